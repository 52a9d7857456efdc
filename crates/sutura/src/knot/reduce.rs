//! Fewer points, same knot: a corner `abc` is cut to `ac` when nothing is in or near the triangle between them
//! (Koniaris and Muthukumar 1991; Taylor 2000). That is an isotopy of the polygon, so the knot type cannot change.
//! Exact predicates would not be enough: they allow a cut that ends within round-off of another strand, and the next
//! rotation of all points then passes it through. So a cut keeps a margin, a million times the round-off, and in doubt
//! is not made.

use super::space::{Aabb, BoxTree, segment_triangle, segments};
use glam::DVec3;

/// Nearest that a cut may come to another edge, for a thread scaled to a radius of about one.
const MARGIN: f64 = 1e-9;

/// Whether the segment `pq`, which has no business at the triangle, comes too near to it.
fn near(triangle: [DVec3; 3], p: DVec3, q: DVec3) -> bool {
    let [a, b, c] = triangle;
    let (u, v) = (b - a, c - a);
    let normal = u.cross(v);
    // Clear of the plane by the margin and by the round-off of the product, both ends on one side: the most common
    // case.
    let (clear, round_off) = (2.0 * MARGIN * normal.length(), 16.0 * f64::EPSILON * u.length() * v.length());
    let side = |x: DVec3| {
        let (w, volume) = (x - a, (x - a).dot(normal));
        if volume.abs() > clear + round_off * w.length() { volume.signum() } else { 0.0 }
    };
    let one_side = side(p) * side(q) > 0.0;
    !one_side && segment_triangle([p, q], triangle) <= MARGIN
}

/// The same for a segment from the corner `shared` of the triangle to `p`, where `opposite` is the other edge: it may
/// only leave. If it went into the triangle it would end there or go out through that edge.
fn near_from(triangle: [DVec3; 3], shared: DVec3, opposite: [DVec3; 2], p: DVec3) -> bool {
    segment_triangle([p, p], triangle) <= MARGIN || segments([shared, p], opposite) <= MARGIN
}

/// The same for a segment that may have corners of the triangle as ends.
fn near_apart_from_corners(triangle: [DVec3; 3], p: DVec3, q: DVec3) -> bool {
    let [a, b, c] = triangle;
    let opposite = |x: DVec3| {
        if x == a {
            [b, c]
        } else if x == b {
            [c, a]
        } else {
            [a, b]
        }
    };
    match (triangle.contains(&p), triangle.contains(&q)) {
        (true, true) => false,
        (true, false) => near_from(triangle, p, opposite(p), q),
        (false, true) => near_from(triangle, q, opposite(q), p),
        (false, false) => near(triangle, p, q),
    }
}

/// Takes out every point that can go, pass after pass, every second one at a time so that the edges grow evenly.
/// `obstacles` are segments that may not be crossed either. The ends of an open chain stay.
pub(super) fn reduce(points: &mut Vec<DVec3>, closed: bool, obstacles: &[[DVec3; 2]]) {
    let n = points.len();
    if n < 4 {
        return;
    }
    let mut next: Vec<usize> = (1..=n).map(|i| i % n).collect();
    let mut prev: Vec<usize> = (0..n).map(|i| (i + n - 1) % n).collect();
    let mut tree = BoxTree::default();
    tree.reset(n);
    let n_edges = if closed { n } else { n - 1 };
    for i in 0..n_edges {
        tree.set(i, Aabb::around(&[points[i], points[next[i]]]));
    }
    tree.refit();
    let obstacle_boxes: Vec<Aabb> = obstacles.iter().map(|o| Aabb::around(o)).collect();

    let mut left = n;
    let mut first = 0; // A point that is still there.
    loop {
        let before = left;
        let mut b = if closed { first } else { next[first] };
        for _ in 0..before {
            let (a, c) = (prev[b], next[b]);
            if left <= 3 || (!closed && c == 0) {
                break;
            }
            let triangle = [points[a], points[b], points[c]];
            let around = Aabb::around(&triangle).grown(MARGIN);
            let blocked = tree.any(&around, &mut |e| {
                let (p, q) = (e, next[e]);
                if e == a || e == b {
                    false
                } else if q == a {
                    near_from(triangle, points[a], [points[b], points[c]], points[p])
                } else if p == c {
                    near_from(triangle, points[c], [points[a], points[b]], points[q])
                } else {
                    near(triangle, points[p], points[q])
                }
            }) || obstacles
                .iter()
                .zip(&obstacle_boxes)
                .any(|(o, ob)| ob.overlaps(&around) && near_apart_from_corners(triangle, o[0], o[1]));
            if !blocked {
                next[a] = c;
                prev[c] = a;
                tree.update(b, Aabb::EMPTY);
                tree.update(a, Aabb::around(&[points[a], points[c]]));
                left -= 1;
                if first == b {
                    first = a;
                }
            }
            b = if blocked || (!closed && next[c] == 0) { c } else { next[c] };
            if !closed && b == 0 {
                break;
            }
        }
        if left == before || left <= 3 {
            break;
        }
    }
    let mut kept = Vec::with_capacity(left);
    let mut i = first;
    for _ in 0..left {
        kept.push(points[i]);
        i = next[i];
    }
    *points = kept;
}

#[cfg(test)]
mod tests {
    use super::super::Rng;
    use super::*;

    #[test]
    fn a_pierced_triangle_stays_and_a_free_one_goes() {
        let triangle = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let inside = DVec3::new(0.2, 0.2, 0.0);
        assert!(near(triangle, inside - DVec3::Z, inside + DVec3::Z));
        assert!(!near(triangle, inside + DVec3::Z, inside + DVec3::Z * 2.0));
        let outside = DVec3::new(0.7, 0.7, 0.0);
        assert!(!near(triangle, outside - DVec3::Z, outside + DVec3::Z));
        // Through an edge, and beside one by less than the margin.
        assert!(near(triangle, DVec3::new(0.2, -1e-10, -1.0), DVec3::new(0.2, -1e-10, 1.0)));
        // In the plane but elsewhere.
        assert!(!near(triangle, outside, outside + DVec3::X));
        assert!(near(triangle, DVec3::new(0.5, 0.5, -1.0), DVec3::new(0.5, 0.5, 1.0)));
    }

    #[test]
    fn a_wavy_open_chain_becomes_its_ends_and_respects_an_obstacle() {
        let mut rng = Rng::new(3);
        let wavy: Vec<DVec3> = (0..200).map(|i| DVec3::X * (f64::from(i) * 0.01) + rng.direction() * 0.02).collect();
        let mut free = wavy.clone();
        reduce(&mut free, false, &[]);
        assert!(free.len() <= 3, "{} points left", free.len());
        assert_eq!((free[0], *free.last().unwrap()), (wavy[0], wavy[199]));
        // A half circle about a needle cannot be drawn straight past it.
        let mut arc: Vec<DVec3> =
            (0..50).map(|i| libm::sincos(f64::from(i) * 0.06)).map(|(s, c)| DVec3::new(c, s, 0.001 * c * s)).collect();
        reduce(&mut arc, false, &[[DVec3::new(0.1, 0.5, -1.0), DVec3::new(0.1, 0.5, 1.0)]]);
        assert!(arc.len() >= 3);
    }
}
