//! Joints of bodies: put in, taken out, read.

use super::{BODY, JOINT, World};
use crate::error::Error;
use crate::handle::Handle;
use crate::math::Pose;
use crate::model::body::{Body, BodyModel};
use crate::model::joint::{Joint, JointModel, JointSpec, Motor};
use crate::state::{History, JointState, places_of};
use crate::view::JointView;

impl World {
    /// Joins two bodies, or a body and the world, where they are now. Where the frames are off by less than a
    /// thousandth of the smaller body's radius of gyration, or of a radian, the second one is moved.
    pub fn insert_joint(&mut self, spec: &JointSpec) -> Result<Handle<Joint>, Error> {
        spec.validate()?;
        let mut sides = [None; 2];
        let mut frames = spec.frames.map(|f| Pose::new(f.position, f.orientation.normalize()));
        let mut size = f64::INFINITY;
        for (k, body) in spec.bodies.iter().enumerate() {
            let Some(body) = body else { continue };
            let model = self.model.bodies.get(*body).ok_or(BODY)?;
            sides[k] = Some(body.index);
            frames[k] = principal_of(model).inverse().compose(&frames[k]);
            size = size.min(model.size());
        }
        let friction = Motor { speed: 0.0, most: spec.friction };
        let mut joint = JointModel {
            bodies: sides,
            frames,
            kind: spec.kind,
            compliance: [spec.compliance, spec.angular_compliance],
            limits: spec.limits,
            friction: Some(friction).filter(|f| f.most > 0.0),
            touch: spec.touch,
        };
        if !joint.align(places_of(&self.state.bodies), size) {
            let [first, second] = joint.meeting(places_of(&self.state.bodies)).frames;
            return Err(Error::invalid("joint", "frames", [first, second], "frames that meet where the bodies are"));
        }
        let coordinate = joint.meeting(places_of(&self.state.bodies)).coordinate(spec.kind, 0.0);
        if let Some([least, most]) = spec.limits
            && !(least..=most).contains(&coordinate)
        {
            return Err(Error::invalid("joint", "limits", [least, most], "limits between which the joint is now"));
        }
        let handle: Handle<Joint> = self.model.joints.insert(joint);
        let same: Handle<Joint> =
            self.state.joints.insert(JointState { coordinate, motor: spec.motor, ..JointState::default() });
        debug_assert_eq!(same, handle);
        self.state.invalidate(History::Unknown);
        Ok(handle)
    }

    /// Takes a joint apart. The bodies go on as they move.
    pub fn remove_joint(&mut self, joint: Handle<Joint>) -> Result<(), Error> {
        self.model.joints.remove(joint).ok_or(JOINT)?;
        self.state.joints.remove(joint);
        self.state.invalidate(History::Unknown);
        Ok(())
    }

    /// Changes the motor of a hinge or a slider, from the next step on.
    pub fn set_joint_motor(&mut self, joint: Handle<Joint>, motor: Option<Motor>) -> Result<(), Error> {
        let kind = self.model.joints.get(joint).ok_or(JOINT)?.kind;
        if let Some(motor) = motor {
            motor.validate()?;
            if kind.axis().is_none() {
                return Err(Error::invalid("joint", "motor", kind, "a hinge or a slider, which have an axis"));
            }
        }
        let state = self.state.joints.get_mut(joint).ok_or(JOINT)?;
        (state.motor, state.drive[0], state.yields[0]) = (motor, 0.0, false);
        self.state.invalidate(History::Unknown);
        Ok(())
    }

    /// Reads a joint.
    pub fn joint(&self, joint: Handle<Joint>) -> Result<JointView<'_>, Error> {
        self.model.joints.get(joint).ok_or(JOINT)?;
        self.view().joints().find(|j| j.slot() == joint.index()).ok_or(JOINT)
    }

    /// The frames for [`JointSpec::frames`] with which bodies are joined at a place in the world.
    pub fn joint_frames(&self, bodies: [Option<Handle<Body>>; 2], at: Pose) -> Result<[Pose; 2], Error> {
        let mut frames = [at; 2];
        for (frame, body) in frames.iter_mut().zip(bodies) {
            if let Some(body) = body {
                *frame = self.body(body)?.pose().inverse().compose(&at);
            }
        }
        Ok(frames)
    }

    pub(super) fn drop_joints_of(&mut self, body: u32) {
        let of_it = |(slot, j): (u32, &JointModel)| j.bodies.contains(&Some(body)).then_some(slot);
        let gone: Vec<u32> = self.model.joints.iter().filter_map(of_it).collect();
        for slot in gone {
            self.model.joints.empty(slot);
            self.state.joints.empty(slot);
        }
    }
}

/// `body_from_principal`.
fn principal_of(model: &BodyModel) -> Pose {
    Pose::new(model.mass.center, model.mass.axes)
}
