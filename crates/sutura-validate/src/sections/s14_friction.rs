//! Friction on a plane.

use super::vector;
use crate::reference::material::{GRAVITY, T1};
use crate::study::{Bar, LeftOut, Level, Quantity, Section, Study, columns, series};
use sutura_scene::Outcome;

const MU: f64 = 0.3;
/// Time of sliding \[s\].
const TIME: f64 = 0.5;

pub fn section() -> Section {
    let mut section = Section::new(
        14,
        "Friction on a plane",
        "A straight piece of 2-0 monofilament, 50 mm, on a plane with mu = 0.3, tilted along the thread after 0.2 s: the limit is 16.699 degrees. Distances \
         are those of N substeps, a h^2 N (N + 1) / 2.",
    );
    section.studies.push(resting());
    for degrees in [17.0, 20.0, 25.0, 30.0] {
        section.studies.push(sliding(degrees));
    }
    section.studies.push(directions());
    section.studies.push(drawn());
    section.studies.push(stopped());
    section.left_out = &[LeftOut {
        what: "spheres and cylinders that roll",
        why: "there are no free rigid bodies; threads slide and do not roll, see docs/theory.md 16",
    }];
    section
}

/// Gravity on a plane tilted by `degrees`, downhill toward `direction` from x.
fn tilted(degrees: f64, direction: f64) -> String {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let (across, along) = direction.to_radians().sin_cos();
    vector([GRAVITY * sin * along, GRAVITY * sin * across, -GRAVITY * cos])
}

/// Distance moved since the plane tilted \[m\].
fn moved(o: &Outcome) -> f64 {
    let places = columns(o, "place", ["time", "x", "y"]);
    match (places.iter().find(|p| p[0] > 0.2 - 1e-9), places.last()) {
        (Some(a), Some(b)) => (b[1] - a[1]).hypot(b[2] - a[2]),
        _ => f64::NAN,
    }
}

fn resting() -> Study {
    Study::new("16.5 degrees, 60 s", "incline")
        .set("phase.tilted.action[0].gravity", tilted(16.5, 0.0))
        .set("phase.tilted.duration", "60 s")
        .set("solver.substep", "10 ms")
        .quantity(Quantity::measured("moved [m]", moved, Vec::new(), "rests", Bar::AtMost(1e-6)))
}

fn sliding(degrees: f64) -> Study {
    const STEPS: [f64; 2] = [2e-3, 1e-3];
    let (sin, cos) = f64::to_radians(degrees).sin_cos();
    let a = GRAVITY * (sin - MU * cos);
    let sum = STEPS.map(|h| {
        let n = (TIME / h).round();
        a * h * h * n * (n + 1.0) / 2.0
    });
    Study::new(format!("{degrees} degrees"), "incline")
        .set("phase.tilted.action[0].gravity", tilted(degrees, 0.0))
        .substeps(&STEPS)
        .quick(degrees == 20.0)
        .quantity(Quantity::measured(
            "moved in 0.5 s [mm]",
            |o| 1e3 * moved(o),
            sum.map(|x| 1e3 * x).to_vec(),
            "Coulomb",
            Bar::Within(0.01),
        ))
}

/// Downhill in several directions to the thread.
fn directions() -> Study {
    let level = |direction: f64| {
        Level::new(format!("{direction} degrees"), 0.0, &[("phase.tilted.action[0].gravity", tilted(20.0, direction))])
    };
    Study::new("20 degrees, downhill at an angle to the thread", "incline")
        .levels([0.0, 15.0, 30.0, 45.0, 90.0].map(level).into())
        .quantity(Quantity::measured(
            "moved in 0.5 s [mm]",
            |o| 1e3 * moved(o),
            Vec::new(),
            "each other",
            Bar::Same(0.01),
        ))
}

fn drawn() -> Study {
    let weight = T1.weight() * 0.05;
    let mean = |o: &Outcome| {
        let late: Vec<f64> = series(o, "pull").into_iter().filter(|p| p.0 > 0.7).map(|p| p.1).collect();
        late.iter().sum::<f64>() / late.len() as f64
    };
    Study::new("drawn lengthwise", "drawn").quantity(Quantity::measured(
        "force over weight",
        move |o| mean(o) / weight,
        vec![MU],
        "mu w L",
        Bar::Within(0.01),
    ))
}

/// Let go at 0.5 m/s.
fn stopped() -> Study {
    const STEPS: [f64; 3] = [2e-3, 1e-3, 5e-4];
    const SPEED: f64 = 0.5;
    let slowed = MU * GRAVITY;
    // Whole substeps in which it slides, each with the speed at its end.
    let sum = STEPS.map(|h| {
        let n = (SPEED / (slowed * h)).floor();
        1e3 * h * (n * SPEED - slowed * h * n * (n + 1.0) / 2.0)
    });
    let distance = |o: &Outcome| {
        let places = series(o, "place");
        let start = places.iter().find(|p| p.0 > 0.3 - 1e-9).map_or(f64::NAN, |p| p.1);
        places.last().map_or(f64::NAN, |p| 1e3 * (p.1 - start))
    };
    // By the speed of the first tenth of a second.
    let slowing = |o: &Outcome| {
        let momentum = series(o, "momentum");
        let at = |time: f64| momentum.iter().find(|p| p.0 > time - 1e-9).map_or(f64::NAN, |p| p.1);
        (at(0.3) - at(0.4)) / 0.1 / (T1.mass() * 0.05)
    };
    Study::new("let go at 0.5 m/s", "slide_to_stop")
        .substeps(&STEPS)
        .quantity(Quantity::measured("slides [mm]", distance, sum.to_vec(), "substeps of Coulomb", Bar::Within(0.001)))
        .quantity(Quantity::measured(
            "slides [mm]",
            distance,
            vec![1e3 * SPEED * SPEED / (2.0 * slowed)],
            "v^2 / 2 mu g",
            Bar::Order(0.01, 0.9),
        ))
        .quantity(Quantity::measured("slows down by [m/s^2]", slowing, vec![slowed], "mu g", Bar::Within(0.001)))
}
