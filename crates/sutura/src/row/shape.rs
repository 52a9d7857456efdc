//! stub
use crate::model::Model;
use crate::scratch::Scratch;
use crate::state::State;
pub(crate) fn begin(_: &Model, _: &mut State, _: &mut Scratch, _h: f64) {}
pub(crate) fn assemble(_: &Model, _: &State, _: &mut Scratch, _h: f64) {}
pub(crate) fn finish(_: &Model, _: &mut State, _: &mut Scratch) {}
