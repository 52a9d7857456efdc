//! Cantilevers against the elastica.

use super::{ELEMENTS, independence, vector};
use crate::reference::material::{GRAVITY, T1};
use crate::reference::{elastica, links};
use crate::results::{Curve, Plot, StudyResult};
use crate::study::{Bar, LeftOut, Quantity, Section, Study, columns, last};
use std::f64::consts::TAU;
use sutura_scene::Outcome;

/// Length of the rods under a tip load \[m\].
const LENGTH: f64 = 0.05;
const TIP_LOADS: [f64; 8] = [0.1, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0];
const WEIGHTS: [f64; 8] = [0.5, 1.0, 2.0, 5.0, 8.0, 10.0, 20.0, 50.0];
/// Shapes that are drawn.
const DRAWN: [f64; 4] = [1.0, 3.0, 10.0, 20.0];

pub fn section() -> Section {
    let mut section = Section::new(
        1,
        "Cantilever: tip load, own weight, tip moment",
        "2-0 monofilament T1 (0.30 mm, 2 GPa, nu 0.4, 1150 kg/m^3), clamped level. k = P L^2 / EI with L = 50 mm, g = w L^3 / EI. The chain of n \
         rigid links has joints of n EI / L, half of one at the clamp, and half of a link's mass at its end: what remains against it are \
         the rod's shear and stretch (some 1e-5) and the solver.",
    );
    let drop = |o: &Outcome| -1e3 * last(o, "tip.z");
    for k in TIP_LOADS {
        section.studies.push(tip_load(k));
    }
    for g in WEIGHTS {
        section.studies.push(self_weight(g));
    }
    for turns in [0.125, 0.25, 0.5, 0.75] {
        section.studies.push(tip_moment(turns));
    }
    section.studies.push(independence("tip load k = 5, other settings", 0.1, loaded(5.0), "drop [mm]", drop));
    section.studies.push(independence("own weight g = 5, other settings", 0.1, weighted(5.0), "drop [mm]", drop));
    section.plots = plots;
    section.left_out = &[LeftOut {
        what: "tip moment of a whole turn",
        why: "a moment that keeps its direction has no energy; beyond three quarters of a turn or so the rod flutters out of its plane (the run \
              does not come to rest), and at a whole turn its end would lie in its start",
    }];
    section
}

/// The cantilever with a tip load.
fn loaded(k: f64) -> Study {
    Study::new(format!("tip load k = {k}"), "cantilever")
        .set("phase.load.action[0].force", vector([0.0, 0.0, -k * T1.ei() / (LENGTH * LENGTH)]))
}

fn tip_load(k: f64) -> Study {
    let [x, drop, slope] = elastica::tip_load(k);
    let source = "elliptic integrals";
    let study = loaded(k)
        .elements("rod", &ELEMENTS)
        .quick(k == 5.0)
        .quantity(Quantity::last("reach / L", "tip.x", 1.0 / LENGTH, x, source, Bar::Order(0.01, 1.8)))
        .quantity(Quantity::last("drop / L", "tip.z", -1.0 / LENGTH, drop, source, Bar::Order(0.01, 1.8)))
        .quantity(Quantity::last("slope at the tip [rad]", "slope", 1.0, slope, source, Bar::Order(0.01, 1.8)))
        .quantity(discrete("drop / L", LENGTH, k, 0.0));
    if DRAWN.contains(&k) {
        study.curve(|outcome| {
            columns(outcome, "along", ["x", "z"]).iter().map(|[x, z]| (x / LENGTH, z / LENGTH)).collect()
        })
    } else {
        study
    }
}

/// Drop against that of a chain of as many links.
fn discrete(name: &str, length: f64, k: f64, g: f64) -> Quantity {
    let references = ELEMENTS.iter().map(|n| links::cantilever(*n as usize, k, g)[1]).collect();
    Quantity::last(name, "tip.z", -1.0 / length, 0.0, "chain of n links", Bar::Within(0.005)).references(references)
}

/// The cantilever under its own weight: a longer one weighs more.
fn weighted(g: f64) -> Study {
    let length = (g * T1.ei() / T1.weight()).cbrt();
    Study::new(format!("own weight g = {g}"), "cantilever")
        .set("thread.rod.line.to", vector([length, 0.0, 0.0]))
        .set("phase.load.action[0]", format!("{{ gravity = {}, ramp = \"1 s\" }}", vector([0.0, 0.0, -GRAVITY])))
}

fn self_weight(g: f64) -> Study {
    let [x, drop, slope] = elastica::self_weight(g);
    let length = (g * T1.ei() / T1.weight()).cbrt();
    let source = "shooting";
    weighted(g)
        .elements("rod", &ELEMENTS)
        .quick(g == 5.0)
        .quantity(Quantity::last("reach / L", "tip.x", 1.0 / length, x, source, Bar::Order(0.01, 1.8)))
        .quantity(Quantity::last("drop / L", "tip.z", -1.0 / length, drop, source, Bar::Order(0.01, 1.8)))
        .quantity(Quantity::last("slope at the tip [rad]", "slope", 1.0, slope, source, Bar::Order(0.01, 1.8)))
        .quantity(discrete("drop / L", length, 0.0, g))
}

/// A moment M = 2 pi a EI / L bends the rod to an arc of a turns.
fn tip_moment(turns: f64) -> Study {
    let angle = TAU * turns;
    let moment = angle * T1.ei() / LENGTH;
    let exact = [angle.sin() / angle, (1.0 - angle.cos()) / angle];
    Study::new(format!("tip moment, {turns} turns"), "cantilever")
        .set(
            "phase.load.action[0]",
            format!("{{ load = \"tip\", at = \"end\", torque = {}, ramp = \"4 s\" }}", vector([0.0, moment, 0.0])),
        )
        .elements("rod", &ELEMENTS)
        .quantity(Quantity::last("reach / L", "tip.x", 1.0 / LENGTH, exact[0], "arc", Bar::Order(0.01, 1.8)).scale(1.0))
        .quantity(Quantity::last("drop / L", "tip.z", -1.0 / LENGTH, exact[1], "arc", Bar::Order(0.01, 1.8)).scale(1.0))
}

fn plots(studies: &[StudyResult]) -> Vec<Plot> {
    let mut curves = Vec::new();
    for k in DRAWN {
        let points = elastica::tip_load_shape(k, 50).into_iter().map(|(x, drop)| (x, -drop)).collect();
        curves.push(Curve { name: format!("k = {k}"), points, dots: false });
        if let Some(study) = studies.iter().find(|s| s.name == format!("tip load k = {k}")) {
            // Every fifth element, so that the line is seen.
            let points = study.curve.iter().skip(2).step_by(5).copied().collect();
            curves.push(Curve { name: format!("k = {k}, ours"), points, dots: true });
        }
    }
    vec![Plot {
        file: "elastica",
        title: "Cantilever under a tip load k = P L² / EI".into(),
        x: ("x / L", ""),
        y: ("z / L", ""),
        curves,
    }]
}
