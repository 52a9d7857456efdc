//! Rods and rings that lose their shape by twist.

use crate::reference::material::T1;
use crate::reference::twist;
use crate::results::{Curve, Plot, StudyResult};
use crate::study::{Bar, Level, Quantity, Section, Study, last, series};
use std::f64::consts::TAU;
use sutura_scene::Outcome;

const LENGTH: f64 = 0.1;
/// Twist put into rings over that at which they leave their plane.
const PARTS: [f64; 8] = [0.8, 0.9, 0.95, 0.99, 1.01, 1.05, 1.1, 1.2];

pub fn section() -> Section {
    let mut section = Section::new(
        4,
        "Instability by twist",
        "Greenhill: a straight rod of 100 mm between two clamps, one of which is drawn along the axis by the tension t = T L^2 / EI; M is its least critical \
         moment (determinant of the linear problem), and the rod is twisted by M L / GJ. Michell: a straight rod closed to a ring of radius 10 mm, free in space, \
         with twist put in before its ends are joined. In the continuum it leaves its plane at 2 pi sqrt 3 EI / GJ, 15.2359 rad here; a ring of n rigid links with the joints of the \
         engine does so at 1.4 / n^2 less (closed form of the discrete problem; discrete elastic rods, whose curvature is 2 tan (p / 2), at some 34 / n^2 more). At 0.99 of the limit \
         the rod and the ring, after a nudge, keep their shape; at 1.01 they lose it. What the ring loses of its twist goes into writhe: their sum is what was put in.",
    );
    for t in [0.02, 10.0, 100.0, 1000.0] {
        for part in [0.99, 1.01] {
            section.studies.push(greenhill(t, part));
        }
    }
    section.studies.push(hold());
    for part in PARTS {
        section.studies.push(michell(part));
    }
    section.plots = plots;
    section
}

fn twisted(name: String, t: f64, part: f64) -> (Study, f64) {
    let moment = part * twist::greenhill(t) * T1.ei() / LENGTH;
    let study = Study::new(name, "twisted")
        .set("grip.left.force", format!("{:e}", t * T1.ei() / (LENGTH * LENGTH)))
        .set("phase.twist.action[0].keys[0].turn.angle", format!("{:e}", moment * LENGTH / T1.gj()));
    (study, moment)
}

fn greenhill(t: f64, part: f64) -> Study {
    let (study, moment) = twisted(format!("rod, t = {t}, {part} of the limit"), t, part);
    let study = study
        .levels(
            [100, 200].map(|n: u32| Level::new(n.to_string(), 0.0, &[("thread.rod.elements", n.to_string())])).into(),
        )
        .quick(t == 10.0);
    let bar = if part < 1.0 { Bar::AtMost(1e-3) } else { Bar::AtLeast(0.01) };
    // What falls goes fast: shorter substeps, so that it is seen before it touches itself.
    let study = if part < 1.0 { study } else { study.set("solver.substep", "0.5 ms").set("frame_rate", 2000) };
    let study = study.quantity(Quantity::measured(
        "off the axis / L",
        |o| last(o, "off_axis") / LENGTH,
        Vec::new(),
        "stays below, leaves above",
        bar,
    ));
    if part < 1.0 {
        study.quantity(Quantity::last(
            "torque over its limit",
            "torque",
            part / moment,
            part,
            "GJ times twist",
            Bar::Within(0.001),
        ))
    } else {
        study
    }
}

/// The torque is held for a minute.
fn hold() -> Study {
    let (study, moment) = twisted("rod, t = 10, held for 60 s at 0.95".into(), 10.0, 0.95);
    let range = move |o: &Outcome| {
        let torque = series(o, "torque");
        let begin = torque.iter().find(|(t, _)| *t >= 3.0).map_or(f64::NAN, |p| p.1);
        torque.iter().filter(|(t, _)| *t >= 3.0).map(|(_, m)| (m - begin).abs()).fold(0.0, f64::max) / moment
    };
    study
        .set("frame_rate", 50)
        .set("phase.stand or fall.max_duration", "60 s")
        .set("solver.substep", "10 ms")
        .set("thread.rod.elements", 50)
        .quantity(Quantity::measured("change of the torque", range, Vec::new(), "none", Bar::AtMost(1e-6)))
        .quantity(Quantity::last(
            "torque over its limit",
            "torque",
            0.95 / moment,
            0.95,
            "GJ times twist",
            Bar::Within(0.001),
        ))
}

fn michell(part: f64) -> Study {
    // Where it is near the limit that of the chain counts; the others are for the picture.
    let counts: &[usize] = if (part - 1.0).abs() < 0.02 { &[50, 100] } else { &[100] };
    let put_in = |n: usize| part * twist::michell(n, T1.gj() / T1.ei()) * T1.ei() / T1.gj();
    let level = |n: &usize| {
        let mut level = Level::new(
            n.to_string(),
            0.0,
            &[("thread.ring.elements", n.to_string()), ("thread.ring.twist", format!("{:e}", put_in(*n)))],
        );
        for (load, quarter) in ["a", "b", "c", "d"].into_iter().zip(0..) {
            level.settings.push((format!("load.{load}.at"), format!("\"particle {}\"", quarter * n / 4)));
        }
        level
    };
    let writhe = |o: &Outcome| last(o, "writhe").abs();
    let (words, bar) =
        if part < 1.0 { ("stays plane", Bar::AtMost(1e-3)) } else { ("leaves its plane", Bar::AtLeast(1.0)) };
    let lost = |o: &Outcome| {
        let link = series(o, "link");
        link.iter().map(|p| (p.1 - link[0].1).abs()).fold(0.0, f64::max)
    };
    Study::new(format!("ring, {part} of Michell's twist"), "ring")
        .levels(counts.iter().map(level).collect())
        .quick(part == 1.01)
        .quantity(Quantity::measured("size of the writhe [turns]", writhe, Vec::new(), words, bar))
        .quantity(Quantity::measured(
            "turns put in",
            |o| series(o, "link").first().map_or(f64::NAN, |p| p.1),
            counts.iter().map(|n| put_in(*n) / TAU).collect(),
            "twist put in",
            Bar::Within(1e-6),
        ))
        .quantity(Quantity::measured(
            "largest change of twist + writhe [turns]",
            lost,
            Vec::new(),
            "kept",
            Bar::AtMost(0.01),
        ))
}

fn plots(studies: &[StudyResult]) -> Vec<Plot> {
    let ours = PARTS.iter().filter_map(|part| {
        let study = studies.iter().find(|s| s.name == format!("ring, {part} of Michell's twist"))?;
        Some((*part, *study.row("size of the writhe [turns]")?.values.last()?))
    });
    let curves = vec![
        Curve { name: "Michell's limit".into(), points: vec![(1.0, 0.0), (1.0, 2.5)], dots: false },
        Curve { name: "100 elements, at rest".into(), points: ours.collect(), dots: true },
    ];
    vec![Plot {
        file: "michell",
        title: "Writhe of a closed ring into which twist was put".into(),
        x: ("twist over Michell's", ""),
        y: ("size of the writhe", "turns"),
        curves,
    }]
}
