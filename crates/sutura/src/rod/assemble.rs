//! The Newton matrix and right side of the rods.

use crate::lanes::{Quat2, Sym2, Vec2, join, lanes};
use crate::model::Model;
use crate::motion::Motion;
use crate::rod::constraint::ClampJoint;
use crate::rod::scratch::RodScratch;
use crate::rod::strain;
use crate::state::State;
use core::ops::Range;
use glam::{DMat3, DQuat, DVec3};
use wide::f64x2;

/// Which second derivatives of the elastic energy go into the matrix. The residual is exact in either case.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Hessian {
    /// With those of the geometry, of either sign: Newton converges in few iterations, also near buckling.
    Exact,
    /// Without those that can make it indefinite.
    Positive,
}

/// Residual and Hessian of inertia, elasticity and loads at the iterate.
pub(crate) fn assemble(model: &Model, state: &State, motion: &Motion, rods: &mut RodScratch, h: f64, hessian: Hessian) {
    for r in 0..rods.ranges.len() {
        let rod = rods.ranges[r].0.clone();
        if is_flat(model, rod.start) {
            assemble_rod::<true>(model, state, motion, rods, (h, hessian), rod);
        } else {
            assemble_rod::<false>(model, state, motion, rods, (h, hessian), rod);
        }
    }
    assemble_clamps(state, rods);
}

/// Whether the rod that begins with particle `first` is stiffer one way than the other.
fn is_flat(model: &Model, first: usize) -> bool {
    model.rods.at(model.rod_of[first]).is_some_and(|rod| rod.flat)
}

fn assemble_rod<const FLAT: bool>(
    model: &Model,
    state: &State,
    motion: &Motion,
    rods: &mut RodScratch,
    (h, hessian): (f64, Hessian),
    rod: Range<usize>,
) {
    let last = rod.end - 1;
    let half = (last - rod.start) / 2;
    let middle = rod.start + half;
    let at = At::<FLAT> {
        model,
        state,
        motion,
        inv_h2: 1.0 / (h * h),
        inv_h: 1.0 / h,
        exact: hessian == Hessian::Exact,
        keeps_length: model.inextensible[rod.start],
        welds: model.welds.iter().next().is_some(),
        given: false,
        last,
    };
    // The first half in the low lane, the second in the high one.
    let mut carry = Carry::none();
    if half > 0 {
        carry = at.carry(rods, middle - 1).scaled(lanes(0.0, 1.0));
    }
    for i in 0..half {
        carry = at.block(rods, rod.start + i, middle + i, &carry);
    }
    carry = carry.high();
    if middle + half < last {
        carry = at.block(rods, last - 1, last - 1, &carry);
    }
    at.last_block(rods, &carry);
}

/// The residual and the Hessian without the clamps of the blocks `held` of a rod, with the tensions that are in
/// `rods`.
pub(crate) fn assemble_blocks(
    model: &Model,
    state: &State,
    motion: &Motion,
    rods: &mut RodScratch,
    (h, rod, held): (f64, &Range<usize>, Range<usize>),
) {
    let last = rod.end - 1;
    let at = At::<true> {
        model,
        state,
        motion,
        inv_h2: 1.0 / (h * h),
        inv_h: 1.0 / h,
        exact: false,
        keeps_length: model.inextensible[rod.start],
        welds: model.welds.iter().next().is_some(),
        given: true,
        last,
    };
    let mut carry = if held.start > rod.start { at.carry(rods, held.start - 1) } else { Carry::none() };
    for e in held {
        if e == last {
            at.last_block(rods, &carry);
        } else {
            carry = at.block(rods, e, e, &carry);
        }
    }
}

/// Adds the moments of the clamps.
pub(crate) fn assemble_clamps(state: &State, rods: &mut RodScratch) {
    for c in &rods.clamps {
        let node = 2 * c.frame as usize + 1;
        let (moment, b) = clamp_terms(c, state.orientation[c.frame as usize]);
        rods.rhs[node] += if c.first { -moment } else { moment };
        rods.system.diagonal[node] += b;
    }
}

/// What the element and the joint before a block add to it: force on the element's first particle and moment on the
/// joint's first frame, with their second derivatives.
struct Carry {
    force: Vec2,
    kx: Sym2,
    moment: Vec2,
    kt: Sym2,
}

impl Carry {
    fn none() -> Self {
        let zero = Vec2::load(DVec3::ZERO, DVec3::ZERO);
        Carry { force: zero, kx: Sym2::scalar(lanes(0.0, 0.0)), moment: zero, kt: Sym2::scalar(lanes(0.0, 0.0)) }
    }
    fn scaled(&self, k: f64x2) -> Self {
        Carry {
            force: self.force.scaled(k),
            kx: self.kx.scaled(k),
            moment: self.moment.scaled(k),
            kt: self.kt.scaled(k),
        }
    }
    /// The high lane in both.
    fn high(&self) -> Self {
        let v = |v: &Vec2| Vec2::load(v.split().1, v.split().1);
        let d = |x: f64x2| f64x2::splat(x.to_array()[1]);
        let m = |m: &Sym2| Sym2 { xx: d(m.xx), yy: d(m.yy), zz: d(m.zz), xy: d(m.xy), xz: d(m.xz), yz: d(m.yz) };
        Carry { force: v(&self.force), kx: m(&self.kx), moment: v(&self.moment), kt: m(&self.kt) }
    }
}

/// What an element does to the particles at its ends and to its frame.
struct Element {
    /// Third director.
    axis: Vec2,
    /// Force on the first particle, minus that on the second.
    force: Vec2,
    /// Torque on the frame.
    torque: Vec2,
    /// Second derivatives: of the particles; of the first particle and the frame, with a minus; of the frame.
    kx: Sym2,
    kd: [Vec2; 3],
    kt: Sym2,
    /// The line between its ends, and the compliance along it where the tension is an unknown, else 0.
    line: Vec2,
    give: f64x2,
    /// What its tension over its stiffness is beyond its elongation.
    off: f64x2,
}

/// Where it is assembled. `FLAT`: joints may be stiffer one way than the other.
struct At<'a, const FLAT: bool> {
    model: &'a Model,
    state: &'a State,
    motion: &'a Motion,
    inv_h2: f64,
    inv_h: f64,
    exact: bool,
    /// Whether the rod is inextensible.
    keeps_length: bool,
    /// Whether there are welds.
    welds: bool,
    /// Whether the axial force is the tension that is given instead of that of the strain.
    given: bool,
    /// Last particle of the rod.
    last: usize,
}

impl<const FLAT: bool> At<'_, FLAT> {
    /// Writes the rows of two blocks, neither of them the last of the rod.
    #[inline(always)]
    fn block(&self, rods: &mut RodScratch, low: usize, high: usize, before: &Carry) -> Carry {
        // The angle of the joint takes long, in which the element can be worked out.
        let turns = self.turns(low + 1, high + 1);
        let own = self.element(rods, low, high);
        let joints = strain::joints(&turns);
        let (inertial, inertia) = self.spin(low, high, &own.axis);
        let (moment, kt) = self.joint(rods, &joints, low + 1, high + 1);
        let (model, state) = (self.model, self.state);
        let w = lanes(model.mass[low], model.mass[high]) * f64x2::splat(self.inv_h2 * self.motion.heavier[0]);
        let off = Vec2::load(self.motion.target[low], self.motion.target[high])
            .less(&Vec2::load(state.position[low], state.position[high]));
        let push = Vec2::load(self.motion.force[low], self.motion.force[high])
            .plus(&off, w)
            .less(&before.force)
            .add(&own.force);
        let torque = Vec2::load(self.motion.torque[low], self.motion.torque[high])
            .add(&inertial)
            .add(&own.torque)
            .add(&moment.less(&before.moment));
        let none = Vec2::load(DVec3::ZERO, DVec3::ZERO);
        let half = if self.exact { moment.scaled(f64x2::splat(0.5)) } else { none };
        (rods.moment[low + 1], rods.moment[high + 1]) = moment.split();
        let (x, t) = ((2 * low, 2 * high), (2 * low + 1, 2 * high + 1));
        (rods.rhs[x.0], rods.rhs[x.1]) = push.split();
        (rods.rhs[t.0], rods.rhs[t.1]) = torque.split();
        let system = &mut rods.system;
        (system.diagonal[x.0], system.diagonal[x.1]) = before.kx.add(&own.kx).add(&Sym2::scalar(w)).split();
        let (a, b) = join(own.kd);
        (system.next[x.0], system.next[x.1]) = (-a, -b);
        (system.next[t.0], system.next[t.1]) = (a.transpose(), b.transpose());
        (system.after[x.0], system.after[x.1]) = own.kx.skew_less(&none);
        if self.keeps_length {
            let (line, give) = (own.line.split(), own.give.to_array());
            let tie = |line: DVec3, give: f64| if give > 0.0 { ([-line, line], give) } else { ([DVec3::ZERO; 2], 1.0) };
            (system.ties[low], system.ties[high]) = (tie(line.0, give[0]), tie(line.1, give[1]));
            [system.right[low], system.right[high]] = own.off.to_array();
        }
        (system.tied[low], system.tied[high]) = (self.keeps_length, self.keeps_length);
        (system.diagonal[t.0], system.diagonal[t.1]) = inertia.add(&own.kt).add(&before.kt).add(&kt).split();
        // Rotations do not commute: relative to the joint, exp(-phi0) exp(phi1) turns by phi1 - phi0 - phi0 x phi1 / 2.
        (system.after[t.0], system.after[t.1]) = kt.skew_less(&half);
        Carry { force: own.force, kx: own.kx, moment, kt }
    }

    /// Writes the rows of the last block, which has no element of its own.
    fn last_block(&self, rods: &mut RodScratch, before: &Carry) {
        let e = self.last;
        let w = self.model.mass[e] * (self.inv_h2 * self.motion.heavier[0]);
        let system = &mut rods.system;
        system.diagonal[2 * e] = before.kx.add(&Sym2::scalar(f64x2::splat(w))).split().1;
        system.diagonal[2 * e + 1] = DMat3::IDENTITY;
        (system.ties[e], system.right[e]) = (([DVec3::ZERO; 2], 1.0), 0.0);
        system.tied[e] = self.keeps_length;
        for node in [2 * e, 2 * e + 1] {
            system.next[node] = DMat3::ZERO;
            system.after[node] = DMat3::ZERO;
        }
        rods.rhs[2 * e] =
            (self.motion.target[e] - self.state.position[e]) * w + self.motion.force[e] - before.force.split().1;
        rods.rhs[2 * e + 1] = DVec3::ZERO;
    }

    /// What element `e` hands on to the block after it.
    fn carry(&self, rods: &RodScratch, e: usize) -> Carry {
        let own = self.element(rods, e, e);
        let (moment, kt) = self.joint(rods, &strain::joints(&self.turns(e + 1, e + 1)), e + 1, e + 1);
        Carry { force: own.force, kx: own.kx, moment, kt }
    }

    #[inline(always)]
    fn element(&self, rods: &RodScratch, low: usize, high: usize) -> Element {
        let (model, state) = (self.model, self.state);
        let [r1, r2, t] = Quat2::load(state.orientation[low], state.orientation[high]).axes();
        let x = &state.position;
        let d = Vec2::load(x[low + 1], x[high + 1]).less(&Vec2::load(x[low], x[high]));
        let l = lanes(model.rest_length[low], model.rest_length[high]);
        // Shear stiffness is the same in both directions: R K R^T = a I + b t t^T.
        let (k0, k1) = (model.stretch_stiffness[low], model.stretch_stiffness[high]);
        let a = lanes(k0.x, k1.x);
        let (t0, t1) = (rods.tension[low], rods.tension[high]);
        let ((c0, p0), (c1, p1)) = (rods.axial(model, low), rods.axial(model, high));
        let c = lanes(c0, c1);
        let along = t.dot(&d);
        // The length of an inextensible element is that between its ends, which shear does not change.
        let (line, stretched, b) = if self.keeps_length {
            let length = d.dot(&d).sqrt();
            (d.scaled(f64x2::splat(1.0) / length), length, -a)
        } else {
            (t, along, c - a)
        };
        let tension = lanes(t0, t1);
        // The elements at a weld have their stiffness in the matrix.
        let is_tied = |e: usize| if !self.welds || model.is_tied(e) { 1.0 } else { 0.0 };
        let tied = if self.keeps_length { lanes(is_tied(low), is_tied(high)) } else { f64x2::ZERO };
        let of_strain = c * (stretched - l) + lanes(p0, p1);
        let pull = if self.given { tension } else { of_strain + tied * (tension - of_strain) };
        let force = d.plus(&t, -along).scaled(a).plus(&line, pull);
        // Geometric stiffness. On motions that keep the element's length and shear, u = phi x d, the second derivative
        // is f.d phi^2 - (phi.f)(phi.d): the tension acts on positions, the shear force couples twist with rotation
        // across.
        let g = if self.exact { lanes(t0, t1) } else { lanes(t0.max(0.0), t1.max(0.0)) } / l;
        // With n = t x d: R K R^T [d]x = a [d]x + b t n^T, and [d]x^T R K R^T [d]x = a (d^2 I - d d^T) + b n n^T.
        let n = t.cross(&d);
        let (bn, ad) = (n.scaled(b), d.scaled(a));
        let kd = [
            Vec2 { x: t.x * bn.x, y: t.y * bn.x + ad.z, z: t.z * bn.x - ad.y },
            Vec2 { x: t.x * bn.y - ad.z, y: t.y * bn.y, z: t.z * bn.y + ad.x },
            Vec2 { x: t.x * bn.z + ad.y, y: t.y * bn.z - ad.x, z: t.z * bn.z },
        ];
        let mut kt = Sym2::scalar(a * d.dot(&d)).square(&d, -a).square(&n, b);
        if self.exact {
            let (s0, s1) = (rods.shear[low], rods.shear[high]);
            let half = l * f64x2::splat(0.5);
            let shear = r1.scaled(lanes(s0.x, s1.x) * half).plus(&r2, lanes(s0.y, s1.y) * half);
            kt = kt.less_product(&shear, &t);
        }
        let (kx, give) = if self.keeps_length {
            let one = f64x2::splat(1.0);
            (Sym2::scalar(a + g).square(&t, b).square(&line, c * (one - tied) - g), tied / c)
        } else {
            (Sym2::scalar(a + g).square(&t, b - g), f64x2::ZERO)
        };
        let off = if self.keeps_length { (tension - of_strain) / c } else { f64x2::ZERO };
        Element { axis: t, force, torque: d.cross(&force), kx, kd, kt, line, give, off }
    }

    /// Inertial torque on frames with third directors `t`, and spin inertia in world axes over h^2. The change of the
    /// latter with the frame (gyroscopic moment) is of the order (radius / length)^2 for a thread and is left out.
    #[inline(always)]
    fn spin(&self, low: usize, high: usize, t: &Vec2) -> (Vec2, Sym2) {
        let q = &self.state.orientation;
        let inv_h2 = self.inv_h2 * self.motion.heavier[1];
        let (i0, i1) = (self.model.inertia[low] * inv_h2, self.model.inertia[high] * inv_h2);
        let (x, z) = (lanes(i0.x, i1.x), lanes(i0.z, i1.z) - lanes(i0.x, i1.x));
        let turn = Quat2::load(self.motion.target_frame[low], self.motion.target_frame[high])
            .times(&Quat2::load(q[low], q[high]).conjugate());
        let off = turn.log();
        let mut torque = off.scaled(x).plus(t, z * t.dot(&off));
        let mut inertia = Sym2::scalar(x).square(t, z);
        // Only flat sections and what is attached have different moments across.
        if i0.x != i0.y || i1.x != i1.y {
            let y = Vec2::load(q[low] * DVec3::Y, q[high] * DVec3::Y);
            let more = lanes(i0.y, i1.y) - x;
            torque = torque.plus(&y, more * y.dot(&off));
            inertia = inertia.square(&y, more);
        }
        (torque, inertia)
    }

    /// Turns of the joints before two elements.
    #[inline(always)]
    fn turns(&self, low: usize, high: usize) -> strain::Turns {
        let (q, half) = (&self.state.orientation, &self.model.rest_half);
        strain::turns([q[low - 1], q[high - 1]], [q[low], q[high]], [half[low], half[high]])
    }

    /// Moments that the joints before two elements exert on the frames before them, and the stiffness against relative
    /// rotation; none where there is no joint.
    #[inline(always)]
    fn joint(&self, rods: &RodScratch, j: &strain::Joints, low: usize, high: usize) -> (Vec2, Sym2) {
        let (model, state) = (self.model, self.state);
        let on = |e: usize| if e < self.last && rods.joint_on[e] { 1.0 } else { 0.0 };
        let (k0, k1) = (model.bend_stiffness[low] * on(low), model.bend_stiffness[high] * on(high));
        let gamma = lanes(model.bend_damping[low], model.bend_damping[high]) * f64x2::splat(self.inv_h);
        let plastic = Vec2::load(state.plastic[low], state.plastic[high]);
        joint_terms::<FLAT>(
            j,
            &plastic,
            &Vec2::load(self.motion.start_angle[low], self.motion.start_angle[high]),
            &Vec2::load(k0, k1),
            gamma,
        )
    }
}

/// Moments in world axes that joints exert on their first frames, and the stiffness against relative rotation.
#[inline(always)]
fn joint_terms<const FLAT: bool>(
    j: &strain::Joints,
    plastic: &Vec2,
    start: &Vec2,
    stiffness: &Vec2,
    gamma: f64x2,
) -> (Vec2, Sym2) {
    let one = f64x2::splat(1.0);
    let moment = j.angle.less(plastic).plus(&j.angle.less(start), gamma).times(stiffness);
    let (bend, twist) = (stiffness.x * (one + gamma), stiffness.z * (one + gamma));
    // With the derivative M R^T, M = s I - c theta theta^T: M M = s^2 I - (2 s c - c^2 theta^2) theta theta^T.
    let c = j.c;
    let cc = c * j.squared;
    let s = one + cc;
    let [m1, m2, m3] = &j.middle;
    let w = m1.scaled(j.angle.x).plus(m2, j.angle.y).plus(m3, j.angle.z);
    let axis = m3.scaled(s).plus(&w, -(c * j.angle.z));
    let mut b = Sym2::scalar(bend * s * s).square(&w, bend * c * (cc - (s + s))).square(&axis, twist - bend);
    let flat = stiffness.y - stiffness.x;
    if FLAT && flat != f64x2::ZERO {
        b = b.square(&m2.scaled(s).plus(&w, -(c * j.angle.y)), flat * (one + gamma));
    }
    let turned = m1.scaled(moment.x).plus(m2, moment.y).plus(m3, moment.z);
    (turned.scaled(s).plus(&w, -(c * j.angle.dot(&moment))), b)
}

/// The same for a clamp. The moment is that on the first of the two.
pub(crate) fn clamp_terms(c: &ClampJoint, q: DQuat) -> (DVec3, DMat3) {
    let (q0, q1) = if c.first { (c.orientation, q) } else { (q, c.orientation) };
    let j = strain::joints(&strain::turns([q0; 2], [q1; 2], [c.rest_half; 2]));
    let twice = |v: DVec3| Vec2::load(v, v);
    let (moment, b) =
        joint_terms::<true>(&j, &twice(DVec3::ZERO), &twice(c.start), &twice(c.stiffness), f64x2::splat(c.damping));
    (moment.split().0, b.split().0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::exp;
    use crate::rod::element_strain;
    use crate::{Material, RodSpec, Section, Stretch, World};

    /// Numbers in [-0.5, 0.5) from a seed.
    fn noise(seed: &mut u64) -> f64 {
        *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    }

    fn vector(seed: &mut u64) -> DVec3 {
        DVec3::new(noise(seed), noise(seed), noise(seed))
    }

    #[test]
    fn the_exact_hessian_is_the_derivative_of_the_residual() {
        for section in [Section::Round, Section::Rectangle([2e-3, 5e-3])] {
            for stretch in [Stretch::Elastic, Stretch::Inextensible] {
                compare_derivatives(section, stretch);
            }
        }
    }

    fn compare_derivatives(section: Section, stretch: Stretch) {
        // A bent, twisted, stretched rod with soft section, so that every term matters.
        let mut seed = 7;
        let n = 5;
        let mut world = World::default();
        let spec = RodSpec {
            section,
            stretch,
            ..RodSpec::straight(DVec3::ZERO, DVec3::X * 0.05, n, 2e-3, Material::elastic(1e6, 1000.0))
        };
        world.insert_rod(&spec).unwrap();
        let (model, mut state) = world.into_parts();
        for i in 0..=n {
            state.position[i] += vector(&mut seed) * DVec3::new(0.0, 5e-4, 5e-4) + DVec3::X * (2e-5 * i as f64);
        }
        let mut frame = state.orientation[0];
        for e in 0..n {
            let t = (state.position[e + 1] - state.position[e]).normalize();
            frame = crate::math::rotation_arc(frame * DVec3::Z, t) * frame;
            state.orientation[e] = exp(vector(&mut seed) * 3e-3) * frame * exp(DVec3::Z * 0.02 * e as f64);
        }
        let (mut motion, mut rods) = (Motion::default(), RodScratch::default());
        motion.fit(&model);
        rods.fit(&model);
        let h = 10.0; // inertia out of the way
        let mut gradient = |state: &State, rods: &mut RodScratch| {
            motion.target.copy_from_slice(&state.position);
            motion.target_frame.copy_from_slice(&state.orientation);
            for e in 0..n {
                let f = element_strain(&model, state, e) * model.stretch_stiffness[e];
                (rods.tension[e], rods.shear[e]) = (f.z, f.truncate());
            }
            assemble(&model, state, &motion, rods, h, Hessian::Exact);
            rods.rhs.iter().map(|v| -*v).collect::<Vec<_>>()
        };
        let moved = |v: &[DVec3], eps: f64| {
            let mut s = State::default();
            s.copy_from(&state);
            for i in 0..=n {
                s.position[i] += v[2 * i] * eps;
                s.orientation[i] = exp(v[2 * i + 1] * eps) * s.orientation[i];
            }
            s
        };
        let product = |rods: &RodScratch, v: &[DVec3], w: &[DVec3]| {
            let s = &rods.system;
            let nodes = 2 * (n + 1);
            (0..nodes)
                .map(|k| {
                    let mut sum = v[k].dot(s.diagonal[k] * w[k]);
                    if k + 1 < nodes {
                        sum += v[k].dot(s.next[k] * w[k + 1]) + w[k].dot(s.next[k] * v[k + 1]);
                    }
                    if k + 2 < nodes {
                        sum += v[k].dot(s.after[k] * w[k + 2]) + w[k].dot(s.after[k] * v[k + 2]);
                    }
                    sum
                })
                .sum::<f64>()
        };
        for _ in 0..20 {
            // Motions that keep length and shear to first order are those for which the tension term is exact.
            let mut v: Vec<DVec3> = vec![DVec3::ZERO; 2 * (n + 1)];
            for e in 0..n {
                v[2 * e + 1] = vector(&mut seed);
                let d = state.position[e + 1] - state.position[e];
                v[2 * e + 2] = v[2 * e] + v[2 * e + 1].cross(d);
            }
            v[2 * n + 1] = DVec3::ZERO;
            gradient(&state, &mut rods);
            let want = product(&rods, &v, &v);
            let e = 1e-5;
            let up = gradient(&moved(&v, e), &mut rods);
            let down = gradient(&moved(&v, -e), &mut rods);
            // The frame of the last, unused node does not count.
            let got: f64 = (0..2 * n + 1).map(|k| (up[k] - down[k]).dot(v[k]) / (2.0 * e)).sum();
            // Left out: second derivatives of the joint's own angle, of the order angle^2 / 6, with angles of 0.1 here.
            assert!((got / want - 1.0).abs() < 3e-3, "{got:e} {want:e}");
        }
    }
}
