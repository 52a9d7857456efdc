//! Time integration: what the solves of a substep start from, and the rates that they leave.
//!
//! Every solve is one of implicit Euler's form: inertia over `span` squared about the place `target` where the rates
//! known so far lead,
//!
//! ```text
//! x* = x_n + sum w_j v_j,   v* = v_n + sum w_j a_j,   target = x* + span v*,   a = (x - target) / span^2,   v = v* + span a
//! ```
//!
//! over the rates at the start of the substep and at the end of its first solve. TR-BDF2 (Bank et al. 1985) has two
//! solves of one span: the trapezoidal rule to the part 2 - sqrt 2 of the substep, then the backward difference formula
//! over both parts. It is of second order, also in what is stiff (both of its solves end where the motion is),
//! L-stable, and needs nothing of the substep before but accelerations. Where those are not known the method of
//! Alexander (1977) takes a substep, with the same stability function. Theory 3.1.

use crate::lanes::{Quat2, Vec2, pairs};
use crate::math::{exp, log};
use crate::model::Model;
use crate::motion::{BodyStart, Motion};
use crate::params::Integrator;
use crate::rod::strain;
use crate::row::movers::{momentum, place_shapes, turned_freely};
use crate::state::{BodyState, Contact, History, Moved, State};
use core::f64::consts::{FRAC_1_SQRT_2, SQRT_2};
use core::ops::Range;
use glam::DVec3;
use wide::f64x2;

/// Blocks of a rod, and the zone of its contacts.
type Blocks = (Range<usize>, Range<usize>);

/// How a substep is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Method {
    /// Implicit Euler: one solve.
    Euler,
    /// Two solves, the first with Euler's weights: needs no accelerations.
    Alexander,
    /// Two solves, the first by the trapezoidal rule.
    TrBdf2,
}

/// One solve of a substep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stage {
    /// Where it begins and ends, from the start of the substep \[s\].
    pub begin: f64,
    pub end: f64,
    /// Time by which its accelerations act on velocities \[s\].
    pub span: f64,
    /// Weights of the rates at the start of the substep and at the end of the first solve \[s\]; none in implicit
    /// Euler.
    pub weights: Option<[f64; 2]>,
    /// Part of the substep over which the accelerations that are known are continued to its end, for the first iterate;
    /// none where they are not known.
    known: Option<f64>,
    /// Whether it is the last one of the substep.
    pub last: bool,
}

/// Span of a solve of the methods with two, over the substep: 1 - 1 / sqrt 2.
const SPAN: f64 = 1.0 - FRAC_1_SQRT_2;

impl Method {
    /// The method for the next substep, of length `h`.
    pub fn of(model: &Model, history: History, h: f64) -> Method {
        match (model.settings.integrator, history) {
            (Integrator::ImplicitEuler, _) | (Integrator::TrBdf2, History::Discontinuous) => Method::Euler,
            (Integrator::TrBdf2, _) if drags_hard(model, h) => Method::Euler,
            (Integrator::TrBdf2, History::Unknown) => Method::Alexander,
            (Integrator::TrBdf2, History::Valid) => Method::TrBdf2,
        }
    }

    /// What damping leaves of linear and angular velocities before the motion, and after it.
    pub fn damping(self, model: &Model, h: f64) -> [(f64, f64); 2] {
        match self {
            Method::Euler => [drag(model, h), fade(model, h)],
            Method::Alexander | Method::TrBdf2 => [half_damping(model, h); 2],
        }
    }

    /// The solves of a substep of length `h`, the only one twice.
    pub fn stages(self, h: f64) -> [Stage; 2] {
        let span = SPAN * h;
        let two = |first: f64, weights: [[f64; 2]; 2], known: [Option<f64>; 2]| {
            let [now, then] = weights.map(|w| Some(w.map(|x| x * h)));
            [
                Stage { begin: 0.0, end: first * h, span, weights: now, known: known[0], last: false },
                Stage { begin: first * h, end: h, span, weights: then, known: known[1], last: true },
            ]
        };
        match self {
            Method::Euler => [Stage { begin: 0.0, end: h, span: h, weights: None, known: None, last: true }; 2],
            Method::Alexander => two(SPAN, [[0.0, 0.0], [0.0, FRAC_1_SQRT_2]], [None, None]),
            Method::TrBdf2 => two(2.0 * SPAN, [[SPAN, 0.0], [0.25 * SQRT_2; 2]], [Some(0.0), Some(0.5 / SPAN)]),
        }
    }
}

impl Stage {
    /// Length of the solve \[s\].
    pub fn length(&self) -> f64 {
        self.end - self.begin
    }
}

/// Sets up `target` and `target_frame`, and moves the state to the first iterate: for implicit Euler where its velocity
/// carries it (loads left out: a light end under load would start far away), else on with the accelerations that are
/// known. `origin` is the state at the start of the substep.
pub(crate) fn carry(
    model: &Model,
    state: &mut State,
    motion: &mut Motion,
    rods: &[Blocks],
    origin: &State,
    stage: &Stage,
    h: f64,
) {
    motion.span = stage.span;
    carry_bodies(model, state, motion, origin, stage, h);
    let Some([w0, w1]) = stage.weights else {
        carry_euler(model, state, motion, rods, h);
        return;
    };
    motion.heavier = [1.0; 2];
    let (keep, keep_spin) = half_damping(model, h);
    let at_start = stage.begin == 0.0;
    let span = stage.span;
    // Acceleration for the first iterate.
    let ahead = |known: &[DVec3], now: &[DVec3], i: usize| match stage.known {
        None => DVec3::ZERO,
        Some(_) if at_start => known[i],
        Some(rate) => known[i] + (now[i] - known[i]) * rate,
    };
    let rate = |k: f64, w: f64, v: DVec3| if w == 0.0 { DVec3::ZERO } else { v * (k * w) };
    let of = |known: &[DVec3], i: usize, w: f64| if w == 0.0 { DVec3::ZERO } else { known[i] * w };
    for (rod, _) in rods {
        for i in rod.clone() {
            let base = origin.position[i] + rate(keep, w0, origin.velocity[i]) + rate(1.0, w1, state.velocity[i]);
            let carried = origin.velocity[i] * keep + of(&origin.acceleration, i, w0) + of(&state.acceleration, i, w1);
            motion.carried[i] = carried;
            motion.target[i] = base + carried * span;
            state.position[i] = motion.target[i] + ahead(&origin.acceleration, &state.acceleration, i) * (span * span);
        }
        for e in rod.start..rod.end - 1 {
            // Angle over which damping takes its rate.
            if e > rod.start && model.bend_damping[e] != 0.0 {
                let half = model.rest_half[e];
                let rate = |s: &State, w: f64, k: f64| {
                    if w == 0.0 {
                        DVec3::ZERO
                    } else {
                        strain::joint_rate(
                            [s.orientation[e - 1], s.orientation[e]],
                            [s.angular_velocity[e - 1], s.angular_velocity[e]],
                            half,
                        ) * (w * k)
                    }
                };
                motion.start_angle[e] = strain::joint_angle(origin.orientation[e - 1], origin.orientation[e], half)
                    + rate(origin, w0, keep_spin)
                    + rate(state, w1, 1.0);
            }
        }
        for e in rod.start..rod.end - 1 {
            let base = exp(rate(1.0, w1, state.angular_velocity[e]))
                * (exp(rate(keep_spin, w0, origin.angular_velocity[e])) * origin.orientation[e]);
            let carried = origin.angular_velocity[e] * keep_spin
                + of(&origin.angular_acceleration, e, w0)
                + of(&state.angular_acceleration, e, w1);
            motion.carried_spin[e] = carried;
            motion.target_frame[e] = (exp(carried * span) * base).normalize();
            let on = ahead(&origin.angular_acceleration, &state.angular_acceleration, e) * (span * span);
            state.orientation[e] = (exp(on) * motion.target_frame[e]).normalize();
        }
    }
}

/// Sets up what bodies start from, and moves them to where they would come without contact.
fn carry_bodies(model: &Model, state: &mut State, motion: &mut Motion, origin: &State, stage: &Stage, h: f64) {
    motion.bodies.clear();
    motion.bodies.resize(model.bodies.len(), None);
    for slot in 0..model.bodies.len() as u32 {
        let (Some(body), Some(now), Some(was)) = (model.bodies.at(slot), state.bodies.at(slot), origin.bodies.at(slot))
        else {
            continue;
        };
        let moments = body.mass.moments;
        let spin = |b: &BodyState, momentum: DVec3| b.orientation * ((b.orientation.conjugate() * momentum) / moments);
        let times = |v: DVec3, w: f64| if w == 0.0 { DVec3::ZERO } else { v * w };
        let start = match stage.weights {
            None => {
                let (keep, keep_spin) = drag(model, h);
                BodyStart {
                    target: now.position + now.velocity * (h * keep),
                    carried: now.velocity,
                    kept: now.velocity * keep,
                    base: now.orientation,
                    part: 0.5,
                    momentum: now.angular_momentum * keep_spin,
                }
            }
            Some([w0, w1]) => {
                let (keep, keep_spin) = half_damping(model, h);
                let base = was.position + times(was.velocity, keep * w0) + times(now.velocity, w1);
                let carried = was.velocity * keep + times(was.acceleration, w0) + times(now.acceleration, w1);
                let first = exp(times(spin(was, was.angular_momentum), keep_spin * w0));
                let second = exp(times(spin(now, now.angular_momentum), w1));
                BodyStart {
                    target: base + carried * stage.span,
                    carried,
                    kept: carried,
                    base: (second * (first * was.orientation)).normalize(),
                    part: 1.0,
                    momentum: was.angular_momentum * keep_spin + times(was.torque, w0) + times(now.torque, w1),
                }
            }
        };
        // What hangs on a thread starts as that does: it would stretch it.
        let hangs = model.welds.iter().any(|(_, w)| w.anchor.is_some_and(|a| a.body == slot));
        let fall = if hangs { DVec3::ZERO } else { model.settings.gravity * (stage.span * stage.span) };
        let orientation = turned_freely(moments, &start, stage.span);
        let now = state.bodies.at_mut(slot).expect("living");
        if now.motion == Moved::Free {
            (now.position, now.orientation) = (start.target + fall, orientation);
            place_shapes(model, state, slot);
        }
        motion.bodies[slot as usize] = Some(start);
    }
}

/// Velocities and angular momenta of bodies from their motion.
fn leave_rates_of_bodies(model: &Model, state: &mut State, motion: &Motion, stage: &Stage, h: f64) {
    let over = 1.0 / (stage.span * stage.span);
    for (slot, start) in motion.bodies.iter().enumerate() {
        let slot = slot as u32;
        let (Some(body), Some(now), Some(start)) = (model.bodies.at(slot), state.bodies.at_mut(slot), start) else {
            continue;
        };
        let reached = momentum(body.mass.moments, start, now, stage.span);
        let acceleration = (now.position - start.target) * (over * motion.heavier[0]);
        if model.settings.integrator == Integrator::TrBdf2 {
            now.acceleration = acceleration;
            now.torque = (reached - start.momentum) * (motion.heavier[1] / stage.span);
        }
        if stage.weights.is_some() {
            let (keep, keep_spin) = if stage.last { half_damping(model, h) } else { (1.0, 1.0) };
            now.velocity = (start.carried + acceleration * stage.span) * keep;
            now.angular_momentum = reached * keep_spin;
        } else {
            let (keep, keep_spin) = fade(model, h);
            let came_from = start.target - start.carried * (h * drag(model, h).0);
            now.velocity = (now.position - came_from) * (keep / h);
            now.angular_momentum = reached * keep_spin;
        }
    }
}

/// Drag is in the solve: x~ = x + h exp(-c h) v and inertia over h (1 - exp(-c h)) / c.
fn carry_euler(model: &Model, state: &mut State, motion: &mut Motion, rods: &[Blocks], h: f64) {
    let (keep, keep_spin) = drag(model, h);
    let settings = &model.settings;
    motion.heavier = [settings.linear_drag, settings.angular_drag].map(|c| heavier(c * h));
    for (rod, _) in rods {
        for i in rod.clone() {
            state.position[i] += state.velocity[i] * (h * keep);
            motion.target[i] = state.position[i];
        }
        for e in rod.start..rod.end - 1 {
            // Only damping asks for it.
            if e > rod.start && model.bend_damping[e] != 0.0 {
                motion.start_angle[e] =
                    strain::joint_angle(state.orientation[e - 1], state.orientation[e], model.rest_half[e]);
            }
        }
        for (low, high) in pairs(rod.start..rod.end - 1) {
            let q = Quat2::load(state.orientation[low], state.orientation[high]);
            let spin = Vec2::load(state.angular_velocity[low], state.angular_velocity[high]);
            let turned = Quat2::exp(&spin.scaled(f64x2::splat(h * keep_spin))).product(&q).normalize().split();
            (state.orientation[low], state.orientation[high]) = turned;
            (motion.target_frame[low], motion.target_frame[high]) = turned;
        }
    }
}

/// Drag times substep beyond which a substep is taken by implicit Euler: split off in halves, drag is off by a 24th of
/// its square.
const HARD: f64 = 0.5;

fn drags_hard(model: &Model, h: f64) -> bool {
    model.settings.linear_drag.max(model.settings.angular_drag) * h > HARD
}

/// What drag leaves of linear and angular velocities over a time.
fn drag(model: &Model, h: f64) -> (f64, f64) {
    (libm::exp(-model.settings.linear_drag * h), libm::exp(-model.settings.angular_drag * h))
}

/// What damping by a part a second leaves of them.
fn fade(model: &Model, h: f64) -> (f64, f64) {
    let keep = |damping: f64| libm::pow(1.0 - damping, h);
    (keep(model.settings.linear_damping), keep(model.settings.angular_damping))
}

/// What half of a substep leaves of linear and angular velocities. Damping acts before and after the motion, half each,
/// which is of second order.
fn half_damping(model: &Model, h: f64) -> (f64, f64) {
    let (drag, fade) = (drag(model, 0.5 * h), fade(model, 0.5 * h));
    (drag.0 * fade.0, drag.1 * fade.1)
}

/// By how much heavier it is in a substep of implicit Euler what loses the part 1 - exp(-x) of its velocity: a constant
/// force then leads to the velocity at which drag balances it, however long the substep.
fn heavier(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { x / -libm::expm1(-x) }
}

/// Velocities from the motion, with damping, and the accelerations that go with them where the next substep may ask.
pub(crate) fn leave_rates(model: &Model, state: &mut State, motion: &Motion, rods: &[Blocks], stage: &Stage, h: f64) {
    leave_rates_of_bodies(model, state, motion, stage, h);
    if model.settings.integrator == Integrator::TrBdf2 {
        let over = 1.0 / (stage.span * stage.span);
        state.acceleration.resize(model.mass.len(), DVec3::ZERO);
        state.angular_acceleration.resize(model.mass.len(), DVec3::ZERO);
        for (rod, _) in rods {
            for i in rod.clone() {
                state.acceleration[i] = (state.position[i] - motion.target[i]) * (over * motion.heavier[0]);
            }
            for e in rod.start..rod.end - 1 {
                state.angular_acceleration[e] =
                    log(state.orientation[e] * motion.target_frame[e].conjugate()) * (over * motion.heavier[1]);
            }
        }
    }
    if stage.weights.is_some() {
        let (keep, keep_spin) = if stage.last { half_damping(model, h) } else { (1.0, 1.0) };
        for (rod, _) in rods {
            for i in rod.clone() {
                state.velocity[i] = (motion.carried[i] + state.acceleration[i] * stage.span) * keep;
            }
            for e in rod.start..rod.end - 1 {
                state.angular_velocity[e] =
                    (motion.carried_spin[e] + state.angular_acceleration[e] * stage.span) * keep_spin;
            }
        }
        return;
    }
    let (keep_linear, keep_angular) = fade(model, h);
    for (rod, _) in rods {
        for i in rod.clone() {
            state.velocity[i] = (state.position[i] - motion.start[i]) * (keep_linear / h);
        }
        for (low, high) in pairs(rod.start..rod.end - 1) {
            let start = Quat2::load(motion.start_frame[low], motion.start_frame[high]);
            let turn = Quat2::load(state.orientation[low], state.orientation[high]).product(&start.conjugate());
            (state.angular_velocity[low], state.angular_velocity[high]) =
                turn.log().scaled(f64x2::splat(keep_angular / h)).split();
        }
    }
}

/// Angular velocity of a frame as the motion takes it over at the start of the substep, and at the end of the last
/// solve.
pub(crate) fn spins(model: &Model, origin: &State, state: &State, h: f64, e: usize) -> [DVec3; 2] {
    [origin.angular_velocity[e] * half_damping(model, h).1, state.angular_velocity[e]]
}

/// Whether other pieces touch now than at the start of the substep, or what slid sticks, or the other way round; and
/// whether a joint has come to a limit, or its motor to its bound.
pub(crate) fn touches_anew(before: &State, now: &State) -> bool {
    let pieces = |c: &Contact| (c.a.piece(), c.b.piece(), c.sliding);
    !before.contacts.iter().map(pieces).eq(now.contacts.iter().map(pieces))
        || !before.joints.iter().map(|(_, j)| j.phase()).eq(now.joints.iter().map(|(_, j)| j.phase()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both solves of x' = k x over one substep, from x = 1 and its rate.
    fn grown(method: Method, k: f64) -> f64 {
        let (start, mut now) = ((1.0, k), (1.0, k));
        for stage in method.stages(1.0) {
            let [w0, w1] = stage.weights.unwrap();
            let base = start.0 + w0 * start.1 + w1 * now.1;
            let x = base / (1.0 - k * stage.span);
            now = (x, (x - base) / stage.span);
        }
        now.0
    }

    #[test]
    fn weights_make_methods_of_second_order_that_damp_what_is_stiff() {
        for method in [Method::Alexander, Method::TrBdf2] {
            for stage in method.stages(1.0) {
                let [w0, w1] = stage.weights.unwrap();
                assert!(
                    (w0 + w1 + stage.span - stage.end).abs() < 1e-15,
                    "a constant rate is carried as far as it goes"
                );
            }
            // exp(k) to second order, and the known constant of the third: 1/6 - 0.0404.
            for k in [1e-2, -1e-2] {
                let error = (grown(method, k) - f64::exp(k)) / (k * k * k);
                assert!((error - 0.0404).abs() < 2e-3, "{method:?}: {error}");
            }
            assert!(grown(method, -1e9).abs() < 1e-8);
        }
        // A swing x'' = -w^2 x loses the part (w h)^4 / 272 a substep.
        let w = 0.05_f64;
        let (start, mut now) = (([1.0, 0.0], [0.0, -w * w]), ([1.0, 0.0], [0.0, -w * w]));
        for stage in Method::TrBdf2.stages(1.0) {
            let [w0, w1] = stage.weights.unwrap();
            let [x, v] = [0, 1].map(|i| start.0[i] + w0 * start.1[i] + w1 * now.1[i]);
            let a = -w * w * (x + stage.span * v) / (1.0 + w * w * stage.span * stage.span);
            let new_v = v + stage.span * a;
            now = ([x + stage.span * new_v, new_v], [new_v, a]);
        }
        let lost = 1.0 - (now.0[0].powi(2) + (now.0[1] / w).powi(2)).sqrt();
        assert!((lost / w.powi(4) * 272.0 - 1.0).abs() < 0.02, "{}", lost / w.powi(4));
    }
}
