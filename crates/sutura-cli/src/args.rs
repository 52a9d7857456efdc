//! What can be typed. The texts here are the manual of the program: each command says what it reads, what it writes and
//! what its exit code means, and shows examples.

use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;

/// Real-time simulator of surgical thread: it ties knots that hold by friction, says which knot it is and measures the
/// forces.
#[derive(Parser, Debug)]
#[command(name = "sutura", version, arg_required_else_help = false, subcommand_required = false, after_help = EXAMPLES)]
pub struct Cli {
    /// What to do; without it, the built-in scene `square_knot` is run.
    #[command(subcommand)]
    pub command: Option<Command>,
}

const EXAMPLES: &str = "\
Examples:
  sutura                        tie a square knot (same as `sutura run square_knot`)
  sutura scenes                 list the built-in scenes
  sutura scenes copy capstan    copy one to ./capstan.toml, to change it
  sutura run capstan.toml       run it; pictures, plots and numbers go to out/capstan
  sutura knot out/capstan/trajectory.sutura
                                say which knot a recording ends with
  sutura export overhand --out overhand.glb
                                a film for Blender, a browser or a game engine

Exit codes: 0 all is well; 1 a check of the scene failed; 2 the input could not be used, or the results not be written. `sutura knot` has two more.";

/// The commands.
#[derive(Subcommand, Debug)]
pub enum Command {
    /// Run a scene: simulate, measure, check, plot and draw it
    Run(Run),
    /// List the built-in scenes, show one or copy one out
    Scenes(Scenes),
    /// Say which knot a polyline or a recorded thread is tied in
    Knot(Knot),
    /// Tie knots, pull their loops apart, and say at what force they slip, come undone or break
    KnotStrength(KnotStrength),
    /// List sizes and materials of surgical thread with their sources
    Presets(Presets),
    /// Measure the speed of this build on this machine
    Bench(Bench),
    /// Compare what this build computes with theory
    Validate(Validate),
    /// Run the experiments of the 2018 paper on its solver, its rivals and Sutura's own
    Paper(Paper),
    /// Do a recorded input again and compare the state after every step
    Replay(Replay),
    /// Write a scene or a recording as glTF (GLB), VTK, OBJ or CSV, for other programs
    Export(Export),
    /// Show a scene or a recording in a window, and take hold of it with the mouse
    View(View),
}

/// Show a scene or a recording in a window, and take hold of it with the mouse.
#[derive(Args, Debug)]
#[command(after_help = "\
This starts `sutura-view`, a program of its own that is built apart (docs/viewer.md); where it is not found, how to get it is said.

Examples:
  sutura view square_knot                             a built-in scene, by name
  sutura view out/square_knot/trajectory.sutura       a recorded run
  sutura view capstan --headless --screenshot c.png   what follows the scene goes to the viewer: `sutura-view --help`

Exit codes: 0 the window was closed; 1 the viewer ended with an error; 2 there is no viewer.")]
pub struct View {
    /// Scene file, trajectory, or the name of a built-in scene [default: square_knot]
    #[arg(value_name = "SCENE_OR_TRAJECTORY")]
    pub scene: Option<String>,
    /// Arguments for the viewer
    #[arg(value_name = "ARGUMENTS", trailing_var_arg = true, allow_hyphen_values = true)]
    pub rest: Vec<String>,
}

/// Run a scene: simulate, measure, check, plot and draw it.
#[derive(Args, Debug, Default)]
#[command(after_help = "\
The folder then holds:
  report.json         what was found: times, clearances, tensions, knots, checks, incidents
  series/*.csv        probes and profiles; `frame.csv` has the numbers of every frame
  plots/*.png, *.svg  the same as curves
  stills/*.png        pictures of the whole thread and of its knot
  trajectory.sutura   positions and orientations of every recorded frame
  input.sutura        with --record: what was done to the world, for `sutura replay`
Results of an earlier run in the same folder are removed before the run begins, and nothing else is: where a file of somebody else is in the \
way, the run is refused, and so is one while another writes there. The report is written last: a folder without one is of a run that did not end.

Examples:
  sutura run square_knot                       a built-in scene, by name
  sutura run my.toml --out /tmp/my --no-plots  a scene file
  sutura run my.toml --still 0.5 --still 2     pictures at these times [s]
  sutura run catenary --set thread.thread.elements=25 --set \"solver.substep=1 ms\"
                                               a scene with other values
  sutura run overhand --quiet && echo tied     for scripts

Exit codes: 0 every check holds; 1 a check failed; 2 the scene could not be read, or the results not be written.")]
pub struct Run {
    /// Scene file, or the name of a built-in scene
    #[arg(value_name = "SCENE", default_value = "square_knot")]
    pub scene: String,
    /// Folder for the results [default: out/<scene>]
    #[arg(long, short, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Value for a key of the scene instead of its own, for instance `thread.silk.elements=50`: names with points
    /// between them, an entry without a name by its number, as in `phase[0].action[1].force`; may be given several
    /// times
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = setting)]
    pub settings: Vec<(String, String)>,
    /// Draw no plots
    #[arg(long)]
    pub no_plots: bool,
    /// Draw no pictures
    #[arg(long)]
    pub no_stills: bool,
    /// Write no trajectory
    #[arg(long)]
    pub no_trajectory: bool,
    /// Write no file at all
    #[arg(long, conflicts_with_all = ["out", "no_plots", "no_stills", "no_trajectory"])]
    pub dry: bool,
    /// Time of a picture [s], instead of the scene's; may be given several times
    #[arg(long = "still", value_name = "TIME", value_parser = time)]
    pub stills: Vec<f64>,
    /// Size of the pictures in pixels
    #[arg(long, value_name = "WIDTHxHEIGHT", default_value = "1200x900", value_parser = size)]
    pub picture_size: (u32, u32),
    /// Direction in which the pictures look, for instance `0,1,-0.5` [default: the scene's, or one from which the knot
    /// is seen well]
    #[arg(long, value_name = "X,Y,Z", value_parser = direction, allow_hyphen_values = true)]
    pub look: Option<[f64; 3]>,
    /// Record what is done to the world, with the state hash after every step, as input.sutura for `sutura replay`
    #[arg(long, conflicts_with = "dry")]
    pub record: bool,
    /// Draw no progress bar and no table
    #[arg(long, short)]
    pub quiet: bool,
}

/// List the built-in scenes, show one or copy one out.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  sutura scenes
  sutura scenes show overhand
  sutura scenes copy overhand my.toml && sutura run my.toml")]
pub struct Scenes {
    /// What to do with them; without it, they are listed
    #[command(subcommand)]
    pub action: Option<ScenesAction>,
}

/// What to do with the built-in scenes.
#[derive(Subcommand, Debug)]
pub enum ScenesAction {
    /// List them with their titles
    List,
    /// Print the text of one
    Show {
        /// Name of the scene
        name: String,
    },
    /// Write one to a file; a file that exists is kept
    Copy {
        /// Name of the scene
        name: String,
        /// File to write [default: <name>.toml]
        file: Option<PathBuf>,
        /// Replace a file that exists
        #[arg(long)]
        force: bool,
    },
}

/// Say which knot a polyline or a recorded thread is tied in.
#[derive(Args, Debug)]
#[command(after_help = "\
FILE is a table of points in order (comma-separated x, y, z; any unit; a line of headings and lines that begin with # are passed \
over), or the trajectory of a run.

An open thread is no knot until its ends are joined. `--ends held` joins them far away along rays outward from the ends, as when two \
instruments hold them; `--ends free` tries 24 random closures, trims the tails, and calls the knot unknown when under 90 % agree.

The name is topology, which a flat knot keeps when it capsizes into half hitches. Where the diameter is known and the knot has a loop, \
the line `form` says how it lies: flat when both strands turn alike (one at most 1.5 times as much as the other), capsized when one goes nearly straight through \
(a third of the other's turning, or less).

Examples:
  sutura knot thread.csv
  sutura knot thread.csv --diameter 0.225
  sutura knot ring.csv --closed --json
  sutura knot out/square_knot/trajectory.sutura --time 4.5 --ends held
  sutura knot thread.csv --expect square

A knot that is certain but has no name here is called `unnamed`, with the invariants that it has; one that is not certain `unknown`, with those of most views.

Exit codes: 0 recognized (or as expected); 1 not what `--expect` wants; 2 the file could not be read; without `--expect` also 3 certain, but without a \
name here; 4 not certain.")]
pub struct Knot {
    /// Table of points (CSV) or trajectory
    pub file: PathBuf,
    /// The last point is joined to the first
    #[arg(long, conflicts_with = "ends")]
    pub closed: bool,
    /// How the ends of an open thread are joined
    #[arg(long, value_enum, default_value_t = EndsOption::Free)]
    pub ends: EndsOption,
    /// Frame of a trajectory, from 0; negative counts from the end [default: the last]
    #[arg(long, value_name = "N", allow_negative_numbers = true, conflicts_with = "time")]
    pub frame: Option<i64>,
    /// Time in a trajectory [s]; the nearest frame is taken
    #[arg(long, value_name = "TIME", value_parser = time)]
    pub time: Option<f64>,
    /// Thread of a trajectory, by name [default: the first]
    #[arg(long, value_name = "NAME")]
    pub thread: Option<String>,
    /// Diameter of the thread in the unit of the points, to tell a flat knot from a capsized one [default: that of the
    /// trajectory]
    #[arg(long, value_name = "D", value_parser = positive)]
    pub diameter: Option<f64>,
    /// Seed of the random views and closures
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Name that the knot must have, for instance `square` or `trefoil-left`
    #[arg(long, value_name = "NAME")]
    pub expect: Option<String>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// How the ends of an open thread are joined.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum EndsOption {
    /// Along rays outward from the ends
    Held,
    /// By many random closures, which must agree
    Free,
}

/// Tie knots, pull their loops apart, and say at what force they slip, come undone or break.
#[derive(Args, Debug)]
#[command(after_help = "\
A case is one sequence of throws, tied around a post, drawn by its tails with one pretension at one friction of thread on thread. The tails \
are let go; what tension is left in the loop and how the knot lies is noted. Then the post is parted, which pulls the loop apart at a \
steady speed (30 diameters a second), until the knot comes undone, or the tension passes the knot-pull strength of the thread, or the loop is \
180 diameters longer. All throws are drawn at once, and a knot still tightens under the first of the load: a slip of a few diameters may be that.

Throws: square, granny, surgeon, surgeon-granny, square+throw, granny+throw, surgeon+throw, or in the notation of surgeons: 1 single, \
2 double; `=` before a throw that mirrors the one before, `x` before one of the same hand. 1=1 is a square knot, 1x1 a granny, 2=1 a surgeon's.

Material: numbers of `sutura presets`, which are unverified where they say so; friction, plastic set and damping (10 ms) are assumed. Without \
--plastic an elastic thread springs open, and holds less than a real one.

The folder then holds:
  knot_strength.md             tables
  knot_strength.csv            every case in full
  knot_strength_pulls.csv      force over growth of the loop, frame by frame
  knot_strength.svg, .png      force until a tail slips, over friction
  knot_strength_peak.svg, .png   greatest force until it comes undone or breaks, over friction

The numbers do not depend on --threads; only a case that is given up after --budget depends on the machine, and the table says so. The default \
is 10 cases, a minute or two on two cores.

Examples:
  sutura knot-strength --plastic
  sutura knot-strength --throws square,granny,2=1=1 --mu 0.1,0.3 --pretension 0.5N,2N
  sutura knot-strength --size 2-0 --material polypropylene --out /tmp/pp
  sutura knot-strength --diameter 0.3mm --modulus 2GPa --strength 12N --list

Exit codes: 0 done; 2 the input could not be used.")]
pub struct KnotStrength {
    /// USP size of the thread
    #[arg(long, value_name = "SIZE", default_value = "3-0")]
    pub size: String,
    /// Material of the thread, by its preset
    #[arg(long, value_name = "NAME", default_value = "silk")]
    pub material: String,
    /// Diameter, instead of that of the size; give --strength with it
    #[arg(long, value_name = "LENGTH", value_parser = length, requires = "strength")]
    pub diameter: Option<f64>,
    /// Young's modulus, instead of the material's
    #[arg(long, value_name = "PRESSURE", value_parser = pressure)]
    pub modulus: Option<f64>,
    /// Bending stiffness over that of a solid rod, instead of the material's
    #[arg(long, value_name = "PART", value_parser = positive)]
    pub bend_scale: Option<f64>,
    /// Knot-pull strength, instead of the least of size and kind of material
    #[arg(long, value_name = "FORCE", value_parser = force)]
    pub strength: Option<f64>,
    /// Sequences of throws
    #[arg(long, value_name = "THROWS", value_delimiter = ',', default_value = "square,granny")]
    pub throws: Vec<String>,
    /// Coefficients of friction of thread on thread
    #[arg(long, value_name = "MU", value_delimiter = ',', default_value = "0.1,0.2,0.3,0.4,0.5", value_parser = friction)]
    pub mu: Vec<f64>,
    /// Forces with which the tails are drawn
    #[arg(long, value_name = "FORCE", value_delimiter = ',', default_value = "1N", value_parser = force)]
    pub pretension: Vec<f64>,
    /// Bends and twist become permanent beyond a strain of 5.6 % at the surface
    #[arg(long)]
    pub plastic: bool,
    /// Length of tail drawn through at which a knot counts as slipping, in diameters; 8 are the 1.8 mm of surgical
    /// tests with 3-0 thread
    #[arg(long, value_name = "DIAMETERS", default_value_t = sutura_studies::strength::SLIP, value_parser = positive)]
    pub slip: f64,
    /// CPU time after which a case is given up [s]
    #[arg(long, value_name = "TIME", default_value_t = 120.0, value_parser = positive)]
    pub budget: f64,
    /// Folder for tables and plots
    #[arg(long, short, value_name = "DIR", default_value = "out/knot-strength")]
    pub out: PathBuf,
    /// Threads of execution [default: as many as there are cores]
    #[arg(long, short, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub threads: Option<u16>,
    /// List the cases, run nothing
    #[arg(long)]
    pub list: bool,
    /// Print a line for each case instead of a progress bar
    #[arg(long, short)]
    pub verbose: bool,
}

/// List sizes and materials of surgical thread with their sources.
#[derive(Args, Debug)]
#[command(after_help = "\
A number marked with * is unverified: recalled or assumed, not read in the source named. Replace it where it matters.

Examples:
  sutura presets
  sutura presets --json")]
pub struct Presets {
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Measure the speed of this build on this machine.
#[derive(Args, Debug)]
#[command(after_help = "\
A free thread (15 cm, radius 0.1 mm, one end pinned) is dropped, 60 frames a second; swings are compared with their path; the tube that \
draws a thread is posed; then the overhand and the square knot are tied and a plectoneme is wound. \
Times are CPU times of the solver on one core; the median of a frame is the number to compare. Build with --release.

Examples:
  sutura bench
  sutura bench --free --elements 120 --elements 500
  sutura bench --json > bench.json")]
pub struct Bench {
    /// Only the free thread
    #[arg(long)]
    pub free: bool,
    /// Only the knots
    #[arg(long, conflicts_with = "free")]
    pub knots: bool,
    /// Number of elements of the free thread; may be given several times [default: 40, 120, 500, 2000]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub elements: Vec<u32>,
    /// Shape of the free thread before it is dropped [default: both]
    #[arg(long, value_enum)]
    pub shape: Option<FreeShape>,
    /// Frames of the free thread
    #[arg(long, default_value_t = 120, value_parser = clap::value_parser!(u32).range(1..))]
    pub frames: u32,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Shape of the free thread.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum FreeShape {
    /// Held out level
    Straight,
    /// Wound as a helix at rest
    Helix,
}

/// Compare what this build computes with theory: closed forms, tables, independent routines.
#[derive(Args, Debug)]
#[command(after_help = "\
Each case is a scene of scenes/validation, run several times with more elements, shorter substeps or other settings. What is measured \
is compared with its reference: the error, and the order at which it falls. The folder then holds:
  validation.md            a table for each section; what misses its bar is in it, with the reason where that is known
  validation/*.svg         plots against theory
  validation/results.json  the same numbers in full, also as results.csv

The numbers do not depend on --jobs. All cases take about two minutes.

Examples:
  sutura validate                   everything, to out/validation.md
  sutura validate 1 3               sections 1 and 3
  sutura validate \"own weight\"      cases with that in their names
  sutura validate --quick           a few quick cases
  sutura validate --list            what there is
  sutura validate --out docs        writes docs/validation.md

Exit codes: 0 all within their bars; 1 something is not; 2 the input could not be used.")]
pub struct Validate {
    /// Numbers of sections, or parts of names of cases [default: everything]
    #[arg(value_name = "SECTION|CASE")]
    pub cases: Vec<String>,
    /// Folder for tables and plots
    #[arg(long, short, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// How many runs at once [default: as many as there are cores]
    #[arg(long, short, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub jobs: Option<u16>,
    /// Only a few quick cases
    #[arg(long)]
    pub quick: bool,
    /// List the cases, run nothing
    #[arg(long)]
    pub list: bool,
    /// Say which run was done and how long it took, instead of a progress bar
    #[arg(long, short)]
    pub verbose: bool,
    /// Write no file, print what missed its bar
    #[arg(long, conflicts_with = "out")]
    pub dry: bool,
}

/// Run the experiments of the 2018 paper on its solver, its rivals and Sutura's own.
#[derive(Args, Debug)]
#[command(after_help = "\
The paper is \"Real-time inextensible surgical thread simulation\" (Int. J. CARS 13:1019, 2018). Each experiment is run on all solvers that belong to it: \
the paper's at the size at which its numbers come out and at the size that it names, Sutura's own, discrete elastic rods, position-based elastic rods with ghost points, \
plain position-based dynamics. The folder then holds:
  paper.md                 one page: what the paper reports beside what is found
  paper.html               the same in one file that needs no other
  paper/*.svg, *.png       plots, pictures of the thread
  paper/*.csv              the numbers; the same bytes on every run
  paper/times.json         times measured

Examples:
  sutura paper                      everything, to out/paper.md
  sutura paper fig8 fig13           two experiments
  sutura paper --list               what there is
  sutura paper all --out docs       writes docs/paper.md

Exit codes: 0 all as asked for; 1 something is not; 2 the input could not be used.")]
pub struct Paper {
    /// Names of experiments [default: all]
    #[arg(value_name = "FIGURE")]
    pub figures: Vec<String>,
    /// Folder for the page, plots and tables
    #[arg(long, short, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// How many runs at once [default: as many as there are cores]
    #[arg(long, short, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub jobs: Option<u16>,
    /// List the experiments, run nothing
    #[arg(long)]
    pub list: bool,
    /// Say which run was done and how long it took, instead of a progress bar
    #[arg(long, short)]
    pub verbose: bool,
}

/// Do a recorded input again and compare the state after every step.
#[derive(Args, Debug)]
#[command(after_help = "\
FILE holds everything that was done to a world, step by step, and the hash of the state after each step: `sutura run --record` writes one. \
The same input gives the same states in every build and on every machine. Where it does not, the first step that differs is told, and \
what was done before it; to see by how much, write the state there from both machines (--until, --state) and compare the tables.

Examples:
  sutura run overhand --record && sutura replay out/overhand/input.sutura
  sutura replay here.sutura --with there.sutura       compare two recordings, run nothing
  sutura replay input.sutura --list                   say what was done, run nothing
  sutura replay input.sutura --hashes | tail -n 1     the recorded hash of the last state
  sutura replay input.sutura --until 0.5 --state here.csv
                                                      the numbers of the state at half a second

Exit codes: 0 the same after every step; 1 it differs; 2 the file could not be used.")]
pub struct Replay {
    /// Recorded input
    pub file: PathBuf,
    /// Compare with this recording instead of running: inputs and states
    #[arg(long, value_name = "FILE", conflicts_with_all = ["until", "state", "list", "hashes"])]
    pub with: Option<PathBuf>,
    /// Stop at this simulated time [s]
    #[arg(long, value_name = "TIME", value_parser = time)]
    pub until: Option<f64>,
    /// Write the numbers of the last state here, a table with their bits
    #[arg(long, value_name = "FILE")]
    pub state: Option<PathBuf>,
    /// List what was done, run nothing
    #[arg(long, conflicts_with_all = ["until", "state", "hashes"])]
    pub list: bool,
    /// Print the recorded hash of the state after each step, one a line, run nothing
    #[arg(long, conflicts_with_all = ["until", "state"])]
    pub hashes: bool,
    /// Print nothing when all is the same
    #[arg(long, short)]
    pub quiet: bool,
}

/// Write a scene or a recording as glTF (GLB), VTK, OBJ or CSV, for other programs.
#[derive(Args, Debug)]
#[command(after_help = "\
SOURCE is a trajectory that `sutura run` wrote, or a scene, which is then run. Lengths are meters, in all formats.

  glb   one file, glTF 2.0: each thread a skinned tube with a joint an element (the path of a joint is that of the middle of its element), with a \
braid texture that shows twist; shapes as nodes; one animation. Blender, three.js, Bevy, Godot, Unity and Windows open it.
  vtk   a folder for ParaView: threads.pvd and shapes.pvd. Threads are polylines with the fields arc, radius, curvature, twist, d1, d2, d3, and, \
where a scene is run, tension, velocity and contact_force: a recording has no forces. Filter `Tube` with `Vary Radius By Absolute Scalar` draws \
them with their radius.
  obj   the last frame as one file (--out ends in .obj), or a folder with a file a frame.
  csv   a table: time, thread, particle, position, and the material frame of the element after it as a quaternion.

Frames are those that there are, at most --fps a second; the same input gives the same bytes.

Examples:
  sutura export square_knot --out knot.glb --up z   run a scene, for a game engine
  sutura export out/overhand/trajectory.sutura --out overhand.glb --fps 60
                                                    what was recorded
  sutura export overhand --format vtk --out /tmp/overhand --to 2
                                                    the first two seconds with their forces, for ParaView
  sutura export out/overhand/trajectory.sutura --out tied.obj --sides 24
                                                    the knot as it ends, for a printer
  sutura export catenary --format csv               to out/catenary/catenary.csv

Exit codes: 0 written; 2 it could not be.")]
pub struct Export {
    /// Trajectory, scene file, or the name of a built-in scene
    #[arg(value_name = "SCENE_OR_TRAJECTORY")]
    pub source: String,
    /// Kind of file [default: by the ending of --out]
    #[arg(long, short, value_enum)]
    pub format: Option<ExportFormat>,
    /// File to write, or folder of a series [default: out/<scene>/...]
    #[arg(long, short, value_name = "FILE|DIR")]
    pub out: Option<PathBuf>,
    /// Frames a second, at most
    #[arg(long, value_name = "N", default_value_t = 30.0, value_parser = positive)]
    pub fps: f64,
    /// First time [s]
    #[arg(long, value_name = "TIME", default_value_t = 0.0, value_parser = time)]
    pub from: f64,
    /// Last time [s] [default: the end]
    #[arg(long, value_name = "TIME", value_parser = time)]
    pub to: Option<f64>,
    /// Vertices around a thread (glb, obj)
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u16).range(3..=256))]
    pub sides: u16,
    /// Rings of vertices an element (glb, obj)
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u16).range(1..=64))]
    pub rings: u16,
    /// Axis of the scene that viewers show as up (glb)
    #[arg(long, value_enum, value_name = "AXIS", default_value_t = Axis::Y)]
    pub up: Axis,
    /// Value for a key of the scene instead of its own, as in `sutura run`
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = setting)]
    pub settings: Vec<(String, String)>,
    /// Draw no progress bar, print nothing
    #[arg(long, short)]
    pub quiet: bool,
}

/// Axis of a scene.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// As in glTF: nothing is turned
    Y,
    /// Against gravity, where a scene does not say otherwise
    Z,
    /// The third one
    X,
}

/// Kind of file.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExportFormat {
    /// glTF 2.0, binary
    Glb,
    /// VTK PolyData with fields
    Vtk,
    /// Wavefront OBJ
    Obj,
    /// Table
    Csv,
}

fn setting(text: &str) -> Result<(String, String), String> {
    let (key, value) = text.split_once('=').ok_or("wanted KEY=VALUE, for instance thread.silk.elements=50")?;
    Ok((key.trim().into(), value.trim().into()))
}

fn time(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|t: &f64| t.is_finite() && *t >= 0.0).ok_or_else(|| "wanted a time >= 0 in seconds".into())
}

fn quantity(text: &str, unit: &str) -> Result<f64, String> {
    let value = sutura_scene::in_si(text, unit)?;
    if value > 0.0 { Ok(value) } else { Err(format!("wanted more than 0 {unit}")) }
}

fn length(text: &str) -> Result<f64, String> {
    quantity(text, "m")
}

fn pressure(text: &str) -> Result<f64, String> {
    quantity(text, "Pa")
}

fn force(text: &str) -> Result<f64, String> {
    quantity(text, "N")
}

fn friction(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|v| (0.0..=1.0).contains(v)).ok_or_else(|| "wanted a number from 0 to 1".into())
}

fn positive(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|v: &f64| v.is_finite() && *v > 0.0).ok_or_else(|| "wanted a number > 0".into())
}

fn size(text: &str) -> Result<(u32, u32), String> {
    let wanted = || "wanted WIDTHxHEIGHT in pixels, each from 16 to 8192, for instance 1200x900".to_string();
    let (w, h) = text.split_once('x').ok_or_else(wanted)?;
    let one = |t: &str| t.parse().ok().filter(|v| (16..=8192).contains(v)).ok_or_else(wanted);
    Ok((one(w)?, one(h)?))
}

fn direction(text: &str) -> Result<[f64; 3], String> {
    let wanted = || "wanted three numbers with commas, not all zero, for instance 0,1,-0.5".to_string();
    let v: Vec<f64> = text.split(',').map(|t| t.trim().parse()).collect::<Result<_, _>>().map_err(|_| wanted())?;
    let v: [f64; 3] = v.try_into().map_err(|_| wanted())?;
    (v.iter().all(|c| c.is_finite()) && v.iter().any(|c| *c != 0.0)).then_some(v).ok_or_else(wanted)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory as _;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn values_are_checked_where_they_are_typed() {
        assert_eq!(size("640x480"), Ok((640, 480)));
        assert!(size("640").is_err() && size("0x5").is_err() && size("99999x20").is_err());
        assert_eq!(direction("0,1,-0.5"), Ok([0.0, 1.0, -0.5]));
        assert!(direction("0,0,0").is_err() && direction("1,2").is_err() && direction("nan,0,1").is_err());
        assert_eq!((force("2"), force("50 mN"), length("2mm")), (Ok(2.0), Ok(0.05), Ok(2e-3)));
        assert!(
            force("2 mm").is_err() && force("0 N").is_err() && friction("1.5").is_err() && positive("nan").is_err()
        );
        assert!(time("-1").is_err() && time("inf").is_err() && time("2.5") == Ok(2.5));
    }
}
