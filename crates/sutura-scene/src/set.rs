//! Values set from outside: a key of a scene by its path, replaced before the scene is read.
//!
//! A path names keys with points between them; an entry of an array of tables is chosen by its `name` or its number:
//! `solver.substep`, `thread.rod.elements`, `phase.load.action[0].force`, `grip[1].hold`.

use crate::error::{Problem, SceneError, suggest};
use toml::Spanned;
use toml::de::{DeArray, DeTable, DeValue};

/// A value for a key, as it was given.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Setting {
    pub path: String,
    pub value: String,
    /// The value as a document of its own, behind as many blanks as there is text before it, so that its spans lie
    /// behind the text.
    document: String,
}

impl Setting {
    /// `before` is the length of the scene's text and of the settings before this one.
    pub fn new(path: &str, value: &str, before: usize) -> Self {
        let document = format!("{}v = {value}", " ".repeat(before));
        Setting { path: path.trim().into(), value: value.trim().into(), document }
    }
    /// Where the next setting may begin.
    pub fn end(&self) -> usize {
        self.document.len()
    }
    /// Where problems with it are.
    pub fn source(&self) -> String {
        format!("{} = {}", self.path, self.value)
    }
    fn error(&self, message: String, help: Option<String>) -> SceneError {
        SceneError {
            problems: vec![Problem {
                file: self.source(),
                line: None,
                column: None,
                key: String::new(),
                message,
                help,
            }],
        }
    }
    /// A TOML value; whatever is none, such as `2 mm`, is a text.
    fn parsed(&self) -> Spanned<DeValue<'_>> {
        let span = self.end() - self.value.len()..self.end();
        match DeTable::parse(&self.document).map(Spanned::into_inner) {
            Ok(table) if table.len() == 1 => table.into_iter().next().map(|(_, value)| value),
            _ => None,
        }
        .unwrap_or_else(|| Spanned::new(span, DeValue::String(self.value.as_str().into())))
    }
    /// Puts the value into the document.
    pub fn apply<'d>(&'d self, root: &mut Spanned<DeTable<'d>>) -> Result<(), SceneError> {
        let mut steps = Vec::new();
        for part in self.path.split('.') {
            let (name, numbers) = part.split_once('[').map_or((part, None), |(name, rest)| (name, Some(rest)));
            if name.is_empty() {
                return Err(
                    self.error("a path is names with points between them, such as thread.NAME.elements".into(), None)
                );
            }
            steps.push(Step::Name(name));
            for number in numbers.iter().flat_map(|n| n.split('[')) {
                match number.strip_suffix(']').and_then(|n| n.parse().ok()) {
                    Some(n) => steps.push(Step::Number(n)),
                    None => {
                        return Err(
                            self.error(format!("`[{number}` is not the number of an entry, such as `[0]`"), None)
                        );
                    }
                }
            }
        }
        let Some((Step::Name(first), rest)) = steps.split_first() else { return Ok(()) };
        let (mut node, mut steps) = (self.child(root.get_mut(), first), rest);
        loop {
            let Some((step, rest)) = steps.split_first() else {
                *node = self.parsed();
                return Ok(());
            };
            node = match (node.get_mut(), step) {
                (DeValue::Table(table), Step::Name(name)) => self.child(table, name),
                (DeValue::Array(items), step) => self.entry(items, step)?,
                (_, Step::Number(n)) => {
                    return Err(self.error(format!("there is no array from which to take entry {n}"), None));
                }
                (_, Step::Name(name)) => {
                    return Err(self.error(format!("there is no table in which to set `{name}`"), None));
                }
            };
            steps = rest;
        }
    }
    /// The value of a key; a key that is not there begins as an empty table.
    fn child<'a, 'd>(&'d self, table: &'a mut DeTable<'d>, name: &'d str) -> &'a mut Spanned<DeValue<'d>> {
        let at = self.end()..self.end();
        table
            .entry(Spanned::new(at.clone(), name.into()))
            .or_insert_with(|| Spanned::new(at, DeValue::Table(DeTable::new())))
    }
    /// An entry of an array, by number or name.
    fn entry<'a, 'd>(
        &self,
        items: &'a mut DeArray<'d>,
        step: &Step<'_>,
    ) -> Result<&'a mut Spanned<DeValue<'d>>, SceneError> {
        let names: Vec<String> = items.iter().map(|item| name_of(item.get_ref()).unwrap_or_default()).collect();
        let found = match step {
            Step::Number(n) => Some(*n).filter(|n| *n < items.len()),
            Step::Name(name) => names.iter().position(|n| n == name),
        };
        match found {
            Some(i) => Ok(&mut items.as_mut()[i]),
            None => Err(match step {
                Step::Number(n) => {
                    self.error(format!("there is no entry {n}: there are {}, counted from 0", items.len()), None)
                }
                Step::Name(name) => {
                    let known = names.iter().map(String::as_str).filter(|n| !n.is_empty());
                    self.error(
                        format!("no entry is called `{name}`; entries without a name are chosen by number, `[0]`"),
                        suggest(name, known),
                    )
                }
            }),
        }
    }
}

enum Step<'a> {
    Name(&'a str),
    Number(usize),
}

fn name_of(item: &DeValue<'_>) -> Option<String> {
    let DeValue::Table(table) = item else { return None };
    match table.get("name")?.get_ref() {
        DeValue::String(name) => Some(name.to_string()),
        _ => None,
    }
}
