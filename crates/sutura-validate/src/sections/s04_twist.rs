//! Rods and rings that lose their shape by twist.

use crate::reference::material::T1;
use crate::reference::twist;
use crate::results::{Curve, Plot, StudyResult};
use crate::study::{Bar, Level, Quantity, Section, Study, last, series};

const LENGTH: f64 = 0.1;
const RING: f64 = 0.01;

pub fn section() -> Section {
    let mut section = Section::new(
        4,
        "Instability by twist",
        "Greenhill: a straight rod of 100 mm between two clamps, one of which is drawn along the axis by the tension t = T L^2 / EI; M is its least critical \
         moment (determinant of the linear problem), and the rod is twisted by M L / GJ. Michell: a closed ring of radius 10 mm, naturally \
         straight, twisted by 2 pi sqrt 3 EI / GJ, which is 15.2359 rad here; a ring of n elements stands 34 / n^2 longer. At 0.99 of the limit \
         the rod (after a nudge) and the ring keep their shape; at 1.01 they lose it. The ring is an open rod with both ends clamped at one place: the \
         gap between them, 0.01 degrees, bends it a little before its limit.",
    );
    for t in [0.02, 10.0, 100.0, 1000.0] {
        for part in [0.99, 1.01] {
            section.studies.push(greenhill(t, part));
        }
    }
    section.studies.push(hold());
    for part in [0.99, 1.01] {
        section.studies.push(michell(part));
    }
    section.plots = plots;
    section
}

fn twisted(name: String, t: f64, part: f64) -> (Study, f64) {
    let moment = part * twist::greenhill(t) * T1.ei() / LENGTH;
    let study = Study::new(name, "twisted")
        .set("grip.left.force", format!("{:e}", t * T1.ei() / (LENGTH * LENGTH)))
        .set("phase.twist.action[0].keys[0].turn.angle", format!("{:e}", moment * LENGTH / T1.gj()));
    (study, moment)
}

fn greenhill(t: f64, part: f64) -> Study {
    let (study, moment) = twisted(format!("rod, t = {t}, {part} of the limit"), t, part);
    let study = study.levels([100, 200].map(|n: u32| Level::new(n.to_string(), 0.0, &[("thread.rod.elements", n.to_string())])).into()).quick(t == 10.0);
    let bar = if part < 1.0 { Bar::AtMost(1e-3) } else { Bar::AtLeast(0.01) };
    // What falls goes fast: shorter substeps, so that it is seen before it touches itself.
    let study = if part < 1.0 { study } else { study.set("solver.substep", "0.5 ms").set("frame_rate", 2000) };
    let study = study.quantity(Quantity::measured("off the axis / L", |o| last(o, "off_axis") / LENGTH, Vec::new(), "stays below, leaves above", bar));
    if part < 1.0 {
        study.quantity(Quantity::last("torque over its limit", "torque", part / moment, part, "GJ times twist", Bar::Within(0.001)))
    } else {
        study
    }
}

/// The torque is held for a minute.
fn hold() -> Study {
    let (study, moment) = twisted("rod, t = 10, held for 60 s at 0.95".into(), 10.0, 0.95);
    let range = move |o: &sutura_scene::Outcome| {
        let torque = series(o, "torque");
        let begin = torque.iter().find(|(t, _)| *t >= 3.0).map_or(f64::NAN, |p| p.1);
        torque.iter().filter(|(t, _)| *t >= 3.0).map(|(_, m)| (m - begin).abs()).fold(0.0, f64::max) / moment
    };
    study
        .set("frame_rate", 50)
        .set("phase.stand or fall.max_duration", "60 s")
        .set("solver.substep", "10 ms")
        .set("thread.rod.elements", 50)
        .quantity(Quantity::measured("change of the torque", range, Vec::new(), "none", Bar::AtMost(1e-6)))
        .quantity(Quantity::last("torque over its limit", "torque", 0.95 / moment, 0.95, "GJ times twist", Bar::Within(0.001)))
}

fn michell(part: f64) -> Study {
    let levels = [100, 140].map(|n: usize| {
        let twist = part * twist::michell(Some(n)) * T1.ei() / T1.gj();
        Level::new(n.to_string(), 0.0, &[("thread.ring.elements", n.to_string()), ("phase.twist.action[0].keys[0].turn.angle", format!("{twist:e}"))])
    });
    // EI and GJ of the scene's rod are those of T1 but for the digits of its modulus.
    let limit = 3.0_f64.sqrt() * T1.ei() / RING;
    let study = Study::new(format!("ring, {part} of Michell's twist"), "ring").levels(levels.into());
    let torque = move |o: &sutura_scene::Outcome| last(o, "torque") / limit;
    let study = if part < 1.0 {
        let references = [100, 140].map(|n| part * twist::michell(Some(n)) / twist::michell(None)).to_vec();
        let bent = Quantity::measured("diameter lost", |o| last(o, "shrunk"), Vec::new(), "stays round", Bar::AtMost(0.01));
        study.quantity(Quantity::measured("torque over Michell's", torque, references, "GJ times twist", Bar::Within(0.005))).quantity(bent)
    } else {
        study.quantity(Quantity::measured("torque over Michell's", torque, Vec::new(), "drops when the ring turns over", Bar::AtMost(0.9)))
    };
    study.curve(move |o| series(o, "torque").into_iter().map(|(t, m)| (t, m / limit)).collect())
}

fn plots(studies: &[StudyResult]) -> Vec<Plot> {
    let curve = |part: f64| {
        let study = studies.iter().find(|s| s.name == format!("ring, {part} of Michell's twist"));
        Curve { name: format!("{part} of the limit"), points: study.map_or_else(Vec::new, |s| s.curve.clone()), dots: false }
    };
    let curves = vec![curve(0.99), curve(1.01)];
    vec![Plot {
        file: "michell",
        title: "Torque of a ring that is twisted to 0.99 and 1.01 of Michell's limit".into(),
        x: ("time", "s"),
        y: ("M R / (√3 EI)", ""),
        curves,
    }]
}
