//! Rods that lose their shape by twist.

use super::numeric::root;
use nalgebra::Complex;
use std::f64::consts::FRAC_PI_2;

/// Least moment M L / EI at which a straight rod between two clamps under the tension t = T L^2 / EI leaves its axis
/// (Greenhill 1883). Small deflections w = x + i y obey w'''' - i M w''' - t w'' = 0 with w = w' = 0 at both ends; the
/// determinant of that problem.
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
    let sample = (0..200)
        .map(|i| determinant(from + 0.1 * f64::from(i)))
        .max_by(|a, b| a.norm().total_cmp(&b.norm()))
        .unwrap_or_default();
    let phase = (sample / sample.norm()).conj();
    let real = |m: f64| (determinant(m) * phase).re;
    let mut m = from;
    while real(m) * real(m + 0.01) > 0.0 && m < from + 40.0 {
        m += 0.01;
    }
    root(m, m + 0.01, real)
}

/// Twist at which a ring of n rigid links leaves its plane \[rad\] times GJ / EI, `ratio` = GJ / EI; toward 2 pi sqrt 3
/// (Michell 1889) as n grows. Its joints have the energy of a rotation vector, bending stiffness n / L and twisting
/// stiffness ratio n / L: the rotation by the angle p between the links and by the twist t has the size w, cos w / 2 =
/// cos p / 2 cos t / 2.
pub fn michell(n: usize, ratio: f64) -> f64 {
    let energy = |p: f64, t: f64| {
        let w = 2.0 * ((0.5 * p).cos() * (0.5 * t).cos()).acos();
        let (sin, twist) = ((0.5 * p).sin(), (0.5 * p).cos() * (0.5 * t).sin());
        0.5 * (w / (0.5 * w).sin()).powi(2) * (sin * sin + ratio * twist * twist)
    };
    n as f64 * leaves_plane(n, energy).0 * ratio
}

/// Twist of a joint and moment along the links at which a ring of n links whose joints have the energy U(p, t) leaves
/// its plane.
///
/// Link k points at the angle 2 pi k / n = k p in the plane; it is turned by P cos 2kp in the plane and by Q sin 2kp
/// out of it, which leaves the ring closed. To second order the angles between links grow by (n / 2) Q^2 (cos p - cos
/// 2p) / sin p together, the squares of their changes are 2 n P^2 sin^2 p, and the ring loses the twist n P Q sin p cos
/// p / cos^2 (p / 2) to writhe. Twist is free to move along the ring, so that the stiffness against changes of p is K =
/// U_pp - U_pt^2 / U_tt; and the quadratic form in P and Q is singular at the moment U_t given by
///
/// U_t^2 = 2 U_p K (cos p - cos 2p) cos^4 (p / 2) / (sin p cos^2 p).
fn leaves_plane(n: usize, energy: impl Fn(f64, f64) -> f64) -> (f64, f64) {
    let p = std::f64::consts::TAU / n as f64;
    // Central differences: the energy is a smooth function of order p^2.
    let e = 1e-3 * p;
    let slopes = |t: f64| {
        let u = |i: f64, j: f64| energy(p + i * e, t + j * e);
        let (up, ut) = ((u(1.0, 0.0) - u(-1.0, 0.0)) / (2.0 * e), (u(0.0, 1.0) - u(0.0, -1.0)) / (2.0 * e));
        let upp = (u(1.0, 0.0) - 2.0 * u(0.0, 0.0) + u(-1.0, 0.0)) / (e * e);
        let utt = (u(0.0, 1.0) - 2.0 * u(0.0, 0.0) + u(0.0, -1.0)) / (e * e);
        let upt = (u(1.0, 1.0) - u(1.0, -1.0) - u(-1.0, 1.0) + u(-1.0, -1.0)) / (4.0 * e * e);
        (up, ut, upp - upt * upt / utt)
    };
    let shape = 2.0 * (p.cos() - (2.0 * p).cos()) * (0.5 * p).cos().powi(4) / (p.sin() * p.cos().powi(2));
    let excess = |t: f64| {
        let (up, ut, k) = slopes(t);
        ut * ut - shape * up * k
    };
    let t = root(0.2 * p, 10.0 * p, excess);
    (t, slopes(t).1)
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
    Helix {
        tension,
        moment,
        angle: (moment * moment / (2.0 * tension) - 1.0).acos(),
        decay: (tension - 0.25 * moment * moment).sqrt(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twisted_between_clamps() {
        for (t, m) in [(1e-9, 8.986_819), (10.0, 10.428_86), (50.0, 15.589_32), (100.0, 20.983_50), (1000.0, 63.559_31)]
        {
            assert!((greenhill(t) - m).abs() < 6e-6, "{t}: {} {m}", greenhill(t));
        }
    }

    /// Discrete rings of 16 and 24 edges with the joints of discrete elastic rods, 2 tan (p / 2) for the curvature,
    /// hold 13.7 % and 5.9 % more moment than sqrt 3 EI / R (eigenvalues of the Hessian in all coordinates, computed
    /// apart).
    #[test]
    fn twisted_rings() {
        for (n, more) in [(16, 0.137), (24, 0.059)] {
            let (_, moment) = leaves_plane(n, |p, t| 2.0 * (0.5 * p).tan().powi(2) + 0.35 * t * t);
            let radius = 0.5 / (0.5 * std::f64::consts::TAU / n as f64).sin();
            assert!(
                (moment * radius / 3.0_f64.sqrt() - 1.0 - more).abs() < 5e-4,
                "{n}: {}",
                moment * radius / 3.0_f64.sqrt()
            );
        }
        for ratio in [0.7, 1.0] {
            assert!((michell(400, ratio) - 10.882_796).abs() < 2e-4, "{}", michell(400, ratio));
        }
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
        assert!(
            (h.moment - 98.541_496_17).abs() < 1e-6
                && (h.tension - 2_900.993_206).abs() < 1e-5
                && (h.angle.to_degrees() - 47.6515).abs() < 1e-4
        );
    }
}
