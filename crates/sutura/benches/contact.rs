//! How the cost of contact grows with its amount: `cargo bench -p sutura --bench contact [-- FAMILY ...]`. CPU time of
//! a frame, the median, the worst and the first, for each size of a family, and the exponent of the median in the
//! number of contacts over the family.
//!
//! - `floor`: a thread laid on a floor.
//! - `wound`: a thread wound around a post, one end drawn by a force, the other led; friction that lets it slide
//!   whatever the number of turns.
//! - `twist`: two threads wound about each other, drawn by forces at their ends.
//! - `threads`: many threads in one world, each wound around a post of its own.

use cpu_time::ThreadTime;
use std::f64::consts::TAU;
use sutura::glam::{DQuat, DVec3};
use sutura::{
    Drive, Friction, Geometry, Grip, GripSpec, Handle, Hold, Material, Place, Pose, RodSpec, Settings, ShapeSpec, World,
};

const FRAME: f64 = 1.0 / 60.0;
const RADIUS: f64 = 0.12e-3;
const POST: f64 = 2.5e-3;
/// Way of a led end in a frame \[m\].
const LED: f64 = 20e-3 * FRAME;

/// A world and the ends that are led in it, each in a direction.
struct Job {
    world: World,
    led: Vec<(Handle<Grip>, DVec3)>,
    frames: usize,
}

/// Makes a job of a size.
type Make = fn(usize) -> Job;

fn silk() -> Material {
    Material { bend_scale: 0.02, bend_damping: 2e-3, ..Material::elastic(8.7e9, 1300.0) }
}

fn world(gravity: f64, mu: f64) -> World {
    let settings = Settings {
        gravity: DVec3::NEG_Z * gravity,
        friction: Friction::coulomb(mu),
        linear_damping: 0.9,
        ..Settings::default()
    };
    World::new(settings).expect("valid settings")
}

fn floor(elements: usize) -> Job {
    let mut world = world(9.81, 0.3);
    world.insert_shape(&ShapeSpec::fixed(Geometry::Plane, Pose::IDENTITY)).expect("a plane");
    let from = DVec3::Z * (1.04 * RADIUS);
    let to = from + DVec3::X * (0.5e-3 * elements as f64);
    world.insert_rod(&RodSpec::straight(from, to, elements, RADIUS, silk())).expect("a thread");
    Job { world, led: Vec::new(), frames: 40 }
}

/// A thread wound around a post at `center`, into the world.
fn wind(world: &mut World, center: DVec3, turns: f64) -> (Handle<Grip>, DVec3) {
    let (around, tail, element) = (POST + 1.05 * RADIUS, 30e-3, 0.4e-3);
    let arc = TAU * turns * around;
    let at = |s: f64| {
        let turned = (s - tail).clamp(0.0, arc) / around;
        let (sin, cos) = turned.sin_cos();
        let beyond = if s < tail { s - tail } else { (s - tail - arc).max(0.0) };
        center + DVec3::new(around * cos - beyond * sin, around * sin + beyond * cos, 3.0 * RADIUS * turned / TAU)
    };
    let n = ((arc + 2.0 * tail) / element).ceil() as usize;
    let points: Vec<DVec3> = (0..=n).map(|i| at((arc + 2.0 * tail) * i as f64 / n as f64)).collect();
    let away = (points[n] - points[n - 1]).normalize();
    let rod = world.insert_rod(&RodSpec::new(points, RADIUS, silk())).expect("a thread");
    let post = Geometry::Cylinder { radius: POST, half_length: 40e-3 };
    world.insert_shape(&ShapeSpec::fixed(post, Pose::at(center))).expect("a post");
    let drive = Drive::Force { direction: DVec3::NEG_Y, force: 0.02, speed_limit: 0.2 };
    world.insert_grip(&GripSpec { drive, ..GripSpec::at_once(rod, Place::Start, Hold::Pin) }).expect("a free end");
    (world.insert_grip(&GripSpec::at_once(rod, Place::End, Hold::Pin)).expect("a free end"), away)
}

fn wound(turns: usize) -> Job {
    let mut world = world(0.0, 0.3 / turns as f64);
    let led = vec![wind(&mut world, DVec3::ZERO, turns as f64)];
    Job { world, led, frames: 40 }
}

fn threads(count: usize) -> Job {
    let mut world = world(0.0, 0.15);
    let led = (0..count).map(|k| wind(&mut world, DVec3::X * (30e-3 * k as f64), 2.0)).collect();
    Job { world, led, frames: 40 }
}

fn twist(turns: usize) -> Job {
    let mut world = world(0.0, 0.3);
    let (pitch, tail) = (12.0 * RADIUS, 5e-3);
    let length = pitch * turns as f64 + 2.0 * tail;
    let n = (length / (4.0 * RADIUS)).ceil() as usize;
    for side in [0.0, 0.5] {
        let at = |z: f64| {
            let turned = TAU * ((z - tail).clamp(0.0, pitch * turns as f64) / pitch + side);
            // Apart at the ends, together between.
            let apart = ((tail - z).max(z - length + tail) / tail).max(0.0);
            DVec3::new(turned.cos(), turned.sin(), 0.0) * (1.03 * RADIUS + 1e-3 * apart) + DVec3::Z * z
        };
        let points = (0..=n).map(|i| at(length * i as f64 / n as f64)).collect();
        let rod = world.insert_rod(&RodSpec::new(points, RADIUS, silk())).expect("a thread");
        for (place, way) in [(Place::Start, DVec3::NEG_Z), (Place::End, DVec3::Z)] {
            let drive = Drive::Force { direction: way, force: 0.2, speed_limit: 0.05 };
            world.insert_grip(&GripSpec { drive, ..GripSpec::at_once(rod, place, Hold::Pin) }).expect("a free end");
        }
    }
    Job { world, led: Vec::new(), frames: 40 }
}

fn main() {
    let families: [(&str, Make, &[usize]); 4] = [
        ("floor", floor, &[100, 300, 1000, 3000]),
        ("wound", wound, &[1, 3, 10, 30]),
        ("twist", twist, &[4, 12, 36, 100]),
        ("threads", threads, &[1, 2, 4, 8, 16]),
    ];
    let asked: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let head = ["family", "size", "contacts", "median ms", "worst", "first", "substeps", "Newton"];
    println!(
        "{:>8} {:>6} {:>9} {:>10} {:>9} {:>9} {:>9} {:>7}",
        head[0], head[1], head[2], head[3], head[4], head[5], head[6], head[7]
    );
    for (name, make, sizes) in families.iter().filter(|f| asked.is_empty() || asked.iter().any(|a| a == f.0)) {
        let mut points = Vec::new();
        for size in *sizes {
            let mut job = make(*size);
            let (mut ms, mut contacts, mut substeps, mut newton) = (Vec::new(), 0, 0, 0);
            for _ in 0..job.frames {
                for (grip, way) in &job.led {
                    let pose = job.world.grip_pose(*grip).expect("it holds");
                    job.world
                        .set_grip_pose(*grip, Pose::new(pose.position + *way * LED, DQuat::IDENTITY))
                        .expect("it holds");
                }
                let start = ThreadTime::now();
                let report = job.world.step(FRAME);
                ms.push(1e3 * start.elapsed().as_secs_f64());
                (contacts, substeps, newton) =
                    (report.contacts, substeps + report.substeps, newton + report.newton_iterations);
            }
            let first = ms[0];
            ms.sort_by(f64::total_cmp);
            let (median, worst) = (ms[ms.len() / 2], ms[ms.len() - 1]);
            println!(
                "{name:>8} {size:>6} {contacts:>9} {median:>10.3} {worst:>9.2} {first:>9.2} {substeps:>9} {newton:>7}"
            );
            points.push((f64::from(contacts.max(1)).ln(), median.ln()));
        }
        // Least squares in logarithms.
        let n = points.len() as f64;
        let (mx, my) = (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
        let slope = points.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum::<f64>()
            / points.iter().map(|p| (p.0 - mx).powi(2)).sum::<f64>();
        println!("{name:>8} exponent {slope:.2}");
    }
}
