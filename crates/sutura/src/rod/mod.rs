//! The Cosserat rod.
use crate::model::{Model, rod::RodModel};
use crate::state::State;
use crate::view::Energy;
use glam::DVec3;

pub(crate) fn internal_force(_m: &Model, _s: &State, _r: &RodModel, _f: usize) -> DVec3 {
    unimplemented!()
}
pub(crate) fn joint_angle(_m: &Model, _s: &State, _f: usize) -> DVec3 {
    unimplemented!()
}
pub(crate) fn energy(_m: &Model, _s: &State, _r: &RodModel) -> Energy {
    unimplemented!()
}
