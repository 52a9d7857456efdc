//! Lists the files of `scenes/` for `samples.rs`, so that a new scene is a sample without a list to keep.

use std::path::Path;

fn main() {
    let folder = Path::new(&std::env::var("CARGO_MANIFEST_DIR").expect("set by cargo")).join("../../scenes");
    println!("cargo::rerun-if-changed={}", folder.display());
    let mut files: Vec<_> =
        std::fs::read_dir(&folder).expect("the folder scenes/").filter_map(|f| f.ok().map(|f| f.path())).collect();
    files.retain(|f| f.extension().is_some_and(|e| e == "toml"));
    files.sort();
    let entry = |f: &std::path::PathBuf| {
        format!(
            "({:?}, include_str!({:?})),\n",
            f.file_stem().unwrap_or_default().to_string_lossy(),
            f.display().to_string()
        )
    };
    let list: String = files.iter().map(entry).collect();
    let out = Path::new(&std::env::var("OUT_DIR").expect("set by cargo")).join("samples.rs");
    std::fs::write(out, format!("&[\n{list}]\n")).expect("the build folder can be written");
}
