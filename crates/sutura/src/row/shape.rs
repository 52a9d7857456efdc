//! Contact of thread with shapes. A shape has no compliance of its own, so each contact touches one rod at one place and goes straight
//! into that rod's matrix: cost is linear in the number of contacts.
//!
//! Normal: energy `k gap^2 / 2` for gap < 0, k = E r (the scale of Hertz stiffness), gap = signed distance of the centerline point less r.
//! Friction: Coulomb with a tangential spring of the same k from the anchor of the last substep (Cundall and Strack 1979): while the
//! trial force `f0 - k slip` is within mu times the normal force it sticks, and does not creep; beyond, the force stays on the disc.
//! The tangential force acts at the surface, with its arm on the frame; the normal force at the centerline.
//! The dependence of the disc on the normal force is left out of the matrix (it would be unsymmetric); iteration closes it.

use crate::math::{Pose, log, outer, skew};
use crate::model::Model;
use crate::scratch::Scratch;
use crate::state::{ShapeContact, State};
use glam::{DMat3, DVec3};

/// A place on a thread that may touch a shape in this substep.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ShapeRow {
    shape: u32,
    element: u32,
    s: f64,
    radius: f64,
    stiffness: f64,
    /// Friction coefficients sticking and sliding.
    mu: [f64; 2],
    sliding: bool,
    /// Friction force at the start of the substep, in the tangent plane then.
    anchor: DVec3,
    /// Outward direction of the surface at the last look.
    normal: DVec3,
    gap: f64,
    active: bool,
    /// Force on the thread at the last look.
    normal_force: f64,
    friction: DVec3,
}

/// Collects the rows of the substep.
pub(crate) fn begin(model: &Model, state: &State, scratch: &mut Scratch) {
    let Scratch { candidates, start, start_shape_pose, rows, .. } = scratch;
    rows.shapes.clear();
    let old = &state.shape_contacts;
    for (slot, e) in &candidates.shapes {
        let (k, e) = (*slot as usize, *e as usize);
        let shape = model.shapes.at(*slot).expect("candidate shapes live");
        let rod = model.rods.at(model.rod_of[e]).expect("element of a living rod");
        let friction = model.friction_between(rod.surface, shape.surface);
        let pose = &state.shape_pose[k];
        let reach = rod.radius * (1.0 + crate::params::REACH);
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
                stiffness: rod.contact_stiffness,
                mu: [friction.stick, friction.slide],
                sliding: known.is_some_and(|c| c.sliding),
                anchor,
                normal,
                gap: before.value - rod.radius,
                active: known.is_some_and(|c| c.normal_force > 0.0) || now.value < rod.radius,
                normal_force: known.map_or(0.0, |c| c.normal_force),
                friction: DVec3::ZERO,
            });
        };
        add(0.0);
        let s = shape.collider.nearest_on_segment(pose, x[e], x[e + 1]);
        if s > 0.02 && s < 0.98 {
            let mid = shape.collider.distance(pose, x[e].lerp(x[e + 1], s), None).value;
            // A row of its own only where the surface bulges toward the middle.
            if mid < d0.min(d1) - 1e-3 * rod.radius {
                add(s);
            }
        }
        if !model.is_element(e + 1) {
            add(1.0);
        }
    }
}

/// Looks at each row at the iterate.
fn look(model: &Model, state: &State, row: &mut ShapeRow) -> DVec3 {
    let e = row.element as usize;
    let shape = model.shapes.at(row.shape).expect("rows name living shapes");
    let p = state.position[e].lerp(state.position[e + 1], row.s);
    let d = shape.collider.distance(&state.shape_pose[row.shape as usize], p, Some(row.normal));
    row.normal = d.normal;
    row.gap = d.value - row.radius;
    p
}

/// Adds forces and stiffness of the rows at the iterate. In the first iteration a row that carried force is taken to carry it still.
pub(crate) fn assemble(model: &Model, state: &State, scratch: &mut Scratch, first: bool) {
    let Scratch { rows, system, rhs, start, start_frame, start_shape_pose, .. } = scratch;
    for row in &mut rows.shapes {
        let p = look(model, state, row);
        if !first {
            row.active = row.gap < 0.0;
        }
        if !row.active {
            (row.normal_force, row.friction) = (0.0, DVec3::ZERO);
            continue;
        }
        let (e, n, k) = (row.element as usize, row.normal, row.stiffness);
        row.normal_force = -k * row.gap;
        let arm = n * -row.radius;
        let turned = log(state.orientation[e] * start_frame[e].conjugate());
        let moved = p - start[e].lerp(start[e + 1], row.s) + turned.cross(arm) - surface_motion(&start_shape_pose[row.shape as usize], &state.shape_pose[row.shape as usize], p + arm);
        let slip = moved - n * n.dot(moved);
        let anchor = row.anchor - n * n.dot(row.anchor);
        let trial = anchor - slip * k;
        let limit = row.mu[usize::from(row.sliding)] * row.normal_force.max(0.0);
        let size = trial.length();
        let across = DMat3::IDENTITY - outer(n, n);
        let stiffness = if size <= limit {
            row.sliding = false;
            row.friction = trial;
            DMat3::from_diagonal(DVec3::splat(k))
        } else {
            row.sliding = true;
            let limit = row.mu[1] * row.normal_force.max(0.0);
            let d = trial / size;
            row.friction = d * limit;
            outer(n, n) * k + (across - outer(d, d)) * (k * limit / size)
        };
        let (a, b) = (1.0 - row.s, row.s);
        let force = n * row.normal_force + row.friction;
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
    }
}

/// How far a shape's material point now at `point` has come since the start of the substep.
fn surface_motion(from: &Pose, to: &Pose, point: DVec3) -> DVec3 {
    if from == to { DVec3::ZERO } else { point - from.transform_point(to.inverse_transform_point(point)) }
}

/// Whether the iterate agrees with the forces that it was computed with: no contact opened or closed, no friction disc that changed.
pub(crate) fn settled(model: &Model, state: &State, scratch: &mut Scratch) -> bool {
    let rows = &mut scratch.rows.shapes;
    let largest = rows.iter().map(|r| r.normal_force).fold(0.0, f64::max);
    rows.iter_mut().all(|row| {
        let (gap, force, active) = (row.gap, row.normal_force, row.active);
        look(model, state, row);
        let now = row.stiffness * (-row.gap).max(0.0);
        row.gap = gap;
        let opened = active != (now > 0.0) && (now - force).abs() > 1e-3 * largest;
        !opened && (now - force).abs() * row.mu[0] <= 1e-2 * largest
    })
}

/// What the next substep starts from.
pub(crate) fn finish(model: &Model, state: &mut State, scratch: &mut Scratch) {
    state.shape_contacts.clear();
    for row in &mut scratch.rows.shapes {
        look(model, state, row);
        if row.gap >= 0.0 {
            continue;
        }
        let normal_force = -row.stiffness * row.gap;
        let limit = row.mu[0] * normal_force;
        let friction = (row.friction - row.normal * row.normal.dot(row.friction)).clamp_length_max(limit);
        state.shape_contacts.push(ShapeContact { shape: row.shape, element: row.element, s: row.s, normal: row.normal, normal_force, friction, sliding: row.sliding });
    }
}
