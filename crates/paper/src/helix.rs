//! The thread of figures 13 to 15, and the map over scale: at rest in a spiral, one end pinned, dropped.

use crate::measure::{FRAME, GRAVITY, length, play, sane};
use crate::method::{Direct, Method};
use std::f64::consts::TAU;
use sutura::PaperSettings;
use sutura::glam::DVec3;
use sutura_rivals::{Hold, Rod, Scene, Shape};

/// Frames of a fall: 5 s.
const FRAMES: usize = 300;
/// Rate at which velocities fade \[1/s\]: a fifth is lost in a second.
const DRAG: f64 = 0.223;

/// What was found of a fall.
pub struct Fall {
    /// The greatest elongation of the whole thread in the 5 s; infinite where it left all bounds.
    pub worst: f64,
    /// The mean elongation over the last second.
    pub last: f64,
    /// Median CPU time of a frame \[ms\].
    pub ms: f64,
    /// Where it is at the end \[m\].
    pub points: Vec<DVec3>,
    /// Steps in which the solver said that something was not found.
    pub incidents: usize,
}

impl Fall {
    /// Whether it left all bounds, or is more than twice as long as it should be.
    pub fn diverged(&self) -> bool {
        self.worst.is_nan() || self.worst > 1.0
    }
}

/// A thread `size` long in `n` elements, wound about the direction in which gravity does not act, with a radius of a
/// thirtieth of its length. For the paper's solver it is a chain of spheres that touch; for the other it is as slender
/// as a thread of 0.3 mm and 15 cm.
fn scene(size: f64, n: usize, spheres: bool) -> Scene {
    let (r, pitch) = (size / 30.0, size / 15.0);
    let turns = size / libm::hypot(TAU * r, pitch);
    let points = (0..=n)
        .map(|i| {
            let turn = turns * i as f64 / n as f64;
            let (s, c) = libm::sincos(TAU * turn);
            DVec3::new(pitch * turn, r * c, r * s)
        })
        .collect();
    let shape = Shape::untwisted(points, DVec3::Y);
    let radius = if spheres { 0.5 * size / n as f64 } else { 1e-3 * size };
    let rod = Rod { start: shape.clone(), rest: shape, radius, young: 2e9, shear: 2e9 / 2.8, density: 1150.0 };
    Scene {
        gravity: DVec3::NEG_Z * GRAVITY,
        drag: DRAG,
        first: Hold::Pin(Box::new(move |_| DVec3::new(0.0, r, 0.0))),
        ..Scene::of(rod)
    }
}

/// Lets it fall.
pub fn fall(method: &Method, size: f64, n: usize) -> Fall {
    let mut solver = crate::method::Ours::new(scene(size, n, matches!(method, Method::Paper(..))), method);
    let rest: f64 = solver.world.rod(solver.rod).map_or(f64::NAN, |r| r.rest_length());
    let (mut worst, mut last) = (0.0_f64, 0.0);
    let ms = play(&mut solver, FRAME, FRAMES, |k, s| {
        let now = if sane(s.positions(), size) { length(s.positions()) / rest - 1.0 } else { f64::INFINITY };
        worst = worst.max(now);
        if k > FRAMES - 60 {
            last += now / 60.0;
        }
    });
    let points = sutura_rivals::Solver::positions(&solver).to_vec();
    Fall { worst, last, ms, points, incidents: solver.incidents }
}

/// The paper's solver.
pub fn paper(iterations: u32, direct_distance: bool, substeps: u32) -> Method {
    Method::Paper(PaperSettings { iterations, direct_distance, ..PaperSettings::default() }, substeps)
}

/// Sutura's own.
pub fn direct(substeps: u32, newton_max: u32) -> Method {
    Method::Direct(Direct { substeps, newton_max, ..Direct::default() })
}
