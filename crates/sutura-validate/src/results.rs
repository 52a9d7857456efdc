//! What was found, judged; its tables and pictures.

use crate::study::{Bar, LeftOut, Quantity, Section, Study};
use serde::Serialize;
use std::fmt::Write as _;

/// A section with its results.
#[derive(Debug, Clone, Serialize)]
pub struct SectionResult {
    /// Its number.
    pub number: u32,
    /// What it is about.
    pub title: &'static str,
    /// What is set up and compared.
    pub intro: &'static str,
    /// Its studies.
    pub studies: Vec<StudyResult>,
    /// Pictures of them.
    #[serde(skip)]
    pub plots: Vec<Plot>,
    /// What is not run: what and why.
    pub left_out: Vec<(&'static str, &'static str)>,
}

/// A study with its results.
#[derive(Debug, Clone, Serialize)]
pub struct StudyResult {
    /// Its name.
    pub name: String,
    /// Its scene in `scenes/validation/`.
    pub scene: &'static str,
    /// One row a quantity.
    pub rows: Vec<Row>,
    /// What was kept of the last run for plots.
    #[serde(skip)]
    pub curve: Vec<(f64, f64)>,
}

/// A quantity with what was found.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// What it is.
    pub quantity: String,
    /// Where the reference comes from.
    pub source: &'static str,
    /// What was varied.
    pub levels: Vec<String>,
    /// References, one a run.
    pub references: Vec<f64>,
    /// Values found, one a run.
    pub values: Vec<f64>,
    /// Errors over their scale, one a run; `None` where there is no reference.
    pub errors: Vec<Option<f64>>,
    /// Order of convergence of the last runs; `None` where there is none, or the differences are rounding.
    pub order: Option<f64>,
    /// What was asked for.
    pub bar: String,
    /// Whether it was met.
    pub passed: bool,
    /// Why it was not, where that is known.
    pub reason: Option<String>,
}

/// A picture of curves.
#[derive(Debug, Clone)]
pub struct Plot {
    /// File name without ending.
    pub file: &'static str,
    /// Above the picture.
    pub title: String,
    /// Name and unit of the abscissa.
    pub x: (&'static str, &'static str),
    /// Name and unit of the ordinate.
    pub y: (&'static str, &'static str),
    /// What is drawn.
    pub curves: Vec<Curve>,
}

/// A curve of a plot.
#[derive(Debug, Clone)]
pub struct Curve {
    /// Name in the legend.
    pub name: String,
    /// Points in order of the abscissa.
    pub points: Vec<(f64, f64)>,
    /// Whether points are drawn instead of a line: what was measured, against a line that is the reference.
    pub dots: bool,
}

/// Differences under this are those of rounding and of the settling of a run: they have no order.
const ROUNDING: f64 = 1e-6;

impl SectionResult {
    pub(crate) fn new(section: &Section, studies: Vec<StudyResult>) -> SectionResult {
        let plots = (section.plots)(&studies);
        let left_out = section.left_out.iter().map(|LeftOut { what, why }| (*what, *why)).collect();
        SectionResult { number: section.number, title: section.title, intro: section.intro, studies, plots, left_out }
    }
    /// Rows of all studies.
    pub fn rows(&self) -> impl Iterator<Item = (&StudyResult, &Row)> {
        self.studies.iter().flat_map(|s| s.rows.iter().map(move |r| (s, r)))
    }
}

impl StudyResult {
    pub(crate) fn new(study: &Study, values: &[Vec<f64>], problems: &[String], curve: Vec<(f64, f64)>) -> StudyResult {
        let rows = study.quantities.iter().zip(values).map(|(q, v)| Row::new(study, q, v, problems)).collect();
        StudyResult { name: study.name.clone(), scene: study.scene, rows, curve }
    }
    /// The row of a quantity.
    pub fn row(&self, quantity: &str) -> Option<&Row> {
        self.rows.iter().find(|r| r.quantity == quantity)
    }
}

impl Row {
    fn new(study: &Study, quantity: &Quantity, values: &[f64], problems: &[String]) -> Row {
        let reference = |i: usize| quantity.reference.get(i.min(quantity.reference.len().saturating_sub(1))).copied();
        let references: Vec<f64> = (0..values.len()).filter_map(reference).collect();
        let scale = |i: usize| quantity.scale.unwrap_or_else(|| references[i].abs());
        let errors: Vec<Option<f64>> =
            values.iter().enumerate().map(|(i, v)| references.get(i).map(|r| (v - r) / scale(i))).collect();
        // The order toward one reference; toward references that differ from run to run there is none.
        let order = if quantity.reference.len() == 1 { order(study, values, &errors, scale(0)) } else { None };
        let last = errors.last().copied().flatten().unwrap_or(f64::NAN).abs();
        let every = |ok: &dyn Fn(f64) -> bool| !values.is_empty() && values.iter().all(|v| ok(*v));
        let met = match quantity.bar {
            Bar::Within(error) if quantity.reference.len() > 1 => {
                errors.iter().all(|e| e.is_some_and(|e| e.abs() <= error))
            }
            Bar::Within(error) => last <= error,
            // Without an order the runs agree to rounding.
            Bar::Order(error, least) => last <= error && order.is_none_or(|p| p >= least),
            Bar::Same(difference) => {
                spread(values)
                    <= difference
                        * quantity.scale.unwrap_or_else(|| values.iter().fold(0.0, |a: f64, v| a.max(v.abs())))
            }
            Bar::AtMost(most) => every(&|v| v <= most),
            Bar::AtLeast(least) => every(&|v| v >= least),
        };
        let bar = match quantity.bar {
            Bar::Within(error) => format!("≤ {}", percent(error)),
            Bar::Order(error, least) => format!("≤ {}, order ≥ {least}", percent(error)),
            Bar::Same(difference) => format!("same to {}", percent(difference)),
            Bar::AtMost(most) => format!("≤ {}", number(most)),
            Bar::AtLeast(least) => format!("≥ {}", number(least)),
        };
        let passed = met && problems.is_empty();
        let reason = if passed {
            None
        } else if problems.is_empty() {
            quantity.reason.map(str::to_string)
        } else {
            Some(problems.join("; "))
        };
        let levels = study.levels.iter().map(|l| l.label.clone()).collect();
        Row {
            quantity: quantity.name.clone(),
            source: quantity.source,
            levels,
            references,
            values: values.to_vec(),
            errors,
            order,
            bar,
            passed,
            reason,
        }
    }
}

/// Largest difference between any two values; not a number if one is.
fn spread(values: &[f64]) -> f64 {
    let (low, high) =
        values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)));
    if values.iter().all(|v| v.is_finite()) { high - low } else { f64::NAN }
}

/// Order of convergence: from the differences between the last three runs where their sizes fall by one ratio, which
/// needs no reference; from the errors of the last two otherwise.
fn order(study: &Study, values: &[f64], errors: &[Option<f64>], scale: f64) -> Option<f64> {
    let ratio = |coarse: f64, fine: f64| if coarse > fine && fine > 0.0 { coarse / fine } else { f64::NAN };
    if let ([.., l0, l1, l2], [.., v0, v1, v2]) = (study.levels.as_slice(), values)
        && (ratio(l0.size, l1.size) / ratio(l1.size, l2.size) - 1.0).abs() < 1e-6
    {
        let (coarse, fine) = ((v0 - v1) / scale, (v1 - v2) / scale);
        return (fine.abs() > ROUNDING).then(|| (coarse / fine).abs().ln() / ratio(l1.size, l2.size).ln());
    }
    let ([.., coarse, fine], [.., Some(e_coarse), Some(e_fine)]) = (study.levels.as_slice(), errors) else {
        return None;
    };
    let meaningful = e_fine.abs() > ROUNDING && e_coarse.abs() > ROUNDING && ratio(coarse.size, fine.size).is_finite();
    meaningful.then(|| (e_coarse / e_fine).abs().ln() / ratio(coarse.size, fine.size).ln())
}

/// A number to six digits.
pub(crate) fn number(v: f64) -> String {
    if v == 0.0 {
        return "0".into();
    }
    if !v.is_finite() {
        return "-".into();
    }
    let exponent = v.abs().log10().floor();
    if !(-4.0..6.0).contains(&exponent) {
        return format!("{v:.4e}");
    }
    let text = format!("{v:.*}", (5.0 - exponent).clamp(0.0, 9.0) as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
}

/// A part of one as percent, to two digits.
fn percent(v: f64) -> String {
    if !v.is_finite() {
        return "-".into();
    }
    let p = 100.0 * v;
    if p == 0.0 {
        return "0".into();
    }
    if p.abs() < 1e-4 {
        return format!("{p:.0e} %");
    }
    let digits = (1.0 - p.abs().log10().floor()).clamp(0.0, 8.0) as usize;
    let text = format!("{p:.digits$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    format!("{text} %")
}

/// The whole document.
pub fn markdown(results: &[SectionResult], plots: &str) -> String {
    let rows: Vec<&Row> = results.iter().flat_map(|s| s.rows().map(|(_, r)| r)).collect();
    let failed = rows.iter().filter(|r| !r.passed).count();
    let mut out = String::from("# Validation\n\n");
    let _ = writeln!(
        out,
        "Written by `sutura validate --out docs`, version {}; nothing here is written by hand. {} quantities, {} within their bars, {failed} not.\n",
        env!("CARGO_PKG_VERSION"),
        rows.len(),
        rows.len() - failed
    );
    out.push_str(
        "Each case is a scene of `scenes/validation`, run several times with other values (`sutura run FILE --set KEY=VALUE` does the same). *At* is \
         what was varied: the number of elements unless it says otherwise. *Ours* are the values found, in the same order; *error* is that of the last \
         run, relative to the reference or to what the case names; *order* is that of convergence, from the differences between three runs (so that \
         shear and stretch, which the references leave out, do not count), left out where these are below 1e-6. A reference that is one for each number of elements (discrete) is compared at each. What fails stays in the table.\n\n",
    );
    out.push_str("| section | within | of |\n|---|---:|---:|\n");
    for s in results {
        let (n, ok) = (s.rows().count(), s.rows().filter(|(_, r)| r.passed).count());
        let _ = writeln!(out, "| [{}. {}](#{}) | {ok} | {n} |", s.number, s.title, anchor(s));
    }
    for s in results {
        let _ = write!(out, "\n## {}. {}\n\n{}\n\n", s.number, s.title, s.intro);
        if s.rows().next().is_some() {
            out.push_str("| case | quantity | reference | source | at | ours | error | order | bar | |\n|---|---|---:|---|---|---:|---:|---:|---|---|\n");
        }
        for (study, r) in s.rows() {
            let _ = writeln!(
                out,
                "| {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |",
                study.name,
                r.quantity,
                list(&r.references),
                r.source,
                r.levels.join(", "),
                r.values.iter().map(|v| number(*v)).collect::<Vec<_>>().join(", "),
                r.errors.last().copied().flatten().map_or_else(|| "-".into(), percent),
                r.order.map_or_else(|| "-".into(), |p| format!("{p:.2}")),
                r.bar,
                if r.passed { "pass" } else { "**FAIL**" }
            );
        }
        let reasons: Vec<String> = s
            .rows()
            .filter(|(_, r)| !r.passed)
            .map(|(study, r)| {
                format!("- {}, {}: {}", study.name, r.quantity, r.reason.as_deref().unwrap_or("reason not known"))
            })
            .collect();
        if !reasons.is_empty() {
            let _ = write!(out, "\nFailing:\n\n{}\n", reasons.join("\n"));
        }
        for plot in &s.plots {
            let _ = write!(out, "\n![{}]({plots}/{}.svg)\n", plot.title, plot.file);
        }
        if !s.left_out.is_empty() {
            out.push_str("\nNot run:\n\n");
            for (what, why) in &s.left_out {
                let _ = writeln!(out, "- {what}: {why}");
            }
        }
    }
    out
}

/// Values that differ, once if they do not.
fn list(values: &[f64]) -> String {
    match values {
        [] => "-".into(),
        [first, rest @ ..] if rest.iter().all(|v| v == first) => number(*first),
        all => all.iter().map(|v| number(*v)).collect::<Vec<_>>().join(", "),
    }
}

/// Anchor of a heading as GitHub makes it.
fn anchor(s: &SectionResult) -> String {
    let heading = format!("{}. {}", s.number, s.title).to_lowercase();
    heading
        .chars()
        .filter(|c| c.is_alphanumeric() || " -_".contains(*c))
        .map(|c| if c == ' ' { '-' } else { c })
        .collect()
}

/// All rows as comma-separated text, one line a run.
pub fn csv(results: &[SectionResult]) -> String {
    let quoted = |t: &str| format!("\"{}\"", t.replace('"', "\"\""));
    let mut out = String::from("section,case,scene,quantity,at,reference,value,error,order,bar,passed\n");
    for s in results {
        for (study, r) in s.rows() {
            for (i, value) in r.values.iter().enumerate() {
                let optional =
                    |v: Option<f64>| v.filter(|v| v.is_finite()).map_or_else(String::new, |v| format!("{v}"));
                let _ = writeln!(
                    out,
                    "{},{},{},{},{},{},{},{},{},{},{}",
                    s.number,
                    quoted(&study.name),
                    study.scene,
                    quoted(&r.quantity),
                    quoted(&r.levels[i]),
                    optional(r.references.get(i).copied()),
                    optional(Some(*value)),
                    optional(r.errors.get(i).copied().flatten()),
                    optional(r.order),
                    quoted(&r.bar),
                    r.passed
                );
            }
        }
    }
    out
}
