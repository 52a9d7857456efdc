//! The one error type of the engine: what was wrong, in which field, with which value, and what was wanted.

/// Why a world could not be built, changed, read or restored.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A field of a specification is out of range.
    #[error("{what}: {field} is {value}, wanted {wanted}")]
    Invalid {
        /// The thing that was being built or changed, for instance `rod`.
        what: &'static str,
        /// The field of its specification.
        field: String,
        /// The value found.
        value: String,
        /// The values allowed.
        wanted: &'static str,
    },
    /// A handle names something that was removed, or that belongs to another world.
    #[error("{what}: the handle does not name one in this world (removed, or from another world)")]
    StaleHandle {
        /// Kind of thing that the handle names.
        what: &'static str,
    },
    /// A snapshot does not fit this world or is damaged.
    #[error("snapshot: {reason}")]
    Snapshot {
        /// What does not fit.
        reason: String,
    },
}

impl Error {
    pub(crate) fn invalid(
        what: &'static str,
        field: impl Into<String>,
        value: impl core::fmt::Debug,
        wanted: &'static str,
    ) -> Self {
        Error::Invalid { what, field: field.into(), value: format!("{value:?}"), wanted }
    }
}

/// `Ok` when `value` is finite and `ok`; the error otherwise.
pub(crate) fn check(what: &'static str, field: &str, value: f64, ok: bool, wanted: &'static str) -> Result<(), Error> {
    if value.is_finite() && ok { Ok(()) } else { Err(Error::invalid(what, field, value, wanted)) }
}

/// Coordinates for a message, with six digits.
pub(crate) fn coordinates(p: glam::DVec3) -> String {
    let digits = |v: f64| format!("{v:.5e}").parse().unwrap_or(v) + 0.0;
    let [x, y, z] = p.to_array().map(digits);
    format!("({x}, {y}, {z}) m")
}
