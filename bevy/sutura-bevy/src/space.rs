//! Meters and axes of the engine as Bevy's.

use bevy::prelude::*;
use sutura::Pose;
use sutura::glam::{DQuat, DVec3};

/// How meters and axes of the engine become Bevy's. By default a centimeter becomes a unit, since shadows and depth of
/// a renderer are made for things of about that size, and up is the engine's z (against its default gravity) as well as
/// Bevy's y.
#[derive(Resource, Debug, Clone, Copy, PartialEq)]
pub struct Space {
    /// Units in a meter, > 0.
    pub scale: f32,
    /// Turns axes of the engine to Bevy's.
    pub rotation: Quat,
}

impl Default for Space {
    fn default() -> Self {
        Space { scale: 100.0, rotation: Quat::from_rotation_x(-core::f32::consts::FRAC_PI_2) }
    }
}

impl Space {
    /// A place of the engine \[m\] in Bevy's world.
    pub fn place(&self, p: DVec3) -> Vec3 {
        self.direction(p * f64::from(self.scale))
    }
    /// A direction or size without its unit.
    pub fn direction(&self, d: DVec3) -> Vec3 {
        self.rotation * Vec3::new(d.x as f32, d.y as f32, d.z as f32)
    }
    /// An orientation.
    pub fn turn(&self, q: DQuat) -> Quat {
        self.rotation * Quat::from_xyzw(q.x as f32, q.y as f32, q.z as f32, q.w as f32)
    }
    /// An orientation of Bevy's world in the engine.
    pub fn turn_back(&self, q: Quat) -> DQuat {
        let q = self.rotation.conjugate() * q;
        DQuat::from_xyzw(f64::from(q.x), f64::from(q.y), f64::from(q.z), f64::from(q.w)).normalize()
    }
    /// A pose.
    pub fn transform(&self, pose: Pose) -> Transform {
        Transform { translation: self.place(pose.position), rotation: self.turn(pose.orientation), scale: Vec3::ONE }
    }
    /// A place of Bevy's world in the engine \[m\].
    pub fn place_back(&self, p: Vec3) -> DVec3 {
        self.direction_back(p) / f64::from(self.scale)
    }
    /// A direction of Bevy's world in the engine.
    pub fn direction_back(&self, d: Vec3) -> DVec3 {
        let d = self.rotation.conjugate() * d;
        DVec3::new(f64::from(d.x), f64::from(d.y), f64::from(d.z))
    }
}
