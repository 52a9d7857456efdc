//! The state as bytes: little endian, versioned, the same on every machine. The hash of these bytes is the state hash.

use crate::error::Error;
use crate::handle::Slots;
use crate::math::{self, Pose};
use crate::model::body::{BodyModel, MassProperties};
use crate::model::grip::{Drive, Hold, LoadKind, Place};
use crate::model::reel::ReelLaw;
use crate::model::rod::RodModel;
use crate::model::weld::{Member, WeldModel};
use crate::model::{Model, ShapeModel};
use crate::state::{
    BodyState, Contact, Contacts, GripState, History, JointState, LoadState, Moved, ReelState, Site, State,
};
use glam::{DQuat, DVec3};

/// First bytes of a snapshot: name and version. What its world was made of follows, and the state.
const MAGIC: &[u8; 8] = b"sutura\x05\0";

/// Those where bodies have joints, which the state then has after the bodies.
const JOINTED: &[u8; 8] = b"sutura\x06\0";
const WITH_JOINTS: u32 = 6;

/// Those of version 4, which says only what threads were made of.
const MATERIALS: &[u8; 8] = b"sutura\x04\0";

/// Those of version 3, which does not say what threads were made of. The hash of a state begins with them, whatever the
/// version, so that states of builds that differ in nothing else can be compared.
const BARE: &[u8; 8] = b"sutura\x03\0";

/// Something that is written and read back without loss.
pub(crate) trait Bytes: Sized {
    fn put(&self, out: &mut Vec<u8>);
    fn take(input: &mut Reader<'_>) -> Result<Self, Error>;
}

pub(crate) struct Reader<'a> {
    pub left: &'a [u8],
    /// Version of what is read.
    pub version: u32,
}

impl Reader<'_> {
    pub fn array<const N: usize>(&mut self) -> Result<[u8; N], Error> {
        let (head, tail) = self.left.split_first_chunk::<N>().ok_or_else(|| damaged("it ends too early"))?;
        self.left = tail;
        Ok(*head)
    }
}

pub(crate) fn damaged(reason: impl Into<String>) -> Error {
    Error::Snapshot { reason: reason.into() }
}

macro_rules! number {
    ($($t:ty),*) => {$(
        impl Bytes for $t {
            fn put(&self, out: &mut Vec<u8>) {
                out.extend_from_slice(&self.to_le_bytes());
            }
            fn take(input: &mut Reader<'_>) -> Result<Self, Error> {
                Ok(<$t>::from_le_bytes(input.array()?))
            }
        }
    )*};
}
number!(u8, u32, i32, u64, f64);

/// Structures: their fields in order.
macro_rules! structure {
    ($t:ident { $($field:ident),* $(,)? }) => {
        impl Bytes for $t {
            fn put(&self, out: &mut Vec<u8>) {
                let $t { $($field),* } = self;
                $($field.put(out);)*
            }
            fn take(input: &mut Reader<'_>) -> Result<Self, Error> {
                Ok($t { $($field: Bytes::take(input)?),* })
            }
        }
    };
}

impl Bytes for bool {
    fn put(&self, out: &mut Vec<u8>) {
        u8::from(*self).put(out);
    }
    fn take(input: &mut Reader<'_>) -> Result<Self, Error> {
        match u8::take(input)? {
            0 => Ok(false),
            1 => Ok(true),
            k => Err(damaged(format!("{k} is not a truth value"))),
        }
    }
}

impl Bytes for DVec3 {
    fn put(&self, out: &mut Vec<u8>) {
        self.to_array().iter().for_each(|v| v.put(out));
    }
    fn take(input: &mut Reader<'_>) -> Result<Self, Error> {
        Ok(DVec3::new(f64::take(input)?, f64::take(input)?, f64::take(input)?))
    }
}

impl Bytes for DQuat {
    fn put(&self, out: &mut Vec<u8>) {
        self.to_array().iter().for_each(|v| v.put(out));
    }
    fn take(input: &mut Reader<'_>) -> Result<Self, Error> {
        Ok(DQuat::from_xyzw(f64::take(input)?, f64::take(input)?, f64::take(input)?, f64::take(input)?))
    }
}

impl<T: Bytes> Bytes for Vec<T> {
    fn put(&self, out: &mut Vec<u8>) {
        (self.len() as u64).put(out);
        self.iter().for_each(|v| v.put(out));
    }
    fn take(input: &mut Reader<'_>) -> Result<Self, Error> {
        let n = u64::take(input)?;
        // Every element takes at least a byte, so a damaged count cannot ask for more memory than the input has.
        if n > input.left.len() as u64 {
            return Err(damaged("a count is larger than what is left"));
        }
        (0..n).map(|_| T::take(input)).collect()
    }
}

impl<T: Bytes> Bytes for Option<T> {
    fn put(&self, out: &mut Vec<u8>) {
        self.is_some().put(out);
        if let Some(v) = self {
            v.put(out);
        }
    }
    fn take(input: &mut Reader<'_>) -> Result<Self, Error> {
        Ok(if bool::take(input)? { Some(T::take(input)?) } else { None })
    }
}

impl<A: Bytes, B: Bytes> Bytes for (A, B) {
    fn put(&self, out: &mut Vec<u8>) {
        self.0.put(out);
        self.1.put(out);
    }
    fn take(input: &mut Reader<'_>) -> Result<Self, Error> {
        Ok((A::take(input)?, B::take(input)?))
    }
}

impl<T: Bytes> Bytes for Slots<T> {
    fn put(&self, out: &mut Vec<u8>) {
        self.raw().put(out);
    }
    fn take(input: &mut Reader<'_>) -> Result<Self, Error> {
        Ok(Slots::from_raw(Vec::take(input)?))
    }
}

/// Enumerations: a tag and the fields.
macro_rules! variants {
    ($t:ident { $($tag:literal => $name:ident $({ $($field:ident),* })? $(( $($item:ident),* ))?),* $(,)? }) => {
        impl Bytes for $t {
            fn put(&self, out: &mut Vec<u8>) {
                match self {
                    $($t::$name $({ $($field),* })? $(( $($item),* ))? => {
                        ($tag as u8).put(out);
                        $($($field.put(out);)*)?
                        $($($item.put(out);)*)?
                    })*
                }
            }
            fn take(input: &mut Reader<'_>) -> Result<Self, Error> {
                match u8::take(input)? {
                    $($tag => {
                        $($(let $item = Bytes::take(input)?;)*)?
                        Ok($t::$name $({ $($field: Bytes::take(input)?),* })? $(( $($item),* ))?)
                    })*
                    k => Err(damaged(format!("{k} is not a kind of {}", stringify!($t)))),
                }
            }
        }
    };
}

pub(crate) use {structure, variants};

variants!(ReelLaw { 0 => Rate(rate), 1 => Brake(force) });
variants!(History { 0 => Unknown, 1 => Discontinuous, 2 => Valid });
variants!(Hold { 0 => Pin, 1 => Clamp, 2 => Jaw });
variants!(Drive { 0 => Pose, 1 => Force { direction, force, speed_limit }, 2 => Hand { direction, force, speed_limit } });
variants!(Place { 0 => Start, 1 => End, 2 => Particle(i), 3 => Element(e), 4 => Arc(s) });
variants!(LoadKind {
    0 => Point { place, force, torque },
    1 => Uniform { force_per_length },
    2 => Mass { place, mass, inertia },
});
structure!(Pose { position, orientation });
structure!(MassProperties { mass, center, moments, axes });
structure!(LoadState { rod, kind });
structure!(JointState { coordinate, force, torque, motor, drive, stop, yields });
variants!(Moved { 0 => Free, 1 => Driven { target }, 2 => Held { by, at } });
structure!(BodyState { motion, position, orientation, velocity, angular_momentum, acceleration, torque });
structure!(ReelState { rod, at_end, law, supply, nominal, fed, added });
structure!(GripState {
    rod,
    index,
    hold,
    drive,
    ramp,
    taken_at,
    taken_pose,
    taken_velocity,
    taken_spin,
    pose,
    target,
    rest_half,
    half_span,
    force,
    torque
});
/// All of a state but bodies, their contacts and their joints, which a world without them does not write.
macro_rules! state {
    ($($field:ident),* $(,)?) => {
        impl Bytes for State {
            fn put(&self, out: &mut Vec<u8>) {
                let State { $($field,)* bodies, weld_force, joints } = self;
                $($field.put(out);)*
                let bodies = bodies.values();
                if !bodies.is_empty() {
                    bodies.put(out);
                    self.contacts.bodies().to_vec().put(out);
                    weld_force.put(out);
                }
                let joints = joints.values();
                if !joints.is_empty() {
                    joints.put(out);
                }
            }
            fn take(input: &mut Reader<'_>) -> Result<Self, Error> {
                let (bodies, weld_force, joints) = (Slots::default(), Vec::new(), Slots::default());
                let mut state = State { $($field: Bytes::take(input)?,)* bodies, weld_force, joints };
                state.weld_force.resize(state.weld_orientation.len(), DVec3::ZERO);
                if !input.left.is_empty() {
                    let bodies = Vec::<Option<BodyState>>::take(input)?;
                    if !matches!(bodies.last(), Some(Some(_))) {
                        return Err(damaged("its last body is none"));
                    }
                    state.bodies = Slots::of_values(bodies);
                    let of_bodies = Vec::<Contact>::take(input)?;
                    let all: Vec<Contact> = state.contacts.iter().copied().chain(of_bodies).collect();
                    state.contacts = sorted(&all)?;
                    state.weld_force = Bytes::take(input)?;
                }
                if input.version == WITH_JOINTS {
                    let joints = Vec::<Option<JointState>>::take(input)?;
                    if !matches!(joints.last(), Some(Some(_))) {
                        return Err(damaged("its last joint is none"));
                    }
                    state.joints = Slots::of_values(joints);
                }
                Ok(state)
            }
        }
    };
}

variants!(Site { 0 => Thread { element, s }, 1 => Shape { shape }, 2 => Surface { shape, at } });
structure!(Contact { a, b, normal, normal_force, friction, residual_slip, sliding });
state!(
    time,
    last_h,
    accepted_in_row,
    rest_length,
    position,
    velocity,
    orientation,
    angular_velocity,
    acceleration,
    angular_acceleration,
    history,
    tension,
    plastic,
    hardened,
    weld_orientation,
    shape_pose,
    shape_target,
    grips,
    loads,
    reels,
    contacts,
);

/// Contacts of threads with threads, and those with shapes, each with its count.
impl Bytes for Contacts {
    fn put(&self, out: &mut Vec<u8>) {
        let rest = |c: &Contact, out: &mut Vec<u8>| {
            (c.normal, c.normal_force).put(out);
            (c.friction, c.residual_slip).put(out);
            c.sliding.put(out);
        };
        (self.threads().len() as u64).put(out);
        for c in self.threads() {
            if let (Site::Thread { element: a, s }, Site::Thread { element: b, s: t }) = (c.a, c.b) {
                ((a, b), (s, t)).put(out);
            }
            rest(c, out);
        }
        (self.shapes().len() as u64).put(out);
        for c in self.shapes() {
            if let (Site::Thread { element, s }, Site::Shape { shape }) = (c.a, c.b) {
                ((shape, element), s).put(out);
            }
            rest(c, out);
        }
    }
    fn take(input: &mut Reader<'_>) -> Result<Self, Error> {
        type Rest = ((DVec3, f64), ((DVec3, DVec3), bool));
        let contact = |a: Site, b: Site, ((normal, normal_force), ((friction, residual_slip), sliding)): Rest| {
            Contact { a, b, normal, normal_force, friction, residual_slip, sliding }
        };
        let threads = Vec::<(((u32, u32), (f64, f64)), Rest)>::take(input)?;
        let shapes = Vec::<(((u32, u32), f64), Rest)>::take(input)?;
        let thread = |element: u32, s: f64| Site::Thread { element, s };
        let threads = threads.into_iter().map(|(((a, b), (s, t)), rest)| contact(thread(a, s), thread(b, t), rest));
        let on = |(((shape, element), s), rest)| contact(thread(element, s), Site::Shape { shape }, rest);
        sorted(&threads.chain(shapes.into_iter().map(on)).collect::<Vec<_>>())
    }
}

/// Contacts that are in the order in which they are written.
fn sorted(all: &[Contact]) -> Result<Contacts, Error> {
    let mut contacts = Contacts::default();
    contacts.set(all.iter().copied());
    if contacts.iter().zip(all).any(|(a, b)| a.order(b).is_ne()) {
        return Err(damaged("its contacts are out of order"));
    }
    Ok(contacts)
}

structure!(Build { materials, rods, shapes, welds });
structure!(BuiltRod { slot, n_elements, radius, closed, section, along, rest });
structure!(BuiltShape { slot, geometry });
structure!(BuiltWeld { slot, places });

/// What a model was built from, beside the lengths that are in the state: numbers where a message can name them, hashes
/// of the rest.
pub(crate) struct Build {
    /// Of materials, and whether threads stretch. These may have changed.
    pub materials: u64,
    rods: Vec<BuiltRod>,
    shapes: Vec<BuiltShape>,
    welds: Vec<BuiltWeld>,
}

/// A thread, in the order of the state.
struct BuiltRod {
    slot: u32,
    /// Without what reels added.
    n_elements: i32,
    radius: f64,
    closed: bool,
    section: u64,
    /// How section, modulus and density change along it.
    along: u64,
    /// Bend and twist at rest; zero is straight.
    rest: u64,
}

struct BuiltShape {
    slot: u32,
    geometry: u64,
}

struct BuiltWeld {
    slot: u32,
    /// Thread and particle, counted without what reels added.
    places: Vec<(u32, i32)>,
}

impl Build {
    /// That of a model, whose reels are in this state.
    pub(crate) fn of(model: &Model, state: &State) -> Self {
        let mut rods: Vec<(u32, &RodModel)> = model.rods.iter().collect();
        rods.sort_unstable_by_key(|(_, r)| r.first);
        let rods = rods.into_iter().map(|(slot, rod)| BuiltRod::of(model, state, slot, rod)).collect();
        let shape = |(slot, s): (u32, &ShapeModel)| BuiltShape { slot, geometry: s.hash };
        let place = |m: &Member| (m.rod, m.particle as i32 - crate::reel::added(state, m.rod, false));
        let weld = |(slot, w): (u32, &WeldModel)| BuiltWeld { slot, places: w.members.iter().map(place).collect() };
        Build {
            materials: made_of(model),
            rods,
            shapes: model.shapes.iter().map(shape).collect(),
            welds: model.welds.iter().map(weld).collect(),
        }
    }

    /// What another one has that this one has not, in words: `self` is here, `there` in the snapshot.
    pub(crate) fn unlike(&self, there: &Build) -> Option<String> {
        let slots = |b: &Build| b.rods.iter().map(|r| r.slot).collect::<Vec<_>>();
        if slots(self) != slots(there) {
            return Some(format!(
                "it is of a world with other threads: those in the slots {:?}, here {:?}",
                slots(there),
                slots(self)
            ));
        }
        let words = |closed: bool| if closed { "closed" } else { "open" };
        for (here, there) in self.rods.iter().zip(&there.rods) {
            let differs = if here.n_elements != there.n_elements {
                format!("it has {} elements there, {} here", there.n_elements, here.n_elements)
            } else if here.closed != there.closed {
                format!("it is {} there, {} here", words(there.closed), words(here.closed))
            } else if !math::same(here.radius, there.radius) {
                format!("its radius is {} m there, {} m here", there.radius, here.radius)
            } else if here.section != there.section {
                "its cross-section is another there".into()
            } else if here.along != there.along {
                "its section, modulus or density changes otherwise along it there".into()
            } else if here.rest != there.rest {
                "its rest shape is another there, or it was cut elsewhere".into()
            } else {
                continue;
            };
            return Some(format!("it is of a world with other threads: of thread {}, {differs}", here.slot));
        }
        let slots = |b: &Build| b.shapes.iter().map(|s| s.slot).collect::<Vec<_>>();
        if slots(self) != slots(there) {
            return Some(format!(
                "it is of a world with other shapes: those in the slots {:?}, here {:?}",
                slots(there),
                slots(self)
            ));
        }
        if let Some((here, _)) = self.shapes.iter().zip(&there.shapes).find(|(a, b)| a.geometry != b.geometry) {
            return Some(format!(
                "it is of a world with other shapes: the geometry of shape {} is another there",
                here.slot
            ));
        }
        let welds = |b: &Build| b.welds.iter().map(|w| (w.slot, w.places.clone())).collect::<Vec<_>>();
        (welds(self) != welds(there)).then(|| "it is of a world with other welds".into())
    }
}

impl BuiltRod {
    fn of(model: &Model, state: &State, slot: u32, rod: &RodModel) -> Self {
        let added = [false, true].map(|at_end| crate::reel::added(state, slot, at_end));
        // What reels add is like its neighbors and straight at rest: the same factors once, and the places that are not
        // straight.
        let mut along =
            model.factors[rod.elements()].iter().map(|f| [f.size, f.modulus, f.density]).collect::<Vec<_>>();
        along.dedup();
        let mut rest = Vec::new();
        for (k, q) in model.rest_half[rod.elements()].iter().enumerate().filter(|(_, q)| **q != DQuat::IDENTITY) {
            (k as i32 - added[0]).put(&mut rest);
            q.put(&mut rest);
        }
        let seam = model.weld_of[rod.first as usize].filter(|w| model.weld_of[rod.particles().end - 1] == Some(*w));
        // The rest shape at the seam, as it was closed.
        let members = seam.and_then(|w| model.welds.at(w)).map_or(&[][..], |w| &w.members);
        for side in members.iter().flat_map(|m| [m.before, m.after]).flatten().filter(|s| s.section == DQuat::IDENTITY)
        {
            side.rest_half.put(&mut rest);
        }
        // A cut leaves ends that do not touch each other.
        for faces in model.faces.iter().filter(|f| f.ends.iter().any(|end| end.rod == slot)) {
            faces.ends.iter().for_each(|end| (end.rod, end.at_end).put(&mut rest));
        }
        BuiltRod {
            slot,
            n_elements: rod.n_elements as i32 - added[0] - added[1],
            radius: rod.radius,
            closed: seam.is_some(),
            section: hash_of(&(rod.section, rod.section_radius)),
            along: hash_of(&along),
            rest: fnv(&rest),
        }
    }
}

pub(crate) fn hash_of(value: &impl Bytes) -> u64 {
    let mut bytes = Vec::new();
    value.put(&mut bytes);
    fnv(&bytes)
}

/// A snapshot of the state of a model.
pub(crate) fn write(model: &Model, state: &State) -> Vec<u8> {
    let jointed = model.joints.iter().next().is_some();
    let mut out = if jointed { JOINTED } else { MAGIC }.to_vec();
    Build::of(model, state).put(&mut out);
    state.put(&mut out);
    if model.bodies.iter().next().is_some() {
        bodies_of(model).put(&mut out);
    }
    if jointed {
        joints_of(model).put(&mut out);
    }
    out
}

/// What joints join, and how, each as one number.
pub(crate) fn joints_of(model: &Model) -> Vec<u64> {
    model.joints.iter().map(|(_, j)| hash_of(j)).collect()
}

/// What bodies consist of and where threads are attached to them, each as one number.
pub(crate) fn bodies_of(model: &Model) -> Vec<u64> {
    let hash = |(slot, b): (u32, &BodyModel)| {
        let geometry = |&(shape, pose): &(u32, Pose)| (model.shapes.at(shape).map(|s| s.hash), pose);
        let anchors = model.welds.iter().filter_map(|(weld, w)| Some((weld, w.anchor.filter(|a| a.body == slot)?)));
        let anchors = anchors.map(|(weld, a)| ((weld, a.pose), (a.strength, a.filter_distance)));
        hash_of(&((b.mass, b.shapes.iter().map(geometry).collect::<Vec<_>>()), anchors.collect::<Vec<_>>()))
    };
    model.bodies.iter().map(hash).collect()
}

/// A snapshot as it was read.
pub(crate) struct Snapshot {
    /// What threads were made of, where it says so.
    pub materials: Option<u64>,
    /// What the world was built from, where it says so.
    pub build: Option<Build>,
    pub bodies: Vec<u64>,
    pub joints: Vec<u64>,
    pub state: State,
}

/// Reads a snapshot of this version or of one of the two before it.
pub(crate) fn read(bytes: &[u8]) -> Result<Snapshot, Error> {
    let mut input = Reader { left: bytes, version: 0 };
    let (materials, build) = match &input.array::<8>()? {
        magic @ (MAGIC | JOINTED) => {
            input.version = if magic == JOINTED { WITH_JOINTS } else { 0 };
            let build = Build::take(&mut input)?;
            (Some(build.materials), Some(build))
        }
        MATERIALS => (Some(u64::take(&mut input)?), None),
        BARE => (None, None),
        _ => return Err(damaged("it does not start as a snapshot of this version")),
    };
    let state = State::take(&mut input)?;
    let bodies = if state.bodies.len() > 0 { Bytes::take(&mut input)? } else { Vec::new() };
    let joints = if state.joints.len() > 0 { Bytes::take(&mut input)? } else { Vec::new() };
    if !input.left.is_empty() {
        return Err(damaged(format!("{} bytes too many", input.left.len())));
    }
    Ok(Snapshot { materials, build, bodies, joints, state })
}

/// What the threads of a model are made of and whether they stretch, as one number: tensions and accelerations of a
/// state are of these.
pub(crate) fn made_of(model: &Model) -> u64 {
    let mut bytes = Vec::new();
    for (slot, rod) in model.rods.iter() {
        slot.put(&mut bytes);
        rod.material.put(&mut bytes);
        rod.stretch.put(&mut bytes);
    }
    fnv(&bytes)
}

/// FNV-1a over the bytes of the state.
pub(crate) fn hash(state: &State) -> u64 {
    let mut bytes = BARE.to_vec();
    state.put(&mut bytes);
    fnv(&bytes)
}

fn fnv(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x0100_0000_01b3))
}
