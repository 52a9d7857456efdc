//! References: closed forms and routines that solve the same problems in other ways than the engine.
//!
//! Lengths are over the length of the rod, forces over EI / L^2, weights per length over EI / L^3, moments over EI / L,
//! unless a function says otherwise. Each is tested against the tables from which this validation was set up.

pub mod catenary;
pub mod curves;
pub mod elastica;
pub mod kirchhoff;
pub mod knots;
pub mod links;
pub mod material;
mod numeric;
pub mod twist;
pub mod vibration;
