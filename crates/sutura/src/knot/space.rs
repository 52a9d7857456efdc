//! What recognition and audit need of space: distances of segments and triangles, and a tree of boxes over things kept
//! in the order of a thread. Neighbors along a thread are neighbors in space, so the order itself is the hierarchy:
//! nothing is sorted, a refit is one pass, and one thing can change in the time of one path to the root. Not shared
//! with the contact code, which the audit checks.

use glam::DVec3;

/// An axis-aligned box. The empty one overlaps nothing.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Aabb {
    pub min: DVec3,
    pub max: DVec3,
}

impl Aabb {
    pub const EMPTY: Aabb = Aabb { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    pub fn around(points: &[DVec3]) -> Self {
        points.iter().fold(Self::EMPTY, |b, p| Aabb { min: b.min.min(*p), max: b.max.max(*p) })
    }
    pub fn union(&self, other: &Aabb) -> Self {
        Aabb { min: self.min.min(other.min), max: self.max.max(other.max) }
    }
    pub fn grown(&self, by: f64) -> Self {
        Aabb { min: self.min - by, max: self.max + by }
    }
    pub fn overlaps(&self, other: &Aabb) -> bool {
        self.min.cmple(other.max).all() && other.min.cmple(self.max).all()
    }
}

/// A complete binary tree in one array: root 1, children of `k` at `2 k` and `2 k + 1`, leaves last.
#[derive(Debug, Clone, Default)]
pub(crate) struct BoxTree {
    n_leaves: usize,
    nodes: Vec<Aabb>,
}

impl BoxTree {
    /// Forgets everything and makes room for `n` things; keeps its memory.
    pub fn reset(&mut self, n: usize) {
        self.n_leaves = n.next_power_of_two();
        self.nodes.clear();
        self.nodes.resize(2 * self.n_leaves, Aabb::EMPTY);
    }
    /// Sets a thing's box; the tree is valid again after [`BoxTree::refit`].
    pub fn set(&mut self, k: usize, b: Aabb) {
        self.nodes[self.n_leaves + k] = b;
    }
    pub fn refit(&mut self) {
        for k in (1..self.n_leaves).rev() {
            self.nodes[k] = self.nodes[2 * k].union(&self.nodes[2 * k + 1]);
        }
    }
    /// Sets a thing's box and what depends on it.
    pub fn update(&mut self, k: usize, b: Aabb) {
        let mut k = self.n_leaves + k;
        self.nodes[k] = b;
        while k > 1 {
            k /= 2;
            self.nodes[k] = self.nodes[2 * k].union(&self.nodes[2 * k + 1]);
        }
    }
    /// Calls `found` for the things whose boxes overlap `b`, in order, until it says true; whether it did.
    pub fn any(&self, b: &Aabb, found: &mut impl FnMut(usize) -> bool) -> bool {
        !self.nodes.is_empty() && self.any_below(1, b, found)
    }
    fn any_below(&self, k: usize, b: &Aabb, found: &mut impl FnMut(usize) -> bool) -> bool {
        if !self.nodes[k].overlaps(b) {
            false
        } else if k >= self.n_leaves {
            found(k - self.n_leaves)
        } else {
            self.any_below(2 * k, b, found) || self.any_below(2 * k + 1, b, found)
        }
    }
    /// Calls `found(i, j)`, `i < j`, for all pairs of things whose boxes overlap.
    pub fn pairs(&self, found: &mut impl FnMut(usize, usize)) {
        if !self.nodes.is_empty() {
            self.pairs_below(1, found);
        }
    }
    fn pairs_below(&self, k: usize, found: &mut impl FnMut(usize, usize)) {
        if k < self.n_leaves {
            self.pairs_below(2 * k, found);
            self.pairs_below(2 * k + 1, found);
            self.between(2 * k, self, 2 * k + 1, found);
        }
    }
    /// Calls `found(i, j)` for all things `i` here and `j` there whose boxes overlap.
    pub fn pairs_with(&self, other: &BoxTree, found: &mut impl FnMut(usize, usize)) {
        if !self.nodes.is_empty() && !other.nodes.is_empty() {
            self.between(1, other, 1, found);
        }
    }
    fn between(&self, a: usize, other: &BoxTree, b: usize, found: &mut impl FnMut(usize, usize)) {
        if !self.nodes[a].overlaps(&other.nodes[b]) {
            return;
        }
        match (a >= self.n_leaves, b >= other.n_leaves) {
            (true, true) => found(a - self.n_leaves, b - other.n_leaves),
            (true, false) => {
                self.between(a, other, 2 * b, found);
                self.between(a, other, 2 * b + 1, found);
            }
            (false, true) => {
                self.between(2 * a, other, b, found);
                self.between(2 * a + 1, other, b, found);
            }
            (false, false) => {
                for (a, b) in [(2 * a, 2 * b), (2 * a, 2 * b + 1), (2 * a + 1, 2 * b), (2 * a + 1, 2 * b + 1)] {
                    self.between(a, other, b, found);
                }
            }
        }
    }
}

/// Distance of a point from a segment.
pub(crate) fn point_segment(p: DVec3, [a, b]: [DVec3; 2]) -> f64 {
    let ab = b - a;
    let along = (p - a).dot(ab) / ab.length_squared();
    // A segment without length gives NaN here, and is a point.
    let u = if along.is_finite() { along.clamp(0.0, 1.0) } else { 0.0 };
    p.distance(a + ab * u)
}

/// Distance of two segments: between their insides where the common perpendicular meets both, otherwise from an end.
pub(crate) fn segments(p: [DVec3; 2], q: [DVec3; 2]) -> f64 {
    let (u, v, w) = (p[1] - p[0], q[1] - q[0], p[0] - q[0]);
    let (a, b, c, d, e) = (u.dot(u), u.dot(v), v.dot(v), u.dot(w), v.dot(w));
    let det = a * c - b * b;
    let (s, t) = (b * e - c * d, a * e - b * d);
    let mut distance = f64::INFINITY;
    if s > 0.0 && s < det && t > 0.0 && t < det {
        distance = (w + u * (s / det) - v * (t / det)).length();
        if det > 1e-8 * a * c {
            return distance;
        }
        // Nearly parallel: the place of the perpendicular is mostly round-off, and an end may be nearer.
    }
    for (x, segment) in [(p[0], q), (p[1], q), (q[0], p), (q[1], p)] {
        distance = distance.min(point_segment(x, segment));
    }
    distance
}

/// Distance of a segment from a triangle, zero where it goes through.
pub(crate) fn segment_triangle(p: [DVec3; 2], [a, b, c]: [DVec3; 3]) -> f64 {
    let normal = (b - a).cross(c - a);
    let height = |x: DVec3| (x - a).dot(normal);
    let over_triangle = |x: DVec3| {
        let turn = |from: DVec3, to: DVec3| (to - from).cross(x - from).dot(normal);
        turn(a, b) >= 0.0 && turn(b, c) >= 0.0 && turn(c, a) >= 0.0
    };
    let (h0, h1) = (height(p[0]), height(p[1]));
    if h0 * h1 <= 0.0 && h0 != h1 && over_triangle(p[0].lerp(p[1], h0 / (h0 - h1))) {
        return 0.0;
    }
    let mut d = segments(p, [a, b]).min(segments(p, [b, c])).min(segments(p, [c, a]));
    for (x, h) in [(p[0], h0), (p[1], h1)] {
        if over_triangle(x) {
            d = d.min(h.abs() / normal.length());
        }
    }
    d
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = DVec3> {
        (-1.0..1.0, -1.0..1.0, -1.0..1.0).prop_map(|(x, y, z)| DVec3::new(x, y, z))
    }

    proptest! {
        /// A search over a grid of places cannot find less, and comes as near as its spacing.
        #[test]
        fn segment_distance_is_the_minimum(p in [point(), point()], q in [point(), point()]) {
            let d = segments(p, q);
            let n = 60;
            let mut least = f64::INFINITY;
            for i in 0..=n {
                for j in 0..=n {
                    let at = |s: [DVec3; 2], k: i32| s[0].lerp(s[1], f64::from(k) / f64::from(n));
                    least = least.min(at(p, i).distance(at(q, j)));
                }
            }
            prop_assert!(d <= least + 1e-14);
            let spacing = 0.5 * (p[0].distance(p[1]) + q[0].distance(q[1])) / f64::from(n);
            prop_assert!(d >= least - spacing, "{d} {least}");
        }

        #[test]
        fn triangle_distance_is_the_minimum(p in [point(), point()], t in [point(), point(), point()]) {
            let d = segment_triangle(p, t);
            let n = 30;
            let mut least = f64::INFINITY;
            for i in 0..=n {
                let x = p[0].lerp(p[1], f64::from(i) / f64::from(n));
                for j in 0..=n {
                    for k in 0..=n - j {
                        let (u, v) = (f64::from(j) / f64::from(n), f64::from(k) / f64::from(n));
                        least = least.min(x.distance(t[0] + (t[1] - t[0]) * u + (t[2] - t[0]) * v));
                    }
                }
            }
            prop_assert!(d <= least + 1e-14);
            // Half a grid cell on each of the three edges.
            let spacing = 0.5 * (p[0].distance(p[1]) + t[0].distance(t[1]) + t[0].distance(t[2])) / f64::from(n);
            prop_assert!(d >= least - spacing, "{d} {least}");
        }
    }
}
