//! Reading a world: slices of its arrays, and what is derived from them. The same views are given to an observer of
//! accepted substeps.

use crate::math::{Pose, log};
use crate::model::Model;
use crate::model::body::{BodyModel, MassProperties};
use crate::model::cut::Faces;
use crate::model::joint::{Along, JointKind, JointModel, Meeting};
use crate::model::material::{Material, SectionStiffness};
use crate::model::rod::{RodModel, Stretch};
use crate::model::section::{Profile, Section};
use crate::model::shape::{Geometry, ShapeMotion};
use crate::model::weld::{WeldModel, rest_across};
use crate::rod::energy::{Energy, energy};
use crate::state::{BodyState, JointState, Moved, Site, State, places_of};
use glam::{DQuat, DVec3};

/// All that can be read at one accepted state.
#[derive(Clone, Copy)]
pub struct View<'a> {
    pub(crate) model: &'a Model,
    pub(crate) state: &'a State,
}

/// One thread at one accepted state.
#[derive(Clone, Copy)]
pub struct RodView<'a> {
    model: &'a Model,
    state: &'a State,
    rod: &'a RodModel,
    slot: u32,
}

/// One shape at one accepted state.
#[derive(Debug, Clone, Copy)]
pub struct ShapeView<'a> {
    /// Geometry in its own frame.
    pub geometry: &'a Geometry,
    /// Where it is.
    pub pose: Pose,
    /// What moves it.
    pub motion: ShapeMotion,
    /// Its surface for friction.
    pub surface: u32,
    /// Slot of the body that it is part of ([`BodyView::slot`]), if it is of one.
    pub body: Option<usize>,
    /// Its slot, unique among living shapes ([`Handle::index`](crate::Handle::index)).
    pub slot: usize,
}

/// Places of threads that are joined, at one accepted state.
#[derive(Clone, Copy)]
pub struct WeldView<'a> {
    weld: &'a WeldModel,
    force: DVec3,
    /// Its point and cross-section, `world_from_weld`.
    pub pose: Pose,
    /// Its slot, unique among living welds ([`Handle::index`](crate::Handle::index)).
    pub slot: usize,
}

impl<'a> WeldView<'a> {
    /// The places joined: slot of the thread and particle on it.
    pub fn places(&self) -> impl Iterator<Item = (usize, usize)> + use<'a> {
        self.weld.members.iter().map(|m| (m.rod as usize, m.particle as usize))
    }
    /// The body that it is on, by its slot, and up to which way from the weld elements of its threads do not touch that
    /// \[m\].
    pub fn body(&self) -> Option<(usize, f64)> {
        self.weld.anchor.map(|a| (a.body as usize, a.filter_distance))
    }
    /// Force of its threads on the body that it is on \[N\]; zero where it is on none.
    pub fn force(&self) -> DVec3 {
        self.force
    }
    /// Elements of the joined threads whose way to each other through the weld is shorter than this do not touch \[m\].
    pub fn filter_distance(&self) -> f64 {
        self.weld.filter_distance
    }
}

/// Two ends that a cut made, at one accepted state.
#[derive(Clone, Copy)]
pub struct CutView<'a> {
    model: &'a Model,
    faces: &'a Faces,
}

impl CutView<'_> {
    /// The ends: slot of the thread and particle on it, its first or its last.
    pub fn places(&self) -> [(usize, usize); 2] {
        self.faces.ends.map(|end| (end.rod as usize, end.particle(self.model) as usize))
    }
    /// Elements whose way to each other by these ends is shorter than this do not touch \[m\].
    pub fn filter_distance(&self) -> f64 {
        self.faces.filter_distance
    }
}

/// A contact that carries force.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct ContactView {
    /// The side that the normal points to. Where a thread touches a shape it is the thread.
    pub a: ContactSide,
    /// The other side.
    pub b: ContactSide,
    /// World point of `a` \[m\]; on a thread it is on the centerline.
    pub point: DVec3,
    /// Unit normal, from `b` toward `a`.
    pub normal: DVec3,
    /// Force on `a`, normal and friction \[N\].
    pub force: DVec3,
    /// Whether it slid in the last substep; else it stuck.
    pub sliding: bool,
}

/// What touches, and where.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum ContactSide {
    /// A place on a thread.
    Thread {
        /// Slot of the thread ([`Handle::index`](crate::Handle::index)).
        rod: usize,
        /// Element of the thread.
        element: usize,
        /// Where on the element, 0 at its first particle, 1 at its second.
        s: f64,
    },
    /// A shape.
    Shape {
        /// Slot of the shape ([`Handle::index`](crate::Handle::index)).
        shape: usize,
    },
}

impl ContactSide {
    /// Slot of the thread, element and place on it, where it is one.
    pub fn thread(&self) -> Option<(usize, usize, f64)> {
        if let ContactSide::Thread { rod, element, s } = *self { Some((rod, element, s)) } else { None }
    }
    /// Slot of the shape, where it is one.
    pub fn shape(&self) -> Option<usize> {
        if let ContactSide::Shape { shape } = *self { Some(shape) } else { None }
    }
}

impl<'a> View<'a> {
    /// Simulated time \[s\].
    pub fn time(&self) -> f64 {
        self.state.time
    }
    /// The living threads in slot order.
    pub fn rods(&self) -> impl Iterator<Item = RodView<'a>> + use<'a> {
        let (model, state) = (self.model, self.state);
        model.rods.iter().map(move |(slot, rod)| RodView { model, state, rod, slot })
    }
    /// The living shapes in slot order.
    pub fn shapes(&self) -> impl Iterator<Item = ShapeView<'a>> + use<'a> {
        let (model, state) = (self.model, self.state);
        model.shapes.iter().map(move |(slot, s)| ShapeView {
            geometry: &s.geometry,
            pose: state.shape_pose[slot as usize],
            motion: s.motion,
            surface: s.surface,
            body: s.body.map(|b| b as usize),
            slot: slot as usize,
        })
    }
    /// The living bodies in slot order.
    pub fn bodies(&self) -> impl Iterator<Item = BodyView<'a>> + use<'a> {
        let (bodies, state, gravity) = (&self.model.bodies, self.state, self.model.settings.gravity);
        let view = move |(slot, model)| Some(BodyView { model, state: state.bodies.at(slot)?, gravity, slot });
        bodies.iter().filter_map(view)
    }
    /// The living joints in slot order.
    pub fn joints(&self) -> impl Iterator<Item = JointView<'a>> + use<'a> {
        let (model, state) = (self.model, self.state);
        let view = move |(slot, joint)| Some(JointView { model, state, joint, now: state.joints.at(slot)?, slot });
        model.joints.iter().filter_map(view)
    }
    /// The living welds in slot order.
    pub fn welds(&self) -> impl Iterator<Item = WeldView<'a>> + use<'a> {
        let (model, state) = (self.model, self.state);
        model.welds.iter().map(move |(slot, weld)| {
            let position = state.position[weld.members[0].index(model)];
            let k = slot as usize;
            WeldView { weld, force: state.weld_force[k], pose: Pose::new(position, state.weld_orientation[k]), slot: k }
        })
    }
    /// The cuts whose parts are both in the world, in the order in which they were made.
    pub fn cuts(&self) -> impl Iterator<Item = CutView<'a>> + use<'a> {
        let model = self.model;
        model.faces.iter().map(move |faces| CutView { model, faces })
    }
    /// Contacts that carry force: those of threads with threads, those of threads with shapes, then those of bodies.
    pub fn contacts(&self) -> impl Iterator<Item = ContactView> + use<'a> {
        let (model, state) = (self.model, self.state);
        let side = move |site: Site| match site {
            Site::Thread { element, s } => {
                let rod = model.rod_of[element as usize];
                let first = model.rods.at(rod).map_or(0, |r| r.first);
                ContactSide::Thread { rod: rod as usize, element: (element - first) as usize, s }
            }
            Site::Shape { shape } | Site::Surface { shape, .. } => ContactSide::Shape { shape: shape as usize },
        };
        let point = move |site: Site| match site {
            Site::Thread { element, s } => {
                let e = element as usize;
                state.position[e].lerp(state.position[e + 1], s)
            }
            Site::Shape { shape } => state.shape_pose[shape as usize].position,
            Site::Surface { shape, at } => state.shape_pose[shape as usize].transform_point(at),
        };
        state.contacts.iter().filter(|c| c.normal_force > 0.0).map(move |c| ContactView {
            a: side(c.a),
            b: side(c.b),
            point: point(c.a),
            normal: c.normal,
            force: c.force(),
            sliding: c.sliding,
        })
    }
    pub(crate) fn rod_at(&self, slot: u32) -> Option<RodView<'a>> {
        let (model, state) = (self.model, self.state);
        model.rods.at(slot).map(|rod| RodView { model, state, rod, slot })
    }
}

/// One free body at one accepted state.
#[derive(Clone, Copy)]
pub struct BodyView<'a> {
    model: &'a BodyModel,
    state: &'a BodyState,
    gravity: DVec3,
    slot: u32,
}

impl<'a> BodyView<'a> {
    /// Its slot, unique among living bodies ([`Handle::index`](crate::Handle::index)).
    pub fn slot(&self) -> usize {
        self.slot as usize
    }
    /// Where its frame is, `world_from_body`.
    pub fn pose(&self) -> Pose {
        let mass = &self.model.mass;
        Pose::new(self.state.position, self.state.orientation).compose(&Pose::new(mass.center, mass.axes).inverse())
    }
    /// Whether it is driven: nothing else moves it then.
    pub fn is_driven(&self) -> bool {
        matches!(self.state.motion, Moved::Driven { .. })
    }
    /// Slot of the body that holds it, if one does.
    pub fn held_by(&self) -> Option<usize> {
        if let Moved::Held { by, .. } = self.state.motion { Some(by as usize) } else { None }
    }
    /// Its mass properties.
    pub fn mass(&self) -> MassProperties {
        self.model.mass
    }
    /// Its center of mass in the world \[m\].
    pub fn center(&self) -> DVec3 {
        self.state.position
    }
    /// Velocity of its center of mass \[m/s\].
    pub fn velocity(&self) -> DVec3 {
        self.state.velocity
    }
    /// Angular velocity in world axes \[rad/s\].
    pub fn angular_velocity(&self) -> DVec3 {
        self.state.spin(self.model.mass.moments)
    }
    /// Linear momentum \[kg m/s\].
    pub fn momentum(&self) -> DVec3 {
        self.state.velocity * self.model.mass.mass
    }
    /// Angular momentum about its center of mass, in world axes \[N m s\].
    pub fn angular_momentum(&self) -> DVec3 {
        self.state.angular_momentum
    }
    /// Mechanical energy: of motion and spin, and in the gravity field.
    pub fn energy(&self) -> Energy {
        let (mass, v) = (self.model.mass.mass, self.state.velocity);
        let kinetic = 0.5 * mass * v.length_squared() + 0.5 * self.angular_velocity().dot(self.state.angular_momentum);
        Energy { kinetic, gravity: -mass * self.gravity.dot(self.state.position), ..Energy::default() }
    }
    /// Slots of its shapes ([`ShapeView::slot`]).
    pub fn shapes(&self) -> impl Iterator<Item = usize> + use<'a> {
        self.model.shapes.iter().map(|(slot, _)| *slot as usize)
    }
}

/// One joint of bodies at one accepted state.
#[derive(Clone, Copy)]
pub struct JointView<'a> {
    model: &'a Model,
    state: &'a State,
    joint: &'a JointModel,
    now: &'a JointState,
    slot: u32,
}

impl JointView<'_> {
    /// Its slot, unique among living joints ([`Handle::index`](crate::Handle::index)).
    pub fn slot(&self) -> usize {
        self.slot as usize
    }
    /// What it leaves free.
    pub fn kind(&self) -> JointKind {
        self.joint.kind
    }
    /// Slots of the bodies that it joins; `None` is the world.
    pub fn bodies(&self) -> [Option<usize>; 2] {
        self.joint.bodies.map(|b| b.map(|slot| slot as usize))
    }
    /// Its frame on each side, `world_from_joint`. They meet, but for what the joint leaves free and its compliance.
    pub fn frames(&self) -> [Pose; 2] {
        self.meeting().frames
    }
    /// Angle of a hinge \[rad\], whole turns counted since it was put in, or way of a slider \[m\]; of the others 0.
    pub fn coordinate(&self) -> f64 {
        self.now.coordinate
    }
    /// Rate of the coordinate \[rad/s\], \[m/s\].
    pub fn rate(&self) -> f64 {
        let rates = self.joint.bodies.map(|b| {
            b.and_then(|slot| View { model: self.model, state: self.state }.bodies().find(|b| b.slot == slot))
                .map_or([DVec3::ZERO; 2], |b| [b.velocity(), b.angular_velocity()])
        });
        self.joint.kind.axis().map_or(0.0, |along| self.meeting().rate(along, rates))
    }
    /// Force of the joint on its second side, in world axes, at the origin of its second frame \[N\]: of all that it
    /// does. The first side has the opposite one, at the same place.
    pub fn force(&self) -> DVec3 {
        self.in_world(self.now.force, |along| matches!(along, Along::Way(_)))
    }
    /// Torque of the joint on its second side about the origin of its second frame, in world axes \[N m\].
    pub fn torque(&self) -> DVec3 {
        self.in_world(self.now.torque, |along| matches!(along, Along::Turn(_)))
    }
    /// Of that along its axis what the motor does \[N m\], \[N\].
    pub fn motor_force(&self) -> f64 {
        self.now.drive[0]
    }
    /// What friction does.
    pub fn friction_force(&self) -> f64 {
        self.now.drive[1]
    }
    /// What a limit does, positive at the lower one.
    pub fn limit_force(&self) -> f64 {
        self.now.stop
    }
    fn in_world(&self, held: DVec3, is: impl Fn(Along) -> bool) -> DVec3 {
        let along = if self.joint.kind.axis().is_some_and(is) {
            self.now.drive[0] + self.now.drive[1] + self.now.stop
        } else {
            0.0
        };
        self.meeting().frames[0].orientation * (held + DVec3::Z * along)
    }
    fn meeting(&self) -> Meeting {
        self.joint.meeting(places_of(&self.state.bodies))
    }
}

impl<'a> RodView<'a> {
    /// Its slot, unique among living threads ([`Handle::index`](crate::Handle::index)).
    pub fn slot(&self) -> usize {
        self.slot as usize
    }
    /// Number of elements n; there are n + 1 particles and n - 1 joints. A closed thread's last particle is at its
    /// first, and it has n joints.
    pub fn n_elements(&self) -> usize {
        self.rod.n_elements as usize
    }
    /// How often its particles were numbered from another one on: where a ring is cut.
    pub(crate) fn turned(&self) -> u32 {
        self.rod.turned
    }
    /// Whether its end is joined to its start.
    pub fn is_closed(&self) -> bool {
        let particles = self.rod.particles();
        let seam = self.model.weld_of[particles.start];
        seam.is_some() && seam == self.model.weld_of[particles.end - 1]
    }
    /// Number of joints between its elements.
    pub fn n_joints(&self) -> usize {
        self.n_elements() - usize::from(!self.is_closed())
    }
    /// What it is made of.
    pub fn material(&self) -> &'a Material {
        &self.rod.material
    }
    /// Whether it stretches.
    pub fn stretch(&self) -> Stretch {
        self.rod.stretch
    }
    /// Its surface for friction.
    pub fn surface(&self) -> u32 {
        self.rod.surface
    }
    /// Radius with which it touches \[m\].
    pub fn radius(&self) -> f64 {
        self.rod.radius
    }
    /// Shape of the cross-section where its size is 1.
    pub fn cross_section(&self) -> Section {
        self.rod.section
    }
    /// Radius of a round section where its size is 1 \[m\].
    pub fn section_radius(&self) -> f64 {
        self.rod.section_radius
    }
    /// Factor on the size of the section along the thread.
    pub fn size(&self) -> &'a Profile {
        &self.rod.size
    }
    /// Of a closed thread, the turn about d3 at rest from its last frame to its first \[rad\], between -pi and pi.
    pub fn seam_turn(&self) -> Option<f64> {
        self.seam_rest().map(about_third)
    }
    /// Axial stiffness E A of an element \[N\].
    pub fn axial_stiffness(&self, element: usize) -> f64 {
        self.section(element).ea
    }
    /// Bending stiffness E I about d1 and d2 and twisting stiffness G J of an element, bending scale included \[N
    /// m^2\].
    pub fn bending_stiffness(&self, element: usize) -> DVec3 {
        self.section(element).bend
    }
    /// Mass per rest length of an element, without what is attached \[kg/m\].
    pub fn mass_per_length(&self, element: usize) -> f64 {
        self.section(element).mass
    }
    fn section(&self, element: usize) -> &SectionStiffness {
        &self.model.section[self.rod.elements()][element]
    }
    /// Particle positions \[m\], n + 1.
    pub fn positions(&self) -> &'a [DVec3] {
        &self.state.position[self.rod.particles()]
    }
    /// Particle velocities \[m/s\], n + 1.
    pub fn velocities(&self) -> &'a [DVec3] {
        &self.state.velocity[self.rod.particles()]
    }
    /// Material frames, `world_from_material`, n.
    pub fn orientations(&self) -> &'a [DQuat] {
        &self.state.orientation[self.rod.elements()]
    }
    /// Angular velocities in world axes \[rad/s\], n.
    pub fn angular_velocities(&self) -> &'a [DVec3] {
        &self.state.angular_velocity[self.rod.elements()]
    }
    /// Rest lengths of the elements \[m\], n.
    pub fn rest_lengths(&self) -> &'a [f64] {
        &self.model.rest_length[self.rod.elements()]
    }
    /// Rest length of the thread \[m\].
    pub fn rest_length(&self) -> f64 {
        self.rest_lengths().iter().sum()
    }
    /// Rest arc length of a particle from the start \[m\].
    pub fn arc(&self, particle: usize) -> f64 {
        self.rest_lengths()[..particle].iter().sum()
    }
    /// Tension in an element \[N\], positive when stretched.
    pub fn tension(&self, element: usize) -> f64 {
        self.internal_force(element).z
    }
    /// Force carried by an element along its directors d1, d2 (shear) and d3 (tension) \[N\].
    pub fn internal_force(&self, element: usize) -> DVec3 {
        crate::rod::internal_force(self.model, self.state, self.rod, self.rod.first as usize + element)
    }
    /// Bend and twist of a joint (between elements `joint` and `joint + 1`; that of a closed thread's seam is the last)
    /// less its rest value, along d1, d2, d3 of the frame halfway \[1/m\].
    pub fn strain(&self, joint: usize) -> DVec3 {
        let f = self.rod.first as usize + joint + 1;
        if self.model.weld_of[f].is_none() {
            return crate::rod::joint_angle(self.model, self.state, f) / self.model.joint_length[f];
        }
        let length = 0.5 * (self.rest_lengths()[joint] + self.rest_lengths()[(joint + 1) % self.n_elements()]);
        crate::rod::welded_joint(self.model, self.state, self.rod, f).map(|(angle, _)| angle).sum::<DVec3>() / length
    }
    /// Elastic bending (components 1, 2) and twisting (3) moment carried by a joint \[N m\], at a weld the mean of both
    /// sides. Damping is not part of it.
    pub fn moment(&self, joint: usize) -> DVec3 {
        let f = self.rod.first as usize + joint + 1;
        if self.model.weld_of[f].is_none() {
            return crate::rod::joint_angle(self.model, self.state, f) * self.model.bend_stiffness[f];
        }
        crate::rod::welded_joint(self.model, self.state, self.rod, f)
            .map(|(angle, stiffness)| angle * stiffness * 0.5)
            .sum()
    }
    /// Largest |length - rest length| / rest length of an element.
    pub fn max_elongation(&self) -> f64 {
        self.elongations().fold(0.0, |a, e| if e.abs() > a { e.abs() } else { a })
    }
    /// (length - rest length) / rest length of each element.
    pub fn elongations(&self) -> impl Iterator<Item = f64> + use<'a> {
        let (x, l) = (self.positions(), self.rest_lengths());
        l.iter().enumerate().map(move |(j, l)| ((x[j + 1] - x[j]).length() - l) / l)
    }
    /// Largest tension of an element \[N\].
    pub fn max_tension(&self) -> f64 {
        (0..self.n_elements()).map(|j| self.tension(j)).fold(f64::NEG_INFINITY, f64::max)
    }
    /// Mean tension \[N\] of the thread between two rest arc lengths \[m\]; `None` when none of it lies between them.
    pub fn mean_tension(&self, from: f64, to: f64) -> Option<f64> {
        let (mut arc, mut length, mut sum) = (0.0, 0.0, 0.0);
        for (j, l) in self.rest_lengths().iter().enumerate() {
            let inside = (to.min(arc + l) - from.max(arc)).max(0.0);
            if inside > 0.0 {
                sum += inside * self.tension(j);
                length += inside;
            }
            arc += l;
        }
        (length > 0.0).then(|| sum / length)
    }
    /// Twist Tw of the material frames about the centerline, in turns (angle by parallel transport, so that Tw + Wr is
    /// kept). At the seam of a closed thread the twist at rest does not count, so that it is what was put in before
    /// closing.
    pub fn twist(&self) -> f64 {
        let q = self.orientations();
        let mut angle = 0.0;
        for j in 1..q.len() {
            let (t0, t1) = (q[j - 1] * DVec3::Z, q[j] * DVec3::Z);
            let carried = crate::math::rotation_arc(t0, t1) * q[j - 1];
            angle += log(carried.conjugate() * q[j]).z;
        }
        if let Some(rest) = self.seam_rest() {
            let (last, first) = (q[q.len() - 1], q[0]);
            let carried = crate::math::rotation_arc(last * DVec3::Z, first * DVec3::Z) * last;
            angle += log(crate::math::exp(DVec3::Z * (about_third(carried.conjugate() * first) - about_third(rest)))).z;
        }
        angle / core::f64::consts::TAU
    }
    /// Rest rotation from the last frame of a closed thread to its first.
    fn seam_rest(&self) -> Option<DQuat> {
        let weld = self.model.welds.at(self.model.weld_of[self.rod.first as usize].filter(|_| self.is_closed())?)?;
        rest_across(&weld.members, (self.slot, self.rod.n_elements), (self.slot, 0))
    }
    /// Mechanical energy of this thread.
    pub fn energy(&self) -> Energy {
        energy(self.model, self.state, self.rod)
    }
    /// Linear momentum \[kg m/s\].
    pub fn momentum(&self) -> DVec3 {
        self.rod.particles().map(|i| self.state.velocity[i] * self.model.mass[i]).sum()
    }
}

/// Of a rotation, the part about the third director \[rad\].
fn about_third(q: DQuat) -> f64 {
    log(DQuat::from_xyzw(0.0, 0.0, q.z, q.w).normalize()).z
}
