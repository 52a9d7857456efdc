//! A tree of boxes over things kept in the order of a thread. Neighbors along a thread are neighbors in space, so the order itself
//! is the hierarchy: nothing is sorted, a refit is one pass, and one thing can change in the time of one path to the root.

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
