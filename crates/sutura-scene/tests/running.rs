//! Running scenes: phases, motions, loads, probes, checks, saved states, recordings.

use sutura_scene::{CheckValue, Outcome, Runner, Scene, Trajectory};

fn run(text: &str) -> Outcome {
    let scene = Scene::parse(text, "test.toml").unwrap_or_else(|e| panic!("{e}"));
    let mut runner = Runner::new(scene).unwrap_or_else(|e| panic!("{e}"));
    let mut last = -1.0;
    loop {
        let p = runner.step_frame();
        assert!(p.fraction >= last && p.fraction <= 1.0, "progress never goes back");
        last = p.fraction;
        if p.finished {
            break;
        }
    }
    assert_eq!(last, 1.0);
    runner.finish()
}

/// A short monofilament that hangs from its start.
const HANGING: &str = r#"
frame_rate = 100
[solver]
gravity = [0, 0, 0]
linear_damping = 0.99
[[thread]]
name = "rod"
diameter = "0.3 mm"
young_modulus = "2 GPa"
density = "1150 kg/m^3"
elements = 10
line = { from = [0, 0, 0], to = "[0, 0, -50] mm" }
[[grip]]
name = "wall"
at = "start"
hold = "clamp"
"#;

#[test]
fn phases_end_by_time_condition_motion_and_running_out() {
    let out = run(&format!(
        r#"{HANGING}
[[phase]]
name = "time"
duration = "50 ms"
[[phase]]
name = "condition"
until = "time() >= 0.1 s"
[[phase]]
name = "motion"
action = [{{ move = "wall", keys = [{{ by = "[0, 0, 1] mm", duration = "30 ms" }}] }}]
[[phase]]
name = "late"
until = "tension(rod) >= 5 N"
max_duration = "20 ms"
out_of_time = "accept"
[[check]]
that = "phase_time()"
after = "condition"
equals = "50 ms"
tolerance = "1 us"
[[check]]
that = "position(wall).z"
equals = "1 mm"
tolerance = "1 nm"
"#
    ));
    let phases: Vec<_> =
        out.report.phases.iter().map(|p| (p.ended_by.as_str(), (p.end_s * 1e3).round() as i64)).collect();
    assert_eq!(phases, [("duration", 50), ("condition", 100), ("motions done", 130), ("out of time", 150)]);
    assert!(out.report.passed, "{:?}", out.report.checks);
    assert_eq!(out.report.frames, 15);
    // Frame times are exact multiples; the world's own clock sums substeps.
    assert!((out.report.simulated_s - 0.15).abs() < 1e-12);
}

/// A thread that nothing holds falls g h^2 n (n + 1) / 2 in n substeps h of implicit Euler: 9.8 mm in four of a
/// hundredth of a second, 14.7 mm in five; 54 mm in the ten of a frame.
const FALLING: &str = r#"
frame_rate = 10
[solver]
substep = "10 ms"
gravity = [0, 0, -9.81]
[[thread]]
name = "rod"
diameter = "0.3 mm"
young_modulus = "2 GPa"
density = "1150 kg/m^3"
elements = 10
line = { from = [0, 0, 0], to = "[50, 0, 0] mm" }
[[probe]]
name = "height"
what = "position(rod.start).z"
[[probe]]
name = "fallen"
what = "-height"
unit = "mm"
[[phase]]
name = "fall"
until = "fallen >= 10 mm"
[[check]]
that = "fallen"
after = "fall"
equals = "14.7 mm"
tolerance = "0.1 mm"
[[check]]
name = "the end of the phase is of the phase"
that = "fallen"
during = "fall"
take = "last"
equals = "14.7 mm"
tolerance = "0.1 mm"
"#;

#[test]
fn a_condition_ends_a_phase_at_the_substep_where_it_comes_true() {
    let text = format!(
        r#"{FALLING}
[[phase]]
name = "lift"
action = [{{ take = "hand", at = "start", hold = "pin" }}, {{ move = "hand", keys = [{{ by = "[0, 0, 5] mm", duration = "0.1 s" }}] }}]
duration = "0.1 s"
[[phase]]
name = "again"
until = "phase_time() >= 20 ms"
min_duration = "35 ms"
[[check]]
name = "what follows begins there"
that = "position(hand).z"
after = "lift"
equals = "-9.7 mm"
tolerance = "0.1 mm"
"#
    );
    let mut runner = Runner::recording(Scene::parse(&text, "test.toml").unwrap_or_else(|e| panic!("{e}")))
        .unwrap_or_else(|e| panic!("{e}"));
    while !runner.step_frame().finished {}
    let out = runner.finish();
    assert!(out.report.passed, "{:#?}", out.report.checks);
    let ms = |s: f64| (s * 1e4).round() / 10.0;
    let phases: Vec<_> = out.report.phases.iter().map(|p| (ms(p.start_s), ms(p.end_s), p.ended_by.as_str())).collect();
    // A duration that begins within a frame goes on to the end of one, so that motions come to their ends.
    assert_eq!(phases, [(0.0, 50.0, "condition"), (50.0, 200.0, "duration"), (200.0, 240.0, "condition")]);
    // Frames stay regular; a run that ends within one has a shorter last one.
    let times: Vec<f64> = out.trajectory.frames.iter().map(|f| ms(f.time)).collect();
    assert_eq!((times, out.report.frames), (vec![0.0, 100.0, 200.0, 240.0], 3));
    assert_eq!(out.series[0].column("time").unwrap().iter().map(|t| ms(*t)).collect::<Vec<_>>(), [100.0, 200.0, 240.0]);
    assert!((out.report.simulated_s - 0.24).abs() < 1e-12 && out.report.work.substeps == 24);
    // It is recorded as it was done.
    let mut same = 0;
    let replayed = out.input.unwrap().replay(&mut |r| {
        same += u32::from(r.is_same());
        std::ops::ControlFlow::Continue(())
    });
    assert_eq!((format!("{:016x}", replayed.unwrap().state_hash()), same), (out.report.state_hash, 24));
}

#[test]
fn a_phase_without_a_condition_steps_whole_frames() {
    let text = FALLING.replace("until = \"fallen >= 10 mm\"", "duration = \"0.1 s\"");
    let mut runner = Runner::recording(Scene::parse(&text, "test.toml").unwrap()).unwrap();
    while !runner.step_frame().finished {}
    let steps =
        runner.finish().input.unwrap().inputs.into_iter().filter(|i| matches!(i, sutura::input::Input::Step(..)));
    assert_eq!(steps.count(), 1);
}

#[test]
fn a_run_that_is_stopped_has_not_passed() {
    let text = format!("{HANGING}\n[[phase]]\nduration = \"1 s\"\n");
    let mut runner = Runner::new(Scene::parse(&text, "test.toml").unwrap()).unwrap();
    runner.step_frame();
    let report = runner.finish().report;
    assert_eq!((report.finished, report.passed, report.phases[0].ended_by.as_str()), (false, false, "stopped"));
}

#[test]
fn running_out_of_time_fails_the_run_unless_accepted() {
    for (late, passed, phases) in [("fail", false, 2), ("stop", false, 1), ("accept", true, 2)] {
        let out = run(&format!(
            "{HANGING}\n[[phase]]\nuntil = \"tension(rod) > 1 N\"\nmax_duration = \"20 ms\"\nout_of_time = \"{late}\"\n[[phase]]\nduration = \"10 ms\"\n"
        ));
        assert_eq!((out.report.passed, out.report.phases.len()), (passed, phases), "{late}");
    }
}

#[test]
fn loads_ramp_and_are_carried_by_the_grip() {
    let out = run(&format!(
        r#"{HANGING}
[[phase]]
name = "load"
action = [{{ load = "weight", at = "end", force = "[0, 0, -10] mN", ramp = "0.2 s" }}]
[[phase]]
name = "settle"
duration = "0.3 s"
[[phase]]
name = "free"
duration = "0.3 s"
action = [{{ unload = "weight" }}]
[[probe]]
name = "pull"
what = "force(wall).z"
unit = "mN"
[[profile]]
name = "along"
what = ["position", "tension"]
after = "settle"
[[check]]
name = "half way up the ramp it is half"
that = "pull"
at = "0.1 s"
equals = "5 mN"
tolerance = "2 %"
[[check]]
name = "carried"
that = "tension(rod.middle)"
after = "settle"
equals = "10 mN"
tolerance = "0.1 %"
[[check]]
name = "gone"
that = "norm(force(wall))"
at_most = "1 uN"
[[check]]
name = "most"
that = "pull"
when = "always"
take = "max"
equals = "10 mN"
tolerance = "1 %"
"#
    ));
    assert!(out.report.passed, "{:#?}", out.report.checks);
    let probe = out.series.iter().find(|s| s.name == "pull").unwrap();
    assert_eq!(probe.columns, [("time".into(), "s".into()), ("pull".into(), "mN".to_owned())]);
    assert_eq!(probe.rows.len(), 81, "the first state and 80 frames");
    let along = out.series.iter().find(|s| s.name == "along").unwrap();
    assert_eq!((along.rows.len(), along.columns.len()), (10, 5));
    assert!(along.column("tension").unwrap().iter().all(|t| (t - 0.01).abs() < 1e-5));
    assert!(along.to_csv().starts_with("arc [m],x [m],y [m],z [m],tension [N]\n0.00"));
}

/// E A of the thread is 141.37 N: 1 N stretches it by 0.70736 %, and at a quarter of the modulus by four times as much.
#[test]
fn a_phase_changes_what_a_thread_is_made_of() {
    let out = run(&format!(
        r#"{HANGING}
[[load]]
name = "weight"
at = "end"
force = "[0, 0, -1] N"
[[phase]]
name = "stiff"
duration = "0.5 s"
[[phase]]
name = "soft"
duration = "0.5 s"
action = [{{ material = "rod", young_modulus = "0.5 GPa", shear_modulus = "0.2 GPa", density = "1200 kg/m^3", bend_scale = 0.5, bend_damping = "1 ms", plasticity = {{ yield_curvature = "200 1/m" }} }}]
[[phase]]
name = "long"
duration = "0.5 s"
action = [{{ material = "rod", stretch = "inextensible", plasticity = "none" }}]
[[check]]
that = "elongation(rod)"
after = "stiff"
equals = 0.0070736
tolerance = "0.1 %"
[[check]]
that = "elongation(rod)"
after = "soft"
equals = 0.0282942
tolerance = "0.1 %"
[[check]]
that = "elongation(rod)"
at_most = 0.00001
[[check]]
that = "tension(rod.middle)"
equals = "1 N"
tolerance = "0.1 %"
"#
    ));
    assert!(out.report.passed, "{:?}", out.report.checks);
}

#[test]
fn what_an_action_does_not_name_of_a_material_stays() {
    let text = format!(
        r#"{HANGING}
[[phase]]
duration = "50 ms"
action = [{{ material = "rod", density = "1200 kg/m^3" }}, {{ material = "rod", poisson_ratio = 0.2, plasticity = {{ yield_curvature = 200, hardening = 0.1 }} }}]
"#
    );
    let mut runner = Runner::new(Scene::parse(&text, "test.toml").unwrap()).unwrap();
    runner.step_frame();
    let rod = runner.world().view().rods().next().unwrap();
    let m = rod.material();
    assert_eq!((m.young_modulus, m.density, m.shear), (2e9, 1200.0, sutura::Shear::Poisson(0.2)));
    let p = m.plasticity.unwrap();
    assert_eq!((p.yield_curvature, p.yield_twist, p.hardening), (200.0, 200.0, 0.1));
    assert_eq!((m.bend_scale, m.bend_damping), (1.0, 0.0));
}

#[test]
fn a_check_that_fails_says_what_it_found() {
    let out = run(&format!(
        "{HANGING}\n[[phase]]\nduration = \"20 ms\"\n[[check]]\nname = \"wrong\"\nthat = \"position(rod.end).z\"\nequals = \"-40 mm\"\ntolerance = \"1 mm\"\n[[check]]\nname = \"never\"\nthat = \"time()\"\nat = \"5 s\"\nat_least = \"1 s\"\n"
    ));
    let [wrong, never] = out.report.checks.as_slice() else { panic!() };
    assert!(!wrong.passed && wrong.unit == "mm" && wrong.wanted == "-40 mm ± 1 mm");
    assert!(matches!(wrong.value, Some(CheckValue::Number(v)) if (v + 50.0).abs() < 1e-3), "{wrong:?}");
    assert!(!never.passed && never.value.is_none());
    assert!(!out.report.passed);
}

#[test]
fn the_report_and_the_recording_read_back() {
    let out = run(&format!("{HANGING}\n[[phase]]\nduration = \"30 ms\"\n"));
    let json = serde_json::to_string_pretty(&out.report).unwrap();
    for key in [
        "scene",
        "solver",
        "simulated_s",
        "cpu_s",
        "real_time_factor",
        "ms_per_frame",
        "max_tension_N",
        "min_clearance",
        "passes_through",
        "state_hash",
    ] {
        assert!(json.contains(&format!("\"{key}\"")), "{key}");
    }
    assert_eq!(serde_json::from_str::<sutura_scene::Report>(&json).unwrap(), out.report);
    let path = tempfile::tempdir().unwrap().keep().join("test.trajectory");
    out.trajectory.write_to(&path).unwrap();
    assert_eq!(Trajectory::read_from(&path).unwrap(), out.trajectory);
    assert_eq!(out.trajectory.frames.len(), 4, "the first state and three frames");
    assert_eq!(out.trajectory.frames[0].positions[0].len(), 11);
    std::fs::remove_dir_all(path.parent().unwrap()).unwrap();
}

#[test]
fn two_runs_give_the_same_state() {
    let text = format!(
        "{HANGING}\n[[phase]]\nduration = \"0.2 s\"\naction = [{{ move = \"wall\", keys = [{{ by = \"[3, 0, 0] mm\", duration = \"0.1 s\" }}] }}]\n"
    );
    assert_eq!(run(&text).report.state_hash, run(&text).report.state_hash);
}

#[test]
fn a_saved_state_goes_on_as_if_it_had_not_stopped() {
    let folder = tempfile::tempdir().unwrap();
    // A grip that came and went shifts the handles: these must come out the same.
    let first = "[[phase]]\nduration = \"50 ms\"\naction = [{ take = \"hand\", at = \"end\", hold = \"pin\" }, { take = \"spare\", at = \"middle\", hold = \"pin\" }]\n[[phase]]\nname = \"moved\"\nduration = \"0.1 s\"\nsave = \"moved.state\"\naction = [{ let_go = \"spare\" }, { move = \"hand\", keys = [{ by = \"[5, 0, 0] mm\", duration = \"80 ms\" }] }]\n";
    // Letting go sets everything moving; driven motion would differ by the rounding of times.
    let second = "[[phase]]\nduration = \"0.1 s\"\naction = [{ let_go = \"hand\" }]\n";
    let whole = run(&format!("{HANGING}\n{first}\n{second}"));
    assert_eq!(whole.saved[0].name, "moved.state");
    std::fs::write(folder.path().join("moved.state"), &whole.saved[0].bytes).unwrap();
    let threads_only = HANGING.split("[[grip]]").next().unwrap();
    let text = format!(
        "start = \"moved.state\"\n{threads_only}\n{second}\n[[check]]\nthat = \"held(wall) and not held(hand) and not held(spare)\"\n"
    );
    let path = folder.path().join("second.toml");
    std::fs::write(&path, text).unwrap();
    let scene = Scene::load(&path).unwrap_or_else(|e| panic!("{e}"));
    let mut runner = Runner::new(scene).unwrap_or_else(|e| panic!("{e}"));
    while !runner.step_frame().finished {}
    let part = runner.finish();
    assert!(part.report.passed, "{:?}", part.report.checks);
    assert_eq!(part.report.state_hash, whole.report.state_hash);
}

#[test]
fn shapes_are_moved_and_probed() {
    let out = run(&format!(
        r#"{HANGING}
[[shape]]
name = "ball"
kind = "sphere"
radius = "5 mm"
position = "[30, 0, 0] mm"
[[phase]]
action = [{{ move = "ball", path = "spline", keys = [{{ to = "[40, 0, 0] mm", time = "50 ms" }}, {{ to = "[40, 20, 0] mm", time = "0.1 s" }}] }}]
[[check]]
that = "norm(position(ball) - [40, 20, 0] mm)"
at_most = "1 nm"
[[check]]
that = "done(ball)"
[[check]]
name = "from its surface to the thread's"
that = "gap(rod, ball)"
at = "0 s"
equals = "24.85 mm"
tolerance = "1 um"
"#
    ));
    assert!(out.report.passed, "{:#?}", out.report.checks);
}

/// Two clamped tapes side by side, one on its edge, and a tapered thread: closed forms of
/// `crates/sutura/tests/sections.rs` through a scene.
#[test]
fn sections_and_tables_along_the_thread_reach_the_engine() {
    let out = run(r#"
frame_rate = 10
[solver]
gravity = [0, 0, 0]
[[thread]]
name = "flat"
section = { rectangle = ["1 mm", "0.5 mm"] }
d1 = [0, 1, 0]
young_modulus = "2 GPa"
density = "1150 kg/m^3"
elements = 40
line = { from = [0, 0, 0], to = "[50, 0, 0] mm" }
[[thread]]
name = "edge"
section = { rectangle = ["1 mm", "0.5 mm"] }
roll = "90 deg"
d1 = [0, 1, 0]
young_modulus = "2 GPa"
density = "1150 kg/m^3"
elements = 40
line = { from = "[0, 10, 0] mm", to = "[50, 10, 0] mm" }
[[thread]]
name = "cone"
diameter = [["0 mm", "1 mm"], ["50 mm", "0.5 mm"]]
young_modulus = "2 GPa"
density = "1150 kg/m^3"
elements = 40
line = { from = "[0, 20, 0] mm", to = "[50, 20, 0] mm" }
[[grip]]
name = "a"
thread = "flat"
at = "start"
hold = "clamp"
[[grip]]
name = "b"
thread = "edge"
at = "start"
hold = "clamp"
[[grip]]
name = "c"
thread = "cone"
at = "start"
hold = "clamp"
[[load]]
name = "on_flat"
thread = "flat"
at = "end"
force = "[0, 0, 10] uN"
[[load]]
name = "on_edge"
thread = "edge"
at = "end"
force = "[0, 0, 10] uN"
[[load]]
name = "on_cone"
thread = "cone"
at = "end"
force = "[0, 0, 10] uN"
[[phase]]
duration = "3 s"
[[check]]
that = "position(flat.end).z"
equals = "20 um"
tolerance = "1 %"
[[check]]
that = "position(edge.end).z"
equals = "5 um"
tolerance = "1 %"
[[check]]
that = "position(cone.end).z"
equals = "8.488 um"
tolerance = "1 %"
"#);
    let report = out.report;
    assert!(report.passed, "{:?}", report.checks);
    let radii: Vec<f64> = report.threads.iter().map(|t| t.radius_m).collect();
    assert_eq!(radii, [0.5e-3; 3]);
}

/// 12 N on a thread whose size must bear 9.41 N with a knot: one warning, and nothing fails.
#[test]
fn a_tension_past_the_knot_pull_strength_is_warned_of_once() {
    let scene = |strength: &str| {
        format!(
            r#"
frame_rate = 100
[solver]
gravity = [0, 0, 0]
linear_damping = 0.999
[[thread]]
name = "silk"
size = "3-0"
material = "silk"
elements = 10
line = {{ from = [0, 0, 0], to = "[0, 0, -50] mm" }}
{strength}
[[grip]]
name = "wall"
at = "start"
hold = "pin"
[[load]]
name = "pull"
at = "end"
force = "[0, 0, -12] N"
[[phase]]
name = "pulled"
duration = "0.5 s"
[[check]]
that = "tension(silk)"
between = ["11.9 N", "12.1 N"]
"#
        )
    };
    let report = run(&scene("")).report;
    assert!(report.passed && report.incidents.is_empty());
    let [warning] = &report.warnings[..] else { panic!("{:?}", report.warnings) };
    assert_eq!((warning.thread.as_str(), warning.strength_n), ("silk", 9.41));
    assert!(warning.tension_n > 9.41 && warning.time_s < 0.5 && (0.0..0.05).contains(&warning.arc_m), "{warning:?}");
    assert!(warning.message.contains("USP size 3-0") && warning.message.contains("unverified"), "{}", warning.message);
    assert_eq!(run(&scene("knot_pull_strength = \"13 N\"")).report.warnings, []);
    let given = run(&scene("knot_pull_strength = \"5 N\"")).report.warnings;
    assert_eq!((given.len(), given[0].strength_n), (1, 5.0));
}

/// A knot has a form only where there is one; the words are checked when the scene is read.
#[test]
fn form_and_tension_of_the_loop_can_be_asked_for() {
    let check = |that: &str, equals: &str| {
        format!("{HANGING}\n[[phase]]\nduration = \"20 ms\"\n[[check]]\nthat = \"{that}\"\n{equals}\n")
    };
    assert!(run(&check("form(rod)", "equals = \"none\"")).report.passed);
    assert!(!run(&check("form(rod)", "equals = \"flat\"")).report.passed);
    assert!(!run(&check("loop_tension(rod)", "at_least = \"0 N\"")).report.passed, "what is not there is no number");
    assert!(!run(&check("turning_share(rod)", "at_least = 0")).report.passed);
    let wrong = |that: &str, word: &str| {
        Scene::parse(&check(that, &format!("equals = \"{word}\"")), "test.toml").unwrap_err().to_string()
    };
    assert!(wrong("form(rod)", "square").contains("no form of a knot is called `square`"));
    assert!(wrong("form(rod)", "capsised").contains("`capsized`"));
    assert!(wrong("knot(rod)", "flat").contains("no knot is called `flat`"));
}

/// What falls with a drag of 100 1/s comes to 98.1 mm/s in a few hundredths of a second; a phase may take the drag away
/// again.
#[test]
fn drag_is_a_rate_of_any_size() {
    let out = run(r#"
[solver]
linear_drag = "100 1/s"
angular_drag = 3
[[thread]]
name = "rod"
diameter = "0.3 mm"
young_modulus = "2 GPa"
density = "1150 kg/m^3"
elements = 5
line = { from = [0, 0, 0], to = "[50, 0, 0] mm" }
[[phase]]
name = "drag"
duration = "0.5 s"
[[phase]]
action = [{ solver = { linear_drag = 0 } }]
duration = "0.1 s"
[[check]]
name = "with drag"
that = "speed(rod)"
after = "drag"
at_least = "98.09 mm/s"
at_most = "98.11 mm/s"
[[check]]
name = "without"
that = "speed(rod)"
at_least = "1079 mm/s"
at_most = "1080 mm/s"
"#);
    assert!(out.report.passed, "{:?}", out.report.checks);
}
