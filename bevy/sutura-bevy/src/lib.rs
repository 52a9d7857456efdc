//! Surgical thread for Bevy: the engine [`sutura`] as a plugin.
//!
//! ```no_run
//! use bevy::prelude::*;
//! use sutura_bevy::{SuturaPlugin, Thread, sutura};
//! use sutura::{Material, RodSpec, glam::DVec3};
//!
//! App::new()
//!     .add_plugins((DefaultPlugins, SuturaPlugin::default()))
//!     .add_systems(Startup, |mut commands: Commands| {
//!         // 10 cm of a 2-0 monofilament. It falls.
//!         let spec = RodSpec::straight(DVec3::ZERO, DVec3::X * 0.1, 100, 0.15e-3, Material::elastic(2e9, 1150.0));
//!         commands.spawn(Thread::new(spec));
//!     })
//!     .run();
//! ```
//!
//! Components: [`Thread`], [`Body`] and [`Grip`] put a thing into the world of the engine when they are spawned and
//! take it out when they are despawned. Resources: [`Sutura`] holds the world, [`PhysicsClock`] says how it follows
//! real time, [`Space`] how its meters and axes become Bevy's, [`Hand`] is what the mouse holds.
//!
//! Physics has frames of its own, of fixed length ([`PhysicsClock::frame`], 1/60 s unless it is set otherwise). In each
//! drawn frame, before `Update`, as many of them are done as real time asks for: none or several. A slow picture slows
//! no physics. Where physics itself cannot keep up, it takes no more than [`PhysicsClock::budget`] of a drawn frame,
//! owes no more than [`PhysicsClock::most_owed`], and what it gives up beyond that is counted in
//! [`PhysicsClock::lost`]; [`PhysicsClock::rate`] says how fast it goes. Everything done to the world is written down
//! in order if the world records ([`Sutura::recording`]), each frame of physics among it, so that what a player did is
//! done again bit for bit whatever the times of the pictures were.
//!
//! Systems that act on the world belong into the schedule [`PhysicsFrame`], set [`PhysicsSet::Drive`]: they run before
//! each frame of physics.
//!
//! Without Bevy's renderer (`MinimalPlugins`) the plugin does the physics and draws nothing.

mod clock;
mod cloth;
mod draw;
mod hand;
pub mod look;
mod mesh;
mod space;
mod things;
mod tip;
mod tube;
mod world;

pub use clock::{PhysicsClock, PhysicsFrame, PhysicsLoop, PhysicsSet};
pub use cloth::Cloth;
pub use draw::{Drawn, Live, Solid, Strand, heat};
pub use hand::{Hand, Held, Pointer, PointerCamera};
pub use mesh::Triangles;
pub use space::Space;
pub use sutura;
pub use things::{Body, Grip, Limits, Thread};
pub use tip::Tip;
pub use world::{Part, Simulation, Sutura};

use bevy::app::RunFixedMainLoop;
use bevy::input::InputSystems;
use bevy::prelude::*;

/// Physics, the mouse, and pictures where there is a renderer.
#[derive(Debug, Clone, Default)]
pub struct SuturaPlugin {
    /// How meters and axes of the engine become Bevy's.
    pub space: Space,
}

impl Plugin for SuturaPlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(self.space)
            .init_resource::<Sutura>()
            .init_resource::<PhysicsClock>()
            .init_resource::<Pointer>()
            .init_resource::<Hand>();
        app.init_schedule(PhysicsFrame);
        app.configure_sets(PhysicsFrame, (PhysicsSet::Drive, PhysicsSet::Step).chain());
        // What was spawned is there, and the pointer is where the mouse is, before physics of the same drawn frame
        // begins.
        app.add_systems(
            PreUpdate,
            (things::take_up, hand::read_pointer, hand::grab, things::take_up).chain().after(InputSystems),
        );
        app.add_systems(RunFixedMainLoop, clock::advance.in_set(PhysicsLoop));
        app.add_systems(
            PhysicsFrame,
            (things::take_up.before(PhysicsSet::Drive), things::step.in_set(PhysicsSet::Step)),
        );
        app.add_observer(things::thread_gone).add_observer(things::body_gone).add_observer(things::grip_gone);
        draw::build(app);
    }
}
