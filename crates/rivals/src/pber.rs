//! Position-based elastic rods with ghost points.
//!
//! Source: Umetani, Schmidt, Stam, "Position-based elastic rods", SCA 2014, and its appendix. Beside each edge is a
//! ghost point, which with the edge spans the material frame. The loop is that of Müller and others 2007 (`points.rs`).
//! With an edge from p0 to p1, its ghost point g, its middle m and e = p1 - p0:
//!
//! ```text
//! |e| - L                     length of the edge                                                     [m]
//! (g - m) . e                 the ghost point stays on the perpendicular bisector                     [m^2]
//! |g - m| - L_ghost           and at its distance                                                     [m]
//! Omega - Omega_rest          Darboux vector at the vertex between two edges, in their mean frame      [1/m]
//!
//! d3 = e / |e|,  d1 = (g - m) across d3,  d2 = d3 x d1
//! Omega_k = 2 (a_i . b_j - a_j . b_i) / (l (1 + sum a_i . b_i)),   (k, j, i) a turn of (1, 2, 3), a and b the frames of both edges
//! ```
//!
//! which is 2 tan (angle / 2) / l along the axis of the rotation from a to b (appendix, section 2). The last is one
//! constraint with three components: the correction is - W J^T (J W J^T)^-1 (s Omega - s Omega_rest) with stiffness
//! numbers s in \[0, 1\] for bending about d1, d2 and for twist. The derivatives are our own: Omega by the rotations of
//! both frames, these by the points. A sweep goes over the edges and joints from both ends in turn, the source's
//! bilateral order, so that neither end comes first.
//!
//! Ours, where the source leaves a choice: the ghost point stands half an edge away and has the mass of its edge, so
//! that the whole has twice the mass of the rod; loads on vertices (forces) act on the vertices' own mass. Gravity may
//! act on ghost points or not: with it free fall is exact, but their weight beside the rod twists and tilts it (a
//! thread hangs 2 mm beside its pin); without it a held rod rests nearly right (14 micrometers), and one that falls
//! freely turns about its axis.
//!
//! What the numbers mean: where constraints cannot all be met, as in a rod that is bent and twisted by its ends, the
//! shape is (for small numbers, many sweeps) that of least sum of s Omega^T (J W J^T)^-1 Omega. For straight equal
//! edges of length L and points of mass m, J W J^T is 6 / (m L^4) in bending and 10 / (m L^4) in twist, so that at
//! equal numbers the rod is 0.6 times as stiff in twist as in bending. At the joint of a held edge it is 1 and 5 (six
//! times and twice as stiff), at the next 5 and 9; there it also couples twist with bending, and a straight rod turned
//! by 3 radians in 20 edges leaves its axis by a tenth of an edge. Large numbers leave less in the joints that a sweep
//! comes to last. A ghost point beside the plane in which a rod is bent draws it out of the plane.
//!
//! Left out: coupling with triangles and rigid bodies. Moduli do nothing: stiffness is in the numbers, which mean what
//! iterations, substeps and the number of edges make of them.

use glam::{DMat3, DQuat, DVec3};

use crate::points::{Points, check_settings, lead};
use crate::scene::{Invalid, Scene, Shape, Solver, frame};

/// How it is solved, and its stiffness numbers.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// Substeps of a frame.
    pub substeps: usize,
    /// Sweeps over all constraints of a substep.
    pub iterations: usize,
    /// Share of a violation that a projection removes, in \[0, 1\]: lengths of edges.
    pub stretching: f64,
    /// The same for both constraints of a ghost point.
    pub ghost: f64,
    /// The same for the Darboux vector: bending about d1 and d2, twist.
    pub bend_twist: DVec3,
    /// Whether gravity acts on ghost points.
    pub ghost_gravity: bool,
}

/// A rod of position-based elastic rods.
pub struct Pber {
    scene: Scene,
    settings: Settings,
    /// The vertices, then the ghost points.
    points: Points,
    length: Vec<f64>,
    ghost: Vec<f64>,
    joint: Vec<f64>,
    omega: Vec<DVec3>,
    /// Edges in the order of a sweep.
    order: Vec<usize>,
    time: f64,
}

impl Default for Settings {
    /// Lengths and ghost points as stiff as they can be, bending and twisting half as much, twenty sweeps; for rods
    /// that are held.
    fn default() -> Self {
        Settings {
            substeps: 1,
            iterations: 20,
            stretching: 1.0,
            ghost: 1.0,
            bend_twist: DVec3::splat(0.5),
            ghost_gravity: false,
        }
    }
}

/// The frame of an edge, and what its rotation depends on.
struct Frame {
    d: DMat3,
    length: f64,
    /// Distance of the ghost point across the edge, and along it from the middle \[m\].
    across: f64,
    along: f64,
}

impl Frame {
    fn new(p0: DVec3, p1: DVec3, g: DVec3) -> Frame {
        let e = p1 - p0;
        let length = e.length();
        let d3 = e / length;
        let w = g - (p0 + p1) * 0.5;
        let along = w.dot(d3);
        let u = w - d3 * along;
        let across = u.length();
        let d1 = u / across;
        Frame { d: DMat3::from_cols(d1, d3.cross(d1), d3), length, across, along }
    }
    /// What a motion of p0, p1 and g turns the frame by, a vector along the world axes: three matrices.
    ///
    /// With e and w = g - m moving by de and dw the frame turns by d3 x de / |e| and, about d3, by d2 . (dw - d3 (de .
    /// ..)) over the distance across: d2 . (dw - (along / |e|) de) / across.
    fn turns(&self) -> [DMat3; 3] {
        let (d2, d3) = (self.d.y_axis, self.d.z_axis);
        let swing = skew(d3) * (1.0 / self.length);
        let by_w = outer(d3, d2) * (1.0 / self.across);
        let by_e = swing - by_w * (self.along / self.length);
        [-by_e - by_w * 0.5, by_e - by_w * 0.5, by_w]
    }
}

/// The Darboux vector between two frames \[1/m\], and its derivative by a rotation of `b` (a vector along the world
/// axes; `a` gives the negative).
fn darboux(a: &Frame, b: &Frame, l: f64) -> (DVec3, DMat3) {
    let r = a.d.transpose() * b.d;
    let trace = r.x_axis.x + r.y_axis.y + r.z_axis.z;
    let axis = DVec3::new(r.y_axis.z - r.z_axis.y, r.z_axis.x - r.x_axis.z, r.x_axis.y - r.y_axis.x);
    let v = axis * (2.0 / (1.0 + trace));
    // A rotation by w after that of v = 2 tan (angle / 2): dv = w + w x v / 2 + (w . v) v / 4.
    let by_turn = DMat3::IDENTITY - skew(v) * 0.5 + outer(v, v) * 0.25;
    (v / l, by_turn * a.d.transpose() * (1.0 / l))
}

fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

fn skew(a: DVec3) -> DMat3 {
    DMat3::from_cols(DVec3::new(0.0, a.z, -a.y), DVec3::new(-a.z, 0.0, a.x), DVec3::new(a.y, -a.x, 0.0))
}

impl Pber {
    /// At rest in the start shape.
    pub fn new(scene: Scene, settings: Settings) -> Result<Self, Invalid> {
        scene.check()?;
        check_settings(&[settings.substeps, settings.iterations], &[settings.stretching, settings.ghost])?;
        check_settings(&[], &settings.bend_twist.to_array())?;
        let rod = &scene.rod;
        let length = rod.rest_lengths();
        let ghost: Vec<f64> = length.iter().map(|l| 0.5 * l).collect();
        let with_ghosts = |shape: &Shape| -> Vec<DVec3> {
            let ghosts = (0..length.len())
                .map(|i| (shape.points[i] + shape.points[i + 1]) * 0.5 + shape.frames[i] * DVec3::X * ghost[i]);
            shape.points.iter().copied().chain(ghosts).collect()
        };
        let mut masses = rod.masses();
        let mut accelerations = scene.accelerations(&masses);
        accelerations
            .resize(masses.len() + length.len(), if settings.ghost_gravity { scene.gravity } else { DVec3::ZERO });
        masses.extend(length.iter().map(|l| rod.density * rod.area() * l));
        let joint: Vec<f64> = length.windows(2).map(|l| 0.5 * (l[0] + l[1])).collect();
        let rest = with_ghosts(&rod.rest);
        let n = length.len();
        let frames: Vec<Frame> = (0..n).map(|i| Frame::new(rest[i], rest[i + 1], rest[n + 1 + i])).collect();
        Ok(Pber {
            points: Points::new(with_ghosts(&rod.start), &masses, accelerations),
            omega: (0..n - 1).map(|i| darboux(&frames[i], &frames[i + 1], joint[i]).0).collect(),
            order: (0..n).map(|k| if k % 2 == 0 { k / 2 } else { n - 1 - k / 2 }).collect(),
            joint,
            ghost,
            length,
            settings,
            scene,
            time: 0.0,
        })
    }
    /// Velocities of the vertices, then of the ghost points \[m/s\].
    pub fn velocities(&self) -> &[DVec3] {
        &self.points.v
    }
    /// Sets the velocities of the vertices, then of the ghost points \[m/s\].
    pub fn set_velocities(&mut self, v: &[DVec3]) {
        self.points.v.copy_from_slice(v);
    }

    fn substep(&mut self, h: f64) {
        self.time += h;
        let n = self.length.len();
        let [first, last] = lead(&self.scene, self.time, self.length[0], self.length[n - 1]);
        let ghost = |end: &[Option<DVec3>; 3], edge: usize| match end {
            [Some(p), Some(q), Some(d1)] => Some((*p + *q) * 0.5 + *d1 * self.ghost[edge]),
            _ => None,
        };
        let held = [
            (0, first[0]),
            (1, first[1]),
            (n + 1, ghost(&first, 0)),
            (n, last[0]),
            (n - 1, last[1]),
            (2 * n, ghost(&last, n - 1)),
        ];
        for (i, at) in held {
            self.points.w[i] = if at.is_some() { 0.0 } else { self.points.w[i] };
        }
        self.points.predict(h, self.scene.drag);
        for (i, at) in held {
            self.points.p[i] = at.unwrap_or(self.points.p[i]);
        }
        for _ in 0..self.settings.iterations {
            for k in 0..n {
                self.project_edge(self.order[k]);
            }
            // The joint after an edge; the edge that comes last of all has none.
            for k in 0..n {
                if self.order[k] + 1 < n {
                    self.project_joint(self.order[k]);
                }
            }
        }
        self.points.finish(h);
    }

    fn project_edge(&mut self, i: usize) {
        let n = self.length.len();
        let ids = [i, i + 1, n + 1 + i];
        self.points.distance(i, i + 1, self.length[i], self.settings.stretching);
        let w = ids.map(|k| self.points.w[k]);
        let p = ids.map(|k| self.points.p[k]);
        // (g - m) . e: by g it is e, by p0 and p1 it is -e / 2 -+ (g - m).
        let (e, u) = (p[1] - p[0], p[2] - (p[0] + p[1]) * 0.5);
        self.project(ids, w, [e * -0.5 - u, e * -0.5 + u, e], u.dot(e), self.settings.ghost);
        let p = ids.map(|k| self.points.p[k]);
        let u = p[2] - (p[0] + p[1]) * 0.5;
        let l = u.length();
        if l > 0.0 {
            let d = u / l;
            self.project(ids, w, [d * -0.5, d * -0.5, d], l - self.ghost[i], self.settings.ghost);
        }
    }

    /// One constraint with its gradient, on three points.
    fn project(&mut self, ids: [usize; 3], w: [f64; 3], gradient: [DVec3; 3], value: f64, stiffness: f64) {
        let sum: f64 = (0..3).map(|k| w[k] * gradient[k].length_squared()).sum();
        if sum > 0.0 {
            for k in 0..3 {
                self.points.p[ids[k]] -= gradient[k] * (stiffness * value * w[k] / sum);
            }
        }
    }

    fn project_joint(&mut self, i: usize) {
        let g = self.length.len() + 1 + i;
        let ids = [i, i + 1, i + 2, g, g + 1];
        let (w, p) = (ids.map(|k| self.points.w[k]), ids.map(|k| self.points.p[k]));
        let (a, b) = (Frame::new(p[0], p[1], p[3]), Frame::new(p[1], p[2], p[4]));
        let (omega, by_turn) = darboux(&a, &b, self.joint[i]);
        let (ta, tb) = (a.turns(), b.turns());
        let turns = [-ta[0], tb[0] - ta[1], tb[1], -ta[2], tb[2]];
        let jacobian = turns.map(|t| by_turn * t);
        let mut system = DMat3::ZERO;
        for k in 0..5 {
            system += jacobian[k] * jacobian[k].transpose() * w[k];
        }
        let lambda = system.inverse() * ((omega - self.omega[i]) * self.settings.bend_twist);
        // Opposite edges, a ghost point on its edge, or nothing that can move: there is no correction then.
        if lambda.is_finite() {
            for k in 0..5 {
                self.points.p[ids[k]] -= jacobian[k].transpose() * lambda * w[k];
            }
        }
    }
}

impl Solver for Pber {
    fn step(&mut self, frame: f64) {
        for _ in 0..self.settings.substeps {
            self.substep(frame / self.settings.substeps as f64);
        }
    }
    fn time(&self) -> f64 {
        self.time
    }
    fn positions(&self) -> &[DVec3] {
        &self.points.p[..=self.length.len()]
    }
    fn frames(&self) -> Option<Vec<DQuat>> {
        let (n, p) = (self.length.len(), &self.points.p);
        Some((0..n).map(|i| Frame::new(p[i], p[i + 1], p[n + 1 + i]).d).map(|d| frame(d.x_axis, d.z_axis)).collect())
    }
    fn rest_lengths(&self) -> &[f64] {
        &self.length
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(k: usize) -> f64 {
        libm::sin((k * k) as f64 * 1.3 + k as f64)
    }

    /// The Darboux vector's derivatives by all five points against central differences, with ghost points that are not
    /// on their bisectors.
    #[test]
    fn darboux_derivatives() {
        let p: [DVec3; 5] = [0, 1, 2, 3, 4].map(|k: usize| {
            let at = [(0.0, 0.0), (1.0, 0.0), (2.0, 0.3), (0.6, 0.5), (1.4, 0.7)][k];
            DVec3::new(at.0, at.1, 0.0) + DVec3::new(noise(k), noise(k + 7), noise(k + 19)) * 0.15
        });
        let value = |p: &[DVec3; 5]| darboux(&Frame::new(p[0], p[1], p[3]), &Frame::new(p[1], p[2], p[4]), 0.9);
        let (a, b) = (Frame::new(p[0], p[1], p[3]), Frame::new(p[1], p[2], p[4]));
        assert!(a.along.abs() > 0.01 && b.along.abs() > 0.01);
        let (ta, tb, by_turn) = (a.turns(), b.turns(), value(&p).1);
        let turns = [-ta[0], tb[0] - ta[1], tb[1], -ta[2], tb[2]];
        for k in 0..5 {
            for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
                let at = |s: f64| {
                    let mut q = p;
                    q[k] += axis * s;
                    value(&q).0
                };
                // Fourth order: s^4 = 1e-12 and rounding 1e-16 / s.
                let s = 1e-3;
                let wanted = ((at(s) - at(-s)) * 8.0 - at(2.0 * s) + at(-2.0 * s)) / (12.0 * s);
                let got = by_turn * turns[k] * axis;
                assert!((wanted - got).length() < 1e-8, "point {k}: {got} for {wanted}");
            }
        }
    }

    /// J W J^T of straight equal edges of length one and points of mass one, inside, beside a held edge, and one
    /// further.
    #[test]
    fn stiffness_of_straight_joints() {
        let at = |x: f64| DVec3::X * x;
        let (a, b) = (
            Frame::new(at(0.0), at(1.0), at(0.5) + DVec3::Y * 0.5),
            Frame::new(at(1.0), at(2.0), at(1.5) + DVec3::Y * 0.5),
        );
        let (ta, tb, by_turn) = (a.turns(), b.turns(), darboux(&a, &b, 1.0).1);
        let turns = [-ta[0], tb[0] - ta[1], tb[1], -ta[2], tb[2]];
        for (w, bend, twist) in
            [([1.0; 5], 6.0, 10.0), ([0.0, 0.0, 1.0, 0.0, 1.0], 1.0, 5.0), ([0.0, 1.0, 1.0, 1.0, 1.0], 5.0, 9.0)]
        {
            let system: DMat3 = (0..5).map(|k| by_turn * turns[k] * (by_turn * turns[k]).transpose() * w[k]).sum();
            let diagonal = DVec3::new(system.x_axis.x, system.y_axis.y, system.z_axis.z);
            assert!((diagonal - DVec3::new(bend, bend, twist)).length() < 1e-12, "{w:?}: {system}");
        }
    }

    /// Between frames that differ by a turn about an axis it is 2 tan (angle / 2) / l along that axis.
    #[test]
    fn darboux_of_a_known_turn() {
        let axis = DVec3::new(0.3, -0.5, 0.8).normalize();
        let turn = DMat3::from_axis_angle(axis, 0.7);
        let at = |d: DMat3| Frame { d, length: 1.0, across: 1.0, along: 0.0 };
        let (omega, _) = darboux(&at(DMat3::IDENTITY), &at(turn), 0.5);
        assert!((omega - axis * (2.0 * libm::tan(0.35) / 0.5)).length() < 1e-14);
    }
}
