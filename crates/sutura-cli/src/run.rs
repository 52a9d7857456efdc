//! The command `sutura run`: step a scene to its end, write what it left behind, and say how it went.

use crate::args::Run;
use crate::output::{Folder, REPORT};
use crate::plot::{Figure, Line, caption};
use crate::still::{self, Camera, Look, Size, Solid, Subject, Tube};
use crate::{say, scenes, table};
use anyhow::Context as _;
use indicatif::{ProgressBar, ProgressStyle};
use std::path::Path;
use std::time::{Duration, Instant};
use sutura::glam::{DQuat, DVec3};
use sutura::{Geometry, Pose};
use sutura_scene::{Frame, Header, KnotReport, Outcome, Report, Runner, Scene, Series};

impl Run {
    /// A built-in scene with everything left at its default.
    pub fn of_sample(name: &str) -> Run {
        Run { scene: name.into(), picture_size: (1200, 900), ..Run::default() }
    }
}

/// Runs the command; false when a check failed.
pub fn run(args: &Run) -> anyhow::Result<bool> {
    let scene = load(&args.scene, &args.settings)?;
    let folder = args.out.clone().unwrap_or_else(|| Path::new("out").join(scene.name()));
    let runner = if args.record { Runner::recording(scene.clone())? } else { Runner::new(scene.clone())? };
    let saves: Vec<String> = scene.saves().map(file_name).collect();
    // Before the work, so that a folder that cannot be written is found at once, and an earlier run cannot pass for
    // this one.
    let mut results = if args.dry { None } else { Some(Folder::open(&folder, scene.start(), &saves)?) };
    let outcome = simulate(runner, args.quiet);
    if let Some(results) = &mut results {
        write(&outcome, &scene, results, args)
            .with_context(|| format!("the results in {} are not complete, and there is no report", folder.display()))?;
    }
    if !args.quiet {
        say(&summary(&outcome.report))?;
        if !args.dry {
            say(&format!("Results are in {}", folder.display()))?;
        }
    }
    Ok(outcome.report.passed)
}

/// A scene file, or else a built-in scene of that name, with some of its values set from outside.
pub fn load(scene: &str, settings: &[(String, String)]) -> anyhow::Result<Scene> {
    let path = Path::new(scene);
    if path.is_file() {
        return Ok(Scene::load_with(path, settings)?);
    }
    if path.components().count() > 1 {
        anyhow::bail!("{scene}: there is no such file");
    }
    let sample = scenes::find(scene).with_context(|| format!("{scene}: there is no such file"))?;
    Ok(Scene::parse_with(sample.text, &format!("{}.toml", sample.name), settings)?)
}

/// Steps to the end under a progress bar.
pub fn simulate(mut runner: Runner, quiet: bool) -> Outcome {
    const LENGTH: u64 = 1000;
    let bar = if quiet { ProgressBar::hidden() } else { ProgressBar::new(LENGTH) };
    // The template is a constant; a default bar would do as well.
    if let Ok(style) = ProgressStyle::with_template("{bar:30.blue/white} {percent:>3} %  {msg}") {
        bar.set_style(style.progress_chars("━━─"));
    }
    for note in runner.notes() {
        bar.println(format!("note: {note}"));
    }
    for overlap in runner.overlaps() {
        bar.println(format!("{}: {}", if overlap.through { "error" } else { "warning" }, overlap.message));
    }
    let (mut solver_ms, mut drawn, mut warned) = (0.0, Instant::now(), 0);
    loop {
        let p = runner.step_frame();
        solver_ms += p.ms;
        for warning in &runner.warnings()[warned..] {
            bar.println(format!("warning at {:.4} s: {}", warning.time_s, warning.message));
            warned += 1;
        }
        if p.finished {
            break;
        }
        if drawn.elapsed() > Duration::from_millis(50) {
            drawn = Instant::now();
            let factor = if solver_ms > 0.0 { 1e3 * p.time / solver_ms } else { 0.0 };
            bar.set_message(format!("{}  {:.2} s  {factor:.1} x real time", p.phase, p.time));
            bar.set_position((p.fraction.clamp(0.0, 1.0) * LENGTH as f64) as u64);
        }
    }
    bar.finish_and_clear();
    runner.finish()
}

fn write(outcome: &Outcome, scene: &Scene, folder: &mut Folder, args: &Run) -> anyhow::Result<()> {
    for series in &outcome.series {
        folder.write(&format!("series/{}.csv", file_name(&series.name)), series.to_csv().as_bytes())?;
    }
    for state in &outcome.saved {
        folder.write(&file_name(&state.name), &state.bytes)?;
    }
    if let Some(input) = &outcome.input {
        folder.write("input.sutura", &input.to_bytes())?;
    }
    if !args.no_trajectory {
        folder.write("trajectory.sutura", &outcome.trajectory.to_bytes())?;
    }
    if !args.no_plots {
        for (name, figure) in figures(outcome) {
            for (ending, bytes) in figure.files()? {
                folder.write(&format!("plots/{name}.{ending}"), &bytes)?;
            }
        }
    }
    if !args.no_stills {
        draw_stills(outcome, scene, folder, args)?;
    }
    // Last: whoever finds it finds everything.
    folder.write(REPORT, &serde_json::to_vec_pretty(&outcome.report)?)
}

/// A name as a file name on any system, and in this folder.
fn file_name(name: &str) -> String {
    let kept: String = name.chars().map(|c| if c.is_alphanumeric() || "_-.+".contains(c) { c } else { '_' }).collect();
    kept.trim_matches(['.', '_']).to_string()
}

/// The plots of a run with their file names: from the series `frame` the numbers of every frame, and each probe.
fn figures(outcome: &Outcome) -> Vec<(String, Figure)> {
    let spans: Vec<(String, f64, f64)> =
        outcome.report.phases.iter().map(|p| (p.name.clone(), p.start_s, p.end_s)).collect();
    let mut all: Vec<(String, Figure)> = Vec::new();
    for series in &outcome.series {
        // Columns of one unit share a picture; those of a frame are grouped by what they mean.
        for (group, figure) in grouped(series) {
            let over_time = series.columns.first().is_some_and(|c| c.0 == "time");
            let figure = Figure { spans: if over_time { spans.clone() } else { Vec::new() }, ..figure };
            if !figure.is_empty() {
                all.push((file_name(&group), figure));
            }
        }
    }
    all
}

/// Columns of the series `frame` that share a picture: file name, title, ordinate, logarithmic or not, the columns.
const FRAME_PLOTS: [(&str, &str, &str, bool, &[&str]); 6] = [
    ("tension", "Largest tension", "tension", false, &["max_tension"]),
    ("elongation", "Largest elongation of an element", "|elongation|", true, &["max_elongation"]),
    (
        "clearance",
        "Closest gap: (distance - radii) / thread diameter",
        "clearance",
        false,
        &["thread_clearance", "shape_clearance"],
    ),
    ("energy", "Mechanical energy", "energy", false, &["energy", "kinetic", "stretch", "bend", "twist", "gravity"]),
    ("ms_per_frame", "Solver time of a frame", "time", true, &["ms"]),
    ("work", "Work of the solver in a frame", "number", false, &["substeps", "rejected", "newton", "contacts"]),
];

fn grouped(series: &Series) -> Vec<(String, Figure)> {
    let Some((x_name, x_unit)) = series.columns.first() else { return Vec::new() };
    let x: Vec<f64> = series.rows.iter().map(|r| r[0]).collect();
    let line = |c: usize, name: &str| Line {
        name: name.into(),
        points: x.iter().copied().zip(series.rows.iter().map(|r| r[c])).collect(),
        dots: false,
    };
    let figure = |title: &str, y: (&str, &str), log: bool, lines: Vec<Line>| Figure {
        title: title.into(),
        x: (x_name.clone(), x_unit.clone()),
        y: (y.0.into(), y.1.into()),
        lines,
        log,
        ..Figure::default()
    };
    let mut out = Vec::new();
    if series.name == "frame" {
        for (file, title, y_name, log, names) in FRAME_PLOTS {
            let columns: Vec<usize> =
                names.iter().filter_map(|name| series.columns.iter().position(|c| c.0 == **name)).collect();
            let Some(&first) = columns.first() else { continue };
            let lines = columns.iter().map(|&c| line(c, &series.columns[c].0.replace('_', " "))).collect();
            out.push((file.to_string(), figure(title, (y_name, &series.columns[first].1), log, lines)));
        }
        return out;
    }
    let mut units: Vec<&String> = Vec::new();
    for (_, unit) in &series.columns[1..] {
        if !units.contains(&unit) {
            units.push(unit);
        }
    }
    for unit in &units {
        let columns: Vec<usize> = (1..series.columns.len()).filter(|c| series.columns[*c].1 == **unit).collect();
        let first = &series.columns[columns[0]].0;
        let name = if units.len() == 1 { series.name.clone() } else { format!("{}-{first}", series.name) };
        let y_name = if columns.len() == 1 { first.as_str() } else { series.name.as_str() };
        let lines = columns.iter().map(|c| line(*c, &series.columns[*c].0)).collect();
        out.push((format!("probe-{name}"), figure(&series.name, (y_name, unit), false, lines)));
    }
    out
}

/// What a recorded frame shows.
fn subject(header: &Header, frame: &Frame) -> Subject {
    let point = |p: &[f32; 3]| DVec3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]));
    let tubes = header
        .threads
        .iter()
        .zip(&frame.positions)
        .map(|(t, x)| Tube { points: x.iter().map(point).collect(), radius: t.radius })
        .collect();
    let solids = header.shapes.iter().zip(&frame.shapes).map(|(shape, (x, q))| {
        let orientation = DQuat::from_array(q.map(f64::from)).normalize();
        Solid { geometry: Geometry::from(&shape.outline), pose: Pose::new(point(x), orientation) }
    });
    Subject { tubes, solids: solids.collect() }
}

/// What a picture of all has to show: the threads, and where there are none what has an end of the shapes.
fn places(subject: &Subject) -> Vec<DVec3> {
    if !subject.tubes.is_empty() {
        return subject.tubes.iter().flat_map(|t| t.points.iter().copied()).collect();
    }
    let corners = |solid: &Solid| {
        let mesh = sutura::skin::shape_mesh(&solid.geometry, 8, 0.0);
        let pose = solid.pose;
        mesh.positions.into_iter().map(move |p| pose.transform_point(DVec3::from(p.map(f64::from))))
    };
    subject.solids.iter().filter(|s| s.geometry != Geometry::Plane).flat_map(corners).collect()
}

/// Two pictures at each time: all of the threads, and the knot from near.
fn draw_stills(outcome: &Outcome, scene: &Scene, folder: &mut Folder, args: &Run) -> anyhow::Result<()> {
    let trajectory = &outcome.trajectory;
    let (Some(first), Some(last)) = (trajectory.frames.first(), trajectory.frames.last()) else { return Ok(()) };
    let of_phases: Vec<f64> = outcome.report.phases.iter().filter(|p| p.still).map(|p| p.end_s).collect();
    let times = match (&args.stills[..], scene.stills(), &of_phases[..]) {
        // A scene that names no times stands with the end alone.
        ([], [] | [f64::INFINITY], []) => vec![first.time, 0.5 * (first.time + last.time), last.time],
        ([], times, phases) => [times, phases].concat(),
        (times, _, _) => times.to_vec(),
    };
    let size = Size { width: args.picture_size.0, height: args.picture_size.1 };
    let camera = scene.camera();
    let up = camera
        .map_or_else(|| (-DVec3::from(outcome.report.solver.gravity)).try_normalize().unwrap_or(DVec3::Z), |c| c.up);
    // One direction for all pictures of a run, from which the last one shows its knot well.
    let at_end = subject(&trajectory.header, last);
    let chosen = args.look.map(DVec3::from).or(camera.map(|c| -c.from));
    let direction = chosen.unwrap_or_else(|| {
        let near = still::knot_region(&at_end.tubes);
        let seen = if near.is_empty() { places(&at_end) } else { near };
        still::best_direction(&at_end, &seen, up)
    });

    let mut drawn: Vec<String> = Vec::new();
    for time in times {
        let Some(frame) = trajectory.nearest(time.min(last.time)) else { continue };
        let moment = format!("{:08.4}s", frame.time);
        if drawn.contains(&moment) {
            continue;
        }
        let subject = subject(&trajectory.header, frame);
        let radius = subject.tubes.iter().map(|t| t.radius).fold(0.0, f64::max);
        let all = places(&subject);
        let near = still::knot_region(&subject.tubes);
        let whole = Look { direction: Some(direction), up: Some(up), ..Look::default() };
        let chosen = Look { at: camera.and_then(|c| c.look_at), width: camera.and_then(|c| c.width), ..whole.clone() };
        for (name, look, points, margin) in [("", chosen, &all, 4.0), ("-near", whole, &near, 10.0)] {
            if points.is_empty() {
                continue;
            }
            let camera = Camera::fit(&look, points, margin * radius, size);
            let mut image = still::render(&subject, &camera, size);
            caption(&mut image, &format!("{}, {:.3} s", scene.title(), frame.time), camera.width())?;
            folder.write(&format!("stills/{moment}{name}.png"), &image.to_png()?)?;
        }
        drawn.push(moment);
    }
    Ok(())
}

/// The tables printed at the end.
fn summary(r: &Report) -> String {
    let mut out = format!("{}\n\n", r.title);
    let mut run = table(&["run", ""], &[]);
    let gap = |g: Option<f64>| g.map_or_else(|| "nothing came near".into(), |g| format!("{g:.4}"));
    let truth = |b: Option<bool>| b.map_or("not audited", |b| if b { "YES" } else { "no" });
    let missed =
        if r.not_simulated_s > 0.0 { format!("; {:.3} s passed without", r.not_simulated_s) } else { String::new() };
    run.add_row(["simulated".to_string(), format!("{:.3} s in {} frames{missed}", r.simulated_s, r.frames)]);
    run.add_row(["solver".to_string(), format!("{:.3} s CPU", r.cpu_s)]);
    run.add_row([
        "real-time factor".to_string(),
        format!("{:.2}, worst second {:.2}", r.real_time_factor, r.worst_second_real_time_factor),
    ]);
    let t = &r.ms_per_frame;
    run.add_row(["ms per frame".to_string(), format!("median {:.3}, p99 {:.3}, most {:.3}", t.median, t.p99, t.max)]);
    let c = &r.min_clearance;
    run.add_row([
        "least clearance [diameters]".to_string(),
        format!("thread-thread {}, thread-shape {}", gap(c.thread_thread), gap(c.thread_shape)),
    ]);
    run.add_row(["passes through".to_string(), truth(r.passes_through).to_string()]);
    run.add_row(["state hash".to_string(), r.state_hash.clone()]);
    out.push_str(&format!("{run}\n\n"));

    let mut threads = table(
        &["thread", "elements", "length [mm]", "radius [mm]", "max elongation", "max tension [N]", "knot"],
        &[1, 2, 3, 4, 5],
    );
    for t in &r.threads {
        let knot = t.knot.as_ref().map_or_else(
            || "-".into(),
            |k| format!("{}{} (det {}, sig {}, {}/{})", k.knot, form(k), k.determinant, k.signature, k.agreed, k.tried),
        );
        threads.add_row([
            t.name.clone(),
            t.elements.to_string(),
            format!("{:.2}", 1e3 * t.length_m),
            format!("{:.4}", 1e3 * t.radius_m),
            format!("{:.2e}", t.max_elongation),
            short(t.max_tension_n),
            knot,
        ]);
    }
    if !r.threads.is_empty() {
        out.push_str(&format!("{threads}\n\n"));
    }
    let mut phases = table(&["phase", "from [s]", "to [s]", "ended by", "knots"], &[1, 2]);
    for p in &r.phases {
        let knots: Vec<String> = p.knots.iter().map(|(thread, k)| format!("{thread}: {}{}", k.knot, form(k))).collect();
        phases.add_row([
            p.name.clone(),
            format!("{:.3}", p.start_s),
            format!("{:.3}", p.end_s),
            p.ended_by.clone(),
            knots.join(", "),
        ]);
    }
    if !r.phases.is_empty() {
        out.push_str(&format!("{phases}\n\n"));
    }
    let mut probes = table(&["probe", "unit", "first", "last", "least", "greatest"], &[2, 3, 4, 5]);
    for p in &r.probes {
        probes.add_row([p.name.clone(), p.unit.clone(), short(p.first), short(p.last), short(p.min), short(p.max)]);
    }
    if !r.probes.is_empty() {
        out.push_str(&format!("{probes}\n\n"));
    }
    let mut checks = table(&["check", "found", "unit", "wanted", "result"], &[1]);
    for c in &r.checks {
        let found = c.value.as_ref().map_or_else(|| "never reached".into(), ToString::to_string);
        checks.add_row([
            c.name.clone(),
            found,
            c.unit.clone(),
            c.wanted.clone(),
            if c.passed { "passed" } else { "FAILED" }.into(),
        ]);
    }
    if !r.checks.is_empty() {
        out.push_str(&format!("{checks}\n\n"));
    }
    for note in &r.notes {
        out.push_str(&format!("note: {note}\n"));
    }
    for w in &r.warnings {
        out.push_str(&format!("warning at {:.4} s: {}\n", w.time_s, w.message));
    }
    for i in &r.incidents {
        let last = if i.count > 1 { format!(" to {:.4} s, {} times", i.last_s, i.count) } else { String::new() };
        out.push_str(&format!("incident at {:.4} s{last}: {}\n", i.first_s, i.message));
    }
    for passage in &r.passages {
        out.push_str(&format!("passed through: {passage}\n"));
    }
    let failed = r.checks.iter().filter(|c| !c.passed).count();
    let verdict = match (r.passed, failed) {
        (true, _) if r.checks.is_empty() => "No checks in this scene.".to_string(),
        (true, _) => format!("All {} checks passed.", r.checks.len()),
        (false, 0) if !r.failures.is_empty() => format!("FAILED: {}.", r.failures.join("; ")),
        (false, 0) => {
            let last = r.phases.last().map_or_else(String::new, |p| format!(" in phase `{}`: {}", p.name, p.ended_by));
            format!("FAILED{last}.")
        }
        (false, n) => format!(
            "FAILED: {}.",
            [vec![format!("{n} of {} checks", r.checks.len())], r.failures.clone()].concat().join("; ")
        ),
    };
    out.push_str(&verdict);
    out.push('\n');
    out
}

/// How a knot lies, after its name.
fn form(knot: &KnotReport) -> String {
    knot.form.as_ref().map_or_else(String::new, |f| format!(", {} ({:.2})", f.verdict, f.share))
}

/// Five digits after the point, or an exponent where these would not do.
fn short(v: f64) -> String {
    if v == 0.0 || (1e-3..1e5).contains(&v.abs()) { format!("{v:.5}") } else { format!("{v:.3e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn file_names_stay_in_the_folder() {
        assert_eq!(file_name("tension(left)"), "tension_left");
        assert_eq!(file_name("../../etc/passwd"), "etc_passwd");
        assert_eq!(file_name("tied.state"), "tied.state");
    }

    #[test]
    fn columns_of_one_unit_share_a_picture() {
        let columns = [("time", "s"), ("x", "m"), ("y", "m"), ("force", "N")]
            .map(|(n, u)| (n.to_string(), u.to_string()))
            .to_vec();
        let series =
            Series { name: "end".into(), columns, rows: vec![vec![0.0, 1.0, 2.0, 3.0], vec![1.0, 2.0, 3.0, 4.0]] };
        let names: Vec<(String, usize)> = grouped(&series).into_iter().map(|(n, f)| (n, f.lines.len())).collect();
        assert_eq!(names, [("probe-end-x".to_string(), 2), ("probe-end-force".to_string(), 1)]);
    }
}
