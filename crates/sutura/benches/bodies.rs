//! Cost of bodies: `cargo bench -p sutura --bench bodies [-- COUNT ...]`. Milliseconds of CPU time per frame, median and
//! worst: of boxes apart from each other on a floor, of solids dropped into a box, of a thread of 120 elements with a
//! point mass, with a needle of that mass and with one that is driven, of beads on a thread, and of jaws that close on
//! a wire with forces in newtons.

use cpu_time::ThreadTime;
use sutura::glam::{DQuat, DVec3};
use sutura::{
    BodyMotion, BodySpec, Friction, Geometry, GripSpec, Handle, Hold, InstrumentSpec, LoadKind, LoadSpec, Material,
    NeedleSpec, Place, Pose, Rod, RodSpec, Settings, ShapeSpec, WeldRest, WeldSpec, World,
};

fn world() -> World {
    let friction = Friction { stick: 0.4, slide: 0.4 };
    let settings = Settings { gravity: DVec3::Z * -9.81, friction, ..Settings::default() };
    let mut world = World::new(settings).expect("valid settings");
    world.insert_shape(&ShapeSpec::fixed(Geometry::Plane, Pose::IDENTITY)).expect("a floor");
    world
}

fn boxes(count: u32) -> World {
    let mut world = world();
    for k in 0..count {
        let at = Pose::at(DVec3::new(0.02 * f64::from(k), 0.0, 0.005));
        let cube = Geometry::Box { half_sides: DVec3::splat(0.005) };
        world.insert_body(&BodySpec::solid(cube, 1000.0, at)).expect("a box");
    }
    world
}

fn heap(count: u32) -> World {
    let mut world = world();
    for inward in [DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Y] {
        let wall = Pose::new(inward * -0.02, DQuat::from_rotation_arc(DVec3::Z, inward));
        world.insert_shape(&ShapeSpec::fixed(Geometry::Plane, wall)).expect("a wall");
    }
    for k in 0..count {
        let solid = match k % 4 {
            0 => Geometry::Sphere { radius: 0.006 },
            1 => Geometry::Box { half_sides: DVec3::new(0.005, 0.006, 0.007) },
            2 => Geometry::Cylinder { radius: 0.005, half_length: 0.007 },
            _ => Geometry::Capsule { radius: 0.004, half_length: 0.005 },
        };
        let f = f64::from(k);
        let at = DVec3::new(0.004 * f64::from(k % 3) - 0.004, 0.003 * f64::from(k % 2), 0.01 + 0.016 * f);
        let turn = DQuat::from_rotation_x(0.3 * f) * DQuat::from_rotation_y(0.2 * f);
        world.insert_body(&BodySpec::solid(solid, 1000.0, Pose::new(at, turn))).expect("a solid");
    }
    world
}

/// A thread that hangs from a clamp and swings, with what `add` puts at its end.
fn hanging(add: impl Fn(&mut World, Handle<Rod>, DVec3)) -> World {
    let mut world = World::new(Settings::default()).expect("valid settings");
    let down = DVec3::new(0.3, 0.0, -1.0).normalize();
    let end = down * 0.12;
    let thread = RodSpec::straight(DVec3::ZERO, end, 120, 1.1e-4, Material::elastic(2e9, 1150.0));
    let rod = world.insert_rod(&thread).expect("a thread");
    world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Pin)).expect("a grip");
    add(&mut world, rod, end);
    world
}

fn with_mass(world: &mut World, rod: Handle<Rod>, _: DVec3) {
    let kind = LoadKind::Mass { place: Place::End, mass: 66e-6, inertia: DVec3::ZERO };
    world.insert_load(&LoadSpec { rod, kind }).expect("a load");
}

fn with_needle(motion: BodyMotion) -> impl Fn(&mut World, Handle<Rod>, DVec3) {
    move |world, rod, end| {
        let needle = NeedleSpec::preset("SH").expect("a needle of the catalogue");
        let body = needle.body(needle.pose(end, end, DVec3::X)).expect("a needle");
        let body = world.insert_body(&body).expect("a body");
        world.set_body_motion(body, motion).expect("a body of this world");
        world.insert_weld(&WeldSpec::to_body((rod, Place::End), body, DVec3::ZERO)).expect("a swage");
    }
}

/// Beads that a thread runs through, evenly along it.
fn with_beads(count: u32) -> impl Fn(&mut World, Handle<Rod>, DVec3) {
    move |world, rod, _| {
        for k in 0..count {
            let particle = 120 * (k + 1) / (count + 1);
            let at = world.rod(rod).expect("a thread of this world").positions()[particle as usize];
            let bead = BodySpec::solid(Geometry::Sphere { radius: 4e-4 }, 2500.0, Pose::at(at));
            let body = world.insert_body(&bead).expect("a bead");
            let weld = WeldSpec::to_body((rod, Place::Particle(particle)), body, DVec3::ZERO);
            world.insert_weld(&WeldSpec { rest: WeldRest::Loose, ..weld }).expect("a bead on its thread");
        }
    }
}

/// Jaws that are about to close on a wire.
fn jaws(force: u32) -> World {
    let friction = Friction { stick: 0.3, slide: 0.3 };
    let settings = Settings { gravity: DVec3::ZERO, friction, ..Settings::default() };
    let mut world = World::new(settings).expect("valid settings");
    let driver = InstrumentSpec::needle_driver(Pose::IDENTITY);
    let spec = InstrumentSpec { opening: 0.2, closing_force: f64::from(force), ..driver };
    let tool = world.insert_instrument(&spec).expect("an instrument");
    let wire = Geometry::Capsule { radius: 3e-4, half_length: 6e-3 };
    let at = Pose::new(DVec3::new(3e-4, 0.0, 5e-3), DQuat::from_rotation_arc(DVec3::Z, DVec3::Y));
    world.insert_body(&BodySpec::solid(wire, 7900.0, at)).expect("a wire");
    world.close_jaws(&tool, &spec, true).expect("an instrument of this world");
    world
}

fn measure(name: &str, count: u32, mut world: World, frames: usize) {
    let mut ms: Vec<f64> = (0..frames)
        .map(|_| {
            let start = ThreadTime::now();
            world.step(1.0 / 60.0);
            1e3 * start.elapsed().as_secs_f64()
        })
        .collect();
    let last: f64 = ms[frames - frames / 6..].iter().sum::<f64>() / (frames / 6) as f64;
    ms.sort_by(f64::total_cmp);
    println!("{name:>8} {count:>7} {:>9.3} {:>9.3} {last:>14.3}", ms[frames / 2], ms[frames - 1]);
}

fn main() {
    let counts: Vec<u32> = std::env::args().filter_map(|a| a.parse().ok()).collect();
    let of = |default: &[u32]| if counts.is_empty() { default.to_vec() } else { counts.clone() };
    println!("{:>8} {:>7} {:>9} {:>9} {:>14}", "", "bodies", "median", "worst", "last sixth");
    for count in of(&[2, 4, 8, 16, 32]) {
        measure("boxes", count, boxes(count), 60);
    }
    for count in of(&[5, 10]) {
        measure("heap", count, heap(count), 120);
    }
    measure("mass", 1, hanging(with_mass), 120);
    measure("needle", 1, hanging(with_needle(BodyMotion::Free)), 120);
    measure("driven", 1, hanging(with_needle(BodyMotion::Driven)), 120);
    for count in of(&[1, 2, 4, 8, 16]) {
        measure("beads", count, hanging(with_beads(count)), 60);
    }
    println!("{:>8} {:>7}", "", "newtons");
    for force in [1, 10, 100] {
        measure("jaws", force, jaws(force), 60);
    }
}
