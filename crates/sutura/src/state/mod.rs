//! What a snapshot must hold: everything that the next step depends on and the user did not give as `Model`.

mod contact;

use crate::arrays::element_arrays;
use crate::handle::Slots;
use crate::math::Pose;
pub(crate) use crate::model::grip::LoadState;
use crate::model::grip::{Drive, Hold};
use crate::model::joint::{JointModel, Motor};
use crate::model::reel::ReelLaw;
pub(crate) use contact::{Contact, Contacts, Site};
use glam::{DQuat, DVec3};

/// What the next substep can count on.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) enum History {
    /// Nothing but positions and velocities: something was edited, or nothing was stepped yet.
    #[default]
    Unknown,
    /// Contacts have just changed: accelerations are about to jump.
    Discontinuous,
    /// The accelerations in the state are those of its forces.
    Valid,
}

/// One vector a quantity.
#[derive(Clone, Default)]
pub struct State {
    /// Simulated time \[s\].
    pub(crate) time: f64,
    /// Length of the last substep that was accepted as a part of a halved one \[s\]; 0 after a whole one.
    pub(crate) last_h: f64,
    /// Accepted substeps since their length last changed.
    pub(crate) accepted_in_row: u32,

    /// Rest length of each element \[m\]; the model has the same.
    pub(crate) rest_length: Vec<f64>,
    pub(crate) position: Vec<DVec3>,
    pub(crate) velocity: Vec<DVec3>,
    pub(crate) orientation: Vec<DQuat>,
    pub(crate) angular_velocity: Vec<DVec3>,
    /// Rates of the two, without damping, where the integrator needs them and `history` says that they are known; else
    /// empty.
    pub(crate) acceleration: Vec<DVec3>,
    pub(crate) angular_acceleration: Vec<DVec3>,
    pub(crate) history: History,
    /// Tension of each element at the last accepted state \[N\]: geometric stiffness, and the first guess of
    /// inextensible elements.
    pub(crate) tension: Vec<f64>,
    /// Plastic bend and twist of the joint before each element \[rad\], part of the rest strain.
    pub(crate) plastic: Vec<DVec3>,
    /// Plastic arc already travelled by each joint, for hardening, over its angle at yield.
    pub(crate) hardened: Vec<f64>,

    /// Cross-section of each weld, `world_from_weld`.
    pub(crate) weld_orientation: Vec<DQuat>,
    pub(crate) shape_pose: Vec<Pose>,
    /// Where the user wants each driven shape at the end of the next step.
    pub(crate) shape_target: Vec<Pose>,

    pub(crate) bodies: Slots<BodyState>,
    /// By slot, force of the threads of each weld on the body that it is on \[N\].
    pub(crate) weld_force: Vec<DVec3>,
    pub(crate) joints: Slots<JointState>,
    pub(crate) grips: Slots<GripState>,
    pub(crate) loads: Slots<LoadState>,
    pub(crate) reels: Slots<ReelState>,

    /// Contacts of the last accepted substep.
    pub(crate) contacts: Contacts,
}

// Accelerations have as many entries, or none where they are not known.
element_arrays!(State { rest_length, position, velocity, orientation, angular_velocity, tension, plastic, hardened });

/// States to go back to, one per halving depth.
#[derive(Default)]
pub(crate) struct Saved(Vec<State>);

impl Saved {
    pub fn save(&mut self, depth: u32, state: &State) {
        let depth = depth as usize;
        if self.0.len() <= depth {
            self.0.resize_with(depth + 1, State::default);
        }
        self.0[depth].copy_from(state);
    }
    pub fn at(&self, depth: u32) -> &State {
        &self.0[depth as usize]
    }
    pub fn restore(&self, depth: u32, state: &mut State) {
        state.copy_from(self.at(depth));
    }
}

/// A rigid body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct BodyState {
    pub motion: Moved,
    /// Center of mass \[m\], and `world_from_principal`.
    pub position: DVec3,
    pub orientation: DQuat,
    /// Velocity of the center of mass \[m/s\], and angular momentum about it in world axes \[N m s\].
    pub velocity: DVec3,
    pub angular_momentum: DVec3,
    /// Rates of the two, where the integrator needs them and `history` says that they are known; else zero.
    pub acceleration: DVec3,
    pub torque: DVec3,
}

/// What moves a body. Poses are `world_from_principal`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Moved {
    Free,
    /// To where the user wants it at the end of the next step.
    Driven {
        target: Pose,
    },
    /// With another body, which nothing holds: where it is in that one's principal frame.
    Held {
        by: u32,
        at: Pose,
    },
}

impl BodyState {
    pub fn pose(&self) -> Pose {
        Pose::new(self.position, self.orientation)
    }
    /// Angular velocity in world axes, of these principal moments \[rad/s\].
    pub fn spin(&self, moments: DVec3) -> DVec3 {
        self.orientation * ((self.orientation.conjugate() * self.angular_momentum) / moments)
    }
    pub fn place(&mut self, pose: &Pose) {
        (self.position, self.orientation) = (pose.position, pose.orientation);
    }
}

/// Pose of the center of mass and principal axes of each body, by its slot, and the center of mass of what moves it.
pub(crate) fn places_of(bodies: &Slots<BodyState>) -> impl Fn(u32) -> Option<(Pose, DVec3)> + '_ {
    |slot| Some((bodies.at(slot)?.pose(), bodies.at(root_of(bodies, slot))?.position))
}

/// A joint. Forces are those of the last solve on its second side, along the axes of its first frame.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct JointState {
    /// Angle \[rad\] or way \[m\] along its axis.
    pub coordinate: f64,
    /// What holds it \[N\], \[N m\], about the origin of its second frame.
    pub force: DVec3,
    pub torque: DVec3,
    pub motor: Option<Motor>,
    /// Along its axis: of the motor, of friction, and of a limit.
    pub drive: [f64; 2],
    pub stop: f64,
    /// Whether motor and friction are at their bounds.
    pub yields: [bool; 2],
}

impl JointState {
    /// What keeps a speed: the motor, and friction.
    pub fn drives(&self, joint: &JointModel) -> [Option<Motor>; 2] {
        [self.motor, joint.friction]
    }
    /// What goes on as it is while this is the same: at which limit it is, which drives are at which bound.
    pub fn phase(&self) -> (f64, [f64; 2]) {
        let sign = |v: f64| if v == 0.0 { 0.0 } else { v.signum() };
        (sign(self.stop), [0, 1].map(|k| if self.yields[k] { sign(self.drive[k]) } else { 0.0 }))
    }
}

/// A grip in action.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct GripState {
    pub rod: u32,
    /// Particle (pin, clamp) or element (jaw), counted from the rod's start.
    pub index: u32,
    pub hold: Hold,
    pub drive: Drive,
    pub ramp: f64,
    /// Simulated time at which it was taken \[s\].
    pub taken_at: f64,
    /// Pose and velocity of the held piece when it was taken.
    pub taken_pose: Pose,
    pub taken_velocity: DVec3,
    pub taken_spin: DVec3,
    /// Pose commanded for the end of the last step and of the next one.
    pub pose: Pose,
    pub target: Pose,
    /// For a clamp: square root of the rest rotation over half an element, between the clamp and the frames beside it.
    pub rest_half: DQuat,
    /// For a jaw: from the middle of the element to its second particle, in the frame of the grip \[m\].
    pub half_span: DVec3,
    /// Force and torque on the thread at the last accepted substep \[N\], \[N m\].
    pub force: DVec3,
    pub torque: DVec3,
}

/// A reel in action.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ReelState {
    pub rod: u32,
    pub at_end: bool,
    pub law: ReelLaw,
    /// Length that is left on it \[m\].
    pub supply: Option<f64>,
    /// Length of the element there when the reel was set up \[m\].
    pub nominal: f64,
    /// Length fed in less length drawn back since then \[m\], and elements added less those taken away.
    pub fed: f64,
    pub added: i32,
}

/// The body that a body moves with: the one that holds it, or itself.
pub(crate) fn root_of(bodies: &Slots<BodyState>, body: u32) -> u32 {
    match bodies.at(body).map(|b| b.motion) {
        Some(Moved::Held { by, .. }) => by,
        _ => body,
    }
}

impl State {
    /// The body that a body moves with: the one that holds it, or itself.
    pub(crate) fn root_of(&self, body: u32) -> u32 {
        root_of(&self.bodies, body)
    }
    /// Whether contact can move a body.
    pub(crate) fn gives_way(&self, body: u32) -> bool {
        self.bodies.at(self.root_of(body)).is_some_and(|b| b.motion == Moved::Free)
    }
    /// Forgets the accelerations, for `why`.
    pub(crate) fn invalidate(&mut self, why: History) {
        self.history = why;
        self.acceleration.clear();
        self.angular_acceleration.clear();
        for (_, body) in self.bodies.iter_mut() {
            (body.acceleration, body.torque) = (DVec3::ZERO, DVec3::ZERO);
        }
    }
    /// A copy into memory that is already there.
    pub(crate) fn copy_from(&mut self, from: &State) {
        let State {
            time,
            last_h,
            accepted_in_row,
            rest_length,
            position,
            velocity,
            orientation,
            angular_velocity,
            acceleration,
            angular_acceleration,
            history,
            tension,
            plastic,
            hardened,
            weld_orientation,
            shape_pose,
            shape_target,
            bodies,
            weld_force,
            joints,
            grips,
            loads,
            reels,
            contacts,
        } = from;
        self.time = *time;
        self.last_h = *last_h;
        self.accepted_in_row = *accepted_in_row;
        self.rest_length.clone_from(rest_length);
        self.position.clone_from(position);
        self.velocity.clone_from(velocity);
        self.orientation.clone_from(orientation);
        self.angular_velocity.clone_from(angular_velocity);
        self.acceleration.clone_from(acceleration);
        self.angular_acceleration.clone_from(angular_acceleration);
        self.history = *history;
        self.tension.clone_from(tension);
        self.plastic.clone_from(plastic);
        self.hardened.clone_from(hardened);
        self.weld_orientation.clone_from(weld_orientation);
        self.shape_pose.clone_from(shape_pose);
        self.shape_target.clone_from(shape_target);
        self.bodies.copy_from(bodies);
        self.weld_force.clone_from(weld_force);
        self.joints.copy_from(joints);
        self.grips.copy_from(grips);
        self.loads.copy_from(loads);
        self.reels.copy_from(reels);
        self.contacts.copy_from(contacts);
    }
}
