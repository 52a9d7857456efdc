//! Recordings: positions and frames over time, in a small binary file that reads back.

use std::path::Path;
use sutura::glam::DVec3;
use sutura::{Geometry, Section};

/// A recording of a run.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Trajectory {
    /// What was recorded.
    pub header: Header,
    /// Recorded frames in order of time.
    pub frames: Vec<Frame>,
}

/// What a recording holds.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Header {
    /// Name of the scene.
    pub scene: String,
    /// Version of the program that wrote it.
    pub version: String,
    /// Frames per second of the simulation.
    pub frame_rate: f64,
    /// The threads, in the order of the frames. Those that are cut off in the run come last, in the order of time.
    pub threads: Vec<Thread>,
    /// The shapes, in the order of the frames.
    pub shapes: Vec<Shape>,
    /// Names of the grips, in the order of the frames.
    pub grips: Vec<String>,
}

/// A recorded thread.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Thread {
    /// Name in the scene.
    pub name: String,
    /// Radius \[m\].
    pub radius: f64,
    /// Elements n; a frame has n + 1 positions and n orientations. Where threads are cut it is the number when the
    /// thread came, and each frame has those of its own.
    pub elements: usize,
    /// What it looks like; recordings of earlier versions have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub look: Option<ThreadLook>,
}

/// What a thread looks like when nothing bends it.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ThreadLook {
    /// Rest lengths of its elements \[m\].
    pub lengths: Vec<f64>,
    /// Its cross-section, axes along d1 and d2.
    pub section: SectionOutline,
    /// Factor on the size of the section: rest arc length \[m\] and factor, linear between.
    pub size: Vec<(f64, f64)>,
    /// Of a closed thread, the turn about d3 at rest from its last frame to its first \[rad\].
    pub seam: Option<f64>,
}

/// Shape of a cross-section (see `sutura::Section`).
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SectionOutline {
    /// Round, of the thread's radius.
    Round,
    /// An ellipse with these semi-axes \[m\].
    Ellipse([f64; 2]),
    /// A rectangle with these sides \[m\].
    Rectangle([f64; 2]),
}

/// A recorded shape.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Shape {
    /// Name in the scene.
    pub name: String,
    /// What it looks like in its own frame.
    pub outline: ShapeOutline,
}

/// Geometry of a shape in its own frame, lengths in meters (see `sutura::Geometry`).
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ShapeOutline {
    /// The half space below z = 0 is solid.
    Plane,
    /// A ball.
    Sphere {
        /// Radius \[m\].
        radius: f64,
    },
    /// About the z axis.
    Capsule {
        /// Radius \[m\].
        radius: f64,
        /// Half the straight part \[m\].
        half_length: f64,
    },
    /// About the z axis.
    Cylinder {
        /// Radius \[m\].
        radius: f64,
        /// Half the length \[m\].
        half_length: f64,
    },
    /// A box.
    Box {
        /// Half the sides \[m\].
        half_sides: [f64; 3],
    },
    /// Triangles.
    Mesh {
        /// Corners \[m\].
        vertices: Vec<[f64; 3]>,
        /// Corners of each triangle.
        triangles: Vec<[u32; 3]>,
    },
}

impl From<Section> for SectionOutline {
    fn from(s: Section) -> Self {
        match s {
            Section::Round => SectionOutline::Round,
            Section::Ellipse(axes) => SectionOutline::Ellipse(axes),
            Section::Rectangle(sides) => SectionOutline::Rectangle(sides),
        }
    }
}

impl From<SectionOutline> for Section {
    fn from(s: SectionOutline) -> Self {
        match s {
            SectionOutline::Round => Section::Round,
            SectionOutline::Ellipse(axes) => Section::Ellipse(axes),
            SectionOutline::Rectangle(sides) => Section::Rectangle(sides),
        }
    }
}

impl From<&Geometry> for ShapeOutline {
    fn from(geometry: &Geometry) -> Self {
        match geometry {
            Geometry::Plane => ShapeOutline::Plane,
            Geometry::Sphere { radius } => ShapeOutline::Sphere { radius: *radius },
            Geometry::Capsule { radius, half_length } => {
                ShapeOutline::Capsule { radius: *radius, half_length: *half_length }
            }
            Geometry::Cylinder { radius, half_length } => {
                ShapeOutline::Cylinder { radius: *radius, half_length: *half_length }
            }
            Geometry::Box { half_sides } => ShapeOutline::Box { half_sides: half_sides.to_array() },
            Geometry::Mesh { vertices, triangles } => ShapeOutline::Mesh {
                vertices: vertices.iter().map(DVec3::to_array).collect(),
                triangles: triangles.clone(),
            },
        }
    }
}

impl From<&ShapeOutline> for Geometry {
    fn from(outline: &ShapeOutline) -> Self {
        match outline {
            ShapeOutline::Plane => Geometry::Plane,
            ShapeOutline::Sphere { radius } => Geometry::Sphere { radius: *radius },
            ShapeOutline::Capsule { radius, half_length } => {
                Geometry::Capsule { radius: *radius, half_length: *half_length }
            }
            ShapeOutline::Cylinder { radius, half_length } => {
                Geometry::Cylinder { radius: *radius, half_length: *half_length }
            }
            ShapeOutline::Box { half_sides } => Geometry::Box { half_sides: DVec3::from(*half_sides) },
            ShapeOutline::Mesh { vertices, triangles } => Geometry::Mesh {
                vertices: vertices.iter().map(|v| DVec3::from(*v)).collect(),
                triangles: triangles.clone(),
            },
        }
    }
}

/// One recorded frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Frame {
    /// Simulated time \[s\].
    pub time: f64,
    /// Particle positions of each thread that is there: the first ones of the header \[m\].
    pub positions: Vec<Vec<[f32; 3]>>,
    /// Material frames of each thread, `world_from_material` as x, y, z, w.
    pub orientations: Vec<Vec<[f32; 4]>>,
    /// Pose of each shape: position \[m\] and orientation as x, y, z, w.
    pub shapes: Vec<([f32; 3], [f32; 4])>,
    /// Where each grip holds \[m\]; `None` while it does not.
    pub grips: Vec<Option<[f32; 3]>>,
    /// What acts; recordings of version 1 do not say.
    pub forces: Option<Forces>,
}

/// What acts in a frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Forces {
    /// Tension of each element of each thread \[N\], positive when stretched.
    pub tensions: Vec<Vec<f32>>,
    /// Force of each grip on its thread \[N\]; zero while it does not hold.
    pub grips: Vec<[f32; 3]>,
    /// Contacts that carry force.
    pub contacts: Vec<Contact>,
}

/// A contact that carries force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// Where on a thread.
    pub on: OnThread,
    /// What it touches.
    pub with: Touched,
    /// The point on the centerline \[m\].
    pub point: [f32; 3],
    /// Unit normal toward the thread.
    pub normal: [f32; 3],
    /// Force on the thread, normal and friction \[N\].
    pub force: [f32; 3],
    /// Whether it slid; else it stuck.
    pub sliding: bool,
}

/// A place on a thread.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OnThread {
    /// Number of the thread in the header.
    pub thread: u32,
    /// Its element.
    pub element: u32,
    /// Where on it, 0 at its first particle, 1 at its second.
    pub s: f32,
}

/// The other side of a contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Touched {
    /// The same thread, or another one.
    Thread(OnThread),
    /// A shape, by its number in the header.
    Shape(u32),
}

/// Why a recording could not be written or read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrajectoryError {
    /// The file could not be opened, written or read.
    #[error("recording: {0}")]
    Io(#[from] std::io::Error),
    /// The file is not a recording, of a later version, cut short or damaged.
    #[error("recording: {0}")]
    Damaged(String),
}

impl Trajectory {
    /// The recorded frames in order.
    pub fn iter(&self) -> std::slice::Iter<'_, Frame> {
        self.frames.iter()
    }
    /// The recorded frame nearest to a time.
    pub fn nearest(&self, time: f64) -> Option<&Frame> {
        self.frames.iter().min_by(|a, b| (a.time - time).abs().total_cmp(&(b.time - time).abs()))
    }
    /// Writes the recording to a file.
    pub fn write_to(&self, path: &Path) -> Result<(), TrajectoryError> {
        crate::whole::write_whole(path, &self.to_bytes()).map_err(TrajectoryError::Io)
    }
    /// Reads a recording from a file.
    pub fn read_from(path: &Path) -> Result<Self, TrajectoryError> {
        Self::from_bytes(&std::fs::read(path)?)
    }
}

impl<'a> IntoIterator for &'a Trajectory {
    type Item = &'a Frame;
    type IntoIter = std::slice::Iter<'a, Frame>;
    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

const MAGIC: &[u8; 8] = b"SUTURATR";
/// Version 1 has no forces; version 3 says of each frame which threads are there, and of how many elements. What needs
/// no version 3 is written as version 2.
const VERSION: u32 = 3;
/// See [`VERSION`].
const OF_HEADER: u32 = 2;

/// Bytes of a contact.
const CONTACT: usize = 64;

impl Trajectory {
    /// The bytes of the file: `SUTURATR`, version, header length, header as JSON, number of frames, frames, checksum.
    pub fn to_bytes(&self) -> Vec<u8> {
        let header = serde_json::to_vec(&self.header).unwrap_or_default();
        let mut out = MAGIC.to_vec();
        let version = if self.frames.iter().all(|f| f.is_of(&self.header)) { OF_HEADER } else { VERSION };
        out.extend_from_slice(&version.to_le_bytes());
        out.extend_from_slice(&(header.len() as u32).to_le_bytes());
        out.extend_from_slice(&header);
        out.extend_from_slice(&(self.frames.len() as u64).to_le_bytes());
        let put = |v: f32, out: &mut Vec<u8>| out.extend_from_slice(&v.to_le_bytes());
        for frame in &self.frames {
            out.extend_from_slice(&frame.time.to_le_bytes());
            if version > OF_HEADER {
                out.extend_from_slice(&(frame.orientations.len() as u32).to_le_bytes());
                frame.orientations.iter().for_each(|q| out.extend_from_slice(&(q.len() as u32).to_le_bytes()));
            }
            for (x, q) in frame.positions.iter().zip(&frame.orientations) {
                x.iter().flatten().for_each(|v| put(*v, &mut out));
                q.iter().flatten().for_each(|v| put(*v, &mut out));
            }
            for (x, q) in &frame.shapes {
                x.iter().chain(q).for_each(|v| put(*v, &mut out));
            }
            for grip in &frame.grips {
                // A grip that does not hold is written as not-a-number.
                grip.unwrap_or([f32::NAN; 3]).iter().for_each(|v| put(*v, &mut out));
            }
            out.extend_from_slice(&u32::from(frame.forces.is_some()).to_le_bytes());
            if let Some(forces) = &frame.forces {
                forces.tensions.iter().flatten().chain(forces.grips.iter().flatten()).for_each(|v| put(*v, &mut out));
                out.extend_from_slice(&(forces.contacts.len() as u32).to_le_bytes());
                forces.contacts.iter().for_each(|c| c.put(&mut out));
            }
        }
        let sum = crc32fast::hash(&out);
        out.extend_from_slice(&sum.to_le_bytes());
        out
    }

    /// Reads what [`Trajectory::to_bytes`] wrote.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, TrajectoryError> {
        let damaged = |why: &str| TrajectoryError::Damaged(why.into());
        if bytes.len() < 28 || &bytes[..8] != MAGIC {
            return Err(damaged("not a recording (it does not begin with SUTURATR)"));
        }
        let mut reader = Reader { bytes: &bytes[..bytes.len() - 4], at: 8 };
        let short = || damaged("cut short");
        let version = reader.u32().ok_or_else(short)?;
        if !(1..=VERSION).contains(&version) {
            return Err(TrajectoryError::Damaged(format!(
                "version {version}, this program reads versions 1 to {VERSION}"
            )));
        }
        let stored = u32::from_le_bytes(bytes[bytes.len() - 4..].try_into().unwrap_or_default());
        if crc32fast::hash(reader.bytes) != stored {
            return Err(damaged("the checksum does not fit: cut short or changed"));
        }
        let length = reader.u32().ok_or_else(short)? as usize;
        let header: Header = serde_json::from_slice(reader.take(length).ok_or_else(short)?)
            .map_err(|e| TrajectoryError::Damaged(format!("header: {e}")))?;
        let count = reader.u64().ok_or_else(short)?;
        let mut trajectory = Trajectory { header, frames: Vec::new() };
        // The size must fit before anything is allocated for it. With forces a frame is longer than that.
        let (left, least) = (
            (reader.bytes.len() - reader.at) as u64,
            trajectory.frame_bytes(version).and_then(|b| b.checked_mul(count)),
        );
        if least.is_none_or(|least| if version == 1 { least != left } else { least > left }) {
            return Err(damaged("the number of frames does not fit the length of the file"));
        }
        for i in 0..count {
            let frame = reader.frame(&trajectory.header, version).ok_or_else(short)?;
            if !frame.is_finite() {
                return Err(TrajectoryError::Damaged(format!("a number of frame {i} is not finite")));
            }
            trajectory.frames.push(frame);
        }
        if reader.at != reader.bytes.len() {
            return Err(damaged("there is more in the file than its frames"));
        }
        Ok(trajectory)
    }

    /// Bytes of a frame without forces, by the header, from version 3 on also without threads; `None` where they are
    /// beyond counting.
    fn frame_bytes(&self, version: u32) -> Option<u64> {
        // The counts of shapes and grips are those of what was read, so their bytes are few.
        let mut sum = if version == 1 { 8 } else { 12 }
            + 28 * self.header.shapes.len() as u64
            + 12 * self.header.grips.len() as u64;
        if version > OF_HEADER {
            return Some(sum + 4);
        }
        for t in &self.header.threads {
            sum = sum.checked_add((t.elements as u64).checked_mul(28)?.checked_add(12)?)?;
        }
        Some(sum)
    }
}

impl Frame {
    fn is_finite(&self) -> bool {
        let points = self.positions.iter().flatten().flatten().chain(self.grips.iter().flatten().flatten());
        let poses = self.shapes.iter().flat_map(|(x, q)| x.iter().chain(q));
        let mut numbers = points.chain(self.orientations.iter().flatten().flatten()).chain(poses);
        self.time.is_finite() && numbers.all(|v| v.is_finite()) && self.forces.as_ref().is_none_or(Forces::is_finite)
    }

    /// Whether its threads are those of the header, with as many elements.
    fn is_of(&self, header: &Header) -> bool {
        header.threads.iter().map(|t| t.elements).eq(self.orientations.iter().map(Vec::len))
    }

    /// Gives threads that a reel has made longer or shorter as many elements as the header says: points at equal parts
    /// of the thread's elements.
    pub(crate) fn fit(&mut self, header: &Header) {
        for (thread, (x, q)) in header.threads.iter().zip(self.positions.iter_mut().zip(&mut self.orientations)) {
            refit(thread.elements, x, q, |a, b, u| std::array::from_fn(|c| a[c] + (b[c] - a[c]) * u as f32));
        }
        if let Some(forces) = &mut self.forces {
            forces.fit(header);
        }
    }
}

impl Forces {
    fn is_finite(&self) -> bool {
        let contacts = self
            .contacts
            .iter()
            .flat_map(|c| c.point.iter().chain(&c.normal).chain(&c.force).copied().chain(c.places().map(|p| p.s)));
        self.tensions.iter().flatten().chain(self.grips.iter().flatten()).copied().chain(contacts).all(f32::is_finite)
    }

    fn fit(&mut self, header: &Header) {
        let had: Vec<usize> = self.tensions.iter().map(Vec::len).collect();
        for (thread, tensions) in header.threads.iter().zip(&mut self.tensions) {
            refit_elements(thread.elements, tensions);
        }
        for place in self.contacts.iter_mut().flat_map(Contact::places_mut) {
            let (had, now) = (had[place.thread as usize], header.threads[place.thread as usize].elements);
            if had != now {
                let along = (f64::from(place.element) + f64::from(place.s)) * now as f64 / had as f64;
                let element = (along as usize).min(now - 1);
                (place.element, place.s) = (element as u32, (along - element as f64).clamp(0.0, 1.0) as f32);
            }
        }
    }
}

impl Contact {
    /// Its places on threads.
    pub(crate) fn places(&self) -> impl Iterator<Item = OnThread> + use<> {
        let other = if let Touched::Thread(place) = self.with { Some(place) } else { None };
        std::iter::once(self.on).chain(other)
    }
    fn places_mut(&mut self) -> impl Iterator<Item = &mut OnThread> {
        let other = if let Touched::Thread(place) = &mut self.with { Some(place) } else { None };
        std::iter::once(&mut self.on).chain(other)
    }
    fn put(&self, out: &mut Vec<u8>) {
        let (shape, other) = match self.with {
            Touched::Thread(place) => (0, place),
            Touched::Shape(shape) => (1, OnThread { thread: shape, element: 0, s: 0.0 }),
        };
        for place in [self.on, other] {
            out.extend_from_slice(&place.thread.to_le_bytes());
            out.extend_from_slice(&place.element.to_le_bytes());
            out.extend_from_slice(&place.s.to_le_bytes());
        }
        out.extend_from_slice(&(shape + 2 * u32::from(self.sliding)).to_le_bytes());
        self.point.iter().chain(&self.normal).chain(&self.force).for_each(|v| out.extend_from_slice(&v.to_le_bytes()));
    }
}

/// A thread of `n` elements where another one lies: points at equal parts of its elements, the frame of the element in
/// which the new one has its middle.
pub(crate) fn refit<P: Copy, Q: Copy>(n: usize, x: &mut Vec<P>, q: &mut Vec<Q>, lerp: impl Fn(P, P, f64) -> P) {
    let had = q.len();
    if n == had || n == 0 || had == 0 {
        return;
    }
    let at = |k: usize| {
        let s = k as f64 * had as f64 / n as f64;
        let e = (s as usize).min(had - 1);
        lerp(x[e], x[e + 1], s - e as f64)
    };
    *x = (0..=n).map(at).collect();
    refit_elements(n, q);
}

/// What `n` elements have where others lie.
pub(crate) fn refit_elements<Q: Copy>(n: usize, q: &mut Vec<Q>) {
    let had = q.len();
    if n != had && had > 0 {
        *q = (0..n).map(|k| q[(((k as f64 + 0.5) * had as f64 / n as f64) as usize).min(had - 1)]).collect();
    }
}

struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    fn take(&mut self, n: usize) -> Option<&'a [u8]> {
        let piece = self.bytes.get(self.at..self.at.checked_add(n)?)?;
        self.at += n;
        Some(piece)
    }
    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.take(N)?.try_into().ok()
    }
    fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }
    fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }
    fn f32s<const N: usize>(&mut self) -> Option<[f32; N]> {
        let mut out = [0.0; N];
        for v in &mut out {
            *v = f32::from_le_bytes(self.array()?);
        }
        Some(out)
    }
    fn place(&mut self) -> Option<OnThread> {
        Some(OnThread { thread: self.u32()?, element: self.u32()?, s: f32::from_le_bytes(self.array()?) })
    }
    /// `None` also where it is on a thread, of these numbers of elements, or on a shape that is not there.
    fn contact(&mut self, header: &Header, elements: &[usize]) -> Option<Contact> {
        let is_there = |p: &OnThread| elements.get(p.thread as usize).is_some_and(|n| (p.element as usize) < *n);
        let (on, other, kind) = (self.place()?, self.place()?, self.u32()?);
        let with = match kind & 1 {
            0 => Touched::Thread(Some(other).filter(is_there)?),
            _ => Touched::Shape(Some(other.thread).filter(|s| (*s as usize) < header.shapes.len())?),
        };
        let (point, normal, force) = (self.f32s()?, self.f32s()?, self.f32s()?);
        Some(Contact { on: Some(on).filter(is_there)?, with, point, normal, force, sliding: kind & 2 != 0 })
    }
    fn forces(&mut self, header: &Header, elements: &[usize]) -> Option<Forces> {
        let mut forces = Forces::default();
        for n in elements {
            let bytes = self.take(n.checked_mul(4)?)?;
            forces.tensions.push(bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect());
        }
        for _ in &header.grips {
            forces.grips.push(self.f32s()?);
        }
        let count = self.u32()? as usize;
        if count > (self.bytes.len() - self.at) / CONTACT {
            return None;
        }
        forces.contacts = (0..count).map(|_| self.contact(header, elements)).collect::<Option<_>>()?;
        Some(forces)
    }
    /// Numbers of elements of the threads that are there.
    fn elements(&mut self, header: &Header, version: u32) -> Option<Vec<usize>> {
        if version <= OF_HEADER {
            return Some(header.threads.iter().map(|t| t.elements).collect());
        }
        let count = self.u32()? as usize;
        if count > header.threads.len() {
            return None;
        }
        (0..count).map(|_| self.u32().map(|n| n as usize).filter(|n| *n > 0)).collect()
    }
    fn frame(&mut self, header: &Header, version: u32) -> Option<Frame> {
        let mut frame = Frame { time: f64::from_le_bytes(self.array()?), ..Frame::default() };
        let elements = self.elements(header, version)?;
        for n in &elements {
            frame.positions.push((0..=*n).map(|_| self.f32s()).collect::<Option<_>>()?);
            frame.orientations.push((0..*n).map(|_| self.f32s()).collect::<Option<_>>()?);
        }
        for _ in &header.shapes {
            frame.shapes.push((self.f32s()?, self.f32s()?));
        }
        for _ in &header.grips {
            let x: [f32; 3] = self.f32s()?;
            frame.grips.push((!x[0].is_nan()).then_some(x));
        }
        if version > 1 {
            frame.forces = match self.u32()? {
                0 => None,
                1 => Some(self.forces(header, &elements)?),
                _ => return None,
            };
        }
        Some(frame)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Trajectory {
        let look = ThreadLook {
            lengths: vec![0.1, 0.3],
            section: SectionOutline::Ellipse([1e-4, 2e-4]),
            size: vec![(0.0, 1.0)],
            seam: None,
        };
        let header = Header {
            scene: "s".into(),
            version: "1".into(),
            frame_rate: 60.0,
            threads: vec![Thread { name: "a".into(), radius: 1e-4, elements: 2, look: Some(look) }],
            shapes: vec![Shape {
                name: "post".into(),
                outline: ShapeOutline::Cylinder { radius: 0.005, half_length: 0.01 },
            }],
            grips: vec!["left".into(), "right".into()],
        };
        let touch = |with: Touched| Contact {
            on: OnThread { thread: 0, element: 0, s: 0.25 },
            with,
            point: [0.0, 0.1, 0.2],
            normal: [1.0, 0.0, 0.0],
            force: [0.3, 0.0, 0.1],
            sliding: with == Touched::Shape(0),
        };
        let frame = |t: f64| Frame {
            time: t,
            positions: vec![vec![[0.0, 0.5, t as f32]; 3]],
            orientations: vec![vec![[0.0, 0.0, 0.0, 1.0]; 2]],
            shapes: vec![([1.0, 2.0, 3.0], [0.0, 0.0, 0.0, 1.0])],
            grips: vec![Some([0.1, 0.2, 0.3]), None],
            forces: Some(Forces {
                tensions: vec![vec![0.5, 0.25 * t as f32]],
                grips: vec![[0.0, 0.5, 0.0], [0.0; 3]],
                contacts: vec![
                    touch(Touched::Shape(0)),
                    touch(Touched::Thread(OnThread { thread: 0, element: 1, s: 0.5 })),
                ],
            }),
        };
        Trajectory { header, frames: vec![frame(0.0), frame(0.5)] }
    }

    #[test]
    fn reads_back_what_it_wrote() {
        let t = sample();
        assert_eq!(Trajectory::from_bytes(&t.to_bytes()).unwrap(), t);
        assert_eq!(t.nearest(0.4).unwrap().time, 0.5);
    }

    #[test]
    fn recordings_without_forces_are_read() {
        let mut t = sample();
        t.frames[1].forces = None;
        assert_eq!(Trajectory::from_bytes(&t.to_bytes()).unwrap(), t);
        // Version 1 ends a frame with its grips.
        t.frames.truncate(1);
        let (bytes, forces) = (t.to_bytes(), 4 + 8 + 24 + 4 + 2 * CONTACT);
        t.frames[0].forces = None;
        let mut old = bytes[..bytes.len() - 4 - forces].to_vec();
        old[8] = 1;
        old.extend_from_slice(&crc32fast::hash(&old).to_le_bytes());
        assert_eq!(Trajectory::from_bytes(&old).unwrap(), t);
    }

    /// A second thread comes in the second frame, of which the first one has an element less.
    fn cut() -> Trajectory {
        let mut t = sample();
        t.header.threads.push(Thread { name: "a.cut".into(), elements: 1, look: None, ..t.header.threads[0].clone() });
        let frame = &mut t.frames[1];
        frame.positions = vec![vec![[0.0, 0.5, 0.0]; 2]; 2];
        frame.orientations = vec![vec![[0.0, 0.0, 0.0, 1.0]; 1]; 2];
        let forces = frame.forces.as_mut().unwrap();
        forces.tensions = vec![vec![0.5], vec![0.25]];
        forces.contacts[1].with = Touched::Thread(OnThread { thread: 1, element: 0, s: 0.5 });
        t
    }

    #[test]
    fn threads_that_come_and_lose_elements_read_back() {
        let t = cut();
        let bytes = t.to_bytes();
        assert_eq!((bytes[8], sample().to_bytes()[8]), (3, 2));
        assert_eq!(Trajectory::from_bytes(&bytes).unwrap(), t);
        // A contact with what was not there yet.
        let mut early = t.clone();
        early.frames[0].forces = t.frames[1].forces.clone();
        assert!(Trajectory::from_bytes(&early.to_bytes()).is_err());
        for n in 0..bytes.len() {
            assert!(Trajectory::from_bytes(&bytes[..n]).is_err(), "cut at {n}");
        }
        // More threads than the header has, and one of no elements.
        let at = bytes.windows(8).position(|w| w == 0.5f64.to_le_bytes()).unwrap() + 8;
        for (offset, value) in [(0, 3u32), (4, 0), (4, u32::MAX)] {
            let mut other = bytes[..bytes.len() - 4].to_vec();
            other[at + offset..at + offset + 4].copy_from_slice(&value.to_le_bytes());
            other.extend_from_slice(&crc32fast::hash(&other).to_le_bytes());
            assert!(Trajectory::from_bytes(&other).is_err(), "{offset} {value}");
        }
    }

    #[test]
    fn contacts_of_what_is_not_there_are_refused() {
        let away = |change: &dyn Fn(&mut Contact)| {
            let mut t = sample();
            change(&mut t.frames[0].forces.as_mut().unwrap().contacts[0]);
            Trajectory::from_bytes(&t.to_bytes()).is_err()
        };
        assert!(!away(&|_| ()));
        assert!(
            away(&|c| c.with = Touched::Shape(1))
                && away(&|c| c.on.element = 2)
                && away(&|c| c.on.thread = 1)
                && away(&|c| c.force[1] = f32::INFINITY)
        );
    }

    #[test]
    fn numbers_that_are_not_finite_are_refused_and_a_header_beyond_proportion_too() {
        let mut t = sample();
        t.frames[1].positions[0][2][1] = f32::NAN;
        assert!(Trajectory::from_bytes(&t.to_bytes()).unwrap_err().to_string().contains("frame 1"));
        // The bytes of a frame of so many elements just fit 64 bits, with those of the shape they do not.
        let mut t = sample();
        t.frames.clear();
        t.header.threads[0].elements = ((u64::MAX - 20) / 28) as usize;
        assert!(Trajectory::from_bytes(&t.to_bytes()).is_err());
    }

    #[test]
    fn every_cut_and_every_flipped_byte_is_noticed() {
        let bytes = sample().to_bytes();
        for n in 0..bytes.len() {
            assert!(Trajectory::from_bytes(&bytes[..n]).is_err(), "cut at {n}");
            let mut changed = bytes.clone();
            changed[n] ^= 0x10;
            assert!(Trajectory::from_bytes(&changed).is_err(), "flipped at {n}");
        }
    }
}
