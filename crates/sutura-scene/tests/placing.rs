//! What a scene puts into the world: things that lie in each other, meshes with faults, runs in which nothing is
//! simulated.

use sutura_scene::{Outcome, Runner, Scene, SceneError};

fn runner(text: &str) -> Result<Runner, SceneError> {
    Runner::new(Scene::parse(text, "test.toml").unwrap_or_else(|e| panic!("{e}")))
}

fn run(text: &str) -> Outcome {
    let mut runner = runner(text).unwrap_or_else(|e| panic!("{e}"));
    while !runner.step_frame().finished {}
    runner.finish()
}

/// A thread along `from` to `to`, in millimeters.
fn thread(name: &str, from: [f64; 3], to: [f64; 3]) -> String {
    format!(
        "[[thread]]\nname = \"{name}\"\ndiameter = \"0.3 mm\"\nyoung_modulus = \"2 GPa\"\ndensity = \"1150 kg/m^3\"\nelements = 20\nline = {{ from = \"{from:?} mm\", to = \"{to:?} mm\" }}\n"
    )
}

const WEIGHTLESS: &str = "[solver]\ngravity = [0, 0, 0]\n";
const SHORT: &str = "[[phase]]\nduration = \"0.1 s\"\n";

#[test]
fn threads_that_start_through_each_other_are_named_and_never_pass() {
    // A clearance of -0.61 diameters, no checks.
    let (a, b) =
        (thread("warp", [-10.0, 0.0, 0.0], [10.0, 0.0, 0.0]), thread("weft", [4.0, -10.0, 0.117], [4.0, 10.0, 0.117]));
    let out = run(&format!("{WEIGHTLESS}{a}{b}{SHORT}")).report;
    assert!(!out.passed && out.failures.len() == 1, "{:?}", out.failures);
    assert_eq!(out.overlaps.len(), 1);
    let o = &out.overlaps[0];
    assert_eq!((o.thread.as_str(), o.with.as_str(), o.through, o.time_s), ("warp", "weft", true, 0.0));
    assert!((o.arc_m - 0.014).abs() < 1e-9 && (o.with_arc_m.unwrap() - 0.01).abs() < 1e-9, "{o:?}");
    assert!(
        (o.depth_m - 0.183e-3).abs() < 1e-9
            && (o.depth_diameters - 0.61).abs() < 1e-6
            && (o.point_m[0] - 4e-3).abs() < 1e-9,
        "{o:?}"
    );
    for words in [
        "`warp` at 14.000 mm",
        "`weft` at 10.000 mm",
        "0.183 mm (0.61 diameters)",
        "(4.000, 0.000, 0.059) mm",
        "test.toml:3: thread[0]",
        "test.toml:10: thread[1]",
    ] {
        assert!(o.message.contains(words), "{}: {words}", o.message);
    }
    // The incident has the same words.
    assert!(out.incidents.iter().any(|i| i.message == o.message && i.count == 1), "{:?}", out.incidents);
}

#[test]
fn what_is_pressed_into_each_other_is_told_and_relaxes() {
    let (a, b) =
        (thread("warp", [-10.0, 0.0, 0.0], [10.0, 0.0, 0.0]), thread("weft", [4.0, -10.0, 0.25], [4.0, 10.0, 0.25]));
    let out = run(&format!("{WEIGHTLESS}{a}{b}[[phase]]\nduration = \"0.5 s\"\n")).report;
    assert!(out.passed && out.overlaps.len() == 1 && !out.overlaps[0].through, "{:?} {:?}", out.failures, out.overlaps);
    assert!(out.incidents.iter().any(|i| i.message.contains("is pressed into")));
    // No time to get out: it does not pass.
    let out = run(&format!("{WEIGHTLESS}{a}{b}[[phase]]\nduration = \"1 ms\"\n")).report;
    assert!(out.passed || out.failures[0].contains("still"), "{:?}", out.failures);
}

#[test]
fn a_thread_in_a_solid_is_named() {
    let shape = "[[shape]]\nname = \"post\"\nkind = \"cylinder\"\nradius = \"2 mm\"\nlength = \"20 mm\"\n";
    let out = run(&format!("{WEIGHTLESS}{}{shape}{SHORT}", thread("a", [-10.0, 0.5, 0.0], [10.0, 0.5, 0.0]))).report;
    assert!(!out.passed && out.overlaps.len() == 1, "{:?}", out.overlaps);
    let o = &out.overlaps[0];
    assert!(o.through && o.with == "post" && o.with_arc_m.is_none() && (o.depth_m - 1.65e-3).abs() < 1e-6, "{o:?}");
    assert!(
        o.message.contains("`a` at") && o.message.contains("lies in `post`") && o.message.contains("shape[0]"),
        "{}",
        o.message
    );
}

#[test]
fn nothing_is_simulated_and_that_is_no_success() {
    let one = thread("a", [0.0, 0.0, 0.0], [50.0, 0.0, 0.0]);
    let out = run(&format!("[solver]\ngravity = [0, 0, -1e300]\n{one}{SHORT}")).report;
    assert!(!out.passed && out.simulated_s == 0.0 && (out.not_simulated_s - 0.1).abs() < 1e-9, "{out:?}");
    assert!(out.failures[0].contains("of 0.1000 s only 0.0000 s were simulated"), "{:?}", out.failures);
    let out = run(&format!("{one}{SHORT}")).report;
    assert!(out.passed && out.not_simulated_s == 0.0 && (out.simulated_s - 0.1).abs() < 1e-12);
    // A line that is closed cannot be.
    let error =
        runner(&format!("{}{SHORT}", one.replace("elements", "closed = true\nelements"))).err().unwrap().to_string();
    assert!(
        error.contains("test.toml:1: thread[0]") && error.contains("centerline[20]") && error.contains("turns back"),
        "{error}"
    );
}

/// A block with one triangle turned over, and without its last one.
fn block(n_triangles: usize, more: &str) -> String {
    let triangles =
        "[0,3,1], [0,2,3], [4,6,7], [4,5,7], [0,5,4], [0,1,5], [2,7,3], [2,6,7], [0,6,2], [0,4,6], [1,7,5], [1,3,7]";
    let triangles: Vec<&str> = triangles.split(", ").take(n_triangles).collect();
    let vertices: Vec<String> = (0..8).map(|k| format!("[{}, {}, {}]", k & 1, k >> 1 & 1, k >> 2)).collect();
    format!(
        "[[shape]]\nname = \"block\"\nkind = \"mesh\"\n{more}vertices = [{}]\ntriangles = [{}]\n",
        vertices.join(", "),
        triangles.join(", ")
    )
}

#[test]
fn meshes_are_mended_and_said_or_refused_where_they_are_wrong() {
    let away = thread("a", [0.0, 0.0, 5000.0], [50.0, 0.0, 5000.0]);
    let mended = runner(&format!("{away}{}{SHORT}", block(12, ""))).unwrap();
    assert_eq!(mended.notes().len(), 1);
    let note = &mended.notes()[0];
    assert!(
        note.contains("mesh `block`: turned 1 triangle")
            && note.contains("triangle 2 at")
            && note.contains("test.toml:8: shape[0]"),
        "{note}"
    );
    let error = runner(&format!("{away}{}{SHORT}", block(11, ""))).err().unwrap().to_string();
    assert!(
        error.contains("test.toml:8: shape[0]")
            && error.contains("1 small hole")
            && error.contains("(1, 0.666667, 0.333333) m"),
        "{error}"
    );
    let open = runner(&format!("{away}{}{SHORT}", block(11, "open = true\n"))).unwrap();
    assert!(open.notes().iter().any(|n| n.contains("the mesh is open")), "{:?}", open.notes());
    let report = open.finish().report;
    assert_eq!(report.notes.len(), 2);
    let text = format!("{away}{SHORT}{}", block(12, "open = true\n").replace("\"mesh\"", "\"plane\""));
    let error = Scene::parse(&text, "test.toml").err().unwrap().to_string();
    assert!(error.contains("only a mesh may be open"), "{error}");
}

#[test]
fn no_scene_of_this_repository_starts_with_things_in_each_other() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let mut n = 0;
    for folder in [folder.clone(), folder.join("validation")] {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|e| e == "toml") {
                // Some validation scenes begin where another ended.
                let runner = match Scene::load(&path).and_then(Runner::new) {
                    Ok(runner) => runner,
                    Err(e) => panic!("{e}"),
                };
                assert!(runner.overlaps().is_empty(), "{}: {:?}", path.display(), runner.overlaps());
                assert!(runner.notes().is_empty(), "{}: {:?}", path.display(), runner.notes());
                n += 1;
            }
        }
    }
    assert!(n > 50, "{n}");
}
