//! Hanging threads: the catenary, and the heavy elastica between two level ends.

use super::numeric::root;
use nalgebra::{DMatrix, DVector};

/// A level catenary over `span`: sag, horizontal force over the weight, tension at the ends over the weight.
pub fn level(span: f64) -> [f64; 3] {
    let q = root(1e-9, 50.0, |q| q.sinh() / q - 1.0 / span);
    let a = span / (2.0 * q);
    [a * (q.cosh() - 1.0), a, a * q.cosh()]
}

/// How the ends of a heavy elastica are held.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ends {
    /// They may turn.
    Pinned,
    /// They stay level.
    Clamped,
}

/// Sag of a heavy rod, w L^3 / EI = `weight`, between level ends `span` apart. Differences of second order for
/// a'' = h sin a - weight (s - 1/2) cos a with the horizontal force h unknown, extrapolated from two grids.
pub fn heavy(span: f64, weight: f64, ends: Ends) -> f64 {
    let (coarse, fine) = (heavy_on(span, weight, ends, 200), heavy_on(span, weight, ends, 400));
    (4.0 * fine - coarse) / 3.0
}

/// The same on half the rod, which is symmetric, with `n` intervals.
fn heavy_on(span: f64, weight: f64, ends: Ends, n: usize) -> f64 {
    let ds = 0.5 / n as f64;
    // From the middle (i = 0, slope zero) to the right end (i = n). Weights of the trapezoidal rule.
    let rule = |i: usize| if i == 0 || i == n { 0.5 * ds } else { ds };
    let [_, a, _] = level(span);
    // The catenary is a good start for a heavy rod; a light one is reached through heavier ones.
    let mut slope: Vec<f64> = (0..=n).map(|i| (i as f64 * ds / a).atan()).collect();
    let mut force = None;
    let mut w = weight.max(2000.0);
    loop {
        let mut h = force.map_or(w * a, |f: f64| f * w);
        for _ in 0..60 {
            // Unknowns: slope at 1..=n and h. A row each for the equation at 1..n, one for the end, one for the span.
            let mut jacobian = DMatrix::<f64>::zeros(n + 1, n + 1);
            let mut residual = DVector::<f64>::zeros(n + 1);
            let theta = |i: usize| slope[i];
            for i in 1..=n {
                let row = i - 1;
                let s = i as f64 * ds;
                if i == n && ends == Ends::Clamped {
                    residual[row] = theta(n);
                    jacobian[(row, row)] = 1.0;
                    continue;
                }
                // Beyond a pinned end the slope is mirrored: no curvature there.
                let next = if i == n { theta(n - 1) } else { theta(i + 1) };
                let (sin, cos) = theta(i).sin_cos();
                residual[row] = next - 2.0 * theta(i) + theta(i - 1) - ds * ds * (h * sin - w * s * cos);
                jacobian[(row, row)] = -2.0 - ds * ds * (h * cos + w * s * sin);
                if i > 1 {
                    jacobian[(row, row - 1)] += 1.0;
                }
                if i == n {
                    jacobian[(row, row - 1)] += 1.0;
                } else {
                    jacobian[(row, row + 1)] += 1.0;
                }
                jacobian[(row, n)] = -ds * ds * sin;
            }
            for i in 0..=n {
                residual[n] += rule(i) * theta(i).cos();
                if i > 0 {
                    jacobian[(n, i - 1)] = -rule(i) * theta(i).sin();
                }
            }
            residual[n] -= 0.5 * span;
            let Some(step) = jacobian.lu().solve(&(-residual)) else { return f64::NAN };
            // Damped while it is far.
            let scale = (0.3 / step.rows(0, n).amax()).min(1.0);
            for i in 1..=n {
                slope[i] += scale * step[i - 1];
            }
            h += scale * step[n];
            if step.rows(0, n).amax() < 1e-12 {
                break;
            }
        }
        force = Some(h / w);
        if w <= weight {
            return (0..=n).map(|i| rule(i) * slope[i].sin()).sum();
        }
        w = (0.3 * w).max(weight);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn level_catenaries() {
        for (c, sag, h, t) in [
            (0.2, 0.472_834, 0.027_947, 0.500_780),
            (0.5, 0.398_194, 0.114_820, 0.513_014),
            (0.95, 0.135_898, 0.851_862, 0.987_760),
        ] {
            let got = level(c);
            assert!((got[0] - sag).abs() < 6e-7 && (got[1] - h).abs() < 6e-7 && (got[2] - t).abs() < 6e-7, "{got:?}");
        }
    }

    #[test]
    fn heavy_rods() {
        for (w, pin, clamp) in
            [(100.0, 0.379_245, 0.377_560), (1000.0, 0.390_688, 0.388_945), (10_000.0, 0.396_724, 0.396_669)]
        {
            let got = [heavy(0.5, w, Ends::Pinned), heavy(0.5, w, Ends::Clamped)];
            assert!((got[0] - pin).abs() < 2e-6 && (got[1] - clamp).abs() < 2e-6, "{w}: {got:?} {pin} {clamp}");
        }
    }
}
