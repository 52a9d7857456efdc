//! The direct distance constraint (rows P-6, P-7): all lengths of a chain, `C_i = |x_i - x_(i+1)| - l_i` \[m\],
//! linearized and solved at once. `J W J^T` is tridiagonal, `w_i + w_(i+1)` beside `-w_(i+1) n_i . n_(i+1)`, n_i along
//! `x_i - x_(i+1)`; a held particle (w = 0) splits it by itself.
//!
//! Source: Han and Harada 2013; the paper's (12) to (15), whose `-1, -2` are those of equal masses and a first particle
//! that is held. Limits: an element held at both ends has no row; a straight chain between two held particles has one
//! row too many (the matrix is that of a path without ends): the row whose pivot vanishes is left out.

use super::number::{Number, Vec3};
use glam::DVec3;
use wide::f64x2;

/// Pivot over diagonal under which a row says nothing that others do not.
const DEPENDENT: f64 = 1e-12;

/// Working memory of one chain.
#[derive(Default)]
pub(super) struct Chain {
    normal: Vec<DVec3>,
    /// Upper part of the factor, and right side, then multipliers.
    upper: Vec<f64>,
    lambda: Vec<f64>,
}

impl Chain {
    pub fn resize(&mut self, n: usize) {
        self.normal.resize(n, DVec3::ZERO);
        self.upper.resize(n, 0.0);
        self.lambda.resize(n, 0.0);
    }

    /// One projection: `x` and `w` are the particles, `l` the lengths between them, one fewer.
    pub fn project(&mut self, x: &mut [DVec3], w: &[f64], l: &[f64]) {
        let n = l.len();
        let (x, w) = (&mut x[..=n], &w[..=n]);
        let (normal, upper, lambda) = (&mut self.normal[..n], &mut self.upper[..n], &mut self.lambda[..n]);
        let pairs = n / 2 * 2;
        for i in (0..pairs).step_by(2) {
            measure::<f64x2>(&x[i..i + 3], &l[i..i + 2], &mut normal[i..i + 2], &mut lambda[i..i + 2]);
        }
        if pairs < n {
            measure::<f64>(&x[pairs..], &l[pairs..], &mut normal[pairs..], &mut lambda[pairs..]);
        }
        // Thomas, each row with the pivot and the right side of the row before. Pivots are a chain of divisions:
        // nothing else is in it.
        let (mut taken, mut right, mut beside) = (0.0, 0.0, 0.0);
        for i in 0..n {
            let diagonal = w[i] + w[i + 1];
            let pivot = diagonal - taken;
            let next = if i + 1 < n { -w[i + 1] * normal[i].dot(normal[i + 1]) } else { 0.0 };
            let (inverse, square) =
                if pivot > DEPENDENT * diagonal { (1.0 / pivot, next * next / pivot) } else { (0.0, 0.0) };
            right = (lambda[i] - beside * right) * inverse;
            (upper[i], lambda[i]) = (next * inverse, right);
            (taken, beside) = (square, next);
        }
        let mut after = 0.0;
        let mut pull = DVec3::ZERO;
        for i in (0..n).rev() {
            after = lambda[i] - upper[i] * after;
            let own = normal[i] * after;
            // dx_i = -w_i (n_i lambda_i - n_(i-1) lambda_(i-1)).
            x[i + 1] += (own - pull) * w[i + 1];
            pull = own;
        }
        x[0] -= pull * w[0];
    }
}

/// Directions and errors of length of as many neighboring elements as there are lanes.
#[inline(always)]
fn measure<T: Number>(x: &[DVec3], l: &[f64], normal: &mut [DVec3], error: &mut [f64]) {
    let d = Vec3::<T>::each(|k| x[k].into()) - Vec3::each(|k| x[k + 1].into());
    let length = d.dot(d).sqrt();
    let inverse = T::each(|_| 1.0) / length;
    for k in 0..T::LANES {
        let own = DVec3::new(d.x.lane(k), d.y.lane(k), d.z.lane(k));
        normal[k] = if length.lane(k) > 0.0 { own * inverse.lane(k) } else { DVec3::ZERO };
        error[k] = length.lane(k) - l[k];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chain(n: usize, bend: f64, off: f64) -> Vec<DVec3> {
        let mut at = DVec3::ZERO;
        (0..=n)
            .map(|i| {
                let here = at;
                let s = i as f64;
                // Lengths are off by up to `off`, directions by `bend`.
                at += DVec3::new(1.0, bend * (1.3 * s).sin(), bend * (2.1 * s).cos()).normalize()
                    * (1.0 + off * (0.7 * s).sin());
                here
            })
            .collect()
    }
    fn elongation(x: &[DVec3]) -> f64 {
        x.windows(2).map(|p| ((p[1] - p[0]).length() - 1.0).abs()).fold(0.0, f64::max)
    }

    /// All rows of the linearized constraints, `C + J dx`, are zero after one go.
    #[test]
    fn linearized_lengths_are_met_at_once() {
        for (n, held) in [(40, vec![]), (39, vec![0]), (40, vec![0, 17]), (39, vec![5, 6, 30])] {
            let before = chain(n, 0.4, 0.05);
            let mut w: Vec<f64> = (0..=n).map(|i| 1.0 + 0.5 * (i as f64).cos()).collect();
            for i in &held {
                w[*i] = 0.0;
            }
            let mut x = before.clone();
            let mut c = Chain::default();
            c.resize(n);
            c.project(&mut x, &w, &vec![1.0; n]);
            for i in 0..n {
                if w[i] + w[i + 1] == 0.0 {
                    continue;
                }
                let d = before[i] - before[i + 1];
                let moved = (x[i] - before[i]) - (x[i + 1] - before[i + 1]);
                let left = d.length() - 1.0 + d.normalize().dot(moved);
                assert!(left.abs() < 1e-13, "row {i} with {held:?}: {left:e}");
            }
            for i in held {
                assert_eq!(x[i], before[i]);
            }
        }
    }

    /// What one projection leaves is of second order in what was wrong, and of a straight chain nothing.
    #[test]
    fn one_projection_leaves_second_order() {
        let left = |bend: f64, off: f64, passes: usize| {
            let mut x = chain(40, bend, off);
            let mut w = vec![1.0; 41];
            w[0] = 0.0;
            let mut c = Chain::default();
            c.resize(40);
            for _ in 0..passes {
                c.project(&mut x, &w, &[1.0; 40]);
            }
            elongation(&x)
        };
        assert!(left(0.0, 0.05, 1) < 1e-13, "{:e}", left(0.0, 0.05, 1));
        let [a, b] = [0.01, 0.005].map(|off| left(0.2, off, 1));
        assert!(a < 0.01 && (a / b - 4.0).abs() < 0.4, "{a:e} {b:e}");
        assert!(left(0.2, 0.01, 5) < 1e-13, "{:e}", left(0.2, 0.01, 5));
    }

    #[test]
    fn what_is_held_splits_the_chain() {
        let n = 30;
        let mut w = vec![1.0; n + 1];
        (w[0], w[12]) = (0.0, 0.0);
        let mut whole = chain(n, 0.3, 0.05);
        let mut parts = whole.clone();
        let mut c = Chain::default();
        c.resize(n);
        c.project(&mut whole, &w, &vec![1.0; n]);
        c.project(&mut parts[..=12], &w[..=12], &[1.0; 12]);
        c.project(&mut parts[12..], &w[12..], &[1.0; 18]);
        assert_eq!(whole, parts);
    }

    #[test]
    fn a_straight_chain_between_held_ends_keeps_finite() {
        let mut x: Vec<DVec3> = (0..=10).map(|i| DVec3::X * (1.1 * f64::from(i))).collect();
        let mut w = vec![1.0; 11];
        (w[0], w[10]) = (0.0, 0.0);
        let mut c = Chain::default();
        c.resize(10);
        c.project(&mut x, &w, &[1.0; 10]);
        // It cannot have its length; nine elements of ten have it.
        let right = x.windows(2).filter(|p| ((p[1] - p[0]).length() - 1.0).abs() < 1e-12).count();
        assert!(x.iter().all(|p| p.is_finite()) && right == 9, "{right} {x:?}");
    }
}
