//! Sizes and materials of surgical thread, each number with its source and whether that source was verified.

/// A number with its unit and where it comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Figure {
    /// The number in SI units.
    pub value: f64,
    /// SI unit, empty for a pure number.
    pub unit: &'static str,
    /// Where it comes from.
    pub source: &'static str,
    /// Whether the source was read. An unverified number is a recalled or assumed one: replace it where it matters.
    pub verified: bool,
}

/// A size of thread by its USP number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Size {
    /// USP number, for instance `3-0`.
    pub name: &'static str,
    /// Metric number (tenths of a millimeter).
    pub metric: f64,
    /// Range of the average diameter allowed for synthetic thread \[m\].
    pub diameter_range: (f64, f64),
    /// Diameter used \[m\], the middle of the range.
    pub diameter: Figure,
    /// Least knot-pull strength of synthetic absorbable thread \[N\].
    pub knot_pull_absorbable: Option<Figure>,
    /// Least knot-pull strength of nonabsorbable thread, class I \[N\].
    pub knot_pull_nonabsorbable: Option<Figure>,
}

/// A material of thread.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MaterialPreset {
    /// Name used in scenes, for instance `silk`.
    pub name: &'static str,
    /// What it is.
    pub title: &'static str,
    /// Young's modulus in tension.
    pub young_modulus: Figure,
    /// Poisson's ratio.
    pub poisson_ratio: Figure,
    /// Mass per volume.
    pub density: Figure,
    /// Bending and twisting stiffness over that of a solid round rod.
    pub bend_scale: Figure,
    /// Kelvin-Voigt relaxation time of bending and twist.
    pub bend_damping: Figure,
    /// Friction of thread on thread.
    pub friction: Figure,
}

impl MaterialPreset {
    /// Its figures with their keys in a scene file.
    pub fn figures(&self) -> [(&'static str, Figure); 6] {
        [
            ("young_modulus", self.young_modulus),
            ("poisson_ratio", self.poisson_ratio),
            ("density", self.density),
            ("bend_scale", self.bend_scale),
            ("bend_damping", self.bend_damping),
            ("friction", self.friction),
        ]
    }
    /// Whether any of its figures is unverified.
    pub fn has_unverified(&self) -> bool {
        self.figures().iter().any(|(_, f)| !f.verified)
    }
}

/// No preset of that name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("no {kind} is called `{name}`{}", .nearest.map(|n| format!("; did you mean `{n}`?")).unwrap_or_default())]
pub struct UnknownPreset {
    /// `size` or `material`.
    pub kind: &'static str,
    /// What was asked for.
    pub name: String,
    /// The nearest name.
    pub nearest: Option<&'static str>,
}

/// All sizes, thinnest first.
pub fn sizes() -> &'static [Size] {
    SIZES
}

/// All materials.
pub fn materials() -> &'static [MaterialPreset] {
    MATERIALS
}

/// A size by its USP number.
pub fn find_size(name: &str) -> Result<&'static Size, UnknownPreset> {
    let wanted = name.trim();
    SIZES.iter().find(|s| s.name == wanted).ok_or_else(|| UnknownPreset {
        kind: "size",
        name: name.into(),
        nearest: crate::error::nearest(wanted, SIZES.iter().map(|s| s.name)),
    })
}

/// A material by its name.
pub fn find_material(name: &str) -> Result<&'static MaterialPreset, UnknownPreset> {
    let wanted = name.trim().to_lowercase();
    MATERIALS.iter().find(|m| m.name == wanted).ok_or_else(|| UnknownPreset {
        kind: "material",
        name: name.into(),
        nearest: crate::error::nearest(&wanted, MATERIALS.iter().map(|m| m.name)),
    })
}

const SIZES: &[Size] = &[];
const MATERIALS: &[MaterialPreset] = &[];
