//! Contacts as forces: thread on thread ([`thread`], coupled through the rods' compliance), thread on shape ([`shape`]:
//! firm in the rods' matrix, light in the small problem), and bodies on each other and on shapes ([`body`]). And what
//! rods share, at the [`border`] of their system: pushed shapes, free bodies, welds, and the joints of bodies.

pub(crate) mod active_set;
pub(crate) mod body;
pub(crate) mod border;
pub(crate) mod delassus;
pub(crate) mod dense;
pub(crate) mod follow;
pub(crate) mod joint;
pub(crate) mod ldl;
pub(crate) mod movers;
pub(crate) mod shape;
pub(crate) mod side;
pub(crate) mod sparse;
pub(crate) mod system;
pub(crate) mod thread;
pub(crate) mod weld;

use crate::collide::{Candidates, Pressed};
use crate::model::Model;
use crate::motion::Motion;
use crate::params;
use crate::state::State;

/// The rows of one substep and the memory of their solver.
#[derive(Default)]
pub(crate) struct Rows {
    pub shapes: Vec<shape::ShapeRow>,
    pub threads: Vec<thread::ThreadRow>,
    pub bodies: body::BodyRows,
    pub movers: movers::Movers,
    pub welds: weld::Welds,
    pub joints: joint::Joints,
    pub border: border::Border,
    pub solver: system::ContactSystem,
    pub follow: follow::Follow,
    fresh: Vec<thread::ThreadRow>,
    fresh_shapes: Vec<shape::ShapeRow>,
}

impl Rows {
    pub fn is_empty(&self) -> bool {
        self.shapes.is_empty() && self.threads.is_empty() && self.bodies.rows.is_empty() && self.joints.stops.is_empty()
    }

    /// Whether the small problem was solved well enough for the step to count.
    pub fn solved(&self) -> bool {
        self.solver.left() < params::CONTACT_LEFT
    }
}

impl Pressed for Rows {
    fn threads(&self, a: usize, b: usize) -> f64 {
        let near = |r: &&thread::ThreadRow| {
            let [c, d] = r.elements();
            c.abs_diff(a) <= 1 && d.abs_diff(b) <= 1
        };
        self.threads.iter().filter(near).map(thread::ThreadRow::depth).fold(0.0, f64::max)
    }

    fn shape(&self, shape: u32, element: usize) -> f64 {
        // In the order of their places.
        let from = self.shapes.partition_point(|r| r.on().1 + 1 < element);
        let near = self.shapes[from..].iter().take_while(|r| r.on().1 <= element + 1);
        near.filter(|r| r.on().0 == shape).map(shape::ShapeRow::depth).fold(0.0, f64::max)
    }
}

/// Collects the rows of a solve of this length and gives them the forces of the last one.
pub(crate) fn prepare(
    model: &Model,
    state: &State,
    motion: &Motion,
    candidates: &Candidates,
    rows: &mut Rows,
    length: f64,
) {
    thread::prepare(model, state, motion, candidates, rows);
    shape::prepare(model, state, motion, candidates, rows, length);
    rows.bodies.prepare(model, state, motion, candidates);
    rows.joints.begin(model, state, motion, &rows.movers);
}

/// Adds rows that the iterate calls for. Whether there are any.
pub(crate) fn extend(model: &Model, state: &State, motion: &Motion, candidates: &Candidates, rows: &mut Rows) -> bool {
    let threads = thread::extend(model, state, motion, candidates, rows);
    shape::extend(model, state, motion, candidates, rows) || threads
}

/// Leaves the contacts in the state, for the next substep to start from.
pub(crate) fn store(model: &Model, state: &mut State, motion: &Motion, rows: &mut Rows) {
    let mut contacts = core::mem::take(&mut state.contacts);
    let threads = thread::contacts(state, motion, &rows.threads);
    let Rows { shapes, bodies, .. } = rows;
    contacts.set(threads.chain(shape::contacts(model, state, motion, shapes)).chain(body::contacts(
        model,
        state,
        motion,
        &mut bodies.rows,
    )));
    state.contacts = contacts;
    rows.joints.store(model, state);
}
