//! Free bodies: put in, taken out, read.

use super::{BODY, World, Wrench};
use crate::error::Error;
use crate::finite::in_proportion;
use crate::handle::Handle;
use crate::math::Pose;
use crate::model::body::{Body, BodyModel, BodySpec};
use crate::model::shape::{Shape, ShapeMotion};
use crate::params::Solver;
use crate::state::{BodyState, History};
use crate::view::BodyView;
use glam::DVec3;

impl World {
    /// Adds a free rigid body. Its solids are shapes from then on, moved by it alone.
    pub fn insert_body(&mut self, spec: &BodySpec) -> Result<Handle<Body>, Error> {
        let (mass, checked) = spec.check()?;
        if self.model.settings.solver != Solver::Direct {
            return Err(Error::invalid("body", "solver", "Paper", "the direct solver: the paper's knows no bodies"));
        }
        let body_pose = Pose::new(spec.pose.position, spec.pose.orientation.normalize());
        let principal = Pose::new(mass.center, mass.axes);
        let center = body_pose.compose(&principal);
        let turn = center.orientation;
        let spin = turn.conjugate() * spec.angular_velocity;
        let state = BodyState {
            position: center.position,
            orientation: turn,
            velocity: spec.velocity,
            angular_momentum: turn * (mass.moments * spin),
            acceleration: DVec3::ZERO,
            torque: DVec3::ZERO,
        };
        let handle: Handle<Body> = self.state.bodies.insert(state);
        let inward = principal.inverse();
        let mut shapes = Vec::new();
        for (collider, solid) in spec.colliders.iter().zip(checked) {
            let local = inward.compose(&Pose::new(collider.pose.position, collider.pose.orientation.normalize()));
            let body = Some(handle.index);
            let pose = center.compose(&local);
            let shape = self.place_shape(solid, collider.surface, ShapeMotion::OnBody, body, pose)?;
            shapes.push((shape.index, local));
        }
        let same: Handle<Body> = self.model.bodies.insert(BodyModel { mass, shapes });
        debug_assert_eq!(same, handle);
        if !in_proportion(&self.model, &self.state) {
            self.remove_body(handle)?;
            return Err(Error::invalid(
                "body",
                "velocity",
                "out of all proportion",
                "numbers with which its energy is finite",
            ));
        }
        self.state.invalidate(History::Unknown);
        Ok(handle)
    }

    /// Removes a body, its shapes and its joints.
    pub fn remove_body(&mut self, body: Handle<Body>) -> Result<(), Error> {
        let gone = self.model.bodies.remove(body).ok_or(BODY)?;
        self.state.bodies.remove(body);
        self.drop_joints_of(body.index);
        for (shape, _) in gone.shapes {
            self.model.shapes.empty(shape);
            let touches = |site: crate::state::Site| site.any_shape() == Some(shape);
            self.state.contacts.retain(|c| !touches(c.a) && !touches(c.b));
        }
        self.state.invalidate(History::Unknown);
        Ok(())
    }

    /// Reads a body.
    pub fn body(&self, body: Handle<Body>) -> Result<BodyView<'_>, Error> {
        self.model.bodies.get(body).ok_or(BODY)?;
        self.view().bodies().find(|b| b.slot() == body.index()).ok_or(BODY)
    }

    /// The shapes of a body, in the order of its solids.
    pub fn body_shapes(&self, body: Handle<Body>) -> Result<Vec<Handle<Shape>>, Error> {
        let model = self.model.bodies.get(body).ok_or(BODY)?;
        Ok(model.shapes.iter().map(|(slot, _)| self.model.shapes.handle(*slot)).collect())
    }

    /// Force of all contacts on a body at the last accepted substep, torque about its center of mass.
    pub fn body_wrench(&self, body: Handle<Body>) -> Result<Wrench, Error> {
        let model = self.model.bodies.get(body).ok_or(BODY)?;
        let center = self.state.bodies.get(body).ok_or(BODY)?.position;
        Ok(self.contact_wrench(center, &|slot| model.shapes.iter().any(|(s, _)| *s == slot)))
    }
}
