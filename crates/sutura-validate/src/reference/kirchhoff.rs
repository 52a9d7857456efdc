//! The static Kirchhoff rod in space by shooting: inextensible, unshearable, of uniform stiffness and rest curvature
//! about its own directors.
//!
//! R = [d1 d2 d3], R' = R hat(u), r' = d3, u = u0 + K^-1 R^T m, n' = 0, m' = -r' x n.

use super::numeric::{integrate, newton};

/// A rod clamped at its start, with a dead force and a dead moment at its end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cantilever {
    /// Position of the clamp.
    pub start: [f64; 3],
    /// Directors d1, d2, d3 at the clamp.
    pub frame: [[f64; 3]; 3],
    /// Length.
    pub length: f64,
    /// Bending stiffness about d1 and d2, twisting stiffness.
    pub stiffness: [f64; 3],
    /// Rest curvature about d1 and d2, and rest twist.
    pub rest: [f64; 3],
    /// Force at the end.
    pub force: [f64; 3],
    /// Moment at the end.
    pub moment: [f64; 3],
}

/// Where a place of the rod is and how it is turned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Station {
    /// Position.
    pub position: [f64; 3],
    /// Directors d1, d2, d3.
    pub frame: [[f64; 3]; 3],
    /// Internal moment, world axes.
    pub moment: [f64; 3],
}

fn cross(a: &[f64], b: &[f64]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl Cantilever {
    /// The end.
    pub fn tip(&self) -> Station {
        self.at(self.length, self.clamp_moment())
    }
    /// Stations at the given arc lengths.
    pub fn stations(&self, arcs: &[f64]) -> Vec<Station> {
        let m0 = self.clamp_moment();
        arcs.iter().map(|s| self.at(*s, m0)).collect()
    }
    /// Internal moment at the clamp, found by shooting with the loads grown in steps.
    fn clamp_moment(&self) -> [f64; 3] {
        const STEPS: i32 = 12;
        let size = |v: [f64; 3]| dot(&v, &v).sqrt();
        let scale = (size(self.force) * self.length + size(self.moment)).max(f64::MIN_POSITIVE);
        let mut guess = vec![0.0; 3];
        for step in 1..=STEPS {
            let part = f64::from(step) / f64::from(STEPS);
            let loaded = Cantilever { force: self.force.map(|f| part * f), ..*self };
            guess = newton(&guess, |m| {
                let tip = loaded.at(self.length, [m[0] * scale, m[1] * scale, m[2] * scale]);
                (0..3).map(|i| (tip.moment[i] - part * self.moment[i]) / scale).collect()
            });
        }
        [guess[0] * scale, guess[1] * scale, guess[2] * scale]
    }
    /// The station at arc length `s` for the moment `m0` at the clamp.
    fn at(&self, s: f64, m0: [f64; 3]) -> Station {
        let [d1, d2, d3] = self.frame;
        let start = [self.start, d1, d2, d3, m0].concat();
        if s <= 0.0 {
            return Station { position: self.start, frame: self.frame, moment: m0 };
        }
        let y = integrate(&start, s, |_, y, dy| {
            let (d1, d2, d3, m) = (&y[3..6], &y[6..9], &y[9..12], &y[12..15]);
            let u: [f64; 3] = std::array::from_fn(|i| self.rest[i] + dot([d1, d2, d3][i], m) / self.stiffness[i]);
            let push = cross(d3, &self.force);
            for i in 0..3 {
                dy[i] = d3[i];
                dy[3 + i] = u[2] * d2[i] - u[1] * d3[i];
                dy[6 + i] = u[0] * d3[i] - u[2] * d1[i];
                dy[9 + i] = u[1] * d1[i] - u[0] * d2[i];
                dy[12 + i] = -push[i];
            }
        });
        let vector = |at: usize| [y[at], y[at + 1], y[at + 2]];
        Station { position: vector(0), frame: [vector(3), vector(6), vector(9)], moment: vector(12) }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{
        elastica,
        material::{SQUARE, T1},
    };
    use super::*;

    #[test]
    fn the_plane_elastica() {
        let rod = Cantilever {
            start: [0.0; 3],
            frame: [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]],
            length: 1.0,
            stiffness: [1.0, 1.0, 0.7],
            rest: [0.0; 3],
            force: [0.0, 0.0, -5.0],
            moment: [0.0; 3],
        };
        let [x, drop, _] = elastica::tip_load(5.0);
        let tip = rod.tip().position;
        assert!((tip[0] - x).abs() < 1e-9 && (tip[2] + drop).abs() < 1e-9 && tip[1].abs() < 1e-12, "{tip:?}");
    }

    /// A tip force and a tip moment on a bent rod of T1, 50 mm.
    #[test]
    fn a_bent_and_twisted_rod() {
        let rod = Cantilever {
            start: [0.0; 3],
            frame: [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]],
            length: 0.05,
            stiffness: [T1.ei(), T1.ei(), T1.gj()],
            rest: [0.0; 3],
            force: [0.0, -1e-3, 0.0],
            moment: [2e-5, 0.0, 0.0],
        };
        let tip = rod.tip();
        for (got, want) in tip.position.iter().zip([36.796_912e-3, -28.824_038e-3, -9.164_207e-3]) {
            assert!((got - want).abs() < 2e-9, "{tip:?}");
        }
        for (got, want) in tip.frame[0].iter().zip([0.729_655, 0.080_136, 0.679_104]) {
            assert!((got - want).abs() < 2e-6, "{tip:?}");
        }
    }

    /// A section four times as stiff about d1, rolled about the rod, and one that turns by 90 degrees along it.
    #[test]
    fn sections_with_two_stiffnesses() {
        let rod = |roll: f64, twist: f64| {
            let (sin, cos) = roll.to_radians().sin_cos();
            Cantilever {
                start: [0.0; 3],
                frame: [[0.0, cos, sin], [0.0, -sin, cos], [1.0, 0.0, 0.0]],
                length: 0.05,
                stiffness: [4.0 * T1.ei(), T1.ei(), T1.gj()],
                rest: [0.0, 0.0, twist / 0.05],
                force: [0.0, -1e-3, 0.0],
                moment: [0.0; 3],
            }
        };
        for (roll, twist, want) in [
            (30.0, 0.0, [-12.145_274, -28.296_333, -8.363_269]),
            (45.0, 0.0, [-10.578_865, -25.274_569, -11.397_547]),
            (90.0, 0.0, [-1.848_434, -12.279_706, 0.0]),
            (0.0, std::f64::consts::FRAC_PI_2, [-12.015_729, -29.353_035, -5.183_563]),
        ] {
            let [x, y, z] = rod(roll, twist).tip().position;
            let got = [x - 0.05, y, z];
            assert!(got.iter().zip(want).all(|(g, w)| (1e3 * g - w).abs() < 2e-6), "{roll}: {got:?}");
        }
    }

    /// The bend of Bathe and Bolourchi with GJ = EI and with that of a square, in thread size too.
    #[test]
    fn arcs_under_a_load_across() {
        let arc = |radius: f64, angle: f64, stiffness: [f64; 3], load: f64| Cantilever {
            start: [0.0; 3],
            frame: [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            length: radius * angle,
            stiffness,
            rest: [-1.0 / radius, 0.0, 0.0],
            force: [0.0, 0.0, load],
            moment: [0.0; 3],
        };
        use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
        let ei = 1e7 / 12.0;
        let t1 = [T1.ei(), T1.ei(), T1.gj()];
        let k = T1.ei() / 0.02_f64.powi(2);
        for (rod, want) in [
            (arc(100.0, FRAC_PI_4, [ei, ei, ei], 600.0), [15.6851, 47.1513, 53.4686]),
            (arc(0.02, FRAC_PI_4, t1, k), [5.66192e-3, 13.81536e-3, 3.10598e-3]),
            (arc(0.02, FRAC_PI_4, t1, 7.2 * k), [3.07964e-3, 9.32177e-3, 10.75004e-3]),
            (arc(0.02, FRAC_PI_2, t1, k), [14.38107e-3, 16.86992e-3, 16.70853e-3]),
        ] {
            let tip = rod.tip().position;
            assert!(tip.iter().zip(want).all(|(g, w)| (g - w).abs() < 1e-6 * rod.length), "{tip:?} {want:?}");
        }
        // With its stretch the square's tip is at (15.5577, 46.8916, 53.6080): 1e-4 of the length away.
        let square = arc(100.0, FRAC_PI_4, [ei, ei, 0.5e7 * SQUARE], 600.0);
        let tip = square.tip().position;
        assert!(
            tip.iter().zip([15.5577, 46.8916, 53.6080]).all(|(g, w)| (g - w).abs() < 1e-4 * square.length),
            "{tip:?}"
        );
    }
}
