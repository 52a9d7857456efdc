//! Steps a scene frame by frame: phases, motions, probes, checks, recording.
//!
//! Probes, checks and the recording look at the ends of frames, whose times are regular. The condition of `until` is
//! judged after every substep, since much can happen in a frame: where it comes true the phase ends, and what is left
//! of the frame is done under the next one.

use crate::error::SceneError;
use crate::expr::Expr;
use crate::report::{
    Clearance, FrameTimes, IncidentReport, KnotReport, Outcome, OverlapReport, PhaseReport, Report, SavedState, Series,
    SolverReport, ThreadReport, WarningReport, WorkReport,
};
use crate::scene::{End, Late, MOST_FRAMES, Moment, Mover, Scene};
use crate::stage::{FrameReport, Stage, lesser};
use crate::trajectory::{
    Contact, Forces, Frame, Header, OnThread, Shape, ShapeOutline, Thread, ThreadLook, Touched, Trajectory,
};
use crate::watch::{Check, Probe, profile};
use cpu_time::ThreadTime;
use std::mem::discriminant;
use std::time::Duration;
use sutura::glam::{DQuat, DVec3};
use sutura::input::{Recorder, Recording};
use sutura::{Grip, Handle, Incident, IncidentKind, Overlap, OverlapWith, Pose, Rod, RodView, World};

/// A scene being run.
pub struct Runner {
    scene: Scene,
    stage: Stage,
    /// World time at which the scene began \[s\] (a saved state has its own).
    world_start: f64,
    frame: u64,
    phase: usize,
    /// Whether the phase began within a frame, where a condition ended the one before.
    phase_within: bool,
    /// Probes that the condition of the phase reads, in order: each may name those before it.
    asked: Vec<usize>,
    finished: bool,
    /// Whether a phase that must not ran out of time.
    late: bool,
    probes: Vec<Probe>,
    profiles: Vec<Series>,
    /// Profiles still to be read, by their number in the scene.
    profiles_open: Vec<usize>,
    checks: Vec<Check>,
    frames: Series,
    trajectory: Trajectory,
    saved: Vec<SavedState>,
    phases: Vec<PhaseReport>,
    incidents: Vec<(IncidentKey, IncidentReport)>,
    warnings: Vec<WarningReport>,
    overlaps: Vec<OverlapReport>,
    notes: Vec<String>,
    /// Time that was not simulated \[s\].
    missed: f64,
    work: WorkReport,
    max_elongation: Vec<f64>,
    max_tension: Vec<f64>,
    /// Solver time of each frame \[s\].
    cpu: Vec<f64>,
    /// Frames in a row in which no good substep was found.
    stuck: u32,
    /// Most work of a call that simulates a frame, and what was done of a frame that it left unfinished.
    most_work: Option<f64>,
    under_way: Option<UnderWay>,
    /// Solver time of the last call \[s\].
    last_cpu: f64,
}

/// A frame that was left unfinished.
struct UnderWay {
    report: FrameReport,
    /// Time of it that is done \[s\].
    done: f64,
    cpu: Duration,
    stuck: bool,
}

type IncidentKey = Option<std::mem::Discriminant<IncidentKind>>;

/// How far a run is.
#[derive(Debug, Clone, PartialEq)]
pub struct Progress {
    /// Frames done.
    pub frame: u64,
    /// Simulated time \[s\].
    pub time: f64,
    /// Part of the run done, in \[0, 1\]; an estimate while conditions may end phases early.
    pub fraction: f64,
    /// Name of the phase under way (the last one when finished).
    pub phase: String,
    /// Solver time of this call \[ms\].
    pub ms: f64,
    /// True where the frame is not finished, since the call had spent its work ([`Runner::limit_work`]): the next call
    /// goes on with it.
    pub cut: bool,
    /// Whether the run is over; further calls do nothing.
    pub finished: bool,
}

/// Part of a run that may have passed without being simulated.
const MOST_MISSED: f64 = 0.1;

/// Frames without a good substep after which a run is given up.
const GIVE_UP: u32 = 30;

impl Runner {
    /// Builds the world of a scene.
    pub fn new(scene: Scene) -> Result<Runner, SceneError> {
        Self::build(scene, false)
    }
    /// The same, and what is done to the world is recorded, with the state hash after each step (whose time counts as
    /// the solver's).
    pub fn recording(scene: Scene) -> Result<Runner, SceneError> {
        Self::build(scene, true)
    }

    fn build(scene: Scene, record: bool) -> Result<Runner, SceneError> {
        let stage = Stage::new(&scene, record)?;
        let n = scene.threads.len();
        let columns = [
            ("time", "s"),
            ("ms", "ms"),
            ("max_tension", "N"),
            ("max_elongation", ""),
            ("clearance", "diameters"),
            ("thread_clearance", "diameters"),
            ("shape_clearance", "diameters"),
            ("energy", "J"),
            ("kinetic", "J"),
            ("stretch", "J"),
            ("bend", "J"),
            ("twist", "J"),
            ("gravity", "J"),
            ("substeps", ""),
            ("rejected", ""),
            ("newton", ""),
            ("contacts", ""),
            ("work", ""),
        ];
        let mut runner = Runner {
            world_start: stage.world.time(),
            frame: 0,
            phase: 0,
            phase_within: false,
            asked: Vec::new(),
            finished: false,
            late: false,
            probes: scene.probes.iter().map(Probe::new).collect(),
            profiles: Vec::new(),
            profiles_open: (0..scene.profiles.len()).collect(),
            checks: scene.checks.iter().map(Check::new).collect(),
            frames: Series {
                name: "frame".into(),
                columns: columns.map(|(n, u)| (n.to_owned(), u.to_owned())).to_vec(),
                rows: Vec::new(),
            },
            trajectory: Trajectory::default(),
            saved: Vec::new(),
            phases: Vec::new(),
            incidents: Vec::new(),
            warnings: Vec::new(),
            overlaps: Vec::new(),
            notes: Vec::new(),
            missed: 0.0,
            work: WorkReport { converged: true, ..WorkReport::default() },
            max_elongation: vec![0.0; n],
            max_tension: vec![f64::NEG_INFINITY; n],
            cpu: Vec::new(),
            stuck: 0,
            most_work: None,
            under_way: None,
            last_cpu: 0.0,
            scene,
            stage,
        };
        runner.trajectory.header = runner.header();
        for (def, handle) in runner.scene.shapes.iter().zip(&runner.stage.shapes) {
            let notes = runner.stage.world.shape_notes(*handle).unwrap_or_default();
            runner.notes.extend(notes.iter().map(|note| format!("mesh `{}`: {note} ({})", def.name, def.location)));
        }
        for overlap in runner.stage.world.overlaps() {
            runner.overlap(&overlap);
        }
        // The audit sweeps from the first state on.
        let Runner { stage, .. } = &mut runner;
        stage.judge.observe(stage.world.view());
        runner.begin_phase()?;
        runner.look();
        runner.record();
        Ok(runner)
    }

    /// Limits the work of each call that simulates a frame, in the counts of
    /// [`StepReport::work`](sutura::StepReport::work). Where it is spent the call returns, with the last substep that
    /// was accepted, and the next call goes on with the frame: slow motion, but no call that takes long. It is counted,
    /// so a recording of the input plays it back as it was.
    pub fn limit_work(&mut self, most: Option<f64>) {
        self.most_work = most;
    }

    /// Simulates one frame, or what there is of the last one where a condition ends the run within it. Does nothing
    /// once the run is finished.
    pub fn step_frame(&mut self) -> Progress {
        self.step_frame_with(&mut |_, _| {})
    }

    /// The same with a hand from outside: before each piece of the frame `drive` gets the world and the part of the
    /// frame that will be done with that piece. What it does is recorded like everything else. What the scene moves
    /// itself is to be lent before ([`Runner::lend`]).
    pub fn step_frame_with(&mut self, drive: &mut dyn FnMut(&mut Recorder, f64)) -> Progress {
        if !self.finished {
            let Some((report, cpu, stuck)) = self.simulate(drive) else { return self.progress() };
            self.frame += 1;
            if !self.finished {
                self.stage.time = self.frame as f64 / self.scene.frame_rate;
            }
            self.stage.moment_passed();
            self.take_note(&report, cpu);
            self.warn();
            self.look();
            self.stuck = if stuck { self.stuck + 1 } else { 0 };
            if self.stuck >= GIVE_UP {
                self.give_up(format!("given up: {GIVE_UP} frames in a row found no acceptable substep"));
            } else if !self.finished {
                self.end_phase_when_due();
                if !self.finished && self.frame as f64 >= MOST_FRAMES {
                    self.give_up(format!("given up after {MOST_FRAMES:e} frames"));
                }
            }
            if self.finished || self.frame.is_multiple_of(self.scene.record_every) {
                self.record();
            }
        }
        self.progress()
    }

    /// A frame of the world after the run is over, for hands from outside. Nothing of it is in the report; what went
    /// wrong comes back.
    pub fn step_beyond(&mut self, drive: &mut dyn FnMut(&mut Recorder, f64)) -> Vec<Incident> {
        let dt = 1.0 / self.scene.frame_rate;
        let pieces = self.pieces(dt);
        let mut incidents = Vec::new();
        for k in 1..=pieces {
            drive(&mut self.stage.world, f64::from(k) / f64::from(pieces));
            self.allow(self.most_work.map(|most| most / f64::from(pieces)));
            if let Err(e) = self.stage.bring_back(self.stage.time, dt / f64::from(pieces)) {
                self.incident(None, e.to_string());
            }
            let step = self.stage.world.step(dt / f64::from(pieces));
            if step.cut {
                self.stage.not_passed(dt / f64::from(pieces) - step.simulated);
            }
            incidents.extend(step.incidents);
        }
        incidents
    }

    /// Somebody else moves this from here on, as a hand that takes it over: it stands still until they do, and the
    /// scene's own motion of it goes on without it. Whether there is such a thing now.
    pub fn lend(&mut self, what: Mover) -> bool {
        let lent = self.stage.lend(what);
        lent.unwrap_or_else(|e| {
            self.incident(None, e.to_string());
            false
        })
    }
    /// They move it no longer: it stays there until it is given back, or until the scene begins another motion of it.
    pub fn leave(&mut self, what: Mover) {
        if let Err(e) = self.stage.leave(what) {
            self.incident(None, e.to_string());
        }
    }
    /// It goes back to where the scene has it, smoothly and no faster than `speed` \[m/s\] beside what the scene moves
    /// it by.
    pub fn give_back(&mut self, what: Mover, speed: f64) {
        if let Err(e) = self.stage.give_back(what, speed) {
            self.incident(None, e.to_string());
        }
    }
    /// What the scene does not have: in another hand, left by it, or on its way back.
    pub fn lent(&self) -> impl Iterator<Item = Mover> {
        self.stage.lent()
    }

    fn give_up(&mut self, why: String) {
        self.incident(None, why);
        self.end_phase("given up", false);
        (self.late, self.finished) = (true, true);
    }

    /// Pieces in which a frame, or what is left of it, is done: what moves is sampled at every substep, so that its
    /// path does not depend on the frame rate, and a condition is judged after each.
    fn pieces(&self, dt: f64) -> u32 {
        let substep = self.stage.world.settings().substep;
        if self.stage.is_driven() || self.condition().is_some() {
            (dt / substep - 1e-9).ceil().clamp(1.0, 10_000.0) as u32
        } else {
            1
        }
    }

    /// Steps the world through one frame, or the rest of it; its report, the solver's CPU time \[s\], and whether it
    /// was stuck. None where the work is spent before.
    fn simulate(&mut self, drive: &mut dyn FnMut(&mut Recorder, f64)) -> Option<(FrameReport, f64, bool)> {
        let dt = 1.0 / self.scene.frame_rate;
        let begin = self.frame as f64 * dt;
        let fresh = || UnderWay {
            report: FrameReport { converged: true, ..FrameReport::default() },
            done: 0.0,
            cpu: Duration::ZERO,
            stuck: false,
        };
        let UnderWay { mut report, done: begun, mut cpu, mut stuck } = self.under_way.take().unwrap_or_else(fresh);
        let (before_call, work_before) = (cpu, self.stage.world.work_done());
        // Work of the piece before, in this call.
        let mut last_piece = 0.0;
        // Of the frame this was done before, or under phases that ended in it; the rest is done in pieces.
        let (mut done, mut pieces, mut k) = (begun, self.pieces(dt - begun), 0);
        while k < pieces {
            k += 1;
            let (rest, part) = (dt - done, f64::from(k) / f64::from(pieces));
            let (at, piece) = (begin + done + rest * f64::from(k) / f64::from(pieces), rest / f64::from(pieces));
            let begin_piece = done + rest * f64::from(k - 1) / f64::from(pieces);
            if let Some(most) = self.most_work {
                let left = most - (self.stage.world.work_done() - work_before);
                // Rather less than what would be thrown away. A piece that is begun may take half of all, for what it
                // needs then is no chance.
                if left < last_piece && begin_piece > begun {
                    self.last_cpu = (cpu - before_call).as_secs_f64();
                    self.under_way = Some(UnderWay { report, done: begin_piece, cpu, stuck });
                    return None;
                }
                self.allow(Some(left.max(0.5 * most)));
            } else {
                self.allow(None);
            }
            // A frame that was begun before has less time left: what is led goes no faster for that.
            drive(
                &mut self.stage.world,
                if k == pieces && begun <= 0.0 { 1.0 } else { (done - begun + rest * part) / dt },
            );
            let moved = self.stage.drive(at);
            if let Err(e) = moved.and(self.stage.bring_back(at, piece)) {
                self.incident(None, e.to_string());
            }
            let Stage { world, judge, .. } = &mut self.stage;
            let mut audited = Duration::ZERO;
            let clock = ThreadTime::now();
            let step = if judge.is_active() {
                world.step_with(piece, &mut |view| {
                    let clock = ThreadTime::now();
                    judge.observe(view);
                    audited += clock.elapsed();
                })
            } else {
                world.step(piece)
            };
            cpu += clock.elapsed().saturating_sub(audited);
            report.add(&step);
            last_piece = step.work;
            report.wanted += if step.cut { step.simulated } else { piece };
            for incident in &step.incidents {
                if let IncidentKind::Overlap(overlap) = &incident.kind {
                    let message = self.overlap(overlap);
                    self.incident(None, message);
                    continue;
                }
                stuck |= matches!(incident.kind, IncidentKind::Stuck { .. } | IncidentKind::NotFinite);
                self.stage.incidents += 1;
                self.incident(Some(&incident.kind), incident.kind.to_string());
            }
            if step.cut {
                let now = begin_piece + step.simulated;
                self.stage.not_passed(piece - step.simulated);
                self.last_cpu = (cpu - before_call).as_secs_f64();
                self.under_way = Some(UnderWay { report, done: now, cpu, stuck });
                return None;
            }
            // At the end of the frame the condition has its turn after probes and checks.
            if k < pieces && self.condition_ends_phase(at, piece, &report) {
                if self.finished {
                    break;
                }
                done += rest * part;
                (pieces, k) = (self.pieces(dt - done), 0);
            }
        }
        self.last_cpu = (cpu - before_call).as_secs_f64();
        Some((report, cpu.as_secs_f64(), stuck))
    }

    /// Limits the work of the next step, or no longer.
    fn allow(&mut self, most: Option<f64>) {
        let most = most.map(|most| most.max(1.0));
        if most != self.stage.world.step_work()
            && let Err(e) = self.stage.world.set_step_work(most)
        {
            self.incident(None, e.to_string());
        }
    }

    /// The condition that the phase waits for, and the time before which it does not count \[s\].
    fn condition(&self) -> Option<(&Expr, f64)> {
        match &self.scene.phases.get(self.phase).filter(|_| !self.finished)?.end {
            End::When { condition: Some(condition), at_least, .. } => Some((condition, *at_least)),
            End::When { .. } | End::After(_) => None,
        }
    }

    /// Judges the condition of the phase within a frame, after a piece of it \[s\]; whether the phase ended. `report`
    /// is of the frame so far.
    fn condition_ends_phase(&mut self, time: f64, piece: f64, report: &FrameReport) -> bool {
        let Some((_, at_least)) = self.condition() else { return false };
        if time - self.stage.phase_begin + 0.5 * piece <= at_least {
            return false;
        }
        self.stage.time = time;
        self.stage.moment_passed();
        self.stage.see(report);
        for i in 0..self.asked.len() {
            self.read_probe(self.asked[i]);
        }
        if !self.condition().is_some_and(|(condition, _)| condition.holds(&self.stage)) {
            return false;
        }
        // What looks at the end of the phase may read all of them.
        (0..self.probes.len()).for_each(|i| self.read_probe(i));
        self.end_phase("condition", true);
        self.next_phase(true);
        true
    }

    /// The value of a probe for expressions that name it, not for its series.
    fn read_probe(&mut self, i: usize) {
        self.stage.probes[i] = self.probes[i].value(&self.stage);
    }

    /// Takes note of what lies in each other; in words.
    fn overlap(&mut self, o: &Overlap) -> String {
        let thread = |rod: Handle<Rod>| {
            let k = self.stage.threads.iter().position(|h| *h == rod);
            k.map_or_else(
                || (format!("thread {rod:?}"), None),
                |k| (self.scene.threads[k].name.clone(), Some(&self.scene.threads[k].location)),
            )
        };
        let shape = |shape: Handle<sutura::Shape>| {
            let k = self.stage.shapes.iter().position(|h| *h == shape);
            k.map_or_else(
                || (format!("shape {shape:?}"), None),
                |k| (self.scene.shapes[k].name.clone(), Some(&self.scene.shapes[k].location)),
            )
        };
        let mm = |v: f64| format!("{:.3}", 1e3 * v + 0.0);
        let (name, mut places) =
            (thread(o.rod).0, thread(o.rod).1.map(ToString::to_string).into_iter().collect::<Vec<_>>());
        let (with, with_arc) = match o.with {
            OverlapWith::Rod { rod, arc } => (thread(rod), Some(arc)),
            OverlapWith::Shape(handle) => (shape(handle), None),
        };
        let itself = matches!(o.with, OverlapWith::Rod { rod, .. } if rod == o.rod);
        places.extend(with.1.map(ToString::to_string).filter(|_| !itself));
        let other = if itself { "itself".into() } else { format!("`{}`", with.0) };
        let at = with_arc.map_or_else(String::new, |arc| format!(" at {} mm", mm(arc)));
        let [x, y, z] = o.point.to_array().map(mm);
        let message = format!(
            "`{name}` at {} mm {} {other}{at}, {} mm ({:.2} diameters) deep, at ({x}, {y}, {z}) mm ({})",
            mm(o.arc),
            o.verb(),
            mm(o.depth),
            o.diameters,
            places.join("; ")
        );
        let report = OverlapReport {
            message: message.clone(),
            time_s: self.stage.time,
            thread: name,
            arc_m: o.arc,
            with: with.0,
            with_arc_m: with_arc,
            point_m: o.point.to_array(),
            depth_m: o.depth,
            depth_diameters: o.diameters,
            through: o.through,
        };
        // The first step says once more what was so at the start.
        if self.overlaps.iter().all(|known| known.message != report.message) {
            self.overlaps.push(report);
        }
        message
    }

    fn incident(&mut self, kind: Option<&IncidentKind>, message: String) {
        let (key, time) = (kind.map(discriminant), self.stage.time);
        if kind.is_none() {
            self.stage.incidents += 1;
        }
        match self.incidents.iter_mut().find(|(k, r)| *k == key && (key.is_some() || r.message == message)) {
            Some((_, r)) => {
                r.count += 1;
                r.last_s = time;
            }
            None => self.incidents.push((key, IncidentReport { message, count: 1, first_s: time, last_s: time })),
        }
    }

    /// Sums up a frame.
    fn take_note(&mut self, report: &FrameReport, cpu: f64) {
        self.cpu.push(cpu);
        let missed = report.wanted - report.simulated;
        // Sums of the same pieces, but for rounding.
        self.missed += if missed > 1e-9 * report.wanted { missed } else { 0.0 };
        let work = &mut self.work;
        work.substeps += u64::from(report.substeps);
        work.rejected += u64::from(report.rejected);
        work.newton_iterations += u64::from(report.newton_iterations);
        work.converged &= report.converged;
        work.max_residual = work.max_residual.max(report.residual);
        work.max_length_error = work.max_length_error.max(report.length_error);
        work.max_contacts = work.max_contacts.max(report.contacts);
        self.stage.see(report);
        let mut energy = sutura::Energy::default();
        // Without a thread there is no tension.
        let (mut tension, mut elongation) = (f64::NAN, 0.0_f64);
        for (i, rod) in self.stage.rods().enumerate() {
            let (t, e, own) = (rod.max_tension(), rod.max_elongation(), rod.energy());
            self.max_tension[i] = self.max_tension[i].max(t);
            self.max_elongation[i] = self.max_elongation[i].max(e);
            (tension, elongation) = (tension.max(t), elongation.max(e));
            energy.kinetic += own.kinetic;
            energy.stretch += own.stretch;
            energy.bend += own.bend;
            energy.twist += own.twist;
            energy.gravity += own.gravity;
        }
        for body in self.stage.bodies() {
            let own = body.energy();
            energy.kinetic += own.kinetic;
            energy.gravity += own.gravity;
        }
        let missing = |v: Option<f64>| v.unwrap_or(f64::NAN);
        self.frames.rows.push(vec![
            self.stage.time,
            cpu * 1e3,
            tension,
            elongation,
            missing(report.clearance()),
            missing(report.thread_clearance),
            missing(report.shape_clearance),
            energy.total(),
            energy.kinetic,
            energy.stretch,
            energy.bend,
            energy.twist,
            energy.gravity,
            f64::from(report.substeps),
            f64::from(report.rejected),
            f64::from(report.newton_iterations),
            f64::from(report.contacts),
            report.work,
        ]);
    }

    /// Warns of the first tension in each thread past its knot-pull strength.
    fn warn(&mut self) {
        for (def, handle) in self.scene.threads.iter().zip(&self.stage.threads) {
            let (Some(strength), Ok(rod)) = (&def.strength, self.stage.world.rod(*handle)) else { continue };
            if self.warnings.iter().any(|w| w.thread == def.name) {
                continue;
            }
            let element = (0..rod.n_elements()).max_by(|a, b| rod.tension(*a).total_cmp(&rod.tension(*b)));
            let Some((element, tension)) = element.map(|j| (j, rod.tension(j))).filter(|e| e.1 > strength.value) else {
                continue;
            };
            let (time_s, arc_m) = (self.stage.time, rod.arc(element) + 0.5 * rod.rest_lengths()[element]);
            let message = format!(
                "`{}`: the tension passes the knot-pull strength of {} N ({}): {tension:.3} N at {:.2} mm; a thread with a knot may break there, here it does not",
                def.name,
                strength.value,
                strength.of,
                1e3 * arc_m
            );
            self.warnings.push(WarningReport {
                message,
                thread: def.name.clone(),
                time_s,
                arc_m,
                tension_n: tension,
                strength_n: strength.value,
            });
        }
    }

    /// Reads probes and checks at the present state.
    fn look(&mut self) {
        let time = self.stage.time;
        for (i, probe) in self.probes.iter_mut().enumerate() {
            let value = probe.read(&self.stage, time);
            self.stage.probes[i] = value;
        }
        for check in &mut self.checks {
            check.look(&self.stage, time, self.phase);
        }
        self.read_profiles(|m| matches!(m, Moment::Time(t) if time + 5e-7 >= t));
    }

    fn read_profiles(&mut self, due: impl Fn(Moment) -> bool) {
        let (now, later): (Vec<usize>, Vec<usize>) =
            self.profiles_open.iter().partition(|i| due(self.scene.profiles[**i].moment));
        self.profiles_open = later;
        for i in now {
            self.profiles.push(profile(&self.scene.profiles[i], &self.stage));
        }
    }

    // ---- phases ----

    /// Begins the phase at hand and every following one that ends at once.
    fn begin_phase(&mut self) -> Result<(), SceneError> {
        self.asked = self.condition().map_or_else(Vec::new, |(condition, _)| self.probes_of(condition));
        let Some(phase) = self.scene.phases.get(self.phase) else {
            self.finished = true;
            return Ok(());
        };
        self.stage.phase_begin = self.stage.time;
        for step in &phase.actions {
            self.stage.apply(step)?;
        }
        let time = self.stage.time;
        self.phases.push(PhaseReport {
            name: phase.name.clone(),
            start_s: time,
            end_s: time,
            ended_by: String::new(),
            knots: Vec::new(),
            still: phase.still,
        });
        Ok(())
    }

    /// The probes that an expression reads, and those that they read.
    fn probes_of(&self, expression: &Expr) -> Vec<usize> {
        let mut found = Vec::new();
        expression.probes(&mut found);
        let mut k = 0;
        while k < found.len() {
            self.scene.probes[found[k]].what.probes(&mut found);
            k += 1;
        }
        found.sort_unstable();
        found
    }

    fn end_phase_when_due(&mut self) {
        let Some(phase) = self.scene.phases.get(self.phase) else { return };
        // Times are whole frames; rounding must not cost or add one. After a phase that ended within a frame it goes
        // up, so that motions come to their ends.
        let (time, frame) = (self.stage.time - self.stage.phase_begin, 1.0 / self.scene.frame_rate);
        let slack = if self.phase_within { 1e-6 * frame } else { 0.5 * frame };
        let ended = match &phase.end {
            End::After(d) => (time + slack > *d).then_some("duration"),
            End::When { condition, at_least, at_most, late } => {
                let holds = match condition {
                    Some(c) => c.holds(&self.stage),
                    None => self.stage.is_done(),
                };
                // As it is judged after the other substeps.
                let slack =
                    if condition.is_some() { 0.5 * self.stage.world.settings().substep.min(frame) } else { slack };
                if holds && time + slack > *at_least {
                    Some(if condition.is_some() { "condition" } else { "motions done" })
                } else if time + slack > *at_most {
                    self.late |= *late != Late::Accept;
                    self.finished |= *late == Late::Stop;
                    Some("out of time")
                } else {
                    None
                }
            }
        };
        let Some(reason) = ended else { return };
        self.end_phase(reason, false);
        if !self.finished {
            self.next_phase(false);
        }
    }

    /// `within`: a frame, not at its end.
    fn next_phase(&mut self, within: bool) {
        self.phase += 1;
        self.phase_within = within;
        if let Err(e) = self.begin_phase() {
            for problem in e.problems {
                self.incident(None, problem.to_string());
            }
            (self.late, self.finished) = (true, true);
        }
    }

    fn end_phase(&mut self, reason: &str, within: bool) {
        let Some(phase) = self.scene.phases.get(self.phase) else { return };
        let (index, time) = (self.phase, self.stage.time);
        for check in &mut self.checks {
            check.phase_ended(&self.stage, time, index, within);
        }
        let knots = phase.knots.iter().map(|t| (self.scene.threads[*t].name.clone(), self.stage.knot(*t))).collect();
        if let Some(name) = &phase.save {
            self.saved.push(SavedState { name: name.clone(), bytes: self.stage.save() });
        }
        if let Some(last) = self.phases.last_mut() {
            (last.end_s, last.ended_by, last.knots) = (time, reason.into(), knots);
        }
        self.read_profiles(|m| m == Moment::PhaseEnd(index));
    }

    fn progress(&self) -> Progress {
        let longest: Vec<f64> = self.scene.phases.iter().map(|p| p.longest().max(1e-9)).collect();
        let total: f64 = longest.iter().sum();
        let done: f64 = longest.iter().take(self.phase).sum();
        let here = longest.get(self.phase).map_or(0.0, |l| (self.stage.time - self.stage.phase_begin).min(*l));
        let phase = &self.scene.phases[self.phase.min(self.scene.phases.len() - 1)];
        Progress {
            frame: self.frame,
            time: self
                .under_way
                .as_ref()
                .map_or(self.stage.time, |u| self.frame as f64 / self.scene.frame_rate + u.done),
            fraction: if self.finished { 1.0 } else { (done + here) / total },
            phase: phase.name.clone(),
            ms: self.last_cpu * 1e3,
            cut: self.under_way.is_some(),
            finished: self.finished,
        }
    }

    /// Why the run does not pass, whatever its checks say.
    fn failures(&self) -> Vec<String> {
        let mut failures = Vec::new();
        let through = self.overlaps.iter().filter(|o| o.through).count();
        if through > 0 {
            failures.push(format!(
                "threads were put through each other or into shapes at {through} place{}",
                if through == 1 { "" } else { "s" }
            ));
        } else if !self.overlaps.is_empty() && !self.stage.world.overlaps().is_empty() {
            failures.push("what was put into each other lies in each other still".into());
        }
        let total = self.stage.time;
        if self.missed > MOST_MISSED * total {
            let simulated = (total - self.missed).max(0.0);
            failures.push(format!(
                "of {total:.4} s only {simulated:.4} s were simulated: no acceptable substep was found for the rest"
            ));
        }
        failures
    }

    /// What lies in each other, so far: at the start, and put there since.
    pub fn overlaps(&self) -> &[OverlapReport] {
        &self.overlaps
    }
    /// What was mended of meshes, and what of them may not have been meant.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }
    /// The warnings so far.
    pub fn warnings(&self) -> &[WarningReport] {
        &self.warnings
    }
    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }
    /// The world as it is now.
    pub fn world(&self) -> &World {
        &self.stage.world
    }
    /// The world, for what is done to it from outside the scene between frames.
    pub fn edit(&mut self) -> &mut Recorder {
        &mut self.stage.world
    }
    /// What was done to the world so far, where it is recorded.
    pub fn recording_so_far(&self) -> Option<&Recording> {
        self.stage.world.recording()
    }
    /// What went wrong so far.
    pub fn incidents(&self) -> impl Iterator<Item = &IncidentReport> {
        self.incidents.iter().map(|(_, report)| report)
    }
    /// The threads that are there with their names; one that is cut off comes after them.
    pub fn threads(&self) -> impl Iterator<Item = (&str, Handle<Rod>)> {
        self.scene.threads.iter().map(|t| t.name.as_str()).zip(self.stage.threads.iter().copied())
    }
    /// The free bodies with their names; their solids are among the shapes.
    pub fn bodies(&self) -> impl Iterator<Item = (&str, Handle<sutura::Body>)> {
        self.scene.bodies.iter().map(|b| b.name.as_str()).zip(self.stage.bodies.iter().copied())
    }
    /// The shapes with their names.
    pub fn shapes(&self) -> impl Iterator<Item = (&str, Handle<sutura::Shape>)> {
        self.scene.shapes.iter().map(|s| s.name.as_str()).zip(self.stage.shapes.iter().copied())
    }
    /// The grips with their names; `None` while they do not hold.
    pub fn grips(&self) -> impl Iterator<Item = (&str, Option<Handle<Grip>>)> {
        self.scene.grips.iter().enumerate().map(|(i, name)| (name.as_str(), self.stage.grip(i)))
    }
    /// The knot in which a thread (by its number in the scene) is tied now; it is recognized once a frame.
    pub fn knot(&self, thread: usize) -> KnotReport {
        self.stage.knot(thread)
    }
    /// How far it is.
    pub fn now(&self) -> Progress {
        self.progress()
    }

    /// The threads in the order of the scene.
    pub fn rods(&self) -> impl Iterator<Item = RodView<'_>> {
        self.stage.rods()
    }
    /// Where the shapes are, in the order of the scene.
    pub fn shape_poses(&self) -> impl Iterator<Item = Pose> {
        (0..self.scene.shapes.len()).map(|i| self.stage.shape_pose(i))
    }

    /// Simulated time since the scene began \[s\].
    pub fn time(&self) -> f64 {
        self.stage.time
    }

    // ---- recording ----

    /// What the recording holds (for drawing while it runs): of the threads those that are there. A thread that is cut
    /// off comes after them.
    pub fn header(&self) -> Header {
        let thread = |(k, (t, r)): (usize, (&crate::scene::ThreadDef, RodView<'_>))| {
            let (lengths, section, size) = (r.rest_lengths().to_vec(), r.cross_section().into(), r.size().0.clone());
            // What will be open is drawn with two ends from the beginning.
            let seam = r.seam_turn().filter(|_| !self.scene.cuts(Some(k)));
            let look = Some(ThreadLook { lengths, section, size, seam });
            Thread { name: t.name.clone(), radius: t.spec.radius, elements: r.n_elements(), look }
        };
        Header {
            scene: self.scene.name.clone(),
            version: env!("CARGO_PKG_VERSION").into(),
            frame_rate: self.scene.frame_rate,
            threads: self.scene.threads.iter().zip(self.stage.rods()).enumerate().map(thread).collect(),
            shapes: self
                .scene
                .shapes
                .iter()
                .map(|s| Shape { name: s.name.clone(), outline: ShapeOutline::from(&s.spec.geometry) })
                .collect(),
            grips: self.scene.grips.clone(),
        }
    }
    /// The world as a frame to draw.
    pub fn frame(&self) -> Frame {
        let v = |p: DVec3| p.as_vec3().to_array();
        let q = |q: DQuat| q.as_quat().to_array();
        Frame {
            time: self.stage.time,
            positions: self.stage.rods().map(|r| r.positions().iter().map(|p| v(*p)).collect()).collect(),
            orientations: self.stage.rods().map(|r| r.orientations().iter().map(|o| q(*o)).collect()).collect(),
            shapes: (0..self.scene.shapes.len())
                .map(|i| {
                    let pose = self.stage.shape_pose(i);
                    (v(pose.position), q(pose.orientation))
                })
                .collect(),
            grips: (0..self.scene.grips.len()).map(|i| self.stage.grip_pose(i).map(|p| v(p.position))).collect(),
            forces: Some(self.forces()),
        }
    }
    fn forces(&self) -> Forces {
        let stage = &self.stage;
        let v = |p: DVec3| p.as_vec3().to_array();
        // Things of the scene alone are in its world, so each has its number.
        let thread = |slot: usize| stage.threads.iter().position(|h| h.index() == slot).map(|i| i as u32);
        let shape = |slot: usize| stage.shapes.iter().position(|h| h.index() == slot).map(|i| i as u32);
        let on = |(slot, element, s): (usize, usize, f64)| {
            Some(OnThread { thread: thread(slot)?, element: element as u32, s: s as f32 })
        };
        let contact = |c: sutura::ContactView| {
            let with = match c.b.thread() {
                Some(place) => Touched::Thread(on(place)?),
                None => Touched::Shape(shape(c.b.shape()?)?),
            };
            Some(Contact {
                on: on(c.a.thread()?)?,
                with,
                point: v(c.point),
                normal: v(c.normal),
                force: v(c.force),
                sliding: c.sliding,
            })
        };
        let grip =
            |i: usize| stage.grip(i).and_then(|h| stage.world.grip_wrench(h).ok()).map_or([0.0; 3], |w| v(w.force));
        Forces {
            tensions: stage.rods().map(|r| (0..r.n_elements()).map(|e| r.tension(e) as f32).collect()).collect(),
            grips: (0..self.scene.grips.len()).map(grip).collect(),
            contacts: stage.world.contacts().filter_map(contact).collect(),
        }
    }
    fn record(&mut self) {
        let (mut frame, known) = (self.frame(), self.trajectory.header.threads.len());
        if frame.positions.len() > known {
            let now = self.header().threads;
            self.trajectory.header.threads.extend(now.into_iter().skip(known));
        }
        // A part is as long as it is.
        if !self.scene.cuts(None) {
            frame.fit(&self.trajectory.header);
        }
        self.trajectory.frames.push(frame);
    }

    // ---- the end ----

    /// Ends the run (early or not) and hands over what it found. A run that is ended early has not passed.
    pub fn finish(mut self) -> Outcome {
        if !self.finished {
            self.end_phase("stopped", false);
        }
        let time = self.stage.time;
        for check in &mut self.checks {
            check.run_ended(&self.stage, time);
        }
        self.read_profiles(|m| m == Moment::End);
        let threads = self.thread_reports();
        let solver = self.solver_report();
        let (thread_thread, thread_shape) = self.stage.clearances();
        let cpu_s: f64 = self.cpu.iter().sum();
        let simulated_s = (self.stage.world.time() - self.world_start - self.missed).max(0.0);
        let failures = self.failures();
        let passages = {
            let thread = |slot: usize| {
                self.stage
                    .threads
                    .iter()
                    .position(|h| h.index() == slot)
                    .map_or(format!("thread {slot}"), |i| self.scene.threads[i].name.clone())
            };
            let shape = |slot: usize| {
                self.stage
                    .shapes
                    .iter()
                    .position(|h| h.index() == slot)
                    .map_or(format!("shape {slot}"), |i| self.scene.shapes[i].name.clone())
            };
            self.stage.judge.passages(thread, shape, self.world_start)
        };
        let checks: Vec<_> = self.checks.into_iter().map(Check::finish).collect();
        let (mut probes, mut series) = (Vec::new(), vec![self.frames]);
        for probe in self.probes {
            let (reports, table) = probe.finish();
            probes.extend(reports);
            series.push(table);
        }
        series.extend(self.profiles);
        let report = Report {
            scene: self.scene.name.clone(),
            title: self.scene.title.clone(),
            version: env!("CARGO_PKG_VERSION").into(),
            solver,
            simulated_s,
            not_simulated_s: self.missed,
            cpu_s,
            real_time_factor: ratio(simulated_s, cpu_s),
            worst_second_real_time_factor: worst_second(&self.cpu, self.scene.frame_rate),
            ms_per_frame: frame_times(&self.cpu),
            frames: self.frame,
            threads,
            min_clearance: Clearance { thread_thread, thread_shape, least: lesser(thread_thread, thread_shape) },
            passes_through: self.stage.judge.passes_through(),
            passages,
            probes,
            finished: self.finished,
            passed: self.finished && checks.iter().all(|c| c.passed) && !self.late && failures.is_empty(),
            failures,
            checks,
            warnings: self.warnings,
            overlaps: self.overlaps,
            notes: self.notes,
            incidents: self.incidents.into_iter().map(|(_, r)| r).collect(),
            state_hash: format!("{:016x}", self.stage.world.state_hash()),
            work: self.work,
            phases: self.phases,
        };
        Outcome {
            report,
            series,
            trajectory: self.trajectory,
            saved: self.saved,
            input: self.stage.world.take_recording(),
        }
    }

    fn thread_reports(&self) -> Vec<ThreadReport> {
        let one = |(i, (def, handle)): (usize, (&crate::scene::ThreadDef, &Handle<Rod>))| {
            let rod = self.stage.world.rod(*handle).ok();
            let audited = self.stage.judge.max_elongation(handle.index());
            ThreadReport {
                name: def.name.clone(),
                elements: rod.map_or(0, |r| r.n_elements()),
                length_m: rod.map_or(0.0, |r| r.rest_length()),
                radius_m: def.spec.radius,
                max_elongation: audited.unwrap_or(0.0).max(self.max_elongation[i]),
                max_tension_n: if self.max_tension[i].is_finite() { self.max_tension[i] } else { 0.0 },
                knot: def.knot.then(|| self.stage.knot(i)),
            }
        };
        self.scene.threads.iter().zip(&self.stage.threads).enumerate().map(one).collect()
    }

    fn solver_report(&self) -> SolverReport {
        let s = self.stage.world.settings();
        SolverReport {
            name: if s.solver == sutura::Solver::Direct { "direct" } else { "paper" }.into(),
            frame_rate: self.scene.frame_rate,
            substep_s: s.substep,
            newton_max: s.newton_max,
            tolerance: s.tolerance,
            linear_damping: s.linear_damping,
            angular_damping: s.angular_damping,
            linear_drag: s.linear_drag,
            angular_drag: s.angular_drag,
            gravity: s.gravity.to_array(),
        }
    }
}

/// Simulated over CPU time; zero when nothing ran, since JSON has no infinity.
fn ratio(simulated: f64, cpu: f64) -> f64 {
    if cpu > 0.0 { simulated / cpu } else { 0.0 }
}

/// Least real-time factor over any second of frames, or over all when there are fewer.
fn worst_second(cpu: &[f64], frame_rate: f64) -> f64 {
    let n = (frame_rate.round() as usize).clamp(1, cpu.len().max(1));
    let worst = cpu.windows(n).map(|w| w.iter().sum::<f64>()).fold(0.0, f64::max);
    ratio(n as f64 / frame_rate, worst)
}

fn frame_times(cpu: &[f64]) -> FrameTimes {
    let mut ms: Vec<f64> = cpu.iter().map(|s| s * 1e3).collect();
    ms.sort_by(f64::total_cmp);
    // The nearest rank: the least value that at least this part of the frames does not exceed.
    let rank = |part: f64| ms.get(((part * ms.len() as f64).ceil() as usize).saturating_sub(1)).copied().unwrap_or(0.0);
    FrameTimes { median: rank(0.5), p99: rank(0.99), max: ms.last().copied().unwrap_or(0.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_of_frames() {
        let cpu: Vec<f64> = (1..=200).map(|i| f64::from(i) * 1e-3).collect();
        let t = frame_times(&cpu);
        assert!((t.median - 100.0).abs() < 1e-9 && (t.p99 - 198.0).abs() < 1e-9 && (t.max - 200.0).abs() < 1e-9);
        assert_eq!(frame_times(&[]), FrameTimes::default());
        // The last 60 frames take 10.23 s for one simulated second.
        let slowest: f64 = cpu[140..].iter().sum();
        assert!((worst_second(&cpu, 60.0) - 1.0 / slowest).abs() < 1e-12);
        assert!((worst_second(&cpu[..2], 60.0) - (2.0 / 60.0) / 3e-3).abs() < 1e-9);
    }
}
