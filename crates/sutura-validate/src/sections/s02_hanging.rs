//! Chains and heavy rods that hang.

use super::{independence, vector};
use crate::reference::catenary::{self, Ends};
use crate::reference::links;
use crate::reference::material::{GRAVITY, T1, T2};
use crate::reference::vibration::{euler_frequency, frequency};
use crate::results::{Curve, Plot, StudyResult};
use crate::study::{Bar, Level, Quantity, Section, Study, columns, last, series};
use std::f64::consts::TAU;
use sutura_scene::Outcome;

/// Length of the hanging chains \[m\].
const LENGTH: f64 = 0.3;
const CHAIN: &str = "chain of n links";

pub fn section() -> Section {
    let mut section = Section::new(
        2,
        "Catenary, heavy elastica, hanging chain",
        "A thread without bending stiffness is a chain of rigid links with its mass at the joints: it is compared with that chain, link by link. \
         Forces are over the weight, lengths over the length. Frequencies are those of the chain after what implicit Euler makes of them, \
         atan(w h) / h.",
    );
    for span in [0.3, 0.5, 0.8, 0.95] {
        section.studies.push(hanging(span, 0.0));
    }
    section.studies.push(hanging(0.5, 0.2));
    for weight in [100.0, 1000.0, 10_000.0] {
        section.studies.push(heavy(weight, Ends::Pinned));
        section.studies.push(heavy(weight, Ends::Clamped));
    }
    let force = |o: &Outcome| 1e3 * last(o, "right_force.x");
    section.studies.push(independence(
        "chain, span 0.5, other settings",
        0.1,
        hanging(0.5, 0.0).levels(Vec::new()),
        "horizontal force [mN]",
        force,
    ));
    for mode in 0..3 {
        section.studies.push(swinging(mode));
    }
    section.studies.push(dropped());
    section.plots = plots;
    section
}

fn hanging(span: f64, rise: f64) -> Study {
    const COUNTS: [u32; 3] = [20, 40, 80];
    let end = [span * LENGTH, 0.0, rise * LENGTH];
    // Two legs of half the length each.
    let chord = span.hypot(rise);
    let depth = (0.25 - 0.25 * chord * chord).sqrt() / chord;
    let low = [(0.5 * span + depth * rise) * LENGTH, 0.0, (0.5 * rise - depth * span) * LENGTH];
    let weight = T2.weight() * LENGTH;
    let of = |f: &dyn Fn((f64, [f64; 2], Vec<f64>)) -> f64| {
        COUNTS.iter().map(|n| f(links::catenary(*n as usize, span, rise))).collect::<Vec<_>>()
    };
    let lowest = |outcome: &Outcome| {
        // Elements report their middles; the lowest particle is the start of the last one that goes down, by its slope.
        let z = columns(outcome, "along", ["z"]);
        let mut height = 0.0;
        let mut least: f64 = 0.0;
        for [middle] in z {
            // Start, middle, end of an element are on a line.
            height += 2.0 * (middle - height);
            least = least.min(height);
        }
        -least / LENGTH
    };
    let mut study = Study::new(
        if rise == 0.0 { format!("chain, span {span}") } else { format!("chain, span {span}, rise {rise}") },
        "chain_hanging",
    )
    .levels(
        COUNTS
            .map(|n| Level::new(n.to_string(), 1.0 / f64::from(n), &[("thread.chain.points", legs(n, low, end))]))
            .into(),
    )
    .quick(span == 0.5 && rise == 0.0)
    .quantity(Quantity::measured(
        "sag",
        lowest,
        of(&|c| -c.2.iter().copied().fold(0.0, f64::min)),
        CHAIN,
        Bar::Within(0.001),
    ))
    .quantity(
        Quantity::last("horizontal force", "right_force.x", 1.0 / weight, 0.0, CHAIN, Bar::Within(0.005))
            .references(of(&|c| c.0)),
    )
    .quantity(
        Quantity::last("tension, first link", "first", 1.0 / weight, 0.0, CHAIN, Bar::Within(0.005))
            .references(of(&|c| c.1[0])),
    )
    .quantity(
        Quantity::last("tension, last link", "last", 1.0 / weight, 0.0, CHAIN, Bar::Within(0.005))
            .references(of(&|c| c.1[1])),
    )
    .quantity(Quantity::measured(
        "greatest elongation",
        |o| last(o, "elongation"),
        Vec::new(),
        "inextensible",
        Bar::AtMost(1e-4),
    ));
    if rise == 0.0 {
        let [sag, ..] = catenary::level(span);
        study = study.quantity(Quantity::measured("sag", lowest, vec![sag], "catenary", Bar::Order(0.01, 1.8))).curve(
            |outcome| columns(outcome, "along", ["x", "z"]).iter().map(|[x, z]| (x / LENGTH, z / LENGTH)).collect(),
        );
    }
    study
}

/// Points of two straight legs from the origin over `low` to `end`, with n links.
fn legs(n: u32, low: [f64; 3], end: [f64; 3]) -> String {
    let between = |a: [f64; 3], b: [f64; 3], part: f64| vector(std::array::from_fn(|k| a[k] + part * (b[k] - a[k])));
    let point = |i: u32| {
        let part = 2.0 * f64::from(i) / f64::from(n);
        if part < 1.0 { between([0.0; 3], low, part) } else { between(low, end, part - 1.0) }
    };
    format!("[{}]", (0..=n).map(point).collect::<Vec<_>>().join(", "))
}

fn heavy(weight: f64, ends: Ends) -> Study {
    let length = (weight * T1.ei() / T1.weight()).cbrt();
    let (hold, word) = if ends == Ends::Pinned { ("pin", "pinned") } else { ("clamp", "held level") };
    let reference = catenary::heavy(0.5, weight, ends);
    Study::new(format!("heavy elastica, w L^3 / EI = {weight}, {word}"), "heavy_elastica")
        .set("thread.rod.line.to", vector([length, 0.0, 0.0]))
        .set("grip.left.hold", hold)
        .set("grip.right.hold", hold)
        .set("phase.together.action[0].keys[0].to", vector([0.5 * length, 0.0, 0.0]))
        .elements("rod", &[100, 200, 400])
        .quantity(Quantity::last(
            "sag",
            "sag",
            1.0 / length,
            reference,
            "differences, extrapolated",
            Bar::Order(0.01, 1.8),
        ))
}

fn swinging(mode: usize) -> Study {
    let levels = [10, 20, 40].map(|n| {
        let (_, shape) = &links::chain_modes(n)[mode];
        let size = shape.amax();
        // A thousandth of the length across; links keep their length.
        let mut points = vec![[0.0; 3]];
        let link = LENGTH / n as f64;
        for i in 0..n {
            let across = 1e-3 * LENGTH * shape[i] / size;
            let step = across - points[i][0];
            points.push([across, 0.0, points[i][2] - (link * link - step * step).sqrt()]);
        }
        let text: Vec<String> = points.into_iter().map(vector).collect();
        Level::new(n.to_string(), 1.0 / n as f64, &[("thread.chain.points", format!("[{}]", text.join(", ")))])
    });
    let hz = |n: usize| euler_frequency(links::chain_modes(n)[mode].0 * (GRAVITY / LENGTH).sqrt(), 1e-3) / TAU;
    Study::new(format!("hanging chain, mode {}", mode + 1), "chain_swinging")
        .levels(levels.into())
        .quick(mode == 0)
        .quantity(Quantity::measured(
            "frequency [Hz]",
            |outcome| frequency(&series(outcome, "tip")),
            [10, 20, 40].map(hz).to_vec(),
            CHAIN,
            Bar::Within(0.005),
        ))
}

fn dropped() -> Study {
    let mut study = Study::new("chain let go level", "chain_dropped").substeps(&[1e-4, 5e-5, 2.5e-5]);
    for time in [0.08, 0.12, 0.16, 0.20] {
        let exact = links::chain_swing(10, 0.1, time);
        let off = move |outcome: &Outcome| {
            let tip = columns(outcome, "tip", ["time", "x", "z"]).into_iter().find(|r| (r[0] - time).abs() < 1e-6);
            tip.map_or(f64::NAN, |[_, x, z]| 1e3 * (x - exact[0]).hypot(z - exact[1]))
        };
        let name = format!("tip at {time} s, distance from ({:.4}, {:.4}) mm [mm]", 1e3 * exact[0], 1e3 * exact[1]);
        study = study.quantity(
            Quantity::measured(name, off, vec![0.0], "equations of motion", Bar::Order(0.01, 0.8)).scale(100.0),
        );
    }
    study.quantity(Quantity::measured(
        "greatest elongation",
        |o| o.report.work.max_length_error,
        Vec::new(),
        "inextensible",
        Bar::AtMost(1e-4),
    ))
}

fn plots(studies: &[StudyResult]) -> Vec<Plot> {
    let mut curves = Vec::new();
    for span in [0.3, 0.5, 0.8, 0.95] {
        let [sag, a, _] = catenary::level(span);
        let height = |x: f64| a * ((x - 0.5 * span) / a).cosh() - a - sag;
        let points = (0..=60).map(|i| span * f64::from(i) / 60.0).map(|x| (x, height(x))).collect();
        curves.push(Curve { name: format!("catenary, span {span}"), points, dots: false });
        if let Some(s) = studies.iter().find(|s| s.name == format!("chain, span {span}")) {
            curves.push(Curve { name: format!("span {span}, ours"), points: s.curve.clone(), dots: true });
        }
    }
    vec![Plot {
        file: "catenary",
        title: "Chains of 80 links between two pins".into(),
        x: ("x / L", ""),
        y: ("z / L", ""),
        curves,
    }]
}
