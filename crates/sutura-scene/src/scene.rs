//! A scene, read and checked.

use crate::error::SceneError;
use std::path::Path;

/// A scene, read from a file and checked.
#[derive(Debug, Clone)]
pub struct Scene {
    name: String,
    title: String,
    description: String,
    frame_rate: f64,
    duration: Option<f64>,
    stills: Vec<f64>,
}

impl Scene {
    /// Reads a scene file. Paths in it are relative to its folder.
    pub fn load(path: &Path) -> Result<Scene, SceneError> {
        let text = std::fs::read_to_string(path).map_err(|e| SceneError::of_file(path.display().to_string(), e.to_string()))?;
        Self::parse(&text, &path.display().to_string())
    }
    /// Reads the text of a scene; `file_name` stands in messages, and its folder is where paths start.
    pub fn parse(_text: &str, file_name: &str) -> Result<Scene, SceneError> {
        Err(SceneError::of_file(file_name, "not readable yet"))
    }
    /// Name: the file name without its ending.
    pub fn name(&self) -> &str {
        &self.name
    }
    /// Title, or the name.
    pub fn title(&self) -> &str {
        &self.title
    }
    /// What it shows, may be empty.
    pub fn description(&self) -> &str {
        &self.description
    }
    /// Frames per second.
    pub fn frame_rate(&self) -> f64 {
        self.frame_rate
    }
    /// Longest simulated time that it can take \[s\] when every phase has a bound; shorter when conditions end phases early.
    pub fn duration(&self) -> Option<f64> {
        self.duration
    }
    /// Times of which stills are wanted \[s\]; times beyond the end mean the end.
    pub fn stills(&self) -> &[f64] {
        &self.stills
    }
}
