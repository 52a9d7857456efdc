//! Free bodies: put in, taken out, read.

use super::{BODY, World, Wrench};
use crate::error::Error;
use crate::finite::in_proportion;
use crate::handle::Handle;
use crate::math::Pose;
use crate::model::body::{Body, BodyModel, BodyMotion, BodySpec};
use crate::model::shape::{Shape, ShapeMotion};
use crate::model::weld::WeldModel;
use crate::params::Solver;
use crate::state::{BodyState, History, Moved};
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
            motion: Moved::Free,
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

    /// Removes a body and its shapes. What it held is free from then on, threads come off it, and its
    /// joints go with it.
    pub fn remove_body(&mut self, body: Handle<Body>) -> Result<(), Error> {
        let gone = self.model.bodies.remove(body).ok_or(BODY)?;
        self.state.bodies.remove(body);
        let held = |b: &&mut BodyState| matches!(b.motion, Moved::Held { by, .. } if by == body.index);
        self.state.bodies.iter_mut().map(|(_, b)| b).filter(held).for_each(|b| b.motion = Moved::Free);
        let on_it = |w: &WeldModel| w.anchor.is_some_and(|a| a.body == body.index);
        let welds: Vec<u32> = self.model.welds.iter().filter(|(_, w)| on_it(w)).map(|(slot, _)| slot).collect();
        for slot in welds {
            self.remove_weld(self.model.welds.handle(slot))?;
        }
        self.drop_joints_of(body.index);
        for (shape, _) in gone.shapes {
            self.model.shapes.empty(shape);
            let touches = |site: crate::state::Site| site.any_shape() == Some(shape);
            self.state.contacts.retain(|c| !touches(c.a) && !touches(c.b));
        }
        self.state.invalidate(History::Unknown);
        Ok(())
    }

    /// Changes what moves a body, from the next step on. One that is driven stays where it is until it is told where to
    /// go, one that is held stays where it is on the one that holds it, and neither jumps. What holds a body is held by
    /// nothing.
    pub fn set_body_motion(&mut self, body: Handle<Body>, motion: BodyMotion) -> Result<(), Error> {
        let own = self.state.bodies.get(body).ok_or(BODY)?;
        let pose = own.pose();
        let moved = match motion {
            BodyMotion::Free => Moved::Free,
            BodyMotion::Driven => Moved::Driven { target: pose },
            BodyMotion::Held { by } => {
                let holder = self.state.bodies.get(by).ok_or(BODY)?;
                let holds = |b: &BodyState| matches!(b.motion, Moved::Held { by, .. } if by == body.index);
                if by == body || matches!(holder.motion, Moved::Held { .. }) {
                    return Err(Error::invalid("body", "by", by, "another body, which nothing holds"));
                }
                if self.state.bodies.iter().any(|(_, b)| holds(b)) {
                    return Err(Error::invalid("body", "by", by, "nothing, while this body holds another one"));
                }
                Moved::Held { by: by.index, at: holder.pose().inverse().compose(&pose) }
            }
        };
        let body = self.state.bodies.get_mut(body).ok_or(BODY)?;
        body.motion = moved;
        self.state.invalidate(History::Unknown);
        Ok(())
    }

    /// Where the frame of a driven body is wanted at the end of the next step, `world_from_body`. On the way there it
    /// moves and turns evenly.
    pub fn set_body_pose(&mut self, body: Handle<Body>, pose: Pose) -> Result<(), Error> {
        let mass = self.model.bodies.get(body).ok_or(BODY)?.mass;
        let state = self.state.bodies.get_mut(body).ok_or(BODY)?;
        if !pose.is_valid() {
            return Err(Error::invalid("body", "pose", pose, "finite, with a unit quaternion"));
        }
        match &mut state.motion {
            Moved::Driven { target } => *target = pose.compose(&Pose::new(mass.center, mass.axes)),
            _ => return Err(Error::invalid("body", "motion", "not driven", "Driven, for a pose to be set")),
        }
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
