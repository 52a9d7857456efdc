//! A symmetric band matrix and its factorization L D L^T without pivoting.

/// Subdiagonals that are kept: the joint at vertex i reaches from x of vertex i - 1 to z of vertex i + 1, 11 unknowns
/// in a row.
pub const HALF: usize = 10;
const WIDTH: usize = HALF + 1;

/// The lower triangle, row after row: entry (r, c) at `r * WIDTH + c + HALF - r`.
pub struct Band {
    n: usize,
    a: Vec<f64>,
}

impl Band {
    /// Zero, of `n` rows.
    pub fn new(n: usize) -> Self {
        Band { n, a: vec![0.0; n * WIDTH] }
    }
    /// Back to zero.
    pub fn clear(&mut self) {
        self.a.fill(0.0);
    }
    /// Adds to the entry of row `r` and column `c <= r`, which lies within the band.
    pub fn add(&mut self, r: usize, c: usize, v: f64) {
        self.a[r * WIDTH + c + HALF - r] += v;
    }
    /// The entry of row `r` and column `c <= r` within the band.
    #[cfg(test)]
    pub fn entry(&self, r: usize, c: usize) -> f64 {
        self.a[r * WIDTH + c + HALF - r]
    }
    /// Row and column `k` of the identity.
    pub fn fix(&mut self, k: usize) {
        self.a[k * WIDTH..(k + 1) * WIDTH].fill(0.0);
        for r in k + 1..self.n.min(k + WIDTH) {
            self.a[r * WIDTH + k + HALF - r] = 0.0;
        }
        self.a[k * WIDTH + HALF] = 1.0;
    }
    /// Puts L and D in the place of the matrix. False when it is not positive definite; the matrix is lost then.
    pub fn factor(&mut self) -> bool {
        for r in 0..self.n {
            let first = r.saturating_sub(HALF);
            let (above, row) = self.a.split_at_mut(r * WIDTH);
            let row = &mut row[..WIDTH];
            // Row of L times D, by forward substitution; divided by D afterwards.
            for c in first..r {
                let other = &above[c * WIDTH..(c + 1) * WIDTH];
                // Columns first..c of both rows: in row c they begin at first + HALF - c, which is not negative as c <
                // r.
                let (i, j, m) = (first + HALF - r, first + HALF - c, c - first);
                let mut s = row[c + HALF - r];
                for (x, y) in row[i..i + m].iter().zip(&other[j..j + m]) {
                    s -= x * y;
                }
                row[c + HALF - r] = s;
            }
            let mut pivot = row[HALF];
            for c in first..r {
                let k = c + HALF - r;
                let l = row[k] / above[c * WIDTH + HALF];
                pivot -= l * row[k];
                row[k] = l;
            }
            if !(pivot > 0.0 && pivot.is_finite()) {
                return false;
            }
            row[HALF] = pivot;
        }
        true
    }
    /// Solves in place with the factors.
    pub fn solve(&self, b: &mut [f64]) {
        for r in 0..self.n {
            let first = r.saturating_sub(HALF);
            let row = &self.a[r * WIDTH + first + HALF - r..r * WIDTH + HALF];
            let s: f64 = row.iter().zip(&b[first..r]).map(|(l, x)| l * x).sum();
            b[r] -= s;
        }
        for r in 0..self.n {
            b[r] /= self.a[r * WIDTH + HALF];
        }
        for r in (0..self.n).rev() {
            let first = r.saturating_sub(HALF);
            let x = b[r];
            for (l, y) in self.a[r * WIDTH + first + HALF - r..r * WIDTH + HALF].iter().zip(&mut b[first..r]) {
                *y -= l * x;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The matrix times the solution gives the right side back, with a fixed row among them; an indefinite matrix is
    /// refused.
    #[test]
    fn solves() {
        let n = 37;
        let entry = |r: usize, c: usize| if r == c { 30.0 + r as f64 } else { libm::sin((r * 7 + c * 3) as f64) };
        let mut band = Band::new(n);
        for r in 0..n {
            for c in r.saturating_sub(HALF)..=r {
                band.add(r, c, entry(r, c));
            }
        }
        band.fix(20);
        let full = |r: usize, c: usize| match (r == 20 || c == 20, r.abs_diff(c) > HALF) {
            (true, _) => f64::from(u8::from(r == c)),
            (_, true) => 0.0,
            _ => entry(r.max(c), r.min(c)),
        };
        let b: Vec<f64> = (0..n).map(|i| libm::cos(i as f64)).collect();
        let mut x = b.clone();
        assert!(band.factor());
        band.solve(&mut x);
        for r in 0..n {
            let s: f64 = (0..n).map(|c| full(r, c) * x[c]).sum();
            // Rounding of a well-conditioned system.
            assert!((s - b[r]).abs() < 1e-13, "row {r}: {s} for {}", b[r]);
        }
        band.clear();
        (0..n).for_each(|r| band.add(r, r, if r == 5 { -1.0 } else { 1.0 }));
        assert!(!band.factor());
    }
}
