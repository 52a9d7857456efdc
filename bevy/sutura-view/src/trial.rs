//! The window tried by itself: everything is shown, what it writes is read back, files are dropped on it, every key is
//! pressed and the mouse drags across the picture, as somebody would who wants to see it break. The first thing that
//! does not do what it should ends it, with words and an exit code.

use crate::camera::Orbit;
use crate::control::Viewer;
use crate::keys::{DRIVE, KEYS};
use crate::stage::Stage;
use bevy::input::ButtonState;
use bevy::input::keyboard::{Key, KeyboardInput, NativeKey};
use bevy::input::mouse::MouseButtonInput;
use bevy::prelude::*;
use bevy::window::{CursorMoved, FileDragAndDrop, PrimaryWindow, WindowCloseRequested};
use bevy_egui::{EguiContext, EguiPrimaryContextPass, PrimaryEguiContext, egui};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use sutura_bevy::sutura::glam::DVec3;
use sutura_bevy::sutura::input::Recording;
use sutura_bevy::{Hand, Held, PhysicsClock, Pointer, PointerCamera, Space, Strand, Sutura};
use sutura_scene::samples;

/// Time that anything may take, and pictures that there are to be in it: the machine may be slow and busy, and some
/// steps do a thing in every picture.
const PATIENCE: (Duration, u32) = (Duration::from_secs(60), 200);

/// What a look at a thing under way says: it is done, not yet, or wrong.
type Verdict = Result<bool, String>;

/// Something to do and what is to come of it. It is looked at in every picture after it was begun, with the number of
/// pictures since.
struct Step {
    name: &'static str,
    act: fn(&mut World, &mut Notes),
    look: fn(&mut World, &mut Notes, u32) -> Verdict,
}

/// What is remembered from one to the next.
struct Notes {
    window: Entity,
    /// Where the viewer writes and files to drop are.
    folder: PathBuf,
    time: f64,
    generation: u64,
    name: String,
    at: Vec2,
    place: Vec3,
    /// Keys that are down.
    down: Vec<KeyCode>,
}

const STEPS: &[Step] = &[
    Step {
        name: "the window shows a scene",
        act: |_, _| (),
        look: |world, _, n| Ok(n >= 20 && !world.resource::<Stage>().frames.is_empty()),
    },
    Step { name: "time goes on while everything is shown", act: show_everything, look: time_goes_on },
    Step { name: "every panel is open", act: |_, _| (), look: panels_are_open },
    Step {
        name: "a picture is written (F12)",
        act: |w, n| press(w, n, KeyCode::F12),
        look: |_, notes, _| pictures(&notes.folder, 1),
    },
    Step {
        name: "a sequence of pictures begins (F11)",
        act: |w, n| press(w, n, KeyCode::F11),
        look: |world, _, n| sequence(world, n, 3),
    },
    Step {
        name: "a sequence of pictures is written (F11)",
        act: |w, n| press(w, n, KeyCode::F11),
        look: sequence_is_written,
    },
    Step {
        name: "it is paused (Space)",
        act: |w, n| press(w, n, KeyCode::Space),
        look: |w, _, _| Ok(!w.resource::<PhysicsClock>().running),
    },
    Step {
        name: "the scene begins again (Backspace)",
        act: |w, n| press(w, n, KeyCode::Backspace),
        look: |w, n, k| opened(w, n, "", k),
    },
    Step { name: "a thread follows the mouse", act: take_thread, look: thread_follows },
    Step {
        name: "what is let go is let go",
        act: |w, n| button(w, n, MouseButton::Left, ButtonState::Released),
        look: |w, _, n| let_go(w, n),
    },
    Step { name: "what was shown is written as GLB (F9)", act: |w, n| press(w, n, KeyCode::F9), look: glb_is_read },
    Step {
        name: "what was done is written and done again (F5)",
        act: |w, n| press(w, n, KeyCode::F5),
        look: input_is_replayed,
    },
    Step {
        name: "a scene dropped on the window is played",
        act: |w, n| drop_file(w, n, "good.toml"),
        look: |w, n, k| opened(w, n, "good.toml", k),
    },
    Step { name: "its time goes on", act: note_time, look: time_goes_on },
    Step {
        name: "a broken scene dropped on the window says what is wrong and where",
        act: |w, n| drop_file(w, n, "broken.toml"),
        look: error_is_shown,
    },
    Step {
        name: "the error goes away (Esc)",
        act: |w, n| press(w, n, KeyCode::Escape),
        look: |w, _, _| Ok(w.resource::<Stage>().error.is_none()),
    },
    Step { name: "and the scene goes on", act: note_time, look: time_goes_on },
    Step {
        name: "a recording dropped on the window is played",
        act: drop_recording,
        look: |w, n, k| opened(w, n, "recording.sutura", k),
    },
    Step { name: "its time goes on too", act: note_time, look: time_goes_on },
    Step {
        name: "the first sample scene (Page down)",
        act: |w, n| press(w, n, KeyCode::PageDown),
        look: |w, n, k| opened(w, n, samples()[0].name, k),
    },
    Step {
        name: "the next one (Page down)",
        act: |w, n| press(w, n, KeyCode::PageDown),
        look: |w, n, k| opened(w, n, samples()[1].name, k),
    },
    Step {
        name: "the one before (Page up)",
        act: |w, n| press(w, n, KeyCode::PageUp),
        look: |w, n, k| opened(w, n, samples()[0].name, k),
    },
    Step {
        name: "from the beginning (Backspace)",
        act: |w, n| press(w, n, KeyCode::Backspace),
        look: |w, n, k| opened(w, n, samples()[0].name, k),
    },
    Step { name: "its time goes on as well", act: note_time, look: time_goes_on },
    Step { name: "every key is pressed and the mouse drags", act: |_, _| (), look: bother },
];

pub(crate) fn build(app: &mut App) {
    let folder = std::env::temp_dir().join(format!("sutura-try-{}", std::process::id()));
    app.world_mut().resource_mut::<Viewer>().folder = folder.clone();
    app.init_resource::<Panels>().add_systems(EguiPrimaryContextPass, measure.after(crate::panel::show));
    let mut run = Run { folder, notes: None, step: 0, begun: None };
    app.add_systems(
        First,
        (move |world: &mut World| run.go_on(world)).before(bevy::ecs::message::MessageUpdateSystems),
    );
}

struct Run {
    folder: PathBuf,
    notes: Option<Notes>,
    step: usize,
    /// When the step began, and pictures since.
    begun: Option<(Instant, u32)>,
}

impl Run {
    fn go_on(&mut self, world: &mut World) {
        let Ok(window) = world.query_filtered::<Entity, With<PrimaryWindow>>().single(world) else { return };
        if self.notes.is_none() {
            if let Err(e) = prepare(&self.folder) {
                return fail(world, "files to drop", &format!("{}: {e}", self.folder.display()));
            }
            let (folder, name) = (self.folder.clone(), String::new());
            self.notes = Some(Notes {
                window,
                folder,
                time: 0.0,
                generation: 0,
                name,
                at: Vec2::ZERO,
                place: Vec3::ZERO,
                down: Vec::new(),
            });
        }
        let Some(notes) = &mut self.notes else { return };
        for key in std::mem::take(&mut notes.down) {
            key_event(world, notes.window, key, ButtonState::Released);
        }
        let Some(step) = STEPS.get(self.step) else {
            if self.step == STEPS.len() {
                // A folder that stays is no fault.
                let _ = std::fs::remove_dir_all(&self.folder);
                println!("trial: all {} steps passed", STEPS.len());
                world.write_message(WindowCloseRequested { window });
                self.step += 1;
            }
            return;
        };
        let Some((when, pictures)) = &mut self.begun else {
            (step.act)(world, notes);
            self.begun = Some((Instant::now(), 0));
            return;
        };
        *pictures += 1;
        match (step.look)(world, notes, *pictures) {
            Ok(true) => (self.step, self.begun) = (self.step + 1, None),
            Ok(false) if when.elapsed() < PATIENCE.0 || *pictures < PATIENCE.1 => {}
            Ok(false) => {
                let clock = world.resource::<PhysicsClock>();
                let state =
                    format!("running {}, {} frames of physics, {:.1} ms each", clock.running, clock.frames, clock.ms);
                fail(
                    world,
                    step.name,
                    &format!(
                        "did not come within {} s and {pictures} pictures ({state}; {})",
                        when.elapsed().as_secs(),
                        world.resource::<Viewer>().message.clone()
                    ),
                );
                self.step = STEPS.len() + 1;
            }
            Err(why) => {
                fail(world, step.name, &why);
                self.step = STEPS.len() + 1;
            }
        }
    }
}

fn fail(world: &mut World, step: &str, why: &str) {
    eprintln!("trial: FAILED: {step}: {why}");
    world.write_message(AppExit::error());
}

/// Files to drop.
fn prepare(folder: &Path) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)?;
    let good = samples().iter().find(|s| s.name == "capstan").map_or("", |s| s.text);
    std::fs::write(folder.join("good.toml"), good)?;
    std::fs::write(folder.join("broken.toml"), "[[thread]]\nname = \"a\"\nlenght = \"10 cm\"\n")
}

// ---- events as the window system gives them ----

fn key_event(world: &mut World, window: Entity, key_code: KeyCode, state: ButtonState) {
    let logical_key = Key::Unidentified(NativeKey::Unidentified);
    world.write_message(KeyboardInput { key_code, logical_key, state, text: None, repeat: false, window });
}

/// A key goes down, and up in the next picture.
fn press(world: &mut World, notes: &mut Notes, key: KeyCode) {
    notes.generation = world.resource::<Stage>().generation;
    key_event(world, notes.window, key, ButtonState::Pressed);
    notes.down.push(key);
}

fn button(world: &mut World, notes: &mut Notes, button: MouseButton, state: ButtonState) {
    world.write_message(MouseButtonInput { button, state, window: notes.window });
}

fn point(world: &mut World, notes: &Notes, position: Vec2) {
    let before = world.get::<Window>(notes.window).and_then(Window::cursor_position);
    if let Some(mut window) = world.get_mut::<Window>(notes.window) {
        window.set_cursor_position(Some(position));
    }
    world.write_message(CursorMoved { window: notes.window, position, delta: before.map(|b| position - b) });
}

fn drop_file(world: &mut World, notes: &mut Notes, file: &str) {
    let stage = world.resource::<Stage>();
    (notes.generation, notes.name) = (stage.generation, stage.name.clone());
    let (window, path_buf) = (notes.window, notes.folder.join(file));
    world.write_message(FileDragAndDrop::HoveredFile { window, path_buf: path_buf.clone() });
    world.write_message(FileDragAndDrop::DroppedFile { window, path_buf });
}

// ---- what is done and looked for ----

fn context(world: &mut World) -> Option<egui::Context> {
    let mut contexts = world.query_filtered::<&mut EguiContext, With<PrimaryEguiContext>>();
    contexts.iter_mut(world).next().map(|mut c| c.get_mut().clone())
}

/// Overlays, help, all panels with all that folds open.
fn show_everything(world: &mut World, notes: &mut Notes) {
    let mut viewer = world.resource_mut::<Viewer>();
    (viewer.tension, viewer.frames, viewer.contacts, viewer.primitives, viewer.knot, viewer.help, viewer.panels) =
        (true, true, true, true, true, true, true);
    if let Some(context) = context(world) {
        context.memory_mut(|m| m.set_everything_is_visible(true));
    }
    note_time(world, notes);
}

fn time(world: &World) -> f64 {
    let stage = world.resource::<Stage>();
    if stage.recorded { stage.time } else { world.resource::<Sutura>().world().time() }
}

fn note_time(world: &mut World, notes: &mut Notes) {
    notes.time = time(world);
}

/// A quarter of a second, while what plays is not stopped and nothing of the past is shown in its place.
fn time_goes_on(world: &mut World, notes: &mut Notes, _: u32) -> Verdict {
    let (stage, clock) = (world.resource::<Stage>(), world.resource::<PhysicsClock>());
    if !clock.running {
        return Err(format!("the scene was paused at {:.3} s, by nobody", time(world)));
    }
    if !stage.recorded && stage.past.is_some() {
        return Err("a frame of the past is shown, which nobody asked for".into());
    }
    let end = stage.frames.last().map_or(0.0, |f| f.time);
    Ok(time(world) > notes.time + 0.25 || (stage.recorded && stage.time >= end && end > notes.time))
}

/// The panels of the last picture, in the order of [`PANELS`]: how high they are; 0 where one is not shown.
#[derive(Resource, Default)]
struct Panels([f32; PANELS.len()]);

const PANELS: [&str; 5] = ["Scene", "Parameters", "Curves", "Keys", "This cannot be opened"];

/// Measures them while they are drawn: egui knows them then only.
fn measure(mut panels: ResMut<Panels>, mut contexts: Query<&mut EguiContext, With<PrimaryEguiContext>>) {
    let Ok(mut context) = contexts.single_mut() else { return };
    let context = context.get_mut();
    panels.0 = PANELS.map(|name| {
        // A window is known by its title, which may be none.
        let id = egui::Id::new(Some(name));
        context.memory(|m| {
            if m.areas().is_visible(&egui::LayerId::new(egui::Order::Middle, id)) {
                m.area_rect(id).map_or(0.0, |r| r.height())
            } else {
                0.0
            }
        })
    });
}

/// Folded, a panel is as high as its title.
fn panels_are_open(world: &mut World, _: &mut Notes, pictures: u32) -> Verdict {
    let folded = PANELS[..4].iter().zip(world.resource::<Panels>().0).find(|(_, height)| *height < 60.0);
    match folded {
        Some((name, height)) if pictures > 30 => Err(format!("the panel `{name}` is {height} high")),
        _ => Ok(folded.is_none()),
    }
}

/// Whether a picture was written that is one; wrong if it shows one color.
fn picture(path: &Path) -> Verdict {
    // It is written by another thread: what cannot be read yet may be under way.
    let Ok(file) = std::fs::File::open(path) else { return Ok(false) };
    let Ok(mut reader) = png::Decoder::new(std::io::BufReader::new(file)).read_info() else { return Ok(false) };
    let mut data = vec![0; reader.output_buffer_size().unwrap_or(0)];
    let Ok(info) = reader.next_frame(&mut data) else { return Ok(false) };
    let bytes = info.color_type.samples();
    let colors: std::collections::BTreeSet<&[u8]> =
        data[..info.buffer_size()].chunks_exact(bytes).map(|p| &p[..bytes.min(3)]).collect();
    if colors.len() < 20 { Err(format!("{} has {} colors", path.display(), colors.len())) } else { Ok(true) }
}

/// Whether the first of the viewer's pictures are there.
fn pictures(folder: &Path, n: u32) -> Verdict {
    (1..=n).try_fold(true, |all, k| Ok(all && picture(&folder.join(format!("{k:03}.png")))?))
}

fn sequence(world: &World, _: u32, least: u32) -> Verdict {
    Ok(world.resource::<Viewer>().sequence.as_ref().is_some_and(|s| s.1 >= least))
}

fn sequence_is_written(world: &mut World, notes: &mut Notes, pictures: u32) -> Verdict {
    if world.resource::<Viewer>().sequence.is_some() {
        return if pictures > 5 { Err("it does not end".into()) } else { Ok(false) };
    }
    let folder = notes.folder.join("002-frames");
    (0..3).try_fold(true, |all, k| Ok(all && picture(&folder.join(format!("{k:05}.png")))?))
}

/// The pointer goes to the middle of the first thread, and its button down.
fn take_thread(world: &mut World, notes: &mut Notes) {
    // Where the panels leave room: they have the pointer where they are.
    (world.resource_mut::<Viewer>().panels, world.resource_mut::<Viewer>().help) = (false, false);
    if let Some(context) = context(world) {
        context.memory_mut(|m| m.set_everything_is_visible(false));
    }
    world.resource_mut::<Orbit>().go_home();
    notes.at = Vec2::ZERO;
}

/// The pointer takes a thread while the scene is paused, since one that falls may be gone when a slow picture shows
/// where it was. Then the scene goes on, and the pointer moves up by a part of the window's height, where a thread that
/// hangs has room.
fn thread_follows(world: &mut World, notes: &mut Notes, pictures: u32) -> Verdict {
    let up = world.get::<Window>(notes.window).map_or(0.0, Window::height) / 12.0;
    match pictures {
        // Panels are gone, and the camera is there.
        0..5 => Ok(false),
        5 => {
            notes.at = middle(world).ok_or("no thread is in the picture")?;
            let at = notes.at;
            point(world, notes, at);
            Ok(false)
        }
        6 => {
            button(world, notes, MouseButton::Left, ButtonState::Pressed);
            Ok(false)
        }
        7 => Ok(false),
        8 => {
            let grip = grip_of_hand(world, notes)?;
            notes.place = world.resource::<Space>().place(grip);
            press(world, notes, KeyCode::Space);
            Ok(false)
        }
        9..30 => {
            grip_of_hand(world, notes)?;
            let at = notes.at - Vec2::new(0.0, up * (pictures - 8) as f32 / 21.0);
            point(world, notes, at);
            Ok(false)
        }
        _ => {
            let now = grip_of_hand(world, notes)?;
            let moved =
                pixels(world, world.resource::<Space>().place(now)).zip(pixels(world, notes.place)).map(|(a, b)| a - b);
            match moved {
                Some(m) if m.x.abs() < 6.0 && (m.y + up).abs() < 6.0 => Ok(true),
                _ if pictures < 60 => Ok(false),
                _ => Err(format!("the mouse went {up} pixels up, what it holds {moved:?}")),
            }
        }
    }
}

/// Where the mouse holds a thread.
fn grip_of_hand(world: &mut World, notes: &Notes) -> Result<DVec3, String> {
    match world.resource::<Hand>().held {
        Some(Held::Thread(grip)) => {
            world.get::<sutura_bevy::Grip>(grip).map(|g| g.pose().position).ok_or_else(|| "its grip is gone".into())
        }
        _ => Err(nothing_held(world, notes)),
    }
}

fn nothing_held(world: &mut World, notes: &Notes) -> String {
    let cursor = world.get::<Window>(notes.window).and_then(Window::cursor_position);
    let (at, thread, pointer) = (notes.at, middle(world), world.resource::<Pointer>());
    let state = format!(
        "{}, {}",
        if pointer.busy { "over a panel" } else { "over no panel" },
        if pointer.pressed { "button down" } else { "button up" }
    );
    format!("the mouse holds nothing: it went to {at}, is at {cursor:?} ({state}), a thread at {thread:?}")
}

/// A point in the picture.
fn pixels(world: &World, at: Vec3) -> Option<Vec2> {
    let mut cameras = world.try_query_filtered::<(&Camera, &GlobalTransform), With<PointerCamera>>()?;
    let (camera, place) = cameras.single(world).ok()?;
    camera.world_to_viewport(place, at).ok()
}

/// The middle of the first thread that has it in the picture.
fn middle(world: &mut World) -> Option<Vec2> {
    let space = *world.resource::<Space>();
    let size = world.query_filtered::<&Window, With<PrimaryWindow>>().single(world).ok()?.size();
    let places: Vec<_> = world
        .query::<&Strand>()
        .iter(world)
        .filter_map(|s| s.positions.get(s.positions.len() / 2))
        .map(|p| space.place(*p))
        .collect();
    places.into_iter().filter_map(|p| pixels(world, p)).find(|p| p.min_element() > 0.0 && p.cmplt(size).all())
}

fn let_go(world: &mut World, pictures: u32) -> Verdict {
    let held = world.resource::<Hand>().held;
    if held.is_some() && pictures > 3 { Err(format!("the mouse still holds {held:?}")) } else { Ok(held.is_none()) }
}

/// The file that the viewer wrote last with this ending.
fn written(folder: &Path, ending: &str) -> Option<PathBuf> {
    let files = std::fs::read_dir(folder).ok()?.filter_map(|e| Some(e.ok()?.path()));
    let numbered =
        |p: &PathBuf| p.extension().is_some_and(|e| e == ending) && p.file_stem().is_some_and(|s| s.len() == 3);
    files.filter(numbered).max()
}

fn glb_is_read(world: &mut World, notes: &mut Notes, pictures: u32) -> Verdict {
    let Some(path) = written(&notes.folder, "glb") else {
        return if pictures > 5 {
            Err(format!("there is no file; {}", world.resource::<Viewer>().message))
        } else {
            Ok(false)
        };
    };
    let bytes = std::fs::read(&path).map_err(|e| e.to_string())?;
    let file = gltf::Gltf::from_slice(&bytes).map_err(|e| format!("{}: {e}", path.display()))?;
    let keys = file
        .animations()
        .flat_map(|a| a.channels().map(|c| c.sampler().input().count()).collect::<Vec<_>>())
        .max()
        .unwrap_or(0);
    if file.skins().count() == 0 || keys < 5 {
        return Err(format!("{} skins, {keys} keys of animation", file.skins().count()));
    }
    Ok(true)
}

fn input_is_replayed(world: &mut World, notes: &mut Notes, pictures: u32) -> Verdict {
    let Some(path) = written(&notes.folder, "sutura") else {
        return if pictures > 5 {
            Err(format!("there is no file; {}", world.resource::<Viewer>().message))
        } else {
            Ok(false)
        };
    };
    let bytes = std::fs::read(&path).map_err(|e| e.to_string())?;
    let recording = Recording::from_bytes(&bytes).map_err(|e| format!("{}: {e}", path.display()))?;
    let (mut steps, mut other) = (0, None);
    let replayed = recording.replay(&mut |step| {
        steps = step.step;
        if step.is_same() {
            return ControlFlow::Continue(());
        }
        other = Some(step.step);
        ControlFlow::Break(())
    });
    replayed.map_err(|e| e.to_string())?;
    match other {
        Some(step) => Err(format!("step {step} is not the same again")),
        None if steps < 10 => Err(format!("only {steps} steps")),
        None => Ok(true),
    }
}

fn drop_recording(world: &mut World, notes: &mut Notes) {
    if let Err(e) = world.resource::<Stage>().trajectory().write_to(&notes.folder.join("recording.sutura")) {
        world.resource_mut::<Viewer>().message = e.to_string();
    }
    drop_file(world, notes, "recording.sutura");
}

/// What was asked for is on view.
fn opened(world: &mut World, notes: &mut Notes, name: &str, pictures: u32) -> Verdict {
    let stage = world.resource::<Stage>();
    if let Some(error) = &stage.error {
        return Err(error.clone());
    }
    if stage.generation == notes.generation {
        return if pictures > 5 { Err(format!("`{}` is still on view", stage.name)) } else { Ok(false) };
    }
    if !stage.name.ends_with(name) {
        return Err(format!("`{}` is on view, not `{name}`", stage.name));
    }
    Ok(true)
}

fn error_is_shown(world: &mut World, notes: &mut Notes, pictures: u32) -> Verdict {
    let stage = world.resource::<Stage>();
    let (error, kept) = (stage.error.clone(), stage.generation == notes.generation && stage.name == notes.name);
    let Some(error) = error else { return if pictures > 5 { Err("no error is shown".into()) } else { Ok(false) } };
    if let Some(missing) = ["broken.toml:3", "lenght"].into_iter().find(|w| !error.contains(w)) {
        return Err(format!("it does not say `{missing}`: {error}"));
    }
    if !kept {
        return Err("what was on view is lost".into());
    }
    let shown = world.resource::<Panels>().0[4] > 30.0;
    if !shown && pictures > 5 { Err("its window is not there".into()) } else { Ok(shown) }
}

/// In each picture the next thing is done: a key goes down, or the mouse moves with its button down.
fn bother(world: &mut World, notes: &mut Notes, pictures: u32) -> Verdict {
    let turn = pictures as usize - 1;
    let keys: Vec<KeyCode> = KEYS.iter().map(|k| k.0).chain(DRIVE.into_iter().flatten()).collect();
    if let Some(code) = keys.get(turn / 2) {
        if turn.is_multiple_of(2) {
            press(world, notes, *code);
        }
        return Ok(false);
    }
    let turn = turn - 2 * keys.len();
    let size = world.get::<Window>(notes.window).map_or(Vec2::ONE, Window::size);
    // Two drags, one with each button, from corner to corner.
    let which = if turn < 20 { MouseButton::Left } else { MouseButton::Right };
    match turn % 20 {
        _ if turn >= 40 => return Ok(true),
        0 => button(world, notes, which, ButtonState::Pressed),
        19 => button(world, notes, which, ButtonState::Released),
        k => point(world, notes, size * (k as f32 / 20.0)),
    }
    Ok(false)
}
