//! Threads: put in, changed, taken out.

use super::{ROD, World};
use crate::error::Error;
use crate::handle::Handle;
use crate::model::Model;
use crate::model::material::Material;
use crate::model::reel::ReelLaw;
use crate::model::rod::{Rod, RodModel, RodSpec, Stretch};
use crate::model::weld::{Member, Side, WeldModel};
use crate::row;
use crate::state::{History, ReelState, Site};
use crate::view::RodView;
use glam::{DQuat, DVec3};

impl World {
    /// Adds a thread.
    pub fn insert_rod(&mut self, spec: &RodSpec) -> Result<Handle<Rod>, Error> {
        let low = spec.lower()?;
        self.state.invalidate(History::Unknown);
        let n = low.rest_lengths.len();
        let (model, state) = (&mut self.model, &mut self.state);
        let first = model.mass.len();
        let rod = RodModel {
            first: first as u32,
            n_elements: n as u32,
            radius: low.radius,
            section: spec.section,
            section_radius: spec.radius,
            size: spec.along.size.clone(),
            material: spec.material.clone(),
            stretch: spec.stretch,
            flat: crate::model::rod::is_flat(&low.sections),
            surface: spec.surface,
            turned: 0,
        };
        let handle: Handle<Rod> = model.rods.insert(rod);
        model.placed.rods.push(handle.index);
        for e in 0..=n {
            // The last entry is no element; its stiffness is never used.
            let section = low.sections[e.min(n - 1)];
            let after = if e < n { low.rest_lengths[e] } else { 0.0 };
            model.rod_of.push(handle.index);
            model.mass.push(0.0);
            model.inertia.push(DVec3::ZERO);
            model.rest_length.push(after);
            state.rest_length.push(after);
            model.inextensible.push(spec.stretch == Stretch::Inextensible);
            model.factors.push(low.factors[e.min(n - 1)]);
            model.section.push(section);
            model.stretch_stiffness.push(DVec3::splat(section.ea));
            model.joint_length.push(0.0);
            model.bend_stiffness.push(section.bend);
            model.bend_damping.push(spec.material.bend_damping);
            model.rest_half.push(if e < n { low.rest_half[e] } else { DQuat::IDENTITY });
            state.position.push(low.centerline[e]);
            state.orientation.push(if e < n { low.frames[e] } else { DQuat::IDENTITY });
        }
        for e in first..=first + n {
            model.refresh_element(e);
            model.refresh_joint(e);
        }
        let total = first + n + 1;
        state.velocity.resize(total, DVec3::ZERO);
        state.angular_velocity.resize(total, DVec3::ZERO);
        state.tension.resize(total, 0.0);
        state.plastic.resize(total, DVec3::ZERO);
        state.hardened.resize(total, 0.0);
        debug_assert!(model.has_entries(total) && state.has_entries(total));
        self.follow_strain(first..first + n);
        self.model.refresh_masses(&self.state.loads);
        self.model.refresh_welds();
        if let Some([before, after]) = low.seam {
            let member = |particle, before, after| Member { rod: handle.index, particle, before, after };
            let orientation = row::weld::between(low.frames[n - 1], low.frames[0], before * after);
            self.join(
                vec![member(n as u32, Some(Side::along(before)), None), member(0, None, Some(Side::along(after)))],
                orientation,
                None,
            );
        }
        Ok(handle)
    }

    /// Tensions of elastic elements are those of their strains.
    pub(super) fn follow_strain(&mut self, range: core::ops::Range<usize>) {
        let (model, state) = (&self.model, &mut self.state);
        for e in range {
            if model.is_element(e) && !model.inextensible[e] {
                state.tension[e] = crate::rod::element_strain(model, state, e).z * model.stretch_stiffness[e].z;
            }
        }
    }

    /// Makes a thread that is in the world of another material, checked as that of a new one. [`Along`](crate::Along)
    /// goes on to hold: modulus and density are multiplied along the thread as they were.
    ///
    /// Where the thread is and how fast it moves stays, and so does its shape at rest with the plastic set that it has
    /// (also where the new material takes none) and the hardening, which is counted in strains at yield. Forces follow:
    /// tensions of an elastic thread and all moments are those of the present strains from here on, momentum is that of
    /// the present velocities. The tensions of an inextensible thread, contact forces and the forces of grips are those
    /// of the last substep until the next one. What is bent beyond a new yield yields in the next substep. The
    /// integrator starts anew, as after any other edit.
    pub fn set_material(&mut self, rod: Handle<Rod>, material: &Material) -> Result<(), Error> {
        material.validate()?;
        let model = &self.model;
        let r = model.rods.get(rod).ok_or(ROD)?;
        let elements = model.factors[r.elements()].iter().copied().zip(model.rest_length[r.elements()].iter().copied());
        let sections = crate::model::rod::sections(material, &r.section, r.section_radius, elements)?;
        let (old, old_sections) = (r.material.clone(), model.section[r.elements()].to_vec());
        let change = |model: &mut Model| model.set_material(rod.index, material.clone(), &sections);
        self.remake(rod, change, |model| model.set_material(rod.index, old, &old_sections))
    }

    /// Lets a thread that is in the world stretch, or keeps it from stretching. One that is stretched shrinks to its
    /// rest length within the next substep, with the jolt that this is, or goes on as it is where what holds it does
    /// not give way, and the step says so. One that begins to stretch carries no tension at first: what it bore
    /// lengthens it. Not where a brake pays it out, which wants one that stretches.
    pub fn set_stretch(&mut self, rod: Handle<Rod>, stretch: Stretch) -> Result<(), Error> {
        let old = self.model.rods.get(rod).ok_or(ROD)?.stretch;
        let brake = |r: &ReelState| r.rod == rod.index && matches!(r.law, ReelLaw::Brake(_));
        if stretch == Stretch::Inextensible && self.state.reels.iter().any(|(_, r)| brake(r)) {
            return Err(Error::invalid("rod", "stretch", stretch, "Elastic, for a thread that a brake pays out"));
        }
        self.remake(rod, |model| model.set_stretch(rod.index, stretch), |model| model.set_stretch(rod.index, old))
    }

    /// Changes stiffness or mass of a thread; puts them back where that leaves the world out of all proportion.
    fn remake(
        &mut self,
        rod: Handle<Rod>,
        change: impl FnOnce(&mut Model),
        back: impl FnOnce(&mut Model),
    ) -> Result<(), Error> {
        let elements = self.model.rods.get(rod).ok_or(ROD)?.elements();
        let tension = self.state.tension[elements.clone()].to_vec();
        change(&mut self.model);
        self.model.refresh_masses(&self.state.loads);
        self.follow_strain(elements.clone());
        if !crate::finite::in_proportion(&self.model, &self.state) {
            back(&mut self.model);
            self.model.refresh_masses(&self.state.loads);
            self.state.tension[elements].copy_from_slice(&tension);
            return Err(Error::invalid(
                "rod",
                "material",
                "out of all proportion",
                "numbers with which the energy of the world is finite",
            ));
        }
        self.state.invalidate(History::Unknown);
        Ok(())
    }

    /// Removes a thread with its grips and loads. What it was welded to comes apart where fewer than two threads are
    /// left.
    pub fn remove_rod(&mut self, rod: Handle<Rod>) -> Result<(), Error> {
        let gone = self.model.rods.remove(rod).ok_or(ROD)?;
        self.state.invalidate(History::Unknown);
        let range = gone.particles();
        let (model, state) = (&mut self.model, &mut self.state);
        model.remove_entries(range.clone());
        state.remove_entries(range.clone());
        let (start, count) = (range.start as u32, range.len() as u32);
        for (_, other) in model.rods.iter_mut() {
            if other.first > start {
                other.first -= count;
            }
        }
        let shift = |e: u32| if e > start { e - count } else { e };
        state.contacts.retain(|c| c.all_elements().all(|e| !range.contains(&(e as usize))));
        state.contacts.rename(|site| match site {
            Site::Thread { element, s } => Site::Thread { element: shift(element), s },
            Site::Shape { .. } | Site::Surface { .. } => site,
        });
        state.grips.retain(|g| g.rod != rod.index);
        state.loads.retain(|l| l.rod != rod.index);
        for (_, weld) in model.welds.iter_mut() {
            weld.members.retain(|m| m.rod != rod.index);
        }
        let apart: Vec<WeldModel> = model.welds.iter().map(|(_, w)| w).filter(|w| !w.joins()).cloned().collect();
        model.welds.retain(WeldModel::joins);
        model.refresh_welds();
        model.faces.retain(|f| f.ends.iter().all(|end| end.rod != rod.index));
        state.reels.retain(|r| r.rod != rod.index);
        apart.iter().for_each(|weld| self.hold_alone(weld));
        Ok(())
    }

    pub(super) fn radius_of(&self, e: usize) -> f64 {
        self.model.rods.at(self.model.rod_of[e]).map_or(0.0, |r| r.radius)
    }

    /// Reads a thread.
    pub fn rod(&self, rod: Handle<Rod>) -> Result<RodView<'_>, Error> {
        self.model.rods.get(rod).ok_or(ROD)?;
        self.view().rod_at(rod.index).ok_or(ROD)
    }
}
