//! The scene on view: its things as entities, light, table, and frames that are remembered.

use crate::camera::Orbit;
use crate::source::{Play, Source, skin};
use bevy::light::{CascadeShadowConfigBuilder, DirectionalLightShadowMap, EnvironmentMapLight, NotShadowCaster};
use bevy::prelude::*;
use sutura_bevy::look::{BodyLook, Materials, ThreadLook};
use sutura_bevy::sutura::glam::{DMat3, DQuat, DVec3};
use sutura_bevy::sutura::{Geometry, Handle, Pose, Rod};
use sutura_bevy::{Body, Cloth, Hand, Live, PhysicsClock, Solid, Space, Strand, Sutura, Thread, Triangles};
use sutura_scene::{Camera, Frame, Header, Runner, Trajectory};

/// A thing of the scene, by its number among threads or bodies.
#[derive(Component, Debug, Clone, Copy)]
pub struct Prop(pub usize);

/// The table under everything, where the scene has no plane of its own.
#[derive(Component, Debug)]
pub struct Table {
    /// Half the size of what is on it at first \[m\].
    pub reach: f64,
}

/// What is on view.
#[derive(Resource)]
pub struct Stage {
    /// What was asked for: a file or the name of a sample.
    pub name: String,
    /// Its title.
    pub title: String,
    /// What could not be opened, for the window.
    pub error: Option<String>,
    /// A recording, instead of a scene that is played.
    pub recorded: bool,
    /// Names and outlines.
    pub header: Header,
    /// Frames shown so far, or those of the recording.
    pub frames: Vec<Frame>,
    /// The frame of these that is shown instead of the present.
    pub past: Option<usize>,
    /// Time of playback in a recording \[s\].
    pub time: f64,
    /// Up from the table.
    pub up: DVec3,
    /// How the scene wants to be looked at.
    pub camera: Option<Camera>,
    /// Height of the table along `up` \[m\].
    table: Option<f64>,
    /// Counts openings.
    pub generation: u64,
}

impl Default for Stage {
    fn default() -> Self {
        Stage {
            name: String::new(),
            title: String::new(),
            error: None,
            recorded: false,
            header: Header::default(),
            frames: Vec::new(),
            past: None,
            time: 0.0,
            up: DVec3::Z,
            camera: None,
            table: None,
            generation: 0,
        }
    }
}

/// Frames that are remembered; when there are more, every other one of the older half goes.
const REMEMBERED: usize = 12_000;

impl Stage {
    /// The frame that is shown, if it is one of the past or of a recording.
    pub fn shown(&self) -> Option<&Frame> {
        self.frames.get(self.past?)
    }
    /// Number of the frame nearest to a time.
    pub fn frame_at(&self, time: f64) -> Option<usize> {
        let after = self.frames.partition_point(|f| f.time < time);
        let nearer = |i: &usize| (self.frames[*i].time - time).abs();
        [after.saturating_sub(1), after]
            .into_iter()
            .filter(|i| *i < self.frames.len())
            .min_by(|a, b| nearer(a).total_cmp(&nearer(b)))
    }
    /// Adds the present to what is remembered.
    pub fn remember(&mut self, frame: Frame) {
        if self.frames.len() >= REMEMBERED {
            let mut k = 0;
            self.frames.retain(|_| {
                k += 1;
                k > REMEMBERED / 2 || k % 2 == 0
            });
        }
        self.frames.push(frame);
    }
    /// All as a recording, for files.
    pub fn trajectory(&self) -> Trajectory {
        Trajectory { header: self.header.clone(), frames: self.frames.clone() }
    }
}

/// Opens something in place of what is on view. Where it cannot be opened the error is shown and what was on view
/// stays.
pub fn open(world: &mut World, name: &str) {
    let opened = Source::open(name).and_then(|source| match source {
        Source::Scene(scene) => Runner::recording(*scene).map(|r| Err(Box::new(r))).map_err(|e| e.to_string()),
        Source::Recorded(t) if t.frames.is_empty() => Err(format!("{name}: a recording without a frame")),
        Source::Recorded(t) => Ok(Ok(t)),
    });
    match opened {
        Ok(Err(runner)) => {
            clear(world, name);
            play(world, *runner);
        }
        Ok(Ok(trajectory)) => {
            clear(world, name);
            replay(world, *trajectory);
        }
        Err(why) => world.resource_mut::<Stage>().error = Some(why),
    }
}

/// Takes everything of the scene away.
fn clear(world: &mut World, name: &str) {
    let old: Vec<Entity> =
        world.query_filtered::<Entity, Or<(With<Prop>, With<Table>, With<sutura_bevy::Grip>)>>().iter(world).collect();
    for entity in old {
        world.despawn(entity);
    }
    let generation = world.resource::<Stage>().generation + 1;
    world.insert_resource(Stage { name: name.into(), generation, ..Stage::default() });
    world.insert_resource(Sutura::default());
    world.resource_mut::<Hand>().let_go();
    world.insert_resource(Live(true));
    world.resource_mut::<PhysicsClock>().restart();
}

/// A scene that is played, as it is now.
pub fn play(world: &mut World, runner: Runner) {
    let scene = runner.scene().clone();
    world.resource_mut::<PhysicsClock>().frame = 1.0 / scene.frame_rate();
    let gravity = runner.world().settings().gravity;
    let mut stage = world.resource_mut::<Stage>();
    stage.title = scene.title().into();
    stage.header = runner.header();
    stage.frames = vec![runner.frame()];
    stage.camera = scene.camera().copied();
    stage.up = upward(gravity, stage.camera.as_ref());
    world.spawn_batch(threads_from(&runner, 0));
    for (i, (name, handle)) in runner.shapes().enumerate() {
        world.spawn((Body::of(handle), Name::new(name.to_owned()), Prop(i)));
    }
    world.insert_resource(Sutura::of(Play(runner)));
}

/// The threads of a scene that is played, from a number on.
fn threads_from(runner: &Runner, first: usize) -> Vec<(Thread, Name, Prop)> {
    let thread = |(i, (name, handle)): (usize, (&str, Handle<Rod>))| {
        let rod = runner.world().rod(handle).ok()?;
        // What bends much more easily than it stretches is a braid.
        let look = ThreadLook { braided: rod.material().bend_scale < 0.5, ..ThreadLook::of(i) };
        Some((Thread::of(handle).looking(look), Name::new(name.to_owned()), Prop(i)))
    };
    runner.threads().enumerate().skip(first).filter_map(thread).collect()
}

/// A recording from its beginning.
fn replay(world: &mut World, trajectory: Trajectory) {
    let Trajectory { header, frames } = trajectory;
    for (i, thread) in header.threads.iter().enumerate() {
        let strand = Strand {
            // A part that is cut off later has no positions yet.
            skin: skin(thread, frames.iter().find_map(|f| f.positions.get(i)).map_or(&[][..], Vec::as_slice)),
            positions: Vec::new(),
            orientations: Vec::new(),
            tensions: Vec::new(),
            look: ThreadLook::of(i),
            stoutness: 1.0,
            tension_scale: None,
        };
        world.spawn((strand, Name::new(thread.name.clone()), Prop(i)));
    }
    for (i, shape) in header.shapes.iter().enumerate() {
        let solid = Solid { geometry: Geometry::from(&shape.outline), pose: Pose::IDENTITY, look: BodyLook::Steel };
        world.spawn((solid, Name::new(shape.name.clone()), Prop(i)));
    }
    world.insert_resource(Live(false));
    let mut stage = world.resource_mut::<Stage>();
    stage.title = format!("{} (recorded)", header.scene);
    // A recording knows no gravity and no camera; those of the sample of its name are likely.
    let sample = sutura_scene::samples().iter().find(|s| s.name == header.scene);
    let scene = sample.and_then(|s| sutura_scene::Scene::parse(s.text, "sample.toml").ok());
    stage.camera = scene.as_ref().and_then(|s| s.camera().copied());
    stage.up = upward(scene.as_ref().map_or(DVec3::NEG_Z, sutura_scene::Scene::gravity), stage.camera.as_ref());
    (stage.header, stage.frames, stage.recorded, stage.past) = (header, frames, true, Some(0));
}

/// Up from the table is against gravity. Without gravity, or where the scene is looked at from below, the cloth lies
/// behind what is looked at instead.
fn upward(gravity: DVec3, camera: Option<&Camera>) -> DVec3 {
    let below = |up: &DVec3| camera.is_some_and(|c| c.from.dot(*up) < -0.1);
    let behind = camera.map(|c| (c.from * 0.8 + c.up * 0.6).normalize_or(DVec3::Z));
    (-gravity).try_normalize().filter(|up| !below(up)).or(behind).unwrap_or(DVec3::Z)
}

/// Least sine of the angle at which a table is looked down at: below it one would see its edge, or its underside.
const LEAST_RISE: f64 = 0.45;

/// A direction to the eye, raised to where it sees the table.
fn raised(from: DVec3, up: DVec3) -> DVec3 {
    let level = from - up * from.dot(up);
    if from.dot(up) >= LEAST_RISE || level.length() < 1e-6 {
        from
    } else {
        level.normalize() * (1.0 - LEAST_RISE * LEAST_RISE).sqrt() + up * LEAST_RISE
    }
}

/// A recorded place or vector.
pub(crate) fn place(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}

/// Remembers each frame of physics, and brings threads that were cut off in it.
pub fn remember(mut commands: Commands, mut stage: ResMut<Stage>, sutura: Res<Sutura>) {
    if let Some(play) = sutura.simulation::<Play>() {
        let known = stage.header.threads.len();
        if play.0.threads().count() > known {
            stage.header.threads.extend(play.0.header().threads.into_iter().skip(known));
            commands.spawn_batch(threads_from(&play.0, known));
        }
        let mut frame = play.0.frame();
        // When the scene is over its own time stands still, the world's does not.
        if play.0.now().finished {
            frame.time = stage.frames.last().map_or(0.0, |f| f.time) + 1.0 / stage.header.frame_rate;
        }
        stage.remember(frame);
    }
}

/// Shows a frame of the past, or of a recording.
pub fn show_past(stage: Res<Stage>, mut strands: Query<(&Prop, &mut Strand)>, mut solids: Query<(&Prop, &mut Solid)>) {
    let Some(frame) = stage.shown() else { return };
    for (prop, mut strand) in &mut strands {
        let (Some(x), Some(q)) = (frame.positions.get(prop.0), frame.orientations.get(prop.0)) else {
            // It is cut off later.
            strand.positions.clear();
            strand.orientations.clear();
            strand.tensions.clear();
            continue;
        };
        if q.len() != strand.skin.lengths.len() {
            // A reel was at work: lengths are those between the particles.
            strand.skin.lengths = x.windows(2).map(|w| place(w[0]).distance(place(w[1])).max(1e-9)).collect();
        }
        strand.positions = x.iter().map(|p| place(*p)).collect();
        strand.orientations = q.iter().map(|q| DQuat::from_array(q.map(f64::from)).normalize()).collect();
        let tensions = frame.forces.as_ref().and_then(|f| f.tensions.get(prop.0));
        strand.tensions.clear();
        strand.tensions.extend(tensions.into_iter().flatten().map(|t| f64::from(*t)));
    }
    for (prop, mut solid) in &mut solids {
        if let Some((x, q)) = frame.shapes.get(prop.0) {
            solid.pose = Pose::new(place(*x), DQuat::from_array(q.map(f64::from)).normalize());
        }
    }
}

/// Everything there is to look at \[m\]: particles, and corners of bodies that are not planes.
pub fn points(world: &mut World) -> Vec<DVec3> {
    let mut out: Vec<DVec3> = Vec::new();
    for strand in world.query::<&Strand>().iter(world) {
        out.extend(&strand.positions);
    }
    for solid in world.query::<&Solid>().iter(world).filter(|s| !matches!(s.geometry, Geometry::Plane)) {
        out.extend(Triangles::of(&solid.geometry, 0.0).positions.iter().map(|p| solid.pose.transform_point(*p)));
    }
    out
}

/// Threads that would be thinner than the least width are drawn that wide, in steps of a quarter so that they are not
/// made anew all the time.
pub fn thicken(world: &mut World, pixels: u32) {
    let (orbit, least) = (world.resource::<Orbit>().clone(), world.resource::<crate::control::Viewer>().least_width);
    let space = *world.resource::<Space>();
    for mut strand in world.query::<&mut Strand>().iter_mut(world) {
        let width = f64::from(orbit.pixels(2.0 * strand.skin.radius as f32 * space.scale, pixels));
        let steps = (f64::from(least) / width.max(1e-9)).max(1.0).ln() / 1.25f64.ln();
        let wanted = 1.25f64.powf(steps.ceil()).min(100.0);
        if strand.stoutness != wanted {
            strand.stoutness = wanted;
        }
    }
}

/// The camera as the scene wants it, for what is there now.
pub fn frame_view(world: &mut World, aspect: f32, zoom: f32) -> Orbit {
    let points = points(world);
    let (stage, space) = (world.resource::<Stage>(), *world.resource::<Space>());
    let up = space.direction(stage.up);
    let camera = stage.camera;
    let from = raised(camera.map_or(DVec3::new(0.35, -0.8, 0.45), |c| c.from).normalize_or(DVec3::Y), stage.up);
    let points: Vec<Vec3> = points.iter().map(|p| space.place(*p)).collect();
    let at = camera.and_then(|c| c.look_at).map(|p| space.place(p));
    let width = camera.and_then(|c| c.width).map(|w| w as f32 * space.scale);
    let screen_up = camera.map_or(up, |c| space.direction(c.up));
    Orbit::fitted(&points, space.direction(from), screen_up, at, width, aspect, zoom)
}

/// Distance from the lowest thing to the table \[m\], and how much more for the height of things: near enough for
/// shadows that ground them.
const CLEARANCE: (f64, f64) = (0.003, 0.10);

/// The table comes down to where nothing hangs through it. It lies square to the picture.
pub fn lay_table(
    mut commands: Commands,
    mut stage: ResMut<Stage>,
    space: Res<Space>,
    strands: Query<&Strand>,
    solids: Query<&Solid>,
    mut tables: Query<(&mut Table, &mut Transform)>,
) {
    if solids.iter().any(|s| matches!(s.geometry, Geometry::Plane)) {
        return;
    }
    let up = stage.up;
    let (mut least, mut most) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut seen = |p: DVec3| {
        (least, most) = (least.min(p), most.max(p));
        (low, high) = (low.min(p.dot(up)), high.max(p.dot(up)));
    };
    strands.iter().flat_map(|s| &s.positions).for_each(|p| seen(*p));
    for solid in &solids {
        Triangles::of(&solid.geometry, 0.0).positions.iter().for_each(|p| seen(solid.pose.transform_point(*p)));
    }
    if !low.is_finite() {
        return;
    }
    let height = low - CLEARANCE.0 - CLEARANCE.1 * (high - low);
    // It never comes up again, and things stay over its middle.
    let height = stage.table.map_or(height, |t| t.min(low - 0.5 * CLEARANCE.0));
    match tables.single_mut() {
        Ok(_) if stage.table == Some(height) => {}
        Ok((_, mut place)) => {
            let moved = up * (height - stage.table.unwrap_or(height));
            place.translation += space.place(moved);
        }
        Err(_) => {
            let middle = 0.5 * (least + most);
            let from = stage.camera.map_or(DVec3::NEG_Y, |c| c.from);
            let right = stage.camera.map_or(up, |c| c.up).cross(from);
            let right = (right - up * right.dot(up)).try_normalize().unwrap_or_else(|| up.any_orthonormal_vector());
            let turn = DQuat::from_mat3(&DMat3::from_cols(right, up.cross(right), up));
            let pose = Pose::new(middle + up * (height - middle.dot(up)), turn);
            let reach = (0.5 * (most - least).length()).clamp(0.02, 0.4);
            commands.spawn((Table { reach }, space.transform(pose), Visibility::default()));
        }
    }
    if stage.table != Some(height) {
        stage.table = Some(height);
    }
}

/// Spreads a cloth on a new table.
pub fn cover_table(
    mut commands: Commands,
    space: Res<Space>,
    shared: Res<Materials>,
    tables: Query<(Entity, &Table), Without<Mesh3d>>,
    mut meshes: ResMut<Assets<Mesh>>,
) {
    for (entity, table) in &tables {
        let cloth = Cloth { reach: table.reach, folds: 1.0, ..Cloth::default() };
        commands.entity(entity).insert((
            Mesh3d(meshes.add(cloth.mesh(space.scale))),
            MeshMaterial3d(shared.drape.clone()),
            NotShadowCaster,
        ));
    }
}

/// The lamp that casts shadows, and the one behind that draws edges; they stand by the camera's scene and not by the
/// camera.
#[derive(Component, Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lamp {
    /// From over the left shoulder.
    Key,
    /// From behind on the right, cool.
    Rim,
}

/// Light and shadow.
pub fn light(mut commands: Commands) {
    commands.insert_resource(DirectionalLightShadowMap { size: 4096 });
    commands.insert_resource(GlobalAmbientLight { brightness: 0.0, ..default() });
    // Threads are thin: their shadows begin at their surface.
    let key = DirectionalLight {
        illuminance: 9000.0,
        color: Color::srgb(1.0, 0.965, 0.91),
        shadow_maps_enabled: true,
        shadow_depth_bias: 0.003,
        shadow_normal_bias: 1.2,
        ..default()
    };
    commands.spawn((key, Lamp::Key));
    commands
        .spawn((DirectionalLight { illuminance: 3000.0, color: Color::srgb(0.80, 0.90, 1.0), ..default() }, Lamp::Rim));
}

/// The lamps and the room stand by the scene as it is looked at first, and the shadows are as fine as the view is
/// close.
pub fn aim(
    mut commands: Commands,
    stage: Res<Stage>,
    space: Res<Space>,
    orbit: Res<Orbit>,
    mut lamps: Query<(Entity, &Lamp, &mut Transform)>,
    mut rooms: Query<&mut EnvironmentMapLight>,
) {
    if !(orbit.is_changed() || stage.is_changed()) {
        return;
    }
    let up = space.direction(stage.up);
    let level = |v: Vec3| (v - up * v.dot(up)).try_normalize();
    let right = level(orbit.home_right()).unwrap_or_else(|| up.any_orthonormal_vector());
    let front = right.cross(up);
    for mut room in &mut rooms {
        room.rotation = Quat::from_mat3(&Mat3::from_cols(right, up, front));
    }
    for (lamp, kind, mut place) in &mut lamps {
        let toward = match kind {
            Lamp::Key => up * 0.95 - right * 0.75 + front * 0.25,
            Lamp::Rim => up * 0.55 + right * 0.6 - front * 0.9,
        };
        *place = Transform::from_translation(orbit.target + toward.normalize() * orbit.distance)
            .looking_at(orbit.target, right);
        if *kind == Lamp::Key {
            // Fine shadows where one looks, and coarser ones behind where that is close.
            let (near, middle, far) = (0.3 * orbit.distance, 2.2 * orbit.distance, orbit.far());
            let num_cascades = if far > 1.2 * middle { 2 } else { 1 };
            let cascades = CascadeShadowConfigBuilder {
                num_cascades,
                minimum_distance: near,
                first_cascade_far_bound: middle,
                maximum_distance: far,
                ..default()
            };
            let cascades = cascades.build();
            commands.entity(lamp).insert(cascades);
        }
    }
}
