//! What the tests of all rivals share.
#![allow(dead_code, reason = "each test program uses a part")]

use glam::DVec3;
use sutura_rivals::{Rod, Shape};

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
