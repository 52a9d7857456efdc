//! Maps of hold or slip as a picture: one small grid for each thread and knot. SVG, and the same as PNG; text is set in
//! `DejaVu Sans`, which is part of the program.

use anyhow::Context as _;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::path::Path;
use std::sync::Once;

/// What became of one case.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cell {
    /// It held.
    Holds,
    /// It slipped, after this load \[N\].
    Slips(f64),
    /// It came open, after this load \[N\].
    Opens(f64),
    /// It was given up.
    NotFinished,
    /// It was not run.
    Missing,
}

impl Cell {
    /// As an entry of a table.
    pub fn words(&self) -> String {
        match self {
            Cell::Holds => "holds".into(),
            Cell::Slips(n) => format!("slips {n:.2} N"),
            Cell::Opens(n) if *n > 0.0 => format!("opens {n:.2} N"),
            Cell::Opens(_) => "opens".into(),
            Cell::NotFinished => "not finished".into(),
            Cell::Missing => String::new(),
        }
    }

    fn mark(&self) -> String {
        match self {
            Cell::Holds => "holds".into(),
            Cell::Slips(n) | Cell::Opens(n) => format!("{n:.2}"),
            Cell::NotFinished => "?".into(),
            Cell::Missing => String::new(),
        }
    }

    fn color(&self) -> RGBColor {
        match self {
            Cell::Holds => RGBColor(120, 190, 130),
            Cell::Slips(_) => RGBColor(245, 200, 120),
            Cell::Opens(_) => RGBColor(225, 120, 110),
            Cell::NotFinished => RGBColor(200, 204, 210),
            Cell::Missing => RGBColor(246, 247, 249),
        }
    }
}

/// One map.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// Above it.
    pub title: String,
    /// Name and levels of the columns.
    pub x: (String, Vec<String>),
    /// Name and levels of the rows, from below.
    pub y: (String, Vec<String>),
    /// Rows of cells.
    pub cells: Vec<Vec<Cell>>,
}

/// Maps beside one another.
const ACROSS: usize = 4;
/// A cell, the room to the left of a map, above it and under it, and that of the legend, in pixels.
const CELL: (i32, i32) = (36, 26);
const LEFT: i32 = 52;
const TOP: i32 = 28;
const UNDER: i32 = 40;
const LEGEND: i32 = 34;
/// Pixels of the PNG in one of the drawing.
const PNG_SCALE: f32 = 2.0;
const INK: RGBColor = RGBColor(55, 60, 68);

/// Writes `<stem>.svg` and `<stem>.png`.
pub fn draw(grids: &[Grid], stem: &Path) -> anyhow::Result<()> {
    static FONT: Once = Once::new();
    FONT.call_once(|| {
        // An error would be a damaged font in the program itself; the test draws text and would show it.
        let _ = plotters::style::register_font("sans-serif", FontStyle::Normal, dejavu::sans::regular());
    });
    let (columns, rows) = grids.iter().fold((1, 1), |a, g| (a.0.max(g.x.1.len() as i32), a.1.max(g.y.1.len() as i32)));
    let panel = (LEFT + columns * CELL.0 + 14, TOP + rows * CELL.1 + UNDER);
    let size = (panel.0 * ACROSS as i32, panel.1 * grids.len().div_ceil(ACROSS) as i32 + LEGEND);
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, (size.0 as u32, size.1 as u32)).into_drawing_area();
        area.fill(&WHITE)?;
        for (k, grid) in grids.iter().enumerate() {
            panel_of(&area, grid, (LEFT + panel.0 * (k % ACROSS) as i32, TOP + panel.1 * (k / ACROSS) as i32))?;
        }
        let kinds = [
            (Cell::Holds, "holds"),
            (Cell::Slips(0.0), "slips, after this load [N]"),
            (Cell::Opens(0.0), "opens"),
            (Cell::NotFinished, "not finished"),
        ];
        for (k, (cell, name)) in kinds.into_iter().enumerate() {
            let (x, y) = (LEFT + 220 * k as i32, size.1 - LEGEND / 2);
            area.draw(&Rectangle::new([(x, y - 7), (x + 18, y + 7)], cell.color().filled()))?;
            area.draw(&Text::new(name, (x + 26, y), font(12, HPos::Left)))?;
        }
        area.present()?;
    }
    let svg = stem.with_extension("svg");
    std::fs::write(&svg, &text).with_context(|| format!("cannot write {}", svg.display()))?;
    png(&text, size, &stem.with_extension("png"))
}

fn font(size: u32, h: HPos) -> TextStyle<'static> {
    ("sans-serif", size).into_font().color(&INK).pos(Pos::new(h, VPos::Center))
}

fn panel_of(
    area: &DrawingArea<SVGBackend<'_>, plotters::coord::Shift>,
    grid: &Grid,
    (left, top): (i32, i32),
) -> anyhow::Result<()> {
    let (columns, rows) = (grid.x.1.len() as i32, grid.y.1.len() as i32);
    area.draw(&Text::new(grid.title.clone(), (left + columns * CELL.0 / 2, top - 12), font(13, HPos::Center)))?;
    for (row, cells) in grid.cells.iter().enumerate() {
        for (column, cell) in cells.iter().enumerate() {
            let (x, y) = (left + column as i32 * CELL.0, top + (rows - 1 - row as i32) * CELL.1);
            area.draw(&Rectangle::new([(x + 1, y + 1), (x + CELL.0 - 1, y + CELL.1 - 1)], cell.color().filled()))?;
            area.draw(&Text::new(cell.mark(), (x + CELL.0 / 2, y + CELL.1 / 2), font(10, HPos::Center)))?;
        }
    }
    let bottom = top + rows * CELL.1;
    for (column, level) in grid.x.1.iter().enumerate() {
        area.draw(&Text::new(
            level.clone(),
            (left + column as i32 * CELL.0 + CELL.0 / 2, bottom + 9),
            font(10, HPos::Center),
        ))?;
    }
    for (row, level) in grid.y.1.iter().enumerate() {
        area.draw(&Text::new(
            level.clone(),
            (left - 5, top + (rows - 1 - row as i32) * CELL.1 + CELL.1 / 2),
            font(10, HPos::Right),
        ))?;
    }
    area.draw(&Text::new(grid.x.0.clone(), (left + columns * CELL.0 / 2, bottom + 23), font(11, HPos::Center)))?;
    let turned = font(11, HPos::Center).transform(FontTransform::Rotate270);
    area.draw(&Text::new(grid.y.0.clone(), (left - 36, top + rows * CELL.1 / 2), turned))?;
    Ok(())
}

/// Turns an SVG text into a PNG file.
fn png(svg: &str, size: (i32, i32), path: &Path) -> anyhow::Result<()> {
    use resvg::{tiny_skia, usvg};
    let mut options = usvg::Options::default();
    let fonts = options.fontdb_mut();
    fonts.load_font_data(dejavu::sans::regular().to_vec());
    fonts.set_sans_serif_family("DejaVu Sans");
    let tree = usvg::Tree::from_str(svg, &options).context("cannot read the picture")?;
    let (width, height) = ((size.0 as f32 * PNG_SCALE) as u32, (size.1 as f32 * PNG_SCALE) as u32);
    let mut image = tiny_skia::Pixmap::new(width, height).context("a picture needs a size")?;
    resvg::render(&tree, tiny_skia::Transform::from_scale(PNG_SCALE, PNG_SCALE), &mut image.as_mut());
    let file = std::fs::File::create(path).with_context(|| format!("cannot write {}", path.display()))?;
    let mut encoder = png::Encoder::new(std::io::BufWriter::new(file), width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::High);
    let rgb: Vec<u8> = image.pixels().iter().flat_map(|p| [p.red(), p.green(), p.blue()]).collect();
    encoder.write_header()?.write_image_data(&rgb)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_is_drawn_with_its_words() {
        let folder = tempfile::tempdir().unwrap();
        let grid = Grid {
            title: "silk, square".into(),
            x: ("mu".into(), vec!["0.1".into(), "0.2".into()]),
            y: ("draw [N]".into(), vec!["1".into()]),
            cells: vec![vec![Cell::Slips(0.43), Cell::Holds]],
        };
        draw(&[grid], &folder.path().join("m")).unwrap();
        let svg = std::fs::read_to_string(folder.path().join("m.svg")).unwrap();
        for word in ["silk, square", "0.43", "holds", "draw [N]"] {
            assert!(svg.contains(word), "{word}");
        }
        // The middle of the first cell of the PNG has the color of slip but for the text: look left of it.
        let decoder =
            png::Decoder::new(std::io::BufReader::new(std::fs::File::open(folder.path().join("m.png")).unwrap()));
        let mut reader = decoder.read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        let (x, y) = (2 * (LEFT + 3) as usize, 2 * (TOP + 4) as usize);
        let at = 3 * (y * info.width as usize + x);
        assert_eq!(pixels[at..at + 3], [245, 200, 120]);
    }
}
