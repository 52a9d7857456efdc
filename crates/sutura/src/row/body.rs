//! Contact of bodies with each other and with other shapes: hard, with Coulomb friction, in the small contact problem.
//!
//! A pair of solids touches at a few places, which are found anew at each iterate; a place that is near one of the
//! iterate before takes over its force. Slip is that of the surfaces past the place, counted along the arc, so that
//! what rolls does not slip.

use crate::collide::Candidates;
use crate::math::{Pose, log};
use crate::model::Model;
use crate::model::collider::{Manifolds, Touch, touches};
use crate::motion::Motion;
use crate::params;
use crate::row::border::Border;
use crate::row::movers::Movers;
use crate::row::side::{Moves, Side};
use crate::row::system::{Entry, Source};
use crate::state::{Contact, Site, State};
use glam::DVec3;

/// A place where two solids may touch, at the iterate.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BodyRow {
    shapes: [u32; 2],
    /// In the frame of each.
    at: [DVec3; 2],
    /// Normal from the second toward the first, and two tangents.
    axes: [DVec3; 3],
    gap: f64,
    /// Gap of the same material at the start, and the part of an overlap there that may remain.
    start_gap: f64,
    keep: f64,
    slip: DVec3,
    /// The place, halfway between the two surfaces.
    middle: DVec3,
    moves: [Option<Moves>; 2],
    mu: [f64; 2],
    sliding: bool,
    /// A length of the smaller of the two bodies.
    size: f64,
    /// Compliance of the constraint \[m/N\], and the most that it is.
    compliance: f64,
    loose: f64,
    /// Slip still to be undone and friction force at the start of the substep.
    residual_slip: DVec3,
    friction_before: DVec3,
    /// Force on the first along the axes \[N\].
    pub force: DVec3,
}

/// Compliance of a contact over that of a free body in a substep: it tells redundant contacts apart. A body lies as
/// much of `g h^2` deep.
const GIVE: f64 = 1e-3;

/// Part of the size of the smaller body up to which a force presses bodies into each other.
const DEEP: f64 = 2e-3;

/// How far a place may be from one of the iterate before to be the same, over the size of the smaller body.
const SAME: f64 = 0.5;

/// What the contact solve may leave of a gap, in thread radii, is so much of the size of a body.
const PRECISE: f64 = 1e-2;

/// Way in a substep, over the size of the smaller body, from which on the two may be past each other at its end.
const FAST: f64 = 0.25;

/// Rows of bodies, and the memory of finding them.
#[derive(Default)]
pub(crate) struct BodyRows {
    pub rows: Vec<BodyRow>,
    before: Vec<BodyRow>,
    manifolds: Manifolds,
}

impl BodyRows {
    /// Finds the rows of a solve as things are at its start, with the forces of the last one.
    pub fn prepare(&mut self, model: &Model, state: &State, motion: &Motion, candidates: &Candidates) {
        self.before.clear();
        for c in state.contacts.bodies() {
            if let (Site::Surface { shape: a, at }, Site::Surface { shape: b, at: other }) = (c.a, c.b) {
                let axes = axes(c.normal);
                self.before.push(BodyRow {
                    shapes: [a, b],
                    at: [at, other],
                    axes,
                    gap: 0.0,
                    start_gap: 0.0,
                    keep: 1.0,
                    slip: DVec3::ZERO,
                    middle: DVec3::ZERO,
                    moves: [None; 2],
                    mu: [0.0; 2],
                    sliding: c.sliding,
                    size: 0.0,
                    compliance: 0.0,
                    loose: 0.0,
                    residual_slip: c.residual_slip,
                    friction_before: c.friction,
                    force: DVec3::from_array(axes.map(|axis| axis.dot(c.force()))),
                });
            }
        }
        self.find(model, state, motion, candidates);
    }

    /// Finds the rows at an iterate; those of the one before hand on their forces.
    pub fn update(&mut self, model: &Model, state: &State, motion: &Motion, candidates: &Candidates) {
        core::mem::swap(&mut self.before, &mut self.rows);
        self.find(model, state, motion, candidates);
    }

    fn find(&mut self, model: &Model, state: &State, motion: &Motion, candidates: &Candidates) {
        let BodyRows { rows, before, manifolds } = self;
        rows.clear();
        for pair in &candidates.solids {
            let shapes = [pair.0, pair.1];
            let [a, b] = shapes.map(|k| model.shapes.at(k).expect("candidate shapes live"));
            let start = shapes.map(|k| &motion.start_shape_pose[k as usize]);
            let now = shapes.map(|k| &state.shape_pose[k as usize]);
            let size = shapes.map(|k| size_of(model, k)).into_iter().fold(f64::INFINITY, f64::min);
            let mass =
                shapes.iter().filter_map(|k| model.body_of(*k)).map(|b| b.mass.mass).fold(f64::INFINITY, f64::min);
            let friction = model.friction_between(a.surface, b.surface);
            let way: f64 =
                [0, 1].map(|k| a_way(start[k], now[k], if k == 0 { &a.collider } else { &b.collider })).iter().sum();
            let reach = way + params::MARGIN * size;
            // What is won back goes with the time, so that a shorter solve asks for less.
            let part = (motion.span / model.settings.substep).min(1.0);
            let keep = 1.0 - (1.0 - params::RECOVER) * part;
            // The iterate may have them past each other.
            let mut seen = now;
            if way > FAST * size {
                let mut normals = [DVec3::ZERO; 2];
                for (seen, normal) in [start, now].into_iter().zip(&mut normals) {
                    touches([&a.collider, &b.collider], seen, reach, manifolds, |t| *normal += t.normal);
                }
                if normals[0] != DVec3::ZERO && normals[0].dot(normals[1]) <= 0.0 {
                    seen = start;
                }
            }
            touches([&a.collider, &b.collider], seen, reach, manifolds, |touch: Touch| {
                let n = touch.normal;
                let mut row = BodyRow {
                    shapes,
                    at: touch.at,
                    axes: axes(n),
                    gap: 0.0,
                    start_gap: 0.0,
                    keep,
                    slip: DVec3::ZERO,
                    middle: DVec3::ZERO,
                    moves: [None; 2],
                    mu: [friction.stick, friction.slide],
                    sliding: false,
                    size,
                    compliance: GIVE * motion.span * motion.span / mass,
                    loose: GIVE * motion.span * motion.span / mass,
                    residual_slip: DVec3::ZERO,
                    friction_before: DVec3::ZERO,
                    force: DVec3::ZERO,
                };
                let far = |r: &&mut BodyRow| (r.at[0] - row.at[0]).length().min((r.at[1] - row.at[1]).length());
                let same = before
                    .iter_mut()
                    .filter(|r| r.shapes == shapes && r.axes[0].dot(n) > 0.5)
                    .filter(|r| far(r) < SAME * size)
                    .min_by(|x, y| far(x).total_cmp(&far(y)));
                if let Some(same) = same {
                    let force: DVec3 = (0..3).map(|k| same.axes[k] * same.force[k]).sum();
                    row.force = DVec3::from_array(row.axes.map(|axis| axis.dot(force)));
                    row.residual_slip = same.residual_slip - n * n.dot(same.residual_slip);
                    row.friction_before = same.friction_before - n * n.dot(same.friction_before);
                    row.sliding = same.sliding;
                    // Each hands on once.
                    same.shapes = [u32::MAX; 2];
                }
                rows.push(row);
            });
        }
    }
}

/// Way of the surface of a shape past a point of the world: of what rolls the arc, not the chord.
fn way_at(from: &Pose, to: &Pose, point: DVec3) -> DVec3 {
    if from == to {
        return DVec3::ZERO;
    }
    let turn = log(to.orientation * from.orientation.conjugate());
    to.position - from.position + turn.cross(point - to.position)
}

/// How far the surface of a shape moves at most.
fn a_way(from: &Pose, to: &Pose, collider: &crate::model::collider::Collider) -> f64 {
    if from == to {
        return 0.0;
    }
    let turn = log(to.orientation * from.orientation.conjugate()).length();
    (to.position - from.position).length() + turn * collider.reach()
}

/// A length of a solid of a body: its thickness, or the radius of gyration of the body.
fn size_of(model: &Model, shape: u32) -> f64 {
    let half_side = || model.shapes.at(shape).map_or(f64::INFINITY, |s| s.collider.half_side());
    model.body_of(shape).map_or(f64::INFINITY, |body| body.size().min(half_side()))
}

fn axes(n: DVec3) -> [DVec3; 3] {
    let t = n.any_orthonormal_vector();
    [n, t, n.cross(t)]
}

impl BodyRow {
    /// Gap that it may keep: a part of the overlap that there was.
    fn allowed(&self) -> f64 {
        self.keep * self.start_gap.min(0.0)
    }

    /// Measures gaps and slip.
    fn measure(&mut self, model: &Model, state: &State, motion: &Motion) {
        let pose = |poses: &[Pose], side: usize| poses[self.shapes[side] as usize];
        let [now, start] = [&state.shape_pose, &motion.start_shape_pose].map(|poses| [pose(poses, 0), pose(poses, 1)]);
        let n = self.axes[0];
        let points = [0, 1].map(|side| now[side].transform_point(self.at[side]));
        let before = [0, 1].map(|side| start[side].transform_point(self.at[side]));
        let middle = (points[0] + points[1]) * 0.5;
        self.middle = middle;
        // Of what rolls the arc is counted from the body's own center.
        let way = |side: usize| {
            let inward = model.local_of(self.shapes[side]).map_or(Pose::IDENTITY, Pose::inverse);
            way_at(&start[side].compose(&inward), &now[side].compose(&inward), middle)
        };
        let slip = way(0) - way(1);
        self.gap = n.dot(points[0] - points[1]);
        self.start_gap = n.dot(before[0] - before[1]);
        self.slip = slip - n * n.dot(slip);
    }

    /// Move of the first against the second by the last steps of the border.
    fn moved(&self, border: &Border) -> DVec3 {
        let [a, b] = self.moves.map(|m| m.map_or(DVec3::ZERO, |m| m.along(border)));
        a - b
    }
}

/// Adds all rows to the contact system.
pub(crate) fn add_entries(
    model: &Model,
    state: &State,
    motion: &Motion,
    rows: &mut [BodyRow],
    (movers, border): (&Movers, &Border),
    entries: &mut Vec<Entry>,
) {
    for (k, row) in rows.iter_mut().enumerate() {
        // Here, since Newton may have gone back since they were found.
        row.measure(model, state, motion);
        row.moves = row.shapes.map(|shape| movers.moves(shape, row.middle));
        // A firm load would press a light body deep.
        row.compliance = row.loose.min(DEEP * row.size / row.force.x.max(f64::MIN_POSITIVE));
        let moved = row.moved(border);
        let slip = row.slip + row.residual_slip + moved - row.friction_before * row.compliance;
        let [n, t1, t2] = row.axes;
        let [a, b] = row.moves;
        entries.push(Entry {
            source: Source::Body(k as u32),
            island: 0,
            sides: [
                a.map_or(Side::Still, |m| Side::Shared(m.toward(row.axes))),
                b.map_or(Side::Still, |m| Side::Shared(m.against(row.axes))),
            ],
            free: DVec3::new(row.gap + n.dot(moved) - row.allowed(), slip.dot(t1), slip.dot(t2)),
            mu: row.mu[usize::from(row.sliding)],
            compliance: DVec3::splat(row.compliance),
            radius: PRECISE * row.size,
            force: row.force,
        });
    }
}

/// What the next substep starts from.
pub(crate) fn contacts<'a>(
    model: &'a Model,
    state: &'a State,
    motion: &'a Motion,
    rows: &'a mut [BodyRow],
) -> impl Iterator<Item = Contact> + use<'a> {
    rows.iter_mut().filter(|r| r.force.x > 0.0).map(|row| {
        row.measure(model, state, motion);
        let [n, t1, t2] = row.axes;
        let friction = t1 * row.force.y + t2 * row.force.z;
        let at_limit = friction.length() >= params::AT_LIMIT * row.mu[usize::from(row.sliding)] * row.force.x;
        let left = row.slip + row.residual_slip + (friction - row.friction_before) * row.compliance;
        Contact {
            a: Site::Surface { shape: row.shapes[0], at: row.at[0] },
            b: Site::Surface { shape: row.shapes[1], at: row.at[1] },
            normal: n,
            normal_force: row.force.x,
            friction,
            residual_slip: if at_limit {
                DVec3::ZERO
            } else {
                left.clamp_length_max(params::RESIDUAL_SLIP_MOST * row.size)
            },
            sliding: at_limit && left.length() > params::SLIP * row.size,
        }
    })
}

/// Whether the iterate keeps the gaps.
pub(crate) fn converged(model: &Model, state: &State, motion: &Motion, rows: &mut [BodyRow]) -> bool {
    rows.iter_mut().all(|r| {
        r.measure(model, state, motion);
        r.gap > r.allowed() - params::SLACK * r.size
    })
}
