//! Instruments: a handle that is led, with a jaw that is part of it, and a second jaw that closes on what is between.

use crate::error::{Error, check};
use crate::handle::Handle;
use crate::math::Pose;
use crate::model::body::{Body, BodySpec, ColliderSpec};
use crate::model::joint::{Joint, JointKind, JointSpec, Motor};
use crate::model::shape::Geometry;
use glam::{DQuat, DVec3};

/// An instrument with two jaws, one of them fixed, as many needle drivers have. Its frame has the hinge as origin, the
/// jaws along z, and y along the hinge; closed, they meet in the plane x = 0, the fixed one on the side of -x.
#[derive(Debug, Clone, PartialEq)]
pub struct InstrumentSpec {
    /// Where it is at first.
    pub pose: Pose,
    /// Length of the jaws from the hinge, their width along the hinge, and their thickness at the hinge \[m\].
    pub jaw: DVec3,
    /// Angle between the jaws when they are open, and at first \[rad\].
    pub opening: f64,
    /// Force at the middle of a jaw with which they close \[N\].
    pub closing_force: f64,
    /// Speed at which the jaw turns where nothing resists \[rad/s\].
    pub speed: f64,
    /// Length and radius of the shaft behind the hinge \[m\].
    pub shaft: [f64; 2],
    /// Density \[kg/m^3\].
    pub density: f64,
    /// Surface for friction, an index of the user's choice.
    pub surface: u32,
}

/// What the angle of a jaw may be off its limits for rounding when it is put in \[rad\].
const ROUNDING: f64 = 1e-6;

/// An instrument in a world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instrument {
    /// Its handle with the fixed jaw, driven: [`World::set_body_pose`](crate::World::set_body_pose) leads it.
    pub handle: Handle<Body>,
    /// The jaw that moves.
    pub jaw: Handle<Body>,
    /// Its hinge, whose angle grows as it opens.
    pub hinge: Handle<Joint>,
}

impl InstrumentSpec {
    /// A needle driver: short, strong jaws, 10 N at their middle.
    pub fn needle_driver(pose: Pose) -> Self {
        InstrumentSpec {
            pose,
            jaw: DVec3::new(10e-3, 2.5e-3, 1.5e-3),
            opening: 0.3,
            closing_force: 10.0,
            speed: 3.0,
            shaft: [40e-3, 2e-3],
            density: 7900.0,
            surface: 0,
        }
    }

    /// Forceps: longer, thinner jaws, 3 N at their middle.
    pub fn forceps(pose: Pose) -> Self {
        let (jaw, closing_force) = (DVec3::new(14e-3, 1.5e-3, 0.8e-3), 3.0);
        InstrumentSpec { jaw, closing_force, shaft: [40e-3, 1.5e-3], ..Self::needle_driver(pose) }
    }

    /// Puts its parts into a world by what inserts a body, drives one and inserts a joint.
    pub(crate) fn insert<W>(
        &self,
        world: &mut W,
        body: impl Fn(&mut W, &BodySpec) -> Result<Handle<Body>, Error>,
        drive: impl Fn(&mut W, Handle<Body>) -> Result<(), Error>,
        joint: impl Fn(&mut W, &JointSpec) -> Result<Handle<Joint>, Error>,
    ) -> Result<Instrument, Error> {
        let [handle, jaw] = self.bodies()?;
        let (handle, jaw) = (body(world, &handle)?, body(world, &jaw)?);
        drive(world, handle)?;
        Ok(Instrument { handle, jaw, hinge: joint(world, &self.hinge(handle, jaw))? })
    }

    /// What the motor of the jaw does while it closes, or opens.
    pub fn motor(&self, close: bool) -> Motor {
        let speed = if close { -self.speed } else { self.speed };
        Motor { speed, most: self.closing_force * 0.5 * self.jaw.x }
    }

    /// Handle and jaw, the latter as open as it is at first.
    fn bodies(&self) -> Result<[BodySpec; 2], Error> {
        let what = "instrument";
        let positive = |field, v: f64| check(what, field, v, v > 0.0, "a finite number > 0");
        self.jaw.to_array().into_iter().try_for_each(|v| positive("jaw", v))?;
        self.shaft.into_iter().try_for_each(|v| positive("shaft", v))?;
        positive("closing_force", self.closing_force)?;
        positive("speed", self.speed)?;
        positive("density", self.density)?;
        check(what, "opening", self.opening, (0.0..1.5).contains(&self.opening), "an angle from 0 to 1.5 [rad]")?;
        if !self.pose.is_valid() {
            return Err(Error::invalid(what, "pose", self.pose, "finite, with a unit quaternion"));
        }
        let solid = |geometry, at: DVec3| ColliderSpec {
            geometry,
            pose: Pose::at(at),
            density: self.density,
            surface: self.surface,
        };
        let body = |pose, colliders| BodySpec { pose, colliders, velocity: DVec3::ZERO, angular_velocity: DVec3::ZERO };
        let [length, radius] = self.shaft;
        let shaft = Geometry::Cylinder { radius, half_length: 0.5 * length };
        let shaft = solid(shaft, DVec3::NEG_Z * (0.5 * length + self.jaw.z));
        let jaw = |side: f64| {
            let half_sides = DVec3::new(self.jaw.z, self.jaw.y, self.jaw.x) * 0.5;
            solid(Geometry::Box { half_sides }, DVec3::new(side * half_sides.x, 0.0, half_sides.z))
        };
        let open = Pose::new(DVec3::ZERO, DQuat::from_rotation_y(self.opening));
        Ok([body(self.pose, vec![shaft, jaw(-1.0)]), body(self.pose.compose(&open), vec![jaw(1.0)])])
    }

    /// The hinge of bodies as [`bodies`](Self::bodies) gives them: zero is closed.
    fn hinge(&self, handle: Handle<Body>, jaw: Handle<Body>) -> JointSpec {
        // The axis of a joint is its z. The jaw is open now, and the frames meet but for its turn.
        let axis = Pose::new(DVec3::ZERO, DQuat::from_rotation_arc(DVec3::Z, DVec3::Y));
        let spec = JointSpec::new(JointKind::Hinge, [Some(handle), Some(jaw)], [axis; 2]);
        JointSpec { limits: Some([-ROUNDING, self.opening + ROUNDING]), motor: Some(self.motor(false)), ..spec }
    }
}
