//! Components that put things into the world: threads, bodies, grips.

use crate::clock::PhysicsClock;
use crate::world::Sutura;
use bevy::prelude::*;
use sutura::glam::DQuat;
use sutura::{Drive, GripSpec, Handle, Hold, Place, Pose, Rod, RodSpec, Shape, ShapeMotion, ShapeSpec, Wrench};

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

/// A body that threads touch: a shape of the engine.
#[derive(Component, Debug)]
#[require(Transform, Visibility)]
pub struct Body {
    spec: Option<ShapeSpec>,
    handle: Option<Handle<Shape>>,
    own: bool,
    error: Option<sutura::Error>,
    /// Where it is to be \[m\]; it goes there no faster than `speed_limit`. `None` leaves it to what moves it otherwise.
    pub target: Option<Pose>,
    /// \[m/s\].
    pub speed_limit: f64,
    /// How it looks.
    pub look: crate::look::BodyLook,
    /// What moved it before a target did.
    before: Option<ShapeMotion>,
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
            speed_limit: 0.5,
            look: crate::look::BodyLook::default(),
            before: None,
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
            speed_limit: 0.5,
            look: crate::look::BodyLook::default(),
            before: None,
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
    /// Where it is to be \[m\]: it is there at the end of the frames of physics of the same drawn frame, unless a limit is reached. `None` lets it
    /// hold where it is.
    pub target: Option<Pose>,
    /// Fastest that it moves \[m/s\].
    pub speed_limit: f64,
    /// Whether it gives way, as a hand does: it goes to its target with no more than `force_limit`, slower by the part of that which it meets, and does
    /// not turn. One that does not is a machine: it moves and turns whatever the force, and a thread that cannot follow gets stuck.
    pub yields: bool,
    /// Greatest force of one that yields \[N\].
    pub force_limit: f64,
    handle: Option<Handle<sutura::Grip>>,
    own: bool,
    error: Option<sutura::Error>,
    /// The pose now; of one that does not yield the one given last.
    pose: Pose,
    /// Whether a force drives it.
    pushing: bool,
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
            speed_limit: 1.0,
            yields: true,
            force_limit: 5.0,
            handle: None,
            own: true,
            error: None,
            pose: Pose::IDENTITY,
            pushing: false,
            wrench: Wrench::default(),
        }
    }
    /// Drives one that is in the world already and stays there.
    pub fn of(thread: Entity, handle: Handle<sutura::Grip>, pose: Pose) -> Self {
        Grip { handle: Some(handle), own: false, pose, ..Grip::new(thread, Place::Start, Hold::Pin) }
    }
    /// The same with other limits: speed \[m/s\] and force \[N\].
    pub fn limited(self, speed_limit: f64, force_limit: f64) -> Self {
        Grip { speed_limit, force_limit, ..self }
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

    /// Where it goes in one of `frames` frames of `dt` \[s\] in which it would like to reach its target.
    fn next(&self, dt: f64, frames: u32) -> Pose {
        let Some(target) = self.target else { return self.pose };
        let part = 1.0 / f64::from(frames.max(1));
        let step = ((target.position - self.pose.position) * part).clamp_length_max(self.speed_limit * dt);
        Pose::new(self.pose.position + step, toward(self.pose.orientation, target.orientation, part))
    }

    /// How one that yields gets there: by a force along the way, at a speed that brings it there where nothing resists.
    fn drive(&self, dt: f64, frames: u32) -> Drive {
        let way = self.next(dt, frames).position - self.pose.position;
        match way.try_normalize().filter(|_| way.length() > CLOSE) {
            Some(direction) => Drive::Force { direction, force: self.force_limit, speed_limit: way.length() / dt },
            None => Drive::Pose,
        }
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
pub(crate) fn take_up(mut sutura: ResMut<Sutura>, mut threads: Query<&mut Thread>, mut bodies: Query<&mut Body>, mut grips: Query<&mut Grip>) {
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
pub(crate) fn step(mut sutura: ResMut<Sutura>, clock: Res<PhysicsClock>, mut bodies: Query<&mut Body>, mut grips: Query<&mut Grip>) {
    let dt = clock.frame;
    let mut held: Vec<(Handle<sutura::Grip>, Pose, Pose)> = Vec::new();
    for mut grip in &mut grips {
        let Some(handle) = grip.handle else { continue };
        let drive = if grip.yields && grip.target.is_some() { grip.drive(dt, clock.remaining) } else { Drive::Pose };
        // What is driven by a scene is left to it while nothing else is wanted.
        if (grip.pushing || drive != Drive::Pose) && sutura.edit().set_grip_drive(handle, drive).is_err() {
            continue;
        }
        grip.pushing = drive != Drive::Pose;
        if !grip.yields && grip.target.is_some() {
            let next = grip.next(dt, clock.remaining);
            held.push((handle, grip.pose, next));
            grip.pose = next;
        }
    }
    let mut moved: Vec<(Handle<Shape>, Pose, Pose)> = Vec::new();
    for mut body in &mut bodies {
        let Some(handle) = body.handle else { continue };
        let Ok((now, motion)) = sutura.world().shape(handle).map(|s| (s.pose, s.motion)) else { continue };
        match (body.target, body.before) {
            (Some(target), before) => {
                if before.is_none() {
                    body.before = Some(motion);
                }
                if motion != ShapeMotion::Driven && sutura.edit().set_shape_motion(handle, ShapeMotion::Driven).is_err() {
                    continue;
                }
                let part = 1.0 / f64::from(clock.remaining.max(1));
                let way = ((target.position - now.position) * part).clamp_length_max(body.speed_limit * dt);
                moved.push((handle, now, Pose::new(now.position + way, toward(now.orientation, target.orientation, part))));
            }
            (None, Some(before)) => {
                body.before = None;
                if before != motion && sutura.edit().set_shape_motion(handle, before).is_err() {
                    continue;
                }
            }
            (None, None) => {}
        }
    }
    sutura.step(dt, &mut |world, part| {
        // A handle may have gone stale by what the simulation did in between; then there is nothing to move.
        for (handle, from, to) in &held {
            let _ = world.set_grip_pose(*handle, between(*from, *to, part));
        }
        for (handle, from, to) in &moved {
            let _ = world.set_shape_pose(*handle, between(*from, *to, part));
        }
    });
    for mut grip in &mut grips {
        let Some(handle) = grip.handle else { continue };
        if let Ok(wrench) = sutura.world().grip_wrench(handle) {
            grip.wrench = wrench;
        }
        if let Some(pose) = sutura.world().grip_pose(handle).ok().filter(|_| grip.yields) {
            grip.pose = pose;
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
    if let Some(handle) = grips.get(gone.entity).ok().filter(|g| g.own).and_then(Grip::handle) {
        let _ = sutura.edit().remove_grip(handle);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sutura::glam::DVec3;

    #[test]
    fn a_grip_keeps_its_speed_and_rests_where_it_is_to_be() {
        let mut grip = Grip::new(Entity::PLACEHOLDER, Place::Start, Hold::Pin);
        grip.target = Some(Pose::at(DVec3::X));
        assert!((grip.next(0.01, 1).position - DVec3::X * 0.01).length() < 1e-15);
        assert!((grip.next(10.0, 4).position - DVec3::X * 0.25).length() < 1e-15);
        let Drive::Force { direction, force, speed_limit } = grip.drive(10.0, 4) else { panic!("not driven by force") };
        assert_eq!((direction, force), (DVec3::X, grip.force_limit));
        assert!((speed_limit - 0.025).abs() < 1e-15);
        grip.target = Some(Pose::IDENTITY);
        assert_eq!(grip.drive(0.01, 1), Drive::Pose);
    }
}
