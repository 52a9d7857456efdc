//! Threads joined to each other.

use super::vector;
use crate::reference::kirchhoff::Cantilever;
use crate::reference::material::T1;
use crate::run;
use crate::study::{Bar, Level, Quantity, Section, Study, columns, last, series};
use std::sync::OnceLock;
use sutura_scene::Outcome;

pub fn section() -> Section {
    let mut section = Section::new(
        19,
        "Joined threads",
        "Threads of 2-0 monofilament welded to each other, under loads so small that beam theory holds (a thousandth of the length), unless said otherwise. The splice is the \
         bent and twisted cantilever of section 17 in two pieces, the outer one numbered toward the clamp. Closed rings are in sections 4, 7 and 8.",
    );
    section.studies.push(splice());
    section.studies.push(knee("knee, force across its plane", [0.0, 0.0, -1.0]));
    section.studies.push(knee("knee, force in its plane", [1.0, 0.0, 0.0]));
    section.studies.push(branch());
    section
}

/// Levels of so many elements in all, parts of them in each of the threads.
fn elements(counts: [u32; 3], threads: [(&str, u32); 2]) -> Vec<Level> {
    let total: u32 = threads.iter().map(|(_, part)| part).sum();
    let level = |n: u32| {
        let mut level = Level::new(n.to_string(), 1.0 / f64::from(n), &[]);
        level.settings = threads
            .iter()
            .map(|(name, part)| (format!("thread.{name}.elements"), (n * part / total).to_string()))
            .collect();
        level
    };
    counts.map(level).into()
}

fn splice() -> Study {
    const LENGTH: f64 = 0.05;
    const COUNTS: [u32; 3] = [24, 48, 96];
    let force = [0.0, -1e-3, 0.0];
    let torque = [2e-5, 0.0, 0.0];
    let exact = Cantilever {
        start: [0.0; 3],
        frame: [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]],
        length: LENGTH,
        stiffness: [T1.ei(), T1.ei(), T1.gj()],
        rest: [0.0; 3],
        force,
        moment: torque,
    }
    .tip()
    .position;
    let load = |place: &str| {
        format!("{{ load = \"tip\", {place}, force = {}, torque = {}, ramp = \"2 s\" }}", vector(force), vector(torque))
    };
    let whole = load("at = \"end\"");
    // The same rod in one piece, run when it is first asked for.
    let pieces: [OnceLock<[f64; 3]>; 3] = Default::default();
    let tip = |o: &Outcome| ["tip.x", "tip.y", "tip.z"].map(|p| last(o, p));
    let apart = move |o: &Outcome| {
        let n: usize = o.report.threads.iter().map(|t| t.elements).sum();
        let Some(i) = COUNTS.iter().position(|c| *c as usize == n) else { return f64::NAN };
        let one = pieces[i].get_or_init(|| {
            let settings = [
                ("thread.rod.elements".to_string(), n.to_string()),
                ("phase.load.action[0]".to_string(), whole.clone()),
            ];
            run::scene("cantilever", &settings).map_or([f64::NAN; 3], |o| tip(&o))
        });
        tip(o).iter().zip(one).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt() / LENGTH
    };
    let mut study = Study::new("splice", "splice")
        .set("phase.load.action[0]", load("thread = \"outer\", at = \"start\""))
        .levels(elements(COUNTS, [("root", 1), ("outer", 1)]))
        .quick(true)
        .quantity(Quantity::measured(
            "tip, distance from that of the rod in one piece / L",
            apart,
            Vec::new(),
            "the same",
            Bar::AtMost(1e-5),
        ));
    for (i, probe) in ["tip.x", "tip.y", "tip.z"].into_iter().enumerate() {
        let name = format!("{} / L", probe.replace('.', " "));
        study = study.quantity(Quantity::last(
            name,
            probe,
            1.0 / LENGTH,
            exact[i] / LENGTH,
            "shooting",
            Bar::Order(0.01, 1.8),
        ));
    }
    study.quantity(Quantity::measured(
        "pieces part by at most [m]",
        |o| series(o, "apart").iter().map(|p| p.1).fold(0.0, f64::max),
        Vec::new(),
        "joined",
        Bar::AtMost(1e-12),
    ))
}

/// A leg of 30 mm and an arm of 20 mm at a right angle.
fn knee(name: &str, direction: [f64; 3]) -> Study {
    const FORCE: f64 = 1e-6;
    let (leg, arm) = (0.03_f64, 0.02_f64);
    let (ei, gj) = (T1.ei(), T1.gj());
    let bent = |l: f64| l.powi(3) / (3.0 * ei);
    let study = Study::new(name, "knee")
        .set("phase.load.action[0].force", vector(direction.map(|c| FORCE * c)))
        .levels(elements([25, 50, 100], [("leg", 3), ("arm", 2)]))
        .quick(true);
    let angle =
        |o: &Outcome| series(o, "angle").iter().map(|p| (p.1 - std::f64::consts::FRAC_PI_2).abs()).fold(0.0, f64::max);
    let beam = "beam theory";
    let study = if direction[2] == 0.0 {
        let moved = move |probe: &'static str, at: f64| move |o: &Outcome| (last(o, probe) - at) / FORCE;
        study
            .quantity(Quantity::measured(
                "tip moves along the force [m/N]",
                moved("tip.x", leg),
                vec![bent(arm) + arm * arm * leg / ei],
                beam,
                Bar::Order(0.005, 1.8),
            ))
            .quantity(Quantity::measured(
                "across it [m/N]",
                moved("tip.y", arm),
                vec![-arm * leg * leg / (2.0 * ei)],
                beam,
                Bar::Order(0.005, 1.8),
            ))
            .quantity(Quantity::last(
                "torque of the clamp over F b",
                "wall_torque.z",
                1.0 / (FORCE * arm),
                1.0,
                "statics",
                Bar::Within(1e-3),
            ))
    } else {
        let sag = -(bent(leg) + bent(arm) + arm * arm * leg / gj);
        study
            .quantity(Quantity::last(
                "tip moves [m/N]",
                "tip.z",
                1.0 / FORCE,
                sag,
                "beam theory",
                Bar::Order(0.005, 1.8),
            ))
            .quantity(Quantity::last(
                "torque of the clamp over F b",
                "wall_torque.x",
                1.0 / (FORCE * arm),
                1.0,
                "statics",
                Bar::Within(1e-3),
            ))
            .quantity(Quantity::last(
                "over F a",
                "wall_torque.y",
                -1.0 / (FORCE * leg),
                1.0,
                "statics",
                Bar::Within(1e-3),
            ))
    };
    // Read between elements half an element from the weld.
    study.quantity(Quantity::measured("change of the angle [rad]", angle, Vec::new(), "keeps", Bar::AtMost(1e-3)))
}

/// A bar of 40 mm between clamps with an arm of 10 mm at its middle.
fn branch() -> Study {
    const FORCE: f64 = 2e-6;
    let (bar, arm) = (0.04_f64, 0.01_f64);
    let (ei, gj) = (T1.ei(), T1.gj());
    // Either half of the bar is twisted by half of the torque.
    let sag = arm * arm * 0.25 * bar / gj + bar.powi(3) / (192.0 * ei) + arm.powi(3) / (3.0 * ei);
    Study::new("branch", "branch")
        .levels(elements([30, 60, 120], [("bar", 2), ("arm", 1)]))
        .quick(true)
        .quantity(Quantity::last("tip moves [m/N]", "tip.z", -1.0 / FORCE, sag, "beam theory", Bar::Order(0.01, 1.8)))
        .quantity(Quantity::last(
            "torque of a clamp over F b / 2",
            "torque",
            2.0 / (FORCE * arm),
            1.0,
            "statics",
            Bar::Within(1e-3),
        ))
        .quantity(Quantity::last(
            "force of the clamps over the load",
            "carried",
            1.0 / FORCE,
            1.0,
            "statics",
            Bar::Within(1e-6),
        ))
        .quantity(Quantity::measured(
            "tip moves across / down",
            |o| columns(o, "tip", ["x", "z"]).last().map_or(f64::NAN, |[x, z]| ((x - 0.02) / z).abs()),
            Vec::new(),
            "none",
            Bar::AtMost(1e-3),
        ))
}
