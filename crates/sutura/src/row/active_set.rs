//! The small contact problem: minimize `l^T S l / 2 + b^T l` over normal forces >= 0 and friction forces within a disc.
//!
//! S is the compliance between contacts, symmetric positive definite (the contacts' own compliance is on its diagonal)
//! and ill conditioned: of forty near contacts in a knot some eight carry, and the others are nearly dependent on them.
//! With the radius of each disc held fixed the problem is convex; the radii follow mu times the normal forces in an
//! outer loop. Taking the disc as part of a cone instead would lift a sliding contact (associated friction), which
//! Coulomb's law does not.
//!
//! For fixed discs a primal active-set method (for the normals that of Lawson and Hanson 1974): a working set of normal
//! forces and of friction forces inside their discs (two unknowns) or on their rims (one, the turn along the rim), a
//! direct solution on it, a step up to the first bound that it meets. At the optimum of a set the contact that overlaps
//! most enters, and friction that is pulled inward leaves its rim. The matrix is a [`Delassus`]. Up to the return to a
//! rim each step lowers the objective; a budget ends what does not. Dependent contacts never share a working set for
//! long, which is what makes sweeps and projected methods fail here.
//!
//! The radii's loop alone would take some eight rounds. Once a set is found, one Newton step solves it with every
//! radius following its normal force (a nonsymmetric system); mostly that is the answer.

use crate::row::delassus::{Delassus, Friction, WorkingSet};

/// Tolerance and limits of a solve.
#[derive(Debug, Clone, Copy, Default)]
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
/// Turn of a rim \[rad\], and change of its stiffness over what the diagonal was, beyond which its row is factored
/// again.
const STALE: f64 = 1e-3;

/// How much less exact the rims are in the first round: its radii are those of the last forces, and Newton on the radii
/// turns the rims too.
const FIRST: f64 = 100.0;

/// Radius of a disc that no friction force reaches \[N\].
const WIDE: f64 = 1e9;

/// Memory of the solver.
#[derive(Default)]
pub(crate) struct ActiveSet {
    set: WorkingSet,
    disc: Vec<f64>,
    gradient: Vec<f64>,
    /// Solution on the working set.
    target: Vec<f64>,
    best: Vec<f64>,
    waiting: Vec<(f64, usize)>,
    /// Multiplications that may still be spent.
    left: f64,
}

impl ActiveSet {
    /// The same from where everything sticks. What is wedged, and would slide out of a wedge without friction, is found
    /// from there only: friction and pressure that bear each other do not grow from nothing.
    pub fn solve_from_stick(
        &mut self,
        s: &mut impl Delassus,
        b: &[f64],
        mu: &[f64],
        l: &mut [f64],
        limits: &Limits,
    ) -> f64 {
        let n = b.len();
        l.fill(0.0);
        for v in [&mut self.gradient, &mut self.target] {
            v.clear();
            v.resize(n, 0.0);
        }
        self.left = limits.work;
        self.set.pressed.clear();
        self.set.pressed.resize(n / 3, false);
        self.set.friction.clear();
        self.set.friction.resize(n / 3, Friction::None);
        self.disc.clear();
        self.disc.resize(n / 3, 0.0);
        for (c, mu) in mu.iter().enumerate() {
            self.set_disc(c, if *mu > 0.0 { WIDE } else { 0.0 }, l);
        }
        self.find_gradient(s, b, l);
        self.fixed_discs(s, b, l, limits.residual, limits.steps, FIRST);
        let spent = limits.work - self.left;
        self.solve(s, b, mu, l, &Limits { work: limits.work - spent, ..*limits })
    }

    /// Solves for `l` (three components a contact: normal, two tangential), starting from its value. `mu` is the
    /// coefficient of each contact. Returns the residual reached \[m\].
    pub fn solve(&mut self, s: &mut impl Delassus, b: &[f64], mu: &[f64], l: &mut [f64], limits: &Limits) -> f64 {
        let n = b.len();
        let m = n / 3;
        for v in [&mut self.gradient, &mut self.target, &mut self.best] {
            v.clear();
            v.resize(n, 0.0);
        }
        self.left = limits.work;
        self.set.pressed.clear();
        self.set.friction.clear();
        self.set.friction.resize(m, Friction::None);
        self.disc.clear();
        self.disc.resize(m, 0.0);
        for c in 0..m {
            l[3 * c] = l[3 * c].max(0.0);
            self.set.pressed.push(l[3 * c] > 0.0);
            self.set_disc(c, mu[c] * l[3 * c], l);
        }
        self.find_gradient(s, b, l);
        let mut reached = self.residual(s, mu, l);
        self.best.copy_from_slice(l);
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
                    self.set.pressed[c] = l[3 * c] > 0.0;
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

    /// Replaces changes of the gaps and slips by those of the forces on the last working set. False when there are
    /// none.
    pub fn response(&mut self, s: &mut impl Delassus, change: &mut [f64]) -> bool {
        self.gradient.copy_from_slice(change);
        let solved = s.solve_set(&self.set, &self.gradient, STALE, change);
        self.left -= s.spent();
        solved
    }

    /// Multiplications that the last solve might still have spent.
    pub fn left(&self) -> f64 {
        self.left
    }

    /// Makes `target` admissible; its residual. It is the best so far where that is less than `reached`.
    fn judge(&mut self, s: &mut impl Delassus, b: &[f64], mu: &[f64], reached: &mut f64) -> f64 {
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
        self.set.friction[c] = if radius <= 0.0 {
            (l[i + 1], l[i + 2]) = (0.0, 0.0);
            Friction::None
        } else if let Friction::Rim(y, z, turn) = self.set.friction[c] {
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
    fn find_gradient(&mut self, s: &mut impl Delassus, b: &[f64], l: &[f64]) {
        self.gradient.copy_from_slice(b);
        s.add_product(l, &mut self.gradient);
    }

    /// Largest violation of complementarity with discs of mu times the normal forces \[m\].
    fn residual(&self, s: &impl Delassus, mu: &[f64], l: &[f64]) -> f64 {
        let g = &self.gradient;
        let mut worst = 0.0f64;
        for c in 0..mu.len() {
            let i = 3 * c;
            worst = worst.max(g[i].min(l[i] * s.diagonal(i)).abs());
            let d = s.tangential(i);
            let (y, z) = onto_disc(l[i + 1] - g[i + 1] / d, l[i + 2] - g[i + 2] / d, mu[c] * l[i]);
            worst = worst.max(d * ((y - l[i + 1]).powi(2) + (z - l[i + 2]).powi(2)).sqrt());
        }
        worst
    }

    /// Minimizes over normal forces and friction forces in the discs as they are, from the gradient at `l`, and leaves
    /// it there. Rims count as at rest when they turn by no more than `loose` times the tolerance.
    fn fixed_discs(&mut self, s: &mut impl Delassus, b: &[f64], l: &mut [f64], tolerance: f64, steps: u32, loose: f64) {
        let m = b.len() / 3;
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
                match self.set.friction[c] {
                    Friction::Rim(y, z, turn) => {
                        let size = (l[i + 1] * l[i + 1] + l[i + 2] * l[i + 2]).sqrt();
                        if size > 0.0 {
                            (l[i + 1], l[i + 2]) = (l[i + 1] * radius / size, l[i + 2] * radius / size);
                            self.set.friction[c] = Friction::Rim(l[i + 1] / radius, l[i + 2] / radius, turn);
                            let moved = ((l[i + 1] - radius * y).powi(2) + (l[i + 2] - radius * z).powi(2)).sqrt();
                            turned = turned.max(s.tangential(i) * moved);
                        }
                    }
                    Friction::Inside if bound.disc <= part || eager && near && bound.disc <= TOGETHER => {
                        let [y, z] = [1, 2].map(|a| before[a] + bound.disc * (self.target[i + a] - before[a]));
                        let size = (y * y + z * z).sqrt();
                        if size > 0.0 {
                            (l[i + 1], l[i + 2]) = (y * radius / size, z * radius / size);
                            self.set.friction[c] = Friction::Rim(y / size, z / size, 0.0);
                        }
                    }
                    _ => {}
                }
                if bound.normal <= part {
                    self.set.pressed[c] = false;
                    l[i] = 0.0;
                }
            }
            self.find_gradient(s, b, l);
            let overlap = (0..m).filter(|c| !self.set.pressed[*c]).map(|c| -self.gradient[3 * c]).fold(0.0, f64::max);
            // Where much is still to come the rims need not be exact.
            let exact = tolerance * loose;
            let optimal = part >= 1.0 && turned <= exact.max(0.03 * overlap);
            let released = self.find_pulls(optimal, tolerance);
            if optimal && !released && !self.enter(s, m, tolerance, eager) && turned <= exact {
                break;
            }
        }
    }

    /// Whether a friction force is within a fiftieth of its rim.
    fn near_rim(&self, c: usize, l: &[f64]) -> bool {
        l[3 * c + 1].powi(2) + l[3 * c + 2].powi(2) > (0.98 * self.disc[c]).powi(2)
    }

    /// How hard each friction force on its rim is pulled outward, which holds it against turning. One that is pulled
    /// inward leaves its rim when `release`; before it is held as if it were pulled outward, or it would turn far for
    /// nothing. Whether any left.
    fn find_pulls(&mut self, release: bool, tolerance: f64) -> bool {
        let mut released = false;
        for (c, friction) in self.set.friction.iter_mut().enumerate() {
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
        if self.set.friction[c] == Friction::Inside && y * y + z * z > radius * radius * (1.0 + 1e-12) {
            // |l + t d| = radius.
            let (dy, dz) = (y - l[i + 1], z - l[i + 2]);
            let (moved, half) = (dy * dy + dz * dz, l[i + 1] * dy + l[i + 2] * dz);
            let inside = (l[i + 1] * l[i + 1] + l[i + 2] * l[i + 2] - radius * radius).min(0.0);
            bound.disc = (((half * half - moved * inside).max(0.0).sqrt() - half) / moved).max(0.0);
        }
        if self.set.pressed[c] && self.target[i] < 0.0 {
            bound.normal = if l[i] > 0.0 { l[i] / (l[i] - self.target[i]) } else { 0.0 };
        }
        bound
    }

    /// How far `l` may go toward the target before a bound of the working set is met or a rim has turned far; rims that
    /// are near already and met within the first part `together` of the way do not count. And whether a contact may not
    /// move at all.
    fn first_bound(&self, l: &[f64], together: f64) -> (f64, bool) {
        let (mut part, mut stuck) = (1.0f64, false);
        for c in 0..self.disc.len() {
            let bound = self.bound(c, l);
            stuck |= bound.normal == 0.0;
            part = part.min(bound.normal);
            if bound.disc > together || !self.near_rim(c, l) {
                part = part.min(bound.disc);
            }
            if let Friction::Rim(..) = self.set.friction[c] {
                let (i, radius) = (3 * c, self.disc[c]);
                let moved = (self.target[i + 1] - l[i + 1]).powi(2) + (self.target[i + 2] - l[i + 2]).powi(2);
                if moved > (TURN * radius).powi(2) {
                    part = part.min(TURN * radius / moved.sqrt());
                }
            }
        }
        (part, stuck)
    }

    /// Takes the contacts that overlap most into the working set: those that overlap nearly as much as the worst and do
    /// not depend on each other, or one. False when none overlaps.
    fn enter(&mut self, s: &mut impl Delassus, m: usize, tolerance: f64, eager: bool) -> bool {
        self.waiting.clear();
        self.waiting.extend(
            (0..m)
                .filter(|c| !self.set.pressed[*c] && self.gradient[3 * c] < -tolerance)
                .map(|c| (self.gradient[3 * c], c)),
        );
        self.waiting.sort_unstable_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        s.none_entered();
        let mut entered = false;
        for (overlap, c) in &self.waiting {
            if *overlap > 0.3 * self.waiting[0].0 || entered && !eager {
                break;
            }
            if s.enters(*c) {
                self.set.pressed[*c] = true;
                entered = true;
            }
        }
        entered
    }

    /// Minimizes over the working set without bounds, from the gradient at `l`; the minimum is left in `target`. False
    /// when its matrix is not positive definite.
    fn solve_working_set(&mut self, s: &mut impl Delassus, l: &[f64], stale: f64) -> bool {
        let solved = s.solve_set(&self.set, &self.gradient, stale, &mut self.target);
        self.left -= s.spent();
        for (t, l) in self.target.iter_mut().zip(l) {
            *t += l;
        }
        solved
    }

    /// Solves the working set with every disc of a contact on its rim following its normal force; the solution is left
    /// in `target`. False when it has none.
    fn following_discs(&mut self, s: &mut impl Delassus, b: &[f64], mu: &[f64]) -> bool {
        let solved = s.solve_following(&self.set, b, mu, &mut self.target);
        self.left -= s.spent();
        solved
    }
}

/// The parts of a way at which a contact meets its bounds.
#[derive(Debug, Clone, Copy)]
struct Bound {
    normal: f64,
    disc: f64,
}

#[inline]
fn onto_disc(y: f64, z: f64, radius: f64) -> (f64, f64) {
    let size = (y * y + z * z).sqrt();
    if size > radius { (y * radius / size, z * radius / size) } else { (y, z) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::row::dense::Dense;
    use crate::row::ldl::dot;

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
                s[i * n + j] =
                    (0..rank).map(|k| g[i * rank + k] * g[j * rank + k]).sum::<f64>() + if i == j { 1e-3 } else { 0.0 };
            }
        }
        (s, (0..n).map(|_| random(seed)).collect())
    }

    fn dense(s: &[f64], n: usize) -> Dense {
        let mut dense = Dense::default();
        dense.begin(n);
        dense.s.copy_from_slice(s);
        dense
    }

    #[test]
    fn satisfies_coulomb_on_redundant_contacts() {
        let mut seed = 3;
        let mut cone = ActiveSet::default();
        for (m, rank) in [(1, 3), (4, 6), (10, 20), (25, 30), (40, 60)] {
            for mu in [0.0, 0.1, 0.4] {
                let (s, b) = problem(m, rank, &mut seed);
                let n = 3 * m;
                let mut l = vec![0.0; n];
                let r = cone.solve(
                    &mut dense(&s, n),
                    &b,
                    &vec![mu; m],
                    &mut l,
                    &Limits { residual: 1e-8, rounds: 100, steps: 200, work: f64::INFINITY },
                );
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
                        assert!(
                            (size - mu * force).abs() < 1e-4
                                && (ty * uy + tz * uz + size * slip).abs() < 1e-3 * (size * slip).max(1e-3)
                        );
                    }
                }
            }
        }
    }
}
