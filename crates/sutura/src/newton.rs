//! One Newton solve of a substep: assemble the rods, factor, couple by contact, step, until nothing moves.
//!
//! The substep minimizes inertia + elastic energy + contact (implicit Euler). Stretch is linearized with its multiplier: the geometric
//! stiffness uses the tension that the last iteration predicted, not the one of the current strain, which makes the iteration that of
//! the mixed (dual) form and lets it take turns of a large angle although stretch is 1e8 times stiffer than bending. For inextensible
//! rods that multiplier also enters the residual (method of multipliers); its penalty is 100 EA.

use crate::math::{exp, log, outer, skew};
use crate::model::Model;
use crate::rod::{element_strain, strain};
use crate::row;
use crate::row::pushed::Sliders;
use crate::scratch::{Freedom, Scratch};
use crate::state::State;
use glam::{DMat3, DQuat, DVec2, DVec3};

/// Elongation to which inextensible elements are held.
const LENGTH_TOLERANCE: f64 = 5e-6;

/// Least part of a step that is taken: a contact met on the way must be met, or the next step does not know of it.
const SHORTEST: f64 = 0.3;
/// Force along a step after it, over the force before it and with the opposite sign, beyond which the step is shortened.
const OVERSHOOT: f64 = 0.5;

/// How a Newton solve ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Outcome {
    pub converged: bool,
    pub finite: bool,
    pub iterations: u32,
    /// Largest rotation of the last iteration \[rad\] and largest move in thread radii.
    pub turn: f64,
    pub residual: f64,
}

/// Solves the substep of length `h` from `scratch.start`, carried on to `scratch.target` by its velocity; the iterate is in `state`.
pub(crate) fn solve(model: &Model, state: &mut State, scratch: &mut Scratch, h: f64) -> Outcome {
    let settings = &model.settings;
    carried_forces(model, state, scratch);
    row::couple::begin(scratch);
    let mut out = Outcome { converged: false, finite: true, iterations: 0, turn: 0.0, residual: 0.0 };
    // Once indefinite, mostly indefinite: a substep tries the exact matrix until it fails.
    let mut exact = true;
    // Work of the forces along the last step, over its full length, and the part of it that was taken.
    let (mut gained, mut scale) = (0.0, 1.0);
    while out.iterations < settings.newton_max {
        out.iterations += 1;
        row::shape::review(model, state, scratch, out.iterations == 1);
        row::couple::zones(scratch);
        let first = out.iterations == 1;
        let mut taken = 1.0;
        loop {
            exact = exact && factor(model, state, scratch, h, Hessian::Exact, first);
            if !exact {
                factor(model, state, scratch, h, Hessian::Positive, first);
            }
            if first || taken < 0.2 || !(gained > 0.0) {
                break;
            }
            // Where the force along the last step has turned round the step went too far: contacts opened, closed or began to slide on
            // the way. Go back to where a straight line between the two forces says that it vanishes.
            let left = work(scratch);
            if left > -OVERSHOOT * gained {
                break;
            }
            let part = (gained / (gained - left)).max(SHORTEST);
            apply(model, state, scratch, -(1.0 - part) * taken * scale);
            scratch.rows.sliders.apply(state, -(1.0 - part) * taken * scale);
            taken *= part;
        }
        let blocks = core::mem::take(&mut scratch.rods);
        scratch.step.copy_from_slice(&scratch.rhs);
        for (rod, zone) in &blocks {
            scratch.system.solve(rod.clone(), zone, &mut scratch.step);
            scratch.torque_correction.apply(&scratch.system, rod, zone, &scratch.torque, &mut scratch.step);
        }
        scratch.rods = blocks;
        Sliders::factor(scratch);
        scratch.rows.sliders.couple(&mut scratch.step, false);
        row::couple::couple(state, scratch);
        gained = work(scratch);
        scale = limit(state, scratch);
        apply(model, state, scratch, scale);
        let slid = scratch.rows.sliders.apply(state, scale);
        (out.turn, out.residual) = largest_move(model, scratch, scale);
        out.residual = max_or_nan(out.residual, slid / model.rods.iter().map(|(_, r)| r.radius).fold(f64::INFINITY, f64::min));
        let stretched = inextensible_error(model, state);
        if !(out.turn.is_finite() && out.residual.is_finite()) {
            out.finite = false;
            return out;
        }
        let settled = out.turn < settings.tolerance && stretched < LENGTH_TOLERANCE && (scratch.rows.is_empty() || out.residual < 0.03);
        if std::env::var("DBG").is_ok() { eprintln!("   it {} exact {exact} taken {taken:.2} scale {scale:.2} turn {:.2e} shift {:.2e} gained {gained:.2e} settled {settled} shape {} cone {} rows {} {} loaded {} {}", out.iterations, out.turn, out.residual, row::shape::settled(model, state, scratch), row::couple::solved(scratch), scratch.rows.threads.len(), scratch.rows.shapes.len(), scratch.rows.threads.iter().filter(|r| r.force.x>0.0).count(), scratch.rows.shapes.iter().filter(|r| r.normal_force>0.0).count()); }
        if scale >= 1.0 && settled && row::couple::solved(scratch) && row::shape::settled(model, state, scratch) && !row::thread::extend(model, state, scratch) {
            out.converged = true;
            break;
        }
    }
    out
}

/// Forces carried at the start of the substep, for the first matrix. Those of the first iterate would be far off: it is where velocity
/// leads, and stretch and shear are so stiff that the second-order strain of a turn counts for newtons.
fn carried_forces(model: &Model, state: &State, scratch: &mut Scratch) {
    scratch.tension.copy_from_slice(&state.tension);
    for (rod, _) in &scratch.rods {
        for e in rod.start..rod.end - 1 {
            let d = scratch.start[e + 1] - scratch.start[e];
            let c = scratch.start_frame[e].conjugate() * d;
            scratch.shear[e] = DVec2::new(c.x, c.y) * model.stretch_stiffness[e].truncate();
        }
    }
}

/// Work of the forces at the iterate, contact forces as last found, along the last step.
fn work(scratch: &Scratch) -> f64 {
    let own: f64 = scratch.rhs.iter().zip(&scratch.step).map(|(r, z)| r.dot(*z)).sum();
    own + row::couple::work(scratch) + scratch.rows.sliders.work()
}

/// Which second derivatives of the elastic energy go into the matrix. The residual is exact in either case.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Hessian {
    /// With those of the geometry, of either sign: Newton converges in few iterations, also near buckling.
    Exact,
    /// Without those that can make it indefinite.
    Positive,
}

/// Assembles and factors. False when a pivot is not positive.
fn factor(model: &Model, state: &State, scratch: &mut Scratch, h: f64, hessian: Hessian, first: bool) -> bool {
    assemble(model, state, scratch, h, hessian);
    row::shape::assemble(model, state, scratch, h, first);
    restrict(state, scratch);
    let Scratch { system, rods, .. } = scratch;
    let mut positive = true;
    for (rod, zone) in rods.iter() {
        positive &= system.factor(rod.clone(), zone);
    }
    positive
}

/// Residual and Hessian of inertia, elasticity and loads at the iterate.
fn assemble(model: &Model, state: &State, scratch: &mut Scratch, h: f64, hessian: Hessian) {
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
pub(crate) fn clamp_terms(c: &crate::scratch::ClampJoint, q: DQuat, h: f64) -> (DVec3, DMat3) {
    let j = if c.first { strain::joint(c.orientation, q, c.rest_half) } else { strain::joint(q, c.orientation, c.rest_half) };
    joint_terms(&j, DVec3::ZERO, c.start, c.stiffness, c.damping, h)
}

/// `a diag(k) a^T`.
#[inline]
fn congruent(a: &DMat3, k: DVec3) -> DMat3 {
    let s = DMat3::from_cols(a.x_axis * k.x, a.y_axis * k.y, a.z_axis * k.z);
    s * a.transpose()
}

/// Takes held nodes out of the system and puts the drive on guided ones.
fn restrict(state: &State, scratch: &mut Scratch) {
    for node in 0..scratch.freedom.len() {
        let freedom = scratch.freedom[node];
        if freedom == Freedom::Free {
            continue;
        }
        if let Freedom::Line { direction, force, damper } = freedom {
            let moved = direction.dot(state.position[node / 2] - scratch.start[node / 2]);
            scratch.system.diagonal[node] += outer(direction, direction) * damper;
            scratch.rhs[node] += direction * (force - damper * moved);
        }
        let keep = freedom.projector();
        scratch.system.restrict(node, keep);
        scratch.rhs[node] = keep * scratch.rhs[node];
    }
}

/// Leaves in `scratch.rhs` the force and torque that each node lacks for balance without its grip: minus what the grip exerts.
pub(crate) fn unbalanced(model: &Model, state: &State, scratch: &mut Scratch, h: f64) {
    scratch.tension.copy_from_slice(&state.tension);
    for e in 0..scratch.tension.len() {
        // The multiplier alone is the tension of an inextensible element; its penalty is taken off again.
        if model.inextensible[e] && model.is_element(e) {
            scratch.tension[e] -= element_strain(model, state, e).z * model.stretch_stiffness[e].z;
        }
    }
    assemble(model, state, scratch, h, Hessian::Positive);
    row::shape::assemble(model, state, scratch, h, false);
    row::couple::add_forces(scratch);
}

/// Factor on the update: no element turns by more than 0.3 rad in an iteration, and no pair of threads gets closer than half its gap.
fn limit(state: &State, scratch: &Scratch) -> f64 {
    let turn = scratch.step.iter().skip(1).step_by(2).map(|v| v.length_squared()).fold(0.0, max_or_nan).sqrt();
    let by_turn = if turn > 0.3 { 0.3 / turn } else { 1.0 };
    by_turn.min(row::thread::limit(state, scratch, by_turn))
}

/// Maximum that keeps NaN.
#[inline]
fn max_or_nan(a: f64, b: f64) -> f64 {
    if b <= a || a.is_nan() { a } else { b }
}

fn apply(model: &Model, state: &mut State, scratch: &mut Scratch, scale: f64) {
    for r in 0..scratch.rods.len() {
        let rod = scratch.rods[r].0.clone();
        for e in rod.start..rod.end - 1 {
            // Predicted force: strain now plus its linear change.
            let (q, d) = (state.orientation[e], state.position[e + 1] - state.position[e]);
            let change = scratch.step[2 * e + 2] - scratch.step[2 * e] + d.cross(scratch.step[2 * e + 1]);
            let strain = q.conjugate() * (d + change * scale) - DVec3::new(0.0, 0.0, model.rest_length[e]);
            let f = strain * model.stretch_stiffness[e];
            scratch.tension[e] = if model.inextensible[e] { scratch.tension[e] + f.z } else { f.z };
            scratch.shear[e] = DVec2::new(f.x, f.y);
        }
        for i in rod.clone() {
            state.position[i] += scratch.step[2 * i] * scale;
        }
        for e in rod.start..rod.end - 1 {
            state.orientation[e] = (exp(scratch.step[2 * e + 1] * scale) * state.orientation[e]).normalize();
        }
    }
}

/// Largest |elongation| of an inextensible element: a second-order error of the turn that Newton just made.
fn inextensible_error(model: &Model, state: &State) -> f64 {
    let mut worst = 0.0;
    for (_, rod) in model.rods.iter().filter(|(_, r)| r.stretch == crate::Stretch::Inextensible) {
        for e in rod.elements() {
            worst = max_or_nan(worst, ((state.position[e + 1] - state.position[e]).length() / model.rest_length[e] - 1.0).abs());
        }
    }
    worst
}

fn largest_move(model: &Model, scratch: &Scratch, scale: f64) -> (f64, f64) {
    let (mut turn, mut shift) = (0.0, 0.0);
    for ((_, rod), (blocks, _)) in model.rods.iter().zip(&scratch.rods) {
        let mut far = 0.0;
        for i in blocks.clone() {
            far = max_or_nan(far, scratch.step[2 * i].length_squared());
            turn = max_or_nan(turn, scratch.step[2 * i + 1].length_squared());
        }
        shift = max_or_nan(shift, far.sqrt() / rod.radius);
    }
    (turn.sqrt() * scale, shift * scale)
}

#[cfg(test)]
mod tests {
    use super::*;
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
                scratch.tension[e] = element_strain(&model, state, e).z * model.stretch_stiffness[e].z;
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
