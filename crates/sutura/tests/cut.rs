//! Threads cut in two: what goes on as it was, and what comes of it.

mod support;

use core::f64::consts::{PI, TAU};
use core::ops::ControlFlow;
use support::{overhand, quiet, settle, t1};
use sutura::audit::Audit;
use sutura::glam::{DQuat, DVec3};
use sutura::input::{Input, Recorder, Recording};
use sutura::knot::{Ends, recognize};
use sutura::{
    Closure, Cut, Drive, Error, Geometry, GripSpec, Handle, Hold, Integrator, LoadKind, LoadSpec, Material,
    PaperSettings, Place, Plasticity, Pose, Profile, ReelLaw, ReelSpec, RestShape, Rod, RodSpec, Settings, ShapeSpec,
    Solver, Stretch, WeldSpec, World,
};

const G: f64 = 9.81;

/// What a cut must leave as it is, of all threads together.
struct Whole {
    mass: f64,
    length: f64,
    momentum: DVec3,
    kinetic: f64,
    elastic: f64,
}

fn whole(world: &World) -> Whole {
    let rods = || world.view().rods();
    let momentum: DVec3 = rods().map(|r| r.momentum()).sum();
    let energy = || rods().map(|r| r.energy());
    Whole {
        mass: rods()
            .map(|r| (0..r.n_elements()).map(|e| r.mass_per_length(e) * r.rest_lengths()[e]).sum::<f64>())
            .sum(),
        length: rods().map(|r| r.rest_length()).sum(),
        momentum,
        kinetic: energy().map(|e| e.kinetic).sum(),
        elastic: energy().map(|e| e.stretch + e.bend + e.twist).sum(),
    }
}

/// Cuts, and sees that nothing jumps.
fn cut(world: &mut World, rod: Handle<Rod>, place: Place) -> Cut {
    let before = whole(world);
    let joint = |world: &World, k: usize| {
        let r = world.rod(rod).unwrap();
        let l = 0.5 * (r.rest_lengths()[k - 1] + r.rest_lengths()[k]);
        0.5 * r.moment(k - 1).dot(r.strain(k - 1) * l)
    };
    let released: Vec<f64> = {
        let n = world.rod(rod).unwrap().n_elements();
        (1..n).map(|k| joint(world, k)).collect()
    };
    let closed = world.rod(rod).unwrap().is_closed();
    let found = world.cut(rod, place).unwrap();
    let after = whole(world);
    let near = |what: &str, a: f64, b: f64, scale: f64| {
        assert!((a - b).abs() <= 1e-13 * scale.max(1e-30), "{what}: {a:e} {b:e} of {scale:e}");
    };
    near("mass", after.mass, before.mass, before.mass);
    near("length", after.length, before.length, before.length);
    near("momentum", after.momentum.distance(before.momentum), 0.0, (before.mass * before.kinetic).sqrt());
    near("kinetic energy", after.kinetic, before.kinetic, before.kinetic);
    if !closed {
        let joint = released[found.particle as usize - 1];
        near("elastic energy", after.elastic, before.elastic - joint, before.elastic);
    }
    found
}

/// A T1 thread that hangs from a pin at its start, with a mass at its end, at rest.
fn hanging(n: usize, stretch: Stretch) -> (World, Handle<Rod>) {
    let (material, radius) = t1();
    let settings = Settings { gravity: DVec3::Z * -G, linear_damping: 0.2, angular_damping: 0.2, ..quiet() };
    let mut world = World::new(settings).unwrap();
    let spec = RodSpec { stretch, ..RodSpec::straight(DVec3::ZERO, DVec3::Z * -0.2, n, radius, material) };
    let rod = world.insert_rod(&spec).unwrap();
    world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Pin)).unwrap();
    let kind = LoadKind::Mass { place: Place::End, mass: 2e-3, inertia: DVec3::ZERO };
    world.insert_load(&LoadSpec { rod, kind }).unwrap();
    settle(&mut world, 1.0 / 60.0, 1e-9, 60.0);
    (world, rod)
}

/// Of a hanging thread cut in the middle the lower part falls, the upper one goes back and carries its own weight.
fn falls(stretch: Stretch) {
    let (mut world, rod) = hanging(100, stretch);
    let stretched = world.rod(rod).unwrap().positions()[50].z;
    let tension = world.rod(rod).unwrap().tension(49);
    let mu = world.rod(rod).unwrap().mass_per_length(0);
    assert!((tension / (2e-3 * G + mu * G * (0.1 + 0.001)) - 1.0).abs() < 1e-6, "{tension}");
    let settings = world.settings().clone();
    let integrator = Integrator::TrBdf2;
    world
        .set_settings(Settings { linear_damping: 0.0, angular_damping: 0.0, substep: 1e-3, integrator, ..settings })
        .unwrap();
    let mut audit = Audit::new();
    audit.observe(world.view());
    let rest = cut(&mut world, rod, Place::Arc(0.1)).rest.unwrap();
    assert_eq!((world.rod(rod).unwrap().n_elements(), world.rod(rest).unwrap().n_elements()), (50, 50));
    let center = |world: &World| {
        let x = world.rod(rest).unwrap().positions();
        let own: DVec3 = x.windows(2).map(|x| (x[0] + x[1]) * (0.5 * mu * 0.002)).sum();
        (own + x[50] * 2e-3) / (mu * 0.1 + 2e-3)
    };
    let (start, time) = (center(&world), world.time());
    let mut worst = 0.0_f64;
    for _ in 0..20 {
        let report = world.step_with(0.01, &mut |view| audit.observe(view));
        assert!(report.incidents.is_empty(), "{:?}", report.incidents);
        let t = world.time() - time;
        let at = center(&world) - start;
        worst = worst.max((at.z + 0.5 * G * t * t).abs()).max(at.truncate().length());
    }
    println!("{stretch:?}: off free fall by {worst:e} m of {:e}", 0.5 * G * 0.04);
    assert!(worst < 1e-4, "{worst:e}");
    assert!(!audit.report().passes_through && audit.report().thread_clearance.is_none_or(|c| c > 0.0));
    // The upper part comes to rest.
    let settings = world.settings().clone();
    world
        .set_settings(Settings { linear_damping: 0.2, angular_damping: 0.2, substep: 1.0 / 60.0, ..settings })
        .unwrap();
    for _ in 0..200 {
        assert!(world.step(1.0 / 60.0).incidents.is_empty());
    }
    let r = world.rod(rod).unwrap();
    let sprung = r.positions()[50].z - stretched;
    let ea = r.axial_stiffness(0);
    let want = if stretch == Stretch::Elastic { (2e-3 * G + mu * G * 0.1) * 0.1 / ea } else { 0.0 };
    assert!((sprung - want).abs() < 1e-3 * want + 1e-9, "{sprung:e} {want:e}");
    for e in 0..50 {
        let own = mu * G * (0.1 - 0.002 * (e as f64 + 0.5));
        assert!((r.tension(e) - own).abs() < 1e-3 * mu * G * 0.1, "{e}: {} {own}", r.tension(e));
    }
}

#[test]
fn a_hanging_thread_that_is_cut_falls_and_springs_back() {
    falls(Stretch::Elastic);
}

#[test]
fn so_does_one_that_cannot_stretch() {
    falls(Stretch::Inextensible);
}

/// A thread that swings and turns about itself, bent and twisted, with plastic set.
fn swinging(plastic: bool) -> (World, Handle<Rod>) {
    let (mut material, radius) = t1();
    if plastic {
        material.plasticity = Some(Plasticity { yield_curvature: 20.0, yield_twist: 20.0, hardening: 0.1 });
    }
    let mut world = World::new(Settings { substep: 1e-3, ..Settings::default() }).unwrap();
    let mut spec = RodSpec::straight(DVec3::ZERO, DVec3::X * 0.1, 50, radius, material);
    spec.pretwist = 3.0;
    spec.rest = RestShape::Given { lengths: None, darboux: Some(vec![DVec3::new(5.0, -3.0, 2.0); 49]) };
    let rod = world.insert_rod(&spec).unwrap();
    world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Clamp)).unwrap();
    for _ in 0..20 {
        assert!(world.step(0.005).incidents.is_empty());
    }
    (world, rod)
}

#[test]
fn nothing_jumps() {
    for (plastic, k) in [(false, 1), (false, 17), (true, 30), (true, 49)] {
        let (mut world, rod) = swinging(plastic);
        let (x, v, q) = {
            let r = world.rod(rod).unwrap();
            (r.positions().to_vec(), r.velocities().to_vec(), r.orientations().to_vec())
        };
        let tensions: Vec<f64> = (0..50).map(|e| world.rod(rod).unwrap().tension(e)).collect();
        let moments: Vec<DVec3> = (0..49).map(|j| world.rod(rod).unwrap().moment(j)).collect();
        let speed = v.iter().map(|v| v.length()).fold(0.0, f64::max);
        assert!(speed > 0.1, "{speed}");
        let rest = cut(&mut world, rod, Place::Particle(k)).rest.unwrap();
        let k = k as usize;
        let (a, b) = (world.rod(rod).unwrap(), world.rod(rest).unwrap());
        assert_eq!((a.positions(), b.positions()), (&x[..=k], &x[k..]));
        assert_eq!((a.velocities(), b.velocities()), (&v[..=k], &v[k..]));
        assert_eq!((a.orientations(), b.orientations()), (&q[..k], &q[k..]));
        let all = |r: &sutura::RodView<'_>| (0..r.n_elements()).map(|e| r.tension(e)).collect::<Vec<_>>();
        assert_eq!((all(&a).as_slice(), all(&b).as_slice()), (&tensions[..k], &tensions[k..]));
        let all = |r: &sutura::RodView<'_>| (0..r.n_joints()).map(|j| r.moment(j)).collect::<Vec<_>>();
        assert_eq!((all(&a).as_slice(), all(&b).as_slice()), (&moments[..k - 1], &moments[k..]));
        assert_eq!((a.radius(), a.material(), a.surface()), (b.radius(), b.material(), b.surface()));
        for _ in 0..20 {
            assert!(world.step(0.005).incidents.is_empty());
        }
    }
}

#[test]
fn a_taper_goes_on_as_it_was() {
    let (material, radius) = t1();
    let mut spec = RodSpec::straight(DVec3::ZERO, DVec3::X * 0.1, 20, radius, material.clone());
    spec.along.size = Profile(vec![(0.0, 1.0), (0.03, 0.5), (0.1, 0.8)]);
    for closed in [false, true] {
        let mut world = World::default();
        if closed {
            let along = spec.along.clone();
            spec = RodSpec::ring(DVec3::ZERO, DVec3::Z, DVec3::X * 0.1 / TAU, 20, radius, material.clone());
            spec.along = along;
        }
        let rod = world.insert_rod(&spec).unwrap();
        let old = world.rod(rod).unwrap();
        let (size, length) = (old.size().clone(), old.rest_length());
        let stiffness: Vec<f64> = (0..20).map(|e| old.axial_stiffness(e)).collect();
        let cut = world.cut(rod, Place::Particle(4)).unwrap();
        let rest = world.rod(cut.rest.unwrap_or(rod)).unwrap();
        let arc = length / 5.0;
        for s in [1e-4, 0.01, 0.05, 0.07] {
            assert!((rest.size().at(s) - size.at(s + arc)).abs() < 1e-12, "{s}");
        }
        assert!((0..16).all(|e| rest.axial_stiffness(e) == stiffness[e + 4]));
        if closed {
            for s in [1e-4, 0.01, 0.019] {
                assert!((rest.size().at(length - arc + s) - size.at(s)).abs() < 1e-12, "{s}");
            }
        }
    }
}

#[test]
fn a_ring_that_is_cut_opens_and_is_straight() {
    let (material, radius) = t1();
    let settings = Settings { linear_damping: 0.05, angular_damping: 0.05, ..quiet() };
    for (particle, twist) in [(0, 0.0), (60, 1.0), (13, 1.0), (30, 0.0)] {
        let mut world = World::new(settings.clone()).unwrap();
        let spec = RodSpec::ring(DVec3::ZERO, DVec3::Z, DVec3::X * 0.02, 60, radius, material.clone());
        let rod = world.insert_rod(&RodSpec { closure: Some(Closure { twist }), ..spec }).unwrap();
        settle(&mut world, 0.02, 1e-7, 100.0);
        let mut audit = Audit::new();
        audit.observe(world.view());
        let (bent, at) = (world.rod(rod).unwrap().energy(), world.rod(rod).unwrap().positions()[particle]);
        let found = cut(&mut world, rod, Place::Particle(particle as u32));
        assert_eq!((found.rest, found.particle), (None, particle as u32 % 60));
        let r = world.rod(rod).unwrap();
        assert!(!r.is_closed() && r.n_elements() == 60 && world.view().welds().count() == 0);
        assert_eq!((r.positions()[0], r.positions()[60]), (at, at));
        // One of 60 joints is gone.
        let left = (r.energy().bend + r.energy().twist) / (bent.bend + bent.twist);
        assert!((left - 59.0 / 60.0).abs() < 1e-6, "{left}");
        for _ in 0..300 {
            let report = world.step_with(0.02, &mut |view| audit.observe(view));
            assert!(report.incidents.is_empty(), "{:?}", report.incidents);
        }
        assert!(!audit.report().passes_through);
        let r = world.rod(rod).unwrap();
        let span = r.positions()[0].distance(r.positions()[60]) / r.rest_length();
        assert!((span - 1.0).abs() < 1e-3, "{particle}: {span}");
    }
}

#[test]
fn where_a_ring_is_cut_is_only_a_matter_of_numbers() {
    let (material, radius) = t1();
    let mut found = Vec::new();
    for particle in [0, 7, 24] {
        let mut world = World::new(quiet()).unwrap();
        let turn = DQuat::from_rotation_z(-TAU * f64::from(particle) / 48.0);
        let spec = RodSpec::ring(DVec3::ZERO, DVec3::Z, DVec3::X * 0.02, 48, radius, material.clone());
        let rod = world.insert_rod(&RodSpec { rest: RestShape::AsInserted, ..spec }).unwrap();
        // Pulled out of its round at a quarter from the cut.
        let place = Place::Particle((particle + 12) % 48);
        let kind =
            LoadKind::Point { place, force: turn.conjugate() * DVec3::new(0.0, 1e-5, 2e-5), torque: DVec3::ZERO };
        world.insert_load(&LoadSpec { rod, kind }).unwrap();
        world.cut(rod, Place::Particle(particle)).unwrap();
        for _ in 0..20 {
            assert!(world.step(0.01).incidents.is_empty());
        }
        found.push(world.rod(rod).unwrap().positions().iter().map(|x| turn * *x).collect::<Vec<_>>());
    }
    for other in &found[1..] {
        let off = found[0].iter().zip(other).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        println!("cut elsewhere: off by {off:e}");
        assert!(off < 1e-9, "{off:e}");
    }
}

#[test]
fn a_knot_that_is_cut_is_none() {
    let (material, radius) = t1();
    let mut world = World::new(Settings { substep: 1e-3, ..quiet() }).unwrap();
    let rod = world.insert_rod(&RodSpec::new(overhand(0.12, 120), radius, material)).unwrap();
    let ends =
        [Place::Start, Place::End].map(|place| world.insert_grip(&GripSpec::at_once(rod, place, Hold::Clamp)).unwrap());
    let poses = ends.map(|g| world.grip_pose(g).unwrap());
    let apart = (poses[1].position - poses[0].position).normalize();
    let mut audit = Audit::new();
    for k in 1..=100 {
        for (grip, (pose, side)) in ends.iter().zip(poses.iter().zip([-1.0, 1.0])) {
            let to = pose.position + apart * (side * 1e-4 * f64::from(k));
            world.set_grip_pose(*grip, Pose::new(to, pose.orientation)).unwrap();
        }
        world.step_with(0.005, &mut |view| audit.observe(view));
    }
    let name =
        |world: &World, rod: Handle<Rod>| recognize(world.rod(rod).unwrap().positions(), Ends::Free, 1).knot.name();
    assert_eq!(name(&world, rod), "trefoil-right");
    let contacts = world.contacts().count();
    assert!(contacts > 0 && !audit.report().passes_through);
    let rest = cut(&mut world, rod, Place::Arc(0.06)).rest.unwrap();
    assert_eq!(world.contacts().count(), contacts);
    for _ in 0..100 {
        let report = world.step_with(0.005, &mut |view| audit.observe(view));
        assert!(report.incidents.is_empty(), "{:?}", report.incidents);
    }
    assert!(!audit.report().passes_through);
    assert_eq!([rod, rest].map(|rod| name(&world, rod)), ["unknot"; 2]);
}

#[test]
fn turns_around_a_post_come_off_where_they_are_cut() {
    let (material, radius) = t1();
    let (post, turns, n) = (3e-3, 2.0, 160);
    let mut world = World::new(Settings { substep: 1e-3, ..quiet() }).unwrap();
    world
        .insert_shape(&ShapeSpec::fixed(Geometry::Cylinder { radius: post, half_length: 0.02 }, Pose::IDENTITY))
        .unwrap();
    let spec = RodSpec::helix(
        DVec3::Z * -1e-3,
        DVec3::Z,
        DVec3::X * (post + 1.02 * radius),
        turns,
        1e-3,
        n,
        radius,
        Material { bend_scale: 0.05, ..material },
    );
    // Tight: shorter at rest by a part in a thousand.
    let own = spec.centerline[0].distance(spec.centerline[1]) * 0.98;
    let rest = RestShape::Given { lengths: Some(vec![own; n]), darboux: None };
    let rod = world.insert_rod(&RodSpec { rest, ..spec }).unwrap();
    for place in [Place::Start, Place::End] {
        world.insert_grip(&GripSpec::at_once(rod, place, Hold::Clamp)).unwrap();
    }
    let mut audit = Audit::new();
    for _ in 0..40 {
        let report = world.step_with(0.005, &mut |view| audit.observe(view));
        assert!(report.incidents.is_empty(), "{:?}", report.incidents);
    }
    let forces = |world: &World| world.contacts().map(|c| (c.point, c.force)).collect::<Vec<_>>();
    let before = forces(&world);
    assert!(before.len() > 100, "{}", before.len());
    let tight = world.rod(rod).unwrap().tension(n / 2);
    let rest = cut(&mut world, rod, Place::Particle(n as u32 / 2)).rest.unwrap();
    assert_eq!(forces(&world), before);
    for _ in 0..60 {
        let report = world.step_with(0.005, &mut |view| audit.observe(view));
        assert!(report.incidents.is_empty(), "{:?}", report.incidents);
    }
    assert!(!audit.report().passes_through);
    // Both parts have sprung off: nothing is left of the tension.
    let slack = [rod, rest].map(|rod| world.rod(rod).unwrap().max_tension());
    assert!(tight > 0.5 && slack.iter().all(|t| *t < 1e-3 * tight), "{tight} {slack:?}");
}

#[test]
fn what_holds_and_loads_a_thread_goes_with_its_place() {
    let (material, radius) = t1();
    let mut world = World::new(quiet()).unwrap();
    let other = RodSpec::straight(DVec3::Y * 0.05, DVec3::new(0.1, 0.05, 0.0), 5, radius, material.clone());
    let gone = world.insert_rod(&other).unwrap();
    let spec = RodSpec::straight(DVec3::ZERO, DVec3::X * 0.1, 20, radius, material.clone());
    let rod = world.insert_rod(&spec).unwrap();
    let last = world.insert_rod(&RodSpec { surface: 2, ..other.clone() }).unwrap();
    world.remove_rod(gone).unwrap();
    let grip = |world: &mut World, place, hold| world.insert_grip(&GripSpec::at_once(rod, place, hold)).unwrap();
    let grips = [
        grip(&mut world, Place::Start, Hold::Clamp),
        grip(&mut world, Place::Element(5), Hold::Jaw),
        grip(&mut world, Place::Particle(12), Hold::Pin),
        grip(&mut world, Place::Element(14), Hold::Jaw),
        grip(&mut world, Place::End, Hold::Clamp),
    ];
    let poses = grips.map(|g| world.grip_pose(g).unwrap());
    let force = DVec3::Z * 1e-4;
    let load = |world: &mut World, kind| world.insert_load(&LoadSpec { rod, kind }).unwrap();
    let point = |place| LoadKind::Point { place, force, torque: DVec3::ZERO };
    let loads = [
        load(&mut world, point(Place::Particle(3))),
        load(&mut world, point(Place::Arc(0.081))),
        load(&mut world, LoadKind::Uniform { force_per_length: force / 0.1 }),
        load(&mut world, LoadKind::Mass { place: Place::Element(16), mass: 1e-5, inertia: DVec3::ZERO }),
        load(&mut world, point(Place::End)),
    ];
    let found = cut(&mut world, rod, Place::Arc(0.0501));
    let rest = found.rest.unwrap();
    assert_eq!((found.particle, world.view().rods().count(), found.loads.len()), (10, 3, 1));
    assert_eq!(found.loads[0].0, loads[2]);
    // The free slot is taken; the thread behind it is where it was.
    assert_eq!(rest.index(), gone.index());
    assert_eq!(world.rod(last).unwrap().positions()[0], DVec3::Y * 0.05);
    assert_eq!(world.rod(last).unwrap().surface(), 2);
    assert_eq!(grips.map(|g| world.grip_pose(g).unwrap()), poses);
    for _ in 0..120 {
        let report = world.step(1.0 / 60.0);
        assert!(report.incidents.is_empty(), "{:?}", report.incidents);
    }
    // All forces are taken by the grips of the part that has them.
    let sum = |which: &[usize]| which.iter().map(|k| world.grip_wrench(grips[*k]).unwrap().force.z).sum::<f64>();
    let (first, second) = (sum(&[0, 1]), sum(&[2, 3, 4]));
    assert!((first + 1.5e-4).abs() < 1e-7 && (second + 2.5e-4).abs() < 1e-7, "{first:e} {second:e}");
    // The new uniform load can be taken off.
    world.remove_load(found.loads[0].1).unwrap();
    world.set_load(loads[1], point(Place::Arc(0.03))).unwrap();
    assert!(world.set_load(loads[1], point(Place::Arc(0.06))).is_err());
    // A thread that goes takes with it what is on it.
    world.remove_rod(rest).unwrap();
    assert!(world.grip_pose(grips[2]).is_err() && world.grip_pose(grips[1]).is_ok());
    assert_eq!(world.view().cuts().count(), 0);
}

#[test]
fn welds_and_reels_go_with_their_ends() {
    let (material, radius) = t1();
    let mut world = World::new(quiet()).unwrap();
    let line = |from, to| RodSpec::straight(from, to, 10, radius, material.clone());
    let rod = world.insert_rod(&line(DVec3::ZERO, DVec3::X * 0.1)).unwrap();
    let branch = world.insert_rod(&line(DVec3::X * 0.07, DVec3::new(0.07, 0.05, 0.0))).unwrap();
    let weld = world.insert_weld(&WeldSpec::new(vec![(rod, Place::Particle(7)), (branch, Place::Start)])).unwrap();
    world.insert_grip(&GripSpec::at_once(rod, Place::End, Hold::Pin)).unwrap();
    let reel = world.insert_reel(&ReelSpec { rod, at_end: true, law: ReelLaw::Rate(0.01), supply: None }).unwrap();
    assert!(world.cut(rod, Place::Particle(7)).is_err() && world.cut(rod, Place::Particle(9)).is_err());
    let rest = cut(&mut world, rod, Place::Particle(4)).rest.unwrap();
    assert_eq!(world.weld_at(rest, 3), Ok(Some(weld)));
    assert_eq!(world.weld_at(branch, 0), Ok(Some(weld)));
    for _ in 0..120 {
        assert!(world.step(1.0 / 60.0).incidents.is_empty());
    }
    assert!((world.reel_fed(reel).unwrap() - 0.02).abs() < 1e-12);
    let lengths = [rod, rest].map(|rod| world.rod(rod).unwrap().rest_length());
    assert!((lengths[0] - 0.04).abs() < 1e-12 && (lengths[1] - 0.08).abs() < 1e-12, "{lengths:?}");
    // Once more, and what is fed in goes on.
    let snapshot = world.snapshot();
    cut(&mut world, rest, Place::Particle(5));
    assert!(world.restore(&snapshot).is_err());
    for _ in 0..10 {
        assert!(world.step(1.0 / 60.0).incidents.is_empty());
    }
}

#[test]
fn a_ring_with_a_branch_at_its_seam_is_cut_elsewhere() {
    let (material, radius) = t1();
    let mut world = World::new(quiet()).unwrap();
    let ring: Vec<DVec3> =
        (0..=40).map(|i| DQuat::from_rotation_z(TAU * f64::from(i % 40) / 40.0) * DVec3::X * 0.02).collect();
    let rod = world.insert_rod(&RodSpec::new(ring, radius, material.clone())).unwrap();
    let spec = RodSpec::straight(DVec3::X * 0.02, DVec3::X * 0.04, 10, radius, material);
    let branch = world.insert_rod(&spec).unwrap();
    let places = vec![(rod, Place::Start), (rod, Place::End), (branch, Place::Start)];
    let weld = world.insert_weld(&WeldSpec::new(places)).unwrap();
    assert!(world.rod(rod).unwrap().is_closed() && world.cut(rod, Place::Start).is_err());
    let before = whole(&world).elastic;
    assert_eq!(world.cut(rod, Place::Particle(10)).unwrap().rest, None);
    assert!(!world.rod(rod).unwrap().is_closed());
    assert_eq!(world.weld_at(rod, 30), Ok(Some(weld)));
    // The rest shape of the weld is as it was joined, so only the cut joint lets go.
    let r = world.rod(rod).unwrap();
    let joint = 0.5 * r.bending_stiffness(0).x * (TAU / 40.0).powi(2) / r.rest_lengths()[0];
    assert!((whole(&world).elastic - (before - joint)).abs() < 1e-9 * before);
    for _ in 0..60 {
        let report = world.step(1.0 / 60.0);
        assert!(report.incidents.is_empty(), "{:?}", report.incidents);
    }
}

#[test]
fn a_snapshot_is_taken_up_by_a_world_that_was_cut_likewise() {
    let build = |at: Option<u32>| {
        let (mut world, rod) = swinging(true);
        at.map(|at| world.cut(rod, Place::Particle(at)).unwrap());
        world
    };
    let mut world = build(Some(20));
    for _ in 0..10 {
        world.step(0.005);
    }
    let snapshot = world.snapshot();
    let go_on = |world: &mut World| (0..20).map(|_| (world.step(0.005), world.state_hash()).1).collect::<Vec<_>>();
    let hashes = go_on(&mut world);
    let mut other = build(Some(20));
    other.restore(&snapshot).unwrap();
    assert_eq!(go_on(&mut other), hashes);
    for at in [None, Some(21)] {
        let mut other = build(at);
        let hash = other.state_hash();
        assert!(matches!(other.restore(&snapshot), Err(Error::Snapshot { .. })));
        assert_eq!(other.state_hash(), hash);
    }
    // Two threads that lie end to end are none that was cut.
    let (material, radius) = t1();
    let two = |cut: bool| {
        let mut world = World::default();
        let line = |from: f64, to: f64, n: usize| {
            RodSpec::straight(DVec3::X * from, DVec3::X * to, n, radius, material.clone())
        };
        if cut {
            let rod = world.insert_rod(&line(0.0, 0.1, 10)).unwrap();
            world.cut(rod, Place::Particle(5)).unwrap();
        } else {
            world.insert_rod(&line(0.0, 0.05, 5)).unwrap();
            world.insert_rod(&line(0.05, 0.1, 5)).unwrap();
        }
        world
    };
    assert!(two(false).restore(&two(true).snapshot()).is_err() && two(true).restore(&two(false).snapshot()).is_err());
    assert!(two(true).restore(&two(true).snapshot()).is_ok());
}

#[test]
fn a_recording_with_cuts_plays_back_to_the_same_bits() {
    let (material, radius) = t1();
    let mut recorder = Recorder::new(Settings::default(), true).unwrap();
    let rod =
        recorder.insert_rod(&RodSpec::straight(DVec3::ZERO, DVec3::X * 0.1, 30, radius, material.clone())).unwrap();
    let ring =
        recorder.insert_rod(&RodSpec::ring(DVec3::Z * -0.02, DVec3::Z, DVec3::X * 0.03, 30, radius, material)).unwrap();
    recorder.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Clamp)).unwrap();
    recorder.step(0.05);
    let rest = recorder.cut(rod, Place::Arc(0.061)).unwrap().rest.unwrap();
    recorder.cut(ring, Place::Particle(4)).unwrap();
    assert!(recorder.cut(rod, Place::Start).is_err());
    recorder.step(0.05);
    recorder.cut(rest, Place::Element(3)).unwrap();
    recorder.step(0.05);
    let recording = recorder.take_recording().unwrap();
    assert_eq!(recording.inputs.iter().filter(|i| matches!(i, Input::Cut(..))).count(), 3);
    let bytes = recording.to_bytes();
    assert_eq!(bytes[8], 6);
    let mut steps = 0;
    Recording::from_bytes(&bytes)
        .unwrap()
        .replay(&mut |step| {
            assert!(step.is_same(), "{}", step.step);
            steps += 1;
            ControlFlow::Continue(())
        })
        .unwrap();
    assert_eq!(steps, 3);
}

#[test]
fn a_thread_may_be_cut_again_and_again() {
    let (material, radius) = t1();
    let mut world = World::new(Settings { substep: 1e-3, ..Settings::default() }).unwrap();
    world.insert_shape(&ShapeSpec::fixed(Geometry::Plane, Pose::at(DVec3::Z * -0.01))).unwrap();
    let rod = world.insert_rod(&RodSpec::straight(DVec3::ZERO, DVec3::X * 0.2, 84, radius, material)).unwrap();
    let mut parts = vec![rod];
    let mut audit = Audit::new();
    for k in 0..20 {
        // The longest part, a little off its middle.
        let longest = |r: &Handle<Rod>| world.rod(*r).unwrap().n_elements();
        let part = *parts.iter().max_by_key(|r| longest(r)).unwrap();
        let at = longest(&part) as u32 / 2 + u32::from(longest(&part) > 6);
        parts.push(cut(&mut world, part, Place::Particle(at)).rest.unwrap());
        let report = world.step_with(0.005, &mut |view| audit.observe(view));
        assert!(report.incidents.is_empty(), "{k}: {:?}", report.incidents);
    }
    assert_eq!((world.view().rods().count(), world.view().cuts().count()), (21, 20));
    let elements: usize = world.view().rods().map(|r| r.n_elements()).sum();
    assert_eq!(elements, 84);
    for _ in 0..60 {
        let report = world.step_with(0.005, &mut |view| audit.observe(view));
        assert!(report.incidents.is_empty(), "{:?}", report.incidents);
    }
    assert!(!audit.report().passes_through);
    assert!(audit.report().thread_clearance.is_none(), "{:?}", audit.report().thread_closest);
}

#[test]
fn numbered_from_the_other_end_it_is_the_same() {
    let (material, radius) = t1();
    let points: Vec<DVec3> = (0..=40)
        .map(|i| {
            let s = f64::from(i) / 40.0;
            DVec3::new(0.1 * s, 0.01 * (PI * s).sin(), 0.004 * s * s)
        })
        .collect();
    let run = |points: Vec<DVec3>, at: u32, held: Place, loaded: Place| {
        let mut world = World::new(Settings { substep: 1e-3, ..Settings::default() }).unwrap();
        let rod = world.insert_rod(&RodSpec::new(points, radius, material.clone())).unwrap();
        world.insert_grip(&GripSpec::at_once(rod, held, Hold::Pin)).unwrap();
        let kind = LoadKind::Mass { place: loaded, mass: 1e-5, inertia: DVec3::ZERO };
        world.insert_load(&LoadSpec { rod, kind }).unwrap();
        for _ in 0..4 {
            world.step(0.005);
        }
        let rest = world.cut(rod, Place::Particle(at)).unwrap().rest.unwrap();
        for _ in 0..10 {
            assert!(world.step(0.005).incidents.is_empty());
        }
        [rod, rest].map(|rod| world.rod(rod).unwrap().positions().to_vec())
    };
    let [a, b] = run(points.clone(), 15, Place::Start, Place::Particle(25));
    let [c, d] = run(points.into_iter().rev().collect(), 25, Place::End, Place::Particle(15));
    let off = |x: &[DVec3], y: &[DVec3]| {
        assert_eq!(x.len(), y.len());
        x.iter().zip(y.iter().rev()).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max)
    };
    println!("from the other end: {:e} {:e}", off(&a, &d), off(&b, &c));
    assert!(off(&a, &d) < 1e-9 && off(&b, &c) < 1e-9, "{:e} {:e}", off(&a, &d), off(&b, &c));
}

#[test]
fn what_cannot_be_cut_is_left_as_it_is() {
    let (material, radius) = t1();
    let mut world = World::new(quiet()).unwrap();
    let rod = world.insert_rod(&RodSpec::straight(DVec3::ZERO, DVec3::X * 0.1, 10, radius, material.clone())).unwrap();
    let one = world.insert_rod(&RodSpec::straight(DVec3::Y, DVec3::ONE, 1, radius, material)).unwrap();
    world.insert_grip(&GripSpec::at_once(rod, Place::Particle(3), Hold::Clamp)).unwrap();
    world.insert_grip(&GripSpec::at_once(rod, Place::Element(6), Hold::Jaw)).unwrap();
    let bad = [
        Place::Start,
        Place::End,
        Place::Particle(0),
        Place::Particle(10),
        Place::Particle(11),
        Place::Element(0),
        Place::Element(10),
        Place::Arc(0.004),
        Place::Arc(0.0951),
        Place::Arc(0.2),
        Place::Arc(f64::NAN),
        Place::Particle(3),
        Place::Particle(6),
        Place::Particle(7),
    ];
    let hash = world.state_hash();
    for place in bad {
        assert!(world.cut(rod, place).is_err(), "{place:?}");
    }
    for place in [Place::Start, Place::Element(0), Place::End] {
        assert!(world.cut(one, place).is_err(), "{place:?}");
    }
    assert_eq!((world.state_hash(), world.view().cuts().count()), (hash, 0));
    let paper = Settings { solver: Solver::Paper(PaperSettings::default()), ..quiet() };
    world.set_settings(paper).unwrap();
    assert!(world.cut(rod, Place::Particle(5)).is_err());
    world.set_settings(quiet()).unwrap();
    world.remove_rod(one).unwrap();
    assert!(matches!(world.cut(one, Place::Particle(1)), Err(Error::StaleHandle { .. })));
    world.cut(rod, Place::Particle(5)).unwrap();
    // The paper's solver goes on with the parts.
    world.set_settings(Settings { solver: Solver::Paper(PaperSettings::default()), ..quiet() }).unwrap();
    assert!(world.step(0.1).incidents.is_empty());
}

#[test]
fn a_grip_driven_by_force_holds_its_part() {
    let (material, radius) = t1();
    let mut world = World::new(quiet()).unwrap();
    let rod = world.insert_rod(&RodSpec::straight(DVec3::ZERO, DVec3::X * 0.1, 20, radius, material)).unwrap();
    world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Clamp)).unwrap();
    let pull = Drive::Force { direction: DVec3::X, force: 0.5, speed_limit: 0.1 };
    let hand = world.insert_grip(&GripSpec { drive: pull, ..GripSpec::at_once(rod, Place::End, Hold::Clamp) }).unwrap();
    for _ in 0..30 {
        world.step(1.0 / 60.0);
    }
    assert!((world.rod(rod).unwrap().tension(5) / 0.5 - 1.0).abs() < 1e-3);
    let before = world.grip_pose(hand).unwrap().position.x;
    cut(&mut world, rod, Place::Particle(8));
    for _ in 0..30 {
        assert!(world.step(1.0 / 60.0).incidents.is_empty());
    }
    // Nothing holds it back.
    let moved = world.grip_pose(hand).unwrap().position.x - before;
    assert!((moved / 0.05 - 1.0).abs() < 0.05, "{moved}");
}

#[test]
fn contacts_of_a_ring_with_itself_keep_their_forces() {
    // A trefoil that is closed springs open as far as its own strands let it.
    let (material, radius) = t1();
    let n = 120;
    let at = |t: f64| {
        DVec3::new(t.sin() + 2.0 * (2.0 * t).sin(), t.cos() - 2.0 * (2.0 * t).cos(), -(3.0 * t).sin()) * 2.5e-3
    };
    let points = (0..n).map(|i| at(TAU * f64::from(i) / f64::from(n))).collect();
    let mut world = World::new(Settings { substep: 1e-3, linear_damping: 0.02, ..quiet() }).unwrap();
    let spec = RodSpec { closure: Some(Closure::default()), ..RodSpec::new(points, radius, material) };
    let rod = world.insert_rod(&spec).unwrap();
    for _ in 0..60 {
        assert!(world.step(0.005).incidents.is_empty());
    }
    // The force of all contacts on each element, named as before the cut.
    let on_elements = |world: &World, begin: usize| {
        let mut sum = vec![DVec3::ZERO; n as usize];
        for c in world.contacts() {
            for (side, force) in [(c.a, c.force), (c.b, -c.force)] {
                let (_, element, _) = side.thread().unwrap();
                sum[(element + begin) % n as usize] += force;
            }
        }
        sum
    };
    let (before, count) = (on_elements(&world, 0), world.contacts().count());
    let pressed = before.iter().map(|f| f.length()).fold(0.0, f64::max);
    assert!(count >= 3 && pressed > 1e-3, "{count} {pressed:e}");
    let mut audit = Audit::new();
    audit.observe(world.view());
    cut(&mut world, rod, Place::Particle(50));
    assert_eq!(world.contacts().count(), count);
    let off = before.iter().zip(on_elements(&world, 50)).map(|(a, b)| a.distance(b)).fold(0.0, f64::max);
    assert!(off < 1e-14 * pressed.max(1.0), "{off:e}");
    for _ in 0..100 {
        let report = world.step_with(0.005, &mut |view| audit.observe(view));
        assert!(report.incidents.is_empty(), "{:?}", report.incidents);
    }
    assert!(!audit.report().passes_through);
    let (a, b) = (world.rod(rod).unwrap().positions()[0], world.rod(rod).unwrap().positions()[n as usize]);
    assert!(a.distance(b) > 5e-3, "{}", a.distance(b));
}
