//! Closest points and times of impact.
use crate::model::Model;
use crate::scratch::Scratch;
use crate::state::State;
pub(crate) struct Collider;
impl Collider { pub fn new(_: &crate::Geometry) -> Result<Self, crate::Error> { Ok(Collider) } }
#[derive(Default)]
pub(crate) struct Candidates;
pub(crate) struct Clearance { pub thread: Option<f64>, pub shape: Option<f64> }
pub(crate) fn detect(_: &Model, _: &State, _: &mut Scratch) {}
pub(crate) fn sweep(_: &Model, _: &State, _: &mut Scratch) -> Result<Clearance, &'static str> { Ok(Clearance { thread: None, shape: None }) }
