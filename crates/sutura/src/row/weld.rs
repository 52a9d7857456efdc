//! Welds: places of threads that share one point and one cross-section. Each is six unknowns at the border of the rods'
//! system ([`border`](crate::row::border)): where it is, and how it is turned.
//!
//! The particles there have no unknowns of their own: their rows and columns of the Newton matrix, inertia and elements
//! beside them included, are added up and become the weld's, which is elimination in another order and loses nothing.
//! The cross-section has no inertia; each frame beside it is tied to it by half a joint, as to a clamp, so that two
//! ends welded are one thread to second order in the element length.

use crate::math::{exp, skew};
use crate::model::Model;
use crate::model::weld::Anchor;
use crate::rod::assemble::clamp_terms;
use crate::rod::constraint::{ClampJoint, NodeConstraint};
use crate::rod::half_angle;
use crate::rod::scratch::RodScratch;
use crate::row::Rows;
use crate::row::border::Border;
use crate::row::movers::{Movers, six_columns, turning_stiffness};
use crate::state::State;
use core::ops::Range;
use glam::{DMat3, DQuat, DVec3};

/// The welds of the substep in slot order. Their unknowns follow those of the pushed shapes.
#[derive(Default)]
pub(crate) struct Welds {
    welds: Vec<Active>,
    joints: Vec<Joint>,
    /// Couplings of nodes with the places of the welds, weld by weld.
    links: Vec<(usize, DMat3)>,
    /// Number of those with unknowns of their own.
    own: usize,
}

struct Active {
    slot: u32,
    /// Its number among those that have unknowns of their own, or where it is on a body.
    at: Carrier,
    unknowns: Unknowns,
    /// Stiffness at its place, what its particles lack for balance, and their couplings, as last assembled.
    own: DMat3,
    right: DVec3,
    links: Range<usize>,
    /// Force of its threads on the body that it is on, as the last step predicted it.
    force: DVec3,
    /// What may move of its place, and of its turning.
    place: NodeConstraint,
    turning: NodeConstraint,
}

#[derive(Clone, Copy)]
enum Carrier {
    Own(usize),
    Body(Anchor),
}

/// The unknowns of the border that move the place of a weld and turn its cross-section, at the iterate: each with what
/// a unit of it does.
#[derive(Clone, Copy, Default)]
struct Unknowns {
    place: [(usize, DVec3); SIX],
    n_place: usize,
    turning: [(usize, DVec3); 3],
    n_turning: usize,
    /// From the center of the body that it is on to its place.
    arm: DVec3,
}

impl Unknowns {
    fn place(&self) -> &[(usize, DVec3)] {
        &self.place[..self.n_place]
    }
    fn turning(&self) -> &[(usize, DVec3)] {
        &self.turning[..self.n_turning]
    }
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
        SIX * self.own
    }

    /// Lists welds and half joints at the start of a solve of length `h`, before anything has moved. Damping acts over
    /// the solve, also where it is one of two: a cross-section without inertia has no rate of its own.
    pub fn begin(&mut self, model: &Model, state: &State, joint_on: &mut [bool], h: f64) {
        self.welds.clear();
        self.joints.clear();
        self.own = 0;
        for (slot, weld) in model.welds.iter() {
            let k = self.welds.len();
            let at = match weld.anchor {
                Some(anchor) => Carrier::Body(anchor),
                None => {
                    self.own += 1;
                    Carrier::Own(self.own - 1)
                }
            };
            let (place, turning) = (NodeConstraint::Free, NodeConstraint::Free);
            self.welds.push(Active {
                slot,
                at,
                unknowns: Unknowns::default(),
                own: DMat3::ZERO,
                right: DVec3::ZERO,
                links: 0..0,
                force: state.weld_force[slot as usize],
                place,
                turning,
            });
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
            if let Carrier::Body(anchor) = w.at {
                members.iter().for_each(|m| constraint[2 * m.index(model)] = NodeConstraint::Held);
                go_with_body(model, state, w.slot, &anchor);
                continue;
            }
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
        (0..self.own)
            .map(|k| vector(border, first + SIX * k + 3).length_squared())
            .fold(0.0, |a, b| if b <= a { a } else { b })
    }

    /// Turns the cross-sections by their part of the step (their particles are moved with the others), and puts those
    /// on bodies where these are now.
    pub fn apply(&self, model: &Model, state: &mut State, first: usize, border: &Border, scale: f64) {
        for w in &self.welds {
            match w.at {
                Carrier::Own(k) => {
                    let q = &mut state.weld_orientation[w.slot as usize];
                    *q = (exp(vector(border, first + SIX * k + 3) * scale) * *q).normalize();
                }
                Carrier::Body(anchor) => go_with_body(model, state, w.slot, &anchor),
            }
        }
    }

    /// Notes the forces on bodies that a step of this length predicts.
    pub fn predict_forces(&mut self, step: &[DVec3], border: &Border, scale: f64) {
        for w in self.welds.iter_mut().filter(|w| w.unknowns.n_place == SIX) {
            let moved: DVec3 = w.unknowns.place().iter().map(|(j, v)| *v * border.step(*j)).sum();
            let pull = self.links[w.links.clone()].iter().map(|(node, m)| m.transpose() * step[*node]);
            w.force = w.right - (w.own * moved + pull.sum::<DVec3>()) * scale;
        }
    }

    /// Force of the threads of a weld on the body that it is on as the last step predicted it, where the body moves.
    pub fn predicted(&self, slot: u32) -> Option<DVec3> {
        self.welds.iter().find(|w| w.slot == slot && w.unknowns.n_place == SIX).map(|w| w.force)
    }

    /// Finds the unknowns of each weld at the iterate.
    fn find_unknowns(&mut self, state: &State, movers: &Movers) {
        let after = movers.count();
        for w in &mut self.welds {
            let u = &mut w.unknowns;
            match w.at {
                Carrier::Own(k) => {
                    let base = after + SIX * k;
                    let (place, turning) = (w.place.projector(), w.turning.projector());
                    (u.n_place, u.n_turning) = (3, 3);
                    for c in 0..3 {
                        u.place[c] = (base + c, place.col(c));
                        u.turning[c] = (base + 3 + c, turning.col(c));
                    }
                }
                Carrier::Body(anchor) => {
                    (u.n_place, u.n_turning) = (0, 0);
                    let at = state.bodies.at(anchor.body).map(|b| b.pose().transform_point(anchor.pose.position));
                    if let (Some((first, center)), Some(at)) = (movers.unknowns_of(anchor.body), at) {
                        (u.n_place, u.n_turning, u.arm) = (SIX, 3, at - center);
                        for (c, column) in six_columns(u.arm).into_iter().enumerate() {
                            u.place[c] = (first + c, column);
                        }
                        for (c, axis) in DVec3::AXES.into_iter().enumerate() {
                            u.turning[c] = (first + 3 + c, axis);
                        }
                    }
                }
            }
        }
    }
}

/// Puts the particles of a weld on a body, and its cross-section, where the body is.
fn go_with_body(model: &Model, state: &mut State, slot: u32, anchor: &Anchor) {
    let Some(pose) = state.bodies.at(anchor.body).map(|b| b.pose().compose(&anchor.pose)) else { return };
    for member in &model.welds.at(slot).expect("living").members {
        state.position[member.index(model)] = pose.position;
    }
    state.weld_orientation[slot as usize] = pose.orientation;
}

fn vector(border: &Border, k: usize) -> DVec3 {
    DVec3::new(border.step(k), border.step(k + 1), border.step(k + 2))
}

/// Makes the rows of welded particles those of the weld, or of the body that it is on: the rods are assembled, nothing
/// is taken out yet.
pub(crate) fn gather(model: &Model, state: &State, rods: &mut RodScratch, rows: &mut Rows, exact: bool) {
    let RodScratch { system, rhs, .. } = rods;
    let Rows { welds, border, movers, .. } = rows;
    if welds.welds.is_empty() {
        return;
    }
    welds.find_unknowns(state, movers);
    let Welds { welds, joints, links, .. } = welds;
    links.clear();
    // What moves and touches an element beside a weld couples with the weld.
    for k in 0..movers.count() {
        let mut found = core::mem::take(border.links_mut(k));
        found.retain(|(node, v)| {
            let Some(w) = weld_of_node(model, welds, *node) else { return true };
            for (to, column) in welds[w].unknowns.place() {
                border.add_own(k, *to, column.dot(*v));
                border.add_own(*to, k, column.dot(*v));
            }
            false
        });
        *border.links_mut(k) = found;
    }
    for k in 0..welds.len() {
        let weld = &welds[k];
        let members = &model.welds.at(weld.slot).expect("living").members;
        let from = links.len();
        let (mut own, mut right) = (DMat3::ZERO, DVec3::ZERO);
        for member in members {
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
        if let Some((stiffness, force)) = weld.place.drive(state.position[members[0].index(model)]) {
            own += stiffness;
            right += force;
        }
        let place = weld.unknowns.place();
        for (node, m) in &links[from..] {
            match weld_of_node(model, welds, *node) {
                Some(other) => add_block(border, welds[other].unknowns.place(), place, m),
                None => place.iter().for_each(|(j, v)| border.link(*j, *node, *m * *v)),
            }
        }
        for member in members {
            place.iter().for_each(|(j, v)| border.carry(*j, 2 * member.index(model), *v));
        }
        add_block(border, place, place, &own);
        place.iter().for_each(|(j, v)| border.push(*j, v.dot(right)));

        let turning = weld.unknowns.turning();
        let (mut stiffness, mut moment) = (DMat3::ZERO, DVec3::ZERO);
        for j in joints.iter().filter(|j| j.weld == k) {
            stiffness += j.stiffness;
            moment += if j.half.first { j.moment } else { -j.moment };
            // Rotations do not commute (as between two frames): half of the moment, with the sign of the order.
            let twist = if exact { skew(j.moment * if j.half.first { -0.5 } else { 0.5 }) } else { DMat3::ZERO };
            let m = twist - j.stiffness;
            turning.iter().for_each(|(c, v)| border.link(*c, 2 * j.half.frame as usize + 1, m * *v));
        }
        match weld.at {
            Carrier::Own(_) => {
                hold(border, place, &weld.place.projector());
                hold(border, turning, &weld.turning.projector());
            }
            Carrier::Body(_) => {
                let most = if exact { f64::INFINITY } else { 0.0 };
                stiffness += turning_stiffness(weld.force, weld.unknowns.arm, |_| most);
            }
        }
        add_block(border, turning, turning, &stiffness);
        turning.iter().for_each(|(j, v)| border.push(*j, v.dot(moment)));
        let weld = &mut welds[k];
        (weld.own, weld.right, weld.links) = (own, right, from..links.len());
    }
}

/// Gives unknowns whose directions are not free a stiffness of their own.
fn hold(border: &mut Border, unknowns: &[(usize, DVec3)], keep: &DMat3) {
    let held = DMat3::IDENTITY - *keep;
    for (r, (i, _)) in unknowns.iter().enumerate() {
        for (c, (j, _)) in unknowns.iter().enumerate() {
            border.add_own(*i, *j, held.col(c)[r]);
        }
    }
}

/// The weld, counted in the substep, that a particle's node belongs to.
fn weld_of_node(model: &Model, welds: &[Active], node: usize) -> Option<usize> {
    let slot = model.weld_of[node / 2].filter(|_| node.is_multiple_of(2))?;
    welds.iter().position(|w| w.slot == slot)
}

fn add_block(border: &mut Border, rows: &[(usize, DVec3)], columns: &[(usize, DVec3)], m: &DMat3) {
    for (j, v) in columns {
        let pull = *m * *v;
        rows.iter().for_each(|(i, u)| border.add_own(*i, *j, u.dot(pull)));
    }
}

/// Orientation of a weld's cross-section, between the frames before and after it, that leaves both half joints with the
/// same moment.
pub(crate) fn between(before: DQuat, after: DQuat, rest_half: DQuat) -> DQuat {
    let turn = (before * rest_half).conjugate() * (after * rest_half.conjugate());
    (before * rest_half * crate::math::half(turn)).normalize()
}
