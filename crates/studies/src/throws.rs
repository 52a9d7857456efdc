//! Thousands of throws of thread at, over, through and into shapes, fixed, driven and pushed
//! ([`sutura_generated::throw`]). Each begins free of overlap and has a way to go on, so no thread may pass through
//! anything, no incident may arise, and all of its time must be simulated.

use anyhow::Context as _;
use clap::Args;
use cpu_time::ThreadTime;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::time::Duration;
use sutura::audit::{Audit, Closest, Crossing, Pair};
use sutura::{Incident, View};
use sutura_generated::Player;
use sutura_generated::play::{energy, kind};
use sutura_generated::throw::{FAMILIES, Throw, numbered};

use crate::case::seconds;
use crate::pool::{self, Ended};
use crate::session::quantile;
use crate::table::markdown;

/// What is asked for.
#[derive(Args, Debug, Clone)]
pub struct Throws {
    /// How many throws
    #[arg(long, default_value_t = 10_000)]
    pub count: u64,
    /// Number of the first one, to run them in parts
    #[arg(long, default_value_t = 0)]
    pub first: u64,
    /// Seed of all of them
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Only the throw of this number: say what it is and how it goes, frame by frame
    #[arg(long, value_name = "NUMBER")]
    pub only: Option<u64>,
    /// With `--only`: write what is done to its world here, for `sutura replay`
    #[arg(long, value_name = "FILE", requires = "only")]
    pub record: Option<PathBuf>,
    /// Throws at a time
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    pub jobs: u16,
    /// CPU time after which a throw is given up, looked at after each frame: `5s`, `1min`
    #[arg(long, default_value = "10s", value_parser = seconds)]
    pub budget: f64,
    /// Time after which a throw hangs
    #[arg(long, default_value = "5min", value_parser = seconds)]
    pub limit: f64,
    /// Say of each throw that fails how it does
    #[arg(long, short)]
    pub verbose: bool,
}

/// What was seen of a throw.
#[derive(Debug, Clone, Default)]
pub struct Seen {
    /// Elements and shapes, or elements and elements, that passed each other.
    pub passages: usize,
    /// The first of them.
    pub first_passage: Option<Crossing>,
    /// Incidents by kind.
    pub incidents: BTreeMap<&'static str, u64>,
    /// The first of them.
    pub first_incident: Option<Incident>,
    /// Whether anything touched.
    pub met: bool,
    /// Refused by the engine when it was built.
    pub refused: u32,
    /// Time simulated and planned \[s\].
    pub time: [f64; 2],
    /// Least clearance between threads, and of thread and shape.
    pub closest: [Option<Closest>; 2],
    /// Where nothing does work from outside: the most by which energy was above its start, over what was turned over.
    pub gain: Option<f64>,
    /// Substeps accepted and thrown away, Newton iterations.
    pub work: [u64; 3],
    /// CPU time of the solver in all frames and in the worst one \[ms\].
    pub cpu: f64,
    /// See `cpu`.
    pub worst: f64,
}

/// Part of the energy turned over by which it may be above its start, that of contacts pressed in and of lengths within
/// the tolerance.
pub const GAIN: f64 = 0.02;

/// Clearance under which things have touched: some is kept between them.
const TOUCHES: f64 = 0.02;

impl Seen {
    /// Least clearance of all.
    pub fn clearance(&self) -> Option<f64> {
        self.closest.iter().flatten().map(|c| c.clearance).reduce(f64::min)
    }
    /// Whether all of the time was simulated.
    pub fn finished(&self) -> bool {
        self.time[0] >= self.time[1] * (1.0 - 1e-9)
    }
    /// What must not be, in words.
    pub fn fault(&self) -> Option<String> {
        let mut faults = Vec::new();
        if let Some(c) = self.first_passage {
            faults.push(format!("{} passages, the first at {:.5} s: {:?}", self.passages, c.time, c.what));
        }
        if let Some(i) = &self.first_incident {
            let counts: Vec<String> = self.incidents.iter().map(|(k, n)| format!("{k} {n}")).collect();
            faults.push(format!("incidents ({}), the first at {:.5} s: {}", counts.join(", "), i.time, i.kind));
        }
        if self.refused > 0 {
            faults.push(format!("{} refused", self.refused));
        }
        if !self.finished() {
            faults.push(format!("{:.4} of {:.4} s simulated", self.time[0], self.time[1]));
        }
        if let Some(gain) = self.gain.filter(|g| *g > GAIN) {
            faults.push(format!("energy grew by {gain:.3} of what was turned over"));
        }
        (!faults.is_empty()).then(|| faults.join("; "))
    }
}

/// Energy of a throw from when nothing does work from outside any more.
#[derive(Default)]
struct Turnover {
    start: Option<(f64, f64)>,
    most: f64,
    above: f64,
}

impl Turnover {
    fn observe(&mut self, throw: &Throw, loads_end: bool, view: View<'_>) {
        let mut scene = throw.scene.clone();
        if loads_end {
            scene.loads.clear();
        }
        let (own, potential) = energy(&scene, view);
        let (own_before, potential_before) = *self.start.get_or_insert((own, potential));
        // What contact moves a resting thread by to keep its distance is no turnover.
        let settles: f64 = view.rods().map(|r| r.mass_per_length(0) * r.rest_length() * 9.81 * r.radius()).sum();
        self.most = self.most.max(own).max((potential - potential_before).abs()).max(settles);
        self.above = self.above.max(own + potential - own_before - potential_before);
    }
    fn gain(&self) -> f64 {
        if self.most > 0.0 { self.above / self.most } else { 0.0 }
    }
}

/// Plays a throw within this CPU time \[s\]; `trace` hears of every frame.
pub fn examine(throw: &Throw, budget: f64, trace: &mut dyn FnMut(String)) -> Seen {
    let scene = &throw.scene;
    let mut seen = Seen { time: [0.0, scene.frame * f64::from(scene.frames)], ..Seen::default() };
    let Ok(mut player) = Player::new(scene, false) else {
        seen.refused = 1;
        return seen;
    };
    let mut audit = Audit::new();
    audit.observe(player.world.view());
    let mut turnover = Turnover::default();
    let mut frame = 0;
    while !player.is_over() && seen.cpu < 1e3 * budget {
        if throw.passive_from == Some(frame) {
            turnover.observe(throw, frame > 0, player.world.view());
        }
        let (began, mut watching) = (ThreadTime::now(), 0.0);
        let report = player.step(&mut |view| {
            let t = ThreadTime::now();
            audit.observe(view);
            watching += t.elapsed().as_secs_f64();
        });
        let ms = 1e3 * (began.elapsed().as_secs_f64() - watching);
        seen.cpu += ms;
        seen.worst = seen.worst.max(ms);
        if throw.passive_from.is_some_and(|from| from <= frame) {
            turnover.observe(throw, throw.passive_from > Some(0), player.world.view());
        }
        frame += 1;
        for (sum, n) in seen.work.iter_mut().zip([report.substeps, report.rejected, report.newton_iterations]) {
            *sum += u64::from(n);
        }
        seen.met |= report.contacts > 0;
        for incident in &report.incidents {
            *seen.incidents.entry(kind(&incident.kind)).or_default() += 1;
            seen.first_incident.get_or_insert_with(|| incident.clone());
        }
        trace(format!(
            "{:.5} s: {ms:.1} ms, {} substeps, {} rejected, {} Newton iterations, {} contacts, clearance of threads {:.4?}, of shapes {:.4?}, {} passages{}",
            report.time,
            report.substeps,
            report.rejected,
            report.newton_iterations,
            report.contacts,
            report.thread_clearance,
            report.shape_clearance,
            audit.report().crossings.len(),
            report.incidents.iter().map(|i| format!("; {:.5} s: {}", i.time, i.kind)).collect::<String>()
        ));
    }
    // The clock stands still where a substep finds no way, and time lost is not made up.
    seen.time[0] = player.world.time();
    let report = audit.report();
    let place = |what: Pair| match what {
        Pair::Threads { a, b } => (a, b),
        Pair::Shape { thread, shape } => (thread, (usize::MAX, shape)),
    };
    seen.passages = report.crossings.iter().map(|c| place(c.what)).collect::<BTreeSet<_>>().len();
    seen.first_passage = report.crossings.first().copied();
    seen.closest = [report.thread_closest, report.shape_closest];
    seen.met |= seen.clearance().is_some_and(|c| c < TOUCHES);
    seen.gain = throw.passive_from.map(|_| turnover.gain());
    seen.refused = player.refused;
    seen
}

/// Sums over the throws of a family.
#[derive(Default)]
struct Sums {
    throws: u64,
    met: u64,
    failed: u64,
    passed: u64,
    passages: usize,
    with_incident: u64,
    incidents: BTreeMap<&'static str, u64>,
    unfinished: u64,
    /// Simulated time that is missing and that was planned \[s\].
    missing: f64,
    planned: f64,
    gained: u64,
    clearance: f64,
    cpu: Vec<f64>,
    worst: (f64, u64),
}

impl Sums {
    fn take(&mut self, number: u64, seen: &Seen) {
        self.throws += 1;
        self.met += u64::from(seen.met);
        self.failed += u64::from(seen.fault().is_some());
        self.passed += u64::from(seen.passages > 0);
        self.passages += seen.passages;
        self.with_incident += u64::from(!seen.incidents.is_empty());
        for (kind, n) in &seen.incidents {
            *self.incidents.entry(kind).or_default() += n;
        }
        self.unfinished += u64::from(!seen.finished());
        self.missing += (seen.time[1] - seen.time[0]).max(0.0);
        self.planned += seen.time[1];
        self.gained += u64::from(seen.gain.is_some_and(|g| g > GAIN));
        self.clearance = self.clearance.min(seen.clearance().unwrap_or(0.0));
        self.cpu.push(seen.cpu);
        if seen.worst > self.worst.0 {
            self.worst = (seen.worst, number);
        }
    }

    fn row(&self, name: &str) -> Vec<String> {
        let incidents: Vec<String> = self.incidents.iter().map(|(kind, n)| format!("{kind} {n}")).collect();
        let q = |part: f64| quantile(&self.cpu, part);
        vec![
            name.into(),
            self.throws.to_string(),
            self.met.to_string(),
            self.failed.to_string(),
            self.passed.to_string(),
            self.passages.to_string(),
            self.with_incident.to_string(),
            if incidents.is_empty() { "none".into() } else { incidents.join(", ") },
            self.unfinished.to_string(),
            format!("{:.1}", 100.0 * self.missing / self.planned.max(f64::MIN_POSITIVE)),
            self.gained.to_string(),
            format!("{:.3}", self.clearance),
            format!("{:.1}", self.cpu.iter().sum::<f64>() / self.cpu.len().max(1) as f64),
            format!("{:.1}", q(0.5)),
            format!("{:.0}", q(0.99)),
            format!("{:.0} ({})", self.worst.0, self.worst.1),
        ]
    }
}

const COLUMNS: [&str; 16] = [
    "what",
    "throws",
    "touching",
    "failed",
    "with passages",
    "passages",
    "with incidents",
    "incidents",
    "unfinished",
    "time missing %",
    "energy grew",
    "least clearance",
    "CPU ms",
    "median",
    "99 %",
    "worst frame ms (throw)",
];

#[derive(Default)]
struct Found {
    families: BTreeMap<&'static str, Sums>,
    ways: BTreeMap<&'static str, Sums>,
    all: Sums,
    /// Numbers of the throws that failed, with passages, and others.
    passed: Vec<u64>,
    others: Vec<u64>,
    panics: Vec<u64>,
    hangs: Vec<u64>,
}

impl Throws {
    /// Plays them; false when something was not as it must be.
    pub fn run(&self) -> anyhow::Result<bool> {
        if let Some(number) = self.only {
            return self.one(number);
        }
        let (seed, budget, mut found) = (self.seed, self.budget, Found::default());
        let play = move |number| {
            let throw = numbered(seed, number);
            (throw.family.name(), throw.how.name(), examine(&throw, budget, &mut |_| {}))
        };
        let numbers = self.first..self.first.saturating_add(self.count);
        pool::play(numbers, self.jobs, Duration::from_secs_f64(self.limit), play, |number, ended| {
            found.take(number, ended).filter(|_| self.verbose)
        });
        print!("{}", found.table(self.seed));
        Ok(found.is_clean())
    }

    fn one(&self, number: u64) -> anyhow::Result<bool> {
        let throw = numbered(self.seed, number);
        println!("{throw:#?}");
        if let Some(path) = &self.record {
            let player = Player::new(&throw.scene, true)?.play();
            let bytes = player.world.recording().map(sutura::input::Recording::to_bytes).unwrap_or_default();
            std::fs::write(path, bytes).with_context(|| format!("cannot write {}", path.display()))?;
        }
        let seen = examine(&throw, self.budget, &mut |line| println!("{line}"));
        println!(
            "{seen:#?}\n{} {}: {}",
            throw.family.name(),
            throw.how.name(),
            seen.fault().unwrap_or_else(|| "as it must be".into())
        );
        Ok(seen.fault().is_none())
    }
}

impl Found {
    /// Takes note of a throw; a line where something is wrong.
    fn take(&mut self, number: u64, ended: Ended<(&'static str, &'static str, Seen)>) -> Option<String> {
        let (family, how, seen) = match ended {
            Ended::Well(seen) => seen,
            Ended::Panicked => {
                self.panics.push(number);
                return Some(format!("throw {number} panicked"));
            }
            Ended::Hung => {
                self.hangs.push(number);
                return Some(format!("throw {number} hangs"));
            }
        };
        self.families.entry(family).or_default().take(number, &seen);
        self.ways.entry(how).or_default().take(number, &seen);
        self.all.take(number, &seen);
        let fault = seen.fault()?;
        if seen.passages > 0 { &mut self.passed } else { &mut self.others }.push(number);
        Some(format!("throw {number} ({family}, {how}): {fault}"))
    }

    fn is_clean(&self) -> bool {
        [&self.passed, &self.others, &self.panics, &self.hangs].iter().all(|v| v.is_empty())
    }

    fn table(&self, seed: u64) -> String {
        let families = FAMILIES.iter().filter_map(|f| Some(self.families.get(f.name())?.row(f.name())));
        let ways = self.ways.iter().map(|(name, sums)| sums.row(name));
        let mut out = markdown(&COLUMNS, families.chain(ways).chain([self.all.row("all")]));
        out += &format!("{} panics, {} hangs; seed {seed}\n", self.panics.len(), self.hangs.len());
        for (what, numbers) in [
            ("panicked", &self.panics),
            ("hangs", &self.hangs),
            ("passes through", &self.passed),
            ("fails otherwise", &self.others),
        ] {
            let mut numbers = numbers.clone();
            numbers.sort_unstable();
            for number in numbers.iter().take(MOST_NAMED) {
                out += &format!("{what}: studies throws --seed {seed} --only {number}\n");
            }
            if numbers.len() > MOST_NAMED {
                out += &format!("{what}: and {} more\n", numbers.len() - MOST_NAMED);
            }
        }
        out
    }
}

/// Throws of each kind of failure that are named.
const MOST_NAMED: usize = 12;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_throw_is_the_same_whenever_it_is_drawn() {
        for number in 0..FAMILIES.len() as u64 {
            let (a, b) = (numbered(3, number), numbered(3, number));
            assert_eq!(format!("{a:?}"), format!("{b:?}"));
            assert_eq!(a.family, FAMILIES[number as usize]);
        }
    }

    #[test]
    fn throws_begin_free_of_overlap_by_the_audit() {
        for number in 0..260 {
            let throw = numbered(7, number);
            let player = Player::new(&throw.scene, false).unwrap();
            assert_eq!(player.refused, 0, "{number}");
            let mut audit = Audit::new();
            audit.observe(player.world.view());
            let report = audit.report();
            assert!(!report.passes_through, "{number}");
            for clearance in [report.thread_clearance, report.shape_clearance].into_iter().flatten() {
                assert!(clearance > 0.0, "{number}: {clearance}");
            }
        }
    }
}
