//! Row E-13, figures 13 to 15: elongation and time over iterations, with and without the direct distance constraint.

use crate::helix::{Fall, direct, fall, paper};
use crate::measure::{fit, number, percent, sane};
use crate::method::Method;
use crate::outcome::{Axis, Check, Compare, Outcome, Panel, Picture, Plot, Table, Tube};
use crate::plan::{Experiment, Plan};
use sutura::glam::DVec3;

pub const EXPERIMENT: Experiment = Experiment {
    name: "fig13",
    title: "Inextensible: elongation and time over iterations, with and without the direct distance constraint",
    figures: "13, 14, 15",
    plan,
};

const N: usize = 120;
const BUDGETS: [u32; 4] = [5, 10, 20, 40];
/// The effective scale and the true one \[m\].
const SIZES: [f64; 2] = [15.0, 0.15];
/// Substeps a frame and Newton iterations allowed: the default, and less of both.
const OURS: [(u32, u32); 8] = [(1, 12), (2, 12), (4, 12), (8, 12), (4, 1), (4, 2), (4, 4), (4, 8)];

fn plan() -> Plan {
    let mut cases: Vec<(Method, f64)> = Vec::new();
    for size in SIZES {
        for ddc in [false, true] {
            cases.extend(BUDGETS.map(|its| (paper(its, ddc, 1), size)));
        }
    }
    cases.extend(OURS.map(|(substeps, newton)| (direct(substeps, newton), 0.15)));
    Plan::new(
        cases,
        |(m, size)| format!("{}, {}, {size} m", m.name(), m.budget()),
        |(m, size)| fall(m, *size, N),
        finish,
    )
}

fn finish(found: &[((Method, f64), Fall)]) -> Outcome {
    let mut out = Outcome::default();
    let paper_of = |size: f64, ddc: bool| -> Vec<&Fall> {
        let fits = |m: &Method| matches!(m, Method::Paper(p, _) if p.direct_distance == ddc);
        found.iter().filter(|((m, s), _)| *s == size && fits(m)).map(|(_, f)| f).collect()
    };
    let ours: Vec<(&Method, &Fall)> =
        found.iter().filter(|((m, _), _)| matches!(m, Method::Direct(_))).map(|((m, _), f)| (m, f)).collect();

    let headings =
        ["length [m]", "method", "steps x iterations", "DDC", "greatest elongation", "mean of the last second"];
    let mut table = Table::new(
        "elongation",
        "Elongation of the thread as a whole in 5 s of falling and swinging, 120 elements",
        &headings,
    );
    let mut times = Table::new(
        "times",
        "CPU time of a frame",
        &["length [m]", "method", "steps x iterations", "DDC", "ms a frame (median)"],
    )
    .measured();
    for ((m, size), f) in found {
        let (ddc, budget) = match m {
            Method::Paper(p, _) => (if p.direct_distance { "yes" } else { "no" }, m.budget()),
            Method::Direct(d) => ("-", format!("{} x at most {}", d.substeps, d.newton_max)),
            _ => ("", String::new()),
        };
        table.row([
            (*size).into(),
            m.name().into(),
            budget.clone().into(),
            ddc.into(),
            percent(f.worst).into(),
            percent(f.last).into(),
        ]);
        times.row([(*size).into(), m.name().into(), budget.into(), ddc.into(), f.ms.into()]);
    }
    let mut exact = Table::new(
        "elongation_numbers",
        "Elongation",
        &["length [m]", "method", "substeps", "iterations", "DDC", "greatest", "last second"],
    )
    .hidden();
    for ((m, size), f) in found {
        let (substeps, iterations, ddc) = match m {
            Method::Paper(p, n) => (*n, p.iterations, if p.direct_distance { "yes" } else { "no" }),
            Method::Direct(d) => (d.substeps, d.newton_max, "-"),
            _ => (0, 0, ""),
        };
        exact.row([
            (*size).into(),
            m.name().into(),
            substeps.into(),
            iterations.into(),
            ddc.into(),
            f.worst.into(),
            f.last.into(),
        ]);
    }

    let list =
        |falls: &[&Fall], of: fn(&Fall) -> f64| falls.iter().map(|f| percent(of(f))).collect::<Vec<_>>().join(", ");
    let (with, without) = (paper_of(15.0, true), paper_of(15.0, false));
    let worst_ours = ours.iter().map(|(_, f)| f.worst).fold(0.0, f64::max);
    out.checks.push(Check::new(
        "with DDC, effective scale: elongation at 5, 10, 20, 40 iterations",
        "each <= 3.2 %",
        list(&with, |f| f.worst),
        with.iter().all(|f| f.worst <= 0.032),
    ));
    let falls = without.windows(2).all(|p| p[1].worst < p[0].worst)
        && (0.1..1.0).contains(&without[0].worst)
        && without[3].worst < 0.1;
    out.checks.push(Check::new(
        "without DDC, effective scale: from tens of percent at 5 to a few at 40",
        "10 to 100 % at 5, falling, under 10 % at 40",
        list(&without, |f| f.worst),
        falls,
    ));
    for (falls, name) in [(&with, "with"), (&without, "without")] {
        let line: Vec<(f64, f64)> = BUDGETS.iter().zip(falls).map(|(its, f)| (f64::from(*its), f.ms)).collect();
        let r2 = fit(&line).2;
        out.checks.push(
            Check::new(
                format!("{name} DDC: time linear in iterations"),
                "R^2 > 0.99",
                format!("R^2 = {r2:.4}"),
                r2 > 0.99,
            )
            .measured(),
        );
    }
    out.checks.push(Check::new(
        "direct, true scale: elongation at every budget",
        "<= 0.001 %",
        format!("at most {}", percent(worst_ours)),
        worst_ours <= 1e-5,
    ));
    let said: usize = ours.iter().map(|(_, f)| f.incidents).sum();
    out.checks.push(Check::new("direct, true scale: no step without an answer", "0", said.to_string(), said == 0));

    let own = ours
        .iter()
        .find(|(m, _)| matches!(m, Method::Direct(d) if (d.substeps, d.newton_max) == (4, 12)))
        .expect("it was run")
        .1;
    let rows: [(&str, &str, bool); 2] = [
        ("13, 14: elongation with DDC at 5, 10, 20, 40 iterations", "under 3.2 % each", true),
        ("13, 14: elongation without", "38.9 % at 5, 4.2 % at 40", false),
    ];
    for (what, published, ddc) in rows {
        out.compare.push(Compare {
            what: what.into(),
            published: published.into(),
            effective: list(&paper_of(15.0, ddc), |f| f.worst),
            true_scale: list(&paper_of(0.15, ddc), |f| f.worst),
            direct: percent(own.worst),
        });
    }
    let ms = |falls: &[&Fall]| falls.iter().map(|f| number(f.ms)).collect::<Vec<_>>().join(", ");
    out.compare.push(Compare {
        what: "15: ms a frame with DDC at 5, 10, 20, 40 iterations".into(),
        published: "linear in iterations (plot)".into(),
        effective: ms(&with),
        true_scale: ms(&paper_of(0.15, true)),
        direct: number(own.ms),
    });

    let points = |falls: &[&Fall], of: fn(&Fall) -> f64| {
        BUDGETS.iter().zip(falls).map(|(its, f)| (f64::from(*its), of(f))).collect::<Vec<_>>()
    };
    let mut lengths = Plot::new(
        "elongation",
        "Figure 14: elongation over iterations",
        Axis::new("iterations", ""),
        Axis::log("greatest elongation", "%"),
    );
    let mut time = Plot::new(
        "time",
        "Figure 15: time over iterations, 15 m",
        Axis::new("iterations", ""),
        Axis::new("CPU time of a frame", "ms"),
    );
    time.measured = true;
    for (size, ddc, name) in [
        (15.0, false, "without DDC, 15 m"),
        (15.0, true, "with DDC, 15 m"),
        (0.15, false, "without DDC, 15 cm"),
        (0.15, true, "with DDC, 15 cm"),
    ] {
        lengths.line(name, points(&paper_of(size, ddc), |f| 100.0 * f.worst));
        if size > 1.0 {
            time.line(name, points(&paper_of(size, ddc), |f| f.ms));
        }
    }
    lengths.line("published, without DDC", vec![(5.0, 38.9), (40.0, 4.2)]);
    lengths.marks.push(("published bound with DDC: 3.2 %".into(), 3.2));
    let own_line: Vec<(f64, f64)> = vec![(5.0, 100.0 * own.worst), (40.0, 100.0 * own.worst)];
    lengths.line("direct, 15 cm", own_line);
    time.marks.push(("direct, 15 cm, 4 substeps".into(), own.ms));

    out.say(
        "120 elements, at rest in a spiral (radius a thirtieth of the length, pitch a fifteenth), one end pinned, dropped; elongation of the thread as a whole, 5 s at 60 frames a second, one step a frame. Damping \
         takes a fifth of the velocities in a second. Neither shape nor damping nor inertia of the frames is named by the paper; without DDC the elongation depends on that inertia (theory 17).",
    );
    out.say(format!(
        "At true scale gravity moves a point by 2.7 mm in a step, two elements: there the published method diverges at every budget, with DDC ({}) and without ({}). `direct` keeps the length at every budget tried, \
         from one substep a frame and from one Newton iteration on; what a small budget costs is not length, but how well it moves.",
        list(&paper_of(0.15, true), |f| f.worst),
        list(&paper_of(0.15, false), |f| f.worst)
    ));

    let view = |f: &Fall, label: String, size: f64| Panel {
        label,
        tubes: if sane(&f.points, 2e-3 * size) {
            vec![Tube { points: f.points.clone(), radius: size / 240.0 }]
        } else {
            Vec::new()
        },
        solids: Vec::new(),
        look: (DVec3::Y, DVec3::Z),
        frame: Some((DVec3::new(0.15 * size, 0.0, -0.45 * size), 1.5 * size)),
    };
    for (size, name, title) in [
        (15.0, "effective", "Figure 13 at the effective scale after 5 s: without DDC above, with DDC below"),
        (0.15, "true", "The same at true scale"),
    ] {
        let panels = [false, true].into_iter().flat_map(|ddc| {
            let falls = paper_of(size, ddc);
            BUDGETS
                .iter()
                .zip(falls)
                .map(move |(its, f)| view(f, format!("{its} iterations, {}", if ddc { "DDC" } else { "no DDC" }), size))
                .collect::<Vec<_>>()
        });
        out.pictures.push(Picture { name: name.into(), title: title.into(), columns: 4, panels: panels.collect() });
    }
    let own_panels = ours
        .iter()
        .filter(|(m, _)| matches!(m, Method::Direct(d) if d.newton_max == 12))
        .map(|(m, f)| view(f, format!("direct, {}", m.budget()), 0.15))
        .collect();
    out.pictures.push(Picture {
        name: "direct".into(),
        title: "Sutura's own solver at true scale after 5 s, 1, 2, 4 and 8 substeps a frame".into(),
        columns: 4,
        panels: own_panels,
    });
    out.plots.extend([lengths, time]);
    out.tables.extend([table, times, exact]);
    out
}
