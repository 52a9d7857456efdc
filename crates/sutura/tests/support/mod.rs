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

/// Steps until nothing moves faster than `speed` \[m/s\] for ten steps, at most `limit` seconds. Returns the time it took.
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
