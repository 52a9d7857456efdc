//! Validation: what the engine computes, against closed forms and independent routines.
//!
//! A [`Study`] is a scene of `scenes/validation/`, run several times with other values (more elements, shorter
//! substeps, another damping), and the quantities measured in it, each with its reference and its bar. [`sections`]
//! lists all of them; [`run`] runs them side by side; [`markdown`] writes the tables. Nothing here knows how the engine
//! works: it sees scenes and their outcomes, and computes its references with routines of its own ([`mod@reference`]).

pub mod reference;
mod results;
mod run;
mod sections;
mod study;

pub use results::{Curve, Plot, Row, SectionResult, StudyResult, csv, markdown};
pub use run::{Progress, run};
pub use sections::sections;
pub use study::{Bar, LeftOut, Level, Quantity, Section, Study, scene_text, scenes};
