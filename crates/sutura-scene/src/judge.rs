//! The only place that asks the engine's audit and knot recognition.

use crate::report::{FormReport, KnotReport};
use sutura::audit::{Audit, Pair};
use sutura::glam::DVec3;
use sutura::knot::{self, Ends, Entries};
use sutura::{RodView, View};

/// Watches accepted states when a scene wants it.
pub struct Judge {
    audit: Option<Audit>,
}

impl Judge {
    pub fn new(active: bool) -> Self {
        Judge { audit: active.then(Audit::new) }
    }
    pub fn observe(&mut self, view: View<'_>) {
        if let Some(audit) = &mut self.audit {
            audit.observe(view);
        }
    }
    pub fn is_active(&self) -> bool {
        self.audit.is_some()
    }
    pub fn passes_through(&self) -> Option<bool> {
        self.audit.as_ref().map(|a| a.report().passes_through)
    }
    /// Least clearances so far: thread to thread, thread to shape.
    pub fn clearances(&self) -> Option<(Option<f64>, Option<f64>)> {
        self.audit.as_ref().map(|a| (a.report().thread_clearance, a.report().shape_clearance))
    }
    /// Largest |elongation| so far by slot of the thread.
    pub fn max_elongation(&self, slot: usize) -> Option<f64> {
        self.audit.as_ref()?.report().max_elongation.iter().find(|e| e.0 == slot).map(|e| e.1)
    }
    /// The first passages in words.
    pub fn passages(
        &self,
        thread: impl Fn(usize) -> String,
        shape: impl Fn(usize) -> String,
        start: f64,
    ) -> Vec<String> {
        let Some(audit) = &self.audit else { return Vec::new() };
        let words = |c: &sutura::audit::Crossing| {
            let what = match c.what {
                Pair::Threads { a, b } => {
                    format!("{} element {} and {} element {}", thread(a.0), a.1, thread(b.0), b.1)
                }
                Pair::Shape { thread: t, shape: s } => format!("{} element {} and {}", thread(t.0), t.1, shape(s)),
            };
            format!("{:.6} s: {what}", c.time - start)
        };
        audit.report().crossings.iter().take(20).map(words).collect()
    }
}

/// Recognizes the knot of a thread. `held`: the arc lengths at which it is held; when both halves are, the piece
/// between the outermost two is closed along rays away from its middle, otherwise the ends count as free. A closed
/// thread needs neither.
pub fn recognize(rod: &RodView<'_>, held: &[f64], seed: u64) -> KnotReport {
    let points = rod.positions();
    let length = rod.rest_length();
    let (first, last) =
        (held.iter().copied().fold(f64::INFINITY, f64::min), held.iter().copied().fold(f64::NEG_INFINITY, f64::max));
    let recognition = if rod.is_closed() {
        knot::recognize(points, Ends::Closed, seed)
    } else if first < 0.5 * length && last > 0.5 * length {
        let arc = |i: usize| rod.arc(i);
        // A little tolerance, since arc lengths are sums.
        let inside: Vec<DVec3> = (0..points.len())
            .filter(|i| arc(*i) >= first - 1e-9 * length && arc(*i) <= last + 1e-9 * length)
            .map(|i| points[i])
            .collect();
        let middle = inside.iter().sum::<DVec3>() / inside.len().max(1) as f64;
        match (inside.first(), inside.last()) {
            (Some(a), Some(b)) => knot::recognize(&inside, Ends::Held { start: *a - middle, end: *b - middle }, seed),
            _ => knot::recognize(points, Ends::Free, seed),
        }
    } else {
        knot::recognize(points, Ends::Free, seed)
    };
    let (tried, agreed) = if recognition.closures_total > 1 {
        (recognition.closures_total, recognition.closures_agreed)
    } else {
        (recognition.projections_total, recognition.projections_agreed)
    };
    KnotReport {
        knot: recognition.name().into(),
        certain: recognition.is_certain(),
        determinant: recognition.determinant,
        signature: i64::from(recognition.signature),
        tried,
        agreed,
        form: form(rod),
    }
}

/// How the knot of a thread lies.
fn form(rod: &RodView<'_>) -> Option<FormReport> {
    let form = knot::form(rod.positions(), rod.rest_lengths(), rod.radius())?;
    Some(FormReport { verdict: form.verdict.name().into(), share: form.share, turning_rad: form.turning })
}

/// How far the ends are extended for the writhe, in lengths of the thread. What joins them there counts for about 1 /
/// this.
const TAILS: f64 = 1e4;

/// Writhe of a thread in turns, its ends extended far along the tangents there: twist + writhe of a thread held by two
/// clamps then changes by their turning alone, and jumps by 2 where the thread passes through itself. A closed thread
/// as it is.
pub fn writhe(rod: &RodView<'_>) -> f64 {
    let points = rod.positions();
    if rod.is_closed() {
        return knot::writhe(points, true);
    }
    let tail = |from: DVec3, to: DVec3| to + (to - from).normalize_or_zero() * (TAILS * rod.rest_length());
    let n = points.len();
    let mut extended = vec![tail(points[1], points[0])];
    extended.extend_from_slice(points);
    extended.push(tail(points[n - 2], points[n - 1]));
    knot::writhe(&extended, false)
}

/// Mean tension of a thread between the inner entries of its knot \[N\].
pub fn loop_tension(rod: &RodView<'_>) -> Option<f64> {
    let [from, to] = entries(rod)?.loop_ab?;
    rod.mean_tension(from, to)
}

/// Where a thread enters its knot.
pub fn entries(rod: &RodView<'_>) -> Option<Entries> {
    knot::entries(rod.positions(), rod.rest_lengths(), rod.radius())
}
