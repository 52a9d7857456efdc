//! Bad scenes give errors that name file, line and key; no text at all makes the loader panic.

use proptest::prelude::*;
use sutura_scene::{Runner, Scene, SceneError, samples};

const GOOD: &str = r#"
[[thread]]
name = "silk"
size = "3-0"
material = "silk"
elements = 20
line = { from = [0, 0, 0], to = "[100, 0, 0] mm" }

[[shape]]
name = "post"
kind = "cylinder"
radius = "5 mm"
length = "20 mm"
position = "[0, 0, 50] mm"

[[phase]]
name = "pull"
until = "tension(left) >= 2 N"
max_duration = "1 s"
action = [
  { take = "left", at = "start" },
  { move = "left", keys = [{ by = "[10, 0, 0] mm", duration = "0.5 s" }] },
]

[[probe]]
name = "force"
what = "force(left)"
unit = "mN"

[[check]]
name = "near"
that = "distance(silk.end, post)"
equals = "10 mm"
tolerance = "1 %"
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
fn the_good_scene_is_good() {
    let scene = Scene::parse(GOOD, "good.toml").unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(scene.name(), "good");
    assert_eq!(scene.duration(), Some(1.0));
    Runner::new(scene).unwrap_or_else(|e| panic!("{e}"));
}

/// Each slip: what is replaced by what, and the line, key, words and help of the problem.
#[test]
fn slips_are_named_with_line_key_and_suggestion() {
    for (from, to, line, key, words, help) in [
        ("elements = 20", "elemnts = 20", 6, "thread[0].elemnts", "unknown key", "`elements`"),
        ("elements = 20", "elements = -3", 6, "thread[0].elements", "whole number", ""),
        ("elements = 20", "elements = 20.5", 6, "thread[0].elements", "whole number", ""),
        ("\"3-0\"", "\"3-00\"", 4, "thread[0].size", "3-00", "`3-0`"),
        ("material = \"silk\"", "material = \"silc\"", 5, "thread[0].material", "silc", "`silk`"),
        ("radius = \"5 mm\"", "radius = \"5 mN\"", 12, "shape[0].radius", "a force, wanted a length", ""),
        ("radius = \"5 mm\"", "radius = \"5 mmm\"", 12, "shape[0].radius", "not a unit", "`mm`"),
        ("radius = \"5 mm\"", "radius = \"5\"", 12, "shape[0].radius", "no unit", "5 m"),
        ("radius = \"5 mm\"", "radius = nan", 12, "shape[0].radius", "finite", ""),
        ("radius = \"5 mm\"", "radius = 0", 12, "shape[0].radius", "> 0", ""),
        ("\"cylinder\"", "\"cilinder\"", 11, "shape[0].kind", "cilinder", "\"cylinder\""),
        ("tension(left) >= 2 N", "tension(lefft) >= 2 N", 18, "phase[0].until", "`lefft`", "`left`"),
        (
            "tension(left) >= 2 N",
            "tension(left) >= 2 mm",
            18,
            "phase[0].until",
            "a force cannot be compared with a length",
            "",
        ),
        ("tension(left) >= 2 N", "tension(left)", 18, "phase[0].until", "condition", ""),
        ("{ move = \"left\"", "{ move = \"lft\"", 22, "phase[0].action[1].move", "`lft`", "`left`"),
        ("at = \"start\"", "at = \"strat\"", 21, "phase[0].action[0].at", "strat", "\"start\""),
        ("at = \"start\"", "at = \"200 mm\"", 21, "phase[0].action[0].at", "0.1", ""),
        ("at = \"start\"", "at = \"particle 21\"", 21, "phase[0].action[0].at", "particles 0 to 20", ""),
        ("at = \"start\"", "at = \"start\", thread = \"silc\"", 21, "phase[0].action[0].thread", "`silc`", "`silk`"),
        ("{ take = \"left\", at = \"start\" }", "{ }", 21, "phase[0].action[0]", "does nothing", "take"),
        (
            "{ take = \"left\", at = \"start\" }",
            "{ material = \"silk\" }",
            21,
            "phase[0].action[0]",
            "what of the material",
            "young_modulus",
        ),
        (
            "{ take = \"left\", at = \"start\" }",
            "{ material = \"silc\", density = 1 }",
            21,
            "phase[0].action[0].material",
            "`silc`",
            "`silk`",
        ),
        (
            "{ take = \"left\", at = \"start\" }",
            "{ material = \"silk\", density = \"1 mm\" }",
            21,
            "phase[0].action[0].density",
            "a length, wanted a density",
            "",
        ),
        (
            "{ take = \"left\", at = \"start\" }",
            "{ material = \"silk\", plasticity = \"nune\" }",
            21,
            "phase[0].action[0].plasticity",
            "nune",
            "\"none\"",
        ),
        (
            "duration = \"0.5 s\"",
            "duration = \"0.5 mm\"",
            22,
            "phase[0].action[1].keys[0].duration",
            "a length, wanted a time",
            "",
        ),
        (", duration = \"0.5 s\"", "", 22, "phase[0].action[1].keys[0]", "when is missing", ""),
        ("what = \"force(left)\"", "what = \"frce(left)\"", 27, "probe[0].what", "`frce`", "`force`"),
        ("unit = \"mN\"", "unit = \"mm\"", 28, "probe[0].unit", "does not fit", ""),
        ("equals = \"10 mm\"", "equals = \"10 N\"", 33, "check[0].equals", "a force, wanted a length", ""),
        ("tolerance = \"1 %\"", "", 30, "check[0]", "`tolerance` is missing", ""),
        ("[0, 0, 50] mm", "[0, 50] mm", 14, "shape[0].position", "three", ""),
        ("name = \"post\"", "name = \"silk\"", 10, "shape[0].name", "taken", ""),
        ("name = \"post\"", "name = \"the post\"", 10, "shape[0].name", "letters", ""),
        ("[[probe]]", "[[prob]]", 25, "prob", "unknown key", "`probe`"),
        ("elements = 20", "elements = 20\npoisson_ratio = 0.7", 7, "thread[0].poisson_ratio", "0.7", ""),
        ("elements = 20", "elements = 20\nsection = \"rund\"", 7, "thread[0].section", "rund", "\"round\""),
        (
            "elements = 20",
            "elements = 20\nsection = { ellipse = \"[1, 0] mm\" }",
            7,
            "thread[0].section.ellipse",
            "two lengths > 0",
            "",
        ),
        (
            "elements = 20",
            "elements = 20\nsection = { rectangle = [\"1 mm\", \"1 mN\"] }",
            7,
            "thread[0].section.rectangle[1]",
            "a force",
            "",
        ),
        (
            "elements = 20",
            "elements = 20\nsection = { elipse = [1, 1] }",
            7,
            "thread[0].section.elipse",
            "unknown key",
            "`ellipse`",
        ),
        (
            "elements = 20",
            "elements = 20\nradius = [[0, 1e-4], [0, 2e-4]]",
            7,
            "thread[0].radius[1][0]",
            "must grow",
            "",
        ),
        ("elements = 20", "elements = 20\nradius = [[0, 1e-4], [0.1, 0]]", 7, "thread[0].radius[1][1]", "> 0", ""),
        (
            "elements = 20",
            "elements = 20\ndensity = [[0, \"1 mm\"]]",
            7,
            "thread[0].density[0][1]",
            "a length, wanted",
            "",
        ),
        ("elements = 20", "elements = 20\nyoung_modulus = []", 7, "thread[0].young_modulus", "at least one pair", ""),
        (
            "elements = 20",
            "radius = [[0, 1e-4]]\nsection_scale = [[0, 1]]\nelements = 20",
            7,
            "thread[0].section_scale",
            "exclude",
            "",
        ),
        (
            "elements = 20",
            "radius = [[0, 1e-4]]\nsection = { ellipse = [1e-4, 2e-4] }\nelements = 20",
            6,
            "thread[0].radius",
            "one radius",
            "`section_scale`",
        ),
        (
            "elements = 20",
            "elements = 20\npretwist = \"1 mm\"",
            7,
            "thread[0].pretwist",
            "a length, wanted an angle",
            "",
        ),
        ("\"[100, 0, 0] mm\"", "\"[0, 0, 0] mm\"", 7, "thread[0].line", "no length", ""),
        ("elements = 20", "elements = 50001", 6, "thread[0].elements", "50000", ""),
        ("max_duration = \"1 s\"", "max_duration = \"1e9 s\"", 16, "phase[0]", "frames, at most", ""),
        (
            "[[thread]]",
            "solver = { substep = 1e-12 }\n[[thread]]",
            2,
            "solver.substep",
            "substeps in a frame, at most",
            "",
        ),
        ("name = \"pull\"", "name = \"pull", 17, "", "", ""),
    ] {
        assert!(GOOD.contains(from), "{from}");
        let e = error(&GOOD.replacen(from, to, 1));
        let found = e.problems.iter().any(|p| {
            let message = format!("{} {}", p.message, p.help.clone().unwrap_or_default());
            p.line == Some(line)
                && p.key == key
                && message.contains(words)
                && message.contains(help)
                && p.file == "bad.toml"
        });
        assert!(found, "{to}: wanted line {line}, `{key}`, \"{words}\", \"{help}\"; found\n{e}");
    }
}

#[test]
fn several_problems_are_reported_at_once_in_the_order_of_the_file() {
    let text =
        GOOD.replace("elements = 20", "elements = 0").replace("\"5 mm\"", "\"5 N\"").replace("(left) >=", "(right) >=");
    let lines: Vec<_> = error(&text).problems.iter().filter_map(|p| p.line).collect();
    assert!(lines.contains(&6) && lines.contains(&12) && lines.contains(&18), "{lines:?}");
    assert!(lines.is_sorted(), "{lines:?}");
}

#[test]
fn what_only_the_engine_knows_is_named_with_the_line_too() {
    let twice = GOOD
        .replace("line = { from = [0, 0, 0], to = \"[100, 0, 0] mm\" }", "points = [[0, 0, 0], [0, 0, 0], [1, 0, 0]]")
        .replace("elements = 20\n", "");
    let e = error(&twice);
    assert_eq!(e.problems[0].line, Some(2));
    assert!(e.to_string().contains("centerline[0..1]"), "{e}");
}

/// Each thread is small enough, all together are not.
#[test]
fn elements_are_counted_over_all_threads() {
    let second = "[[thread]]\nname = \"other\"\nsize = \"3-0\"\nmaterial = \"silk\"\nelements = 49981\nline = { from = [0, 1, 0], to = [1, 1, 0] }\n[[shape]]";
    let e = error(&GOOD.replacen("[[shape]]", second, 1));
    assert!(e.problems.iter().any(|p| p.key == "thread[1].elements" && p.message.contains("50001")), "{e}");
}

#[test]
fn grips_must_be_taken_before_they_are_used() {
    let again = GOOD
        .replace("{ take = \"left\", at = \"start\" },", "{ take = \"left\", at = \"start\" }, { let_go = \"left\" },");
    let e = error(&again);
    assert!(e.to_string().contains("does not hold anything then") && e.problems[0].line == Some(22), "{e}");
}

#[test]
fn missing_files_are_named() {
    let e =
        error(&GOOD.replace(
            "line = { from = [0, 0, 0], to = \"[100, 0, 0] mm\" }",
            "points = { file = \"no_such_file.csv\" }",
        ));
    assert!(e.to_string().contains("no_such_file.csv") && e.problems[0].line == Some(7), "{e}");
    let e = error(&format!("start = \"no_such_state\"\n{GOOD}"));
    assert!(e.to_string().contains("no_such_state") && e.problems[0].line == Some(1), "{e}");
    assert!(Scene::load(std::path::Path::new("no_such_scene.toml")).is_err());
}

#[test]
fn an_empty_scene_says_what_is_missing() {
    let e = error("");
    assert!(e.to_string().contains("[[thread]]") && e.to_string().contains("[[phase]]"), "{e}");
}

/// Pieces that a slip of the pen or a malicious text might put in place of a value.
const ODD: &[&str] = &[
    "nan",
    "inf",
    "-1",
    "0",
    "1e300",
    "-0.0",
    "\"\"",
    "\"mm\"",
    "\"1e400 mm\"",
    "\"[1,2\"",
    "[]",
    "[[]]",
    "{}",
    "true",
    "1979-05-27",
    "\"start\"",
    "[1, 2, 3]",
    "99999999999999999999",
    "\"1 %\"",
    "\"-5 mm\"",
    "\"🧵\"",
    "\"silk.end\"",
    "\"((((\"",
    "\"1/0\"",
    "'''\n'''",
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// One value of a sample is replaced by something odd.
    #[test]
    fn odd_values_never_panic(sample in 0..samples().len(), line in 0usize..200, odd in 0..ODD.len()) {
        let text = samples()[sample].text;
        let lines: Vec<&str> = text.lines().collect();
        let at = line % lines.len();
        let changed: Vec<String> = lines.iter().enumerate().map(|(i, l)| match l.split_once('=') {
            Some((key, _)) if i == at => format!("{key}= {}", ODD[odd]),
            _ => (*l).to_owned(),
        }).collect();
        if let Ok(scene) = Scene::parse(&changed.join("\n"), "odd.toml")
            && scene.duration().is_some_and(|d| d < 100.0)
            && let Ok(mut runner) = Runner::new(scene)
        {
            // The first frames must not panic either.
            for _ in 0..2 {
                runner.step_frame();
            }
            let outcome = runner.finish();
            prop_assert!(serde_json::to_string(&outcome.report).is_ok());
        }
    }

    /// Bytes of a sample are cut, doubled, swapped or replaced.
    #[test]
    fn mangled_texts_never_panic(sample in 0..samples().len(), edits in prop::collection::vec((any::<prop::sample::Index>(), 0u8..4, any::<char>()), 1..8)) {
        let mut text: Vec<char> = samples()[sample].text.chars().collect();
        for (index, kind, c) in edits {
            if text.is_empty() {
                break;
            }
            let i = index.index(text.len());
            match kind {
                0 => { text.remove(i); }
                1 => text.insert(i, c),
                2 => text[i] = c,
                _ => text.truncate(i.max(1)),
            }
        }
        let text: String = text.into_iter().collect();
        let _ = Scene::parse(&text, "mangled.toml");
    }
}

/// Each series is a file of its name.
#[test]
fn two_series_of_one_name_are_an_error() {
    let scene = |profiles: &str| {
        format!(
            "[[thread]]\nname = \"a\"\ndiameter = \"0.2 mm\"\nyoung_modulus = \"1 GPa\"\ndensity = \"1 g/cc\"\nelements = 4\nline = {{ from = [0, 0, 0], to = \"[9, 0, 0] mm\" }}\n\
             [[phase]]\nduration = \"0.1 s\"\n[[probe]]\nname = \"pull\"\nwhat = \"tension(a)\"\n{profiles}"
        )
    };
    let profile = |name: &str| format!("[[profile]]\nname = \"{name}\"\nwhat = \"tension\"\n");
    assert!(Scene::parse(&scene(&(profile("along") + &profile("later"))), "s.toml").is_ok());
    for taken in [profile("pull"), profile("frame"), profile("along") + &profile("along")] {
        let error = Scene::parse(&scene(&taken), "s.toml").unwrap_err().to_string();
        assert!(error.contains("is taken"), "{error}");
    }
}
