//! What is typed: which cases, and how much each may take.

use anyhow::{Context as _, bail};
use std::fmt;

/// How much a case may take.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Budget {
    /// CPU time \[s\].
    pub cpu_s: f64,
    /// Frames.
    pub frames: u32,
}

impl fmt::Display for Budget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} s of CPU time, {} frames", self.cpu_s, self.frames)
    }
}

/// A time with its unit `s` (also without), `min` or `h` \[s\].
pub fn seconds(text: &str) -> anyhow::Result<f64> {
    let text = text.trim();
    let split = text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len());
    let unit = match text[split..].trim() {
        "" | "s" => 1.0,
        "min" => 60.0,
        "h" => 3600.0,
        other => bail!("`{other}` is no unit of time here: s, min or h"),
    };
    let value: f64 = text[..split].trim().parse().with_context(|| format!("`{text}` is no time, such as 60s"))?;
    if !(value.is_finite() && value > 0.0) {
        bail!("a time must be greater than zero, not {text}");
    }
    Ok(value * unit)
}

/// Values wanted of some factors: `mu=0.1,mu=0.3,e=2`. Of one factor any value will do; of several all must fit.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Filter {
    wanted: Vec<(String, String)>,
}

impl Filter {
    /// Reads a filter for a study with these factors.
    pub fn parse(text: &str, factors: &[&str]) -> anyhow::Result<Filter> {
        let wanted = assignments(text)?;
        for (factor, _) in &wanted {
            if !factors.contains(&factor.as_str()) {
                bail!("there is no factor `{factor}`; there are {}", factors.join(", "));
            }
        }
        Ok(Filter { wanted })
    }

    /// Whether a case with these levels of the factors is wanted.
    pub fn admits(&self, factors: &[&str], levels: &[String]) -> bool {
        factors.iter().zip(levels).all(|(factor, level)| {
            let mut values = self.wanted.iter().filter(|(f, _)| f == factor).map(|(_, v)| v).peekable();
            values.peek().is_none() || values.any(|v| same(v, level))
        })
    }
}

/// `key=value` pairs between commas.
pub fn assignments(text: &str) -> anyhow::Result<Vec<(String, String)>> {
    let pair = |piece: &str| {
        let (k, v) = piece.split_once('=').with_context(|| format!("`{piece}` is not of the form factor=value"))?;
        Ok((k.trim().to_string(), v.trim().to_string()))
    };
    text.split(',').filter(|p| !p.trim().is_empty()).map(pair).collect()
}

/// Whether two texts are the same number or else the same text.
fn same(a: &str, b: &str) -> bool {
    match (a.parse::<f64>(), b.parse::<f64>()) {
        (Ok(x), Ok(y)) => x.to_bits() == y.to_bits(),
        _ => a == b,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_with_their_unit() {
        assert_eq!(seconds("60s").unwrap(), 60.0);
        assert_eq!(seconds("2.5 min").unwrap(), 150.0);
        assert_eq!(seconds("7").unwrap(), 7.0);
        for bad in ["", "s", "-1s", "3 days", "nan"] {
            assert!(seconds(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn a_filter_takes_any_value_of_a_factor_and_all_factors() {
        let factors = ["mu", "knot"];
        let level = |mu: &str, knot: &str| [mu.to_string(), knot.to_string()];
        let f = Filter::parse("mu=0.1, mu=0.30,knot=square", &factors).unwrap();
        assert!(f.admits(&factors, &level("0.1", "square")) && f.admits(&factors, &level("0.3", "square")));
        assert!(!f.admits(&factors, &level("0.2", "square")) && !f.admits(&factors, &level("0.1", "granny")));
        assert!(Filter::default().admits(&factors, &level("9", "x")));
        assert!(Filter::parse("mo=1", &factors).unwrap_err().to_string().contains("mu, knot"));
        assert!(Filter::parse("mu", &factors).is_err());
    }
}
