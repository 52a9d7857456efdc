//! Work, counted in multiply-adds and not timed, so that what a step does is the same on any machine.

/// What a step has taken so far, and what it may take.
#[derive(Default)]
pub(crate) struct Effort {
    /// Of the present substep, halvings included.
    pub now: f64,
    /// Of the substeps before it in this step, and of the last one that was accepted.
    pub spent: f64,
    pub last: f64,
    /// Most that the step may take.
    pub allowed: f64,
    /// The step ends here, since that is spent.
    pub cut: bool,
}

impl Effort {
    /// Begins a step that may take this much.
    pub fn begin(&mut self, allowed: f64) {
        *self = Effort { allowed, ..Effort::default() };
    }
    /// Begins a substep.
    pub fn next(&mut self) {
        self.spent += core::mem::take(&mut self.now);
    }
    /// Work of the step so far.
    pub fn sum(&self) -> f64 {
        self.spent + self.now
    }
    /// Whether the substep has taken all the work that it may.
    pub fn exhausted(&self) -> bool {
        self.now > crate::params::SUBSTEP_WORK
    }
    /// Whether the step has taken all that it may.
    pub fn late(&self) -> bool {
        self.sum() > self.allowed
    }
}
