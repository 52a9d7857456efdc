//! The world that is stepped.

use bevy::prelude::*;
use std::any::Any;
use std::time::{Duration, Instant};
use sutura::input::{Recorder, Recording};
use sutura::{Handle, Incident, Rod, Settings, Shape, World};

/// A thing of the world that a hand takes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Part {
    /// A grip.
    Grip(Handle<sutura::Grip>),
    /// A body.
    Body(Handle<Shape>),
}

/// What is stepped: a world, or something that holds one and does more in a frame of it (a scene with motions of its
/// own).
pub trait Simulation: Any + Send + Sync {
    /// Reads the world.
    fn world(&self) -> &World;
    /// Changes the world.
    fn edit(&mut self) -> &mut Recorder;
    /// What was done to it, if it records.
    fn recording(&self) -> Option<&Recording>;
    /// One frame of physics of `dt` \[s\]. It may be done in pieces; before each `drive` is to be called with the part
    /// of the frame that will be done with that piece, in (0, 1]. What went wrong comes back.
    fn step(&mut self, dt: f64, drive: &mut dyn FnMut(&mut Recorder, f64)) -> Vec<Incident>;
    /// Limits the work of each frame from now on, or no longer ([`World::set_step_work`]): one that has spent it ends
    /// early, with less time simulated.
    fn limit_work(&mut self, most: Option<f64>);
    /// A hand takes a thing that was in the world before (`held`), or lets go of it. Whether the simulation sees to
    /// what moves it from then on; else a body that is let go is moved by what moved it before.
    fn hold(&mut self, _part: Part, _held: bool) -> bool {
        false
    }
    /// The simulation's own grip on a particle of a thread: a hand that takes hold there takes that one.
    fn grip_at(&self, _thread: Handle<Rod>, _particle: usize) -> Option<Handle<sutura::Grip>> {
        None
    }
}

impl Simulation for Recorder {
    fn world(&self) -> &World {
        self
    }
    fn edit(&mut self) -> &mut Recorder {
        self
    }
    fn recording(&self) -> Option<&Recording> {
        Recorder::recording(self)
    }
    fn step(&mut self, dt: f64, drive: &mut dyn FnMut(&mut Recorder, f64)) -> Vec<Incident> {
        drive(self, 1.0);
        Recorder::step(self, dt).incidents
    }
    fn limit_work(&mut self, most: Option<f64>) {
        let most = most.filter(|most| *most > 0.0);
        if most != self.step_work() {
            // Refused is only what is no number > 0.
            let _ = self.set_step_work(most);
        }
    }
}

/// The world of the engine, lengths in meters, and what it said of its last frame.
#[derive(Resource)]
pub struct Sutura {
    simulation: Box<dyn Simulation>,
    /// What went wrong in the last frame of physics. A step never fails: where it found no way it stands still and says
    /// so here.
    pub incidents: Vec<Incident>,
    /// Work in a millisecond, as measured lately.
    work_per_ms: f64,
}

/// Work in a millisecond that is expected before any is measured.
const WORK_PER_MS: f64 = 1e6;

/// Work of a frame from which on its time says what work takes.
const TELLING: f64 = 1e6;

/// Part of a measured rate that the next frame goes by.
const NEWEST: f64 = 0.1;

impl Default for Sutura {
    fn default() -> Self {
        Sutura::new(Settings::default(), false).unwrap_or_else(|e| unreachable!("the default settings are valid: {e}"))
    }
}

impl Sutura {
    /// An empty world, which writes down what is done to it if it is to.
    pub fn new(settings: Settings, record: bool) -> Result<Self, sutura::Error> {
        Ok(Self::of(Recorder::new(settings, record)?))
    }
    /// A world of one's own.
    pub fn of(simulation: impl Simulation) -> Self {
        Sutura { simulation: Box::new(simulation), incidents: Vec::new(), work_per_ms: WORK_PER_MS }
    }
    /// Reads the world.
    pub fn world(&self) -> &World {
        self.simulation.world()
    }
    /// Changes the world; what is done here is recorded.
    pub fn edit(&mut self) -> &mut Recorder {
        self.simulation.edit()
    }
    /// The simulation given to [`Sutura::of`], if it is of this type.
    pub fn simulation<T: Simulation>(&self) -> Option<&T> {
        let any: &dyn Any = &*self.simulation;
        any.downcast_ref()
    }
    /// The same, to change it.
    pub fn simulation_mut<T: Simulation>(&mut self) -> Option<&mut T> {
        let any: &mut dyn Any = &mut *self.simulation;
        any.downcast_mut()
    }
    /// Everything done so far, if the world records.
    pub fn recording(&self) -> Option<&Recording> {
        self.simulation.recording()
    }
    pub(crate) fn hold(&mut self, part: Part, held: bool) -> bool {
        self.simulation.hold(part, held)
    }
    pub(crate) fn grip_at(&self, thread: Handle<Rod>, particle: usize) -> Option<Handle<sutura::Grip>> {
        self.simulation.grip_at(thread, particle)
    }
    /// A frame of physics of `dt` \[s\], which ends early where it would take longer than `most`. The engine counts
    /// work; what a count takes here is measured.
    pub(crate) fn step(&mut self, dt: f64, most: Option<Duration>, drive: &mut dyn FnMut(&mut Recorder, f64)) {
        let most = most.map(|most| most.as_secs_f64() * 1e3 * self.work_per_ms);
        self.simulation.limit_work(most);
        let (before, start) = (self.world().work_done(), Instant::now());
        self.incidents = self.simulation.step(dt, drive);
        let (work, ms) = (self.world().work_done() - before, start.elapsed().as_secs_f64() * 1e3);
        if work > TELLING && ms > 0.0 {
            self.work_per_ms += NEWEST * (work / ms - self.work_per_ms);
        }
    }
}
