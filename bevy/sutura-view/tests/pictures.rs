//! Pictures without a display: each sample scene has its threads where they are, and nowhere else. Pictures that are
//! wrong are left in the build folder.
//!
//! These want a Vulkan driver (`scripts/viewer_setup.sh` installs one in software), and fail without.

use bevy::prelude::*;
use std::path::Path;
use sutura_bevy::look::ThreadLook;
use sutura_bevy::sutura::skin::{Bone, Skin};
use sutura_bevy::{Drawn, Space, Strand, Thread};
use sutura_scene::{Runner, Scene, samples};
use sutura_view::{Picture, Studio};

const SIZE: (u32, u32) = (640, 360);
/// A color that nothing else has.
const MAGENTA: Srgba = Srgba::rgb(0.95, 0.05, 0.95);

/// Whether a pixel shows some thread: more red and blue than green. Drape has more green, steel as much of each, the
/// marks of grips more green than blue.
fn is_thread(pixel: [u8; 3]) -> bool {
    pixel[0].min(pixel[2]) > pixel[1].saturating_add(6)
}

/// All threads in one color.
fn paint(world: &mut World) {
    let look = ThreadLook { color: MAGENTA, tracer: MAGENTA, braided: false };
    world.query::<&mut Thread>().iter_mut(world).for_each(|mut t| t.look = look);
    world.query::<&mut Strand>().iter_mut(world).for_each(|mut s| s.look = look);
}

/// Looks at the picture; what is wrong with it.
fn judge(picture: &Picture, threads: &[Vec<(f32, f32, bool)>], width: f32) -> Result<(), String> {
    let (w, h) = (picture.width as i32, picture.height as i32);
    let at = |x: i32, y: i32| (x >= 0 && y >= 0 && x < w && y < h).then(|| picture.at(x as u32, y as u32));
    let near =
        |x: f32, y: f32| (-1..=1).any(|i| (-1..=1).any(|j| at(x as i32 + i, y as i32 + j).is_some_and(is_thread)));
    let (mut seen, mut all) = (0, 0);
    // Within half its width and a few pixels of the centerline; nearer parts are wider than the middle.
    let reach = 0.75 * width + 3.0;
    let mut allowed = vec![false; (w * h) as usize];
    for thread in threads {
        // What leaves the picture is seen up to its edge.
        for (x, y, hidden) in thread.iter().filter(|p| at(p.0.floor() as i32, p.1.floor() as i32).is_some()) {
            all += usize::from(!hidden);
            seen += usize::from(!hidden && near(*x, *y));
        }
        for pair in thread.windows(2) {
            let (a, b) = (Vec2::new(pair[0].0, pair[0].1), Vec2::new(pair[1].0, pair[1].1));
            let n = (a.distance(b) / 2.0).ceil() as i32 + 1;
            for k in 0..=n {
                let p = a.lerp(b, k as f32 / n as f32);
                let r = reach.ceil() as i32;
                for (i, j) in (-r..=r).flat_map(|i| (-r..=r).map(move |j| (i, j))) {
                    let (x, y) = (p.x as i32 + i, p.y as i32 + j);
                    if x >= 0 && y >= 0 && x < w && y < h && ((i * i + j * j) as f32) <= (reach + 1.0).powi(2) {
                        allowed[(y * w + x) as usize] = true;
                    }
                }
            }
        }
    }
    // A scene may have bodies alone.
    if all < 10 && !threads.is_empty() {
        return Err(format!("only {all} particles in the picture that no body hides"));
    }
    if (seen as f64) < 0.97 * all as f64 {
        return Err(format!("thread is seen at {seen} of {all} particles that no body hides"));
    }
    let stray = (0..w * h).filter(|i| !allowed[*i as usize] && at(i % w, i / w).is_some_and(is_thread)).count();
    if stray > 0 {
        return Err(format!("{stray} pixels have the color of thread where there is none"));
    }
    let mut colors: Vec<[u8; 3]> = picture.data.chunks_exact(3).map(|c| [c[0] / 8, c[1] / 8, c[2] / 8]).collect();
    colors.sort_unstable();
    colors.dedup();
    if colors.len() < 40 { Err(format!("{} colors", colors.len())) } else { Ok(()) }
}

#[test]
fn each_sample_scene_has_its_threads_where_they_are() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("pictures");
    std::fs::create_dir_all(&folder).unwrap();
    let mut studio = Studio::new(SIZE);
    let mut wrong = Vec::new();
    for sample in samples() {
        studio.open(sample.name).unwrap();
        studio.go(0.25);
        studio.frame(1.0, None);
        paint(studio.world());
        let picture = studio.draw().unwrap();
        let radius = studio.world().query::<&Strand>().iter(studio.world()).map(|s| s.skin.radius).fold(0.0, f64::max);
        let width = studio.width(radius);
        if let Err(why) = judge(&picture, &studio.threads(), width) {
            picture.write(&folder.join(format!("{}-wrong.png", sample.name))).unwrap();
            wrong.push(format!("{}: {why}", sample.name));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}, pictures in {}", folder.display());
    // The check itself: threads that are not where they are said to be are noticed.
    let (picture, threads) = (studio.draw().unwrap(), studio.threads());
    let moved: Vec<Vec<(f32, f32, bool)>> =
        threads.iter().map(|t| t.iter().map(|(x, y, h)| (x + 25.0, y + 12.0, *h)).collect()).collect();
    assert!(judge(&picture, &moved, 1.0).is_err());
}

#[test]
fn a_recording_is_drawn_like_the_run_that_it_is_of() {
    let sample = samples().iter().find(|s| s.name == "hanging_helix").unwrap();
    let mut runner = Runner::new(Scene::parse(sample.text, "hanging_helix.toml").unwrap()).unwrap();
    while runner.now().time < 0.5 {
        runner.step_frame();
    }
    let time = runner.now().time;
    let trajectory = runner.finish().trajectory;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("trajectory.sutura");
    trajectory.write_to(&path).unwrap();
    let mut studio = Studio::new(SIZE);
    let mut threads = Vec::new();
    for name in [path.to_str().unwrap(), "hanging_helix"] {
        studio.open(name).unwrap();
        studio.go(time);
        studio.frame(1.0, None);
        paint(studio.world());
        let picture = studio.draw().unwrap();
        let width = studio.width(0.0);
        judge(&picture, &studio.threads(), width).unwrap();
        threads.push(studio.threads());
    }
    let apart = threads[0][0].iter().zip(&threads[1][0]).map(|(a, b)| (a.0 - b.0).hypot(a.1 - b.1)).fold(0.0, f32::max);
    assert_eq!(threads[0][0].len(), threads[1][0].len());
    assert!(apart < 0.1, "{apart} pixels apart");
}

#[test]
fn the_graphics_processor_skins_as_the_engine_does() {
    let mut studio = Studio::new(SIZE);
    // Closed, twisted, and wound up: every bone turns.
    studio.open("twisted_ring").unwrap();
    studio.go(1.0);
    studio.frame(1.0, None);
    paint(studio.world());
    let by_graphics = studio.draw().unwrap();
    // The same skin, posed by the engine and drawn as it is.
    let world = studio.world();
    let space = *world.resource::<Space>();
    let (strand, drawn) =
        world.query::<(&Strand, &Drawn)>().single(world).map(|(s, d)| (s.clone(), d.clone())).unwrap();
    let skin = Skin::new(&strand.skin).unwrap();
    let mut bones = vec![Bone::default(); skin.n_bones()];
    skin.bones_at(&strand.positions, &strand.orientations, &mut bones);
    let (mut x, mut n) = (vec![[0.0; 3]; skin.n_vertices()], vec![[0.0; 3]; skin.n_vertices()]);
    skin.pose(&bones, &mut x, &mut n);
    let turned = |v: &[f32; 3], scale: f32| (space.rotation * Vec3::from_array(*v) * scale).to_array();
    let mesh = Mesh::new(bevy::mesh::PrimitiveTopology::TriangleList, default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, x.iter().map(|v| turned(v, space.scale)).collect::<Vec<_>>())
        .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, n.iter().map(|v| turned(v, 1.0)).collect::<Vec<_>>())
        .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, skin.mesh().uvs.clone())
        .with_inserted_indices(bevy::mesh::Indices::U32(skin.mesh().triangles.iter().flatten().copied().collect()));
    let mesh = world.resource_mut::<Assets<Mesh>>().add(mesh);
    let material = world.get::<MeshMaterial3d<StandardMaterial>>(drawn.parts[0]).unwrap().clone();
    for part in drawn.parts {
        world.entity_mut(part).insert(Visibility::Hidden);
    }
    let nothing = studio.draw().unwrap();
    studio.world().spawn((Mesh3d(mesh), material));
    let by_engine = studio.draw().unwrap();
    let off = |a: &Picture, b: &Picture| a.data.iter().zip(&b.data).filter(|(a, b)| a.abs_diff(**b) > 12).count();
    let thread = off(&by_engine, &nothing);
    let differ = off(&by_engine, &by_graphics);
    assert!(thread > 2000, "{thread}");
    // Edges of a few pixels, from rounding.
    assert!(differ * 200 < thread, "{differ} of {thread}");
}
