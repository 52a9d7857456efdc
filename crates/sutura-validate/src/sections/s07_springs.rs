//! Naturally curved rods: springs, arcs, rings.

use super::{ELEMENTS, vector};
use crate::reference::kirchhoff::Cantilever;
use crate::reference::material::T1;
use crate::study::{Bar, Level, Quantity, Section, Study, last};
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use sutura_scene::Outcome;

/// Radius of the springs \[m\].
const RADIUS: f64 = 0.005;
const TURNS: f64 = 5.0;

pub fn section() -> Section {
    let mut section = Section::new(
        7,
        "Naturally curved rods and springs",
        "Helical springs of five turns of 2-0 monofilament, radius 5 mm, pulled along the axis by a force that acts at the axis: stiffness under a \
         small pull with the end free to turn, against L R^2 (cos^2 / GJ + sin^2 / EI); large pulls against the Kirchhoff rod by shooting, with the \
         same dead force and dead torque; under a small pull with the end kept from turning, too. Arcs and closed rings in their plane against Castigliano.",
    );
    for angle in [5.0, 10.0, 20.0, 30.0] {
        section.studies.push(stiffness(angle));
        section.studies.push(blocked(angle));
    }
    for force in [0.2e-3, 0.5e-3, 1.0e-3] {
        section.studies.push(stretched(force));
    }
    section.studies.push(quarter([0.0, 1.0], [0.5 * FRAC_PI_2, 0.5], "quarter arc, load across the tip's tangent"));
    section.studies.push(quarter([1.0, 0.0], [0.75 * PI - 2.0, 0.5], "quarter arc, load along the tip's tangent"));
    section.studies.push(straightened());
    for seam in [0.0, 0.125, 0.2] {
        section.studies.push(ring(seam));
    }
    section
}

fn spring(name: String, angle: f64, force: f64) -> Study {
    let pitch = TAU * RADIUS * angle.to_radians().tan();
    Study::new(name, "spring")
        .set("thread.rod.helix.pitch", format!("{pitch:e}"))
        .set("phase.load.action[0].force", vector([0.0, 0.0, force]))
        .set("phase.load.action[0].torque", vector([0.0, RADIUS * force, 0.0]))
        .elements("rod", &[100, 200, 400])
}

fn stiffness(angle: f64) -> Study {
    const FORCE: f64 = 1e-6;
    let (sin, cos) = angle.to_radians().sin_cos();
    let length = TAU * RADIUS * TURNS / cos;
    let compliance = length * RADIUS * RADIUS * (cos * cos / T1.gj() + sin * sin / T1.ei());
    let height = length * sin;
    spring(format!("spring, pitch angle {angle} degrees"), angle, FORCE).quick(angle == 10.0).quantity(
        Quantity::measured(
            "stiffness [N/m]",
            move |o| FORCE / (last(o, "tip.z") - height),
            vec![1.0 / compliance],
            "compliance of a helix",
            Bar::Order(0.01, 1.8),
        ),
    )
}

/// The end kept from turning about the axis, by the torque about it that undoes the turn: the compliances of a helix
/// are, over L, R^2 (cos^2 / GJ + sin^2 / EI) of length to force, sin^2 / GJ + cos^2 / EI of turn to torque, R sin cos
/// (1 / GJ - 1 / EI) between them.
fn blocked(angle: f64) -> Study {
    const FORCE: f64 = 1e-6;
    let (sin, cos) = angle.to_radians().sin_cos();
    let length = TAU * RADIUS * TURNS / cos;
    let (bend, twist) = (1.0 / T1.ei(), 1.0 / T1.gj());
    let [force, both, torque] = [
        RADIUS * RADIUS * (cos * cos * twist + sin * sin * bend),
        RADIUS * sin * cos * (twist - bend),
        sin * sin * twist + cos * cos * bend,
    ]
    .map(|c| length * c);
    let height = length * sin;
    spring(format!("spring, pitch angle {angle} degrees, end kept from turning"), angle, FORCE)
        .set("phase.load.action[0].torque", vector([0.0, RADIUS * FORCE, -both / torque * FORCE]))
        .quantity(Quantity::measured(
            "stiffness [N/m]",
            move |o| FORCE / (last(o, "tip.z") - height),
            vec![torque / (force * torque - both * both)],
            "compliance of a helix",
            Bar::Order(0.01, 1.8),
        ))
}

fn stretched(force: f64) -> Study {
    let angle = 10.0_f64;
    let (sin, cos) = angle.to_radians().sin_cos();
    let length = TAU * RADIUS * TURNS / cos;
    let tip = Cantilever {
        start: [RADIUS, 0.0, 0.0],
        // Normal, binormal, tangent.
        frame: [[-1.0, 0.0, 0.0], [0.0, -sin, cos], [0.0, cos, sin]],
        length,
        stiffness: [T1.ei(), T1.ei(), T1.gj()],
        rest: [0.0, cos * cos / RADIUS, sin * cos / RADIUS],
        force: [0.0, 0.0, force],
        moment: [0.0, RADIUS * force, 0.0],
    }
    .tip()
    .position;
    let mut study = spring(format!("spring, {} mN", 1e3 * force), angle, force);
    for (i, probe) in ["tip.x", "tip.y", "tip.z"].into_iter().enumerate() {
        let name = format!("{} [mm]", probe.replace('.', " "));
        // Errors over the height of the spring.
        study = study.quantity(
            Quantity::last(name, probe, 1e3, 1e3 * tip[i], "shooting", Bar::Order(0.01, 1.8)).scale(1e3 * tip[2]),
        );
    }
    study
}

/// A quarter of a circle in its plane under a small load; displacement of its tip along and across, over P R^3 / EI.
fn quarter(direction: [f64; 2], want: [f64; 2], name: &str) -> Study {
    const R: f64 = 0.02;
    const K: f64 = 1e-4;
    let load = K * T1.ei() / (R * R);
    let factor = 1.0 / (K * R);
    let along = move |o: &Outcome| {
        let (x, y) = (last(o, "tip.x") - R, last(o, "tip.y") - R);
        factor * (x * direction[0] + y * direction[1])
    };
    let across = move |o: &Outcome| {
        let (x, y) = (last(o, "tip.x") - R, last(o, "tip.y") - R);
        (factor * (x * direction[1] + y * direction[0])).abs()
    };
    Study::new(name, "arc")
        .set("thread.rod.arc.angle", "90 deg")
        .set("phase.load.action[0].force", vector([load * direction[0], load * direction[1], 0.0]))
        .set("phase.settle.until", "speed(rod) < 1e-11 m/s")
        .elements("rod", &ELEMENTS)
        .quantity(Quantity::measured("along the load", along, vec![want[0]], "Castigliano", Bar::Order(0.01, 1.8)))
        .quantity(Quantity::measured("across", across, vec![want[1]], "Castigliano", Bar::Order(0.01, 1.8)))
}

fn straightened() -> Study {
    Study::new("arc of R = 10 mm held straight", "straightened")
        .elements("rod", &ELEMENTS)
        .quantity(Quantity::last("moment over EI / R", "moment", 0.01 / T1.ei(), 1.0, "EI / R", Bar::Within(0.001)))
        .quantity(Quantity::measured("bow [m]", |o| last(o, "bow"), Vec::new(), "straight", Bar::AtMost(1e-9)))
}

/// The ring pulled at two places across from each other, the seam at a part of a turn before one of them.
fn ring(seam: f64) -> Study {
    const R: f64 = 0.01;
    const FORCE: f64 = 1e-5;
    let factor = T1.ei() / (FORCE * R.powi(3));
    // The ring is a closed polygon of chords: what it opens by counts from its own width.
    let opened = move |probe: &'static str| move |o: &Outcome| factor * (last(o, probe) - first(o, probe));
    let level = |n: u32| {
        let place = |quarter: u32| (f64::from(n) * seam) as u32 + quarter * n / 4;
        let between = |a: u32, b: u32| {
            format!("\"norm(position(ring.particle[{}]) - position(ring.particle[{}]))\"", place(a) % n, place(b) % n)
        };
        // From the first place to the start, a part of a turn back.
        let (sin, cos) = (TAU * seam).sin_cos();
        let settings = [
            ("thread.ring.elements", n.to_string()),
            ("thread.ring.arc.start", vector([R * cos, -R * sin, 0.0])),
            ("phase.load.action[0].at", format!("\"particle {}\"", place(0))),
            ("phase.load.action[1].at", format!("\"particle {}\"", place(2))),
            ("probe.along.what", between(0, 2)),
            ("probe.across.what", between(1, 3)),
        ];
        Level::new(n.to_string(), 1.0 / f64::from(n), &settings)
    };
    let name = if seam == 0.0 {
        "closed ring pulled apart at its seam".into()
    } else {
        format!("closed ring pulled apart, its seam {} degrees off", 360.0 * seam)
    };
    Study::new(name, "ring_pulled")
        .levels([40, 80, 160].map(level).into())
        .quick(seam > 0.0)
        .quantity(Quantity::measured(
            "opening over F R^3 / EI",
            opened("along"),
            vec![0.25 * PI - 2.0 / PI],
            "Castigliano",
            Bar::Order(0.005, 1.8),
        ))
        .quantity(Quantity::measured(
            "closing over F R^3 / EI",
            opened("across"),
            vec![0.5 - 2.0 / PI],
            "Castigliano",
            Bar::Order(0.005, 1.8),
        ))
}

fn first(outcome: &Outcome, probe: &str) -> f64 {
    outcome.report.probes.iter().find(|p| p.name == probe).map_or(f64::NAN, |p| p.first)
}
