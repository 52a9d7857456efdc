//! Scenes as texts: read, and run for some frames when they are small.

use crate::finite::{self, Found, all, one};
use sutura_scene::{Outcome, Runner, Scene};

/// What is run: elements of all threads (a solid of a body counts for some), substeps, and the product of both.
const MOST_ELEMENTS: usize = 150;
const MOST_SUBSTEPS: f64 = 24.0;
const MOST_WORK: f64 = 1500.0;
const ELEMENTS_A_SOLID: usize = 10;

pub fn run(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    if asks_for_many(text) {
        return;
    }
    match Scene::parse(text, "fuzzed.toml") {
        Ok(scene) => play(scene),
        Err(e) => assert!(!e.problems.is_empty() && !e.to_string().is_empty()),
    }
}

/// Whether a number in the text may be a number of elements that takes long to build: any whole number of more than
/// three digits after the word `elements`.
fn asks_for_many(text: &str) -> bool {
    text.split("elements").skip(1).any(|rest| {
        rest.trim_start_matches(|c: char| !c.is_ascii_digit()).chars().take_while(char::is_ascii_digit).count() > 3
    })
}

/// Runs a scene for some frames and looks at everything it hands over.
pub fn play(scene: Scene) {
    let mut runner = match Runner::new(scene) {
        Ok(runner) => runner,
        Err(e) => return assert!(!e.problems.is_empty()),
    };
    finite::assert(finite::state(runner.world().view()));
    let view = runner.world().view();
    let solids: usize = view.bodies().map(|b| b.shapes().count()).sum();
    let elements = view.rods().map(|r| r.n_elements()).sum::<usize>() + solids * ELEMENTS_A_SOLID;
    if elements > MOST_ELEMENTS {
        return;
    }
    let mut substeps = 0.0;
    loop {
        let settings = runner.world().settings();
        let wanted = (1.0 / runner.scene().frame_rate() / settings.substep).ceil();
        // A frame that is refused as too long costs nothing.
        substeps += if wanted > 1e6 { 1.0 } else { wanted };
        if substeps > MOST_SUBSTEPS || substeps * elements as f64 > MOST_WORK || runner.step_frame().finished {
            break;
        }
        finite::assert(finite::state(runner.world().view()));
    }
    // What is read must be finite where no incident says otherwise; incidents are known at the end.
    let read = finite::readings(runner.world());
    let outcome = runner.finish();
    if outcome.report.incidents.is_empty() {
        finite::assert(read.and_then(|()| reported(&outcome)));
    }
}

fn reported(outcome: &Outcome) -> Found {
    let report = &outcome.report;
    for thread in &report.threads {
        one("length", thread.length_m)?;
        one("largest elongation", thread.max_elongation)?;
        one("largest tension", thread.max_tension_n)?;
    }
    [report.min_clearance.thread_thread, report.min_clearance.thread_shape]
        .into_iter()
        .flatten()
        .try_for_each(|c| one("clearance", c))?;
    one("residual", report.work.max_residual)?;
    one("length error", report.work.max_length_error)?;
    all("gravity", &[report.solver.gravity.into()])?;
    for frame in &outcome.trajectory {
        one("time of a frame", frame.time)?;
        frame.positions.iter().flatten().flatten().try_for_each(|v| one("a recorded position", f64::from(*v)))?;
    }
    Ok(())
}
