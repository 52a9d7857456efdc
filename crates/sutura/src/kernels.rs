//! The parts of a Newton iteration one by one, for the benchmark. Not an interface.

use crate::model::Model;
use crate::newton;
use crate::rod::assemble::{Hessian, assemble};
use crate::scratch::Scratch;
use crate::state::State;

/// The rods of a world at rest in their present state.
pub struct Kernels {
    model: Model,
    state: State,
    scratch: Scratch,
}

/// Substep of the default settings \[s\].
const H: f64 = 1.0 / 240.0;

impl Kernels {
    /// Takes the world apart.
    pub fn new(world: crate::World) -> Self {
        let (model, state) = world.into_parts();
        let mut scratch = Scratch::default();
        scratch.fit(&model);
        scratch.target.copy_from_slice(&state.position);
        scratch.target_frame.copy_from_slice(&state.orientation);
        crate::row::couple::zones(&mut scratch);
        Kernels { model, state, scratch }
    }
    /// Residual and Hessian.
    pub fn assemble(&mut self) {
        assemble(&self.model, &self.state, &mut self.scratch, H, Hessian::Exact);
    }
    /// Those and the factor. False when it is not positive.
    pub fn factor(&mut self) -> bool {
        newton::factor(&self.model, &self.state, &mut self.scratch, H, Hessian::Positive, false)
    }
    /// One right side.
    pub fn solve(&mut self) -> f64 {
        let Scratch { system, rods, rhs, step, .. } = &mut self.scratch;
        step.copy_from_slice(rhs);
        for (rod, zone) in rods.iter() {
            system.solve(rod.clone(), zone, step);
        }
        step[0].x
    }
}
