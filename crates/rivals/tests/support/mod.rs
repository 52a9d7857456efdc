//! What the tests of all rivals share.
#![allow(dead_code, reason = "each test program uses a part")]

use glam::{DQuat, DVec3};
use sutura_rivals::{Hold, Pose, Rod, Scene, Shape, Solver};

/// A straight line of `n` edges from the origin.
pub fn line(n: usize, edge: f64, along: DVec3) -> Shape {
    Shape::straight(DVec3::ZERO, along * edge * n as f64, n, along.any_orthonormal_vector())
}

/// A thread of 0.3 mm, 2 GPa, Poisson's ratio 0.4, straight or as it is given.
pub fn thread(shape: Shape) -> Rod {
    Rod { start: shape.clone(), rest: shape, radius: 0.15e-3, young: 2e9, shear: 2e9 / 2.8, density: 1150.0 }
}

/// Three turns of a helix, of radius 5 mm and pitch 8 mm, in `n` edges.
pub fn helix(n: usize) -> Shape {
    let points = (0..=n)
        .map(|i| {
            let a = 3.0 * std::f64::consts::TAU * i as f64 / n as f64;
            DVec3::new(5e-3 * libm::cos(a), 5e-3 * libm::sin(a), 8e-3 * a / std::f64::consts::TAU)
        })
        .collect();
    Shape::untwisted(points, DVec3::X)
}

/// 40 edges, 15 cm, clamped at both ends along x: in two seconds the ends come together by 5 cm and the last one turns
/// once; gravity along -z.
pub fn pressed_and_turned(turns: f64) -> Scene {
    let (n, edge) = (40, 0.15 / 40.0);
    // d1 lies in the plane in which the rod sags, so that no method has a reason to leave it but the turn.
    let rod = thread(Shape::straight(DVec3::ZERO, DVec3::X * edge * 40.0, n, DVec3::Z));
    let frame = rod.start.frames[0];
    let part = |t: f64| (t / 2.0).min(1.0);
    Scene {
        first: Hold::Clamp(Box::new(move |t| Pose::new(DVec3::X * 0.025 * part(t), frame))),
        last: Hold::Clamp(Box::new(move |t| {
            let turn = DQuat::from_rotation_x(std::f64::consts::TAU * turns * part(t));
            Pose::new(DVec3::X * (0.15 - 0.025 * part(t)), turn * frame)
        })),
        gravity: DVec3::NEG_Z * 9.81,
        drag: 2.0,
        ..Scene::of(rod)
    }
}

/// How far a solver's rod reaches out of the plane y = 0 \[m\].
pub fn out_of_plane(solver: &dyn Solver) -> f64 {
    solver.positions().iter().map(|p| p.y.abs()).fold(0.0, f64::max)
}
