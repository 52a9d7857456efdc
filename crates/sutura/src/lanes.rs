//! Two of everything in the lanes of a vector register: the same arithmetic on two elements at a time, with the same
//! bits on every machine.

use glam::{DMat3, DQuat, DVec3};
use wide::f64x2;

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
