//! Cross-sections and how they change along a thread: geometry only.

use crate::error::{Error, check};
use core::f64::consts::PI;

/// Shape of the cross-section, with its principal axes along the directors d1 and d2. What touches is always a round
/// thread of [`RodSpec::radius`](crate::RodSpec::radius).
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub enum Section {
    /// Round, of the thread's radius.
    #[default]
    Round,
    /// An ellipse with these semi-axes along d1 and d2 \[m\], > 0.
    Ellipse([f64; 2]),
    /// A rectangle with these sides along d1 and d2 \[m\], > 0.
    Rectangle([f64; 2]),
}

/// Constants of a section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Areas {
    /// Area \[m^2\].
    pub area: f64,
    /// Second moments of area about d1 and d2 \[m^4\].
    pub about: [f64; 2],
    /// Torsion constant J \[m^4\].
    pub torsion: f64,
}

impl Section {
    /// Constants of the section, `size` times as large; `radius` \[m\] is that of a round one.
    pub(crate) fn areas(&self, radius: f64, size: f64) -> Areas {
        match self.scaled(size) {
            Section::Round => {
                let r = radius * size;
                let area = PI * r * r;
                let i = 0.25 * area * r * r;
                Areas { area, about: [i, i], torsion: 2.0 * i }
            }
            Section::Ellipse([a, b]) => {
                let area = PI * a * b;
                // Torsion: Saint-Venant 1855; Timoshenko and Goodier, Theory of Elasticity, section 107.
                Areas {
                    area,
                    about: [0.25 * area * b * b, 0.25 * area * a * a],
                    torsion: area * (a * b) * (a * b) / (a * a + b * b),
                }
            }
            Section::Rectangle([a, b]) => {
                let area = a * b;
                Areas {
                    area,
                    about: [area * b * b / 12.0, area * a * a / 12.0],
                    torsion: torsion_of_rectangle(a.max(b), a.min(b)),
                }
            }
        }
    }

    /// Shear correction factor of Cowper (1966). A rectangle's is the same in both directions; an ellipse takes that of
    /// a circle.
    pub(crate) fn shear_factor(&self, nu: f64) -> f64 {
        match self {
            Section::Round | Section::Ellipse(_) => 6.0 * (1.0 + nu) / (7.0 + 6.0 * nu),
            Section::Rectangle(_) => 10.0 * (1.0 + nu) / (12.0 + 11.0 * nu),
        }
    }

    /// The same, `size` times as large. A round one is as large as the thread's radius.
    pub fn scaled(&self, size: f64) -> Self {
        match *self {
            Section::Round => Section::Round,
            Section::Ellipse(axes) => Section::Ellipse(axes.map(|x| x * size)),
            Section::Rectangle(sides) => Section::Rectangle(sides.map(|x| x * size)),
        }
    }

    /// Half the larger of its two widths \[m\]; `None` for a round one, which is as large as the thread's radius.
    pub fn half_width(&self) -> Option<f64> {
        match self {
            Section::Round => None,
            Section::Ellipse([a, b]) => Some(a.max(*b)),
            Section::Rectangle([a, b]) => Some(0.5 * a.max(*b)),
        }
    }

    pub(crate) fn validate(&self) -> Result<(), Error> {
        let (Section::Ellipse(widths) | Section::Rectangle(widths)) = self else { return Ok(()) };
        widths.iter().try_for_each(|w| check("rod", "section", *w, *w > 0.0, "two finite lengths > 0 [m]"))
    }
}

/// Torsion constant of a rectangle with sides a >= b (Saint-Venant's series; Timoshenko and Goodier, section 109):
/// `a b^3 (1/3 - 64 / pi^5 (b / a) sum tanh(n pi a / 2 b) / n^5)` over odd n. The sum of 1 / n^5 is taken out in closed
/// form, 31/32 zeta(5); what is left, `1 - tanh(x) = 2 / (exp(2 x) + 1)`, vanishes to the last bit after six terms.
fn torsion_of_rectangle(a: f64, b: f64) -> f64 {
    const SUM: f64 = 31.0 / 32.0 * 1.036_927_755_143_37;
    let rest: f64 = [1.0f64, 3.0, 5.0, 7.0, 9.0, 11.0]
        .iter()
        .map(|n| 2.0 / (n * n * n * n * n * (libm::exp(n * PI * a / b) + 1.0)))
        .sum();
    a * b * b * b * (1.0 / 3.0 - 64.0 / (PI * PI * PI * PI * PI) * (b / a) * (SUM - rest))
}

/// A factor along a thread: linear between points (rest arc length from the start \[m\], factor), constant before the
/// first and after the last. Without points it is 1.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Profile(pub Vec<(f64, f64)>);

/// How a thread changes along its length. Each element has the values at its middle.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Along {
    /// Size of the section, both ways. Contact takes the largest everywhere.
    pub size: Profile,
    /// Young's modulus and shear modulus. Contact takes the material's own.
    pub modulus: Profile,
    /// Density.
    pub density: Profile,
}

impl Profile {
    /// The factor at rest arc length `s` \[m\].
    pub fn at(&self, s: f64) -> f64 {
        let i = self.0.partition_point(|(arc, _)| *arc <= s);
        match (i.checked_sub(1).map(|i| self.0[i]), self.0.get(i)) {
            (Some((s0, a)), Some((s1, b))) => a + (b - a) * ((s - s0) / (s1 - s0)),
            (Some((_, a)), None) => a,
            (None, Some((_, b))) => *b,
            (None, None) => 1.0,
        }
    }

    /// The same, seen from a place on it on.
    pub(crate) fn beyond(&self, from: f64) -> Self {
        let start = (!self.0.is_empty()).then(|| (0.0, self.at(from)));
        let after = self.0.iter().filter(|(s, _)| *s > from).map(|(s, v)| (s - from, *v));
        Profile(start.into_iter().chain(after).collect())
    }

    /// That of a ring of this length which begins at another place.
    pub(crate) fn turned(&self, from: f64, length: f64) -> Self {
        let (mut turned, seam) = (self.beyond(from), length - from);
        turned.0.retain(|(s, _)| *s < seam);
        if !self.0.is_empty() {
            let before = self.beyond(0.0).0.into_iter().filter(|(s, _)| *s < from).map(|(s, v)| (s + seam, v));
            let ends = [(seam, self.at(length)), (length, self.at(from))];
            turned.0.extend([ends[0]].into_iter().chain(before).chain([ends[1]]));
        }
        turned
    }

    /// The largest factor.
    pub fn largest(&self) -> f64 {
        self.0.iter().map(|(_, v)| *v).reduce(f64::max).unwrap_or(1.0)
    }

    pub(crate) fn validate(&self, what: &'static str, field: &str) -> Result<(), Error> {
        for (i, (s, v)) in self.0.iter().enumerate() {
            let ascending = i == 0 || self.0[i - 1].0 < *s;
            check(what, &format!("{field}[{i}]"), *s, ascending, "finite arc lengths [m], ascending")?;
            check(what, &format!("{field}[{i}]"), *v, *v > 0.0, "a finite factor > 0")?;
        }
        Ok(())
    }
}

/// The factors of [`Along`] at one place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Factors {
    pub size: f64,
    pub modulus: f64,
    pub density: f64,
}

impl Along {
    /// At rest arc length `s` \[m\].
    pub(crate) fn at(&self, s: f64) -> Factors {
        Factors { size: self.size.at(s), modulus: self.modulus.at(s), density: self.density.at(s) }
    }
    pub(crate) fn validate(&self) -> Result<(), Error> {
        self.size.validate("rod", "along.size")?;
        self.modulus.validate("rod", "along.modulus")?;
        self.density.validate("rod", "along.density")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn torsion_of_rectangles_as_tabulated() {
        // Timoshenko and Goodier, table of section 109: J = k1 a b^3.
        for (ratio, k) in [
            (1.0, 0.1406),
            (1.2, 0.166),
            (1.5, 0.196),
            (2.0, 0.229),
            (2.5, 0.249),
            (3.0, 0.263),
            (4.0, 0.281),
            (5.0, 0.291),
            (10.0, 0.312),
        ] {
            let j = torsion_of_rectangle(ratio, 1.0) / ratio;
            assert!((j - k).abs() < 6e-4, "{ratio}: {j} {k}");
        }
        // The plain series to 2000 terms.
        let series = |a: f64| {
            let sum: f64 =
                (0..2000).map(|i| f64::from(2 * i + 1)).map(|n| libm::tanh(0.5 * n * PI * a) / n.powi(5)).sum();
            a * (1.0 / 3.0 - 64.0 / PI.powi(5) / a * sum)
        };
        for a in [1.0, 1.3, 4.0, 50.0] {
            assert!((torsion_of_rectangle(a, 1.0) / series(a) - 1.0).abs() < 1e-12, "{a}");
        }
    }

    #[test]
    fn an_ellipse_of_equal_axes_is_a_circle() {
        let (a, b) = (Section::Ellipse([2e-4; 2]).areas(1.0, 1.5), Section::Round.areas(2e-4, 1.5));
        for (x, y) in [(a.area, b.area), (a.about[0], b.about[0]), (a.about[1], b.about[1]), (a.torsion, b.torsion)] {
            assert!((x / y - 1.0).abs() < 1e-14, "{x} {y}");
        }
    }

    #[test]
    fn a_profile_is_linear_between_its_points() {
        let p = Profile(vec![(1.0, 2.0), (3.0, 4.0), (4.0, 1.0)]);
        for (s, v) in [(0.0, 2.0), (1.0, 2.0), (2.0, 3.0), (3.0, 4.0), (3.5, 2.5), (4.0, 1.0), (9.0, 1.0)] {
            assert_eq!(p.at(s), v, "{s}");
        }
        assert_eq!((p.largest(), Profile::default().at(0.3), Profile::default().largest()), (4.0, 1.0, 1.0));
    }
}
