//! Length fed in and drawn back. The rest length of the last element at a reel is State; what the model says of that
//! element follows from it, and elements are cut in two or joined between substeps.

use crate::handle::Slots;
use crate::model::Model;
use crate::model::grip::{Hold, Place};
use crate::model::reel::ReelLaw;
use crate::model::rod::RodModel;
use crate::rod::brake::Brake;
use crate::state::{LoadState, ReelState, Site, State};

/// Lengths of the last element, over its length when the reel was set up, beyond which it is cut and below which it is
/// joined with the next.
const LONGEST: f64 = 1.6;
const SHORTEST: f64 = 0.4;
/// Where it cannot be joined it is not drawn back beyond this.
const LEAST: f64 = 0.25;
/// Length up to which a substep feeds in: what would be more elements than that is not a rate but a jump.
const MOST: f64 = 1000.0;
/// Length beyond which an element is not cut: too few digits say what is left of it.
const ENDLESS: f64 = 1e9;

impl ReelState {
    /// The element at the reel, in the world's arrays.
    pub fn element(&self, model: &Model) -> usize {
        let rod = model.rods.at(self.rod).expect("reels go with their rods");
        if self.at_end { rod.elements().end - 1 } else { rod.first as usize }
    }
}

/// Feeds the length of a substep at its start. True where there are reels: weights are others then.
pub(crate) fn feed(model: &mut Model, state: &mut State, h: f64) -> bool {
    let State { reels, loads, rest_length, .. } = state;
    for (_, reel) in reels.iter_mut() {
        if let ReelLaw::Rate(rate) = reel.law {
            reel.feed(model, rest_length, loads, rate * h);
        }
    }
    sync(model, state);
    state.reels.iter().next().is_some()
}

/// Gives off what brakes let slip in a substep.
pub(crate) fn release(model: &mut Model, state: &mut State, brakes: &[Brake]) {
    for brake in brakes.iter().filter(|b| b.slips) {
        let paid = brake.paid(model, state);
        let State { reels, loads, rest_length, .. } = &mut *state;
        for (_, reel) in reels.iter_mut().filter(|(slot, _)| *slot == brake.reel) {
            reel.feed(model, rest_length, loads, paid);
        }
    }
    if !brakes.is_empty() {
        sync(model, state);
    }
}

impl ReelState {
    /// Feeds in as much of `length` as there is.
    fn feed(&mut self, model: &Model, rest_length: &mut [f64], loads: &mut Slots<LoadState>, length: f64) {
        let now = &mut rest_length[self.element(model)];
        let there_is = self.supply.map_or(length, |s| length.min(s));
        let length = there_is.min((MOST * self.nominal - *now).max(0.0)).max(LEAST * self.nominal - *now);
        *now += length;
        self.fed += length;
        self.supply = self.supply.map(|s| s - length);
        if !self.at_end {
            // Places told by their arc from the start keep their material, also where it is on the reel.
            for (_, load) in loads.iter_mut().filter(|(_, l)| l.rod == self.rod) {
                if let Some(Place::Arc(s)) = load.kind.place_mut() {
                    *s += length;
                }
            }
        }
    }
}

/// Makes the model's elements at reels as long as the state says.
pub(crate) fn sync(model: &mut Model, state: &State) {
    for (_, reel) in state.reels.iter() {
        let e = reel.element(model);
        if model.rest_length[e] != state.rest_length[e] {
            model.rest_length[e] = state.rest_length[e];
            model.refresh_element(e);
            model.refresh_joint(e);
            model.refresh_joint(e + 1);
        }
    }
    if state.reels.iter().next().is_some() {
        model.refresh_masses(&state.loads);
    }
}

/// Cuts and joins elements at reels, with regard to what the next `h` draws back. True when there is another number of
/// them now.
pub(crate) fn remesh(model: &mut Model, state: &mut State, h: f64) -> bool {
    let mut changed = false;
    for slot in 0..state.reels.len() as u32 {
        // What a substep feeds in is cut before the next one.
        for _ in 0..MOST as u32 {
            let Some(reel) = state.reels.at(slot) else { break };
            let (e, nominal, length) = (reel.element(model), reel.nominal, state.rest_length[reel.element(model)]);
            let n = model.rods.at(reel.rod).expect("reels go with their rods").n_elements;
            // The particle between the last element and the next.
            let inner = if reel.at_end { e } else { e + 1 };
            let drawn = if let ReelLaw::Rate(rate) = reel.law { (-rate * h).max(0.0) } else { 0.0 };
            if length - drawn > LONGEST * nominal && length < ENDLESS * nominal {
                // Toward the reel stays what is left of it.
                let first = if reel.at_end { nominal } else { length - nominal };
                let rod = reel.rod;
                split_state(model, state, slot, e, first);
                split_model(model, rod, e);
            } else if length - drawn < SHORTEST * nominal
                && n > 2
                && model.weld_of[inner].is_none()
                && !held(model, state, inner)
            {
                let (rod, at_end) = (reel.rod, reel.at_end);
                merge_state(model, state, slot, inner - 1, at_end);
                merge_model(model, rod, inner - 1);
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

/// Whether a grip holds a particle.
pub(crate) fn held(model: &Model, state: &State, particle: usize) -> bool {
    state.grips.iter().any(|(_, g)| {
        let first = (model.rods.at(g.rod).expect("grips go with their rod").first + g.index) as usize;
        (first..=first + usize::from(g.hold == Hold::Jaw)).contains(&particle)
    })
}

/// Elements that a reel has added to a thread, less those that it took away.
pub(crate) fn added(state: &State, rod: u32, at_end: bool) -> i32 {
    state.reels.iter().map(|(_, r)| r).find(|r| r.rod == rod && r.at_end == at_end).map_or(0, |r| r.added)
}

/// Whether a reel can work on a rod: elements at its ends are cut and joined as if they were all alike, of whatever
/// material.
pub(crate) fn suits(model: &Model, rod: &RodModel) -> bool {
    let first = rod.first as usize;
    rod.n_elements >= 2
        && rod
            .elements()
            .all(|k| model.factors[k] == model.factors[first] && model.rest_half[k] == glam::DQuat::IDENTITY)
}

/// Whether a state read from outside has lengths and reels that the model, which now fits the state `from`, can be made
/// to fit.
pub(crate) fn check(model: &Model, from: &State, to: &State) -> Result<(), &'static str> {
    for (_, reel) in to.reels.iter() {
        let numbers = reel.nominal.is_finite()
            && reel.nominal > 0.0
            && reel.fed.is_finite()
            && reel.supply.is_none_or(|s| s.is_finite() && s >= 0.0);
        let rod = model.rods.at(reel.rod).ok_or("a reel is at a thread that is not here")?;
        let alone = to.reels.iter().filter(|(_, r)| (r.rod, r.at_end) == (reel.rod, reel.at_end)).count() == 1;
        let brake = matches!(reel.law, ReelLaw::Brake(_)) && rod.stretch == crate::Stretch::Inextensible;
        if !numbers || !alone || brake || !suits(model, rod) || reel.law.validate().is_err() {
            return Err("a reel is out of range");
        }
    }
    // Rods lie one after the other, each with a last entry that is no element.
    let mut ends = 0;
    let mut rods: Vec<_> = model.rods.iter().collect();
    rods.sort_unstable_by_key(|(_, r)| r.first);
    for (slot, rod) in rods {
        let more =
            [false, true].map(|at_end| i64::from(added(to, slot, at_end)) - i64::from(added(from, slot, at_end)));
        let now = i64::from(rod.n_elements);
        let least = if to.reels.iter().any(|(_, r)| r.rod == slot) { 2 } else { 1 };
        let n = usize::try_from(now + more[0] + more[1])
            .ok()
            .filter(|n| *n >= least)
            .ok_or("a reel has drawn back more than there is")?;
        // Particles that go when elements are joined.
        let gone = |k: i64| (1..=-more[0]).contains(&k) || (now + more[1]..now).contains(&k);
        if model.welds.iter().flat_map(|(_, w)| &w.members).any(|m| m.rod == slot && gone(i64::from(m.particle))) {
            return Err("it is of a world with other welds");
        }
        let end = ends + n;
        let lengths = to.rest_length.get(ends..=end).ok_or("it is of a world with other threads")?;
        if !lengths[..n].iter().all(|l| l.is_finite() && *l > 0.0) || lengths[n] != 0.0 {
            return Err("a length of an element is out of range");
        }
        for (_, reel) in to.reels.iter().filter(|(_, r)| r.rod == slot) {
            if lengths[if reel.at_end { n - 1 } else { 0 }] < LEAST * reel.nominal * (1.0 - 1e-9) {
                return Err("a reel is out of range");
            }
        }
        ends = end + 1;
    }
    if ends == to.rest_length.len() { Ok(()) } else { Err("it is of a world with other threads") }
}

/// Whether a state that [`check`] has passed has the rest lengths of the model, which now fits the state `from`. Of a
/// thread with a reel the length of the elements at the reel is compared: what was fed in and drawn back may have come
/// of others.
pub(crate) fn check_lengths(model: &Model, from: &State, to: &State) -> Result<(), String> {
    let mut rods: Vec<_> = model.rods.iter().collect();
    rods.sort_unstable_by_key(|(_, r)| r.first);
    let mut first = 0;
    for (slot, rod) in rods {
        let nominal = |state: &State, at_end: bool| {
            state.reels.iter().map(|(_, r)| r).find(|r| (r.rod, r.at_end) == (slot, at_end)).map(|r| r.nominal)
        };
        let more: i64 = [false, true]
            .map(|at_end| i64::from(added(to, slot, at_end)) - i64::from(added(from, slot, at_end)))
            .iter()
            .sum();
        let n = (i64::from(rod.n_elements) + more) as usize;
        let (here, there) = (&model.rest_length[rod.elements()], &to.rest_length[first..first + n]);
        first += n + 1;
        let differs = |place: String, here: f64, there: f64| {
            Err(format!(
                "it is of a world with other threads: of thread {slot}, {place} is {there} m long at rest there, {here} m here"
            ))
        };
        let reels = [false, true].map(|at_end| (nominal(from, at_end), nominal(to, at_end)));
        if reels.iter().all(|(a, b)| a.is_none() && b.is_none()) {
            if let Some(e) = (0..n).find(|e| !crate::math::same(here[*e], there[*e])) {
                return differs(format!("element {e}"), here[e], there[e]);
            }
            continue;
        }
        for (at_end, (now, then)) in reels.into_iter().enumerate() {
            let at = |lengths: &[f64]| lengths[if at_end == 1 { lengths.len() - 1 } else { 0 }];
            if now.is_some() || then.is_some() {
                let (here, there) = (now.unwrap_or(at(here)), then.unwrap_or(at(there)));
                if !crate::math::same(here, there) {
                    return differs(
                        format!("an element at the {}", if at_end == 1 { "end" } else { "start" }),
                        here,
                        there,
                    );
                }
            }
        }
    }
    Ok(())
}

/// Gives the model as many elements in the state `to` as it has in `from`, and their lengths there.
pub(crate) fn refit(model: &mut Model, from: &State, to: &State) {
    let slots: Vec<u32> = model.rods.iter().map(|(slot, _)| slot).collect();
    for slot in slots {
        for at_end in [false, true] {
            let (now, want) = (added(from, slot, at_end), added(to, slot, at_end));
            let end = |model: &Model| {
                model
                    .rods
                    .at(slot)
                    .map(|r| if at_end { r.elements().end - 1 } else { r.first as usize })
                    .expect("listed")
            };
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
    model.rest_length.clone_from(&to.rest_length);
    for e in 0..model.rest_length.len() {
        model.refresh_element(e);
        model.refresh_joint(e);
    }
}

/// Cuts element `e` of a rod in two of the same section, in the model; lengths are to be set.
fn split_model(model: &mut Model, rod: u32, e: usize) {
    model.repeat_entry(e);
    model.rest_half[e + 1] = glam::DQuat::IDENTITY;
    shift_model(&mut model.rods, rod, e, 1);
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
    model.remove_entry(e + 1);
    shift_model(&mut model.rods, rod, e, -1);
    for (_, weld) in model.welds.iter_mut() {
        for m in weld.members.iter_mut().filter(|m| m.rod == rod) {
            let first = model.rods.at(rod).expect("living").first;
            m.particle -= u32::from((first + m.particle) as usize > e);
        }
    }
    model.refresh_welds();
}

fn shift_model(rods: &mut Slots<RodModel>, rod: u32, e: usize, by: i32) {
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
    let (x, v) =
        (state.position[e].lerp(state.position[e + 1], part), state.velocity[e].lerp(state.velocity[e + 1], part));
    state.repeat_entry(e);
    (state.position[e + 1], state.velocity[e + 1]) = (x, v);
    (state.plastic[e + 1], state.hardened[e + 1]) = (glam::DVec3::ZERO, 0.0);
    (state.rest_length[e], state.rest_length[e + 1]) = (first, l - first);
    let place = |k: u32, s: f64| match (k as usize).cmp(&e) {
        core::cmp::Ordering::Less => (k, s),
        // Of a part too small to be told from none it is the end.
        core::cmp::Ordering::Equal if s <= part => (k, (s / part).min(1.0)),
        core::cmp::Ordering::Equal => (k + 1, (s - part) / (1.0 - part)),
        core::cmp::Ordering::Greater => (k + 1, s),
    };
    renumber_state(model, state, reel, e, 1, &place);
}

/// Joins elements `e` and `e + 1` of the rod, in the state. What stays is the frame of the one that is not at the reel.
fn merge_state(model: &Model, state: &mut State, reel: u32, e: usize, at_end: bool) {
    let (a, b) = (model.rest_length[e], model.rest_length[e + 1]);
    let keep = if at_end { e } else { e + 1 };
    state.orientation[e] = state.orientation[keep];
    state.angular_velocity[e] = state.angular_velocity[keep];
    state.tension[e] = state.tension[keep];
    state.rest_length[e] = a + b;
    state.remove_entry(e + 1);
    let part = a / (a + b);
    let place = |k: u32, s: f64| match k as usize {
        k if k == e => (k as u32, s * part),
        k if k == e + 1 => (e as u32, part + s * (1.0 - part)),
        k => (if k > e { k as u32 - 1 } else { k as u32 }, s),
    };
    renumber_state(model, state, reel, e, -1, &place);
}

/// Names of particles and elements after element `e` change by one; `place` says where places on elements are now.
fn renumber_state(
    model: &Model,
    state: &mut State,
    reel: u32,
    e: usize,
    by: i32,
    place: &dyn Fn(u32, f64) -> (u32, f64),
) {
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
        if let Some(Place::Particle(k) | Place::Element(k)) = load.kind.place_mut() {
            *k = moved(*k);
        }
    }
    state.contacts.rename(|site| match site {
        Site::Thread { element, s } => {
            let (element, s) = place(element, s);
            Site::Thread { element, s }
        }
        Site::Shape { .. } | Site::Surface { .. } => site,
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::Contact;
    use crate::{LoadKind, LoadSpec, Material, ReelSpec, RodSpec, Settings, World};
    use glam::DVec3;

    /// A thread of ten elements with a reel at its start, stepped for a while in substeps that are put back and halved.
    #[test]
    fn an_arc_keeps_its_material_through_substeps_that_are_put_back() {
        let mut world = World::new(Settings { newton_max: 1, halvings: 2, ..Settings::default() }).unwrap();
        let rod = world
            .insert_rod(&RodSpec::straight(DVec3::ZERO, DVec3::X * 0.02, 10, 1.5e-4, Material::elastic(2e9, 1150.0)))
            .unwrap();
        world.insert_grip(&crate::GripSpec::at_once(rod, Place::Start, Hold::Pin)).unwrap();
        let reel = world.insert_reel(&ReelSpec { rod, at_end: false, law: ReelLaw::Rate(0.01), supply: None }).unwrap();
        world
            .insert_load(&LoadSpec {
                rod,
                kind: LoadKind::Mass { place: Place::Arc(0.015), mass: 1e-5, inertia: DVec3::ZERO },
            })
            .unwrap();
        let rejected: u32 = (0..30).map(|_| world.step(1.0 / 60.0).rejected).sum();
        assert!(rejected > 10, "{rejected}");
        let fed = world.reel_fed(reel).unwrap();
        let (_, mut state) = world.into_parts();
        let arcs: Vec<f64> = state
            .loads
            .iter_mut()
            .filter_map(|(_, l)| if let Some(Place::Arc(s)) = l.kind.place_mut() { Some(*s) } else { None })
            .collect();
        assert!((arcs[0] - 0.015 - fed).abs() < 1e-12 && fed > 1e-3, "{arcs:?} {fed}");
    }

    #[test]
    fn an_element_without_end_is_not_cut_to_nothing() {
        let mut world = World::default();
        let material = Material::elastic(2e9, 1150.0);
        let rod = world.insert_rod(&RodSpec::straight(DVec3::ZERO, DVec3::X * 0.02, 10, 1.5e-4, material)).unwrap();
        world.insert_reel(&ReelSpec { rod, at_end: false, law: ReelLaw::Rate(0.0), supply: None }).unwrap();
        let (mut model, mut state) = world.into_parts();
        state.rest_length[0] = 1e88;
        sync(&mut model, &state);
        remesh(&mut model, &mut state, 1e-3);
        assert!(state.rest_length[..10].iter().all(|l| *l > 0.0));
    }

    #[test]
    fn contacts_stay_in_order_when_an_element_is_cut_and_joined() {
        let mut world = World::default();
        let rod = world
            .insert_rod(&RodSpec::straight(DVec3::ZERO, DVec3::X * 0.02, 10, 1.5e-4, Material::elastic(2e9, 1150.0)))
            .unwrap();
        world.insert_reel(&ReelSpec { rod, at_end: false, law: ReelLaw::Rate(0.0), supply: None }).unwrap();
        let (mut model, mut state) = world.into_parts();
        let contact = |a: Site, b: Site| Contact {
            a,
            b,
            normal: DVec3::Z,
            normal_force: 1.0,
            friction: DVec3::ZERO,
            residual_slip: DVec3::ZERO,
            sliding: false,
        };
        let place = |element: u32, s: f64| Site::Thread { element, s };
        let on = |element: u32, s: f64, shape: u32| contact(place(element, s), Site::Shape { shape });
        let pair = |a: u32, s: f64, b: u32| contact(place(a, s), place(b, 0.5));
        // Of a shape 1 they come after all of a shape 0.
        let shapes = [on(0, 0.2, 0), on(0, 0.9, 0), on(1, 0.1, 0), on(0, 0.3, 1)];
        state.contacts.set(shapes.into_iter().chain([pair(0, 0.9, 5), pair(0, 0.1, 6), pair(1, 0.5, 5)]));
        let in_order = |state: &State| {
            let (threads, shapes) = (state.contacts.threads(), state.contacts.shapes());
            assert!(threads.is_sorted_by_key(|c| c.elements().unwrap()), "{threads:?}");
            assert!(shapes.is_sorted_by_key(|c| c.on_shape().unwrap()), "{shapes:?}");
        };
        state.rest_length[0] *= 1.7;
        sync(&mut model, &state);
        assert!(remesh(&mut model, &mut state, 1e-3));
        in_order(&state);
        state.rest_length[0] *= 0.5;
        sync(&mut model, &state);
        assert!(remesh(&mut model, &mut state, 1e-3));
        in_order(&state);
        let pairs: Vec<_> = state.contacts.threads().iter().filter_map(Contact::elements).collect();
        assert_eq!(pairs, [(0, 5), (0, 6), (1, 5)]);
    }
}
