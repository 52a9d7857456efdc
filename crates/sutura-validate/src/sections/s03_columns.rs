//! Columns that stand, fall and buckle.

use super::{ELEMENTS, independence, vector};
use crate::reference::elastica;
use crate::reference::links::{self, End};
use crate::reference::material::{GRAVITY, T1};
use crate::results::{Curve, Plot, StudyResult};
use crate::study::{Bar, LeftOut, Level, Quantity, Section, Study, last};
use std::f64::consts::PI;
use sutura_scene::Outcome;

const LENGTH: f64 = 0.05;
/// Columns stand or fall at these parts of the load of the chain of as many links.
const PARTS: [f64; 2] = [0.95, 1.05];
const COUNTS: [usize; 2] = [20, 50];
const PINNED: [f64; 6] = [0.02, 0.05, 0.1, 0.2, 0.3, 0.5];
const CLAMPED: [f64; 3] = [0.05, 0.15, 0.4];

pub fn section() -> Section {
    let mut section = Section::new(
        3,
        "Buckling",
        "Columns of 2-0 monofilament under 0.95 and 1.05 of the critical load of a chain of as many links (eigenvalues): after a nudge that moves \
         them by about a thousandth of their length they stand, or fall. Columns shortened by a part e of their length, against the elastica: \
         load over Euler's, bow over length.",
    );
    for (name, start, end) in [
        ("pinned", End::Pinned, End::Pinned),
        ("clamped and pinned", End::Clamped, End::Pinned),
        ("clamped", End::Clamped, End::Clamped),
    ] {
        for part in PARTS {
            let load = |n| part * links::critical_load(n, start, end) * T1.ei() / (LENGTH * LENGTH);
            let levels = COUNTS.map(|n| level(n, &[("grip.head.force", format!("{:e}", load(n)))]));
            let study = Study::new(format!("{name}, {part} of the critical load"), "column")
                .set("grip.foot.hold", hold(start))
                .set("grip.head.hold", hold(end));
            section.studies.push(stands(study.levels(levels.into()), part, LENGTH).quick(start == End::Pinned));
        }
    }
    for part in PARTS {
        let load = |n| part * links::critical_load(n, End::Clamped, End::Free) * T1.ei() / (LENGTH * LENGTH);
        let levels = COUNTS.map(|n| level(n, &[("phase.nudge.action[0].force", vector([0.0, 0.0, -load(n)]))]));
        section.studies.push(stands(
            Study::new(format!("clamped and free, {part} of the critical load"), "column_free").levels(levels.into()),
            part,
            LENGTH,
        ));
    }
    for part in PARTS {
        let length = |n| (part * links::heavy_column(n) * T1.ei() / T1.weight()).cbrt();
        let levels = COUNTS.map(|n| level(n, &[("thread.rod.line.to", vector([0.0, 0.0, length(n)]))]));
        let study = Study::new(format!("own weight, {part} of the critical one"), "column_free")
            .set("solver.gravity", vector([0.0, 0.0, -GRAVITY]))
            .set("solver.substep", "5 ms");
        section.studies.push(stands(study.levels(levels.into()), part, 0.2));
    }
    for e in PINNED {
        section.studies.push(buckled(e, End::Pinned));
    }
    for e in CLAMPED {
        section.studies.push(buckled(e, End::Clamped));
    }
    let load = |o: &Outcome| 1e3 * last(o, "load");
    section.studies.push(independence(
        "pinned, shortened by 0.2, other settings",
        5e-3,
        buckled(0.2, End::Pinned),
        "load [mN]",
        load,
    ));
    section.plots = plots;
    section.left_out = &[LeftOut {
        what: "guidewire in a straight vessel",
        why: "there is no hollow shape but a mesh, not set up yet",
    }];
    section
}

fn hold(end: End) -> &'static str {
    if end == End::Clamped { "clamp" } else { "pin" }
}

fn level(n: usize, settings: &[(&str, String)]) -> Level {
    let mut level = Level::new(n.to_string(), 0.0, settings);
    level.settings.push(("thread.rod.elements".into(), n.to_string()));
    level
}

fn stands(study: Study, part: f64, length: f64) -> Study {
    let bar = if part < 1.0 { Bar::AtMost(1e-3) } else { Bar::AtLeast(0.05) };
    study.quantity(Quantity::measured(
        "bow / L at the end",
        move |o| last(o, "bow") / length,
        Vec::new(),
        "stands below, falls above",
        bar,
    ))
}

fn buckled(e: f64, ends: End) -> Study {
    let [load, bow] = elastica::buckled(e);
    let (euler, word) = if ends == End::Pinned { (PI * PI, "pinned") } else { (4.0 * PI * PI, "clamped") };
    Study::new(format!("{word}, shortened by {e}"), "buckled")
        .set("grip.left.hold", hold(ends))
        .set("grip.right.hold", hold(ends))
        .set("phase.together.action[0].keys[0].by", vector([-e * LENGTH, 0.0, 0.0]))
        .elements("rod", &ELEMENTS)
        .quick(e == 0.2)
        .quantity(Quantity::last(
            "load over Euler's",
            "load",
            LENGTH * LENGTH / (T1.ei() * euler),
            load,
            "elliptic integrals",
            Bar::Order(0.01, 1.8),
        ))
        .quantity(Quantity::last("bow / L", "bow", 1.0 / LENGTH, bow, "elliptic integrals", Bar::Order(0.01, 1.8)))
}

fn plots(studies: &[StudyResult]) -> Vec<Plot> {
    let buckled = (1..=60).map(|i| 0.55 * f64::from(i) / 60.0).map(|e| (e, elastica::buckled(e)[0]));
    let exact = std::iter::once((0.0, 1.0)).chain(buckled).collect();
    let ours = |word: &str, shortenings: &[f64]| {
        let found = shortenings.iter().filter_map(|e| {
            let study = studies.iter().find(|s| s.name == format!("{word}, shortened by {e}"))?;
            Some((*e, *study.row("load over Euler's")?.values.last()?))
        });
        found.collect::<Vec<_>>()
    };
    let curves = vec![
        Curve { name: "elastica".into(), points: exact, dots: false },
        Curve { name: "pinned, ours".into(), points: ours("pinned", &PINNED), dots: true },
        Curve { name: "clamped, ours".into(), points: ours("clamped", &CLAMPED), dots: true },
    ];
    vec![Plot {
        file: "buckling",
        title: "Load of a buckled column over Euler's".into(),
        x: ("shortening / L", ""),
        y: ("P / P Euler", ""),
        curves,
    }]
}
