//! The world: what a user builds, steps and reads. Handles become indices here and nowhere else.

use crate::collide::overlap::{Overlap, OverlapWith};
use crate::drive::Interval;
use crate::error::{Error, check};
use crate::handle::Handle;
use crate::math::Pose;
use crate::model::grip::{Drive, Grip, GripSpec, Hold, Load, LoadKind, LoadSpec, Place};
use crate::model::material::Material;
use crate::model::reel::{Reel, ReelLaw, ReelSpec};
use crate::model::rod::{Rod, RodModel, RodSpec, Stretch};
use crate::model::shape::{Checked, Shape, ShapeMotion, ShapeSpec};
use crate::model::weld::{Member, Side, Weld, WeldModel, WeldRest, WeldSpec};
use crate::model::{Model, Placed, ShapeModel};
use crate::params::{Friction, Settings, Solver};
use crate::report::{Incident, IncidentKind, StepReport};
use crate::row;
use crate::scratch::Scratch;
use crate::snapshot::{Build, Snapshot};
use crate::state::{GripState, LoadState, Onset, ReelState, State};
use crate::step::Step;
use crate::view::{ContactView, ContactWith, RodView, ShapeView, View};
use glam::{DQuat, DVec3};

/// Threads, shapes, grips and loads that move together.
#[derive(Default)]
pub struct World {
    model: Model,
    state: State,
    scratch: Scratch,
    /// Work of all steps so far.
    work: f64,
}

/// Force \[N\] and torque \[N m\] in world axes, about the place where they act.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Wrench {
    /// Force \[N\].
    pub force: DVec3,
    /// Torque \[N m\].
    pub torque: DVec3,
}

const ROD: Error = Error::StaleHandle { what: "rod" };
const SHAPE: Error = Error::StaleHandle { what: "shape" };
const GRIP: Error = Error::StaleHandle { what: "grip" };
const LOAD: Error = Error::StaleHandle { what: "load" };
const REEL: Error = Error::StaleHandle { what: "reel" };
const WELD: Error = Error::StaleHandle { what: "weld" };

/// Substeps that one call may take.
const MOST_SUBSTEPS: f64 = 1e6;

impl World {
    /// An empty world.
    pub fn new(settings: Settings) -> Result<Self, Error> {
        let mut world = World::default();
        world.set_settings(settings)?;
        Ok(world)
    }
    /// The settings.
    pub fn settings(&self) -> &Settings {
        &self.model.settings
    }
    /// Changes the settings, the solver among them.
    ///
    /// From [`Solver::Direct`] to [`Solver::Paper`] only where the world has nothing that the paper has not: an error
    /// says what it has. (Where such a thing comes later, the steps say so.) Positions, velocities and poses go on;
    /// tensions, contact forces and the forces of grips end. Back to the direct solver tensions are those of the
    /// strains that the paper's solver has left, lengths that are constraints become so within the next substep,
    /// contacts are found anew with threads on the sides where they are now, and what lies in each other parts.
    pub fn set_settings(&mut self, settings: Settings) -> Result<(), Error> {
        settings.validate()?;
        let (before, after) = (self.model.settings.solver, settings.solver);
        if before == Solver::Direct
            && after != Solver::Direct
            && let Some(what) = crate::pbd::unknown(&self.model, &self.state)
        {
            return Err(Error::invalid(
                "settings",
                "solver",
                what,
                "the direct solver, in a world with what that of the paper does not know",
            ));
        }
        self.model.settings = settings;
        self.state.interrupt(Onset::Unknown);
        if before != Solver::Direct && after == Solver::Direct {
            self.follow_strain(0..self.model.mass.len());
        }
        Ok(())
    }
    /// Limits the work of each step from now on, or no longer (`None`, as a world begins).
    ///
    /// Work is counted in multiply-adds, roughly: 1e9 are about a second of one core. It is counted and not timed, so
    /// what a step does is the same on any machine; who wants a frame within a time measures what a count takes there
    /// ([`StepReport::work`]). Where a step has spent it, it ends with the last substep that was accepted: its state is
    /// as good as any, but [`StepReport::simulated`] is less than the time wanted, and the time of the world is less by
    /// what is missing. Step on by that, or let everything be in slow motion. What grips and driven shapes are wanted
    /// to reach is reached in part. A step that finds no substep within its limit leaves everything as it was, and the
    /// next one tries a shorter substep; after a few such steps one is found, whatever it takes. The paper's solver
    /// takes no notice.
    pub fn set_step_work(&mut self, most: Option<f64>) -> Result<(), Error> {
        if let Some(most) = most {
            check("world", "step_work", most, most > 0.0, "a finite number > 0")?;
        }
        self.model.step_work = most;
        Ok(())
    }
    /// Work of all steps so far, in the counts of [`StepReport::work`].
    pub fn work_done(&self) -> f64 {
        self.work
    }
    /// The limit on the work of a step.
    pub fn step_work(&self) -> Option<f64> {
        self.model.step_work
    }
    /// Friction between two surfaces (indices given in `RodSpec::surface`, `ShapeSpec::surface`).
    pub fn set_friction(&mut self, a: u32, b: u32, friction: Friction) -> Result<(), Error> {
        friction.validate()?;
        let key = (a.min(b), a.max(b));
        match self.model.friction.binary_search_by_key(&key, |(k, _)| *k) {
            Ok(i) => self.model.friction[i].1 = friction,
            Err(i) => self.model.friction.insert(i, (key, friction)),
        }
        self.state.interrupt(Onset::Unknown);
        Ok(())
    }

    /// Friction between two surfaces: what was set for them, or the default of the settings.
    pub fn friction(&self, a: u32, b: u32) -> Friction {
        self.model.friction_between(a, b)
    }

    /// Adds a thread.
    pub fn insert_rod(&mut self, spec: &RodSpec) -> Result<Handle<Rod>, Error> {
        let low = spec.lower()?;
        self.state.interrupt(Onset::Unknown);
        let n = low.rest_lengths.len();
        let (model, state) = (&mut self.model, &mut self.state);
        let first = model.mass.len();
        let rod = RodModel {
            first: first as u32,
            n_elements: n as u32,
            radius: low.radius,
            section: spec.section,
            section_radius: spec.radius,
            size: spec.along.size.clone(),
            material: spec.material.clone(),
            stretch: spec.stretch,
            flat: crate::model::rod::is_flat(&low.sections),
            surface: spec.surface,
        };
        let handle: Handle<Rod> = model.rods.insert(rod);
        model.placed.rods.push(handle.index);
        for e in 0..=n {
            // The last entry is no element; its stiffness is never used.
            let section = low.sections[e.min(n - 1)];
            let after = if e < n { low.rest_lengths[e] } else { 0.0 };
            model.rod_of.push(handle.index);
            model.mass.push(0.0);
            model.inertia.push(DVec3::ZERO);
            model.rest_length.push(after);
            state.rest_length.push(after);
            model.inextensible.push(spec.stretch == Stretch::Inextensible);
            model.factors.push(low.factors[e.min(n - 1)]);
            model.section.push(section);
            model.stretch_stiffness.push(DVec3::splat(section.ea));
            model.joint_length.push(0.0);
            model.bend_stiffness.push(section.bend);
            model.bend_damping.push(spec.material.bend_damping);
            model.rest_half.push(if e < n { low.rest_half[e] } else { DQuat::IDENTITY });
            state.position.push(low.centerline[e]);
            state.orientation.push(if e < n { low.frames[e] } else { DQuat::IDENTITY });
        }
        for e in first..=first + n {
            model.refresh_element(e);
            model.refresh_joint(e);
        }
        let total = first + n + 1;
        state.velocity.resize(total, DVec3::ZERO);
        state.angular_velocity.resize(total, DVec3::ZERO);
        state.tension.resize(total, 0.0);
        state.plastic.resize(total, DVec3::ZERO);
        state.hardened.resize(total, 0.0);
        self.follow_strain(first..first + n);
        self.model.refresh_masses(&self.state.loads);
        self.model.refresh_welds();
        if let Some([before, after]) = low.seam {
            let member = |particle, before, after| Member { rod: handle.index, particle, before, after };
            let orientation = row::weld::between(low.frames[n - 1], low.frames[0], before * after);
            self.join(
                vec![member(n as u32, Some(Side::along(before)), None), member(0, None, Some(Side::along(after)))],
                orientation,
            );
        }
        Ok(handle)
    }

    /// Tensions of elastic elements are those of their strains.
    fn follow_strain(&mut self, range: core::ops::Range<usize>) {
        let (model, state) = (&self.model, &mut self.state);
        for e in range {
            if model.is_element(e) && !model.inextensible[e] {
                state.tension[e] = crate::rod::element_strain(model, state, e).z * model.stretch_stiffness[e].z;
            }
        }
    }

    /// Makes a thread that is in the world of another material, checked as that of a new one. [`Along`](crate::Along)
    /// goes on to hold: modulus and density are multiplied along the thread as they were.
    ///
    /// Where the thread is and how fast it moves stays, and so does its shape at rest with the plastic set that it has
    /// (also where the new material takes none) and the hardening, which is counted in strains at yield. Forces follow:
    /// tensions of an elastic thread and all moments are those of the present strains from here on, momentum is that of
    /// the present velocities. The tensions of an inextensible thread, contact forces and the forces of grips are those
    /// of the last substep until the next one. What is bent beyond a new yield yields in the next substep. The
    /// integrator starts anew, as after any other edit.
    pub fn set_material(&mut self, rod: Handle<Rod>, material: &Material) -> Result<(), Error> {
        material.validate()?;
        let model = &self.model;
        let r = model.rods.get(rod).ok_or(ROD)?;
        let elements = model.factors[r.elements()].iter().copied().zip(model.rest_length[r.elements()].iter().copied());
        let sections = crate::model::rod::sections(material, &r.section, r.section_radius, elements)?;
        let (old, old_sections) = (r.material.clone(), model.section[r.elements()].to_vec());
        let change = |model: &mut Model| model.set_material(rod.index, material.clone(), &sections);
        self.remake(rod, change, |model| model.set_material(rod.index, old, &old_sections))
    }

    /// Lets a thread that is in the world stretch, or keeps it from stretching. One that is stretched shrinks to its
    /// rest length within the next substep, with the jolt that this is, or goes on as it is where what holds it does
    /// not give way, and the step says so. One that begins to stretch carries no tension at first: what it bore
    /// lengthens it. Not where a brake pays it out, which wants one that stretches.
    pub fn set_stretch(&mut self, rod: Handle<Rod>, stretch: Stretch) -> Result<(), Error> {
        let old = self.model.rods.get(rod).ok_or(ROD)?.stretch;
        let brake = |r: &ReelState| r.rod == rod.index && matches!(r.law, ReelLaw::Brake(_));
        if stretch == Stretch::Inextensible && self.state.reels.iter().any(|(_, r)| brake(r)) {
            return Err(Error::invalid("rod", "stretch", stretch, "Elastic, for a thread that a brake pays out"));
        }
        self.remake(rod, |model| model.set_stretch(rod.index, stretch), |model| model.set_stretch(rod.index, old))
    }

    /// Changes stiffness or mass of a thread; puts them back where that leaves the world out of all proportion.
    fn remake(
        &mut self,
        rod: Handle<Rod>,
        change: impl FnOnce(&mut Model),
        back: impl FnOnce(&mut Model),
    ) -> Result<(), Error> {
        let elements = self.model.rods.get(rod).ok_or(ROD)?.elements();
        let tension = self.state.tension[elements.clone()].to_vec();
        change(&mut self.model);
        self.model.refresh_masses(&self.state.loads);
        self.follow_strain(elements.clone());
        if !crate::finite::in_proportion(&self.model, &self.state) {
            back(&mut self.model);
            self.model.refresh_masses(&self.state.loads);
            self.state.tension[elements].copy_from_slice(&tension);
            return Err(Error::invalid(
                "rod",
                "material",
                "out of all proportion",
                "numbers with which the energy of the world is finite",
            ));
        }
        self.state.interrupt(Onset::Unknown);
        Ok(())
    }

    /// Removes a thread with its grips and loads. What it was welded to comes apart where fewer than two threads are
    /// left.
    pub fn remove_rod(&mut self, rod: Handle<Rod>) -> Result<(), Error> {
        let gone = self.model.rods.remove(rod).ok_or(ROD)?;
        self.state.interrupt(Onset::Unknown);
        let range = gone.particles();
        let (model, state) = (&mut self.model, &mut self.state);
        macro_rules! drain {
            ($($array:expr),* $(,)?) => { $($array.drain(range.clone());)* };
        }
        drain!(
            model.rod_of,
            model.mass,
            model.factors,
            model.section,
            model.inertia,
            model.rest_length,
            model.inextensible,
            model.stretch_stiffness,
            model.joint_length,
            model.bend_stiffness,
            model.bend_damping,
            model.rest_half,
            state.rest_length,
            state.position,
            state.velocity,
            state.orientation,
            state.angular_velocity,
            state.tension,
            state.plastic,
            state.hardened,
        );
        let (start, count) = (range.start as u32, range.len() as u32);
        for (_, other) in model.rods.iter_mut() {
            if other.first > start {
                other.first -= count;
            }
        }
        let shift = |e: u32| if e > start { e - count } else { e };
        state.thread_contacts.retain(|c| !range.contains(&(c.a as usize)) && !range.contains(&(c.b as usize)));
        for c in &mut state.thread_contacts {
            (c.a, c.b) = (shift(c.a), shift(c.b));
        }
        state.shape_contacts.retain(|c| !range.contains(&(c.element as usize)));
        for c in &mut state.shape_contacts {
            c.element = shift(c.element);
        }
        state.grips.retain(|g| g.rod != rod.index);
        state.loads.retain(|l| l.rod != rod.index);
        for (_, weld) in model.welds.iter_mut() {
            weld.members.retain(|m| m.rod != rod.index);
        }
        let apart: Vec<WeldModel> =
            model.welds.iter().map(|(_, w)| w).filter(|w| w.members.len() < 2).cloned().collect();
        model.welds.retain(|w| w.members.len() >= 2);
        model.refresh_welds();
        state.reels.retain(|r| r.rod != rod.index);
        apart.iter().for_each(|weld| self.hold_alone(weld));
        Ok(())
    }

    /// Joins places of threads. Where they lie apart (by a tenth of a radius at most) they meet in the middle, or at
    /// the one that is held.
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
        let middle = places.iter().map(|p| state.position[p.2]).sum::<DVec3>() / places.len() as f64;
        let apart = places.iter().map(|p| (state.position[p.2] - middle).length()).fold(0.0, f64::max);
        if apart > 0.1 * least {
            return Err(Error::invalid("weld", "places", apart, "places within a tenth of a radius of each other [m]"));
        }
        let held: Vec<usize> = places.iter().map(|p| p.2).filter(|i| crate::reel::held(model, state, *i)).collect();
        if held.len() > 1 {
            return Err(Error::invalid(
                "weld",
                "places",
                format!("{} held", held.len()),
                "at most one place that a grip holds",
            ));
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
            WeldRest::AsInserted => q,
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
        for (_, _, i) in places {
            (self.state.position[i], self.state.velocity[i]) = (at, velocity);
        }
        Ok(self.join(members, orientation))
    }

    /// Takes a weld apart. A thread that went through it goes on, ends are free. A clamp there goes on holding its own
    /// thread as it is: its pose turns from the cross-section of the weld to that of the thread.
    /// What lay in each other at the weld touches from now on, and is pushed apart.
    pub fn remove_weld(&mut self, weld: Handle<Weld>) -> Result<(), Error> {
        let gone = self.model.welds.remove(weld).ok_or(WELD)?;
        self.state.interrupt(Onset::Unknown);
        self.model.refresh_welds();
        self.hold_alone(&gone);
        Ok(())
    }

    /// Clamps at a weld that is gone hold the cross-section of their own thread from now on, with the moment that it
    /// carries.
    fn hold_alone(&mut self, gone: &WeldModel) {
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

    fn join(&mut self, members: Vec<Member>, orientation: DQuat) -> Handle<Weld> {
        self.state.interrupt(Onset::Unknown);
        let radius = members.iter().map(|m| self.radius_of(m.index(&self.model))).fold(0.0, f64::max);
        let mut weld = WeldModel { members, exempt: core::f64::consts::PI * radius };
        weld.exempt = crate::collide::exempt(&self.model, &self.state.position, &weld);
        let handle: Handle<Weld> = self.model.welds.insert(weld);
        self.state.weld_orientation.resize(self.model.welds.len(), DQuat::IDENTITY);
        self.state.weld_orientation[handle.index()] = orientation;
        self.model.refresh_welds();
        handle
    }

    /// Adds a shape.
    pub fn insert_shape(&mut self, spec: &ShapeSpec) -> Result<Handle<Shape>, Error> {
        let Checked { geometry, closed, container, notes } = spec.check()?;
        let collider = crate::model::collider::Collider::new(&geometry)?;
        let hash = crate::snapshot::hash_of(&geometry);
        let shape = ShapeModel {
            geometry,
            hash,
            collider,
            surface: spec.surface,
            motion: spec.motion,
            closed,
            container,
            notes,
        };
        let handle: Handle<Shape> = self.model.shapes.insert(shape);
        self.model.placed.shapes.push(handle.index);
        let n = self.model.shapes.len();
        self.state.shape_pose.resize(n, Pose::IDENTITY);
        self.state.shape_target.resize(n, Pose::IDENTITY);
        let pose = Pose::new(spec.pose.position, spec.pose.orientation.normalize());
        self.state.shape_pose[handle.index()] = pose;
        self.state.shape_target[handle.index()] = pose;
        Ok(handle)
    }

    /// Removes a shape.
    pub fn remove_shape(&mut self, shape: Handle<Shape>) -> Result<(), Error> {
        self.model.shapes.remove(shape).ok_or(SHAPE)?;
        self.state.interrupt(Onset::Unknown);
        self.state.shape_contacts.retain(|c| c.shape != shape.index);
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
        self.model.shapes.get_mut(shape).ok_or(SHAPE)?.motion = motion;
        self.state.interrupt(Onset::Unknown);
        self.state.shape_target[shape.index()] = self.state.shape_pose[shape.index()];
        Ok(())
    }

    /// Takes hold.
    pub fn insert_grip(&mut self, spec: &GripSpec) -> Result<Handle<Grip>, Error> {
        spec.drive.validate()?;
        check("grip", "ramp", spec.ramp, spec.ramp >= 0.0, "a finite time >= 0 [s]")?;
        let rod = self.model.rods.get(spec.rod).ok_or(ROD)?;
        spec.place.validate("grip", &self.model, rod)?;
        let n = rod.n_elements;
        let index = match spec.hold {
            Hold::Pin | Hold::Clamp => spec.place.particle(&self.model, rod),
            Hold::Jaw => (spec.place.on_element(&self.model, rod).0 - rod.first as usize) as u32,
        };
        let first = (rod.first + index) as usize;
        let wanted = first..=first + usize::from(spec.hold == Hold::Jaw);
        let welded = wanted
            .clone()
            .filter_map(|i| self.model.weld_of[i])
            .flat_map(|w| self.model.welds.at(w).into_iter().flat_map(|w| &w.members));
        if wanted
            .clone()
            .chain(welded.map(|m| m.index(&self.model)))
            .any(|i| crate::reel::held(&self.model, &self.state, i))
        {
            return Err(Error::invalid("grip", "place", spec.place, "a piece that no other grip holds"));
        }
        let i = (rod.first + index) as usize;
        let state = &self.state;
        if spec.hold == Hold::Jaw
            && state.reels.iter().any(|(_, r)| r.rod == spec.rod.index && r.element(&self.model) == i)
        {
            return Err(Error::invalid("grip", "place", spec.place, "an element that is not at a reel, for a jaw"));
        }
        let (mut rest_half, mut half_span) = (DQuat::IDENTITY, DVec3::ZERO);
        let (position, orientation, velocity, spin) = match spec.hold {
            Hold::Pin => (state.position[i], DQuat::IDENTITY, state.velocity[i], DVec3::ZERO),
            Hold::Clamp => {
                // Rest rotation over half an element: half that of the joint here, or of the nearest joint at an end.
                let joint = if n < 2 { None } else { Some((rod.first + index.clamp(1, n - 1)) as usize) };
                if let Some(j) = joint {
                    rest_half = crate::math::half(self.model.rest_half[j]);
                }
                let welded = self.model.weld_of[i].map(|w| state.weld_orientation[w as usize]);
                let (before, after) =
                    ((index > 0).then(|| state.orientation[i - 1]), (index < n).then(|| state.orientation[i]));
                let q = welded.unwrap_or_else(|| crate::model::grip::clamp_orientation(before, after, rest_half));
                (state.position[i], q, state.velocity[i], state.angular_velocity[if index < n { i } else { i - 1 }])
            }
            Hold::Jaw => {
                let (a, b, q) = (state.position[i], state.position[i + 1], state.orientation[i]);
                half_span = q.conjugate() * ((b - a) * 0.5);
                ((a + b) * 0.5, q, (state.velocity[i] + state.velocity[i + 1]) * 0.5, state.angular_velocity[i])
            }
        };
        let pose = Pose::new(position, orientation);
        self.state.interrupt(Onset::Unknown);
        Ok(self.state.grips.insert(GripState {
            rod: spec.rod.index,
            index,
            hold: spec.hold,
            drive: spec.drive,
            ramp: spec.ramp,
            taken_at: self.state.time,
            taken_pose: pose,
            taken_velocity: velocity,
            taken_spin: spin,
            pose,
            target: pose,
            rest_half,
            half_span,
            force: DVec3::ZERO,
            torque: DVec3::ZERO,
        }))
    }

    /// Lets go.
    pub fn remove_grip(&mut self, grip: Handle<Grip>) -> Result<(), Error> {
        self.state.grips.remove(grip).ok_or(GRIP)?;
        self.state.interrupt(Onset::Unknown);
        Ok(())
    }

    /// Pose wanted at the end of the next step for a pose-driven grip. A pin ignores the orientation. The orientation
    /// of a clamp or jaw is that of the material frame held (`world_from_material`).
    pub fn set_grip_pose(&mut self, grip: Handle<Grip>, pose: Pose) -> Result<(), Error> {
        let g = self.state.grips.get_mut(grip).ok_or(GRIP)?;
        if !pose.is_valid() {
            return Err(Error::invalid("grip", "pose", pose, "finite, with a unit quaternion"));
        }
        if g.drive != Drive::Pose {
            return Err(Error::invalid("grip", "drive", g.drive, "Pose, for a pose to be set"));
        }
        g.target = pose;
        Ok(())
    }

    /// Changes what moves a grip, from the next step on. To `Drive::Pose`: it stays where it is until a pose is set.
    pub fn set_grip_drive(&mut self, grip: Handle<Grip>, drive: Drive) -> Result<(), Error> {
        drive.validate()?;
        let g = self.state.grips.get_mut(grip).ok_or(GRIP)?;
        g.drive = drive;
        g.target = g.pose;
        self.state.interrupt(Onset::Unknown);
        Ok(())
    }

    /// Pose of the held piece now. For a pin the orientation is the identity.
    pub fn grip_pose(&self, grip: Handle<Grip>) -> Result<Pose, Error> {
        let g = self.state.grips.get(grip).ok_or(GRIP)?;
        let rod = self.model.rods.at(g.rod).ok_or(ROD)?;
        let i = (rod.first + g.index) as usize;
        let x = &self.state.position;
        Ok(match g.hold {
            Hold::Pin => Pose::at(x[i]),
            Hold::Clamp => Pose::new(x[i], g.pose.orientation),
            Hold::Jaw => Pose::new((x[i] + x[i + 1]) * 0.5, self.state.orientation[i]),
        })
    }

    /// What moves a grip.
    pub fn grip_drive(&self, grip: Handle<Grip>) -> Result<Drive, Error> {
        Ok(self.state.grips.get(grip).ok_or(GRIP)?.drive)
    }

    /// Force and torque with which the grip acts on the thread, at the last accepted substep.
    pub fn grip_wrench(&self, grip: Handle<Grip>) -> Result<Wrench, Error> {
        let g = self.state.grips.get(grip).ok_or(GRIP)?;
        Ok(Wrench { force: g.force, torque: g.torque })
    }

    /// Adds a load.
    pub fn insert_load(&mut self, spec: &LoadSpec) -> Result<Handle<Load>, Error> {
        let rod = self.model.rods.get(spec.rod).ok_or(ROD)?;
        self.validate_load(&spec.kind, rod)?;
        let handle = self.state.loads.insert(LoadState { rod: spec.rod.index, kind: spec.kind });
        self.state.interrupt(Onset::Unknown);
        self.model.refresh_masses(&self.state.loads);
        Ok(handle)
    }

    /// Changes a load.
    pub fn set_load(&mut self, load: Handle<Load>, kind: LoadKind) -> Result<(), Error> {
        let rod = self.state.loads.get(load).ok_or(LOAD)?.rod;
        self.validate_load(&kind, self.model.rods.at(rod).ok_or(ROD)?)?;
        if let Some(l) = self.state.loads.get_mut(load) {
            l.kind = kind;
        }
        self.state.interrupt(Onset::Unknown);
        self.model.refresh_masses(&self.state.loads);
        Ok(())
    }

    /// Removes a load.
    pub fn remove_load(&mut self, load: Handle<Load>) -> Result<(), Error> {
        self.state.loads.remove(load).ok_or(LOAD)?;
        self.state.interrupt(Onset::Unknown);
        self.model.refresh_masses(&self.state.loads);
        Ok(())
    }

    /// Sets a reel up.
    pub fn insert_reel(&mut self, spec: &ReelSpec) -> Result<Handle<Reel>, Error> {
        spec.validate()?;
        let (model, state) = (&self.model, &self.state);
        let rod = model.rods.get(spec.rod).ok_or(ROD)?;
        self.validate_law(&spec.law, rod)?;
        if state.reels.iter().any(|(_, r)| r.rod == spec.rod.index && r.at_end == spec.at_end) {
            return Err(Error::invalid("reel", "at_end", spec.at_end, "an end that has no reel yet"));
        }
        let e = if spec.at_end { rod.elements().end - 1 } else { rod.first as usize };
        if model.weld_of[if spec.at_end { e + 1 } else { e }].is_some() {
            return Err(Error::invalid("reel", "at_end", spec.at_end, "an end that is not welded"));
        }
        if !crate::reel::suits(model, rod) {
            return Err(Error::invalid(
                "reel",
                "rod",
                spec.rod,
                "a thread of two elements or more, of one section, straight at rest",
            ));
        }
        let jaw = |g: &GripState| g.rod == spec.rod.index && g.hold == Hold::Jaw && (rod.first + g.index) as usize == e;
        if state.grips.iter().any(|(_, g)| jaw(g)) {
            return Err(Error::invalid("reel", "at_end", spec.at_end, "an end whose last element no jaw holds"));
        }
        let nominal = model.rest_length[e];
        self.state.interrupt(Onset::Unknown);
        let reel = ReelState {
            rod: spec.rod.index,
            at_end: spec.at_end,
            law: spec.law,
            supply: spec.supply,
            nominal,
            fed: 0.0,
            added: 0,
        };
        Ok(self.state.reels.insert(reel))
    }

    /// Changes what a reel does, from the next step on.
    pub fn set_reel(&mut self, reel: Handle<Reel>, law: ReelLaw) -> Result<(), Error> {
        law.validate()?;
        let rod = self.state.reels.get(reel).ok_or(REEL)?.rod;
        self.validate_law(&law, self.model.rods.at(rod).ok_or(ROD)?)?;
        self.state.reels.get_mut(reel).ok_or(REEL)?.law = law;
        Ok(())
    }

    /// Length that a reel has fed in, less what it has drawn back \[m\].
    pub fn reel_fed(&self, reel: Handle<Reel>) -> Result<f64, Error> {
        self.state.reels.get(reel).map(|r| r.fed).ok_or(REEL)
    }

    fn validate_law(&self, law: &ReelLaw, rod: &RodModel) -> Result<(), Error> {
        law.validate()?;
        if matches!(law, ReelLaw::Brake(_)) && rod.stretch == Stretch::Inextensible {
            return Err(Error::invalid("reel", "law", law, "a rate, for a thread that does not stretch"));
        }
        Ok(())
    }

    fn validate_load(&self, kind: &LoadKind, rod: &RodModel) -> Result<(), Error> {
        kind.validate()?;
        match kind {
            LoadKind::Point { place, .. } | LoadKind::Mass { place, .. } => place.validate("load", &self.model, rod),
            LoadKind::Uniform { .. } => Ok(()),
        }
    }

    /// Force with which threads act on a shape, at the last accepted substep, torque about its origin.
    pub fn shape_wrench(&self, shape: Handle<Shape>) -> Result<Wrench, Error> {
        self.model.shapes.get(shape).ok_or(SHAPE)?;
        let origin = self.state.shape_pose[shape.index()].position;
        let mut sum = Wrench::default();
        for c in self.state.shape_contacts.iter().filter(|c| c.shape == shape.index) {
            let e = c.element as usize;
            let x = self.state.position[e].lerp(self.state.position[e + 1], c.s);
            let surface = x - c.normal * self.radius_of(e);
            let force = -(c.normal * c.normal_force + c.friction);
            sum.force += force;
            sum.torque += (surface - origin).cross(force);
        }
        Ok(sum)
    }

    fn radius_of(&self, e: usize) -> f64 {
        self.model.rods.at(self.model.rod_of[e]).map_or(0.0, |r| r.radius)
    }

    /// Reads a thread.
    pub fn rod(&self, rod: Handle<Rod>) -> Result<RodView<'_>, Error> {
        self.model.rods.get(rod).ok_or(ROD)?;
        self.view().rod_at(rod.index).ok_or(ROD)
    }
    /// Reads a shape.
    pub fn shape(&self, shape: Handle<Shape>) -> Result<ShapeView<'_>, Error> {
        let s = self.model.shapes.get(shape).ok_or(SHAPE)?;
        Ok(ShapeView {
            geometry: &s.geometry,
            pose: self.state.shape_pose[shape.index()],
            motion: s.motion,
            surface: s.surface,
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
    /// Reads everything.
    pub fn view(&self) -> View<'_> {
        View { model: &self.model, state: &self.state }
    }

    /// Contacts that carry force, at the last accepted substep.
    pub fn contacts(&self) -> impl Iterator<Item = ContactView> + '_ {
        let place = |e: u32| {
            let slot = self.model.rod_of[e as usize];
            (slot as usize, (e - self.model.rods.at(slot).map_or(0, |r| r.first)) as usize)
        };
        let point = |e: u32, s: f64| self.state.position[e as usize].lerp(self.state.position[e as usize + 1], s);
        let threads = self.state.thread_contacts.iter().filter(|c| c.normal_force > 0.0).map(move |c| {
            let (rod, element) = place(c.b);
            ContactView {
                a: place(c.a),
                b: ContactWith::Thread(rod, element, c.t),
                s: c.s,
                point: point(c.a, c.s),
                normal: c.normal,
                force: c.normal * c.normal_force + c.friction,
                sliding: c.sliding,
            }
        });
        let shapes = self.state.shape_contacts.iter().filter(|c| c.normal_force > 0.0).map(move |c| ContactView {
            a: place(c.element),
            b: ContactWith::Shape(c.shape as usize),
            s: c.s,
            point: point(c.element, c.s),
            normal: c.normal,
            force: c.normal * c.normal_force + c.friction,
            sliding: c.sliding,
        });
        threads.chain(shapes)
    }

    /// What lies in each other now, each place once, threads first: where, how deep, and whether contact can part it.
    /// What neighbors along a thread or through a weld is left out, and so is what overlaps by less than a tenth of a
    /// diameter, as loaded contacts and arcs cut into chords do. The first step after [`World::insert_rod`] and
    /// [`World::insert_shape`] says it of what was inserted ([`IncidentKind::Overlap`]).
    pub fn overlaps(&self) -> Vec<Overlap> {
        crate::collide::overlap::overlaps(&self.model, &self.state)
    }

    /// Simulated time \[s\].
    pub fn time(&self) -> f64 {
        self.state.time
    }

    /// Advances by `dt` \[s\], cut into substeps. Never fails: see the report.
    pub fn step(&mut self, dt: f64) -> StepReport {
        self.step_with(dt, &mut |_| {})
    }

    /// The same; `observe` sees every accepted substep (an audit, a recorder), and once more the state before one for
    /// which elements at a reel were cut or joined.
    pub fn step_with(&mut self, dt: f64, observe: &mut dyn FnMut(View<'_>)) -> StepReport {
        let start = self.state.time;
        let mut report = StepReport { time: start, ..StepReport::default() };
        if !(dt.is_finite() && dt > 0.0) {
            report.incidents.push(Incident {
                time: start,
                kind: IncidentKind::BadInput { what: "the time step is not a finite number > 0" },
            });
            return report;
        }
        if dt / self.model.settings.substep > MOST_SUBSTEPS {
            report.incidents.push(Incident {
                time: start,
                kind: IncidentKind::BadInput { what: "the time step is more than a million substeps" },
            });
            return report;
        }
        let placed = core::mem::take(&mut self.model.placed);
        self.report_overlaps(&placed, &mut report);
        let teleported = self.report_teleports(dt, &mut report);
        let interval = &mut Interval { start, length: dt, observe };
        let World { model, state, scratch, .. } = self;
        match model.settings.solver {
            Solver::Direct => Step { model, state, scratch, interval, report: &mut report }.run(),
            Solver::Paper(p) => crate::pbd::step(model, state, &mut scratch.paper, interval, &p, &mut report),
        }
        report.time = self.state.time;
        self.work += report.work;
        self.report_overlaps(&teleported, &mut report);
        if self.model.settings.solver == Solver::Direct {
            report.contacts = self.contacts().count() as u32;
        }
        report.length_error = self.length_error();
        report
    }

    /// What was put where something is already is told; contact does with it what it can.
    fn report_overlaps(&self, placed: &Placed, report: &mut StepReport) {
        if placed.rods.is_empty() && placed.shapes.is_empty() {
            return;
        }
        let put = |rod: Handle<Rod>| placed.rods.contains(&rod.index);
        let one = |o: &Overlap| match o.with {
            OverlapWith::Rod { rod, .. } => put(o.rod) || put(rod),
            OverlapWith::Shape(shape) => put(o.rod) || placed.shapes.contains(&shape.index),
        };
        let time = report.time;
        report
            .incidents
            .extend(self.overlaps().into_iter().filter(one).map(|o| Incident { time, kind: IncidentKind::Overlap(o) }));
    }

    /// A driven thing that is to move farther in a step than at 100 m/s was placed there, not moved.
    fn report_teleports(&self, dt: f64, report: &mut StepReport) -> Placed {
        const FASTEST: f64 = 100.0;
        let mut placed = Placed::default();
        let mut tell = |distance: f64| {
            let far = distance > FASTEST * dt;
            if far {
                report.incidents.push(Incident { time: report.time, kind: IncidentKind::Teleport { distance } });
            }
            far
        };
        // What a force moves has no target; the one that it had stays behind.
        for (_, g) in self.state.grips.iter().filter(|(_, g)| g.drive == Drive::Pose) {
            if tell((g.target.position - g.pose.position).length()) {
                placed.rods.push(g.rod);
            }
        }
        for (slot, _) in self.model.shapes.iter().filter(|(_, s)| s.motion == ShapeMotion::Driven) {
            let k = slot as usize;
            if tell((self.state.shape_target[k].position - self.state.shape_pose[k].position).length()) {
                placed.shapes.push(slot);
            }
        }
        placed
    }

    fn length_error(&self) -> f64 {
        let mut worst = 0.0f64;
        for (_, rod) in self.model.rods.iter() {
            for e in rod.elements() {
                let strain =
                    (self.state.position[e + 1] - self.state.position[e]).length() / self.model.rest_length[e] - 1.0;
                let want =
                    if self.model.inextensible[e] { 0.0 } else { self.state.tension[e] / self.model.section[e].ea };
                worst = worst.max((strain - want).abs());
            }
        }
        worst
    }

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
        let Snapshot { materials, build, state } = crate::snapshot::read(bytes)?;
        let refused = |reason: &str| Error::Snapshot { reason: reason.into() };
        if let Some(reason) = build.and_then(|there| Build::of(&self.model, &self.state).unlike(&there)) {
            return Err(Error::Snapshot { reason });
        }
        crate::reel::check(&self.model, &self.state, &state).map_err(refused)?;
        crate::reel::check_lengths(&self.model, &self.state, &state).map_err(|reason| Error::Snapshot { reason })?;
        let before = self.state.clone();
        crate::reel::refit(&mut self.model, &before, &state);
        let fits = self.check_fit(&state);
        if fits.is_ok() {
            self.take_up(&state);
            if materials.is_some_and(|m| m != crate::snapshot::made_of(&self.model)) {
                self.state.interrupt(Onset::Unknown);
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
        self.model.refresh_masses(&self.state.loads);
    }

    /// Whether a state read from outside belongs to this model and is usable.
    fn check_fit(&self, s: &State) -> Result<(), &'static str> {
        let n = self.model.mass.len();
        let lengths = [
            s.rest_length.len(),
            s.position.len(),
            s.velocity.len(),
            s.orientation.len(),
            s.angular_velocity.len(),
            s.tension.len(),
            s.plastic.len(),
            s.hardened.len(),
        ];
        if lengths.iter().any(|l| *l != n) {
            return Err("it is of a world with other threads");
        }
        if s.weld_orientation.len() != self.model.welds.len() {
            return Err("it is of a world with other welds");
        }
        let known = if s.onset == Onset::Smooth { n } else { 0 };
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
        let forces = |normal: DVec3, normal_force: f64, friction: DVec3| {
            (normal.length() - 1.0).abs() < 1e-6 && normal_force.is_finite() && friction.is_finite()
        };
        let threads = s.thread_contacts.iter().all(|c| {
            element(c.a)
                && element(c.b)
                && c.a < c.b
                && place(c.s)
                && place(c.t)
                && forces(c.normal, c.normal_force, c.friction)
                && c.drift.is_finite()
        });
        let shapes = s.shape_contacts.iter().all(|c| {
            element(c.element)
                && self.model.shapes.at(c.shape).is_some()
                && place(c.s)
                && forces(c.normal, c.normal_force, c.friction)
                && c.drift.is_finite()
        });
        if !(threads && shapes) {
            return Err("a contact is out of range");
        }
        Ok(())
    }

    /// 64-bit hash of the state; equal bits, equal hash, on any machine.
    pub fn state_hash(&self) -> u64 {
        crate::snapshot::hash(&self.state)
    }

    pub(crate) fn into_parts(self) -> (Model, State) {
        (self.model, self.state)
    }

    /// Drops the working memory. Nothing that follows changes by a bit; the next step allocates again.
    pub fn forget_scratch(&mut self) {
        self.scratch = Scratch::default();
    }
}
