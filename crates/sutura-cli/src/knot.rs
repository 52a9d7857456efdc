//! The command `sutura knot`: which knot is it?

use crate::args::{EndsOption, Knot};
use crate::{FAILS, HOLDS, say, say_json};
use anyhow::{Context as _, bail};
use sutura::glam::DVec3;
use sutura::knot::{Ends, Form, KnotType, Verdict, form, recognize};
use sutura_scene::{TableError, Trajectory, points_from_table};

/// What is printed as JSON.
#[derive(serde::Serialize)]
struct Answer<'a> {
    file: String,
    points: usize,
    time_s: Option<f64>,
    thread: Option<&'a str>,
    ends: &'static str,
    knot: &'static str,
    certain: bool,
    title: String,
    prime_parts: &'a str,
    determinant: u64,
    signature: i32,
    alexander: &'a [i64],
    crossings: usize,
    views_agreed: u32,
    views: u32,
    closures_agreed: u32,
    closures: u32,
    trimmed: f64,
    form: Option<Lies>,
    problem: Option<String>,
}

/// How the knot lies.
#[derive(serde::Serialize)]
struct Lies {
    verdict: &'static str,
    straight: Option<&'static str>,
    share: f64,
    turning_rad: [f64; 2],
}

impl From<Form> for Lies {
    fn from(form: Form) -> Self {
        let straight = match form.verdict {
            Verdict::Capsized { straight } => Some(if straight == 0 { "start" } else { "end" }),
            Verdict::Flat | Verdict::Unclear => None,
        };
        Lies { verdict: form.verdict.name(), straight, share: form.share, turning_rad: form.turning }
    }
}

/// The knot is certain and has no name here.
const UNNAMED: u8 = 3;
/// The knot is not certain.
const UNCERTAIN: u8 = 4;

/// Runs the command; its exit code.
pub fn knot(args: &Knot) -> anyhow::Result<u8> {
    if let Some(name) = &args.expect {
        let known = || KnotType::NAMES.into_iter().chain(["unnamed", "unknown"]);
        if !known().any(|n| n == name) {
            let near = crate::nearest(name, known()).map_or_else(
                || format!("there are {}", known().collect::<Vec<_>>().join(", ")),
                |n| format!("did you mean `{n}`?"),
            );
            bail!("no knot is called `{name}`; {near}");
        }
    }
    let curve = read(args)?;
    let (ends, how) = match args.ends {
        _ if args.closed => (Ends::Closed, "closed"),
        EndsOption::Free => (Ends::Free, "free"),
        EndsOption::Held => (held(&curve.points), "held"),
    };
    let found = recognize(&curve.points, ends, args.seed);
    let answer = Answer {
        file: args.file.display().to_string(),
        points: curve.points.len(),
        time_s: curve.time,
        thread: curve.thread.as_deref(),
        ends: how,
        knot: found.name(),
        certain: found.is_certain(),
        title: match (found.knot, found.is_certain()) {
            (KnotType::Unknown, true) => "certain, but no knot that has a name here".into(),
            (KnotType::Unknown, false) => "not certain".into(),
            (named, _) => named.to_string(),
        },
        prime_parts: &found.notation,
        determinant: found.determinant,
        signature: found.signature,
        alexander: &found.alexander,
        crossings: found.crossings,
        views_agreed: found.projections_agreed,
        views: found.projections_total,
        closures_agreed: found.closures_agreed,
        closures: found.closures_total,
        trimmed: found.trimmed,
        form: curve.radius.and_then(|radius| form_of(&curve.points, radius)).map(Lies::from),
        problem: found.problem.map(|p| format!("{p:?}")),
    };
    if args.json {
        say_json(&answer)?;
    } else {
        say(&words(&answer))?;
    }
    Ok(match &args.expect {
        Some(name) if name == answer.knot => HOLDS,
        Some(_) => FAILS,
        None if !answer.certain => UNCERTAIN,
        None if found.knot == KnotType::Unknown => UNNAMED,
        None => HOLDS,
    })
}

fn words(a: &Answer<'_>) -> String {
    let mut out = format!("{} ({})\n", a.title, a.knot);
    let mut line = |name: &str, value: String| out.push_str(&format!("  {name:<12}{value}\n"));
    if let (Some(thread), Some(time)) = (a.thread, a.time_s) {
        line("thread", format!("{thread} at {time:.4} s"));
    }
    line("points", format!("{}, ends {}", a.points, a.ends));
    if !a.prime_parts.is_empty() {
        line("prime parts", a.prime_parts.to_string());
    }
    line("determinant", a.determinant.to_string());
    line("signature", a.signature.to_string());
    if !a.alexander.is_empty() {
        line("Alexander", a.alexander.iter().map(i64::to_string).collect::<Vec<_>>().join(" "));
    }
    line("crossings", format!("{} after simplification", a.crossings));
    let trimmed =
        if a.trimmed > 0.0 { format!(", {:.0} % trimmed from each end", 100.0 * a.trimmed) } else { String::new() };
    line(
        "agreement",
        format!("{} of {} views, {} of {} closures{trimmed}", a.views_agreed, a.views, a.closures_agreed, a.closures),
    );
    if let Some(form) = &a.form {
        let straight = form.straight.map_or_else(String::new, |end| format!(", the strand of the {end} is straight"));
        let [a, b] = form.turning_rad.map(f64::to_degrees);
        line(
            "form",
            format!("{}{straight}; strands turn by {a:.0} and {b:.0} deg, share {:.2}", form.verdict, form.share),
        );
    }
    if let Some(problem) = &a.problem {
        line("problem", problem.clone());
    }
    out
}

/// How the knot lies; lengths are those of the pieces, which a recording does not tell from rest lengths.
fn form_of(points: &[DVec3], radius: f64) -> Option<Form> {
    // A point given twice is an element without length.
    let mut points = points.to_vec();
    points.dedup();
    let lengths: Vec<f64> = points.windows(2).map(|w| w[0].distance(w[1])).collect();
    form(&points, &lengths, radius)
}

struct Curve {
    points: Vec<DVec3>,
    /// Radius of the thread, in the unit of the points.
    radius: Option<f64>,
    time: Option<f64>,
    thread: Option<String>,
}

fn read(args: &Knot) -> anyhow::Result<Curve> {
    let file = &args.file;
    let bytes = std::fs::read(file).with_context(|| format!("cannot read {}", file.display()))?;
    if !bytes.starts_with(b"SUTURATR") {
        if args.frame.is_some() || args.time.is_some() || args.thread.is_some() {
            bail!("{}: not a trajectory, so --frame, --time and --thread mean nothing", file.display());
        }
        return Ok(Curve {
            points: points_from_table(&bytes).map_err(|e| match e {
                TableError::Row { line, reason } => anyhow::anyhow!("{}:{line}: {reason}", file.display()),
                other => anyhow::anyhow!("{}: {other}", file.display()),
            })?,
            radius: args.diameter.map(|d| 0.5 * d),
            time: None,
            thread: None,
        });
    }
    let trajectory = Trajectory::from_bytes(&bytes).with_context(|| file.display().to_string())?;
    let count = trajectory.frames.len();
    let frame = match (args.frame, args.time) {
        (Some(n), _) => {
            let index = if n < 0 { n + count as i64 } else { n };
            usize::try_from(index)
                .ok()
                .and_then(|i| trajectory.frames.get(i))
                .with_context(|| format!("{}: no frame {n}, it has {count}", file.display()))?
        }
        (None, Some(time)) => trajectory.nearest(time).with_context(|| format!("{}: no frames", file.display()))?,
        (None, None) => trajectory.frames.last().with_context(|| format!("{}: no frames", file.display()))?,
    };
    let threads = &trajectory.header.threads;
    let k = match &args.thread {
        None => 0,
        Some(name) => threads.iter().position(|t| t.name == *name).with_context(|| {
            let names: Vec<&str> = threads.iter().map(|t| t.name.as_str()).collect();
            format!("{}: no thread `{name}`; there are {}", file.display(), names.join(", "))
        })?,
    };
    let points = frame.positions.get(k).with_context(|| format!("{}: no threads", file.display()))?;
    Ok(Curve {
        points: points.iter().map(|p| DVec3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]))).collect(),
        radius: args.diameter.map(|d| 0.5 * d).or(threads.get(k).map(|t| t.radius)),
        time: Some(frame.time),
        thread: threads.get(k).map(|t| t.name.clone()),
    })
}

/// Ends held by instruments that came from outside: each ray leads away from the middle of the thread.
fn held(points: &[DVec3]) -> Ends {
    let middle = points.iter().sum::<DVec3>() / points.len() as f64;
    let (first, last) = (points[0], points[points.len() - 1]);
    let outward = |end: DVec3, other: DVec3| {
        [end - middle, end - other, DVec3::X].into_iter().find(|d| d.length() > 0.0).unwrap_or(DVec3::X)
    };
    Ends::Held { start: outward(first, last), end: outward(last, first) }
}
