//! What is put where something is already: the step says what, where and how deep, and time that was not simulated is
//! not counted as if it were.

mod support;

use support::t1;
use sutura::glam::DVec3;
use sutura::{
    Geometry, GripSpec, Hold, Incident, IncidentKind, Overlap, OverlapWith, Place, Pose, RodSpec, Settings,
    ShapeMotion, ShapeSpec, Solver, StepReport, World,
};

const DT: f64 = 1.0 / 60.0;

fn quiet() -> World {
    World::new(Settings { gravity: DVec3::ZERO, ..Settings::default() }).unwrap()
}

fn along_x(z: f64) -> RodSpec {
    let (material, radius) = t1();
    RodSpec::straight(DVec3::new(-0.01, 0.0, z), DVec3::new(0.01, 0.0, z), 20, radius, material)
}

fn along_y(z: f64) -> RodSpec {
    let (material, radius) = t1();
    RodSpec::straight(DVec3::new(2e-3, -0.01, z), DVec3::new(2e-3, 0.01, z), 20, radius, material)
}

fn told(report: &StepReport) -> Vec<Overlap> {
    report.incidents.iter().filter_map(|i| if let IncidentKind::Overlap(o) = i.kind { Some(o) } else { None }).collect()
}

#[test]
fn the_first_step_after_an_insertion_names_what_lies_in_what() {
    let radius = t1().1;
    let mut world = quiet();
    let a = world.insert_rod(&along_x(0.0)).unwrap();
    assert!(told(&world.step(DT)).is_empty() && world.overlaps().is_empty());
    // A clearance of -0.61 diameters: the centerline of each runs within the other.
    let b = world.insert_rod(&along_y(0.39 * 2.0 * radius)).unwrap();
    assert_eq!(world.overlaps().len(), 1);
    let report = world.step(DT);
    let found = told(&report);
    assert_eq!(found.len(), 1);
    let o = found[0];
    let OverlapWith::Rod { rod, arc } = o.with else { panic!("{o:?}") };
    assert_eq!((o.rod, rod, o.through), (a, b, true));
    assert!(
        (o.arc - 0.012).abs() < 1e-9
            && (arc - 0.01).abs() < 1e-9
            && (o.diameters - 0.61).abs() < 1e-6
            && (o.depth - 1.22 * radius).abs() < 1e-9,
        "{o:?}"
    );
    assert!((o.point - DVec3::new(2e-3, 0.0, 0.39 * radius)).length() < 1e-9);
    let words = report.incidents[0].kind.to_string();
    assert!(
        words.contains("#0.0")
            && words.contains("#1.0")
            && words.contains("0.61 diameters")
            && words.contains("passes through"),
        "{words}"
    );
    // It is said once.
    assert!(told(&world.step(DT)).is_empty());
}

#[test]
fn what_is_pressed_is_pushed_apart() {
    let radius = t1().1;
    let mut world = quiet();
    world.insert_rod(&along_x(0.0)).unwrap();
    world.insert_rod(&along_y(1.7 * radius)).unwrap();
    let found = told(&world.step(DT));
    assert!(found.len() == 1 && !found[0].through && (found[0].diameters - 0.15).abs() < 1e-6, "{found:?}");
    for _ in 0..30 {
        world.step(DT);
    }
    assert!(world.overlaps().is_empty(), "{:?}", world.overlaps());
    // What overlaps by no more than a loaded contact does is not worth a word.
    world.insert_rod(&along_x(0.01)).unwrap();
    world.insert_rod(&along_y(0.01 + 1.92 * radius)).unwrap();
    assert!(told(&world.step(DT)).is_empty());
}

#[test]
fn shapes_put_onto_threads_are_named() {
    let radius = t1().1;
    let mut world = quiet();
    let rod = world.insert_rod(&along_x(0.0)).unwrap();
    world.step(DT);
    let ball = ShapeSpec::fixed(Geometry::Sphere { radius: 1e-3 }, Pose::at(DVec3::new(-4e-3, 0.5e-3, 0.0)));
    let ball = world.insert_shape(&ball).unwrap();
    let plane = world.insert_shape(&ShapeSpec::fixed(Geometry::Plane, Pose::at(DVec3::Z * (-0.6 * radius)))).unwrap();
    let found = told(&world.step(DT));
    assert_eq!(
        found.iter().map(|o| (o.rod, o.with, o.through)).collect::<Vec<_>>(),
        [(rod, OverlapWith::Shape(ball), true), (rod, OverlapWith::Shape(plane), false)]
    );
    assert!(
        (found[0].depth - 0.5e-3 - radius).abs() < 1e-7
            && (found[0].arc - 6e-3).abs() < 1e-4
            && (found[1].depth - 0.4 * radius).abs() < 1e-9,
        "{found:?}"
    );
}

#[test]
fn a_shape_that_jumps_into_a_thread_is_named() {
    // The paper's solver moves shapes to where they are wanted, whatever is there: here a thread that is held.
    let mut world =
        World::new(Settings { gravity: DVec3::ZERO, solver: Solver::Paper(Default::default()), ..Settings::default() })
            .unwrap();
    let rod = world.insert_rod(&along_x(0.0)).unwrap();
    for place in [Place::Start, Place::Particle(10), Place::End] {
        world.insert_grip(&GripSpec::at_once(rod, place, Hold::Pin)).unwrap();
    }
    let bar = ShapeSpec {
        motion: ShapeMotion::Driven,
        ..ShapeSpec::fixed(Geometry::Box { half_sides: DVec3::splat(5e-3) }, Pose::at(DVec3::Z * 10.0))
    };
    let bar = world.insert_shape(&bar).unwrap();
    assert!(told(&world.step(DT)).is_empty());
    world.set_shape_pose(bar, Pose::at(DVec3::ZERO)).unwrap();
    let report = world.step(DT);
    assert!(report.incidents.iter().any(|i| matches!(i.kind, IncidentKind::Teleport { .. })));
    let found = told(&report);
    assert!(
        !found.is_empty() && found.iter().all(|o| o.rod == rod && o.with == OverlapWith::Shape(bar)),
        "{:?}",
        report.incidents
    );
}

#[test]
fn time_that_passes_without_simulation_is_told() {
    let mut world = quiet();
    world.insert_rod(&along_x(0.0)).unwrap();
    let report = world.step(DT);
    assert!((report.simulated - DT).abs() < 1e-15 && (report.time - DT).abs() < 1e-15);
    world.set_settings(Settings { gravity: DVec3::NEG_Z * 1e300, ..Settings::default() }).unwrap();
    let report = world.step(DT);
    assert!(report.simulated == 0.0 && (report.time - 2.0 * DT).abs() < 1e-15, "{report:?}");
    assert!(matches!(report.incidents[..], [Incident { kind: IncidentKind::NotFinite, .. }]));
    assert_eq!(world.step(f64::NAN).simulated, 0.0);
}
