//! One Newton solve of a substep: assemble the rods, factor, couple by contact, step, until nothing moves.
//!
//! The substep minimizes inertia + elastic energy + contact (implicit Euler). Stretch is linearized with its
//! multiplier: the geometric stiffness uses the tension that the last iteration predicted, not the one of the current
//! strain, which makes the iteration that of the mixed (dual) form and lets it take turns of a large angle although
//! stretch is 1e8 times stiffer than bending. In inextensible rods that tension is an unknown of its own, eliminated in
//! its element, whose stiffness is 1e5 EA (theory 7.1).

use crate::collide::Candidates;
use crate::effort::Effort;
use crate::math::max_or_nan;
use crate::model::Model;
use crate::model::weld::WeldModel;
use crate::motion::Motion;
use crate::rod::assemble::{Hessian, assemble};
use crate::rod::brake;
use crate::rod::constraint::NodeConstraint;
use crate::rod::length::LENGTH_TOLERANCE;
use crate::rod::scratch::RodScratch;
use crate::row::{self, Rows};
use crate::state::State;

/// Least part of a step that is taken: a contact met on the way must be met, or the next step does not know of it.
const SHORTEST: f64 = 0.3;
/// Largest turn of an element in an iteration \[rad\].
const TURN_MOST: f64 = 0.3;
/// Force along a step after it, over the force before it and with the opposite sign, beyond which the step is
/// shortened.
const OVERSHOOT: f64 = 0.5;

/// Part of the work of turning that is uncertain where bodies hang on threads.
const STRAIGHT: f64 = 0.05;

/// Turn of an iteration over that of the one before beyond which a substep without contacts goes over to the exact
/// matrix.
const SLOW: f64 = 0.3;

/// Move of the last iteration where there are contacts, in radii, that counts as none.
const NEAR: f64 = 0.03;

/// Iterations in which the way to go must have become half as long, where it is longer than `FAR` radii.
const SOME: u32 = 4;
const FAR: f64 = 1.0;

/// Iterations in a row that may leave the contact problem unsolved.
const UNSOLVED: u32 = 2;

/// Least part of an iteration that the next one is taken to do, where they shrink fast.
const SLACKEN: f64 = 0.2;

/// Working memory of a solve.
#[derive(Default)]
pub(crate) struct Solver {
    pub motion: Motion,
    pub rods: RodScratch,
    pub candidates: Candidates,
    pub rows: Rows,
    pub effort: Effort,
}

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

/// Solves for the end of a motion from `motion.start`, carried on to `motion.target` by its velocity; accelerations
/// act over `h`, which in implicit Euler is the substep. The iterate is in `state`. `last` says that no shorter substep
/// will be tried.
pub(crate) fn solve(model: &Model, state: &mut State, solver: &mut Solver, h: f64, last: bool) -> Outcome {
    let settings = &model.settings;
    let Solver { motion, rods, candidates, rows, effort } = solver;
    rods.begin(model, state, motion);
    row::system::begin(rows);
    let mut out = Outcome { converged: false, finite: true, iterations: 0, turn: 0.0, residual: 0.0 };
    // Once indefinite, mostly indefinite: a substep tries the exact matrix until it fails. Without contacts the other
    // one mostly is as good, so the exact one has to wait until it is not.
    let mut exact = !rows.is_empty();
    let mut waiting = !exact;
    // Inextensible elements at a weld have their stiffness in the matrix, and the digits that this costs are those of
    // the next iteration.
    let firm = |rod: u32| model.rods.at(rod).is_some_and(|r| r.stretch == crate::Stretch::Inextensible);
    let hangs = |w: &WeldModel| w.anchor.is_some_and(|a| state.gives_way(a.body));
    let hanging = model.welds.iter().any(|(_, weld)| hangs(weld));
    let stiff = |w: &WeldModel| w.members.iter().any(|m| firm(m.rod));
    // What hangs and turns by little more than nothing has second thoughts too: a stiff thread is stretched by that
    // with more than the weight of a needle.
    let least = if hanging || model.welds.iter().any(|(_, weld)| stiff(weld)) { 2 } else { 1 };
    let (mut before, mut moved_before) = (f64::INFINITY, f64::INFINITY);
    // Work of the forces along the last step, over its full length, and the part of it that was taken.
    let (mut gained, mut scale) = (0.0_f64, 1.0);
    // Way that was to go some iterations ago, in radii, and iterations in a row whose contact problem was not solved.
    let (mut way, mut unsolved) = (f64::INFINITY, 0);
    while out.iterations < settings.newton_max && !effort.exhausted() && !effort.late() {
        out.iterations += 1;
        let shared = rows.border.count() as f64;
        effort.now += shared * shared * shared / 3.0 + 5000.0 * candidates.solids.len() as f64;
        effort.now +=
            600.0 * model.mass.len() as f64 + 200.0 * (candidates.threads.len() + candidates.shapes.len()) as f64;
        row::shape::update_active_set(model, state, motion, rows, out.iterations == 1);
        brake::review(model, state, &mut rods.brakes);
        rows.joints.review(model, state, motion);
        if out.iterations > 1 {
            rows.bodies.update(model, state, motion, candidates);
        }
        row::system::zones(&mut rods.ranges, rows);
        let first = out.iterations == 1;
        let mut taken = 1.0;
        loop {
            exact = exact && factor(model, state, motion, rods, rows, (h, Hessian::Exact, first));
            if !exact {
                factor(model, state, motion, rods, rows, (h, Hessian::Positive, first));
            }
            if first || taken < 0.2 || gained <= 0.0 || gained.is_nan() {
                break;
            }
            // Where the force along the last step has turned round the step went too far: contacts opened, closed or
            // began to slide on the way. Go back to where a straight line between the two forces says that it vanishes.
            let turning = rods.work_of_turn(model, state);
            let left = work(rods, work_of_others(rods, rows)) + turning - row::shape::work_unforeseen(rows, &rods.step);
            // That of turning is taken along a straight step, and what hangs goes along an arc.
            let unsure = if hanging { STRAIGHT * turning.abs() } else { 0.0 };
            if left > -OVERSHOOT * gained - unsure {
                break;
            }
            let part = (gained / (gained - left)).max(SHORTEST);
            apply(model, state, rods, rows, -(1.0 - part) * taken * scale, false);
            taken *= part;
        }
        let RodScratch { ranges, system, torque_correction, rhs, step, .. } = &mut *rods;
        step.copy_from_slice(rhs);
        for (rod, zone) in ranges.iter() {
            system.solve_all(rod.clone(), zone, step);
            torque_correction.apply(system, rod, zone, &motion.torque, step);
        }
        rows.border.couple(&mut rods.step, false);
        row::system::solve(model, state, motion, rods, rows, effort);
        row::follow::follow(rods, rows, effort);
        let [by_contacts, on_shared] = work_of_others(rods, rows);
        let by_joints = rows.joints.work(rows.movers.count() + rows.welds.count(), &rows.border);
        let by_others = [by_contacts, on_shared + by_joints];
        let trusted = !waiting || !rods.neglects(model, state, motion, h);
        let (turn, shift) = rods.largest_move(model);
        let turn = max_or_nan(turn, rows.welds.turn_squared(rows.movers.count(), &rows.border));
        let turn = max_or_nan(turn, rows.movers.turn_squared(&rows.border)).sqrt();
        let shift = max_or_nan(shift, rows.movers.largest_move(model, &rows.border));
        scale = limit(state, motion, rods, candidates, turn);
        let (slid, built_up) = apply(model, state, rods, rows, scale, true);
        row::shape::predict(rows, &rods.step, scale);
        rows.welds.predict_forces(&rods.step, &rows.border, scale);
        (out.turn, out.residual) = (turn * scale, shift * scale);
        if waiting && (!trusted || out.turn > SLOW * before || !rows.is_empty()) {
            (waiting, exact) = (false, true);
        }
        out.residual =
            max_or_nan(out.residual, slid / model.rods.iter().map(|(_, r)| r.radius).fold(f64::INFINITY, f64::min));
        if !(out.turn.is_finite() && out.residual.is_finite()) {
            out.finite = false;
            return out;
        }
        unsolved = if rows.solved() { 0 } else { unsolved + 1 };
        let whole = out.residual / scale;
        let hopeless = unsolved > UNSOLVED || out.iterations.is_multiple_of(SOME) && whole > FAR && whole > 0.5 * way;
        if hopeless && !last && !rows.is_empty() {
            // Substeps half as long have a better chance than more iterations.
            break;
        }
        if first || out.iterations.is_multiple_of(SOME) {
            way = whole;
        }
        // What the next iteration would do, going by what this one did after the one before.
        let rate = if first { 1.0 } else { (out.turn / before).max(out.residual / moved_before).clamp(SLACKEN, 1.0) };
        (before, moved_before) = (out.turn, out.residual);
        let rests = trusted
            && scale >= 1.0
            && out.turn * rate < settings.tolerance
            && (rows.is_empty() || out.residual * rate < NEAR);
        if rests
            && out.iterations >= least.min(settings.newton_max)
            && rods.length_error(model, state) <= LENGTH_TOLERANCE
            && rows.solved()
            && brake::settled(model, state, &rods.brakes)
            && row::shape::converged(model, state, motion, rows, &rods.step, out.iterations)
            && row::body::converged(model, state, motion, &mut rows.bodies.rows)
            && rows.joints.converged(model, state, motion, &rows.border, rate)
            && !row::extend(model, state, motion, candidates, rows)
        {
            out.converged = true;
            break;
        }
        gained = work(rods, by_others) - built_up;
    }
    out
}

/// Work of the forces at the iterate along the last step, with that of contacts and of what is shared.
fn work(rods: &RodScratch, [contacts, shared]: [f64; 2]) -> f64 {
    let own: f64 = rods.rhs.iter().zip(&rods.step).map(|(r, z)| r.dot(*z)).sum();
    own + contacts + shared
}

/// Work of contact forces, as last found, and of those on what rods share along the last step.
fn work_of_others(rods: &RodScratch, rows: &Rows) -> [f64; 2] {
    [row::system::work(rows, &rods.step), rows.border.work()]
}

/// Assembles and factors. False when a pivot is not positive.
pub(crate) fn factor(
    model: &Model,
    state: &State,
    motion: &Motion,
    rods: &mut RodScratch,
    rows: &mut Rows,
    (h, hessian, first): (f64, Hessian, bool),
) -> bool {
    assemble(model, state, motion, rods, h, hessian);
    brake::assemble(model, state, rods);
    row::shape::assemble(model, state, motion, rods, rows, first);
    rows.welds.assemble_joints(state, &mut rods.rhs, &mut rods.system.diagonal);
    row::weld::gather(model, state, rods, rows, hessian == Hessian::Exact);
    restrict(state, rods);
    let RodScratch { system, ranges, constraint, .. } = rods;
    let mut positive = true;
    for (rod, zone) in ranges.iter() {
        positive &= system.factor(rod.clone(), zone);
    }
    rows.border.factor(system, ranges, constraint, rows.movers.of_bodies()) && positive
}

/// Takes held nodes out of the system and puts the drive on guided ones.
fn restrict(state: &State, rods: &mut RodScratch) {
    for node in 0..rods.constraint.len() {
        let constraint = rods.constraint[node];
        if constraint == NodeConstraint::Free {
            continue;
        }
        if let Some((stiffness, force)) = constraint.drive(state.position[node / 2]) {
            rods.system.diagonal[node] += stiffness;
            rods.rhs[node] += force;
        }
        let keep = constraint.projector();
        rods.system.restrict(node, keep);
        rods.rhs[node] = keep * rods.rhs[node];
    }
}

/// Factor on the update: no element turns by more than 0.3 rad in an iteration, and no pair of threads gets closer than
/// half its gap.
fn limit(state: &State, motion: &Motion, rods: &RodScratch, candidates: &Candidates, turn: f64) -> f64 {
    let by_turn = if turn > TURN_MOST { TURN_MOST / turn } else { 1.0 };
    by_turn.min(row::thread::limit(state, motion, candidates, &rods.step, by_turn))
}

/// Takes a part of the step, `anew` or back on the last one; the largest move of a pushed shape \[m\], and the work of
/// the forces that the step builds up in the rods.
fn apply(
    model: &Model,
    state: &mut State,
    rods: &mut RodScratch,
    rows: &mut Rows,
    scale: f64,
    anew: bool,
) -> (f64, f64) {
    let built_up = rods.apply(model, state, scale, anew);
    let slid = rows.movers.apply(model, state, &rows.border, scale);
    rows.welds.apply(model, state, rows.movers.count(), &rows.border, scale);
    rows.joints.apply(rows.movers.count() + rows.welds.count(), &rows.border, scale);
    (slid, built_up)
}
