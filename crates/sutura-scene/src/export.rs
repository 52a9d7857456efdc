//! Scenes and recordings as files that other programs open: glTF (GLB), VTK, OBJ, CSV.
//!
//! An [`Exporter`] is given moments in order of time, from a recording ([`Moment::of_frame`]) or from a run under way
//! ([`Moment::of_runner`]), which also knows velocities. Equal moments give equal bytes.

mod csv;
mod glb;
mod obj;
mod texture;
mod vtk;

use crate::runner::Runner;
use crate::trajectory::{Frame, Header, Thread, refit};
use std::path::{Path, PathBuf};
use sutura::glam::{DQuat, DVec3};
use sutura::skin::{Skin, SkinSpec, TriangleMesh, shape_mesh};
use sutura::{Geometry, Pose, Profile};

/// Colors of threads, one after the other (sRGB), chosen to be told apart also by the color-blind (after Okabe and Ito
/// 2008, darkened a little).
pub const THREAD_COLORS: [[u8; 3]; 10] = [
    [38, 84, 160],
    [222, 128, 20],
    [0, 140, 105],
    [190, 70, 130],
    [110, 80, 170],
    [150, 110, 60],
    [70, 70, 75],
    [120, 165, 30],
    [0, 155, 190],
    [205, 60, 50],
];

/// Sides of round shapes.
const SHAPE_SIDES: u32 = 48;

/// A kind of file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// glTF 2.0 in one binary file: skinned threads, moving shapes.
    Glb,
    /// A folder of VTK PolyData with fields, for ParaView.
    Vtk,
    /// Wavefront OBJ: one file of the last moment, or a folder with one file a moment.
    Obj,
    /// A table with a row a particle and moment.
    Csv,
}

/// What of a run is exported, and how fine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Moments a second \[1/s\]; at most those that there are.
    pub rate: f64,
    /// First and last time \[s\].
    pub from: f64,
    /// Last time \[s\].
    pub to: f64,
    /// Vertices around a thread.
    pub sides: u32,
    /// Rings of vertices an element.
    pub rings: u32,
    /// Direction of the scene that is up where glTF says what is up, a unit vector: y as in glTF turns nothing. Other
    /// formats are not turned.
    pub up: DVec3,
}

impl Default for Options {
    fn default() -> Self {
        Options { rate: 30.0, from: 0.0, to: f64::INFINITY, sides: 12, rings: 4, up: DVec3::Y }
    }
}

/// Where everything is at one time.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Moment {
    /// Simulated time \[s\].
    pub time: f64,
    /// The threads, in the order of the header.
    pub threads: Vec<Strand>,
    /// Where the shapes are, in the order of the header.
    pub shapes: Vec<Pose>,
}

/// A thread at one time.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Strand {
    /// Particles \[m\], n + 1.
    pub positions: Vec<DVec3>,
    /// Material frames, n.
    pub orientations: Vec<DQuat>,
    /// Velocity of each particle \[m/s\]; only a run under way knows it.
    pub velocities: Option<Vec<DVec3>>,
    /// Its forces; recordings of version 1 do not say.
    pub loads: Option<Loads>,
}

/// Forces of a thread.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Loads {
    /// Of each element \[N\], positive when stretched.
    pub tensions: Vec<f64>,
    /// Force of all contacts on each particle \[N\]: that on an element, shared by the lever.
    pub contact_forces: Vec<DVec3>,
}

/// Why something could not be exported.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// A file or folder could not be written.
    #[error("cannot write {path}: {source}")]
    Io {
        /// Which.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A thread has no tube.
    #[error("thread `{thread}`: {source}")]
    Tube {
        /// Its name.
        thread: String,
        /// Why not.
        source: sutura::Error,
    },
    /// An option is out of range.
    #[error("{0}")]
    Option(String),
    /// No moment lies in the range of time.
    #[error("there is nothing between {from} s and {to} s: the recording goes from {first} s to {last} s")]
    Nothing {
        /// First time wanted \[s\].
        from: f64,
        /// Last time wanted \[s\].
        to: f64,
        /// First time that there was \[s\].
        first: f64,
        /// Last time that there was \[s\].
        last: f64,
    },
    /// A GLB file is at most 4 GiB.
    #[error(
        "the file would be larger than a GLB can be (4 GiB): export fewer frames a second (`--fps`), or a part (`--from`, `--to`)"
    )]
    TooLarge,
}

/// What was written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Written {
    /// Number of moments.
    pub moments: usize,
    /// Bytes in all files.
    pub bytes: u64,
}

/// Writes moments to files.
pub struct Exporter {
    header: Header,
    options: Options,
    out: Output,
    looks: Looks,
    writer: Option<Box<dyn Writer>>,
    format: Format,
    /// Number of the next moment by the rate.
    due: u64,
    moments: usize,
    seen: Option<(f64, f64)>,
}

/// A kind of file as it is written.
trait Writer {
    fn add(&mut self, seen: &Seen<'_>, moment: &Moment, out: &mut Output) -> Result<(), ExportError>;
    fn finish(self: Box<Self>, seen: &Seen<'_>, out: &mut Output) -> Result<(), ExportError>;
}

/// The threads and shapes that there are to write so far.
struct Seen<'a> {
    header: &'a Header,
    looks: &'a Looks,
}

/// Writes files and counts their bytes.
struct Output {
    path: PathBuf,
    bytes: u64,
}

/// The looks of the shapes of a recording, and of those of its threads that have come.
#[derive(Default)]
struct Looks {
    skins: Vec<Skin>,
    shapes: Vec<TriangleMesh>,
}

impl Exporter {
    /// Begins an export to a file or folder.
    pub fn new(format: Format, header: &Header, out: &Path, options: Options) -> Result<Self, ExportError> {
        let bad = |what: String| Err(ExportError::Option(what));
        if !(options.rate.is_finite() && options.rate > 0.0) {
            return bad(format!("{} frames a second: wanted a number > 0", options.rate));
        }
        if options.from.is_nan() || options.to.is_nan() || options.from > options.to {
            return bad(format!(
                "from {} s to {} s: wanted the first time not after the last",
                options.from, options.to
            ));
        }
        if !options.up.is_normalized() {
            return bad(format!("up is {}: wanted a unit vector", options.up));
        }
        let out = Output { path: out.to_path_buf(), bytes: 0 };
        // Now, so that what cannot be written is found before the work.
        out.prepare(format)?;
        let (header, looks) = (header.clone(), Looks::default());
        Ok(Exporter { header, options, out, looks, writer: None, format, due: 0, moments: 0, seen: None })
    }

    /// Whether a moment of this time is to be added: the first one at or after each multiple of the period.
    pub fn wants(&mut self, time: f64) -> bool {
        self.seen = Some((self.seen.map_or(time, |s| s.0), time));
        // Times are sums of steps; rounding must not cost or add one.
        const SLACK: f64 = 1e-6;
        if time < self.options.from - SLACK || time > self.options.to + SLACK {
            return false;
        }
        let period =
            (time - self.options.from.max(0.0)).max(0.0) * self.options.rate + SLACK * self.options.rate.max(1.0);
        let number = period as u64;
        if self.moments > 0 && number < self.due {
            return false;
        }
        self.due = number + 1;
        true
    }

    /// Takes note of threads of a run under way that have come since.
    pub fn follow(&mut self, runner: &Runner) {
        let known = self.header.threads.len();
        if runner.rods().count() > known {
            self.header.threads.extend(runner.header().threads.into_iter().skip(known));
        }
    }

    /// Adds a moment. Its threads are the first ones of the header, its shapes all of them.
    pub fn add(&mut self, moment: &Moment) -> Result<(), ExportError> {
        self.moments += 1;
        self.looks.follow(&self.header, moment, &self.options)?;
        let seen = Seen { header: &self.header, looks: &self.looks };
        let writer = self.writer.get_or_insert_with(|| match self.format {
            Format::Glb => Box::new(glb::Glb::new(self.options.up)),
            Format::Vtk => Box::new(vtk::Vtk::new()),
            Format::Obj => Box::new(obj::Obj::new()),
            Format::Csv => Box::new(csv::Csv::new()),
        });
        writer.add(&seen, moment, &mut self.out)
    }

    /// Writes what is left to write.
    pub fn finish(mut self) -> Result<Written, ExportError> {
        let Some(writer) = self.writer else {
            let (first, last) = self.seen.unwrap_or((0.0, 0.0));
            return Err(ExportError::Nothing { from: self.options.from, to: self.options.to, first, last });
        };
        writer.finish(&Seen { header: &self.header, looks: &self.looks }, &mut self.out)?;
        Ok(Written { moments: self.moments, bytes: self.out.bytes })
    }
}

impl Format {
    /// By the ending of a file's name.
    pub fn of(path: &Path) -> Option<Format> {
        let ending = path.extension()?.to_str()?.to_ascii_lowercase();
        match ending.as_str() {
            "glb" => Some(Format::Glb),
            "vtk" | "pvd" | "vtp" => Some(Format::Vtk),
            "obj" => Some(Format::Obj),
            "csv" => Some(Format::Csv),
            _ => None,
        }
    }
}

impl Output {
    /// Whether an OBJ goes to one file.
    fn is_one_file(&self) -> bool {
        Format::of(&self.path) == Some(Format::Obj)
    }

    /// Makes the folder, and takes away the files of an earlier series, which would pass for those of this one.
    fn prepare(&self, format: Format) -> Result<(), ExportError> {
        let failed = |path: &Path| {
            let path = path.to_path_buf();
            move |source| ExportError::Io { path, source }
        };
        let (folder, series) = match format {
            Format::Glb | Format::Csv => (self.path.parent(), None),
            Format::Obj if self.is_one_file() => (self.path.parent(), None),
            Format::Obj => (Some(self.path.as_path()), Some(".obj")),
            Format::Vtk => (Some(self.path.as_path()), Some(".vtp")),
        };
        let Some(folder) = folder.filter(|f| !f.as_os_str().is_empty()) else { return Ok(()) };
        std::fs::create_dir_all(folder).map_err(failed(folder))?;
        let Some(ending) = series else { return Ok(()) };
        for entry in std::fs::read_dir(folder).map_err(failed(folder))? {
            let path = entry.map_err(failed(folder))?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let number = ["threads_", "shapes_", "frame_"]
                .iter()
                .find_map(|start| name.strip_prefix(start)?.strip_suffix(ending));
            if number.is_some_and(|n| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit())) {
                std::fs::remove_file(&path).map_err(failed(&path))?;
            }
        }
        Ok(())
    }

    /// Writes the file itself, or one in the folder.
    fn write(&mut self, name: Option<&str>, bytes: &[u8]) -> Result<(), ExportError> {
        let path = name.map_or_else(|| self.path.clone(), |name| self.path.join(name));
        crate::whole::write_whole(&path, bytes).map_err(|source| ExportError::Io { path, source })?;
        self.bytes += bytes.len() as u64;
        Ok(())
    }
}

impl Looks {
    /// Takes up what a moment has that was not there before.
    fn follow(&mut self, header: &Header, moment: &Moment, options: &Options) -> Result<(), ExportError> {
        if self.shapes.is_empty() {
            // A plane reaches three times as far as the threads at the beginning, where there are none as the shapes.
            let shapes = moment.shapes.iter().map(|s| &s.position).filter(|_| moment.threads.is_empty());
            let points = || moment.threads.iter().flat_map(|t| &t.positions).chain(shapes.clone());
            let shape = |(shape, pose): (&crate::trajectory::Shape, &Pose)| {
                let reach = points().map(|x| (*x - pose.position).length()).fold(1e-2, f64::max);
                shape_mesh(&Geometry::from(&shape.outline), SHAPE_SIDES, 3.0 * reach)
            };
            self.shapes = header.shapes.iter().zip(&moment.shapes).map(shape).collect();
        }
        let known = self.skins.len();
        if moment.threads.len() > known {
            for (thread, strand) in header.threads.iter().zip(&fitted(header, moment).threads).skip(known) {
                let spec = SkinSpec { sides: options.sides, rings: options.rings, ..tube(thread, strand) };
                let skin = Skin::new(&spec);
                self.skins.push(skin.map_err(|source| ExportError::Tube { thread: thread.name.clone(), source })?);
            }
        }
        Ok(())
    }
}

/// The tube of a thread: as it was recorded, or by the distances of its particles, round and closed where the last one
/// lies on the first.
fn tube(thread: &Thread, strand: &Strand) -> SkinSpec {
    let x = &strand.positions;
    match &thread.look {
        Some(look) if look.lengths.len() == strand.orientations.len() => SkinSpec {
            section: look.section.into(),
            size: Profile(look.size.clone()),
            seam: look.seam,
            ..SkinSpec::new(look.lengths.clone(), thread.radius)
        },
        _ => SkinSpec {
            seam: (x.len() > 3 && x.first() == x.last()).then_some(0.0),
            ..SkinSpec::new(x.windows(2).map(|w| (w[1] - w[0]).length()).collect(), thread.radius)
        },
    }
}

/// The moment with as many elements in each thread as the header says: threads at reels gain and lose some.
fn fitted(header: &Header, moment: &Moment) -> Moment {
    let mut fitted = moment.clone();
    for (thread, strand) in header.threads.iter().zip(&mut fitted.threads) {
        refit(thread.elements, &mut strand.positions, &mut strand.orientations, DVec3::lerp);
    }
    fitted
}

impl Moment {
    /// A recorded frame.
    pub fn of_frame(frame: &Frame) -> Self {
        let point = |p: &[f32; 3]| DVec3::from(p.map(f64::from));
        let turn = |q: &[f32; 4]| DQuat::from_array(q.map(f64::from)).normalize();
        let strand = |(x, q): (&Vec<[f32; 3]>, &Vec<[f32; 4]>)| Strand {
            positions: x.iter().map(point).collect(),
            orientations: q.iter().map(turn).collect(),
            ..Strand::default()
        };
        let mut moment = Moment {
            time: frame.time,
            threads: frame.positions.iter().zip(&frame.orientations).map(strand).collect(),
            shapes: frame.shapes.iter().map(|(x, q)| Pose::new(point(x), turn(q))).collect(),
        };
        if let Some(forces) = &frame.forces {
            for (strand, tensions) in moment.threads.iter_mut().zip(&forces.tensions) {
                strand.load(tensions.iter().map(|t| f64::from(*t)).collect());
            }
            for contact in &forces.contacts {
                for (place, sign) in contact.places().zip([1.0, -1.0]) {
                    moment.push(
                        place.thread as usize,
                        place.element as usize,
                        f64::from(place.s),
                        point(&contact.force) * sign,
                    );
                }
            }
        }
        moment
    }

    /// The state of a run under way.
    pub fn of_runner(runner: &Runner) -> Self {
        let mut moment = Moment { time: runner.time(), threads: Vec::new(), shapes: runner.shape_poses().collect() };
        let mut slots = Vec::new();
        for rod in runner.rods() {
            let (positions, orientations) = (rod.positions().to_vec(), rod.orientations().to_vec());
            let mut strand =
                Strand { positions, orientations, velocities: Some(rod.velocities().to_vec()), loads: None };
            strand.load((0..rod.n_elements()).map(|e| rod.tension(e)).collect());
            moment.threads.push(strand);
            slots.push(rod.slot());
        }
        let mut push = |slot: usize, element: usize, s: f64, force: DVec3| {
            if let Some(thread) = slots.iter().position(|k| *k == slot) {
                moment.push(thread, element, s, force);
            }
        };
        for contact in runner.world().contacts() {
            for (side, force) in [(contact.a, contact.force), (contact.b, -contact.force)] {
                if let Some((slot, element, s)) = side.thread() {
                    push(slot, element, s, force);
                }
            }
        }
        moment
    }

    /// Adds the force of a contact on a place of a thread.
    fn push(&mut self, thread: usize, element: usize, s: f64, force: DVec3) {
        let loads = self.threads.get_mut(thread).and_then(|t| t.loads.as_mut());
        if let Some([before, after]) = loads.and_then(|l| l.contact_forces.get_mut(element..element + 2)) {
            *before += force * (1.0 - s);
            *after += force * s;
        }
    }
}

impl Strand {
    /// Tensions, and no contact yet.
    fn load(&mut self, tensions: Vec<f64>) {
        self.loads = Some(Loads { contact_forces: vec![DVec3::ZERO; tensions.len() + 1], tensions });
    }
}
