//! Threads cut in two.

use super::{ROD, World};
use crate::error::Error;
use crate::handle::Handle;
use crate::model::Model;
use crate::model::cut::{Cut, End, Faces};
use crate::model::grip::{Load, LoadKind, LoadState, Place};
use crate::model::rod::{Rod, is_flat};
use crate::model::weld::{Member, Weld, rest_across};
use crate::params::Solver;
use crate::state::{History, Site, State};
use glam::{DQuat, DVec3};

/// Where a thread is to be cut.
#[derive(Clone, Copy)]
struct At {
    /// Slot of the thread, its first entry in the world's arrays, and the number of its elements.
    slot: u32,
    first: usize,
    n: usize,
    /// The particle, counted from the start of the thread.
    particle: usize,
    /// Rest arc from the start to there \[m\].
    arc: f64,
}

impl World {
    /// Cuts a thread at the particle nearest to a place (of the middle of an element at the one before it).
    ///
    /// The part from the start to the cut keeps the handle. The rest is a thread of its own, of the same material,
    /// section, surface and shape at rest. A closed thread is open then: it keeps its handle, and starts and ends at
    /// the cut; its seam is a joint as any other, without plastic set.
    ///
    /// Everything goes on as it was, but for the bend and twist of the joint that was cut: positions, velocities,
    /// tensions, plastic set, and contacts with their forces. Each new end has half of the mass of the particle. Grips,
    /// welds, reels and loads go with the element or particle at which they are; a load at the very particle goes with
    /// its element, a uniform one acts on both parts. Handles stay as they are, but for the new thread and for the
    /// uniform loads on it ([`Cut`]). The integrator starts anew, as after any other edit.
    ///
    /// The faces of a cut are flat, while contact takes the ends of a thread as round: what lies within half a turn of
    /// the thread's radius (pi r) by way of the cut does not touch, as it did not before.
    ///
    /// Refused are: the first and the last particle of an open thread; a particle that a grip holds, or that a weld
    /// joins (but for the seam of a closed thread, if nothing else is welded to it); a place that would leave less than
    /// two elements beside a reel; and any place while the paper's solver steps the world.
    pub fn cut(&mut self, rod: Handle<Rod>, place: Place) -> Result<Cut, Error> {
        let (model, state) = (&self.model, &self.state);
        let r = model.rods.get(rod).ok_or(ROD)?;
        let refused = |wanted: &'static str| Err(Error::invalid("cut", "place", place, wanted));
        if model.settings.solver != Solver::Direct {
            return Err(Error::invalid("cut", "solver", model.settings.solver, "the direct solver"));
        }
        place.validate("cut", model, r)?;
        let (first, n) = (r.first as usize, r.n_elements as usize);
        let seam = model.weld_of[first].filter(|weld| model.weld_of[first + n] == Some(*weld));
        let particle = match place.particle(model, r) as usize {
            k if k == n && seam.is_some() => 0,
            k => k,
        };
        if seam.is_none() && (particle == 0 || particle == n) {
            return refused("a place with an element of the thread on either side");
        }
        let both = [first + particle, if particle == 0 { first + n } else { first + particle }];
        if both.into_iter().any(|i| crate::reel::held(model, state, i)) {
            return refused("a place that no grip holds");
        }
        let alone = |weld: u32| particle == 0 && model.welds.at(weld).is_some_and(|w| w.members.len() == 2);
        if model.weld_of[first + particle].is_some_and(|weld| !alone(weld)) {
            return refused("a place that is not welded");
        }
        let left = |at_end: bool| if at_end { n - particle } else { particle };
        if state.reels.iter().any(|(_, reel)| reel.rod == rod.index && left(reel.at_end) < 2) {
            return refused("a place two elements or more from a reel");
        }
        let arc = model.rest_length[first..first + particle].iter().sum();
        let radius = r.radius;
        let at = At { slot: rod.index, first, n, particle, arc };
        self.state.invalidate(History::Unknown);
        let cut = match seam {
            Some(weld) => self.open(at, weld),
            None => self.part(at),
        };
        let end = |rod: u32, at_end: bool| End { rod, at_end };
        let ends = [end(rod.index, true), end(cut.rest.map_or(rod.index, |rest| rest.index), false)];
        self.model.faces.push(Faces { ends, filter_distance: core::f64::consts::PI * radius });
        self.model.refresh_rod(first..first + n + 1 + usize::from(cut.rest.is_some()));
        self.model.refresh_masses(&self.state.loads);
        self.model.refresh_welds();
        Ok(cut)
    }

    /// Makes two of an open thread.
    fn part(&mut self, at: At) -> Cut {
        let At { slot, first, n, particle, arc } = at;
        let (model, state) = (&mut self.model, &mut self.state);
        // By their elements, while these have their numbers.
        let rod = model.rods.at(slot).expect("just read").clone();
        let i = first + particle;
        let on_rest = |load: &mut LoadState| {
            load.rod == slot && load.kind.place_mut().is_some_and(|place| place.on_element(model, &rod).0 >= i)
        };
        let carried: Vec<bool> = state.loads.iter_mut().map(|(_, load)| on_rest(load)).collect();

        model.repeat_entry(i);
        state.repeat_entry(i);
        end_with(model, state, i);
        start_with(model, state, i + 1);
        for (_, other) in model.rods.iter_mut().filter(|(_, other)| other.first > rod.first) {
            other.first += 1;
        }
        let mut rest = rod.clone();
        (rest.first, rest.n_elements) = (i as u32 + 1, (n - particle) as u32);
        rest.size = rod.size.beyond(arc);
        rest.flat = is_flat(&model.section[rest.elements()]);
        let own = model.rods.at_mut(slot).expect("just read");
        own.n_elements = particle as u32;
        own.flat = is_flat(&model.section[own.elements()]);
        let particles = rest.particles();
        let handle: Handle<Rod> = model.rods.insert(rest);
        model.rod_of[particles].fill(handle.index);
        if model.placed.rods.contains(&slot) {
            model.placed.rods.push(handle.index);
        }

        let (new, k) = (handle.index, particle as u32);
        state.contacts.rename(|site| match site {
            Site::Thread { element, s } => Site::Thread { element: element + u32::from(element as usize >= i), s },
            Site::Shape { .. } | Site::Surface { .. } => site,
        });
        for (_, grip) in state.grips.iter_mut().filter(|(_, g)| g.rod == slot && g.index >= k) {
            (grip.rod, grip.index) = (new, grip.index - k);
        }
        for (_, reel) in state.reels.iter_mut().filter(|(_, r)| r.rod == slot && r.at_end) {
            reel.rod = new;
        }
        let members = model.welds.iter_mut().flat_map(|(_, weld)| &mut weld.members);
        for member in members.filter(|m| m.rod == slot && m.particle > k) {
            (member.rod, member.particle) = (new, member.particle - k);
        }
        for end in model.faces.iter_mut().flat_map(|f| &mut f.ends).filter(|end| end.rod == slot && end.at_end) {
            end.rod = new;
        }
        for ((_, load), _) in state.loads.iter_mut().zip(carried).filter(|(_, carried)| *carried) {
            load.rod = new;
            match load.kind.place_mut() {
                Some(Place::Particle(j) | Place::Element(j)) => *j -= k,
                Some(Place::Arc(s)) => *s = (*s - arc).max(0.0),
                Some(Place::Start | Place::End) | None => {}
            }
        }
        let uniform = |load: &LoadState| load.rod == slot && matches!(load.kind, LoadKind::Uniform { .. });
        let shared: Vec<(u32, LoadKind)> =
            state.loads.iter().filter(|(_, load)| uniform(load)).map(|(k, load)| (k, load.kind)).collect();
        let share = |(k, kind): (u32, LoadKind)| -> (Handle<Load>, Handle<Load>) {
            (state.loads.handle(k), state.loads.insert(LoadState { rod: new, kind }))
        };
        Cut { particle: k, rest: Some(handle), loads: shared.into_iter().map(share).collect() }
    }

    /// Makes a closed thread an open one that starts at the cut.
    fn open(&mut self, at: At, weld: u32) -> Cut {
        let At { slot, first, n, particle, arc } = at;
        self.model.faces.retain(|f| f.ends.iter().all(|end| end.rod != slot));
        let members = &self.model.welds.at(weld).expect("just read").members;
        let rest = rest_across(members, (slot, n as u32), (slot, 0)).unwrap_or(DQuat::IDENTITY);
        // What else is welded to the seam stays so.
        if members.len() == 2 {
            let gone = self.model.welds.remove(self.model.welds.handle::<Weld>(weld)).expect("just read");
            self.hold_alone(&gone);
        }
        if particle == 0 {
            return Cut { particle: 0, rest: None, loads: Vec::new() };
        }
        let (model, state) = (&mut self.model, &mut self.state);
        let (count, k) = (n as u32, particle as u32);
        let seam = count - k;
        let turned = |j: u32| (j + seam) % count;
        let length = arc + model.rest_length[first + particle..first + n].iter().sum::<f64>();

        let (ring, first_now) = (first..first + n, first + particle);
        model.rotate_entries(ring.clone(), first_now);
        state.rotate_entries(ring, first_now);
        (state.position[first + n], state.velocity[first + n]) = (state.position[first], state.velocity[first]);
        start_with(model, state, first);
        start_with(model, state, first + seam as usize);
        model.rest_half[first + seam as usize] = crate::math::half(rest);
        let rod = model.rods.at_mut(slot).expect("just read");
        rod.size = rod.size.turned(arc, length);
        rod.turned += 1;

        state.contacts.rename(|site| match site {
            Site::Thread { element, s } if (first..first + n).contains(&(element as usize)) => {
                Site::Thread { element: first as u32 + turned(element - first as u32), s }
            }
            _ => site,
        });
        for (_, grip) in state.grips.iter_mut().filter(|(_, g)| g.rod == slot) {
            grip.index = turned(grip.index);
        }
        for weld in model.welds.iter_mut().map(|(_, weld)| weld) {
            let own = |m: &Member| m.rod == slot;
            for member in weld.members.iter_mut().filter(|m| own(m)) {
                member.particle = turned(member.particle);
            }
            // Where the thread met itself it goes through.
            let last = weld.members.iter().position(|m| own(m) && m.particle == seam && m.after.is_none());
            let before = last.and_then(|last| weld.members[last].before);
            let through = weld.members.iter_mut().find(|m| own(m) && m.particle == seam && m.after.is_some());
            if let (Some(last), Some(through)) = (last, through) {
                through.before = before;
                weld.members.remove(last);
            }
        }
        for (_, load) in state.loads.iter_mut().filter(|(_, l)| l.rod == slot) {
            if let Some(place) = load.kind.place_mut() {
                *place = match *place {
                    Place::Start => Place::Particle(seam),
                    Place::End => Place::Arc(length - arc),
                    Place::Particle(j) if j == count => Place::Arc(length - arc),
                    Place::Particle(j) => Place::Particle(turned(j)),
                    Place::Element(j) => Place::Element(turned(j)),
                    Place::Arc(s) if s <= arc => Place::Arc((s + length - arc).min(length)),
                    Place::Arc(s) => Place::Arc(s - arc),
                }
            }
        }
        Cut { particle: k, rest: None, loads: Vec::new() }
    }
}

/// Makes an entry the last one of a thread, which is no element.
fn end_with(model: &mut Model, state: &mut State, i: usize) {
    (model.rest_length[i], state.rest_length[i]) = (0.0, 0.0);
    (model.section[i], model.factors[i], model.rest_half[i]) =
        (model.section[i - 1], model.factors[i - 1], DQuat::IDENTITY);
    (state.orientation[i], state.angular_velocity[i]) = (DQuat::IDENTITY, DVec3::ZERO);
    (state.tension[i], state.plastic[i], state.hardened[i]) = (0.0, DVec3::ZERO, 0.0);
}

/// Makes an entry the first one of a thread, which has no joint before it.
fn start_with(model: &mut Model, state: &mut State, i: usize) {
    model.rest_half[i] = DQuat::IDENTITY;
    (state.plastic[i], state.hardened[i]) = (DVec3::ZERO, 0.0);
}
