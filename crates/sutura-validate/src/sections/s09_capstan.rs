//! Threads around a cylinder.

use super::vector;
use crate::reference::material::T2;
use crate::results::{Curve, Plot, StudyResult};
use crate::study::{Bar, Level, Quantity, Section, Study, series};
use std::f64::consts::PI;
use sutura_scene::Outcome;

const CASES: [(f64, f64); 5] = [(0.1, 180.0), (0.2, 180.0), (0.3, 180.0), (0.2, 360.0), (0.3, 360.0)];

pub fn section() -> Section {
    let mut section = Section::new(
        9,
        "Capstan",
        "A limp thread (0.20 mm, 0.2 GPa) around a cylinder of 20 mm, 100 mN at one end, the other drawn at 4 to 15 mm/s: the ratio of the forces while it slides, \
         mean over the last half second, against exp(mu phi). Bending stiffness (EI / 2 R^2 = 0.02 mN) matters by less than 0.1 %. \
         At 0.97 of the limit it must not creep for a minute, at 1.03 it must slide.",
    );
    for (mu, degrees) in CASES {
        section.studies.push(sliding(mu, degrees));
    }
    section.studies.push(held(0.97));
    section.studies.push(held(1.03));
    section.plots = plots;
    section
}

fn ratio(o: &Outcome) -> f64 {
    let pull = series(o, "pull");
    let end = pull.last().map_or(0.0, |p| p.0);
    let late: Vec<f64> = pull.iter().filter(|p| p.0 > end - 0.5).map(|p| p.1).collect();
    late.iter().sum::<f64>() / late.len() as f64 / 0.1
}

fn sliding(mu: f64, degrees: f64) -> Study {
    // One turn moves along the cylinder by ten diameters, and leaves upward.
    let turns = degrees / 360.0;
    let advance = if degrees > 180.0 { 2e-3 } else { 0.0 };
    let angle = degrees.to_radians();
    let out = 0.02012;
    // From below on the left over the top; the leaving end points along the tangent.
    let (x, z) = (-out * angle.cos(), out * angle.sin());
    let tangent = [angle.sin(), 0.0, angle.cos()];
    let exit = [x + 0.035 * tangent[0], advance, z + 0.035 * tangent[2]];
    let path = format!(
        "[{{ from = {} }}, {{ line_to = {} }}, {{ arc = {{ center = [0, 0, 0], axis = [0, 1, 0], angle = {angle:e}, advance = {advance:e} }} }}, {{ line_to = {} }}]",
        vector([-out, 0.0, -0.035]),
        vector([-out, 0.0, 0.0]),
        vector(exit)
    );
    let exact = (mu * angle).exp();
    // Farther than the thread stretches, so that all of it slides.
    let drawn = 0.008 + 0.1 * exact * 0.2 / T2.ea();
    let sign = tangent[2];
    let ends = |n: u32| Level::new(n.to_string(), 1.0 / f64::from(n), &[("thread.thread.elements", n.to_string())]);
    let counts = if turns > 0.5 { [195, 260] } else { [130, 180] };
    Study::new(format!("mu = {mu}, {degrees} degrees"), "capstan")
        .set("friction.pair[0].mu", mu)
        .set("thread.thread.path", path)
        .set("phase.draw.action[0].keys[0].by", vector([0.0, 0.0, drawn * sign]))
        .levels(counts.map(ends).into())
        .quick(mu == 0.2 && degrees == 180.0)
        .quantity(Quantity::measured("T2 / T1", move |o| ratio(o) * -sign, vec![exact], "capstan", Bar::Within(0.005)))
}

fn held(part: f64) -> Study {
    let force = part * 0.1 * (0.2 * PI).exp();
    let study = Study::new(format!("held at {part} of the limit, 60 s"), "capstan_hold")
        .set("phase.pull.action[0].force", vector([0.0, 0.0, -force]));
    let moved = |o: &Outcome| {
        let slid: Vec<f64> = series(o, "slid").into_iter().filter(|p| p.0 >= 2.5).map(|p| p.1).collect();
        1e3 * slid.iter().map(|s| (s - slid[0]).abs()).fold(0.0, f64::max)
    };
    if part < 1.0 {
        study.quantity(Quantity::measured("creep [mm]", moved, Vec::new(), "none", Bar::AtMost(0.01)))
    } else {
        study.quantity(Quantity::measured(
            "slid at the end [mm]",
            |o| 1e3 * (crate::study::last(o, "slid") - 0.035),
            Vec::new(),
            "slides",
            Bar::AtLeast(3.0),
        ))
    }
}

fn plots(studies: &[StudyResult]) -> Vec<Plot> {
    let exact = (0..=50).map(|i| 0.04 * f64::from(i)).map(|x| (x, x.exp())).collect();
    let found = CASES.iter().filter_map(|(mu, degrees)| {
        let study = studies.iter().find(|s| s.name == format!("mu = {mu}, {degrees} degrees"))?;
        Some((mu * degrees.to_radians(), *study.row("T2 / T1")?.values.last()?))
    });
    let mut ours: Vec<(f64, f64)> = found.collect();
    ours.sort_by(|a, b| a.0.total_cmp(&b.0));
    let curves = vec![
        Curve { name: "exp(mu phi)".into(), points: exact, dots: false },
        Curve { name: "ours".into(), points: ours, dots: true },
    ];
    vec![Plot {
        file: "capstan",
        title: "Ratio of the forces of a thread that slides around a cylinder".into(),
        x: ("mu phi", ""),
        y: ("T2 / T1", ""),
        curves,
    }]
}
