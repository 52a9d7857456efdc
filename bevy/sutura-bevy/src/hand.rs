//! The mouse takes hold of threads and bodies.

use crate::mesh::Triangles;
use crate::space::Space;
use crate::things::{Body, Grip, Thread};
use crate::world::Sutura;
use bevy::prelude::*;
use bevy::window::PrimaryWindow;
use sutura::glam::DVec3;
use sutura::{Geometry, Handle, Hold, Place, Pose, Rod};

/// Marks the camera through which the pointer looks.
#[derive(Component, Debug, Clone, Copy, Default)]
pub struct PointerCamera;

/// The input of the hand. Where there is a primary window and a [`PointerCamera`], it is read from the mouse each
/// frame; else (in a test, on another device) whoever has such a thing writes it.
#[derive(Resource, Debug, Clone, Default)]
pub struct Pointer {
    /// Line of sight through the pointer in Bevy's world.
    pub ray: Option<Ray3d>,
    /// Direction in which the camera looks; what is held moves across it.
    pub forward: Vec3,
    /// Whether the button is down.
    pub pressed: bool,
    /// Whether something else has the mouse, such as a panel under it: then nothing is taken.
    pub busy: bool,
    /// How much nearer (negative) or farther what is held is to come, part of its distance.
    pub farther: f32,
    /// Angle within which a thread beside the line of sight is taken \[rad\].
    pub reach: f32,
}

/// What the hand holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Held {
    /// A thread, by a [`Grip`] (this entity).
    Thread(Entity),
    /// A [`Body`] (this entity).
    Body(Entity),
}

/// The hand of the mouse.
#[derive(Resource, Debug, Clone)]
pub struct Hand {
    /// How it takes threads.
    pub hold: Hold,
    /// What it holds.
    pub held: Option<Held>,
    /// Where it was taken, now \[m\], and the force with which it acts on what it holds \[N\], world axes of the
    /// engine.
    pub at: DVec3,
    /// See `at`.
    pub force: DVec3,
    /// Fastest that it moves what it holds \[m/s\].
    pub speed_limit: f64,
    /// Force from which on it pulls no harder \[N\].
    pub force_limit: f64,
    /// Middle of what is held less the point of the line of sight that holds it \[m\].
    offset: DVec3,
    /// Distance of that point along the line of sight's plane \[units\].
    depth: f32,
    was_pressed: bool,
}

impl Default for Hand {
    fn default() -> Self {
        Hand {
            hold: Hold::Pin,
            held: None,
            at: DVec3::ZERO,
            force: DVec3::ZERO,
            speed_limit: 1.0,
            force_limit: 5.0,
            offset: DVec3::ZERO,
            depth: 0.0,
            was_pressed: false,
        }
    }
}

impl Hand {
    /// Holds nothing any more, as where what it held is gone. It takes again when the button goes down anew.
    pub fn let_go(&mut self) {
        (self.held, self.force, self.was_pressed) = (None, DVec3::ZERO, true);
    }
}

/// Reads the mouse.
pub(crate) fn read_pointer(
    mut pointer: ResMut<Pointer>,
    windows: Query<&Window, With<PrimaryWindow>>,
    cameras: Query<(&Camera, &GlobalTransform), With<PointerCamera>>,
    buttons: Option<Res<ButtonInput<MouseButton>>>,
) {
    let (Ok(window), Ok((camera, place)), Some(buttons)) = (windows.single(), cameras.single(), buttons) else {
        return;
    };
    // Eight pixels of the window's height.
    pointer.reach = 8.0 * 0.8 / window.height().max(1.0);
    pointer.forward = place.forward().into();
    pointer.ray = window.cursor_position().and_then(|at| camera.viewport_to_world(place, at).ok());
    pointer.pressed = buttons.pressed(MouseButton::Left);
}

/// Takes what is under the pointer when its button goes down, moves it while it is held, and lets go.
pub(crate) fn grab(
    mut commands: Commands,
    mut hand: ResMut<Hand>,
    mut pointer: ResMut<Pointer>,
    space: Res<Space>,
    sutura: Res<Sutura>,
    threads: Query<(Entity, &Thread)>,
    mut bodies: Query<(Entity, &mut Body)>,
    mut grips: Query<&mut Grip>,
) {
    let pressed = pointer.pressed && !(pointer.busy && hand.held.is_none());
    let farther = std::mem::take(&mut pointer.farther);
    if !pressed {
        match hand.held.take() {
            Some(Held::Thread(grip)) => commands.entity(grip).try_despawn(),
            Some(Held::Body(body)) => {
                if let Ok((_, mut body)) = bodies.get_mut(body) {
                    // It stays where it was put, unless it is moved by something else.
                    body.target = None;
                }
            }
            None => {}
        }
        (hand.force, hand.was_pressed) = (DVec3::ZERO, false);
        return;
    }
    let (fresh, Some(ray)) = (!hand.was_pressed, pointer.ray) else { return };
    hand.was_pressed = true;
    let cosine = ray.direction.dot(pointer.forward).max(0.1);
    if fresh && hand.held.is_none() {
        let (origin, direction) = (space.place_back(ray.origin), space.direction_back(*ray.direction));
        let thread = nearest_thread(&sutura, threads.iter(), origin, direction, f64::from(pointer.reach));
        let body = nearest_body(&sutura, bodies.iter(), origin, direction);
        let t = match (thread, body) {
            // A thread behind a body is hidden.
            (Some(thread), body) if body.is_none_or(|b| thread.t <= b.1 + thread.radius) => {
                let theirs =
                    thread.handle.and_then(|rod| Some((sutura.grip_at(rod, thread.particle)?, sutura.world())));
                let grip = match theirs.and_then(|(grip, world)| Some((grip, world.grip_pose(grip).ok()?))) {
                    Some((grip, pose)) => Grip::of(thread.entity, grip, pose),
                    None => Grip::new(thread.entity, Place::Particle(thread.particle as u32), hand.hold),
                };
                let grip = grip.limited(hand.speed_limit, hand.force_limit);
                hand.held = Some(Held::Thread(commands.spawn(grip).id()));
                hand.offset = thread.at - (origin + direction * thread.t);
                thread.t
            }
            (_, Some((entity, t, at))) => {
                hand.held = Some(Held::Body(entity));
                hand.offset = at - (origin + direction * t);
                t
            }
            _ => return,
        };
        hand.depth = (t * f64::from(space.scale)) as f32 * cosine;
    }
    hand.depth = (hand.depth * (1.0 + farther)).max(1e-3);
    let at = space.place_back(ray.origin + *ray.direction * (hand.depth / cosine)) + hand.offset;
    hand.at = at;
    match hand.held {
        Some(Held::Thread(grip)) => {
            // In the frame in which it is taken, the grip is not there yet and stays where it took.
            if let Ok(mut grip) = grips.get_mut(grip) {
                let orientation = grip.pose().orientation;
                (grip.limits.speed, grip.limits.force) = (hand.speed_limit, hand.force_limit);
                grip.target = Some(Pose::new(at, orientation));
                hand.force = grip.wrench().force;
            }
        }
        Some(Held::Body(body)) => {
            if let Ok((_, mut body)) = bodies.get_mut(body) {
                if let Some(pose) = body.handle().and_then(|h| sutura.world().shape(h).ok()).map(|s| s.pose) {
                    body.target = Some(Pose::new(at, pose.orientation));
                    (body.limits.speed, body.limits.force) = (hand.speed_limit, hand.force_limit);
                    // It may not have come along.
                    hand.at = pose.position;
                }
                // What the hand has to hold against.
                hand.force = -body.wrench().force;
            }
        }
        None => {}
    }
}

/// A thread under the pointer.
#[derive(Clone, Copy)]
struct Found {
    entity: Entity,
    handle: Option<Handle<Rod>>,
    particle: usize,
    /// Along the ray \[m\].
    t: f64,
    at: DVec3,
    radius: f64,
    /// How far beside the line of sight its surface is, as an angle \[rad\].
    beside: f64,
}

/// The thread whose picture is nearest to the line of sight.
fn nearest_thread<'a>(
    sutura: &Sutura,
    threads: impl Iterator<Item = (Entity, &'a Thread)>,
    origin: DVec3,
    direction: DVec3,
    reach: f64,
) -> Option<Found> {
    let mut best: Option<Found> = None;
    for (entity, thread) in threads {
        let Some(rod) = thread.handle().and_then(|h| sutura.world().rod(h).ok()) else { continue };
        for (particle, at) in rod.positions().iter().enumerate() {
            let t = (*at - origin).dot(direction);
            if t <= 0.0 {
                continue;
            }
            let distance = (*at - origin - direction * t).length();
            // Particles are apart by an element; what lies between them is on the thread too.
            let length = rod.rest_lengths()[particle.min(rod.n_elements() - 1)];
            let beside = (distance - rod.radius() - 0.5 * length).max(0.0) / t;
            let nearer = |b: &Found| (beside, distance) < (b.beside, (b.at - origin - direction * b.t).length());
            if beside <= reach && best.as_ref().is_none_or(nearer) {
                best =
                    Some(Found { entity, handle: thread.handle(), particle, t, at: *at, radius: rod.radius(), beside });
            }
        }
    }
    best
}

/// The first body that the line of sight hits: entity, distance \[m\] and its position. Planes are no bodies to take,
/// and hide nothing.
fn nearest_body<'a>(
    sutura: &Sutura,
    bodies: impl Iterator<Item = (Entity, &'a Body)>,
    origin: DVec3,
    direction: DVec3,
) -> Option<(Entity, f64, DVec3)> {
    let mut best: Option<(Entity, f64, DVec3)> = None;
    for (entity, body) in bodies {
        let Some(shape) = body.handle().and_then(|h| sutura.world().shape(h).ok()) else { continue };
        if matches!(shape.geometry, Geometry::Plane) {
            continue;
        }
        let back = shape.pose.orientation.conjugate();
        let hit = Triangles::of(shape.geometry, 0.0).hit(shape.pose.inverse_transform_point(origin), back * direction);
        if let Some(t) = hit.filter(|t| best.is_none_or(|b| *t < b.1)) {
            best = Some((entity, t, shape.pose.position));
        }
    }
    best
}
