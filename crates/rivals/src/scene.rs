//! What is asked of every solver: one rod, how its ends are held, what pulls at it; and what can be read while it runs.
//!
//! A rod of n edges has n + 1 vertices. The frame of an edge is `world_from_material`: its columns are the directors
//! d1, d2 (across) and d3, which is the direction of the edge. A clamp holds a whole edge: two vertices and the frame.
//! Bending between the first two edges is counted at the vertex they share and stands for half an edge on either side,
//! so that a clamped rod bends from the *middle* of the held edge on: against theory, a rod clamped at one end has the
//! length of n - 1/2 edges, one clamped at both ends that of n - 1.

use std::fmt;

use glam::{DMat3, DQuat, DVec3};

/// Place and orientation of a held end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Where the end vertex is \[m\].
    pub position: DVec3,
    /// Frame of the end edge, `world_from_material`; the edge lies along its third column.
    pub orientation: DQuat,
}

/// How an end is held, as a function of time \[s\].
pub enum Hold {
    /// Not at all.
    Free,
    /// The end vertex is led, and turns freely.
    Pin(Box<dyn Fn(f64) -> DVec3 + Send + Sync>),
    /// The end edge is led: the vertex at the end lies at the position, the other one along the orientation's third
    /// column.
    Clamp(Box<dyn Fn(f64) -> Pose + Send + Sync>),
}

/// A centerline with a frame on every edge.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    /// The vertices \[m\].
    pub points: Vec<DVec3>,
    /// One frame an edge, `world_from_material`.
    pub frames: Vec<DQuat>,
}

/// A rod of round section.
#[derive(Debug, Clone)]
pub struct Rod {
    /// Where it is at first, at rest.
    pub start: Shape,
    /// The shape without forces.
    pub rest: Shape,
    /// Radius \[m\].
    pub radius: f64,
    /// Young's modulus \[Pa\].
    pub young: f64,
    /// Shear modulus \[Pa\].
    pub shear: f64,
    /// Density \[kg/m^3\].
    pub density: f64,
}

/// All that a solver is told.
pub struct Scene {
    /// The rod.
    pub rod: Rod,
    /// How the vertex 0 is held.
    pub first: Hold,
    /// How the last vertex is held.
    pub last: Hold,
    /// Gravity \[m/s^2\].
    pub gravity: DVec3,
    /// Constant forces \[N\] on vertices.
    pub loads: Vec<(usize, DVec3)>,
    /// Rate at which velocities fade \[1/s\]; zero is none.
    pub drag: f64,
}

/// Why a scene cannot be simulated.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Invalid(pub(crate) String);

/// What every solver can do.
pub trait Solver {
    /// Steps by `frame` \[s\], in as many substeps as the solver's settings say.
    fn step(&mut self, frame: f64);
    /// Time simulated so far \[s\].
    fn time(&self) -> f64;
    /// The vertices \[m\].
    fn positions(&self) -> &[DVec3];
    /// The frames of the edges, where the method has any.
    fn frames(&self) -> Option<Vec<DQuat>>;
    /// Lengths of the edges without forces \[m\].
    fn rest_lengths(&self) -> &[f64];
    /// Length over rest length, less one.
    fn elongation(&self) -> f64 {
        let length: f64 = self.positions().windows(2).map(|p| p[0].distance(p[1])).sum();
        length / self.rest_lengths().iter().sum::<f64>() - 1.0
    }
    /// The greatest change of length of an edge over its rest length, without its sign.
    fn greatest_strain(&self) -> f64 {
        self.positions()
            .windows(2)
            .zip(self.rest_lengths())
            .map(|(p, l)| (p[0].distance(p[1]) / l - 1.0).abs())
            .fold(0.0, f64::max)
    }
}

impl fmt::Display for Invalid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Invalid {}

impl Pose {
    /// An end at `position` whose edge lies along d3 of `orientation`.
    pub fn new(position: DVec3, orientation: DQuat) -> Self {
        Pose { position, orientation }
    }
}

impl Shape {
    /// A centerline whose frames do not twist: each is the one before, carried over by the least rotation. The first d1
    /// is the direction across the first edge that is nearest to `d1`.
    pub fn untwisted(points: Vec<DVec3>, d1: DVec3) -> Self {
        let mut frames: Vec<DQuat> = Vec::with_capacity(points.len().saturating_sub(1));
        let mut across = d1;
        for i in 1..points.len() {
            let t = direction(points[i] - points[i - 1]);
            if i > 1 {
                across = transport(across, direction(points[i - 1] - points[i - 2]), t);
            }
            across = (across - t * t.dot(across)).try_normalize().unwrap_or_else(|| t.any_orthonormal_vector());
            frames.push(frame(across, t));
        }
        Shape { points, frames }
    }
    /// A straight line of `n` edges from `from` to `to`.
    pub fn straight(from: DVec3, to: DVec3, n: usize, d1: DVec3) -> Self {
        Shape::untwisted((0..=n).map(|i| from.lerp(to, i as f64 / n as f64)).collect(), d1)
    }
}

impl Rod {
    /// Second moment of area \[m^4\].
    pub fn second_moment(&self) -> f64 {
        0.25 * std::f64::consts::PI * self.radius.powi(4)
    }
    /// Area of the section \[m^2\].
    pub fn area(&self) -> f64 {
        std::f64::consts::PI * self.radius * self.radius
    }
    /// Lengths of the edges at rest \[m\].
    pub fn rest_lengths(&self) -> Vec<f64> {
        self.rest.points.windows(2).map(|p| p[0].distance(p[1])).collect()
    }
    /// Masses of the vertices \[kg\]: half of each edge that meets there.
    pub fn masses(&self) -> Vec<f64> {
        let lengths = self.rest_lengths();
        let mut masses = vec![0.0; lengths.len() + 1];
        for (i, l) in lengths.iter().enumerate() {
            let half = 0.5 * self.density * self.area() * l;
            masses[i] += half;
            masses[i + 1] += half;
        }
        masses
    }
}

impl Scene {
    /// A free rod without gravity, loads or drag.
    pub fn of(rod: Rod) -> Self {
        Scene { rod, first: Hold::Free, last: Hold::Free, gravity: DVec3::ZERO, loads: vec![], drag: 0.0 }
    }
    /// Whether the scene can be simulated.
    pub(crate) fn check(&self) -> Result<(), Invalid> {
        let rod = &self.rod;
        let n = rod.rest.points.len();
        let wrong = |what: String| Err(Invalid(what));
        if n < 5 {
            return wrong(format!("a rod needs at least 5 vertices, this one has {n}"));
        }
        for (name, shape) in [("start", &rod.start), ("rest", &rod.rest)] {
            if shape.points.len() != n || shape.frames.len() != n - 1 {
                return wrong(format!("{name} shape: {n} vertices and {} frames are wanted", n - 1));
            }
            if !shape.points.iter().all(|p| p.is_finite())
                || !shape.points.windows(2).all(|p| p[0].distance(p[1]) > 0.0)
            {
                return wrong(format!("{name} shape: neighbors must be finite and apart"));
            }
            for i in 0..n - 1 {
                // A hundredth is a slip of the caller; rounding is far below.
                if (shape.frames[i] * DVec3::Z).distance(direction(shape.points[i + 1] - shape.points[i])) > 0.01 {
                    return wrong(format!("{name} shape: d3 of frame {i} does not lie along its edge"));
                }
            }
        }
        for (name, value) in
            [("radius", rod.radius), ("young", rod.young), ("shear", rod.shear), ("density", rod.density)]
        {
            if !(value > 0.0 && value.is_finite()) {
                return wrong(format!("{name} must be positive, it is {value}"));
            }
        }
        if !(self.drag >= 0.0 && self.drag.is_finite() && self.gravity.is_finite()) {
            return wrong("drag and gravity must be finite, drag at least zero".into());
        }
        match self.loads.iter().find(|(i, f)| *i >= n || !f.is_finite()) {
            Some((i, _)) => wrong(format!("load on vertex {i}: no such vertex, or not finite")),
            None => Ok(()),
        }
    }
    /// Accelerations of the vertices by gravity and loads \[m/s^2\].
    pub(crate) fn accelerations(&self, masses: &[f64]) -> Vec<DVec3> {
        let mut a = vec![self.gravity; masses.len()];
        for &(i, f) in &self.loads {
            a[i] += f / masses[i];
        }
        a
    }
}

/// Unit vector along `v`, which is not zero.
pub(crate) fn direction(v: DVec3) -> DVec3 {
    v / v.length()
}

/// `v` after the least rotation that takes the unit vector `a` to the unit vector `b`.
pub(crate) fn transport(v: DVec3, a: DVec3, b: DVec3) -> DVec3 {
    let axis = a.cross(b);
    let c = a.dot(b);
    // Half a turn has no axis; a vector across a stays across b.
    if 1.0 + c < 1e-14 {
        return v;
    }
    v * c + axis.cross(v) + axis * (axis.dot(v) / (1.0 + c))
}

/// The frame with directors d1 and d3 = `t`.
pub(crate) fn frame(d1: DVec3, t: DVec3) -> DQuat {
    DQuat::from_mat3(&DMat3::from_cols(d1, t.cross(d1), t)).normalize()
}
