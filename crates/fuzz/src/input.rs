//! Bytes as numbers: mostly sensible ones, so that something happens, and now and then any number at all.

use arbitrary::Unstructured;
use sutura::glam::{DQuat, DVec3};

/// A source of values that never runs dry: past its end everything is zero.
pub struct Input<'a>(Unstructured<'a>);

impl<'a> Input<'a> {
    pub fn new(data: &'a [u8]) -> Self {
        Input(Unstructured::new(data))
    }
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
    pub fn byte(&mut self) -> u8 {
        self.0.arbitrary().unwrap_or(0)
    }
    pub fn bytes(&mut self, n: usize) -> &'a [u8] {
        let n = n.min(self.0.len());
        self.0.bytes(n).unwrap_or_default()
    }
    pub fn rest(self) -> &'a [u8] {
        self.0.take_rest()
    }
    /// Under `n`, which is at most 256.
    pub fn below(&mut self, n: usize) -> usize {
        usize::from(self.byte()) % n.max(1)
    }
    pub fn truth(&mut self) -> bool {
        self.byte() & 1 == 1
    }
    pub fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.below(of.len())]
    }

    /// A number of the order of `scale`, from -4 to 4 of it; one of the odd ones; or any at all.
    pub fn number(&mut self, scale: f64) -> f64 {
        const ODD: [f64; 20] = [
            0.0,
            -0.0,
            1.0,
            -1.0,
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::MAX,
            f64::MIN,
            f64::MIN_POSITIVE,
            5e-324,
            1e300,
            1e150,
            1e80,
            1e20,
            1e9,
            1e-9,
            1e-20,
            1e-80,
            1e-150,
        ];
        match self.byte() {
            b @ 0..=199 => scale * (f64::from(b) - 100.0) / 25.0,
            b @ 200..=219 => ODD[usize::from(b - 200)],
            b @ 220..=239 => scale * ODD[usize::from(b - 220)],
            _ => f64::from_bits(self.0.arbitrary().unwrap_or(0)),
        }
    }
    /// The same, > 0 more often than not.
    pub fn size(&mut self, scale: f64) -> f64 {
        let v = self.number(scale);
        // The odd ones stay as they are.
        if v.abs() <= 4.0 * scale { v.abs().max(0.01 * scale) } else { v }
    }
    pub fn vector(&mut self, scale: f64) -> DVec3 {
        DVec3::new(self.number(scale), self.number(scale), self.number(scale))
    }
    /// A unit vector; not always.
    pub fn direction(&mut self) -> DVec3 {
        let v = self.vector(1.0);
        if self.below(16) == 0 { v } else { v.try_normalize().unwrap_or(DVec3::X) }
    }
    /// A unit quaternion; not always.
    pub fn rotation(&mut self) -> DQuat {
        let v = self.vector(1.0);
        let q = DQuat::from_xyzw(v.x, v.y, v.z, self.number(1.0));
        if self.below(16) == 0 || !(q.is_finite() && q.length() > 0.0 && q.length().is_finite()) {
            q
        } else {
            q.normalize()
        }
    }

    /// Bytes that are what is left of the input, or good ones with changes: numbers overwritten, pieces cut out and put
    /// in.
    pub fn changed(mut self, good: &[u8]) -> Vec<u8> {
        if self.below(8) == 0 {
            return self.rest().to_vec();
        }
        let mut bytes = good.to_vec();
        while !self.is_empty() && !bytes.is_empty() {
            let at = (usize::from(self.byte()) * 256 + usize::from(self.byte())) % bytes.len();
            let new = match self.byte() % 8 {
                0 | 1 => self.bytes(1).to_vec(),
                2 => self.bytes(4).to_vec(),
                3 => self.bytes(8).to_vec(),
                4 | 5 => self.number(1.0).to_le_bytes().to_vec(),
                6 => {
                    let end = (at + usize::from(self.byte())).min(bytes.len());
                    bytes.drain(at..end);
                    continue;
                }
                _ => {
                    let piece = self.below(32);
                    let piece = self.bytes(piece).to_vec();
                    bytes.splice(at..at, piece);
                    continue;
                }
            };
            let end = (at + new.len()).min(bytes.len());
            bytes[at..end].copy_from_slice(&new[..end - at]);
        }
        bytes
    }
}
