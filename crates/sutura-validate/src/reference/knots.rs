//! Forces of knots and plectonemes in thin elastic rods, and centerlines of loose long knots.
//!
//! h is the radius of the rod, R the radius of curvature with which the loop of a knot leaves its braid, eps = sqrt(h /
//! R). Forces are over EI / h^2, moments over EI / h. A knot of n turns has 2n + 1 crossings; n = 1 is the overhand
//! knot.

use super::numeric::root;
use ellip::{ellipe, ellipk};
use std::f64::consts::{PI, TAU};

/// Friction constant of the overhand knot.
pub const SIGMA: f64 = 0.492;

/// Force of an overhand knot in the limit of small eps, drawn by its ends or, with `sign` -1, let out (Audoly,
/// Clauvelin and Neukirch 2007).
pub fn overhand(eps: f64, mu: f64, sign: f64) -> f64 {
    0.5 * eps.powi(4) + sign * SIGMA * mu * eps.powi(3)
}

/// n^2 times the force of a long knot for n^2 h / e, with e the length that the knot takes up, in the limit of many
/// turns that friction holds (Jawed, Dieleman, Audoly and Reis 2015, equation 5): the loop is a planar elastica that
/// leaves the braid with curvature 1 / R and comes back to its other end, x = l / R is the length of the braid.
pub fn long_knot(shortening: f64, mu: f64) -> f64 {
    let shape = |m: f64| {
        let (k, e) = (ellipk(m).unwrap_or(f64::NAN), ellipe(m).unwrap_or(f64::NAN));
        (8.0 * (k - e) / m - 4.0 * k, 4.0 * k)
    };
    let c = 3.0_f64.sqrt() * PI * PI;
    // By the logarithm of 1 - m, whose root is as exact near a very slender loop as near a circle.
    let loop_of = |q: f64| shape(1.0 - (-q).exp());
    let q = root(1e-6, 30.0, |q| {
        let (x, loop_length) = loop_of(q);
        x * x / (x + loop_length) / (8.0 * c) - shortening
    });
    mu * loop_of(q).0.powi(3) / (96.0 * c)
}

/// Force along the axis that a ply of angle `angle` and radius h balances, without friction (Clauvelin, Audoly and
/// Neukirch 2009, equation 9).
pub fn ply_force(angle: f64) -> f64 {
    let (sin, cos) = angle.sin_cos();
    sin.powi(3) * (cos * (2.0 * angle).tan() - 0.5 * sin)
}

/// Twisting moment of the strands of that ply.
pub fn ply_moment(angle: f64) -> f64 {
    let (sin, cos) = angle.sin_cos();
    2.0 * cos * sin.powi(3) / (2.0 * angle).cos()
}

/// Centerline of a loose knot of `turns` turns, right-handed, of a rod of unit radius: two strands 3 radii apart wind
/// around each other along x with the pitch that theory gives them at `eps`, a flat loop of two half circles and a
/// straight piece joins them, and the tails go on along x for `tail`. Points are `spacing` apart; corners are rounded.
pub fn loose(turns: u32, eps: f64, tail: f64, spacing: f64) -> Vec<[f64; 3]> {
    let radius = eps.powi(-2);
    let half = 0.5 * f64::from(turns) * TAU * (12.0_f64.sqrt() * radius).sqrt();
    let strand = |u: f64, side: f64| {
        let (sin, cos) = (f64::from(turns) * TAU * u).sin_cos();
        [(2.0 * u - 1.0) * half, side * 1.5 * cos, side * 1.5 * sin]
    };
    let steps = |n: usize| (0..n).map(move |i| i as f64 / n as f64);
    let around = PI * radius;
    let whole = 2.0 * (around + half);
    // Along the loop from one end of the braid to the other, and across from one strand to the other.
    let joined = |u: f64| {
        let s = u * whole;
        let (x, z) = if s < around {
            let (sin, cos) = (s / radius).sin_cos();
            (half + radius * sin, radius * (1.0 - cos))
        } else if s < around + 2.0 * half {
            (half - (s - around), 2.0 * radius)
        } else {
            let (sin, cos) = ((s - around - 2.0 * half) / radius).sin_cos();
            (-half - radius * sin, radius * (1.0 + cos))
        };
        [x, 1.5 * (1.0 - 2.0 * u * u * (3.0 - 2.0 * u)), z]
    };
    let mut curve: Vec<[f64; 3]> = steps(300).map(|u| [-half - tail * (1.0 - u), 1.5, 0.0]).collect();
    curve.extend(steps(300 * turns as usize).map(|u| strand(u, 1.0)));
    curve.extend(steps(1500).map(joined));
    curve.extend(steps(300 * turns as usize).map(|u| strand(u, -1.0)));
    curve.extend(steps(300).map(|u| [half + tail * u, -1.5, 0.0]));
    curve.push([half + tail, -1.5, 0.0]);
    resampled(&curve, spacing)
}

/// Centerline of one thread of a loose bend of two, in millimeters, of thread of 0.2 mm; the other is the same turned
/// half around y. Two half knots follow one another along y: a reef when `side` is 1 (they are of opposite hands), a
/// granny when it is -1. The standing end is at the start.
pub fn bend(side: f64) -> Vec<[f64; 3]> {
    // Half length of a throw, radius of its strands, and of the turn from one throw into the other.
    let (half, wound, turn) = (2.4, 0.22, 1.28);
    let second = -2.0 * (turn + wound);
    let steps = |n: usize| (0..n).map(move |i| i as f64 / n as f64);
    let mut curve: Vec<[f64; 3]> = steps(200).map(|u| [-half - 12.0 * (1.0 - u), wound, 0.0]).collect();
    curve.extend(steps(300).map(|u| {
        let (sin, cos) = (3.0 * PI * u).sin_cos();
        [half * (2.0 * u - 1.0), wound * cos, wound * sin]
    }));
    curve.extend(steps(80).map(|u| {
        let (sin, cos) = (PI * u).sin_cos();
        [half + turn * sin, -wound - turn + turn * cos, 0.0]
    }));
    curve.extend(steps(300).map(|u| {
        let (sin, cos) = (3.0 * PI * u).sin_cos();
        [half * (1.0 - 2.0 * u), second + wound * cos, side * wound * sin]
    }));
    curve.extend((0..=100).map(|i| [-half - 0.08 * f64::from(i), second - wound, 0.0]));
    resampled(&curve, 0.2)
}

/// Points at equal distances along a polyline, each the mean of those around it within four spacings, but for the ends.
fn resampled(curve: &[[f64; 3]], spacing: f64) -> Vec<[f64; 3]> {
    const FINE: usize = 4;
    let apart = |a: &[f64; 3], b: &[f64; 3]| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt();
    let mut arc = vec![0.0];
    for pair in curve.windows(2) {
        arc.push(arc[arc.len() - 1] + apart(&pair[0], &pair[1]));
    }
    let length = arc[arc.len() - 1];
    let count = FINE * (length / spacing).round() as usize;
    let at = |s: f64| {
        let i = arc.partition_point(|a| *a <= s).clamp(1, arc.len() - 1);
        let u = (s - arc[i - 1]) / (arc[i] - arc[i - 1]);
        std::array::from_fn(|k| curve[i - 1][k] + u * (curve[i][k] - curve[i - 1][k]))
    };
    let fine: Vec<[f64; 3]> = (0..=count).map(|i| at(length * i as f64 / count as f64)).collect();
    (0..=count)
        .step_by(FINE)
        .map(|i| {
            let reach = (4 * FINE).min(i).min(count - i);
            let mut sum = [0.0; 4];
            for j in i - reach..=i + reach {
                let weight = 1.0 + (PI * (j as f64 - i as f64) / (reach as f64 + 1.0)).cos();
                for (s, x) in sum.iter_mut().zip(fine[j].iter().chain([&1.0])) {
                    *s += weight * x;
                }
            }
            [sum[0] / sum[3], sum[1] / sum[3], sum[2] / sum[3]]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(got: f64, want: f64, within: f64) {
        assert!((got / want - 1.0).abs() < within, "{got} {want}");
    }

    #[test]
    fn forces_of_overhand_knots_are_those_of_the_table() {
        for (eps, free, drawn, out, rough) in [
            (0.10, 5.0000e-5, 9.920e-5, 8.0e-7, 1.9760e-4),
            (0.20, 8.0000e-4, 1.1936e-3, 4.064e-4, 1.9808e-3),
            (0.30, 4.0500e-3, 5.3784e-3, 2.7216e-3, 8.0352e-3),
        ] {
            close(overhand(eps, 0.0, 1.0), free, 1e-4);
            close(overhand(eps, 0.1, 1.0), drawn, 1e-4);
            close(overhand(eps, 0.1, -1.0), out, 1e-3);
            close(overhand(eps, 0.3, 1.0), rough, 1e-4);
        }
    }

    #[test]
    fn forces_of_long_knots_are_those_of_the_table() {
        for (shortening, force) in
            [(9.20878e-5, 1.64525e-5), (8.14935e-4, 6.09352e-4), (2.57856e-3, 4.87482e-3), (7.44516e-3, 3.89985e-2)]
        {
            close(long_knot(shortening, 1.0), force, 1e-4);
        }
    }

    #[test]
    fn plies_are_those_of_the_table() {
        for (degrees, force, moment) in [
            (15.0_f64, 0.007425, 0.038675),
            (20.0, 0.024705, 0.098156),
            (25.0, 0.065578, 0.212855),
            (30.0, 0.156250, 0.433013),
        ] {
            close(ply_force(degrees.to_radians()), force, 1e-4);
            close(ply_moment(degrees.to_radians()), moment, 1e-4);
        }
    }

    #[test]
    fn loose_knots_are_what_they_are_called_and_touch_nowhere() {
        use sutura::glam::DVec3;
        use sutura::knot::{Ends, recognize};
        for (turns, name) in [(1, "3_1"), (2, "5_1"), (3, "7_1"), (4, "9_1")] {
            let points: Vec<DVec3> = loose(turns, 0.1, 200.0, 2.5).into_iter().map(DVec3::from_array).collect();
            let knot = recognize(&points, Ends::Free, 1).to_string();
            assert!(knot.contains(name), "{knot}");
            for (i, p) in points.iter().enumerate() {
                assert!(points.iter().skip(i + 4).all(|q| p.distance(*q) > 2.2), "turns {turns}, point {i}");
            }
        }
    }
}
