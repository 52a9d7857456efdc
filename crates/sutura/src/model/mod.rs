//! What does not change while the world steps: topology, rest shape, mass, compliance, geometry.

pub mod grip;
pub mod material;
pub mod rod;
pub mod shape;

use crate::handle::Slots;
use crate::math::Pose;
use crate::params::{Friction, Settings};
use glam::{DQuat, DVec3};
use rod::RodModel;
use shape::{Geometry, ShapeMotion};

/// All rods lie one after the other in these arrays: particle arrays have `n + 1` entries a rod, frame arrays `n`.
#[derive(Default)]
pub struct Model {
    pub(crate) settings: Settings,
    pub(crate) rods: Slots<RodModel>,
    pub(crate) shapes: Slots<ShapeModel>,
    /// Friction of pairs of surfaces, smaller index first, sorted.
    pub(crate) friction: Vec<((u32, u32), Friction)>,

    /// Mass of each particle, attached masses included \[kg\].
    pub(crate) mass: Vec<f64>,
    /// Slot of the rod of each particle.
    pub(crate) particle_rod: Vec<u32>,

    /// Rest length of each element \[m\].
    pub(crate) rest_length: Vec<f64>,
    /// Moments of inertia of each frame along its directors, attached ones included \[kg m^2\].
    pub(crate) inertia: Vec<DVec3>,
    /// Slot of the rod of each element.
    pub(crate) element_rod: Vec<u32>,
    /// Rest length between the middles of elements `f - 1` and `f` \[m\]; zero at the first element of a rod (no joint).
    pub(crate) joint_length: Vec<f64>,
    /// Square root of the rest rotation of the joint between `f - 1` and `f`.
    pub(crate) rest_half: Vec<DQuat>,
}

/// A shape, checked and ready for queries.
pub(crate) struct ShapeModel {
    pub geometry: Geometry,
    pub collider: crate::collide::Collider,
    pub surface: u32,
    pub motion: ShapeMotion,
    /// Pose at insertion.
    pub pose: Pose,
}

impl Model {
    /// Friction between two surfaces.
    pub(crate) fn friction_between(&self, a: u32, b: u32) -> Friction {
        let key = (a.min(b), a.max(b));
        match self.friction.binary_search_by_key(&key, |(k, _)| *k) {
            Ok(i) => self.friction[i].1,
            Err(_) => self.settings.friction,
        }
    }
    /// First particle of element `f`: rods before it have one particle more than elements.
    pub(crate) fn particle_of(&self, f: usize) -> usize {
        let rod = self.rods.at(self.element_rod[f]).expect("element of a living rod");
        f - rod.first_frame as usize + rod.first_particle as usize
    }
}
