//! Strains of the discrete Cosserat rod and their derivatives.
//!
//! Stretch and shear of an element: `C = R(q)^T (x1 - x0) - l e3` \[m\], energy `C^T K C / 2` with K = diag(kGA, kGA,
//! EA) / l. With d = x1 - x0 and world increments dx, phi (q <- exp(phi) q), `R dC = dx1 - dx0 + d x phi`.
//!
//! Bend and twist of a joint: `theta = log(h^-1 r h^-1)` \[rad\], r = conj(q0) q1, h the square root of its rest value;
//! energy `theta^T B theta / 2`, B = diag(E I1, E I2, GJ) / lbar. The symmetric form gives the same energy when the rod
//! is numbered from the other end (the one-sided h^-2 r does not); the logarithm stays linear to 180 degrees. With
//! delta = phi1 - phi0, `d theta = M(theta) Rm^T delta`, Rm = R(q0 h exp(theta/2)) the frame halfway and M = I + (a /
//! sin a - 1) (across theta), a = |theta| / 2.
//!
//! Source: Kugelstadt and Schoemer 2016 (staggered frames); Deul et al. 2018 (physical compliance). The logarithm
//! instead of 2 Im(q) and the symmetric rest are ours.

use crate::lanes::{Quat2, Vec2, lanes};
use crate::math::{log, log_and_root};
use glam::{DQuat, DVec3};
use wide::f64x2;

/// Angles of two joints along the directors halfway, and what their derivatives d theta / d (phi1 - phi0) = M Rm^T are
/// made of.
pub(super) struct Joints {
    /// theta \[rad\], and its square.
    pub angle: Vec2,
    pub squared: f64x2,
    /// Columns of Rm.
    pub middle: [Vec2; 3],
    /// M = (1 + c theta^2) I - c theta theta^T.
    pub c: f64x2,
}

/// Rotation angle of a joint from its rest value.
#[inline]
pub(crate) fn joint_angle(q0: DQuat, q1: DQuat, rest_half: DQuat) -> DVec3 {
    log((q0 * rest_half).conjugate() * (q1 * rest_half.conjugate()))
}

/// Rate of that angle while the two frames turn with angular velocities `w` \[rad/s\], world axes.
pub(crate) fn joint_rate(q: [DQuat; 2], w: [DVec3; 2], rest_half: DQuat) -> DVec3 {
    let j = joints(&turns([q[0]; 2], [q[1]; 2], [rest_half; 2]));
    let (angle, c, squared) = (j.angle.split().0, j.c.to_array()[0], j.squared.to_array()[0]);
    let across = w[1] - w[0];
    let seen = DVec3::from(j.middle.map(|m| m.split().0.dot(across)));
    seen * (1.0 + c * squared) - angle * (c * angle.dot(seen))
}

/// Turns of two joints from rest, after their first frames.
pub(super) struct Turns {
    first: Quat2,
    turn: Quat2,
    /// 1 / (1 + cos) of half the angle, and tan^2 of a quarter of it, as in `math::log`.
    inverse: f64x2,
    u: f64x2,
}

#[inline(always)]
pub(super) fn turns(q0: [DQuat; 2], q1: [DQuat; 2], rest_half: [DQuat; 2]) -> Turns {
    let half = Quat2::load(rest_half[0], rest_half[1]);
    let first = Quat2::load(q0[0], q0[1]).times(&half);
    let turn = first.conjugate().times(&Quat2::load(q1[0], q1[1]).times(&half.conjugate()));
    let s2 = turn.v.dot(&turn.v);
    let inverse = f64x2::splat(1.0) / ((s2 + turn.w * turn.w).sqrt() + turn.w);
    Turns { first, turn, inverse, u: s2 * inverse * inverse }
}

/// The angles of two joints, with the derivatives.
#[inline(always)]
pub(super) fn joints(turns: &Turns) -> Joints {
    let Turns { first, turn, inverse, u } = *turns;
    let one = f64x2::splat(1.0);
    let [low, high] = u.to_array();
    // Both angles under 0.2 rad.
    if low < 0.0025 && high < 0.0025 {
        let k = |x: f64| f64x2::splat(x);
        // 4 atan(x) / x; the first term left out is u^7 / 15.
        let series = one
            - u * (k(1.0 / 3.0)
                - u * (k(0.2) - u * (k(1.0 / 7.0) - u * (k(1.0 / 9.0) - u * (k(1.0 / 11.0) - u * k(1.0 / 13.0))))));
        let angle = turn.v.scaled(k(4.0) * inverse * series);
        let squared = angle.dot(&angle);
        // (a / sin a - 1) / theta^2 with a = theta / 2.
        let c = k(1.0 / 24.0)
            + squared * (k(7.0 / 5760.0) + squared * (k(31.0 / 967_680.0) + squared * k(127.0 / 154_828_800.0)));
        // cos^2 (a / 2) = (1 + cos a) / 2.
        let cosine = (k(0.5) + k(0.5) * turn.w).sqrt();
        let root = Quat2 { v: turn.v.scaled(k(0.5) / cosine), w: cosine };
        return Joints { angle, squared, middle: first.times(&root).axes(), c };
    }
    let (low, high) = turn.split();
    let ((a0, c0, r0), (a1, c1, r1)) = (large(low), large(high));
    let angle = Vec2::load(a0, a1);
    Joints { angle, squared: angle.dot(&angle), middle: first.times(&Quat2::load(r0, r1)).axes(), c: lanes(c0, c1) }
}

/// Rotation vector of `turn`, c, and half the rotation, for any angle.
fn large(turn: DQuat) -> (DVec3, f64, DQuat) {
    let (angle, half_over_sine, root) = log_and_root(turn);
    let squared = angle.length_squared();
    // Near half a turn sin a is still near 1, so M is bounded by pi / 2.
    let c = if squared < 0.04 {
        1.0 / 24.0 + squared * (7.0 / 5760.0 + squared * (31.0 / 967_680.0 + squared * (127.0 / 154_828_800.0)))
    } else {
        (half_over_sine - 1.0) / squared
    };
    (angle, c, root)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{exp, outer};
    use glam::DMat3;

    #[test]
    fn derivative_matches_differences() {
        for size in [0.0, 0.01, 0.19, 0.21, 1.0, 2.5] {
            let rest = exp(DVec3::new(0.1, 0.2, -0.15));
            let q0 = exp(DVec3::new(0.3, -0.7, 0.2));
            let q1 = q0 * rest * exp(DVec3::new(0.6, -0.48, 0.64) * size) * rest;
            // Two joints of different angles: the second is another one at rest.
            let j = joints(&turns([q0, rest], [q1, rest * rest * rest], [rest; 2]));
            let (angle, other) = j.angle.split();
            assert!(other.length() < 1e-15);
            let middle = DMat3::from_cols(j.middle[0].split().0, j.middle[1].split().0, j.middle[2].split().0);
            let (c, squared) = (j.c.to_array()[0], j.squared.to_array()[0]);
            assert!((angle.length() - size).abs() < 1e-12);
            for axis in 0..3 {
                let e = 1e-6;
                let mut d = DVec3::ZERO;
                d[axis] = e;
                let up = joint_angle(q0, exp(d) * q1, rest);
                let down = joint_angle(exp(d) * q0, q1, rest);
                let m = DMat3::from_diagonal(DVec3::splat(1.0 + c * squared)) - outer(angle, angle) * c;
                let got = (m * middle.transpose()).col(axis);
                // Forward differences of step 1e-6.
                assert!(
                    ((up - angle) / e - got).length() < 1e-5,
                    "size {size} axis {axis}: {:?} {:?}",
                    (up - angle) / e,
                    got
                );
                assert!(((down - angle) / e + got).length() < 1e-5);
            }
        }
    }

    #[test]
    fn rate_matches_differences() {
        let rest = exp(DVec3::new(0.1, 0.2, -0.15));
        let q = [exp(DVec3::new(0.3, -0.7, 0.2)), exp(DVec3::new(0.5, 0.4, -0.3))];
        let w = [DVec3::new(2.0, -1.0, 0.5), DVec3::new(-0.3, 1.5, 0.8)];
        let at = |t: f64| joint_angle(exp(w[0] * t) * q[0], exp(w[1] * t) * q[1], rest);
        let (got, want) = (joint_rate(q, w, rest), (at(1e-5) - at(-1e-5)) / 2e-5);
        assert!((got - want).length() < 1e-8, "{got} {want}");
    }

    #[test]
    fn reversing_the_rod_mirrors_the_angle() {
        // Numbered from the other end, each frame is turned half a turn about d1: d2 and d3 change sign.
        let flip = exp(DVec3::X * core::f64::consts::PI);
        let rest = exp(DVec3::new(0.05, 0.1, 0.02));
        let (q0, q1) = (exp(DVec3::new(0.3, 0.1, 0.0)), exp(DVec3::new(-0.2, 0.6, 0.3)));
        let forward = joint_angle(q0, q1, rest);
        let rest_back = (flip.conjugate() * (rest * rest).conjugate() * flip).normalize();
        let back = joint_angle(q1 * flip, q0 * flip, crate::math::half(rest_back));
        let want = -(flip.conjugate() * forward);
        assert!((back - want).length() < 1e-14, "{back:?} {want:?}");
    }
}
