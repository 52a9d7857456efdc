//! Threads attached to bodies: a weight, a needle, a bead (`docs/theory.md` 20).

use sutura::glam::{DQuat, DVec3};
use sutura::{
    Body, BodyMotion, BodySpec, ColliderSpec, Geometry, GripSpec, Handle, Hold, Integrator, Material, NeedleSpec,
    Place, Pose, Rod, RodSpec, Settings, WeldRest, WeldSpec, World,
};

const G: f64 = 9.81;
const DT: f64 = 1.0 / 240.0;

/// A bar of steel, 20 mm long and 1 mm thick, that hangs down from its frame's origin.
fn bar(density: f64, top: Pose) -> BodySpec {
    let (radius, half_length) = (5e-4, 1e-2);
    let pose = Pose::at(DVec3::NEG_Z * half_length);
    let collider = ColliderSpec { geometry: Geometry::Cylinder { radius, half_length }, pose, density, surface: 0 };
    BodySpec { pose: top, colliders: vec![collider], velocity: DVec3::ZERO, angular_velocity: DVec3::ZERO }
}

fn thread(from: DVec3, to: DVec3, n: usize) -> RodSpec {
    RodSpec::straight(from, to, n, 1.2e-4, Material::elastic(2e9, 1150.0))
}

/// A thread of 120 elements that hangs from a clamp, with a bar at its end.
fn hanging(density: f64, settings: Settings) -> (World, Handle<Rod>, Handle<Body>) {
    let mut world = World::new(settings).unwrap();
    let rod = world.insert_rod(&thread(DVec3::ZERO, DVec3::NEG_Z * 0.15, 120)).unwrap();
    world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Clamp)).unwrap();
    let body = world.insert_body(&bar(density, Pose::at(DVec3::NEG_Z * 0.15))).unwrap();
    world.insert_weld(&WeldSpec::to_body((rod, Place::End), body, DVec3::ZERO)).unwrap();
    (world, rod, body)
}

fn step(world: &mut World, n: u32) -> u32 {
    let mut iterations = 0;
    for k in 0..n {
        let report = world.step(DT);
        assert!(report.incidents.is_empty(), "step {k}: {:?}", report.incidents);
        iterations += report.newton_iterations;
    }
    iterations
}

fn gap(world: &World, rod: Handle<Rod>, body: Handle<Body>, point: DVec3) -> f64 {
    let end = *world.rod(rod).unwrap().positions().last().unwrap();
    (end - world.body(body).unwrap().pose().transform_point(point)).length()
}

#[test]
fn a_bar_hangs_on_its_thread_whatever_its_mass() {
    let mut counts = Vec::new();
    // 1 mg to 10 g.
    for density in [64.0, 7900.0, 640_000.0] {
        let settings = Settings { linear_drag: 5.0, angular_drag: 5.0, ..Settings::default() };
        let (mut world, rod, body) = hanging(density, settings);
        counts.push(step(&mut world, 480));
        let mass = world.body(body).unwrap().mass().mass;
        let weld = world.view().welds().next().unwrap();
        assert!((weld.force() - DVec3::NEG_Z * mass * -G).length() < 5.0, "sign");
        let weight = mass * G;
        let pull = weld.force().z;
        println!("{density}: mass {mass:e}, {pull:e} for {weight:e}; gap {}", gap(&world, rod, body, DVec3::ZERO));
        assert!((pull / weight - 1.0).abs() < 2e-3, "{pull} {weight}");
        assert_eq!(gap(&world, rod, body, DVec3::ZERO), 0.0);
    }
    println!("{counts:?}");
    let (least, most) = (counts.iter().min().unwrap(), counts.iter().max().unwrap());
    assert!(most - least <= 480, "an iteration a substep at most: {counts:?}");
}

/// A bar held in the air is a clamp to the thread.
#[test]
fn a_driven_bar_is_a_clamp() {
    let mut by_bar = World::new(Settings::default()).unwrap();
    let mut by_clamp = World::new(Settings::default()).unwrap();
    let spec = thread(DVec3::ZERO, DVec3::X * 0.05, 40);
    let rods = [&mut by_bar, &mut by_clamp].map(|w| w.insert_rod(&spec).unwrap());
    let pose = Pose::new(DVec3::X * 0.05, DQuat::from_rotation_y(-std::f64::consts::FRAC_PI_2));
    let body = by_bar.insert_body(&bar(7900.0, pose)).unwrap();
    by_bar.set_body_motion(body, BodyMotion::Driven).unwrap();
    by_bar.insert_weld(&WeldSpec::to_body((rods[0], Place::End), body, DVec3::ZERO)).unwrap();
    let grip = by_clamp.insert_grip(&GripSpec::at_once(rods[1], Place::End, Hold::Clamp)).unwrap();
    let clamp = by_clamp.grip_pose(grip).unwrap();
    for k in 0..120 {
        let turn = DQuat::from_rotation_z(0.01 * f64::from(k)) * DQuat::from_rotation_x(0.02 * f64::from(k));
        let shift = DVec3::new(0.0, 1e-4, -5e-5) * f64::from(k);
        by_bar.set_body_pose(body, Pose::new(pose.position + shift, (turn * pose.orientation).normalize())).unwrap();
        let turned = Pose::new(clamp.position + shift, (turn * clamp.orientation).normalize());
        by_clamp.set_grip_pose(grip, turned).unwrap();
        step(&mut by_bar, 1);
        step(&mut by_clamp, 1);
    }
    let [a, b] = [(&by_bar, rods[0]), (&by_clamp, rods[1])].map(|(w, r)| w.rod(r).unwrap().positions().to_vec());
    let off = a.iter().zip(&b).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max);
    println!("off {off:e}");
    // The center of the bar goes along a chord from pose to pose, the clamp's point another.
    assert!(off < 1e-9, "{off}");
    let pull = by_bar.view().welds().next().unwrap().force();
    let grip = by_clamp.grip_wrench(grip).unwrap();
    println!("{pull} {:?}", grip.force);
    assert!((pull + grip.force).length() < 1e-6 * pull.length(), "{pull} {:?}", grip.force);
}

/// Period of the swing of a body in the plane y = 0 about a point above it.
fn period(world: &mut World, body: Handle<Body>) -> f64 {
    let (mut crossings, mut before) = (Vec::new(), 1.0);
    for k in 1..=480 {
        step(world, 1);
        let x = world.body(body).unwrap().center().x;
        if before > 0.0 && x <= 0.0 {
            crossings.push((f64::from(k) - x / (x - before)) * DT);
        }
        before = x;
    }
    let n = crossings.len() - 1;
    (crossings[n] - crossings[0]) / n as f64
}

/// About a pin at the far end of a thread that is short, light and stiff; and about the end itself, where that is held.
#[test]
fn a_bar_swings_as_a_compound_pendulum() {
    let angle: f64 = 0.2;
    let down = DVec3::new(angle.sin(), 0.0, -angle.cos());
    let (length, radius, density) = (0.01, 3e-4, 1150.0);
    for (loose, integrator) in
        [(false, Integrator::ImplicitEuler), (true, Integrator::TrBdf2), (false, Integrator::TrBdf2)]
    {
        let mut world = World::new(Settings { integrator, ..Settings::default() }).unwrap();
        let material = Material::elastic(1e11, density);
        let from = if loose { DVec3::X * length } else { DVec3::ZERO };
        let to = if loose { DVec3::ZERO } else { down * length };
        let rod = world.insert_rod(&RodSpec::straight(from, to, 8, radius, material)).unwrap();
        let hold = if loose { Hold::Clamp } else { Hold::Pin };
        world.insert_grip(&GripSpec::at_once(rod, Place::Start, hold)).unwrap();
        let turn = DQuat::from_rotation_arc(DVec3::NEG_Z, down);
        let body = world.insert_body(&bar(7900.0, Pose::new(to, turn))).unwrap();
        let rest = if loose { WeldRest::Loose } else { WeldRest::AsInserted };
        let weld = WeldSpec { rest, ..WeldSpec::to_body((rod, Place::End), body, DVec3::ZERO) };
        world.insert_weld(&weld).unwrap();
        let mass = world.body(body).unwrap().mass();
        let l = if loose { 0.01 } else { length + 0.01 };
        let thread = if loose { 0.0 } else { density * std::f64::consts::PI * radius * radius * length };
        let about = mass.moments.max_element() + mass.mass * l * l + thread * length * length / 3.0;
        let restoring = G * (mass.mass * l + thread * length / 2.0);
        let wanted = std::f64::consts::TAU * (about / restoring).sqrt() * (1.0 + angle * angle / 16.0);
        let found = period(&mut world, body);
        println!("loose {loose}: {found} {wanted}");
        assert!((found / wanted - 1.0).abs() < 5e-3, "loose {loose}: {found} {wanted}");
    }
}

/// What holds and what is held fall, spin and swing as one body of both.
#[test]
fn a_held_body_and_its_holder_are_one() {
    let handle = |at: DVec3| {
        let half_sides = DVec3::new(2e-3, 3e-3, 4e-3);
        ColliderSpec { geometry: Geometry::Box { half_sides }, pose: Pose::at(at), density: 2000.0, surface: 0 }
    };
    let free = Settings { gravity: DVec3::ZERO, ..Settings::default() };
    let (mut two, mut one) = (World::new(free.clone()).unwrap(), World::new(free).unwrap());
    let at = DVec3::new(5e-3, 1e-3, -2e-3);
    let (spin, velocity) = (DVec3::new(3.0, -2.0, 4.0), DVec3::new(0.1, 0.0, -0.05));
    let part = bar(7900.0, Pose::IDENTITY);
    let mut both = part.clone();
    both.colliders.push(handle(at));
    (both.velocity, both.angular_velocity) = (velocity, spin);
    let both = one.insert_body(&both).unwrap();
    let center = one.body(both).unwrap().center();
    let of = |c: DVec3| velocity + spin.cross(c - center);
    let holder = BodySpec { colliders: vec![handle(at)], ..part.clone() };
    let moving = |spec: BodySpec, c: DVec3| BodySpec { velocity: of(c), angular_velocity: spin, ..spec };
    let bar_center = DVec3::NEG_Z * 0.01;
    let holder = two.insert_body(&moving(holder, at)).unwrap();
    let held = two.insert_body(&moving(part, bar_center)).unwrap();
    two.set_body_motion(held, BodyMotion::Held { by: holder }).unwrap();
    let sum = |w: &World| w.view().bodies().map(|b| b.momentum()).sum::<DVec3>();
    let about = |w: &World| {
        let of = |b: sutura::BodyView<'_>| b.angular_momentum() + b.center().cross(b.momentum());
        w.view().bodies().map(of).sum::<DVec3>()
    };
    let before = (sum(&two), about(&two));
    step(&mut two, 240);
    step(&mut one, 240);
    let off = two.body(held).unwrap().pose().position - one.body(both).unwrap().pose().position;
    let turn = two.body(held).unwrap().pose().orientation.angle_between(one.body(both).unwrap().pose().orientation);
    println!("{off} {turn} {} {}", sum(&two) - before.0, about(&two) - before.1);
    // Of what orbits implicit Euler loses the part h w^2 a second: at 5.4 rad/s an eighth.
    assert!((sum(&two) - before.0).length() < 1e-5 * before.0.length());
    assert!((about(&two) - before.1).length() < 0.03 * before.1.length());
    assert!(off.length() < 1e-3 && turn < 0.15, "{off} {turn}");
}

/// Beads sit in the middle of a thread that runs through them: it is as long as without them, and bears them all.
#[test]
fn beads_hang_on_the_thread_that_runs_through_them() {
    let settings = Settings { linear_drag: 20.0, angular_drag: 20.0, ..Settings::default() };
    let mut world = World::new(settings).unwrap();
    let rod = world.insert_rod(&thread(DVec3::ZERO, DVec3::NEG_Z * 0.12, 120)).unwrap();
    world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Clamp)).unwrap();
    let mut weight = 0.0;
    for particle in [20, 45, 46, 100] {
        let at = world.rod(rod).unwrap().positions()[particle];
        // The place is the very middle of the bead, and within an element's reach of the next.
        let bead = BodySpec::solid(Geometry::Sphere { radius: 4e-4 }, 2500.0, Pose::at(at));
        let body = world.insert_body(&bead).unwrap();
        let weld = WeldSpec::to_body((rod, Place::Particle(particle as u32)), body, DVec3::ZERO);
        world.insert_weld(&WeldSpec { rest: WeldRest::Loose, ..weld }).unwrap();
        weight += world.body(body).unwrap().mass().mass * G;
    }
    step(&mut world, 480);
    let rod = world.rod(rod).unwrap();
    let own: f64 = (0..120).map(|e| rod.mass_per_length(e) * rod.rest_lengths()[e]).sum::<f64>() * G;
    let top = rod.internal_force(0).z;
    let wanted = weight + own * (1.0 - 0.5 / 120.0);
    assert!((top / wanted - 1.0).abs() < 1e-3, "{top} {wanted}");
    assert!(rod.positions().iter().all(|x| x.x.abs() < 1e-6 && x.y.abs() < 1e-6));
}

/// A thread's bits are the same whoever restores what; a body that goes lets go.
#[test]
fn attachments_are_saved_and_come_apart_with_their_body() {
    let (mut world, rod, body) = hanging(7900.0, Settings::default());
    step(&mut world, 20);
    let saved = world.snapshot();
    step(&mut world, 20);
    let hash = world.state_hash();
    let (mut other, ..) = hanging(7900.0, Settings::default());
    other.restore(&saved).unwrap();
    step(&mut other, 20);
    assert_eq!(other.state_hash(), hash);
    let (mut unlike, ..) = hanging(7800.0, Settings::default());
    assert!(unlike.restore(&saved).is_err());
    assert!(world.insert_grip(&GripSpec::at_once(rod, Place::End, Hold::Pin)).is_err());
    world.remove_body(body).unwrap();
    assert_eq!(world.view().welds().count(), 0);
    step(&mut world, 20);
    world.insert_grip(&GripSpec::at_once(rod, Place::End, Hold::Pin)).unwrap();
}

/// A needle on a thread goes from one driver to the other and back, twenty times, while both move.
#[test]
fn a_needle_that_is_handed_over_does_not_drift() {
    let mut world = World::new(Settings::default()).unwrap();
    let rod = world.insert_rod(&thread(DVec3::new(-0.1, 0.0, 0.0), DVec3::ZERO, 100)).unwrap();
    world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Pin)).unwrap();
    let needle = NeedleSpec::preset("SH").unwrap();
    let pose = needle.pose(DVec3::ZERO, DVec3::X, DVec3::Z);
    let body = world.insert_body(&needle.body(pose).unwrap()).unwrap();
    world.insert_weld(&WeldSpec::to_body((rod, Place::End), body, DVec3::ZERO)).unwrap();
    let block = |at: DVec3| BodySpec::solid(Geometry::Box { half_sides: DVec3::splat(1e-3) }, 7900.0, Pose::at(at));
    let places = [DVec3::new(0.006, 0.0, 0.006), DVec3::new(0.012, 0.0, 0.006)];
    let drivers = places.map(|at| world.insert_body(&block(at)).unwrap());
    drivers.iter().for_each(|d| world.set_body_motion(*d, BodyMotion::Driven).unwrap());
    for k in 0..20_u32 {
        let holder = drivers[k as usize % 2];
        world.set_body_motion(body, BodyMotion::Held { by: holder }).unwrap();
        for s in 1..=24 {
            let angle = std::f64::consts::TAU * (f64::from(k * 24 + s) / 480.0);
            let (sin, cos) = angle.sin_cos();
            let shift = DVec3::new(cos - 1.0, sin, 0.5 * sin) * 0.005;
            for (driver, at) in drivers.iter().zip(places) {
                world.set_body_pose(*driver, Pose::at(at + shift)).unwrap();
            }
            step(&mut world, 1);
            let now = world.body(body).unwrap().pose();
            let wanted = Pose::new(pose.position + shift, pose.orientation);
            let off = (now.position - wanted.position).length();
            assert!(off < 1e-12 && now.orientation.angle_between(wanted.orientation) < 1e-7, "{k}: {off:e}");
            assert_eq!(gap(&world, rod, body, DVec3::ZERO), 0.0);
        }
    }
    // Let go, it falls and hangs on its thread.
    world.set_body_motion(body, BodyMotion::Free).unwrap();
    drivers.iter().for_each(|d| world.remove_body(*d).unwrap());
    step(&mut world, 240);
    assert!(world.body(body).unwrap().center().z < -0.05);
}

/// What binds is torn: a swage bears its strength and no more.
#[test]
fn a_swage_comes_off_at_its_strength() {
    for (strength, holds) in [(1.1, true), (0.9, false)] {
        let mut world = World::new(Settings { gravity: DVec3::ZERO, ..Settings::default() }).unwrap();
        let rod = world.insert_rod(&thread(DVec3::ZERO, DVec3::X * 0.05, 40)).unwrap();
        let grip = world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Pin)).unwrap();
        let body = world.insert_body(&bar(7900.0, Pose::new(DVec3::X * 0.05, DQuat::from_rotation_y(-1.57)))).unwrap();
        world.set_body_motion(body, BodyMotion::Driven).unwrap();
        let mut weld = WeldSpec::to_body((rod, Place::End), body, DVec3::ZERO);
        weld.anchor.as_mut().unwrap().strength = Some(strength);
        let weld = world.insert_weld(&weld).unwrap();
        // Stretched to 1 N.
        let stiffness = 2e9 * std::f64::consts::PI * 1.2e-4 * 1.2e-4 / 0.05;
        let mut events = Vec::new();
        for k in 1..=60 {
            let shift = DVec3::NEG_X * (f64::from(k) / 60.0 / stiffness);
            world.set_grip_pose(grip, Pose::at(shift)).unwrap();
            events.extend(world.step(DT).detached);
        }
        assert_eq!(world.view().welds().count() == 1, holds, "{strength}");
        assert_eq!(events.is_empty(), holds);
        assert!(events.iter().all(|(w, force)| *w == weld && (0.9..0.95).contains(&force.length())), "{events:?}");
    }
}
