//! Recognition of knots.

use crate::reference::curves;
use crate::study::{Bar, LeftOut, Quantity, Section, Study};
use sutura::glam::{DQuat, DVec3};
use sutura::knot::{Ends, Recognition, recognize};

/// Crossings of the throws, name, determinant, signature.
const THROWS: [(&[i32], &str, f64, f64); 12] = [
    (&[1], "unknot", 1.0, 0.0),
    (&[3], "trefoil-right", 3.0, -2.0),
    (&[-3], "trefoil-left", 3.0, 2.0),
    (&[5], "double-throw-right", 5.0, -4.0),
    (&[3, -3], "square", 9.0, 0.0),
    (&[3, 3], "granny-right", 9.0, -4.0),
    (&[-3, -3], "granny-left", 9.0, 4.0),
    (&[5, -3], "surgeon-square-right", 15.0, -2.0),
    (&[5, 3], "surgeon-granny-right", 15.0, -6.0),
    (&[3, -3, 3], "square-and-throw-right", 27.0, -2.0),
    (&[3, 3, 3], "", 27.0, -6.0),
    (&[5, -3, 3], "", 45.0, -4.0),
];

/// Ways in which each curve is turned before it is looked at.
const TURNS: u32 = 20;

pub fn section() -> Section {
    let mut section = Section::new(
        12,
        "Recognition of knots",
        "Closed curves of known type, each turned in 20 ways: determinant and signature (KnotInfo; the connected sum multiplies the first and adds the second), \
         and how often the name is right. A throw is given by its crossings, positive ones right-handed.",
    );
    for (throws, name, determinant, signature) in THROWS {
        let title = format!("throws {}", throws.iter().map(|c| format!("{c:+}")).collect::<Vec<_>>().join(" "));
        section
            .studies
            .push(knot(title, curves::stacked_throws(throws), name, determinant, signature).quick(throws.len() == 2));
    }
    section.studies.push(knot("figure-eight".into(), curves::figure_eight(200), "figure-eight", 5.0, 0.0));
    section.studies.push(knot("torus knot 7".into(), curves::torus_knot(7, 300), "", 7.0, -6.0));
    section.studies.push(knot("torus knot 9".into(), curves::torus_knot(9, 300), "", 9.0, -8.0));
    section.left_out = &[LeftOut {
        what: "knots while they are tied, open ends",
        why: "in the tests of the engine (crates/sutura/tests/knots.rs) and the sample scenes",
    }];
    section
}

fn knot(title: String, points: Vec<[f64; 3]>, name: &'static str, determinant: f64, signature: f64) -> Study {
    let seen = move || -> Vec<Recognition> {
        let turn = |k: u32| {
            let k = f64::from(k);
            let q = DQuat::from_rotation_z(2.4 * k) * DQuat::from_rotation_x(1.1 * k) * DQuat::from_rotation_y(0.7 * k);
            points.iter().map(|p| q * DVec3::from(*p)).collect::<Vec<_>>()
        };
        (0..TURNS).map(|k| recognize(&turn(k), Ends::Closed, u64::from(k))).collect()
    };
    let seen = std::sync::Arc::new(std::sync::LazyLock::new(seen));
    // The value farthest from what is wanted.
    let worst = |seen: &[Recognition], of: &dyn Fn(&Recognition) -> f64, wanted: f64| {
        seen.iter().map(of).fold(wanted, |a, v| if (v - wanted).abs() > (a - wanted).abs() { v } else { a })
    };
    let (first, second, third) = (seen.clone(), seen.clone(), seen);
    let mut study = Study::direct(title)
        .quantity(Quantity::measured(
            "determinant",
            move |_| worst(&first, &|r| r.determinant as f64, determinant),
            vec![determinant],
            "KnotInfo",
            Bar::Within(0.0),
        ))
        .quantity(
            Quantity::measured(
                "signature",
                move |_| worst(&second, &|r| f64::from(r.signature), signature),
                vec![signature],
                "KnotInfo",
                Bar::Within(0.0),
            )
            .scale(1.0),
        );
    if !name.is_empty() {
        let right = move |_: &sutura_scene::Outcome| {
            third.iter().filter(|r| r.knot.name() == name).count() as f64 / f64::from(TURNS)
        };
        study = study.quantity(Quantity::measured(
            format!("part recognized as {name}"),
            right,
            vec![1.0],
            "known",
            Bar::Within(0.0),
        ));
    }
    study
}
