//! The discrete Cosserat rod: strains, their linear system, and read-outs.

pub(crate) mod assemble;
pub(crate) mod brake;
pub(crate) mod factor;
pub(crate) mod lanes;
pub(crate) mod strain;
pub(crate) mod torque;

use crate::model::grip::Hold;
use crate::model::{Model, rod::RodModel};
use crate::state::{GripState, State};
use crate::view::Energy;
use glam::DVec3;

/// Stretch and shear of element `e` along its directors \[m\]. The stretch of an inextensible one is that of the line
/// between its ends.
#[inline]
pub(crate) fn element_strain(model: &Model, state: &State, e: usize) -> DVec3 {
    let d = state.position[e + 1] - state.position[e];
    let c = state.orientation[e].conjugate() * d;
    c.truncate().extend(if model.inextensible[e] { d.length() } else { c.z } - model.rest_length[e])
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
        (half.angle(node, q), model.section[half.frame].bend / (0.5 * model.rest_length[half.frame]))
    })
}

/// Whether the energy of every rod is a finite number, and so all that is worked out from its state. (Elastic bending
/// and twist add no more than a stiffness times the square of half a turn.) So is the square of every distance.
pub(crate) fn in_proportion(model: &Model, state: &State) -> bool {
    let (mut sum, mut squares) = (0.0, 0.0);
    for (_, rod) in model.rods.iter() {
        for i in rod.particles() {
            squares += state.position[i].length_squared();
            sum += model.mass[i]
                * (state.velocity[i].length_squared() + model.settings.gravity.dot(state.position[i]).abs());
        }
        for e in rod.elements() {
            let c = element_strain(model, state, e);
            let w = state.angular_velocity[e];
            sum += model.inertia[e].max_element() * w.length_squared()
                + (model.stretch_stiffness[e] * c).dot(c)
                + state.tension[e].abs();
            sum += (model.bend_stiffness[e] * state.plastic[e]).dot(state.plastic[e]);
        }
    }
    sum.is_finite() && (4.0 * squares).is_finite()
}

/// Mechanical energy of a rod.
pub(crate) fn energy(model: &Model, state: &State, rod: &RodModel) -> Energy {
    let mut sum = Energy::default();
    for i in rod.particles() {
        sum.kinetic += 0.5 * model.mass[i] * state.velocity[i].length_squared();
        sum.gravity -= model.mass[i] * model.settings.gravity.dot(state.position[i]);
    }
    for e in rod.elements() {
        let w = state.orientation[e].conjugate() * state.angular_velocity[e];
        sum.kinetic += 0.5 * (model.inertia[e] * w).dot(w);
        let c = element_strain(model, state, e);
        let mut k = model.stretch_stiffness[e];
        if rod.stretch == crate::Stretch::Inextensible {
            k.z = 0.0;
        }
        sum.stretch += 0.5 * (k * c).dot(c);
        if model.is_joint(e) && model.weld_of[e].is_none() && clamps(model, state, rod).all(|(i, _)| i != e) {
            add_joint(&mut sum, joint_angle(model, state, e), model.bend_stiffness[e]);
        }
    }
    // A clamp holds half a joint on each side.
    for (i, grip) in clamps(model, state, rod).filter(|(i, _)| model.weld_of[*i].is_none()) {
        let held = grip.pose.orientation;
        for (e, first) in
            [(i.wrapping_sub(1), false), (i, true)].into_iter().filter(|(e, _)| rod.elements().contains(e))
        {
            let (a, b) = if first { (held, state.orientation[e]) } else { (state.orientation[e], held) };
            let angle = strain::joint_angle(a, b, grip.rest_half);
            add_joint(&mut sum, angle, model.section[e].bend / (0.5 * model.rest_length[e]));
        }
    }
    // Each weld once, also where it joins the rod to itself.
    for (_, weld) in model.welds.iter() {
        let first = weld.members.iter().map(|m| m.index(model)).find(|i| rod.particles().contains(i));
        for (a, b) in first.into_iter().flat_map(|e| welded_joint(model, state, rod, e)) {
            add_joint(&mut sum, a, b);
        }
    }
    sum
}

/// The clamps of a rod, with the particle that each holds.
fn clamps<'a>(model: &'a Model, state: &'a State, rod: &'a RodModel) -> impl Iterator<Item = (usize, &'a GripState)> {
    let slot = model.rod_of[rod.first as usize];
    let own = state.grips.iter().filter(move |(_, g)| g.rod == slot && g.hold == Hold::Clamp);
    own.map(|(_, g)| ((rod.first + g.index) as usize, g))
}

fn add_joint(sum: &mut Energy, angle: DVec3, stiffness: DVec3) {
    sum.bend += 0.5 * (stiffness.x * angle.x * angle.x + stiffness.y * angle.y * angle.y);
    sum.twist += 0.5 * stiffness.z * angle.z * angle.z;
}
