//! `[[joint]]` in scenes: what it does, and what is wrong with one.

use sutura_scene::{Runner, Scene, SceneError};

const GOOD: &str = r#"
[solver]
gravity = [0, 0, 0]

[[body]]
name = "arm"
kind = "box"
sides = "[40, 10, 10] mm"
density = "1 g/cc"
position = "[20, 0, 0] mm"

[[body]]
name = "hand"
kind = "box"
sides = "[20, 8, 8] mm"
density = "1 g/cc"
position = "[50, 0, 0] mm"

[[joint]]
name = "shoulder"
kind = "hinge"
body = "arm"
at = [0, 0, 0]
axis = [0, 0, 2]
motor = { speed = "0.5 turns/s", torque = "1 N mm" }
limits = ["-10 deg", "80 deg"]

[[joint]]
name = "wrist"
kind = "slider"
bodies = ["arm", "hand"]
at = "[40, 0, 0] mm"
axis = [1, 0, 0]
limits = "[0, 3] mm"
friction = "0.1 mN"

[[phase]]
name = "turn"
duration = "0.8 s"

[[check]]
that = "joint_angle(shoulder)"
equals = "80 deg"
tolerance = "0.1 deg"

[[check]]
that = "joint_way(wrist)"
equals = "3 mm"
tolerance = "0.01 mm"

[[check]]
that = "torque(shoulder).z"
equals = "0 N mm"
tolerance = "0.01 N mm"

[[check]]
that = "incidents() == 0"
"#;

fn error(text: &str) -> SceneError {
    match Scene::parse(text, "bad.toml") {
        Err(e) => e,
        Ok(scene) => match Runner::new(scene) {
            Err(e) => e,
            Ok(_) => panic!("accepted:\n{text}"),
        },
    }
}

#[test]
fn joints_hold_turn_and_slide() {
    let mut runner = Runner::new(Scene::parse(GOOD, "good.toml").unwrap_or_else(|e| panic!("{e}"))).unwrap();
    while !runner.step_frame().finished {}
    let report = runner.finish().report;
    assert!(report.passed, "{:?}", report.checks);
}

/// What is replaced by what, the key, and words of the problem.
#[test]
fn slips_in_joints_are_named() {
    let cases = [
        ("name = \"wrist\"\n", "", "joint[1]", "`name` is missing"),
        ("name = \"wrist\"", "name = \"arm\"", "joint[1].name", "is taken"),
        ("kind = \"hinge\"", "kind = \"hing\"", "joint[0].kind", "hing"),
        ("body = \"arm\"", "body = \"amr\"", "joint[0].body", "no body is called `amr`"),
        ("body = \"arm\"\n", "", "joint[0]", "`body` is missing"),
        ("body = \"arm\"", "body = \"arm\"\nbodies = [\"arm\", \"hand\"]", "joint[0].body", "exclude"),
        ("[\"arm\", \"hand\"]", "[\"arm\", \"arm\"]", "joint[1].bodies", "itself"),
        ("[\"arm\", \"hand\"]", "[\"arm\"]", "joint[1].bodies", "wanted two"),
        ("at = [0, 0, 0]\n", "", "joint[0]", "at"),
        ("axis = [1, 0, 0]\n", "", "joint[1]", "axis"),
        ("axis = [1, 0, 0]", "axis = [0, 0, 0]", "joint[1].axis", "cannot be zero"),
        ("kind = \"slider\"", "kind = \"ball\"", "joint[1].axis", "only a hinge and a slider"),
        ("limits = \"[0, 3] mm\"", "limits = \"[0, 3] deg\"", "joint[1].limits", "deg"),
        ("limits = \"[0, 3] mm\"", "limits = \"[3, 0] mm\"", "joint[1].limits", "smaller"),
        ("limits = \"[0, 3] mm\"", "limits = \"[1, 3] mm\"", "joint[1]", "limits"),
        ("torque = \"1 N mm\"", "force = \"1 N\"", "joint[0].motor", "`torque` is missing"),
        ("torque = \"1 N mm\"", "torque = \"1 N\"", "joint[0].motor.torque", "N"),
        ("speed = \"0.5 turns/s\", ", "", "joint[0].motor", "speed"),
        ("friction = \"0.1 mN\"", "friction = \"-1 mN\"", "joint[1].friction", ""),
        ("friction = \"0.1 mN\"", "fricton = \"1 mN\"", "joint[1].fricton", "unknown key"),
        ("joint_way(wrist)", "joint_way(arm)", "check[1].that", "a joint"),
        ("joint_way(wrist)", "position(wrist)", "check[1].that", "wrist"),
    ];
    for (old, new, key, words) in cases {
        assert!(GOOD.contains(old), "{old}");
        let found = error(&GOOD.replacen(old, new, 1));
        let seen = found.problems.iter().any(|p| p.key == key && p.message.contains(words));
        assert!(seen, "{old} -> {new}: wanted {key} with `{words}`, found\n{found}");
        assert!(found.problems.iter().all(|p| p.line.is_some()), "{found}");
    }
}
