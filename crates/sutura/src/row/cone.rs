//! The small contact problem: minimize `l^T S l / 2 + b^T l` over normal forces >= 0 and friction forces within a disc.
//!
//! S is the compliance between contacts, symmetric positive definite (the contacts' own compliance is on its diagonal). With the radius
//! of each disc held fixed the problem is convex; the radii follow mu times the normal forces in an outer loop, with a proximal term
//! that keeps redundant contacts (parallel strands) from swapping load. Taking the disc as part of a cone instead would lift a sliding
//! contact (associated friction), which Coulomb's law does not.
//!
//! Inner loop: two projected Gauss-Seidel sweeps, then Newton on the active set (bound normals and clamped friction taken out), project,
//! exact line search. Each part lowers the objective, so it converges; it ends on the natural residual.

/// Limits and tolerance of a solve. Residuals are in meters: how far a contact is from its complementarity.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits {
    /// Residual of the fixed-disc problem and of the whole \[m\].
    pub inner: f64,
    pub outer: f64,
    pub max_inner: u32,
    pub max_outer: u32,
    /// Weight of the proximal term over the normal compliance of a contact.
    pub proximal: f64,
}

/// Memory of the solver.
#[derive(Default)]
pub(crate) struct Cone {
    gradient: Vec<f64>,
    direction: Vec<f64>,
    image: Vec<f64>,
    candidate: Vec<f64>,
    center: Vec<f64>,
    prox: Vec<f64>,
    shifted: Vec<f64>,
    disc: Vec<f64>,
    unknowns: Vec<Unknown>,
    dense: Vec<f64>,
    right: Vec<f64>,
    best: Vec<f64>,
    row: Vec<f64>,
}

/// An unknown of the active-set system: a row of S combined from at most two components of a contact.
#[derive(Debug, Clone, Copy)]
struct Unknown {
    index: usize,
    /// Weights of components `index` and `index + 1`.
    weight: [f64; 2],
    extra: f64,
}

impl Cone {
    /// Solves for `l` (three components a contact: normal, two tangential), starting from its value. `s` is dense, row after row.
    /// `mu` is the coefficient of each contact. Returns the residual reached \[m\].
    pub fn solve(&mut self, s: &[f64], b: &[f64], mu: &[f64], l: &mut [f64], limits: &Limits) -> f64 {
        let n = b.len();
        let m = n / 3;
        for v in [
            &mut self.gradient,
            &mut self.direction,
            &mut self.image,
            &mut self.candidate,
            &mut self.center,
            &mut self.prox,
            &mut self.shifted,
            &mut self.best,
            &mut self.row,
        ] {
            v.clear();
            v.resize(n, 0.0);
        }
        self.disc.clear();
        self.disc.resize(m, 0.0);
        for c in 0..m {
            let i = 3 * c;
            // By the normal compliance in all directions: the tangential one may be a thousand times larger (a thread that spins freely),
            // and as a measure it would tie the normal force to its last value.
            self.prox[i..i + 3].fill(limits.proximal * s[i * n + i]);
            l[i] = l[i].max(0.0);
            self.disc[c] = mu[c] * l[i];
        }
        let mut reached = f64::INFINITY;
        for _ in 0..limits.max_outer {
            project(l, &self.disc);
            self.center.copy_from_slice(l);
            for i in 0..n {
                self.shifted[i] = b[i] - self.prox[i] * self.center[i];
            }
            self.refresh_gradient(s, l);
            self.inner(s, l, limits);
            // Residual of the problem without the proximal term, with discs that fit the normal forces.
            for c in 0..m {
                self.disc[c] = mu[c] * l[3 * c];
            }
            for i in 0..n {
                self.gradient[i] -= self.prox[i] * (l[i] - self.center[i]);
            }
            reached = self.residual(s, n, l);
            if reached < limits.outer {
                break;
            }
        }
        reached
    }

    /// gradient = S l + prox l + shifted.
    fn refresh_gradient(&mut self, s: &[f64], l: &[f64]) {
        let n = l.len();
        for i in 0..n {
            self.gradient[i] = self.shifted[i] + self.prox[i] * l[i] + dot(&s[i * n..i * n + n], l);
        }
    }

    fn inner(&mut self, s: &[f64], l: &mut [f64], limits: &Limits) {
        let n = l.len();
        let mut best = self.residual(s, n, l);
        self.best.copy_from_slice(l);
        for round in 0..limits.max_inner {
            if best < limits.inner {
                break;
            }
            if round > 0 {
                self.sweep(s, l, false);
                self.sweep(s, l, true);
                let r = self.residual(s, n, l);
                if r < best {
                    best = r;
                    self.best.copy_from_slice(l);
                    if best < limits.inner {
                        break;
                    }
                }
            }
            if !self.newton(s, l) {
                break;
            }
            let r = self.residual(s, n, l);
            if r < best {
                best = r;
                self.best.copy_from_slice(l);
            }
        }
        l.copy_from_slice(&self.best);
        self.refresh_gradient(s, l);
    }

    fn diagonal(&self, s: &[f64], n: usize, i: usize) -> f64 {
        s[i * n + i] + self.prox[i]
    }

    /// Largest violation of complementarity \[m\].
    fn residual(&self, s: &[f64], n: usize, l: &[f64]) -> f64 {
        let g = &self.gradient;
        let mut worst = 0.0f64;
        for c in 0..n / 3 {
            let i = 3 * c;
            worst = worst.max(g[i].min(l[i] * self.diagonal(s, n, i)).abs());
            let d = self.diagonal(s, n, i + 1).max(self.diagonal(s, n, i + 2));
            let (y, z) = (l[i + 1] - g[i + 1] / d, l[i + 2] - g[i + 2] / d);
            let (y, z) = onto_disc(y, z, self.disc[c]);
            worst = worst.max(d * ((y - l[i + 1]).powi(2) + (z - l[i + 2]).powi(2)).sqrt());
        }
        worst
    }

    /// One projected Gauss-Seidel sweep, forward or back.
    fn sweep(&mut self, s: &[f64], l: &mut [f64], back: bool) {
        let n = l.len();
        let m = n / 3;
        for q in 0..m {
            let c = if back { m - 1 - q } else { q };
            let i = 3 * c;
            let normal = (l[i] - self.gradient[i] / self.diagonal(s, n, i)).max(0.0);
            self.change(s, l, i, normal - l[i]);
            let disc = self.disc[c];
            if disc <= 0.0 && l[i + 1] == 0.0 && l[i + 2] == 0.0 {
                continue;
            }
            let (d1, d2) = (self.diagonal(s, n, i + 1), self.diagonal(s, n, i + 2));
            let cross = s[(i + 1) * n + i + 2];
            let det = d1 * d2 - cross * cross;
            let (g1, g2) = (self.gradient[i + 1], self.gradient[i + 2]);
            let (mut y, mut z) = (l[i + 1] - (d2 * g1 - cross * g2) / det, l[i + 2] - (d1 * g2 - cross * g1) / det);
            if y * y + z * z > disc * disc {
                // On the rim: a few projected gradient steps of the two-by-two problem.
                let step = 1.0 / d1.max(d2);
                (y, z) = (l[i + 1], l[i + 2]);
                for _ in 0..4 {
                    let (ey, ez) = (y - l[i + 1], z - l[i + 2]);
                    let (h1, h2) = (g1 + d1 * ey + cross * ez, g2 + cross * ey + d2 * ez);
                    (y, z) = onto_disc(y - h1 * step, z - h2 * step, disc);
                }
            }
            self.change(s, l, i + 1, y - l[i + 1]);
            self.change(s, l, i + 2, z - l[i + 2]);
        }
    }

    /// Adds `d` to one unknown and keeps the gradient.
    #[inline]
    fn change(&mut self, s: &[f64], l: &mut [f64], i: usize, d: f64) {
        if d == 0.0 {
            return;
        }
        let n = l.len();
        l[i] += d;
        for (g, r) in self.gradient.iter_mut().zip(&s[i * n..i * n + n]) {
            *g += r * d;
        }
        self.gradient[i] += self.prox[i] * d;
    }

    /// Newton on the active set with exact line search. False when no progress is possible.
    fn newton(&mut self, s: &[f64], l: &mut [f64]) -> bool {
        let n = l.len();
        let m = n / 3;
        self.unknowns.clear();
        self.candidate.fill(0.0);
        for c in 0..m {
            let i = 3 * c;
            if l[i] - self.gradient[i] / self.diagonal(s, n, i) > 0.0 {
                self.unknowns.push(Unknown { index: i, weight: [1.0, 0.0], extra: 0.0 });
            }
            let disc = self.disc[c];
            if disc <= 0.0 {
                continue;
            }
            let d = self.diagonal(s, n, i + 1).max(self.diagonal(s, n, i + 2));
            let (y, z) = (l[i + 1] - self.gradient[i + 1] / d, l[i + 2] - self.gradient[i + 2] / d);
            let size = (y * y + z * z).sqrt();
            if size <= disc {
                self.unknowns.push(Unknown { index: i + 1, weight: [1.0, 0.0], extra: 0.0 });
                self.unknowns.push(Unknown { index: i + 2, weight: [1.0, 0.0], extra: 0.0 });
            } else {
                // On the rim at direction (y, z): only the turn along the rim is unknown; its curvature adds stiffness.
                let (cy, cz) = (y / size, z / size);
                self.candidate[i + 1] = disc * cy;
                self.candidate[i + 2] = disc * cz;
                self.unknowns.push(Unknown { index: i + 1, weight: [-cz, cy], extra: (size / disc - 1.0) * d });
            }
        }
        let k = self.unknowns.len();
        if k > 0 {
            self.dense.clear();
            self.dense.resize(k * k, 0.0);
            self.right.clear();
            self.right.resize(k, 0.0);
            for p in 0..k {
                let u = self.unknowns[p];
                let i = u.index;
                let single = u.weight[1] == 0.0;
                let row: &[f64] = if single {
                    &s[i * n..i * n + n]
                } else {
                    for z in 0..n {
                        self.row[z] = u.weight[0] * s[i * n + z] + u.weight[1] * s[(i + 1) * n + z];
                    }
                    &self.row
                };
                for q in p..k {
                    let v = self.unknowns[q];
                    self.dense[p * k + q] = if v.weight[1] == 0.0 { row[v.index] } else { v.weight[0] * row[v.index] + v.weight[1] * row[v.index + 1] };
                }
                self.dense[p * k + p] += self.prox[i] + u.extra;
                let b = if single { self.shifted[i] } else { u.weight[0] * self.shifted[i] + u.weight[1] * self.shifted[i + 1] };
                self.right[p] = -b - dot(row, &self.candidate);
            }
            if !factor_upper(&mut self.dense, k) {
                return false;
            }
            solve_upper(&self.dense, &mut self.right);
            for p in 0..k {
                let u = self.unknowns[p];
                self.candidate[u.index] += u.weight[0] * self.right[p];
                if u.weight[1] != 0.0 {
                    self.candidate[u.index + 1] += u.weight[1] * self.right[p];
                }
            }
        }
        project(&mut self.candidate, &self.disc);
        for i in 0..n {
            self.direction[i] = self.candidate[i] - l[i];
        }
        let (mut slope, mut curvature) = (0.0, 0.0);
        for i in 0..n {
            self.image[i] = dot(&s[i * n..i * n + n], &self.direction) + self.prox[i] * self.direction[i];
            slope += self.gradient[i] * self.direction[i];
            curvature += self.image[i] * self.direction[i];
        }
        if !(curvature > 0.0 && slope < 0.0) {
            return false;
        }
        let t = (-slope / curvature).min(1.0);
        for i in 0..n {
            l[i] += t * self.direction[i];
            self.gradient[i] += t * self.image[i];
        }
        true
    }
}

#[inline]
fn onto_disc(y: f64, z: f64, radius: f64) -> (f64, f64) {
    let size = (y * y + z * z).sqrt();
    if size > radius { (y * radius / size, z * radius / size) } else { (y, z) }
}

fn project(l: &mut [f64], disc: &[f64]) {
    for (c, radius) in l.chunks_exact_mut(3).zip(disc) {
        c[0] = c[0].max(0.0);
        (c[1], c[2]) = onto_disc(c[1], c[2], *radius);
    }
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
                let limits = Limits { inner: 1e-9, outer: 1e-8, max_inner: 60, max_outer: 400, proximal: 0.03 };
                let r = cone.solve(&s, &b, &vec![mu; m], &mut l, &limits);
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
