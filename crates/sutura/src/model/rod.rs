//! What a user says of a thread, and the checked, lowered form that the solver reads.

use crate::error::{Error, check};
use crate::math::{exp, frame_from_tangent, half, log, rotation_arc};
use crate::model::material::{Material, SectionStiffness};
use crate::model::section::{Along, Factors, Profile, Section};
use glam::{DQuat, DVec3};

/// A thread. Marker of [`Handle`](crate::Handle).
#[derive(Debug)]
pub enum Rod {}

/// A thread to insert.
#[derive(Debug, Clone)]
pub struct RodSpec {
    /// Particles along the centerline in the world \[m\], at least two, no two neighbors at one place. A closed thread
    /// has at least three, and goes on from the last to the first.
    pub centerline: Vec<DVec3>,
    /// Material frame of each element, `world_from_material`, third director along the element. `None`: transported
    /// without twist from the first, whose first director is the across direction nearest to the normal of the first
    /// bend.
    pub frames: Option<Vec<DQuat>>,
    /// Shape that the thread has when nothing acts on it.
    pub rest: RestShape,
    /// Radius with which it touches, and of a round section \[m\], > 0.
    pub radius: f64,
    /// Shape of the cross-section.
    pub section: Section,
    /// Angle by which the section is turned about the tangent, from `frames` and the rest shape \[rad\].
    pub roll: f64,
    /// The same, growing from zero at the start to this at the end, evenly along the rest length \[rad\]: twist without
    /// moment.
    pub pretwist: f64,
    /// How size, stiffness and density change along it.
    pub along: Along,
    /// What it is made of.
    pub material: Material,
    /// Whether its end is joined to its start.
    pub closure: Option<Closure>,
    /// Whether the centerline may stretch.
    pub stretch: Stretch,
    /// Surface for friction, an index of the user's choice (see [`World::set_friction`](crate::World::set_friction)).
    pub surface: u32,
}

/// Shape of a thread at rest.
#[derive(Debug, Clone, PartialEq)]
pub enum RestShape {
    /// As inserted: lengths, bend and twist of `centerline` and `frames` are free of force.
    AsInserted,
    /// Straight and untwisted, with the lengths of `centerline`.
    Straight,
    /// Lengths of the elements \[m\] and rest bend and twist of the joints, along d1, d2, d3 \[1/m\]; either may be
    /// left to `centerline`.
    Given {
        /// Rest length of each element \[m\], > 0; `None` takes them from `centerline`.
        lengths: Option<Vec<f64>>,
        /// Rest Darboux vector of each joint between neighboring elements \[rad/m\], of a closed thread with the one
        /// from the last to the first at the end; `None` is straight and untwisted.
        darboux: Option<Vec<DVec3>>,
    },
}

/// How the end of a thread is joined to its start. The seam is as stiff as any other joint; it takes no plastic set.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Closure {
    /// Angle by which the thread is twisted before its ends are joined \[rad\]: moment, spread evenly. Positive is the
    /// right-hand rotation of the end against the start.
    pub twist: f64,
}

/// Whether the centerline stretches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stretch {
    /// By T / (E A).
    Elastic,
    /// Not at all: lengths are held to 1e-5. Where they would take half of E A to hold, as between ends that are driven
    /// apart, it stretches as its material does, and the report says so
    /// ([`IncidentKind::LengthNotKept`](crate::IncidentKind::LengthNotKept)).
    Inextensible,
}

impl RodSpec {
    /// An elastic, straight-rest thread through `centerline`.
    pub fn new(centerline: Vec<DVec3>, radius: f64, material: Material) -> Self {
        RodSpec {
            centerline,
            frames: None,
            rest: RestShape::Straight,
            radius,
            section: Section::Round,
            roll: 0.0,
            pretwist: 0.0,
            along: Along::default(),
            material,
            closure: None,
            stretch: Stretch::Elastic,
            surface: 0,
        }
    }

    /// `n_elements` equal elements from `from` to `to`.
    pub fn straight(from: DVec3, to: DVec3, n_elements: usize, radius: f64, material: Material) -> Self {
        let n = n_elements.max(1);
        let points = (0..=n).map(|i| from.lerp(to, i as f64 / n as f64)).collect();
        Self::new(points, radius, material)
    }

    /// A closed, straight-rest thread of `n_elements` equal elements along a circle about the axis `axis` (unit)
    /// through `center`, beginning at `center + start` (`start` across the axis, its length is the radius of the
    /// circle).
    pub fn ring(center: DVec3, axis: DVec3, start: DVec3, n_elements: usize, radius: f64, material: Material) -> Self {
        let other = axis.cross(start);
        let n = n_elements.max(3);
        let at = |i: usize| {
            let (s, c) = libm::sincos(core::f64::consts::TAU * i as f64 / n as f64);
            center + start * c + other * s
        };
        RodSpec { closure: Some(Closure::default()), ..Self::new((0..n).map(at).collect(), radius, material) }
    }

    /// Equal elements on a helix about the axis `axis` (unit) through `center`, starting at `center + start` (`start`
    /// across the axis, its length is the helix radius), `turns` turns (positive is right-handed), advancing `pitch`
    /// \[m\] a turn. The rest shape is the helix itself.
    #[allow(clippy::too_many_arguments, reason = "a helix has that many numbers")]
    pub fn helix(
        center: DVec3,
        axis: DVec3,
        start: DVec3,
        turns: f64,
        pitch: f64,
        n_elements: usize,
        radius: f64,
        material: Material,
    ) -> Self {
        let other = axis.cross(start);
        let n = n_elements.max(1);
        let points = (0..=n)
            .map(|i| {
                let turn = turns.abs() * i as f64 / n as f64;
                let (s, c) = libm::sincos(core::f64::consts::TAU * turn * turns.signum());
                center + start * c + other * s + axis * (pitch * turn)
            })
            .collect();
        RodSpec { rest: RestShape::AsInserted, ..Self::new(points, radius, material) }
    }
}

/// Frames along `points` without twist, starting with the across direction nearest to `hint`.
pub fn transported_frames(points: &[DVec3], hint: DVec3) -> Vec<DQuat> {
    let mut frames = Vec::with_capacity(points.len().saturating_sub(1));
    let mut before: Option<(DVec3, DQuat)> = None;
    for pair in points.windows(2) {
        let t = (pair[1] - pair[0]).normalize();
        let q = match before {
            None => frame_from_tangent(t, hint),
            Some((t0, q0)) => (rotation_arc(t0, t) * q0).normalize(),
        };
        frames.push(q);
        before = Some((t, q));
    }
    frames
}

/// A rod as the solver reads it. Elements and joints are slices of the world's arrays.
#[derive(Debug, Clone)]
pub(crate) struct RodModel {
    /// Index of the first particle and element in the world's arrays.
    pub first: u32,
    pub n_elements: u32,
    /// With which it touches \[m\].
    pub radius: f64,
    /// Cross-section as given, of this radius \[m\] where it is round, and the factor on its size: for who draws it.
    pub section: Section,
    pub section_radius: f64,
    pub size: Profile,
    pub material: Material,
    pub stretch: Stretch,
    /// Whether it bends more easily one way than the other.
    pub flat: bool,
    pub surface: u32,
    /// How often its particles were numbered from another one on.
    pub turned: u32,
}

impl RodModel {
    pub fn particles(&self) -> core::ops::Range<usize> {
        self.first as usize..(self.first + self.n_elements + 1) as usize
    }
    pub fn elements(&self) -> core::ops::Range<usize> {
        self.first as usize..(self.first + self.n_elements) as usize
    }
}

/// Sections of the elements of a rod, checked. Each element is given by its factors and its rest length \[m\].
pub(crate) fn sections(
    material: &Material,
    section: &Section,
    radius: f64,
    elements: impl Iterator<Item = (Factors, f64)>,
) -> Result<Vec<SectionStiffness>, Error> {
    let what = "rod";
    let mut sections = Vec::with_capacity(elements.size_hint().0);
    for (here, length) in elements {
        let s = SectionStiffness::new(material, section, radius, here);
        let stiffness = (s.ea + s.bend.max_element()) / length;
        check(what, "section", stiffness, stiffness * 1e6 < f64::MAX, "sizes and moduli of finite stiffness")?;
        let least = s.bend.min_element().min(s.kga).min(s.mass).min(s.inertia.min_element());
        check(
            what,
            "section",
            least,
            least.is_normal(),
            "sizes, moduli and densities whose products are no smaller than the least number",
        )?;
        sections.push(s);
    }
    if material.plasticity.is_some() && is_flat(&sections) {
        return Err(Error::invalid(
            what,
            "material.plasticity",
            section,
            "no plasticity for a section that is stiffer one way than the other",
        ));
    }
    Ok(sections)
}

/// Whether any bends more easily one way than the other.
pub(crate) fn is_flat(sections: &[SectionStiffness]) -> bool {
    sections.iter().any(|s| s.bend.x != s.bend.y)
}

/// The parts of a rod that go into the world's arrays, checked.
pub(crate) struct Lowered {
    /// Of a closed thread with the first once more at the end.
    pub centerline: Vec<DVec3>,
    /// Of a closed thread: square roots of the rest rotations from the last frame to the seam and from there to the
    /// first.
    pub seam: Option<[DQuat; 2]>,
    pub rest_lengths: Vec<f64>,
    /// Square root of the rest rotation of each joint; entry j is between frames j-1 and j (entry 0 unused, identity).
    pub rest_half: Vec<DQuat>,
    pub frames: Vec<DQuat>,
    /// Of each element.
    pub factors: Vec<Factors>,
    pub sections: Vec<SectionStiffness>,
    /// With which it touches \[m\].
    pub radius: f64,
}

impl RodSpec {
    pub(crate) fn lower(&self) -> Result<Lowered, Error> {
        let what = "rod";
        self.material.validate()?;
        check(what, "radius", self.radius, self.radius > 0.0, "a finite length > 0 [m]")?;
        self.section.validate()?;
        self.along.validate()?;
        // Of a larger angle no digit says how far the last turn went.
        check(what, "roll", self.roll, self.roll.abs() < 1e12, "a finite angle under 1e12 [rad]")?;
        check(what, "pretwist", self.pretwist, true, "a finite angle [rad]")?;
        let closed = self.closure.is_some();
        if self.centerline.len() < if closed { 3 } else { 2 } {
            return Err(Error::invalid(
                what,
                "centerline",
                format!("{} points", self.centerline.len()),
                "at least 2 points, 3 of a closed thread",
            ));
        }
        let mut points = self.centerline.clone();
        points.extend(closed.then(|| points[0]));
        let points = &points;
        for (i, p) in points.iter().enumerate() {
            if !crate::math::is_place(*p) {
                return Err(Error::invalid(
                    what,
                    format!("centerline[{i}]"),
                    p,
                    "finite coordinates whose squares are finite too [m]",
                ));
            }
        }
        let n = points.len() - 1;
        // A segment shorter than a thousandth of the radius has no usable direction.
        let shortest = 1e-3 * self.radius;
        for i in 0..n {
            let l = (points[i + 1] - points[i]).length();
            if !(l.is_finite() && l > shortest) {
                return Err(Error::invalid(
                    what,
                    format!("centerline[{i}..{}]", i + 1),
                    l,
                    "neighboring points farther apart than radius / 1000",
                ));
            }
        }
        if closed {
            // One that turns back on itself lies in itself there, and no seam holds it so.
            const SHARPEST: f64 = 3.0;
            let along = |i: usize| (points[i % n + 1] - points[i % n]).normalize();
            let sharp = (1..=n)
                .map(|i| (i, log(rotation_arc(along(i - 1), along(i))).length()))
                .find(|(_, turn)| *turn > SHARPEST);
            if let Some((i, turn)) = sharp {
                let (field, value) = (format!("centerline[{}]", i % n), format!("a turn by {turn:.2} rad"));
                return Err(Error::Invalid {
                    what,
                    field,
                    value,
                    wanted: "a closed thread that nowhere turns back on itself (by more than 3 rad)",
                });
            }
        }
        let mut frames = match &self.frames {
            Some(f) => {
                if f.len() != n {
                    return Err(Error::invalid(what, "frames", format!("{} frames", f.len()), "one for each element"));
                }
                for (i, q) in f.iter().enumerate() {
                    let t = (points[i + 1] - points[i]).normalize();
                    if !q.is_finite() || (q.length() - 1.0).abs() > 1e-6 || (*q * DVec3::Z).dot(t) < 0.9 {
                        return Err(Error::invalid(
                            what,
                            format!("frames[{i}]"),
                            q,
                            "a unit quaternion whose third director is along the element",
                        ));
                    }
                }
                f.iter().map(|q| q.normalize()).collect()
            }
            None => {
                let bend = points
                    .windows(3)
                    .map(|w| (w[1] - w[0]).normalize().cross((w[2] - w[1]).normalize()))
                    .find(|c| c.length() > 1e-6);
                let mut frames = transported_frames(points, bend.unwrap_or(DVec3::ZERO));
                if closed {
                    // What the frames lack to meet at the seam is spread over all joints.
                    let (last, first) = (frames[n - 1], frames[0]);
                    let carried = rotation_arc(last * DVec3::Z, first * DVec3::Z) * last;
                    let lack = log(carried.conjugate() * first).z;
                    for (e, q) in frames.iter_mut().enumerate() {
                        *q = (*q * exp(DVec3::Z * (lack * e as f64 / n as f64))).normalize();
                    }
                }
                frames
            }
        };
        let own_lengths = || (0..n).map(|i| (points[i + 1] - points[i]).length()).collect::<Vec<_>>();
        let mut rest_half = vec![DQuat::IDENTITY; n];
        // Entry 0 is the seam's.
        let first_joint = usize::from(!closed);
        let rest_lengths = match &self.rest {
            RestShape::Straight => own_lengths(),
            RestShape::AsInserted => {
                for j in first_joint..n {
                    rest_half[j] = half(frames[(j + n - 1) % n].conjugate() * frames[j]);
                }
                own_lengths()
            }
            RestShape::Given { lengths, darboux } => {
                let lengths = match lengths {
                    Some(l) if l.len() != n => {
                        return Err(Error::invalid(
                            what,
                            "rest.lengths",
                            format!("{} lengths", l.len()),
                            "one for each element",
                        ));
                    }
                    Some(l) => {
                        if let Some(i) = l.iter().position(|l| !(l.is_finite() && *l > shortest)) {
                            return Err(Error::invalid(
                                what,
                                format!("rest.lengths[{i}]"),
                                l[i],
                                "a finite length > radius / 1000 [m]",
                            ));
                        }
                        l.clone()
                    }
                    None => own_lengths(),
                };
                if let Some(d) = darboux {
                    if d.len() + first_joint != n {
                        return Err(Error::invalid(
                            what,
                            "rest.darboux",
                            format!("{} joints", d.len()),
                            "one for each joint between neighboring elements",
                        ));
                    }
                    for j in first_joint..n {
                        let before = (j + n - 1) % n;
                        let phi = d[before] * (0.5 * (lengths[before] + lengths[j]));
                        if !(phi.is_finite() && phi.length() < 3.0) {
                            return Err(Error::invalid(
                                what,
                                format!("rest.darboux[{before}]"),
                                d[before],
                                "finite, under 3 rad per element",
                            ));
                        }
                        rest_half[j] = exp(phi * 0.5);
                    }
                }
                lengths
            }
        };
        let middles: Vec<f64> = rest_lengths
            .iter()
            .scan(0.0, |arc, l| {
                *arc += l;
                Some(*arc - 0.5 * l)
            })
            .collect();
        if self.roll != 0.0 || self.pretwist != 0.0 {
            let rate = self.pretwist / rest_lengths.iter().sum::<f64>();
            let evenly =
                rest_lengths.iter().all(|l| (rate * l).abs() < 3.0) && middles.iter().all(|s| (rate * s).is_finite());
            check(what, "pretwist", self.pretwist, evenly, "under 3 rad per element")?;
            let turn: Vec<DQuat> = middles.iter().map(|s| exp(DVec3::Z * (self.roll + rate * s))).collect();
            for j in first_joint..n {
                let before = (j + n - 1) % n;
                rest_half[j] = half((turn[before].conjugate() * (rest_half[j] * rest_half[j]) * turn[j]).normalize());
            }
            for (frame, turn) in frames.iter_mut().zip(&turn) {
                *frame = (*frame * *turn).normalize();
            }
        }
        let seam = self.closure.map(|c| {
            // The seam lies half of the twist before the first frame and half of it after the last.
            let (h, turn) = (rest_half[0], exp(DVec3::Z * (-0.5 * c.twist)));
            [half(h * turn), half(turn * h)]
        });
        rest_half[0] = DQuat::IDENTITY;
        if let Some(Closure { twist }) = self.closure {
            let length: f64 = rest_lengths.iter().sum();
            check(
                what,
                "closure.twist",
                twist,
                (twist / n as f64).abs() < 3.0,
                "a finite angle under 3 rad per element [rad]",
            )?;
            for (q, s) in frames.iter_mut().zip(&middles) {
                *q = (*q * exp(DVec3::Z * (twist * s / length))).normalize();
            }
        }
        let factors: Vec<Factors> = middles.iter().map(|s| self.along.at(*s)).collect();
        let elements = factors.iter().copied().zip(rest_lengths.iter().copied());
        let sections = sections(&self.material, &self.section, self.radius, elements)?;
        Ok(Lowered {
            centerline: points.clone(),
            seam,
            rest_lengths,
            rest_half,
            frames,
            factors,
            sections,
            radius: self.radius * self.along.size.largest(),
        })
    }
}
