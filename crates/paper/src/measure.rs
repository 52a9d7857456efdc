//! What is measured of a thread, and how numbers are said.

use cpu_time::ThreadTime;
use std::f64::consts::PI;
use sutura::glam::{DQuat, DVec3};
use sutura_rivals::{Rod, Scene, Shape, Solver};

/// A frame \[s\].
pub const FRAME: f64 = 1.0 / 60.0;
/// Length of most threads of the paper \[m\].
pub const LENGTH: f64 = 0.15;
/// Gravity \[m/s^2\].
pub const GRAVITY: f64 = 9.81;
/// The size at which the published numbers come out, over the true size (15 m for 15 cm). The paper's solver knows
/// lengths only by g dt^2 over them: a hundredth of gravity at true size is the same to it.
pub const EFFECTIVE: f64 = 100.0;

/// A thread of 0.3 mm, 2 GPa, Poisson's ratio 0.4: a monofilament of size 2-0 or so. The paper names neither.
pub fn thread(start: Shape, rest: Shape) -> Rod {
    Rod { start, rest, radius: 0.15e-3, young: 2e9, shear: 2e9 / 2.8, density: 1150.0 }
}

/// A straight thread along x from `from` to `to`, with d1 up, and its frame.
pub fn level(from: f64, to: f64, n: usize) -> (Shape, DQuat) {
    let shape = Shape::straight(DVec3::X * from, DVec3::X * to, n, DVec3::Z);
    let frame = shape.frames[0];
    (shape, frame)
}

/// Frame by frame until `until` \[s\]; the median CPU time of a frame \[ms\]. `look` sees the state after each frame,
/// outside of the time.
pub fn play(solver: &mut dyn Solver, frame: f64, frames: usize, mut look: impl FnMut(usize, &dyn Solver)) -> f64 {
    let mut ms = Vec::with_capacity(frames);
    for k in 1..=frames {
        let clock = ThreadTime::now();
        solver.step(frame);
        ms.push(1e3 * clock.elapsed().as_secs_f64());
        look(k, solver);
    }
    median(ms)
}

/// Median.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Length of a polyline.
pub fn length(points: &[DVec3]) -> f64 {
    points.windows(2).map(|p| p[0].distance(p[1])).sum()
}

/// Whether all is still a number, and not farther away than a thousand times `size`.
pub fn sane(points: &[DVec3], size: f64) -> bool {
    points.iter().all(|p| p.is_finite() && p.length() < 1e3 * size)
}

/// Out-of-plane distance about the axis x: of all planes through the axis, the one is taken from which the farthest
/// point is nearest.
pub fn out_of_plane(points: &[DVec3]) -> f64 {
    let widest = |turn: f64| {
        let (s, c) = libm::sincos(turn);
        points.iter().map(|p| (p.z * c - p.y * s).abs()).fold(0.0, f64::max)
    };
    // The width is a maximum of sinusoids: between neighbors of so fine a grid it has one minimum.
    let n = 720;
    let step = PI / f64::from(n);
    let best = (0..n).map(|k| step * f64::from(k)).min_by(|a, b| widest(*a).total_cmp(&widest(*b))).unwrap_or(0.0);
    let (mut low, mut high) = (best - step, best + step);
    for _ in 0..60 {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if widest(a) < widest(b) { high = b } else { low = a }
    }
    widest(0.5 * (low + high))
}

/// The point at arc length `s` of a polyline whose edges have the lengths `rest`, beginning at arc length `from`.
pub fn at_arc(points: &[DVec3], rest: &[f64], from: f64, s: f64) -> DVec3 {
    let mut left = s - from;
    for (p, l) in points.windows(2).zip(rest) {
        if left <= *l {
            return p[0].lerp(p[1], left / l);
        }
        left -= l;
    }
    points[points.len() - 1]
}

/// Root mean square distance between two sets of points after the best turn of the first about x.
pub fn apart_about_x(a: &[DVec3], b: &[DVec3]) -> f64 {
    let (mut cross, mut dot) = (0.0, 0.0);
    for (p, q) in a.iter().zip(b) {
        cross += p.y * q.z - p.z * q.y;
        dot += p.y * q.y + p.z * q.z;
    }
    let turn = DQuat::from_rotation_x(libm::atan2(cross, dot));
    let sum: f64 = a.iter().zip(b).map(|(p, q)| (turn * *p).distance_squared(*q)).sum();
    (sum / a.len().max(1) as f64).sqrt()
}

/// Slope, ordinate at zero and R^2 of the straight line through points.
pub fn fit(points: &[(f64, f64)]) -> (f64, f64, f64) {
    let n = points.len() as f64;
    let (mx, my) = (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
    let sum = |f: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(f).sum::<f64>();
    let (xx, xy, yy) = (sum(&|p| (p.0 - mx).powi(2)), sum(&|p| (p.0 - mx) * (p.1 - my)), sum(&|p| (p.1 - my).powi(2)));
    (xy / xx, my - xy / xx * mx, xy * xy / (xx * yy))
}

/// A scene of a thread with gravity along -z, of which nothing is held.
pub fn scene(rod: Rod, gravity: f64, drag: f64) -> Scene {
    Scene { gravity: DVec3::NEG_Z * gravity, drag, ..Scene::of(rod) }
}

/// A number to three digits.
pub fn number(v: f64) -> String {
    if !v.is_finite() {
        return "-".into();
    }
    if v == 0.0 {
        return "0".into();
    }
    let exponent = v.abs().log10().floor();
    if !(-4.0..6.0).contains(&exponent) {
        return format!("{v:.1e}");
    }
    let text = format!("{v:.*}", (2.0 - exponent).clamp(0.0, 7.0) as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
}

/// A part of one, as percent.
pub fn percent(v: f64) -> String {
    if v.is_finite() { format!("{} %", number(100.0 * v)) } else { "diverges".into() }
}

/// A length in millimeters.
pub fn mm(v: f64) -> String {
    if v.is_finite() { format!("{} mm", number(1e3 * v)) } else { "diverges".into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn out_of_plane_does_not_see_a_turn_of_the_whole() {
        let flat: Vec<DVec3> = (0..50).map(|i| f64::from(i) * 0.1).map(|t| DVec3::new(t, 0.0, libm::sin(t))).collect();
        let loops: Vec<DVec3> = flat.iter().map(|p| *p + DVec3::Y * 0.2 * libm::sin(2.0 * p.x)).collect();
        let turned = |points: &[DVec3]| points.iter().map(|p| DQuat::from_rotation_x(0.7) * *p).collect::<Vec<_>>();
        assert!(out_of_plane(&turned(&flat)) < 1e-9);
        let (a, b) = (out_of_plane(&loops), out_of_plane(&turned(&loops)));
        assert!(a > 0.05 && (a / b - 1.0).abs() < 1e-6, "{a} {b}");
        assert!(apart_about_x(&loops, &turned(&loops)) < 1e-12);
    }

    #[test]
    fn a_line_is_fitted() {
        let (slope, at_zero, r2) = fit(&[(1.0, 3.0), (2.0, 5.0), (4.0, 9.0)]);
        assert!((slope - 2.0).abs() < 1e-12 && (at_zero - 1.0).abs() < 1e-12 && (r2 - 1.0).abs() < 1e-12);
        assert!(fit(&[(1.0, 3.0), (2.0, 9.0), (4.0, 5.0)]).2 < 0.5);
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!(
            [number(0.123456), number(12345.6), number(1e-7), number(0.0), percent(0.032)],
            ["0.123", "12346", "1.0e-7", "0", "3.2 %"]
        );
    }
}
