//! Plays a scene: builds its world, steps it, and looks at what must hold of every scene after every step and substep.

use crate::scene::{Act, Held, Scene};
use std::collections::BTreeMap;
use sutura::audit::Audit;
use sutura::glam::DVec3;
use sutura::input::Recorder;
use sutura::math::exp;
use sutura::{
    Drive, Error, Grip, GripSpec, Handle, IncidentKind, Integrator, Load, LoadKind, LoadSpec, Place, Pose, Reel,
    ReelSpec, Rod, RodView, Shape, StepReport, Stretch, View, Weld, WeldSpec, World,
};

/// A scene being played.
pub struct Player<'a> {
    scene: &'a Scene,
    /// Its world.
    pub world: Recorder,
    /// Its threads; `None` for what the engine refused, or was removed.
    pub rods: Vec<Option<Handle<Rod>>>,
    shapes: Vec<Option<Handle<Shape>>>,
    loads: Vec<Option<Handle<Load>>>,
    welds: Vec<Option<Handle<Weld>>>,
    reels: Vec<Option<Handle<Reel>>>,
    grips: Vec<Option<(Handle<Grip>, Pose)>>,
    frame: u32,
    /// Frames in a row in which no acceptable substep was found.
    stuck: u32,
    /// How often the engine refused what the scene wanted, with an error.
    pub refused: u32,
}

/// Frames in a row without an acceptable substep after which a scene is over.
const STUCK: u32 = 2;

impl<'a> Player<'a> {
    /// Builds the world; an error when it refuses the settings. `record` says whether it writes down what is done to
    /// it.
    pub fn new(scene: &'a Scene, record: bool) -> Result<Self, Error> {
        let world = Recorder::new(scene.settings.clone(), record)?;
        let grips = vec![None; scene.grips.len()];
        let (rods, shapes, loads, welds, reels) = (Vec::new(), Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut player =
            Player { scene, world, rods, shapes, loads, welds, reels, grips, frame: 0, stuck: 0, refused: 0 };
        if scene.other_order {
            player.insert_shapes();
            player.insert_rods();
            player.insert_loads();
            player.set_frictions();
        } else {
            player.set_frictions();
            player.insert_rods();
            player.insert_shapes();
        }
        player.take();
        if !scene.other_order {
            player.insert_loads();
        }
        Ok(player)
    }

    fn set_frictions(&mut self) {
        for (a, b, friction) in &self.scene.frictions {
            let set = self.world.set_friction(*a, *b, *friction);
            self.done(set);
        }
    }
    fn insert_rods(&mut self) {
        for spec in &self.scene.rods {
            let rod = self.world.insert_rod(spec);
            let rod = self.done(rod);
            self.rods.push(rod);
        }
        for weld in &self.scene.welds {
            let places: Option<Vec<_>> =
                weld.places.iter().map(|(rod, place)| Some((self.rod(*rod)?, *place))).collect();
            let weld = places.and_then(|places| {
                let weld = self.world.insert_weld(&WeldSpec { places, rest: weld.rest, anchor: None });
                self.done(weld)
            });
            self.welds.push(weld);
        }
        for reel in &self.scene.reels {
            let reel = self.rod(reel.rod).and_then(|rod| {
                let length = self.world.rod(rod).map_or(0.0, |r| r.rest_length());
                let reel = self.world.insert_reel(&ReelSpec {
                    rod,
                    at_end: reel.at_end,
                    law: reel.law,
                    supply: reel.supply.map(|s| s * length),
                });
                self.done(reel)
            });
            self.reels.push(reel);
        }
    }
    fn insert_shapes(&mut self) {
        for spec in &self.scene.shapes {
            let shape = self.world.insert_shape(spec);
            let shape = self.done(shape);
            self.shapes.push(shape);
        }
    }
    fn insert_loads(&mut self) {
        for (rod, kind) in &self.scene.loads {
            let load = self.rod(*rod).and_then(|rod| {
                let load = self.world.insert_load(&LoadSpec { rod, kind: *kind });
                self.done(load)
            });
            self.loads.push(load);
        }
    }

    /// Counts what was refused.
    fn done<T>(&mut self, result: Result<T, Error>) -> Option<T> {
        self.refused += u32::from(result.is_err());
        result.ok()
    }
    fn rod(&self, number: usize) -> Option<Handle<Rod>> {
        self.rods.get(number).copied().flatten()
    }

    /// Takes hold of what is to be held from this frame on.
    fn take(&mut self) {
        for (i, grip) in self.scene.grips.iter().enumerate() {
            if grip.from != self.frame || self.grips[i].is_some() {
                continue;
            }
            let Some(rod) = self.rod(grip.rod) else { continue };
            let taken = self.world.insert_grip(&GripSpec {
                rod,
                place: grip.place,
                hold: grip.hold,
                drive: grip.drive,
                ramp: grip.ramp,
            });
            if let Some(handle) = self.done(taken)
                && let Ok(pose) = self.world.grip_pose(handle)
            {
                self.grips[i] = Some((handle, pose));
            }
        }
    }

    /// What is done before this frame's step.
    fn act(&mut self) {
        self.take();
        for (i, grip) in self.scene.grips.iter().enumerate() {
            let Some((handle, taken)) = self.grips[i] else { continue };
            if self.frame >= grip.until {
                self.grips[i] = None;
                // It may have gone with its thread.
                let _ = self.world.remove_grip(handle);
            } else if grip.drive == Drive::Pose && (grip.velocity != DVec3::ZERO || grip.spin != DVec3::ZERO) {
                let pose = moved(grip, taken, f64::from(self.frame + 1 - grip.from) * self.scene.frame);
                let set = self.world.set_grip_pose(handle, pose);
                self.done(set);
            }
        }
        let (scene, now) = (self.scene, self.frame);
        for (i, _) in scene.welds.iter().enumerate().filter(|(_, w)| w.until == now) {
            if let Some(weld) = self.welds[i].take() {
                // It may have gone with its threads.
                let _ = self.world.remove_weld(weld);
            }
        }
        for (i, reel) in scene.reels.iter().enumerate() {
            if let (Some((_, law)), Some(handle)) = (reel.later.filter(|(frame, _)| *frame == now), self.reels[i]) {
                let set = self.world.set_reel(handle, law);
                self.done(set);
            }
        }
        for (_, act) in scene.acts.iter().filter(|(frame, _)| *frame == now) {
            self.do_act(act);
        }
    }

    fn do_act(&mut self, act: &Act) {
        let grip = |player: &Self, i: usize| player.grips.get(i).copied().flatten().map(|g| g.0);
        let done = match act {
            Act::RemoveRod(i) => self.rods.get_mut(*i).and_then(Option::take).map(|rod| self.world.remove_rod(rod)),
            Act::InsertRod(spec) => Some(self.world.insert_rod(spec).map(|rod| self.rods.push(Some(rod)))),
            Act::Material(i, material) => self.rod(*i).map(|rod| self.world.set_material(rod, material)),
            Act::Stretch(i, stretch) => self.rod(*i).map(|rod| self.world.set_stretch(rod, *stretch)),
            Act::RemoveShape(i) => {
                self.shapes.get_mut(*i).and_then(Option::take).map(|shape| self.world.remove_shape(shape))
            }
            Act::ShapePose(i, pose) => {
                self.shapes.get(*i).copied().flatten().map(|shape| self.world.set_shape_pose(shape, *pose))
            }
            Act::Settings(settings) => Some(self.world.set_settings(settings.clone())),
            Act::Load(i, kind) => self.loads.get(*i).copied().flatten().map(|load| self.world.set_load(load, *kind)),
            Act::Drive(i, drive) => grip(self, *i).map(|grip| self.world.set_grip_drive(grip, *drive)),
            Act::GripPose(i, pose) => grip(self, *i).map(|grip| self.world.set_grip_pose(grip, *pose)),
        };
        if let Some(done) = done {
            self.done(done);
        }
    }

    /// Steps through the next frame.
    pub fn step(&mut self, observe: &mut dyn FnMut(View<'_>)) -> StepReport {
        self.act();
        self.frame += 1;
        let report = self.world.step_with(self.scene.frame, observe);
        let stuck = report.incidents.iter().any(|i| {
            matches!(i.kind, IncidentKind::Stuck { .. } | IncidentKind::Held { .. } | IncidentKind::NotFinite)
        });
        self.stuck = if stuck { self.stuck + 1 } else { 0 };
        report
    }
    /// Whether there are no frames left, or it is stuck for good: each such frame takes all the attempts that the
    /// settings allow.
    pub fn is_over(&self) -> bool {
        self.frame >= self.scene.frames || self.stuck >= STUCK
    }
    /// Plays to the end.
    pub fn play(mut self) -> Self {
        while !self.is_over() {
            self.step(&mut |_| {});
        }
        self
    }
    /// Plays to the end; before each frame for which `split` holds it goes on from a snapshot of itself, without its
    /// working memory.
    pub fn play_split(mut self, split: impl Fn(u32) -> bool) -> Result<Self, Error> {
        while !self.is_over() {
            if split(self.frame) {
                let snapshot = self.world.snapshot();
                self.world.restore(&snapshot)?;
                self.world.forget_scratch();
            }
            self.step(&mut |_| {});
        }
        Ok(self)
    }
}

/// Pose of a grip some time after it was taken.
fn moved(grip: &Held, taken: Pose, time: f64) -> Pose {
    Pose::new(taken.position + grip.velocity * time, (exp(grip.spin * time) * taken.orientation).normalize())
}

/// What was seen of a scene that was played.
#[derive(Debug, Clone, Default)]
pub struct Seen {
    /// Frames stepped.
    pub frames: u64,
    /// Substeps accepted.
    pub substeps: u64,
    /// Substeps thrown away.
    pub rejected: u64,
    /// Insertions and changes that the engine refused.
    pub refused: u64,
    /// Incidents by kind.
    pub incidents: BTreeMap<&'static str, u64>,
    /// What must not be: a number that is not finite, work without bound, a passage. The first, in words.
    pub fault: Option<String>,
    /// Of a passive scene: the most that its energy grew in a step, over what was turned over until then.
    pub growth: f64,
    /// Time of that \[s\].
    pub growth_time: f64,
    /// State hash at the end.
    pub hash: u64,
}

/// Kind of an incident in a word.
pub fn kind(incident: &IncidentKind) -> &'static str {
    match incident {
        IncidentKind::NotFinite => "not finite, rolled back",
        IncidentKind::Stuck { .. } => "stuck",
        IncidentKind::Held { .. } => "held",
        IncidentKind::NotConverged { .. } => "not converged",
        IncidentKind::LengthNotKept { .. } => "length not kept",
        IncidentKind::Teleport { .. } => "teleport",
        IncidentKind::BadInput { .. } => "bad input",
        IncidentKind::PassedThrough { .. } => "passed through",
        _ => "other",
    }
}

/// Plays a scene to its end under the eyes of everything that must hold. `audited`: also that nothing passes through
/// anything unsaid.
pub fn watch(scene: &Scene, audited: bool) -> Seen {
    let mut seen = Seen::default();
    let Ok(mut player) = Player::new(scene, false) else {
        seen.refused = 1;
        return seen;
    };
    // Threads of a scene whose energy is looked at keep their numbers.
    let whole = player.rods.iter().all(Option::is_some);
    let mut energies = (whole && scene.is_passive()).then(|| Turnover::new(scene, &player.world));
    // Ends that were welded lie in each other when the weld is gone, and part.
    let audited = audited && scene.welds.iter().all(|w| w.until == u32::MAX);
    let mut audit = Audit::new();
    if audited {
        audit.observe(player.world.view());
    }
    while !player.is_over() && seen.fault.is_none() {
        let report = player.step(&mut |view| {
            if audited {
                audit.observe(view);
            }
        });
        if let Some(e) = &mut energies {
            e.observe(
                &player.world,
                report.incidents.iter().any(|i| matches!(i.kind, IncidentKind::LengthNotKept { .. })),
            );
        }
        seen.frames += 1;
        seen.substeps += u64::from(report.substeps);
        seen.rejected += u64::from(report.rejected);
        for incident in &report.incidents {
            *seen.incidents.entry(kind(&incident.kind)).or_default() += 1;
        }
        seen.fault = fault(&player.world, scene.frame, &report);
        if seen.fault.is_none()
            && audited
            && audit.report().passes_through
            && !seen.incidents.contains_key("passed through")
        {
            seen.fault = Some(format!("passed through unsaid: {:?}", audit.report().crossings.first()));
        }
    }
    if let Some(e) = energies {
        (seen.growth, seen.growth_time) = (e.growth, e.time);
    }
    seen.refused = u64::from(player.refused);
    seen.hash = player.world.state_hash();
    seen
}

/// What is wrong after a step, if anything: numbers that are not finite, more work than the settings allow, or not said
/// that it went wrong.
fn fault(world: &World, dt: f64, report: &StepReport) -> Option<String> {
    let settings = world.settings();
    let wanted = (dt / settings.substep * (1.0 - 1e-9)).ceil().max(1.0);
    // Of second order there are two solves, and one more where contacts changed.
    let solves = if settings.integrator == Integrator::TrBdf2 { 3 } else { 1 };
    // A thread that gives way costs an attempt a step, and after a reel has cut an element another one.
    let giving = world.view().rods().filter(|r| r.stretch() == Stretch::Inextensible).count() as f64;
    // With each thread that is held the rest is tried anew.
    let held = report.incidents.iter().filter(|i| matches!(i.kind, IncidentKind::Held { .. })).count() as f64;
    let attempts = wanted * (f64::from((2u32 << settings.halvings) - 1) + giving) * (1.0 + held);
    if f64::from(report.substeps) + f64::from(report.rejected) > attempts
        || report.newton_iterations > solves * settings.newton_max * (report.substeps + report.rejected)
    {
        return Some(format!("more work than the settings allow: {report:?}"));
    }
    let said = [
        report.residual,
        report.length_error,
        report.thread_clearance.unwrap_or(0.0),
        report.shape_clearance.unwrap_or(0.0),
    ];
    if !said.iter().all(|v| v.is_finite()) {
        return Some(format!("the report has a number that is not finite: {report:?}"));
    }
    if !report.converged && report.incidents.is_empty() {
        return Some("not converged, and no incident says so".into());
    }
    if !world.time().is_finite() {
        return Some("the time is not finite".into());
    }
    for rod in world.view().rods() {
        let vectors = rod.positions().iter().chain(rod.velocities()).chain(rod.angular_velocities());
        if !vectors.into_iter().all(|v| v.is_finite()) {
            return Some("a position or velocity is not finite".into());
        }
        if !rod.orientations().iter().all(|q| q.is_finite() && (q.length() - 1.0).abs() < 1e-6) {
            return Some("a frame is not a rotation".into());
        }
        if !(0..rod.n_joints()).all(|j| rod.moment(j).is_finite() && rod.strain(j).is_finite()) {
            return Some("a moment in a thread is not finite".into());
        }
        if !(0..rod.n_elements()).all(|e| rod.internal_force(e).is_finite()) {
            return Some("a force in a thread is not finite".into());
        }
    }
    if !world.view().welds().all(|w| w.pose.position.is_finite() && (w.pose.orientation.length() - 1.0).abs() < 1e-6) {
        return Some("the pose of a weld is not finite".into());
    }
    if !world.view().shapes().all(|s| s.pose.position.is_finite() && s.pose.orientation.is_finite()) {
        return Some("the pose of a shape is not finite".into());
    }
    if !world.contacts().all(|c| c.force.is_finite() && c.point.is_finite() && c.normal.is_finite()) {
        return Some("a contact force is not finite".into());
    }
    None
}

/// Energy of a passive scene from step to step.
struct Turnover<'a> {
    scene: &'a Scene,
    start: f64,
    last: f64,
    /// What constraints of length and contacts left open at the last state.
    open: f64,
    /// Most that any kind of energy was so far: what a difference is measured by \[J\].
    most: f64,
    growth: f64,
    time: f64,
    /// Whether a length was not kept in the last step.
    off: bool,
}

/// Where nothing moves energy is the rounding of lengths and angles: this part of EI / L counts as turned over.
const NOTHING: f64 = 1e-9;

/// To how much the engine holds the length of an inextensible element. The work of its tension over that much comes and
/// goes.
const LENGTH_TOLERANCE: f64 = 5e-6;

impl<'a> Turnover<'a> {
    fn new(scene: &'a Scene, world: &World) -> Self {
        let view = world.view();
        let (own, potential) = energy(scene, view);
        let bending: f64 = view.rods().map(|r| r.bending_stiffness(0).min_element() / r.rest_length()).sum();
        let open = open_work(scene, world);
        Turnover {
            scene,
            start: potential,
            last: own + potential,
            open,
            most: own.max(NOTHING * bending),
            growth: 0.0,
            time: 0.0,
            off: false,
        }
    }
    /// After a step; `off` when the report says that a length was not kept in it: a thread that is to keep its length
    /// counts no energy of stretch.
    fn observe(&mut self, world: &World, off: bool) {
        let (own, potential) = energy(self.scene, world.view());
        let (total, open) = (own + potential, open_work(self.scene, world));
        self.most = self.most.max(own).max((potential - self.start).abs());
        let growth = (total - self.last - open.max(self.open)) / self.most;
        let excused = core::mem::replace(&mut self.off, off) || off;
        if !excused && growth > self.growth || growth.is_nan() {
            (self.growth, self.time) = (growth, world.time());
        }
        (self.last, self.open) = (total, open);
    }
}

/// Part of a diameter by which the engine lets things overlap. A contact force works over that much, and this is no
/// energy of a thread.
const OVERLAP: f64 = 0.04;

/// Work of the tensions of inextensible threads over what their lengths may be off, to either side, and of contact
/// forces over the overlap that may be \[J\].
fn open_work(scene: &Scene, world: &World) -> f64 {
    let widest = scene.rods.iter().map(|r| r.radius).fold(0.0, f64::max);
    let touching: f64 = world.contacts().map(|c| c.force.length() * 2.0 * widest * OVERLAP).sum();
    let rods = world.view().rods().zip(&scene.rods).filter(|(_, spec)| spec.stretch == Stretch::Inextensible);
    let of = |rod: &RodView<'_>| {
        rod.rest_lengths().iter().enumerate().map(|(e, l)| rod.tension(e).abs() * l * LENGTH_TOLERANCE).sum::<f64>()
    };
    touching + 2.0 * rods.map(|(rod, _)| of(&rod)).sum::<f64>()
}

/// Kinetic and elastic energy, and the potential of gravity and loads \[J\].
pub fn energy(scene: &Scene, view: View<'_>) -> (f64, f64) {
    let (mut own, mut potential) = (0.0, 0.0);
    for rod in view.rods() {
        let e = rod.energy();
        own += e.kinetic + e.stretch + e.bend + e.twist;
        potential += e.gravity;
    }
    // Threads of a passive scene keep their slots.
    for (number, kind) in &scene.loads {
        let Some(rod) = view.rods().nth(*number) else { continue };
        let x = rod.positions();
        match kind {
            LoadKind::Point { place, force, .. } => {
                let at = match *place {
                    Place::Start => x[0],
                    Place::End => x[x.len() - 1],
                    Place::Particle(i) => x[i as usize],
                    Place::Element(e) => (x[e as usize] + x[e as usize + 1]) * 0.5,
                    Place::Arc(_) => continue,
                };
                potential -= force.dot(at);
            }
            LoadKind::Uniform { force_per_length } => {
                let moment: DVec3 =
                    rod.rest_lengths().iter().enumerate().map(|(e, l)| (x[e] + x[e + 1]) * (0.5 * l)).sum();
                potential -= force_per_length.dot(moment);
            }
            // Its weight is in the energy of the thread.
            LoadKind::Mass { .. } => {}
        }
    }
    (own, potential)
}
