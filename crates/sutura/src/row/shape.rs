//! Contact of thread with shapes: normal force `k gap^2` for gap < 0, gap = signed distance of the centerline point
//! less r (and less a fiftieth of the diameter, kept in reserve for the chords between particles), with Coulomb
//! friction. It stiffens as Hertz contact does; k is such that a force of `E r^2 / 1000` leaves a gap of -r / 100.
//!
//! A row that bore a firm load is a spring in the rods' own matrix: cost is linear in the number of such rows. All
//! others (light ones, those that touch, lift off or lie much deeper than their force says) enter the small contact
//! problem ([`system`]), which decides all of them at once; Newton alone would switch them on and off from one
//! iteration to the next.
//!
//! Friction is a tangential spring from the anchor of the last substep (Cundall and Strack 1979), as stiff as the
//! normal one: while the trial force `f0 - k * slip` is within mu times the normal force it sticks, and does not creep;
//! beyond, the force stays on the disc. Both forces act at the centerline.
//! The friction of rows that slide follows their normal forces within each iteration ([`follow`](crate::row::follow)).
//! Which of the two a firm row does is decided once an iteration, going by what it did in the one before (an active
//! set): one that slides and is pushed back against its friction has stopped. Going by the trial force alone it would
//! slide the other way then, and to and fro, since the spring is 10^4 times and more stiffer than the inertia behind
//! it. A substep counts only where the law agrees with the forces that it was solved with, and the next one starts from
//! those.
//!
//! A row that slides by more than a trace has the kinetic coefficient in the next substep. Within a substep there is
//! one coefficient, or evening out forces between contacts that together hold would set them off one after the other.
//!
//! [`system`]: crate::row::system

use crate::collide::{Candidates, Pressed};
use crate::math::{Pose, outer};
use crate::model::collider::{APART, Collider, Distance};
use crate::model::shape::ShapeMotion;
use crate::model::{Model, ShapeModel};
use crate::motion::Motion;
use crate::params;
use crate::rod::scratch::RodScratch;
use crate::row::Rows;
use crate::row::border::Border;
use crate::row::movers::Movers;
use crate::row::side::{Endpoint, Side};
use crate::row::system::{Entry, Source, regain};
use crate::state::{Contact, Site, State};
use core::ops::Range;
use glam::{DMat3, DVec3};

/// A place on a thread that may touch a shape in this substep.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ShapeRow {
    shape: u32,
    element: u32,
    s: f64,
    radius: f64,
    /// Normal force over gap squared \[N/m^2\], and normal stiffness at the last look \[N/m\].
    hardness: f64,
    stiffness: f64,
    /// Friction coefficients: the kinetic one holds if it slid in the last substep.
    mu: [f64; 2],
    sliding: bool,
    /// Least normal force of a firm row \[N\].
    least: f64,
    /// In the rods' matrix, not in the small problem.
    firm: bool,
    /// Left out of the small problem, it was violated.
    activate: bool,
    /// Friction force at the start of the substep, in the tangent plane then, and slip that was still to be undone.
    friction_before: DVec3,
    residual_slip: DVec3,
    /// Compliance with which it was last in the small problem \[m/N\].
    effective_compliance: f64,
    /// Direction of the element, and, between its particles, that of the thread as a smooth curve.
    along: DVec3,
    smooth: Option<DVec3>,
    /// At a particle whose foot is that of an edge row: see [`leave_to_edges`].
    beside_edge: bool,
    /// Outward direction of the surface, the point of it that is touched, and gap at the last look.
    normal: DVec3,
    surface: DVec3,
    gap: f64,
    /// Distance from the surface at the start.
    before: Distance,
    /// Gap at the start, and where the velocity of the thread and the shape's drive would lead.
    start_gap: f64,
    next_gap: f64,
    /// Normal force at the start.
    force_before: f64,
    /// Force on the thread at the last look (firm) or of the last solution.
    pub normal_force: f64,
    friction: DVec3,
    /// Normal force that limits the friction of a firm row, and what that does.
    pressed: f64,
    mode: Mode,
    /// Direction of its friction while it slides, and what the size of that has grown by since the matrix was put
    /// together \[N\].
    rim: DVec3,
    followed: f64,
    /// How often it slid and stopped in this substep.
    stops: u32,
    /// Stiffness of a firm row as last assembled, and the force that the step after it predicted.
    tangent: DMat3,
    predicted_force: DVec3,
}

/// What the friction of a firm row does, with the direction of its force.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Mode {
    Sticks,
    Slides(DVec3),
}

/// Normal force over E times the gap squared.
const HARDNESS: f64 = 10.0;

/// Radius of a surface, with the thread's own, from which on a row within an element does not follow the nearest place,
/// in radii of the thread.
const FLAT: f64 = 8.0;

/// How often a firm row may slide and stop in a substep.
const RESTLESS: u32 = 1;

/// How much nearer than its ends a place within an element is that has a row of its own, in radii; and over an edge
/// sharper than the thread.
const BULGE: f64 = 0.08;
const SHARP_BULGE: f64 = 0.004;

impl ShapeRow {
    /// Its element, when it may enter the small problem.
    pub fn compliant_element(&self) -> Option<usize> {
        (!self.firm).then_some(self.element as usize)
    }

    pub fn on(&self) -> (u32, usize) {
        (self.shape, self.element as usize)
    }

    /// How deep its force presses the thread into the shape \[m\].
    pub fn depth(&self) -> f64 {
        (self.normal_force.max(0.0) / self.hardness).sqrt()
    }

    fn mu(&self) -> f64 {
        self.mu[usize::from(self.sliding)]
    }

    /// Place along all threads, in elements.
    fn place(&self) -> f64 {
        f64::from(self.element) + self.s
    }

    fn key(&self) -> (u32, f64) {
        (self.shape, self.place())
    }

    /// Takes over an old contact.
    fn receive(&mut self, c: &Contact) {
        let across = |v: DVec3| v - self.normal * self.normal.dot(v);
        self.sliding |= c.sliding;
        self.residual_slip = across(c.residual_slip);
        self.force_before += c.normal_force;
        self.normal_force = self.force_before;
        self.friction_before += across(c.friction);
        self.friction = self.friction_before;
        self.firm = self.force_before > self.least;
        self.mode = Some(self.friction)
            .filter(|_| self.sliding)
            .and_then(DVec3::try_normalize)
            .map_or(Mode::Sticks, Mode::Slides);
    }

    /// Says whether this is a firm row that slides.
    pub fn slides(&self) -> bool {
        self.firm && self.rim != DVec3::ZERO
    }

    /// Returns what its friction is too small by where the step leads, and whether it presses there.
    pub fn missing(&self, step: &[DVec3], movers: &Movers, border: &Border) -> (f64, bool) {
        let pressed = self.normal_force - self.stiffness * self.normal.dot(moved(self, step, movers, border));
        (self.mu() * (pressed.max(0.0) - self.pressed) - self.followed, pressed > 0.0)
    }

    /// What the limit of its friction gains by a step.
    pub fn gained(&self, step: &[DVec3], movers: &Movers, border: &Border) -> f64 {
        -self.mu() * self.stiffness * self.normal.dot(moved(self, step, movers, border))
    }

    /// Makes its friction larger.
    pub fn grow(&mut self, by: f64) {
        self.followed += by;
    }

    /// Adds a friction force of this size, and its reaction, to right sides.
    pub fn push(&self, size: f64, right: &mut [DVec3], movers: &Movers, border: &mut Border) {
        let (e, force) = (self.element as usize, self.rim * size);
        right[2 * e] += force * (1.0 - self.s);
        right[2 * e + 2] += force * self.s;
        if let Some(moves) = movers.moves(self.shape, self.surface) {
            moves.load(-force, border);
        }
    }

    /// Normal and two tangents.
    fn axes(&self) -> [DVec3; 3] {
        let n = self.normal;
        let t1 = (self.along - n * n.dot(self.along)).try_normalize().unwrap_or_else(|| n.any_orthonormal_vector());
        [n, t1, n.cross(t1)]
    }

    /// Compliance with which it enters the small problem: gap over force at the last force, which a light contact is
    /// taken to have at least.
    fn compliance(&self) -> f64 {
        1.0 / (self.hardness * self.normal_force.max(self.least)).sqrt()
    }

    /// Takes the small problem's force.
    pub fn solved(&mut self, force: DVec3) {
        let [_, t1, t2] = self.axes();
        self.normal_force = force.x;
        self.friction = t1 * force.y + t2 * force.z;
    }
}

/// What the rows of one element on one shape have in common.
struct Pair<'a> {
    model: &'a Model,
    slot: u32,
    element: usize,
    /// Way of a pushed shape that nothing resists.
    pushed: DVec3,
    start: &'a [DVec3],
    start_pose: &'a Pose,
    now: &'a [DVec3],
    pose: &'a Pose,
}

impl Pair<'_> {
    fn shape(&self) -> &ShapeModel {
        self.model.shapes.at(self.slot).expect("candidate shapes live")
    }

    /// Distances of a place at the start and where velocity leads, in the direction of the first.
    fn look(&self, s: f64) -> (Distance, Distance) {
        let e = self.element;
        let at = |x: &[DVec3]| {
            if s == 0.0 {
                x[e]
            } else if s == 1.0 {
                x[e + 1]
            } else {
                x[e].lerp(x[e + 1], s)
            }
        };
        let before = self.shape().collider.distance(self.start_pose, at(self.start));
        (
            before,
            self.shape().collider.follow(
                (self.start_pose, at(self.start), before),
                (self.pose, at(self.now)),
                before.normal,
            ),
        )
    }

    /// Direction of the thread at a place within the element, which turns evenly from the middle of one element to that
    /// of the next.
    fn smooth_direction(&self, s: f64) -> DVec3 {
        let (e, x) = (self.element, self.start);
        let of = |e: usize| (x[e + 1] - x[e]).normalize_or_zero();
        let own = of(e);
        let (at_joint, part) = if s > 0.5 {
            (if self.model.is_element(e + 1) { own + of(e + 1) } else { own }, 2.0 * s - 1.0)
        } else {
            (if e > 0 && self.model.is_element(e - 1) { own + of(e - 1) } else { own }, 1.0 - 2.0 * s)
        };
        own.lerp(at_joint.normalize_or(own), part).normalize_or(own)
    }

    fn row(&self, s: f64, before: Distance, now: Distance) -> ShapeRow {
        let e = self.element;
        let rod = self.model.rods.at(self.model.rod_of[e]).expect("element of a living rod");
        let friction = self.model.friction_between(rod.surface, self.shape().surface);
        let gap = before.value - rod.radius * (1.0 + 2.0 * params::KEEP);
        let smooth = (s > 0.0 && s < 1.0).then(|| self.smooth_direction(s));
        ShapeRow {
            shape: self.slot,
            element: e as u32,
            s,
            radius: rod.radius,
            hardness: HARDNESS * rod.material.young_modulus,
            stiffness: 0.0,
            least: params::FIRM * rod.material.young_modulus * rod.radius * rod.radius,
            mu: [friction.stick, friction.slide],
            sliding: false,
            firm: false,
            activate: false,
            friction_before: DVec3::ZERO,
            residual_slip: DVec3::ZERO,
            effective_compliance: 0.0,
            along: (self.start[e + 1] - self.start[e]).normalize_or_zero(),
            smooth,
            beside_edge: false,
            normal: across(before.normal, smooth),
            surface: DVec3::ZERO,
            gap,
            before,
            start_gap: gap,
            next_gap: gap + now.value - before.value - before.normal.dot(self.pushed),
            force_before: 0.0,
            normal_force: 0.0,
            friction: DVec3::ZERO,
            mode: Mode::Sticks,
            rim: DVec3::ZERO,
            followed: 0.0,
            stops: 0,
            pressed: 0.0,
            tangent: DMat3::ZERO,
            predicted_force: DVec3::ZERO,
        }
    }
}

/// Collects the rows of the substep and gives them the forces of the last one.
pub(crate) fn prepare(model: &Model, state: &State, motion: &Motion, candidates: &Candidates, rows: &mut Rows, h: f64) {
    let Motion { start, start_shape_pose, .. } = motion;
    let (rows, movers) = (&mut rows.shapes, &mut rows.movers);
    rows.clear();
    movers.begin(model, state, h);
    let x = &state.position;
    let mut last = None;
    for (slot, e) in &candidates.shapes {
        let (k, e) = (*slot as usize, *e as usize);
        let shape = model.shapes.at(*slot).expect("candidate shapes live");
        let radius = model.rods.at(model.rod_of[e]).expect("element of a living rod").radius;
        let pushed = match shape.motion {
            ShapeMotion::Pushed { direction, force, speed_limit } if force > 0.0 => direction * (speed_limit * h),
            _ => DVec3::ZERO,
        };
        let (start_pose, pose) = (&start_shape_pose[k], &state.shape_pose[k]);
        let pair = Pair { model, slot: *slot, element: e, pushed, start, start_pose, now: x, pose };
        let reach = radius * (1.0 + params::REACH);
        // Neighboring elements share a particle.
        let first = last.take().filter(|(at, _)| *at == (*slot, e)).map_or_else(|| pair.look(0.0), |(_, seen)| seen);
        let second = pair.look(1.0);
        last = Some(((*slot, e + 1), second));
        let nearer = |(before, now): (Distance, Distance)| before.value.min(now.value);
        let (d0, d1) = (nearer(first), nearer(second));
        let length = (x[e + 1] - x[e]).length();
        if d0.min(d1) > reach + length {
            continue;
        }
        let mut add = |s: f64, before: Distance, now: Distance| {
            if before.value.min(now.value) <= reach {
                rows.push(pair.row(s, before, now));
            }
        };
        // At a particle, against all walls of a mesh that it may touch.
        let mut at_particle = |i: usize, s: f64, seen: (Distance, Distance)| {
            add(s, seen.0, seen.1);
            let near = radius * (1.0 + params::MARGIN) + 1.5 * (x[i] - start[i]).length().min(4.0 * radius);
            shape.collider.further_walls(start_pose, start[i], near, |before| {
                add(s, before, shape.collider.follow((start_pose, start[i], before), (pose, x[i]), before.normal));
            });
        };
        at_particle(e, 0.0, first);
        if !model.is_element(e + 1) {
            at_particle(e + 1, 1.0, second);
        }
        let mut places = [0.0; params::PLACES];
        let mut count = 0;
        let mut between = |s: f64, value: f64| {
            let apart = places[..count].iter().all(|p: &f64| (p - s).abs() * length > params::SAME_EDGE * radius);
            if bulges([d0, d1], s, value, length, radius) && apart && count < places.len() {
                places[count] = s;
                count += 1;
            }
        };
        let below = d0.min(d1) - SHARP_BULGE * radius;
        // As things are, and where velocity leads if that is elsewhere.
        let seen = |pose: &Pose, x: &[DVec3]| [x[e], x[e + 1]].map(|p| pose.inverse_transform_point(p));
        let (local, next) = (seen(start_pose, start), seen(pose, x));
        let body = |d: Distance| Distance { normal: start_pose.orientation.conjugate() * d.normal, ..d };
        shape.collider.least_between(local, [body(first.0), body(second.0)], below, |s, d| between(s, d.value));
        let moved = (next[0] - local[0]).length_squared().max((next[1] - local[1]).length_squared());
        if moved > (params::SAME_ROW * radius).powi(2) {
            shape
                .collider
                .least_between(next, next.map(|p| shape.collider.distance_local(p)), below, |s, d| between(s, d.value));
        }
        for s in &places[..count] {
            let seen = pair.look(*s);
            let kept = keep_place(state.contacts.shapes(), &pair, *s, nearer(seen), length, radius);
            let (before, now) = if kept == *s { seen } else { pair.look(kept) };
            add(kept, before, now);
        }
    }
    rows.sort_unstable_by(|a, b| a.key().partial_cmp(&b.key()).expect("places are numbers"));
    leave_to_edges(rows, start);
    inherit(state.contacts.shapes(), model, rows);
    merge(rows);
}

/// Whether a place between two particles needs a row of its own: where the surface bulges toward the middle by more
/// than may overlap. On a flatter one a chord would rock about the row: the closest place runs along the element by
/// (radius of the surface) x (tilt). It does not about an edge sharper than the thread, which shows by how fast the
/// distance grows.
fn bulges(ends: [f64; 2], s: f64, value: f64, length: f64, radius: f64) -> bool {
    let way = length * if ends[0] < ends[1] { s } else { 1.0 - s };
    let bulge = ends[0].min(ends[1]) - value;
    // The distance grows by way^2 / (2 (R + r)) from the nearest place of a surface of radius R.
    let sharp = way * way < 4.0 * radius * bulge;
    s > 0.02 && s < 0.98 && (bulge > BULGE * radius || sharp && bulge > SHARP_BULGE * radius)
}

/// Where a place within an element is taken to touch: where it last did, as far as that is about as near as the nearest
/// place `s`, whose distance is `value`. The nearest place on a flat surface runs along the element with the least
/// tilt, and a row that follows it makes the element rock: it would tilt back by as much in the next substep. On an
/// edge it stays where it is while the thread is drawn over it, and the row has to follow.
fn keep_place(old: &[Contact], pair: &Pair<'_>, s: f64, value: f64, length: f64, radius: f64) -> f64 {
    let here = Some((pair.slot, pair.element as u32));
    let from = old.partition_point(|c| c.on_shape() < here);
    let near = old[from..].iter().take_while(|c| c.on_shape() == here);
    let places = near.filter_map(|c| c.a.thread()).map(|(_, s)| s).filter(|s| *s > 0.0 && *s < 1.0);
    let Some(last) = places.min_by(|a, b| (a - s).abs().total_cmp(&(b - s).abs())) else { return s };
    let (before, now) = pair.look(last);
    let farther = before.value.min(now.value) - value;
    // The distance grows by way^2 / (2 (R + r)) from the nearest place of a surface of radius R.
    let (way, allowed) = ((last - s) * length, params::SAME_PLACE * radius);
    if way * way < 2.0 * FLAT * radius * farther {
        return s;
    }
    s + (last - s) * if farther <= allowed { 1.0 } else { (allowed / farther).sqrt() }
}

/// Drops rows at particles beside an edge that has its own row on the element: both have the same foot. A thread bears
/// on an edge with its side, across its direction; a row at a particle that is yet to come to the edge would bear on it
/// head on, and each particle that is drawn over it would be a bump.
fn leave_to_edges(rows: &mut Vec<ShapeRow>, start: &[DVec3]) {
    let at = |r: &ShapeRow| {
        let e = r.element as usize;
        if r.s == 0.0 { start[e] } else { start[e].lerp(start[e + 1], r.s) }
    };
    let foot = |r: &ShapeRow| at(r) - r.before.normal * r.before.value;
    for k in 0..rows.len() {
        let row = rows[k];
        if row.smooth.is_some() {
            continue;
        }
        let beside = |edge: &ShapeRow| {
            let way = (at(edge) - at(&row)).length();
            let sharp = way < 1.5 * row.radius && (foot(edge) - foot(&row)).length() < 0.5 * way;
            edge.smooth.is_some() && edge.before.value < row.before.value && sharp
        };
        let near = &rows[between(rows, row.shape, row.place() - 1.0, row.place() + 1.0)];
        rows[k].beside_edge = near.iter().any(beside);
    }
    rows.retain(|r| !r.beside_edge);
}

/// Rows on a shape whose places are within a range, of rows in the order of shapes and places.
fn between(rows: &[ShapeRow], shape: u32, from: f64, to: f64) -> Range<usize> {
    rows.partition_point(|r| r.key() < (shape, from))..rows.partition_point(|r| r.key() <= (shape, to))
}

/// Gives each old contact's force and friction to the row on the same shape that is nearest to it along the thread, or
/// on another one in its place: the half of a post that a thread touches now may be the other one.
fn inherit(old: &[Contact], model: &Model, rows: &mut [ShapeRow]) {
    for c in old {
        let (Some((element, s)), Some(shape)) = (c.a.thread(), c.b.shape()) else { continue };
        let place = f64::from(element) + s;
        let nearest = |shape: u32, reach: f64, facing: f64| {
            let far = |k: &usize| (rows[*k].place() - place).abs();
            let there = |r: &ShapeRow| {
                model.rod_of[r.element as usize] == model.rod_of[element as usize] && r.normal.dot(c.normal) > facing
            };
            between(rows, shape, place - reach, place + reach)
                .filter(|k| there(&rows[*k]))
                .min_by(|a, b| far(a).total_cmp(&far(b)))
        };
        let found = nearest(shape, 0.3, 0.5)
            .or_else(|| model.shapes.iter().find_map(|(other, _)| nearest(other, 1e-9, 0.9999)));
        if let Some(k) = found {
            rows[k].receive(c);
        }
    }
}

/// Leaves one of rows at one place against shapes that lie in one another, such as the halves of a post: the one that
/// is nearer now and next, or where they are alike the one that bore force. Both stay where one overtakes the other.
fn merge(rows: &mut Vec<ShapeRow>) {
    rows.sort_unstable_by(|a, b| {
        a.element
            .cmp(&b.element)
            .then(a.s.total_cmp(&b.s))
            .then(b.force_before.total_cmp(&a.force_before))
            .then(a.shape.cmp(&b.shape))
    });
    rows.dedup_by(|b, a| {
        // Neighboring elements share a particle.
        let place = (a.place() - b.place()).abs() < 1e-3;
        if !place || a.normal.dot(b.normal) < 0.99 {
            return false;
        }
        let alike = 1e-3 * a.radius;
        let farther = [b.start_gap - a.start_gap, b.next_gap - a.next_gap];
        let (first, second) = (farther.iter().all(|f| *f > -alike), farther.iter().all(|f| *f < alike));
        if second && !first {
            core::mem::swap(a, b);
        }
        first || second
    });
}

/// What of a surface's direction is across the thread. A thread is bent over an edge in a smooth curve, which the edge
/// presses across: across the elements, from one to the next, the force would turn back and forth, and each joint drawn
/// over the edge would be a notch.
fn across(normal: DVec3, smooth: Option<DVec3>) -> DVec3 {
    smooth.map_or(normal, |t| (normal - t * t.dot(normal)).normalize_or(normal))
}

/// Looks where the row is now; its point on the centerline.
fn evaluate(model: &Model, state: &State, motion: &Motion, row: &mut ShapeRow) -> DVec3 {
    let e = row.element as usize;
    let shape = model.shapes.at(row.shape).expect("rows name living shapes");
    let p = state.position[e].lerp(state.position[e + 1], row.s);
    let from = motion.start[e].lerp(motion.start[e + 1], row.s);
    let k = row.shape as usize;
    let d =
        shape.collider.follow((&motion.start_shape_pose[k], from, row.before), (&state.shape_pose[k], p), row.normal);
    row.normal = across(d.normal, row.smooth);
    row.gap = d.value - row.radius * (1.0 + 2.0 * params::KEEP);
    row.surface = p - row.normal * row.radius;
    p
}

/// Slip of the thread against the shape's surface since the start of the substep, with what was still to be undone
/// then.
fn slip(state: &State, motion: &Motion, row: &ShapeRow) -> DVec3 {
    let e = row.element as usize;
    let (n, p) = (row.normal, state.position[e].lerp(state.position[e + 1], row.s));
    let taken_along = surface_motion(
        &motion.start_shape_pose[row.shape as usize],
        &state.shape_pose[row.shape as usize],
        p - n * row.radius,
    );
    let slip = p - motion.start[e].lerp(motion.start[e + 1], row.s) - taken_along + row.residual_slip;
    slip - n * n.dot(slip)
}

/// Looks at a firm row: its normal force and stiffness, and the friction force that would undo all slip. In the first
/// iteration the row is linearized where it bore its force: Newton starts where velocity leads, which may be just
/// off the surface.
fn evaluate_penalty(model: &Model, state: &State, motion: &Motion, row: &mut ShapeRow, first: bool) -> DVec3 {
    evaluate(model, state, motion, row);
    let n = row.normal;
    let depth = (-row.gap).max(0.0);
    row.pressed = row.hardness * depth * depth;
    if first && row.force_before > row.pressed {
        let depth_before = (row.force_before / row.hardness).sqrt();
        row.pressed = row.force_before;
        row.stiffness = 2.0 * row.hardness * depth_before;
        row.normal_force = row.force_before + row.stiffness * (-row.gap - depth_before);
    } else {
        row.stiffness = 2.0 * row.hardness * depth;
        row.normal_force = row.pressed;
    }
    row.friction_before - n * n.dot(row.friction_before) - slip(state, motion, row) * row.stiffness
}

/// What friction does at the iterate, going by what it did before. One that slid and would be pushed the other way has
/// stopped.
fn update_mode(row: &mut ShapeRow, trial: DVec3) {
    let (size, limit) = (trial.length(), row.mu() * row.pressed);
    let before = row.mode;
    row.mode = match row.mode {
        Mode::Sticks if size > limit => Mode::Slides(trial / size),
        Mode::Slides(d) if size > limit && trial.dot(d) > 0.0 => Mode::Slides(trial / size),
        _ => Mode::Sticks,
    };
    row.stops += u32::from(row.mode == Mode::Sticks && before != Mode::Sticks);
}

/// Friction force of a firm row at the iterate, and stiffness of all its forces against moves of the surface point.
fn forces(row: &mut ShapeRow, trial: DVec3) -> DMat3 {
    let (n, k) = (row.normal, row.stiffness);
    match row.mode {
        Mode::Sticks => {
            row.friction = trial;
            row.rim = DVec3::ZERO;
            DMat3::from_diagonal(DVec3::splat(k))
        }
        Mode::Slides(before) => {
            let limit = row.mu() * row.pressed;
            let size = trial.length();
            let forward = size > limit && trial.dot(before) > 0.0;
            let direction = if forward { trial / size } else { (before - n * n.dot(before)).normalize_or_zero() };
            row.friction = direction * limit;
            row.rim = direction;
            let aside = if forward { k * limit / size } else { k };
            outer(n, n) * k + (DMat3::IDENTITY - outer(n, n) - outer(direction, direction)) * aside
        }
    }
}

/// Decides which firm rows slide, and takes those whose law is far from their linearization out of the rods' matrix.
pub(crate) fn update_active_set(model: &Model, state: &State, motion: &Motion, rows: &mut Rows, first: bool) {
    for row in rows.shapes.iter_mut().filter(|r| r.firm) {
        let before = *row;
        let trial = evaluate_penalty(model, state, motion, row, first);
        // Much deeper than its force says, its law is far from the parabola's tangent. One that slides and stops by
        // turns may do so with another one for ever: the small problem decides all of them at once.
        if row.gap < -3.0 * (row.force_before / row.hardness).sqrt()
            || row.normal_force <= 0.0 && !first
            || row.stops > RESTLESS
        {
            *row = ShapeRow { firm: false, ..before };
        } else {
            update_mode(row, trial);
        }
    }
}

/// Adds forces and stiffness of the firm rows at the iterate, and looks where the others are.
pub(crate) fn assemble(
    model: &Model,
    state: &State,
    motion: &Motion,
    rods: &mut RodScratch,
    rows: &mut Rows,
    first: bool,
) {
    let RodScratch { system, rhs, .. } = rods;
    let moving = rows.movers.count() + rows.welds.count();
    rows.border.clear(moving, rows.joints.count());
    rows.movers.assemble(model, state, motion, &mut rows.border);
    rows.joints.assemble(model, state, motion, moving, &mut rows.border);
    for row in &mut rows.shapes {
        if !row.firm {
            evaluate(model, state, motion, row);
            continue;
        }
        let trial = evaluate_penalty(model, state, motion, row, first);
        let stiffness = forces(row, trial);
        let e = row.element as usize;
        let (a, b) = (1.0 - row.s, row.s);
        let force = row.normal * row.normal_force + row.friction;
        rhs[2 * e] += force * a;
        rhs[2 * e + 2] += force * b;
        system.diagonal[2 * e] += stiffness * (a * a);
        system.diagonal[2 * e + 2] += stiffness * (b * b);
        system.after[2 * e] += stiffness * (a * b);
        rows.movers.add((row.shape, row.surface), e, &stiffness, force, [a, b], &mut rows.border);
        row.tangent = stiffness;
        row.followed = 0.0;
    }
}

/// Move of a row's place against its shape along the last step.
fn moved(row: &ShapeRow, step: &[DVec3], movers: &Movers, border: &Border) -> DVec3 {
    let e = row.element as usize;
    step[2 * e] * (1.0 - row.s) + step[2 * e + 2] * row.s - movers.moved(row.shape, row.surface, border)
}

/// Notes the forces that a step of this length predicts for the firm rows.
pub(crate) fn predict(rows: &mut Rows, step: &[DVec3], scale: f64) {
    let (movers, border) = (&rows.movers, &rows.border);
    for row in rows.shapes.iter_mut().filter(|r| r.firm) {
        row.predicted_force = row.normal * row.normal_force + row.friction + row.rim * (row.followed * scale)
            - row.tangent * moved(row, step, movers, border) * scale;
    }
}

/// Work along the last step of what the firm rows' forces now are beyond those that it predicted.
pub(crate) fn work_unforeseen(rows: &Rows, step: &[DVec3]) -> f64 {
    let on = |row: &ShapeRow| {
        (row.normal * row.normal_force + row.friction - row.predicted_force).dot(moved(
            row,
            step,
            &rows.movers,
            &rows.border,
        ))
    };
    rows.shapes.iter().filter(|r| r.firm).map(on).sum()
}

/// Adds the rows that may act to the small problem.
pub(crate) fn add_entries(
    state: &State,
    motion: &Motion,
    step: &[DVec3],
    rows: &mut [ShapeRow],
    shared: (&Movers, &Border),
    entries: &mut Vec<Entry>,
) {
    let (movers, border) = shared;
    for (k, row) in rows.iter_mut().enumerate().filter(|(_, r)| !r.firm) {
        let e = row.element as usize;
        let moved =
            step[2 * e] * (1.0 - row.s) + step[2 * e + 2] * row.s - movers.moved(row.shape, row.surface, border);
        let gap = row.gap + row.normal.dot(moved);
        if row.normal_force <= 0.0 && !row.activate && gap > params::PRUNE * row.radius {
            (row.normal_force, row.friction) = (0.0, DVec3::ZERO);
            continue;
        }
        row.effective_compliance = row.compliance();
        let axes = row.axes();
        let [_, t1, t2] = axes;
        let slip = slip(state, motion, row) + moved - row.friction_before * row.effective_compliance;
        let (allowed, normal) =
            regain(row.start_gap, (row.force_before / row.hardness).sqrt(), row.effective_compliance);
        let shape = movers.moves(row.shape, row.surface).map_or(Side::Still, |moves| Side::Shared(moves.against(axes)));
        entries.push(Entry {
            source: Source::Shape(k as u32),
            island: 0,
            sides: [Side::Chain(Endpoint::new(e, row.s, axes)), shape],
            free: DVec3::new(gap - allowed, slip.dot(t1), slip.dot(t2)),
            mu: row.mu(),
            compliance: DVec3::new(normal, row.effective_compliance, row.effective_compliance),
            radius: row.radius,
            force: DVec3::new(row.normal_force, row.friction.dot(t1), row.friction.dot(t2)),
        });
    }
}

/// How far a shape's material point now at `point` has come since the start of the substep.
fn surface_motion(from: &Pose, to: &Pose, point: DVec3) -> DVec3 {
    if from == to { DVec3::ZERO } else { point - from.transform_point(to.inverse_transform_point(point)) }
}

/// Whether the iterate agrees with the forces that it was computed with: what the law says now against its
/// linearization.
pub(crate) fn converged(
    model: &Model,
    state: &State,
    motion: &Motion,
    rows: &mut Rows,
    step: &[DVec3],
    iterations: u32,
) -> bool {
    let (movers, border) = (&rows.movers, &rows.border);
    let mut settled = true;
    // Rod by rod: what a taut one bears says nothing about a light one.
    for rows in rows.shapes.chunk_by_mut(|a, b| model.rod_of[a.element as usize] == model.rod_of[b.element as usize]) {
        let largest = rows.iter().map(|r| r.normal_force).fold(0.0, f64::max);
        for row in rows {
            let mut now = *row;
            if row.firm {
                let trial = evaluate_penalty(model, state, motion, &mut now, false);
                update_mode(&mut now, trial);
                forces(&mut now, trial);
                // The step counted on the spring of a row that sticks, also a little beyond its limit: it slides in the
                // next substep.
                let friction = if row.mode == Mode::Sticks { trial } else { row.friction + row.rim * row.followed };
                let normal_force = (row.normal_force - row.stiffness * (now.gap - row.gap)).max(0.0);
                let off = (now.normal_force - normal_force).abs().max((now.friction - friction).length());
                // Where one after another goes over its limit the last digit would take an iteration each.
                let front =
                    iterations > params::FRONT && moved(row, step, movers, border).length() < params::SLIP * row.radius;
                settled &= off <= params::OFF_BALANCE * largest || front;
            } else if row.normal_force <= 0.0 {
                evaluate(model, state, motion, &mut now);
                if now.gap < row.start_gap.min(0.0) - params::SLACK * row.radius {
                    (row.activate, settled) = (true, false);
                }
            }
        }
    }
    settled
}

/// Adds rows where the iterate comes nearer to a shape than the forces there press it, although all rows are satisfied:
/// a row keeps its place on the thread, and the edge or wall that it was set up against may have come to another. True
/// when any was added.
pub(crate) fn extend(model: &Model, state: &State, motion: &Motion, candidates: &Candidates, all: &mut Rows) -> bool {
    let mut fresh = core::mem::take(&mut all.fresh_shapes);
    fresh.clear();
    let x = &state.position;
    for (slot, e) in &candidates.shapes {
        let (k, e) = (*slot as usize, *e as usize);
        let collider = &model.shapes.at(*slot).expect("candidate shapes live").collider;
        let r = candidates.radius[e];
        let length = (x[e + 1] - x[e]).length();
        let (start_pose, pose) = (&motion.start_shape_pose[k], &state.shape_pose[k]);
        let pair = Pair {
            model,
            slot: *slot,
            element: e,
            pushed: DVec3::ZERO,
            start: &motion.start,
            start_pose,
            now: x,
            pose,
        };
        let local = [x[e], x[e + 1]].map(|p| pose.inverse_transform_point(p));
        let ends = local.map(|p| collider.distance_local(p));
        let least = r * (1.0 + 2.0 * (params::KEEP - params::SLACK));
        if ends[0].value.min(ends[1].value) - 0.5 * length >= least {
            continue;
        }
        let rows = &all.shapes;
        // Of a mesh facets are told apart; other surfaces turn in one piece.
        let apart = if matches!(collider, Collider::Surface(_)) { APART } else { 0.7 };
        let mut pressed = None;
        let mut look = |s: f64, d: Distance| {
            if d.value >= least || d.value >= least - *pressed.get_or_insert_with(|| all.shape(*slot, e)) {
                return;
            }
            let at = |x: &[DVec3]| x[e].lerp(x[e + 1], s);
            let mut before = collider.distance(start_pose, at(pair.start));
            let normal = pose.orientation * d.normal;
            let facing = (start_pose.orientation.conjugate() * before.normal).dot(d.normal);
            if facing < apart {
                // It came from elsewhere to this wall, if it was before it.
                let way = pose.inverse_transform_point(at(x)) - start_pose.inverse_transform_point(at(pair.start));
                before = Distance { value: d.value - d.normal.dot(way), normal: start_pose.orientation * d.normal };
                if before.value <= 0.0 {
                    return;
                }
            }
            // What was as deep and only stays there is left to the rows that are.
            if d.value >= before.value && before.value < r {
                return;
            }
            let place = e as f64 + s;
            let known = |row: &ShapeRow| {
                row.shape == *slot
                    && (row.place() - place).abs() * length < params::SAME_ROW * r
                    && row.normal.dot(normal) > apart
            };
            if !rows.iter().chain(&fresh).any(known) {
                let mut row = pair.row(s, before, Distance { value: d.value, normal });
                (row.normal, row.gap, row.activate) =
                    (across(normal, row.smooth), d.value - r * (1.0 + 2.0 * params::KEEP), true);
                fresh.push(row);
            }
        };
        look(0.0, ends[0]);
        if !model.is_element(e + 1) {
            look(1.0, ends[1]);
        }
        collider.least_between(local, ends, least.min(ends[0].value.min(ends[1].value) - SHARP_BULGE * r), |s, d| {
            if bulges(ends.map(|d| d.value), s, d.value, length, r) {
                look(s, d);
            }
        });
    }
    let any = !fresh.is_empty();
    all.shapes.extend_from_slice(&fresh);
    // Rod by rod, as they are looked at.
    all.shapes.sort_unstable_by(|a, b| a.place().total_cmp(&b.place()).then(a.shape.cmp(&b.shape)));
    all.fresh_shapes = fresh;
    any
}

/// What the next substep starts from: the forces at the accepted state, not those that its last iteration was computed
/// with.
pub(crate) fn contacts<'a>(
    model: &'a Model,
    state: &'a State,
    motion: &'a Motion,
    rows: &'a mut [ShapeRow],
) -> impl Iterator<Item = Contact> + use<'a> {
    rows.iter_mut().filter_map(|row| {
        // How far it slid, and slip that is still to be undone.
        let (slid, residual_slip) = if row.firm {
            let trial = evaluate_penalty(model, state, motion, row, false);
            if row.mode != Mode::Sticks {
                update_mode(row, trial);
            }
            forces(row, trial);
            let beyond = trial.length() - row.friction.length();
            (if beyond > 0.0 { beyond / row.stiffness } else { 0.0 }, DVec3::ZERO)
        } else {
            evaluate(model, state, motion, row);
            let left = slip(state, motion, row) + (row.friction - row.friction_before) * row.effective_compliance;
            let at_limit = row.friction.length() >= params::AT_LIMIT * row.mu() * row.normal_force;
            if at_limit {
                (left.length(), DVec3::ZERO)
            } else {
                (0.0, left.clamp_length_max(params::RESIDUAL_SLIP_MOST * row.radius))
            }
        };
        (row.normal_force > 0.0).then_some(Contact {
            a: Site::Thread { element: row.element, s: row.s },
            b: Site::Shape { shape: row.shape },
            normal: row.normal,
            normal_force: row.normal_force,
            friction: row.friction,
            residual_slip,
            sliding: slid > params::SLIP * row.radius,
        })
    })
}
