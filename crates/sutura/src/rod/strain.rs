//! Strains of the discrete Cosserat rod and their derivatives.
//!
//! Stretch and shear of an element: `C = R(q)^T (x1 - x0) - l e3` \[m\], energy `C^T K C / 2` with K = diag(kGA, kGA, EA) / l.
//! With d = x1 - x0 and world increments dx, phi (q <- exp(phi) q), `R dC = dx1 - dx0 + d x phi`.
//!
//! Bend and twist of a joint: `theta = log(h^-1 r h^-1)` \[rad\], r = conj(q0) q1, h the square root of its rest value; energy
//! `theta^T B theta / 2`, B = diag(EI, EI, GJ) / lbar. The symmetric form gives the same energy when the rod is numbered from the other end (the
//! one-sided h^-2 r does not); the logarithm stays linear to 180 degrees. With delta = phi1 - phi0, `d theta = M(theta) Rm^T delta`,
//! Rm = R(q0 h exp(theta/2)) the frame halfway and M = I + (a / sin a - 1) (across theta), a = |theta| / 2.
//!
//! Source: Kugelstadt and Schoemer 2016 (staggered frames); Deul et al. 2018 (physical compliance). The logarithm instead of 2 Im(q) and
//! the symmetric rest are ours.

use crate::math::{log, log_and_root};
use glam::{DMat3, DQuat, DVec3};

/// Angle of a joint along the directors halfway, and what its derivative d theta / d (phi1 - phi0) = M Rm^T is made of.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Joint {
    /// theta \[rad\], and its square.
    pub angle: DVec3,
    pub squared: f64,
    /// Rm.
    pub middle: DMat3,
    /// M = (1 + c theta^2) I - c theta theta^T.
    pub c: f64,
}

/// Rotation angle of a joint from its rest value.
#[inline]
pub(crate) fn joint_angle(q0: DQuat, q1: DQuat, rest_half: DQuat) -> DVec3 {
    log((q0 * rest_half).conjugate() * (q1 * rest_half.conjugate()))
}

/// The same with its derivative.
#[inline(always)]
pub(crate) fn joint(q0: DQuat, q1: DQuat, rest_half: DQuat) -> Joint {
    let first = q0 * rest_half;
    let turn = first.conjugate() * (q1 * rest_half.conjugate());
    let (angle, half_over_sine, root) = log_and_root(turn);
    let squared = angle.length_squared();
    // (a / sin a - 1) / theta^2 with a = theta / 2: series below, exact above. Near half a turn sin a is still near 1, so M is bounded by pi / 2.
    let c = if squared < 0.04 {
        1.0 / 24.0 + squared * (7.0 / 5760.0 + squared * (31.0 / 967_680.0 + squared * (127.0 / 154_828_800.0)))
    } else {
        (half_over_sine - 1.0) / squared
    };
    Joint { angle, squared, middle: DMat3::from_quat(first * root), c }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{exp, outer};

    #[test]
    fn derivative_matches_differences() {
        for size in [0.0, 0.01, 0.19, 0.21, 1.0, 2.5] {
            let rest = exp(DVec3::new(0.1, 0.2, -0.15));
            let q0 = exp(DVec3::new(0.3, -0.7, 0.2));
            let q1 = q0 * rest * exp(DVec3::new(0.6, -0.48, 0.64) * size) * rest;
            let j = joint(q0, q1, rest);
            assert!((j.angle.length() - size).abs() < 1e-12);
            for axis in 0..3 {
                let e = 1e-6;
                let mut d = DVec3::ZERO;
                d[axis] = e;
                let up = joint_angle(q0, exp(d) * q1, rest);
                let down = joint_angle(exp(d) * q0, q1, rest);
                let m = DMat3::from_diagonal(DVec3::splat(1.0 + j.c * j.squared)) - outer(j.angle, j.angle) * j.c;
                let got = (m * j.middle.transpose()).col(axis);
                // Forward differences of step 1e-6.
                assert!(((up - j.angle) / e - got).length() < 1e-5, "size {size} axis {axis}: {:?} {:?}", (up - j.angle) / e, got);
                assert!(((down - j.angle) / e + got).length() < 1e-5);
            }
        }
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
