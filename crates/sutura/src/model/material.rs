//! Moduli to compliance and mass. The only place where a Young's modulus becomes a stiffness.

use crate::error::{Error, check};
use crate::model::section::{Factors, Section};
use glam::DVec3;

/// What a thread is made of.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// Young's modulus E in tension \[Pa\], > 0.
    pub young_modulus: f64,
    /// How it resists shear: Poisson's ratio or the shear modulus itself.
    pub shear: Shear,
    /// Mass per volume \[kg/m^3\], > 0.
    pub density: f64,
    /// Bending and twisting stiffness over that of a solid round rod of modulus E, in (0, 1]. 1 is a monofilament; a
    /// braid is much softer in bending than `E I`.
    pub bend_scale: f64,
    /// Relaxation time tau of Kelvin-Voigt damping in bending and twist \[s\], >= 0: moment = stiffness * (strain + tau
    /// * strain rate).
    pub bend_damping: f64,
    /// Plastic set in bending and twist; `None` is purely elastic.
    pub plasticity: Option<Plasticity>,
}

/// Resistance to shear, given either way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shear {
    /// Poisson's ratio nu in (-1, 0.5]: G = E / (2 (1 + nu)).
    Poisson(f64),
    /// Shear modulus G \[Pa\], > 0.
    Modulus(f64),
}

/// Yield in bending and twist with linear kinematic-free (isotropic) hardening, per joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plasticity {
    /// Curvature at which bending becomes permanent \[1/m\], > 0.
    pub yield_curvature: f64,
    /// Twist per length at which twist becomes permanent \[rad/m\], > 0.
    pub yield_twist: f64,
    /// Slope after yield over elastic slope, in [0, 1). Zero is perfectly plastic.
    pub hardening: f64,
}

impl Material {
    /// A purely elastic solid round material with Poisson's ratio 0.4, no damping.
    pub fn elastic(young_modulus: f64, density: f64) -> Self {
        Material {
            young_modulus,
            shear: Shear::Poisson(0.4),
            density,
            bend_scale: 1.0,
            bend_damping: 0.0,
            plasticity: None,
        }
    }

    /// Shear modulus G \[Pa\].
    pub fn shear_modulus(&self) -> f64 {
        match self.shear {
            Shear::Poisson(nu) => self.young_modulus / (2.0 * (1.0 + nu)),
            Shear::Modulus(g) => g,
        }
    }

    /// Plane-strain modulus of Hertz contact, E / (1 - nu^2) \[Pa\]. Where the shear modulus is given, which of a braid
    /// says nothing about nu, nu is 0.4.
    pub(crate) fn contact_modulus(&self) -> f64 {
        let nu = match self.shear {
            Shear::Poisson(nu) => nu,
            Shear::Modulus(_) => 0.4,
        };
        self.young_modulus / (1.0 - nu * nu)
    }

    pub(crate) fn validate(&self) -> Result<(), Error> {
        let what = "material";
        check(what, "young_modulus", self.young_modulus, self.young_modulus > 0.0, "a finite number > 0 [Pa]")?;
        match self.shear {
            Shear::Poisson(nu) => check(what, "poisson_ratio", nu, nu > -1.0 && nu <= 0.5, "a number in (-1, 0.5]")?,
            Shear::Modulus(g) => check(what, "shear_modulus", g, g > 0.0, "a finite number > 0 [Pa]")?,
        }
        check(what, "density", self.density, self.density > 0.0, "a finite number > 0 [kg/m^3]")?;
        check(
            what,
            "bend_scale",
            self.bend_scale,
            self.bend_scale > 0.0 && self.bend_scale <= 1.0,
            "a number in (0, 1]",
        )?;
        check(what, "bend_damping", self.bend_damping, self.bend_damping >= 0.0, "a finite time >= 0 [s]")?;
        if let Some(p) = &self.plasticity {
            check(what, "yield_curvature", p.yield_curvature, p.yield_curvature > 0.0, "a finite number > 0 [1/m]")?;
            check(what, "yield_twist", p.yield_twist, p.yield_twist > 0.0, "a finite number > 0 [rad/m]")?;
            check(what, "hardening", p.hardening, (0.0..1.0).contains(&p.hardening), "a number in [0, 1)")?;
        }
        Ok(())
    }
}

/// Stiffness and mass per length of a rod at one place. Lengths divide or multiply these, nothing else does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SectionStiffness {
    /// Axial stiffness E A \[N\].
    pub ea: f64,
    /// Shear stiffness k G A, the same in both directions \[N\].
    pub kga: f64,
    /// Bending stiffness E I about d1 and d2 and twisting stiffness G J, times the bending scale \[N m^2\].
    pub bend: DVec3,
    /// Mass per length \[kg/m\].
    pub mass: f64,
    /// Moments of inertia per length about d1, d2 and d3, rho I \[kg m\].
    pub inertia: DVec3,
}

impl SectionStiffness {
    /// Where the factors along a rod are `here`; `radius` \[m\] is that of a round section of size 1.
    pub fn new(material: &Material, section: &Section, radius: f64, here: Factors) -> Self {
        let of = section.areas(radius, here.size);
        let (e, g) = (material.young_modulus * here.modulus, material.shear_modulus() * here.modulus);
        let density = material.density * here.density;
        let nu = (e / (2.0 * g) - 1.0).clamp(0.0, 0.5);
        let [i1, i2] = of.about;
        SectionStiffness {
            ea: e * of.area,
            kga: section.shear_factor(nu) * g * of.area,
            bend: DVec3::new(e * i1, e * i2, g * of.torsion) * material.bend_scale,
            mass: density * of.area,
            inertia: DVec3::new(density * i1, density * i2, density * i1 + density * i2),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::section::Along;

    #[test]
    fn section_of_the_2_0_monofilament() {
        // Reference set T1: d = 0.30 mm, E = 2 GPa, nu = 0.4, rho = 1150.
        let s = SectionStiffness::new(
            &Material::elastic(2.0e9, 1150.0),
            &Section::Round,
            0.15e-3,
            Along::default().at(0.0),
        );
        for (got, want) in [
            (s.ea, 141.372),
            (s.bend.x, 7.95216e-7),
            (s.bend.y, s.bend.x),
            (s.bend.z, 5.68011e-7),
            (s.mass, 8.12887e-5),
        ] {
            assert!((got / want - 1.0).abs() < 1e-5, "{got} {want}");
        }
    }

    #[test]
    fn an_incompressible_limit_is_allowed_and_beyond_it_is_not() {
        let mut m = Material::elastic(1e9, 1000.0);
        m.shear = Shear::Poisson(0.5);
        assert!(m.validate().is_ok());
        m.shear = Shear::Poisson(0.51);
        assert!(m.validate().unwrap_err().to_string().contains("poisson_ratio"));
    }
}
