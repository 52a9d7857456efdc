//! A scene, read and checked: what there is, what happens, what is watched.

use crate::doc::Location;
use crate::error::SceneError;
use crate::expr::{At, Expr, Read};
use crate::motion::Plan;
use crate::units::Unit;
use std::path::{Path, PathBuf};
use sutura::glam::DVec3;
use sutura::{
    BodySpec, Friction, Hold, JointKind, Material, Motor, Place, Plasticity, Pose, ReelLaw, RodSpec, Settings,
    ShapeSpec, Shear, Stretch, WeldRest,
};

/// Most frames of a run: two days at 60 a second. What is recorded and probed is kept in memory.
pub(crate) const MOST_FRAMES: f64 = 1e7;

/// A scene, read from a file and checked.
#[derive(Debug, Clone)]
pub struct Scene {
    pub(crate) name: String,
    pub(crate) title: String,
    pub(crate) description: String,
    pub(crate) frame_rate: f64,
    pub(crate) stills: Vec<f64>,
    pub(crate) camera: Option<Camera>,
    /// Every how many frames one is recorded.
    pub(crate) record_every: u64,
    pub(crate) audit: bool,
    pub(crate) seed: u64,
    pub(crate) settings: Settings,
    pub(crate) frictions: Vec<(u32, u32, Friction, Location)>,
    pub(crate) solver_location: Location,
    /// Those of its own, then the parts that cuts make, in the order in which they come.
    pub(crate) threads: Vec<ThreadDef>,
    /// Number of its own.
    pub(crate) own_threads: usize,
    /// Those of their own, then those of the bodies.
    pub(crate) shapes: Vec<ShapeDef>,
    pub(crate) bodies: Vec<BodyDef>,
    pub(crate) joints: Vec<JointDef>,
    pub(crate) welds: Vec<WeldDef>,
    pub(crate) reels: Vec<ReelDef>,
    pub(crate) grips: Vec<String>,
    pub(crate) loads: Vec<String>,
    pub(crate) start: Option<(PathBuf, Location)>,
    pub(crate) initial: Vec<Step>,
    pub(crate) phases: Vec<Phase>,
    pub(crate) probes: Vec<ProbeDef>,
    pub(crate) profiles: Vec<ProfileDef>,
    pub(crate) checks: Vec<CheckDef>,
}

/// Where a still picture is looked at from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Point in the middle of the picture \[m\]; `None`: the middle of what is there.
    pub look_at: Option<DVec3>,
    /// From the point toward the camera, a unit vector.
    pub from: DVec3,
    /// Upward in the picture, a unit vector.
    pub up: DVec3,
    /// Width of what is seen at the point \[m\]; `None`: all of it.
    pub width: Option<f64>,
}

#[derive(Debug, Clone)]
pub(crate) struct ThreadDef {
    pub name: String,
    pub spec: RodSpec,
    pub location: Location,
    /// Whether the final knot is recognised for the report.
    pub knot: bool,
    /// Tension past which a run warns, and where it comes from.
    pub strength: Option<Strength>,
}

/// Knot-pull strength of a thread.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Strength {
    /// \[N\].
    pub value: f64,
    /// In words.
    pub of: String,
}

#[derive(Debug, Clone)]
pub(crate) struct ShapeDef {
    pub name: String,
    pub spec: ShapeSpec,
    pub location: Location,
}

#[derive(Debug, Clone)]
pub(crate) struct BodyDef {
    pub name: String,
    pub spec: BodySpec,
    pub driven: bool,
    /// Number of the body that holds it at first.
    pub held_by: Option<usize>,
    /// Point of a needle, in its frame.
    pub tip: Option<DVec3>,
    pub location: Location,
}

#[derive(Debug, Clone)]
pub(crate) struct JointDef {
    pub kind: JointKind,
    /// `None` is the world.
    pub bodies: [Option<usize>; 2],
    /// Its frame in the world at the beginning.
    pub at: Pose,
    pub limits: Option<[f64; 2]>,
    pub motor: Option<Motor>,
    pub friction: f64,
    /// Of places and of turning.
    pub compliance: [f64; 2],
    pub touch: bool,
    pub location: Location,
}

#[derive(Debug, Clone)]
pub(crate) struct WeldDef {
    pub places: Vec<(usize, Place)>,
    pub rest: WeldRest,
    pub anchor: Option<AnchorDef>,
    pub location: Location,
}

/// Where a weld is on a body, and what it bears \[N\].
#[derive(Debug, Clone)]
pub(crate) struct AnchorDef {
    pub body: usize,
    pub point: DVec3,
    pub strength: Option<f64>,
}

#[derive(Debug, Clone)]
pub(crate) struct ReelDef {
    pub thread: usize,
    pub at_end: bool,
    pub law: ReelLaw,
    pub supply: Option<f64>,
    pub location: Location,
}

/// A thing of a scene that can be moved, by its number there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mover {
    /// A grip.
    Grip(usize),
    /// A shape.
    Shape(usize),
    /// A body.
    Body(usize),
}

#[derive(Debug, Clone)]
pub(crate) enum Action {
    Take {
        grip: usize,
        thread: usize,
        place: Place,
        hold: Hold,
        ramp: f64,
    },
    LetGo {
        grip: usize,
    },
    Move {
        what: Mover,
        plan: Plan,
    },
    Rest {
        what: Mover,
    },
    /// A body takes another one, rigidly.
    Hold {
        body: usize,
        by: usize,
    },
    /// Nothing holds or drives a body any more.
    Release {
        body: usize,
    },
    Push {
        what: Mover,
        direction: DVec3,
        force: f64,
        speed_limit: f64,
    },
    Load {
        load: usize,
        thread: usize,
        kind: LoadDef,
        ramp: f64,
    },
    Unload {
        load: usize,
    },
    /// Remembers where the thread enters its knot, so that `slip` counts from here.
    Mark {
        thread: usize,
    },
    Gravity {
        value: DVec3,
        ramp: f64,
    },
    Solver {
        linear_damping: Option<f64>,
        angular_damping: Option<f64>,
        linear_drag: Option<f64>,
        angular_drag: Option<f64>,
        substep: Option<f64>,
        newton_max: Option<u32>,
        tolerance: Option<f64>,
    },
    Reel {
        reel: usize,
        law: ReelLaw,
    },
    Friction {
        a: u32,
        b: u32,
        friction: Friction,
    },
    Remake {
        thread: usize,
        change: Remake,
    },
    /// `part` is the rest, which a closed thread has not.
    Cut {
        thread: usize,
        place: Place,
        part: Option<usize>,
    },
}

/// What changes of what a thread is made of; the rest stays.
#[derive(Debug, Clone)]
pub(crate) struct Remake {
    pub young_modulus: Option<f64>,
    pub shear: Option<Shear>,
    pub density: Option<f64>,
    pub bend_scale: Option<f64>,
    pub bend_damping: Option<f64>,
    /// `Some(None)` makes it elastic.
    pub plasticity: Option<Option<Plasticity>>,
    pub stretch: Option<Stretch>,
}

impl Remake {
    /// The material that comes of another one.
    pub fn of(&self, before: &Material) -> Material {
        Material {
            young_modulus: self.young_modulus.unwrap_or(before.young_modulus),
            shear: self.shear.unwrap_or(before.shear),
            density: self.density.unwrap_or(before.density),
            bend_scale: self.bend_scale.unwrap_or(before.bend_scale),
            bend_damping: self.bend_damping.unwrap_or(before.bend_damping),
            plasticity: self.plasticity.unwrap_or(before.plasticity),
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum LoadDef {
    Point { place: Place, force: DVec3, torque: DVec3 },
    Uniform { force_per_length: DVec3 },
    Mass { place: Place, mass: f64, inertia: DVec3 },
}

#[derive(Debug, Clone)]
pub(crate) struct Step {
    pub action: Action,
    pub location: Location,
}

#[derive(Debug, Clone)]
pub(crate) struct Phase {
    pub name: String,
    pub actions: Vec<Step>,
    pub end: End,
    pub save: Option<String>,
    /// Threads whose knot is recognised at its end.
    pub knots: Vec<usize>,
    pub still: bool,
}

#[derive(Debug, Clone)]
pub(crate) enum End {
    After(f64),
    /// When the condition holds, or the motions and ramps begun in the phase are done (`None`).
    When {
        condition: Option<Expr>,
        at_least: f64,
        at_most: f64,
        late: Late,
    },
}

/// What happens when a condition does not come true in time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Late {
    /// The run fails and ends.
    Stop,
    /// The run fails, the next phase begins.
    Fail,
    /// The next phase begins.
    Accept,
}

#[derive(Debug, Clone)]
pub(crate) struct ProbeDef {
    pub name: String,
    pub what: Expr,
    /// Unit of the numbers; `None` is SI.
    pub unit: Option<(String, Unit)>,
    pub every: f64,
}

#[derive(Debug, Clone)]
pub(crate) struct ProfileDef {
    pub name: String,
    pub thread: usize,
    pub what: Vec<(&'static str, Read, &'static [&'static str], &'static str)>,
    pub moment: Moment,
}

/// When something is read once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Moment {
    End,
    Time(f64),
    PhaseEnd(usize),
}

/// When a check looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Span {
    Once(Moment),
    /// From a time to a time \[s\].
    Window(f64, f64),
    During(usize),
}

/// What is made of the values seen in a span.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Take {
    /// Every one must pass; the worst is shown.
    Every,
    First,
    Last,
    Max,
    Min,
    Mean,
    /// Last less first.
    Change,
    /// Greatest less least.
    Range,
}

#[derive(Debug, Clone)]
pub(crate) enum Wanted {
    True,
    Text(String),
    /// Value and allowed difference.
    Near(f64, f64),
    Between(f64, f64),
}

#[derive(Debug, Clone)]
pub(crate) struct CheckDef {
    pub name: String,
    pub that: Expr,
    pub wanted: Wanted,
    /// In words.
    pub words: String,
    pub unit: Option<(String, Unit)>,
    pub span: Span,
    pub take: Take,
}

/// Place of the engine for a place of the scene on a thread of rest length `length`.
pub(crate) fn engine_place(at: At, length: f64) -> Place {
    match at {
        At::Start => Place::Start,
        At::Middle => Place::Arc(0.5 * length),
        At::End => Place::End,
        At::Particle(i) => Place::Particle(i),
        At::Element(i) => Place::Element(i),
        At::Arc(s) => Place::Arc(s),
    }
}

impl Scene {
    /// Reads a scene file. Paths in it are relative to its folder.
    pub fn load(path: &Path) -> Result<Scene, SceneError> {
        Self::load_with(path, &[])
    }
    /// The same with some of its values set from outside, see [`Scene::parse_with`].
    pub fn load_with(path: &Path, settings: &[(String, String)]) -> Result<Scene, SceneError> {
        let text = std::fs::read_to_string(path)
            .map_err(|e| SceneError::of_file(path.display().to_string(), e.to_string()))?;
        Self::parse_with(&text, &path.display().to_string(), settings)
    }
    /// Reads the text of a scene; `file_name` stands in messages, and its folder is where paths start.
    pub fn parse(text: &str, file_name: &str) -> Result<Scene, SceneError> {
        Self::parse_with(text, file_name, &[])
    }
    /// The same with some of its values set from outside, in order: the path of a key (`solver.substep`,
    /// `thread.NAME.elements`, `phase.NAME.action[0].force`) and its value, which is read as TOML and, where it is none
    /// (`2 mm`), as a text.
    pub fn parse_with(text: &str, file_name: &str, settings: &[(String, String)]) -> Result<Scene, SceneError> {
        crate::load::scene(text, file_name, settings)
    }
    /// Name: the file name without its ending.
    pub fn name(&self) -> &str {
        &self.name
    }
    /// Title, or the name.
    pub fn title(&self) -> &str {
        &self.title
    }
    /// What it shows, may be empty.
    pub fn description(&self) -> &str {
        &self.description
    }
    /// Frames per second.
    pub fn frame_rate(&self) -> f64 {
        self.frame_rate
    }
    /// Whether it cuts a thread; `None` asks for any.
    pub(crate) fn cuts(&self, which: Option<usize>) -> bool {
        let cut = |step: &Step| matches!(step.action, Action::Cut { thread, .. } if which.is_none_or(|w| w == thread));
        let taken_up = which.is_none() && self.threads.len() > self.own_threads;
        taken_up || self.phases.iter().flat_map(|p| &p.actions).any(cut)
    }
    /// Longest simulated time that it can take \[s\], as far as it is known beforehand; shorter when conditions end
    /// phases early.
    pub fn duration(&self) -> Option<f64> {
        Some(self.phases.iter().map(Phase::longest).sum())
    }
    /// Times of which stills are wanted \[s\]; times beyond the end mean the end. Phases may ask for one at their end,
    /// which the report marks.
    pub fn stills(&self) -> &[f64] {
        &self.stills
    }
    /// Gravity at its beginning \[m/s^2\].
    pub fn gravity(&self) -> DVec3 {
        self.settings.gravity
    }
    /// File of the saved state from which it starts.
    pub fn start(&self) -> Option<&Path> {
        self.start.as_ref().map(|s| s.0.as_path())
    }
    /// Names of the files of saved states, in the folder of a run.
    pub fn saves(&self) -> impl Iterator<Item = &str> {
        self.phases.iter().filter_map(|p| p.save.as_deref())
    }
    /// How stills are looked at, when the scene says so.
    pub fn camera(&self) -> Option<&Camera> {
        self.camera.as_ref()
    }
}

impl Phase {
    /// Longest time that it can take \[s\].
    pub fn longest(&self) -> f64 {
        match &self.end {
            End::After(d) => *d,
            End::When { condition: None, at_least, .. } => self.motions().max(*at_least),
            End::When { at_most, .. } => *at_most,
        }
    }
    /// Time that its motions and ramps take, as far as known beforehand.
    fn motions(&self) -> f64 {
        let of = |step: &Step| match &step.action {
            Action::Move { plan, .. } => plan.least_duration(),
            Action::Load { ramp, .. } | Action::Gravity { ramp, .. } | Action::Take { ramp, .. } => *ramp,
            _ => 0.0,
        };
        self.actions.iter().map(of).fold(0.0, f64::max)
    }
}
