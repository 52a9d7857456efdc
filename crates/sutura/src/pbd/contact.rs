//! Contact of the paper (rows P-8 to P-10): a thread is a chain of spheres, one a particle.
//!
//! Once a step, over the way from the last state to the predicted one: boxes of swept spheres into a spatial hash;
//! boxes that overlap; the time of impact of two spheres, a root of a quadratic. The normal n there is kept. Every
//! iteration projects, with r = x_a - x_b, u = r / |r|,
//!
//! ```text
//! C_c = r . n - d >= 0 [m]                          gradient n
//! C_f = |u x n|        once C_c has pushed          gradient (I - u u^T) (n x s) / |r|,  s = (u x n) / |u x n|
//! ```
//!
//! The friction strength k multiplies the correction: inside C_f, as printed, it cancels. Shapes, of which the paper
//! has edges only, are met by the sphere's distance from them; the point met moves with the shape and has no inverse
//! mass.
//!
//! Limits: between spheres farther apart than their diameter there are gaps; what comes near in the projections only is
//! seen a step later; there are no forces.

use crate::math::Pose;
use crate::model::Model;
use crate::model::collider::Collider;
use crate::state::State;
use glam::DVec3;

/// What a sphere touches.
#[derive(Debug, Clone, Copy)]
enum Other {
    Particle(u32),
    /// A point of a shape, where it is at the end of the step.
    Point(DVec3),
}

#[derive(Debug, Clone, Copy)]
struct Contact {
    a: u32,
    b: Other,
    normal: DVec3,
    /// Least distance along the normal \[m\].
    distance: f64,
    /// Inverse masses over their sum.
    share: [f64; 2],
    /// Whether it has pushed.
    pushed: bool,
}

/// The box of a swept sphere, and its first cell.
#[derive(Debug, Clone, Copy)]
struct Swept {
    lo: DVec3,
    hi: DVec3,
    cell: [i64; 3],
}

/// Contacts of a step, and the hash that finds them.
#[derive(Default)]
pub(super) struct Contacts {
    list: Vec<Contact>,
    swept: Vec<Swept>,
    /// Hash of a cell and a sphere in it, sorted: buckets lie together, in the order of spheres.
    entries: Vec<(u32, u32)>,
    /// Rest arc of each particle from the start of its thread \[m\].
    arc: Vec<f64>,
}

/// Steps toward a shape until the gap is under this part of the radius, or as many.
const NEAR: f64 = 1e-3;
const STEPS: u32 = 32;

/// Where the particles were and are predicted to be, and what is known of each.
pub(super) struct Motion<'a> {
    pub from: &'a [DVec3],
    pub to: &'a [DVec3],
    pub radius: &'a [f64],
    pub inverse_mass: &'a [f64],
    /// Poses of the shapes at the start.
    pub shapes_from: &'a [Pose],
}

/// When, in [0, 1], two spheres first touch whose centers are `r` apart and move by `d` against each other; at once
/// where they overlap.
fn time_of_impact(r: DVec3, d: DVec3, sum: f64) -> Option<f64> {
    let c = r.length_squared() - sum * sum;
    if c <= 0.0 {
        return Some(0.0);
    }
    let (a, b) = (d.length_squared(), r.dot(d));
    let root = b * b - a * c;
    if b >= 0.0 || root < 0.0 {
        return None;
    }
    // The smaller root without cancellation.
    let t = c / (root.sqrt() - b);
    (t <= 1.0).then_some(t)
}

/// The friction constraint and its gradient over x_a; none where there is nothing to undo, or nothing that would (a
/// right angle).
fn friction(r: DVec3, n: DVec3) -> Option<(f64, DVec3)> {
    let length = r.length();
    let u = r / length;
    let cross = u.cross(n);
    let c = cross.length();
    if !(c > f64::EPSILON && u.dot(n) > f64::EPSILON) {
        return None;
    }
    let along = n.cross(cross / c);
    Some((c, (along - u * u.dot(along)) / length))
}

impl Contacts {
    pub fn len(&self) -> usize {
        self.list.len()
    }
    pub fn touching(&self) -> usize {
        self.list.iter().filter(|c| c.pushed).count()
    }

    /// Finds what meets on the way.
    pub fn detect(&mut self, model: &Model, state: &State, m: &Motion<'_>) {
        self.list.clear();
        self.sweep(m);
        self.measure_arcs(model, state);
        self.meet_threads(model, m);
        self.meet_shapes(model, state, m);
    }

    fn sweep(&mut self, m: &Motion<'_>) {
        self.swept.clear();
        let mut extent = 0.0f64;
        for (i, (a, b)) in m.from.iter().zip(m.to).enumerate() {
            let r = DVec3::splat(m.radius[i]);
            let (lo, hi) = (a.min(*b) - r, a.max(*b) + r);
            extent = extent.max((hi - lo).max_element());
            self.swept.push(Swept { lo, hi, cell: [0; 3] });
        }
        // A cell as large as the largest box: each box is in eight cells at most.
        let scale = 1.0 / extent;
        let cell = |p: DVec3| (p * scale).to_array().map(|v| v.floor() as i64);
        self.entries.clear();
        for (i, s) in self.swept.iter_mut().enumerate() {
            s.cell = cell(s.lo);
            let last = cell(s.hi);
            for x in s.cell[0]..=last[0].min(s.cell[0].saturating_add(1)) {
                for y in s.cell[1]..=last[1].min(s.cell[1].saturating_add(1)) {
                    for z in s.cell[2]..=last[2].min(s.cell[2].saturating_add(1)) {
                        self.entries.push((hash([x, y, z]), i as u32));
                    }
                }
            }
        }
        self.entries.sort_unstable();
    }

    fn measure_arcs(&mut self, model: &Model, state: &State) {
        self.arc.clear();
        for e in 0..model.mass.len() {
            let first = e == 0 || model.rod_of[e] != model.rod_of[e - 1];
            self.arc.push(if first { 0.0 } else { self.arc[e - 1] + state.rest_length[e - 1] });
        }
    }

    fn meet_threads(&mut self, model: &Model, m: &Motion<'_>) {
        let mut start = 0;
        while start < self.entries.len() {
            let key = self.entries[start].0;
            let count = self.entries[start..].iter().take_while(|e| e.0 == key).count();
            for i in start..start + count {
                for j in i + 1..start + count {
                    self.meet_pair(model, m, key, self.entries[i].1, self.entries[j].1);
                }
            }
            start += count;
        }
        // Buckets are in the order of a hash; contacts are in the order of the thread.
        self.list.sort_unstable_by_key(|c| (c.a, if let Other::Particle(b) = c.b { b } else { u32::MAX }));
    }

    fn meet_pair(&mut self, model: &Model, m: &Motion<'_>, key: u32, a: u32, b: u32) {
        let (i, j) = (a as usize, b as usize);
        let (p, q) = (&self.swept[i], &self.swept[j]);
        if i == j || !(p.lo.cmple(q.hi).all() && q.lo.cmple(p.hi).all()) {
            return;
        }
        // Two boxes may share several cells: the first of these decides.
        let shared: [i64; 3] = core::array::from_fn(|k| p.cell[k].max(q.cell[k]));
        if hash(shared) != key {
            return;
        }
        let sum = m.radius[i] + m.radius[j];
        // Neighbors along the thread, to half a turn of its own radius.
        if model.rod_of[i] == model.rod_of[j] && (self.arc[j] - self.arc[i]).abs() < core::f64::consts::FRAC_PI_2 * sum
        {
            return;
        }
        let (r, d) = (m.from[i] - m.from[j], (m.to[i] - m.from[i]) - (m.to[j] - m.from[j]));
        let Some(t) = time_of_impact(r, d, sum) else { return };
        self.push(a, Other::Particle(b), (r + d * t).normalize_or_zero(), sum, [m.inverse_mass[i], m.inverse_mass[j]]);
    }

    fn meet_shapes(&mut self, model: &Model, state: &State, m: &Motion<'_>) {
        for (slot, shape) in model.shapes.iter() {
            let (from, to) = (m.shapes_from[slot as usize], state.shape_pose[slot as usize]);
            let (lo, hi) = shape.collider.bounds(&from);
            let (lo2, hi2) = shape.collider.bounds(&to);
            let (lo, hi) = (lo.min(lo2), hi.max(hi2));
            for i in 0..m.from.len() {
                let s = &self.swept[i];
                if !(s.lo.cmple(hi).all() && lo.cmple(s.hi).all()) {
                    continue;
                }
                let way = [from.inverse_transform_point(m.from[i]), to.inverse_transform_point(m.to[i])];
                if let Some((point, normal)) = meet_shape(&shape.collider, way, m.radius[i]) {
                    self.push(
                        i as u32,
                        Other::Point(to.transform_point(point)),
                        to.orientation * normal,
                        m.radius[i],
                        [m.inverse_mass[i], 0.0],
                    );
                }
            }
        }
    }

    fn push(&mut self, a: u32, b: Other, normal: DVec3, distance: f64, w: [f64; 2]) {
        let sum = w[0] + w[1];
        if sum > 0.0 && normal != DVec3::ZERO {
            self.list.push(Contact { a, b, normal, distance, share: w.map(|w| w / sum), pushed: false });
        }
    }

    /// One projection of all contacts, then of all friction.
    pub fn project(&mut self, x: &mut [DVec3], k: f64) {
        for c in &mut self.list {
            let gap = c.between(x).dot(c.normal) - c.distance;
            if gap < 0.0 {
                c.pushed = true;
                c.shift(x, c.normal * -gap);
            }
        }
        if k == 0.0 {
            return;
        }
        for c in self.list.iter().filter(|c| c.pushed) {
            if let Some((value, gradient)) = friction(c.between(x), c.normal) {
                c.shift(x, gradient * (-k * value / gradient.length_squared()));
            }
        }
    }
}

impl Contact {
    fn between(&self, x: &[DVec3]) -> DVec3 {
        let b = match self.b {
            Other::Particle(b) => x[b as usize],
            Other::Point(b) => b,
        };
        x[self.a as usize] - b
    }
    /// Changes the difference of places by `d`, momentum kept.
    fn shift(&self, x: &mut [DVec3], d: DVec3) {
        x[self.a as usize] += d * self.share[0];
        if let Other::Particle(b) = self.b {
            x[b as usize] -= d * self.share[1];
        }
    }
}

/// Where a sphere meets a shape on its way, both in the frame of the shape: the point of the surface and the normal. By
/// steps that the distance allows.
fn meet_shape(shape: &Collider, [from, to]: [DVec3; 2], radius: f64) -> Option<(DVec3, DVec3)> {
    let way = (to - from).length();
    let mut t = 0.0;
    for _ in 0..STEPS {
        let at = from.lerp(to, t);
        let d = shape.distance_local(at);
        let gap = d.value - radius;
        if gap <= NEAR * radius {
            return Some((at - d.normal * d.value, d.normal));
        }
        t += gap / way;
        if t.is_nan() || t > 1.0 {
            return None;
        }
    }
    // It passes by closely: the last place will do.
    let at = from.lerp(to, t);
    let d = shape.distance_local(at);
    Some((at - d.normal * d.value, d.normal))
}

/// Hash of a cell (Teschner et al. 2003, with other odd numbers).
fn hash(cell: [i64; 3]) -> u32 {
    let [x, y, z] = cell.map(|c| c as u64);
    let h = x.wrapping_mul(0x9e37_79b9_7f4a_7c15)
        ^ y.wrapping_mul(0xc2b2_ae3d_27d4_eb4f)
        ^ z.wrapping_mul(0x1656_67b1_9e37_79f9);
    (h >> 32) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn impact_is_that_of_the_closed_form() {
        // Head on: a gap of 3 closes at 5 a step. Off center by 0.6 of the sum: a 3-4-5 triangle.
        assert_eq!(time_of_impact(DVec3::X * 4.0, DVec3::X * -5.0, 1.0), Some(0.6));
        let t = time_of_impact(DVec3::new(4.0, 0.6, 0.0), DVec3::X * -5.0, 1.0).unwrap();
        assert!((t - (4.0 - 0.8) / 5.0).abs() < 1e-15, "{t}");
        assert_eq!(time_of_impact(DVec3::new(4.0, 1.1, 0.0), DVec3::X * -5.0, 1.0), None);
        assert_eq!(time_of_impact(DVec3::X * 4.0, DVec3::X * -2.9, 1.0), None);
        assert_eq!(time_of_impact(DVec3::X * 4.0, DVec3::X * 5.0, 1.0), None);
        assert_eq!(time_of_impact(DVec3::X * 0.5, DVec3::X * 5.0, 1.0), Some(0.0));
        // A hundred diameters a step, from a thousandth away: no cancellation.
        let t = time_of_impact(DVec3::X * 1.001, DVec3::X * -200.0, 1.0).unwrap();
        assert!((t / (0.001 / 200.0) - 1.0).abs() < 1e-12, "{t:e}");
    }

    #[test]
    fn the_gradient_of_friction_is_that_of_finite_differences() {
        let n = DVec3::new(0.48, 0.6, 0.64);
        let r = DVec3::new(0.6, 0.5, 0.9);
        let (_, gradient) = friction(r, n).unwrap();
        // As the appendix prints it, without k.
        let u = r.normalize();
        let cross = u.cross(n);
        let du = (glam::DMat3::IDENTITY * r.length_squared() - crate::math::outer(r, r)) * (1.0 / r.length().powi(3));
        let printed = (crate::math::skew(-n) * du).transpose() * (cross / cross.length());
        let h = 1e-6;
        for axis in DVec3::AXES {
            let value = |s: f64| friction(r + axis * s, n).unwrap().0;
            let slope = (value(h) - value(-h)) / (2.0 * h);
            assert!(
                (slope - gradient.dot(axis)).abs() < 1e-9 && (printed - gradient).dot(axis).abs() < 1e-14,
                "{slope} {gradient} {printed}"
            );
        }
        assert!(friction(n * 3.0, n).is_none_or(|(c, _)| c < 1e-15), "nothing to undo");
    }

    /// A sphere pushed into another one and sideways.
    #[test]
    fn full_friction_stops_motion_across_the_normal() {
        let slide = |k: f64, iterations: u32| {
            let mut contacts = Contacts::default();
            contacts.push(0, Other::Particle(1), DVec3::Z, 1.0, [1.0, 2.0]);
            let mut x = [DVec3::new(0.3, 0.0, 0.9), DVec3::ZERO];
            for _ in 0..iterations {
                contacts.project(&mut x, k);
            }
            let momentum = x[0] + x[1] * 0.5;
            assert!((momentum - DVec3::new(0.3, 0.0, 0.9)).length() < 1e-15);
            assert!((x[0] - x[1]).z >= 1.0 - 1e-12);
            (x[0] - x[1]).x
        };
        assert!(slide(1.0, 5).abs() < 1e-12, "{:e}", slide(1.0, 5));
        assert_eq!(slide(0.0, 5), 0.3);
        // k scales the correction: about (1 - k)^n is left.
        let [half, quarter] = [slide(0.5, 1), slide(0.25, 1)];
        assert!((half / 0.3 - 0.5).abs() < 0.05 && (quarter / 0.3 - 0.75).abs() < 0.05, "{half} {quarter}");
    }

    /// The hash finds the pairs that trying all of them finds.
    #[test]
    fn no_pair_is_missed() {
        let at = |i: usize, k: f64| {
            let s = i as f64 * 0.61 + k;
            DVec3::new((3.1 * s).sin(), (2.3 * s).cos(), (1.7 * s).sin())
        };
        let n = 150;
        let from: Vec<DVec3> = (0..n).map(|i| at(i, 0.0)).collect();
        let to: Vec<DVec3> = (0..n).map(|i| at(i, 0.05 + 0.001 * i as f64)).collect();
        let (radius, w) = (vec![0.06; n], vec![1.0; n]);
        // Every particle a thread of its own, so that none are neighbors.
        let model = Model { rod_of: (0..n as u32).collect(), mass: vec![1.0; n], ..Model::default() };
        let state = State { rest_length: vec![0.0; n], ..State::default() };
        let mut contacts = Contacts::default();
        contacts.detect(
            &model,
            &state,
            &Motion { from: &from, to: &to, radius: &radius, inverse_mass: &w, shapes_from: &[] },
        );
        let found: Vec<(usize, usize)> = contacts
            .list
            .iter()
            .map(|c| (c.a as usize, if let Other::Particle(b) = c.b { b as usize } else { panic!("no shapes") }))
            .collect();
        let mut wanted = Vec::new();
        for i in 0..n {
            for j in i + 1..n {
                if time_of_impact(from[i] - from[j], (to[i] - from[i]) - (to[j] - from[j]), 0.12).is_some() {
                    wanted.push((i, j));
                }
            }
        }
        assert!(wanted.len() > 20, "{}", wanted.len());
        assert_eq!(found, wanted);
    }
}
