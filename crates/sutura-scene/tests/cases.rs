//! Cases of mechanics written as scenes alone, to show that the format is enough for them. Numbers are closed forms or
//! converged solutions of the equations; T1 is a 2-0 monofilament (0.30 mm, 2 GPa, nu 0.4, 1150 kg/m^3; E I =
//! 7.95216e-7 N m^2).

use sutura_scene::{Outcome, Runner, Scene};

const T1: &str = "diameter = \"0.30 mm\"\nyoung_modulus = \"2 GPa\"\npoisson_ratio = 0.4\ndensity = \"1150 kg/m^3\"\n";

fn run(text: &str) -> Outcome {
    let scene = Scene::parse(text, "case.toml").unwrap_or_else(|e| panic!("{e}"));
    let mut runner = Runner::new(scene).unwrap_or_else(|e| panic!("{e}"));
    while !runner.step_frame().finished {}
    runner.finish()
}

fn passes(text: &str) {
    let r = run(text).report;
    for c in &r.checks {
        println!(
            "{} {}: {} {} (wanted {})",
            c.passed,
            c.name,
            c.value.as_ref().map_or("-".into(), ToString::to_string),
            c.unit,
            c.wanted
        );
    }
    println!("{:?} {:?}", r.phases, r.incidents);
    assert!(r.passed);
}

/// Euler: a pinned strut of 50 mm carries 3.1394 mN. The pins slide along the axis under the load.
#[test]
fn a_strut_stands_at_95_percent_and_buckles_at_105() {
    for (part, checks) in [
        (0.95, "[[check]]\nname = \"straight\"\nthat = \"abs(position(strut.middle).z)\"\nat_most = \"0.02 mm\""),
        (1.05, "[[check]]\nname = \"buckled\"\nthat = \"abs(position(strut.middle).z)\"\nat_least = \"3 mm\""),
    ] {
        passes(&format!(
            r#"
[solver]
gravity = [0, 0, 0]
[[thread]]
name = "strut"
{T1}
elements = 50
line = {{ from = [0, 0, 0], to = "[50, 0, 0] mm" }}
[[grip]]
name = "foot"
at = "start"
hold = "pin"
[[grip]]
name = "head"
at = "end"
hold = "pin"
direction = [-1, 0, 0]
force = "{} mN"
speed_limit = "1 m/s"
[[load]]
name = "nudge"
at = "middle"
force = "[0, 0, 0.01] mN"
[[phase]]
duration = "0.2 s"
[[phase]]
duration = "6 s"
action = [{{ unload = "nudge" }}]
{checks}
"#,
            3.1394 * part
        ));
    }
}

/// First bending mode of a cantilever of 50 mm: 22.139 Hz. From release to the second crossing of the axis is three
/// quarters of a period.
#[test]
fn a_cantilever_rings_at_its_frequency() {
    passes(&format!(
        r#"
frame_rate = 5000
record_every = 100
[solver]
gravity = [0, 0, 0]
linear_damping = 0.999
substep = "0.2 ms"
[[thread]]
name = "rod"
{T1}
elements = 50
line = {{ from = [0, 0, 0], to = "[50, 0, 0] mm" }}
[[grip]]
name = "wall"
at = "start"
hold = "clamp"
[[load]]
name = "pull"
at = "end"
force = "[0, 0, 0.02] mN"
[[phase]]
name = "settle"
duration = "1 s"
[[phase]]
name = "down"
until = "position(rod.end).z <= 0 m"
max_duration = "0.1 s"
action = [{{ unload = "pull" }}, {{ solver = {{ linear_damping = 0 }} }}]
[[phase]]
name = "half"
until = "position(rod.end).z >= 0 m"
min_duration = "5 ms"
max_duration = "0.1 s"
[[check]]
name = "half a period"
that = "phase_time()"
after = "half"
equals = "22.58 ms"
tolerance = "2 %"      # a frame is 0.9 %; the static shape holds a few percent of higher modes
"#
    ));
}

/// A bob of 1e-9 kg m^2 on 0.1 m of T1 turns with a period of 83.368 ms; the thread begins twisted.
#[test]
fn a_torsion_pendulum_has_its_period() {
    passes(&format!(
        r#"
frame_rate = 5000
record_every = 100
[solver]
gravity = [0, 0, 0]
substep = "0.2 ms"
[[thread]]
name = "wire"
{T1}
elements = 40
line = {{ from = [0, 0, 0], to = "[0, 0, -100] mm" }}
d1 = [1, 0, 0]
twist = "30 deg"
[[grip]]
name = "ceiling"
at = "start"
hold = "clamp"
[[load]]
name = "bob"
at = "end"
mass = "1 mg"
inertia = [1e-9, 1e-9, 1e-9]
[[phase]]
name = "quarter"
until = "twist(wire) <= 0"
max_duration = "0.1 s"
[[phase]]
name = "half"
until = "twist(wire) >= 0"
min_duration = "10 ms"
max_duration = "0.1 s"
[[check]]
name = "half a period"
that = "phase_time()"
after = "half"
equals = "41.684 ms"
tolerance = "1 %"      # a frame is 0.5 %
"#
    ));
}

/// Localized helical buckling: clamped rod of 0.2 m, ends brought together by 10 mm and turned 12 times: T = 15.84 mN,
/// M = 0.21004 mN m.
#[test]
fn localized_buckling_has_its_tension_and_torque() {
    passes(&format!(
        r#"
[solver]
gravity = [0, 0, 0]
linear_damping = 0.99
angular_damping = 0.99
[[thread]]
name = "rod"
{T1}
elements = 200
line = {{ from = [-0.1, 0, 0], to = [0.1, 0, 0] }}
[[grip]]
name = "left"
at = "start"
hold = "clamp"
[[grip]]
name = "right"
at = "end"
hold = "clamp"
# First together, then turned: the bow in one plane winds up into the localized helix.
[[load]]
name = "nudge"
at = "middle"
force = "[0, 0, 0.5] mN"
[[phase]]
name = "together"
action = [{{ move = "right", keys = [{{ by = "[-10, 0, 0] mm", duration = "1 s" }}] }}]
[[phase]]
name = "turn"
action = [{{ unload = "nudge" }}, {{ move = "right", keys = [{{ turn = {{ axis = [1, 0, 0], angle = "12 turns" }}, duration = "6 s" }}] }}]
[[phase]]
name = "settle"
duration = "4 s"
[[check]]
name = "tension"
that = "force(right).x"
equals = "15.8416 mN"
tolerance = "3 %"
[[check]]
name = "torque"
that = "torque(right).x"
equals = "0.210038 mN m"
tolerance = "3 %"
[[check]]
name = "turns put in are kept by twist and writhe"
that = "twist(rod) + writhe(rod)"
equals = 11.94         # from the first element's middle to the last one's: 12 (1 - 1/200)
tolerance = 0.005
"#
    ));
}

/// Free fall: N substeps give g h^2 N (N + 1) / 2, at 1/600 s for 0.5 s 1.230338 m; damping multiplies the speed by (1
/// - d)^t.
#[test]
fn a_thread_falls_and_is_slowed_by_the_identities_of_the_integrator() {
    passes(&format!(
        r#"
frame_rate = 600
record_every = 100
[solver]
substeps = 1
[[thread]]
name = "rod"
{T1}
elements = 10
line = {{ from = [0, 0, 0], to = "[50, 0, 0] mm" }}
[[phase]]
name = "fall"
duration = "0.5 s"
[[phase]]
name = "coast"
duration = "1 s"
action = [{{ gravity = [0, 0, 0] }}, {{ solver = {{ linear_damping = 0.5 }} }}]
[[check]]
name = "fallen"
that = "-position(rod.middle).z"
after = "fall"
equals = "1.2303375 m"
tolerance = "1 nm"
[[check]]
name = "speed reached"
that = "speed(rod.middle)"
after = "fall"
equals = "4.905 m/s"
tolerance = "1 nm/s"
[[check]]
name = "half of it a second later"
that = "speed(rod.middle)"
equals = "2.4525 m/s"
tolerance = "1 nm/s"
"#
    ));
}

/// A helical spring of five turns (R 5 mm, pitch angle 10 degrees) pulled along its axis by 0.2 mN lengthens by 1.38683
/// mm when its end may turn. The pull acts on the axis: at the end of the thread that is a force and a torque.
#[test]
fn a_helical_spring_has_its_stiffness() {
    let (radius, turns) = (5.0_f64, 5.0_f64);
    let pitch = std::f64::consts::TAU * radius * 10.0_f64.to_radians().tan();
    passes(&format!(
        r#"
[solver]
gravity = [0, 0, 0]
linear_damping = 0.99
[[thread]]
name = "spring"
{T1}
elements = 300
helix = {{ center = [0, 0, 0], axis = [0, 0, 1], start = "[{radius}, 0, 0] mm", turns = {turns}, pitch = "{pitch} mm" }}
rest = "as_inserted"
[[grip]]
name = "wall"
at = "start"
hold = "clamp"
[[phase]]
action = [{{ load = "pull", at = "end", force = "[0, 0, 0.2] mN", torque = "[0, 1e-3, 0] mN m", ramp = "1 s" }}]
[[phase]]
duration = "4 s"
[[check]]
name = "lengthening"
that = "position(spring.end).z"
equals = "{} mm"
tolerance = "0.014 mm"     # 1 % of the lengthening
"#,
        pitch * turns + 1.38683
    ));
}

/// The paper's solver by its keys: figure 8's thread keeps its length, and the report says whose answer it is.
#[test]
fn a_scene_for_the_papers_solver() {
    let scene = |method: &str| {
        format!(
            r#"
[solver]
gravity = [0, 0, -0.1]     # else it stays straight and is pressed together
substeps = 1
angular_damping = 0.2
method = "{method}"
paper = {{ iterations = 10, stretch_shear = 1, bend = [0.05, 0.1], twist = 0.25, ddc = true, friction = 1, frame_inertia = 64, order = "two_color" }}
[[thread]]
name = "silk"
{T1}
elements = 40
line = {{ from = [0, 0, 0], to = "[150, 0, 0] mm" }}
[[grip]]
name = "left"
at = "start"
hold = "jaw"
[[grip]]
name = "right"
at = "end"
hold = "jaw"
[[phase]]
action = [{{ move = "right", relative_to = "taken", keys = [{{ to = "[-50, 0, 0] mm", duration = "1 s" }}] }}]
[[check]]
name = "length"
that = "length(silk)"
equals = "150 mm"
tolerance = "0.5 mm"
"#
        )
    };
    let report = run(&scene("paper")).report;
    println!("{:?} {:?}", report.checks, report.incidents);
    assert!(report.passed && report.incidents.is_empty());
    assert_eq!((report.solver.name.as_str(), report.work.substeps), ("paper", report.frames));
    let refused = Scene::parse(&scene("direct"), "case.toml").unwrap_err().to_string();
    assert!(refused.contains("method = \"paper\""), "{refused}");
}
