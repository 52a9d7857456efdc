//! The viewer without a window or a renderer: keys, files, time.

use bevy::input::keyboard::{Key, KeyboardInput, NativeKey};
use bevy::input::{ButtonState, InputPlugin};
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy::window::FileDragAndDrop;
use std::time::Duration;
use sutura_bevy::sutura::glam::DVec3;
use sutura_bevy::sutura::input::{Input, Recording};
use sutura_bevy::sutura::{
    Friction, Handle, Integrator, Material, PaperSettings, Plasticity, Rod, Settings, Solver, Stretch, World as Engine,
};
use sutura_bevy::{Grip, Hand, Held, Live, PhysicsClock, Pointer, Space, Sutura};
use sutura_view::ViewerPlugin;
use sutura_view::control::{Viewer, go_to, open};
use sutura_view::keys::{DRIVE, KEYS};
use sutura_view::parameters::{Change, Parameters};
use sutura_view::source::Play;
use sutura_view::stage::Stage;

fn app(scene: &str, folder: &std::path::Path) -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, InputPlugin, ViewerPlugin));
    app.add_message::<FileDragAndDrop>();
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f64(1.0 / 60.0)));
    app.world_mut().resource_mut::<PhysicsClock>().budget = Duration::from_secs(1000);
    app.world_mut().resource_mut::<Viewer>().folder = folder.to_path_buf();
    open(app.world_mut(), scene);
    app.update();
    app
}

/// A key as the window reports it.
fn key(app: &mut App, key_code: KeyCode, state: ButtonState) {
    let logical_key = Key::Unidentified(NativeKey::Unidentified);
    app.world_mut().write_message(KeyboardInput {
        key_code,
        logical_key,
        state,
        text: None,
        repeat: false,
        window: Entity::PLACEHOLDER,
    });
}

fn press(app: &mut App, code: KeyCode) {
    key(app, code, ButtonState::Pressed);
    app.update();
    key(app, code, ButtonState::Released);
    app.update();
}

#[test]
fn every_key_in_any_state_does_no_harm() {
    let folder = tempfile::tempdir().unwrap();
    let mut app = app("catenary", folder.path());
    // One frame of physics a picture: keys make it sixteen times as fast, and scenes may be heavy.
    app.world_mut().resource_mut::<PhysicsClock>().budget = Duration::ZERO;
    // In a scene, then in what stands there after a file that cannot be opened, then in a recording.
    let recording = folder.path().join("trajectory.sutura");
    for round in 0..3 {
        let keys: Vec<KeyCode> = KEYS.iter().map(|k| k.0).chain(DRIVE.into_iter().flatten()).collect();
        for code in keys {
            press(&mut app, code);
            // Help and messages are in the way of nothing.
            app.world_mut().resource_mut::<Viewer>().open = None;
        }
        // Two at a time, held while time goes on.
        for pair in KEYS.windows(2) {
            key(&mut app, pair[0].0, ButtonState::Pressed);
            press(&mut app, pair[1].0);
            key(&mut app, pair[0].0, ButtonState::Released);
        }
        if round == 0 {
            let trajectory = app.world().resource::<Stage>().trajectory();
            assert!(!trajectory.frames.is_empty());
            trajectory.write_to(&recording).unwrap();
            open(app.world_mut(), "/no/such/file.toml");
            assert!(app.world().resource::<Stage>().error.is_some());
        } else {
            open(app.world_mut(), recording.to_str().unwrap());
            assert!(app.world().resource::<Stage>().recorded, "{:?}", app.world().resource::<Stage>().error);
        }
        app.update();
    }
    assert!(!app.should_exit().is_some_and(|e| e.is_error()));
}

#[test]
fn a_recording_and_the_past_show_the_tensions_that_there_were() {
    let folder = tempfile::tempdir().unwrap();
    let mut app = app("catenary", folder.path());
    let tensions = |app: &mut App| -> Vec<f64> {
        app.world_mut().query::<&sutura_bevy::Strand>().iter(app.world()).next().unwrap().tensions.clone()
    };
    while app.world().resource::<Stage>().frames.len() < 40 {
        app.update();
    }
    let then = app.world().resource::<Stage>().frames[20].clone();
    let forces = then.forces.clone().unwrap();
    let recorded: Vec<f64> = forces.tensions[0].iter().map(|t| f64::from(*t)).collect();
    assert!(recorded.iter().any(|t| *t > 1e-5) && forces.grips.iter().any(|f| f[2] > 1e-5), "{forces:?}");
    go_to(app.world_mut(), then.time);
    app.update();
    assert_eq!(tensions(&mut app), recorded);
    let recording = folder.path().join("trajectory.sutura");
    app.world().resource::<Stage>().trajectory().write_to(&recording).unwrap();
    open(app.world_mut(), recording.to_str().unwrap());
    go_to(app.world_mut(), then.time);
    app.update();
    assert_eq!(app.world().resource::<Stage>().shown().unwrap().time, then.time);
    assert_eq!(tensions(&mut app), recorded);
}

#[test]
fn a_bad_scene_shows_its_error_and_what_was_there_stays() {
    let folder = tempfile::tempdir().unwrap();
    let mut app = app("catenary", folder.path());
    let bad = folder.path().join("bad.toml");
    std::fs::write(&bad, "[[thread]]\nname = \"a\"\nlenght = \"10 cm\"\n").unwrap();
    app.world_mut().write_message(FileDragAndDrop::DroppedFile { window: Entity::PLACEHOLDER, path_buf: bad });
    app.update();
    let stage = app.world().resource::<Stage>();
    let said = stage.error.clone().unwrap();
    assert!(said.contains("bad.toml") && said.contains("lenght"), "{said}");
    assert_eq!(stage.name, "catenary");
    assert!(app.world().resource::<Sutura>().simulation::<Play>().is_some());
    // A good one dropped next is opened.
    let good = folder.path().join("good.toml");
    std::fs::write(&good, sutura_scene::samples().iter().find(|s| s.name == "capstan").unwrap().text).unwrap();
    app.world_mut().write_message(FileDragAndDrop::DroppedFile { window: Entity::PLACEHOLDER, path_buf: good });
    app.update();
    let stage = app.world().resource::<Stage>();
    assert!(stage.error.is_none() && stage.name.ends_with("good.toml"));
}

#[test]
fn the_past_is_remembered_and_the_present_goes_on_from_where_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let mut app = app("catenary", folder.path());
    for _ in 0..30 {
        app.update();
    }
    let now = app.world().resource::<Sutura>().world().time();
    let hash = app.world().resource::<Sutura>().world().state_hash();
    press(&mut app, KeyCode::ArrowLeft);
    let stage = app.world().resource::<Stage>();
    assert!((stage.shown().unwrap().time - (now - 0.1)).abs() < 0.02);
    assert!(!app.world().resource::<Live>().0 && !app.world().resource::<PhysicsClock>().running);
    press(&mut app, KeyCode::Home);
    assert_eq!(app.world().resource::<Stage>().past, Some(0));
    press(&mut app, KeyCode::End);
    assert!(app.world().resource::<Live>().0);
    // Looking at the past changed nothing.
    assert_eq!(app.world().resource::<Sutura>().world().state_hash(), hash);
    press(&mut app, KeyCode::Period);
    let one = app.world().resource::<Sutura>().world().time();
    assert!((one - now - 1.0 / 60.0).abs() < 1e-9, "{one} {now}");
    // From the beginning.
    press(&mut app, KeyCode::Backspace);
    assert!(app.world().resource::<Sutura>().world().time() < 0.1);
}

#[test]
fn a_hand_in_a_scene_is_recorded_with_it_and_done_again() {
    let folder = tempfile::tempdir().unwrap();
    let mut app = app("free_thread", folder.path());
    let rod = |app: &App| {
        let world = app.world().resource::<Sutura>().world();
        let rod = world.view().rods().next().unwrap();
        rod.positions()[rod.n_elements() / 2]
    };
    let at = rod(&app);
    let space = *app.world().resource::<Space>();
    let look = |app: &mut App, at: DVec3, pressed: bool| {
        let ray =
            Ray3d::new(space.place(at + DVec3::new(0.0, -0.3, 0.0)), Dir3::new(space.direction(DVec3::Y)).unwrap());
        let mut pointer = app.world_mut().resource_mut::<Pointer>();
        (pointer.ray, pointer.forward, pointer.pressed, pointer.reach) =
            (Some(ray), space.direction(DVec3::Y), pressed, 0.02);
        app.update();
    };
    look(&mut app, at, true);
    assert!(matches!(app.world().resource::<Hand>().held, Some(Held::Thread(_))));
    let mut most = 0.0f64;
    for k in 1..=30 {
        look(&mut app, at + DVec3::new(-0.0005, 0.0, 0.001) * f64::from(k), true);
        most = most.max(app.world().resource::<Hand>().force.length());
    }
    assert!((rod(&app) - at - DVec3::new(-0.015, 0.0, 0.03)).length() < 1e-4, "{}", rod(&app) - at);
    assert!(most > 0.0);
    look(&mut app, at, false);
    assert_eq!(app.world().resource::<Hand>().held, None);
    assert_done_again(&mut app, folder.path());
}

/// The file of what was done, written by its key, gives the same state.
fn assert_done_again(app: &mut App, folder: &std::path::Path) -> Recording {
    press(app, KeyCode::Space);
    press(app, KeyCode::F5);
    let file = std::fs::read_dir(folder)
        .unwrap()
        .filter_map(Result::ok)
        .map(|e| e.path())
        .find(|p| p.extension().is_some_and(|e| e == "sutura"));
    let bytes = std::fs::read(file.unwrap()).unwrap();
    let recording = Recording::from_bytes(&bytes).unwrap();
    let again = recording.replay(&mut |step| {
        assert!(step.is_same(), "step {}", step.step);
        std::ops::ControlFlow::Continue(())
    });
    assert_eq!(again.unwrap().state_hash(), app.world().resource::<Sutura>().world().state_hash());
    recording
}

fn engine(app: &App) -> &Engine {
    app.world().resource::<Sutura>().world()
}

fn first_thread(app: &App) -> Handle<Rod> {
    app.world().resource::<Sutura>().simulation::<Play>().unwrap().0.threads().next().unwrap().1
}

/// What the panel does, and some frames after it.
fn change(app: &mut App, changes: Vec<Change>) {
    app.world_mut().resource_mut::<Parameters>().wanted.extend(changes);
    for _ in 0..10 {
        app.update();
    }
}

#[test]
fn what_is_changed_while_it_runs_is_recorded_and_done_again() {
    let folder = tempfile::tempdir().unwrap();
    let mut app = app("free_thread", folder.path());
    change(&mut app, vec![]);
    let rod = first_thread(&app);
    let (settings, material) = (engine(&app).settings().clone(), engine(&app).rod(rod).unwrap().material().clone());
    let lowest =
        |app: &App| engine(app).rod(rod).unwrap().positions().iter().map(|x| x.z).fold(f64::INFINITY, f64::min);
    let plastic = Plasticity { yield_curvature: 50.0, yield_twist: 80.0, hardening: 0.1 };
    let soft =
        Material { young_modulus: 0.1 * material.young_modulus, density: 3.0 * material.density, ..material.clone() };
    change(&mut app, vec![Change::Material(rod, soft.clone()), Change::Friction(0, 0, Friction::coulomb(0.7))]);
    assert_eq!(engine(&app).rod(rod).unwrap().material(), &soft);
    assert_eq!(engine(&app).friction(0, 0), Friction::coulomb(0.7));
    let other = if engine(&app).rod(rod).unwrap().stretch() == Stretch::Elastic {
        Stretch::Inextensible
    } else {
        Stretch::Elastic
    };
    change(&mut app, vec![Change::Stretch(rod, other)]);
    assert_eq!(engine(&app).rod(rod).unwrap().stretch(), other);
    let paper = Settings {
        solver: Solver::Paper(PaperSettings::default()),
        integrator: Integrator::TrBdf2,
        ..settings.clone()
    };
    change(&mut app, vec![Change::Settings(paper.clone())]);
    assert_eq!(engine(&app).settings(), &paper);
    let low = lowest(&app);
    change(&mut app, vec![]);
    assert_ne!(lowest(&app), low, "it moves");
    change(&mut app, vec![Change::Settings(Settings { integrator: Integrator::TrBdf2, ..settings.clone() })]);
    change(
        &mut app,
        vec![Change::Material(rod, Material { plasticity: Some(plastic), bend_damping: 0.01, ..soft.clone() })],
    );
    // Refused: it says why, and nothing changes, nor is what follows it done.
    let before = engine(&app).settings().clone();
    app.world_mut().resource_mut::<PhysicsClock>().running = false;
    let hash = engine(&app).state_hash();
    change(&mut app, vec![Change::Settings(paper), Change::Material(rod, material.clone())]);
    let error = app.world().resource::<Parameters>().error.clone().unwrap();
    assert!(error.contains("plastic set"), "{error}");
    change(&mut app, vec![Change::Material(rod, Material { density: -1.0, ..material.clone() })]);
    let error = app.world().resource::<Parameters>().error.clone().unwrap();
    assert!(error.contains("density"), "{error}");
    assert_eq!((engine(&app).settings(), engine(&app).state_hash()), (&before, hash));
    // Everything back.
    let changed = app.world().resource::<Parameters>().changed(engine(&app));
    assert_eq!(changed.len(), 4, "{changed:?}");
    app.world_mut().resource_mut::<PhysicsClock>().running = true;
    change(&mut app, changed);
    assert_eq!(app.world().resource::<Parameters>().error, None);
    assert!(app.world().resource::<Parameters>().changed(engine(&app)).is_empty());
    assert_eq!((engine(&app).settings(), engine(&app).rod(rod).unwrap().material()), (&settings, &material));
    let recording = assert_done_again(&mut app, folder.path());
    let count = |of: fn(&Input) -> bool| recording.inputs.iter().filter(|i| of(i)).count();
    assert_eq!(count(|i| matches!(i, Input::SetMaterial(..))), 3);
    assert_eq!(count(|i| matches!(i, Input::SetStretch(..))), 2);
    // Another scene has its own.
    open(app.world_mut(), "capstan");
    app.update();
    assert!(app.world().resource::<Parameters>().changed(engine(&app)).is_empty());
}

#[test]
fn keys_take_two_ends_and_move_them() {
    let folder = tempfile::tempdir().unwrap();
    // Both ends are held by the scene: its grips are taken over.
    let mut app = app("catenary", folder.path());
    press(&mut app, KeyCode::Digit1);
    press(&mut app, KeyCode::Digit2);
    for _ in 0..5 {
        app.update();
    }
    let poses = |app: &mut App| {
        let grips = app.world().resource::<Viewer>().grips;
        grips.map(|g| app.world().get::<Grip>(g.unwrap()).unwrap().pose().position)
    };
    let before = poses(&mut app);
    for code in [KeyCode::KeyW, KeyCode::KeyK] {
        key(&mut app, code, ButtonState::Pressed);
    }
    for _ in 0..30 {
        app.update();
    }
    let after = poses(&mut app);
    let speed = app.world().resource::<Viewer>().grip_speed;
    // One up and one down in the picture, at the speed of the keys.
    for (side, way) in [(0, 1.0), (1, -1.0)] {
        let moved = after[side] - before[side];
        assert!((moved.length() - 0.5 * speed).abs() < 0.05 * speed, "{moved}");
        assert!(moved.z * way > 0.0, "{moved}");
    }
    press(&mut app, KeyCode::Digit1);
    assert!(app.world().resource::<Viewer>().grips[0].is_none() && app.world().resource::<Viewer>().grips[1].is_some());
}

/// A thread between a grip that the scene moves to and fro, and one that it lets rest; a bar that it moves.
const TAKEN: &str = r#"
[solver]
gravity = [0, 0, 0]
linear_damping = 0.9
[[thread]]
name = "thread"
diameter = "0.4 mm"
young_modulus = "0.1 GPa"
density = "1150 kg/m^3"
elements = 40
line = { from = [0, 0, 0], to = "[100, 0, 0] mm" }
[[shape]]
name = "bar"
kind = "sphere"
radius = "5 mm"
position = "[50, 0, 40] mm"
[[grip]]
name = "left"
at = "start"
hold = "pin"
[[grip]]
name = "right"
at = "end"
hold = "pin"
[[phase]]
name = "one"
duration = "4 s"
action = [
  { move = "right", keys = [{ to = "[80, 0, 0] mm", duration = "2 s" }] },
  { move = "bar", keys = [{ to = "[50, 0, 60] mm", duration = "2 s" }] },
]
[[phase]]
name = "two"
duration = "3 s"
action = [{ move = "right", keys = [{ to = "[70, 0, 0] mm", duration = "1 s" }] }]
"#;

fn incidents(app: &App) -> u64 {
    let sutura = app.world().resource::<Sutura>();
    sutura.incidents.len() as u64 + sutura.simulation::<Play>().unwrap().0.incidents().map(|i| i.count).sum::<u64>()
}

/// Goes on by pictures; the fastest that the thing moved \[m/s\].
fn fastest(app: &mut App, pictures: u32, at: &dyn Fn(&App) -> DVec3) -> f64 {
    let mut most = 0.0f64;
    for _ in 0..pictures {
        let before = at(app);
        app.update();
        most = most.max((at(app) - before).length() * 60.0);
    }
    most
}

#[test]
fn what_is_taken_over_stays_where_it_was_left_and_goes_back_without_a_jump() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("taken.toml");
    std::fs::write(&scene, TAKEN).unwrap();
    let mut app = app(scene.to_str().unwrap(), folder.path());
    assert_eq!(app.world().resource::<Stage>().error, None);
    let right = |app: &App| {
        let play = app.world().resource::<Sutura>().simulation::<Play>().unwrap();
        let (_, grip) = play.0.grips().find(|g| g.0 == "right").unwrap();
        play.0.world().grip_pose(grip.unwrap()).unwrap().position
    };
    let bar = |app: &App| {
        app.world().resource::<Sutura>().simulation::<Play>().unwrap().0.shape_poses().next().unwrap().position
    };
    let time = |app: &App| app.world().resource::<Sutura>().simulation::<Play>().unwrap().0.time();
    // In the middle of its motion the keys take the grip over: it stands, then goes where they lead it.
    fastest(&mut app, 30, &right);
    press(&mut app, KeyCode::Digit2);
    let taken = right(&app);
    assert!(fastest(&mut app, 10, &right) < 1e-9);
    key(&mut app, KeyCode::KeyI, ButtonState::Pressed);
    let fast = fastest(&mut app, 30, &right);
    key(&mut app, KeyCode::KeyI, ButtonState::Released);
    assert!((0.9..1.01).contains(&(fast / app.world().resource::<Viewer>().grip_speed)), "{fast}");
    app.update();
    let led = right(&app) - taken;
    assert!(led.z > 0.008, "{led}");
    // Let go, it stays there, though the scene's motion goes on.
    press(&mut app, KeyCode::Digit2);
    assert!(fastest(&mut app, 20, &right) < 1e-9);
    assert!(time(&app) < 2.0);
    // Given back, it goes to where the scene has it, smoothly: no faster than 5 cm/s beside the scene's own motion (at
    // most 19 mm/s).
    press(&mut app, KeyCode::KeyG);
    let fast = fastest(&mut app, 60, &right);
    assert!(fast > 0.01 && fast < 0.05 + 0.019, "{fast}");
    while time(&app) < 2.1 {
        app.update();
    }
    assert!((right(&app) - DVec3::new(0.08, 0.0, 0.0)).length() < 1e-7, "{}", right(&app));
    // Taken again, and left: the next phase moves it from where it is.
    press(&mut app, KeyCode::Digit2);
    key(&mut app, KeyCode::KeyI, ButtonState::Pressed);
    fastest(&mut app, 20, &right);
    key(&mut app, KeyCode::KeyI, ButtonState::Released);
    app.update();
    press(&mut app, KeyCode::Digit2);
    let left = right(&app);
    assert!(left.z > 0.005 && time(&app) < 4.0, "{left} {}", time(&app));
    let mut fast = 0.0f64;
    while time(&app) < 5.2 {
        fast = fast.max(fastest(&mut app, 1, &right));
    }
    assert!((right(&app) - DVec3::new(0.07, 0.0, 0.0)).length() < 1e-7, "{}", right(&app));
    assert!(fast < 2.0 * (left - right(&app)).length(), "{fast}");
    // The same with the bar, by the mouse.
    let space = *app.world().resource::<Space>();
    let look = |app: &mut App, at: DVec3, pressed: bool| {
        let ray =
            Ray3d::new(space.place(at + DVec3::new(0.0, -0.3, 0.0)), Dir3::new(space.direction(DVec3::Y)).unwrap());
        let mut pointer = app.world_mut().resource_mut::<Pointer>();
        (pointer.ray, pointer.forward, pointer.pressed, pointer.reach) =
            (Some(ray), space.direction(DVec3::Y), pressed, 0.002);
        app.update();
    };
    let home = bar(&app);
    look(&mut app, home, true);
    assert!(matches!(app.world().resource::<Hand>().held, Some(Held::Body(_))));
    for k in 1..=30 {
        look(&mut app, home + DVec3::X * 0.0005 * f64::from(k), true);
    }
    look(&mut app, home, false);
    assert!((bar(&app) - home - DVec3::X * 0.015).length() < 1e-6);
    assert!(fastest(&mut app, 20, &bar) < 1e-9);
    // The scene is over: it is given back all the same.
    while !app.world().resource::<Sutura>().simulation::<Play>().unwrap().0.now().finished {
        app.update();
    }
    press(&mut app, KeyCode::KeyG);
    let fast = fastest(&mut app, 60, &bar);
    assert!(fast > 0.03 && fast < 0.0501, "{fast}");
    assert!((bar(&app) - home).length() < 1e-9);
    assert_eq!(app.world().resource::<Sutura>().simulation::<Play>().unwrap().0.lent().count(), 0);
    assert_eq!(incidents(&app), 0);
    // All of it is done again bit for bit.
    let sutura = app.world().resource::<Sutura>();
    let bytes = sutura.recording().unwrap().to_bytes();
    let again = Recording::from_bytes(&bytes).unwrap().replay(&mut |step| {
        assert!(step.is_same(), "step {}", step.step);
        std::ops::ControlFlow::Continue(())
    });
    assert_eq!(again.unwrap().state_hash(), sutura.world().state_hash());
}

#[test]
fn a_key_moves_its_grip_in_the_physics_of_the_same_picture() {
    let folder = tempfile::tempdir().unwrap();
    let mut app = app("catenary", folder.path());
    press(&mut app, KeyCode::Digit1);
    let pose = |app: &App| {
        app.world().get::<Grip>(app.world().resource::<Viewer>().grips[0].unwrap()).unwrap().pose().position
    };
    let (before, frames) = (pose(&app), app.world().resource::<PhysicsClock>().frames);
    key(&mut app, KeyCode::KeyW, ButtonState::Pressed);
    app.update();
    let clock = app.world().resource::<PhysicsClock>();
    assert_eq!(clock.frames, frames + 1);
    let wanted = app.world().resource::<Viewer>().grip_speed * clock.frame;
    let moved = (pose(&app) - before).length();
    assert!((moved / wanted - 1.0).abs() < 0.05, "{moved} of {wanted}");
    // And stops with it.
    key(&mut app, KeyCode::KeyW, ButtonState::Released);
    let there = pose(&app);
    app.update();
    assert!((pose(&app) - there).length() < 1e-9);
}

#[test]
fn the_present_is_written_as_glb() {
    let folder = tempfile::tempdir().unwrap();
    let mut app = app("catenary", folder.path());
    for _ in 0..10 {
        app.update();
    }
    press(&mut app, KeyCode::F9);
    let message = app.world().resource::<Viewer>().message.clone();
    let bytes = std::fs::read(folder.path().join("001.glb")).unwrap_or_else(|e| panic!("{e}: {message}"));
    assert_eq!(&bytes[..4], b"glTF");
}
