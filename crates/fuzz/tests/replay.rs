//! Every input of the corpus and every fault that fuzzing ever found, tried again without a fuzzer.

use std::path::{Path, PathBuf};
use sutura_fuzz::TARGETS;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz")
}

/// Files of `fuzz/KIND/TARGET` in order of name; none when there is no such folder.
fn files(kind: &str, target: &str) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder().join(kind).join(target)) else { return Vec::new() };
    let mut files: Vec<PathBuf> = entries.filter_map(|e| e.ok().map(|e| e.path())).filter(|p| p.is_file()).collect();
    files.sort();
    files
}

fn replay(target: &str) {
    let corpus = files("corpus", target);
    assert!(!corpus.is_empty(), "the corpus of {target} is empty");
    for file in corpus.into_iter().chain(files("faults", target)) {
        let data = std::fs::read(&file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
        // A fault in the middle of many is found by its name.
        println!("{}", file.display());
        sutura_fuzz::run(target, &data);
    }
}

macro_rules! replays {
    ($($target:ident),*) => {
        $(
            #[test]
            fn $target() {
                replay(stringify!($target));
            }
        )*
        /// A target without a test here, a folder without a target, a program without one: none is overlooked.
        #[test]
        fn targets_tests_folders_and_programs_are_the_same() {
            let names: Vec<&str> = TARGETS.iter().map(|t| t.name).collect();
            assert_eq!(names, [$(stringify!($target)),*]);
            let stems = |folder: PathBuf| {
                let entries = std::fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
                let mut stems: Vec<String> = entries.filter_map(|e| Some(e.ok()?.path().file_stem()?.to_string_lossy().into_owned())).collect();
                stems.sort();
                stems
            };
            assert_eq!(stems(folder().join("corpus")), names);
            assert_eq!(stems(folder().join("fuzz_targets")), names);
            assert!(stems(folder().join("faults")).iter().all(|f| names.contains(&f.as_str())));
        }
    };
}

replays!(edits, expr, knot, saved, scene, snapshot, trajectory);
