//! Snapshots from outside: refused, or the world goes on from them.

use crate::finite;
use crate::input::Input;
use std::sync::OnceLock;
use sutura::glam::DVec3;
use sutura::{
    BodySpec, Closure, Drive, Error, Geometry, GripSpec, Handle, Hold, Integrator, LoadKind, LoadSpec, Material, Place,
    Plasticity, Pose, ReelLaw, ReelSpec, Rod, RodSpec, Settings, ShapeMotion, ShapeSpec, Stretch, WeldSpec, World,
};

/// The worlds, and snapshots of them after some steps.
const WORLDS: [fn() -> Result<World, Error>; 3] = [simple, busy, joined];
/// Length of the head of a snapshot: version, and what threads are made of.
const MADE_OF: usize = 16;
static SNAPSHOTS: OnceLock<[Vec<u8>; 3]> = OnceLock::new();

pub fn run(data: &[u8]) {
    let mut input = Input::new(data);
    let which = match input.byte() {
        128.. => 2,
        b => usize::from(b & 1),
    };
    let good = &SNAPSHOTS.get_or_init(|| [stepped(0), stepped(1), stepped(2)])[which];
    take_up(which, &input.changed(good), good);
}

fn world(which: usize) -> World {
    WORLDS[which]().unwrap_or_else(|e| panic!("{e}"))
}

/// A snapshot of a world after some steps.
fn stepped(which: usize) -> Vec<u8> {
    let mut world = world(which);
    for _ in 0..12 {
        world.step(1.0 / 240.0);
    }
    world.snapshot()
}

/// Finds where the state begins in a snapshot: from its first field, the time, on it differs from that of a new world.
fn state_from(which: usize, good: &[u8]) -> usize {
    let new = world(which).snapshot();
    good.iter().zip(&new).take_while(|(a, b)| a == b).count()
}

fn take_up(which: usize, bytes: &[u8], good: &[u8]) {
    let mut world = world(which);
    let before = world.state_hash();
    if world.restore(bytes).is_err() {
        assert_eq!(world.state_hash(), before, "a snapshot that was refused changed the world");
        return;
    }
    // Of threads that are made of something else it takes what it can. The head may differ in the rounding of a radius.
    if bytes.get(..MADE_OF) == good.get(..MADE_OF) {
        let head = state_from(which, good);
        assert!(world.snapshot().get(head..) == bytes.get(head..), "what was read is not what was written");
    }
    finite::assert(finite::readings(&world));
    for _ in 0..2 {
        let report = world.step(1.0 / 240.0);
        finite::assert(finite::report(&report));
        finite::assert(finite::state(world.view()));
        if report.incidents.is_empty() {
            finite::assert(finite::readings(&world));
        }
    }
    let again = world.snapshot();
    if let Err(e) = world.restore(&again) {
        panic!("the world does not take its own snapshot: {e}");
    }
}

/// A thread held at its start.
fn simple() -> Result<World, Error> {
    Ok(held()?.0)
}

fn held() -> Result<(World, Handle<Rod>), Error> {
    let mut world = World::new(Settings { halvings: 2, ..Settings::default() })?;
    let first = world.insert_rod(&RodSpec::straight(
        DVec3::new(-0.01, 0.0, 0.0),
        DVec3::new(0.01, 0.0, 0.0),
        8,
        1.5e-4,
        material(),
    ))?;
    world.insert_grip(&GripSpec::at_once(first, Place::Start, Hold::Clamp))?;
    Ok((world, first))
}

fn material() -> Material {
    let set = Plasticity { yield_curvature: 200.0, yield_twist: 300.0, hardening: 0.1 };
    Material { bend_damping: 0.01, plasticity: Some(set), ..Material::elastic(2e9, 1150.0) }
}

/// Two threads, one across the other, on a post, with every kind of grip and load.
fn busy() -> Result<World, Error> {
    let (mut world, first) = held()?;
    let across =
        RodSpec::straight(DVec3::new(0.0, -0.01, 3.0e-4), DVec3::new(0.0, 0.01, 3.0e-4), 8, 1.5e-4, material());
    let second = world.insert_rod(&RodSpec { stretch: Stretch::Inextensible, ..across })?;
    let post = Geometry::Cylinder { radius: 2e-3, half_length: 5e-3 };
    world.insert_shape(&ShapeSpec::fixed(post, Pose::at(DVec3::new(3e-3, 0.0, -7.2e-3))))?;
    let pushed = ShapeMotion::Pushed { direction: DVec3::Z, force: 0.01, speed_limit: 0.02 };
    let ball = ShapeSpec::fixed(Geometry::Sphere { radius: 1e-3 }, Pose::at(DVec3::new(6e-3, 0.0, -1.1e-3)));
    world.insert_shape(&ShapeSpec { motion: pushed, ..ball })?;
    world.insert_grip(&GripSpec::at_once(second, Place::Start, Hold::Jaw))?;
    let drive = Drive::Force { direction: DVec3::Y, force: 0.1, speed_limit: 0.01 };
    world.insert_grip(&GripSpec { drive, ..GripSpec::new(second, Place::End, Hold::Pin) })?;
    world.insert_load(&LoadSpec {
        rod: first,
        kind: LoadKind::Mass { place: Place::End, mass: 1e-6, inertia: DVec3::splat(1e-14) },
    })?;
    world.insert_load(&LoadSpec { rod: first, kind: LoadKind::Uniform { force_per_length: DVec3::Y * 1e-4 } })?;
    // Two dice on the post, one of them in the slot of another one.
    let die = |at: DVec3| BodySpec::solid(Geometry::Box { half_sides: DVec3::splat(5e-4) }, 1000.0, Pose::at(at));
    let gone = world.insert_body(&die(DVec3::new(3e-3, 1e-3, -1.7e-3)))?;
    world.insert_body(&die(DVec3::new(3e-3, -1e-3, -1.7e-3)))?;
    world.remove_body(gone)?;
    let thrown = BodySpec { velocity: DVec3::X * 0.1, ..die(DVec3::new(2.5e-3, 1e-3, -1.7e-3)) };
    world.insert_body(&thrown)?;
    let torque = LoadKind::Point { place: Place::Arc(5e-3), force: DVec3::ZERO, torque: DVec3::X * 1e-7 };
    world.insert_load(&LoadSpec { rod: first, kind: torque })?;
    Ok(world)
}

/// A twisted ring with a branch, and a thread with a reel at both ends, in motion of second order where there is one.
fn joined() -> Result<World, Error> {
    let mut world = World::new(Settings { halvings: 2, integrator: Integrator::TrBdf2, ..Settings::default() })?;
    let ring = RodSpec::ring(DVec3::ZERO, DVec3::Z, DVec3::X * 5e-3, 12, 1.5e-4, material());
    let ring = world.insert_rod(&RodSpec { closure: Some(Closure { twist: 1.0 }), ..ring })?;
    let at = world.rod(ring)?.positions()[6];
    let branch = world.insert_rod(&RodSpec::straight(at, at - DVec3::X * 5e-3, 5, 1.5e-4, material()))?;
    world.insert_weld(&WeldSpec::new(vec![(ring, Place::Particle(6)), (branch, Place::Start)]))?;
    world.insert_grip(&GripSpec::at_once(ring, Place::Start, Hold::Clamp))?;
    let fed =
        world.insert_rod(&RodSpec::straight(DVec3::Y * 0.02, DVec3::new(0.01, 0.02, 0.0), 8, 1.5e-4, material()))?;
    world.insert_grip(&GripSpec::at_once(fed, Place::Start, Hold::Clamp))?;
    world.insert_grip(&GripSpec::at_once(fed, Place::End, Hold::Pin))?;
    world.insert_load(&LoadSpec {
        rod: fed,
        kind: LoadKind::Mass { place: Place::Arc(5e-3), mass: 1e-6, inertia: DVec3::ZERO },
    })?;
    world.insert_reel(&ReelSpec { rod: fed, at_end: false, law: ReelLaw::Rate(0.05), supply: None })?;
    world.insert_reel(&ReelSpec { rod: fed, at_end: true, law: ReelLaw::Brake(0.05), supply: Some(0.01) })?;
    Ok(world)
}
