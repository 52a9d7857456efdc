//! Every sample scene runs and passes its own checks.

use sutura_scene::{Outcome, Runner, Scene, samples};

fn run(name: &str) -> Outcome {
    let sample = samples().iter().find(|s| s.name == name).unwrap_or_else(|| panic!("no sample {name}"));
    let scene = Scene::parse(sample.text, &format!("{name}.toml")).unwrap_or_else(|e| panic!("{e}"));
    let mut runner = Runner::new(scene).unwrap_or_else(|e| panic!("{e}"));
    while !runner.step_frame().finished {}
    runner.finish()
}

fn passes(name: &str) {
    let outcome = run(name);
    let r = &outcome.report;
    for c in &r.checks {
        let value = c.value.as_ref().map_or("-".into(), ToString::to_string);
        println!("{} {}: {value} {} (wanted {})", if c.passed { "ok  " } else { "FAIL" }, c.name, c.unit, c.wanted);
    }
    for i in &r.incidents {
        println!("incident: {} x{} from {} s", i.message, i.count, i.first_s);
    }
    for p in &r.phases {
        println!("phase {}: {} to {} s, {}", p.name, p.start_s, p.end_s, p.ended_by);
    }
    println!(
        "{} frames, {:.3} ms median, real time x{:.1}, substeps {}, newton {}",
        r.frames, r.ms_per_frame.median, r.real_time_factor, r.work.substeps, r.work.newton_iterations
    );
    assert!(r.passed, "{name} does not pass");
}

macro_rules! sample_tests {
    ($($name:ident),* $(,)?) => { $(#[test] fn $name() { passes(stringify!($name)); })* };
}

sample_tests!(
    elastica_tip_load,
    elastica_self_weight,
    catenary,
    clamped_twist,
    hanging_chain,
    hanging_helix,
    free_thread,
    capstan,
    cut,
    rolling,
    hanging_needle,
    hand_over,
    pendulum,
    heap
);
