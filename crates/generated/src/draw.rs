//! Numbers from which a scene is drawn: those of a list, for a test tool that makes them simpler one by one, or those
//! of a seed. Zero is the simplest choice everywhere, and a list that has come to its end goes on with zeros.

use sutura::glam::{DQuat, DVec3};
use sutura::math::exp;

/// A source of numbers in [0, 1).
#[derive(Debug, Clone)]
pub enum Draw {
    /// The numbers, and how many were taken.
    List(Vec<f64>, usize),
    /// The state of a generator (splitmix64).
    Seed(u64),
}

impl Draw {
    /// Numbers of a list.
    pub fn list(numbers: Vec<f64>) -> Self {
        Draw::List(numbers, 0)
    }
    /// Numbers of a seed; `number` tells scenes of one seed apart.
    pub fn seed(seed: u64, number: u64) -> Self {
        let mut draw = Draw::Seed(seed);
        let mixed = draw.bits() ^ number.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        Draw::Seed(mixed)
    }
    fn bits(&mut self) -> u64 {
        let Draw::Seed(state) = self else { return 0 };
        *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    /// The next number.
    pub fn unit(&mut self) -> f64 {
        if let Draw::List(numbers, taken) = self {
            *taken += 1;
            return numbers.get(*taken - 1).copied().unwrap_or(0.0);
        }
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }
    /// Evenly from `a` (the simplest) to `b`.
    pub fn even(&mut self, a: f64, b: f64) -> f64 {
        a + (b - a) * self.unit()
    }
    /// From `a` (the simplest) to `b`, both > 0, evenly in the logarithm.
    pub fn log(&mut self, a: f64, b: f64) -> f64 {
        a * libm::pow(b / a, self.unit())
    }
    /// A whole number from `a` (the simplest) to `b`, both among them.
    pub fn whole(&mut self, a: u32, b: u32) -> u32 {
        a + (self.unit() * f64::from(b - a + 1)) as u32
    }
    /// True with this probability; false is the simplest.
    pub fn chance(&mut self, p: f64) -> bool {
        self.unit() >= 1.0 - p
    }
    /// Each component evenly in [-size, size]; drawn as zero when the numbers are.
    pub fn vector(&mut self, size: f64) -> DVec3 {
        DVec3::new(self.signed(), self.signed(), self.signed()) * size
    }
    /// From -1 to 1, zero being the simplest.
    pub fn signed(&mut self) -> f64 {
        let u = self.unit();
        if u < 0.5 { -2.0 * u } else { 2.0 * u - 1.0 }
    }
    /// A rotation of any axis and angle, the identity being the simplest.
    pub fn turn(&mut self) -> DQuat {
        exp(self.vector(core::f64::consts::PI)).normalize()
    }
    /// A unit vector; `x` is the simplest.
    pub fn direction(&mut self) -> DVec3 {
        self.turn() * DVec3::X
    }
}
