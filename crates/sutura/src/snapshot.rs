//! The state as bytes: little endian, versioned, the same on every machine. The hash of these bytes is the state hash.

use crate::error::Error;
use crate::handle::Slots;
use crate::math::Pose;
use crate::model::Model;
use crate::model::grip::{Drive, Hold, LoadKind, Place};
use crate::model::reel::ReelLaw;
use crate::state::{GripState, LoadState, Onset, ReelState, ShapeContact, State, ThreadContact};
use glam::{DQuat, DVec3};

/// First bytes of a snapshot: name and version. What its threads were made of follows, and the state.
const MAGIC: &[u8; 8] = b"sutura\x04\0";

/// Those of version 3, which does not say what threads were made of. The hash of a state begins with them, whatever the version, so that states of builds
/// that differ in nothing else can be compared.
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
variants!(Onset { 0 => Unknown, 1 => Broken, 2 => Smooth });
variants!(Hold { 0 => Pin, 1 => Clamp, 2 => Jaw });
variants!(Drive { 0 => Pose, 1 => Force { direction, force, speed_limit }, 2 => Hand { direction, force, speed_limit } });
variants!(Place { 0 => Start, 1 => End, 2 => Particle(i), 3 => Element(e), 4 => Arc(s) });
variants!(LoadKind {
    0 => Point { place, force, torque },
    1 => Uniform { force_per_length },
    2 => Mass { place, mass, inertia },
});
structure!(Pose { position, orientation });
structure!(LoadState { rod, kind });
structure!(ReelState { rod, at_end, law, supply, nominal, fed, added });
structure!(ThreadContact { a, b, s, t, normal, normal_force, friction, drift, sliding });
structure!(ShapeContact { shape, element, s, normal, normal_force, friction, drift, sliding });
structure!(GripState { rod, index, hold, drive, ramp, taken_at, taken_pose, taken_velocity, taken_spin, pose, target, rest_half, half_span, force, torque });
structure!(State {
    time,
    last_h,
    calm,
    rest_length,
    position,
    velocity,
    orientation,
    angular_velocity,
    acceleration,
    angular_acceleration,
    onset,
    tension,
    plastic,
    hardened,
    weld_orientation,
    shape_pose,
    shape_target,
    grips,
    loads,
    reels,
    thread_contacts,
    shape_contacts,
});

/// A snapshot of the state of a model.
pub(crate) fn write(state: &State, made_of: u64) -> Vec<u8> {
    let mut out = MAGIC.to_vec();
    made_of.put(&mut out);
    state.put(&mut out);
    out
}

/// What threads were made of, where the snapshot says so, and the state.
pub(crate) fn read(bytes: &[u8]) -> Result<(Option<u64>, State), Error> {
    let mut input = Reader { left: bytes, version: 0 };
    let made_of = match &input.array::<8>()? {
        MAGIC => Some(u64::take(&mut input)?),
        BARE => None,
        _ => return Err(damaged("it does not start as a snapshot of this version")),
    };
    let state = State::take(&mut input)?;
    if !input.left.is_empty() {
        return Err(damaged(format!("{} bytes too many", input.left.len())));
    }
    Ok((made_of, state))
}

/// What the threads of a model are made of and whether they stretch, as one number: tensions and accelerations of a state are of these.
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
