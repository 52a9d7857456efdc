//! What is driven from outside: loads, grips, shapes.

use crate::integrator::{self, Stage};
use crate::math::{Pose, exp, log};
use crate::model::Model;
use crate::model::grip::{Drive, Hold, LoadKind};
use crate::model::shape::ShapeMotion;
use crate::motion::Motion;
use crate::newton::Solver;
use crate::rod::constraint::{ClampJoint, NodeConstraint};
use crate::rod::{brake, strain};
use crate::row::movers::{follow_holder, place_shapes};
use crate::state::{GripState, Moved, State};
use crate::view::View;
use glam::{DQuat, DVec3};

/// One call of `World::step`: its interval, and who watches.
pub(crate) struct Interval<'a> {
    /// Simulated time at its start and its length \[s\].
    pub start: f64,
    pub length: f64,
    pub observe: &'a mut dyn FnMut(View<'_>),
}

/// Loads that do not depend on the motion.
pub(crate) fn outside_forces(model: &Model, state: &State, motion: &mut Motion) {
    for i in 0..model.mass.len() {
        motion.force[i] = model.settings.gravity * model.mass[i];
        motion.torque[i] = DVec3::ZERO;
    }
    for (_, load) in state.loads.iter() {
        let rod = model.rods.at(load.rod).expect("loads go with their rod");
        match load.kind {
            LoadKind::Point { place, force, torque } => {
                let (e, s) = place.on_element(model, rod);
                motion.force[e] += force * (1.0 - s);
                motion.force[e + 1] += force * s;
                motion.torque[e] += torque;
            }
            LoadKind::Uniform { force_per_length } => {
                for e in rod.elements() {
                    let half = force_per_length * (0.5 * model.rest_length[e]);
                    motion.force[e] += half;
                    motion.force[e + 1] += half;
                }
            }
            LoadKind::Mass { .. } => {}
        }
    }
}

/// Where each grip wants its piece at time `t`.
pub(crate) fn grip_pose(grip: &GripState, interval: &Interval<'_>, t: f64) -> Pose {
    let s = ((t - interval.start) / interval.length).clamp(0.0, 1.0);
    let command = grip.pose.interpolate(&grip.target, s);
    let u = if grip.ramp > 0.0 { (t - grip.taken_at) / grip.ramp } else { 1.0 };
    if u >= 1.0 {
        return command;
    }
    let along = t - grip.taken_at;
    let own = Pose::new(
        grip.taken_pose.position + grip.taken_velocity * along,
        (exp(grip.taken_spin * along) * grip.taken_pose.orientation).normalize(),
    );
    own.interpolate(&command, smoothstep(u.max(0.0)))
}

/// 0 to 1 with zero slope at both ends.
fn smoothstep(u: f64) -> f64 {
    u * u * (3.0 - 2.0 * u)
}

/// A solve that is to begin: the substep it is in, from `began`, and the stage of it.
pub(crate) struct Begun<'a> {
    pub began: f64,
    pub h: f64,
    pub stage: &'a Stage,
    /// State at the start of the substep.
    pub origin: &'a State,
}

/// Moves the state to the iterate that Newton starts from, and places what is held. `held` are rods that stay where
/// they are.
pub(crate) fn predict(
    model: &Model,
    state: &mut State,
    solver: &mut Solver,
    interval: &Interval<'_>,
    begun: &Begun<'_>,
    held_rods: &[(u32, f64)],
) {
    let Solver { motion, rods, rows, .. } = solver;
    let Begun { began, h, stage, origin } = *begun;
    motion.start.copy_from_slice(&state.position);
    motion.start_frame.copy_from_slice(&state.orientation);
    motion.start_shape_pose.clone_from(&state.shape_pose);
    rods.constraint.fill(NodeConstraint::Free);
    rods.joint_on.fill(true);
    rods.clamps.clear();
    rows.welds.begin(model, state, &mut rods.joint_on, stage.length());
    brake::begin(model, state, &mut rods.brakes);
    integrator::carry(model, state, motion, &rods.ranges, origin, stage, h);
    for (slot, _) in held_rods {
        let rod = model.rods.at(*slot).expect("rods live through a step");
        for i in rod.particles() {
            (state.position[i], state.orientation[i]) = (motion.start[i], motion.start_frame[i]);
            (rods.constraint[2 * i], rods.constraint[2 * i + 1]) = (NodeConstraint::Held, NodeConstraint::Held);
        }
    }
    let t = began + stage.end;
    for (slot, grip) in state.grips.iter() {
        if held_rods.iter().any(|(rod, _)| *rod == grip.rod) {
            continue;
        }
        let rod = model.rods.at(grip.rod).expect("grips go with their rod");
        let first = rod.first as usize;
        let pose = grip_pose(grip, interval, t);
        let i = first + grip.index as usize;
        let (line, count) = match grip.drive {
            Drive::Pose => (None, 1.0),
            Drive::Force { direction, force, speed_limit } | Drive::Hand { direction, force, speed_limit } => {
                let u = if grip.ramp > 0.0 { ((t - grip.taken_at) / grip.ramp).clamp(0.0, 1.0) } else { 1.0 };
                let force = force * smoothstep(u);
                (
                    Some((direction, force, force / speed_limit / stage.span)),
                    if grip.hold == Hold::Jaw { 0.5 } else { 1.0 },
                )
            }
        };
        let mut place = |i: usize, position: DVec3| match line {
            None => {
                rods.constraint[2 * i] = NodeConstraint::Held;
                state.position[i] = position;
            }
            Some((direction, force, damper)) if force > 0.0 => {
                let from = if stage.weights.is_some() {
                    motion.target[i] - motion.carried[i] * stage.span
                } else {
                    motion.start[i]
                };
                let (force, damper) = (force * count, damper * count);
                if matches!(grip.drive, Drive::Hand { .. }) {
                    rods.constraint[2 * i] = NodeConstraint::Damped { force: direction * force, damper, from };
                    state.position[i] = motion.start[i];
                    return;
                }
                rods.constraint[2 * i] = NodeConstraint::Guided { direction, force, damper, from };
                let along = direction * direction.dot(state.position[i] - motion.start[i]);
                state.position[i] = motion.start[i] + along;
            }
            Some(_) => {
                rods.constraint[2 * i] = NodeConstraint::Held;
                state.position[i] = motion.start[i];
            }
        };
        match grip.hold {
            Hold::Pin => place(i, pose.position),
            Hold::Clamp if let Some(weld) = model.weld_of[i] => {
                // The weld's own half joints hold on to its cross-section.
                place(i, pose.position);
                state.weld_orientation[weld as usize] = pose.orientation;
                rows.welds.hold_turning(weld);
            }
            Hold::Clamp => {
                place(i, pose.position);
                if i > first && i < first + rod.n_elements as usize {
                    rods.joint_on[i] = false;
                }
                let stiffness = |e: usize| model.section[e].bend / (0.5 * model.rest_length[e]);
                let sides =
                    [(i > first).then(|| (i - 1, false)), (i < first + rod.n_elements as usize).then_some((i, true))];
                for (e, before) in sides.into_iter().flatten() {
                    // Damping acts against the clamp's own orientation.
                    let held = |t: f64| grip_pose(grip, interval, t).orientation;
                    let pair = |held: DQuat, q: DQuat| if before { [held, q] } else { [q, held] };
                    let angle = |[a, b]: [DQuat; 2]| strain::joint_angle(a, b, grip.rest_half);
                    let now = pair(held(t - stage.length()), motion.start_frame[e]);
                    let start = stage.weights.map_or_else(
                        || angle(now),
                        |weights| {
                            let at_start = pair(held(began), origin.orientation[e]);
                            let turning = log(pose.orientation * held(began).conjugate()) / stage.end;
                            let rate = |at: [DQuat; 2], w: DVec3| {
                                strain::joint_rate(at, if before { [turning, w] } else { [w, turning] }, grip.rest_half)
                            };
                            let [w0, w1] = integrator::spins(model, origin, state, h, e);
                            angle(at_start) + rate(at_start, w0) * weights[0] + rate(now, w1) * weights[1]
                        },
                    );
                    rods.clamps.push(ClampJoint {
                        grip: slot,
                        frame: e as u32,
                        first: before,
                        orientation: pose.orientation,
                        rest_half: grip.rest_half,
                        stiffness: stiffness(e),
                        damping: rod.material.bend_damping / stage.span,
                        start,
                    });
                }
            }
            Hold::Jaw => {
                let span = pose.orientation * grip.half_span;
                place(i, pose.position - span);
                place(i + 1, pose.position + span);
                rods.constraint[2 * i + 1] = NodeConstraint::Held;
                state.orientation[i] = pose.orientation;
                motion.target_frame[i] = pose.orientation;
                motion.carried_spin[i] = log(pose.orientation * motion.start_frame[i].conjugate()) / stage.length();
            }
        }
    }
    move_shapes(model, state, interval, t, stage.length());
    rows.welds.predict(model, state, &mut rods.constraint, stage.length());
}

/// Moves driven shapes and bodies on to time `t`, by a time `length`, and what they hold with them.
pub(crate) fn move_shapes(model: &Model, state: &mut State, interval: &Interval<'_>, t: f64, length: f64) {
    // Rate that reaches the target at the end of the interval; equal to interpolating from its start.
    let left = interval.start + interval.length - (t - length);
    let s = if left > length { length / left } else { 1.0 };
    for (slot, shape) in model.shapes.iter() {
        let k = slot as usize;
        if matches!(shape.motion, ShapeMotion::Driven) {
            state.shape_pose[k] = state.shape_pose[k].interpolate(&state.shape_target[k], s);
        }
    }
    for slot in 0..model.bodies.len() as u32 {
        let Some(body) = state.bodies.at_mut(slot) else { continue };
        if let Moved::Driven { target } = body.motion {
            let pose = body.pose().interpolate(&target, s);
            body.place(&pose);
            place_shapes(model, state, slot);
        }
    }
    (0..model.bodies.len() as u32).for_each(|slot| follow_holder(model, state, slot));
}
