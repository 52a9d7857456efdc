//! The sample scenes, part of the program.

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
    SAMPLES
}

const SAMPLES: &[Sample] = &[];
