//! Inextensible threads: those that cannot keep their length stretch as their material does to the end of the step.

use crate::model::Model;
use crate::model::rod::{RodModel, Stretch};
use crate::rod::element_strain;
use crate::rod::scratch::RodScratch;
use crate::state::State;

/// Elongation to which an element of an inextensible thread agrees with its tension where a solve ends.
pub(crate) const LENGTH_TOLERANCE: f64 = 5e-6;

/// Tension over E A that no inextensible thread keeps its length under: no thread bears as much.
pub(crate) const UNBEARABLE: f64 = 0.5;

/// Tension over E A from which an inextensible thread may be why a substep is not acceptable.
pub(crate) const TAUT: f64 = 1e-3;

/// Most that a thread keeps of its tension, over E A, where it begins to stretch.
const KEPT_TENSION: f64 = 0.05;

/// Tension over E A of the element of a rod that was last found to be pulled or pressed most.
fn most_pulled(model: &Model, rods: &RodScratch, rod: &RodModel) -> f64 {
    rod.elements()
        .map(|e| rods.tension[e] / model.section[e].ea)
        .fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a })
}

/// Inextensible threads that keep their length.
fn keeping<'a>(model: &'a Model, rods: &'a RodScratch) -> impl Iterator<Item = &'a RodModel> {
    model
        .rods
        .iter()
        .map(|(_, rod)| rod)
        .filter(|r| r.stretch == Stretch::Inextensible && rods.stretches[r.first as usize].is_none())
}

/// Greatest tension over E A of inextensible threads that keep their length.
pub(crate) fn tautest(model: &Model, rods: &RodScratch) -> f64 {
    keeping(model, rods).map(|rod| most_pulled(model, rods, rod).abs()).fold(0.0, f64::max)
}

/// Inextensible threads that the last attempt found as `taut`, over E A, or more stretch as their material does from
/// here to the end of the step. Whether there are any.
pub(crate) fn let_stretch(model: &Model, state: &State, rods: &mut RodScratch, taut: f64) -> bool {
    let found: Vec<_> = keeping(model, rods)
        .map(|rod| (rod.elements(), most_pulled(model, rods, rod)))
        .filter(|(_, pulled)| pulled.abs() >= taut)
        .collect();
    for (elements, pulled) in &found {
        for e in elements.clone() {
            let ea = model.section[e].ea;
            let before = state.tension[e] - ea * element_strain(model, state, e).z / model.rest_length[e];
            // What is pressed along itself has no tension to begin with, and the other way round.
            let (least, most) = if *pulled > 0.0 { (0.0, KEPT_TENSION * ea) } else { (-KEPT_TENSION * ea, 0.0) };
            rods.stretches[e] = Some(before.clamp(least, most));
        }
    }
    !found.is_empty()
}

/// Inextensible threads that are off their length, and the largest elongation of an element of each.
pub(crate) fn off_length<'a>(model: &'a Model, state: &'a State) -> impl Iterator<Item = (u32, f64)> + use<'a> {
    let rods = model.rods.iter().filter(|(_, r)| r.stretch == Stretch::Inextensible);
    rods.filter_map(|(slot, rod)| {
        let elongation = |e: usize| (state.position[e + 1] - state.position[e]).length() / model.rest_length[e] - 1.0;
        let most = rod.elements().map(elongation).fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a });
        (most.abs() > 2.0 * LENGTH_TOLERANCE).then_some((slot, most))
    })
}
