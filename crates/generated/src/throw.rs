//! Throws: a short thread at, over, through or inside one shape, drawn so that it begins free of overlap and that there
//! is always a way to go on without one: what is driven by pose meets threads that give way, and no force presses
//! deeper than a thread can be pressed. So no throw has a reason for a passage or an incident.

use crate::draw::Draw;
use crate::mesh;
use crate::near;
use crate::scene::{Act, Held, Scene};
use core::f64::consts::PI;
use sutura::glam::{DQuat, DVec3};
use sutura::math::exp;
use sutura::{
    Drive, Friction, Geometry, Hold, LoadKind, Material, Place, Pose, RodSpec, Settings, ShapeMotion, ShapeSpec, Shear,
    Stretch, transported_frames,
};

/// What the thread meets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Family {
    /// A plate of 0.05 to 1 mm, face or edge first.
    Plate,
    /// A narrow plate, edge first.
    Blade,
    /// A wire or needle of 0.05 to 2 mm radius, across or point first.
    Wire,
    /// A cylinder with its rims.
    Peg,
    /// A box with its edges and corners.
    Corner,
    /// A ball.
    Sphere,
    /// A box, cylinder or ball as a mesh.
    MeshSolid,
    /// A tube with an inner and an outer wall; the thread in it, through it, or outside.
    Tube,
    /// A ring; the thread through it, or outside.
    Ring,
    /// Two walls of one mesh, the thread between them.
    Slot,
    /// A sheet with a boundary.
    Sheet,
    /// A closed mesh with the thread inside.
    Container,
    /// No shape but another thread, thicker or thinner.
    Threads,
}

/// All of them, in the order of their numbers.
pub const FAMILIES: [Family; 13] = [
    Family::Plate,
    Family::Blade,
    Family::Wire,
    Family::Peg,
    Family::Corner,
    Family::Sphere,
    Family::MeshSolid,
    Family::Tube,
    Family::Ring,
    Family::Slot,
    Family::Sheet,
    Family::Container,
    Family::Threads,
];

impl Family {
    /// In a word.
    pub fn name(self) -> &'static str {
        match self {
            Family::Plate => "plate",
            Family::Blade => "blade",
            Family::Wire => "wire",
            Family::Peg => "peg",
            Family::Corner => "corner",
            Family::Sphere => "sphere",
            Family::MeshSolid => "mesh solid",
            Family::Tube => "tube",
            Family::Ring => "ring",
            Family::Slot => "slot",
            Family::Sheet => "sheet",
            Family::Container => "container",
            Family::Threads => "threads",
        }
    }
}

/// What brings them together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum How {
    /// The shape moves by pose, and may spin.
    Driven,
    /// A force pushes the shape.
    Pushed,
    /// The thread flies.
    Thrown,
    /// Forces or weights at the ends of the thread pull it over the shape.
    Pulled,
    /// A grip that moves by pose draws the thread along by one end.
    Led,
}

impl How {
    /// In a word.
    pub fn name(self) -> &'static str {
        match self {
            How::Driven => "driven",
            How::Pushed => "pushed",
            How::Thrown => "thrown",
            How::Pulled => "pulled",
            How::Led => "led",
        }
    }
}

/// A throw.
#[derive(Debug, Clone)]
pub struct Throw {
    /// What is met.
    pub family: Family,
    /// How.
    pub how: How,
    /// The scene.
    pub scene: Scene,
    /// From which frame on nothing from outside does work; `None` where something does to the end.
    pub passive_from: Option<u32>,
}

/// A thread before it is anywhere: its middle is at the origin, it runs along x and bends toward y.
#[derive(Debug, Clone)]
struct Thread {
    points: Vec<DVec3>,
    radius: f64,
    material: Material,
}

/// Part of its axial stiffness that a force on a thread may reach: it then stretches by as much, and is pressed in by a
/// fifth of its radius.
const MOST_STRAIN: f64 = 0.05;

impl Thread {
    fn draw(d: &mut Draw, thick: (f64, f64), bent: bool) -> Thread {
        let radius = d.log(thick.0, thick.1);
        let element = 2.0 * radius * d.even(1.0, 10.0);
        let n = ((d.log(0.01, 0.06) / element) as usize).clamp(10, 60);
        let length = element * n as f64;
        let angle = if bent && d.chance(0.5) { d.even(0.2, 5.0) } else { 0.0 };
        let at = |i: usize| {
            let s = i as f64 / n as f64 - 0.5;
            if angle == 0.0 {
                return DVec3::X * (length * s);
            }
            let (sin, cos) = libm::sincos(angle * s);
            DVec3::new(sin, 1.0 - cos, 0.0) * (length / angle)
        };
        let material = Material {
            young_modulus: d.log(1e7, 1.93e11),
            shear: Shear::Poisson(0.4),
            density: d.log(1000.0, 8000.0),
            bend_scale: if d.chance(0.3) { 0.02 } else { 1.0 },
            bend_damping: if d.chance(0.5) { d.log(0.001, 0.01) } else { 0.0 },
            plasticity: None,
        };
        Thread { points: (0..=n).map(at).collect(), radius, material }
    }
    fn n(&self) -> usize {
        self.points.len() - 1
    }
    fn length(&self) -> f64 {
        self.points[0].distance(self.points[1]) * self.n() as f64
    }
    /// E A \[N\].
    fn axial(&self) -> f64 {
        self.material.young_modulus * PI * self.radius * self.radius
    }
    fn line_density(&self) -> f64 {
        self.material.density * PI * self.radius * self.radius
    }
    /// A force \[N\] between 0.01 and 10, as far as the thread bears it.
    fn force(&self, d: &mut Draw) -> f64 {
        let most = (MOST_STRAIN * self.axial()).min(10.0);
        d.log(most.min(0.01), most)
    }
    fn spec(&self, place: &Pose, stretch: Stretch) -> RodSpec {
        let centerline: Vec<DVec3> = self.points.iter().map(|p| place.transform_point(*p)).collect();
        let frames = transported_frames(&centerline, place.orientation * DVec3::Z);
        RodSpec { frames: Some(frames), stretch, ..RodSpec::new(centerline, self.radius, self.material.clone()) }
    }
}

/// A shape in its own frame, and how a thread is brought to it.
struct Target {
    geometry: Geometry,
    /// From the shape toward the thread, a unit vector.
    toward: DVec3,
    /// Where the middle of the thread is aimed at.
    aim: DVec3,
    /// Direction of the thread there.
    along: DVec3,
    /// The thread lies at `aim`, inside the shape; else it comes from outside.
    inside: bool,
}

/// A unit vector across this one.
fn across(d: &mut Draw, v: DVec3) -> DVec3 {
    DQuat::from_axis_angle(v, d.even(0.0, 2.0 * PI)) * v.any_orthonormal_vector()
}

/// Near a direction, tilted by this angle at most.
fn tilted(d: &mut Draw, v: DVec3, angle: f64) -> DVec3 {
    let axis = across(d, v);
    (DQuat::from_axis_angle(axis, d.even(0.0, angle)) * v).normalize()
}

/// The shape of a family, of sizes that go with a thread of this radius and length.
fn target(d: &mut Draw, family: Family, radius: f64, length: f64) -> Target {
    let outside = |d: &mut Draw, geometry: Geometry, toward: DVec3, aim: DVec3| {
        let along = across(d, toward);
        Target { geometry, toward, aim, along: tilted(d, along, 0.3), inside: false }
    };
    let within = |d: &mut Draw, half: DVec3| d.vector(1.0) * half;
    match family {
        Family::Plate => {
            let half = DVec3::new(d.even(5e-3, 2e-2), d.even(5e-3, 2e-2), 0.5 * d.log(5e-5, 1e-3));
            let side = [DVec3::Z, DVec3::Z, DVec3::X][d.whole(0, 2) as usize];
            let (toward, aim) = (tilted(d, side, 0.5), within(d, 0.6 * half));
            outside(d, Geometry::Box { half_sides: half }, toward, aim)
        }
        Family::Blade => {
            let half = DVec3::new(d.even(5e-3, 2e-2), d.log(5e-4, 3e-3), 0.5 * d.log(5e-5, 5e-4));
            let (toward, aim) = (tilted(d, DVec3::Y, 0.4), within(d, 0.6 * half));
            outside(d, Geometry::Box { half_sides: half }, toward, aim)
        }
        Family::Wire => {
            let (thick, half_length) = (d.log(5e-5, 2e-3), d.even(5e-3, 2e-2));
            let geometry = if d.chance(0.5) {
                Geometry::Capsule { radius: thick, half_length }
            } else {
                Geometry::Cylinder { radius: thick, half_length }
            };
            let side = if d.chance(0.2) { DVec3::Z } else { across(d, DVec3::Z) };
            let (toward, aim) = (tilted(d, side, 0.4), DVec3::Z * (d.signed() * 0.6 * half_length));
            outside(d, geometry, toward, aim)
        }
        Family::Peg => {
            let (thick, half_length) = (d.log(1e-3, 5e-3), d.log(2e-3, 1e-2));
            let (toward, aim) = (d.direction(), within(d, 0.8 * DVec3::new(thick, thick, half_length)));
            outside(d, Geometry::Cylinder { radius: thick, half_length }, toward, aim)
        }
        Family::Corner => {
            let half = DVec3::new(d.log(1e-3, 8e-3), d.log(1e-3, 8e-3), d.log(1e-3, 8e-3));
            let (toward, aim) = (d.direction(), within(d, 0.9 * half));
            outside(d, Geometry::Box { half_sides: half }, toward, aim)
        }
        Family::Sphere => {
            let size = d.log(3e-4, 8e-3);
            let (toward, aim) = (d.direction(), d.vector(0.5 * size));
            outside(d, Geometry::Sphere { radius: size }, toward, aim)
        }
        Family::MeshSolid => {
            let half = DVec3::new(d.log(5e-4, 8e-3), d.log(5e-4, 8e-3), d.log(3e-4, 8e-3));
            let geometry = match d.whole(0, 2) {
                0 => mesh::cuboid(half),
                1 => mesh::cylinder(half.x, half.z, d.whole(8, 24)),
                _ => mesh::ball(half.x, d.whole(8, 16)),
            };
            let (toward, aim) = (d.direction(), within(d, 0.5 * half));
            outside(d, geometry, toward, aim)
        }
        Family::Tube => {
            let sides = d.whole(8, 20);
            // The flat sides come nearer to the axis than the corners.
            let inner = radius * d.even(1.6, 6.0) / libm::cos(PI / f64::from(sides));
            let (wall, half_length) = (d.log(1e-4, 1e-3), length * d.log(0.1, 0.8));
            let geometry = mesh::tube(inner, wall, half_length, sides, d.whole(1, 4));
            if d.chance(0.3) {
                let side = if d.chance(0.3) { DVec3::Z } else { across(d, DVec3::Z) };
                let (toward, aim) = (tilted(d, side, 0.4), DVec3::Z * (d.signed() * 0.6 * half_length));
                return outside(d, geometry, toward, aim);
            }
            let off = across(d, DVec3::Z) * d.even(0.0, 0.3 * (inner - radius));
            let shift = DVec3::Z * (d.signed() * 0.3 * length);
            Target { geometry, toward: across(d, DVec3::Z), aim: off + shift, along: DVec3::Z, inside: true }
        }
        Family::Ring => {
            let minor = d.log(1e-4, 1e-3);
            let major = minor + radius * d.log(2.0, 10.0);
            let geometry = mesh::torus(major, minor, d.whole(12, 24), d.whole(6, 10));
            if d.chance(0.3) {
                let (toward, aim) = (d.direction(), across(d, DVec3::Z) * major);
                return outside(d, geometry, toward, aim);
            }
            let off = across(d, DVec3::Z) * d.even(0.0, 0.3 * (major - minor - radius))
                + DVec3::Z * (d.signed() * 0.3 * length);
            Target { geometry, toward: d.direction(), aim: off, along: tilted(d, DVec3::Z, 0.3), inside: true }
        }
        Family::Slot => {
            let half_gap = radius * d.log(1.4, 6.0);
            let thickness = if d.chance(0.5) { d.log(1e-4, 1e-3) } else { 0.0 };
            let geometry = mesh::slot(half_gap, thickness, length * d.log(0.2, 1.0));
            let along = DQuat::from_rotation_z(d.even(0.0, 2.0 * PI)) * DVec3::X;
            let toward = if d.chance(0.7) { DVec3::Z } else { d.direction() };
            let off = DVec3::new(
                d.signed() * 0.2 * length,
                d.signed() * 0.2 * length,
                d.signed() * 0.5 * (half_gap - radius),
            );
            Target { geometry, toward, aim: off, along, inside: true }
        }
        Family::Sheet => {
            let half = DVec3::new(d.even(3e-3, 2e-2), d.even(3e-3, 2e-2), 0.0);
            let wave = if d.chance(0.5) { d.even(0.0, 2e-3) } else { 0.0 };
            let geometry = mesh::sheet(half.x, half.y, d.whole(1, 6), d.whole(1, 6), wave);
            let side = if d.chance(0.3) { DVec3::X } else { DVec3::Z };
            // Beyond the boundary now and then.
            let (toward, aim) = (tilted(d, side, 0.5), within(d, 1.1 * half));
            outside(d, geometry, toward, aim)
        }
        Family::Container => {
            let half = length * DVec3::new(d.even(0.55, 1.0), d.even(0.3, 0.8), d.even(0.2, 0.8));
            let geometry = match d.whole(0, 2) {
                0 => mesh::cuboid(half),
                1 => mesh::cylinder(half.x, half.z, d.whole(8, 24)),
                _ => mesh::ball(half.x, d.whole(8, 16)),
            };
            let off = d.vector(0.1 * length);
            let along = DQuat::from_rotation_z(0.2 * d.signed()) * DVec3::X;
            Target { geometry: mesh::inward(geometry), toward: d.direction(), aim: off, along, inside: true }
        }
        Family::Threads => unreachable!("there is no shape"),
    }
}

/// The throw of a number: the families take turns.
pub fn numbered(seed: u64, number: u64) -> Throw {
    let family = FAMILIES[(number % FAMILIES.len() as u64) as usize];
    let mut draw = Draw::seed(seed, number);
    for _ in 0..MOST_DRAWS {
        let throw = if family == Family::Threads { of_threads(&mut draw) } else { at_shape(&mut draw, family) };
        if let Some(throw) = throw {
            return throw;
        }
    }
    unreachable!("throw {number} of seed {seed}: no start free of overlap in {MOST_DRAWS} draws")
}

/// Draws that overlap, or lead a held place into the shape, are drawn again. Most families find one within ten.
const MOST_DRAWS: u32 = 10_000;

/// Least room at the start, in radii of the thread.
const ROOM: f64 = 0.3;
/// Least distance of points half a radius apart, in radii: between them it is less by a quarter at most.
const CLEAR: f64 = 1.27;
/// Part of its length that the middle of a thread held at both ends may be carried off by pose, and the modulus of
/// those that bear it \[Pa\]: it is then longer by a quarter, and pressed in by a third of its radius.
const CARRIED: f64 = 0.35;
const SOFT: (f64, f64) = (1e7, 1e8);

fn settings(d: &mut Draw, gravity: DVec3) -> Settings {
    let mu = if d.chance(0.8) { d.even(0.0, 0.5) } else { 0.0 };
    let damping = if d.chance(0.5) { d.even(0.0, 0.9) } else { 0.0 };
    Settings {
        gravity,
        substep: 1.0 / [240.0, 240.0, 480.0, 960.0][d.whole(0, 3) as usize],
        linear_damping: damping,
        angular_damping: damping,
        friction: Friction::coulomb(mu),
        ..Settings::default()
    }
}

fn empty(settings: Settings, frame: f64, frames: u32) -> Scene {
    let (frictions, rods, welds, reels) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let (shapes, grips, loads, acts) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    Scene { settings, frictions, rods, welds, reels, shapes, grips, loads, frame, frames, acts, other_order: false }
}

fn held(rod: usize, place: Place, drive: Drive) -> Held {
    Held {
        rod,
        place,
        hold: Hold::Pin,
        drive,
        ramp: 0.0,
        from: 0,
        until: u32::MAX,
        velocity: DVec3::ZERO,
        spin: DVec3::ZERO,
    }
}

/// What holds a thread that is met, beside what it is led by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Holds {
    Nothing,
    OneEnd,
    BothEnds,
    /// Hands at both ends, which give way.
    Hands,
}

fn hold(scene: &mut Scene, holds: Holds, mut hand: impl FnMut(Place) -> Drive) {
    let by_pose = |place| held(0, place, Drive::Pose);
    match holds {
        Holds::Nothing => {}
        Holds::OneEnd => scene.grips.push(by_pose(Place::Start)),
        Holds::BothEnds => scene.grips.extend([Place::Start, Place::End].map(by_pose)),
        Holds::Hands => {
            for place in [Place::Start, Place::End] {
                scene.grips.push(held(0, place, hand(place)));
            }
        }
    }
}

/// Of a straight motion and spin.
fn moved(pose: &Pose, velocity: DVec3, spin: DVec3, time: f64) -> Pose {
    Pose::new(pose.position + velocity * time, (exp(spin * time) * pose.orientation).normalize())
}

/// Speed that a thread has after it was pushed through the first frame.
fn throw_off(scene: &mut Scene, rod: usize, thread: &Thread, velocity: DVec3) {
    let load = |force_per_length| LoadKind::Uniform { force_per_length };
    scene.acts.push((1, Act::Load(scene.loads.len(), load(DVec3::ZERO))));
    scene.loads.push((rod, load(velocity * (thread.line_density() / scene.frame))));
}

fn at_shape(d: &mut Draw, family: Family) -> Option<Throw> {
    let mut thread = Thread::draw(d, (5e-5, 5e-4), family != Family::Slot);
    let (radius, length) = (thread.radius, thread.length());
    let t = target(d, family, radius, length);
    let how = [How::Driven, How::Driven, How::Pushed, How::Thrown, How::Pulled, How::Led][d.whole(0, 5) as usize];
    // Half of what is driven is as fast as hands and instruments get.
    let slowest = if d.chance(0.5) { 0.2 } else { 0.01 };
    let speed = if how == How::Thrown { d.log(0.2, 5.0) } else { d.log(slowest, 2.0) };
    // What holds a thread that is met.
    let holds = [Holds::Nothing, Holds::OneEnd, Holds::BothEnds, Holds::Hands, Holds::Hands][d.whole(0, 4) as usize];
    let holds = if t.inside && matches!(holds, Holds::OneEnd | Holds::BothEnds) { Holds::Hands } else { holds };
    let taut = holds == Holds::BothEnds && matches!(how, How::Driven | How::Pushed);
    let short = how == How::Thrown || taut && how == How::Driven;
    let frame = if short { 1.0 / 240.0 } else { 1.0 / [60.0, 120.0, 240.0][d.whole(0, 2) as usize] };
    let time = d.even(0.05, 0.3);
    let frames = (time / frame).ceil() as u32;
    // What is driven against a thread held at both ends stops before that bears no more.
    let moving =
        if taut && how == How::Driven { frames.min((CARRIED * length / (speed * frame)) as u32) } else { frames };
    if moving == 0 {
        return None;
    }
    if taut && how == How::Driven {
        thread.material.young_modulus = d.log(SOFT.0, SOFT.1);
    }
    let travel = speed * frame * f64::from(moving);
    // What moves comes to the shape in the first third of the time.
    let gap = radius * ROOM + (radius * d.log(0.1, 10.0)).min(0.3 * travel);
    let run_up = if how == How::Thrown { 1.2 * speed * frame } else { 0.0 };

    // The whole is turned; the shape is at the origin to begin with.
    let pose = Pose::new(DVec3::ZERO, d.turn());
    let (toward, along) = (pose.orientation * t.toward, pose.orientation * t.along);
    let side = (toward - along * along.dot(toward)).normalize_or(along.any_orthonormal_vector());
    let side = DQuat::from_axis_angle(along, d.even(0.0, 2.0 * PI)) * side;
    let lies = DQuat::from_mat3(&sutura::glam::DMat3::from_cols(along, side, along.cross(side))).normalize();
    let mut place = Pose::new(pose.transform_point(t.aim), lies);
    let is_mesh = matches!(t.geometry, Geometry::Mesh { .. });
    let spacing = if is_mesh { (0.25 * length / thread.n() as f64).max(0.5 * radius) } else { 0.5 * radius };
    if !t.inside {
        place.position += toward * (near::extent(&t.geometry) + length);
        approach(&thread, &mut place, spacing, toward, radius + gap, |x| near::shape(&t.geometry, &pose, x))?;
        place.position += toward * run_up;
    }
    let x: Vec<DVec3> = thread.points.iter().map(|p| place.transform_point(*p)).collect();
    if near::shape(&t.geometry, &pose, &near::samples(&x, 0.5 * radius)) < CLEAR * radius {
        return None;
    }

    let gravity = match d.whole(0, 3) {
        0 => DVec3::ZERO,
        1 => d.direction() * 9.81,
        _ => toward * -9.81,
    };
    let mut scene = empty(settings(d, gravity), frame, frames);
    // Between two ends that do not give way, what meets a thread lengthens it.
    let stretch = if d.chance(0.2) && !taut { Stretch::Inextensible } else { Stretch::Elastic };
    scene.rods.push(thread.spec(&place, stretch));
    let (mut velocity, mut spin) = (DVec3::ZERO, DVec3::ZERO);
    let mut motion = ShapeMotion::Fixed;
    let mut passive_from = None;
    let outward = [x[0] - x[1], x[thread.n()] - x[thread.n() - 1]].map(DVec3::normalize);
    // A hand that gives way when what it holds is carried off.
    let hand = |d: &mut Draw, direction: DVec3, fastest: f64| Drive::Hand {
        direction,
        force: thread.force(d),
        speed_limit: fastest.max(0.05),
    };
    match how {
        How::Driven => {
            velocity = tilted(d, toward, 0.3) * speed;
            if d.chance(0.4) && !taut {
                spin = d.direction() * d.log(0.5, 50.0);
            }
            motion = ShapeMotion::Driven;
            let fastest = speed + spin.length() * near::extent(&t.geometry);
            hold(&mut scene, holds, |place| hand(d, outward[usize::from(place == Place::End)], fastest));
            for k in 0..moving {
                scene.acts.push((k, Act::ShapePose(0, moved(&pose, velocity, spin, f64::from(k + 1) * frame))));
            }
        }
        How::Pushed => {
            motion = ShapeMotion::Pushed { direction: toward, force: thread.force(d), speed_limit: speed };
            hold(&mut scene, holds, |place| hand(d, outward[usize::from(place == Place::End)], speed));
        }
        How::Thrown => {
            throw_off(&mut scene, 0, &thread, -toward * speed);
            if holds == Holds::OneEnd {
                scene.grips.push(held(0, Place::Start, Drive::Pose));
            }
            passive_from = Some(1);
        }
        How::Pulled => {
            let spread = d.even(0.0, 1.0);
            let weights = d.chance(0.4) && gravity != DVec3::ZERO;
            for (place, out) in [Place::Start, Place::End].into_iter().zip(outward) {
                if weights {
                    // Caught from a fall it pulls some times its weight.
                    let mass = 0.2 * thread.force(d) / 9.81;
                    scene.loads.push((0, LoadKind::Mass { place, mass, inertia: DVec3::ZERO }));
                } else {
                    let direction = (out * spread - toward * (1.0 - 0.5 * spread)).normalize();
                    let drive = hand(d, direction, speed);
                    scene.grips.push(held(0, place, drive));
                }
            }
            passive_from = weights.then_some(0);
        }
        How::Led => {
            let direction = if t.inside && matches!(family, Family::Tube | Family::Ring | Family::Slot) {
                outward[1]
            } else {
                -toward
            };
            let grip = Held { velocity: tilted(d, direction, 0.2) * speed, ..held(0, Place::End, Drive::Pose) };
            scene.grips.push(grip);
        }
    }
    // Places held by pose must have room all along.
    for grip in scene.grips.iter().filter(|g| g.drive == Drive::Pose) {
        let at = if grip.place == Place::Start { x[0] } else { x[thread.n()] };
        // In steps of less than a third of a radius, so that not even a sheet is stepped over.
        let speed = (grip.velocity - velocity).length() + spin.length() * (at - pose.position).length().max(0.02);
        let steps = 4 * (frames as usize).max((f64::from(frames) * frame * speed / radius).ceil() as usize);
        for k in 0..=steps {
            let time = f64::from(frames) * frame * k as f64 / steps as f64;
            let shape = moved(&pose, velocity, spin, time.min(f64::from(moving) * frame));
            if near::shape(&t.geometry, &shape, &[at + grip.velocity * time]) < 1.3 * radius {
                return None;
            }
        }
        if how == How::Pushed
            && near::shape(&t.geometry, &pose, &near::samples(&[at, at - toward * travel], radius)) < 2.0 * radius
        {
            return None;
        }
    }
    scene.shapes.push(ShapeSpec { motion, ..ShapeSpec::fixed(t.geometry, pose) });
    Some(Throw { family, how, scene, passive_from })
}

/// Brings a thread from afar against `toward` until it is this near. `None` where it goes by.
fn approach(
    thread: &Thread,
    place: &mut Pose,
    spacing: f64,
    toward: DVec3,
    wanted: f64,
    distance: impl Fn(&[DVec3]) -> f64,
) -> Option<()> {
    let start = place.position;
    let mut x: Vec<DVec3> =
        near::samples(&thread.points, spacing).into_iter().map(|p| place.transform_point(p)).collect();
    for _ in 0..200 {
        // No step of this length can overlap.
        let room = distance(&x) - wanted;
        if room < 0.02 * wanted {
            return Some(());
        }
        place.position -= toward * room;
        if (start - place.position).dot(toward) > 4.0 * start.length() {
            return None;
        }
        x.iter_mut().for_each(|p| *p -= toward * room);
    }
    None
}

/// A thread that meets another one of another thickness.
fn of_threads(d: &mut Draw) -> Option<Throw> {
    let (a, b) = (Thread::draw(d, (5e-5, 5e-4), true), Thread::draw(d, (5e-5, 5e-4), true));
    let how = [How::Thrown, How::Pulled, How::Led][d.whole(0, 2) as usize];
    let speed = if how == How::Thrown { d.log(0.2, 5.0) } else { d.log(0.01, 2.0) };
    let frame = if how == How::Thrown { 1.0 / 240.0 } else { 1.0 / 120.0 };
    let time = d.even(0.05, 0.3);
    let frames = (time / frame).ceil() as u32;
    let wanted = (a.radius + b.radius) * (1.0 + ROOM) + (a.radius * d.log(0.1, 10.0)).min(0.3 * speed * time);
    let still = Pose::new(DVec3::ZERO, d.turn());
    let line: Vec<DVec3> = b.points.iter().map(|p| still.transform_point(*p)).collect();
    let along = still.orientation * DVec3::X;
    let toward = across(d, along);
    let lies = DQuat::from_axis_angle(toward, d.even(0.3, PI - 0.3)) * still.orientation;
    let reach = 0.3 * b.length();
    let mut place = Pose::new(along * (d.signed() * reach) + toward * (a.length() + b.length()), lies.normalize());
    approach(&a, &mut place, 0.5 * a.radius, toward, wanted, |x| near::polyline(x, &line))?;
    if how == How::Thrown {
        place.position += toward * (1.2 * speed * frame);
    }
    let gravity = if d.chance(0.5) { DVec3::ZERO } else { toward * -9.81 };
    let mut scene = empty(settings(d, gravity), frame, frames);
    scene.rods = vec![
        a.spec(&place, Stretch::Elastic),
        b.spec(&still, if d.chance(0.2) { Stretch::Inextensible } else { Stretch::Elastic }),
    ];
    // The one that is met gives way at the hands that hold it, or at its free end.
    let bears = |d: &mut Draw| a.force(d).min(b.force(d));
    let mut passive_from = None;
    if d.chance(0.5) {
        scene.grips.push(held(1, Place::Start, Drive::Pose));
    } else {
        for (place, out) in [(Place::Start, -along), (Place::End, along)] {
            let drive = Drive::Hand { direction: out, force: bears(d), speed_limit: speed.max(0.05) };
            scene.grips.push(held(1, place, drive));
        }
    }
    match how {
        How::Thrown => {
            throw_off(&mut scene, 0, &a, -toward * speed);
            passive_from = scene.grips.iter().all(|g| g.drive == Drive::Pose).then_some(1);
        }
        How::Pulled => {
            let force = bears(d);
            for place in [Place::Start, Place::End] {
                scene.grips.push(held(
                    0,
                    place,
                    Drive::Hand { direction: -toward, force, speed_limit: speed.max(0.05) },
                ));
            }
        }
        _ => scene.grips.push(Held { velocity: -toward * speed, ..held(0, Place::End, Drive::Pose) }),
    }
    // A place that is led stays clear of one that is held by pose.
    let led = place.transform_point(a.points[a.n()]);
    let clear = 3.0 * (a.radius + b.radius);
    if how == How::Led
        && near::samples(&[led, led - toward * (speed * time)], clear).iter().any(|p| p.distance(line[0]) < 3.0 * clear)
    {
        return None;
    }
    Some(Throw { family: Family::Threads, how, scene, passive_from })
}
