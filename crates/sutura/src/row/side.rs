//! One side of a contact constraint: which unknowns move it, and how.

use crate::rod::constraint::NodeConstraint;
use crate::row::border::Border;
use core::ops::Range;
use glam::{DMat3, DVec3};

/// A side at the iterate.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Side {
    /// Fixed, or driven by its pose.
    Still,
    /// A place on a thread.
    Chain(Endpoint),
    /// A place on what is moved by unknowns of the border, along the three axes of the contact.
    Shared(Moves),
}

/// A thread's side of a contact: its Jacobian as right-side columns (normal, two tangents) on blocks `element` and
/// `element + 1`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Endpoint {
    pub element: usize,
    /// Columns on the positions of its two particles.
    pub here: DMat3,
    pub next: DMat3,
}

/// Most unknowns that move one point.
const MOST: usize = 6;

/// How a point moves with unknowns of the border: a vector per unit of each.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Moves {
    first: u32,
    count: u8,
    columns: [DVec3; MOST],
}

impl Endpoint {
    /// The place `s` of the centerline of `element`, pushed along `axes`.
    pub fn new(element: usize, s: f64, axes: [DVec3; 3]) -> Self {
        let axes = DMat3::from_cols(axes[0], axes[1], axes[2]);
        Endpoint { element, here: axes * (1.0 - s), next: axes * s }
    }

    /// What of it can give way: where a grip holds, the rods' matrix has a stiffness that stands for nothing.
    pub fn restricted(&self, constraint: &[NodeConstraint]) -> Self {
        let keep = |node: usize, columns: DMat3| {
            if constraint[node] == NodeConstraint::Free { columns } else { constraint[node].projector() * columns }
        };
        let x = 2 * self.element;
        Endpoint { here: keep(x, self.here), next: keep(x + 2, self.next), ..*self }
    }

    pub fn within(&self, zone: &Range<usize>) -> bool {
        zone.contains(&self.element) && self.element + 1 < zone.end
    }

    pub fn push(&self, force: DVec3, right: &mut [DVec3]) {
        right[2 * self.element] += self.here * force;
        right[2 * self.element + 2] += self.next * force;
    }

    pub fn work(&self, force: DVec3, step: &[DVec3]) -> f64 {
        let k = 2 * self.element;
        (self.here * force).dot(step[k]) + (self.next * force).dot(step[k + 2])
    }
}

impl Moves {
    /// By the unknowns from `first` on.
    pub fn new(first: usize, columns: &[DVec3]) -> Self {
        let mut all = [DVec3::ZERO; MOST];
        all[..columns.len()].copy_from_slice(columns);
        Moves { first: first as u32, count: columns.len() as u8, columns: all }
    }

    /// Each unknown, and what a unit of it moves the point by.
    pub fn columns(&self) -> impl Iterator<Item = (usize, DVec3)> + use<> {
        let (first, columns) = (self.first as usize, self.columns);
        (0..usize::from(self.count)).map(move |k| (first + k, columns[k]))
    }

    /// Along axes.
    pub fn toward(&self, axes: [DVec3; 3]) -> Self {
        let along = |v: DVec3| DVec3::from_array(axes.map(|a| v.dot(a)));
        Moves { columns: self.columns.map(along), ..*self }
    }

    /// The other way round, along axes.
    pub fn against(&self, axes: [DVec3; 3]) -> Self {
        let along = |v: DVec3| DVec3::from_array(axes.map(|a| (-v).dot(a)));
        Moves { columns: self.columns.map(along), ..*self }
    }

    /// Move of the point by the last steps of its unknowns.
    pub fn along(&self, border: &Border) -> DVec3 {
        self.columns().map(|(k, c)| c * border.step(k)).sum()
    }

    /// Adds a force on the point to those of the contacts on the border.
    pub fn load(&self, force: DVec3, border: &mut Border) {
        self.columns().for_each(|(k, c)| border.load(k, c.dot(force)));
    }
}

impl Side {
    /// The place on a thread, where it is one.
    pub fn chain(&self) -> Option<&Endpoint> {
        if let Side::Chain(endpoint) = self { Some(endpoint) } else { None }
    }

    /// Move along an axis of the contact by a step of the rods and the last steps of the border.
    pub fn moved(&self, axis: usize, step: &[DVec3], border: &Border) -> f64 {
        match self {
            Side::Still => 0.0,
            Side::Chain(endpoint) => endpoint.work(DVec3::AXES[axis], step),
            Side::Shared(moves) => moves.columns().map(|(k, c)| c[axis] * border.step(k)).sum(),
        }
    }

    /// Adds a force along the axes to right sides.
    pub fn push(&self, force: DVec3, right: &mut [DVec3], border: &mut Border) {
        match self {
            Side::Still => {}
            Side::Chain(endpoint) => endpoint.push(force, right),
            Side::Shared(moves) => moves.load(force, border),
        }
    }

    /// Work of a force along the axes over a step.
    pub fn work(&self, force: DVec3, step: &[DVec3], border: &Border) -> f64 {
        match self {
            Side::Still => 0.0,
            Side::Chain(endpoint) => endpoint.work(force, step),
            Side::Shared(moves) => moves.along(border).dot(force),
        }
    }
}
