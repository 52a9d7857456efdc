//! Cost of the paper's solver: `cargo bench -p sutura --bench paper`. Median CPU time of a frame, one step a frame, and nanoseconds an element and iteration.

use cpu_time::ThreadTime;
use sutura::glam::{DQuat, DVec3};
use sutura::{GripSpec, Hold, Material, PaperSettings, Place, Pose, RodSpec, Settings, Solver, SweepOrder, World};

const DT: f64 = 1.0 / 60.0;
const FRAMES: u32 = 600;

/// Figure 8: 15 cm held at both ends, which move 5 cm against each other and turn once.
fn frame(elements: usize, p: PaperSettings) -> f64 {
    // A little gravity: what is straight and pressed exactly along itself stays straight.
    let gravity = DVec3::NEG_Z * 0.1;
    let settings = Settings { gravity, substep: DT, linear_damping: 0.2, angular_damping: 0.2, solver: Solver::Paper(p), ..Settings::default() };
    let mut world = World::new(settings).expect("valid settings");
    let spec = RodSpec::straight(DVec3::ZERO, DVec3::X * 0.15, elements, 0.075 / elements as f64, Material::elastic(2e9, 1150.0));
    let rod = world.insert_rod(&spec).expect("a valid thread");
    world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Jaw)).expect("a free place");
    let grip = world.insert_grip(&GripSpec::at_once(rod, Place::End, Hold::Jaw)).expect("a free place");
    let home = world.grip_pose(grip).expect("a grip");
    let mut ms: Vec<f64> = (1..=FRAMES)
        .map(|k| {
            let s = f64::from(k) / f64::from(FRAMES);
            let turned = DQuat::from_rotation_x(core::f64::consts::TAU * s) * home.orientation;
            world.set_grip_pose(grip, Pose::new(home.position - DVec3::X * (0.05 * s), turned)).expect("a pose");
            let start = ThreadTime::now();
            world.step(DT);
            1e3 * start.elapsed().as_secs_f64()
        })
        .collect();
    ms.sort_by(f64::total_cmp);
    ms[ms.len() / 2]
}

fn main() {
    println!("{:>8} {:>10} {:>10} {:>5} {:>12} {:>22}", "elements", "iterations", "order", "DDC", "ms a frame", "ns/element/iteration");
    for elements in [40, 120, 500] {
        for (order, name) in [(SweepOrder::Natural, "natural"), (SweepOrder::TwoColor, "two-color")] {
            for direct_distance in [true, false] {
                let p = |iterations| PaperSettings { iterations, order, direct_distance, ..PaperSettings::default() };
                // The slope over iterations, so that what a step costs beside them does not count.
                let [few, many] = [20, 40].map(|n| frame(elements, p(n)));
                let slope = (many - few) * 1e6 / (20.0 * elements as f64);
                println!("{elements:>8} {:>10} {name:>10} {direct_distance:>5} {few:>12.4} {slope:>22.1}", 20);
            }
        }
    }
}
