//! The force that draws an overhand knot tight.

use crate::reference::material::{Rod, T1};
use crate::results::{Curve, Plot, StudyResult};
use crate::study::{Bar, LeftOut, Level, Quantity, Section, Study, series};
use sutura_scene::Outcome;

const FRICTIONS: [f64; 3] = [0.0, 0.1, 0.3];
/// Where the force is read: square root of radius of the thread over radius of the loop.
const EPSILONS: [f64; 3] = [0.125, 0.15, 0.2];
/// Curvature of the loop in which threads of several diameters are compared \[1/m\].
const CURVATURE: f64 = 115.0;
/// Until a loop without friction drifts off the middle of the thread \[s\].
const DRIFTING: f64 = 7.5;
/// While it settles from the shape in which it was set down \[s\].
const GATHERING: f64 = 2.5;

pub fn section() -> Section {
    let mut section = Section::new(
        10,
        "Force of an overhand knot",
        "An overhand knot of 2-0 monofilament drawn slowly by both ends, h its radius, R the radius of curvature at the middle of its loop, eps = sqrt(h / R): \
         F h^2 / EI against eps^4 / 2 + 0.492 mu eps^3 (Audoly, Clauvelin and Neukirch 2007, a limit for small eps). Without friction the work \
         of the force is the gain of elastic energy. The bar of the force is that of published codes (0.75 to 1.33 of theory).",
    );
    for mu in FRICTIONS {
        section.studies.push(drawn(mu));
    }
    for mu in FRICTIONS {
        section.studies.push(thinner(mu));
    }
    section.plots = plots;
    section.left_out = &[
        LeftOut { what: "knots of more crossings (Jawed et al. 2015)", why: "not set up yet; their law is drawn for one" },
        LeftOut { what: "plectonemes (Clauvelin et al. 2009)", why: "not set up yet" },
        LeftOut { what: "closed tight knots", why: "there are no closed rings" },
    ];
    section
}

fn audoly(mu: f64, eps: f64) -> f64 {
    0.5 * eps.powi(4) + 0.492 * mu * eps.powi(3)
}

/// Law of long knots of one throw, dominated by friction: 2 pi mu (h k)^3 with k = (sqrt 12 h R)^(-1/2).
fn jawed(mu: f64, eps: f64) -> f64 {
    2.0 * std::f64::consts::PI * mu * (eps / 12.0_f64.powf(0.25)).powi(3)
}

/// (eps, F h^2 / EI) while it is drawn.
fn curve(o: &Outcome) -> Vec<(f64, f64)> {
    let h = 0.5 * T1.diameter;
    let pairs = series(o, "curvature").into_iter().zip(series(o, "force"));
    pairs.filter(|((t, _), _)| *t > GATHERING).map(|((_, k), (_, f))| ((h * k).sqrt(), f * h * h / T1.ei())).collect()
}

/// Force where the loop first has this size.
fn force_at(o: &Outcome, eps: f64) -> f64 {
    let found = curve(o).windows(2).find(|w| w[0].0 < eps && w[1].0 >= eps).map(|w| w[0].1 + (eps - w[0].0) / (w[1].0 - w[0].0) * (w[1].1 - w[0].1));
    found.unwrap_or(f64::NAN)
}

fn drawn(mu: f64) -> Study {
    let reason = "theory is a limit for small eps, approached slowly: see the thinner threads below";
    let mut study = Study::new(format!("mu = {mu}"), "knot_force").set("friction.default", mu).elements("rod", &[200, 400]).curve(move |o| {
        let drifting = if mu > 0.0 { f64::INFINITY } else { DRIFTING };
        let times = series(o, "curvature").into_iter().map(|p| p.0).filter(|t| *t > GATHERING);
        curve(o).into_iter().zip(times).filter(|(_, t)| *t < drifting).map(|(p, _)| p).collect()
    });
    // Without friction nothing keeps the loop in the middle of the thread: a tight one drifts off.
    for eps in EPSILONS.into_iter().filter(|eps| mu > 0.0 || *eps < 0.2) {
        let quantity =
            Quantity::measured(format!("F h^2 / EI at eps = {eps}"), move |o| force_at(o, eps), vec![audoly(mu, eps)], "Audoly et al.", Bar::Within(0.33));
        study = study.quantity(if mu > 0.0 { quantity.because(reason) } else { quantity });
    }
    if mu > 0.0 {
        return study;
    }
    study.quantity(Quantity::measured("work of the force over gain of energy", work_over_energy, vec![1.0], "conserved", Bar::Within(0.05)))
}

/// Thinner and thinner threads in a loop of one size: theory is their limit, with an error of the first order in eps.
fn thinner(mu: f64) -> Study {
    let level = |(diameter, elements): (f64, u32)| {
        let eps = (0.5e-3 * diameter * CURVATURE).sqrt();
        let settings = [("thread.rod.diameter", format!("\"{diameter} mm\"")), ("thread.rod.elements", elements.to_string())];
        Level::new(format!("eps {eps:.3}"), eps, &settings)
    };
    let levels = [(0.24, 400), (0.12, 600), (0.06, 800)].map(level);
    let ratio = move |o: &Outcome| {
        let h = o.report.threads[0].radius_m;
        let rod = Rod { diameter: 2.0 * h, ..T1 };
        let pairs: Vec<(f64, f64)> =
            series(o, "curvature").into_iter().zip(series(o, "force")).filter(|((t, _), _)| *t > 1.0).map(|((_, k), (_, f))| (k, f)).collect();
        let found = pairs.windows(2).find(|w| w[0].0 < CURVATURE && w[1].0 >= CURVATURE);
        let force = found.map_or(f64::NAN, |w| w[0].1 + (CURVATURE - w[0].0) / (w[1].0 - w[0].0) * (w[1].1 - w[0].1));
        force * h * h / rod.ei() / audoly(mu, (h * CURVATURE).sqrt())
    };
    let quantity = Quantity::measured("force over that of the limit", ratio, vec![1.0], "Audoly et al.", Bar::Within(0.33))
        .because("theory is a limit for small eps, approached slowly");
    Study::new(format!("thinner, mu = {mu}"), "knot_force")
        .set("friction.default", mu)
        .set("phase.draw.max_duration", "\"4.2 s\"")
        .levels(levels.into())
        .quantity(quantity)
}

fn work_over_energy(o: &Outcome) -> f64 {
    let late = |name: &str| series(o, name).into_iter().filter(|p| p.0 > GATHERING && p.0 < DRIFTING).map(|p| p.1).collect::<Vec<f64>>();
    let (force, distance, energy) = (late("force"), late("distance"), late("energy"));
    let work: f64 = (1..force.len().min(distance.len())).map(|i| 0.5 * (force[i] + force[i - 1]) * (distance[i] - distance[i - 1])).sum();
    match (energy.first(), energy.last()) {
        (Some(a), Some(b)) => work / (b - a),
        _ => f64::NAN,
    }
}

fn plots(studies: &[StudyResult]) -> Vec<Plot> {
    let range = || (0..=40).map(|i| 0.1 + 0.0035 * f64::from(i));
    let mut curves = Vec::new();
    for mu in FRICTIONS {
        curves.push(Curve { name: format!("Audoly, mu = {mu}"), points: range().map(|e| (e, audoly(mu, e))).collect(), dots: false });
        if let Some(s) = studies.iter().find(|s| s.name == format!("mu = {mu}")) {
            let points = s.curve.iter().step_by(12).copied().filter(|p| (0.1..=0.24).contains(&p.0)).collect();
            curves.push(Curve { name: format!("mu = {mu}, ours"), points, dots: true });
        }
    }
    curves.push(Curve { name: "Jawed, mu = 0.3".into(), points: range().map(|e| (e, jawed(0.3, e))).collect(), dots: false });
    vec![Plot { file: "knot_force", title: "Force that draws an overhand knot".into(), x: ("√(h / R)", ""), y: ("F h² / EI", ""), curves }]
}
