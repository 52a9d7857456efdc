//! Contact that holds: what is thin, sharp, hollow or moved, and loads that a suture bears.

use sutura_scene::{Outcome, Runner, Scene};

fn run(text: &str) -> Outcome {
    let mut runner = Runner::new(Scene::parse(text, "contact.toml").unwrap()).unwrap();
    while !runner.step_frame().finished {}
    runner.finish()
}

/// Every check passes, nothing passes through, nothing is said.
fn holds(text: &str) -> Outcome {
    let outcome = run(text);
    let r = &outcome.report;
    assert!(r.incidents.is_empty(), "{:?}", r.incidents.iter().map(|i| &i.message).collect::<Vec<_>>());
    assert!(r.passes_through != Some(true) && r.passed, "{:?} {:?}", r.passages, r.checks);
    outcome
}

const SILK: &str = r#"
[[thread]]
name = "t"
size = "3-0"
material = "silk"
"#;

/// Plates thinner than the way of a substep, from either side.
#[test]
fn a_thin_plate_takes_a_thread_along() {
    for (sides, speed, sign) in [("0.1 mm", "0.1 m/s", 1), ("0.1 mm", "0.4 m/s", -1), ("0.5 mm", "1 m/s", 1)] {
        holds(&format!(
            r#"
[solver]
gravity = [0, 0, 0]
linear_damping = 0.9
{SILK}
elements = 100
line = {{ from = "[0, -25, 0] mm", to = "[0, 25, 0] mm" }}
[[shape]]
name = "plate"
kind = "box"
sides = ["{sides}", "20 mm", "80 mm"]
position = "[{}, 0, 0] mm"
[[phase]]
action = [{{ move = "plate", path = "linear", speed = "{speed}", keys = [{{ by = "[{}, 0, 0] mm" }}] }}]
[[check]]
name = "carried along"
that = "{sign} * position(t.middle).x"
at_least = "20 mm"
"#,
            -10 * sign,
            40 * sign
        ));
    }
}

/// A wire that crosses a taut thread at 1 m/s takes it along.
#[test]
fn a_fast_wire_takes_a_held_thread_along() {
    for radius in ["0.1 mm", "1 mm"] {
        holds(&format!(
            r#"
[solver]
gravity = [0, 0, 0]
[friction]
default = 0
[[thread]]
name = "t"
radius = "0.15 mm"
young_modulus = "100 MPa"
density = "1150 kg/m^3"
elements = 40
line = {{ from = "[-20.2, 0, 0] mm", to = "[19.8, 0, 0] mm" }}
[[grip]]
name = "a"
at = "start"
hold = "pin"
[[grip]]
name = "b"
at = "end"
hold = "pin"
[[shape]]
name = "wire"
kind = "cylinder"
radius = "{radius}"
length = "20 mm"
position = "[0, 0, 8] mm"
orientation = {{ z = [0, 1, 0] }}
[[phase]]
action = [{{ move = "wire", path = "linear", speed = "1 m/s", keys = [{{ by = "[0, 0, -13] mm" }}] }}]
[[phase]]
duration = "0.05 s"
[[check]]
name = "taken along"
that = "position(t.middle).z"
at_most = "-5 mm"
"#
        ));
    }
}

/// Tight over a post by 15 N and more, and free again when the hands go back.
#[test]
fn what_is_pressed_hard_comes_free() {
    let outcome = run(r#"
[solver]
linear_damping = 0.5
angular_damping = 0.5
[friction]
default = 0.2
[[thread]]
name = "t"
diameter = "0.3 mm"
young_modulus = "2.2 GPa"
density = "1140 kg/m^3"
elements = 200
line = { from = "[-60, 0, 4.17] mm", to = "[60, 0, 4.17] mm" }
[[shape]]
name = "post"
kind = "cylinder"
radius = "4 mm"
length = "60 mm"
orientation = { axis = [1, 0, 0], angle = "90 deg" }
[[grip]]
name = "a"
at = "start"
hold = "pin"
[[grip]]
name = "b"
at = "end"
hold = "pin"
[[phase]]
name = "down"
action = [
  { move = "a", path = "linear", keys = [{ to = "[-45, 0, -25] mm", duration = "0.4 s" }, { to = "[-5, 0, -53.5] mm", duration = "0.5 s" }, { by = "[0, 0, -4.5] mm", duration = "0.1 s" }] },
  { move = "b", path = "linear", keys = [{ to = "[45, 0, -25] mm", duration = "0.4 s" }, { to = "[5, 0, -53.5] mm", duration = "0.5 s" }, { by = "[0, 0, -4.5] mm", duration = "0.1 s" }] },
]
[[phase]]
name = "back"
action = [
  { move = "a", path = "linear", speed = "10 cm/s", keys = [{ by = "[0, 0, 25] mm" }] },
  { move = "b", path = "linear", speed = "10 cm/s", keys = [{ by = "[0, 0, 25] mm" }] },
]
[[phase]]
duration = "0.2 s"
[[check]]
name = "tight"
that = "force(a)"
after = "down"
at_least = "8 N"
[[check]]
name = "slack"
that = "force(a)"
at_most = "0.01 N"
"#);
    let r = &outcome.report;
    assert!(r.incidents.is_empty() && r.passed && r.passes_through != Some(true), "{:?} {:?}", r.incidents, r.checks);
}

/// A thread falls in a slot between two walls of one mesh onto the lower one, and in a closed box, whose triangles face
/// in, onto its floor.
#[test]
fn walls_of_one_mesh_are_kept_apart() {
    let thread = r#"
[[thread]]
name = "w"
radius = "0.15 mm"
young_modulus = "20 MPa"
density = "1150 kg/m^3"
elements = 16
line = { from = "[-4, 0, 0.3] mm", to = "[4, 0, 0.3] mm" }
"#;
    let slot = r#"
vertices = [[-0.01,-0.01,-0.001],[0.01,-0.01,-0.001],[0.01,0.01,-0.001],[-0.01,0.01,-0.001],[-0.01,-0.01,0.001],[0.01,-0.01,0.001],[0.01,0.01,0.001],[-0.01,0.01,0.001]]
triangles = [[0,1,2],[0,2,3],[4,6,5],[4,7,6]]
"#;
    let container = r#"
vertices = [[-0.01,-0.01,-0.001],[0.01,-0.01,-0.001],[0.01,0.01,-0.001],[-0.01,0.01,-0.001],[-0.01,-0.01,0.001],[0.01,-0.01,0.001],[0.01,0.01,0.001],[-0.01,0.01,0.001]]
triangles = [[0,1,2],[0,2,3],[4,6,5],[4,7,6],[0,5,1],[0,4,5],[1,6,2],[1,5,6],[2,7,3],[2,6,7],[3,4,0],[3,7,4]]
"#;
    for mesh in [slot, container] {
        holds(&format!(
            r#"
{thread}
[[shape]]
name = "walls"
kind = "mesh"
{mesh}
[[phase]]
duration = "0.4 s"
[[check]]
name = "rests on the lower wall"
that = "position(w.middle).z"
equals = "-0.85 mm"
tolerance = "0.03 mm"
"#
        ));
    }
}

/// 50 mN over the edge of a box, drawn and let out: no incident, and at the grip what friction allows. A thread that
/// bends over an edge at one place pulls 1.326 times as much for mu = 0.2 (theory 11.3), a belt 1.369; it may stick
/// below that.
#[test]
fn an_edge_is_drawn_over() {
    holds(
        r#"
[solver]
linear_damping = 0.9
[friction]
default = 0.2
[[thread]]
name = "t"
radius = "0.15 mm"
young_modulus = "100 MPa"
density = "1150 kg/m^3"
elements = 150
path = [{ from = "[-30, 0, 0.4] mm" }, { line_to = "[0.4, 0, 0.4] mm" }, { line_to = "[0.4, 0, -20] mm" }]
[[shape]]
name = "box"
kind = "box"
sides = ["100 mm", "20 mm", "20 mm"]
position = "[-50, 0, -10] mm"
[[grip]]
name = "a"
at = "start"
hold = "jaw"
[[load]]
name = "m"
at = "end"
mass = "5 g"
[[phase]]
name = "rest"
duration = "0.3 s"
[[phase]]
name = "draw"
action = [{ move = "a", path = "linear", keys = [{ by = "[-3, 0, 0] mm", duration = "0.5 s" }] }]
[[phase]]
name = "let out"
action = [{ move = "a", path = "linear", keys = [{ by = "[3, 0, 0] mm", duration = "0.5 s" }] }]
[[probe]]
name = "f"
what = "-force(a).x"
unit = "mN"
[[check]]
name = "drawn"
that = "-force(a).x"
after = "draw"
between = ["51 mN", "72 mN"]
[[check]]
name = "let out"
that = "-force(a).x"
after = "let out"
between = ["34 mN", "48 mN"]
"#,
    );
}

/// Two threads crossed between a table and a plate lie as deep in each other as Hertz says, wherever the joints are:
/// with an even number of elements the places that cross are at a joint, with an odd one in the middle of an element.
/// For 5 N the depth is 11.6 % of the diameter, from 2 % before touch on.
#[test]
fn a_crossing_is_as_deep_wherever_the_joints_are() {
    for (a, b, aside) in [(40, 40, 0.0), (40, 41, 0.0), (41, 41, 0.0), (40, 40, 0.05), (40, 40, 0.2)] {
        let thread = |name: &str, elements: u32, from: String, to: String| {
            format!(
                r#"
[[thread]]
name = "{name}"
diameter = "0.32 mm"
young_modulus = "2.2 GPa"
density = "1140 kg/m^3"
elements = {elements}
line = {{ from = "{from} mm", to = "{to} mm" }}
[[grip]]
name = "g{name}"
thread = "{name}"
at = "start"
hold = "clamp"
"#
            )
        };
        let lower = thread("a", a, "[-10, 0, 0.165]".into(), "[10, 0, 0.165]".into());
        let upper = thread("b", b, format!("[{aside}, -10, 0.49]"), format!("[{aside}, 10, 0.49]"));
        holds(&format!(
            r#"
[solver]
linear_damping = 0.9
angular_damping = 0.9
[friction]
default = 0.2
{lower}{upper}
[[shape]]
name = "table"
kind = "box"
sides = ["1 mm", "1 mm", "1 mm"]
position = "[0, 0, -0.5] mm"
[[shape]]
name = "plate"
kind = "box"
sides = ["1 mm", "1 mm", "1 mm"]
position = "[0, 0, 1.16] mm"
[[phase]]
name = "press"
duration = "0.5 s"
action = [{{ push = "plate", direction = [0, 0, -1], force = "5 N", speed_limit = "0.1 m/s" }}]
[[check]]
name = "depth"
that = "thread_clearance()"
after = "press"
equals = -0.0962
tolerance = "2 %"
"#
        ));
    }
}
