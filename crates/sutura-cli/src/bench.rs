//! The command `sutura bench`: how fast is this build on this machine? Times are CPU times of the solver on one core,
//! so that another program on the same machine costs little.

use crate::args::{Bench, FreeShape};
use crate::{run, say, say_json, table};
use anyhow::Context as _;
use cpu_time::ThreadTime;
use sutura::glam::DVec3;
use sutura::skin::{Bone, Skin, SkinSpec};
use sutura::{GripSpec, Hold, Integrator, Material, Place, RodSpec, Settings, Shear, Stretch, World};
use sutura_scene::Runner;

/// Everything measured.
#[derive(serde::Serialize)]
struct Measured {
    machine: Machine,
    free_thread: Vec<FreeThread>,
    free_swing: Vec<FreeSwing>,
    skin: Option<SkinTime>,
    knots: Vec<Knot>,
}

/// Cost of what is drawn.
#[derive(serde::Serialize)]
struct SkinTime {
    elements: usize,
    vertices: usize,
    /// Bones, positions and normals, once.
    ms_median: f64,
    ms_per_10_000: f64,
}

/// What times were measured on.
#[derive(serde::Serialize)]
pub struct Machine {
    /// The processor.
    pub cpu: String,
    /// Its cores.
    pub cores: usize,
    system: String,
    /// Debug or release.
    pub build: &'static str,
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

/// How near a swing comes to its converged path, and what that costs.
#[derive(serde::Serialize)]
struct FreeSwing {
    integrator: &'static str,
    substeps_per_frame: u32,
    newton_per_frame: f64,
    ms_median: f64,
    ms_p99: f64,
    /// Root mean square distance of the end from the converged path, with drag over 2 s and without over half a second
    /// \[mm\].
    drag_rms_mm: f64,
    free_rms_mm: f64,
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
    let mut measured =
        Measured { machine: machine(), free_thread: Vec::new(), free_swing: Vec::new(), skin: None, knots: Vec::new() };
    if !args.knots {
        for shape in shapes {
            for &n in &counts {
                measured.free_thread.push(free_thread(shape, n, args.frames)?);
            }
        }
        measured.free_swing = free_swings()?;
        measured.skin = Some(skin()?);
    }
    if !args.free {
        let rod_ns = measured.free_thread.iter().map(|f| f.ns_per_element_iteration).reduce(f64::min);
        for name in ["overhand", "square_knot", "plectoneme"] {
            measured.knots.push(knot(name, rod_ns)?);
        }
    }
    if args.json { say_json(&measured) } else { say(&as_tables(&measured)) }
}

/// The tube of a thread of 192 elements that hangs in a helix: some 10 000 vertices.
fn skin() -> anyhow::Result<SkinTime> {
    let material = Material::elastic(1e9, 1150.0);
    let mut world = World::new(Settings::default())?;
    let rod = world.insert_rod(&RodSpec::helix(
        DVec3::ZERO,
        DVec3::X,
        DVec3::Y * 3e-3,
        6.0,
        LENGTH / 30.0,
        192,
        RADIUS,
        material,
    ))?;
    let view = world.rod(rod)?;
    let skin = Skin::new(&SkinSpec::of(&view))?;
    let n = skin.n_vertices();
    let (mut bones, mut positions, mut normals) =
        (vec![Bone::default(); skin.n_bones()], vec![[0.0; 3]; n], vec![[0.0; 3]; n]);
    let mut ms: Vec<f64> = (0..500)
        .map(|_| {
            let start = ThreadTime::now();
            skin.bones(&view, &mut bones);
            skin.pose(std::hint::black_box(&bones), &mut positions, &mut normals);
            std::hint::black_box((&positions, &normals));
            1e3 * start.elapsed().as_secs_f64()
        })
        .collect();
    let ms_median = quantile(&mut ms, 0.5);
    Ok(SkinTime { elements: skin.n_elements(), vertices: n, ms_median, ms_per_10_000: 1e4 * ms_median / n as f64 })
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

/// Frames of a swing with drag, and of one without: after half a second that one is chaotic.
const SWINGS: [(f64, usize); 2] = [(4.0, 120), (0.0, 30)];

fn free_swings() -> anyhow::Result<Vec<FreeSwing>> {
    let converged = SWINGS.map(|(drag, frames)| swing(Integrator::TrBdf2, 64, 1e-5, drag, frames));
    let mut out = Vec::new();
    for (integrator, name, counts) in
        [(Integrator::ImplicitEuler, "implicit Euler", [4, 8, 16]), (Integrator::TrBdf2, "TR-BDF2", [2, 4, 6])]
    {
        for substeps in counts {
            let [drag, free] =
                SWINGS.map(|(drag, frames)| swing(integrator, substeps, Settings::default().tolerance, drag, frames));
            let (mut drag, free) = (drag?, free?);
            let [with, without] = converged.each_ref().map(|c| c.as_ref().map_or(&[][..], |c| &c.path));
            out.push(FreeSwing {
                integrator: name,
                substeps_per_frame: substeps,
                newton_per_frame: drag.newton as f64 / drag.path.len() as f64,
                ms_median: quantile(&mut drag.ms, 0.5),
                ms_p99: quantile(&mut drag.ms, 0.99),
                drag_rms_mm: 1e3 * apart(&drag.path, with),
                free_rms_mm: 1e3 * apart(&free.path, without),
            });
        }
    }
    Ok(out)
}

struct Swing {
    path: Vec<DVec3>,
    ms: Vec<f64>,
    newton: u64,
}

/// The path of the free end of a thread of 15 cm, radius 0.25 mm, E = 10 MPa, clamped and let go level, frame by frame.
fn swing(integrator: Integrator, substeps: u32, tolerance: f64, drag: f64, frames: usize) -> anyhow::Result<Swing> {
    const ELEMENTS: usize = 120;
    let linear_damping = -(-drag).exp_m1();
    let mut world = World::new(Settings {
        substep: FRAME / f64::from(substeps),
        integrator,
        tolerance,
        linear_damping,
        ..Settings::default()
    })?;
    let material = Material { shear: Shear::Modulus(1e7 / 3.0), ..Material::elastic(1e7, 1000.0) };
    let rod = world.insert_rod(&RodSpec::straight(DVec3::ZERO, DVec3::X * LENGTH, ELEMENTS, 0.25e-3, material))?;
    world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Clamp))?;
    let mut swing = Swing { path: Vec::new(), ms: Vec::new(), newton: 0 };
    for _ in 0..frames {
        let start = ThreadTime::now();
        let report = world.step(FRAME);
        swing.ms.push(1e3 * start.elapsed().as_secs_f64());
        swing.newton += u64::from(report.newton_iterations);
        swing.path.push(world.rod(rod)?.positions()[ELEMENTS]);
    }
    Ok(swing)
}

/// Root mean square distance; not a number where there is nothing to compare with.
fn apart(a: &[DVec3], b: &[DVec3]) -> f64 {
    if a.len() != b.len() {
        return f64::NAN;
    }
    (a.iter().zip(b).map(|(a, b)| a.distance_squared(*b)).sum::<f64>() / a.len() as f64).sqrt()
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

/// This machine and build.
pub fn machine() -> Machine {
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
    let mut out = format!(
        "{}, {cores} (one used), {}; sutura {}, {} build\n",
        machine.cpu, machine.system, machine.version, machine.build
    );
    if !m.free_thread.is_empty() {
        let mut t = table(
            &[
                "free thread",
                "elements",
                "ms/frame median",
                "p99",
                "substeps/frame",
                "Newton/frame",
                "ns/element/iteration",
                "max elongation",
                "incidents",
            ],
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
        out.push_str(&format!(
            "\n{:.0} cm, radius {} mm, one end pinned, dropped, 60 frames/s\n{t}\n",
            100.0 * LENGTH,
            1e3 * RADIUS
        ));
    }
    if !m.free_swing.is_empty() {
        let mut t = table(
            &[
                "free swing",
                "substeps/frame",
                "Newton/frame",
                "ms/frame median",
                "p99",
                "off [mm], drag 4/s, 2 s",
                "off [mm], no drag, 0.5 s",
            ],
            &[1, 2, 3, 4, 5, 6],
        );
        for f in &m.free_swing {
            t.add_row([
                f.integrator.to_string(),
                f.substeps_per_frame.to_string(),
                format!("{:.1}", f.newton_per_frame),
                format!("{:.4}", f.ms_median),
                format!("{:.4}", f.ms_p99),
                format!("{:.3}", f.drag_rms_mm),
                format!("{:.3}", f.free_rms_mm),
            ]);
        }
        out.push_str(&format!(
            "\n15 cm, radius 0.25 mm, 120 elements, E 10 MPa, clamped, let go level; times with drag; RMS of the end from its converged path\n{t}\n"
        ));
    }
    if let Some(s) = &m.skin {
        let (n, of, ms, each) = (s.vertices, s.elements, s.ms_median, s.ms_per_10_000);
        out.push_str(&format!("\nskin of {n} vertices (12 around, 4 rings an element, {of} elements): {ms:.4} ms median, {each:.4} ms for 10 000\n"));
    }
    if !m.knots.is_empty() {
        let mut t = table(
            &[
                "knot",
                "elements",
                "ms/frame median",
                "p99",
                "most contacts",
                "ns/contact/iteration",
                "real-time factor",
                "worst second",
                "checks",
            ],
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
