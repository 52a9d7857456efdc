//! Contacts as forces: thread on thread ([`thread`], coupled through the rods' compliance) and thread on shape ([`shape`], local).

pub(crate) mod cone;
pub(crate) mod pushed;
pub(crate) mod shape;
pub(crate) mod thread;

/// The rows of one substep and the memory of their solver.
#[derive(Default)]
pub(crate) struct Rows {
    pub shapes: Vec<shape::ShapeRow>,
    pub threads: Vec<thread::ThreadRow>,
    pub sliders: pushed::Sliders,
    pub solver: thread::Coupling,
}

impl Rows {
    pub fn is_empty(&self) -> bool {
        self.shapes.is_empty() && self.threads.is_empty()
    }
}
