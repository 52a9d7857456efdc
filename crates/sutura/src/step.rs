//! The step. Stage order is decided here and nowhere else.

use crate::attempt::{Refused, Step, Substep, attempt, least};
use crate::collide::Clearance;
use crate::drive::outside_forces;
use crate::integrator::{Method, touches_anew};
use crate::model::Model;
use crate::newton::Outcome;
use crate::params::Integrator;
use crate::reel;
use crate::rejection::Rejection;
use crate::report::{Incident, IncidentKind};
use crate::rod::length::{TAUT, UNBEARABLE, let_stretch, off_length};
use crate::scratch::Scratch;
use crate::state::History;
use crate::view::View;
use glam::DVec3;

/// Halvings after which taut inextensible threads stretch, if there is still no acceptable substep.
const GIVE_WAY: u32 = 4;

/// Accepted substeps of one length before twice the length is tried again.
const CALM: u32 = 6;

/// Substep over the one that is wanted, below which a step finds one whatever it takes.
const STARVED: f64 = 1.0 / 48.0;

/// Part of what a step may take that a substep which found no end in it took, for the next step to try half of it.
const TOO_LONG: f64 = 0.5;

impl Step<'_, '_> {
    /// Advances the whole world by the interval, in equal substeps no longer than the setting.
    pub fn run(&mut self) {
        self.scratch.fit(self.model);
        outside_forces(self.model, self.state, &mut self.scratch.solver.motion);
        let (start, length) = (self.interval.start, self.interval.length);
        let n = (length / self.model.settings.substep * (1.0 - 1e-9)).ceil().max(1.0);
        let h = length / n;
        self.report.converged = true;
        self.scratch.held.clear();
        self.state.time = start;
        // Where shorter and shorter substeps found no way within what a step may take, one is found now, whatever it
        // takes.
        let shortest = 0.75 * 0.5_f64.powi(self.model.settings.halvings as i32);
        let starved =
            self.state.last_h > 0.0 && self.state.last_h < self.model.settings.substep * STARVED.max(shortest);
        let allowed = self.model.step_work.filter(|_| !starved).unwrap_or(f64::INFINITY);
        self.scratch.solver.effort.begin(allowed);
        let whole = (0..n as u32).all(|k| {
            if reel::remesh(self.model, self.state, h) {
                self.scratch.fit(self.model);
                self.state.invalidate(History::Unknown);
                // Who looks from state to state must not lose sight of the motion to come.
                (self.interval.observe)(View { model: self.model, state: self.state });
            }
            self.scratch.solver.effort.next();
            self.advance(Substep { t: start + h * f64::from(k), h, depth: 0 })
        });
        for (slot, elongation) in off_length(self.model, self.state) {
            let kind = IncidentKind::LengthNotKept { rod: self.model.rods.handle(slot), elongation };
            self.report.incidents.push(Incident { time: self.state.time, kind });
        }
        // Where nothing acceptable was found, what is driven stays with the rest.
        let reached = if whole { 1.0 } else { (self.state.time - start) / length };
        for (_, grip) in self.state.grips.iter_mut() {
            let held = self.scratch.held.iter().find(|(rod, _)| *rod == grip.rod).map(|(_, t)| (t - start) / length);
            grip.pose = grip.pose.interpolate(&grip.target, held.unwrap_or(reached));
        }
        let effort = &self.scratch.solver.effort;
        self.report.simulated = reached * length;
        (self.report.work, self.report.cut) = (effort.sum(), effort.cut);
        if !effort.cut {
            self.state.time = start + length;
        }
    }

    /// Advances by a substep, or by its two halves where its end is not acceptable. False when it got stuck.
    fn advance(&mut self, sub: Substep) -> bool {
        let last_h = self.state.last_h;
        // Where substeps had to be short a while ago they start short.
        if sub.depth < self.model.settings.halvings
            && last_h > 0.0
            && sub.h > last_h * if self.state.accepted_in_row < CALM { 1.5 } else { 3.0 }
        {
            return self.halves(sub);
        }
        // Rather less than what would be thrown away.
        let effort = &mut self.scratch.solver.effort;
        let before = effort.sum();
        if self.report.substeps > 0 && before + effort.last > effort.allowed {
            effort.cut = true;
            return false;
        }
        self.scratch.saved.save(sub.depth, self.state);
        let reels = reel::feed(self.model, self.state, sub.h);
        if reels {
            outside_forces(self.model, self.state, &mut self.scratch.solver.motion);
        }
        // Length that comes in has no past to go by.
        let mut method = if reels { Method::Euler } else { Method::of(self.model, self.state.history, sub.h) };
        let mut end = attempt(self, sub, method);
        if end.too_coarse {
            // What stops or jumps has no second derivative to go by, and would bounce; what turns too far in a substep
            // would gain energy.
            self.scratch.saved.restore(sub.depth, self.state);
            method = Method::Euler;
            end = attempt(self, sub, method);
        }
        match end.verdict {
            Ok(clearance) => {
                self.commit(sub, method, reels, &end.outcome, &clearance);
                self.scratch.solver.effort.last = self.scratch.solver.effort.sum() - before;
                true
            }
            Err(refused) => self.retry(sub, refused, before),
        }
    }

    fn halves(&mut self, sub: Substep) -> bool {
        let half = Substep { h: 0.5 * sub.h, depth: sub.depth + 1, ..sub };
        self.advance(half) && self.advance(Substep { t: sub.t + half.h, ..half })
    }

    /// Takes the trial state as the state.
    fn commit(&mut self, sub: Substep, method: Method, reels: bool, outcome: &Outcome, clearance: &Clearance) {
        let Step { model, state, scratch, report, .. } = self;
        if model.settings.integrator == Integrator::TrBdf2 {
            if reels || method == Method::Euler && touches_anew(scratch.saved.at(sub.depth), state) {
                state.invalidate(History::Discontinuous);
            } else {
                state.history = History::Valid;
            }
        }
        if scratch.held.is_empty() {
            scratch.solver.effort.allowed = model.step_work.unwrap_or(f64::INFINITY);
        }
        let last_h = state.last_h;
        state.last_h = if sub.depth == 0 { 0.0 } else { sub.h };
        state.accepted_in_row = if sub.h > 1.5 * last_h { 0 } else { state.accepted_in_row.saturating_add(1) };
        state.time = sub.t + sub.h;
        report.substeps += 1;
        report.residual = report.residual.max(outcome.residual);
        report.thread_clearance = least(report.thread_clearance, clearance.thread);
        report.shape_clearance = least(report.shape_clearance, clearance.shape);
        if !outcome.converged {
            report.converged = false;
            let kind = IncidentKind::NotConverged { residual: outcome.residual };
            report.incidents.push(Incident { time: state.time, kind });
        }
        (self.interval.observe)(View { model: self.model, state: self.state });
    }

    /// Goes back, and on in another way. False where there is none, or no time for it.
    fn retry(&mut self, sub: Substep, refused: Refused, before: f64) -> bool {
        self.report.rejected += 1;
        self.scratch.saved.restore(sub.depth, self.state);
        reel::sync(self.model, self.state);
        let Step { model, state, scratch, report, .. } = self;
        let effort = &mut scratch.solver.effort;
        let last = sub.depth >= model.settings.halvings || effort.exhausted();
        if effort.late() {
            if report.substeps == 0 || effort.sum() - before > TOO_LONG * effort.allowed {
                (state.last_h, state.accepted_in_row) = (0.5 * sub.h, 0);
            }
            effort.cut = true;
            return false;
        }
        let taut = if last || sub.depth >= GIVE_WAY { TAUT } else { UNBEARABLE };
        if let_stretch(model, state, &mut scratch.solver.rods, taut) {
            return self.advance(sub);
        }
        (state.last_h, state.accepted_in_row) = (0.5 * sub.h, 0);
        if !last {
            return self.halves(sub);
        }
        let reason = refused.reason;
        report.converged = false;
        if let Some(rods) = hold_refused(model, scratch, refused, sub.t) {
            let kind = IncidentKind::Held { reason, rods: rods.map(|r| model.rods.handle(r)) };
            report.incidents.push(Incident { time: sub.t, kind });
            (state.last_h, state.accepted_in_row) = (0.0, 0);
            return self.advance(sub);
        }
        let kind =
            if reason == Rejection::NotFinite { IncidentKind::NotFinite } else { IncidentKind::Stuck { reason } };
        report.incidents.push(Incident { time: sub.t, kind });
        state.last_h = 0.0;
        // Rest: what moved into this state must not push again.
        state.velocity.fill(DVec3::ZERO);
        state.angular_velocity.fill(DVec3::ZERO);
        for (_, body) in state.bodies.iter_mut() {
            (body.velocity, body.angular_momentum) = (DVec3::ZERO, DVec3::ZERO);
        }
        state.invalidate(History::Unknown);
        false
    }
}

/// Holds the rods for which the last attempt was refused where they are, for the rest of the step, which is then done
/// to its end: which ones they are is not known in the next. None when that is no help: they are held already, or
/// nothing else is there to go on. (What threads share at a weld, and reels, would need more: then all stops.)
fn hold_refused(model: &Model, scratch: &mut Scratch, refused: Refused, t: f64) -> Option<[u32; 2]> {
    let rods = refused.rods?;
    let Scratch { held, solver, .. } = scratch;
    if model.welds.len() > 0 || !solver.rods.brakes.is_empty() {
        return None;
    }
    let before = held.len();
    for rod in rods {
        if held.iter().all(|(r, _)| *r != rod) {
            held.push((rod, t));
        }
    }
    solver.effort.allowed = f64::INFINITY;
    (held.len() > before && held.len() < solver.rods.ranges.len()).then_some(rods)
}
