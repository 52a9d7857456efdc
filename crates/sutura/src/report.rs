//! What a step says of itself.

use crate::collide::overlap::{Overlap, OverlapWith};
use crate::error::coordinates;
use crate::handle::Handle;
use crate::model::rod::Rod;
use crate::model::weld::Weld;
use crate::rejection::Rejection;
use glam::DVec3;

/// What one call of [`World::step`](crate::World::step) did, and what it reached.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct StepReport {
    /// Simulated time at the end \[s\].
    pub time: f64,
    /// Time that was simulated, of the time wanted \[s\]. The rest passed with everything at rest, as where no
    /// acceptable substep was found; where the step was `cut` it did not pass.
    pub simulated: f64,
    /// True where the step ended early, since it had spent its work
    /// ([`World::set_step_work`](crate::World::set_step_work)).
    pub cut: bool,
    /// Work that it took, in rough counts of multiply-adds.
    pub work: f64,
    /// Substeps accepted.
    pub substeps: u32,
    /// Substeps thrown away and done again: as two halves, or with a thread that stretches where it cannot keep its
    /// length.
    pub rejected: u32,
    /// Newton iterations, those of rejected substeps among them.
    pub newton_iterations: u32,
    /// Whether every accepted substep converged to the tolerance within the budget.
    pub converged: bool,
    /// Largest move of a particle in the last Newton iteration of an accepted substep, over the thread's radius.
    pub residual: f64,
    /// Largest |elongation| of an element of an inextensible rod, over its rest length; for an elastic rod |strain -
    /// T/EA|.
    pub length_error: f64,
    /// Least clearance between two pieces of thread over the accepted substeps, in thread diameters: (distance - radii)
    /// / diameter. `None` when nothing was near, and with the paper's solver: the audit measures it with any.
    pub thread_clearance: Option<f64>,
    /// Least clearance between thread and shape, in thread diameters.
    pub shape_clearance: Option<f64>,
    /// Contacts that carried force at the end; with the paper's solver, which has no forces, those that pushed in the
    /// last substep.
    pub contacts: u32,
    /// Welds whose threads came off their bodies at the end of it, with the force that they pulled with \[N\]
    /// ([`WeldAnchor::strength`](crate::WeldAnchor::strength)).
    pub detached: Vec<(Handle<Weld>, DVec3)>,
    /// What went wrong.
    pub incidents: Vec<Incident>,
}

/// Something that went wrong in a step and what was done about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Incident {
    /// Simulated time at which it happened \[s\].
    pub time: f64,
    /// What happened.
    pub kind: IncidentKind,
}

/// Kinds of incident.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum IncidentKind {
    /// A number of the solution was not finite. The substep was rolled back.
    NotFinite,
    /// After all halvings no acceptable substep was found: the world stays at the last good state and the rest of the
    /// step was not simulated. What it would have crossed or failed to converge on is said.
    Stuck {
        /// Why the last attempt was rejected.
        reason: Rejection,
    },
    /// After all halvings no acceptable substep was found for these threads: they stay where they were for the rest of
    /// the step, everything else goes on.
    Held {
        /// Why the last attempt was rejected.
        reason: Rejection,
        /// The threads (twice the same one, where it was alone).
        rods: [Handle<Rod>; 2],
    },
    /// A substep was accepted without convergence to the tolerance.
    NotConverged {
        /// Largest move in the last iteration over the thread's radius.
        residual: f64,
    },
    /// To keep an inextensible thread at its length would take more force than any thread bears, as where its ends are
    /// driven apart, or no way was found: for the rest of the step it stretched as its material does.
    LengthNotKept {
        /// The thread.
        rod: Handle<Rod>,
        /// Elongation over its rest length of the element that is off most, in the end.
        elongation: f64,
    },
    /// A driven grip or shape jumped farther in one step than a motion can: it was moved over the step at the speed
    /// that this implies.
    Teleport {
        /// Distance \[m\].
        distance: f64,
    },
    /// What was inserted since the last step, or jumped in this one, lies in something. What is only pressed into each
    /// other is pushed apart; where a centerline passes through, the world goes on as it is, and what contact makes of
    /// it is left to chance.
    Overlap(Overlap),
    /// A time step that is not a finite number > 0, or an input that is not finite: nothing was done.
    BadInput {
        /// Which input.
        what: &'static str,
    },
    /// The paper's solver ([`Solver::Paper`](crate::Solver::Paper)) steps a world that has something which the paper
    /// has not: nothing moved.
    NotInPaper {
        /// What that is.
        what: &'static str,
    },
    /// Thread passed through thread or shape between accepted states (also found by the independent audit).
    PassedThrough {
        /// The thread, when it was one thread through itself.
        rod: Option<Handle<Rod>>,
    },
}

impl core::fmt::Display for IncidentKind {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            IncidentKind::NotFinite => write!(f, "a number was not finite; the substep was rolled back"),
            IncidentKind::Stuck { reason } => {
                write!(f, "no acceptable substep was found ({reason}); stayed at the last good state")
            }
            IncidentKind::Held { reason, .. } => write!(
                f,
                "no acceptable motion of a thread was found ({reason}); it stayed where it was, the rest went on"
            ),
            IncidentKind::NotConverged { residual } => {
                write!(f, "accepted without convergence: last move {residual:.2e} radii")
            }
            IncidentKind::LengthNotKept { elongation, .. } => {
                write!(
                    f,
                    "an inextensible thread did not keep its length (off by {:.3} %): it stretched as its material does",
                    100.0 * elongation
                )
            }
            IncidentKind::Teleport { distance } => write!(f, "a driven thing jumped {distance:.3e} m in one step"),
            IncidentKind::Overlap(o) => {
                write!(f, "thread {:?} at {:.4e} m {} ", o.rod, o.arc, o.verb())?;
                match o.with {
                    OverlapWith::Rod { rod, arc } => write!(f, "thread {rod:?} at {arc:.4e} m")?,
                    OverlapWith::Shape(shape) => write!(f, "shape {shape:?}")?,
                }
                write!(f, ", {:.3e} m ({:.2} diameters) deep, at {}", o.depth, o.diameters, coordinates(o.point))
            }
            IncidentKind::BadInput { what } => write!(f, "bad input: {what}; nothing was done"),
            IncidentKind::NotInPaper { what } => write!(f, "the paper's solver does not know {what}; nothing moved"),
            IncidentKind::PassedThrough { .. } => write!(f, "thread passed through"),
        }
    }
}
