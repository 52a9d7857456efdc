//! What the whole check consists of. A step that fails does not stop the others.

use crate::fuzz;
use crate::imports;
use crate::program::{self, GlbValidator, Profile, Program};
use crate::states;
use crate::tally::{Tally, cargo, root};
use crate::viewer;
use std::path::PathBuf;
use std::time::Duration;

/// Scenes that the whole check leaves out, and why. `cargo xtask scenes` runs them all.
const LEFT_OUT: &[(&str, &str)] = &[];

/// The longest that a scene may take \[s\]: many times what the slowest takes on a slow machine; a scene that hangs is
/// stopped.
const LONGEST: Duration = Duration::from_secs(300);

/// How long each fuzz target is tried \[s\], beyond its corpus, which the tests replay. `cargo xtask fuzz` takes
/// longer.
const FUZZING: f64 = 20.0;

/// Scenes that the debug build runs whole, with their motions, conditions and audit: a free thread, and one in contact
/// with a shape. Of all others it does again what the release build recorded.
const RUN_AGAIN: &[&str] = &["hanging_helix", "capstan"];

/// Everything.
pub fn everything(tally: &mut Tally) {
    tally.run("format", &mut cargo(&["fmt", "--check", "--all"]));
    tally.run("lints", &mut cargo(&["clippy", "--workspace", "--all-targets", "--", "--deny", "warnings"]));
    imports::check(tally);
    tests(tally, &[]);
    // The programs have nothing to document beyond their own help. Steps select the whole workspace where they can: a
    // part of it would choose other features of the dependencies and build them again.
    let mut doc = cargo(&["doc", "--workspace", "--lib", "--no-deps"]);
    tally.run("documentation", doc.env("RUSTDOCFLAGS", "--deny warnings"));
    if program::build(tally, Profile::Debug).is_some() {
        tally.run("example of the README", &mut program::example("first_thread"));
    }
    let recorded = scenes(tally, &[]);
    glb(tally, &recorded);
    same_bits(tally, &recorded);
    fuzz::run(tally, None, FUZZING);
    viewer::check(tally);
}

/// All tests, those of the documentation among them: the command in the README, which goes on after the first failure
/// here so that the count is whole.
pub fn tests(tally: &mut Tally, args: &[String]) {
    let mut command = cargo(&["test", "--workspace", "--no-fail-fast"]);
    tally.run_tests("cargo test --workspace", command.args(args));
}

/// What a scene that ran left behind.
pub struct Recorded {
    pub name: String,
    /// What was done to the world, with the state hash after every step.
    pub input: PathBuf,
    trajectory: PathBuf,
}

/// Runs scenes with the release build: the named ones, or all but those left out. Compares their states with those that
/// are kept. Those that ran.
pub fn scenes(tally: &mut Tally, names: &[String]) -> Vec<Recorded> {
    let Some(sutura) = program::build(tally, Profile::Release) else { return Vec::new() };
    let recorded = record(tally, &sutura, names);
    states::check(tally, &sutura, &recorded);
    recorded
}

/// Runs the named scenes, or all but those left out. Those that passed.
pub fn record(tally: &mut Tally, sutura: &Program, names: &[String]) -> Vec<Recorded> {
    let all = match sample_names() {
        Ok(all) => all,
        Err(why) => {
            tally.count("scenes", Err(why));
            return Vec::new();
        }
    };
    println!();
    let mut recorded = Vec::new();
    for name in if names.is_empty() { &all } else { names } {
        let step = format!("scene {name}");
        match LEFT_OUT.iter().find(|(n, _)| n == name) {
            Some((_, why)) if names.is_empty() => tally.skip(&step, why),
            _ => {
                let result = sutura.run_scene(name, &format!("{name}-check"), LONGEST);
                tally.count(
                    &step,
                    result.map(|report| {
                        println!("   {step}: passed, {:.1} s simulated in {:.1} s CPU", report.simulated, report.cpu);
                        recorded.push(Recorded {
                            name: name.clone(),
                            input: report.input,
                            trajectory: report.trajectory,
                        });
                    }),
                );
            }
        }
    }
    recorded
}

/// Every scene as GLB has neither an error nor a warning by the validator of Khronos.
pub fn glb(tally: &mut Tally, recorded: &[Recorded]) {
    let Some(sutura) = program::build(tally, Profile::Release) else { return };
    println!();
    let validator = GlbValidator::fetch();
    if let Err(why) = &validator {
        tally.skip("glTF validator of Khronos", why);
    }
    for Recorded { name, trajectory, .. } in recorded {
        let check = |glb: PathBuf| validator.as_ref().map_or(Ok(()), |v| v.check(&glb));
        tally.count(&format!("GLB of {name}"), sutura.export_glb(trajectory).and_then(check));
    }
}

/// Every scene has the same state after every step in the debug build and in one for other features of the processor.
fn same_bits(tally: &mut Tally, recorded: &[Recorded]) {
    let (Some(release), Some(debug)) = (program::build(tally, Profile::Release), program::build(tally, Profile::Debug))
    else {
        return;
    };
    println!();
    let count = |tally: &mut Tally, step: String, result: Result<(), String>| {
        if result.is_ok() {
            println!("   {step}");
        }
        tally.count(&step, result);
    };
    for Recorded { name, input, .. } in recorded {
        count(tally, format!("same bits of {name}, debug build"), debug.replay(input, LONGEST));
        if RUN_AGAIN.contains(&name.as_str()) {
            let again = debug
                .run_scene(name, &format!("{name}-debug"), LONGEST)
                .and_then(|report| release.compare(input, &report.input));
            count(tally, format!("same bits of {name}, run by the debug build"), again);
        }
    }
    let step = format!("build for {}", program::OTHER_FEATURES);
    if !program::has_other_features() {
        return tally.skip(&step, "this processor is not one of them");
    }
    let Some(recorder) = program::build_for_other_features(tally, &step) else { return };
    for Recorded { name, input, .. } in recorded {
        let result = recorder.record(name, LONGEST).and_then(|other| release.compare(input, &other));
        count(tally, format!("same bits of {name}, {step}"), result);
    }
}

/// Names of the sample scenes, sorted.
pub fn sample_names() -> Result<Vec<String>, String> {
    let folder = root().join("scenes");
    let entries = std::fs::read_dir(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut names: Vec<String> = entries
        .filter_map(|e| e.ok().map(|e| e.path()))
        .filter(|p| p.extension().is_some_and(|e| e == "toml"))
        .filter_map(|p| Some(p.file_stem()?.to_string_lossy().into_owned()))
        .collect();
    names.sort();
    if names.is_empty() { Err(format!("no scene in {}", folder.display())) } else { Ok(names) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_that_are_named_here_exist() {
        let all = sample_names().unwrap();
        for name in LEFT_OUT.iter().map(|(name, _)| name).chain(RUN_AGAIN) {
            assert!(all.iter().any(|n| n == name), "{name}");
        }
    }
}
