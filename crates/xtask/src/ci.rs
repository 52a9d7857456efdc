//! What the whole check consists of. A step that fails does not stop the others.

use crate::fuzz;
use crate::program::{self, Profile};
use crate::tally::{Tally, cargo, root};
use std::time::Duration;

/// Scenes that the whole check leaves out, and why. `cargo xtask scenes` runs them all.
const LEFT_OUT: &[(&str, &str)] = &[];

/// The longest that a scene may take \[s\]: many times what the slowest takes on a slow machine; a scene that hangs is stopped.
const LONGEST: Duration = Duration::from_secs(300);

/// How long each fuzz target is tried \[s\], beyond its corpus, which the tests replay. `cargo xtask fuzz` takes longer.
const FUZZING: f64 = 20.0;

/// Scenes whose last state must be the same on every run and in every build: a free thread, and one in contact with a shape. The
/// unoptimized build runs them too, so they are quick ones.
const SAME_BITS: &[&str] = &["hanging_helix", "capstan"];

/// Everything.
pub fn everything(tally: &mut Tally) {
    tally.run("format", &mut cargo(&["fmt", "--check", "--all"]));
    tally.run("lints", &mut cargo(&["clippy", "--workspace", "--all-targets", "--", "--deny", "warnings"]));
    tests(tally, &[]);
    // The programs have nothing to document beyond their own help. Steps select the whole workspace where they can: a part of it
    // would choose other features of the dependencies and build them again.
    let mut doc = cargo(&["doc", "--workspace", "--lib", "--no-deps"]);
    tally.run("documentation", doc.env("RUSTDOCFLAGS", "--deny warnings"));
    if program::build(tally, Profile::Debug).is_some() {
        tally.run("example of the README", &mut program::example("first_thread"));
    }
    scenes(tally, &[]);
    same_bits(tally);
    fuzz::run(tally, None, FUZZING);
}

/// All tests, those of the documentation among them: the command in the README, which goes on after the first failure here so that the
/// count is whole.
pub fn tests(tally: &mut Tally, args: &[String]) {
    let mut command = cargo(&["test", "--workspace", "--no-fail-fast"]);
    tally.run_tests("cargo test --workspace", command.args(args));
}

/// Runs scenes with the release build: the named ones, or all but those left out.
pub fn scenes(tally: &mut Tally, names: &[String]) {
    let Some(sutura) = program::build(tally, Profile::Release) else { return };
    let all = match sample_names() {
        Ok(all) => all,
        Err(why) => return tally.count("scenes", Err(why)),
    };
    println!();
    for name in if names.is_empty() { &all } else { names } {
        let step = format!("scene {name}");
        match LEFT_OUT.iter().find(|(n, _)| n == name) {
            Some((_, why)) if names.is_empty() => tally.skip(&step, why),
            _ => {
                let result = sutura.run_scene(name, &format!("{name}-check"), LONGEST);
                if let Ok(report) = &result {
                    println!("   {step}: passed, {:.1} s simulated in {:.1} s CPU", report.simulated, report.cpu);
                }
                tally.count(&step, result.map(|_| ()));
            }
        }
    }
}

/// The same bits twice from one build, and from two builds.
fn same_bits(tally: &mut Tally) {
    let (Some(release), Some(debug)) = (program::build(tally, Profile::Release), program::build(tally, Profile::Debug)) else { return };
    println!();
    for name in SAME_BITS {
        let hash = |sutura: &program::Program, run: &str| sutura.run_scene(name, &format!("{name}-{run}"), LONGEST).map(|r| r.state_hash);
        let (first, second, other) = (hash(&release, "first"), hash(&release, "second"), hash(&debug, "debug"));
        let mut compare = |step: &str, a: &Result<String, String>, b: &Result<String, String>| {
            let result = match (a, b) {
                (Ok(a), Ok(b)) if a == b => Ok(()),
                (Ok(a), Ok(b)) => Err(format!("the states differ: {a} and {b}")),
                (Err(why), _) | (_, Err(why)) => Err(why.clone()),
            };
            if result.is_ok() {
                println!("   {name}, {step}: the same bits");
            }
            tally.count(&format!("same bits of {name}, {step}"), result);
        };
        compare("two runs", &first, &second);
        compare("release and debug builds", &first, &other);
    }
}

/// Names of the sample scenes, sorted.
fn sample_names() -> Result<Vec<String>, String> {
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
        for name in LEFT_OUT.iter().map(|(name, _)| name).chain(SAME_BITS) {
            assert!(all.iter().any(|n| n == name), "{name}");
        }
    }
}
