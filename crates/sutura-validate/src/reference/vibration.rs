//! Vibration of rods, and what the time integrators make of it.

use super::numeric::roots_above;
use std::f64::consts::{PI, TAU};

/// beta L of a cantilever, mode by mode: cos x cosh x = -1.
pub fn cantilever(modes: usize) -> Vec<f64> {
    roots_above(0.5, 0.01, modes, |x| x.cos() + 1.0 / x.cosh())
}

/// beta L of a free rod, mode by mode: cos x cosh x = 1.
pub fn free(modes: usize) -> Vec<f64> {
    roots_above(1.0, 0.01, modes, |x| x.cos() - 1.0 / x.cosh())
}

/// Shape of a mode of a cantilever, 1 at its tip.
pub fn cantilever_shape(beta: f64, s: f64) -> f64 {
    let ratio = (beta.sinh() - beta.sin()) / (beta.cosh() + beta.cos());
    let shape = |x: f64| x.cosh() - x.cos() - ratio * (x.sinh() - x.sin());
    shape(beta * s) / shape(beta)
}

/// Shape of a mode of a free rod, 1 at its ends.
pub fn free_shape(beta: f64, s: f64) -> f64 {
    let ratio = (beta.cosh() - beta.cos()) / (beta.sinh() - beta.sin());
    let shape = |x: f64| x.cosh() + x.cos() - ratio * (x.sinh() + x.sin());
    shape(beta * s) / shape(0.0)
}

/// Frequency \[Hz\] of a stiff string between pins: tension \[N\], stiffness \[N m^2\], mass per length \[kg/m\],
/// length \[m\].
pub fn stiff_string(mode: u32, tension: f64, ei: f64, mass: f64, length: f64) -> f64 {
    let k = f64::from(mode) * PI / length;
    k / TAU * ((tension + ei * k * k) / mass).sqrt()
}

/// Angular frequency at which implicit Euler of substep h lets a mode of angular frequency w swing.
pub fn euler_frequency(w: f64, h: f64) -> f64 {
    (w * h).atan() / h
}

/// Logarithmic decrement per second that implicit Euler gives a mode.
pub fn euler_decay(w: f64, h: f64) -> f64 {
    0.5 * (w * h * w * h).ln_1p() / h
}

/// What TR-BDF2 multiplies a mode exp(i w t) by in a substep of w h = `y`: its size and angle. The quotient (1 + (1 - 2
/// g) z) / (1 - g z)^2 with g = 1 - 1 / sqrt 2 at z = i y.
fn tr_bdf2_factor(y: f64) -> (f64, f64) {
    let g = 1.0 - std::f64::consts::FRAC_1_SQRT_2;
    let (a, b) = ((1.0 - 2.0 * g) * y, g * y);
    ((1.0 + a * a).sqrt() / (1.0 + b * b), a.atan() + 2.0 * b.atan())
}

/// Angular frequency at which TR-BDF2 of substep h lets a mode of angular frequency w swing.
pub fn tr_bdf2_frequency(w: f64, h: f64) -> f64 {
    tr_bdf2_factor(w * h).1 / h
}

/// Logarithmic decrement per second that TR-BDF2 gives a mode.
pub fn tr_bdf2_decay(w: f64, h: f64) -> f64 {
    -tr_bdf2_factor(w * h).0.ln() / h
}

/// Frequency \[Hz\] of a signal that swings about zero, from its crossings (linear between samples).
pub fn frequency(signal: &[(f64, f64)]) -> f64 {
    let crossings: Vec<f64> = signal
        .windows(2)
        .filter(|w| w[0].1 * w[1].1 < 0.0)
        .map(|w| w[0].0 + (w[1].0 - w[0].0) * w[0].1 / (w[0].1 - w[1].1))
        .collect();
    match crossings.as_slice() {
        [first, .., last] => 0.5 * (crossings.len() - 1) as f64 / (last - first),
        _ => f64::NAN,
    }
}

/// Decay of a signal that swings about zero \[1/s\], from its extremes.
pub fn decay(signal: &[(f64, f64)]) -> f64 {
    let extremes: Vec<(f64, f64)> = signal
        .windows(3)
        .filter(|w| (w[1].1 - w[0].1) * (w[2].1 - w[1].1) < 0.0)
        .map(|w| {
            // The vertex of the parabola through three samples at equal times.
            let (a, b, c) = (w[0].1, w[1].1, w[2].1);
            let bow = a - 2.0 * b + c;
            let at = 0.5 * (a - c) / bow;
            (w[1].0 + at * (w[2].0 - w[1].0), (b - 0.25 * (a - c) * at).abs())
        })
        .collect();
    match extremes.as_slice() {
        [first, .., last] => (first.1 / last.1).ln() / (last.0 - first.0),
        _ => f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::super::material::T1;
    use super::*;

    #[test]
    fn frequencies() {
        for (got, want) in
            cantilever(3).iter().chain(&free(2)).zip([1.875_104_1, 4.694_091_1, 7.854_757_4, 4.730_040_7, 7.853_204_6])
        {
            assert!((got - want).abs() < 1e-6, "{got} {want}");
        }
        let hz = |beta: f64, l: f64| beta * beta / (l * l) * (T1.ei() / T1.mass()).sqrt() / TAU;
        assert!(
            (hz(cantilever(1)[0], 0.05) - 22.1390).abs() < 1e-4 && (hz(cantilever(2)[1], 0.05) - 138.743).abs() < 1e-3
        );
        for (mode, want) in [(1, 176.057), (2, 356.203), (3, 544.374)] {
            assert!((stiff_string(mode, 0.1, T1.ei(), T1.mass(), 0.1) - want).abs() < 2e-3);
        }
        assert!(
            cantilever_shape(cantilever(1)[0], 0.0).abs() < 1e-12 && (free_shape(free(1)[0], 1.0) - 1.0).abs() < 1e-6
        );
    }

    /// At 5 Hz: h = 1/60 s gives -7.9 % and zeta 0.251; 1/600 s -0.09 % and 0.0262.
    #[test]
    fn implicit_euler() {
        let w = TAU * 5.0;
        for (h, shift, zeta) in [(1.0 / 60.0, -0.079, 0.251), (1.0 / 600.0, -0.0009, 0.0262)] {
            assert!((euler_frequency(w, h) / w - 1.0 - shift).abs() < 5e-4);
            assert!(
                (euler_decay(w, h) / euler_frequency(w, h) - zeta).abs() < 6e-4,
                "{}",
                euler_decay(w, h) / euler_frequency(w, h)
            );
        }
    }

    /// Leading terms: slower by 0.0404 (w h)^2, a loss of (w h)^4 g^4 / 2 a substep.
    #[test]
    fn tr_bdf2() {
        for y in [0.05, 0.1] {
            assert!(
                ((1.0 - tr_bdf2_frequency(y, 1.0) / y) / (y * y) - 0.0404).abs() < 5e-4,
                "{}",
                tr_bdf2_frequency(y, 1.0)
            );
            assert!((tr_bdf2_decay(y, 1.0) / y.powi(4) * 272.0 - 1.0).abs() < 0.01, "{}", tr_bdf2_decay(y, 1.0));
        }
    }

    #[test]
    fn a_signal_has_its_frequency_and_decay() {
        let signal: Vec<(f64, f64)> = (0..2000)
            .map(|i| 1e-3 * f64::from(i))
            .map(|t| (t, (-0.3 * t).exp() * (TAU * 7.0 * t + 0.2).cos()))
            .collect();
        assert!(
            (frequency(&signal) - 7.0).abs() < 2e-4 && (decay(&signal) - 0.3).abs() < 1e-4,
            "{} {}",
            frequency(&signal),
            decay(&signal)
        );
    }
}
