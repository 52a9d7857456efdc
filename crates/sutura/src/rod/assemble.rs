//! The Newton matrix and right side of the rods.

use crate::math::log;
use crate::model::Model;
use crate::rod::strain;
use crate::scratch::{ClampJoint, Scratch};
use crate::state::State;
use core::ops::Range;
use glam::{DMat3, DQuat, DVec3};

/// Which second derivatives of the elastic energy go into the matrix. The residual is exact in either case.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Hessian {
    /// With those of the geometry, of either sign: Newton converges in few iterations, also near buckling.
    Exact,
    /// Without those that can make it indefinite.
    Positive,
}

/// Residual and Hessian of inertia, elasticity and loads at the iterate.
pub(crate) fn assemble(model: &Model, state: &State, scratch: &mut Scratch, h: f64, hessian: Hessian) {
    for r in 0..scratch.rods.len() {
        let rod = scratch.rods[r].0.clone();
        assemble_blocks(model, state, scratch, h, hessian, &rod, rod.clone());
    }
    assemble_clamps(state, scratch, h);
}

/// Rows of the particles and frames `blocks` of a rod, each written once.
pub(crate) fn assemble_blocks(model: &Model, state: &State, scratch: &mut Scratch, h: f64, hessian: Hessian, rod: &Range<usize>, blocks: Range<usize>) {
    let exact = hessian == Hessian::Exact;
    let inv_h2 = 1.0 / (h * h);
    let last = rod.end - 1;
    // What the element and the joint before block e add to it.
    let (mut force, mut kx) = (DVec3::ZERO, Sym::ZERO);
    let (mut moment, mut kt) = (DVec3::ZERO, Sym::ZERO);
    if blocks.start > rod.start {
        let before = element(model, state, scratch, blocks.start - 1, exact);
        (force, kx) = (before.force, before.kx);
        if blocks.start < last && scratch.joint_on[blocks.start] {
            (moment, kt) = joint_before(model, state, scratch, blocks.start, h);
        }
    }
    for e in blocks {
        let w = model.mass[e] * inv_h2;
        let particle = Sym::scalar(w).plus(&kx);
        let push = (scratch.target[e] - state.position[e]) * w + scratch.force[e] - force;
        let system = &mut scratch.system;
        if e == last {
            system.diagonal[2 * e] = particle.matrix();
            system.diagonal[2 * e + 1] = DMat3::IDENTITY;
            for node in [2 * e, 2 * e + 1] {
                system.next[node] = DMat3::ZERO;
                system.after[node] = DMat3::ZERO;
            }
            scratch.rhs[2 * e] = push;
            scratch.rhs[2 * e + 1] = DVec3::ZERO;
            break;
        }
        let own = element(model, state, scratch, e, exact);
        let spin = spin(model, state, scratch, e, inv_h2, own.axis);
        let (next_moment, next_kt) =
            if e + 1 < last && scratch.joint_on[e + 1] { joint_before(model, state, scratch, e + 1, h) } else { (DVec3::ZERO, Sym::ZERO) };
        let system = &mut scratch.system;
        system.diagonal[2 * e] = particle.plus(&own.kx).matrix();
        system.next[2 * e] = -own.kd;
        system.after[2 * e] = -own.kx.matrix();
        system.diagonal[2 * e + 1] = spin.1.plus(&own.kt).plus(&kt).plus(&next_kt).matrix();
        system.next[2 * e + 1] = own.kd.transpose();
        // Rotations do not commute: relative to the joint, exp(-phi0) exp(phi1) turns by phi1 - phi0 - phi0 x phi1 / 2.
        system.after[2 * e + 1] = next_kt.negated_with_skew(if exact { next_moment * 0.5 } else { DVec3::ZERO });
        scratch.moment[e + 1] = next_moment;
        scratch.rhs[2 * e] = push + own.force;
        scratch.rhs[2 * e + 1] = spin.0 + scratch.torque[e] + own.torque + (next_moment - moment);
        (force, kx) = (own.force, own.kx);
        (moment, kt) = (next_moment, next_kt);
    }
}

/// Adds the moments of the clamps.
pub(crate) fn assemble_clamps(state: &State, scratch: &mut Scratch, h: f64) {
    for c in &scratch.clamps {
        let node = 2 * c.frame as usize + 1;
        let (moment, b) = clamp_terms(c, state.orientation[c.frame as usize], h);
        scratch.rhs[node] += if c.first { -moment } else { moment };
        scratch.system.diagonal[node] += b;
    }
}

/// What an element does to the particles at its ends and to its frame.
struct Element {
    /// Third director.
    axis: DVec3,
    /// Force on the first particle, minus that on the second.
    force: DVec3,
    /// Torque on the frame.
    torque: DVec3,
    /// Second derivatives: of the particles; of the first particle and the frame, with a minus; of the frame.
    kx: Sym,
    kd: DMat3,
    kt: Sym,
}

#[inline(always)]
fn element(model: &Model, state: &State, scratch: &Scratch, e: usize, exact: bool) -> Element {
    let r = DMat3::from_quat(state.orientation[e]);
    let t = r.z_axis;
    let d = state.position[e + 1] - state.position[e];
    let l = model.rest_length[e];
    // Shear stiffness is the same in both directions: R K R^T = a I + b t t^T.
    let k = model.stretch_stiffness[e];
    let (a, b) = (k.x, k.z - k.x);
    let along = t.dot(d);
    let carried = scratch.tension[e];
    let multiplier = if model.inextensible[e] { carried } else { 0.0 };
    let force = (d - t * along) * a + t * (k.z * (along - l) + multiplier);
    // Geometric stiffness. On motions that keep the element's length and shear, u = phi x d, the second derivative is
    // f.d phi^2 - (phi.f)(phi.d): the tension acts on positions, the shear force couples twist with rotation across.
    let g = if exact { carried } else { carried.max(0.0) } / l;
    // With n = t x d: R K R^T [d]x = a [d]x + b t n^T, and [d]x^T R K R^T [d]x = a (d^2 I - d d^T) + b n n^T.
    let n = t.cross(d);
    let (bn, ad) = (n * b, d * a);
    let kd = DMat3::from_cols(
        DVec3::new(t.x * bn.x, t.y * bn.x + ad.z, t.z * bn.x - ad.y),
        DVec3::new(t.x * bn.y - ad.z, t.y * bn.y, t.z * bn.y + ad.x),
        DVec3::new(t.x * bn.z + ad.y, t.y * bn.z - ad.x, t.z * bn.z),
    );
    let mut kt = Sym::scalar(a * d.length_squared()).square(d, -a).square(n, b);
    if exact {
        let shear = (r.x_axis * scratch.shear[e].x + r.y_axis * scratch.shear[e].y) * (0.5 * l);
        kt = kt.less_product(shear, t);
    }
    Element { axis: t, force, torque: d.cross(force), kx: Sym::scalar(a + g).square(t, b - g), kd, kt }
}

/// Inertial torque on a frame whose third director is `t`, and spin inertia in world axes over h^2. The change of the latter with the frame
/// (gyroscopic moment) is of the order (radius / length)^2 for a thread and is left out.
#[inline(always)]
fn spin(model: &Model, state: &State, scratch: &Scratch, e: usize, inv_h2: f64, t: DVec3) -> (DVec3, Sym) {
    let q = state.orientation[e];
    let i = model.inertia[e] * inv_h2;
    let off = log(scratch.target_frame[e] * q.conjugate());
    let mut torque = off * i.x + t * ((i.z - i.x) * t.dot(off));
    let mut inertia = Sym::scalar(i.x).square(t, i.z - i.x);
    // Only what is attached has different moments across.
    if i.y != i.x {
        let y = q * DVec3::Y;
        torque += y * ((i.y - i.x) * y.dot(off));
        inertia = inertia.square(y, i.y - i.x);
    }
    (torque, inertia)
}

/// Moment that the joint before element `e` exerts on the frame before it, and the stiffness against relative rotation.
#[inline(always)]
fn joint_before(model: &Model, state: &State, scratch: &Scratch, e: usize, h: f64) -> (DVec3, Sym) {
    let j = strain::joint(state.orientation[e - 1], state.orientation[e], model.rest_half[e]);
    joint_terms(&j, state.plastic[e], scratch.start_angle[e], model.bend_stiffness[e], model.bend_damping[e], h)
}

/// Moment in world axes that the joint exerts on its first frame, and the stiffness against relative rotation. Bending stiffness is the
/// same in both directions.
#[inline(always)]
fn joint_terms(j: &strain::Joint, plastic: DVec3, start: DVec3, stiffness: DVec3, damping: f64, h: f64) -> (DVec3, Sym) {
    let gamma = damping / h;
    let moment = stiffness * ((j.angle - plastic) + (j.angle - start) * gamma);
    let (bend, twist) = (stiffness.x * (1.0 + gamma), stiffness.z * (1.0 + gamma));
    // With the derivative M R^T, M = s I - c theta theta^T: M M = s^2 I - (2 s c - c^2 theta^2) theta theta^T.
    let (s, c) = (1.0 + j.c * j.squared, j.c);
    let w = j.middle * j.angle;
    let axis = j.middle.z_axis * s - w * (c * j.angle.z);
    let b = Sym::scalar(bend * s * s).square(w, bend * c * (c * j.squared - 2.0 * s)).square(axis, twist - bend);
    (j.middle * (moment * s) - w * (c * j.angle.dot(moment)), b)
}

/// The same for a clamp. The moment is that on the first of the two.
pub(crate) fn clamp_terms(c: &ClampJoint, q: DQuat, h: f64) -> (DVec3, DMat3) {
    let j = if c.first { strain::joint(c.orientation, q, c.rest_half) } else { strain::joint(q, c.orientation, c.rest_half) };
    let (moment, b) = joint_terms(&j, DVec3::ZERO, c.start, c.stiffness, c.damping, h);
    (moment, b.matrix())
}

/// A symmetric 3x3 matrix.
#[derive(Debug, Clone, Copy)]
struct Sym {
    xx: f64,
    yy: f64,
    zz: f64,
    xy: f64,
    xz: f64,
    yz: f64,
}

impl Sym {
    const ZERO: Sym = Sym { xx: 0.0, yy: 0.0, zz: 0.0, xy: 0.0, xz: 0.0, yz: 0.0 };

    /// `s I`.
    #[inline(always)]
    fn scalar(s: f64) -> Self {
        Sym { xx: s, yy: s, zz: s, ..Sym::ZERO }
    }
    /// `self + k v v^T`.
    #[inline(always)]
    fn square(self, v: DVec3, k: f64) -> Self {
        let w = v * k;
        self.plus(&Sym { xx: v.x * w.x, yy: v.y * w.y, zz: v.z * w.z, xy: v.x * w.y, xz: v.x * w.z, yz: v.y * w.z })
    }
    /// `self - a b^T - b a^T`.
    #[inline(always)]
    fn less_product(self, a: DVec3, b: DVec3) -> Self {
        Sym {
            xx: self.xx - 2.0 * (a.x * b.x),
            yy: self.yy - 2.0 * (a.y * b.y),
            zz: self.zz - 2.0 * (a.z * b.z),
            xy: self.xy - (a.x * b.y + a.y * b.x),
            xz: self.xz - (a.x * b.z + a.z * b.x),
            yz: self.yz - (a.y * b.z + a.z * b.y),
        }
    }
    #[inline(always)]
    fn plus(self, o: &Sym) -> Self {
        Sym { xx: self.xx + o.xx, yy: self.yy + o.yy, zz: self.zz + o.zz, xy: self.xy + o.xy, xz: self.xz + o.xz, yz: self.yz + o.yz }
    }
    #[inline(always)]
    fn matrix(&self) -> DMat3 {
        DMat3::from_cols(DVec3::new(self.xx, self.xy, self.xz), DVec3::new(self.xy, self.yy, self.yz), DVec3::new(self.xz, self.yz, self.zz))
    }
    /// `[v]x - self`.
    #[inline(always)]
    fn negated_with_skew(&self, v: DVec3) -> DMat3 {
        DMat3::from_cols(
            DVec3::new(-self.xx, v.z - self.xy, -v.y - self.xz),
            DVec3::new(-v.z - self.xy, -self.yy, v.x - self.yz),
            DVec3::new(v.y - self.xz, -v.x - self.yz, -self.zz),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::exp;
    use crate::rod::element_strain;
    use crate::{Material, RodSpec, World};

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
        // A bent, twisted, stretched rod with soft section, so that every term matters.
        let mut seed = 7;
        let n = 5;
        let mut world = World::default();
        let spec = RodSpec::straight(DVec3::ZERO, DVec3::X * 0.05, n, 2e-3, Material::elastic(1e6, 1000.0));
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
        let mut scratch = Scratch::default();
        scratch.fit(&model);
        let h = 10.0; // inertia out of the way
        let gradient = |state: &State, scratch: &mut Scratch| {
            scratch.target.copy_from_slice(&state.position);
            scratch.target_frame.copy_from_slice(&state.orientation);
            for e in 0..n {
                let f = element_strain(&model, state, e) * model.stretch_stiffness[e];
                (scratch.tension[e], scratch.shear[e]) = (f.z, f.truncate());
            }
            assemble(&model, state, scratch, h, Hessian::Exact);
            scratch.rhs.iter().map(|v| -*v).collect::<Vec<_>>()
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
        let product = |scratch: &Scratch, v: &[DVec3], w: &[DVec3]| {
            let s = &scratch.system;
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
            gradient(&state, &mut scratch);
            let want = product(&scratch, &v, &v);
            let e = 1e-5;
            let up = gradient(&moved(&v, e), &mut scratch);
            let down = gradient(&moved(&v, -e), &mut scratch);
            // The frame of the last, unused node does not count.
            let got: f64 = (0..2 * n + 1).map(|k| (up[k] - down[k]).dot(v[k]) / (2.0 * e)).sum();
            // Left out: second derivatives of the joint's own angle, of the order angle^2 / 6, with angles of 0.1 here.
            assert!((got / want - 1.0).abs() < 3e-3, "{got:e} {want:e}");
        }
    }
}
