//! Units: the only place where a millimeter becomes 0.001. Everything past this module is SI.

use std::fmt;

/// Exponents of meter, kilogram, second and radian.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Dim {
    pub m: i8,
    pub kg: i8,
    pub s: i8,
    pub rad: i8,
}

const fn dim(m: i8, kg: i8, s: i8) -> Dim {
    Dim { m, kg, s, rad: 0 }
}

impl Dim {
    pub const NUMBER: Dim = dim(0, 0, 0);
    pub const LENGTH: Dim = dim(1, 0, 0);
    pub const AREA: Dim = dim(2, 0, 0);
    pub const MASS: Dim = dim(0, 1, 0);
    pub const TIME: Dim = dim(0, 0, 1);
    pub const RATE: Dim = dim(0, 0, -1);
    pub const ANGLE: Dim = Dim { m: 0, kg: 0, s: 0, rad: 1 };
    /// Angular velocity.
    pub const SPIN: Dim = Dim { m: 0, kg: 0, s: -1, rad: 1 };
    pub const SPEED: Dim = dim(1, 0, -1);
    pub const ACCELERATION: Dim = dim(1, 0, -2);
    pub const FORCE: Dim = dim(1, 1, -2);
    /// Torque and energy alike.
    pub const TORQUE: Dim = dim(2, 1, -2);
    pub const STIFFNESS: Dim = dim(0, 1, -2);
    pub const PRESSURE: Dim = dim(-1, 1, -2);
    pub const DENSITY: Dim = dim(-3, 1, 0);
    pub const CURVATURE: Dim = dim(-1, 0, 0);
    pub const INERTIA: Dim = dim(2, 1, 0);
    pub const MOMENTUM: Dim = dim(1, 1, -1);

    pub fn times(self, o: Dim) -> Dim {
        let add = i8::saturating_add;
        Dim { m: add(self.m, o.m), kg: add(self.kg, o.kg), s: add(self.s, o.s), rad: add(self.rad, o.rad) }
    }
    pub fn over(self, o: Dim) -> Dim {
        self.times(o.power(-1))
    }
    pub fn power(self, n: i8) -> Dim {
        let mul = i8::saturating_mul;
        Dim { m: mul(self.m, n), kg: mul(self.kg, n), s: mul(self.s, n), rad: mul(self.rad, n) }
    }
    /// Whether a quantity of dimension `got` may stand where this one is wanted. Radians count only between an angle
    /// and a pure number: `30 deg` is not a coefficient, though 0.5 is an angle and `1/m` a twist.
    pub fn accepts(self, got: Dim) -> bool {
        (self.m, self.kg, self.s) == (got.m, got.kg, got.s)
            && (got.rad == 0 || self.rad != 0 || (self.m, self.kg, self.s) != (0, 0, 0))
    }
    /// Whether two quantities may be added or compared (angles are numbers here).
    pub fn same_kind(self, o: Dim) -> bool {
        (self.m, self.kg, self.s) == (o.m, o.kg, o.s)
    }
    /// The SI unit, for column headings.
    pub fn si_unit(self) -> String {
        let known = [
            (Dim::FORCE, "N"),
            (Dim::TORQUE, "N m"),
            (Dim::STIFFNESS, "N/m"),
            (Dim::PRESSURE, "Pa"),
            (Dim::SPEED, "m/s"),
            (Dim::ACCELERATION, "m/s^2"),
            (Dim::CURVATURE, "1/m"),
            (Dim::RATE, "1/s"),
            (Dim::DENSITY, "kg/m^3"),
            (Dim::ANGLE, "rad"),
        ];
        if let Some((_, name)) = known.iter().find(|(d, _)| *d == self) {
            return (*name).into();
        }
        let (mut top, mut bottom) = (Vec::new(), Vec::new());
        for (n, symbol) in [(self.kg, "kg"), (self.m, "m"), (self.s, "s"), (self.rad, "rad")] {
            let text = if n.abs() > 1 { format!("{symbol}^{}", n.unsigned_abs()) } else { symbol.into() };
            match n {
                0 => {}
                1.. => top.push(text),
                _ => bottom.push(text),
            }
        }
        match (top.is_empty(), bottom.is_empty()) {
            (_, true) => top.join(" "),
            (true, false) => format!("1/{}", bottom.join("/")),
            (false, false) => format!("{}/{}", top.join(" "), bottom.join("/")),
        }
    }
}

impl fmt::Display for Dim {
    /// In words, for messages.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let known = [
            (Dim::NUMBER, "a pure number"),
            (Dim::LENGTH, "a length"),
            (Dim::AREA, "an area"),
            (Dim::MASS, "a mass"),
            (Dim::TIME, "a time"),
            (Dim::RATE, "a rate (1/s)"),
            (Dim::ANGLE, "an angle"),
            (Dim::SPIN, "an angular velocity"),
            (Dim::SPEED, "a speed"),
            (Dim::ACCELERATION, "an acceleration"),
            (Dim::FORCE, "a force"),
            (Dim::TORQUE, "a torque or energy"),
            (Dim::STIFFNESS, "a force per length"),
            (Dim::PRESSURE, "a pressure or modulus"),
            (Dim::DENSITY, "a density"),
            (Dim::CURVATURE, "a curvature (1/m)"),
            (Dim::INERTIA, "a moment of inertia"),
        ];
        match known.iter().find(|(d, _)| d == self) {
            Some((_, words)) => write!(f, "{words}"),
            None => write!(f, "something in {}", self.si_unit()),
        }
    }
}

/// A unit: its size in SI and its dimension.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    pub size: f64,
    pub dim: Dim,
}

/// A number with its dimension, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantity {
    pub value: f64,
    pub dim: Dim,
}

/// Whole unit symbols. `true` where SI prefixes may stand before it.
const SYMBOLS: &[(&str, f64, Dim, bool)] = &[
    ("m", 1.0, Dim::LENGTH, true),
    ("g", 1e-3, Dim::MASS, true),
    ("s", 1.0, Dim::TIME, true),
    ("N", 1.0, Dim::FORCE, true),
    ("Pa", 1.0, Dim::PRESSURE, true),
    ("J", 1.0, Dim::TORQUE, true),
    ("Hz", 1.0, Dim::RATE, true),
    ("rad", 1.0, Dim::ANGLE, true),
    ("min", 60.0, Dim::TIME, false),
    ("deg", std::f64::consts::PI / 180.0, Dim::ANGLE, false),
    ("°", std::f64::consts::PI / 180.0, Dim::ANGLE, false),
    ("turn", std::f64::consts::TAU, Dim::ANGLE, false),
    ("turns", std::f64::consts::TAU, Dim::ANGLE, false),
    ("%", 0.01, Dim::NUMBER, false),
    ("cc", 1e-6, Dim { m: 3, kg: 0, s: 0, rad: 0 }, false),
];

const PREFIXES: &[(&str, f64)] =
    &[("n", 1e-9), ("u", 1e-6), ("µ", 1e-6), ("μ", 1e-6), ("m", 1e-3), ("c", 1e-2), ("k", 1e3), ("M", 1e6), ("G", 1e9)];

/// A unit symbol with or without prefix, such as `mm` or `GPa`.
pub fn symbol(word: &str) -> Option<Unit> {
    if let Some((_, size, dim, _)) = SYMBOLS.iter().find(|(s, ..)| *s == word) {
        return Some(Unit { size: *size, dim: *dim });
    }
    PREFIXES.iter().find_map(|(prefix, factor)| {
        let rest = word.strip_prefix(prefix)?;
        let (_, size, dim, _) = SYMBOLS.iter().find(|(s, _, _, prefixed)| *prefixed && *s == rest)?;
        Some(Unit { size: size * factor, dim: *dim })
    })
}

/// Units that are offered when a word is not one.
fn known_words() -> Vec<&'static str> {
    vec![
        "m", "mm", "cm", "um", "km", "kg", "g", "mg", "ug", "s", "ms", "us", "min", "N", "mN", "uN", "kN", "Pa", "kPa",
        "MPa", "GPa", "J", "mJ", "uJ", "Hz", "kHz", "rad", "deg", "turn", "turns", "%", "cc",
    ]
}

/// Reads a unit such as `mm`, `m/s^2`, `mN m`, `1/m`. Factors are joined by a space, `*` or `·`; `/` divides by the
/// next factor.
pub fn parse_unit(text: &str) -> Result<Unit, String> {
    let mut unit = Unit { size: 1.0, dim: Dim::NUMBER };
    let mut divide = false;
    let mut first = true;
    let spaced = text.replace('/', " / ").replace(['*', '·'], " ").replace("²", "^2").replace("³", "^3");
    for word in spaced.split_whitespace() {
        if word == "/" {
            if divide || first {
                return Err(format!("`{text}` is not a unit"));
            }
            divide = true;
            continue;
        }
        let (name, power) = match word.split_once('^') {
            None => (word, 1i8),
            Some((name, digits)) => match digits.parse::<i8>() {
                Ok(n) if n.abs() <= 9 => (name, n),
                _ => return Err(format!("`{word}` is not a unit: the power must be a small whole number")),
            },
        };
        let factor = if name == "1" { Some(Unit { size: 1.0, dim: Dim::NUMBER }) } else { symbol(name) };
        let Some(factor) = factor else {
            let near = crate::error::nearest(name, known_words());
            return Err(match near {
                Some(near) => format!("`{name}` is not a unit; did you mean `{near}`?"),
                None => format!(
                    "`{name}` is not a unit (known: m, g, s, N, Pa, J, Hz, rad with prefixes n u m c k M G; deg, turn, min, %)"
                ),
            });
        };
        let power = if divide { -power } else { power };
        unit.size *= factor.size.powi(i32::from(power));
        unit.dim = unit.dim.times(factor.dim.power(power));
        divide = false;
        first = false;
    }
    if divide {
        return Err(format!("`{text}` ends with a division"));
    }
    Ok(unit)
}

/// Length of the number at the start of `text`, 0 when there is none.
pub fn number_length(text: &str) -> usize {
    let b = text.as_bytes();
    let digits = |mut i: usize| {
        while i < b.len() && (b[i].is_ascii_digit() || (b[i] == b'_' && i > 0 && b[i - 1].is_ascii_digit())) {
            i += 1;
        }
        i
    };
    let start = usize::from(matches!(b.first(), Some(b'+' | b'-')));
    let mut i = digits(start);
    let mut any = i > start;
    if b.get(i) == Some(&b'.') {
        let j = digits(i + 1);
        any |= j > i + 1;
        i = if any { j } else { i };
    }
    if !any {
        return 0;
    }
    if matches!(b.get(i), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(b.get(i + 1), Some(b'+' | b'-')));
        let j = digits(i + 1 + sign);
        if j > i + 1 + sign {
            i = j;
        }
    }
    i
}

/// A quantity typed outside of a scene, in SI. `like` is an SI unit of what is wanted, such as `N`, and is meant where
/// the text has no unit. The error is a message.
pub fn in_si(text: &str, like: &str) -> Result<f64, String> {
    let (quantity, wanted) = (parse_quantity(text)?, parse_unit(like)?);
    let plain = quantity.dim == Dim::NUMBER && number_length(text.trim()) == text.trim().len();
    if plain || wanted.dim.accepts(quantity.dim) {
        Ok(quantity.value)
    } else {
        Err(format!("`{text}` is {}, wanted {}", quantity.dim, wanted.dim))
    }
}

/// Reads a number with a unit, such as `0.225 mm`, `8.7 GPa`, `1/4 turn` is not one.
pub fn parse_quantity(text: &str) -> Result<Quantity, String> {
    let text = text.trim();
    let n = number_length(text);
    let value: f64 =
        text[..n].replace('_', "").parse().map_err(|_| format!("`{text}` does not begin with a number"))?;
    if !value.is_finite() {
        return Err(format!("`{text}` is too large a number"));
    }
    let unit = parse_unit(&text[n..])?;
    let value = value * unit.size;
    if !value.is_finite() {
        return Err(format!("`{text}` is too large a number"));
    }
    Ok(Quantity { value, dim: unit.dim })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities_are_converted_to_si() {
        // The factors are exact powers of ten, so only rounding of the product is allowed.
        for (text, value, dim) in [
            ("0.225 mm", 0.225e-3, Dim::LENGTH),
            ("2 N", 2.0, Dim::FORCE),
            ("8.7 GPa", 8.7e9, Dim::PRESSURE),
            ("20 ms", 0.02, Dim::TIME),
            ("5 cm/s", 0.05, Dim::SPEED),
            ("10 mN m", 0.01, Dim::TORQUE),
            ("10 mN*m", 0.01, Dim::TORQUE),
            ("1.3 g/cc", 1300.0, Dim::DENSITY),
            ("1150 kg/m^3", 1150.0, Dim::DENSITY),
            ("9.81 m/s^2", 9.81, Dim::ACCELERATION),
            ("9.81m/s²", 9.81, Dim::ACCELERATION),
            ("200 1/m", 200.0, Dim::CURVATURE),
            ("3 %", 0.03, Dim::NUMBER),
            ("1e-3", 1e-3, Dim::NUMBER),
            ("-2.5 µN", -2.5e-6, Dim::FORCE),
            ("60 Hz", 60.0, Dim::RATE),
            ("2 min", 120.0, Dim::TIME),
            ("1 N/m", 1.0, Dim::STIFFNESS),
        ] {
            let q = parse_quantity(text).unwrap_or_else(|e| panic!("{text}: {e}"));
            assert!((q.value - value).abs() <= 4e-16 * value.abs(), "{text}: {}", q.value);
            assert_eq!(q.dim, dim, "{text}");
        }
        assert!((parse_quantity("180 deg").unwrap().value - std::f64::consts::PI).abs() < 1e-15);
        assert!((parse_quantity("2 turns").unwrap().value - 2.0 * std::f64::consts::TAU).abs() < 1e-15);
    }

    #[test]
    fn wrong_units_are_named_and_the_nearest_is_offered() {
        for (text, part) in [
            ("3 mmm", "`mm`"),
            ("3 Gpa", "`GPa`"),
            ("3 newton", "not a unit"),
            ("mm", "begin with a number"),
            ("3 m/", "division"),
            ("3 m^x", "power"),
        ] {
            let e = parse_quantity(text).unwrap_err();
            assert!(e.contains(part), "{text}: {e}");
        }
        assert!(parse_quantity("1e999").is_err());
        assert!(parse_quantity("").is_err());
    }

    #[test]
    fn angles_stand_for_numbers_only_where_an_angle_is_wanted() {
        assert!(Dim::ANGLE.accepts(Dim::NUMBER) && Dim::ANGLE.accepts(Dim::ANGLE));
        assert!(!Dim::NUMBER.accepts(Dim::ANGLE));
        assert!(Dim::CURVATURE.accepts(parse_unit("rad/m").unwrap().dim));
        assert!(!Dim::FORCE.accepts(Dim::LENGTH));
    }

    #[test]
    fn si_units_read_back() {
        for unit in ["N", "N m", "m/s", "kg m^2", "1/m", "rad", "N/m", "kg m/s", "m^2"] {
            let u = parse_unit(unit).unwrap();
            assert_eq!(parse_unit(&u.dim.si_unit()).unwrap(), u, "{unit}");
        }
    }
}
