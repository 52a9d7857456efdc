//! Rotations and small linear algebra, each convention in one place.
//!
//! `log(q)` is the rotation vector (axis times angle, angle in [0, pi]); `exp` is its inverse. A rotation is updated in
//! world axes, `q <- exp(phi) q`. Transcendental functions come from `libm`, so that the bits agree across machines.

use glam::{DMat3, DQuat, DVec3};

/// A rigid placement: takes points of a body to the world, `x_world = orientation * x_body + position`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Origin of the body in the world \[m\].
    pub position: DVec3,
    /// `world_from_body`, a unit quaternion.
    pub orientation: DQuat,
}

impl Pose {
    /// The body frame is the world frame.
    pub const IDENTITY: Pose = Pose { position: DVec3::ZERO, orientation: DQuat::IDENTITY };

    /// A placement from its two parts.
    pub fn new(position: DVec3, orientation: DQuat) -> Self {
        Pose { position, orientation }
    }
    /// A placement that only moves.
    pub fn at(position: DVec3) -> Self {
        Pose { position, orientation: DQuat::IDENTITY }
    }
    /// World coordinates of a body point.
    pub fn transform_point(&self, p: DVec3) -> DVec3 {
        self.orientation * p + self.position
    }
    /// Body coordinates of a world point.
    pub fn inverse_transform_point(&self, p: DVec3) -> DVec3 {
        self.orientation.conjugate() * (p - self.position)
    }
    /// `self * inner`: the placement of something known in this body's frame.
    pub fn compose(&self, inner: &Pose) -> Pose {
        Pose {
            position: self.transform_point(inner.position),
            orientation: (self.orientation * inner.orientation).normalize(),
        }
    }
    /// The placement that undoes this one.
    pub fn inverse(&self) -> Pose {
        let inv = self.orientation.conjugate();
        Pose { position: -(inv * self.position), orientation: inv }
    }
    /// Between two placements: straight line and shortest constant-rate rotation, `s` in \[0, 1\].
    pub fn interpolate(&self, to: &Pose, s: f64) -> Pose {
        let turn = log(to.orientation * self.orientation.conjugate());
        Pose {
            position: self.position + (to.position - self.position) * s,
            orientation: (exp(turn * s) * self.orientation).normalize(),
        }
    }
    /// Whether every number is finite and the quaternion is a unit one.
    pub(crate) fn is_valid(&self) -> bool {
        is_place(self.position) && self.orientation.is_finite() && (self.orientation.length() - 1.0).abs() < 1e-6
    }
}

/// Whether a point is somewhere from which distances can be measured: its coordinates are finite, and so are their
/// squares.
pub(crate) fn is_place(x: DVec3) -> bool {
    x.length_squared().is_finite()
}

/// Unit quaternion of the rotation vector `phi` \[rad\].
#[inline]
pub fn exp(phi: DVec3) -> DQuat {
    let a2 = phi.length_squared();
    // Series that are exact to the last bit while a^2 is below 1e-3, and below 1; they also avoid 0/0.
    let (s, c) = if a2 < 1e-3 {
        let s = 0.5 - a2 * (1.0 / 48.0 - a2 * (1.0 / 3840.0 - a2 / 645_120.0));
        let c = 1.0 - a2 * (0.125 - a2 * (1.0 / 384.0 - a2 * (1.0 / 46_080.0 - a2 / 10_321_920.0)));
        (s, c)
    } else if a2 < 1.0 {
        // sin x / x and cos x of x = a / 2; the first terms left out are x^16 / 17! and x^18 / 18!, with x^2 < 1/4.
        let u = 0.25 * a2;
        let s = 1.0
            - u * (1.0 / 6.0
                - u * (1.0 / 120.0
                    - u * (1.0 / 5040.0
                        - u * (1.0 / 362_880.0
                            - u * (1.0 / 39_916_800.0 - u * (1.0 / 6_227_020_800.0 - u / 1_307_674_368_000.0))))));
        let c = 1.0
            - u * (0.5
                - u * (1.0 / 24.0
                    - u * (1.0 / 720.0
                        - u * (1.0 / 40_320.0
                            - u * (1.0 / 3_628_800.0
                                - u * (1.0 / 479_001_600.0
                                    - u * (1.0 / 87_178_291_200.0 - u / 20_922_789_888_000.0)))))));
        (0.5 * s, c)
    } else {
        let a = a2.sqrt();
        let (sin, cos) = libm::sincos(0.5 * a);
        (sin / a, cos)
    };
    DQuat::from_xyzw(phi.x * s, phi.y * s, phi.z * s, c)
}

/// Rotation vector of the unit quaternion `q` \[rad\], of length at most pi.
#[inline]
pub fn log(q: DQuat) -> DVec3 {
    let v = DVec3::new(q.x, q.y, q.z);
    let s2 = v.length_squared();
    let w = q.w.abs();
    // 2 atan(s/w)/s as a series in (s/w)^2 while that is small.
    let k = if s2 < 1e-3 * w * w {
        let u = s2 / (w * w);
        2.0 / w * (1.0 - u * (1.0 / 3.0 - u * (0.2 - u * (1.0 / 7.0 - u * (1.0 / 9.0 - u / 11.0)))))
    } else {
        angle_over_sine(s2, w)
    };
    v * k.copysign(q.w)
}

/// 2 atan(s / w) / s for w >= 0: rotation angle over the length of a quaternion's vector part.
#[inline]
fn angle_over_sine(s2: f64, w: f64) -> f64 {
    // tan of a quarter of the angle.
    let r = (s2 + w * w).sqrt() + w;
    let u = s2 / (r * r);
    if u < 0.0157 {
        // 4 atan(x) / x to half a radian; the first term left out is x^18 / 19 with x^2 = u.
        let (u2, v) = (u * u, 1.0 / r);
        let even = 1.0 + u2 * (0.2 + u2 * (1.0 / 9.0 + u2 * (1.0 / 13.0 + u2 * (1.0 / 17.0))));
        let odd = 1.0 / 3.0 + u2 * (1.0 / 7.0 + u2 * (1.0 / 11.0 + u2 * (1.0 / 15.0)));
        4.0 * v * (even - u * odd)
    } else {
        let s = s2.sqrt();
        2.0 * libm::atan2(s, w) / s
    }
}

/// Rotation vector of `q`, half its length over its sine, and the rotation by half of it.
#[inline(always)]
pub(crate) fn log_and_root(q: DQuat) -> (DVec3, f64, DQuat) {
    let v = DVec3::new(q.x, q.y, q.z) * 1.0_f64.copysign(q.w);
    let w = q.w.abs();
    let k = angle_over_sine(v.length_squared(), w);
    // cos^2 (a / 2) = (1 + cos a) / 2.
    let c = (0.5 + 0.5 * w).sqrt();
    let s = 0.5 / c;
    (v * k, 0.5 * k, DQuat::from_xyzw(v.x * s, v.y * s, v.z * s, c))
}

/// Matrix of the cross product: `skew(a) * b = a x b`.
#[inline]
pub fn skew(a: DVec3) -> DMat3 {
    DMat3::from_cols(DVec3::new(0.0, a.z, -a.y), DVec3::new(-a.z, 0.0, a.x), DVec3::new(a.y, -a.x, 0.0))
}

/// `a b^T`.
#[inline]
pub fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// The rotation of least angle that takes unit vector `a` to unit vector `b`; for opposite vectors half a turn about an
/// axis across `a`.
pub fn rotation_arc(a: DVec3, b: DVec3) -> DQuat {
    let w = 1.0 + a.dot(b);
    if w < 1e-12 {
        let axis = a.any_orthonormal_vector();
        return DQuat::from_xyzw(axis.x, axis.y, axis.z, 0.0);
    }
    let v = a.cross(b);
    DQuat::from_xyzw(v.x, v.y, v.z, w).normalize()
}

/// A unit quaternion whose third director is the unit vector `t`; the first is the one nearest to `hint`, or any across
/// `t`.
pub fn frame_from_tangent(t: DVec3, hint: DVec3) -> DQuat {
    let across = hint - t * t.dot(hint);
    let d1 = if across.length_squared() > 1e-12 * hint.length_squared() && hint.length_squared() > 0.0 {
        across.normalize()
    } else {
        t.any_orthonormal_vector()
    };
    DQuat::from_mat3(&DMat3::from_cols(d1, t.cross(d1), t)).normalize()
}

/// Square root of a rotation: half its angle about the same axis.
#[inline]
pub fn half(q: DQuat) -> DQuat {
    exp(log(q) * 0.5)
}

/// Solves the dense system `a x = b` of `n` rows (row after row) in place by elimination with partial pivoting. False
/// when singular.
pub(crate) fn solve_dense(a: &mut [f64], b: &mut [f64], n: usize) -> bool {
    for k in 0..n {
        let mut p = k;
        for i in k + 1..n {
            if a[i * n + k].abs() > a[p * n + k].abs() {
                p = i;
            }
        }
        let pivot = a[p * n + k];
        if !(pivot.abs() > 0.0 && pivot.is_finite()) {
            return false;
        }
        if p != k {
            for j in 0..n {
                a.swap(k * n + j, p * n + j);
            }
            b.swap(k, p);
        }
        for i in k + 1..n {
            let f = a[i * n + k] / pivot;
            for j in k..n {
                a[i * n + j] -= f * a[k * n + j];
            }
            b[i] -= f * b[k];
        }
    }
    for k in (0..n).rev() {
        let mut s = b[k];
        for j in k + 1..n {
            s -= a[k * n + j] * b[j];
        }
        b[k] = s / a[k * n + k];
    }
    true
}

/// Maximum that keeps NaN.
#[inline]
pub(crate) fn max_or_nan(a: f64, b: f64) -> f64 {
    if b <= a || a.is_nan() { a } else { b }
}

/// Whether two lengths are the same but for rounding of how they were worked out.
pub(crate) fn same(a: f64, b: f64) -> bool {
    const ROUNDING: f64 = 1e-9;
    (a - b).abs() <= ROUNDING * a.abs().max(b.abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exp_and_log_are_inverse_across_the_series_switch() {
        for a in [0.0, 1e-9, 1e-3, 0.03, 0.0316, 0.0317, 0.05, 0.5, 1.5, 3.0, 3.13] {
            let phi = DVec3::new(0.36, -0.48, 0.8) * a;
            let q = exp(phi);
            assert!((q.length() - 1.0).abs() < 4e-16, "unit at {a}");
            assert!((log(q) - phi).length() <= 4e-15 * a.max(1e-3), "log at {a}: {}", (log(q) - phi).length());
        }
    }

    #[test]
    fn interpolation_turns_at_constant_rate() {
        let to = Pose::new(DVec3::new(1.0, 2.0, 3.0), exp(DVec3::new(0.0, 0.0, 2.0)));
        let p = Pose::IDENTITY.interpolate(&to, 0.25);
        assert!((p.position - to.position * 0.25).length() < 1e-15);
        assert!((log(p.orientation) - DVec3::new(0.0, 0.0, 0.5)).length() < 1e-14);
    }

    #[test]
    fn arc_of_opposite_vectors_is_half_a_turn() {
        let q = rotation_arc(DVec3::X, -DVec3::X);
        assert!((q * DVec3::X + DVec3::X).length() < 1e-15);
    }
}
