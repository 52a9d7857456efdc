//! Localized helical buckling.

use super::vector;
use crate::reference::material::T1;
use crate::reference::twist::{self, Helix};
use crate::results::{Curve, Plot, StudyResult};
use crate::study::{Bar, Quantity, Section, Study, last, series};
use std::f64::consts::TAU;
use sutura_scene::Outcome;

const LENGTH: f64 = 0.2;
/// Shortening \[m\] and turns.
const CASES: [(f64, f64); 2] = [(0.010, 12.0), (0.020, 8.0)];

pub fn section() -> Section {
    let mut section = Section::new(
        5,
        "Localized helical buckling",
        "A clamped rod of 200 mm is shortened and turned. Far from its ends the solution is known in closed form; the envelope is \
         (cos a - cos a_max) / (1 - cos a_max) = tanh^2 of the distance from the middle, a the angle of the tangent with the axis.",
    );
    for case in CASES {
        section.studies.push(study(case));
    }
    section.plots = plots;
    section
}

fn helix((shortening, turns): (f64, f64)) -> Helix {
    twist::localized(shortening / LENGTH, turns * TAU, T1.gj() / T1.ei())
}

/// Envelope over the distance from the middle times its decay, from the chords of the last recorded frame.
fn envelope(outcome: &Outcome, h: &Helix) -> Vec<(f64, f64)> {
    let Some(points) = outcome.trajectory.frames.last().and_then(|f| f.positions.first()) else { return Vec::new() };
    let n = (points.len() - 1) as f64;
    let one = |(i, w): (usize, &[[f32; 3]])| {
        let d: [f64; 3] = std::array::from_fn(|k| f64::from(w[1][k]) - f64::from(w[0][k]));
        let cos = d[0] / d.iter().map(|c| c * c).sum::<f64>().sqrt();
        let s = (i as f64 + 0.5) / n - 0.5;
        (h.decay * s, (cos - h.angle.cos()) / (1.0 - h.angle.cos()))
    };
    points.windows(2).enumerate().map(one).collect()
}

fn study(case: (f64, f64)) -> Study {
    let (shortening, turns) = case;
    let h = helix(case);
    let source = "closed form, long rod";
    let error =
        move |o: &Outcome| envelope(o, &h).iter().map(|(x, f)| (f - x.tanh().powi(2)).abs()).fold(f64::NAN, f64::max);
    let lost = move |o: &Outcome| {
        let n = o.report.threads.first().map_or(f64::NAN, |t| t.elements as f64);
        // Twist counts from the middle of the first element to that of the last one.
        (last(o, "turns") / turns / (1.0 - 1.0 / n) - 1.0).abs() * turns
    };
    let jump = |o: &Outcome| series(o, "turns").windows(2).map(|w| (w[1].1 - w[0].1).abs()).fold(0.0, f64::max);
    Study::new(name(case), "localized")
        .set("phase.together.action[0].keys[0].by", vector([-shortening, 0.0, 0.0]))
        .set("phase.turn.action[1].keys[0].turn.angle", format!("{:e}", turns * TAU))
        .elements("rod", &[100, 200, 400])
        .quantity(Quantity::last(
            "tension [mN]",
            "tension",
            1e3,
            1e3 * h.tension * T1.ei() / (LENGTH * LENGTH),
            source,
            Bar::Within(0.02),
        ))
        .quantity(Quantity::last(
            "torque [mN m]",
            "torque",
            1e3,
            1e3 * h.moment * T1.ei() / LENGTH,
            source,
            Bar::Within(0.02),
        ))
        .quantity(
            Quantity::measured("largest error of the envelope", error, vec![0.0], source, Bar::Within(0.02)).scale(1.0),
        )
        .quantity(Quantity::measured("turns lost of twist + writhe", lost, Vec::new(), "conserved", Bar::AtMost(0.01)))
        .quantity(Quantity::measured(
            "largest change of twist + writhe in a frame [turns]",
            jump,
            Vec::new(),
            "2 where a strand passes through",
            Bar::AtMost(0.5),
        ))
        .curve(move |o| envelope(o, &h))
}

fn name((shortening, turns): (f64, f64)) -> String {
    format!("{} mm, {turns} turns", 1e3 * shortening)
}

fn plots(studies: &[StudyResult]) -> Vec<Plot> {
    let exact = (-50..=50).map(|i| 0.1 * f64::from(i)).map(|x| (x, x.tanh().powi(2))).collect();
    let mut curves = vec![Curve { name: "tanh²".into(), points: exact, dots: false }];
    for case in CASES {
        if let Some(s) = studies.iter().find(|s| s.name == name(case)) {
            let points = s.curve.iter().step_by(4).copied().filter(|p| p.0.abs() <= 5.0).collect();
            curves.push(Curve { name: format!("{}, ours", s.name), points, dots: true });
        }
    }
    vec![Plot {
        file: "localized",
        title: "Envelope of the localized helix".into(),
        x: ("distance from the middle times decay", ""),
        y: ("envelope", ""),
        curves,
    }]
}
