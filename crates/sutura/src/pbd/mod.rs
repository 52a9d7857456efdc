//! The solver of the 2018 paper, "Real-time inextensible surgical thread simulation", over the same model and state:
//! kept as published, for reproduction and comparison. Order of its stages (rows P-1, P-2): predict, find what meets on
//! the way, iterations of shear and stretch, bend and twist, lengths, contact, friction; velocities; damping. Theory 17
//! says what was changed and why.

mod constraints;
mod contact;
mod ddc;
mod number;
mod sweep;

use crate::drive::{Interval, grip_pose, move_shapes, outside_forces};
use crate::finite::{all_finite, in_proportion};
use crate::math::Pose;
use crate::model::Model;
use crate::model::grip::{Drive, Hold};
use crate::model::shape::ShapeMotion;
use crate::motion;
use crate::params::PaperSettings;
use crate::report::{Incident, IncidentKind, StepReport};
use crate::state::{History, State};
use crate::view::View;
use constraints::{BendTwist, StretchShear};
use contact::{Contacts, Motion};
use ddc::Chain;
use glam::{DQuat, DVec3};
use sweep::Sweep;

/// Working memory.
#[derive(Default)]
pub(crate) struct Work {
    /// State at the start of the substep.
    saved: State,
    motion: motion::Motion,
    /// Radius of the thread of each element \[m\].
    radius: Vec<f64>,
    /// Zero where a grip holds.
    inverse_mass: Vec<f64>,
    inverse_inertia: Vec<f64>,
    sweep: Sweep,
    chain: Chain,
    contacts: Contacts,
}

/// Advances the whole world by the interval, in equal substeps no longer than the setting.
pub(crate) fn step(
    model: &Model,
    state: &mut State,
    work: &mut Work,
    interval: &mut Interval<'_>,
    p: &PaperSettings,
    report: &mut StepReport,
) {
    if let Some(what) = unknown(model, state) {
        report.incidents.push(Incident { time: interval.start, kind: IncidentKind::NotInPaper { what } });
        state.time = interval.start + interval.length;
        return;
    }
    work.motion.fit(model);
    work.radius.clear();
    work.radius.extend(model.rod_of.iter().map(|r| model.rods.at(*r).map_or(0.0, |r| r.radius)));
    outside_forces(model, state, &mut work.motion);
    weigh(model, state, work, p);
    let n = (interval.length / model.settings.substep * (1.0 - 1e-9)).ceil().max(1.0);
    let h = interval.length / n;
    report.converged = true;
    for k in 1..=n as u32 {
        work.saved.copy_from(state);
        let t = interval.start + h * f64::from(k);
        if !substep(model, state, work, interval, p, t, h) {
            state.copy_from(&work.saved);
            state.velocity.fill(DVec3::ZERO);
            state.angular_velocity.fill(DVec3::ZERO);
            report.incidents.push(Incident { time: state.time, kind: IncidentKind::NotFinite });
            report.converged = false;
            break;
        }
        state.time = t;
        report.substeps += 1;
        report.contacts = work.contacts.touching() as u32;
        (interval.observe)(View { model, state });
    }
    let reached = (state.time - interval.start) / interval.length;
    for (_, grip) in state.grips.iter_mut() {
        grip.pose = grip.pose.interpolate(&grip.target, reached);
    }
    report.simulated = reached * interval.length;
    state.time = interval.start + interval.length;
}

/// What the world has and the paper has not.
pub(crate) fn unknown(model: &Model, state: &State) -> Option<&'static str> {
    if model.welds.iter().next().is_some() {
        return Some("a weld or a closed thread");
    }
    if state.reels.iter().next().is_some() {
        return Some("a reel");
    }
    // Set may be left of a material that took some.
    if model.rods.iter().any(|(_, r)| r.material.plasticity.is_some())
        || state.plastic.iter().any(|a| *a != DVec3::ZERO)
    {
        return Some("plastic set");
    }
    if model.shapes.iter().any(|(_, s)| matches!(s.motion, ShapeMotion::Pushed { .. })) {
        return Some("a shape pushed by a force");
    }
    if model.bodies.iter().next().is_some() {
        return Some("a free body");
    }
    state.grips.iter().any(|(_, g)| g.drive != Drive::Pose).then_some("a grip driven by force")
}

/// Inverse masses, and all of the constraints that does not change in a step.
fn weigh(model: &Model, state: &State, work: &mut Work, p: &PaperSettings) {
    let n = model.mass.len();
    let Work { inverse_mass: w, inverse_inertia: wq, sweep, chain, .. } = work;
    w.clear();
    w.extend(model.mass.iter().map(|m| 1.0 / m));
    wq.clear();
    wq.extend((0..n).map(|e| {
        let l = model.rest_length[e];
        if model.is_element(e) { 1.0 / (p.frame_inertia * model.section[e].mass * l * l * l) } else { 0.0 }
    }));
    for (_, grip) in state.grips.iter() {
        let rod = model.rods.at(grip.rod).expect("grips go with their rod");
        let i = (rod.first + grip.index) as usize;
        w[i] = 0.0;
        match grip.hold {
            Hold::Pin => {}
            Hold::Clamp => {
                for e in [i.wrapping_sub(1), i].into_iter().filter(|e| rod.elements().contains(e)) {
                    wq[e] = 0.0;
                }
            }
            Hold::Jaw => (w[i + 1], wq[i]) = (0.0, 0.0),
        }
    }
    sweep.set(
        p.order,
        (0..n).map(|e| {
            let (l, ends) =
                if model.is_element(e) { (model.rest_length[e], [w[e], w[e + 1]]) } else { (1.0, [0.0, 0.0]) };
            let pair = if model.is_joint(e) { [wq[e - 1], wq[e]] } else { [0.0, 0.0] };
            let rest = model.rest_half[e] * model.rest_half[e];
            (
                StretchShear::new(l, ends, wq[e], p.stretch_shear),
                BendTwist::new(rest, pair, DVec3::new(p.bend[0], p.bend[1], p.twist)),
            )
        }),
    );
    chain.resize(n);
}

/// One step of the paper, to time `t`. False where a number is not finite.
fn substep(
    model: &Model,
    state: &mut State,
    work: &mut Work,
    interval: &Interval<'_>,
    p: &PaperSettings,
    t: f64,
    h: f64,
) -> bool {
    predict(model, state, work, h);
    hold(model, state, interval, t);
    move_shapes(model, state, interval, t, h);
    if !state.position.iter().all(|x| crate::math::is_place(*x)) {
        return false;
    }
    let way = Motion {
        from: &work.motion.start,
        to: &state.position,
        radius: &work.radius,
        inverse_mass: &work.inverse_mass,
        shapes_from: &work.motion.start_shape_pose,
    };
    work.contacts.detect(model, state, &way);
    for _ in 0..p.iterations {
        project(model, state, work, p);
    }
    leave_rates(model, state, &work.motion, h);
    all_finite(model, state) && in_proportion(model, state)
}

/// Explicit Euler under outside forces and torques.
fn predict(model: &Model, state: &mut State, work: &mut Work, h: f64) {
    let Work { motion, inverse_mass: w, inverse_inertia: wq, .. } = work;
    motion.start.copy_from_slice(&state.position);
    motion.start_frame.copy_from_slice(&state.orientation);
    motion.start_shape_pose.clone_from(&state.shape_pose);
    for (_, rod) in model.rods.iter() {
        for i in rod.particles() {
            if w[i] > 0.0 {
                state.velocity[i] += motion.force[i] * (h * w[i]);
                state.position[i] += state.velocity[i] * h;
            }
        }
        for e in rod.elements() {
            if wq[e] > 0.0 {
                state.angular_velocity[e] += motion.torque[e] * (h * wq[e]);
                let q = state.orientation[e];
                let spin = state.angular_velocity[e] * (0.5 * h);
                state.orientation[e] = (q + DQuat::from_xyzw(spin.x, spin.y, spin.z, 0.0) * q).normalize();
            }
        }
    }
}

/// Places what grips hold where they want it at time `t`.
fn hold(model: &Model, state: &mut State, interval: &Interval<'_>, t: f64) {
    let (position, orientation) = (&mut state.position, &mut state.orientation);
    for (_, grip) in state.grips.iter() {
        let rod = model.rods.at(grip.rod).expect("grips go with their rod");
        let i = (rod.first + grip.index) as usize;
        let pose: Pose = grip_pose(grip, interval, t);
        match grip.hold {
            Hold::Pin => position[i] = pose.position,
            Hold::Clamp => {
                position[i] = pose.position;
                let rest = grip.rest_half * grip.rest_half;
                if i > rod.first as usize {
                    orientation[i - 1] = (pose.orientation * rest.conjugate()).normalize();
                }
                if i < rod.elements().end {
                    orientation[i] = (pose.orientation * rest).normalize();
                }
            }
            Hold::Jaw => {
                let span = pose.orientation * grip.half_span;
                (position[i], position[i + 1]) = (pose.position - span, pose.position + span);
                orientation[i] = pose.orientation;
            }
        }
    }
}

/// One iteration over all constraints.
fn project(model: &Model, state: &mut State, work: &mut Work, p: &PaperSettings) {
    let (x, q) = (&mut state.position[..], &mut state.orientation[..]);
    for (_, rod) in model.rods.iter() {
        let (particles, elements) = (rod.particles(), rod.elements());
        work.sweep.project(p.order, elements.clone(), &mut x[particles.clone()], &mut q[elements.clone()]);
        if p.direct_distance {
            work.chain.project(&mut x[particles.clone()], &work.inverse_mass[particles], &model.rest_length[elements]);
        }
    }
    if work.contacts.len() > 0 {
        work.contacts.project(x, p.friction);
    }
}

/// Velocities from the way made, then damping (P-11). There are no forces: what the state keeps of those is cleared.
fn leave_rates(model: &Model, state: &mut State, motion: &motion::Motion, h: f64) {
    let s = &model.settings;
    let keep_linear = libm::pow(1.0 - s.linear_damping, h) * libm::exp(-s.linear_drag * h);
    let keep_angular = libm::pow(1.0 - s.angular_damping, h) * libm::exp(-s.angular_drag * h);
    for (_, rod) in model.rods.iter() {
        for i in rod.particles() {
            state.velocity[i] = (state.position[i] - motion.start[i]) * (keep_linear / h);
        }
        for e in rod.elements() {
            // The inverse of the prediction, but for the length of the quaternion.
            let turn = state.orientation[e] * motion.start_frame[e].conjugate();
            state.angular_velocity[e] =
                DVec3::new(turn.x, turn.y, turn.z) * (2.0_f64.copysign(turn.w) * keep_angular / h);
        }
    }
    state.tension.fill(0.0);
    state.contacts.clear();
    for (_, grip) in state.grips.iter_mut() {
        (grip.force, grip.torque) = (DVec3::ZERO, DVec3::ZERO);
    }
    (state.last_h, state.accepted_in_row) = (0.0, 0);
    state.invalidate(History::Unknown);
}
