//! Linking number and writhe.

use crate::reference::curves;
use crate::study::{Bar, Quantity, Section, Study};
use std::f64::consts::TAU;
use sutura::glam::DVec3;
use sutura::knot::{gauss_linking, writhe};

/// Writhe of the polygon of n points of the torus trefoil (Klenin and Langowski 2000, computed apart).
const POLYGONS: [(usize, f64); 4] = [(50, 3.321_992), (100, 3.333_206), (200, 3.336_092), (400, 3.336_819)];

pub fn section() -> Section {
    let mut section = Section::new(
        11,
        "Linking number and writhe",
        "Gauss' integrals of polygons: the torus trefoil (radius 1, tube 0.4) against values computed apart, and against the double integral of the smooth \
         curve; linking numbers, which are whole. That twist + writhe of a clamped rod and of a closed one keep the turns put in is in sections 5 and 4.",
    );
    let trefoil = |n: usize| curves::torus_knot(3, n).into_iter().map(DVec3::from).collect::<Vec<_>>();
    let mut study = Study::direct("torus trefoil").quick(true);
    for (n, value) in POLYGONS {
        study = study.quantity(Quantity::measured(
            format!("writhe, {n} points"),
            move |_| writhe(&trefoil(n), true),
            vec![value],
            "Python",
            Bar::Within(1e-6),
        ));
    }
    let mirrored = move |_: &sutura_scene::Outcome| {
        writhe(&trefoil(100).iter().map(|p| DVec3::new(p.x, p.y, -p.z)).collect::<Vec<_>>(), true)
    };
    study = study
        .quantity(Quantity::measured(
            "writhe, 800 points",
            move |_| writhe(&trefoil(800), true),
            vec![curves::torus_writhe(3, 1600)],
            "double integral",
            Bar::Within(1e-4),
        ))
        .quantity(Quantity::measured(
            "writhe of its mirror image, 100 points",
            mirrored,
            vec![-3.333_206],
            "Python",
            Bar::Within(1e-6),
        ));
    section.studies.push(study);

    let circle = |n: usize| {
        (0..n).map(|i| TAU * i as f64 / n as f64).map(|t| DVec3::new(t.cos(), t.sin(), 0.0)).collect::<Vec<_>>()
    };
    // A coil around the circle.
    let coil = move |turns: f64| {
        let point = |t: f64| {
            let r = 1.0 + 0.3 * (turns * t).cos();
            DVec3::new(r * t.cos(), r * t.sin(), 0.3 * (turns * t).sin())
        };
        (0..300).map(|i| point(TAU * f64::from(i) / 300.0)).collect::<Vec<_>>()
    };
    let mut study = Study::direct("coil around a circle").quick(true);
    for turns in [-3.0, -1.0, 1.0, 7.0] {
        // Up on the outside is a left-handed coil of positive angle.
        let measure = move |_: &sutura_scene::Outcome| gauss_linking(&circle(200), &coil(turns)).abs();
        study = study.quantity(Quantity::measured(
            format!("size of the linking number, {turns} turns"),
            measure,
            vec![turns.abs()],
            "whole",
            Bar::Within(1e-9),
        ));
    }
    section.studies.push(study);
    section
}
