//! The command-line program `sutura`: builds it, runs scenes with it and reads their reports.

use crate::tally::{Tally, cargo, root, status_within, target};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

/// With which optimization the program is built.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Profile {
    Debug,
    Release,
}

/// A program that was built.
pub struct Program {
    path: PathBuf,
}

/// What a run reported, as far as the checks need it.
pub struct Report {
    /// What was done to the world, with the state hash after every step.
    pub input: PathBuf,
    /// Where everything was, frame by frame.
    pub trajectory: PathBuf,
    pub simulated: f64,
    pub cpu: f64,
}

/// Builds the program; `None` (and a failed step) when it does not build.
pub fn build(tally: &mut Tally, profile: Profile) -> Option<Program> {
    let (name, folder, args) = match profile {
        // The tests build program and examples too, so after them there is nothing left to build.
        Profile::Debug => ("debug build", "debug", ["test", "--quiet", "--workspace", "--no-run"]),
        Profile::Release => ("release build", "release", ["build", "--release", "--package", "sutura-cli"]),
    };
    let mut command = cargo(&args);
    let path = target().join(folder).join(format!("sutura{}", std::env::consts::EXE_SUFFIX));
    tally.run(name, &mut command).then_some(Program { path })
}

/// An example of the debug build.
pub fn example(name: &str) -> Command {
    let mut command =
        Command::new(target().join("debug/examples").join(format!("{name}{}", std::env::consts::EXE_SUFFIX)));
    command.current_dir(root()).stdin(Stdio::null());
    command
}

impl Program {
    fn command(&self) -> Command {
        let mut command = Command::new(&self.path);
        command.current_dir(root()).stdin(Stdio::null());
        command
    }

    /// Runs a sample scene without pictures; an error when it ends with another exit code than 0.
    pub fn run_scene(&self, name: &str, run: &str, limit: Duration) -> Result<Report, String> {
        let out = target().join("scenes").join(run);
        let file = format!("scenes/{name}.toml");
        let mut command = self.command();
        command.args(["run", &file, "--quiet", "--no-plots", "--no-stills", "--record", "--out"]).arg(&out);
        // Results of an earlier run must not pass for those of this one, and may be of another version of the program.
        let _ = std::fs::remove_dir_all(&out);
        let ended = status_within(&mut command, limit);
        let report = read(&out.join("report.json"));
        match (ended, report) {
            (Ok(()), Ok((report, _))) => Ok(report),
            (Err(why), Ok((_, failed))) if !failed.is_empty() => Err(format!("{why}: {}", failed.join("; "))),
            (Err(why), _) | (_, Err(why)) => Err(why),
        }
    }

    /// Does a recorded input again; an error when the state is another one after any step.
    pub fn replay(&self, input: &Path, limit: Duration) -> Result<(), String> {
        status_within(self.command().args(["replay", "--quiet"]).arg(input), limit)
    }

    /// The state hash after every step of a recorded input.
    pub fn hashes(&self, input: &Path) -> Result<Vec<u64>, String> {
        let output = self.command().args(["replay", "--hashes"]).arg(input).output().map_err(|e| e.to_string())?;
        if !output.status.success() {
            return Err(format!("{}: {}", output.status, String::from_utf8_lossy(&output.stderr)));
        }
        let hash = |line: &str| u64::from_str_radix(line, 16).map_err(|e| format!("`{line}` is no hash: {e}"));
        String::from_utf8_lossy(&output.stdout).lines().map(hash).collect()
    }

    /// Exports a recorded trajectory as GLB beside it.
    pub fn export_glb(&self, trajectory: &Path) -> Result<PathBuf, String> {
        let glb = trajectory.with_extension("glb");
        let _ = std::fs::remove_file(&glb);
        status_within(
            self.command().args(["export", "--quiet"]).arg(trajectory).arg("--out").arg(&glb),
            Duration::from_secs(60),
        )?;
        Ok(glb)
    }

    /// Compares two recorded inputs and their states.
    pub fn compare(&self, input: &Path, other: &Path) -> Result<(), String> {
        status_within(
            self.command().args(["replay", "--quiet"]).arg(input).arg("--with").arg(other),
            Duration::from_secs(60),
        )
    }

    /// Runs a sample scene with the recorder of another build; what it recorded.
    pub fn record(&self, name: &str, limit: Duration) -> Result<PathBuf, String> {
        let out = target().join("scenes/other-features");
        let input = out.join(format!("{name}.input"));
        let _ = std::fs::remove_file(&input);
        status_within(self.command().arg(out).arg(format!("scenes/{name}.toml")).stdout(Stdio::null()), limit)?;
        Ok(input)
    }
}

/// The glTF validator of Khronos, run by Node.js.
pub struct GlbValidator {
    folder: PathBuf,
}

impl GlbValidator {
    /// Fetches it where that was not done yet; an error where it cannot be had.
    pub fn fetch() -> Result<Self, String> {
        let validator = GlbValidator { folder: target().join("gltf-validator") };
        match validator.command().arg("--fetch").status() {
            Ok(status) if status.success() => Ok(validator),
            Ok(_) => Err("npm could not fetch it".into()),
            Err(e) => Err(format!("no Node.js: {e}")),
        }
    }

    /// An error when it finds an error or a warning, which it prints.
    pub fn check(&self, glb: &Path) -> Result<(), String> {
        status_within(self.command().arg(glb), Duration::from_secs(60))
    }

    fn command(&self) -> Command {
        let mut command = Command::new("node");
        command.current_dir(root()).stdin(Stdio::null()).arg("scripts/validate_glb.mjs").arg(&self.folder);
        command
    }
}

/// Features of the processor for which a second build is made: with AVX2 and fused multiply-add the compiler may
/// vectorize and contract otherwise, and must not.
pub const OTHER_FEATURES: &str = "x86-64-v3";

/// Whether this processor has them.
pub fn has_other_features() -> bool {
    #[cfg(target_arch = "x86_64")]
    return std::is_x86_feature_detected!("avx2")
        && std::is_x86_feature_detected!("bmi2")
        && std::is_x86_feature_detected!("f16c")
        && std::is_x86_feature_detected!("fma")
        && std::is_x86_feature_detected!("lzcnt")
        && std::is_x86_feature_detected!("movbe");
    #[cfg(not(target_arch = "x86_64"))]
    return false;
}

/// A recorder of scenes for these features: not the whole program, which takes several times as long to build.
pub fn build_for_other_features(tally: &mut Tally, step: &str) -> Option<Program> {
    let folder = target().join("other-features");
    let mut command =
        cargo(&["build", "--release", "--package", "sutura-scene", "--example", "record", "--target-dir"]);
    command.arg(&folder).env("RUSTFLAGS", format!("-C target-cpu={OTHER_FEATURES}"));
    let path = folder.join("release/examples").join(format!("record{}", std::env::consts::EXE_SUFFIX));
    tally.run(step, &mut command).then_some(Program { path })
}

/// The report in a folder, and its checks that failed.
fn read(path: &Path) -> Result<(Report, Vec<String>), String> {
    let problem = |e: &dyn std::fmt::Display| format!("{}: {e}", path.display());
    let text = std::fs::read_to_string(path).map_err(|e| problem(&e))?;
    let json: serde_json::Value = serde_json::from_str(&text).map_err(|e| problem(&e))?;
    let number = |key: &str| json[key].as_f64().ok_or_else(|| problem(&format!("no number `{key}`")));
    let (input, trajectory) = (path.with_file_name("input.sutura"), path.with_file_name("trajectory.sutura"));
    let checks = json["checks"].as_array().into_iter().flatten().filter(|c| c["passed"] == false);
    let failed = checks.map(|c| format!("{} is {}, wanted {}", c["name"], c["value"], c["wanted"])).collect();
    Ok((Report { input, trajectory, simulated: number("simulated_s")?, cpu: number("cpu_s")? }, failed))
}

/// Times the release build.
pub fn bench(tally: &mut Tally, args: &[String]) {
    if let Some(sutura) = build(tally, Profile::Release) {
        tally.run("bench", sutura.command().arg("bench").args(args));
    }
}

/// Runs the main job and takes its last near picture for the README.
pub fn bless_picture(tally: &mut Tally) {
    let Some(sutura) = build(tally, Profile::Release) else { return };
    let out = target().join("scenes/square_knot-picture");
    let mut run = sutura.command();
    run.args(["run", "scenes/square_knot.toml", "--no-plots", "--no-trajectory", "--record", "--out"]).arg(&out);
    if !tally.run("square knot", &mut run) {
        return;
    }
    let picture = root().join("docs/images/square_knot.png");
    tally.count("picture", take_last_near_picture(&out.join("stills"), &picture));
    println!("   {}", picture.display());
}

/// Pictures are named by their time, with leading zeros; those of the knot alone end in `-near`.
fn take_last_near_picture(stills: &Path, picture: &Path) -> Result<(), String> {
    let entries = std::fs::read_dir(stills).map_err(|e| format!("{}: {e}", stills.display()))?;
    let near = entries.filter_map(|e| e.ok().map(|e| e.path())).filter(|p| p.to_string_lossy().ends_with("-near.png"));
    let last = near.max().ok_or_else(|| format!("no picture of a knot in {}", stills.display()))?;
    if let Some(folder) = picture.parent() {
        std::fs::create_dir_all(folder).map_err(|e| e.to_string())?;
    }
    std::fs::copy(&last, picture).map(|_| ()).map_err(|e| format!("{}: {e}", picture.display()))
}
