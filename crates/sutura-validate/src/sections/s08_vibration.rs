//! Vibration of rods.

use super::vector;
use crate::reference::links;
use crate::reference::material::T1;
use crate::reference::vibration::{self, decay, euler_decay, euler_frequency, frequency};
use crate::results::{Curve, Plot, StudyResult};
use crate::study::{Bar, Level, Quantity, Section, Study, columns, series};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

const LENGTH: f64 = 0.05;
const COUNTS: [usize; 3] = [20, 40, 80];

pub fn section() -> Section {
    let mut section = Section::new(
        8,
        "Vibration",
        "Rods of 2-0 monofilament, 50 mm unless said otherwise, begin in the shape of a mode, a thousandth of the length high. References are theory after \
         the known shift of implicit Euler, atan(w h) / h; its decay is ln(1 + (w h)^2) / 2h a second.",
    );
    for (mode, h) in [(0, 2e-4), (1, 3e-5), (2, 1e-5)] {
        section.studies.push(cantilever(mode, h));
    }
    section.studies.push(cantilever_decay());
    for (mode, h) in [(0, 3e-5), (1, 1e-5)] {
        section.studies.push(free(mode, h));
    }
    for mode in [1, 2] {
        section.studies.push(string(mode));
    }
    for mode in [2, 3] {
        section.studies.push(ring(mode, false));
        section.studies.push(ring(mode, true));
    }
    section.studies.push(tip_mass());
    section.studies.push(bob());
    section.studies.push(torsion());
    section.studies.push(axial());
    section.plots = plots;
    section
}

/// Angular frequency of a bending mode of dimensionless frequency beta^2.
fn bending(square: f64) -> f64 {
    square * (T1.ei() / T1.mass()).sqrt() / (LENGTH * LENGTH)
}

/// Points along x with a deflection along z of a thousandth of the length, with chords of equal length.
pub(super) fn shaped(n: usize, length: f64, shape: impl Fn(f64) -> f64) -> String {
    let link = length / n as f64;
    let mut points = vec![[0.0, 0.0, 1e-3 * length * shape(0.0)]];
    for i in 1..=n {
        let z = 1e-3 * length * shape(i as f64 / n as f64);
        let rise = z - points[i - 1][2];
        points.push([points[i - 1][0] + (link * link - rise * rise).sqrt(), 0.0, z]);
    }
    format!("[{}]", points.into_iter().map(vector).collect::<Vec<_>>().join(", "))
}

fn timed(study: Study, h: f64, periods: f64, w: f64) -> Study {
    let frames = 1.0 / h;
    study
        .set("solver.substep", format!("{h:e}"))
        .set("frame_rate", format!("{frames:e}"))
        .set("phase.swing.duration", format!("{:e}", periods * TAU / w))
}

fn level(n: usize, points: String) -> Level {
    Level::new(n.to_string(), 1.0 / n as f64, &[("thread.rod.points", points)])
}

fn hz(w: f64, h: f64) -> f64 {
    euler_frequency(w, h) / TAU
}

fn cantilever(mode: usize, h: f64) -> Study {
    let beta = vibration::cantilever(3)[mode];
    let w = bending(beta * beta);
    let levels = COUNTS.map(|n| level(n, shaped(n, LENGTH, |s| vibration::cantilever_shape(beta, s))));
    let discrete = COUNTS.map(|n| hz(bending(links::cantilever_modes(n)[mode].0), h)).to_vec();
    timed(Study::new(format!("cantilever, mode {}", mode + 1), "vibrating"), h, 6.0, w)
        .levels(levels.into())
        .quick(mode == 0)
        .quantity(measured(vec![hz(w, h)], "Euler and Bernoulli", Bar::Order(0.005, 1.8)).scale(hz(w, h)))
        .quantity(measured(discrete, "chain of n links", Bar::Within(0.005)))
}

/// Frequency of the tip [Hz].
fn measured(reference: Vec<f64>, source: &'static str, bar: Bar) -> Quantity {
    Quantity::measured("frequency [Hz]", |o| frequency(&series(o, "tip")), reference, source, bar)
}

fn cantilever_decay() -> Study {
    const STEPS: [f64; 3] = [1e-3, 5e-4, 2.5e-4];
    const N: usize = 40;
    let beta = vibration::cantilever(1)[0];
    let w = bending(links::cantilever_modes(N)[0].0);
    let levels = STEPS.map(|h| {
        Level::new(
            format!("{} ms", 1e3 * h),
            h,
            &[("solver.substep", format!("{h:e}")), ("frame_rate", format!("{:e}", 1.0 / h))],
        )
    });
    Study::new("cantilever, decay of mode 1", "vibrating")
        .set("thread.rod.points", shaped(N, LENGTH, |s| vibration::cantilever_shape(beta, s)))
        .levels(levels.into())
        .quantity(measured(STEPS.map(|h| hz(w, h)).to_vec(), "implicit Euler", Bar::Within(0.005)))
        .quantity(Quantity::measured(
            "decay [1/s]",
            |o| decay(&series(o, "tip")),
            STEPS.map(|h| euler_decay(w, h)).to_vec(),
            "implicit Euler",
            Bar::Within(0.01),
        ))
        .curve(|o| series(o, "tip").into_iter().map(|(t, z)| (t, z / (1e-3 * LENGTH))).collect())
}

fn free(mode: usize, h: f64) -> Study {
    let beta = vibration::free(2)[mode];
    let w = bending(beta * beta);
    let levels = COUNTS.map(|n| level(n, shaped(n, LENGTH, |s| vibration::free_shape(beta, s))));
    timed(Study::new(format!("free rod, mode {}", mode + 1), "vibrating_free"), h, 6.0, w)
        .levels(levels.into())
        .quantity(measured(vec![hz(w, h)], "Euler and Bernoulli", Bar::Order(0.005, 1.8)))
        .quantity(Quantity::measured(
            "largest momentum over that of its speed",
            largest_momentum(w),
            Vec::new(),
            "none",
            Bar::AtMost(0.01),
        ))
}

/// Momentum over mass times the largest speed of the tip.
fn largest_momentum(w: f64) -> impl Fn(&sutura_scene::Outcome) -> f64 + Send + Sync {
    move |o| {
        let scale = T1.mass() * LENGTH * 1e-3 * LENGTH * w;
        series(o, "momentum").iter().map(|p| p.1).fold(0.0, f64::max) / scale
    }
}

fn string(mode: u32) -> Study {
    const L: f64 = 0.1;
    const TENSION: f64 = 0.1;
    let h = 2e-5;
    let f = vibration::stiff_string(mode, TENSION, T1.ei(), T1.mass(), L);
    // Stretched between fixed pins by the strain that the tension makes.
    let stretched = L * (1.0 + TENSION / T1.ea());
    let shape = move |n| shaped(n, stretched, |s| (f64::from(mode) * PI * s).sin() * 0.1);
    timed(Study::new(format!("stiff string, 100 mm, 0.1 N, mode {mode}"), "string"), h, 6.0, TAU * f)
        .levels(COUNTS.map(|n| level(n, shape(n))).into())
        .quantity(Quantity::measured(
            "frequency [Hz]",
            |o| frequency(&series(o, "bow")),
            vec![hz(TAU * f, h)],
            "stiff string",
            Bar::Order(0.005, 1.8),
        ))
}

/// A closed ring, round at rest, in a mode of so many waves in or across its plane (Love 1927, 293; no stretch, no
/// rotary inertia).
fn ring(waves: u32, across: bool) -> Study {
    const R: f64 = 0.02;
    const H: f64 = 5e-5;
    const HEIGHT: f64 = 1e-3;
    let n = f64::from(waves);
    let soft = if across { T1.ei() / T1.gj() } else { 1.0 };
    let w = (T1.ei() / T1.mass() / (n * n + soft)).sqrt() * n * (n * n - 1.0) / (R * R);
    let shape = |elements: usize| {
        let point = |i: usize| {
            let s = TAU * i as f64 / elements as f64;
            let (sin, cos) = (n * s).sin_cos();
            // In the plane points move along the ring, too, and keep their distance.
            let (radius, angle, z) =
                if across { (R, s, R * HEIGHT * cos) } else { (R * (1.0 + HEIGHT * cos), s - HEIGHT / n * sin, 0.0) };
            vector([radius * angle.cos(), radius * angle.sin(), z])
        };
        format!("[{}]", (0..elements).map(point).collect::<Vec<_>>().join(", "))
    };
    let level = |elements: usize| {
        Level::new(elements.to_string(), 1.0 / elements as f64, &[("thread.ring.points", shape(elements))])
    };
    let swing = move |o: &sutura_scene::Outcome| {
        let start = columns(o, "start", ["time", "x", "z"]);
        frequency(&start.iter().map(|[t, x, z]| (*t, if across { *z } else { x - R })).collect::<Vec<_>>())
    };
    let word = if across { "across" } else { "in" };
    let scale = T1.mass() * TAU * R * R * HEIGHT * w;
    let push = move |o: &sutura_scene::Outcome| series(o, "momentum").iter().map(|p| p.1).fold(0.0, f64::max) / scale;
    timed(Study::new(format!("closed ring, {waves} waves {word} its plane"), "vibrating_ring"), H, 6.0, w)
        .levels([24, 48, 96].map(level).into())
        .quick(waves == 2 && !across)
        .quantity(Quantity::measured(
            "frequency [Hz]",
            swing,
            vec![hz(w, H)],
            "inextensible ring",
            Bar::Order(0.005, 1.8),
        ))
        .quantity(Quantity::measured(
            "largest momentum over that of its speed",
            push,
            Vec::new(),
            "none",
            Bar::AtMost(0.01),
        ))
}

fn tip_mass() -> Study {
    // Massless beam with the mass at its end, and 33/140 of the beam's own (Rayleigh); exact to 0.1 % for this ratio.
    let mass = 1e-5 + 33.0 / 140.0 * T1.mass() * LENGTH;
    let w = (3.0 * T1.ei() / (mass * LENGTH.powi(3))).sqrt();
    let swing =
        |o: &sutura_scene::Outcome| frequency(&series(o, "tip").into_iter().filter(|p| p.0 > 1.6).collect::<Vec<_>>());
    Study::new("cantilever with 10 mg at its tip", "tip_mass").elements("rod", &[20, 40, 80]).quantity(
        Quantity::measured(
            "frequency [Hz]",
            swing,
            vec![hz(w, 5e-4)],
            "Rayleigh, 33/140 of the rod's mass",
            Bar::Order(0.005, 1.8),
        ),
    )
}

fn bob() -> Study {
    const L: f64 = 0.1;
    let inertia = 1e-9 + T1.mass() * T1.diameter.powi(2) / 8.0 * L / 3.0;
    let w = (T1.gj() / (inertia * L)).sqrt();
    Study::new("torsion pendulum, 100 mm, 1e-9 kg m^2", "bob").elements("rod", &[20, 40, 80]).quantity(
        Quantity::measured(
            "frequency [Hz]",
            |o| frequency(&series(o, "turn")),
            vec![hz(w, 2e-4)],
            "GJ / (J L)",
            Bar::Within(0.005),
        )
        .because("the inertia is on the last frame, half an element before the end: first order in the element length"),
    )
}

fn torsion() -> Study {
    let h = 1e-6;
    let w = FRAC_PI_2 * (T1.gj() / (T1.mass() * T1.diameter.powi(2) / 8.0)).sqrt() / LENGTH;
    timed_torsion(w).elements("rod", &[50, 100, 200]).quantity(Quantity::measured(
        "frequency [Hz]",
        |o| frequency(&series(o, "turn")),
        vec![hz(w, h)],
        "sqrt(G / rho) / 4L",
        Bar::Within(0.005),
    ))
}

fn timed_torsion(w: f64) -> Study {
    Study::new("torsion, c / 4L", "torsion_wave").set("phase.swing.duration", format!("{:e}", 6.0 * TAU / w))
}

fn axial() -> Study {
    let h = 1e-6;
    let w = FRAC_PI_2 * (T1.ea() / T1.mass()).sqrt() / LENGTH;
    let points = |n: usize| {
        let x = |i: usize| {
            let s = i as f64 / n as f64;
            vector([LENGTH * (s + 1e-4 * (FRAC_PI_2 * s).sin()), 0.0, 0.0])
        };
        format!("[{}]", (0..=n).map(x).collect::<Vec<_>>().join(", "))
    };
    Study::new("along the rod, c / 4L", "axial_wave")
        .set("phase.swing.duration", format!("{:e}", 6.0 * TAU / w))
        .levels(COUNTS.map(|n| level(n, points(n))).into())
        .quantity(measured(vec![hz(w, h)], "sqrt(E / rho) / 4L", Bar::Order(0.005, 1.8)))
}

fn plots(studies: &[StudyResult]) -> Vec<Plot> {
    let ours =
        studies.iter().find(|s| s.name == "cantilever, decay of mode 1").map_or_else(Vec::new, |s| s.curve.clone());
    let (w, h) = (bending(links::cantilever_modes(40)[0].0), 2.5e-4);
    let theory: Vec<(f64, f64)> =
        ours.iter().map(|(t, _)| (*t, (-euler_decay(w, h) * t).exp() * (euler_frequency(w, h) * t).cos())).collect();
    let spectrum = |points: &[(f64, f64)], step: f64| -> Vec<(f64, f64)> {
        (0..=(60.0 / step) as u32)
            .map(|i| step * f64::from(i))
            .map(|f| {
                let (c, s) = points
                    .iter()
                    .fold((0.0, 0.0), |(c, s), (t, z)| (c + z * (TAU * f * t).cos(), s + z * (TAU * f * t).sin()));
                (f, c.hypot(s) * 2.0 / points.len().max(1) as f64)
            })
            .collect()
    };
    let curves = vec![
        Curve { name: "theory with implicit Euler's decay".into(), points: spectrum(&theory, 0.1), dots: false },
        Curve { name: "ours".into(), points: spectrum(&ours, 0.5), dots: true },
    ];
    vec![Plot {
        file: "vibration",
        title: "Spectrum of the tip of a cantilever let go in its first mode, h = 0.25 ms".into(),
        x: ("frequency", "Hz"),
        y: ("amplitude", ""),
        curves,
    }]
}
