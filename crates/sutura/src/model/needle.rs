//! Surgical needles: their curve, their point, and the body that they are.

use crate::error::{Error, check};
use crate::math::Pose;
use crate::model::body::{BodySpec, ColliderSpec};
use crate::model::shape::Geometry;
use glam::{DMat3, DQuat, DVec3};

/// A needle. Its frame has the swage as origin, z along the needle there, toward its point, and x toward the center of
/// its first arc; y is across its plane.
#[derive(Debug, Clone, PartialEq)]
pub struct NeedleSpec {
    /// Its arcs one after the other, from the swage to the point.
    pub arcs: Vec<NeedleArc>,
    /// Diameter of its wire \[m\].
    pub wire: f64,
    /// Its point.
    pub point: NeedlePoint,
    /// Density \[kg/m^3\].
    pub density: f64,
    /// Surface for friction, an index of the user's choice.
    pub surface: u32,
}

/// A piece of a needle of one curvature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NeedleArc {
    /// Its length \[m\].
    pub length: f64,
    /// Its curvature toward x \[1/m\]; zero is straight.
    pub curvature: f64,
}

/// How a needle's point parts tissue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum NeedlePoint {
    /// Round, it spreads.
    Taper,
    /// With cutting edges, one of them on the inner side of the curve.
    Cutting,
    /// With cutting edges, one of them on the outer side of the curve.
    ReverseCutting,
    /// Rounded, for tissue that tears.
    Blunt,
}

/// The part of a circle that a needle is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum NeedleShape {
    /// No curve.
    Straight,
    /// 90 degrees.
    QuarterCircle,
    /// 135 degrees.
    ThreeEighthsCircle,
    /// 180 degrees.
    HalfCircle,
    /// 225 degrees.
    FiveEighthsCircle,
}

impl NeedleShape {
    /// The angle of its arc \[rad\].
    pub fn angle(self) -> f64 {
        core::f64::consts::FRAC_PI_4
            * match self {
                NeedleShape::Straight => 0.0,
                NeedleShape::QuarterCircle => 2.0,
                NeedleShape::ThreeEighthsCircle => 3.0,
                NeedleShape::HalfCircle => 4.0,
                NeedleShape::FiveEighthsCircle => 5.0,
            }
    }
}

/// A needle of a catalogue.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NeedleCode {
    /// Code by which it is ordered, Ethicon's.
    pub code: &'static str,
    /// Its shape.
    pub shape: NeedleShape,
    /// Length along its arc \[m\].
    pub length: f64,
    /// Diameter of its wire \[m\]. Catalogues seldom say: these are typical, and unverified.
    pub wire: f64,
    /// Its point.
    pub point: NeedlePoint,
}

/// Common needles, with shape and arc length as makers' catalogues have them.
pub const NEEDLES: [NeedleCode; 9] = {
    use NeedlePoint::{ReverseCutting, Taper};
    use NeedleShape::{FiveEighthsCircle, HalfCircle, ThreeEighthsCircle};
    const fn of(code: &'static str, shape: NeedleShape, length: f64, wire: f64, point: NeedlePoint) -> NeedleCode {
        NeedleCode { code, shape, length, wire, point }
    }
    [
        of("P-3", ThreeEighthsCircle, 13e-3, 0.43e-3, ReverseCutting),
        of("PS-2", ThreeEighthsCircle, 19e-3, 0.6e-3, ReverseCutting),
        of("FS-2", ThreeEighthsCircle, 19e-3, 0.66e-3, ReverseCutting),
        of("RB-1", HalfCircle, 17e-3, 0.5e-3, Taper),
        of("SH", HalfCircle, 26e-3, 0.66e-3, Taper),
        of("CT-1", HalfCircle, 36e-3, 1.0e-3, Taper),
        of("CT", HalfCircle, 40e-3, 1.3e-3, Taper),
        of("CTX", HalfCircle, 48e-3, 1.3e-3, Taper),
        of("UR-6", FiveEighthsCircle, 27e-3, 1.0e-3, Taper),
    ]
};

/// Density of the steel of needles \[kg/m^3\].
const STEEL: f64 = 7900.0;

/// Length of a point, in diameters of the wire, and its radius at the very end over that of the wire.
const POINT: f64 = 4.0;
const TIP: f64 = 0.15;

/// Most that a chord is off its arc, in radii of the wire, and most capsules of a needle.
const OFF: f64 = 0.1;
const MOST: usize = 96;

impl NeedleSpec {
    /// Of one arc of this length \[m\], of wire of this diameter \[m\], of steel.
    pub fn new(shape: NeedleShape, length: f64, wire: f64, point: NeedlePoint) -> Self {
        let arcs = vec![NeedleArc { length, curvature: shape.angle() / length }];
        NeedleSpec { arcs, wire, point, density: STEEL, surface: 0 }
    }

    /// By its catalogue code ([`NEEDLES`]), whatever its case.
    pub fn preset(code: &str) -> Option<Self> {
        let found = NEEDLES.iter().find(|n| n.code.eq_ignore_ascii_case(code.trim()))?;
        Some(NeedleSpec::new(found.shape, found.length, found.wire, found.point))
    }

    /// Its length along its arcs \[m\].
    pub fn length(&self) -> f64 {
        self.arcs.iter().map(|a| a.length).sum()
    }

    /// Its frame at a way from the swage along it \[m\]: z along the needle, x toward the inner side of the curve.
    pub fn at(&self, way: f64) -> Pose {
        let mut pose = Pose::IDENTITY;
        let mut left = way.clamp(0.0, self.length());
        for arc in &self.arcs {
            let s = left.min(arc.length);
            left -= s;
            let angle = arc.curvature * s;
            let (sin, cos) = libm::sincos(angle);
            // Along z and toward x: sin(k s) / k and (1 - cos(k s)) / k.
            let along = if angle.abs() < 1e-6 { s } else { sin / arc.curvature };
            let aside = if angle.abs() < 1e-6 { 0.5 * angle * s } else { (1.0 - cos) / arc.curvature };
            let turn = crate::math::exp(DVec3::Y * angle);
            pose = pose.compose(&Pose::new(DVec3::new(aside, 0.0, along), turn));
        }
        pose
    }

    /// Where the point is, in the frame of the needle.
    pub fn tip(&self) -> Pose {
        self.at(self.length())
    }

    /// Radius at a way from the swage \[m\].
    pub fn radius(&self, way: f64) -> f64 {
        let r = 0.5 * self.wire;
        let tip = if self.point == NeedlePoint::Blunt { 1.0 } else { TIP };
        let part = ((self.length() - way) / (POINT * self.wire)).clamp(0.0, 1.0);
        r * (tip + (1.0 - tip) * part)
    }

    /// Where its frame is when the swage is at `swage` and the needle goes on along `along`, its first arc bent toward
    /// `toward` (what of it is across).
    pub fn pose(&self, swage: DVec3, along: DVec3, toward: DVec3) -> Pose {
        let z = along.normalize_or(DVec3::Z);
        let x = (toward - z * z.dot(toward)).try_normalize().unwrap_or_else(|| z.any_orthonormal_vector());
        Pose::new(swage, DQuat::from_mat3(&DMat3::from_cols(x, z.cross(x), z)).normalize())
    }

    /// The body that it is, with its frame there: capsules along its curve, thinner toward the point, of the mass of
    /// the wire.
    pub fn body(&self, pose: Pose) -> Result<BodySpec, Error> {
        self.validate()?;
        let total = self.length();
        let point = (POINT * self.wire).min(0.5 * total);
        let turned: f64 = self.arcs.iter().map(|a| (a.curvature * a.length).abs()).sum();
        let tightest = self.arcs.iter().map(|a| a.curvature.abs()).fold(0.0, f64::max);
        let per_chord = 2.0 * libm::acos((1.0 - OFF * 0.5 * self.wire * tightest).max(0.0));
        let n = if turned > 0.0 { (turned / per_chord).ceil() } else { 1.0 };
        check("needle", "wire", self.wire, n <= MOST as f64, "a wire that is not that thin for the curve [m]")?;
        // Joints of the capsules; those of the point are shorter, since it becomes thinner.
        let shaft = total - point;
        let mut ways: Vec<f64> = (0..=n as usize).map(|k| shaft * k as f64 / n).collect();
        let ends = self.arcs.iter().scan(0.0, |s, a| {
            *s += a.length;
            Some(*s)
        });
        ways.extend(ends.filter(|s| *s < shaft));
        ways.extend([0.35, 0.65, 0.85, 1.0].map(|part| shaft + point * part));
        ways.sort_unstable_by(f64::total_cmp);
        ways.dedup_by(|b, a| *b - *a < 1e-6 * total);
        let capsule = |pair: &[f64]| {
            let (a, b) = (self.at(pair[0]).position, self.at(pair[1]).position);
            let radius = self.radius(0.5 * (pair[0] + pair[1]));
            let half_length = 0.5 * a.distance(b);
            // A capsule has its ends' volume besides.
            let round = core::f64::consts::PI * radius * radius;
            let volume = round * (2.0 * half_length + radius * 4.0 / 3.0);
            ColliderSpec {
                geometry: Geometry::Capsule { radius, half_length },
                pose: Pose::new((a + b) * 0.5, crate::math::rotation_arc(DVec3::Z, (b - a).normalize())),
                density: self.density * round * (pair[1] - pair[0]) / volume,
                surface: self.surface,
            }
        };
        let colliders = ways.windows(2).map(capsule).collect();
        Ok(BodySpec { pose, colliders, velocity: DVec3::ZERO, angular_velocity: DVec3::ZERO })
    }

    fn validate(&self) -> Result<(), Error> {
        let what = "needle";
        if self.arcs.is_empty() {
            return Err(Error::invalid(what, "arcs", "none", "at least one arc"));
        }
        for arc in &self.arcs {
            check(what, "length", arc.length, arc.length > 0.0, "a finite length > 0 [m]")?;
            check(what, "curvature", arc.curvature, true, "a finite curvature [1/m]")?;
        }
        let most = 0.25 * self.length();
        check(what, "wire", self.wire, self.wire > 0.0 && self.wire < most, "less than a quarter of its length [m]")?;
        check(what, "density", self.density, self.density > 0.0, "a density > 0 [kg/m^3]")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_half_circle_comes_back_beside_where_it_began() {
        let needle = NeedleSpec::preset("sh").unwrap();
        let r = 26e-3 / core::f64::consts::PI;
        let tip = needle.tip();
        assert!((tip.position - DVec3::X * (2.0 * r)).length() < 1e-12, "{tip:?}");
        assert!((tip.orientation * DVec3::Z - DVec3::NEG_Z).length() < 1e-12);
        // Straight and then curved: a ski needle.
        let arc = |length, curvature| NeedleArc { length, curvature };
        let ski = NeedleSpec { arcs: vec![arc(0.01, 0.0), arc(0.01, 50.0)], ..needle };
        let wanted = DVec3::new((1.0 - 0.5f64.cos()) / 50.0, 0.0, 0.01 + 0.5f64.sin() / 50.0);
        assert!((ski.tip().position - wanted).length() < 1e-12);
    }

    #[test]
    fn a_needle_has_the_mass_and_the_inertia_of_its_wire() {
        for (shape, length, wire) in
            [(NeedleShape::HalfCircle, 36e-3, 1e-3), (NeedleShape::ThreeEighthsCircle, 13e-3, 4e-4)]
        {
            // Blunt: of one radius all along.
            let needle = NeedleSpec::new(shape, length, wire, NeedlePoint::Blunt);
            let found = needle.body(Pose::IDENTITY).unwrap().mass_properties().unwrap();
            let mass = STEEL * core::f64::consts::PI * 0.25 * wire * wire * length;
            assert!((found.mass / mass - 1.0).abs() < 1e-12, "{found:?} {mass}");
            let (angle, r) = (shape.angle(), length / shape.angle());
            // Of a thin arc: its center is at r sin(a / 2) / (a / 2) from the middle of the circle, where its moment
            // across is m r^2.
            let center = r * (0.5 * angle).sin() / (0.5 * angle);
            let across = mass * (r * r - center * center);
            assert!((found.moments.max_element() / across - 1.0).abs() < 1e-2, "{found:?} {across}");
            let middle = needle.at(0.5 * length);
            let outward = middle.orientation * DVec3::X;
            let wanted = middle.position + outward * (r - center);
            assert!((found.center - wanted).length() < 2e-3 * length, "{found:?} {wanted}");
        }
    }

    #[test]
    fn what_is_no_needle_is_refused() {
        let thin = NeedleSpec::new(NeedleShape::HalfCircle, 0.1, 1e-6, NeedlePoint::Taper);
        assert!(thin.body(Pose::IDENTITY).is_err());
        let thick = NeedleSpec::new(NeedleShape::HalfCircle, 1e-3, 1e-3, NeedlePoint::Taper);
        assert!(thick.body(Pose::IDENTITY).is_err());
        assert!(NeedleSpec::preset("none").is_none());
        for n in NEEDLES {
            NeedleSpec::preset(n.code).unwrap().body(Pose::IDENTITY).unwrap().mass_properties().unwrap();
        }
    }
}
