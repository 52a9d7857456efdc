//! Time integration of second order: its order, what it keeps, and that contact does not feed it.

mod support;

use support::{quiet, settle, t1};
use sutura::glam::{DQuat, DVec3};
use sutura::{
    Friction, Geometry, GripSpec, Handle, Hold, Integrator, LoadKind, LoadSpec, Material, Place, Pose, Rod, RodSpec, Settings, ShapeSpec, Stretch, World,
};

/// Newton so far that its error is far below that of time.
fn second_order(substep: f64) -> Settings {
    Settings { substep, integrator: Integrator::TrBdf2, tolerance: 1e-9, newton_max: 40, ..quiet() }
}

const WEIGHT: DVec3 = DVec3::new(0.0, 0.0, -9.81);

/// Observed order from three runs whose substeps are halved: that of the differences of their results.
fn order(run: impl Fn(f64) -> Vec<DVec3>, h: f64) -> f64 {
    let [a, b, c] = [h, 0.5 * h, 0.25 * h].map(run);
    let apart = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    (apart(&a, &b) / apart(&b, &c)).log2()
}

/// Steps for a time, without incidents.
fn run(world: &mut World, time: f64) {
    for _ in 0..10 {
        let report = world.step(0.1 * time);
        assert!(report.converged && report.incidents.is_empty() && report.rejected == 0, "{report:?}");
    }
}

/// Ends and middle, and their velocities in the units of a millisecond.
fn seen(world: &World, rod: Handle<Rod>) -> Vec<DVec3> {
    let (view, mut out) = (world.rod(rod).unwrap(), Vec::new());
    let n = view.positions().len() - 1;
    for i in [0, n / 2, n] {
        out.extend([view.positions()[i], view.velocities()[i] * 1e-3]);
    }
    out
}

/// A bob on a thread of one element, from level through the bottom: the tension goes from nothing to three weights.
fn pendulum(settings: Settings) -> Vec<DVec3> {
    let mut world = World::new(settings).unwrap();
    let (material, radius) = t1();
    let rod = world.insert_rod(&RodSpec::straight(DVec3::ZERO, DVec3::X * 0.1, 1, radius, material)).unwrap();
    world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Pin)).unwrap();
    world.insert_load(&LoadSpec { rod, kind: LoadKind::Mass { place: Place::End, mass: 1e-5, inertia: DVec3::ZERO } }).unwrap();
    run(&mut world, 0.25);
    seen(&world, rod)
}

#[test]
fn a_pendulum_is_of_second_order() {
    let p = order(|h| pendulum(Settings { gravity: WEIGHT, ..second_order(h) }), 1.0 / 480.0);
    assert!(p > 1.8, "order {p}");
    let first = order(|h| pendulum(Settings { gravity: WEIGHT, integrator: Integrator::ImplicitEuler, ..second_order(h) }), 1.0 / 480.0);
    assert!(first < 1.3, "implicit Euler has order {first}");
}

#[test]
fn drag_keeps_the_order() {
    let p = order(|h| pendulum(Settings { gravity: WEIGHT, linear_damping: 0.98, ..second_order(h) }), 1.0 / 480.0);
    assert!(p > 1.8, "order {p}");
}

/// A soft thread held by a clamp that itself turns, with damping in its bending: large turns with rates everywhere.
#[test]
fn a_clamped_thread_with_bend_damping_is_of_second_order() {
    let whipped = |h: f64| {
        let mut world = World::new(Settings { gravity: WEIGHT, ..second_order(h) }).unwrap();
        let material = Material { bend_damping: 0.01, ..Material::elastic(1e7, 1000.0) };
        let rod = world.insert_rod(&RodSpec::straight(DVec3::ZERO, DVec3::X * 0.03, 12, 0.5e-3, material)).unwrap();
        let grip = world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Clamp)).unwrap();
        let start = world.grip_pose(grip).unwrap();
        for frame in 1..=10 {
            // At a constant rate from the start, so that the drive has no kinks that refinement would see.
            world.set_grip_pose(grip, Pose::new(start.position, DQuat::from_rotation_y(0.1 * f64::from(frame)) * start.orientation)).unwrap();
            let report = world.step(0.01);
            assert!(report.converged && report.rejected == 0, "{report:?}");
        }
        seen(&world, rod)
    };
    let p = order(whipped, 1.0 / 1000.0);
    assert!(p > 1.8, "order {p}");
}

/// A free rod with uneven moments of inertia at its end, pushed and turned for a while and then left to tumble.
fn tumbling(settings: Settings, bend_damping: f64) -> (World, Handle<Rod>) {
    let mut world = World::new(settings).unwrap();
    let rod =
        world.insert_rod(&RodSpec::straight(DVec3::ZERO, DVec3::X * 0.03, 10, 0.5e-3, Material { bend_damping, ..Material::elastic(1e7, 1000.0) })).unwrap();
    world.insert_load(&LoadSpec { rod, kind: LoadKind::Mass { place: Place::End, mass: 1e-5, inertia: DVec3::new(1e-10, 3e-10, 2e-10) } }).unwrap();
    let push = |part: f64| LoadKind::Point { place: Place::Start, force: DVec3::new(0.0, 2e-4, 0.6e-4) * part, torque: DVec3::new(2e-8, 0.0, 0.0) * part };
    let load = world.insert_load(&LoadSpec { rod, kind: push(0.0) }).unwrap();
    // Softly: what a jump would set ringing is not resolved in time. Each change of the load is a restart.
    for k in 0..50 {
        let part = (core::f64::consts::PI * (f64::from(k) + 0.5) / 50.0).sin().powi(2);
        world.set_load(load, push(part)).unwrap();
        world.step(1e-3);
    }
    world.remove_load(load).unwrap();
    (world, rod)
}

#[test]
fn a_free_rod_that_tumbles_is_of_second_order() {
    let p = order(
        |h| {
            let (mut world, rod) = tumbling(second_order(h), 1e-3);
            run(&mut world, 0.05);
            // Places and directions: velocities have a ring of the last change of load.
            let view = world.rod(rod).unwrap();
            let mut out = view.positions().to_vec();
            out.extend([0, 9].map(|e| view.orientations()[e] * DVec3::X * 0.01));
            out
        },
        1.0 / 4000.0,
    );
    assert!(p > 1.8, "order {p}");
}

#[test]
fn momentum_stays_and_energy_does_not_grow() {
    let (mut world, rod) = tumbling(second_order(1.0 / 400.0), 0.0);
    let momentum = world.rod(rod).unwrap().momentum();
    // Where it restarts a velocity is off by a third of the substep times an acceleration that comes of its constraints; for 20 substeps that may ring.
    world.step(0.05);
    let mut least = world.rod(rod).unwrap().energy().total();
    let first = least;
    for _ in 0..400 {
        world.step(1.0 / 400.0);
        let view = world.rod(rod).unwrap();
        let energy = view.energy().total();
        assert!(energy <= least * (1.0 + 2e-5), "{energy:e} after {least:e}");
        least = least.min(energy);
        assert!(view.momentum().distance(momentum) < 1e-11 * momentum.length(), "{} {momentum}", view.momentum());
    }
    assert!(least > 0.9 * first, "{least:e} of {first:e}");
}

#[test]
fn drag_takes_the_same_in_a_second() {
    let mut world = World::new(Settings { linear_damping: 0.7, ..second_order(1.0 / 240.0) }).unwrap();
    let (material, radius) = t1();
    let rod = world.insert_rod(&RodSpec::straight(DVec3::ZERO, DVec3::X * 0.1, 4, radius, material)).unwrap();
    // Accelerated for a while, then left alone.
    world.set_settings(Settings { gravity: DVec3::Y, ..world.settings().clone() }).unwrap();
    world.step(0.5);
    world.set_settings(Settings { gravity: DVec3::ZERO, ..world.settings().clone() }).unwrap();
    let before = world.rod(rod).unwrap().velocities()[2].y;
    run(&mut world, 1.0);
    let after = world.rod(rod).unwrap().velocities()[2].y;
    assert!((after / before - 0.3).abs() < 1e-12, "{before} {after}");
}

#[test]
fn rest_does_not_depend_on_it() {
    let tip = |integrator: Integrator| {
        let settings = Settings { gravity: WEIGHT, integrator, linear_damping: 1.0 - 1e-9, tolerance: 1e-12, newton_max: 40, ..quiet() };
        let mut world = World::new(Settings { substep: 1.0 / 240.0, ..settings }).unwrap();
        let (material, radius) = t1();
        let material = Material { bend_damping: 0.01, ..material };
        let rod = world.insert_rod(&RodSpec::straight(DVec3::ZERO, DVec3::X * 0.05, 20, radius, material)).unwrap();
        let grip = world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Clamp)).unwrap();
        settle(&mut world, 1.0 / 60.0, 1e-13, 20.0);
        let wrench = world.grip_wrench(grip).unwrap();
        (world.rod(rod).unwrap().positions()[20], wrench.force, wrench.torque)
    };
    let [a, b] = [Integrator::ImplicitEuler, Integrator::TrBdf2].map(tip);
    assert!(a.0.z < -5e-4, "it bends: {}", a.0);
    // Forces also by the rounding of the lengths of stiff elements, 141 N times 1e-15.
    for (a, b, rounding) in [(a.0, b.0, 0.0), (a.1, b.1, 2e-13), (a.2, b.2, 0.0)] {
        assert!((a - b).length() <= 1e-9 * a.length() + rounding, "{a} {b}");
    }
}

/// A thread lands on a floor, level: all its particles at once.
fn landing(settings: Settings, height: f64) -> (World, Handle<Rod>) {
    let mut world = World::new(settings).unwrap();
    let (material, radius) = t1();
    let start = DVec3::new(-0.02, 0.0, radius + height);
    let rod = world.insert_rod(&RodSpec::straight(start, start + DVec3::X * 0.04, 10, radius, material)).unwrap();
    let floor = ShapeSpec::fixed(Geometry::Box { half_sides: DVec3::new(0.1, 0.1, 0.01) }, Pose::at(DVec3::NEG_Z * 0.01));
    world.insert_shape(&floor).unwrap();
    (world, rod)
}

#[test]
fn an_impact_gains_no_energy_and_comes_to_rest() {
    for k in 0..10 {
        // The moment of impact falls anywhere within a substep.
        let settings = Settings { gravity: WEIGHT, friction: Friction::coulomb(0.3), tolerance: 1e-3, ..second_order(1.0 / 240.0) };
        let (mut world, rod) = landing(settings, 2e-3 + 4e-5 * f64::from(k));
        let mut least = world.rod(rod).unwrap().energy().total();
        for frame in 0..60 {
            let report = world.step(1.0 / 240.0);
            assert!(report.incidents.is_empty(), "{report:?}");
            let energy = world.rod(rod).unwrap().energy().total();
            // Weight times a thousandth of the radius: what the contact tolerance may give back.
            assert!(energy <= least + 9.81 * 3.3e-6 * 1.5e-7, "{frame}: {energy:e} after {least:e}");
            least = least.min(energy);
        }
        let fastest = world.rod(rod).unwrap().velocities().iter().map(|v| v.length()).fold(0.0, f64::max);
        assert!(fastest < 1e-6 && world.contacts().count() > 0, "{fastest}");
    }
}

#[test]
fn a_snapshot_and_lost_working_memory_change_no_bit() {
    let settings = Settings { gravity: WEIGHT, tolerance: 1e-3, ..second_order(1.0 / 240.0) };
    let make = || landing(settings.clone(), 2e-3);
    let (mut plain, mut forgetful, mut restored) = (make().0, make().0, make().0);
    for step in 0..40 {
        plain.step(1.0 / 120.0);
        forgetful.forget_scratch();
        forgetful.step(1.0 / 120.0);
        if step % 3 == 0 {
            let bytes = restored.snapshot();
            let (mut other, _) = make();
            other.restore(&bytes).unwrap();
            restored = other;
        }
        restored.step(1.0 / 120.0);
        assert_eq!(plain.state_hash(), forgetful.state_hash(), "step {step}");
        assert_eq!(plain.state_hash(), restored.state_hash(), "step {step}");
    }
}

#[test]
fn halved_substeps_keep_the_answer() {
    // Two iterations are not enough for whole substeps of a thread that whips.
    let tip = |newton_max: u32, substep: f64| {
        let settings = Settings { gravity: WEIGHT, tolerance: 1e-6, newton_max, ..second_order(substep) };
        let mut world = World::new(settings).unwrap();
        let rod = world.insert_rod(&RodSpec::straight(DVec3::ZERO, DVec3::X * 0.1, 20, 0.25e-3, Material::elastic(1e7, 1000.0))).unwrap();
        world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Pin)).unwrap();
        let mut rejected = 0;
        for _ in 0..24 {
            let report = world.step(1.0 / 60.0);
            assert!(report.incidents.is_empty(), "{report:?}");
            rejected += report.rejected;
        }
        (world.rod(rod).unwrap().positions()[20], rejected)
    };
    let (halved, rejected) = tip(2, 1.0 / 120.0);
    let (fine, none) = tip(40, 1.0 / 1920.0);
    assert!(rejected > 0 && none == 0, "{rejected} {none}");
    // Half a millimeter of the 100 that it has swung: what whole substeps of 1/240 s are off.
    assert!(halved.distance(fine) < 5e-4, "{halved} {fine}");
}

#[test]
fn lengths_are_held_in_very_short_substeps() {
    // So short that multipliers do not settle in a solve.
    let mut world = World::new(Settings { gravity: WEIGHT, tolerance: 1e-4, newton_max: 12, ..second_order(1.0 / 7680.0) }).unwrap();
    let thread = RodSpec::straight(DVec3::ZERO, DVec3::X * 0.15, 120, 0.25e-3, Material::elastic(1e7, 1000.0));
    let rod = world.insert_rod(&RodSpec { stretch: Stretch::Inextensible, ..thread }).unwrap();
    world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Pin)).unwrap();
    for _ in 0..300 {
        let report = world.step(1.0 / 7680.0);
        assert!(report.incidents.is_empty() && report.rejected == 0, "{report:?}");
    }
    // The free end falls freely but for the last hundredth.
    let (t, tip) = (world.time(), world.rod(rod).unwrap().positions()[120]);
    assert!((tip.z / (-0.5 * 9.81 * t * t) - 1.0).abs() < 0.02, "{tip}");
}
