//! Where a picture is taken from: the camera, which way it looks best, and which part of the threads is worth a closer
//! look.

use super::cast::Ray;
use super::stage::Stage;
use super::{Size, Subject, Tube};
use core::f64::consts::{PI, TAU};
use sutura::glam::DVec3;

/// How to look at it. What is `None` is chosen to suit the subject.
#[derive(Clone, Default)]
pub struct Look {
    /// Direction in which the eye looks.
    pub direction: Option<DVec3>,
    /// Direction that is up in the picture.
    pub up: Option<DVec3>,
    /// Point in the middle of the picture \[m\].
    pub at: Option<DVec3>,
    /// Width of the picture at that point \[m\].
    pub width: Option<f64>,
    /// Parallel rays instead of rays from an eye.
    pub orthographic: bool,
}

/// Half the opening angle of the perspective, as a tangent: narrow, so that a thread's thickness hardly depends on its
/// depth.
const HALF_FIELD: f64 = 0.2;

/// The eye, or the screen of parallel rays.
#[derive(Clone, Debug)]
pub struct Camera {
    pub(super) at: DVec3,
    pub(super) right: DVec3,
    pub(super) up: DVec3,
    pub(super) forward: DVec3,
    /// Half the picture's width at `at` \[m\].
    pub(super) half_width: f64,
    aspect: f64,
    distance: f64,
    orthographic: bool,
}

impl Camera {
    /// The camera that `look` asks for, fitted to `points` (with `radius` around each) where it asks for nothing.
    pub fn fit(look: &Look, points: &[DVec3], radius: f64, size: Size) -> Camera {
        let forward = look.direction.unwrap_or(DVec3::new(-0.3, 0.8, -0.52)).normalize_or(DVec3::Y);
        let up = look.up.unwrap_or(DVec3::Z);
        let up = if up.cross(forward).length() > 0.05 * up.length() { up } else { forward.any_orthonormal_vector() };
        let right = forward.cross(up).normalize();
        let up = right.cross(forward);
        let aspect = f64::from(size.width) / f64::from(size.height);
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for p in points {
            let p = DVec3::new(p.dot(right), p.dot(up), p.dot(forward));
            (low, high) = (low.min(p - radius), high.max(p + radius));
        }
        if points.is_empty() {
            (low, high) = (DVec3::splat(-0.01), DVec3::splat(0.01));
        }
        let middle = (low + high) * 0.5;
        let at = look.at.unwrap_or(right * middle.x + up * middle.y + forward * middle.z);
        // Nearer things look larger: what lies in front of `at` needs a wider picture there.
        let half_width = look.width.map_or_else(
            || {
                let need = points.iter().map(|p| {
                    let d = *p - at;
                    let across = (d.dot(right).abs() + radius).max((d.dot(up).abs() + radius) * aspect);
                    if look.orthographic { across } else { across - d.dot(forward) * HALF_FIELD }
                });
                1.08 * need.fold(4.0 * radius, f64::max)
            },
            |w| 0.5 * w,
        );
        Camera {
            at,
            right,
            up,
            forward,
            half_width,
            aspect,
            distance: half_width / HALF_FIELD,
            orthographic: look.orthographic,
        }
    }

    /// Width of the picture at the point looked at \[m\].
    pub fn width(&self) -> f64 {
        2.0 * self.half_width
    }

    /// Through a point of the screen, both coordinates from -1 to 1.
    pub(super) fn ray(&self, x: f64, y: f64) -> Ray {
        let screen = self.right * (x * self.half_width) + self.up * (y * self.half_width / self.aspect);
        if self.orthographic {
            Ray { origin: self.at + screen - self.forward * self.distance, direction: self.forward }
        } else {
            Ray {
                origin: self.at - self.forward * self.distance,
                direction: (screen + self.forward * self.distance).normalize(),
            }
        }
    }

    fn toward(&self, p: DVec3) -> Ray {
        let back =
            if self.orthographic { -self.forward } else { (self.at - self.forward * self.distance - p).normalize() };
        Ray { origin: p, direction: back }
    }
}

/// Which way to look so that most of `points` is seen and spread wide: the best of a fixed set of directions.
pub fn best_direction(subject: &Subject, points: &[DVec3], up: DVec3) -> DVec3 {
    let stage = Stage::new(subject);
    let n = points.len().max(1) as f64;
    let middle = points.iter().sum::<DVec3>() / n;
    let size = points.iter().map(|p| (*p - middle).length()).fold(1e-9, f64::max);
    let (x, y) = (up.any_orthonormal_vector(), up.cross(up.any_orthonormal_vector()));
    let mut best = (f64::NEG_INFINITY, x);
    for height in [0.25, 0.55, 0.9, 1.35] {
        for k in 0..16 {
            let turn = TAU * (f64::from(k) + 0.35) / 16.0;
            let back = (x * turn.cos() + y * turn.sin()) * f64::cos(height) + up * f64::sin(height);
            let camera = Camera::fit(
                &Look { direction: Some(-back), up: Some(up), ..Look::default() },
                points,
                0.02 * size,
                Size { width: 4, height: 3 },
            );
            let mut seen = 0.0;
            let mut spread = [0.0; 3];
            for p in points.iter().step_by(1 + points.len() / 200) {
                let ray = camera.toward(*p);
                let start = Ray { origin: *p + ray.direction * (0.02 * size), ..ray };
                let clear = !stage.blocked(&start, f64::INFINITY)
                    && stage.floors.iter().all(|f| ray.direction.dot(f.normal) > 0.0);
                seen += if clear { 1.0 } else { 0.0 };
                let (u, v) = ((*p - middle).dot(camera.right), (*p - middle).dot(camera.up));
                spread = [spread[0] + u * u, spread[1] + v * v, spread[2] + 1.0];
            }
            // Wide rather than high suits the page; half of the score is being seen at all.
            let score = seen / spread[2]
                + 0.6 * (spread[0] / spread[2]).sqrt() / size
                + 0.5 * (spread[1] / spread[2]).sqrt() / size;
            if score > best.0 {
                best = (score, -back);
            }
        }
    }
    best.1
}

/// The part of the threads worth a closer look: points where thread lies near other thread (or near itself, `pi` radii
/// along it left out); where there is none, around the sharpest bend; nothing when the threads are nearly straight.
pub fn knot_region(tubes: &[Tube]) -> Vec<DVec3> {
    let all: Vec<(usize, f64, DVec3, f64)> = tubes
        .iter()
        .enumerate()
        .flat_map(|(k, tube)| {
            let mut arc = 0.0;
            let mut last = tube.points.first().copied().unwrap_or(DVec3::ZERO);
            tube.points.iter().map(move |p| {
                arc += (*p - last).length();
                last = *p;
                (k, arc, *p, tube.radius)
            })
        })
        .collect();
    let near = |factor: f64| {
        let touching = |(k, s, p, r): &(usize, f64, DVec3, f64)| {
            all.iter().any(|(k2, s2, p2, r2)| {
                let reach = factor * (r + r2);
                (p2 - p).length_squared() < reach * reach
                    && (k != k2 || (s - s2).abs() > PI * (factor + 1.0) * r.max(*r2))
            })
        };
        all.iter().filter(|a| touching(a)).map(|a| a.2).collect::<Vec<_>>()
    };
    let mut points = near(2.0);
    if points.len() < 4 {
        points = near(4.0);
    }
    if points.len() < 4 {
        let bend = |w: &[DVec3]| (w[0] - w[1] * 2.0 + w[2]).length() * 4.0 / (w[2] - w[0]).length_squared();
        let bends = tubes.iter().flat_map(|t| t.points.windows(3).map(move |w| (bend(w) * t.radius, w[1], t.radius)));
        // Bends of more than fifty radii are no sight.
        if let Some((_, p, r)) = bends.filter(|b| b.0 > 0.02).max_by(|a, b| a.0.total_cmp(&b.0)) {
            points = all.iter().filter(|a| (a.2 - p).length() < 30.0 * r).map(|a| a.2).collect();
        }
    }
    // The far tenth is left out: a thread that brushes another far away is not the knot.
    let middle = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
    points.sort_by(|a, b| (*a - middle).length().total_cmp(&(*b - middle).length()));
    points.truncate((points.len() * 9).div_ceil(10));
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_fits_into_the_picture() {
        let points: Vec<DVec3> =
            (0..200).map(|i| f64::from(i) * 0.1).map(|t| DVec3::new(t.cos(), 2.0 * t.sin(), 0.3 * t) * 1e-2).collect();
        for orthographic in [false, true] {
            let look = Look { direction: Some(DVec3::new(0.4, 0.7, -0.3)), orthographic, ..Look::default() };
            let camera = Camera::fit(&look, &points, 1e-3, Size { width: 400, height: 300 });
            let mut widest = 0.0_f64;
            for p in &points {
                let d = *p - camera.at;
                let depth = d.dot(camera.forward);
                let scale = if orthographic { 1.0 } else { camera.distance / (camera.distance + depth) };
                let (u, v) = (
                    d.dot(camera.right) * scale / camera.half_width,
                    d.dot(camera.up) * scale * camera.aspect / camera.half_width,
                );
                assert!(u.abs() < 1.0 && v.abs() < 1.0, "{u} {v}");
                widest = widest.max(u.abs()).max(v.abs());
            }
            // A margin of a radius and a twelfth, no more than a third of the picture wasted.
            assert!(widest > 0.66, "{widest}");
        }
    }
}
