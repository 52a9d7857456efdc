//! Length fed in and drawn back at an end of a thread.

mod support;

use support::{quiet, settle, t1};
use sutura::glam::DVec3;
use sutura::{
    Drive, Error, Geometry, Grip, GripSpec, Handle, Hold, Place, Pose, Reel, ReelLaw, ReelSpec, Rod, RodSpec, Settings,
    ShapeSpec, Stretch, World,
};

/// A T1 thread of 50 mm that hangs from a reel at its start or its end.
fn hanging(at_end: bool, law: ReelLaw, stretch: Stretch) -> (World, Handle<Rod>, Handle<Grip>, Handle<Reel>) {
    let (material, radius) = t1();
    let mut world = World::new(Settings::default()).unwrap();
    let (from, to) = (DVec3::ZERO, DVec3::NEG_Z * 0.05);
    let line = if at_end {
        RodSpec::straight(to, from, 50, radius, material)
    } else {
        RodSpec::straight(from, to, 50, radius, material)
    };
    let rod = world.insert_rod(&RodSpec { stretch, ..line }).unwrap();
    let place = if at_end { Place::End } else { Place::Start };
    let grip = world.insert_grip(&GripSpec::at_once(rod, place, Hold::Clamp)).unwrap();
    let reel = world.insert_reel(&ReelSpec { rod, at_end, law, supply: None }).unwrap();
    (world, rod, grip, reel)
}

#[test]
fn a_hanging_thread_is_let_down_and_drawn_up_at_the_rate_of_its_reel() {
    for (at_end, stretch) in [(false, Stretch::Elastic), (true, Stretch::Elastic), (true, Stretch::Inextensible)] {
        let (mut world, rod, grip, reel) = hanging(at_end, ReelLaw::Rate(0.03), stretch);
        let lowest = |world: &World| world.rod(rod).unwrap().positions().iter().map(|x| x.z).fold(0.0, f64::min);
        let mut length = 0.05;
        for (rate, time) in [(0.03, 1.0), (-0.05, 1.0), (0.0, 0.5), (0.04, 1.0), (-0.02, 2.0)] {
            world.set_reel(reel, ReelLaw::Rate(rate)).unwrap();
            // Mean excess of the force over the weight in the second half of the time.
            let mut excess = 0.0;
            let frames = (60.0 * time) as u32;
            for k in 0..frames {
                let report = world.step(1.0 / 60.0);
                assert!(report.incidents.is_empty() && report.length_error < 1e-4, "{report:?}");
                let view = world.rod(rod).unwrap();
                let weight = view.mass_per_length(0) * view.rest_length() * 9.81;
                if k >= frames / 2 {
                    excess += (world.grip_wrench(grip).unwrap().force.z - weight) / f64::from(frames - frames / 2);
                }
            }
            length += rate * time;
            let view = world.rod(rod).unwrap();
            assert!(
                (view.rest_length() - length).abs() < 1e-9
                    && (world.reel_fed(reel).unwrap() - (length - 0.05)).abs() < 1e-9,
                "{rate} {} {} {length}",
                view.rest_length(),
                world.reel_fed(reel).unwrap()
            );
            // It hangs straight down, and the reel carries its weight, which grows with it.
            assert!((lowest(&world) + length).abs() < 1e-4 * length, "{at_end} {rate}: {} {length}", lowest(&world));
            let weight = view.mass_per_length(0) * length * 9.81;
            // The momentum that comes in or goes out with the thread makes a difference of the order mu v^2.
            let flux = 2.0 * view.mass_per_length(0) * rate * rate;
            assert!(excess.abs() < 2e-3 * weight + flux, "{at_end} {rate}: {excess} {weight}");
            // Elements stay of the length that they had.
            let (least, most) =
                view.rest_lengths().iter().fold((1.0, 0.0), |(a, b): (f64, f64), l| (a.min(*l), b.max(*l)));
            let substep = rate.abs() / 240.0;
            assert!(least > 0.24e-3 && most < 1.61e-3 + substep, "{least} {most}");
        }
    }
}

#[test]
fn a_brake_gives_off_thread_at_its_tension_and_holds_below() {
    let (mut world, rod, _, reel) = hanging(true, ReelLaw::Brake(0.2), Stretch::Elastic);
    let pull = |force| Drive::Force { direction: DVec3::NEG_Z, force, speed_limit: 0.05 };
    let grip =
        world.insert_grip(&GripSpec { drive: pull(0.15), ..GripSpec::at_once(rod, Place::Start, Hold::Pin) }).unwrap();
    for _ in 0..120 {
        assert!(world.step(1.0 / 60.0).incidents.is_empty());
    }
    assert!(world.reel_fed(reel).unwrap().abs() < 1e-9, "{}", world.reel_fed(reel).unwrap());
    // Pulled by 0.3 N it comes off at the speed at which the grip's force is what the brake holds (and the weight adds
    // a little).
    world.set_grip_drive(grip, pull(0.3)).unwrap();
    for _ in 0..60 {
        assert!(world.step(1.0 / 60.0).incidents.is_empty());
    }
    let before = world.reel_fed(reel).unwrap();
    for _ in 0..60 {
        assert!(world.step(1.0 / 60.0).incidents.is_empty());
    }
    let speed = world.reel_fed(reel).unwrap() - before;
    let want = 0.05 * (1.0 - 0.2 / 0.3);
    assert!((speed / want - 1.0).abs() < 0.02, "{speed} {want}");
    let view = world.rod(rod).unwrap();
    assert!((view.tension(view.n_elements() - 1) / 0.2 - 1.0).abs() < 2e-3, "{}", view.tension(view.n_elements() - 1));
    // Slack thread is not drawn back.
    world.remove_grip(grip).unwrap();
    let length = world.rod(rod).unwrap().rest_length();
    for _ in 0..60 {
        assert!(world.step(1.0 / 60.0).incidents.is_empty());
    }
    assert_eq!(world.rod(rod).unwrap().rest_length(), length);
}

#[test]
fn an_empty_reel_holds_and_a_short_thread_is_not_drawn_in() {
    let (mut world, rod, _, _) = hanging(true, ReelLaw::Rate(-0.1), Stretch::Elastic);
    for _ in 0..120 {
        assert!(world.step(1.0 / 60.0).incidents.is_empty());
    }
    let view = world.rod(rod).unwrap();
    assert!(view.n_elements() == 2 && view.rest_length() > 1e-3, "{} {}", view.n_elements(), view.rest_length());

    let (material, radius) = t1();
    let mut world = World::new(Settings::default()).unwrap();
    let rod = world.insert_rod(&RodSpec::straight(DVec3::ZERO, DVec3::X * 0.02, 20, radius, material)).unwrap();
    let reel =
        world.insert_reel(&ReelSpec { rod, at_end: false, law: ReelLaw::Rate(0.1), supply: Some(0.0123) }).unwrap();
    world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Pin)).unwrap();
    for _ in 0..60 {
        assert!(world.step(1.0 / 60.0).incidents.is_empty());
    }
    assert!((world.reel_fed(reel).unwrap() - 0.0123).abs() < 1e-12);
    assert!((world.rod(rod).unwrap().rest_length() - 0.0323).abs() < 1e-12);
}

#[test]
fn a_thread_let_down_onto_a_table_coils_and_what_holds_it_elsewhere_stays_in_place() {
    let (material, radius) = t1();
    let mut world = World::new(Settings { linear_damping: 0.9, ..Settings::default() }).unwrap();
    let other = world
        .insert_rod(&RodSpec::straight(DVec3::ONE, DVec3::ONE + DVec3::X * 0.01, 5, radius, material.clone()))
        .unwrap();
    world.insert_grip(&GripSpec::at_once(other, Place::Particle(3), Hold::Clamp)).unwrap();
    let rod = world
        .insert_rod(&RodSpec::straight(
            DVec3::Z * 0.03,
            DVec3::new(1e-3, 2e-4, 1e-3),
            29,
            radius,
            sutura::Material { bend_damping: 0.01, ..material },
        ))
        .unwrap();
    let after = world
        .insert_rod(&RodSpec::straight(DVec3::new(-1.0, 0.0, 1.0), DVec3::new(-1.01, 0.0, 1.0), 5, radius, t1().0))
        .unwrap();
    let held = world.insert_grip(&GripSpec::at_once(after, Place::Particle(4), Hold::Clamp)).unwrap();
    world.insert_shape(&ShapeSpec::fixed(Geometry::Plane, Pose::IDENTITY)).unwrap();
    world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Clamp)).unwrap();
    world.insert_reel(&ReelSpec { rod, at_end: false, law: ReelLaw::Rate(0.03), supply: None }).unwrap();
    let mut audit = sutura::audit::Audit::new();
    for _ in 0..180 {
        let report = world.step_with(1.0 / 60.0, &mut |v| audit.observe(v));
        assert!(report.incidents.is_empty(), "{:?}", report.incidents);
    }
    assert!(
        !audit.report().passes_through && audit.report().shape_clearance.unwrap() > -0.05,
        "{:?}",
        audit.report().shape_closest
    );
    assert!(audit.report().thread_clearance.is_none_or(|c| c > -0.05), "{:?}", audit.report().thread_closest);
    assert!(audit.report().max_elongation.iter().all(|e| e.1 < 1e-2), "{:?}", audit.report().max_elongation);
    let view = world.rod(rod).unwrap();
    assert!((view.rest_length() - 0.119_018).abs() < 1e-6 && view.positions()[0] == DVec3::Z * 0.03);
    assert!(view.positions().iter().all(|x| x.z > 0.9 * radius));
    assert!((world.rod(after).unwrap().positions()[4] - world.grip_pose(held).unwrap().position).length() < 1e-15);
}

#[test]
fn a_snapshot_goes_back_to_another_number_of_elements() {
    for at_end in [false, true] {
        let (mut world, rod, _, reel) = hanging(at_end, ReelLaw::Rate(0.05), Stretch::Elastic);
        let (mut twin, ..) = hanging(at_end, ReelLaw::Rate(0.05), Stretch::Elastic);
        let start = world.snapshot();
        (0..30).for_each(|_| drop(world.step(1.0 / 60.0)));
        let saved = world.snapshot();
        assert!(world.rod(rod).unwrap().n_elements() > 60);
        (0..30).for_each(|_| drop(world.step(1.0 / 60.0)));
        let end = world.state_hash();
        // Forward in a world that has not fed anything yet, back in the one that fed most.
        twin.restore(&saved).unwrap();
        world.restore(&saved).unwrap();
        for w in [&mut world, &mut twin] {
            (0..30).for_each(|_| drop(w.step(1.0 / 60.0)));
            assert_eq!(w.state_hash(), end);
        }
        world.restore(&start).unwrap();
        assert_eq!((world.rod(rod).unwrap().n_elements(), world.reel_fed(reel).unwrap()), (50, 0.0));
        // A damaged one changes nothing.
        let mut bad = saved.clone();
        let last = bad.len() - 1;
        bad.truncate(last);
        assert!(world.restore(&bad).is_err());
        assert_eq!(world.rod(rod).unwrap().n_elements(), 50);
    }
}

#[test]
fn what_cannot_be_reeled_is_said() {
    let (mut world, rod, ..) = hanging(true, ReelLaw::Rate(0.0), Stretch::Inextensible);
    let spec = |at_end, law| ReelSpec { rod, at_end, law, supply: None };
    let field = |e: Result<Handle<Reel>, Error>| match e.unwrap_err() {
        Error::Invalid { field, .. } => field,
        other => panic!("{other}"),
    };
    assert_eq!(field(world.insert_reel(&spec(true, ReelLaw::Rate(0.1)))), "at_end");
    assert_eq!(field(world.insert_reel(&spec(false, ReelLaw::Rate(f64::NAN)))), "rate");
    assert_eq!(field(world.insert_reel(&spec(false, ReelLaw::Brake(0.0)))), "brake");
    assert_eq!(field(world.insert_reel(&spec(false, ReelLaw::Brake(0.1)))), "law");
    assert!(world.insert_grip(&GripSpec::at_once(rod, Place::Element(49), Hold::Jaw)).is_err());
    let (material, radius) = t1();
    let ring = world.insert_rod(&RodSpec::ring(DVec3::X, DVec3::Z, DVec3::X * 0.01, 30, radius, material)).unwrap();
    assert_eq!(field(world.insert_reel(&ReelSpec { rod: ring, ..spec(true, ReelLaw::Rate(0.1)) })), "at_end");
    // Nor is an end at a reel welded.
    let (tail, tail_radius) = t1();
    let at = world.rod(rod).unwrap().positions()[50];
    let tail = world.insert_rod(&RodSpec::straight(at, at + DVec3::X * 0.01, 10, tail_radius, tail)).unwrap();
    assert!(world.insert_weld(&sutura::WeldSpec::new(vec![(rod, Place::End), (tail, Place::Start)])).is_err());
    settle(&mut World::new(quiet()).unwrap(), 0.1, 1.0, 2.0);
}

#[test]
fn a_snapshot_of_elements_all_alike_is_taken_up_with_all_joints() {
    // Lengths and rates are powers of two: after eight substeps there is one element more, of the same length as all
    // others.
    for at_end in [false, true] {
        let build = || {
            let (material, radius) = t1();
            let mut world = World::new(Settings { substep: 1.0 / 256.0, ..Settings::default() }).unwrap();
            let rod = world
                .insert_rod(&RodSpec::straight(DVec3::ZERO, DVec3::X * (10.0 / 1024.0), 10, radius, material))
                .unwrap();
            let place = if at_end { Place::End } else { Place::Start };
            world.insert_grip(&GripSpec::at_once(rod, place, Hold::Clamp)).unwrap();
            world.insert_reel(&ReelSpec { rod, at_end, law: ReelLaw::Rate(1.0 / 32.0), supply: None }).unwrap();
            (world, rod)
        };
        let ((mut world, rod), (mut twin, _)) = (build(), build());
        (0..8).for_each(|_| drop(world.step(1.0 / 256.0)));
        let lengths = world.rod(rod).unwrap().rest_lengths().to_vec();
        assert_eq!(lengths, [1.0 / 1024.0; 11]);
        twin.restore(&world.snapshot()).unwrap();
        world.step(1.0 / 256.0);
        twin.step(1.0 / 256.0);
        assert_eq!(world.state_hash(), twin.state_hash());
    }
}

#[test]
fn what_is_drawn_onto_the_reel_comes_off_again_and_the_snapshot_between_is_taken() {
    for at_end in [false, true] {
        let (mut world, rod, _, reel) = hanging(at_end, ReelLaw::Rate(-0.05), Stretch::Elastic);
        // A mass 5 mm from the reel.
        let place = Place::Arc(if at_end { 0.045 } else { 0.005 });
        world
            .insert_load(&sutura::LoadSpec {
                rod,
                kind: sutura::LoadKind::Mass { place, mass: 1e-3, inertia: DVec3::ZERO },
            })
            .unwrap();
        let pulled = |world: &World| {
            let view = world.rod(rod).unwrap();
            // Where tension jumps by the weight, from the reel.
            let tensions: Vec<f64> = (0..view.n_elements())
                .map(|e| view.tension(if at_end { view.n_elements() - 1 - e } else { e }))
                .collect();
            tensions.iter().position(|t| *t < 5e-3).unwrap()
        };
        world.step(0.2);
        assert_eq!(pulled(&world), 0);
        let saved = world.snapshot();
        world.restore(&saved).unwrap();
        world.set_reel(reel, ReelLaw::Rate(0.05)).unwrap();
        world.step(0.4);
        world.set_reel(reel, ReelLaw::Rate(0.0)).unwrap();
        world.step(1.0);
        let (at, view) = (pulled(&world), world.rod(rod).unwrap());
        let fed: f64 = (0..at).map(|e| view.rest_lengths()[if at_end { view.n_elements() - 1 - e } else { e }]).sum();
        assert!((fed - 0.015).abs() < 1.5e-3, "{at_end}: {fed}");
    }
}

#[test]
fn a_rate_beyond_all_proportion_feeds_a_thousand_elements_a_substep() {
    let (mut world, rod, _, reel) = hanging(true, ReelLaw::Rate(100.0), Stretch::Elastic);
    world.set_settings(Settings { substep: 1e9, halvings: 0, ..Settings::default() }).unwrap();
    world.step(1e9);
    world.step(1e9);
    assert!(world.reel_fed(reel).unwrap() <= 2.0 && world.rod(rod).unwrap().n_elements() <= 1100);
}
