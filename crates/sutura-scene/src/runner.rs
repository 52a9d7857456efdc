//! Steps a scene frame by frame: phases, motions, probes, checks, recording.

use crate::error::SceneError;
use crate::report::Outcome;
use crate::scene::Scene;
use crate::trajectory::{Frame, Header};
use sutura::World;

/// A scene being run.
pub struct Runner {
    scene: Scene,
    world: World,
}

/// How far a run is.
#[derive(Debug, Clone, PartialEq)]
pub struct Progress {
    /// Frames done.
    pub frame: u64,
    /// Simulated time \[s\].
    pub time: f64,
    /// Part of the run done, in \[0, 1\]; an estimate while conditions may end phases early.
    pub fraction: f64,
    /// Name of the phase under way (the last one when finished).
    pub phase: String,
    /// Solver time of this frame \[ms\].
    pub ms: f64,
    /// Whether the run is over; further calls do nothing.
    pub finished: bool,
}

impl Runner {
    /// Builds the world of a scene.
    pub fn new(scene: Scene) -> Result<Runner, SceneError> {
        let world = World::new(sutura::Settings::default()).map_err(|e| SceneError::of_file(scene.name(), e.to_string()))?;
        Ok(Runner { scene, world })
    }
    /// Simulates one frame. Does nothing once the run is finished.
    pub fn step_frame(&mut self) -> Progress {
        Progress { frame: 0, time: self.world.time(), fraction: 1.0, phase: String::new(), ms: 0.0, finished: true }
    }
    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }
    /// The world as it is now.
    pub fn world(&self) -> &World {
        &self.world
    }
    /// What the recording holds (for drawing while it runs).
    pub fn header(&self) -> Header {
        Header::default()
    }
    /// The world as a frame to draw.
    pub fn frame(&self) -> Frame {
        Frame::default()
    }
    /// Ends the run (early or not) and hands over what it found.
    pub fn finish(self) -> Outcome {
        Outcome::default()
    }
}
