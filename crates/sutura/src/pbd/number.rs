//! Vectors and quaternions of numbers, or of as many numbers as a register has lanes: a constraint is written once, and
//! projected alone or several at a time with the same bits, on every machine.

use core::ops::{Add, Div, Mul, Neg, Sub};
use glam::{DQuat, DVec3};
use wide::f64x2;

/// A number, or one in each lane.
pub(super) trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    const LANES: usize;
    fn each(of_lane: impl Fn(usize) -> f64) -> Self;
    fn lane(self, k: usize) -> f64;
    fn sqrt(self) -> Self;
    /// With the other sign where `by` has the sign of a negative number.
    fn flip(self, by: Self) -> Self;
}

impl Number for f64 {
    const LANES: usize = 1;
    #[inline(always)]
    fn each(of_lane: impl Fn(usize) -> f64) -> Self {
        of_lane(0)
    }
    #[inline(always)]
    fn lane(self, _: usize) -> f64 {
        self
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn flip(self, by: Self) -> Self {
        f64::from_bits(self.to_bits() ^ (by.to_bits() & (-0.0f64).to_bits()))
    }
}

impl Number for f64x2 {
    const LANES: usize = 2;
    #[inline(always)]
    fn each(of_lane: impl Fn(usize) -> f64) -> Self {
        f64x2::new([of_lane(0), of_lane(1)])
    }
    #[inline(always)]
    fn lane(self, k: usize) -> f64 {
        self.to_array()[k]
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64x2::sqrt(self)
    }
    #[inline(always)]
    fn flip(self, by: Self) -> Self {
        self ^ (by & f64x2::splat(-0.0))
    }
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Vec3<T> {
    pub x: T,
    pub y: T,
    pub z: T,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Quat<T> {
    pub x: T,
    pub y: T,
    pub z: T,
    pub w: T,
}

impl From<DVec3> for Vec3<f64> {
    #[inline(always)]
    fn from(v: DVec3) -> Self {
        Vec3 { x: v.x, y: v.y, z: v.z }
    }
}

impl From<DQuat> for Quat<f64> {
    #[inline(always)]
    fn from(q: DQuat) -> Self {
        Quat { x: q.x, y: q.y, z: q.z, w: q.w }
    }
}

impl<T: Number> Vec3<T> {
    #[inline(always)]
    pub fn each(of_lane: impl Fn(usize) -> Vec3<f64>) -> Self {
        Vec3 { x: T::each(|k| of_lane(k).x), y: T::each(|k| of_lane(k).y), z: T::each(|k| of_lane(k).z) }
    }
    /// Every other of these, one a lane.
    #[inline(always)]
    pub fn load(from: &[DVec3]) -> Self {
        Self::each(|k| from[2 * k].into())
    }
    #[inline(always)]
    pub fn store(self, to: &mut [DVec3]) {
        for k in 0..T::LANES {
            to[2 * k] = DVec3::new(self.x.lane(k), self.y.lane(k), self.z.lane(k));
        }
    }
    #[inline(always)]
    pub fn dot(self, o: Self) -> T {
        self.x * o.x + self.y * o.y + self.z * o.z
    }
    #[inline(always)]
    pub fn flip(self, by: T) -> Self {
        Vec3 { x: self.x.flip(by), y: self.y.flip(by), z: self.z.flip(by) }
    }
}

impl<T: Number> Quat<T> {
    #[inline(always)]
    pub fn each(of_lane: impl Fn(usize) -> Quat<f64>) -> Self {
        Quat {
            x: T::each(|k| of_lane(k).x),
            y: T::each(|k| of_lane(k).y),
            z: T::each(|k| of_lane(k).z),
            w: T::each(|k| of_lane(k).w),
        }
    }
    /// Every other of these, one a lane.
    #[inline(always)]
    pub fn load(from: &[DQuat]) -> Self {
        Self::each(|k| from[2 * k].into())
    }
    #[inline(always)]
    pub fn store(self, to: &mut [DQuat]) {
        for k in 0..T::LANES {
            to[2 * k] = DQuat::from_xyzw(self.x.lane(k), self.y.lane(k), self.z.lane(k), self.w.lane(k));
        }
    }
    /// `conj(self) o`.
    #[inline(always)]
    pub fn conjugate_times(self, o: Self) -> Self {
        let (a, b) = (self, o);
        Quat {
            x: (a.w * b.x - a.x * b.w) + (a.z * b.y - a.y * b.z),
            y: (a.w * b.y - a.y * b.w) + (a.x * b.z - a.z * b.x),
            z: (a.w * b.z - a.z * b.w) + (a.y * b.x - a.x * b.y),
            w: self.dot(o),
        }
    }
    #[inline(always)]
    pub fn lane(self, k: usize) -> Quat<f64> {
        Quat { x: self.x.lane(k), y: self.y.lane(k), z: self.z.lane(k), w: self.w.lane(k) }
    }
    #[inline(always)]
    pub fn imaginary(self) -> Vec3<T> {
        Vec3 { x: self.x, y: self.y, z: self.z }
    }
    #[inline(always)]
    pub fn dot(self, o: Self) -> T {
        (self.x * o.x + self.y * o.y) + (self.z * o.z + self.w * o.w)
    }
    #[inline(always)]
    pub fn inverse_length(self) -> T {
        T::each(|_| 1.0) / self.dot(self).sqrt()
    }
    #[inline(always)]
    pub fn normalized(self) -> Self {
        self * self.inverse_length()
    }
}

impl<T: Number> Add for Vec3<T> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Vec3 { x: self.x + o.x, y: self.y + o.y, z: self.z + o.z }
    }
}

impl<T: Number> Sub for Vec3<T> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Vec3 { x: self.x - o.x, y: self.y - o.y, z: self.z - o.z }
    }
}

impl<T: Number> Mul<T> for Vec3<T> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, k: T) -> Self {
        Vec3 { x: self.x * k, y: self.y * k, z: self.z * k }
    }
}

/// Component by component.
impl<T: Number> Mul for Vec3<T> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        Vec3 { x: self.x * o.x, y: self.y * o.y, z: self.z * o.z }
    }
}

impl<T: Number> Add for Quat<T> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Quat { x: self.x + o.x, y: self.y + o.y, z: self.z + o.z, w: self.w + o.w }
    }
}

impl<T: Number> Sub for Quat<T> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Quat { x: self.x - o.x, y: self.y - o.y, z: self.z - o.z, w: self.w - o.w }
    }
}

impl<T: Number> Mul<T> for Quat<T> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, k: T) -> Self {
        Quat { x: self.x * k, y: self.y * k, z: self.z * k, w: self.w * k }
    }
}
