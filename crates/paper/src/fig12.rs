//! Row E-11, figures 11 and 12: a thread of 2 cm pressed together and let go, with three dampings.

use crate::measure::{FRAME, level, number, scene, thread};
use crate::method::{Direct, Method, Ours};
use crate::outcome::{Axis, Check, Compare, Outcome, Panel, Picture, Plot, Table, Tube};
use crate::plan::{Experiment, Plan};
use std::f64::consts::PI;
use sutura::glam::DVec3;
use sutura::{Integrator, PaperSettings};
use sutura_rivals::{Hold, Pose, Scene, Solver as _};

pub const EXPERIMENT: Experiment =
    Experiment { name: "fig12", title: "Damping: pressed together and let go", figures: "11, 12", plan };

const N: usize = 49;
const LENGTH: f64 = 0.02;
/// Way of the right end \[m\].
const PRESSED: f64 = 0.01;
/// Frames of pressing, of rest, and after it is let go.
const PRESS: usize = 60;
const REST: usize = 30;
const FRAMES: usize = 500;
const DAMPING: [f64; 3] = [0.0, 0.2, 0.4];

#[derive(Clone)]
struct Case {
    name: &'static str,
    method: Method,
    linear: f64,
    angular: f64,
}

struct Answer {
    /// Sum of the distances of the particles from where they were at rest, each frame from the release on \[m\].
    sums: Vec<f64>,
    /// Mechanical energy each frame \[J\]. The paper's solver has no moduli, and so none: for it this says nothing.
    energy: Vec<f64>,
    /// At rest, pressed, and after 10 and 500 frames.
    shapes: Vec<Vec<DVec3>>,
    incidents: usize,
}

const PAPER: &str = "paper, angular damping";
const ANGULAR: &str = "direct, angular damping";
const LINEAR: &str = "direct, linear damping";
const DEFAULT: &str = "direct, default step";

fn plan() -> Plan {
    let fine = Method::Direct(Direct { substeps: 100, integrator: Integrator::TrBdf2, ..Direct::default() });
    let mut cases = Vec::new();
    for d in DAMPING {
        cases.push(Case { name: ANGULAR, method: fine.clone(), linear: 0.0, angular: d });
        cases.push(Case { name: LINEAR, method: fine.clone(), linear: d, angular: 0.0 });
        cases.push(Case { name: PAPER, method: Method::Paper(PaperSettings::default(), 1), linear: 0.0, angular: d });
    }
    cases.push(Case { name: DEFAULT, method: Method::Direct(Direct::default()), linear: 0.0, angular: 0.0 });
    Plan::new(cases, |c| format!("{}, {} and {}", c.name, c.linear, c.angular), simulate, finish)
}

fn pressed() -> Scene {
    let l = LENGTH / N as f64;
    let (shape, frame) = level(0.0, LENGTH, N);
    let part = |t: f64| (t / (PRESS as f64 * FRAME)).min(1.0);
    // Exactly along itself it would stay straight: on its way the end goes aside by a little.
    let end = move |t: f64| DVec3::new(LENGTH - PRESSED * part(t), 0.0, 2.0 * l * libm::sin(PI * part(t)));
    Scene {
        first: Hold::Clamp(Box::new(move |_| Pose::new(DVec3::ZERO, frame))),
        last: Hold::Pin(Box::new(end)),
        ..scene(thread(shape.clone(), shape), 0.0, 0.0)
    }
}

fn simulate(case: &Case) -> Answer {
    let mut ours = Ours::new(pressed(), &case.method);
    let settings = sutura::Settings {
        linear_damping: case.linear,
        angular_damping: case.angular,
        ..ours.world.settings().clone()
    };
    ours.world.set_settings(settings).expect("valid settings");
    let rest = ours.positions().to_vec();
    for _ in 0..PRESS + REST {
        ours.step(FRAME);
    }
    let mut answer = Answer {
        sums: Vec::new(),
        energy: Vec::new(),
        shapes: vec![rest.clone(), ours.positions().to_vec()],
        incidents: 0,
    };
    let look = |ours: &Ours, answer: &mut Answer| {
        answer.sums.push(ours.positions().iter().zip(&rest).map(|(p, q)| p.distance(*q)).sum());
        answer.energy.push(ours.world.rod(ours.rod).expect("the thread is there").energy().total());
    };
    look(&ours, &mut answer);
    ours.let_go();
    for k in 1..=FRAMES {
        ours.step(FRAME);
        look(&ours, &mut answer);
        if k == 10 || k == FRAMES {
            answer.shapes.push(ours.positions().to_vec());
        }
    }
    answer.incidents = ours.incidents;
    answer
}

/// Mean over the last hundred frames.
fn late(values: &[f64]) -> f64 {
    values.iter().rev().take(100).sum::<f64>() / 100.0
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Part by which the greatest energy of any later frame is above the first.
fn growth(energy: &[f64]) -> f64 {
    energy[1..].iter().fold(0.0, |a: f64, e| a.max(*e)) / energy[0] - 1.0
}

/// Greatest values of the swings: those that no neighbor within ten frames exceeds.
fn swings(sums: &[f64]) -> Vec<f64> {
    let n = sums.len();
    let top = |k: &usize| (k.saturating_sub(10)..(k + 11).min(n)).all(|j| sums[j] <= sums[*k]);
    (0..n - 10).filter(top).map(|k| sums[k]).collect()
}

fn finish(found: &[(Case, Answer)]) -> Outcome {
    let mut out = Outcome::default();
    let of = |name: &str| -> Vec<&Answer> { found.iter().filter(|(c, _)| c.name == name).map(|(_, a)| a).collect() };
    let mut table = Table::new(
        "settling",
        "Sum of the distances to the state at rest, 50 particles",
        &[
            "method",
            "damping per second",
            "when let go [mm]",
            "mean of 500 frames [mm]",
            "mean of the last 100 [mm]",
            "energy: greatest later over first, less one",
        ],
    );
    let mut curves = Table::new(
        "frames",
        "Sum of distances by frame",
        &["method", "damping", "frame", "sum of distances [m]", "energy [J]"],
    )
    .hidden();
    let series = |name: &str| matches!(name, PAPER | ANGULAR | LINEAR | DEFAULT);
    for (c, a) in found.iter().filter(|(c, _)| series(c.name)) {
        let d = c.linear.max(c.angular);
        let grown = if c.name == PAPER { "none is defined".into() } else { growth(&a.energy).into() };
        table.row([
            c.name.into(),
            d.into(),
            (1e3 * a.sums[0]).into(),
            (1e3 * mean(&a.sums)).into(),
            (1e3 * late(&a.sums)).into(),
            grown,
        ]);
        for (k, (s, e)) in a.sums.iter().zip(&a.energy).enumerate() {
            let e = if c.name == PAPER { f64::NAN } else { *e };
            curves.row([c.name.into(), d.into(), k.into(), (*s).into(), e.into()]);
        }
    }
    for (name, bar) in [(PAPER, "paper"), (LINEAR, "direct (linear damping)")] {
        let all = of(name);
        let means: Vec<f64> = all.iter().map(|a| late(&a.sums)).collect();
        let words = means.iter().map(|m| format!("{} mm", number(1e3 * m))).collect::<Vec<_>>().join(", ");
        out.checks.push(Check::new(
            format!("{bar}: more damping settles sooner: sum over the last 100 frames at 0, 0.2, 0.4"),
            "falling",
            words,
            means.windows(2).all(|m| m[1] < m[0]),
        ));
        let (first, last) = (all[0].sums[0], late(&all[0].sums));
        out.checks.push(Check::new(
            format!("{bar}: without damping it keeps moving: sum over the last 100 frames"),
            "over 1 % of that when let go",
            format!("{} %", number(100.0 * last / first)),
            last > 0.01 * first,
        ));
    }
    let tops = swings(&of(PAPER)[0].sums);
    let words = tops.iter().map(|t| format!("{} mm", number(1e3 * t))).collect::<Vec<_>>().join(", ");
    out.checks.push(Check::new(
        "paper, without damping: it has no energy, but no swing is wider than the one before",
        "falling",
        words,
        tops.len() > 1 && tops.windows(2).all(|t| t[1] <= t[0]),
    ));
    let grown =
        [ANGULAR, LINEAR].iter().flat_map(|name| of(name)).map(|a| growth(&a.energy)).fold(f64::NEG_INFINITY, f64::max);
    out.checks.push(Check::new(
        "direct: the energy of no later frame is above that when let go",
        "<= 0 %",
        format!("{} %", number(100.0 * grown)),
        grown <= 0.0,
    ));
    let words = |name: &str| of(name).iter().map(|a| number(1e3 * late(&a.sums))).collect::<Vec<_>>().join(", ");
    out.compare.push(Compare {
        what: "12: sum of distances [mm], frames 400 to 500, damping 0, 0.2, 0.4".into(),
        published: "falls with damping; 0 keeps moving (plot)".into(),
        effective: words(PAPER),
        true_scale: "the same: without gravity nothing knows the scale".into(),
        direct: format!("{} (linear damping, second order, 100 substeps)", words(LINEAR)),
    });
    let stop = of(DEFAULT)[0];
    let settled = stop
        .sums
        .iter()
        .position(|s| *s < 0.01 * stop.sums[0])
        .map_or_else(|| "not within 500 frames".into(), |k| format!("after {k} frames"));
    out.say(format!(
        "2 cm, 49 elements, no gravity, left end clamped, right end pressed in by 1 cm and let go; 500 frames. On its way the end goes aside by a little, since a thread pressed exactly along itself stays straight. Without gravity the paper's solver does not know a scale at all: true and effective are the same. \
         In a real thread this is a vibration at some 140 Hz and above, and what da damps, the spin of the sections, carries next to nothing of it: `direct` with da = 0, 0.2, 0.4 gives {} mm, all alike. \
         Linear damping does it ({} mm). To keep a motion of 140 Hz for 8 s takes the second order and 100 substeps a frame; at its default (implicit Euler, 4 substeps) `direct` is at rest {settled}: \
         what is faster than the step is damped away, on purpose.",
        words(ANGULAR),
        words(LINEAR)
    ));
    let mut panels = Vec::new();
    for (name, label) in [(PAPER, "paper"), (LINEAR, "direct")] {
        for (points, moment) in
            of(name)[0].shapes.iter().zip(["at rest", "pressed", "10 frames after", "500 frames after"])
        {
            panels.push(Panel {
                label: format!("{label}, {moment}"),
                tubes: vec![Tube { points: points.clone(), radius: 1.5e-4 }],
                solids: Vec::new(),
                look: (DVec3::Y, DVec3::Z),
                frame: Some((DVec3::new(0.01, 0.0, 0.0), 0.028)),
            });
        }
    }
    out.pictures.push(Picture {
        name: "states".into(),
        title: "Figure 11, without damping".into(),
        columns: 4,
        panels,
    });
    for (name, file, title) in [
        (PAPER, "paper", "Figure 12, the paper's solver: sum of distances over frames"),
        (LINEAR, "direct", "The same, direct with linear damping"),
        (ANGULAR, "angular", "The same, direct with angular damping"),
    ] {
        let mut plot = Plot::new(file, title, Axis::new("frame", ""), Axis::new("sum of distances", "m"));
        for (d, a) in DAMPING.iter().zip(of(name)) {
            plot.line(format!("damping {d}"), a.sums.iter().enumerate().map(|(k, s)| (k as f64, *s)).collect());
        }
        out.plots.push(plot);
    }
    out.tables.extend([table, curves]);
    out
}
