//! Naturally curved cantilevers under a load across their plane.

use super::{ELEMENTS, vector};
use crate::reference::kirchhoff::Cantilever;
use crate::reference::material::{Rod, T1};
use crate::study::{Bar, LeftOut, Quantity, Section, Study};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

pub fn section() -> Section {
    let mut section = Section::new(
        6,
        "Bend of 45 degrees (Bathe and Bolourchi 1979)",
        "An arc that is an arc at rest, clamped along y, bends toward x; a dead load at its tip along z. Tip positions over the radius, against the \
         Kirchhoff rod by shooting. k = P R^2 / EI. The case of the literature (R = 100, unit square section, E = 1e7, nu = 0, P = 300, 450, 600) is \
         run with a round section of the same EI and GJ = EI, inextensible: for P = 600 the tip is (15.6851, 47.1513, 53.4686).",
    );
    for (k, angle) in [(1.0, FRAC_PI_4), (3.6, FRAC_PI_4), (7.2, FRAC_PI_4), (1.0, FRAC_PI_2)] {
        let name = format!("2-0 monofilament, R = 20 mm, {} degrees, k = {k}", (angle.to_degrees()).round());
        section.studies.push(arc(name, T1, 0.02, angle, k, k == 7.2));
    }
    // A diameter of 2 keeps shear and stretch as small as they are in the literature's rod; E then follows from EI. It is light, so that it comes to rest soon.
    let thin = Rod { diameter: 2.0, young: 1e7 / 12.0 * 4.0 / PI, poisson: 0.0, density: 1e-6 };
    for load in [300.0, 450.0, 600.0] {
        section.studies.push(arc(format!("R = 100, GJ = EI, P = {load}"), thin, 100.0, FRAC_PI_4, load * 1e4 / thin.ei(), false));
    }
    section.left_out = &[LeftOut { what: "the square section itself, with its true torsion constant", why: "sections are round" }];
    section
}

fn arc(name: String, rod: Rod, radius: f64, angle: f64, k: f64, quick: bool) -> Study {
    let load = k * rod.ei() / (radius * radius);
    let exact = Cantilever {
        start: [0.0; 3],
        frame: [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        length: radius * angle,
        stiffness: [rod.ei(), rod.gj()],
        rest: [-1.0 / radius, 0.0, 0.0],
        force: [0.0, 0.0, load],
        moment: [0.0; 3],
    }
    .tip()
    .position;
    let mut study = Study::new(name, "arc")
        .set("thread.rod.diameter", format!("{:e}", rod.diameter))
        .set("thread.rod.young_modulus", format!("{:e}", rod.young))
        .set("thread.rod.poisson_ratio", rod.poisson)
        .set("thread.rod.density", rod.density)
        .set("thread.rod.arc.center", vector([radius, 0.0, 0.0]))
        .set("thread.rod.arc.angle", format!("{angle:e}"))
        .set("phase.load.action[0].force", vector([0.0, 0.0, load]))
        .set("phase.settle.until", format!("speed(rod) < {:e} m/s", 1e-7 * radius))
        .elements("rod", &ELEMENTS)
        .quick(quick);
    for (i, probe) in ["tip.x", "tip.y", "tip.z"].into_iter().enumerate() {
        let name = format!("{} / R", probe.replace('.', " "));
        study = study.quantity(Quantity::last(name, probe, 1.0 / radius, exact[i] / radius, "shooting", Bar::Order(0.005, 1.8)));
    }
    study
}
