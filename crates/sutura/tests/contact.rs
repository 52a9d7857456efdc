//! Contact: what is in the way stays in the way.

mod support;

use support::t1;
use sutura::audit::Audit;
use sutura::glam::DVec3;
use sutura::{
    Geometry, GripSpec, Hold, IncidentKind, LoadKind, LoadSpec, Place, Pose, Rejection, RodSpec, Settings, ShapeSpec,
    World,
};

#[test]
fn what_touches_a_held_piece_bears_on_it() {
    // A thread laid across another one between the jaws of two grips: it rests on the held elements themselves.
    let (material, radius) = t1();
    let material = sutura::Material { bend_damping: 0.01, ..material };
    let mut world = World::new(Settings { linear_damping: 0.99, ..Settings::default() }).unwrap();
    let below =
        world.insert_rod(&RodSpec::straight(DVec3::ZERO, DVec3::X * 2e-3, 4, radius, material.clone())).unwrap();
    for e in [0, 3] {
        world.insert_grip(&GripSpec::at_once(below, Place::Element(e), Hold::Jaw)).unwrap();
    }
    let x = 0.2e-3;
    let from = DVec3::new(x, -5e-3, 2.1 * radius);
    let above = world.insert_rod(&RodSpec::straight(from, from + DVec3::Y * 1e-2, 20, radius, material)).unwrap();
    // Kept level and over the middle of a held element.
    for place in [Place::Start, Place::End] {
        let grip = GripSpec::at_once(above, place, Hold::Pin);
        world.insert_grip(&grip).unwrap();
    }
    let kind = LoadKind::Point { place: Place::Particle(10), force: DVec3::NEG_Z * 0.2, torque: DVec3::ZERO };
    world.insert_load(&LoadSpec { rod: above, kind }).unwrap();
    let mut audit = Audit::new();
    for _ in 0..60 {
        let report = world.step_with(1.0 / 60.0, &mut |v| audit.observe(v));
        assert!(report.incidents.is_empty(), "{:?}", report.incidents);
    }
    assert!(audit.report().thread_clearance.unwrap() > -0.05, "{:?}", audit.report().thread_clearance);
    let force: f64 = world.contacts().map(|c| c.force.z.abs()).sum();
    assert!(force > 0.1, "{force}");
}

#[test]
fn what_would_not_come_to_an_end_is_said_to_be_stuck() {
    // Two threads as thick as they are long, side by side: every element of one lies in every element of the other,
    // some twenty thousand contacts.
    let mut world = World::new(Settings::default()).unwrap();
    for y in [0.0, 0.01] {
        let from = DVec3::new(0.0, y, 0.0);
        world.insert_rod(&RodSpec::straight(from, from + DVec3::X * 0.1, 100, 0.05, t1().0)).unwrap();
    }
    let report = world.step(1.0 / 60.0);
    let stuck = |k: &IncidentKind| matches!(k, IncidentKind::Stuck { reason } if *reason == Rejection::TooMuchWork);
    assert!(report.incidents.iter().any(|i| stuck(&i.kind)), "{:?}", report.incidents.first());
    assert!(world.view().rods().all(|r| r.positions().iter().all(|x| x.is_finite())));
}

#[test]
fn an_edge_across_an_element_is_not_passed_between_its_ends_and_its_middle() {
    // A thread of long elements drawn down over the edge of a box, which lies a quarter and less of an element from a
    // particle.
    for quarter in [0.25, 0.15, 0.6, 0.9] {
        let (material, radius) = t1();
        let material = sutura::Material { bend_damping: 0.01, ..material };
        let mut world = World::new(Settings { linear_damping: 0.9, ..Settings::default() }).unwrap();
        let l = 16.0 * radius;
        let from = DVec3::new(-(10.0 + quarter) * l, 0.0, 1.05 * radius);
        let rod =
            world.insert_rod(&RodSpec::straight(from, from + DVec3::X * (20.0 * l), 20, radius, material)).unwrap();
        // The edge is the y axis; the box lies on its side of negative x.
        let half = DVec3::new(0.1, 0.05, 0.05);
        world
            .insert_shape(&ShapeSpec::fixed(
                Geometry::Box { half_sides: half },
                Pose::at(DVec3::new(-half.x, 0.0, -half.z)),
            ))
            .unwrap();
        world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Clamp)).unwrap();
        let kind = LoadKind::Point { place: Place::End, force: DVec3::NEG_Z * 0.05, torque: DVec3::ZERO };
        world.insert_load(&LoadSpec { rod, kind }).unwrap();
        let mut audit = Audit::new();
        for _ in 0..60 {
            world.step_with(1.0 / 60.0, &mut |v| audit.observe(v));
        }
        let report = audit.report();
        assert!(
            !report.passes_through && report.shape_clearance.unwrap() > -0.06,
            "{quarter}: {:?}",
            report.shape_closest
        );
        assert!(
            world.rod(rod).unwrap().positions()[20].z < -5.0 * l,
            "{quarter}: {}",
            world.rod(rod).unwrap().positions()[20]
        );
    }
}
