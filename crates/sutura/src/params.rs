//! Settings of a world and the tolerances that stages of the step share. Lengths that the solver compares with are
//! multiples of the smallest thread radius; nothing here is an absolute length.

use crate::error::{Error, check};
use glam::DVec3;

/// Settings of a world. All have defaults; every one may be changed between steps.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Gravity \[m/s^2\]. Default (0, 0, -9.81).
    pub gravity: DVec3,
    /// Longest substep \[s\], > 0. A step is cut into equal substeps no longer than this. Default 1/240.
    pub substep: f64,
    /// Newton iterations in a substep before it is given up and halved, >= 1. Default 12.
    pub newton_max: u32,
    /// A substep has converged when Newton's next iteration is expected to turn no element by more than this \[rad\],
    /// going by the last two. The error left is of the order of its square. Default 0.003.
    pub tolerance: f64,
    /// Linear damping d_v in [0, 1): velocities lose this fraction in a second, whatever the step. Default 0.
    pub linear_damping: f64,
    /// Angular damping d_a in [0, 1), per second. Default 0.
    pub angular_damping: f64,
    /// Linear drag c_v \[1/s\], >= 0: a force -c_v m v, by which a velocity falls to exp(-c_v t) of itself and what
    /// falls comes to g / c_v, whatever the substep. It adds to the damping, which is a drag of -ln(1 - d_v). Default
    /// 0.
    pub linear_drag: f64,
    /// Angular drag c_a \[1/s\], >= 0, on the spin of cross-sections. Default 0.
    pub angular_drag: f64,
    /// Friction where no pair of surfaces is set. Default 0.3 and 0.3.
    pub friction: Friction,
    /// How many times a substep may be halved, 0..=12. Default 12: what snaps free under load needs microseconds.
    pub halvings: u32,
    /// Default implicit Euler.
    pub integrator: Integrator,
    /// Default [`Solver::Direct`].
    pub solver: Solver,
}

/// Which solver steps the world.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub enum Solver {
    /// Whole threads at once, with physical moduli and forces.
    #[default]
    Direct,
    /// That of the 2018 paper, kept as published for comparison. Of the other settings it uses gravity, substep (one
    /// step a frame is the paper's) and damping; of a thread its geometry, rest shape and mass. It knows no forces.
    /// Welds, reels, plastic set, and grips and shapes driven by force are not in it: then nothing moves and the report
    /// says so; [`World::set_settings`](crate::World::set_settings) does not switch to it where they are.
    Paper(PaperSettings),
}

/// Numbers of the paper's solver, without unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PaperSettings {
    /// Iterations a substep, >= 1. Default 20.
    pub iterations: u32,
    /// Stiffness of shear and stretch in [0, 1]: the part of a correction that is made. Default 1.
    pub stretch_shear: f64,
    /// Stiffness of bending about d1 and d2 in [0, 1]. Default 0.05.
    pub bend: [f64; 2],
    /// Stiffness of twist in [0, 1]. Default 0.25.
    pub twist: f64,
    /// Whether the lengths of a thread are solved for directly in each iteration. Default true.
    pub direct_distance: bool,
    /// Strength of friction k in [0, 1]. Default 1.
    pub friction: f64,
    /// Moment of inertia of an element over its mass and squared length, > 0. The paper does not name its own. Default
    /// 64: masses and inertias of 1, as its equation (15) has them, at the size at which its elongations come out
    /// (elements of 1/8 of a unit). A slender bar is 1/12.
    pub frame_inertia: f64,
    /// Default natural, the paper's.
    pub order: SweepOrder,
}

/// Order in which constraints of one kind are projected. The result of a finite number of iterations depends on it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum SweepOrder {
    /// Along the thread.
    #[default]
    Natural,
    /// Every other one, then those between: none waits for its neighbor.
    TwoColor,
}

impl Default for PaperSettings {
    fn default() -> Self {
        PaperSettings {
            iterations: 20,
            stretch_shear: 1.0,
            bend: [0.05; 2],
            twist: 0.25,
            direct_distance: true,
            friction: 1.0,
            frame_inertia: 64.0,
            order: SweepOrder::Natural,
        }
    }
}

impl PaperSettings {
    fn validate(&self) -> Result<(), Error> {
        let what = "settings";
        let part = |field: &str, v: f64| check(what, field, v, (0.0..=1.0).contains(&v), "a number in [0, 1]");
        check(what, "paper.iterations", f64::from(self.iterations), self.iterations >= 1, "at least 1")?;
        part("paper.stretch_shear", self.stretch_shear)?;
        part("paper.bend", self.bend[0])?;
        part("paper.bend", self.bend[1])?;
        part("paper.twist", self.twist)?;
        part("paper.friction", self.friction)?;
        check(what, "paper.frame_inertia", self.frame_inertia, self.frame_inertia > 0.0, "a finite number > 0")
    }
}

/// How motion is integrated in time. Where things come to rest does not depend on it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Integrator {
    /// First order: a motion of angular frequency w loses about w^2 h / 2 of its amplitude per second. One solve a
    /// substep.
    #[default]
    ImplicitEuler,
    /// Second order (TR-BDF2): it loses about w^4 h^3 / 270 per second, and swings slower by the part w^2 h^2 / 25. Two
    /// solves a substep. A substep in which contacts open, close, begin to slide or to stick goes by implicit Euler,
    /// and so does the next one.
    TrBdf2,
}

/// Coulomb friction between two surfaces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Friction {
    /// Coefficient while the contact sticks, >= 0.
    pub stick: f64,
    /// Coefficient while it slides, 0 <= slide <= stick.
    pub slide: f64,
}

impl Friction {
    /// The same coefficient sticking and sliding.
    pub fn coulomb(mu: f64) -> Self {
        Friction { stick: mu, slide: mu }
    }
    pub(crate) fn validate(&self) -> Result<(), Error> {
        check("friction", "stick", self.stick, self.stick >= 0.0, "a finite number >= 0")?;
        check("friction", "slide", self.slide, self.slide >= 0.0 && self.slide <= self.stick, "a number in [0, stick]")
    }
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            gravity: DVec3::new(0.0, 0.0, -9.81),
            substep: 1.0 / 240.0,
            newton_max: 12,
            tolerance: 3e-3,
            linear_damping: 0.0,
            angular_damping: 0.0,
            linear_drag: 0.0,
            angular_drag: 0.0,
            friction: Friction::coulomb(0.3),
            halvings: 12,
            integrator: Integrator::ImplicitEuler,
            solver: Solver::Direct,
        }
    }
}

/// Depth, in sums of radii, up to which a contact of two threads is a linear spring; beyond, it follows Hertz. Without
/// it a light contact would be the softer the lighter it is, and a sudden load would find it soft.
pub(crate) const LIGHT: f64 = 0.005;

/// Normal force over E r^2 beyond which a contact with a shape that stays as it is goes into the rods' matrix.
pub(crate) const FIRM: f64 = 1e-8;

/// How far beyond the predicted motion candidates are sought, in radii.
pub(crate) const REACH: f64 = 1.5;
/// Overlap, in sums of radii, beyond which a substep that brought two things nearer is rejected. The bar of the sample
/// scenes is 0.05.
pub(crate) const OVERLAP: f64 = 0.04;
/// Overlap that no approach may go beyond.
const DEEPEST: f64 = 0.05;

/// Overlap, force or not, that no approach may go beyond: centerlines stay farther apart than [`PASS`], and out of
/// shapes.
const LIMIT: f64 = 0.35;

/// Whether a motion from one clearance to another, both in sums of radii, is one that overlaps too much, beyond the
/// depth to which the contact's own force presses. What approaches by next to nothing (the contact solve leaves that
/// much) may go on up to [`DEEPEST`]: many short substeps would add up.
pub(crate) fn overlaps(before: f64, now: f64, pressed: f64) -> bool {
    let pressed = pressed.min(LIMIT - DEEPEST);
    let room = ((DEEPEST + pressed + now) / (DEEPEST - OVERLAP)).clamp(0.0, 1.0);
    now < -OVERLAP - pressed && now < before - (1e-6 + 2e-4 * room)
}

/// Overlap, in sums of radii, from which on it is told of what was put there: more than loaded contacts come to, and
/// than the chords of a thread that is led around something cut off.
pub(crate) const PRESSED: f64 = 0.1;

/// Distance of centerlines, in sums of radii, that no motion may go below on its way.
pub(crate) const PASS: f64 = 0.3;

/// The same of a centerline from a shape, in radii. A thread may be pressed to 0.3 (see `LIMIT`).
pub(crate) const PASS_SHAPE: f64 = 0.2;

/// Distance kept between centerlines beyond the sum of radii, in sums of radii; half of the overlap tolerance in
/// reserve.
pub(crate) const KEEP: f64 = 0.02;
/// How much nearer than that Newton's answer may bring two pieces before another contact is added.
pub(crate) const SLACK: f64 = 0.03;
/// Gap beyond the predicted motion within which contacts are set up, in radii.
pub(crate) const MARGIN: f64 = 0.3;
/// Gap after the step without contact forces beyond which a contact without force is left out of the solve, in radii.
pub(crate) const PRUNE: f64 = 0.5;
/// Squared cosine beyond which two elements count as parallel (17 degrees).
pub(crate) const PARALLEL: f64 = 0.914;
/// How much farther apart than their closest places two pieces may be where they are still taken to touch, in radii.
pub(crate) const SAME_PLACE: f64 = 1e-3;
/// Rows that one element may have on one shape between its particles.
pub(crate) const PLACES: usize = 4;
/// How near to each other along the thread two places over edges count as one, in radii.
pub(crate) const SAME_EDGE: f64 = 0.3;
/// How far from a row along the thread another one is set up within a substep, in radii.
pub(crate) const SAME_ROW: f64 = 0.1;
/// Cosine between the normals of two contacts from which on they may be on one patch.
pub(crate) const SAME_PATCH: f64 = 0.9;
/// Part of an old overlap that may remain after a substep.
pub(crate) const RECOVER: f64 = 0.8;
/// Part of the depth to which its force presses a contact that it may lie deeper, to count half as one that overlaps.
pub(crate) const UNEXPLAINED: f64 = 0.2;
/// Residual of the contact solve, in radii. A light contact with a shape lies some 1e-4 radii deep: what leaves more
/// does not find its force.
pub(crate) const CONTACT_TOLERANCE: f64 = 1e-5;
/// What a contact force in a rod's matrix may be off, over the largest of a shape on the same rod.
pub(crate) const OFF_BALANCE: f64 = 2e-3;
/// Newton iterations after which a contact may be off by more, if it moves by less than `SLIP`.
pub(crate) const FRONT: u32 = 3;
/// Slip in a substep beyond which a contact counts as sliding and its kinetic friction holds, in radii. What slips less
/// evens out forces between contacts that together hold.
pub(crate) const SLIP: f64 = 1e-3;
/// Part of the friction limit from which a friction force is taken to be at it.
pub(crate) const AT_LIMIT: f64 = 0.9999;

/// Most slip that the next substep is left to undo, in radii.
pub(crate) const RESIDUAL_SLIP_MOST: f64 = 0.1;

/// Multiplications that a contact solve may spend; large ones get a third of the cube of their unknowns, two
/// factorizations. (One that is cut short has friction that does not hold yet: in a rope of threads that feeds itself
/// from substep to substep.)
pub(crate) const CONTACT_WORK: f64 = 3e6;
/// Multiplications that a contact solve may spend where its matrix is sparse. That is dozens of factorizations: with
/// eight a twist of 200 contacts did not come to its end.
pub(crate) const SPARSE_WORK: f64 = 3e8;
/// Work that a substep with all its halves may take, in rough counts of multiplications, so a minute or so. No sample
/// scene reaches it. What takes more will not come to an end in any time worth waiting for: the world counts as stuck.
pub(crate) const SUBSTEP_WORK: f64 = 5e10;
/// Residual of the contact solve beyond which a Newton iteration does not count as converged, in radii.
pub(crate) const CONTACT_LEFT: f64 = 0.06;

impl Settings {
    pub(crate) fn validate(&self) -> Result<(), Error> {
        let what = "settings";
        if !self.gravity.is_finite() {
            return Err(Error::invalid(what, "gravity", self.gravity, "a finite vector [m/s^2]"));
        }
        check(what, "substep", self.substep, self.substep > 0.0, "a finite time > 0 [s]")?;
        check(what, "newton_max", f64::from(self.newton_max), self.newton_max >= 1, "at least 1")?;
        check(
            what,
            "tolerance",
            self.tolerance,
            self.tolerance > 0.0 && self.tolerance <= 0.1,
            "a number in (0, 0.1]",
        )?;
        check(
            what,
            "linear_damping",
            self.linear_damping,
            (0.0..1.0).contains(&self.linear_damping),
            "a number in [0, 1)",
        )?;
        check(
            what,
            "angular_damping",
            self.angular_damping,
            (0.0..1.0).contains(&self.angular_damping),
            "a number in [0, 1)",
        )?;
        check(what, "linear_drag", self.linear_drag, self.linear_drag >= 0.0, "a finite rate >= 0 [1/s]")?;
        check(what, "angular_drag", self.angular_drag, self.angular_drag >= 0.0, "a finite rate >= 0 [1/s]")?;
        check(what, "halvings", f64::from(self.halvings), self.halvings <= 12, "at most 12")?;
        if let Solver::Paper(p) = &self.solver {
            p.validate()?;
        }
        self.friction.validate()
    }
}
