//! What the two position-based methods share: points with weights, prediction, corrections of a distance, and
//! velocities.
//!
//! Source: Müller, Heidelberger, Hennix, Ratcliff, "Position based dynamics", J. Vis. Commun. Image R. 2007: the loop
//! of section 3.1, the projection of equations (8) and (9), the distance constraint of equations (10) and (11).

use glam::DVec3;

use crate::scene::{Hold, Invalid, Scene};

/// Points that constraints move.
pub struct Points {
    pub p: Vec<DVec3>,
    before: Vec<DVec3>,
    pub v: Vec<DVec3>,
    /// Inverse masses \[1/kg\]; zero for points that are led.
    pub w: Vec<f64>,
    pub accelerations: Vec<DVec3>,
}

impl Points {
    /// At rest.
    pub fn new(p: Vec<DVec3>, masses: &[f64], accelerations: Vec<DVec3>) -> Self {
        Points {
            before: p.clone(),
            v: vec![DVec3::ZERO; p.len()],
            w: masses.iter().map(|m| 1.0 / m).collect(),
            accelerations,
            p,
        }
    }
    /// Velocities by gravity and loads, then positions by velocities, as explicit as the source has it.
    pub fn predict(&mut self, h: f64, drag: f64) {
        let fade = libm::exp(-drag * h);
        self.before.copy_from_slice(&self.p);
        for i in 0..self.p.len() {
            if self.w[i] > 0.0 {
                self.v[i] = (self.v[i] + self.accelerations[i] * h) * fade;
                self.p[i] += self.v[i] * h;
            }
        }
    }
    /// Velocities from what the points moved by.
    pub fn finish(&mut self, h: f64) {
        for i in 0..self.p.len() {
            self.v[i] = (self.p[i] - self.before[i]) / h;
        }
    }
    /// Moves two points along their distance, by the share `stiffness` of what is missing to `length`.
    pub fn distance(&mut self, i: usize, j: usize, length: f64, stiffness: f64) {
        let w = self.w[i] + self.w[j];
        let d = self.p[j] - self.p[i];
        let l = d.length();
        if w > 0.0 && l > 0.0 {
            let move_by = d * (stiffness * (l - length) / (l * w));
            self.p[i] += move_by * self.w[i];
            self.p[j] -= move_by * self.w[j];
        }
    }
}

/// The two vertices and the d1 of a held end: `None` where it is not held.
pub type Led = [Option<DVec3>; 3];

/// Where the ends are led at time `t`: end vertex, its neighbor, d1 of the edge.
pub fn lead(scene: &Scene, t: f64, first_length: f64, last_length: f64) -> [Led; 2] {
    [(&scene.first, first_length), (&scene.last, -last_length)].map(|(hold, length)| match hold {
        Hold::Free => [None; 3],
        Hold::Pin(at) => [Some(at(t)), None, None],
        Hold::Clamp(at) => {
            let pose = at(t);
            [
                Some(pose.position),
                Some(pose.position + pose.orientation * DVec3::Z * length),
                Some(pose.orientation * DVec3::X),
            ]
        }
    })
}

/// Whether numbers of a method's settings are shares, in \[0, 1\], and counts are positive.
pub fn check_settings(counts: &[usize], shares: &[f64]) -> Result<(), Invalid> {
    if counts.contains(&0) || !shares.iter().all(|s| (0.0..=1.0).contains(s)) {
        return Err(Invalid("substeps and iterations must be positive, stiffness numbers in [0, 1]".into()));
    }
    Ok(())
}
