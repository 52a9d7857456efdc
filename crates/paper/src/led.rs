//! A sample scene on Sutura's own solver, and the paper's solver led along the same way.
//!
//! The paper's solver knows no forces, so that it cannot draw an end until it pulls back with 2 N. What the hands do is
//! taken from the run of the other: which places of the thread are held, for which frames, and which way each goes;
//! also which way shapes go that a force moves. A grip takes hold of the thread where it then is, and makes the way
//! that it makes in the other run. Threads that do not stretch cannot go the way of threads that do: ends are set back
//! by as much as the thread is longer than at rest, or by more, so that what happens is not owed to a thread pulled
//! longer than it is.

use crate::measure::{EFFECTIVE, FRAME, length, mm, number, percent, sane};
use crate::outcome::{Cell, Panel, Picture, Solid, Table, Tube};
use cpu_time::ThreadTime;
use sutura::audit::Audit;
use sutura::glam::DVec3;
use sutura::knot::{self, Ends, Entries};
use sutura::{
    Geometry, Grip, GripSpec, Handle, Hold, IncidentKind, Material, PaperSettings, Place, Pose, RodSpec, RodView,
    Settings, ShapeMotion, ShapeSpec, Solver, View, World,
};
use sutura_scene::{Runner, Scene, samples};

/// Name of the last phase of these scenes, in which nothing is to move.
const LAST: &str = "hold";

/// Frames of it that the paper's solver goes through.
const HELD: usize = 180;
/// In place of the name of a phase: the frame before a run diverged.
const BEFORE: &str = "before it diverged";

/// A run of a sample scene, and what it leaves for others to follow.
pub struct Lead {
    /// How the grips of this scene hold.
    hold: Hold,
    settings: Settings,
    threads: Vec<Thread>,
    shapes: Vec<Geometry>,
    /// Where the shapes are at first.
    shape_poses: Vec<Pose>,
    /// In order of time: what is done in each frame of 1/60 s.
    frames: Vec<Hands>,
    /// Names of phases, and the frames after which they end.
    phases: Vec<(String, usize)>,
}

/// A thread as it lies at first: straight.
struct Thread {
    from: DVec3,
    to: DVec3,
    radius: f64,
}

/// What holds during a frame, and where it is at its end.
#[derive(Clone)]
struct Hands {
    grips: Vec<Held>,
    shapes: Vec<Pose>,
}

/// A place of a thread that is held.
#[derive(Clone, Copy, PartialEq)]
struct Held {
    /// Number of the grip in the scene.
    grip: usize,
    thread: usize,
    /// Rest arc length of the place \[m\].
    arc: f64,
    /// Where it was when taken.
    taken: DVec3,
    /// Where it is at the end of the frame.
    at: DVec3,
}

/// What a run shows.
pub struct Run {
    /// Who ran.
    pub name: String,
    /// Elements of all threads.
    pub elements: usize,
    /// At the end of each phase.
    pub shots: Vec<Shot>,
    /// Least clearance of thread from thread in diameters, and of thread from shape.
    pub clearance: [f64; 2],
    /// Passages seen, at most 256, and when the first was \[s\].
    pub passages: usize,
    pub first_passage: f64,
    /// Greatest elongation of a thread as a whole, and of an element.
    pub elongation: [f64; 2],
    /// Farthest way of a place from where it was when the last phase began \[m\].
    pub drift: f64,
    /// Change of the places at which the thread enters its knot in that phase \[m\].
    pub slip: f64,
    /// Contacts that carry force, or that pushed, at the end.
    pub contacts: u32,
    /// Part of the particles nearer than 1.05 diameters to another thread, at the end.
    pub touching: f64,
    /// When it was given up: a place of a thread lay farther away than ten lengths of it, or was no number \[s\].
    pub diverged: Option<f64>,
    /// CPU time of a frame \[ms\]: mean and median.
    pub ms: [f64; 2],
}

/// Everything at the end of a phase.
pub struct Shot {
    /// Name of the phase.
    pub phase: String,
    /// The threads, with their radius.
    pub threads: Vec<(Vec<DVec3>, f64)>,
    /// The shapes.
    pub shapes: Vec<(Geometry, Pose)>,
    /// What knot the first thread has, empty where none is looked for.
    pub knot: String,
}

/// How the paper's solver goes along a way.
#[derive(Clone, Copy)]
pub struct Pace {
    /// Steps in a frame of 1/60 s.
    pub steps: u32,
    /// Gravity over the scene's.
    pub gravity: f64,
    /// Phase at whose end friction begins, where the scene has none before.
    pub smooth_until: Option<&'static str>,
}

/// Seen from outside in the last phase, and over all.
#[derive(Default)]
struct Watch {
    begin: Option<(Vec<DVec3>, Option<Entries>)>,
    drift: f64,
    slip: f64,
    elongation: f64,
}

impl Watch {
    /// After a frame; `last` says whether the last phase has begun.
    fn look(&mut self, view: View<'_>, last: bool) {
        let points: Vec<DVec3> = view.rods().flat_map(|r| r.positions().iter().copied()).collect();
        let whole = |r: &RodView<'_>| length(r.positions()) / r.rest_length() - 1.0;
        self.elongation = view.rods().map(|r| whole(&r)).fold(self.elongation, f64::max);
        if !last {
            return;
        }
        let entries = view.rods().next().and_then(|r| knot::entries(r.positions(), r.rest_lengths(), r.radius()));
        let Some((before, entered)) = &self.begin else {
            self.begin = Some((points, entries));
            return;
        };
        self.drift = points.iter().zip(before).map(|(a, b)| a.distance(*b)).fold(self.drift, f64::max);
        self.slip = match (entered, entries) {
            (Some(then), Some(now)) => self.slip.max(now.slip_since(then)),
            _ => f64::NAN,
        };
    }
}

fn shot(view: View<'_>, phase: &str, tied: bool, held: bool) -> Shot {
    let knot = view
        .rods()
        .next()
        .filter(|r| tied && sane(r.positions(), r.rest_length()))
        .map_or_else(String::new, |r| which(&r, held));
    Shot {
        phase: phase.into(),
        threads: view.rods().map(|r| (r.positions().to_vec(), r.radius())).collect(),
        shapes: view.shapes().map(|s| (s.geometry.clone(), s.pose)).collect(),
        knot,
    }
}

/// The knot of a thread whose ends are held, or free.
fn which(rod: &RodView<'_>, held: bool) -> String {
    let points = rod.positions();
    let middle = points.iter().sum::<DVec3>() / points.len() as f64;
    let ends = if held {
        Ends::Held { start: points[0] - middle, end: points[points.len() - 1] - middle }
    } else {
        Ends::Free
    };
    knot::recognize(points, ends, 1).knot.name().to_string()
}

/// Part of the particles that are near another thread.
fn touching(view: View<'_>) -> f64 {
    if view.rods().count() < 2 {
        return f64::NAN;
    }
    let (mut near, mut all) = (0_usize, 0_usize);
    for rod in view.rods() {
        for p in rod.positions() {
            all += 1;
            let reach = 1.05 * 2.0 * rod.radius();
            let close = |a: DVec3, b: DVec3| {
                let t = ((*p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
                p.distance(a.lerp(b, t)) < reach
            };
            near += usize::from(
                view.rods()
                    .filter(|o| o.slot() != rod.slot())
                    .any(|o| o.positions().windows(2).any(|w| close(w[0], w[1]))),
            );
        }
    }
    near as f64 / all as f64
}

fn ms(mut frames: Vec<f64>) -> [f64; 2] {
    let mean = frames.iter().sum::<f64>() / frames.len() as f64;
    frames.sort_by(f64::total_cmp);
    [1e3 * mean, 1e3 * frames[frames.len() / 2]]
}

/// Runs a sample scene as it is. `hold` is how its grips hold; each end of a thread is led as far as `share` of its
/// stretch allows.
pub fn direct(name: &str, hold: Hold, share: f64) -> (Lead, Run) {
    let sample = samples().iter().find(|s| s.name == name).expect("it is a sample scene");
    let scene = Scene::parse(sample.text, name).expect("sample scenes are valid");
    assert!((scene.frame_rate() * FRAME - 1.0).abs() < 1e-12, "frames of 1/60 s");
    let mut runner = Runner::new(scene).expect("sample scenes are valid");
    let world = runner.world();
    let threads = world.view().rods().map(|r| (r.positions(), r.radius()));
    let mut lead = Lead {
        hold,
        settings: world.settings().clone(),
        threads: threads.map(|(p, radius)| Thread { from: p[0], to: p[p.len() - 1], radius }).collect(),
        shapes: world.view().shapes().map(|s| s.geometry.clone()).collect(),
        shape_poses: world.view().shapes().map(|s| s.pose).collect(),
        frames: Vec::new(),
        phases: Vec::new(),
    };
    let tied = world.view().rods().count() == 1;
    let elements = world.view().rods().map(|r| r.n_elements()).sum();
    let (mut watch, mut shots, mut cpu) = (Watch::default(), Vec::new(), Vec::new());
    let mut phase = String::new();
    let mut held = taken(&runner, &[], share);
    loop {
        let progress = runner.step_frame();
        cpu.push(1e-3 * progress.ms);
        // The first phase is longer than a frame.
        if phase.is_empty() {
            phase.clone_from(&progress.phase);
        }
        let view = runner.world().view();
        for h in &mut held {
            let rod = view.rods().nth(h.thread).expect("threads stay");
            h.at = set_back(&rod, place(&rod, h.arc), share);
        }
        lead.frames.push(Hands { grips: held.clone(), shapes: view.shapes().map(|s| s.pose).collect() });
        watch.look(view, progress.phase == LAST);
        if progress.phase != phase || progress.finished {
            let both = held
                .iter()
                .filter(|h| h.arc == 0.0 || h.arc > 0.999 * view.rods().next().map_or(0.0, |r| r.rest_length()))
                .count()
                >= 2;
            shots.push(shot(view, &phase, tied, both));
            lead.phases.push((std::mem::replace(&mut phase, progress.phase.clone()), lead.frames.len()));
        }
        if progress.finished {
            break;
        }
        held = taken(&runner, &held, share);
    }
    let (contacts, touching) = (runner.world().contacts().count() as u32, touching(runner.world().view()));
    let report = runner.finish().report;
    let number = |v: Option<f64>| v.unwrap_or(f64::NAN);
    let passage = report.passages.first().and_then(|p| p.split(' ').next()?.parse().ok());
    let run = Run {
        name: "direct".into(),
        elements,
        shots,
        clearance: [number(report.min_clearance.thread_thread), number(report.min_clearance.thread_shape)],
        passages: report.passages.len(),
        first_passage: number(passage),
        elongation: [watch.elongation, report.threads.iter().map(|t| t.max_elongation).fold(0.0, f64::max)],
        drift: watch.drift,
        slip: watch.slip,
        contacts,
        touching,
        diverged: None,
        ms: ms(cpu),
    };
    (lead, run)
}

/// Where a particle is; an end of a thread that is stretched is set back along it by `share` of what the thread is
/// longer than at rest.
fn set_back(rod: &RodView<'_>, i: usize, share: f64) -> DVec3 {
    let p = rod.positions();
    let neighbor = match i {
        0 => 1,
        _ if i == rod.n_elements() => i - 1,
        _ => return p[i],
    };
    p[i] + (p[neighbor] - p[i]).normalize() * (share * (length(p) - rod.rest_length()).max(0.0))
}

/// The particle at a rest arc length.
fn place(rod: &RodView<'_>, arc: f64) -> usize {
    let mut left = arc;
    for (i, l) in rod.rest_lengths().iter().enumerate() {
        if left < 0.5 * l {
            return i;
        }
        left -= l;
    }
    rod.n_elements()
}

/// What the grips of the scene hold now; `before` is what they held.
fn taken(runner: &Runner, before: &[Held], share: f64) -> Vec<Held> {
    let view = runner.world().view();
    let one = |(grip, at): (usize, Option<[f32; 3]>)| {
        let at = DVec3::from(at?.map(f64::from));
        // The pose of a grip is where its particle is.
        let all = view.rods().enumerate().flat_map(|(thread, rod)| {
            rod.positions().iter().enumerate().map(move |(i, p)| (p.distance(at), thread, i))
        });
        let (_, thread, i) = all.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let rod = view.rods().nth(thread)?;
        let (arc, at) = (rod.arc(i), set_back(&rod, i, share));
        let old = before.iter().find(|h| h.grip == grip && h.thread == thread && h.arc == arc);
        Some(Held { grip, thread, arc, taken: old.map_or(at, |o| o.taken), at })
    };
    runner.frame().grips.into_iter().enumerate().filter_map(one).collect()
}

/// Leads the paper's solver along the way of a run, until it diverges; through the first three seconds of its last
/// phase.
pub fn paper(lead: &Lead, name: &str, numbers: PaperSettings, pace: Pace) -> Run {
    let settings = Settings {
        solver: Solver::Paper(numbers),
        gravity: lead.settings.gravity * pace.gravity,
        substep: FRAME / f64::from(pace.steps) * (1.0 + 1e-9),
        ..lead.settings.clone()
    };
    const GOOD: &str = "what the scene has is valid";
    let mut world = World::new(settings).expect(GOOD);
    let mut elements = 0;
    let rods: Vec<_> = lead.threads.iter().map(|t| world.insert_rod(&spheres(t, &mut elements)).expect(GOOD)).collect();
    let shapes: Vec<_> = lead
        .shapes
        .iter()
        .zip(&lead.shape_poses)
        .map(|(geometry, pose)| {
            world
                .insert_shape(&ShapeSpec { motion: ShapeMotion::Driven, ..ShapeSpec::fixed(geometry.clone(), *pose) })
                .expect(GOOD)
        })
        .collect();
    let tied = rods.len() == 1;
    let mut grips: Vec<(Held, Handle<Grip>, Pose)> = Vec::new();
    let (mut watch, mut audit, mut shots, mut cpu) = (Watch::default(), Audit::new(), Vec::new(), Vec::new());
    let (mut contacts, mut diverged) = (0, None);
    let rough_from = pace.smooth_until.and_then(|name| Some(lead.phases.iter().find(|p| p.0 == name)?.1)).unwrap_or(0);
    let rub = |world: &mut World, friction: f64| {
        let solver = Solver::Paper(PaperSettings { friction, ..numbers });
        world.set_settings(Settings { solver, ..world.settings().clone() }).expect(GOOD);
    };
    if rough_from > 0 {
        rub(&mut world, 0.0);
    }
    audit.observe(world.view());
    let last_from = lead.phases.iter().rev().nth(1).map_or(0, |p| p.1);
    let end = lead.frames.len().min(last_from + HELD);
    let mut before = shot(world.view(), BEFORE, false, false);
    for (k, hands) in lead.frames.iter().take(end).enumerate() {
        if k == rough_from && k > 0 {
            rub(&mut world, numbers.friction);
        }
        let stays = |h: &Held| hands.grips.iter().any(|n| (n.grip, n.thread, n.arc) == (h.grip, h.thread, h.arc));
        grips.retain(|(h, handle, _)| stays(h) || world.remove_grip(*handle).is_err());
        for h in &hands.grips {
            if !grips.iter().any(|(o, ..)| o.grip == h.grip) {
                let spec = GripSpec::at_once(rods[h.thread], Place::Arc(h.arc), lead.hold);
                let handle = world.insert_grip(&spec).expect(GOOD);
                grips.push((*h, handle, world.grip_pose(handle).expect(GOOD)));
            }
        }
        for (taken, handle, from) in &grips {
            let now = hands.grips.iter().find(|h| h.grip == taken.grip).expect("others were let go");
            world
                .set_grip_pose(*handle, Pose::new(from.position + (now.at - taken.taken), from.orientation))
                .expect(GOOD);
        }
        for (shape, pose) in shapes.iter().zip(&hands.shapes) {
            world.set_shape_pose(*shape, *pose).expect(GOOD);
        }
        let (clock, mut audited) = (ThreadTime::now(), std::time::Duration::ZERO);
        let report = world.step_with(FRAME, &mut |view| {
            let clock = ThreadTime::now();
            audit.observe(view);
            audited += clock.elapsed();
        });
        cpu.push(clock.elapsed().saturating_sub(audited).as_secs_f64());
        contacts = report.contacts;
        if world.view().rods().any(|r| !sane(r.positions(), 0.01 * r.rest_length()))
            || !report.incidents.iter().all(|i| matches!(i.kind, IncidentKind::Teleport { .. }))
        {
            diverged = Some(world.time());
            shots.push(before);
            break;
        }
        before = shot(world.view(), BEFORE, false, false);
        watch.look(world.view(), k + 1 >= last_from);
        if let Some((phase, _)) = lead.phases.iter().find(|p| p.1.min(end) == k + 1) {
            let total = |h: &Held| lead.threads[h.thread].from.distance(lead.threads[h.thread].to);
            let both = grips.iter().filter(|(h, ..)| h.arc == 0.0 || h.arc > 0.999 * total(h)).count() >= 2;
            shots.push(shot(world.view(), phase, tied, both));
        }
    }
    let seen = audit.report();
    let number = |v: Option<f64>| v.unwrap_or(f64::NAN);
    Run {
        name: name.into(),
        elements,
        shots,
        clearance: [number(seen.thread_clearance), number(seen.shape_clearance)],
        passages: seen.crossings.len(),
        first_passage: number(seen.crossings.first().map(|c| c.time)),
        elongation: [watch.elongation, seen.max_elongation.iter().map(|e| e.1).fold(0.0, f64::max)],
        drift: watch.drift,
        slip: watch.slip,
        contacts,
        touching: touching(world.view()),
        diverged,
        ms: ms(cpu),
    }
}

/// A thread as the paper wants it: spheres side by side.
fn spheres(t: &Thread, elements: &mut usize) -> RodSpec {
    let n = (t.from.distance(t.to) / (2.0 * t.radius)).round();
    *elements += n as usize;
    let points = (0..=n as usize).map(|i| t.from.lerp(t.to, i as f64 / n)).collect();
    // Of the material it uses nothing: masses are all alike.
    RodSpec::new(points, t.radius, Material::elastic(1e9, 1e3))
}

/// A scene on both solvers: the run of Sutura's own, then those of the paper's.
///
/// - True scale: one step in a frame of 1/60 s.
/// - A hundredth of gravity at true scale, where there is gravity: what falls then falls as it does in a scene a
///   hundred times as large, but hands move as many diameters in a step as before.
/// - Effective scale: a scene a hundred times as large, under the same gravity, in which the hands are as quick as what
///   falls, so that all takes ten times as long; ten steps where there was one (Froude's similarity: lengths as the
///   square of times).
/// - Other numbers of steps in a frame.
pub fn all(name: &str, hold: Hold, share: f64, others: &[u32], smooth_until: Option<&'static str>) -> Vec<Run> {
    let (lead, run) = direct(name, hold, share);
    let mut runs = vec![run];
    let mut go = |name: &str, steps: u32, gravity: f64| {
        runs.push(paper(&lead, name, PaperSettings::default(), Pace { steps, gravity, smooth_until }));
    };
    go(TRUE, 1, 1.0);
    if lead.settings.gravity != DVec3::ZERO {
        go("paper, a hundredth of gravity", 1, 1.0 / EFFECTIVE);
    }
    go(SCALED, EFFECTIVE.sqrt() as u32, 1.0);
    for steps in others {
        go(&format!("paper, {steps} steps a frame"), *steps, 1.0);
    }
    runs
}

/// Names of runs of the paper's solver.
pub const TRUE: &str = "paper, true scale";
pub const SCALED: &str = "paper, effective scale";

/// The run of a name.
pub fn find<'a>(runs: &'a [Run], name: &str) -> &'a Run {
    runs.iter().find(|r| r.name == name).expect("it was run")
}

/// What the runs show, as a table.
pub fn table(name: &str, title: &str, runs: &[Run]) -> Table {
    let headings = [
        "solver",
        "elements",
        "diverged at [s]",
        "passages (256 at most)",
        "first passage [s]",
        "least clearance, thread [diameters]",
        "least clearance, shape [diameters]",
        "greatest elongation, whole",
        "of an element",
        "drift in the hold [mm]",
        "contacts at the end",
        "particles in touch",
    ];
    let mut t = Table::new(name, title, &headings);
    let known = |v: f64| if v.is_finite() { Cell::from(v) } else { Cell::from("-") };
    for r in runs {
        let settled = r.diverged.is_none();
        t.row([
            r.name.clone().into(),
            r.elements.into(),
            r.diverged.map_or("-".into(), Cell::from),
            r.passages.into(),
            known(r.first_passage),
            known(r.clearance[0]),
            known(r.clearance[1]),
            if settled { percent(r.elongation[0]).into() } else { "-".into() },
            if settled { percent(r.elongation[1]).into() } else { "-".into() },
            if settled { known(1e3 * r.drift) } else { "-".into() },
            if settled { r.contacts.into() } else { "-".into() },
            if settled { known(r.touching) } else { "-".into() },
        ]);
    }
    t
}

/// What they cost.
pub fn times(name: &str, runs: &[Run]) -> Table {
    let mut t = Table::new(
        name,
        "CPU time of a frame (those that diverged: until then)",
        &["solver", "elements", "ms a frame, mean", "median"],
    )
    .measured();
    for r in runs {
        t.row([r.name.clone().into(), r.elements.into(), r.ms[0].into(), r.ms[1].into()]);
    }
    t
}

/// Moments of some runs: a row for each run. One that diverged is shown as it was in the frame before. Threads are
/// drawn thicker where they would hardly be seen.
pub fn picture(name: &str, title: &str, runs: &[&Run], moments: &[Moment]) -> Picture {
    let mut panels = Vec::new();
    for r in runs {
        let mut told = false;
        for m in moments {
            let (shot, label) = match (r.at(m.phase), r.diverged) {
                (Some(shot), _) => (Some(shot), format!("{}: {}", r.name, m.words)),
                (None, Some(t)) if !told => (r.at(BEFORE), format!("{}: diverges at {} s", r.name, number(t))),
                _ => (None, String::new()),
            };
            told |= r.at(m.phase).is_none();
            let mut panel =
                Panel { label, tubes: Vec::new(), solids: Vec::new(), look: m.look, frame: Some((m.at, m.width)) };
            if let Some(shot) = shot {
                let good = shot.threads.iter().filter(|(p, _)| sane(p, 0.1));
                panel.tubes = good
                    .map(|(points, radius)| Tube { points: points.clone(), radius: radius.max(m.width / 400.0) })
                    .collect();
                panel.solids = shot
                    .shapes
                    .iter()
                    .map(|(geometry, pose)| Solid { geometry: geometry.clone(), pose: *pose })
                    .collect();
            }
            panels.push(panel);
        }
    }
    Picture { name: name.into(), title: title.into(), columns: moments.len(), panels }
}

/// When and how to look.
pub struct Moment {
    pub phase: &'static str,
    pub words: &'static str,
    /// Direction in which one looks, and the one that is up.
    pub look: (DVec3, DVec3),
    /// Point in the middle and width \[m\].
    pub at: DVec3,
    pub width: f64,
}

/// Passages and overlap in words.
pub fn verdict(r: &Run) -> String {
    if let Some(t) = r.diverged {
        return format!("diverges at {} s", number(t));
    }
    let passages = match r.passages {
        0 => "nothing passes through".to_string(),
        n => format!("{n}{} passages from {} s on", if n == 256 { " or more" } else { "" }, number(r.first_passage)),
    };
    format!("{passages}; overlap {} of a diameter", percent((-r.least()).max(0.0)))
}

/// The same, and how far anything moved while it was held.
pub fn moved(r: &Run) -> String {
    let drift = if r.diverged.is_none() { format!("; drift {}", mm(r.drift)) } else { String::new() };
    verdict(r) + &drift
}

impl Run {
    /// What it was at the end of a phase; nothing once it has diverged.
    pub fn at(&self, phase: &str) -> Option<&Shot> {
        self.shots.iter().find(|s| s.phase == phase)
    }
    /// Least clearance of anything.
    pub fn least(&self) -> f64 {
        // A clearance that is no number is that of nothing near.
        self.clearance[0].min(self.clearance[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A thread led by both ends makes their way, and one let go stays behind.
    #[test]
    fn hands_lead_and_let_go() {
        let (from, to) = (DVec3::ZERO, DVec3::X * 0.02);
        let hands = |k: usize| {
            let way = DVec3::Y * (1e-3 * k as f64);
            let one = |grip: usize, arc: f64, taken: DVec3| Held { grip, thread: 0, arc, taken, at: taken + way };
            let mut grips = vec![one(0, 0.0, from)];
            if k <= 5 {
                grips.push(one(1, 0.02, to));
            }
            Hands { grips, shapes: Vec::new() }
        };
        let lead = Lead {
            hold: Hold::Pin,
            settings: Settings { gravity: DVec3::ZERO, linear_damping: 0.999_999, ..Settings::default() },
            threads: vec![Thread { from, to, radius: 5e-4 }],
            shapes: Vec::new(),
            shape_poses: Vec::new(),
            frames: (1..=10).map(hands).collect(),
            phases: vec![("both".into(), 5), (LAST.into(), 10)],
        };
        let run = paper(&lead, "paper", PaperSettings::default(), Pace { steps: 10, gravity: 1.0, smooth_until: None });
        assert_eq!((run.elements, run.diverged, run.passages), (20, None, 0));
        let ends = |phase: &str| {
            let points = &run.at(phase).expect("it was reached").threads[0].0;
            (points[0], points[20])
        };
        let (a, b) = ends("both");
        assert!(a.distance(DVec3::Y * 5e-3) < 1e-12 && b.distance(to + DVec3::Y * 5e-3) < 1e-12, "{a} {b}");
        let (a, b) = ends(LAST);
        assert!(a.distance(DVec3::Y * 1e-2) < 1e-12 && b.distance(to + DVec3::Y * 1e-2) > 1e-3, "{a} {b}");
        assert!(run.elongation[0].abs() < 1e-3, "{:?}", run.elongation);
    }
}
