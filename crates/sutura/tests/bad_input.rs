//! Whatever a world is given: an error that says what was wrong, or an incident in the report; never a panic, a hang, or a number that is
//! not finite; and afterwards a world that can still be used.

mod support;

use proptest::prelude::*;
use support::{overhand, quiet, t1};
use sutura::audit::Audit;
use sutura::glam::{DQuat, DVec3};
use sutura::{
    Drive, Error, Friction, Geometry, Grip, GripSpec, Handle, Hold, IncidentKind, LoadKind, LoadSpec, Material, Place, Plasticity, Pose, RestShape, Rod,
    RodSpec, Settings, ShapeMotion, ShapeSpec, Shear, StepReport, Stretch, World,
};

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

/// Everything that can be read is finite.
#[track_caller]
fn assert_finite(world: &World) {
    assert!(world.time().is_finite());
    for rod in world.view().rods() {
        let vectors = rod.positions().iter().chain(rod.velocities()).chain(rod.angular_velocities());
        assert!(vectors.into_iter().all(|v| v.is_finite()), "a position or velocity is not finite");
        assert!(rod.orientations().iter().all(|q| q.is_finite() && (q.length() - 1.0).abs() < 1e-6), "a frame is not a rotation");
        assert!((0..rod.n_elements()).all(|e| rod.internal_force(e).is_finite()), "a force is not finite");
    }
    assert!(world.view().shapes().all(|s| s.pose.position.is_finite() && s.pose.orientation.is_finite()));
    assert!(world.contacts().all(|c| c.force.is_finite() && c.point.is_finite() && c.normal.is_finite()), "a contact force is not finite");
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
    !report.incidents.iter().any(|i| matches!(i.kind, IncidentKind::Stuck { .. } | IncidentKind::NotFinite | IncidentKind::BadInput { .. }))
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

// Constructors and setters.

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
    for (field, stick, slide) in
        [("stick", -0.1, -0.2), ("stick", NAN, 0.0), ("stick", INF, 0.0), ("slide", 0.3, 0.4), ("slide", 0.3, -0.1), ("slide", 0.3, NAN)]
    {
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
    let plastic = |yield_curvature, yield_twist, hardening| made_of(&|m| m.plasticity = Some(Plasticity { yield_curvature, yield_twist, hardening }));
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
        ("rest.darboux[0]", with(&|s| s.rest = RestShape::Given { lengths: None, darboux: Some(vec![DVec3::X * 1e6; 19]) })),
        ("rest.darboux[0]", with(&|s| s.rest = RestShape::Given { lengths: None, darboux: Some(vec![DVec3::splat(NAN); 19]) })),
    ];
    for x in [0.0, -1.0, NAN, INF] {
        bad.push(("radius", with(&|s| s.radius = x)));
        bad.push(("rest.lengths[0]", with(&|s| s.rest = RestShape::Given { lengths: Some(vec![x; 20]), darboux: None })));
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
    bad.push(("triangles[0]", Geometry::Mesh { vertices: vec![DVec3::ZERO, DVec3::X, DVec3::X * 2.0], triangles: vec![[0, 1, 2]] }));
    bad.push(("vertices[1]", Geometry::Mesh { vertices: vec![DVec3::ZERO, DVec3::splat(NAN), DVec3::Y], triangles: vec![[0, 1, 2]] }));
    for (field, geometry) in bad {
        assert_eq!(invalid(world.insert_shape(&ShapeSpec::fixed(geometry, Pose::IDENTITY))), field);
    }
    for pose in bad_poses() {
        assert_eq!(invalid(world.insert_shape(&ShapeSpec::fixed(Geometry::Plane, pose))), "pose");
    }
    let fixed = world.insert_shape(&ShapeSpec::fixed(Geometry::Sphere { radius: 1e-3 }, Pose::at(DVec3::Z * 0.1))).unwrap();
    assert_eq!(invalid(world.set_shape_pose(fixed, Pose::IDENTITY)), "motion");
    for (field, motion) in [
        ("motion.force", ShapeMotion::Pushed { direction: DVec3::X, force: NAN, speed_limit: 1.0 }),
        ("motion.force", ShapeMotion::Pushed { direction: DVec3::X, force: -1.0, speed_limit: 1.0 }),
        ("motion.speed_limit", ShapeMotion::Pushed { direction: DVec3::X, force: 1.0, speed_limit: 0.0 }),
        ("motion.direction", ShapeMotion::Pushed { direction: DVec3::ZERO, force: 1.0, speed_limit: 1.0 }),
        ("motion.direction", ShapeMotion::Pushed { direction: DVec3::splat(NAN), force: 1.0, speed_limit: 1.0 }),
    ] {
        assert_eq!(invalid(world.set_shape_motion(fixed, motion)), field);
        assert_eq!(invalid(world.insert_shape(&ShapeSpec { motion, ..ShapeSpec::fixed(Geometry::Plane, Pose::IDENTITY) })), field);
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
        assert_eq!(invalid(world.insert_grip(&GripSpec { ramp, ..GripSpec::new(rod, Place::Start, Hold::Pin) })), "ramp");
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

fn point(place: Place, force: DVec3) -> LoadKind {
    LoadKind::Point { place, force, torque: DVec3::ZERO }
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
    let sphere = ShapeSpec { motion: ShapeMotion::Driven, ..ShapeSpec::fixed(Geometry::Sphere { radius: 1e-3 }, Pose::at(DVec3::Z * 0.1)) };
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
        let rod = world.insert_rod(&RodSpec::straight(from, from + DVec3::X * 0.03, 10 + 3 * k as usize, radius, material.clone())).unwrap();
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

// Time steps.

#[test]
fn time_steps_that_are_none() {
    let (mut world, _) = thread(Settings::default());
    step(&mut world, DT);
    let before = world.state_hash();
    for dt in [0.0, -0.0, -DT, NAN, INF, -INF] {
        let report = world.step(dt);
        assert!(matches!(report.incidents[..], [ref i] if matches!(i.kind, IncidentKind::BadInput { .. })), "{dt}: {report:?}");
        assert_eq!((report.substeps, report.newton_iterations, world.state_hash()), (0, 0, before), "{dt}");
    }
    assert_usable(&mut world, 2, "after them");
}

#[test]
fn time_steps_that_are_tiny() {
    for dt in [1e-9, 1e-15, 1e-100, f64::MIN_POSITIVE, 5e-324] {
        let (mut world, rod) = thread(Settings::default());
        world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Clamp)).unwrap();
        step(&mut world, DT);
        step(&mut world, dt);
        assert_usable(&mut world, 3, &format!("dt {dt:e}"));
    }
}

/// A step that is not done for good, and says so, is stopped by the observer of this test after this many substeps.
const MANY: u32 = 20_000;

#[test]
fn time_steps_that_are_huge() {
    for (dt, substep) in [(1e9, 1.0 / 240.0), (1e300, 1.0 / 240.0), (DT, 1e-300)] {
        let (mut world, _) = thread(Settings { substep, gravity: DVec3::ZERO, ..Settings::default() });
        let mut substeps = 0;
        let report = world.step_with(dt, &mut |_| {
            substeps += 1;
            assert!(substeps < MANY, "dt {dt:e}, substep {substep:e}: {MANY} substeps and no end");
        });
        assert!(!report.incidents.is_empty(), "{report:?}");
        assert_finite(&world);
    }
}

#[test]
fn a_long_substep() {
    // A substep as long as the step, a thread held at one end that falls for ten seconds at once.
    for substep in [1.0, 10.0, 1e6] {
        let (mut world, rod) = thread(Settings { substep, ..Settings::default() });
        world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Pin)).unwrap();
        for _ in 0..3 {
            step(&mut world, substep.min(1e4));
        }
        world.set_settings(Settings::default()).unwrap();
        assert_usable(&mut world, 5, &format!("substep {substep:e}"));
    }
}

// Numbers that are finite and absurd.

/// Steps a world that was built with absurd numbers; an error at building is as good.
fn absurd(what: &str, build: impl FnOnce(&mut World) -> Result<(), Error>) {
    let mut world = World::new(Settings { halvings: 3, ..Settings::default() }).unwrap();
    if build(&mut world).is_err() {
        return;
    }
    for _ in 0..3 {
        let report = step(&mut world, DT);
        assert!(report.converged || !report.incidents.is_empty(), "{what}: {report:?}");
    }
}

#[test]
fn absurd_threads() {
    let (material, radius) = t1();
    for x in [1e-300, 1e-150, 1e-30, 1e30, 1e150, 1e300] {
        let spec = |points: Vec<DVec3>, radius: f64, material: &Material| RodSpec::new(points, radius, material.clone());
        let points = |l: f64| (0..=4).map(|i| DVec3::X * (l * f64::from(i) / 4.0)).collect::<Vec<_>>();
        let insert = |s: RodSpec| move |w: &mut World| w.insert_rod(&s).map(|_| ());
        absurd(&format!("radius {x:e}"), insert(spec(points(0.01), x, &material)));
        absurd(&format!("length {x:e}"), insert(spec(points(x), radius, &material)));
        absurd(&format!("all lengths {x:e}"), insert(spec(points(x), 0.01 * x, &material)));
        absurd(&format!("density {x:e}"), insert(spec(points(0.01), radius, &Material { density: x, ..material.clone() })));
        absurd(&format!("modulus {x:e}"), insert(spec(points(0.01), radius, &Material { young_modulus: x, ..material.clone() })));
        absurd(&format!("shear modulus {x:e}"), insert(spec(points(0.01), radius, &Material { shear: Shear::Modulus(x), ..material.clone() })));
        absurd(&format!("damping {x:e}"), insert(spec(points(0.01), radius, &Material { bend_damping: x, ..material.clone() })));
        let far: Vec<DVec3> = points(0.01).iter().map(|p| *p + DVec3::Y * x).collect();
        absurd(&format!("{x:e} away"), insert(spec(far, radius, &material)));
        let crossing = points(x).iter().map(|p| DVec3::new(0.5 * x, p.x - 0.5 * x, 0.0)).collect::<Vec<_>>();
        let two = [spec(points(x), 0.01 * x, &material), spec(crossing, 0.01 * x, &material)];
        absurd(&format!("two that cross, all lengths {x:e}"), move |w| two.iter().try_for_each(|s| w.insert_rod(s).map(|_| ())));
        let lengths = RestShape::Given { lengths: Some(vec![x; 4]), darboux: None };
        absurd(&format!("rest length {x:e}"), insert(RodSpec { rest: lengths, ..spec(points(0.01), radius, &material) }));
    }
}

#[test]
fn absurd_loads_and_grips() {
    for x in [1e-300, 1e-30, 1e6, 1e30, 1e150, 1e300] {
        let on = |kind: LoadKind| {
            move |w: &mut World| {
                let rod = w.insert_rod(&straight())?;
                w.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Clamp))?;
                w.insert_load(&LoadSpec { rod, kind }).map(|_| ())
            }
        };
        let place = Place::End;
        absurd(&format!("force {x:e}"), on(point(place, DVec3::Z * x)));
        absurd(&format!("torque {x:e}"), on(LoadKind::Point { place, force: DVec3::ZERO, torque: DVec3::Y * x }));
        absurd(&format!("force per length {x:e}"), on(LoadKind::Uniform { force_per_length: DVec3::Z * x }));
        absurd(&format!("mass {x:e}"), on(LoadKind::Mass { place, mass: x, inertia: DVec3::ZERO }));
        absurd(&format!("inertia {x:e}"), on(LoadKind::Mass { place, mass: 0.0, inertia: DVec3::splat(x) }));
        absurd(&format!("gravity {x:e}"), move |w| {
            w.set_settings(Settings { gravity: DVec3::NEG_Z * x, ..w.settings().clone() })?;
            w.insert_rod(&straight()).map(|_| ())
        });
        for hold in [Hold::Pin, Hold::Clamp, Hold::Jaw] {
            absurd(&format!("{hold:?} taken to {x:e}"), move |w| {
                let rod = w.insert_rod(&straight())?;
                let grip = w.insert_grip(&GripSpec::new(rod, Place::Start, hold))?;
                w.set_grip_pose(grip, Pose::at(DVec3::Y * x))
            });
            absurd(&format!("{hold:?} pulled with {x:e}"), move |w| {
                let rod = w.insert_rod(&straight())?;
                let drive = Drive::Force { direction: DVec3::Y, force: x, speed_limit: x };
                w.insert_grip(&GripSpec { drive, ..GripSpec::new(rod, Place::Start, hold) }).map(|_| ())
            });
        }
        absurd(&format!("a shape of {x:e}"), move |w| {
            w.insert_rod(&straight())?;
            w.insert_shape(&ShapeSpec::fixed(Geometry::Box { half_sides: DVec3::splat(x) }, Pose::at(DVec3::NEG_Z * x)))?;
            w.insert_shape(&ShapeSpec::fixed(Geometry::Cylinder { radius: x, half_length: x }, Pose::at(DVec3::Z * x))).map(|_| ())
        });
        absurd(&format!("a shape pushed with {x:e}"), move |w| {
            w.insert_rod(&straight())?;
            let motion = ShapeMotion::Pushed { direction: DVec3::X, force: x, speed_limit: x };
            let ball = ShapeSpec::fixed(Geometry::Sphere { radius: 1e-3 }, Pose::at(DVec3::new(-2e-3, 0.0, 0.0)));
            w.insert_shape(&ShapeSpec { motion, ..ball }).map(|_| ())
        });
    }
}

#[test]
fn a_load_that_was_absurd() {
    let (mut world, rod) = thread(Settings { halvings: 2, ..Settings::default() });
    let load = world.insert_load(&LoadSpec { rod, kind: point(Place::End, DVec3::Z * 1e300) }).unwrap();
    let report = step(&mut world, DT);
    assert!(!report.incidents.is_empty(), "{report:?}");
    world.remove_load(load).unwrap();
    assert_usable(&mut world, 5, "load removed");
}

#[test]
fn a_healthy_thread_does_not_hide_an_absurd_one() {
    for x in [1e30, 1e60, 1e80, 1e100, 1e120, 1e140, 1e200, 1e300] {
        for stretch in [Stretch::Elastic, Stretch::Inextensible] {
            let mut world = World::new(Settings { halvings: 3, ..Settings::default() }).unwrap();
            let rod = world.insert_rod(&RodSpec { stretch, ..straight() }).unwrap();
            let healthy = straight();
            let healthy = RodSpec { centerline: healthy.centerline.iter().map(|p| *p + DVec3::Y).collect(), ..healthy };
            world.insert_rod(&healthy).unwrap();
            world.insert_load(&LoadSpec { rod, kind: point(Place::End, DVec3::Z * x) }).unwrap();
            for _ in 0..4 {
                let report = step(&mut world, DT);
                assert!(!report.incidents.is_empty(), "force {x:e}: {report:?}");
            }
            world.remove_rod(rod).unwrap();
            assert_usable(&mut world, 3, &format!("force {x:e}, thread removed"));
        }
    }
}

// Snapshots.

/// A world with all that a snapshot holds: two threads that touch, on a plane, grips of all kinds, loads, a driven and a removed shape.
fn full_world() -> World {
    let (material, radius) = t1();
    let mut world = World::new(Settings { halvings: 3, ..Settings::default() }).unwrap();
    let gone = world.insert_shape(&ShapeSpec::fixed(Geometry::Sphere { radius: 1e-3 }, Pose::at(DVec3::Z * 0.1))).unwrap();
    world.insert_shape(&ShapeSpec::fixed(Geometry::Plane, Pose::IDENTITY)).unwrap();
    let ball = ShapeSpec::fixed(Geometry::Sphere { radius: 2e-3 }, Pose::at(DVec3::new(0.0, 0.01, 4e-3)));
    world.insert_shape(&ShapeSpec { motion: ShapeMotion::Driven, ..ball }).unwrap();
    world.remove_shape(gone).unwrap();
    let low = DVec3::Z * (1.04 * radius);
    let plastic = Material { plasticity: Some(Plasticity { yield_curvature: 20.0, yield_twist: 20.0, hardening: 0.1 }), ..material.clone() };
    let a = world.insert_rod(&RodSpec::straight(low - DVec3::X * 0.01, low + DVec3::X * 0.01, 8, radius, plastic)).unwrap();
    let high = DVec3::Z * (3.1 * radius);
    let b = world.insert_rod(&RodSpec::straight(high - DVec3::Y * 0.01, high + DVec3::Y * 0.01, 7, radius, material)).unwrap();
    world.insert_grip(&GripSpec::new(a, Place::Start, Hold::Clamp)).unwrap();
    world.insert_grip(&GripSpec::new(b, Place::Start, Hold::Pin)).unwrap();
    let drive = Drive::Force { direction: DVec3::Y, force: 0.01, speed_limit: 0.01 };
    world.insert_grip(&GripSpec { drive, ..GripSpec::new(b, Place::End, Hold::Jaw) }).unwrap();
    world.insert_load(&LoadSpec { rod: b, kind: LoadKind::Mass { place: Place::Arc(0.004), mass: 1e-5, inertia: DVec3::ZERO } }).unwrap();
    world.insert_load(&LoadSpec { rod: a, kind: point(Place::End, DVec3::Z * 1e-5) }).unwrap();
    for _ in 0..6 {
        world.step(DT);
    }
    assert!(world.contacts().count() > 3, "{} touch", world.contacts().count());
    world
}

/// What must hold after any bytes were given to `restore`.
fn restore_damaged(world: &mut World, bytes: &[u8]) -> Result<(), Error> {
    let before = world.state_hash();
    let result = world.restore(bytes);
    match &result {
        Err(e) => {
            assert!(matches!(e, Error::Snapshot { .. }), "another error: {e}");
            assert_eq!(world.state_hash(), before, "an error changes nothing");
        }
        Ok(()) => {
            assert_finite(world);
            for _ in 0..2 {
                let report = world.step(DT);
                assert!(report.substeps + report.rejected <= 4 * 15, "{report:?}");
                assert_finite(world);
            }
            // Inserting and removing still work.
            let rod = world.insert_rod(&straight()).unwrap();
            let grip = world.insert_grip(&GripSpec::new(rod, Place::Start, Hold::Pin)).unwrap();
            world.remove_grip(grip).unwrap();
            world.remove_rod(rod).unwrap();
        }
    }
    result
}

#[test]
fn a_snapshot_cut_short_or_too_long() {
    let mut world = full_world();
    let bytes = world.snapshot();
    for n in 0..bytes.len() {
        assert!(restore_damaged(&mut world, &bytes[..n]).is_err(), "{n} of {} bytes were taken", bytes.len());
    }
    let mut longer = bytes.clone();
    longer.push(0);
    assert!(restore_damaged(&mut world, &longer).is_err());
    assert!(world.restore(&bytes).is_ok());
    assert_usable(&mut world, 2, "whole");
}

#[test]
fn a_snapshot_of_another_world() {
    let bytes = full_world().snapshot();
    let (mut other, rod) = thread(Settings::default());
    assert!(restore_damaged(&mut other, &bytes).is_err());
    // One with fewer shapes, and one from before a thread was removed.
    let taken = other.snapshot();
    other.remove_rod(rod).unwrap();
    assert!(restore_damaged(&mut other, &taken).is_err());
    assert_usable(&mut other, 1, "other");
}

#[test]
fn a_snapshot_with_nan_in_place_of_a_number() {
    let mut world = full_world();
    let bytes = world.snapshot();
    // Eight bytes that make a number as they occur here are one, mostly; the others lie across two, and may make one that will do.
    let number = |at: usize| f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()).abs();
    let numbers: Vec<usize> = (8..bytes.len() - 8).filter(|at| (1e-9..1e3).contains(&number(*at))).collect();
    assert!(numbers.len() > 200, "{}", numbers.len());
    let mut taken = 0;
    for at in &numbers {
        let mut damaged = bytes.clone();
        damaged[*at..at + 8].copy_from_slice(&NAN.to_le_bytes());
        taken += usize::from(restore_damaged(&mut world, &damaged).is_ok());
        world.restore(&bytes).unwrap();
    }
    assert!(taken < numbers.len() / 5, "{taken} of {} were taken", numbers.len());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_snapshot_with_a_flipped_bit(at in any::<prop::sample::Index>(), bit in 0u32..8) {
        let mut world = full_world();
        let mut bytes = world.snapshot();
        let at = at.index(bytes.len());
        bytes[at] ^= 1 << bit;
        let _ = restore_damaged(&mut world, &bytes);
    }

    #[test]
    fn a_snapshot_with_a_number_exchanged(at in any::<prop::sample::Index>(), new in prop_oneof![
        Just(f64::NAN.to_bits()), Just(f64::INFINITY.to_bits()), Just(f64::MAX.to_bits()), Just((-1e200f64).to_bits()), Just(0u64), Just(u64::MAX), any::<u64>(),
    ]) {
        let mut world = full_world();
        let mut bytes = world.snapshot();
        let at = at.index(bytes.len() - 8);
        bytes[at..at + 8].copy_from_slice(&new.to_le_bytes());
        let _ = restore_damaged(&mut world, &bytes);
    }

    #[test]
    fn any_bytes_as_a_snapshot(tail in prop::collection::vec(any::<u8>(), 0..200)) {
        let mut world = full_world();
        let mut bytes = world.snapshot()[..8].to_vec();
        bytes.extend(tail);
        let _ = restore_damaged(&mut world, &bytes);
    }
}

// Motions that cannot be followed.

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
    let pins = [Place::Start, Place::End].map(|place| world.insert_grip(&GripSpec::at_once(rod, place, Hold::Pin)).unwrap());
    (world, rod, pins)
}

/// One step that is watched, for a motion that is not to be followed: either the audit finds nothing crossed, or the report says so.
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
            let axis = (world.grip_pose(pins[1]).unwrap().position - world.grip_pose(pins[0]).unwrap().position).normalize();
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
    let jump = report.incidents.iter().find_map(|i| if let IncidentKind::Teleport { distance } = i.kind { Some(distance) } else { None });
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
            Geometry::Mesh { vertices: vec![DVec3::new(-0.1, -0.1, 0.0), DVec3::new(0.1, -0.1, 0.0), DVec3::new(0.0, 0.1, 0.0)], triangles: vec![[0, 1, 2]] },
            DQuat::IDENTITY,
        ),
    ] {
        let (mut world, rod) = thread(hasty());
        let shape = world.insert_shape(&ShapeSpec::fixed(geometry.clone(), Pose::new(DVec3::NEG_Z * 0.01, orientation))).unwrap();
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
        let spec = ShapeSpec { motion: ShapeMotion::Driven, ..ShapeSpec::fixed(geometry.clone(), Pose::at(DVec3::new(0.025, 0.0, 0.1))) };
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
    let ring: Vec<DVec3> = (0..=24).map(|i| DQuat::from_rotation_z(core::f64::consts::TAU * f64::from(i) / 24.0) * DVec3::X * 5e-3).collect();
    let there_and_back: Vec<DVec3> = (0..=20i32).map(|i| DVec3::X * (1e-3 * f64::from(10 - (i - 10).abs()))).collect();
    for (what, points) in [("closed ring", ring), ("there and back", there_and_back)] {
        for rest in [RestShape::Straight, RestShape::AsInserted] {
            let mut world = World::new(hasty()).unwrap();
            let Ok(rod) = world.insert_rod(&RodSpec { rest, ..RodSpec::new(points.clone(), radius, material.clone()) }) else { continue };
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
#[ignore = "pulled by 10 mm of 50 and let go, elements shrink by 73 % in a substep taken with a residual of 4730 radii, and every later step is stuck; with 8 halvings after 0.1 mm already"]
fn an_inextensible_thread_pulled_beyond_its_length() {
    for hold in [Hold::Pin, Hold::Clamp, Hold::Jaw] {
        for by in [1e-4, 1e-2, 0.1] {
            let (material, radius) = t1();
            let mut world = World::new(hasty()).unwrap();
            let spec = RodSpec { stretch: Stretch::Inextensible, ..RodSpec::straight(DVec3::ZERO, DVec3::X * 0.05, 20, radius, material) };
            let rod = world.insert_rod(&spec).unwrap();
            world.insert_grip(&GripSpec::at_once(rod, Place::Start, hold)).unwrap();
            let end = world.insert_grip(&GripSpec::at_once(rod, Place::End, hold)).unwrap();
            let pose = world.grip_pose(end).unwrap();
            world.set_grip_pose(end, Pose::new(pose.position + DVec3::X * by, pose.orientation)).unwrap();
            let mut incidents = 0;
            for _ in 0..3 {
                incidents += step(&mut world, DT).incidents.len();
            }
            assert!(incidents > 0, "{hold:?} by {by}: the thread is longer by {}", world.rod(rod).unwrap().max_elongation());
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
    assert!((view.max_tension() / view.axial_stiffness() - 1.0).abs() < 1e-2, "{}", view.max_tension());
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
