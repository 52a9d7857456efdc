//! Joints of free bodies against closed forms (`docs/theory.md` 21).

use core::f64::consts::{FRAC_PI_2, PI, TAU};
use sutura::glam::{DQuat, DVec3};
use sutura::input::{Recorder, Recording};
use sutura::math::log;
use sutura::{
    Body, BodySpec, ColliderSpec, Friction, Geometry, Handle, Integrator, Joint, JointKind, JointSpec, Motor, Pose,
    Settings, ShapeSpec, StepReport, World,
};

const DT: f64 = 1.0 / 60.0;
const G: f64 = 9.81;
/// Kilograms per cubic meter of all bodies here.
const DENSITY: f64 = 1000.0;

fn settings() -> Settings {
    Settings {
        gravity: DVec3::Z * -G,
        integrator: Integrator::TrBdf2,
        friction: Friction { stick: 0.3, slide: 0.3 },
        ..Settings::default()
    }
}

fn run(world: &mut World, seconds: f64, dt: f64, mut watch: impl FnMut(&World, &StepReport)) {
    for _ in 0..(seconds / dt).round() as u32 {
        let report = world.step(dt);
        assert!(report.incidents.is_empty(), "{:?} at {}", report.incidents, world.time());
        watch(world, &report);
    }
}

fn bar(half: DVec3, pose: Pose) -> BodySpec {
    BodySpec::solid(Geometry::Box { half_sides: half }, DENSITY, pose)
}

/// A joint at a place in the world.
fn join(world: &World, kind: JointKind, bodies: [Option<Handle<Body>>; 2], at: Pose) -> JointSpec {
    JointSpec::new(kind, bodies, world.joint_frames(bodies, at).unwrap())
}

/// The frame of a joint at a place whose axis is y.
fn about_y(at: DVec3) -> Pose {
    Pose::new(at, DQuat::from_rotation_x(-FRAC_PI_2))
}

fn energy(world: &World) -> f64 {
    world.view().bodies().map(|b| b.energy().kinetic + b.energy().gravity).sum()
}

/// Complete elliptic integral of the first kind of the modulus k, by the arithmetic-geometric mean.
fn elliptic_k(k: f64) -> f64 {
    let (mut a, mut b) = (1.0, (1.0 - k * k).sqrt());
    for _ in 0..20 {
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
    }
    FRAC_PI_2 / a
}

/// A bar of 20 cm on a hinge at its end, about y, let go at an angle from hanging.
fn pendulum(world: &mut World, angle: f64) -> (Handle<Body>, Handle<Joint>) {
    let half = DVec3::new(0.005, 0.005, 0.1);
    let hanging = DQuat::from_rotation_y(-angle);
    let body = world.insert_body(&bar(half, Pose::new(hanging * DVec3::new(0.0, 0.0, -0.1), hanging))).unwrap();
    // The angle of the hinge is counted from where it is let go.
    let joint = world.insert_joint(&join(world, JointKind::Hinge, [None, Some(body)], about_y(DVec3::ZERO))).unwrap();
    (body, joint)
}

#[test]
fn a_pendulum_swings_as_the_elliptic_integral_has_it() {
    for angle in [0.1, 1.0, 2.5] {
        let mut world = World::new(settings()).unwrap();
        let (body, joint) = pendulum(&mut world, angle);
        let mass = world.body(body).unwrap().mass();
        let inertia = mass.mass * (0.04 + 1e-4) / 12.0 + mass.mass * 0.01;
        let small = TAU * (inertia / (mass.mass * G * 0.1)).sqrt();
        let wanted = small * 2.0 / PI * elliptic_k((0.5 * angle).sin());
        // Times at which it passes the vertical, by interpolation.
        let (mut before, mut passes) = ((0.0, angle), Vec::new());
        let mut off = 0.0f64;
        run(&mut world, 2.2 * wanted, DT / 4.0, |world, _| {
            let view = world.joint(joint).unwrap();
            let now = (world.time(), angle - view.coordinate());
            let [a, b] = view.frames().map(|f| f.position);
            off = off.max((a - b).length());
            if before.1 * now.1 < 0.0 {
                passes.push(before.0 + (now.0 - before.0) * before.1 / (before.1 - now.1));
            }
            before = now;
        });
        let period = passes[2] - passes[0];
        assert!((period / wanted - 1.0).abs() < 5e-3, "{period} {wanted}");
        assert!(off < 1e-9, "{off:e}");
    }
}

#[test]
fn a_double_pendulum_keeps_its_energy() {
    let mut world = World::new(Settings { substep: 1e-3, ..settings() }).unwrap();
    let half = DVec3::new(0.1, 0.005, 0.005);
    let first = world.insert_body(&bar(half, Pose::at(DVec3::X * 0.1))).unwrap();
    let second = world.insert_body(&bar(half, Pose::at(DVec3::X * 0.3))).unwrap();
    world.insert_joint(&join(&world, JointKind::Hinge, [None, Some(first)], about_y(DVec3::ZERO))).unwrap();
    world.insert_joint(&join(&world, JointKind::Hinge, [Some(first), Some(second)], about_y(DVec3::X * 0.2))).unwrap();
    let before = energy(&world);
    let scale = world.view().bodies().map(|b| b.mass().mass).sum::<f64>() * G * 0.2;
    let (mut most, mut least) = (0.0f64, 0.0f64);
    run(&mut world, 5.0, DT, |world, _| {
        let drift = (energy(world) - before) / scale;
        (most, least) = (most.max(drift), least.min(drift));
    });
    assert!(most < 1e-4 && least > -5e-3, "{most:e} {least:e}");
}

/// Around the vertical at an angle: omega^2 (I1 + m l^2 - I3) cos a = m g l of a bar that does not spin about itself in
/// the turning frame.
#[test]
fn a_conical_pendulum_goes_round_in_its_time() {
    let mut world = World::new(settings()).unwrap();
    let (angle, l) = (0.6f64, 0.1);
    let turn = DQuat::from_rotation_y(-angle);
    let spec = bar(DVec3::new(0.005, 0.005, l), Pose::new(turn * DVec3::Z * -l, turn));
    let m = spec.mass_properties().unwrap().mass;
    let (across, along) = (m * (4.0 * l * l + 1e-4) / 12.0, m * 2e-4 / 12.0);
    let omega = (m * G * l / ((across + m * l * l - along) * angle.cos())).sqrt();
    let spin = DVec3::Z * omega;
    let velocity = spin.cross(spec.pose.position);
    let body = world.insert_body(&BodySpec { velocity, angular_velocity: spin, ..spec }).unwrap();
    let joint = world.insert_joint(&join(&world, JointKind::Ball, [None, Some(body)], Pose::IDENTITY)).unwrap();
    let (start, mut height) = (world.body(body).unwrap().center(), 0.0f64);
    let wanted = TAU / omega;
    let (mut last, mut angle_gone) = (start, 0.0);
    run(&mut world, 2.0, 1.0 / 240.0, |world, _| {
        let now = world.body(body).unwrap().center();
        angle_gone += (last.x * now.y - last.y * now.x).atan2(last.x * now.x + last.y * now.y);
        height = height.max((now.z - start.z).abs());
        last = now;
    });
    let period = TAU * world.time() / angle_gone;
    let pull = world.joint(joint).unwrap().force();
    assert!((period / wanted - 1.0).abs() < 5e-3 && height < 1e-3 * l, "{period} {wanted} {height:e}");
    assert!((pull.z / (m * G) - 1.0).abs() < 5e-3);
    let inward = pull - DVec3::Z * pull.z;
    let wanted = m * omega * omega * l * angle.sin();
    assert!((inward.length() / wanted - 1.0).abs() < 1e-2, "{} {wanted}", inward.length());
}

/// Two bars that are one, on a hinge, and the one that they are.
#[test]
fn bodies_fixed_to_each_other_move_as_one() {
    for (substep, bound) in [(1.0 / 240.0, 1e-4), (1.0 / 3840.0, 1e-6)] {
        let half = DVec3::new(0.02, 0.01, 0.05);
        let part = |z: f64| ColliderSpec {
            geometry: Geometry::Box { half_sides: half },
            pose: Pose::at(DVec3::Z * z),
            density: DENSITY,
            surface: 0,
        };
        let spin = DVec3::new(1.0, 2.0, 0.5);
        let of = |at: DVec3| spin.cross(at) + DVec3::new(0.1, 0.0, 1.0);
        let mut two = World::new(Settings { substep, ..settings() }).unwrap();
        let [a, b] = [-0.05, 0.05].map(|z| {
            let at = DVec3::Z * z;
            let spec = BodySpec { velocity: of(at), angular_velocity: spin, ..bar(half, Pose::at(at)) };
            two.insert_body(&spec).unwrap()
        });
        two.insert_joint(&join(&two, JointKind::Fixed, [Some(a), Some(b)], Pose::at(DVec3::X * 0.01))).unwrap();
        let mut one = World::new(Settings { substep, ..settings() }).unwrap();
        let compound = BodySpec {
            colliders: vec![part(-0.05), part(0.05)],
            velocity: of(DVec3::ZERO),
            angular_velocity: spin,
            ..bar(half, Pose::IDENTITY)
        };
        let c = one.insert_body(&compound).unwrap();
        run(&mut two, 0.5, DT, |_, _| {});
        run(&mut one, 0.5, DT, |_, _| {});
        let pose = one.body(c).unwrap().pose();
        let off = [(a, -0.05), (b, 0.05)].map(|(body, z)| {
            let found = two.body(body).unwrap().pose();
            let turn = log(found.orientation * pose.orientation.conjugate()).length();
            ((found.position - pose.transform_point(DVec3::Z * z)).length(), turn)
        });
        assert!(off.iter().all(|(way, turn)| *way < 0.1 * bound && *turn < bound), "{off:?}");
    }
}

#[test]
fn a_slider_goes_down_an_incline() {
    let mut world = World::new(settings()).unwrap();
    let angle: f64 = 0.4;
    let down = DVec3::new(angle.cos(), 0.0, -angle.sin());
    let axis = Pose::new(DVec3::new(0.0, 0.1, 0.0), DQuat::from_rotation_arc(DVec3::Z, down));
    let body = world.insert_body(&bar(DVec3::new(0.02, 0.01, 0.03), Pose::IDENTITY)).unwrap();
    let joint = world.insert_joint(&join(&world, JointKind::Slider, [None, Some(body)], axis)).unwrap();
    run(&mut world, 1.0, DT, |_, _| {});
    let view = world.joint(joint).unwrap();
    let wanted = 0.5 * G * angle.sin();
    let mass = world.body(body).unwrap().mass().mass;
    assert!((view.coordinate() / wanted - 1.0).abs() < 1e-6);
    assert!((view.force().length() / (mass * G * angle.cos()) - 1.0).abs() < 1e-6);
    let turned = log(world.body(body).unwrap().pose().orientation).length();
    assert!(turned < 1e-9, "{turned:e}");
}

#[test]
fn a_limit_stops_a_hinge_and_bears_its_weight() {
    for integrator in [Integrator::ImplicitEuler, Integrator::TrBdf2] {
        let mut world = World::new(Settings { integrator, ..settings() }).unwrap();
        let body = world.insert_body(&bar(DVec3::new(0.1, 0.005, 0.005), Pose::at(DVec3::X * 0.1))).unwrap();
        let spec = join(&world, JointKind::Hinge, [None, Some(body)], about_y(DVec3::ZERO));
        // It falls, which is a positive turn about y.
        let joint = world.insert_joint(&JointSpec { limits: Some([-0.1, 0.5]), ..spec }).unwrap();
        let mut most = 0.0f64;
        run(&mut world, 2.0, DT, |world, _| most = most.max(world.joint(joint).unwrap().coordinate()));
        let view = world.joint(joint).unwrap();
        let wanted = -world.body(body).unwrap().mass().mass * G * 0.1 * 0.5f64.cos();
        assert!(most < 0.5 + 1e-4, "{most}");
        assert!((view.coordinate() - 0.5).abs() < 1e-4);
        assert!((view.limit_force() / wanted - 1.0).abs() < 1e-3, "{} {wanted}", view.limit_force());
        assert!((view.torque().y / wanted - 1.0).abs() < 1e-3);
        assert!((view.force().z / (world.body(body).unwrap().mass().mass * G) - 1.0).abs() < 1e-3);
    }
}

#[test]
fn a_motor_keeps_to_its_torque_and_reaches_its_speed() {
    for integrator in [Integrator::ImplicitEuler, Integrator::TrBdf2] {
        let mut world = World::new(Settings { integrator, gravity: DVec3::ZERO, ..settings() }).unwrap();
        let wheel = Geometry::Cylinder { radius: 0.05, half_length: 0.01 };
        let body = world.insert_body(&BodySpec::solid(wheel, DENSITY, Pose::IDENTITY)).unwrap();
        let inertia = 0.5 * world.body(body).unwrap().mass().mass * 0.05 * 0.05;
        let (speed, most) = (10.0, 20.0 * inertia);
        let spec = join(&world, JointKind::Hinge, [None, Some(body)], Pose::IDENTITY);
        let joint = world.insert_joint(&JointSpec { motor: Some(Motor { speed, most }), ..spec }).unwrap();
        run(&mut world, 1.0, 1.0 / 240.0, |world, _| {
            let (t, view) = (world.time(), world.joint(joint).unwrap());
            assert!(view.motor_force().abs() <= most, "{} {most}", view.motor_force());
            let wanted = (20.0 * t).min(speed);
            assert!((view.rate() - wanted).abs() < 1e-6 * speed, "{} {wanted} at {t}", view.rate());
        });
        let view = world.joint(joint).unwrap();
        assert!(view.motor_force().abs() < 1e-6 * most);
        // 0.5 s at 20 rad/s^2, then 10 rad/s: more than a turn is counted.
        assert!((view.coordinate() - 7.5).abs() < 0.05, "{}", view.coordinate());
    }
}

/// Friction of a hinge holds up to its bound, and slows by it.
#[test]
fn friction_of_a_joint_holds_and_brakes() {
    let run_with = |part: f64| {
        let mut world = World::new(settings()).unwrap();
        let body = world.insert_body(&bar(DVec3::new(0.1, 0.005, 0.005), Pose::at(DVec3::X * 0.1))).unwrap();
        let torque = world.body(body).unwrap().mass().mass * G * 0.1;
        let spec = join(&world, JointKind::Hinge, [None, Some(body)], about_y(DVec3::ZERO));
        let joint = world.insert_joint(&JointSpec { friction: part * torque, ..spec }).unwrap();
        run(&mut world, 0.1, 1.0 / 240.0, |_, _| {});
        let view = world.joint(joint).unwrap();
        let inertia = world.body(body).unwrap().mass().mass * (0.04 / 3.0 + 1e-4 / 12.0);
        (view.coordinate(), view.friction_force() / torque, torque / inertia)
    };
    let (still, force, _) = run_with(1.01);
    assert!(still.abs() < 1e-9 && (force + 1.0).abs() < 1e-6, "{still:e} {force}");
    let (turned, force, rate) = run_with(0.5);
    assert!((turned / (0.25 * rate * 0.01) - 1.0).abs() < 0.02 && (force + 0.5).abs() < 1e-12);
}

/// Five light bars and a ball of ten thousand times the mass of each: a string of no mass and a ball, whose slow mode
/// is known.
#[test]
fn light_links_carry_a_heavy_end() {
    let mut world = World::new(settings()).unwrap();
    let (n, link, angle) = (5, 0.02, 0.1f64);
    let turn = DQuat::from_rotation_y(-angle);
    let place = |d: f64| turn * DVec3::new(0.0, 0.0, -d);
    let mut bodies = Vec::new();
    for k in 0..n {
        let at = place(link * (f64::from(k) + 0.5));
        let spec = bar(DVec3::new(5e-4, 5e-4, 0.5 * link), Pose::new(at, turn));
        bodies.push(world.insert_body(&spec).unwrap());
    }
    let light = world.body(bodies[0]).unwrap().mass().mass;
    let (l, r) = (link * f64::from(n), (1e4 * light / (4.0 / 3.0 * PI * DENSITY)).cbrt());
    let ball = BodySpec::solid(Geometry::Sphere { radius: r }, DENSITY, Pose::new(place(l + r), turn));
    bodies.push(world.insert_body(&ball).unwrap());
    for (k, below) in bodies.iter().enumerate() {
        let above = if k > 0 { Some(bodies[k - 1]) } else { None };
        let spec = join(&world, JointKind::Ball, [above, Some(*below)], Pose::at(place(link * k as f64)));
        world.insert_joint(&spec).unwrap();
    }
    let (mut before, mut passes, mut off) = ((0.0, 1.0), Vec::new(), 0.0f64);
    run(&mut world, 2.0, DT / 4.0, |world, _| {
        for j in world.view().joints() {
            let [a, b] = j.frames().map(|f| f.position);
            off = off.max((a - b).length());
        }
        let now = (world.time(), world.view().bodies().last().unwrap().center().x);
        if before.1 * now.1 < 0.0 {
            passes.push(before.0 + (now.0 - before.0) * before.1 / (before.1 - now.1));
        }
        before = now;
    });
    // m (l a + r b)^2 / 2 + 0.4 m r^2 b^2 / 2 in the rates of the two angles, g (l a^2 + r b^2) m / 2 in the angles:
    // 0.4 l r^2 w^4 - (1.4 r + l) g r w^2 + g^2 r = 0, over l r.
    let (p, q, c) = (0.4 * l * r * r, (1.4 * r + l) * G * r, G * G * r);
    let squared = (q - (q * q - 4.0 * p * c).sqrt()) / (2.0 * p);
    let wanted = TAU / squared.sqrt() * (1.0 + angle * angle / 16.0);
    let period = passes[4] - passes[2];
    assert!((period / wanted - 1.0).abs() < 5e-3, "{period} {wanted}");
    assert!(off < 1e-9, "{off:e}");
}

fn chain(turn: DQuat, kind: JointKind) -> (World, Vec<Handle<Body>>, Vec<Handle<Joint>>) {
    let mut world = World::new(Settings { gravity: turn * DVec3::Z * -G, ..settings() }).unwrap();
    let link = 0.02;
    let (mut bodies, mut joints) = (Vec::new(), Vec::new());
    for k in 0..20 {
        let at = turn * DVec3::Z * (-link * (f64::from(k) + 0.5));
        let spec = bar(DVec3::new(0.003, 0.003, 0.5 * link), Pose::new(at, turn));
        let body = world.insert_body(&spec).unwrap();
        let above = bodies.last().copied();
        let at = Pose::new(DVec3::ZERO, turn).compose(&about_y(DVec3::Z * (-link * f64::from(k))));
        joints.push(world.insert_joint(&join(&world, kind, [above, Some(body)], at)).unwrap());
        bodies.push(body);
    }
    (world, bodies, joints)
}

#[test]
fn a_chain_hangs_without_sag_and_its_top_bears_its_weight() {
    let (mut world, bodies, joints) = chain(DQuat::IDENTITY, JointKind::Ball);
    let before: Vec<DVec3> = bodies.iter().map(|b| world.body(*b).unwrap().center()).collect();
    run(&mut world, 1.0, DT, |_, _| {});
    let mass: f64 = world.view().bodies().map(|b| b.mass().mass).sum();
    let pull = world.joint(joints[0]).unwrap().force();
    let sag =
        bodies.iter().zip(&before).map(|(b, x)| (world.body(*b).unwrap().center() - *x).length()).fold(0.0, f64::max);
    assert!((pull.z / (mass * G) - 1.0).abs() < 1e-6, "{pull} {}", mass * G);
    assert!(sag < 1e-6, "{sag:e}");
}

#[test]
fn a_turned_chain_swings_as_the_other_turned() {
    let turn = DQuat::from_rotation_y(0.7) * DQuat::from_rotation_x(0.4);
    let ends = [DQuat::IDENTITY, turn].map(|turn| {
        let (mut world, bodies, joints) = chain(turn, JointKind::Hinge);
        let tilt = Settings { gravity: turn * DVec3::new(3.0, 4.0, -8.0), ..settings() };
        world.set_settings(tilt).unwrap();
        run(&mut world, 0.25, DT, |_, _| {});
        let end = world.body(bodies[19]).unwrap().center();
        (turn.conjugate() * end, turn.conjugate() * world.joint(joints[3]).unwrap().force())
    });
    assert!((ends[0].0 - ends[1].0).length() < 1e-9);
    assert!((ends[0].1 - ends[1].1).length() < 1e-6 * ends[0].1.length());
}

/// A bar on a hinge at one end, the other on a floor: forces and moments balance.
#[test]
fn a_bar_rests_on_a_hinge_and_a_floor() {
    let mut world = World::new(settings()).unwrap();
    world.insert_shape(&ShapeSpec::fixed(Geometry::Plane, Pose::IDENTITY)).unwrap();
    let body = world.insert_body(&bar(DVec3::new(0.1, 0.01, 0.005), Pose::at(DVec3::Z * 0.02))).unwrap();
    let at = DVec3::new(-0.1, 0.0, 0.02);
    let joint = world.insert_joint(&join(&world, JointKind::Hinge, [None, Some(body)], about_y(at))).unwrap();
    run(&mut world, 1.0, DT, |_, _| {});
    let view = world.body(body).unwrap();
    let weight = DVec3::Z * -G * view.mass().mass;
    let floor: DVec3 = world.contacts().map(|c| -c.force).sum();
    let moment: DVec3 = world.contacts().map(|c| (c.point - at).cross(-c.force)).sum();
    let hinge = world.joint(joint).unwrap().force();
    let off = (view.center() - at).cross(weight) + moment;
    assert!(floor.z > 0.4 * weight.length());
    assert!((floor + hinge + weight).length() < 1e-5 * weight.length(), "{floor} {hinge} {weight}");
    assert!(off.y.abs() < 1e-5 * weight.length() * 0.1, "{off}");
}

#[test]
fn a_closed_loop_of_hinges_moves_and_keeps_together() {
    // A parallelogram whose hinges hold twice what holds already.
    let mut world = World::new(settings()).unwrap();
    let leg = DVec3::new(0.005, 0.005, 0.05);
    let legs = [-0.05, 0.05].map(|x| world.insert_body(&bar(leg, Pose::at(DVec3::new(x, 0.0, -0.05)))).unwrap());
    let beam = world.insert_body(&bar(DVec3::new(0.05, 0.005, 0.005), Pose::at(DVec3::Z * -0.1))).unwrap();
    let mut joints = Vec::new();
    for (leg, x) in legs.into_iter().zip([-0.05, 0.05]) {
        for (other, z) in [(None, 0.0), (Some(beam), -0.1)] {
            let spec = join(&world, JointKind::Hinge, [other, Some(leg)], about_y(DVec3::new(x, 0.0, z)));
            joints.push(world.insert_joint(&spec).unwrap());
        }
    }
    world.set_settings(Settings { gravity: DVec3::new(5.0, 0.0, -G), ..settings() }).unwrap();
    let before = energy(&world);
    let (mut off, mut gain) = (0.0f64, 0.0f64);
    run(&mut world, 2.0, DT, |world, _| {
        for j in world.view().joints() {
            let [a, b] = j.frames();
            off = off.max((a.position - b.position).length());
        }
        gain = gain.max(energy(world) - before);
    });
    assert!(off < 1e-9, "{off:e}");
    assert!(gain < 1e-4 * before.abs(), "{gain:e} of {before}");
    let angle = world.joint(joints[0]).unwrap().coordinate();
    assert!(angle.abs() > 0.3, "it moves: {angle}");
}

/// A chain that is let go sideways and whips: no step makes energy, whatever the method.
#[test]
fn a_whipping_chain_gains_no_energy() {
    for (integrator, kind) in [Integrator::ImplicitEuler, Integrator::TrBdf2]
        .map(|i| [JointKind::Ball, JointKind::Hinge].map(|k| (i, k)))
        .concat()
    {
        let mut world = World::new(Settings { integrator, ..settings() }).unwrap();
        let mut above = None;
        for k in 0..8 {
            let at = DVec3::X * (0.03 * (f64::from(k) + 0.5));
            let body = world.insert_body(&bar(DVec3::new(0.015, 0.003, 0.003), Pose::at(at))).unwrap();
            let at = about_y(DVec3::X * (0.03 * f64::from(k)));
            let spec = JointSpec { friction: 0.0, ..join(&world, kind, [above, Some(body)], at) };
            world.insert_joint(&spec).unwrap();
            above = Some(body);
        }
        let scale = world.view().bodies().map(|b| b.mass().mass).sum::<f64>() * G * 0.12;
        let (start, mut before, mut gain) = (energy(&world), energy(&world), 0.0f64);
        run(&mut world, 3.0, DT, |world, _| {
            gain = gain.max((energy(world) - before) / scale);
            before = energy(world);
        });
        assert!(gain < 3e-4, "{gain:e}");
        assert!(before - start < -0.5 * scale, "{integrator:?}: {before} {start}");
    }
}

/// On a joint with a motor that lifts, with friction, limits and contact: one of each.
fn machine(world: &mut Recorder) -> (Vec<Handle<Body>>, Vec<Handle<Joint>>) {
    world.insert_shape(&ShapeSpec::fixed(Geometry::Plane, Pose::at(DVec3::Z * -0.2))).unwrap();
    let bodies: Vec<_> = (0..4)
        .map(|k| {
            let at = Pose::at(DVec3::X * (0.06 * f64::from(k) + 0.03));
            world.insert_body(&bar(DVec3::new(0.03, 0.01, 0.005), at)).unwrap()
        })
        .collect();
    let at = |k: usize| about_y(DVec3::X * (0.06 * k as f64));
    let hinge = join(world, JointKind::Hinge, [None, Some(bodies[0])], at(0));
    let motor = Some(Motor { speed: 3.0, most: 0.05 });
    let joints = vec![
        world.insert_joint(&JointSpec { motor, ..hinge }).unwrap(),
        world.insert_joint(&join(world, JointKind::Ball, [Some(bodies[0]), Some(bodies[1])], at(1))).unwrap(),
        world
            .insert_joint(&JointSpec {
                limits: Some([-0.3, 0.4]),
                friction: 1e-3,
                ..join(world, JointKind::Hinge, [Some(bodies[1]), Some(bodies[2])], at(2))
            })
            .unwrap(),
        world
            .insert_joint(&JointSpec {
                limits: Some([-0.01, 0.01]),
                ..join(world, JointKind::Slider, [Some(bodies[2]), Some(bodies[3])], at(3))
            })
            .unwrap(),
    ];
    (bodies, joints)
}

#[test]
fn a_snapshot_holds_joints_and_dropped_memory_changes_no_bit() {
    let build = || {
        let mut world = Recorder::new(settings(), true).unwrap();
        let (bodies, joints) = machine(&mut world);
        (world, bodies, joints)
    };
    let ((mut one, ..), (mut other, ..)) = (build(), build());
    for _ in 0..30 {
        let report = one.step(DT);
        assert!(report.incidents.is_empty(), "{:?}", report.incidents);
        other.step(DT);
        other.forget_scratch();
    }
    assert_eq!(one.state_hash(), other.state_hash());
    let bytes = one.snapshot();
    let (mut third, bodies, joints) = build();
    third.restore(&bytes).unwrap();
    assert_eq!(third.snapshot(), bytes);
    for _ in 0..30 {
        one.step(DT);
        third.step(DT);
    }
    assert_eq!(third.state_hash(), one.state_hash());
    // What is cut off or changed is refused, and changes nothing.
    for n in [bytes.len() - 1, bytes.len() - 20, 60] {
        assert!(third.restore(&bytes[..n]).is_err());
    }
    let mut plain = bytes.clone();
    plain[7 - 1] = 5;
    assert!(third.restore(&plain).is_err());
    assert_eq!(third.state_hash(), one.state_hash());
    // Another joint is another world.
    third.remove_joint(joints[3]).unwrap();
    assert!(third.restore(&bytes).unwrap_err().to_string().contains("joint"));
    let frames = third.joint_frames([Some(bodies[2]), Some(bodies[3])], Pose::IDENTITY).unwrap();
    third.insert_joint(&JointSpec::new(JointKind::Fixed, [Some(bodies[2]), Some(bodies[3])], frames)).unwrap();
    assert!(third.restore(&bytes).unwrap_err().to_string().contains("joint"));
    // Done again from its bytes, each step leaves the same hash.
    let recording = Recording::from_bytes(&one.take_recording().unwrap().to_bytes()).unwrap();
    let mut steps = 0;
    recording
        .replay(&mut |r| {
            assert!(r.is_same(), "step {}", r.step);
            steps += 1;
            core::ops::ControlFlow::Continue(())
        })
        .unwrap();
    assert_eq!(steps, 60);
}

#[test]
fn a_world_without_joints_writes_none() {
    let mut world = World::new(settings()).unwrap();
    let (body, joint) = pendulum(&mut world, 0.3);
    world.remove_joint(joint).unwrap();
    let mut same = World::new(settings()).unwrap();
    let (other, _) = pendulum(&mut same, 0.3);
    same.remove_body(other).unwrap();
    assert!(same.view().joints().next().is_none(), "a removed body takes its joints along");
    assert!(world.joint(joint).is_err());
    assert_eq!(world.snapshot()[6], 5);
    world.step(DT);
    assert!(world.body(body).unwrap().velocity().z < -0.1);
}

#[test]
fn joints_that_make_no_sense_are_refused() {
    let mut world = World::new(settings()).unwrap();
    let body = world.insert_body(&bar(DVec3::splat(0.01), Pose::IDENTITY)).unwrap();
    let good = join(&world, JointKind::Hinge, [None, Some(body)], Pose::IDENTITY);
    let apart = [Pose::at(DVec3::X * 1e-3), good.frames[1]];
    let tilted = [Pose::new(DVec3::ZERO, DQuat::from_rotation_x(0.01)), good.frames[1]];
    let cases = [
        ("bodies", JointSpec { bodies: [None, None], ..good.clone() }),
        ("bodies", JointSpec { bodies: [Some(body), Some(body)], ..good.clone() }),
        ("frames", JointSpec { frames: apart, ..good.clone() }),
        ("frames", JointSpec { frames: tilted, ..good.clone() }),
        ("frames", JointSpec { frames: [Pose::at(DVec3::NAN), Pose::IDENTITY], ..good.clone() }),
        ("compliance", JointSpec { compliance: -1.0, ..good.clone() }),
        ("angular_compliance", JointSpec { angular_compliance: f64::INFINITY, ..good.clone() }),
        ("friction", JointSpec { friction: f64::NAN, ..good.clone() }),
        ("limits", JointSpec { limits: Some([1.0, -1.0]), ..good.clone() }),
        ("limits", JointSpec { limits: Some([0.1, 1.0]), ..good.clone() }),
        ("limits", JointSpec { limits: Some([-1.0, 1.0]), kind: JointKind::Ball, ..good.clone() }),
        ("motor", JointSpec { motor: Some(Motor { speed: 1.0, most: 1.0 }), kind: JointKind::Fixed, ..good.clone() }),
        ("motor.most", JointSpec { motor: Some(Motor { speed: 1.0, most: 0.0 }), ..good.clone() }),
    ];
    let hash = world.state_hash();
    for (field, spec) in cases {
        let error = world.insert_joint(&spec).unwrap_err().to_string();
        assert!(error.contains(&format!("joint: {field} is")), "{field}: {error}");
    }
    assert_eq!(world.state_hash(), hash);
    world.insert_joint(&good).unwrap();
}

/// A joint with compliance gives way by its force.
#[test]
fn a_joint_gives_way_as_its_compliance_says() {
    let mut world = World::new(Settings { linear_drag: 20.0, ..settings() }).unwrap();
    let body = world.insert_body(&bar(DVec3::splat(0.01), Pose::IDENTITY)).unwrap();
    let spec = JointSpec { compliance: 0.01, ..join(&world, JointKind::Fixed, [None, Some(body)], Pose::IDENTITY) };
    world.insert_joint(&spec).unwrap();
    run(&mut world, 3.0, DT, |_, _| {});
    let view = world.body(body).unwrap();
    let wanted = -0.01 * G * view.mass().mass;
    assert!((view.center().z / wanted - 1.0).abs() < 1e-3, "{} {wanted}", view.center().z);
}

/// Bodies that are joined lie in each other, unless they are to touch.
#[test]
fn joined_bodies_touch_where_they_are_to() {
    for touch in [false, true] {
        let mut world = World::new(settings()).unwrap();
        let half = DVec3::new(0.03, 0.005, 0.005);
        let upper = world.insert_body(&bar(half, Pose::at(DVec3::X * 0.03))).unwrap();
        let lower = world.insert_body(&bar(half, Pose::at(DVec3::new(0.03, 0.0, -0.011)))).unwrap();
        world.insert_joint(&join(&world, JointKind::Fixed, [None, Some(lower)], Pose::IDENTITY)).unwrap();
        let spec = join(&world, JointKind::Hinge, [Some(lower), Some(upper)], about_y(DVec3::ZERO));
        let joint = world.insert_joint(&JointSpec { touch, ..spec }).unwrap();
        let mut angle = 0.0f64;
        run(&mut world, 0.5, DT, |world, _| angle = angle.max(world.joint(joint).unwrap().coordinate()));
        if touch {
            assert!((angle - 0.001 / 0.06).abs() < 2e-3, "{angle}");
        } else {
            assert!(angle > 0.5, "{angle}");
        }
    }
}

/// A motor that lifts bears the weight at its speed; one too weak falls with what is left of gravity.
#[test]
fn a_motor_lifts_what_it_can() {
    for (part, lifts) in [(1.5, true), (0.75, false)] {
        let mut world = World::new(settings()).unwrap();
        let body = world.insert_body(&bar(DVec3::splat(0.02), Pose::IDENTITY)).unwrap();
        let weight = G * world.body(body).unwrap().mass().mass;
        let spec = join(&world, JointKind::Slider, [None, Some(body)], Pose::IDENTITY);
        let motor = Some(Motor { speed: 0.1, most: part * weight });
        let joint = world.insert_joint(&JointSpec { motor, ..spec }).unwrap();
        run(&mut world, 0.5, DT, |world, _| {
            assert!(world.joint(joint).unwrap().motor_force() <= part * weight);
        });
        let view = world.joint(joint).unwrap();
        let (rate, force) = if lifts { (0.1, weight) } else { (-0.25 * G * 0.5, 0.75 * weight) };
        assert!((view.rate() / rate - 1.0).abs() < 1e-6, "{} {rate}", view.rate());
        assert!((view.motor_force() / force - 1.0).abs() < 1e-6, "{} {force}", view.motor_force());
        assert!((view.force().z / force - 1.0).abs() < 1e-6);
    }
}
