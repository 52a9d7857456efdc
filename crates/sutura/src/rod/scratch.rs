//! Working memory of the rods: their linear system, and the forces in them at the iterate.

use crate::model::Model;
use crate::rod::brake::Brake;
use crate::rod::constraint::{ClampJoint, NodeConstraint};
use crate::rod::factor::System;
use crate::rod::torque::TorqueCorrection;
use core::ops::Range;
use glam::{DVec2, DVec3};

/// Nodes are a particle, a frame, a particle and so on: `2 i` and `2 i + 1` of particle and element `i`.
#[derive(Default)]
pub(crate) struct RodScratch {
    /// Blocks of each living rod, and the zone of its contacts.
    pub ranges: Vec<(Range<usize>, Range<usize>)>,
    /// One per node.
    pub constraint: Vec<NodeConstraint>,
    pub joint_on: Vec<bool>,
    pub clamps: Vec<ClampJoint>,
    pub brakes: Vec<Brake>,

    pub system: System,
    pub torque_correction: TorqueCorrection,
    /// Right side, and solution, one per node.
    pub rhs: Vec<DVec3>,
    pub step: Vec<DVec3>,

    /// Predicted tension after the current iteration, for geometric stiffness.
    pub tension: Vec<f64>,
    /// What the last step, in full, changes it by in inextensible threads.
    pub tension_change: Vec<f64>,
    /// Axial force at its rest length \[N\] of each element that stretches as its material does although its thread is
    /// inextensible, for the rest of a step.
    pub stretches: Vec<Option<f64>>,
    /// Predicted shear force along the first two directors, likewise.
    pub shear: Vec<DVec2>,
    /// Moment of the joint before each element on the element before it, in world axes.
    pub moment: Vec<DVec3>,
}

impl RodScratch {
    /// Makes room for the model's arrays. Inextensible threads keep their length again.
    pub fn fit(&mut self, model: &Model) {
        let n = model.mass.len();
        self.constraint.resize(2 * n, NodeConstraint::Free);
        self.joint_on.resize(n, true);
        self.system.resize(n);
        self.rhs.resize(2 * n, DVec3::ZERO);
        self.step.resize(2 * n, DVec3::ZERO);
        self.tension.resize(n, 0.0);
        self.tension_change.resize(n, 0.0);
        self.stretches.clear();
        self.stretches.resize(n, None);
        self.shear.resize(n, DVec2::ZERO);
        self.moment.resize(n, DVec3::ZERO);
        self.ranges.clear();
        for (_, rod) in model.rods.iter() {
            let blocks = rod.particles();
            let last = blocks.end - 1..blocks.end;
            self.ranges.push((blocks, last));
        }
    }

    /// Elements of all rods.
    pub fn elements(&self) -> impl Iterator<Item = usize> + use<'_> {
        self.ranges.iter().flat_map(|(rod, _)| rod.start..rod.end - 1)
    }

    /// Axial stiffness of an element \[N/m\], and its axial force at its rest length \[N\].
    #[inline(always)]
    pub fn axial(&self, model: &Model, e: usize) -> (f64, f64) {
        match self.stretches[e] {
            None => (model.stretch_stiffness[e].z, 0.0),
            Some(force) => (model.section[e].ea / model.rest_length[e], force),
        }
    }
}
