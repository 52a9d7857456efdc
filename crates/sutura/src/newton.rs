//! One Newton solve of a substep: assemble the rods, factor, couple by contact, step, until nothing moves.
//!
//! The substep minimizes inertia + elastic energy + contact (implicit Euler). Stretch is linearized with its
//! multiplier: the geometric stiffness uses the tension that the last iteration predicted, not the one of the current
//! strain, which makes the iteration that of the mixed (dual) form and lets it take turns of a large angle although
//! stretch is 1e8 times stiffer than bending. In inextensible rods that tension is an unknown of its own, eliminated in
//! its element, whose stiffness is 1e5 EA (theory 7.1).

use crate::math::exp;
use crate::model::Model;
use crate::model::grip::Hold;
use crate::model::rod::RodModel;
use crate::rod::assemble::{Hessian, assemble, assemble_blocks, assemble_clamps};
use crate::rod::{brake, element_strain};
use crate::row;
use crate::scratch::{Freedom, Scratch};
use crate::state::State;
use core::ops::Range;
use glam::DVec3;

/// Elongation to which an element of an inextensible thread agrees with its tension where a solve ends.
pub(crate) const LENGTH_TOLERANCE: f64 = 5e-6;

/// Least part of a step that is taken: a contact met on the way must be met, or the next step does not know of it.
const SHORTEST: f64 = 0.3;
/// Force along a step after it, over the force before it and with the opposite sign, beyond which the step is
/// shortened.
const OVERSHOOT: f64 = 0.5;

/// Turn of an iteration over that of the one before beyond which a substep without contacts goes over to the exact
/// matrix.
const SLOW: f64 = 0.3;

/// Part of the stiffness along a step that the positive matrix may have left out where its step is taken for the last
/// one.
const TRUSTED: f64 = 0.1;

/// Move of the last iteration where there are contacts, in radii, that counts as none.
const NEAR: f64 = 0.03;

/// Iterations in which the way to go must have become half as long, where it is longer than `FAR` radii.
const SOME: u32 = 4;
const FAR: f64 = 1.0;

/// Iterations in a row that may leave the contact problem unsolved.
const UNSOLVED: u32 = 2;

/// Least part of an iteration that the next one is taken to do, where they shrink fast.
const SLACKEN: f64 = 0.2;

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

/// Solves for the end of a motion from `scratch.start`, carried on to `scratch.target` by its velocity; accelerations
/// act over `h`, which in implicit Euler is the substep. The iterate is in `state`. `last` says that no shorter substep
/// will be tried.
pub(crate) fn solve(model: &Model, state: &mut State, scratch: &mut Scratch, h: f64, last: bool) -> Outcome {
    let settings = &model.settings;
    carried_forces(model, state, scratch);
    row::couple::begin(scratch);
    let mut out = Outcome { converged: false, finite: true, iterations: 0, turn: 0.0, residual: 0.0 };
    // Once indefinite, mostly indefinite: a substep tries the exact matrix until it fails. Without contacts the other
    // one mostly is as good, so the exact one has to wait until it is not.
    let mut exact = !scratch.rows.is_empty();
    let mut waiting = !exact;
    // Inextensible elements at a weld have their stiffness in the matrix, and the digits that this costs are those of
    // the next iteration.
    let firm = |rod: u32| model.rods.at(rod).is_some_and(|r| r.stretch == crate::Stretch::Inextensible);
    let least = if model.welds.iter().any(|(_, weld)| weld.members.iter().any(|m| firm(m.rod))) { 2 } else { 1 };
    let (mut before, mut moved_before) = (f64::INFINITY, f64::INFINITY);
    // Work of the forces along the last step, over its full length, and the part of it that was taken.
    let (mut gained, mut scale) = (0.0_f64, 1.0);
    // Way that was to go some iterations ago, in radii, and iterations in a row whose contact problem was not solved.
    let (mut way, mut unsolved) = (f64::INFINITY, 0);
    while out.iterations < settings.newton_max && !scratch.exhausted() && !scratch.late() {
        out.iterations += 1;
        scratch.work += 600.0 * model.mass.len() as f64
            + 200.0 * (scratch.candidates.threads.len() + scratch.candidates.shapes.len()) as f64;
        row::shape::review(model, state, scratch, out.iterations == 1);
        brake::review(model, state, &mut scratch.brakes);
        row::couple::zones(scratch);
        let first = out.iterations == 1;
        let mut taken = 1.0;
        loop {
            exact = exact && factor(model, state, scratch, h, Hessian::Exact, first);
            if !exact {
                factor(model, state, scratch, h, Hessian::Positive, first);
            }
            if first || taken < 0.2 || gained <= 0.0 || gained.is_nan() {
                break;
            }
            // Where the force along the last step has turned round the step went too far: contacts opened, closed or
            // began to slide on the way. Go back to where a straight line between the two forces says that it vanishes.
            let left = work_left(model, state, scratch);
            if left > -OVERSHOOT * gained {
                break;
            }
            let part = (gained / (gained - left)).max(SHORTEST);
            apply(model, state, scratch, -(1.0 - part) * taken * scale, false);
            taken *= part;
        }
        let blocks = core::mem::take(&mut scratch.rods);
        scratch.step.copy_from_slice(&scratch.rhs);
        for (rod, zone) in &blocks {
            scratch.system.solve_all(rod.clone(), zone, &mut scratch.step);
            scratch.torque_correction.apply(&scratch.system, rod, zone, &scratch.torque, &mut scratch.step);
        }
        scratch.rods = blocks;
        scratch.rows.border.couple(&mut scratch.step, false);
        row::couple::couple(state, scratch);
        row::follow::follow(scratch);
        gained = work_ahead(model, state, scratch);
        let trusted = !waiting || !neglects(model, state, scratch, h);
        scale = limit(state, scratch);
        let slid = apply(model, state, scratch, scale, true);
        row::shape::predict(scratch, scale);
        (out.turn, out.residual) = largest_move(model, scratch, scale);
        if waiting && (!trusted || out.turn > SLOW * before || !scratch.rows.is_empty()) {
            (waiting, exact) = (false, true);
        }
        out.residual =
            max_or_nan(out.residual, slid / model.rods.iter().map(|(_, r)| r.radius).fold(f64::INFINITY, f64::min));
        if !(out.turn.is_finite() && out.residual.is_finite()) {
            out.finite = false;
            return out;
        }
        unsolved = if row::couple::solved(scratch) { 0 } else { unsolved + 1 };
        let whole = out.residual / scale;
        let hopeless = unsolved > UNSOLVED || out.iterations.is_multiple_of(SOME) && whole > FAR && whole > 0.5 * way;
        if hopeless && !last && !scratch.rows.is_empty() {
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
            && (scratch.rows.is_empty() || out.residual * rate < NEAR);
        if rests
            && out.iterations >= least.min(settings.newton_max)
            && length_error(model, state, scratch) <= LENGTH_TOLERANCE
            && row::couple::solved(scratch)
            && brake::settled(model, state, &scratch.brakes)
            && row::shape::settled(model, state, scratch, out.iterations)
            && !extends(model, state, scratch)
        {
            out.converged = true;
            break;
        }
    }
    out
}

/// Whether contacts were added that the iterate calls for.
fn extends(model: &Model, state: &State, scratch: &mut Scratch) -> bool {
    let threads = row::thread::extend(model, state, scratch);
    row::shape::extend(model, state, scratch) || threads
}

/// Tension and shear force that the start of the substep carries into the geometric stiffness.
fn carried_forces(model: &Model, state: &State, scratch: &mut Scratch) {
    scratch.tension.copy_from_slice(&state.tension);
    for r in 0..scratch.rods.len() {
        let rod = scratch.rods[r].0.clone();
        for e in rod.start..rod.end - 1 {
            let strain = scratch.start_frame[e].conjugate() * (scratch.start[e + 1] - scratch.start[e]);
            scratch.shear[e] = strain.truncate() * model.stretch_stiffness[e].truncate();
        }
    }
}

/// Work of the forces at the iterate, contact forces as last found, along the last step.
fn work(scratch: &Scratch) -> f64 {
    let own: f64 = scratch.rhs.iter().zip(&scratch.step).map(|(r, z)| r.dot(*z)).sum();
    own + row::couple::work(scratch) + scratch.rows.border.work()
}

/// Linear change of an element's strain along the last step.
fn strain_change(model: &Model, state: &State, step: &[DVec3], e: usize) -> DVec3 {
    let (d, apart) = (state.position[e + 1] - state.position[e], step[2 * e + 2] - step[2 * e]);
    let change = state.orientation[e].conjugate() * (apart + d.cross(step[2 * e + 1]));
    if model.inextensible[e] { change.truncate().extend(apart.dot(d) / d.length()) } else { change }
}

/// Work along the last step of what `excess` says that the stretch and shear forces of each element are too large by.
fn work_of_excess(model: &Model, state: &State, scratch: &Scratch, excess: impl Fn(usize, DVec3) -> DVec3) -> f64 {
    // What slips off a reel builds up no force.
    let slips = |e: &usize| scratch.brakes.iter().any(|b| b.element == *e && b.slips);
    let elements = scratch.rods.iter().flat_map(|(rod, _)| rod.start..rod.end - 1).filter(|e| !slips(e));
    let on = |e: usize| {
        let change = strain_change(model, state, &scratch.step, e);
        excess(e, change).dot(change)
    };
    elements.map(on).sum()
}

/// Work of the forces along the step to come, over its full length, without the stretch and shear forces that it builds
/// up.
fn work_ahead(model: &Model, state: &State, scratch: &Scratch) -> f64 {
    let built_up = |e: usize, change: DVec3| {
        let axial = scratch.axial(model, e).0;
        let known = if model.is_tied(e) { scratch.system.right[e] } else { 0.0 };
        (model.stretch_stiffness[e].truncate() * change.truncate()).extend(axial * (change.z - known))
    };
    work(scratch) - work_of_excess(model, state, scratch, built_up)
}

/// Work of the forces at the iterate along the last step, with the stretch and shear forces that the step predicted:
/// those of the strain itself hold an error of second order in the turn, which the next step takes away and which
/// outweighs all else.
fn work_left(model: &Model, state: &State, scratch: &Scratch) -> f64 {
    let error = |e: usize, _| {
        let (axial, at_rest) = scratch.axial(model, e);
        let strain = element_strain(model, state, e);
        let tension = if model.is_tied(e) { 0.0 } else { axial * strain.z + at_rest - scratch.tension[e] };
        (strain.truncate() * model.stretch_stiffness[e].truncate() - scratch.shear[e]).extend(tension)
    };
    work(scratch) + work_of_excess(model, state, scratch, error) - row::shape::work_unforeseen(scratch)
}

/// Assembles and factors. False when a pivot is not positive.
pub(crate) fn factor(
    model: &Model,
    state: &State,
    scratch: &mut Scratch,
    h: f64,
    hessian: Hessian,
    first: bool,
) -> bool {
    assemble(model, state, scratch, h, hessian);
    brake::assemble(model, state, scratch);
    row::shape::assemble(model, state, scratch, first);
    let Scratch { rows, rhs, system, .. } = &mut *scratch;
    rows.welds.assemble_joints(state, rhs, &mut system.diagonal);
    row::weld::gather(model, state, scratch, hessian == Hessian::Exact);
    restrict(state, scratch);
    let Scratch { system, rods, rows, freedom, .. } = scratch;
    let mut positive = true;
    for (rod, zone) in rods.iter() {
        positive &= system.factor(rod.clone(), zone);
    }
    rows.border.factor(system, rods, freedom) && positive
}

/// Takes held nodes out of the system and puts the drive on guided ones.
fn restrict(state: &State, scratch: &mut Scratch) {
    for node in 0..scratch.freedom.len() {
        let freedom = scratch.freedom[node];
        if freedom == Freedom::Free {
            continue;
        }
        if let Some((stiffness, force)) = freedom.drive(state.position[node / 2]) {
            scratch.system.diagonal[node] += stiffness;
            scratch.rhs[node] += force;
        }
        let keep = freedom.projector();
        scratch.system.restrict(node, keep);
        scratch.rhs[node] = keep * scratch.rhs[node];
    }
}

/// Leaves in `scratch.rhs`, at the grips, the force and torque that each node lacks for balance without its grip: minus
/// what the grip exerts.
pub(crate) fn unbalanced(model: &Model, state: &State, scratch: &mut Scratch, h: f64) {
    for (_, grip) in state.grips.iter() {
        let rod = model.rods.at(grip.rod).expect("grips go with their rod");
        let first = (rod.first + grip.index) as usize;
        let held = if grip.hold == Hold::Jaw { first..first + 2 } else { first..first + 1 };
        unbalanced_blocks(model, state, scratch, h, rod, held.clone());
        // Where a weld is held, what all threads there lack.
        for weld in held.filter_map(|i| model.weld_of[i]) {
            for member in &model.welds.at(weld).expect("living").members {
                let (rod, i) = (model.rods.at(member.rod).expect("welds go with their rods"), member.index(model));
                if !(first..first + 2).contains(&i) {
                    unbalanced_blocks(model, state, scratch, h, rod, i..i + 1);
                }
            }
        }
    }
    assemble_clamps(state, scratch);
    let Scratch { rows, rhs, system, .. } = &mut *scratch;
    rows.welds.assemble_joints(state, rhs, &mut system.diagonal);
    row::shape::assemble(model, state, scratch, false);
    row::couple::add_forces(scratch);
}

fn unbalanced_blocks(model: &Model, state: &State, scratch: &mut Scratch, h: f64, rod: &RodModel, held: Range<usize>) {
    let elements = held.start.max(rod.first as usize + 1) - 1..held.end.min(rod.elements().end);
    scratch.tension[elements.clone()].copy_from_slice(&state.tension[elements]);
    assemble_blocks(model, state, scratch, h, &rod.particles(), held);
}

/// Factor on the update: no element turns by more than 0.3 rad in an iteration, and no pair of threads gets closer than
/// half its gap.
fn limit(state: &State, scratch: &Scratch) -> f64 {
    let turn =
        scratch.step.iter().skip(1).step_by(2).map(|v| v.length_squared()).fold(weld_turn(scratch), max_or_nan).sqrt();
    let by_turn = if turn > 0.3 { 0.3 / turn } else { 1.0 };
    by_turn.min(row::thread::limit(state, scratch, by_turn))
}

/// Greatest turn of a weld in the last step, squared.
fn weld_turn(scratch: &Scratch) -> f64 {
    let rows = &scratch.rows;
    rows.welds.turn_squared(rows.sliders.count(), &rows.border)
}

/// Maximum that keeps NaN.
#[inline]
fn max_or_nan(a: f64, b: f64) -> f64 {
    if b <= a || a.is_nan() { a } else { b }
}

/// Whether the positive matrix leaves out too much of the exact one along the last step, over inertia and bending
/// there. (Stretch and shear do not count: their rounding alone can outweigh a slow motion near buckling.)
fn neglects(model: &Model, state: &State, scratch: &Scratch, h: f64) -> bool {
    let step = &scratch.step;
    let (mut out, mut kept) = (0.0, 0.0);
    for (rod, _) in &scratch.rods {
        for e in rod.start..rod.end - 1 {
            let turn = step[2 * e + 1];
            let local = state.orientation[e].conjugate() * turn;
            out -= model.rest_length[e] * local.z * local.truncate().dot(scratch.shear[e]);
            if scratch.tension[e] < 0.0 {
                let change = state.orientation[e].conjugate() * (step[2 * e + 2] - step[2 * e]);
                out += scratch.tension[e] / model.rest_length[e] * change.truncate().length_squared();
            }
            kept += scratch.heavier[0] * model.mass[e] / (h * h) * step[2 * e].length_squared();
            if e > rod.start {
                let before = step[2 * e - 1];
                out += before.dot(scratch.moment[e].cross(turn));
                let stiffness = model.bend_stiffness[e];
                kept += stiffness.x.min(stiffness.y) * (turn - before).length_squared();
            }
        }
    }
    out.abs() > TRUSTED * kept
}

/// Takes a part of the step, `anew` or back on the last one; the largest move of a pushed shape \[m\].
fn apply(model: &Model, state: &mut State, scratch: &mut Scratch, scale: f64, anew: bool) -> f64 {
    for r in 0..scratch.rods.len() {
        let rod = scratch.rods[r].0.clone();
        for e in rod.start..rod.end - 1 {
            // Predicted force: strain now plus its linear change.
            let (q, d) = (state.orientation[e], state.position[e + 1] - state.position[e]);
            let change = strain_change(model, state, &scratch.step, e);
            let strain = q.conjugate() * d + change * scale - DVec3::new(0.0, 0.0, model.rest_length[e]);
            let f = strain * model.stretch_stiffness[e];
            scratch.shear[e] = f.truncate();
            if !model.inextensible[e] {
                scratch.tension[e] = f.z;
                continue;
            }
            // The tension is an unknown of its own, of which as much is taken as of the others.
            if anew {
                scratch.tension_change[e] = scratch.axial(model, e).0 * (change.z - scratch.system.right[e]);
            }
            scratch.tension[e] += scratch.tension_change[e] * scale;
        }
        for i in rod.clone() {
            state.position[i] += scratch.step[2 * i] * scale;
        }
        for e in rod.start..rod.end - 1 {
            state.orientation[e] = (exp(scratch.step[2 * e + 1] * scale) * state.orientation[e]).normalize();
        }
    }
    for b in scratch.brakes.iter().filter(|b| b.slips) {
        scratch.tension[b.element] = scratch.tension[b.element].min(b.limit);
    }
    let rows = &scratch.rows;
    rows.welds.apply(state, rows.sliders.count(), &rows.border, scale);
    rows.sliders.apply(state, &rows.border, scale)
}

/// Largest elongation by which an element of an inextensible thread is off what its tension makes it: a second-order
/// error of the turn that Newton just made.
fn length_error(model: &Model, state: &State, scratch: &Scratch) -> f64 {
    let mut worst = 0.0;
    for (_, rod) in model.rods.iter().filter(|(_, r)| r.stretch == crate::Stretch::Inextensible) {
        for e in rod.elements() {
            let (axial, at_rest) = scratch.axial(model, e);
            let c = (state.position[e + 1] - state.position[e]).length() - model.rest_length[e];
            worst = max_or_nan(worst, (c - (scratch.tension[e] - at_rest) / axial).abs() / model.rest_length[e]);
        }
    }
    worst
}

fn largest_move(model: &Model, scratch: &Scratch, scale: f64) -> (f64, f64) {
    let (mut turn, mut shift) = (weld_turn(scratch), 0.0);
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
