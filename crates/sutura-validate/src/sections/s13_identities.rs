//! What the integrator must do to the last digits.

use crate::reference::material::{G1, GRAVITY, T1};
use crate::reference::vibration::{euler_frequency, frequency};
use crate::study::{Bar, LeftOut, Level, Quantity, Section, Study, columns, last, series};
use std::f64::consts::TAU;
use sutura_scene::Outcome;

/// Frames a second, with one substep each.
const RATES: [u32; 2] = [60, 600];

pub fn section() -> Section {
    let mut section = Section::new(
        13,
        "Conservation, damping, identities of the integrator",
        "Free fall from rest is g h^2 N (N + 1) / 2 after N substeps; damping multiplies velocities by (1 - d)^t whatever the substep, and comes after \
         gravity. A single stretched element follows x1 = (x0 + h v0) / (1 + (w h)^2); a spinning pair of particles keeps its \
         angular momentum, and so turns by the same angle in each substep.",
    );
    section.studies.push(falling());
    section.studies.push(terminal());
    section.studies.push(spring());
    section.studies.push(spinning());
    section.studies.push(pendulum());
    section.left_out = &[LeftOut {
        what: "torque-free top, gyroscope",
        why: "there are no free rigid bodies; a thread's gyroscopic moment is left out, see docs/theory.md 3",
    }];
    section
}

fn rates() -> Vec<Level> {
    RATES.map(|n| Level::new(format!("h = 1/{n} s"), 0.0, &[("frame_rate", n.to_string())])).into()
}

/// Columns x, y, z of a probe at a time.
fn at(outcome: &Outcome, probe: &str, time: f64) -> [f64; 3] {
    columns(outcome, probe, ["time", "x", "y", "z"])
        .into_iter()
        .find(|r| (r[0] - time).abs() < 1e-9)
        .map_or([f64::NAN; 3], |r| [r[1], r[2], r[3]])
}

fn falling() -> Study {
    let per_rate = |f: &dyn Fn(f64) -> f64| RATES.map(|n| f(1.0 / f64::from(n))).to_vec();
    let fallen = per_rate(&|h| {
        let n = (0.5 / h).round();
        GRAVITY * h * h * n * (n + 1.0) / 2.0
    });
    // Damping comes after the move of its substep.
    let coasted = per_rate(&|h| {
        let q = 0.5_f64.powf(h);
        0.5 * GRAVITY * h * (1.0 - q.powf(1.0 / h)) / (1.0 - q)
    });
    Study::new("free fall, then damping 0.5", "free_fall")
        .levels(rates())
        .quick(true)
        .quantity(Quantity::measured(
            "fallen in 0.5 s [m]",
            |o| -at(o, "place", 0.5)[2],
            fallen,
            "sum",
            Bar::Within(1e-9),
        ))
        .quantity(Quantity::measured(
            "speed after 0.5 s [m/s]",
            |o| -at(o, "velocity", 0.5)[2],
            vec![0.5 * GRAVITY],
            "g t",
            Bar::Within(1e-9),
        ))
        .quantity(Quantity::measured(
            "speed a second later [m/s]",
            |o| -last(o, "velocity.z"),
            vec![0.25 * GRAVITY],
            "(1 - d)^t",
            Bar::Within(1e-9),
        ))
        .quantity(Quantity::measured(
            "coasted in it [m]",
            |o| at(o, "place", 0.5)[2] - last(o, "place.z"),
            coasted,
            "geometric sum",
            Bar::Within(1e-9),
        ))
}

fn terminal() -> Study {
    let speed = RATES.map(|n| {
        let h = 1.0 / f64::from(n);
        let q = 0.1_f64.powf(h);
        GRAVITY * h * q / (1.0 - q)
    });
    Study::new("terminal speed, damping 0.9", "free_fall")
        .levels(rates())
        .set("phase.coast.action[0].gravity", "[0, 0, -9.81]")
        .set("phase.coast.action[1].solver.linear_damping", 0.9)
        .set("phase.coast.duration", "14 s")
        .quantity(Quantity::measured(
            "speed [m/s]",
            |o| -last(o, "velocity.z"),
            speed.to_vec(),
            "damping after gravity",
            Bar::Within(1e-9),
        ))
}

fn spring() -> Study {
    const H: f64 = 1e-5;
    const START: f64 = 1e-4;
    let mass = 1e-4 + 0.5 * T1.mass() * 0.05;
    let w = (T1.ea() / 0.05 / mass).sqrt();
    let worst = move |o: &Outcome| {
        let (mut x, mut v, mut worst) = (START, 0.0, 0.0_f64);
        for (_, got) in series(o, "stretch").iter().skip(1) {
            let next = (x + H * v) / (1.0 + (w * H).powi(2));
            v = (next - x) / H;
            x = next;
            worst = worst.max((got - x).abs());
        }
        worst / START
    };
    Study::new("one spring, 2000 substeps", "spring_mass").quick(true).quantity(
        Quantity::measured("largest difference over the start", worst, vec![0.0], "recursion", Bar::Within(1e-6))
            .scale(1.0),
    )
}

fn spinning() -> Study {
    // Angle from frame to frame; a frame is a substep.
    let angles = |o: &Outcome| {
        let along = columns(o, "along", ["time", "x", "z"]);
        let turn = |w: &[[f64; 3]]| {
            let (a, b) = (w[0], w[1]);
            (b[0], (a[1] * b[2] - a[2] * b[1]).atan2(a[1] * b[1] + a[2] * b[2]))
        };
        along.windows(2).map(turn).filter(|(t, _)| *t > 0.0105).map(|(_, a)| a).collect::<Vec<f64>>()
    };
    let ratio = move |o: &Outcome| {
        let turns = angles(o);
        let (Some(first), Some(end)) = (turns.first(), turns.last()) else { return f64::NAN };
        end / first
    };
    let drift = |o: &Outcome| {
        let rows: Vec<[f64; 4]> =
            columns(o, "momentum", ["time", "x", "y", "z"]).into_iter().filter(|r| r[0] > 0.0105).collect();
        let Some(first) = rows.first().copied() else { return f64::NAN };
        let size = first[1].hypot(first[3]);
        rows.iter().map(|r| (1..4).map(|k| (r[k] - first[k]).powi(2)).sum::<f64>().sqrt() / size).fold(0.0, f64::max)
    };
    Study::new("spinning dumbbell, 1 s", "spinning")
        .quantity(Quantity::measured(
            "last angle of a substep over the first",
            ratio,
            vec![1.0],
            "conserved",
            Bar::Within(1e-3),
        ))
        .quantity(Quantity::measured(
            "drift of the momentum over it",
            drift,
            Vec::new(),
            "conserved",
            Bar::AtMost(1e-10),
        ))
}

fn pendulum() -> Study {
    let w = (1.5 * GRAVITY / 0.1).sqrt();
    // The wire bends a little: its mass hangs on a stiff rod (w L^3 / EI = 0.02).
    debug_assert!(G1.weight() * 1e-3 / G1.ei() < 0.03);
    Study::new("rod pendulum, 100 mm", "pendulum").elements("rod", &[10, 20, 40]).quantity(Quantity::measured(
        "period [s]",
        |o| 1.0 / frequency(&series(o, "tip")),
        vec![TAU / euler_frequency(w, 1e-3)],
        "2 pi sqrt(2L / 3g)",
        Bar::Order(0.005, 1.8),
    ))
}
