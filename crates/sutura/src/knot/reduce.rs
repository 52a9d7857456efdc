//! Fewer points, same knot: a corner `abc` is cut to `ac` when nothing pierces the triangle between them (Koniaris and Muthukumar
//! 1991; Taylor 2000). That is an isotopy of the polygon, so the knot type cannot change. The predicates are exact (Shewchuk 1997,
//! crate `robust`), and a case in doubt (four points in a plane) is left alone.

use super::Rng;
use super::boxes::{Aabb, BoxTree};
use glam::DVec3;
use robust::{Coord3D, orient3d};

/// Sign of the volume of `abcd`: that of `(b - a) x (d - c) . (c - a)`.
pub(super) fn side(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> i8 {
    let coord = |p: DVec3| Coord3D { x: p.x, y: p.y, z: p.z };
    let volume = orient3d(coord(a), coord(b), coord(c), coord(d));
    i8::from(volume > 0.0) - i8::from(volume < 0.0)
}

/// Whether the segment `pq`, which shares no point with the triangle by right, meets it or may.
fn pierces([a, b, c]: [DVec3; 3], p: DVec3, q: DVec3) -> bool {
    match side(a, b, c, p) * side(a, b, c, q) {
        1 => false,
        0 => true,
        _ => {
            let (u, v, w) = (side(p, q, a, b), side(p, q, b, c), side(p, q, c, a));
            u == 0 || v == 0 || w == 0 || (u == v && v == w)
        }
    }
}

/// The same for a segment that may share corners with the triangle. From a shared corner it can only leave.
fn pierces_from(triangle: [DVec3; 3], p: DVec3, q: DVec3) -> bool {
    let [a, b, c] = triangle;
    match (triangle.contains(&p), triangle.contains(&q)) {
        (true, true) => false,
        (true, false) => side(a, b, c, q) == 0,
        (false, true) => side(a, b, c, p) == 0,
        (false, false) => pierces(triangle, p, q),
    }
}

/// Takes out every point that can go, pass after pass, every second one at a time so that the edges grow evenly. `obstacles` are
/// segments that may not be crossed either. The ends of an open chain stay.
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
            let around = Aabb::around(&triangle);
            let blocked = tree.any(&around, &mut |e| {
                let (p, q) = (e, next[e]);
                if e == a || e == b {
                    false
                } else if q == a {
                    side(triangle[0], triangle[1], triangle[2], points[p]) == 0
                } else if p == c {
                    side(triangle[0], triangle[1], triangle[2], points[q]) == 0
                } else {
                    pierces(triangle, points[p], points[q])
                }
            }) || obstacles.iter().zip(&obstacle_boxes).any(|(o, ob)| ob.overlaps(&around) && pierces_from(triangle, o[0], o[1]));
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

/// Moves the corners of a small closed polygon about at random, each by two triangle moves, which leads it out of a shape from
/// which no corner can be cut although the knot has a simpler one.
pub(super) fn shake(points: &mut [DVec3], rng: &mut Rng) {
    let n = points.len();
    if n < 4 {
        return;
    }
    for i in 0..n {
        let (a, b, c) = (points[(i + n - 1) % n], points[i], points[(i + 1) % n]);
        let reach = 0.5 * ((a - b).length() + (c - b).length());
        let to = b + (0.5 * (a + c) - b) * rng.unit() + rng.direction() * (reach * rng.unit() * rng.unit());
        let edge = |k: usize| (points[k], points[(k + 1) % n]);
        // First the point `to` grows out of the edge ab, then b is cut off between `to` and c.
        let out = [a, to, b];
        let cut = [to, b, c];
        let free = (0..n).all(|k| {
            let (p, q) = edge(k);
            (k == (i + n - 1) % n || !pierces_from(out, p, q)) && (k == i || k == (i + n - 1) % n || !pierces_from(cut, p, q))
        }) && side(to, b, c, a) != 0;
        if free {
            points[i] = to;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pierced_triangle_stays_and_a_free_one_goes() {
        let triangle = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let inside = DVec3::new(0.2, 0.2, 0.0);
        assert!(pierces(triangle, inside - DVec3::Z, inside + DVec3::Z));
        assert!(!pierces(triangle, inside + DVec3::Z, inside + DVec3::Z * 2.0));
        let outside = DVec3::new(0.7, 0.7, 0.0);
        assert!(!pierces(triangle, outside - DVec3::Z, outside + DVec3::Z));
        // In the plane, and through an edge: in doubt, so it counts as pierced.
        assert!(pierces(triangle, outside, outside + DVec3::X));
        assert!(pierces(triangle, DVec3::new(0.5, 0.5, -1.0), DVec3::new(0.5, 0.5, 1.0)));
    }

    #[test]
    fn the_side_has_the_sign_of_the_triple_product() {
        // (b - a) x (d - c) . (c - a) for a = 0, b = x, c = z, d = z + y is x x y . z = 1.
        assert_eq!(side(DVec3::ZERO, DVec3::X, DVec3::Z, DVec3::Z + DVec3::Y), 1);
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
        let mut arc: Vec<DVec3> = (0..50).map(|i| libm::sincos(f64::from(i) * 0.06)).map(|(s, c)| DVec3::new(c, s, 0.001 * c * s)).collect();
        reduce(&mut arc, false, &[[DVec3::new(0.1, 0.5, -1.0), DVec3::new(0.1, 0.5, 1.0)]]);
        assert!(arc.len() >= 3);
    }
}
