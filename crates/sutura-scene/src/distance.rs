//! Distances that expressions ask for: between threads, and of threads from shapes. Brute force over the elements; its
//! own code, like the audit, so that a probe of a gap does not lean on the contact solver.

use sutura::glam::DVec3;
use sutura::{Geometry, Pose};

/// Least distance of two segments.
fn segments(p0: DVec3, p1: DVec3, q0: DVec3, q1: DVec3) -> f64 {
    let (u, v, w) = (p1 - p0, q1 - q0, p0 - q0);
    let (a, b, c, d, e) = (u.dot(u), u.dot(v), v.dot(v), u.dot(w), v.dot(w));
    let det = a * c - b * b;
    // Parallel segments: any place on the first will do, the second and the ends settle it.
    let mut s = if det > 1e-14 * a * c { ((b * e - c * d) / det).clamp(0.0, 1.0) } else { 0.0 };
    let mut t = if c > 0.0 { (b * s + e) / c } else { 0.0 };
    if !(0.0..=1.0).contains(&t) {
        t = t.clamp(0.0, 1.0);
        s = if a > 0.0 { ((b * t - d) / a).clamp(0.0, 1.0) } else { 0.0 };
    }
    (w + u * s - v * t).length()
}

/// Least distance of the surfaces of two threads; of one from itself (`same`) without pairs nearer than pi r along it.
pub fn threads(a: (&[DVec3], f64), b: (&[DVec3], f64), same: Option<&[f64]>) -> f64 {
    let radii = a.1 + b.1;
    let mut least = f64::INFINITY;
    let mut arc = vec![0.0];
    if let Some(lengths) = same {
        for l in lengths {
            arc.push(arc[arc.len() - 1] + l);
        }
    }
    for (i, p) in a.0.windows(2).enumerate() {
        let (middle, half) = ((p[0] + p[1]) * 0.5, 0.5 * p[0].distance(p[1]));
        for (j, q) in b.0.windows(2).enumerate() {
            if same.is_some() && (j <= i || arc[j] - arc[i + 1] < std::f64::consts::PI * a.1) {
                continue;
            }
            let apart = middle.distance((q[0] + q[1]) * 0.5) - half - 0.5 * q[0].distance(q[1]);
            if apart < least {
                least = least.min(segments(p[0], p[1], q[0], q[1]));
            }
        }
    }
    least - radii
}

/// Least distance of the surface of a thread from a shape, sampled at four places an element; negative inside a solid.
pub fn thread_shape(points: &[DVec3], radius: f64, geometry: &Geometry, pose: &Pose) -> f64 {
    let from = |p: DVec3| point_shape(pose.inverse_transform_point(p), geometry);
    let samples = points.windows(2).flat_map(|p| [0.0, 0.25, 0.5, 0.75].map(|s| from(p[0].lerp(p[1], s))));
    samples.chain(points.last().map(|p| from(*p))).fold(f64::INFINITY, f64::min) - radius
}

/// Signed distance of a point in the frame of the shape.
fn point_shape(p: DVec3, geometry: &Geometry) -> f64 {
    let boxed = |d: DVec3| d.max(DVec3::ZERO).length() + d.max_element().min(0.0);
    match geometry {
        Geometry::Plane => p.z,
        Geometry::Sphere { radius } => p.length() - radius,
        Geometry::Capsule { radius, half_length } => {
            (p - DVec3::Z * p.z.clamp(-half_length, *half_length)).length() - radius
        }
        Geometry::Cylinder { radius, half_length } => {
            let (side, end) = (p.truncate().length() - radius, p.z.abs() - half_length);
            side.max(0.0).hypot(end.max(0.0)) + side.max(end).min(0.0)
        }
        Geometry::Box { half_sides } => boxed(p.abs() - *half_sides),
        Geometry::Mesh { vertices, triangles } => {
            let corner = |i: u32| vertices.get(i as usize).copied().unwrap_or(DVec3::NAN);
            triangles
                .iter()
                .map(|t| point_triangle(p, corner(t[0]), corner(t[1]), corner(t[2])))
                .fold(f64::INFINITY, f64::min)
        }
    }
}

fn point_triangle(p: DVec3, a: DVec3, b: DVec3, c: DVec3) -> f64 {
    let n = (b - a).cross(c - a);
    let inside = [(a, b), (b, c), (c, a)].iter().all(|(u, v)| n.cross(*v - *u).dot(p - *u) >= 0.0);
    if inside && n.length() > 0.0 {
        return ((p - a).dot(n) / n.length()).abs();
    }
    [(a, b), (b, c), (c, a)].iter().map(|(u, v)| segments(p, p, *u, *v)).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_of_known_figures() {
        let v = DVec3::new;
        let line = [v(-1.0, 0.0, 0.3), v(1.0, 0.0, 0.3)];
        let crossing = [v(0.0, -1.0, 0.0), v(0.0, 1.0, 0.0)];
        let beside = [v(0.5, 0.4, 0.3), v(3.0, 0.4, 0.3)];
        assert!((threads((&line, 0.05), (&crossing, 0.05), None) - 0.2).abs() < 1e-15);
        assert!((threads((&line, 0.05), (&beside, 0.05), None) - 0.3).abs() < 1e-15);
        let at = Pose::IDENTITY;
        let ball = |d: DVec3, g: &Geometry| thread_shape(&[d, d + DVec3::X * 1e-9], 0.1, g, &at);
        for (p, g, wanted) in [
            (v(0.0, 0.0, 2.0), Geometry::Plane, 1.9),
            (v(0.0, 3.0, 0.0), Geometry::Sphere { radius: 1.0 }, 1.9),
            (v(0.0, 3.0, 0.5), Geometry::Capsule { radius: 1.0, half_length: 1.0 }, 1.9),
            (v(0.0, 4.0, 5.0), Geometry::Cylinder { radius: 1.0, half_length: 1.0 }, 4.9),
            (v(0.0, 0.5, 0.0), Geometry::Cylinder { radius: 1.0, half_length: 1.0 }, -0.6),
            (v(0.0, 4.0, 5.0), Geometry::Box { half_sides: DVec3::ONE }, 4.9),
            (
                v(0.1, 0.1, 0.7),
                Geometry::Mesh { vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y], triangles: vec![[0, 1, 2]] },
                0.6,
            ),
            (
                v(-0.4, 0.1, 0.3),
                Geometry::Mesh { vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y], triangles: vec![[0, 1, 2]] },
                0.4,
            ),
        ] {
            assert!((ball(p, &g) - wanted).abs() < 1e-8, "{g:?}: {}", ball(p, &g));
        }
    }

    #[test]
    fn a_thread_does_not_touch_itself_where_it_only_bends() {
        let points: Vec<DVec3> = (0..=20).map(|i| DVec3::X * f64::from(i) * 0.01).collect();
        let lengths = vec![0.01; 20];
        // Pairs must have pi r between them: the nearest left are 0.01 or more apart.
        let gap = threads((&points, 0.003), (&points, 0.003), Some(&lengths));
        assert!((gap - (0.01 - 0.006)).abs() < 1e-12, "{gap}");
    }
}
