//! Length that is fed in or drawn back at an end of a thread.

use crate::error::{Error, check};
use crate::handle::Handle;
use crate::model::rod::Rod;

/// A reel. Marker of [`Handle`].
#[derive(Debug)]
pub enum Reel {}

/// A reel at an end of a thread, which a pin or clamp holds there. The last element grows and shrinks; beyond 1.6 times
/// its own length it is cut in two, below 0.4 times it is joined with the next. Removed only with its thread; to stop
/// it, set its rate to zero.
#[derive(Debug, Clone, PartialEq)]
pub struct ReelSpec {
    /// The thread, not closed.
    pub rod: Handle<Rod>,
    /// At its end, not at its start.
    pub at_end: bool,
    /// What it does.
    pub law: ReelLaw,
    /// Length that is on it \[m\], >= 0; without end if `None`.
    pub supply: Option<f64>,
}

/// What a reel does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ReelLaw {
    /// Feeds length in at this rate \[m/s\], in a substep no more than a thousand elements; draws it back where the
    /// rate is negative, down to two elements.
    Rate(f64),
    /// Gives off length where the tension at the end would be higher than this \[N\], > 0, as a spool with a brake. Not
    /// for inextensible threads.
    Brake(f64),
}

impl ReelLaw {
    pub(crate) fn validate(&self) -> Result<(), Error> {
        match *self {
            ReelLaw::Rate(v) => check("reel", "rate", v, v.abs() <= 100.0, "a finite speed of at most 100 m/s [m/s]"),
            ReelLaw::Brake(t) => check("reel", "brake", t, t > 0.0, "a finite force > 0 [N]"),
        }
    }
}

impl ReelSpec {
    pub(crate) fn validate(&self) -> Result<(), Error> {
        self.law.validate()?;
        self.supply.map_or(Ok(()), |s| check("reel", "supply", s, s >= 0.0, "a finite length >= 0 [m]"))
    }
}
