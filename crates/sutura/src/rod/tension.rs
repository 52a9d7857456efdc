//! Stretch and shear in the mixed form of Newton's method: forces that a step predicts, and what it counted on.
//!
//! Stretch is linearized with its multiplier: the geometric stiffness uses the tension that the last iteration
//! predicted, not the one of the current strain. In inextensible rods that tension is an unknown of its own (theory
//! 7.1).

use crate::math::{exp, max_or_nan};
use crate::model::Model;
use crate::motion::Motion;
use crate::rod::element_strain;
use crate::rod::scratch::RodScratch;
use crate::state::State;
use glam::DVec3;

/// Part of the stiffness along a step that the positive matrix may have left out where its step is taken for the last
/// one.
const TRUSTED: f64 = 0.1;

/// Linear change of an element's strain along the last step.
fn strain_change(model: &Model, state: &State, step: &[DVec3], e: usize) -> DVec3 {
    let (d, apart) = (state.position[e + 1] - state.position[e], step[2 * e + 2] - step[2 * e]);
    let change = state.orientation[e].conjugate() * (apart + d.cross(step[2 * e + 1]));
    if model.inextensible[e] { change.truncate().extend(apart.dot(d) / d.length()) } else { change }
}

impl RodScratch {
    /// Tension and shear force that the start of the substep carries into the geometric stiffness.
    pub fn begin(&mut self, model: &Model, state: &State, motion: &Motion) {
        self.tension.copy_from_slice(&state.tension);
        for (rod, _) in &self.ranges {
            for e in rod.start..rod.end - 1 {
                let strain = motion.start_frame[e].conjugate() * (motion.start[e + 1] - motion.start[e]);
                self.shear[e] = strain.truncate() * model.stretch_stiffness[e].truncate();
            }
        }
    }

    /// Work along the last step of what `excess` says that the stretch and shear forces of each element are too large by.
    fn work_of_excess(&self, model: &Model, state: &State, excess: impl Fn(usize, DVec3) -> DVec3) -> f64 {
        // What slips off a reel builds up no force.
        let slips = |e: &usize| self.brakes.iter().any(|b| b.element == *e && b.slips);
        let elements = self.elements().filter(|e| !slips(e));
        let on = |e: usize| {
            let change = strain_change(model, state, &self.step, e);
            excess(e, change).dot(change)
        };
        elements.map(on).sum()
    }

    /// Work along the step to come, over its full length, of the stretch and shear forces that it builds up.
    pub fn work_built_up(&self, model: &Model, state: &State) -> f64 {
        self.work_of_excess(model, state, |e, change| {
            let axial = self.axial(model, e).0;
            let known = if model.is_tied(e) { self.system.right[e] } else { 0.0 };
            (model.stretch_stiffness[e].truncate() * change.truncate()).extend(axial * (change.z - known))
        })
    }

    /// Work along the last step of what the strain's own stretch and shear forces are beyond those that the step
    /// predicted: an error of second order in the turn, which the next step takes away and which outweighs all else.
    pub fn work_of_turn(&self, model: &Model, state: &State) -> f64 {
        self.work_of_excess(model, state, |e, _| {
            let (axial, at_rest) = self.axial(model, e);
            let strain = element_strain(model, state, e);
            let tension = if model.is_tied(e) { 0.0 } else { axial * strain.z + at_rest - self.tension[e] };
            (strain.truncate() * model.stretch_stiffness[e].truncate() - self.shear[e]).extend(tension)
        })
    }

    /// Whether the positive matrix leaves out too much of the exact one along the last step, over inertia and bending
    /// there. (Stretch and shear do not count: their rounding alone can outweigh a slow motion near buckling.)
    pub fn neglects(&self, model: &Model, state: &State, motion: &Motion, h: f64) -> bool {
        let step = &self.step;
        let (mut out, mut kept) = (0.0, 0.0);
        for (rod, _) in &self.ranges {
            for e in rod.start..rod.end - 1 {
                let turn = step[2 * e + 1];
                let local = state.orientation[e].conjugate() * turn;
                out -= model.rest_length[e] * local.z * local.truncate().dot(self.shear[e]);
                if self.tension[e] < 0.0 {
                    let change = state.orientation[e].conjugate() * (step[2 * e + 2] - step[2 * e]);
                    out += self.tension[e] / model.rest_length[e] * change.truncate().length_squared();
                }
                kept += motion.heavier[0] * model.mass[e] / (h * h) * step[2 * e].length_squared();
                if e > rod.start {
                    let before = step[2 * e - 1];
                    out += before.dot(self.moment[e].cross(turn));
                    let stiffness = model.bend_stiffness[e];
                    kept += stiffness.x.min(stiffness.y) * (turn - before).length_squared();
                }
            }
        }
        out.abs() > TRUSTED * kept
    }

    /// Largest elongation by which an element of an inextensible thread is off what its tension makes it: a second-order
    /// error of the turn that Newton just made.
    pub fn length_error(&self, model: &Model, state: &State) -> f64 {
        let mut worst = 0.0;
        for (_, rod) in model.rods.iter().filter(|(_, r)| r.stretch == crate::Stretch::Inextensible) {
            for e in rod.elements() {
                let (axial, at_rest) = self.axial(model, e);
                let c = (state.position[e + 1] - state.position[e]).length() - model.rest_length[e];
                worst = max_or_nan(worst, (c - (self.tension[e] - at_rest) / axial).abs() / model.rest_length[e]);
            }
        }
        worst
    }

    /// Takes a part of the step, `anew` or back on the last one.
    pub fn apply(&mut self, model: &Model, state: &mut State, scale: f64, anew: bool) {
        for r in 0..self.ranges.len() {
            let rod = self.ranges[r].0.clone();
            for e in rod.start..rod.end - 1 {
                // Predicted force: strain now plus its linear change.
                let (q, d) = (state.orientation[e], state.position[e + 1] - state.position[e]);
                let change = strain_change(model, state, &self.step, e);
                let strain = q.conjugate() * d + change * scale - DVec3::new(0.0, 0.0, model.rest_length[e]);
                let f = strain * model.stretch_stiffness[e];
                self.shear[e] = f.truncate();
                if !model.inextensible[e] {
                    self.tension[e] = f.z;
                    continue;
                }
                // The tension is an unknown of its own, of which as much is taken as of the others.
                if anew {
                    self.tension_change[e] = self.axial(model, e).0 * (change.z - self.system.right[e]);
                }
                self.tension[e] += self.tension_change[e] * scale;
            }
            for i in rod.clone() {
                state.position[i] += self.step[2 * i] * scale;
            }
            for e in rod.start..rod.end - 1 {
                state.orientation[e] = (exp(self.step[2 * e + 1] * scale) * state.orientation[e]).normalize();
            }
        }
        for b in self.brakes.iter().filter(|b| b.slips) {
            self.tension[b.element] = self.tension[b.element].min(b.limit);
        }
    }

    /// Largest turn of a frame, squared, and largest move in radii of the last step.
    pub fn largest_move(&self, model: &Model) -> (f64, f64) {
        let (mut turn, mut shift) = (0.0, 0.0);
        for ((_, rod), (blocks, _)) in model.rods.iter().zip(&self.ranges) {
            let mut far = 0.0;
            for i in blocks.clone() {
                far = max_or_nan(far, self.step[2 * i].length_squared());
                turn = max_or_nan(turn, self.step[2 * i + 1].length_squared());
            }
            shift = max_or_nan(shift, far.sqrt() / rod.radius);
        }
        (turn, shift)
    }
}
