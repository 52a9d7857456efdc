//! The discrete Cosserat rod: strains, their linear system, and read-outs.

pub(crate) mod assemble;
pub(crate) mod brake;
pub(crate) mod constraint;
pub(crate) mod energy;
pub(crate) mod factor;

pub(crate) mod length;
pub(crate) mod plastic;
pub(crate) mod scratch;
pub(crate) mod strain;
pub(crate) mod tension;
pub(crate) mod torque;

use crate::lanes::{Quat2, Vec2, lanes};
use crate::model::weld::Half;
use crate::model::{Model, rod::RodModel};
use crate::state::State;
use glam::{DQuat, DVec3};

/// Stretch and shear of element `e` along its directors \[m\]. The stretch of an inextensible one is that of the line
/// between its ends.
#[inline]
pub(crate) fn element_strain(model: &Model, state: &State, e: usize) -> DVec3 {
    let d = state.position[e + 1] - state.position[e];
    let c = state.orientation[e].conjugate() * d;
    c.truncate().extend(if model.inextensible[e] { d.length() } else { c.z } - model.rest_length[e])
}

/// The same of two elements of one rod.
#[inline(always)]
pub(crate) fn element_strains(model: &Model, state: &State, (low, high): (usize, usize)) -> Vec2 {
    let d = along(&state.position, (low, high));
    let c = Quat2::load(state.orientation[low], state.orientation[high]).conjugate().rotate(&d);
    let l = lanes(model.rest_length[low], model.rest_length[high]);
    Vec2 { z: if model.inextensible[low] { d.dot(&d).sqrt() } else { c.z } - l, ..c }
}

/// The ways from the first to the second particles of two elements.
#[inline(always)]
pub(crate) fn along(x: &[DVec3], (low, high): (usize, usize)) -> Vec2 {
    Vec2::load(x[low + 1], x[high + 1]).less(&Vec2::load(x[low], x[high]))
}

/// Force carried by element `e` along its directors \[N\].
pub(crate) fn internal_force(model: &Model, state: &State, rod: &RodModel, e: usize) -> DVec3 {
    let mut f = element_strain(model, state, e) * model.stretch_stiffness[e];
    if rod.stretch == crate::Stretch::Inextensible {
        f.z = state.tension[e];
    }
    f
}

/// Elastic bend and twist of the joint before element `e` \[rad\].
pub(crate) fn joint_angle(model: &Model, state: &State, e: usize) -> DVec3 {
    strain::joint_angle(state.orientation[e - 1], state.orientation[e], model.rest_half[e]) - state.plastic[e]
}

/// Elastic angle \[rad\] of half a joint at a weld, for the orientations of the weld and of its frame.
pub(crate) fn half_angle(half: &Half, weld: DQuat, frame: DQuat) -> DVec3 {
    let held = weld * half.side.section;
    let (a, b) = if half.first { (held, frame) } else { (frame, held) };
    strain::joint_angle(a, b, half.side.rest_half)
}

/// Elastic angles of the two half joints by which a rod goes on through a weld, as it is at particle `e` (the first or
/// last of a closed rod), and their stiffness.
pub(crate) fn welded_joint(
    model: &Model,
    state: &State,
    rod: &RodModel,
    e: usize,
) -> impl Iterator<Item = (DVec3, DVec3)> {
    let slot = model.weld_of[e];
    let weld = slot.and_then(|s| model.welds.at(s));
    let halves = weld.into_iter().flat_map(|w| w.halves(model)).filter(|half| rod.elements().contains(&half.frame));
    halves.map(move |half| {
        let (q, node) =
            (state.orientation[half.frame], state.weld_orientation[slot.expect("there is a weld") as usize]);
        (half_angle(&half, node, q), model.section[half.frame].bend / (0.5 * model.rest_length[half.frame]))
    })
}
