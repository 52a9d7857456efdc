//! A scene as data: what is inserted, how grips move, and what is done at which frame.

use sutura::glam::DVec3;
use sutura::{
    Drive, Friction, Hold, LoadKind, Material, Place, Pose, ReelLaw, RodSpec, Settings, ShapeSpec, Stretch, WeldRest,
};

/// A scene.
#[derive(Debug, Clone)]
pub struct Scene {
    /// Settings of its world.
    pub settings: Settings,
    /// Friction between surfaces.
    pub frictions: Vec<(u32, u32, Friction)>,
    /// Threads, with explicit frames where it is to be transformed.
    pub rods: Vec<RodSpec>,
    /// Places of threads that are joined.
    pub welds: Vec<Joined>,
    /// Reels.
    pub reels: Vec<Reeled>,
    /// Shapes.
    pub shapes: Vec<ShapeSpec>,
    /// Grips.
    pub grips: Vec<Held>,
    /// Loads: number of the thread, and the load.
    pub loads: Vec<(usize, LoadKind)>,
    /// Length of a frame \[s\].
    pub frame: f64,
    /// Number of frames.
    pub frames: u32,
    /// What is done at the beginning of which frame, in any order.
    pub acts: Vec<(u32, Act)>,
    /// Whether shapes and loads are inserted before threads and grips. It must not matter.
    pub other_order: bool,
}

/// A grip over the time of a scene.
#[derive(Debug, Clone)]
pub struct Held {
    /// Number of the thread.
    pub rod: usize,
    /// Where.
    pub place: Place,
    /// How.
    pub hold: Hold,
    /// What moves it.
    pub drive: Drive,
    /// Time over which it takes hold \[s\].
    pub ramp: f64,
    /// Frames at whose beginning it takes hold and lets go.
    pub from: u32,
    /// See `from`.
    pub until: u32,
    /// Velocity of its pose from where it was taken \[m/s\].
    pub velocity: DVec3,
    /// Angular velocity of its pose, world axes \[rad/s\].
    pub spin: DVec3,
}

/// Places of threads that are joined for a time.
#[derive(Debug, Clone)]
pub struct Joined {
    /// Numbers of the threads, and where.
    pub places: Vec<(usize, Place)>,
    /// Shape at rest.
    pub rest: WeldRest,
    /// Frame at whose beginning they come apart.
    pub until: u32,
}

/// A reel.
#[derive(Debug, Clone, Copy)]
pub struct Reeled {
    /// Number of the thread.
    pub rod: usize,
    /// At which end.
    pub at_end: bool,
    /// What it does, and what from some frame on.
    pub law: ReelLaw,
    /// See `law`.
    pub later: Option<(u32, ReelLaw)>,
    /// What is on it, in lengths of the thread as inserted.
    pub supply: Option<f64>,
}

/// Something done while it runs. Numbers are those of the scene's lists; what is not there (any more) is passed over.
#[derive(Debug, Clone)]
pub enum Act {
    /// A thread is removed.
    RemoveRod(usize),
    /// A thread is inserted.
    InsertRod(Box<RodSpec>),
    /// A thread is made of something else.
    Material(usize, Material),
    /// A thread stretches or does not.
    Stretch(usize, Stretch),
    /// A shape is removed.
    RemoveShape(usize),
    /// A driven shape is to go there.
    ShapePose(usize, Pose),
    /// Other settings.
    Settings(Settings),
    /// A load changes.
    Load(usize, LoadKind),
    /// What moves a grip changes.
    Drive(usize, Drive),
    /// A grip is to go there.
    GripPose(usize, Pose),
}

impl Scene {
    /// Whether nothing from outside does work but loads that have a potential: its energy must not grow.
    pub fn is_passive(&self) -> bool {
        let still = |g: &Held| {
            g.drive == Drive::Pose && g.ramp == 0.0 && g.from == 0 && g.velocity == DVec3::ZERO && g.spin == DVec3::ZERO
        };
        let potential = |kind: &LoadKind| !matches!(kind, LoadKind::Point { torque, .. } if *torque != DVec3::ZERO);
        let fixed = |s: &ShapeSpec| s.motion == sutura::ShapeMotion::Fixed;
        let ever = |w: &Joined| w.until == u32::MAX;
        self.reels.is_empty()
            && self.welds.iter().all(ever)
            && self.grips.iter().all(still)
            && self.loads.iter().all(|(_, k)| potential(k))
            && self.shapes.iter().all(fixed)
            && self.acts.is_empty()
    }

    /// Sum of the lengths of its threads \[m\].
    pub fn length(&self) -> f64 {
        self.rods.iter().map(|r| length(r, &r.centerline)).sum()
    }
}

/// Length of a thread along `centerline`, that of a closed one all around.
pub fn length(rod: &RodSpec, centerline: &[DVec3]) -> f64 {
    let open: f64 = centerline.windows(2).map(|w| w[0].distance(w[1])).sum();
    let closing = rod.closure.map(|_| centerline[0].distance(centerline[centerline.len() - 1]));
    open + closing.unwrap_or(0.0)
}

/// Number of its elements.
pub fn elements(rod: &RodSpec) -> u32 {
    rod.centerline.len() as u32 - u32::from(rod.closure.is_none())
}
