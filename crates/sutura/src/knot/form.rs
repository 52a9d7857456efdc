//! Whether a knot lies flat or has capsized, which topology does not tell.
//!
//! Two strands make a knot: the two passes of a thread through it, or one of each of two threads. In a flat knot each
//! bends round the other, and both turn alike. When it capsizes (a reef knot spilled into a lark's head, a granny into
//! two half hitches) one strand goes nearly straight through and the other winds about it. So the measure is how evenly
//! the turning is shared: with the total curvature of the strands `K1` and `K2` \[rad\],
//!
//! `share = 2 min(K1, K2) / (K1 + K2)`,
//!
//! 1 when both turn alike, 0 when one is straight. It has no length in it, and is the same for the mirror image, for
//! the thread read backward, and for any motion of the whole (theory 15).
//!
//! Curvature is taken from chords of one thread radius of arc: shorter waves are those of a table's digits or of a
//! solver at rest, not the thread's.

use super::space::{Aabb, BoxTree, point_segment};
use super::{Entries, entries};
use glam::DVec3;

/// How a knot lies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Form {
    /// Flat or capsized.
    pub verdict: Verdict,
    /// How evenly the two strands share the turning: 1 alike, 0 one of them straight.
    pub share: f64,
    /// Total curvature of each strand within the knot \[rad\].
    pub turning: [f64; 2],
}

/// Flat or capsized.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Both strands turn alike.
    Flat,
    /// One strand goes through nearly straight, the other is wound about it.
    Capsized {
        /// Which one is straight: 0 the first thread, or the pass at the thread's start; 1 the other.
        straight: usize,
    },
    /// Something between.
    Unclear,
}

impl Verdict {
    /// Every name that [`Verdict::name`] gives.
    pub const NAMES: [&str; 3] = ["flat", "capsized", "unclear"];
    /// `flat`, `capsized`, `unclear`.
    pub fn name(self) -> &'static str {
        match self {
            Verdict::Flat => "flat",
            Verdict::Capsized { .. } => "capsized",
            Verdict::Unclear => "unclear",
        }
    }
}

/// Share from which on a knot is flat: one strand turns at most one and a half times as much as the other.
const FLAT: f64 = 0.8;
/// Share to which it is capsized: one strand turns at least three times as much as the other.
const CAPSIZED: f64 = 0.5;
/// Turning of both strands together under which there is nothing to share \[rad\]: two strands that lie side by side
/// are no knot. A flat throw has a quarter of a turn in each strand at least.
const LEAST_TURNING: f64 = core::f64::consts::PI;

/// How the knot of a thread with a loop lies. `None` when it touches itself nowhere, has no loop
/// ([`Entries::loop_ab`]), or when the input does not fit together.
pub fn form(points: &[DVec3], rest_lengths: &[f64], radius: f64) -> Option<Form> {
    let Entries { tail_a, loop_ab: Some([loop_a, loop_b]), tail_b } = entries(points, rest_lengths, radius)? else {
        return None;
    };
    let strand = |from: f64, to: f64| between(points, rest_lengths, from, to);
    form_of_strands([&strand(tail_a, loop_a), &strand(loop_b, tail_b)], radius)
}

/// How the knot that joins two threads of this radius lies: a strand is the part of a thread from the first to the last
/// place that is nearer than 1.2 diameters to the other thread. `None` when they do not touch.
pub fn form_of_two(a: &[DVec3], b: &[DVec3], radius: f64) -> Option<Form> {
    if !(radius.is_finite() && radius > 0.0) || a.iter().chain(b).any(|p| !p.is_finite()) {
        return None;
    }
    let reach = 1.2 * 2.0 * radius;
    form_of_strands([&near(&even(a, radius), b, reach), &near(&even(b, radius), a, reach)], radius)
}

/// How two strands lie that make a knot, given from where they enter it to where they leave it. `None` when they do not
/// turn, or when the input does not fit together.
pub fn form_of_strands(strands: [&[DVec3]; 2], radius: f64) -> Option<Form> {
    let finite = strands.iter().all(|s| s.iter().all(|p| p.is_finite()));
    if !(finite && radius.is_finite() && radius > 0.0) {
        return None;
    }
    let turning = strands.map(|s| turning(&even(s, radius)));
    let (least, sum) = (turning[0].min(turning[1]), turning[0] + turning[1]);
    if sum < LEAST_TURNING {
        return None;
    }
    let share = 2.0 * least / sum;
    let verdict = match () {
        () if share >= FLAT => Verdict::Flat,
        () if share <= CAPSIZED => Verdict::Capsized { straight: usize::from(turning[1] < turning[0]) },
        () => Verdict::Unclear,
    };
    Some(Form { verdict, share, turning })
}

/// Sum of the angles between the pieces of a polyline \[rad\].
fn turning(points: &[DVec3]) -> f64 {
    let pieces: Vec<DVec3> = points.windows(2).map(|w| w[1] - w[0]).filter(|p| *p != DVec3::ZERO).collect();
    pieces.windows(2).map(|w| libm::atan2(w[0].cross(w[1]).length(), w[0].dot(w[1]))).sum()
}

/// The part of a thread between two rest arc lengths.
fn between(points: &[DVec3], rest_lengths: &[f64], from: f64, to: f64) -> Vec<DVec3> {
    let mut part = Vec::new();
    let mut arc = 0.0;
    for (w, l) in points.windows(2).zip(rest_lengths) {
        let (a, b) = (from.max(arc), to.min(arc + l));
        if a <= b {
            let at = |s: f64| w[0].lerp(w[1], (s - arc) / l);
            if part.is_empty() {
                part.push(at(a));
            }
            part.push(at(b));
        }
        arc += l;
    }
    part
}

/// A polyline in pieces of equal arc length, about `length` each.
fn even(points: &[DVec3], length: f64) -> Vec<DVec3> {
    let mut arc = vec![0.0];
    for w in points.windows(2) {
        arc.push(arc[arc.len() - 1] + w[0].distance(w[1]));
    }
    let total = arc[arc.len() - 1];
    // A strand of a million radii is none; the bound keeps nonsense from filling the memory.
    let n = (total / length).round().clamp(1.0, 1e6) as usize;
    let mut k = 0;
    let place = |i: usize, k: &mut usize| {
        let s = total * i as f64 / n as f64;
        while *k + 2 < arc.len() && arc[*k + 1] < s {
            *k += 1;
        }
        let piece = arc[*k + 1] - arc[*k];
        points[*k].lerp(points[*k + 1], if piece > 0.0 { ((s - arc[*k]) / piece).min(1.0) } else { 0.0 })
    };
    if points.len() < 2 { points.to_vec() } else { (0..=n).map(|i| place(i, &mut k)).collect() }
}

/// From the first to the last of `points` within reach of a polyline.
fn near(points: &[DVec3], polyline: &[DVec3], reach: f64) -> Vec<DVec3> {
    let mut tree = BoxTree::default();
    tree.reset(polyline.len().saturating_sub(1));
    for (k, w) in polyline.windows(2).enumerate() {
        tree.set(k, Aabb::around(w));
    }
    tree.refit();
    let touches = |p: &DVec3| {
        tree.any(&Aabb::around(&[*p]).grown(reach), &mut |k| point_segment(*p, [polyline[k], polyline[k + 1]]) < reach)
    };
    match (points.iter().position(touches), points.iter().rposition(touches)) {
        (Some(first), Some(last)) => points[first..=last].to_vec(),
        _ => Vec::new(),
    }
}
