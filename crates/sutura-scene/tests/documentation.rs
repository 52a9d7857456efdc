//! `docs/formats.md` keeps up with the code.

use sutura_scene::{Runner, Scene};

fn text() -> String {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/formats.md");
    std::fs::read_to_string(path).unwrap()
}

/// Every whole scene can be read and does what it says: its conditions come true, its checks hold. (A second of rest is
/// cut to a tenth.)
#[test]
fn every_whole_scene_in_the_documentation_runs() {
    let text = text();
    let blocks: Vec<&str> = text.split("```toml\n").skip(1).filter_map(|b| b.split("```").next()).collect();
    assert!(!blocks.is_empty());
    for block in blocks {
        let scene = Scene::parse(&block.replace("duration = \"1 s\"", "duration = \"0.1 s\""), "formats.md")
            .unwrap_or_else(|e| panic!("{e}"));
        let mut runner = Runner::new(scene).unwrap_or_else(|e| panic!("{e}"));
        while !runner.step_frame().finished {}
        let report = runner.finish().report;
        let ends: Vec<&str> = report.phases.iter().map(|p| p.ended_by.as_str()).collect();
        assert!(report.passed, "phases ended by {ends:?}, checks {:?}", report.checks);
    }
}

#[test]
fn every_key_of_the_report_is_documented() {
    let (text, json) = (text(), serde_json::to_value(sutura_scene::Report::default()).unwrap());
    for key in json.as_object().unwrap().keys() {
        assert!(text.contains(&format!("`{key}`")), "{key}");
    }
}

/// The loader asks for its keys by literal names; each must stand in the documentation.
#[test]
fn every_key_of_the_loader_is_documented() {
    let text = text();
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let sources =
        ["load.rs", "load/bodies.rs", "load/joints.rs", "load/things.rs", "load/happening.rs", "load/watching.rs"]
            .map(|f| std::fs::read_to_string(folder.join(f)).unwrap());
    let mut count = 0;
    for source in &sources {
        for call in [
            "get(\"",
            "need(\"",
            "text(\"",
            "tables(\"",
            "vector(\"",
            "quantity(\"",
            "need_quantity(\"",
            "need_vector(\"",
            "truth_or(\"",
            "quantity_or(\"",
            ", \"",
        ] {
            for rest in source.split(call).skip(1) {
                let Some((key, after)) = rest.split_once('"') else { continue };
                // `, "` also begins other texts; keys are followed by a dimension, a default or the end of the call.
                let is_key = call != ", \"" || after.starts_with(", Dim::");
                if is_key
                    && key.chars().all(|c| c.is_ascii_lowercase() || c == '_' || c.is_ascii_digit())
                    && !key.is_empty()
                {
                    count += 1;
                    let found = [
                        format!("`{key}"),
                        format!("[{key}"),
                        format!("{key} ="),
                        format!(", {key}"),
                        format!("{{ {key}"),
                        format!("{key} }}"),
                    ]
                    .iter()
                    .any(|f| text.contains(f));
                    assert!(found, "`{key}` is read but not documented");
                }
            }
        }
    }
    assert!(count > 100, "the search finds the keys: {count}");
}
