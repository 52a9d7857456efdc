//! Rows F-1 to F-4: what the paper says is missing from its method. Stiffness over budget and elements, moduli in Pa,
//! forces against theory, Coulomb's law.
//!
//! Cases of forces and friction are those of `sutura-validate`, whose references are used throughout.

use crate::measure::{FRAME, GRAVITY, LENGTH, level, number, percent, sane, scene, thread};
use crate::method::{Direct, Method};
use crate::outcome::{Axis, Check, Compare, Outcome, Plot, Table};
use crate::plan::{Experiment, Plan};
use std::sync::LazyLock;
use sutura::PaperSettings;
use sutura::glam::DVec3;
use sutura_rivals::{Hold, Pose, Scene, pber};
use sutura_scene::{Runner, Scene as SceneFile};
use sutura_validate::reference::{elastica, material::T1};
use sutura_validate::{Section, scene_text, sections};

pub const EXPERIMENT: Experiment =
    Experiment { name: "limits", title: "What the paper says is missing", figures: "", plan };

/// Elements where they are not varied.
const N: usize = 40;

fn plan() -> Plan {
    stiffness().and(moduli()).and(forces()).and(friction())
}

fn direct(substeps: u32, newton_max: u32) -> Method {
    Method::Direct(Direct { substeps, newton_max, ..Direct::default() })
}

fn paper(iterations: u32, steps: u32) -> Method {
    Method::Paper(PaperSettings { iterations, ..PaperSettings::default() }, steps)
}

fn pber(iterations: usize, substeps: usize) -> Method {
    Method::Pber(pber::Settings {
        substeps,
        iterations,
        bend_twist: DVec3::new(0.05, 0.05, 0.25),
        ..Default::default()
    })
}

/// A level thread, clamped at one end, of the given length from the middle of the held element on: refinement converges
/// to one rod.
fn cantilever(length: f64, n: usize, gravity: f64, drag: f64) -> Scene {
    let l = length / (n as f64 - 0.5);
    let (shape, frame) = level(-0.5 * l, length, n);
    Scene {
        first: Hold::Clamp(Box::new(move |_| Pose::new(DVec3::NEG_X * (0.5 * l), frame))),
        ..scene(thread(shape.clone(), shape), gravity, drag)
    }
}

/// Drop of the tip over the length after `frames`; not a number where it diverges.
fn drop(method: &Method, scene: Scene, length: f64, frames: usize) -> f64 {
    let mut solver = method.start(scene);
    for _ in 0..frames {
        solver.step(FRAME);
    }
    let points = solver.positions();
    if sane(points, 0.01 * length) { -points[points.len() - 1].z / length } else { f64::NAN }
}

// ---- F-1 ----

/// What is varied.
#[derive(Clone, Copy, PartialEq)]
enum Vary {
    /// Iterations in a step (of Newton's method for `direct`).
    Iterations,
    /// Steps in a frame.
    Steps,
    Elements,
}

#[derive(Clone)]
struct Droop {
    vary: Vary,
    value: usize,
    method: Method,
    n: usize,
}

/// Steps a frame of the position-based methods where these are not varied: as at the effective scale.
const STEPS: u32 = 10;

fn stiffness() -> Plan {
    let mut cases = Vec::new();
    let mut add = |vary: Vary, value: usize, method: Method, n: usize| cases.push(Droop { vary, value, method, n });
    for i in [5, 10, 20, 40, 80, 160] {
        add(Vary::Iterations, i, paper(i as u32, STEPS), N);
    }
    for i in [5, 20, 80] {
        add(Vary::Iterations, i, pber(i, STEPS as usize), N);
    }
    for i in [1, 2, 3, 5, 12, 40] {
        add(Vary::Iterations, i, direct(4, i as u32), N);
    }
    for s in [1, 2, 5, 10, 20, 40] {
        add(Vary::Steps, s, paper(20, s as u32), N);
    }
    for s in [1, 5, 20] {
        add(Vary::Steps, s, pber(20, s), N);
    }
    for s in [1, 2, 4, 8, 16, 40] {
        add(Vary::Steps, s, direct(s as u32, 12), N);
    }
    for n in [10, 20, 40, 80, 160] {
        add(Vary::Elements, n, paper(20, STEPS), n);
        add(Vary::Elements, n, direct(4, 12), n);
    }
    for n in [10, 40, 160] {
        add(Vary::Elements, n, pber(20, STEPS as usize), n);
    }
    let label = |c: &Droop| format!("F-1: {}, {} elements, {}", c.method.name(), c.n, c.method.budget());
    Plan::new(cases, label, |c| drop(&c.method, cantilever(LENGTH, c.n, GRAVITY, 4.0), LENGTH, 480), stiffness_found)
}

fn stiffness_found(found: &[(Droop, f64)]) -> Outcome {
    let mut out = Outcome::default();
    // Weight over stiffness, w L^3 / EI.
    let heaviness = T1.weight() * LENGTH.powi(3) / T1.ei();
    let exact = elastica::self_weight(heaviness)[1];
    let mut table = Table::new(
        "stiffness",
        "F-1: drop of the tip over the length, cantilever of 15 cm under its own weight",
        &["varied", "method", "elements", "steps x iterations", "drop / length", "against the elastica"],
    )
    .hidden();
    for (c, d) in found {
        let word = match c.vary {
            Vary::Iterations => "iterations",
            Vary::Steps => "steps",
            Vary::Elements => "elements",
        };
        table.row([
            word.into(),
            c.method.name().into(),
            c.n.into(),
            c.method.budget().into(),
            (*d).into(),
            percent(d / exact - 1.0).into(),
        ]);
    }
    let of = |vary: Vary, name: &str| -> Vec<(f64, f64)> {
        found
            .iter()
            .filter(|(c, d)| c.vary == vary && c.method.name() == name && d.is_finite())
            .map(|(c, d)| (c.value as f64, *d))
            .collect()
    };
    let range = |vary: Vary, name: &str| {
        let p = of(vary, name);
        let (low, high) = p.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v.1), h.max(v.1)));
        format!("{} to {}", number(low), number(high))
    };
    for (vary, name, axis) in [
        (Vary::Iterations, "iterations", "iterations in a step"),
        (Vary::Steps, "steps", "steps in a frame of 1/60 s"),
        (Vary::Elements, "elements", "elements"),
    ] {
        let mut plot = Plot::new(
            name,
            &format!("F-1: drop of a cantilever at rest over {axis}"),
            Axis::log(axis, ""),
            Axis::new("drop of the tip / length", ""),
        );
        for m in ["direct", "paper", "PBER"] {
            plot.line(m, of(vary, m));
        }
        plot.marks.push(("elastica".into(), exact));
        out.plots.push(plot);
    }
    let off = |vary: Vary, from: f64| {
        of(vary, "direct").iter().filter(|p| p.0 >= from).map(|p| (p.1 / exact - 1.0).abs()).fold(0.0, f64::max)
    };
    let count = |vary: Vary| of(vary, "direct").len();
    for (what, vary, from, n) in [
        ("1 to 40 Newton iterations", Vary::Iterations, 0.0, 6),
        ("1 to 40 substeps a frame", Vary::Steps, 0.0, 6),
        ("20 to 160 elements", Vary::Elements, 20.0, 5),
    ] {
        let e = off(vary, from);
        out.checks.push(Check::new(
            format!("F-1, direct: drop of a cantilever against the elastica, {what}"),
            "within 1 %",
            percent(e),
            e <= 0.01 && count(vary) == n,
        ));
    }
    out.say(format!(
        "**F-1, stiffness.** A thread of 0.3 mm and 2 GPa, 15 cm long and clamped level, bends under its own weight by {} of its length (elastica, w L^3 / EI = {}). With *direct* it does so at any \
         number of Newton iterations, substeps and elements. With the paper's solver (numbers 0.05 and 0.25) the drop is {} over 5 to 160 iterations, {} over steps in a frame, {} over 10 to 160 elements; with PBER {}, {} and {}. \
         Where a curve ends, the method diverges. Ten steps a frame and 20 iterations where these are not varied.",
        number(exact),
        number(heaviness),
        range(Vary::Iterations, "paper"),
        range(Vary::Steps, "paper"),
        range(Vary::Elements, "paper"),
        range(Vary::Iterations, "PBER"),
        range(Vary::Steps, "PBER"),
        range(Vary::Elements, "PBER"),
    ));
    let diverges = found
        .iter()
        .find(|(c, d)| c.vary == Vary::Steps && c.value == 1 && c.method.name() == "paper" && !d.is_finite())
        .is_some();
    out.compare.push(Compare {
        what: "F-1: drop of a cantilever / length, 5 to 160 iterations (elastica ".to_string() + &number(exact) + ")",
        published: "depends on iterations (stated)".into(),
        effective: range(Vary::Iterations, "paper"),
        true_scale: if diverges {
            "diverges at 20 iterations".into()
        } else {
            of(Vary::Steps, "paper").first().map_or("-".into(), |p| format!("{} at 20 iterations", number(p.1)))
        },
        direct: range(Vary::Iterations, "direct"),
    });
    out.tables.push(table);
    out
}

// ---- F-2 ----

/// Length of the cantilever with a load at its tip \[m\].
const SHORT: f64 = 0.05;
const MODULI: [f64; 3] = [1e8, 1e9, 1e10];

#[derive(Clone)]
struct Tip {
    method: Method,
    young: f64,
    force: f64,
}

/// Drop over the length beyond which a thread hangs longer than it is: not drawn.
const LONGER: f64 = 1.05;

/// Bending stiffness of the thread with another modulus.
fn stiff(young: f64) -> f64 {
    T1.ei() * young / T1.young
}

fn moduli() -> Plan {
    let mut cases = Vec::new();
    for young in MODULI {
        for k in [0.1, 0.3, 1.0, 2.0, 5.0, 10.0, 20.0] {
            cases.push(Tip { method: direct(4, 12), young, force: k * stiff(young) / (SHORT * SHORT) });
        }
        for e in -12..=-3 {
            cases.push(Tip { method: paper(20, STEPS), young, force: libm::pow(10.0, 0.5 * f64::from(e)) });
        }
    }
    let label = |c: &Tip| format!("F-2: {}, {} GPa, {} N", c.method.name(), number(1e-9 * c.young), number(c.force));
    let run = |c: &Tip| {
        let mut scene = cantilever(SHORT, N, 0.0, 8.0);
        (scene.rod.young, scene.rod.shear) = (c.young, c.young / 2.8);
        scene.loads.push((N, DVec3::NEG_Z * c.force));
        drop(&c.method, scene, SHORT, 300)
    };
    Plan::new(cases, label, run, moduli_found)
}

fn moduli_found(found: &[(Tip, f64)]) -> Outcome {
    let mut out = Outcome::default();
    let mut plot = Plot::new(
        "moduli",
        "F-2: drop of a cantilever under a load at its tip",
        Axis::log("load", "N"),
        Axis::new("drop of the tip / length", ""),
    );
    let mut table = Table::new(
        "moduli",
        "F-2: drop of the tip over the length",
        &["method", "modulus [GPa]", "load [N]", "P L^2 / EI", "drop / length", "elastica"],
    )
    .hidden();
    let mut worst = 0.0_f64;
    for young in MODULI {
        let to_load = |k: f64| k * stiff(young) / (SHORT * SHORT);
        let exact = (0..=60)
            .map(|i| libm::pow(10.0, -1.3 + 2.6 * f64::from(i) / 60.0))
            .map(|k| (to_load(k), elastica::tip_load(k)[1]));
        plot.line(format!("elastica, {} GPa", number(1e-9 * young)), exact.collect());
        let own = found.iter().filter(|(c, _)| c.young == young && c.method.name() == "direct");
        plot.dots(format!("direct, {} GPa", number(1e-9 * young)), own.map(|(c, d)| (c.force, *d)).collect());
    }
    let of_paper = |young: f64| -> Vec<(f64, f64)> {
        found
            .iter()
            .filter(|(c, d)| c.young == young && c.method.name() == "paper" && *d < LONGER)
            .map(|(c, d)| (c.force, *d))
            .collect()
    };
    plot.line("paper, any modulus", of_paper(MODULI[0]));
    for young in &MODULI[1..] {
        plot.dots(format!("paper, {} GPa", number(1e-9 * young)), of_paper(*young));
    }
    for (c, d) in found {
        let k = c.force * SHORT * SHORT / stiff(c.young);
        let exact = elastica::tip_load(k)[1];
        table.row([
            c.method.name().into(),
            (1e-9 * c.young).into(),
            c.force.into(),
            k.into(),
            (*d).into(),
            exact.into(),
        ]);
        if c.method.name() == "direct" {
            worst = worst.max(if d.is_finite() { (d / exact - 1.0).abs() } else { f64::INFINITY });
        }
    }
    let same = MODULI.iter().all(|y| of_paper(*y) == of_paper(MODULI[0]));
    out.checks.push(Check::new(
        "F-2, direct: drop under a load at the tip against the elastica, 0.1 to 10 GPa, P L^2 / EI = 0.1 to 20",
        "within 1 %",
        percent(worst),
        worst <= 0.01,
    ));
    out.checks.push(Check::new(
        "F-2, paper: the drop does not know the modulus",
        "the same bits",
        if same { "the same" } else { "differs" },
        same,
    ));
    out.say(format!(
        "**F-2, moduli.** A thread of 0.3 mm and 5 cm with a dead load at its tip, 0.1, 1 and 10 GPa: *direct* is within {} of the elastica (elliptic integrals) at every modulus and load. To the paper's solver the modulus \
         does not exist: its curve is one for all (20 iterations, ten steps a frame). From {} N on the load pulls it longer than it is, or it diverges.",
        percent(worst),
        number(found.iter().filter(|(c, d)| c.method.name() == "paper" && (d.is_nan() || *d >= LONGER)).map(|(c, _)| c.force).fold(f64::INFINITY, f64::min)),
    ));
    out.compare.push(Compare {
        what: "F-2: drop under a tip load against the elastica, 0.1 to 10 GPa".into(),
        published: "no relation to moduli (stated)".into(),
        effective: "the same curve for all moduli".into(),
        true_scale: "as there".into(),
        direct: format!("within {}", percent(worst)),
    });
    out.plots.push(plot);
    out.tables.push(table);
    out
}

// ---- F-3, F-4: cases of the validation ----

static SECTIONS: LazyLock<Vec<Section>> = LazyLock::new(sections);

/// Quantities of the finest run of a case of the validation: name, value, reference.
fn validated(number: u32, name: &str) -> Vec<(String, f64, f64)> {
    const THERE: &str = "it is a case of the validation";
    let section = SECTIONS.iter().find(|s| s.number == number).expect(THERE);
    let study = section.studies.iter().find(|s| s.name == name).expect(THERE);
    let level = study.levels.last().expect(THERE);
    let settings: Vec<(String, String)> = study.settings.iter().chain(&level.settings).cloned().collect();
    let outcome = run(study.scene, &settings);
    study
        .quantities
        .iter()
        .map(|q| (q.name.clone(), (q.measure)(&outcome), q.reference.last().copied().unwrap_or(f64::NAN)))
        .collect()
}

fn run(scene: &str, settings: &[(String, String)]) -> sutura_scene::Outcome {
    let text = scene_text(scene).expect("it is a scene of the validation");
    let scene = SceneFile::parse_with(text, scene, settings).expect("scenes of the validation are valid");
    let mut runner = Runner::new(scene).expect("scenes of the validation are valid");
    while !runner.step_frame().finished {}
    runner.finish()
}

/// A quantity by the beginning of its name: value and reference.
fn quantity(all: &[(String, f64, f64)], name: &str) -> (f64, f64) {
    all.iter().find(|q| q.0.starts_with(name)).map_or((f64::NAN, f64::NAN), |q| (q.1, q.2))
}

const SHORTENED: [f64; 6] = [0.02, 0.05, 0.1, 0.2, 0.3, 0.5];
const SPANS: [f64; 4] = [0.3, 0.5, 0.8, 0.95];

#[derive(Clone, Copy)]
enum Force {
    /// A pinned column shortened by a part of its length.
    Column(f64),
    /// A chain between two pins, this part of its length apart.
    Chain(f64),
    /// A rod of 10 cm between two clamps, turned by an angle \[rad\].
    Twist(f64),
}

/// Length of the twisted rod \[m\].
const TWISTED: f64 = 0.1;

fn forces() -> Plan {
    let cases: Vec<Force> = SHORTENED
        .map(Force::Column)
        .into_iter()
        .chain(SPANS.map(Force::Chain))
        .chain([1.0, 3.0, 6.0, 8.0].map(Force::Twist))
        .collect();
    let label = |c: &Force| match c {
        Force::Column(e) => format!("F-3: column shortened by {e}"),
        Force::Chain(s) => format!("F-3: chain, span {s}"),
        Force::Twist(a) => format!("F-3: twisted by {a} rad"),
    };
    let run = |c: &Force| match c {
        Force::Column(e) => vec![quantity(&validated(3, &format!("pinned, shortened by {e}")), "load")],
        Force::Chain(s) => {
            let all = validated(2, &format!("chain, span {s}"));
            vec![quantity(&all, "horizontal force"), quantity(&all, "tension, first")]
        }
        Force::Twist(a) => vec![(torque(*a), T1.gj() * a / TWISTED)],
    };
    Plan::new(cases, label, run, forces_found)
}

/// Torque at the end of a straight rod between two clamps \[N m\].
fn torque(angle: f64) -> f64 {
    let settings =
        [("phase.twist.action[0].keys[0].turn.angle", format!("{angle:e}")), ("grip.left.force", "0.01".into())]
            .map(|(k, v)| (k.to_string(), v));
    let outcome = run("twisted", &settings);
    outcome.report.probes.iter().find(|p| p.name == "torque").map_or(f64::NAN, |p| p.last)
}

fn forces_found(found: &[(Force, Vec<(f64, f64)>)]) -> Outcome {
    let mut out = Outcome::default();
    let mut table = Table::new(
        "forces",
        "F-3: forces that direct reads, against theory",
        &["case", "what", "read", "theory", "error"],
    );
    let mut worst = [0.0_f64; 3];
    let (mut loads, mut sides, mut tensions) = (Vec::new(), Vec::new(), Vec::new());
    for (c, q) in found {
        let (kind, case, names): (usize, String, &[&str]) = match c {
            Force::Column(e) => {
                loads.push((*e, q[0].0));
                (0, format!("pinned column of 5 cm shortened by {}", percent(*e)), &["load over Euler's"])
            }
            Force::Chain(s) => {
                sides.push((*s, q[0].0));
                tensions.push((*s, q[1].0));
                (
                    1,
                    format!("thread hung between pins, span {s} of its length"),
                    &["horizontal force over weight", "tension at the pin over weight"],
                )
            }
            Force::Twist(a) => (2, format!("rod between clamps turned by {a} rad"), &["torque [N m]"]),
        };
        for (name, (read, theory)) in names.iter().zip(q) {
            let error = read / theory - 1.0;
            worst[kind] = worst[kind].max(if error.is_finite() { error.abs() } else { f64::INFINITY });
            table.row([case.clone().into(), (*name).into(), (*read).into(), (*theory).into(), percent(error).into()]);
        }
    }
    for (what, e) in [
        "load of a buckled column against the elastica",
        "forces of a hanging thread against its closed form",
        "torque of a twisted rod against G J / L",
    ]
    .iter()
    .zip(worst)
    {
        out.checks.push(Check::new(format!("F-3, direct: {what}"), "within 1 %", percent(e), e <= 0.01));
    }
    let mut plot = Plot::new(
        "column",
        "F-3: load of a column whose ends come together",
        Axis::new("shortening / length", ""),
        Axis::new("load / Euler's load", ""),
    );
    plot.line(
        "elastica",
        std::iter::once((0.0, 1.0))
            .chain((1..=55).map(|i| 0.01 * f64::from(i)).map(|e| (e, elastica::buckled(e)[0])))
            .collect(),
    );
    plot.dots("direct", loads);
    out.plots.push(plot);
    let mut plot = Plot::new(
        "hanging",
        "F-3: forces of a thread hung between two pins",
        Axis::new("span / length", ""),
        Axis::new("force / weight", ""),
    );
    let catenary = |k: usize| {
        (25..=97)
            .map(|i| 0.01 * f64::from(i))
            .map(|s| (s, sutura_validate::reference::catenary::level(s)[k]))
            .collect::<Vec<_>>()
    };
    plot.line("catenary, horizontal", catenary(1));
    plot.dots("direct, horizontal", sides);
    plot.line("catenary, tension at the pins", catenary(2));
    plot.dots("direct, first element", tensions);
    out.plots.push(plot);
    out.say(format!(
        "**F-3, forces.** What *direct* reads at pins and clamps is within {} of the elastica for a buckled column, {} of the closed form (a chain of as many links) for a hanging thread, {} of G J / L for a twisted rod (rounding). The paper's solver has no \
         forces to read: at its grips they are zero.",
        percent(worst[0]),
        percent(worst[1]),
        percent(worst[2])
    ));
    out.compare.push(Compare {
        what: "F-3: forces against theory (column, hanging thread, torque)".into(),
        published: "none (stated)".into(),
        effective: "none".into(),
        true_scale: "none".into(),
        direct: format!("within {}", percent(worst.iter().copied().fold(0.0, f64::max))),
    });
    out.tables.push(table);
    out
}

// ---- F-4 ----

const MU: f64 = 0.3;
const ANGLES: [f64; 7] = [5.0, 10.0, 16.5, 17.0, 20.0, 25.0, 30.0];
const AROUND: [(f64, f64); 5] = [(0.1, 180.0), (0.2, 180.0), (0.3, 180.0), (0.2, 360.0), (0.3, 360.0)];
/// Substeps of the incline \[s\]: of `direct`, and of the paper's solver at its effective scale.
const FINE: f64 = 1e-3;
const TENTH: f64 = FRAME / 10.0;

type Pair = (f64, f64);

#[derive(Clone, Copy)]
enum Rub {
    /// An incline of so many degrees; with the paper's solver by its factor k and its step.
    Incline(f64, Option<(f64, f64)>),
    /// Coefficient, and angle wrapped \[degrees\].
    Capstan(f64, f64),
}

fn friction() -> Plan {
    let mut cases: Vec<Rub> = ANGLES.map(|a| Rub::Incline(a, None)).to_vec();
    for paper in [(0.0, TENTH), (0.01, TENTH), (0.1, TENTH), (1.0, TENTH), (0.1, FRAME), (1.0, FRAME)] {
        cases.extend([5.0, 10.0, 17.0, 20.0, 30.0].map(|a| Rub::Incline(a, Some(paper))));
    }
    cases.extend(AROUND.map(|(mu, degrees)| Rub::Capstan(mu, degrees)));
    let label = |c: &Rub| match c {
        Rub::Incline(a, None) => format!("F-4: direct, incline of {a} degrees"),
        Rub::Incline(a, Some((k, h))) => {
            format!("F-4: paper, k = {k}, steps of {} ms, incline of {a} degrees", number(1e3 * h))
        }
        Rub::Capstan(mu, d) => format!("F-4: capstan, mu = {mu}, {d} degrees"),
    };
    let run = |c: &Rub| match c {
        Rub::Incline(a, paper) => {
            (slide(*a, *paper), (GRAVITY * (a.to_radians().sin() - MU * a.to_radians().cos())).max(0.0))
        }
        Rub::Capstan(mu, d) => quantity(&validated(9, &format!("mu = {mu}, {d} degrees")), "T2 / T1"),
    };
    Plan::new(cases, label, run, friction_found)
}

/// Acceleration down the incline, from the way in the last half second \[m/s^2\]: `n` steps of length h make the way a
/// h^2 n (n + 1) / 2.
fn slide(degrees: f64, paper: Option<(f64, f64)>) -> f64 {
    let (s, c) = libm::sincos(degrees.to_radians());
    let h = paper.map_or(FINE, |p| p.1);
    let mut settings = vec![
        ("phase.tilted.action[0].gravity".to_string(), format!("[{:e}, 0, {:e}]", GRAVITY * s, -GRAVITY * c)),
        ("frame_rate".to_string(), if paper.is_some() { "60".to_string() } else { "100".to_string() }),
        ("solver.substep".to_string(), format!("{:e}", h * (1.0 + 1e-9))),
    ];
    if let Some((k, _)) = paper {
        settings.extend([
            ("solver.method".to_string(), "paper".to_string()),
            ("solver.paper.friction".to_string(), k.to_string()),
        ]);
    }
    let outcome = run("incline", &settings);
    let Some(place) = outcome.series.iter().find(|s| s.name == "place") else { return f64::NAN };
    // Time, x, y, z.
    let Some(begin) = place.rows.iter().find(|r| r[0] > 0.2 - 1e-9) else { return f64::NAN };
    let Some(end) = place.rows.last() else { return f64::NAN };
    let n = ((end[0] - begin[0]) / h).round();
    2.0 * (end[1] - begin[1]) / (h * h * n * (n + 1.0))
}

fn friction_found(found: &[(Rub, (f64, f64))]) -> Outcome {
    let mut out = Outcome::default();
    let mut table =
        Table::new("friction", "F-4: friction against Coulomb's law", &["case", "solver", "found", "Coulomb"]);
    let (mut inclines, mut capstans) = (Vec::new(), Vec::new());
    // By factor and step.
    let mut papers: Vec<(Pair, Vec<Pair>)> = Vec::new();
    let (mut sliding, mut resting, mut ratio) = (0.0_f64, 0.0_f64, 0.0_f64);
    for (c, (got, law)) in found {
        let relative = (got / law - 1.0).abs();
        let relative = if relative.is_finite() { relative } else { f64::INFINITY };
        let (case, solver) = match c {
            Rub::Incline(a, None) => {
                inclines.push((*a, *got));
                if *law > 0.0 {
                    sliding = sliding.max(relative);
                } else {
                    resting = resting.max(if got.is_finite() { got.abs() } else { f64::INFINITY });
                }
                (format!("acceleration on an incline of {a} degrees [m/s^2]"), "direct".to_string())
            }
            Rub::Incline(a, Some(p)) => {
                match papers.iter_mut().find(|l| l.0 == *p) {
                    Some(l) => l.1.push((*a, *got)),
                    None => papers.push((*p, vec![(*a, *got)])),
                }
                (
                    format!("acceleration on an incline of {a} degrees [m/s^2]"),
                    format!("paper, k = {}, steps of {} ms", p.0, number(1e3 * p.1)),
                )
            }
            Rub::Capstan(mu, degrees) => {
                capstans.push((mu * degrees.to_radians(), *got));
                ratio = ratio.max(relative);
                (format!("capstan: ratio of tensions, mu = {mu}, {degrees} degrees"), "direct".to_string())
            }
        };
        table.row([case.into(), solver.into(), (*got).into(), (*law).into()]);
    }
    out.checks.push(Check::new(
        "F-4, direct: acceleration on an incline of 17 to 30 degrees, mu = 0.3, against g (sin - mu cos)",
        "within 1 %",
        percent(sliding),
        sliding <= 0.01,
    ));
    out.checks.push(Check::new(
        "F-4, direct: acceleration below the angle of friction (16.7 degrees) [m/s^2]",
        "<= 1e-5",
        number(resting),
        resting <= 1e-5,
    ));
    out.checks.push(Check::new(
        "F-4, direct: ratio of tensions round a cylinder against exp(mu phi)",
        "within 1 %",
        percent(ratio),
        ratio <= 0.01,
    ));

    let mut plot = Plot::new(
        "incline",
        "F-4: thread on an incline, mu = 0.3",
        Axis::new("angle", "degrees"),
        Axis::new("acceleration", "m/s^2"),
    );
    let law = |a: f64| (GRAVITY * (a.to_radians().sin() - MU * a.to_radians().cos())).max(0.0);
    plot.line("Coulomb", (0..=60).map(|i| 0.5 * f64::from(i)).map(|a| (a, law(a))).collect());
    plot.dots("direct", inclines);
    for ((k, h), points) in &papers {
        plot.line(format!("paper, k = {k}, steps of {} ms", number(1e3 * h)), points.clone());
    }
    out.plots.push(plot);
    capstans.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut plot = Plot::new(
        "capstan",
        "F-4: ratio of tensions of a thread that slides round a cylinder",
        Axis::new("mu phi", ""),
        Axis::new("T2 / T1", ""),
    );
    plot.line("exp(mu phi)", (0..=50).map(|i| 0.04 * f64::from(i)).map(|x| (x, libm::exp(x))).collect());
    plot.dots("direct", capstans);
    out.plots.push(plot);
    let at = |k: f64, h: f64, a: f64| {
        papers.iter().find(|l| l.0 == (k, h)).and_then(|l| l.1.iter().find(|p| p.0 == a)).map_or(f64::NAN, |p| p.1)
    };
    let of = |h: f64, a: f64, ks: &[f64]| {
        ks.iter().map(|k| format!("{} (k = {k})", number(at(*k, h, a)))).collect::<Vec<_>>().join(", ")
    };
    let ks = [0.0, 0.01, 0.1, 1.0];
    out.say(format!(
        "**F-4, Coulomb's law.** A thread on a plane with mu = 0.3 that tilts: *direct* rests below 16.7 degrees and slides above with g (sin - mu cos) to {}; round a cylinder tensions are in the ratio of the capstan to {}. \
         The paper's factor k is no coefficient of friction. Mean acceleration down the incline over half a second [m/s^2], ten steps in a frame of 1/60 s: on 5 degrees, where Coulomb's law gives 0, {}; on 30 degrees, where it gives {}, {}. \
         With one step in a frame: {} and {}. The same k gives another friction at another step.",
        percent(sliding),
        percent(ratio),
        of(TENTH, 5.0, &ks),
        number(law(30.0)),
        of(TENTH, 30.0, &ks),
        of(FRAME, 5.0, &ks[2..]),
        of(FRAME, 30.0, &ks[2..]),
    ));
    out.compare.push(Compare {
        what: "F-4: acceleration on 20 degrees, mu = 0.3, m/s^2 (Coulomb ".to_string() + &number(law(20.0)) + ")",
        published: "not Coulomb's (stated)".into(),
        effective: of(TENTH, 20.0, &ks[1..]),
        true_scale: of(FRAME, 20.0, &ks[2..]),
        direct: number(
            found.iter().find(|(c, _)| matches!(c, Rub::Incline(a, None) if *a == 20.0)).map_or(f64::NAN, |f| f.1.0),
        ),
    });
    out.tables.push(table);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loaded_cantilever_is_the_elastica() {
        let k = 2.0;
        let mut scene = cantilever(SHORT, 20, 0.0, 8.0);
        scene.loads.push((20, DVec3::NEG_Z * (k * T1.ei() / (SHORT * SHORT))));
        let (found, exact) = (drop(&direct(4, 12), scene, SHORT, 200), elastica::tip_load(k)[1]);
        assert!((found / exact - 1.0).abs() < 2e-3, "{found} {exact}");
    }
}
