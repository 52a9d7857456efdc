//! Curves over time as SVG, the same turned into PNG, and captions on pictures. Text is set in `DejaVu Sans`, which is
//! part of the program, so that no font need be installed.

use crate::output::put;
use crate::still::{Image, Size};
use anyhow::Context as _;
use plotters::coord::Shift;
use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::path::Path;
use std::sync::Once;
use sutura_scene::export::THREAD_COLORS;

/// One picture of curves.
#[derive(Default)]
pub struct Figure {
    /// Above the picture.
    pub title: String,
    /// Name and unit of the abscissa.
    pub x: (String, String),
    /// Name and unit of the ordinate; an SI unit gets a prefix that suits the numbers.
    pub y: (String, String),
    /// The curves.
    pub lines: Vec<Line>,
    /// Logarithmic ordinate (numbers at or under zero are left out).
    pub log: bool,
    /// Logarithmic abscissa, in the same way.
    pub log_x: bool,
    /// Stretches of the abscissa with names, shaded in turn.
    pub spans: Vec<(String, f64, f64)>,
    /// Ordinates that matter, with what they mean.
    pub marks: Vec<(String, f64)>,
}

/// One curve.
pub struct Line {
    /// Name in the legend.
    pub name: String,
    /// Points in order of the abscissa; those not finite leave a gap.
    pub points: Vec<(f64, f64)>,
    /// Whether the points themselves are drawn, in the color of the curve before, instead of a curve through them.
    pub dots: bool,
}

/// Size as shown on a page.
const SIZE: Size = Size { width: 860, height: 440 };
/// Units of drawing in a pixel of `SIZE`: the drawing code rounds to whole units, which would show as steps.
const FINE: u32 = 8;
/// Pixels of the PNG in a pixel of `SIZE`.
pub const PNG_SCALE: u32 = 2;
const INK: RGBColor = RGBColor(55, 60, 68);
const FAINT: RGBColor = RGBColor(226, 229, 233);
const BAND: RGBColor = RGBColor(246, 247, 249);

impl Figure {
    /// Whether there is anything to draw.
    pub fn is_empty(&self) -> bool {
        !self.lines.iter().any(|l| l.points.iter().filter(|p| self.can_show(p)).count() > 1)
    }

    fn can_show(&self, p: &(f64, f64)) -> bool {
        p.0.is_finite() && p.1.is_finite() && (!self.log || p.1 > 0.0) && (!self.log_x || p.0 > 0.0)
    }

    /// Part of the width at which an abscissa lies.
    fn share(&self, v: f64, (from, to): (f64, f64)) -> f64 {
        let scale = |v: f64| if self.log_x { v.max(f64::MIN_POSITIVE).ln() } else { v };
        (scale(v) - scale(from)) / (scale(to) - scale(from))
    }

    /// Writes `<stem>.svg`.
    pub fn write_svg(&self, stem: &Path) -> anyhow::Result<()> {
        put(&stem.with_extension("svg"), self.svg()?.as_bytes())
    }

    /// Writes `<stem>.png` and `<stem>.svg`.
    pub fn write(&self, stem: &Path) -> anyhow::Result<()> {
        self.files()?.iter().try_for_each(|(ending, bytes)| put(&stem.with_extension(ending), bytes))
    }

    /// The bytes of both files by their endings.
    pub fn files(&self) -> anyhow::Result<[(&'static str, Vec<u8>); 2]> {
        let svg = self.svg()?;
        let png = rasterize(&svg, (SIZE.width, SIZE.height), PNG_SCALE)?.to_png()?;
        Ok([("svg", svg.into_bytes()), ("png", png)])
    }

    fn svg(&self) -> anyhow::Result<String> {
        fonts();
        let drawn = (SIZE.width * FINE, SIZE.height * FINE);
        let mut text = String::new();
        self.draw(&SVGBackend::with_string(&mut text, drawn).into_drawing_area())?;
        let head = |(width, height): (u32, u32)| format!("<svg width=\"{width}\" height=\"{height}\"");
        Ok(text.replacen(&head(drawn), &head((SIZE.width, SIZE.height)), 1))
    }

    fn draw(&self, area: &Area<'_>) -> anyhow::Result<()> {
        let shown = || self.lines.iter().flat_map(|l| l.points.iter().copied()).filter(|p| self.can_show(p));
        let largest = shown().fold(0.0, |a: f64, p| a.max(p.1.abs()));
        let (factor, unit) = si_prefix(largest, &self.y.1);
        let range = |pick: fn(&(f64, f64)) -> f64| {
            shown().map(|p| pick(&p)).fold((f64::INFINITY, f64::NEG_INFINITY), |a, v| (a.0.min(v), a.1.max(v)))
        };
        let (x, y) = (range(|p| p.0), range(|p| p.1));
        let x = match x.1 > x.0 {
            true if self.log_x => (x.0 / 1.1, x.1 * 1.1),
            true => x,
            false => (x.0 - 0.5, x.0 + 0.5),
        };
        let frame = Frame { figure: self, factor, unit, x, largest: largest * factor };
        // Under a factor of eight a logarithmic axis would have hardly a mark.
        if self.log && y.1 > 8.0 * y.0 {
            let (low, high) = (y.0 * factor, y.1 * factor);
            frame.draw_over(area, (low / 1.3..high * 1.6).log_scale())
        } else {
            let (mut low, mut high) = (y.0 * factor, y.1 * factor);
            // An ordinate that begins near zero is shown from zero.
            if low > 0.0 && low < 0.4 * high {
                low = 0.0;
            }
            let margin = if high > low { 0.08 * (high - low) } else { 0.5 * high.abs().max(1e-12) };
            (low, high) = (if low == 0.0 { 0.0 } else { low - margin }, high + 1.5 * margin);
            frame.draw_over(area, low..high)
        }
    }
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

struct Frame<'a> {
    figure: &'a Figure,
    factor: f64,
    unit: String,
    x: (f64, f64),
    /// Largest magnitude of an ordinate, as shown.
    largest: f64,
}

impl Frame<'_> {
    /// Draws over the abscissa that the figure asks for.
    fn draw_over<Y>(&self, area: &Area<'_>, y: Y) -> anyhow::Result<()>
    where
        Y: AsRangedCoord<Value = f64>,
        Y::CoordDescType: Ranged<ValueType = f64> + ValueFormatter<f64>,
    {
        let x = self.x;
        if self.figure.log_x { self.draw(area, (x.0..x.1).log_scale(), y) } else { self.draw(area, x.0..x.1, y) }
    }

    fn draw<X, Y>(&self, area: &Area<'_>, across: X, y: Y) -> anyhow::Result<()>
    where
        X: AsRangedCoord<Value = f64>,
        X::CoordDescType: Ranged<ValueType = f64> + ValueFormatter<f64>,
        Y: AsRangedCoord<Value = f64>,
        Y::CoordDescType: Ranged<ValueType = f64> + ValueFormatter<f64>,
    {
        let Frame { figure, x, factor, .. } = *self;
        let font = |size: u32| ("sans-serif", size * FINE).into_font().color(&INK);
        let px = |v: u32| (v * FINE) as i32;
        let mut chart = ChartBuilder::on(area)
            .margin(px(12))
            .margin_right(px(20))
            .caption(&figure.title, font(16))
            .x_label_area_size(px(42))
            .y_label_area_size(px(66))
            .build_cartesian_2d(across, y)?;
        let (left, top) = chart.plotting_area().get_base_pixel();
        let (width, height) = chart.plotting_area().dim_in_pixel();
        let column =
            |v: f64| left + (f64::from(width) * figure.share(v, x)).clamp(0.0, f64::from(width)).round() as i32;
        let spans = || figure.spans.iter().map(|(name, from, to)| (name, column(*from), column(*to)));

        for (_, a, b) in spans().skip(1).step_by(2) {
            area.draw(&Rectangle::new([(a, top), (b, top + height as i32)], BAND.filled()))?;
        }
        let named =
            |(name, unit): (&str, &str)| if unit.is_empty() { name.to_string() } else { format!("{name} [{unit}]") };
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(FAINT.stroke_width(FINE))
            .axis_style(INK.stroke_width(FINE))
            .x_desc(named((&figure.x.0, &figure.x.1)))
            .y_desc(named((&figure.y.0, &self.unit)))
            .axis_desc_style(font(13))
            .label_style(font(11))
            .x_label_formatter(&|v| number(if v.abs() < 1e-9 * (x.1 - x.0) { 0.0 } else { *v }))
            .y_label_formatter(&|v| number(if v.abs() < 1e-9 * self.largest { 0.0 } else { *v }))
            .set_all_tick_mark_size(px(4))
            .draw()?;
        // A name that does not fit is left out: the report lists the phases.
        for (name, a, b) in spans().filter(|(name, a, b)| name.chars().count() as i32 * px(6) < b - a) {
            let style = font(10).color(&RGBColor(130, 136, 145)).pos(Pos::new(HPos::Center, VPos::Top));
            area.draw(&Text::new(name.clone(), ((a + b) / 2, top + px(4)), style))?;
        }
        for (name, value) in &figure.marks {
            let style = RGBColor(150, 60, 60).stroke_width(FINE);
            let points = [(x.0, value * factor), (x.1, value * factor)];
            let drawn = chart.draw_series(DashedLineSeries::new(points, 6 * FINE, 4 * FINE, style))?;
            drawn.label(name.clone()).legend(move |(lx, ly)| PathElement::new([(lx, ly), (lx + px(16), ly)], style));
        }
        let mut color = 0;
        for (i, line) in figure.lines.iter().enumerate() {
            // Dots belong to the curve before them; of several kinds the first do.
            color += usize::from(i > 0 && (!line.dots || figure.lines[i - 1].dots));
            let [r, g, b] = THREAD_COLORS[color % THREAD_COLORS.len()];
            if line.dots {
                let dots = line
                    .points
                    .iter()
                    .filter(|p| figure.can_show(p))
                    .map(|(x, y)| Circle::new((*x, y * factor), 5 * FINE / 2, RGBColor(r, g, b).filled()));
                let drawn = chart.draw_series(dots)?;
                drawn
                    .label(line.name.clone())
                    .legend(move |(lx, ly)| Circle::new((lx + px(8), ly), 5 * FINE / 2, RGBColor(r, g, b).filled()));
                continue;
            }
            let style = RGBColor(r, g, b).stroke_width(3 * FINE / 2);
            for (k, piece) in line.points.split(|p| !figure.can_show(p)).filter(|p| !p.is_empty()).enumerate() {
                let points = thin(piece, |p| figure.share(p.0, x), SIZE.width as usize)
                    .into_iter()
                    .map(|(x, y)| (x, y * factor));
                let drawn = chart.draw_series(LineSeries::new(points, style))?;
                if k == 0 {
                    drawn
                        .label(line.name.clone())
                        .legend(move |(lx, ly)| PathElement::new([(lx, ly), (lx + px(16), ly)], style));
                }
            }
        }
        if figure.lines.len() + figure.marks.len() > 1 {
            chart
                .configure_series_labels()
                .position(self.emptiest_corner())
                .margin(px(18))
                .legend_area_size(px(22))
                .background_style(WHITE.mix(0.85))
                .border_style(FAINT.stroke_width(FINE))
                .label_font(font(11))
                .draw()?;
        }
        area.present()?;
        Ok(())
    }

    /// Where the legend hides the fewest points of the curves.
    fn emptiest_corner(&self) -> SeriesLabelPosition {
        use SeriesLabelPosition::{LowerLeft, LowerRight, MiddleLeft, MiddleRight, UpperLeft, UpperRight};
        let figure = self.figure;
        let scale = |v: f64| if figure.log { v.max(f64::MIN_POSITIVE).ln() } else { v };
        let points: Vec<(f64, f64)> = figure
            .lines
            .iter()
            .flat_map(|l| l.points.iter().copied())
            .filter(|p| figure.can_show(p))
            .map(|p| (p.0, scale(p.1)))
            .collect();
        let (low, high) = points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |a, p| (a.0.min(p.1), a.1.max(p.1)));
        let share = |p: &(f64, f64)| (figure.share(p.0, self.x), (p.1 - low) / (high - low).max(f64::MIN_POSITIVE));
        let hidden = |right: bool, from: f64, to: f64| {
            points
                .iter()
                .map(share)
                .filter(|(u, v)| (if right { *u > 0.75 } else { *u < 0.25 }) && (from..to).contains(v))
                .count()
        };
        let places = [
            (UpperRight, true, 0.6, 1.1),
            (UpperLeft, false, 0.6, 1.1),
            (LowerRight, true, -0.1, 0.4),
            (LowerLeft, false, -0.1, 0.4),
        ];
        let between = [(MiddleRight, true, 0.3, 0.7), (MiddleLeft, false, 0.3, 0.7)];
        places
            .into_iter()
            .chain(between)
            .min_by_key(|(_, right, from, to)| hidden(*right, *from, *to))
            .map_or(UpperRight, |p| p.0)
    }
}

/// At most four points (first, least, greatest, last) for each of `columns` columns, by their share of the width: what
/// the eye sees of the curve, in a small file.
fn thin(points: &[(f64, f64)], across: impl Fn(&(f64, f64)) -> f64, columns: usize) -> Vec<(f64, f64)> {
    if points.len() <= 4 * columns {
        return points.to_vec();
    }
    let column = |p: &(f64, f64)| (across(p) * columns as f64) as usize;
    let mut out = Vec::with_capacity(4 * columns);
    for piece in points.chunk_by(|a, b| column(a) == column(b)) {
        let by = |a: &usize, b: &usize| piece[*a].1.total_cmp(&piece[*b].1);
        let mut keep =
            [0, (0..piece.len()).min_by(by).unwrap_or(0), (0..piece.len()).max_by(by).unwrap_or(0), piece.len() - 1];
        keep.sort_unstable();
        let mut last = None;
        for k in keep {
            if last != Some(k) {
                out.push(piece[k]);
            }
            last = Some(k);
        }
    }
    out
}

/// Factor and unit such that the largest number is between 1 and 1000, for units that take a prefix.
fn si_prefix(largest: f64, unit: &str) -> (f64, String) {
    let takes_prefix = ["m", "N", "J", "N m", "Pa", "m/s", "s", "W"].contains(&unit);
    if !takes_prefix || largest == 0.0 {
        return (1.0, unit.to_string());
    }
    let prefixes = [("n", 1e9), ("µ", 1e6), ("m", 1e3), ("", 1.0), ("k", 1e-3), ("M", 1e-6), ("G", 1e-9)];
    let (prefix, factor) = prefixes.into_iter().rev().find(|(_, f)| largest * f >= 0.9995).unwrap_or(prefixes[0]);
    (factor, format!("{prefix}{unit}"))
}

/// A number as short as it can be read back to six digits.
pub fn number(v: f64) -> String {
    if v == 0.0 {
        return "0".into();
    }
    let exponent = v.abs().log10().floor();
    if !(-4.0..6.0).contains(&exponent) {
        return format!("{v:.2e}");
    }
    let text = format!("{v:.*}", (5.0 - exponent).clamp(0.0, 9.0) as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
}

/// Writes `text` in the lower left corner of a picture and a scale bar of a round length in the lower right one;
/// `width` is that of the picture at the point looked at \[m\].
pub fn caption(image: &mut Image, text: &str, width: f64) -> anyhow::Result<()> {
    let (columns, rows) = (f64::from(image.size.width), f64::from(image.size.height));
    let unit = rows / 100.0;
    let bar = round_length(0.25 * width);
    let (from, right, bottom) = (columns - 3.0 * unit - bar / width * columns, columns - 3.0 * unit, rows - 3.0 * unit);
    let label = if bar >= 1e-3 { format!("{} mm", number(bar * 1e3)) } else { format!("{} µm", number(bar * 1e6)) };
    let escaped = text.replace('&', "&amp;").replace('<', "&lt;");
    let svg = format!(
        r##"<svg xmlns="http://www.w3.org/2000/svg" width="{columns}" height="{rows}" fill="#373c44" font-family="sans-serif" font-size="{}">
<text x="{}" y="{bottom}">{escaped}</text>
<rect x="{from}" y="{}" width="{}" height="{}"/>
<text x="{}" y="{}" text-anchor="middle">{label}</text>
</svg>"##,
        2.7 * unit,
        3.0 * unit,
        bottom - 0.5 * unit,
        right - from,
        0.5 * unit,
        0.5 * (from + right),
        bottom - 1.8 * unit,
    );
    overlay(image, &svg, 1.0)
}

/// An SVG text of this size as a picture on white, `fine` times as fine.
pub fn rasterize(svg: &str, (width, height): (u32, u32), fine: u32) -> anyhow::Result<Image> {
    let size = Size { width: width * fine, height: height * fine };
    let mut image = Image { size, rgb: vec![255; (3 * size.width * size.height) as usize] };
    overlay(&mut image, svg, f64::from(fine))?;
    Ok(image)
}

/// Draws an SVG text over a picture.
fn overlay(image: &mut Image, svg: &str, scale: f64) -> anyhow::Result<()> {
    use resvg::{tiny_skia, usvg};
    let mut options = usvg::Options::default();
    let fonts = options.fontdb_mut();
    fonts.load_font_data(dejavu::sans::regular().to_vec());
    fonts.set_sans_serif_family("DejaVu Sans");
    let tree = usvg::Tree::from_str(svg, &options).context("cannot draw text over a picture")?;
    let mut layer = tiny_skia::Pixmap::new(image.size.width, image.size.height).context("a picture needs a size")?;
    resvg::render(&tree, tiny_skia::Transform::from_scale(scale as f32, scale as f32), &mut layer.as_mut());
    for (under, over) in image.rgb.chunks_mut(3).zip(layer.pixels()) {
        let keep = 255 - u32::from(over.alpha());
        for (u, o) in under.iter_mut().zip([over.red(), over.green(), over.blue()]) {
            // The layer's colors are already multiplied by its opacity.
            *u = ((u32::from(*u) * keep + 127) / 255 + u32::from(o)).min(255) as u8;
        }
    }
    Ok(())
}

/// The largest of 1, 2, 5 times a power of ten that is no longer than `limit`.
fn round_length(limit: f64) -> f64 {
    let power = 10_f64.powf(limit.log10().floor());
    [5.0, 2.0, 1.0].into_iter().map(|k| k * power).find(|l| *l <= limit).unwrap_or(power)
}

fn fonts() {
    static DONE: Once = Once::new();
    DONE.call_once(|| {
        // An error would be a damaged font in the program itself; the tests draw text and would show it.
        let _ = plotters::style::register_font("sans-serif", FontStyle::Normal, dejavu::sans::regular());
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_ends_and_extremes() {
        let points: Vec<(f64, f64)> =
            (0..100_000).map(|i| (f64::from(i), if i == 54_321 { 9.0 } else { f64::from(i % 7) })).collect();
        let thinned = thin(&points, |p| p.0 / 99_999.0, 500);
        assert!(thinned.len() <= 4 * 501);
        assert_eq!((thinned[0], thinned[thinned.len() - 1]), (points[0], points[99_999]));
        assert!(thinned.contains(&(54_321.0, 9.0)), "a single spike is what one looks for");
    }

    #[test]
    fn numbers_are_short_and_prefixes_suit() {
        assert_eq!(
            [number(0.1 + 0.2), number(1200.0), number(1e-7), number(-2.5), number(0.0)],
            ["0.3", "1200", "1.00e-7", "-2.5", "0"]
        );
        assert_eq!(si_prefix(0.02, "N"), (1e3, "mN".into()));
        assert_eq!(si_prefix(2.0, "N"), (1.0, "N".into()));
        assert_eq!(si_prefix(1e-5, ""), (1.0, String::new()));
        assert_eq!(round_length(0.0137), 0.01);
        assert_eq!(round_length(0.0021), 0.002);
    }
}
