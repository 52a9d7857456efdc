//! Joints of free bodies. Each direction in which a joint holds is an unknown of the border, a Lagrange multiplier:
//!
//! ```text
//! [ H    -s J^T ] [dx]   [ r + J^T l   ]
//! [ -s J  -s^2 c] [dy] = [ s (g + c l) ],     l <- l + s dy
//! ```
//!
//! g is how far the two sides are apart, J its derivative, c the compliance and l the force. The scale s, the lighter
//! side's mass or moment of inertia over h^2, makes an unknown a length or an angle. The matrix is quasi-definite: any
//! order of elimination is stable (Vanderbei 1995), and the pivots of multipliers are negative. What is redundant is
//! held by all that hold it.
//!
//! A force that stays as it is while its arm turns is a stiffness (Tournier et al. 2015). Where it is positive it is in
//! the matrix, where it is negative as far as that stays positive.
//!
//! Motor and friction are multipliers too, of the rate along the axis, with a bound. A multiplier beyond its bound is
//! put there and leaves the system until its rate says that it is too much. Limits open and close, so they are rows of
//! the small contact problem.

use crate::handle::Slots;
use crate::math::max_or_nan;
use crate::model::Model;
use crate::model::body::BodyModel;
use crate::model::joint::{Along, JointModel, Meeting, Motor};
use crate::motion::Motion;
use crate::params;
use crate::row::border::Border;
use crate::row::movers::{Movers, momentum, turning_stiffness};
use crate::row::side::{Moves, Side};
use crate::row::system::{Entry, Source};
use crate::state::{BodyState, State, places_of, root_of};
use core::ops::Range;
use glam::DVec3;

/// Diagonal of a multiplier in its own scale: tells redundant multipliers apart. The residual does not have it, so what
/// is held is held exactly.
const REDUNDANT: f64 = 1e-10;

/// How far the sides may be apart at the end of a solve, over the size of the smaller body, and in radians; and over
/// their distance from the origin, whose digits they are made of.
const EXACT: f64 = 1e-9;
const ROUNDING: f64 = 1e-14;

/// Part of its inertia over h^2 that a force which pushes toward a body may take off its stiffness about an axis.
const WEAKENED: f64 = 0.25;

/// Turn of a joined body that the next iteration may be expected to make \[rad\], and its move over its size.
const STILL: f64 = 1e-8;

/// Compliance of a limit over that of the bodies in a substep.
const GIVE: f64 = 1e-6;

/// How far a limit may be passed, over the size of the smaller body.
const PASSED: f64 = 1e-6;

/// What the contact solve may leave of a limit, in thread radii, is so much of the size of a body.
const PRECISE: f64 = 1e-3;

/// Iterations after which a force that was put at its bound stays there.
const RESTLESS: u32 = 8;

/// The joints of the substep in slot order.
#[derive(Default)]
pub(crate) struct Joints {
    active: Vec<Active>,
    rows: Vec<Row>,
    pub stops: Vec<Stop>,
    /// Whether a force has come to its bound or left it in this iteration, and how many iterations there were.
    changed: bool,
    iterations: u32,
}

struct Active {
    slot: u32,
    /// First unknowns of the bodies.
    first: [Option<usize>; 2],
    rows: Range<usize>,
    /// Size of the smaller body.
    size: f64,
    /// Scales of ways and of turns.
    scale: [f64; 2],
}

/// A multiplier.
struct Row {
    along: Along,
    /// Which of the joint's drives it is, and what that keeps to; none of what is held.
    drive: Option<(usize, Motor)>,
    force: f64,
    /// Whether it is at its bound.
    yields: bool,
}

/// A limit.
pub(crate) struct Stop {
    joint: usize,
    /// 1 at the lower limit, -1 at the upper one.
    sign: f64,
    limit: f64,
    /// Meters by a unit of the coordinate.
    unit: f64,
    /// Part of an overlap at the start that may remain, in units of the coordinate.
    allowed: f64,
    /// Along the axis away from the limit \[N\], in the units of the contact problem.
    pub force: f64,
}

impl Active {
    fn scale_of(&self, along: Along) -> f64 {
        match along {
            Along::Way(_) => self.scale[0],
            Along::Turn(_) => self.scale[1],
        }
    }

    /// Adds what a unit force along a direction does to each unknown, to `each`.
    fn columns(&self, meeting: &Meeting, along: Along, mut each: impl FnMut(usize, f64)) {
        for (first, parts) in self.first.iter().zip(meeting.columns(along)) {
            if let Some(first) = first {
                (0..6).for_each(|k| each(first + k, parts[k / 3][k % 3]));
            }
        }
    }
}

impl Joints {
    /// Lists the joints at the start of a solve, with the forces of the last one.
    pub fn begin(&mut self, model: &Model, state: &State, motion: &Motion, movers: &Movers) {
        let Joints { active, rows, stops, changed, iterations } = self;
        active.clear();
        rows.clear();
        stops.clear();
        (*changed, *iterations) = (false, 0);
        for (slot, joint) in model.joints.iter() {
            let Some(last) = state.joints.at(slot) else { continue };
            let first = joint.bodies.map(|b| Some(movers.unknowns_of(b?)?.0));
            // What nothing moves is where it is led.
            if first == [None; 2] {
                continue;
            }
            let masses = || joint.bodies.iter().flatten().filter_map(|b| model.bodies.at(*b));
            let size = masses().map(BodyModel::size).fold(f64::INFINITY, f64::min);
            let over = |sum: f64, heavier: f64| heavier / (sum * motion.span * motion.span);
            let scale = [
                over(masses().map(|b| 1.0 / b.mass.mass).sum(), motion.heavier[0]),
                over(masses().map(|b| 1.0 / b.mass.moments.max_element()).sum(), motion.heavier[1]),
            ];
            let from = rows.len();
            for along in joint.kind.held() {
                let force = match *along {
                    Along::Way(k) => last.force[k],
                    Along::Turn(k) => last.torque[k],
                };
                rows.push(Row { along: *along, drive: None, force, yields: false });
            }
            if let Some(along) = joint.kind.axis() {
                let drives = last.drives(joint).into_iter().enumerate();
                for (k, motor) in drives.filter_map(|(k, motor)| Some((k, motor?))) {
                    let force = last.drive[k].clamp(-motor.most, motor.most);
                    rows.push(Row { along, drive: Some((k, motor)), force, yields: last.yields[k] });
                }
                let unit = if matches!(along, Along::Turn(_)) { size } else { 1.0 };
                let part = (motion.span / model.settings.substep).min(1.0);
                for (k, limit) in joint.limits.into_iter().flatten().enumerate() {
                    let sign = if k == 0 { 1.0 } else { -1.0 };
                    let overlap = (sign * (last.coordinate - limit)).min(0.0);
                    let force = (sign * last.stop / unit).max(0.0);
                    let allowed = (1.0 - (1.0 - params::RECOVER) * part) * overlap;
                    stops.push(Stop { joint: active.len(), sign, limit, unit, allowed, force });
                }
            }
            active.push(Active { slot, first, rows: from..rows.len(), size, scale });
        }
    }

    /// Number of unknowns.
    pub fn count(&self) -> usize {
        self.rows.len()
    }

    /// Whether a force that is at its bound is too much.
    pub fn review(&mut self, model: &Model, state: &State, motion: &Motion) {
        self.changed = false;
        self.iterations += 1;
        for a in &self.active {
            let joint = model.joints.at(a.slot).expect("listed");
            let meeting = joint.meeting(places_of(&state.bodies));
            for row in self.rows[a.rows.clone()].iter_mut().filter(|r| r.yields) {
                let excess = residual(model, state, motion, joint, &meeting, row) * row.force;
                if excess > 0.0 && self.iterations < RESTLESS {
                    row.yields = false;
                    self.changed = true;
                }
            }
        }
    }

    /// Puts the multipliers, which follow the other unknowns from `base` on, into the border.
    pub fn assemble(&self, model: &Model, state: &State, motion: &Motion, base: usize, border: &mut Border) {
        for a in &self.active {
            let joint = model.joints.at(a.slot).expect("listed");
            let meeting = joint.meeting(places_of(&state.bodies));
            let mut force = DVec3::ZERO;
            for k in a.rows.clone() {
                let (row, m) = (&self.rows[k], base + k);
                let scale = a.scale_of(row.along);
                a.columns(&meeting, row.along, |unknown, v| border.push(unknown, v * row.force));
                if let Along::Way(axis) = row.along {
                    force += meeting.axis(axis) * row.force;
                }
                if row.yields {
                    border.add_own(m, m, -scale);
                    continue;
                }
                a.columns(&meeting, row.along, |unknown, v| {
                    border.add_own(m, unknown, -scale * v);
                    border.add_own(unknown, m, -scale * v);
                });
                border.add_own(m, m, -scale * (scale * compliance(joint, row) + REDUNDANT));
                border.push(m, scale * residual(model, state, motion, joint, &meeting, row));
            }
            for (side, sign) in [(0, -1.0), (1, 1.0)] {
                let Some(first) = a.first[side] else { continue };
                let arm = meeting.frames[1].position - meeting.centers[side];
                let firm = |axis: DVec3| inertia_about(model, state, motion, joint.bodies[side], axis);
                let stiffness = turning_stiffness(force * sign, arm, |axis| WEAKENED * firm(axis));
                for i in 0..3 {
                    (0..3).for_each(|j| border.add_own(first + 3 + i, first + 3 + j, stiffness.col(j)[i]));
                }
            }
        }
    }

    /// Takes their part of the step.
    pub fn apply(&mut self, base: usize, border: &Border, scale: f64) {
        for a in &self.active {
            for k in a.rows.clone() {
                let row = &mut self.rows[k];
                if row.yields {
                    continue;
                }
                row.force += a.scale_of(row.along) * border.step(base + k) * scale;
                if let Some((_, Motor { most, .. })) = row.drive
                    && row.force.abs() > most
                {
                    row.force = row.force.clamp(-most, most);
                    (row.yields, self.changed) = (true, true);
                }
            }
        }
    }

    /// Work of the change of their forces along the last step.
    pub fn work(&self, base: usize, border: &Border) -> f64 {
        (base..base + self.rows.len()).map(|k| -border.work_of_constraint(k)).sum()
    }

    /// Adds the limits to the contact system.
    pub fn add_entries(&self, model: &Model, state: &State, border: &Border, entries: &mut Vec<Entry>) {
        for (k, stop) in self.stops.iter().enumerate() {
            let a = &self.active[stop.joint];
            let joint = model.joints.at(a.slot).expect("listed");
            let (Some(along), Some(last)) = (joint.kind.axis(), state.joints.at(a.slot)) else { continue };
            let meeting = joint.meeting(places_of(&state.bodies));
            let columns = meeting.columns(along);
            let sides = [0, 1].map(|side| {
                a.first[side].map_or(Side::Still, |first| {
                    let column = |k: usize| DVec3::X * (columns[side][k / 3][k % 3] * stop.sign * stop.unit);
                    Side::Shared(Moves::new(first, &[0, 1, 2, 3, 4, 5].map(column)))
                })
            });
            let moved: f64 = sides.iter().map(|side| side.moved(0, &[], border)).sum();
            let gap = stop.gap(joint, &meeting, last.coordinate) - stop.allowed;
            // However firmly it is pressed it is passed by less than what counts.
            let loose = GIVE * stop.unit * stop.unit / a.scale_of(along);
            let firm = 0.5 * PASSED * a.size / stop.force.max(f64::MIN_POSITIVE);
            entries.push(Entry {
                source: Source::Limit(k as u32),
                island: 0,
                sides,
                free: DVec3::X * (gap * stop.unit + moved),
                mu: 0.0,
                compliance: DVec3::splat(loose.min(firm)),
                radius: PRECISE * a.size,
                force: DVec3::X * stop.force,
            });
        }
    }

    /// Whether the iterate keeps to the joints, and an iteration that does `rate` times as much as the last one would
    /// change little.
    pub fn converged(&self, model: &Model, state: &State, motion: &Motion, border: &Border, rate: f64) -> bool {
        let holds = |a: &Active| {
            let joint = model.joints.at(a.slot).expect("listed");
            let meeting = joint.meeting(places_of(&state.bodies));
            let far = ROUNDING * meeting.frames[1].position.length();
            let left = |row: &Row| {
                let off = residual(model, state, motion, joint, &meeting, row);
                let off = if row.yields { (off * row.force.signum()).max(0.0) } else { off.abs() };
                match row.along {
                    Along::Way(_) => off <= (EXACT * a.size).max(far),
                    Along::Turn(_) => off <= EXACT.max(far / a.size),
                }
            };
            let step = |first: usize| DVec3::new(border.step(first), border.step(first + 1), border.step(first + 2));
            let moved = |first: &usize| max_or_nan(step(*first).length() / a.size, step(first + 3).length());
            let still = a.first.iter().flatten().all(|first| moved(first) * rate <= STILL);
            still && self.rows[a.rows.clone()].iter().all(left)
        };
        let keeps = |stop: &Stop| {
            let a = &self.active[stop.joint];
            let joint = model.joints.at(a.slot).expect("listed");
            let before = state.joints.at(a.slot).map_or(0.0, |j| j.coordinate);
            let gap = stop.gap(joint, &joint.meeting(places_of(&state.bodies)), before);
            (gap - stop.allowed) * stop.unit >= -PASSED * a.size
        };
        !self.changed && self.active.iter().all(holds) && self.stops.iter().all(keeps)
    }

    /// Leaves coordinates and forces in the state.
    pub fn store(&self, model: &Model, state: &mut State) {
        let State { joints, bodies, .. } = state;
        // Those of bodies that are led as well.
        for (slot, joint) in model.joints.iter() {
            let Some(now) = joints.at_mut(slot) else { continue };
            now.coordinate = joint.meeting(places_of(bodies)).coordinate(joint.kind, now.coordinate);
        }
        for (k, a) in self.active.iter().enumerate() {
            let Some(now) = joints.at_mut(a.slot) else { continue };
            (now.force, now.torque) = (DVec3::ZERO, DVec3::ZERO);
            for row in &self.rows[a.rows.clone()] {
                match (row.drive, row.along) {
                    (Some((d, _)), _) => (now.drive[d], now.yields[d]) = (row.force, row.yields),
                    (None, Along::Way(k)) => now.force[k] = row.force,
                    (None, Along::Turn(k)) => now.torque[k] = row.force,
                }
            }
            now.stop = self.stops.iter().filter(|s| s.joint == k).map(|s| s.sign * s.unit * s.force).sum();
        }
    }
}

impl Stop {
    /// Of the coordinate to the limit.
    fn gap(&self, joint: &JointModel, meeting: &Meeting, before: f64) -> f64 {
        self.sign * (meeting.coordinate(joint.kind, before) - self.limit)
    }
}

/// Largest c for which the inertia of a body over h^2 less c about an axis is positive.
fn inertia_about(model: &Model, state: &State, motion: &Motion, body: Option<u32>, axis: DVec3) -> f64 {
    let of = |slot: u32| Some((model.bodies.at(slot)?.mass.moments, state.bodies.at(slot)?.orientation));
    let Some((moments, orientation)) = body.and_then(of) else { return 0.0 };
    let own = orientation.conjugate() * axis;
    motion.heavier[1] / (motion.span * motion.span * own.dot(own / moments))
}

/// Of what a row holds.
fn compliance(joint: &JointModel, row: &Row) -> f64 {
    match (row.drive, row.along) {
        (Some(_), _) => 0.0,
        (None, Along::Way(_)) => joint.compliance[0],
        (None, Along::Turn(_)) => joint.compliance[1],
    }
}

/// How far a row is from what it wants \[m\], \[rad\].
fn residual(model: &Model, state: &State, motion: &Motion, joint: &JointModel, meeting: &Meeting, row: &Row) -> f64 {
    let Some((_, motor)) = row.drive else {
        return meeting.off(joint.kind, row.along) + compliance(joint, row) * row.force;
    };
    let rates_of = |slot: u32| rates(model, &state.bodies, motion, root_of(&state.bodies, slot));
    let rates = joint.bodies.map(|b| b.map_or([DVec3::ZERO; 2], rates_of));
    (meeting.rate(row.along, rates) - motor.speed) * motion.span
}

/// Velocity of the center and angular velocity of a body that the iterate would leave.
fn rates(model: &Model, bodies: &Slots<BodyState>, motion: &Motion, slot: u32) -> [DVec3; 2] {
    let (Some(body), Some(now), Some(start)) =
        (model.bodies.at(slot), bodies.at(slot), motion.bodies.get(slot as usize).and_then(Option::as_ref))
    else {
        return [DVec3::ZERO; 2];
    };
    let q = now.orientation;
    let momentum = momentum(body.mass.moments, start, now, motion.span);
    let velocity = start.kept + (now.position - start.target) / motion.span;
    [velocity, q * ((q.conjugate() * momentum) / body.mass.moments)]
}
