//! Friction that sticks and slides, by pair of surfaces: a thread on an inclined plane, and a thread across two others.

mod support;

use support::t1;
use sutura::glam::{DQuat, DVec3};
use sutura::{
    ContactSide, Friction, Geometry, GripSpec, Handle, Hold, Material, Place, Pose, Rod, RodSpec, Settings, Shape,
    ShapeSpec, World,
};

const G: f64 = 9.81;
const DT: f64 = 1.0 / 60.0;
/// Distance from a surface at which a thread lies, over its radius: contacts keep a fiftieth of the diameter in
/// reserve.
const LIES_AT: f64 = 1.04;

/// Unit vectors down a slope about the y axis and out of it.
fn slope(angle: f64) -> (DVec3, DVec3) {
    let turn = DQuat::from_rotation_y(angle);
    (turn * DVec3::X, turn * DVec3::Z)
}

/// Settings with another friction between all surfaces than the one that a test sets for a pair.
fn settings(elsewhere: f64) -> Settings {
    Settings { friction: Friction::coulomb(elsewhere), ..Settings::default() }
}

/// Holds whatever lies on it.
const ROUGH: Friction = Friction { stick: 9.0, slide: 9.0 };

/// Lets things come to rest on rough surfaces, then sets the friction of the pair: it starts from forces that differ
/// from contact to contact, some beyond the limit then.
fn rest(world: &mut World, pair: (u32, u32), friction: Friction) {
    world.set_friction(pair.0, pair.1, ROUGH).unwrap();
    for _ in 0..30 {
        let report = world.step(DT);
        assert!(report.incidents.is_empty(), "{:?}", report.incidents);
    }
    world.set_friction(pair.0, pair.1, friction).unwrap();
}

/// A thread of 10 mm in five elements, along the slope of a plane of the given angle.
struct Incline {
    world: World,
    rod: Handle<Rod>,
    plane: Handle<Shape>,
    down: DVec3,
    out: DVec3,
    radius: f64,
    weight: f64,
}

impl Incline {
    fn new(angle: f64, friction: Friction) -> Self {
        let (material, radius) = t1();
        let (down, out) = slope(angle);
        // The pair (4, 7) has the friction; whatever else would be taken is far off.
        let mut world = World::new(settings(if friction.stick > 0.1 { 0.0 } else { 5.0 })).unwrap();
        world.set_friction(4, 4, ROUGH).unwrap();
        world.set_friction(7, 7, ROUGH).unwrap();
        let pose = Pose::new(DVec3::ZERO, DQuat::from_rotation_y(angle));
        let plane = world.insert_shape(&ShapeSpec { surface: 7, ..ShapeSpec::fixed(Geometry::Plane, pose) }).unwrap();
        let from = out * (LIES_AT * radius);
        let rod = world
            .insert_rod(&RodSpec { surface: 4, ..RodSpec::straight(from, from + down * 0.01, 5, radius, material) })
            .unwrap();
        let weight = world.rod(rod).unwrap().rest_length() * 8.128_87e-5 * G;
        rest(&mut world, (7, 4), friction);
        Incline { world, rod, plane, down, out, radius, weight }
    }

    /// Way and speed of the middle of the thread down the slope.
    fn middle(&self) -> (f64, f64) {
        let view = self.world.rod(self.rod).unwrap();
        let mean = |v: &[DVec3]| v.iter().sum::<DVec3>().dot(self.down) / v.len() as f64;
        (mean(view.positions()), mean(view.velocities()))
    }

    /// Largest distance of a particle from the place over the plane where it lies, over the radius.
    fn lift(&self) -> f64 {
        let view = self.world.rod(self.rod).unwrap();
        view.positions().iter().map(|p| (p.dot(self.out) / self.radius - LIES_AT).abs()).fold(0.0, f64::max)
    }

    /// Steps once; nothing may go wrong.
    fn step(&mut self) {
        let report = self.world.step(DT);
        assert!(report.incidents.is_empty(), "{:?}", report.incidents);
    }

    /// Number of contacts, and their normal force and force up the slope, over the weight.
    fn carried(&self) -> (usize, f64, f64) {
        let (mut count, mut normal, mut up) = (0, 0.0, 0.0);
        for c in self.world.contacts() {
            assert_eq!(c.b, ContactSide::Shape { shape: self.plane.index() });
            count += 1;
            normal += c.force.dot(self.out) / self.weight;
            up -= c.force.dot(self.down) / self.weight;
        }
        (count, normal, up)
    }
}

#[test]
fn a_thread_on_a_plane_holds_for_a_minute_just_under_the_limit() {
    for mu in [0.05, 0.3, 0.6] {
        let angle = f64::atan(0.97 * mu);
        let mut it = Incline::new(angle, Friction::coulomb(mu));
        let (start, _) = it.middle();
        let mut farthest = 0.0f64;
        for _ in 0..3600 {
            it.step();
            farthest = farthest.max((it.middle().0 - start).abs());
        }
        assert!(farthest < 1e-5, "mu {mu}: crept {farthest:e} m");
        let (count, normal, up) = it.carried();
        // Balance of the whole thread at rest: forces of the contacts against its weight.
        assert!(
            count == 6 && (normal / angle.cos() - 1.0).abs() < 1e-3 && (up / angle.sin() - 1.0).abs() < 1e-3,
            "{count} {normal} {up}"
        );
    }
}

#[test]
fn a_thread_put_down_on_a_plane_holds_from_the_first_substep() {
    // It touches without speed and without force: the first substep has to find both forces at once.
    let (material, radius) = t1();
    let mut came = Vec::new();
    for (mu, part) in [(0.05, 0.97), (0.3, 0.97), (0.6, 0.97), (0.5, 0.6)] {
        let angle = f64::atan(part * mu);
        let (down, out) = slope(angle);
        let mut world = World::new(settings(mu)).unwrap();
        world
            .insert_shape(&ShapeSpec::fixed(Geometry::Plane, Pose::new(DVec3::ZERO, DQuat::from_rotation_y(angle))))
            .unwrap();
        let from = out * (LIES_AT * radius);
        let rod = world.insert_rod(&RodSpec::straight(from, from + down * 0.01, 5, radius, material.clone())).unwrap();
        for _ in 0..60 {
            world.step(DT);
        }
        came.push((world.rod(rod).unwrap().positions()[0] - from).dot(down));
    }
    assert!(came.iter().all(|c| c.abs() < 1e-5), "slid {came:?} m");
}

#[test]
fn a_thread_on_a_plane_slides_just_over_the_limit_and_stays_on_it() {
    for mu in [0.05, 0.3, 0.6] {
        let angle = f64::atan(1.03 * mu);
        let mut it = Incline::new(angle, Friction::coulomb(mu));
        let want = G * (angle.sin() - mu * angle.cos());
        for _ in 0..12 {
            it.step();
        }
        let (_, before) = it.middle();
        let mut lift = 0.0f64;
        for _ in 0..48 {
            it.step();
            lift = lift.max(it.lift());
            let (count, normal, _) = it.carried();
            assert!(
                count == 6 && (normal / angle.cos() - 1.0).abs() < 0.01,
                "mu {mu}: {count} contacts carry {normal} of the weight"
            );
        }
        let got = (it.middle().1 - before) / (48.0 * DT);
        assert!((got / want - 1.0).abs() < 0.02, "mu {mu}: accelerates by {got}, wanted {want}");
        assert!(lift < 1e-3, "mu {mu}: moved {lift} radii from the plane");
    }
}

#[test]
fn it_starts_beyond_the_static_and_slides_by_the_kinetic_coefficient() {
    let friction = Friction { stick: 0.4, slide: 0.2 };
    let mut holds = Incline::new(f64::atan(0.97 * friction.stick), friction);
    let (start, _) = holds.middle();
    for _ in 0..300 {
        holds.step();
    }
    assert!((holds.middle().0 - start).abs() < 1e-5, "crept {:e} m", holds.middle().0 - start);

    let angle = f64::atan(1.03 * friction.stick);
    let mut slides = Incline::new(angle, friction);
    let want = G * (angle.sin() - friction.slide * angle.cos());
    for _ in 0..12 {
        slides.step();
    }
    let (_, before) = slides.middle();
    for _ in 0..24 {
        slides.step();
    }
    let got = (slides.middle().1 - before) / (24.0 * DT);
    assert!((got / want - 1.0).abs() < 0.02, "accelerates by {got}, wanted {want}");
    assert!(slides.lift() < 1e-3, "moved {} radii from the plane", slides.lift());
}

/// Two taut threads down a slope, 4 mm apart, and a light one of 6 mm laid across them.
struct Frame {
    world: World,
    light: Handle<Rod>,
    down: DVec3,
    out: DVec3,
    weight: f64,
}

impl Frame {
    fn new(angle: f64, friction: Friction) -> Self {
        let (material, radius) = t1();
        let (down, out) = slope(angle);
        let mut world = World::new(settings(if friction.stick > 0.1 { 0.0 } else { 5.0 })).unwrap();
        world.set_friction(3, 3, ROUGH).unwrap();
        for y in [-2e-3, 2e-3] {
            let from = DVec3::Y * y;
            let rail =
                RodSpec { surface: 3, ..RodSpec::straight(from, from + down * 0.015, 10, radius, material.clone()) };
            let rail = world.insert_rod(&rail).unwrap();
            for place in [Place::Start, Place::End] {
                let grip = world.insert_grip(&GripSpec::at_once(rail, place, Hold::Clamp)).unwrap();
                if place == Place::End {
                    // Taut: a thousandth longer, 0.14 N. Its own weight then bends it by 0.2 micrometers.
                    let pose = world.grip_pose(grip).unwrap();
                    world.set_grip_pose(grip, Pose::new(pose.position + down * 15e-6, pose.orientation)).unwrap();
                }
            }
        }
        // A fifth of the density of the rails, half their radius.
        let thin = 0.5 * radius;
        let material = Material { density: 0.2 * material.density, ..material };
        // Threads keep a fiftieth of the sum of radii in reserve.
        let at = down * 2.25e-3 + out * (1.02 * (radius + thin));
        let spec = RodSpec::straight(at - DVec3::Y * 3e-3, at + DVec3::Y * 3e-3, 6, thin, material.clone());
        let light = world.insert_rod(&RodSpec { surface: 8, ..spec }).unwrap();
        let weight = 6e-3 * material.density * core::f64::consts::PI * thin * thin * G;
        rest(&mut world, (3, 8), friction);
        Frame { world, light, down, out, weight }
    }

    fn middle(&self) -> (f64, f64) {
        let view = self.world.rod(self.light).unwrap();
        let mean = |v: &[DVec3]| v.iter().sum::<DVec3>().dot(self.down) / v.len() as f64;
        (mean(view.positions()), mean(view.velocities()))
    }

    fn step(&mut self) -> f64 {
        let report = self.world.step(DT);
        assert!(report.incidents.is_empty(), "{:?}", report.incidents);
        report.thread_clearance.expect("the light thread has left the rails")
    }

    /// Normal force and force up the slope on the light thread, over its weight.
    fn carried(&self) -> (f64, f64) {
        // The light thread has the higher slot, so it is the other side of each contact.
        let on_light = self.world.contacts().map(|c| -c.force).sum::<DVec3>() / self.weight;
        (on_light.dot(self.out), -on_light.dot(self.down))
    }
}

#[test]
fn a_thread_across_threads_holds_for_a_minute_just_under_the_limit() {
    for mu in [0.05, 0.3] {
        let angle = f64::atan(0.97 * mu);
        let mut it = Frame::new(angle, Friction::coulomb(mu));
        let (start, _) = it.middle();
        let mut farthest = 0.0f64;
        for _ in 0..3600 {
            it.step();
            farthest = farthest.max((it.middle().0 - start).abs());
        }
        // The rails were stretched by 15 micrometers at their end: what lies on them goes along by two or three.
        assert!(farthest < 1e-5, "mu {mu}: crept {farthest:e} m");
        let (normal, up) = it.carried();
        assert!((normal / angle.cos() - 1.0).abs() < 0.01 && (up / angle.sin() - 1.0).abs() < 0.01, "{normal} {up}");
    }
}

#[test]
fn a_thread_across_threads_slides_just_over_the_limit_and_stays_on_them() {
    for mu in [0.05, 0.3] {
        let angle = f64::atan(1.03 * mu);
        let mut it = Frame::new(angle, Friction::coulomb(mu));
        let want = G * (angle.sin() - mu * angle.cos());
        for _ in 0..6 {
            it.step();
        }
        let (from, before) = it.middle();
        let (mut nearest, mut apart, mut normal, mut steps) = (f64::INFINITY, f64::NEG_INFINITY, 0.0, 0);
        // Until it has come 8 mm, over five elements of the rails.
        while it.middle().0 < from + 8e-3 {
            let clearance = it.step();
            nearest = nearest.min(clearance);
            apart = apart.max(clearance);
            normal += it.carried().0;
            steps += 1;
            assert!(steps < 200, "mu {mu}: came {:e} m", it.middle().0 - from);
        }
        let got = (it.middle().1 - before) / (f64::from(steps) * DT);
        assert!((got / want - 1.0).abs() < 0.02, "mu {mu}: accelerates by {got}, wanted {want}");
        // The reserve is a fiftieth of a diameter; a hundredth of it more would be lift.
        assert!(nearest > -0.01 && apart < 0.03, "mu {mu}: clearance from {nearest} to {apart} diameters");
        assert!(
            (normal / f64::from(steps) / angle.cos() - 1.0).abs() < 0.02,
            "mu {mu}: carries {} of the weight",
            normal / f64::from(steps)
        );
    }
}

#[test]
fn a_thread_across_threads_starts_beyond_the_static_and_slides_by_the_kinetic_coefficient() {
    let friction = Friction { stick: 0.4, slide: 0.2 };
    let mut holds = Frame::new(f64::atan(0.97 * friction.stick), friction);
    let (start, _) = holds.middle();
    for _ in 0..300 {
        holds.step();
    }
    assert!((holds.middle().0 - start).abs() < 1e-5, "crept {:e} m", holds.middle().0 - start);

    let angle = f64::atan(1.03 * friction.stick);
    let mut slides = Frame::new(angle, friction);
    let want = G * (angle.sin() - friction.slide * angle.cos());
    for _ in 0..2 {
        slides.step();
    }
    let (from, before) = slides.middle();
    let mut steps = 0;
    while slides.middle().0 < from + 6e-3 {
        slides.step();
        steps += 1;
        assert!(steps < 60, "came {:e} m", slides.middle().0 - from);
    }
    let got = (slides.middle().1 - before) / (f64::from(steps) * DT);
    assert!((got / want - 1.0).abs() < 0.02, "accelerates by {got}, wanted {want}");
}

#[test]
fn the_pair_of_surfaces_decides() {
    // Two threads of different surfaces on one plane; then with the surfaces exchanged.
    let (material, radius) = t1();
    let angle = f64::atan(0.3);
    let (down, out) = slope(angle);
    for (a, b) in [(1, 2), (2, 1)] {
        let mut world = World::new(settings(0.3)).unwrap();
        world.set_friction(1, 9, ROUGH).unwrap();
        let plane = ShapeSpec {
            surface: 9,
            ..ShapeSpec::fixed(Geometry::Plane, Pose::new(DVec3::ZERO, DQuat::from_rotation_y(angle)))
        };
        world.insert_shape(&plane).unwrap();
        let rods = [(a, -5e-3), (b, 5e-3)].map(|(surface, y)| {
            let from = out * (LIES_AT * radius) + DVec3::Y * y;
            let spec = RodSpec::straight(from, from + down * 0.01, 5, radius, material.clone());
            (surface, from, world.insert_rod(&RodSpec { surface, ..spec }).unwrap())
        });
        rest(&mut world, (9, 2), Friction::coulomb(0.1));
        world.set_friction(9, 1, Friction::coulomb(0.5)).unwrap();
        for _ in 0..30 {
            world.step(DT);
        }
        for (surface, from, rod) in rods {
            let came = (world.rod(rod).unwrap().positions()[0] - from).dot(down);
            // With 0.1 it accelerates by 1.88 m/s^2: 23 cm in half a second.
            assert!(
                if surface == 1 { came.abs() < 1e-5 } else { (0.2..0.26).contains(&came) },
                "surface {surface} came {came} m"
            );
        }
    }
}
