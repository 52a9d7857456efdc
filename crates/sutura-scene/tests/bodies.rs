//! Free bodies in scenes: they run, are recorded and asked about, and slips name line and key.

use std::ops::ControlFlow;
use sutura_scene::export::{Exporter, Format, Moment, Options};
use sutura_scene::{Outcome, Runner, Scene, SceneError, ShapeOutline, Touched, Trajectory};

const G: f64 = 9.81;

fn runner(text: &str) -> Runner {
    let scene = Scene::parse(text, "bodies.toml").unwrap_or_else(|e| panic!("{e}"));
    Runner::recording(scene).unwrap_or_else(|e| panic!("{e}"))
}

fn run(text: &str) -> Outcome {
    let mut runner = runner(text);
    while !runner.step_frame().finished {}
    runner.finish()
}

/// A thread between two posts carries a ball; a dumbbell of two balls falls and spins beside it.
const SCENE: &str = r#"
frame_rate = 100
[[thread]]
name = "rope"
diameter = "0.4 mm"
young_modulus = "0.5 GPa"
density = "1150 kg/m^3"
elements = 40
line = { from = "[-20, 0, 0] mm", to = "[20, 0, 0] mm" }
[[shape]]
name = "floor"
kind = "plane"
position = "[0, 0, -100] mm"
[[body]]
name = "ball"
kind = "sphere"
radius = "3 mm"
density = "1000 kg/m^3"
position = "[0, 0, 3.3] mm"
[[body]]
name = "dumbbell"
density = "2 g/cc"
position = "[0, 60, 0] mm"
velocity = "[0, 0, 0.5] m/s"
angular_velocity = ["2 rad/s", 0, 0]
parts = [
  { kind = "sphere", radius = "2 mm", position = "[-10, 0, 0] mm" },
  { kind = "sphere", radius = "2 mm", position = "[10, 0, 0] mm" },
  { kind = "cylinder", radius = "1 mm", length = "20 mm", orientation = { z = [1, 0, 0] }, density = 1 },
]
[[grip]]
name = "left"
at = "start"
[[grip]]
name = "right"
at = "end"
[[phase]]
name = "fall"
duration = "0.1 s"
"#;

#[test]
fn a_scene_with_bodies_runs_and_tells_of_them() {
    // Without friction or damping a ball that falls 0.1 mm onto a taut thread goes on with it.
    let mass = 1000.0 * 4.0 / 3.0 * std::f64::consts::PI * 0.003f64.powi(3);
    let check = |that: &str, wanted: f64, allowed: f64| {
        format!("[[check]]\nthat = \"{that}\"\nequals = {wanted:e}\ntolerance = {allowed:e}\n")
    };
    // Implicit Euler at three substeps a frame falls half a substep too long.
    let (t, h) = (0.1, 0.01 / 3.0);
    let speed = 0.5 - G * t;
    let checks = [
        check("velocity(dumbbell).z", speed, 1e-9),
        check("speed(dumbbell)", speed.abs(), 1e-9),
        check("spin(dumbbell)", 2.0, 1e-9),
        check("position(dumbbell).z", 0.5 * t - 0.5 * G * t * (t + h), 1e-9),
        check("position(dumbbell).y", 0.06, 1e-12),
        check("distance(dumbbell, ball) * 0 + position(dumbbell).x", 0.0, 1e-12),
        check("angle(d2(dumbbell), [0, 1, 0])", 0.2, 1e-6),
        check("momentum(ball).z / velocity(ball).z", mass, 1e-9 * mass),
        check("kinetic_energy(ball) / speed(ball) / speed(ball)", 0.5 * mass, 1e-3 * mass),
        check("kinetic_energy() - kinetic_energy(rope) - kinetic_energy(ball) - kinetic_energy(dumbbell)", 0.0, 1e-15),
        check("energy() - energy(rope) - energy(ball) - energy(dumbbell)", 0.0, 1e-15),
        check("norm(force(dumbbell))", 0.0, 1e-15),
        // What the thread gives to the ball it takes from it: it is all that the ball touches.
        "[[check]]\nthat = \"force(ball).z\"\nduring = \"fall\"\ntake = \"max\"\nat_least = \"1 mN\"\n".to_owned(),
        "[[check]]\nthat = \"gap(rope, ball)\"\nbetween = [\"-0.05 mm\", \"0.1 mm\"]\n".to_owned(),
        "[[check]]\nthat = \"incidents() == 0 and not passes_through()\"\n".to_owned(),
    ];
    let out = run(&(SCENE.to_owned() + &checks.concat()));
    for c in &out.report.checks {
        assert!(c.passed, "{c:?}");
    }
    assert!(out.report.passed, "{:#?}", out.report.incidents);
    // The energy in the series is that of threads and bodies.
    let frames = &out.series[0];
    let column = |name: &str| frames.columns.iter().position(|c| c.0 == name).unwrap();
    let last = frames.rows.last().unwrap();
    assert!(last[column("kinetic")] > 0.5 * 1e-4 * speed * speed, "{}", last[column("kinetic")]);
}

#[test]
fn the_solids_of_bodies_are_shapes_of_the_recording() {
    let out = run(SCENE);
    let header = &out.trajectory.header;
    let names: Vec<&str> = header.shapes.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["floor", "ball", "dumbbell.0", "dumbbell.1", "dumbbell.2"]);
    assert!(matches!(header.shapes[1].outline, ShapeOutline::Sphere { .. }), "{:?}", header.shapes[1].outline);
    let (first, last) = (&out.trajectory.frames[0], out.trajectory.frames.last().unwrap());
    assert_eq!(first.shapes[3].0, [0.01, 0.06, 0.0]);
    // Both balls of the dumbbell fall and stay as far apart as they are.
    let [a, b] = [2, 3].map(|k| last.shapes[k].0);
    assert!((b[0] - a[0] - 0.02).abs() < 1e-6 && (a[2] - b[2]).abs() < 1e-6, "{a:?} {b:?}");
    // The thread's contact with the ball has the ball's number.
    let touched =
        |f: &sutura_scene::Frame| f.forces.iter().flat_map(|f| &f.contacts).any(|c| c.with == Touched::Shape(1));
    assert!(out.trajectory.frames.iter().any(touched));
    let path = tempfile::tempdir().unwrap().keep().join("bodies.trajectory");
    out.trajectory.write_to(&path).unwrap();
    assert_eq!(Trajectory::read_from(&path).unwrap(), out.trajectory);
    std::fs::remove_dir_all(path.parent().unwrap()).unwrap();
}

#[test]
fn a_recording_of_a_scene_with_bodies_plays_back_to_the_same_bits() {
    let out = run(SCENE);
    let again = run(SCENE);
    assert_eq!(out.report.state_hash, again.report.state_hash);
    let recording = out.input.expect("it was recorded");
    let bytes = recording.to_bytes();
    let read = sutura::input::Recording::from_bytes(&bytes).unwrap();
    let mut steps = 0;
    let watch = &mut |r: &sutura::input::Replayed<'_>| {
        steps += 1;
        if r.is_same() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    };
    let world = read.replay(watch).unwrap();
    assert_eq!(steps, 10);
    assert_eq!(format!("{:016x}", world.state_hash()), out.report.state_hash);
}

#[test]
fn a_saved_state_holds_the_bodies() {
    let folder = tempfile::tempdir().unwrap();
    let second = "[[phase]]\nname = \"on\"\nduration = \"0.1 s\"\n";
    let whole = run(&(SCENE.replace("duration = \"0.1 s\"", "duration = \"0.1 s\"\nsave = \"state\"") + second));
    std::fs::write(folder.path().join("state"), &whole.saved[0].bytes).unwrap();
    let before = SCENE.split("[[grip]]").next().unwrap();
    let path = folder.path().join("second.toml");
    let go_on = |text: &str| {
        std::fs::write(&path, text).unwrap();
        Scene::load(&path).and_then(Runner::new)
    };
    let mut runner = go_on(&format!("start = \"state\"\n{before}{second}")).unwrap_or_else(|e| panic!("{e}"));
    while !runner.step_frame().finished {}
    assert_eq!(runner.finish().report.state_hash, whole.report.state_hash);
    // Other bodies are refused.
    let other = before.replace("radius = \"3 mm\"", "radius = \"2 mm\"");
    assert!(go_on(&format!("start = \"state\"\n{other}{second}")).is_err());
}

/// A scene needs no thread where there is a body.
#[test]
fn a_body_alone_falls_and_is_exported() {
    let text = "[[body]]\nname = \"stone\"\nkind = \"box\"\nsides = \"[1, 2, 3] cm\"\ndensity = \"2.6 g/cc\"\n[[phase]]\nuntil = \"speed() >= 1 m/s\"\n[[check]]\nthat = \"abs(energy(stone)) < 1 mJ\"\n";
    let out = run(text);
    assert!(out.report.passed, "{:?}", out.report);
    assert!(serde_json::to_string(&out.report).is_ok());
    let folder = tempfile::tempdir().unwrap();
    for name in ["stone.glb", "stone.obj"] {
        let path = folder.path().join(name);
        let options =
            Options { rate: 60.0, from: 0.0, to: f64::INFINITY, sides: 12, rings: 4, up: sutura::glam::DVec3::Y };
        let mut exporter = Exporter::new(Format::of(&path).unwrap(), &out.trajectory.header, &path, options).unwrap();
        for frame in &out.trajectory.frames {
            if exporter.wants(frame.time) {
                exporter.add(&Moment::of_frame(frame)).unwrap();
            }
        }
        exporter.finish().unwrap();
        assert!(std::fs::metadata(&path).unwrap().len() > 500, "{name}");
    }
}

fn error(text: &str) -> SceneError {
    match Scene::parse(text, "bad.toml").and_then(Runner::new) {
        Err(e) => e,
        Ok(_) => panic!("accepted:\n{text}"),
    }
}

#[test]
fn slips_are_named_with_line_key_and_words() {
    let good = "[[body]]\nname = \"ball\"\nkind = \"sphere\"\nradius = \"3 mm\"\ndensity = \"1 g/cc\"\n\
                [[body]]\nname = \"two\"\nparts = [\n  { kind = \"sphere\", radius = \"2 mm\", density = \"1 g/cc\" },\n  { kind = \"box\", sides = \"[1, 1, 1] mm\", density = \"2 g/cc\" },\n]\n\
                [[phase]]\nname = \"rest\"\nduration = \"10 ms\"\naction = [{ gravity = [0, 0, 0] }]\n[[probe]]\nname = \"p\"\nwhat = \"spin(ball)\"\n";
    assert!(Scene::parse(good, "good.toml").and_then(Runner::new).is_ok());
    let sheet = "vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\ntriangles = [[0, 1, 2]]";
    for (from, to, line, key, words) in [
        ("density = \"1 g/cc\"\n[[body]]", "[[body]]", 1, "body[0]", "`density` is missing"),
        (
            "density = \"1 g/cc\"\n[[body]]",
            "density = \"1 g\"\n[[body]]",
            5,
            "body[0].density",
            "a mass, wanted a density",
        ),
        ("density = \"1 g/cc\"\n[[body]]", "density = 0\n[[body]]", 5, "body[0].density", "> 0"),
        ("density = \"1 g/cc\"\n[[body]]", "density = 1\nopen = true\n[[body]]", 6, "body[0].open", "unknown key"),
        (
            "density = \"1 g/cc\"\n[[body]]",
            "density = 1\nvelocity = \"[1, 0, 0] mm\"\n[[body]]",
            6,
            "body[0].velocity",
            "a length, wanted a speed",
        ),
        (
            "density = \"1 g/cc\"\n[[body]]",
            "density = 1\nangular_velocity = \"[1, 0, 0] m/s\"\n[[body]]",
            6,
            "body[0].angular_velocity",
            "a speed, wanted an angular velocity",
        ),
        (", density = \"2 g/cc\"", "", 10, "body[1].parts[1]", "`density` is missing"),
        ("kind = \"sphere\"\nradius = \"3 mm\"", "kind = \"plane\"", 3, "body[0].kind", "a plane is none"),
        (
            "kind = \"box\", sides = \"[1, 1, 1] mm\"",
            "kind = \"plane\"",
            10,
            "body[1].parts[1].kind",
            "a plane is none",
        ),
        (
            "kind = \"sphere\"\nradius = \"3 mm\"",
            &format!("kind = \"mesh\"\n{sheet}"),
            4,
            "body[0].vertices",
            "closed solid",
        ),
        ("kind = \"sphere\"\nradius = \"3 mm\"", "kind = \"mesh\"\nfile = \"none.obj\"", 4, "body[0].file", "none.obj"),
        ("radius = \"3 mm\"\n", "", 1, "body[0]", "`radius` is missing"),
        ("parts = [", "kind = \"box\"\nparts = [", 8, "body[1].kind", "exclude"),
        ("name = \"two\"", "name = \"ball\"", 7, "body[1].name", "taken"),
        ("gravity = [0, 0, 0]", "push = \"ball\"", 15, "phase[0].action[0].push", "cannot be pushed"),
        ("gravity = [0, 0, 0]", "grasp = \"ball\"", 15, "phase[0].action[0]", "`by` is missing"),
        ("gravity = [0, 0, 0]", "grasp = \"ball\", by = \"bal\"", 15, "phase[0].action[0].by", "no body is called"),
        (
            "density = \"1 g/cc\"\n[[body]]",
            "density = 1\ndriven = true\nheld_by = \"two\"\n[[body]]",
            6,
            "body[0].driven",
            "exclude",
        ),
        (
            "[[phase]]",
            "[[needle]]\nname = \"n\"\ncode = \"XY\"\n[[phase]]",
            14,
            "needle[0].code",
            "no needle has the code",
        ),
        (
            "[[phase]]",
            "[[needle]]\nname = \"n\"\ncode = \"SH\"\nswage = \"t.end\"\n[[phase]]",
            15,
            "needle[0].swage",
            "no end of a thread",
        ),
        ("[[phase]]", "[[needle]]\nname = \"n\"\nwire = \"1 mm\"\n[[phase]]", 12, "needle[0]", "`shape` is missing"),
        ("spin(ball)", "spin(bal)", 18, "probe[0].what", "`bal`"),
        ("spin(ball)", "tension(ball)", 18, "probe[0].what", "wants a thread"),
        ("[[phase]]", "[solver]\nmethod = \"paper\"\n[[phase]]", 1, "body[0]", "the direct solver"),
    ] {
        assert!(good.contains(from), "{from}");
        let e = error(&good.replacen(from, to, 1));
        let found = e.problems.iter().any(|p| {
            p.line == Some(line)
                && p.key == key
                && format!("{} {}", p.message, p.help.clone().unwrap_or_default()).contains(words)
                && p.file == "bad.toml"
        });
        assert!(found, "{to}: wanted line {line}, `{key}`, \"{words}\"; found\n{e}");
    }
    let none = format!("{}parts = []\n[[phase]]\nduration = 1\n", "[[body]]\nname = \"two\"\n");
    assert!(error(&none).to_string().contains("at least one part"));
}
