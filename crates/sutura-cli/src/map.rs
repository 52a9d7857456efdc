//! Maps of marks by row and column, as SVG and PNG.

use crate::output::put;
use crate::plot::{PNG_SCALE, rasterize};
use std::fmt::Write as _;
use std::path::Path;
use sutura_paper::Grid;

/// A cell, the room left of a map, above it, under it, in pixels.
const CELL: (f64, f64) = (64.0, 24.0);
const LEFT: f64 = 110.0;
const TOP: f64 = 44.0;
const UNDER: f64 = 52.0;
/// Maps beside one another.
const ACROSS: usize = 2;

/// Writes `<stem>.svg` and `<stem>.png`.
pub fn write(grids: &[Grid], stem: &Path) -> anyhow::Result<()> {
    let (columns, rows) = grids.iter().fold((1, 1), |a, g| (a.0.max(g.x.1.len()), a.1.max(g.y.1.len())));
    let panel = (LEFT + columns as f64 * CELL.0 + 16.0, TOP + rows as f64 * CELL.1 + UNDER);
    let across = ACROSS.min(grids.len().max(1));
    let size = (panel.0 * across as f64, panel.1 * grids.len().div_ceil(across) as f64);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\" font-family=\"DejaVu Sans, sans-serif\" fill=\"#373c44\">\n\
         <rect width=\"{w}\" height=\"{h}\" fill=\"#fff\"/>\n",
        w = size.0,
        h = size.1
    );
    for (k, grid) in grids.iter().enumerate() {
        draw(&mut svg, grid, (LEFT + panel.0 * (k % across) as f64, TOP + panel.1 * (k / across) as f64));
    }
    svg.push_str("</svg>\n");
    put(&stem.with_extension("svg"), svg.as_bytes())?;
    rasterize(&svg, (size.0 as u32, size.1 as u32), PNG_SCALE)?.write(&stem.with_extension("png"))
}

fn draw(svg: &mut String, grid: &Grid, (left, top): (f64, f64)) {
    let (columns, rows) = (grid.x.1.len() as f64, grid.y.1.len() as f64);
    text(svg, (left + 0.5 * columns * CELL.0, top - 22.0), 13, "middle", "", &grid.title);
    for (row, cells) in grid.cells.iter().enumerate() {
        for (column, (mark, good)) in cells.iter().enumerate() {
            let (x, y) = (left + column as f64 * CELL.0, top + row as f64 * CELL.1);
            let _ = writeln!(
                svg,
                "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"{}\"/>",
                x + 1.0,
                y + 1.0,
                CELL.0 - 2.0,
                CELL.1 - 2.0,
                shade(*good)
            );
            text(svg, (x + 0.5 * CELL.0, y + 0.5 * CELL.1 + 4.0), 10, "middle", "", mark);
        }
    }
    let bottom = top + rows * CELL.1;
    for (column, level) in grid.x.1.iter().enumerate() {
        text(svg, (left + (column as f64 + 0.5) * CELL.0, bottom + 14.0), 10, "middle", "", level);
    }
    for (row, level) in grid.y.1.iter().enumerate() {
        text(svg, (left - 6.0, top + (row as f64 + 0.5) * CELL.1 + 4.0), 10, "end", "", level);
    }
    text(svg, (left + 0.5 * columns * CELL.0, bottom + 32.0), 11, "middle", "", &grid.x.0);
    let (x, y) = (left - 92.0, top + 0.5 * rows * CELL.1);
    text(svg, (x, y), 11, "middle", &format!(" transform=\"rotate(-90 {x} {y})\""), &grid.y.0);
}

fn text(svg: &mut String, (x, y): (f64, f64), size: u32, anchor: &str, more: &str, text: &str) {
    let escaped = text.replace('&', "&amp;").replace('<', "&lt;");
    let _ =
        writeln!(svg, "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\" text-anchor=\"{anchor}\"{more}>{escaped}</text>");
}

/// From red (0) over yellow to green (1).
fn shade(good: f64) -> String {
    let stops = [[225.0, 120.0, 110.0], [245.0, 205.0, 120.0], [120.0, 190.0, 130.0]];
    let at = 2.0 * good.clamp(0.0, 1.0);
    let (k, part) = if at < 1.0 { (0, at) } else { (1, at - 1.0) };
    let [r, g, b] = [0, 1, 2].map(|c| (stops[k][c] + part * (stops[k + 1][c] - stops[k][c])).round());
    format!("rgb({r},{g},{b})")
}
