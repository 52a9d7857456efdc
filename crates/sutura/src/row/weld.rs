//! Welds: places of threads that share one point and one cross-section. Each is six unknowns at the border of the rods'
//! system ([`border`](crate::row::border)): where it is, and how it is turned.
//!
//! The particles there have no unknowns of their own: their rows and columns of the Newton matrix, inertia and elements
//! beside them included, are added up and become the weld's, which is elimination in another order and loses nothing.
//! The cross-section has no inertia; each frame beside it is tied to it by half a joint, as to a clamp, so that two
//! ends welded are one thread to second order in the element length.

use crate::math::{exp, skew};
use crate::model::Model;
use crate::rod::assemble::clamp_terms;
use crate::rod::constraint::{ClampJoint, NodeConstraint};
use crate::rod::half_angle;
use crate::rod::scratch::RodScratch;
use crate::row::Rows;
use crate::row::border::Border;
use crate::state::State;
use glam::{DMat3, DQuat, DVec3};

/// The welds of the substep in slot order. Their unknowns follow those of the pushed shapes.
#[derive(Default)]
pub(crate) struct Welds {
    welds: Vec<Active>,
    joints: Vec<Joint>,
    links: Vec<(usize, DMat3)>,
}

struct Active {
    slot: u32,
    /// What may move of its place, and of its turning.
    place: NodeConstraint,
    turning: NodeConstraint,
}

/// Half a joint between a weld and a frame, as last assembled.
struct Joint {
    weld: usize,
    /// `weld_from_section` of the thread.
    section: DQuat,
    half: ClampJoint,
    /// Moment on the first of the two in world axes, and stiffness against their turning.
    moment: DVec3,
    stiffness: DMat3,
}

/// Unknowns of a weld.
const SIX: usize = 6;

impl Welds {
    pub fn count(&self) -> usize {
        SIX * self.welds.len()
    }

    /// Lists welds and half joints at the start of a solve of length `h`, before anything has moved. Damping acts over
    /// the solve, also where it is one of two: a cross-section without inertia has no rate of its own.
    pub fn begin(&mut self, model: &Model, state: &State, joint_on: &mut [bool], h: f64) {
        self.welds.clear();
        self.joints.clear();
        for (slot, weld) in model.welds.iter() {
            let k = self.welds.len();
            self.welds.push(Active { slot, place: NodeConstraint::Free, turning: NodeConstraint::Free });
            let orientation = state.weld_orientation[slot as usize];
            for member in &weld.members {
                if member.before.is_some() && member.after.is_some() {
                    joint_on[member.index(model)] = false;
                }
                let damping = model.rods.at(member.rod).expect("welds go with their rods").material.bend_damping / h;
                for half in member.halves(model) {
                    self.joints.push(Joint {
                        weld: k,
                        section: half.side.section,
                        half: ClampJoint {
                            grip: slot,
                            frame: half.frame as u32,
                            first: half.first,
                            orientation,
                            rest_half: half.side.rest_half,
                            stiffness: model.section[half.frame].bend / (0.5 * model.rest_length[half.frame]),
                            damping,
                            start: half_angle(&half, orientation, state.orientation[half.frame]),
                        },
                        moment: DVec3::ZERO,
                        stiffness: DMat3::ZERO,
                    });
                }
            }
        }
    }

    /// Keeps the cross-section of a weld from turning.
    pub fn hold_turning(&mut self, slot: u32) {
        for w in self.welds.iter_mut().filter(|w| w.slot == slot) {
            w.turning = NodeConstraint::Held;
        }
    }

    /// Moves the welds to the iterate that Newton starts from. A weld is held where one of its particles is.
    pub fn predict(&mut self, model: &Model, state: &mut State, constraint: &mut [NodeConstraint], h: f64) {
        for (k, w) in self.welds.iter_mut().enumerate() {
            let members = &model.welds.at(w.slot).expect("living").members;
            let held = members.iter().map(|m| m.index(model)).find(|i| constraint[2 * i] != NodeConstraint::Free);
            let from = held.unwrap_or_else(|| members[0].index(model));
            w.place = constraint[2 * from];
            let place = state.position[from];
            for i in members.iter().map(|m| m.index(model)) {
                state.position[i] = place;
                constraint[2 * i] = NodeConstraint::Held;
            }
            if w.turning == NodeConstraint::Free
                && let Some(joint) = self.joints.iter().find(|j| j.weld == k)
            {
                let q = &mut state.weld_orientation[w.slot as usize];
                *q = (exp(state.angular_velocity[joint.half.frame as usize] * h) * *q).normalize();
            }
        }
    }

    /// Moments and stiffness of the half joints at the iterate, on the frames.
    pub fn assemble_joints(&mut self, state: &State, rhs: &mut [DVec3], diagonal: &mut [DMat3]) {
        for j in &mut self.joints {
            j.half.orientation = (state.weld_orientation[self.welds[j.weld].slot as usize] * j.section).normalize();
            (j.moment, j.stiffness) = clamp_terms(&j.half, state.orientation[j.half.frame as usize]);
            let node = 2 * j.half.frame as usize + 1;
            rhs[node] += if j.half.first { -j.moment } else { j.moment };
            diagonal[node] += j.stiffness;
        }
    }

    /// Moment of the half joints on the cross-section of a weld.
    pub fn moment(&self, slot: u32) -> DVec3 {
        self.joints
            .iter()
            .filter(|j| self.welds[j.weld].slot == slot)
            .map(|j| if j.half.first { j.moment } else { -j.moment })
            .sum()
    }

    /// Greatest turn of the last step \[rad\], squared.
    pub fn turn_squared(&self, first: usize, border: &Border) -> f64 {
        (0..self.welds.len())
            .map(|k| vector(border, first + SIX * k + 3).length_squared())
            .fold(0.0, |a, b| if b <= a { a } else { b })
    }

    /// Turns the cross-sections by their part of the step. (Their particles are moved with the others.)
    pub fn apply(&self, state: &mut State, first: usize, border: &Border, scale: f64) {
        for (k, w) in self.welds.iter().enumerate() {
            let q = &mut state.weld_orientation[w.slot as usize];
            *q = (exp(vector(border, first + SIX * k + 3) * scale) * *q).normalize();
        }
    }
}

fn vector(border: &Border, k: usize) -> DVec3 {
    DVec3::new(border.step(k), border.step(k + 1), border.step(k + 2))
}

/// Makes the rows of welded particles those of the weld: the rods are assembled, nothing is taken out yet.
pub(crate) fn gather(model: &Model, state: &State, rods: &mut RodScratch, rows: &mut Rows, exact: bool) {
    let RodScratch { system, rhs, .. } = rods;
    let Rows { welds, border, movers, .. } = rows;
    let first = movers.count();
    let Welds { welds, joints, links } = welds;
    // A pushed shape that touches an element beside a weld couples with the weld.
    for k in 0..first {
        let mut found = core::mem::take(border.links_mut(k));
        found.retain(|(node, v)| {
            let Some(w) = weld_of_node(model, welds, *node) else { return true };
            let v = welds[w].place.projector() * *v;
            for c in 0..3 {
                let to = first + SIX * w + c;
                border.add_own(k, to, v[c]);
                border.add_own(to, k, v[c]);
            }
            false
        });
        *border.links_mut(k) = found;
    }
    for k in 0..welds.len() {
        let base = first + SIX * k;
        links.clear();
        let (mut own, mut right) = (DMat3::ZERO, DVec3::ZERO);
        for member in &model.welds.at(welds[k].slot).expect("living").members {
            let i = member.index(model);
            let n = 2 * i;
            let rod = model.rods.at(member.rod).expect("welds go with their rods");
            own += system.diagonal[n];
            right += rhs[n];
            if i > rod.first as usize {
                links.push((n - 2, system.after[n - 2]));
                links.push((n - 1, system.next[n - 1]));
            }
            if i < (rod.first + rod.n_elements) as usize {
                links.push((n + 1, system.next[n].transpose()));
                links.push((n + 2, system.after[n].transpose()));
            }
            rhs[n] = DVec3::ZERO;
        }
        let place = welds[k].place;
        let i = model.welds.at(welds[k].slot).expect("living").members[0].index(model);
        if let Some((stiffness, force)) = place.drive(state.position[i]) {
            own += stiffness;
            right += force;
        }
        let keep = place.projector();
        for (node, m) in links.iter() {
            let m = *m * keep;
            match weld_of_node(model, welds, *node) {
                Some(other) => add_block(border, first + SIX * other, base, &(welds[other].place.projector() * m)),
                None => (0..3).for_each(|c| border.link(base + c, *node, m.col(c))),
            }
        }
        for member in &model.welds.at(welds[k].slot).expect("living").members {
            (0..3).for_each(|c| border.carry(base + c, 2 * member.index(model), keep.col(c)));
        }
        add_block(border, base, base, &(keep * own * keep + (DMat3::IDENTITY - keep)));
        let right = keep * right;
        (0..3).for_each(|c| border.push(base + c, right[c]));

        let base = base + 3;
        let keep = welds[k].turning.projector();
        let (mut own, mut right) = (DMat3::ZERO, DVec3::ZERO);
        for j in joints.iter().filter(|j| j.weld == k) {
            own += j.stiffness;
            right += if j.half.first { j.moment } else { -j.moment };
            // Rotations do not commute (as between two frames): half of the moment, with the sign of the order.
            let twist = if exact { skew(j.moment * if j.half.first { -0.5 } else { 0.5 }) } else { DMat3::ZERO };
            let m = (twist - j.stiffness) * keep;
            (0..3).for_each(|c| border.link(base + c, 2 * j.half.frame as usize + 1, m.col(c)));
        }
        add_block(border, base, base, &(keep * own * keep + (DMat3::IDENTITY - keep)));
        let right = keep * right;
        (0..3).for_each(|c| border.push(base + c, right[c]));
    }
}

/// The weld, counted in the substep, that a particle's node belongs to.
fn weld_of_node(model: &Model, welds: &[Active], node: usize) -> Option<usize> {
    let slot = model.weld_of[node / 2].filter(|_| node.is_multiple_of(2))?;
    welds.iter().position(|w| w.slot == slot)
}

fn add_block(border: &mut Border, row: usize, col: usize, m: &DMat3) {
    for c in 0..3 {
        for r in 0..3 {
            border.add_own(row + r, col + c, m.col(c)[r]);
        }
    }
}

/// Orientation of a weld's cross-section, between the frames before and after it, that leaves both half joints with the
/// same moment.
pub(crate) fn between(before: DQuat, after: DQuat, rest_half: DQuat) -> DQuat {
    let turn = (before * rest_half).conjugate() * (after * rest_half.conjugate());
    (before * rest_half * crate::math::half(turn)).normalize()
}
