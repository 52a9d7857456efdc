//! The state of a world, taken and restored.

use super::World;
use crate::error::Error;
use crate::math::Pose;
use crate::model::body::BodyModel;
use crate::model::grip::{Hold, LoadKind, Place};
use crate::model::joint::JointModel;
use crate::snapshot::{Build, Snapshot};
use crate::state::{Contact, History, Moved, Site, State, places_of};

impl World {
    /// Everything that the next step depends on beyond the model, as bytes (little endian, versioned).
    pub fn snapshot(&self) -> Vec<u8> {
        crate::snapshot::write(&self.model, &self.state)
    }

    /// Takes the world back to a snapshot of a world with the same threads, shapes and welds. On error nothing is
    /// changed; it says what differs: number and rest lengths of elements, radius, section, rest shape, whether a
    /// thread is closed, the geometry of a shape, the places of a weld. (Of a snapshot of an earlier version lengths
    /// and numbers are compared, since it says no more.)
    ///
    /// Materials, settings and friction are the model's: they stay as they are now. Where threads were of another
    /// material, or stretched otherwise, when the snapshot was taken, its strains, velocities and plastic set are taken
    /// over, tensions follow the strains, and the integrator starts anew, as if [`World::set_material`] came after it.
    /// Else what follows is the same to the bit.
    pub fn restore(&mut self, bytes: &[u8]) -> Result<(), Error> {
        let Snapshot { materials, build, bodies, joints, state } = crate::snapshot::read(bytes)?;
        let refused = |reason: &str| Error::Snapshot { reason: reason.into() };
        if let Some(reason) = build.and_then(|there| Build::of(&self.model, &self.state).unlike(&there)) {
            return Err(Error::Snapshot { reason });
        }
        crate::reel::check(&self.model, &self.state, &state).map_err(refused)?;
        crate::reel::check_lengths(&self.model, &self.state, &state).map_err(|reason| Error::Snapshot { reason })?;
        let before = self.state.clone();
        crate::reel::refit(&mut self.model, &before, &state);
        let other = || "a body in it has another mass, or consists of something else";
        let fits = self.check_fit(&state);
        let fits =
            fits.and_then(|()| (bodies == crate::snapshot::bodies_of(&self.model)).then_some(()).ok_or_else(other));
        let jointed = || "a joint in it joins something else, or otherwise";
        let fits =
            fits.and_then(|()| (joints == crate::snapshot::joints_of(&self.model)).then_some(()).ok_or_else(jointed));
        if fits.is_ok() {
            self.take_up(&state);
            if materials.is_some_and(|m| m != crate::snapshot::made_of(&self.model)) {
                self.state.invalidate(History::Unknown);
                self.follow_strain(0..self.model.mass.len());
            }
        }
        // Finite numbers may be so large that what is worked out from them, with the masses that they attach, is not.
        let sound = fits.and_then(|()| {
            crate::finite::in_proportion(&self.model, &self.state)
                .then_some(())
                .ok_or("a number in it is out of all proportion")
        });
        if let Err(reason) = sound {
            crate::reel::refit(&mut self.model, &state, &before);
            self.take_up(&before);
            return Err(refused(reason));
        }
        Ok(())
    }

    /// Goes on from a state of this model, in the memory that is there, so that the next steps need not grow it again.
    fn take_up(&mut self, state: &State) {
        self.state.copy_from(state);
        self.state.bodies = state.bodies.like(&self.model.bodies);
        self.state.joints = state.joints.like(&self.model.joints);
        self.model.refresh_masses(&self.state.loads);
    }

    /// Whether a state read from outside belongs to this model and is usable.
    fn check_fit(&self, s: &State) -> Result<(), &'static str> {
        let n = self.model.mass.len();
        if !s.has_entries(n) {
            return Err("it is of a world with other threads");
        }
        if s.weld_orientation.len() != self.model.welds.len() {
            return Err("it is of a world with other welds");
        }
        let known = if s.history == History::Valid { n } else { 0 };
        if s.acceleration.len() != known || s.angular_acceleration.len() != known {
            return Err("it has accelerations where there are none, or none where there are");
        }
        if s.shape_pose.len() != self.model.shapes.len() || s.shape_target.len() != s.shape_pose.len() {
            return Err("it is of a world with other shapes");
        }
        let vectors = s
            .position
            .iter()
            .chain(&s.velocity)
            .chain(&s.angular_velocity)
            .chain(&s.acceleration)
            .chain(&s.angular_acceleration)
            .chain(&s.plastic);
        let finite = vectors.into_iter().all(|v| v.is_finite())
            && s.orientation.iter().chain(&s.weld_orientation).all(|q| (q.length() - 1.0).abs() < 1e-6)
            && s.tension.iter().chain(&s.hardened).all(|v| v.is_finite())
            && s.shape_pose.iter().chain(&s.shape_target).all(Pose::is_valid)
            && s.time.is_finite()
            && s.last_h.is_finite();
        if !finite {
            return Err("a number in it is not finite or a quaternion is not of unit length");
        }
        let slots = |bodies: &mut dyn Iterator<Item = u32>| bodies.collect::<Vec<_>>();
        if slots(&mut s.bodies.iter().map(|(k, _)| k)) != slots(&mut self.model.bodies.iter().map(|(k, _)| k)) {
            return Err("it is of a world with other bodies");
        }
        for (_, b) in s.bodies.iter() {
            let vectors = [b.position, b.velocity, b.angular_momentum, b.acceleration, b.torque];
            let with_another = |by: u32, at: &Pose| {
                at.is_valid() && s.bodies.at(by).is_some_and(|b| !matches!(b.motion, Moved::Held { .. }))
            };
            let driven = match &b.motion {
                Moved::Free => true,
                Moved::Driven { target } => target.is_valid(),
                Moved::Held { by, at } => with_another(*by, at),
            };
            if !vectors.iter().all(|v| v.is_finite()) || !b.orientation.is_normalized() || !driven {
                return Err("a body is out of range");
            }
        }
        if s.weld_force.len() != s.weld_orientation.len() || !s.weld_force.iter().all(|f| f.is_finite()) {
            return Err("a force at a weld is out of range");
        }
        if slots(&mut s.joints.iter().map(|(k, _)| k)) != slots(&mut self.model.joints.iter().map(|(k, _)| k)) {
            return Err("it is of a world with other joints");
        }
        for (slot, j) in s.joints.iter() {
            let numbers = [j.coordinate, j.drive[0], j.drive[1], j.stop];
            let finite = j.force.is_finite() && j.torque.is_finite() && numbers.iter().all(|v| v.is_finite());
            let drives = self.model.joints.at(slot).map_or([None; 2], |m| j.drives(m));
            let most = |k: usize| drives[k].map_or(0.0, |d| d.most);
            let bounded = (0..2).all(|k| j.drive[k].abs() <= most(k));
            let has_axis = self.model.joints.at(slot).is_some_and(|m| m.kind.axis().is_some());
            let motor = j.motor.is_none_or(|m| has_axis && m.validate().is_ok());
            if !(finite && bounded && motor) {
                return Err("a joint is out of range");
            }
            let there = |m: &JointModel| m.meeting(places_of(&s.bodies)).coordinate(m.kind, j.coordinate);
            if !self.model.joints.at(slot).is_some_and(|m| there(m) == j.coordinate) {
                return Err("a joint is not where its bodies are");
            }
        }
        let on_its_body = |(slot, model): (u32, &BodyModel)| {
            let pose = s.bodies.at(slot).map(|b| Pose::new(b.position, b.orientation));
            pose.is_none_or(|pose| {
                model.shapes.iter().all(|(k, local)| s.shape_pose[*k as usize] == pose.compose(local))
            })
        };
        if !self.model.bodies.iter().all(on_its_body) {
            return Err("a shape is not where its body is");
        }
        for (_, g) in s.grips.iter() {
            let rod = self.model.rods.at(g.rod).ok_or("a grip holds a thread that is not here")?;
            let last = if g.hold == Hold::Jaw { rod.n_elements - 1 } else { rod.n_elements };
            let poses =
                g.pose.is_valid() && g.target.is_valid() && g.taken_pose.is_valid() && g.rest_half.is_normalized();
            let vectors =
                [g.half_span, g.taken_velocity, g.taken_spin, g.force, g.torque].iter().all(|v| v.is_finite());
            let times = g.ramp.is_finite() && g.ramp >= 0.0 && g.taken_at.is_finite();
            if g.index > last || g.drive.validate().is_err() || !poses || !vectors || !times {
                return Err("a grip is out of range");
            }
        }
        for (_, l) in s.loads.iter() {
            let rod = self.model.rods.at(l.rod).ok_or("a load is on a thread that is not here")?;
            // What is on a reel lies before the start or beyond the end.
            let on_reel = matches!(l.kind, LoadKind::Point { place: Place::Arc(s), .. } | LoadKind::Mass { place: Place::Arc(s), .. } if s.is_finite());
            if l.kind.validate().is_err() || !on_reel && self.validate_load(&l.kind, rod).is_err() {
                return Err("a load is out of range");
            }
        }
        let element = |e: u32| (e as usize) < n && self.model.is_element(e as usize);
        let place = |s: f64| (0.0..=1.0).contains(&s);
        let site = |site: Site| match site {
            Site::Thread { element: e, s } => element(e) && place(s),
            Site::Shape { shape } => self.model.shapes.at(shape).is_some(),
            Site::Surface { shape, at } => self.model.shapes.at(shape).is_some() && at.is_finite(),
        };
        let moves = |shape: u32| self.model.body_of(shape).is_some();
        let pair = |c: &Contact| match (c.a, c.b) {
            (Site::Thread { element: a, .. }, Site::Thread { element: b, .. }) => a < b,
            (Site::Thread { .. }, Site::Shape { .. }) => true,
            (Site::Surface { shape: a, .. }, Site::Surface { shape: b, .. }) => a < b && (moves(a) || moves(b)),
            _ => false,
        };
        let contacts = s.contacts.iter().all(|c| {
            site(c.a)
                && site(c.b)
                && pair(c)
                && (c.normal.length() - 1.0).abs() < 1e-6
                && c.force().is_finite()
                && c.residual_slip.is_finite()
        });
        if !contacts {
            return Err("a contact is out of range");
        }
        Ok(())
    }

    /// 64-bit hash of the state; equal bits, equal hash, on any machine.
    pub fn state_hash(&self) -> u64 {
        crate::snapshot::hash(&self.state)
    }
}
