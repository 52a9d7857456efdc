//! Row E-9, figure 9: one end turned five times, at several stiffnesses in bending and one in twist.

use crate::measure::{FRAME, LENGTH, level, number, scene, thread};
use crate::method::{Direct, Method, Ours};
use crate::outcome::{Axis, Check, Compare, Outcome, Panel, Picture, Plot, Table, Tube};
use crate::plan::{Experiment, Plan};
use std::f64::consts::TAU;
use sutura::glam::{DQuat, DVec3};
use sutura::{PaperSettings, knot};
use sutura_rivals::{Hold, Pose, Rod, Scene, Solver as _};

pub const EXPERIMENT: Experiment = Experiment {
    name: "fig9",
    title: "Circles wound by ten pi of turn, over stiffness in bending",
    figures: "9",
    plan,
};

const N: usize = 120;
/// Turns of the right end: 10 pi.
const TURNS: f64 = 5.0;
/// Distance of the ends over the length.
const NEAR: f64 = 0.7;
/// The ends come together in this time \[s\], then one turns, then all comes to rest.
const PRESS: f64 = 2.0;
const TURN: f64 = 8.0;
const FRAMES: usize = 60 * 14;
const DRAG: f64 = 2.0;
/// Gravity that only says which way to bend \[m/s^2\].
const NUDGE: f64 = 1e-3;
/// Stiffness in bending over that in twist. A round rod has 1 + nu = 1.4.
const RATIOS: [f64; 5] = [2.0, 1.4, 1.0, 0.5, 0.2];
/// Stiffness in twist of the paper's solver.
const TWIST: f64 = 0.25;

#[derive(Clone)]
struct Case {
    ratio: f64,
    ours: bool,
}

struct Answer {
    points: Vec<DVec3>,
    writhe: f64,
    radius: f64,
    incidents: usize,
    off_length: usize,
}

fn plan() -> Plan {
    let cases = [false, true].into_iter().flat_map(|ours| RATIOS.map(|ratio| Case { ratio, ours })).collect();
    Plan::new(
        cases,
        |c| format!("{}, bending over twist {}", if c.ours { "direct" } else { "paper" }, c.ratio),
        simulate,
        finish,
    )
}

/// For the paper's solver a chain of spheres that touch; for the other a thread of 0.3 mm, of which only the stiffness
/// in bending is changed.
fn wound(case: &Case) -> Scene {
    let l = LENGTH / (N as f64 - 1.0);
    let (shape, frame) = level(-0.5 * l, LENGTH + 0.5 * l, N);
    let round = thread(shape.clone(), shape);
    let rod =
        Rod { young: round.young * case.ratio / 1.4, radius: if case.ours { round.radius } else { 0.5 * l }, ..round };
    let way = 0.5 * (1.0 - NEAR) * LENGTH;
    let near = move |t: f64| way * (t / PRESS).min(1.0);
    let turned = |t: f64| DQuat::from_rotation_x(TAU * TURNS * ((t - PRESS) / TURN).clamp(0.0, 1.0));
    Scene {
        first: Hold::Clamp(Box::new(move |t| Pose::new(DVec3::X * (near(t) - 0.5 * l), frame))),
        last: Hold::Clamp(Box::new(move |t| Pose::new(DVec3::X * (LENGTH - near(t) + 0.5 * l), turned(t) * frame))),
        ..scene(rod, NUDGE, DRAG)
    }
}

fn simulate(case: &Case) -> Answer {
    let method = if case.ours {
        Method::Direct(Direct::default())
    } else {
        Method::Paper(
            PaperSettings { bend: [(TWIST * case.ratio).min(1.0); 2], twist: TWIST, ..PaperSettings::default() },
            1,
        )
    };
    let mut ours = Ours::new(wound(case), &method);
    for _ in 0..FRAMES {
        ours.step(FRAME);
    }
    let points = ours.positions().to_vec();
    let radius = ours.world.rod(ours.rod).map_or(0.0, |r| r.radius());
    Answer { writhe: writhe(&points), points, radius, incidents: ours.incidents, off_length: ours.off_length }
}

/// Writhe of the thread with its ends extended far along x: circles wound.
fn writhe(points: &[DVec3]) -> f64 {
    let far = DVec3::X * (1e4 * LENGTH);
    let extended: Vec<DVec3> =
        [points[0] - far].into_iter().chain(points.iter().copied()).chain([points[points.len() - 1] + far]).collect();
    knot::writhe(&extended, false)
}

fn finish(found: &[(Case, Answer)]) -> Outcome {
    let mut out = Outcome::default();
    let of = |ours: bool| -> Vec<&(Case, Answer)> { found.iter().filter(|(c, _)| c.ours == ours).collect() };
    let mut table = Table::new(
        "circles",
        "Circles wound (writhe of the centerline, in turns) by 5 turns of the end",
        &[
            "method",
            "bending over twist",
            "circles",
            "left as twist [turns]",
            "frames without an answer",
            "frames off its length",
        ],
    );
    for (c, a) in found {
        let method = if c.ours { "direct" } else { "paper" };
        table.row([
            method.into(),
            c.ratio.into(),
            a.writhe.into(),
            (TURNS - a.writhe.abs()).into(),
            a.incidents.into(),
            a.off_length.into(),
        ]);
    }
    let words = |ours: bool| of(ours).iter().map(|(_, a)| number(a.writhe.abs())).collect::<Vec<_>>().join(", ");
    let ratios = RATIOS.map(number).join(", ");
    out.compare.push(Compare {
        what: format!("9: circles wound, bending over twist {ratios}"),
        published: "fewer as bending falls (pictures)".into(),
        effective: words(false),
        true_scale: "the same: without gravity nothing knows the scale".into(),
        direct: words(true),
    });
    let clean = of(true).iter().all(|(_, a)| a.incidents == 0 && a.points.iter().all(|p| p.is_finite()));
    out.checks.push(Check::new(
        "direct winds at every stiffness, each step with an answer",
        "yes",
        if clean { "yes" } else { "no" },
        clean,
    ));
    let energy_order = of(true).windows(2).all(|w| w[1].1.writhe.abs() >= w[0].1.writhe.abs() - 0.05);
    out.checks.push(Check::new(
        "direct: what is softer in bending turns more of the twist into circles",
        "not fewer as bending falls",
        words(true),
        energy_order,
    ));
    out.say(format!(
        "15 cm, 120 elements, ends drawn together to {} of the length, then the right one turned five times about the line between them; no gravity to speak of. Of 5 turns a part stays as twist, the rest goes into circles, which the \
         writhe of the centerline counts. The paper's twist number is {TWIST}; its bending number is that times the ratio. How near the ends are is not named by the paper. It reports fewer circles as bending falls. In a rod \
         it is the other way: what is softer in bending gives more of its twist to circles, up to nearly all of it (`direct`, from one loop to a ply of four to five circles). The paper's solver shows no trend at 20 iterations ({}): \
         its spheres are as thick as its elements are long, so that a ply is four times as wide, and its twist goes along the thread by one element in a sweep. `direct` keeps its length, but where it is straight and pressed along itself and in snaps of the ply, in some frames of 840 (in the table), in which it \
         stretches as its material does.",
        number(NEAR),
        words(false)
    ));
    let mut plot = Plot::new(
        "circles",
        "Figure 9: circles wound over stiffness in bending",
        Axis::new("stiffness in bending over that in twist", ""),
        Axis::new("circles", "turns"),
    );
    for (ours, name) in [(false, "paper"), (true, "direct")] {
        let mut points: Vec<(f64, f64)> = of(ours).iter().map(|(c, a)| (c.ratio, a.writhe.abs())).collect();
        points.reverse();
        plot.line(name, points);
    }
    let panels = [false, true].into_iter().flat_map(|ours| {
        of(ours).into_iter().map(move |(c, a)| Panel {
            label: format!("{}, {}", if ours { "direct" } else { "paper" }, c.ratio),
            tubes: vec![Tube { points: a.points.clone(), radius: a.radius.max(4e-4) }],
            solids: Vec::new(),
            look: (DVec3::new(0.0, 0.8, -0.6), DVec3::Z),
            frame: None,
        })
    });
    out.pictures.push(Picture {
        name: "wound".into(),
        title: "Figure 9: stiffness in bending falls from left to right".into(),
        columns: RATIOS.len(),
        panels: panels.collect(),
    });
    out.plots.push(plot);
    out.tables.push(table);
    out
}
