//! The command `sutura validate`: runs the cases of `sutura-validate`, writes tables and plots.

use crate::args::Validate;
use crate::plot::{Figure, Line};
use crate::{say, table};
use anyhow::{Context as _, bail};
use indicatif::{ProgressBar, ProgressStyle};
use std::path::Path;
use sutura_validate::{Plot, Section, SectionResult};

/// Runs the command; false when a quantity missed its bar.
pub fn validate(args: &Validate) -> anyhow::Result<bool> {
    let sections = chosen(args)?;
    if args.list {
        return say(&list(&sections)).map(|()| true);
    }
    if !args.dry {
        // Before the work, so that a folder that cannot be written is found at once.
        let folder = args.out.join("validation");
        std::fs::create_dir_all(&folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
    }
    let results = simulate(&sections, args);
    if !args.dry {
        write(&results, &args.out)?;
    }
    let rows = || results.iter().flat_map(SectionResult::rows);
    let failed = rows().filter(|(_, r)| !r.passed).count();
    if failed > 0 {
        say(&failures(&results))?;
    }
    say(&format!("{} of {} quantities are within their bars.", rows().count() - failed, rows().count()))?;
    if !args.dry {
        say(&format!("The tables are in {}", args.out.join("validation.md").display()))?;
    }
    Ok(failed == 0)
}

/// The sections with the cases that are asked for.
fn chosen(args: &Validate) -> anyhow::Result<Vec<Section>> {
    let mut sections = sutura_validate::sections();
    for wanted in &args.cases {
        let known = match wanted.parse::<u32>() {
            Ok(number) => sections.iter().any(|s| s.number == number),
            Err(_) => sections.iter().any(|s| s.studies.iter().any(|c| c.name.contains(wanted.as_str()))),
        };
        if !known {
            bail!("no section and no case is called `{wanted}`; `sutura validate --list` lists them");
        }
    }
    for section in &mut sections {
        let number = section.number;
        let wanted = |name: &str| {
            args.cases.iter().any(|w| w.parse::<u32>().map_or_else(|_| name.contains(w.as_str()), |n| n == number))
        };
        section.studies.retain(|c| (args.cases.is_empty() || wanted(&c.name)) && (!args.quick || c.quick));
    }
    sections.retain(|s| !s.studies.is_empty());
    Ok(sections)
}

fn list(sections: &[Section]) -> String {
    let mut t = table(&["section", "case", "scene", "runs", "quantities"], &[0, 3, 4]);
    for section in sections {
        for c in &section.studies {
            t.add_row([
                section.number.to_string(),
                c.name.clone(),
                c.scene.into(),
                c.levels.len().to_string(),
                c.quantities.len().to_string(),
            ]);
        }
    }
    t.to_string()
}

/// Runs under a progress bar.
fn simulate(sections: &[Section], args: &Validate) -> Vec<SectionResult> {
    let jobs = args.jobs.map_or_else(|| std::thread::available_parallelism().map_or(1, usize::from), usize::from);
    let total: usize = sections.iter().flat_map(|s| &s.studies).map(|c| c.levels.len()).sum();
    let bar = if args.verbose { ProgressBar::hidden() } else { ProgressBar::new(total as u64) };
    // The template is a constant; a default bar would do as well.
    if let Ok(style) = ProgressStyle::with_template("{bar:30.blue/white} {pos} of {len}  {msg}") {
        bar.set_style(style.progress_chars("━━─"));
    }
    let results = sutura_validate::run(sections, jobs, &|p| {
        bar.set_message(p.name.clone());
        bar.set_position(p.done as u64);
        if args.verbose {
            eprintln!("{:>4} of {total}  {:>7.2} s  {}", p.done, p.seconds, p.name);
        }
    });
    bar.finish_and_clear();
    results
}

fn write(results: &[SectionResult], out: &Path) -> anyhow::Result<()> {
    let put = |path: &Path, text: &str| crate::output::put(path, text.as_bytes());
    let folder = out.join("validation");
    put(&out.join("validation.md"), &sutura_validate::markdown(results, "validation"))?;
    put(&folder.join("results.csv"), &sutura_validate::csv(results))?;
    put(&folder.join("results.json"), &serde_json::to_string_pretty(results)?)?;
    for plot in results.iter().flat_map(|s| &s.plots) {
        let figure = figure(plot);
        if !figure.is_empty() {
            figure.write_svg(&folder.join(plot.file))?;
        }
    }
    Ok(())
}

fn figure(plot: &Plot) -> Figure {
    let own = |(name, unit): (&str, &str)| (name.to_string(), unit.to_string());
    Figure {
        title: plot.title.clone(),
        x: own(plot.x),
        y: own(plot.y),
        lines: plot
            .curves
            .iter()
            .map(|c| Line { name: c.name.clone(), points: c.points.clone(), dots: c.dots })
            .collect(),
        ..Figure::default()
    }
}

/// What missed its bar.
fn failures(results: &[SectionResult]) -> String {
    let mut out = String::new();
    for section in results {
        for (study, row) in section.rows().filter(|(_, row)| !row.passed) {
            let last = |values: &[f64]| values.last().map_or_else(|| "-".into(), |v| crate::plot::number(*v));
            let error = row
                .errors
                .last()
                .copied()
                .flatten()
                .map_or_else(String::new, |e| format!(", error {:.3} %", 100.0 * e));
            let order = row.order.map_or_else(String::new, |p| format!(", order {p:.2}"));
            let why = row.reason.as_ref().map_or_else(String::new, |r| format!(": {r}"));
            out.push_str(&format!(
                "MISSED {} {}, {}: {} for {}{error}{order} (bar {}){why}\n",
                section.number,
                study.name,
                row.quantity,
                last(&row.values),
                last(&row.references),
                row.bar
            ));
        }
    }
    out
}
