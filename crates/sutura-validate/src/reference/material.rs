//! The rods of the cases, and their stiffness from first principles (independently of the engine's `material.rs`).

use std::f64::consts::PI;

/// Acceleration of gravity in all cases \[m/s^2\].
pub const GRAVITY: f64 = 9.81;

/// Torsion constant of a square over the fourth power of its side (Saint-Venant).
pub const SQUARE: f64 = 0.140_577;

/// A round elastic rod.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rod {
    /// Diameter \[m\].
    pub diameter: f64,
    /// Young's modulus \[Pa\].
    pub young: f64,
    /// Poisson's ratio.
    pub poisson: f64,
    /// Density \[kg/m^3\].
    pub density: f64,
}

/// A 2-0 monofilament.
pub const T1: Rod = Rod { diameter: 0.30e-3, young: 2.0e9, poisson: 0.40, density: 1150.0 };
/// A limp 3-0 braid, by its effective modulus.
pub const T2: Rod = Rod { diameter: 0.20e-3, young: 0.20e9, poisson: 0.40, density: 1300.0 };
/// A guidewire of 0.035 inch.
pub const G1: Rod = Rod { diameter: 0.89e-3, young: 60.0e9, poisson: 0.33, density: 6450.0 };

impl Rod {
    /// Cross-section \[m^2\].
    pub fn area(&self) -> f64 {
        0.25 * PI * self.diameter.powi(2)
    }
    /// Bending stiffness \[N m^2\].
    pub fn ei(&self) -> f64 {
        self.young * PI * (0.5 * self.diameter).powi(4) / 4.0
    }
    /// Twisting stiffness \[N m^2\].
    pub fn gj(&self) -> f64 {
        self.ei() / (1.0 + self.poisson)
    }
    /// Stretching stiffness \[N\].
    pub fn ea(&self) -> f64 {
        self.young * self.area()
    }
    /// Mass per length \[kg/m\].
    pub fn mass(&self) -> f64 {
        self.density * self.area()
    }
    /// Weight per length \[N/m\].
    pub fn weight(&self) -> f64 {
        self.mass() * GRAVITY
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[expect(clippy::approx_constant, reason = "EA of T2 happens to have the digits of tau")]
    fn stiffness_of_the_rods() {
        for (rod, ei, gj, ea, mass, weight) in [
            (T1, 7.95216e-7, 5.68011e-7, 141.372, 8.12887e-5, 7.97442e-4),
            (T2, 1.57080e-8, 1.12200e-8, 6.28319, 4.08407e-5, 4.00647e-4),
            (G1, 1.84791e-3, 1.38941e-3, 37326.8, 4.01263e-3, 3.93639e-2),
        ] {
            for (got, want) in
                [(rod.ei(), ei), (rod.gj(), gj), (rod.ea(), ea), (rod.mass(), mass), (rod.weight(), weight)]
            {
                assert!((got / want - 1.0).abs() < 3e-6, "{got} {want}");
            }
        }
    }
}
