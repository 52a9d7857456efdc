//! Shapes that contact moves: their unknowns are the first of the border ([`border`](crate::row::border)), coupled to
//! all threads that touch them.
//!
//! A shape that a force pushes along a line has one. It has no mass; the force law `F (1 - v / v_limit)` is its
//! damping, taken implicitly.

use crate::model::Model;
use crate::model::shape::ShapeMotion;
use crate::row::border::Border;
use crate::row::side::Moves;
use crate::state::State;
use glam::{DMat3, DVec3};

/// A shape on a line, and the number of its unknown.
struct Slider {
    shape: u32,
    direction: DVec3,
}

/// The shapes that may move in the substep.
#[derive(Default)]
pub(crate) struct Movers {
    sliders: Vec<Slider>,
    /// Length of the solve \[s\].
    h: f64,
}

impl Movers {
    /// Lists the shapes that may move. A pushed shape without force stays.
    pub fn begin(&mut self, model: &Model, h: f64) {
        self.sliders.clear();
        self.h = h;
        for (slot, shape) in model.shapes.iter() {
            if let ShapeMotion::Pushed { direction, force, .. } = shape.motion
                && force > 0.0
            {
                self.sliders.push(Slider { shape: slot, direction });
            }
        }
    }

    /// Number of unknowns.
    pub fn count(&self) -> usize {
        self.sliders.len()
    }

    /// Puts what acts on the shapes beside contact into the border.
    pub fn assemble(&self, model: &Model, state: &State, start: &[crate::math::Pose], border: &mut Border) {
        let h = self.h;
        for (k, s) in self.sliders.iter().enumerate() {
            let Some(ShapeMotion::Pushed { force, speed_limit, .. }) = model.shapes.at(s.shape).map(|s| s.motion)
            else {
                continue;
            };
            let damper = force / (speed_limit * h);
            let moved = s.direction.dot(state.shape_pose[s.shape as usize].position - start[s.shape as usize].position);
            border.add_own(k, k, damper);
            border.push(k, force - damper * moved);
        }
    }

    /// How a shape's material point moves with its unknowns; none where nothing moves the shape.
    pub fn moves(&self, shape: u32) -> Option<Moves> {
        let k = self.sliders.iter().position(|s| s.shape == shape)?;
        Some(Moves::new(k, &[self.sliders[k].direction]))
    }

    /// Move of a point of a shape in this Newton iteration so far \[m\].
    pub fn moved(&self, shape: u32, border: &Border) -> DVec3 {
        self.moves(shape).map_or(DVec3::ZERO, |m| m.along(border))
    }

    /// Adds a contact of a shape with the element `e`: stiffness, force on the thread and weights of its particles.
    pub fn add(&self, shape: u32, e: usize, stiffness: &DMat3, force: DVec3, weights: [f64; 2], border: &mut Border) {
        let Some(moves) = self.moves(shape) else { return };
        for (k, direction) in moves.columns() {
            let pull = *stiffness * direction;
            border.link(k, 2 * e, -pull * weights[0]);
            border.link(k, 2 * e + 2, -pull * weights[1]);
            for (j, other) in moves.columns() {
                border.add_own(k, j, other.dot(pull));
            }
            border.push(k, -direction.dot(force));
        }
    }

    /// Moves the shapes by their part of the update; the largest move \[m\].
    pub fn apply(&self, state: &mut State, border: &Border, scale: f64) -> f64 {
        let mut far = 0.0f64;
        for (k, s) in self.sliders.iter().enumerate() {
            let step = border.step(k) * scale;
            state.shape_pose[s.shape as usize].position += s.direction * step;
            far = far.max(step.abs());
        }
        far
    }
}
