//! Shared by the integration tests: reference materials and settling.
#![allow(dead_code, reason = "each test file uses a part")]

use sutura::glam::DVec3;
use sutura::{Friction, Material, Settings, World};

/// Reference set T1: 2-0 monofilament, d = 0.30 mm, E = 2 GPa, nu = 0.4, rho = 1150.
pub fn t1() -> (Material, f64) {
    (Material::elastic(2.0e9, 1150.0), 0.15e-3)
}

/// No gravity, no damping, one substep a 60th of a second.
pub fn quiet() -> Settings {
    Settings { gravity: DVec3::ZERO, substep: 1.0 / 60.0, friction: Friction::coulomb(0.3), ..Settings::default() }
}

/// Steps until nothing moves faster than `speed` \[m/s\] for ten steps, at most `limit` seconds. Returns the time it
/// took.
pub fn settle(world: &mut World, dt: f64, speed: f64, limit: f64) -> f64 {
    let start = world.time();
    let mut still = 0;
    while world.time() - start < limit {
        let report = world.step(dt);
        assert!(report.incidents.is_empty(), "{:?}", report.incidents);
        let fastest = world.view().rods().flat_map(|r| r.velocities().iter().map(|v| v.length())).fold(0.0, f64::max);
        still = if fastest < speed { still + 1 } else { 0 };
        if still >= 10 {
            return world.time() - start;
        }
    }
    panic!("not at rest after {limit} s");
}

/// A loose open overhand knot (left or right does not matter) through `n + 1` points at equal arcs: Shastri's
/// polynomial trefoil `(t^3 - 3 t, t^4 - 4 t^2, 0.55 (t^5 / 5 - 2 t))` takes 45 % of the length, straight tails the
/// rest.
pub fn overhand(length: f64, n: usize) -> Vec<DVec3> {
    let knot: Vec<DVec3> = (0..=4000)
        .map(|i| {
            let t = -2.05 + 4.1 * f64::from(i) / 4000.0;
            let t2 = t * t;
            DVec3::new(t * (t2 - 3.0), t2 * (t2 - 4.0), 0.55 * t * (0.2 * t2 * t2 - 2.0))
        })
        .collect();
    let arc: f64 = knot.windows(2).map(|w| w[0].distance(w[1])).sum();
    let scale = 0.45 * length / arc;
    let tail = 0.275 * length;
    let mut points: Vec<DVec3> = knot.iter().map(|p| *p * scale).collect();
    let (first, last) = (points[0], points[4000]);
    points.insert(0, first + (first - points[1]).normalize() * tail);
    points.push(last + (last - points[4000]).normalize() * tail);
    resample(&points, n)
}

/// `n + 1` points at equal arcs along a polyline. The studies have the same (`evenly` and `overhand` in
/// `crates/studies/src/curve.rs`): what both see is the engine, which inserts centerlines and makes none, and its tests
/// do not build the studies' tables and pictures.
pub fn resample(points: &[DVec3], n: usize) -> Vec<DVec3> {
    let mut arc = vec![0.0];
    for w in points.windows(2) {
        arc.push(arc[arc.len() - 1] + w[0].distance(w[1]));
    }
    let total = arc[arc.len() - 1];
    (0..=n)
        .map(|i| {
            let s = total * i as f64 / n as f64;
            let k = arc.partition_point(|a| *a < s).clamp(1, arc.len() - 1);
            points[k - 1].lerp(points[k], (s - arc[k - 1]) / (arc[k] - arc[k - 1]))
        })
        .collect()
}
