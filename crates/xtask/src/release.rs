//! Whether a commit is ready to be released. Changes nothing.

use crate::tally::{Tally, cargo, root};
use std::process::Command;

/// All conditions.
pub fn ready(tally: &mut Tally) {
    tally.count("nothing uncommitted", clean());
    let version = env!("CARGO_PKG_VERSION");
    tally.count(
        &format!("CHANGELOG.md has {version} and nothing unreleased"),
        changelog(&read("CHANGELOG.md"), version),
    );
    for file in ["LICENSE-MIT", "LICENSE-APACHE", "NOTICE", "docs/images/square_knot.png"] {
        let there = root().join(file).is_file();
        tally.count(&format!("there is {file}"), if there { Ok(()) } else { Err("it is missing") });
    }
    let measured = if measured(&read("README.md")) { Ok(()) } else { Err("the table `Measured` has empty rows") };
    tally.count("README.md says what was measured", measured);
    tally
        .run("packages", &mut cargo(&["package", "--workspace", "--exclude", "xtask", "--no-verify", "--allow-dirty"]));
}

fn read(file: &str) -> String {
    std::fs::read_to_string(root().join(file)).unwrap_or_default()
}

fn clean() -> Result<(), String> {
    let out = Command::new("git")
        .args(["status", "--porcelain"])
        .current_dir(root())
        .output()
        .map_err(|e| format!("git: {e}"))?;
    let changed = String::from_utf8_lossy(&out.stdout);
    if out.status.success() && changed.is_empty() { Ok(()) } else { Err(format!("git status:\n{changed}")) }
}

/// A heading with the version and a date, and an empty section of what is unreleased.
fn changelog(text: &str, version: &str) -> Result<(), String> {
    let dated =
        |l: &str| l.strip_prefix(&format!("## [{version}] - ")).is_some_and(|date| date.len() == "2026-01-01".len());
    if !text.lines().any(dated) {
        return Err(format!("no heading `## [{version}] - <date>`"));
    }
    let unreleased =
        text.lines().skip_while(|l| !l.starts_with("## [Unreleased]")).skip(1).take_while(|l| !l.starts_with("## "));
    match unreleased.filter(|l| !l.trim().is_empty()).count() {
        0 => Ok(()),
        n => Err(format!("{n} lines are still under `Unreleased`")),
    }
}

/// Whether every row of the table under `## Measured` is filled in.
fn measured(readme: &str) -> bool {
    let rows: Vec<&str> = readme
        .lines()
        .skip_while(|l| *l != "## Measured")
        .skip(1)
        .take_while(|l| !l.starts_with("## "))
        .filter(|l| l.starts_with('|'))
        .collect();
    rows.len() > 2 && rows.iter().all(|r| r.trim_matches('|').split('|').all(|cell| !cell.trim().is_empty()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_changelog_is_ready_when_the_version_is_dated_and_nothing_is_left() {
        let ready = "# Changelog\n\n## [Unreleased]\n\n## [1.2.0] - 2026-02-03\n\n- A knot.\n";
        assert_eq!(changelog(ready, "1.2.0"), Ok(()));
        assert!(changelog(ready, "1.3.0").is_err());
        assert!(changelog(&ready.replace("[Unreleased]\n", "[Unreleased]\n- More.\n"), "1.2.0").is_err());
    }

    #[test]
    fn an_empty_cell_is_not_measured() {
        let table = "## Measured\n\n| what | ms |\n|---|---|\n| a | 1 |\n\n## Next\n\n| | |\n";
        assert!(measured(table));
        assert!(!measured(&table.replace("| 1 |", "| |")));
        assert!(!measured("## Measured\n"));
    }

    /// The example of the README is the file that is built and run by the checks.
    #[test]
    fn the_readme_shows_the_example() {
        let (readme, example) = (read("README.md"), read("crates/sutura/examples/first_thread.rs"));
        let code = example.split_once("\n\n").map_or("", |(_heading, code)| code);
        assert!(
            code.contains("fn main()") && readme.contains(code.trim()),
            "README.md does not have the text of examples/first_thread.rs"
        );
    }

    /// Files that the documents point to exist (the picture is made at the end).
    #[test]
    fn links_between_documents_lead_somewhere() {
        for document in ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "docs/theory.md"] {
            let text = read(document);
            let folder = root().join(document).parent().map(std::path::Path::to_path_buf).unwrap_or_default();
            assert!(!text.is_empty(), "{document}");
            for link in text.split("](").skip(1).filter_map(|l| l.split_once(')')).map(|(link, _)| link) {
                let file = link.split('#').next().unwrap_or_default();
                if !file.is_empty() && !file.contains("://") && !file.ends_with(".png") {
                    assert!(folder.join(file).exists(), "{document} points to {link}");
                }
            }
        }
    }
}
