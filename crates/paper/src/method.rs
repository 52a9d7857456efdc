//! The solvers, behind one interface: that of the rivals. A thread for one is a thread for all.

use sutura::glam::{DQuat, DVec3};
use sutura::{
    Grip, GripSpec, Handle, Integrator, Material, PaperSettings, Place, Pose, RestShape, Rod, RodSpec, Settings, Shear,
    Stretch, SweepOrder, World,
};
use sutura_rivals::{Der, Hold, Pbd, Pber, Scene, Solver, der, pbd, pber};

/// A solver with its settings.
#[derive(Debug, Clone)]
pub enum Method {
    /// Sutura's own.
    Direct(Direct),
    /// The paper's.
    Paper(PaperSettings, u32),
    /// Discrete elastic rods.
    Der(der::Settings),
    /// Position-based elastic rods with ghost points.
    Pber(pber::Settings),
    /// Distances between neighbors and next neighbors.
    Pbd(pbd::Settings),
}

/// Settings of Sutura's own solver.
#[derive(Debug, Clone, Copy)]
pub struct Direct {
    /// Substeps a frame.
    pub substeps: u32,
    /// Newton iterations a substep.
    pub newton_max: u32,
    /// When a substep has converged \[rad\].
    pub tolerance: f64,
    /// How it goes in time.
    pub integrator: Integrator,
}

impl Default for Direct {
    /// As the engine has them: 240 substeps a second at 60 frames.
    fn default() -> Self {
        let s = Settings::default();
        Direct { substeps: 4, newton_max: s.newton_max, tolerance: s.tolerance, integrator: s.integrator }
    }
}

impl Method {
    /// Its name.
    pub fn name(&self) -> &'static str {
        match self {
            Method::Direct(_) => "direct",
            Method::Paper(p, _) if p.order == SweepOrder::TwoColor => "paper, two-color",
            Method::Paper(..) => "paper",
            Method::Der(_) => "DER",
            Method::Pber(_) => "PBER",
            Method::Pbd(_) => "PBD",
        }
    }
    /// Steps a frame and iterations a step, in words.
    pub fn budget(&self) -> String {
        match self {
            Method::Direct(d) => format!("{} x Newton", d.substeps),
            Method::Paper(p, n) => format!("{n} x {}", p.iterations),
            Method::Der(s) => format!("{} x Newton", s.substeps),
            Method::Pber(s) => format!("{} x {}", s.substeps, s.iterations),
            Method::Pbd(s) => format!("{} x {}", s.substeps, s.iterations),
        }
    }
    /// The scene with this solver.
    pub fn start(&self, scene: Scene) -> Box<dyn Solver> {
        // Scenes and settings are those of this crate: a bad one is a fault of the code.
        const GOOD: &str = "scenes of the experiments are valid";
        match self {
            Method::Direct(_) | Method::Paper(..) => Box::new(Ours::new(scene, self)),
            Method::Der(s) => Box::new(Der::new(scene, *s).expect(GOOD)),
            Method::Pber(s) => Box::new(Pber::new(scene, *s).expect(GOOD)),
            Method::Pbd(s) => Box::new(Pbd::new(scene, *s).expect(GOOD)),
        }
    }
}

/// The engine, with either of its solvers.
pub struct Ours {
    /// The world.
    pub world: World,
    /// Its thread.
    pub rod: Handle<Rod>,
    grips: Vec<(Handle<Grip>, Hold, Held)>,
    /// Steps in which something was not found.
    pub incidents: usize,
    /// Frames in which an inextensible thread did not keep its length.
    pub off_length: usize,
    rest: Vec<f64>,
    substeps: u32,
}

/// Which way a held edge lies from the vertex that is led.
#[derive(Clone, Copy)]
struct Held {
    /// Half the length of the edge, along d3 \[m\].
    half: f64,
}

impl Ours {
    /// The scene in a world with one of the engine's solvers.
    pub fn new(scene: Scene, method: &Method) -> Ours {
        let fade = -libm::expm1(-scene.drag);
        let base =
            Settings { gravity: scene.gravity, linear_damping: fade, angular_damping: fade, ..Settings::default() };
        let (settings, substeps, stretch) = match method {
            Method::Paper(p, n) => (Settings { solver: sutura::Solver::Paper(*p), ..base }, *n, Stretch::Elastic),
            Method::Direct(d) => (
                Settings { newton_max: d.newton_max, tolerance: d.tolerance, integrator: d.integrator, ..base },
                d.substeps,
                Stretch::Inextensible,
            ),
            _ => unreachable!("the others are no solvers of the engine"),
        };
        let mut world = World::new(settings).expect("settings of the experiments are valid");
        let thread = &scene.rod;
        let rest = thread.rest_lengths();
        let straight = thread.rest.frames.iter().all(|q| q.dot(thread.rest.frames[0]).abs() > 1.0 - 1e-12);
        assert!(straight || thread.start == thread.rest, "a thread begins straight or at rest");
        let spec = RodSpec {
            frames: Some(thread.start.frames.clone()),
            rest: if straight { RestShape::Straight } else { RestShape::AsInserted },
            stretch,
            ..RodSpec::new(
                thread.start.points.clone(),
                thread.radius,
                Material { shear: Shear::Modulus(thread.shear), ..Material::elastic(thread.young, thread.density) },
            )
        };
        let rod = world.insert_rod(&spec).expect("threads of the experiments are valid");
        let n = rest.len();
        let mut grips = Vec::new();
        for (place, hold, half) in
            [(Place::Start, scene.first, 0.5 * rest[0]), (Place::End, scene.last, -0.5 * rest[n - 1])]
        {
            let kind = match &hold {
                Hold::Free => continue,
                Hold::Pin(_) => sutura::Hold::Pin,
                Hold::Clamp(_) => sutura::Hold::Jaw,
            };
            let grip = world.insert_grip(&GripSpec::at_once(rod, place, kind)).expect("the ends are free");
            grips.push((grip, hold, Held { half }));
        }
        for (vertex, force) in scene.loads {
            let kind = sutura::LoadKind::Point { place: Place::Particle(vertex as u32), force, torque: DVec3::ZERO };
            world.insert_load(&sutura::LoadSpec { rod, kind }).expect("loads of the experiments are valid");
        }
        Ours { world, rod, grips, incidents: 0, off_length: 0, rest, substeps }
    }
    /// Lets the end go that was held last.
    pub fn let_go(&mut self) {
        if let Some((grip, ..)) = self.grips.pop() {
            self.world.remove_grip(grip).expect("the grip is there");
        }
    }
}

impl Solver for Ours {
    fn step(&mut self, frame: f64) {
        let mut settings = self.world.settings().clone();
        // A little more, so that rounding makes no step more.
        settings.substep = frame / f64::from(self.substeps) * (1.0 + 1e-9);
        if settings.substep != self.world.settings().substep {
            self.world.set_settings(settings).expect("valid settings");
        }
        let t = self.world.time() + frame;
        for (grip, hold, held) in &self.grips {
            let pose = match hold {
                Hold::Free => continue,
                Hold::Pin(at) => Pose::new(at(t), DQuat::IDENTITY),
                Hold::Clamp(at) => {
                    let pose = at(t);
                    Pose::new(pose.position + pose.orientation * DVec3::Z * held.half, pose.orientation)
                }
            };
            self.world.set_grip_pose(*grip, pose).expect("a pose of the experiment");
        }
        let incidents = self.world.step(frame).incidents;
        let off = incidents.iter().filter(|i| matches!(i.kind, sutura::IncidentKind::LengthNotKept { .. })).count();
        (self.incidents, self.off_length) = (self.incidents + incidents.len() - off, self.off_length + off);
    }
    fn time(&self) -> f64 {
        self.world.time()
    }
    fn positions(&self) -> &[DVec3] {
        self.world.rod(self.rod).expect("the thread is there").positions()
    }
    fn frames(&self) -> Option<Vec<DQuat>> {
        Some(self.world.rod(self.rod).expect("the thread is there").orientations().to_vec())
    }
    fn rest_lengths(&self) -> &[f64] {
        &self.rest
    }
}
