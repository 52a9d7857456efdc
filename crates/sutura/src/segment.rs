//! Closest points of two segments.

use glam::DVec3;

/// Places on the two segments and the vector from the second's point to the first's.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Closest {
    pub s: f64,
    pub t: f64,
    pub apart: DVec3,
}

/// Closest points of segments p0 p1 and q0 q1 (Ericson, Real-Time Collision Detection, 5.1.9, in the form that clamps
/// one place at a time).
#[inline]
pub(crate) fn closest(p0: DVec3, p1: DVec3, q0: DVec3, q1: DVec3) -> Closest {
    let (u, v, w) = (p1 - p0, q1 - q0, p0 - q0);
    let (a, b, e) = (u.length_squared(), u.dot(v), v.length_squared());
    let (c, f) = (u.dot(w), v.dot(w));
    let denominator = a * e - b * b;
    // Parallel within rounding: any place will do, the clamps below find a closest one.
    let mut s = if denominator > 1e-14 * a * e { ((b * f - c * e) / denominator).clamp(0.0, 1.0) } else { 0.0 };
    let mut t = if e > 0.0 { (b * s + f) / e } else { 0.0 };
    if t < 0.0 {
        t = 0.0;
        s = if a > 0.0 { (-c / a).clamp(0.0, 1.0) } else { 0.0 };
    } else if t > 1.0 {
        t = 1.0;
        s = if a > 0.0 { ((b - c) / a).clamp(0.0, 1.0) } else { 0.0 };
    }
    Closest { s, t, apart: w + u * s - v * t }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = DVec3> {
        (-1.0..1.0, -1.0..1.0, -1.0..1.0).prop_map(|(x, y, z)| DVec3::new(x, y, z))
    }

    proptest! {
        #[test]
        fn no_other_pair_of_places_is_nearer(p0 in point(), p1 in point(), q0 in point(), q1 in point()) {
            let c = closest(p0, p1, q0, q1);
            let d = c.apart.length();
            prop_assert!((p0.lerp(p1, c.s) - q0.lerp(q1, c.t) - c.apart).length() < 1e-14);
            for i in 0..=20 {
                for j in 0..=20 {
                    let other = (p0.lerp(p1, f64::from(i) / 20.0) - q0.lerp(q1, f64::from(j) / 20.0)).length();
                    prop_assert!(other >= d - 1e-12);
                }
            }
        }
    }

    #[test]
    fn parallel_segments() {
        let c = closest(DVec3::ZERO, DVec3::X, DVec3::new(0.5, 1.0, 0.0), DVec3::new(1.5, 1.0, 0.0));
        assert!((c.apart.length() - 1.0).abs() < 1e-15);
        let c = closest(DVec3::ZERO, DVec3::X, DVec3::new(3.0, 0.0, 0.0), DVec3::new(2.0, 0.0, 0.0));
        assert!((c.apart.length() - 1.0).abs() < 1e-15 && c.s == 1.0 && c.t == 1.0);
    }
}
