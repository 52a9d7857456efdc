//! A world being stepped under the eyes of the audit, its work counted, within a budget.

use crate::case::Budget;
use cpu_time::ThreadTime;
use std::collections::BTreeMap;
use sutura::audit::Audit;
use sutura::{IncidentKind, World};
use sutura_generated::play::kind;

/// A world and what was seen of it.
pub struct Session {
    /// The world.
    pub world: World,
    /// What passed through what, and how near things came, over every accepted substep.
    pub audit: Audit,
    /// Solver time of each frame \[ms\].
    pub ms: Vec<f64>,
    /// Substeps accepted.
    pub substeps: u64,
    /// Substeps thrown away.
    pub rejected: u64,
    /// Newton iterations.
    pub newton: u64,
    /// Number of incidents.
    pub incidents: u64,
    /// The same by kind.
    pub kinds: BTreeMap<&'static str, u64>,
    /// The first of them in words, with its time.
    pub first_incident: String,
    /// Largest |strain - T / EA| of an element at the end of a frame, with the tension that the solver carries.
    pub strain_error: f64,
    budget: Budget,
    started: ThreadTime,
    /// Frames in succession that the solver could not finish.
    stuck: u32,
}

/// Frames in succession without an acceptable substep after which a case is given up.
const STUCK: u32 = 30;

impl Session {
    /// Begins; the budget counts from here, on this thread of execution.
    pub fn new(world: World, budget: Budget) -> Self {
        let mut audit = Audit::new();
        // What is passed in the first substep is passed from where it began.
        audit.observe(world.view());
        Session {
            world,
            audit,
            ms: Vec::new(),
            substeps: 0,
            rejected: 0,
            newton: 0,
            incidents: 0,
            kinds: BTreeMap::new(),
            first_incident: String::new(),
            strain_error: 0.0,
            budget,
            started: ThreadTime::now(),
            stuck: 0,
        }
    }

    /// Advances by one frame of `dt` \[s\]. The error says why it is not worth going on, or that the budget is spent.
    pub fn frame(&mut self, dt: f64) -> Result<(), String> {
        let Session { world, audit, .. } = self;
        let began = ThreadTime::now();
        let mut watching = 0.0;
        let report = world.step_with(dt, &mut |view| {
            let t = ThreadTime::now();
            audit.observe(view);
            watching += t.elapsed().as_secs_f64();
        });
        self.ms.push((began.elapsed().as_secs_f64() - watching) * 1e3);
        self.substeps += u64::from(report.substeps);
        self.rejected += u64::from(report.rejected);
        self.newton += u64::from(report.newton_iterations);
        self.strain_error = self.strain_error.max(report.length_error);
        self.incidents += report.incidents.len() as u64;
        for incident in &report.incidents {
            *self.kinds.entry(kind(&incident.kind)).or_default() += 1;
        }
        if let (true, Some(i)) = (self.first_incident.is_empty(), report.incidents.first()) {
            self.first_incident = format!("{:.4} s: {}", i.time, i.kind);
        }
        let stuck = report.incidents.iter().any(|i| matches!(i.kind, IncidentKind::Stuck { .. }));
        self.stuck = if stuck { self.stuck + 1 } else { 0 };
        if self.stuck >= STUCK {
            return Err(format!("stuck for {STUCK} frames"));
        }
        if self.ms.len() as u64 >= u64::from(self.budget.frames) {
            return Err(format!("over {} frames", self.budget.frames));
        }
        if self.started.elapsed().as_secs_f64() > self.budget.cpu_s {
            return Err(format!("over {} s of CPU time", self.budget.cpu_s));
        }
        Ok(())
    }

    /// Solver time of all frames \[s\].
    pub fn solver_s(&self) -> f64 {
        self.ms.iter().sum::<f64>() / 1e3
    }

    /// The worst frame \[ms\].
    pub fn worst(&self) -> f64 {
        self.ms.iter().copied().fold(0.0, f64::max)
    }

    /// Incidents by kind in words.
    pub fn incidents_in_words(&self) -> String {
        let kinds: Vec<String> = self.kinds.iter().map(|(kind, n)| format!("{kind} {n}")).collect();
        if kinds.is_empty() { "none".into() } else { kinds.join(", ") }
    }

    /// Largest strain of an element over every accepted substep.
    pub fn strain(&self) -> f64 {
        self.audit.report().max_elongation.iter().map(|e| e.1).fold(0.0, f64::max)
    }

    /// Least clearance of thread from thread in diameters, as text; empty when nothing came near.
    pub fn clearance(&self) -> String {
        self.audit.report().thread_clearance.map(|c| format!("{c:.4}")).unwrap_or_default()
    }

    /// Passages through anything seen until this time, and after it.
    pub fn passes(&self, time: f64) -> (usize, usize) {
        let all = &self.audit.report().crossings;
        let until = all.iter().filter(|c| c.time <= time).count();
        (until, all.len() - until)
    }
}

/// The value under which this part of the numbers lies; zero when there are none.
pub fn quantile(numbers: &[f64], part: f64) -> f64 {
    let mut sorted = numbers.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(((sorted.len().max(1) - 1) as f64 * part).round() as usize).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sutura::Settings;

    #[test]
    fn a_budget_of_frames_ends_a_session() {
        let mut s = Session::new(World::new(Settings::default()).unwrap(), Budget { cpu_s: 1e3, frames: 3 });
        assert_eq!((s.frame(0.01), s.frame(0.01)), (Ok(()), Ok(())));
        assert_eq!(s.frame(0.01), Err("over 3 frames".into()));
        assert!((s.world.time() - 0.03).abs() < 1e-12);
    }

    #[test]
    fn a_budget_of_time_ends_a_session() {
        let mut s = Session::new(World::new(Settings::default()).unwrap(), Budget { cpu_s: 1e-9, frames: 1000 });
        assert!(s.frame(0.01).unwrap_err().contains("CPU"));
    }

    #[test]
    fn quantiles_of_a_few_numbers() {
        let v = [3.0, 1.0, 2.0];
        assert_eq!((quantile(&v, 0.5), quantile(&v, 0.99), quantile(&[], 0.5)), (2.0, 3.0, 0.0));
    }
}
