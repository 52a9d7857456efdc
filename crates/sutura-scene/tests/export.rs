//! What is exported is what moved: files are read back by other code and compared with the run.

use std::path::Path;
use sutura::glam::{DQuat, DVec3, Mat4, Quat, Vec3, Vec4};
use sutura::skin::{Bone, Skin, SkinSpec};
use sutura::{Profile, Section};
use sutura_scene::export::{ExportError, Exporter, Format, Loads, Moment, Options, Strand};
use sutura_scene::{Header, Runner, Scene, ThreadLook, Trajectory};

/// A thread that falls over a post, a ring closed with a twist that is no whole number of turns, and a bar that moves
/// and turns.
const SCENE: &str = r#"
title = "Three things"
frame_rate = 60

[[thread]]
name = "silk"
size = "3-0"
material = "silk"
elements = 24
line = { from = "[-6, 0, 2.5] mm", to = "[10, 0, 2.5] mm" }

[[thread]]
name = "ring"
size = "2-0"
material = "polypropylene"
elements = 30
closed = true
twist = "1.3 turn"
arc = { center = "[0, 30, 0] mm", axis = [0, 0, 1], start = "[6, 30, 0] mm", angle = "1 turn" }

[[shape]]
name = "post"
kind = "cylinder"
radius = "2 mm"
length = "10 mm"
orientation = { axis = [1, 0, 0], angle = "90 deg" }

[[shape]]
name = "bar"
kind = "box"
sides = "[2, 4, 6] mm"
position = "[40, 0, 0] mm"

[[shape]]
name = "floor"
kind = "plane"
position = "[0, 0, -30] mm"

[[phase]]
name = "fall"
action = [{ move = "bar", keys = [{ to = "[40, 10, 0] mm", turn = { axis = [0, 0, 1], angle = "90 deg" }, duration = "0.2 s" }] }]
duration = "0.25 s"
"#;

fn recorded() -> Trajectory {
    let mut runner = Runner::new(Scene::parse(SCENE, "three.toml").unwrap_or_else(|e| panic!("{e}"))).unwrap();
    while !runner.step_frame().finished {}
    runner.finish().trajectory
}

fn export(t: &Trajectory, format: Format, out: &Path, options: Options) -> Result<usize, ExportError> {
    let mut exporter = Exporter::new(format, &t.header, out, options)?;
    for frame in &t.frames {
        if exporter.wants(frame.time) {
            exporter.add(&Moment::of_frame(frame))?;
        }
    }
    Ok(exporter.finish()?.moments)
}

const ALL: Options = Options { rate: 60.0, from: 0.0, to: f64::INFINITY, sides: 12, rings: 4, up: DVec3::Y };

/// A GLB file as the crate `gltf` reads it.
struct Read {
    document: gltf::Document,
    bytes: Vec<u8>,
}

/// Keys of the animation of a node; what has no channel is where the node is.
struct Keys {
    times: Vec<f32>,
    translations: Vec<[f32; 3]>,
    rotations: Vec<[f32; 4]>,
    scales: Vec<[f32; 3]>,
}

impl Read {
    fn new(path: &Path) -> Self {
        let bytes = std::fs::read(path).unwrap();
        // This checks the document against the rules of the format, as far as the crate knows them.
        let gltf = gltf::Gltf::from_slice(&bytes).unwrap();
        Read { bytes: gltf.blob.clone().unwrap(), document: gltf.document }
    }

    fn keys(&self, node: &gltf::Node<'_>, n: usize) -> Keys {
        let (translation, rotation, scale) = node.transform().decomposed();
        let mut keys = Keys {
            times: Vec::new(),
            translations: vec![translation; n],
            rotations: vec![rotation; n],
            scales: vec![scale; n],
        };
        for channel in self
            .document
            .animations()
            .flat_map(|a| a.channels().collect::<Vec<_>>())
            .filter(|c| c.target().node().index() == node.index())
        {
            let reader = channel.reader(|_| Some(&self.bytes));
            keys.times = reader.read_inputs().unwrap().collect();
            match reader.read_outputs().unwrap() {
                gltf::animation::util::ReadOutputs::Translations(t) => keys.translations = t.collect(),
                gltf::animation::util::ReadOutputs::Rotations(r) => keys.rotations = r.into_f32().collect(),
                gltf::animation::util::ReadOutputs::Scales(s) => keys.scales = s.collect(),
                gltf::animation::util::ReadOutputs::MorphTargetWeights(_) => panic!("there are no morph targets"),
            }
        }
        keys
    }
}

fn wide(x: [f32; 3]) -> DVec3 {
    Vec3::from(x).as_dvec3()
}

#[test]
fn joints_go_the_way_of_the_elements() {
    let folder = tempfile::tempdir().unwrap();
    let t = recorded();
    let path = folder.path().join("three.glb");
    assert_eq!(export(&t, Format::Glb, &path, ALL).unwrap(), t.frames.len());
    let read = Read::new(&path);
    let skins: Vec<_> = read.document.skins().collect();
    assert_eq!(skins.len(), 2);
    let (mut worst, mut moved) = (0.0f64, 0.0f64);
    for (k, skin) in skins.iter().enumerate() {
        let joints: Vec<_> = skin.joints().collect();
        let n = t.header.threads[k].elements;
        // Beyond the seam the ring has one joint on each side.
        assert_eq!(joints.len(), n + 2 * k);
        for (e, joint) in joints[..n].iter().enumerate() {
            let keys = read.keys(joint, t.frames.len());
            assert_eq!(keys.translations.len(), t.frames.len());
            for (i, frame) in t.frames.iter().enumerate() {
                let (a, b) = (wide(frame.positions[k][e]), wide(frame.positions[k][e + 1]));
                let off = (wide(keys.translations[i]) - (a + b) * 0.5).length();
                worst = worst.max(off);
                moved = moved.max((wide(keys.translations[i]) - wide(keys.translations[0])).length());
                let turn = Quat::from_array(keys.rotations[i]).dot(Quat::from_array(frame.orientations[k][e])).abs();
                assert!(turn > 1.0 - 1e-6, "orientation of joint {e} at frame {i}");
                assert!(keys.times.is_empty() || (f64::from(keys.times[i]) - frame.time).abs() < 1e-6);
            }
            for w in keys.rotations.windows(2) {
                assert!(
                    Quat::from_array(w[0]).dot(Quat::from_array(w[1])) > 0.0,
                    "between two keys a rotation takes the long way"
                );
            }
        }
    }
    println!("joints are within {worst:.1e} m of the trajectory");
    assert!(worst < 1e-8, "{worst} m");
    assert!(moved > 1e-2, "the thread fell {moved} m");
}

#[test]
fn a_glb_poses_as_the_skin_does() {
    let folder = tempfile::tempdir().unwrap();
    let t = recorded();
    let path = folder.path().join("three.glb");
    export(&t, Format::Glb, &path, ALL).unwrap();
    let read = Read::new(&path);
    let last = t.frames.len() - 1;
    let moment = Moment::of_frame(&t.frames[last]);
    for node in read.document.nodes().filter(|n| n.skin().is_some()) {
        let skin = node.skin().unwrap();
        let k = t.header.threads.iter().position(|t| Some(t.name.as_str()) == skin.name()).unwrap();
        let primitive = node.mesh().unwrap().primitives().next().unwrap();
        let reader = primitive.reader(|_| Some(&read.bytes));
        let inverse: Vec<Mat4> = skin
            .reader(|_| Some(&read.bytes))
            .read_inverse_bind_matrices()
            .unwrap()
            .map(|m| Mat4::from_cols_array_2d(&m))
            .collect();
        let matrices: Vec<Mat4> = skin
            .joints()
            .zip(&inverse)
            .map(|(joint, inverse)| {
                let keys = read.keys(&joint, t.frames.len());
                let (s, q, x) = (keys.scales[last], keys.rotations[last], keys.translations[last]);
                Mat4::from_scale_rotation_translation(s.into(), Quat::from_array(q), x.into()) * *inverse
            })
            .collect();
        let positions: Vec<[f32; 3]> = reader.read_positions().unwrap().collect();
        let joints: Vec<[u16; 4]> = reader.read_joints(0).unwrap().into_u16().collect();
        let weights: Vec<[f32; 4]> = reader.read_weights(0).unwrap().into_f32().collect();

        // The skin of the engine, where the elements of the recording are.
        let thread = &t.header.threads[k];
        let look: &ThreadLook = thread.look.as_ref().unwrap();
        let own =
            Skin::new(&SkinSpec { seam: look.seam, ..SkinSpec::new(look.lengths.clone(), thread.radius) }).unwrap();
        assert_eq!((own.n_vertices(), own.n_bones()), (positions.len(), matrices.len()));
        let mut bones = vec![Bone::default(); own.n_bones()];
        own.bones_at(&moment.threads[k].positions, &moment.threads[k].orientations, &mut bones);
        let (mut x, mut n) = (vec![[0.0; 3]; positions.len()], vec![[0.0; 3]; positions.len()]);
        own.pose(&bones, &mut x, &mut n);
        let mut worst = 0.0f32;
        for i in 0..positions.len() {
            let blended =
                (0..4).map(|c| matrices[usize::from(joints[i][c])] * weights[i][c]).fold(Mat4::ZERO, |a, b| a + b);
            let there = blended * Vec4::from((Vec3::from(positions[i]), 1.0));
            worst = worst.max((there.truncate() - Vec3::from(x[i])).length());
        }
        // Scales nearer to 1 than a thousandth are left out.
        assert!(f64::from(worst) < 2e-3 * thread.radius, "{}: {worst} m", thread.name);
        assert!(look.seam.is_some() == (thread.name == "ring"));
    }
}

#[test]
fn shapes_that_move_are_animated_and_others_are_not() {
    let folder = tempfile::tempdir().unwrap();
    let t = recorded();
    let path = folder.path().join("three.glb");
    export(&t, Format::Glb, &path, ALL).unwrap();
    let read = Read::new(&path);
    let animated = |name: &str| {
        let node = read.document.nodes().find(|n| n.name() == Some(name)).unwrap();
        (read.keys(&node, t.frames.len()), node.transform().decomposed())
    };
    let (bar, _) = animated("bar");
    assert_eq!(bar.times.len(), t.frames.len());
    for (i, frame) in t.frames.iter().enumerate() {
        let (x, q) = frame.shapes[1];
        assert_eq!(bar.translations[i], x);
        assert!(Quat::from_array(bar.rotations[i]).dot(Quat::from_array(q)).abs() > 1.0 - 1e-6);
    }
    assert!((bar.translations[t.frames.len() - 1][1] - 0.01).abs() < 1e-6, "the bar moved a centimeter");
    let (post, (at, _, _)) = animated("post");
    assert!(post.times.is_empty() && at == t.frames[0].shapes[0].0);
}

#[test]
fn a_scene_can_be_set_upright() {
    let folder = tempfile::tempdir().unwrap();
    let t = recorded();
    let path = folder.path().join("up.glb");
    export(&t, Format::Glb, &path, Options { up: DVec3::Z, ..ALL }).unwrap();
    let read = Read::new(&path);
    let roots: Vec<_> = read.document.default_scene().unwrap().nodes().collect();
    let upright = roots.iter().find(|n| n.name() == Some("upright")).unwrap();
    let turn = Quat::from_array(upright.transform().decomposed().1);
    assert!((turn * Vec3::Z - Vec3::Y).length() < 1e-6);
    // Tubes stand at the root, all else is turned, and joints go the same way as before within that.
    assert!(roots.iter().all(|n| n.skin().is_some() || n.index() == upright.index()));
    assert_eq!(upright.children().count(), 2 + 3);
    let silk = upright.children().find(|n| n.name() == Some("silk")).unwrap();
    let keys = read.keys(&silk.children().next().unwrap(), t.frames.len());
    let x = &t.frames.last().unwrap().positions[0];
    assert!((wide(keys.translations[t.frames.len() - 1]) - (wide(x[0]) + wide(x[1])) * 0.5).length() < 1e-8);
}

#[test]
fn the_same_recording_gives_the_same_bytes_and_a_series_leaves_no_old_files() {
    let folder = tempfile::tempdir().unwrap();
    let t = recorded();
    for (format, name) in [
        (Format::Glb, "a.glb"),
        (Format::Csv, "a.csv"),
        (Format::Obj, "a.obj"),
        (Format::Vtk, "vtk"),
        (Format::Obj, "obj"),
    ] {
        let both: Vec<Vec<(String, Vec<u8>)>> = ["one", "two"]
            .map(|run| {
                let out = folder.path().join(run).join(name);
                if run == "two" && out.extension().is_none() {
                    // An earlier, longer series in the same folder.
                    export(&t, format, &out, ALL).unwrap();
                }
                export(&t, format, &out, Options { rate: 20.0, ..ALL }).unwrap();
                let mut files: Vec<_> = if out.is_dir() {
                    std::fs::read_dir(&out).unwrap().map(|e| e.unwrap().path()).collect()
                } else {
                    vec![out]
                };
                files.sort();
                files
                    .into_iter()
                    .map(|f| (f.file_name().unwrap().to_string_lossy().into_owned(), std::fs::read(f).unwrap()))
                    .collect()
            })
            .to_vec();
        assert!(both[0] == both[1], "{format:?}");
        assert!(both[0].iter().all(|f| !f.1.is_empty()));
    }
}

/// The array of a name in a VTK file, whole, as floats.
fn array(text: &str, name: &str) -> Vec<f32> {
    use base64::Engine as _;
    let tag = text
        .split("<DataArray ")
        .find(|a| a.contains(&format!("Name=\"{name}\"")))
        .unwrap_or_else(|| panic!("no {name}"));
    let data = tag.split_once('>').unwrap().1.split('<').next().unwrap();
    let bytes = base64::engine::general_purpose::STANDARD.decode(data).unwrap();
    assert_eq!(u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize, bytes.len() - 4);
    bytes[4..].chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
}

/// A quarter of a circle, turning about itself at an even rate, and a ring of which the same holds.
#[test]
fn vtk_has_curvature_and_twist_of_a_curve_that_is_known() {
    let folder = tempfile::tempdir().unwrap();
    let (n, radius, rate) = (40usize, 0.02, 30.0);
    let strand = |angle: f64| {
        let step = angle / n as f64;
        let at = |k: f64, r: f64| DVec3::new(r * (step * k).cos(), r * (step * k).sin(), 0.0);
        let length = 2.0 * radius * (0.5 * step).sin();
        let frame = |k: usize| {
            let along = (at(k as f64 + 1.0, radius) - at(k as f64, radius)).normalize();
            sutura::math::frame_from_tangent(along, DVec3::Z) * DQuat::from_rotation_z(rate * length * k as f64)
        };
        let loads = Loads {
            tensions: (0..n).map(|e| e as f64).collect(),
            contact_forces: (0..=n).map(|i| DVec3::Y * i as f64).collect(),
        };
        Strand {
            positions: (0..=n).map(|k| at(k as f64, radius)).collect(),
            orientations: (0..n).map(frame).collect(),
            velocities: Some(vec![DVec3::X; n + 1]),
            loads: Some(loads),
        }
    };
    let turned = rate * 2.0 * radius * (0.5 * std::f64::consts::TAU / n as f64).sin() * n as f64;
    for (angle, seam) in [(0.5 * std::f64::consts::PI, None), (std::f64::consts::TAU, Some(-turned))] {
        let look =
            ThreadLook { lengths: vec![1e-3; n], section: Section::Round.into(), size: Profile::default().0, seam };
        let thread = sutura_scene::Thread { name: "arc".into(), radius: 1e-4, elements: n, look: Some(look) };
        let header = Header { threads: vec![thread], ..Header::default() };
        let mut exporter = Exporter::new(Format::Vtk, &header, folder.path(), ALL).unwrap();
        assert!(exporter.wants(0.0));
        exporter.add(&Moment { time: 0.0, threads: vec![strand(angle)], shapes: Vec::new() }).unwrap();
        exporter.finish().unwrap();
        let text = std::fs::read_to_string(folder.path().join("threads_00000.vtp")).unwrap();
        let (curvature, twist) = (array(&text, "curvature"), array(&text, "twist"));
        let inner = if seam.is_some() { 0..n + 1 } else { 1..n };
        for i in inner {
            // Bend a and twist of a joint in one rotation vector are off by a twelfth of a^2, 0.2 % where the polygon
            // turns by 9 degrees.
            assert!((f64::from(curvature[i]) * radius - 1.0).abs() < 2.5e-3, "{seam:?}: {} at {i}", curvature[i]);
            assert!((f64::from(twist[i]) / rate - 1.0).abs() < 2.5e-3, "{seam:?}: {} at {i}", twist[i]);
        }
        let (tension, force, arc) = (array(&text, "tension"), array(&text, "contact_force"), array(&text, "arc"));
        assert_eq!((tension.len(), force.len(), arc.len()), (n + 1, 3 * (n + 1), n + 1));
        assert_eq!((tension[1], tension[n - 1]), (0.5, n as f32 - 1.5));
        assert_eq!(force[3 * 7 + 1], 7.0);
        assert!((f64::from(arc[n]) / (radius * angle) - 1.0).abs() < 2e-3);
        let (d3, x) = (array(&text, "d3"), array(&text, "Points"));
        for i in 1..n {
            let at = DVec3::new(x[3 * i].into(), x[3 * i + 1].into(), x[3 * i + 2].into());
            let along = DVec3::new(d3[3 * i].into(), d3[3 * i + 1].into(), d3[3 * i + 2].into());
            assert!((along.length() - 1.0).abs() < 1e-6 && along.dot(at).abs() < 1e-6 * radius.recip());
        }
    }
}

#[test]
fn a_run_under_way_tells_its_forces_and_so_does_its_recording() {
    let mut runner = Runner::new(Scene::parse(SCENE, "three.toml").unwrap()).unwrap();
    while !runner.step_frame().finished {}
    let moment = Moment::of_runner(&runner);
    // Contacts between threads cancel, so what is left is what the shapes do: the weight of the thread that lies on the
    // post, and more while it falls.
    let loads = moment.threads[0].loads.as_ref().unwrap();
    let sum: DVec3 = loads.contact_forces.iter().sum();
    let all: DVec3 =
        runner.world().contacts().filter(|c| c.a.thread().is_some_and(|(rod, ..)| rod == 0)).map(|c| c.force).sum();
    assert!(sum.z > 0.0 && (sum - all).length() < 1e-12 * all.length().max(1e-9), "{sum} {all}");
    let rod = runner.rods().next().unwrap();
    assert_eq!(loads.tensions[5], rod.tension(5));
    assert_eq!(moment.threads[0].velocities.as_deref(), Some(rod.velocities()));
    let recorded = Moment::of_frame(&runner.frame());
    for (a, b) in recorded.threads.iter().zip(&moment.threads) {
        let (a, b) = (a.loads.as_ref().unwrap(), b.loads.as_ref().unwrap());
        let greatest = b.contact_forces.iter().map(|f| f.length()).fold(1e-9, f64::max);
        assert!(a.tensions.iter().zip(&b.tensions).all(|(a, b)| *a == f64::from(*b as f32)));
        assert!(a.contact_forces.iter().zip(&b.contact_forces).all(|(a, b)| (*a - *b).length() < 1e-6 * greatest));
    }
    // Nothing acts on the thread of the recording that does not act on that of the run, so all that it says of grips
    // and contacts is there.
    let forces = runner.frame().forces.unwrap();
    assert_eq!(forces.contacts.len(), runner.world().contacts().count());
    for ((_, handle), force) in runner.grips().zip(&forces.grips) {
        let wrench = handle.map_or(DVec3::ZERO, |h| runner.world().grip_wrench(h).unwrap().force);
        assert_eq!(wrench.as_vec3().to_array(), *force);
    }
}

#[test]
fn tables_and_obj_hold_the_positions() {
    let folder = tempfile::tempdir().unwrap();
    let t = recorded();
    let (table, obj) = (folder.path().join("t.csv"), folder.path().join("t.obj"));
    export(&t, Format::Csv, &table, ALL).unwrap();
    let mut rows = csv::Reader::from_path(table).unwrap();
    let rows: Vec<csv::StringRecord> = rows.records().map(Result::unwrap).collect();
    assert_eq!(rows.len(), t.frames.len() * (25 + 31));
    let row = &rows[rows.len() - 31 - 25 + 7];
    assert_eq!((&row[1], &row[2]), ("silk", "7"));
    let x = t.frames.last().unwrap().positions[0][7];
    for c in 0..3 {
        assert_eq!(row[3 + c].parse::<f32>().unwrap(), x[c]);
    }
    export(&t, Format::Obj, &obj, ALL).unwrap();
    let text = std::fs::read_to_string(obj).unwrap();
    let lines =
        |tag: &str| text.lines().filter(|l| l.starts_with(tag)).map(|l| l[tag.len()..].to_owned()).collect::<Vec<_>>();
    let (v, vn, f) = (lines("v "), lines("vn "), lines("f "));
    assert_eq!((lines("o "), v.len()), (["silk", "ring", "post", "bar", "floor"].map(String::from).to_vec(), vn.len()));
    // Every vertex of the first thread is a radius from its centerline, but for the parts that blending takes.
    let center: Vec<DVec3> = t.frames.last().unwrap().positions[0].iter().map(|x| wide(*x)).collect();
    let first = 13 * (24 * 4 + 1 + 6);
    for line in &v[..first] {
        let c: Vec<f64> = line.split(' ').map(|t| t.parse().unwrap()).collect();
        let x = DVec3::new(c[0], c[1], c[2]);
        let to = |w: &[DVec3]| {
            (x - (w[0]
                + (w[1] - w[0]) * ((x - w[0]).dot(w[1] - w[0]) / (w[1] - w[0]).length_squared()).clamp(0.0, 1.0)))
            .length()
        };
        let off = center.windows(2).map(to).fold(f64::INFINITY, f64::min) / t.header.threads[0].radius;
        assert!((0.8..1.2).contains(&off), "{off} radii");
    }
    let most =
        f.iter().flat_map(|l| l.split(' ')).map(|c| c.split('/').next().unwrap().parse::<usize>().unwrap()).max();
    assert_eq!(most, Some(v.len()), "faces count vertices from one, through all objects");
}

#[test]
fn moments_are_picked_by_rate_and_range() {
    let header = Header::default();
    let picked = |options: Options, rate: f64, n: u32| -> Vec<f64> {
        let folder = tempfile::tempdir().unwrap();
        let mut exporter = Exporter::new(Format::Csv, &header, &folder.path().join("t.csv"), options).unwrap();
        let times = (0..=n).map(|k| f64::from(k) / rate);
        times.filter(|t| exporter.wants(*t).then(|| exporter.add(&Moment::default()).unwrap()).is_some()).collect()
    };
    assert_eq!(picked(Options { rate: 30.0, ..ALL }, 60.0, 600).len(), 301);
    assert_eq!(picked(Options { rate: 1000.0, ..ALL }, 60.0, 600).len(), 601, "no more than there are");
    assert_eq!(picked(Options { rate: 25.0, ..ALL }, 60.0, 600).len(), 251, "the first at or after each multiple");
    let part = picked(Options { rate: 10.0, from: 1.0, to: 2.0, ..ALL }, 60.0, 600);
    assert!(part.len() == 11 && part[0] == 1.0 && part[10] == 2.0, "{part:?}");
}

#[test]
fn what_cannot_be_exported_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let t = recorded();
    let to = folder.path().join("x.glb");
    let error = |options: Options, out: &Path| export(&t, Format::Glb, out, options).unwrap_err().to_string();
    assert!(error(Options { from: 5.0, ..ALL }, &to).contains("the recording goes from 0 s to 0.25 s"));
    assert!(error(Options { rate: 0.0, ..ALL }, &to).contains("wanted a number > 0"));
    assert!(error(Options { from: 2.0, to: 1.0, ..ALL }, &to).contains("not after the last"));
    assert!(error(Options { sides: 2, ..ALL }, &to).contains("thread `silk`: skin: sides is 2.0, wanted 3 to 256"));
    std::fs::write(folder.path().join("file"), "").unwrap();
    assert!(error(ALL, &folder.path().join("file/x.glb")).contains("cannot write"));
}

/// A recording of an earlier version knows no looks: the tube is round, of the lengths between its particles.
#[test]
fn a_recording_without_looks_is_exported_too() {
    let folder = tempfile::tempdir().unwrap();
    let mut t = recorded();
    t.header.threads.iter_mut().for_each(|t| t.look = None);
    let t = Trajectory::from_bytes(&t.to_bytes()).unwrap();
    let path = folder.path().join("old.glb");
    export(&t, Format::Glb, &path, ALL).unwrap();
    let read = Read::new(&path);
    // The ring is known by its last particle on its first.
    let joints: Vec<usize> = read.document.skins().map(|s| s.joints().count()).collect();
    assert_eq!(joints, [24, 32]);
}
