//! What the viewer does with time, keys and files.

use crate::camera::Orbit;
use crate::keys::{Action, DRIVE, KEYS};
use crate::source::Play;
use crate::stage::{self, Prop, Stage};
use bevy::prelude::*;
use bevy::render::view::screenshot::{Screenshot, save_to_disk};
use bevy::window::{FileDragAndDrop, PrimaryWindow};
use std::path::PathBuf;
use sutura_bevy::sutura::glam::{DQuat, DVec3};
use sutura_bevy::sutura::{Hold, Place, Pose};
use sutura_bevy::{Body, Grip, Hand, Live, Part, PhysicsClock, Simulation as _, Space, Strand, Sutura, Thread};
use sutura_scene::export::{Exporter, Format, Moment, Options};
use sutura_scene::samples;

/// What is shown beside the scene, and what is wanted of the viewer.
#[derive(Resource, Debug, Clone)]
pub struct Viewer {
    /// Tension as color.
    pub tension: bool,
    /// Tension that is shown as blue and as red \[N\].
    pub tension_scale: (f64, f64),
    /// Whether that is as somebody wants it, and does not follow what there is.
    pub tension_fixed: bool,
    /// Material frames.
    pub frames: bool,
    /// Contacts.
    pub contacts: bool,
    /// Collision primitives.
    pub primitives: bool,
    /// Tips of instruments where grips hold.
    pub instruments: bool,
    /// Which knot it is.
    pub knot: bool,
    /// Least width at which a thread is drawn \[pixels\]; 0 draws it as thin as it is.
    pub least_width: f32,
    /// Panels.
    pub panels: bool,
    /// Help.
    pub help: bool,
    /// What to open.
    pub open: Option<String>,
    /// What was done last, in words.
    pub message: String,
    /// Grips of the keyboard.
    pub grips: [Option<Entity>; 2],
    /// Speed of the grips of the keyboard \[m/s\].
    pub grip_speed: f64,
    /// Folder of a sequence of pictures under way, and its next number.
    pub sequence: Option<(PathBuf, u32)>,
    /// Where files go.
    pub folder: PathBuf,
    /// Actions wanted by keys and buttons, in order.
    pub wanted: Vec<Action>,
}

impl Default for Viewer {
    fn default() -> Self {
        Viewer {
            tension: false,
            tension_scale: (0.0, 1e-3),
            tension_fixed: false,
            frames: false,
            contacts: false,
            primitives: false,
            instruments: true,
            knot: true,
            least_width: 3.0,
            panels: true,
            help: false,
            open: None,
            message: String::new(),
            grips: [None; 2],
            grip_speed: 0.02,
            sequence: None,
            folder: PathBuf::from("out/view"),
            wanted: Vec::new(),
        }
    }
}

/// Whether the keyboard belongs to a field of a panel.
#[derive(Resource, Debug, Default)]
pub struct Typing(pub bool);

/// Reads the keys.
pub fn read_keys(keys: Res<ButtonInput<KeyCode>>, typing: Res<Typing>, mut viewer: ResMut<Viewer>) {
    if typing.0 {
        return;
    }
    viewer.wanted.extend(KEYS.iter().filter(|k| keys.just_pressed(k.0)).map(|k| k.3));
}

/// A file dropped on the window is opened.
pub fn read_drops(mut drops: MessageReader<FileDragAndDrop>, mut viewer: ResMut<Viewer>) {
    for drop in drops.read() {
        if let FileDragAndDrop::DroppedFile { path_buf, .. } = drop {
            viewer.open = Some(path_buf.display().to_string());
        }
    }
}

/// Does what is wanted.
pub fn act(world: &mut World) {
    let wanted = std::mem::take(&mut world.resource_mut::<Viewer>().wanted);
    for action in wanted {
        act_once(world, action);
    }
    if let Some(name) = world.resource_mut::<Viewer>().open.take() {
        open(world, &name);
    }
}

/// Opens something and looks at it.
pub fn open(world: &mut World, name: &str) {
    let before = world.resource::<Stage>().generation;
    stage::open(world, name);
    if world.resource::<Stage>().generation != before {
        let mut viewer = world.resource_mut::<Viewer>();
        (viewer.grips, viewer.message, viewer.tension_scale) =
            ([None; 2], String::new(), Viewer::default().tension_scale);
    }
}

fn act_once(world: &mut World, action: Action) {
    match action {
        Action::PlayPause => {
            go_live(world);
            let mut clock = world.resource_mut::<PhysicsClock>();
            clock.running = !clock.running;
        }
        Action::Step => {
            world.resource_mut::<PhysicsClock>().running = false;
            let mut stage = world.resource_mut::<Stage>();
            if let Some(past) = stage.past {
                let last = stage.frames.len().saturating_sub(1);
                let now = (past + 1).min(last);
                (stage.past, stage.time) = (Some(now), stage.frames[now].time);
                if !stage.recorded && now == last {
                    go_live(world);
                }
            } else {
                world.resource_mut::<PhysicsClock>().by_hand += 1;
            }
        }
        Action::Reset => {
            let name = world.resource::<Stage>().name.clone();
            open(world, &name);
        }
        Action::Slower | Action::Faster => {
            let mut clock = world.resource_mut::<PhysicsClock>();
            clock.speed = (clock.speed * if action == Action::Faster { 2.0 } else { 0.5 }).clamp(1.0 / 64.0, 16.0);
        }
        Action::Back | Action::Forward => {
            let stage = world.resource::<Stage>();
            let now = stage.shown().or(stage.frames.last()).map_or(0.0, |f| f.time);
            go_to(world, now + if action == Action::Back { -0.1 } else { 0.1 });
        }
        Action::First => go_to(world, f64::NEG_INFINITY),
        Action::Latest => go_to(world, f64::INFINITY),
        Action::Home => world.resource_mut::<Orbit>().go_home(),
        Action::Take(side) => take(world, side),
        Action::GiveBack => give_back(world),
        Action::Picture => {
            let viewer = world.resource::<Viewer>();
            let path = viewer.folder.join(format!("{}.png", unique(&viewer.folder)));
            picture(world, path);
        }
        Action::Sequence => {
            let mut viewer = world.resource_mut::<Viewer>();
            viewer.sequence = match viewer.sequence.take() {
                Some((folder, n)) => {
                    viewer.message = format!("{n} pictures in {}", folder.display());
                    None
                }
                None => {
                    let folder = viewer.folder.join(format!("{}-frames", unique(&viewer.folder)));
                    match std::fs::create_dir_all(&folder) {
                        Ok(()) => Some((folder, 0)),
                        Err(e) => {
                            viewer.message = format!("cannot make the folder {}: {e}", folder.display());
                            None
                        }
                    }
                }
            };
        }
        Action::Glb => {
            let result = write_glb(world.resource::<Stage>(), &world.resource::<Viewer>().folder);
            world.resource_mut::<Viewer>().message = result.unwrap_or_else(|e| e);
        }
        Action::Input => {
            let result = write_input(world.resource::<Sutura>(), &world.resource::<Viewer>().folder);
            world.resource_mut::<Viewer>().message = result.unwrap_or_else(|e| e);
        }
        Action::NextScene | Action::LastScene => {
            let name = &world.resource::<Stage>().name;
            let (n, at) = (samples().len(), samples().iter().position(|s| s.name == name));
            let next = match (at, action) {
                (Some(i), Action::NextScene) => (i + 1) % n,
                (Some(i), _) => (i + n - 1) % n,
                (None, _) => 0,
            };
            open(world, samples()[next].name);
        }
        _ => {
            let mut viewer = world.resource_mut::<Viewer>();
            let flag = match action {
                Action::Tension => &mut viewer.tension,
                Action::Frames => &mut viewer.frames,
                Action::Contacts => &mut viewer.contacts,
                Action::Primitives => &mut viewer.primitives,
                Action::Instruments => &mut viewer.instruments,
                Action::Knot => &mut viewer.knot,
                Action::Panels => &mut viewer.panels,
                Action::Help => &mut viewer.help,
                _ => {
                    (viewer.help, viewer.message) = (false, String::new());
                    let grips = std::mem::take(&mut viewer.grips);
                    world.resource_mut::<Stage>().error = None;
                    for grip in grips.into_iter().flatten() {
                        world.despawn(grip);
                    }
                    return;
                }
            };
            *flag = !*flag;
        }
    }
}

/// Back to the present of a scene that is played.
fn go_live(world: &mut World) {
    let mut stage = world.resource_mut::<Stage>();
    if stage.recorded {
        let end = stage.frames.last().map_or(0.0, |f| f.time);
        // Played to its end, it begins again.
        if stage.time >= end {
            stage.time = stage.frames.first().map_or(0.0, |f| f.time);
        }
        return;
    }
    stage.past = None;
    world.resource_mut::<Live>().0 = true;
}

/// Shows a time of the past; the present of a scene that is played is the time of its last frame.
pub fn go_to(world: &mut World, time: f64) {
    world.resource_mut::<PhysicsClock>().running = false;
    let mut stage = world.resource_mut::<Stage>();
    let last = stage.frames.len().saturating_sub(1);
    let Some(frame) = stage.frame_at(time) else { return };
    if frame == last && !stage.recorded {
        return go_live(world);
    }
    (stage.past, stage.time) = (Some(frame), stage.frames[frame].time);
    world.resource_mut::<Live>().0 = false;
}

/// Plays a recording.
pub fn play_recording(mut stage: ResMut<Stage>, clock: Res<PhysicsClock>, time: Res<Time<Real>>) {
    if !stage.recorded || !clock.running {
        return;
    }
    let end = stage.frames.last().map_or(0.0, |f| f.time);
    stage.time = (stage.time + time.delta_secs_f64() * clock.speed).min(end);
    stage.past = stage.frame_at(stage.time);
}

/// A grip of the keyboard takes an end of a thread, or lets go. Where a grip of the scene holds it already, that one is
/// driven.
fn take(world: &mut World, side: usize) {
    if let Some(grip) = world.resource_mut::<Viewer>().grips[side].take() {
        world.despawn(grip);
        return;
    }
    let mut threads: Vec<(usize, Entity)> =
        world.query_filtered::<(Entity, &Prop), With<Thread>>().iter(world).map(|(e, p)| (p.0, e)).collect();
    threads.sort_unstable();
    let chosen = if side == 0 { threads.first() } else { threads.last() };
    let Some((_, thread)) = chosen.copied() else {
        world.resource_mut::<Viewer>().message = "there is no thread to take".into();
        return;
    };
    let place = if side == 0 { Place::Start } else { Place::End };
    let sutura = world.resource::<Sutura>();
    let theirs = world.get::<Thread>(thread).and_then(Thread::handle).and_then(|rod| {
        let end = if side == 0 { 0 } else { sutura.world().rod(rod).ok()?.n_elements() };
        let grip = sutura.simulation::<Play>()?.grip_at(rod, end)?;
        Some((grip, sutura.world().grip_pose(grip).ok()?))
    });
    let grip = match theirs {
        Some((handle, pose)) => Grip::of(thread, handle, pose),
        None => Grip::new(thread, place, Hold::Clamp),
    };
    let entity = world.spawn(grip).id();
    world.resource_mut::<Viewer>().grips[side] = Some(entity);
}

/// Before each frame of physics the keys move their grips.
pub fn drive(
    mut viewer: ResMut<Viewer>,
    keys: Res<ButtonInput<KeyCode>>,
    typing: Res<Typing>,
    clock: Res<PhysicsClock>,
    orbit: Res<Orbit>,
    space: Res<Space>,
    hand: Res<Hand>,
    mut grips: Query<&mut Grip>,
) {
    for side in 0..2 {
        let Some(mut grip) = viewer.grips[side].and_then(|g| grips.get_mut(g).ok()) else { continue };
        if let Some(e) = grip.error() {
            viewer.message = format!("grip {}: {e}", NAMES[side]);
            continue;
        }
        if grip.handle().is_none() || typing.0 {
            continue;
        }
        let down = DRIVE[side].map(|k| f64::from(u8::from(keys.pressed(k))));
        let fast = if keys.pressed(KeyCode::ShiftLeft) || keys.pressed(KeyCode::ShiftRight) { 4.0 } else { 1.0 };
        let axis = |v: Vec3| space.direction_back(v);
        let way = axis(orbit.right()) * (down[1] - down[0])
            + axis(orbit.above()) * (down[3] - down[2])
            + axis(orbit.forward()) * (down[4] - down[5]);
        let twist = (down[7] - down[6]) * 3.0 * fast * clock.frame;
        (grip.limits.speed, grip.limits.force) = (hand.speed_limit, hand.force_limit);
        if way == DVec3::ZERO && twist == 0.0 {
            continue;
        }
        let pose = grip.pose();
        let step =
            way.normalize_or_zero() * (viewer.grip_speed * fast * clock.frame * f64::from(clock.remaining.max(1)));
        let about = DQuat::from_axis_angle(pose.orientation * DVec3::Z, twist * f64::from(clock.remaining.max(1)));
        grip.target = Some(Pose::new(pose.position + step, (about * pose.orientation).normalize()));
    }
}

/// A grip that no key moves any more stays where it is, and one that the scene let go is nobody's.
pub fn settle(
    mut commands: Commands,
    mut viewer: ResMut<Viewer>,
    sutura: Res<Sutura>,
    hand: Res<Hand>,
    mut grips: Query<&mut Grip>,
) {
    for side in 0..2 {
        let Some(entity) = viewer.grips[side] else { continue };
        if let Ok(mut grip) = grips.get_mut(entity) {
            grip.target = None;
            if grip.handle().is_some_and(|h| sutura.world().grip_pose(h).is_err()) {
                viewer.grips[side] = None;
                viewer.message = format!("the scene let go of what grip {} held", NAMES[side]);
                commands.entity(entity).despawn();
            }
        }
    }
    if let Some(sutura_bevy::Held::Thread(grip)) = hand.held
        && let Some(e) = grips.get(grip).ok().and_then(Grip::error)
    {
        viewer.message = format!("the hand does not hold: {e}");
    }
}

/// The grips of the keyboard.
const NAMES: [&str; 2] = ["A", "B"];

/// Speed at which what was taken over goes back to where the scene has it \[m/s\].
const BACK: f64 = 0.05;

/// What hands took over of the scene, and hold no longer, goes back to it.
fn give_back(world: &mut World) {
    let held: Vec<Part> = {
        let hand = match world.resource::<Hand>().held {
            Some(sutura_bevy::Held::Thread(e) | sutura_bevy::Held::Body(e)) => Some(e),
            None => None,
        };
        let entities = world.resource::<Viewer>().grips.into_iter().flatten().chain(hand);
        let part = |e: Entity| {
            world
                .get::<Grip>(e)
                .and_then(Grip::handle)
                .map(Part::Grip)
                .or(world.get::<Body>(e).and_then(Body::handle).map(Part::Body))
        };
        entities.filter_map(part).collect()
    };
    let mut sutura = world.resource_mut::<Sutura>();
    let Some(play) = sutura.simulation_mut::<Play>() else { return };
    let n = play.give_back(&held, BACK);
    world.resource_mut::<Viewer>().message = match n {
        0 => "there is nothing to give back to the scene".into(),
        _ => format!("given back to the scene: {n}"),
    };
}

/// Strands show the tension where that is wanted; its scale follows what there is.
pub fn show_tension(mut viewer: ResMut<Viewer>, time: Res<Time<Real>>, mut strands: Query<&mut Strand>) {
    if viewer.tension && !viewer.tension_fixed {
        let most = strands.iter().flat_map(|s| &s.tensions).fold(0.0, |a: f64, t| a.max(*t));
        // It grows at once and shrinks slowly, by half in two seconds.
        let kept = viewer.tension_scale.1 * (-0.35 * time.delta_secs_f64()).exp();
        viewer.tension_scale = (0.0, most.max(kept).max(1e-3));
    }
    let scale = viewer.tension.then_some(viewer.tension_scale);
    for mut strand in &mut strands {
        if strand.tension_scale != scale {
            strand.tension_scale = scale;
        }
    }
}

/// Writes what the window shows.
fn picture(world: &mut World, path: PathBuf) {
    if world.query_filtered::<(), With<PrimaryWindow>>().iter(world).next().is_none() {
        world.resource_mut::<Viewer>().message = "there is no window to take a picture of".into();
        return;
    }
    let folder = path.parent().map(std::fs::create_dir_all);
    world.resource_mut::<Viewer>().message = match folder {
        Some(Err(e)) => format!("cannot write {}: {e}", path.display()),
        _ => {
            world.spawn(Screenshot::primary_window()).observe(save_to_disk(path.clone()));
            format!("picture: {}", path.display())
        }
    };
}

/// The next picture of a sequence.
pub fn record(world: &mut World) {
    if let Some((folder, n)) = world.resource::<Viewer>().sequence.clone() {
        picture(world, folder.join(format!("{n:05}.png")));
        world.resource_mut::<Viewer>().sequence = Some((folder, n + 1));
    }
}

/// A name that no file has yet.
fn unique(folder: &std::path::Path) -> String {
    let taken = |n: u32| {
        ["png", "glb", "sutura"].iter().any(|e| folder.join(format!("{n:03}.{e}")).exists())
            || folder.join(format!("{n:03}-frames")).exists()
    };
    format!("{:03}", (1..).find(|n| !taken(*n)).unwrap_or(0))
}

fn write_glb(stage: &Stage, folder: &std::path::Path) -> Result<String, String> {
    let path = folder.join(format!("{}.glb", unique(folder)));
    let run = || -> Result<(), Box<dyn std::error::Error>> {
        std::fs::create_dir_all(folder)?;
        let mut exporter = Exporter::new(Format::Glb, &stage.header, &path, Options::default())?;
        for frame in &stage.frames {
            if exporter.wants(frame.time) {
                exporter.add(&Moment::of_frame(frame))?;
            }
        }
        exporter.finish()?;
        Ok(())
    };
    run().map(|()| format!("GLB: {}", path.display())).map_err(|e| e.to_string())
}

fn write_input(sutura: &Sutura, folder: &std::path::Path) -> Result<String, String> {
    let recording = sutura.recording().ok_or("nothing is recorded")?;
    let path = folder.join(format!("{}.sutura", unique(folder)));
    std::fs::create_dir_all(folder)
        .and_then(|()| std::fs::write(&path, recording.to_bytes()))
        .map_err(|e| format!("cannot write {}: {e}", path.display()))?;
    Ok(format!("input: {} (sutura replay)", path.display()))
}
