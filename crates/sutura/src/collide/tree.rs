//! A binary tree of boxes over the elements in array order. Neighbors along a thread are neighbors in space, so the
//! tree never needs sorting: it is refilled bottom up.

use core::ops::Range;
use glam::DVec3;

#[derive(Debug, Clone, Copy)]
pub(crate) struct Bounds {
    pub lo: DVec3,
    pub hi: DVec3,
}

impl Bounds {
    pub const EMPTY: Bounds = Bounds { lo: DVec3::INFINITY, hi: DVec3::NEG_INFINITY };

    pub fn of(points: &[DVec3], grow: f64) -> Self {
        let mut b = Bounds::EMPTY;
        for p in points {
            b.lo = b.lo.min(*p);
            b.hi = b.hi.max(*p);
        }
        b.grown(grow)
    }
    #[inline(always)]
    pub fn grown(&self, by: f64) -> Self {
        Bounds { lo: self.lo - DVec3::splat(by), hi: self.hi + DVec3::splat(by) }
    }
    #[inline(always)]
    pub fn union(&self, o: &Bounds) -> Bounds {
        Bounds { lo: self.lo.min(o.lo), hi: self.hi.max(o.hi) }
    }
    #[inline(always)]
    pub fn overlaps(&self, o: &Bounds) -> bool {
        self.lo.cmple(o.hi).all() && o.lo.cmple(self.hi).all()
    }
}

#[derive(Default)]
pub(crate) struct Tree {
    /// Heap order: children of `k` are `2 k + 1` and `2 k + 2`; the last `leaves` entries are the leaves.
    nodes: Vec<Bounds>,
    leaves: usize,
    stack: Vec<(u32, u32)>,
    /// Of pairs of nodes of one level, with the number of leaves under each.
    pair_stack: Vec<(u32, u32, u32)>,
}

impl Tree {
    /// Refills the tree with `n` leaves.
    pub fn fill(&mut self, n: usize, mut leaf: impl FnMut(usize) -> Bounds) {
        self.leaves = n.next_power_of_two();
        self.nodes.resize(2 * self.leaves - 1, Bounds::EMPTY);
        for (i, node) in self.nodes[self.leaves - 1..].iter_mut().enumerate() {
            *node = if i < n { leaf(i) } else { Bounds::EMPTY };
        }
        for k in (0..self.leaves - 1).rev() {
            self.nodes[k] = self.nodes[2 * k + 1].union(&self.nodes[2 * k + 2]);
        }
    }

    pub fn leaf(&self, i: usize) -> &Bounds {
        &self.nodes[self.leaves - 1 + i]
    }

    /// Calls `found(i, j)` with i < j for all pairs of overlapping leaves, except where `skip` says of a range of
    /// leaves that no pair within it matters.
    pub fn pairs(&mut self, skip: impl Fn(Range<usize>) -> bool, mut found: impl FnMut(usize, usize)) {
        let leaves = self.leaves as u32;
        self.pair_stack.clear();
        self.pair_stack.push((0, 0, leaves));
        while let Some((a, b, size)) = self.pair_stack.pop() {
            // The level begins at node leaves / size - 1.
            let first = |k: u32| ((k + 1) * size - leaves) as usize;
            let half = size / 2;
            if a == b {
                if size > 1 && !skip(first(a)..first(a + 1)) {
                    self.pair_stack.extend([
                        (2 * a + 1, 2 * a + 1, half),
                        (2 * a + 2, 2 * a + 2, half),
                        (2 * a + 1, 2 * a + 2, half),
                    ]);
                }
                continue;
            }
            if !self.nodes[a as usize].overlaps(&self.nodes[b as usize]) || skip(first(a)..first(b + 1)) {
                continue;
            }
            if size == 1 {
                found(first(a), first(b));
            } else {
                let (a, b) = (2 * a + 1, 2 * b + 1);
                self.pair_stack.extend([(a, b, half), (a, b + 1, half), (a + 1, b, half), (a + 1, b + 1, half)]);
            }
        }
    }

    /// Calls `found(i)` for all leaves that overlap `with`.
    pub fn overlapping(&mut self, with: &Bounds, mut found: impl FnMut(usize)) {
        let inner = self.leaves as u32 - 1;
        self.stack.clear();
        self.stack.push((0, 0));
        while let Some((a, _)) = self.stack.pop() {
            if !self.nodes[a as usize].overlaps(with) {
                continue;
            }
            if a >= inner {
                found((a - inner) as usize);
            } else {
                self.stack.extend([(2 * a + 1, 0), (2 * a + 2, 0)]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_pairs_that_brute_force_finds() {
        let at = |i: usize| {
            let s = i as f64 * 0.37;
            DVec3::new((3.1 * s).sin(), (2.3 * s).cos(), (1.7 * s).sin())
        };
        let boxes: Vec<Bounds> = (0..37).map(|i| Bounds::of(&[at(i), at(i + 1)], 0.1)).collect();
        let mut tree = Tree::default();
        tree.fill(boxes.len(), |i| boxes[i]);
        let mut got = Vec::new();
        tree.pairs(|_| false, |i, j| got.push((i, j)));
        got.sort_unstable();
        let mut want = Vec::new();
        for i in 0..boxes.len() {
            for j in i + 1..boxes.len() {
                if boxes[i].overlaps(&boxes[j]) {
                    want.push((i, j));
                }
            }
        }
        assert_eq!(got, want);
        // With pairs up to six apart left out where whole ranges are.
        got.clear();
        tree.pairs(|range| range.len() <= 7, |i, j| got.push((i, j)));
        got.sort_unstable();
        let far: Vec<_> = want.iter().copied().filter(|(i, j)| j - i > 6).collect();
        assert_eq!(got, far);
        assert!(far.len() < want.len());
        assert!(want.len() > 40 && want.len() < 600);
    }
}
