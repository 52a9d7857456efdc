//! The sample scenes, part of the program.

use std::sync::LazyLock;

/// A sample scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sample {
    /// Its name, the file name without `.toml`.
    pub name: &'static str,
    /// One line on what it shows.
    pub title: &'static str,
    /// The text of the file.
    pub text: &'static str,
}

/// All sample scenes.
pub fn samples() -> &'static [Sample] {
    static SAMPLES: LazyLock<Vec<Sample>> =
        LazyLock::new(|| TEXTS.iter().map(|(name, text)| Sample { name, title: title(text).unwrap_or(name), text }).collect());
    &SAMPLES
}

/// The `title` of a scene file.
fn title(text: &'static str) -> Option<&'static str> {
    text.lines().find_map(|line| line.strip_prefix("title = \"")?.strip_suffix('"'))
}

macro_rules! sample_list {
    ($($name:literal),* $(,)?) => { &[$(($name, include_str!(concat!("../../../scenes/", $name, ".toml")))),*] };
}

/// Every file of `scenes/`.
const TEXTS: &[(&str, &str)] =
    sample_list!["capstan", "catenary", "clamped_twist", "elastica_self_weight", "elastica_tip_load", "free_thread", "hanging_chain", "hanging_helix"];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scene_file_is_a_sample_and_reads() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
        let mut files: Vec<String> =
            std::fs::read_dir(folder).unwrap().filter_map(|f| f.unwrap().file_name().to_str()?.strip_suffix(".toml").map(str::to_owned)).collect();
        files.sort();
        assert_eq!(files, samples().iter().map(|s| s.name).collect::<Vec<_>>());
        for sample in samples() {
            let scene = crate::Scene::parse(sample.text, &format!("{}.toml", sample.name)).unwrap_or_else(|e| panic!("{e}"));
            assert_eq!(sample.title, scene.title());
            assert!(!scene.description().is_empty());
        }
    }
}
