//! What a solve starts from: where things were, where their velocities carry them, and what acts on them from outside.

use crate::math::Pose;
use crate::model::Model;
use glam::{DQuat, DVec3};

/// One entry per particle or element, as in [`State`](crate::state::State).
#[derive(Default)]
pub(crate) struct Motion {
    /// Positions, orientations and poses at the start of the solve.
    pub start: Vec<DVec3>,
    pub start_frame: Vec<DQuat>,
    pub start_shape_pose: Vec<Pose>,
    /// Joint angles there, for Kelvin-Voigt.
    pub start_angle: Vec<DVec3>,

    /// Where the velocity alone would carry positions and orientations.
    pub target: Vec<DVec3>,
    pub target_frame: Vec<DQuat>,
    /// Velocity and angular velocity there; not set by implicit Euler.
    pub carried: Vec<DVec3>,
    pub carried_spin: Vec<DVec3>,
    /// Factors on mass and on moments of inertia by which drag within the solve makes things heavier.
    pub heavier: [f64; 2],

    /// Of bodies, by their slots.
    pub bodies: Vec<Option<BodyStart>>,
    /// Time by which accelerations act on velocities in the solve \[s\].
    pub span: f64,

    /// Outside force and torque on particles and frames.
    pub force: Vec<DVec3>,
    pub torque: Vec<DVec3>,
}

/// What the solve of a body starts from.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BodyStart {
    /// Where velocity alone would carry its center of mass, and the velocity there.
    pub target: DVec3,
    pub carried: DVec3,
    /// The velocity that it ends with where nothing acts on it.
    pub kept: DVec3,
    /// Orientation and angular momentum that the solve sets out with.
    pub base: DQuat,
    /// Part of the turn from there at which the inertia is taken: what the mean velocity of a solve asks for, or the
    /// one at its end.
    pub part: f64,
    pub momentum: DVec3,
}

impl Motion {
    /// Makes room for the model's arrays.
    pub fn fit(&mut self, model: &Model) {
        let n = model.mass.len();
        self.heavier = [1.0; 2];
        self.start.resize(n, DVec3::ZERO);
        self.start_frame.resize(n, DQuat::IDENTITY);
        self.start_angle.resize(n, DVec3::ZERO);
        self.target.resize(n, DVec3::ZERO);
        self.target_frame.resize(n, DQuat::IDENTITY);
        self.carried.resize(n, DVec3::ZERO);
        self.carried_spin.resize(n, DVec3::ZERO);
        self.force.resize(n, DVec3::ZERO);
        self.torque.resize(n, DVec3::ZERO);
    }
}
