//! The Delassus matrix put together: for few contacts. The factorization of the working set follows it row by row
//! ([`Ldl`]).

use crate::row::delassus::{Delassus, Friction, WorkingSet};
use crate::row::ldl::{Ldl, dot};

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

    /// With its rim's direction as it is now.
    fn now(&self, set: &WorkingSet) -> Unknown {
        match (self.kind, set.friction[self.contact / 3]) {
            (Kind::Turn(..), Friction::Rim(y, z, turn)) => Unknown { kind: Kind::Turn(-z, y), turn, ..*self },
            _ => *self,
        }
    }

    /// Adds `x` of it to a vector of components.
    fn add(&self, x: f64, v: &mut [f64]) {
        let i = self.contact;
        match self.kind {
            Kind::Component(a) => v[i + a] += x,
            Kind::Turn(y, z) => {
                v[i + 1] += y * x;
                v[i + 2] += z * x;
            }
        }
    }
}

/// S and the factorization of a working set.
#[derive(Default)]
pub(crate) struct Dense {
    n: usize,
    /// Row after row.
    pub s: Vec<f64>,
    /// The working set as factored.
    unknowns: Vec<Unknown>,
    following: Vec<Unknown>,
    factor: Ldl,
    right: Vec<f64>,
    row: Vec<f64>,
    matrix: Vec<f64>,
    /// Parts of each contact that are factored: a bit for its normal force, one for its friction.
    have: Vec<u8>,
    entered: Vec<usize>,
    spent: f64,
}

impl Dense {
    /// Makes it a matrix of `n` rows of zeros.
    pub fn begin(&mut self, n: usize) {
        self.n = n;
        self.s.clear();
        self.s.resize(n * n, 0.0);
        self.row.clear();
        self.row.resize(n, 0.0);
        self.unknowns.clear();
        self.factor.clear();
        self.spent = 0.0;
    }

    /// Whether a factored unknown still is one of the working set, or nearly.
    fn stands(&self, set: &WorkingSet, unknown: &Unknown, stale: f64) -> bool {
        let c = unknown.contact / 3;
        match (unknown.kind, set.friction[c]) {
            (Kind::Component(0), _) => set.pressed[c],
            (Kind::Component(_), friction) => friction == Friction::Inside,
            (Kind::Turn(ty, tz), Friction::Rim(y, z, turn)) => {
                let diagonal = self.tangential(unknown.contact);
                (ty * y + tz * z).abs() <= stale && (turn - unknown.turn).abs() <= stale * (diagonal + unknown.turn)
            }
            (Kind::Turn(..), _) => false,
        }
    }

    /// Makes the factored set the working set. False when its matrix is not positive definite.
    fn factor(&mut self, set: &WorkingSet, stale: f64) -> bool {
        let m = self.n / 3;
        let mut have = core::mem::take(&mut self.have);
        have.clear();
        have.resize(m, 0u8);
        // Taking out one after the other pays while they are few.
        let len = self.unknowns.len() as f64;
        let (mut apart, mut gone) = (0.0, 0.0);
        for (k, unknown) in self.unknowns.iter().enumerate() {
            if !self.stands(set, unknown, stale) {
                apart += 0.5 * (len - k as f64).powi(2) + 0.5 * len * len;
                gone += 1.0;
            }
        }
        if gone > 0.0 && apart > (len - gone).powi(3) / 6.0 {
            self.unknowns.clear();
            self.factor.clear();
        }
        for k in (0..self.unknowns.len()).rev() {
            let unknown = self.unknowns[k];
            let bit = if unknown.kind == Kind::Component(0) { 1 } else { 2 };
            if self.stands(set, &unknown, stale) {
                have[unknown.contact / 3] |= bit;
            } else {
                self.spent += 0.5 * ((self.unknowns.len() - k) as f64).powi(2);
                self.factor.remove(k);
                self.unknowns.remove(k);
            }
        }
        let mut positive = true;
        for c in 0..m {
            let contact = 3 * c;
            if set.pressed[c] && have[c] & 1 == 0 {
                positive &= self.push(Unknown { contact, kind: Kind::Component(0), turn: 0.0 });
            }
            match set.friction[c] {
                Friction::Inside if have[c] & 2 == 0 => {
                    for a in [1, 2] {
                        positive &= self.push(Unknown { contact, kind: Kind::Component(a), turn: 0.0 });
                    }
                }
                Friction::Rim(y, z, turn) if have[c] & 2 == 0 => {
                    positive &= self.push(Unknown { contact, kind: Kind::Turn(-z, y), turn });
                }
                _ => {}
            }
        }
        self.have = have;
        positive
    }

    fn push(&mut self, unknown: Unknown) -> bool {
        self.spent += 0.5 * (self.unknowns.len() as f64).powi(2);
        let Dense { n, s, factor, unknowns, .. } = self;
        let row = |a: usize| &s[(unknown.contact + a) * *n..(unknown.contact + a + 1) * *n];
        let pushed = match unknown.kind {
            Kind::Component(a) => {
                let row = row(a);
                factor.push(unknowns.iter().map(|u| u.of(row)).chain([unknown.of(row)]))
            }
            Kind::Turn(y, z) => {
                let (first, second) = (row(1), row(2));
                let of = |u: &Unknown| y * u.of(first) + z * u.of(second);
                factor.push(unknowns.iter().map(of).chain([of(&unknown) + unknown.turn]))
            }
        };
        if pushed {
            self.unknowns.push(unknown);
        }
        pushed
    }
}

impl Delassus for Dense {
    fn add_product(&mut self, l: &[f64], out: &mut [f64]) {
        for (k, v) in l.iter().enumerate().filter(|(_, v)| **v != 0.0) {
            for (o, r) in out.iter_mut().zip(&self.s[k * self.n..(k + 1) * self.n]) {
                *o += r * v;
            }
        }
    }

    fn diagonal(&self, i: usize) -> f64 {
        self.s[i * self.n + i]
    }

    fn none_entered(&mut self) {
        self.entered.clear();
    }

    fn enters(&mut self, c: usize) -> bool {
        let normal = |c: usize, d: usize| self.s[3 * c * self.n + 3 * d];
        let free = self.entered.iter().all(|d| normal(c, *d).powi(2) < 0.25 * normal(c, c) * normal(*d, *d));
        if free {
            self.entered.push(c);
        }
        free
    }

    fn solve_set(&mut self, set: &WorkingSet, gradient: &[f64], stale: f64, change: &mut [f64]) -> bool {
        if !self.factor(set, stale) {
            return false;
        }
        self.spent += (self.unknowns.len() as f64).powi(2) + (self.unknowns.len() * self.n) as f64;
        // The right side is that of the rims as they are, also where the matrix is of what they were.
        self.right.clear();
        self.right.extend(self.unknowns.iter().map(|u| -u.now(set).of(gradient)));
        self.factor.solve(&mut self.right);
        change.fill(0.0);
        for (unknown, x) in self.unknowns.iter().zip(&self.right) {
            unknown.now(set).add(*x, change);
        }
        true
    }

    fn solve_following(&mut self, set: &WorkingSet, b: &[f64], mu: &[f64], forces: &mut [f64]) -> bool {
        // A pressed contact's friction only.
        let mut unknowns = core::mem::take(&mut self.following);
        unknowns.clear();
        for c in (0..self.n / 3).filter(|c| set.pressed[*c]) {
            let contact = 3 * c;
            unknowns.push(Unknown { contact, kind: Kind::Component(0), turn: 0.0 });
            match set.friction[c] {
                Friction::Inside => {
                    unknowns.extend([1, 2].map(|a| Unknown { contact, kind: Kind::Component(a), turn: 0.0 }));
                }
                Friction::Rim(y, z, turn) => unknowns.push(Unknown { contact, kind: Kind::Turn(-z, y), turn }),
                Friction::None => {}
            }
        }
        let following = &unknowns[..];
        let k = following.len();
        self.spent += (k * k * k) as f64 / 3.0;
        self.matrix.clear();
        self.right.clear();
        for u in following {
            let row = u.row(&self.s, self.n, &mut self.row);
            for v in following {
                let j = v.contact;
                let drag = match (v.kind, set.friction[j / 3]) {
                    (Kind::Component(0), Friction::Rim(y, z, _)) => mu[j / 3] * (y * row[j + 1] + z * row[j + 2]),
                    _ => 0.0,
                };
                self.matrix.push(v.of(row) + drag + if u == v { u.turn } else { 0.0 });
            }
            self.right.push(-u.of(b));
        }
        let solved = solve_dense(&mut self.matrix, &mut self.right);
        if solved {
            forces.fill(0.0);
            for (u, x) in following.iter().zip(&self.right) {
                u.add(*x, forces);
                if let (Kind::Component(0), Friction::Rim(y, z, _)) = (u.kind, set.friction[u.contact / 3]) {
                    forces[u.contact + 1] += mu[u.contact / 3] * y * x;
                    forces[u.contact + 2] += mu[u.contact / 3] * z * x;
                }
            }
        }
        self.following = unknowns;
        solved
    }

    fn spent(&mut self) -> f64 {
        core::mem::take(&mut self.spent)
    }
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
