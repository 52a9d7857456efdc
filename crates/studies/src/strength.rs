//! How strong a knot is: tied, drawn to a pretension and let go, then its loop is pulled apart until a tail slips, the
//! knot comes undone, or the tension passes what the thread bears with a knot in it.
//!
//! The pull is one of displacement: the halves of the post part at a steady speed, so that the force is an outcome,
//! also past its peak.

use crate::case::Budget;
use crate::curve::Stack;
use crate::run::NOT_FINISHED;
use crate::table::{Table, markdown};
use crate::tie::{FRAME, Spec, Tied};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use sutura::knot::{Entries, Form, KnotType};
use sutura::{Material, Plasticity};

/// A sequence of throws.
#[derive(Debug, Clone, PartialEq)]
pub struct Throws {
    /// As it was written.
    pub name: String,
    /// Half twists of each throw, the first one next to the loop; odd, positive is right-handed.
    pub half_twists: Vec<i32>,
}

/// Sequences with a name, in the notation of [`Throws::parse`].
pub const NAMED: [(&str, &str); 7] = [
    ("square", "1=1"),
    ("granny", "1x1"),
    ("surgeon", "2=1"),
    ("surgeon-granny", "2x1"),
    ("square+throw", "1=1=1"),
    ("granny+throw", "1x1x1"),
    ("surgeon+throw", "2=1=1"),
];

impl Throws {
    /// A name of [`NAMED`], or throws from the first to the last in the notation of surgeons: 1 is a single throw, 2 a
    /// double one, `=` before a throw that mirrors the one before, `x` before one of the same hand. The first is
    /// right-handed.
    pub fn parse(text: &str) -> Result<Throws, String> {
        let text = text.trim();
        let wanted = || {
            let names: Vec<&str> = NAMED.iter().map(|n| n.0).collect();
            format!(
                "`{text}` is no sequence of throws: {}, or such as 2=1=1 (digits 1 to 4; `=` mirrors, `x` repeats)",
                names.join(", ")
            )
        };
        let code = NAMED.iter().find(|n| n.0 == text).map_or(text, |n| n.1);
        let (mut half_twists, mut hand) = (Vec::new(), 1);
        for (k, c) in code.chars().enumerate() {
            match (k % 2, c) {
                (0, '1'..='4') => half_twists.push(hand * (2 * (c as i32 - '0' as i32) + 1)),
                (1, '=') => hand = -hand,
                (1, 'x') => {}
                _ => return Err(wanted()),
            }
        }
        // A text of even length, the empty one too, has no last throw.
        if code.len() % 2 == 1 { Ok(Throws { name: text.into(), half_twists }) } else { Err(wanted()) }
    }
}

/// A case.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// Material of the thread.
    pub material: Material,
    /// Its diameter \[m\].
    pub diameter: f64,
    /// Tension that it bears with a knot in it \[N\].
    pub strength: f64,
    /// The knot.
    pub throws: Throws,
    /// Friction of thread on thread.
    pub mu: f64,
    /// Force with which the tails are drawn \[N\].
    pub pretension: f64,
    /// Length of tail drawn through the knot at which it counts as slipping, in diameters.
    pub slip: f64,
}

/// Kelvin-Voigt relaxation time of bending and twist \[s\], as the scene square_knot; unverified.
pub const BEND_DAMPING: f64 = 0.01;

/// Plastic set of a thread of this diameter \[m\]: that of the scene square_knot, a strain of 5.6 % at the surface;
/// unverified.
pub fn set(diameter: f64) -> Plasticity {
    let yields = 0.05625 / (0.5 * diameter);
    Plasticity { yield_curvature: yields, yield_twist: yields, hardening: 0.02 }
}

/// Radius of the post and length of a tail before the draw, in diameters: what `hold` has with a 3-0 thread.
const POST: f64 = 9.0;
const TAIL: f64 = 20.0;
/// Length of tail drawn through at which a knot usually counts as slipping, in diameters: the 1.8 mm of Silver's tests
/// with 3-0 thread. A knot that was drawn in one go draws in some of it while it tightens under the first of the load.
pub const SLIP: f64 = 8.0;
/// Rate at which the loop gets longer while it is pulled, in diameters a second, and by how much at most, in diameters:
/// more than the tails of a knot hold after the draw.
const PULL_RATE: f64 = 30.0;
const PULL_LONGEST: f64 = 180.0;
/// Force behind the pull over twice the strength of the thread: the speed falls by no more than one part in this before
/// the thread breaks.
const PULL_FORCE: f64 = 20.0;
/// Frames from one recognition of the knot to the next while it is pulled. Its entries are looked for in every frame.
const RECOGNIZE: u32 = 6;

/// How a pull ended.
#[derive(Debug, Clone, PartialEq)]
pub enum Ended {
    /// The tension passed the strength of the thread, and no tail had slipped.
    Breaks,
    /// The same after a tail had slipped.
    SlipsThenBreaks,
    /// The knot came undone.
    ComesUndone,
    /// It slipped as far as the pull went, and was a knot still.
    Slips,
    /// It was none when the tails were let go.
    OpensWhenLetGo,
    /// It was given up: why and where.
    NotFinished(String),
}

impl Ended {
    /// In words.
    pub fn words(&self) -> String {
        match self {
            Ended::Breaks => "breaks before it slips".into(),
            Ended::SlipsThenBreaks => "slips, then breaks".into(),
            Ended::ComesUndone => "comes undone".into(),
            Ended::Slips => "slips".into(),
            Ended::OpensWhenLetGo => "opens when let go".into(),
            Ended::NotFinished(why) => format!("{NOT_FINISHED}{why}"),
        }
    }
}

/// What was found. Forces on the loop are those on one half of the post, which two strands carry \[N\].
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// How it ended.
    pub ended: Ended,
    /// Force that both tails reached.
    pub drawn: f64,
    /// After the tails were let go: mean tension of the loop, force on the post, and how the knot lay.
    pub loop_tension: Option<f64>,
    /// See `loop_tension`.
    pub residual: f64,
    /// See `loop_tension`.
    pub form: Option<Form>,
    /// Greatest force until a tail had slipped, or until the end where none did.
    pub held: f64,
    /// Whether a tail slipped, and by how much the loop was longer then \[m\].
    pub slipped: Option<f64>,
    /// How it lay when a tail slipped, or at the end.
    pub form_held: Option<Form>,
    /// Greatest force until the end.
    pub peak: f64,
    /// Greatest tension of the thread at the end of a frame of the pull.
    pub tension: f64,
    /// By how much the loop was longer at the end \[m\].
    pub growth: f64,
    /// Recognized knot before the draw, after it was let go, and at the end.
    pub knots: [String; 3],
    /// Passages through anything, by the audit.
    pub passes: usize,
    /// Least clearance of thread from thread \[diameters\]; empty when nothing came near.
    pub clearance: String,
    /// Incidents of the solver.
    pub incidents: u64,
    /// Simulated time \[s\], and CPU time of the solver \[s\].
    pub simulated: f64,
    /// See `simulated`.
    pub cpu: f64,
    /// Hash of the last state.
    pub state_hash: u64,
    /// The pull, frame by frame: growth of the loop \[m\], force on it \[N\], slip of the tails \[m\].
    pub pull: Vec<[f64; 3]>,
}

impl Case {
    fn spec(&self) -> Spec {
        let d = self.diameter;
        let stack = Stack { diameter: d, post: POST * d, throws: self.throws.half_twists.clone(), tail: TAIL * d };
        Spec { material: self.material.clone(), stack, mu: self.mu, element: 1.0, substep: 1.0 / 240.0 }
    }

    /// Runs it. `trace` takes lines that say how it goes.
    pub fn run(&self, budget: Budget, trace: &mut dyn FnMut(String)) -> Found {
        let mut found = Found {
            ended: Ended::Slips,
            drawn: 0.0,
            loop_tension: None,
            residual: 0.0,
            form: None,
            held: 0.0,
            slipped: None,
            form_held: None,
            peak: 0.0,
            tension: 0.0,
            growth: 0.0,
            knots: Default::default(),
            passes: 0,
            clearance: String::new(),
            incidents: 0,
            simulated: 0.0,
            cpu: 0.0,
            state_hash: 0,
            pull: Vec::new(),
        };
        let mut tied = match Tied::new(&self.spec(), budget, trace) {
            Ok(tied) => tied,
            Err(why) => return Found { ended: Ended::NotFinished(why), ..found },
        };
        found.ended = self
            .pull_apart(&mut tied, &mut found)
            .unwrap_or_else(|why| Ended::NotFinished(format!("{why}, at {:.3} s", tied.s.world.time())));
        tied.say(&found.ended.words());
        found.drawn = tied.drawn;
        found.knots[2] = tied.knot().unwrap_or_default();
        (found.passes, _) = tied.s.passes(f64::INFINITY);
        found.clearance = tied.s.clearance();
        found.incidents = tied.s.incidents;
        (found.simulated, found.cpu, found.state_hash) =
            (tied.s.world.time(), tied.s.solver_s(), tied.s.world.state_hash());
        found
    }

    fn pull_apart(&self, tied: &mut Tied<'_>, found: &mut Found) -> Result<Ended, String> {
        found.knots[0] = tied.knot()?;
        tied.draw(self.pretension)?;
        tied.rest()?;
        found.knots[1] = tied.knot()?;
        let before = match tied.entries() {
            Some(entries) if found.knots[1] == found.knots[0] => entries,
            _ => return Ok(Ended::OpensWhenLetGo),
        };
        (found.loop_tension, found.residual, found.form) = (tied.loop_tension(), tied.load(), tied.form());
        found.form_held = found.form;
        let opened = tied.opened();
        // The halves of the post go out by a quarter of what the loop gets longer.
        tied.push(PULL_FORCE * 2.0 * self.strength, 0.25 * PULL_RATE * self.diameter)?;
        for frame in 1..=(PULL_LONGEST / PULL_RATE / FRAME).round() as u32 {
            tied.frame("pulling")?;
            let (load, tension) = (tied.load(), tied.rod()?.max_tension());
            (found.growth, found.tension) = (tied.opened() - opened, found.tension.max(tension));
            let Some(now) = tied.entries() else { return Ok(Ended::ComesUndone) };
            let slip = taken_in(&before, &now).min(found.growth);
            found.pull.push([found.growth, load, slip]);
            found.peak = found.peak.max(load);
            if found.slipped.is_none() {
                found.held = found.held.max(load);
                found.form_held = tied.form();
                found.slipped = (slip > self.slip * self.diameter).then_some(found.growth);
            }
            if tension > self.strength {
                return Ok(if found.slipped.is_some() { Ended::SlipsThenBreaks } else { Ended::Breaks });
            }
            if frame % RECOGNIZE == 0 {
                // A tail on its way through may leave the closures at odds; that is no other knot yet.
                let knot = tied.knot()?;
                if knot != found.knots[0] && knot != KnotType::Unknown.name() {
                    return Ok(Ended::ComesUndone);
                }
            }
        }
        Ok(Ended::Slips)
    }
}

/// Runs cases on this many threads of execution; the results are in the order of the cases and do not depend on how
/// many there are, but for the CPU times and where a budget of CPU time ends a case. `done` is told of each case when
/// it is done.
pub fn run(cases: &[Case], budget: Budget, threads: usize, done: &(dyn Fn(&Case, &Found) + Sync)) -> Vec<Found> {
    let (next, all) = (AtomicUsize::new(0), Mutex::new(vec![None; cases.len()]));
    std::thread::scope(|scope| {
        for _ in 0..threads.clamp(1, cases.len().max(1)) {
            scope.spawn(|| {
                loop {
                    let k = next.fetch_add(1, Ordering::Relaxed);
                    let Some(case) = cases.get(k) else { break };
                    let found = case.run(budget, &mut |_| {});
                    done(case, &found);
                    all.lock().unwrap_or_else(PoisonError::into_inner)[k] = Some(found);
                }
            });
        }
    });
    all.into_inner().unwrap_or_else(PoisonError::into_inner).into_iter().flatten().collect()
}

/// Columns of the table, those of the case first.
const COLUMNS: [&str; 24] = [
    "throws",
    "pretension_n",
    "mu",
    "ended",
    "held_n",
    "slipped_mm",
    "peak_n",
    "tension_n",
    "growth_mm",
    "loop_tension_n",
    "residual_n",
    "form",
    "share",
    "form_held",
    "share_held",
    "drawn_n",
    "knot_before",
    "knot_free",
    "knot_end",
    "passes",
    "clearance",
    "incidents",
    "cpu_s",
    "state_hash",
];
/// Those that are read by eye.
const SHORT: [&str; 14] = [
    "throws",
    "pretension_n",
    "mu",
    "ended",
    "held_n",
    "slipped_mm",
    "peak_n",
    "growth_mm",
    "loop_tension_n",
    "form",
    "share",
    "form_held",
    "passes",
    "cpu_s",
];

/// One row a case.
pub fn table(cases: &[Case], found: &[Found]) -> Table {
    let mut table = Table::new(COLUMNS);
    let verdict = |form: &Option<Form>| form.map_or_else(String::new, |f| f.verdict.name().into());
    let share = |form: &Option<Form>| form.map_or_else(String::new, |f| format!("{:.3}", f.share));
    for (case, f) in cases.iter().zip(found) {
        let [before, free, end] = f.knots.clone();
        table.rows.push(vec![
            case.throws.name.clone(),
            case.pretension.to_string(),
            case.mu.to_string(),
            f.ended.words(),
            format!("{:.3}", f.held),
            f.slipped.map(|v| format!("{:.3}", 1e3 * v)).unwrap_or_default(),
            format!("{:.3}", f.peak),
            format!("{:.3}", f.tension),
            format!("{:.3}", 1e3 * f.growth),
            f.loop_tension.map(|v| format!("{v:.4}")).unwrap_or_default(),
            format!("{:.4}", f.residual),
            verdict(&f.form),
            share(&f.form),
            verdict(&f.form_held),
            share(&f.form_held),
            format!("{:.3}", f.drawn),
            before,
            free,
            end,
            f.passes.to_string(),
            f.clearance.clone(),
            f.incidents.to_string(),
            format!("{:.1}", f.cpu),
            format!("{:016x}", f.state_hash),
        ]);
    }
    table
}

/// The pulls, frame by frame, as a table.
pub fn pulls(cases: &[Case], found: &[Found]) -> Table {
    let mut table = Table::new(["throws", "pretension_n", "mu", "growth_mm", "load_n", "slip_mm"]);
    for (case, f) in cases.iter().zip(found) {
        let of_case = [case.throws.name.clone(), case.pretension.to_string(), case.mu.to_string()];
        for [growth, load, slip] in &f.pull {
            let numbers = [format!("{:.4}", 1e3 * growth), format!("{load:.4}"), format!("{:.4}", 1e3 * slip)];
            table.rows.push(of_case.iter().cloned().chain(numbers).collect());
        }
    }
    table
}

/// A report in Markdown: for each sequence of throws and pretension what became of it over the friction, then every
/// case. `picture` is the stem of the plots beside it.
pub fn report(cases: &[Case], found: &[Found], head: &str, picture: &str) -> String {
    let mut out = format!(
        "# Strength of knots\n\n{head}\n\n![Force that the loop holds until a tail slips]({picture}.svg)\n\n![Greatest force until it comes undone or breaks]({picture}_peak.svg)\n\n"
    );
    let mut mus: Vec<f64> = cases.iter().map(|c| c.mu).collect();
    mus.sort_by(f64::total_cmp);
    mus.dedup();
    let mut groups: Vec<(&str, f64)> = cases.iter().map(|c| (c.throws.name.as_str(), c.pretension)).collect();
    groups.dedup();
    let heads: Vec<String> = ["throws", "pretension [N] \\ mu"]
        .into_iter()
        .map(str::to_string)
        .chain(mus.iter().map(f64::to_string))
        .collect();
    let heads: Vec<&str> = heads.iter().map(String::as_str).collect();
    let cell = |(throws, pretension): (&str, f64), mu: f64| {
        let of = |c: &Case| {
            c.throws.name == throws && c.pretension.to_bits() == pretension.to_bits() && c.mu.to_bits() == mu.to_bits()
        };
        let Some(k) = cases.iter().position(of) else { return String::new() };
        let f = &found[k];
        match f.ended {
            Ended::Breaks => format!("{:.2}, breaks", f.peak),
            Ended::SlipsThenBreaks => format!("{:.2}, breaks at {:.2}", f.held, f.peak),
            Ended::ComesUndone | Ended::Slips => format!("{:.2}, most {:.2}", f.held, f.peak),
            Ended::OpensWhenLetGo => "opens".into(),
            Ended::NotFinished(_) => "not finished".into(),
        }
    };
    out.push_str("Force on the loop \\[N\\] until a tail slips; the most it holds until it comes undone, or at which the thread breaks:\n\n");
    out.push_str(&markdown(
        &heads,
        groups.iter().map(|g| {
            [g.0.to_string(), g.1.to_string()].into_iter().chain(mus.iter().map(|mu| cell(*g, *mu))).collect()
        }),
    ));
    out.push_str("\n## Every case\n\n");
    out.push_str(&table(cases, found).markdown(&SHORT));
    out
}

/// Length of tail that went into the knot: of the tail that lost more \[m\]. An entry jumps where a tail that lies
/// along the knot comes off it; what passes through the knot lengthens the loop, whose growth is therefore a bound of
/// the slip.
fn taken_in(before: &Entries, now: &Entries) -> f64 {
    (before.tail_a - now.tail_a).max(now.tail_b - before.tail_b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn throws_are_read_by_name_and_in_the_notation_of_surgeons() {
        let read = |text: &str| Throws::parse(text).map(|t| t.half_twists);
        assert_eq!(read("square"), Ok(vec![3, -3]));
        assert_eq!(read("1x1"), Ok(vec![3, 3]));
        assert_eq!(read("2=1=1"), Ok(vec![5, -3, 3]));
        assert_eq!(read("1=1x1"), Ok(vec![3, -3, -3]));
        for wrong in ["", "=", "1=", "5", "1 = 1", "11", "reef"] {
            assert!(read(wrong).unwrap_err().contains("square+throw"), "{wrong}");
        }
        for (name, code) in NAMED {
            assert_eq!(read(name), read(code), "{name}");
        }
    }

    /// A short way into the draw, to the last bit.
    #[test]
    fn results_do_not_depend_on_the_number_of_threads() {
        let preset = sutura_scene::presets::find_material("silk").unwrap();
        let material = Material {
            bend_scale: preset.bend_scale.value,
            ..Material::elastic(preset.young_modulus.value, preset.density.value)
        };
        let case = |throws: &str, mu: f64| Case {
            material: material.clone(),
            diameter: 0.225e-3,
            strength: 9.41,
            throws: Throws::parse(throws).unwrap(),
            mu,
            pretension: 1.0,
            slip: 1.0,
        };
        let cases = [case("square", 0.2), case("granny", 0.3), case("1x1", 0.1)];
        let budget = Budget { cpu_s: 1e3, frames: 3 };
        let results = |threads: usize| {
            let found = run(&cases, budget, threads, &|_, _| {});
            let table = table(&cases, &found);
            let cpu = table.column("cpu_s");
            let mut rows = table.rows;
            rows.iter_mut().for_each(|row| row[cpu].clear());
            rows
        };
        let one = results(1);
        assert_eq!(one, results(2));
        assert_eq!(one.len(), 3);
        assert_ne!(one[0].last(), one[1].last(), "each case has its own last state");
        assert!(one.iter().all(|row| row[3] == "not finished: over 3 frames, at 0.050 s"), "{one:?}");
        let text = report(&cases, &run(&cases, budget, 2, &|_, _| {}), "Head.", "stem");
        assert!(
            text.contains("| 1x1 | 1 | not finished |  |  |")
                && text.contains("![Force that the loop holds until a tail slips](stem.svg)"),
            "{text}"
        );
    }

    #[test]
    fn the_tail_that_lost_more_counts() {
        let before = Entries { tail_a: 5.0, loop_ab: None, tail_b: 20.0 };
        assert_eq!(taken_in(&before, &Entries { tail_a: 4.0, loop_ab: None, tail_b: 22.0 }), 2.0);
        assert_eq!(taken_in(&before, &Entries { tail_a: 3.0, loop_ab: None, tail_b: 19.0 }), 2.0);
    }
}
