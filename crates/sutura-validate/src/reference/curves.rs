//! Closed curves of known knot type, and their writhe as a double integral.

use std::f64::consts::{PI, TAU};

/// `n` points of the torus knot that goes twice around and `q` times through, right-handed: radius 1, tube 0.4.
pub fn torus_knot(q: u32, n: usize) -> Vec<[f64; 3]> {
    (0..n).map(|i| torus(q, TAU * i as f64 / n as f64).0).collect()
}

/// Point and tangent of the torus knot.
fn torus(q: u32, t: f64) -> ([f64; 3], [f64; 3]) {
    let q = f64::from(q);
    let radius = 1.0 + 0.4 * (q * t).cos();
    let change = -0.4 * q * (q * t).sin();
    let (sin, cos) = (2.0 * t).sin_cos();
    // Down on the outside makes it right-handed.
    (
        [radius * cos, radius * sin, -0.4 * (q * t).sin()],
        [change * cos - 2.0 * radius * sin, change * sin + 2.0 * radius * cos, -0.4 * q * (q * t).cos()],
    )
}

/// `n` points of the figure-eight knot.
pub fn figure_eight(n: usize) -> Vec<[f64; 3]> {
    let point = |t: f64| {
        let radius = 2.0 + (2.0 * t).cos();
        [radius * (3.0 * t).cos(), radius * (3.0 * t).sin(), (4.0 * t).sin()]
    };
    (0..n).map(|i| point(TAU * i as f64 / n as f64)).collect()
}

/// A closed braid of one strand more than there are throws: throw i twists strands i and i + 1 by as many crossings, to
/// the right for positive ones. That is the connected sum of the throws, each closed.
pub fn stacked_throws(crossings: &[i32]) -> Vec<[f64; 3]> {
    let letters: Vec<(usize, f64)> = crossings
        .iter()
        .enumerate()
        .flat_map(|(lane, c)| (0..c.abs()).map(move |_| (lane, f64::from(c.signum()))))
        .collect();
    const PIECES: usize = 8;
    let mut points = Vec::new();
    let mut lane = 0;
    loop {
        for (k, (inner, sign)) in letters.iter().enumerate() {
            let (to, height) = match lane {
                l if l == *inner => (l + 1, 0.4 * sign),
                l if l == inner + 1 => (l - 1, -0.4 * sign),
                l => (l, 0.0),
            };
            for piece in 0..PIECES {
                let u = piece as f64 / PIECES as f64;
                let radius = 3.0 + lane as f64 + (to as f64 - lane as f64) * 0.5 * (1.0 - (PI * u).cos());
                let angle = TAU * (k as f64 + u) / letters.len() as f64;
                points.push([radius * angle.cos(), radius * angle.sin(), height * (PI * u).sin()]);
            }
            lane = to;
        }
        if lane == 0 {
            return points;
        }
    }
}

/// Writhe of the smooth torus knot: Gauss' double integral by the trapezoidal rule on `n` points, which converges
/// faster than any power for a closed smooth curve (the integrand vanishes on the diagonal).
pub fn torus_writhe(q: u32, n: usize) -> f64 {
    let samples: Vec<([f64; 3], [f64; 3])> = (0..n).map(|i| torus(q, TAU * i as f64 / n as f64)).collect();
    let mut sum = 0.0;
    for (i, (a, ta)) in samples.iter().enumerate() {
        for (b, tb) in &samples[..i] {
            let d: [f64; 3] = std::array::from_fn(|k| a[k] - b[k]);
            let cross = [ta[1] * tb[2] - ta[2] * tb[1], ta[2] * tb[0] - ta[0] * tb[2], ta[0] * tb[1] - ta[1] * tb[0]];
            sum +=
                d.iter().zip(cross).map(|(d, c)| d * c).sum::<f64>() / d.iter().map(|d| d * d).sum::<f64>().powf(1.5);
        }
    }
    // Both orders of each pair, over 4 pi.
    2.0 * sum * (TAU / n as f64).powi(2) / (4.0 * PI)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Polygons of 50, 100, 200, 400 points have 3.321992, 3.333206, 3.336092, 3.336819: of second order toward
    /// 3.33706.
    #[test]
    fn writhe_of_the_trefoil() {
        assert!((torus_writhe(3, 400) - 3.33706).abs() < 1e-4, "{}", torus_writhe(3, 400));
        assert!((torus_writhe(3, 400) - torus_writhe(3, 800)).abs() < 1e-4);
    }

    #[test]
    fn braids_are_closed() {
        for throws in [&[3][..], &[3, -3], &[5, -3, 3]] {
            let points = stacked_throws(throws);
            let step = |a: &[f64; 3], b: &[f64; 3]| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt();
            let longest = points.windows(2).map(|w| step(&w[0], &w[1])).fold(0.0, f64::max);
            assert!(step(&points[0], &points[points.len() - 1]) <= longest * 1.01);
        }
    }
}
