//! What a run hands over: the report (`report.json`), the time series and the saved states.

use crate::trajectory::Trajectory;
use serde::{Deserialize, Serialize};
use sutura::input::Recording;

/// Everything that a run leaves behind.
#[derive(Debug, Clone, Default)]
pub struct Outcome {
    /// Summary, checks and incidents.
    pub report: Report,
    /// Probes, profiles and the built-in series `frame`.
    pub series: Vec<Series>,
    /// Positions and frames of every recorded frame.
    pub trajectory: Trajectory,
    /// States that phases asked to save.
    pub saved: Vec<SavedState>,
    /// What was done to the world, where it was to be recorded.
    pub input: Option<Recording>,
}

/// A state to write to a file, so that another scene can start from it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SavedState {
    /// File name wanted by the scene.
    pub name: String,
    /// The bytes of the file (see `docs/formats.md`).
    pub bytes: Vec<u8>,
}

/// One table of numbers over time (or over the length of a thread, for a profile).
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Name, unique in the run.
    pub name: String,
    /// Name and unit of each column; the first is what the rows run over, `time` in s (`arc` in m for a profile).
    pub columns: Vec<(String, String)>,
    /// Rows in order.
    pub rows: Vec<Vec<f64>>,
}

impl Series {
    /// The numbers of a column by name.
    pub fn column(&self, name: &str) -> Option<Vec<f64>> {
        let c = self.columns.iter().position(|(n, _)| n == name)?;
        Some(self.rows.iter().map(|r| r[c]).collect())
    }
    /// The table as comma-separated text; headings are `name [unit]`.
    pub fn to_csv(&self) -> String {
        let heading: Vec<String> =
            self.columns.iter().map(|(n, u)| if u.is_empty() { n.clone() } else { format!("{n} [{u}]") }).collect();
        let mut text = heading.join(",") + "\n";
        for row in &self.rows {
            let cells: Vec<String> =
                row.iter().map(|v| if v.is_finite() { format!("{v}") } else { String::new() }).collect();
            text.push_str(&cells.join(","));
            text.push('\n');
        }
        text
    }
}

/// The report of a run, `report.json`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Name of the scene (the file name without its ending).
    pub scene: String,
    /// Title given in the scene, or its name.
    pub title: String,
    /// Version of the program that ran it.
    pub version: String,
    /// Solver and its settings.
    pub solver: SolverReport,
    /// Time that was simulated \[s\].
    pub simulated_s: f64,
    /// Time that passed with everything at rest because no acceptable substep was found \[s\].
    #[serde(default)]
    pub not_simulated_s: f64,
    /// CPU time of the solver \[s\]; audit, recording, probes and checks are not in it.
    pub cpu_s: f64,
    /// `simulated_s / cpu_s`.
    pub real_time_factor: f64,
    /// The least real-time factor over any window of one simulated second (over the whole run when it is shorter).
    pub worst_second_real_time_factor: f64,
    /// Solver time of a frame \[ms\].
    pub ms_per_frame: FrameTimes,
    /// Frames simulated.
    pub frames: u64,
    /// Each thread.
    pub threads: Vec<ThreadReport>,
    /// Least clearances over every accepted substep.
    pub min_clearance: Clearance,
    /// Whether anything passed through anything, by the audit; `None` when the scene switches the audit off.
    pub passes_through: Option<bool>,
    /// What the audit saw pass through, where and when (first few).
    pub passages: Vec<String>,
    /// Summary of each probe column.
    pub probes: Vec<ProbeReport>,
    /// Each check.
    pub checks: Vec<CheckReport>,
    /// What a real thread might not have borne; no failure.
    #[serde(default)]
    pub warnings: Vec<WarningReport>,
    /// What lay in each other at the start, or was put where something was already.
    #[serde(default)]
    pub overlaps: Vec<OverlapReport>,
    /// What was mended of meshes, and what of them may not have been meant: in words.
    #[serde(default)]
    pub notes: Vec<String>,
    /// What went wrong.
    pub incidents: Vec<IncidentReport>,
    /// Why the run did not pass, beside checks that failed and phases that ran out of time: in words.
    #[serde(default)]
    pub failures: Vec<String>,
    /// Hash of the last state, 16 hexadecimal digits.
    pub state_hash: String,
    /// What the solver did.
    pub work: WorkReport,
    /// Each phase that was begun.
    pub phases: Vec<PhaseReport>,
    /// Whether the run came to its end; not when it was stopped before.
    pub finished: bool,
    /// Whether it came to its end, every check passed, no phase ran out of time (where running out is a failure), and
    /// `failures` is empty.
    pub passed: bool,
}

/// Solver and settings.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct SolverReport {
    /// `direct` or `paper`.
    pub name: String,
    /// Frames per second.
    pub frame_rate: f64,
    /// Longest substep \[s\].
    pub substep_s: f64,
    /// Newton iterations allowed in a substep.
    pub newton_max: u32,
    /// Convergence tolerance \[rad\].
    pub tolerance: f64,
    /// Linear damping per second at the end of the run.
    pub linear_damping: f64,
    /// Angular damping per second at the end of the run.
    pub angular_damping: f64,
    /// Linear drag at the end of the run \[1/s\].
    pub linear_drag: f64,
    /// Angular drag at the end of the run \[1/s\].
    pub angular_drag: f64,
    /// Gravity at the end of the run \[m/s^2\].
    pub gravity: [f64; 3],
}

/// Solver time of a frame \[ms\].
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct FrameTimes {
    /// Half of the frames took less.
    pub median: f64,
    /// 99 of 100 frames took less.
    pub p99: f64,
    /// The longest.
    pub max: f64,
}

/// One thread at the end of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ThreadReport {
    /// Name in the scene.
    pub name: String,
    /// Number of elements.
    pub elements: usize,
    /// Rest length \[m\].
    pub length_m: f64,
    /// Radius \[m\].
    pub radius_m: f64,
    /// Largest |elongation| of an element at any frame's end.
    pub max_elongation: f64,
    /// Largest tension of an element at any frame's end \[N\].
    #[serde(rename = "max_tension_N")]
    pub max_tension_n: f64,
    /// Recognised knot at the end; `None` when recognition was not asked for.
    pub knot: Option<KnotReport>,
}

/// A recognised knot and how sure that is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KnotReport {
    /// Name of the knot; `unnamed` when it is certain and has none here, `unknown` when it is not certain.
    #[serde(alias = "name")]
    pub knot: String,
    /// Whether enough views and closures agree: the invariants are those of the knot, named or not.
    #[serde(default)]
    pub certain: bool,
    /// Knot determinant.
    pub determinant: u64,
    /// Knot signature.
    pub signature: i64,
    /// Closures and projections tried, and how many agreed with the answer.
    pub tried: u32,
    /// See `tried`.
    pub agreed: u32,
    /// How it lies; `None` without a loop, or where the thread does not touch itself.
    #[serde(default)]
    pub form: Option<FormReport>,
}

/// Whether a knot lies flat or has capsized, which its name does not tell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FormReport {
    /// `flat`, `capsized` or `unclear`.
    pub verdict: String,
    /// How evenly the two strands share the turning: 1 alike, 0 one of them straight.
    pub share: f64,
    /// Total curvature of the strand of the thread's start, and of that of its end \[rad\].
    pub turning_rad: [f64; 2],
}

/// A tension that passed the knot-pull strength of its thread: the first time in a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WarningReport {
    /// In words.
    pub message: String,
    /// Name of the thread.
    pub thread: String,
    /// End of the frame at which it was seen \[s\].
    pub time_s: f64,
    /// Arc length from the start of the thread where the tension is greatest \[m\].
    pub arc_m: f64,
    /// The tension there \[N\].
    #[serde(rename = "tension_N")]
    pub tension_n: f64,
    /// The strength that it passed \[N\].
    #[serde(rename = "strength_N")]
    pub strength_n: f64,
}

/// A place where a thread lay in a thread or a shape.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OverlapReport {
    /// In words, with file, line and key of both.
    pub message: String,
    /// When \[s\].
    pub time_s: f64,
    /// Name of the thread.
    pub thread: String,
    /// Where on it, rest length from its start \[m\].
    pub arc_m: f64,
    /// Name of the thread or shape that it lay in.
    pub with: String,
    /// Where on that, if it is a thread \[m\].
    pub with_arc_m: Option<f64>,
    /// Place in the world \[m\].
    pub point_m: [f64; 3],
    /// How deep \[m\].
    pub depth_m: f64,
    /// The same over the diameter, of two threads the mean one.
    pub depth_diameters: f64,
    /// Whether a centerline ran within the other thread, in the solid or across the mesh; else they were only pressed
    /// into each other.
    pub through: bool,
}

/// Least clearance by kind of pair: (distance - radii) / thread diameter, negative overlaps. `None`: nothing was ever
/// near.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Clearance {
    /// Between two pieces of thread.
    pub thread_thread: Option<f64>,
    /// Between thread and shape.
    pub thread_shape: Option<f64>,
    /// The lesser of the two.
    pub least: Option<f64>,
}

/// A column of a probe over the run, in the unit of the probe.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProbeReport {
    /// Name of the probe, with `.column` when it has several.
    pub name: String,
    /// Unit of the numbers.
    pub unit: String,
    /// First value.
    pub first: f64,
    /// Last value.
    pub last: f64,
    /// Least value.
    pub min: f64,
    /// Greatest value.
    pub max: f64,
}

/// What a check found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CheckReport {
    /// Name of the check.
    pub name: String,
    /// The value found; `None` when the moment of the check was never reached.
    pub value: Option<CheckValue>,
    /// Unit of the value, empty for text, truth and pure numbers.
    pub unit: String,
    /// What was wanted, in words.
    pub wanted: String,
    /// Whether it holds.
    pub passed: bool,
    /// Simulated time at which the value was taken \[s\].
    pub time_s: Option<f64>,
}

/// The value of a check.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum CheckValue {
    /// True or false.
    Truth(bool),
    /// A number in the unit of the check.
    Number(f64),
    /// A word, for instance the name of a knot.
    Text(String),
}

impl std::fmt::Display for CheckValue {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            CheckValue::Truth(b) => write!(f, "{b}"),
            CheckValue::Number(v) if *v != 0.0 && (v.abs() < 1e-3 || v.abs() >= 1e6) => write!(f, "{v:.4e}"),
            CheckValue::Number(v) => write!(f, "{v:.6}"),
            CheckValue::Text(t) => write!(f, "{t}"),
        }
    }
}

/// Incidents of one kind.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct IncidentReport {
    /// What happened, at its first time.
    pub message: String,
    /// How often.
    pub count: u64,
    /// First time \[s\].
    pub first_s: f64,
    /// Last time \[s\].
    pub last_s: f64,
}

/// What the solver did in the whole run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct WorkReport {
    /// Substeps accepted.
    pub substeps: u64,
    /// Substeps thrown away and halved.
    pub rejected: u64,
    /// Newton iterations.
    pub newton_iterations: u64,
    /// Whether every accepted substep converged.
    pub converged: bool,
    /// Largest residual move of an accepted substep, over the thread's radius.
    pub max_residual: f64,
    /// Largest error of an element's length: elongation where inextensible, |strain - T/EA| where elastic.
    pub max_length_error: f64,
    /// Most contacts that carried force at a step's end.
    pub max_contacts: u32,
}

/// A phase of the run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PhaseReport {
    /// Its name.
    pub name: String,
    /// When it began \[s\].
    pub start_s: f64,
    /// When it ended \[s\]; the end of the run when it did not.
    pub end_s: f64,
    /// `duration`, `condition`, `motions done`, `out of time`, `given up`, or `stopped`.
    pub ended_by: String,
    /// Whether the scene wants a still picture of its end.
    #[serde(default)]
    pub still: bool,
    /// Recognised knots at its end where asked: thread and knot.
    pub knots: Vec<(String, KnotReport)>,
}
