//! Length fed in and drawn back. The rest length of the last element at a reel is State; what the model says of that element follows from it, and
//! elements are cut in two or joined between substeps.

use crate::model::Model;
use crate::model::grip::{Hold, LoadKind, Place};
use crate::model::reel::ReelLaw;
use crate::rod::brake::Brake;
use crate::state::{ReelState, State};

/// Lengths of the last element, over its length when the reel was set up, beyond which it is cut and below which it is joined with the next.
const LONGEST: f64 = 1.6;
const SHORTEST: f64 = 0.4;
/// Where it cannot be joined it is not drawn back beyond this.
const LEAST: f64 = 0.25;

impl ReelState {
    /// The element at the reel, in the world's arrays.
    pub fn element(&self, model: &Model) -> usize {
        let rod = model.rods.at(self.rod).expect("reels go with their rods");
        if self.at_end { rod.elements().end - 1 } else { rod.first as usize }
    }
}

/// Feeds the length of a substep at its start. True where there are reels: weights are others then.
pub(crate) fn turn(model: &mut Model, state: &mut State, h: f64) -> bool {
    for (_, reel) in state.reels.iter_mut() {
        if let ReelLaw::Rate(rate) = reel.law {
            reel.feed(rate * h);
        }
    }
    follow(model, state);
    state.reels.iter().next().is_some()
}

/// Gives off what brakes let slip in a substep.
pub(crate) fn pay_out(model: &mut Model, state: &mut State, brakes: &[Brake]) {
    for brake in brakes.iter().filter(|b| b.slips) {
        let paid = brake.paid(model, state);
        for (_, reel) in state.reels.iter_mut().filter(|(slot, _)| *slot == brake.reel) {
            reel.feed(paid);
        }
    }
    if !brakes.is_empty() {
        follow(model, state);
    }
}

impl ReelState {
    /// Feeds in as much of `length` as there is.
    pub fn feed(&mut self, length: f64) {
        let most = self.supply.map_or(length, |s| length.min(s));
        let length = most.max(LEAST * self.nominal - self.length);
        self.length += length;
        self.fed += length;
        self.supply = self.supply.map(|s| s - length);
    }
}

/// Makes the model's end elements what the reels say.
pub(crate) fn follow(model: &mut Model, state: &mut State) {
    for (_, reel) in state.reels.iter() {
        let e = reel.element(model);
        let more = reel.length - model.rest_length[e];
        if more == 0.0 {
            continue;
        }
        model.rest_length[e] = reel.length;
        state.rest_length[e] = reel.length;
        model.refresh_element(e);
        for joint in [e, e + 1] {
            model.refresh_joint(joint);
        }
        if !reel.at_end {
            // Places told by their arc from the start keep their material.
            for (_, load) in state.loads.iter_mut().filter(|(_, l)| l.rod == reel.rod) {
                if let LoadKind::Point { place: Place::Arc(s), .. } | LoadKind::Mass { place: Place::Arc(s), .. } = &mut load.kind {
                    *s = (*s + more).max(0.0);
                }
            }
        }
    }
    if state.reels.iter().next().is_some() {
        model.refresh_masses(&state.loads);
    }
}

/// Cuts and joins elements at reels, with regard to what the next `h` draws back. True when there is another number of them now.
pub(crate) fn renumber(model: &mut Model, state: &mut State, h: f64) -> bool {
    let mut changed = false;
    for slot in 0..state.reels.len() as u32 {
        while let Some(reel) = state.reels.at(slot).cloned() {
            let e = reel.element(model);
            let n = model.rods.at(reel.rod).expect("reels go with their rods").n_elements;
            // The particle between the last element and the next.
            let inner = if reel.at_end { e } else { e + 1 };
            let drawn = if let ReelLaw::Rate(rate) = reel.law { (-rate * h).max(0.0) } else { 0.0 };
            if reel.length - drawn > LONGEST * reel.nominal {
                // Toward the reel stays what is left of it.
                let first = if reel.at_end { reel.nominal } else { reel.length - reel.nominal };
                split_state(model, state, slot, e, first);
                split_model(model, reel.rod, e);
                set(state, slot, reel.length - reel.nominal);
            } else if reel.length - drawn < SHORTEST * reel.nominal && n > 2 && model.weld_of[inner].is_none() && !held(model, state, inner) {
                let first = inner - 1;
                let joined = model.rest_length[first] + model.rest_length[first + 1];
                merge_state(model, state, slot, first, reel.at_end);
                merge_model(model, reel.rod, first);
                set(state, slot, joined);
            } else {
                break;
            }
            changed = true;
            model.rest_length.clone_from(&state.rest_length);
            for k in (e.max(1) - 1)..(e + 3).min(model.rest_length.len()) {
                model.refresh_element(k);
                model.refresh_joint(k);
            }
        }
    }
    if changed {
        model.refresh_masses(&state.loads);
    }
    changed
}

fn set(state: &mut State, slot: u32, length: f64) {
    for (_, reel) in state.reels.iter_mut().filter(|(k, _)| *k == slot) {
        reel.length = length;
    }
}

/// Whether a grip holds a particle.
pub(crate) fn held(model: &Model, state: &State, particle: usize) -> bool {
    state.grips.iter().any(|(_, g)| {
        let first = (model.rods.at(g.rod).expect("grips go with their rod").first + g.index) as usize;
        (first..=first + usize::from(g.hold == Hold::Jaw)).contains(&particle)
    })
}

/// Elements that a reel has added to a thread, less those that it took away.
fn added(state: &State, rod: u32, at_end: bool) -> i32 {
    state.reels.iter().map(|(_, r)| r).find(|r| r.rod == rod && r.at_end == at_end).map_or(0, |r| r.added)
}

/// Whether a state read from outside has lengths and reels that the model, which now fits the state `from`, can be made to fit.
pub(crate) fn check(model: &Model, from: &State, to: &State) -> Result<(), &'static str> {
    for (_, reel) in to.reels.iter() {
        let numbers = [reel.nominal, reel.length, reel.fed, reel.supply.unwrap_or(0.0)].iter().all(|v| v.is_finite()) && reel.nominal > 0.0;
        let rod = model.rods.at(reel.rod).ok_or("a reel is at a thread that is not here")?;
        let alone = to.reels.iter().filter(|(_, r)| (r.rod, r.at_end) == (reel.rod, reel.at_end)).count() == 1;
        let brake = matches!(reel.law, ReelLaw::Brake(_)) && rod.stretch == crate::Stretch::Inextensible;
        if !numbers || !alone || brake || reel.law.validate().is_err() {
            return Err("a reel is out of range");
        }
    }
    // Rods lie one after the other, each with a last entry that is no element.
    let mut ends = 0;
    let mut rods: Vec<_> = model.rods.iter().collect();
    rods.sort_unstable_by_key(|(_, r)| r.first);
    for (slot, rod) in rods {
        let more = |at_end| i64::from(added(to, slot, at_end)) - i64::from(added(from, slot, at_end));
        let n = i64::from(rod.n_elements) + more(false) + more(true);
        let n = usize::try_from(n).ok().filter(|n| *n >= 1).ok_or("a reel has drawn back more than there is")?;
        let end = ends + n;
        let lengths = to.rest_length.get(ends..=end).ok_or("it is of a world with other threads")?;
        if !lengths[..n].iter().all(|l| l.is_finite() && *l > 0.0) || lengths[n] != 0.0 {
            return Err("a length of an element is out of range");
        }
        ends = end + 1;
    }
    if ends == to.rest_length.len() { Ok(()) } else { Err("it is of a world with other threads") }
}

/// Gives the model as many elements in the state `to` as it has in `from`, and their lengths there.
pub(crate) fn refit(model: &mut Model, from: &State, to: &State) {
    let slots: Vec<u32> = model.rods.iter().map(|(slot, _)| slot).collect();
    for slot in slots {
        for at_end in [false, true] {
            let (now, want) = (added(from, slot, at_end), added(to, slot, at_end));
            let end = |model: &Model| model.rods.at(slot).map(|r| if at_end { r.elements().end - 1 } else { r.first as usize }).expect("listed");
            for _ in now..want {
                let e = end(model);
                split_model(model, slot, e);
            }
            for _ in want..now {
                let e = end(model);
                merge_model(model, slot, if at_end { e - 1 } else { e });
            }
        }
    }
    if model.rest_length != to.rest_length {
        model.rest_length.clone_from(&to.rest_length);
        for e in 0..model.rest_length.len() {
            model.refresh_element(e);
            model.refresh_joint(e);
        }
    }
}

/// Cuts element `e` of a rod in two of the same section, in the model; lengths are to be set.
fn split_model(model: &mut Model, rod: u32, e: usize) {
    let Model {
        rods, mass, rod_of, rest_length, section, inertia, joint_length, rest_half, stretch_stiffness, inextensible, bend_stiffness, bend_damping, ..
    } = model;
    macro_rules! again {
        ($($array:ident),*) => {$( let v = $array[e].clone(); $array.insert(e + 1, v); )*};
    }
    again!(mass, rod_of, rest_length, section, inertia, joint_length, stretch_stiffness, inextensible, bend_stiffness, bend_damping);
    rest_half.insert(e + 1, glam::DQuat::IDENTITY);
    shift_model(rods, rod, e, 1);
    for (_, weld) in model.welds.iter_mut() {
        for m in weld.members.iter_mut().filter(|m| m.rod == rod) {
            let first = model.rods.at(rod).expect("living").first;
            m.particle += u32::from((first + m.particle) as usize > e);
        }
    }
    model.refresh_welds();
}

/// Joins elements `e` and `e + 1` of a rod, in the model; the length is to be set.
fn merge_model(model: &mut Model, rod: u32, e: usize) {
    let Model {
        rods, mass, rod_of, rest_length, section, inertia, joint_length, rest_half, stretch_stiffness, inextensible, bend_stiffness, bend_damping, ..
    } = model;
    macro_rules! without {
        ($($array:ident),*) => {$( $array.remove(e + 1); )*};
    }
    without!(mass, rod_of, rest_length, section, inertia, joint_length, rest_half, stretch_stiffness, inextensible, bend_stiffness, bend_damping);
    shift_model(rods, rod, e, -1);
    for (_, weld) in model.welds.iter_mut() {
        for m in weld.members.iter_mut().filter(|m| m.rod == rod) {
            let first = model.rods.at(rod).expect("living").first;
            m.particle -= u32::from((first + m.particle) as usize > e);
        }
    }
    model.refresh_welds();
}

fn shift_model(rods: &mut crate::handle::Slots<crate::model::rod::RodModel>, rod: u32, e: usize, by: i32) {
    for (slot, r) in rods.iter_mut() {
        if slot == rod {
            r.n_elements = r.n_elements.saturating_add_signed(by);
        } else if r.first as usize > e {
            r.first = r.first.saturating_add_signed(by);
        }
    }
}

/// Cuts element `e` of the rod at `part` of its length, in the state; the reel's count follows.
fn split_state(model: &Model, state: &mut State, reel: u32, e: usize, first: f64) {
    let l = model.rest_length[e];
    let part = first / l;
    let (x, v) = (state.position[e].lerp(state.position[e + 1], part), state.velocity[e].lerp(state.velocity[e + 1], part));
    state.position.insert(e + 1, x);
    state.velocity.insert(e + 1, v);
    let State { orientation, angular_velocity, tension, plastic, hardened, rest_length, .. } = &mut *state;
    orientation.insert(e + 1, orientation[e]);
    angular_velocity.insert(e + 1, angular_velocity[e]);
    tension.insert(e + 1, tension[e]);
    plastic.insert(e + 1, glam::DVec3::ZERO);
    hardened.insert(e + 1, 0.0);
    rest_length.insert(e + 1, l - first);
    rest_length[e] = first;
    let place = |k: u32, s: f64| match (k as usize).cmp(&e) {
        core::cmp::Ordering::Less => (k, s),
        core::cmp::Ordering::Equal if s <= part => (k, s / part),
        core::cmp::Ordering::Equal => (k + 1, (s - part) / (1.0 - part)),
        core::cmp::Ordering::Greater => (k + 1, s),
    };
    renumber_state(model, state, reel, e, 1, &place);
}

/// Joins elements `e` and `e + 1` of the rod, in the state. What stays is the frame of the one that is not at the reel.
fn merge_state(model: &Model, state: &mut State, reel: u32, e: usize, at_end: bool) {
    let (a, b) = (model.rest_length[e], model.rest_length[e + 1]);
    let keep = if at_end { e } else { e + 1 };
    let State { position, velocity, orientation, angular_velocity, tension, plastic, hardened, rest_length, .. } = &mut *state;
    position.remove(e + 1);
    velocity.remove(e + 1);
    (orientation[e], angular_velocity[e], tension[e]) = (orientation[keep], angular_velocity[keep], tension[keep]);
    rest_length[e] = a + b;
    orientation.remove(e + 1);
    angular_velocity.remove(e + 1);
    tension.remove(e + 1);
    plastic.remove(e + 1);
    hardened.remove(e + 1);
    rest_length.remove(e + 1);
    let part = a / (a + b);
    let place = |k: u32, s: f64| match k as usize {
        k if k == e => (k as u32, s * part),
        k if k == e + 1 => (e as u32, part + s * (1.0 - part)),
        k => (if k > e { k as u32 - 1 } else { k as u32 }, s),
    };
    renumber_state(model, state, reel, e, -1, &place);
}

/// Names of particles and elements after element `e` change by one; `place` says where places on elements are now.
fn renumber_state(model: &Model, state: &mut State, reel: u32, e: usize, by: i32, place: &dyn Fn(u32, f64) -> (u32, f64)) {
    let rod = state.reels.at(reel).expect("the reel that feeds").rod;
    let local = e as u32 - model.rods.at(rod).expect("living").first;
    let moved = |k: u32| if k > local { k.saturating_add_signed(by) } else { k };
    for (k, r) in state.reels.iter_mut() {
        if k == reel {
            r.added += by;
        }
    }
    for (_, g) in state.grips.iter_mut().filter(|(_, g)| g.rod == rod) {
        g.index = moved(g.index);
    }
    for (_, load) in state.loads.iter_mut().filter(|(_, l)| l.rod == rod) {
        if let LoadKind::Point { place, .. } | LoadKind::Mass { place, .. } = &mut load.kind {
            match place {
                Place::Particle(k) | Place::Element(k) => *k = moved(*k),
                Place::Start | Place::End | Place::Arc(_) => {}
            }
        }
    }
    for c in &mut state.thread_contacts {
        ((c.a, c.s), (c.b, c.t)) = (place(c.a, c.s), place(c.b, c.t));
    }
    for c in &mut state.shape_contacts {
        (c.element, c.s) = place(c.element, c.s);
    }
}
