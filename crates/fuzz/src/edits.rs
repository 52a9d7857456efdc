//! Worlds that are edited and stepped in any order, with sensible numbers and absurd ones.

use crate::finite;
use crate::input::Input;
use sutura::glam::DVec3;
use sutura::{
    Along, Closure, Drive, Friction, Geometry, Grip, GripSpec, Handle, Hold, Integrator, Load, LoadKind, LoadSpec,
    Material, PaperSettings, Place, Plasticity, Pose, Profile, Reel, ReelLaw, ReelSpec, RestShape, Rod, RodSpec,
    Section, Settings, Shape, ShapeMotion, ShapeSpec, Shear, Solver, Stretch, Weld, WeldRest, WeldSpec, World,
};

/// What one input may do: edits, threads, elements of one, substeps in all.
const MOST_EDITS: u32 = 60;
const MOST_THREADS: usize = 3;
const MOST_ELEMENTS: usize = 10;
const MOST_SUBSTEPS: f64 = 40.0;
/// Where there are reels, which may feed in a thousand elements a substep: substeps of one step, and elements beyond
/// which an input is at its end.
const MOST_REELED: f64 = 4.0;
const MOST_FED: usize = 500;

/// A world, and every handle that it ever gave: those of things that are gone too.
struct Session {
    world: World,
    rods: Vec<Handle<Rod>>,
    shapes: Vec<Handle<Shape>>,
    grips: Vec<Handle<Grip>>,
    loads: Vec<Handle<Load>>,
    welds: Vec<Handle<Weld>>,
    reels: Vec<Handle<Reel>>,
    snapshots: Vec<Vec<u8>>,
    substeps: f64,
}

pub fn run(data: &[u8]) {
    let mut input = Input::new(data);
    let settings = Settings { halvings: 2, ..Settings::default() };
    let world = World::new(settings).unwrap_or_else(|e| panic!("{e}"));
    let mut session = Session {
        world,
        rods: vec![],
        shapes: vec![],
        grips: vec![],
        loads: vec![],
        welds: vec![],
        reels: vec![],
        snapshots: vec![],
        substeps: 0.0,
    };
    for _ in 0..MOST_EDITS {
        if input.is_empty() || session.substeps > MOST_SUBSTEPS {
            break;
        }
        session.edit(&mut input);
    }
}

impl Session {
    /// One edit. Errors are answers; what matters is that the world stays usable.
    fn edit(&mut self, input: &mut Input<'_>) {
        let which = input.byte();
        match which % 20 {
            _ if which >= 240 => self.edit_joined(which, input),
            0..=1 => self.insert_rod(input),
            2 => {
                let shape = ShapeSpec {
                    geometry: geometry(input),
                    pose: pose(input),
                    surface: input.below(3) as u32,
                    motion: motion(input),
                    open: true,
                };
                self.shapes.extend(self.world.insert_shape(&shape));
            }
            3..=4 => {
                if let Some(rod) = pick(&self.rods, input) {
                    let hold = input.pick(&[Hold::Pin, Hold::Clamp, Hold::Jaw]);
                    let ramp = if input.truth() { 0.0 } else { input.number(0.01) };
                    self.grips.extend(self.world.insert_grip(&GripSpec {
                        rod,
                        place: place(input),
                        hold,
                        drive: drive(input),
                        ramp,
                    }));
                }
            }
            5 => {
                if let Some(grip) = pick(&self.grips, input) {
                    let _ = self.world.remove_grip(grip);
                }
            }
            6 => {
                if let Some(grip) = pick(&self.grips, input) {
                    let _ = self.world.set_grip_drive(grip, drive(input));
                }
            }
            7..=8 => {
                if let Some(grip) = pick(&self.grips, input) {
                    let mut to = self.world.grip_pose(grip).unwrap_or(Pose::IDENTITY);
                    to.position += input.vector(1e-3);
                    if input.truth() {
                        to.orientation = input.rotation();
                    }
                    let _ = self.world.set_grip_pose(grip, to);
                }
            }
            9 => {
                if let Some(rod) = pick(&self.rods, input) {
                    self.loads.extend(self.world.insert_load(&LoadSpec { rod, kind: load(input) }));
                }
            }
            10 => {
                if let Some(l) = pick(&self.loads, input) {
                    let _ = if input.truth() { self.world.set_load(l, load(input)) } else { self.world.remove_load(l) };
                }
            }
            11 => {
                if let Some(shape) = pick(&self.shapes, input) {
                    let _ = self.world.set_shape_pose(shape, pose(input));
                }
            }
            12 => {
                if let Some(shape) = pick(&self.shapes, input) {
                    let _ = if input.truth() {
                        self.world.set_shape_motion(shape, motion(input))
                    } else {
                        self.world.remove_shape(shape)
                    };
                }
            }
            13 => {
                if let Some(rod) = pick(&self.rods, input) {
                    let _ = self.world.remove_rod(rod);
                }
            }
            14 => self.settings(input),
            15 => match input.below(3) {
                0 => self.snapshots.push(self.world.snapshot()),
                1 => self.world.forget_scratch(),
                _ => {
                    if let Some(snapshot) = self.snapshots.get(input.below(self.snapshots.len())) {
                        let _ = self.world.restore(snapshot);
                    }
                }
            },
            _ => self.step(input),
        }
        finite::assert(finite::state(self.world.view()));
        self.read();
    }

    /// Edits of welds, reels and closed threads, cuts, and the integrator.
    fn edit_joined(&mut self, which: u8, input: &mut Input<'_>) {
        match which {
            240..=242 => self.branch(input),
            243 => {
                let places =
                    (0..2 + input.below(2)).filter_map(|_| Some((pick(&self.rods, input)?, place(input)))).collect();
                let rest = input.pick(&[WeldRest::AsInserted, WeldRest::Straight]);
                self.welds.extend(self.world.insert_weld(&WeldSpec { places, rest, anchor: None }));
            }
            244 => {
                if let Some(weld) = pick(&self.welds, input) {
                    let _ = self.world.remove_weld(weld);
                }
            }
            // A seam that is opened, or what else is welded there.
            245 => {
                if let Some(rod) = pick(&self.rods, input)
                    && let Ok(Some(weld)) = self.world.weld_at(rod, input.below(MOST_ELEMENTS) as u32)
                {
                    self.welds.push(weld);
                    let _ = self.world.remove_weld(weld);
                }
            }
            246..=248 => {
                if let Some(rod) = pick(&self.rods, input) {
                    let supply = if input.truth() { Some(input.size(5e-3)) } else { None };
                    self.reels.extend(self.world.insert_reel(&ReelSpec {
                        rod,
                        at_end: input.truth(),
                        law: law(input),
                        supply,
                    }));
                }
            }
            249..=250 => {
                if let Some(reel) = pick(&self.reels, input) {
                    let _ = self.world.set_reel(reel, law(input));
                }
            }
            251..=252 => {
                let integrator = input.pick(&[Integrator::TrBdf2, Integrator::ImplicitEuler]);
                let _ = self.world.set_settings(Settings { integrator, ..self.world.settings().clone() });
            }
            253 => {
                if self.world.view().rods().count() < MOST_THREADS {
                    let material = Material { bend_damping: input.size(0.01), ..Material::elastic(2e9, 1150.0) };
                    let spec = RodSpec::ring(
                        input.vector(2e-3),
                        DVec3::Z,
                        DVec3::X * input.size(5e-3),
                        3 + input.below(10),
                        1.5e-4,
                        material,
                    );
                    let stretch = input.pick(&[Stretch::Elastic, Stretch::Inextensible]);
                    let rest = if input.truth() { RestShape::Straight } else { RestShape::AsInserted };
                    let closure = Some(Closure { twist: input.number(3.0) });
                    self.rods.extend(self.world.insert_rod(&RodSpec { closure, stretch, rest, ..spec }));
                }
            }
            254 => self.remake(input),
            255 if self.world.view().rods().count() < MOST_THREADS => {
                if let Some(rod) = pick(&self.rods, input)
                    && let Ok(cut) = self.world.cut(rod, place(input))
                {
                    self.rods.extend(cut.rest);
                    self.loads.extend(cut.loads.iter().map(|(_, on_rest)| *on_rest));
                }
            }
            _ => self.step(input),
        }
    }

    /// What a thread is made of, whether it stretches, and which solver steps all of them.
    fn remake(&mut self, input: &mut Input<'_>) {
        match input.below(4) {
            0 => {
                if let Some(rod) = pick(&self.rods, input) {
                    let _ = self.world.set_stretch(rod, input.pick(&[Stretch::Elastic, Stretch::Inextensible]));
                }
            }
            1 => {
                let paper = PaperSettings {
                    iterations: 1 + input.below(5) as u32,
                    direct_distance: input.truth(),
                    ..PaperSettings::default()
                };
                let solver = input.pick(&[Solver::Direct, Solver::Paper(paper)]);
                let _ = self.world.set_settings(Settings { solver, ..self.world.settings().clone() });
            }
            _ => {
                if let Some(rod) = pick(&self.rods, input) {
                    let mut material = Material::elastic(input.size(1e9), input.size(1e3));
                    odd_material(&mut material, input.byte(), input);
                    let _ = self.world.set_material(rod, &material);
                }
            }
        }
    }

    /// A thread that begins or ends where another one has a particle, welded to it there.
    fn branch(&mut self, input: &mut Input<'_>) {
        let Some(from) = pick(&self.rods, input) else { return };
        let Ok(view) = self.world.rod(from) else { return };
        let particle = input.below(view.n_elements() + 1);
        let (at, radius) = (view.positions()[particle], view.radius());
        let to = at + input.direction() * input.size(5e-3);
        let n = 1 + input.below(MOST_ELEMENTS);
        let material = Material::elastic(input.size(1e9), 1150.0);
        let (spec, place) = if input.truth() {
            (RodSpec::straight(at, to, n, radius, material), Place::Start)
        } else {
            (RodSpec::straight(to, at, n, radius, material), Place::End)
        };
        if self.world.view().rods().count() >= MOST_THREADS {
            return;
        }
        if let Ok(rod) = self.world.insert_rod(&spec) {
            self.rods.push(rod);
            let mut places = vec![(from, Place::Particle(particle as u32)), (rod, place)];
            if input.truth() {
                places.reverse();
            }
            let rest = input.pick(&[WeldRest::AsInserted, WeldRest::Straight]);
            self.welds.extend(self.world.insert_weld(&WeldSpec { places, rest, anchor: None }));
        }
    }

    fn insert_rod(&mut self, input: &mut Input<'_>) {
        if self.world.view().rods().count() >= MOST_THREADS {
            return;
        }
        let n = 1 + input.below(MOST_ELEMENTS);
        let radius = input.size(1e-4);
        let mut material = Material::elastic(input.size(1e9), input.size(1e3));
        let from = input.vector(2e-3);
        let mut centerline = vec![from];
        let along = input.direction() * input.size(1e-3);
        for _ in 0..n {
            let last = centerline[centerline.len() - 1];
            centerline.push(last + along + if input.truth() { DVec3::ZERO } else { input.vector(4e-4) });
        }
        let odd = input.byte();
        let mut spec = RodSpec::new(centerline, radius, material.clone());
        if odd & 1 != 0 {
            spec.stretch = Stretch::Inextensible;
        }
        if odd & 2 != 0 {
            spec.rest = match input.below(3) {
                0 => RestShape::AsInserted,
                1 => RestShape::Given { lengths: Some((0..n).map(|_| input.size(1e-3)).collect()), darboux: None },
                _ => RestShape::Given { lengths: None, darboux: Some((1..n).map(|_| input.vector(500.0)).collect()) },
            };
        }
        if odd & 4 != 0 {
            let widths = [input.size(1e-4), input.size(1e-4)];
            spec.section = if input.truth() { Section::Ellipse(widths) } else { Section::Rectangle(widths) };
            (spec.roll, spec.pretwist) = (input.number(1.0), input.number(1.0));
        }
        if odd & 8 != 0 {
            let profile =
                |input: &mut Input<'_>| Profile(vec![(0.0, input.size(1.0)), (input.size(1e-3), input.size(1.0))]);
            spec.along = Along { size: profile(input), modulus: profile(input), density: profile(input) };
        }
        odd_material(&mut material, odd, input);
        if odd & 64 != 0 {
            spec.frames = Some((0..n).map(|_| input.rotation()).collect());
        }
        if odd & 128 != 0 {
            spec.closure = Some(Closure { twist: input.number(2.0) });
        }
        spec.material = material;
        spec.surface = input.below(3) as u32;
        self.rods.extend(self.world.insert_rod(&spec));
    }

    fn settings(&mut self, input: &mut Input<'_>) {
        let mut settings = self.world.settings().clone();
        match input.below(8) {
            0 => settings.gravity = input.vector(10.0),
            1 => settings.substep = input.size(2e-3),
            2 => settings.newton_max = 1 + input.below(20) as u32,
            3 => settings.tolerance = input.size(3e-3),
            4 => settings.linear_damping = input.size(0.3),
            5 => settings.angular_damping = input.size(0.3),
            6 => settings.halvings = input.below(5) as u32,
            _ => {
                let friction = Friction { stick: input.size(0.3), slide: input.size(0.1) };
                let _ = self.world.set_friction(input.below(3) as u32, input.below(3) as u32, friction);
            }
        }
        let _ = self.world.set_settings(settings);
    }

    fn step(&mut self, input: &mut Input<'_>) {
        let dt = if input.truth() { 1.0 / 240.0 } else { input.size(2e-3) };
        let settings = self.world.settings();
        let substeps = (dt / settings.substep).ceil().max(1.0) * f64::from(1 << settings.halvings) / 4.0;
        // What is refused as too long costs nothing.
        let most = if self.reels.is_empty() { MOST_SUBSTEPS } else { MOST_REELED };
        if substeps > most && dt / settings.substep <= 1e6 {
            return;
        }
        self.substeps += substeps.min(MOST_SUBSTEPS);
        let report = self.world.step(dt);
        finite::assert(finite::report(&report));
        if report.incidents.is_empty() {
            finite::assert(finite::readings(&self.world));
        }
        if self.world.view().rods().map(|r| r.n_elements()).sum::<usize>() > MOST_FED {
            self.substeps = f64::INFINITY;
        }
    }

    /// What can be read by handle, those of things that are gone too.
    fn read(&self) {
        for grip in &self.grips {
            if let (Ok(pose), Ok(wrench)) = (self.world.grip_pose(*grip), self.world.grip_wrench(*grip)) {
                finite::assert(finite::all("grip", &[pose.position, wrench.force, wrench.torque]));
            }
        }
        for reel in &self.reels {
            if let Ok(fed) = self.world.reel_fed(*reel) {
                finite::assert(finite::one("length fed", fed));
            }
        }
        for shape in &self.shapes {
            if let Ok(wrench) = self.world.shape_wrench(*shape) {
                finite::assert(finite::all("wrench of a shape", &[wrench.force, wrench.torque]));
            }
        }
        for rod in &self.rods {
            if let Ok(rod) = self.world.rod(*rod) {
                assert_eq!(rod.positions().len(), rod.n_elements() + 1);
            }
        }
    }
}

/// A material with more to it than stiffness and mass.
fn odd_material(material: &mut Material, odd: u8, input: &mut Input<'_>) {
    if odd & 16 != 0 {
        material.shear =
            if input.truth() { Shear::Poisson(input.number(0.2)) } else { Shear::Modulus(input.size(1e9)) };
        material.bend_scale = input.size(0.2);
        material.bend_damping = input.size(0.01);
    }
    if odd & 32 != 0 {
        let (yield_curvature, yield_twist, hardening) = (input.size(200.0), input.size(200.0), input.size(0.1));
        material.plasticity = Some(Plasticity { yield_curvature, yield_twist, hardening });
    }
}

fn pick<T: Copy>(of: &[T], input: &mut Input<'_>) -> Option<T> {
    of.get(input.below(of.len())).copied()
}

fn place(input: &mut Input<'_>) -> Place {
    match input.below(5) {
        0 => Place::Start,
        1 => Place::End,
        2 => Place::Particle(u32::from(input.byte()) % 12),
        3 => Place::Element(u32::from(input.byte()) % 12),
        _ => Place::Arc(input.size(2e-3)),
    }
}

fn pose(input: &mut Input<'_>) -> Pose {
    Pose::new(input.vector(3e-3), if input.truth() { input.rotation() } else { Pose::IDENTITY.orientation })
}

fn law(input: &mut Input<'_>) -> ReelLaw {
    if input.truth() { ReelLaw::Rate(input.number(0.1)) } else { ReelLaw::Brake(input.size(0.1)) }
}

fn drive(input: &mut Input<'_>) -> Drive {
    if input.truth() {
        Drive::Pose
    } else {
        Drive::Force { direction: input.direction(), force: input.size(0.1), speed_limit: input.size(0.01) }
    }
}

fn motion(input: &mut Input<'_>) -> ShapeMotion {
    match input.below(3) {
        0 => ShapeMotion::Fixed,
        1 => ShapeMotion::Driven,
        _ => {
            ShapeMotion::Pushed { direction: input.direction(), force: input.size(0.1), speed_limit: input.size(0.01) }
        }
    }
}

fn load(input: &mut Input<'_>) -> LoadKind {
    match input.below(3) {
        0 => LoadKind::Point { place: place(input), force: input.vector(0.01), torque: input.vector(1e-6) },
        1 => LoadKind::Uniform { force_per_length: input.vector(1e-2) },
        _ => LoadKind::Mass { place: place(input), mass: input.size(1e-5), inertia: DVec3::splat(input.size(1e-14)) },
    }
}

fn geometry(input: &mut Input<'_>) -> Geometry {
    match input.below(6) {
        0 => Geometry::Plane,
        1 => Geometry::Sphere { radius: input.size(1e-3) },
        2 => Geometry::Capsule { radius: input.size(1e-3), half_length: input.size(1e-3) },
        3 => Geometry::Cylinder { radius: input.size(1e-3), half_length: input.size(1e-3) },
        4 => Geometry::Box { half_sides: DVec3::new(input.size(1e-3), input.size(1e-3), input.size(1e-3)) },
        _ => {
            let vertices = (0..3 + input.below(4)).map(|_| input.vector(1e-3)).collect();
            let corner = |input: &mut Input<'_>| input.below(7) as u32;
            let triangles = (0..=input.below(4)).map(|_| [corner(input), corner(input), corner(input)]).collect();
            Geometry::Mesh { vertices, triangles }
        }
    }
}
