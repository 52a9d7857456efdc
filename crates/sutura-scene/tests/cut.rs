//! Threads cut in scenes: what refers to them, what is recorded and exported of them.

use core::ops::ControlFlow;
use std::path::Path;
use sutura_scene::export::{Exporter, Format, Moment, Options};
use sutura_scene::{Outcome, Runner, Scene, SceneError, Trajectory};

const THREADS: &str = r#"
[solver]
substep = "2 ms"
linear_drag = 20
angular_drag = 20

[[thread]]
name = "silk"
size = "2-0"
material = "polypropylene"
elements = 40
line = { from = [0, 0, 0], to = "[0, 0, -80] mm" }

[[thread]]
name = "ring"
size = "2-0"
material = "polypropylene"
elements = 30
closed = true
arc = { center = "[40, 0, 0] mm", axis = [0, 1, 0], start = "[40, 0, 10] mm", angle = "1 turn" }

[[grip]]
name = "hook"
thread = "silk"
at = "start"
hold = "clamp"

[[grip]]
name = "foot"
thread = "silk"
at = "70 mm"
hold = "pin"

[[load]]
name = "wind"
thread = "silk"
force_per_length = "[0.01, 0, 0] N/m"

[[load]]
name = "weight"
thread = "silk"
at = "60 mm"
mass = "0.1 g"
"#;

const CUTS: &str = r#"
[[phase]]
name = "hang"
duration = "50 ms"

[[phase]]
name = "cut"
duration = "0.1 s"
save = "cut.state"
action = [
    { cut = "silk", at = "41 mm", name = "tail" },
    { cut = "ring", at = "particle 10" },
    { cut = "silk", at = "middle" },
]
"#;

const REST: &str = r#"
[[phase]]
name = "hold"
duration = "0.4 s"
action = [
    { take = "hand", thread = "silk.cut", at = "end", hold = "pin" },
    { load = "wind", thread = "silk", force_per_length = "[0.02, 0, 0] N/m" },
    { let_go = "foot" },
]

[[check]]
that = "length(silk) + length(silk.cut) + length(tail)"
equals = "80 mm"
tolerance = "0.1 mm"
[[check]]
that = "distance(silk.cut.end, hand)"
at_most = "1 nm"
[[check]]
that = "held(hand) and not held(foot)"
[[check]]
that = "length(tail)"
equals = "40 mm"
tolerance = "0.1 mm"
[[check]]
that = "distance(ring.start, ring.end)"
at_least = "20 mm"
[[check]]
that = "incidents() == 0"
[[check]]
that = "not passes_through()"
"#;

fn scene(text: &str) -> Result<Scene, SceneError> {
    Scene::parse(text, "cut.toml")
}

fn run(text: &str) -> Outcome {
    let mut runner = Runner::recording(scene(text).unwrap_or_else(|e| panic!("{e}"))).unwrap_or_else(|e| panic!("{e}"));
    while !runner.step_frame().finished {}
    runner.finish()
}

fn whole() -> Outcome {
    run(&format!("{THREADS}{CUTS}{REST}"))
}

#[test]
fn parts_are_threads_of_the_scene() {
    let outcome = whole();
    let r = &outcome.report;
    assert!(r.passed, "{:?} {:?}", r.checks, r.incidents);
    let threads: Vec<_> = r.threads.iter().map(|t| (t.name.as_str(), t.elements)).collect();
    assert_eq!(threads, [("silk", 10), ("ring", 30), ("tail", 20), ("silk.cut", 10)]);
    // What was done to the world plays back to the same bits.
    let mut steps = 0;
    let same = |step: &sutura::input::Replayed<'_>| {
        assert!(step.is_same(), "{}", step.step);
        steps += 1;
        ControlFlow::Continue(())
    };
    outcome.input.unwrap().replay(&mut { same }).unwrap();
    assert!(steps > 30, "{steps}");
}

#[test]
fn a_saved_state_has_its_cuts() {
    let folder = tempfile::tempdir().unwrap();
    let one = whole();
    std::fs::write(folder.path().join("cut.state"), &one.saved[0].bytes).unwrap();
    let bare = THREADS.split("[[grip]]").next().unwrap();
    let path = folder.path().join("second.toml");
    std::fs::write(&path, format!("start = \"cut.state\"\n{bare}{REST}")).unwrap();
    let mut runner =
        Runner::new(Scene::load(&path).unwrap_or_else(|e| panic!("{e}"))).unwrap_or_else(|e| panic!("{e}"));
    while !runner.step_frame().finished {}
    let two = runner.finish();
    assert!(two.report.passed, "{:?}", two.report.checks);
    assert_eq!(two.report.state_hash, one.report.state_hash);
    assert_eq!(two.trajectory.header.threads.len(), 4);
}

#[test]
fn a_recording_has_each_thread_from_when_it_is_there() {
    let outcome = whole();
    let t = &outcome.trajectory;
    let names: Vec<&str> = t.header.threads.iter().map(|t| t.name.as_str()).collect();
    assert_eq!(names, ["silk", "ring", "tail", "silk.cut"]);
    let elements = |frame: &sutura_scene::Frame| frame.orientations.iter().map(Vec::len).collect::<Vec<_>>();
    assert_eq!(elements(&t.frames[0]), [40, 30]);
    assert_eq!(elements(t.frames.last().unwrap()), [10, 30, 20, 10]);
    assert!(t.frames.iter().all(|f| f.positions.iter().zip(&f.orientations).all(|(x, q)| x.len() == q.len() + 1)));
    let bytes = t.to_bytes();
    assert_eq!(bytes[8], 3);
    assert_eq!(&Trajectory::from_bytes(&bytes).unwrap(), t);
    // A scene without a cut writes what it always did.
    let uncut = run(&format!("{THREADS}{}", CUTS.split("[[phase]]\nname = \"cut\"").next().unwrap()));
    assert_eq!(uncut.trajectory.to_bytes()[8], 2);
}

const ALL: Options = Options { rate: 1e3, ..DEFAULT };
const DEFAULT: Options =
    Options { rate: 30.0, from: 0.0, to: f64::INFINITY, sides: 6, rings: 1, up: sutura::glam::DVec3::Y };

fn of_recording(t: &Trajectory, format: Format, out: &Path) {
    let mut exporter = Exporter::new(format, &t.header, out, ALL).unwrap();
    for frame in &t.frames {
        assert!(exporter.wants(frame.time));
        exporter.add(&Moment::of_frame(frame)).unwrap();
    }
    assert_eq!(exporter.finish().unwrap().moments, t.frames.len());
}

fn of_run(format: Format, out: &Path) {
    let mut runner = Runner::new(scene(&format!("{THREADS}{CUTS}{REST}")).unwrap()).unwrap();
    let mut exporter = Exporter::new(format, &runner.header(), out, ALL).unwrap();
    loop {
        exporter.follow(&runner);
        exporter.add(&Moment::of_runner(&runner)).unwrap();
        if runner.now().finished {
            break;
        }
        runner.step_frame();
    }
    exporter.finish().unwrap();
}

#[test]
fn tables_obj_and_vtk_have_the_threads_that_are_there() {
    let folder = tempfile::tempdir().unwrap();
    let t = whole().trajectory;
    let at = |name: &str| folder.path().join(name);
    for (live, end) in [(false, "rec"), (true, "run")] {
        let export = |format: Format, name: &str| {
            let out = at(&format!("{end}{name}"));
            if live {
                of_run(format, &out);
            } else {
                of_recording(&t, format, &out);
            }
            out
        };
        let csv = std::fs::read_to_string(export(Format::Csv, ".csv")).unwrap();
        let rows = |name: &str| csv.lines().filter(|l| l.split(',').nth(1) == Some(name)).count();
        let before = t.frames.iter().filter(|f| f.positions.len() == 2).count();
        let after = t.frames.len() - before;
        assert!(before >= 3 && after > 10);
        assert_eq!([rows("tail"), rows("silk.cut")], [21 * after, 11 * after]);
        assert_eq!(rows("silk"), 41 * before + 11 * after);
        let obj = export(Format::Obj, "obj");
        let objects = |k: usize| {
            let text = std::fs::read_to_string(obj.join(format!("frame_{k:05}.obj"))).unwrap();
            text.lines().filter_map(|l| l.strip_prefix("o ").map(str::to_owned)).collect::<Vec<_>>()
        };
        assert_eq!(objects(0), ["silk", "ring"]);
        assert_eq!(objects(t.frames.len() - 1), ["silk", "ring", "tail", "silk.cut"]);
        let vtk = export(Format::Vtk, "vtk");
        let lines = |k: usize| {
            let text = std::fs::read_to_string(vtk.join(format!("threads_{k:05}.vtp"))).unwrap();
            [2, 4].into_iter().find(|n| text.contains(&format!("NumberOfLines=\"{n}\"")))
        };
        assert_eq!((lines(0), lines(t.frames.len() - 1)), (Some(2), Some(4)));
    }
}

#[test]
fn a_glb_shows_a_part_from_when_it_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let t = whole().trajectory;
    let [recorded, live] = ["recorded.glb", "live.glb"].map(|name| folder.path().join(name));
    of_recording(&t, Format::Glb, &recorded);
    of_run(Format::Glb, &live);
    for file in [recorded, live] {
        let gltf = gltf::Gltf::from_slice(&std::fs::read(&file).unwrap()).unwrap();
        let (document, bytes) = (gltf.document, gltf.blob.unwrap());
        let skins: Vec<(String, usize)> =
            document.skins().map(|s| (s.name().unwrap().to_owned(), s.joints().count())).collect();
        let names = ["silk", "ring", "tail", "silk.cut"];
        assert_eq!(skins, names.iter().map(|n| (*n).to_owned()).zip([40, 30, 20, 10]).collect::<Vec<_>>());
        let animation = document.animations().next().unwrap();
        let scales = |name: &str| {
            let channel = animation.channels().find(|c| {
                c.target().node().name() == Some(name) && c.target().property() == gltf::animation::Property::Scale
            });
            let reader = channel.unwrap().reader(|_| Some(&bytes)).read_outputs().unwrap();
            let gltf::animation::util::ReadOutputs::Scales(scales) = reader else { panic!("no scales") };
            scales.map(|s| s[0]).collect::<Vec<f32>>()
        };
        let tail = scales("tail.3");
        assert_eq!(tail.len(), t.frames.len());
        for (frame, scale) in t.frames.iter().zip(&tail) {
            let there = frame.positions.len() > 2;
            assert!(if there { (scale - 1.0).abs() < 0.1 } else { *scale == 0.0 }, "{} {scale}", frame.time);
        }
    }
}

#[test]
fn slips_are_named() {
    let phase = |actions: &str| format!("{THREADS}\n[[phase]]\nduration = \"1 ms\"\naction = [{actions}]\n");
    for (actions, words) in [
        ("{ cut = \"silk\" }", "`at` is missing"),
        ("{ cut = \"silk\", at = \"start\" }", "at least one is to be left"),
        ("{ cut = \"silk\", at = \"79.9 mm\" }", "at least one is to be left"),
        ("{ cut = \"silk\", at = \"90 mm\" }", "particles 0 to 40"),
        ("{ cut = \"silk\", at = \"middle\", name = \"ring\" }", "the name `ring` is taken"),
        ("{ cut = \"silk\", at = \"middle\", name = \"a b\" }", "cannot be a name"),
        ("{ cut = \"silk\", at = \"middle\" }, { cut = \"silk\", at = \"middle\" }", "the name `silk.cut` is taken"),
        ("{ cut = \"silk\", at = \"middle\" }, { cut = \"silk\", at = \"50 mm\", name = \"b\" }", "particles 0 to 20"),
        ("{ cut = \"ring\", at = \"middle\", name = \"a\" }", "nothing is cut off"),
        ("{ cut = \"silc\", at = \"middle\" }", "no thread is called `silc`"),
        ("{ cut = \"silk\", at = \"middle\", ramp = \"1 s\" }", "ramp: unknown key"),
        (
            "{ take = \"hand\", thread = \"tail\", at = \"end\" }, { cut = \"silk\", at = \"middle\", name = \"tail\" }",
            "`tail` is not cut off yet then",
        ),
    ] {
        let said = scene(&phase(actions)).expect_err(actions).to_string();
        assert!(said.contains(words), "{actions}:\n{said}");
    }
    // What only the engine knows is named with its line too; in a later phase it ends the run.
    let held = "{ cut = \"silk\", at = \"particle 35\" }";
    let said = Runner::new(scene(&phase(held)).unwrap()).err().unwrap().to_string();
    assert!(said.contains("cut.toml:47") && said.contains("no grip holds"), "{said}");
    let later = run(&format!("{}[[phase]]\nduration = \"1 s\"\naction = [{held}]\n", phase("")));
    assert!(!later.report.passed && later.report.frames < 5);
    assert!(later.report.incidents.iter().any(|i| i.message.contains("no grip holds")), "{:?}", later.report.incidents);
    // A probe of a part is missing until it is there.
    let probed = run(&format!("{THREADS}{CUTS}\n[[probe]]\nname = \"z\"\nwhat = \"position(tail.end).z\"\n"));
    let series = probed.series.iter().find(|s| s.name == "z").unwrap();
    assert!(series.rows[0][1].is_nan() && series.rows.last().unwrap()[1].is_finite());
}
