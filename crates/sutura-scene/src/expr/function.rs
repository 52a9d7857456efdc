//! What an expression may call: functions that read the running world, and functions of numbers.

use super::Ref;
use crate::units::Dim;

/// Functions that read the running world.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Read {
    Time,
    PhaseTime,
    Position,
    Velocity,
    D1,
    D2,
    D3,
    Orientation,
    Tension,
    Shear,
    Moment,
    Bending,
    Torsion,
    Curvature,
    TwistRate,
    Force,
    Torque,
    Wrench,
    Mass,
    Center,
    Tip,
    Pull,
    Distance,
    Gap,
    MinClearance,
    Clearance,
    ThreadClearance,
    ShapeClearance,
    Energy,
    Kinetic,
    Elastic,
    Elongation,
    Length,
    Twist,
    Writhe,
    Speed,
    Spin,
    JointAngle,
    JointWay,
    Momentum,
    Contacts,
    Incidents,
    Done,
    Held,
    Knot,
    Determinant,
    Signature,
    Form,
    TurningShare,
    Entries,
    LoopTension,
    Slip,
    PassesThrough,
}

/// Functions of numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Maths {
    Abs,
    Sqrt,
    Sin,
    Cos,
    Exp,
    Ln,
    Atan2,
    Min,
    Max,
    Norm,
    Dot,
    Angle,
}

/// Kinds of thing that a function's argument may name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Wants {
    /// A place on a thread, a grip, a shape or a body.
    Place,
    /// A place on a thread or a grip.
    OnThread,
    /// The same, or a thread for its greatest value.
    OnThreadOrAll,
    /// A place on a thread, a grip or a body.
    Moving,
    /// The same, or a thread for its greatest value.
    MovingOrAll,
    Thread,
    ThreadOrBody,
    GripOrBody,
    GripOrSolid,
    ThreadOrSolid,
    Body,
    Joint,
    /// A grip, a shape, a body or a joint.
    Acting,
}

impl Wants {
    pub fn takes(self, thing: Ref) -> bool {
        match self {
            Wants::Place => !matches!(thing, Ref::Thread(_) | Ref::Joint(_)),
            Wants::OnThread => matches!(thing, Ref::On(..) | Ref::Grip(_)),
            Wants::OnThreadOrAll => matches!(thing, Ref::On(..) | Ref::Grip(_) | Ref::Thread(_)),
            Wants::Moving => matches!(thing, Ref::On(..) | Ref::Grip(_) | Ref::Body(_)),
            Wants::MovingOrAll => !matches!(thing, Ref::Shape(_) | Ref::Joint(_)),
            Wants::Thread => matches!(thing, Ref::Thread(_)),
            Wants::ThreadOrBody => matches!(thing, Ref::Thread(_) | Ref::Body(_)),
            Wants::GripOrBody => matches!(thing, Ref::Grip(_) | Ref::Body(_)),
            Wants::GripOrSolid => matches!(thing, Ref::Grip(_) | Ref::Shape(_) | Ref::Body(_)),
            Wants::ThreadOrSolid => matches!(thing, Ref::Thread(_) | Ref::Shape(_) | Ref::Body(_)),
            Wants::Body => matches!(thing, Ref::Body(_)),
            Wants::Joint => matches!(thing, Ref::Joint(_)),
            Wants::Acting => matches!(thing, Ref::Grip(_) | Ref::Shape(_) | Ref::Body(_) | Ref::Joint(_)),
        }
    }
    pub fn words(self) -> &'static str {
        match self {
            Wants::Place => "a place such as `silk.end`, a grip, a shape or a body",
            Wants::OnThread => "a place such as `silk.end`, or a grip",
            Wants::OnThreadOrAll => "a thread, a place such as `silk.end`, or a grip",
            Wants::Moving => "a place such as `silk.end`, a grip or a body",
            Wants::MovingOrAll => "a thread, a place such as `silk.end`, a grip or a body",
            Wants::Thread => "a thread",
            Wants::ThreadOrBody => "a thread or a body",
            Wants::GripOrBody => "a grip or a body",
            Wants::GripOrSolid => "a grip, a shape or a body",
            Wants::ThreadOrSolid => "a thread, a shape or a body",
            Wants::Body => "a body",
            Wants::Joint => "a joint",
            Wants::Acting => "a grip, a shape, a body or a joint",
        }
    }
}

const WRENCH: &[(&str, Dim)] = &[
    ("fx", Dim::FORCE),
    ("fy", Dim::FORCE),
    ("fz", Dim::FORCE),
    ("mx", Dim::TORQUE),
    ("my", Dim::TORQUE),
    ("mz", Dim::TORQUE),
];
const QUATERNION: &[(&str, Dim)] =
    &[("qx", Dim::NUMBER), ("qy", Dim::NUMBER), ("qz", Dim::NUMBER), ("qw", Dim::NUMBER)];
const ENTRIES: &[(&str, Dim)] =
    &[("tail_a", Dim::LENGTH), ("loop_a", Dim::LENGTH), ("loop_b", Dim::LENGTH), ("tail_b", Dim::LENGTH)];

pub(super) struct Function {
    pub name: &'static str,
    pub read: Read,
    /// Each argument, and how many of them must be given.
    pub wants: &'static [Wants],
    pub least: usize,
    pub gives: Gives,
}

pub(super) enum Gives {
    Number(Dim),
    Vector(Dim),
    Columns(&'static [(&'static str, Dim)]),
    Truth,
    Text,
}

const fn f(name: &'static str, read: Read, wants: &'static [Wants], least: usize, gives: Gives) -> Function {
    Function { name, read, wants, least, gives }
}

/// Every function that reads the world: the one list from which names, arguments and results are checked.
pub(super) const FUNCTIONS: &[Function] = &[
    f("time", Read::Time, &[], 0, Gives::Number(Dim::TIME)),
    f("phase_time", Read::PhaseTime, &[], 0, Gives::Number(Dim::TIME)),
    f("position", Read::Position, &[Wants::Place], 1, Gives::Vector(Dim::LENGTH)),
    f("velocity", Read::Velocity, &[Wants::Moving], 1, Gives::Vector(Dim::SPEED)),
    f("d1", Read::D1, &[Wants::Place], 1, Gives::Vector(Dim::NUMBER)),
    f("d2", Read::D2, &[Wants::Place], 1, Gives::Vector(Dim::NUMBER)),
    f("d3", Read::D3, &[Wants::Place], 1, Gives::Vector(Dim::NUMBER)),
    f("orientation", Read::Orientation, &[Wants::Place], 1, Gives::Columns(QUATERNION)),
    f("tension", Read::Tension, &[Wants::OnThreadOrAll], 1, Gives::Number(Dim::FORCE)),
    f("shear", Read::Shear, &[Wants::OnThreadOrAll], 1, Gives::Number(Dim::FORCE)),
    f("moment", Read::Moment, &[Wants::OnThread], 1, Gives::Vector(Dim::TORQUE)),
    f("bending", Read::Bending, &[Wants::OnThreadOrAll], 1, Gives::Number(Dim::TORQUE)),
    f("torsion", Read::Torsion, &[Wants::OnThreadOrAll], 1, Gives::Number(Dim::TORQUE)),
    f("curvature", Read::Curvature, &[Wants::OnThreadOrAll], 1, Gives::Number(Dim::CURVATURE)),
    f("twist_rate", Read::TwistRate, &[Wants::OnThread], 1, Gives::Number(Dim::CURVATURE)),
    f("force", Read::Force, &[Wants::Acting], 1, Gives::Vector(Dim::FORCE)),
    f("torque", Read::Torque, &[Wants::Acting], 1, Gives::Vector(Dim::TORQUE)),
    f("wrench", Read::Wrench, &[Wants::Acting], 1, Gives::Columns(WRENCH)),
    f("mass", Read::Mass, &[Wants::Body], 1, Gives::Number(Dim::MASS)),
    f("center", Read::Center, &[Wants::Body], 1, Gives::Vector(Dim::LENGTH)),
    f("tip", Read::Tip, &[Wants::Body], 1, Gives::Vector(Dim::LENGTH)),
    f("pull", Read::Pull, &[Wants::Body], 1, Gives::Vector(Dim::FORCE)),
    f("distance", Read::Distance, &[Wants::Place, Wants::Place], 2, Gives::Number(Dim::LENGTH)),
    f("gap", Read::Gap, &[Wants::Thread, Wants::ThreadOrSolid], 1, Gives::Number(Dim::LENGTH)),
    f("min_clearance", Read::MinClearance, &[], 0, Gives::Number(Dim::NUMBER)),
    f("clearance", Read::Clearance, &[], 0, Gives::Number(Dim::NUMBER)),
    f("thread_clearance", Read::ThreadClearance, &[], 0, Gives::Number(Dim::NUMBER)),
    f("shape_clearance", Read::ShapeClearance, &[], 0, Gives::Number(Dim::NUMBER)),
    f("energy", Read::Energy, &[Wants::ThreadOrBody], 0, Gives::Number(Dim::TORQUE)),
    f("kinetic_energy", Read::Kinetic, &[Wants::ThreadOrBody], 0, Gives::Number(Dim::TORQUE)),
    f("elastic_energy", Read::Elastic, &[Wants::Thread], 0, Gives::Number(Dim::TORQUE)),
    f("elongation", Read::Elongation, &[Wants::Thread], 0, Gives::Number(Dim::NUMBER)),
    f("length", Read::Length, &[Wants::Thread], 1, Gives::Number(Dim::LENGTH)),
    f("twist", Read::Twist, &[Wants::Thread], 1, Gives::Number(Dim::NUMBER)),
    f("writhe", Read::Writhe, &[Wants::Thread], 1, Gives::Number(Dim::NUMBER)),
    f("speed", Read::Speed, &[Wants::MovingOrAll], 0, Gives::Number(Dim::SPEED)),
    f("spin", Read::Spin, &[Wants::Body], 1, Gives::Number(Dim::SPIN)),
    f("joint_angle", Read::JointAngle, &[Wants::Joint], 1, Gives::Number(Dim::ANGLE)),
    f("joint_way", Read::JointWay, &[Wants::Joint], 1, Gives::Number(Dim::LENGTH)),
    f("momentum", Read::Momentum, &[Wants::ThreadOrBody], 0, Gives::Vector(Dim::MOMENTUM)),
    f("contacts", Read::Contacts, &[], 0, Gives::Number(Dim::NUMBER)),
    f("incidents", Read::Incidents, &[], 0, Gives::Number(Dim::NUMBER)),
    f("done", Read::Done, &[Wants::GripOrSolid], 0, Gives::Truth),
    f("held", Read::Held, &[Wants::GripOrBody], 1, Gives::Truth),
    f("knot", Read::Knot, &[Wants::Thread], 1, Gives::Text),
    f("determinant", Read::Determinant, &[Wants::Thread], 1, Gives::Number(Dim::NUMBER)),
    f("signature", Read::Signature, &[Wants::Thread], 1, Gives::Number(Dim::NUMBER)),
    f("form", Read::Form, &[Wants::Thread], 1, Gives::Text),
    f("turning_share", Read::TurningShare, &[Wants::Thread], 1, Gives::Number(Dim::NUMBER)),
    f("entries", Read::Entries, &[Wants::Thread], 1, Gives::Columns(ENTRIES)),
    f("loop_tension", Read::LoopTension, &[Wants::Thread], 1, Gives::Number(Dim::FORCE)),
    f("slip", Read::Slip, &[Wants::Thread], 1, Gives::Number(Dim::LENGTH)),
    f("passes_through", Read::PassesThrough, &[], 0, Gives::Truth),
];

pub(super) const MATHS: &[(&str, Maths, usize)] = &[
    ("abs", Maths::Abs, 1),
    ("sqrt", Maths::Sqrt, 1),
    ("sin", Maths::Sin, 1),
    ("cos", Maths::Cos, 1),
    ("exp", Maths::Exp, 1),
    ("ln", Maths::Ln, 1),
    ("atan2", Maths::Atan2, 2),
    ("min", Maths::Min, 2),
    ("max", Maths::Max, 2),
    ("norm", Maths::Norm, 1),
    ("dot", Maths::Dot, 2),
    ("angle", Maths::Angle, 2),
];

/// Names of all functions, for the documentation test.
#[cfg(test)]
pub fn function_names() -> Vec<&'static str> {
    FUNCTIONS.iter().map(|f| f.name).chain(MATHS.iter().map(|m| m.0)).collect()
}
