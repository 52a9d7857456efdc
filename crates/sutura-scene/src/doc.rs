//! A TOML document read with its places: every value knows its line and its key, and problems are collected instead of
//! stopping at the first.

use crate::error::{Problem, SceneError, suggest};
use crate::set::Setting;
use crate::units::{Dim, parse_quantity, parse_unit};
use std::borrow::Cow;
use std::cell::RefCell;
use std::ops::Range;
use sutura::glam::DVec3;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The text being read and what was found wrong with it.
pub struct Doc {
    file: String,
    text: String,
    /// Values set from outside; their spans lie behind the text.
    settings: Vec<Setting>,
    problems: RefCell<Vec<(usize, Problem)>>,
}

/// Where something stands in the file, kept for problems that show only later.
#[derive(Debug, Clone, PartialEq)]
pub struct Location {
    pub file: String,
    /// `None` for what was set from outside.
    pub line: Option<usize>,
    pub key: String,
}

impl std::fmt::Display for Location {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let line = self.line.map_or_else(String::new, |line| format!(":{line}"));
        write!(f, "{}{line}: {}", self.file, self.key)
    }
}

impl Location {
    /// A problem at this place.
    pub fn problem(&self, message: impl Into<String>) -> Problem {
        Problem {
            file: self.file.clone(),
            line: self.line,
            column: None,
            key: self.key.clone(),
            message: message.into(),
            help: None,
        }
    }
    /// An error with one problem at this place.
    pub fn error(&self, message: impl Into<String>) -> SceneError {
        SceneError { problems: vec![self.problem(message)] }
    }
}

impl Doc {
    /// `settings` are paths and values from outside.
    pub fn new(file: &str, text: &str, settings: &[(String, String)]) -> Self {
        let mut end = text.len();
        let setting = |(path, value): &(String, String)| {
            let setting = Setting::new(path, value, end);
            end = setting.end();
            setting
        };
        Doc {
            file: file.into(),
            text: text.into(),
            settings: settings.iter().map(setting).collect(),
            problems: RefCell::default(),
        }
    }
    pub fn text(&self) -> &str {
        &self.text
    }
    pub fn settings(&self) -> &[Setting] {
        &self.settings
    }
    /// File, line and column of a byte; what was set from outside stands for itself.
    fn place(&self, at: usize) -> (String, Option<usize>, Option<usize>) {
        if at > self.text.len()
            && let Some(setting) = self.settings.iter().find(|s| at <= s.end())
        {
            return (setting.source(), None, None);
        }
        let (line, column) = self.line_column(at);
        (self.file.clone(), Some(line), Some(column))
    }
    /// Line and column, from 1, of a byte.
    fn line_column(&self, at: usize) -> (usize, usize) {
        let mut at = at.min(self.text.len());
        while !self.text.is_char_boundary(at) {
            at -= 1;
        }
        let before = &self.text[..at];
        let line_start = before.rfind('\n').map_or(0, |i| i + 1);
        (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
    }
    /// Notes a problem at a byte.
    pub fn problem(&self, at: usize, key: &str, message: impl Into<String>, help: Option<String>) {
        let (file, line, column) = self.place(at);
        let problem = Problem { file, line, column, key: key.into(), message: message.into(), help };
        self.problems.borrow_mut().push((at, problem));
    }
    /// Notes a problem at a place read before.
    pub fn problem_at(&self, location: &Location, message: impl Into<String>) {
        let lines = |n: usize| self.text.split_inclusive('\n').take(n).map(str::len).sum();
        let set = || self.settings.iter().find(|s| s.source() == location.file).map_or(0, Setting::end);
        let at = location.line.map_or_else(set, |line| lines(line.saturating_sub(1)));
        self.problem(at, &location.key, message, None);
    }
    /// `Ok` when nothing was wrong, else all problems in the order of the file, each place and message once.
    pub fn verdict(&self) -> Result<(), SceneError> {
        let mut problems = self.problems.borrow().clone();
        problems.sort_by_key(|(at, _)| *at);
        problems.dedup();
        if problems.is_empty() {
            Ok(())
        } else {
            Err(SceneError { problems: problems.into_iter().map(|(_, p)| p).collect() })
        }
    }
}

/// A table under reading. Keys that were asked for are remembered; [`Table::finish`] reports the others.
pub struct Table<'d> {
    doc: &'d Doc,
    map: &'d DeTable<'d>,
    span: Range<usize>,
    path: String,
    known: RefCell<Vec<String>>,
}

/// A value under reading.
#[derive(Clone)]
pub struct Value<'d> {
    doc: &'d Doc,
    node: &'d DeValue<'d>,
    span: Range<usize>,
    path: String,
}

impl<'d> Table<'d> {
    /// The whole document.
    pub fn root(doc: &'d Doc, table: &'d Spanned<DeTable<'d>>) -> Self {
        Table { doc, map: table.get_ref(), span: table.span(), path: String::new(), known: RefCell::default() }
    }
    fn key_path(&self, key: &str) -> String {
        if self.path.is_empty() { key.into() } else { format!("{}.{key}", self.path) }
    }
    /// The value of a key, when it is there.
    pub fn get(&self, key: &str) -> Option<Value<'d>> {
        if !self.known.borrow().iter().any(|k| k == key) {
            self.known.borrow_mut().push(key.into());
        }
        let (_, node) = self.map.iter().find(|(k, _)| k.get_ref() == key)?;
        Some(Value { doc: self.doc, node: node.get_ref(), span: node.span(), path: self.key_path(key) })
    }
    /// Whether a key is there (it counts as known).
    pub fn has(&self, key: &str) -> bool {
        self.get(key).is_some()
    }
    /// The value of a key that must be there.
    pub fn need(&self, key: &str, wanted: &str) -> Option<Value<'d>> {
        let value = self.get(key);
        if value.is_none() {
            self.problem(format!("`{key}` is missing: {wanted}"), self.misspelled(key));
        }
        value
    }
    /// A key in the table that looks like `key` misspelled.
    fn misspelled(&self, key: &str) -> Option<String> {
        let known = self.known.borrow();
        let others: Vec<&str> =
            self.map.keys().map(|k| k.get_ref().as_ref()).filter(|k: &&str| !known.iter().any(|n| n == k)).collect();
        crate::error::nearest(key, others).map(|k| format!("there is a `{k}`"))
    }
    /// Notes a problem with the table as a whole.
    pub fn problem(&self, message: impl Into<String>, help: Option<String>) {
        self.doc.problem(self.span.start, &self.path, message, help);
    }
    pub fn location(&self) -> Location {
        let (file, line, _) = self.doc.place(self.span.start);
        Location { file, line, key: self.path.clone() }
    }
    /// Reports every key that was never asked for, with the nearest that was.
    pub fn finish(&self) {
        let known = self.known.borrow();
        for key in self.map.keys() {
            let name: &str = key.get_ref();
            if !known.iter().any(|k| k == name) {
                let help = suggest(name, known.iter().map(String::as_str));
                self.doc.problem(key.span().start, &self.key_path(name), "unknown key", help);
            }
        }
    }

    pub fn quantity(&self, key: &str, dim: Dim) -> Option<f64> {
        self.get(key)?.quantity(dim)
    }
    pub fn quantity_or(&self, key: &str, dim: Dim, default: f64) -> f64 {
        self.quantity(key, dim).unwrap_or(default)
    }
    pub fn need_quantity(&self, key: &str, dim: Dim) -> Option<f64> {
        self.need(key, &format!("{dim} is wanted"))?.quantity(dim)
    }
    pub fn vector(&self, key: &str, dim: Dim) -> Option<DVec3> {
        self.get(key)?.vector(dim)
    }
    pub fn need_vector(&self, key: &str, dim: Dim) -> Option<DVec3> {
        self.need(key, &format!("three numbers are wanted, {dim} each"))?.vector(dim)
    }
    pub fn text(&self, key: &str) -> Option<Cow<'d, str>> {
        self.get(key)?.text()
    }
    pub fn truth_or(&self, key: &str, default: bool) -> bool {
        self.get(key).and_then(|v| v.truth()).unwrap_or(default)
    }
    /// The elements of an array of tables; a single table counts as one.
    pub fn tables(&self, key: &str) -> Vec<Table<'d>> {
        let Some(value) = self.get(key) else { return Vec::new() };
        match value.node {
            DeValue::Table(_) => value.table().into_iter().collect(),
            _ => value.array("an array of tables").unwrap_or_default().iter().filter_map(Value::table).collect(),
        }
    }
}

impl<'d> Value<'d> {
    /// Notes a problem here.
    pub fn problem(&self, message: impl Into<String>, help: Option<String>) {
        self.doc.problem(self.span.start, &self.path, message, help);
    }
    fn wrong<T>(&self, wanted: &str) -> Option<T> {
        let found = match self.node {
            DeValue::String(s) => format!("the text \"{}\"", shorten(s)),
            DeValue::Integer(i) => format!("the number {i}"),
            DeValue::Float(f) => format!("the number {}", f.as_str()),
            DeValue::Boolean(b) => format!("{b}"),
            DeValue::Datetime(_) => "a date or time of day".into(),
            DeValue::Array(_) => "an array".into(),
            DeValue::Table(_) => "a table".into(),
        };
        self.problem(format!("found {found}, wanted {wanted}"), None);
        None
    }
    pub fn location(&self) -> Location {
        let (file, line, _) = self.doc.place(self.span.start);
        Location { file, line, key: self.path.clone() }
    }
    pub fn is_text(&self) -> bool {
        matches!(self.node, DeValue::String(_))
    }
    pub fn is_array(&self) -> bool {
        matches!(self.node, DeValue::Array(_))
    }
    pub fn is_table(&self) -> bool {
        matches!(self.node, DeValue::Table(_))
    }
    pub fn is_truth(&self) -> bool {
        matches!(self.node, DeValue::Boolean(_))
    }
    pub fn text(&self) -> Option<Cow<'d, str>> {
        match self.node {
            DeValue::String(s) => Some(s.clone()),
            _ => self.wrong("a text in quotes"),
        }
    }
    pub fn truth(&self) -> Option<bool> {
        match self.node {
            DeValue::Boolean(b) => Some(*b),
            _ => self.wrong("true or false"),
        }
    }
    /// A plain TOML number.
    fn plain_number(&self) -> Option<f64> {
        match self.node {
            DeValue::Integer(i) => i64::from_str_radix(i.as_str(), i.radix()).ok().map(|v| v as f64),
            DeValue::Float(f) => f.as_str().parse().ok(),
            _ => None,
        }
        .filter(|v: &f64| v.is_finite())
    }
    /// A quantity in SI: a text with a unit, or a plain number that is SI already.
    pub fn quantity(&self, dim: Dim) -> Option<f64> {
        if let Some(v) = self.plain_number() {
            return Some(v);
        }
        let DeValue::String(text) = self.node else {
            return self.wrong(&format!("{dim}: a finite number, or a text such as \"1 {}\"", dim.si_unit()));
        };
        match parse_quantity(text) {
            Ok(q) if dim.accepts(q.dim) => Some(q.value),
            // A text without unit is a slip more often than SI.
            Ok(q) if q.dim == Dim::NUMBER => {
                self.problem(
                    format!("\"{text}\" has no unit, wanted {dim}"),
                    Some(format!("write it as \"{} {}\", or without quotes for SI", text.trim(), dim.si_unit())),
                );
                None
            }
            Ok(q) => {
                self.problem(format!("\"{text}\" is {}, wanted {dim}", q.dim), None);
                None
            }
            Err(e) => {
                self.problem(e, None);
                None
            }
        }
    }
    /// A whole number in a range.
    pub fn integer(&self, from: i64, to: i64) -> Option<i64> {
        let value = match self.node {
            DeValue::Integer(i) => i64::from_str_radix(i.as_str(), i.radix()).ok(),
            _ => None,
        };
        match value {
            Some(v) if (from..=to).contains(&v) => Some(v),
            _ => self.wrong(&format!("a whole number from {from} to {to}")),
        }
    }
    pub fn array(&self, wanted: &str) -> Option<Vec<Value<'d>>> {
        let DeValue::Array(items) = self.node else { return self.wrong(wanted) };
        let item = |(i, v): (usize, &'d Spanned<DeValue<'d>>)| Value {
            doc: self.doc,
            node: v.get_ref(),
            span: v.span(),
            path: format!("{}[{i}]", self.path),
        };
        Some(items.iter().enumerate().map(item).collect())
    }
    pub fn table(&self) -> Option<Table<'d>> {
        match self.node {
            DeValue::Table(map) => Some(Table {
                doc: self.doc,
                map,
                span: self.span.clone(),
                path: self.path.clone(),
                known: RefCell::default(),
            }),
            _ => self.wrong("a table { key = value, .. }"),
        }
    }
    /// Numbers of an array, or of a text such as `"[0, 0, 10] mm"`.
    pub fn quantities(&self, dim: Dim, wanted: &str) -> Option<Vec<f64>> {
        if let DeValue::String(text) = self.node {
            let numbers = text.trim().strip_prefix('[').and_then(|rest| rest.split_once(']'));
            let Some((inside, unit)) = numbers else { return self.wrong(wanted) };
            let unit = match parse_unit(unit) {
                Ok(unit) if dim.accepts(unit.dim) => unit,
                Ok(unit) => {
                    self.problem(format!("\"{}\" is {}, wanted {dim}", shorten(text), unit.dim), None);
                    return None;
                }
                Err(e) => {
                    self.problem(e, None);
                    return None;
                }
            };
            let numbers: Option<Vec<f64>> = inside
                .split(',')
                .map(|n| n.trim().parse::<f64>().ok().filter(|v| v.is_finite()).map(|v| v * unit.size))
                .collect();
            return numbers.or_else(|| self.wrong(wanted));
        }
        self.array(wanted)?.iter().map(|v| v.quantity(dim)).collect()
    }
    /// Three numbers.
    pub fn vector(&self, dim: Dim) -> Option<DVec3> {
        let wanted = format!("three numbers, each {dim}");
        match self.quantities(dim, &wanted)?.as_slice() {
            [x, y, z] => Some(DVec3::new(*x, *y, *z)),
            other => {
                self.problem(format!("found {} numbers, wanted three", other.len()), None);
                None
            }
        }
    }
    /// A direction: three numbers, not all zero, made a unit vector.
    pub fn direction(&self) -> Option<DVec3> {
        let v = self.vector(Dim::NUMBER)?;
        let unit = v.try_normalize();
        if unit.is_none() {
            self.problem("a direction cannot be zero", None);
        }
        unit
    }
    /// One of several words.
    pub fn choice<T: Clone>(&self, words: &[(&str, T)]) -> Option<T> {
        let text = self.text()?;
        if let Some((_, t)) = words.iter().find(|(w, _)| *w == text) {
            return Some(t.clone());
        }
        self.problem(
            format!(
                "\"{}\" is not one of: {}",
                shorten(&text),
                words.iter().map(|(w, _)| *w).collect::<Vec<_>>().join(", ")
            ),
            crate::error::nearest(&text, words.iter().map(|(w, _)| *w)).map(|n| format!("did you mean \"{n}\"?")),
        );
        None
    }
}

fn shorten(text: &str) -> String {
    if text.chars().count() > 60 { text.chars().take(60).collect::<String>() + ".." } else { text.into() }
}
