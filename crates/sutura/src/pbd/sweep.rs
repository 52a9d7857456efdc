//! One projection of all shear and stretch of a thread, then of all bend and twist, in one of two orders.
//!
//! *Natural*: along the thread, each constraint after its neighbor, the published order. A joint needs two frames that
//! are done with shear and stretch and the joint before it, so it may follow the elements at some distance: one loop
//! over both, in which the processor has two chains to work on, with the same bits.
//!
//! *Two-color*: every other constraint, then those between. Those of a color do not touch each other, so several are
//! projected in the lanes of a register.

use super::constraints::{BendTwist, StretchShear};
use super::number::{Number, Quat, Vec3};
use crate::params::SweepOrder;
use glam::{DQuat, DVec3};
use wide::f64x2;

/// From the first constraint in the lanes to the first that comes next in its color.
const GROUP: usize = 2 * f64x2::LANES;

/// The constraints of all threads.
#[derive(Default)]
pub(super) struct Sweep {
    /// Of each element, and of the joint before it.
    stretch: Vec<StretchShear<f64>>,
    joint: Vec<BendTwist<f64>>,
    /// Each with those after it of its color, in lanes; for the two colors.
    stretch_lanes: Vec<StretchShear<f64x2>>,
    joint_lanes: Vec<BendTwist<f64x2>>,
}

/// The constraints and the state of one thread; the first joint is none.
struct Thread<'a> {
    stretch: &'a [StretchShear<f64>],
    joint: &'a [BendTwist<f64>],
    x: &'a mut [DVec3],
    q: &'a mut [DQuat],
}

impl Sweep {
    pub fn set(&mut self, order: SweepOrder, constraints: impl Iterator<Item = (StretchShear<f64>, BendTwist<f64>)>) {
        self.stretch.clear();
        self.joint.clear();
        for (stretch, joint) in constraints {
            self.stretch.push(stretch);
            self.joint.push(joint);
        }
        self.stretch_lanes.clear();
        self.joint_lanes.clear();
        if order == SweepOrder::TwoColor {
            // At the end of all threads lanes have nothing to hold, and are not used.
            let of_lane = |e: usize, k: usize| (e + 2 * k).min(self.stretch.len() - 1);
            self.stretch_lanes
                .extend((0..self.stretch.len()).map(|e| StretchShear::each(|k| self.stretch[of_lane(e, k)])));
            self.joint_lanes.extend((0..self.joint.len()).map(|e| BendTwist::each(|k| self.joint[of_lane(e, k)])));
        }
    }

    /// One projection of the thread with these elements, which the state is of.
    pub fn project(&self, order: SweepOrder, elements: core::ops::Range<usize>, x: &mut [DVec3], q: &mut [DQuat]) {
        let n = elements.len();
        let mut thread = Thread {
            stretch: &self.stretch[elements.clone()],
            joint: &self.joint[elements.clone()],
            x: &mut x[..=n],
            q: &mut q[..n],
        };
        match order {
            SweepOrder::Natural => thread.natural(),
            SweepOrder::TwoColor => {
                thread.two_color(&self.stretch_lanes[elements.clone()], &self.joint_lanes[elements]);
            }
        }
    }
}

impl Thread<'_> {
    fn natural(&mut self) {
        /// How many elements a joint is behind.
        const LAG: usize = 1;
        let Thread { stretch, joint, x, q } = self;
        let n = stretch.len();
        let mut place = Vec3::from(x[0]);
        // The frame that the next joint begins with, and one over its length, not multiplied yet.
        let (mut frame, mut inverse) = (Quat::from(DQuat::IDENTITY), 1.0);
        for e in 0..n + LAG {
            if e < n {
                let (done, next, turned) = stretch[e].project(place, x[e + 1].into(), q[e].into());
                done.store(&mut x[e..]);
                turned.store(&mut q[e..]);
                place = next;
            }
            if e == LAG {
                (frame, inverse) = (q[0].into(), 1.0);
            }
            if e > LAG {
                let j = e - LAG;
                let both = joint[j].project_both(frame, inverse, q[j].into());
                let inverses = both.inverse_length();
                (both.lane(0) * inverses.lane(0)).store(&mut q[j - 1..]);
                (frame, inverse) = (both.lane(1), inverses.lane(1));
            }
        }
        place.store(&mut x[n..]);
        if n > 1 {
            (frame * inverse).store(&mut q[n - 1..]);
        }
    }

    fn two_color(&mut self, stretch_lanes: &[StretchShear<f64x2>], joint_lanes: &[BendTwist<f64x2>]) {
        let n = self.stretch.len();
        for color in 0..2 {
            let mut e = color;
            while e + GROUP < n + 2 {
                stretch_at(&stretch_lanes[e], e, self.x, self.q);
                e += GROUP;
            }
            for e in (e..n).step_by(2) {
                stretch_at(&self.stretch[e], e, self.x, self.q);
            }
        }
        for color in 0..2 {
            let mut e = 1 + color;
            while e + GROUP < n + 2 {
                joint_at(&joint_lanes[e], e, self.q);
                e += GROUP;
            }
            for e in (e..n).step_by(2) {
                joint_at(&self.joint[e], e, self.q);
            }
        }
    }
}

/// Projects element `e`, or as many as there are lanes, every other from `e` on.
#[inline(always)]
fn stretch_at<T: Number>(c: &StretchShear<T>, e: usize, x: &mut [DVec3], q: &mut [DQuat]) {
    let (x, q) = (&mut x[e..e + 2 * T::LANES], &mut q[e..e + 2 * T::LANES - 1]);
    let (x0, x1, turned) = c.project(Vec3::load(x), Vec3::load(&x[1..]), Quat::load(q));
    x0.store(x);
    x1.store(&mut x[1..]);
    turned.store(q);
}

/// Projects the joint before element `e`, or as many as there are lanes, every other from there on.
#[inline(always)]
fn joint_at<T: Number>(c: &BendTwist<T>, e: usize, q: &mut [DQuat]) {
    let q = &mut q[e - 1..e - 1 + 2 * T::LANES];
    let [a, b] = c.project(Quat::load(q), T::each(|_| 1.0), Quat::load(&q[1..]));
    a.normalized().store(q);
    b.normalized().store(&mut q[1..]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::exp;

    type Constraints = (StretchShear<f64>, BendTwist<f64>);

    /// Threads with `sizes` elements, of all kinds of weights, some held, far from rest.
    fn threads(sizes: &[usize]) -> (Vec<Constraints>, Vec<DVec3>, Vec<DQuat>) {
        let n: usize = sizes.iter().map(|n| n + 1).sum();
        let s = |i: usize, k: f64| (k * i as f64).sin();
        let weight = |i: usize| if i % 7 == 3 { 0.0 } else { 1.0 + 0.5 * s(i, 2.1) };
        let constraint = |e: usize| {
            let rest = exp(DVec3::new(0.2 * s(e, 0.3), 0.1, -0.3 * s(e, 1.1)));
            let stretch =
                StretchShear::new(1.0 + 0.2 * s(e, 0.9), [weight(e), weight(e + 1)], 0.3 * weight(e + 2), 0.9);
            (stretch, BendTwist::new(rest, [weight(e + 1), weight(e + 2)], DVec3::new(0.5, 0.6, 0.8)))
        };
        let place = |i: usize| DVec3::new(i as f64, 0.3 * s(i, 1.3), 0.2 * s(i, 0.7));
        // Every fifth quaternion has the other sign.
        let frame =
            |e: usize| exp(DVec3::new(0.4 * s(e, 0.8), 1.5, 0.3 * s(e, 1.9))) * if e % 5 == 2 { -1.0 } else { 1.0 };
        ((0..n).map(constraint).collect(), (0..n).map(place).collect(), (0..n).map(frame).collect())
    }

    /// One constraint after the other, nothing shared between them.
    fn one_by_one(order: SweepOrder, constraints: &[Constraints], x: &mut [DVec3], q: &mut [DQuat]) {
        let n = constraints.len();
        let sequence = |first: usize| -> Vec<usize> {
            match order {
                SweepOrder::Natural => (first..n).collect(),
                SweepOrder::TwoColor => (first..n).step_by(2).chain((first + 1..n).step_by(2)).collect(),
            }
        };
        for e in sequence(0) {
            stretch_at(&constraints[e].0, e, x, q);
        }
        for e in sequence(1) {
            joint_at(&constraints[e].1, e, q);
        }
    }

    /// What is fused or in lanes is that which comes of one constraint after the other: of two colors to the bit, in
    /// natural order, where a frame is scaled at another place, to rounding.
    #[test]
    fn all_at_once_is_one_by_one() {
        let sizes = [1, 2, 3, 4, 5, 6, 7, 8, 9, 40, 41];
        let (constraints, x, q) = threads(&sizes);
        let mut ends = Vec::new();
        for order in [SweepOrder::Natural, SweepOrder::TwoColor] {
            let mut sweep = Sweep::default();
            sweep.set(order, constraints.iter().copied());
            let (mut fast, mut slow) = ((x.clone(), q.clone()), (x.clone(), q.clone()));
            for _ in 0..20 {
                let mut start = 0;
                for n in sizes {
                    let end = start + n;
                    sweep.project(order, start..end, &mut fast.0[start..=end], &mut fast.1[start..end]);
                    one_by_one(order, &constraints[start..end], &mut slow.0[start..=end], &mut slow.1[start..end]);
                    start = end + 1;
                }
            }
            let off = |i: usize| (fast.0[i] - slow.0[i]).length().max((fast.1[i] - slow.1[i]).length());
            let worst = (0..x.len()).map(off).fold(0.0, f64::max);
            assert!(worst < 1e-14 && (order == SweepOrder::Natural || worst == 0.0), "{order:?}: {worst:e}");
            let moved = (0..x.len()).map(|i| (fast.0[i] - x[i]).length()).fold(0.0, f64::max);
            assert!(moved > 0.1, "nothing to do: {moved}");
            ends.push(fast.0);
        }
        // The two orders are two answers.
        let apart = ends[0].iter().zip(&ends[1]).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        assert!(apart > 1e-6, "{apart:e}");
    }
}
