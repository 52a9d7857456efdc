//! Runs studies side by side. Results do not depend on how many run at once, nor on their order.

use crate::results::{SectionResult, StudyResult};
use crate::study::{Level, Section, Study, scene_text};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;
use sutura_scene::{Outcome, Runner, Scene};

/// How far it is.
#[derive(Debug, Clone, PartialEq)]
pub struct Progress {
    /// Runs done.
    pub done: usize,
    /// Runs in all.
    pub total: usize,
    /// What was just done: section, study, level.
    pub name: String,
    /// How long it took \[s\].
    pub seconds: f64,
}

/// What one run gives.
#[derive(Default)]
struct Measured {
    values: Vec<f64>,
    curve: Vec<(f64, f64)>,
    problem: Option<String>,
}

/// Runs all studies of the sections on `jobs` threads; `tell` hears of each run as it is done.
pub fn run(sections: &[Section], jobs: usize, tell: &(dyn Fn(&Progress) + Sync)) -> Vec<SectionResult> {
    let work: Vec<(&Section, &Study, &Level)> = sections
        .iter()
        .flat_map(|s| s.studies.iter().flat_map(move |study| study.levels.iter().map(move |level| (s, study, level))))
        .collect();
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let measured: Vec<Mutex<Measured>> = work.iter().map(|_| Mutex::default()).collect();
    std::thread::scope(|scope| {
        for _ in 0..jobs.max(1) {
            scope.spawn(|| {
                while let Some((i, (section, study, level))) = take(&work, &next) {
                    let clock = Instant::now();
                    let result = one(study, level);
                    if let Ok(mut slot) = measured[i].lock() {
                        *slot = result;
                    }
                    let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                    let name = format!("{} {} {}", section.number, study.name, level.label);
                    tell(&Progress { done, total: work.len(), name, seconds: clock.elapsed().as_secs_f64() });
                }
            });
        }
    });
    let mut measured = measured.into_iter().map(|m| m.into_inner().unwrap_or_default());
    let study = |study: &Study| {
        let runs: Vec<Measured> = measured.by_ref().take(study.levels.len()).collect();
        let problems: Vec<String> = runs
            .iter()
            .zip(&study.levels)
            .filter_map(|(run, level)| run.problem.as_ref().map(|p| format!("{}: {p}", level.label)))
            .collect();
        let values: Vec<Vec<f64>> = (0..study.quantities.len())
            .map(|q| runs.iter().map(|r| r.values.get(q).copied().unwrap_or(f64::NAN)).collect())
            .collect();
        let curve = runs.into_iter().last().unwrap_or_default().curve;
        StudyResult::new(study, &values, &problems, curve)
    };
    let mut study = study;
    sections
        .iter()
        .map(|s| {
            let studies = s.studies.iter().map(&mut study).collect();
            SectionResult::new(s, studies)
        })
        .collect()
}

fn take<'a, T>(work: &'a [T], next: &AtomicUsize) -> Option<(usize, &'a T)> {
    let i = next.fetch_add(1, Ordering::Relaxed);
    work.get(i).map(|w| (i, w))
}

fn one(study: &Study, level: &Level) -> Measured {
    match outcome(study, level) {
        Err(problem) => Measured { problem: Some(problem), ..Measured::default() },
        Ok(outcome) => Measured {
            values: study.quantities.iter().map(|q| (q.measure)(&outcome)).collect(),
            curve: study.curve.as_ref().map_or_else(Vec::new, |c| c(&outcome)),
            problem: problem(&outcome),
        },
    }
}

fn outcome(study: &Study, level: &Level) -> Result<Outcome, String> {
    if study.scene.is_empty() {
        return Ok(Outcome::default());
    }
    let settings: Vec<(String, String)> = study.settings.iter().chain(&level.settings).cloned().collect();
    scene(study.scene, &settings)
}

/// Runs a scene of `scenes/validation/` with values set in it.
pub(crate) fn scene(name: &str, settings: &[(String, String)]) -> Result<Outcome, String> {
    let text = scene_text(name).ok_or_else(|| format!("there is no scene `{name}`"))?;
    let scene = Scene::parse_with(text, &format!("{name}.toml"), settings).map_err(|e| e.to_string())?;
    let mut runner = Runner::new(scene).map_err(|e| e.to_string())?;
    while !runner.step_frame().finished {}
    Ok(runner.finish())
}

/// What went wrong in a run, whatever it measured.
fn problem(outcome: &Outcome) -> Option<String> {
    let report = &outcome.report;
    let late = report.phases.iter().find(|p| ["out of time", "given up", "stopped"].contains(&p.ended_by.as_str()));
    if !report.passed
        && let Some(phase) = late
    {
        return Some(format!("phase `{}` ended by: {}", phase.name, phase.ended_by));
    }
    if let Some(check) = report.checks.iter().find(|c| !c.passed) {
        return Some(format!("check `{}` failed", check.name));
    }
    report.incidents.first().map(|i| format!("incident at {:.4} s: {}", i.first_s, i.message))
}
