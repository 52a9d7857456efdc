//! The step allocates nothing once its working memory has grown to what the motion needs.
//!
//! Warm-up is the same motion, run once: the world is then put back to its start by a snapshot and the motion runs
//! again, bit for bit, so that whatever it allocates it would allocate for ever.

mod support;

use support::{overhand, quiet, t1};
use sutura::glam::{DQuat, DVec3};
use sutura::{
    BodySpec, Drive, Friction, Geometry, GripSpec, Handle, Hold, Incident, IncidentKind, Integrator, JointKind,
    JointSpec, LoadKind, LoadSpec, Material, Motor, Place, Pose, ReelLaw, ReelSpec, RodSpec, Settings, ShapeSpec,
    Stretch, WeldSpec, World,
};

const DT: f64 = 1.0 / 60.0;

/// What the second run of a motion took.
#[derive(Debug, Default, PartialEq)]
struct Second {
    /// Allocations in the steps.
    allocations: u64,
    /// Steps that allocated.
    steps: u32,
    rejected: u32,
    most_contacts: u32,
}

/// Runs `frames` steps twice from the same state, with `drive` before each, and counts in the second run.
fn second_run(world: &mut World, frames: u32, mut drive: impl FnMut(&mut World, u32)) -> Second {
    let start = world.snapshot();
    let mut end = None;
    let mut second = Second::default();
    for run in 0..2 {
        world.restore(&start).unwrap();
        for frame in 0..frames {
            drive(world, frame);
            let mut report = None;
            let info = allocation_counter::measure(|| report = Some(world.step(DT)));
            let report = report.unwrap();
            // A report of an incident is a vector that grows; here there are none, but for what the first step of all
            // says of how the thread lies.
            let known = |i: &Incident| run == 0 && frame == 0 && matches!(i.kind, IncidentKind::Overlap(_));
            assert!(report.incidents.iter().all(known), "frame {frame}: {:?}", report.incidents);
            if run == 1 {
                second.allocations += info.count_total;
                second.steps += u32::from(info.count_total > 0);
                second.rejected += report.rejected;
                second.most_contacts = second.most_contacts.max(report.contacts);
            }
        }
        let hash = world.state_hash();
        assert_eq!(*end.get_or_insert(hash), hash, "the second run differs from the first");
    }
    second
}

/// The counter counts: otherwise all below would pass for nothing.
#[test]
fn the_counter_sees_an_allocation() {
    assert_eq!(allocation_counter::measure(|| drop(std::hint::black_box(vec![1u8]))).count_total, 1);
}

#[test]
fn a_swinging_thread() {
    let (material, radius) = t1();
    for (stretch, integrator) in [
        (Stretch::Elastic, Integrator::ImplicitEuler),
        (Stretch::Inextensible, Integrator::ImplicitEuler),
        (Stretch::Elastic, Integrator::TrBdf2),
    ] {
        let spec = RodSpec { stretch, ..RodSpec::straight(DVec3::ZERO, DVec3::X * 0.1, 60, radius, material.clone()) };
        let mut world = World::new(Settings { integrator, ..Settings::default() }).unwrap();
        let rod = world.insert_rod(&spec).unwrap();
        world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Pin)).unwrap();
        let second = second_run(&mut world, 30, |_, _| {});
        assert_eq!(second.allocations, 0, "{stretch:?}: {second:?}");
        // Beyond what the first run warmed: with nothing that grows, warm-up is one step.
        let more = allocation_counter::measure(|| {
            for _ in 0..30 {
                world.step(DT);
            }
        });
        assert_eq!(more.count_total, 0, "{stretch:?}: {more:?}");
    }
}

#[test]
fn a_thread_that_is_made_of_something_else_as_it_swings() {
    let (material, radius) = t1();
    for stretch in [Stretch::Elastic, Stretch::Inextensible] {
        let spec = RodSpec { stretch, ..RodSpec::straight(DVec3::ZERO, DVec3::X * 0.1, 60, radius, material.clone()) };
        let mut world = World::default();
        let rod = world.insert_rod(&spec).unwrap();
        world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Clamp)).unwrap();
        world.step(DT);
        let second = second_run(&mut world, 30, |world, frame| {
            // At the end it is as it was, for the second run begins with that.
            let changed = frame < 29;
            let factor = if !changed {
                1.0
            } else if frame % 4 < 2 {
                0.2
            } else {
                3.0
            };
            let other = Material { young_modulus: 2e9 * factor, density: 1150.0 / factor, ..material.clone() };
            world.set_material(rod, &other).unwrap();
            world.set_stretch(rod, if changed && frame % 10 < 5 { Stretch::Elastic } else { stretch }).unwrap();
        });
        assert_eq!(second.allocations, 0, "{stretch:?}: {second:?}");
    }
}

#[test]
fn grips_driven_by_pose_and_by_force_and_a_torque() {
    let (material, radius) = t1();
    let mut world = World::new(Settings::default()).unwrap();
    let rod = world.insert_rod(&RodSpec::straight(DVec3::ZERO, DVec3::X * 0.1, 60, radius, material)).unwrap();
    let clamp = world.insert_grip(&GripSpec::new(rod, Place::Start, Hold::Clamp)).unwrap();
    world.insert_grip(&GripSpec::new(rod, Place::Particle(30), Hold::Pin)).unwrap();
    let pull = Drive::Force { direction: DVec3::X, force: 0.5, speed_limit: 0.05 };
    world.insert_grip(&GripSpec { drive: pull, ..GripSpec::new(rod, Place::End, Hold::Jaw) }).unwrap();
    let torque = LoadKind::Point { place: Place::Element(45), force: DVec3::Z * 1e-3, torque: DVec3::Y * 1e-6 };
    world.insert_load(&LoadSpec { rod, kind: torque }).unwrap();
    let home = world.grip_pose(clamp).unwrap();
    let second = second_run(&mut world, 60, |world, frame| {
        let s = f64::from(frame + 1) * DT;
        let pose =
            Pose::new(home.position + DVec3::X * (0.005 * s), DQuat::from_rotation_y(0.3 * s) * home.orientation);
        world.set_grip_pose(clamp, pose).unwrap();
    });
    assert_eq!(second.allocations, 0, "{second:?}");
}

#[test]
fn a_thread_that_slides_over_a_cylinder() {
    let radius = 0.15e-3;
    let material = Material { bend_scale: 0.05, bend_damping: 0.01, ..Material::elastic(2e9, 1150.0) };
    let cylinder = 5e-3;
    let mut world =
        World::new(Settings { friction: Friction { stick: 0.1, slide: 0.08 }, ..Settings::default() }).unwrap();
    let pose = Pose::new(DVec3::ZERO, DQuat::from_rotation_x(core::f64::consts::FRAC_PI_2));
    world.insert_shape(&ShapeSpec::fixed(Geometry::Cylinder { radius: cylinder, half_length: 0.01 }, pose)).unwrap();
    // Over the top, a gram at the short side and half a gram at the long one: more than friction holds.
    let r = cylinder + 1.05 * radius;
    let mut path = vec![DVec3::new(-r, 0.0, -0.03)];
    path.extend(
        (0..=60).map(|i| DQuat::from_rotation_y(core::f64::consts::PI * f64::from(i) / 60.0) * DVec3::NEG_X * r),
    );
    path.push(DVec3::new(r, 0.0, -0.01));
    let rod = world.insert_rod(&RodSpec::new(support::resample(&path, 80), radius, material)).unwrap();
    for (place, mass) in [(Place::Start, 5e-4), (Place::End, 1e-3)] {
        world.insert_load(&LoadSpec { rod, kind: LoadKind::Mass { place, mass, inertia: DVec3::ZERO } }).unwrap();
    }
    let start = world.rod(rod).unwrap().positions()[0];
    let second = second_run(&mut world, 6, |_, _| {});
    let fallen = world.rod(rod).unwrap().positions()[0].z - start.z;
    assert!(fallen > 5e-3 && second.most_contacts > 10, "it does not slide: {fallen:e} m, {second:?}");
    assert_eq!(second.allocations, 0, "{second:?}");
}

/// A thread with a loose overhand knot and pins at its ends; `newton_max` is the Newton budget.
fn knotted(newton_max: u32) -> (World, [Handle<sutura::Grip>; 2]) {
    let radius = 0.25e-3;
    let length = 300.0 * radius;
    let material = Material { bend_damping: 0.01, ..Material::elastic(2e9, 1150.0) };
    let settings = Settings { substep: 1.0 / 240.0, newton_max, linear_damping: 0.9, angular_damping: 0.9, ..quiet() };
    let mut world = World::new(settings).unwrap();
    let rod = world.insert_rod(&RodSpec::new(overhand(length, 75), radius, material)).unwrap();
    let pins =
        [Place::Start, Place::End].map(|place| world.insert_grip(&GripSpec::at_once(rod, place, Hold::Pin)).unwrap());
    (world, pins)
}

/// Draws the pins apart at 0.1 m/s each.
fn draw(world: &mut World, pins: [Handle<sutura::Grip>; 2]) {
    let [a, b] = pins.map(|p| world.grip_pose(p).unwrap().position);
    let axis = (b - a).normalize();
    world.set_grip_pose(pins[0], Pose::at(a - axis * (0.1 * DT))).unwrap();
    world.set_grip_pose(pins[1], Pose::at(b + axis * (0.1 * DT))).unwrap();
}

#[test]
fn an_overhand_knot_drawn_tight() {
    let (mut world, pins) = knotted(12);
    let second = second_run(&mut world, 11, |world, _| draw(world, pins));
    assert!(second.most_contacts > 6, "not tight: {second:?}");
    assert_eq!(second.allocations, 0, "{second:?}");
}

#[test]
fn an_overhand_knot_whose_substeps_are_rejected_and_halved() {
    // Too few iterations for most substeps: they are halved until three are enough.
    let (mut world, pins) = knotted(3);
    let second = second_run(&mut world, 9, |world, _| draw(world, pins));
    assert!(second.rejected > 5, "nothing was rejected: {second:?}");
    assert_eq!(second.allocations, 0, "{second:?}");
}

#[test]
fn a_ring_with_a_branch_that_falls_onto_a_table() {
    let (material, radius) = t1();
    let mut world = World::new(Settings::default()).unwrap();
    let ring = world
        .insert_rod(&RodSpec::ring(DVec3::Z * 2e-3, DVec3::Z, DVec3::X * 0.01, 40, radius, material.clone()))
        .unwrap();
    let at = world.rod(ring).unwrap().positions()[20];
    let branch = world.insert_rod(&RodSpec::straight(at, at - DVec3::X * 0.01, 10, radius, material)).unwrap();
    world.insert_weld(&WeldSpec::new(vec![(ring, Place::Particle(20)), (branch, Place::Start)])).unwrap();
    world.insert_shape(&ShapeSpec::fixed(Geometry::Plane, Pose::IDENTITY)).unwrap();
    let second = second_run(&mut world, 20, |_, _| {});
    assert!(second.most_contacts > 10, "it does not lie: {second:?}");
    assert_eq!(second.allocations, 0, "{second:?}");
}

/// Up to the number of elements that there were before: feeding in and drawing back over the same length allocates
/// nothing the second time. (Beyond it the arrays grow, as if a thread were inserted.)
#[test]
fn a_reel_within_the_elements_that_there_were() {
    let (material, radius) = t1();
    let mut world = World::new(Settings::default()).unwrap();
    let rod = world.insert_rod(&RodSpec::straight(DVec3::ZERO, DVec3::NEG_Z * 0.03, 30, radius, material)).unwrap();
    world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Clamp)).unwrap();
    let reel = world.insert_reel(&ReelSpec { rod, at_end: false, law: ReelLaw::Rate(0.05), supply: None }).unwrap();
    let mut most = 0;
    let second = second_run(&mut world, 60, |world, frame| {
        world.set_reel(reel, ReelLaw::Rate(if frame < 30 { 0.05 } else { -0.05 })).unwrap();
        most = most.max(world.rod(rod).unwrap().n_elements());
    });
    assert!(most > 50, "{most}");
    assert_eq!(second.allocations, 0, "{second:?}");
}

/// Joints of every kind, with a motor, friction, limits that are met, and a floor.
#[test]
fn a_machine_of_joints_allocates_nothing() {
    for integrator in [Integrator::ImplicitEuler, Integrator::TrBdf2] {
        let mut world = World::new(Settings { integrator, ..Settings::default() }).unwrap();
        let floor = Geometry::Box { half_sides: DVec3::new(0.5, 0.5, 0.02) };
        world.insert_shape(&ShapeSpec::fixed(floor, Pose::at(DVec3::Z * -0.12))).unwrap();
        let about_y = DQuat::from_rotation_x(-core::f64::consts::FRAC_PI_2);
        let mut above = None;
        let kinds = [JointKind::Hinge, JointKind::Ball, JointKind::Slider, JointKind::Fixed, JointKind::Hinge];
        for (k, kind) in kinds.into_iter().enumerate() {
            let x = 0.04 * k as f64;
            let half_sides = DVec3::new(0.02, 0.006, 0.004);
            let bar = BodySpec::solid(Geometry::Box { half_sides }, 1000.0, Pose::at(DVec3::X * (x + 0.02)));
            let body = world.insert_body(&bar).unwrap();
            let sides = [above, Some(body)];
            let frames = world.joint_frames(sides, Pose::new(DVec3::X * x, about_y)).unwrap();
            let mut spec = JointSpec::new(kind, sides, frames);
            match k {
                0 => spec.motor = Some(Motor { speed: -4.0, most: 0.02 }),
                2 => spec.limits = Some([-2e-3, 2e-3]),
                4 => (spec.limits, spec.friction) = (Some([-0.2, 0.3]), 1e-4),
                _ => {}
            }
            world.insert_joint(&spec).unwrap();
            above = Some(body);
        }
        let second = second_run(&mut world, 90, |_, _| {});
        assert_eq!((second.allocations, second.steps), (0, 0), "{integrator:?}: {second:?}");
    }
}
