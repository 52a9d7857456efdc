//! Working memory of a world. May be dropped between steps without changing one bit of what follows.

use crate::budget::Budget;
use crate::model::Model;
use crate::newton::Solver;
use crate::pbd;
use crate::state::Saved;

#[derive(Default)]
pub(crate) struct Scratch {
    /// States to go back to when a substep is rejected, one per halving depth.
    pub saved: Saved,
    pub solver: Solver,
    pub budget: Budget,
    /// Rods that are held where they were, from when, for the rest of the step.
    pub held: Vec<(u32, f64)>,
    /// Of the paper's solver.
    pub paper: pbd::Work,
}

impl Scratch {
    /// Makes room for the model's arrays. Inextensible threads keep their length again.
    pub fn fit(&mut self, model: &Model) {
        self.solver.motion.fit(model);
        self.solver.rods.fit(model);
        self.solver.candidates.fit(model);
    }
}
