//! What is wrong with a scene: file, line, key, reason and the nearest thing that would have been right.

use std::fmt;

/// Everything found wrong with a scene, at least one problem.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneError {
    /// What is wrong, in the order of the file.
    pub problems: Vec<Problem>,
}

/// One thing wrong with a scene.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// File in which it was found.
    pub file: String,
    /// Line, from 1; `None` when the problem is not at one place (a file that cannot be read).
    pub line: Option<usize>,
    /// Column in characters, from 1.
    pub column: Option<usize>,
    /// Key in the file, for instance `thread[0].radius`; empty at the top.
    pub key: String,
    /// What is wrong and what was wanted.
    pub message: String,
    /// The nearest right thing.
    pub help: Option<String>,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file)?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
            if let Some(column) = self.column {
                write!(f, ":{column}")?;
            }
        }
        if !self.key.is_empty() {
            write!(f, ": {}", self.key)?;
        }
        write!(f, ": {}", self.message)?;
        if let Some(help) = &self.help {
            write!(f, " ({help})")?;
        }
        Ok(())
    }
}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, problem) in self.problems.iter().enumerate() {
            if i > 0 {
                writeln!(f)?;
            }
            write!(f, "{problem}")?;
        }
        Ok(())
    }
}

impl std::error::Error for SceneError {}

impl SceneError {
    /// A problem with a file as a whole.
    pub(crate) fn of_file(file: impl Into<String>, message: impl Into<String>) -> Self {
        SceneError {
            problems: vec![Problem {
                file: file.into(),
                line: None,
                column: None,
                key: String::new(),
                message: message.into(),
                help: None,
            }],
        }
    }
}

/// "did you mean" for a word among the words that would do; `None` when nothing is near.
pub(crate) fn nearest<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let lower = word.to_lowercase();
    known
        .into_iter()
        .map(|k| (strsim::damerau_levenshtein(&lower, &k.to_lowercase()), k))
        // A third of the word may be wrong; beyond that a suggestion misleads.
        .filter(|(d, k)| *d <= (word.chars().count().max(k.chars().count()) / 3).max(1))
        .min()
        .map(|(_, k)| k)
}

/// The help line for [`nearest`]: the suggestion, or the list when it is short.
pub(crate) fn suggest<'a>(word: &str, known: impl IntoIterator<Item = &'a str> + Clone) -> Option<String> {
    if let Some(near) = nearest(word, known.clone()) {
        return Some(format!("did you mean `{near}`?"));
    }
    let all: Vec<&str> = known.into_iter().collect();
    (!all.is_empty() && all.len() <= 40).then(|| format!("known: {}", all.join(", ")))
}
