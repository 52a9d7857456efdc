//! One attempt at a substep: its solves, and whether its end may be kept.

use crate::budget::{self, Settled};
use crate::collide::{self, Clearance};
use crate::drive::{Begun, Interval, predict};
use crate::finite::{all_finite, in_proportion};
use crate::integrator::{self, Method, Stage, touches_anew};
use crate::model::Model;
use crate::newton::{self, Outcome, Solver};
use crate::reaction::reactions;
use crate::reel;
use crate::rejection::Rejection;
use crate::report::StepReport;
use crate::rod::length::{UNBEARABLE, tautest};
use crate::rod::plastic::yield_plastic;
use crate::row;
use crate::scratch::Scratch;
use crate::state::State;

/// Halvings down to which a substep is not taken that makes energy.
const FINE: u32 = 4;

/// A step under way. The model changes between substeps only, where reels feed.
pub(crate) struct Step<'a, 'b> {
    pub model: &'a mut Model,
    pub state: &'a mut State,
    pub scratch: &'a mut Scratch,
    pub interval: &'a mut Interval<'b>,
    pub report: &'a mut StepReport,
}

/// A part of a step: from `t` by `h`, after this many halvings.
#[derive(Clone, Copy)]
pub(crate) struct Substep {
    pub t: f64,
    pub h: f64,
    pub depth: u32,
}

/// What a substep came to. Its end is in the state, to be kept or thrown away.
pub(crate) struct Attempt {
    pub outcome: Outcome,
    pub verdict: Result<Clearance, Refused>,
    /// Whether it was of second order although contacts changed in it or it made energy.
    pub too_coarse: bool,
}

/// Why a substep is not acceptable, and because of which rods, where that is known.
#[derive(Clone, Copy)]
pub(crate) struct Refused {
    pub reason: Rejection,
    pub rods: Option<[u32; 2]>,
}

impl From<Rejection> for Refused {
    fn from(reason: Rejection) -> Self {
        Refused { reason, rods: None }
    }
}

/// The solves of a substep, each judged by itself.
pub(crate) fn attempt(step: &mut Step<'_, '_>, sub: Substep, method: Method) -> Attempt {
    let halvings = step.model.settings.halvings;
    let mut attempt: Option<Attempt> = None;
    for stage in method.stages(sub.h) {
        let Step { model, state, scratch, interval, report } = &mut *step;
        let Scratch { saved, solver, budget, held, .. } = &mut **scratch;
        let origin = saved.at(sub.depth);
        let begun = Begun { began: sub.t, h: sub.h, stage: &stage, origin };
        predict(model, state, solver, interval, &begun, held);
        collide::detect(model, state, &solver.motion, &mut solver.candidates);
        row::prepare(model, state, &solver.motion, &solver.candidates, &mut solver.rows, stage.length());
        let outcome = newton::solve(model, state, solver, stage.span, sub.depth == halvings);
        report.newton_iterations += outcome.iterations;
        let verdict = judge(model, state, solver, &outcome, sub.depth == halvings).and_then(|clearance| {
            reel::release(model, state, &solver.rods.brakes);
            complete(model, state, solver, &stage, sub.h);
            let clear = [clearance.thread, clearance.shape].into_iter().flatten().all(f64::is_finite);
            // The last solve is looked at once more when velocities are corrected.
            let sound = all_finite(model, state) && (stage.last || in_proportion(model, state));
            if clear && sound { Ok(clearance) } else { Err(Rejection::NotFinite.into()) }
        });
        let touches = verdict.is_ok() && method != Method::Euler && touches_anew(origin, state);
        let mut so_far = match (attempt, verdict) {
            (Some(Attempt { outcome: before, verdict: Ok(c), .. }), Ok(d)) => Attempt {
                outcome: Outcome {
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
            if method != Method::Euler && budget::joints_gain(model, origin, state) {
                so_far.too_coarse = true;
                return so_far;
            }
            let last = sub.depth >= FINE.min(halvings);
            match budget::settle(model, state, &solver.motion, budget, origin, (sub.h, method, last)) {
                Settled::Well => {}
                Settled::Coarse => so_far.too_coarse = true,
                Settled::Gained if !last => so_far.verdict = Err(Rejection::EnergyGained.into()),
                Settled::Gained => {}
            }
            if so_far.verdict.is_ok() && !in_proportion(model, state) {
                so_far.verdict = Err(Rejection::NotFinite.into());
            }
            return so_far;
        }
        attempt = Some(so_far);
    }
    unreachable!("a method has a last solve")
}

/// Whether the end of a solve may be an end of the substep: converged, or no shorter one is left to try, within what a
/// thread bears, and reached without a passage.
fn judge(
    model: &Model,
    state: &State,
    solver: &mut Solver,
    outcome: &Outcome,
    shortest: bool,
) -> Result<Clearance, Refused> {
    let Solver { motion, rods, candidates, rows, effort } = solver;
    if !outcome.finite {
        Err(Rejection::NotFinite.into())
    } else if (outcome.converged || shortest) && tautest(model, rods) >= UNBEARABLE {
        Err(Rejection::LengthNotKept.into())
    } else if !outcome.converged && (effort.exhausted() || effort.late()) {
        Err(Rejection::TooMuchWork.into())
    } else if !outcome.converged && !shortest {
        Err(Rejection::NotConverged.into())
    } else {
        let swept = collide::sweep(model, state, motion, candidates, rows);
        swept.map_err(|refused| Refused { reason: refused.reason, rods: Some(refused.rods) })
    }
}

/// Velocities from the motion, damping, tensions, plastic flow, contacts and the forces of grips at the end of a solve:
/// what the next one, or the next substep, starts from.
fn complete(model: &Model, state: &mut State, solver: &mut Solver, stage: &Stage, h: f64) {
    integrator::leave_rates(model, state, &solver.motion, &solver.rods.ranges, stage, h);
    for e in solver.rods.elements() {
        state.tension[e] = if model.inextensible[e] {
            solver.rods.tension[e]
        } else {
            crate::rod::element_strain(model, state, e).z * model.stretch_stiffness[e].z
        };
    }
    yield_plastic(model, state);
    row::store(model, state, &solver.motion, &mut solver.rows);
    reactions(model, state, solver, stage.span);
}

pub(crate) fn least(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.min(b)),
        (a, b) => a.or(b),
    }
}
