//! Parameter studies: many small cases of knots, stepped without scenes, whose tables the documentation shows. Each
//! study can be stopped and taken up again. Nothing that is measured depends on a clock but the times themselves, and
//! what a budget of CPU time cuts off.

pub mod case;
pub mod curve;
pub mod firm;
pub mod hands;
pub mod hold;
pub mod map;
pub mod overhand;
pub mod pool;
pub mod robustness;
pub mod run;
pub mod session;
pub mod strength;
pub mod table;
pub mod throws;
pub mod tie;
