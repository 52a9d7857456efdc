//! Constructors, setters and handles: an error names the field, and changes nothing.

use crate::support::t1;
use crate::{DT, INF, NAN, assert_usable, point, step, straight, thread};
use sutura::glam::{DQuat, DVec3};
use sutura::{
    Closure, Drive, Error, Friction, Geometry, GripSpec, Hold, LoadKind, LoadSpec, Material, Place, Plasticity, Pose,
    Profile, RestShape, RodSpec, Section, Settings, ShapeMotion, ShapeSpec, Shear, World,
};

/// An error of the kind that names a field, and the field.
fn invalid<T>(result: Result<T, Error>) -> String {
    match result {
        Err(Error::Invalid { field, .. }) => field,
        Err(other) => panic!("another error: {other}"),
        Ok(_) => panic!("it was taken"),
    }
}

fn stale<T>(result: Result<T, Error>) {
    match result {
        Err(Error::StaleHandle { .. }) => {}
        Err(other) => panic!("another error: {other}"),
        Ok(_) => panic!("it was taken"),
    }
}

#[test]
fn settings_out_of_range() {
    let plain = Settings::default;
    let bad = [
        ("gravity", Settings { gravity: DVec3::new(0.0, NAN, 0.0), ..plain() }),
        ("gravity", Settings { gravity: DVec3::new(0.0, 0.0, -INF), ..plain() }),
        ("substep", Settings { substep: 0.0, ..plain() }),
        ("substep", Settings { substep: -1e-3, ..plain() }),
        ("substep", Settings { substep: NAN, ..plain() }),
        ("substep", Settings { substep: INF, ..plain() }),
        ("newton_max", Settings { newton_max: 0, ..plain() }),
        ("tolerance", Settings { tolerance: 0.0, ..plain() }),
        ("tolerance", Settings { tolerance: 1.0, ..plain() }),
        ("tolerance", Settings { tolerance: NAN, ..plain() }),
        ("linear_damping", Settings { linear_damping: 1.0, ..plain() }),
        ("linear_damping", Settings { linear_damping: -0.1, ..plain() }),
        ("linear_damping", Settings { linear_damping: NAN, ..plain() }),
        ("angular_damping", Settings { angular_damping: 1.0, ..plain() }),
        ("angular_damping", Settings { angular_damping: -0.1, ..plain() }),
        ("angular_damping", Settings { angular_damping: NAN, ..plain() }),
        ("halvings", Settings { halvings: 13, ..plain() }),
        ("stick", Settings { friction: Friction { stick: -0.1, slide: 0.0 }, ..plain() }),
    ];
    for (field, settings) in bad {
        assert_eq!(invalid(World::new(settings.clone())), field);
        let (mut world, _) = thread(Settings::default());
        assert_eq!(invalid(world.set_settings(settings)), field);
        assert_eq!(*world.settings(), Settings::default(), "an error changes nothing");
        assert_usable(&mut world, 1, field);
    }
}

#[test]
fn friction_out_of_range() {
    let (mut world, _) = thread(Settings::default());
    for (field, stick, slide) in [
        ("stick", -0.1, -0.2),
        ("stick", NAN, 0.0),
        ("stick", INF, 0.0),
        ("slide", 0.3, 0.4),
        ("slide", 0.3, -0.1),
        ("slide", 0.3, NAN),
    ] {
        assert_eq!(invalid(world.set_friction(0, 1, Friction { stick, slide })), field);
    }
}

#[test]
fn threads_that_cannot_be() {
    let (material, _) = t1();
    let with = |change: &dyn Fn(&mut RodSpec)| {
        let mut spec = straight();
        change(&mut spec);
        spec
    };
    let made_of = |change: &dyn Fn(&mut Material)| {
        let mut material = material.clone();
        change(&mut material);
        RodSpec { material, ..straight() }
    };
    let plastic = |yield_curvature, yield_twist, hardening| {
        made_of(&|m| m.plasticity = Some(Plasticity { yield_curvature, yield_twist, hardening }))
    };
    let mut bad = vec![
        ("centerline", with(&|s| s.centerline.clear())),
        ("centerline", with(&|s| s.centerline.truncate(1))),
        ("centerline[3]", with(&|s| s.centerline[3].y = NAN)),
        ("centerline[20]", with(&|s| s.centerline[20].x = INF)),
        // A repeated point, and one that is nearly the same.
        ("centerline[6..7]", with(&|s| s.centerline[7] = s.centerline[6])),
        ("centerline[6..7]", with(&|s| s.centerline[7] = s.centerline[6] + DVec3::Y * 1e-8)),
        ("centerline[0..1]", with(&|s| s.centerline = vec![DVec3::ZERO; 5])),
        ("frames", with(&|s| s.frames = Some(vec![DQuat::IDENTITY; 3]))),
        ("frames[0]", with(&|s| s.frames = Some(vec![DQuat::IDENTITY; 20]))),
        ("frames[0]", with(&|s| s.frames = Some(vec![DQuat::from_xyzw(NAN, 0.0, 0.0, 1.0); 20]))),
        ("frames[0]", with(&|s| s.frames = Some(vec![DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0); 20]))),
        ("rest.lengths", with(&|s| s.rest = RestShape::Given { lengths: Some(vec![1e-3; 19]), darboux: None })),
        ("rest.darboux", with(&|s| s.rest = RestShape::Given { lengths: None, darboux: Some(vec![DVec3::ZERO; 20]) })),
        (
            "rest.darboux[0]",
            with(&|s| s.rest = RestShape::Given { lengths: None, darboux: Some(vec![DVec3::X * 1e6; 19]) }),
        ),
        (
            "rest.darboux[0]",
            with(&|s| s.rest = RestShape::Given { lengths: None, darboux: Some(vec![DVec3::splat(NAN); 19]) }),
        ),
    ];
    bad.push(("along.size[1]", with(&|s| s.along.size = Profile(vec![(0.1, 1.0), (0.1, 1.0)]))));
    bad.push(("pretwist", with(&|s| s.pretwist = 1e6)));
    for x in [NAN, INF] {
        bad.push(("roll", with(&|s| s.roll = x)));
        bad.push(("pretwist", with(&|s| s.pretwist = x)));
        bad.push(("along.size[0]", with(&|s| s.along.size = Profile(vec![(x, 1.0)]))));
    }
    for x in [0.0, -1.0, NAN, INF] {
        bad.push(("section", with(&|s| s.section = Section::Ellipse([1e-4, x]))));
        bad.push(("section", with(&|s| s.section = Section::Rectangle([x, 1e-4]))));
        bad.push(("along.size[0]", with(&|s| s.along.size = Profile(vec![(0.0, x)]))));
        bad.push(("along.modulus[0]", with(&|s| s.along.modulus = Profile(vec![(0.0, x)]))));
        bad.push(("along.density[0]", with(&|s| s.along.density = Profile(vec![(0.0, x)]))));
        bad.push(("radius", with(&|s| s.radius = x)));
        bad.push((
            "rest.lengths[0]",
            with(&|s| s.rest = RestShape::Given { lengths: Some(vec![x; 20]), darboux: None }),
        ));
        bad.push(("young_modulus", made_of(&|m| m.young_modulus = x)));
        bad.push(("density", made_of(&|m| m.density = x)));
        bad.push(("shear_modulus", made_of(&|m| m.shear = Shear::Modulus(x))));
        bad.push(("bend_scale", made_of(&|m| m.bend_scale = x)));
        bad.push(("yield_curvature", plastic(x, 1.0, 0.0)));
        bad.push(("yield_twist", plastic(1.0, x, 0.0)));
    }
    for x in [-1.0, NAN, INF] {
        bad.push(("bend_damping", made_of(&|m| m.bend_damping = x)));
        bad.push(("hardening", plastic(1.0, 1.0, x)));
        bad.push(("poisson_ratio", made_of(&|m| m.shear = Shear::Poisson(x))));
    }
    bad.push(("hardening", plastic(1.0, 1.0, 1.0)));
    bad.push(("bend_scale", made_of(&|m| m.bend_scale = 1.1)));
    bad.push(("poisson_ratio", made_of(&|m| m.shear = Shear::Poisson(0.51))));
    let (mut world, _) = thread(Settings::default());
    let before = world.state_hash();
    for (field, spec) in bad {
        assert_eq!(invalid(world.insert_rod(&spec)), field, "{spec:?}");
        assert_eq!(world.state_hash(), before, "an error changes nothing");
    }
    assert_usable(&mut world, 2, "after the errors");
}

#[test]
fn a_closed_thread_that_turns_back_on_itself() {
    let (material, radius) = t1();
    let (mut world, _) = thread(Settings::default());
    let closed = |centerline: Vec<DVec3>| RodSpec {
        closure: Some(Closure::default()),
        ..RodSpec::new(centerline, radius, material.clone())
    };
    // A line: back from its end through all of it. A fold in a ring.
    let line: Vec<DVec3> = (0..=20).map(|i| DVec3::X * (0.0025 * f64::from(i))).collect();
    assert_eq!(invalid(world.insert_rod(&closed(line))), "centerline[20]");
    let mut ring = RodSpec::ring(DVec3::ZERO, DVec3::Z, DVec3::X * 0.02, 24, radius, material.clone()).centerline;
    assert!(world.insert_rod(&closed(ring.clone())).is_ok());
    ring[7] = ring[5].lerp(ring[6], 0.5);
    assert_eq!(invalid(world.insert_rod(&closed(ring))), "centerline[6]");
}

#[test]
fn shapes_that_cannot_be() {
    let (mut world, _) = thread(Settings::default());
    let mut bad = Vec::new();
    for x in [0.0, -1.0, NAN, INF] {
        bad.push(("radius", Geometry::Sphere { radius: x }));
        bad.push(("radius", Geometry::Capsule { radius: x, half_length: 1.0 }));
        bad.push(("half_length", Geometry::Capsule { radius: 1.0, half_length: x }));
        bad.push(("radius", Geometry::Cylinder { radius: x, half_length: 1.0 }));
        bad.push(("half_length", Geometry::Cylinder { radius: 1.0, half_length: x }));
        bad.push(("half_sides.y", Geometry::Box { half_sides: DVec3::new(1.0, x, 1.0) }));
    }
    let corners = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
    bad.push(("triangles", Geometry::Mesh { vertices: corners.clone(), triangles: vec![] }));
    bad.push(("triangles[0]", Geometry::Mesh { vertices: corners.clone(), triangles: vec![[0, 1, 3]] }));
    bad.push(("triangles[0]", Geometry::Mesh { vertices: corners.clone(), triangles: vec![[0, 1, 1]] }));
    bad.push((
        "triangles[0]",
        Geometry::Mesh { vertices: vec![DVec3::ZERO, DVec3::X, DVec3::X * 2.0], triangles: vec![[0, 1, 2]] },
    ));
    bad.push((
        "vertices[1]",
        Geometry::Mesh { vertices: vec![DVec3::ZERO, DVec3::splat(NAN), DVec3::Y], triangles: vec![[0, 1, 2]] },
    ));
    for (field, geometry) in bad {
        assert_eq!(invalid(world.insert_shape(&ShapeSpec::fixed(geometry, Pose::IDENTITY))), field);
    }
    for pose in bad_poses() {
        assert_eq!(invalid(world.insert_shape(&ShapeSpec::fixed(Geometry::Plane, pose))), "pose");
    }
    let fixed =
        world.insert_shape(&ShapeSpec::fixed(Geometry::Sphere { radius: 1e-3 }, Pose::at(DVec3::Z * 0.1))).unwrap();
    assert_eq!(invalid(world.set_shape_pose(fixed, Pose::IDENTITY)), "motion");
    for (field, motion) in [
        ("motion.force", ShapeMotion::Pushed { direction: DVec3::X, force: NAN, speed_limit: 1.0 }),
        ("motion.force", ShapeMotion::Pushed { direction: DVec3::X, force: -1.0, speed_limit: 1.0 }),
        ("motion.speed_limit", ShapeMotion::Pushed { direction: DVec3::X, force: 1.0, speed_limit: 0.0 }),
        ("motion.direction", ShapeMotion::Pushed { direction: DVec3::ZERO, force: 1.0, speed_limit: 1.0 }),
        ("motion.direction", ShapeMotion::Pushed { direction: DVec3::splat(NAN), force: 1.0, speed_limit: 1.0 }),
    ] {
        assert_eq!(invalid(world.set_shape_motion(fixed, motion)), field);
        assert_eq!(
            invalid(world.insert_shape(&ShapeSpec { motion, ..ShapeSpec::fixed(Geometry::Plane, Pose::IDENTITY) })),
            field
        );
    }
    world.set_shape_motion(fixed, ShapeMotion::Driven).unwrap();
    for pose in bad_poses() {
        assert_eq!(invalid(world.set_shape_pose(fixed, pose)), "pose");
    }
    assert_usable(&mut world, 2, "after the errors");
}

fn bad_poses() -> [Pose; 5] {
    [
        Pose::at(DVec3::new(NAN, 0.0, 0.0)),
        Pose::at(DVec3::new(0.0, INF, 0.0)),
        Pose::new(DVec3::ZERO, DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0)),
        Pose::new(DVec3::ZERO, DQuat::from_xyzw(NAN, 0.0, 0.0, 1.0)),
        Pose::new(DVec3::ZERO, DQuat::from_xyzw(0.0, 0.0, 0.0, 2.0)),
    ]
}

#[test]
fn grips_that_cannot_be() {
    let (mut world, rod) = thread(Settings::default());
    for (field, place) in [
        ("place.particle", Place::Particle(21)),
        ("place.particle", Place::Particle(u32::MAX)),
        ("place.element", Place::Element(20)),
        ("place.element", Place::Element(u32::MAX)),
        ("place.arc", Place::Arc(NAN)),
        ("place.arc", Place::Arc(-1e-3)),
        ("place.arc", Place::Arc(0.051)),
        ("place.arc", Place::Arc(INF)),
    ] {
        for hold in [Hold::Pin, Hold::Clamp, Hold::Jaw] {
            assert_eq!(invalid(world.insert_grip(&GripSpec::new(rod, place, hold))), field);
        }
        assert_eq!(invalid(world.insert_load(&LoadSpec { rod, kind: point(place, DVec3::ZERO) })), field);
    }
    for ramp in [NAN, INF, -0.1] {
        assert_eq!(
            invalid(world.insert_grip(&GripSpec { ramp, ..GripSpec::new(rod, Place::Start, Hold::Pin) })),
            "ramp"
        );
    }
    let grip = world.insert_grip(&GripSpec::new(rod, Place::Start, Hold::Jaw)).unwrap();
    // What one grip holds no other can: the jaw has both particles.
    for place in [Place::Start, Place::Particle(1), Place::Arc(0.0)] {
        assert_eq!(invalid(world.insert_grip(&GripSpec::new(rod, place, Hold::Pin))), "place");
    }
    for (field, drive) in [
        ("drive.force", Drive::Force { direction: DVec3::X, force: NAN, speed_limit: 1.0 }),
        ("drive.force", Drive::Force { direction: DVec3::X, force: -1.0, speed_limit: 1.0 }),
        ("drive.speed_limit", Drive::Force { direction: DVec3::X, force: 1.0, speed_limit: 0.0 }),
        ("drive.speed_limit", Drive::Force { direction: DVec3::X, force: 1.0, speed_limit: INF }),
        ("drive.direction", Drive::Force { direction: DVec3::ZERO, force: 1.0, speed_limit: 1.0 }),
        ("drive.direction", Drive::Force { direction: DVec3::splat(1.0), force: 1.0, speed_limit: 1.0 }),
        ("drive.direction", Drive::Force { direction: DVec3::splat(NAN), force: 1.0, speed_limit: 1.0 }),
    ] {
        assert_eq!(invalid(world.set_grip_drive(grip, drive)), field);
        assert_eq!(invalid(world.insert_grip(&GripSpec { drive, ..GripSpec::new(rod, Place::End, Hold::Pin) })), field);
    }
    for pose in bad_poses() {
        assert_eq!(invalid(world.set_grip_pose(grip, pose)), "pose");
    }
    world.set_grip_drive(grip, Drive::Force { direction: DVec3::X, force: 0.1, speed_limit: 0.1 }).unwrap();
    assert_eq!(invalid(world.set_grip_pose(grip, Pose::IDENTITY)), "drive");
    assert_usable(&mut world, 2, "after the errors");
}

#[test]
fn loads_that_cannot_be() {
    let (mut world, rod) = thread(Settings::default());
    let load = world.insert_load(&LoadSpec { rod, kind: point(Place::End, DVec3::ZERO) }).unwrap();
    let place = Place::End;
    for (field, kind) in [
        ("force", point(place, DVec3::new(NAN, 0.0, 0.0))),
        ("force", point(place, DVec3::new(INF, 0.0, 0.0))),
        ("torque", LoadKind::Point { place, force: DVec3::ZERO, torque: DVec3::splat(NAN) }),
        ("force_per_length", LoadKind::Uniform { force_per_length: DVec3::splat(INF) }),
        ("mass", LoadKind::Mass { place, mass: -1.0, inertia: DVec3::ZERO }),
        ("mass", LoadKind::Mass { place, mass: NAN, inertia: DVec3::ZERO }),
        ("inertia", LoadKind::Mass { place, mass: 0.0, inertia: DVec3::new(0.0, -1.0, 0.0) }),
        ("inertia", LoadKind::Mass { place, mass: 0.0, inertia: DVec3::new(0.0, NAN, 0.0) }),
        ("place.particle", point(Place::Particle(22), DVec3::ZERO)),
        ("place.element", LoadKind::Mass { place: Place::Element(20), mass: 1e-3, inertia: DVec3::ZERO }),
    ] {
        assert_eq!(invalid(world.insert_load(&LoadSpec { rod, kind })), field);
        assert_eq!(invalid(world.set_load(load, kind)), field);
    }
    assert_usable(&mut world, 2, "after the errors");
}

#[test]
fn handles_of_what_is_gone() {
    let (mut world, rod) = thread(Settings::default());
    let grip = world.insert_grip(&GripSpec::new(rod, Place::Start, Hold::Pin)).unwrap();
    let load = world.insert_load(&LoadSpec { rod, kind: point(Place::End, DVec3::X) }).unwrap();
    let sphere = ShapeSpec {
        motion: ShapeMotion::Driven,
        ..ShapeSpec::fixed(Geometry::Sphere { radius: 1e-3 }, Pose::at(DVec3::Z * 0.1))
    };
    let shape = world.insert_shape(&sphere).unwrap();
    world.step(DT);
    world.remove_rod(rod).unwrap();
    world.remove_shape(shape).unwrap();
    let check = |world: &mut World| {
        stale(world.rod(rod).map(|_| ()));
        stale(world.remove_rod(rod));
        stale(world.insert_grip(&GripSpec::new(rod, Place::Start, Hold::Pin)));
        stale(world.insert_load(&LoadSpec { rod, kind: point(Place::Start, DVec3::ZERO) }));
        stale(world.remove_grip(grip));
        stale(world.set_grip_pose(grip, Pose::IDENTITY));
        stale(world.set_grip_drive(grip, Drive::Pose));
        stale(world.grip_pose(grip));
        stale(world.grip_wrench(grip));
        stale(world.set_load(load, point(Place::Start, DVec3::ZERO)));
        stale(world.remove_load(load));
        stale(world.shape(shape).map(|_| ()));
        stale(world.remove_shape(shape));
        stale(world.set_shape_pose(shape, Pose::IDENTITY));
        stale(world.set_shape_motion(shape, ShapeMotion::Fixed));
        stale(world.shape_wrench(shape));
    };
    check(&mut world);
    assert_usable(&mut world, 1, "an empty world");
    // The same slots again: the old handles stay stale.
    let again = world.insert_rod(&straight()).unwrap();
    world.insert_grip(&GripSpec::new(again, Place::Start, Hold::Pin)).unwrap();
    world.insert_load(&LoadSpec { rod: again, kind: point(Place::End, DVec3::X * 1e-3) }).unwrap();
    world.insert_shape(&sphere).unwrap();
    check(&mut world);
    assert_usable(&mut world, 3, "slots used again");
}

#[test]
fn removing_a_thread_leaves_the_others_as_they_are() {
    let (material, radius) = t1();
    let mut world = World::new(Settings::default()).unwrap();
    let mut rods = Vec::new();
    for k in 0..3 {
        let from = DVec3::Y * (0.01 * f64::from(k));
        let rod = world
            .insert_rod(&RodSpec::straight(from, from + DVec3::X * 0.03, 10 + 3 * k as usize, radius, material.clone()))
            .unwrap();
        let grip = world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Clamp)).unwrap();
        rods.push((rod, grip));
    }
    for _ in 0..10 {
        step(&mut world, DT);
    }
    let last = world.rod(rods[2].0).unwrap().positions().to_vec();
    world.remove_rod(rods[0].0).unwrap();
    world.remove_rod(rods[1].0).unwrap();
    assert_eq!(world.rod(rods[2].0).unwrap().positions(), last);
    assert_usable(&mut world, 10, "two of three removed");
    assert!(world.grip_wrench(rods[2].1).unwrap().force.is_finite());
}
