//! Contact of thread with shapes. A shape has no compliance of its own, so each contact touches one rod at one place and goes straight
//! into that rod's matrix: cost is linear in the number of contacts.
//!
//! Normal: force `k gap^2` for gap < 0, gap = signed distance of the centerline point less r (and less a
//! fiftieth of the diameter, kept in reserve for the chords between particles). It starts with zero slope, so that a thread that
//! lies lightly on a shape does not rattle between touching and not, and stiffens as Hertz contact does; k is such that a force of
//! `E r^2 / 1000` leaves a gap of -r / 100.
//! Friction: Coulomb with a tangential spring from the anchor of the last substep (Cundall and Strack 1979), as stiff as the normal one
//! is at its load: while the trial force `f0 - stiffness * slip` is within mu times the normal force it sticks, and does not creep; beyond,
//! the force stays on the disc.
//! The tangential force acts at the surface, with its arm on the frame; the normal force at the centerline.
//! A contact that begins to slide enters with its secant stiffness, limit over trial length, in every tangential direction: with none
//! along the slip (the tangent) a light thread spun by friction overshoots from slip to counter-slip for ever. Once a contact slides along
//! its thread in the same direction in two iterations the tangent is taken; across the thread, where it may roll, never.
//! The dependence of the disc on the normal force is left out of the matrix (it would be unsymmetric); iteration closes it.

use crate::math::{Pose, log, outer, skew};
use crate::model::Model;
use crate::params;
use crate::scratch::Scratch;
use crate::state::{ShapeContact, State};
use glam::{DMat3, DQuat, DVec3};

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
    /// Friction coefficients sticking and sliding.
    mu: [f64; 2],
    sliding: bool,
    /// Friction force at the start of the substep, in the tangent plane then.
    anchor: DVec3,
    /// Outward direction of the surface at the last look.
    normal: DVec3,
    gap: f64,
    /// Force on the thread at the last look.
    normal_force: f64,
    friction: DVec3,
    /// Direction of the friction force in the iteration before, when it slid.
    slid: DVec3,
}

/// Collects the rows of the substep.
pub(crate) fn begin(model: &Model, state: &State, scratch: &mut Scratch) {
    let Scratch { candidates, start, start_shape_pose, rows, .. } = scratch;
    rows.shapes.clear();
    rows.sliders.begin(model);
    let old = &state.shape_contacts;
    for (slot, e) in &candidates.shapes {
        let (k, e) = (*slot as usize, *e as usize);
        let shape = model.shapes.at(*slot).expect("candidate shapes live");
        let rod = model.rods.at(model.rod_of[e]).expect("element of a living rod");
        let friction = model.friction_between(rod.surface, shape.surface);
        let pose = &state.shape_pose[k];
        let reach = rod.radius * (1.0 + params::REACH);
        let x = &state.position;
        let far = |i: usize| {
            let before = shape.collider.distance(&start_shape_pose[k], start[i], None);
            let now = shape.collider.distance(pose, x[i], Some(before.normal));
            (before.value.min(now.value), before)
        };
        let (d0, _) = far(e);
        let (d1, _) = far(e + 1);
        let length = (x[e + 1] - x[e]).length();
        if d0.min(d1) > reach + length {
            continue;
        }
        let mut add = |s: f64| {
            let p0 = start[e].lerp(start[e + 1], s);
            let before = shape.collider.distance(&start_shape_pose[k], p0, None);
            // Old contacts are sorted; those of this element on this shape are a few entries.
            let from = old.partition_point(|c| (c.shape, c.element) < (*slot, e as u32));
            let known = old[from..]
                .iter()
                .take_while(|c| (c.shape, c.element) == (*slot, e as u32))
                .filter(|c| (c.s - s).abs() < 0.3)
                .min_by(|a, b| (a.s - s).abs().total_cmp(&(b.s - s).abs()));
            let normal = match known {
                Some(c) if c.normal.dot(before.normal) < 0.0 => -before.normal,
                _ => before.normal,
            };
            let now = shape.collider.distance(pose, x[e].lerp(x[e + 1], s), Some(normal));
            if now.value.min(before.value) > reach {
                return;
            }
            let anchor = known.map_or(DVec3::ZERO, |c| c.friction - normal * normal.dot(c.friction));
            rows.shapes.push(ShapeRow {
                shape: *slot,
                element: e as u32,
                s,
                radius: rod.radius,
                hardness: 10.0 * rod.material.young_modulus,
                stiffness: 0.0,
                mu: [friction.stick, friction.slide],
                sliding: known.is_some_and(|c| c.sliding),
                anchor,
                normal,
                gap: before.value - rod.radius * (1.0 + 2.0 * params::KEEP),
                normal_force: known.map_or(0.0, |c| c.normal_force),
                friction: DVec3::ZERO,
                slid: DVec3::ZERO,
            });
        };
        add(0.0);
        let s = shape.collider.nearest_on_segment(pose, x[e], x[e + 1]);
        if s > 0.02 && s < 0.98 {
            let mid = shape.collider.distance(pose, x[e].lerp(x[e + 1], s), None).value;
            // A row of its own only where the surface bulges toward the middle by more than may overlap. On a flatter one a chord would
            // rock about it: the closest place runs along the element by (radius of the surface) x (tilt).
            if mid < d0.min(d1) - 0.08 * rod.radius {
                add(s);
            }
        }
        if !model.is_element(e + 1) {
            add(1.0);
        }
    }
}

/// Where things were at the start of the substep.
struct Start<'a> {
    position: &'a [DVec3],
    frame: &'a [DQuat],
    shape: &'a [Pose],
}

/// Looks where the row is now.
fn look(model: &Model, state: &State, row: &mut ShapeRow) -> DVec3 {
    let e = row.element as usize;
    let shape = model.shapes.at(row.shape).expect("rows name living shapes");
    let p = state.position[e].lerp(state.position[e + 1], row.s);
    let d = shape.collider.distance(&state.shape_pose[row.shape as usize], p, Some(row.normal));
    row.normal = d.normal;
    row.gap = d.value - row.radius * (1.0 + 2.0 * params::KEEP);
    p
}

/// Forces of a row at the iterate, and their stiffness against moves of the surface point. `None` when it carries none. In the first
/// iteration a row that carried force is linearized where it carried it: Newton starts where velocity leads, which may be just off the
/// surface.
fn forces(model: &Model, state: &State, start: &Start<'_>, row: &mut ShapeRow, first: bool) -> Option<DMat3> {
    let p = look(model, state, row);
    let (e, n) = (row.element as usize, row.normal);
    let mut depth = (-row.gap).max(0.0);
    row.stiffness = 2.0 * row.hardness * depth;
    if first && row.normal_force > row.hardness * depth * depth {
        depth = (row.normal_force / row.hardness).sqrt();
        row.stiffness = 2.0 * row.hardness * depth;
        row.normal_force += row.stiffness * (-row.gap - depth);
    } else {
        row.normal_force = row.hardness * depth * depth;
    }
    if depth == 0.0 {
        row.friction = DVec3::ZERO;
        return None;
    }
    let k = row.stiffness;
    let arm = n * -row.radius;
    let turned = log(state.orientation[e] * start.frame[e].conjugate());
    let carried = surface_motion(&start.shape[row.shape as usize], &state.shape_pose[row.shape as usize], p + arm);
    let moved = p - start.position[e].lerp(start.position[e + 1], row.s) + turned.cross(arm) - carried;
    let tangential = |v: DVec3| v - n * n.dot(v);
    let trial = tangential(row.anchor) - tangential(moved) * k;
    let limit = row.mu[usize::from(row.sliding)] * row.normal_force.max(0.0);
    let size = trial.length();
    if size <= limit {
        row.slid = DVec3::ZERO;
        row.sliding = false;
        row.friction = trial;
        return Some(DMat3::from_diagonal(DVec3::splat(k)));
    }
    row.sliding = true;
    let limit = row.mu[1] * row.normal_force.max(0.0);
    let direction = trial / size;
    row.friction = direction * limit;
    let secant = (DMat3::IDENTITY - outer(n, n)) * (k * limit / size);
    let along = (state.position[e + 1] - state.position[e]).normalize_or_zero();
    let steady = row.slid.dot(direction) > 0.95 && direction.dot(along).abs() > 0.95;
    row.slid = direction;
    Some(outer(n, n) * k + if steady { secant - outer(direction, direction) * (k * limit / size) } else { secant })
}

/// Adds forces and stiffness of the rows at the iterate.
pub(crate) fn assemble(model: &Model, state: &State, scratch: &mut Scratch, h: f64, first: bool) {
    let Scratch { rows, system, rhs, start, start_frame, start_shape_pose, .. } = scratch;
    rows.sliders.clear(model, state, start_shape_pose, h);
    let start = Start { position: start, frame: start_frame, shape: start_shape_pose };
    for row in &mut rows.shapes {
        let Some(stiffness) = forces(model, state, &start, row, first) else { continue };
        let e = row.element as usize;
        let arm = row.normal * -row.radius;
        let (a, b) = (1.0 - row.s, row.s);
        let force = row.normal * row.normal_force + row.friction;
        rhs[2 * e] += force * a;
        rhs[2 * e + 2] += force * b;
        rhs[2 * e + 1] += arm.cross(row.friction);
        let turn = skew(arm) * -1.0;
        let kt = stiffness * turn;
        system.diagonal[2 * e] += stiffness * (a * a);
        system.diagonal[2 * e + 2] += stiffness * (b * b);
        system.after[2 * e] += stiffness * (a * b);
        system.next[2 * e] += kt * a;
        system.next[2 * e + 1] += kt.transpose() * b;
        system.diagonal[2 * e + 1] += turn.transpose() * kt;
        rows.sliders.add(row.shape, e, &stiffness, force, [a, b], &turn);
    }
}

/// How far a shape's material point now at `point` has come since the start of the substep.
fn surface_motion(from: &Pose, to: &Pose, point: DVec3) -> DVec3 {
    if from == to { DVec3::ZERO } else { point - from.transform_point(to.inverse_transform_point(point)) }
}

/// Whether the iterate agrees with the forces that it was computed with: what the law says now against its linearization.
pub(crate) fn settled(model: &Model, state: &State, scratch: &mut Scratch) -> bool {
    let rows = &mut scratch.rows.shapes;
    let largest = rows.iter().map(|r| r.normal_force).fold(0.0, f64::max);
    rows.iter_mut().all(|row| {
        let (gap, normal) = (row.gap, row.normal);
        look(model, state, row);
        let predicted = (row.normal_force - row.stiffness * (row.gap - gap)).max(0.0);
        let now = row.hardness * (-row.gap).max(0.0).powi(2);
        (row.gap, row.normal) = (gap, normal);
        // Forces under a millionth of E r^2 do not move a thread.
        let floor = 1e-7 * row.hardness * row.radius * row.radius;
        (now - predicted).abs() <= 0.02 * largest + floor
    })
}

/// What the next substep starts from: the forces at the accepted state, not those that its last iteration was computed with.
pub(crate) fn finish(model: &Model, state: &mut State, scratch: &mut Scratch) {
    let Scratch { rows, start, start_frame, start_shape_pose, .. } = scratch;
    let start = Start { position: start, frame: start_frame, shape: start_shape_pose };
    let mut contacts = core::mem::take(&mut state.shape_contacts);
    contacts.clear();
    for row in &mut rows.shapes {
        if forces(model, state, &start, row, false).is_some() {
            contacts.push(ShapeContact {
                shape: row.shape,
                element: row.element,
                s: row.s,
                normal: row.normal,
                normal_force: row.normal_force,
                friction: row.friction,
                sliding: row.sliding,
            });
        }
    }
    state.shape_contacts = contacts;
}
