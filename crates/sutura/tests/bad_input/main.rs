//! Whatever a world is given: an error that says what was wrong, or an incident in the report; never a panic, a hang,
//! or a number that is not finite; and afterwards a world that can still be used.

mod building;
mod motions;
mod numbers;
mod snapshots;
#[path = "../support/mod.rs"]
mod support;

use support::t1;
use sutura::glam::DVec3;
use sutura::{Handle, IncidentKind, LoadKind, Place, Rod, RodSpec, Settings, StepReport, World};

const DT: f64 = 1.0 / 60.0;
const INF: f64 = f64::INFINITY;
const NAN: f64 = f64::NAN;

/// A world with a straight thread of 50 mm in 20 elements along x.
fn thread(settings: Settings) -> (World, Handle<Rod>) {
    let (material, radius) = t1();
    let mut world = World::new(settings).unwrap();
    let rod = world.insert_rod(&RodSpec::straight(DVec3::ZERO, DVec3::X * 0.05, 20, radius, material)).unwrap();
    (world, rod)
}

fn straight() -> RodSpec {
    let (material, radius) = t1();
    RodSpec::straight(DVec3::ZERO, DVec3::X * 0.05, 20, radius, material)
}

fn point(place: Place, force: DVec3) -> LoadKind {
    LoadKind::Point { place, force, torque: DVec3::ZERO }
}

/// Everything that can be read is finite.
#[track_caller]
fn assert_finite(world: &World) {
    assert!(world.time().is_finite());
    for rod in world.view().rods() {
        let vectors = rod.positions().iter().chain(rod.velocities()).chain(rod.angular_velocities());
        assert!(vectors.into_iter().all(|v| v.is_finite()), "a position or velocity is not finite");
        assert!(
            rod.orientations().iter().all(|q| q.is_finite() && (q.length() - 1.0).abs() < 1e-6),
            "a frame is not a rotation"
        );
        assert!((0..rod.n_elements()).all(|e| rod.internal_force(e).is_finite()), "a force is not finite");
    }
    assert!(world.view().shapes().all(|s| s.pose.position.is_finite() && s.pose.orientation.is_finite()));
    assert!(
        world.contacts().all(|c| c.force.is_finite() && c.point.is_finite() && c.normal.is_finite()),
        "a contact force is not finite"
    );
}

/// One step, with its work held against the bound that the settings imply, and the state looked at.
#[track_caller]
fn step(world: &mut World, dt: f64) -> StepReport {
    let settings = world.settings().clone();
    let report = world.step(dt);
    let wanted = (dt / settings.substep * (1.0 - 1e-9)).ceil().max(1.0);
    let attempts = wanted * f64::from((2u32 << settings.halvings) - 1);
    assert!(f64::from(report.substeps + report.rejected) <= attempts, "{report:?}");
    assert!(report.newton_iterations <= settings.newton_max * (report.substeps + report.rejected), "{report:?}");
    assert!(report.residual.is_finite() && report.length_error.is_finite(), "{report:?}");
    assert_finite(world);
    report
}

/// Whether a step came to its end.
fn went_through(report: &StepReport) -> bool {
    !report
        .incidents
        .iter()
        .any(|i| matches!(i.kind, IncidentKind::Stuck { .. } | IncidentKind::NotFinite | IncidentKind::BadInput { .. }))
}

/// Steps on; at the end the world moves again. `what` is for the message.
#[track_caller]
fn assert_usable(world: &mut World, frames: u32, what: &str) {
    let before = world.time();
    let mut last = None;
    for _ in 0..frames {
        last = Some(step(world, DT));
    }
    let last = last.unwrap();
    assert!(went_through(&last) && last.substeps > 0, "{what}: {:?}", last.incidents);
    assert!((world.time() - before - f64::from(frames) * DT).abs() < 1e-9);
}
