//! Joints: what two free bodies, or a body and the world, may not do against each other.

use crate::error::{Error, check};
use crate::handle::Handle;
use crate::math::{Pose, log};
use crate::model::body::Body;
use core::f64::consts::{PI, TAU};
use glam::DVec3;

/// A joint of bodies. Marker of [`Handle`](crate::Handle).
#[derive(Debug)]
pub enum Joint {}

/// A joint to insert. It holds exactly, whatever the masses, but for the compliance that it is given.
#[derive(Debug, Clone, PartialEq)]
pub struct JointSpec {
    /// What it joins; `None` is the world. At least one is a body.
    pub bodies: [Option<Handle<Body>>; 2],
    /// Where the joint is in the frame of each, `body_from_joint`, in the world `world_from_joint`. Where both are put,
    /// they meet but for what the joint leaves free. [`World::joint_frames`](crate::World::joint_frames) gives them for
    /// a place in the world.
    pub frames: [Pose; 2],
    /// What it leaves free. Its axis is the third of the joint's frames.
    pub kind: JointKind,
    /// Compliance of the places that it holds together \[m/N\], >= 0.
    pub compliance: f64,
    /// Compliance of the turning that it prevents \[rad/(N m)\], >= 0.
    pub angular_compliance: f64,
    /// Least and greatest angle of a hinge \[rad\], or way of a slider \[m\].
    pub limits: Option<[f64; 2]>,
    /// What drives a hinge or a slider.
    pub motor: Option<Motor>,
    /// Dry friction of a hinge \[N m\] or a slider \[N\], whatever presses, >= 0.
    pub friction: f64,
    /// Whether the two bodies touch each other as others do.
    pub touch: bool,
}

/// What a joint leaves free of the motion of its second side against its first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum JointKind {
    /// Nothing.
    Fixed,
    /// Turning about a point.
    Ball,
    /// Turning about an axis.
    Hinge,
    /// A way along an axis.
    Slider,
}

/// What drives a joint along its axis: it keeps a speed as far as its force reaches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motor {
    /// Speed of the second side against the first \[rad/s\] or \[m/s\].
    pub speed: f64,
    /// Most torque \[N m\] or force \[N\], > 0.
    pub most: f64,
}

/// A joint in the world.
#[derive(Debug)]
pub(crate) struct JointModel {
    /// Slots of the bodies.
    pub bodies: [Option<u32>; 2],
    /// Frames of the joint, in the bodies' own of center of mass and principal axes.
    pub frames: [Pose; 2],
    pub kind: JointKind,
    /// Of places and of turning.
    pub compliance: [f64; 2],
    pub limits: Option<[f64; 2]>,
    /// What keeps to no speed.
    pub friction: Option<Motor>,
    pub touch: bool,
}

/// A direction of motion against each other: along an axis of the first frame, or about it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Along {
    Way(usize),
    Turn(usize),
}

/// Where the two sides of a joint are.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Meeting {
    pub frames: [Pose; 2],
    /// Centers of mass of what moves them.
    pub centers: [DVec3; 2],
}

/// How far the frames of a joint may be apart where it is put in, over the size of the smaller body, and in radians.
const APART: f64 = 1e-3;

impl JointKind {
    /// The directions in which it holds.
    pub(crate) fn held(self) -> &'static [Along] {
        use Along::{Turn, Way};
        match self {
            JointKind::Fixed => &[Way(0), Way(1), Way(2), Turn(0), Turn(1), Turn(2)],
            JointKind::Ball => &[Way(0), Way(1), Way(2)],
            JointKind::Hinge => &[Way(0), Way(1), Way(2), Turn(0), Turn(1)],
            JointKind::Slider => &[Way(0), Way(1), Turn(0), Turn(1), Turn(2)],
        }
    }

    /// The one direction that it leaves free.
    pub(crate) fn axis(self) -> Option<Along> {
        match self {
            JointKind::Hinge => Some(Along::Turn(2)),
            JointKind::Slider => Some(Along::Way(2)),
            JointKind::Fixed | JointKind::Ball => None,
        }
    }
}

impl JointSpec {
    /// Without limits, motor and friction.
    pub fn new(kind: JointKind, bodies: [Option<Handle<Body>>; 2], frames: [Pose; 2]) -> Self {
        JointSpec {
            bodies,
            frames,
            kind,
            compliance: 0.0,
            angular_compliance: 0.0,
            limits: None,
            motor: None,
            friction: 0.0,
            touch: false,
        }
    }

    pub(crate) fn validate(&self) -> Result<(), Error> {
        let what = "joint";
        if self.bodies[0] == self.bodies[1] {
            return Err(Error::invalid(what, "bodies", self.bodies, "two bodies, or a body and the world"));
        }
        for frame in self.frames {
            if !frame.is_valid() {
                return Err(Error::invalid(what, "frames", frame, "finite, with a unit quaternion"));
            }
        }
        let compliance = [("compliance", self.compliance), ("angular_compliance", self.angular_compliance)];
        for (field, v) in compliance {
            check(what, field, v, v >= 0.0, "a finite number >= 0")?;
        }
        check(what, "friction", self.friction, self.friction >= 0.0, "a finite number >= 0")?;
        let asked =
            [("limits", self.limits.is_some()), ("motor", self.motor.is_some()), ("friction", self.friction > 0.0)];
        if self.kind.axis().is_none()
            && let Some((field, _)) = asked.iter().find(|(_, asked)| *asked)
        {
            return Err(Error::invalid(what, *field, self.kind, "a hinge or a slider, which have an axis"));
        }
        if let Some([least, most]) = self.limits
            && !(least.is_finite() && most.is_finite() && least < most)
        {
            return Err(Error::invalid(what, "limits", [least, most], "two finite numbers, the smaller one first"));
        }
        self.motor.map_or(Ok(()), |motor| motor.validate())
    }
}

impl Motor {
    pub(crate) fn validate(&self) -> Result<(), Error> {
        check("joint", "motor.speed", self.speed, true, "a finite number")?;
        check("joint", "motor.most", self.most, self.most > 0.0, "a finite number > 0")
    }
}

impl JointModel {
    /// Where its sides are, by the poses of bodies and the centers of mass of what moves these.
    pub fn meeting(&self, place_of: impl Fn(u32) -> Option<(Pose, DVec3)>) -> Meeting {
        let places = self.bodies.map(|body| body.and_then(&place_of).unwrap_or((Pose::IDENTITY, DVec3::ZERO)));
        Meeting {
            frames: [0, 1].map(|side| places[side].0.compose(&self.frames[side])),
            centers: places.map(|(_, center)| center),
        }
    }

    /// Moves the second frame to where the joint allows it to be, where that is near. False where it is far; `size` is
    /// that of the smaller body.
    pub fn align(&mut self, place_of: impl Fn(u32) -> Option<(Pose, DVec3)>, size: f64) -> bool {
        let meeting = self.meeting(place_of);
        let off = |held: &Along| match held {
            Along::Way(_) => meeting.off(self.kind, *held).abs() / size,
            Along::Turn(_) => meeting.off(self.kind, *held).abs(),
        };
        if !self.kind.held().iter().all(|held| off(held) <= APART) {
            return false;
        }
        let inward = meeting.frames[1].inverse();
        let wanted = meeting.frames[0].compose(&meeting.left_free(self.kind));
        self.frames[1] = self.frames[1].compose(&inward.compose(&wanted));
        true
    }
}

impl Meeting {
    /// An axis of the first frame.
    pub fn axis(&self, k: usize) -> DVec3 {
        self.frames[0].orientation * DVec3::AXES[k]
    }

    /// What a unit of each side's own motion, of its center and of its turn, changes along a direction.
    pub fn columns(&self, along: Along) -> [[DVec3; 2]; 2] {
        let point = self.frames[1].position;
        [(0, -1.0), (1, 1.0)].map(|(side, sign): (usize, f64)| match along {
            Along::Way(k) => {
                let a = self.axis(k) * sign;
                [a, (point - self.centers[side]).cross(a)]
            }
            Along::Turn(k) => [DVec3::ZERO, self.axis(k) * sign],
        })
    }

    /// How far the second side is off the first along a direction \[m\], \[rad\].
    pub fn off(&self, kind: JointKind, along: Along) -> f64 {
        let [first, second] = &self.frames;
        match along {
            Along::Way(k) => self.axis(k).dot(second.position - first.position),
            Along::Turn(k) if kind == JointKind::Hinge => {
                if k == 2 {
                    return self.twist();
                }
                // The turn from the axis of the first to that of the second.
                let [a, b] = [first, second].map(|f| f.orientation * DVec3::Z);
                let (across, cos) = (a.cross(b), a.dot(b));
                let sin = across.length();
                if sin == 0.0 && cos >= 0.0 {
                    return 0.0;
                }
                let across = if sin > 0.0 { across / sin } else { self.axis(0) };
                self.axis(k).dot(across) * libm::atan2(sin, cos)
            }
            Along::Turn(k) => log(first.orientation.conjugate() * second.orientation)[k],
        }
    }

    /// Turn about the third axis, between -pi and pi.
    fn twist(&self) -> f64 {
        let q = self.frames[0].orientation.conjugate() * self.frames[1].orientation;
        let angle = 2.0 * libm::atan2(q.z, q.w);
        if angle > PI {
            angle - TAU
        } else if angle < -PI {
            angle + TAU
        } else {
            angle
        }
    }

    /// The second frame in the first as a joint without play has it.
    fn left_free(&self, kind: JointKind) -> Pose {
        let [first, second] = &self.frames;
        match kind {
            JointKind::Fixed => Pose::IDENTITY,
            JointKind::Ball => {
                Pose { orientation: first.orientation.conjugate() * second.orientation, ..Pose::IDENTITY }
            }
            JointKind::Hinge => Pose { orientation: crate::math::exp(DVec3::Z * self.twist()), ..Pose::IDENTITY },
            JointKind::Slider => Pose::at(DVec3::Z * self.off(kind, Along::Way(2))),
        }
    }

    /// Angle or way along the axis; an angle is the one nearest to `before`.
    pub fn coordinate(&self, kind: JointKind, before: f64) -> f64 {
        match kind.axis() {
            Some(along @ Along::Way(_)) => self.off(kind, along),
            Some(along @ Along::Turn(_)) => {
                let angle = self.off(kind, along);
                angle + TAU * ((before - angle) / TAU).round()
            }
            None => 0.0,
        }
    }

    /// Rate of change along a direction, from the velocities and angular velocities of the sides.
    pub fn rate(&self, along: Along, rates: [[DVec3; 2]; 2]) -> f64 {
        let columns = self.columns(along);
        (0..2).map(|side| (0..2).map(|k| columns[side][k].dot(rates[side][k])).sum::<f64>()).sum()
    }
}
