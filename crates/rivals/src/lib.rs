//! Other methods for elastic rods, each from its paper, that Sutura is compared with: discrete elastic rods ([`Der`]),
//! position-based elastic rods with ghost points ([`Pber`]), and plain position-based dynamics ([`Pbd`]).
//!
//! They know nothing of the engine and share with each other only what is asked of them ([`Scene`]) and what is read
//! ([`Solver`]). SI units. None of them has contact.

mod band;
pub mod der;
pub mod pbd;
pub mod pber;
mod points;
pub mod scene;

pub use der::Der;
pub use pbd::Pbd;
pub use pber::Pber;
pub use scene::{Hold, Invalid, Pose, Rod, Scene, Shape, Solver};
