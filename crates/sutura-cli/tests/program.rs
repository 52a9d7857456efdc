//! The program as a user meets it: what it prints, what it writes, and with which code it ends.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Runs the program in a folder.
fn sutura(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_sutura")).args(args).current_dir(folder).output().expect("the program starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("the program prints UTF-8")
}

fn polyline(name: &str) -> String {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../sutura/tests/polylines").join(format!("{name}.csv"));
    path.to_str().expect("a path of text").to_string()
}

/// A pinned thread that swings for a tenth of a second over a post; `LIMIT` is to be replaced by what its tip may fall.
const SWING: &str = r#"
title = "Swing"

[[thread]]
name = "thread"
diameter = "0.2 mm"
young_modulus = "1 GPa"
poisson_ratio = 0.4
density = "1150 kg/m^3"
elements = 20
line = { from = [0, 0, 0], to = "[30, 0, 0] mm" }

[[grip]]
name = "nail"
at = "start"
hold = "pin"

[[phase]]
name = "fall"
duration = "0.1 s"

[[probe]]
name = "tip"
what = "position(thread.end)"
unit = "mm"

[[check]]
name = "falls"
that = "-position(thread.end).z"
at_least = "LIMIT"
"#;

fn write_swing(folder: &Path, limit: &str) {
    std::fs::write(folder.join("swing.toml"), SWING.replace("LIMIT", limit))
        .expect("a temporary folder can be written");
}

fn is_png(path: &Path, width: u32, height: u32) -> bool {
    let bytes = std::fs::read(path).unwrap_or_default();
    let number = |at: usize| bytes.get(at..at + 4).map(|b| u32::from_be_bytes([b[0], b[1], b[2], b[3]]));
    bytes.starts_with(b"\x89PNG\r\n\x1a\n") && number(16) == Some(width) && number(20) == Some(height)
}

#[test]
fn help_teaches() {
    let folder = tempfile::tempdir().unwrap();
    let out = sutura(folder.path(), &["--help"]);
    assert_eq!(out.status.code(), Some(0));
    let help = text(&out.stdout);
    for word in ["run", "scenes", "knot", "knot-strength", "presets", "bench", "export", "Examples:", "Exit codes"] {
        assert!(help.contains(word), "`{word}` is in the help");
    }
    for command in ["run", "scenes", "knot", "knot-strength", "presets", "bench", "export"] {
        let out = sutura(folder.path(), &[command, "--help"]);
        assert_eq!(out.status.code(), Some(0), "{command}");
        assert!(text(&out.stdout).contains("Examples:"), "{command} --help has examples");
    }
}

#[test]
fn bad_input_ends_with_two_and_says_why() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("bad.toml"), SWING.replace("elements", "elemnts")).unwrap();
    std::fs::write(folder.path().join("bad.csv"), "x,y,z\n0,0,0\n1,0,0\n1,fish,0\n").unwrap();
    // Line 10 of the scene is the misspelled key; line 4 of the table is the one with the fish.
    let cases: [(&[&str], &[&str]); 17] = [
        (&["run", "bad.toml"], &["bad.toml:10", "elemnts", "elements"]),
        (&["run", "nowhere/none.toml"], &["nowhere/none.toml"]),
        (&["run", "capstn"], &["capstn", "capstan"]),
        (&["run", "bad.toml", "--picture-size", "7"], &["1200x900"]),
        (&["knot", "bad.csv"], &["bad.csv:4", "fish"]),
        (&["knot", "none.csv"], &["none.csv"]),
        (&["knot", "bad.csv", "--expect", "sqare"], &["sqare", "square"]),
        (&["knot-strength", "--throws", "reef"], &["reef", "square", "2=1=1"]),
        (&["knot-strength", "--size", "11-0"], &["11-0", "--strength"]),
        (&["knot-strength", "--pretension", "2 mm"], &["2 mm", "force"]),
        (&["knot-strength", "--diameter", "0.3mm"], &["--strength"]),
        (&["scenes", "show", "capstn"], &["capstan"]),
        (&["export", "capstn", "--out", "x.glb"], &["capstn", "capstan"]),
        (&["export", "capstan"], &["--format glb", "--out capstan.glb"]),
        (&["export", "capstan", "--out", "x.glb", "--sides", "2"], &["--sides", "3..=256"]),
        (&["export", "capstan", "--out", "bad.toml/x.glb"], &["cannot write bad.toml"]),
        (&["export", "capstan", "--out", "x.glb", "--from", "2", "--to", "1"], &["from 2 s to 1 s"]),
    ];
    for (args, words) in cases {
        let out = sutura(folder.path(), args);
        let error = text(&out.stderr);
        assert_eq!(out.status.code(), Some(2), "{args:?}: {error}");
        for word in words {
            assert!(error.contains(word), "{args:?} names `{word}`: {error}");
        }
        assert!(!error.contains("panicked"), "{args:?}: {error}");
    }
    assert!(!folder.path().join("out").exists(), "a scene that cannot be read leaves nothing behind");
}

#[test]
fn a_run_writes_everything_and_what_it_writes_reads_back() {
    let folder = tempfile::tempdir().unwrap();
    write_swing(folder.path(), "5 mm");
    let out = sutura(folder.path(), &["run", "swing.toml", "--picture-size", "96x72", "--still", "0.05"]);
    assert_eq!(out.status.code(), Some(0), "{}{}", text(&out.stdout), text(&out.stderr));
    let printed = text(&out.stdout);
    for word in ["Swing", "real-time factor", "falls", "All 1 checks passed", "tip.z"] {
        assert!(printed.contains(word), "`{word}` is printed: {printed}");
    }
    let results = folder.path().join("out/swing");
    let report: serde_json::Value =
        serde_json::from_slice(&std::fs::read(results.join("report.json")).unwrap()).unwrap();
    let keys = [
        "scene",
        "solver",
        "simulated_s",
        "cpu_s",
        "real_time_factor",
        "ms_per_frame",
        "threads",
        "min_clearance",
        "passes_through",
    ];
    for key in keys.iter().chain(&["probes", "checks", "incidents", "state_hash"]) {
        assert!(report.get(key).is_some(), "report.json has `{key}`");
    }
    // Frames are a sixtieth of a second, so the run ends within one of its tenth of a second.
    assert!((report["simulated_s"].as_f64().unwrap() - 0.1).abs() < 1.0 / 60.0);
    assert_eq!(report["checks"][0]["passed"], true);
    for file in [
        "series/frame.csv",
        "series/tip.csv",
        "plots/tension.svg",
        "plots/elongation.svg",
        "plots/energy.svg",
        "plots/ms_per_frame.svg",
    ] {
        let content = std::fs::read_to_string(results.join(file)).unwrap_or_default();
        assert!(content.len() > 100, "{file} is there and not empty");
    }
    for plot in ["tension", "elongation", "energy", "ms_per_frame", "probe-tip"] {
        assert!(
            is_png(&results.join(format!("plots/{plot}.png")), 1720, 880),
            "{plot}.png is a picture of the size drawn"
        );
    }
    assert!(is_png(&results.join("stills/000.0500s.png"), 96, 72), "the still asked for is there");
    let trajectory = sutura_scene::Trajectory::read_from(&results.join("trajectory.sutura")).unwrap();
    assert_eq!((trajectory.header.threads.len(), trajectory.header.threads[0].elements), (1, 20));

    // A straight thread that swings is no knot, from the recording as well.
    let out = sutura(folder.path(), &["knot", "out/swing/trajectory.sutura", "--expect", "unknot", "--frame", "-1"]);
    assert_eq!(out.status.code(), Some(0), "{}", text(&out.stdout));

    // What an earlier run left must not pass for results of a later one.
    let out = sutura(folder.path(), &["run", "swing.toml", "--no-plots", "--no-stills", "--quiet"]);
    assert_eq!((out.status.code(), text(&out.stdout)), (Some(0), String::new()));
    assert!(!results.join("plots/tension.png").exists() && !results.join("stills/000.0500s.png").exists());
}

#[test]
fn a_check_that_fails_ends_with_one() {
    let folder = tempfile::tempdir().unwrap();
    // In a tenth of a second nothing falls farther than g t^2 / 2 = 49 mm, and the thread is 30 mm long.
    write_swing(folder.path(), "50 mm");
    let out = sutura(folder.path(), &["run", "swing.toml", "--dry"]);
    assert_eq!(out.status.code(), Some(1), "{}", text(&out.stderr));
    assert!(text(&out.stdout).contains("FAILED: 1 of 1 checks"));
    assert!(!folder.path().join("out").exists(), "--dry writes nothing");
}

/// The two ways of one square knot, from the engine's tests.
#[test]
fn a_spilled_knot_is_told_from_a_flat_one_where_the_diameter_is_known() {
    let folder = tempfile::tempdir().unwrap();
    for (file, verdict, straight) in [("tied_square", "flat", None), ("spilled_square", "capsized", Some("start"))] {
        let path = polyline(file);
        let out = sutura(folder.path(), &["knot", &path, "--diameter", "0.225", "--json", "--expect", "square"]);
        let answer: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
        assert_eq!(out.status.code(), Some(0));
        assert_eq!(
            (answer["form"]["verdict"].as_str(), answer["form"]["straight"].as_str()),
            (Some(verdict), straight)
        );
        assert!(text(&sutura(folder.path(), &["knot", &path, "--diameter", "0.225"]).stdout).contains(verdict));
        let unknown: serde_json::Value =
            serde_json::from_slice(&sutura(folder.path(), &["knot", &path, "--json"]).stdout).unwrap();
        assert!(unknown["form"].is_null(), "without a diameter nothing touches");
    }
}

/// Cases are listed; a case over its budget is in the table as such, with files and plots beside it.
#[test]
fn the_strength_of_knots_is_tabled() {
    let folder = tempfile::tempdir().unwrap();
    let listed = sutura(
        folder.path(),
        &["knot-strength", "--throws", "square,2x1", "--mu", "0.1,0.3", "--pretension", "1N,2N", "--list"],
    );
    let lines = text(&listed.stdout);
    assert_eq!((listed.status.code(), lines.lines().count()), (Some(0), 8), "{lines}");
    assert!(lines.contains("2x1, drawn with 2 N, mu 0.3"), "{lines}");
    assert!(!folder.path().join("out").exists(), "--list writes nothing");

    let out = sutura(
        folder.path(),
        &["knot-strength", "--plastic", "--throws", "granny", "--mu", "0.2,0.3", "--budget", "0.000001"],
    );
    assert_eq!(out.status.code(), Some(0), "{}", text(&out.stderr));
    assert!(text(&out.stdout).contains("not finished"), "{}", text(&out.stdout));
    let made = folder.path().join("out/knot-strength");
    let read = |name: &str| std::fs::read_to_string(made.join(name)).unwrap();
    let table = read("knot_strength.csv");
    assert_eq!(table.lines().count(), 3, "{table}");
    assert!(
        table.lines().skip(1).all(|l| l.starts_with("granny,1,0.") && l.contains("over 0.000001 s of CPU time")),
        "{table}"
    );
    let report = read("knot_strength.md");
    assert!(
        report.contains("| granny | 1 | not finished | not finished |") && report.contains("knot-pull strength 9.41 N"),
        "{report}"
    );
    assert_eq!(read("knot_strength_pulls.csv").lines().count(), 1, "nothing was pulled");
}

#[test]
fn knots_of_the_reference_polylines() {
    let folder = tempfile::tempdir().unwrap();
    // Determinant and signature from the tables of knots: connected sums multiply the one and add the other.
    let cases = [
        ("throw_+1_unknot", "unknot", 1, 0),
        ("trefoil_R", "trefoil-right", 3, -2),
        ("trefoil_L", "trefoil-left", 3, 2),
        ("figure8", "figure-eight", 5, 0),
        ("square_+3-3", "square", 9, 0),
        ("granny_+3+3", "granny-right", 9, -4),
        ("surgeon_square_+5-3", "surgeon-square-right", 15, -2),
    ];
    for (file, name, determinant, signature) in cases {
        for join in [&["--closed"][..], &["--ends", "free"]] {
            let path = polyline(file);
            let args = [&["knot", path.as_str(), "--json", "--expect", name], join].concat();
            let out = sutura(folder.path(), &args);
            let answer: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
            assert_eq!((answer["knot"].as_str(), out.status.code()), (Some(name), Some(0)), "{file} {join:?}");
            assert_eq!(
                (answer["determinant"].as_u64(), answer["signature"].as_i64()),
                (Some(determinant), Some(signature)),
                "{file} {join:?}"
            );
        }
    }
    let out = sutura(folder.path(), &["knot", &polyline("granny_+3+3"), "--expect", "square"]);
    assert_eq!(out.status.code(), Some(1), "a granny is not a square knot");
    assert!(text(&out.stdout).contains("determinant 9"));
}

/// A curve on a torus that goes round so often along it and across it, forty points each time; closed.
fn torus_knot(along: u32, across: u32) -> String {
    let n = 40 * across.max(along);
    let point = |k: u32| {
        let t = f64::from(k) / f64::from(n) * std::f64::consts::TAU;
        let (a, b) = (t * f64::from(along), t * f64::from(across));
        format!("{},{},{}\n", (2.0 + b.cos()) * a.cos(), (2.0 + b.cos()) * a.sin(), b.sin())
    };
    (0..n).map(point).collect()
}

#[test]
fn a_knot_without_a_name_is_told_from_one_that_is_not_certain() {
    let folder = tempfile::tempdir().unwrap();
    let knot = |args: &[&str]| {
        let out = sutura(folder.path(), &[&["knot", "points.csv"], args].concat());
        (out.status.code(), text(&out.stdout))
    };
    // The torus knot of 13 crossings: no knot of the tables has as many. Its determinant is 13, its signature 12.
    std::fs::write(folder.path().join("points.csv"), torus_knot(2, 13)).unwrap();
    let (code, words) = knot(&["--closed"]);
    assert!(
        code == Some(3)
            && words.starts_with("certain, but no knot that has a name here (unnamed)")
            && words.contains("determinant 13"),
        "{words}"
    );
    let (code, json) = knot(&["--closed", "--json"]);
    let answer: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(
        (code, answer["knot"].as_str(), answer["certain"].as_bool(), answer["determinant"].as_u64()),
        (Some(3), Some("unnamed"), Some(true), Some(13))
    );
    assert_eq!(answer["signature"].as_i64().map(i64::abs), Some(12));
    assert_eq!(
        (knot(&["--closed", "--expect", "unnamed"]).0, knot(&["--closed", "--expect", "unknown"]).0),
        (Some(0), Some(1))
    );
    // A trefoil cut where its end lies in a loop: some closures are knots and some are not.
    let trefoil = torus_knot(2, 3);
    let cut: Vec<&str> = trefoil.lines().collect();
    std::fs::write(folder.path().join("points.csv"), cut[..cut.len() * 84 / 100].join("\n")).unwrap();
    let unsure: Vec<String> = (0..10).map(|s| s.to_string()).filter(|s| knot(&["--seed", s]).0 == Some(4)).collect();
    let seed = unsure.first().expect("for most seeds the closures disagree");
    let (_, words) = knot(&["--seed", seed]);
    assert!(words.starts_with("not certain (unknown)") && words.contains("Disagreement"), "{words}");
    let answer: serde_json::Value = serde_json::from_str(&knot(&["--seed", seed, "--json"]).1).unwrap();
    assert_eq!((answer["knot"].as_str(), answer["certain"].as_bool()), (Some("unknown"), Some(false)));
    assert_eq!(
        (knot(&["--seed", seed, "--expect", "unknown"]).0, knot(&["--seed", seed, "--expect", "unnamed"]).0),
        (Some(0), Some(1))
    );
}

/// What is recognized is under the same keys in the report and in what `sutura knot` prints.
#[test]
fn a_knot_has_one_key_everywhere() {
    let folder = tempfile::tempdir().unwrap();
    write_swing(folder.path(), "5 mm");
    let settings = ["--set", "thread.thread.knot=true", "--set", "phase.fall.knot=true"];
    let out = sutura(
        folder.path(),
        &[&["run", "swing.toml", "--quiet", "--no-plots", "--no-stills"], &settings[..]].concat(),
    );
    assert_eq!(out.status.code(), Some(0), "{}", text(&out.stderr));
    let report: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("out/swing/report.json")).unwrap()).unwrap();
    let printed = sutura(folder.path(), &["knot", "out/swing/trajectory.sutura", "--json"]);
    let printed: serde_json::Value = serde_json::from_slice(&printed.stdout).unwrap();
    for found in [&report["threads"][0]["knot"], &report["phases"][0]["knots"][0][1], &printed] {
        assert_eq!((found["knot"].as_str(), found["certain"].as_bool()), (Some("unknot"), Some(true)), "{found}");
        assert_eq!((found["determinant"].as_u64(), found["signature"].as_i64()), (Some(1), Some(0)), "{found}");
        assert!(found.get("name").is_none() && found.get("form").is_some(), "{found}");
    }
    assert_eq!((&report["finished"], &report["passed"]), (&true.into(), &true.into()));
}

#[test]
fn an_interrupted_run_leaves_no_report_and_keeps_others_out_only_while_it_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    write_swing(folder.path(), "5 mm");
    let files = ["--quiet", "--no-plots", "--no-stills", "--out", "results"];
    let run = |more: &[&str]| sutura(folder.path(), &[&["run", "swing.toml"], &files[..], more].concat());
    assert_eq!(run(&[]).status.code(), Some(0));
    let report = folder.path().join("results/report.json");
    std::fs::write(folder.path().join("results/swing.glb"), "an export").unwrap();
    assert!(report.is_file());

    let mut command = Command::new(env!("CARGO_BIN_EXE_sutura"));
    let mut long = command
        .args(["run", "swing.toml", "--set", "phase.fall.duration=100000 s"])
        .args(files)
        .current_dir(folder.path())
        .spawn()
        .unwrap();
    let begun = std::time::Instant::now();
    while report.exists() && begun.elapsed().as_secs() < 60 {
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    assert!(!report.exists(), "what passed before does not pass for this run");
    let second = run(&[]);
    assert_eq!(second.status.code(), Some(2));
    assert!(text(&second.stderr).contains("another run is writing into results"), "{}", text(&second.stderr));
    assert!(long.try_wait().unwrap().is_none(), "the run goes on");
    // Harder than by Ctrl-C, which whoever starts the tests may have switched off.
    long.kill().unwrap();
    assert!(!long.wait().unwrap().success());
    assert!(!report.exists() && !folder.path().join("results/trajectory.sutura").exists());

    assert_eq!(run(&[]).status.code(), Some(0));
    assert!(report.is_file() && folder.path().join("results/swing.glb").is_file());
}

/// A limit on the size of a file stands for a full disk: some of the results can be written and some cannot.
#[test]
#[cfg(unix)]
fn a_full_disk_leaves_no_report_and_no_file_that_is_cut() {
    let folder = tempfile::tempdir().unwrap();
    write_swing(folder.path(), "5 mm");
    let run = ["run", "swing.toml", "--picture-size", "96x72", "--no-trajectory", "--out", "results"];
    assert_eq!(sutura(folder.path(), &run).status.code(), Some(0));
    let limited = format!("trap '' XFSZ; ulimit -f 8; exec '{}' {}", env!("CARGO_BIN_EXE_sutura"), run.join(" "));
    let out = Command::new("sh").args(["-c", &limited]).current_dir(folder.path()).output().unwrap();
    let error = text(&out.stderr);
    assert!(
        out.status.code() == Some(2) && error.contains("no report") && error.contains("cannot write results"),
        "{error}"
    );
    let results = folder.path().join("results");
    assert!(!results.join("report.json").exists() && results.join("series/frame.csv").is_file());
    for file in ["plots", "series", "stills"].iter().filter_map(|f| std::fs::read_dir(results.join(f)).ok()).flatten() {
        let path = file.unwrap().path();
        let bytes = std::fs::read(&path).unwrap();
        let whole = match path.extension().and_then(|e| e.to_str()) {
            Some("svg") => bytes.trim_ascii_end().ends_with(b"</svg>"),
            Some("png") => bytes.ends_with(b"IEND\xaeB`\x82"),
            Some("csv") => bytes.ends_with(b"\n"),
            _ => false,
        };
        assert!(whole, "{}", path.display());
    }
    assert_eq!(sutura(folder.path(), &run).status.code(), Some(0));
    assert!(results.join("report.json").is_file());
}

#[test]
fn a_folder_with_files_of_somebody_else_is_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    write_swing(folder.path(), "5 mm");
    std::fs::write(folder.path().join("report.json"), "{ \"mine\": true }").unwrap();
    let out = sutura(folder.path(), &["run", "swing.toml", "--quiet", "--no-plots", "--no-stills", "--out", "."]);
    assert_eq!(out.status.code(), Some(2));
    assert!(text(&out.stderr).contains("report.json is not of an earlier run"), "{}", text(&out.stderr));
    assert_eq!(std::fs::read_to_string(folder.path().join("report.json")).unwrap(), "{ \"mine\": true }");
    std::fs::remove_file(folder.path().join("report.json")).unwrap();
    assert_eq!(
        sutura(folder.path(), &["run", "swing.toml", "--quiet", "--no-plots", "--no-stills", "--out", "."])
            .status
            .code(),
        Some(0)
    );
    assert!(folder.path().join("swing.toml").is_file() && folder.path().join("report.json").is_file());
}

#[test]
fn scenes_are_listed_shown_and_copied_but_not_over_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let list = text(&sutura(folder.path(), &["scenes"]).stdout);
    for sample in sutura_scene::samples() {
        assert!(list.contains(sample.name), "{} is listed", sample.name);
    }
    let sample = &sutura_scene::samples()[0];
    assert_eq!(
        text(&sutura(folder.path(), &["scenes", "show", sample.name]).stdout).trim_end(),
        sample.text.trim_end()
    );
    assert_eq!(sutura(folder.path(), &["scenes", "copy", sample.name]).status.code(), Some(0));
    let file = folder.path().join(format!("{}.toml", sample.name));
    assert_eq!(std::fs::read_to_string(&file).unwrap(), sample.text);
    std::fs::write(&file, "mine").unwrap();
    assert_eq!(sutura(folder.path(), &["scenes", "copy", sample.name]).status.code(), Some(2));
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "mine", "a file that exists is kept");
}

#[test]
fn presets_say_what_is_unverified() {
    let folder = tempfile::tempdir().unwrap();
    let out = text(&sutura(folder.path(), &["presets"]).stdout);
    assert!(out.contains("3-0") && out.contains("silk") && out.contains("* unverified") && out.contains("Sources"));
    let json: serde_json::Value =
        serde_json::from_slice(&sutura(folder.path(), &["presets", "--json"]).stdout).unwrap();
    let silk = json["materials"].as_array().unwrap().iter().find(|m| m["name"] == "silk").expect("silk is a preset");
    // Naleway 2015 measured the modulus; no one measured the bending scale.
    assert_eq!(silk["figures"]["young_modulus"]["verified"], true);
    assert_eq!(silk["figures"]["bend_scale"]["verified"], false);
}

#[test]
fn bench_measures_and_names_the_machine() {
    let folder = tempfile::tempdir().unwrap();
    let out = sutura(
        folder.path(),
        &["bench", "--free", "--elements", "10", "--frames", "5", "--shape", "straight", "--json"],
    );
    assert_eq!(out.status.code(), Some(0), "{}", text(&out.stderr));
    let json: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    assert!(json["machine"]["cores"].as_u64() >= Some(1) && json["machine"]["build"].is_string());
    assert!(json["skin"]["vertices"].as_u64() > Some(9000) && json["skin"]["ms_median"].as_f64() > Some(0.0));
    let row = &json["free_thread"][0];
    assert!(row["ms_median"].as_f64() > Some(0.0) && row["ms_p99"].as_f64() >= row["ms_median"].as_f64());
    // Inextensible means to a thousandth of a percent.
    assert!(row["max_elongation"].as_f64() < Some(1e-5));
}

#[test]
fn validation_lists_runs_and_writes() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let list = sutura(folder.path(), &["validate", "--list"]);
    assert!(list.status.success() && text(&list.stdout).contains("tip load k = 5"));
    let out = sutura(folder.path(), &["validate", "tip load k = 1", "--out", "found"]);
    assert!(out.status.success(), "{}{}", text(&out.stdout), text(&out.stderr));
    assert!(text(&out.stdout).contains("quantities are within their bars"));
    let table = std::fs::read_to_string(folder.path().join("found/validation.md")).expect("the tables are written");
    assert!(table.contains("## 1. Cantilever") && table.contains("![Cantilever") && table.contains("0.301721"));
    for file in ["elastica.svg", "results.csv", "results.json"] {
        assert!(folder.path().join("found/validation").join(file).is_file(), "{file}");
    }
    let wrong = sutura(folder.path(), &["validate", "tipp"]);
    assert_eq!(wrong.status.code(), Some(2));
    assert!(text(&wrong.stderr).contains("`tipp`") && text(&wrong.stderr).contains("--list"));
}

#[test]
fn values_of_a_scene_can_be_set() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    write_swing(folder.path(), "1 mm");
    let run = |settings: &[&str]| {
        let args: Vec<&str> =
            ["run", "swing.toml", "--dry"].into_iter().chain(settings.iter().flat_map(|s| ["--set", s])).collect();
        sutura(folder.path(), &args)
    };
    assert_eq!(run(&[]).status.code(), Some(0));
    // Without weight it does not fall.
    assert_eq!(run(&["solver.gravity=[0, 0, 0]"]).status.code(), Some(1));
    let wrong = run(&["thread.thread.elments=5"]);
    assert_eq!(wrong.status.code(), Some(2));
    assert!(
        text(&wrong.stderr).contains("thread.thread.elments = 5") && text(&wrong.stderr).contains("`elements`"),
        "{}",
        text(&wrong.stderr)
    );
}

#[test]
fn scenes_and_recordings_are_exported() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    write_swing(folder.path(), "0 m");
    let said = |args: &[&str]| {
        let output = sutura(folder.path(), args);
        assert!(output.status.success(), "{args:?}: {}", text(&output.stderr));
        text(&output.stdout)
    };
    said(&["run", "swing.toml", "--quiet", "--no-plots", "--no-stills", "--out", "swing"]);
    let recording = "swing/trajectory.sutura";
    // Six frames of a tenth of a second at 60 a second, and the start; every second one of them.
    let out = said(&["export", recording, "--out", "swing.glb"]);
    assert!(out.starts_with("4 frames") && out.contains("swing.glb"), "{out}");
    let glb = std::fs::read(folder.path().join("swing.glb")).expect("a file");
    assert!(glb.starts_with(b"glTF"));
    assert!(said(&["export", recording, "--out", "all.csv", "--fps", "60", "--to", "0.05"]).starts_with("4 frames"));
    assert!(said(&["export", recording, "--out", "last.obj", "--quiet"]).is_empty());
    // A scene that is run knows its velocities as well; a recording its forces.
    said(&["export", "swing.toml", "--format", "vtk", "--out", "live", "--set", "thread.thread.elements=10"]);
    said(&["export", recording, "--format", "vtk"]);
    let has = |file: &str, field: &str| {
        std::fs::read_to_string(folder.path().join(file)).expect("a file").contains(&format!("\"{field}\""))
    };
    assert!(has("live/threads_00003.vtp", "tension") && has("out/swing/vtk/threads_00003.vtp", "tension"));
    assert!(has("live/threads_00003.vtp", "velocity") && !has("out/swing/vtk/threads_00003.vtp", "velocity"));
    assert!(folder.path().join("live/threads.pvd").is_file() && !folder.path().join("live/shapes.pvd").exists());
    let refused = sutura(folder.path(), &["export", recording, "--out", "x.glb", "--from", "9"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(text(&refused.stderr).contains("the recording goes from 0 s to 0.1 s"), "{}", text(&refused.stderr));
}

#[test]
fn a_recorded_run_replays_to_the_same_state_after_every_step() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    write_swing(folder.path(), "0 m");
    let files = ["--no-plots", "--no-stills", "--no-trajectory"];
    let run = |out: &str, more: &[&str]| {
        let args = [&["run", "swing.toml", "--quiet", "--record", "--out", out], &files[..], more].concat();
        assert!(sutura(folder.path(), &args).status.success());
        format!("{out}/input.sutura")
    };
    let (one, same, other) =
        (run("one", &[]), run("same", &[]), run("other", &["--set", "thread.thread.density=1151 kg/m^3"]));
    let said = |args: &[&str]| {
        let output = sutura(folder.path(), &[&["replay"], args].concat());
        (output.status.code(), text(&output.stdout))
    };

    let (code, out) = said(&[&one]);
    let report = std::fs::read_to_string(folder.path().join("one/report.json")).expect("a report");
    let hash = out.trim().rsplit(' ').next().expect("the last word is the hash").to_string();
    assert!(code == Some(0) && out.contains("the same state after every step") && report.contains(&hash), "{out}");
    assert_eq!(said(&[&one, "--quiet"]), (Some(0), String::new()));

    assert_eq!(said(&[&one, "--with", &same]).0, Some(0));
    let (code, out) = said(&[&one, "--with", &other]);
    assert!(code == Some(1) && out.contains("the same for 0 steps") && out.contains("InsertRod"), "{out}");

    // The first of the steps whose recorded state is not what the input gives is told.
    let path = folder.path().join(&one);
    let mut bytes = std::fs::read(&path).expect("a recording");
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    std::fs::write(&path, &bytes).expect("a temporary folder can be written");
    let (code, out) = said(&[&one]);
    assert!(code == Some(1) && out.contains("differs after step 6 first"), "{out}");
    assert_eq!(said(&[&one, "--until", "0.05"]).0, Some(0));

    let (code, _) = said(&[&same, "--until", "0.05", "--state", "state.csv"]);
    let state = std::fs::read_to_string(folder.path().join("state.csv")).expect("a table");
    assert!(code == Some(0) && state.lines().count() > 21 * 6 && state.contains("thread 0 position,20,2,"), "{state}");
    let (code, list) = said(&[&same, "--list"]);
    assert!(
        code == Some(0) && list.lines().filter(|l| l.starts_with("Step(")).count() == 6 && list.contains("InsertGrip"),
        "{list}"
    );

    let (code, hashes) = said(&[&same, "--hashes"]);
    let recorded: Vec<&str> =
        list.lines().filter_map(|l| l.strip_suffix(')')?.split_once("s, state ")).map(|l| l.1).collect();
    assert_eq!((code, hashes.lines().collect()), (Some(0), recorded));
    assert_eq!(hashes.lines().last(), Some(hash.as_str()));

    std::fs::write(&path, &bytes[..last]).expect("a temporary folder can be written");
    assert_eq!(said(&[&one]).0, Some(2));
    assert_eq!(said(&["swing.toml"]).0, Some(2));
}

#[test]
fn without_a_viewer_it_says_how_to_get_one_and_with_one_it_passes_on_what_was_asked() {
    let folder = tempfile::tempdir().unwrap();
    // The program alone in a folder, and nothing in PATH.
    let program = folder.path().join(format!("sutura{}", std::env::consts::EXE_SUFFIX));
    std::fs::copy(env!("CARGO_BIN_EXE_sutura"), &program).unwrap();
    let run =
        |args: &[&str]| Command::new(&program).args(args).env("PATH", folder.path().join("empty")).output().unwrap();
    let out = run(&["view", "capstan"]);
    assert_eq!(out.status.code(), Some(2));
    assert!(text(&out.stderr).contains("cargo install --path bevy/sutura-view"));
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        let viewer = folder.path().join("sutura-view");
        std::fs::write(&viewer, "#!/bin/sh\necho \"$@\"\nexit 3\n").unwrap();
        std::fs::set_permissions(&viewer, std::fs::Permissions::from_mode(0o755)).unwrap();
        let out = run(&["view", "capstan", "--headless", "--at", "1"]);
        assert_eq!(text(&out.stdout), "capstan --headless --at 1\n");
        assert_eq!(out.status.code(), Some(1));
    }
}
