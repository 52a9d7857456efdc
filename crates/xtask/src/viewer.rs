//! Checks what is seen: the plugin for Bevy and the viewer, which are a workspace of their own.

use crate::tally::{Tally, cargo, root, target};
use std::process::{Command, Stdio};
use std::time::Duration;

/// The whole of it.
pub fn check(tally: &mut Tally) {
    const MANIFEST: [&str; 2] = ["--manifest-path", "bevy/Cargo.toml"];
    tally.run("viewer: format", cargo(&["fmt", "--check", "--all"]).args(MANIFEST));
    // Only here is a display or a driver missing that another system has anyway.
    if cfg!(target_os = "linux")
        && !tally.run(
            "viewer: set-up",
            Command::new("bash").arg("scripts/viewer_setup.sh").current_dir(root()).stdin(Stdio::null()),
        )
    {
        return;
    }
    let folder = target().join("bevy");
    let within = |command: &str| {
        let mut command = cargo(&[command, "--workspace"]);
        command.args(MANIFEST).arg("--target-dir").arg(&folder);
        command
    };
    tally.run("viewer: lints", within("clippy").args(["--all-targets", "--", "--deny", "warnings"]));
    // The example game is built with the tests, and the pictures of the sample scenes are drawn and looked at by them.
    tally.run_tests("viewer: tests and pictures", within("test").arg("--no-fail-fast"));
    tally.run(
        "viewer: documentation",
        within("doc").args(["--lib", "--no-deps"]).env("RUSTDOCFLAGS", "--deny warnings"),
    );

    let program = folder.join("debug").join(format!("sutura-view{}", std::env::consts::EXE_SUFFIX));
    let picture = folder.join("viewer.png");
    let _ = std::fs::remove_file(&picture);
    let mut draw = Command::new(&program);
    draw.args(["--headless", "--at", "0.1", "--size", "320x180", "capstan", "--screenshot"]).arg(&picture);
    tally.run("viewer: a picture by the program", draw.stdin(Stdio::null()));
    let bytes = std::fs::read(&picture).unwrap_or_default();
    let size = (320u32.to_be_bytes(), 180u32.to_be_bytes());
    let good = bytes.starts_with(b"\x89PNG") && bytes.get(16..24) == Some(&[size.0, size.1].concat()[..]);
    tally.count(
        "viewer: the picture is a PNG of its size",
        if good { Ok(()) } else { Err(format!("{} bytes", bytes.len())) },
    );

    if cfg!(target_os = "linux") {
        window(tally, &program);
    }
}

/// Opens the window on a display without a screen and lets it try itself: time, panels, files, keys, mouse; it closes
/// itself.
fn window(tally: &mut Tally, program: &std::path::Path) {
    println!("\n== viewer: window");
    let mut command = Command::new("xvfb-run");
    command
        .args(["--auto-servernum", "--server-args=-screen 0 1024x640x24"])
        .arg(program)
        .args(["--size", "480x320", "--try", "catenary"]);
    let result = crate::tally::status_within(command.stdin(Stdio::null()), Duration::from_secs(600));
    println!("   viewer: window: {}", if result.is_ok() { "passed" } else { "failed" });
    tally.count("viewer: window tries itself", result);
}
