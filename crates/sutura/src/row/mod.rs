//! Contacts as forces: thread on thread ([`thread`], coupled through the rods' compliance) and thread on shape
//! ([`shape`]: firm in the rods' matrix, light in the small problem). And what rods share, at the [`border`] of their
//! system: pushed shapes and welds.

pub(crate) mod border;
pub(crate) mod cone;
pub(crate) mod couple;
pub(crate) mod delassus;
pub(crate) mod dense;
pub(crate) mod follow;
pub(crate) mod ldl;
pub(crate) mod pushed;
pub(crate) mod shape;
pub(crate) mod sparse;
pub(crate) mod thread;
pub(crate) mod weld;

use crate::math::Pose;
use crate::scratch::Scratch;
use glam::DVec3;

/// Where things were at the start of the substep.
pub(crate) struct Start<'a> {
    pub position: &'a [DVec3],
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
    pub follow: follow::Follow,
    fresh: Vec<thread::ThreadRow>,
    fresh_shapes: Vec<shape::ShapeRow>,
}

impl Rows {
    pub fn is_empty(&self) -> bool {
        self.shapes.is_empty() && self.threads.is_empty()
    }
}

/// How deep the contact forces at two elements or their neighbors press them into each other \[m\].
pub(crate) fn pressed_threads(scratch: &Scratch, a: usize, b: usize) -> f64 {
    let near = |r: &&thread::ThreadRow| {
        let [c, d] = r.elements();
        c.abs_diff(a) <= 1 && d.abs_diff(b) <= 1
    };
    scratch.rows.threads.iter().filter(near).map(thread::ThreadRow::depth).fold(0.0, f64::max)
}

/// How deep the contact forces at an element or its neighbors press it into a shape \[m\].
pub(crate) fn pressed_shape(scratch: &Scratch, shape: u32, element: usize) -> f64 {
    // In the order of their places.
    let rows = &scratch.rows.shapes;
    let from = rows.partition_point(|r| r.on().1 + 1 < element);
    let near = rows[from..].iter().take_while(|r| r.on().1 <= element + 1);
    near.filter(|r| r.on().0 == shape).map(shape::ShapeRow::depth).fold(0.0, f64::max)
}
