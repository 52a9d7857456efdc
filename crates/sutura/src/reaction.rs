//! Forces of grips: what the nodes that they hold lack for balance.

use crate::model::Model;
use crate::model::grip::{Drive, Hold};
use crate::model::rod::RodModel;
use crate::motion::Motion;
use crate::newton::Solver;
use crate::rod::assemble::{assemble_blocks, assemble_clamps, clamp_terms};
use crate::rod::scratch::RodScratch;
use crate::row;
use crate::state::State;
use core::ops::Range;
use glam::DVec3;

/// Force and torque of each grip on its thread, and of threads on bodies, from what was left unbalanced at their nodes.
pub(crate) fn reactions(model: &Model, state: &mut State, solver: &mut Solver, h: f64) {
    unbalanced(model, state, solver, h);
    let Solver { rods, rows, .. } = solver;
    // At a weld all threads together.
    let rhs = &rods.rhs;
    let lacking = |i: usize| match model.weld_of[i].and_then(|w| model.welds.at(w)) {
        Some(weld) => weld.members.iter().map(|m| rhs[2 * m.index(model)]).sum(),
        None => rhs[2 * i],
    };
    for (slot, weld) in model.welds.iter().filter(|(_, w)| w.anchor.is_some()) {
        // Where nothing moves the body nothing was predicted.
        let lacking = || weld.members.iter().map(|m| rhs[2 * m.index(model)]).sum();
        state.weld_force[slot as usize] = rows.welds.predicted(slot).unwrap_or_else(lacking);
    }
    let (position, grips) = (&state.position, &mut state.grips);
    for (slot, grip) in grips.iter_mut() {
        let rod = model.rods.at(grip.rod).expect("grips go with their rod");
        let i = rod.first as usize + grip.index as usize;
        grip.torque = DVec3::ZERO;
        grip.force = -lacking(i);
        match grip.hold {
            Hold::Pin => {}
            Hold::Clamp if let Some(weld) = model.weld_of[i] => grip.torque = -rows.welds.moment(weld),
            Hold::Clamp => {
                for c in rods.clamps.iter().filter(|c| c.grip == slot) {
                    let (moment, _) = clamp_terms(c, state.orientation[c.frame as usize]);
                    grip.torque += if c.first { -moment } else { moment };
                }
            }
            Hold::Jaw => {
                let other = -lacking(i + 1);
                let arm = (position[i + 1] - position[i]) * 0.5;
                grip.torque = arm.cross(other - grip.force) - rods.rhs[2 * i + 1];
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

/// Leaves in `rods.rhs`, at the grips, the force and torque that each node lacks for balance without its grip: minus
/// what the grip exerts.
fn unbalanced(model: &Model, state: &State, solver: &mut Solver, h: f64) {
    let Solver { motion, rods, rows, .. } = solver;
    for (_, grip) in state.grips.iter() {
        let rod = model.rods.at(grip.rod).expect("grips go with their rod");
        let first = (rod.first + grip.index) as usize;
        let held = if grip.hold == Hold::Jaw { first..first + 2 } else { first..first + 1 };
        unbalanced_blocks(model, state, motion, rods, h, rod, held.clone());
        // Where a weld is held, what all threads there lack.
        for weld in held.filter_map(|i| model.weld_of[i]) {
            for member in &model.welds.at(weld).expect("living").members {
                let (rod, i) = (model.rods.at(member.rod).expect("welds go with their rods"), member.index(model));
                if !(first..first + 2).contains(&i) {
                    unbalanced_blocks(model, state, motion, rods, h, rod, i..i + 1);
                }
            }
        }
    }
    for (_, weld) in model.welds.iter().filter(|(_, w)| w.anchor.is_some()) {
        for member in &weld.members {
            let (rod, i) = (model.rods.at(member.rod).expect("welds go with their rods"), member.index(model));
            unbalanced_blocks(model, state, motion, rods, h, rod, i..i + 1);
        }
    }
    assemble_clamps(state, rods);
    rows.welds.assemble_joints(state, &mut rods.rhs, &mut rods.system.diagonal);
    row::shape::assemble(model, state, motion, rods, rows, false);
    row::system::add_forces(rows, &mut rods.rhs);
}

fn unbalanced_blocks(
    model: &Model,
    state: &State,
    motion: &Motion,
    rods: &mut RodScratch,
    h: f64,
    rod: &RodModel,
    held: Range<usize>,
) {
    let elements = held.start.max(rod.first as usize + 1) - 1..held.end.min(rod.elements().end);
    rods.tension[elements.clone()].copy_from_slice(&state.tension[elements]);
    assemble_blocks(model, state, motion, rods, (h, &rod.particles(), held));
}
