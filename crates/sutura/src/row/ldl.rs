//! A dense L D L^T factorization whose matrix grows by a row at the end and shrinks by any row, at the cost of a solve
//! instead of a factorization.

/// L below the diagonal and D on it, packed row after row.
#[derive(Debug, Default)]
pub(crate) struct Ldl {
    size: usize,
    packed: Vec<f64>,
    /// Per row how many of its first entries are zero at least, a multiple of what `dot` takes at once.
    zeros: Vec<usize>,
    work: Vec<f64>,
}

/// Numbers that `dot` takes at once.
const LANES: usize = 8;

/// First entry of a row.
#[inline]
fn row(k: usize) -> usize {
    k * (k + 1) / 2
}

impl Ldl {
    pub fn clear(&mut self) {
        self.size = 0;
        self.packed.clear();
        self.zeros.clear();
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
        let zeros = last[..n].iter().position(|v| *v != 0.0).unwrap_or(n) / LANES * LANES;
        // L y = a; then the row of L is y / D.
        for k in zeros..n {
            let from = zeros.max(self.zeros[k]).min(k);
            last[k] -= dot(&done[row(k) + from..row(k) + k], &last[from..k]);
        }
        for k in zeros..n {
            let y = last[k];
            last[k] = y / done[row(k) + k];
            pivot -= y * last[k];
        }
        last[n] = pivot;
        if !(sign * pivot > 0.0 && pivot.is_finite()) {
            self.packed.truncate(from);
            return false;
        }
        self.zeros.push(zeros);
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
        self.zeros.remove(k);
        self.zeros[k..].fill(0);
        self.size -= 1;
    }

    /// Replaces the right side by the solution.
    pub fn solve(&self, x: &mut [f64]) {
        let n = self.size;
        for k in 0..n {
            let (before, rest) = x.split_at_mut(k);
            let from = self.zeros[k].min(k);
            rest[0] -= dot(&self.packed[row(k) + from..row(k) + k], &before[from..]);
        }
        for k in 0..n {
            x[k] /= self.packed[row(k) + k];
        }
        for k in (0..n).rev() {
            let (before, rest) = x.split_at_mut(k);
            let f = rest[0];
            let from = self.zeros[k].min(k);
            for (v, l) in before[from..].iter_mut().zip(&self.packed[row(k) + from..row(k) + k]) {
                *v -= f * l;
            }
        }
    }
}

/// Dot product in eight interleaved sums: a fixed order that vectorizes.
#[inline]
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; LANES];
    let (ca, cb) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let tail: f64 = ca.remainder().iter().zip(cb.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in ca.zip(cb) {
        for k in 0..LANES {
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

    /// Blocks that do not depend on each other, and constraints between neighbors after them.
    #[test]
    fn solves_a_quasi_definite_matrix_with_zeros() {
        let (blocks, n) = (7, 7 * 6 + 6 * 3);
        let a = |i: usize, j: usize| {
            let (low, high) = (i.min(j), i.max(j));
            let moving = 6 * blocks;
            if high < moving {
                if low / 6 == high / 6 {
                    (-0.3 * (high - low) as f64).exp() + if i == j { 1.0 } else { 0.0 }
                } else {
                    0.0
                }
            } else if low < moving {
                let joint = (high - moving) / 3;
                if low / 6 == joint || low / 6 == joint + 1 { ((low * high) as f64).sin() } else { 0.0 }
            } else if i == j {
                -1e-10
            } else {
                0.0
            }
        };
        let mut factor = Ldl::default();
        for i in 0..n {
            let sign = if i < 6 * blocks { 1.0 } else { -1.0 };
            assert!(factor.push_signed((0..=i).map(|j| a(i, j)), sign));
        }
        assert!(!factor.push_signed((0..=n).map(|j| if j < n { 0.0 } else { 1.0 }), -1.0), "of the other sign");
        let right: Vec<f64> = (0..n).map(|i| (i as f64).cos()).collect();
        let mut x = right.clone();
        factor.solve(&mut x);
        for (i, b) in right.iter().enumerate() {
            let sum: f64 = (0..n).map(|j| a(i, j) * x[j]).sum();
            assert!((sum - b).abs() < 1e-10, "{i}: {sum} {b}");
        }
        // A row taken out, and put back at the end.
        factor.remove(3);
        let order: Vec<usize> = (0..n).filter(|i| *i != 3).chain([3]).collect();
        assert!(factor.push_signed(order.iter().map(|j| a(3, *j)), 1.0));
        let mut y: Vec<f64> = order.iter().map(|i| right[*i]).collect();
        factor.solve(&mut y);
        for (i, y) in order.iter().zip(&y) {
            assert!((y - x[*i]).abs() < 1e-8 * x.iter().fold(1.0, |m: f64, v| m.max(v.abs())), "{y} {}", x[*i]);
        }
    }
}
