//! Time integration of second order.

use crate::reference::links;
use crate::reference::material::{GRAVITY, T1};
use crate::reference::vibration::{self, decay, frequency, tr_bdf2_decay, tr_bdf2_frequency};
use crate::run;
use crate::sections::s08_vibration::shaped;
use crate::study::{Bar, Level, Quantity, Section, Study, columns, series};
use std::f64::consts::TAU;
use std::sync::OnceLock;
use sutura_scene::Outcome;

pub fn section() -> Section {
    let mut section = Section::new(
        18,
        "Second order in time",
        "The integrator `tr_bdf2`. Rods that swing slightly, against theory and what the method makes of it: a mode of angular frequency w is slowed by the part \
         0.04 (w h)^2 and loses (w h)^4 / 272 of its amplitude a substep. The free swing is a thread of 15 cm, radius 0.25 mm, E = 10 MPa, \
         clamped at one end and let go level; distances of its end from the converged answer (same elements, 64 substeps a frame) are root mean squares over the frames, 60 a second. With a \
         drag of 4/s over 2 s. Without drag the motion is chaotic after about 0.8 s: one part in a million more weight ends up as centimeters, in any integrator, so \
         that it is compared over the first half second. A thread of 40 elements is compared with the equations of motion of its links by Runge and Kutta.",
    );
    section.studies.push(cantilever());
    section.studies.push(pendulum());
    section.studies.push(swing(
        "free swing, drag 4/s, 2 s",
        "tr_bdf2",
        &[2, 4, 8, 16],
        4.0,
        120,
        Bar::Order(5e-4, 1.8),
    ));
    section.studies.push(swing(
        "free swing, drag 4/s, 2 s, implicit Euler",
        "implicit_euler",
        &[4, 8, 16, 32],
        4.0,
        120,
        Bar::Order(0.015, 0.7),
    ));
    section.studies.push(swing(
        "free swing, no drag, 0.5 s",
        "tr_bdf2",
        &[4, 8, 16, 32],
        0.0,
        30,
        Bar::Order(5e-4, 1.8),
    ));
    section.studies.push(swing(
        "free swing, no drag, 0.5 s, implicit Euler",
        "implicit_euler",
        &[4, 16, 32, 64],
        0.0,
        30,
        Bar::Order(0.05, 0.7),
    ));
    section.studies.push(sensitive());
    section.studies.push(linked());
    section
}

const SUBSTEPS: [f64; 3] = [32e-3, 16e-3, 8e-3];

fn stepped(h: f64) -> Level {
    Level::new(
        format!("{} ms", 1e3 * h),
        h,
        &[("solver.substep", format!("{h:e}")), ("frame_rate", format!("{:e}", 1.0 / h))],
    )
}

/// The tip after two seconds. The rod begins in the shape of the continuum's mode, and the clamp turns its first
/// element: a part of 0.005 of the second mode is in it, which at the shortest substep is more than the first mode
/// loses in two seconds, and is gone by then.
fn late(o: &Outcome) -> Vec<(f64, f64)> {
    series(o, "tip").into_iter().filter(|p| p.0 > 2.0).collect()
}

fn cantilever() -> Study {
    const N: usize = 20;
    const LENGTH: f64 = 0.1;
    let beta = vibration::cantilever(1)[0];
    let w = links::cantilever_modes(N)[0].0 * (T1.ei() / T1.mass()).sqrt() / (LENGTH * LENGTH);
    Study::new("cantilever of 100 mm, mode 1", "vibrating")
        .set("solver.integrator", "tr_bdf2")
        .set("thread.rod.points", shaped(N, LENGTH, |s| vibration::cantilever_shape(beta, s)))
        .set("phase.swing.duration", "24 s")
        .levels(SUBSTEPS.map(stepped).into())
        .quantity(Quantity::measured(
            "frequency [Hz]",
            |o| frequency(&series(o, "tip")),
            vec![w / TAU],
            "chain of 20 links",
            Bar::Order(0.005, 1.8),
        ))
        .quantity(Quantity::measured(
            "frequency [Hz]",
            |o| frequency(&series(o, "tip")),
            SUBSTEPS.map(|h| tr_bdf2_frequency(w, h) / TAU).to_vec(),
            "TR-BDF2",
            Bar::Within(0.002),
        ))
        .quantity(Quantity::measured(
            "decay [1/s]",
            |o| decay(&late(o)),
            SUBSTEPS.map(|h| tr_bdf2_decay(w, h)).to_vec(),
            "TR-BDF2",
            Bar::Within(0.01),
        ))
}

fn pendulum() -> Study {
    const STEPS: [f64; 3] = [2e-2, 1e-2, 5e-3];
    let w = (1.5 * GRAVITY / 0.1).sqrt();
    let discrete = {
        // Masses at the particles, half at the ends: sum of m x^2 is (1 + 1 / 2 n^2) / 3 of M L^2.
        let n = 20.0_f64;
        w / (1.0 + 0.5 / (n * n)).sqrt()
    };
    Study::new("rod pendulum, 100 mm", "pendulum")
        .set("solver.integrator", "tr_bdf2")
        .levels(STEPS.map(stepped).into())
        .quick(true)
        .quantity(Quantity::measured(
            "frequency [Hz]",
            |o| frequency(&series(o, "tip")),
            vec![discrete / TAU],
            "masses on a rigid line",
            Bar::Order(0.005, 1.8),
        ))
        .quantity(Quantity::measured(
            "decay [1/s]",
            |o| decay(&series(o, "tip")),
            STEPS.map(|h| tr_bdf2_decay(discrete, h)).to_vec(),
            "TR-BDF2",
            Bar::Within(0.05),
        ))
}

/// What is set for a drag in 1/s: the part of the velocity lost in a second.
fn damping(drag: f64) -> (String, String) {
    ("solver.linear_damping".into(), format!("{:e}", -(-drag).exp_m1()))
}

fn tip(o: &Outcome) -> Vec<[f64; 3]> {
    columns(o, "tip", ["x", "y", "z"])
}

/// The converged path of the end, run when it is first asked for.
fn converged(drag: f64, settings: &[(&str, &str)]) -> Vec<[f64; 3]> {
    let mut all =
        vec![damping(drag), ("solver.substeps".into(), "64".into()), ("solver.tolerance".into(), "1e-5".into())];
    all.extend(settings.iter().map(|(path, value)| ((*path).to_string(), (*value).to_string())));
    run::scene("free_swing", &all).map_or_else(|_| Vec::new(), |o| tip(&o))
}

/// Root mean square distance \[m\] over the first rows but that of the start; not a number where they are not there.
fn apart(a: &[[f64; 3]], b: &[[f64; 3]], frames: usize) -> f64 {
    if a.len() <= frames || b.len() <= frames {
        return f64::NAN;
    }
    let squares: f64 =
        a.iter().zip(b).skip(1).take(frames).flat_map(|(a, b)| (0..3).map(move |i| (a[i] - b[i]).powi(2))).sum();
    (squares / frames as f64).sqrt()
}

fn swing(name: &str, integrator: &str, substeps: &[u32], drag: f64, frames: usize, bar: Bar) -> Study {
    let reference = OnceLock::new();
    let off = move |o: &Outcome| 1e3 * apart(&tip(o), reference.get_or_init(|| converged(drag, &[])), frames);
    let levels = substeps
        .iter()
        .map(|n| Level::new(format!("{n} a frame"), 1.0 / f64::from(*n), &[("solver.substeps", n.to_string())]));
    let (path, value) = damping(drag);
    Study::new(name, "free_swing")
        .set("solver.integrator", integrator)
        .set(&path, value)
        .levels(levels.collect())
        .quantity(
            Quantity::measured("end, distance from the converged path [mm]", off, vec![0.0], "64 substeps", bar)
                .scale(1000.0 * 0.15),
        )
}

/// Not of ours but of the problem: what a millionth more of weight does without drag.
fn sensitive() -> Study {
    let moved = |frames: usize| {
        move |_: &Outcome| {
            let [a, b] =
                ["-9.81", "-9.81000981"].map(|g| converged(0.0, &[("solver.gravity", &format!("[0, 0, {g}]"))]));
            1e3 * apart(&a, &b, frames)
        }
    };
    Study::direct("free swing, no drag, a millionth more of weight")
        .quantity(Quantity::measured("end moves over 0.5 s [mm]", moved(30), Vec::new(), "none", Bar::AtMost(0.001)))
        .quantity(Quantity::measured("end moves over 2 s [mm]", moved(120), Vec::new(), "none", Bar::AtLeast(1.0)))
}

/// Against the equations of motion of the links, of the same number, which no code of ours integrates.
fn linked() -> Study {
    const N: usize = 40;
    const TIMES: [f64; 4] = [0.1, 0.2, 0.3, 0.4];
    const LENGTH: f64 = 0.15;
    // EI / M = E r^2 / (4 rho L).
    let bending = 1e7 * 0.25e-3_f64.powi(2) / (4.0 * 1000.0 * LENGTH);
    let exact: OnceLock<Vec<[f64; 2]>> = OnceLock::new();
    let off = move |o: &Outcome| {
        let exact = exact.get_or_init(|| links::rod_swing(N, LENGTH, bending, 4.0, &TIMES));
        let rows = columns(o, "tip", ["time", "x", "z"]);
        let at = |(time, exact): (&f64, &[f64; 2])| {
            let row = rows.iter().find(|r| (r[0] - time).abs() < 1e-6);
            row.map_or(f64::NAN, |[_, x, z]| (x - exact[0]).hypot(z - exact[1]))
        };
        1e3 * TIMES.iter().zip(exact).map(at).fold(0.0, |a, b| if b.is_nan() || b > a { b } else { a })
    };
    let levels = [4_u32, 8, 16]
        .map(|n| Level::new(format!("{n} a frame"), 1.0 / f64::from(n), &[("solver.substeps", n.to_string())]));
    let (path, value) = damping(4.0);
    Study::new("free swing of 40 elements, inextensible, drag 4/s", "free_swing")
        .set("thread.thread.elements", N)
        .set("thread.thread.stretch", "inextensible")
        .set(&path, value)
        .set("phase.swing.duration", "0.5 s")
        .levels(levels.into())
        .quantity(
            Quantity::measured(
                "end, greatest distance at 0.1 to 0.4 s [mm]",
                off,
                vec![0.0],
                "40 links, Runge and Kutta",
                Bar::Order(5e-4, 1.8),
            )
            .scale(1000.0 * LENGTH),
        )
}
