//! Real-time simulator of surgical thread: inextensible Cosserat rods of true physical size that touch, hold by
//! friction and knot.
//!
//! SI units throughout; right-handed; no up axis (gravity is a vector). Energy, tension and twist signs: tension is
//! positive when stretched, positive twist is the right-hand rotation about the tangent of increasing arc length.

mod arrays;
mod attempt;
pub mod audit;
mod budget;
mod collide;
mod drive;
mod effort;
pub mod error;
mod finite;
pub mod handle;
pub mod input;
mod integrator;
#[doc(hidden)]
pub mod kernels;
pub mod knot;
mod lanes;
pub mod math;
mod model;
mod motion;
mod newton;
mod params;
mod pbd;
mod reaction;
mod reel;
mod rejection;
mod report;
mod rod;
mod row;
mod scratch;
mod segment;
pub mod skin;
mod snapshot;
mod state;
mod step;
mod view;
mod world;

pub use collide::overlap::{Overlap, OverlapWith};
pub use error::Error;
pub use glam;
pub use handle::Handle;
pub use math::Pose;
pub use model::body::{Body, BodyMotion, BodySpec, ColliderSpec, MassProperties};
pub use model::cut::Cut;
pub use model::grip::{Drive, Grip, GripSpec, Hold, Load, LoadKind, LoadSpec, Place};
pub use model::instrument::{Instrument, InstrumentSpec};
pub use model::joint::{Joint, JointKind, JointSpec, Motor};
pub use model::material::{Material, Plasticity, Shear};
pub use model::needle::{NEEDLES, NeedleArc, NeedleCode, NeedlePoint, NeedleShape, NeedleSpec};
pub use model::reel::{Reel, ReelLaw, ReelSpec};
pub use model::rod::{Closure, RestShape, Rod, RodSpec, Stretch, transported_frames};
pub use model::section::{Along, Profile, Section};
pub use model::shape::{Geometry, Shape, ShapeMotion, ShapeSpec};
pub use model::weld::{Weld, WeldAnchor, WeldRest, WeldSpec};
pub use params::{Friction, Integrator, PaperSettings, Settings, Solver, SweepOrder};
pub use rejection::Rejection;
pub use report::{Incident, IncidentKind, StepReport};
pub use rod::energy::Energy;
pub use view::{BodyView, ContactSide, ContactView, CutView, JointView, RodView, ShapeView, View, WeldView};
pub use world::{World, Wrench};
