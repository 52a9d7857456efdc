//! The world of a running scene with its names: applies actions, moves what moves, and answers what expressions ask.

use crate::distance;
use crate::doc::Location;
use crate::error::SceneError;
use crate::expr::{At, Live, Read, Ref, Value};
use crate::judge::{self, Judge};
use crate::motion::{Motion, quintic};
use crate::parted::Parting;
use crate::report::KnotReport;
use crate::saved::{Event, SavedFile};
use crate::scene::{Action, JointDef, LoadDef, Mover, Scene, Step};
use std::sync::Mutex;
use sutura::glam::{DQuat, DVec3};
use sutura::input::Recorder;
use sutura::knot::Entries;
use sutura::math::{exp, log};
use sutura::{
    Body, BodyMotion, BodyView, Drive, Error, Grip, GripSpec, Handle, Hold, Joint, JointKind, JointSpec, Load,
    LoadKind, LoadSpec, Place, Pose, Reel, ReelSpec, Rod, RodView, Shape, ShapeMotion, StepReport, WeldAnchor,
    WeldSpec,
};

/// A grip that holds.
#[derive(Debug, Clone, Copy)]
struct Held {
    handle: Handle<Grip>,
    thread: usize,
    place: Place,
    /// Where it was when taken.
    taken: Pose,
}

/// A load that acts.
#[derive(Debug, Clone)]
struct Acting {
    handle: Handle<Load>,
    /// Those of a uniform load on the parts that were cut off since.
    also: Vec<Handle<Load>>,
    thread: usize,
    kind: LoadDef,
}

/// A motion under way.
struct Moving {
    what: Mover,
    motion: Motion,
    begin: f64,
    /// Its last pose was given to the world.
    done: bool,
}

/// What moves a thing that may be moved.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Way {
    /// Nothing, ever.
    Fixed,
    /// Poses.
    Posed,
    /// A force along a line: direction, force \[N\], speed limit \[m/s\].
    Pushed(DVec3, f64, f64),
    /// What acts on a body.
    Free,
}

/// A thing that somebody else moves, or has moved. The scene's own motion of it goes on meanwhile, unseen.
struct Lent {
    what: Mover,
    /// What moves it in the scene.
    way: Way,
    /// Where the scene has it while no motion of it is under way.
    place: Pose,
    state: LentState,
}

enum LentState {
    /// In the other hand.
    Held,
    /// It stays where that hand left it.
    Left,
    /// On its way back: how far off it was, the time for the way and the part of that which has passed \[s\].
    Back { off: Pose, span: f64, passed: f64 },
}

/// Fastest turn of a thing on its way back \[rad/s\].
const BACK_TURN: f64 = 3.0;
/// Greatest slope of [`quintic`].
const QUINTIC_SLOPE: f64 = 1.875;

/// A number that grows to its new value.
struct Ramp {
    begin: f64,
    span: f64,
    what: Growing,
}

enum Growing {
    Gravity { from: DVec3, to: DVec3 },
    Load { load: usize, from: LoadDef, to: LoadDef },
}

/// What the last frame's steps said together.
#[derive(Debug, Clone, Default)]
pub struct FrameReport {
    /// Time that was to be simulated, and that was \[s\].
    pub wanted: f64,
    pub simulated: f64,
    pub substeps: u32,
    pub rejected: u32,
    pub newton_iterations: u32,
    pub converged: bool,
    pub residual: f64,
    pub length_error: f64,
    pub thread_clearance: Option<f64>,
    pub shape_clearance: Option<f64>,
    pub contacts: u32,
    pub work: f64,
}

impl FrameReport {
    pub fn add(&mut self, step: &StepReport) {
        self.simulated += step.simulated;
        self.substeps += step.substeps;
        self.rejected += step.rejected;
        self.newton_iterations += step.newton_iterations;
        self.converged &= step.converged;
        self.residual = self.residual.max(step.residual);
        self.length_error = self.length_error.max(step.length_error);
        self.thread_clearance = lesser(self.thread_clearance, step.thread_clearance);
        self.shape_clearance = lesser(self.shape_clearance, step.shape_clearance);
        self.contacts = step.contacts;
        self.work += step.work;
    }
    pub fn clearance(&self) -> Option<f64> {
        lesser(self.thread_clearance, self.shape_clearance)
    }
}

/// The lesser of two numbers that may be missing.
pub fn lesser(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.min(b)),
        (a, b) => a.or(b),
    }
}

/// Puts a joint in.
fn join(world: &mut Recorder, bodies: &[Handle<Body>], joint: &JointDef) -> Result<Handle<Joint>, Error> {
    let sides = joint.bodies.map(|b| b.map(|b| bodies[b]));
    let spec = JointSpec {
        compliance: joint.compliance[0],
        angular_compliance: joint.compliance[1],
        limits: joint.limits,
        motor: joint.motor,
        friction: joint.friction,
        touch: joint.touch,
        ..JointSpec::new(joint.kind, sides, world.joint_frames(sides, joint.at)?)
    };
    world.insert_joint(&spec)
}

/// The world with its names.
pub struct Stage {
    pub world: Recorder,
    /// Those that are there: parts come when they are cut off, in the order of the scene.
    pub threads: Vec<Handle<Rod>>,
    /// Those of their own, then those of the bodies, as in the scene.
    pub shapes: Vec<Handle<Shape>>,
    pub bodies: Vec<Handle<Body>>,
    /// Points of needles in their frames.
    tips: Vec<Option<DVec3>>,
    joints: Vec<Handle<Joint>>,
    reels: Vec<Handle<Reel>>,
    grips: Vec<Option<Held>>,
    loads: Vec<Option<Acting>>,
    moving: Vec<Moving>,
    lent: Vec<Lent>,
    ramps: Vec<Ramp>,
    /// Everything that gave or took a handle, for saved states.
    events: Vec<Event>,
    marks: Vec<Option<Entries>>,
    /// Simulated time since the start of the scene, and of the phase \[s\].
    pub time: f64,
    pub phase_begin: f64,
    pub last: FrameReport,
    /// Least clearance so far by the engine.
    pub least: (Option<f64>, Option<f64>),
    pub incidents: u64,
    pub judge: Judge,
    pub probes: Vec<Value>,
    seed: u64,
    /// Recognitions at the present time, so that several checks share one.
    knots: Mutex<Vec<(usize, KnotReport)>>,
    names: Names,
}

/// Names for saved states.
struct Names {
    threads: Vec<String>,
    grips: Vec<String>,
    loads: Vec<String>,
}

impl Stage {
    /// Builds the world of a scene (which records what is done to it, if it is to), takes up a saved state, and applies
    /// what stands at the beginning.
    pub fn new(scene: &Scene, record: bool) -> Result<Stage, SceneError> {
        let at = |location: &Location, e: Error| location.error(e.to_string());
        let mut world = Recorder::new(scene.settings.clone(), record).map_err(|e| at(&scene.solver_location, e))?;
        for (a, b, friction, location) in &scene.frictions {
            world.set_friction(*a, *b, *friction).map_err(|e| at(location, e))?;
        }
        // Every thread, shape and body is tried, so that all problems show at once.
        let mut problems = Vec::new();
        let (mut threads, mut shapes, mut bodies) = (Vec::new(), Vec::new(), Vec::new());
        for thread in &scene.threads[..scene.own_threads] {
            match world.insert_rod(&thread.spec) {
                Ok(h) => threads.push(h),
                Err(e) => problems.push(thread.location.problem(e.to_string())),
            }
        }
        for shape in scene.shapes.iter().filter(|s| s.spec.motion != ShapeMotion::OnBody) {
            match world.insert_shape(&shape.spec) {
                Ok(h) => shapes.push(h),
                Err(e) => problems.push(shape.location.problem(e.to_string())),
            }
        }
        for body in &scene.bodies {
            match world.insert_body(&body.spec).and_then(|h| Ok((h, world.body_shapes(h)?))) {
                Ok((h, solids)) => {
                    bodies.push(h);
                    shapes.extend(solids);
                }
                Err(e) => problems.push(body.location.problem(e.to_string())),
            }
        }
        if !problems.is_empty() {
            return Err(SceneError { problems });
        }
        for (k, body) in scene.bodies.iter().enumerate().filter(|(_, b)| b.driven) {
            world.set_body_motion(bodies[k], BodyMotion::Driven).map_err(|e| at(&body.location, e))?;
        }
        for (k, body) in scene.bodies.iter().enumerate() {
            if let Some(by) = body.held_by {
                let motion = BodyMotion::Held { by: bodies[by] };
                world.set_body_motion(bodies[k], motion).map_err(|e| at(&body.location, e))?;
            }
        }
        for weld in &scene.welds {
            let places = weld.places.iter().map(|(thread, place)| (threads[*thread], *place)).collect();
            let anchor =
                weld.anchor.as_ref().map(|a| WeldAnchor { body: bodies[a.body], point: a.point, strength: a.strength });
            world.insert_weld(&WeldSpec { places, rest: weld.rest, anchor }).map_err(|e| at(&weld.location, e))?;
        }
        let mut joints = Vec::new();
        for joint in &scene.joints {
            joints.push(join(&mut world, &bodies, joint).map_err(|e| at(&joint.location, e))?);
        }
        let mut reels = Vec::new();
        for reel in &scene.reels {
            let spec = ReelSpec { rod: threads[reel.thread], at_end: reel.at_end, law: reel.law, supply: reel.supply };
            reels.push(world.insert_reel(&spec).map_err(|e| at(&reel.location, e))?);
        }
        let names = Names {
            threads: scene.threads.iter().map(|t| t.name.clone()).collect(),
            grips: scene.grips.clone(),
            loads: scene.loads.clone(),
        };
        let mut stage = Stage {
            marks: vec![None; threads.len()],
            world,
            threads,
            shapes,
            bodies,
            tips: scene.bodies.iter().map(|b| b.tip).collect(),
            joints,
            reels,
            grips: vec![None; scene.grips.len()],
            loads: vec![None; scene.loads.len()],
            moving: Vec::new(),
            lent: Vec::new(),
            ramps: Vec::new(),
            events: Vec::new(),
            time: 0.0,
            phase_begin: 0.0,
            last: FrameReport { converged: true, ..FrameReport::default() },
            least: (None, None),
            incidents: 0,
            judge: Judge::new(scene.audit),
            probes: vec![Value::Number(f64::NAN); scene.probes.len()],
            seed: scene.seed,
            knots: Mutex::default(),
            names,
        };
        if let Some((path, location)) = &scene.start {
            let saved = SavedFile::read(path).map_err(|e| location.error(format!("{}: {e}", path.display())))?;
            stage.take_up(&saved).map_err(|e| location.error(format!("{}: {e}", path.display())))?;
        }
        for step in &scene.initial {
            stage.apply(step)?;
        }
        Ok(stage)
    }

    /// Does a saved scene's takings and loadings again, then takes its snapshot.
    fn take_up(&mut self, saved: &SavedFile) -> Result<(), String> {
        let find = |list: &[String], name: &str| {
            list.iter().position(|n| n == name).ok_or(format!("it knows `{name}`, this scene does not"))
        };
        for event in &saved.events {
            match event {
                Event::Take { grip, thread, place, hold } => {
                    let (grip, thread) = (find(&self.names.grips, grip)?, find(&self.names.threads, thread)?);
                    self.take(grip, thread, (*place).into(), (*hold).into(), 0.0).map_err(|e| e.to_string())?;
                }
                Event::LetGo { grip } => self.let_go(find(&self.names.grips, grip)?).map_err(|e| e.to_string())?,
                Event::Load { load, thread, kind } => {
                    let (load, thread) = (find(&self.names.loads, load)?, find(&self.names.threads, thread)?);
                    self.set_load(load, thread, from_kind((*kind).into())).map_err(|e| e.to_string())?;
                }
                Event::Cut { thread, particle, part } => {
                    let thread = find(&self.names.threads, thread)?;
                    let part = part.as_ref().map(|part| find(&self.names.threads, part)).transpose()?;
                    self.cut(thread, Place::Particle(*particle), part).map_err(|e| e.to_string())?;
                }
                Event::Unload { load } => self.unload(find(&self.names.loads, load)?).map_err(|e| e.to_string())?,
            }
        }
        self.world.restore(&saved.snapshot).map_err(|e| e.to_string())?;
        for held in self.grips.iter_mut().flatten() {
            held.taken = self.world.grip_pose(held.handle).map_err(|e| e.to_string())?;
        }
        Ok(())
    }

    /// The bytes of a saved state.
    pub fn save(&self) -> Vec<u8> {
        SavedFile { events: self.events.clone(), snapshot: self.world.snapshot() }.to_bytes()
    }

    // ---- actions ----

    pub fn apply(&mut self, step: &Step) -> Result<(), SceneError> {
        self.act(&step.action).map_err(|e| step.location.error(e.to_string()))
    }

    fn act(&mut self, action: &Action) -> Result<(), Error> {
        match action {
            Action::Take { grip, thread, place, hold, ramp } => self.take(*grip, *thread, *place, *hold, *ramp),
            Action::LetGo { grip } => self.let_go(*grip),
            Action::Move { what, plan } => {
                let Some(start) = self.pose_of(*what) else { return Ok(()) };
                self.set_way(*what, Way::Posed)?;
                let taken = if let Mover::Grip(i) = what { self.grips[*i].map_or(start, |h| h.taken) } else { start };
                let motion = plan.motion(start, taken, |s| self.shape_pose(s));
                self.stop_motion(*what);
                self.moving.push(Moving { what: *what, motion, begin: self.time, done: false });
                Ok(())
            }
            Action::Rest { what } => {
                self.stop_motion(*what);
                self.set_way(*what, Way::Posed)
            }
            Action::Hold { body, by } => {
                self.stop_motion(Mover::Body(*body));
                self.lent.retain(|l| l.what != Mover::Body(*body));
                self.world.set_body_motion(self.bodies[*body], BodyMotion::Held { by: self.bodies[*by] })
            }
            Action::Release { body } => {
                self.stop_motion(Mover::Body(*body));
                self.set_way(Mover::Body(*body), Way::Free)
            }
            Action::Push { what, direction, force, speed_limit } => {
                self.stop_motion(*what);
                self.set_way(*what, Way::Pushed(*direction, *force, *speed_limit))
            }
            Action::Load { load, thread, kind, ramp } => {
                self.ramps.retain(|r| !matches!(r.what, Growing::Load { load: l, .. } if l == *load));
                if *ramp <= 0.0 {
                    return self.set_load(*load, *thread, *kind);
                }
                let from = match &self.loads[*load] {
                    Some(acting) if acting.thread == *thread && same_kind(&acting.kind, kind) => acting.kind,
                    _ => scaled(kind, 0.0),
                };
                self.set_load(*load, *thread, from)?;
                self.ramps.push(Ramp {
                    begin: self.time,
                    span: *ramp,
                    what: Growing::Load { load: *load, from, to: *kind },
                });
                Ok(())
            }
            Action::Unload { load } => {
                self.ramps.retain(|r| !matches!(r.what, Growing::Load { load: l, .. } if l == *load));
                self.unload(*load)
            }
            Action::Mark { thread } => {
                self.marks[*thread] = judge::entries(&self.world.rod(self.thread(*thread)?)?);
                Ok(())
            }
            Action::Gravity { value, ramp } => {
                self.ramps.retain(|r| !matches!(r.what, Growing::Gravity { .. }));
                let from = self.world.settings().gravity;
                if *ramp > 0.0 {
                    self.ramps.push(Ramp {
                        begin: self.time,
                        span: *ramp,
                        what: Growing::Gravity { from, to: *value },
                    });
                    return Ok(());
                }
                self.set_gravity(*value)
            }
            Action::Solver {
                linear_damping,
                angular_damping,
                linear_drag,
                angular_drag,
                substep,
                newton_max,
                tolerance,
            } => {
                let mut s = self.world.settings().clone();
                s.linear_damping = linear_damping.unwrap_or(s.linear_damping);
                s.angular_damping = angular_damping.unwrap_or(s.angular_damping);
                s.linear_drag = linear_drag.unwrap_or(s.linear_drag);
                s.angular_drag = angular_drag.unwrap_or(s.angular_drag);
                s.substep = substep.unwrap_or(s.substep);
                s.newton_max = newton_max.unwrap_or(s.newton_max);
                s.tolerance = tolerance.unwrap_or(s.tolerance);
                self.world.set_settings(s)
            }
            Action::Cut { thread, place, part } => self.cut(*thread, *place, *part),
            Action::Reel { reel, law } => self.world.set_reel(self.reels[*reel], *law),
            Action::Friction { a, b, friction } => self.world.set_friction(*a, *b, *friction),
            Action::Remake { thread, change } => {
                let rod = self.thread(*thread)?;
                let material = change.of(self.world.rod(rod)?.material());
                self.world.set_material(rod, &material)?;
                change.stretch.map_or(Ok(()), |stretch| self.world.set_stretch(rod, stretch))
            }
        }
    }

    fn take(&mut self, grip: usize, thread: usize, place: Place, hold: Hold, ramp: f64) -> Result<(), Error> {
        if self.grips[grip].is_some() {
            self.let_go(grip)?;
        }
        let handle =
            self.world.insert_grip(&GripSpec { rod: self.thread(thread)?, place, hold, drive: Drive::Pose, ramp })?;
        let taken = self.world.grip_pose(handle)?;
        self.grips[grip] = Some(Held { handle, thread, place, taken });
        let (grip, thread) = (self.names.grips[grip].clone(), self.names.threads[thread].clone());
        self.events.push(Event::Take { grip, thread, place: place.into(), hold: hold.into() });
        Ok(())
    }
    fn let_go(&mut self, grip: usize) -> Result<(), Error> {
        self.stop_motion(Mover::Grip(grip));
        self.lent.retain(|l| l.what != Mover::Grip(grip));
        if let Some(held) = self.grips[grip].take() {
            self.world.remove_grip(held.handle)?;
            self.events.push(Event::LetGo { grip: self.names.grips[grip].clone() });
        }
        Ok(())
    }
    fn set_load(&mut self, load: usize, thread: usize, kind: LoadDef) -> Result<(), Error> {
        match &mut self.loads[load] {
            Some(acting) if acting.thread == thread => {
                for handle in std::iter::once(acting.handle).chain(acting.also.iter().copied()) {
                    self.world.set_load(handle, to_kind(kind))?;
                }
                acting.kind = kind;
            }
            _ => {
                self.unload(load)?;
                let handle = self.world.insert_load(&LoadSpec { rod: self.thread(thread)?, kind: to_kind(kind) })?;
                self.loads[load] = Some(Acting { handle, also: Vec::new(), thread, kind });
            }
        }
        // Only the last value counts for a saved state.
        let name = &self.names.loads[load];
        let event =
            Event::Load { load: name.clone(), thread: self.names.threads[thread].clone(), kind: to_kind(kind).into() };
        match self.events.last_mut() {
            Some(Event::Load { load, kind: last, .. }) if load == name => *last = to_kind(kind).into(),
            _ => self.events.push(event),
        }
        Ok(())
    }
    fn unload(&mut self, load: usize) -> Result<(), Error> {
        if let Some(acting) = self.loads[load].take() {
            for handle in std::iter::once(acting.handle).chain(acting.also) {
                self.world.remove_load(handle)?;
            }
            self.events.push(Event::Unload { load: self.names.loads[load].clone() });
        }
        Ok(())
    }
    /// Cuts a thread; what the scene knows of places on it goes with them.
    fn cut(&mut self, thread: usize, place: Place, part: Option<usize>) -> Result<(), Error> {
        let handle = self.thread(thread)?;
        let rod = self.world.rod(handle)?;
        let (lengths, closed) = (rod.rest_lengths().to_vec(), rod.is_closed());
        if closed == part.is_some() {
            let value = if closed { "closed" } else { "open" }.into();
            let wanted = "a thread that ends where the scene has its ends";
            return Err(Error::Invalid { what: "cut", field: "thread".into(), value, wanted });
        }
        let cut = self.world.cut(handle, place)?;
        let parting = Parting { lengths, closed, particle: cut.particle as usize };
        self.threads.extend(cut.rest);
        match part {
            Some(_) => self.marks.push(None),
            // It is counted from another start now.
            None => self.marks[thread] = None,
        }
        let of = |on_rest: bool| part.filter(|_| on_rest).unwrap_or(thread);
        for held in self.grips.iter_mut().flatten().filter(|h| h.thread == thread) {
            let (on_rest, place) = parting.carry(held.place);
            (held.thread, held.place) = (of(on_rest), place);
        }
        let carry = |kind: &mut LoadDef| {
            let (LoadDef::Point { place, .. } | LoadDef::Mass { place, .. }) = kind else { return false };
            let (on_rest, now) = parting.carry(*place);
            *place = now;
            on_rest
        };
        for ramp in &mut self.ramps {
            if let Growing::Load { load, from, to } = &mut ramp.what
                && self.loads[*load].as_ref().is_some_and(|acting| acting.thread == thread)
            {
                carry(from);
                carry(to);
            }
        }
        for acting in self.loads.iter_mut().flatten() {
            if acting.thread == thread {
                acting.thread = of(carry(&mut acting.kind));
            }
            let shared = cut.loads.iter().filter(|(here, _)| *here == acting.handle || acting.also.contains(here));
            let shared: Vec<_> = shared.map(|(_, there)| *there).collect();
            acting.also.extend(shared);
        }
        let name = |k: usize| self.names.threads[k].clone();
        let event = Event::Cut { thread: name(thread), particle: cut.particle, part: part.map(name) };
        self.events.push(event);
        Ok(())
    }
    /// A thread that is there.
    fn thread(&self, thread: usize) -> Result<Handle<Rod>, Error> {
        self.threads.get(thread).copied().ok_or(Error::StaleHandle { what: "rod" })
    }
    fn set_gravity(&mut self, gravity: DVec3) -> Result<(), Error> {
        let settings = sutura::Settings { gravity, ..self.world.settings().clone() };
        self.world.set_settings(settings)
    }
    fn stop_motion(&mut self, what: Mover) {
        self.moving.retain(|m| m.what != what);
    }

    // ---- motion ----

    /// The scene wants a thing to be moved this way from here on. What another hand holds it only remembers; what that
    /// hand has left it takes back.
    fn set_way(&mut self, what: Mover, way: Way) -> Result<(), Error> {
        let now = self.pose_of(what);
        if let Some(lent) = self.lent.iter_mut().find(|l| l.what == what) {
            if matches!(lent.state, LentState::Held) {
                (lent.way, lent.place) = (way, now.unwrap_or(lent.place));
                return Ok(());
            }
            self.lent.retain(|l| l.what != what);
        }
        self.put_way(what, way)
    }
    fn put_way(&mut self, what: Mover, way: Way) -> Result<(), Error> {
        match what {
            Mover::Grip(i) => {
                let Some(held) = self.grips[i] else { return Ok(()) };
                let drive = match way {
                    Way::Fixed | Way::Posed | Way::Free => Drive::Pose,
                    Way::Pushed(direction, force, speed_limit) => Drive::Force { direction, force, speed_limit },
                };
                self.world.set_grip_drive(held.handle, drive)
            }
            Mover::Shape(i) => {
                let motion = match way {
                    Way::Fixed | Way::Free => ShapeMotion::Fixed,
                    Way::Posed => ShapeMotion::Driven,
                    Way::Pushed(direction, force, speed_limit) => ShapeMotion::Pushed { direction, force, speed_limit },
                };
                self.world.set_shape_motion(self.shapes[i], motion)
            }
            Mover::Body(i) => {
                let motion = if way == Way::Posed { BodyMotion::Driven } else { BodyMotion::Free };
                self.world.set_body_motion(self.bodies[i], motion)
            }
        }
    }
    fn way_of(&self, what: Mover) -> Option<Way> {
        Some(match what {
            Mover::Grip(i) => match self.world.grip_drive(self.grips[i]?.handle).ok()? {
                Drive::Pose => Way::Posed,
                Drive::Force { direction, force, speed_limit } | Drive::Hand { direction, force, speed_limit } => {
                    Way::Pushed(direction, force, speed_limit)
                }
                _ => return None,
            },
            Mover::Shape(i) => match self.world.shape(self.shapes[i]).ok()?.motion {
                ShapeMotion::Fixed => Way::Fixed,
                ShapeMotion::Driven => Way::Posed,
                ShapeMotion::Pushed { direction, force, speed_limit } => Way::Pushed(direction, force, speed_limit),
                _ => return None,
            },
            Mover::Body(i) => match self.body(i)? {
                b if b.held_by().is_some() => return None,
                b if b.is_driven() => Way::Posed,
                _ => Way::Free,
            },
        })
    }

    /// Somebody else moves a thing from here on; it stands still until they do. Whether there is such a thing.
    pub fn lend(&mut self, what: Mover) -> Result<bool, Error> {
        let (Some(way), Some(place)) = (self.way_of(what), self.pose_of(what)) else { return Ok(false) };
        match self.lent.iter_mut().find(|l| l.what == what) {
            Some(lent) => lent.state = LentState::Held,
            None => self.lent.push(Lent { what, way, place, state: LentState::Held }),
        }
        self.put_way(what, Way::Posed)?;
        Ok(true)
    }
    /// They do so no longer: it stays there.
    pub fn leave(&mut self, what: Mover) -> Result<(), Error> {
        let Some(lent) = self.lent.iter_mut().find(|l| l.what == what) else { return Ok(()) };
        lent.state = LentState::Left;
        self.put_way(what, Way::Posed)
    }
    /// It goes back to where the scene has it, no faster than `speed` \[m/s\] beside what the scene moves it by; what
    /// the scene pushes by a force is pushed at once.
    pub fn give_back(&mut self, what: Mover, speed: f64) -> Result<(), Error> {
        let (Some(k), Some(now)) = (self.lent.iter().position(|l| l.what == what), self.pose_of(what)) else {
            return Ok(());
        };
        let way = self.lent[k].way;
        if matches!(way, Way::Pushed(..) | Way::Free) {
            self.lent.remove(k);
            return self.put_way(what, way);
        }
        let wanted = self.wanted(&self.lent[k], self.time);
        let turn = now.orientation * wanted.orientation.conjugate();
        let off = Pose::new(now.position - wanted.position, if turn.w < 0.0 { -turn } else { turn });
        let span =
            QUINTIC_SLOPE * (off.position.length() / speed.max(1e-6)).max(log(off.orientation).length() / BACK_TURN);
        self.lent[k].state = LentState::Back { off, span, passed: 0.0 };
        self.put_way(what, Way::Posed)
    }
    /// Everything that the scene does not have.
    pub fn lent(&self) -> impl Iterator<Item = Mover> {
        self.lent.iter().map(|l| l.what)
    }

    /// Where the scene has a thing that it lent.
    fn wanted(&self, lent: &Lent, time: f64) -> Pose {
        self.moving.iter().find(|m| m.what == lent.what).map_or(lent.place, |m| m.motion.pose(time - m.begin))
    }
    fn put_pose(&mut self, what: Mover, pose: Pose) -> Result<(), Error> {
        match what {
            Mover::Grip(i) => self.grips[i].map_or(Ok(()), |held| self.world.set_grip_pose(held.handle, pose)),
            Mover::Shape(i) => self.world.set_shape_pose(self.shapes[i], pose),
            Mover::Body(i) => self.world.set_body_pose(self.bodies[i], pose),
        }
    }
    /// Takes back a part of the time for which things were last brought back: the step ended early, and that part did
    /// not pass.
    pub fn not_passed(&mut self, dt: f64) {
        for l in &mut self.lent {
            if let LentState::Back { passed, .. } = &mut l.state {
                *passed = (*passed - dt).max(0.0);
            }
        }
    }
    /// What is on its way back goes on by `dt`; the scene has it at `time`.
    pub fn bring_back(&mut self, time: f64, dt: f64) -> Result<(), Error> {
        let mut lent = std::mem::take(&mut self.lent);
        let mut result = Ok(());
        lent.retain_mut(|l| {
            let wanted = self.wanted(l, time);
            let LentState::Back { off, span, passed } = &mut l.state else { return true };
            *passed += dt;
            let left = if *passed < *span { 1.0 - quintic(*passed / *span) } else { 0.0 };
            let turn = exp(log(off.orientation) * left);
            let pose = Pose::new(wanted.position + off.position * left, (turn * wanted.orientation).normalize());
            let set = self.put_pose(l.what, pose);
            result = std::mem::replace(&mut result, Ok(())).and(set);
            // It arrived with the substep before.
            let there = *passed >= *span + dt;
            if there {
                let set = if l.way == Way::Posed { Ok(()) } else { self.put_way(l.what, l.way) };
                result = std::mem::replace(&mut result, Ok(())).and(set);
            }
            !there
        });
        self.lent = lent;
        result
    }

    /// Whether anything changes from substep to substep.
    pub fn is_driven(&self) -> bool {
        !self.is_done() || self.lent.iter().any(|l| matches!(l.state, LentState::Back { .. }))
    }
    /// Whether nothing that the scene began is still under way.
    pub fn is_done(&self) -> bool {
        self.ramps.is_empty() && self.moving.iter().all(|m| m.done)
    }
    /// Gives the world the poses and loads wanted at a time.
    pub fn drive(&mut self, time: f64) -> Result<(), Error> {
        let mut moving = std::mem::take(&mut self.moving);
        let mut result = Ok(());
        for m in moving.iter_mut().filter(|m| !m.done) {
            let t = time - m.begin;
            m.done = t >= m.motion.duration() - 1e-12;
            if self.lent.iter().all(|l| l.what != m.what) {
                let set = self.put_pose(m.what, m.motion.pose(t));
                result = result.and(set);
            }
        }
        self.moving = moving;
        let ramps = std::mem::take(&mut self.ramps);
        for ramp in ramps {
            let s = quintic((time - ramp.begin) / ramp.span);
            let set = match &ramp.what {
                Growing::Gravity { from, to } => self.set_gravity(from.lerp(*to, s)),
                Growing::Load { load, from, to } => match &self.loads[*load] {
                    Some(acting) => self.set_load(*load, acting.thread, between(from, to, s)),
                    None => Ok(()),
                },
            };
            result = result.and(set);
            if time < ramp.begin + ramp.span - 1e-12 {
                self.ramps.push(ramp);
            }
        }
        result
    }

    pub fn shape_pose(&self, shape: usize) -> Pose {
        self.world.shape(self.shapes[shape]).map_or(Pose::IDENTITY, |s| s.pose)
    }
    /// A grip that holds.
    pub fn grip(&self, grip: usize) -> Option<Handle<Grip>> {
        self.grips[grip].map(|held| held.handle)
    }
    /// Pose of a grip that holds.
    pub fn grip_pose(&self, grip: usize) -> Option<Pose> {
        self.grips[grip].and_then(|held| self.world.grip_pose(held.handle).ok())
    }
    fn pose_of(&self, what: Mover) -> Option<Pose> {
        match what {
            Mover::Grip(i) => self.grip_pose(i),
            Mover::Shape(i) => Some(self.shape_pose(i)),
            Mover::Body(i) => self.body(i).map(|b| b.pose()),
        }
    }

    // ---- reading ----

    pub fn rod(&self, thread: usize) -> Option<RodView<'_>> {
        self.world.rod(*self.threads.get(thread)?).ok()
    }
    pub fn rods(&self) -> impl Iterator<Item = RodView<'_>> {
        (0..self.threads.len()).filter_map(|i| self.rod(i))
    }
    fn body(&self, body: usize) -> Option<BodyView<'_>> {
        self.world.body(self.bodies[body]).ok()
    }
    pub fn bodies(&self) -> impl Iterator<Item = BodyView<'_>> {
        (0..self.bodies.len()).filter_map(|i| self.body(i))
    }
    /// Recognizes the knot of a thread as it is now.
    pub fn knot(&self, thread: usize) -> KnotReport {
        // Nothing panics while it is locked.
        let known = |knots: &mut Vec<(usize, KnotReport)>| {
            knots.iter().find(|(t, _)| *t == thread).map(|(_, knot)| knot.clone())
        };
        if let Some(knot) = self.knots.lock().ok().and_then(|mut knots| known(&mut knots)) {
            return knot;
        }
        let knot = match self.rod(thread) {
            Some(rod) => {
                let held: Vec<f64> =
                    self.grips.iter().flatten().filter(|h| h.thread == thread).map(|h| arc_of(&rod, h.place)).collect();
                judge::recognize(&rod, &held, self.seed)
            }
            None => KnotReport {
                knot: "unknown".into(),
                certain: false,
                determinant: 0,
                signature: 0,
                tried: 0,
                agreed: 0,
                form: None,
            },
        };
        if let Ok(mut knots) = self.knots.lock() {
            knots.push((thread, knot.clone()));
        }
        knot
    }
    /// Forgets what held for the moment before.
    pub fn moment_passed(&mut self) {
        if let Ok(knots) = self.knots.get_mut() {
            knots.clear();
        }
    }
    /// What the steps of a frame, or of a part of it, said.
    pub fn see(&mut self, report: &FrameReport) {
        self.last = report.clone();
        self.least = (lesser(self.least.0, report.thread_clearance), lesser(self.least.1, report.shape_clearance));
    }
    /// Least clearances so far, by the audit where it runs.
    pub fn clearances(&self) -> (Option<f64>, Option<f64>) {
        self.judge.clearances().unwrap_or(self.least)
    }

    fn energy(&self, args: &[Ref], part: impl Fn(&sutura::Energy) -> f64) -> f64 {
        match args.first() {
            Some(Ref::Thread(t)) => self.rod(*t).map_or(f64::NAN, |r| part(&r.energy())),
            Some(Ref::Body(b)) => self.body(*b).map_or(f64::NAN, |b| part(&b.energy())),
            _ => self.rods().map(|r| r.energy()).chain(self.bodies().map(|b| b.energy())).map(|e| part(&e)).sum(),
        }
    }

    /// The thread and place that a reference names; a grip stands for the place that it holds.
    fn on_thread(&self, r: Ref) -> Option<(RodView<'_>, Place)> {
        match r {
            Ref::On(t, at) => self.rod(t).map(|rod| (rod, crate::scene::engine_place(at, rod.rest_length()))),
            Ref::Grip(g) => self.grips[g].and_then(|h| Some((self.rod(h.thread)?, h.place))),
            Ref::Thread(_) | Ref::Shape(_) | Ref::Body(_) | Ref::Joint(_) => None,
        }
    }
    /// A number of one element, or its greatest magnitude over a whole thread.
    fn at_element(&self, args: &[Ref], of: impl Fn(&RodView<'_>, usize) -> f64) -> f64 {
        match args.first() {
            Some(Ref::Thread(t)) => self
                .rod(*t)
                .map_or(f64::NAN, |r| (0..r.n_elements()).map(|j| of(&r, j)).fold(f64::NEG_INFINITY, f64::max)),
            Some(r) => self.on_thread(*r).map_or(f64::NAN, |(rod, place)| of(&rod, element_of(&rod, place))),
            None => f64::NAN,
        }
    }
    fn at_joint(&self, args: &[Ref], of: impl Fn(&RodView<'_>, usize) -> f64) -> f64 {
        match args.first() {
            Some(Ref::Thread(t)) => self
                .rod(*t)
                .map_or(f64::NAN, |r| (0..r.n_elements().saturating_sub(1)).map(|j| of(&r, j)).fold(0.0, f64::max)),
            Some(r) => {
                self.on_thread(*r).and_then(|(rod, place)| Some(of(&rod, joint_of(&rod, place)?))).unwrap_or(f64::NAN)
            }
            None => f64::NAN,
        }
    }
    fn position(&self, r: Ref) -> DVec3 {
        match r {
            Ref::Grip(g) => self.grip_pose(g).map_or(DVec3::NAN, |p| p.position),
            Ref::Shape(s) => self.shape_pose(s).position,
            Ref::Body(b) => self.body(b).map_or(DVec3::NAN, |b| b.pose().position),
            _ => self.on_thread(r).map_or(DVec3::NAN, |(rod, place)| along(&rod, rod.positions(), place)),
        }
    }
    fn orientation(&self, r: Ref) -> DQuat {
        match r {
            Ref::Grip(g) => self.grip_pose(g).map_or(DQuat::NAN, |p| p.orientation),
            Ref::Shape(s) => self.shape_pose(s).orientation,
            Ref::Body(b) => self.body(b).map_or(DQuat::NAN, |b| b.pose().orientation),
            _ => self.on_thread(r).map_or(DQuat::NAN, |(rod, place)| rod.orientations()[element_of(&rod, place)]),
        }
    }
    fn velocity(&self, r: Ref) -> DVec3 {
        match r {
            Ref::Body(b) => self.body(b).map_or(DVec3::NAN, |b| b.velocity()),
            _ => self.on_thread(r).map_or(DVec3::NAN, |(rod, place)| along(&rod, rod.velocities(), place)),
        }
    }
    /// Where the point of a needle is.
    fn tip(&self, r: Ref) -> DVec3 {
        let Ref::Body(b) = r else { return DVec3::NAN };
        self.body(b).zip(self.tips[b]).map_or(DVec3::NAN, |(body, tip)| body.pose().transform_point(tip))
    }
    /// What threads pull a body with.
    fn pull(&self, r: Ref) -> DVec3 {
        let Ref::Body(b) = r else { return DVec3::NAN };
        let slot = self.bodies[b].index();
        let on_it = |w: &sutura::WeldView<'_>| w.body().is_some_and(|(body, _)| body == slot);
        self.world.view().welds().filter(on_it).map(|w| w.force()).sum()
    }
    fn wrench(&self, r: Ref) -> sutura::Wrench {
        let none = sutura::Wrench { force: DVec3::NAN, torque: DVec3::NAN };
        match r {
            Ref::Grip(g) => self.grips[g].and_then(|h| self.world.grip_wrench(h.handle).ok()).unwrap_or(none),
            Ref::Shape(s) => self.world.shape_wrench(self.shapes[s]).unwrap_or(none),
            Ref::Body(b) => self.world.body_wrench(self.bodies[b]).unwrap_or(none),
            Ref::Joint(j) => self
                .world
                .joint(self.joints[j])
                .map_or(none, |j| sutura::Wrench { force: j.force(), torque: j.torque() }),
            _ => none,
        }
    }
    /// Angle of a hinge, way of a slider.
    fn coordinate(&self, r: Ref, kind: JointKind) -> f64 {
        let Ref::Joint(j) = r else { return f64::NAN };
        self.world.joint(self.joints[j]).ok().filter(|j| j.kind() == kind).map_or(f64::NAN, |j| j.coordinate())
    }
    fn gap(&self, a: usize, b: Ref) -> f64 {
        let Some(rod) = self.rod(a) else { return f64::NAN };
        let from = |shape: Handle<Shape>| {
            let shape = self.world.shape(shape);
            shape.map_or(f64::NAN, |s| distance::thread_shape(rod.positions(), rod.radius(), s.geometry, &s.pose))
        };
        match b {
            Ref::Shape(s) => from(self.shapes[s]),
            Ref::Body(b) => {
                let solids = self.world.body_shapes(self.bodies[b]).unwrap_or_default();
                solids.into_iter().map(from).fold(f64::INFINITY, f64::min)
            }
            Ref::Thread(t) if t != a => self.rod(t).map_or(f64::NAN, |other| {
                distance::threads((rod.positions(), rod.radius()), (other.positions(), other.radius()), None)
            }),
            _ => distance::threads(
                (rod.positions(), rod.radius()),
                (rod.positions(), rod.radius()),
                Some(rod.rest_lengths()),
            ),
        }
    }
    fn is_moving(&self, what: Mover) -> bool {
        self.moving.iter().any(|m| m.what == what && !m.done)
    }
}

/// Element in which a place lies; a particle counts to the element that begins there.
fn element_of(rod: &RodView<'_>, place: Place) -> usize {
    let last = rod.n_elements() - 1;
    match place {
        Place::Start => 0,
        Place::End => last,
        Place::Particle(i) | Place::Element(i) => (i as usize).min(last),
        Place::Arc(s) => fraction(rod, s).0,
    }
}

/// Joint nearest to a place; `None` for a thread of one element.
fn joint_of(rod: &RodView<'_>, place: Place) -> Option<usize> {
    let last = rod.n_elements().checked_sub(2)?;
    Some(match place {
        Place::Start => 0,
        Place::End => last,
        Place::Particle(i) => (i as usize).saturating_sub(1).min(last),
        Place::Element(i) => (i as usize).min(last),
        Place::Arc(s) => {
            let (j, u) = fraction(rod, s);
            (if u < 0.5 { j.saturating_sub(1) } else { j }).min(last)
        }
    })
}

/// Element and part of it at an arc length.
fn fraction(rod: &RodView<'_>, s: f64) -> (usize, f64) {
    let mut at = 0.0;
    for (j, l) in rod.rest_lengths().iter().enumerate() {
        if s < at + l {
            return (j, ((s - at) / l).clamp(0.0, 1.0));
        }
        at += l;
    }
    (rod.n_elements() - 1, 1.0)
}

fn arc_of(rod: &RodView<'_>, place: Place) -> f64 {
    let n = rod.n_elements();
    match place {
        Place::Start => 0.0,
        Place::End => rod.rest_length(),
        Place::Particle(i) => rod.arc((i as usize).min(n)),
        Place::Element(i) => 0.5 * (rod.arc((i as usize).min(n - 1)) + rod.arc((i as usize + 1).min(n))),
        Place::Arc(s) => s,
    }
}

/// Something known at particles, at a place (linear between them).
fn along(rod: &RodView<'_>, values: &[DVec3], place: Place) -> DVec3 {
    let n = rod.n_elements();
    match place {
        Place::Start => values[0],
        Place::End => values[n],
        Place::Particle(i) => values[(i as usize).min(n)],
        Place::Element(i) => {
            let j = (i as usize).min(n - 1);
            (values[j] + values[j + 1]) * 0.5
        }
        Place::Arc(s) => {
            let (j, u) = fraction(rod, s);
            values[j].lerp(values[j + 1], u)
        }
    }
}

/// Curvature and twist of the thread as it lies at a joint \[1/m\].
fn bend(rod: &RodView<'_>, joint: usize) -> DVec3 {
    let q = rod.orientations();
    let l = 0.5 * (rod.rest_lengths()[joint] + rod.rest_lengths()[joint + 1]);
    log((q[joint].conjugate() * q[joint + 1]).normalize()) / l
}

fn to_kind(def: LoadDef) -> LoadKind {
    match def {
        LoadDef::Point { place, force, torque } => LoadKind::Point { place, force, torque },
        LoadDef::Uniform { force_per_length } => LoadKind::Uniform { force_per_length },
        LoadDef::Mass { place, mass, inertia } => LoadKind::Mass { place, mass, inertia },
    }
}

fn from_kind(kind: LoadKind) -> LoadDef {
    match kind {
        LoadKind::Point { place, force, torque } => LoadDef::Point { place, force, torque },
        LoadKind::Uniform { force_per_length } => LoadDef::Uniform { force_per_length },
        LoadKind::Mass { place, mass, inertia } => LoadDef::Mass { place, mass, inertia },
    }
}

/// Whether one load may grow into another: the same kind at the same place.
fn same_kind(a: &LoadDef, b: &LoadDef) -> bool {
    match (a, b) {
        (LoadDef::Point { place: p, .. }, LoadDef::Point { place: q, .. })
        | (LoadDef::Mass { place: p, .. }, LoadDef::Mass { place: q, .. }) => p == q,
        (LoadDef::Uniform { .. }, LoadDef::Uniform { .. }) => true,
        _ => false,
    }
}

fn scaled(def: &LoadDef, s: f64) -> LoadDef {
    match *def {
        LoadDef::Point { place, force, torque } => LoadDef::Point { place, force: force * s, torque: torque * s },
        LoadDef::Uniform { force_per_length } => LoadDef::Uniform { force_per_length: force_per_length * s },
        LoadDef::Mass { place, mass, inertia } => LoadDef::Mass { place, mass: mass * s, inertia: inertia * s },
    }
}

fn between(a: &LoadDef, b: &LoadDef, s: f64) -> LoadDef {
    match (*a, *b) {
        (LoadDef::Point { force: f0, torque: t0, .. }, LoadDef::Point { place, force, torque }) => {
            LoadDef::Point { place, force: f0.lerp(force, s), torque: t0.lerp(torque, s) }
        }
        (LoadDef::Uniform { force_per_length: f0 }, LoadDef::Uniform { force_per_length }) => {
            LoadDef::Uniform { force_per_length: f0.lerp(force_per_length, s) }
        }
        (LoadDef::Mass { mass: m0, inertia: i0, .. }, LoadDef::Mass { place, mass, inertia }) => {
            LoadDef::Mass { place, mass: m0 + (mass - m0) * s, inertia: i0.lerp(inertia, s) }
        }
        _ => *b,
    }
}

impl Live for Stage {
    fn probe(&self, probe: usize) -> Value {
        self.probes.get(probe).cloned().unwrap_or(Value::Number(f64::NAN))
    }

    fn read(&self, read: Read, args: &[Ref]) -> Value {
        let first = args.first().copied();
        let thread = match first {
            Some(Ref::Thread(t)) => Some(t),
            _ => None,
        };
        let of_thread = |f: &dyn Fn(&RodView<'_>) -> f64| {
            Value::Number(thread.and_then(|t| self.rod(t)).map_or(f64::NAN, |r| f(&r)))
        };
        let place = first.unwrap_or(Ref::Thread(0));
        match read {
            Read::Time => Value::Number(self.time),
            Read::PhaseTime => Value::Number(self.time - self.phase_begin),
            Read::Position => Value::Vector(self.position(place)),
            Read::Velocity => Value::Vector(self.velocity(place)),
            Read::D1 => Value::Vector(self.orientation(place) * DVec3::X),
            Read::D2 => Value::Vector(self.orientation(place) * DVec3::Y),
            Read::D3 => Value::Vector(self.orientation(place) * DVec3::Z),
            Read::Orientation => Value::Columns(self.orientation(place).to_array().to_vec()),
            Read::Tension => Value::Number(self.at_element(args, |r, j| r.internal_force(j).z)),
            Read::Shear => Value::Number(self.at_element(args, |r, j| r.internal_force(j).truncate().length())),
            Read::Moment => Value::Vector(
                self.on_thread(place).and_then(|(rod, p)| Some(rod.moment(joint_of(&rod, p)?))).unwrap_or(DVec3::NAN),
            ),
            Read::Bending => Value::Number(self.at_joint(args, |r, j| r.moment(j).truncate().length())),
            Read::Torsion => Value::Number(match thread {
                Some(_) => self.at_joint(args, |r, j| r.moment(j).z.abs()),
                None => self.at_joint(args, |r, j| r.moment(j).z),
            }),
            Read::Curvature => Value::Number(self.at_joint(args, |r, j| bend(r, j).truncate().length())),
            Read::TwistRate => Value::Number(self.at_joint(args, |r, j| bend(r, j).z)),
            Read::Force => Value::Vector(self.wrench(place).force),
            Read::Torque => Value::Vector(self.wrench(place).torque),
            Read::Mass => Value::Number(match place {
                Ref::Body(b) => self.body(b).map_or(f64::NAN, |b| b.mass().mass),
                _ => f64::NAN,
            }),
            Read::Center => Value::Vector(match place {
                Ref::Body(b) => self.body(b).map_or(DVec3::NAN, |b| b.center()),
                _ => DVec3::NAN,
            }),
            Read::Tip => Value::Vector(self.tip(place)),
            Read::Pull => Value::Vector(self.pull(place)),
            Read::Wrench => {
                let w = self.wrench(place);
                Value::Columns(w.force.to_array().into_iter().chain(w.torque.to_array()).collect())
            }
            Read::Distance => {
                Value::Number(args.get(1).map_or(f64::NAN, |b| self.position(place).distance(self.position(*b))))
            }
            Read::Gap => Value::Number(thread.map_or(f64::NAN, |t| self.gap(t, args.get(1).copied().unwrap_or(place)))),
            // Nothing near is far away.
            Read::Clearance => Value::Number(self.last.clearance().unwrap_or(f64::INFINITY)),
            Read::ThreadClearance => Value::Number(self.last.thread_clearance.unwrap_or(f64::INFINITY)),
            Read::ShapeClearance => Value::Number(self.last.shape_clearance.unwrap_or(f64::INFINITY)),
            Read::MinClearance => {
                let (a, b) = self.clearances();
                Value::Number(lesser(a, b).unwrap_or(f64::INFINITY))
            }
            Read::Energy => Value::Number(self.energy(args, sutura::Energy::total)),
            Read::Kinetic => Value::Number(self.energy(args, |e| e.kinetic)),
            Read::Elastic => Value::Number(self.energy(args, |e| e.stretch + e.bend + e.twist)),
            Read::Elongation => match thread {
                Some(_) => of_thread(&|r| r.max_elongation()),
                None => Value::Number(self.rods().map(|r| r.max_elongation()).fold(0.0, f64::max)),
            },
            Read::Length => of_thread(&|r| r.positions().windows(2).map(|p| p[0].distance(p[1])).sum()),
            Read::Twist => of_thread(&|r| r.twist()),
            Read::Writhe => of_thread(&|r| judge::writhe(r)),
            Read::Speed => {
                let fastest = |r: &RodView<'_>| r.velocities().iter().map(|v| v.length()).fold(0.0, f64::max);
                match first {
                    None => {
                        let bodies = self.bodies().map(|b| b.velocity().length());
                        Value::Number(self.rods().map(|r| fastest(&r)).chain(bodies).fold(0.0, f64::max))
                    }
                    Some(Ref::Thread(_)) => of_thread(&fastest),
                    Some(r) => Value::Number(self.velocity(r).length()),
                }
            }
            Read::JointAngle => Value::Number(self.coordinate(place, JointKind::Hinge)),
            Read::JointWay => Value::Number(self.coordinate(place, JointKind::Slider)),
            Read::Spin => Value::Number(match place {
                Ref::Body(b) => self.body(b).map_or(f64::NAN, |b| b.angular_velocity().length()),
                _ => f64::NAN,
            }),
            Read::Momentum => Value::Vector(match first {
                Some(Ref::Thread(t)) => self.rod(t).map_or(DVec3::NAN, |r| r.momentum()),
                Some(Ref::Body(b)) => self.body(b).map_or(DVec3::NAN, |b| b.momentum()),
                _ => self.rods().map(|r| r.momentum()).chain(self.bodies().map(|b| b.momentum())).sum(),
            }),
            Read::Contacts => Value::Number(f64::from(self.last.contacts)),
            Read::Incidents => Value::Number(self.incidents as f64),
            Read::Done => Value::Truth(match first {
                Some(Ref::Grip(g)) => !self.is_moving(Mover::Grip(g)),
                Some(Ref::Shape(s)) => !self.is_moving(Mover::Shape(s)),
                Some(Ref::Body(b)) => !self.is_moving(Mover::Body(b)),
                _ => self.is_done(),
            }),
            Read::Held => Value::Truth(match first {
                Some(Ref::Grip(g)) => self.grips[g].is_some(),
                Some(Ref::Body(b)) => self.body(b).is_some_and(|b| b.held_by().is_some()),
                _ => false,
            }),
            Read::Knot => Value::Text(thread.map_or("unknown".into(), |t| self.knot(t).knot)),
            Read::Determinant => Value::Number(thread.map_or(f64::NAN, |t| self.knot(t).determinant as f64)),
            Read::Signature => Value::Number(thread.map_or(f64::NAN, |t| self.knot(t).signature as f64)),
            Read::Form => Value::Text(thread.and_then(|t| self.knot(t).form).map_or("none".into(), |f| f.verdict)),
            Read::TurningShare => Value::Number(thread.and_then(|t| self.knot(t).form).map_or(f64::NAN, |f| f.share)),
            Read::Entries => {
                let e = thread.and_then(|t| self.rod(t)).and_then(|r| judge::entries(&r));
                let [a, b] = e.and_then(|e| e.loop_ab).unwrap_or([f64::NAN; 2]);
                Value::Columns(vec![e.map_or(f64::NAN, |e| e.tail_a), a, b, e.map_or(f64::NAN, |e| e.tail_b)])
            }
            Read::LoopTension => {
                Value::Number(thread.and_then(|t| judge::loop_tension(&self.rod(t)?)).unwrap_or(f64::NAN))
            }
            Read::Slip => Value::Number(
                thread
                    .and_then(|t| Some((self.marks[t]?, judge::entries(&self.rod(t)?)?)))
                    .map_or(f64::NAN, |(before, now)| now.slip_since(&before)),
            ),
            Read::PassesThrough => Value::Truth(self.judge.passes_through() == Some(true)),
        }
    }
}

/// The parts of [`Read`] that a profile reads at one element.
pub fn read_at_element(stage: &Stage, read: Read, thread: usize, element: usize) -> Value {
    stage.read(read, &[Ref::On(thread, At::Element(element as u32))])
}
