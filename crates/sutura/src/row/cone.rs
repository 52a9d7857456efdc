//! The small contact problem: minimize `l^T S l / 2 + b^T l` over normal forces >= 0 and friction forces within a disc.
//!
//! S is the compliance between contacts, symmetric positive definite (the contacts' own compliance is on its diagonal) and ill conditioned:
//! of forty near contacts in a knot some eight carry, and the others are nearly dependent on them. With the radius of each disc held
//! fixed the problem is convex; the radii follow mu times the normal forces in an outer loop. Taking the disc as part of a cone instead would
//! lift a sliding contact (associated friction), which Coulomb's law does not.
//!
//! For fixed discs a primal active-set method (for the normals that of Lawson and Hanson 1974): a working set of normal forces and of
//! friction forces inside their discs (two unknowns) or on their rims (one, the turn along the rim), a direct solution on it, a step up to the
//! first bound that it meets. At the optimum of a set the contact that overlaps most enters, and friction that is pulled inward leaves
//! its rim. The factorization follows the set row by row ([`Ldl`]). Up to the return to a rim each step lowers the objective; a budget ends what
//! does not. Dependent contacts never share a working set for long, which is what makes sweeps and projected methods fail here.
//!
//! The radii's loop alone would take some eight rounds. Once a set is found, one Newton step solves it with every radius following its normal
//! force (a nonsymmetric system); mostly that is the answer.

use crate::row::ldl::{Ldl, dot};

/// Tolerance and limits of a solve.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits {
    /// How far a contact may be from its complementarity \[m\].
    pub residual: f64,
    /// Rounds of the outer loop, and solutions on a working set in each.
    pub rounds: u32,
    pub steps: u32,
    /// Multiplications in all factorizations of a solve, about.
    pub work: f64,
}

/// Part of its own radius that a friction force may move along its rim before it is linearized again.
const TURN: f64 = 0.7;
/// Rounds after which the radii move halfway only: where friction and pressure feed each other they may swing.
const SWING: u32 = 3;
/// Steps in which several contacts may enter and several rims be met at once.
const EAGER: u32 = 30;
/// Part of a step in which all friction forces that are near their rims meet them at once.
const TOGETHER: f64 = 0.1;
/// Turn of a rim \[rad\], and change of its stiffness over what the diagonal was, beyond which its row is factored again.
const STALE: f64 = 0.01;

/// How much less exact the rims are in the first round: its radii are those of the last forces, and Newton on the radii turns the rims too.
const FIRST: f64 = 100.0;

/// What a friction force may do.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Friction {
    /// Its disc is a point.
    None,
    Inside,
    /// On the rim in direction (y, z); stiffness against turning along it.
    Rim(f64, f64, f64),
}

/// An unknown of the working set: a component (0, 1 or 2) of a contact, or the turn along its rim with tangent (y, z).
#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Component(usize),
    Turn(f64, f64),
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Unknown {
    /// First component of its contact.
    contact: usize,
    kind: Kind,
    /// Stiffness against turning, as factored.
    turn: f64,
}

impl Unknown {
    /// Its entry in a vector of components.
    #[inline]
    fn of(&self, v: &[f64]) -> f64 {
        match self.kind {
            Kind::Component(a) => v[self.contact + a],
            Kind::Turn(y, z) => y * v[self.contact + 1] + z * v[self.contact + 2],
        }
    }

    /// Its row of `s`, which has rows of `n`; that of a turn is put together in `work`.
    fn row<'a>(&self, s: &'a [f64], n: usize, work: &'a mut [f64]) -> &'a [f64] {
        let component = |a: usize| &s[(self.contact + a) * n..(self.contact + a + 1) * n];
        match self.kind {
            Kind::Component(a) => component(a),
            Kind::Turn(y, z) => {
                for (v, (r1, r2)) in work.iter_mut().zip(component(1).iter().zip(component(2))) {
                    *v = y * r1 + z * r2;
                }
                work
            }
        }
    }
}

/// Memory of the solver.
#[derive(Default)]
pub(crate) struct Cone {
    pressed: Vec<bool>,
    friction: Vec<Friction>,
    disc: Vec<f64>,
    gradient: Vec<f64>,
    /// Solution on the working set.
    target: Vec<f64>,
    best: Vec<f64>,
    /// The working set as factored.
    unknowns: Vec<Unknown>,
    factor: Ldl,
    right: Vec<f64>,
    row: Vec<f64>,
    dense: Vec<f64>,
    waiting: Vec<(f64, usize)>,
    /// What of each contact is factored.
    have: Vec<u8>,
    /// Multiplications that may still be spent.
    left: f64,
}

impl Cone {
    /// Solves for `l` (three components a contact: normal, two tangential), starting from its value. `s` is dense, row after row.
    /// `mu` is the coefficient of each contact. Returns the residual reached \[m\].
    pub fn solve(&mut self, s: &[f64], b: &[f64], mu: &[f64], l: &mut [f64], limits: &Limits) -> f64 {
        let n = b.len();
        let m = n / 3;
        for v in [&mut self.gradient, &mut self.target, &mut self.best, &mut self.row] {
            v.clear();
            v.resize(n, 0.0);
        }
        self.unknowns.clear();
        self.factor.clear();
        self.pressed.clear();
        self.friction.clear();
        self.friction.resize(m, Friction::None);
        self.disc.clear();
        self.disc.resize(m, 0.0);
        for c in 0..m {
            l[3 * c] = l[3 * c].max(0.0);
            self.pressed.push(l[3 * c] > 0.0);
            self.set_disc(c, mu[c] * l[3 * c], l);
        }
        self.find_gradient(s, b, l);
        let mut reached = self.residual(s, mu, l);
        self.best.copy_from_slice(l);
        self.left = limits.work;
        for round in 0..limits.rounds {
            if reached < limits.residual || self.left < 0.0 {
                break;
            }
            self.fixed_discs(s, b, l, 0.3 * limits.residual, limits.steps, if round == 0 { FIRST } else { 1.0 });
            // With discs that fit the normal forces.
            self.target.copy_from_slice(l);
            let simple = self.judge(s, b, mu, &mut reached);
            if reached < limits.residual {
                break;
            }
            let mut slow = round >= SWING;
            if self.following_discs(s, b, mu) && self.judge(s, b, mu, &mut reached) < simple {
                slow = false;
                l.copy_from_slice(&self.target);
                for c in 0..m {
                    self.pressed[c] = l[3 * c] > 0.0;
                }
            }
            for c in 0..m {
                let fit = mu[c] * l[3 * c];
                let half = slow && self.disc[c] > 1e-9 * fit;
                self.set_disc(c, if half { 0.5 * (fit + self.disc[c]) } else { fit }, l);
            }
            self.find_gradient(s, b, l);
        }
        l.copy_from_slice(&self.best);
        reached
    }

    /// Makes `target` admissible; its residual. It is the best so far where that is less than `reached`.
    fn judge(&mut self, s: &[f64], b: &[f64], mu: &[f64], reached: &mut f64) -> f64 {
        let mut target = core::mem::take(&mut self.target);
        for (f, mu) in target.chunks_exact_mut(3).zip(mu) {
            f[0] = f[0].max(0.0);
            (f[1], f[2]) = onto_disc(f[1], f[2], mu * f[0]);
        }
        self.find_gradient(s, b, &target);
        let residual = self.residual(s, mu, &target);
        if residual < *reached {
            *reached = residual;
            self.best.copy_from_slice(&target);
        }
        self.target = target;
        residual
    }

    /// Gives a contact its disc and puts its friction force into it.
    fn set_disc(&mut self, c: usize, radius: f64, l: &mut [f64]) {
        let (i, size) = (3 * c, (l[3 * c + 1] * l[3 * c + 1] + l[3 * c + 2] * l[3 * c + 2]).sqrt());
        self.disc[c] = radius;
        self.friction[c] = if radius <= 0.0 {
            (l[i + 1], l[i + 2]) = (0.0, 0.0);
            Friction::None
        } else if let Friction::Rim(y, z, turn) = self.friction[c] {
            (l[i + 1], l[i + 2]) = (radius * y, radius * z);
            Friction::Rim(y, z, turn)
        } else if size >= 0.9999 * radius {
            let (y, z) = (l[i + 1] / size, l[i + 2] / size);
            (l[i + 1], l[i + 2]) = (radius * y, radius * z);
            Friction::Rim(y, z, 0.0)
        } else {
            Friction::Inside
        };
    }

    /// gradient = S l + b.
    fn find_gradient(&mut self, s: &[f64], b: &[f64], l: &[f64]) {
        let n = b.len();
        self.gradient.copy_from_slice(b);
        for (k, v) in l.iter().enumerate().filter(|(_, v)| **v != 0.0) {
            for (g, r) in self.gradient.iter_mut().zip(&s[k * n..k * n + n]) {
                *g += r * v;
            }
        }
    }

    /// Largest violation of complementarity with discs of mu times the normal forces \[m\].
    fn residual(&self, s: &[f64], mu: &[f64], l: &[f64]) -> f64 {
        let (n, g) = (l.len(), &self.gradient);
        let mut worst = 0.0f64;
        for c in 0..mu.len() {
            let i = 3 * c;
            worst = worst.max(g[i].min(l[i] * s[i * n + i]).abs());
            let d = tangential(s, n, i);
            let (y, z) = onto_disc(l[i + 1] - g[i + 1] / d, l[i + 2] - g[i + 2] / d, mu[c] * l[i]);
            worst = worst.max(d * ((y - l[i + 1]).powi(2) + (z - l[i + 2]).powi(2)).sqrt());
        }
        worst
    }

    /// Minimizes over normal forces and friction forces in the discs as they are, from the gradient at `l`, and leaves it there. Rims count as at rest when
    /// they turn by no more than `loose` times the tolerance.
    fn fixed_discs(&mut self, s: &[f64], b: &[f64], l: &mut [f64], tolerance: f64, steps: u32, loose: f64) {
        let (n, m) = (b.len(), b.len() / 3);
        let (mut eager, mut part) = (true, 0.0);
        self.find_pulls(false, tolerance);
        for step in 0..steps {
            eager = eager && step < EAGER;
            if self.left < 0.0 || !self.solve_working_set(s, l, if part < 1.0 { 10.0 * STALE } else { STALE }) {
                break;
            }
            let stuck;
            (part, stuck) = self.first_bound(l, if eager { TOGETHER } else { 0.0 });
            // A contact that entered with others and would leave at once: from now on one at a time.
            eager = eager && !stuck;
            let mut turned = 0.0f64;
            for c in 0..m {
                let (i, radius) = (3 * c, self.disc[c]);
                let (before, bound, near) = ([l[i], l[i + 1], l[i + 2]], self.bound(c, l), self.near_rim(c, l));
                for a in i..i + 3 {
                    l[a] = if part < 1.0 { l[a] + part * (self.target[a] - l[a]) } else { self.target[a] };
                }
                match self.friction[c] {
                    Friction::Rim(y, z, turn) => {
                        let size = (l[i + 1] * l[i + 1] + l[i + 2] * l[i + 2]).sqrt();
                        if size > 0.0 {
                            (l[i + 1], l[i + 2]) = (l[i + 1] * radius / size, l[i + 2] * radius / size);
                            self.friction[c] = Friction::Rim(l[i + 1] / radius, l[i + 2] / radius, turn);
                            let moved = ((l[i + 1] - radius * y).powi(2) + (l[i + 2] - radius * z).powi(2)).sqrt();
                            turned = turned.max(tangential(s, n, i) * moved);
                        }
                    }
                    Friction::Inside if bound.disc <= part || eager && near && bound.disc <= TOGETHER => {
                        let [y, z] = [1, 2].map(|a| before[a] + bound.disc * (self.target[i + a] - before[a]));
                        let size = (y * y + z * z).sqrt();
                        if size > 0.0 {
                            (l[i + 1], l[i + 2]) = (y * radius / size, z * radius / size);
                            self.friction[c] = Friction::Rim(y / size, z / size, 0.0);
                        }
                    }
                    _ => {}
                }
                if bound.normal <= part {
                    self.pressed[c] = false;
                    l[i] = 0.0;
                }
            }
            self.find_gradient(s, b, l);
            self.left -= (self.unknowns.len() * n) as f64;
            let overlap = (0..m).filter(|c| !self.pressed[*c]).map(|c| -self.gradient[3 * c]).fold(0.0, f64::max);
            // Where much is still to come the rims need not be exact.
            let exact = tolerance * loose;
            let optimal = part >= 1.0 && turned <= exact.max(0.03 * overlap);
            let released = self.find_pulls(optimal, tolerance);
            if optimal && !released && !self.enter(s, n, tolerance, eager) && turned <= exact {
                break;
            }
        }
    }

    /// Whether a friction force is within a fiftieth of its rim.
    fn near_rim(&self, c: usize, l: &[f64]) -> bool {
        l[3 * c + 1].powi(2) + l[3 * c + 2].powi(2) > (0.98 * self.disc[c]).powi(2)
    }

    /// How hard each friction force on its rim is pulled outward, which holds it against turning. One that is pulled inward leaves its rim when `release`; before
    /// it is held as if it were pulled outward, or it would turn far for nothing. Whether any left.
    fn find_pulls(&mut self, release: bool, tolerance: f64) -> bool {
        let mut released = false;
        for (c, friction) in self.friction.iter_mut().enumerate() {
            if let Friction::Rim(y, z, turn) = friction {
                let pull = -(self.gradient[3 * c + 1] * *y + self.gradient[3 * c + 2] * *z);
                *turn = pull.abs() / self.disc[c];
                if release && pull < -tolerance {
                    *friction = Friction::Inside;
                    released = true;
                }
            }
        }
        released
    }

    /// The parts of the way from `l` to the target at which a contact meets its bounds.
    fn bound(&self, c: usize, l: &[f64]) -> Bound {
        let (i, radius) = (3 * c, self.disc[c]);
        let (y, z) = (self.target[i + 1], self.target[i + 2]);
        let mut bound = Bound { normal: f64::INFINITY, disc: f64::INFINITY };
        if self.friction[c] == Friction::Inside && y * y + z * z > radius * radius * (1.0 + 1e-12) {
            // |l + t d| = radius.
            let (dy, dz) = (y - l[i + 1], z - l[i + 2]);
            let (moved, half) = (dy * dy + dz * dz, l[i + 1] * dy + l[i + 2] * dz);
            let inside = (l[i + 1] * l[i + 1] + l[i + 2] * l[i + 2] - radius * radius).min(0.0);
            bound.disc = (((half * half - moved * inside).max(0.0).sqrt() - half) / moved).max(0.0);
        }
        if self.pressed[c] && self.target[i] < 0.0 {
            bound.normal = if l[i] > 0.0 { l[i] / (l[i] - self.target[i]) } else { 0.0 };
        }
        bound
    }

    /// How far `l` may go toward the target before a bound of the working set is met or a rim has turned far; rims that are near already and met
    /// within the first part `together` of the way do not count. And whether a contact may not move at all.
    fn first_bound(&self, l: &[f64], together: f64) -> (f64, bool) {
        let (mut part, mut stuck) = (1.0f64, false);
        for c in 0..self.disc.len() {
            let bound = self.bound(c, l);
            stuck |= bound.normal == 0.0;
            part = part.min(bound.normal);
            if bound.disc > together || !self.near_rim(c, l) {
                part = part.min(bound.disc);
            }
            if let Friction::Rim(..) = self.friction[c] {
                let (i, radius) = (3 * c, self.disc[c]);
                let moved = (self.target[i + 1] - l[i + 1]).powi(2) + (self.target[i + 2] - l[i + 2]).powi(2);
                if moved > (TURN * radius).powi(2) {
                    part = part.min(TURN * radius / moved.sqrt());
                }
            }
        }
        (part, stuck)
    }

    /// Takes the contacts that overlap most into the working set: those that overlap nearly as much as the worst and do not depend on each
    /// other, or one. False when none overlaps.
    fn enter(&mut self, s: &[f64], n: usize, tolerance: f64, eager: bool) -> bool {
        self.waiting.clear();
        self.waiting.extend((0..n / 3).filter(|c| !self.pressed[*c] && self.gradient[3 * c] < -tolerance).map(|c| (self.gradient[3 * c], c)));
        self.waiting.sort_unstable_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        let mut entered = 0;
        for k in 0..self.waiting.len() {
            let (overlap, c) = self.waiting[k];
            if overlap > 0.3 * self.waiting[0].0 || entered > 0 && !eager {
                break;
            }
            let apart = |d: usize| s[3 * c * n + 3 * d].powi(2) < 0.25 * s[3 * c * n + 3 * c] * s[3 * d * n + 3 * d];
            if self.waiting[..entered].iter().all(|(_, d)| apart(*d)) {
                self.pressed[c] = true;
                self.waiting.swap(entered, k);
                entered += 1;
            }
        }
        entered > 0
    }

    /// Whether a factored unknown still is one of the working set, or nearly.
    fn stands(&self, unknown: &Unknown, diagonal: f64, stale: f64) -> bool {
        let c = unknown.contact / 3;
        match (unknown.kind, self.friction[c]) {
            (Kind::Component(0), _) => self.pressed[c],
            (Kind::Component(_), friction) => friction == Friction::Inside,
            (Kind::Turn(ty, tz), Friction::Rim(y, z, turn)) => {
                (ty * y + tz * z).abs() <= stale && (turn - unknown.turn).abs() <= stale * (diagonal + unknown.turn)
            }
            (Kind::Turn(..), _) => false,
        }
    }

    /// Makes the factored set the working set. False when its matrix is not positive definite.
    fn factor_working_set(&mut self, s: &[f64], n: usize, stale: f64) -> bool {
        let m = n / 3;
        // What of each contact is factored: a bit for its normal force, one for its friction.
        let mut have = core::mem::take(&mut self.have);
        have.clear();
        have.resize(m, 0u8);
        for k in (0..self.unknowns.len()).rev() {
            let unknown = self.unknowns[k];
            let bit = if unknown.kind == Kind::Component(0) { 1 } else { 2 };
            if self.stands(&unknown, tangential(s, n, unknown.contact), stale) {
                have[unknown.contact / 3] |= bit;
            } else {
                self.left -= 0.5 * ((self.unknowns.len() - k) as f64).powi(2);
                self.factor.remove(k);
                self.unknowns.remove(k);
            }
        }
        let mut positive = true;
        for c in 0..m {
            let contact = 3 * c;
            if self.pressed[c] && have[c] & 1 == 0 {
                positive &= self.push(s, n, Unknown { contact, kind: Kind::Component(0), turn: 0.0 });
            }
            match self.friction[c] {
                Friction::Inside if have[c] & 2 == 0 => {
                    for a in [1, 2] {
                        positive &= self.push(s, n, Unknown { contact, kind: Kind::Component(a), turn: 0.0 });
                    }
                }
                Friction::Rim(y, z, turn) if have[c] & 2 == 0 => positive &= self.push(s, n, Unknown { contact, kind: Kind::Turn(-z, y), turn }),
                _ => {}
            }
        }
        self.have = have;
        positive
    }

    fn push(&mut self, s: &[f64], n: usize, unknown: Unknown) -> bool {
        let row = unknown.row(s, n, &mut self.row);
        self.left -= 0.5 * (self.unknowns.len() as f64).powi(2);
        let pushed = self.factor.push(self.unknowns.iter().map(|u| u.of(row)).chain([unknown.of(row) + unknown.turn]));
        if pushed {
            self.unknowns.push(unknown);
        }
        pushed
    }

    /// Minimizes over the working set without bounds, from the gradient at `l`; the minimum is left in `target`. False when its matrix is not positive
    /// definite.
    fn solve_working_set(&mut self, s: &[f64], l: &[f64], stale: f64) -> bool {
        if !self.factor_working_set(s, l.len(), stale) {
            return false;
        }
        self.left -= (self.unknowns.len() as f64).powi(2);
        self.right.clear();
        // The right side is that of the rims as they are, also where the matrix is of what they were.
        for k in 0..self.unknowns.len() {
            let now = self.now(&self.unknowns[k]);
            self.right.push(-now.of(&self.gradient));
        }
        self.factor.solve(&mut self.right);
        self.target.copy_from_slice(l);
        for k in 0..self.unknowns.len() {
            let (now, x) = (self.now(&self.unknowns[k]), self.right[k]);
            add(&now, x, &mut self.target);
        }
        true
    }

    /// The unknown with its rim's direction as it is now.
    fn now(&self, unknown: &Unknown) -> Unknown {
        match (unknown.kind, self.friction[unknown.contact / 3]) {
            (Kind::Turn(..), Friction::Rim(y, z, turn)) => Unknown { kind: Kind::Turn(-z, y), turn, ..*unknown },
            _ => *unknown,
        }
    }

    /// Solves the working set with every disc of a contact on its rim following its normal force; the solution is left in `target`. False when it has
    /// none.
    fn following_discs(&mut self, s: &[f64], b: &[f64], mu: &[f64]) -> bool {
        let n = b.len();
        // A pressed contact's friction only.
        let mut set = core::mem::take(&mut self.unknowns);
        let factored = set.len();
        for k in 0..factored {
            let now = self.now(&set[k]);
            if self.pressed[now.contact / 3] {
                set.push(now);
            }
        }
        let unknowns = &set[factored..];
        let k = unknowns.len();
        self.left -= (k * k * k) as f64 / 3.0;
        self.dense.clear();
        self.right.clear();
        for u in unknowns {
            let row = u.row(s, n, &mut self.row);
            for v in unknowns {
                let j = v.contact;
                let drag = match (v.kind, self.friction[j / 3]) {
                    (Kind::Component(0), Friction::Rim(y, z, _)) => mu[j / 3] * (y * row[j + 1] + z * row[j + 2]),
                    _ => 0.0,
                };
                self.dense.push(v.of(row) + drag + if u == v { u.turn } else { 0.0 });
            }
            self.right.push(-u.of(b));
        }
        let solved = solve_dense(&mut self.dense, &mut self.right);
        if solved {
            self.target.fill(0.0);
            for (u, x) in unknowns.iter().zip(&self.right) {
                add(u, *x, &mut self.target);
                if let (Kind::Component(0), Friction::Rim(y, z, _)) = (u.kind, self.friction[u.contact / 3]) {
                    self.target[u.contact + 1] += mu[u.contact / 3] * y * x;
                    self.target[u.contact + 2] += mu[u.contact / 3] * z * x;
                }
            }
        }
        set.truncate(factored);
        self.unknowns = set;
        solved
    }
}

/// The parts of a way at which a contact meets its bounds.
#[derive(Debug, Clone, Copy)]
struct Bound {
    normal: f64,
    disc: f64,
}

fn add(unknown: &Unknown, x: f64, v: &mut [f64]) {
    let i = unknown.contact;
    match unknown.kind {
        Kind::Component(a) => v[i + a] += x,
        Kind::Turn(y, z) => {
            v[i + 1] += y * x;
            v[i + 2] += z * x;
        }
    }
}

/// The larger tangential compliance of the contact whose components start at `i`.
#[inline]
fn tangential(s: &[f64], n: usize, i: usize) -> f64 {
    s[(i + 1) * n + i + 1].max(s[(i + 2) * n + i + 2])
}

#[inline]
fn onto_disc(y: f64, z: f64, radius: f64) -> (f64, f64) {
    let size = (y * y + z * z).sqrt();
    if size > radius { (y * radius / size, z * radius / size) } else { (y, z) }
}

/// Gauss elimination with row pivoting: replaces `x` by the solution. False when the matrix is singular.
fn solve_dense(a: &mut [f64], x: &mut [f64]) -> bool {
    let n = x.len();
    for k in 0..n {
        let pivot = (k..n).max_by(|i, j| a[i * n + k].abs().total_cmp(&a[j * n + k].abs())).expect("k < n");
        if pivot != k {
            x.swap(pivot, k);
            for c in k..n {
                a.swap(pivot * n + c, k * n + c);
            }
        }
        let inv = 1.0 / a[k * n + k];
        if !inv.is_finite() {
            return false;
        }
        let (top, bottom) = a.split_at_mut((k + 1) * n);
        let pivot = &top[k * n + k + 1..];
        for i in k + 1..n {
            let row = &mut bottom[(i - k - 1) * n + k..(i - k) * n];
            let f = row[0] * inv;
            if f != 0.0 {
                for (r, p) in row[1..].iter_mut().zip(pivot) {
                    *r -= f * p;
                }
                x[i] -= f * x[k];
            }
        }
    }
    for k in (0..n).rev() {
        x[k] = (x[k] - dot(&a[k * n + k + 1..(k + 1) * n], &x[k + 1..])) / a[k * n + k];
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random(seed: &mut u64) -> f64 {
        *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    }

    /// S = G G^T of low rank plus a small diagonal: redundant contacts, as on parallel strands.
    fn problem(m: usize, rank: usize, seed: &mut u64) -> (Vec<f64>, Vec<f64>) {
        let n = 3 * m;
        let g: Vec<f64> = (0..n * rank).map(|_| random(seed)).collect();
        let mut s = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..n {
                s[i * n + j] = (0..rank).map(|k| g[i * rank + k] * g[j * rank + k]).sum::<f64>() + if i == j { 1e-3 } else { 0.0 };
            }
        }
        (s, (0..n).map(|_| random(seed)).collect())
    }

    #[test]
    fn satisfies_coulomb_on_redundant_contacts() {
        let mut seed = 3;
        let mut cone = Cone::default();
        for (m, rank) in [(1, 3), (4, 6), (10, 20), (25, 30), (40, 60)] {
            for mu in [0.0, 0.1, 0.4] {
                let (s, b) = problem(m, rank, &mut seed);
                let n = 3 * m;
                let mut l = vec![0.0; n];
                let r = cone.solve(&s, &b, &vec![mu; m], &mut l, &Limits { residual: 1e-8, rounds: 100, steps: 200, work: f64::INFINITY });
                assert!(r < 1e-6, "{m} contacts, mu {mu}: residual {r:e}");
                for c in 0..m {
                    let g = |i: usize| b[i] + dot(&s[i * n..i * n + n], &l);
                    let (gap, force) = (g(3 * c), l[3 * c]);
                    assert!(force >= 0.0 && gap > -1e-5 && (gap * force).abs() < 1e-5, "gap {gap:e}, force {force}");
                    let (ty, tz) = (l[3 * c + 1], l[3 * c + 2]);
                    let (uy, uz) = (g(3 * c + 1), g(3 * c + 2));
                    let (size, slip) = ((ty * ty + tz * tz).sqrt(), (uy * uy + uz * uz).sqrt());
                    assert!(size <= mu * force + 1e-6);
                    if slip > 1e-4 && force > 1e-4 {
                        // Sliding: friction at its limit and against the slip.
                        assert!((size - mu * force).abs() < 1e-4 && (ty * uy + tz * uz + size * slip).abs() < 1e-3 * (size * slip).max(1e-3));
                    }
                }
            }
        }
    }
}
