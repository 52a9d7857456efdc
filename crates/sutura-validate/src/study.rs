//! What is run, measured and asked for.

use crate::results::{Plot, StudyResult};
use sutura_scene::Outcome;

/// Cases of one kind.
pub struct Section {
    /// Number, that of the table.
    pub number: u32,
    /// What it is about.
    pub title: &'static str,
    /// What is set up and what is compared with what.
    pub intro: &'static str,
    /// The cases.
    pub studies: Vec<Study>,
    /// Pictures of the results.
    pub plots: fn(&[StudyResult]) -> Vec<Plot>,
    /// What belongs here and is not run.
    pub left_out: &'static [LeftOut],
}

/// Something that is not run, and why.
#[derive(Debug, Clone, Copy)]
pub struct LeftOut {
    /// What it is.
    pub what: &'static str,
    /// Why it is not run.
    pub why: &'static str,
}

/// A scene, refined, and what is measured in it.
pub struct Study {
    /// Name, unique in its section.
    pub name: String,
    /// Name of the scene in `scenes/validation/`; empty where nothing is simulated.
    pub scene: &'static str,
    /// Values set in the scene for all runs: path and value.
    pub settings: Vec<(String, String)>,
    /// The runs, coarse to fine.
    pub levels: Vec<Level>,
    /// What is compared.
    pub quantities: Vec<Quantity>,
    /// What is kept of the last run for plots.
    pub curve: Option<Measure<Vec<(f64, f64)>>>,
    /// Whether it belongs to the quick selection.
    pub quick: bool,
}

/// What is read from a run.
pub type Measure<T> = Box<dyn Fn(&Outcome) -> T + Send + Sync>;

/// One run of a study.
pub struct Level {
    /// What is varied, for the table: `25`, `1 ms`.
    pub label: String,
    /// Length or time that goes to zero with refinement, in any unit; zero where runs are not refinements of one
    /// another.
    pub size: f64,
    /// Values set in the scene for this run.
    pub settings: Vec<(String, String)>,
}

/// A number measured, and what it is compared with.
pub struct Quantity {
    /// What it is.
    pub name: String,
    /// How it is read from a run.
    pub measure: Measure<f64>,
    /// What it should be: one value for all runs, or one a run.
    pub reference: Vec<f64>,
    /// Where the reference comes from.
    pub source: &'static str,
    /// What errors are divided by; the magnitude of the reference when `None`.
    pub scale: Option<f64>,
    /// What is asked for.
    pub bar: Bar,
    /// Why it fails, where that is known.
    pub reason: Option<&'static str>,
}

/// What is asked of a quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Bar {
    /// Error of the last run.
    Within(f64),
    /// Error of the last run, and least order of convergence over the last two.
    Order(f64, f64),
    /// Largest difference between any two runs.
    Same(f64),
    /// The value in every run.
    AtMost(f64),
    /// The value in every run.
    AtLeast(f64),
}

impl Section {
    /// A section without studies yet.
    pub fn new(number: u32, title: &'static str, intro: &'static str) -> Section {
        Section { number, title, intro, studies: Vec::new(), plots: |_| Vec::new(), left_out: &[] }
    }
}

impl Study {
    /// A scene run once as it is.
    pub fn new(name: impl Into<String>, scene: &'static str) -> Study {
        Study {
            name: name.into(),
            scene,
            settings: Vec::new(),
            levels: vec![Level { label: "-".into(), size: 0.0, settings: Vec::new() }],
            quantities: Vec::new(),
            curve: None,
            quick: false,
        }
    }
    /// Nothing to simulate: measures call a function of the engine themselves.
    pub fn direct(name: impl Into<String>) -> Study {
        Study::new(name, "")
    }
    /// Sets a value of the scene in all runs.
    #[expect(clippy::needless_pass_by_value, reason = "numbers and texts alike")]
    pub fn set(mut self, path: &str, value: impl ToString) -> Study {
        self.settings.push((path.into(), value.to_string()));
        self
    }
    /// One run for each number of elements of a thread.
    pub fn elements(self, thread: &str, counts: &[u32]) -> Study {
        let level = |n: &u32| Level {
            label: n.to_string(),
            size: 1.0 / f64::from(*n),
            settings: vec![(format!("thread.{thread}.elements"), n.to_string())],
        };
        self.levels(counts.iter().map(level).collect())
    }
    /// One run for each substep \[s\].
    pub fn substeps(self, substeps: &[f64]) -> Study {
        let level =
            |h: &f64| Level { label: time(*h), size: *h, settings: vec![("solver.substep".into(), format!("{h:e}"))] };
        self.levels(substeps.iter().map(level).collect())
    }
    /// The runs.
    pub fn levels(mut self, levels: Vec<Level>) -> Study {
        self.levels = levels;
        self
    }
    /// Adds what is measured.
    pub fn quantity(mut self, quantity: Quantity) -> Study {
        self.quantities.push(quantity);
        self
    }
    /// Keeps a curve of the last run.
    pub fn curve(mut self, curve: impl Fn(&Outcome) -> Vec<(f64, f64)> + Send + Sync + 'static) -> Study {
        self.curve = Some(Box::new(curve));
        self
    }
    /// Makes it part of the quick selection.
    pub fn quick(mut self, quick: bool) -> Study {
        self.quick = quick;
        self
    }
}

impl Level {
    /// A run with some values of the scene.
    pub fn new(label: impl Into<String>, size: f64, settings: &[(&str, String)]) -> Level {
        Level {
            label: label.into(),
            size,
            settings: settings.iter().map(|(path, value)| ((*path).to_string(), value.clone())).collect(),
        }
    }
}

impl Quantity {
    /// Last value of a probe (`name`, or `name.column`) times a factor.
    pub fn last(
        name: impl Into<String>,
        probe: &'static str,
        factor: f64,
        reference: f64,
        source: &'static str,
        bar: Bar,
    ) -> Quantity {
        Quantity::measured(name, move |outcome| factor * last(outcome, probe), vec![reference], source, bar)
    }
    /// Anything read from a run; `reference` is one value, or one a run.
    pub fn measured(
        name: impl Into<String>,
        measure: impl Fn(&Outcome) -> f64 + Send + Sync + 'static,
        reference: Vec<f64>,
        source: &'static str,
        bar: Bar,
    ) -> Quantity {
        Quantity { name: name.into(), measure: Box::new(measure), reference, source, scale: None, bar, reason: None }
    }
    /// Divides errors by this instead of the reference.
    pub fn scale(mut self, scale: f64) -> Quantity {
        self.scale = Some(scale);
        self
    }
    /// One reference a run.
    pub fn references(mut self, references: Vec<f64>) -> Quantity {
        self.reference = references;
        self
    }
    /// Why it fails.
    pub fn because(mut self, reason: &'static str) -> Quantity {
        self.reason = Some(reason);
        self
    }
}

/// Last value of a probe or of one of its columns; not a number when there is none.
pub fn last(outcome: &Outcome, probe: &str) -> f64 {
    outcome.report.probes.iter().find(|p| p.name == probe).map_or(f64::NAN, |p| p.last)
}

/// Times and values of a probe with one column.
pub fn series(outcome: &Outcome, probe: &str) -> Vec<(f64, f64)> {
    let Some(series) = outcome.series.iter().find(|s| s.name == probe) else { return Vec::new() };
    series.rows.iter().map(|r| (r[0], r[1])).collect()
}

/// Columns of a series (a probe or profile).
pub fn columns<const N: usize>(outcome: &Outcome, name: &str, columns: [&str; N]) -> Vec<[f64; N]> {
    let Some(series) = outcome.series.iter().find(|s| s.name == name) else { return Vec::new() };
    let Some(found) =
        columns.iter().map(|c| series.columns.iter().position(|(n, _)| n == c)).collect::<Option<Vec<_>>>()
    else {
        return Vec::new();
    };
    series.rows.iter().map(|r| std::array::from_fn(|i| r[found[i]])).collect()
}

/// A time in words.
fn time(seconds: f64) -> String {
    let (value, unit) = if seconds >= 1.0 {
        (seconds, "s")
    } else if seconds >= 1e-3 {
        (seconds * 1e3, "ms")
    } else {
        (seconds * 1e6, "µs")
    };
    let rounded = (value * 1e4).round() / 1e4;
    format!("{rounded} {unit}")
}

/// Names and texts of the scenes.
pub fn scenes() -> &'static [(&'static str, &'static str)] {
    include!(concat!(env!("OUT_DIR"), "/scenes.rs"))
}

/// Text of a scene of `scenes/validation/`.
pub fn scene_text(name: &str) -> Option<&'static str> {
    scenes().iter().find(|(n, _)| *n == name).map(|(_, text)| *text)
}
