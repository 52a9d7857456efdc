//! Inextensible threads: under loads, and between things that do not give way, held longer, shorter or just as long as
//! they are.

mod support;

use core::f64::consts::PI;
use support::t1;
use sutura::glam::{DQuat, DVec3};
use sutura::{
    Drive, Friction, Geometry, Grip, GripSpec, Handle, Hold, IncidentKind, Integrator, LoadKind, LoadSpec, Material,
    Place, Pose, Rod, RodSpec, Settings, ShapeSpec, StepReport, Stretch, World,
};

/// A frame [s].
const DT: f64 = 1.0 / 60.0;

/// Newton iterations that a frame of four substeps may take: each length that cannot be kept costs an attempt of a few.
const MOST_ITERATIONS: u32 = 1000;

const INTEGRATORS: [Integrator; 2] = [Integrator::ImplicitEuler, Integrator::TrBdf2];

/// Length of the thread [m].
const LENGTH: f64 = 0.12;

/// With some damping in bending, as real thread has.
fn soft() -> (Material, f64) {
    let (material, radius) = t1();
    (Material { bend_damping: 0.01, ..material }, radius)
}

struct Held {
    world: World,
    rod: Handle<Rod>,
    end: Handle<Grip>,
    /// Along the thread.
    along: DVec3,
    /// E A [N].
    ea: f64,
}

impl Held {
    /// A straight thread held at both ends.
    fn new(settings: Settings, hold: Hold, along: DVec3, stretch: Stretch) -> Self {
        let (material, radius) = soft();
        let ea = material.young_modulus * PI * radius * radius;
        let mut world = World::new(settings).unwrap();
        let rod = world
            .insert_rod(&RodSpec { stretch, ..RodSpec::straight(DVec3::ZERO, along * LENGTH, 48, radius, material) })
            .unwrap();
        world.insert_grip(&GripSpec::at_once(rod, Place::Start, hold)).unwrap();
        let end = world.insert_grip(&GripSpec::at_once(rod, Place::End, hold)).unwrap();
        Held { world, rod, end, along, ea }
    }
    fn still(hold: Hold) -> Self {
        Held::new(Settings { gravity: DVec3::ZERO, ..Settings::default() }, hold, DVec3::X, Stretch::Inextensible)
    }
    /// Moves the end on by a distance, in a frame.
    fn draw(&mut self, by: f64) -> StepReport {
        let pose = self.world.grip_pose(self.end).unwrap();
        self.world.set_grip_pose(self.end, Pose::new(pose.position + self.along * by, pose.orientation)).unwrap();
        let report = self.world.step(DT);
        assert!(report.newton_iterations < MOST_ITERATIONS, "{report:?}");
        assert!(
            report.incidents.iter().all(|i| matches!(i.kind, IncidentKind::LengthNotKept { .. })),
            "{:?}",
            report.incidents
        );
        report
    }
    /// Force of the end on the thread, along it [N].
    fn force(&self) -> f64 {
        self.world.grip_wrench(self.end).unwrap().force.dot(self.along)
    }
    fn elongation(&self) -> f64 {
        self.world.rod(self.rod).unwrap().max_elongation()
    }
}

fn close(got: f64, want: f64, part: f64, what: &str) {
    assert!((got - want).abs() <= part * want.abs(), "{what}: {got:e}, not {want:e}");
}

#[test]
fn drawn_beyond_its_length_it_pulls_back_as_its_material_does_and_is_itself_again_after() {
    for integrator in INTEGRATORS {
        for hold in [Hold::Pin, Hold::Clamp, Hold::Jaw] {
            for along in [DVec3::X, DVec3::new(0.48, -0.6, 0.64)] {
                let mut held =
                    Held::new(Settings { integrator, ..Settings::default() }, hold, along, Stretch::Inextensible);
                let what = format!("{integrator:?} {hold:?} {along}");
                // First slack, then drawn to 3 % beyond, held, and slack again.
                (0..30).for_each(|_| drop(held.draw(-1e-4)));
                let slack = held.force();
                assert!(slack.abs() < 0.01 && held.elongation() < 5e-6, "{what}: {slack}");
                (0..50).for_each(|_| drop(held.draw(1.01e-4)));
                // Taut it is, with what tension its weight and its swing gave it on the way.
                let taut = held.force();
                (0..20).for_each(|_| drop(held.draw(1.01e-4)));
                let report = held.draw(0.0);
                // What a jaw holds does not stretch.
                let length = if hold == Hold::Jaw { LENGTH * 46.0 / 48.0 } else { LENGTH };
                close(held.force() - taut, held.ea * 20.0 * 1.01e-4 / length, 5e-3, &what);
                close(held.force(), held.ea * 4.07e-3 / length, 0.03, &what);
                assert!(
                    matches!(report.incidents[..], [ref i] if matches!(i.kind, IncidentKind::LengthNotKept { rod, .. } if rod == held.rod)),
                    "{what}"
                );
                (0..70).for_each(|_| drop(held.draw(-1.01e-4)));
                let report = held.draw(0.0);
                assert!(
                    report.incidents.is_empty() && held.elongation() < 5e-6,
                    "{what}: {:e} {report:?}",
                    held.elongation()
                );
                assert!(held.force().abs() < 0.01, "{what}: slack it pulls with {}", held.force());
            }
        }
    }
}

#[test]
fn held_at_its_length_its_tension_stays_what_it_was() {
    // Within the tolerance of lengths.
    for by in [1e-6, 4e-6, -1e-6] {
        for hold in [Hold::Pin, Hold::Clamp] {
            let mut held = Held::still(hold);
            held.draw(by * LENGTH);
            held.draw(0.0);
            let force = held.force();
            for _ in 0..300 {
                assert!(held.draw(0.0).incidents.is_empty());
            }
            close(held.force(), force, 1e-6, &format!("{hold:?} by {by}"));
            // As stiff as that: positions are rounded to 1e-17 m, which is 1e-8 of these elongations.
            close(force, 1e5 * held.ea * by, 1e-6, &format!("{hold:?} by {by}"));
        }
    }
}

#[test]
fn drawn_slowly_it_carries_no_more_than_half_of_its_stiffness_and_then_pulls_as_its_material_does() {
    for integrator in INTEGRATORS {
        let mut held = Held::new(
            Settings { gravity: DVec3::ZERO, integrator, ..Settings::default() },
            Hold::Pin,
            DVec3::X,
            Stretch::Inextensible,
        );
        let mut most = 0.0_f64;
        for _ in 0..40 {
            held.draw(5e-7 * LENGTH);
            most = most.max(held.force());
        }
        assert!(most > 0.4 * held.ea && most < 0.5 * held.ea, "{integrator:?}: {most}");
        // It keeps a twentieth of E A of what it had, and pulls with what it is stretched by besides.
        close(held.force(), held.ea * (0.05 + 2e-5), 1e-6, "beyond its length");
        let before = held.force();
        (0..100).for_each(|_| drop(held.draw(0.0)));
        close(held.force(), before, 1e-6, "held");
        (0..4).for_each(|_| drop(held.draw(-5e-6 * LENGTH)));
        let report = held.draw(0.0);
        assert!(
            report.incidents.is_empty() && held.elongation() < 5e-6 && held.force().abs() < 1e-3,
            "{integrator:?}: {} {report:?}",
            held.force()
        );
    }
}

#[test]
fn drawn_by_a_force_and_then_held_it_keeps_its_tension_and_gains_what_it_is_stretched_by() {
    for integrator in INTEGRATORS {
        let mut held = Held::new(
            Settings { gravity: DVec3::ZERO, integrator, ..Settings::default() },
            Hold::Pin,
            DVec3::X,
            Stretch::Inextensible,
        );
        held.world
            .set_grip_drive(held.end, Drive::Force { direction: DVec3::X, force: 2.0, speed_limit: 0.05 })
            .unwrap();
        for _ in 0..60 {
            assert!(held.world.step(DT).incidents.is_empty());
        }
        held.world.set_grip_drive(held.end, Drive::Pose).unwrap();
        (0..300).for_each(|_| drop(held.draw(0.0)));
        close(held.force(), 2.0, 1e-3, "held");
        (0..12).for_each(|_| drop(held.draw(1e-5)));
        close(held.force(), 2.0 + held.ea * 1e-3, 1e-3, "drawn on");
        (0..12).for_each(|_| drop(held.draw(-1e-5)));
        close(held.force(), 2.0, 1e-3, "and back");
        held.draw(-2e-5);
        close(
            held.force(),
            -held.ea * 2e-5 / LENGTH,
            1e-3,
            "shorter than it is it has no tension, and is pressed along itself",
        );
    }
}

#[test]
fn pressed_along_itself_it_resists_as_its_material_does() {
    for integrator in INTEGRATORS {
        for substep in [DT / 4.0, DT / 100.0] {
            let settings = Settings { gravity: DVec3::ZERO, integrator, substep, ..Settings::default() };
            let run = |stretch| {
                let mut held = Held::new(settings.clone(), Hold::Clamp, DVec3::X, stretch);
                for _ in 0..10 {
                    held.world.set_grip_pose(held.end, shifted(&held, -1e-4)).unwrap();
                    let report = held.world.step(DT);
                    assert!(report.newton_iterations <= 400, "{report:?}");
                }
                held.force()
            };
            close(run(Stretch::Inextensible), run(Stretch::Elastic), 1e-6, &format!("{integrator:?} {substep}"));
        }
    }
}

fn shifted(held: &Held, by: f64) -> Pose {
    let pose = held.world.grip_pose(held.end).unwrap();
    Pose::new(pose.position + held.along * by, pose.orientation)
}

/// Force of the end of a thread around a post, whose other end is held, while the end is drawn by 3 mm and let back by
/// 4.
fn around_a_post(stretch: Stretch, integrator: Integrator) -> Vec<f64> {
    let (material, radius) = soft();
    let mut world = World::new(Settings { integrator, ..Settings::default() }).unwrap();
    world.set_friction(0, 0, Friction::coulomb(0.2)).unwrap();
    let (post, arm) = (5e-3, 0.04);
    let around = post + radius + 1e-5;
    let length = 2.0 * arm + around * PI;
    let at = |s: f64| match s {
        s if s < arm => DVec3::new(-around, 0.0, s - arm),
        s if s < arm + around * PI => {
            DVec3::new(-around * ((s - arm) / around).cos(), 0.0, around * ((s - arm) / around).sin())
        }
        s => DVec3::new(around, 0.0, arm + around * PI - s),
    };
    let points = (0..=80).map(|i| at(length * f64::from(i) / 80.0)).collect();
    let rod = world.insert_rod(&RodSpec { stretch, ..RodSpec::new(points, radius, material) }).unwrap();
    let lying = Pose::new(DVec3::ZERO, DQuat::from_rotation_x(PI / 2.0));
    world.insert_shape(&ShapeSpec::fixed(Geometry::Cylinder { radius: post, half_length: 0.02 }, lying)).unwrap();
    world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Jaw)).unwrap();
    let end = world.insert_grip(&GripSpec::at_once(rod, Place::End, Hold::Clamp)).unwrap();
    let mut forces = Vec::new();
    for f in 0..130 {
        let pose = world.grip_pose(end).unwrap();
        let by = if f < 60 { -5e-5 } else { 6e-5 };
        world.set_grip_pose(end, Pose::new(pose.position + DVec3::Z * by, pose.orientation)).unwrap();
        let report = world.step(DT);
        assert!(report.converged && report.newton_iterations < MOST_ITERATIONS, "{stretch:?} {f}: {report:?}");
        forces.push(world.grip_wrench(end).unwrap().force.length());
    }
    if stretch == Stretch::Inextensible {
        let left = world.rod(rod).unwrap().max_elongation();
        assert!(left < 5e-6, "slack again it is longer by {left:e}");
    }
    forces
}

#[test]
fn taut_around_a_post_it_pulls_as_its_material_does() {
    for integrator in INTEGRATORS {
        let (got, want) =
            (around_a_post(Stretch::Inextensible, integrator), around_a_post(Stretch::Elastic, integrator));
        // Frictional contacts of the second order part a little where one substep goes another way.
        let bar = if integrator == Integrator::ImplicitEuler { 1e-4 } else { 0.01 };
        for f in (5..100).step_by(5) {
            close(got[f], want[f], bar, &format!("{integrator:?} frame {f}"));
        }
        assert!(want[59] > 3.0 && got[129] < 0.05, "{} {}", want[59], got[129]);
    }
}

#[test]
fn the_same_input_gives_the_same_bits_with_and_without_working_memory() {
    let hashes = |forget: bool| {
        let mut held = Held::new(Settings::default(), Hold::Pin, DVec3::X, Stretch::Inextensible);
        let mut out = Vec::new();
        for f in 0..60 {
            if forget {
                held.world.forget_scratch();
            }
            held.draw(if f < 30 { 1e-4 } else { -1.2e-4 });
            out.push(held.world.state_hash());
        }
        out
    };
    assert_eq!(hashes(false), hashes(true));
}

/// A thread of 150 mm of 0.45 mm nylon held at its start, straight at an angle from where it hangs, with a load at its
/// end.
struct Hung {
    world: World,
    rod: Handle<Rod>,
    top: Handle<Grip>,
}

const HUNG: f64 = 0.15;

impl Hung {
    fn new(settings: Settings, elements: usize, hold: Hold, angle: f64, kind: LoadKind) -> Self {
        let mut world = World::new(settings).unwrap();
        let end = DVec3::new(angle.sin(), 0.0, -angle.cos()) * HUNG;
        let spec = RodSpec::straight(DVec3::ZERO, end, elements, 0.225e-3, Material::elastic(2.2e9, 1140.0));
        let rod = world.insert_rod(&RodSpec { stretch: Stretch::Inextensible, ..spec }).unwrap();
        let top = world.insert_grip(&GripSpec::at_once(rod, Place::Start, hold)).unwrap();
        world.insert_load(&LoadSpec { rod, kind }).unwrap();
        Hung { world, rod, top }
    }
    /// A frame, in which it keeps its length.
    fn step(&mut self, what: &str) {
        let report = self.world.step(DT);
        assert!(report.incidents.is_empty(), "{what}: {report:?}");
        assert!(report.length_error <= 1e-5, "{what}: {:e}", report.length_error);
    }
    fn force(&self) -> DVec3 {
        self.world.grip_wrench(self.top).unwrap().force
    }
}

fn mass_at_end(mass: f64) -> LoadKind {
    LoadKind::Mass { place: Place::End, mass, inertia: DVec3::ZERO }
}

#[test]
fn a_heavy_end_swings_as_a_pendulum_does() {
    // Where it is clamped an element bends within its own length and is sheared by a tenth, which must not count as
    // length.
    for integrator in INTEGRATORS {
        for (mass, elements, hold) in [
            (0.05, 120, Hold::Clamp),
            (0.05, 120, Hold::Pin),
            (0.1, 120, Hold::Clamp),
            (1.0, 20, Hold::Clamp),
            (1.0, 120, Hold::Clamp),
            (1.0, 120, Hold::Pin),
            (1.0, 500, Hold::Clamp),
            (10.0, 120, Hold::Clamp),
        ] {
            let what = format!("{integrator:?} {mass} kg {elements} {hold:?}");
            let mut hung =
                Hung::new(Settings { integrator, ..Settings::default() }, elements, hold, PI / 4.0, mass_at_end(mass));
            let mut most = 0.0_f64;
            for f in 0..60 {
                hung.step(&what);
                if f < 2 {
                    continue;
                }
                let view = hung.world.rod(hung.rod).unwrap();
                let (x, v) = (view.positions()[elements], view.velocities()[elements]);
                let line = x / x.length();
                // Weight and turning on the line; the thread itself weighs 27 mg.
                let want = mass * (9.81 * -line.z + (v - line * v.dot(line)).length_squared() / HUNG);
                let got = -hung.force().dot(line);
                // The thread itself swings too as it is let go. The velocity of implicit Euler is that of the middle of
                // the substep, in which the line turns by up to 0.033 rad. A clamped thread bends
                // over sqrt(EI / T), 4 mm with 50 g where it turns round: from there on it is a pendulum, and its clamp
                // bears a moment.
                let bent = (2.2e9 * 0.25 * PI * 0.225e-3_f64.powi(4) / (9.81 * mass * (PI / 4.0).cos())).sqrt() / HUNG;
                let bar = if integrator == Integrator::TrBdf2 { 0.01 } else { 0.033 }
                    + if hold == Hold::Clamp { 2.0 * bent } else { 0.0 };
                assert!((got - want).abs() < bar * mass * 9.81, "{what} frame {f}: {got}, not {want}");
                most = most.max(hung.force().length());
            }
            // 3 - 2 cos 45 of its weight where nothing damps; implicit Euler does.
            let least = if integrator == Integrator::TrBdf2 { 1.56 } else { 1.4 };
            assert!(most / (9.81 * mass) > least && most / (9.81 * mass) < 1.62, "{what}: {most}");
        }
    }
}

#[test]
fn what_hangs_at_rest_is_held_at_its_length() {
    for integrator in INTEGRATORS {
        for elements in [20, 120, 500] {
            for hold in [Hold::Clamp, Hold::Pin] {
                for kind in [
                    mass_at_end(0.05),
                    mass_at_end(1.0),
                    mass_at_end(10.0),
                    LoadKind::Point { place: Place::End, force: DVec3::Z * -9.81, torque: DVec3::ZERO },
                ] {
                    let what = format!("{integrator:?} {elements} {hold:?} {kind:?}");
                    let load = if let LoadKind::Mass { mass, .. } = kind { 9.81 * mass } else { 9.81 };
                    let mut hung = Hung::new(
                        Settings { integrator, linear_damping: 0.9, ..Settings::default() },
                        elements,
                        hold,
                        0.0,
                        kind,
                    );
                    (0..20).for_each(|_| hung.step(&what));
                    // With the weight of the thread itself.
                    let weight = 9.81 * 1140.0 * PI * 0.225e-3 * 0.225e-3 * HUNG;
                    close(hung.force().z, load + weight, 1e-6, &what);
                }
            }
        }
    }
}

#[test]
fn a_jolt_that_no_thread_bears_stretches_it_and_after_it_has_its_length() {
    let mut hung = Hung::new(Settings::default(), 60, Hold::Pin, 2.6, mass_at_end(1.0));
    let (mut told, mut most) = (0, 0.0_f64);
    for _ in 0..240 {
        let report = hung.world.step(DT);
        assert!(
            report.incidents.iter().all(|i| matches!(i.kind, IncidentKind::LengthNotKept { .. })),
            "{:?}",
            report.incidents
        );
        told += report.incidents.len();
        most = most.max(hung.force().length());
    }
    // It falls 0.28 m. What an elastic thread would bear is m v omega with omega^2 = EA / (L m), 113 N.
    assert!(told > 0 && most < 113.0, "told {told} times, {most} N");
    assert!(hung.world.rod(hung.rod).unwrap().max_elongation() < 1e-5);
}
