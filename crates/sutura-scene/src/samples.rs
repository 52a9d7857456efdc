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
    static SAMPLES: LazyLock<Vec<Sample>> = LazyLock::new(|| {
        TEXTS.iter().map(|(name, text)| Sample { name, title: title(text).unwrap_or(name), text }).collect()
    });
    &SAMPLES
}

/// The `title` of a scene file.
fn title(text: &'static str) -> Option<&'static str> {
    text.lines().find_map(|line| line.strip_prefix("title = \"")?.strip_suffix('"'))
}

/// Name and text of every file of `scenes/`, in order of name.
const TEXTS: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/samples.rs"));

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sample_reads_and_says_what_it_shows() {
        assert!(samples().len() >= 8);
        for sample in samples() {
            let scene =
                crate::Scene::parse(sample.text, &format!("{}.toml", sample.name)).unwrap_or_else(|e| panic!("{e}"));
            assert_eq!(sample.title, scene.title());
            assert!(!scene.description().is_empty(), "{}", sample.name);
        }
    }
}
