//! How the cost of contact grows with its amount: `cargo bench -p sutura --bench contact [-- FAMILY ...]`. CPU time of
//! a frame, the median, the 99th percentile, the worst and the first, for each size of a family, and the exponent of
//! the median in the number of contacts over the family. Contacts are those that carry force at the end; of several
//! incidents the first is printed. All families take two to three minutes; those named after `--` are run alone.
//!
//! - `floor`: a thread laid on a floor.
//! - `wound`: a thread wound around a post, one end drawn by a force, the other led; friction that lets it slide
//!   whatever the number of turns.
//! - `twist`: two threads wound about each other, drawn by forces at their ends.
//! - `threads`: many threads in one world, each wound around a post of its own.
//! - `row`: loose overhand knots in a row on one thread, drawn tight by forces at its ends, which then rest.
//! - `knots`: many threads in one world, each with one such knot.
//! - `idle`: one such knot, and beside it threads that swing from a pin and touch nothing.
//! - `swing`: those threads without the knot. A frame of `idle` should cost the knot and this.

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

/// Radius of a thread with knots; its elements are a diameter long, some 65 to a knot.
const KNOTTED: f64 = 0.2e-3;

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

/// Loose overhand knots in a row along x, and straight ends: two strands that make three half turns about each other,
/// the end of the first led back over them to the start of the second.
fn overhands(count: usize, from: DVec3) -> Vec<DVec3> {
    // Half the distance of the strands, length of a throw, radius of the bends of a loop, and what is straight at the
    // ends and between knots; in diameters.
    let (apart, throw, bend, end) = (1.1, 10.0, 2.5, 10.0);
    let fine = (0..200).map(|i| f64::from(i) / 200.0);
    let strand = |x: f64, side: f64, u: f64| {
        let (sin, cos) = (1.5 * TAU * u * u * (3.0 - 2.0 * u)).sin_cos();
        DVec3::new(x + throw * u, -side * apart * cos, side * apart * sin)
    };
    let around = |x: f64, angle: f64| DVec3::new(x + bend * angle.sin(), apart + bend * (1.0 - angle.cos()), 0.0);
    let mut points = vec![DVec3::new(-end, -apart, 0.0)];
    for k in 0..count {
        let x = (throw + end) * k as f64;
        points.extend(fine.clone().map(|u| strand(x, 1.0, u)));
        points.extend(fine.clone().map(|u| around(x + throw, 0.5 * TAU * u)));
        points.extend(fine.clone().map(|u| around(x, 0.5 * TAU * (1.0 + u))));
        points.extend(fine.clone().map(|u| strand(x, -1.0, u)));
        points.push(DVec3::new(x + throw, -apart, 0.0));
    }
    points.push(points[points.len() - 1] + DVec3::X * end);
    // Equal elements.
    let mut arc = vec![0.0];
    arc.extend(points.windows(2).scan(0.0, |arc, w| {
        *arc += w[0].distance(w[1]);
        Some(*arc)
    }));
    let total = arc[arc.len() - 1];
    let n = total.round();
    let at = |s: f64| {
        let k = arc.partition_point(|a| *a < s).clamp(1, arc.len() - 1);
        points[k - 1].lerp(points[k], (s - arc[k - 1]) / (arc[k] - arc[k - 1]))
    };
    (0..=n as usize).map(|i| from + at(total * i as f64 / n) * (2.0 * KNOTTED)).collect()
}

/// A thread with knots, into the world, and the forces that draw them tight, each knot in the same time.
fn knotted(world: &mut World, count: usize, from: DVec3) {
    let material = Material { bend_damping: 10e-3, ..silk() };
    let rod = world.insert_rod(&RodSpec::new(overhands(count, from), KNOTTED, material)).expect("a thread");
    for (place, direction) in [(Place::Start, DVec3::NEG_X), (Place::End, DVec3::X)] {
        let drive = Drive::Force { direction, force: 0.5, speed_limit: 6e-3 * count as f64 };
        world.insert_grip(&GripSpec { drive, ..GripSpec::at_once(rod, place, Hold::Pin) }).expect("a free end");
    }
}

fn row(count: usize) -> Job {
    let mut world = world(0.0, 0.3);
    knotted(&mut world, count, DVec3::ZERO);
    Job { world, led: Vec::new(), frames: 150 }
}

fn knots(count: usize) -> Job {
    let mut world = world(0.0, 0.3);
    (0..count).for_each(|k| knotted(&mut world, 1, DVec3::Y * (20e-3 * k as f64)));
    Job { world, led: Vec::new(), frames: 150 }
}

fn swing(count: usize) -> Job {
    let mut world = world(9.81, 0.3);
    for k in 0..count {
        let from = DVec3::Y * (20e-3 + 3e-3 * k as f64);
        let to = from + DVec3::new(5e-3, 0.0, -25e-3);
        let rod = world.insert_rod(&RodSpec::straight(from, to, 64, KNOTTED, silk())).expect("a thread");
        world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Pin)).expect("a free end");
    }
    Job { world, led: Vec::new(), frames: 150 }
}

fn idle(count: usize) -> Job {
    let mut job = swing(count);
    knotted(&mut job.world, 1, DVec3::ZERO);
    job
}

fn main() {
    let families: [(&str, Make, &[usize]); 8] = [
        ("floor", floor, &[100, 300, 1000, 3000]),
        ("wound", wound, &[1, 3, 10, 30]),
        ("twist", twist, &[4, 12, 36, 100]),
        ("threads", threads, &[1, 2, 4, 8, 16]),
        ("row", row, &[1, 2, 4, 8, 16]),
        ("knots", knots, &[1, 2, 4, 8, 16]),
        ("idle", idle, &[0, 8, 31]),
        ("swing", swing, &[8, 31]),
    ];
    let asked: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    println!(
        "  family   size  contacts  median ms       p99     worst     first  substeps  rejected  Newton  incidents"
    );
    for (name, make, sizes) in families.iter().filter(|f| asked.is_empty() || asked.iter().any(|a| a == f.0)) {
        let mut points = Vec::new();
        for size in *sizes {
            let mut job = make(*size);
            let (mut ms, mut contacts, mut incidents) = (Vec::new(), 0, Vec::new());
            let (mut substeps, mut rejected, mut newton) = (0, 0, 0);
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
                contacts = report.contacts;
                substeps += report.substeps;
                rejected += report.rejected;
                newton += report.newton_iterations;
                incidents.extend(report.incidents);
            }
            let first = ms[0];
            ms.sort_by(f64::total_cmp);
            let [median, p99, worst] = [0.5, 0.99, 1.0].map(|q: f64| ms[(q * ms.len() as f64).ceil() as usize - 1]);
            println!(
                "{name:>8} {size:>6} {contacts:>9} {median:>10.3} {p99:>9.2} {worst:>9.2} {first:>9.2} {substeps:>9} \
                 {rejected:>9} {newton:>7} {:>10}",
                incidents.len()
            );
            if let Some(first) = incidents.first() {
                println!("{name:>8} first incident at {:.4} s: {}", first.time, first.kind);
            }
            points.push((f64::from(contacts.max(1)).ln(), median.ln()));
        }
        if matches!(*name, "idle" | "swing") {
            continue;
        }
        // Least squares in logarithms.
        let n = points.len() as f64;
        let (mx, my) = (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
        let slope = points.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum::<f64>()
            / points.iter().map(|p| (p.0 - mx).powi(2)).sum::<f64>();
        println!("{name:>8} exponent {slope:.2}");
    }
}
