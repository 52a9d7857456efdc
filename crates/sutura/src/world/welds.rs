//! Welds: threads joined and taken apart.

use super::{BODY, ROD, WELD, World};
use crate::error::Error;
use crate::handle::Handle;
use crate::math::Pose;
use crate::model::grip::{Hold, Place};
use crate::model::rod::Rod;
use crate::model::weld::{Anchor, Member, Side, Weld, WeldModel, WeldRest, WeldSpec};
use crate::report::StepReport;
use crate::row;
use crate::state::History;
use glam::{DQuat, DVec3};

impl World {
    /// Joins places of threads with each other, or with a body. Where they lie apart (by a tenth of a radius at most)
    /// they meet in the middle, at the one that is held, or on the body.
    pub fn insert_weld(&mut self, spec: &WeldSpec) -> Result<Handle<Weld>, Error> {
        spec.validate()?;
        let (model, state) = (&self.model, &self.state);
        let mut places: Vec<(u32, u32, usize)> = Vec::new();
        for (rod, place) in &spec.places {
            let r = model.rods.get(*rod).ok_or(ROD)?;
            place.validate("weld", model, r)?;
            let particle = place.particle(model, r);
            let i = (r.first + particle) as usize;
            if state
                .reels
                .iter()
                .any(|(_, reel)| reel.rod == rod.index && particle == if reel.at_end { r.n_elements } else { 0 })
            {
                return Err(Error::invalid("weld", "places", place, "an end that has no reel"));
            }
            if model.weld_of[i].is_some() || places.iter().any(|p| p.2 == i) {
                return Err(Error::invalid("weld", "places", place, "a place that is not welded yet"));
            }
            places.push((rod.index, particle, i));
        }
        let least = places.iter().map(|p| self.radius_of(p.2)).fold(f64::INFINITY, f64::min);
        let on = match &spec.anchor {
            None => None,
            Some(anchor) => {
                let mass = &model.bodies.get(anchor.body).ok_or(BODY)?.mass;
                let body = state.bodies.get(anchor.body).ok_or(BODY)?;
                let frame = body.pose().compose(&Pose::new(mass.center, mass.axes).inverse());
                Some((anchor, *body, frame.transform_point(anchor.point)))
            }
        };
        let middle = match on {
            Some((.., point)) => point,
            None => places.iter().map(|p| state.position[p.2]).sum::<DVec3>() / places.len() as f64,
        };
        let apart = places.iter().map(|p| (state.position[p.2] - middle).length()).fold(0.0, f64::max);
        if apart > 0.1 * least {
            return Err(Error::invalid("weld", "places", apart, "places within a tenth of a radius of each other [m]"));
        }
        let held: Vec<usize> = places.iter().map(|p| p.2).filter(|i| crate::reel::held(model, state, *i)).collect();
        let (most, wanted) = if on.is_some() {
            (0, "places that no grip holds, on a body")
        } else {
            (1, "at most one that a grip holds")
        };
        if held.len() > most {
            return Err(Error::invalid("weld", "places", format!("{} held", held.len()), wanted));
        }
        let frames = |(slot, particle, i): (u32, u32, usize)| {
            let n = model.rods.at(slot).expect("just read").n_elements;
            ((particle > 0).then(|| state.orientation[i - 1]), (particle < n).then(|| state.orientation[i]))
        };
        // What a clamp holds there it goes on holding. Else a thread that goes on through the weld decides how its
        // cross-section is turned, or the first one that ends there.
        let clamp = state
            .grips
            .iter()
            .map(|(_, g)| g)
            .find(|g| g.hold == Hold::Clamp && places.iter().any(|p| (p.0, p.1) == (g.rod, g.index)));
        if let Some(k) = clamp.and_then(|g| places.iter().position(|p| (p.0, p.1) == (g.rod, g.index))) {
            places.swap(0, k);
        }
        let through = |p: &(u32, u32, usize)| match frames(*p) {
            (Some(a), Some(b)) => Some(row::weld::between(a, b, model.rest_half[p.2])),
            _ => None,
        };
        let (before, after) = frames(places[0]);
        let orientation = clamp
            .map(|g| g.pose.orientation)
            .or_else(|| places.iter().find_map(through))
            .or(before)
            .or(after)
            .expect("a thread has frames");
        let straight = |q: DQuat, outward: DVec3| match spec.rest {
            WeldRest::AsInserted | WeldRest::Loose => q,
            // Turned so that it goes on where the first one leads.
            WeldRest::Straight => {
                let leads = orientation * if before.is_some() { DVec3::Z } else { DVec3::NEG_Z };
                (crate::math::rotation_arc(outward, leads) * q).normalize()
            }
        };
        let mut members = Vec::new();
        for (k, place) in places.iter().enumerate() {
            let (rod, particle, i) = *place;
            let (before, after) = match frames(*place) {
                (Some(_), Some(_)) if spec.rest == WeldRest::Straight => {
                    return Err(Error::invalid(
                        "weld",
                        "places",
                        particle,
                        "ends of threads where they go on straight",
                    ));
                }
                _ if spec.rest == WeldRest::Loose => (None, None),
                (a, b) if k == 0 && clamp.is_some() => {
                    let held = Side::along(clamp.map_or(DQuat::IDENTITY, |g| g.rest_half));
                    (a.map(|_| held), b.map(|_| held))
                }
                (Some(_), Some(_)) => {
                    let own = Side::turned(orientation, through(place).expect("it goes through"));
                    let side = Side { rest_half: crate::math::half(model.rest_half[i]), ..own };
                    (Some(side), Some(side))
                }
                (a, b) if k == 0 => (a.map(|q| Side::turned(orientation, q)), b.map(|q| Side::turned(orientation, q))),
                (a, b) => (
                    a.map(|q| Side::turned(orientation, straight(q, q * DVec3::NEG_Z))),
                    b.map(|q| Side::turned(orientation, straight(q, q * DVec3::Z))),
                ),
            };
            members.push(Member { rod, particle, before, after });
        }
        let mass: f64 = places.iter().map(|p| model.mass[p.2]).sum();
        let velocity = places.iter().map(|p| state.velocity[p.2] * model.mass[p.2]).sum::<DVec3>() / mass;
        if !velocity.is_finite() {
            return Err(Error::invalid("weld", "places", velocity, "places of finite momentum"));
        }
        let at = held.first().map_or(middle, |i| state.position[*i]);
        let velocity = match (&on, &spec.anchor) {
            (Some((_, body, point)), Some(anchor)) => {
                let moments = model.bodies.get(anchor.body).ok_or(BODY)?.mass.moments;
                body.velocity + body.spin(moments).cross(*point - body.position)
            }
            _ => velocity,
        };
        let anchor = on.map(|(anchor, body, point)| Anchor {
            body: anchor.body.index,
            pose: body.pose().inverse().compose(&Pose::new(point, orientation)),
            strength: anchor.strength.unwrap_or(f64::INFINITY),
            filter_distance: 0.0,
        });
        for (_, _, i) in places {
            (self.state.position[i], self.state.velocity[i]) = (at, velocity);
        }
        Ok(self.join(members, orientation, anchor))
    }

    /// Takes a weld apart. A thread that went through it goes on, ends are free. A clamp there goes on holding its own
    /// thread as it is: its pose turns from the cross-section of the weld to that of the thread.
    /// What lay in each other at the weld touches from now on, and is pushed apart.
    pub fn remove_weld(&mut self, weld: Handle<Weld>) -> Result<(), Error> {
        let gone = self.model.welds.remove(weld).ok_or(WELD)?;
        self.state.invalidate(History::Unknown);
        self.model.refresh_welds();
        self.hold_alone(&gone);
        Ok(())
    }

    /// Takes off their bodies the threads that pull at them with more than the welds bear.
    pub(super) fn detach(&mut self, report: &mut StepReport) {
        let force = |slot: u32| self.state.weld_force[slot as usize];
        let torn = |(slot, w): (u32, &WeldModel)| {
            w.anchor.filter(|a| force(slot).length() > a.strength).map(|_| (self.model.welds.handle(slot), force(slot)))
        };
        report.detached.extend(self.model.welds.iter().filter_map(torn));
        for (weld, _) in &report.detached {
            // It was there a moment ago.
            let _ = self.remove_weld(*weld);
        }
    }

    /// Clamps at a weld that is gone hold the cross-section of their own thread from now on, with the moment that it
    /// carries.
    pub(super) fn hold_alone(&mut self, gone: &WeldModel) {
        for g in self.state.grips.iter_mut().map(|(_, g)| g).filter(|g| g.hold == Hold::Clamp) {
            let member = gone.members.iter().find(|m| (m.rod, m.particle) == (g.rod, g.index));
            if let Some(side) = member.and_then(|m| m.before.or(m.after)) {
                for pose in [&mut g.taken_pose, &mut g.pose, &mut g.target] {
                    pose.orientation = (pose.orientation * side.section).normalize();
                }
                g.rest_half = side.rest_half;
            }
        }
    }

    /// The weld at a particle of a thread, such as the seam of a closed one.
    pub fn weld_at(&self, rod: Handle<Rod>, particle: u32) -> Result<Option<Handle<Weld>>, Error> {
        let r = self.model.rods.get(rod).ok_or(ROD)?;
        Place::Particle(particle).validate("weld", &self.model, r)?;
        Ok(self.model.weld_of[(r.first + particle) as usize].map(|slot| self.model.welds.handle(slot)))
    }

    pub(super) fn join(&mut self, members: Vec<Member>, orientation: DQuat, anchor: Option<Anchor>) -> Handle<Weld> {
        self.state.invalidate(History::Unknown);
        let radius = members.iter().map(|m| self.radius_of(m.index(&self.model))).fold(0.0, f64::max);
        let mut weld = WeldModel { members, anchor, filter_distance: core::f64::consts::PI * radius };
        weld.filter_distance = crate::collide::filter_distance(&self.model, &self.state.position, &weld);
        let on_body = crate::collide::filter_distance_on_body(&self.model, &self.state, &weld);
        if let Some(anchor) = &mut weld.anchor {
            anchor.filter_distance = on_body;
        }
        let handle: Handle<Weld> = self.model.welds.insert(weld);
        self.state.weld_orientation.resize(self.model.welds.len(), DQuat::IDENTITY);
        self.state.weld_orientation[handle.index()] = orientation;
        self.state.weld_force.resize(self.model.welds.len(), DVec3::ZERO);
        self.state.weld_force[handle.index()] = DVec3::ZERO;
        self.model.refresh_welds();
        handle
    }
}
