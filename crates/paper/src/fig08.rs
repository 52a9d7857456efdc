//! Row E-8, figure 8: a thread of 40 elements, pressed together by 5 cm and turned once, by every method; and what each
//! costs at what error.

use crate::measure::{
    EFFECTIVE, FRAME, GRAVITY, LENGTH, apart_about_x, at_arc, level, mm, number, out_of_plane, percent, play, sane,
    scene, thread,
};
use crate::method::{Direct, Method};
use crate::outcome::{Axis, Check, Compare, Outcome, Panel, Picture, Plot, Table, Tube};
use crate::plan::{Experiment, Plan};
use std::f64::consts::TAU;
use sutura::glam::{DQuat, DVec3};
use sutura::{PaperSettings, SweepOrder};
use sutura_rivals::{Hold, Pose, Scene, der, pbd, pber};

pub const EXPERIMENT: Experiment = Experiment {
    name: "fig8",
    title: "Bending and twist coupled: both ends moved 5 cm and turned 360 degrees",
    figures: "8",
    plan,
};

/// Elements of the published thread.
const N: usize = 40;
/// The ends move for this time \[s\], and are then held until the end.
const MOVE: f64 = 4.0;
/// Frames in all.
const FRAMES: usize = 600;
/// Rate at which velocities fade \[1/s\], so that it comes to rest. The paper names none.
const DRAG: f64 = 2.0;
/// Gravity that only says which way to bend \[m/s^2\].
const NUDGE: f64 = 1e-3;
/// Points at which shapes are compared.
const POINTS: usize = 200;

/// The thread between the middles of its two held elements is 15 cm long, so that refinement converges to one rod.
fn pressed(n: usize, gravity: f64) -> Scene {
    let l = LENGTH / (n as f64 - 1.0);
    let (shape, frame) = level(-0.5 * l, LENGTH + 0.5 * l, n);
    let part = |t: f64| (t / MOVE).min(1.0);
    Scene {
        first: Hold::Clamp(Box::new(move |t| Pose::new(DVec3::X * (0.025 * part(t) - 0.5 * l), frame))),
        last: Hold::Clamp(Box::new(move |t| {
            let turn = DQuat::from_rotation_x(TAU * part(t));
            Pose::new(DVec3::X * (LENGTH - 0.025 * part(t) + 0.5 * l), turn * frame)
        })),
        ..scene(thread(shape.clone(), shape), gravity, DRAG)
    }
}

#[derive(Clone)]
struct Case {
    method: Method,
    n: usize,
    gravity: f64,
    role: Role,
}

/// What a case is run for.
#[derive(Clone, Copy, PartialEq)]
enum Role {
    /// The answer: discrete elastic rods, fine.
    Converged,
    /// The published figure.
    Figure,
    /// Cost against error.
    Sweep,
}

struct Answer {
    /// Points at equal arc lengths.
    shape: Vec<DVec3>,
    /// The vertices.
    points: Vec<DVec3>,
    out_of_plane: f64,
    elongation: f64,
    ms: f64,
    /// Farthest way of a point in the last second \[m\].
    restless: f64,
}

fn weak() -> f64 {
    GRAVITY / EFFECTIVE
}

fn der(substeps: usize) -> Method {
    Method::Der(der::Settings { substeps, iterations: 200, ..Default::default() })
}

fn direct(substeps: u32) -> Method {
    Method::Direct(Direct { substeps, ..Direct::default() })
}

fn paper(iterations: u32, substeps: u32) -> Method {
    Method::Paper(PaperSettings { iterations, ..numbers() }, substeps)
}

/// Stiffness numbers of bending and twist in the ratio of the moduli, G J / E I = 1 / (1 + nu).
fn numbers() -> PaperSettings {
    PaperSettings { bend: [0.05; 2], twist: 0.05 / 1.4, ..PaperSettings::default() }
}

fn pber(iterations: usize, substeps: usize) -> Method {
    Method::Pber(pber::Settings {
        substeps,
        iterations,
        bend_twist: DVec3::new(0.05, 0.05, 0.05 / 1.4),
        ..Default::default()
    })
}

fn pbd(iterations: usize, substeps: usize) -> Method {
    Method::Pbd(pbd::Settings { substeps, iterations, ..Default::default() })
}

fn plan() -> Plan {
    let case = |method: Method, n: usize, gravity: f64, role: Role| Case { method, n, gravity, role };
    let mut cases = Vec::new();
    for (gravity, full) in [(NUDGE, false), (weak(), false), (GRAVITY, true)] {
        cases.push(case(der(4), 320, gravity, Role::Converged));
        let one_each = [
            paper(20, 1),
            Method::Paper(PaperSettings::default(), 1),
            pber(20, 1),
            pber(80, 1),
            pbd(20, 1),
            direct(4),
            der(1),
        ];
        cases.extend(one_each.into_iter().map(|m| case(m, N, gravity, Role::Figure)));
        let two_color = PaperSettings { order: SweepOrder::TwoColor, ..numbers() };
        cases.push(case(Method::Paper(two_color, 1), N, gravity, Role::Figure));
        // At true scale one step a frame is too long for the position-based methods; with ten the step is that of the
        // effective scale.
        if full {
            cases.extend(
                [paper(20, 10), pber(80, 10), pbd(20, 10)].into_iter().map(|m| case(m, N, gravity, Role::Figure)),
            );
        }
    }
    for n in [10, 20, 40, 80, 160] {
        cases.extend(
            [direct(1), direct(2), der(1), der(2), paper(20, 1), pber(20, 1)]
                .into_iter()
                .map(|m| case(m, n, weak(), Role::Sweep)),
        );
    }
    for iterations in [5, 80, 320] {
        cases.extend(
            [paper(iterations, 1), pber(iterations as usize, 1)].into_iter().map(|m| case(m, N, weak(), Role::Sweep)),
        );
    }
    Plan::new(
        cases,
        |c| format!("{}, {} elements, {}, g {}", c.method.name(), c.n, c.method.budget(), number(c.gravity)),
        simulate,
        finish,
    )
}

fn simulate(case: &Case) -> Answer {
    let mut solver = case.method.start(pressed(case.n, case.gravity));
    let mut before = Vec::new();
    let ms = play(&mut *solver, FRAME, FRAMES, |k, s| {
        if k == FRAMES - 60 {
            before = s.positions().to_vec();
        }
    });
    let points = solver.positions().to_vec();
    if !sane(&points, LENGTH) {
        return Answer {
            shape: Vec::new(),
            points,
            out_of_plane: f64::NAN,
            elongation: f64::NAN,
            ms,
            restless: f64::NAN,
        };
    }
    let l = solver.rest_lengths()[0];
    let shape = (0..=POINTS)
        .map(|k| at_arc(&points, solver.rest_lengths(), -0.5 * l, LENGTH * k as f64 / POINTS as f64))
        .collect();
    let restless = points.iter().zip(&before).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    Answer { shape, out_of_plane: out_of_plane(&points), elongation: solver.elongation(), points, ms, restless }
}

fn finish(found: &[(Case, Answer)]) -> Outcome {
    let mut out = Outcome::default();
    let converged = |gravity: f64| {
        found
            .iter()
            .find(|(c, _)| c.role == Role::Converged && c.gravity == gravity)
            .map(|(_, a)| a)
            .expect("it was run")
    };
    let error = |c: &Case, a: &Answer| {
        let reference = converged(c.gravity);
        if a.shape.is_empty() { f64::NAN } else { apart_about_x(&a.shape, &reference.shape) / LENGTH }
    };
    let loop_error = |c: &Case, a: &Answer| a.out_of_plane / converged(c.gravity).out_of_plane - 1.0;
    let figures = || found.iter().filter(|(c, _)| c.role == Role::Figure);

    let headings = [
        "gravity [m/s^2]",
        "method",
        "steps x iterations",
        "bend : twist",
        "out of plane [mm]",
        "against DER, converged",
        "shape, RMS / length",
        "elongation",
        "moved in the last second [mm]",
    ];
    let mut table = Table::new(
        "loop",
        "Out-of-plane distance of the loop at rest, 40 elements (converged: DER, 320 elements)",
        &headings,
    );
    let mut times = Table::new(
        "times",
        "CPU time of a frame, 40 elements",
        &["gravity [m/s^2]", "method", "steps x iterations", "ms a frame (median)"],
    )
    .measured();
    for (c, a) in found.iter().filter(|(c, _)| c.role != Role::Sweep) {
        table.row([
            c.gravity.into(),
            c.method.name().into(),
            c.method.budget().into(),
            stiffness(&c.method).into(),
            (1e3 * a.out_of_plane).into(),
            percent(loop_error(c, a)).into(),
            percent(error(c, a)).into(),
            percent(a.elongation).into(),
            (1e3 * a.restless).into(),
        ]);
        if c.role == Role::Figure {
            times.row([c.gravity.into(), c.method.name().into(), c.method.budget().into(), a.ms.into()]);
        }
    }

    let pick = |name: &str, budget: &str, own: bool, gravity: f64| {
        let fits = |c: &Case| c.method.name() == name && c.method.budget() == budget && c.gravity == gravity;
        figures().find(|(c, _)| fits(c) && (stiffness(&c.method) != "0.05 : 0.25" || !own)).expect("it was run")
    };
    let weak = weak();
    let [p, pb, pl, d, rod] =
        [("paper", "1 x 20"), ("PBER", "1 x 80"), ("PBD", "1 x 20"), ("direct", "4 x Newton"), ("DER", "1 x Newton")]
            .map(|(name, budget)| pick(name, budget, true, weak));
    let strong = [("paper", "1 x 20"), ("PBER", "1 x 80"), ("PBD", "1 x 20")]
        .map(|(name, budget)| pick(name, budget, true, GRAVITY));
    let [p0, pb0, pl0, d0, rod0] =
        [("paper", "1 x 20"), ("PBER", "1 x 80"), ("PBD", "1 x 20"), ("direct", "4 x Newton"), ("DER", "1 x Newton")]
            .map(|(name, budget)| pick(name, budget, true, NUDGE));
    let few = pick("PBER", "1 x 20", true, NUDGE);
    let (d_true, p_ten) = (pick("direct", "4 x Newton", true, GRAVITY), pick("paper", "10 x 20", true, GRAVITY));
    let default =
        figures().find(|(c, _)| c.gravity == weak && stiffness(&c.method) == "0.05 : 0.25").expect("it was run");

    let physical = [
        (d0, "direct, without gravity"),
        (d, "direct, effective scale"),
        (d_true, "direct, true scale"),
        (rod0, "DER, 40 elements, without gravity"),
        (rod, "DER, 40 elements, effective scale"),
    ];
    for ((c, a), name) in [(p0, "paper, without gravity"), (pb0, "PBER, without gravity")]
        .into_iter()
        .chain(physical)
        .chain([(p, "paper, effective scale"), (pb, "PBER, effective scale")])
    {
        let e = loop_error(c, a);
        out.checks.push(Check::new(
            format!("loop of {name}, against converged DER"),
            "within 10 %",
            percent(e),
            e.abs() <= 0.1,
        ));
    }
    for (found, place) in [(pl0, "without gravity"), (pl, "effective scale")] {
        out.checks.push(Check::new(
            format!("plain PBD shows no loop, {place}"),
            "< 1 % of DER's",
            mm(found.1.out_of_plane),
            found.1.out_of_plane < 0.01 * converged(found.0.gravity).out_of_plane,
        ));
    }

    out.compare.push(Compare {
        what: "8: out-of-plane loop, ours / PBER / plain PBD".into(),
        published: "yes / yes / none (pictures)".into(),
        effective: format!("{} / {} / {}", mm(p.1.out_of_plane), mm(pb.1.out_of_plane), mm(pl.1.out_of_plane)),
        true_scale: strong.map(|(_, a)| mm(a.out_of_plane)).join(" / "),
        direct: format!("{} (converged DER: {})", mm(d_true.1.out_of_plane), mm(converged(GRAVITY).out_of_plane)),
    });
    out.compare.push(Compare {
        what: "8: ms a frame, ours / PBER / plain PBD".into(),
        published: "2.68 / 32.44 / 2.24 (i7-7700, C#)".into(),
        effective: format!("{} / {} / {}", number(p.1.ms), number(pb.1.ms), number(pl.1.ms)),
        true_scale: strong.map(|(_, a)| number(a.ms)).join(" / "),
        direct: format!("{} (DER {})", number(d_true.1.ms), number(pick("DER", "1 x Newton", true, GRAVITY).1.ms)),
    });
    out.checks.push(
        Check::new("paper, 40 elements, 20 iterations: ms a frame", "<= 0.1", number(p.1.ms), p.1.ms <= 0.1).measured(),
    );

    // Cost against error: a method is better where its curve lies farther to the lower left.
    let mut plot = Plot::new(
        "cost",
        "Cost against error: 10 to 160 elements, at rest, effective scale",
        Axis::log("error of the shape, RMS over length", ""),
        Axis::log("CPU time of a frame", "ms"),
    );
    plot.measured = true;
    let mut sweep = Table::new(
        "errors",
        "Error of the shape at rest by method, elements and budget",
        &["method", "elements", "steps x iterations", "error / length", "elongation"],
    )
    .hidden();
    let mut costs = Table::new(
        "costs",
        "Cost by method, elements and budget",
        &["method", "elements", "steps x iterations", "error / length", "ms a frame"],
    )
    .measured()
    .hidden();
    let mut lines: Vec<(String, Vec<(f64, f64)>)> = Vec::new();
    for (c, a) in found
        .iter()
        .filter(|(c, _)| c.gravity == weak && c.role != Role::Converged && stiffness(&c.method) != "0.05 : 0.25")
    {
        let e = error(c, a);
        sweep.row([c.method.name().into(), c.n.into(), c.method.budget().into(), e.into(), a.elongation.into()]);
        costs.row([c.method.name().into(), c.n.into(), c.method.budget().into(), e.into(), a.ms.into()]);
        if c.role == Role::Sweep
            && !c.method.budget().starts_with("2 x")
            && (c.n != N || matches!(&c.method, Method::Direct(_) | Method::Der(_)) || c.method.budget() == "1 x 20")
        {
            let name = format!("{}, {}", c.method.name(), c.method.budget());
            match lines.iter_mut().find(|l| l.0 == name) {
                Some(l) => l.1.push((e, a.ms)),
                None => lines.push((name, vec![(e, a.ms)])),
            }
        }
    }
    let budgets = |name: &str| -> Vec<(f64, f64)> {
        let mut own: Vec<&(Case, Answer)> = found
            .iter()
            .filter(|(c, _)| c.role == Role::Sweep && c.n == N && c.method.name() == name && c.gravity == weak)
            .collect();
        own.sort_by(|a, b| a.1.ms.total_cmp(&b.1.ms));
        own.into_iter().map(|(c, a)| (error(c, a), a.ms)).collect()
    };
    let cheapest = |name: &str, bound: f64| {
        let all =
            found.iter().filter(|(c, _)| c.role != Role::Converged && c.gravity == weak && c.method.name() == name);
        all.filter(|(c, a)| error(c, a) <= bound).map(|(_, a)| a.ms).fold(f64::INFINITY, f64::min)
    };
    for (name, mut points) in lines {
        points.sort_by(|a, b| a.1.total_cmp(&b.1));
        plot.line(name, points);
    }
    for name in ["paper", "PBER"] {
        plot.line(format!("{name}, 40 elements, 5 to 320 iterations"), budgets(name));
    }
    let mut equal = Table::new(
        "equal",
        "Cheapest setting that reaches an error (RMS of the shape at rest over the length)",
        &["error", "direct [ms]", "DER [ms]", "paper [ms]", "PBER [ms]"],
    )
    .measured();
    let mut dearer = Vec::new();
    for bound in [0.1, 0.03, 0.01, 0.003, 0.001, 0.0003] {
        let [d, rest @ ..] = ["direct", "DER", "paper", "PBER"].map(|m| cheapest(m, bound));
        if rest.iter().any(|c| *c < d) {
            dearer.push(percent(bound));
        }
        let cell = |v: f64| if v.is_finite() { v.into() } else { "not reached".into() };
        equal.row([percent(bound).into(), cell(d), cell(rest[0]), cell(rest[1]), cell(rest[2])]);
    }
    let words = if dearer.is_empty() {
        "yes".into()
    } else {
        format!("all but {}, where DER with 10 elements is", dearer.join(", "))
    };
    out.checks.push(
        Check::new("direct is the cheapest at equal error", "at each error of the table", words, dearer.is_empty())
            .measured(),
    );

    out.say(format!(
        "A thread of 15 cm between clamps (0.3 mm, 2 GPa, Poisson's ratio 0.4), straight at rest. In {MOVE} s the ends come together by 5 cm while one turns once; then all comes to rest. The \
         paper's solver and both rivals of it know lengths only by g dt^2 over them, so that its effective scale, 15 m, is the same as a hundredth of gravity at true size: that is what \
         *gravity {}* means, and what the physical methods are compared at as well. Out-of-plane distance: of all planes through the line between the ends, the one is taken from which the farthest \
         point is nearest.",
        number(weak)
    ));
    out.say(format!(
        "**Without gravity** (a ten-thousandth of it, which says which way to bend) all but plain PBD show the loop: paper {} at 20 iterations, PBER {} at 80 ({} at 20, where it still creeps), direct {}, DER {}. \
         The joints beside the held edges of PBER are softer, since a ghost point that is held cannot give way. **At the effective scale** gravity, weak as it is, wins over \
         the constraints of 20 iterations: the loop of the paper's solver is {} and that of PBER {}; both grow with the iterations.",
        mm(p0.1.out_of_plane),
        mm(pb0.1.out_of_plane),
        mm(few.1.out_of_plane),
        mm(d0.1.out_of_plane),
        mm(rod0.1.out_of_plane),
        mm(p.1.out_of_plane),
        mm(pb.1.out_of_plane),
    ));
    out.say(format!(
        "**Numbers without unit.** Bending and twisting stiffness of a round rod are in the ratio 1 : {}; with numbers in that ratio the paper's solver gives {} at the effective scale, with those \
         that the paper names for figure 10 (0.05 : 0.25, a rod five times as stiff in twist) it gives {}: the shape is that of its ratio, and only that. Its out-of-plane distance is {} of the converged one.",
        number(1.0 / 1.4),
        mm(p.1.out_of_plane),
        mm(default.1.out_of_plane),
        percent(p.1.out_of_plane / converged(weak).out_of_plane),
    ));
    out.say(format!(
        "**True scale.** With 9.81 m/s^2 and one step a frame the paper's solver gives {}, PBER {}, where it should be {}. With ten steps a frame, which is the step of the effective scale again, \
         the paper's solver gives {}: what is wrong is not its constraints but how far gravity moves a point in a step; how stiff the thread is, still nobody told it.",
        mm(strong[0].1.out_of_plane),
        mm(strong[1].1.out_of_plane),
        mm(converged(GRAVITY).out_of_plane),
        mm(p_ten.1.out_of_plane),
    ));
    out.say(format!(
        "**Cost.** Published: PBER over ours 12, ours over plain PBD 1.2, at numbers of iterations that are not named. Here, in one run, PBER at 80 iterations and the others at 20: {} and {}.",
        number(pb.1.ms / p.1.ms),
        number(p.1.ms / pl.1.ms)
    ));

    out.pictures.push(picture(
        found,
        NUDGE,
        "loop",
        "Without gravity, from the side (top row) and from above (bottom row)",
    ));
    out.pictures.push(picture(
        found,
        weak,
        "effective",
        "At the effective scale, from the side (top row) and from above (bottom row)",
    ));
    out.pictures.push(picture(
        found,
        GRAVITY,
        "true",
        "At true scale, from the side (top row) and from above (bottom row)",
    ));
    out.plots.push(plot);
    out.tables.extend([table, times, equal, sweep, costs]);
    out
}

/// The stiffness numbers of bending and twist.
fn stiffness(m: &Method) -> String {
    match m {
        Method::Paper(p, _) => format!("{} : {}", p.bend[0], number(p.twist)),
        Method::Pber(p) => format!("{} : {}", p.bend_twist.x, number(p.bend_twist.z)),
        Method::Pbd(p) => format!("{} : -", p.bending),
        _ => "moduli".into(),
    }
}

fn picture(found: &[(Case, Answer)], gravity: f64, name: &str, title: &str) -> Picture {
    let shown =
        [("paper", "1 x 20"), ("PBER", "1 x 80"), ("PBD", "1 x 20"), ("direct", "4 x Newton"), ("DER", "1 x Newton")]
            .map(|(m, budget)| {
                let fits = |c: &Case| {
                    c.role == Role::Figure
                        && c.gravity == gravity
                        && c.method.name() == m
                        && c.method.budget() == budget
                };
                found.iter().find(|(c, _)| fits(c) && stiffness(&c.method) != "0.05 : 0.25").expect("it was run")
            });
    let panel = |(c, a): &(Case, Answer), above: bool| Panel {
        label: format!("{}{}", c.method.name(), if above { ", from above" } else { "" }),
        tubes: if sane(&a.points, 0.01 * LENGTH) {
            vec![Tube { points: upright(&a.points), radius: 6e-4 }]
        } else {
            Vec::new()
        },
        solids: Vec::new(),
        look: if above { (DVec3::NEG_Z, DVec3::Y) } else { (DVec3::Y, DVec3::Z) },
        frame: Some((DVec3::new(0.5 * LENGTH, 0.0, if above { 0.0 } else { -0.03 }), 0.14)),
    };
    let mut panels: Vec<Panel> = shown.iter().map(|f| panel(f, false)).collect();
    panels.extend(shown.iter().map(|f| panel(f, true)));
    Picture { name: name.into(), title: title.into(), columns: 5, panels }
}

/// Turned about x so that it hangs down: the turn of the whole means nothing where gravity is weak.
fn upright(points: &[DVec3]) -> Vec<DVec3> {
    let middle = points.iter().sum::<DVec3>();
    let turn = DQuat::from_rotation_x(-TAU / 4.0 - libm::atan2(middle.z, middle.y));
    points.iter().map(|p| turn * *p).collect()
}
