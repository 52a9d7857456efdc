//! Constraints of the rod, dimensionless, each projected by itself: `dp = -W J^T (J W J^T)^-1 C` (rows P-1, P-4, P-5).
//!
//! Shear and stretch `C = (x1 - x0) / l - R(q) e3`; bend and twist `C = Im(conj(q) u - s conj(q0) u0)`, s = +1 or -1, whichever rest rotation is nearer.
//! A quaternion counts as four free numbers: then both `J W J^T` are multiples of the identity, `(w0 + w1) / l^2 + 4 wq` and `wq + wu`, and the
//! corrected quaternions are normalized. Stiffness in [0, 1] multiplies the correction, that of bend and twist a component each.
//!
//! Source: Kugelstadt and Schoemer 2016, eqs. 37, 40, as taken over by the 2018 paper's (8), (11). Limits: the part of a correction that only changes the length of a
//! quaternion is lost with the normalization, so that pure stretch converges slower than its linear step says.

use glam::{DQuat, DVec3};

/// Shear and stretch of an element: what is constant over a step. Zeros where everything is held.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct StretchShear {
    inverse_length: f64,
    /// Correction of the two particles and of the quaternion per C.
    particles: [f64; 2],
    turn: f64,
}

/// Bend and twist of a joint: what is constant over a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct BendTwist {
    rest: DQuat,
    /// Part of the correction that each frame takes, stiffness included.
    frames: [DVec3; 2],
}

impl StretchShear {
    /// `w` the inverse masses of the particles, `wq` the inverse inertia of the frame, `k` the stiffness.
    pub fn new(l: f64, w: [f64; 2], wq: f64, k: f64) -> Self {
        let jwj = (w[0] + w[1]) / (l * l) + 4.0 * wq;
        if jwj <= 0.0 {
            return StretchShear { inverse_length: 1.0 / l, ..Self::default() };
        }
        let gain = k / jwj;
        StretchShear { inverse_length: 1.0 / l, particles: [gain * w[0] / l, gain * w[1] / l], turn: gain * wq }
    }
    #[inline(always)]
    pub fn value(&self, x0: DVec3, x1: DVec3, q: DQuat) -> DVec3 {
        (x1 - x0) * self.inverse_length - third_director(q)
    }
    #[inline(always)]
    pub fn project(&self, x: &mut [DVec3], q: &mut DQuat) {
        let c = self.value(x[0], x[1], *q);
        x[0] += c * self.particles[0];
        x[1] -= c * self.particles[1];
        // dC/dq is minus that of the director.
        *q = (*q + third_director_pull(*q, c) * self.turn).normalize();
    }
}

impl BendTwist {
    pub fn new(rest: DQuat, w: [f64; 2], k: DVec3) -> Self {
        let sum = w[0] + w[1];
        let part = |w: f64| if sum > 0.0 { k * (w / sum) } else { DVec3::ZERO };
        BendTwist { rest, frames: [part(w[0]), part(w[1])] }
    }
    #[inline(always)]
    pub fn value(&self, q: DQuat, u: DQuat) -> DVec3 {
        let now = q.conjugate() * u;
        let sign = 1.0_f64.copysign(now.dot(self.rest));
        imaginary(now) - imaginary(self.rest) * sign
    }
    #[inline(always)]
    pub fn project(&self, pair: &mut [DQuat]) {
        let (q, u) = (pair[0], pair[1]);
        let c = self.value(q, u);
        pair[0] = (q + times_imaginary(u, c * self.frames[0])).normalize();
        pair[1] = (u + times_imaginary(q, c * self.frames[1]) * -1.0).normalize();
    }
}

#[inline(always)]
fn imaginary(q: DQuat) -> DVec3 {
    DVec3::new(q.x, q.y, q.z)
}

/// `q e3 conj(q)`.
#[inline(always)]
fn third_director(q: DQuat) -> DVec3 {
    DVec3::new(2.0 * (q.x * q.z + q.w * q.y), 2.0 * (q.y * q.z - q.w * q.x), q.w * q.w - q.x * q.x - q.y * q.y + q.z * q.z)
}

/// `(d (q e3 conj(q)) / dq)^T c = 2 c q conj(e3)` over the four numbers of q.
#[inline(always)]
fn third_director_pull(q: DQuat, c: DVec3) -> DQuat {
    DQuat::from_xyzw(c.x * q.z - c.y * q.w - c.z * q.x, c.x * q.w + c.y * q.z - c.z * q.y, c.x * q.x + c.y * q.y + c.z * q.z, c.x * q.y - c.y * q.x + c.z * q.w)
        * 2.0
}

/// `q (v, 0)`. For the joint `(dC/du)^T v = q v` and `(dC/dq)^T v = -u v`.
#[inline(always)]
fn times_imaginary(q: DQuat, v: DVec3) -> DQuat {
    DQuat::from_xyzw(
        q.w * v.x + q.y * v.z - q.z * v.y,
        q.w * v.y + q.z * v.x - q.x * v.z,
        q.w * v.z + q.x * v.y - q.y * v.x,
        -(q.x * v.x + q.y * v.y + q.z * v.z),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::exp;

    const H: f64 = 1e-6;

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
        let close = |a: DQuat, b: DQuat| assert!((a - b).length() < 1e-9, "{a} {b}");
        close(gradient(q, |q| third_director(q).dot(v)), third_director_pull(q, v));
        close(gradient(u, |u| joint.value(q, u).dot(v)), times_imaginary(q, v));
        close(gradient(q, |q| joint.value(q, u).dot(v)), times_imaginary(u, v) * -1.0);
        // Those over positions are plus and minus 1 / l.
        let c = StretchShear::new(0.5, [1.0, 2.0], 3.0, 1.0);
        let (a, b) = (DVec3::new(0.1, 0.2, 0.3), DVec3::new(0.2, 0.5, 0.7));
        let slope = (c.value(a, b + v * H, q) - c.value(a, b - v * H, q)) / (2.0 * H);
        assert!((slope - v * 2.0).length() < 1e-9);
    }

    #[test]
    fn a_projection_is_the_one_of_p_1() {
        // With dp = W J^T lambda and J W J^T lambda = -C the linearized constraint is met before the quaternion is normalized.
        let (l, w, wq) = (0.3, [2.0, 0.7], 9.0);
        let c = StretchShear::new(l, w, wq, 1.0);
        let q = exp(DVec3::new(0.2, 0.4, -0.3));
        let before = [DVec3::new(0.01, 0.0, 0.0), DVec3::new(0.1, 0.2, 0.24)];
        let (mut x, mut turned) = (before, q);
        let value = c.value(x[0], x[1], q);
        c.project(&mut x, &mut turned);
        let dq = third_director_pull(q, value) * c.turn;
        let directed = DVec3::from_array(core::array::from_fn(|k| third_director_pull(q, DVec3::AXES[k]).dot(dq)));
        let left = value + ((x[1] - before[1]) - (x[0] - before[0])) / l - directed;
        assert!(left.length() < 1e-14 * value.length().max(1.0), "{left}");
        // Momentum stays.
        assert!(((x[0] - before[0]) / w[0] + (x[1] - before[1]) / w[1]).length() < 1e-16);

        let joint = BendTwist::new(exp(DVec3::new(0.05, 0.0, -0.1)), [3.0, 5.0], DVec3::ONE);
        let u = exp(DVec3::new(0.25, 0.3, -0.35));
        let mut pair = [q, u];
        let value = joint.value(q, u);
        joint.project(&mut pair);
        let after = joint.value(pair[0], pair[1]);
        assert!(after.length() < value.length() * value.length(), "second order: {} after {}", after.length(), value.length());
    }
}
