//! Runs programs and keeps count of what passed and what failed.

use std::fmt::Display;
use std::io::{BufRead as _, BufReader};
use std::path::PathBuf;
use std::process::{Command, ExitCode, Stdio};
use std::time::{Duration, Instant};

/// What was checked so far. Every test of a test program counts, every other step counts as one.
#[derive(Default)]
pub struct Tally {
    passed: u64,
    skipped: u64,
    failed: u64,
    /// Names of what failed, in order.
    failures: Vec<String>,
}

impl Tally {
    /// Counts a step.
    pub fn count(&mut self, step: &str, result: Result<(), impl Display>) {
        match result {
            Ok(()) => self.passed += 1,
            Err(why) => {
                println!("FAILED {step}: {why}");
                self.fail(step);
            }
        }
    }

    /// Counts something that was left out.
    pub fn skip(&mut self, step: &str, why: &str) {
        println!("skipped {step}: {why}");
        self.skipped += 1;
    }

    fn fail(&mut self, name: &str) {
        self.failed += 1;
        self.failures.push(name.to_string());
    }

    /// Runs a program to its end and counts it as one step.
    pub fn run(&mut self, step: &str, command: &mut Command) -> bool {
        let (result, seconds) = timed(step, || status(command));
        let good = result.is_ok();
        println!("   {step}: {} in {seconds:.0} s", if good { "passed" } else { "failed" });
        self.count(step, result);
        good
    }

    /// Runs `cargo test` and counts every test.
    pub fn run_tests(&mut self, step: &str, command: &mut Command) {
        let (result, seconds) = timed(step, || read_tests(command));
        match result {
            Ok((tests, success)) => {
                println!(
                    "   {step}: {} passed, {} failed, {} ignored in {seconds:.0} s",
                    tests.passed, tests.failed, tests.ignored
                );
                self.passed += tests.passed;
                self.skipped += tests.ignored;
                for name in &tests.names {
                    self.fail(&format!("{step}: {name}"));
                }
                // A test program that died, or did not build, leaves no line for its tests.
                let unnamed = tests.failed.saturating_sub(tests.names.len() as u64);
                self.failed += unnamed;
                if unnamed > 0 || (!success && tests.failed == 0) {
                    self.failures.push(format!("{step}: something without a name; see above"));
                    self.failed += u64::from(unnamed == 0);
                }
                if success && tests.passed == 0 {
                    self.fail(&format!("{step}: no test was found"));
                }
            }
            Err(why) => self.count(step, Err(why)),
        }
    }

    /// Prints what failed and, as the last line, the counts.
    pub fn close(self) -> ExitCode {
        println!();
        for name in &self.failures {
            println!("FAILED {name}");
        }
        let skipped = if self.skipped > 0 { format!(", {} skipped", self.skipped) } else { String::new() };
        println!("{} passed, {} failed{skipped}", self.passed, self.failed);
        ExitCode::from(u8::from(self.failed > 0))
    }
}

/// Cargo, the one that runs this program where there is one.
pub fn cargo(args: &[&str]) -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.args(args).current_dir(root()).stdin(Stdio::null());
    command
}

/// The folder of the workspace.
pub fn root() -> PathBuf {
    let own =
        std::env::var_os("CARGO_MANIFEST_DIR").map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")), PathBuf::from);
    own.ancestors().nth(2).expect("this crate is two folders below the workspace").to_path_buf()
}

/// The folder of build output, where this program may also leave files.
pub fn target() -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), |dir| root().join(dir))
}

fn timed<T>(step: &str, work: impl FnOnce() -> T) -> (T, f64) {
    println!("\n== {step}");
    let start = Instant::now();
    let result = work();
    (result, start.elapsed().as_secs_f64())
}

fn status(command: &mut Command) -> Result<(), String> {
    let status = command.status().map_err(|e| format!("{}: {e}", command.get_program().display()))?;
    if status.success() { Ok(()) } else { Err(status.to_string()) }
}

/// Runs a program, but no longer than `limit`.
pub fn status_within(command: &mut Command, limit: Duration) -> Result<(), String> {
    let mut child = command.spawn().map_err(|e| format!("{}: {e}", command.get_program().display()))?;
    let end = Instant::now() + limit;
    loop {
        match child.try_wait().map_err(|e| e.to_string())? {
            Some(status) if status.success() => return Ok(()),
            Some(status) => return Err(status.to_string()),
            None if Instant::now() > end => {
                // It may have ended on its own in between; either way it is over.
                let _ = child.kill();
                let _ = child.wait();
                return Err(format!("stopped after {} s", limit.as_secs()));
            }
            None => std::thread::sleep(Duration::from_millis(20)),
        }
    }
}

/// What test programs said of themselves.
#[derive(Debug, Default, PartialEq, Eq)]
struct Tests {
    passed: u64,
    failed: u64,
    ignored: u64,
    /// Names of the tests that failed.
    names: Vec<String>,
}

impl Tests {
    fn read(&mut self, line: &str) {
        if let Some(name) = line.strip_prefix("test ").and_then(|l| l.strip_suffix(" ... FAILED")) {
            self.names.push(name.to_string());
        }
        let Some(counts) =
            line.strip_prefix("test result: ").and_then(|l| l.split_once(". ")).map(|(_, counts)| counts)
        else {
            return;
        };
        for part in counts.split("; ") {
            let Some((number, what)) = part.split_once(' ') else { continue };
            let Ok(number) = number.parse::<u64>() else { continue };
            match what {
                "passed" => self.passed += number,
                "failed" => self.failed += number,
                "ignored" => self.ignored += number,
                _ => {}
            }
        }
    }
}

/// Runs `cargo test`, shows what it prints, and reads it. Also whether it ended well.
fn read_tests(command: &mut Command) -> Result<(Tests, bool), String> {
    let mut child = command.stdout(Stdio::piped()).spawn().map_err(|e| e.to_string())?;
    let mut tests = Tests::default();
    if let Some(out) = child.stdout.take() {
        for line in BufReader::new(out).split(b'\n') {
            let line = line.map_err(|e| e.to_string())?;
            let line = String::from_utf8_lossy(&line);
            println!("{line}");
            tests.read(line.trim_end());
        }
    }
    let status = child.wait().map_err(|e| e.to_string())?;
    Ok((tests, status.success()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_read_from_what_test_programs_print() {
        let mut tests = Tests::default();
        for line in [
            "running 3 tests",
            "test math::one ... ok",
            "test math::two - should panic ... FAILED",
            "test result: FAILED. 1 passed; 1 failed; 1 ignored; 0 measured; 4 filtered out; finished in 0.00s",
            "test result: ok. 12 passed; 0 failed; 0 ignored; 0 measured; 0 filtered out; finished in 1.25s; merged doctests compilation took 0.31s",
            "a test may print: test result: of nothing",
        ] {
            tests.read(line);
        }
        assert_eq!(tests, Tests { passed: 13, failed: 1, ignored: 1, names: vec!["math::two - should panic".into()] });
    }

    #[cfg(unix)]
    #[test]
    fn what_fails_dies_or_hangs_is_counted_as_failed() {
        let sh = |script: &str| {
            let mut command = Command::new("sh");
            command.args(["-c", script]);
            command
        };
        let mut tally = Tally::default();
        tally.run_tests("good", &mut sh("echo 'test result: ok. 2 passed; 0 failed; 0 ignored'"));
        assert_eq!((tally.passed, tally.failed), (2, 0));
        tally.run_tests("died", &mut sh("echo 'test result: ok. 2 passed; 0 failed; 0 ignored'; exit 101"));
        assert_eq!((tally.passed, tally.failed), (4, 1));
        tally.run_tests(
            "one",
            &mut sh("echo 'test a ... FAILED'; echo 'test result: FAILED. 0 passed; 1 failed; 0 ignored'; exit 101"),
        );
        assert_eq!((tally.passed, tally.failed), (4, 2));
        tally.run_tests("empty", &mut sh("true"));
        assert_eq!((tally.passed, tally.failed), (4, 3));
        assert!(!tally.run("step", &mut sh("exit 3")) && tally.run("step", &mut sh("true")));
        assert_eq!((tally.passed, tally.failed, tally.failures.len()), (5, 4, 4));
        let hung = status_within(&mut sh("sleep 60"), Duration::from_millis(100));
        assert!(hung.unwrap_err().contains("stopped"));
    }
}
