//! A table of results as CSV: one row a case, found again by the levels of its factors.

use anyhow::Context as _;
use std::fmt::Write as _;
use std::path::Path;

/// Headings and rows of equal length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Table {
    /// Names of the columns.
    pub columns: Vec<String>,
    /// The rows.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// An empty table.
    pub fn new<'a>(columns: impl IntoIterator<Item = &'a str>) -> Self {
        Table { columns: columns.into_iter().map(str::to_string).collect(), rows: Vec::new() }
    }

    /// Reads the table in a file; empty when there is no such file or its columns are others.
    pub fn read_or_new(path: &Path, columns: &[&str]) -> anyhow::Result<Self> {
        let mut table = Table::new(columns.iter().copied());
        if !path.is_file() {
            return Ok(table);
        }
        let cannot = || format!("cannot read {}", path.display());
        let mut reader = csv::Reader::from_path(path).with_context(cannot)?;
        if reader.headers().with_context(cannot)?.iter().eq(columns.iter().copied()) {
            for row in reader.records() {
                table.rows.push(row.with_context(cannot)?.iter().map(str::to_string).collect());
            }
        }
        Ok(table)
    }

    /// Writes the table, all or nothing.
    pub fn write(&self, path: &Path) -> anyhow::Result<()> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        writer.write_record(&self.columns)?;
        for row in &self.rows {
            writer.write_record(row)?;
        }
        replace(path, &writer.into_inner()?)
    }

    /// Index of a column. Panics when there is none: the names are constants of this crate.
    pub fn column(&self, name: &str) -> usize {
        self.columns.iter().position(|c| c == name).unwrap_or_else(|| panic!("no column {name}"))
    }

    /// An entry of a row by the name of its column.
    pub fn text<'a>(&self, row: &'a [String], name: &str) -> &'a str {
        &row[self.column(name)]
    }

    /// The same as a number; `None` when it is empty or none.
    pub fn number(&self, row: &[String], name: &str) -> Option<f64> {
        self.text(row, name).parse().ok()
    }

    /// The table in Markdown with these columns.
    pub fn markdown(&self, columns: &[&str]) -> String {
        let at: Vec<usize> = columns.iter().map(|c| self.column(c)).collect();
        markdown(columns, self.rows.iter().map(|r| at.iter().map(|c| r[*c].clone()).collect()))
    }
}

/// A table in Markdown.
pub fn markdown(columns: &[&str], rows: impl Iterator<Item = Vec<String>>) -> String {
    let mut out = format!("| {} |\n|{}\n", columns.join(" | "), "---|".repeat(columns.len()));
    for row in rows {
        let cells: Vec<String> = row.iter().map(|c| c.replace('|', "\\|")).collect();
        // Writing to a text does not fail.
        let _ = writeln!(out, "| {} |", cells.join(" | "));
    }
    out
}

/// Writes a file by way of another, so that a program that is stopped leaves the old or the new one.
pub fn replace(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    let cannot = || format!("cannot write {}", path.display());
    let beside = path.with_extension("part");
    std::fs::write(&beside, bytes).with_context(cannot)?;
    std::fs::rename(&beside, path).with_context(cannot)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_read_back_as_written_and_another_one_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        let mut table = Table::new(["mu", "ended"]);
        table.rows.push(vec!["0.1".into(), "not finished: over 1 s, at \"x\"".into()]);
        table.write(&path).unwrap();
        assert_eq!(Table::read_or_new(&path, &["mu", "ended"]).unwrap(), table);
        assert!(Table::read_or_new(&path, &["mu", "knot"]).unwrap().rows.is_empty());
        assert!(Table::read_or_new(&folder.path().join("none.csv"), &["mu"]).unwrap().rows.is_empty());
        assert_eq!(table.number(&table.rows[0], "mu"), Some(0.1));
        assert_eq!(table.number(&table.rows[0], "ended"), None);
        assert_eq!(table.markdown(&["mu"]), "| mu |\n|---|\n| 0.1 |\n");
    }
}
