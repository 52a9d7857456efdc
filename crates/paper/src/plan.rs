//! Runs experiments side by side. What they find does not depend on how many run at once, nor on their order.

use crate::outcome::Outcome;
use std::any::Any;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// An experiment of the paper.
pub struct Experiment {
    /// Its name on the command line: `fig8`.
    pub name: &'static str,
    /// What it is about.
    pub title: &'static str,
    /// The figures that it stands for, as published.
    pub figures: &'static str,
    pub(crate) plan: fn() -> Plan,
}

/// An experiment with what it found.
pub struct Result {
    /// Its name.
    pub name: &'static str,
    /// Its title.
    pub title: &'static str,
    /// The published figures.
    pub figures: &'static str,
    /// What was found.
    pub outcome: Outcome,
    /// CPU-seconds, roughly: of all its cases.
    pub seconds: f64,
}

/// How far it is.
pub struct Progress {
    /// Cases done.
    pub done: usize,
    /// Cases in all.
    pub total: usize,
    /// What was just done.
    pub name: String,
    /// How long it took \[s\].
    pub seconds: f64,
}

type Answer = Box<dyn Any + Send>;

/// Cases that do not depend on each other, and what is made of their answers.
pub(crate) struct Plan {
    cases: Vec<Case>,
    finish: Box<dyn FnOnce(Vec<Answer>) -> Outcome>,
}

struct Case {
    label: String,
    run: Box<dyn Fn() -> Answer + Send + Sync>,
}

impl Plan {
    /// Runs `run` on each of the cases; `finish` gets cases and answers in their order.
    pub fn new<C, A>(
        cases: Vec<C>,
        label: impl Fn(&C) -> String,
        run: impl Fn(&C) -> A + Clone + Send + Sync + 'static,
        finish: impl FnOnce(&[(C, A)]) -> Outcome + 'static,
    ) -> Plan
    where
        C: Clone + Send + Sync + 'static,
        A: Send + 'static,
    {
        let case = |c: &C| {
            let (own, run) = (c.clone(), run.clone());
            Case { label: label(c), run: Box::new(move || Box::new(run(&own))) }
        };
        let boxed = cases.iter().map(case).collect();
        let finish = move |answers: Vec<Answer>| {
            let answers = answers.into_iter().map(|a| *a.downcast::<A>().expect("answers are made by `run`"));
            let found: Vec<(C, A)> = cases.into_iter().zip(answers).collect();
            finish(&found)
        };
        Plan { cases: boxed, finish: Box::new(finish) }
    }
    /// Both plans, as one experiment: what each finds, one after the other.
    pub fn and(self, other: Plan) -> Plan {
        let n = self.cases.len();
        let mut cases = self.cases;
        cases.extend(other.cases);
        let finish = move |mut answers: Vec<Answer>| {
            let later = answers.split_off(n);
            let (mut first, second) = ((self.finish)(answers), (other.finish)(later));
            first.add(second);
            first
        };
        Plan { cases, finish: Box::new(finish) }
    }
}

impl Outcome {
    fn add(&mut self, other: Outcome) {
        self.say(other.text);
        self.compare.extend(other.compare);
        self.checks.extend(other.checks);
        self.tables.extend(other.tables);
        self.plots.extend(other.plots);
        self.grids.extend(other.grids);
        self.pictures.extend(other.pictures);
    }
}

/// Runs the experiments on `jobs` threads; `tell` hears of each case as it is done.
pub fn run(experiments: &[Experiment], jobs: usize, tell: &(dyn Fn(&Progress) + Sync)) -> Vec<Result> {
    let plans: Vec<Plan> = experiments.iter().map(|e| (e.plan)()).collect();
    let work: Vec<(&str, &Case)> =
        experiments.iter().zip(&plans).flat_map(|(e, plan)| plan.cases.iter().map(|c| (e.name, c))).collect();
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let answers: Vec<Mutex<Option<(Answer, f64)>>> = work.iter().map(|_| Mutex::default()).collect();
    std::thread::scope(|scope| {
        for _ in 0..jobs.max(1) {
            scope.spawn(|| {
                while let Some((i, (name, case))) = take(&work, &next) {
                    let clock = Instant::now();
                    let answer = (case.run)();
                    let seconds = clock.elapsed().as_secs_f64();
                    if let Ok(mut slot) = answers[i].lock() {
                        *slot = Some((answer, seconds));
                    }
                    let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                    tell(&Progress { done, total: work.len(), name: format!("{name}: {}", case.label), seconds });
                }
            });
        }
    });
    drop(work);
    let mut answers = answers.into_iter().map(|a| a.into_inner().ok().flatten().expect("each case was run"));
    let mut results = Vec::new();
    for (e, plan) in experiments.iter().zip(plans) {
        let (own, seconds): (Vec<Answer>, Vec<f64>) = answers.by_ref().take(plan.cases.len()).unzip();
        results.push(Result {
            name: e.name,
            title: e.title,
            figures: e.figures,
            outcome: (plan.finish)(own),
            seconds: seconds.iter().sum(),
        });
    }
    results
}

fn take<'a, T>(work: &'a [T], next: &AtomicUsize) -> Option<(usize, &'a T)> {
    let i = next.fetch_add(1, Ordering::Relaxed);
    work.get(i).map(|w| (i, w))
}
