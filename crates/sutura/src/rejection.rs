//! Why a substep is not acceptable.

/// Why an attempt at a substep is rejected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Rejection {
    /// A number of the solution was not finite.
    NotFinite,
    /// Newton's iteration did not converge.
    NotConverged,
    /// Its solution would take more work than a substep may, or than the step has left.
    TooMuchWork,
    /// An inextensible thread cannot keep its length.
    LengthNotKept,
    /// It would end with more energy than it began with, although nothing drives it.
    EnergyGained,
    /// Two pieces of thread overlap by more than the force between them presses them into each other.
    ThreadOverlap,
    /// Two pieces of thread would pass through each other.
    ThreadPassage,
    /// A thread overlaps a shape by more than the force between them presses it in.
    ShapeOverlap,
    /// A thread would pass through a shape.
    ShapePassage,
}

impl core::fmt::Display for Rejection {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Rejection::NotFinite => "not finite",
            Rejection::NotConverged => "not converged",
            Rejection::TooMuchWork => "more work than a substep may take",
            Rejection::LengthNotKept => "an inextensible thread cannot keep its length",
            Rejection::EnergyGained => "energy out of nothing",
            Rejection::ThreadOverlap => "threads overlap",
            Rejection::ThreadPassage => "threads would pass through each other",
            Rejection::ShapeOverlap => "a thread overlaps a shape",
            Rejection::ShapePassage => "a thread would pass through a shape",
        })
    }
}
