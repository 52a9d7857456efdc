//! The command `sutura knot-strength`: at what force knots slip, come undone or break, over friction, throws and
//! pretension.

use crate::args::KnotStrength;
use crate::plot::{Figure, Line, number};
use crate::{say, table};
use anyhow::{Context as _, anyhow};
use indicatif::{ProgressBar, ProgressStyle};
use sutura::{Material, Plasticity, Shear};
use sutura_scene::presets;
use sutura_studies::case::Budget;
use sutura_studies::strength::{self, Case, Ended, Found, Throws};
use sutura_studies::table::replace;

/// Name of the files.
const STEM: &str = "knot_strength";
/// Frames after which a case is given up: ten times what one takes.
const FRAMES: u32 = 5000;

/// Runs the command.
pub fn knot_strength(args: &KnotStrength) -> anyhow::Result<()> {
    let cases = cases(args)?;
    if args.list {
        return say(&cases.iter().map(name).collect::<Vec<_>>().join("\n"));
    }
    // Before the work, so that a folder that cannot be written is found at once.
    std::fs::create_dir_all(&args.out).with_context(|| format!("cannot make the folder {}", args.out.display()))?;
    let found = simulate(&cases, args);
    let stem = args.out.join(STEM);
    strength::table(&cases, &found).write(&stem.with_extension("csv"))?;
    strength::pulls(&cases, &found).write(&args.out.join(format!("{STEM}_pulls.csv")))?;
    replace(&stem.with_extension("md"), strength::report(&cases, &found, &head(&cases, args), STEM).as_bytes())?;
    for (file, figure) in figures(&cases, &found) {
        if !figure.is_empty() {
            figure.write(&args.out.join(file))?;
        }
    }
    say(&summary(&cases, &found))?;
    say(&format!("Results are in {}", args.out.display()))
}

/// Every sequence of throws with every pretension and every friction, in this order.
fn cases(args: &KnotStrength) -> anyhow::Result<Vec<Case>> {
    let (size, preset) = (presets::find_size(&args.size)?, presets::find_material(&args.material)?);
    let diameter = args.diameter.unwrap_or(size.diameter.value);
    let strength = args.strength.or(presets::knot_pull(size, Some(preset)).map(|f| f.value));
    let strength = strength.with_context(|| {
        format!("no limit of knot-pull strength is known for {} of size {}; give --strength", preset.name, size.name)
    })?;
    let material = Material {
        young_modulus: args.modulus.unwrap_or(preset.young_modulus.value),
        shear: Shear::Poisson(preset.poisson_ratio.value),
        density: preset.density.value,
        bend_scale: args.bend_scale.unwrap_or(preset.bend_scale.value),
        bend_damping: strength::BEND_DAMPING,
        plasticity: args.plastic.then(|| strength::set(diameter)),
    };
    let mut all = Vec::new();
    for throws in &args.throws {
        let throws = Throws::parse(throws).map_err(|e| anyhow!(e))?;
        for &pretension in &args.pretension {
            all.extend(args.mu.iter().map(|&mu| Case {
                material: material.clone(),
                diameter,
                strength,
                throws: throws.clone(),
                mu,
                pretension,
                slip: args.slip,
            }));
        }
    }
    Ok(all)
}

fn name(case: &Case) -> String {
    format!("{}, drawn with {} N, mu {}", case.throws.name, case.pretension, case.mu)
}

/// Runs under a progress bar.
fn simulate(cases: &[Case], args: &KnotStrength) -> Vec<Found> {
    let threads = args.threads.map_or_else(|| std::thread::available_parallelism().map_or(1, usize::from), usize::from);
    let bar = if args.verbose { ProgressBar::hidden() } else { ProgressBar::new(cases.len() as u64) };
    // The template is a constant; a default bar would do as well.
    if let Ok(style) = ProgressStyle::with_template("{bar:30.blue/white} {pos} of {len}  {elapsed}  {msg}") {
        bar.set_style(style.progress_chars("━━─"));
    }
    bar.tick();
    let found = strength::run(cases, Budget { cpu_s: args.budget, frames: FRAMES }, threads, &|case, found| {
        let line = format!("{}: {}", name(case), found.ended.words());
        if args.verbose {
            eprintln!("{line} ({:.1} s)", found.cpu);
        }
        bar.set_message(line);
        bar.inc(1);
    });
    bar.finish_and_clear();
    found
}

/// What was tied, in words.
fn head(cases: &[Case], args: &KnotStrength) -> String {
    let Some(Case { material: m, diameter, strength, slip, .. }) = cases.first() else { return String::new() };
    let set = match &m.plasticity {
        Some(Plasticity { yield_curvature, hardening, .. }) => {
            format!("plastic set from a curvature of {} 1/m on (hardening {hardening})", number(*yield_curvature))
        }
        None => "no plastic set".into(),
    };
    let thread =
        if args.diameter.is_some() { args.material.clone() } else { format!("{} {}", args.size, args.material) };
    format!(
        "Written by `sutura knot-strength`, version {}. Thread: {thread}, diameter {} mm, modulus {} GPa, bending scale {}, {set}; knot-pull strength {} N \
         (the tension at which it counts as broken). A tail slips when {slip} diameters of it were drawn through. Forces are those on the loop, which two strands \
         carry.",
        env!("CARGO_PKG_VERSION"),
        number(1e3 * diameter),
        number(1e-9 * m.young_modulus),
        number(m.bend_scale),
        number(*strength)
    )
}

/// Forces over friction, one curve for each sequence of throws and pretension.
fn figures(cases: &[Case], found: &[Found]) -> Vec<(String, Figure)> {
    let figure = |title: &str, y: &str, of: &dyn Fn(&Found) -> f64| {
        let mut lines: Vec<Line> = Vec::new();
        for (case, f) in cases.iter().zip(found) {
            let name = format!("{}, {} N", case.throws.name, case.pretension);
            let value = match f.ended {
                Ended::NotFinished(_) => f64::NAN,
                _ => of(f),
            };
            match lines.iter_mut().find(|l| l.name == name) {
                Some(line) => line.points.push((case.mu, value)),
                None => lines.push(Line { name, points: vec![(case.mu, value)], dots: false }),
            }
        }
        for line in &mut lines {
            line.points.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        let marks =
            cases.first().map(|c| ("twice the knot-pull strength".to_string(), 2.0 * c.strength)).into_iter().collect();
        let (x, y) = (("friction of thread on thread".into(), String::new()), (y.to_string(), "N".to_string()));
        Figure { title: title.into(), x, y, lines, marks, ..Figure::default() }
    };
    vec![
        (STEM.into(), figure("Force on the loop until a tail slips", "force", &|f| f.held)),
        (
            format!("{STEM}_peak"),
            figure("Greatest force on the loop until it comes undone or breaks", "force", &|f| f.peak),
        ),
    ]
}

fn summary(cases: &[Case], found: &[Found]) -> String {
    let mut t = table(
        &["throws", "pretension [N]", "mu", "slips at [N]", "most [N]", "left in the loop [N]", "form", "ended"],
        &[1, 2, 3, 4, 5],
    );
    for (case, f) in cases.iter().zip(found) {
        t.add_row([
            case.throws.name.clone(),
            number(case.pretension),
            number(case.mu),
            if f.slipped.is_some() { format!("{:.2}", f.held) } else { "-".into() },
            format!("{:.2}", f.peak),
            f.loop_tension.map_or_else(|| "-".into(), |v| format!("{v:.4}")),
            f.form.map_or_else(|| "-".into(), |form| form.verdict.name().into()),
            f.ended.words(),
        ]);
    }
    let passes: usize = found.iter().map(|f| f.passes).sum();
    let audit = if passes == 0 {
        "Nothing passed through anything.".to_string()
    } else {
        format!("THINGS PASSED THROUGH EACH OTHER {passes} times.")
    };
    format!("{t}\n\n{audit}")
}
