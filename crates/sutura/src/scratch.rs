//! Working memory of the step. May be dropped between steps without changing one bit of what follows.

use crate::collide::Candidates;
use crate::math::Pose;
use crate::rod::factor::System;
use crate::rod::torque::TorqueCorrection;
use crate::row::Rows;
use crate::state::State;
use core::ops::Range;
use glam::{DMat3, DQuat, DVec2, DVec3};

/// What may move at a node of the linear system.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Freedom {
    Free,
    Held,
    /// Only along a unit direction, with a force there \[N\] and a damper against it (force per move within the
    /// substep, \[N/m\]). Its move is counted from `from`.
    Line {
        direction: DVec3,
        force: f64,
        damper: f64,
        from: DVec3,
    },
    /// Everywhere, with a force \[N\] and a damper that acts in every direction (force per move within the substep,
    /// \[N/m\]). Its move is counted from `from`.
    Led {
        force: DVec3,
        damper: f64,
        from: DVec3,
    },
}

impl Freedom {
    /// Stiffness and force of what drives the node at `position`, if something does.
    pub fn drive(&self, position: DVec3) -> Option<(DMat3, DVec3)> {
        match *self {
            Freedom::Free | Freedom::Held => None,
            Freedom::Line { direction, force, damper, from } => Some((
                crate::math::outer(direction, direction) * damper,
                direction * (force - damper * direction.dot(position - from)),
            )),
            Freedom::Led { force, damper, from } => {
                Some((DMat3::IDENTITY * damper, force - (position - from) * damper))
            }
        }
    }
    /// Projector on the directions that stay free.
    pub fn projector(&self) -> DMat3 {
        match self {
            Freedom::Free | Freedom::Led { .. } => DMat3::IDENTITY,
            Freedom::Held => DMat3::ZERO,
            Freedom::Line { direction, .. } => crate::math::outer(*direction, *direction),
        }
    }
}

/// A joint between a frame and the fixed cross-section of a clamp.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ClampJoint {
    pub grip: u32,
    pub frame: u32,
    /// The clamp comes before the frame along the rod.
    pub first: bool,
    pub orientation: DQuat,
    pub rest_half: DQuat,
    pub stiffness: DVec3,
    /// Damping time over the span of the solve.
    pub damping: f64,
    /// Angle over which damping takes its rate: in implicit Euler that at the start of the substep.
    pub start: DVec3,
}

#[derive(Default)]
pub(crate) struct Scratch {
    /// States to go back to when a substep is rejected, one per halving depth.
    pub saved: Vec<State>,

    /// Where the velocity alone would carry positions and orientations.
    pub target: Vec<DVec3>,
    pub target_frame: Vec<DQuat>,
    /// Velocity and angular velocity there; not set by implicit Euler.
    pub carried: Vec<DVec3>,
    pub carried_spin: Vec<DVec3>,
    /// Factors on mass and on moments of inertia by which drag within the solve makes things heavier.
    pub heavier: [f64; 2],
    /// Start of the substep.
    pub start: Vec<DVec3>,
    pub start_frame: Vec<DQuat>,
    pub start_shape_pose: Vec<Pose>,
    /// Joint angles at the start, for Kelvin-Voigt.
    pub start_angle: Vec<DVec3>,
    /// Outside force and torque on particles and frames.
    pub force: Vec<DVec3>,
    pub torque: Vec<DVec3>,

    /// Radius of the thread of each element.
    pub radius: Vec<f64>,
    /// One per node: particle, frame, particle, ...
    pub freedom: Vec<Freedom>,
    pub joint_on: Vec<bool>,
    pub clamps: Vec<ClampJoint>,
    pub brakes: Vec<crate::rod::brake::Brake>,

    pub system: System,
    pub torque_correction: TorqueCorrection,
    /// Right side, then solution, one per node.
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

    /// Blocks of each living rod, and the zone of its thread contacts.
    pub rods: Vec<(Range<usize>, Range<usize>)>,

    /// Work of the substep so far, in rough counts of multiplications: counted, not timed. And that of the substeps
    /// before in this step, of the last one accepted, and what the step may take.
    pub work: f64,
    pub spent: f64,
    pub last_work: f64,
    pub allowed: f64,
    /// Whether the step ends here, since that is spent.
    pub cut: bool,
    /// Rods that the last attempt was refused for, and rods that are held where they were, from when, for the rest of
    /// the step.
    pub refused: Option<[u32; 2]>,
    pub held: Vec<(u32, f64)>,
    pub candidates: Candidates,
    pub rows: Rows,
    pub budget: crate::budget::Budget,
    /// Of the paper's solver.
    pub paper: crate::pbd::Work,
}

impl Scratch {
    /// Whether the substep has taken all the work that it may.
    pub fn exhausted(&self) -> bool {
        self.work > crate::params::SUBSTEP_WORK
    }
    /// Whether the step has taken all that it may. Where rods are held for its rest it is done to the end: which ones
    /// is not known in the next.
    pub fn late(&self) -> bool {
        self.held.is_empty() && self.spent + self.work > self.allowed
    }
    /// Axial stiffness of an element \[N/m\], and its axial force at its rest length \[N\].
    #[inline(always)]
    pub fn axial(&self, model: &crate::model::Model, e: usize) -> (f64, f64) {
        match self.stretches[e] {
            None => (model.stretch_stiffness[e].z, 0.0),
            Some(force) => (model.section[e].ea / model.rest_length[e], force),
        }
    }
    /// Makes room for the model's arrays. Inextensible threads keep their length again.
    pub fn fit(&mut self, model: &crate::model::Model) {
        self.heavier = [1.0; 2];
        let n = model.mass.len();
        self.target.resize(n, DVec3::ZERO);
        self.target_frame.resize(n, DQuat::IDENTITY);
        self.carried.resize(n, DVec3::ZERO);
        self.carried_spin.resize(n, DVec3::ZERO);
        self.start.resize(n, DVec3::ZERO);
        self.start_frame.resize(n, DQuat::IDENTITY);
        self.start_angle.resize(n, DVec3::ZERO);
        self.force.resize(n, DVec3::ZERO);
        self.torque.resize(n, DVec3::ZERO);
        self.freedom.resize(2 * n, Freedom::Free);
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
        self.radius.clear();
        self.radius.extend(model.rod_of.iter().map(|r| model.rods.at(*r).map_or(0.0, |r| r.radius)));
        self.rods.clear();
        for (_, rod) in model.rods.iter() {
            let blocks = rod.particles();
            let last = blocks.end - 1..blocks.end;
            self.rods.push((blocks, last));
        }
    }
}
