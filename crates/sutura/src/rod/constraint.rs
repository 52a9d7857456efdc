//! What holds and drives the nodes of rods from outside.

use crate::math::outer;
use glam::{DMat3, DQuat, DVec3};

/// What may move at a node of the linear system.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum NodeConstraint {
    Free,
    Held,
    /// Only along a unit direction, with a force there \[N\] and a damper against it (force per move within the
    /// substep, \[N/m\]). Its move is counted from `from`.
    Guided {
        direction: DVec3,
        force: f64,
        damper: f64,
        from: DVec3,
    },
    /// Everywhere, with a force \[N\] and a damper that acts in every direction (force per move within the substep,
    /// \[N/m\]). Its move is counted from `from`.
    Damped {
        force: DVec3,
        damper: f64,
        from: DVec3,
    },
}

impl NodeConstraint {
    /// Stiffness and force of what drives the node at `position`, if something does.
    pub fn drive(&self, position: DVec3) -> Option<(DMat3, DVec3)> {
        match *self {
            NodeConstraint::Free | NodeConstraint::Held => None,
            NodeConstraint::Guided { direction, force, damper, from } => Some((
                outer(direction, direction) * damper,
                direction * (force - damper * direction.dot(position - from)),
            )),
            NodeConstraint::Damped { force, damper, from } => {
                Some((DMat3::IDENTITY * damper, force - (position - from) * damper))
            }
        }
    }
    /// Projector on the directions that stay free.
    pub fn projector(&self) -> DMat3 {
        match self {
            NodeConstraint::Free | NodeConstraint::Damped { .. } => DMat3::IDENTITY,
            NodeConstraint::Held => DMat3::ZERO,
            NodeConstraint::Guided { direction, .. } => outer(*direction, *direction),
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
