//! Free rigid bodies against closed forms (`docs/theory.md` 19).

use sutura::glam::{DQuat, DVec3};
use sutura::{
    Body, BodySpec, ColliderSpec, Friction, Geometry, GripSpec, Handle, Hold, Integrator, Material, Place, Pose,
    RodSpec, Settings, ShapeSpec, StepReport, World,
};

const DT: f64 = 1.0 / 60.0;
const G: f64 = 9.81;
/// Kilograms per cubic meter of all bodies here.
const DENSITY: f64 = 1000.0;

fn world(gravity: DVec3, mu: f64) -> World {
    World::new(Settings { gravity, friction: Friction { stick: mu, slide: mu }, ..Settings::default() }).unwrap()
}

fn run(world: &mut World, seconds: f64, mut watch: impl FnMut(&World, &StepReport)) {
    for _ in 0..(seconds / DT).round() as u32 {
        let report = world.step(DT);
        assert!(report.incidents.is_empty(), "{:?}", report.incidents);
        watch(world, &report);
    }
}

fn ground(world: &mut World, turn: DQuat) {
    world.insert_shape(&ShapeSpec::fixed(Geometry::Plane, Pose::new(DVec3::ZERO, turn))).unwrap();
}

#[test]
fn a_body_falls_as_implicit_euler_has_it() {
    let mut world = world(DVec3::Z * -G, 0.3);
    let ball = BodySpec::solid(Geometry::Sphere { radius: 0.01 }, DENSITY, Pose::IDENTITY);
    let body = world.insert_body(&BodySpec { velocity: DVec3::X, ..ball }).unwrap();
    run(&mut world, 0.5, |_, _| {});
    let (h, n) = (1.0 / 240.0, 120.0);
    let wanted = DVec3::new(0.5, 0.0, -G * h * h * n * (n + 1.0) / 2.0);
    let at = world.body(body).unwrap().pose().position;
    assert!((at - wanted).length() < 1e-12, "{at} {wanted}");
}

/// Moments 1:2:3 and the angular velocity after a second, from elliptic functions.
#[test]
fn a_free_top_turns_as_euler_says_and_keeps_its_momentum() {
    let plate = Geometry::Box { half_sides: DVec3::new(2f64.sqrt(), 1.0, 1e-3) * 0.01 };
    let tilted = DQuat::from_rotation_x(1.1) * DQuat::from_rotation_z(0.4);
    for (turn, integrator) in
        [DQuat::IDENTITY, tilted].map(|t| [Integrator::ImplicitEuler, Integrator::TrBdf2].map(|i| (t, i))).concat()
    {
        let error = |parts: f64| {
            let mut world = world(DVec3::ZERO, 0.3);
            let settings = Settings { integrator, substep: 1.0 / 240.0 / parts, ..world.settings().clone() };
            world.set_settings(settings).unwrap();
            let spec = BodySpec::solid(plate.clone(), DENSITY, Pose::new(DVec3::X, turn));
            let spin = turn * DVec3::new(3.0, 4.0, 5.0);
            let body = world.insert_body(&BodySpec { angular_velocity: spin, ..spec }).unwrap();
            let before = world.body(body).unwrap().angular_momentum();
            run(&mut world, 1.0, |_, _| {});
            let view = world.body(body).unwrap();
            assert!((view.angular_momentum() - before).length() < 1e-12 * before.length());
            let found = view.pose().orientation.conjugate() * view.angular_velocity();
            let wanted = DVec3::new(4.734_230_16, -1.608_435_52, 5.428_717_93);
            (found - wanted).length() / wanted.length()
        };
        let [whole, half] = [error(1.0), error(2.0)];
        assert!(whole < 1e-3, "{whole:e} with {integrator:?}");
        assert!(half < 0.3 * whole, "of second order: {whole:e} {half:e} with {integrator:?}");
    }
}

/// Starts a solid on a slope and gives its acceleration down the slope over g sin a.
fn rolling(geometry: Geometry, radius: f64, orientation: DQuat) -> f64 {
    let angle: f64 = 0.2;
    let turn = DQuat::from_rotation_y(angle);
    let mut world = world(DVec3::Z * -G, 0.5);
    ground(&mut world, turn);
    let out = turn * DVec3::Z;
    let spec = BodySpec::solid(geometry, DENSITY, Pose::new(out * radius, turn * orientation));
    let body = world.insert_body(&spec).unwrap();
    let time = 1.0;
    run(&mut world, time, |_, _| {});
    let view = world.body(body).unwrap();
    let off = view.center().dot(out) - radius;
    assert!(off.abs() < 1e-4 * radius, "off the slope by {off:e}");
    view.velocity().dot(turn * DVec3::X) / (G * angle.sin() * time)
}

#[test]
fn what_is_round_rolls_down_a_slope() {
    let sphere = rolling(Geometry::Sphere { radius: 0.01 }, 0.01, DQuat::IDENTITY);
    assert!((sphere / (5.0 / 7.0) - 1.0).abs() < 5e-3, "sphere {sphere}");
    let upright = DQuat::from_rotation_x(core::f64::consts::FRAC_PI_2);
    let cylinder = rolling(Geometry::Cylinder { radius: 0.01, half_length: 0.02 }, 0.01, upright);
    assert!((cylinder / (2.0 / 3.0) - 1.0).abs() < 5e-3, "cylinder {cylinder}");
}

#[test]
fn a_sliding_ball_comes_to_roll_at_five_sevenths_of_its_speed() {
    let (mu, speed) = (0.2, 1.0);
    let mut world = world(DVec3::Z * -G, mu);
    ground(&mut world, DQuat::IDENTITY);
    let ball = BodySpec::solid(Geometry::Sphere { radius: 0.01 }, DENSITY, Pose::at(DVec3::Z * 0.01));
    let body = world.insert_body(&BodySpec { velocity: DVec3::X * speed, ..ball }).unwrap();
    let wanted = 2.0 / 7.0 * speed / (mu * G);
    run(&mut world, 0.5 * wanted, |_, _| {});
    let half = world.body(body).unwrap().velocity().x;
    let t = world.time();
    assert!((half - (speed - mu * G * t)).abs() < 5e-3 * speed, "{half} after {t}");
    run(&mut world, wanted, |_, _| {});
    let view = world.body(body).unwrap();
    assert!((view.velocity().x / (5.0 / 7.0 * speed) - 1.0).abs() < 5e-3, "{}", view.velocity());
    assert!((view.angular_velocity().y * 0.01 - view.velocity().x).abs() < 1e-3 * speed, "{}", view.angular_velocity());
}

#[test]
fn a_box_holds_on_a_slope_up_to_its_friction_and_slides_beyond() {
    let mu: f64 = 0.3;
    for (part, slides) in [(0.97, false), (1.1, true)] {
        let angle = (part * mu).atan();
        let turn = DQuat::from_rotation_y(angle);
        let mut world = world(DVec3::Z * -G, mu);
        ground(&mut world, turn);
        let half = DVec3::new(0.02, 0.02, 0.01);
        let spec =
            BodySpec::solid(Geometry::Box { half_sides: half }, DENSITY, Pose::new(turn * DVec3::Z * 0.01, turn));
        let body = world.insert_body(&spec).unwrap();
        run(&mut world, 2.0, |_, _| {});
        let view = world.body(body).unwrap();
        let way = (view.center() - turn * DVec3::Z * 0.01).dot(turn * DVec3::X);
        if slides {
            let t = world.time();
            let wanted = 0.5 * G * (angle.sin() - mu * angle.cos()) * t * t;
            assert!((way / wanted - 1.0).abs() < 0.01, "{way} {wanted}");
        } else {
            assert!(way.abs() < 1e-6, "slid by {way:e}");
            assert!(world.body_wrench(body).unwrap().force.dot(DVec3::Z) > 0.99 * G * view.mass().mass);
        }
    }
}

fn stack(world: &mut World, count: u32) -> Vec<Handle<Body>> {
    let half = 0.01;
    (0..count)
        .map(|k| {
            let at = DVec3::new(0.002 * f64::from(k % 2), 0.0, half * (2.0 * f64::from(k) + 1.0));
            let cube = Geometry::Box { half_sides: DVec3::splat(half) };
            world.insert_body(&BodySpec::solid(cube, DENSITY, Pose::at(at))).unwrap()
        })
        .collect()
}

#[test]
fn a_stack_of_boxes_stands() {
    let mut world = world(DVec3::Z * -G, 0.5);
    ground(&mut world, DQuat::IDENTITY);
    let boxes = stack(&mut world, 5);
    let before: Vec<DVec3> = boxes.iter().map(|b| world.body(*b).unwrap().center()).collect();
    run(&mut world, 5.0, |_, _| {});
    for (b, was) in boxes.iter().zip(before) {
        let view = world.body(*b).unwrap();
        assert!((view.center() - was).length() < 1e-5, "{} {was}", view.center());
        assert!(view.velocity().length() < 1e-6, "{}", view.velocity());
    }
}

/// A thread that hits a ball: what one gains the other loses.
#[test]
fn a_thread_and_a_body_that_meet_keep_their_momentum() {
    let mut world = world(DVec3::ZERO, 0.3);
    let spec = RodSpec::straight(
        DVec3::new(-0.03, 0.0, 0.0),
        DVec3::new(0.03, 0.0, 0.0),
        40,
        3e-4,
        Material::elastic(1e8, 1150.0),
    );
    let rod = world.insert_rod(&spec).unwrap();
    let ball = Geometry::Sphere { radius: 2e-3 };
    let spec = BodySpec::solid(ball, DENSITY, Pose::at(DVec3::new(0.004, 0.0, 4e-3)));
    let body = world.insert_body(&BodySpec { velocity: DVec3::new(0.05, 0.0, -0.3), ..spec }).unwrap();
    let sum = |world: &World| world.rod(rod).unwrap().momentum() + world.body(body).unwrap().momentum();
    let before = sum(&world);
    let start = world.body(body).unwrap().momentum();
    run(&mut world, 0.2, |world, _| {
        let off = (sum(world) - before).length();
        assert!(off < 1e-6 * before.length(), "{off:e} at {}", world.time());
    });
    let handed = (world.body(body).unwrap().momentum() - start).length();
    assert!(handed > 0.1 * start.length(), "they met: {handed:e} of {:e}", start.length());
}

#[test]
fn a_snapshot_holds_bodies_and_dropped_memory_changes_no_bit() {
    let build = || {
        let mut world = world(DVec3::Z * -G, 0.5);
        ground(&mut world, DQuat::IDENTITY);
        stack(&mut world, 3);
        let spec = BodySpec::solid(Geometry::Sphere { radius: 0.005 }, DENSITY, Pose::at(DVec3::new(0.0, 0.0, 0.1)));
        world.insert_body(&BodySpec { angular_velocity: DVec3::new(1.0, 2.0, 3.0), ..spec }).unwrap();
        world
    };
    let (mut one, mut other) = (build(), build());
    for _ in 0..20 {
        one.step(DT);
        other.step(DT);
        other.forget_scratch();
    }
    assert_eq!(one.state_hash(), other.state_hash());
    let mut third = build();
    third.restore(&one.snapshot()).unwrap();
    assert_eq!(third.state_hash(), one.state_hash());
    for _ in 0..20 {
        one.step(DT);
        third.step(DT);
    }
    assert_eq!(third.state_hash(), one.state_hash());
}

#[test]
fn a_removed_body_is_gone_with_its_shapes() {
    let mut world = world(DVec3::Z * -G, 0.5);
    ground(&mut world, DQuat::IDENTITY);
    let boxes = stack(&mut world, 2);
    run(&mut world, 0.2, |_, _| {});
    assert_eq!(world.view().shapes().count(), 3);
    world.remove_body(boxes[0]).unwrap();
    assert_eq!(world.view().shapes().count(), 1 + 1);
    assert!(world.body(boxes[0]).is_err());
    run(&mut world, 0.5, |_, _| {});
    let z = world.body(boxes[1]).unwrap().center().z;
    assert!((z - 0.01).abs() < 1e-4, "{z}");
}

#[test]
fn a_ball_that_is_shot_at_a_thin_plate_stays_on_its_side() {
    for speed in [0.1, 1.0, 10.0, 50.0] {
        let mut world = world(DVec3::ZERO, 0.3);
        let plate = Geometry::Box { half_sides: DVec3::new(0.05, 0.05, 1e-4) };
        world.insert_shape(&ShapeSpec::fixed(plate, Pose::IDENTITY)).unwrap();
        let ball = BodySpec::solid(Geometry::Sphere { radius: 2e-3 }, DENSITY, Pose::at(DVec3::Z * 0.05));
        let body = world.insert_body(&BodySpec { velocity: DVec3::Z * -speed, ..ball }).unwrap();
        run(&mut world, 0.6, |_, _| {});
        let z = world.body(body).unwrap().center().z;
        assert!(z > 2.0e-3, "{z} at {speed} m/s");
    }
}

/// Without restitution the tangential velocity loses what friction may take, at most what makes the ball roll.
#[test]
fn an_oblique_impact_takes_what_friction_may() {
    for mu in [0.1, 0.5] {
        let mut world = world(DVec3::ZERO, mu);
        ground(&mut world, DQuat::IDENTITY);
        let ball = BodySpec::solid(Geometry::Sphere { radius: 0.01 }, DENSITY, Pose::at(DVec3::Z * 0.03));
        let body = world.insert_body(&BodySpec { velocity: DVec3::new(1.0, 0.0, -1.0), ..ball }).unwrap();
        run(&mut world, 0.2, |_, _| {});
        let v = world.body(body).unwrap().velocity();
        let wanted = 1.0 - f64::min(mu, 2.0 / 7.0);
        // The compliance of a contact gives back a thousandth.
        assert!((v.x / wanted - 1.0).abs() < 5e-3 && v.z.abs() < 2e-3, "{v} {wanted}");
    }
}

/// Hooks on a thread between two pins: the thread bears their weight, and the pins bear it all.
#[test]
fn a_thread_bears_the_bodies_that_hang_on_it() {
    let mut world = world(DVec3::Z * -G, 0.3);
    let (from, to) = (DVec3::X * -0.05, DVec3::X * 0.05);
    let rod = world.insert_rod(&RodSpec::straight(from, to, 100, 3e-4, Material::elastic(1e9, 1150.0))).unwrap();
    let pins = [Place::Start, Place::End].map(|p| world.insert_grip(&GripSpec::at_once(rod, p, Hold::Pin)).unwrap());
    let part = |at: DVec3, half_sides: DVec3| ColliderSpec {
        geometry: Geometry::Box { half_sides },
        pose: Pose::at(at),
        density: DENSITY,
        surface: 0,
    };
    let hooks: Vec<_> = [-0.02, 0.015]
        .map(|x| {
            let leg = DVec3::new(1e-3, 5e-4, 3e-3);
            let colliders = vec![
                part(DVec3::ZERO, DVec3::new(1e-3, 3e-3, 1e-3)),
                part(DVec3::new(0.0, 2.5e-3, -4e-3), leg),
                part(DVec3::new(0.0, -2.5e-3, -4e-3), leg),
            ];
            let body = BodySpec::solid(Geometry::Sphere { radius: 1.0 }, 0.0, Pose::at(DVec3::new(x, 0.0, 1.4e-3)));
            world.insert_body(&BodySpec { colliders, ..body }).unwrap()
        })
        .into();
    run(&mut world, 2.0, |_, _| {});
    let mut weight = 0.0;
    for hook in &hooks {
        let own = G * world.body(*hook).unwrap().mass().mass;
        let held = world.body_wrench(*hook).unwrap().force.z;
        assert!((held / own - 1.0).abs() < 5e-3, "{held} of {own}");
        weight += own;
    }
    let view = world.rod(rod).unwrap();
    weight += G * (0..view.n_elements()).map(|e| view.mass_per_length(e) * view.rest_lengths()[e]).sum::<f64>();
    let pinned: f64 = pins.iter().map(|p| world.grip_wrench(*p).unwrap().force.z).sum();
    assert!((pinned / weight - 1.0).abs() < 5e-3, "{pinned} of {weight}");
}

/// A ball that hits a free plate off its center turns it and does not pass it.
#[test]
fn a_fast_ball_does_not_pass_a_free_plate() {
    for (speed, off) in [(3.0, 8e-3), (10.0, 8e-3), (30.0, 3e-3), (45.0, 1e-3)] {
        let mut world = world(DVec3::ZERO, 0.3);
        let plate = Geometry::Box { half_sides: DVec3::new(0.01, 0.01, 5e-4) };
        let plate = world.insert_body(&BodySpec::solid(plate, DENSITY, Pose::IDENTITY)).unwrap();
        let at = Pose::at(DVec3::new(off, 0.0, 0.02));
        let ball = BodySpec::solid(Geometry::Sphere { radius: 1e-3 }, DENSITY, at);
        let ball = world.insert_body(&BodySpec { velocity: DVec3::Z * -speed, ..ball }).unwrap();
        let momentum = |b| world.body(b).unwrap().momentum();
        let before = momentum(ball);
        for _ in 0..2 {
            world.step(DT);
        }
        let momentum = |b| world.body(b).unwrap().momentum();
        assert!((momentum(ball) + momentum(plate) - before).length() < 1e-9 * before.length());
        // Without restitution a free plate hit at r takes 1 / (1 + m (1/M + r^2 / I)) of what stops the ball.
        let mass = world.body(plate).unwrap().mass();
        let m = world.body(ball).unwrap().mass().mass;
        let inertia = mass.mass * (4e-4 + 1e-6) / 12.0;
        let wanted = 1.0 / (1.0 + m * (1.0 / mass.mass + off * off / inertia));
        let taken = momentum(plate).z / before.z;
        assert!((taken / wanted - 1.0).abs() < 0.1, "{speed} m/s at {off}: the plate took {taken} for {wanted}");
    }
}
