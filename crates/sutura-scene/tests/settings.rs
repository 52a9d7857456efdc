//! Values of a scene set from outside.

use sutura_scene::{Runner, Scene};

const SCENE: &str = r#"
[solver]
substep = "4 ms"

[[thread]]
name = "silk"
size = "3-0"
material = "silk"
elements = 20
line = { from = [0, 0, 0], to = "[100, 0, 0] mm" }

[[phase]]
name = "pull"
action = [{ load = "tip", at = "end", force = "[0, 0, -1] mN" }]
duration = "20 ms"

[[probe]]
name = "elements"
what = "length(silk) / distance(silk.particle[0], silk.particle[1])"

[[probe]]
name = "fallen"
what = "-position(silk.end).z"
unit = "mm"
"#;

fn read(settings: &[(&str, &str)]) -> Result<Scene, String> {
    let settings: Vec<(String, String)> = settings.iter().map(|(k, v)| ((*k).into(), (*v).into())).collect();
    Scene::parse_with(SCENE, "scene.toml", &settings).map_err(|e| e.to_string())
}

/// Last values of the two probes.
fn run(settings: &[(&str, &str)]) -> [f64; 2] {
    let mut runner = Runner::new(read(settings).unwrap_or_else(|e| panic!("{e}"))).unwrap_or_else(|e| panic!("{e}"));
    while !runner.step_frame().finished {}
    let report = runner.finish().report;
    [report.probes[0].last, report.probes[1].last]
}

#[test]
fn keys_are_replaced_and_added() {
    let [elements, fallen] = run(&[]);
    assert!((elements - 20.0).abs() < 0.01);
    assert!((run(&[("thread.silk.elements", "30")])[0] - 30.0).abs() < 0.01);
    // By number, inside an array, with a unit; and a key that the scene does not have.
    assert!(run(&[("phase[0].action[0].force", "[0, 0, -2] mN")])[1] > fallen);
    assert!(run(&[("phase.pull.action[0].force", "[0, 0, 0]"), ("solver.gravity", "[0, 0, 0]")])[1].abs() < 1e-9);
    // The last word counts.
    assert!((run(&[("thread.silk.elements", "30"), ("thread.silk.elements", "40")])[0] - 40.0).abs() < 0.01);
}

#[test]
fn mistakes_name_the_setting() {
    for (path, value, part) in [
        ("thread.silk.elments", "30", "unknown key (did you mean `elements`?)"),
        (
            "thread.slik.elements",
            "30",
            "no entry is called `slik`; entries without a name are chosen by number, `[0]` (did you mean `silk`?)",
        ),
        ("thread.silk.elements", "many", "found the text \"many\", wanted a whole number"),
        ("thread.silk.elements", "-3", "wanted a whole number"),
        ("solver.substep", "1 mm", "\"1 mm\" is a length, wanted a time"),
        ("thread.silk.line.to", "[1, 2] mm", "found 2 numbers, wanted three"),
        ("thread.silk.elements.x", "1", "there is no table in which to set `x`"),
        ("solver[0]", "1", "there is no array from which to take entry 0"),
        ("phase[3].duration", "1 s", "there is no entry 3: there are 1, counted from 0"),
        ("phase[x].duration", "1 s", "`[x]` is not the number of an entry"),
        ("", "1", "a path is names with points between them"),
        ("phase.pull.until", "speed(silk) < 1 mm", "a speed cannot be compared with a length"),
    ] {
        let error = read(&[(path, value)]).err().unwrap_or_else(|| panic!("accepted {path} = {value}"));
        assert!(error.contains(&format!("{path} = {value}: ")) && error.contains(part), "{path} = {value}: {error}");
    }
    // What was right in the scene still names its line.
    let error = read(&[("thread.silk.name", "wool")]).expect_err("the scene speaks of silk");
    assert!(error.contains("scene.toml:") && error.contains("silk"), "{error}");
}

#[test]
fn no_setting_makes_the_reader_panic() {
    for value in ["", "\"", "[", "{", "1\nx = 2", "'''", "\u{0}", "ü", "= 3", "# nothing"] {
        for path in
            ["title", "thread.silk.elements", "thread", "phase", "solver.substep", "thread[", "thread]0[", ".", "ü.ö"]
        {
            let _ = read(&[(path, value)]);
        }
    }
}
