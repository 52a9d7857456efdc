//! Where a thread enters its knot.
//!
//! A place on the thread is in touch when another part of the same thread, more than `2 pi r` of thread away (so that a
//! bend is not taken for a contact), is nearer than 1.2 diameters, centerline to centerline. Stretches of places in
//! touch, joined over gaps of under 4 diameters, form a knot when they touch each other; the largest such group by
//! length is the knot, so that a tail that lies across the loop is left out. The knot's first and last place are where
//! the tails enter. The longest gap between is the loop, when it is longer than 10 diameters, which is all the thread
//! that a tight overhand knot holds.
//!
//! Each place is found where the distance to the other strand is exactly 1.2 diameters, between particles too, and
//! measured in rest arc length. So it moves continuously while the thread does, and stays when the whole knot moves.

use super::space::{Aabb, BoxTree};
use glam::DVec3;

/// Rest arc lengths from the start of the thread at which it enters and leaves its knot \[m\].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Entries {
    /// The tail at the thread's start goes in here.
    pub tail_a: f64,
    /// Where the loop comes out and goes in again; `None` when there is none, as in a tight overhand knot.
    pub loop_ab: Option<[f64; 2]>,
    /// The tail at the thread's end comes out here.
    pub tail_b: f64,
}

impl Entries {
    /// Slip since `before`: the largest change of an entry of both \[m\].
    pub fn slip_since(&self, before: &Entries) -> f64 {
        let mut slip = (self.tail_a - before.tail_a).abs().max((self.tail_b - before.tail_b).abs());
        if let (Some(now), Some(then)) = (self.loop_ab, before.loop_ab) {
            slip = slip.max((now[0] - then[0]).abs()).max((now[1] - then[1]).abs());
        }
        slip
    }
}

/// Where the thread through `points` with these rest lengths of its elements and this radius enters its knot. `None`
/// when it touches itself nowhere, or when the input does not fit together.
pub fn entries(points: &[DVec3], rest_lengths: &[f64], radius: f64) -> Option<Entries> {
    let fits = points.len() == rest_lengths.len() + 1
        && radius.is_finite()
        && radius > 0.0
        && points.iter().all(|p| p.is_finite())
        && rest_lengths.iter().all(|l| l.is_finite() && *l > 0.0);
    if !fits || rest_lengths.is_empty() {
        return None;
    }
    let thread = Thread::new(points, rest_lengths, radius);
    let stretches = thread.stretches_in_touch();
    let knot = largest_group(&thread, &stretches)?;
    let (first, last) = (knot.first()?, knot.last()?);
    let gap = knot.windows(2).map(|w| [w[0].to, w[1].from]).max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])));
    Some(Entries { tail_a: first.from, loop_ab: gap.filter(|g| g[1] - g[0] > 10.0 * 2.0 * radius), tail_b: last.to })
}

/// Places in touch from one rest arc length to another.
#[derive(Debug, Clone)]
struct Stretch {
    from: f64,
    to: f64,
    /// Places that its places touch.
    touches: Vec<f64>,
}

struct Thread<'a> {
    points: &'a [DVec3],
    /// Rest arc length of each particle.
    arc: Vec<f64>,
    radius: f64,
    /// Distance under which places are in touch.
    reach: f64,
    tree: BoxTree,
}

impl<'a> Thread<'a> {
    fn new(points: &'a [DVec3], rest_lengths: &[f64], radius: f64) -> Self {
        let mut arc = vec![0.0; points.len()];
        for (i, l) in rest_lengths.iter().enumerate() {
            arc[i + 1] = arc[i] + l;
        }
        let mut tree = BoxTree::default();
        tree.reset(rest_lengths.len());
        for (i, w) in points.windows(2).enumerate() {
            tree.set(i, Aabb::around(w));
        }
        tree.refit();
        Thread { points, arc, radius, reach: 1.2 * 2.0 * radius, tree }
    }

    /// Point of the centerline at rest arc length `s` of element `e`.
    fn point(&self, e: usize, s: f64) -> DVec3 {
        self.points[e].lerp(self.points[e + 1], ((s - self.arc[e]) / (self.arc[e + 1] - self.arc[e])).clamp(0.0, 1.0))
    }

    /// The place of another part of the thread nearest to place `s` of element `e`, when it is within reach.
    fn touch(&self, e: usize, s: f64) -> Option<f64> {
        let p = self.point(e, s);
        let apart = 2.0 * core::f64::consts::PI * self.radius;
        let mut best: Option<(f64, f64)> = None;
        self.tree.any(&Aabb::around(&[p]).grown(self.reach), &mut |f| {
            // Only the pieces of the element that are far enough along the thread.
            for (from, to) in
                [(self.arc[f], self.arc[f + 1].min(s - apart)), (self.arc[f].max(s + apart), self.arc[f + 1])]
            {
                if from < to {
                    let (a, b) = (self.point(f, from), self.point(f, to));
                    let u = ((p - a).dot(b - a) / (b - a).length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
                    let distance = p.distance(a.lerp(b, u));
                    if distance < best.map_or(self.reach, |b| b.0) {
                        best = Some((distance, from + u * (to - from)));
                    }
                }
            }
            false
        });
        best.map(|b| b.1)
    }

    /// The border of the places in touch between `touching` and `apart`, both on element `e`.
    fn border(&self, e: usize, mut touching: f64, mut apart: f64) -> f64 {
        // Fifty halvings of an element end at the last digit.
        for _ in 0..50 {
            let s = 0.5 * (touching + apart);
            if self.touch(e, s).is_some() {
                touching = s;
            } else {
                apart = s;
            }
        }
        touching
    }

    fn stretches_in_touch(&self) -> Vec<Stretch> {
        let mut all: Vec<Stretch> = Vec::new();
        let mut before: Option<f64> = None; // The last place looked at, when it was not in touch.
        let mut inside = false;
        for e in 0..self.points.len() - 1 {
            // Places at most half a radius apart: a shorter contact is none that could hold a knot.
            let pieces = ((self.arc[e + 1] - self.arc[e]) / (0.5 * self.radius)).ceil().clamp(1.0, 64.0) as usize;
            for k in 0..=pieces {
                let s = self.arc[e] + (self.arc[e + 1] - self.arc[e]) * k as f64 / pieces as f64;
                let touch = self.touch(e, s);
                match (touch, inside) {
                    (Some(t), false) => {
                        let from = before.map_or(s, |b| self.border(e, s, b.max(self.arc[e])));
                        match all.last_mut() {
                            Some(last) if from - last.to < 4.0 * 2.0 * self.radius => last.to = s,
                            _ => all.push(Stretch { from, to: s, touches: Vec::new() }),
                        }
                        all.last_mut().expect("there is one").touches.push(t);
                    }
                    (Some(t), true) => {
                        let last = all.last_mut().expect("inside one");
                        last.to = s;
                        last.touches.push(t);
                    }
                    (None, true) => {
                        let last = all.last_mut().expect("inside one");
                        last.to = self.border(e, last.to.max(self.arc[e]), s);
                    }
                    (None, false) => {}
                }
                inside = touch.is_some();
                before = (!inside).then_some(s);
            }
        }
        all
    }
}

/// The stretches that touch each other and are longest together, in order along the thread.
fn largest_group(thread: &Thread<'_>, stretches: &[Stretch]) -> Option<Vec<Stretch>> {
    let mut group: Vec<usize> = (0..stretches.len()).collect();
    for (i, stretch) in stretches.iter().enumerate() {
        for t in &stretch.touches {
            let near = |s: &Stretch| *t > s.from - thread.radius && *t < s.to + thread.radius;
            if let Some(j) = stretches.iter().position(near) {
                let (a, b) = (group[i].min(group[j]), group[i].max(group[j]));
                group.iter_mut().filter(|g| **g == b).for_each(|g| *g = a);
            }
        }
    }
    let length =
        |g: usize| stretches.iter().zip(&group).filter(|(_, k)| **k == g).map(|(s, _)| s.to - s.from).sum::<f64>();
    // Of equal ones the first.
    let largest = (0..stretches.len()).rev().max_by(|a, b| length(*a).total_cmp(&length(*b)))?;
    Some(stretches.iter().zip(&group).filter(|(_, g)| **g == largest).map(|(s, _)| s.clone()).collect())
}
