//! Plain position-based dynamics: distances between neighbors, and between second neighbors against bending.
//!
//! Source: Müller and others 2007, as `points.rs` says. Bending is that of cloth and ropes before dihedral angles: a
//! distance constraint from vertex to the vertex after next, of the length it has at rest, with a stiffness number of
//! its own. One sweep of Gauss and Seidel goes along the rod, both constraints of an edge in turn. A stiffness number
//! is the share of a violation that one projection removes, so that what it means depends on iterations, substeps and
//! the number of edges; zero is none, one is rigid.
//!
//! Left out: twist and frames, which the method does not have. Young's modulus and shear modulus do nothing.

use glam::{DQuat, DVec3};

use crate::points::{Points, check_settings, lead};
use crate::scene::{Invalid, Scene, Solver};

/// How it is solved, and its stiffness numbers.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// Substeps of a frame.
    pub substeps: usize,
    /// Sweeps over all constraints of a substep.
    pub iterations: usize,
    /// Share of a change of an edge's length that a projection removes, in \[0, 1\].
    pub stretching: f64,
    /// The same for the distance of second neighbors.
    pub bending: f64,
}

/// A rod of plain position-based dynamics.
pub struct Pbd {
    scene: Scene,
    settings: Settings,
    points: Points,
    length: Vec<f64>,
    /// Distances of second neighbors at rest \[m\].
    second: Vec<f64>,
    time: f64,
}

impl Default for Settings {
    /// Edges as stiff as they can be, bending half as much, twenty sweeps.
    fn default() -> Self {
        Settings { substeps: 1, iterations: 20, stretching: 1.0, bending: 0.5 }
    }
}

impl Pbd {
    /// At rest in the start shape.
    pub fn new(scene: Scene, settings: Settings) -> Result<Self, Invalid> {
        scene.check()?;
        check_settings(&[settings.substeps, settings.iterations], &[settings.stretching, settings.bending])?;
        let masses = scene.rod.masses();
        let points = Points::new(scene.rod.start.points.clone(), &masses, scene.accelerations(&masses));
        let second = scene.rod.rest.points.windows(3).map(|p| p[0].distance(p[2])).collect();
        Ok(Pbd { length: scene.rod.rest_lengths(), second, points, settings, scene, time: 0.0 })
    }
    /// Velocities of the vertices \[m/s\].
    pub fn velocities(&self) -> &[DVec3] {
        &self.points.v
    }
    /// Sets the velocities of the vertices \[m/s\].
    pub fn set_velocities(&mut self, v: &[DVec3]) {
        self.points.v.copy_from_slice(v);
    }

    fn substep(&mut self, h: f64) {
        self.time += h;
        let n = self.length.len();
        let [first, last] = lead(&self.scene, self.time, self.length[0], self.length[n - 1]);
        let held = [(0, first[0]), (1, first[1]), (n - 1, last[1]), (n, last[0])];
        for (i, at) in held {
            self.points.w[i] = if at.is_some() { 0.0 } else { self.points.w[i] };
        }
        self.points.predict(h, self.scene.drag);
        for (i, at) in held {
            self.points.p[i] = at.unwrap_or(self.points.p[i]);
        }
        for _ in 0..self.settings.iterations {
            for i in 0..n {
                self.points.distance(i, i + 1, self.length[i], self.settings.stretching);
                if i + 1 < n {
                    self.points.distance(i, i + 2, self.second[i], self.settings.bending);
                }
            }
        }
        self.points.finish(h);
    }
}

impl Solver for Pbd {
    fn step(&mut self, frame: f64) {
        for _ in 0..self.settings.substeps {
            self.substep(frame / self.settings.substeps as f64);
        }
    }
    fn time(&self) -> f64 {
        self.time
    }
    fn positions(&self) -> &[DVec3] {
        &self.points.p
    }
    fn frames(&self) -> Option<Vec<DQuat>> {
        None
    }
    fn rest_lengths(&self) -> &[f64] {
        &self.length
    }
}
