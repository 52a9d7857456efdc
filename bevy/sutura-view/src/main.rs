//! `sutura-view`: shows scenes and recordings of surgical thread, in a window or as pictures.

use anyhow::Context as _;
use bevy::app::AppExit;
use clap::Parser;
use std::path::Path;
use std::process::ExitCode;
use sutura_view::{Args, Studio, window};

fn main() -> ExitCode {
    let args = Args::parse();
    if !args.headless {
        return match window(&args) {
            AppExit::Success => ExitCode::SUCCESS,
            AppExit::Error(code) => ExitCode::from(code.get()),
        };
    }
    match draw(&args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("error: {e:#}");
            ExitCode::from(2)
        }
    }
}

/// Pictures without a window.
fn draw(args: &Args) -> anyhow::Result<()> {
    if args.screenshot.is_none() && args.frames.is_none() {
        anyhow::bail!("--headless draws pictures: say which with --screenshot FILE or --frames FOLDER");
    }
    anyhow::ensure!(args.at.is_finite() && args.at >= 0.0, "--at: a time of 0 or more seconds");
    anyhow::ensure!(args.every.is_finite() && args.every > 0.0, "--every: a time of more than 0 seconds");
    let mut studio = Studio::new(args.size);
    studio.open(&args.scene).map_err(anyhow::Error::msg)?;
    studio.tension(args.tension);
    studio.least_width(args.least_width);
    let put = |studio: &mut Studio, path: &Path| -> anyhow::Result<()> {
        let picture = studio.draw().map_err(anyhow::Error::msg)?;
        if let Some(folder) = path.parent().filter(|f| !f.as_os_str().is_empty()) {
            std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
        }
        picture.write(path).with_context(|| format!("cannot write {}", path.display()))
    };
    if let Some(folder) = &args.frames {
        let n = (args.at / args.every + 1e-9) as u32;
        for k in 0..=n {
            studio.go(f64::from(k) * args.every);
            if k == 0 {
                studio.frame(args.zoom, args.look_at);
            }
            put(&mut studio, &folder.join(format!("{k:05}.png")))?;
        }
    }
    if let Some(path) = &args.screenshot {
        studio.go(args.at);
        studio.frame(args.zoom, args.look_at);
        put(&mut studio, path)?;
    }
    Ok(())
}
