//! Runs the cases of a study that are not in its table yet, and writes the table after each.

use crate::case::{Budget, Filter};
use crate::table::{Table, replace};
use anyhow::Context as _;
use indicatif::{ProgressBar, ProgressStyle};
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A study: cases, each with its level of every factor, and what is measured of each.
pub trait Study {
    /// A case.
    type Case: Sync;
    /// Name of its files.
    const NAME: &'static str;
    /// The factors.
    const FACTORS: &'static [&'static str];
    /// What is measured.
    const MEASURES: &'static [&'static str];
    /// All cases, in the order of the table.
    fn cases() -> Vec<Self::Case>;
    /// The level of each factor.
    fn levels(case: &Self::Case) -> Vec<String>;
    /// Runs a case; what was measured. `trace` takes lines that say how it goes.
    fn run(case: &Self::Case, budget: Budget, trace: &mut dyn FnMut(String)) -> Vec<String>;
    /// What a table says, in Markdown. Pictures go beside it.
    fn report(table: &Table, folder: &std::path::Path) -> anyhow::Result<String>;
}

/// How to run a study.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Where the files go.
    pub folder: PathBuf,
    /// Which cases.
    pub only: Filter,
    /// How much each may take.
    pub budget: Budget,
    /// How many at a time.
    pub jobs: usize,
    /// Whether to run cases that are in the table already.
    pub again: bool,
    /// Whether to say how each goes.
    pub verbose: bool,
    /// The engine's version and what it computes.
    pub engine: String,
}

/// Columns between factors and measures: what decides whether a case must be run anew.
const OWN: [&str; 3] = ["engine", "budget_s", "budget_frames"];
/// The measure that says how a case ended.
pub const ENDED: &str = "ended";
/// How it begins where a case was given up.
pub const NOT_FINISHED: &str = "not finished: ";

/// Runs a study; how many cases it ran.
pub fn run<S: Study>(plan: &Plan) -> anyhow::Result<usize> {
    std::fs::create_dir_all(&plan.folder)
        .with_context(|| format!("cannot make the folder {}", plan.folder.display()))?;
    let path = plan.folder.join(S::NAME).with_extension("csv");
    let columns: Vec<&str> = S::FACTORS.iter().chain(&OWN).chain(S::MEASURES).copied().collect();
    let table = Table::read_or_new(&path, &columns)?;
    let cases = S::cases();
    let wanted = |levels: &[String]| plan.only.admits(S::FACTORS, levels);
    let selected: Vec<&S::Case> = cases.iter().filter(|c| wanted(&S::levels(c))).collect();
    anyhow::ensure!(!selected.is_empty(), "no case of the study has these levels");
    let due: Vec<&S::Case> =
        selected.into_iter().filter(|c| plan.again || !is_done::<S>(&table, &S::levels(c), plan)).collect();

    let bar = ProgressBar::new(due.len() as u64);
    // The template is a constant; a default bar would do as well.
    if let Ok(style) = ProgressStyle::with_template("{bar:30.blue/white} {pos}/{len}  {elapsed}, {eta} left  {msg}") {
        bar.set_style(style.progress_chars("━━─"));
    }
    bar.tick();
    let (next, shared) = (AtomicUsize::new(0), Mutex::new((table, Ok(()))));
    std::thread::scope(|scope| {
        for _ in 0..plan.jobs.max(1) {
            scope.spawn(|| {
                while let Some(case) = due.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let levels = S::levels(case);
                    let name =
                        S::FACTORS.iter().zip(&levels).map(|(f, l)| format!("{f}={l}")).collect::<Vec<_>>().join(",");
                    bar.set_message(name.clone());
                    if plan.verbose {
                        bar.suspend(|| eprintln!("{name}"));
                    }
                    let measured = S::run(case, plan.budget, &mut |line| {
                        if plan.verbose {
                            bar.suspend(|| eprintln!("  {line}"));
                        }
                    });
                    let own = [plan.engine.clone(), plan.budget.cpu_s.to_string(), plan.budget.frames.to_string()];
                    let row: Vec<String> = levels.into_iter().chain(own).chain(measured).collect();
                    let mut shared = shared.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
                    let (table, written) = &mut *shared;
                    put::<S>(table, row, &cases);
                    if written.is_ok() {
                        *written = table.write(&path);
                    }
                    bar.inc(1);
                }
            });
        }
    });
    bar.finish_and_clear();
    let (table, written) = shared.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    written?;
    report::<S>(&table, cases.len(), plan)?;
    Ok(due.len())
}

/// The report on the cases that this engine ran.
fn report<S: Study>(table: &Table, n_cases: usize, plan: &Plan) -> anyhow::Result<()> {
    let engine = table.column(OWN[0]);
    let mut current = table.clone();
    current.rows.retain(|r| r[engine] == plan.engine);
    let unfinished = current.rows.iter().filter(|r| current.text(r, ENDED).starts_with(NOT_FINISHED)).count();
    let head = format!(
        "{} of {n_cases} cases were run with engine {}, {unfinished} of them were not finished. Made by `studies {}`; see [README.md](README.md).\n",
        current.rows.len(),
        plan.engine,
        S::NAME
    );
    let body = S::report(&current, &plan.folder)?;
    let (title, rest) = body.split_once('\n').unwrap_or((&body, ""));
    replace(&plan.folder.join(S::NAME).with_extension("md"), format!("{title}\n\n{head}{rest}").as_bytes())
}

/// Whether the table has this case, run by this engine, and finished or given up on no smaller a budget than now.
fn is_done<S: Study>(table: &Table, levels: &[String], plan: &Plan) -> bool {
    table.rows.iter().any(|row| {
        let spent = |column: &str, now: f64| table.number(row, column).is_some_and(|then| then >= now);
        let finished = !table.text(row, ENDED).starts_with(NOT_FINISHED);
        let tried = spent(OWN[1], plan.budget.cpu_s) && spent(OWN[2], f64::from(plan.budget.frames));
        row[..S::FACTORS.len()] == *levels && table.text(row, OWN[0]) == plan.engine && (finished || tried)
    })
}

/// Puts a row in its place, for the one that was there.
fn put<S: Study>(table: &mut Table, row: Vec<String>, cases: &[S::Case]) {
    let n = S::FACTORS.len();
    let order: Vec<Vec<String>> = cases.iter().map(|c| S::levels(c)).collect();
    table.rows.retain(|r| r[..n] != row[..n]);
    table.rows.push(row);
    table.rows.sort_by_key(|r| order.iter().position(|levels| *levels == r[..n]));
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    /// Cases 0 to 3; the odd ones are finished with a budget of ten frames only.
    struct Numbers;

    impl Study for Numbers {
        type Case = u32;
        const NAME: &'static str = "numbers";
        const FACTORS: &'static [&'static str] = &["n"];
        const MEASURES: &'static [&'static str] = &[ENDED];
        fn cases() -> Vec<u32> {
            (0..4).collect()
        }
        fn levels(case: &u32) -> Vec<String> {
            vec![case.to_string()]
        }
        fn run(case: &u32, budget: Budget, _: &mut dyn FnMut(String)) -> Vec<String> {
            vec![if case.is_multiple_of(2) || budget.frames >= 10 {
                "well".into()
            } else {
                format!("{NOT_FINISHED}tired")
            }]
        }
        fn report(table: &Table, _: &Path) -> anyhow::Result<String> {
            Ok(format!("# Numbers\n\n{}", table.markdown(&["n", ENDED])))
        }
    }

    #[test]
    fn a_study_goes_on_where_it_was_left() {
        let folder = tempfile::tempdir().unwrap();
        let plan = Plan {
            folder: folder.path().to_path_buf(),
            only: Filter::parse("n=2,n=3", Numbers::FACTORS).unwrap(),
            budget: Budget { cpu_s: 1.0, frames: 5 },
            jobs: 2,
            again: false,
            verbose: false,
            engine: "a".into(),
        };
        assert_eq!(run::<Numbers>(&plan).unwrap(), 2);
        let all = Plan { only: Filter::default(), ..plan.clone() };
        assert_eq!(run::<Numbers>(&all).unwrap(), 2);
        assert_eq!(run::<Numbers>(&all).unwrap(), 0);
        let text = std::fs::read_to_string(folder.path().join("numbers.md")).unwrap();
        assert!(text.contains("4 of 4 cases") && text.contains("2 of them were not finished"), "{text}");
        // More budget: what was given up is tried again; the rest is not.
        assert_eq!(run::<Numbers>(&Plan { budget: Budget { cpu_s: 1.0, frames: 10 }, ..all.clone() }).unwrap(), 2);
        assert_eq!(run::<Numbers>(&all).unwrap(), 0);
        assert_eq!(run::<Numbers>(&Plan { again: true, ..plan.clone() }).unwrap(), 2);
        // Another engine.
        assert_eq!(run::<Numbers>(&Plan { engine: "b".into(), ..plan.clone() }).unwrap(), 2);
        let table = Table::read_or_new(
            &folder.path().join("numbers.csv"),
            &["n", "engine", "budget_s", "budget_frames", ENDED],
        )
        .unwrap();
        let seen: Vec<(&str, &str)> = table.rows.iter().map(|r| (r[0].as_str(), r[1].as_str())).collect();
        assert_eq!(seen, [("0", "a"), ("1", "a"), ("2", "b"), ("3", "b")]);
        assert!(run::<Numbers>(&Plan { only: Filter::parse("n=7", Numbers::FACTORS).unwrap(), ..plan }).is_err());
    }
}
