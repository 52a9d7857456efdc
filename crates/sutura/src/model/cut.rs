//! What a cut leaves of a thread.

use crate::handle::Handle;
use crate::model::Model;
use crate::model::grip::Load;
use crate::model::rod::Rod;

/// What became of a thread that was cut ([`World::cut`](crate::World::cut)).
#[derive(Debug, Clone, PartialEq)]
pub struct Cut {
    /// The particle at which it was cut, counted as before the cut.
    pub particle: u32,
    /// The part from there to the end, a thread of its own. `None`: the thread was closed, and is open now.
    pub rest: Option<Handle<Rod>>,
    /// Uniform loads that act on both parts now: the one that was there, and that of `rest`.
    pub loads: Vec<(Handle<Load>, Handle<Load>)>,
}

/// The two ends that a cut made. What lies beside them, within `filter_distance` by way of the cut, does not touch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Faces {
    pub ends: [End; 2],
    pub filter_distance: f64,
}

/// An end of a thread, by its slot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct End {
    pub rod: u32,
    pub at_end: bool,
}

impl End {
    /// Its particle, counted from the start of the thread.
    pub fn particle(self, model: &Model) -> u32 {
        if self.at_end { model.rods.at(self.rod).expect("faces go with their threads").n_elements } else { 0 }
    }
    /// Its particle in the world's arrays.
    pub fn index(self, model: &Model) -> usize {
        (model.rods.at(self.rod).expect("faces go with their threads").first + self.particle(model)) as usize
    }
}
