//! Grips, loads and reels.

use super::{GRIP, LOAD, REEL, ROD, World, Wrench};
use crate::error::{Error, check};
use crate::handle::Handle;
use crate::math::Pose;
use crate::model::grip::{Drive, Grip, GripSpec, Hold, Load, LoadKind, LoadSpec};
use crate::model::reel::{Reel, ReelLaw, ReelSpec};
use crate::model::rod::{RodModel, Stretch};
use crate::state::{GripState, History, LoadState, ReelState};
use glam::{DQuat, DVec3};

impl World {
    /// Takes hold.
    pub fn insert_grip(&mut self, spec: &GripSpec) -> Result<Handle<Grip>, Error> {
        spec.drive.validate()?;
        check("grip", "ramp", spec.ramp, spec.ramp >= 0.0, "a finite time >= 0 [s]")?;
        let rod = self.model.rods.get(spec.rod).ok_or(ROD)?;
        spec.place.validate("grip", &self.model, rod)?;
        let n = rod.n_elements;
        let index = match spec.hold {
            Hold::Pin | Hold::Clamp => spec.place.particle(&self.model, rod),
            Hold::Jaw => (spec.place.on_element(&self.model, rod).0 - rod.first as usize) as u32,
        };
        let first = (rod.first + index) as usize;
        let wanted = first..=first + usize::from(spec.hold == Hold::Jaw);
        let welded = wanted
            .clone()
            .filter_map(|i| self.model.weld_of[i])
            .flat_map(|w| self.model.welds.at(w).into_iter().flat_map(|w| &w.members));
        if wanted
            .clone()
            .chain(welded.map(|m| m.index(&self.model)))
            .any(|i| crate::reel::held(&self.model, &self.state, i))
        {
            return Err(Error::invalid("grip", "place", spec.place, "a piece that no other grip holds"));
        }
        if wanted
            .clone()
            .filter_map(|i| self.model.weld_of[i])
            .any(|w| self.model.welds.at(w).is_some_and(|w| w.anchor.is_some()))
        {
            return Err(Error::invalid("grip", "place", spec.place, "a piece that is not attached to a body"));
        }
        let i = (rod.first + index) as usize;
        let state = &self.state;
        if spec.hold == Hold::Jaw
            && state.reels.iter().any(|(_, r)| r.rod == spec.rod.index && r.element(&self.model) == i)
        {
            return Err(Error::invalid("grip", "place", spec.place, "an element that is not at a reel, for a jaw"));
        }
        let (mut rest_half, mut half_span) = (DQuat::IDENTITY, DVec3::ZERO);
        let (position, orientation, velocity, spin) = match spec.hold {
            Hold::Pin => (state.position[i], DQuat::IDENTITY, state.velocity[i], DVec3::ZERO),
            Hold::Clamp => {
                // Rest rotation over half an element: half that of the joint here, or of the nearest joint at an end.
                let joint = if n < 2 { None } else { Some((rod.first + index.clamp(1, n - 1)) as usize) };
                if let Some(j) = joint {
                    rest_half = crate::math::half(self.model.rest_half[j]);
                }
                let welded = self.model.weld_of[i].map(|w| state.weld_orientation[w as usize]);
                let (before, after) =
                    ((index > 0).then(|| state.orientation[i - 1]), (index < n).then(|| state.orientation[i]));
                let q = welded.unwrap_or_else(|| crate::model::grip::clamp_orientation(before, after, rest_half));
                (state.position[i], q, state.velocity[i], state.angular_velocity[if index < n { i } else { i - 1 }])
            }
            Hold::Jaw => {
                let (a, b, q) = (state.position[i], state.position[i + 1], state.orientation[i]);
                half_span = q.conjugate() * ((b - a) * 0.5);
                ((a + b) * 0.5, q, (state.velocity[i] + state.velocity[i + 1]) * 0.5, state.angular_velocity[i])
            }
        };
        let pose = Pose::new(position, orientation);
        self.state.invalidate(History::Unknown);
        Ok(self.state.grips.insert(GripState {
            rod: spec.rod.index,
            index,
            hold: spec.hold,
            drive: spec.drive,
            ramp: spec.ramp,
            taken_at: self.state.time,
            taken_pose: pose,
            taken_velocity: velocity,
            taken_spin: spin,
            pose,
            target: pose,
            rest_half,
            half_span,
            force: DVec3::ZERO,
            torque: DVec3::ZERO,
        }))
    }

    /// Lets go.
    pub fn remove_grip(&mut self, grip: Handle<Grip>) -> Result<(), Error> {
        self.state.grips.remove(grip).ok_or(GRIP)?;
        self.state.invalidate(History::Unknown);
        Ok(())
    }

    /// Pose wanted at the end of the next step for a pose-driven grip. A pin ignores the orientation. The orientation
    /// of a clamp or jaw is that of the material frame held (`world_from_material`).
    pub fn set_grip_pose(&mut self, grip: Handle<Grip>, pose: Pose) -> Result<(), Error> {
        let g = self.state.grips.get_mut(grip).ok_or(GRIP)?;
        if !pose.is_valid() {
            return Err(Error::invalid("grip", "pose", pose, "finite, with a unit quaternion"));
        }
        if g.drive != Drive::Pose {
            return Err(Error::invalid("grip", "drive", g.drive, "Pose, for a pose to be set"));
        }
        g.target = pose;
        Ok(())
    }

    /// Changes what moves a grip, from the next step on. To `Drive::Pose`: it stays where it is until a pose is set.
    pub fn set_grip_drive(&mut self, grip: Handle<Grip>, drive: Drive) -> Result<(), Error> {
        drive.validate()?;
        let g = self.state.grips.get_mut(grip).ok_or(GRIP)?;
        g.drive = drive;
        g.target = g.pose;
        self.state.invalidate(History::Unknown);
        Ok(())
    }

    /// Pose of the held piece now. For a pin the orientation is the identity.
    pub fn grip_pose(&self, grip: Handle<Grip>) -> Result<Pose, Error> {
        let g = self.state.grips.get(grip).ok_or(GRIP)?;
        let rod = self.model.rods.at(g.rod).ok_or(ROD)?;
        let i = (rod.first + g.index) as usize;
        let x = &self.state.position;
        Ok(match g.hold {
            Hold::Pin => Pose::at(x[i]),
            Hold::Clamp => Pose::new(x[i], g.pose.orientation),
            Hold::Jaw => Pose::new((x[i] + x[i + 1]) * 0.5, self.state.orientation[i]),
        })
    }

    /// What moves a grip.
    pub fn grip_drive(&self, grip: Handle<Grip>) -> Result<Drive, Error> {
        Ok(self.state.grips.get(grip).ok_or(GRIP)?.drive)
    }

    /// Force and torque with which the grip acts on the thread, at the last accepted substep.
    pub fn grip_wrench(&self, grip: Handle<Grip>) -> Result<Wrench, Error> {
        let g = self.state.grips.get(grip).ok_or(GRIP)?;
        Ok(Wrench { force: g.force, torque: g.torque })
    }

    /// Adds a load.
    pub fn insert_load(&mut self, spec: &LoadSpec) -> Result<Handle<Load>, Error> {
        let rod = self.model.rods.get(spec.rod).ok_or(ROD)?;
        self.validate_load(&spec.kind, rod)?;
        let handle = self.state.loads.insert(LoadState { rod: spec.rod.index, kind: spec.kind });
        self.state.invalidate(History::Unknown);
        self.model.refresh_masses(&self.state.loads);
        Ok(handle)
    }

    /// Changes a load.
    pub fn set_load(&mut self, load: Handle<Load>, kind: LoadKind) -> Result<(), Error> {
        let rod = self.state.loads.get(load).ok_or(LOAD)?.rod;
        self.validate_load(&kind, self.model.rods.at(rod).ok_or(ROD)?)?;
        if let Some(l) = self.state.loads.get_mut(load) {
            l.kind = kind;
        }
        self.state.invalidate(History::Unknown);
        self.model.refresh_masses(&self.state.loads);
        Ok(())
    }

    /// Removes a load.
    pub fn remove_load(&mut self, load: Handle<Load>) -> Result<(), Error> {
        self.state.loads.remove(load).ok_or(LOAD)?;
        self.state.invalidate(History::Unknown);
        self.model.refresh_masses(&self.state.loads);
        Ok(())
    }

    /// Sets a reel up.
    pub fn insert_reel(&mut self, spec: &ReelSpec) -> Result<Handle<Reel>, Error> {
        spec.validate()?;
        let (model, state) = (&self.model, &self.state);
        let rod = model.rods.get(spec.rod).ok_or(ROD)?;
        self.validate_law(&spec.law, rod)?;
        if state.reels.iter().any(|(_, r)| r.rod == spec.rod.index && r.at_end == spec.at_end) {
            return Err(Error::invalid("reel", "at_end", spec.at_end, "an end that has no reel yet"));
        }
        let e = if spec.at_end { rod.elements().end - 1 } else { rod.first as usize };
        if model.weld_of[if spec.at_end { e + 1 } else { e }].is_some() {
            return Err(Error::invalid("reel", "at_end", spec.at_end, "an end that is not welded"));
        }
        if !crate::reel::suits(model, rod) {
            return Err(Error::invalid(
                "reel",
                "rod",
                spec.rod,
                "a thread of two elements or more, of one section, straight at rest",
            ));
        }
        let jaw = |g: &GripState| g.rod == spec.rod.index && g.hold == Hold::Jaw && (rod.first + g.index) as usize == e;
        if state.grips.iter().any(|(_, g)| jaw(g)) {
            return Err(Error::invalid("reel", "at_end", spec.at_end, "an end whose last element no jaw holds"));
        }
        let nominal = model.rest_length[e];
        self.state.invalidate(History::Unknown);
        let reel = ReelState {
            rod: spec.rod.index,
            at_end: spec.at_end,
            law: spec.law,
            supply: spec.supply,
            nominal,
            fed: 0.0,
            added: 0,
        };
        Ok(self.state.reels.insert(reel))
    }

    /// Changes what a reel does, from the next step on.
    pub fn set_reel(&mut self, reel: Handle<Reel>, law: ReelLaw) -> Result<(), Error> {
        law.validate()?;
        let rod = self.state.reels.get(reel).ok_or(REEL)?.rod;
        self.validate_law(&law, self.model.rods.at(rod).ok_or(ROD)?)?;
        self.state.reels.get_mut(reel).ok_or(REEL)?.law = law;
        Ok(())
    }

    /// Length that a reel has fed in, less what it has drawn back \[m\].
    pub fn reel_fed(&self, reel: Handle<Reel>) -> Result<f64, Error> {
        self.state.reels.get(reel).map(|r| r.fed).ok_or(REEL)
    }

    fn validate_law(&self, law: &ReelLaw, rod: &RodModel) -> Result<(), Error> {
        law.validate()?;
        if matches!(law, ReelLaw::Brake(_)) && rod.stretch == Stretch::Inextensible {
            return Err(Error::invalid("reel", "law", law, "a rate, for a thread that does not stretch"));
        }
        Ok(())
    }

    pub(super) fn validate_load(&self, kind: &LoadKind, rod: &RodModel) -> Result<(), Error> {
        kind.validate()?;
        match kind {
            LoadKind::Point { place, .. } | LoadKind::Mass { place, .. } => place.validate("load", &self.model, rod),
            LoadKind::Uniform { .. } => Ok(()),
        }
    }
}
