//! The independent audit: did anything pass through anything, how near did things come, how far did threads stretch.
//!
//! It looks only at positions at accepted states, with its own distances and its own search for near pairs, so that it
//! cannot share a mistake with the contact code. Between two states it takes every particle to move along a straight
//! line. For a shape that turns that can be a straight line as seen from the shape or from the world: only what crosses
//! on both ways has passed through. (Between two states it turns by far less than a right angle; where it does not, the
//! two ways have little to do with each other.)
//!
//! - Thread through thread: the centerlines of two elements come within a thousandth of the smaller radius. Elements
//!   with less than `pi r` of thread between them are left out, and so are those beside a weld or on both sides of a
//!   cut.
//! - Thread through shape: the centerline is inside a solid, or comes within a thousandth of the radius of a mesh's
//!   surface.
//! - Clearance: (distance of centerlines - radii) / mean diameter at the states themselves, 0 touches, negative
//!   overlaps; to a shape (distance of centerline from surface - radius) / diameter. Only what is nearer than one
//!   diameter is looked at.
//!
//! A thread or shape that appears, or whose number of particles changes, or that is a ring which was cut, is taken up
//! from its first state on; a thread
//! removed and replaced by one of the same size and radius in the same slot between two states cannot be told from a
//! move.

mod distance;

use crate::knot::space::{Aabb, BoxTree, segment_triangle, segments};
use crate::math::log;
use crate::{Geometry, Pose, ShapeView, View};
use distance::{segment_solid, time_within};
use glam::DVec3;

/// What passed through what.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pair {
    /// Two pieces of thread: slot of the thread and element.
    Threads {
        /// The one.
        a: (usize, usize),
        /// The other.
        b: (usize, usize),
    },
    /// A piece of thread and a shape.
    Shape {
        /// Slot of the thread and element.
        thread: (usize, usize),
        /// Slot of the shape.
        shape: usize,
    },
}

/// One passage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// Simulated time of the state at which it was seen \[s\].
    pub time: f64,
    /// What crossed.
    pub what: Pair,
}

/// The place of least clearance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Closest {
    /// Clearance in diameters.
    pub clearance: f64,
    /// Simulated time \[s\].
    pub time: f64,
    /// Between what.
    pub what: Pair,
}

/// What the audit has seen so far.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct AuditReport {
    /// Whether anything passed through anything.
    pub passes_through: bool,
    /// The passages in order of time, at most the first [`Audit::MOST_CROSSINGS`].
    pub crossings: Vec<Crossing>,
    /// Least clearance of two pieces of thread in diameters; `None` when none came nearer than one diameter.
    pub thread_clearance: Option<f64>,
    /// Where and when that was.
    pub thread_closest: Option<Closest>,
    /// Least clearance of thread and shape in diameters; `None` when none came nearer than one diameter.
    pub shape_clearance: Option<f64>,
    /// Where and when that was.
    pub shape_closest: Option<Closest>,
    /// Largest |length - rest length| / rest length of an element, by slot of the thread.
    pub max_elongation: Vec<(usize, f64)>,
    /// States looked at.
    pub states: u64,
    /// States with a number that is not finite; they (for a shape: it) were left out.
    pub states_not_finite: u64,
}

/// Watches a world. Give it every accepted state ([`World::step_with`](crate::World::step_with)).
#[derive(Debug, Default)]
pub struct Audit {
    report: AuditReport,
    now: Frame,
    before: Frame,
    /// Rest arc length of each particle from the start of its thread.
    arc: Vec<f64>,
    /// One a thread: boxes around what its elements swept.
    trees: Vec<BoxTree>,
    welds: Vec<SeenWeld>,
    shapes: Vec<SeenShape>,
}

/// Positions at one state.
#[derive(Debug, Default)]
struct Frame {
    rods: Vec<SeenRod>,
    position: Vec<DVec3>,
}

#[derive(Debug, Clone, Copy)]
struct SeenRod {
    slot: usize,
    turned: u32,
    radius: f64,
    first: usize,
    n_particles: usize,
    /// Where its particles are in the frame before, when it was there.
    first_before: Option<usize>,
}

#[derive(Debug)]
struct SeenShape {
    slot: usize,
    pose: Pose,
    geometry: Geometry,
    bounds: Option<Aabb>,
    triangles: Triangles,
    /// Whether it is there in the state at hand.
    alive: bool,
}

/// Places that are joined at the state at hand, or were until a cut: the number of the thread there and the rest arc on
/// it, and up to which way by there elements of the threads do not touch.
#[derive(Debug)]
struct SeenWeld {
    places: Vec<(usize, f64)>,
    filter_distance: f64,
    /// The body that it is on, by its slot, and up to which way elements do not touch that.
    body: Option<(usize, f64)>,
}

/// Filter distance of a weld, the body that it is on with its filter distance, and its places by thread slot and
/// particle.
type Joined = (f64, Option<(usize, f64)>, Vec<(usize, usize)>);

impl SeenWeld {
    /// The shortest rest arc to it from an element that goes from `from` to `to` on the thread of number `k`.
    fn way(&self, k: usize, from: f64, to: f64) -> f64 {
        let ways = self.places.iter().filter(|p| p.0 == k).map(|p| (p.1 - to).max(from - p.1).max(0.0));
        ways.fold(f64::INFINITY, f64::min)
    }
}

/// One thread at one state, as plain slices.
#[derive(Debug, Clone, Copy)]
struct RodSlice<'a> {
    slot: usize,
    /// Changes where its particles are numbered otherwise.
    turned: u32,
    radius: f64,
    positions: &'a [DVec3],
    rest_lengths: &'a [f64],
}

/// Centerlines nearer than this part of the radius have crossed.
const TOUCHING: f64 = 1e-3;
/// A way as seen from a shape that turns counts as straight where it is off by this part of the radius, in at most
/// [`MOST_PIECES`] pieces.
const STRAIGHT: f64 = 1e-2;
/// See [`STRAIGHT`]: enough for half a turn of a shape of a hundred radii.
const MOST_PIECES: f64 = 256.0;

impl Audit {
    /// The number of passages that are listed one by one.
    pub const MOST_CROSSINGS: usize = 256;

    /// An audit that has seen nothing.
    pub fn new() -> Self {
        Self::default()
    }

    /// What was seen so far.
    pub fn report(&self) -> &AuditReport {
        &self.report
    }

    /// Looks at an accepted state, and at what was swept since the one before.
    pub fn observe(&mut self, view: View<'_>) {
        let rods = view.rods().map(|r| RodSlice {
            slot: r.slot(),
            turned: r.turned(),
            radius: r.radius(),
            positions: r.positions(),
            rest_lengths: r.rest_lengths(),
        });
        self.observe_slices(
            view.time(),
            rods,
            view.shapes(),
            view.welds()
                .map(|w| (w.filter_distance(), w.body(), w.places().collect()))
                .chain(view.cuts().map(|c| (c.filter_distance(), None, c.places().to_vec()))),
        );
    }

    fn observe_slices<'a>(
        &mut self,
        time: f64,
        rods: impl Iterator<Item = RodSlice<'a>>,
        shapes: impl Iterator<Item = ShapeView<'a>>,
        welds: impl Iterator<Item = Joined>,
    ) {
        self.report.states += 1;
        core::mem::swap(&mut self.now, &mut self.before);
        if !self.take_up(rods) {
            self.report.states_not_finite += 1;
            // The last good state stays the one to sweep from.
            core::mem::swap(&mut self.now, &mut self.before);
            return;
        }
        self.refit();
        self.take_welds(welds);
        self.threads(time);
        self.all_shapes(time, shapes);
    }

    /// Copies the threads, and measures their elongation. Whether all numbers are finite.
    fn take_up<'a>(&mut self, rods: impl Iterator<Item = RodSlice<'a>>) -> bool {
        let Audit { report, now, before, arc, .. } = self;
        now.rods.clear();
        now.position.clear();
        arc.clear();
        for rod in rods {
            let n_particles = rod.positions.len();
            if n_particles < 2 || rod.rest_lengths.len() + 1 != n_particles {
                continue;
            }
            if rod.positions.iter().any(|p| !p.is_finite()) {
                return false;
            }
            let same = |old: &&SeenRod| {
                (old.slot, old.turned, old.n_particles) == (rod.slot, rod.turned, n_particles)
                    && old.radius.to_bits() == rod.radius.to_bits()
            };
            let first_before = before.rods.iter().find(same).map(|old| old.first);
            now.rods.push(SeenRod {
                slot: rod.slot,
                turned: rod.turned,
                radius: rod.radius,
                first: now.position.len(),
                n_particles,
                first_before,
            });
            now.position.extend_from_slice(rod.positions);
            let (mut s, mut elongation) = (0.0, 0.0_f64);
            arc.push(0.0);
            for (x, l) in rod.positions.windows(2).zip(rod.rest_lengths) {
                s += l;
                arc.push(s);
                elongation = elongation.max((x[0].distance(x[1]) - l).abs() / l);
            }
            match report.max_elongation.iter_mut().find(|e| e.0 == rod.slot) {
                Some(e) => e.1 = e.1.max(elongation),
                None => report.max_elongation.push((rod.slot, elongation)),
            }
        }
        true
    }

    /// Places by thread slot and particle.
    fn take_welds(&mut self, welds: impl Iterator<Item = Joined>) {
        let Audit { now, arc, welds: seen, .. } = self;
        seen.clear();
        for (filter_distance, body, places) in welds {
            let place = |(slot, particle): (usize, usize)| {
                let k = now.rods.iter().position(|rod| rod.slot == slot)?;
                Some((k, arc[now.rods[k].first + particle]))
            };
            seen.push(SeenWeld { places: places.into_iter().filter_map(place).collect(), filter_distance, body });
        }
    }

    /// Boxes around what each element swept, grown so that two overlap when the elements are nearer than any before:
    /// only then does their clearance matter. What crosses overlaps anyway.
    fn refit(&mut self) {
        let grow = 1.0 + self.report.thread_clearance.unwrap_or(1.0).max(-0.9);
        if self.trees.len() < self.now.rods.len() {
            self.trees.resize_with(self.now.rods.len(), BoxTree::default);
        }
        for (rod, tree) in self.now.rods.iter().zip(&mut self.trees) {
            tree.reset(rod.n_particles - 1);
            for e in 0..rod.n_particles - 1 {
                let mut b = Aabb::around(&self.now.element(rod, e));
                if let Some(old) = self.before.element_before(rod, e) {
                    b = b.union(&Aabb::around(&old));
                }
                tree.set(e, b.grown(grow * rod.radius));
            }
            tree.refit();
        }
    }

    fn threads(&mut self, time: f64) {
        let Audit { report, now, before, arc, trees, welds, .. } = self;
        // Whether two elements are near each other by way of a weld.
        let way = |weld: &SeenWeld, k: usize, e: usize| {
            weld.way(k, arc[now.rods[k].first + e], arc[now.rods[k].first + e + 1])
        };
        let joined = |i: usize, e: usize, k: usize, f: usize| {
            welds.iter().any(|w| way(w, i, e) + way(w, k, f) < w.filter_distance)
        };
        for (i, rod) in now.rods.iter().enumerate() {
            let apart = core::f64::consts::PI * rod.radius;
            trees[i].pairs(&mut |e, f| {
                if arc[rod.first + f] - arc[rod.first + e + 1] >= apart && !joined(i, e, i, f) {
                    thread_pair(report, now, before, time, (rod, e), (rod, f));
                }
            });
            for (k, (other, tree)) in now.rods.iter().zip(trees.iter()).enumerate().skip(i + 1) {
                trees[i].pairs_with(tree, &mut |e, f| {
                    if !joined(i, e, k, f) {
                        thread_pair(report, now, before, time, (rod, e), (other, f));
                    }
                });
            }
        }
    }

    fn all_shapes<'a>(&mut self, time: f64, shapes: impl Iterator<Item = ShapeView<'a>>) {
        let Audit { report, now, before, arc, trees, welds, shapes: seen, .. } = self;
        seen.iter_mut().for_each(|s| s.alive = false);
        for shape in shapes {
            let known = seen.iter().position(|s| s.slot == shape.slot && s.is(shape.geometry));
            if !(shape.pose.position.is_finite() && shape.pose.orientation.is_finite()) {
                report.states_not_finite += 1;
                // Its last good pose stays the one to sweep from.
                known.into_iter().for_each(|k| seen[k].alive = true);
                continue;
            }
            let k = known.unwrap_or_else(|| {
                seen.push(SeenShape::new(&shape));
                seen.len() - 1
            });
            let old_pose = known.map(|_| seen[k].pose);
            seen[k].pose = shape.pose;
            seen[k].alive = true;
            for (number, (rod, tree)) in now.rods.iter().zip(trees.iter()).enumerate() {
                let element = |report: &mut AuditReport, e: usize| {
                    let (from, to) = (arc[rod.first + e], arc[rod.first + e + 1]);
                    let holds = |w: &SeenWeld| w.body.filter(|b| Some(b.0) == shape.body).map(|b| b.1);
                    if welds.iter().any(|w| holds(w).is_some_and(|filter| w.way(number, from, to) < filter)) {
                        return;
                    }
                    thread_and_shape(report, time, rod, e, now, before, &seen[k], old_pose);
                };
                match &seen[k].bounds {
                    Some(bounds) => {
                        let reach = bounds
                            .swept(&old_pose.unwrap_or(shape.pose), &shape.pose)
                            .grown(near_shape(report, rod.radius));
                        tree.any(&reach, &mut |e| {
                            element(report, e);
                            false
                        });
                    }
                    None => (0..rod.n_particles - 1).for_each(|e| element(report, e)),
                }
            }
        }
        seen.retain(|s| s.alive);
    }
}

impl Frame {
    fn element(&self, rod: &SeenRod, e: usize) -> [DVec3; 2] {
        [self.position[rod.first + e], self.position[rod.first + e + 1]]
    }
    /// The same element in this frame, which is the one before.
    fn element_before(&self, rod: &SeenRod, e: usize) -> Option<[DVec3; 2]> {
        rod.first_before.map(|first| [self.position[first + e], self.position[first + e + 1]])
    }
}

impl AuditReport {
    fn cross(&mut self, time: f64, what: Pair) {
        self.passes_through = true;
        if self.crossings.len() < Audit::MOST_CROSSINGS {
            self.crossings.push(Crossing { time, what });
        }
    }
}

/// Distance from a surface under which clearance matters: less than ever before, at first less than a diameter.
fn near_shape(report: &AuditReport, radius: f64) -> f64 {
    radius * (1.0 + 2.0 * report.shape_clearance.unwrap_or(1.0).max(-0.5))
}

fn lerp(from: [DVec3; 2], to: [DVec3; 2], t: f64) -> [DVec3; 2] {
    [from[0].lerp(to[0], t), from[1].lerp(to[1], t)]
}

fn thread_pair(
    report: &mut AuditReport,
    now: &Frame,
    before: &Frame,
    time: f64,
    a: (&SeenRod, usize),
    b: (&SeenRod, usize),
) {
    let (p, q) = (now.element(a.0, a.1), now.element(b.0, b.1));
    let d = segments(p, q);
    let radii = a.0.radius + b.0.radius;
    let clearance = (d - radii) / radii;
    let what = Pair::Threads { a: (a.0.slot, a.1), b: (b.0.slot, b.1) };
    if clearance < report.thread_clearance.unwrap_or(1.0) {
        report.thread_clearance = Some(clearance);
        report.thread_closest = Some(Closest { clearance, time, what });
    }
    let (Some(old_p), Some(old_q)) = (before.element_before(a.0, a.1), before.element_before(b.0, b.1)) else { return };
    let limit = TOUCHING * a.0.radius.min(b.0.radius);
    let relative = |i: usize, j: usize| ((p[i] - old_p[i]) - (q[j] - old_q[j])).length();
    let rate = relative(0, 0).max(relative(0, 1)).max(relative(1, 0)).max(relative(1, 1));
    if d - rate > limit {
        return;
    }
    if time_within(&|t| segments(lerp(old_p, p, t), lerp(old_q, q, t)), rate, limit, limit).is_some() {
        report.cross(time, what);
    }
}

#[allow(clippy::too_many_arguments)] // One state of an element and one of a shape, now and before.
fn thread_and_shape(
    report: &mut AuditReport,
    time: f64,
    rod: &SeenRod,
    e: usize,
    now: &Frame,
    before: &Frame,
    shape: &SeenShape,
    old_pose: Option<Pose>,
) {
    let seen_from = |pose: &Pose, x: [DVec3; 2]| x.map(|x| pose.inverse_transform_point(x));
    let x = now.element(rod, e);
    let p = seen_from(&shape.pose, x);
    let near = near_shape(report, rod.radius);
    let what = Pair::Shape { thread: (rod.slot, e), shape: shape.slot };
    let d = shape.distance(p, near);
    let clearance = (d - rod.radius) / (2.0 * rod.radius);
    if clearance < report.shape_clearance.unwrap_or(1.0) {
        report.shape_clearance = Some(clearance);
        report.shape_closest = Some(Closest { clearance, time, what });
    }
    let Some((old_x, old_pose)) = before.element_before(rod, e).zip(old_pose) else {
        if shape.crosses(p, p, rod.radius) {
            report.cross(time, what);
        }
        return;
    };
    let old = seen_from(&old_pose, old_x);
    if shape.crosses(old, p, rod.radius) && crosses_in_the_world(shape, &old_pose, old_x, x, rod.radius) {
        report.cross(time, what);
    }
}

/// Whether a thread crosses a shape that turns when it is the thread that moves along a straight line, as seen from the
/// world. By then it was seen to cross along a straight line as seen from the shape. What the way between two states
/// was nobody knows: of a thread at rest the one is off by the height of the arc that the shape turns by, of a thread
/// that is taken along the other.
fn crosses_in_the_world(shape: &SeenShape, old_pose: &Pose, old_x: [DVec3; 2], x: [DVec3; 2], radius: f64) -> bool {
    let angle = log((shape.pose.orientation * old_pose.orientation.conjugate()).normalize()).length();
    let far = x
        .iter()
        .map(|x| x.distance(shape.pose.position))
        .chain(old_x.iter().map(|x| x.distance(old_pose.position)))
        .fold(0.0, f64::max);
    let moved = x
        .iter()
        .zip(&old_x)
        .map(|(x, old)| ((*x - *old) - (shape.pose.position - old_pose.position)).length())
        .fold(0.0, f64::max);
    // Height of the arc: an eighth of the acceleration in the turning frame.
    let arc = 0.125 * angle * (angle * far + 2.0 * moved);
    let pieces = (arc / (STRAIGHT * radius)).sqrt().ceil().clamp(1.0, MOST_PIECES);
    let at = |i: f64| {
        let t = i / pieces;
        let pose = old_pose.interpolate(&shape.pose, t);
        lerp(old_x, x, t).map(|x| pose.inverse_transform_point(x))
    };
    (0..pieces as u32).any(|i| shape.crosses(at(f64::from(i)), at(f64::from(i) + 1.0), radius))
}

impl SeenShape {
    fn new(shape: &ShapeView<'_>) -> Self {
        let symmetric = |half: DVec3| Some(Aabb { min: -half, max: half });
        let mut triangles = Triangles::default();
        let bounds = match shape.geometry {
            Geometry::Plane => None,
            Geometry::Sphere { radius } => symmetric(DVec3::splat(*radius)),
            Geometry::Capsule { radius, half_length } => symmetric(DVec3::new(*radius, *radius, radius + half_length)),
            Geometry::Cylinder { radius, half_length } => symmetric(DVec3::new(*radius, *radius, *half_length)),
            Geometry::Box { half_sides } => symmetric(*half_sides),
            Geometry::Mesh { vertices, triangles: t } => {
                triangles = Triangles::new(vertices, t);
                Some(Aabb::around(vertices))
            }
        };
        SeenShape {
            slot: shape.slot,
            pose: shape.pose,
            geometry: shape.geometry.clone(),
            bounds,
            triangles,
            alive: true,
        }
    }

    /// Distance of an element in the shape's frame from its surface, negative inside a solid; of a mesh no more than
    /// `near` is looked for.
    fn distance(&self, p: [DVec3; 2], near: f64) -> f64 {
        let Geometry::Mesh { vertices, triangles } = &self.geometry else {
            let middle = 0.5 * (p[0] + p[1]);
            let least = segment_solid([middle, middle], &self.geometry) - 0.5 * p[0].distance(p[1]);
            return if least > near { least } else { segment_solid(p, &self.geometry) };
        };
        let mut least = f64::INFINITY;
        self.triangles.tree.any(&Aabb::around(&p).grown(near), &mut |k| {
            least = segment_triangle(p, triangles[self.triangles.order[k] as usize].map(|v| vertices[v as usize]))
                .min(least);
            false
        });
        least
    }

    /// Whether an element whose ends move along straight lines in the shape's frame crosses it: comes inside a solid,
    /// or onto the surface of a mesh.
    fn crosses(&self, old: [DVec3; 2], p: [DVec3; 2], radius: f64) -> bool {
        let rate = p[0].distance(old[0]).max(p[1].distance(old[1]));
        let limit = TOUCHING * radius;
        let within = |limit: f64, distance: &dyn Fn([DVec3; 2]) -> f64| {
            distance(p) - rate <= limit
                && time_within(&|t| distance(lerp(old, p, t)), rate, limit, TOUCHING * radius).is_some()
        };
        let Geometry::Mesh { vertices, triangles } = &self.geometry else {
            let middle = 0.5 * (p[0] + p[1]);
            // The middle of an element that goes inside is this near the surface now.
            let outside = segment_solid([middle, middle], &self.geometry) - 0.5 * p[0].distance(p[1]) > rate;
            return !outside && within(0.0, &|p| segment_solid(p, &self.geometry));
        };
        let reach = Aabb::around(&p).union(&Aabb::around(&old)).grown(limit);
        self.triangles.tree.any(&reach, &mut |k| {
            let corners = triangles[self.triangles.order[k] as usize].map(|v| vertices[v as usize]);
            within(limit, &|p| segment_triangle(p, corners))
        })
    }

    /// Whether this is the geometry known. A mesh is known by its size and its ends, as comparing all of it at each
    /// state would cost more than the audit.
    fn is(&self, geometry: &Geometry) -> bool {
        match (&self.geometry, geometry) {
            (Geometry::Mesh { vertices: v, triangles: t }, Geometry::Mesh { vertices: w, triangles: u }) => {
                v.len() == w.len() && t.len() == u.len() && v.first() == w.first() && v.last() == w.last()
            }
            (a, b) => a == b,
        }
    }
}

impl Aabb {
    /// World box around everything that a box of the body sweeps from one pose to the other, turning included.
    fn swept(&self, from: &Pose, to: &Pose) -> Aabb {
        let (middle, half) = (0.5 * (self.min + self.max), 0.5 * (self.max - self.min));
        let at = |pose: &Pose| {
            let m = glam::DMat3::from_quat(pose.orientation);
            let h = m.x_axis.abs() * half.x + m.y_axis.abs() * half.y + m.z_axis.abs() * half.z;
            let c = pose.transform_point(middle);
            Aabb { min: c - h, max: c + h }
        };
        let angle = log((to.orientation * from.orientation.conjugate()).normalize()).length();
        at(from).union(&at(to)).grown(angle * (middle.length() + half.length()))
    }
}

/// The triangles of a mesh in an order that follows space (along a Morton curve), so that a tree over the order is a
/// good one.
#[derive(Debug, Default)]
struct Triangles {
    order: Vec<u32>,
    tree: BoxTree,
}

impl Triangles {
    fn new(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        let bounds = Aabb::around(vertices);
        let size = (bounds.max - bounds.min).max(DVec3::splat(f64::MIN_POSITIVE));
        let corners = |t: u32| triangles[t as usize].map(|v| vertices[v as usize]);
        let place = |t: u32| {
            let [a, b, c] = corners(t);
            // Ten bits an axis.
            let cell = (((a + b + c) / 3.0 - bounds.min) / size * 1023.0).clamp(DVec3::ZERO, DVec3::splat(1023.0));
            let cell = [cell.x as u32, cell.y as u32, cell.z as u32];
            (0..10).fold(0_u32, |code, bit| {
                (0..3).fold(code, |code, axis| code | ((cell[axis] >> bit) & 1) << (3 * bit + axis as u32))
            })
        };
        let mut order: Vec<u32> = (0..triangles.len() as u32).collect();
        order.sort_by_cached_key(|t| (place(*t), *t));
        let mut tree = BoxTree::default();
        tree.reset(order.len());
        for (k, t) in order.iter().enumerate() {
            tree.set(k, Aabb::around(&corners(*t)));
        }
        tree.refit();
        Triangles { order, tree }
    }
}

#[cfg(test)]
mod tests;
