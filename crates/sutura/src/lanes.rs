//! Two of everything in the lanes of a vector register: the same arithmetic on two elements at a time, with the same
//! bits on every machine.

use crate::math::{exp, log};
use core::ops::Range;
use glam::{DMat3, DQuat, DVec3};
use wide::f64x2;

/// The indices of a range two by two, for the two lanes; one that is left over comes twice.
#[inline(always)]
pub(crate) fn pairs(range: Range<usize>) -> impl Iterator<Item = (usize, usize)> {
    let end = range.end;
    range.step_by(2).map(move |low| (low, (low + 1).min(end - 1)))
}

/// Two vectors in the lanes of one.
#[derive(Clone, Copy)]
pub(crate) struct Vec2 {
    pub x: f64x2,
    pub y: f64x2,
    pub z: f64x2,
}

#[inline(always)]
pub(crate) fn lanes(low: f64, high: f64) -> f64x2 {
    f64x2::new([low, high])
}

impl Vec2 {
    #[inline(always)]
    pub fn load(low: DVec3, high: DVec3) -> Self {
        Vec2 { x: lanes(low.x, high.x), y: lanes(low.y, high.y), z: lanes(low.z, high.z) }
    }
    #[inline(always)]
    pub fn split(&self) -> (DVec3, DVec3) {
        let (x, y, z) = (self.x.to_array(), self.y.to_array(), self.z.to_array());
        (DVec3::new(x[0], y[0], z[0]), DVec3::new(x[1], y[1], z[1]))
    }
    #[inline(always)]
    pub fn times(&self, o: &Vec2) -> Vec2 {
        Vec2 { x: self.x * o.x, y: self.y * o.y, z: self.z * o.z }
    }
    #[inline(always)]
    pub fn less(&self, o: &Vec2) -> Vec2 {
        Vec2 { x: self.x - o.x, y: self.y - o.y, z: self.z - o.z }
    }
    #[inline(always)]
    pub fn dot(&self, o: &Vec2) -> f64x2 {
        self.x * o.x + self.y * o.y + self.z * o.z
    }
    /// `self + v * k`.
    #[inline(always)]
    pub fn plus(&self, v: &Vec2, k: f64x2) -> Vec2 {
        Vec2 { x: self.x + v.x * k, y: self.y + v.y * k, z: self.z + v.z * k }
    }
    #[inline(always)]
    pub fn add(&self, o: &Vec2) -> Vec2 {
        Vec2 { x: self.x + o.x, y: self.y + o.y, z: self.z + o.z }
    }
    #[inline(always)]
    pub fn scaled(&self, k: f64x2) -> Vec2 {
        Vec2 { x: self.x * k, y: self.y * k, z: self.z * k }
    }
    #[inline(always)]
    pub fn cross(&self, o: &Vec2) -> Vec2 {
        Vec2 { x: self.y * o.z - self.z * o.y, y: self.z * o.x - self.x * o.z, z: self.x * o.y - self.y * o.x }
    }
}

/// Two quaternions in the lanes of one.
#[derive(Clone, Copy)]
pub(crate) struct Quat2 {
    pub v: Vec2,
    pub w: f64x2,
}

impl Quat2 {
    #[inline(always)]
    pub fn load(low: DQuat, high: DQuat) -> Self {
        Quat2 {
            v: Vec2 { x: lanes(low.x, high.x), y: lanes(low.y, high.y), z: lanes(low.z, high.z) },
            w: lanes(low.w, high.w),
        }
    }
    #[inline(always)]
    pub fn split(&self) -> (DQuat, DQuat) {
        let ((a, b), w) = (self.v.split(), self.w.to_array());
        (DQuat::from_xyzw(a.x, a.y, a.z, w[0]), DQuat::from_xyzw(b.x, b.y, b.z, w[1]))
    }
    #[inline(always)]
    pub fn conjugate(&self) -> Quat2 {
        Quat2 { v: Vec2 { x: -self.v.x, y: -self.v.y, z: -self.v.z }, w: self.w }
    }
    #[inline(always)]
    pub fn times(&self, o: &Quat2) -> Quat2 {
        let (a, b) = (&self.v, &o.v);
        Quat2 { v: a.cross(b).plus(b, self.w).plus(a, o.w), w: self.w * o.w - a.dot(b) }
    }
    /// The product, summed in the order of `glam`.
    #[inline(always)]
    pub fn product(&self, o: &Quat2) -> Quat2 {
        let (Quat2 { v: a, w: aw }, Quat2 { v: b, w: bw }) = (*self, *o);
        Quat2 {
            v: Vec2 {
                x: aw * b.x + a.x * bw + a.y * b.z - a.z * b.y,
                y: aw * b.y - a.x * b.z + a.y * bw + a.z * b.x,
                z: aw * b.z + a.x * b.y - a.y * b.x + a.z * bw,
            },
            w: aw * bw - a.x * b.x - a.y * b.y - a.z * b.z,
        }
    }
    /// The rotated vectors, summed in the order of `glam`.
    #[inline(always)]
    pub fn rotate(&self, v: &Vec2) -> Vec2 {
        let (Quat2 { v: b, w }, two) = (self, f64x2::splat(2.0));
        v.scaled(*w * *w - b.dot(b)).add(&b.scaled(v.dot(b) * two)).add(&b.cross(v).scaled(*w * two))
    }
    #[inline(always)]
    pub fn normalize(&self) -> Quat2 {
        let Quat2 { v: Vec2 { x, y, z }, w } = *self;
        let inverse = f64x2::splat(1.0) / (x * x + y * y + z * z + w * w).sqrt();
        Quat2 { v: self.v.scaled(inverse), w: w * inverse }
    }
    /// `math::exp` of both.
    #[inline(always)]
    pub fn exp(phi: &Vec2) -> Quat2 {
        let k = |x: f64| f64x2::splat(x);
        let a2 = phi.dot(phi);
        let [low, high] = a2.to_array();
        let (s, c) = if low < 1e-3 && high < 1e-3 {
            let s = k(0.5) - a2 * (k(1.0 / 48.0) - a2 * (k(1.0 / 3840.0) - a2 / k(645_120.0)));
            let c = k(1.0) - a2 * (k(0.125) - a2 * (k(1.0 / 384.0) - a2 * (k(1.0 / 46_080.0) - a2 / k(10_321_920.0))));
            (s, c)
        } else if (1e-3..1.0).contains(&low) && (1e-3..1.0).contains(&high) {
            let u = k(0.25) * a2;
            let s = k(1.0)
                - u * (k(1.0 / 6.0)
                    - u * (k(1.0 / 120.0)
                        - u * (k(1.0 / 5040.0)
                            - u * (k(1.0 / 362_880.0)
                                - u * (k(1.0 / 39_916_800.0)
                                    - u * (k(1.0 / 6_227_020_800.0) - u / k(1_307_674_368_000.0)))))));
            let c = k(1.0)
                - u * (k(0.5)
                    - u * (k(1.0 / 24.0)
                        - u * (k(1.0 / 720.0)
                            - u * (k(1.0 / 40_320.0)
                                - u * (k(1.0 / 3_628_800.0)
                                    - u * (k(1.0 / 479_001_600.0)
                                        - u * (k(1.0 / 87_178_291_200.0) - u / k(20_922_789_888_000.0))))))));
            (k(0.5) * s, c)
        } else {
            let (low, high) = phi.split();
            return Quat2::load(exp(low), exp(high));
        };
        Quat2 { v: phi.scaled(s), w: c }
    }
    /// `math::log` of both.
    #[inline(always)]
    pub fn log(&self) -> Vec2 {
        let k = |x: f64| f64x2::splat(x);
        let (s2, w) = (self.v.dot(&self.v), self.w);
        let ([w0, w1], [low, high], [most0, most1]) = (w.to_array(), s2.to_array(), (k(1e-3) * w * w).to_array());
        // NaN goes the long way.
        if w0 > 0.0 && w1 > 0.0 {
            if self.v.x == f64x2::ZERO && self.v.y == f64x2::ZERO && self.v.z == f64x2::ZERO {
                return self.v;
            }
            if low < most0 && high < most1 {
                let u = s2 / (w * w);
                let series = k(1.0 / 3.0) - u * (k(0.2) - u * (k(1.0 / 7.0) - u * (k(1.0 / 9.0) - u / k(11.0))));
                return self.v.scaled(k(2.0) / w * (k(1.0) - u * series));
            }
            // As in `angle_over_sine`.
            let r = (s2 + w * w).sqrt() + w;
            let u = s2 / (r * r);
            let [u0, u1] = u.to_array();
            if low >= most0 && high >= most1 && u0 < 0.0157 && u1 < 0.0157 {
                let (u2, v) = (u * u, k(1.0) / r);
                let even = k(1.0) + u2 * (k(0.2) + u2 * (k(1.0 / 9.0) + u2 * (k(1.0 / 13.0) + u2 * k(1.0 / 17.0))));
                let odd = k(1.0 / 3.0) + u2 * (k(1.0 / 7.0) + u2 * (k(1.0 / 11.0) + u2 * k(1.0 / 15.0)));
                return self.v.scaled(k(4.0) * v * (even - u * odd));
            }
        }
        let (low, high) = self.split();
        Vec2::load(log(low), log(high))
    }
    /// The directors.
    #[inline(always)]
    pub fn axes(&self) -> [Vec2; 3] {
        let Quat2 { v: Vec2 { x, y, z }, w } = *self;
        let (one, x2, y2, z2) = (f64x2::splat(1.0), x + x, y + y, z + z);
        let (xx, xy, xz, yy, yz, zz) = (x * x2, x * y2, x * z2, y * y2, y * z2, z * z2);
        let (wx, wy, wz) = (w * x2, w * y2, w * z2);
        [
            Vec2 { x: one - (yy + zz), y: xy + wz, z: xz - wy },
            Vec2 { x: xy - wz, y: one - (xx + zz), z: yz + wx },
            Vec2 { x: xz + wy, y: yz - wx, z: one - (xx + yy) },
        ]
    }
}

/// Two symmetric matrices in the lanes of one.
#[derive(Clone, Copy)]
pub(crate) struct Sym2 {
    pub xx: f64x2,
    pub yy: f64x2,
    pub zz: f64x2,
    pub xy: f64x2,
    pub xz: f64x2,
    pub yz: f64x2,
}

impl Sym2 {
    /// `s I`.
    #[inline(always)]
    pub fn scalar(s: f64x2) -> Self {
        let none = f64x2::splat(0.0);
        Sym2 { xx: s, yy: s, zz: s, xy: none, xz: none, yz: none }
    }
    /// `self + k v v^T`.
    #[inline(always)]
    pub fn square(&self, v: &Vec2, k: f64x2) -> Self {
        let w = v.scaled(k);
        self.add(&Sym2 { xx: v.x * w.x, yy: v.y * w.y, zz: v.z * w.z, xy: v.x * w.y, xz: v.x * w.z, yz: v.y * w.z })
    }
    /// `self - a b^T - b a^T`.
    #[inline(always)]
    pub fn less_product(&self, a: &Vec2, b: &Vec2) -> Self {
        let (x, y, z) = (a.x * b.x, a.y * b.y, a.z * b.z);
        Sym2 {
            xx: self.xx - (x + x),
            yy: self.yy - (y + y),
            zz: self.zz - (z + z),
            xy: self.xy - (a.x * b.y + a.y * b.x),
            xz: self.xz - (a.x * b.z + a.z * b.x),
            yz: self.yz - (a.y * b.z + a.z * b.y),
        }
    }
    #[inline(always)]
    pub fn add(&self, o: &Sym2) -> Self {
        Sym2 {
            xx: self.xx + o.xx,
            yy: self.yy + o.yy,
            zz: self.zz + o.zz,
            xy: self.xy + o.xy,
            xz: self.xz + o.xz,
            yz: self.yz + o.yz,
        }
    }
    #[inline(always)]
    pub fn scaled(&self, k: f64x2) -> Self {
        Sym2 { xx: self.xx * k, yy: self.yy * k, zz: self.zz * k, xy: self.xy * k, xz: self.xz * k, yz: self.yz * k }
    }
    #[inline(always)]
    pub fn split(&self) -> (DMat3, DMat3) {
        join([
            Vec2 { x: self.xx, y: self.xy, z: self.xz },
            Vec2 { x: self.xy, y: self.yy, z: self.yz },
            Vec2 { x: self.xz, y: self.yz, z: self.zz },
        ])
    }
    /// `[v]x - self`.
    #[inline(always)]
    pub fn skew_less(&self, v: &Vec2) -> (DMat3, DMat3) {
        join([
            Vec2 { x: -self.xx, y: v.z - self.xy, z: -v.y - self.xz },
            Vec2 { x: -v.z - self.xy, y: -self.yy, z: v.x - self.yz },
            Vec2 { x: v.y - self.xz, y: -v.x - self.yz, z: -self.zz },
        ])
    }
}

/// The two matrices with these columns.
#[inline(always)]
pub(crate) fn join(cols: [Vec2; 3]) -> (DMat3, DMat3) {
    let [(xl, xh), (yl, yh), (zl, zh)] = cols.each_ref().map(Vec2::split);
    (DMat3::from_cols(xl, yl, zl), DMat3::from_cols(xh, yh, zh))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bits(q: DQuat) -> [u64; 4] {
        q.to_array().map(f64::to_bits)
    }

    fn quats(q: Quat2) -> [[u64; 4]; 2] {
        <[DQuat; 2]>::from(q.split()).map(bits)
    }

    fn vectors(v: Vec2) -> [[u64; 3]; 2] {
        <[DVec3; 2]>::from(v.split()).map(|v| v.to_array().map(f64::to_bits))
    }

    #[test]
    fn lanes_have_the_bits_of_the_same_one_by_one() {
        let v = |k: f64| DVec3::new((1.3 * k).sin(), (0.7 * k).cos(), (2.1 * k).sin() - 0.4);
        let sizes = [0.0, 1e-9, 1e-3, 0.02, 0.0316, 0.0317, 0.1, 0.2, 0.3, 0.6, 0.9, 1.5, 3.0, 3.1];
        for (i, a) in sizes.into_iter().enumerate() {
            for (j, b) in sizes.into_iter().enumerate() {
                let (phi, psi) = (v(i as f64) * a, v(j as f64 + 0.5) * b);
                let (q, other) = (Quat2::exp(&Vec2::load(phi, psi)), Quat2::load(exp(psi), exp(phi)));
                let (q0, q1) = (exp(phi), exp(psi));
                assert_eq!(quats(q), [bits(q0), bits(q1)]);
                assert_eq!(vectors(q.log()), [log(q0), log(q1)].map(|v| v.to_array().map(f64::to_bits)));
                let back = Quat2::load(-q0, -q1).log();
                assert_eq!(vectors(back), [log(-q0), log(-q1)].map(|v| v.to_array().map(f64::to_bits)));
                assert_eq!(quats(q.product(&other)), [bits(q0 * q1), bits(q1 * q0)]);
                let unit = q.product(&other).normalize();
                assert_eq!(quats(unit), [bits((q0 * q1).normalize()), bits((q1 * q0).normalize())]);
                let turned = q.conjugate().rotate(&Vec2::load(psi, phi));
                let want = [q0.conjugate() * psi, q1.conjugate() * phi];
                assert_eq!(vectors(turned), want.map(|v| v.to_array().map(f64::to_bits)));
            }
        }
    }

    #[test]
    fn pairs_come_to_each_index() {
        assert!(pairs(3..3).next().is_none());
        assert_eq!(pairs(3..8).collect::<Vec<_>>(), [(3, 4), (5, 6), (7, 7)]);
    }
}
