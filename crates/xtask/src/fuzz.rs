//! Builds the fuzzer and runs its targets for a time. What a target is, is in `crates/fuzz`.
//!
//! The fuzzer is libFuzzer, which the crate `libfuzzer-sys` brings as C++ sources. The flags are those that `cargo
//! fuzz` passes to a stable compiler, so that neither cargo-fuzz nor a nightly toolchain has to be there: only a C++
//! compiler.

use crate::tally::{Tally, cargo, root, target};
use std::io::{BufRead as _, BufReader};
use std::path::PathBuf;
use std::process::{Command, Stdio};

/// Instrumentation for coverage and comparisons.
const FLAGS: &str = "--cfg fuzzing -Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
    -Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table \
    -Cllvm-args=-sanitizer-coverage-trace-compares -Ccodegen-units=1";

/// Longest that one input may take \[s\] (a thousand times what a slow one does), and largest memory \[MB\].
const TIMEOUT: &str = "-timeout=20";
const MEMORY: &str = "-rss_limit_mb=4000";

/// Longest input of each target \[bytes\]: what is longer only says the same again.
const LONGEST: &[(&str, u32)] = &[
    ("edits", 600),
    ("expr", 400),
    ("knot", 1200),
    ("saved", 300),
    ("scene", 3000),
    ("snapshot", 300),
    ("trajectory", 300),
];

/// `cargo xtask fuzz [TARGET] [--minutes M]`.
pub fn command(tally: &mut Tally, args: &[String]) -> Result<(), String> {
    let (mut only, mut minutes) = (None, 10.0);
    let mut rest = args.iter();
    while let Some(arg) = rest.next() {
        match arg.as_str() {
            "--minutes" => {
                let value = rest.next().and_then(|v| v.parse().ok()).filter(|m: &f64| *m > 0.0 && m.is_finite());
                minutes = value.ok_or("`--minutes` wants a number > 0")?;
            }
            name => match LONGEST.iter().find(|(t, _)| *t == name) {
                Some((t, _)) => only = Some(*t),
                None => {
                    return Err(format!(
                        "there is no fuzz target `{name}`; there are {}",
                        LONGEST.iter().map(|(t, _)| *t).collect::<Vec<_>>().join(", ")
                    ));
                }
            },
        }
    }
    run(tally, only, minutes * 60.0);
    Ok(())
}

/// Runs one target or all for so many seconds each. What the fuzzer keeps goes to the folder of build output; a fault
/// stays there too.
pub fn run(tally: &mut Tally, only: Option<&str>, seconds: f64) {
    let Some(programs) = build(tally) else { return };
    for (name, longest) in LONGEST.iter().filter(|(name, _)| only.is_none_or(|o| o == *name)) {
        let work = target().join("fuzz-work").join(name);
        let faults = work.join("faults");
        let corpus = work.join("corpus");
        if let Err(e) = std::fs::create_dir_all(&corpus).and_then(|()| std::fs::create_dir_all(&faults)) {
            return tally.count(&format!("fuzz {name}"), Err(format!("{}: {e}", work.display())));
        }
        let mut command = Command::new(programs.join(name));
        command.current_dir(&work);
        command.args([TIMEOUT, MEMORY, "-print_final_stats=1"]);
        command.arg(format!("-max_total_time={}", seconds.ceil())).arg(format!("-max_len={longest}"));
        command.arg(format!("-artifact_prefix={}/", faults.display()));
        if matches!(*name, "scene" | "expr") {
            command.arg(format!("-dict={}", root().join("fuzz/scene.dict").display()));
        }
        command.arg(&corpus);
        command.args(
            ["corpus", "faults"]
                .map(|kind| root().join("fuzz").join(kind).join(name))
                .into_iter()
                .filter(|f| f.is_dir()),
        );
        println!("\n== fuzz {name} for {seconds:.0} s");
        let result = watch(&mut command);
        match &result {
            Ok(what) => println!("   fuzz {name}: passed, {what}"),
            Err(_) => println!(
                "   the input is in {}; `{} INPUT` tries it again",
                faults.display(),
                programs.join(name).display()
            ),
        }
        tally.count(&format!("fuzz {name}"), result.map(|_| ()));
    }
}

/// Runs a fuzzer to its end: what it did in words, or the last lines of what it printed.
fn watch(command: &mut Command) -> Result<String, String> {
    // A line for all that is new, then the fault or the counts.
    const SHOWN: usize = 50;
    let mut child = command
        .stdin(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|e| format!("{}: {e}", command.get_program().display()))?;
    let mut lines = Vec::new();
    if let Some(out) = child.stderr.take() {
        lines.extend(
            BufReader::new(out).split(b'\n').map_while(Result::ok).map(|l| String::from_utf8_lossy(&l).into_owned()),
        );
    }
    let status = child.wait().map_err(|e| e.to_string())?;
    if status.success() {
        return Ok(summary(&lines));
    }
    Err(format!("{status}\n{}", lines[lines.len().saturating_sub(SHOWN)..].join("\n")))
}

/// Inputs tried and places of the code reached, from what libFuzzer prints at its end.
fn summary(lines: &[String]) -> String {
    let after = |word: &str| lines.iter().rev().find_map(|l| l.split_once(word)?.1.split_whitespace().next());
    format!(
        "{} inputs, {} places of the code",
        after("stat::number_of_executed_units:").unwrap_or("?"),
        after(" cov: ").unwrap_or("?")
    )
}

/// The folder of the built programs; `None` when they cannot be built here, and why is printed.
fn build(tally: &mut Tally) -> Option<PathBuf> {
    let Some(host) = host() else {
        tally.skip("fuzzing", "rustc does not say which machine this is");
        return None;
    };
    // The only tool that a Rust toolchain does not bring. What the crate `cc` would take.
    let compiler = std::env::var("CXX").unwrap_or_else(|_| "c++".into());
    if !Command::new(&compiler).arg("--version").output().is_ok_and(|o| o.status.success()) {
        tally.skip(
            "fuzzing",
            &format!("there is no C++ compiler `{compiler}` for libFuzzer; the corpus is replayed by the tests"),
        );
        return None;
    }
    // Apart from the build, so that a machine without a network is told from a fuzzer that does not build.
    if !cargo(&["fetch", "--quiet", "--manifest-path", "fuzz/Cargo.toml"]).status().is_ok_and(|s| s.success()) {
        tally.skip("fuzzing", "libFuzzer cannot be fetched (the reason is above); the corpus is replayed by the tests");
        return None;
    }
    let folder = target().join("fuzz");
    // Named, so that build scripts and macros are built without the flags.
    let mut command = cargo(&[
        "build",
        "--quiet",
        "--release",
        "--manifest-path",
        "fuzz/Cargo.toml",
        "--target",
        &host,
        "--target-dir",
    ]);
    command.arg(&folder).env("RUSTFLAGS", FLAGS);
    tally.run("fuzzer", &mut command).then(|| folder.join(host).join("release"))
}

/// The triple of this machine, as rustc calls it.
fn host() -> Option<String> {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let out = Command::new(rustc).arg("-vV").output().ok()?;
    String::from_utf8_lossy(&out.stdout).lines().find_map(|l| l.strip_prefix("host: ").map(str::to_string))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_target_has_a_longest_input() {
        let mut folders: Vec<String> = std::fs::read_dir(root().join("fuzz/corpus"))
            .unwrap()
            .map(|f| f.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        folders.sort();
        assert_eq!(folders, LONGEST.iter().map(|(name, _)| *name).collect::<Vec<_>>());
    }

    #[test]
    fn what_the_fuzzer_did_is_read_from_its_last_lines() {
        let lines = [
            "#1912\tNEW    cov: 1600 ft: 6563",
            "#2000\tDONE   cov: 1695 ft: 6563 corp: 447/114Kb",
            "stat::number_of_executed_units: 2000",
        ];
        assert_eq!(summary(&lines.map(str::to_string)), "2000 inputs, 1695 places of the code");
    }

    #[test]
    fn words_that_mean_nothing_are_refused() {
        let mut tally = Tally::default();
        for args in [vec!["sene"], vec!["scene", "--minutes"], vec!["--minutes", "0"], vec!["--minutes", "inf"]] {
            let args: Vec<String> = args.into_iter().map(str::to_string).collect();
            assert!(command(&mut tally, &args).is_err(), "{args:?}");
        }
    }
}
