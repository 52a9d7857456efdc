//! The elastic energy of a discrete rod, its gradient and its Hessian.
//!
//! Source: Bergou, Wardetzky, Robinson, Audoly, Grinspun, "Discrete elastic rods", SIGGRAPH 2008: curvature binormal
//! (eq. 1), energies of bending and twisting, parallel transport along the rod. From Bergou, Audoly, Vouga, Wardetzky,
//! Grinspun, "Discrete viscous threads", SIGGRAPH 2010: stretching as an energy, reference frames transported in time,
//! and the derivatives of curvature and twist.
//!
//! With e, f the edges that meet at a vertex, t_e, t_f their directions, chi = 1 + t_e . t_f, l half the sum of their
//! rest lengths:
//!
//! ```text
//! kb      = 2 t_e x t_f / chi                                curvature binormal, of length 2 tan (angle / 2)
//! omega   = (kb . m2, -kb . m1) with the directors m of e, and again with those of f
//! tau     = theta_f - theta_e + reference twist
//! E       = sum EA/2 (|e| / L - 1)^2 L  +  sum [EI/2 (omega_e - rest)^2 + EI/2 (omega_f - rest)^2 + GJ (tau - rest)^2] / (2 l)        [J]
//! ```
//!
//! The two curvatures of a joint are those of 2008. Their mean, which 2010 has in their place, makes a rod that is
//! twisted by tau from edge to edge softer in bending by cos^2 (tau / 2): a fifth at twelve turns in eighty edges.
//!
//! Left out: anisotropic sections (the rods compared here are round; EI is one number), plasticity.

use glam::{DMat3, DQuat, DVec3};

use crate::band::Band;
use crate::scene::{Rod, Shape, direction, frame, transport};

/// Where a rod is: its unknowns, and the reference frames that these are measured from.
#[derive(Clone)]
pub struct Config {
    /// The vertices \[m\].
    pub x: Vec<DVec3>,
    /// Angle of the material frame from the reference frame of each edge \[rad\].
    pub theta: Vec<f64>,
    /// Direction of each edge.
    pub t: Vec<DVec3>,
    /// First director of the reference frame of each edge.
    pub reference: Vec<DVec3>,
    /// Angle from the reference frame of the edge before, transported, to that of the edge after each inner vertex
    /// \[rad\]. It counts turns.
    pub reference_twist: Vec<f64>,
}

/// Stiffness and rest shape.
pub struct Elastic {
    /// Rest length of each edge \[m\].
    pub length: Vec<f64>,
    /// Rest length of each joint \[m\]: half of both edges.
    pub joint: Vec<f64>,
    omega: Vec<[f64; 4]>,
    tau: Vec<f64>,
    /// Stiffness against stretching \[N\], bending and twisting \[N m^2\].
    pub stiffness: [f64; 3],
}

/// The four vectors and two angles that a joint's energy is made of.
struct Joint {
    kb: DVec3,
    chi: f64,
    inv_e: f64,
    inv_f: f64,
    te: DVec3,
    tf: DVec3,
    /// m1 and m2 of e, then of f.
    m: [DVec3; 4],
    omega: [f64; 4],
    tau: f64,
}

impl Config {
    /// At a shape, its frames being the reference.
    pub fn new(shape: &Shape) -> Self {
        let t: Vec<DVec3> = shape.points.windows(2).map(|p| direction(p[1] - p[0])).collect();
        let reference: Vec<DVec3> = (0..t.len())
            .map(|i| {
                let d = shape.frames[i] * DVec3::X;
                direction(d - t[i] * t[i].dot(d))
            })
            .collect();
        let twist = vec![0.0; t.len() - 1];
        let mut config =
            Config { x: shape.points.clone(), theta: vec![0.0; t.len()], t, reference, reference_twist: twist };
        config.measure_reference();
        config
    }
    /// Reference twist of all inner vertices, of the turns nearest to what it was.
    fn measure_reference(&mut self) {
        for i in 0..self.reference_twist.len() {
            let (a, b) = (self.t[i], self.t[i + 1]);
            let over = transport(self.reference[i], a, b);
            let (sin, cos) = libm::sincos(self.reference_twist[i]);
            let before = over * cos + b.cross(over) * sin;
            let now = self.reference[i + 1];
            self.reference_twist[i] += libm::atan2(before.cross(now).dot(b), before.dot(now));
        }
    }
    /// Takes the vertices and angles of `from` plus `scale` times the step `d`; reference frames are transported from
    /// those of `from`.
    pub fn set_moved(&mut self, from: &Config, d: &[f64], scale: f64) {
        for i in 0..self.x.len() {
            self.x[i] = from.x[i] + DVec3::from_slice(&d[4 * i..4 * i + 3]) * scale;
        }
        for i in 0..self.theta.len() {
            self.theta[i] = from.theta[i] + d[4 * i + 3] * scale;
        }
        self.transport_from(from);
    }
    /// Directions and reference frames of the present vertices, transported from those of `from`.
    pub fn transport_from(&mut self, from: &Config) {
        for i in 0..self.t.len() {
            let t = direction(self.x[i + 1] - self.x[i]);
            let d = transport(from.reference[i], from.t[i], t);
            // What rounding leaves along the edge or of the length is taken away.
            self.reference[i] = direction(d - t * t.dot(d));
            self.t[i] = t;
        }
        self.reference_twist.copy_from_slice(&from.reference_twist);
        self.measure_reference();
    }
    /// The first two directors of the material frame of edge `i`.
    fn material(&self, i: usize) -> [DVec3; 2] {
        let (sin, cos) = libm::sincos(self.theta[i]);
        let (u, v) = (self.reference[i], self.t[i].cross(self.reference[i]));
        [u * cos + v * sin, v * cos - u * sin]
    }
    /// The material frame of edge `i`.
    pub fn frame(&self, i: usize) -> DQuat {
        frame(self.material(i)[0], self.t[i])
    }
    /// The angle of edge `i` at which its d1 is `d1`, of the turns nearest to the present one.
    pub fn angle_towards(&self, i: usize, d1: DVec3) -> f64 {
        let [m1, m2] = self.material(i);
        self.theta[i] + libm::atan2(d1.dot(m2), d1.dot(m1))
    }
    fn joint(&self, i: usize, me: [DVec3; 2], mf: [DVec3; 2]) -> Joint {
        let (te, tf) = (self.t[i], self.t[i + 1]);
        let chi = 1.0 + te.dot(tf);
        let kb = te.cross(tf) * (2.0 / chi);
        Joint {
            kb,
            chi,
            inv_e: 1.0 / self.x[i].distance(self.x[i + 1]),
            inv_f: 1.0 / self.x[i + 1].distance(self.x[i + 2]),
            te,
            tf,
            m: [me[0], me[1], mf[0], mf[1]],
            omega: curvatures(kb, me, mf),
            tau: self.theta[i + 1] - self.theta[i] + self.reference_twist[i],
        }
    }
}

impl Elastic {
    /// Of a rod.
    pub fn new(rod: &Rod) -> Self {
        let rest = Config::new(&rod.rest);
        let length = rod.rest_lengths();
        let i = rod.second_moment();
        let joints: Vec<Joint> =
            (0..length.len() - 1).map(|k| rest.joint(k, rest.material(k), rest.material(k + 1))).collect();
        Elastic {
            joint: length.windows(2).map(|l| 0.5 * (l[0] + l[1])).collect(),
            length,
            omega: joints.iter().map(|j| j.omega).collect(),
            tau: joints.iter().map(|j| j.tau).collect(),
            stiffness: [rod.young * rod.area(), rod.young * i, rod.shear * 2.0 * i],
        }
    }
    /// Energies of stretching, bending and twisting \[J\].
    pub fn energy(&self, c: &Config) -> [f64; 3] {
        let [ea, ei, gj] = self.stiffness;
        let mut energy = [0.0; 3];
        let mut me = c.material(0);
        for i in 0..self.length.len() {
            let strain = c.x[i].distance(c.x[i + 1]) / self.length[i] - 1.0;
            energy[0] += 0.5 * ea * strain * strain * self.length[i];
            if i + 1 < self.length.len() {
                let mf = c.material(i + 1);
                let kb = c.t[i].cross(c.t[i + 1]) * (2.0 / (1.0 + c.t[i].dot(c.t[i + 1])));
                let omega = curvatures(kb, me, mf);
                let bend: f64 = omega.iter().zip(&self.omega[i]).map(|(a, b)| (a - b) * (a - b)).sum();
                let tau = c.theta[i + 1] - c.theta[i] + c.reference_twist[i] - self.tau[i];
                energy[1] += 0.25 * ei * bend / self.joint[i];
                energy[2] += 0.5 * gj * tau * tau / self.joint[i];
                me = mf;
            }
        }
        energy
    }
    /// Twisting moment at each inner vertex \[N m\].
    pub fn twisting(&self, c: &Config) -> Vec<f64> {
        (0..self.joint.len())
            .map(|i| {
                self.stiffness[2] * (c.theta[i + 1] - c.theta[i] + c.reference_twist[i] - self.tau[i]) / self.joint[i]
            })
            .collect()
    }
    /// Tension of each edge \[N\].
    pub fn tensions(&self, c: &Config) -> Vec<f64> {
        (0..self.length.len())
            .map(|i| self.stiffness[0] * (c.x[i].distance(c.x[i + 1]) / self.length[i] - 1.0))
            .collect()
    }
    /// Adds gradient and Hessian; the unknowns are x, y, z of vertex 0, angle of edge 0, x, y, z of vertex 1 and so on.
    /// Without `curved` the second derivatives of curvature and twist, and the negative ones of stretching, are left
    /// out: that matrix is never indefinite.
    pub fn assemble(&self, c: &Config, curved: bool, gradient: &mut [f64], hessian: &mut Band) {
        let [ea, ei, gj] = self.stiffness;
        for i in 0..self.length.len() {
            let l = c.x[i].distance(c.x[i + 1]);
            let force = ea * (l / self.length[i] - 1.0);
            let side = if curved { force / l } else { (force / l).max(0.0) };
            let along = DMat3::from_cols(c.t[i] * c.t[i].x, c.t[i] * c.t[i].y, c.t[i] * c.t[i].z);
            let k = along * (ea / self.length[i] - side) + DMat3::from_diagonal(DVec3::splat(side));
            for a in 0..3 {
                gradient[4 * i + a] -= force * c.t[i][a];
                gradient[4 * i + 4 + a] += force * c.t[i][a];
                for b in 0..3 {
                    let v = k.col(b)[a];
                    hessian.add(4 * i + 4 + a, 4 * i + b, -v);
                    if b <= a {
                        hessian.add(4 * i + a, 4 * i + b, v);
                        hessian.add(4 * i + 4 + a, 4 * i + 4 + b, v);
                    }
                }
            }
        }
        let mut me = c.material(0);
        for i in 0..self.joint.len() {
            let mf = c.material(i + 1);
            let joint = c.joint(i, me, mf);
            me = mf;
            let mut g = [0.0; 8];
            let mut h = [[0.0; 8]; 8];
            // The sums of the directors that the curvatures are measured with, each times its moment.
            let (mut de, mut df) = (DVec3::ZERO, DVec3::ZERO);
            let mut add = |stiffness: f64, strain: f64, first: &[f64; 8]| {
                for a in 0..8 {
                    g[a] += stiffness * strain * first[a];
                    for b in 0..=a {
                        h[a][b] += stiffness * first[a] * first[b];
                    }
                }
            };
            let k = 0.5 * ei / self.joint[i];
            for which in 0..4 {
                let strain = joint.omega[which] - self.omega[i][which];
                let (d, turned) = joint.directors(which);
                let (e, f) = if which < 2 { (d, DVec3::ZERO) } else { (DVec3::ZERO, d) };
                let (ue, uf) = if which < 2 { (turned, DVec3::ZERO) } else { (DVec3::ZERO, turned) };
                add(k, strain, &joint.curvature_gradient(joint.omega[which], e, f, ue, uf));
                de += e * (k * strain);
                df += f * (k * strain);
            }
            let (k, strain) = (gj / self.joint[i], joint.tau - self.tau[i]);
            add(k, strain, &joint.twist_gradient());
            if curved {
                joint.add_curvature_hessian(de, df, &mut h);
                joint.add_twist_hessian(k * strain, &mut h);
            }
            scatter(4 * i, &g, &mut h, gradient, hessian);
        }
    }
}

/// From edges to vertices: e = x1 - x0, f = x2 - x1. Only the lower triangle of `h` is given.
fn scatter(base: usize, g: &[f64; 8], h: &mut [[f64; 8]; 8], gradient: &mut [f64], hessian: &mut Band) {
    for a in 0..8 {
        for b in a + 1..8 {
            h[a][b] = h[b][a];
        }
    }
    // Columns first, then rows.
    let mut m = [[0.0; 11]; 8];
    for a in 0..8 {
        m[a] = spread(&h[a]);
    }
    let rows = spread(g);
    for b in 0..11 {
        let column = spread(&[m[0][b], m[1][b], m[2][b], m[3][b], m[4][b], m[5][b], m[6][b], m[7][b]]);
        gradient[base + b] += rows[b];
        for a in b..11 {
            hessian.add(base + a, base + b, column[a]);
        }
    }
}

/// Derivatives by (e, angle of e, f, angle of f) as derivatives by (x0, angle of e, x1, angle of f, x2).
fn spread(v: &[f64; 8]) -> [f64; 11] {
    [-v[0], -v[1], -v[2], v[3], v[0] - v[4], v[1] - v[5], v[2] - v[6], v[7], v[4], v[5], v[6]]
}

/// The curvature binormal in the directors of both edges.
fn curvatures(kb: DVec3, me: [DVec3; 2], mf: [DVec3; 2]) -> [f64; 4] {
    [kb.dot(me[1]), -kb.dot(me[0]), kb.dot(mf[1]), -kb.dot(mf[0])]
}

impl Joint {
    /// What curvature `which` is measured with, and what that becomes when it turns about its edge.
    fn directors(&self, which: usize) -> (DVec3, DVec3) {
        let [m1, m2] = if which < 2 { [self.m[0], self.m[1]] } else { [self.m[2], self.m[3]] };
        if which.is_multiple_of(2) { (m2, -m1) } else { (-m1, -m2) }
    }
    /// Of `kappa` = kb . (de + df), with de fixed in the frame of e and df in that of f; `ue` and `uf` are these turned
    /// by a right angle.
    fn curvature_gradient(&self, kappa: f64, de: DVec3, df: DVec3, ue: DVec3, uf: DVec3) -> [f64; 8] {
        let t = (self.te + self.tf) / self.chi;
        let d = (de + df) * (2.0 / self.chi);
        let e = (self.tf.cross(d) - t * kappa) * self.inv_e;
        let f = (-self.te.cross(d) - t * kappa) * self.inv_f;
        [e.x, e.y, e.z, self.kb.dot(ue), f.x, f.y, f.z, self.kb.dot(uf)]
    }
    fn twist_gradient(&self) -> [f64; 8] {
        let (e, f) = (self.kb * (0.5 * self.inv_e), self.kb * (0.5 * self.inv_f));
        [e.x, e.y, e.z, -1.0, f.x, f.y, f.z, 1.0]
    }
    /// Adds the second derivatives of kb . (de + df).
    fn add_curvature_hessian(&self, de: DVec3, df: DVec3, h: &mut [[f64; 8]; 8]) {
        let (ie, jf) = (self.inv_e, self.inv_f);
        let kappa = self.kb.dot(de + df);
        let t = (self.te + self.tf) / self.chi;
        let d = (de + df) * (2.0 / self.chi);
        let (a, b) = (self.tf.cross(d), self.te.cross(d));
        let tt = outer(t, t) * (2.0 * kappa);
        let id = DMat3::IDENTITY;
        let ee = (tt - outer(a, t) - outer(t, a) - (id - outer(self.te, self.te)) * (kappa / self.chi)
            + (outer(self.kb, de) + outer(de, self.kb)) * 0.5)
            * (ie * ie);
        let ff = (tt + outer(b, t) + outer(t, b) - (id - outer(self.tf, self.tf)) * (kappa / self.chi)
            + (outer(self.kb, df) + outer(df, self.kb)) * 0.5)
            * (jf * jf);
        let ef = (tt - outer(a, t) + outer(t, b) - (id + outer(self.te, self.tf)) * (kappa / self.chi) - skew(d))
            * (ie * jf);
        add_blocks(1.0, ee, ff, ef, h);
        // Turning a frame turns its director d into u, and u into -d.
        for (row, u, dd) in [(3, self.te.cross(de), de), (7, self.tf.cross(df), df)] {
            let slope = self.kb.dot(u);
            let e = (self.tf.cross(u) * (2.0 / self.chi) - t * slope) * ie;
            let f = (-self.te.cross(u) * (2.0 / self.chi) - t * slope) * jf;
            for k in 0..3 {
                h[row.max(k)][row.min(k)] += e[k];
                h[row.max(k + 4)][row.min(k + 4)] += f[k];
            }
            h[row][row] -= self.kb.dot(dd);
        }
    }
    fn add_twist_hessian(&self, scale: f64, h: &mut [[f64; 8]; 8]) {
        let (ie, jf) = (self.inv_e, self.inv_f);
        let t = (self.te + self.tf) / self.chi;
        let ee = (outer(self.kb, self.te + t) + outer(self.te + t, self.kb)) * (-0.25 * ie * ie);
        let ff = (outer(self.kb, self.tf + t) + outer(self.tf + t, self.kb)) * (-0.25 * jf * jf);
        let ef = (skew(self.te) * (2.0 / self.chi) - outer(self.kb, t)) * (0.5 * ie * jf);
        add_blocks(scale, ee, ff, ef, h);
    }
}

/// Adds second derivatives by e and e, f and f, e (row) and f (column) to the lower triangle.
fn add_blocks(scale: f64, ee: DMat3, ff: DMat3, ef: DMat3, h: &mut [[f64; 8]; 8]) {
    for a in 0..3 {
        for b in 0..3 {
            h[4 + b][a] += scale * ef.col(b)[a];
            if b <= a {
                h[a][b] += scale * ee.col(b)[a];
                h[4 + a][4 + b] += scale * ff.col(b)[a];
            }
        }
    }
}

fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

fn skew(a: DVec3) -> DMat3 {
    DMat3::from_cols(DVec3::new(0.0, a.z, -a.y), DVec3::new(-a.z, 0.0, a.x), DVec3::new(a.y, -a.x, 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(k: usize) -> f64 {
        libm::sin((k * k) as f64 * 1.7 + k as f64)
    }

    /// A crooked rod of five edges, bent and twisted, with a rest shape of its own; energies of order one.
    fn crooked() -> (Elastic, Config) {
        let points = |seed: usize| {
            (0..6)
                .map(|i| {
                    DVec3::new(i as f64 + 0.3 * noise(seed + i), 0.4 * noise(seed + 10 + i), 0.4 * noise(seed + 20 + i))
                })
                .collect()
        };
        let start = Shape::untwisted(points(3), DVec3::Y);
        let rest = Shape::untwisted(points(40), DVec3::Y);
        let mut config = Config::new(&start);
        (0..5).for_each(|i| config.theta[i] = 0.7 * noise(i + 60));
        let mut elastic = Elastic::new(&Rod { start, rest, radius: 1.0, young: 1.0, shear: 0.4, density: 1.0 });
        elastic.stiffness = [1.0, 0.8, 0.6];
        (elastic, config)
    }

    fn energy(elastic: &Elastic, from: &Config, d: &[f64]) -> f64 {
        let mut moved = from.clone();
        moved.set_moved(from, d, 1.0);
        elastic.energy(&moved).iter().sum()
    }

    /// Gradient and Hessian against central differences of the energy, frames transported from where the derivatives
    /// are taken.
    #[test]
    fn derivatives_are_those_of_the_energy() {
        let (elastic, config) = crooked();
        let n = 23;
        let mut gradient = vec![0.0; n];
        let mut hessian = Band::new(n);
        elastic.assemble(&config, true, &mut gradient, &mut hessian);
        // Differences of fourth order: error some s^4 = 1e-12 and rounding 1e-16 / s for the gradient, 1e-16 / s^2 for
        // the Hessian.
        let s = 1e-3;
        for k in 0..n {
            let at = |m: f64| {
                let mut d = vec![0.0; n];
                d[k] = m * s;
                energy(&elastic, &config, &d)
            };
            let slope = (8.0 * (at(1.0) - at(-1.0)) - at(2.0) + at(-2.0)) / (12.0 * s);
            assert!((slope - gradient[k]).abs() < 1e-9, "gradient {k}: {} for {slope}", gradient[k]);
        }
        for r in 0..n {
            for c in 0..=r {
                let at = |m: f64, p: f64| {
                    let mut d = vec![0.0; n];
                    d[r] += m * s;
                    d[c] += p * s;
                    energy(&elastic, &config, &d)
                };
                let second = |u: f64| (at(u, u) - at(u, -u) - at(-u, u) + at(-u, -u)) / (4.0 * u * u * s * s);
                let wanted = (4.0 * second(1.0) - second(2.0)) / 3.0;
                let got = if r - c > crate::band::HALF { 0.0 } else { hessian.entry(r, c) };
                assert!((wanted - got).abs() < 1e-7, "Hessian {r} {c}: {got} for {wanted}");
            }
        }
    }

    /// A rigid motion and a common turn of all frames cost nothing; the energies of a bent arc and of a twisted line
    /// are those of theory.
    #[test]
    fn energies_are_those_of_theory() {
        let n = 100;
        let arc: Vec<DVec3> = (0..=n)
            .map(|i| {
                let a = i as f64 / n as f64;
                DVec3::new(libm::sin(a), 1.0 - libm::cos(a), 0.0)
            })
            .collect();
        let rod = Rod {
            start: Shape::untwisted(arc, DVec3::Z),
            rest: Shape::straight(DVec3::ZERO, DVec3::X, n, DVec3::Z),
            radius: 0.01,
            young: 1e6,
            shear: 4e5,
            density: 1.0,
        };
        let elastic = Elastic::new(&rod);
        let mut config = Config::new(&rod.start);
        (0..n).for_each(|i| config.theta[i] = 2.0 * i as f64 / (n - 1) as f64);
        let [_, bend, twist] = elastic.energy(&config);
        let ei = 1e6 * rod.second_moment();
        // Joints reach from the middle of the first edge to that of the last: L = 1 - 1 / n; chords and tangents differ
        // by 1 / n^2.
        let l = 1.0 - 1.0 / n as f64;
        assert!((bend / (0.5 * ei * l) - 1.0).abs() < 1e-4, "{bend}");
        assert!((twist / (0.5 * 0.8 * ei * 4.0 / l) - 1.0).abs() < 1e-12, "{twist}");
    }
}
