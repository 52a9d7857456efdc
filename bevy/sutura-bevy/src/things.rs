//! Components that put things into the world: threads, bodies, grips.

use crate::clock::PhysicsClock;
use crate::world::{Part, Sutura};
use bevy::prelude::*;
use sutura::glam::{DQuat, DVec3};
use sutura::math::{exp, log};
use sutura::{Drive, GripSpec, Handle, Hold, Place, Pose, Rod, RodSpec, Shape, ShapeMotion, ShapeSpec, Solver, Wrench};

/// A thread. It is in the world from the next frame on, and as long as its entity lives.
#[derive(Component, Debug)]
#[require(Transform, Visibility)]
pub struct Thread {
    spec: Option<RodSpec>,
    handle: Option<Handle<Rod>>,
    own: bool,
    error: Option<sutura::Error>,
    /// How it looks.
    pub look: crate::look::ThreadLook,
}

impl Thread {
    /// A thread to put into the world.
    pub fn new(spec: RodSpec) -> Self {
        Thread { spec: Some(spec), handle: None, own: true, error: None, look: crate::look::ThreadLook::default() }
    }
    /// One that is in the world already and stays there.
    pub fn of(handle: Handle<Rod>) -> Self {
        Thread { spec: None, handle: Some(handle), own: false, error: None, look: crate::look::ThreadLook::default() }
    }
    /// The same in another look.
    pub fn looking(self, look: crate::look::ThreadLook) -> Self {
        Thread { look, ..self }
    }
    /// Its handle in [`Sutura::world`], once it is there.
    pub fn handle(&self) -> Option<Handle<Rod>> {
        self.handle
    }
    /// Why it is not there: the world refused it.
    pub fn error(&self) -> Option<&sutura::Error> {
        self.error.as_ref()
    }
}

/// How a grip or body gets to its target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Fastest that it moves \[m/s\].
    pub speed: f64,
    /// Fastest that it turns \[rad/s\].
    pub turn: f64,
    /// Whether it gives way, as a hand does: it moves with no more than `force`, slower by the part of that which it
    /// meets, and then turns with no more than `torque`. One that does not is a machine: it moves and turns whatever
    /// the force, and a thread that cannot follow gets stuck. (In a world of the paper's solver, which knows no such
    /// drive, everything is a machine.)
    pub yields: bool,
    /// Greatest force of one that yields \[N\].
    pub force: f64,
    /// Greatest torque of one that yields \[N m\].
    pub torque: f64,
}

impl Default for Limits {
    fn default() -> Self {
        Limits { speed: 1.0, turn: 10.0, yields: true, force: 5.0, torque: 0.05 }
    }
}

/// What is done with a thing in a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Go {
    /// It holds where it is.
    Stay,
    /// A force takes it along a line.
    Push { direction: DVec3, force: f64, speed_limit: f64 },
    /// It is led to this pose.
    Lead(Pose),
}

impl Limits {
    /// What is done in one of `frames` frames of `dt` \[s\] in which something at `now` that acts with a force and
    /// torque would like to reach its target.
    fn go(&self, now: Pose, acting: Wrench, target: Option<Pose>, dt: f64, frames: u32) -> Go {
        let strained = acting.force.length() > OVER * self.force;
        if self.yields
            && strained
            && let Some(direction) = acting.force.try_normalize()
        {
            // Drawn harder than it may hold, it gives way along the pull.
            return Go::Push { direction, force: self.force, speed_limit: self.speed };
        }
        let Some(target) = target else { return Go::Stay };
        let part = 1.0 / f64::from(frames.max(1));
        let way = ((target.position - now.position) * part).clamp_length_max(self.speed * dt);
        if self.yields && way.length() > CLOSE {
            return Go::Push { direction: way.normalize(), force: self.force, speed_limit: way.length() / dt };
        }
        let turn = log((target.orientation * now.orientation.conjugate()).normalize());
        let mut turn = (turn * part).clamp_length_max(self.turn * dt);
        if self.yields
            && let Some(axis) = turn.try_normalize()
        {
            turn *= (1.0 - acting.torque.dot(axis) / self.torque).clamp(0.0, 1.0);
        }
        let next = Pose::new(
            if self.yields { now.position } else { now.position + way },
            (exp(turn) * now.orientation).normalize(),
        );
        if next == now { Go::Stay } else { Go::Lead(next) }
    }
}

/// How far above its limit a force is before what acts with it gives way, so that the limit itself can be held.
const OVER: f64 = 1.02;

/// A body that threads touch: a shape of the engine.
#[derive(Component, Debug)]
#[require(Transform, Visibility)]
pub struct Body {
    spec: Option<ShapeSpec>,
    handle: Option<Handle<Shape>>,
    own: bool,
    error: Option<sutura::Error>,
    /// Where it is to be \[m\]; it goes there within `limits`. `None` leaves it to what moves it otherwise.
    pub target: Option<Pose>,
    /// How it goes there.
    pub limits: Limits,
    /// How it looks.
    pub look: crate::look::BodyLook,
    /// What moved it before a target did: `None` while no target does, or where the simulation remembers it.
    before: Option<ShapeMotion>,
    /// Whether a target moves it.
    taken: bool,
    wrench: Wrench,
}

impl Body {
    /// A body to put into the world.
    pub fn new(spec: ShapeSpec) -> Self {
        Body {
            spec: Some(spec),
            handle: None,
            own: true,
            error: None,
            target: None,
            limits: Limits { speed: 0.5, ..Limits::default() },
            look: crate::look::BodyLook::default(),
            before: None,
            taken: false,
            wrench: Wrench::default(),
        }
    }
    /// One that is in the world already and stays there.
    pub fn of(handle: Handle<Shape>) -> Self {
        Body {
            spec: None,
            handle: Some(handle),
            own: false,
            error: None,
            target: None,
            limits: Limits { speed: 0.5, ..Limits::default() },
            look: crate::look::BodyLook::default(),
            before: None,
            taken: false,
            wrench: Wrench::default(),
        }
    }
    /// The same in another look.
    pub fn looking(self, look: crate::look::BodyLook) -> Self {
        Body { look, ..self }
    }
    /// Its handle in [`Sutura::world`], once it is there.
    pub fn handle(&self) -> Option<Handle<Shape>> {
        self.handle
    }
    /// Why it is not there.
    pub fn error(&self) -> Option<&sutura::Error> {
        self.error.as_ref()
    }
    /// Force and torque with which threads act on it \[N\], \[N m\], world axes of the engine.
    pub fn wrench(&self) -> Wrench {
        self.wrench
    }
}

/// A grip on a thread. It holds from the next frame on, as long as its entity lives.
#[derive(Component, Debug)]
pub struct Grip {
    /// Entity of the thread.
    thread: Entity,
    place: Place,
    hold: Hold,
    /// Where it is to be \[m\]: it is there at the end of the frames of physics of the same drawn frame, unless a limit
    /// is reached. `None` lets it hold where it is.
    pub target: Option<Pose>,
    /// How it goes there.
    pub limits: Limits,
    handle: Option<Handle<sutura::Grip>>,
    own: bool,
    error: Option<sutura::Error>,
    /// The pose now; of one that does not yield the one given last.
    pose: Pose,
    /// Whether it moves: the simulation leaves it to this grip then.
    taken: bool,
    wrench: Wrench,
}

impl Grip {
    /// Takes hold of a thread (its entity) over 20 ms.
    pub fn new(thread: Entity, place: Place, hold: Hold) -> Self {
        Grip {
            thread,
            place,
            hold,
            target: None,
            limits: Limits::default(),
            handle: None,
            own: true,
            error: None,
            pose: Pose::IDENTITY,
            taken: false,
            wrench: Wrench::default(),
        }
    }
    /// Drives one that is in the world already and stays there.
    pub fn of(thread: Entity, handle: Handle<sutura::Grip>, pose: Pose) -> Self {
        Grip { handle: Some(handle), own: false, pose, ..Grip::new(thread, Place::Start, Hold::Pin) }
    }
    /// The same with other limits: speed \[m/s\] and force \[N\].
    pub fn limited(self, speed_limit: f64, force_limit: f64) -> Self {
        Grip { limits: Limits { speed: speed_limit, force: force_limit, ..self.limits }, ..self }
    }
    /// Its handle in [`Sutura::world`], once it holds.
    pub fn handle(&self) -> Option<Handle<sutura::Grip>> {
        self.handle
    }
    /// Why it does not hold.
    pub fn error(&self) -> Option<&sutura::Error> {
        self.error.as_ref()
    }
    /// The thread that it holds.
    pub fn thread(&self) -> Entity {
        self.thread
    }
    /// Where it is \[m\].
    pub fn pose(&self) -> Pose {
        self.pose
    }
    /// Force and torque with which it acts on the thread \[N\], \[N m\], world axes of the engine.
    pub fn wrench(&self) -> Wrench {
        self.wrench
    }
    /// Force \[N\] with which it acts on the thread.
    pub fn force(&self) -> f64 {
        self.wrench.force.length()
    }
}

/// A target this close is reached \[m\]: a thousandth of the thinnest thread.
const CLOSE: f64 = 1e-7;

/// Part of the way from one orientation to another, the short way.
fn toward(from: DQuat, to: DQuat, part: f64) -> DQuat {
    let to = if from.dot(to) < 0.0 { -to } else { to };
    from.lerp(to, part).normalize()
}

/// Puts what was spawned into the world.
pub(crate) fn take_up(
    mut sutura: ResMut<Sutura>,
    mut threads: Query<&mut Thread>,
    mut bodies: Query<&mut Body>,
    mut grips: Query<&mut Grip>,
) {
    for mut thread in threads.iter_mut().filter(|t| t.spec.is_some()) {
        let Some(spec) = thread.spec.take() else { continue };
        match sutura.edit().insert_rod(&spec) {
            Ok(handle) => thread.handle = Some(handle),
            Err(e) => {
                error!("a thread is refused: {e}");
                thread.error = Some(e);
            }
        }
    }
    for mut body in bodies.iter_mut().filter(|b| b.spec.is_some()) {
        let Some(spec) = body.spec.take() else { continue };
        match sutura.edit().insert_shape(&spec) {
            Ok(handle) => body.handle = Some(handle),
            Err(e) => {
                error!("a body is refused: {e}");
                body.error = Some(e);
            }
        }
    }
    for mut grip in grips.iter_mut().filter(|g| g.handle.is_none() && g.error.is_none()) {
        let Some(rod) = threads.get(grip.thread).ok().and_then(Thread::handle) else { continue };
        let taken = sutura.edit().insert_grip(&GripSpec::new(rod, grip.place, grip.hold));
        match taken.and_then(|handle| Ok((handle, sutura.world().grip_pose(handle)?))) {
            Ok((handle, pose)) => (grip.handle, grip.pose) = (Some(handle), pose),
            Err(e) => {
                warn!("a grip does not hold: {e}");
                grip.error = Some(e);
            }
        }
    }
}

/// One frame of physics: what is held goes toward its target, the world is stepped, and forces are read.
pub(crate) fn step(
    mut sutura: ResMut<Sutura>,
    clock: Res<PhysicsClock>,
    mut bodies: Query<&mut Body>,
    mut grips: Query<&mut Grip>,
) {
    let (dt, frames) = (clock.frame, clock.remaining);
    let machines = matches!(sutura.world().settings().solver, Solver::Paper(_));
    let allowed = |limits: Limits| Limits { yields: limits.yields && !machines, ..limits };
    // Both lists: where each is now, and where it is led. A handle may have gone stale by what the simulation did; then
    // there is nothing to move.
    let mut led: Vec<(Part, Pose, Pose)> = Vec::new();
    for mut grip in &mut grips {
        let Some(handle) = grip.handle else { continue };
        let Ok(now) = sutura.world().grip_drive(handle) else { continue };
        if !grip.taken {
            // One of the simulation's is in this hand from the beginning on.
            grip.taken = true;
            if !grip.own {
                sutura.hold(Part::Grip(handle), true);
            }
        }
        let go = allowed(grip.limits).go(grip.pose, grip.wrench, grip.target, dt, frames);
        let drive = match go {
            Go::Push { direction, force, speed_limit } => Drive::Hand { direction, force, speed_limit },
            Go::Stay | Go::Lead(_) => Drive::Pose,
        };
        if drive != now {
            let _ = sutura.edit().set_grip_drive(handle, drive);
        }
        if let Go::Lead(next) = go {
            led.push((Part::Grip(handle), grip.pose, next));
            grip.pose = next;
        }
    }
    for mut body in &mut bodies {
        let Some(handle) = body.handle else { continue };
        let Ok((pose, now)) = sutura.world().shape(handle).map(|s| (s.pose, s.motion)) else { continue };
        if body.taken != body.target.is_some() {
            body.taken = body.target.is_some();
            let seen_to = sutura.hold(Part::Body(handle), body.taken);
            if body.taken {
                body.before = (!seen_to).then_some(now);
            } else if let Some(before) = body.before.take() {
                let _ = sutura.edit().set_shape_motion(handle, before);
            }
        }
        if !body.taken {
            continue;
        }
        // What threads do to it is what the hand has to hold against.
        let acting = Wrench { force: -body.wrench.force, torque: -body.wrench.torque };
        let go = allowed(body.limits).go(pose, acting, body.target, dt, frames);
        let motion = match go {
            Go::Push { direction, force, speed_limit } => ShapeMotion::Pushed { direction, force, speed_limit },
            Go::Stay | Go::Lead(_) => ShapeMotion::Driven,
        };
        if sutura.world().shape(handle).is_ok_and(|s| s.motion != motion) {
            let _ = sutura.edit().set_shape_motion(handle, motion);
        }
        if let Go::Lead(next) = go {
            led.push((Part::Body(handle), pose, next));
        }
    }
    sutura.step(dt, clock.most_frame, &mut |world, part| {
        for (what, from, to) in &led {
            let pose = between(*from, *to, part);
            let _ = match what {
                Part::Grip(grip) => world.set_grip_pose(*grip, pose),
                Part::Body(body) => world.set_shape_pose(*body, pose),
            };
        }
    });
    for mut grip in &mut grips {
        let Some(handle) = grip.handle else { continue };
        if let Ok((pose, wrench)) =
            sutura.world().grip_pose(handle).and_then(|p| Ok((p, sutura.world().grip_wrench(handle)?)))
        {
            // A pin has no orientation of its own, and keeps the one that it was given.
            let turned = if grip.hold == Hold::Pin { grip.pose.orientation } else { pose.orientation };
            (grip.pose, grip.wrench) = (Pose::new(pose.position, turned), wrench);
        }
    }
    for mut body in &mut bodies {
        if let Some(wrench) = body.handle.and_then(|h| sutura.world().shape_wrench(h).ok()) {
            body.wrench = wrench;
        }
    }
}

fn between(from: Pose, to: Pose, part: f64) -> Pose {
    Pose::new(from.position.lerp(to.position, part), toward(from.orientation, to.orientation, part))
}

// What is despawned leaves the world. A handle may be stale already: with a thread its grips go.

pub(crate) fn thread_gone(gone: On<Remove, Thread>, threads: Query<&Thread>, mut sutura: ResMut<Sutura>) {
    if let Some(handle) = threads.get(gone.entity).ok().filter(|t| t.own).and_then(Thread::handle) {
        let _ = sutura.edit().remove_rod(handle);
    }
}

pub(crate) fn body_gone(gone: On<Remove, Body>, bodies: Query<&Body>, mut sutura: ResMut<Sutura>) {
    if let Some(handle) = bodies.get(gone.entity).ok().filter(|b| b.own).and_then(Body::handle) {
        let _ = sutura.edit().remove_shape(handle);
    }
}

pub(crate) fn grip_gone(gone: On<Remove, Grip>, grips: Query<&Grip>, mut sutura: ResMut<Sutura>) {
    let Ok(grip) = grips.get(gone.entity) else { return };
    match grip.handle {
        Some(handle) if grip.own => drop(sutura.edit().remove_grip(handle)),
        Some(handle) if grip.taken => drop(sutura.hold(Part::Grip(handle), false)),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_moves_keeps_its_limits_and_rests_where_it_is_to_be() {
        let (limits, none) = (Limits::default(), Wrench::default());
        let machine = Limits { yields: false, ..limits };
        let to = |p: DVec3| Some(Pose::at(p));
        assert_eq!(limits.go(Pose::IDENTITY, none, None, 0.01, 1), Go::Stay);
        assert_eq!(machine.go(Pose::IDENTITY, none, to(DVec3::X), 0.01, 1), Go::Lead(Pose::at(DVec3::X * 0.01)));
        assert_eq!(machine.go(Pose::IDENTITY, none, to(DVec3::X), 10.0, 4), Go::Lead(Pose::at(DVec3::X * 0.25)));
        assert_eq!(
            limits.go(Pose::IDENTITY, none, to(DVec3::X), 10.0, 4),
            Go::Push { direction: DVec3::X, force: limits.force, speed_limit: 0.025 }
        );
        assert_eq!(limits.go(Pose::IDENTITY, none, to(DVec3::ZERO), 0.01, 1), Go::Stay);
        // Drawn harder than it may hold: along the pull, whatever it is to do.
        let strained = Wrench { force: DVec3::Y * 6.0, ..none };
        let gives = Go::Push { direction: DVec3::Y, force: limits.force, speed_limit: limits.speed };
        assert_eq!(
            (
                limits.go(Pose::IDENTITY, strained, None, 0.01, 1),
                limits.go(Pose::IDENTITY, strained, to(DVec3::X), 0.01, 1)
            ),
            (gives, gives)
        );
        // It turns slower by the part of its torque that it meets, and not at all against all of it.
        let turned = Some(Pose::new(DVec3::ZERO, DQuat::from_rotation_z(1.0)));
        for (met, angle) in [(0.0, 0.1), (0.25, 0.075), (1.0, 0.0), (2.0, 0.0), (-1.0, 0.1)] {
            let acting = Wrench { torque: DVec3::Z * met * limits.torque, ..none };
            let now = match limits.go(Pose::IDENTITY, acting, turned, 0.01, 1) {
                Go::Lead(pose) => log(pose.orientation).z,
                other => {
                    if other == Go::Stay {
                        0.0
                    } else {
                        panic!("{other:?}")
                    }
                }
            };
            assert!((now - angle).abs() < 1e-12, "{now} {angle}");
        }
    }
}
