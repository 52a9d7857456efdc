//! Frames: bending and twist together, roll of a clamp, rotation of the whole scene.

use super::{ELEMENTS, vector};
use crate::reference::kirchhoff::{Cantilever, Station};
use crate::reference::material::T1;
use crate::study::{Bar, Level, Quantity, Section, Study, last};
use std::f64::consts::FRAC_PI_2;

const LENGTH: f64 = 0.05;

pub fn section() -> Section {
    let mut section = Section::new(
        17,
        "Frames",
        "A cantilever of 50 mm of 2-0 monofilament along x, 1 mN along -y at its tip and a dead torque of 2e-5 N m about x there, against the Kirchhoff rod \
         by shooting; the opposite torque mirrors z. What a round, naturally straight rod does depends neither on the roll of its clamp nor on \
         how the whole scene is turned. A section that is four times as stiff about d1 as about d2 (an ellipse), rolled about the rod, and one that turns by 90 degrees along the \
         rod, against shooting with two bending stiffnesses.",
    );
    section.studies.push(twisted(2e-5));
    section.studies.push(twisted(-2e-5));
    section.studies.push(roll());
    section.studies.push(turned());
    for degrees in [0.0, 30.0, 45.0, 90.0] {
        section.studies.push(flat(degrees, 0.0));
    }
    section.studies.push(flat(0.0, FRAC_PI_2));
    section
}

fn exact(moment: f64) -> Station {
    Cantilever {
        start: [0.0; 3],
        frame: [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]],
        length: LENGTH,
        stiffness: [T1.ei(), T1.ei(), T1.gj()],
        rest: [0.0; 3],
        force: [0.0, -1e-3, 0.0],
        moment: [moment, 0.0, 0.0],
    }
    .tip()
}

fn load(force: [f64; 3], torque: [f64; 3]) -> String {
    format!(
        "{{ load = \"tip\", at = \"end\", force = {}, torque = {}, ramp = \"2 s\" }}",
        vector(force),
        vector(torque)
    )
}

fn twisted(moment: f64) -> Study {
    let tip = exact(moment);
    let mut study = Study::new(format!("tip torque {moment:e} N m"), "cantilever")
        .set("phase.load.action[0]", load([0.0, -1e-3, 0.0], [moment, 0.0, 0.0]))
        .elements("rod", &ELEMENTS)
        .quick(moment > 0.0);
    for (i, probe) in ["tip.x", "tip.y", "tip.z"].into_iter().enumerate() {
        let name = format!("{} / L", probe.replace('.', " "));
        study = study.quantity(Quantity::last(
            name,
            probe,
            1.0 / LENGTH,
            tip.position[i] / LENGTH,
            "shooting",
            Bar::Order(0.01, 1.8),
        ));
    }
    for (i, probe) in ["d1.x", "d1.y", "d1.z"].into_iter().enumerate() {
        let name = probe.replace('.', " at the tip, ");
        let reason =
            "read in the last element, half an element from the tip, where a torque of first order in the element acts";
        study = study.quantity(
            Quantity::last(name, probe, 1.0, tip.frame[0][i], "shooting", Bar::Order(0.01, 0.9))
                .scale(1.0)
                .because(reason),
        );
    }
    study
}

/// The clamp rolled about the rod.
fn roll() -> Study {
    let level = |degrees: f64| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        Level::new(format!("{degrees} degrees"), 0.0, &[("thread.rod.d1", vector([0.0, cos, sin]))])
    };
    let mut study = Study::new("roll of the clamp", "cantilever")
        .set("phase.load.action[0]", load([0.0, -1e-3, 0.5e-3], [0.0; 3]))
        .levels([0.0, 30.0, 45.0, 90.0].map(level).into());
    for probe in ["tip.x", "tip.y", "tip.z"] {
        let name = format!("{} / L", probe.replace('.', " "));
        study = study.quantity(
            Quantity::measured(name, move |o| last(o, probe) / LENGTH, Vec::new(), "each other", Bar::Same(1e-6))
                .scale(1.0),
        );
    }
    study
}

/// The whole scene turned: the rod along another direction, the load turned with it. The deflection along the load is
/// the same.
fn turned() -> Study {
    // Columns of a rotation: where x, y, z go.
    let level = |name: &str, axes: [[f64; 3]; 3]| {
        let along = axes[0].map(|c| c * LENGTH);
        let force = axes[2].map(|c| -1e-3 * c);
        Level::new(
            name,
            0.0,
            &[
                ("thread.rod.line.to", vector(along)),
                ("thread.rod.d1", vector(axes[1])),
                ("phase.load.action[0]", load(force, [0.0; 3])),
            ],
        )
    };
    let (s, c) = 0.7_f64.sin_cos();
    let (u, v) = 1.1_f64.sin_cos();
    let levels = vec![
        level("as it is", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
        level("x to z", [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
        level("x to -x", [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]),
        level("oblique", [[c * v, s, -c * u], [-s * v, c, s * u], [u, 0.0, v]]),
    ];
    let size = |o: &sutura_scene::Outcome| {
        ["tip.x", "tip.y", "tip.z"].map(|p| last(o, p)).iter().map(|v| v * v).sum::<f64>().sqrt() / LENGTH
    };
    Study::new("whole scene turned", "cantilever").levels(levels).quantity(Quantity::measured(
        "distance of the tip from the clamp / L",
        size,
        Vec::new(),
        "each other",
        Bar::Same(1e-9),
    ))
}

/// An ellipse that bends about d2 as the round thread does, and is four times as stiff about d1; rolled, or turning
/// along the rod.
fn flat(degrees: f64, pretwist: f64) -> Study {
    let radius = 0.5 * T1.diameter;
    // Semi-axes a along d1 and 2a along d2: moments of area 2 pi a^4 and pi a^4 / 2, torsion constant 8 pi a^4 / 5,
    // which is pi r^4 / 2 of the round one 1.6 times.
    let a = radius * 0.5_f64.powf(0.25);
    let (sin, cos) = degrees.to_radians().sin_cos();
    let tip = Cantilever {
        start: [0.0; 3],
        frame: [[0.0, cos, sin], [0.0, -sin, cos], [1.0, 0.0, 0.0]],
        length: LENGTH,
        stiffness: [4.0 * T1.ei(), T1.ei(), 1.6 * T1.gj()],
        rest: [0.0, 0.0, pretwist / LENGTH],
        force: [0.0, -1e-3, 0.0],
        moment: [0.0; 3],
    }
    .tip()
    .position;
    let name = if pretwist == 0.0 {
        format!("flat section, rolled by {degrees} degrees")
    } else {
        "flat section, turning by 90 degrees".into()
    };
    let mut study = Study::new(name, "cantilever")
        .set("thread.rod.section", format!("{{ ellipse = [{a:e}, {:e}] }}", 2.0 * a))
        .set("thread.rod.roll", format!("\"{degrees} deg\""))
        .set("thread.rod.pretwist", format!("{pretwist:e}"))
        .set("phase.load.action[0]", load([0.0, -1e-3, 0.0], [0.0; 3]))
        .elements("rod", &ELEMENTS)
        .quick(degrees == 30.0);
    for (i, probe) in ["tip.x", "tip.y", "tip.z"].into_iter().enumerate() {
        let name = format!("{} / L", probe.replace('.', " "));
        study = study.quantity(
            Quantity::last(name, probe, 1.0 / LENGTH, tip[i] / LENGTH, "shooting", Bar::Order(0.005, 1.8)).scale(1.0),
        );
    }
    study
}
