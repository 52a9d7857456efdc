//! Cost of free bodies at rest and in a heap: `cargo bench -p sutura --bench bodies [-- COUNT ...]`. Milliseconds of
//! CPU time a frame: median and worst, of boxes apart from each other on a floor and of solids dropped into a box.

use cpu_time::ThreadTime;
use sutura::glam::{DQuat, DVec3};
use sutura::{BodySpec, Friction, Geometry, Pose, Settings, ShapeSpec, World};

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
}
