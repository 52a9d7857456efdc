//! Shapes: put in, moved, read.

use super::{SHAPE, World, Wrench};
use crate::error::Error;
use crate::handle::Handle;
use crate::math::Pose;
use crate::model::ShapeModel;
use crate::model::shape::{Checked, Shape, ShapeMotion, ShapeSpec};
use crate::state::{History, Site};
use crate::view::ShapeView;
use glam::DVec3;

impl World {
    /// Adds a shape.
    pub fn insert_shape(&mut self, spec: &ShapeSpec) -> Result<Handle<Shape>, Error> {
        if spec.motion == ShapeMotion::OnBody {
            return Err(on_body(spec.motion));
        }
        let pose = Pose::new(spec.pose.position, spec.pose.orientation.normalize());
        self.place_shape(spec.check()?, spec.surface, spec.motion, None, pose)
    }

    /// Puts a checked shape into the world.
    pub(super) fn place_shape(
        &mut self,
        checked: Checked,
        surface: u32,
        motion: ShapeMotion,
        body: Option<u32>,
        pose: Pose,
    ) -> Result<Handle<Shape>, Error> {
        let Checked { geometry, closed, container, notes } = checked;
        let collider = crate::model::collider::Collider::new(&geometry)?;
        let hash = crate::snapshot::hash_of(&geometry);
        let shape = ShapeModel { geometry, hash, collider, surface, motion, body, closed, container, notes };
        let handle: Handle<Shape> = self.model.shapes.insert(shape);
        self.model.placed.shapes.push(handle.index);
        let n = self.model.shapes.len();
        self.state.shape_pose.resize(n, Pose::IDENTITY);
        self.state.shape_target.resize(n, Pose::IDENTITY);
        self.state.shape_pose[handle.index()] = pose;
        self.state.shape_target[handle.index()] = pose;
        Ok(handle)
    }

    /// Removes a shape.
    pub fn remove_shape(&mut self, shape: Handle<Shape>) -> Result<(), Error> {
        let motion = self.model.shapes.get(shape).ok_or(SHAPE)?.motion;
        if motion == ShapeMotion::OnBody {
            return Err(on_body(motion));
        }
        self.model.shapes.remove(shape);
        self.state.invalidate(History::Unknown);
        let gone = Some(shape.index);
        self.state.contacts.retain(|c| c.a.any_shape() != gone && c.b.any_shape() != gone);
        Ok(())
    }

    /// Pose wanted at the end of the next step for a driven shape. It gets there at constant rate.
    pub fn set_shape_pose(&mut self, shape: Handle<Shape>, pose: Pose) -> Result<(), Error> {
        let s = self.model.shapes.get(shape).ok_or(SHAPE)?;
        if s.motion != ShapeMotion::Driven {
            return Err(Error::invalid("shape", "motion", s.motion, "Driven, for a pose to be set"));
        }
        if !pose.is_valid() {
            return Err(Error::invalid("shape", "pose", pose, "finite, with a unit quaternion"));
        }
        self.state.shape_target[shape.index()] = pose;
        Ok(())
    }

    /// Changes what moves a shape (for instance the force on a pushed one), from the next step on.
    pub fn set_shape_motion(&mut self, shape: Handle<Shape>, motion: ShapeMotion) -> Result<(), Error> {
        motion.validate()?;
        let now = &mut self.model.shapes.get_mut(shape).ok_or(SHAPE)?.motion;
        if *now == ShapeMotion::OnBody || motion == ShapeMotion::OnBody {
            return Err(on_body(motion));
        }
        *now = motion;
        self.state.invalidate(History::Unknown);
        self.state.shape_target[shape.index()] = self.state.shape_pose[shape.index()];
        Ok(())
    }

    /// Force of all contacts on a shape, at the last accepted substep, torque about its origin.
    pub fn shape_wrench(&self, shape: Handle<Shape>) -> Result<Wrench, Error> {
        self.model.shapes.get(shape).ok_or(SHAPE)?;
        let origin = self.state.shape_pose[shape.index()].position;
        Ok(self.contact_wrench(origin, &|slot| slot == shape.index))
    }

    /// Force of contacts on shapes, torque about a point.
    pub(super) fn contact_wrench(&self, about: DVec3, own: &dyn Fn(u32) -> bool) -> Wrench {
        let mut sum = Wrench::default();
        for c in self.state.contacts.iter() {
            for (site, sign) in [(c.a, 1.0), (c.b, -1.0)] {
                let point = match (site, c.a.thread()) {
                    (Site::Surface { shape, at }, _) if own(shape) => {
                        self.state.shape_pose[shape as usize].transform_point(at)
                    }
                    (Site::Shape { shape }, Some((element, s))) if own(shape) => {
                        let e = element as usize;
                        let x = self.state.position[e].lerp(self.state.position[e + 1], s);
                        x - c.normal * self.radius_of(e)
                    }
                    _ => continue,
                };
                let force = c.force() * sign;
                sum.force += force;
                sum.torque += (point - about).cross(force);
            }
        }
        sum
    }

    /// Reads a shape.
    pub fn shape(&self, shape: Handle<Shape>) -> Result<ShapeView<'_>, Error> {
        let s = self.model.shapes.get(shape).ok_or(SHAPE)?;
        Ok(ShapeView {
            geometry: &s.geometry,
            pose: self.state.shape_pose[shape.index()],
            motion: s.motion,
            surface: s.surface,
            body: s.body.map(|b| b as usize),
            slot: shape.index(),
        })
    }

    /// What was mended of a mesh when it was inserted, and what may not have been meant: that it is open and where,
    /// that it is a container. Each is a sentence without its full stop.
    pub fn shape_notes(&self, shape: Handle<Shape>) -> Result<&[String], Error> {
        Ok(&self.model.shapes.get(shape).ok_or(SHAPE)?.notes)
    }

    /// Whether a shape has an inside: all but open meshes.
    pub fn shape_is_closed(&self, shape: Handle<Shape>) -> Result<bool, Error> {
        Ok(self.model.shapes.get(shape).ok_or(SHAPE)?.closed)
    }
}

/// A shape of a body goes and moves with it.
fn on_body(motion: ShapeMotion) -> Error {
    Error::invalid(
        "shape",
        "motion",
        motion,
        "a shape of its own, where that of a body is made and moved with the body",
    )
}
