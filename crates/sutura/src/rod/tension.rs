//! Stretch and shear in the mixed form of Newton's method: forces that a step predicts, and what it counted on.
//!
//! Stretch is linearized with its multiplier: the geometric stiffness uses the tension that the last iteration
//! predicted, not the one of the current strain. In inextensible rods that tension is an unknown of its own (theory
//! 7.1).

use crate::lanes::{Quat2, Vec2, lanes, pairs};
use crate::math::max_or_nan;
use crate::model::Model;
use crate::motion::Motion;
use crate::rod::scratch::RodScratch;
use crate::rod::{along, element_strains};
use crate::state::State;
use glam::DVec3;
use wide::f64x2;

/// Part of the stiffness along a step that the positive matrix may have left out where its step is taken for the last
/// one.
const TRUSTED: f64 = 0.1;

/// Linear change of the strain of two elements of one rod along the last step.
#[inline(always)]
fn strain_change(model: &Model, state: &State, step: &[DVec3], (low, high): (usize, usize)) -> Vec2 {
    let d = along(&state.position, (low, high));
    let apart = Vec2::load(step[2 * low + 2], step[2 * high + 2]).less(&Vec2::load(step[2 * low], step[2 * high]));
    let turn = Vec2::load(step[2 * low + 1], step[2 * high + 1]);
    let q = Quat2::load(state.orientation[low], state.orientation[high]);
    let change = q.conjugate().rotate(&apart.add(&d.cross(&turn)));
    if model.inextensible[low] { Vec2 { z: apart.dot(&d) / d.dot(&d).sqrt(), ..change } } else { change }
}

/// Stiffness of two elements in shear and, of the material, in stretch.
#[inline(always)]
fn stiffness(model: &Model, (low, high): (usize, usize)) -> Vec2 {
    Vec2::load(model.stretch_stiffness[low], model.stretch_stiffness[high])
}

impl RodScratch {
    /// Tension and shear force that the start of the substep carries into the geometric stiffness.
    pub fn begin(&mut self, model: &Model, state: &State, motion: &Motion) {
        self.tension.copy_from_slice(&state.tension);
        for (rod, _) in &self.ranges {
            for (low, high) in pairs(rod.start..rod.end - 1) {
                let q = Quat2::load(motion.start_frame[low], motion.start_frame[high]);
                let strain = q.conjugate().rotate(&along(&motion.start, (low, high)));
                let force = strain.times(&stiffness(model, (low, high))).split();
                (self.shear[low], self.shear[high]) = (force.0.truncate(), force.1.truncate());
            }
        }
    }

    /// Axial stiffness of two elements, and their axial forces at their rest lengths.
    #[inline(always)]
    fn axials(&self, model: &Model, (low, high): (usize, usize)) -> (f64x2, f64x2) {
        let ((c0, p0), (c1, p1)) = (self.axial(model, low), self.axial(model, high));
        (lanes(c0, c1), lanes(p0, p1))
    }

    /// Work along the last step of what the strain's own stretch and shear forces are beyond those that the step
    /// predicted: an error of second order in the turn, which the next step takes away and which outweighs all else.
    pub fn work_of_turn(&self, model: &Model, state: &State) -> f64 {
        let mut sum = 0.0;
        for (rod, _) in &self.ranges {
            for (low, high) in pairs(rod.start..rod.end - 1) {
                let (axial, at_rest) = self.axials(model, (low, high));
                let strain = element_strains(model, state, (low, high));
                let beyond = (axial * strain.z + at_rest - lanes(self.tension[low], self.tension[high])).to_array();
                let off = |e: usize, beyond: f64| if model.is_tied(e) { 0.0 } else { beyond };
                let force = strain.times(&stiffness(model, (low, high)));
                let (s0, s1) = (self.shear[low], self.shear[high]);
                let excess = Vec2 {
                    x: force.x - lanes(s0.x, s1.x),
                    y: force.y - lanes(s0.y, s1.y),
                    z: lanes(off(low, beyond[0]), off(high, beyond[1])),
                };
                let change = strain_change(model, state, &self.step, (low, high));
                self.add_work(&mut sum, (low, high), excess.dot(&change));
            }
        }
        sum
    }

    /// Adds the work on two elements, but what slips off a reel, which builds up no force.
    #[inline(always)]
    fn add_work(&self, sum: &mut f64, (low, high): (usize, usize), work: f64x2) {
        let slips = |e: usize| self.brakes.iter().any(|b| b.element == e && b.slips);
        let [first, second] = work.to_array();
        if !slips(low) {
            *sum += first;
        }
        if high > low && !slips(high) {
            *sum += second;
        }
    }

    /// Whether the positive matrix leaves out too much of the exact one along the last step, over inertia and bending
    /// there. (Stretch and shear do not count: their rounding alone can outweigh a slow motion near buckling.)
    pub fn neglects(&self, model: &Model, state: &State, motion: &Motion, h: f64) -> bool {
        let step = &self.step;
        let heavier = f64x2::splat(motion.heavier[0]);
        let (mut out, mut kept) = (0.0, 0.0);
        for (rod, _) in &self.ranges {
            for (low, high) in pairs(rod.start..rod.end - 1) {
                let turn = Vec2::load(step[2 * low + 1], step[2 * high + 1]);
                let frame = Quat2::load(state.orientation[low], state.orientation[high]).conjugate();
                let local = frame.rotate(&turn);
                let l = lanes(model.rest_length[low], model.rest_length[high]);
                let (s0, s1) = (self.shear[low], self.shear[high]);
                let sheared = l * local.z * (local.x * lanes(s0.x, s1.x) + local.y * lanes(s0.y, s1.y));
                let x = Vec2::load(step[2 * low], step[2 * high]);
                let (t0, t1) = (self.tension[low], self.tension[high]);
                let pressed = if t0 < 0.0 || t1 < 0.0 {
                    let apart = Vec2::load(step[2 * low + 2], step[2 * high + 2]).less(&x);
                    let change = frame.rotate(&apart);
                    lanes(t0, t1) / l * (change.x * change.x + change.y * change.y)
                } else {
                    f64x2::ZERO
                };
                let moved = heavier * lanes(model.mass[low], model.mass[high]) / f64x2::splat(h * h) * x.dot(&x);
                // The first element of a rod has no joint before it.
                let before = |e: usize| step[2 * e.max(rod.start + 1) - 1];
                let before = Vec2::load(before(low), before(high));
                let crossed = before.dot(&Vec2::load(self.moment[low], self.moment[high]).cross(&turn));
                let (k0, k1) = (model.bend_stiffness[low], model.bend_stiffness[high]);
                let bent = turn.less(&before);
                let bent = lanes(k0.x.min(k0.y), k1.x.min(k1.y)) * bent.dot(&bent);
                let lanes = [sheared, pressed, moved, crossed, bent].map(f64x2::to_array);
                for (lane, e) in [low, high].into_iter().enumerate().take(1 + high - low) {
                    let [sheared, pressed, moved, crossed, bent] = lanes.map(|v| v[lane]);
                    out -= sheared;
                    if self.tension[e] < 0.0 {
                        out += pressed;
                    }
                    kept += moved;
                    if e > rod.start {
                        out += crossed;
                        kept += bent;
                    }
                }
            }
        }
        out.abs() > TRUSTED * kept
    }

    /// Largest elongation by which an element of an inextensible thread is off what its tension makes it: a
    /// second-order error of the turn that Newton just made.
    pub fn length_error(&self, model: &Model, state: &State) -> f64 {
        let mut worst = 0.0;
        for (_, rod) in model.rods.iter().filter(|(_, r)| r.stretch == crate::Stretch::Inextensible) {
            for (low, high) in pairs(rod.elements()) {
                let (axial, at_rest) = self.axials(model, (low, high));
                let (d, l) =
                    (along(&state.position, (low, high)), lanes(model.rest_length[low], model.rest_length[high]));
                let stretched = (lanes(self.tension[low], self.tension[high]) - at_rest) / axial;
                let [first, second] = ((d.dot(&d).sqrt() - l - stretched).abs() / l).to_array();
                worst = max_or_nan(max_or_nan(worst, first), second);
            }
        }
        worst
    }

    /// Takes a part of the step, `anew` or back on the last one. The work along the step, over its full length, of the
    /// stretch and shear forces that it builds up.
    pub fn apply(&mut self, model: &Model, state: &mut State, scale: f64, anew: bool) -> f64 {
        let mut built_up = 0.0;
        for r in 0..self.ranges.len() {
            let rod = self.ranges[r].0.clone();
            let part = f64x2::splat(scale);
            for (low, high) in pairs(rod.start..rod.end - 1) {
                // Predicted force: strain now plus its linear change.
                let q = Quat2::load(state.orientation[low], state.orientation[high]);
                let change = strain_change(model, state, &self.step, (low, high));
                let d = along(&state.position, (low, high));
                let l = lanes(model.rest_length[low], model.rest_length[high]);
                let strain = q.conjugate().rotate(&d).plus(&change, part);
                let k = stiffness(model, (low, high));
                let f = Vec2 { z: strain.z - l, ..strain }.times(&k).split();
                (self.shear[low], self.shear[high]) = (f.0.truncate(), f.1.truncate());
                let known = |e: usize| if model.is_tied(e) { self.system.right[e] } else { 0.0 };
                let known = lanes(known(low), known(high));
                let force = self.axials(model, (low, high)).0 * (change.z - known);
                let work = Vec2 { z: force, ..change.times(&k) }.dot(&change);
                self.add_work(&mut built_up, (low, high), work);
                if model.inextensible[low] {
                    // The tension is an unknown of its own, of which as much is taken as of the others.
                    if anew {
                        let known = lanes(self.system.right[low], self.system.right[high]);
                        [self.tension_change[low], self.tension_change[high]] =
                            (self.axials(model, (low, high)).0 * (change.z - known)).to_array();
                    }
                    let change = lanes(self.tension_change[low], self.tension_change[high]);
                    let tension = lanes(self.tension[low], self.tension[high]) + change * part;
                    [self.tension[low], self.tension[high]] = tension.to_array();
                } else {
                    (self.tension[low], self.tension[high]) = (f.0.z, f.1.z);
                }
                let turn = Vec2::load(self.step[2 * low + 1], self.step[2 * high + 1]);
                (state.orientation[low], state.orientation[high]) =
                    Quat2::exp(&turn.scaled(part)).product(&q).normalize().split();
            }
            for i in rod {
                state.position[i] += self.step[2 * i] * scale;
            }
        }
        for b in self.brakes.iter().filter(|b| b.slips) {
            self.tension[b.element] = self.tension[b.element].min(b.limit);
        }
        built_up
    }

    /// Largest turn of a frame, squared, and largest move in radii of the last step.
    pub fn largest_move(&self, model: &Model) -> (f64, f64) {
        let (mut turn, mut shift) = (0.0, 0.0);
        for ((_, rod), (blocks, _)) in model.rods.iter().zip(&self.ranges) {
            let mut far = 0.0;
            for (low, high) in pairs(blocks.clone()) {
                let x = Vec2::load(self.step[2 * low], self.step[2 * high]);
                let t = Vec2::load(self.step[2 * low + 1], self.step[2 * high + 1]);
                let ([x0, x1], [t0, t1]) = (x.dot(&x).to_array(), t.dot(&t).to_array());
                (far, turn) = (max_or_nan(max_or_nan(far, x0), x1), max_or_nan(max_or_nan(turn, t0), t1));
            }
            shift = max_or_nan(shift, far.sqrt() / rod.radius);
        }
        (turn, shift)
    }
}
