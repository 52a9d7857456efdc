//! Mechanical energy of rods.

use crate::model::Model;
use crate::model::grip::Hold;
use crate::model::rod::RodModel;
use crate::rod::{element_strain, joint_angle, strain, welded_joint};
use crate::state::{GripState, State};
use glam::DVec3;

/// Mechanical energy \[J\]. Elastic parts are zero at rest; gravity is relative to the world's origin.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Energy {
    /// Of motion and spin.
    pub kinetic: f64,
    /// Of stretch and shear.
    pub stretch: f64,
    /// Of bending.
    pub bend: f64,
    /// Of twist.
    pub twist: f64,
    /// In the gravity field.
    pub gravity: f64,
}

impl Energy {
    /// The sum.
    pub fn total(&self) -> f64 {
        self.kinetic + self.stretch + self.bend + self.twist + self.gravity
    }
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
