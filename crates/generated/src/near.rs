//! Distances by trying everything: from each point of a thread to a solid or to every triangle of a mesh. Slow, short,
//! and not shared with anything that it is to judge: it says whether a start is free of overlap and whether a held
//! place has room.

use sutura::glam::DVec3;
use sutura::{Geometry, Pose};

/// Distance of a point from a shape in its own frame, negative inside a solid. A mesh has no inside.
pub fn point(geometry: &Geometry, p: DVec3) -> f64 {
    let inner_and_outer = |outside: DVec3| outside.max(DVec3::ZERO).length() + outside.max_element().min(0.0);
    match geometry {
        Geometry::Plane => p.z,
        Geometry::Sphere { radius } => p.length() - radius,
        Geometry::Capsule { radius, half_length } => {
            p.distance(DVec3::Z * p.z.clamp(-half_length, *half_length)) - radius
        }
        Geometry::Cylinder { radius, half_length } => {
            let (side, cap) = (p.x.hypot(p.y) - radius, p.z.abs() - half_length);
            side.max(0.0).hypot(cap.max(0.0)) + side.max(cap).min(0.0)
        }
        Geometry::Box { half_sides } => inner_and_outer(p.abs() - *half_sides),
        Geometry::Mesh { vertices, triangles } => {
            triangles.iter().map(|t| triangle(p, t.map(|v| vertices[v as usize]))).fold(f64::INFINITY, f64::min)
        }
    }
}

/// Distance of a point from a segment.
pub fn segment(p: DVec3, [a, b]: [DVec3; 2]) -> f64 {
    let along = b - a;
    p.distance(a + along * ((p - a).dot(along) / along.length_squared()).clamp(0.0, 1.0))
}

fn triangle(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let normal = (b - a).cross(c - a).normalize();
    let left = |from: DVec3, to: DVec3| normal.cross(to - from).dot(p - from) >= 0.0;
    if left(a, b) && left(b, c) && left(c, a) {
        return (p - a).dot(normal).abs();
    }
    segment(p, [a, b]).min(segment(p, [b, c])).min(segment(p, [c, a]))
}

/// Points along a polyline no farther apart than `spacing`, its own among them.
pub fn samples(points: &[DVec3], spacing: f64) -> Vec<DVec3> {
    let mut all = vec![points[0]];
    for w in points.windows(2) {
        let n = (w[0].distance(w[1]) / spacing).ceil().max(1.0) as usize;
        all.extend((1..=n).map(|i| w[0].lerp(w[1], i as f64 / n as f64)));
    }
    all
}

/// Least distance of these points from a shape.
pub fn shape(geometry: &Geometry, pose: &Pose, points: &[DVec3]) -> f64 {
    points.iter().map(|p| point(geometry, pose.inverse_transform_point(*p))).fold(f64::INFINITY, f64::min)
}

/// Least distance of these points from a polyline.
pub fn polyline(points: &[DVec3], line: &[DVec3]) -> f64 {
    let of = |p: &DVec3| line.windows(2).map(|w| segment(*p, [w[0], w[1]])).fold(f64::INFINITY, f64::min);
    points.iter().map(of).fold(f64::INFINITY, f64::min)
}

/// Radius of the ball about the origin of its frame that holds a shape.
pub fn extent(geometry: &Geometry) -> f64 {
    match geometry {
        Geometry::Plane => f64::INFINITY,
        Geometry::Sphere { radius } => *radius,
        Geometry::Capsule { radius, half_length } => radius + half_length,
        Geometry::Cylinder { radius, half_length } => radius.hypot(*half_length),
        Geometry::Box { half_sides } => half_sides.length(),
        Geometry::Mesh { vertices, .. } => vertices.iter().map(|v| v.length()).fold(0.0, f64::max),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh;

    #[test]
    fn a_mesh_of_a_box_is_as_near_as_the_box() {
        let half = DVec3::new(1.0, 2.0, 0.5);
        let (solid, surface) = (Geometry::Box { half_sides: half }, mesh::cuboid(half));
        for p in [
            DVec3::new(3.0, 0.1, 0.2),
            DVec3::new(1.5, 2.5, 0.9),
            DVec3::new(-0.3, 0.4, 0.7),
            DVec3::new(0.2, -1.9, 0.1),
        ] {
            assert!((point(&solid, p).abs() - point(&surface, p)).abs() < 1e-12, "{p}");
        }
    }
}
