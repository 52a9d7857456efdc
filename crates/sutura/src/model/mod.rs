//! What does not change while the world steps: topology, rest shape, mass, compliance, geometry.

pub mod body;
pub(crate) mod collider;
pub mod cut;
pub mod grip;
pub mod instrument;
pub mod joint;
pub mod material;
pub mod mesh;
pub mod needle;
pub mod reel;
pub mod rod;
pub mod section;
pub mod shape;
pub mod weld;

use crate::arrays::element_arrays;
use crate::handle::Slots;
use crate::params::{Friction, Settings};
use body::BodyModel;
use cut::Faces;
use glam::{DQuat, DVec3};
use grip::{LoadKind, LoadState};
use joint::JointModel;
use material::{Material, SectionStiffness};
use rod::{RodModel, Stretch};
use section::Factors;
use shape::{Geometry, ShapeMotion};
use weld::WeldModel;

/// Axial stiffness of an inextensible element over that of its material: under half of E A, more than any thread bears,
/// it is longer by 5e-6. Stiffer, tension would lose digits to the rounding of positions.
const INEXTENSIBLE: f64 = 1e5;

/// All rods lie one after the other in these arrays, `n + 1` entries a rod for particles and for elements too: the last
/// element entry of a rod is unused, so that element `e` joins particles `e` and `e + 1` and has frame `e`.
#[derive(Default)]
pub struct Model {
    pub(crate) settings: Settings,
    /// Most work that a step may take, where it is limited.
    pub(crate) step_work: Option<f64>,
    pub(crate) rods: Slots<RodModel>,
    pub(crate) shapes: Slots<ShapeModel>,
    pub(crate) bodies: Slots<BodyModel>,
    pub(crate) joints: Slots<JointModel>,
    pub(crate) welds: Slots<WeldModel>,
    /// Of each cut the two ends that it made, while both threads are there.
    pub(crate) faces: Vec<Faces>,
    /// What was put into the world since the last step, which the next one looks at.
    pub(crate) placed: Placed,
    /// Friction of pairs of surfaces, smaller index first, sorted.
    pub(crate) friction: Vec<((u32, u32), Friction)>,

    /// Mass of each particle, attached masses included \[kg\].
    pub(crate) mass: Vec<f64>,
    /// Slot of the rod of each particle and element.
    pub(crate) rod_of: Vec<u32>,
    /// Slot of the weld that each particle belongs to.
    pub(crate) weld_of: Vec<Option<u32>>,

    /// Rest length of each element \[m\].
    pub(crate) rest_length: Vec<f64>,
    /// Size, modulus and density of each element over those of its rod.
    pub(crate) factors: Vec<Factors>,
    /// Stiffness and mass per length of each element.
    pub(crate) section: Vec<SectionStiffness>,
    /// Moments of inertia of each frame along its directors, attached ones included \[kg m^2\].
    pub(crate) inertia: Vec<DVec3>,
    /// Rest length between the middles of elements `e - 1` and `e` \[m\]; zero at the first element of a rod (no
    /// joint).
    pub(crate) joint_length: Vec<f64>,
    /// Square root of the rest rotation of the joint between `e - 1` and `e`.
    pub(crate) rest_half: Vec<DQuat>,
    /// Stiffness of each element along d1, d2 (shear) and d3 (stretch; of inextensible rods along the line between its
    /// ends) \[N/m\].
    pub(crate) stretch_stiffness: Vec<DVec3>,
    /// Whether each element is one of an inextensible thread.
    pub(crate) inextensible: Vec<bool>,
    /// Stiffness of each joint in bending about d1, d2 and twist about d3 \[N m/rad\].
    pub(crate) bend_stiffness: Vec<DVec3>,
    /// Relaxation time of Kelvin-Voigt damping of each joint \[s\].
    pub(crate) bend_damping: Vec<f64>,
}

element_arrays!(Model {
    mass,
    rod_of,
    rest_length,
    factors,
    section,
    inertia,
    joint_length,
    rest_half,
    stretch_stiffness,
    inextensible,
    bend_stiffness,
    bend_damping,
});

/// Slots of threads and shapes that were put somewhere, not moved there.
#[derive(Debug, Default)]
pub(crate) struct Placed {
    pub rods: Vec<u32>,
    pub shapes: Vec<u32>,
}

/// A shape, checked and ready for queries.
pub(crate) struct ShapeModel {
    pub geometry: Geometry,
    /// Hash of the geometry, for snapshots.
    pub hash: u64,
    pub collider: collider::Collider,
    pub surface: u32,
    pub motion: ShapeMotion,
    /// Slot of the body that it is part of.
    pub body: Option<u32>,
    /// Whether a mesh is closed, so that it has an inside; of the other shapes true.
    pub closed: bool,
    /// Whether part of a mesh is a container, around which everything is solid.
    pub container: bool,
    /// What was mended of a mesh, and what a user may not have meant.
    pub notes: Vec<String>,
}

impl Model {
    /// The body that a shape is part of.
    pub(crate) fn body_of(&self, shape: u32) -> Option<&BodyModel> {
        self.bodies.at(self.shapes.at(shape)?.body?)
    }
    /// Whether two bodies are joined so that they do not touch each other.
    pub(crate) fn apart(&self, a: Option<u32>, b: Option<u32>) -> bool {
        let joins = |j: &JointModel| !j.touch && (j.bodies == [a, b] || j.bodies == [b, a]);
        a.is_some() && b.is_some() && self.joints.iter().any(|(_, j)| joins(j))
    }
    /// Where a shape is in its body.
    pub(crate) fn local_of(&self, shape: u32) -> Option<&crate::math::Pose> {
        self.body_of(shape)?.shapes.iter().find(|(slot, _)| *slot == shape).map(|(_, local)| local)
    }
    /// Friction between two surfaces.
    pub(crate) fn friction_between(&self, a: u32, b: u32) -> Friction {
        let key = (a.min(b), a.max(b));
        match self.friction.binary_search_by_key(&key, |(k, _)| *k) {
            Ok(i) => self.friction[i].1,
            Err(_) => self.settings.friction,
        }
    }
    /// Makes a rod of a material, which gives its elements these sections. Masses are to be refreshed.
    pub(crate) fn set_material(&mut self, slot: u32, material: Material, sections: &[SectionStiffness]) {
        let rod = self.rods.at_mut(slot).expect("living");
        rod.flat = rod::is_flat(sections);
        let damping = material.bend_damping;
        rod.material = material;
        let (elements, particles) = (rod.elements(), rod.particles());
        self.section[elements].copy_from_slice(sections);
        self.bend_damping[particles.clone()].fill(damping);
        self.refresh_rod(particles);
    }
    /// Makes a rod one that stretches or does not.
    pub(crate) fn set_stretch(&mut self, slot: u32, stretch: Stretch) {
        let rod = self.rods.at_mut(slot).expect("living");
        rod.stretch = stretch;
        let particles = rod.particles();
        self.inextensible[particles.clone()].fill(stretch == Stretch::Inextensible);
        self.refresh_rod(particles);
    }
    pub(crate) fn refresh_rod(&mut self, particles: core::ops::Range<usize>) {
        for e in particles {
            self.refresh_element(e);
            self.refresh_joint(e);
        }
    }
    /// Stiffness of an element from its section and length.
    pub(crate) fn refresh_element(&mut self, e: usize) {
        if self.is_element(e) {
            let stiffer = if self.inextensible[e] { INEXTENSIBLE } else { 1.0 };
            let section = &self.section[e];
            self.stretch_stiffness[e] =
                DVec3::new(section.kga, section.kga, stiffer * section.ea) / self.rest_length[e];
        }
    }
    /// Whether the tension of an element is an unknown of the linear system: in an inextensible thread, but for
    /// elements at a weld.
    #[inline(always)]
    pub(crate) fn is_tied(&self, e: usize) -> bool {
        self.inextensible[e] && self.weld_of[e].is_none() && self.weld_of[e + 1].is_none()
    }
    /// Length and stiffness of the joint before element `e`, where there is one: half an element in series with half of
    /// the next.
    pub(crate) fn refresh_joint(&mut self, e: usize) {
        let joint = e > 0 && self.is_element(e) && self.is_element(e - 1) && self.rod_of[e] == self.rod_of[e - 1];
        if !joint {
            self.joint_length[e] = 0.0;
            return;
        }
        let (la, lb) = (self.rest_length[e - 1], self.rest_length[e]);
        let (a, b) = (self.section[e - 1].bend, self.section[e].bend);
        self.joint_length[e] = 0.5 * (la + lb);
        self.bend_stiffness[e] = if a == b {
            a / self.joint_length[e]
        } else {
            (DVec3::splat(0.5 * la) / a + DVec3::splat(0.5 * lb) / b).recip()
        };
    }
    /// Lumped masses and spin inertias: half of each element at its ends, and what is attached.
    pub(crate) fn refresh_masses(&mut self, loads: &Slots<LoadState>) {
        self.mass.fill(0.0);
        self.inertia.fill(DVec3::ZERO);
        for (_, rod) in self.rods.iter() {
            for e in rod.elements() {
                let l = self.rest_length[e];
                let section = self.section[e];
                let half = 0.5 * section.mass * l;
                self.mass[e] += half;
                self.mass[e + 1] += half;
                self.inertia[e] = section.inertia * l;
            }
        }
        for (_, load) in loads.iter() {
            if let LoadKind::Mass { place, mass, inertia } = load.kind {
                let rod = self.rods.at(load.rod).expect("loads go with their rod");
                let (e, s) = place.on_element(self, rod);
                self.mass[e] += mass * (1.0 - s);
                self.mass[e + 1] += mass * s;
                self.inertia[e] += inertia;
            }
        }
    }
    /// Which weld each particle belongs to.
    pub(crate) fn refresh_welds(&mut self) {
        self.weld_of.clear();
        self.weld_of.resize(self.mass.len(), None);
        for (slot, weld) in self.welds.iter() {
            for member in &weld.members {
                let first = self.rods.at(member.rod).expect("welds go with their rods").first;
                self.weld_of[(first + member.particle) as usize] = Some(slot);
            }
        }
    }
    /// Whether `e` is an element (and not the unused last entry of a rod).
    pub(crate) fn is_element(&self, e: usize) -> bool {
        self.rest_length[e] > 0.0
    }
    /// Whether there is a joint between elements `e - 1` and `e`.
    pub(crate) fn is_joint(&self, e: usize) -> bool {
        self.joint_length[e] > 0.0
    }
}
