//! The viewer of sutura, as a library for its program and its tests: [`window`] shows scenes in a window, [`Studio`]
//! draws them without one.

pub mod args;
pub mod camera;
pub mod control;
mod instruments;
pub mod keys;
mod overlay;
mod panel;
pub mod parameters;
pub mod source;
pub mod stage;
mod studio;
mod trial;

pub use args::Args;
pub use studio::{Picture, Studio};

use bevy::app::RunFixedMainLoop;
use bevy::asset::AssetEventSystems;
use bevy::input::InputSystems;
use bevy::log::LogPlugin;
use bevy::prelude::*;
use bevy_egui::{EguiPlugin, EguiPostUpdateSet, EguiPrimaryContextPass};
use camera::{Orbit, Surroundings};
use control::{Typing, Viewer};
use stage::Stage;
use sutura_bevy::{PhysicsClock, PhysicsFrame, PhysicsSet, SuturaPlugin};

/// Everything of the viewer but the window: what it draws needs a renderer, what it does needs none.
pub struct ViewerPlugin;

impl Plugin for ViewerPlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins(SuturaPlugin::default());
        app.init_resource::<Viewer>().init_resource::<Stage>().init_resource::<Orbit>().init_resource::<Typing>();
        app.init_resource::<panel::Curves>().init_resource::<panel::Knots>().init_resource::<parameters::Parameters>();
        let keys = resource_exists::<ButtonInput<KeyCode>>;
        app.add_systems(
            PreUpdate,
            (control::read_keys, control::read_drops, control::act).chain().after(InputSystems).run_if(keys),
        );
        app.add_systems(PreUpdate, (parameters::remember, parameters::apply).chain().after(control::act));
        app.add_systems(
            PhysicsFrame,
            (
                control::drive.in_set(PhysicsSet::Drive).run_if(keys),
                (stage::remember, control::settle, panel::measure).chain().after(PhysicsSet::Step),
            ),
        );
        app.add_systems(
            Update,
            (
                control::play_recording,
                stage::show_past,
                control::show_tension,
                stage::lay_table,
                panel::recognize_knots,
                camera::orbit.run_if(keys),
            )
                .chain(),
        );
        // Where there is a renderer.
        let renders = resource_exists::<Assets<StandardMaterial>>;
        app.add_systems(Startup, (stage::light, camera::make_surroundings).run_if(renders));
        app.add_systems(
            Update,
            (camera::follow, stage::aim, stage::cover_table.after(stage::lay_table), instruments::show)
                .after(camera::orbit)
                .run_if(renders),
        );
        let lines = resource_exists::<GizmoConfigStore>;
        app.add_systems(Startup, overlay::set_up.run_if(lines));
        app.add_systems(Update, (overlay::draw, control::record).after(stage::show_past).run_if(lines));
    }
}

/// Opens the window, and returns when it is closed.
pub fn window(args: &Args) -> AppExit {
    let (width, height) = args.size;
    let window = Window { title: "sutura".into(), resolution: (width, height).into(), ..default() };
    let mut app = App::new();
    app.add_plugins(DefaultPlugins.set(WindowPlugin { primary_window: Some(window), ..default() }).set(quiet()));
    app.add_plugins((EguiPlugin::default(), ViewerPlugin));
    app.world_mut().resource_mut::<PhysicsClock>().running = !args.paused;
    // The picture goes on where physics is slow: it gets two thirds of a picture at 30 a second, and half of a slower
    // one.
    app.world_mut().resource_mut::<PhysicsClock>().budget = std::time::Duration::from_millis(22);
    app.world_mut().resource_mut::<PhysicsClock>().share = std::time::Duration::from_millis(200);
    app.world_mut().resource_mut::<PhysicsClock>().most_frame = Some(std::time::Duration::from_millis(14));
    let (name, zoom) = (args.scene.clone(), args.zoom as f32);
    app.add_systems(PostStartup, (move |world: &mut World| control::open(world, &name), spawn_camera).chain());
    app.world_mut().resource_mut::<Viewer>().least_width = args.least_width;
    app.add_systems(RunFixedMainLoop, look_at_new.after(sutura_bevy::PhysicsLoop));
    app.add_systems(Last, |world: &mut World| {
        let height = world.query::<&Window>().iter(world).next().map_or(0, Window::physical_height);
        stage::thicken(world, height);
    });
    app.insert_resource(Zoom(zoom));
    app.add_systems(EguiPrimaryContextPass, panel::show);
    // Letters that were not shown before are in the texture of letters in the picture that shows them; else they are
    // missing there.
    app.configure_sets(PostUpdate, EguiPostUpdateSet::PostProcessOutput.before(AssetEventSystems));
    if args.trial {
        trial::build(&mut app);
    }
    app.run()
}

/// Messages of the engine and the viewer, and warnings of the rest.
fn quiet() -> LogPlugin {
    LogPlugin {
        filter: "warn,sutura_view=info,sutura_bevy=info,wgpu_hal=error,naga=error,bevy_render::renderer=error".into(),
        ..default()
    }
}

/// How close the first view is.
#[derive(Resource, Debug, Clone, Copy)]
struct Zoom(f32);

fn spawn_camera(mut commands: Commands, orbit: Res<Orbit>, around: Res<Surroundings>) {
    commands.spawn(camera::lens(&orbit, &around));
}

/// A scene that was opened is looked at as soon as its things are there.
fn look_at_new(world: &mut World, mut seen: Local<u64>) {
    let generation = world.resource::<Stage>().generation;
    if *seen == generation || stage::points(world).is_empty() {
        return;
    }
    *seen = generation;
    let zoom = world.resource::<Zoom>().0;
    let aspect = world.query::<&Window>().iter(world).next().map_or(16.0 / 9.0, |w| w.width() / w.height().max(1.0));
    let orbit = stage::frame_view(world, aspect, zoom);
    world.insert_resource(orbit);
}
