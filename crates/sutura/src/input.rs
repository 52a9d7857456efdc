//! What was done to a world, as data: every insertion, grip, pose, drive, load and step in order, with the state hash
//! after each step. Done again, in another build or on another machine, the same inputs give the same hash after every
//! step; where they do not, the first step that differs is known.
//!
//! A [`Recorder`] is a world that writes down what is done to it. A [`Recording`] can be written, read and replayed.
//! Its inputs are in order and each step has its length, so what a user does by hand is recorded as well as what a
//! scene does: a grip inserted, its poses from step to step, its removal.

use crate::error::Error;
use crate::handle::Handle;
use crate::math::Pose;
use crate::model::body::{Body, BodyMotion, BodySpec, ColliderSpec};
use crate::model::cut::Cut;
use crate::model::grip::{Drive, Grip, GripSpec, Load, LoadKind, LoadSpec, Place};
use crate::model::instrument::{Instrument, InstrumentSpec};
use crate::model::joint::{Joint, JointKind, JointModel, JointSpec, Motor};
use crate::model::material::{Material, Plasticity, Shear};
use crate::model::reel::{Reel, ReelLaw, ReelSpec};
use crate::model::rod::{Closure, RestShape, Rod, RodSpec, Stretch};
use crate::model::section::{Along, Profile, Section};
use crate::model::shape::{Geometry, Shape, ShapeMotion, ShapeSpec};
use crate::model::weld::{Weld, WeldAnchor, WeldRest, WeldSpec};
use crate::params::{Friction, Integrator, PaperSettings, Settings, Solver, SweepOrder};
use crate::report::StepReport;
use crate::snapshot::{Bytes, Reader, damaged, structure, variants};
use crate::view::View;
use crate::world::World;
use core::ops::{ControlFlow, Deref};

/// Something done to a world: one call of a method of [`World`] that changes it.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum Input {
    /// [`World::set_settings`].
    Settings(Settings),
    /// [`World::set_friction`].
    Friction(u32, u32, Friction),
    /// [`World::insert_rod`].
    InsertRod(RodSpec),
    /// [`World::remove_rod`].
    RemoveRod(Handle<Rod>),
    /// [`World::cut`].
    Cut(Handle<Rod>, Place),
    /// [`World::set_material`].
    SetMaterial(Handle<Rod>, Material),
    /// [`World::set_stretch`].
    SetStretch(Handle<Rod>, Stretch),
    /// [`World::insert_shape`].
    InsertShape(ShapeSpec),
    /// [`World::remove_shape`].
    RemoveShape(Handle<Shape>),
    /// [`World::set_shape_pose`].
    ShapePose(Handle<Shape>, Pose),
    /// [`World::set_shape_motion`].
    ShapeMotion(Handle<Shape>, ShapeMotion),
    /// [`World::insert_grip`].
    InsertGrip(GripSpec),
    /// [`World::remove_grip`].
    RemoveGrip(Handle<Grip>),
    /// [`World::set_grip_pose`].
    GripPose(Handle<Grip>, Pose),
    /// [`World::set_grip_drive`].
    GripDrive(Handle<Grip>, Drive),
    /// [`World::insert_load`].
    InsertLoad(LoadSpec),
    /// [`World::set_load`].
    SetLoad(Handle<Load>, LoadKind),
    /// [`World::remove_load`].
    RemoveLoad(Handle<Load>),
    /// [`World::insert_weld`].
    InsertWeld(WeldSpec),
    /// [`World::remove_weld`].
    RemoveWeld(Handle<Weld>),
    /// [`World::insert_reel`].
    InsertReel(ReelSpec),
    /// [`World::set_reel`].
    SetReel(Handle<Reel>, ReelLaw),
    /// [`World::restore`].
    Restore(Vec<u8>),
    /// [`World::set_step_work`].
    StepWork(Option<f64>),
    /// [`World::insert_body`].
    InsertBody(BodySpec),
    /// [`World::remove_body`].
    RemoveBody(Handle<Body>),
    /// [`World::set_body_motion`].
    BodyMotion(Handle<Body>, BodyMotion),
    /// [`World::set_body_pose`].
    BodyPose(Handle<Body>, Pose),
    /// [`World::insert_joint`].
    InsertJoint(JointSpec),
    /// [`World::remove_joint`].
    RemoveJoint(Handle<Joint>),
    /// [`World::set_joint_motor`].
    JointMotor(Handle<Joint>, Option<Motor>),
    /// [`World::step`] by a time \[s\], and the state hash that it left.
    Step(f64, u64),
}

impl Input {
    /// Does it. A step gives its report; whether the hash is that of the recording is for the caller to see.
    pub fn apply(&self, world: &mut World) -> Result<Option<StepReport>, Error> {
        match self {
            Input::Settings(settings) => world.set_settings(settings.clone())?,
            Input::Friction(a, b, friction) => world.set_friction(*a, *b, *friction)?,
            Input::InsertRod(spec) => drop(world.insert_rod(spec)?),
            Input::RemoveRod(rod) => world.remove_rod(*rod)?,
            Input::Cut(rod, place) => drop(world.cut(*rod, *place)?),
            Input::SetMaterial(rod, material) => world.set_material(*rod, material)?,
            Input::SetStretch(rod, stretch) => world.set_stretch(*rod, *stretch)?,
            Input::InsertShape(spec) => drop(world.insert_shape(spec)?),
            Input::RemoveShape(shape) => world.remove_shape(*shape)?,
            Input::ShapePose(shape, pose) => world.set_shape_pose(*shape, *pose)?,
            Input::ShapeMotion(shape, motion) => world.set_shape_motion(*shape, *motion)?,
            Input::InsertGrip(spec) => drop(world.insert_grip(spec)?),
            Input::RemoveGrip(grip) => world.remove_grip(*grip)?,
            Input::GripPose(grip, pose) => world.set_grip_pose(*grip, *pose)?,
            Input::GripDrive(grip, drive) => world.set_grip_drive(*grip, *drive)?,
            Input::InsertLoad(spec) => drop(world.insert_load(spec)?),
            Input::SetLoad(load, kind) => world.set_load(*load, *kind)?,
            Input::RemoveLoad(load) => world.remove_load(*load)?,
            Input::InsertWeld(spec) => drop(world.insert_weld(spec)?),
            Input::RemoveWeld(weld) => world.remove_weld(*weld)?,
            Input::InsertReel(spec) => drop(world.insert_reel(spec)?),
            Input::SetReel(reel, law) => world.set_reel(*reel, *law)?,
            Input::Restore(bytes) => world.restore(bytes)?,
            Input::InsertBody(spec) => drop(world.insert_body(spec)?),
            Input::RemoveBody(body) => world.remove_body(*body)?,
            Input::BodyMotion(body, motion) => world.set_body_motion(*body, *motion)?,
            Input::BodyPose(body, pose) => world.set_body_pose(*body, *pose)?,
            Input::InsertJoint(spec) => drop(world.insert_joint(spec)?),
            Input::RemoveJoint(joint) => world.remove_joint(*joint)?,
            Input::JointMotor(joint, motor) => world.set_joint_motor(*joint, *motor)?,
            Input::StepWork(most) => world.set_step_work(*most)?,
            Input::Step(dt, _) => return Ok(Some(world.step(*dt))),
        }
        Ok(None)
    }
}

/// A world that writes down what is done to it, if it is to. It reads as the [`World`] that it holds. What ends in an
/// error changes nothing and is not written down.
pub struct Recorder {
    world: World,
    recording: Option<Recording>,
}

impl Deref for Recorder {
    type Target = World;
    fn deref(&self) -> &World {
        &self.world
    }
}

/// Methods of the world that change it, recorded: name, arguments, and the input that they are.
macro_rules! recorded {
    ($($(#[$doc:meta])* $name:ident($($arg:ident: $t:ty),*) -> $out:ty, $input:expr;)*) => {$(
        $(#[$doc])*
        pub fn $name(&mut self, $($arg: $t),*) -> Result<$out, Error> {
            let input = self.recording.is_some().then(|| $input);
            let out = self.world.$name($($arg),*)?;
            self.note(input);
            Ok(out)
        }
    )*};
}

impl Recorder {
    /// An empty world; everything from here on is recorded, or nothing.
    pub fn new(settings: Settings, record: bool) -> Result<Self, Error> {
        let recording = record.then(|| Recording { inputs: vec![Input::Settings(settings.clone())] });
        Ok(Recorder { world: World::new(settings)?, recording })
    }

    recorded! {
        /// [`World::set_settings`].
        set_settings(settings: Settings) -> (), Input::Settings(settings.clone());
        /// [`World::set_friction`].
        set_friction(a: u32, b: u32, friction: Friction) -> (), Input::Friction(a, b, friction);
        /// [`World::insert_rod`].
        insert_rod(spec: &RodSpec) -> Handle<Rod>, Input::InsertRod(spec.clone());
        /// [`World::remove_rod`].
        remove_rod(rod: Handle<Rod>) -> (), Input::RemoveRod(rod);
        /// [`World::cut`].
        cut(rod: Handle<Rod>, place: Place) -> Cut, Input::Cut(rod, place);
        /// [`World::set_material`].
        set_material(rod: Handle<Rod>, material: &Material) -> (), Input::SetMaterial(rod, material.clone());
        /// [`World::set_stretch`].
        set_stretch(rod: Handle<Rod>, stretch: Stretch) -> (), Input::SetStretch(rod, stretch);
        /// [`World::insert_shape`].
        insert_shape(spec: &ShapeSpec) -> Handle<Shape>, Input::InsertShape(spec.clone());
        /// [`World::remove_shape`].
        remove_shape(shape: Handle<Shape>) -> (), Input::RemoveShape(shape);
        /// [`World::set_shape_pose`].
        set_shape_pose(shape: Handle<Shape>, pose: Pose) -> (), Input::ShapePose(shape, pose);
        /// [`World::set_shape_motion`].
        set_shape_motion(shape: Handle<Shape>, motion: ShapeMotion) -> (), Input::ShapeMotion(shape, motion);
        /// [`World::insert_grip`].
        insert_grip(spec: &GripSpec) -> Handle<Grip>, Input::InsertGrip(spec.clone());
        /// [`World::remove_grip`].
        remove_grip(grip: Handle<Grip>) -> (), Input::RemoveGrip(grip);
        /// [`World::set_grip_pose`].
        set_grip_pose(grip: Handle<Grip>, pose: Pose) -> (), Input::GripPose(grip, pose);
        /// [`World::set_grip_drive`].
        set_grip_drive(grip: Handle<Grip>, drive: Drive) -> (), Input::GripDrive(grip, drive);
        /// [`World::insert_load`].
        insert_load(spec: &LoadSpec) -> Handle<Load>, Input::InsertLoad(spec.clone());
        /// [`World::set_load`].
        set_load(load: Handle<Load>, kind: LoadKind) -> (), Input::SetLoad(load, kind);
        /// [`World::remove_load`].
        remove_load(load: Handle<Load>) -> (), Input::RemoveLoad(load);
        /// [`World::insert_weld`].
        insert_weld(spec: &WeldSpec) -> Handle<Weld>, Input::InsertWeld(spec.clone());
        /// [`World::remove_weld`].
        remove_weld(weld: Handle<Weld>) -> (), Input::RemoveWeld(weld);
        /// [`World::insert_reel`].
        insert_reel(spec: &ReelSpec) -> Handle<Reel>, Input::InsertReel(spec.clone());
        /// [`World::set_reel`].
        set_reel(reel: Handle<Reel>, law: ReelLaw) -> (), Input::SetReel(reel, law);
        /// [`World::insert_body`].
        insert_body(spec: &BodySpec) -> Handle<Body>, Input::InsertBody(spec.clone());
        /// [`World::remove_body`].
        remove_body(body: Handle<Body>) -> (), Input::RemoveBody(body);
        /// [`World::set_body_motion`].
        set_body_motion(body: Handle<Body>, motion: BodyMotion) -> (), Input::BodyMotion(body, motion);
        /// [`World::set_body_pose`].
        set_body_pose(body: Handle<Body>, pose: Pose) -> (), Input::BodyPose(body, pose);
        /// [`World::insert_joint`].
        insert_joint(spec: &JointSpec) -> Handle<Joint>, Input::InsertJoint(spec.clone());
        /// [`World::remove_joint`].
        remove_joint(joint: Handle<Joint>) -> (), Input::RemoveJoint(joint);
        /// [`World::set_joint_motor`].
        set_joint_motor(joint: Handle<Joint>, motor: Option<Motor>) -> (), Input::JointMotor(joint, motor);
        /// [`World::set_step_work`].
        set_step_work(most: Option<f64>) -> (), Input::StepWork(most);
        /// [`World::restore`].
        restore(bytes: &[u8]) -> (), Input::Restore(bytes.to_vec());
    }

    /// [`World::insert_instrument`], recorded as the bodies and the joint that it is.
    pub fn insert_instrument(&mut self, spec: &InstrumentSpec) -> Result<Instrument, Error> {
        let drive = |recorder: &mut Recorder, handle| recorder.set_body_motion(handle, BodyMotion::Driven);
        spec.insert(self, Recorder::insert_body, drive, Recorder::insert_joint)
    }
    /// [`World::close_jaws`].
    pub fn close_jaws(&mut self, instrument: &Instrument, spec: &InstrumentSpec, close: bool) -> Result<(), Error> {
        self.set_joint_motor(instrument.hinge, Some(spec.motor(close)))
    }

    /// [`World::step`].
    pub fn step(&mut self, dt: f64) -> StepReport {
        self.step_with(dt, &mut |_| {})
    }
    /// [`World::step_with`]. Where it records, the state hash is part of its time.
    pub fn step_with(&mut self, dt: f64, observe: &mut dyn FnMut(View<'_>)) -> StepReport {
        let report = self.world.step_with(dt, observe);
        let input = self.recording.is_some().then(|| Input::Step(dt, self.world.state_hash()));
        self.note(input);
        report
    }

    /// [`World::forget_scratch`]: nothing that follows changes by a bit, so it is not recorded.
    pub fn forget_scratch(&mut self) {
        self.world.forget_scratch();
    }

    fn note(&mut self, input: Option<Input>) {
        if let (Some(recording), Some(input)) = (&mut self.recording, input) {
            recording.inputs.push(input);
        }
    }

    /// What was recorded so far; `None` where nothing is.
    pub fn recording(&self) -> Option<&Recording> {
        self.recording.as_ref()
    }
    /// The same, taken out; nothing is recorded from here on.
    pub fn take_recording(&mut self) -> Option<Recording> {
        self.recording.take()
    }
}

/// Everything done to a world from its beginning.
#[derive(Debug, Clone, Default)]
pub struct Recording {
    /// In order.
    pub inputs: Vec<Input>,
}

/// A step that was done again.
pub struct Replayed<'a> {
    /// Number of the step, from 1.
    pub step: usize,
    /// The world after it.
    pub world: &'a World,
    /// What it said.
    pub report: &'a StepReport,
    /// State hash when it was recorded.
    pub recorded: u64,
    /// State hash now.
    pub found: u64,
}

impl Replayed<'_> {
    /// Whether the state is the one that was recorded.
    pub fn is_same(&self) -> bool {
        self.recorded == self.found
    }
}

/// First bytes of a recording: name and version. Version 5 is the same without the inputs 24 and above, version 4 also
/// without the input 23, version 3 also without drag and without [`ShapeSpec::open`], version 2 also without the inputs
/// 21 and 22.
const MAGIC: &[u8; 8] = b"SUTURAIN";
const VERSION: u32 = 6;
const OLDEST: u32 = 2;

impl Recording {
    /// Does everything again in a world of its own; `watch` sees it after every step and may stop there. An error is
    /// that of an input that this build does not take.
    pub fn replay(&self, watch: &mut dyn FnMut(&Replayed<'_>) -> ControlFlow<()>) -> Result<World, Error> {
        let mut world = World::default();
        let mut step = 0;
        for input in &self.inputs {
            let report = input.apply(&mut world)?;
            if let (Some(report), Input::Step(_, recorded)) = (report, input) {
                step += 1;
                let replayed =
                    Replayed { step, world: &world, report: &report, recorded: *recorded, found: world.state_hash() };
                if watch(&replayed).is_break() {
                    break;
                }
            }
        }
        Ok(world)
    }

    /// The first input in which two recordings differ, by its number; where one ends before the other, the end of the
    /// shorter.
    pub fn first_difference(&self, other: &Recording) -> Option<usize> {
        let bytes = |input: &Input| {
            let mut out = Vec::new();
            input.put(&mut out);
            out
        };
        let n = self.inputs.len().min(other.inputs.len());
        let differs = (0..n).find(|i| bytes(&self.inputs[*i]) != bytes(&other.inputs[*i]));
        differs.or((self.inputs.len() != other.inputs.len()).then_some(n))
    }

    /// Number of steps among the first `n` inputs, and the time simulated by them \[s\].
    pub fn steps_within(&self, n: usize) -> (usize, f64) {
        let steps = self.inputs[..n].iter().filter_map(|i| if let Input::Step(dt, _) = i { Some(dt) } else { None });
        steps.fold((0, 0.0), |(n, time), dt| (n + 1, time + dt))
    }

    /// The bytes of a file: `SUTURAIN`, version, inputs (see `docs/formats.md`). The same inputs are the same bytes on
    /// any machine.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = MAGIC.to_vec();
        VERSION.put(&mut out);
        self.inputs.put(&mut out);
        out
    }

    /// Reads them back.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Error> {
        let mut input = Reader { left: bytes, version: VERSION };
        if bytes.len() < MAGIC.len() || &input.array::<8>()? != MAGIC {
            return Err(damaged("it is no recording of input (it does not begin with SUTURAIN)"));
        }
        let version = u32::take(&mut input)?;
        if !(OLDEST..=VERSION).contains(&version) {
            return Err(damaged(format!(
                "recording of version {version}, this build reads versions {OLDEST} to {VERSION}"
            )));
        }
        input.version = version;
        let inputs = Vec::take(&mut input)?;
        if !input.left.is_empty() {
            return Err(damaged(format!("{} bytes too many", input.left.len())));
        }
        Ok(Recording { inputs })
    }
}

impl<T> Bytes for Handle<T> {
    fn put(&self, out: &mut Vec<u8>) {
        self.index.put(out);
        self.generation.put(out);
    }
    fn take(input: &mut Reader<'_>) -> Result<Self, Error> {
        Ok(Handle::new(u32::take(input)?, u32::take(input)?))
    }
}

impl<T: Bytes, const N: usize> Bytes for [T; N] {
    fn put(&self, out: &mut Vec<u8>) {
        self.iter().for_each(|v| v.put(out));
    }
    fn take(input: &mut Reader<'_>) -> Result<Self, Error> {
        let items = (0..N).map(|_| T::take(input)).collect::<Result<Vec<T>, Error>>()?;
        Ok(items.try_into().unwrap_or_else(|_| unreachable!("as many as there are")))
    }
}

impl Bytes for ShapeSpec {
    fn put(&self, out: &mut Vec<u8>) {
        let ShapeSpec { geometry, pose, surface, motion, open } = self;
        geometry.put(out);
        pose.put(out);
        surface.put(out);
        motion.put(out);
        open.put(out);
    }
    fn take(input: &mut Reader<'_>) -> Result<Self, Error> {
        let (geometry, pose, surface, motion) =
            (Bytes::take(input)?, Bytes::take(input)?, Bytes::take(input)?, Bytes::take(input)?);
        // Versions 2 and 3 know no meshes that are refused for their holes.
        let open = if input.version < 4 { true } else { Bytes::take(input)? };
        Ok(ShapeSpec { geometry, pose, surface, motion, open })
    }
}

impl Bytes for WeldSpec {
    fn put(&self, out: &mut Vec<u8>) {
        let WeldSpec { places, rest, anchor } = self;
        places.put(out);
        rest.put(out);
        anchor.put(out);
    }
    fn take(input: &mut Reader<'_>) -> Result<Self, Error> {
        let (places, rest) = (Bytes::take(input)?, Bytes::take(input)?);
        // Versions before 6 know no bodies.
        let anchor = if input.version < 6 { None } else { Bytes::take(input)? };
        Ok(WeldSpec { places, rest, anchor })
    }
}

/// Tag before the solver of settings that have drag: that follows.
const DRAG: u8 = 2;

/// Without drag they are as before there was any.
impl Bytes for Settings {
    fn put(&self, out: &mut Vec<u8>) {
        let Settings { gravity, substep, newton_max, tolerance, linear_damping, angular_damping, .. } = self;
        gravity.put(out);
        substep.put(out);
        newton_max.put(out);
        tolerance.put(out);
        linear_damping.put(out);
        angular_damping.put(out);
        let Settings { linear_drag, angular_drag, friction, halvings, integrator, solver, .. } = self;
        friction.put(out);
        halvings.put(out);
        integrator.put(out);
        if (*linear_drag, *angular_drag) != (0.0, 0.0) {
            DRAG.put(out);
            linear_drag.put(out);
            angular_drag.put(out);
        }
        solver.put(out);
    }
    fn take(input: &mut Reader<'_>) -> Result<Self, Error> {
        let mut settings = Settings {
            gravity: Bytes::take(input)?,
            substep: Bytes::take(input)?,
            newton_max: Bytes::take(input)?,
            tolerance: Bytes::take(input)?,
            linear_damping: Bytes::take(input)?,
            angular_damping: Bytes::take(input)?,
            linear_drag: 0.0,
            angular_drag: 0.0,
            friction: Bytes::take(input)?,
            halvings: Bytes::take(input)?,
            integrator: Bytes::take(input)?,
            solver: Solver::Direct,
        };
        if input.left.first() == Some(&DRAG) {
            let _: u8 = Bytes::take(input)?;
            (settings.linear_drag, settings.angular_drag) = (Bytes::take(input)?, Bytes::take(input)?);
        }
        settings.solver = Bytes::take(input)?;
        Ok(settings)
    }
}

impl Bytes for Profile {
    fn put(&self, out: &mut Vec<u8>) {
        self.0.put(out);
    }
    fn take(input: &mut Reader<'_>) -> Result<Self, Error> {
        Ok(Profile(Vec::take(input)?))
    }
}

structure!(PaperSettings { iterations, stretch_shear, bend, twist, direct_distance, friction, frame_inertia, order });
structure!(Friction { stick, slide });
structure!(Plasticity { yield_curvature, yield_twist, hardening });
structure!(Material { young_modulus, shear, density, bend_scale, bend_damping, plasticity });
structure!(Along { size, modulus, density });
structure!(RodSpec {
    centerline,
    frames,
    rest,
    radius,
    section,
    roll,
    pretwist,
    along,
    material,
    closure,
    stretch,
    surface
});
structure!(Closure { twist });
structure!(ColliderSpec { geometry, pose, density, surface });
structure!(Motor { speed, most });
structure!(JointSpec { bodies, frames, kind, compliance, angular_compliance, limits, motor, friction, touch });
structure!(JointModel { bodies, frames, kind, compliance, limits, friction, touch });
structure!(BodySpec { pose, colliders, velocity, angular_velocity });
structure!(WeldAnchor { body, point, strength });
structure!(ReelSpec { rod, at_end, law, supply });
structure!(GripSpec { rod, place, hold, drive, ramp });
structure!(LoadSpec { rod, kind });
variants!(JointKind { 0 => Fixed, 1 => Ball, 2 => Hinge, 3 => Slider });
variants!(Shear { 0 => Poisson(nu), 1 => Modulus(g) });
variants!(Section { 0 => Round, 1 => Ellipse(axes), 2 => Rectangle(sides) });
variants!(Solver { 0 => Direct, 1 => Paper(numbers) });
variants!(SweepOrder { 0 => Natural, 1 => TwoColor });
variants!(Integrator { 0 => ImplicitEuler, 1 => TrBdf2 });
variants!(WeldRest { 0 => AsInserted, 1 => Straight, 2 => Loose });
variants!(BodyMotion { 0 => Free, 1 => Driven, 2 => Held { by } });
variants!(Stretch { 0 => Elastic, 1 => Inextensible });
variants!(RestShape { 0 => AsInserted, 1 => Straight, 2 => Given { lengths, darboux } });
variants!(Geometry {
    0 => Plane,
    1 => Sphere { radius },
    2 => Capsule { radius, half_length },
    3 => Cylinder { radius, half_length },
    4 => Box { half_sides },
    5 => Mesh { vertices, triangles },
});
variants!(ShapeMotion { 0 => Fixed, 1 => Driven, 2 => Pushed { direction, force, speed_limit }, 3 => OnBody });
variants!(Input {
    0 => Settings(settings),
    1 => Friction(a, b, friction),
    2 => InsertRod(spec),
    3 => RemoveRod(rod),
    4 => InsertShape(spec),
    5 => RemoveShape(shape),
    6 => ShapePose(shape, pose),
    7 => ShapeMotion(shape, motion),
    8 => InsertGrip(spec),
    9 => RemoveGrip(grip),
    10 => GripPose(grip, pose),
    11 => GripDrive(grip, drive),
    12 => InsertLoad(spec),
    13 => SetLoad(load, kind),
    14 => RemoveLoad(load),
    15 => Restore(bytes),
    16 => Step(dt, hash),
    17 => InsertWeld(spec),
    18 => RemoveWeld(weld),
    19 => InsertReel(spec),
    20 => SetReel(reel, law),
    21 => SetMaterial(rod, material),
    22 => SetStretch(rod, stretch),
    23 => StepWork(most),
    24 => InsertBody(spec),
    25 => RemoveBody(body),
    26 => BodyMotion(body, motion),
    27 => BodyPose(body, pose),
    34 => Cut(rod, place),
    30 => InsertJoint(spec),
    31 => RemoveJoint(joint),
    32 => JointMotor(joint, motor),
});
