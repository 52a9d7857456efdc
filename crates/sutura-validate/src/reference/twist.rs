//! Rods that lose their shape by twist.

use super::numeric::root;
use nalgebra::Complex;
use std::f64::consts::FRAC_PI_2;

/// Least moment M L / EI at which a straight rod between two clamps under the tension t = T L^2 / EI leaves its axis (Greenhill 1883).
/// Small deflections w = x + i y obey w'''' - i M w''' - t w'' = 0 with w = w' = 0 at both ends; the determinant of that problem.
pub fn greenhill(t: f64) -> f64 {
    // w'' = e^{l s}; integrated twice from zero.
    let integrals = |l: Complex<f64>| {
        if l.norm() < 1e-3 {
            return (Complex::from(0.5) + l / 6.0 + l * l / 24.0, Complex::from(1.0) + l / 2.0 + l * l / 6.0);
        }
        let e = l.exp();
        ((e - 1.0 - l) / (l * l), (e - 1.0) / l)
    };
    let determinant = |m: f64| {
        let d = Complex::from(4.0 * t - m * m).sqrt();
        let i_m = Complex::new(0.0, m);
        let (a, b) = ((i_m + d) / 2.0, (i_m - d) / 2.0);
        let ((wa, sa), (wb, sb)) = (integrals(a), integrals(b));
        (wa * sb - sa * wb) / (a - b) * (-i_m / 2.0).exp()
    };
    let from = 2.0 * t.max(0.0).sqrt() + 1e-3;
    // Real up to one constant phase.
    let sample = (0..200).map(|i| determinant(from + 0.1 * f64::from(i))).max_by(|a, b| a.norm().total_cmp(&b.norm())).unwrap_or_default();
    let phase = (sample / sample.norm()).conj();
    let real = |m: f64| (determinant(m) * phase).re;
    let mut m = from;
    while real(m) * real(m + 0.01) > 0.0 && m < from + 40.0 {
        m += 0.01;
    }
    root(m, m + 0.01, real)
}

/// Twist at which a ring leaves its plane \[rad\] times GJ / EI (Michell 1889): 2 pi sqrt 3. A ring of n straight elements does so later,
/// by 34 / n^2 of it (fitted to eigenvalues of discrete rings).
pub fn michell(n: Option<usize>) -> f64 {
    std::f64::consts::TAU * 3.0_f64.sqrt() * n.map_or(1.0, |n| 1.0 + 34.0 / (n * n) as f64)
}

/// The localized helix of a long rod between two clamps (Coyne 1990; van der Heijden and Thompson 2000).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Helix {
    /// Tension T L^2 / EI.
    pub tension: f64,
    /// Moment M L / EI.
    pub moment: f64,
    /// Greatest angle of the tangent with the axis \[rad\].
    pub angle: f64,
    /// Decay of the envelope times L.
    pub decay: f64,
}

/// For ends that came together by `shortening` of the length and were turned by `turns` \[rad\]; `ratio` is GJ / EI.
pub fn localized(shortening: f64, turns: f64, ratio: f64) -> Helix {
    let f = |psi: f64| 4.0 * (2.0 * psi).sin() / shortening / ratio + 4.0 * psi - turns;
    // The first of its roots: the branch on which the helix is shallow.
    let mut psi = 1e-6;
    while f(psi) * f(psi + 1e-4) > 0.0 && psi < FRAC_PI_2 {
        psi += 1e-4;
    }
    let psi = root(psi, psi + 1e-4, f);
    let tension = (4.0 * psi.sin() / shortening).powi(2);
    let moment = 2.0 * tension.sqrt() * psi.cos();
    Helix { tension, moment, angle: (moment * moment / (2.0 * tension) - 1.0).acos(), decay: (tension - 0.25 * moment * moment).sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twisted_between_clamps() {
        for (t, m) in [(1e-9, 8.986_819), (10.0, 10.428_86), (50.0, 15.589_32), (100.0, 20.983_50), (1000.0, 63.559_31)] {
            assert!((greenhill(t) - m).abs() < 6e-6, "{t}: {} {m}", greenhill(t));
        }
        assert!((michell(None) - 10.882_796).abs() < 1e-6);
    }

    /// The second is the case of PyElastica, with its numbers.
    #[test]
    fn localized_helices() {
        use super::super::material::T1;
        let (ei, l) = (T1.ei(), 0.2);
        let h = localized(0.05, 12.0 * std::f64::consts::TAU, T1.gj() / ei);
        assert!((h.tension * ei / (l * l) - 1.58416e-2).abs() < 1e-7 && (h.moment * ei / l - 2.10038e-4).abs() < 1e-9);
        assert!((h.angle.to_degrees() - 41.324).abs() < 1e-3 && (h.decay - 9.96).abs() < 5e-3);
        let h = localized(0.03, 27.0 * std::f64::consts::TAU, 0.789 / 1.345);
        assert!((h.moment - 98.541_496_17).abs() < 1e-6 && (h.tension - 2_900.993_206).abs() < 1e-5 && (h.angle.to_degrees() - 47.6515).abs() < 1e-4);
    }
}
