//! Saved states as files that a scene starts from. As for recordings, with a checksum that fits too.

use crate::input::Input;
use crate::trajectory::{sealed, unsealed};
use std::path::PathBuf;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};
use sutura_scene::{Outcome, Runner, Scene};

static GOOD: OnceLock<Vec<u8>> = OnceLock::new();

pub fn run(data: &[u8]) {
    let good = GOOD.get_or_init(|| unsealed(outcome().saved[0].bytes.clone()));
    let bytes = Input::new(data).changed(good);
    start_from(&bytes);
    start_from(&sealed(bytes));
}

/// What the scene leaves behind.
pub fn outcome() -> Outcome {
    let scene = Scene::parse(SCENE, "fuzzed.toml").unwrap_or_else(|e| panic!("{e}"));
    let mut runner = Runner::new(scene).unwrap_or_else(|e| panic!("{e}"));
    while !runner.step_frame().finished {}
    runner.finish()
}

/// Saves a state, and goes on from it with the line `start = ".."` in front.
const SCENE: &str = r#"
frame_rate = 240
[solver]
halvings = 2
[[thread]]
name = "silk"
radius = "0.1 mm"
young_modulus = "2 GPa"
density = "1000 kg/m^3"
elements = 6
line = { from = [0, 0, 0], to = [0.02, 0, 0] }
[[shape]]
name = "post"
kind = "sphere"
radius = "5 mm"
position = "[10, 0, -5.1] mm"
[[grip]]
name = "left"
at = "start"
[[load]]
name = "weight"
at = "end"
mass = "1 mg"
[[phase]]
name = "run"
duration = "8 ms"
save = "state"
"#;

/// A file that goes away again.
struct TemporaryFile(PathBuf);

impl Drop for TemporaryFile {
    fn drop(&mut self) {
        // What cannot be removed is left to the system, which clears its folder of temporary files.
        let _ = std::fs::remove_file(&self.0);
    }
}

fn start_from(bytes: &[u8]) {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let name = format!("sutura-fuzz-{}-{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
    let file = TemporaryFile(std::env::temp_dir().join(name));
    std::fs::write(&file.0, bytes).unwrap_or_else(|e| panic!("{}: {e}", file.0.display()));
    // A TOML text in single quotes takes any path without one.
    let text = format!("start = '{}'\n{SCENE}", file.0.display());
    if let Ok(scene) = Scene::parse(&text, "fuzzed.toml") {
        crate::scene::play(scene);
    }
}
