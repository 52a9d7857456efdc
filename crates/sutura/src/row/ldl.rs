//! A dense L D L^T factorization whose matrix grows by a row at the end and shrinks by any row, at the cost of a solve
//! instead of a factorization.

/// L below the diagonal and D on it, packed row after row.
#[derive(Debug, Default)]
pub(crate) struct Ldl {
    size: usize,
    packed: Vec<f64>,
    work: Vec<f64>,
}

/// First entry of a row.
#[inline]
fn row(k: usize) -> usize {
    k * (k + 1) / 2
}

impl Ldl {
    pub fn clear(&mut self) {
        self.size = 0;
        self.packed.clear();
    }

    /// Adds the last row of the grown matrix, diagonal included. False, and nothing added, when it is not positive
    /// definite.
    pub fn push(&mut self, entries: impl Iterator<Item = f64>) -> bool {
        self.push_signed(entries, 1.0)
    }

    /// The same of a matrix that is quasi-definite: the new pivot is to have this sign.
    pub fn push_signed(&mut self, entries: impl Iterator<Item = f64>, sign: f64) -> bool {
        let n = self.size;
        let from = self.packed.len();
        self.packed.extend(entries);
        let (done, last) = self.packed.split_at_mut(from);
        let mut pivot = last[n];
        // L y = a; then the row of L is y / D.
        for k in 0..n {
            last[k] -= dot(&done[row(k)..row(k) + k], &last[..k]);
        }
        for k in 0..n {
            let y = last[k];
            last[k] = y / done[row(k) + k];
            pivot -= y * last[k];
        }
        last[n] = pivot;
        if !(sign * pivot > 0.0 && pivot.is_finite()) {
            self.packed.truncate(from);
            return false;
        }
        self.size += 1;
        true
    }

    /// Takes row and column `k` out: what they had taken from those after them comes back, a positive update of rank
    /// one (Gill, Golub, Murray and Saunders 1974, method C1).
    pub fn remove(&mut self, k: usize) {
        let n = self.size;
        let mut weight = self.packed[row(k) + k];
        // Pivots and factors of the update so far.
        self.work.clear();
        self.work.resize(2 * n, 0.0);
        let (along, factor) = self.work.split_at_mut(n);
        let mut to = row(k);
        for i in k + 1..n {
            let from = row(i);
            let mut w = self.packed[from + k];
            self.packed.copy_within(from..from + k, to);
            for j in k + 1..i {
                let l = self.packed[from + j];
                w -= along[j] * l;
                self.packed[to + j - 1] = l + factor[j] * w;
            }
            let d = self.packed[from + i];
            let grown = d + weight * w * w;
            (along[i], factor[i]) = (w, weight * w / grown);
            weight *= d / grown;
            self.packed[to + i - 1] = grown;
            to += i;
        }
        self.packed.truncate(to);
        self.size -= 1;
    }

    /// Replaces the right side by the solution.
    pub fn solve(&self, x: &mut [f64]) {
        let n = self.size;
        for k in 0..n {
            let (before, rest) = x.split_at_mut(k);
            rest[0] -= dot(&self.packed[row(k)..row(k) + k], before);
        }
        for k in 0..n {
            x[k] /= self.packed[row(k) + k];
        }
        for k in (0..n).rev() {
            let (before, rest) = x.split_at_mut(k);
            let f = rest[0];
            for (v, l) in before.iter_mut().zip(&self.packed[row(k)..row(k) + k]) {
                *v -= f * l;
            }
        }
    }
}

/// Dot product in eight interleaved sums: a fixed order that vectorizes.
#[inline]
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_what_is_left_after_rows_came_and_went() {
        let n = 23;
        // Positive definite: a Gaussian of the distance.
        let a = |i: usize, j: usize| (-0.02 * (i as f64 - j as f64).powi(2)).exp() + if i == j { 0.1 } else { 0.0 };
        let mut factor = Ldl::default();
        let mut rows: Vec<usize> = vec![];
        let push = |factor: &mut Ldl, rows: &mut Vec<usize>, i: usize| {
            rows.push(i);
            assert!(factor.push(rows.iter().map(|j| a(i, *j))));
        };
        for i in 0..n {
            push(&mut factor, &mut rows, i);
        }
        let gone: Vec<usize> = [22, 0, 7, 13, 3, 3]
            .into_iter()
            .map(|k| {
                factor.remove(k);
                rows.remove(k)
            })
            .collect();
        for i in &gone[2..] {
            push(&mut factor, &mut rows, *i);
        }
        let right: Vec<f64> = rows.iter().map(|i| (*i as f64).sin()).collect();
        let mut x = right.clone();
        factor.solve(&mut x);
        for (i, b) in rows.iter().zip(&right) {
            let sum: f64 = rows.iter().zip(&x).map(|(j, x)| a(*i, *j) * x).sum();
            assert!((sum - b).abs() < 1e-12, "{sum} {b}");
        }
        // Nothing is added that depends on the rest.
        assert!(!factor.push(rows.iter().map(|j| a(10, *j)).chain([1.0])));
        let mut y = right.clone();
        factor.solve(&mut y);
        assert_eq!(x, y);
    }
}
