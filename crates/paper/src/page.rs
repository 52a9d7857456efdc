//! One page of all that was found, as Markdown.

use crate::measure::number;
use crate::outcome::{Cell, Table};
use crate::plan::Result;
use std::fmt::Write as _;

/// The page. `made` says when and where; `file` gives the place of a picture by experiment and name.
pub fn page(results: &[Result], made: &str, file: &dyn Fn(&str, &str) -> String) -> String {
    let checks = || results.iter().flat_map(|r| &r.outcome.checks);
    let (n, ok) = (checks().count(), checks().filter(|c| c.passed).count());
    let mut out = format!(
        "# The paper, reproduced\n\nWritten by `sutura paper`; nothing here is written by hand. {made} {n} things asked for, {ok} found as asked, {} not.\n\n\
         The paper is \"Real-time inextensible surgical thread simulation\" (Int. J. CARS 13:1019, 2018). *Paper* is its solver as published (what was changed and why: \
         theory 17), *direct* is Sutura's own, *DER* are discrete elastic rods, *PBER* position-based elastic rods with ghost points, *PBD* distances between neighbors and second neighbors, each \
         implemented from its paper. *Effective scale* is the size at which the published numbers come out, 15 m for 15 cm; *true scale* is the size that the paper names. The numbers do not depend on \
         the machine, but for times.\n\n",
        n - ok
    );
    let compares: Vec<_> = results.iter().flat_map(|r| &r.outcome.compare).collect();
    if !compares.is_empty() {
        out.push_str("| figure | the paper reports | `paper`, effective scale | `paper`, true scale | `direct`, true scale |\n|---|---|---|---|---|\n");
        for c in compares {
            let _ =
                writeln!(out, "| {} | {} | {} | {} | {} |", c.what, c.published, c.effective, c.true_scale, c.direct);
        }
        out.push('\n');
    }
    for r in results {
        let _ = write!(out, "## {}\n\n{}\n\n", heading(r), r.outcome.text);
        if !r.outcome.checks.is_empty() {
            out.push_str("| asked for | bar | found | |\n|---|---|---|---|\n");
            for c in &r.outcome.checks {
                let _ = writeln!(
                    out,
                    "| {} | {} | {} | {} |",
                    c.what,
                    c.bar,
                    c.found,
                    if c.passed { "yes" } else { "**NO**" }
                );
            }
            out.push('\n');
        }
        for p in &r.outcome.pictures {
            let _ = write!(out, "![{}]({})\n\n", p.title, file(r.name, &format!("{}.png", p.name)));
            let _ = write!(out, "*{}.*\n\n", p.title);
        }
        for p in &r.outcome.plots {
            let _ = write!(out, "![{}]({})\n\n", p.title, file(r.name, &format!("{}.svg", p.name)));
        }
        if !r.outcome.grids.is_empty() {
            let _ = write!(out, "![{}]({})\n\n", r.outcome.grids[0].title, file(r.name, "map.svg"));
        }
        for t in r.outcome.tables.iter().filter(|t| t.shown) {
            let _ = write!(out, "{}\n\n", table(t));
        }
    }
    out
}

/// Name of a section: that of the published figures, if there are some.
fn heading(r: &Result) -> String {
    if r.figures.is_empty() { r.title.into() } else { format!("Figure {}. {}", r.figures, r.title) }
}

/// A table as Markdown.
pub fn table(t: &Table) -> String {
    let mut out = format!("**{}**{}\n\n", t.title, if t.measured { " (measured)" } else { "" });
    let numbers = |column: usize| t.rows.iter().all(|r| matches!(r.get(column), Some(Cell::Number(_))));
    let _ = writeln!(out, "| {} |", t.headings.join(" | "));
    let rule: Vec<&str> = (0..t.headings.len()).map(|c| if numbers(c) { "---:" } else { "---" }).collect();
    let _ = writeln!(out, "|{}|", rule.join("|"));
    for row in &t.rows {
        let cells: Vec<String> = row
            .iter()
            .map(|c| match c {
                Cell::Word(w) => w.clone(),
                Cell::Number(v) => number(*v),
            })
            .collect();
        let _ = writeln!(out, "| {} |", cells.join(" | "));
    }
    out
}
