//! Forces of knots: overhand knots drawn and let out, long knots, plectonemes, reef and granny.

use super::vector;
use crate::reference::knots;
use crate::reference::material::{Rod, T1};
use crate::results::{Curve, Plot, StudyResult};
use crate::study::{Bar, LeftOut, Level, Quantity, Section, Study, columns, series};
use sutura::glam::DVec3;
use sutura_scene::Outcome;

const FRICTIONS: [f64; 3] = [0.0, 0.1, 0.3];
/// Where the force is read: square root of radius of the thread over radius of curvature of the loop.
const EPSILONS: [f64; 4] = [0.15, 0.2, 0.25, 0.3];
/// F h^2 / EI there by `scripts/knot_reference.py`, without friction and with mu = 0.3.
const APART: [(f64, [f64; 4]); 2] =
    [(0.0, [2.0406e-4, 6.1466e-4, 1.4446e-3, 2.8907e-3]), (0.3, [9.5719e-4, 2.5105e-3, 5.4197e-3, 1.0402e-2])];
/// Curvature of the loop in which threads of several diameters are compared \[1/m\].
const CURVATURE: f64 = 150.0;
/// While a knot settles from the shape in which it was set down \[s\].
const GATHERING: f64 = 1.5;
/// Friction of long knots, that of the experiments of Jawed et al.
const LONG_FRICTION: f64 = 0.119;
/// Turns of the end of the rod that winds about itself at which it rests.
const TURNS: [u32; 3] = [8, 11, 14];
/// Bending stiffness of that rod over a solid one's.
const BEND_SCALE: f64 = 0.05;

pub fn section() -> Section {
    let mut section = Section::new(
        10,
        "Forces of knots and plectonemes",
        "Knots of 2-0 monofilament drawn slowly by both ends, h the radius of the thread, R the least radius of curvature, with which the loop leaves the braid \
         (at the middle of the loop the thread is straighter), eps = sqrt(h / R). Overhand knots: F h^2 / EI against eps^4 / 2 + 0.492 mu eps^3 (- while it is \
         let out; Audoly, Clauvelin and Neukirch 2007), a limit for small eps whose error is of the order of eps: it is approached in thinner and thinner \
         thread, and away from it the same numbers come from scripts/knot_reference.py, which has another rod, contact and friction. Long knots of n turns \
         against Jawed, Dieleman, Audoly and Reis (2015), a limit for many turns, for the length e that they take up. Plectonemes against equation 9 of \
         Clauvelin, Audoly and Neukirch (2009), where a rod rests after several turns of its end. Reef and granny, with the same \
         friction (0.3), are tied with 0.5 N and drawn by their standing ends: the reef holds that, the granny does not.",
    );
    section.studies.extend(FRICTIONS.map(overhand));
    section.studies.extend(FRICTIONS.map(thinner));
    section.studies.extend((1..=4).map(long));
    section.studies.push(plectoneme());
    section.studies.push(bend("reef", 1.0, Bar::AtLeast(0.5)));
    section.studies.push(bend("granny", -1.0, Bar::AtMost(0.5)));
    section.plots = plots;
    section.left_out = &[LeftOut { what: "closed tight knots", why: "set up in no scene yet" }];
    section
}

/// When the phase began and ended \[s\].
fn phase(o: &Outcome, name: &str) -> (f64, f64) {
    o.report.phases.iter().find(|p| p.name == name).map_or((f64::NAN, f64::NAN), |p| (p.start_s, p.end_s))
}

/// (eps, F h^2 / EI) during a phase.
fn forces(o: &Outcome, during: &str) -> Vec<(f64, f64)> {
    let h = o.report.threads.first().map_or(f64::NAN, |t| t.radius_m);
    let ei = Rod { diameter: 2.0 * h, ..T1 }.ei();
    let (from, to) = phase(o, during);
    let rows = series(o, "curvature").into_iter().zip(series(o, "force"));
    rows.filter(|((t, _), _)| *t >= from.max(GATHERING) && *t <= to)
        .map(|((_, k), (_, f))| ((h * k).sqrt(), f * h * h / ei))
        .collect()
}

/// What of it counts while a knot is drawn: with friction a loose one stays as it is until the tails are straight, and
/// carries less than it would without friction; half of that leaves room for what theory leaves out.
fn drawing(o: &Outcome) -> Vec<(f64, f64)> {
    forces(o, "draw").into_iter().filter(|(eps, f)| *f > 0.5 * knots::overhand(*eps, 0.0, 1.0)).collect()
}

/// Force at one eps: the corners of polylines that slide over each other make it uneven, so by a straight line through
/// the logarithms within a tenth of eps.
fn force_at(points: &[(f64, f64)], eps: f64) -> f64 {
    let near = points.iter().filter(|p| (p.0 / eps).ln().abs() < 0.1 && p.1 > 0.0);
    let mut m = [0.0; 5];
    for (e, f) in near {
        let (x, y) = ((e / eps).ln(), f.ln());
        for (m, v) in m.iter_mut().zip([1.0, x, y, x * x, x * y]) {
            *m += v;
        }
    }
    let [n, x, y, xx, xy] = m;
    ((y * xx - x * xy) / (n * xx - x * x)).exp()
}

fn overhand(mu: f64) -> Study {
    let drawn = "theory is a limit: at this eps an independent routine differs from it as much";
    let out = if mu > 0.0 {
        "theory is a limit, and here the difference of two terms, one off by a fifth up, the other down"
    } else {
        drawn
    };
    let mut study = Study::new(format!("overhand knot, mu = {mu}"), "knot_force")
        .set("friction.default", mu)
        .elements("rod", &[450])
        .curve(drawing);
    // With much friction the tails are straight only once the loop is smaller than that.
    for (i, eps) in EPSILONS.into_iter().enumerate().filter(|(_, eps)| mu < 0.2 || *eps > 0.15) {
        let measure = move |o: &Outcome| force_at(&drawing(o), eps);
        let limit = knots::overhand(eps, mu, 1.0);
        study = study.quantity(
            Quantity::measured(
                format!("F h^2 / EI at eps = {eps}"),
                measure,
                vec![limit],
                "Audoly et al.",
                Bar::Within(0.15),
            )
            .because(drawn),
        );
        if let Some((_, apart)) = APART.iter().find(|(m, _)| *m == mu) {
            study = study.quantity(Quantity::measured(
                format!("the same at eps = {eps}"),
                measure,
                vec![apart[i]],
                "computed apart",
                Bar::Within(0.1),
            ));
        }
    }
    if mu > 0.2 {
        let locked = |o: &Outcome| forces(o, "let_out").last().map_or(f64::NAN, |p| p.0);
        return study.quantity(Quantity::measured(
            "eps at which it stays when let go",
            locked,
            vec![2.0 * knots::SIGMA * mu],
            "Audoly et al.",
            Bar::Within(0.15),
        ));
    }
    for eps in [0.25, 0.2, 0.15] {
        let measure = move |o: &Outcome| force_at(&forces(o, "let_out"), eps);
        let limit = knots::overhand(eps, mu, -1.0);
        study = study.quantity(
            Quantity::measured(
                format!("let out, F h^2 / EI at eps = {eps}"),
                measure,
                vec![limit],
                "Audoly et al.",
                Bar::Within(0.15),
            )
            .because(out),
        );
    }
    if mu > 0.0 {
        return study;
    }
    study.quantity(Quantity::measured(
        "work of the force over gain of energy",
        work_over_energy,
        vec![1.0],
        "conserved",
        Bar::Within(0.05),
    ))
}

/// Work against energy while it is drawn.
fn work_over_energy(o: &Outcome) -> f64 {
    let (_, end) = phase(o, "draw");
    let during = |name: &str| {
        series(o, name).into_iter().filter(|p| p.0 > GATHERING && p.0 < end).map(|p| p.1).collect::<Vec<f64>>()
    };
    let (force, distance, energy) = (during("force"), during("distance"), during("energy"));
    let work: f64 = (1..force.len().min(distance.len()))
        .map(|i| 0.5 * (force[i] + force[i - 1]) * (distance[i] - distance[i - 1]))
        .sum();
    match (energy.first(), energy.last()) {
        (Some(a), Some(b)) => work / (b - a),
        _ => f64::NAN,
    }
}

/// Thinner and thinner threads in a loop of one size: theory is their limit, with an error of the first order in eps.
fn thinner(mu: f64) -> Study {
    let eps = |diameter: f64| (0.5e-3 * diameter * CURVATURE).sqrt();
    let level = |(diameter, elements): (f64, u32)| {
        let settings =
            [("thread.rod.diameter", format!("\"{diameter} mm\"")), ("thread.rod.elements", elements.to_string())];
        Level::new(format!("eps {:.3}", eps(diameter)), eps(diameter), &settings)
    };
    let levels = [(0.24, 400), (0.12, 600), (0.06, 800)].map(level);
    let ratio = move |o: &Outcome| {
        let eps = (o.report.threads.first().map_or(f64::NAN, |t| t.radius_m) * CURVATURE).sqrt();
        force_at(&drawing(o), eps) / knots::overhand(eps, mu, 1.0)
    };
    let quantity =
        Quantity::measured("force over that of the limit", ratio, vec![1.0], "Audoly et al.", Bar::Within(0.15))
            .because("theory is a limit for small eps; with friction it is approached more slowly");
    Study::new(format!("thinner, mu = {mu}"), "knot_force")
        .set("friction.default", mu)
        .set("phase.draw.max_duration", "\"5.5 s\"")
        .set("phase.let_out.max_duration", "\"20 ms\"")
        .levels(levels.into())
        .quantity(quantity)
}

/// Length that the knot takes up, and force, in the variables of the master curve, while it is drawn.
fn master(o: &Outcome, turns: u32) -> Vec<(f64, f64)> {
    let (h, n2) = (0.5 * T1.diameter, f64::from(turns * turns));
    let (from, to) = phase(o, "draw");
    let rows = series(o, "shortening").into_iter().zip(series(o, "force"));
    // The ends have begun to move and the tails are straight.
    rows.filter(|((t, _), _)| *t >= from + 1.0 && *t <= to)
        .map(|((_, e), (_, f))| (n2 * h / e, n2 * f * h * h / T1.ei()))
        .collect()
}

fn long(turns: u32) -> Study {
    let h = 0.5e3 * T1.diameter;
    let points = knots::loose(turns, 0.1, 200.0, 3.0);
    let list: Vec<String> =
        points.iter().map(|p| format!("\"[{:.5}, {:.5}, {:.5}] mm\"", h * p[0], h * p[1], h * p[2])).collect();
    // Each end moves by a fifth of what the knot takes up at first.
    let speed = 1e-3 * [5.0, 6.5, 8.0, 10.0][turns as usize - 1];
    let ratio = move |o: &Outcome| {
        let (found, wanted) = master(o, turns)
            .into_iter()
            .fold((0.0, 0.0), |sum, (e, f)| (sum.0 + f, sum.1 + knots::long_knot(e, LONG_FRICTION)));
        found / wanted
    };
    let seconds = 5.0;
    Study::new(format!("long knot, {turns} turns"), "long_knot")
        .set("friction.default", LONG_FRICTION)
        .set("thread.rod.points", format!("[{}]", list.join(", ")))
        .set("phase.draw.action[0].keys[0].by", vector([-speed * seconds, 0.0, 0.0]))
        .set("phase.draw.action[1].keys[0].by", vector([speed * seconds, 0.0, 0.0]))
        .quantity(
            Quantity::measured("force over that of the master curve", ratio, vec![1.0], "Jawed et al.", Bar::Within(0.15))
                .because("the master curve is a limit for many turns; the friction constant of one turn is half of what it has, of two turns three quarters"),
        )
        .curve(move |o| master(o, turns))
}

/// Radius of the helices over h, and their angle \[rad\], in the middle of the ply. Tangents are by differences of
/// fourth order, the nearest place of the other strand by parabolas: a strand turns by a third of a radian from one
/// element to the next.
fn ply(o: &Outcome, turns: u32) -> (f64, f64) {
    let points: Vec<DVec3> =
        columns(o, &format!("shape_{turns}"), ["x", "y", "z"]).into_iter().map(DVec3::from_array).collect();
    let h = 0.5 * T1.diameter;
    let tangent = |i: usize| (8.0 * (points[i + 1] - points[i - 1]) - (points[i + 2] - points[i - 2])).normalize();
    // The other strand is more than a dozen radii on along the thread.
    let skip = 12;
    let end = points.len().saturating_sub(3);
    let mut found = Vec::new();
    for i in 2..end {
        let far = |j: usize| points[i].distance_squared(points[j]);
        let Some(j) = (i + skip..end).min_by(|a, b| far(*a).total_cmp(&far(*b))) else { continue };
        let (a, b, c) = (far(j - 1), far(j), far(j + 1));
        let t = (0.5 * (a - c) / (a - 2.0 * b + c)).clamp(-1.0, 1.0);
        let between = |at: &dyn Fn(usize) -> DVec3| {
            at(j - 1) * (0.5 * t * (t - 1.0)) + at(j) * (1.0 - t * t) + at(j + 1) * (0.5 * t * (t + 1.0))
        };
        let apart = points[i].distance(between(&|k| points[k]));
        if apart < 2.2 * h {
            found.push((0.5 * apart / h, 0.5 * (-tangent(i).dot(between(&tangent))).acos()));
        }
    }
    let middle = &found[found.len() / 4..(3 * found.len()).div_ceil(4)];
    let n = middle.len() as f64;
    (middle.iter().map(|m| m.0).sum::<f64>() / n, middle.iter().map(|m| m.1).sum::<f64>() / n)
}

/// Mean of a probe over the last second of the rest.
fn at_rest(o: &Outcome, probe: &str, turns: u32) -> f64 {
    let (_, end) = phase(o, &format!("rest at {turns}"));
    let values: Vec<f64> =
        series(o, probe).into_iter().filter(|p| p.0 > end - 1.0 && p.0 <= end).map(|p| p.1).collect();
    values.iter().sum::<f64>() / values.len() as f64
}

fn plectoneme() -> Study {
    let (h, ei) = (0.5 * T1.diameter, BEND_SCALE * T1.ei());
    let theory = "Clauvelin et al.";
    let mut study = Study::new("plectoneme", "plectoneme");
    for turns in TURNS {
        let radius = move |o: &Outcome| ply(o, turns).0;
        let force = move |o: &Outcome| {
            let (radius, angle) = ply(o, turns);
            at_rest(o, "tension", turns) * (radius * h).powi(2) / ei / knots::ply_force(angle)
        };
        let moment = move |o: &Outcome| {
            let (radius, angle) = ply(o, turns);
            at_rest(o, "torque", turns) * radius * h / ei / knots::ply_moment(angle)
        };
        // Twist counts from the middle of the first element to that of the last one.
        let link = move |o: &Outcome| {
            let n = o.report.threads.first().map_or(f64::NAN, |t| t.elements as f64);
            at_rest(o, "twist", turns) * n / (n - 1.0) + at_rest(o, "writhe", turns) - f64::from(turns)
        };
        study = study
            .quantity(Quantity::measured(
                format!("radius of the ply / h, {turns} turns"),
                radius,
                vec![1.0],
                "it touches",
                Bar::Within(0.03),
            ))
            .quantity(Quantity::measured(
                format!("tension over that of its angle, {turns} turns"),
                force,
                vec![1.0],
                theory,
                Bar::Within(0.03),
            ))
            .quantity(Quantity::measured(
                format!("torque over that of its angle, {turns} turns"),
                moment,
                vec![1.0],
                theory,
                Bar::Within(0.03),
            ))
            .quantity(Quantity::measured(
                format!("turns lost of twist + writhe, {turns} turns"),
                move |o| link(o).abs(),
                Vec::new(),
                "conserved",
                Bar::AtMost(0.01),
            ));
    }
    study.curve(move |o| {
        TURNS
            .iter()
            .map(|n| (ply(o, *n).1.to_degrees(), at_rest(o, "tension", *n) * (ply(o, *n).0 * h).powi(2) / ei))
            .collect()
    })
}

/// A bend of two threads with the same friction, tied with half a newton on all ends and then drawn by its standing
/// ones.
fn bend(name: &'static str, side: f64, bar: Bar) -> Study {
    let line = |mirror: f64| {
        let points: Vec<String> = knots::bend(side)
            .iter()
            .map(|p| format!("\"[{:.4}, {:.4}, {:.4}] mm\"", mirror * p[0], p[1], mirror * p[2]))
            .collect();
        format!("[{}]", points.join(", "))
    };
    let slides = |o: &Outcome| {
        let (start, end) = phase(o, "pull");
        // From when the tails run through.
        let forces: Vec<f64> =
            series(o, "force").into_iter().filter(|p| p.0 > start + 0.3 && p.0 < end).map(|p| p.1).collect();
        forces.iter().sum::<f64>() / forces.len() as f64
    };
    let quantity = Quantity::measured("mean force with which it slides [N]", slides, Vec::new(), "0.5 N tied it", bar);
    Study::new(name, "bend").set("thread.one.points", line(1.0)).set("thread.two.points", line(-1.0)).quantity(quantity)
}

fn plots(studies: &[StudyResult]) -> Vec<Plot> {
    let find = |name: &str| studies.iter().find(|s| s.name == name);
    let range = |from: f64, to: f64| (0..=60).map(move |i| from + (to - from) * f64::from(i) / 60.0);
    let thin = |points: &[(f64, f64)], every: usize| points.iter().step_by(every).copied().collect::<Vec<_>>();
    let mut force = Vec::new();
    let mut long = Vec::new();
    for mu in FRICTIONS {
        let points = range(0.12, 0.31).map(|e| (e, knots::overhand(e, mu, 1.0))).collect();
        force.push(Curve { name: format!("Audoly, mu = {mu}"), points, dots: false });
        if let Some(s) = find(&format!("overhand knot, mu = {mu}")) {
            force.push(Curve { name: format!("mu = {mu}, ours"), points: thin(&s.curve, 12), dots: true });
        }
    }
    let points = range(1e-3, 0.02).map(|e| (e, knots::long_knot(e, LONG_FRICTION))).collect();
    long.push(Curve { name: "Jawed".into(), points, dots: false });
    for turns in 1..=4 {
        if let Some(s) = find(&format!("long knot, {turns} turns")) {
            long.push(Curve { name: format!("{turns} turns, ours"), points: thin(&s.curve, 20), dots: true });
        }
    }
    let mut ply = vec![Curve {
        name: "Clauvelin".into(),
        points: range(8.0, 20.0).map(|a| (a, knots::ply_force(a.to_radians()))).collect(),
        dots: false,
    }];
    if let Some(s) = find("plectoneme") {
        ply.push(Curve { name: "ours".into(), points: s.curve.clone(), dots: true });
    }
    vec![
        Plot {
            file: "knot_force",
            title: "Force that draws an overhand knot".into(),
            x: ("√(h / R)", ""),
            y: ("F h² / EI", ""),
            curves: force,
        },
        Plot {
            file: "long_knots",
            title: "Long knots, mu = 0.119".into(),
            x: ("n² h / e", ""),
            y: ("n² F h² / EI", ""),
            curves: long,
        },
        Plot {
            file: "plectoneme",
            title: "Tension of a plectoneme".into(),
            x: ("angle of the ply", "degrees"),
            y: ("F R² / EI", ""),
            curves: ply,
        },
    ]
}
