//! What contact moves beside threads: its unknowns are the first of the border ([`border`](crate::row::border)),
//! coupled to all threads that touch it.
//!
//! A shape that a force pushes along a line has one. It has no mass; the force law `F (1 - v / v_limit)` is its
//! damping, taken implicitly. A free body has six: the place of its center of mass and its turn. With Omega the mean
//! angular velocity in body axes over the solve and R_m the orientation halfway,
//!
//! ```text
//! Omega = log(q0^-1 q) / h,    R_m = R(q0 exp(h Omega / 2)),    L = R_m I Omega
//! ```
//!
//! its angular momentum keeps to L = L0 + h tau: momentum is kept exactly, and a free top is of second order in h.
//! The matrix has R_m I R_m^T / h^2, which leaves out a part of the order h |Omega|. In the methods with two solves
//! Omega is the velocity at the end of a solve, and R_m the orientation there.

use crate::math::{exp, log, outer, skew};
use crate::model::Model;
use crate::model::shape::ShapeMotion;
use crate::motion::{BodyStart, Motion};
use crate::row::border::Border;
use crate::row::side::Moves;
use crate::state::{BodyState, Moved, State};
use core::ops::Range;
use glam::{DMat3, DQuat, DVec3};

/// A shape on a line.
struct Slider {
    shape: u32,
    direction: DVec3,
}

/// A body that contact can move, by unknowns of its own or with the one that holds it.
struct Mover {
    slot: u32,
    /// First of the unknowns, the body that has them, and where that has its center of mass at the iterate.
    first: usize,
    root: u32,
    center: DVec3,
}

/// What may move in the substep. Unknowns are those of the sliders, then those of the bodies.
#[derive(Default)]
pub(crate) struct Movers {
    sliders: Vec<Slider>,
    bodies: Vec<Mover>,
    /// Number of bodies with unknowns of their own.
    roots: usize,
    /// What moves each body, counted here, by its slot, and the body of each shape.
    mover_of: Vec<Option<u32>>,
    body_of: Vec<Option<u32>>,
    /// Length of the solve \[s\].
    h: f64,
}

/// Unknowns of a body.
const SIX: usize = 6;

/// Inertia in world axes and angular momentum of a body that has come to `q` within `span`.
fn rotation(moments: DVec3, start: &BodyStart, q: DQuat, span: f64) -> (DMat3, DVec3) {
    let turn = log(start.base.conjugate() * q);
    let middle = DMat3::from_quat(start.base * exp(turn * start.part));
    let inertia = middle * DMat3::from_diagonal(moments) * middle.transpose();
    (inertia, middle * (moments * turn) / span)
}

/// Orientation after `span` of a body without torque.
pub(crate) fn turned_freely(moments: DVec3, start: &BodyStart, span: f64) -> DQuat {
    let mut turn = DVec3::ZERO;
    for _ in 0..20 {
        let middle = start.base * exp(turn * start.part);
        let next = (middle.conjugate() * start.momentum) / moments * span;
        let done = (next - turn).length() <= 1e-15 * next.length();
        turn = next;
        if done {
            break;
        }
    }
    (start.base * exp(turn)).normalize()
}

/// Angular momentum of a body that has come to where it is within `span`.
pub(crate) fn momentum(moments: DVec3, start: &BodyStart, body: &BodyState, span: f64) -> DVec3 {
    rotation(moments, start, body.orientation, span).1
}

/// Puts the shapes of a body where it is.
pub(crate) fn place_shapes(model: &Model, state: &mut State, slot: u32) {
    let (Some(model), Some(body)) = (model.bodies.at(slot), state.bodies.at(slot)) else { return };
    let pose = body.pose();
    for (shape, local) in &model.shapes {
        state.shape_pose[*shape as usize] = pose.compose(local);
    }
}

/// Puts a body that another one holds, and its shapes, where that is.
pub(crate) fn follow_holder(model: &Model, state: &mut State, slot: u32) {
    if let Some(Moved::Held { by, at }) = state.bodies.at(slot).map(|b| b.motion)
        && let Some(pose) = state.bodies.at(by).map(|b| b.pose().compose(&at))
    {
        state.bodies.at_mut(slot).expect("just read").place(&pose);
        place_shapes(model, state, slot);
    }
}

/// How a point that is `arm` from the center of what moves it goes with each of six unknowns: a turn phi moves it by
/// phi x arm.
pub(crate) fn six_columns(arm: DVec3) -> [DVec3; 6] {
    let turns = -skew(arm);
    [DVec3::X, DVec3::Y, DVec3::Z, turns.col(0), turns.col(1), turns.col(2)]
}

/// Stiffness against turning of a force that stays as it is and acts at the end of an arm: the symmetric part of
/// `(f . r) 1 - f r^T`. Its axes are the normal of the plane of both, the bisector and what is across these. Where it
/// is negative it takes off an axis what `most` allows.
pub(crate) fn turning_stiffness(force: DVec3, arm: DVec3, most: impl Fn(DVec3) -> f64) -> DMat3 {
    let size = force.length() * arm.length();
    if !(size > 0.0 && size.is_finite()) {
        return DMat3::ZERO;
    }
    let (f, r) = (force.normalize(), arm.normalize());
    let cos = f.dot(r);
    let bisector = (f + r).try_normalize().unwrap_or_else(|| r.any_orthonormal_vector());
    let normal = f.cross(r).try_normalize().unwrap_or_else(|| bisector.any_orthonormal_vector());
    let axes = [
        (normal, size * cos),
        (bisector, 0.5 * size * (cos - 1.0)),
        (bisector.cross(normal), 0.5 * size * (cos + 1.0)),
    ];
    axes.map(|(axis, k)| outer(axis, axis) * k.max(-most(axis))).into_iter().sum()
}

/// Last steps of three unknowns.
fn steps(border: &Border, first: usize) -> DVec3 {
    DVec3::new(border.step(first), border.step(first + 1), border.step(first + 2))
}

impl Movers {
    /// Lists what may move. A pushed shape without force stays.
    pub fn begin(&mut self, model: &Model, state: &State, h: f64) {
        self.sliders.clear();
        self.bodies.clear();
        self.body_of.clear();
        self.mover_of.clear();
        self.roots = 0;
        self.h = h;
        for (slot, shape) in model.shapes.iter() {
            if let ShapeMotion::Pushed { direction, force, .. } = shape.motion
                && force > 0.0
            {
                self.sliders.push(Slider { shape: slot, direction });
            }
        }
        if model.bodies.len() == 0 {
            return;
        }
        self.body_of.resize(model.shapes.len(), None);
        self.mover_of.resize(model.bodies.len(), None);
        // Those that hold come before those that are held.
        for held in [false, true] {
            for (slot, body) in model.bodies.iter() {
                let root = state.root_of(slot);
                if (root != slot) != held || !state.gives_way(slot) {
                    continue;
                }
                let number = self.bodies.len() as u32;
                let first = if held {
                    self.mover_of[root as usize].map_or(0, |m| self.bodies[m as usize].first)
                } else {
                    self.roots += 1;
                    self.sliders.len() + SIX * (self.roots - 1)
                };
                let center = state.bodies.at(root).map_or(DVec3::ZERO, |b| b.position);
                self.bodies.push(Mover { slot, first, root, center });
                self.mover_of[slot as usize] = Some(number);
                for (shape, _) in &body.shapes {
                    self.body_of[*shape as usize] = Some(number);
                }
            }
        }
    }

    /// Number of unknowns.
    pub fn count(&self) -> usize {
        self.sliders.len() + SIX * self.roots
    }

    /// Those of bodies, six each.
    pub fn of_bodies(&self) -> Range<usize> {
        self.sliders.len()..self.count()
    }

    pub fn has_bodies(&self) -> bool {
        !self.bodies.is_empty()
    }

    /// Puts what acts on them beside contact into the border.
    pub fn assemble(&mut self, model: &Model, state: &State, motion: &Motion, border: &mut Border) {
        let h = self.h;
        for (k, s) in self.sliders.iter().enumerate() {
            let Some(ShapeMotion::Pushed { force, speed_limit, .. }) = model.shapes.at(s.shape).map(|s| s.motion)
            else {
                continue;
            };
            let damper = force / (speed_limit * h);
            let at = s.shape as usize;
            let moved = s.direction.dot(state.shape_pose[at].position - motion.start_shape_pose[at].position);
            border.add_own(k, k, damper);
            border.push(k, force - damper * moved);
        }
        let span = motion.span;
        for Mover { slot, first, root, center } in &mut self.bodies {
            let first = *first;
            let (Some(body), Some(start)) = (state.bodies.at(*slot), &motion.bodies[*slot as usize]) else { continue };
            let mass = &model.bodies.at(*slot).expect("listed").mass;
            *center = state.bodies.at(*root).map_or(body.position, |b| b.position);
            let arm = body.position - *center;
            let w = mass.mass * motion.heavier[0] / (span * span);
            let force = model.settings.gravity * mass.mass + (start.target - body.position) * w;
            let (inertia, momentum) = rotation(mass.moments, start, body.orientation, span);
            let over = motion.heavier[1] / (span * span);
            let mut torque = (start.momentum - momentum) * (motion.heavier[1] / span);
            if root != slot {
                torque += arm.cross(force);
                let across = skew(arm) * w;
                let about = -(skew(arm) * across);
                for i in 0..3 {
                    for j in 0..3 {
                        border.add_own(first + 3 + i, first + j, across.col(j)[i]);
                        border.add_own(first + j, first + 3 + i, across.col(j)[i]);
                        border.add_own(first + 3 + i, first + 3 + j, about.col(j)[i]);
                    }
                }
            }
            for i in 0..3 {
                border.add_own(first + i, first + i, w);
                border.push(first + i, force[i]);
                border.push(first + 3 + i, torque[i]);
                for j in 0..3 {
                    border.add_own(first + 3 + i, first + 3 + j, inertia.col(j)[i] * over);
                }
            }
        }
    }

    /// How the material of a shape that is at `point` moves with its unknowns; none where nothing moves the shape.
    pub fn moves(&self, shape: u32, point: DVec3) -> Option<Moves> {
        if let Some(number) = self.body_of.get(shape as usize).copied().flatten() {
            let Mover { first, center, .. } = self.bodies[number as usize];
            return Some(Moves::new(first, &six_columns(point - center)));
        }
        let k = self.sliders.iter().position(|s| s.shape == shape)?;
        Some(Moves::new(k, &[self.sliders[k].direction]))
    }

    /// Move of the material of a shape at a point in this Newton iteration so far \[m\].
    pub fn moved(&self, shape: u32, point: DVec3, border: &Border) -> DVec3 {
        self.moves(shape, point).map_or(DVec3::ZERO, |m| m.along(border))
    }

    /// Greatest turn of a body in the last step \[rad\], squared.
    pub fn turn_squared(&self, border: &Border) -> f64 {
        let turn = |number: usize| steps(border, self.sliders.len() + SIX * number + 3).length_squared();
        (0..self.roots).map(turn).fold(0.0, crate::math::max_or_nan)
    }

    /// Greatest move of a body in the last step, in hundredths of its size.
    pub fn largest_move(&self, model: &Model, border: &Border) -> f64 {
        let moved =
            |m: &Mover| steps(border, m.first).length() / (0.01 * model.bodies.at(m.slot).expect("listed").size());
        self.bodies[..self.roots].iter().map(moved).fold(0.0, crate::math::max_or_nan)
    }

    /// Takes their part of the step; the largest move of a pushed shape \[m\].
    pub fn apply(&self, model: &Model, state: &mut State, border: &Border, scale: f64) -> f64 {
        let mut far = 0.0f64;
        for (k, s) in self.sliders.iter().enumerate() {
            let step = border.step(k) * scale;
            state.shape_pose[s.shape as usize].position += s.direction * step;
            far = far.max(step.abs());
        }
        for Mover { slot, first, .. } in &self.bodies[..self.roots] {
            let body = state.bodies.at_mut(*slot).expect("listed");
            body.position += steps(border, *first) * scale;
            body.orientation = (exp(steps(border, first + 3) * scale) * body.orientation).normalize();
            place_shapes(model, state, *slot);
        }
        self.bodies[self.roots..].iter().for_each(|m| follow_holder(model, state, m.slot));
        far
    }

    /// First of the six unknowns that move a body, and the center about which they turn it; none where nothing can.
    pub fn unknowns_of(&self, body: u32) -> Option<(usize, DVec3)> {
        let Mover { first, center, .. } = self.bodies[self.mover_of.get(body as usize).copied().flatten()? as usize];
        Some((first, center))
    }

    /// Adds a contact of a shape with the element `e`, at a point of its surface: stiffness, force on the thread and
    /// weights of its particles.
    pub fn add(
        &self,
        (shape, point): (u32, DVec3),
        e: usize,
        stiffness: &DMat3,
        force: DVec3,
        weights: [f64; 2],
        border: &mut Border,
    ) {
        let Some(moves) = self.moves(shape, point) else { return };
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
}
