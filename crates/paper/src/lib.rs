//! The experiments of "Real-time inextensible surgical thread simulation" (International Journal of Computer Assisted Radiology and Surgery
//! 13:1019, 2018), figures 8 to 18: run on the paper's own solver, on the methods that it compares with, and on Sutura's own solver.
//!
//! [`experiments`] lists them, [`run`] runs them side by side, [`page`] writes what was found as one page. Everything found is data; drawing and
//! files are the caller's. What is found depends on nothing but the code; times do, and are kept apart ([`Table::measured`]).

mod fig08;
mod fig16;
mod fig17;
mod fig18;
mod led;
mod limits;
mod measure;
mod method;
mod outcome;
mod page;
mod plan;

pub use outcome::{Axis, Cell, Check, Compare, Curve, Grid, Outcome, Panel, Picture, Plot, Solid, Table, Tube};
pub use page::{page, table};
pub use plan::{Experiment, Progress, Result, run};

/// All experiments, in the order of the figures.
pub fn experiments() -> Vec<Experiment> {
    vec![fig08::EXPERIMENT, fig16::EXPERIMENT, fig17::EXPERIMENT, fig18::EXPERIMENT, limits::EXPERIMENT]
}
