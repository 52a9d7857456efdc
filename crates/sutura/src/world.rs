//! The world: what a user builds, steps and reads.

use crate::error::Error;
use crate::handle::Handle;
use crate::math::Pose;
use crate::model::Model;
use crate::model::grip::{Drive, Grip, GripSpec, Load, LoadKind, LoadSpec};
use crate::model::rod::{Rod, RodSpec};
use crate::model::shape::{Shape, ShapeMotion, ShapeSpec};
use crate::params::{Friction, Settings};
use crate::report::StepReport;
use crate::state::State;
use crate::view::{ContactView, RodView, ShapeView, View};
use glam::DVec3;

/// Threads, shapes, grips and loads that move together.
pub struct World {
    model: Model,
    state: State,
}

/// Force \[N\] and torque \[N m\] in world axes, about the place where they act.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Wrench {
    /// Force \[N\].
    pub force: DVec3,
    /// Torque \[N m\].
    pub torque: DVec3,
}

#[allow(unused_variables)]
impl World {
    /// An empty world.
    pub fn new(settings: Settings) -> Result<Self, Error> {
        unimplemented!()
    }
    /// The settings.
    pub fn settings(&self) -> &Settings {
        unimplemented!()
    }
    /// Changes the settings.
    pub fn set_settings(&mut self, settings: Settings) -> Result<(), Error> {
        unimplemented!()
    }
    /// Friction between two surfaces (indices given in `RodSpec::surface`, `ShapeSpec::surface`).
    pub fn set_friction(&mut self, a: u32, b: u32, friction: Friction) -> Result<(), Error> {
        unimplemented!()
    }
    /// Adds a thread.
    pub fn insert_rod(&mut self, spec: &RodSpec) -> Result<Handle<Rod>, Error> {
        unimplemented!()
    }
    /// Removes a thread with its grips and loads.
    pub fn remove_rod(&mut self, rod: Handle<Rod>) -> Result<(), Error> {
        unimplemented!()
    }
    /// Adds a shape.
    pub fn insert_shape(&mut self, spec: &ShapeSpec) -> Result<Handle<Shape>, Error> {
        unimplemented!()
    }
    /// Removes a shape.
    pub fn remove_shape(&mut self, shape: Handle<Shape>) -> Result<(), Error> {
        unimplemented!()
    }
    /// Pose wanted at the end of the next step for a driven shape. It gets there at constant rate.
    pub fn set_shape_pose(&mut self, shape: Handle<Shape>, pose: Pose) -> Result<(), Error> {
        unimplemented!()
    }
    /// Changes what moves a shape (for instance the force on a pushed one), from the next step on.
    pub fn set_shape_motion(&mut self, shape: Handle<Shape>, motion: ShapeMotion) -> Result<(), Error> {
        unimplemented!()
    }
    /// Takes hold.
    pub fn insert_grip(&mut self, spec: &GripSpec) -> Result<Handle<Grip>, Error> {
        unimplemented!()
    }
    /// Lets go.
    pub fn remove_grip(&mut self, grip: Handle<Grip>) -> Result<(), Error> {
        unimplemented!()
    }
    /// Pose wanted at the end of the next step for a pose-driven grip. A pin ignores the orientation. The orientation of a clamp or
    /// jaw is that of the material frame held (`world_from_material`).
    pub fn set_grip_pose(&mut self, grip: Handle<Grip>, pose: Pose) -> Result<(), Error> {
        unimplemented!()
    }
    /// Changes what moves a grip, from the next step on. To `Drive::Pose`: it stays where it is until a pose is set.
    pub fn set_grip_drive(&mut self, grip: Handle<Grip>, drive: Drive) -> Result<(), Error> {
        unimplemented!()
    }
    /// Pose of the held piece now.
    pub fn grip_pose(&self, grip: Handle<Grip>) -> Result<Pose, Error> {
        unimplemented!()
    }
    /// Force and torque with which the grip acts on the thread, at the last accepted substep.
    pub fn grip_wrench(&self, grip: Handle<Grip>) -> Result<Wrench, Error> {
        unimplemented!()
    }
    /// Adds a load.
    pub fn insert_load(&mut self, spec: &LoadSpec) -> Result<Handle<Load>, Error> {
        unimplemented!()
    }
    /// Changes a load.
    pub fn set_load(&mut self, load: Handle<Load>, kind: LoadKind) -> Result<(), Error> {
        unimplemented!()
    }
    /// Removes a load.
    pub fn remove_load(&mut self, load: Handle<Load>) -> Result<(), Error> {
        unimplemented!()
    }
    /// Force with which threads act on a shape, at the last accepted substep, torque about its origin.
    pub fn shape_wrench(&self, shape: Handle<Shape>) -> Result<Wrench, Error> {
        unimplemented!()
    }
    /// Reads a thread.
    pub fn rod(&self, rod: Handle<Rod>) -> Result<RodView<'_>, Error> {
        unimplemented!()
    }
    /// Reads a shape.
    pub fn shape(&self, shape: Handle<Shape>) -> Result<ShapeView<'_>, Error> {
        unimplemented!()
    }
    /// Reads everything.
    pub fn view(&self) -> View<'_> {
        View { model: &self.model, state: &self.state }
    }
    /// Contacts that carry force, at the last accepted substep.
    pub fn contacts(&self) -> impl Iterator<Item = ContactView> + '_ {
        core::iter::empty()
    }
    /// Simulated time \[s\].
    pub fn time(&self) -> f64 {
        self.state.time
    }
    /// Advances by `dt` \[s\], cut into substeps. Never fails: see the report.
    pub fn step(&mut self, dt: f64) -> StepReport {
        self.step_with(dt, &mut |_| {})
    }
    /// The same; `observe` sees every accepted substep (an audit, a recorder).
    pub fn step_with(&mut self, dt: f64, observe: &mut dyn FnMut(View<'_>)) -> StepReport {
        unimplemented!()
    }
    /// Everything that the next step depends on beyond the model, as bytes (little endian, versioned).
    pub fn snapshot(&self) -> Vec<u8> {
        unimplemented!()
    }
    /// Takes the world back to a snapshot of a world with the same model.
    pub fn restore(&mut self, bytes: &[u8]) -> Result<(), Error> {
        unimplemented!()
    }
    /// 64-bit hash of the state; equal bits, equal hash, on any machine.
    pub fn state_hash(&self) -> u64 {
        unimplemented!()
    }
}
