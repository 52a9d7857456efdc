//! The small contact problem: its assembly in the rods' compliance and what its solution does.
//!
//! Each [`Entry`] is one contact. With W the inverse of the rods' Newton matrix and G the Jacobian of the contacts, `S
//! = G W G^T` is the compliance between contacts. Newton's step without contact gives the right side, the contact
//! forces follow from S ([`active_set`]), and then the step that they cause. (A contact sweep that moves particles by
//! their own inertia, m / h^2, cannot hold: the rod behind them is 10^5 times stiffer.)
//!
//! [`active_set`]: crate::row::active_set

use crate::effort::Effort;
use crate::model::Model;
use crate::motion::Motion;
use crate::params;
use crate::rod::constraint::NodeConstraint;
use crate::rod::factor::{Block, Columns, System};
use crate::rod::scratch::RodScratch;
use crate::row::active_set::{ActiveSet, Limits};
use crate::row::border::Border;
use crate::row::dense::Dense;
use crate::row::side::{Endpoint, Side};
use crate::row::sparse::Sparse;
use crate::row::{Rows, body, joint, shape, thread};
use crate::state::State;
use core::ops::Range;
use glam::{DMat3, DVec3};

/// The row that an entry stands for.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Source {
    Thread(u32),
    Shape(u32),
    Body(u32),
    /// Of a joint.
    Limit(u32),
}

/// One contact.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Entry {
    pub source: Source,
    /// Number of its island, found here.
    pub island: u32,
    /// What its force pushes, and against what.
    pub sides: [Side; 2],
    /// Gap, and slip still to undo, that the step without contact forces would leave \[m\].
    pub free: DVec3,
    pub mu: f64,
    /// Of the contact itself along the three axes \[m/N\].
    pub compliance: DVec3,
    pub radius: f64,
    /// Force along the axes \[N\].
    pub force: DVec3,
}

impl Entry {
    /// Its places on threads.
    fn ends(&self) -> impl Iterator<Item = &Endpoint> + Clone {
        self.sides.iter().filter_map(Side::chain)
    }

    fn touches(&self, zone: &Range<usize>) -> bool {
        self.ends().any(|p| p.within(zone))
    }

    /// Change of its gap and slips by a step.
    fn moved(&self, axis: usize, step: &[DVec3], border: &Border) -> f64 {
        self.sides.iter().map(|side| side.moved(axis, step, border)).sum()
    }
}

/// An endpoint and the number of its entry.
#[derive(Debug, Clone, Copy)]
struct Placed {
    entry: u32,
    at: Endpoint,
}

/// Memory of how a dense S is put together.
#[derive(Default)]
struct Assembly {
    endpoints: Vec<Placed>,
    /// Zone blocks that endpoints touch, ascending, and the transfer from each to the one before it.
    blocks: Vec<usize>,
    jumps: Vec<Block>,
    /// Response of each component to what rods share.
    reach: Vec<f64>,
    small: Vec<f64>,
}

impl Assembly {
    /// Adds `G W G^T` of each rod to the upper triangle of `s`.
    fn compliance(
        &mut self,
        system: &mut System,
        rods: &[(Range<usize>, Range<usize>)],
        constraint: &[NodeConstraint],
        entries: &[Entry],
        s: &mut [f64],
    ) {
        let Assembly { endpoints, blocks, jumps, .. } = self;
        for (_, zone) in rods {
            endpoints.clear();
            for (k, entry) in entries.iter().enumerate() {
                let inside = entry.ends().filter(|p| p.within(zone));
                endpoints.extend(inside.map(|at| Placed { entry: k as u32, at: at.restricted(constraint) }));
            }
            if endpoints.is_empty() {
                continue;
            }
            endpoints.sort_unstable_by_key(|p| (p.at.element, p.entry));
            system.invert_zone(zone);
            blocks.clear();
            for p in endpoints.iter() {
                for k in [p.at.element, p.at.element + 1] {
                    if blocks.last().is_none_or(|l| *l < k) {
                        blocks.push(k);
                    }
                }
            }
            // Transfer from each touched block up to the one before it.
            jumps.clear();
            jumps.push(Block::default());
            for pair in blocks.windows(2) {
                let mut jump = system.transfer(pair[1] - 1).negated();
                for k in (pair[0]..pair[1] - 1).rev() {
                    jump = system.transfer(k).negated().mul(&jump);
                }
                jumps.push(jump);
            }
            compliance_between(system, endpoints, blocks, jumps, s, 3 * entries.len());
        }
    }

    /// Adds what gives way with what rods share: W grows by (H^-1 B) schur^-1 (H^-1 B)^T, and the shape or the weld
    /// itself moves. `unknowns` are those of the border that the entries depend on.
    fn shared(&mut self, border: &mut Border, unknowns: &[u32], entries: &[Entry], s: &mut [f64]) {
        let (m, n) = (unknowns.len(), 3 * entries.len());
        if m == 0 {
            return;
        }
        let Assembly { reach, small, .. } = self;
        reach.clear();
        for entry in entries {
            for unit in DVec3::AXES {
                let from = reach.len();
                let response = |k: &u32| entry.ends().map(|p| p.work(unit, border.response(*k as usize))).sum::<f64>();
                reach.extend(unknowns.iter().map(response));
                for side in &entry.sides {
                    if let Side::Shared(moves) = side {
                        for (k, c) in moves.columns() {
                            let place = unknowns.partition_point(|u| (*u as usize) < k);
                            reach[from + place] -= unit.dot(c);
                        }
                    }
                }
            }
        }
        border.begin_part(unknowns);
        for i in 0..n {
            small.clear();
            small.extend_from_slice(&reach[i * m..(i + 1) * m]);
            border.solve_part(unknowns, small);
            for j in i..n {
                s[i * n + j] += small.iter().zip(&reach[j * m..(j + 1) * m]).map(|(a, b)| a * b).sum::<f64>();
            }
        }
    }
}

/// Adds the contacts' own compliance to the diagonal, and mirrors the upper triangle.
fn finish_dense(entries: &[Entry], s: &mut [f64]) {
    let n = 3 * entries.len();
    for (k, entry) in entries.iter().enumerate() {
        for (axis, i) in (3 * k..3 * k + 3).enumerate() {
            s[i * n + i] += entry.compliance[axis];
            for j in 0..i {
                s[i * n + j] = s[j * n + i];
            }
        }
    }
}

/// Contacts that press, where threads touch each other, up to which S is put together in any case.
const MANY: usize = 64;

/// Says whether the contacts are so many that S is better not put together, by rough counts of multiplications. A dense
/// solve puts it together and factors it about twice; a sparse one eliminates each block of the zones with two
/// neighbors and those that contacts touch with five, about thrice. What rods share and the tension unknowns of
/// inextensible elements are in the dense one only.
fn pays(system: &System, rods: &[(Range<usize>, Range<usize>)], entries: &[Entry], n: usize) -> bool {
    if entries.iter().filter(|e| e.force.x > 0.0).count() < MANY && entries.iter().any(|e| e.ends().count() > 1) {
        return false;
    }
    let mut blocks = 0;
    for (_, zone) in rods.iter().filter(|(_, zone)| entries.iter().any(|e| e.touches(zone))) {
        if system.tied[zone.clone()].contains(&true) {
            return false;
        }
        blocks += zone.len();
    }
    let touched = (2 * entries.iter().map(|e| e.ends().count()).sum::<usize>()).min(blocks);
    let n = n as f64;
    30.0 * n * n + n * n * n / 3.0 > 3.0 * (1500.0 * blocks as f64 + 5000.0 * touched as f64)
}

/// Multiplications that a contact solve gets although the step has spent what it may.
const LEAST_WORK: f64 = 1e5;

/// Contacts that depend on each other, through rods that touch, and what solves them.
#[derive(Default)]
struct Island {
    entries: Range<usize>,
    dense: Dense,
    sparse: Sparse,
    active_set: ActiveSet,
    /// Bodies are in it.
    bodies: bool,
    spare: Vec<f64>,
    /// The sparse matrix is in use; what a solution may take; the least radius of the entries.
    many: bool,
    limits: Limits,
    smallest: f64,
}

impl Island {
    /// Its part of a vector of components.
    fn components(&self) -> Range<usize> {
        3 * self.entries.start..3 * self.entries.end
    }

    /// Solves for the forces, from those given; the residual in radii.
    fn solve(&mut self, b: &[f64], mu: &[f64], force: &mut [f64]) -> f64 {
        let (components, entries) = (self.components(), self.entries.clone());
        let (b, mu, force) = (&b[components.clone()], &mu[entries], &mut force[components]);
        if self.many {
            return self.active_set.solve(&mut self.sparse, b, mu, force, &self.limits) / self.smallest;
        }
        let mut left = self.active_set.solve(&mut self.dense, b, mu, force, &self.limits);
        if self.bodies && left > params::CONTACT_LEFT * self.smallest {
            self.spare.resize(force.len(), 0.0);
            let limits = Limits { work: self.active_set.left().max(LEAST_WORK), ..self.limits };
            let again = self.active_set.solve_from_stick(&mut self.dense, b, mu, &mut self.spare, &limits);
            if again < left {
                left = again;
                force.copy_from_slice(&self.spare);
            }
        }
        left / self.smallest
    }

    /// Replaces changes of gaps and slips by those of the forces of the contacts that press. Where there are none,
    /// none.
    fn respond(&mut self, change: &mut [f64]) {
        let change = &mut change[self.components()];
        let solved = if self.many {
            self.active_set.response(&mut self.sparse, change)
        } else {
            self.active_set.response(&mut self.dense, change)
        };
        if !solved {
            change.fill(0.0);
        }
    }
}

/// Sorts the entries by islands and finds these: what touches is of one, and so is what shares unknowns of the border.
/// An island is numbered as the first of its rods, or after all rods as the first of its unknowns, so that it finds its
/// memory again in the next iteration. Without free bodies all that shares something is one.
fn find_islands(coupling: &mut ContactSystem, rods: &[(Range<usize>, Range<usize>)], border: &Border, bodies: bool) {
    let ContactSystem { entries, islands, active, root, .. } = coupling;
    let (n, count) = (rods.len(), border.count());
    root.clear();
    root.extend((0..(n + count).max(1) as u32).map(|r| if count > 0 && !bodies { 0 } else { r }));
    let join = |root: &mut [u32], a: usize, b: usize| {
        let (a, b) = (root[a], root[b]);
        if a != b {
            root.iter_mut().filter(|r| **r == a.max(b)).for_each(|r| *r = a.min(b));
        }
    };
    if bodies {
        for k in 0..count {
            border.coupled(k).for_each(|j| join(root, n + k, n + j));
            for (rod, (blocks, _)) in rods.iter().enumerate() {
                if border.links_rod(k, blocks) {
                    join(root, n + k, rod);
                }
            }
        }
    }
    // In the order of slots, which need not be that of the arrays.
    let rod_of = |p: &Endpoint| rods.iter().position(|(blocks, _)| blocks.contains(&p.element)).unwrap_or(0);
    for entry in entries.iter_mut() {
        let mut first = None;
        for side in &entry.sides {
            let mut joined = |node: usize| join(root, *first.get_or_insert(node), node);
            match side {
                Side::Still => {}
                Side::Chain(endpoint) => joined(rod_of(endpoint)),
                Side::Shared(moves) => moves.columns().for_each(|(k, _)| joined(n + k)),
            }
        }
        entry.island = first.unwrap_or(0) as u32;
    }
    entries.iter_mut().for_each(|e| e.island = root[e.island as usize]);
    entries.sort_unstable_by_key(|e| match e.source {
        Source::Thread(k) => (e.island, 0, k),
        Source::Shape(k) => (e.island, 1, k),
        Source::Body(k) => (e.island, 2, k),
        Source::Limit(k) => (e.island, 3, k),
    });
    if islands.len() < root.len() {
        islands.resize_with(root.len(), Island::default);
    }
    active.clear();
    let mut from = 0;
    for part in entries.chunk_by(|a, b| a.island == b.island) {
        islands[part[0].island as usize].entries = from..from + part.len();
        active.push(part[0].island);
        from += part.len();
    }
}

/// Memory of the coupling.
#[derive(Default)]
pub(crate) struct ContactSystem {
    /// Island by island.
    entries: Vec<Entry>,
    islands: Vec<Island>,
    /// Those in use, that of each rod and then of each unknown of the border, and the unknowns of one.
    active: Vec<u32>,
    root: Vec<u32>,
    unknowns: Vec<u32>,
    assembly: Assembly,
    b: Vec<f64>,
    mu: Vec<f64>,
    force: Vec<f64>,
    right: Vec<DVec3>,
    change: Vec<f64>,
    steps: Vec<f64>,
    /// Residual of the last solution, in radii.
    left: f64,
}

impl ContactSystem {
    /// Residual of the last solution, in radii.
    pub fn left(&self) -> f64 {
        self.left
    }
}

/// Gap that a row may keep, and its compliance, so that overlap from before is won back over a few substeps. `depth` is
/// to what the force at the start presses, by a law of `compliance` now. A row that lay deeper, by `-start_gap`, ends
/// at `RECOVER * old + (1 - RECOVER) * depth`, never deeper than the larger of the two (what is deeper than its force
/// explains must be able to bear more force without going deeper). What lies only a little deeper is between that and
/// the law itself.
pub(crate) fn regain(start_gap: f64, depth: f64, compliance: f64) -> (f64, f64) {
    let excess = -start_gap - depth;
    if excess <= 0.0 {
        return (0.0, compliance);
    }
    let part = params::RECOVER * (excess / (excess + params::UNEXPLAINED * depth));
    (part * start_gap, (1.0 - part) * compliance)
}

/// Forgets the contacts of the last substep.
pub(crate) fn begin(rows: &mut Rows) {
    rows.solver.entries.clear();
}

/// Sets the zone of each rod: from the first to the last block that the small problem may touch.
pub(crate) fn zones(ranges: &mut [(Range<usize>, Range<usize>)], rows: &Rows) {
    for (blocks, zone) in ranges {
        let (mut lo, mut hi) = (usize::MAX, 0);
        let touched = rows
            .threads
            .iter()
            .flat_map(thread::ThreadRow::elements)
            .chain(rows.shapes.iter().filter_map(shape::ShapeRow::compliant_element));
        for e in touched.filter(|e| blocks.contains(e)) {
            lo = lo.min(e);
            hi = hi.max(e + 1);
        }
        // Without rows the middle, so that elimination from both ends is balanced.
        let middle = (blocks.start + blocks.end) / 2;
        *zone = if lo == usize::MAX { middle..middle + 1 } else { lo..hi + 1 };
    }
}

/// Finds the contact forces at this iterate and adds the step that they cause to `rods.step`.
pub(crate) fn solve(
    model: &Model,
    state: &State,
    motion: &Motion,
    rods: &mut RodScratch,
    rows: &mut Rows,
    effort: &mut Effort,
) {
    let may_spend = effort.allowed - effort.spent;
    let RodScratch { ranges: rods, system, step, constraint, .. } = rods;
    let work = &mut effort.now;
    let entries = &mut rows.solver.entries;
    entries.clear();
    thread::add_entries(state, motion, step, &mut rows.threads, entries);
    shape::add_entries(state, motion, step, &mut rows.shapes, (&rows.movers, &rows.border), entries);
    body::add_entries(model, state, motion, &mut rows.bodies.rows, (&rows.movers, &rows.border), entries);
    rows.joints.add_entries(model, state, &rows.border, entries);
    rows.solver.left = 0.0;
    if rows.solver.entries.is_empty() {
        return;
    }
    find_islands(&mut rows.solver, rods, &rows.border, rows.movers.has_bodies());
    let ContactSystem { entries, islands, active, root, unknowns, assembly, b, mu, force, right, left, .. } =
        &mut rows.solver;
    b.clear();
    mu.clear();
    force.clear();
    for entry in entries.iter() {
        b.extend(entry.free.to_array());
        mu.push(entry.mu);
        force.extend(entry.force.to_array());
    }
    for k in active.iter() {
        let island = &mut islands[*k as usize];
        let entries = &entries[island.entries.clone()];
        let n = 3 * entries.len();
        island.bodies = entries.iter().any(|e| matches!(e.source, Source::Body(_)));
        island.smallest = entries.iter().map(|e| e.radius).fold(f64::INFINITY, f64::min);
        island.many = rows.border.count() == 0 && pays(system, rods, entries, n);
        let most = if island.many { params::SPARSE_WORK } else { params::CONTACT_WORK.max((n * n * n) as f64 / 3.0) };
        // What is left to the step is enough, or the iteration counts for nothing.
        let most = most.min((may_spend - *work).max(LEAST_WORK));
        island.limits =
            Limits { residual: params::CONTACT_TOLERANCE * island.smallest, rounds: 15, steps: 60, work: most };
        // Putting S together, and the most that its solution may take.
        *work += if island.many { most } else { 30.0 * (n * n) as f64 + most };
        if *work > params::SUBSTEP_WORK {
            *left = f64::INFINITY;
            break;
        }
        let mut positive = true;
        if island.many {
            let zones = || rods.iter().map(|(_, zone)| zone).filter(|zone| entries.iter().any(|e| e.touches(zone)));
            zones().for_each(|zone| system.invert_zone(zone));
            island.sparse.begin(system, zones());
            for entry in entries {
                let ends = entry.ends().map(|p| p.restricted(constraint));
                let diagonal = ends.clone().map(|p| own_compliance(system, &p)).sum::<DVec3>() + entry.compliance;
                let places = ends.flat_map(|p| [(p.element, p.here), (p.element + 1, p.next)]);
                island.sparse.push(places, entry.compliance, diagonal);
            }
            positive = island.sparse.prepare();
        } else {
            island.dense.begin(n);
            assembly.compliance(system, rods, constraint, entries, &mut island.dense.s);
            unknowns.clear();
            let first = root.len() - rows.border.count();
            unknowns.extend((0..rows.border.count() as u32).filter(|u| root[first + *u as usize] == *k));
            assembly.shared(&mut rows.border, unknowns, entries, &mut island.dense.s);
            finish_dense(entries, &mut island.dense.s);
        }
        if positive {
            *left = left.max(island.solve(b, mu, force));
            *work -= island.active_set.left().max(0.0);
        } else {
            *left = f64::INFINITY;
            *work -= most;
        }
    }
    if left.is_infinite() {
        entries.clear();
        active.clear();
        return;
    }
    right.clear();
    right.resize(step.len(), DVec3::ZERO);
    load(entries, force, &mut rows.border, right);
    hand_over(entries, force, (&mut rows.threads, &mut rows.shapes), (&mut rows.bodies.rows, &mut rows.joints.stops));
    respond(rods, system, constraint, &mut rows.border, right);
    for (z, r) in step.iter_mut().zip(right.iter()) {
        *z += *r;
    }
}

/// Replaces forces on the nodes, and those on the unknowns of the border, by the step that they cause.
fn respond(
    rods: &[(Range<usize>, Range<usize>)],
    system: &System,
    constraint: &[NodeConstraint],
    border: &mut Border,
    right: &mut [DVec3],
) {
    border.load_carried(right);
    for (r, constraint) in right.iter_mut().zip(constraint.iter()) {
        if *constraint != NodeConstraint::Free {
            *r = constraint.projector() * *r;
        }
    }
    for (rod, zone) in rods {
        system.solve(rod.clone(), zone, right);
    }
    border.couple(right, true);
}

/// Adds to `b` what a step changes of the gaps and slips of the entries.
fn shift(entries: &[Entry], border: &Border, step: &[DVec3], b: &mut [f64]) {
    for (entry, b) in entries.iter().zip(b.chunks_exact_mut(3)) {
        for (axis, b) in b.iter_mut().enumerate() {
            *b += entry.moved(axis, step, border);
        }
    }
}

/// Adds forces of the entries to right sides.
fn load(entries: &[Entry], force: &[f64], border: &mut Border, right: &mut [DVec3]) {
    for (entry, f) in entries.iter().zip(force.chunks_exact(3)) {
        let f = DVec3::from_slice(f);
        entry.sides.iter().for_each(|side| side.push(f, right, border));
    }
}

/// Replaces forces on the nodes by the step that they cause while the contacts that press go on pressing: the linear
/// response of the last solution. The border's steps are to be set aside.
pub(crate) fn pressed_response(rods: &RodScratch, rows: &mut Rows, effort: &mut Effort, right: &mut [DVec3]) {
    let RodScratch { ranges: rods, system, constraint, .. } = rods;
    let work = &mut effort.now;
    let ContactSystem { entries, islands, active, right: more, change, b, .. } = &mut rows.solver;
    respond(rods, system, constraint, &mut rows.border, right);
    *work += 100.0 * right.len() as f64;
    if entries.is_empty() {
        return;
    }
    change.clear();
    change.resize(b.len(), 0.0);
    shift(entries, &rows.border, right, change);
    active.iter().for_each(|k| islands[*k as usize].respond(change));
    more.clear();
    more.resize(right.len(), DVec3::ZERO);
    load(entries, change, &mut rows.border, more);
    respond(rods, system, constraint, &mut rows.border, more);
    for (z, r) in right.iter_mut().zip(more.iter()) {
        *z += *r;
    }
}

/// Adds more forces on the nodes to the iteration: finds the contact forces again, with the same matrix, and adds the
/// step of both.
pub(crate) fn again(rods: &mut RodScratch, rows: &mut Rows, effort: &mut Effort, right: &mut [DVec3]) {
    let RodScratch { ranges: rods, system, step, constraint, .. } = rods;
    let work = &mut effort.now;
    let ContactSystem { entries, islands, active, right: more, change, steps, b, mu, force, left, .. } =
        &mut rows.solver;
    steps.clear();
    rows.border.swap_steps(steps);
    respond(rods, system, constraint, &mut rows.border, right);
    if !entries.is_empty() {
        shift(entries, &rows.border, right, b);
        change.clone_from(force);
        *left = 0.0;
        for k in active.iter() {
            let island = &mut islands[*k as usize];
            *left = left.max(island.solve(b, mu, force));
            *work += island.limits.work - island.active_set.left().max(0.0);
        }
        for (c, f) in change.iter_mut().zip(force.iter()) {
            *c = f - *c;
        }
        more.clear();
        more.resize(right.len(), DVec3::ZERO);
        load(entries, change, &mut rows.border, more);
        respond(rods, system, constraint, &mut rows.border, more);
        for (z, r) in right.iter_mut().zip(more.iter()) {
            *z += *r;
        }
        hand_over(
            entries,
            force,
            (&mut rows.threads, &mut rows.shapes),
            (&mut rows.bodies.rows, &mut rows.joints.stops),
        );
    }
    rows.border.add_steps(steps);
    for (z, r) in step.iter_mut().zip(right.iter()) {
        *z += *r;
    }
}

/// Tells the rows their forces.
fn hand_over(
    entries: &mut [Entry],
    force: &[f64],
    (threads, shapes): (&mut [thread::ThreadRow], &mut [shape::ShapeRow]),
    (bodies, stops): (&mut [body::BodyRow], &mut [joint::Stop]),
) {
    for (entry, f) in entries.iter_mut().zip(force.chunks_exact(3)) {
        entry.force = DVec3::from_slice(f);
        match entry.source {
            Source::Thread(k) => threads[k as usize].force = entry.force,
            Source::Shape(k) => shapes[k as usize].solved(entry.force),
            Source::Body(k) => bodies[k as usize].force = entry.force,
            Source::Limit(k) => stops[k as usize].force = entry.force.x,
        }
    }
}

/// Adds the entries' forces to a right side.
pub(crate) fn add_forces(rows: &Rows, rhs: &mut [DVec3]) {
    for entry in &rows.solver.entries {
        for p in entry.ends() {
            p.push(entry.force, rhs);
        }
    }
}

/// Work of the entries' forces along the step.
pub(crate) fn work(rows: &Rows, step: &[DVec3]) -> f64 {
    let border = &rows.border;
    let on = |e: &Entry| e.sides.iter().map(|side| side.work(e.force, step, border)).sum::<f64>();
    rows.solver.entries.iter().filter(|e| e.force != DVec3::ZERO).map(on).sum()
}

/// Computes how the two blocks that an endpoint touches move under unit forces along its components.
fn response(system: &System, p: &Endpoint) -> (Columns, Columns) {
    let (here, next, k) = (system.inverse(p.element), system.inverse(p.element + 1), system.transfer(p.element));
    let columns = |x: DMat3| Columns { x, t: DMat3::ZERO };
    let kt = k.transpose().mul_columns(&columns(p.here));
    let pushed = next.mul_columns(&Columns { x: p.next - kt.x, t: -kt.t });
    let direct = next.mul_columns(&columns(p.next));
    let (own, up) = (here.mul_columns(&columns(p.here)), k.mul_columns(&direct));
    (Columns { x: own.x - up.x, t: own.t - up.t }, pushed)
}

/// Compliance of an endpoint along each of its axes.
fn own_compliance(system: &System, p: &Endpoint) -> DVec3 {
    let (here, next) = response(system, p);
    let along = |k: usize| p.here.col(k).dot(here.x.col(k)) + p.next.col(k).dot(next.x.col(k));
    DVec3::new(along(0), along(1), along(2))
}

/// Adds `G W G^T` over the endpoints of one rod to the upper triangle of `s`.
fn compliance_between(
    system: &System,
    endpoints: &[Placed],
    blocks: &[usize],
    jumps: &[Block],
    s: &mut [f64],
    n: usize,
) {
    for (qi, q) in endpoints.iter().enumerate() {
        // The column of the inverse at q's two blocks, then up by transfers: z_i = -k_i z_{i+1}.
        let (mut here, mut next) = response(system, &q.at);
        let e = q.at.element;
        let mut at = blocks.partition_point(|b| *b < e);
        let mut pi = qi + 1;
        // Endpoints on the same element after q are handled when they are q.
        while pi > 0 {
            pi -= 1;
            let p = &endpoints[pi];
            while blocks[at] > p.at.element {
                at -= 1;
                next = here;
                here = jumps[at + 1].mul_columns(&here);
            }
            let value = p.at.here.transpose() * here.x + p.at.next.transpose() * next.x;
            let (r, c) = (3 * p.entry as usize, 3 * q.entry as usize);
            for j in 0..3 {
                for i in 0..3 {
                    let v = value.col(j)[i];
                    if r < c {
                        s[(r + i) * n + c + j] += v;
                    } else if r > c {
                        s[(c + j) * n + r + i] += v;
                    } else {
                        // Both sides of one row on one rod: count the pair and its mirror image.
                        let twice = pi != qi;
                        s[(r + i) * n + c + j] += v;
                        if twice {
                            s[(r + j) * n + c + i] += v;
                        }
                    }
                }
            }
        }
    }
}
