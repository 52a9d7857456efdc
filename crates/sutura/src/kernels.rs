//! The parts of a Newton iteration one by one, for the benchmark. Not an interface.

use crate::model::Model;
use crate::newton;
use crate::newton::Solver;
use crate::rod::assemble::{Hessian, assemble};
use crate::rod::scratch::RodScratch;
use crate::state::State;

/// The rods of a world at rest in their present state.
pub struct Kernels {
    model: Model,
    state: State,
    solver: Solver,
}

/// Substep of the default settings \[s\].
const H: f64 = 1.0 / 240.0;

impl Kernels {
    /// Takes the world apart.
    pub fn new(world: crate::World) -> Self {
        let (model, state) = world.into_parts();
        let mut solver = Solver::default();
        solver.motion.fit(&model);
        solver.rods.fit(&model);
        solver.motion.target.copy_from_slice(&state.position);
        solver.motion.target_frame.copy_from_slice(&state.orientation);
        crate::row::system::zones(&mut solver.rods.ranges, &solver.rows);
        Kernels { model, state, solver }
    }
    /// Residual and Hessian.
    pub fn assemble(&mut self) {
        let Solver { motion, rods, .. } = &mut self.solver;
        assemble(&self.model, &self.state, motion, rods, H, Hessian::Exact);
    }
    /// Those and the factor. False when it is not positive.
    pub fn factor(&mut self) -> bool {
        let Solver { motion, rods, rows, .. } = &mut self.solver;
        newton::factor(&self.model, &self.state, motion, rods, rows, (H, Hessian::Positive, false))
    }
    /// One right side.
    pub fn solve(&mut self) -> f64 {
        let RodScratch { system, ranges, rhs, step, .. } = &mut self.solver.rods;
        step.copy_from_slice(rhs);
        for (rod, zone) in ranges.iter() {
            system.solve(rod.clone(), zone, step);
        }
        step[0].x
    }
}
