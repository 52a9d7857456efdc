//! The world: what a user builds, steps and reads. Handles become indices here and nowhere else.

mod bodies;
mod cuts;
mod holds;
mod instruments;
mod joints;
mod rods;
mod saved;
mod shapes;
mod welds;

use crate::attempt::Step;
use crate::collide::overlap::{Overlap, OverlapWith};
use crate::drive::Interval;
use crate::error::{Error, check};
use crate::handle::Handle;
use crate::model::grip::Drive;
use crate::model::rod::Rod;
use crate::model::shape::ShapeMotion;
use crate::model::{Model, Placed};
use crate::params::{Friction, Settings, Solver};
use crate::report::{Incident, IncidentKind, StepReport};
use crate::scratch::Scratch;
use crate::state::{History, State};
use crate::view::{ContactView, View};
use glam::DVec3;

/// Threads, bodies, shapes, grips and loads that move together.
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
const BODY: Error = Error::StaleHandle { what: "body" };
const JOINT: Error = Error::StaleHandle { what: "joint" };
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
        self.state.invalidate(History::Unknown);
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
        self.state.invalidate(History::Unknown);
        Ok(())
    }

    /// Friction between two surfaces: what was set for them, or the default of the settings.
    pub fn friction(&self, a: u32, b: u32) -> Friction {
        self.model.friction_between(a, b)
    }

    /// Reads everything.
    pub fn view(&self) -> View<'_> {
        View { model: &self.model, state: &self.state }
    }

    /// Contacts that carry force, at the last accepted substep: those of threads with threads, those of threads
    /// with shapes, then those of bodies.
    pub fn contacts(&self) -> impl Iterator<Item = ContactView> + '_ {
        self.view().contacts()
    }

    /// What lies in each other now, each place once, threads first: where, how deep, and whether contact can part it.
    /// Bodies that lie in each other or in shapes are not looked at: they are parted within a few substeps.
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
        self.detach(&mut report);
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

    pub(crate) fn into_parts(self) -> (Model, State) {
        (self.model, self.state)
    }

    /// Drops the working memory. Nothing that follows changes by a bit; the next step allocates again.
    pub fn forget_scratch(&mut self) {
        self.scratch = Scratch::default();
    }
}
