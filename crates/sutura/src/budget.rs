//! What a substep may not make: angular momentum of threads that nothing holds, and energy of threads that nothing
//! drives. Theory 3.2.
//!
//! Both are kept by correcting velocities at the end of the substep, positions stay. Threads in contact or welded are
//! one group, since they exchange both. For a group of particles m, x, v and frames I, w (world axes), about its center
//! of mass c with velocity u,
//!
//! ```text
//! L = sum m (x - c) x (v - u) + sum I w \[kg m^2/s\],     J = sum m (r^2 - r r^T) + sum I \[kg m^2\],     r = x - c
//! ```
//!
//! a turning by J^-1 dL gives it the angular momentum that it had, with what loads add. What its energy (kinetic,
//! elastic, of gravity and dead loads) has grown by is taken from the motion of its parts against each other: k of it
//! is left, where the energy is that at the start. Both corrections are of the order of the error of the method in a
//! substep, so they leave its order. Contact forces have no energy here: what overlap gives back is taken off too.

use crate::integrator::Method;
use crate::math::Pose;
use crate::model::Model;
use crate::model::grip::{Drive, LoadKind};
use crate::model::rod::{RodModel, Stretch};
use crate::model::shape::ShapeMotion;
use crate::motion::Motion;
use crate::params::{Integrator, OVERLAP};
use crate::rod::length::LENGTH_TOLERANCE;
use crate::state::{BodyState, Contact, Site, State};
use glam::{DMat3, DVec3};

/// Rounding of an energy, over the energies that it is summed of: some hundred terms of some rounded numbers each.
const ROUNDING: f64 = 1e-13;

/// Part of the trace of J added to it where it is inverted: a straight thread has next to no inertia about its own
/// axis, and what is off there by the bending of its parts is not to become spin.
const STIFFENED: f64 = 1e-2;

/// Passes that such an inverse is applied in: what is left is some 1e-5 of the error of a substep.
const PASSES: u32 = 3;

/// Gain of a substep of second order over the energy of the group beyond which it is not resolved in time, and implicit
/// Euler takes it.
const UNRESOLVED: f64 = 1e-3;

/// The same of joined bodies, over their kinetic energy and what gravity does.
const UNRESOLVED_JOINTS: f64 = 1e-4;

/// Part of its energy that a group may be left with too much: Newton's iteration leaves some of that in what comes to
/// rest.
const LEFT: f64 = 1e-9;

/// Elongation of an inextensible thread that no substep leaves: an edit has put work in.
const EDITED: f64 = 200.0 * LENGTH_TOLERANCE;

/// Energy of a thread that is bent by next to nothing, over that at an angle of one from end to end: rounding of angles
/// and lengths.
const NOTHING: f64 = 1e-9;

/// Way of a grip in a step, in radii, up to which it stands still.
const STANDS: f64 = 1e-9;

/// Threads that act on each other.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Group {
    /// Something that does not move holds it, or it touches that.
    held: bool,
    /// A grip does; something touches it.
    gripped: bool,
    touched: bool,
    /// Something else does work on it.
    driven: bool,
    /// A torque does: it has no potential.
    twisted: bool,
}

/// Working memory.
#[derive(Default)]
pub(crate) struct Budget {
    /// Per slot of a rod the least slot of its group, and the group there.
    of: Vec<u32>,
    groups: Vec<Group>,
}

/// Velocities of a rigid body.
#[derive(Debug, Clone, Copy, Default)]
struct Rigid {
    center: DVec3,
    velocity: DVec3,
    spin: DVec3,
}

impl Rigid {
    fn at(&self, x: DVec3) -> DVec3 {
        self.velocity + self.spin.cross(x - self.center)
    }
}

/// Mass, center and its velocity, angular momentum of particles and of frames, inertia.
struct Moments {
    rigid: Rigid,
    orbital: DVec3,
    spin: DVec3,
    inertia: DMat3,
}

/// What became of what a substep has made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Settled {
    /// Taken off, or no more than lengths and contacts may be off by.
    Well,
    /// It was of second order and made so much that it should not count.
    Coarse,
    /// It moved to where energy is more than it had, even without any motion.
    Gained,
}

/// Whether joined bodies, which no motor drives and nothing touches, have gained more energy in a substep of second
/// order than its error explains: they whip, and the substep does not resolve it.
pub(crate) fn joints_gain(model: &Model, before: &State, after: &State) -> bool {
    if before.joints.iter().any(|(_, j)| j.motor.is_some()) {
        return false;
    }
    let (mut gained, mut scale) = (0.0, 0.0);
    for (slot, body) in model.bodies.iter() {
        let joined = model.joints.iter().any(|(_, j)| j.bodies.contains(&Some(slot)));
        let (Some(was), Some(now), true) = (before.bodies.at(slot), after.bodies.at(slot), joined) else { continue };
        let mass = &body.mass;
        let kinetic = |b: &BodyState| {
            let along = b.orientation.conjugate() * b.angular_momentum;
            0.5 * (mass.mass * b.velocity.length_squared() + along.dot(along / mass.moments))
        };
        let fallen = mass.mass * model.settings.gravity.dot(now.position - was.position);
        let [first, last] = [was, now].map(kinetic);
        gained += last - first - fallen;
        scale += last + first + fallen.abs();
    }
    let of_joined =
        |c: &Contact| [c.a, c.b].into_iter().filter_map(Site::any_shape).any(|shape| model.body_of(shape).is_some());
    gained > UNRESOLVED_JOINTS * scale && !after.contacts.iter().any(of_joined)
}

/// Takes off the state at the end of a substep what the substep has made, against that at its start, `before`. `last`
/// where no shorter one will be tried.
pub(crate) fn settle(
    model: &Model,
    state: &mut State,
    motion: &Motion,
    budget: &mut Budget,
    before: &State,
    (h, method, last): (f64, Method, bool),
) -> Settled {
    budget.group(model, state, before);
    let mut settled = Settled::Well;
    for root in 0..budget.of.len() as u32 {
        let group = budget.groups[root as usize];
        if budget.of[root as usize] != root || group.driven || model.rods.at(root).is_none() {
            continue;
        }
        let rods = || {
            budget
                .of
                .iter()
                .enumerate()
                .filter(move |(_, of)| **of == root)
                .filter_map(|(slot, _)| model.rods.at(slot as u32))
        };
        if !group.held {
            keep_momentum(model, state, motion, before, h, method, &rods);
        }
        // Implicit Euler is left alone where hands hold what touches something: contacts give back what they were
        // pressed with.
        let kept = !(group.gripped && model.settings.integrator == Integrator::ImplicitEuler);
        if !group.twisted && kept {
            match keep_energy(model, state, motion, before, group.held, last, &rods) {
                Settled::Well => {}
                _ if method != Method::Euler => settled = Settled::Coarse,
                // A length that was off at the start, by an edit, is work that was put in.
                Settled::Gained if most_elongated(model, before) < EDITED => settled = Settled::Gained,
                Settled::Gained | Settled::Coarse => {}
            }
        }
    }
    settled
}

impl Budget {
    /// Which threads act on each other, and what acts on them.
    fn group(&mut self, model: &Model, state: &State, before: &State) {
        let n = model.rods.len();
        self.of.clear();
        self.of.extend(0..n as u32);
        self.groups.clear();
        self.groups.resize(n, Group { held: false, gripped: false, touched: false, driven: false, twisted: false });
        let contacts = || before.contacts.iter().chain(state.contacts.iter());
        for (a, b) in contacts().filter_map(Contact::elements) {
            self.join(model.rod_of[a as usize], model.rod_of[b as usize]);
        }
        for (_, weld) in model.welds.iter() {
            for member in &weld.members[1..] {
                self.join(weld.members[0].rod, member.rod);
            }
        }
        for slot in 0..n {
            self.of[slot] = self.root(slot as u32);
        }
        for (_, grip) in state.grips.iter() {
            let group = &mut self.groups[self.of[grip.rod as usize] as usize];
            (group.held, group.gripped) = (true, true);
            let rod = model.rods.at(grip.rod).expect("grips go with their rod");
            group.driven |= match grip.drive {
                Drive::Pose => moves(&grip.pose, &grip.target, rod.radius) || before.time < grip.taken_at + grip.ramp,
                Drive::Force { force, .. } | Drive::Hand { force, .. } => force > 0.0,
            };
        }
        for rod in model.welds.iter().filter(|(_, w)| w.anchor.is_some()).flat_map(|(_, w)| &w.members).map(|m| m.rod) {
            self.groups[self.of[rod as usize] as usize].driven = true;
        }
        for (_, reel) in state.reels.iter() {
            self.groups[self.of[reel.rod as usize] as usize].driven = true;
        }
        for c in contacts() {
            let Some((element, _)) = c.a.thread() else { continue };
            let group = &mut self.groups[self.of[model.rod_of[element as usize] as usize] as usize];
            group.touched = true;
            let Some(shape) = c.b.shape() else { continue };
            let k = shape as usize;
            let pushed = model.shapes.at(shape).is_some_and(|s| matches!(s.motion, ShapeMotion::Pushed { .. }));
            group.held = true;
            group.driven |= pushed || state.shape_pose[k] != before.shape_pose[k];
        }
        for (_, load) in state.loads.iter() {
            if matches!(load.kind, LoadKind::Point { torque, .. } if torque != DVec3::ZERO) {
                self.groups[self.of[load.rod as usize] as usize].twisted = true;
            }
        }
    }

    fn root(&self, mut slot: u32) -> u32 {
        while self.of[slot as usize] != slot {
            slot = self.of[slot as usize];
        }
        slot
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.of[a.max(b) as usize] = a.min(b);
    }
}

/// Gives a group the angular momentum that it had, with what loads have added and damping has taken.
fn keep_momentum<'a, I: Iterator<Item = &'a RodModel> + Clone>(
    model: &Model,
    state: &mut State,
    motion: &Motion,
    before: &State,
    h: f64,
    method: Method,
    rods: &impl Fn() -> I,
) {
    let [first, last] = method.damping(model, h);
    let keeps = last.0 > 0.0 && last.1 > 0.0;
    let (was, is) = (moments(model, before, rods()), moments(model, state, rods()));
    let mut torque = DVec3::ZERO;
    for rod in rods() {
        for i in rod.particles() {
            let arms = before.position[i] - was.rigid.center + state.position[i] - is.rigid.center;
            torque += (arms * 0.5).cross(motion.force[i]);
        }
        torque += rod.elements().map(|e| motion.torque[e]).sum::<DVec3>();
    }
    // As the solves have it, which leave the gyroscopic moment out: inertia times the change of angular velocity.
    let mut spin = DVec3::ZERO;
    for e in rods().flat_map(RodModel::elements) {
        let change = before.angular_velocity[e] * first.1 - state.angular_velocity[e] / last.1;
        spin += (spun(model, before, e, change) + spun(model, state, e, change)) * 0.5;
    }
    let lacking = was.orbital * first.0 + torque * h - is.orbital / last.0 + spin;
    let turn = is.solve(lacking);
    if !keeps || !turn.is_finite() {
        return;
    }
    for rod in rods() {
        for i in rod.particles() {
            state.velocity[i] += turn.cross(state.position[i] - is.rigid.center) * last.0;
        }
        for e in rod.elements() {
            state.angular_velocity[e] += turn * last.1;
        }
    }
}

/// Takes off the motion what the energy has grown by.
fn keep_energy<'a, I: Iterator<Item = &'a RodModel> + Clone>(
    model: &Model,
    state: &mut State,
    motion: &Motion,
    before: &State,
    held: bool,
    last: bool,
    rods: &impl Fn() -> I,
) -> Settled {
    // Energies of which the gain is a difference.
    let (mut gain, mut scale) = (0.0, 0.0);
    for rod in rods() {
        let [was, is] = [before, &*state].map(|s| {
            let e = crate::rod::energy::energy(model, s, rod);
            e.kinetic + e.stretch + e.bend + e.twist
        });
        let give: f64 =
            rod.elements().filter(|e| model.is_joint(*e)).map(|e| 1.0 / model.bend_stiffness[e].min_element()).sum();
        scale += was.max(is) + if give > 0.0 { NOTHING / give } else { 0.0 };
        gain += is - was;
        for i in rod.particles() {
            // Not the difference of two potentials: the origin may be far.
            let work = motion.force[i].dot(state.position[i] - before.position[i]);
            scale += work.abs();
            gain -= work;
        }
    }
    let rounding = ROUNDING * scale;
    if gain.is_nan() || gain <= rounding {
        return Settled::Well;
    }
    let slack = slack(model, state, before, rods);
    let resolved = gain <= UNRESOLVED * scale + slack;
    let mut left = gain;
    if held {
        left = slow(model, state, rods, Rigid::default(), left);
    } else {
        let moments = moments(model, state, rods());
        let spin = moments.solve(moments.orbital + moments.spin);
        let rigid = Rigid { spin: if spin.is_finite() { spin } else { DVec3::ZERO }, ..moments.rigid };
        left = slow(model, state, rods, rigid, left);
        // What is spun keeps its spin while shorter substeps may yet find that energy.
        if left > rounding && (last || left <= LEFT * scale + slack) {
            left = slow(model, state, rods, Rigid { spin: DVec3::ZERO, ..rigid }, left);
        }
    }
    if left > LEFT * scale + slack {
        Settled::Gained
    } else if resolved {
        Settled::Well
    } else {
        Settled::Coarse
    }
}

/// Work of tensions over what lengths that are constraints may be off, and of contact forces over what they may overlap
/// \[J\]: it comes and goes.
fn slack<'a, I: Iterator<Item = &'a RodModel> + Clone>(
    model: &Model,
    state: &State,
    before: &State,
    rods: &impl Fn() -> I,
) -> f64 {
    let mut sum = 0.0;
    for rod in rods().filter(|rod| rod.stretch == Stretch::Inextensible) {
        for e in rod.elements() {
            sum += before.tension[e].abs().max(state.tension[e].abs()) * model.rest_length[e] * 2.0 * LENGTH_TOLERANCE;
        }
    }
    for rod in rods() {
        let own = |e: u32| rod.particles().contains(&(e as usize));
        let of = |s: &State| {
            let own = s.contacts.iter().filter(|c| c.a.thread().is_some_and(|(element, _)| own(element)));
            own.map(|c| if c.b.shape().is_some() { c.normal_force } else { 2.0 * c.normal_force }).sum::<f64>()
        };
        sum += of(before).max(of(state)) * rod.radius * 2.0 * OVERLAP;
    }
    sum
}

/// Slows the motion relative to that of a rigid body until kinetic energy is less by `excess`, or it is that of the
/// rigid body. What is left of the excess.
fn slow<'a, I: Iterator<Item = &'a RodModel> + Clone>(
    model: &Model,
    state: &mut State,
    rods: &impl Fn() -> I,
    rigid: Rigid,
    excess: f64,
) -> f64 {
    // Kinetic energy is a + b k + c k^2 where k of the relative motion is left.
    let (mut b, mut c) = (0.0, 0.0);
    for rod in rods() {
        for i in rod.particles() {
            let (mean, m) = (rigid.at(state.position[i]), model.mass[i]);
            let own = state.velocity[i] - mean;
            b += m * own.dot(mean);
            c += 0.5 * m * own.length_squared();
        }
        for e in rod.elements() {
            let q = state.orientation[e].conjugate();
            let (mean, own) = (q * rigid.spin, q * (state.angular_velocity[e] - rigid.spin));
            b += (model.inertia[e] * own).dot(mean);
            c += 0.5 * (model.inertia[e] * own).dot(own);
        }
    }
    // b + c - excess = b k + c k^2.
    let wanted = b + c - excess;
    let root = b * b + 4.0 * c * wanted;
    let k = if wanted > 0.0 && root >= 0.0 { (2.0 * wanted / (b + root.sqrt())).clamp(0.0, 1.0) } else { 0.0 };
    for rod in rods() {
        for i in rod.particles() {
            let mean = rigid.at(state.position[i]);
            state.velocity[i] = mean + (state.velocity[i] - mean) * k;
        }
        for e in rod.elements() {
            state.angular_velocity[e] = rigid.spin + (state.angular_velocity[e] - rigid.spin) * k;
        }
    }
    excess - (b * (1.0 - k) + c * (1.0 - k * k))
}

/// Angular momentum of a frame at an angular velocity.
fn spun(model: &Model, state: &State, e: usize, w: DVec3) -> DVec3 {
    let q = state.orientation[e];
    q * (model.inertia[e] * (q.conjugate() * w))
}

fn moments<'a>(model: &Model, state: &State, rods: impl Iterator<Item = &'a RodModel> + Clone) -> Moments {
    let (mut mass, mut center, mut velocity) = (0.0, DVec3::ZERO, DVec3::ZERO);
    for i in rods.clone().flat_map(RodModel::particles) {
        let m = model.mass[i];
        mass += m;
        center += state.position[i] * m;
        velocity += state.velocity[i] * m;
    }
    (center, velocity) = (center / mass, velocity / mass);
    let (mut orbital, mut spin) = (DVec3::ZERO, DVec3::ZERO);
    let (mut inertia, mut squares) = (DMat3::ZERO, 0.0);
    for rod in rods {
        for i in rod.particles() {
            let (m, r) = (model.mass[i], state.position[i] - center);
            orbital += r.cross(state.velocity[i] - velocity) * m;
            inertia -= crate::math::outer(r * m, r);
            squares += m * r.length_squared();
        }
        for e in rod.elements() {
            let r = DMat3::from_quat(state.orientation[e]);
            let own = r * DMat3::from_diagonal(model.inertia[e]) * r.transpose();
            inertia += own;
            spin += own * state.angular_velocity[e];
        }
    }
    inertia += DMat3::from_diagonal(DVec3::splat(squares));
    Moments { rigid: Rigid { center, velocity, spin: DVec3::ZERO }, orbital, spin, inertia }
}

impl Moments {
    /// Rate of turning that has this angular momentum.
    fn solve(&self, momentum: DVec3) -> DVec3 {
        let trace = self.inertia.x_axis.x + self.inertia.y_axis.y + self.inertia.z_axis.z;
        let inverse = (self.inertia + DMat3::from_diagonal(DVec3::splat(STIFFENED * trace))).inverse();
        let mut turn = DVec3::ZERO;
        for _ in 0..PASSES {
            turn += inverse * (momentum - self.inertia * turn);
        }
        turn
    }
}
/// Whether a grip is on its way from one pose to another, beyond rounding.
fn moves(pose: &Pose, target: &Pose, radius: f64) -> bool {
    let turned = pose.orientation.dot(target.orientation).abs();
    (target.position - pose.position).length() > STANDS * radius || 1.0 - turned > STANDS
}

/// Largest |elongation| of an element whose length is a constraint.
fn most_elongated(model: &Model, state: &State) -> f64 {
    let rods = model.rods.iter().filter(|(_, r)| r.stretch == Stretch::Inextensible);
    let elongation =
        |e: usize| ((state.position[e + 1] - state.position[e]).length() / model.rest_length[e] - 1.0).abs();
    rods.flat_map(|(_, rod)| rod.elements()).map(elongation).fold(0.0, f64::max)
}
