//! The linear system of a rod and its direct solution.
//!
//! The unknowns of a rod, ordered x_0, theta_0, x_1, theta_1, ... in nodes of three, couple each node to the next two
//! only: x_i to theta_i and x_{i+1}, theta_i to x_{i+1} and theta_{i+1}. The matrix is symmetric positive definite and
//! block pentadiagonal with 3x3 blocks. It is factored as L D L^T without square roots, each 3x3 pivot as l d l^T (a
//! pivot's closed-form inverse would lose all digits: stretch is 1e8 times stiffer than the rest).
//!
//! The tension of an inextensible element is an unknown besides, eliminated between its two particles: as a stiffness
//! in their blocks it would take the digits of masses with it, which are 1e-13 of it. The matrix is quasi-definite
//! then, and any order of elimination is stable [Vanderbei 1995].
//!
//! Elimination runs from both ends of a rod toward a zone of blocks `[lo, hi]` (a block is x_i with theta_i) and then
//! through the zone from `lo` to `hi`, so that the inverse within the zone, which contacts need, follows from the zone
//! alone.

use crate::lanes::{Vec2, lanes};
use crate::math::outer;
use core::ops::Range;
use glam::{DMat3, DVec3};
use wide::f64x2;

/// One pivot `l d l^T` with unit lower triangular `l`.
#[derive(Debug, Clone, Copy, Default)]
struct Pivot {
    l10: f64,
    l20: f64,
    l21: f64,
    /// Reciprocals of d.
    inv: DVec3,
}

impl Pivot {
    #[inline(always)]
    fn new(a: &DMat3) -> Self {
        let d0 = a.x_axis.x;
        let i0 = 1.0 / d0;
        let l10 = a.x_axis.y * i0;
        let l20 = a.x_axis.z * i0;
        let d1 = a.y_axis.y - l10 * a.x_axis.y;
        let i1 = 1.0 / d1;
        let c21 = a.y_axis.z - l20 * a.x_axis.y;
        let l21 = c21 * i1;
        let d2 = a.z_axis.z - l20 * a.x_axis.z - l21 * c21;
        Pivot { l10, l20, l21, inv: DVec3::new(i0, i1, 1.0 / d2) }
    }
    /// `l^-1 v`.
    #[inline(always)]
    fn lower(&self, v: DVec3) -> DVec3 {
        let y = v.y - self.l10 * v.x;
        DVec3::new(v.x, y, v.z - self.l20 * v.x - self.l21 * y)
    }
    /// `l^-T v`.
    #[inline(always)]
    fn upper(&self, v: DVec3) -> DVec3 {
        let y = v.y - self.l21 * v.z;
        DVec3::new(v.x - self.l10 * y - self.l20 * v.z, y, v.z)
    }
    #[inline(always)]
    fn lower_mat(&self, m: &DMat3) -> DMat3 {
        DMat3::from_cols(self.lower(m.x_axis), self.lower(m.y_axis), self.lower(m.z_axis))
    }
    #[inline(always)]
    fn upper_mat(&self, m: &DMat3) -> DMat3 {
        DMat3::from_cols(self.upper(m.x_axis), self.upper(m.y_axis), self.upper(m.z_axis))
    }
    /// `l m`.
    fn times_lower(&self, m: &DMat3) -> DMat3 {
        let col = |v: DVec3| DVec3::new(v.x, self.l10 * v.x + v.y, self.l20 * v.x + self.l21 * v.y + v.z);
        DMat3::from_cols(col(m.x_axis), col(m.y_axis), col(m.z_axis))
    }
    /// `l d l^T`.
    fn whole(&self) -> DMat3 {
        let l = self.times_lower(&DMat3::IDENTITY);
        l * DMat3::from_diagonal(DVec3::ONE / self.inv) * l.transpose()
    }
    /// The inverse of the pivot times `m`.
    #[inline(always)]
    fn solve_mat(&self, m: &DMat3) -> DMat3 {
        self.upper_mat(&scale_rows(&self.lower_mat(m), self.inv))
    }
}

#[inline(always)]
fn scale_rows(m: &DMat3, s: DVec3) -> DMat3 {
    DMat3::from_cols(m.x_axis * s, m.y_axis * s, m.z_axis * s)
}

/// `a^T b`.
#[inline(always)]
fn t_mul(a: &DMat3, b: &DMat3) -> DMat3 {
    let col = |v: DVec3| DVec3::new(a.x_axis.dot(v), a.y_axis.dot(v), a.z_axis.dot(v));
    DMat3::from_cols(col(b.x_axis), col(b.y_axis), col(b.z_axis))
}

/// A 6x6 matrix in four 3x3 blocks: rows and columns are (x, theta).
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Block {
    pub xx: DMat3,
    pub xt: DMat3,
    pub tx: DMat3,
    pub tt: DMat3,
}

/// Three columns of six numbers: (x, theta) parts.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Columns {
    pub x: DMat3,
    pub t: DMat3,
}

impl Block {
    #[inline(always)]
    pub fn mul_columns(&self, c: &Columns) -> Columns {
        Columns { x: self.xx * c.x + self.xt * c.t, t: self.tx * c.x + self.tt * c.t }
    }
    #[inline(always)]
    pub fn mul(&self, b: &Block) -> Block {
        Block {
            xx: self.xx * b.xx + self.xt * b.tx,
            xt: self.xx * b.xt + self.xt * b.tt,
            tx: self.tx * b.xx + self.tt * b.tx,
            tt: self.tx * b.xt + self.tt * b.tt,
        }
    }
    #[inline(always)]
    pub fn transpose(&self) -> Block {
        Block { xx: self.xx.transpose(), xt: self.tx.transpose(), tx: self.xt.transpose(), tt: self.tt.transpose() }
    }
    pub fn negated(&self) -> Block {
        Block { xx: -self.xx, xt: -self.xt, tx: -self.tx, tt: -self.tt }
    }
    fn add(&self, b: &Block) -> Block {
        Block { xx: self.xx + b.xx, xt: self.xt + b.xt, tx: self.tx + b.tx, tt: self.tt + b.tt }
    }
}

/// A multiplier of an element with what it couples to: the tension of an inextensible one. Its own entry is minus its
/// compliance, so it takes the sign of a pivot with it but no digits, however small the compliance is. It is eliminated
/// after the first of the element's particles.
#[derive(Debug, Clone, Copy, Default)]
struct Link {
    /// `l^-1` of its coupling to that particle.
    own: DVec3,
    /// ContactSystem to the two nodes that come after, when the particle is eliminated.
    next: DVec3,
    after: DVec3,
    /// Minus the reciprocal of its pivot.
    inv: f64,
}

impl Link {
    #[inline(always)]
    fn new(p: &Pivot, [a, b]: [DVec3; 2], give: f64, w1: &DMat3, w2: &DMat3) -> Self {
        let own = p.lower(a);
        let s = own * p.inv;
        Link { own, next: -t_vec(w1, s), after: b - t_vec(w2, s), inv: 1.0 / (give + own.dot(s)) }
    }
    /// What it takes to the right sides of the two nodes, where that of the particle is `s` and its own is `right`.
    #[inline(always)]
    fn forward(&self, s: DVec3, right: f64) -> (DVec3, DVec3) {
        let t = (right - self.own.dot(s)) * self.inv;
        (self.next * t, self.after * t)
    }
    /// What it does to the particle, before `l^-T`.
    #[inline(always)]
    fn back(&self, p: &Pivot, s: DVec3, right: f64, next: DVec3, after: DVec3) -> DVec3 {
        self.own * p.inv * ((self.next.dot(next) + self.after.dot(after) + self.own.dot(s) - right) * self.inv)
    }
}

/// A node of six right sides.
pub(crate) type Six = [DVec3; 6];

/// The system of all rods. Node `2 i` is particle i, node `2 i + 1` frame i. Assembled, then factored in place.
#[derive(Default)]
pub(crate) struct System {
    pub diagonal: Vec<DMat3>,
    /// ContactSystem of each node to the next one and to the one after it: `a[k][k + 1]`, `a[k][k + 2]`.
    pub next: Vec<DMat3>,
    pub after: Vec<DMat3>,
    /// Whether a block is one of a rod whose elements have multipliers.
    pub tied: Vec<bool>,
    /// ContactSystem of each element's multiplier to its two particles, and its compliance, > 0; no coupling where it
    /// has none.
    pub ties: Vec<([DVec3; 2], f64)>,
    /// Right side of each multiplier's row.
    pub right: Vec<f64>,
    links: Vec<Link>,
    pivots: Vec<Pivot>,
    /// Inverse of the matrix at zone blocks, and transfer `z_i = -k_i z_{i+1}` between them.
    inverse: Vec<Block>,
    transfer: Vec<Block>,
}

impl System {
    pub fn resize(&mut self, n_particles: usize) {
        let n = 2 * n_particles;
        self.diagonal.resize(n, DMat3::ZERO);
        self.next.resize(n, DMat3::ZERO);
        self.after.resize(n, DMat3::ZERO);
        self.tied.resize(n_particles, false);
        self.ties.resize(n_particles, ([DVec3::ZERO; 2], 1.0));
        self.right.resize(n_particles, 0.0);
        self.links.resize(n_particles, Link::default());
        self.pivots.resize(n, Pivot::default());
        self.inverse.resize(n_particles, Block::default());
        self.transfer.resize(n_particles, Block::default());
    }

    /// Takes a node out of the system: its unknown becomes zero times `1 - keep`, where `keep` projects on the free
    /// directions. What is taken out is as stiff as the rest, so that rounding is the same at any scale.
    pub fn restrict(&mut self, node: usize, keep: DMat3) {
        let d = &self.diagonal[node];
        let size = d.x_axis.x.abs().max(d.y_axis.y.abs()).max(d.z_axis.z.abs());
        self.diagonal[node] = keep * *d * keep + (DMat3::IDENTITY - keep) * size;
        self.next[node] = keep * self.next[node];
        self.after[node] = keep * self.after[node];
        if node >= 1 {
            self.next[node - 1] *= keep;
        }
        if node >= 2 {
            self.after[node - 2] *= keep;
        }
        if node.is_multiple_of(2) && self.tied[node / 2] {
            let e = node / 2;
            self.ties[e].0[0] = keep * self.ties[e].0[0];
            if e >= 1 {
                self.ties[e - 1].0[1] = keep * self.ties[e - 1].0[1];
            }
        }
    }

    /// The multiplier that is eliminated with node `k` toward higher nodes, or toward lower ones.
    #[inline(always)]
    fn tie(&self, k: usize, up: bool) -> Option<usize> {
        (k.is_multiple_of(2) && self.tied[k / 2]).then(|| if up { k / 2 } else { k / 2 - 1 })
    }

    /// Factors the rod whose blocks are `blocks`; the zone must lie within. False when the matrix is not positive
    /// definite.
    pub fn factor(&mut self, blocks: Range<usize>, zone: &Range<usize>) -> bool {
        let (both, top) = (both(&blocks, zone), self.top(&blocks, zone));
        if top < 2 * blocks.end {
            self.pivots[top] = Pivot::new(&self.diagonal[top]);
        }
        if self.tied[blocks.start] {
            self.eliminate_both::<true>(2 * blocks.start, top - 1, both);
        } else {
            self.eliminate_both::<false>(2 * blocks.start, top - 1, both);
        }
        for k in 2 * blocks.start + both..2 * zone.start {
            self.eliminate_up(k);
        }
        for k in (2 * zone.end..top - both).rev() {
            self.eliminate_down(k);
        }
        for k in 2 * zone.start..2 * zone.end - 2 {
            self.eliminate_up(k);
        }
        // The last block of the zone has no coupling left beyond itself.
        let k = 2 * zone.end - 2;
        let p = Pivot::new(&self.diagonal[k]);
        let w1 = p.lower_mat(&self.next[k]);
        self.diagonal[k + 1] -= t_mul(&w1, &scale_rows(&w1, p.inv));
        self.next[k] = w1;
        self.pivots[k] = p;
        self.pivots[k + 1] = Pivot::new(&self.diagonal[k + 1]);
        self.pivots[2 * blocks.start..2 * blocks.end].iter().all(|p| p.inv.min_element() > 0.0)
    }

    /// End of the nodes that are eliminated downward. The last frame of a rod, which is no element's, couples to
    /// nothing: where there are multipliers it is left out, so that the two ends come to their particles at the same
    /// time.
    fn top(&self, blocks: &Range<usize>, zone: &Range<usize>) -> usize {
        2 * blocks.end - usize::from(self.tied[blocks.start] && zone.end < blocks.end)
    }

    /// Eliminates `count` nodes from `low` on toward higher nodes and as many from `high` on toward lower ones, one of
    /// each at a time in the two lanes of a vector: each end's nodes wait for one another, the two ends do not.
    fn eliminate_both<const TIED: bool>(&mut self, low: usize, high: usize, count: usize) {
        if count == 0 {
            return;
        }
        // The next pivot, the one after it, and their coupling.
        let mut d0 = Mat2::symmetric(&self.diagonal[low], &self.diagonal[high]);
        let mut d1 = Mat2::symmetric(&self.diagonal[low + 1], &self.diagonal[high - 1]);
        let mut n0 = Mat2::load(&self.next[low], &self.next[high - 1]);
        for i in 0..count {
            let (k, m) = (low + i, high - i);
            let a0 = Mat2::load(&self.after[k], &self.after[m - 2]);
            let n1 = Mat2::load(&self.next[k + 1], &self.next[m - 2]);
            let d2 = Mat2::symmetric(&self.diagonal[k + 2], &self.diagonal[m - 2]);
            let p = Pivot2::new(&d0);
            let (w1, w2) = (p.lower_mat(&n0), p.lower_mat(&a0));
            let (s1, s2) = (w1.scale_rows(&p.inv), w2.scale_rows(&p.inv));
            d0 = d1.less_square(&w1, &s1);
            d1 = d2.less_square(&w2, &s2);
            n0 = n1.less_product(&w1, &s2);
            if TIED && i.is_multiple_of(2) {
                let (e, f) = (k / 2, m / 2 - 1);
                let (([a, b], give), ([c, d], other)) = (self.ties[e], self.ties[f]);
                let own = p.lower(&Vec2::load(a, d));
                let s = own.times(&p.inv);
                let inv = f64x2::splat(1.0) / (lanes(give, other) + own.dot(&s));
                let zero = Vec2::load(DVec3::ZERO, DVec3::ZERO);
                let (next, after) = (zero.less_t_vec(&w1, &s), Vec2::load(b, c).less_t_vec(&w2, &s));
                d0 = d0.plus_product(&next, &next.scaled(inv));
                n0 = n0.plus_product(&next, &after.scaled(inv));
                d1 = d1.plus_product(&after, &after.scaled(inv));
                let (own, next, after, inv) = (own.split(), next.split(), after.split(), inv.to_array());
                self.links[e] = Link { own: own.0, next: next.0, after: after.0, inv: inv[0] };
                self.links[f] = Link { own: own.1, next: next.1, after: after.1, inv: inv[1] };
            }
            w1.store(&mut self.next, k, m - 1);
            w2.store(&mut self.after, k, m - 2);
            (self.pivots[k], self.pivots[m]) = p.split();
        }
        let (k, m) = (low + count, high - count);
        d0.store(&mut self.diagonal, k, m);
        d1.store(&mut self.diagonal, k + 1, m - 1);
        n0.store(&mut self.next, k, m - 1);
        self.next[m - 1] = self.next[m - 1].transpose();
    }

    /// Eliminates node `k` toward higher nodes.
    #[inline(always)]
    fn eliminate_up(&mut self, k: usize) {
        let p = Pivot::new(&self.diagonal[k]);
        let w1 = p.lower_mat(&self.next[k]);
        let w2 = p.lower_mat(&self.after[k]);
        let (s1, s2) = (scale_rows(&w1, p.inv), scale_rows(&w2, p.inv));
        self.diagonal[k + 1] -= t_mul(&w1, &s1);
        self.next[k + 1] -= t_mul(&w1, &s2);
        self.diagonal[k + 2] -= t_mul(&w2, &s2);
        if let Some(e) = self.tie(k, true) {
            let (tie, give) = self.ties[e];
            let link = Link::new(&p, tie, give, &w1, &w2);
            self.diagonal[k + 1] += outer(link.next, link.next * link.inv);
            self.next[k + 1] += outer(link.next, link.after * link.inv);
            self.diagonal[k + 2] += outer(link.after, link.after * link.inv);
            self.links[e] = link;
        }
        self.next[k] = w1;
        self.after[k] = w2;
        self.pivots[k] = p;
    }

    /// Eliminates node `k` toward lower nodes. The scaled couplings replace `next[k - 1]` and `after[k - 2]`,
    /// transposed.
    #[inline(always)]
    fn eliminate_down(&mut self, k: usize) {
        let p = Pivot::new(&self.diagonal[k]);
        let w1 = p.lower_mat(&self.next[k - 1].transpose());
        let w2 = p.lower_mat(&self.after[k - 2].transpose());
        let (s1, s2) = (scale_rows(&w1, p.inv), scale_rows(&w2, p.inv));
        self.diagonal[k - 1] -= t_mul(&w1, &s1);
        self.next[k - 2] -= t_mul(&w2, &s1);
        self.diagonal[k - 2] -= t_mul(&w2, &s2);
        if let Some(e) = self.tie(k, false) {
            let ([a, b], give) = self.ties[e];
            let link = Link::new(&p, [b, a], give, &w1, &w2);
            self.diagonal[k - 1] += outer(link.next, link.next * link.inv);
            self.next[k - 2] += outer(link.after, link.next * link.inv);
            self.diagonal[k - 2] += outer(link.after, link.after * link.inv);
            self.links[e] = link;
        }
        self.next[k - 1] = w1;
        self.after[k - 2] = w2;
        self.pivots[k] = p;
    }

    /// Solves for one right side of the rod, in place, that of the multipliers being zero. `factor` must have run with
    /// the same ranges.
    pub fn solve(&self, blocks: Range<usize>, zone: &Range<usize>, z: &mut [DVec3]) {
        self.solve_part(blocks, zone, z, 0.0);
    }

    /// The same with the multipliers' own right sides.
    pub fn solve_all(&self, blocks: Range<usize>, zone: &Range<usize>, z: &mut [DVec3]) {
        self.solve_part(blocks, zone, z, 1.0);
    }

    /// The same with a part of them.
    fn solve_part(&self, blocks: Range<usize>, zone: &Range<usize>, z: &mut [DVec3], part: f64) {
        let (first, top) = (2 * blocks.start, self.top(&blocks, zone));
        if top < 2 * blocks.end {
            let p = &self.pivots[top];
            z[top] = p.upper(p.lower(z[top]) * p.inv);
        }
        let (lo, hi) = (2 * zone.start, 2 * zone.end);
        let both = both(&blocks, zone);
        // Forward: y = l^-1 r, then what it leaves in the nodes it couples to.
        if self.tied[blocks.start] {
            self.forward_both::<true>(first, top - 1, both, z, part);
        } else {
            self.forward_both::<false>(first, top - 1, both, z, part);
        }
        self.forward_up(first + both..lo, z, part);
        self.forward_down(hi..top - both, z, part);
        self.forward_up(lo..hi - 2, z, part);
        let k = hi - 2;
        let p = &self.pivots[k];
        z[k] = p.lower(z[k]) * p.inv;
        let s = z[k];
        z[k + 1] -= t_vec(&self.next[k], s);
        let q = &self.pivots[k + 1];
        z[k + 1] = q.upper(q.lower(z[k + 1]) * q.inv);
        z[k] = p.upper(z[k] - (self.next[k] * z[k + 1]) * p.inv);
        for k in (first + both..hi - 2).rev() {
            let p = &self.pivots[k];
            let tied = self
                .tie(k, true)
                .map_or(DVec3::ZERO, |e| self.links[e].back(p, z[k], part * self.right[e], z[k + 1], z[k + 2]));
            z[k] = p.upper(z[k] - (self.next[k] * z[k + 1] + self.after[k] * z[k + 2]) * p.inv - tied);
        }
        for k in hi..top - both {
            let p = &self.pivots[k];
            let tied = self
                .tie(k, false)
                .map_or(DVec3::ZERO, |e| self.links[e].back(p, z[k], part * self.right[e], z[k - 1], z[k - 2]));
            z[k] = p.upper(z[k] - (self.next[k - 1] * z[k - 1] + self.after[k - 2] * z[k - 2]) * p.inv - tied);
        }
        if self.tied[blocks.start] {
            self.backward_both::<true>(first, top - 1, both, z, part);
        } else {
            self.backward_both::<false>(first, top - 1, both, z, part);
        }
    }

    /// Solves for six right sides at once, of a rod without multipliers: the nodes wait for one another, the right
    /// sides do not. `z` has the nodes of the rod, of which all but those of `loaded` are zero.
    pub fn solve_six(&self, blocks: &Range<usize>, zone: &Range<usize>, z: &mut [Six], loaded: Range<usize>) {
        let base = 2 * blocks.start;
        let (lo, hi) = (2 * zone.start - base, 2 * zone.end - base);
        let end = 2 * blocks.end - base;
        let pivot = |k: usize| &self.pivots[base + k];
        let (next, after) = (|k: usize| &self.next[base + k], |k: usize| &self.after[base + k]);
        for k in (hi..loaded.end.max(hi)).rev() {
            let (p, n, a) = (pivot(k), next(k - 1), after(k - 2));
            for c in 0..6 {
                let s = p.lower(z[k][c]) * p.inv;
                z[k][c] = s;
                z[k - 1][c] -= t_vec(n, s);
                z[k - 2][c] -= t_vec(a, s);
            }
        }
        for k in loaded.start.min(lo)..hi - 2 {
            let (p, n, a) = (pivot(k), next(k), after(k));
            for c in 0..6 {
                let s = p.lower(z[k][c]) * p.inv;
                z[k][c] = s;
                z[k + 1][c] -= t_vec(n, s);
                z[k + 2][c] -= t_vec(a, s);
            }
        }
        let k = hi - 2;
        let (p, q, n) = (pivot(k), pivot(k + 1), next(k));
        for c in 0..6 {
            let s = p.lower(z[k][c]) * p.inv;
            z[k + 1][c] = q.upper(q.lower(z[k + 1][c] - t_vec(n, s)) * q.inv);
            z[k][c] = p.upper(s - (*n * z[k + 1][c]) * p.inv);
        }
        for k in (0..hi - 2).rev() {
            let (p, n, a) = (pivot(k), next(k), after(k));
            for c in 0..6 {
                z[k][c] = p.upper(z[k][c] - (*n * z[k + 1][c] + *a * z[k + 2][c]) * p.inv);
            }
        }
        for k in hi..end {
            let (p, n, a) = (pivot(k), next(k - 1), after(k - 2));
            for c in 0..6 {
                z[k][c] = p.upper(z[k][c] - (*n * z[k - 1][c] + *a * z[k - 2][c]) * p.inv);
            }
        }
    }

    fn forward_up(&self, nodes: Range<usize>, z: &mut [DVec3], part: f64) {
        for k in nodes {
            let p = &self.pivots[k];
            z[k] = p.lower(z[k]) * p.inv;
            let s = z[k];
            z[k + 1] -= t_vec(&self.next[k], s);
            z[k + 2] -= t_vec(&self.after[k], s);
            if let Some(e) = self.tie(k, true) {
                let (next, after) = self.links[e].forward(s, part * self.right[e]);
                z[k + 1] += next;
                z[k + 2] += after;
            }
        }
    }

    fn forward_down(&self, nodes: Range<usize>, z: &mut [DVec3], part: f64) {
        for k in nodes.rev() {
            let p = &self.pivots[k];
            z[k] = p.lower(z[k]) * p.inv;
            let s = z[k];
            z[k - 1] -= t_vec(&self.next[k - 1], s);
            z[k - 2] -= t_vec(&self.after[k - 2], s);
            if let Some(e) = self.tie(k, false) {
                let (next, after) = self.links[e].forward(s, part * self.right[e]);
                z[k - 1] += next;
                z[k - 2] += after;
            }
        }
    }

    /// The multipliers of both ends at particles `k` and `m`.
    #[inline(always)]
    fn links(&self, k: usize, m: usize) -> Link2 {
        let of = |e: usize| (self.links[e], self.right[e]);
        Link2::join(&of(k / 2), &of(m / 2 - 1))
    }

    fn forward_both<const TIED: bool>(&self, low: usize, high: usize, count: usize, z: &mut [DVec3], part: f64) {
        if count == 0 {
            return;
        }
        let mut z0 = Vec2::load(z[low], z[high]);
        let mut z1 = Vec2::load(z[low + 1], z[high - 1]);
        for i in 0..count {
            let (k, m) = (low + i, high - i);
            let p = Pivot2::join(&self.pivots[k], &self.pivots[m]);
            let s = p.lower(&z0).times(&p.inv);
            (z[k], z[m]) = s.split();
            z0 = z1.less_t_vec(&Mat2::pair(&self.next[k], &self.next[m - 1]), &s);
            z1 = Vec2::load(z[k + 2], z[m - 2]).less_t_vec(&Mat2::pair(&self.after[k], &self.after[m - 2]), &s);
            if TIED && i.is_multiple_of(2) {
                let link = self.links(k, m);
                let t = (link.right * part - link.own.dot(&s)) * link.inv;
                (z0, z1) = (z0.plus(&link.next, t), z1.plus(&link.after, t));
            }
        }
        let (k, m) = (low + count, high - count);
        (z[k], z[m]) = z0.split();
        (z[k + 1], z[m - 1]) = z1.split();
    }

    fn backward_both<const TIED: bool>(&self, low: usize, high: usize, count: usize, z: &mut [DVec3], part: f64) {
        if count == 0 {
            return;
        }
        let (k, m) = (low + count, high - count);
        let mut z1 = Vec2::load(z[k], z[m]);
        let mut z2 = Vec2::load(z[k + 1], z[m - 1]);
        for i in (0..count).rev() {
            let (k, m) = (low + i, high - i);
            let p = Pivot2::join(&self.pivots[k], &self.pivots[m]);
            // The node two away is known before the one next to it.
            let far = Mat2::pair(&self.after[k], &self.after[m - 2]).times(&z2);
            let near = Mat2::pair(&self.next[k], &self.next[m - 1]).times(&z1);
            let s = Vec2::load(z[k], z[m]);
            let mut left = s.less(&far.times(&p.inv)).less(&near.times(&p.inv));
            if TIED && i.is_multiple_of(2) {
                let link = self.links(k, m);
                let t = (link.next.dot(&z1) + link.after.dot(&z2) + link.own.dot(&s) - link.right * part) * link.inv;
                left = left.plus(&link.own.times(&p.inv), -t);
            }
            z2 = z1;
            z1 = p.upper(&left);
            (z[k], z[m]) = z1.split();
        }
    }

    /// Inverse of the matrix at the zone's diagonal blocks, and the transfers between neighboring ones (Takahashi's
    /// recursion): X_ii = D_i^-1 + K_i X_{i+1,i+1} K_i^T, X_ij = -K_i X_{i+1,j} for i < j.
    pub fn invert_zone(&mut self, zone: &Range<usize>) {
        for i in zone.clone().rev() {
            let (px, pt) = (self.pivots[2 * i], self.pivots[2 * i + 1]);
            // Inverse of the pivot block [[dx, n], [n^T, dt]]: theta's own pivot is already the Schur complement.
            let tt = pt.solve_mat(&DMat3::IDENTITY);
            let mut n = px.upper_mat(&scale_rows(&self.next[2 * i], px.inv));
            let mut alone = px.solve_mat(&DMat3::IDENTITY);
            let link = self.tie(2 * i, true).filter(|_| i + 1 < zone.end).map(|e| self.links[e]);
            // A multiplier takes motions along it out of the particle's own inverse.
            let along = link.map_or(DVec3::ZERO, |link| px.upper(link.own * px.inv));
            if let Some(link) = link {
                n += outer(along, link.next * link.inv);
                alone -= outer(along, along * link.inv);
            }
            let xt = -(n * tt);
            let own = Block { xx: alone - xt * n.transpose(), xt, tx: xt.transpose(), tt };
            if i + 1 == zone.end {
                self.inverse[i] = own;
                continue;
            }
            // theta_i = -(t1 x' + t2 theta'), x_i = -(n theta_i + m x').
            let t1 = pt.upper_mat(&scale_rows(&self.next[2 * i + 1], pt.inv));
            let t2 = pt.upper_mat(&scale_rows(&self.after[2 * i + 1], pt.inv));
            let mut m = px.upper_mat(&scale_rows(&self.after[2 * i], px.inv));
            if let Some(link) = link {
                m += outer(along, link.after * link.inv);
            }
            let k = Block { xx: m - n * t1, xt: -(n * t2), tx: t1, tt: t2 };
            self.inverse[i] = own.add(&k.mul(&self.inverse[i + 1]).mul(&k.transpose()));
            self.transfer[i] = k;
        }
    }

    /// The matrix at zone block `i` and from it to the next, as left by the elimination of what is before it in the
    /// zone and beyond the zone.
    pub fn zone_block(&self, i: usize) -> (Block, Block) {
        let (px, pt) = (&self.pivots[2 * i], &self.pivots[2 * i + 1]);
        let w = &self.next[2 * i];
        let own = Block {
            xx: px.whole(),
            xt: px.times_lower(w),
            tx: DMat3::ZERO,
            tt: pt.whole() + t_mul(w, &scale_rows(w, px.inv)),
        };
        let v = &self.after[2 * i];
        let to = Block {
            xx: px.times_lower(v),
            xt: DMat3::ZERO,
            tx: pt.times_lower(&self.next[2 * i + 1]) + t_mul(w, &scale_rows(v, px.inv)),
            tt: pt.times_lower(&self.after[2 * i + 1]),
        };
        (own, to)
    }

    /// Inverse at zone block `i`.
    pub fn inverse(&self, i: usize) -> &Block {
        &self.inverse[i]
    }
    /// `k` in `z_i = -k z_{i+1}` for a right side that is zero at and before block `i`.
    pub fn transfer(&self, i: usize) -> &Block {
        &self.transfer[i]
    }
}

#[inline(always)]
fn t_vec(a: &DMat3, v: DVec3) -> DVec3 {
    DVec3::new(a.x_axis.dot(v), a.y_axis.dot(v), a.z_axis.dot(v))
}

/// How many nodes are eliminated from each end at the same time. The two ends must not touch the same nodes, so the
/// last two before the zone are left to be eliminated one by one.
fn both(blocks: &Range<usize>, zone: &Range<usize>) -> usize {
    (2 * (zone.start - blocks.start).min(blocks.end - zone.end)).saturating_sub(2)
}

impl Vec2 {
    /// `self - a^T v`.
    #[inline(always)]
    fn less_t_vec(&self, a: &Mat2, v: &Vec2) -> Vec2 {
        Vec2 { x: self.x - a.cols[0].dot(v), y: self.y - a.cols[1].dot(v), z: self.z - a.cols[2].dot(v) }
    }
}

/// Two matrices in the lanes of one.
#[derive(Clone, Copy)]
struct Mat2 {
    cols: [Vec2; 3],
}

impl Mat2 {
    #[inline(always)]
    fn pair(low: &DMat3, high: &DMat3) -> Self {
        Mat2 {
            cols: [
                Vec2::load(low.x_axis, high.x_axis),
                Vec2::load(low.y_axis, high.y_axis),
                Vec2::load(low.z_axis, high.z_axis),
            ],
        }
    }
    /// The coupling of a node to a higher one, and, transposed, that of a node to a lower one.
    #[inline(always)]
    fn load(low: &DMat3, high: &DMat3) -> Self {
        let row =
            |l: DVec3, h0: f64, h1: f64, h2: f64| Vec2 { x: lanes(l.x, h0), y: lanes(l.y, h1), z: lanes(l.z, h2) };
        Mat2 {
            cols: [
                row(low.x_axis, high.x_axis.x, high.y_axis.x, high.z_axis.x),
                row(low.y_axis, high.x_axis.y, high.y_axis.y, high.z_axis.y),
                row(low.z_axis, high.x_axis.z, high.y_axis.z, high.z_axis.z),
            ],
        }
    }
    /// Two symmetric matrices.
    #[inline(always)]
    fn symmetric(low: &DMat3, high: &DMat3) -> Self {
        let (xx, yy, zz) = (
            lanes(low.x_axis.x, high.x_axis.x),
            lanes(low.y_axis.y, high.y_axis.y),
            lanes(low.z_axis.z, high.z_axis.z),
        );
        let (xy, xz, yz) = (
            lanes(low.x_axis.y, high.x_axis.y),
            lanes(low.x_axis.z, high.x_axis.z),
            lanes(low.y_axis.z, high.y_axis.z),
        );
        Mat2 { cols: [Vec2 { x: xx, y: xy, z: xz }, Vec2 { x: xy, y: yy, z: yz }, Vec2 { x: xz, y: yz, z: zz }] }
    }
    #[inline(always)]
    fn store(&self, to: &mut [DMat3], low: usize, high: usize) {
        let [(xl, xh), (yl, yh), (zl, zh)] = self.cols.each_ref().map(Vec2::split);
        to[low] = DMat3::from_cols(xl, yl, zl);
        to[high] = DMat3::from_cols(xh, yh, zh);
    }
    #[inline(always)]
    fn scale_rows(&self, s: &Vec2) -> Mat2 {
        Mat2 { cols: self.cols.each_ref().map(|c| c.times(s)) }
    }
    #[inline(always)]
    fn times(&self, v: &Vec2) -> Vec2 {
        let [a, b, c] = &self.cols;
        Vec2 {
            x: a.x * v.x + b.x * v.y + c.x * v.z,
            y: a.y * v.x + b.y * v.y + c.y * v.z,
            z: a.z * v.x + b.z * v.y + c.z * v.z,
        }
    }
    /// `self + a b^T`.
    #[inline(always)]
    fn plus_product(&self, a: &Vec2, b: &Vec2) -> Mat2 {
        let [x, y, z] = &self.cols;
        Mat2 { cols: [x.plus(a, b.x), y.plus(a, b.y), z.plus(a, b.z)] }
    }
    /// `self - w^T s`.
    #[inline(always)]
    fn less_product(&self, w: &Mat2, s: &Mat2) -> Mat2 {
        Mat2 { cols: [0, 1, 2].map(|j: usize| self.cols[j].less_t_vec(w, &s.cols[j])) }
    }
    /// The same where the result is symmetric.
    #[inline(always)]
    fn less_square(&self, w: &Mat2, s: &Mat2) -> Mat2 {
        let [wx, wy, wz] = &w.cols;
        let [sx, sy, sz] = &s.cols;
        let [a, b, c] = &self.cols;
        let (xx, xy, xz) = (a.x - wx.dot(sx), a.y - wy.dot(sx), a.z - wz.dot(sx));
        let (yy, yz, zz) = (b.y - wy.dot(sy), b.z - wz.dot(sy), c.z - wz.dot(sz));
        Mat2 { cols: [Vec2 { x: xx, y: xy, z: xz }, Vec2 { x: xy, y: yy, z: yz }, Vec2 { x: xz, y: yz, z: zz }] }
    }
}

/// Two multipliers in the lanes of one.
struct Link2 {
    own: Vec2,
    next: Vec2,
    after: Vec2,
    inv: f64x2,
    right: f64x2,
}

impl Link2 {
    #[inline(always)]
    fn join((low, l): &(Link, f64), (high, h): &(Link, f64)) -> Self {
        Link2 {
            own: Vec2::load(low.own, high.own),
            next: Vec2::load(low.next, high.next),
            after: Vec2::load(low.after, high.after),
            inv: lanes(low.inv, high.inv),
            right: lanes(*l, *h),
        }
    }
}

/// Two pivots in the lanes of one.
struct Pivot2 {
    l10: f64x2,
    l20: f64x2,
    l21: f64x2,
    inv: Vec2,
}

impl Pivot2 {
    #[inline(always)]
    fn new(a: &Mat2) -> Self {
        let [x, y, z] = &a.cols;
        let one = f64x2::splat(1.0);
        let i0 = one / x.x;
        let (l10, l20) = (x.y * i0, x.z * i0);
        let i1 = one / (y.y - l10 * x.y);
        let c21 = y.z - l20 * x.y;
        let l21 = c21 * i1;
        let d2 = z.z - l20 * x.z - l21 * c21;
        Pivot2 { l10, l20, l21, inv: Vec2 { x: i0, y: i1, z: one / d2 } }
    }
    #[inline(always)]
    fn join(low: &Pivot, high: &Pivot) -> Self {
        Pivot2 {
            l10: lanes(low.l10, high.l10),
            l20: lanes(low.l20, high.l20),
            l21: lanes(low.l21, high.l21),
            inv: Vec2::load(low.inv, high.inv),
        }
    }
    #[inline(always)]
    fn split(&self) -> (Pivot, Pivot) {
        let (l10, l20, l21, inv) = (self.l10.to_array(), self.l20.to_array(), self.l21.to_array(), self.inv.split());
        (
            Pivot { l10: l10[0], l20: l20[0], l21: l21[0], inv: inv.0 },
            Pivot { l10: l10[1], l20: l20[1], l21: l21[1], inv: inv.1 },
        )
    }
    #[inline(always)]
    fn lower(&self, v: &Vec2) -> Vec2 {
        let y = v.y - self.l10 * v.x;
        Vec2 { x: v.x, y, z: v.z - self.l20 * v.x - self.l21 * y }
    }
    #[inline(always)]
    fn upper(&self, v: &Vec2) -> Vec2 {
        let y = v.y - self.l21 * v.z;
        Vec2 { x: v.x - self.l10 * y - self.l20 * v.z, y, z: v.z }
    }
    #[inline(always)]
    fn lower_mat(&self, m: &Mat2) -> Mat2 {
        Mat2 { cols: m.cols.each_ref().map(|c| self.lower(c)) }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A pseudo-random symmetric positive definite system of `n` blocks whose stiffnesses spread over eight decades.
    pub(crate) fn sample(n: usize) -> System {
        let mut seed = 0x9e37_79b9_7f4a_7c15_u64;
        let mut rnd = move || {
            seed ^= seed << 13;
            seed ^= seed >> 7;
            seed ^= seed << 17;
            (seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        let mut s = System::default();
        s.resize(n);
        // A sum of rank-one terms j j^T over three neighboring nodes keeps the pattern and is positive.
        for k in 0..2 * n {
            s.diagonal[k] = DMat3::IDENTITY * 1e-3;
        }
        for k in 0..2 * n - 2 {
            for w in [1e5, 1.0, 1e-2, 1e-2, 3.0] {
                let j: Vec<DVec3> = (0..3).map(|_| DVec3::new(rnd(), rnd(), rnd())).collect();
                for a in 0..3 {
                    s.diagonal[k + a] += outer(j[a], j[a]) * w;
                }
                s.next[k] += outer(j[0], j[1]) * w;
                s.next[k + 1] += outer(j[1], j[2]) * w;
                s.after[k] += outer(j[0], j[2]) * w;
            }
        }
        s
    }

    fn multiply(s: &System, z: &[DVec3]) -> Vec<DVec3> {
        let n = z.len();
        (0..n)
            .map(|k| {
                let mut y = s.diagonal[k] * z[k];
                if k + 1 < n {
                    y += s.next[k] * z[k + 1];
                }
                if k + 2 < n {
                    y += s.after[k] * z[k + 2];
                }
                if k >= 1 {
                    y += s.next[k - 1].transpose() * z[k - 1];
                }
                if k >= 2 {
                    y += s.after[k - 2].transpose() * z[k - 2];
                }
                y
            })
            .collect()
    }

    #[test]
    fn solves_for_every_zone() {
        let n = 11;
        for lo in 0..n {
            for hi in lo + 1..=n {
                let s = sample(n);
                let mut f = sample(n);
                f.factor(0..n, &(lo..hi));
                let want: Vec<DVec3> = (0..2 * n).map(|k| DVec3::new(k as f64, 1.0, -0.5 * k as f64)).collect();
                let mut z = multiply(&s, &want);
                f.solve(0..n, &(lo..hi), &mut z);
                let err = z.iter().zip(&want).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max);
                // Condition about 1e9, so nine digits may go.
                assert!(err < 1e-6, "zone {lo}..{hi}: {err:e}");
            }
        }
    }

    #[test]
    fn six_right_sides_at_once_give_what_each_gives_alone() {
        let n = 11;
        for (lo, hi, loaded) in
            [(0, 1, 20..22), (5, 6, 19..22), (5, 7, 0..3), (10, 11, 4..18), (3, 9, 0..22), (2, 3, 9..10)]
        {
            let mut f = sample(n);
            f.factor(0..n, &(lo..hi));
            let mut six = vec![[DVec3::ZERO; 6]; 2 * n];
            for k in loaded.clone() {
                six[k] = core::array::from_fn(|c| DVec3::new(1.0 + c as f64, k as f64, -1.0));
            }
            let alone: Vec<Vec<DVec3>> = (0..6)
                .map(|c| {
                    let mut z: Vec<DVec3> = six.iter().map(|v| v[c]).collect();
                    f.solve(0..n, &(lo..hi), &mut z);
                    z
                })
                .collect();
            f.solve_six(&(0..n), &(lo..hi), &mut six, loaded.clone());
            let size = alone.iter().flatten().map(|v| v.length()).fold(0.0, f64::max);
            for (c, z) in alone.iter().enumerate() {
                let err = z.iter().zip(&six).map(|(a, b)| (*a - b[c]).length()).fold(0.0, f64::max);
                assert!(err < 1e-9 * size, "zone {lo}..{hi}, loaded {loaded:?}: {err:e} of {size:e}");
            }
        }
    }

    /// Gives the elements multipliers, and puts what they come to into the matrix of the other.
    fn tie(f: &mut System, condensed: &mut System, n: usize) {
        for e in 0..n - 1 {
            let x = e as f64;
            let (a, b) = (DVec3::new(0.3 + 0.1 * x, -0.5, 0.2 * x), DVec3::new(-0.4, 0.6 - 0.1 * x, 0.3));
            let give = 0.03 * (x + 1.0);
            f.ties[e] = ([a, b], give);
            condensed.diagonal[2 * e] += outer(a, a) / give;
            condensed.diagonal[2 * e + 2] += outer(b, b) / give;
            condensed.after[2 * e] += outer(a, b) / give;
        }
        f.tied.fill(true);
        // The last frame is no element's.
        for s in [f, condensed] {
            (s.next[2 * n - 2], s.after[2 * n - 3]) = (DMat3::ZERO, DMat3::ZERO);
        }
    }

    #[test]
    fn multipliers_are_stiffnesses_in_the_matrix() {
        let n = 11;
        for lo in 0..n {
            for hi in lo + 1..=n {
                let (mut f, mut s) = (sample(n), sample(n));
                tie(&mut f, &mut s, n);
                assert!(f.factor(0..n, &(lo..hi)));
                let want: Vec<DVec3> = (0..2 * n).map(|k| DVec3::new(k as f64, 1.0, -0.5 * k as f64)).collect();
                let mut z = multiply(&s, &want);
                f.solve(0..n, &(lo..hi), &mut z);
                let err = z.iter().zip(&want).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max);
                // As without.
                assert!(err < 1e-6, "zone {lo}..{hi}: {err:e}");
            }
        }
    }

    #[test]
    fn zone_inverse_is_the_inverse() {
        for tied in [false, true] {
            compare_inverse(tied);
        }
    }

    fn compare_inverse(tied: bool) {
        let n = 11;
        let zone = 2..6;
        let mut f = sample(n);
        if tied {
            tie(&mut f, &mut sample(n), n);
        }
        f.factor(0..n, &zone);
        f.invert_zone(&zone);
        for j in zone.clone() {
            for axis in 0..3 {
                let mut z = vec![DVec3::ZERO; 2 * n];
                z[2 * j][axis] = 1.0;
                f.solve(0..n, &zone, &mut z);
                // Down the column from the diagonal block by transfers.
                let mut x = f.inverse(j).xx.col(axis);
                let mut t = f.inverse(j).tx.col(axis);
                for i in (zone.start..=j).rev() {
                    if i < j {
                        let k = f.transfer(i);
                        (x, t) = (-(k.xx * x + k.xt * t), -(k.tx * x + k.tt * t));
                    }
                    let scale = z[2 * i].length().max(z[2 * i + 1].length());
                    assert!(
                        (x - z[2 * i]).length() < 1e-8 * scale && (t - z[2 * i + 1]).length() < 1e-8 * scale,
                        "block {i},{j}"
                    );
                }
            }
        }
    }
}
