//! Distance from points and elements to shapes. The shapes themselves and their closest points are parry3d's.

use crate::error::Error;
use crate::math::Pose;
use crate::model::shape::Geometry;
use glam::DVec3;
use parry3d_f64::shape::{Ball, Capsule, Cuboid, Cylinder, Shape, TriMesh};

/// A geometry ready for queries.
pub(crate) enum Collider {
    /// The half space below z = 0.
    Plane,
    /// A solid; parry's axis of revolution is y, ours is z.
    Solid(Box<dyn Shape>),
    /// A surface without an inside.
    Surface(Box<TriMesh>),
}

/// Signed distance (negative inside a solid) and the unit direction in which it grows.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Distance {
    pub value: f64,
    pub normal: DVec3,
}

/// Our body axes to parry's and back.
pub(super) fn to_parry(p: DVec3) -> DVec3 {
    DVec3::new(p.x, p.z, -p.y)
}
fn from_parry(p: DVec3) -> DVec3 {
    DVec3::new(p.x, -p.z, p.y)
}

impl Collider {
    pub fn new(geometry: &Geometry) -> Result<Self, Error> {
        Ok(match geometry {
            Geometry::Plane => Collider::Plane,
            Geometry::Sphere { radius } => Collider::Solid(Box::new(Ball::new(*radius))),
            Geometry::Capsule { radius, half_length } => Collider::Solid(Box::new(Capsule::new_y(*half_length, *radius))),
            Geometry::Cylinder { radius, half_length } => Collider::Solid(Box::new(Cylinder::new(*half_length, *radius))),
            Geometry::Box { half_sides } => Collider::Solid(Box::new(Cuboid::new(to_parry(*half_sides).abs()))),
            Geometry::Mesh { vertices, triangles } => {
                let mesh = TriMesh::new(vertices.iter().map(|v| to_parry(*v)).collect(), triangles.clone())
                    .map_err(|e| Error::invalid("shape", "mesh", e, "a mesh that can be searched"))?;
                Collider::Surface(Box::new(mesh))
            }
        })
    }

    /// Distance of a world point. `side` orients a surface (and decides when the point lies on it).
    #[inline]
    pub fn distance(&self, pose: &Pose, point: DVec3, side: Option<DVec3>) -> Distance {
        let local = pose.inverse_transform_point(point);
        let shape: &dyn Shape = match self {
            Collider::Plane => return Distance { value: local.z, normal: pose.orientation * DVec3::Z },
            Collider::Solid(shape) => shape.as_ref(),
            Collider::Surface(mesh) => mesh.as_ref(),
        };
        let on = shape.project_local_point(to_parry(local), false);
        let off = pose.orientation * (local - from_parry(on.point));
        let length = off.length();
        let inside = matches!(self, Collider::Solid(_)) && on.is_inside;
        let sign = match (self, side) {
            (Collider::Surface(_), Some(n)) if off.dot(n) < 0.0 => -1.0,
            _ if inside => -1.0,
            _ => 1.0,
        };
        // On the surface itself the direction is lost; then the remembered side, or away from the body's origin.
        let normal = if length > 0.0 { off * (sign / length) } else { side.unwrap_or_else(|| (pose.orientation * local).normalize_or(DVec3::Z)) };
        Distance { value: sign * length, normal }
    }

    /// Whether distances need to know the side that they are taken from.
    pub fn has_sides(&self) -> bool {
        matches!(self, Collider::Surface(_))
    }

    /// The same where the distances at the ends and in the middle are known: none where these say that it comes nowhere as near as `below`.
    pub fn nearest_between(&self, known: [Distance; 3], pose: &Pose, [a, b]: [DVec3; 2], along: DVec3, below: f64) -> Option<f64> {
        // A distance grows no faster than the way.
        let least = known.iter().map(|d| d.value).fold(f64::INFINITY, f64::min) - 0.25 * along.length();
        if least >= below {
            return None;
        }
        let [first, middle, last] = known.map(|d| (d.value, d.normal.dot(along)));
        if !self.has_sides() && least_by_tangents(first, middle, 0.5).min(least_by_tangents(middle, last, 0.5)) >= below {
            return None;
        }
        self.nearest_on_segment(pose, a, b, below)
    }

    /// Place in [0, 1] on the segment where its distance is least, where that is less than `below`. Distance to a convex set is convex along a
    /// segment, so tangents bound it and a golden-section search finds it; for a surface it is a local minimum near the better end.
    pub fn nearest_on_segment(&self, pose: &Pose, a: DVec3, b: DVec3, below: f64) -> Option<f64> {
        let along = b - a;
        let with_slope = |s: f64| {
            let d = self.distance(pose, a.lerp(b, s), None);
            (d.value, d.normal.dot(along))
        };
        if !self.has_sides() {
            let (first, middle, last) = (with_slope(0.0), with_slope(0.5), with_slope(1.0));
            if least_by_tangents(first, middle, 0.5).min(least_by_tangents(middle, last, 0.5)) >= below {
                return None;
            }
        }
        let at = |s: f64| self.distance(pose, a.lerp(b, s), None).value;
        let golden = 0.381_966_011_250_105;
        let (mut lo, mut hi) = (0.0, 1.0);
        let (mut s1, mut s2) = (golden, 1.0 - golden);
        let (mut d1, mut d2) = (at(s1), at(s2));
        for _ in 0..14 {
            if d1 <= d2 {
                hi = s2;
                (s2, d2) = (s1, d1);
                s1 = lo + golden * (hi - lo);
                d1 = at(s1);
            } else {
                lo = s1;
                (s1, d1) = (s2, d2);
                s2 = hi - golden * (hi - lo);
                d2 = at(s2);
            }
        }
        let s = 0.5 * (lo + hi);
        (at(s) < below).then_some(s)
    }

    /// World box that holds the shape.
    pub fn bounds(&self, pose: &Pose) -> (DVec3, DVec3) {
        let shape: &dyn Shape = match self {
            // Finite: an infinite box would meet the empty one of an unused leaf of the tree.
            Collider::Plane => return (DVec3::splat(f64::MIN), DVec3::splat(f64::MAX)),
            Collider::Solid(shape) => shape.as_ref(),
            Collider::Surface(mesh) => mesh.as_ref(),
        };
        let local = shape.compute_local_aabb();
        let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for k in 0..8 {
            let pick = |bit: usize, a: f64, b: f64| if k >> bit & 1 == 0 { a } else { b };
            let corner = DVec3::new(pick(0, local.mins.x, local.maxs.x), pick(1, local.mins.y, local.maxs.y), pick(2, local.mins.z, local.maxs.z));
            let p = pose.transform_point(from_parry(corner));
            lo = lo.min(p);
            hi = hi.max(p);
        }
        (lo, hi)
    }
}

/// The least that a convex function can be on an interval, by its values and slopes at the two ends.
fn least_by_tangents((f0, g0): (f64, f64), (f1, g1): (f64, f64), length: f64) -> f64 {
    if g0 >= 0.0 {
        f0
    } else if g1 <= 0.0 {
        f1
    } else {
        f0 + g0 * ((f1 - f0 - g1 * length) / (g0 - g1)).clamp(0.0, length)
    }
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
        let d = c.distance(&pose, p, None);
        assert!((d.value - 1e-3).abs() < 1e-15 && (d.normal - DVec3::Y).length() < 1e-12, "{d:?}");
        let d = c.distance(&pose, pose.transform_point(DVec3::new(0.0, 4e-3, 0.0)), None);
        assert!((d.value + 1e-3).abs() < 1e-15 && (d.normal - DVec3::Y).length() < 1e-12, "{d:?}");
    }

    #[test]
    fn nearest_place_on_a_chord() {
        let c = Collider::new(&Geometry::Cylinder { radius: 5e-3, half_length: 0.02 }).unwrap();
        let (a, b) = (DVec3::new(-3e-4, 5.1e-3, 0.0), DVec3::new(1e-4, 5.1e-3, 0.0));
        let s = c.nearest_on_segment(&Pose::IDENTITY, a, b, 1.0001e-4).unwrap();
        // Fourteen golden sections leave 1e-3 of the segment.
        assert!((s - 0.75).abs() < 2e-3, "{s}");
        // The chord comes as near as 1e-4.
        assert_eq!(c.nearest_on_segment(&Pose::IDENTITY, a, b, 0.9999e-4), None);
        assert!(least_by_tangents((1.0, -2.0), (1.0, 2.0), 0.5) == 0.5);
    }

    #[test]
    fn a_surface_keeps_its_side() {
        let mesh = Geometry::Mesh { vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y], triangles: vec![[0, 1, 2]] };
        let c = Collider::new(&mesh).unwrap();
        let p = DVec3::new(0.2, 0.2, -1e-4);
        assert!((c.distance(&Pose::IDENTITY, p, None).value - 1e-4).abs() < 1e-15);
        let d = c.distance(&Pose::IDENTITY, p, Some(DVec3::Z));
        assert!((d.value + 1e-4).abs() < 1e-15 && (d.normal - DVec3::Z).length() < 1e-12);
    }
}
