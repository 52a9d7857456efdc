//! Still pictures of threads and shapes: rays cast at capsules, cylinders, boxes and triangles, with soft shadow and
//! ambient occlusion, so that over and under at a crossing can be told. A picture is a function of its input alone.
//!
//! The thread is drawn as a tube about a smooth curve near its polyline, not as the polyline's capsules (`smooth` in
//! `stage`).

mod camera;
mod cast;
mod stage;

pub use camera::{Camera, Look, best_direction, knot_region};

use stage::{Dice, Stage, look_along};
use std::path::Path;
use std::sync::Mutex;
use sutura::glam::DVec3;
use sutura::{Geometry, Pose};

/// Linear light, red green blue.
pub type Color = DVec3;

/// What is to be seen.
#[derive(Default)]
pub struct Subject {
    /// The threads.
    pub tubes: Vec<Tube>,
    /// What they touch.
    pub solids: Vec<Solid>,
}

/// A thread.
pub struct Tube {
    /// Centerline \[m\].
    pub points: Vec<DVec3>,
    /// Radius \[m\].
    pub radius: f64,
}

/// A shape.
pub struct Solid {
    /// In its own frame.
    pub geometry: Geometry,
    /// Where it is.
    pub pose: Pose,
}

/// Size of a picture in pixels.
#[derive(Clone, Copy)]
pub struct Size {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

/// A picture, 8 bits each of red, green and blue.
pub struct Image {
    /// Size in pixels.
    pub size: Size,
    /// Row by row from the top left.
    pub rgb: Vec<u8>,
}

impl Image {
    /// Writes a PNG file.
    pub fn write(&self, path: &Path) -> anyhow::Result<()> {
        crate::output::put(path, &self.to_png()?)
    }

    /// The bytes of a PNG file.
    pub fn to_png(&self) -> anyhow::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.size.width, self.size.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&self.rgb)?;
        writer.finish()?;
        Ok(bytes)
    }
}

/// Cells of the 4 x 4 grid of a pixel in the order in which they are sampled: first four that share no row and no
/// column.
const SAMPLE_ORDER: [u32; 16] = [1, 7, 8, 14, 2, 4, 11, 13, 0, 6, 9, 15, 3, 5, 10, 12];

/// Samples of a pixel that looks like its neighbors.
const FEW: usize = 4;

/// Draws the subject: a few samples in each pixel, then more where neighbors differ.
pub fn render(subject: &Subject, camera: &Camera, size: Size) -> Image {
    let painter = Painter { stage: Stage::new(subject), camera, size };
    let (columns, rows) = (size.width as usize, size.height as usize);
    let coarse = painter.each_pixel(|x, y| painter.sum(x, y, 0..FEW) / FEW as f64);
    let differs = |x: usize, y: usize| {
        let (mut low, mut high) = (Color::INFINITY, Color::NEG_INFINITY);
        for v in y.saturating_sub(1)..(y + 2).min(rows) {
            for color in &coarse[v * columns + x.saturating_sub(1)..v * columns + (x + 2).min(columns)] {
                let seen = color.map(|c| c.max(0.0).sqrt());
                (low, high) = (low.min(seen), high.max(seen));
            }
        }
        (high - low).max_element() > 0.02
    };
    let all = SAMPLE_ORDER.len();
    let fine = painter.each_pixel(|x, y| {
        let few = coarse[y * columns + x];
        if differs(x, y) { (few * FEW as f64 + painter.sum(x, y, FEW..all)) / all as f64 } else { few }
    });
    Image { size, rgb: fine.into_iter().flat_map(encode).collect() }
}

struct Painter<'a> {
    stage: Stage,
    camera: &'a Camera,
    size: Size,
}

impl Painter<'_> {
    /// The value of `paint` at each pixel, row by row, on all cores.
    fn each_pixel(&self, paint: impl Fn(usize, usize) -> Color + Sync) -> Vec<Color> {
        let columns = self.size.width as usize;
        let mut colors = vec![Color::ZERO; columns * self.size.height as usize];
        let rows = Mutex::new(colors.chunks_mut(columns).enumerate());
        let workers = std::thread::available_parallelism().map_or(1, usize::from);
        std::thread::scope(|scope| {
            for _ in 0..workers {
                scope.spawn(|| {
                    loop {
                        let next = rows.lock().expect("no worker panics while it holds the rows").next();
                        let Some((y, row)) = next else { break };
                        for (x, color) in row.iter_mut().enumerate() {
                            *color = paint(x, y);
                        }
                    }
                });
            }
        });
        colors
    }

    /// Sum over some of the samples of a pixel.
    fn sum(&self, x: usize, y: usize, samples: core::ops::Range<usize>) -> Color {
        let mut dice = Dice::new(samples.start);
        let place = |at: usize, cell: u32, count: u32| {
            2.0 * (at as f64 + (f64::from(cell) + 0.5) / 4.0) / f64::from(count) - 1.0
        };
        let one = |k: u32| {
            let (u, v) = (place(x, k % 4, self.size.width), -place(y, k / 4, self.size.height));
            look_along(&self.stage, self.camera, &self.camera.ray(u, v), v, &mut dice)
        };
        SAMPLE_ORDER[samples].iter().copied().map(one).sum()
    }
}

fn encode(c: Color) -> [u8; 3] {
    let one = |v: f64| (255.0 * v.clamp(0.0, 1.0).powf(1.0 / 2.2)).round() as u8;
    [one(c.x), one(c.y), one(c.z)]
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Size = Size { width: 48, height: 48 };

    /// Two threads that cross at the origin, the first along x at height `z` over the second along y.
    fn crossing(z: f64) -> Subject {
        let tube = |along: DVec3, at: DVec3| Tube {
            points: (-4..=4).map(|i| along * (f64::from(i) * 1e-3) + at).collect(),
            radius: 3e-4,
        };
        Subject { tubes: vec![tube(DVec3::X, DVec3::Z * z), tube(DVec3::Y, DVec3::ZERO)], solids: Vec::new() }
    }

    fn from_above(subject: &Subject, orthographic: bool) -> Image {
        let look = Look {
            direction: Some(-DVec3::Z),
            up: Some(DVec3::Y),
            at: Some(DVec3::ZERO),
            width: Some(4e-3),
            orthographic,
        };
        render(subject, &Camera::fit(&look, &[], 1e-4, SIZE), SIZE)
    }

    /// Blue less red at a pixel: positive on the first thread's color, negative on the second's.
    fn blueness(image: &Image, x: u32, y: u32) -> i32 {
        let at = (3 * (y * image.size.width + x)) as usize;
        i32::from(image.rgb[at + 2]) - i32::from(image.rgb[at])
    }

    #[test]
    fn the_upper_thread_covers_the_lower_one() {
        for orthographic in [false, true] {
            let (over, under) = (from_above(&crossing(7e-4), orthographic), from_above(&crossing(-7e-4), orthographic));
            // The colors differ by over 100 of 255; shading and fading take less than half of that.
            assert!(blueness(&over, 24, 24) > 40, "the first thread is over: {}", blueness(&over, 24, 24));
            assert!(blueness(&under, 24, 24) < -40, "the first thread is under: {}", blueness(&under, 24, 24));
            // Beside the crossing each is seen: x runs to the right, y upward.
            assert!(blueness(&over, 44, 24) > 40 && blueness(&over, 24, 4) < -40);
        }
    }

    #[test]
    fn a_picture_has_the_same_bytes_each_time() {
        assert!(
            from_above(&crossing(7e-4), false).rgb == from_above(&crossing(7e-4), false).rgb,
            "whatever thread draws which row"
        );
    }

    #[test]
    fn the_knot_region_is_where_thread_meets_thread() {
        let crossing = crossing(7e-4);
        let points = knot_region(&crossing.tubes);
        assert!(!points.is_empty() && points.iter().all(|p| p.length() < 3e-3), "around the origin: {points:?}");
        let straight = [Tube { points: (0..50).map(|i| DVec3::X * (f64::from(i) * 1e-3)).collect(), radius: 1e-4 }];
        assert!(knot_region(&straight).is_empty(), "nothing to see on a straight thread");
    }
}
