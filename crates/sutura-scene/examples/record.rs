//! Runs scene files and records what they do to their worlds, with the state hash after every step: `record FOLDER
//! SCENE...` writes `FOLDER/<scene>.input` for each. The whole check runs it in a build for other features of the
//! processor; `sutura replay` reads the files.

use std::path::Path;
use sutura_scene::{Runner, Scene};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let (folder, scenes) = args.split_first().ok_or("wanted a folder and scene files")?;
    std::fs::create_dir_all(folder)?;
    for path in scenes {
        let scene = Scene::load(Path::new(path))?;
        let file = Path::new(folder).join(format!("{}.input", scene.name()));
        let mut runner = Runner::recording(scene)?;
        while !runner.step_frame().finished {}
        let outcome = runner.finish();
        let input = outcome.input.ok_or("nothing was recorded")?;
        let report = outcome.report;
        println!(
            "{} {} {} in {:.1} s CPU",
            report.state_hash,
            report.scene,
            if report.passed { "passed" } else { "FAILED" },
            report.cpu_s
        );
        std::fs::write(file, input.to_bytes())?;
    }
    Ok(())
}
