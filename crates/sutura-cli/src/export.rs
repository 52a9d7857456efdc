//! The command `sutura export`: scenes and recordings as files that other programs open.

use crate::args::{Axis, Export, ExportFormat};
use crate::{run, say};
use anyhow::{Context as _, bail};
use indicatif::{ProgressBar, ProgressStyle};
use std::path::{Path, PathBuf};
use sutura::glam::DVec3;
use sutura_scene::export::{Exporter, Format, Moment, Options, Written};
use sutura_scene::{Runner, Trajectory};

/// What is exported.
enum Source {
    Recording(Box<Trajectory>),
    Scene(Box<Runner>),
}

/// Runs the command.
pub fn export(args: &Export) -> anyhow::Result<()> {
    let source = read(args)?;
    let header = match &source {
        Source::Recording(t) => t.header.clone(),
        Source::Scene(r) => r.header(),
    };
    let by_name = args.out.as_deref().and_then(Format::of);
    let format = match (args.format, by_name) {
        (Some(format), _) => format.into(),
        (None, Some(format)) => format,
        (None, None) => bail!(
            "which format? Give `--format glb` (or vtk, obj, csv), or a file name that says it: `--out {}.glb`",
            header.scene
        ),
    };
    let out = args.out.clone().unwrap_or_else(|| default_out(&header.scene, format));
    let up = match args.up {
        Axis::X => DVec3::X,
        Axis::Y => DVec3::Y,
        Axis::Z => DVec3::Z,
    };
    let options = Options {
        rate: args.fps,
        from: args.from,
        to: args.to.unwrap_or(f64::INFINITY),
        sides: args.sides.into(),
        rings: args.rings.into(),
        up,
    };
    let mut exporter = Exporter::new(format, &header, &out, options)?;
    let written = match source {
        Source::Recording(t) => {
            let bar = bar(args.quiet, t.frames.len() as u64);
            for frame in &t.frames {
                if exporter.wants(frame.time) {
                    exporter.add(&Moment::of_frame(frame))?;
                }
                bar.inc(1);
            }
            bar.finish_and_clear();
            exporter.finish()?
        }
        Source::Scene(runner) => simulate(*runner, exporter, args.quiet, options.to)?,
    };
    if !args.quiet {
        say(&format!("{} frames, {}, in {}", written.moments, megabytes(written.bytes), out.display()))?;
    }
    Ok(())
}

/// A recording, by its first bytes, or else a scene.
fn read(args: &Export) -> anyhow::Result<Source> {
    let path = Path::new(&args.source);
    if path.is_file() {
        let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
        if bytes.starts_with(b"SUTURATR") {
            if !args.settings.is_empty() {
                bail!("{}: a recording, in which nothing can be set; --set is for scenes", path.display());
            }
            let trajectory = Trajectory::from_bytes(&bytes).with_context(|| path.display().to_string())?;
            return Ok(Source::Recording(Box::new(trajectory)));
        }
        if bytes.starts_with(b"SUTURA") {
            bail!("{}: no recording of positions; `sutura run` writes one as trajectory.sutura", path.display());
        }
    }
    Ok(Source::Scene(Box::new(Runner::new(run::load(&args.source, &args.settings)?)?)))
}

fn simulate(mut runner: Runner, mut exporter: Exporter, quiet: bool, to: f64) -> anyhow::Result<Written> {
    let bar = bar(quiet, 1000);
    let mut finished = false;
    loop {
        if exporter.wants(runner.time()) {
            exporter.follow(&runner);
            exporter.add(&Moment::of_runner(&runner))?;
        }
        if finished || runner.time() >= to {
            break;
        }
        let progress = runner.step_frame();
        finished = progress.finished;
        bar.set_message(format!("{}  {:.2} s", progress.phase, progress.time));
        bar.set_position((progress.fraction.clamp(0.0, 1.0) * 1000.0) as u64);
    }
    bar.finish_and_clear();
    Ok(exporter.finish()?)
}

fn bar(quiet: bool, length: u64) -> ProgressBar {
    let bar = if quiet { ProgressBar::hidden() } else { ProgressBar::new(length) };
    // The template is a constant; a default bar would do as well.
    if let Ok(style) = ProgressStyle::with_template("{bar:30.blue/white} {percent:>3} %  {msg}") {
        bar.set_style(style.progress_chars("━━─"));
    }
    bar
}

fn default_out(scene: &str, format: Format) -> PathBuf {
    let folder = Path::new("out").join(scene);
    match format {
        Format::Glb => folder.join(format!("{scene}.glb")),
        Format::Vtk => folder.join("vtk"),
        Format::Obj => folder.join("obj"),
        Format::Csv => folder.join(format!("{scene}.csv")),
    }
}

fn megabytes(bytes: u64) -> String {
    if bytes < 1_000_000 { format!("{:.0} kB", bytes as f64 * 1e-3) } else { format!("{:.1} MB", bytes as f64 * 1e-6) }
}

impl From<ExportFormat> for Format {
    fn from(f: ExportFormat) -> Self {
        match f {
            ExportFormat::Glb => Format::Glb,
            ExportFormat::Vtk => Format::Vtk,
            ExportFormat::Obj => Format::Obj,
            ExportFormat::Csv => Format::Csv,
        }
    }
}
