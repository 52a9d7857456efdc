//! Centerlines of loose knots: pieces of analytic curves, joined smoothly and cut into equal elements.

use sutura::glam::DVec3;
use sutura::knot::{Ends, KnotType, recognize};

/// The polyline through `n + 1` points at equal arcs along `points`. (Scenes cut lines into equal chords instead; the
/// engine's tests have their own copy, see there.)
pub fn evenly(points: &[DVec3], n: usize) -> Vec<DVec3> {
    let mut arc = vec![0.0];
    for w in points.windows(2) {
        arc.push(arc[arc.len() - 1] + w[0].distance(w[1]));
    }
    let total = arc[arc.len() - 1];
    (0..=n)
        .map(|i| {
            let s = total * i as f64 / n as f64;
            let k = arc.partition_point(|a| *a < s).clamp(1, arc.len() - 1);
            points[k - 1].lerp(points[k], (s - arc[k - 1]) / (arc[k] - arc[k - 1]))
        })
        .collect()
}

/// Length of a polyline.
pub fn length(points: &[DVec3]) -> f64 {
    points.windows(2).map(|w| w[0].distance(w[1])).sum()
}

/// The knot of a polyline whose ends are held and go on from one another: outward along the line between them.
pub fn knot_held(points: &[DVec3]) -> KnotType {
    let along = points[points.len() - 1] - points[0];
    recognize(points, Ends::Held { start: -along, end: along }, SEED).knot
}

/// The knot of a polyline with free ends.
pub fn knot_free(points: &[DVec3]) -> KnotType {
    recognize(points, Ends::Free, SEED).knot
}

/// Seed of all recognition here.
const SEED: u64 = 1;

/// A loose open overhand knot of this length \[m\] in `n` equal elements. The polynomial trefoil (Shastri)
/// `(t^3 - 3 t, t^4 - 4 t^2, t^5 / 5 - 2 t)` with its height times 0.55 takes 45 % of the thread, straight tails the
/// rest.
pub fn overhand(total: f64, n: usize) -> Vec<DVec3> {
    const FINE: usize = 4000;
    const KNOT: f64 = 0.45;
    let knot: Vec<DVec3> = (0..=FINE)
        .map(|i| {
            let t = -2.05 + 4.1 * i as f64 / FINE as f64;
            let t2 = t * t;
            DVec3::new(t * (t2 - 3.0), t2 * (t2 - 4.0), 0.55 * t * (t2 * t2 / 5.0 - 2.0))
        })
        .collect();
    let scale = KNOT * total / length(&knot);
    let tail = 0.5 * (1.0 - KNOT) * total;
    let outward = [(knot[0] - knot[1]).normalize(), (knot[FINE] - knot[FINE - 1]).normalize()];
    let mut points = vec![knot[0] * scale + outward[0] * tail];
    points.extend(knot.iter().map(|p| *p * scale));
    points.push(knot[FINE] * scale + outward[1] * tail);
    evenly(&points, n)
}

/// Throws stacked under a loop around a post, and what is left for the tails.
#[derive(Debug, Clone, PartialEq)]
pub struct Stack {
    /// Thread diameter \[m\].
    pub diameter: f64,
    /// Radius of the post \[m\]; its axis is z through the origin.
    pub post: f64,
    /// Half twists of each throw, the first one next to the post; odd, positive is right-handed. 3 is a single throw, 5
    /// a double one.
    pub throws: Vec<i32>,
    /// Length of each tail \[m\].
    pub tail: f64,
}

/// Distance of the strands of a throw from its axis, in diameters.
const THROW_RADIUS: f64 = 2.0;
/// Length of a half twist along the axis of its throw, in diameters.
const HALF_TWIST: f64 = 4.0;
/// Distance of the axes of neighboring throws, in diameters.
const THROW_SPACING: f64 = 10.0;
/// Gap between the post and the first throw, and between the post and the loop, in diameters.
const POST_GAP: (f64, f64) = (2.0, 0.1);

impl Stack {
    /// The centerline of the loosely tied thread in elements of about this length \[m\]: a tail, the throws from the
    /// last to the first, round the post, the throws from the first to the last, a tail. The throws lie under the post
    /// (toward -y); the strands of each wind about a line along x, and every strand goes from one side to the other.
    /// The tails lie along x.
    pub fn centerline(&self, element: f64) -> Vec<DVec3> {
        let (left, right) = (self.strand(-1.0), self.strand(1.0));
        let mut points: Vec<DVec3> = left.into_iter().rev().collect();
        points.extend(self.arc());
        points.extend(right);
        points.dedup();
        let n = (length(&points) / element).round().max(1.0) as usize;
        evenly(&points, n)
    }

    /// Over the top of the post, from left to right.
    fn arc(&self) -> Vec<DVec3> {
        const FINE: u32 = 200;
        (0..=FINE)
            .map(|i| {
                self.on_post(LEAVES + (core::f64::consts::PI - 2.0 * LEAVES) * (1.0 - f64::from(i) / f64::from(FINE)))
            })
            .collect()
    }

    /// The point of the loop at this angle from the x axis.
    fn on_post(&self, angle: f64) -> DVec3 {
        let (s, c) = libm::sincos(angle);
        DVec3::new(c, s, 0.0) * (self.post + (0.5 + POST_GAP.1) * self.diameter)
    }

    /// From where the loop leaves the post on this side (-1 left, 1 right) to the end of the tail.
    fn strand(&self, mut side: f64) -> Vec<DVec3> {
        const FINE: u32 = 200;
        let d = self.diameter;
        let a = THROW_RADIUS * d;
        let (s, c) = libm::sincos(LEAVES);
        let mut at = self.on_post(LEAVES);
        at.x *= side;
        let mut heading = DVec3::new(side * s, -c, 0.0);
        let mut points = vec![at];
        let mut axis = -self.post - POST_GAP.0 * d - 0.5 * d - a;
        for &half_twists in &self.throws {
            let (n, hand) = (f64::from(half_twists.abs()), f64::from(half_twists.signum()));
            let half = 0.5 * n * HALF_TWIST * d;
            let point = |u: f64| {
                let (s, c) = libm::sincos(n * core::f64::consts::PI * u);
                DVec3::new(side * half * (1.0 - 2.0 * u), axis + a * c, -side * hand * a * s)
            };
            let turning = n * core::f64::consts::PI * a;
            let first = DVec3::new(-2.0 * side * half, 0.0, -side * hand * turning).normalize();
            points.extend(bend(at, heading, point(0.0), first));
            points.extend((1..=FINE).map(|i| point(f64::from(i) / f64::from(FINE))));
            at = point(1.0);
            // An odd number of half twists ends with the sine falling.
            heading = DVec3::new(first.x, 0.0, -first.z);
            side = -side;
            axis -= THROW_SPACING * d;
        }
        let straight = at + DVec3::new(side * 5.0 * d, 0.0, 0.0) - DVec3::Z * at.z;
        points.extend(bend(at, heading, straight, DVec3::X * side));
        points.push(straight + DVec3::X * (side * self.tail));
        points
    }
}

/// Angle from the x axis at which the loop leaves the post \[rad\].
const LEAVES: f64 = -0.2;

/// A cubic from one point and direction to another, without its first point. A way there and back gets room to turn.
fn bend(from: DVec3, heading: DVec3, to: DVec3, arriving: DVec3) -> Vec<DVec3> {
    const FINE: u32 = 60;
    let reach = from.distance(to) * (1.5 - 0.5 * heading.dot(arriving));
    let point = |u: f64| {
        let (v, u2, v2) = (1.0 - u, u * u, (1.0 - u) * (1.0 - u));
        from * (v2 * (1.0 + 2.0 * u)) + heading * (reach * u * v2) + to * (u2 * (1.0 + 2.0 * v))
            - arriving * (reach * u2 * v)
    };
    (1..=FINE).map(|i| point(f64::from(i) / f64::from(FINE))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use sutura::knot::{Hand, entries};

    fn rest_lengths(points: &[DVec3]) -> Vec<f64> {
        points.windows(2).map(|w| w[0].distance(w[1])).collect()
    }

    #[test]
    fn the_overhand_knot_is_a_trefoil_of_its_length_and_touches_nothing() {
        let radius = 0.25e-3;
        for n in [150, 300] {
            let points = overhand(600.0 * radius, n);
            assert_eq!(points.len(), n + 1);
            assert!(matches!(knot_held(&points), KnotType::Trefoil(_)), "{}", knot_held(&points).name());
            assert_eq!(knot_held(&points), knot_free(&points));
            // Chords of a bend are shorter than its arc, by (length / radius of bend)^2 / 24.
            assert!((length(&points) / (600.0 * radius) - 1.0).abs() < 2e-3, "{}", length(&points));
            assert_eq!(entries(&points, &rest_lengths(&points), radius), None);
        }
    }

    fn stack(throws: &[i32]) -> Stack {
        Stack { diameter: 0.2e-3, post: 2e-3, throws: throws.to_vec(), tail: 8e-3 }
    }

    #[test]
    fn stacks_are_the_knots_that_their_throws_make() {
        let cases: [(&[i32], KnotType); 9] = [
            (&[1], KnotType::Unknot),
            (&[3], KnotType::Trefoil(Hand::Right)),
            (&[-3], KnotType::Trefoil(Hand::Left)),
            (&[3, -3], KnotType::Square),
            (&[3, 3], KnotType::Granny(Hand::Right)),
            (&[-3, -3], KnotType::Granny(Hand::Left)),
            (&[5, -3], KnotType::SurgeonSquare(Hand::Right)),
            (&[3, -3, 3], KnotType::SquareAndThrow(Hand::Right)),
            (&[3, 3, 3], KnotType::ThreeEqualThrows(Hand::Right)),
        ];
        for (throws, knot) in cases {
            for elements in [1.0, 2.0] {
                let points = stack(throws).centerline(elements * 0.2e-3);
                assert_eq!(knot_held(&points), knot, "{throws:?} {elements}");
                assert_eq!(knot_free(&points), knot, "{throws:?} {elements}");
            }
        }
    }

    #[test]
    fn a_stack_is_loose_smooth_and_outside_the_post() {
        for throws in [&[3, -3][..], &[3, 3], &[5, -3], &[3, -3, 3]] {
            let stack = stack(throws);
            let points = stack.centerline(stack.diameter);
            assert_eq!(entries(&points, &rest_lengths(&points), 0.5 * stack.diameter), None, "{throws:?}");
            let pieces: Vec<DVec3> = points.windows(2).map(|w| (w[1] - w[0]) / stack.diameter).collect();
            // No bend is sharper than one of radius one diameter, which a tight knot has too: a radian from element to
            // element.
            let sharpest = pieces.windows(2).map(|w| w[0].angle_between(w[1])).fold(0.0, f64::max);
            assert!(sharpest < 1.0, "{throws:?}: {sharpest}");
            for (w, piece) in points.windows(2).zip(&pieces) {
                // Chords cut corners, over a radian by 4 %; rest lengths are the chords', which may differ by a tenth.
                assert!((0.9..1.02).contains(&piece.length()), "{throws:?}: {}", piece.length());
                let nearest = [0.0, 0.25, 0.5, 0.75]
                    .map(|u| w[0].lerp(w[1], u).truncate().length())
                    .into_iter()
                    .fold(f64::INFINITY, f64::min);
                assert!(nearest > stack.post + 0.5 * stack.diameter, "{throws:?}: {nearest}");
            }
        }
    }
}
