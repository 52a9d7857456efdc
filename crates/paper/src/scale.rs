//! The verdict on scale: where the published method keeps its length, over size, substeps, iterations and elements; and
//! the same for the direct solver.

use crate::helix::{Fall, direct, fall, paper};
use crate::measure::percent;
use crate::method::Method;
use crate::outcome::{Check, Grid, Outcome, Table};
use crate::plan::{Experiment, Plan};

pub const EXPERIMENT: Experiment = Experiment { name: "scale", title: "The verdict on scale", figures: "", plan };

const SIZES: [f64; 3] = [0.15, 1.5, 15.0];
const SUBSTEPS: [u32; 5] = [1, 2, 4, 8, 16];
const ITERATIONS: [u32; 4] = [5, 10, 20, 40];
const NEWTON: [u32; 4] = [1, 2, 4, 12];
const ELEMENTS: [usize; 4] = [30, 60, 120, 240];
/// Iterations while elements vary, and the other way round.
const AT: (u32, usize) = (20, 120);
/// The published bound.
const BOUND: f64 = 0.032;

#[derive(Clone)]
struct Case {
    size: f64,
    substeps: u32,
    iterations: u32,
    n: usize,
    ours: bool,
}

fn plan() -> Plan {
    let mut cases = Vec::new();
    for ours in [false, true] {
        let (budgets, at) = if ours { (NEWTON, 12) } else { (ITERATIONS, AT.0) };
        for size in SIZES {
            for substeps in SUBSTEPS {
                cases.extend(budgets.map(|iterations| Case { size, substeps, iterations, n: AT.1, ours }));
                cases.extend(ELEMENTS.into_iter().filter(|n| *n != AT.1).map(|n| Case {
                    size,
                    substeps,
                    iterations: at,
                    n,
                    ours,
                }));
            }
        }
    }
    let method =
        |c: &Case| if c.ours { direct(c.substeps, c.iterations) } else { paper(c.iterations, true, c.substeps) };
    let label = move |c: &Case| format!("{}, {} elements, {} m", describe(&method(c)), c.n, c.size);
    Plan::new(cases, label, move |c| fall(&method(c), c.size, c.n), finish)
}

fn describe(m: &Method) -> String {
    format!("{}, {}", m.name(), m.budget())
}

fn finish(found: &[(Case, Fall)]) -> Outcome {
    let mut out = Outcome::default();
    let at = |ours: bool, size: f64, substeps: u32, iterations: u32, n: usize| {
        let same = |c: &Case| {
            c.ours == ours && c.size == size && c.substeps == substeps && c.iterations == iterations && c.n == n
        };
        &found.iter().find(|(c, _)| same(c)).expect("it was run").1
    };
    let rows: Vec<(f64, u32)> = SIZES.into_iter().flat_map(|size| SUBSTEPS.map(|s| (size, s))).collect();
    let mark = |f: &Fall| {
        let words = if f.diverged() { "diverges".into() } else { percent(f.worst) };
        (
            words,
            if f.diverged() {
                0.0
            } else if f.worst > BOUND {
                0.5
            } else {
                1.0
            },
        )
    };
    let grid = |title: &str, name: &str, levels: Vec<String>, cell: &dyn Fn(f64, u32, usize) -> (String, f64)| Grid {
        title: title.into(),
        x: (name.into(), levels),
        y: ("length, substeps a frame".into(), rows.iter().map(|(size, s)| format!("{size} m, {s}")).collect()),
        cells: rows.iter().map(|(size, s)| (0..4).map(|k| cell(*size, *s, k)).collect()).collect(),
    };
    let words = |v: &[u32]| v.iter().map(u32::to_string).collect::<Vec<_>>();
    let counts = || ELEMENTS.iter().map(usize::to_string).collect::<Vec<_>>();
    out.grids = vec![
        grid("paper with DDC, 120 elements", "iterations", words(&ITERATIONS), &|size, s, k| {
            mark(at(false, size, s, ITERATIONS[k], AT.1))
        }),
        grid("paper with DDC, 20 iterations", "elements", counts(), &|size, s, k| {
            mark(at(false, size, s, AT.0, ELEMENTS[k]))
        }),
        grid("direct, 120 elements", "Newton iterations allowed", words(&NEWTON), &|size, s, k| {
            mark(at(true, size, s, NEWTON[k], AT.1))
        }),
        grid("direct, 12 Newton iterations allowed", "elements", counts(), &|size, s, k| {
            mark(at(true, size, s, 12, ELEMENTS[k]))
        }),
    ];
    let mut table = Table::new(
        "falls",
        "All falls",
        &[
            "method",
            "length [m]",
            "elements",
            "substeps a frame",
            "iterations",
            "greatest elongation",
            "g h^2 over the length of an element",
        ],
    )
    .hidden();
    for (c, f) in found {
        table.row([
            if c.ours { "direct" } else { "paper" }.into(),
            c.size.into(),
            c.n.into(),
            c.substeps.into(),
            c.iterations.into(),
            f.worst.into(),
            way(c).into(),
        ]);
    }
    let ours = found.iter().filter(|(c, _)| c.ours).map(|(_, f)| f.worst).fold(0.0, f64::max);
    let n_ours = found.iter().filter(|(c, _)| c.ours).count();
    out.checks.push(Check::new(
        "direct keeps the length at every size, substep, budget and number of elements",
        "<= 0.001 %",
        format!("at most {} in {n_ours} falls", percent(ours)),
        ours <= 1e-5,
    ));
    // What decides: the way that gravity moves a point in a step, over the length of an element and by iterations.
    let paper: Vec<(f64, &Fall)> = found.iter().filter(|(c, _)| !c.ours).map(|(c, f)| (way(c), f)).collect();
    let kept = paper.iter().filter(|(_, f)| f.worst <= BOUND).map(|p| p.0).fold(0.0, f64::max);
    let lost = paper.iter().filter(|(_, f)| f.diverged()).map(|p| p.0).fold(f64::INFINITY, f64::min);
    let (n_kept, n_lost) =
        (paper.iter().filter(|(_, f)| f.worst <= BOUND).count(), paper.iter().filter(|(_, f)| f.diverged()).count());
    out.say(format!(
        "The fall of figure 13 over size, substeps, iterations and number of elements: the greatest elongation in 5 s, green up to the published 3.2 %, yellow above, red where the thread becomes more than \
         twice as long or is lost. Of {} falls the published method keeps {n_kept} and loses {n_lost}. What decides is g h^2 / l, how far gravity moves a point in a step over the length of an element: every fall \
         that is lost has more than {}, every one that is kept less than {}; more iterations move the border, but at true scale and one step a frame (g h^2 / l = {}) no number of those published is enough. The \
         remedy inside the method is the substep: its cost grows by as much. `direct` keeps its length everywhere, from one substep a frame on.",
        paper.len(),
        crate::measure::number(lost),
        crate::measure::number(kept),
        crate::measure::number(9.81 / 3600.0 / (0.15 / 120.0)),
    ));
    out.tables.push(table);
    out
}

/// How far gravity moves a point in a step, over the length of an element.
fn way(c: &Case) -> f64 {
    let h = 1.0 / (60.0 * f64::from(c.substeps));
    9.81 * h * h / (c.size / c.n as f64)
}
