//! CPU time of a frame of 1/60 s by each method at 40 edges: a thread whose ends come together and turn, under gravity.
//!
//! `cargo run --release -p sutura-rivals --example cost`

#[path = "../tests/support/mod.rs"]
mod support;

use cpu_time::ProcessTime;
use support::{out_of_plane, pressed_and_turned};
use sutura_rivals::{Der, Pbd, Pber, Solver, der, pbd, pber};

fn main() {
    println!(
        "method, substeps, iterations: least and median of 5 runs of 240 frames [ms a frame], greatest strain, out of plane [mm]"
    );
    for (substeps, iterations) in [(1, 20), (1, 100), (20, 20)] {
        let settings = pber::Settings { substeps, iterations, ..Default::default() };
        measure(&format!("ghost points, {substeps}, {iterations}"), || {
            Box::new(Pber::new(pressed_and_turned(1.0), settings).unwrap())
        });
        let settings = pbd::Settings { substeps, iterations, ..Default::default() };
        measure(&format!("distances, {substeps}, {iterations}"), || {
            Box::new(Pbd::new(pressed_and_turned(1.0), settings).unwrap())
        });
    }
    for (substeps, tolerance) in [(1, 1e-9), (1, 1e-4), (4, 1e-9)] {
        let settings = der::Settings { substeps, tolerance, ..Default::default() };
        let make = || Der::new(pressed_and_turned(1.0), settings).unwrap();
        measure(&format!("discrete elastic rods, {substeps}, to {tolerance:e}"), || Box::new(make()));
        let mut der = make();
        (0..240).for_each(|_| der.step(1.0 / 60.0));
        println!(
            "  Newton iterations a substep {:.2}, unsolved {}",
            der.newton_iterations() as f64 / (240 * substeps) as f64,
            der.unsolved()
        );
    }
}

fn measure(name: &str, make: impl Fn() -> Box<dyn Solver>) {
    let mut times = vec![];
    let mut last = None;
    for _ in 0..5 {
        let mut solver = make();
        let start = ProcessTime::now();
        (0..240).for_each(|_| solver.step(1.0 / 60.0));
        times.push(start.elapsed().as_secs_f64() * 1e3 / 240.0);
        last = Some(solver);
    }
    times.sort_by(f64::total_cmp);
    let solver = last.expect("there were runs");
    println!(
        "{name}: {:.4} {:.4}, {:.2e}, {:.3}",
        times[0],
        times[2],
        solver.greatest_strain(),
        1e3 * out_of_plane(&*solver)
    );
}
