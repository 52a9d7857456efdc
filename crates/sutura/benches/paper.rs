//! Cost of the paper's solver: `cargo bench -p sutura --bench paper [-- ELEMENTS...]`. Median CPU time of a frame, one
//! step a frame, and nanoseconds an element and iteration.

use core::f64::consts::TAU;
use cpu_time::ThreadTime;
use sutura::glam::{DQuat, DVec3};
use sutura::{GripSpec, Hold, Material, PaperSettings, Place, Pose, RodSpec, Settings, Solver, SweepOrder, World};

const DT: f64 = 1.0 / 60.0;

/// Median ms of `frames` frames, of which `before` does what comes before each step.
fn median(world: &mut World, frames: u32, mut before: impl FnMut(&mut World, f64)) -> f64 {
    let mut ms: Vec<f64> = (1..=frames)
        .map(|k| {
            before(world, f64::from(k) / f64::from(frames));
            let start = ThreadTime::now();
            world.step(DT);
            1e3 * start.elapsed().as_secs_f64()
        })
        .collect();
    ms.sort_by(f64::total_cmp);
    ms[ms.len() / 2]
}

fn world(gravity: DVec3, p: PaperSettings) -> World {
    World::new(Settings {
        gravity,
        substep: DT,
        linear_damping: 0.2,
        angular_damping: 0.2,
        solver: Solver::Paper(p),
        ..Settings::default()
    })
    .expect("valid settings")
}

/// Figure 8: 15 cm held at both ends, which move 5 cm against each other and turn once.
fn turned(elements: usize, p: PaperSettings) -> f64 {
    // A little gravity: what is straight and pressed exactly along itself stays straight.
    let mut world = world(DVec3::NEG_Z * 0.1, p);
    let spec = RodSpec::straight(
        DVec3::ZERO,
        DVec3::X * 0.15,
        elements,
        0.075 / elements as f64,
        Material::elastic(2e9, 1150.0),
    );
    let rod = world.insert_rod(&spec).expect("a valid thread");
    world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Jaw)).expect("a free place");
    let grip = world.insert_grip(&GripSpec::at_once(rod, Place::End, Hold::Jaw)).expect("a free place");
    let home = world.grip_pose(grip).expect("a grip");
    median(&mut world, 600, |world, s| {
        let turned = DQuat::from_rotation_x(TAU * s) * home.orientation;
        world.set_grip_pose(grip, Pose::new(home.position - DVec3::X * (0.05 * s), turned)).expect("a pose");
    })
}

/// Figures 13 to 15: 15 m in 120 elements, at rest in a helix, pinned at one end, falling for five seconds.
fn helix(p: PaperSettings) -> f64 {
    let mut world = world(Settings::default().gravity, p);
    let turns = 15.0 / (TAU * 0.5).hypot(1.0);
    let spec =
        RodSpec::helix(DVec3::ZERO, DVec3::X, DVec3::Y * 0.5, turns, 1.0, 120, 0.0625, Material::elastic(2e9, 1150.0));
    let rod = world.insert_rod(&spec).expect("a valid thread");
    world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Pin)).expect("a free place");
    median(&mut world, 300, |_, _| {})
}

fn main() {
    println!(
        "{:>8} {:>10} {:>10} {:>5} {:>12} {:>22}",
        "elements", "iterations", "order", "DDC", "ms a frame", "ns/element/iteration"
    );
    // `cargo bench` adds an option of its own.
    let given: Vec<usize> = std::env::args().skip(1).filter_map(|a| a.parse().ok()).collect();
    let all = given.is_empty();
    for elements in if all { vec![40, 120, 500] } else { given } {
        for (order, name) in [(SweepOrder::Natural, "natural"), (SweepOrder::TwoColor, "two-color")] {
            for direct_distance in [true, false] {
                let p = |iterations| PaperSettings { iterations, order, direct_distance, ..PaperSettings::default() };
                // The slope over iterations, so that what a step costs beside them does not count.
                let [few, many] = [20, 40].map(|n| turned(elements, p(n)));
                let slope = (many - few) * 1e6 / (20.0 * elements as f64);
                println!("{elements:>8} {:>10} {name:>10} {direct_distance:>5} {few:>12.4} {slope:>22.1}", 20);
            }
        }
    }
    if all {
        for direct_distance in [true, false] {
            let ms = [5, 10, 20, 40]
                .map(|iterations| helix(PaperSettings { iterations, direct_distance, ..PaperSettings::default() }));
            println!("falling helix, DDC {direct_distance}: {ms:.4?} ms a frame at 5, 10, 20, 40 iterations");
        }
    }
}
