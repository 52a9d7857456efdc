//! Whether everything that can be read of a state is a finite number.

use crate::lanes::{Vec2, lanes, pairs};
use crate::model::Model;
use crate::rod::element_strains;
use crate::state::State;
use glam::DVec3;
use wide::f64x2;

/// Whether what can be read of an accepted state is finite, but for what [`in_proportion`] looks at: also what is the
/// sum or product of finite numbers.
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
    let joints = state.joints.iter().all(|(_, j)| {
        let along = [j.coordinate, j.drive[0], j.drive[1], j.stop];
        j.force.is_finite() && j.torque.is_finite() && along.iter().all(|v| v.is_finite())
    });
    let between = state.contacts.bodies().iter().all(|c| c.force().is_finite());
    grips && bodies && joints && between && shapes && threads && on_shapes.is_finite()
}

/// Whether the energy of every rod and body is a finite number, and so all that is worked out from its state. (Elastic
/// bending and twist add no more than a stiffness times the square of half a turn.) So is the square of every distance.
pub(crate) fn in_proportion(model: &Model, state: &State) -> bool {
    let (mut sum, mut squares) = (f64x2::ZERO, f64x2::ZERO);
    let gravity = Vec2::load(model.settings.gravity, model.settings.gravity);
    for (_, rod) in model.rods.iter() {
        for (low, high) in pairs(rod.particles()) {
            let x = Vec2::load(state.position[low], state.position[high]);
            let v = Vec2::load(state.velocity[low], state.velocity[high]);
            squares += x.dot(&x);
            sum += lanes(model.mass[low], model.mass[high]) * (v.dot(&v) + gravity.dot(&x).abs());
        }
        for (low, high) in pairs(rod.elements()) {
            let two = |of: &[DVec3]| Vec2::load(of[low], of[high]);
            let c = element_strains(model, state, (low, high));
            let (w, bent) = (two(&state.angular_velocity), two(&state.plastic));
            let inertia = lanes(model.inertia[low].max_element(), model.inertia[high].max_element());
            sum += inertia * w.dot(&w)
                + two(&model.stretch_stiffness).times(&c).dot(&c)
                + lanes(state.tension[low], state.tension[high]).abs()
                + two(&model.bend_stiffness).times(&bent).dot(&bent);
        }
    }
    let (mut of_bodies, mut far) = (0.0, 0.0);
    for (slot, b) in state.bodies.iter() {
        let Some(mass) = model.bodies.at(slot).map(|b| &b.mass) else { continue };
        far += b.position.length_squared();
        of_bodies += mass.mass * (b.velocity.length_squared() + model.settings.gravity.dot(b.position).abs());
        of_bodies += b.angular_momentum.length_squared() / mass.moments.min_element();
    }
    (sum.reduce_add() + of_bodies).is_finite() && (4.0 * (squares.reduce_add() + far)).is_finite()
}
