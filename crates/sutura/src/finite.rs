//! Whether everything that can be read of a state is a finite number.

use crate::model::Model;
use crate::rod::element_strain;
use crate::state::State;
use glam::DVec3;

/// Whether everything that can be read of an accepted state is a finite number: also what is the sum or product of
/// finite ones.
pub(crate) fn all_finite(model: &Model, state: &State) -> bool {
    let grips =
        state.grips.iter().all(|(_, g)| g.force.is_finite() && g.torque.is_finite() && g.pose.position.is_finite());
    let shapes = model.shapes.iter().all(|(k, _)| state.shape_pose[k as usize].is_valid());
    let threads = state.contacts.threads().iter().all(|c| c.force().is_finite());
    // What threads do to a shape is read as a sum.
    let on_shapes: DVec3 = state
        .contacts
        .shapes()
        .iter()
        .filter_map(|c| {
            let (element, s) = c.a.thread()?;
            let e = element as usize;
            let radius = model.rods.at(model.rod_of[e]).map_or(0.0, |r| r.radius);
            let at = state.position[e].lerp(state.position[e + 1], s);
            let arm = at - c.normal * radius - state.shape_pose[c.b.shape()? as usize].position;
            Some(c.force().abs() + arm.cross(c.force()).abs())
        })
        .sum();
    let bodies = state.bodies.iter().all(|(_, b)| {
        [b.position, b.velocity, b.angular_momentum, b.acceleration, b.torque].iter().all(|v| v.is_finite())
    });
    let between = state.contacts.bodies().iter().all(|c| c.force().is_finite());
    grips && bodies && between && shapes && threads && on_shapes.is_finite() && in_proportion(model, state)
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
