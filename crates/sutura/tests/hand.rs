//! Grips driven as by a hand: with a force and a speed limit, giving way in every direction.

mod support;

use support::t1;
use sutura::glam::DVec3;
use sutura::{
    Drive, Geometry, Grip, GripSpec, Handle, Hold, Material, Place, Pose, Rod, RodSpec, Settings, ShapeMotion,
    ShapeSpec, World,
};

const DT: f64 = 1.0 / 60.0;
const HOLDS: [Hold; 3] = [Hold::Pin, Hold::Clamp, Hold::Jaw];

/// A thread along x without weight, a hand at its end.
fn led(hold: Hold, direction: DVec3, force: f64, speed_limit: f64) -> (World, Handle<Rod>, Handle<Grip>) {
    let (material, radius) = t1();
    let mut world = World::new(Settings { gravity: DVec3::ZERO, ..Settings::default() }).unwrap();
    let material = Material { bend_damping: 0.01, ..material };
    let rod = world.insert_rod(&RodSpec::straight(DVec3::ZERO, DVec3::X * 0.06, 30, radius, material)).unwrap();
    let hand = world
        .insert_grip(&GripSpec {
            drive: Drive::Hand { direction, force, speed_limit },
            ..GripSpec::at_once(rod, Place::End, hold)
        })
        .unwrap();
    (world, rod, hand)
}

fn steps(world: &mut World, n: u32) {
    for _ in 0..n {
        let report = world.step(DT);
        assert!(report.incidents.is_empty() && report.converged, "{report:?}");
    }
}

/// A jump is a distance of 100 m/s in a step, from where it is to where it was to be led: what a force has taken
/// farther than that was led nowhere.
#[test]
fn what_a_force_takes_far_has_not_jumped() {
    let (mut world, _, hand) = led(Hold::Pin, DVec3::X, 1.0, 2.0);
    let motion = ShapeMotion::Pushed { direction: DVec3::Y, force: 1.0, speed_limit: 2.0 };
    let ball = ShapeSpec { motion, ..ShapeSpec::fixed(Geometry::Sphere { radius: 1e-3 }, Pose::at(DVec3::Y)) };
    let ball = world.insert_shape(&ball).unwrap();
    steps(&mut world, 90);
    assert!(world.grip_pose(hand).unwrap().position.x > 100.0 * DT);
    assert!(world.shape(ball).unwrap().pose.position.y > 1.0 + 100.0 * DT);
}

#[test]
fn where_nothing_resists_it_moves_at_its_speed_limit() {
    for hold in HOLDS {
        let (mut world, _, hand) = led(hold, DVec3::X, 1.0, 0.02);
        steps(&mut world, 30);
        let before = world.grip_pose(hand).unwrap().position;
        steps(&mut world, 60);
        let moved = world.grip_pose(hand).unwrap().position - before;
        assert!((moved - DVec3::X * 0.02).length() < 1e-4 * 0.02, "{hold:?}: {moved} in a second");
        assert!(world.grip_wrench(hand).unwrap().force.length() < 1e-4);
    }
}

#[test]
fn it_pulls_as_hard_as_it_may_and_no_harder_whatever_holds_it_back() {
    for hold in HOLDS {
        for fixed in [Hold::Pin, Hold::Clamp] {
            let (mut world, rod, hand) = led(hold, DVec3::new(0.8, 0.6, 0.0), 0.5, 0.05);
            world.insert_grip(&GripSpec::at_once(rod, Place::Start, fixed)).unwrap();
            let start = world.rod(rod).unwrap().positions()[0];
            for _ in 0..1000 {
                steps(&mut world, 1);
                let force = world.grip_wrench(hand).unwrap().force.length();
                assert!(force < 0.5 * 1.0001, "{hold:?}: {force} N");
            }
            // It hangs from the start in the direction of the force, which is all tension.
            let (force, at) = (world.grip_wrench(hand).unwrap().force, world.grip_pose(hand).unwrap().position);
            let along = (at - start).normalize();
            assert!((force - DVec3::new(0.4, 0.3, 0.0)).length() < 1e-3, "{hold:?} {fixed:?}: {force}");
            // What is clamped at an end, or does not turn between jaws, bends there before it is straight.
            let least = if hold == Hold::Pin && fixed == Hold::Pin { 1.0 - 1e-6 } else { 0.99 };
            assert!(along.dot(DVec3::new(0.8, 0.6, 0.0)) > least, "{hold:?} {fixed:?}: {along}");
        }
    }
}

#[test]
fn drawn_across_its_direction_it_gives_way_where_a_force_along_a_line_does_not() {
    // The other end is drawn across, at half the speed limit.
    let reached = |drive: Drive| {
        let (mut world, rod, hand) = led(Hold::Pin, DVec3::X, 0.2, 0.04);
        world.set_grip_drive(hand, drive).unwrap();
        let other = world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Pin)).unwrap();
        let mut most = 0.0f64;
        for _ in 0..180 {
            let pose = world.grip_pose(other).unwrap();
            world.set_grip_pose(other, Pose::new(pose.position + DVec3::Y * (0.02 * DT), pose.orientation)).unwrap();
            world.step(DT);
            most = most.max(world.grip_wrench(hand).unwrap().force.length());
        }
        (world.grip_pose(hand).unwrap().position.y, most)
    };
    let (direction, force, speed_limit) = (DVec3::X, 0.2, 0.04);
    let (way, most) = reached(Drive::Hand { direction, force, speed_limit });
    assert!(way > 0.02 && most < 0.2 * 1.12, "it came {way} m along, with {most} N");
    let (way, most) = reached(Drive::Force { direction, force, speed_limit });
    assert!(way.abs() < 1e-9 && most > 0.25, "along a line it came {way} m across, with {most} N");
}
