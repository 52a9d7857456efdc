//! Discrete elastic rods with implicit time integration.
//!
//! Source: Bergou and others 2008 and 2010, as `energy.rs` says. Vertices and one angle an edge are the unknowns;
//! material frames are turned by the angles from reference frames, which are transported in time. Where this departs
//! from 2008: stretching is an energy instead of a projection onto constant lengths, frames are not quasistatic (an
//! edge has the inertia of its section about its axis), and time is integrated by implicit Euler: a step ends where
//!
//! ```text
//! sum m |x - x_predicted|^2 / (2 h^2)  +  sum J (theta - theta_predicted)^2 / (2 h^2)  +  E(x, theta)        [J]
//! ```
//!
//! is least. It is found by Newton's method with the band matrix of all unknowns and a search along each direction.
//! Where the matrix is not positive definite, that of Gauss and Newton takes its place.
//!
//! Left out: contact, the momentum of edges that turn across their axis (as in the papers), damping other than the drag
//! of the scene.

mod energy;

use glam::{DQuat, DVec3};

use crate::band::Band;
use crate::scene::{Hold, Invalid, Scene, Solver};
use energy::{Config, Elastic};

/// How closely it is solved.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// Substeps of a frame.
    pub substeps: usize,
    /// Newton iterations of a substep at most.
    pub iterations: usize,
    /// A substep is solved when no vertex moved by more than this, over the mean length of an edge, and no angle by
    /// more, in radians.
    pub tolerance: f64,
}

/// A rod of discrete elastic rods.
pub struct Der {
    scene: Scene,
    settings: Settings,
    elastic: Elastic,
    masses: Vec<f64>,
    /// Moments of inertia of the edges about their axes \[kg m^2\].
    inertias: Vec<f64>,
    accelerations: Vec<DVec3>,
    /// Unknowns that the ends' holds give.
    fixed: Vec<usize>,
    config: Config,
    trial: Config,
    v: Vec<DVec3>,
    spin: Vec<f64>,
    time: f64,
    x_predicted: Vec<DVec3>,
    theta_predicted: Vec<f64>,
    gradient: Vec<f64>,
    direction: Vec<f64>,
    matrix: Band,
    newton: usize,
    unsolved: usize,
}

impl Default for Settings {
    /// Solved to rounding: a frame takes two to four iterations. Where a step jumps, as when a straight rod is suddenly
    /// pressed, it may be a hundred and more; the limit is for such.
    fn default() -> Self {
        Settings { substeps: 1, iterations: 200, tolerance: 1e-9 }
    }
}

impl Der {
    /// At rest in the start shape.
    pub fn new(scene: Scene, settings: Settings) -> Result<Self, Invalid> {
        scene.check()?;
        if settings.substeps == 0
            || settings.iterations == 0
            || settings.tolerance.is_nan()
            || settings.tolerance <= 0.0
        {
            return Err(Invalid("substeps, iterations and tolerance must be positive".into()));
        }
        let rod = &scene.rod;
        let elastic = Elastic::new(rod);
        let masses = rod.masses();
        let n = elastic.length.len();
        let mut fixed: Vec<usize> = match scene.first {
            Hold::Free => vec![],
            Hold::Pin(_) => vec![0, 1, 2],
            Hold::Clamp(_) => (0..7).collect(),
        };
        match scene.last {
            Hold::Free => {}
            Hold::Pin(_) => fixed.extend(4 * n..4 * n + 3),
            Hold::Clamp(_) => fixed.extend(4 * n - 4..4 * n + 3),
        }
        let config = Config::new(&rod.start);
        Ok(Der {
            inertias: elastic.length.iter().map(|l| 2.0 * rod.density * rod.second_moment() * l).collect(),
            accelerations: scene.accelerations(&masses),
            trial: config.clone(),
            v: vec![DVec3::ZERO; n + 1],
            spin: vec![0.0; n],
            time: 0.0,
            x_predicted: config.x.clone(),
            theta_predicted: config.theta.clone(),
            gradient: vec![0.0; 4 * n + 3],
            direction: vec![0.0; 4 * n + 3],
            matrix: Band::new(4 * n + 3),
            newton: 0,
            unsolved: 0,
            scene,
            settings,
            elastic,
            masses,
            fixed,
            config,
        })
    }
    /// Velocities of the vertices \[m/s\].
    pub fn velocities(&self) -> &[DVec3] {
        &self.v
    }
    /// Sets the velocities of the vertices \[m/s\].
    pub fn set_velocities(&mut self, v: &[DVec3]) {
        self.v.copy_from_slice(v);
    }
    /// Energies of stretching, bending and twisting \[J\].
    pub fn elastic_energy(&self) -> [f64; 3] {
        self.elastic.energy(&self.config)
    }
    /// Twisting moment at each inner vertex \[N m\].
    pub fn twisting_moments(&self) -> Vec<f64> {
        self.elastic.twisting(&self.config)
    }
    /// Tension of each edge \[N\].
    pub fn tensions(&self) -> Vec<f64> {
        self.elastic.tensions(&self.config)
    }
    /// Forces of stretching, bending and twisting on the vertices \[N\]. At rest a held end bears the negative of those
    /// on its vertices.
    pub fn elastic_forces(&self) -> Vec<DVec3> {
        let n = self.masses.len();
        let (mut gradient, mut matrix) = (vec![0.0; 4 * n - 1], Band::new(4 * n - 1));
        self.elastic.assemble(&self.config, false, &mut gradient, &mut matrix);
        (0..n).map(|i| -DVec3::from_slice(&gradient[4 * i..4 * i + 3])).collect()
    }
    /// Newton iterations done so far.
    pub fn newton_iterations(&self) -> usize {
        self.newton
    }
    /// Substeps so far that ended above the tolerance.
    pub fn unsolved(&self) -> usize {
        self.unsolved
    }

    fn substep(&mut self, h: f64) {
        self.time += h;
        let before = self.config.clone();
        let fade = libm::exp(-self.scene.drag * h);
        for i in 0..self.v.len() {
            self.x_predicted[i] = before.x[i] + self.v[i] * (h * fade) + self.accelerations[i] * (h * h);
            self.config.x[i] = before.x[i] + self.v[i] * (h * fade);
        }
        for i in 0..self.spin.len() {
            self.theta_predicted[i] = before.theta[i] + self.spin[i] * (h * fade);
            self.config.theta[i] = self.theta_predicted[i];
        }
        self.lead_ends(&before);
        self.minimize(h);
        for i in 0..self.v.len() {
            self.v[i] = (self.config.x[i] - before.x[i]) / h;
        }
        for i in 0..self.spin.len() {
            self.spin[i] = (self.config.theta[i] - before.theta[i]) / h;
        }
    }

    /// Puts held vertices and frames where they are led; transports the reference frames to where all vertices are now.
    fn lead_ends(&mut self, before: &Config) {
        let n = self.elastic.length.len();
        let mut d1 = [None, None];
        for (k, hold, end, inner, edge, sign) in
            [(0, &self.scene.first, 0, 1, 0, 1.0), (1, &self.scene.last, n, n - 1, n - 1, -1.0)]
        {
            match hold {
                Hold::Free => {}
                Hold::Pin(at) => self.config.x[end] = at(self.time),
                Hold::Clamp(at) => {
                    let pose = at(self.time);
                    self.config.x[end] = pose.position;
                    self.config.x[inner] =
                        pose.position + pose.orientation * DVec3::Z * (sign * self.elastic.length[edge]);
                    // Measured from the angle before, so that a turn per step of less than half is followed.
                    self.config.theta[edge] = before.theta[edge];
                    d1[k] = Some((edge, pose.orientation * DVec3::X));
                }
            }
        }
        self.config.transport_from(before);
        for (edge, d) in d1.into_iter().flatten() {
            self.config.theta[edge] = self.config.angle_towards(edge, d);
        }
    }

    /// What a step minimizes, at `c`.
    fn merit(&self, c: &Config, h: f64) -> f64 {
        let w = 0.5 / (h * h);
        let linear: f64 =
            (0..self.masses.len()).map(|i| self.masses[i] * c.x[i].distance_squared(self.x_predicted[i])).sum();
        let turning: f64 =
            (0..self.inertias.len()).map(|i| self.inertias[i] * (c.theta[i] - self.theta_predicted[i]).powi(2)).sum();
        w * (linear + turning) + self.elastic.energy(c).iter().sum::<f64>()
    }

    fn assemble(&mut self, h: f64, curved: bool) {
        self.gradient.fill(0.0);
        self.matrix.clear();
        self.elastic.assemble(&self.config, curved, &mut self.gradient, &mut self.matrix);
        for i in 0..self.masses.len() {
            let w = self.masses[i] / (h * h);
            for k in 0..3 {
                self.gradient[4 * i + k] += w * (self.config.x[i][k] - self.x_predicted[i][k]);
                self.matrix.add(4 * i + k, 4 * i + k, w);
            }
        }
        for i in 0..self.inertias.len() {
            let w = self.inertias[i] / (h * h);
            self.gradient[4 * i + 3] += w * (self.config.theta[i] - self.theta_predicted[i]);
            self.matrix.add(4 * i + 3, 4 * i + 3, w);
        }
        for &k in &self.fixed {
            self.gradient[k] = 0.0;
            self.matrix.fix(k);
        }
    }

    fn minimize(&mut self, h: f64) {
        let edge = self.elastic.length.iter().sum::<f64>() / self.elastic.length.len() as f64;
        let mut merit = self.merit(&self.config, h);
        for _ in 0..self.settings.iterations {
            self.newton += 1;
            self.assemble(h, true);
            if !self.matrix.factor() {
                self.assemble(h, false);
                if !self.matrix.factor() {
                    break;
                }
            }
            for (d, g) in self.direction.iter_mut().zip(&self.gradient) {
                *d = -g;
            }
            self.matrix.solve(&mut self.direction);
            let slope: f64 = self.direction.iter().zip(&self.gradient).map(|(d, g)| d * g).sum();
            let reach = (0..self.masses.len())
                .map(|i| DVec3::from_slice(&self.direction[4 * i..4 * i + 3]).length() / edge)
                .chain((0..self.inertias.len()).map(|i| self.direction[4 * i + 3].abs()))
                .fold(0.0, f64::max);
            // Beyond a turn of an edge by half a radian the second derivatives say little.
            let turn = (0..self.elastic.length.len())
                .map(|i| {
                    let (a, b) = (&self.direction[4 * i..4 * i + 3], &self.direction[4 * i + 4..4 * i + 7]);
                    DVec3::from_slice(b).distance(DVec3::from_slice(a)) / self.elastic.length[i]
                })
                .fold(0.0, f64::max);
            let mut scale = if turn > 0.5 { 0.5 / turn } else { 1.0 };
            // Below this the merit cannot tell one point from the next; the direction can.
            let rounding = -slope <= 1e-11 * merit.abs();
            let mut found = false;
            for _ in 0..40 {
                self.trial.set_moved(&self.config, &self.direction, scale);
                let value = self.merit(&self.trial, h);
                // A ten-thousandth of what the slope promises is the usual condition of Armijo.
                if value <= merit + 1e-4 * scale * slope || (rounding && value.is_finite()) {
                    merit = value;
                    found = true;
                    break;
                }
                scale *= 0.5;
            }
            if !found {
                break;
            }
            std::mem::swap(&mut self.config, &mut self.trial);
            if reach < self.settings.tolerance {
                return;
            }
        }
        self.unsolved += 1;
    }
}

impl Solver for Der {
    fn step(&mut self, frame: f64) {
        for _ in 0..self.settings.substeps {
            self.substep(frame / self.settings.substeps as f64);
        }
    }
    fn time(&self) -> f64 {
        self.time
    }
    fn positions(&self) -> &[DVec3] {
        &self.config.x
    }
    fn frames(&self) -> Option<Vec<DQuat>> {
        Some((0..self.elastic.length.len()).map(|i| self.config.frame(i)).collect())
    }
    fn rest_lengths(&self) -> &[f64] {
        &self.elastic.length
    }
}
