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
//! its rim. Up to the return to a rim each step lowers the objective; a budget ends what does not. Dependent contacts never share a working set
//! for long, which is what makes sweeps and projected methods fail here.

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
/// Steps after which contacts enter one at a time.
const EAGER: u32 = 15;

/// What a friction force may do.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Friction {
    /// Its disc is a point.
    None,
    Inside,
    /// On the rim in direction (y, z); stiffness against turning along it.
    Rim(f64, f64, f64),
}

/// An unknown of the working set.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    /// Component 0, 1 or 2 of the contact.
    Component(usize),
    /// The turn along the rim with tangent (y, z).
    Turn(f64, f64),
}

/// Memory of the solver.
#[derive(Default)]
pub(crate) struct Cone {
    pressed: Vec<bool>,
    friction: Vec<Friction>,
    disc: Vec<f64>,
    gradient: Vec<f64>,
    /// The force about which the working set is linearized, and its solution.
    base: Vec<f64>,
    target: Vec<f64>,
    best: Vec<f64>,
    /// First component of the contact and kind.
    unknowns: Vec<(usize, Kind)>,
    dense: Vec<f64>,
    right: Vec<f64>,
    row: Vec<f64>,
    waiting: Vec<(f64, usize)>,
    /// Multiplications that may still be spent.
    left: f64,
}

impl Cone {
    /// Solves for `l` (three components a contact: normal, two tangential), starting from its value. `s` is dense, row after row.
    /// `mu` is the coefficient of each contact. Returns the residual reached \[m\].
    pub fn solve(&mut self, s: &[f64], b: &[f64], mu: &[f64], l: &mut [f64], limits: &Limits) -> f64 {
        let n = b.len();
        let m = n / 3;
        for v in [&mut self.gradient, &mut self.base, &mut self.target, &mut self.best, &mut self.row] {
            v.clear();
            v.resize(n, 0.0);
        }
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
            self.fixed_discs(s, b, l, 0.3 * limits.residual, limits.steps);
            // With discs that fit the normal forces.
            self.target.copy_from_slice(l);
            for c in 0..m {
                let (y, z) = onto_disc(l[3 * c + 1], l[3 * c + 2], mu[c] * l[3 * c]);
                (self.target[3 * c + 1], self.target[3 * c + 2]) = (y, z);
            }
            let fitted = core::mem::take(&mut self.target);
            self.find_gradient(s, b, &fitted);
            let residual = self.residual(s, mu, &fitted);
            if residual < reached {
                reached = residual;
                self.best.copy_from_slice(&fitted);
            }
            self.target = fitted;
            for c in 0..m {
                let fit = mu[c] * l[3 * c];
                let slow = round >= SWING && self.disc[c] > 1e-9 * fit;
                self.set_disc(c, if slow { 0.5 * (fit + self.disc[c]) } else { fit }, l);
            }
        }
        l.copy_from_slice(&self.best);
        reached
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

    /// Minimizes over normal forces and friction forces in the discs as they are. Leaves the gradient at `l`.
    fn fixed_discs(&mut self, s: &[f64], b: &[f64], l: &mut [f64], tolerance: f64, steps: u32) {
        let (n, m) = (b.len(), b.len() / 3);
        let mut eager = true;
        for step in 0..steps {
            eager = eager && step < EAGER;
            if self.left < 0.0 || !self.solve_working_set(s, b) {
                break;
            }
            let (part, stuck) = self.first_bound(l);
            for (v, t) in l.iter_mut().zip(&self.target) {
                *v = if part < 1.0 { *v + part * (t - *v) } else { *t };
            }
            // A contact that entered with others and would leave at once: from now on one at a time.
            eager = eager && !stuck;
            let mut turned = false;
            for c in 0..m {
                let (i, radius) = (3 * c, self.disc[c]);
                let size = (l[i + 1] * l[i + 1] + l[i + 2] * l[i + 2]).sqrt();
                match self.friction[c] {
                    Friction::Rim(y, z, turn) if size > 0.0 => {
                        (l[i + 1], l[i + 2]) = (l[i + 1] * radius / size, l[i + 2] * radius / size);
                        self.friction[c] = Friction::Rim(l[i + 1] / radius, l[i + 2] / radius, turn);
                        let moved = ((l[i + 1] - radius * y).powi(2) + (l[i + 2] - radius * z).powi(2)).sqrt();
                        turned |= tangential(s, n, i) * moved > tolerance;
                    }
                    Friction::Inside if part < 1.0 && size >= radius * (1.0 - 1e-9) && size > 0.0 => {
                        let (y, z) = (self.target[i + 1], self.target[i + 2]);
                        if y * y + z * z > radius * radius {
                            self.friction[c] = Friction::Rim(l[i + 1] / size, l[i + 2] / size, 0.0);
                        }
                    }
                    _ => {}
                }
                if self.pressed[c] && self.target[i] < 0.0 && l[i] <= 1e-12 * (l[i] - self.target[i]) {
                    self.pressed[c] = false;
                    l[i] = 0.0;
                }
            }
            self.find_gradient(s, b, l);
            let optimal = part >= 1.0 && !turned;
            let mut released = false;
            for c in 0..m {
                if let Friction::Rim(y, z, _) = self.friction[c] {
                    let pull = -(self.gradient[3 * c + 1] * y + self.gradient[3 * c + 2] * z);
                    if optimal && pull < -tolerance {
                        self.friction[c] = Friction::Inside;
                        released = true;
                    } else {
                        self.friction[c] = Friction::Rim(y, z, (pull / self.disc[c]).max(0.0));
                    }
                }
            }
            if optimal && !released && !self.enter(s, n, tolerance, eager) {
                break;
            }
        }
    }

    /// How far `l` may go toward the target before a bound of the working set is met or a rim has turned far, and whether it may not move at all.
    fn first_bound(&self, l: &[f64]) -> (f64, bool) {
        let (mut part, mut stuck) = (1.0f64, false);
        for c in 0..self.disc.len() {
            let (i, radius) = (3 * c, self.disc[c]);
            let (y, z) = (self.target[i + 1], self.target[i + 2]);
            let (dy, dz) = (y - l[i + 1], z - l[i + 2]);
            let moved = dy * dy + dz * dz;
            match self.friction[c] {
                Friction::Inside if y * y + z * z > radius * radius * (1.0 + 1e-12) => {
                    // |l + t d| = radius.
                    let half = l[i + 1] * dy + l[i + 2] * dz;
                    let inside = (l[i + 1] * l[i + 1] + l[i + 2] * l[i + 2] - radius * radius).min(0.0);
                    part = part.min(((half * half - moved * inside).max(0.0).sqrt() - half) / moved).max(0.0);
                }
                Friction::Rim(..) if moved > (TURN * radius).powi(2) => part = part.min(TURN * radius / moved.sqrt()),
                _ => {}
            }
            if self.pressed[c] && self.target[i] < 0.0 {
                let way = if l[i] > 0.0 { l[i] / (l[i] - self.target[i]) } else { 0.0 };
                stuck |= way == 0.0;
                part = part.min(way);
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

    /// Minimizes over the working set without bounds; the minimum is left in `target`. False when its matrix is not positive definite.
    fn solve_working_set(&mut self, s: &[f64], b: &[f64]) -> bool {
        let n = b.len();
        self.unknowns.clear();
        self.base.fill(0.0);
        for c in 0..n / 3 {
            let i = 3 * c;
            if self.pressed[c] {
                self.unknowns.push((i, Kind::Component(0)));
            }
            match self.friction[c] {
                Friction::None => {}
                Friction::Inside => self.unknowns.extend([(i, Kind::Component(1)), (i, Kind::Component(2))]),
                Friction::Rim(y, z, _) => {
                    self.unknowns.push((i, Kind::Turn(-z, y)));
                    (self.base[i + 1], self.base[i + 2]) = (self.disc[c] * y, self.disc[c] * z);
                }
            }
        }
        let base = core::mem::take(&mut self.base);
        self.find_gradient(s, b, &base);
        let k = self.unknowns.len();
        self.left -= (k * k * k) as f64 / 6.0 + (k * n) as f64;
        self.dense.clear();
        self.dense.resize(k * k, 0.0);
        self.right.clear();
        for p in 0..k {
            let (i, kind) = self.unknowns[p];
            let (row, right): (&[f64], f64) = match kind {
                Kind::Component(a) => (&s[(i + a) * n..(i + a + 1) * n], self.gradient[i + a]),
                Kind::Turn(y, z) => {
                    for (v, (r1, r2)) in self.row.iter_mut().zip(s[(i + 1) * n..(i + 2) * n].iter().zip(&s[(i + 2) * n..(i + 3) * n])) {
                        *v = y * r1 + z * r2;
                    }
                    (&self.row, y * self.gradient[i + 1] + z * self.gradient[i + 2])
                }
            };
            self.right.push(-right);
            for (d, (j, other)) in self.dense[p * k + p..(p + 1) * k].iter_mut().zip(&self.unknowns[p..]) {
                *d = match other {
                    Kind::Component(a) => row[j + a],
                    Kind::Turn(y, z) => y * row[j + 1] + z * row[j + 2],
                };
            }
            if let (Kind::Turn(..), Friction::Rim(_, _, turn)) = (kind, self.friction[i / 3]) {
                self.dense[p * k + p] += turn;
            }
        }
        let positive = factor_upper(&mut self.dense, k);
        if positive {
            solve_upper(&self.dense, &mut self.right);
            self.target.copy_from_slice(&base);
            for ((i, kind), x) in self.unknowns.iter().zip(&self.right) {
                match kind {
                    Kind::Component(a) => self.target[i + a] += x,
                    Kind::Turn(y, z) => {
                        self.target[i + 1] += y * x;
                        self.target[i + 2] += z * x;
                    }
                }
            }
        }
        self.base = base;
        positive
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

/// Dot product in eight interleaved sums: a fixed order that vectorizes.
#[inline]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (ca, cb) = (a.chunks_exact(8), b.chunks_exact(8));
    let tail: f64 = ca.remainder().iter().zip(cb.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in ca.zip(cb) {
        for k in 0..8 {
            sums[k] += x[k] * y[k];
        }
    }
    ((sums[0] + sums[4]) + (sums[1] + sums[5])) + ((sums[2] + sums[6]) + (sums[3] + sums[7])) + tail
}

/// LDL^T of a symmetric matrix of which the upper triangle is given, row after row; leaves D on the diagonal and D L^T above it.
fn factor_upper(a: &mut [f64], n: usize) -> bool {
    for k in 0..n {
        let d = a[k * n + k];
        if !(d > 0.0 && d.is_finite()) {
            return false;
        }
        let inv = 1.0 / d;
        let (top, bottom) = a.split_at_mut((k + 1) * n);
        let pivot = &top[k * n + k + 1..];
        for i in k + 1..n {
            let f = pivot[i - k - 1] * inv;
            if f != 0.0 {
                let row = &mut bottom[(i - k - 1) * n + i..(i - k) * n];
                for (r, p) in row.iter_mut().zip(&pivot[i - k - 1..]) {
                    *r -= f * p;
                }
            }
        }
    }
    true
}

fn solve_upper(a: &[f64], x: &mut [f64]) {
    let n = x.len();
    for k in 0..n {
        let f = x[k] / a[k * n + k];
        x[k] = f;
        let (_, rest) = x.split_at_mut(k + 1);
        for (v, r) in rest.iter_mut().zip(&a[k * n + k + 1..(k + 1) * n]) {
            *v -= f * r;
        }
    }
    for k in (0..n).rev() {
        let s = dot(&a[k * n + k + 1..(k + 1) * n], &x[k + 1..]);
        x[k] -= s / a[k * n + k];
    }
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
