//! Distances of segments from solids, and whether a moving distance ever gets small. Written for the audit alone: it
//! must not share a mistake with the contact code.
//!
//! A sweep needs no polynomial roots. While the ends of two segments move along straight lines, their distance changes
//! no faster than the fastest pair of ends; so a distance `d` at one instant keeps it above zero for a time `d / rate`
//! on both sides. Halving what is not yet excluded ends at the crossing or at nothing, and moves within one plane or
//! end to end are no special cases.

use crate::Geometry;
use crate::knot::space::{point_segment, segments};
use glam::DVec3;

/// Least signed distance of a segment from the surface of a convex solid, negative inside, in the solid's own frame.
/// Infinite for the mesh, which is no solid.
pub(super) fn segment_solid(p: [DVec3; 2], solid: &Geometry) -> f64 {
    match solid {
        Geometry::Plane => p[0].z.min(p[1].z),
        Geometry::Sphere { radius } => point_segment(DVec3::ZERO, p) - radius,
        Geometry::Capsule { radius, half_length } => {
            segments(p, [DVec3::Z * -*half_length, DVec3::Z * *half_length]) - radius
        }
        Geometry::Cylinder { radius, half_length } => {
            // Beside the cylinder only the distance from the axis counts: the common case, and a quick one.
            let across = p.map(|x| DVec3::new(x.x, x.y, 0.0));
            let beside = point_segment(DVec3::ZERO, across) - radius;
            if beside >= 0.0 && p[0].z.abs().max(p[1].z.abs()) <= *half_length {
                return beside;
            }
            least_along(p, |x| {
                let (side, cap) = (x.x.hypot(x.y) - radius, x.z.abs() - half_length);
                side.max(0.0).hypot(cap.max(0.0)) + side.max(cap).min(0.0)
            })
        }
        Geometry::Box { half_sides } => least_along(p, |x| {
            let outside = x.abs() - *half_sides;
            outside.max(DVec3::ZERO).length() + outside.max_element().min(0.0)
        }),
        Geometry::Mesh { .. } => f64::INFINITY,
    }
}

/// Minimum along a segment of the signed distance from a convex solid, which is a convex function (golden section).
fn least_along([a, b]: [DVec3; 2], distance: impl Fn(DVec3) -> f64) -> f64 {
    // Each step keeps this part of the interval; 34 leave 1e-7 of the element, far below any thread's radius.
    const KEPT: f64 = 0.618_033_988_749_894_9;
    const STEPS: usize = 34;
    let at = |s: f64| distance(a.lerp(b, s));
    let (mut from, mut to) = (0.0, 1.0);
    let (mut s, mut t) = (1.0 - KEPT, KEPT);
    let (mut at_s, mut at_t) = (at(s), at(t));
    for _ in 0..STEPS {
        if at_s < at_t {
            (to, t, at_t) = (t, s, at_s);
            s = from + (1.0 - KEPT) * (to - from);
            at_s = at(s);
        } else {
            (from, s, at_s) = (s, t, at_t);
            t = from + KEPT * (to - from);
            at_t = at(t);
        }
    }
    at_s.min(at_t).min(at(0.0)).min(at(1.0))
}

/// How often one motion is looked at. What slides past at the distance `d` over the length `l` needs about `l / d`
/// looks, so this is a slide of thousands of thread diameters in one substep.
const MOST_LOOKS: u32 = 1 << 14;

/// First time in [0, 1] found at which `distance` is at most `limit`, or so near to it that `resolution` or
/// [`MOST_LOOKS`] cannot tell, when it changes by at most `rate` in the whole interval. Never misses one.
pub(super) fn time_within(distance: &impl Fn(f64) -> f64, rate: f64, limit: f64, resolution: f64) -> Option<f64> {
    let mut looks = MOST_LOOKS;
    within(distance, rate, limit, resolution, (0.0, distance(0.0)), (1.0, distance(1.0)), &mut looks)
}

fn within(
    distance: &impl Fn(f64) -> f64,
    rate: f64,
    limit: f64,
    resolution: f64,
    from: (f64, f64),
    to: (f64, f64),
    looks: &mut u32,
) -> Option<f64> {
    let span = rate * (to.0 - from.0);
    if from.1 <= limit {
        return Some(from.0);
    }
    // Going down from both ends as fast as it can, this is how low it gets between.
    if 0.5 * (from.1 + to.1 - span) > limit {
        return None;
    }
    let middle = 0.5 * (from.0 + to.0);
    if span < resolution || middle <= from.0 || middle >= to.0 || *looks == 0 {
        return Some(middle);
    }
    *looks -= 1;
    let middle = (middle, distance(middle));
    within(distance, rate, limit, resolution, from, middle, looks)
        .or_else(|| within(distance, rate, limit, resolution, middle, to, looks))
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
        fn solid_distance_is_the_minimum(p in [point(), point()]) {
            let box_ = Geometry::Box { half_sides: DVec3::new(0.3, 0.4, 0.5) };
            let cylinder = Geometry::Cylinder { radius: 0.3, half_length: 0.4 };
            for solid in [box_, cylinder] {
                let d = segment_solid(p, &solid);
                let n = 400;
                let least = (0..=n).map(|i| p[0].lerp(p[1], f64::from(i) / f64::from(n))).map(|x| segment_solid([x, x], &solid)).fold(f64::INFINITY, f64::min);
                let spacing = 0.5 * p[0].distance(p[1]) / f64::from(n);
                prop_assert!(d <= least + 1e-7 && d >= least - spacing, "{d} {least}");
            }
        }

        /// Against the coplanarity cubic, solved by sampling: where its sign changes between two fine times and the
        /// segments are near, there is a crossing, and it must be found.
        #[test]
        fn no_crossing_is_missed(p in [point(), point()], q in [point(), point()], dp in [point(), point()], dq in [point(), point()]) {
            let at = |x: [DVec3; 2], v: [DVec3; 2], t: f64| [x[0] + v[0] * t, x[1] + v[1] * t];
            let volume = |t: f64| {
                let (p, q) = (at(p, dp, t), at(q, dq, t));
                (p[1] - p[0]).cross(q[1] - q[0]).dot(q[0] - p[0])
            };
            let distance = |t: f64| segments(at(p, dp, t), at(q, dq, t));
            let rate = dp.iter().flat_map(|a| dq.iter().map(move |b| a.distance(*b))).fold(0.0, f64::max);
            let found = time_within(&distance, rate, 1e-6, 1e-6);
            let n = 2000;
            for i in 0..n {
                let (mut a, mut b) = (f64::from(i) / f64::from(n), f64::from(i + 1) / f64::from(n));
                if volume(a) * volume(b) < 0.0 {
                    for _ in 0..60 {
                        let m = 0.5 * (a + b);
                        if volume(a) * volume(m) <= 0.0 { b = m } else { a = m }
                    }
                    // Points are of order one: after 60 bisections what is left of a true crossing is rounding; the
                    // segments' lines may cross outside of them, far more than this apart.
                    if distance(a) < 1e-12 {
                        prop_assert!(found.is_some(), "crossing at {a} missed");
                    }
                }
            }
            if let Some(t) = found {
                prop_assert!(distance(t) <= 3e-6);
            }
        }
    }

    #[test]
    fn a_slide_beyond_all_proportion_comes_to_an_end() {
        // At twice the limit all along: found by nothing but the number of looks.
        let calls = core::cell::Cell::new(0_u32);
        let sliding = |_: f64| {
            calls.set(calls.get() + 1);
            2e-7
        };
        assert!(time_within(&sliding, 1e20, 1e-7, 1e-7).is_some());
        assert!(calls.get() <= MOST_LOOKS + 2);
        assert!(time_within(&sliding, 1e-4, 1e-7, 1e-7).is_none());
    }

    #[test]
    fn a_move_in_the_common_plane_is_found() {
        // Collinear segments that run into each other, and a segment that slides over another in their plane: the cubic
        // is zero.
        let still = [DVec3::ZERO, DVec3::X];
        let end_on = |t: f64| segments([DVec3::X * (3.0 - 3.0 * t), DVec3::X * (4.0 - 3.0 * t)], still);
        assert!(time_within(&end_on, 3.0, 1e-6, 1e-6).is_some());
        let across =
            |t: f64| segments([DVec3::new(0.5, 2.0 - 4.0 * t, 0.0), DVec3::new(0.6, 2.5 - 4.0 * t, 0.0)], still);
        assert!(time_within(&across, 4.0, 1e-6, 1e-6).is_some());
        let past = |t: f64| segments([DVec3::new(1.1, 2.0 - 4.0 * t, 0.0), DVec3::new(1.2, 2.5 - 4.0 * t, 0.0)], still);
        assert!(time_within(&past, 4.0, 1e-6, 1e-6).is_none());
    }
}
