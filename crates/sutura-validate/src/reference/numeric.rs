//! Roots, systems of equations and ordinary differential equations, by library routines where these are fit.

use nalgebra::{DMatrix, DVector};

/// The root of `f` between `a` and `b`, where it has opposite signs; not a number where it has not. Bisection down to
/// rounding: Brent's method in the crate `roots` 0.0.8 does not end where `f` holds the rounding of an integration.
pub fn root(a: f64, b: f64, f: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (a, b);
    let rising = f(low) < 0.0;
    if rising == (f(high) < 0.0) {
        return f64::NAN;
    }
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            return middle;
        }
        if (f(middle) < 0.0) == rising { low = middle } else { high = middle }
    }
}

/// The first `count` roots of `f` above `from`, looked for in steps.
pub fn roots_above(from: f64, step: f64, count: usize, f: impl Fn(f64) -> f64) -> Vec<f64> {
    let mut found = Vec::new();
    let mut x = from;
    // A bound for functions without roots: far beyond what any case asks for.
    while found.len() < count && x < from + 1e6 * step {
        if f(x) * f(x + step) < 0.0 {
            found.push(root(x, x + step, &f));
        }
        x += step;
    }
    found
}

/// Newton's method with differences for derivatives; the last iterate, whose residual the caller's tests look at.
pub fn newton(start: &[f64], f: impl Fn(&[f64]) -> Vec<f64>) -> Vec<f64> {
    let n = start.len();
    let mut x = start.to_vec();
    for _ in 0..60 {
        let r = DVector::from_vec(f(&x));
        let mut jacobian = DMatrix::zeros(n, n);
        for j in 0..n {
            let step = 1e-7 * x[j].abs().max(1e-3);
            let shifted = |by: f64| {
                let mut y = x.clone();
                y[j] += by;
                DVector::from_vec(f(&y))
            };
            jacobian.set_column(j, &((shifted(step) - shifted(-step)) / (2.0 * step)));
        }
        let Some(dx) = jacobian.lu().solve(&(-r)) else { return vec![f64::NAN; n] };
        for (x, dx) in x.iter_mut().zip(dx.iter()) {
            *x += dx;
        }
        let size = x.iter().fold(1e-3, |a: f64, v| a.max(v.abs()));
        if dx.amax() < 1e-13 * size {
            break;
        }
    }
    x
}

/// y at `end` of y' = f(x, y), y(0) = `start`: the classical Runge-Kutta rule of order 4 in 2000 steps, an error of
/// some 1e-11 for what is asked here. (Dormand and Prince in the crate `ode_solvers` 0.6 gives up on slopes that begin
/// at zero.)
pub fn integrate(start: &[f64], end: f64, f: impl Fn(f64, &[f64], &mut [f64])) -> Vec<f64> {
    const STEPS: u32 = 2000;
    let h = end / f64::from(STEPS);
    let n = start.len();
    let mut y = start.to_vec();
    let (mut k, mut sum, mut at) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    for step in 0..STEPS {
        let x = h * f64::from(step);
        sum.fill(0.0);
        // How far along the last slope, and what the slope found there counts.
        for (stage, (along, weight)) in [(0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)].into_iter().enumerate() {
            for i in 0..n {
                at[i] = if stage == 0 { y[i] } else { y[i] + along * h * k[i] };
            }
            f(x + along * h, &at, &mut k);
            for i in 0..n {
                sum[i] += weight * k[i];
            }
        }
        for i in 0..n {
            y[i] += h / 6.0 * sum[i];
        }
    }
    y
}
