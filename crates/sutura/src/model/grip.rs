//! What holds or drives a piece of a thread, and what loads it.

use crate::error::{Error, check};
use crate::handle::Handle;
use crate::math::half;
use crate::model::Model;
use crate::model::rod::{Rod, RodModel};
use glam::{DQuat, DVec3};

/// A grip. Marker of [`Handle`](crate::Handle).
#[derive(Debug)]
pub enum Grip {}

/// A load. Marker of [`Handle`](crate::Handle).
#[derive(Debug)]
pub enum Load {}

/// A place along a thread.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Place {
    /// The first particle (for [`Hold::Jaw`] the first element).
    Start,
    /// The last particle (for [`Hold::Jaw`] the last element).
    End,
    /// Particle by number, from 0 at the start.
    Particle(u32),
    /// Middle of an element by number, from 0 at the start.
    Element(u32),
    /// The particle (for [`Hold::Jaw`] and loads the element) nearest to this rest arc length from the start \[m\].
    Arc(f64),
}

/// How a grip holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hold {
    /// The position of one particle; it may turn.
    Pin,
    /// One particle and the cross-section there. It acts over half an element on each side (compliance of half a
    /// joint), which keeps the solution second order in the element length.
    Clamp,
    /// A whole element: its two particles and its frame, as between the jaws of an instrument.
    Jaw,
}

/// What moves a grip.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Drive {
    /// A pose set by the user ([`World::set_grip_pose`](crate::World::set_grip_pose)); where it is when taken, until
    /// then.
    Pose,
    /// A force along a line through where it is, with a speed limit: the grip acts with `force * (1 - speed /
    /// speed_limit)` along `direction`, so it moves at `speed_limit` where nothing resists and rests where the thread
    /// pulls back with `force`. It does not move across `direction`; a clamp or jaw does not turn.
    Force {
        /// Direction of the force in the world, a unit vector.
        direction: DVec3,
        /// Force wanted \[N\], >= 0.
        force: f64,
        /// Speed where nothing resists \[m/s\], > 0.
        speed_limit: f64,
    },
    /// The same, but it gives way across `direction` too: the grip acts with `force * (direction - velocity /
    /// speed_limit)`. So what holds it back from wherever, it rests or gives way with no more than `force`; a clamp or
    /// jaw does not turn.
    Hand {
        /// Direction of the force in the world, a unit vector.
        direction: DVec3,
        /// Force wanted \[N\], >= 0.
        force: f64,
        /// Speed where nothing resists \[m/s\], > 0.
        speed_limit: f64,
    },
}

/// A grip to take.
#[derive(Debug, Clone)]
pub struct GripSpec {
    /// The thread.
    pub rod: Handle<Rod>,
    /// Where along it.
    pub place: Place,
    /// How it holds.
    pub hold: Hold,
    /// What moves it.
    pub drive: Drive,
    /// Time over which it takes hold \[s\], >= 0: the held piece passes smoothly from its own motion to the grip's.
    /// Where the first pose set differs from the piece's pose, the difference is closed over this time too.
    pub ramp: f64,
}

impl GripSpec {
    /// A grip driven by pose that takes hold over 20 ms.
    pub fn new(rod: Handle<Rod>, place: Place, hold: Hold) -> Self {
        GripSpec { rod, place, hold, drive: Drive::Pose, ramp: 0.02 }
    }
    /// The same, holding from this instant.
    pub fn at_once(rod: Handle<Rod>, place: Place, hold: Hold) -> Self {
        GripSpec { ramp: 0.0, ..Self::new(rod, place, hold) }
    }
}

impl Drive {
    pub(crate) fn validate(&self) -> Result<(), Error> {
        if let Drive::Force { direction, force, speed_limit } | Drive::Hand { direction, force, speed_limit } = self {
            check("grip", "drive.force", *force, *force >= 0.0, "a finite force >= 0 [N]")?;
            check("grip", "drive.speed_limit", *speed_limit, *speed_limit > 0.0, "a finite speed > 0 [m/s]")?;
            if !direction.is_finite() || (direction.length() - 1.0).abs() > 1e-6 {
                return Err(Error::invalid("grip", "drive.direction", direction, "a unit vector"));
            }
        }
        Ok(())
    }
}

/// What acts on a thread from outside, beside gravity.
#[derive(Debug, Clone)]
pub struct LoadSpec {
    /// The thread.
    pub rod: Handle<Rod>,
    /// The load.
    pub kind: LoadKind,
}

/// Kinds of load. Forces and torques are in world axes and keep their direction (dead loads).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LoadKind {
    /// Force \[N\] and torque \[N m\] at a place. A torque acts on the nearest element.
    Point {
        /// Where.
        place: Place,
        /// Force \[N\].
        force: DVec3,
        /// Torque \[N m\].
        torque: DVec3,
    },
    /// Force per rest length along the whole thread \[N/m\].
    Uniform {
        /// Force per length \[N/m\].
        force_per_length: DVec3,
    },
    /// A mass and its moments of inertia fixed to the thread at a place. It has weight.
    Mass {
        /// Where.
        place: Place,
        /// Mass \[kg\], >= 0.
        mass: f64,
        /// Moments of inertia along d1, d2, d3 of the nearest element \[kg m^2\], >= 0.
        inertia: DVec3,
    },
}

impl LoadKind {
    /// Where it acts, if at one place.
    pub(crate) fn place_mut(&mut self) -> Option<&mut Place> {
        match self {
            LoadKind::Point { place, .. } | LoadKind::Mass { place, .. } => Some(place),
            LoadKind::Uniform { .. } => None,
        }
    }
    pub(crate) fn validate(&self) -> Result<(), Error> {
        let finite = |field: &str, v: DVec3| {
            if v.is_finite() { Ok(()) } else { Err(Error::invalid("load", field, v, "a finite vector")) }
        };
        match self {
            LoadKind::Point { force, torque, .. } => {
                finite("force", *force)?;
                finite("torque", *torque)
            }
            LoadKind::Uniform { force_per_length } => finite("force_per_length", *force_per_length),
            LoadKind::Mass { mass, inertia, .. } => {
                check("load", "mass", *mass, *mass >= 0.0, "a finite mass >= 0 [kg]")?;
                check(
                    "load",
                    "inertia",
                    inertia.min_element(),
                    inertia.is_finite() && inertia.min_element() >= 0.0,
                    "finite moments >= 0 [kg m^2]",
                )
            }
        }
    }
}

impl Place {
    /// Element (index in the world's arrays) and position on it, 0 to 1.
    pub(crate) fn on_element(&self, model: &Model, rod: &RodModel) -> (usize, f64) {
        let (first, n) = (rod.first as usize, rod.n_elements as usize);
        match *self {
            Place::Start => (first, 0.0),
            Place::End => (first + n - 1, 1.0),
            Place::Particle(i) if i as usize >= n => (first + n - 1, 1.0),
            Place::Particle(i) => (first + i as usize, 0.0),
            Place::Element(e) => (first + (e as usize).min(n - 1), 0.5),
            Place::Arc(s) => {
                let mut left = s.max(0.0);
                for e in rod.elements() {
                    let l = model.rest_length[e];
                    if left <= l {
                        return (e, left / l);
                    }
                    left -= l;
                }
                (first + n - 1, 1.0)
            }
        }
    }
    /// Particle counted from the rod's start.
    pub(crate) fn particle(&self, model: &Model, rod: &RodModel) -> u32 {
        let (e, s) = self.on_element(model, rod);
        (e - rod.first as usize) as u32 + u32::from(s > 0.5)
    }
    pub(crate) fn validate(&self, what: &'static str, model: &Model, rod: &RodModel) -> Result<(), Error> {
        match *self {
            Place::Start | Place::End => Ok(()),
            Place::Particle(i) if i <= rod.n_elements => Ok(()),
            Place::Element(e) if e < rod.n_elements => Ok(()),
            Place::Arc(s) => {
                let length: f64 = rod.elements().map(|e| model.rest_length[e]).sum();
                check(
                    what,
                    "place.arc",
                    s,
                    s >= 0.0 && s <= length * (1.0 + 1e-9),
                    "a rest arc length within the thread [m]",
                )
            }
            Place::Particle(i) => Err(Error::invalid(what, "place.particle", i, "at most the number of elements")),
            Place::Element(e) => Err(Error::invalid(what, "place.element", e, "under the number of elements")),
        }
    }
}

/// A load in action.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LoadState {
    pub rod: u32,
    pub kind: LoadKind,
}

/// Orientation held by a clamp that carries the moment there now.
pub(crate) fn clamp_orientation(before: Option<DQuat>, after: Option<DQuat>, rest_half: DQuat) -> DQuat {
    match (before, after) {
        (Some(a), Some(b)) => (a * half(a.conjugate() * b)).normalize(),
        (None, Some(b)) => (b * (rest_half * rest_half).conjugate()).normalize(),
        (Some(a), None) => (a * rest_half * rest_half).normalize(),
        (None, None) => DQuat::IDENTITY,
    }
}
