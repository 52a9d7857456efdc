//! Scenes of a generator by the thousand, half of them sensible, half absurd. None may panic, hang, give a number that
//! is not finite or let a thread pass through something without saying so; each gives the same bits when it is split by
//! snapshot and restore and when what it consists of is inserted in another order; where nothing does work from
//! outside, energy does not grow.

use anyhow::Context as _;
use clap::Args;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Duration;
use sutura_generated::make::numbered;
use sutura_generated::play::{Seen, watch};
use sutura_generated::{Player, Scene};

use crate::case::seconds;
use crate::pool::{self, Ended};
use crate::session::quantile;

/// What is asked for.
#[derive(Args, Debug, Clone)]
pub struct Robustness {
    /// How many scenes
    #[arg(long, default_value_t = 10_000)]
    pub scenes: u64,
    /// Number of the first one, to run them in parts
    #[arg(long, default_value_t = 0)]
    pub first: u64,
    /// Seed of all of them
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Only the scene of this number: say what it is and how it goes
    #[arg(long, value_name = "NUMBER")]
    pub only: Option<u64>,
    /// With `--only`: write what is done to its world here, for `sutura replay`
    #[arg(long, value_name = "FILE", requires = "only")]
    pub record: Option<PathBuf>,
    /// Scenes at a time
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    pub jobs: u16,
    /// Time after which a scene hangs: `60s`, `5min`
    #[arg(long, default_value = "5min", value_parser = seconds)]
    pub limit: f64,
}

/// Plays a scene in all ways.
fn examine(name: &str, scene: &Scene) -> Seen {
    let mut seen = watch(scene, name != "absurd");
    if seen.fault.is_some() || (seen.refused > 0 && seen.frames == 0) {
        return seen;
    }
    let other = Scene { other_order: !scene.other_order, ..scene.clone() };
    let split = Player::new(&other, false).and_then(|p| p.play_split(|frame| frame % 3 == 1));
    match split.map(|p| p.world.state_hash()) {
        Ok(hash) if hash == seen.hash => {}
        Ok(hash) => {
            seen.fault =
                Some(format!("inserted in another order and split by snapshots: {hash:016x} for {:016x}", seen.hash));
        }
        Err(e) => seen.fault = Some(format!("its own snapshot: {e}")),
    }
    seen
}

/// Sums over the scenes of a kind.
#[derive(Default)]
struct Sums {
    scenes: u64,
    frames: u64,
    substeps: u64,
    rejected: u64,
    refused: u64,
    incidents: BTreeMap<&'static str, u64>,
    /// Scenes with an incident.
    with_incident: u64,
    /// Most growth of energy in a step, of scenes of first and of second order.
    growth: [Vec<f64>; 2],
}

#[derive(Default)]
struct Found {
    sums: BTreeMap<&'static str, Sums>,
    panics: Vec<u64>,
    hangs: Vec<u64>,
    faults: Vec<(u64, String)>,
    /// Number and growth of the scene whose energy grew most.
    worst: (u64, f64, f64),
}

impl Robustness {
    /// Plays them; false when something was not as it must be.
    pub fn run(&self) -> anyhow::Result<bool> {
        if let Some(number) = self.only {
            return self.one(number);
        }
        let (seed, mut found) = (self.seed, Found::default());
        let numbers = self.first..self.first.saturating_add(self.scenes);
        let examine = move |number| {
            let (name, scene) = numbered(seed, number);
            examine(name, &scene)
        };
        pool::play(numbers, self.jobs, Duration::from_secs_f64(self.limit), examine, |number, ended| {
            let (name, scene) = numbered(seed, number);
            found.take(number, name, scene.settings.integrator == sutura::Integrator::TrBdf2, ended)
        });
        print!("{}", found.table(self.seed));
        Ok(found.panics.is_empty() && found.hangs.is_empty() && found.faults.is_empty())
    }

    fn one(&self, number: u64) -> anyhow::Result<bool> {
        let (name, scene) = numbered(self.seed, number);
        println!("{name}: {scene:#?}");
        if let Some(path) = &self.record {
            // What was done until a panic is the panic's own message; what is written is of a scene that comes to its
            // end.
            let player = Player::new(&scene, true)?.play();
            let bytes = player.world.recording().map(sutura::input::Recording::to_bytes).unwrap_or_default();
            std::fs::write(path, bytes).with_context(|| format!("cannot write {}", path.display()))?;
        }
        let seen = examine(name, &scene);
        println!("{seen:#?}");
        Ok(seen.fault.is_none())
    }
}

impl Found {
    /// Takes note of a scene; a line to print where something is wrong.
    fn take(&mut self, number: u64, name: &'static str, second_order: bool, ended: Ended<Seen>) -> Option<String> {
        let seen = match ended {
            Ended::Well(seen) => seen,
            Ended::Panicked => {
                self.panics.push(number);
                return Some(format!("scene {number} ({name}) panicked"));
            }
            Ended::Hung => {
                self.hangs.push(number);
                return Some(format!("scene {number} ({name}) hangs"));
            }
        };
        let sums = self.sums.entry(name).or_default();
        sums.scenes += 1;
        sums.frames += seen.frames;
        sums.substeps += seen.substeps;
        sums.rejected += seen.rejected;
        sums.refused += seen.refused;
        sums.with_incident += u64::from(!seen.incidents.is_empty());
        for (kind, n) in &seen.incidents {
            *sums.incidents.entry(kind).or_default() += n;
        }
        if matches!(name, "free passive" | "touching") {
            sums.growth[usize::from(second_order)].push(seen.growth);
            if seen.growth > self.worst.1 {
                self.worst = (number, seen.growth, seen.growth_time);
            }
        }
        let fault = seen.fault?;
        let line = format!("scene {number} ({name}): {fault}");
        self.faults.push((number, fault));
        Some(line)
    }

    fn table(&self, seed: u64) -> String {
        let mut out = String::from(
            "| scenes | number | frames | substeps | rejected | refused | with an incident | incidents |\n|---|---|---|---|---|---|---|---|\n",
        );
        for (name, s) in &self.sums {
            let incidents: Vec<String> = s.incidents.iter().map(|(kind, n)| format!("{kind} {n}")).collect();
            let incidents = if incidents.is_empty() { "none".into() } else { incidents.join(", ") };
            out += &format!(
                "| {name} | {} | {} | {} | {} | {} | {} | {incidents} |\n",
                s.scenes, s.frames, s.substeps, s.rejected, s.refused, s.with_incident
            );
        }
        out.push('\n');
        for (name, s) in &self.sums {
            for (growth, order) in
                s.growth.iter().zip(["implicit Euler", "second order"]).filter(|(g, _)| !g.is_empty())
            {
                let q = |part: f64| quantile(growth, part);
                out += &format!(
                    "energy of {name}, {order}, most growth in a step: median {:.1e}, 99 % {:.1e}, most {:.1e}\n",
                    q(0.5),
                    q(0.99),
                    q(1.0)
                );
            }
        }
        out += &format!("most of all in scene {} at {:.4} s\n", self.worst.0, self.worst.2);
        out += &format!(
            "{} panics, {} hangs, {} other faults; seed {seed}\n",
            self.panics.len(),
            self.hangs.len(),
            self.faults.len()
        );
        for number in self.panics.iter().chain(&self.hangs).chain(self.faults.iter().map(|(n, _)| n)) {
            out += &format!("again: studies robustness --seed {seed} --only {number}\n");
        }
        out
    }
}
