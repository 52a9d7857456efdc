//! The sweep of the overhand knot: drawn tight by both ends, then let go at once from full tension.

use crate::case::{Budget, assignments};
use crate::curve::{self, knot_free, knot_held};
use crate::run::{ENDED, NOT_FINISHED, Study};
use crate::session::{Session, quantile};
use crate::table::{Table, markdown};
use anyhow::Context as _;
use std::path::Path;
use sutura::glam::DVec3;
use sutura::math::rotation_arc;
use sutura::{Friction, GripSpec, Hold, Material, Place, Pose, RodSpec, Settings, World};

/// The study.
pub struct Overhand;

/// A case. What is not a factor of the sweep has a default.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// Radius of the thread \[m\].
    pub radius: f64,
    /// Young's modulus \[Pa\].
    pub young_modulus: f64,
    /// Speed of each end \[m/s\].
    pub speed: f64,
    /// Coefficient of friction.
    pub mu: f64,
    /// Element length in diameters.
    pub element: f64,
    /// Longest substep \[s\].
    pub substep: f64,
    /// Kelvin-Voigt relaxation time of bending and twist \[s\].
    pub bend_damping: f64,
    /// Simulated time after the ends are let go \[s\].
    pub released: f64,
    /// Tension at which the draw ends, over EA.
    pub full: f64,
}

impl Default for Case {
    fn default() -> Self {
        Case {
            radius: 0.25e-3,
            young_modulus: 2e9,
            speed: 0.05,
            mu: 0.3,
            element: 2.0,
            substep: 1.0 / 240.0,
            bend_damping: 0.01,
            released: 0.2,
            full: 0.01,
        }
    }
}

/// Length of the thread in radii.
const LENGTH: f64 = 600.0;
/// Length of thread left in the knot at which the draw ends, in radii.
const LEFT: f64 = 50.0;
/// The longest frame \[s\].
const FRAME: f64 = 1.0 / 60.0;

impl Case {
    /// A case from `key=value` pairs, units as in the table; `substep` in substeps a second, `damping` and `released`
    /// in seconds, `full` in percent of EA.
    pub fn parse(text: &str) -> anyhow::Result<Case> {
        let mut case = Case::default();
        for (key, value) in assignments(text)? {
            let x: f64 = value.parse().with_context(|| format!("{key}: `{value}` is no number"))?;
            match key.as_str() {
                "r" => case.radius = x * 1e-3,
                "e" => case.young_modulus = x * 1e9,
                "speed" => case.speed = x,
                "mu" => case.mu = x,
                "l" => case.element = x,
                "substep" => case.substep = 1.0 / x,
                "damping" => case.bend_damping = x,
                "released" => case.released = x,
                "full" => case.full = x * 1e-2,
                _ => {
                    anyhow::bail!("there is no `{key}`; there are r, e, speed, mu, l, substep, damping, released, full")
                }
            }
        }
        Ok(case)
    }

    fn length(&self) -> f64 {
        LENGTH * self.radius
    }

    fn world(&self) -> Result<(World, sutura::Handle<sutura::Rod>), sutura::Error> {
        let elements = (self.length() / (self.element * 2.0 * self.radius)).round() as usize;
        let material = Material { bend_damping: self.bend_damping, ..Material::elastic(self.young_modulus, 1150.0) };
        let settings = Settings {
            gravity: DVec3::ZERO,
            substep: self.substep,
            friction: Friction::coulomb(self.mu),
            linear_damping: 0.9,
            angular_damping: 0.9,
            ..Settings::default()
        };
        let mut world = World::new(settings)?;
        let rod = world.insert_rod(&RodSpec::new(curve::overhand(self.length(), elements), self.radius, material))?;
        Ok((world, rod))
    }
}

/// What a draw has come to.
struct Drawn {
    /// Largest tension \[N\].
    tension: f64,
    /// EA \[N\].
    ea: f64,
    /// Distance of the ends \[m\].
    span: f64,
}

impl Drawn {
    fn of(s: &Session, rod: sutura::Handle<sutura::Rod>) -> Result<Drawn, sutura::Error> {
        let view = s.world.rod(rod)?;
        let x = view.positions();
        Ok(Drawn { tension: view.max_tension(), ea: view.axial_stiffness(0), span: x[0].distance(x[x.len() - 1]) })
    }

    /// Why the draw ends here.
    fn ended(&self, case: &Case, time: f64) -> Option<&'static str> {
        if self.tension >= case.full * self.ea {
            Some("tension")
        } else if self.left(case) <= LEFT * case.radius {
            Some("25 diameters left")
        } else if time > case.length() / case.speed {
            Some("time")
        } else {
            None
        }
    }

    fn left(&self, case: &Case) -> f64 {
        case.length() - self.span
    }

    /// How long the next frame is. The end would otherwise be passed by far: at 1 m/s the ends of the thinnest thread
    /// go the length of the thread in 1/60 s. A quarter of the way left, and at half the tension a quarter of a percent
    /// of the length.
    fn frame(&self, case: &Case) -> f64 {
        let least = 1.5 * case.radius;
        let way = if self.tension > 0.25 * case.full * self.ea {
            least
        } else {
            least.max(0.1 * (self.left(case) - LEFT * case.radius))
        };
        FRAME.min(way / (2.0 * case.speed))
    }
}

/// What was measured, as it goes into the table.
#[derive(Default)]
struct Found {
    ended: String,
    knots: [String; 3],
    drawn: Option<Drawn>,
    /// Simulated time at the end of the draw \[s\], and its frames.
    drawn_s: f64,
    drawn_frames: usize,
}

fn draw_and_let_go(
    case: &Case,
    s: &mut Session,
    rod: sutura::Handle<sutura::Rod>,
    found: &mut Found,
    trace: &mut dyn FnMut(String),
) -> Result<(), String> {
    let text = |e: sutura::Error| e.to_string();
    let knot = |s: &Session, held: bool| {
        let points = s.world.rod(rod).map(|r| r.positions().to_vec()).map_err(text)?;
        Ok::<_, String>(if held { knot_held(&points) } else { knot_free(&points) }.name().to_string())
    };
    found.knots[0] = knot(s, true)?;
    let ends = [Place::Start, Place::End]
        .map(|place| s.world.insert_grip(&GripSpec::at_once(rod, place, Hold::Clamp)).map_err(text));
    let [start, end] = ends;
    let grips = [start?, end?];
    loop {
        let drawn = Drawn::of(s, rod).map_err(text)?;
        let time = s.world.time();
        if s.ms.len().is_multiple_of(10) {
            trace(format!(
                "{time:.4} s: T {:.4} % of EA, {:.1} d left, {} contacts, {} substeps, {} rejected, {} Newton, last frame {:.2} ms",
                100.0 * drawn.tension / drawn.ea,
                drawn.left(case) / (2.0 * case.radius),
                s.world.contacts().count(),
                s.substeps,
                s.rejected,
                s.newton,
                s.ms.last().copied().unwrap_or(0.0)
            ));
        }
        (found.drawn_s, found.drawn_frames) = (time, s.ms.len());
        let (ended, dt) = (drawn.ended(case, time), drawn.frame(case));
        found.drawn = Some(drawn);
        if let Some(ended) = ended {
            found.ended = ended.into();
            break;
        }
        // From where the ends are, so that the grips do not run away from a solver that is stuck. They turn toward the
        // axis.
        let mut poses = [s.world.grip_pose(grips[0]).map_err(text)?, s.world.grip_pose(grips[1]).map_err(text)?];
        let axis = (poses[1].position - poses[0].position).normalize();
        for (pose, sign) in poses.iter_mut().zip([-1.0, 1.0]) {
            let tangent = pose.orientation * DVec3::Z;
            let turned = rotation_arc(tangent, tangent.lerp(axis, 3.0 * dt).normalize()) * pose.orientation;
            *pose = Pose::new(pose.position + axis * (sign * case.speed * dt), turned.normalize());
        }
        for (grip, pose) in grips.into_iter().zip(poses) {
            s.world.set_grip_pose(grip, pose).map_err(text)?;
        }
        s.frame(dt)?;
    }
    found.knots[1] = knot(s, true)?;
    trace(format!("{:.4} s: {}, {}, let go", s.world.time(), found.ended, found.knots[1]));
    for grip in grips {
        s.world.remove_grip(grip).map_err(text)?;
    }
    while s.world.time() < found.drawn_s + case.released {
        s.frame(FRAME)?;
    }
    found.knots[2] = knot(s, false)?;
    Ok(())
}

/// Runs one case; the measures in the order of [`Study::MEASURES`].
fn measure(case: &Case, budget: Budget, trace: &mut dyn FnMut(String)) -> Vec<String> {
    let mut found = Found::default();
    let mut row = vec![String::new(); Overhand::MEASURES.len()];
    let (world, rod) = match case.world() {
        Ok(made) => made,
        Err(e) => {
            row[0] = format!("{NOT_FINISHED}{e}");
            return row;
        }
    };
    let mut s = Session::new(world, budget);
    if let Err(why) = draw_and_let_go(case, &mut s, rod, &mut found, trace) {
        let stood = match (&found.drawn, found.ended.as_str()) {
            (Some(d), "") => format!(
                "drawing, T {:.3} % of EA, {:.1} d left",
                100.0 * d.tension / d.ea,
                d.left(case) / (2.0 * case.radius)
            ),
            (_, ended) => format!("let go ({ended})"),
        };
        found.ended = format!("{NOT_FINISHED}{why}, at {:.4} s, {stood}", s.world.time());
    }
    let (while_drawn, after) = s.passes(found.drawn_s);
    let d = found.drawn;
    let tightening = &s.ms[..found.drawn_frames];
    let [before, tight, released] = found.knots;
    row = vec![
        found.ended,
        while_drawn.to_string(),
        after.to_string(),
        before,
        tight,
        released,
        s.clearance(),
        format!("{:.2e}", s.strain_error),
        format!("{:.5}", s.strain()),
        d.as_ref().map(|d| format!("{:.3}", 100.0 * d.tension / d.ea)).unwrap_or_default(),
        d.as_ref().map(|d| format!("{:.1}", d.left(case) / (2.0 * case.radius))).unwrap_or_default(),
        format!("{:.4}", found.drawn_s),
        found.drawn_frames.to_string(),
        s.substeps.to_string(),
        s.rejected.to_string(),
        s.newton.to_string(),
        s.incidents.to_string(),
        s.first_incident.clone(),
        format!("{:.3}", quantile(tightening, 0.5)),
        format!("{:.3}", quantile(tightening, 0.99)),
        format!("{:.3}", quantile(tightening, 1.0)),
        format!("{:.2}", 1e3 * found.drawn_s / tightening.iter().sum::<f64>().max(f64::MIN_POSITIVE)),
        format!("{:.2}", s.solver_s()),
        format!("{:016x}", s.world.state_hash()),
    ];
    trace(Overhand::MEASURES.iter().zip(&row).map(|(m, v)| format!("{m} {v}")).collect::<Vec<_>>().join("; "));
    row
}

impl Study for Overhand {
    type Case = Case;
    const NAME: &'static str = "overhand";
    const FACTORS: &'static [&'static str] = &["r", "e", "speed", "mu", "l"];
    const MEASURES: &'static [&'static str] = &[
        ENDED,
        "passes_drawn",
        "passes_released",
        "knot_before",
        "knot_tight",
        "knot_released",
        "clearance",
        "strain_error",
        "strain",
        "tension_percent",
        "left_d",
        "drawn_s",
        "drawn_frames",
        "substeps",
        "rejected",
        "newton",
        "incidents",
        "first_incident",
        "ms_median",
        "ms_p99",
        "ms_max",
        "real_time",
        "cpu_s",
        "state_hash",
    ];

    fn cases() -> Vec<Case> {
        let mut all = Vec::new();
        for radius in [0.05e-3, 0.15e-3, 0.25e-3] {
            for young_modulus in [0.1e9, 2e9, 9e9] {
                for speed in [0.05, 0.3, 1.0] {
                    for mu in [0.0, 0.1, 0.3] {
                        for element in [1.0, 2.0] {
                            all.push(Case { radius, young_modulus, speed, mu, element, ..Case::default() });
                        }
                    }
                }
            }
        }
        all
    }

    fn levels(case: &Case) -> Vec<String> {
        // A product of a power of ten may miss the short number by the last digit.
        let short = |v: f64| ((v * 1e6).round() / 1e6).to_string();
        [case.radius * 1e3, case.young_modulus / 1e9, case.speed, case.mu, case.element].map(short).to_vec()
    }

    fn run(case: &Case, budget: Budget, trace: &mut dyn FnMut(String)) -> Vec<String> {
        measure(case, budget, trace)
    }

    fn report(table: &Table, _: &Path) -> anyhow::Result<String> {
        let mut out = String::from("# The overhand knot, drawn tight and let go\n\n");
        out.push_str(&summary(table));
        out.push_str("\n## Every case\n\n");
        let all: Vec<&str> = Self::FACTORS
            .iter()
            .chain(Self::MEASURES)
            .copied()
            .filter(|c| !["first_incident", "state_hash", "knot_before"].contains(c))
            .collect();
        out.push_str(&table.markdown(&all));
        Ok(out)
    }
}

/// One line for all cases and one for each level of each factor: sums, and the worst of what has a worst.
fn summary(table: &Table) -> String {
    let columns = [
        "cases",
        "",
        "not finished",
        "passed through",
        "knot kept",
        "least clearance",
        "largest strain error",
        "substeps",
        "rejected",
        "with incidents",
        "ms median",
        "ms p99, worst",
        "CPU s",
    ];
    let line = |factor: &str, level: &str, rows: &[&Vec<String>]| {
        let numbers = |name: &str| rows.iter().filter_map(|r| table.number(r, name)).collect::<Vec<f64>>();
        let count = |holds: &dyn Fn(&[String]) -> bool| rows.iter().filter(|r| holds(r)).count().to_string();
        let sum = |name: &str| numbers(name).iter().sum::<f64>();
        let knot = |r: &[String], name: &str| table.text(r, name).to_string();
        vec![
            factor.to_string(),
            level.to_string(),
            count(&|r| table.text(r, ENDED).starts_with(NOT_FINISHED)),
            count(&|r| {
                table.number(r, "passes_drawn").unwrap_or(0.0) + table.number(r, "passes_released").unwrap_or(0.0) > 0.0
            }),
            count(&|r| knot(r, "knot_before") == knot(r, "knot_tight")),
            numbers("clearance").into_iter().reduce(f64::min).map(|v| format!("{v:.3}")).unwrap_or_default(),
            numbers("strain_error").into_iter().reduce(f64::max).map(|v| format!("{v:.1e}")).unwrap_or_default(),
            sum("substeps").to_string(),
            sum("rejected").to_string(),
            count(&|r| table.number(r, "incidents").unwrap_or(0.0) > 0.0),
            format!("{:.2}", quantile(&numbers("ms_median"), 0.5)),
            format!("{:.2}", quantile(&numbers("ms_p99"), 1.0)),
            format!("{:.1}", sum("cpu_s")),
        ]
    };
    let all: Vec<&Vec<String>> = table.rows.iter().collect();
    let mut lines = vec![line("all", &all.len().to_string(), &all)];
    for (k, factor) in Overhand::FACTORS.iter().enumerate() {
        let mut levels: Vec<&String> = all.iter().map(|r| &r[k]).collect();
        levels.sort_by(|a, b| a.parse::<f64>().unwrap_or(0.0).total_cmp(&b.parse().unwrap_or(0.0)));
        levels.dedup();
        for level in levels {
            let rows: Vec<&Vec<String>> = all.iter().copied().filter(|r| r[k] == *level).collect();
            lines.push(line(factor, &format!("{level} ({} cases)", rows.len()), &rows));
        }
    }
    markdown(&columns, lines.into_iter())
}

/// The engine's version and the hash of the state that it comes to in a short draw with contacts: what computes
/// otherwise has another one.
pub fn engine() -> String {
    let case = Case { speed: 0.3, ..Case::default() };
    let mut found = Found::default();
    let hash = case.world().map_or(0, |(world, rod)| {
        let mut s = Session::new(world, Budget { cpu_s: f64::MAX, frames: FINGERPRINT_FRAMES });
        // Ends when the frames are spent.
        let _ = draw_and_let_go(&case, &mut s, rod, &mut found, &mut |_| {});
        s.world.state_hash()
    });
    format!("{}-{hash:016x}", env!("CARGO_PKG_VERSION"))
}

/// Frames of the draw that tells engines apart; contacts begin in the first few.
const FINGERPRINT_FRAMES: u32 = 12;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sweep_has_its_162_cases_once_each() {
        let mut all: Vec<Vec<String>> = Overhand::cases().iter().map(Overhand::levels).collect();
        assert_eq!(all.len(), 162);
        assert_eq!(all[0], ["0.05", "0.1", "0.05", "0", "1"]);
        all.sort();
        all.dedup();
        assert_eq!(all.len(), 162);
    }

    #[test]
    fn a_case_is_read_back_from_its_levels() {
        for case in Overhand::cases() {
            let pairs: Vec<String> =
                Overhand::FACTORS.iter().zip(Overhand::levels(&case)).map(|(f, l)| format!("{f}={l}")).collect();
            let read = Case::parse(&pairs.join(",")).unwrap();
            assert!(
                (read.radius / case.radius - 1.0).abs() < 1e-12
                    && (read.young_modulus / case.young_modulus - 1.0).abs() < 1e-12
            );
            assert_eq!((read.speed, read.mu, read.element), (case.speed, case.mu, case.element));
        }
        assert!(Case::parse("radius=1").unwrap_err().to_string().contains("substep"));
    }

    #[test]
    fn a_case_over_budget_says_where_it_stood() {
        let row = measure(&Case::default(), Budget { cpu_s: 1e3, frames: 2 }, &mut |_| {});
        assert_eq!(row.len(), Overhand::MEASURES.len());
        assert!(row[0].starts_with("not finished: over 2 frames, at 0.0333 s, drawing, T "), "{}", row[0]);
        assert_eq!((row[1].as_str(), row[3].as_str(), row[4].as_str()), ("0", "trefoil-right", ""));
    }

    #[test]
    fn the_last_frames_do_not_pass_the_end_of_the_draw() {
        for case in Overhand::cases() {
            let (left, ea) = (150.0 * case.radius, 1.0);
            let at = |tension: f64| Drawn { tension, ea, span: case.length() - left }.frame(&case) * 2.0 * case.speed;
            // A tenth of the hundred radii left; a quarter of a percent of the length when the tension rises.
            assert!(at(0.0) <= 10.0 * case.radius * (1.0 + 1e-9) && at(0.006) <= 1.5 * case.radius * (1.0 + 1e-9));
            assert!(at(0.0) > 0.0);
        }
    }
}
