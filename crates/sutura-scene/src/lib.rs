//! Scenes of the thread simulator as files: read, run, probed, checked and recorded.
//!
//! A scene is a TOML text (`docs/formats.md` has every key). [`Scene::load`] reads one, [`Runner`] steps it frame by
//! frame, and [`Runner::finish`] hands over an [`Outcome`]: the report, the time series and the trajectory. Units are
//! converted here, once; everything past the loader is in SI units.

mod curve;
mod distance;
mod doc;
mod error;
pub mod export;
mod expr;
mod judge;
mod load;
mod motion;
mod parted;
pub mod presets;
mod report;
mod runner;
mod samples;
mod saved;
mod scene;
mod set;
mod stage;
mod table;
mod trajectory;
mod units;
mod watch;
mod whole;

pub use error::{Problem, SceneError};
pub use report::{
    CheckReport, CheckValue, Clearance, FormReport, FrameTimes, IncidentReport, KnotReport, Outcome, OverlapReport,
    PhaseReport, ProbeReport, Report, SavedState, Series, SolverReport, ThreadReport, WarningReport, WorkReport,
};
pub use runner::{Progress, Runner};
pub use samples::{Sample, samples};
pub use scene::{Camera, Mover, Scene};
pub use table::{TableError, points_from_table};
pub use trajectory::{
    Contact, Forces, Frame, Header, OnThread, SectionOutline, Shape, ShapeOutline, Thread, ThreadLook, Touched,
    Trajectory, TrajectoryError,
};
pub use units::in_si;
pub use whole::{PARTIAL, write_whole};
