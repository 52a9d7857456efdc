//! The command `sutura bench`: how fast is this build on this machine? Times are CPU times of the solver on one core, so that
//! another program on the same machine costs little.

use crate::args::{Bench, FreeShape};
use crate::{run, say, say_json, table};
use anyhow::Context as _;
use cpu_time::ThreadTime;
use sutura::glam::DVec3;
use sutura::{GripSpec, Hold, Material, Place, RodSpec, Settings, Stretch, World};
use sutura_scene::Runner;

/// Everything measured.
#[derive(serde::Serialize)]
struct Measured {
    machine: Machine,
    free_thread: Vec<FreeThread>,
    knots: Vec<Knot>,
}

#[derive(serde::Serialize)]
struct Machine {
    cpu: String,
    cores: usize,
    system: String,
    build: &'static str,
    version: &'static str,
}

#[derive(serde::Serialize)]
struct FreeThread {
    shape: &'static str,
    elements: u32,
    frames: u32,
    ms_median: f64,
    ms_p99: f64,
    /// Over all frames.
    newton_per_frame: f64,
    substeps_per_frame: f64,
    ns_per_element_iteration: f64,
    max_elongation: f64,
    incidents: usize,
}

#[derive(serde::Serialize)]
struct Knot {
    scene: String,
    elements: usize,
    ms_median: f64,
    ms_p99: f64,
    most_contacts: u32,
    /// CPU time for each contact and Newton iteration, the rods' own time at the rate of the free thread taken off.
    ns_per_contact_iteration: Option<f64>,
    real_time_factor: f64,
    worst_second_real_time_factor: f64,
    passed: bool,
}

const FRAME: f64 = 1.0 / 60.0;
const LENGTH: f64 = 0.15;
const RADIUS: f64 = 1e-4;

/// Runs the command.
pub fn bench(args: &Bench) -> anyhow::Result<()> {
    let counts = if args.elements.is_empty() { vec![40, 120, 500, 2000] } else { args.elements.clone() };
    let shapes = args.shape.map_or_else(|| vec![FreeShape::Straight, FreeShape::Helix], |s| vec![s]);
    let mut measured = Measured { machine: machine(), free_thread: Vec::new(), knots: Vec::new() };
    if !args.knots {
        for shape in shapes {
            for &n in &counts {
                measured.free_thread.push(free_thread(shape, n, args.frames)?);
            }
        }
    }
    if !args.free {
        let rod_ns = measured.free_thread.iter().map(|f| f.ns_per_element_iteration).reduce(f64::min);
        for name in ["overhand", "square_knot", "plectoneme"] {
            measured.knots.push(knot(name, rod_ns)?);
        }
    }
    if args.json { say_json(&measured) } else { say(&as_tables(&measured)) }
}

fn free_thread(shape: FreeShape, elements: u32, frames: u32) -> anyhow::Result<FreeThread> {
    let n = elements as usize;
    let material = Material::elastic(1e9, 1150.0);
    let spec = match shape {
        FreeShape::Straight => RodSpec::straight(DVec3::ZERO, DVec3::X * LENGTH, n, RADIUS, material),
        // Six turns, a fifth of the length along the axis.
        FreeShape::Helix => {
            let (turns, pitch) = (6.0, LENGTH / 30.0);
            let around = ((LENGTH / turns).powi(2) - pitch * pitch).sqrt() / core::f64::consts::TAU;
            RodSpec::helix(DVec3::ZERO, DVec3::X, DVec3::Y * around, turns, pitch, n, RADIUS, material)
        }
    };
    let mut world = World::new(Settings::default())?;
    let rod = world.insert_rod(&RodSpec { stretch: Stretch::Inextensible, ..spec })?;
    world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Pin))?;
    let (mut ms, mut newton, mut substeps, mut elongation, mut incidents) = (Vec::new(), 0_u64, 0_u64, 0.0_f64, 0);
    for _ in 0..frames {
        let start = ThreadTime::now();
        let report = world.step(FRAME);
        ms.push(1e3 * start.elapsed().as_secs_f64());
        newton += u64::from(report.newton_iterations);
        substeps += u64::from(report.substeps);
        incidents += report.incidents.len();
        elongation = elongation.max(world.rod(rod)?.max_elongation());
    }
    let total: f64 = ms.iter().sum();
    Ok(FreeThread {
        shape: if shape == FreeShape::Straight { "straight" } else { "helix" },
        elements,
        frames,
        ms_median: quantile(&mut ms, 0.5),
        ms_p99: quantile(&mut ms, 0.99),
        newton_per_frame: newton as f64 / f64::from(frames),
        substeps_per_frame: substeps as f64 / f64::from(frames),
        ns_per_element_iteration: 1e6 * total / (newton.max(1) as f64 * f64::from(elements)),
        max_elongation: elongation,
        incidents,
    })
}

fn knot(name: &str, rod_ns: Option<f64>) -> anyhow::Result<Knot> {
    let scene = run::load(name, &[]).with_context(|| format!("the benchmark needs the built-in scene `{name}`"))?;
    let outcome = run::simulate(Runner::new(scene)?, false);
    let r = &outcome.report;
    let elements: usize = r.threads.iter().map(|t| t.elements).sum();
    let frame = outcome.series.iter().find(|s| s.name == "frame");
    let column = |name: &str| frame.and_then(|f| f.column(name));
    let per_contact = match (rod_ns, column("contacts"), column("newton")) {
        (Some(rod_ns), Some(contacts), Some(newton)) => {
            let rows: f64 = contacts.iter().zip(&newton).map(|(c, n)| c * n).sum();
            let rods = rod_ns * elements as f64 * newton.iter().sum::<f64>();
            (rows > 0.0).then(|| (1e9 * r.cpu_s - rods) / rows)
        }
        _ => None,
    };
    Ok(Knot {
        scene: name.into(),
        elements,
        ms_median: r.ms_per_frame.median,
        ms_p99: r.ms_per_frame.p99,
        most_contacts: r.work.max_contacts,
        ns_per_contact_iteration: per_contact,
        real_time_factor: r.real_time_factor,
        worst_second_real_time_factor: r.worst_second_real_time_factor,
        passed: r.passed,
    })
}

fn machine() -> Machine {
    let brand = sysinfo::System::new().ok().and_then(|mut system| {
        system.refresh_cpu_list(sysinfo::CpuRefreshKind::nothing());
        system.cpus().first().map(|c| c.brand().trim().to_string()).filter(|b| !b.is_empty())
    });
    Machine {
        cpu: brand.unwrap_or_else(|| "unknown processor".into()),
        cores: std::thread::available_parallelism().map_or(1, usize::from),
        system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
        build: if cfg!(debug_assertions) { "debug (slow: build with --release)" } else { "release" },
        version: env!("CARGO_PKG_VERSION"),
    }
}

/// The smallest value that at least the part `q` of the values does not exceed.
fn quantile(values: &mut [f64], q: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let rank = (q * values.len() as f64).ceil() as usize;
    values.get(rank.max(1) - 1).copied().unwrap_or(f64::NAN)
}

fn as_tables(m: &Measured) -> String {
    let machine = &m.machine;
    let cores = if machine.cores == 1 { "1 core".to_string() } else { format!("{} cores", machine.cores) };
    let mut out = format!("{}, {cores} (one used), {}; sutura {}, {} build\n", machine.cpu, machine.system, machine.version, machine.build);
    if !m.free_thread.is_empty() {
        let mut t = table(
            &["free thread", "elements", "ms/frame median", "p99", "substeps/frame", "Newton/frame", "ns/element/iteration", "max elongation", "incidents"],
            &[1, 2, 3, 4, 5, 6, 7, 8],
        );
        for f in &m.free_thread {
            t.add_row([
                f.shape.to_string(),
                f.elements.to_string(),
                format!("{:.4}", f.ms_median),
                format!("{:.4}", f.ms_p99),
                format!("{:.1}", f.substeps_per_frame),
                format!("{:.1}", f.newton_per_frame),
                format!("{:.0}", f.ns_per_element_iteration),
                format!("{:.1e}", f.max_elongation),
                f.incidents.to_string(),
            ]);
        }
        out.push_str(&format!("\n{:.0} cm, radius {} mm, one end pinned, dropped, 60 frames/s\n{t}\n", 100.0 * LENGTH, 1e3 * RADIUS));
    }
    if !m.knots.is_empty() {
        let mut t = table(
            &["knot", "elements", "ms/frame median", "p99", "most contacts", "ns/contact/iteration", "real-time factor", "worst second", "checks"],
            &[1, 2, 3, 4, 5, 6, 7],
        );
        for k in &m.knots {
            t.add_row([
                k.scene.clone(),
                k.elements.to_string(),
                format!("{:.3}", k.ms_median),
                format!("{:.3}", k.ms_p99),
                k.most_contacts.to_string(),
                k.ns_per_contact_iteration.map_or_else(|| "-".into(), |v| format!("{v:.0}")),
                format!("{:.2}", k.real_time_factor),
                format!("{:.2}", k.worst_second_real_time_factor),
                if k.passed { "passed" } else { "FAILED" }.to_string(),
            ]);
        }
        out.push_str(&format!("\n{t}\n"));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_values_of_the_sample() {
        let mut v: Vec<f64> = (1..=100).rev().map(f64::from).collect();
        assert_eq!((quantile(&mut v, 0.5), quantile(&mut v, 0.99), quantile(&mut v, 1.0)), (50.0, 99.0, 100.0));
        assert!(quantile(&mut [], 0.5).is_nan());
        assert_eq!(quantile(&mut [7.0], 0.5), 7.0);
    }

    #[test]
    fn the_machine_has_a_name_and_a_core() {
        let m = machine();
        assert!(!m.cpu.is_empty() && m.cores >= 1);
    }
}
