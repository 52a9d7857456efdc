//! Which knots hold: a knot tied loosely around a post in two halves is drawn to a force by its tails and let go; then
//! the halves of the post load its loop.

use crate::case::{Budget, assignments};
use crate::curve::Stack;
use crate::map;
use crate::run::{ENDED, NOT_FINISHED, Study};
use crate::session::quantile;
use crate::table::{Table, markdown};
use crate::tie::{FRAME, Spec, Tied};
use anyhow::Context as _;
use std::path::Path;
use sutura::{Material, Plasticity, Shear};
use sutura_scene::presets;

/// The study.
pub struct Hold;

/// A thread of the study: name, material preset, whether bends and twist become permanent.
const THREADS: [(&str, &str, bool); 4] = [
    ("silk", "silk", false),
    ("silk-set", "silk", true),
    ("monofilament", "polypropylene", false),
    ("monofilament-set", "polypropylene", true),
];
/// A knot of the study: name and half twists of its throws.
const KNOTS: [(&str, &[i32]); 4] =
    [("square", &[3, -3]), ("granny", &[3, 3]), ("surgeon", &[5, -3]), ("square+throw", &[3, -3, 3])];
/// Coefficients of friction of thread on thread.
const MU: [f64; 8] = [0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5];
/// Forces on the tails \[N\].
const DRAW: [f64; 3] = [0.5, 1.0, 2.0];

/// 3-0, as the scene square_knot.
const SIZE: &str = "3-0";
/// Plastic set and damping as the scene square_knot; unverified. The same set for both materials: a strain of 5.6 % at
/// the surface.
const SET: Plasticity = Plasticity { yield_curvature: 500.0, yield_twist: 500.0, hardening: 0.02 };
const BEND_DAMPING: f64 = 0.01;
/// Radius of the halves of the post, and length of a tail before the draw \[m\].
const POST: f64 = 2e-3;
const TAIL: f64 = 8e-3;
/// Speed at which half a post is pushed when nothing resists \[m/s\].
const PUSH_SPEED: f64 = 0.005;
/// Load on the loop \[N\].
const LOAD: f64 = 1.0;
/// How long the phases under load are \[s\].
const RAMP: f64 = 1.0;
const SETTLE: f64 = 1.0;
const HOLD: f64 = 3.0;
/// Slip in the hold under which a knot holds \[m\].
const HOLDS: f64 = 1e-4;
/// Load from which on the loop counts as taut \[N\].
const TAUT: f64 = 0.05;
/// Growth of the taut loop beyond which a knot has failed \[m\]. A knot drawn in one go still tightens under the first
/// load, by up to 1.8 mm in the cases seen; it holds less than 6 mm of thread.
const FAILED: f64 = 5e-3;
/// Growth of a loop that never was taut at which it has failed too: more than it was slack.
const FAILED_SLACK: f64 = 8e-3;
/// A case: indices into the lists above, and numbers. What is not a factor of the study has a default.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Case {
    thread: usize,
    knot: usize,
    mu: f64,
    draw: f64,
    /// Element length in diameters. With 2, as in the scene, the solver does not come to rest under the load.
    element: f64,
    /// Longest substep \[s\].
    substep: f64,
}

impl Default for Case {
    fn default() -> Self {
        Case { thread: 1, knot: 0, mu: 0.3, draw: 1.0, element: 1.0, substep: 1.0 / 240.0 }
    }
}

impl Case {
    /// A case from `key=value` pairs; `l` is the element length in diameters, `substep` the number of substeps a
    /// second.
    pub fn parse(text: &str) -> anyhow::Result<Case> {
        let mut case = Case::default();
        for (key, value) in assignments(text)? {
            let number = || value.parse::<f64>().with_context(|| format!("{key}: `{value}` is no number"));
            let no_such = || format!("there is no {key} `{value}`");
            match key.as_str() {
                "thread" => case.thread = THREADS.iter().position(|t| t.0 == value).with_context(no_such)?,
                "knot" => case.knot = KNOTS.iter().position(|k| k.0 == value).with_context(no_such)?,
                "mu" => case.mu = number()?,
                "draw" => case.draw = number()?,
                "l" => case.element = number()?,
                "substep" => case.substep = 1.0 / number()?,
                _ => anyhow::bail!("there is no `{key}`; there are thread, knot, draw, mu, l, substep"),
            }
        }
        Ok(case)
    }

    fn spec(&self) -> Result<Spec, String> {
        let (_, material, set) = THREADS[self.thread];
        let preset = presets::find_material(material).map_err(|e| e.to_string())?;
        let diameter = presets::find_size(SIZE).map_err(|e| e.to_string())?.diameter.value;
        let material = Material {
            young_modulus: preset.young_modulus.value,
            shear: Shear::Poisson(preset.poisson_ratio.value),
            density: preset.density.value,
            bend_scale: preset.bend_scale.value,
            bend_damping: BEND_DAMPING,
            plasticity: set.then_some(SET),
        };
        let stack = Stack { diameter, post: POST, throws: KNOTS[self.knot].1.to_vec(), tail: TAIL };
        Ok(Spec { material, stack, mu: self.mu, element: self.element, substep: self.substep })
    }
}

/// What was found.
#[derive(Debug, Default)]
struct Found {
    /// How it ended.
    ended: String,
    /// Knots before the draw, after it, and after it was let go.
    knots: [String; 3],
    /// Force on the loop after the tails were let go, and the largest after that \[N\].
    residual: f64,
    peak: f64,
    /// Growth of the loop since it was taut, the end of the hold against its beginning, and the slip of the entries in
    /// the hold \[m\].
    growth: f64,
    growth_hold: Option<f64>,
    slip_hold: Option<f64>,
}

/// A case being run.
struct Bench<'a> {
    tied: Tied<'a>,
    found: Found,
    /// What `opened` was when the loop was let go, and when it was first taut under the load.
    let_go: f64,
    taut: Option<f64>,
}

impl Bench<'_> {
    /// Frames for this time. What made the knot fail, if it did.
    fn loaded(&mut self, what: &str, duration: f64, force: &dyn Fn(f64) -> f64) -> Result<Option<String>, String> {
        let frames = (duration / FRAME).round() as u32;
        for k in 1..=frames {
            self.tied.push(force(f64::from(k) / f64::from(frames)), PUSH_SPEED)?;
            self.tied.frame(what)?;
            let load = self.tied.load();
            self.found.peak = self.found.peak.max(load);
            let opened = self.tied.opened();
            if load >= TAUT {
                self.taut.get_or_insert(opened);
            }
            self.found.growth = opened - self.taut.unwrap_or(self.let_go);
            if self.tied.entries().is_none() {
                return Ok(Some(format!("opens at {:.2} N", self.found.peak)));
            }
            if self.found.growth > if self.taut.is_some() { FAILED } else { FAILED_SLACK } {
                return Ok(Some(format!("slips at {:.2} N", self.found.peak)));
            }
        }
        Ok(None)
    }

    /// The case to its end: how it ended.
    fn run(&mut self, case: &Case) -> Result<String, String> {
        self.found.knots[0] = self.tied.knot()?;
        self.found.knots[1] = self.tied.draw(case.draw)?;
        self.tied.rest()?;
        self.found.knots[2] = self.tied.knot()?;
        if self.tied.entries().is_none() || self.found.knots[2] != self.found.knots[0] {
            return Ok("opens when let go".into());
        }
        self.let_go = self.tied.opened();
        // The loop presses the halves together already; from that force to the load.
        self.found.residual = self.tied.load();
        let from = self.found.residual.clamp(0.0, LOAD);
        for (what, duration, force) in [
            ("loading", RAMP, &(|part| from + (LOAD - from) * part) as &dyn Fn(f64) -> f64),
            ("settling", SETTLE, &|_| LOAD),
        ] {
            if let Some(failed) = self.loaded(what, duration, force)? {
                return Ok(failed);
            }
        }
        let (marked, opened) = (self.tied.entries(), self.tied.opened());
        if let Some(failed) = self.loaded("holding", HOLD, &|_| LOAD)? {
            return Ok(failed);
        }
        let slip = marked.and_then(|marked| Some(self.tied.entries()?.slip_since(&marked)));
        (self.found.slip_hold, self.found.growth_hold) = (slip, Some(self.tied.opened() - opened));
        Ok(if slip.is_some_and(|slip| slip < HOLDS) {
            "holds".into()
        } else {
            format!("slips at {:.2} N", self.found.peak)
        })
    }
}

fn measure(case: &Case, budget: Budget, trace: &mut dyn FnMut(String)) -> Vec<String> {
    let tied = match case.spec().and_then(|spec| Tied::new(&spec, budget, trace)) {
        Ok(tied) => tied,
        Err(why) => {
            let mut row = vec![String::new(); Hold::MEASURES.len()];
            row[0] = format!("{NOT_FINISHED}{why}");
            return row;
        }
    };
    let mut bench = Bench { tied, found: Found::default(), let_go: 0.0, taut: None };
    let ended = bench.run(case);
    bench.found.ended = ended.unwrap_or_else(|why| {
        let f = &bench.found;
        let phase = match () {
            () if f.knots[1].is_empty() => format!("drawing, {:.2} N", bench.tied.drawn),
            () if f.knots[2].is_empty() => "let go".into(),
            () => format!("loading, {:.2} N, loop {:.3} mm longer", f.peak, 1e3 * f.growth),
        };
        format!("{NOT_FINISHED}{why}, at {:.3} s, {phase}", bench.tied.s.world.time())
    });
    let Bench { mut tied, found, .. } = bench;
    tied.say("end");
    let [before, drawn, free] = found.knots;
    let end = tied.knot().unwrap_or_default();
    let s = &tied.s;
    let (passes, _) = s.passes(f64::INFINITY);
    let row = vec![
        found.ended,
        format!("{:.3}", found.peak),
        found.slip_hold.map(|v| format!("{:.5}", 1e3 * v)).unwrap_or_default(),
        found.growth_hold.map(|v| format!("{:.5}", 1e3 * v)).unwrap_or_default(),
        format!("{:.4}", 1e3 * found.growth),
        format!("{:.3}", found.residual),
        format!("{:.3}", tied.drawn),
        before,
        drawn,
        free,
        end,
        passes.to_string(),
        s.clearance(),
        s.substeps.to_string(),
        s.rejected.to_string(),
        s.newton.to_string(),
        s.incidents.to_string(),
        s.first_incident.clone(),
        format!("{:.3}", s.world.time()),
        format!("{:.2}", quantile(&s.ms, 0.5)),
        format!("{:.2}", quantile(&s.ms, 0.99)),
        format!("{:.2}", s.solver_s()),
        format!("{:016x}", s.world.state_hash()),
    ];
    tied.tell(Hold::MEASURES.iter().zip(&row).map(|(m, v)| format!("{m} {v}")).collect::<Vec<_>>().join("; "));
    row
}

impl Study for Hold {
    type Case = Case;
    const NAME: &'static str = "hold";
    const FACTORS: &'static [&'static str] = &["thread", "knot", "draw", "mu"];
    const MEASURES: &'static [&'static str] = &[
        ENDED,
        "peak_n",
        "slip_hold_mm",
        "growth_hold_mm",
        "growth_mm",
        "residual_n",
        "drawn_n",
        "knot_before",
        "knot_drawn",
        "knot_free",
        "knot_end",
        "passes",
        "clearance",
        "substeps",
        "rejected",
        "newton",
        "incidents",
        "first_incident",
        "simulated_s",
        "ms_median",
        "ms_p99",
        "cpu_s",
        "state_hash",
    ];

    fn cases() -> Vec<Case> {
        let mut all = Vec::new();
        for thread in 0..THREADS.len() {
            for knot in 0..KNOTS.len() {
                for draw in DRAW {
                    all.extend(MU.map(|mu| Case { thread, knot, mu, draw, ..Case::default() }));
                }
            }
        }
        all
    }

    fn levels(case: &Case) -> Vec<String> {
        vec![THREADS[case.thread].0.into(), KNOTS[case.knot].0.into(), case.draw.to_string(), case.mu.to_string()]
    }

    fn run(case: &Case, budget: Budget, trace: &mut dyn FnMut(String)) -> Vec<String> {
        measure(case, budget, trace)
    }

    fn report(table: &Table, folder: &Path) -> anyhow::Result<String> {
        map::draw(&grids(table), &folder.join(Self::NAME))?;
        let mut out = String::from("# Which knots hold\n\n![Hold or slip](hold.png)\n");
        for grid in grids(table) {
            out.push_str(&format!("\n## {}\n\n", grid.title));
            let head: Vec<String> =
                std::iter::once(format!("draw [{}] \\ mu", "N")).chain(MU.map(|m| m.to_string())).collect();
            let head: Vec<&str> = head.iter().map(String::as_str).collect();
            let rows = DRAW.iter().zip(&grid.cells).map(|(draw, cells)| {
                std::iter::once(draw.to_string()).chain(cells.iter().map(map::Cell::words)).collect()
            });
            out.push_str(&markdown(&head, rows));
        }
        let mm = |row: &[String], name: &str| table.number(row, name).map(|v| 1e-3 * v.abs());
        let apart = |r: &&Vec<String>| {
            mm(r, "slip_hold_mm")
                .zip(mm(r, "growth_hold_mm"))
                .is_some_and(|(slip, growth)| (slip < HOLDS) != (growth < HOLDS))
        };
        let n_apart = table.rows.iter().filter(apart).count();
        out.push_str(&format!("\nIn {n_apart} cases the slip of the entries in the hold and the growth of the loop are not on the same side of 0.1 mm.\n"));
        out.push_str("\n## Every case\n\n");
        let all: Vec<&str> = Self::FACTORS
            .iter()
            .chain(Self::MEASURES)
            .copied()
            .filter(|c| !["first_incident", "state_hash"].contains(c))
            .collect();
        out.push_str(&table.markdown(&all));
        Ok(out)
    }
}

/// One map for each thread and knot: rows by draw, columns by mu.
fn grids(table: &Table) -> Vec<map::Grid> {
    let cell = |case: &Case| {
        let levels = Hold::levels(case);
        let Some(row) = table.rows.iter().find(|r| r[..levels.len()] == levels[..]) else { return map::Cell::Missing };
        let peak = table.number(row, "peak_n").unwrap_or(0.0);
        match table.text(row, ENDED) {
            "holds" => map::Cell::Holds,
            ended if ended.starts_with("slips") => map::Cell::Slips(peak),
            ended if ended.starts_with("opens") => map::Cell::Opens(peak),
            _ => map::Cell::NotFinished,
        }
    };
    let mut all = Vec::new();
    for (thread, (thread_name, ..)) in THREADS.iter().enumerate() {
        for (knot, (knot_name, _)) in KNOTS.iter().enumerate() {
            let cells = DRAW
                .map(|draw| MU.map(|mu| cell(&Case { thread, knot, mu, draw, ..Case::default() })).to_vec())
                .to_vec();
            let title = format!("{thread_name}, {knot_name}");
            all.push(map::Grid {
                title,
                x: ("mu".into(), MU.map(|m| m.to_string()).to_vec()),
                y: ("draw [N]".into(), DRAW.map(|d| d.to_string()).to_vec()),
                cells,
            });
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_study_has_each_case_once_and_each_knot_is_tied() {
        let mut all: Vec<Vec<String>> = Hold::cases().iter().map(Hold::levels).collect();
        assert_eq!(all.len(), THREADS.len() * KNOTS.len() * DRAW.len() * MU.len());
        all.sort();
        all.dedup();
        assert_eq!(all.len(), Hold::cases().len());
        for (knot, want) in
            ["square", "granny-right", "surgeon-square-right", "square-and-throw-right"].into_iter().enumerate()
        {
            let spec = Case { knot, ..Case::default() }.spec().unwrap();
            let tied = Tied::new(&spec, Budget { cpu_s: 1e3, frames: 1 }, &mut |_| {}).map(|t| t.knot());
            assert_eq!(tied, Ok(Ok(want.to_string())));
        }
    }

    #[test]
    fn a_case_over_budget_says_where_it_stood() {
        let row = measure(&Case::default(), Budget { cpu_s: 1e3, frames: 2 }, &mut |_| {});
        assert_eq!(row.len(), Hold::MEASURES.len());
        assert!(row[0].starts_with("not finished: over 2 frames, at 0.033 s, drawing"), "{}", row[0]);
        assert_eq!(row[7], "square");
    }
}
