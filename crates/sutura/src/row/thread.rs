//! stub
use crate::model::Model;
use crate::scratch::Scratch;
use crate::state::State;
pub(crate) fn begin(_: &Model, _: &mut State, _: &mut Scratch, _h: f64) {}
pub(crate) fn finish(_: &Model, _: &mut State, _: &mut Scratch) {}
pub(crate) fn zones(_: &mut Scratch) {}
pub(crate) fn add_forces(_: &mut Scratch) {}
pub(crate) fn extend(_: &Model, _: &State, _: &mut Scratch) -> bool { false }
pub(crate) fn limit(_: &Model, _: &State, _: &Scratch, s: f64) -> f64 { s }
