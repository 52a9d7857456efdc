//! What must not matter does not: static answers are the same for another substep, another iteration budget and other
//! damping, and for the same thing turned, mirrored, numbered from the other end, or ten times as large.

mod support;

use core::f64::consts::{FRAC_PI_2, PI, TAU};
use support::{quiet, resample, settle, t1};
use sutura::glam::{DQuat, DVec3};
use sutura::{
    Friction, Geometry, GripSpec, Handle, Hold, LoadKind, LoadSpec, Material, Place, Pose, RestShape, Rod, RodSpec,
    Settings, ShapeSpec, Stretch, World,
};

/// The way in which a case is done. The default is plain.
#[derive(Debug, Clone, Copy)]
struct Way {
    substep: f64,
    newton_max: u32,
    linear_damping: f64,
    angular_damping: f64,
    bend_damping: f64,
    /// Turned by this in space.
    turn: DQuat,
    /// Reflected at y = 0 before that.
    mirror: bool,
    /// Particles numbered from the other end.
    reversed: bool,
    /// Lengths and times times this, stresses and densities as they are: forces grow by its square, torques by its
    /// cube, gravity falls by it.
    scale: f64,
}

const PLAIN: Way = Way {
    substep: 1.0 / 60.0,
    newton_max: 12,
    linear_damping: 0.0,
    angular_damping: 0.0,
    bend_damping: 0.01,
    turn: DQuat::IDENTITY,
    mirror: false,
    reversed: false,
    scale: 1.0,
};

impl Way {
    fn direction(&self, v: DVec3) -> DVec3 {
        self.turn * if self.mirror { DVec3::new(v.x, -v.y, v.z) } else { v }
    }
    /// Reflected, a rotation vector or torque changes sign as well.
    fn axial(&self, v: DVec3) -> DVec3 {
        self.direction(v) * if self.mirror { -1.0 } else { 1.0 }
    }
    fn point(&self, p: DVec3) -> DVec3 {
        self.direction(p) * self.scale
    }
    fn force(&self, f: DVec3) -> DVec3 {
        self.direction(f) * self.scale * self.scale
    }
    /// Results back in the plain case's axes and units.
    fn point_back(&self, p: DVec3) -> DVec3 {
        let v = self.turn.conjugate() * (p / self.scale);
        if self.mirror { DVec3::new(v.x, -v.y, v.z) } else { v }
    }
    fn force_back(&self, f: DVec3) -> DVec3 {
        self.point_back(f) / self.scale
    }
    fn torque_back(&self, t: DVec3) -> DVec3 {
        self.point_back(t) * (if self.mirror { -1.0 } else { 1.0 } / (self.scale * self.scale))
    }
    fn place(&self, place: Place) -> Place {
        match place {
            Place::Start if self.reversed => Place::End,
            Place::End if self.reversed => Place::Start,
            other => other,
        }
    }

    fn world(&self, gravity: f64, friction: f64) -> World {
        World::new(self.settings(gravity, friction)).unwrap()
    }

    fn settings(&self, gravity: f64, friction: f64) -> Settings {
        Settings {
            gravity: self.direction(DVec3::NEG_Z * gravity) / self.scale,
            substep: self.substep * self.scale,
            newton_max: self.newton_max,
            // Rates per second.
            linear_damping: 1.0 - (1.0 - self.linear_damping).powf(1.0 / self.scale),
            angular_damping: 1.0 - (1.0 - self.angular_damping).powf(1.0 / self.scale),
            friction: Friction::coulomb(friction),
            ..quiet()
        }
    }

    /// A thread of the T1 material through points given for the plain case.
    fn thread(
        &self,
        world: &mut World,
        points: &[DVec3],
        bend_scale: f64,
        stretch: Stretch,
        rest: RestShape,
    ) -> Handle<Rod> {
        let (material, radius) = t1();
        let material = Material { bend_scale, bend_damping: self.bend_damping * self.scale, ..material };
        let mut points: Vec<DVec3> = points.iter().map(|p| self.point(*p)).collect();
        if self.reversed {
            points.reverse();
        }
        world.insert_rod(&RodSpec { stretch, rest, ..RodSpec::new(points, radius * self.scale, material) }).unwrap()
    }

    fn settle(&self, world: &mut World) {
        settle(world, 0.1 * self.scale, 1e-7, 400.0 * self.scale);
    }

    fn positions(&self, world: &World, rod: Handle<Rod>) -> Vec<DVec3> {
        let mut points: Vec<DVec3> = world.rod(rod).unwrap().positions().iter().map(|p| self.point_back(*p)).collect();
        if self.reversed {
            points.reverse();
        }
        points
    }
}

/// Answers of a case: what is compared, and the size that a difference is measured by.
type Answers = Vec<(&'static str, DVec3, f64)>;

/// Cantilever of 50 mm under a tip load, large deflection, with a part across so that it leaves the plane.
fn cantilever_under_tip_load(way: &Way) -> Answers {
    let length = 0.05;
    let mut world = way.world(0.0, 0.3);
    let points: Vec<DVec3> = (0..=40).map(|i| DVec3::X * (length * f64::from(i) / 40.0)).collect();
    let rod = way.thread(&mut world, &points, 1.0, Stretch::Elastic, RestShape::Straight);
    let clamp = world.insert_grip(&GripSpec::at_once(rod, way.place(Place::Start), Hold::Clamp)).unwrap();
    // P L^2 / EI = 3 down and 1 across.
    let unit = 7.952_16e-7 / (length * length);
    let force = way.force(DVec3::new(0.0, unit, -3.0 * unit));
    world
        .insert_load(&LoadSpec {
            rod,
            kind: LoadKind::Point { place: way.place(Place::End), force, torque: DVec3::ZERO },
        })
        .unwrap();
    way.settle(&mut world);
    let tip = way.positions(&world, rod)[40];
    let root = world.grip_wrench(clamp).unwrap();
    let deflection = (tip - DVec3::X * length).length();
    vec![
        ("tip", tip, deflection),
        ("root force", way.force_back(root.force), 3.0 * unit),
        ("root moment", way.torque_back(root.torque), 3.0 * unit * length),
    ]
}

/// Cantilever of 100 mm under its own weight.
fn cantilever_under_self_weight(way: &Way) -> Answers {
    let length = 0.1;
    let mut world = way.world(9.81, 0.3);
    let points: Vec<DVec3> = (0..=40).map(|i| DVec3::X * (length * f64::from(i) / 40.0)).collect();
    let rod = way.thread(&mut world, &points, 1.0, Stretch::Elastic, RestShape::Straight);
    let clamp = world.insert_grip(&GripSpec::at_once(rod, way.place(Place::Start), Hold::Clamp)).unwrap();
    way.settle(&mut world);
    let tip = way.positions(&world, rod)[40];
    let root = world.grip_wrench(clamp).unwrap();
    vec![
        ("tip", tip, 12.4e-3),
        ("root force", way.force_back(root.force), 8.13e-5 * 9.81 * length),
        ("root moment", way.torque_back(root.torque), 8.13e-5 * 9.81 * length * length / 2.0),
    ]
}

/// A limp thread of 150 mm between two pins 100 mm apart and 10 mm different in height, inextensible.
fn catenary(way: &Way) -> Answers {
    let mut world = way.world(9.81, 0.3);
    let fine: Vec<DVec3> = (0..=200)
        .map(|i| {
            let s = f64::from(i) / 200.0;
            DVec3::new(0.1 * s, 0.0, 0.01 * s - 4.0 * 0.048 * s * (1.0 - s))
        })
        .collect();
    let points = resample(&fine, 40);
    let rod = way.thread(&mut world, &points, 0.01, Stretch::Inextensible, RestShape::Straight);
    let pins = [Place::Start, Place::End]
        .map(|p| world.insert_grip(&GripSpec::at_once(rod, way.place(p), Hold::Pin)).unwrap());
    way.settle(&mut world);
    let lowest = way.positions(&world, rod)[20];
    let [a, b] = pins.map(|p| way.force_back(world.grip_wrench(p).unwrap().force));
    vec![("middle", lowest, 0.048), ("force at the start", a, a.length()), ("force at the end", b, b.length())]
}

/// Clamped at both ends, 100 mm, twisted by 1.5 turns and sagging by its weight: twist takes the sag out of the plane.
fn clamped_twist(way: &Way) -> Answers {
    let length = 0.1;
    let mut world = way.world(9.81, 0.3);
    let points: Vec<DVec3> = (0..=40).map(|i| DVec3::X * (length * f64::from(i) / 40.0)).collect();
    let rod = way.thread(&mut world, &points, 1.0, Stretch::Elastic, RestShape::Straight);
    let left = world.insert_grip(&GripSpec::at_once(rod, way.place(Place::Start), Hold::Clamp)).unwrap();
    let right = world.insert_grip(&GripSpec::at_once(rod, way.place(Place::End), Hold::Clamp)).unwrap();
    let pose = world.grip_pose(right).unwrap();
    let axis = way.axial(DVec3::X);
    for i in 1..=50 {
        let turn = DQuat::from_axis_angle(axis, TAU * 1.5 * f64::from(i) / 50.0);
        world.set_grip_pose(right, Pose::new(pose.position, (turn * pose.orientation).normalize())).unwrap();
        world.step(0.02 * way.scale);
    }
    way.settle(&mut world);
    let middle = way.positions(&world, rod)[20];
    let [a, b] = [left, right].map(|g| way.torque_back(world.grip_wrench(g).unwrap().torque));
    // Sag without twist: q L^4 / (384 EI) = 0.26 mm.
    vec![("middle", middle, 0.26e-3), ("torque at the start", a, a.length()), ("torque at the end", b, b.length())]
}

/// Over a cylinder of 10 mm, limp and formed to it, put there under small weights on rough surfaces, which is the same
/// for all ways of solving: what friction carries depends on how the load came. Then the surfaces become smooth, and
/// the weights 5 and 7 mN: a ratio of 1.4, where friction 0.3 could hold exp(0.3 pi) = 2.57.
fn over_a_cylinder(way: &Way) -> Answers {
    let first = Way { turn: way.turn, mirror: way.mirror, reversed: way.reversed, scale: way.scale, ..PLAIN };
    let mut world = first.world(9.81, 1.0);
    let radius = 5e-3;
    let pose = Pose::new(DVec3::ZERO, (way.turn * DQuat::from_rotation_x(FRAC_PI_2)).normalize());
    world
        .insert_shape(&ShapeSpec::fixed(
            Geometry::Cylinder { radius: radius * way.scale, half_length: 0.01 * way.scale },
            pose,
        ))
        .unwrap();
    let r = radius + 1.04 * 0.15e-3;
    let mut path = vec![DVec3::new(-r, 0.0, -0.02)];
    path.extend((0..=60).map(|i| DQuat::from_rotation_y(PI * f64::from(i) / 60.0) * DVec3::NEG_X * r));
    path.push(DVec3::new(r, 0.0, -0.015));
    let rod = first.thread(&mut world, &resample(&path, 60), 0.01, Stretch::Elastic, RestShape::AsInserted);
    let pulls = [(Place::Start, 5e-3), (Place::End, 7e-3)];
    let kind = |(place, f): (Place, f64), part: f64| LoadKind::Point {
        place: way.place(place),
        force: way.force(DVec3::NEG_Z * (f * part)),
        torque: DVec3::ZERO,
    };
    let loads = pulls.map(|pull| world.insert_load(&LoadSpec { rod, kind: kind(pull, 0.05) }).unwrap());
    // While it is put down a substep may not converge (this test is of rest; how to get there is another one's).
    world.step(0.1 * way.scale);
    way.settle(&mut world);
    world.set_settings(way.settings(9.81, 0.3)).unwrap();
    for i in 1..=20 {
        for (load, pull) in loads.iter().zip(pulls) {
            world.set_load(*load, kind(pull, f64::from(i) / 20.0)).unwrap();
        }
        world.step(0.05 * way.scale);
    }
    // It has to hold: it may not pass for settled before it has had time to creep.
    for _ in 0..100 {
        world.step(0.1 * way.scale);
    }
    let points = way.positions(&world, rod);
    let carried = way.force_back(world.contacts().map(|c| c.force).sum::<DVec3>());
    vec![("light end", points[0], 0.02), ("heavy end", points[60], 0.015), ("contact force", carried, 12e-3)]
}

/// Largest difference of two sets of answers, relative to their sizes, and where. What is not a number is the largest.
fn difference(a: &Answers, b: &Answers) -> (f64, &'static str) {
    let parts = a.iter().zip(b).map(|((name, p, size), (_, q, _))| (((*p - *q).length() / size).abs(), *name));
    parts.max_by(|x, y| x.0.total_cmp(&y.0)).expect("a case has answers")
}

/// Ways of solving and of damping, none of which has a part in rest.
fn numerics() -> Vec<(&'static str, Way)> {
    vec![
        ("half the substep", Way { substep: 0.5 * PLAIN.substep, ..PLAIN }),
        ("a quarter of the substep", Way { substep: 0.25 * PLAIN.substep, ..PLAIN }),
        ("twice the iterations", Way { newton_max: 2 * PLAIN.newton_max, ..PLAIN }),
        ("linear damping", Way { linear_damping: 0.9, ..PLAIN }),
        ("angular damping", Way { angular_damping: 0.9, ..PLAIN }),
        ("both", Way { linear_damping: 0.5, angular_damping: 0.99, ..PLAIN }),
    ]
}

/// Kelvin-Voigt damping is of the material and not to be changed while a world runs.
fn kelvin_voigt() -> Vec<(&'static str, Way)> {
    vec![
        ("no Kelvin-Voigt", Way { bend_damping: 0.0, ..PLAIN }),
        ("five times Kelvin-Voigt", Way { bend_damping: 0.05, ..PLAIN }),
    ]
}

/// The same thing otherwise placed, numbered or sized.
fn symmetries() -> Vec<(&'static str, Way)> {
    let turn = DQuat::from_scaled_axis(DVec3::new(0.7, -1.1, 2.0)).normalize();
    vec![
        ("turned", Way { turn, ..PLAIN }),
        ("mirrored", Way { mirror: true, ..PLAIN }),
        ("reversed", Way { reversed: true, ..PLAIN }),
        ("ten times as large", Way { scale: 10.0, ..PLAIN }),
        ("all of it", Way { turn, mirror: true, reversed: true, scale: 10.0, ..PLAIN }),
    ]
}

/// Compares all the ways with the plain one.
fn compare(case: impl Fn(&Way) -> Answers, ways: &[(&'static str, Way)], tolerance: f64) {
    let plain = case(&PLAIN);
    let off: Vec<String> = ways
        .iter()
        .map(|(name, way)| (name, difference(&plain, &case(way))))
        .inspect(|(name, (d, what))| println!("{name}: {what} differs by {d:.1e}"))
        .filter(|(_, (d, _))| d.is_nan() || *d >= tolerance)
        .map(|(name, (d, what))| format!("{name}: {what} differs by {d:.1e}"))
        .collect();
    assert!(off.is_empty(), "beyond {tolerance:e}: {off:?}");
}

/// The bar is 1e-3. Rest is reached to 1e-7 m/s and answers then differ by 2e-6 at most, by 1e-7 without friction.
const NUMERICS: f64 = 1e-4;
/// The same sums in another order.
const SYMMETRY: f64 = 1e-5;

#[test]
fn tip_load_whatever_the_numerics() {
    compare(cantilever_under_tip_load, &numerics(), NUMERICS);
    compare(cantilever_under_tip_load, &kelvin_voigt(), NUMERICS);
}
#[test]
fn tip_load_whatever_the_view() {
    compare(cantilever_under_tip_load, &symmetries(), SYMMETRY);
}
#[test]
fn self_weight_whatever_the_numerics() {
    compare(cantilever_under_self_weight, &numerics(), NUMERICS);
    compare(cantilever_under_self_weight, &kelvin_voigt(), NUMERICS);
}
#[test]
fn self_weight_whatever_the_view() {
    compare(cantilever_under_self_weight, &symmetries(), SYMMETRY);
}
#[test]
fn catenary_whatever_the_numerics() {
    compare(catenary, &numerics(), NUMERICS);
    compare(catenary, &kelvin_voigt(), NUMERICS);
}
#[test]
fn catenary_whatever_the_view() {
    compare(catenary, &symmetries(), SYMMETRY);
}
#[test]
fn clamped_twist_whatever_the_numerics() {
    compare(clamped_twist, &numerics(), NUMERICS);
    compare(clamped_twist, &kelvin_voigt(), NUMERICS);
}
#[test]
fn clamped_twist_whatever_the_view() {
    compare(clamped_twist, &symmetries(), SYMMETRY);
}
#[test]
fn over_a_cylinder_whatever_the_numerics() {
    compare(over_a_cylinder, &numerics(), NUMERICS);
}
#[test]
fn over_a_cylinder_whatever_the_view() {
    // Friction at a particle turns the element after it: numbered from the other end, the one before. First order in
    // the elements, which are a twelfth of the arc that they touch.
    compare(over_a_cylinder, &symmetries(), 1e-4);
}

#[test]
fn the_cases_are_what_they_say() {
    // So that agreement is not that of two worlds in which nothing happens.
    let tip = cantilever_under_tip_load(&PLAIN)[0].1;
    assert!(tip.x < 0.045 && tip.y > 5e-3 && tip.z < -0.02, "{tip}");
    let tip = cantilever_under_self_weight(&PLAIN)[0].1;
    assert!((tip.z / -12.38e-3 - 1.0).abs() < 0.01, "{tip}");
    let answers = catenary(&PLAIN);
    let weight = 8.128_87e-5 * 9.81 * 0.15;
    assert!(((answers[1].1 + answers[2].1).z / weight - 1.0).abs() < 0.05 && answers[0].1.z < -0.03, "{answers:?}");
    let answers = clamped_twist(&PLAIN);
    assert!((answers[2].1.x / (5.680_11e-7 * TAU * 1.5 / 0.1) - 1.0).abs() < 0.02, "{answers:?}");
    assert!(answers[0].1.z < -1e-4, "{answers:?}");
    let answers = over_a_cylinder(&PLAIN);
    // The contacts carry both weights and the thread's own.
    let own = 8.128_87e-5 * 9.81 * 0.0511;
    assert!((answers[2].1.z / (12e-3 + own) - 1.0).abs() < 0.01, "{answers:?}");
}
