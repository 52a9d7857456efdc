//! Unknowns that several rods share: where a pushed shape is on its line, where a weld is and how it is turned. They
//! border the rods' system,
//!
//! ```text
//! [ H   B ] [dz]   [r]
//! [ B^T D ] [dy] = [s]
//! ```
//!
//! and are eliminated last: `dy = (D - B^T H^-1 B)^-1 (s - B^T z)`, `dz = z - H^-1 B dy` with `z = H^-1 r`. What an
//! unknown is and which forces act on it is in [`movers`](crate::row::movers), [`weld`](crate::row::weld) and
//! [`joint`](crate::row::joint). The last of them may be multipliers of constraints, whose pivots are negative.

use crate::math::solve_dense;
use crate::rod::constraint::NodeConstraint;
use crate::rod::factor::{Six, System};
use crate::row::ldl::Ldl;
use core::ops::Range;
use glam::DVec3;

/// One unknown.
#[derive(Default)]
struct Column {
    /// Its column of B, node by node; a node may come more than once.
    links: Vec<(usize, DVec3)>,
    /// Places that move with it: nodes without an unknown of their own.
    carried: Vec<(usize, DVec3)>,
    /// H^-1 B, and minus the motion of what it carries: what a unit of it takes away from z.
    response: Vec<DVec3>,
    /// Force on it, and that of the small contact problem.
    right: f64,
    load: f64,
    /// Its change in this Newton iteration.
    step: f64,
}

/// The shared unknowns of a Newton iteration.
#[derive(Default)]
pub(crate) struct Border {
    columns: Vec<Column>,
    count: usize,
    /// The first multiplier.
    multipliers: usize,
    /// D, and the Schur complement, row after row.
    own: Vec<f64>,
    schur: Vec<f64>,
    /// The factor of the Schur complement where its pivots have the signs that they should have.
    factor: Ldl,
    positive: bool,
    dense: Vec<f64>,
    small: Vec<f64>,
    /// The factor for a part of the unknowns that the others do not depend on.
    part: Ldl,
    part_positive: bool,
    /// Responses of six unknowns together.
    six: Vec<Six>,
}

/// Finds the responses of a rod to six unknowns, which begin as what pushes it.
fn respond_together(
    system: &System,
    rod: &Range<usize>,
    zone: &Range<usize>,
    columns: &mut [Column],
    z: &mut Vec<Six>,
) {
    let (first, last) = (2 * rod.start, 2 * rod.end);
    let linked = || columns.iter().flat_map(|c| &c.links).map(|(node, _)| *node).filter(|k| (first..last).contains(k));
    let (Some(least), Some(most)) = (linked().min(), linked().max()) else { return };
    z.clear();
    z.resize(last - first, [DVec3::ZERO; 6]);
    for k in least..=most {
        z[k - first] = core::array::from_fn(|c| columns[c].response[k]);
    }
    system.solve_six(rod, zone, z, least - first..most + 1 - first);
    for (c, column) in columns.iter_mut().enumerate() {
        for (to, from) in column.response[first..last].iter_mut().zip(&*z) {
            *to = from[c];
        }
    }
}

impl Border {
    /// Makes `moving` unknowns that nothing links or pushes, and multipliers after them. Their last steps, and the
    /// contact forces found in them, are kept.
    pub fn clear(&mut self, moving: usize, multipliers: usize) {
        let count = moving + multipliers;
        self.multipliers = moving;
        if self.columns.len() < count {
            self.columns.resize_with(count, Column::default);
        }
        self.count = count;
        for c in &mut self.columns[..count] {
            c.links.clear();
            c.carried.clear();
            c.right = 0.0;
        }
        self.own.clear();
        self.own.resize(count * count, 0.0);
    }

    pub fn count(&self) -> usize {
        self.count
    }
    /// Adds `v` to the coupling of unknown `k` with a node.
    pub fn link(&mut self, k: usize, node: usize, v: DVec3) {
        self.columns[k].links.push((node, v));
    }
    /// Couplings of unknown `k` with nodes so far.
    pub fn links_mut(&mut self, k: usize) -> &mut Vec<(usize, DVec3)> {
        &mut self.columns[k].links
    }
    /// A node that moves by `v` with each unit of unknown `k`.
    pub fn carry(&mut self, k: usize, node: usize, v: DVec3) {
        self.columns[k].carried.push((node, v));
    }
    /// Adds to the coupling of two unknowns, in one direction.
    pub fn add_own(&mut self, i: usize, j: usize, v: f64) {
        self.own[i * self.count + j] += v;
    }
    /// Adds a force to the right side of unknown `k`.
    pub fn push(&mut self, k: usize, force: f64) {
        self.columns[k].right += force;
    }
    /// Adds a force of the small contact problem.
    pub fn load(&mut self, k: usize, force: f64) {
        self.columns[k].load += force;
    }
    /// Adds those on the nodes that the unknowns carry.
    pub fn load_carried(&mut self, right: &[DVec3]) {
        for c in &mut self.columns[..self.count] {
            c.load += inner(&c.carried, right);
        }
    }
    /// Change of unknown `k` in this Newton iteration so far.
    pub fn step(&self, k: usize) -> f64 {
        self.columns[k].step
    }
    /// Exchanges the changes of all unknowns in this iteration for others, at first none.
    pub fn swap_steps(&mut self, steps: &mut Vec<f64>) {
        steps.resize(self.count, 0.0);
        for (c, s) in self.columns[..self.count].iter_mut().zip(steps) {
            core::mem::swap(&mut c.step, s);
        }
    }
    /// Adds to the changes of all unknowns.
    pub fn add_steps(&mut self, steps: &[f64]) {
        for (c, s) in self.columns[..self.count].iter_mut().zip(steps) {
            c.step += s;
        }
    }
    /// What a unit of unknown `k` takes away from the step of the rods.
    pub fn response(&self, k: usize) -> &[DVec3] {
        &self.columns[k].response
    }

    /// Takes what is held out of B and finds the responses; the rods' system is factored. `sixes` are unknowns of which
    /// six at a time are linked to much the same nodes. False when the whole is not positive definite, but for the
    /// multipliers.
    pub fn factor(
        &mut self,
        system: &System,
        rods: &[(Range<usize>, Range<usize>)],
        constraint: &[NodeConstraint],
        sixes: Range<usize>,
    ) -> bool {
        let n = self.count;
        for (k, c) in self.columns[..n].iter_mut().enumerate() {
            c.response.clear();
            c.response.resize(constraint.len(), DVec3::ZERO);
            for (node, v) in &mut c.links {
                if constraint[*node] != NodeConstraint::Free {
                    *v = constraint[*node].projector() * *v;
                }
                c.response[*node] += *v;
            }
            for (rod, zone) in rods {
                if sixes.contains(&k) && !system.tied[rod.start] {
                    continue;
                }
                if c.response[2 * rod.start..2 * rod.end].iter().any(|v| *v != DVec3::ZERO) {
                    system.solve(rod.clone(), zone, &mut c.response);
                }
            }
        }
        for (rod, zone) in rods.iter().filter(|(rod, _)| !system.tied[rod.start]) {
            for six in self.columns[sixes.clone()].chunks_exact_mut(6) {
                respond_together(system, rod, zone, six, &mut self.six);
            }
        }
        for c in &mut self.columns[..n] {
            for (node, v) in &c.carried {
                c.response[*node] = -*v;
            }
        }
        self.schur.clear();
        for i in 0..n {
            for j in 0..n {
                self.schur.push(self.own[i * n + j] - inner(&self.columns[i].links, &self.columns[j].response));
            }
        }
        self.factor.clear();
        let sign = |i: usize| if i < self.multipliers { 1.0 } else { -1.0 };
        self.positive =
            (0..n).all(|i| self.factor.push_signed(self.schur[i * n..i * n + i + 1].iter().copied(), sign(i)));
        self.positive
    }

    /// `schur^-1 v` for a vector over the unknowns. False when there is none.
    pub fn solve_small(&mut self, v: &mut [f64]) -> bool {
        if self.positive {
            self.factor.solve(v);
            return true;
        }
        self.dense.clone_from(&self.schur);
        solve_dense(&mut self.dense, v, self.count)
    }

    /// Unknowns that depend on unknown `k`, by themselves or through rods.
    pub fn coupled(&self, k: usize) -> impl Iterator<Item = usize> + use<'_> {
        let row = &self.schur[k * self.count..(k + 1) * self.count];
        row.iter().enumerate().filter(|(_, v)| **v != 0.0).map(|(j, _)| j)
    }

    /// Whether unknown `k` is linked to a rod, or carries a node of it.
    pub fn links_rod(&self, k: usize, blocks: &Range<usize>) -> bool {
        let Column { links, carried, .. } = &self.columns[k];
        links.iter().chain(carried).any(|(node, _)| blocks.contains(&(node / 2)))
    }

    /// Prepares for solutions of some of the unknowns, which do not depend on the others.
    pub fn begin_part(&mut self, unknowns: &[u32]) {
        let n = self.count;
        if unknowns.len() == n {
            return;
        }
        let Border { part, schur, multipliers, .. } = self;
        part.clear();
        let sign = |i: u32| if (i as usize) < *multipliers { 1.0 } else { -1.0 };
        self.part_positive = unknowns.iter().enumerate().all(|(k, i)| {
            part.push_signed(unknowns[..=k].iter().map(|j| schur[*i as usize * n + *j as usize]), sign(*i))
        });
    }

    /// `schur^-1 v` for a vector over these unknowns.
    pub fn solve_part(&mut self, unknowns: &[u32], v: &mut [f64]) {
        if unknowns.len() == self.count {
            self.solve_small(v);
        } else if self.part_positive {
            self.part.solve(v);
        } else {
            let mut all = vec![0.0; self.count];
            unknowns.iter().zip(&*v).for_each(|(k, x)| all[*k as usize] = *x);
            self.solve_small(&mut all);
            unknowns.iter().zip(v).for_each(|(k, x)| *x = all[*k as usize]);
        }
    }

    /// Couples a solution `z` of the rods alone with the unknowns under their own forces, or under those of the small
    /// contact problem.
    pub fn couple(&mut self, z: &mut [DVec3], contacts: bool) {
        let n = self.count;
        if n == 0 {
            return;
        }
        let mut small = core::mem::take(&mut self.small);
        small.clear();
        small.extend(self.columns[..n].iter().map(|c| if contacts { c.load } else { c.right } - inner(&c.links, z)));
        if !self.solve_small(&mut small) {
            small.fill(0.0);
        }
        {
            for (c, y) in self.columns[..n].iter_mut().zip(&small) {
                c.step = if contacts { c.step + y } else { *y };
                c.load = 0.0;
                for (z, r) in z.iter_mut().zip(&c.response) {
                    *z -= *r * *y;
                }
            }
        }
        self.small = small;
    }

    /// Work of the forces on what moves, without those of the small contact problem, along its last step.
    pub fn work(&self) -> f64 {
        self.columns[..self.multipliers].iter().map(|c| c.right * c.step).sum()
    }

    /// What the change of a multiplier in the last step takes off the work of the forces along it.
    pub fn work_of_constraint(&self, k: usize) -> f64 {
        let c = &self.columns[k];
        c.step * (c.right - self.own[k * self.count + k] * c.step)
    }
}

fn inner(links: &[(usize, DVec3)], z: &[DVec3]) -> f64 {
    links.iter().map(|(node, v)| v.dot(z[*node])).sum()
}
