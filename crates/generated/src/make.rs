//! Draws scenes: sensible ones, of threads as they are used, and absurd ones, of numbers that are finite and nothing
//! else.

use crate::draw::Draw;
use crate::scene::{Act, Held, Joined, Reeled, Scene, elements};
use core::f64::consts::{FRAC_PI_2, TAU};
use sutura::glam::{DQuat, DVec3};
use sutura::{
    Along, Closure, Drive, Friction, Geometry, Hold, Integrator, LoadKind, Material, Place, Plasticity, Pose, Profile,
    ReelLaw, RestShape, RodSpec, Section, Settings, ShapeMotion, ShapeSpec, Shear, Stretch, WeldRest,
    transported_frames,
};

/// Which sensible scenes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Threads far from each other, held, loaded and moved: nothing touches.
    Free,
    /// The same, and nothing does work from outside.
    FreePassive,
    /// Threads that fall onto a shape and onto each other; nothing does work from outside.
    Touching,
    /// The same, with grips that move and shapes that are driven and pushed.
    Worked,
}

/// A centerline given by a formula, so that it can be cut into any number of elements.
#[derive(Debug, Clone, Copy)]
pub struct Curve {
    kind: u32,
    length: f64,
    angle: f64,
    rise: f64,
    waves: [DVec3; 2],
}

impl Curve {
    /// Straight, arc, helix or waves; `flat` keeps it in the plane z = 0 and from crossing itself.
    fn draw(d: &mut Draw, flat: bool) -> Self {
        let kind = d.whole(0, 3);
        let length = d.log(0.02, 0.06);
        let angle = d.even(0.5, 4.0);
        let rise = if flat { 0.0 } else { d.even(0.3, 0.8) };
        let mut wave = |size: f64| {
            let v = d.vector(size);
            if flat { DVec3::new(0.0, v.y, 0.0) } else { DVec3::new(0.0, v.y, v.z) }
        };
        Curve { kind, length, angle, rise, waves: [wave(0.08), wave(0.03)] }
    }

    fn at(&self, s: f64) -> DVec3 {
        let l = self.length;
        match self.kind {
            0 => DVec3::X * (l * s),
            1 | 2 => {
                // An arc; with a rise it is a helix.
                let radius = l / self.angle;
                let rise = if self.kind == 2 { self.rise * l * s } else { 0.0 };
                let (sin, cos) = libm::sincos(self.angle * s);
                DVec3::new(radius * sin, radius * (1.0 - cos), rise)
            }
            _ => {
                let wave = |k: f64| libm::sin(TAU * k * s);
                DVec3::X * (l * s) + (self.waves[0] * wave(1.0) + self.waves[1] * wave(2.0)) * l
            }
        }
    }

    /// `n + 1` points along it.
    pub fn points(&self, n: usize) -> Vec<DVec3> {
        (0..=n).map(|i| self.at(i as f64 / n as f64)).collect()
    }
}

/// Points of a centerline as a thread, with explicit frames, moved and turned.
fn rod(points: &[DVec3], place: Pose, radius: f64, material: Material) -> RodSpec {
    let centerline: Vec<DVec3> = points.iter().map(|p| place.transform_point(*p)).collect();
    let frames = transported_frames(&centerline, place.orientation * DVec3::Z);
    RodSpec { frames: Some(frames), ..RodSpec::new(centerline, radius, material) }
}

fn material(d: &mut Draw) -> Material {
    Material {
        young_modulus: d.log(2e9, 1e8),
        shear: if d.chance(0.3) { Shear::Modulus(d.log(7e8, 5e7)) } else { Shear::Poisson(d.even(0.4, 0.2)) },
        density: d.even(1150.0, 1600.0),
        bend_scale: d.log(1.0, 0.02),
        bend_damping: if d.chance(0.5) { d.log(0.01, 0.001) } else { 0.0 },
        plasticity: None,
    }
}

/// The engine's settings as they may sensibly be, gravity along `down`.
fn settings(d: &mut Draw, down: DVec3) -> Settings {
    let damping = d.chance(0.5);
    Settings {
        gravity: down * if d.chance(0.2) { 0.0 } else { 9.81 },
        substep: d.log(1.0 / 240.0, 1.0 / 960.0),
        linear_damping: if damping { d.even(0.0, 0.9) } else { 0.0 },
        angular_damping: if damping { d.even(0.0, 0.9) } else { 0.0 },
        friction: friction(d),
        // What is stuck takes twice the attempts for each.
        halvings: 6,
        integrator: if d.chance(0.3) { Integrator::TrBdf2 } else { Integrator::ImplicitEuler },
        ..Settings::default()
    }
}

fn friction(d: &mut Draw) -> Friction {
    let stick = d.even(0.3, 0.0);
    Friction { stick, slide: stick * d.even(1.0, 0.5) }
}

/// A sensible scene. All of it is turned at random.
pub fn sensible(d: &mut Draw, kind: Kind) -> Scene {
    let touching = matches!(kind, Kind::Touching | Kind::Worked);
    let passive = matches!(kind, Kind::FreePassive | Kind::Touching);
    let whole = d.turn();
    let n_rods = d.whole(1, if touching { 3 } else { 2 }) as usize;
    let down = if touching { DVec3::NEG_Z } else { d.direction() };
    let mut scene = Scene {
        settings: settings(d, down),
        frictions: vec![(0, 1, friction(d)), (1, 1, friction(d))],
        rods: Vec::new(),
        welds: Vec::new(),
        reels: Vec::new(),
        shapes: Vec::new(),
        grips: Vec::new(),
        loads: Vec::new(),
        frame: 1.0 / 60.0,
        frames: d.whole(8, 24),
        acts: Vec::new(),
        other_order: false,
    };
    let mut height = 0.0;
    for number in 0..n_rods {
        let mut radius = d.log(0.15e-3, 0.4e-3);
        let mut curve = Curve::draw(d, touching);
        let n = d.whole(4, ((curve.length / (2.5 * radius)) as u32).min(30)) as usize;
        let closed = n >= 8 && d.chance(0.2);
        let joined = number > 0 && !closed && d.chance(0.4);
        // A thread that goes on from another one leaves it behind.
        curve.kind = if joined { 0 } else { curve.kind };
        let points = if closed { ring(curve.length, n) } else { curve.points(n) };
        let section = if d.chance(0.3) { flat_section(d, radius) } else { Section::Round };
        if let Some(half_width) = section.half_width() {
            radius = half_width;
        }
        height += radius * d.even(1.2, 4.0);
        let middle = points[n / 2];
        let place = if touching {
            let turn = DQuat::from_rotation_z(d.even(0.0, TAU)).normalize();
            Pose::new(DVec3::Z * height - turn * middle, turn)
        } else {
            Pose::new(DVec3::Y * (0.2 * number as f64), d.turn())
        };
        height += radius;
        let parent = if joined { join(d, &mut scene, number, touching) } else { None };
        let mut spec = rod(&points, parent.unwrap_or(place), radius, material(d));
        if closed {
            // The last point was for the last frame.
            spec.centerline.pop();
            spec.closure = Some(Closure { twist: d.signed() * 6.0 });
        }
        spec.section = section;
        spec.surface = d.whole(0, 1);
        spec.stretch = if d.chance(0.4) { Stretch::Inextensible } else { Stretch::Elastic };
        spec.rest = match d.whole(0, 3) {
            0 | 1 => RestShape::AsInserted,
            2 if curve.kind == 0 || curve.angle < 2.0 => RestShape::Straight,
            _ => {
                let bend = d.vector(20.0);
                RestShape::Given { lengths: None, darboux: Some(vec![bend; n - usize::from(!closed)]) }
            }
        };
        // Closed as it lies it would have its bend turned with the twist, from the end at which it is counted.
        if closed && spec.rest == RestShape::AsInserted {
            spec.rest = RestShape::Straight;
        }
        if d.chance(0.2) {
            (spec.roll, spec.pretwist) = (d.even(0.0, 1.0), d.even(0.0, 3.0));
        }
        if d.chance(0.2) {
            let profile = |d: &mut Draw, a: f64, b: f64| {
                Profile(vec![(0.0, 1.0), (0.3 * curve.length, d.even(a, b)), (0.9 * curve.length, 1.0)])
            };
            // A size under one: what touches is the largest.
            spec.along =
                Along { size: profile(d, 1.0, 0.7), modulus: profile(d, 1.0, 3.0), density: profile(d, 1.0, 2.0) };
        }
        if section == Section::Round && d.chance(0.2) {
            spec.material.plasticity = Some(Plasticity {
                yield_curvature: d.log(300.0, 50.0),
                yield_twist: d.log(300.0, 50.0),
                hardening: d.even(0.0, 0.5),
            });
        }
        if !closed && !joined && !passive && d.chance(0.3) {
            (spec.rest, spec.along, spec.roll, spec.pretwist) = (RestShape::Straight, Along::default(), 0.0, 0.0);
            reels(d, &mut scene, number, spec.stretch);
        }
        holds(d, &mut scene, number, &spec, kind);
        loads(d, &mut scene, number, n as u32, passive, spec.radius);
        scene.rods.push(spec);
    }
    if touching {
        let ground = ground(d, kind);
        scene.shapes.push(ground);
    }
    let way = crate::way::Way { turn: whole, ..crate::way::Way::default() };
    if whole == DQuat::IDENTITY { scene } else { way.scene(&scene) }
}

/// A round elastic thread along some curve, cut into `n` elements, held at its start, falling and pulled at its end.
pub fn cut(d: &mut Draw, n: usize) -> Scene {
    let mut scene = sensible(&mut Draw::list(Vec::new()), Kind::Free);
    let curve = Curve::draw(d, false);
    let material = Material { bend_damping: d.log(0.01, 0.003), ..material(d) };
    let spec = rod(&curve.points(n), Pose::new(DVec3::ZERO, d.turn()), d.log(0.15e-3, 0.4e-3), material);
    scene.rods = vec![RodSpec { rest: RestShape::AsInserted, ..spec }];
    let hold = if d.chance(0.5) { Hold::Clamp } else { Hold::Pin };
    scene.grips = vec![still(0, Place::Start, hold)];
    scene.loads = vec![(0, LoadKind::Point { place: Place::End, force: d.vector(2e-5), torque: DVec3::ZERO })];
    scene
}

fn flat_section(d: &mut Draw, radius: f64) -> Section {
    let (a, b) = (radius, radius * d.even(0.6, 0.2));
    let axes = if d.chance(0.5) { [a, b] } else { [b, a] };
    if d.chance(0.5) { Section::Ellipse(axes) } else { Section::Rectangle(axes.map(|x| 2.0 * x)) }
}

/// `n + 1` points around a circle of this length, the last one at the first.
fn ring(length: f64, n: usize) -> Vec<DVec3> {
    let at = |i: usize| {
        let (sin, cos) = libm::sincos(TAU * (i % n) as f64 / n as f64);
        DVec3::new(cos, sin, 0.0) * (length / TAU)
    };
    (0..=n).map(at).collect()
}

/// Joins the next thread, `number`, with its start to the end of the one before it, or to its middle where that is
/// straight and far from all else; says where it begins.
fn join(d: &mut Draw, scene: &mut Scene, number: usize, touching: bool) -> Option<Pose> {
    let (from, before) = (number - 1, scene.rods.last()?);
    if before.closure.is_some() || scene.reels.iter().any(|r| r.rod == from && r.at_end) {
        return None;
    }
    let (x, n) = (&before.centerline, before.centerline.len() - 1);
    let straight = (x[n] - x[0]).length() > 0.999 * crate::scene::length(before, x);
    let (place, at, bend) = if straight && !touching && d.chance(0.5) {
        (Place::Particle(n as u32 / 2), x[n / 2], 1.3)
    } else {
        (Place::End, x[n], d.even(0.0, 0.6))
    };
    // About the normal of the ground, or any axis across.
    let along = (x[n] - x[n - 1]).normalize();
    let axis = if touching { DVec3::Z } else { along.any_orthonormal_vector() };
    let frame = DQuat::from_rotation_arc(DVec3::X, DQuat::from_axis_angle(axis, bend) * along).normalize();
    let rest = if bend < 1.0 && d.chance(0.3) { WeldRest::Straight } else { WeldRest::AsInserted };
    let until = if d.chance(0.2) && scene.frames > 8 { scene.frames / 2 } else { u32::MAX };
    let mut places = vec![(from, place), (number, Place::Start)];
    if d.chance(0.3) {
        places.reverse();
    }
    scene.welds.push(Joined { places, rest, until });
    Some(Pose::new(at, frame))
}

/// A reel at one end or both.
fn reels(d: &mut Draw, scene: &mut Scene, rod: usize, stretch: Stretch) {
    let law = |d: &mut Draw| {
        let brake = d.chance(0.4) && stretch == Stretch::Elastic;
        if brake { ReelLaw::Brake(d.log(0.2, 1e-3)) } else { ReelLaw::Rate(d.signed() * 0.05) }
    };
    let both = d.chance(0.3);
    let first = d.chance(0.5);
    for at_end in [false, true].into_iter().filter(|at_end| both || *at_end == first) {
        let (law, later) = (law(d), if d.chance(0.4) { Some((scene.frames / 2, law(d))) } else { None });
        let supply = if d.chance(0.3) { Some(d.even(0.3, 0.0)) } else { None };
        scene.reels.push(Reeled { rod, at_end, law, later, supply });
    }
}

/// A grip that holds from the beginning and stays where it is.
fn still(rod: usize, place: Place, hold: Hold) -> Held {
    Held {
        rod,
        place,
        hold,
        drive: Drive::Pose,
        ramp: 0.0,
        from: 0,
        until: u32::MAX,
        velocity: DVec3::ZERO,
        spin: DVec3::ZERO,
    }
}

/// What holds a thread at its ends, and how it moves.
fn holds(d: &mut Draw, scene: &mut Scene, rod: usize, spec: &RodSpec, kind: Kind) {
    let joined = |place: Place| scene.welds.iter().any(|w| w.places.contains(&(rod, place)));
    let reeled = [false, true].map(|at_end| scene.reels.iter().any(|r| r.rod == rod && r.at_end == at_end));
    let (start, end) = (d.chance(0.7) || reeled[0], d.chance(0.3) && elements(spec) > 3 || reeled[1]);
    // A weld is held as the place of one of its threads only, and a seam once.
    let places = [
        (start && !joined(Place::Start), Place::Start, reeled[0]),
        (end && spec.closure.is_none(), Place::End, reeled[1]),
    ];
    for (_, place, reeled) in places.into_iter().filter(|p| p.0) {
        let hold = [Hold::Pin, Hold::Clamp, Hold::Jaw][d.whole(0, if reeled { 1 } else { 2 }) as usize];
        scene.grips.push(still(rod, place, hold));
    }
    if matches!(kind, Kind::FreePassive | Kind::Touching) {
        return;
    }
    // The last grip moves, is taken late, let go early, or pulls with a force.
    let frames = scene.frames;
    if let Some(grip) = scene.grips.last_mut().filter(|g| g.rod == rod) {
        match d.whole(0, 2) {
            0 => (grip.velocity, grip.spin) = (d.vector(0.05), d.vector(2.0)),
            1 => {
                grip.drive =
                    Drive::Force { direction: d.direction(), force: d.log(1e-3, 0.1), speed_limit: d.log(0.05, 0.2) };
            }
            _ => (grip.from, grip.until, grip.ramp) = (frames / 4, frames / 2, 0.02),
        }
    }
}

fn loads(d: &mut Draw, scene: &mut Scene, rod: usize, n: u32, passive: bool, radius: f64) {
    let place = |d: &mut Draw| [Place::End, Place::Start, Place::Element(n / 2)][d.whole(0, 2) as usize];
    // A force that bends a thread as its weight does, or some times that.
    if d.chance(0.3) {
        let torque = if passive { DVec3::ZERO } else { d.vector(1e-7) };
        scene.loads.push((rod, LoadKind::Point { place: place(d), force: d.vector(1e-4), torque }));
    }
    if d.chance(0.2) {
        scene.loads.push((rod, LoadKind::Uniform { force_per_length: d.vector(2e-3) }));
    }
    if d.chance(0.2) {
        let mass = d.log(1e-6, 1e-4);
        scene
            .loads
            .push((rod, LoadKind::Mass { place: place(d), mass, inertia: DVec3::splat(mass * radius * radius) }));
    }
}

/// What threads fall on: its top is at z = 0.
fn ground(d: &mut Draw, kind: Kind) -> ShapeSpec {
    let size = d.log(5e-3, 3e-2);
    let about = DQuat::from_rotation_z(d.even(0.0, TAU)).normalize();
    let lying = (about * DQuat::from_rotation_x(FRAC_PI_2)).normalize();
    let (geometry, pose) = match d.whole(0, 5) {
        0 => (Geometry::Plane, Pose::IDENTITY),
        1 => (Geometry::Sphere { radius: size }, Pose::at(DVec3::NEG_Z * size)),
        2 => (Geometry::Cylinder { radius: size, half_length: 0.05 }, Pose::new(DVec3::NEG_Z * size, lying)),
        3 => (Geometry::Capsule { radius: size, half_length: 0.02 }, Pose::new(DVec3::NEG_Z * size, lying)),
        4 => (Geometry::Box { half_sides: DVec3::new(size, 2.0 * size, size) }, Pose::new(DVec3::NEG_Z * size, about)),
        _ => {
            // A shallow roof of four triangles.
            let (a, b) = (2.0 * size, 0.3 * size);
            let vertices = vec![
                DVec3::ZERO,
                DVec3::new(a, 0.0, -b),
                DVec3::new(0.0, a, -b),
                DVec3::new(-a, 0.0, -b),
                DVec3::new(0.0, -a, -b),
            ];
            (
                Geometry::Mesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]] },
                Pose::new(DVec3::ZERO, about),
            )
        }
    };
    let motion = match kind {
        Kind::Worked if d.chance(0.3) => {
            ShapeMotion::Pushed { direction: DVec3::Z, force: d.log(1e-3, 0.1), speed_limit: d.log(0.02, 0.2) }
        }
        _ => ShapeMotion::Fixed,
    };
    ShapeSpec { geometry, pose, surface: d.whole(0, 1), motion, open: false }
}

/// The scene of a number, and its kind in words: every second one is absurd, the others take turns.
pub fn numbered(seed: u64, number: u64) -> (&'static str, Scene) {
    let mut draw = Draw::seed(seed, number);
    let (name, kind) = match number % 8 {
        1 => ("free", Kind::Free),
        3 => ("free passive", Kind::FreePassive),
        5 => ("touching", Kind::Touching),
        7 => ("worked", Kind::Worked),
        _ => return ("absurd", absurd(&mut draw)),
    };
    let scene = sensible(&mut draw, kind);
    (name, Scene { other_order: draw.chance(0.5), ..scene })
}

/// Orders of magnitude around one.
fn wild(d: &mut Draw) -> f64 {
    let u = d.signed();
    // Mostly a few orders, now and then hundreds.
    let orders = if d.chance(0.15) { 300.0 } else { 12.0 };
    libm::pow(10.0, orders * u * u * u)
}

/// A scene of finite numbers that may be anything: a sensible one in which a few things are absurd.
pub fn absurd(d: &mut Draw) -> Scene {
    let kind = [Kind::Free, Kind::Touching, Kind::Worked][d.whole(0, 2) as usize];
    let mut scene = sensible(d, kind);
    scene.frames = d.whole(3, 8);
    // Being stuck takes twice the attempts for each halving allowed.
    scene.settings.halvings = if d.chance(0.005) { 12 } else { d.whole(0, 3) };
    // An element may be so short that a thousand of them are fed in every substep.
    for reel in &mut scene.reels {
        reel.supply = reel.supply.or(Some(2.0));
    }
    for _ in 0..d.whole(1, 4) {
        make_absurd(d, &mut scene);
    }
    scene.other_order = d.chance(0.5);
    scene
}

fn make_absurd(d: &mut Draw, scene: &mut Scene) {
    let x = wild(d);
    let (n_rods, frames) = (scene.rods.len(), scene.frames);
    let number = d.whole(0, n_rods as u32 - 1) as usize;
    let when = d.whole(0, frames - 1);
    let rod = &mut scene.rods[number];
    let n = rod.centerline.len() - 1;
    match d.whole(0, 41) {
        0 => rod.radius *= x,
        1 => rod.material.young_modulus *= x,
        2 => rod.material.density *= x,
        3 => rod.material.bend_damping = x,
        4 => rod.material.shear = Shear::Modulus(1e9 * x),
        5 => rod.material.bend_scale = x.min(1.0),
        6 => {
            rod.material.plasticity =
                Some(Plasticity { yield_curvature: x, yield_twist: wild(d), hardening: d.even(0.0, 0.999) });
        }
        7 => rod.section = Section::Rectangle([1e-4 * x, 1e-4 * wild(d)]),
        8 => rod.pretwist = x,
        9 => {
            rod.rest = RestShape::Given { lengths: Some((0..n).map(|_| 1e-3 * d.log(1.0, x)).collect()), darboux: None }
        }
        10 => rod.rest = RestShape::Given { lengths: None, darboux: Some((1..n).map(|_| d.vector(x)).collect()) },
        11 => rod.centerline.iter_mut().for_each(|p| *p *= x),
        12 => {
            rod.frames = None;
            rod.centerline.iter_mut().for_each(|p| *p += d.vector(0.02));
        }
        13 => rod.centerline.iter_mut().for_each(|p| p.x += x),
        14 => rod.along.modulus = Profile(vec![(0.0, 1.0), (0.01, x)]),
        15 => rod.along.size = Profile(vec![(0.0, 1.0), (0.01, x)]),
        16 => {
            rod.frames = None;
            let back: Vec<DVec3> = rod.centerline.iter().rev().skip(1).copied().collect();
            rod.centerline.extend(back);
            rod.rest = RestShape::Straight;
        }
        17 => {
            let twin = rod.clone();
            scene.rods.push(twin);
        }
        18 => scene.settings.gravity *= x,
        19 => scene.settings.tolerance = x.clamp(1e-300, 0.1),
        20 => scene.settings.newton_max = d.whole(1, 60),
        // At most some hundreds of substeps a frame.
        21 => scene.frame = scene.settings.substep * x.min(300.0),
        22 => {
            scene.settings.substep *= x.max(1e-2);
        }
        23 => scene.settings.friction = Friction { stick: x, slide: x * d.unit() },
        24 => scene.frictions.push((0, 1, Friction::coulomb(x))),
        25 => scene.settings.linear_damping = 1.0 - 1e-16 * x.clamp(1.0, 1e15),
        26 => scene
            .loads
            .push((number, LoadKind::Point { place: Place::Arc(1e-3), force: d.direction() * x, torque: DVec3::ZERO })),
        27 => scene.loads.push((
            number,
            LoadKind::Point { place: Place::End, force: DVec3::ZERO, torque: d.direction() * (1e-6 * x) },
        )),
        28 => {
            scene.loads.push((number, LoadKind::Mass { place: Place::Start, mass: x, inertia: DVec3::splat(wild(d)) }));
        }
        29 => {
            for grip in &mut scene.grips {
                (grip.velocity, grip.spin, grip.drive) = (d.direction() * x, d.direction() * wild(d), Drive::Pose);
            }
        }
        30 => {
            for grip in &mut scene.grips {
                grip.drive = Drive::Force { direction: d.direction(), force: x, speed_limit: wild(d) };
                grip.ramp = wild(d);
            }
        }
        31 => {
            let geometry = [
                Geometry::Sphere { radius: 0.01 * x },
                Geometry::Box { half_sides: DVec3::new(0.01, 0.01 * x, 0.01) },
                Geometry::Plane,
            ][d.whole(0, 2) as usize]
                .clone();
            let motion = [
                ShapeMotion::Driven,
                ShapeMotion::Pushed { direction: d.direction(), force: wild(d), speed_limit: wild(d) },
            ][d.whole(0, 1) as usize];
            let shape = scene.shapes.len();
            scene.shapes.push(ShapeSpec {
                geometry,
                pose: Pose::new(d.vector(0.02), d.turn()),
                surface: 1,
                motion,
                open: false,
            });
            scene.acts.push((when, Act::ShapePose(shape, Pose::new(d.vector(x), d.turn()))));
        }
        32 => scene.acts.push((when, if d.chance(0.5) { Act::RemoveRod(number) } else { Act::RemoveShape(0) })),
        33 => {
            let spec = Box::new(rod.clone());
            scene.acts.push((when, Act::InsertRod(spec)));
        }
        34 => {
            let other = Settings {
                gravity: d.vector(x),
                substep: scene.settings.substep * d.log(0.3, 30.0),
                ..scene.settings.clone()
            };
            scene.acts.push((when, Act::Settings(other)));
        }
        36 => rod.closure = if d.chance(0.5) { None } else { Some(Closure { twist: d.signed() * x }) },
        37 => {
            let spec =
                RodSpec { along: Along::default(), roll: 0.0, pretwist: 0.0, rest: RestShape::Straight, ..rod.clone() };
            *rod = spec;
            let law = if d.chance(0.5) { ReelLaw::Rate(d.signed() * x.min(100.0)) } else { ReelLaw::Brake(x) };
            let later =
                Some((when, if d.chance(0.5) { ReelLaw::Rate(-x.min(100.0)) } else { ReelLaw::Brake(wild(d)) }));
            scene.reels.push(Reeled { rod: number, at_end: d.chance(0.5), law, later, supply: Some(d.even(3.0, 0.0)) });
        }
        38 => {
            for reel in &mut scene.reels {
                reel.law = if d.chance(0.5) {
                    ReelLaw::Rate(d.signed() * wild(d).min(100.0))
                } else {
                    ReelLaw::Brake(wild(d))
                };
            }
        }
        // A thread onto itself, its twin, or another one, wherever they lie.
        39 => {
            let other = d.whole(0, n_rods as u32 - 1) as usize;
            let place = |d: &mut Draw| {
                [Place::Start, Place::End, Place::Particle(n as u32 / 2), Place::Particle(1)][d.whole(0, 3) as usize]
            };
            let places = vec![(number, place(d)), (other, place(d))];
            let shift = scene.rods[number].centerline[0] - scene.rods[other].centerline[0];
            if d.chance(0.7) {
                scene.rods[other].centerline.iter_mut().for_each(|p| *p += shift);
            }
            scene.welds.push(Joined {
                places,
                rest: if d.chance(0.5) { WeldRest::Straight } else { WeldRest::AsInserted },
                until: when,
            });
        }
        40 => scene.welds.iter_mut().for_each(|w| w.until = when),
        41 => scene.settings.integrator = Integrator::TrBdf2,
        _ => {
            let drive = Drive::Force { direction: d.direction(), force: x, speed_limit: 1.0 };
            let act = match d.whole(0, 3) {
                0 => Act::Drive(0, drive),
                1 => Act::GripPose(0, Pose::new(d.vector(x), d.turn())),
                2 => {
                    let Material { young_modulus, density, .. } = rod.material;
                    Act::Material(
                        number,
                        Material {
                            young_modulus: young_modulus * x,
                            density: density * wild(d),
                            ..rod.material.clone()
                        },
                    )
                }
                _ => Act::Stretch(number, if d.chance(0.5) { Stretch::Elastic } else { Stretch::Inextensible }),
            };
            scene.acts.push((when, act));
        }
    }
}
