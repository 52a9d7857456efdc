//! Scenes made by a generator, for properties that must hold of every one: [`make`] draws them, [`way`] does to them
//! what must not change the answer, [`play`] steps them and looks at what must hold. [`throw`] draws short threads that
//! meet shapes of all kinds.

pub mod draw;
pub mod make;
pub mod mesh;
pub mod near;
pub mod play;
pub mod scene;
pub mod throw;
pub mod way;

pub use draw::Draw;
pub use play::{Player, Seen, watch};
pub use scene::{Act, Held, Scene};
pub use way::Way;
