//! Contacts as forces: thread on thread ([`thread`], coupled through the rods' compliance) and thread on shape ([`shape`]: firm in the rods' matrix, light in the
//! small problem). And what rods share, at the [`border`] of their system: pushed shapes and welds.

pub(crate) mod border;
pub(crate) mod cone;
pub(crate) mod couple;
pub(crate) mod ldl;
pub(crate) mod pushed;
pub(crate) mod shape;
pub(crate) mod thread;
pub(crate) mod weld;

use crate::math::Pose;
use glam::{DQuat, DVec3};

/// Where things were at the start of the substep.
pub(crate) struct Start<'a> {
    pub position: &'a [DVec3],
    pub frame: &'a [DQuat],
    pub shape: &'a [Pose],
}

/// The rows of one substep and the memory of their solver.
#[derive(Default)]
pub(crate) struct Rows {
    pub shapes: Vec<shape::ShapeRow>,
    pub threads: Vec<thread::ThreadRow>,
    pub sliders: pushed::Sliders,
    pub welds: weld::Welds,
    pub border: border::Border,
    pub solver: couple::Coupling,
    fresh: Vec<thread::ThreadRow>,
}

impl Rows {
    pub fn is_empty(&self) -> bool {
        self.shapes.is_empty() && self.threads.is_empty()
    }
}
