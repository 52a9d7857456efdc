//! The Newton matrix and right side of the rods.

use crate::math::{log, outer, skew};
use crate::model::Model;
use crate::rod::{element_strain, strain};
use crate::scratch::{ClampJoint, Scratch};
use crate::state::State;
use glam::{DMat3, DQuat, DVec3};

/// Which second derivatives of the elastic energy go into the matrix. The residual is exact in either case.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Hessian {
    /// With those of the geometry, of either sign: Newton converges in few iterations, also near buckling.
    Exact,
    /// Without those that can make it indefinite.
    Positive,
}

/// Residual and Hessian of inertia, elasticity and loads at the iterate.
pub(crate) fn assemble(model: &Model, state: &State, scratch: &mut Scratch, h: f64, hessian: Hessian) {
    let exact = hessian == Hessian::Exact;
    let inv_h2 = 1.0 / (h * h);
    let system = &mut scratch.system;
    let rhs = &mut scratch.rhs;
    for (rod, _) in &scratch.rods {
        let last = rod.end - 1;
        for i in rod.clone() {
            let w = model.mass[i] * inv_h2;
            system.diagonal[2 * i] = DMat3::from_diagonal(DVec3::splat(w));
            rhs[2 * i] = (scratch.target[i] - state.position[i]) * w + scratch.force[i];
            system.next[2 * i] = DMat3::ZERO;
            system.after[2 * i] = DMat3::ZERO;
            system.next[2 * i + 1] = DMat3::ZERO;
            system.after[2 * i + 1] = DMat3::ZERO;
        }
        system.diagonal[2 * last + 1] = DMat3::IDENTITY;
        rhs[2 * last + 1] = DVec3::ZERO;
        for e in rod.start..last {
            // Spin inertia in world axes; its change with the frame (gyroscopic moment) is of the order (radius / length)^2 for a
            // thread and is left out.
            let r = DMat3::from_quat(state.orientation[e]);
            let inertia = congruent(&r, model.inertia[e] * inv_h2);
            let off = log(scratch.target_frame[e] * state.orientation[e].conjugate());
            system.diagonal[2 * e + 1] = inertia;
            rhs[2 * e + 1] = inertia * off + scratch.torque[e];
        }
        for e in rod.start..last {
            let r = DMat3::from_quat(state.orientation[e]);
            let d = state.position[e + 1] - state.position[e];
            let l = model.rest_length[e];
            let k = model.stretch_stiffness[e];
            let mut f = element_strain(model, state, e) * k;
            if model.inextensible[e] {
                f.z += scratch.tension[e];
            }
            let force = r * f;
            rhs[2 * e] += force;
            rhs[2 * e + 2] -= force;
            rhs[2 * e + 1] += d.cross(force);
            let kw = congruent(&r, k);
            // Geometric stiffness. On motions that keep the element's length and shear, u = phi x d, the second derivative is
            // f.d phi^2 - (phi.f)(phi.d): the tension acts on positions, the shear force couples twist with rotation across.
            let t = r.z_axis;
            let tension = if exact { scratch.tension[e] } else { scratch.tension[e].max(0.0) };
            let geometric = (DMat3::IDENTITY - outer(t, t)) * (tension / l);
            let kx = kw + geometric;
            if exact {
                let shear = (r.x_axis * scratch.shear[e].x + r.y_axis * scratch.shear[e].y) * (0.5 * l);
                system.diagonal[2 * e + 1] -= outer(shear, t) + outer(t, shear);
            }
            let dx = skew(d);
            let kd = kw * dx;
            system.diagonal[2 * e] += kx;
            system.diagonal[2 * e + 2] += kx;
            system.after[2 * e] -= kx;
            system.next[2 * e] -= kd;
            system.next[2 * e + 1] += kd.transpose();
            system.diagonal[2 * e + 1] -= dx * kd;
        }
        for e in rod.start + 1..last {
            if !scratch.joint_on[e] {
                continue;
            }
            let j = strain::joint(state.orientation[e - 1], state.orientation[e], model.rest_half[e]);
            let (moment, b) = joint_terms(&j, state.plastic[e], scratch.start_angle[e], model.bend_stiffness[e], model.bend_damping[e], h);
            rhs[2 * e - 1] += moment;
            rhs[2 * e + 1] -= moment;
            system.diagonal[2 * e - 1] += b;
            system.diagonal[2 * e + 1] += b;
            system.after[2 * e - 1] -= b;
            if exact {
                // Rotations do not commute: relative to the joint, exp(-phi0) exp(phi1) turns by phi1 - phi0 - phi0 x phi1 / 2.
                system.after[2 * e - 1] += skew(moment) * 0.5;
            }
        }
    }
    for c in &scratch.clamps {
        let e = c.frame as usize;
        let (moment, b) = clamp_terms(c, state.orientation[e], h);
        if c.first {
            rhs[2 * e + 1] -= moment;
        } else {
            rhs[2 * e + 1] += moment;
        }
        system.diagonal[2 * e + 1] += b;
    }
}

/// Moment in world axes that the joint exerts on its first frame, and the stiffness against relative rotation.
#[inline]
fn joint_terms(j: &strain::Joint, plastic: DVec3, start: DVec3, stiffness: DVec3, damping: f64, h: f64) -> (DVec3, DMat3) {
    let gamma = damping / h;
    let moment = stiffness * ((j.angle - plastic) + (j.angle - start) * gamma);
    let jt = j.derivative.transpose();
    let b = stiffness * (1.0 + gamma);
    (jt * moment, congruent(&jt, b))
}

/// The same for a clamp. The moment is that on the first of the two.
pub(crate) fn clamp_terms(c: &ClampJoint, q: DQuat, h: f64) -> (DVec3, DMat3) {
    let j = if c.first { strain::joint(c.orientation, q, c.rest_half) } else { strain::joint(q, c.orientation, c.rest_half) };
    joint_terms(&j, DVec3::ZERO, c.start, c.stiffness, c.damping, h)
}

/// `a diag(k) a^T`.
#[inline]
fn congruent(a: &DMat3, k: DVec3) -> DMat3 {
    let s = DMat3::from_cols(a.x_axis * k.x, a.y_axis * k.y, a.z_axis * k.z);
    s * a.transpose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::exp;
    use crate::{Material, RodSpec, World};

    /// Numbers in [-0.5, 0.5) from a seed.
    fn noise(seed: &mut u64) -> f64 {
        *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    }

    fn vector(seed: &mut u64) -> DVec3 {
        DVec3::new(noise(seed), noise(seed), noise(seed))
    }

    #[test]
    fn the_exact_hessian_is_the_derivative_of_the_residual() {
        // A bent, twisted, stretched rod with soft section, so that every term matters.
        let mut seed = 7;
        let n = 5;
        let mut world = World::default();
        let spec = RodSpec::straight(DVec3::ZERO, DVec3::X * 0.05, n, 2e-3, Material::elastic(1e6, 1000.0));
        world.insert_rod(&spec).unwrap();
        let (model, mut state) = world.into_parts();
        for i in 0..=n {
            state.position[i] += vector(&mut seed) * DVec3::new(0.0, 5e-4, 5e-4) + DVec3::X * (2e-5 * i as f64);
        }
        let mut frame = state.orientation[0];
        for e in 0..n {
            let t = (state.position[e + 1] - state.position[e]).normalize();
            frame = crate::math::rotation_arc(frame * DVec3::Z, t) * frame;
            state.orientation[e] = exp(vector(&mut seed) * 3e-3) * frame * exp(DVec3::Z * 0.02 * e as f64);
        }
        let mut scratch = Scratch::default();
        scratch.fit(&model);
        let h = 10.0; // inertia out of the way
        let gradient = |state: &State, scratch: &mut Scratch| {
            scratch.target.copy_from_slice(&state.position);
            scratch.target_frame.copy_from_slice(&state.orientation);
            for e in 0..n {
                let f = element_strain(&model, state, e) * model.stretch_stiffness[e];
                (scratch.tension[e], scratch.shear[e]) = (f.z, f.truncate());
            }
            assemble(&model, state, scratch, h, Hessian::Exact);
            scratch.rhs.iter().map(|v| -*v).collect::<Vec<_>>()
        };
        let moved = |v: &[DVec3], eps: f64| {
            let mut s = State::default();
            s.copy_from(&state);
            for i in 0..=n {
                s.position[i] += v[2 * i] * eps;
                s.orientation[i] = exp(v[2 * i + 1] * eps) * s.orientation[i];
            }
            s
        };
        let product = |scratch: &Scratch, v: &[DVec3], w: &[DVec3]| {
            let s = &scratch.system;
            let nodes = 2 * (n + 1);
            (0..nodes)
                .map(|k| {
                    let mut sum = v[k].dot(s.diagonal[k] * w[k]);
                    if k + 1 < nodes {
                        sum += v[k].dot(s.next[k] * w[k + 1]) + w[k].dot(s.next[k] * v[k + 1]);
                    }
                    if k + 2 < nodes {
                        sum += v[k].dot(s.after[k] * w[k + 2]) + w[k].dot(s.after[k] * v[k + 2]);
                    }
                    sum
                })
                .sum::<f64>()
        };
        for _ in 0..20 {
            // Motions that keep length and shear to first order are those for which the tension term is exact.
            let mut v: Vec<DVec3> = vec![DVec3::ZERO; 2 * (n + 1)];
            for e in 0..n {
                v[2 * e + 1] = vector(&mut seed);
                let d = state.position[e + 1] - state.position[e];
                v[2 * e + 2] = v[2 * e] + v[2 * e + 1].cross(d);
            }
            v[2 * n + 1] = DVec3::ZERO;
            gradient(&state, &mut scratch);
            let want = product(&scratch, &v, &v);
            let e = 1e-5;
            let up = gradient(&moved(&v, e), &mut scratch);
            let down = gradient(&moved(&v, -e), &mut scratch);
            // The frame of the last, unused node does not count.
            let got: f64 = (0..2 * n + 1).map(|k| (up[k] - down[k]).dot(v[k]) / (2.0 * e)).sum();
            // Left out: second derivatives of the joint's own angle, of the order angle^2 / 6, with angles of 0.1 here.
            assert!((got / want - 1.0).abs() < 3e-3, "{got:e} {want:e}");
        }
    }
}
