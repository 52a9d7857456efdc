//! The step. Stage order is decided here and nowhere else.

use crate::budget::{self, Settled};
use crate::collide::{self, Clearance};
use crate::integrator::{self, Method, Stage, touches_anew};
use crate::math::{Pose, exp, log};
use crate::model::Model;
use crate::model::grip::{Drive, Hold, LoadKind};
use crate::model::rod::{RodModel, Stretch};
use crate::model::shape::ShapeMotion;
use crate::newton;
use crate::params::{Integrator, Solver};
use crate::pbd;
use crate::reel;
use crate::report::{Incident, IncidentKind, Rejection, StepReport};
use crate::rod::strain;
use crate::row;
use crate::scratch::{ClampJoint, Freedom, Scratch};
use crate::state::{GripState, Onset, State};
use crate::view::View;
use glam::{DQuat, DVec3};

/// One call of `World::step`: its interval, and who watches.
pub(crate) struct Interval<'a> {
    /// Simulated time at its start and its length \[s\].
    pub start: f64,
    pub length: f64,
    pub observe: &'a mut dyn FnMut(View<'_>),
}

/// Advances the whole world by the interval, in equal substeps no longer than the setting.
pub(crate) fn step(
    model: &mut Model,
    state: &mut State,
    scratch: &mut Scratch,
    interval: &mut Interval<'_>,
    report: &mut StepReport,
) {
    if let Solver::Paper(p) = model.settings.solver {
        pbd::step(model, state, scratch, interval, &p, report);
        return;
    }
    scratch.fit(model);
    outside_forces(model, state, scratch);
    let n = (interval.length / model.settings.substep * (1.0 - 1e-9)).ceil().max(1.0);
    let h = interval.length / n;
    report.converged = true;
    scratch.held.clear();
    state.time = interval.start;
    (scratch.work, scratch.spent, scratch.last_work, scratch.cut) = (0.0, 0.0, 0.0, false);
    // Where shorter and shorter substeps found no way within what a step may take, one is found now, whatever it takes.
    let shortest = 0.75 * 0.5_f64.powi(model.settings.halvings as i32);
    let starved = state.last_h > 0.0 && state.last_h < model.settings.substep * STARVED.max(shortest);
    scratch.allowed = model.step_work.filter(|_| !starved).unwrap_or(f64::INFINITY);
    let whole = (0..n as u32).all(|k| {
        if reel::renumber(model, state, h) {
            scratch.fit(model);
            state.interrupt(Onset::Unknown);
            // Who looks from state to state must not lose sight of the motion to come.
            (interval.observe)(View { model, state });
        }
        scratch.spent += core::mem::take(&mut scratch.work);
        advance(model, state, scratch, interval, interval.start + h * f64::from(k), h, 0, report)
    });
    tell_lengths(model, state, report);
    // Where nothing acceptable was found, what is driven stays with the rest.
    let reached = if whole { 1.0 } else { (state.time - interval.start) / interval.length };
    for (_, grip) in state.grips.iter_mut() {
        let held =
            scratch.held.iter().find(|(rod, _)| *rod == grip.rod).map(|(_, t)| (t - interval.start) / interval.length);
        grip.pose = grip.pose.interpolate(&grip.target, held.unwrap_or(reached));
    }
    report.simulated = reached * interval.length;
    (report.work, report.cut) = (scratch.spent + scratch.work, scratch.cut);
    if !scratch.cut {
        state.time = interval.start + interval.length;
    }
}

/// Tension over E A that no inextensible thread keeps its length under: no thread bears as much.
const UNBEARABLE: f64 = 0.5;

/// Tension over E A from which an inextensible thread may be why a substep is not acceptable.
const TAUT: f64 = 1e-3;

/// Most that a thread keeps of its tension, over E A, where it begins to stretch.
const KEPT_TENSION: f64 = 0.05;

/// Halvings down to which a substep is not taken that makes energy.
const FINE: u32 = 4;

/// Halvings after which taut inextensible threads stretch, if there is still no acceptable substep.
const GIVE_WAY: u32 = 4;

/// Accepted substeps of one length before twice the length is tried again.
const CALM: u32 = 6;

/// Substep over the one that is wanted, below which a step finds one whatever it takes.
const STARVED: f64 = 1.0 / 48.0;

/// Part of what a step may take that a substep which found no end in it took, for the next step to try half of it.
const TOO_LONG: f64 = 0.5;

/// Advances from `t` by `h`, or in two halves when the result is not acceptable. False when it got stuck.
#[allow(clippy::too_many_arguments, reason = "the recursion on halves hands all of them on")]
fn advance(
    model: &mut Model,
    state: &mut State,
    scratch: &mut Scratch,
    interval: &mut Interval<'_>,
    t: f64,
    h: f64,
    depth: u32,
    report: &mut StepReport,
) -> bool {
    // Where substeps had to be short a while ago they start short.
    if depth < model.settings.halvings
        && state.last_h > 0.0
        && h > state.last_h * if state.calm < CALM { 1.5 } else { 3.0 }
    {
        let half = 0.5 * h;
        return advance(model, state, scratch, interval, t, half, depth + 1, report)
            && advance(model, state, scratch, interval, t + half, half, depth + 1, report);
    }
    // Rather less than what would be thrown away.
    if report.substeps > 0
        && scratch.held.is_empty()
        && scratch.spent + scratch.work + scratch.last_work > scratch.allowed
    {
        scratch.cut = true;
        return false;
    }
    let before = scratch.spent + scratch.work;
    save(state, scratch, depth);
    let reels = reel::turn(model, state, h);
    if reels {
        outside_forces(model, state, scratch);
    }
    // Length that comes in has no past to go by.
    let mut method = if reels { Method::Euler } else { Method::of(model, state.onset, h) };
    let mut attempt = solve(model, state, scratch, interval, t, h, depth, method, report);
    if attempt.too_coarse {
        // What stops or jumps has no second derivative to go by, and would bounce; what turns too far in a substep
        // would gain energy.
        restore(state, scratch, depth);
        method = Method::Euler;
        attempt = solve(model, state, scratch, interval, t, h, depth, method, report);
    }
    let Attempt { outcome, verdict, .. } = attempt;
    match verdict {
        Ok(clearance) => {
            if model.settings.integrator == Integrator::TrBdf2 {
                if reels || method == Method::Euler && touches_anew(&scratch.saved[depth as usize], state) {
                    state.interrupt(Onset::Broken);
                } else {
                    state.onset = Onset::Smooth;
                }
            }
            scratch.last_work = scratch.spent + scratch.work - before;
            scratch.allowed = model.step_work.unwrap_or(f64::INFINITY);
            let last = state.last_h;
            state.last_h = if depth == 0 { 0.0 } else { h };
            state.calm = if h > 1.5 * last { 0 } else { state.calm.saturating_add(1) };
            state.time = t + h;
            report.substeps += 1;
            report.residual = report.residual.max(outcome.residual);
            report.thread_clearance = least(report.thread_clearance, clearance.thread);
            report.shape_clearance = least(report.shape_clearance, clearance.shape);
            if !outcome.converged {
                report.converged = false;
                report.incidents.push(Incident {
                    time: state.time,
                    kind: IncidentKind::NotConverged { residual: outcome.residual },
                });
            }
            (interval.observe)(View { model, state });
            true
        }
        Err(reason) => {
            report.rejected += 1;
            let last = depth >= model.settings.halvings || scratch.exhausted();
            restore(state, scratch, depth);
            reel::follow(model, state);
            if scratch.late() {
                if report.substeps == 0 || scratch.spent + scratch.work - before > TOO_LONG * scratch.allowed {
                    (state.last_h, state.calm) = (0.5 * h, 0);
                }
                scratch.cut = true;
                return false;
            }
            let taut = if last || depth >= GIVE_WAY { TAUT } else { UNBEARABLE };
            if let_stretch(model, state, scratch, taut) {
                return advance(model, state, scratch, interval, t, h, depth, report);
            }
            (state.last_h, state.calm) = (0.5 * h, 0);
            if !last {
                let half = 0.5 * h;
                return advance(model, state, scratch, interval, t, half, depth + 1, report)
                    && advance(model, state, scratch, interval, t + half, half, depth + 1, report);
            }
            if let Some(rods) = hold_refused(model, scratch, t) {
                report.incidents.push(Incident {
                    time: t,
                    kind: IncidentKind::Held { reason, rods: rods.map(|r| model.rods.handle(r)) },
                });
                report.converged = false;
                (state.last_h, state.calm) = (0.0, 0);
                return advance(model, state, scratch, interval, t, h, depth, report);
            }
            let kind =
                if reason == Rejection::NotFinite { IncidentKind::NotFinite } else { IncidentKind::Stuck { reason } };
            report.incidents.push(Incident { time: t, kind });
            report.converged = false;
            state.last_h = 0.0;
            // Rest: what moved into this state must not push again.
            state.velocity.fill(DVec3::ZERO);
            state.angular_velocity.fill(DVec3::ZERO);
            state.interrupt(Onset::Unknown);
            false
        }
    }
}

/// Holds the rods for which the last attempt was refused where they are, for the rest of the step; which ones. None
/// when that is no help: they are held already, or nothing else is there to go on. (What threads share at a weld, and
/// reels, would need more: then all stops.)
fn hold_refused(model: &Model, scratch: &mut Scratch, t: f64) -> Option<[u32; 2]> {
    let rods = scratch.refused.take()?;
    if model.welds.len() > 0 || !scratch.brakes.is_empty() {
        return None;
    }
    let before = scratch.held.len();
    for rod in rods {
        if scratch.held.iter().all(|(r, _)| *r != rod) {
            scratch.held.push((rod, t));
        }
    }
    (scratch.held.len() > before && scratch.held.len() < scratch.rods.len()).then_some(rods)
}

/// Tension over E A of the element of a rod that was last found to be pulled or pressed most.
fn most_pulled(model: &Model, scratch: &Scratch, rod: &RodModel) -> f64 {
    rod.elements()
        .map(|e| scratch.tension[e] / model.section[e].ea)
        .fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a })
}

/// Inextensible threads that keep their length.
fn keeping<'a>(model: &'a Model, scratch: &'a Scratch) -> impl Iterator<Item = &'a RodModel> {
    model
        .rods
        .iter()
        .map(|(_, rod)| rod)
        .filter(|r| r.stretch == Stretch::Inextensible && scratch.stretches[r.first as usize].is_none())
}

/// Greatest tension over E A of inextensible threads that keep their length.
fn tautest(model: &Model, scratch: &Scratch) -> f64 {
    keeping(model, scratch).map(|rod| most_pulled(model, scratch, rod).abs()).fold(0.0, f64::max)
}

/// Inextensible threads that the last attempt found as `taut`, over E A, or more stretch as their material does from
/// here to the end of the step. Whether there are any.
fn let_stretch(model: &Model, state: &State, scratch: &mut Scratch, taut: f64) -> bool {
    let found: Vec<_> = keeping(model, scratch)
        .map(|rod| (rod.elements(), most_pulled(model, scratch, rod)))
        .filter(|(_, pulled)| pulled.abs() >= taut)
        .collect();
    for (elements, pulled) in &found {
        for e in elements.clone() {
            let ea = model.section[e].ea;
            let before = state.tension[e] - ea * crate::rod::element_strain(model, state, e).z / model.rest_length[e];
            // What is pressed along itself has no tension to begin with, and the other way round.
            let (least, most) = if *pulled > 0.0 { (0.0, KEPT_TENSION * ea) } else { (-KEPT_TENSION * ea, 0.0) };
            scratch.stretches[e] = Some(before.clamp(least, most));
        }
    }
    !found.is_empty()
}

/// Tells of inextensible threads whose tension was more than one can bear that keeps its length.
fn tell_lengths(model: &Model, state: &State, report: &mut StepReport) {
    for (slot, rod) in model.rods.iter().filter(|(_, r)| r.stretch == Stretch::Inextensible) {
        let elongation = |e: usize| (state.position[e + 1] - state.position[e]).length() / model.rest_length[e] - 1.0;
        let most = rod.elements().map(elongation).fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a });
        if most.abs() > 2.0 * newton::LENGTH_TOLERANCE {
            report.incidents.push(Incident {
                time: state.time,
                kind: IncidentKind::LengthNotKept { rod: model.rods.handle(slot), elongation: most },
            });
        }
    }
}

/// Whether everything that can be read of an accepted state is a finite number: also what is the sum or product of
/// finite ones.
pub(crate) fn all_finite(model: &Model, state: &State) -> bool {
    let grips =
        state.grips.iter().all(|(_, g)| g.force.is_finite() && g.torque.is_finite() && g.pose.position.is_finite());
    let shapes = model.shapes.iter().all(|(k, _)| state.shape_pose[k as usize].is_valid());
    let threads = state.thread_contacts.iter().all(|c| (c.normal * c.normal_force + c.friction).is_finite());
    // What threads do to a shape is read as a sum.
    let on_shapes: DVec3 = state
        .shape_contacts
        .iter()
        .map(|c| {
            let radius = model.rods.at(model.rod_of[c.element as usize]).map_or(0.0, |r| r.radius);
            let at = state.position[c.element as usize].lerp(state.position[c.element as usize + 1], c.s);
            let arm = at - c.normal * radius - state.shape_pose[c.shape as usize].position;
            let force = c.normal * c.normal_force + c.friction;
            force.abs() + arm.cross(force).abs()
        })
        .sum();
    grips && shapes && threads && on_shapes.is_finite() && crate::rod::in_proportion(model, state)
}

/// What a substep came to.
struct Attempt {
    outcome: newton::Outcome,
    verdict: Result<Clearance, Rejection>,
    /// Whether it was of second order although contacts changed in it or it made energy.
    too_coarse: bool,
}

/// The solves of a substep of length `h` from `t`, each looked at and accepted by itself.
#[allow(clippy::too_many_arguments, reason = "those of `advance`")]
fn solve(
    model: &mut Model,
    state: &mut State,
    scratch: &mut Scratch,
    interval: &Interval<'_>,
    t: f64,
    h: f64,
    depth: u32,
    method: Method,
    report: &mut StepReport,
) -> Attempt {
    let mut attempt: Option<Attempt> = None;
    for stage in method.stages(h) {
        predict(model, state, scratch, interval, t, &stage, h, depth);
        collide::detect(model, state, scratch);
        row::thread::begin(model, state, scratch);
        row::shape::begin(model, state, scratch, stage.length());
        scratch.refused = None;
        let outcome = newton::solve(model, state, scratch, stage.span, depth == model.settings.halvings);
        report.newton_iterations += outcome.iterations;
        let verdict = if !outcome.finite {
            Err(Rejection::NotFinite)
        } else if (outcome.converged || depth == model.settings.halvings) && tautest(model, scratch) >= UNBEARABLE {
            Err(Rejection::LengthNotKept)
        } else if !outcome.converged && (scratch.exhausted() || scratch.late()) {
            Err(Rejection::TooMuchWork)
        } else if !outcome.converged && depth < model.settings.halvings {
            Err(Rejection::NotConverged)
        } else {
            let pressed = collide::Pressed { threads: row::pressed_threads, shape: row::pressed_shape };
            collide::sweep(model, state, scratch, pressed).map_err(|refused| {
                scratch.refused = Some(refused.rods);
                refused.reason
            })
        };
        let mut touches = false;
        let verdict = verdict.and_then(|clearance| {
            reel::pay_out(model, state, &scratch.brakes);
            accept(model, state, scratch, &stage, h);
            let clear = [clearance.thread, clearance.shape].into_iter().flatten().all(f64::is_finite);
            if clear && all_finite(model, state) { Ok(clearance) } else { Err(Rejection::NotFinite) }
        });
        if verdict.is_ok() {
            touches = method != Method::Euler && touches_anew(&scratch.saved[depth as usize], state);
        }
        let mut so_far = match (attempt, verdict) {
            (Some(Attempt { outcome: before, verdict: Ok(c), .. }), Ok(d)) => Attempt {
                outcome: newton::Outcome {
                    converged: outcome.converged && before.converged,
                    residual: outcome.residual.max(before.residual),
                    ..outcome
                },
                verdict: Ok(Clearance { thread: least(c.thread, d.thread), shape: least(c.shape, d.shape) }),
                too_coarse: touches,
            },
            (_, verdict) => Attempt { outcome, verdict, too_coarse: touches },
        };
        if touches || so_far.verdict.is_err() {
            return so_far;
        }
        if stage.last {
            let saved = core::mem::take(&mut scratch.saved);
            let last = depth >= FINE.min(model.settings.halvings);
            match budget::settle(model, state, scratch, &saved[depth as usize], h, method, last) {
                Settled::Well => {}
                Settled::Coarse => so_far.too_coarse = true,
                Settled::Gained if !last => so_far.verdict = Err(Rejection::EnergyGained),
                Settled::Gained => {}
            }
            scratch.saved = saved;
            return so_far;
        }
        attempt = Some(so_far);
    }
    unreachable!("a method has a last solve")
}

fn least(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.min(b)),
        (a, b) => a.or(b),
    }
}

pub(crate) fn save(state: &State, scratch: &mut Scratch, depth: u32) {
    let depth = depth as usize;
    while scratch.saved.len() <= depth {
        scratch.saved.push(State::default());
    }
    scratch.saved[depth].copy_from(state);
}

pub(crate) fn restore(state: &mut State, scratch: &Scratch, depth: u32) {
    state.copy_from(&scratch.saved[depth as usize]);
}

/// Loads that do not depend on the motion.
pub(crate) fn outside_forces(model: &Model, state: &State, scratch: &mut Scratch) {
    for i in 0..model.mass.len() {
        scratch.force[i] = model.settings.gravity * model.mass[i];
        scratch.torque[i] = DVec3::ZERO;
    }
    for (_, load) in state.loads.iter() {
        let rod = model.rods.at(load.rod).expect("loads go with their rod");
        match load.kind {
            LoadKind::Point { place, force, torque } => {
                let (e, s) = place.on_element(model, rod);
                scratch.force[e] += force * (1.0 - s);
                scratch.force[e + 1] += force * s;
                scratch.torque[e] += torque;
            }
            LoadKind::Uniform { force_per_length } => {
                for e in rod.elements() {
                    let half = force_per_length * (0.5 * model.rest_length[e]);
                    scratch.force[e] += half;
                    scratch.force[e + 1] += half;
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

/// Moves the state to the iterate that Newton starts from, and places what is held. `began` is when the substep did.
#[allow(clippy::too_many_arguments, reason = "those of `solve`")]
fn predict(
    model: &Model,
    state: &mut State,
    scratch: &mut Scratch,
    interval: &Interval<'_>,
    began: f64,
    stage: &Stage,
    h: f64,
    depth: u32,
) {
    scratch.start.copy_from_slice(&state.position);
    scratch.start_frame.copy_from_slice(&state.orientation);
    scratch.start_shape_pose.clone_from(&state.shape_pose);
    scratch.freedom.fill(Freedom::Free);
    scratch.joint_on.fill(true);
    scratch.clamps.clear();
    scratch.rows.welds.begin(model, state, &mut scratch.joint_on, stage.length());
    crate::rod::brake::begin(model, state, &mut scratch.brakes);
    let saved = core::mem::take(&mut scratch.saved);
    let origin = &saved[depth as usize];
    integrator::carry(model, state, scratch, origin, stage, h);
    for (slot, _) in &scratch.held {
        let rod = model.rods.at(*slot).expect("rods live through a step");
        for i in rod.particles() {
            (state.position[i], state.orientation[i]) = (scratch.start[i], scratch.start_frame[i]);
            (scratch.freedom[2 * i], scratch.freedom[2 * i + 1]) = (Freedom::Held, Freedom::Held);
        }
    }
    let t = began + stage.end;
    for (slot, grip) in state.grips.iter() {
        if scratch.held.iter().any(|(rod, _)| *rod == grip.rod) {
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
                scratch.freedom[2 * i] = Freedom::Held;
                state.position[i] = position;
            }
            Some((direction, force, damper)) if force > 0.0 => {
                let from = if stage.weights.is_some() {
                    scratch.target[i] - scratch.carried[i] * stage.span
                } else {
                    scratch.start[i]
                };
                let (force, damper) = (force * count, damper * count);
                if matches!(grip.drive, Drive::Hand { .. }) {
                    scratch.freedom[2 * i] = Freedom::Led { force: direction * force, damper, from };
                    state.position[i] = scratch.start[i];
                    return;
                }
                scratch.freedom[2 * i] = Freedom::Line { direction, force, damper, from };
                let along = direction * direction.dot(state.position[i] - scratch.start[i]);
                state.position[i] = scratch.start[i] + along;
            }
            Some(_) => {
                scratch.freedom[2 * i] = Freedom::Held;
                state.position[i] = scratch.start[i];
            }
        };
        match grip.hold {
            Hold::Pin => place(i, pose.position),
            Hold::Clamp if let Some(weld) = model.weld_of[i] => {
                // The weld's own half joints hold on to its cross-section.
                place(i, pose.position);
                state.weld_orientation[weld as usize] = pose.orientation;
                scratch.rows.welds.hold_turning(weld);
            }
            Hold::Clamp => {
                place(i, pose.position);
                if i > first && i < first + rod.n_elements as usize {
                    scratch.joint_on[i] = false;
                }
                let stiffness = |e: usize| model.section[e].bend / (0.5 * model.rest_length[e]);
                let sides =
                    [(i > first).then(|| (i - 1, false)), (i < first + rod.n_elements as usize).then_some((i, true))];
                for (e, before) in sides.into_iter().flatten() {
                    // Damping acts against the clamp's own orientation.
                    let held = |t: f64| grip_pose(grip, interval, t).orientation;
                    let pair = |held: DQuat, q: DQuat| if before { [held, q] } else { [q, held] };
                    let angle = |[a, b]: [DQuat; 2]| strain::joint_angle(a, b, grip.rest_half);
                    let now = pair(held(t - stage.length()), scratch.start_frame[e]);
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
                    scratch.clamps.push(ClampJoint {
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
                scratch.freedom[2 * i + 1] = Freedom::Held;
                state.orientation[i] = pose.orientation;
                scratch.target_frame[i] = pose.orientation;
                scratch.carried_spin[i] = log(pose.orientation * scratch.start_frame[i].conjugate()) / stage.length();
            }
        }
    }
    scratch.rows.welds.predict(model, state, &mut scratch.freedom, stage.length());
    move_shapes(model, state, interval, t, stage.length());
    scratch.saved = saved;
}

/// Moves driven shapes on to time `t`, by a time `length`.
pub(crate) fn move_shapes(model: &Model, state: &mut State, interval: &Interval<'_>, t: f64, length: f64) {
    for (slot, shape) in model.shapes.iter() {
        let k = slot as usize;
        if matches!(shape.motion, ShapeMotion::Driven) {
            // Rate that reaches the target at the end of the interval; equal to interpolating from its start.
            let left = interval.start + interval.length - (t - length);
            let s = if left > length { length / left } else { 1.0 };
            state.shape_pose[k] = state.shape_pose[k].interpolate(&state.shape_target[k], s);
        }
    }
}

/// Velocities from the motion, damping, plastic flow, and what the next substep starts from.
fn accept(model: &Model, state: &mut State, scratch: &mut Scratch, stage: &Stage, h: f64) {
    integrator::leave_rates(model, state, scratch, stage, h);
    for (rod, _) in &scratch.rods {
        for e in rod.start..rod.end - 1 {
            let strain = crate::rod::element_strain(model, state, e);
            state.tension[e] =
                if model.inextensible[e] { scratch.tension[e] } else { strain.z * model.stretch_stiffness[e].z };
        }
    }
    yield_plastic(model, state);
    row::thread::finish(state, scratch);
    row::shape::finish(model, state, scratch);
    reactions(model, state, scratch, stage.span);
}

/// Bend and twist beyond yield become permanent (return mapping with isotropic hardening, bending radially in the two
/// directions).
fn yield_plastic(model: &Model, state: &mut State) {
    for (_, rod) in model.rods.iter() {
        let Some(p) = rod.material.plasticity else { continue };
        // Plastic modulus so that the slope after yield is `hardening` times the elastic one.
        let harden = p.hardening / (1.0 - p.hardening);
        for e in rod.elements().skip(1).filter(|e| model.weld_of[*e].is_none()) {
            let l = model.joint_length[e];
            let a = crate::rod::joint_angle(model, state, e);
            let grown = 1.0 + harden * state.hardened[e];
            let bend = (a.x * a.x + a.y * a.y).sqrt();
            let over = bend - p.yield_curvature * l * grown;
            if over > 0.0 {
                let flow = over / (1.0 + harden);
                state.plastic[e] += DVec3::new(a.x, a.y, 0.0) * (flow / bend);
                state.hardened[e] += flow / (p.yield_curvature * l);
            }
            let over = a.z.abs() - p.yield_twist * l * grown;
            if over > 0.0 {
                let flow = over / (1.0 + harden);
                state.plastic[e].z += flow * a.z.signum();
                state.hardened[e] += flow / (p.yield_twist * l);
            }
        }
    }
}

/// Force and torque of each grip on its thread, from what was left unbalanced at its nodes.
fn reactions(model: &Model, state: &mut State, scratch: &mut Scratch, h: f64) {
    newton::unbalanced(model, state, scratch, h);
    // At a weld all threads together.
    let rhs = &scratch.rhs;
    let lacking = |i: usize| match model.weld_of[i].and_then(|w| model.welds.at(w)) {
        Some(weld) => weld.members.iter().map(|m| rhs[2 * m.index(model)]).sum(),
        None => rhs[2 * i],
    };
    let (position, grips) = (&state.position, &mut state.grips);
    for (slot, grip) in grips.iter_mut() {
        let rod = model.rods.at(grip.rod).expect("grips go with their rod");
        let i = rod.first as usize + grip.index as usize;
        grip.torque = DVec3::ZERO;
        grip.force = -lacking(i);
        match grip.hold {
            Hold::Pin => {}
            Hold::Clamp if let Some(weld) = model.weld_of[i] => grip.torque = -scratch.rows.welds.moment(weld),
            Hold::Clamp => {
                for c in scratch.clamps.iter().filter(|c| c.grip == slot) {
                    let (moment, _) = crate::rod::assemble::clamp_terms(c, state.orientation[c.frame as usize]);
                    grip.torque += if c.first { -moment } else { moment };
                }
            }
            Hold::Jaw => {
                let other = -lacking(i + 1);
                let arm = (position[i + 1] - position[i]) * 0.5;
                grip.torque = arm.cross(other - grip.force) - scratch.rhs[2 * i + 1];
                grip.force += other;
            }
        }
        if grip.drive != Drive::Pose {
            let middle = if grip.hold == Hold::Jaw { (position[i] + position[i + 1]) * 0.5 } else { position[i] };
            grip.pose.position = middle;
            grip.target.position = middle;
        }
    }
}

/// Orientation held by a clamp that carries the moment there now.
pub(crate) fn clamp_orientation(before: Option<DQuat>, after: Option<DQuat>, rest_half: DQuat) -> DQuat {
    match (before, after) {
        (Some(a), Some(b)) => (a * crate::math::half(a.conjugate() * b)).normalize(),
        (None, Some(b)) => (b * (rest_half * rest_half).conjugate()).normalize(),
        (Some(a), None) => (a * rest_half * rest_half).normalize(),
        (None, None) => DQuat::IDENTITY,
    }
}
