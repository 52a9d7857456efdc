//! Shapes pushed along a line by a force: one unknown each, coupled to all threads that touch the shape. They border the rods' system,
//!
//! ```text
//! [ H   B ] [dz]   [r]
//! [ B^T D ] [dy] = [s]
//! ```
//!
//! and are eliminated last: `dy = (D - B^T H^-1 B)^-1 (s - B^T z)`, `dz = z - H^-1 B dy` with `z = H^-1 r`. The shape has no mass; the force
//! law `F (1 - v / v_limit)` is its damping, taken implicitly.

use crate::math::solve_dense;
use crate::model::Model;
use crate::model::shape::ShapeMotion;
use crate::scratch::{Freedom, Scratch};
use crate::state::State;
use glam::{DMat3, DVec3};

#[derive(Default)]
struct Slider {
    shape: u32,
    direction: DVec3,
    /// B, and H^-1 B.
    border: Vec<DVec3>,
    response: Vec<DVec3>,
    diagonal: f64,
    right: f64,
    /// Force of the small contact problem along the direction \[N\].
    load: f64,
    /// Move in this Newton iteration \[m\].
    step: f64,
}

/// The pushed shapes of the substep.
#[derive(Default)]
pub(crate) struct Sliders {
    sliders: Vec<Slider>,
    count: usize,
    /// Length of the solve \[s\].
    h: f64,
    schur: Vec<f64>,
    dense: Vec<f64>,
    small: Vec<f64>,
}

impl Sliders {
    /// Which shapes may slide. A pushed shape without force stays.
    pub fn begin(&mut self, model: &Model, h: f64) {
        (self.count, self.h) = (0, h);
        for (slot, shape) in model.shapes.iter() {
            if let ShapeMotion::Pushed { direction, force, .. } = shape.motion
                && force > 0.0
            {
                if self.sliders.len() == self.count {
                    self.sliders.push(Slider::default());
                }
                let s = &mut self.sliders[self.count];
                (s.shape, s.direction) = (slot, direction);
                self.count += 1;
            }
        }
    }

    fn active(&mut self) -> &mut [Slider] {
        &mut self.sliders[..self.count]
    }

    /// Clears the border and puts the force law on the diagonal.
    pub fn clear(&mut self, model: &Model, state: &State, start: &[crate::math::Pose]) {
        let h = self.h;
        for s in self.active() {
            let Some(ShapeMotion::Pushed { force, speed_limit, .. }) = model.shapes.at(s.shape).map(|s| s.motion) else { continue };
            let damper = force / (speed_limit * h);
            let moved = s.direction.dot(state.shape_pose[s.shape as usize].position - start[s.shape as usize].position);
            s.border.clear();
            s.border.resize(2 * model.mass.len(), DVec3::ZERO);
            s.diagonal = damper;
            s.right = force - damper * moved;
        }
    }

    /// Adds a contact of the shape with the element `e`: stiffness, force on the thread, weights of its particles and turn of its frame.
    pub fn add(&mut self, shape: u32, e: usize, stiffness: &DMat3, force: DVec3, weights: [f64; 2], turn: &DMat3) {
        let Some(s) = self.sliders[..self.count].iter_mut().find(|s| s.shape == shape) else { return };
        let pull = *stiffness * s.direction;
        s.border[2 * e] -= pull * weights[0];
        s.border[2 * e + 2] -= pull * weights[1];
        s.border[2 * e + 1] -= turn.transpose() * pull;
        s.diagonal += s.direction.dot(pull);
        s.right -= s.direction.dot(force);
    }

    /// Takes what is held out of the border and finds the responses. The rods' system is factored.
    pub fn factor(scratch: &mut Scratch) {
        let Scratch { rows, system, rods, freedom, .. } = scratch;
        let sliders = &mut rows.sliders;
        let n = sliders.count;
        for s in sliders.active() {
            for (node, b) in s.border.iter_mut().enumerate() {
                if freedom[node] != Freedom::Free {
                    *b = freedom[node].projector() * *b;
                }
            }
            s.response.clone_from(&s.border);
            for (rod, zone) in rods.iter() {
                system.solve(rod.clone(), zone, &mut s.response);
            }
            (s.step, s.load) = (0.0, 0.0);
        }
        sliders.schur.clear();
        for i in 0..n {
            for j in 0..n {
                let own = if i == j { sliders.sliders[i].diagonal } else { 0.0 };
                sliders.schur.push(own - inner(&sliders.sliders[i].border, &sliders.sliders[j].response));
            }
        }
    }

    /// The number of a shape that is pushed.
    pub fn find(&self, shape: u32) -> Option<usize> {
        self.sliders[..self.count].iter().position(|s| s.shape == shape)
    }
    pub fn direction(&self, k: usize) -> DVec3 {
        self.sliders[k].direction
    }
    /// Move in this Newton iteration so far \[m\].
    pub fn step(&self, k: usize) -> f64 {
        self.sliders[k].step
    }
    pub fn load(&mut self, k: usize, force: f64) {
        self.sliders[k].load += force;
    }

    /// Couples a solution `z` of the rods alone with the sliders under their own forces, or under those of the small contact problem.
    pub fn couple(&mut self, z: &mut [DVec3], contacts: bool) {
        let n = self.count;
        if n == 0 {
            return;
        }
        self.small.clear();
        for s in &self.sliders[..n] {
            self.small.push(if contacts { s.load } else { s.right } - inner(&s.border, z));
        }
        self.dense.clone_from(&self.schur);
        if !solve_dense(&mut self.dense, &mut self.small, n) {
            return;
        }
        for (s, y) in self.sliders[..n].iter_mut().zip(&self.small) {
            s.step += y;
            for (z, r) in z.iter_mut().zip(&s.response) {
                *z -= *r * *y;
            }
        }
    }

    /// Work of the forces on the shapes along their step.
    pub fn work(&self) -> f64 {
        self.sliders[..self.count].iter().map(|s| (s.right + s.load) * s.step).sum()
    }

    pub fn count(&self) -> usize {
        self.count
    }
    /// Response of the rods to slider `k`.
    pub fn response(&self, k: usize) -> &[DVec3] {
        &self.sliders[k].response
    }

    /// `schur^-1 v` for a vector over the sliders.
    pub fn solve_small(&mut self, v: &mut [f64]) {
        self.dense.clone_from(&self.schur);
        solve_dense(&mut self.dense, v, self.count);
    }

    /// Moves the shapes by their part of the update; the largest move \[m\].
    pub fn apply(&self, state: &mut State, scale: f64) -> f64 {
        let mut far = 0.0f64;
        for s in &self.sliders[..self.count] {
            state.shape_pose[s.shape as usize].position += s.direction * (s.step * scale);
            far = far.max((s.step * scale).abs());
        }
        far
    }
}

fn inner(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x.dot(*y)).sum()
}
