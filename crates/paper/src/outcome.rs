//! What an experiment finds: text, tables, curves, maps and shapes to be drawn.

use sutura::glam::DVec3;
use sutura::{Geometry, Pose};

/// What an experiment found.
#[derive(Default)]
pub struct Outcome {
    /// What is set up, what is seen, and what falls short: paragraphs of Markdown.
    pub text: String,
    /// For the table at the top of the page.
    pub compare: Vec<Compare>,
    /// What was asked for, and what was found.
    pub checks: Vec<Check>,
    /// Numbers.
    pub tables: Vec<Table>,
    /// Curves.
    pub plots: Vec<Plot>,
    /// Maps.
    pub grids: Vec<Grid>,
    /// Pictures of threads.
    pub pictures: Vec<Picture>,
}

/// A line of the table at the top: what the paper reports, and what is found here.
pub struct Compare {
    /// What it is.
    pub what: String,
    /// What the paper reports.
    pub published: String,
    /// The paper's solver at its effective scale.
    pub effective: String,
    /// The paper's solver at true scale.
    pub true_scale: String,
    /// Sutura's own solver at true scale.
    pub direct: String,
}

/// Something asked for.
pub struct Check {
    /// What.
    pub what: String,
    /// The bar.
    pub bar: String,
    /// What was found.
    pub found: String,
    /// Whether it is within the bar.
    pub passed: bool,
    /// Whether it hangs on times measured, so that another run may find otherwise.
    pub measured: bool,
}

/// A table, also written as CSV.
pub struct Table {
    /// Name of the file, without the experiment's.
    pub name: String,
    /// Above it.
    pub title: String,
    /// Headings with units.
    pub headings: Vec<String>,
    /// Rows of cells.
    pub rows: Vec<Vec<Cell>>,
    /// Whether it holds times measured: these differ from run to run, and are kept out of the CSV files.
    pub measured: bool,
    /// Whether the page shows it (else it is only in the file).
    pub shown: bool,
}

/// A cell of a table.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// A word.
    Word(String),
    /// A number.
    Number(f64),
}

/// An axis of a plot.
pub struct Axis {
    /// Its name.
    pub name: String,
    /// Its unit, empty for none.
    pub unit: String,
    /// Whether it is logarithmic.
    pub log: bool,
}

/// Curves.
pub struct Plot {
    /// Name of the file, without the experiment's.
    pub name: String,
    /// Above it.
    pub title: String,
    /// Abscissa.
    pub x: Axis,
    /// Ordinate.
    pub y: Axis,
    /// What is drawn.
    pub curves: Vec<Curve>,
    /// Ordinates that matter, with what they mean.
    pub marks: Vec<(String, f64)>,
    /// Whether it shows times measured.
    pub measured: bool,
}

/// A curve of a plot.
pub struct Curve {
    /// Name in the legend.
    pub name: String,
    /// Points in order.
    pub points: Vec<(f64, f64)>,
    /// Whether points are drawn, in the color of the curve before, instead of a line.
    pub dots: bool,
}

/// A map: cells by row and column, each with a mark and a shade.
pub struct Grid {
    /// Above it.
    pub title: String,
    /// Name and levels of the columns.
    pub x: (String, Vec<String>),
    /// Name and levels of the rows, from above.
    pub y: (String, Vec<String>),
    /// Rows of marks, and how well that is: 1 good, 0 bad.
    pub cells: Vec<Vec<(String, f64)>>,
}

/// Pictures beside one another.
pub struct Picture {
    /// Name of the file, without the experiment's.
    pub name: String,
    /// Under it.
    pub title: String,
    /// Panels in a row.
    pub columns: usize,
    /// The panels, row by row.
    pub panels: Vec<Panel>,
}

/// One picture.
pub struct Panel {
    /// What it shows.
    pub label: String,
    /// Threads.
    pub tubes: Vec<Tube>,
    /// What they touch.
    pub solids: Vec<Solid>,
    /// Direction in which one looks, and the one that is up.
    pub look: (DVec3, DVec3),
    /// Point in the middle and width of the picture \[m\]; as it fits, where there is none.
    pub frame: Option<(DVec3, f64)>,
}

/// A thread to draw.
pub struct Tube {
    /// Its centerline \[m\].
    pub points: Vec<DVec3>,
    /// Its radius \[m\].
    pub radius: f64,
}

/// A shape to draw.
pub struct Solid {
    /// In its own frame.
    pub geometry: Geometry,
    /// Where it is.
    pub pose: Pose,
}

impl Table {
    /// A table that the page shows, without rows.
    pub fn new(name: &str, title: &str, headings: &[&str]) -> Table {
        let headings = headings.iter().map(|h| (*h).to_string()).collect();
        Table { name: name.into(), title: title.into(), headings, rows: Vec::new(), measured: false, shown: true }
    }
    /// One of times.
    pub fn measured(self) -> Table {
        Table { measured: true, ..self }
    }
    /// One that is too long for the page.
    pub fn hidden(self) -> Table {
        Table { shown: false, ..self }
    }
    /// Adds a row.
    pub fn row(&mut self, cells: impl IntoIterator<Item = Cell>) {
        self.rows.push(cells.into_iter().collect());
    }
    /// As comma-separated text. Numbers are written so that they read back as they are.
    pub fn csv(&self) -> String {
        let quoted = |t: &str| {
            if t.contains([',', '"', '\n']) { format!("\"{}\"", t.replace('"', "\"\"")) } else { t.to_string() }
        };
        let line = |cells: Vec<String>| cells.join(",") + "\n";
        let cell = |c: &Cell| match c {
            Cell::Word(w) => quoted(w),
            Cell::Number(v) if v.is_finite() => format!("{v}"),
            Cell::Number(_) => String::new(),
        };
        let head = line(self.headings.iter().map(|h| quoted(h)).collect());
        self.rows.iter().fold(head, |text, row| text + &line(row.iter().map(cell).collect()))
    }
}

impl From<f64> for Cell {
    fn from(v: f64) -> Cell {
        Cell::Number(v)
    }
}

impl From<usize> for Cell {
    fn from(v: usize) -> Cell {
        Cell::Number(v as f64)
    }
}

impl From<u32> for Cell {
    fn from(v: u32) -> Cell {
        Cell::Number(v.into())
    }
}

impl From<&str> for Cell {
    fn from(v: &str) -> Cell {
        Cell::Word(v.into())
    }
}

impl From<String> for Cell {
    fn from(v: String) -> Cell {
        Cell::Word(v)
    }
}

impl Axis {
    /// A linear axis.
    pub fn new(name: &str, unit: &str) -> Axis {
        Axis { name: name.into(), unit: unit.into(), log: false }
    }
    /// A logarithmic one.
    pub fn log(name: &str, unit: &str) -> Axis {
        Axis { log: true, ..Axis::new(name, unit) }
    }
}

impl Plot {
    /// A plot without curves.
    pub fn new(name: &str, title: &str, x: Axis, y: Axis) -> Plot {
        Plot { name: name.into(), title: title.into(), x, y, curves: Vec::new(), marks: Vec::new(), measured: false }
    }
    /// Adds a line.
    pub fn line(&mut self, name: impl Into<String>, points: Vec<(f64, f64)>) {
        self.curves.push(Curve { name: name.into(), points, dots: false });
    }
    /// Adds dots, in the color of the curve before.
    pub fn dots(&mut self, name: impl Into<String>, points: Vec<(f64, f64)>) {
        self.curves.push(Curve { name: name.into(), points, dots: true });
    }
}

impl Check {
    /// One that does not hang on times.
    pub fn new(what: impl Into<String>, bar: impl Into<String>, found: impl Into<String>, passed: bool) -> Check {
        Check { what: what.into(), bar: bar.into(), found: found.into(), passed, measured: false }
    }
    /// One that does.
    pub fn measured(self) -> Check {
        Check { measured: true, ..self }
    }
}

impl Outcome {
    /// Adds a paragraph.
    pub fn say(&mut self, text: impl AsRef<str>) {
        if !self.text.is_empty() {
            self.text.push_str("\n\n");
        }
        self.text.push_str(text.as_ref());
    }
}
