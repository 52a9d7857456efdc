//! The rod against closed forms.

mod support;

use core::f64::consts::TAU;
use support::{quiet, settle, t1};
use sutura::glam::{DQuat, DVec3};
use sutura::{GripSpec, Handle, Hold, LoadKind, LoadSpec, Place, Pose, Rod, RodSpec, Settings, Stretch, World};

/// A straight T1 cantilever along x, clamped at the start.
fn cantilever(length: f64, n: usize, settings: Settings) -> (World, Handle<Rod>) {
    let (material, radius) = t1();
    let mut world = World::new(settings).unwrap();
    let rod = world.insert_rod(&RodSpec::straight(DVec3::ZERO, DVec3::X * length, n, radius, material)).unwrap();
    world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Clamp)).unwrap();
    (world, rod)
}

fn tip(world: &World, rod: Handle<Rod>) -> DVec3 {
    *world.rod(rod).unwrap().positions().last().unwrap()
}

/// Elastica under a dead tip load P: (P L^2 / EI, x_tip / L, drop / L). Elliptic integrals.
const TIP_LOAD: [(f64, f64, f64); 4] = [
    (0.1, 0.999_335, 0.033_295),
    (1.0, 0.943_567, 0.301_721),
    (5.0, 0.612_372, 0.713_792),
    (10.0, 0.445_004, 0.810_609),
];

#[test]
fn elastica_under_tip_load_is_second_order() {
    for (k, x, drop) in TIP_LOAD {
        let mut errors = Vec::new();
        for n in [10, 20, 40] {
            let length = 0.05;
            let (mut world, rod) = cantilever(length, n, quiet());
            let ei = world.rod(rod).unwrap().bending_stiffness(0).x;
            let force = DVec3::NEG_Z * (k * ei / (length * length));
            world
                .insert_load(&LoadSpec { rod, kind: LoadKind::Point { place: Place::End, force, torque: DVec3::ZERO } })
                .unwrap();
            settle(&mut world, 0.1, 1e-7, 200.0);
            let p = tip(&world, rod) / length;
            errors.push((p - DVec3::new(x, 0.0, -drop)).length());
        }
        // The tables have six digits; stretch and shear of this rod are 1e-5 of its length.
        assert!(errors[2] < 1e-3, "k {k}: {errors:?}");
        assert!(errors[0] / errors[1] > 3.0 && errors[1] / errors[2] > 3.0, "order under 1.6 at k {k}: {errors:?}");
    }
}

#[test]
fn elastica_under_self_weight() {
    // T1, L = 50, 100, 150 mm: drop in mm by shooting.
    for (length, drop) in [(0.05, 0.7833e-3), (0.1, 12.3809e-3), (0.15, 56.155e-3)] {
        let (mut world, rod) = cantilever(length, 100, Settings { gravity: DVec3::NEG_Z * 9.81, ..quiet() });
        settle(&mut world, 0.1, 1e-7, 300.0);
        let got = -tip(&world, rod).z;
        assert!((got / drop - 1.0).abs() < 2e-3, "{length}: {got} {drop}");
    }
}

#[test]
fn a_tip_moment_of_a_quarter_turn_makes_a_quarter_circle() {
    // A dead moment has no energy: from about half a turn on it feeds a flutter out of the plane. A quarter turn is
    // stable.
    let mut errors = Vec::new();
    for n in [20, 40] {
        let length = 0.05;
        let (mut world, rod) = cantilever(length, n, quiet());
        let ei = world.rod(rod).unwrap().bending_stiffness(0).x;
        let torque = DVec3::NEG_Y * (core::f64::consts::FRAC_PI_2 * ei / length);
        let load = world
            .insert_load(&LoadSpec {
                rod,
                kind: LoadKind::Point { place: Place::End, force: DVec3::ZERO, torque: DVec3::ZERO },
            })
            .unwrap();
        for i in 1..=40 {
            world
                .set_load(
                    load,
                    LoadKind::Point { place: Place::End, force: DVec3::ZERO, torque: torque * (f64::from(i) / 40.0) },
                )
                .unwrap();
            world.step(0.1);
        }
        for _ in 0..100 {
            world.step(0.1);
        }
        errors.push((tip(&world, rod) / length - DVec3::new(1.0, 0.0, 1.0) * core::f64::consts::FRAC_2_PI).length());
    }
    // The torque acts on the last frame, half an element before the tip: second order in the element length.
    assert!(errors[1] < 1e-4 && errors[0] / errors[1] > 2.5, "{errors:?}");
}

#[test]
fn a_twisted_clamped_rod_carries_gj_times_twist() {
    let (material, radius) = t1();
    let length = 0.1;
    let mut world = World::new(quiet()).unwrap();
    let rod = world.insert_rod(&RodSpec::straight(DVec3::ZERO, DVec3::X * length, 50, radius, material)).unwrap();
    let left = world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Clamp)).unwrap();
    let right = world.insert_grip(&GripSpec::at_once(rod, Place::End, Hold::Clamp)).unwrap();
    let pose = world.grip_pose(right).unwrap();
    let turns = 0.95 * 2.0024; // onset of buckling at zero tension is at 2.0024 turns for nu = 0.4
    for i in 1..=50 {
        let turn = DQuat::from_rotation_x(TAU * turns * f64::from(i) / 50.0);
        world.set_grip_pose(right, Pose::new(pose.position, turn * pose.orientation)).unwrap();
        world.step(0.02);
    }
    settle(&mut world, 0.1, 1e-7, 100.0);
    let gj = world.rod(rod).unwrap().bending_stiffness(0).z;
    let want = gj * TAU * turns / length;
    let (a, b) = (world.grip_wrench(left).unwrap().torque.x, world.grip_wrench(right).unwrap().torque.x);
    assert!((b / want - 1.0).abs() < 1e-6 && (a / want + 1.0).abs() < 1e-6, "{a} {b} {want}");
}

#[test]
fn a_free_thread_keeps_its_length_and_falls() {
    let (material, radius) = t1();
    let mut spec = RodSpec::straight(DVec3::ZERO, DVec3::X * 0.15, 120, radius, material);
    spec.stretch = Stretch::Inextensible;
    let mut world = World::new(Settings { gravity: DVec3::NEG_Z * 9.81, ..quiet() }).unwrap();
    let rod = world.insert_rod(&spec).unwrap();
    world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Pin)).unwrap();
    let mut worst = 0.0f64;
    for _ in 0..120 {
        let r = world.step(1.0 / 60.0);
        assert!(r.incidents.is_empty(), "{:?}", r.incidents);
        worst = worst.max(world.rod(rod).unwrap().max_elongation());
    }
    assert!(worst < 1e-5, "{worst:e}");
}

#[test]
fn the_elastic_energy_of_a_cantilever_is_half_the_work_of_its_load() {
    // In the joints, and in the half joint that the clamp holds. Few elements, so that it counts.
    for n in [4, 9] {
        let (mut world, rod) = cantilever(0.05, n, quiet());
        let force = DVec3::NEG_Z * 1e-5;
        let before = tip(&world, rod);
        world
            .insert_load(&LoadSpec { rod, kind: LoadKind::Point { place: Place::End, force, torque: DVec3::ZERO } })
            .unwrap();
        settle(&mut world, 0.1, 1e-9, 200.0);
        let work = 0.5 * force.dot(tip(&world, rod) - before);
        let energy = world.rod(rod).unwrap().energy().total();
        // The deflection is a hundredth of the length: it is linear to its square.
        assert!((energy / work - 1.0).abs() < 1e-3, "{n}: {energy:e} {work:e}");
    }
}
