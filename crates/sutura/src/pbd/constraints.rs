//! Constraints of the rod, dimensionless, each projected by itself: `dp = -W J^T (J W J^T)^-1 C` (rows P-1, P-4, P-5).
//!
//! Shear and stretch `C = (x1 - x0) / l - R(q) e3`; bend and twist `C = Im(conj(q) u - s conj(q0) u0)`, s = +1 or -1,
//! whichever rest rotation is nearer. A quaternion counts as four free numbers: then both `J W J^T` are multiples of
//! the identity, `(w0 + w1) / l^2 + 4 wq` and `wq + wu`, and the corrected quaternions are normalized. Stiffness in [0,
//! 1] multiplies the correction, that of bend and twist a component each.
//!
//! Source: Kugelstadt and Schoemer 2016, eqs. 37, 40, as taken over by the 2018 paper's (8), (11). Limits: the part of
//! a correction that only changes the length of a quaternion is lost with the normalization, so that pure stretch
//! converges slower than its linear step says.

use super::number::{Number, Quat, Vec3};
use glam::{DQuat, DVec3};
use wide::f64x2;

/// Shear and stretch of an element: what is constant over a step. Zeros where everything is held.
#[derive(Debug, Clone, Copy)]
pub(super) struct StretchShear<T> {
    inverse_length: T,
    /// Correction of the two particles per C, and twice that of the quaternion.
    particles: [T; 2],
    turn: T,
}

/// Bend and twist of a joint: what is constant over a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct BendTwist<T> {
    rest: Quat<T>,
    /// Part of the correction that each frame takes, stiffness and sign included.
    frames: [Vec3<T>; 2],
}

impl StretchShear<f64> {
    /// `w` the inverse masses of the particles, `wq` the inverse inertia of the frame, `k` the stiffness.
    pub fn new(l: f64, w: [f64; 2], wq: f64, k: f64) -> Self {
        let jwj = (w[0] + w[1]) / (l * l) + 4.0 * wq;
        let gain = if jwj > 0.0 { k / jwj } else { 0.0 };
        StretchShear { inverse_length: 1.0 / l, particles: [gain * w[0] / l, gain * w[1] / l], turn: 2.0 * gain * wq }
    }
}

impl<T: Number> StretchShear<T> {
    pub fn each(of_lane: impl Fn(usize) -> StretchShear<f64>) -> Self {
        StretchShear {
            inverse_length: T::each(|k| of_lane(k).inverse_length),
            particles: [0, 1].map(|i| T::each(|k| of_lane(k).particles[i])),
            turn: T::each(|k| of_lane(k).turn),
        }
    }
    #[inline(always)]
    pub fn value(&self, x0: Vec3<T>, x1: Vec3<T>, q: Quat<T>) -> Vec3<T> {
        (x1 - x0) * self.inverse_length - third_director(q)
    }
    #[inline(always)]
    pub fn project(&self, x0: Vec3<T>, x1: Vec3<T>, q: Quat<T>) -> (Vec3<T>, Vec3<T>, Quat<T>) {
        let c = self.value(x0, x1, q);
        // dC/dq is minus that of the director.
        (
            x0 + c * self.particles[0],
            x1 - c * self.particles[1],
            (q + half_director_pull(q, c * self.turn)).normalized(),
        )
    }
}

impl BendTwist<f64> {
    pub fn new(rest: DQuat, w: [f64; 2], k: DVec3) -> Self {
        let sum = w[0] + w[1];
        let part = |w: f64| Vec3::from(if sum > 0.0 { k * (w / sum) } else { DVec3::ZERO });
        BendTwist { rest: rest.into(), frames: [part(w[0]), part(-w[1])] }
    }
    /// As `project`, with the two frames in the lanes.
    #[inline(always)]
    pub fn project_both(&self, q: Quat<f64>, inverse: f64, u: Quat<f64>) -> Quat<f64x2> {
        let c = self.value(q, inverse, u);
        let q = q * inverse;
        let [own, other] = [[q, u], [u, q]].map(|of| Quat::each(|k| of[k]));
        own + times_imaginary(other, Vec3::each(|_| c) * Vec3::each(|k| self.frames[k]))
    }
}

impl<T: Number> BendTwist<T> {
    pub fn each(of_lane: impl Fn(usize) -> BendTwist<f64>) -> Self {
        BendTwist {
            rest: Quat::each(|k| of_lane(k).rest),
            frames: [0, 1].map(|i| Vec3::each(|k| of_lane(k).frames[i])),
        }
    }
    /// Of the frames `q * inverse`, a unit quaternion, and `u`. The factor comes late since in a chain of joints it is
    /// known late.
    #[inline(always)]
    pub fn value(&self, q: Quat<T>, inverse: T, u: Quat<T>) -> Vec3<T> {
        let now = q.conjugate_times(u);
        let sign = now.dot(self.rest);
        now.imaginary() * inverse - self.rest.imaginary().flip(sign)
    }
    /// The corrected frames; neither is normalized.
    #[inline(always)]
    pub fn project(&self, q: Quat<T>, inverse: T, u: Quat<T>) -> [Quat<T>; 2] {
        let c = self.value(q, inverse, u);
        let q = q * inverse;
        [q + times_imaginary(u, c * self.frames[0]), u + times_imaginary(q, c * self.frames[1])]
    }
}

/// `q e3 conj(q)`.
#[inline(always)]
fn third_director<T: Number>(q: Quat<T>) -> Vec3<T> {
    let (a, b) = (q.x * q.z + q.w * q.y, q.y * q.z - q.w * q.x);
    Vec3 { x: a + a, y: b + b, z: (q.w * q.w + q.z * q.z) - (q.x * q.x + q.y * q.y) }
}

/// `(d (q e3 conj(q)) / dq)^T c / 2 = c q conj(e3)` over the four numbers of q.
#[inline(always)]
fn half_director_pull<T: Number>(q: Quat<T>, c: Vec3<T>) -> Quat<T> {
    Quat {
        x: c.x * q.z - c.y * q.w - c.z * q.x,
        y: c.x * q.w + c.y * q.z - c.z * q.y,
        z: c.x * q.x + c.y * q.y + c.z * q.z,
        w: c.x * q.y - c.y * q.x + c.z * q.w,
    }
}

/// `q (v, 0)`. For the joint `(dC/du)^T v = q v` and `(dC/dq)^T v = -u v`.
#[inline(always)]
fn times_imaginary<T: Number>(q: Quat<T>, v: Vec3<T>) -> Quat<T> {
    Quat {
        x: (q.w * v.x + q.y * v.z) - q.z * v.y,
        y: (q.w * v.y + q.z * v.x) - q.x * v.z,
        z: (q.w * v.z + q.x * v.y) - q.y * v.x,
        w: -(q.x * v.x + q.y * v.y + q.z * v.z),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::exp;

    const H: f64 = 1e-6;

    fn vector(v: Vec3<f64>) -> DVec3 {
        DVec3::new(v.x, v.y, v.z)
    }
    fn quaternion(q: Quat<f64>) -> DQuat {
        DQuat::from_xyzw(q.x, q.y, q.z, q.w)
    }

    /// Central differences of `f` over the four numbers of `q`.
    fn gradient(q: DQuat, f: impl Fn(DQuat) -> f64) -> DQuat {
        let axis = |k: usize| DQuat::from_array(core::array::from_fn(|j| if j == k { H } else { 0.0 }));
        DQuat::from_array(core::array::from_fn(|k| (f(q + axis(k)) - f(q - axis(k))) / (2.0 * H)))
    }

    #[test]
    fn gradients_are_those_of_finite_differences() {
        let (q, u) = (exp(DVec3::new(0.3, -0.8, 0.5)), exp(DVec3::new(0.5, -0.6, 0.1)));
        let v = DVec3::new(0.7, -0.2, 1.1);
        let joint = BendTwist::new(exp(DVec3::new(0.1, 0.0, -0.2)), [1.0, 1.0], DVec3::ONE);
        let value = |q: DQuat, u: DQuat| vector(joint.value(q.into(), 1.0, u.into())).dot(v);
        let close = |a: DQuat, b: Quat<f64>, k: f64| assert!((a - quaternion(b) * k).length() < 1e-9, "{a} {b:?}");
        close(gradient(q, |q| vector(third_director(q.into())).dot(v)), half_director_pull(q.into(), v.into()), 2.0);
        close(gradient(u, |u| value(q, u)), times_imaginary(q.into(), v.into()), 1.0);
        close(gradient(q, |q| value(q, u)), times_imaginary(u.into(), v.into()), -1.0);
        // Those over positions are plus and minus 1 / l.
        let c = StretchShear::new(0.5, [1.0, 2.0], 3.0, 1.0);
        let (a, b) = (DVec3::new(0.1, 0.2, 0.3), DVec3::new(0.2, 0.5, 0.7));
        let at = |b: DVec3| vector(c.value(a.into(), b.into(), q.into()));
        let slope = (at(b + v * H) - at(b - v * H)) / (2.0 * H);
        assert!((slope - v * 2.0).length() < 1e-9);
    }

    #[test]
    fn a_projection_is_the_one_of_p_1() {
        // With dp = W J^T lambda and J W J^T lambda = -C the linearized constraint is met before the quaternion is
        // normalized.
        let (l, w, wq) = (0.3, [2.0, 0.7], 9.0);
        let c = StretchShear::new(l, w, wq, 1.0);
        let q = exp(DVec3::new(0.2, 0.4, -0.3));
        let before = [DVec3::new(0.01, 0.0, 0.0), DVec3::new(0.1, 0.2, 0.24)];
        let value = c.value(before[0].into(), before[1].into(), q.into());
        let (x0, x1, turned) = c.project(before[0].into(), before[1].into(), q.into());
        let x = [x0, x1].map(vector);
        let pull = |v: DVec3| quaternion(half_director_pull(q.into(), v.into()));
        let dq = pull(vector(value)) * c.turn;
        assert!(((q + dq).normalize() - quaternion(turned)).length() < 1e-15);
        let directed = DVec3::from_array(core::array::from_fn(|k| 2.0 * pull(DVec3::AXES[k]).dot(dq)));
        let value = vector(value);
        let left = value + ((x[1] - before[1]) - (x[0] - before[0])) / l - directed;
        assert!(left.length() < 1e-14 * value.length().max(1.0), "{left}");
        // Momentum stays.
        assert!(((x[0] - before[0]) / w[0] + (x[1] - before[1]) / w[1]).length() < 1e-16);

        let joint = BendTwist::new(exp(DVec3::new(0.05, 0.0, -0.1)), [3.0, 5.0], DVec3::ONE);
        let u = exp(DVec3::new(0.25, 0.3, -0.35));
        let value = joint.value(q.into(), 1.0, u.into());
        let [a, b] = joint.project(q.into(), 1.0, u.into()).map(Quat::normalized);
        let (after, value) = (vector(joint.value(a, 1.0, b)), vector(value));
        assert!(
            after.length() < value.length() * value.length(),
            "second order: {} after {}",
            after.length(),
            value.length()
        );
    }

    /// The frame that comes unnormalized, and two frames in lanes.
    #[test]
    fn a_joint_is_projected_alike_in_all_ways() {
        let joint = BendTwist::new(exp(DVec3::new(0.05, 0.0, -0.1)), [3.0, 5.0], DVec3::new(0.3, 0.7, 0.9));
        let (q, u) = (exp(DVec3::new(0.2, 0.4, -0.3)), exp(DVec3::new(0.25, 0.3, -0.35)));
        for u in [u, -u] {
            let [a, b] = joint.project(q.into(), 1.0, u.into()).map(quaternion);
            let both = joint.project_both(q.into(), 1.0, u.into());
            assert_eq!([a, b], [0, 1].map(|k| quaternion(both.lane(k))));
            let long = joint.project((q * 1.7).into(), 1.0 / 1.7, u.into()).map(quaternion);
            assert!((long[0] - a).length() < 1e-15 && (long[1] - b).length() < 1e-15);
        }
    }
}
