//! Two hands at play: noisy, sudden, taking hold and letting go anywhere on a thread that hangs over a post above a
//! table. They are hands: no stronger and no faster than the viewer's, so whatever they do there is a way to go on. No
//! thread may pass through anything and no incident may arise.

use clap::Args;
use std::collections::BTreeMap;
use std::time::Duration;
use sutura::glam::{DQuat, DVec3};
use sutura::{
    Drive, Friction, Geometry, Grip, GripSpec, Handle, Hold, Material, Place, Pose, Rod, RodSpec, Settings, ShapeSpec,
    Shear, World,
};
use sutura_generated::Draw;
use sutura_scene::presets::{find_material, find_size};

use crate::case::{Budget, seconds};
use crate::pool::{self, Ended};
use crate::session::Session;
use crate::table::markdown;

/// What is asked for.
#[derive(Args, Debug, Clone)]
pub struct Hands {
    /// How many pairs of hands; the threads take turns
    #[arg(long, default_value_t = 20)]
    pub seeds: u64,
    /// Number of the first one
    #[arg(long, default_value_t = 0)]
    pub first: u64,
    /// How long each plays: `20s`
    #[arg(long, default_value = "20s", value_parser = seconds)]
    pub seconds: f64,
    /// Only this one: say how it goes, a line every tenth of a second
    #[arg(long, value_name = "NUMBER")]
    pub only: Option<u64>,
    /// Pairs at a time
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    pub jobs: u16,
    /// CPU time after which a pair is given up
    #[arg(long, default_value = "5min", value_parser = seconds)]
    pub budget: f64,
    /// Most work of a frame, in counts of the engine, some 1e9 a second of one core: what needs more is in slow motion
    #[arg(long, value_name = "COUNTS", value_parser = positive)]
    pub work: Option<f64>,
    /// Say of each pair how it did when it has
    #[arg(long, short)]
    pub verbose: bool,
}

fn positive(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|x: &f64| x.is_finite() && *x > 0.0).ok_or_else(|| format!("{text} is not a number > 0"))
}

/// Seed of all of them.
const SEED: u64 = 0x6861_6e64;
/// Threads that take turns.
const THREADS: [(&str, &str); 3] = [("2-0", "silk"), ("3-0", "silk"), ("2-0", "nylon")];
/// Length of a thread, and of an element \[m\].
const LENGTH: f64 = 0.15;
const ELEMENT: f64 = 1e-3;
/// A frame \[s\].
const FRAME: f64 = 1.0 / 60.0;
/// Radius of the post, which lies along y, and the height of the table \[m\].
const POST: f64 = 5e-3;
const TABLE: f64 = -0.05;
/// Force and speed that a hand does not go beyond, as in the viewer \[N\], \[m/s\].
const FORCE: f64 = 5.0;
const FASTEST: f64 = 1.0;
/// A force this far above the limit and the hand gives way, as in the viewer.
const OVER: f64 = 1.02;
/// Speeds with which hands go to their goals \[m/s\].
const SPEEDS: (f64, f64) = (0.02, 0.5);
/// Height \[m\] and frequency \[1/s\] of tremor.
const TREMOR: (f64, f64) = (2e-4, 10.0);
/// Sudden turns back a second.
const REVERSALS: f64 = 0.7;
/// How long a hand holds, and stays empty \[s\].
const HOLDS: (f64, f64) = (0.5, 4.0);
const EMPTY: (f64, f64) = (0.05, 0.6);

/// A hand.
struct Hand {
    held: Option<(Handle<Grip>, u32)>,
    /// Where it wants to be, without tremor, and where it is on its way to \[m\].
    at: DVec3,
    goal: DVec3,
    speed: f64,
    /// Time at which it takes hold or lets go \[s\].
    until: f64,
    phase: DVec3,
    /// Frames in which it met its limit.
    strained: u64,
}

/// Work space: above the table, on both sides of the post.
fn goal(d: &mut Draw) -> DVec3 {
    DVec3::new(d.signed() * 0.07, d.signed() * 0.03, d.even(TABLE + 2e-3, 0.06))
}

/// A pair of hands.
struct Pair {
    s: Session,
    rod: Handle<Rod>,
    hands: [Hand; 2],
    draw: Draw,
}

impl Pair {
    fn new(number: u64, budget: Budget) -> Result<Self, String> {
        let text = |e: sutura::Error| e.to_string();
        let (size, material) = thread(number);
        let (size, m) =
            (find_size(size).map_err(|e| e.to_string())?, find_material(material).map_err(|e| e.to_string())?);
        let settings = Settings {
            linear_damping: 0.5,
            angular_damping: 0.5,
            friction: Friction::coulomb(m.friction.value),
            ..Settings::default()
        };
        let mut world = World::new(settings).map_err(text)?;
        let radius = 0.5 * size.diameter.value;
        let (n, reach) = ((LENGTH / ELEMENT) as usize, POST + 1.5 * radius);
        // Over the post, both halves hanging down.
        let quarter = reach * core::f64::consts::FRAC_PI_2;
        let at = |s: f64| {
            if s.abs() > quarter {
                return DVec3::new(reach * s.signum(), 2e-3 * s / LENGTH, -(s.abs() - quarter));
            }
            let (sin, cos) = libm::sincos(s / reach);
            DVec3::new(reach * sin, 2e-3 * s / LENGTH, reach * cos)
        };
        let lift = DVec3::Z * (0.5 * LENGTH - quarter + TABLE + 2e-3).max(0.0);
        let points = (0..=n).map(|i| at(LENGTH * (i as f64 / n as f64 - 0.5)) + lift).collect();
        let material = Material {
            young_modulus: m.young_modulus.value,
            shear: Shear::Poisson(m.poisson_ratio.value),
            density: m.density.value,
            bend_scale: m.bend_scale.value,
            bend_damping: 2e-3,
            plasticity: None,
        };
        let rod = world.insert_rod(&RodSpec::new(points, radius, material)).map_err(text)?;
        let lying = DQuat::from_rotation_x(core::f64::consts::FRAC_PI_2);
        world
            .insert_shape(&ShapeSpec::fixed(
                Geometry::Cylinder { radius: POST, half_length: 0.03 },
                Pose::new(lift, lying),
            ))
            .map_err(text)?;
        world.insert_shape(&ShapeSpec::fixed(Geometry::Plane, Pose::at(DVec3::Z * TABLE))).map_err(text)?;
        let mut draw = Draw::seed(SEED, number);
        let hands = [0, 1].map(|_| Hand {
            held: None,
            at: DVec3::ZERO,
            goal: DVec3::ZERO,
            speed: 0.0,
            until: draw.even(0.0, 0.2),
            phase: draw.vector(core::f64::consts::PI),
            strained: 0,
        });
        Ok(Pair { s: Session::new(world, budget), rod, hands, draw })
    }

    /// What the hands do before a frame.
    fn act(&mut self) -> Result<(), String> {
        let text = |e: sutura::Error| e.to_string();
        let (world, d) = (&mut self.s.world, &mut self.draw);
        let now = world.time();
        for k in 0..2 {
            let other = self.hands[1 - k].held;
            let hand = &mut self.hands[k];
            if now >= hand.until {
                if let Some((grip, _)) = hand.held.take() {
                    world.remove_grip(grip).map_err(text)?;
                    hand.until = now + d.even(EMPTY.0, EMPTY.1);
                } else {
                    let x = world.rod(self.rod).map_err(text)?.positions();
                    let last = x.len() as u32 - 1;
                    // An end as often as anywhere between.
                    let particle = match d.whole(0, 3) {
                        0 => 0,
                        1 => last,
                        _ => d.whole(0, last),
                    };
                    // Not where the other hand is.
                    if other.is_none_or(|(_, taken)| particle.abs_diff(taken) > 5) {
                        hand.at = x[particle as usize];
                        let hold = if d.chance(0.5) { Hold::Pin } else { Hold::Clamp };
                        let grip = world
                            .insert_grip(&GripSpec::new(self.rod, Place::Particle(particle), hold))
                            .map_err(text)?;
                        hand.held = Some((grip, particle));
                        (hand.goal, hand.speed) = (goal(d), d.log(SPEEDS.0, SPEEDS.1));
                        hand.until = now + d.even(HOLDS.0, HOLDS.1);
                    }
                }
            }
            let Some((grip, _)) = hand.held else { continue };
            if d.chance(REVERSALS * FRAME) {
                (hand.goal, hand.speed) = (2.0 * hand.at - hand.goal, d.log(SPEEDS.0, SPEEDS.1));
                hand.goal.z = hand.goal.z.clamp(TABLE, 0.08);
            }
            let way = hand.goal - hand.at;
            if way.length() < 1e-3 {
                (hand.goal, hand.speed) = (goal(d), d.log(SPEEDS.0, SPEEDS.1));
            }
            hand.at += way.clamp_length_max(hand.speed * FRAME);
            let beat = core::f64::consts::TAU * TREMOR.1 * now;
            let tremor = DVec3::new(
                libm::sin(beat + hand.phase.x),
                libm::sin(1.1 * beat + hand.phase.y),
                libm::sin(0.9 * beat + hand.phase.z),
            ) * TREMOR.0;
            let (is, acting) =
                (world.grip_pose(grip).map_err(text)?.position, world.grip_wrench(grip).map_err(text)?.force);
            let toward = (hand.at + tremor - is).clamp_length_max(FASTEST * FRAME);
            let drive = if acting.length() > OVER * FORCE {
                hand.strained += 1;
                Drive::Hand { direction: acting.normalize(), force: FORCE, speed_limit: FASTEST }
            } else if toward.length() > 1e-7 {
                Drive::Hand { direction: toward.normalize(), force: FORCE, speed_limit: toward.length() / FRAME }
            } else {
                Drive::Pose
            };
            world.set_grip_drive(grip, drive).map_err(text)?;
            // What is held back does not let the hand run away from it.
            hand.at = is + (hand.at - is).clamp_length_max(MOST_AHEAD);
        }
        Ok(())
    }
}

/// How far a hand that is held back may want to be from what it holds \[m\].
const MOST_AHEAD: f64 = 0.02;

fn thread(number: u64) -> (&'static str, &'static str) {
    THREADS[(number % THREADS.len() as u64) as usize]
}

/// How a pair did.
#[derive(Debug, Clone, Default)]
struct Played {
    time: f64,
    ms: Vec<f64>,
    kinds: BTreeMap<&'static str, u64>,
    first_incident: String,
    passages: usize,
    first_passage: String,
    strained: u64,
    strain: f64,
    clearance: [Option<f64>; 2],
    ended: String,
}

impl Played {
    fn is_clean(&self) -> bool {
        self.kinds.is_empty() && self.passages == 0 && self.ended.is_empty()
    }
    /// Most CPU time of the solver in any second, over a second.
    fn slowest_second(&self) -> f64 {
        let second = (1.0 / FRAME).round() as usize;
        self.ms.windows(second.min(self.ms.len()).max(1)).map(|w| w.iter().sum::<f64>() / 1e3).fold(0.0, f64::max)
    }
    fn over(&self, ms: f64) -> usize {
        self.ms.iter().filter(|m| **m > ms).count()
    }
    fn row(&self, name: String) -> Vec<String> {
        let kinds: Vec<String> = self.kinds.iter().map(|(kind, n)| format!("{kind} {n}")).collect();
        let clearance = |c: Option<f64>| c.map(|c| format!("{c:.3}")).unwrap_or_default();
        vec![
            name,
            format!("{:.2}", self.time),
            format!("{:.1}", 100.0 * (1.0 - self.time / (self.ms.len() as f64 * FRAME))),
            self.passages.to_string(),
            if kinds.is_empty() { "none".into() } else { kinds.join(", ") },
            self.strained.to_string(),
            clearance(self.clearance[0]),
            clearance(self.clearance[1]),
            format!("{:.2}", 100.0 * self.strain),
            format!("{:.1}", self.ms.iter().sum::<f64>() / 1e3),
            self.over(16.7).to_string(),
            self.over(33.0).to_string(),
            format!("{:.0}", self.ms.iter().copied().fold(0.0, f64::max)),
            format!("{:.2}", self.slowest_second()),
            [&self.ended, &self.first_passage, &self.first_incident]
                .into_iter()
                .filter(|t| !t.is_empty())
                .cloned()
                .collect::<Vec<_>>()
                .join("; "),
        ]
    }
}

const COLUMNS: [&str; 15] = [
    "hands",
    "simulated s",
    "slow motion %",
    "passages",
    "incidents",
    "frames at the hand's limit",
    "clearance of threads",
    "of shapes",
    "strain %",
    "CPU s",
    "frames over 16.7 ms",
    "over 33 ms",
    "worst ms",
    "slowest second s",
    "ended, first passage, first incident",
];

fn play(number: u64, time: f64, budget: f64, work: Option<f64>, trace: &mut dyn FnMut(String)) -> Played {
    let frames = (time / FRAME).round() as u32;
    let mut pair = match Pair::new(number, Budget { cpu_s: budget, frames: u32::MAX }) {
        Ok(pair) => pair,
        Err(e) => return Played { ended: e, ..Played::default() },
    };
    if let Err(e) = pair.s.world.set_step_work(work) {
        return Played { ended: e.to_string(), ..Played::default() };
    }
    let mut ended = String::new();
    for frame in 0..frames {
        if let Err(e) = pair.act().and_then(|()| pair.s.frame(FRAME)) {
            ended = e;
            break;
        }
        if frame % 6 == 5 {
            let s = &pair.s;
            let held: Vec<String> =
                pair.hands.iter().map(|h| h.held.map_or("empty".into(), |(_, p)| format!("at {p}"))).collect();
            trace(format!(
                "{:.2} s: hands {}, {} contacts, {:.1} ms, {} rejected so far, {} incidents, {} passages",
                s.world.time(),
                held.join(" and "),
                s.world.contacts().count(),
                s.ms.last().unwrap_or(&0.0),
                s.rejected,
                s.incidents,
                s.audit.report().crossings.len()
            ));
        }
    }
    let (s, hands) = (pair.s, pair.hands);
    let report = s.audit.report();
    Played {
        time: s.world.time(),
        kinds: s.kinds.clone(),
        first_incident: s.first_incident.clone(),
        passages: report.crossings.len(),
        first_passage: report
            .crossings
            .first()
            .map(|c| format!("passage at {:.4} s: {:?}", c.time, c.what))
            .unwrap_or_default(),
        strained: hands.iter().map(|h| h.strained).sum(),
        strain: s.strain(),
        clearance: [report.thread_clearance, report.shape_clearance],
        ended,
        ms: s.ms,
    }
}

impl Hands {
    /// Plays them; false when something was not as it must be.
    pub fn run(&self) -> bool {
        let (time, budget, work) = (self.seconds, self.budget, self.work);
        let name = |number: u64| format!("{number} ({} {})", thread(number).1, thread(number).0);
        if let Some(number) = self.only {
            let played = play(number, time, budget, work, &mut |line| println!("{line}"));
            print!("{}", markdown(&COLUMNS, [played.row(name(number))].into_iter()));
            return played.is_clean();
        }
        let mut all = BTreeMap::new();
        // Hung is what does not come back long after its budget.
        let limit = Duration::from_secs_f64(20.0 * budget + 600.0);
        pool::play(
            self.first..self.first.saturating_add(self.seeds),
            self.jobs,
            limit,
            move |number| play(number, time, budget, work, &mut |_| {}),
            |number, ended| {
                let played = match ended {
                    Ended::Well(played) => played,
                    Ended::Panicked => Played { ended: "panicked".into(), ..Played::default() },
                    Ended::Hung => Played { ended: "hangs".into(), ..Played::default() },
                };
                let line = self.verbose.then(|| played.row(name(number)).join(" | "));
                all.insert(number, played);
                line
            },
        );
        print!("{}", markdown(&COLUMNS, all.iter().map(|(number, played)| played.row(name(*number)))));
        let count = |f: &dyn Fn(&Played) -> bool| all.values().filter(|p| f(p)).count();
        println!(
            "{} of {} clean: {} with passages, {} with incidents, {} not played to the end",
            count(&Played::is_clean),
            all.len(),
            count(&|p| p.passages > 0),
            count(&|p| !p.kinds.is_empty()),
            count(&|p| !p.ended.is_empty())
        );
        all.values().all(Played::is_clean)
    }
}
