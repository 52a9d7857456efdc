//! Motions that cannot be followed, and threads that begin inside of something.

use crate::support::{overhand, quiet, t1};
use crate::{DT, assert_finite, assert_usable, step, straight, thread};
use sutura::audit::Audit;
use sutura::glam::{DQuat, DVec3};
use sutura::{
    Geometry, Grip, GripSpec, Handle, Hold, IncidentKind, Material, Place, Pose, RestShape, Rod, RodSpec, Settings,
    ShapeMotion, ShapeSpec, StepReport, Stretch, World,
};

/// Few halvings: being stuck then takes 31 attempts a substep and not 511.
fn hasty() -> Settings {
    Settings { substep: 1.0 / 240.0, halvings: 4, linear_damping: 0.9, angular_damping: 0.9, ..quiet() }
}

/// A loose overhand knot with pins at its ends.
fn knotted() -> (World, Handle<Rod>, [Handle<Grip>; 2]) {
    let radius = 0.25e-3;
    let material = Material { bend_damping: 0.01, ..Material::elastic(2e9, 1150.0) };
    let mut world = World::new(hasty()).unwrap();
    let rod = world.insert_rod(&RodSpec::new(overhand(600.0 * radius, 150), radius, material)).unwrap();
    let pins =
        [Place::Start, Place::End].map(|place| world.insert_grip(&GripSpec::at_once(rod, place, Hold::Pin)).unwrap());
    (world, rod, pins)
}

/// One step that is watched, for a motion that is not to be followed: either the audit finds nothing crossed, or the
/// report says so.
fn audited_step(world: &mut World, dt: f64) -> StepReport {
    let mut audit = Audit::new();
    audit.observe(world.view());
    let report = world.step_with(dt, &mut |view| audit.observe(view));
    assert_finite(world);
    let said = report.incidents.iter().any(|i| matches!(i.kind, IncidentKind::PassedThrough { .. }));
    assert!(!audit.report().passes_through || said, "passed through, and the report says {:?}", report.incidents);
    report
}

#[test]
fn a_pin_that_jumps_through_a_knot() {
    let (mut world, _, pins) = knotted();
    // Tighten a little, so that there is something in the way.
    world.set_settings(Settings { halvings: 8, ..hasty() }).unwrap();
    for _ in 0..6 {
        for (pin, way) in pins.iter().zip([-1.0, 1.0]) {
            let at = world.grip_pose(*pin).unwrap().position;
            let axis =
                (world.grip_pose(pins[1]).unwrap().position - world.grip_pose(pins[0]).unwrap().position).normalize();
            world.set_grip_pose(*pin, Pose::at(at + axis * (way * 1e-3))).unwrap();
        }
        assert!(step(&mut world, DT).incidents.is_empty());
    }
    world.set_settings(hasty()).unwrap();
    let [a, b] = pins.map(|p| world.grip_pose(p).unwrap().position);
    let middle = (a + b) * 0.5;
    world.set_grip_pose(pins[0], Pose::at(a + (middle - a).normalize() * 0.1)).unwrap();
    audited_step(&mut world, DT);
    for pin in pins {
        world.remove_grip(pin).unwrap();
    }
    assert_usable(&mut world, 10, "let go");
}

#[test]
fn a_pin_that_jumps_in_no_time_is_reported() {
    // Ten centimeters in half a millisecond: 200 m/s.
    let (mut world, _, pins) = knotted();
    let at = world.grip_pose(pins[0]).unwrap().position;
    world.set_grip_pose(pins[0], Pose::at(at + DVec3::Y * 0.1)).unwrap();
    let report = audited_step(&mut world, 5e-4);
    let jump = report
        .incidents
        .iter()
        .find_map(|i| if let IncidentKind::Teleport { distance } = i.kind { Some(distance) } else { None });
    assert!(jump.is_some_and(|d| (d - 0.1).abs() < 1e-9), "{:?}", report.incidents);
    for pin in pins {
        world.remove_grip(pin).unwrap();
    }
    assert_usable(&mut world, 10, "let go");
}

#[test]
fn a_clamp_that_jumps_through_a_shape() {
    let across = DQuat::from_rotation_x(core::f64::consts::FRAC_PI_2);
    for (geometry, orientation) in [
        (Geometry::Sphere { radius: 5e-3 }, DQuat::IDENTITY),
        (Geometry::Box { half_sides: DVec3::new(0.05, 0.05, 1e-4) }, DQuat::IDENTITY),
        (Geometry::Cylinder { radius: 5e-3, half_length: 0.05 }, across),
        (
            Geometry::Mesh {
                vertices: vec![DVec3::new(-0.1, -0.1, 0.0), DVec3::new(0.1, -0.1, 0.0), DVec3::new(0.0, 0.1, 0.0)],
                triangles: vec![[0, 1, 2]],
            },
            DQuat::IDENTITY,
        ),
    ] {
        let (mut world, rod) = thread(hasty());
        let shape = world
            .insert_shape(&ShapeSpec::fixed(geometry.clone(), Pose::new(DVec3::NEG_Z * 0.01, orientation)))
            .unwrap();
        let clamp = world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Clamp)).unwrap();
        let pose = world.grip_pose(clamp).unwrap();
        world.set_grip_pose(clamp, Pose::new(pose.position - DVec3::Z * 0.1, pose.orientation)).unwrap();
        let report = audited_step(&mut world, DT);
        // The held particle cannot go through, nor stop: the step cannot be done.
        assert!(!report.incidents.is_empty(), "{geometry:?}: {report:?}");
        world.remove_grip(clamp).unwrap();
        assert_usable(&mut world, 10, &format!("{geometry:?}, let go"));
        world.remove_shape(shape).unwrap();
        assert_usable(&mut world, 2, &format!("{geometry:?}, removed"));
    }
}

#[test]
fn a_shape_that_jumps_onto_a_thread() {
    for (geometry, held) in [
        (Geometry::Sphere { radius: 5e-3 }, false),
        (Geometry::Sphere { radius: 5e-3 }, true),
        (Geometry::Box { half_sides: DVec3::splat(4e-3) }, true),
        (Geometry::Capsule { radius: 2e-3, half_length: 0.02 }, true),
    ] {
        let (mut world, rod) = thread(hasty());
        if held {
            for place in [Place::Start, Place::End] {
                world.insert_grip(&GripSpec::at_once(rod, place, Hold::Clamp)).unwrap();
            }
        }
        let spec = ShapeSpec {
            motion: ShapeMotion::Driven,
            ..ShapeSpec::fixed(geometry.clone(), Pose::at(DVec3::new(0.025, 0.0, 0.1)))
        };
        let shape = world.insert_shape(&spec).unwrap();
        step(&mut world, DT);
        world.set_shape_pose(shape, Pose::at(DVec3::new(0.025, 0.0, 0.0))).unwrap();
        audited_step(&mut world, DT);
        world.remove_shape(shape).unwrap();
        assert_usable(&mut world, 10, &format!("{geometry:?}, held {held}, removed"));
    }
}

#[test]
fn threads_inserted_in_one_another() {
    let (material, radius) = t1();
    // The same place; crossing; half overlapping side by side; end in end.
    let pairs = [
        (DVec3::ZERO, DVec3::X * 0.02),
        (DVec3::new(0.01, -0.01, 0.0), DVec3::new(0.01, 0.01, 0.0)),
        (DVec3::new(0.0, radius, 0.0), DVec3::new(0.02, radius, 0.0)),
        (DVec3::new(0.0199, 0.0, 0.0), DVec3::new(0.04, 0.0, 0.0)),
    ];
    for (from, to) in pairs {
        let mut world = World::new(hasty()).unwrap();
        let spec = |from, to| RodSpec::straight(from, to, 10, radius, material.clone());
        world.insert_rod(&spec(DVec3::ZERO, DVec3::X * 0.02)).unwrap();
        let second = world.insert_rod(&spec(from, to)).unwrap();
        for _ in 0..5 {
            step(&mut world, DT);
        }
        world.remove_rod(second).unwrap();
        assert_usable(&mut world, 5, &format!("{from} to {to}, the second removed"));
    }
}

#[test]
fn a_thread_that_runs_back_into_itself() {
    let (material, radius) = t1();
    let ring: Vec<DVec3> = (0..=24)
        .map(|i| DQuat::from_rotation_z(core::f64::consts::TAU * f64::from(i) / 24.0) * DVec3::X * 5e-3)
        .collect();
    let there_and_back: Vec<DVec3> = (0..=20i32).map(|i| DVec3::X * (1e-3 * f64::from(10 - (i - 10).abs()))).collect();
    for (what, points) in [("closed ring", ring), ("there and back", there_and_back)] {
        for rest in [RestShape::Straight, RestShape::AsInserted] {
            let mut world = World::new(hasty()).unwrap();
            let Ok(rod) = world.insert_rod(&RodSpec { rest, ..RodSpec::new(points.clone(), radius, material.clone()) })
            else {
                continue;
            };
            for _ in 0..5 {
                step(&mut world, DT);
            }
            world.remove_rod(rod).unwrap();
            world.insert_rod(&straight()).unwrap();
            assert_usable(&mut world, 5, what);
        }
    }
}

#[test]
fn a_thread_inserted_in_a_shape() {
    for geometry in [
        Geometry::Sphere { radius: 0.1 },
        Geometry::Sphere { radius: 2e-3 },
        Geometry::Box { half_sides: DVec3::splat(0.06) },
        Geometry::Cylinder { radius: 5e-3, half_length: 0.05 },
        Geometry::Capsule { radius: 5e-3, half_length: 0.05 },
        Geometry::Plane,
    ] {
        let mut world = World::new(hasty()).unwrap();
        let pose = if geometry == Geometry::Plane { Pose::at(DVec3::Z * 1e-3) } else { Pose::IDENTITY };
        let shape = world.insert_shape(&ShapeSpec::fixed(geometry.clone(), pose)).unwrap();
        world.insert_rod(&straight()).unwrap();
        for _ in 0..5 {
            step(&mut world, DT);
        }
        world.remove_shape(shape).unwrap();
        assert_usable(&mut world, 5, &format!("{geometry:?} removed"));
    }
}

#[test]
fn an_inextensible_thread_pulled_beyond_its_length() {
    for hold in [Hold::Pin, Hold::Clamp, Hold::Jaw] {
        for by in [1e-4, 1e-2, 0.1] {
            let (material, radius) = t1();
            let mut world = World::new(hasty()).unwrap();
            let spec = RodSpec {
                stretch: Stretch::Inextensible,
                ..RodSpec::straight(DVec3::ZERO, DVec3::X * 0.05, 20, radius, material)
            };
            let rod = world.insert_rod(&spec).unwrap();
            world.insert_grip(&GripSpec::at_once(rod, Place::Start, hold)).unwrap();
            let end = world.insert_grip(&GripSpec::at_once(rod, Place::End, hold)).unwrap();
            let pose = world.grip_pose(end).unwrap();
            world.set_grip_pose(end, Pose::new(pose.position + DVec3::X * by, pose.orientation)).unwrap();
            let mut incidents = 0;
            for _ in 0..3 {
                incidents += step(&mut world, DT).incidents.len();
            }
            assert!(
                incidents > 0,
                "{hold:?} by {by}: the thread is longer by {}",
                world.rod(rod).unwrap().max_elongation()
            );
            world.remove_grip(end).unwrap();
            for _ in 0..10 {
                step(&mut world, DT);
            }
            assert_usable(&mut world, 10, &format!("{hold:?} by {by}, let go"));
            let left = world.rod(rod).unwrap().max_elongation();
            assert!(left < 1e-4, "{hold:?} by {by}: let go, it is still longer by {left:e}");
        }
    }
}

#[test]
fn grips_that_pull_an_elastic_thread_to_twice_its_length() {
    let (mut world, rod) = thread(hasty());
    world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Clamp)).unwrap();
    let end = world.insert_grip(&GripSpec::at_once(rod, Place::End, Hold::Clamp)).unwrap();
    let pose = world.grip_pose(end).unwrap();
    world.set_grip_pose(end, Pose::new(pose.position + DVec3::X * 0.05, pose.orientation)).unwrap();
    for _ in 0..3 {
        step(&mut world, DT);
    }
    // Twice the length is a strain of one, whatever the material says to that: EA.
    let view = world.rod(rod).unwrap();
    assert!((view.max_tension() / view.axial_stiffness(0) - 1.0).abs() < 1e-2, "{}", view.max_tension());
    world.remove_grip(end).unwrap();
    assert_usable(&mut world, 20, "let go");
}

#[test]
fn a_clamp_turned_by_half_a_turn_at_once() {
    for axis in [DVec3::X, DVec3::Y] {
        let (mut world, rod) = thread(hasty());
        let clamp = world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Clamp)).unwrap();
        let pose = world.grip_pose(clamp).unwrap();
        let turn = DQuat::from_axis_angle(axis, core::f64::consts::PI);
        world.set_grip_pose(clamp, Pose::new(pose.position, (turn * pose.orientation).normalize())).unwrap();
        step(&mut world, 1e-3);
        world.remove_grip(clamp).unwrap();
        assert_usable(&mut world, 10, "let go");
    }
}
