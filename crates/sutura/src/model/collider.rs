//! Distance from points and elements to shapes. The shapes themselves and their closest points are parry3d's.

use crate::error::Error;
use crate::math::Pose;
use crate::model::shape::Geometry;
use crate::segment;
use core::f64::consts::FRAC_1_SQRT_2;
use glam::{DMat3, DQuat, DVec3};
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::math::Pose3 as ParryPose;
use parry3d_f64::query::{
    ContactManifold, ContactManifoldsWorkspace, DefaultQueryDispatcher, PersistentQueryDispatcher, PointQuery,
    PointQueryWithLocation, Ray, RayCast,
};
use parry3d_f64::shape::{
    Ball, Capsule, Cuboid, Cylinder, HalfSpace, Shape, TriMesh, TriMeshFlags, TrianglePointLocation,
};

/// A geometry ready for queries.
pub(crate) enum Collider {
    /// The half space below z = 0.
    Plane,
    /// A convex solid; parry's axis of revolution is y, ours is z.
    Solid(Box<dyn Shape>),
    /// A triangle mesh.
    Surface(Box<Surface>),
}

/// A triangle mesh ready for queries.
pub(crate) struct Surface {
    mesh: TriMesh,
    /// Every edge belongs to two triangles that run along it in opposite directions: normals point out of the solid. Of
    /// an open mesh both sides are outside.
    closed: bool,
    edges: Vec<Edge>,
    /// Edges of each triangle, in the order of [`TriMesh::triangle`]: from its first corner, from its second, from its
    /// third.
    edges_of: Vec<[u32; 3]>,
}

/// An edge of a mesh, with the triangles on both sides of it (twice the same one at a border).
#[derive(Debug, Clone, Copy)]
struct Edge {
    triangles: [u32; 2],
    ends: [DVec3; 2],
    /// In the plane of each triangle, across the edge and into the triangle.
    inward: [DVec3; 2],
}

/// Signed distance (negative inside of a solid) and the unit direction in which it grows.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Distance {
    pub value: f64,
    pub normal: DVec3,
}

/// Walls of a mesh that a particle may touch at once.
const WALLS: usize = 8;

/// Sine of the angle up to which the direction from an edge may lean over a triangle beside it and still be that of a
/// nearest place.
const LEAN: f64 = 1e-6;

/// Cosine up to which two nearest places of a mesh count as on different walls: two facets with a hollow edge between
/// them are.
pub(crate) const APART: f64 = 0.9999;

/// Places that are looked at for the least distance of a segment from a convex solid.
const SEARCH: u32 = 24;

/// How near to the least distance such a place comes, over the length of the segment.
const PRECISE: f64 = 1e-6;

/// Our body axes to parry's and back.
fn to_parry(p: DVec3) -> DVec3 {
    DVec3::new(p.x, p.z, -p.y)
}
fn from_parry(p: DVec3) -> DVec3 {
    DVec3::new(p.x, -p.z, p.y)
}

/// The turn that [`from_parry`] is.
const FROM_PARRY: DQuat = DQuat::from_xyzw(FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2);

/// A pose in parry's axes.
fn pose_in_parry(pose: &Pose) -> ParryPose {
    ParryPose::from_parts(pose.position, pose.orientation * FROM_PARRY)
}

/// A place where two solids touch or nearly do.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Touch {
    /// In the frame of each.
    pub at: [DVec3; 2],
    /// Unit normal in the world, from the second toward the first.
    pub normal: DVec3,
}

/// Memory of [`touches`].
#[derive(Default)]
pub(crate) struct Manifolds {
    one: ContactManifold<(), ()>,
    many: Vec<ContactManifold<(), ()>>,
    workspace: Option<ContactManifoldsWorkspace>,
}

/// Finds the places where two solids are nearer than `reach`. (Of meshes, and of boxes and cylinders on planes, parry
/// allocates.)
pub(crate) fn touches(
    [a, b]: [&Collider; 2],
    [pose_a, pose_b]: [&Pose; 2],
    reach: f64,
    memory: &mut Manifolds,
    mut found: impl FnMut(Touch),
) {
    let relative = pose_in_parry(pose_a).inv_mul(&pose_in_parry(pose_b));
    let Manifolds { one, many, workspace } = memory;
    let ground = HalfSpace::new(DVec3::Y);
    let dispatcher = DefaultQueryDispatcher;
    let mut take = |manifold: &ContactManifold<(), ()>| {
        let normal = -(pose_a.orientation * from_parry(manifold.local_n1));
        for p in manifold.points.iter().filter(|p| p.dist < reach) {
            found(Touch { at: [from_parry(p.local_p1), from_parry(p.local_p2)], normal });
        }
    };
    let shape = |c: &'_ Collider| matches!(c, Collider::Surface(_));
    let dynamic = |c| -> &dyn Shape {
        match c {
            &Collider::Plane => &ground,
            Collider::Solid(solid) => &**solid,
            Collider::Surface(surface) => &surface.mesh,
        }
    };
    // A manifold that is found again depends on what it was before, and so would the bits.
    if shape(a) || shape(b) {
        many.clear();
        *workspace = None;
        let done = dispatcher.contact_manifolds(&relative, dynamic(a), dynamic(b), reach, many, workspace);
        if done.is_ok() {
            many.iter().for_each(&mut take);
        }
    } else {
        one.clear();
        (one.local_n1, one.local_n2) = (DVec3::ZERO, DVec3::ZERO);
        let done = dispatcher.contact_manifold_convex_convex(&relative, dynamic(a), dynamic(b), None, None, reach, one);
        if done.is_ok() {
            take(one);
        }
    }
}

impl Collider {
    /// Mass, center of mass and inertia about it of a convex solid, in the frame of the collider.
    pub fn mass_properties(&self, density: f64) -> (f64, DVec3, DMat3) {
        let Collider::Solid(solid) = self else { return (0.0, DVec3::ZERO, DMat3::ZERO) };
        let p = solid.mass_properties(density);
        let turn = DMat3::from_quat(FROM_PARRY);
        (p.mass(), from_parry(p.local_com), turn * p.reconstruct_inertia_matrix() * turn.transpose())
    }

    pub fn new(geometry: &Geometry) -> Result<Self, Error> {
        Ok(match geometry {
            Geometry::Plane => Collider::Plane,
            Geometry::Sphere { radius } => Collider::Solid(Box::new(Ball::new(*radius))),
            Geometry::Capsule { radius, half_length } => {
                Collider::Solid(Box::new(Capsule::new_y(*half_length, *radius)))
            }
            Geometry::Cylinder { radius, half_length } => {
                Collider::Solid(Box::new(Cylinder::new(*half_length, *radius)))
            }
            Geometry::Box { half_sides } => Collider::Solid(Box::new(Cuboid::new(to_parry(*half_sides).abs()))),
            Geometry::Mesh { vertices, triangles } => Collider::Surface(Box::new(Surface::new(vertices, triangles)?)),
        })
    }

    /// Distance of a world point. To an open mesh it is positive on either side.
    #[inline]
    pub fn distance(&self, pose: &Pose, point: DVec3) -> Distance {
        let d = self.distance_local(pose.inverse_transform_point(point));
        Distance { value: d.value, normal: pose.orientation * d.normal }
    }

    /// The same in the body frame.
    pub fn distance_local(&self, local: DVec3) -> Distance {
        let (on, sides) = match self {
            Collider::Plane => return Distance { value: local.z, normal: DVec3::Z },
            Collider::Solid(shape) => (shape.project_local_point(to_parry(local), false), true),
            Collider::Surface(surface) => (surface.mesh.project_local_point(to_parry(local), false), surface.closed),
        };
        let off = local - from_parry(on.point);
        let length = off.length();
        // The very middle of a ball has no nearest point: one beside it has.
        if length.is_nan() && local == DVec3::ZERO {
            return self.distance_local(DVec3::Z * (BESIDE * self.half_side()));
        }
        let sign = if sides && on.is_inside { -1.0 } else { 1.0 };
        // On the surface itself the direction is lost: away from the body's origin will do.
        let normal = if length > 0.0 { off * (sign / length) } else { local.normalize_or(DVec3::Z) };
        Distance { value: sign * length, normal }
    }

    /// Distance of a point that came from a place with the distance `before`, from the same part of the surface.
    /// (`from` and `to` are the pose of the shape and the point, then and now; `ahead` is the direction in which the
    /// surface faced at the last look.) What is nearest now may be another wall, or the far side of a thin one: it
    /// faces back, or is nearer than a convex surface would be that is tangent to the one there was. Then the surface
    /// is taken to go on as a plane.
    pub fn follow(&self, from: (&Pose, DVec3, Distance), to: (&Pose, DVec3), ahead: DVec3) -> Distance {
        let now = self.distance(to.0, to.1);
        let faces = now.normal.dot(ahead) > 0.0;
        let Collider::Surface(_) = self else {
            return if faces { now } else { plane(from, to) };
        };
        let plane = plane(from, to);
        if faces && now.value >= plane.value - CONVEX * plane.value.abs() { now } else { plane }
    }

    /// Calls `found` with the distances, up to `reach`, of a world point from all walls of a mesh that face it from
    /// different sides, but for the nearest one.
    pub fn further_walls(&self, pose: &Pose, point: DVec3, reach: f64, mut found: impl FnMut(Distance)) {
        let Collider::Surface(surface) = self else { return };
        let local = pose.inverse_transform_point(point);
        let first = self.distance_local(local);
        if first.value < 0.0 {
            return;
        }
        let mut walls = [first; WALLS];
        let mut count = 1;
        // From the nearest to the farthest, as few as there are: each time the nearest of those that are apart from all
        // others.
        while count < walls.len() {
            let Some(next) = surface.nearest_wall(local, reach, &walls[..count]) else { break };
            walls[count] = next;
            count += 1;
            found(Distance { value: next.value, normal: pose.orientation * next.normal });
        }
    }

    /// Places in (0, 1) on the segment (body frame) where its distance is least, as far as they are nearer than
    /// `below`, with their distances. Of a convex solid there is one at most. Of a mesh they lie on edges, and where
    /// the segment passes through it. `known` are the distances of its ends.
    pub fn least_between(
        &self,
        ends: [DVec3; 2],
        known: [Distance; 2],
        below: f64,
        mut found: impl FnMut(f64, Distance),
    ) {
        match self {
            // Greatest and least are at the ends.
            Collider::Plane => {}
            Collider::Solid(_) => {
                if let Some((s, d)) = self.least_of_convex(ends, known, below) {
                    found(s, d);
                }
            }
            Collider::Surface(surface) => surface.least_on_edges(ends, below, &mut found),
        }
    }

    /// Least distance of the segment (body frame) from the shape, zero or less where they meet, and a place where it
    /// is; nothing beyond `below`.
    pub fn segment_distance(&self, [a, b]: [DVec3; 2], below: f64) -> Option<(f64, f64)> {
        let known = [self.distance_local(a), self.distance_local(b)];
        let [first, last] = known.map(|d| d.value);
        let mut least = if first <= last { (0.0, first) } else { (1.0, last) };
        if least.1 - 0.5 * (b - a).length() < below {
            self.least_between([a, b], known, below, |s, d| {
                if d.value < least.1 {
                    least = (s, d.value);
                }
            });
        }
        (least.1 < below).then_some(least)
    }

    /// Place in (0, 1) on the segment where the distance, convex along it, is least, where that is less than `below`.
    /// Tangents at both sides bound it from below. The next place to look at is where the slope would vanish if it
    /// changed evenly, which is so on a smooth surface, and where the tangents meet, which is so at an edge, in turn.
    fn least_of_convex(&self, [a, b]: [DVec3; 2], known: [Distance; 2], below: f64) -> Option<(f64, Distance)> {
        let along = b - a;
        let side = |s: f64, d: Distance| (s, d, d.normal.dot(along));
        let (mut lo, mut hi) = (side(0.0, known[0]), side(1.0, known[1]));
        if !(lo.2 < 0.0 && hi.2 > 0.0) {
            return None;
        }
        for k in 0..SEARCH {
            let width = hi.0 - lo.0;
            let meet = lo.0 + ((hi.1.value - lo.1.value) - hi.2 * width) / (lo.2 - hi.2);
            let bound = lo.1.value + lo.2 * (meet - lo.0);
            if bound >= below {
                return None;
            }
            if lo.1.value.min(hi.1.value) - bound <= PRECISE * along.length() {
                break;
            }
            let even = lo.0 + width * lo.2 / (lo.2 - hi.2);
            let s = if k % 2 == 0 { even } else { meet }.clamp(lo.0 + 0.02 * width, hi.0 - 0.02 * width);
            let now = side(s, self.distance_local(a.lerp(b, s)));
            if now.2 < 0.0 {
                lo = now;
            } else {
                hi = now;
            }
        }
        let (s, d, _) = if lo.1.value < hi.1.value { lo } else { hi };
        (s > 0.0 && s < 1.0 && d.value < below).then_some((s, d))
    }

    /// Half of the smallest side of its box.
    pub fn half_side(&self) -> f64 {
        if matches!(self, Collider::Plane) {
            return f64::INFINITY;
        }
        let (lo, hi) = self.bounds(&Pose::IDENTITY);
        0.5 * (hi - lo).min_element()
    }

    /// Distance from the origin beyond which nothing of a solid is.
    pub fn reach(&self) -> f64 {
        if matches!(self, Collider::Plane) {
            return 0.0;
        }
        let (lo, hi) = self.bounds(&Pose::IDENTITY);
        lo.abs().max(hi.abs()).length()
    }

    /// World box that holds the shape.
    pub fn bounds(&self, pose: &Pose) -> (DVec3, DVec3) {
        let shape: &dyn Shape = match self {
            // Finite: an infinite box would meet the empty one of an unused leaf of the tree.
            Collider::Plane => return (DVec3::splat(f64::MIN), DVec3::splat(f64::MAX)),
            Collider::Solid(shape) => shape.as_ref(),
            Collider::Surface(surface) => &surface.mesh,
        };
        let local = shape.compute_local_aabb();
        let (a, b) = (from_parry(local.mins), from_parry(local.maxs));
        let (middle, half) = (pose.transform_point((a + b) * 0.5), (b - a).abs() * 0.5);
        let turn = DMat3::from_quat(pose.orientation);
        let reach = turn.x_axis.abs() * half.x + turn.y_axis.abs() * half.y + turn.z_axis.abs() * half.z;
        (middle - reach, middle + reach)
    }

    /// World box that holds the shape all the way from one pose to another.
    pub fn swept_bounds(&self, from: &Pose, to: &Pose) -> (DVec3, DVec3) {
        let (lo, hi) = self.bounds(from);
        if from == to || matches!(self, Collider::Plane) {
            return (lo, hi);
        }
        let (lo2, hi2) = self.bounds(to);
        // Between the two a corner at the distance R from the origin swings by R (1 - cos(angle / 2)) out of the chord.
        let turn = crate::math::log(to.orientation * from.orientation.conjugate()).length();
        let far = (hi - lo).length().max((from.position - lo).abs().max((hi - from.position).abs()).length());
        let bulge = DVec3::splat(far * turn * turn / 8.0);
        (lo.min(lo2) - bulge, hi.max(hi2) + bulge)
    }
}

/// How far beside the middle of a ball that is, over its radius.
const BESIDE: f64 = 1e-9;

/// Part of a distance by which rounding may bring a convex surface nearer than its tangent.
const CONVEX: f64 = 1e-9;

/// Distance from the plane that a surface had, as seen from the body.
fn plane((from_pose, from, before): (&Pose, DVec3, Distance), (pose, point): (&Pose, DVec3)) -> Distance {
    let normal = from_pose.orientation.conjugate() * before.normal;
    let way = pose.inverse_transform_point(point) - from_pose.inverse_transform_point(from);
    Distance { value: before.value + normal.dot(way), normal: pose.orientation * normal }
}

impl Surface {
    fn new(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Result<Self, Error> {
        let bad = |e: &dyn core::fmt::Debug| Error::invalid("shape", "mesh", e, "a mesh that can be searched");
        let mut mesh =
            TriMesh::new(vertices.iter().map(|v| to_parry(*v)).collect(), triangles.to_vec()).map_err(|e| bad(&e))?;
        // Each side of a triangle, by its ends in order.
        let mut sides: Vec<([u32; 2], u32, usize)> = Vec::with_capacity(3 * triangles.len());
        for (k, t) in triangles.iter().enumerate() {
            for i in 0..3 {
                let (a, b) = (t[i], t[(i + 1) % 3]);
                sides.push(([a.min(b), a.max(b)], k as u32, i));
            }
        }
        sides.sort_unstable();
        let mut edges = Vec::new();
        let mut edges_of = vec![[0; 3]; triangles.len()];
        let mut closed = true;
        for same in sides.chunk_by(|a, b| a.0 == b.0) {
            let (key, first, second) = (same[0].0, same[0], same[same.len().min(2) - 1]);
            let ends = key.map(|v| vertices[v as usize]);
            let inward = [first, second].map(|(_, k, i)| {
                let corner = vertices[triangles[k as usize][(i + 2) % 3] as usize] - ends[0];
                let along = (ends[1] - ends[0]).normalize_or_zero();
                (corner - along * along.dot(corner)).normalize_or_zero()
            });
            let forward = |(_, k, i): ([u32; 2], u32, usize)| triangles[k as usize][i] == key[0];
            closed &= same.len() == 2 && forward(first) != forward(second);
            for (_, k, i) in same {
                edges_of[*k as usize][*i] = edges.len() as u32;
            }
            edges.push(Edge { triangles: [first.1, second.1], ends, inward });
        }
        if closed {
            mesh.set_flags(TriMeshFlags::ORIENTED).map_err(|e| bad(&e))?;
        }
        Ok(Surface { mesh, closed, edges, edges_of })
    }

    /// Where a segment (body frame) crosses the surface first, as a part of its length.
    pub fn crossing(&self, ends: [DVec3; 2]) -> Option<f64> {
        let [from, to] = ends.map(to_parry);
        self.mesh.cast_local_ray(&Ray::new(from, to - from), 1.0, false)
    }

    /// Triangles near a segment.
    fn near(&self, a: DVec3, b: DVec3, reach: f64) -> impl Iterator<Item = u32> + '_ {
        let (a, b) = (to_parry(a), to_parry(b));
        let grow = DVec3::splat(reach);
        let around = Aabb::new(a.min(b) - grow, a.max(b) + grow);
        let query = parry3d_f64::partitioning::BvhNode::leaf(around, 0);
        self.mesh.bvh().leaves(move |node: &parry3d_f64::partitioning::BvhNode| node.intersects(&query))
    }

    /// The nearest place that is apart from all `known` ones, faces the point and is a nearest place among its
    /// neighbors.
    fn nearest_wall(&self, p: DVec3, reach: f64, known: &[Distance]) -> Option<Distance> {
        let mut best: Option<Distance> = None;
        for k in self.near(p, p, reach) {
            let triangle = self.mesh.triangle(k);
            let (on, at) = triangle.project_local_point_and_get_location(to_parry(p), false);
            let off = p - from_parry(on.point);
            let value = off.length();
            if value >= best.map_or(reach, |b| b.value) || value == 0.0 {
                continue;
            }
            let normal = off / value;
            if known.iter().any(|w| w.normal.dot(normal) > APART) {
                continue;
            }
            // Where the foot is on an edge, the triangle on the other side must not come nearer; where it is on a
            // corner, it is another's if any.
            let foremost = match at {
                TrianglePointLocation::OnEdge(i, _) => {
                    // Parry numbers AB, BC, AC.
                    let edge = &self.edges[self.edges_of[k as usize][i as usize] as usize];
                    edge.inward.iter().all(|v| v.dot(normal) <= LEAN)
                }
                TrianglePointLocation::OnVertex(i) => {
                    let v = self.mesh.indices()[k as usize][i as usize];
                    let corner = from_parry(self.mesh.vertices()[v as usize]);
                    // No triangle at this corner may lean toward the point.
                    self.near(corner, corner, 0.0).all(|t| {
                        let [a, b, c] = self.mesh.indices()[t as usize];
                        ![a, b, c].contains(&v)
                            || [a, b, c].iter().all(|w| {
                                (from_parry(self.mesh.vertices()[*w as usize]) - corner).dot(normal)
                                    <= LEAN * (value + 1.0)
                            })
                    })
                }
                _ => true,
            };
            let faces = !self.closed || self.mesh.triangle_normal(k).is_none_or(|n| from_parry(n).dot(normal) > -LEAN);
            if foremost && faces {
                best = Some(Distance { value, normal });
            }
        }
        best
    }

    fn least_on_edges(&self, [a, b]: [DVec3; 2], below: f64, found: &mut impl FnMut(f64, Distance)) {
        let mut places = [(0.0, Distance { value: f64::INFINITY, normal: DVec3::Z }); crate::params::PLACES];
        let mut put = |s: f64, d: Distance| {
            // The nearest few, no two of them at one place.
            if let Some(same) = places.iter_mut().find(|(t, e)| e.value < f64::INFINITY && (t - s).abs() < 1e-3) {
                if d.value < same.1.value {
                    *same = (s, d);
                }
            } else if let Some(last) =
                places.iter_mut().max_by(|x, y| x.1.value.total_cmp(&y.1.value)).filter(|last| d.value < last.1.value)
            {
                *last = (s, d);
            }
        };
        for k in self.near(a, b, below.max(0.0)) {
            let t = self.mesh.triangle(k);
            let (p, q, r) = (from_parry(t.a), from_parry(t.b), from_parry(t.c));
            if let Some(s) = crosses([a, b], [p, q, r]) {
                put(s, Distance { value: 0.0, normal: (q - p).cross(r - p).normalize_or(DVec3::Z) });
            }
            for e in self.edges_of[k as usize] {
                let edge = &self.edges[e as usize];
                if edge.triangles[0] != k {
                    continue;
                }
                let c = segment::closest(a, b, edge.ends[0], edge.ends[1]);
                let value = c.apart.length();
                if c.s <= 0.0 || c.s >= 1.0 || value >= below || value == 0.0 {
                    continue;
                }
                let normal = c.apart / value;
                if edge.inward.iter().all(|v| v.dot(normal) <= LEAN) {
                    // From within a solid the nearest place of an edge is no way out.
                    put(c.s, Distance { value, normal });
                }
            }
        }
        for (s, d) in places.iter().filter(|(_, d)| d.value < below) {
            found(*s, *d);
        }
    }
}

/// Where a segment passes through a triangle.
fn crosses([a, b]: [DVec3; 2], [p, q, r]: [DVec3; 3]) -> Option<f64> {
    let n = (q - p).cross(r - p);
    let (da, db) = (n.dot(a - p), n.dot(b - p));
    if da * db >= 0.0 {
        return None;
    }
    let s = da / (da - db);
    let x = a.lerp(b, s);
    let inside = |u: DVec3, v: DVec3| n.dot((v - u).cross(x - u)) >= 0.0;
    (inside(p, q) && inside(q, r) && inside(r, p)).then_some(s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::exp;

    #[test]
    fn cylinder_axis_is_z_and_small_sizes_are_exact() {
        let c = Collider::new(&Geometry::Cylinder { radius: 5e-3, half_length: 0.02 }).unwrap();
        let pose = Pose::new(DVec3::new(0.1, 0.0, 0.0), exp(DVec3::new(0.0, 0.5, 0.0)));
        let p = pose.transform_point(DVec3::new(0.0, 6e-3, 0.01));
        let d = c.distance(&pose, p);
        assert!((d.value - 1e-3).abs() < 1e-15 && (d.normal - DVec3::Y).length() < 1e-12, "{d:?}");
        let d = c.distance(&pose, pose.transform_point(DVec3::new(0.0, 4e-3, 0.0)));
        assert!((d.value + 1e-3).abs() < 1e-15 && (d.normal - DVec3::Y).length() < 1e-12, "{d:?}");
    }

    fn least(c: &Collider, ends: [DVec3; 2], below: f64) -> Vec<(f64, f64)> {
        let mut all = Vec::new();
        c.least_between(ends, ends.map(|p| c.distance_local(p)), below, |s, d| all.push((s, d.value)));
        all.sort_by(|x, y| x.0.total_cmp(&y.0));
        all
    }

    #[test]
    fn nearest_place_on_a_chord() {
        let c = Collider::new(&Geometry::Cylinder { radius: 5e-3, half_length: 0.02 }).unwrap();
        let ends = [DVec3::new(-3e-4, 5.1e-3, 0.0), DVec3::new(1e-4, 5.1e-3, 0.0)];
        let found = least(&c, ends, 1.0001e-4);
        // The distance differs from its least by the square of the place: a billionth of the segment leaves 1e-4 of it.
        assert!(found.len() == 1 && (found[0].0 - 0.75).abs() < 2e-3, "{found:?}");
        // The chord comes as near as 1e-4.
        assert!(least(&c, ends, 0.9999e-4).is_empty());
    }

    /// Corners and triangles of a box about the origin, outward.
    fn box_mesh(half: DVec3) -> Geometry {
        let vertices =
            (0..8).map(|k| DVec3::select(glam::BVec3::new(k & 1 > 0, k & 2 > 0, k & 4 > 0), half, -half)).collect();
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
        Geometry::Mesh { vertices, triangles }
    }

    #[test]
    fn a_closed_mesh_is_as_the_solid_that_it_bounds() {
        let half = DVec3::new(1e-3, 2e-3, 5e-4);
        let (mesh, solid) =
            (Collider::new(&box_mesh(half)).unwrap(), Collider::new(&Geometry::Box { half_sides: half }).unwrap());
        assert!(matches!(&mesh, Collider::Surface(s) if s.closed));
        for i in 0..500_u32 {
            let f = |k: u32| (f64::from(i * 7 + k * 131) * 0.618_033_988_7).fract() - 0.5;
            let p = DVec3::new(f(1), f(2), f(3)) * 5e-3;
            let (d, e) = (mesh.distance_local(p), solid.distance_local(p));
            assert!((d.value - e.value).abs() < 1e-12, "{p:?}: {d:?} {e:?}");
            let q = DVec3::new(f(4), f(5), f(6)) * 5e-3;
            let of = |c: &Collider| c.segment_distance([p, q], 1e-2).map_or(1e-2, |(_, d)| d.max(0.0));
            assert!((of(&mesh) - of(&solid)).abs() < 1e-8, "{p:?} {q:?}: {} {}", of(&mesh), of(&solid));
        }
    }

    #[test]
    fn a_wall_under_an_element_has_two_edges() {
        let mesh = Collider::new(&box_mesh(DVec3::new(2e-4, 1e-2, 1e-2))).unwrap();
        let found = least(&mesh, [DVec3::new(-1e-3, 0.0, 1.01e-2), DVec3::new(1e-3, 0.0, 1.01e-2)], 2e-4);
        assert!(
            found.iter().any(|(s, _)| (s - 0.4).abs() < 1e-9) && found.iter().any(|(s, _)| (s - 0.6).abs() < 1e-9),
            "{found:?}"
        );
    }

    #[test]
    fn both_walls_of_a_slot_are_seen_and_neither_is_taken_for_the_other() {
        let square = |z: f64| {
            [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| DVec3::new(x * 1e-2, y * 1e-2, z))
        };
        let vertices = [square(-1e-3), square(1e-3)].concat();
        let c =
            Collider::new(&Geometry::Mesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]] })
                .unwrap();
        let pose = Pose::IDENTITY;
        let (low, high) = (DVec3::new(1e-4, 0.0, -1e-4), DVec3::new(1e-4, 0.0, 1e-4));
        let mut others = Vec::new();
        c.further_walls(&pose, low, 2e-3, |d| others.push(d));
        assert!(
            others.len() == 1 && (others[0].value - 1.1e-3).abs() < 1e-15 && others[0].normal.z < -0.999,
            "{others:?}"
        );
        // Across the middle it is still above the lower wall.
        let before = c.distance(&pose, low);
        let d = c.follow((&pose, low, before), (&pose, high), before.normal);
        assert!((d.value - 1.1e-3).abs() < 1e-15 && d.normal.z > 0.999, "{d:?}");
        // And through the lower one it is behind it.
        let d = c.follow((&pose, low, before), (&pose, DVec3::new(1e-4, 0.0, -1.2e-3)), before.normal);
        assert!((d.value + 2e-4).abs() < 1e-15 && d.normal.z > 0.999, "{d:?}");
    }
}
