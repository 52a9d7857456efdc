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

use crate::math::{exp, log, outer};
use glam::{DMat3, DQuat, DVec3};

/// Angle of a joint along the directors halfway, and its derivative.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Joint {
    /// theta \[rad\].
    pub angle: DVec3,
    /// d theta / d (phi1 - phi0).
    pub derivative: DMat3,
}

/// Rotation angle of a joint from its rest value.
#[inline]
pub(crate) fn joint_angle(q0: DQuat, q1: DQuat, rest_half: DQuat) -> DVec3 {
    let back = rest_half.conjugate();
    log(back * (q0.conjugate() * q1) * back)
}

/// The same with its derivative.
#[inline]
pub(crate) fn joint(q0: DQuat, q1: DQuat, rest_half: DQuat) -> Joint {
    let angle = joint_angle(q0, q1, rest_half);
    let middle = q0 * rest_half * exp(angle * 0.5);
    let rt = DMat3::from_quat(middle).transpose();
    let t2 = angle.length_squared();
    // (a / sin a - 1) / theta^2 with a = theta / 2: series below, exact above.
    let c = if t2 < 0.04 {
        1.0 / 24.0 + t2 * (7.0 / 5760.0 + t2 * (31.0 / 967_680.0 + t2 * (127.0 / 154_828_800.0)))
    } else {
        let a = 0.5 * t2.sqrt();
        (a / libm::sin(a) - 1.0) / t2
    };
    // Near half a turn sin a is still near 1, so M is bounded by pi / 2.
    let m = DMat3::from_diagonal(DVec3::splat(1.0 + c * t2)) - outer(angle, angle) * c;
    Joint { angle, derivative: m * rt }
}

#[cfg(test)]
mod tests {
    use super::*;

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
                let got = j.derivative.col(axis);
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
