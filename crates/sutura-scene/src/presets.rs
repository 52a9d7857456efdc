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
    /// Which limit of knot-pull strength its threads must meet; `None` where neither is for it.
    pub absorbable: Option<bool>,
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

/// The least knot-pull strength of a thread of this size: of the kind of its material, and of the weaker kind where the
/// material is not known. `None` where there is no limit.
pub fn knot_pull(size: &Size, material: Option<&MaterialPreset>) -> Option<Figure> {
    let kinds = [(true, size.knot_pull_absorbable), (false, size.knot_pull_nonabsorbable)];
    let fits = |absorbable: bool| material.is_none_or(|m| m.absorbable == Some(absorbable));
    kinds.into_iter().filter(|k| fits(k.0)).filter_map(|k| k.1).min_by(|a, b| a.value.total_cmp(&b.value))
}

/// Where the ranges of diameter come from.
const RANGES: &str = "lower bounds: metric number / 10 (Ph. Eur.; product catalogues, e.g. 3-0 = 2, 2-0 = 3); upper bounds recalled from the USP monographs, not read again; the middle of the range is used";
/// Where the knot-pull limits come from.
const KNOT_PULL: &str = "USP <881> tables as recalled (kgf x 9.80665); not read again";

const fn size(
    name: &'static str,
    metric: f64,
    range_mm: (f64, f64),
    middle_mm: f64,
    absorbable: Option<f64>,
    nonabsorbable: Option<f64>,
) -> Size {
    const fn pull(value: Option<f64>) -> Option<Figure> {
        match value {
            Some(value) => Some(Figure { value, unit: "N", source: KNOT_PULL, verified: false }),
            None => None,
        }
    }
    Size {
        name,
        metric,
        diameter_range: (range_mm.0 / 1e3, range_mm.1 / 1e3),
        diameter: Figure { value: middle_mm / 1e3, unit: "m", source: RANGES, verified: false },
        knot_pull_absorbable: pull(absorbable),
        knot_pull_nonabsorbable: pull(nonabsorbable),
    }
}

/// `3` stands for 3 and 4, which share their range. 2-0 is metric 3 (one source says 2.5; catalogues and a measured
/// 0.303 mm say 3).
const SIZES: &[Size] = &[
    size("11-0", 0.1, (0.010, 0.019), 0.015, None, None),
    size("10-0", 0.2, (0.020, 0.029), 0.025, None, None),
    size("9-0", 0.3, (0.030, 0.039), 0.035, None, None),
    size("8-0", 0.4, (0.040, 0.049), 0.045, Some(0.69), Some(0.59)),
    size("7-0", 0.5, (0.050, 0.069), 0.06, Some(1.37), Some(1.08)),
    size("6-0", 0.7, (0.070, 0.099), 0.085, Some(2.45), Some(1.96)),
    size("5-0", 1.0, (0.100, 0.149), 0.125, Some(6.67), Some(3.92)),
    size("4-0", 1.5, (0.150, 0.199), 0.175, Some(9.32), Some(5.88)),
    size("3-0", 2.0, (0.200, 0.249), 0.225, Some(17.36), Some(9.41)),
    size("2-0", 3.0, (0.300, 0.339), 0.32, Some(26.28), Some(14.12)),
    size("0", 3.5, (0.350, 0.399), 0.375, Some(38.25), Some(21.18)),
    size("1", 4.0, (0.400, 0.499), 0.45, Some(49.82), Some(26.67)),
    size("2", 5.0, (0.500, 0.599), 0.55, Some(62.27), Some(34.52)),
    size("3", 6.0, (0.600, 0.699), 0.65, Some(71.49), Some(47.86)),
    size("5", 7.0, (0.700, 0.799), 0.75, None, Some(60.41)),
];

const fn read(value: f64, unit: &'static str, source: &'static str) -> Figure {
    Figure { value, unit, source, verified: true }
}

const fn unverified(value: f64, unit: &'static str, source: &'static str) -> Figure {
    Figure { value, unit, source, verified: false }
}

/// The abstract gives one modulus per material.
const NALEWAY: &str = "Naleway et al. 2015, initial modulus of 3-0 thread (abstract: studylib.net/doc/10697220)";
const TEXTBOOK: &str = "recalled textbook value, not verified";
const MODULUS: &str = "middle of a recalled range, not verified";
const BRAID_BENDING: &str =
    "assumed: braids are said to bend 10 to 100 times softer than a solid rod, no measurement was found";
const SOLID: &str = "a solid round monofilament, by definition";
const NO_DAMPING: &str = "none assumed; no measurement was found";
const MONO_FRICTION: &str =
    "engineering start value, 0.12 to 0.25 for monofilaments; falls with load; no source gives a number";
const BRAID_FRICTION: &str =
    "engineering start value, 0.2 to 0.35 for braids; falls with load; no source gives a number";
const POISSON: &str = "assumed for polymers, not verified";

const fn monofilament(
    name: &'static str,
    title: &'static str,
    absorbable: bool,
    young_modulus: Figure,
    density: f64,
) -> MaterialPreset {
    MaterialPreset {
        name,
        title,
        absorbable: Some(absorbable),
        young_modulus,
        poisson_ratio: unverified(0.4, "", POISSON),
        density: unverified(density, "kg/m^3", TEXTBOOK),
        bend_scale: read(1.0, "", SOLID),
        bend_damping: unverified(0.0, "s", NO_DAMPING),
        friction: unverified(0.18, "", MONO_FRICTION),
    }
}

const fn braid(
    name: &'static str,
    title: &'static str,
    absorbable: bool,
    young_modulus: Figure,
    density: f64,
) -> MaterialPreset {
    MaterialPreset {
        bend_scale: unverified(0.02, "", BRAID_BENDING),
        friction: unverified(0.3, "", BRAID_FRICTION),
        ..monofilament(name, title, absorbable, young_modulus, density)
    }
}

const MATERIALS: &[MaterialPreset] = &[
    braid("silk", "braided silk", false, read(8.7e9, "Pa", NALEWAY), 1300.0),
    braid(
        "polyglactin",
        "braided polyglactin 910 (the modulus is that of the rapid grade)",
        true,
        read(9.32e9, "Pa", NALEWAY),
        1500.0,
    ),
    monofilament(
        "polypropylene",
        "polypropylene monofilament; takes a plastic set at moderate load (Holmlund 1976)",
        false,
        unverified(3.0e9, "Pa", MODULUS),
        910.0,
    ),
    monofilament("nylon", "nylon monofilament", false, unverified(2.2e9, "Pa", MODULUS), 1140.0),
    monofilament("polydioxanone", "polydioxanone monofilament", true, unverified(1.5e9, "Pa", MODULUS), 1300.0),
    MaterialPreset {
        // The limits of class I are not for metal.
        absorbable: None,
        poisson_ratio: unverified(0.3, "", TEXTBOOK),
        ..monofilament("steel", "stainless steel wire", false, unverified(195.0e9, "Pa", TEXTBOOK), 7900.0)
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_ordered_and_their_middles_lie_in_their_ranges() {
        for pair in sizes().windows(2) {
            assert!(pair[0].diameter_range.1 < pair[1].diameter_range.0, "{} {}", pair[0].name, pair[1].name);
        }
        for s in sizes() {
            assert!(s.diameter_range.0 <= s.diameter.value && s.diameter.value <= s.diameter_range.1, "{}", s.name);
            // The metric number is the lower bound in tenths of a millimeter.
            assert!((s.metric * 1e-4 - s.diameter_range.0).abs() < 1e-9, "{}", s.name);
        }
    }

    #[test]
    fn presets_are_found_or_the_nearest_is_named() {
        assert_eq!(find_size("3-0").unwrap().diameter.value, 0.225e-3);
        assert_eq!(find_material("Silk").unwrap().young_modulus.value, 8.7e9);
        assert_eq!(find_size("3-00").unwrap_err().nearest, Some("3-0"));
        assert!(find_material("nilon").unwrap_err().to_string().contains("`nylon`"));
        assert_eq!(find_material("granite").unwrap_err().nearest, None);
    }

    #[test]
    fn the_knot_pull_limit_is_that_of_the_kind_of_the_material() {
        let (size, pull) = (find_size("3-0").unwrap(), |m: &str| {
            knot_pull(find_size("3-0").unwrap(), Some(find_material(m).unwrap())).map(|f| f.value)
        });
        assert_eq!((pull("silk"), pull("polydioxanone"), pull("steel")), (Some(9.41), Some(17.36), None));
        assert_eq!(knot_pull(size, None).map(|f| f.value), Some(9.41));
        assert_eq!(knot_pull(find_size("9-0").unwrap(), None), None);
        assert_eq!(knot_pull(find_size("5").unwrap(), None).map(|f| f.value), Some(60.41));
    }

    #[test]
    fn every_material_that_has_an_unverified_number_says_so() {
        for m in materials() {
            for (key, f) in m.figures() {
                assert!(!f.source.is_empty() && f.value.is_finite(), "{} {key}", m.name);
                let admits = ["assumed", "recalled", "start value"].iter().any(|w| f.source.contains(w));
                assert_eq!(f.verified, !admits, "{} {key}: {}", m.name, f.source);
            }
            assert!(m.has_unverified());
        }
    }
}
