//! The Delassus matrix never put together: for many contacts. A working set is added to the rods' matrix A in the zones
//! as springs of the contacts' own compliance, H = A + G^T B G, and that is factored by blocks of six (a particle with
//! its frame), multifrontally, in an order of least degree. Threads that touch have a narrow graph whatever the number
//! of contacts (along two strands wound about each other fronts are some four blocks wide), so the cost is linear in
//! it. With w = S l + b the gradient and B the force per gap of a contact of the set,
//!
//! ```text
//! (A + G^T B G) z = -G^T B w,      change of the forces = -B (w + G z),
//! ```
//!
//! which by elimination of z is the working set's own equation. Pivots are safe without exchange: A is positive
//! definite, and contacts are about as stiff as stretch. What did not change since the last factorization, and all that
//! it was eliminated into, is not factored again.

use crate::rod::factor::{Block, System};
use crate::row::delassus::{Delassus, Friction, WorkingSet};
use core::ops::Range;
use glam::{DMat3, DVec3};

/// Six by six, row after row.
type Mat6 = [f64; 36];
type Vec6 = [f64; 6];

/// A contact: the nodes that it touches, its components there as columns on their positions, and what it adds.
#[derive(Debug, Clone, Copy)]
struct Place {
    count: usize,
    node: [u32; 4],
    jacobian: [DMat3; 4],
    compliance: DVec3,
    /// Diagonal of S.
    diagonal: DVec3,
    /// Force per gap, as factored.
    spring: DMat3,
    /// First of its nodes in the order of elimination.
    owner: u32,
}

/// An eliminated node: the later ones that it is coupled to, in order of elimination, and where its (1 + up)^2 blocks
/// are.
#[derive(Debug, Clone, Default)]
struct Front {
    up: Range<usize>,
    at: usize,
    /// The first of `up`, which takes what this one leaves; none of the last.
    parent: Option<u32>,
    /// Its part of `owned`.
    sites: Range<usize>,
}

/// The matrix of the rods in the zones, the contacts, and the factorization of both.
#[derive(Default)]
pub(crate) struct Sparse {
    /// First block of each zone, and its node.
    zones: Vec<(usize, usize)>,
    diagonal: Vec<Mat6>,
    /// Coupling of each node to the next one, zero at the end of a zone.
    next: Vec<Option<Mat6>>,
    sites: Vec<Place>,
    fronts: Vec<Front>,
    ups: Vec<u32>,
    owned: Vec<u32>,
    data: Vec<Mat6>,
    /// The same for the rods alone.
    bare: Vec<Mat6>,
    /// First node in the order that a contact touches.
    first_touched: usize,
    dirty: Vec<bool>,
    y: Vec<Vec6>,
    /// Of nodes next to contacts that entered: in which round.
    taken: Vec<u32>,
    round: u32,
    order: Order,
    spent: f64,
}

/// An order of elimination and the memory of its search.
#[derive(Default)]
struct Order {
    /// Nodes in order, and the place of each in it.
    nodes: Vec<u32>,
    place: Vec<u32>,
    /// The graph that it was found for, as numbers, and that of now.
    graph: Vec<u32>,
    now: Vec<u32>,
    adjacent: Vec<Vec<u32>>,
    touched: Vec<bool>,
    left: Vec<u32>,
    then: Vec<u32>,
    blocked: Vec<u32>,
    by_owner: Vec<(u32, u32)>,
}

impl Sparse {
    /// Takes the rods' matrix in these zones from its factor.
    pub fn begin<'a>(&mut self, system: &System, zones: impl Iterator<Item = &'a Range<usize>>) {
        self.zones.clear();
        self.diagonal.clear();
        self.next.clear();
        self.sites.clear();
        self.spent = 0.0;
        for zone in zones {
            let from = self.diagonal.len();
            self.zones.push((zone.start, from));
            for i in zone.clone() {
                let (own, to) = system.zone_block(i);
                self.diagonal.push(whole(&Block { tx: own.xt.transpose(), ..own }));
                self.next.push((i + 1 < zone.end).then(|| whole(&to)));
            }
            // The factor's pivots are what is left after the blocks before: what those took is put back, U^T P^-1 U =
            // K^T U.
            for i in zone.start..zone.end - 1 {
                let k = from + i - zone.start;
                let transfer = whole(system.transfer(i));
                let Some(u) = self.next[k] else { continue };
                let to = &mut self.diagonal[k + 1];
                for r in 0..6 {
                    for c in r..6 {
                        let v: f64 = (0..6).map(|q| u[6 * q + r] * transfer[6 * q + c]).sum();
                        to[6 * r + c] += v;
                        if c > r {
                            to[6 * c + r] += v;
                        }
                    }
                }
            }
        }
        // Zones come in the order of slots.
        self.zones.sort_unstable();
    }

    /// The node of a block of the zones.
    fn node(&self, block: usize) -> u32 {
        let (start, node) = self.zones[self.zones.partition_point(|(b, _)| *b <= block) - 1];
        (node + block - start) as u32
    }

    /// Adds a contact that touches these blocks, with its components as columns on their positions.
    pub fn push(&mut self, places: impl Iterator<Item = (usize, DMat3)>, compliance: DVec3, diagonal: DVec3) {
        let mut site = Place {
            count: 0,
            node: [0; 4],
            jacobian: [DMat3::ZERO; 4],
            compliance,
            diagonal,
            spring: DMat3::ZERO,
            owner: 0,
        };
        for (block, x) in places {
            let node = self.node(block);
            let k = site.node[..site.count].iter().position(|n| *n == node).unwrap_or(site.count);
            site.count = site.count.max(k + 1);
            site.node[k] = node;
            site.jacobian[k] += x;
        }
        self.sites.push(site);
    }

    /// Finds the order of elimination, where the graph is another one, and factors the rods alone. False when a pivot
    /// is not positive.
    pub fn prepare(&mut self) -> bool {
        let n = self.diagonal.len();
        let now = &mut self.order.now;
        now.clear();
        now.push(n as u32);
        now.extend(self.zones.iter().map(|z| z.1 as u32));
        for s in &self.sites {
            now.push(u32::MAX);
            now.extend_from_slice(&s.node[..s.count]);
        }
        if self.order.now != self.order.graph {
            core::mem::swap(&mut self.order.now, &mut self.order.graph);
            self.find_order();
        }
        for s in &mut self.sites {
            s.owner = s.node[..s.count].iter().map(|v| self.order.place[*v as usize]).min().unwrap_or(0);
        }
        self.taken.clear();
        self.taken.resize(n, 0);
        self.round = 0;
        self.dirty.clear();
        self.dirty.resize(n, true);
        let good = self.factor();
        self.bare.resize(self.data.len(), [0.0; 36]);
        let from = self.fronts.get(self.first_touched).map_or(0, |f| f.at);
        self.bare[from..].copy_from_slice(&self.data[from..]);
        good
    }

    /// Least degree, in rounds of nodes that are not neighbors, so that the tree of fronts is flat. Nodes that no
    /// contact touches come first: they are eliminated once for all working sets.
    fn find_order(&mut self) {
        let n = self.diagonal.len();
        let Order { nodes, place, adjacent, touched, left, then, blocked, by_owner, .. } = &mut self.order;
        adjacent.iter_mut().for_each(Vec::clear);
        if adjacent.len() < n {
            adjacent.resize_with(n, || Vec::with_capacity(16));
        }
        for (k, next) in self.next.iter().enumerate() {
            if next.is_some() {
                join(adjacent, k as u32, k as u32 + 1);
            }
        }
        touched.clear();
        touched.resize(n, false);
        for s in &self.sites {
            let near = &s.node[..s.count];
            for (i, a) in near.iter().enumerate() {
                touched[*a as usize] = true;
                near[..i].iter().for_each(|b| join(adjacent, *a, *b));
            }
        }
        nodes.clear();
        place.clear();
        place.resize(n, u32::MAX);
        left.clear();
        left.extend((0..n as u32).filter(|v| !touched[*v as usize]));
        then.clear();
        then.extend((0..n as u32).filter(|v| touched[*v as usize]));
        self.first_touched = left.len();
        blocked.clear();
        blocked.resize(n, 0);
        self.fronts.clear();
        self.ups.clear();
        let mut round = 0;
        while !(left.is_empty() && then.is_empty()) {
            if left.is_empty() {
                core::mem::swap(left, then);
            }
            round += 1;
            let least = left.iter().map(|v| adjacent[*v as usize].len()).min().unwrap_or(0);
            for v in left.iter() {
                if adjacent[*v as usize].len() > least || blocked[*v as usize] == round {
                    continue;
                }
                let from = self.ups.len();
                self.ups.append(&mut adjacent[*v as usize]);
                let near = &self.ups[from..];
                for (i, a) in near.iter().enumerate() {
                    blocked[*a as usize] = round;
                    let list = &mut adjacent[*a as usize];
                    if let Ok(at) = list.binary_search(v) {
                        list.remove(at);
                    }
                    near[..i].iter().for_each(|b| join(adjacent, *a, *b));
                }
                place[*v as usize] = nodes.len() as u32;
                nodes.push(*v);
                self.fronts.push(Front { up: from..self.ups.len(), ..Front::default() });
            }
            left.retain(|v| place[*v as usize] == u32::MAX);
        }
        let mut at = 0;
        for front in &mut self.fronts {
            let up = &mut self.ups[front.up.clone()];
            up.iter_mut().for_each(|v| *v = place[*v as usize]);
            up.sort_unstable();
            (front.at, front.parent) = (at, up.first().copied());
            at += (1 + up.len()).pow(2);
        }
        self.data.resize(at, [0.0; 36]);
        by_owner.clear();
        let owner = |s: &Place| s.node[..s.count].iter().map(|v| place[*v as usize]).min().unwrap_or(0);
        by_owner.extend(self.sites.iter().enumerate().map(|(k, s)| (owner(s), k as u32)));
        by_owner.sort_unstable();
        self.owned.clear();
        self.owned.extend(by_owner.iter().map(|(_, k)| *k));
        for (k, (p, _)) in by_owner.iter().enumerate() {
            let sites = &mut self.fronts[*p as usize].sites;
            *sites = if sites.end == 0 { k..k + 1 } else { sites.start..k + 1 };
        }
    }

    /// Gives each contact what it adds in a working set. With `mu` friction on a rim follows the normal force, and only
    /// contacts that press count.
    fn set_springs(&mut self, set: &WorkingSet, mu: Option<&[f64]>) {
        for (c, site) in self.sites.iter_mut().enumerate() {
            let spring = spring(set.pressed[c], set.friction[c], site.compliance, mu.map(|mu| mu[c]));
            if site.spring != spring {
                site.spring = spring;
                self.dirty[site.owner as usize] = true;
            }
        }
    }

    /// Puts the front at place `p` together: the rods' blocks and the contacts that it owns.
    fn assemble(&mut self, p: usize) {
        let front = &self.fronts[p];
        let w = 1 + front.up.len();
        let ups = &self.ups[front.up.clone()];
        let place = &self.order.place;
        let data = &mut self.data[front.at..front.at + w * w];
        data.fill([0.0; 36]);
        let v = self.order.nodes[p] as usize;
        let local = |node: usize| {
            let q = place[node];
            if q as usize == p { Some(0) } else { ups.binary_search(&q).ok().map(|k| k + 1) }
        };
        data[0] = self.diagonal[v];
        if let Some(u) = &self.next[v]
            && let Some(j) = local(v + 1)
        {
            (data[j], data[j * w]) = (*u, transposed(u));
        }
        if v > 0
            && let Some(u) = &self.next[v - 1]
            && let Some(j) = local(v - 1)
        {
            (data[j * w], data[j]) = (*u, transposed(u));
        }
        for k in &self.owned[front.sites.clone()] {
            let site = &self.sites[*k as usize];
            if site.spring == DMat3::ZERO {
                continue;
            }
            let at = site.node.map(|n| local(n as usize).unwrap_or(0));
            for j in 0..site.count {
                let pull = site.spring * site.jacobian[j].transpose();
                for i in 0..site.count {
                    add_position(&mut data[at[i] * w + at[j]], &(site.jacobian[i] * pull));
                }
            }
        }
    }

    /// Factors what has changed. False when a pivot is not positive.
    fn factor(&mut self) -> bool {
        let n = self.fronts.len();
        // A parent is put together from all of its children: what changes makes those above it change.
        for p in 0..n {
            if self.dirty[p] {
                if let Some(parent) = self.fronts[p].parent {
                    self.dirty[parent as usize] = true;
                }
                self.assemble(p);
            }
        }
        let mut good = true;
        for p in 0..n {
            let front = &self.fronts[p];
            let w = 1 + front.up.len();
            if self.dirty[p] {
                good &= eliminate(&mut self.data[front.at..front.at + w * w], w);
                self.spent += 216.0 * (w * w) as f64;
            }
            // To the parent, where that is put together anew.
            let Some(parent) = front.parent.filter(|q| self.dirty[*q as usize]) else { continue };
            let above = &self.fronts[parent as usize];
            let (low, high) = self.data.split_at_mut(above.at);
            let (from, wide) = (&low[front.at..front.at + w * w], 1 + above.up.len());
            let ups = &self.ups[above.up.clone()];
            let local = |q: u32| if q == parent { 0 } else { 1 + ups.binary_search(&q).unwrap_or(0) };
            for (i, a) in self.ups[front.up.clone()].iter().enumerate() {
                let row = local(*a) * wide;
                for (j, b) in self.ups[front.up.clone()].iter().enumerate() {
                    for (t, f) in high[row + local(*b)].iter_mut().zip(&from[(i + 1) * w + j + 1]) {
                        *t += f;
                    }
                }
            }
        }
        self.dirty.fill(false);
        good
    }

    /// `y = -G^T B w` with the springs as factored.
    fn pull(&mut self, w: &[f64]) {
        self.y.clear();
        self.y.resize(self.fronts.len(), [0.0; 6]);
        for (site, w) in self.sites.iter().zip(w.chunks_exact(3)) {
            let force = site.spring * DVec3::from_slice(w);
            scatter(site, -force, &self.order.place, &mut self.y);
        }
    }

    /// Through the matrix: leaves in `out` the forces -B (w + G z) with H z = -G^T B w.
    fn solve(&mut self, w: &[f64], out: &mut [f64]) {
        self.pull(w);
        substitute(&self.fronts, &self.ups, &self.data, self.first_touched, &mut self.y);
        for ((site, w), out) in self.sites.iter().zip(w.chunks_exact(3)).zip(out.chunks_exact_mut(3)) {
            let gap = DVec3::from_slice(w) + gather(site, &self.order.place, &self.y);
            (-(site.spring * gap)).write_to_slice(out);
        }
        self.spent += self.cost_of_substitution();
    }

    fn cost_of_substitution(&self) -> f64 {
        72.0 * (self.fronts.len() + self.ups.len()) as f64
    }
}

impl Delassus for Sparse {
    fn add_product(&mut self, l: &[f64], out: &mut [f64]) {
        self.y.clear();
        self.y.resize(self.fronts.len(), [0.0; 6]);
        for (site, l) in self.sites.iter().zip(l.chunks_exact(3)) {
            scatter(site, DVec3::from_slice(l), &self.order.place, &mut self.y);
        }
        substitute(&self.fronts, &self.ups, &self.bare, self.first_touched, &mut self.y);
        for ((site, l), out) in self.sites.iter().zip(l.chunks_exact(3)).zip(out.chunks_exact_mut(3)) {
            let gap = gather(site, &self.order.place, &self.y) + site.compliance * DVec3::from_slice(l);
            (DVec3::from_slice(out) + gap).write_to_slice(out);
        }
        self.spent += self.cost_of_substitution();
    }

    fn diagonal(&self, i: usize) -> f64 {
        self.sites[i / 3].diagonal[i % 3]
    }

    fn none_entered(&mut self) {
        self.round += 1;
    }

    fn enters(&mut self, c: usize) -> bool {
        let site = &self.sites[c];
        let nodes = &site.node[..site.count];
        let free = nodes.iter().all(|v| self.taken[*v as usize] != self.round);
        if free {
            nodes.iter().for_each(|v| self.taken[*v as usize] = self.round);
        }
        free
    }

    fn solve_set(&mut self, set: &WorkingSet, gradient: &[f64], _stale: f64, change: &mut [f64]) -> bool {
        self.set_springs(set, None);
        if !self.factor() {
            return false;
        }
        self.solve(gradient, change);
        true
    }

    fn solve_following(&mut self, set: &WorkingSet, b: &[f64], mu: &[f64], forces: &mut [f64]) -> bool {
        self.set_springs(set, Some(mu));
        if !self.factor() {
            return false;
        }
        self.solve(b, forces);
        true
    }

    fn spent(&mut self) -> f64 {
        core::mem::take(&mut self.spent)
    }
}

/// Force per gap of a contact in the working set.
fn spring(pressed: bool, friction: Friction, compliance: DVec3, mu: Option<f64>) -> DMat3 {
    let mut b = DMat3::ZERO;
    if mu.is_some() && !pressed {
        return b;
    }
    let k = compliance.recip();
    if pressed {
        b.x_axis.x = k.x;
    }
    match friction {
        Friction::None => {}
        Friction::Inside => (b.y_axis.y, b.z_axis.z) = (k.y, k.z),
        Friction::Rim(y, z, turn) => {
            // Both tangential compliances are alike.
            let t = 1.0 / (compliance.y + turn);
            (b.y_axis.y, b.z_axis.y, b.y_axis.z, b.z_axis.z) = (z * z * t, -y * z * t, -y * z * t, y * y * t);
            if let Some(mu) = mu {
                (b.x_axis.y, b.x_axis.z) = (mu * y * k.x, mu * z * k.x);
            }
        }
    }
    b
}

fn join(adjacent: &mut [Vec<u32>], a: u32, b: u32) {
    if a == b {
        return;
    }
    for (a, b) in [(a, b), (b, a)] {
        let list = &mut adjacent[a as usize];
        if let Err(at) = list.binary_search(&b) {
            list.insert(at, b);
        }
    }
}

fn scatter(site: &Place, force: DVec3, place: &[u32], y: &mut [Vec6]) {
    if force == DVec3::ZERO {
        return;
    }
    for k in 0..site.count {
        let at = &mut y[place[site.node[k] as usize] as usize];
        for (a, f) in at.iter_mut().zip((site.jacobian[k] * force).to_array()) {
            *a += f;
        }
    }
}

fn gather(site: &Place, place: &[u32], z: &[Vec6]) -> DVec3 {
    (0..site.count)
        .map(|k| site.jacobian[k].transpose() * DVec3::from_slice(&z[place[site.node[k] as usize] as usize][..3]))
        .sum()
}

/// Eliminates the first of `w` rows and columns of blocks. False when a pivot is not positive.
fn eliminate(data: &mut [Mat6], w: usize) -> bool {
    let mut pivot = data[0];
    let good = lu(&mut pivot);
    data[0] = pivot;
    for x in &mut data[1..w] {
        lu_solve(&pivot, x);
    }
    let (row, below) = data.split_at_mut(w);
    for line in below.chunks_exact_mut(w) {
        let (a, line) = line.split_at_mut(1);
        for (to, x) in line.iter_mut().zip(&row[1..]) {
            subtract_product(to, &a[0], x);
        }
    }
    good
}

/// Solves for a right side that is zero at the nodes eliminated before `from`, where the solution is not wanted.
fn substitute(fronts: &[Front], all_ups: &[u32], data: &[Mat6], from: usize, y: &mut [Vec6]) {
    for p in from..fronts.len() {
        let front = &fronts[p];
        let w = 1 + front.up.len();
        let data = &data[front.at..front.at + w * w];
        let mut x = y[p];
        lu_solve_one(&data[0], &mut x);
        y[p] = x;
        for (i, q) in all_ups[front.up.clone()].iter().enumerate() {
            subtract(&mut y[*q as usize], &data[(i + 1) * w], &x);
        }
    }
    for p in (from..fronts.len()).rev() {
        let front = &fronts[p];
        let mut x = y[p];
        for (j, q) in all_ups[front.up.clone()].iter().enumerate() {
            subtract(&mut x, &data[front.at + j + 1], &y[*q as usize]);
        }
        y[p] = x;
    }
}

/// The block as rows.
fn whole(b: &Block) -> Mat6 {
    let mut out = [0.0; 36];
    for (r, c, m) in [(0, 0, &b.xx), (0, 3, &b.xt), (3, 0, &b.tx), (3, 3, &b.tt)] {
        for j in 0..3 {
            for i in 0..3 {
                out[6 * (r + i) + c + j] = m.col(j)[i];
            }
        }
    }
    out
}

/// Adds to the part of the positions.
#[inline(always)]
fn add_position(to: &mut Mat6, m: &DMat3) {
    for j in 0..3 {
        for i in 0..3 {
            to[6 * i + j] += m.col(j)[i];
        }
    }
}

fn transposed(m: &Mat6) -> Mat6 {
    core::array::from_fn(|k| m[6 * (k % 6) + k / 6])
}

#[inline(always)]
fn subtract_product(c: &mut Mat6, a: &Mat6, b: &Mat6) {
    for i in 0..6 {
        let mut row = [0.0; 6];
        row.copy_from_slice(&c[6 * i..6 * i + 6]);
        for k in 0..6 {
            let f = a[6 * i + k];
            for j in 0..6 {
                row[j] -= f * b[6 * k + j];
            }
        }
        c[6 * i..6 * i + 6].copy_from_slice(&row);
    }
}

#[inline(always)]
fn subtract(y: &mut Vec6, a: &Mat6, x: &Vec6) {
    for r in 0..6 {
        let mut sum = 0.0;
        for c in 0..6 {
            sum += a[6 * r + c] * x[c];
        }
        y[r] -= sum;
    }
}

/// L U without exchange, L with a unit diagonal. False when a pivot is not positive.
#[inline(always)]
fn lu(a: &mut Mat6) -> bool {
    let mut good = true;
    for k in 0..6 {
        let inv = 1.0 / a[7 * k];
        good &= inv.is_finite() && inv > 0.0;
        for i in k + 1..6 {
            let f = a[6 * i + k] * inv;
            a[6 * i + k] = f;
            for j in k + 1..6 {
                a[6 * i + j] -= f * a[6 * k + j];
            }
        }
    }
    good
}

/// Replaces six columns by their solutions.
#[inline(always)]
fn lu_solve(a: &Mat6, x: &mut Mat6) {
    for i in 0..6 {
        for k in 0..i {
            let f = a[6 * i + k];
            for j in 0..6 {
                x[6 * i + j] -= f * x[6 * k + j];
            }
        }
    }
    for i in (0..6).rev() {
        for k in i + 1..6 {
            let f = a[6 * i + k];
            for j in 0..6 {
                x[6 * i + j] -= f * x[6 * k + j];
            }
        }
        let inv = 1.0 / a[7 * i];
        for j in 0..6 {
            x[6 * i + j] *= inv;
        }
    }
}

#[inline(always)]
fn lu_solve_one(a: &Mat6, x: &mut Vec6) {
    for i in 0..6 {
        for k in 0..i {
            x[i] -= a[6 * i + k] * x[k];
        }
    }
    for i in (0..6).rev() {
        for k in i + 1..6 {
            x[i] -= a[6 * i + k] * x[k];
        }
        x[i] /= a[7 * i];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rod::factor::tests::sample;

    const BLOCKS: usize = 24;

    fn random(seed: &mut u64) -> f64 {
        *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    }

    /// Contacts between blocks of one rod, some of them far apart, and S put together from solutions of the rod.
    fn problem(seed: &mut u64) -> (Sparse, Vec<f64>) {
        let (rod, zone) = (0..BLOCKS, 3..BLOCKS - 2);
        let mut system = sample(BLOCKS);
        assert!(system.factor(rod.clone(), &zone));
        system.invert_zone(&zone);
        let mut sparse = Sparse::default();
        sparse.begin(&system, [&zone].into_iter());
        let mut sides = Vec::new();
        for k in 0..9 {
            let first = zone.start + k;
            let blocks = if k % 3 == 0 {
                vec![first, first + 1]
            } else {
                vec![first, first + 1, zone.end - 2 - k, zone.end - 1 - k]
            };
            let side: Vec<(usize, DMat3)> =
                blocks.iter().map(|b| (*b, DMat3::from_cols_array(&core::array::from_fn(|_| random(seed))))).collect();
            let tangential = 0.01 + random(seed).abs();
            sparse.push(
                side.iter().copied(),
                DVec3::new(0.01 + random(seed).abs(), tangential, tangential),
                DVec3::ONE,
            );
            sides.push(side);
        }
        assert!(sparse.prepare());
        let n = 3 * sides.len();
        let mut s = vec![0.0; n * n];
        for j in 0..n {
            let mut z = vec![DVec3::ZERO; 2 * BLOCKS];
            for (b, x) in &sides[j / 3] {
                z[2 * b] += x.col(j % 3);
            }
            system.solve_all(rod.clone(), &zone, &mut z);
            for i in 0..n {
                s[i * n + j] = sides[i / 3].iter().map(|(b, x)| x.col(i % 3).dot(z[2 * b])).sum();
            }
            s[j * n + j] += sparse.sites[j / 3].compliance[j % 3];
        }
        (sparse, s)
    }

    fn times(s: &[f64], l: &[f64]) -> Vec<f64> {
        s.chunks_exact(l.len()).map(|r| r.iter().zip(l).map(|(a, b)| a * b).sum()).collect()
    }

    #[test]
    fn is_the_matrix_that_solutions_of_the_rod_put_together() {
        let seed = &mut 7;
        let (mut sparse, s) = problem(seed);
        let l: Vec<f64> = (0..27).map(|_| random(seed)).collect();
        let (mut product, exact) = (vec![0.0; l.len()], times(&s, &l));
        sparse.add_product(&l, &mut product);
        let size = exact.iter().fold(0.0f64, |a, v| a.max(v.abs()));
        assert!(product.iter().zip(&exact).all(|(a, b)| (a - b).abs() < 1e-9 * size), "{product:?} {exact:?}");
    }

    #[test]
    fn solves_working_sets() {
        let seed = &mut 11;
        let (mut sparse, s) = problem(seed);
        let mu = vec![0.3; 9];
        // Several, one after the other, so that most of the factorization is kept.
        for round in 0..6 {
            let friction = |k: usize| match (k + round) % 3 {
                0 => Friction::None,
                1 => Friction::Inside,
                _ => Friction::Rim(0.6, -0.8, 0.2),
            };
            let set = WorkingSet {
                pressed: (0..9).map(|k| (k + round) % 4 != 0).collect(),
                friction: (0..9).map(friction).collect(),
            };
            let b: Vec<f64> = (0..27).map(|_| random(seed)).collect();
            let mut change = vec![0.0; 27];
            for following in [false, true] {
                let solved = if following {
                    sparse.solve_following(&set, &b, &mu, &mut change)
                } else {
                    sparse.solve_set(&set, &b, 0.0, &mut change)
                };
                assert!(solved);
                let gradient: Vec<f64> = times(&s, &change).iter().zip(&b).map(|(a, b)| a + b).collect();
                for c in 0..9 {
                    let (l, g) = (&change[3 * c..3 * c + 3], &gradient[3 * c..3 * c + 3]);
                    let none = |v: f64| v.abs() < 1e-8;
                    assert!(none(if set.pressed[c] { g[0] } else { l[0] }), "contact {c}: {l:?} {g:?}");
                    if following && !set.pressed[c] {
                        assert!(none(l[1]) && none(l[2]));
                        continue;
                    }
                    match set.friction[c] {
                        Friction::None => assert!(none(l[1]) && none(l[2])),
                        Friction::Inside => assert!(none(g[1]) && none(g[2])),
                        Friction::Rim(y, z, turn) => {
                            let radial = l[1] * y + l[2] * z - if following { mu[c] * l[0] } else { 0.0 };
                            let along = l[2] * y - l[1] * z;
                            assert!(
                                none(radial) && none(g[2] * y - g[1] * z + turn * along),
                                "contact {c}: {l:?} {g:?}"
                            );
                        }
                    }
                }
            }
        }
    }
}
