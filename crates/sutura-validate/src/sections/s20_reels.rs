//! Threads that come off reels.

use crate::reference::material::{T1, T2};
use crate::study::{Bar, Level, Quantity, Section, Study, last, series};
use std::f64::consts::PI;
use sutura_scene::Outcome;

pub fn section() -> Section {
    let mut section = Section::new(
        20,
        "Reels",
        "2-0 monofilament that is fed in at a rate or comes off against a brake. What hangs weighs what was fed. Pulled by a grip whose force falls with its speed, F (1 - v / v_limit), \
         thread comes off at the speed at which that is the tension of the brake. Over a cylinder the brake is the weak side of a capstan (thread and cylinder of section 9). Thread \
         is at rest on the reel; fed in at the speed v without gravity, mu v^2 of momentum comes in a second.",
    );
    section.studies.push(hanging());
    section.studies.push(brake());
    section.studies.push(capstan());
    section.studies.push(fed());
    section
}

/// The last value before a time.
fn before(o: &Outcome, probe: &str, time: f64) -> f64 {
    series(o, probe).iter().take_while(|p| p.0 < time + 1e-9).last().map_or(f64::NAN, |p| p.1)
}

fn hanging() -> Study {
    // After 2 s at 30 mm/s, and after 2 1/4 s at -40 mm/s.
    let (down, up) = (0.11, 0.02);
    let weight = move |length: f64| T1.weight() * length;
    let theory = "length fed times w";
    Study::new("hanging thread, let down and drawn up", "reel_hanging")
        .substeps(&[8e-3, 4e-3, 2e-3])
        .quick(true)
        .quantity(Quantity::measured(
            "length when let down [mm]",
            |o| 1e3 * before(o, "length", 6.0),
            vec![1e3 * down],
            "rate times time",
            Bar::Within(1e-4),
        ))
        .quantity(Quantity::measured(
            "end below the mouth [mm]",
            |o| 1e3 * before(o, "low", 6.0),
            vec![1e3 * down],
            "hangs straight",
            Bar::Within(1e-4),
        ))
        .quantity(Quantity::measured(
            "force at the mouth over the weight",
            move |o| before(o, "force", 6.0) / weight(down),
            vec![1.0],
            theory,
            Bar::Within(1e-3),
        ))
        .quantity(Quantity::last(
            "length when drawn up [mm]",
            "length",
            1e3,
            1e3 * up,
            "rate times time",
            Bar::Within(1e-4),
        ))
        .quantity(Quantity::last(
            "force at the mouth over the weight, drawn up",
            "force",
            1.0 / weight(up),
            1.0,
            theory,
            Bar::Within(1e-3),
        ))
}

fn brake() -> Study {
    const SET: f64 = 0.2;
    let level =
        |pull: f64| Level::new(format!("{pull} N"), 0.0, &[("phase.come off.action[0].force", format!("{pull}"))]);
    let pulls = [0.22, 0.3, 0.8];
    let speed = pulls.map(|pull| 50.0 * (1.0 - SET / pull)).to_vec();
    // From a second after the pull grew.
    let per_second = |o: &Outcome| 1e3 * (last(o, "length") - before(o, "length", 2.0));
    Study::new("brake of 0.2 N, pulled", "reel_brake")
        .levels(pulls.map(level).into())
        .quick(true)
        .quantity(Quantity::measured(
            "given off under 0.15 N, less the stretch [mm]",
            |o| 1e3 * (before(o, "length", 1.0) - 0.05 * (1.0 + 0.15 / T1.ea())),
            Vec::new(),
            "none",
            Bar::AtMost(1e-3),
        ))
        .quantity(Quantity::last("force at the mouth [N]", "force", 1.0, SET, "brake", Bar::Within(1e-3)))
        .quantity(
            Quantity::last("speed of the grip [mm/s]", "speed", 1e3, 0.0, "v_limit (1 - T / F)", Bar::Within(1e-3))
                .references(speed.clone()),
        )
        .quantity(Quantity::measured("thread given off [mm/s]", per_second, speed, "the same", Bar::Within(2e-3)))
}

fn capstan() -> Study {
    let mean = |o: &Outcome, probe: &str| {
        let late: Vec<f64> = series(o, probe).into_iter().filter(|p| p.0 > 1.0).map(|p| p.1).collect();
        late.iter().sum::<f64>() / late.len() as f64
    };
    // As in section 9.
    let exact = (0.2 * PI).exp();
    Study::new("drawn over a cylinder, 180 degrees, mu = 0.2", "capstan_reel")
        .levels(
            [130, 180]
                .map(|n: u32| Level::new(n.to_string(), 0.0, &[("thread.thread.elements", n.to_string())]))
                .into(),
        )
        .quantity(Quantity::measured(
            "force at the mouth [N]",
            move |o| mean(o, "hold"),
            vec![0.1],
            "brake",
            Bar::Within(1e-3),
        ))
        .quantity(Quantity::measured(
            "T2 / T1",
            move |o| mean(o, "pull") / mean(o, "hold"),
            vec![exact],
            "capstan",
            Bar::Within(0.005),
        ))
        .quantity(Quantity::measured(
            "given off in the last second [mm]",
            |o| 1e3 * (last(o, "length") - before(o, "length", 1.0)),
            vec![8.0],
            "drawn",
            Bar::Within(0.005),
        ))
        .quantity(Quantity::measured(
            "stretch at the mouth",
            |o| last(o, "hold") / T2.ea(),
            vec![0.1 / T2.ea()],
            "T / EA",
            Bar::Within(1e-3),
        ))
}

fn fed() -> Study {
    let speeds = [0.25, 0.5, 1.0];
    let flux = |v: f64| T1.mass() * v * v;
    let level = |v: f64| Level::new(format!("{v} m/s"), v, &[("reel[0].rate", v.to_string())]);
    // From when the thread moves as a whole; the speed from what came in.
    let from = 0.02;
    let speed = |o: &Outcome| (last(o, "length") - 0.05) / 0.1;
    let gained = move |o: &Outcome| (last(o, "momentum") - before(o, "momentum", from)) / (0.1 - from) / flux(speed(o));
    let force = move |o: &Outcome| {
        let late: Vec<f64> = series(o, "force").into_iter().filter(|p| p.0 > from + 1e-9).map(|p| p.1).collect();
        late.iter().sum::<f64>() / late.len() as f64 / flux(speed(o))
    };
    Study::new("fed in fast, no gravity", "reel_fed")
        .levels(speeds.map(level).into())
        .quantity(Quantity::measured("momentum gained in a second over mu v^2", gained, vec![1.0; 3], "mu v^2", Bar::Within(1e-3)))
        .quantity(Quantity::measured("mean force at the mouth over mu v^2", force, vec![1.0; 3], "momentum", Bar::Within(0.05)).because(
            "half of what is fed in becomes mass of the first free particle, and has its speed at once; the grip gives its speed to the other half only",
        ))
}
