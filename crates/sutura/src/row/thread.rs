//! Contact of thread with thread: the rows, their memory, and where new ones are needed. Their forces come from the
//! small contact problem ([`system`]).
//!
//! A row is a plane: two material places and a normal, fixed over the substep; where Newton's answer still brings two
//! pieces too near, another row is added at their present closest places.
//!
//! Friction acts at the centerline, as the normal force does. It does not turn a thread about its own axis: threads
//! slide on each other and do not roll. (Spin has next to no inertia and, on a thread whose ends are free to turn, no
//! stiffness: the compliance it adds to the small problem is a thousand times the rest, and the solve does not
//! converge.) Nor has it an arm about the other two: a thread drawn over a post of radius R would slide at its surface
//! by R / (R + r) of its way only, and over an edge not at all.
//!
//! Friction sticks to an anchor: the tangential spring's force and what the last solve left undone are carried to the
//! next substep.
//!
//! [`system`]: crate::row::system

use crate::collide::{Candidates, relative_motion};
use crate::model::Model;
use crate::motion::Motion;
use crate::params;
use crate::row::Rows;
use crate::row::side::{Endpoint, Side};
use crate::row::system::{Entry, Source, regain};
use crate::segment;
use crate::state::{Contact, Site, State};
use glam::DVec3;

/// Two places of thread that may not come nearer than `sum` along `normal`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ThreadRow {
    a: usize,
    b: usize,
    s: f64,
    t: f64,
    /// Normal from b toward a and two tangents.
    axes: [DVec3; 3],
    /// Distance kept between the centerlines \[m\] and the two radii.
    sum: f64,
    radii: [f64; 2],
    /// Normal force over depth^(3/2) \[N/m^(3/2)\] (Hertz), and the least force whose secant is taken \[N\].
    hertz: f64,
    least: f64,
    /// How many rows bear on the same patch, itself among them, were their forces equal.
    parts: f64,
    /// Compliance with which it was last in the small problem \[m/N\].
    effective_compliance: f64,
    mu: [f64; 2],
    sliding: bool,
    /// Friction force on a at the start of the substep, and slip that was still to be undone.
    friction_before: DVec3,
    residual_slip: DVec3,
    /// Force on a along the axes \[N\].
    pub force: DVec3,
    /// Left out of the small problem, it was violated.
    activate: bool,
    /// Clearance already missing at the start: what its force does not explain is won back over a few substeps, not at
    /// once.
    start_gap: f64,
    /// Depth to which its force at the start presses \[m\].
    depth_before: f64,
}

impl ThreadRow {
    fn new(model: &Model, start: &[DVec3], a: usize, b: usize, s: f64, t: f64, normal: DVec3) -> Self {
        let (ra, rb) =
            (model.rods.at(model.rod_of[a]).expect("living"), model.rods.at(model.rod_of[b]).expect("living"));
        let f = model.friction_between(ra.surface, rb.surface);
        // Tangents along and across the mean direction of a: any pair will do, this one turns with the thread.
        let along = start[a + 1] - start[a];
        let t1 =
            (along - normal * normal.dot(along)).try_normalize().unwrap_or_else(|| normal.any_orthonormal_vector());
        let sum = ra.radius + rb.radius;
        let modulus = 1.0 / (1.0 / ra.material.contact_modulus() + 1.0 / rb.material.contact_modulus());
        let hertz = 4.0 / 3.0 * modulus * (ra.radius * rb.radius).sqrt().sqrt();
        let light = params::LIGHT * sum;
        ThreadRow {
            a,
            b,
            s,
            t,
            axes: [normal, t1, normal.cross(t1)],
            sum: sum * (1.0 + params::KEEP),
            radii: [ra.radius, rb.radius],
            hertz,
            least: hertz * light * light.sqrt(),
            parts: 1.0,
            effective_compliance: 0.0,
            mu: [f.stick, f.slide],
            sliding: false,
            friction_before: DVec3::ZERO,
            residual_slip: DVec3::ZERO,
            force: DVec3::ZERO,
            activate: false,
            start_gap: 0.0,
            depth_before: 0.0,
        }
    }

    fn apart(&self, x: &[DVec3]) -> DVec3 {
        x[self.a].lerp(x[self.a + 1], self.s) - x[self.b].lerp(x[self.b + 1], self.t)
    }

    /// Slip of the two against each other since the start of the substep, as a vector.
    fn slip(&self, state: &State, motion: &Motion) -> DVec3 {
        let n = self.axes[0];
        let slip = self.apart(&state.position) - self.apart(&motion.start);
        slip - n * n.dot(slip)
    }

    fn endpoints(&self) -> [Endpoint; 2] {
        let [n, t1, t2] = self.axes;
        [Endpoint::new(self.a, self.s, self.axes), Endpoint::new(self.b, self.t, [-n, -t1, -t2])]
    }

    /// How deep its force presses the two into each other \[m\].
    pub fn depth(&self) -> f64 {
        self.force.x * self.compliance()
    }

    /// Depth over force, at the present force: a secant of Hertz' law, and below the least force a straight line.
    fn compliance(&self) -> f64 {
        let force = self.force.x.max(self.least);
        let over = force / self.hertz;
        libm::cbrt(over * over) / force
    }

    pub fn elements(&self) -> [usize; 2] {
        [self.a, self.b]
    }

    fn key(&self) -> (usize, usize) {
        (self.a, self.b)
    }

    /// Places along both threads in element units, to find rows that say the same.
    fn place(&self) -> (f64, f64) {
        (self.a as f64 + self.s, self.b as f64 + self.t)
    }
}

/// Collects the rows of the substep at its start, with room for the predicted motion, and gives them the last substep's
/// forces.
pub(crate) fn prepare(model: &Model, state: &State, motion: &Motion, candidates: &Candidates, rows: &mut Rows) {
    let start = &motion.start;
    rows.threads.clear();
    let old = state.contacts.threads();
    for (a, b) in &candidates.threads {
        let (a, b) = (*a as usize, *b as usize);
        let c = segment::closest(start[a], start[a + 1], start[b], start[b + 1]);
        let mut row = ThreadRow::new(model, start, a, b, c.s, c.t, DVec3::Z);
        let r = 0.5 * (row.radii[0] + row.radii[1]);
        let motion = relative_motion(start, &state.position, a, b).min(4.0 * r);
        let room = row.sum + params::MARGIN * r + 1.5 * motion;
        if c.apart.length_squared() > room * room {
            continue;
        }
        let kept = keep_place(old, start, a, b, &c, r);
        // Near-parallel pieces touch along a stretch: a row at each end of their overlap as well.
        let (u, v) = (start[a + 1] - start[a], start[b + 1] - start[b]);
        let cosine = u.dot(v) / (u.length() * v.length());
        let mut places = [kept; 5];
        let mut count = 1;
        if cosine * cosine > params::PARALLEL {
            for (s, t) in [(Some(0.0), None), (Some(1.0), None), (None, Some(0.0)), (None, Some(1.0))] {
                let place = match (s, t) {
                    (Some(s), _) => (s, (start[a].lerp(start[a + 1], s) - start[b]).dot(v) / v.length_squared()),
                    (_, Some(t)) => ((start[b].lerp(start[b + 1], t) - start[a]).dot(u) / u.length_squared(), t),
                    _ => continue,
                };
                let inside = |x: f64| (0.0..=1.0).contains(&x);
                if inside(place.0) && inside(place.1) && places[..count].iter().all(|p| (p.0 - place.0).abs() > 0.2) {
                    places[count] = place;
                    count += 1;
                }
            }
        }
        for (s, t) in &places[..count] {
            let apart = start[a].lerp(start[a + 1], *s) - start[b].lerp(start[b + 1], *t);
            if apart.length_squared() > room * room {
                continue;
            }
            if leans(model, candidates, start, b, *t, a, apart) || leans(model, candidates, start, a, *s, b, -apart) {
                continue;
            }
            let known = nearest_known(old, a, b, *s, *t);
            let across = if (*s, *t) == kept { c.apart } else { apart };
            let mut normal = across.try_normalize().unwrap_or(DVec3::Z);
            if let Some((k, _)) = known.filter(|(k, _)| k.normal.dot(normal) < 0.0) {
                // It was on the other side: it has been pushed through and goes back.
                normal = if apart.length() < 0.5 * row.sum { -normal } else { normal };
                if apart.length() == 0.0 {
                    normal = k.normal;
                }
            }
            row = ThreadRow::new(model, start, a, b, *s, *t, normal);
            row.start_gap = normal.dot(apart) - row.sum;
            rows.threads.push(row);
        }
    }
    merge(&mut rows.threads);
    inherit(old, &mut rows.threads);
    share(&mut rows.threads, start);
}

/// Rows that bear on one another's patch bear together what one would: a thread that crosses another one at a joint of
/// it lies in a notch, between two of them, and short elements along each other have several. Hertz' law is that of the
/// patch, so each has its part of it.
fn share(rows: &mut [ThreadRow], start: &[DVec3]) {
    let at = |e: usize, s: f64| start[e].lerp(start[e + 1], s);
    for k in 0..rows.len() {
        let row = rows[k];
        if row.force.x <= 0.0 {
            continue;
        }
        let patch = row.radii[0].min(row.radii[1]);
        // In the order of places on the first thread; the patch is at most some elements long.
        let reach = patch / start[row.a].distance(start[row.a + 1]) + 1.0;
        let from = rows.partition_point(|r| r.place().0 < row.place().0 - reach);
        let (mut sum, mut squares) = (0.0, 0.0);
        for r in rows[from..].iter().take_while(|r| r.place().0 <= row.place().0 + reach) {
            let apart = (at(r.a, r.s) - at(row.a, row.s))
                .length_squared()
                .max((at(r.b, r.t) - at(row.b, row.t)).length_squared());
            if apart < patch * patch && r.axes[0].dot(row.axes[0]) > params::SAME_PATCH {
                let near = 1.0 - apart / (patch * patch);
                sum += near * r.force.x;
                squares += near * r.force.x * r.force.x;
            }
        }
        // As many equal forces as there are: 1 where one bears nearly all of it.
        rows[k].parts = sum * sum / squares;
    }
    for row in rows.iter_mut().filter(|r| r.parts > 1.0) {
        row.hertz /= row.parts;
        row.least /= row.parts;
        row.depth_before = row.depth();
    }
}

/// Where two pieces are taken to touch: where they last did, as long as that is about as near as their closest places
/// `c`. (Within both pieces the direction is the same.) The closest places of pieces that are nearly parallel run along
/// them with the least tilt. A row that follows moves the force with it, which tilts them back, to and fro from substep
/// to substep.
fn keep_place(old: &[Contact], start: &[DVec3], a: usize, b: usize, c: &segment::Closest, radius: f64) -> (f64, f64) {
    let inside = |x: f64| x > 0.0 && x < 1.0;
    let Some((_, k)) = nearest_known(old, a, b, c.s, c.t).filter(|_| inside(c.s) && inside(c.t)) else {
        return (c.s, c.t);
    };
    let apart = start[a].lerp(start[a + 1], k[0]) - start[b].lerp(start[b + 1], k[1]);
    let (farther, allowed) = (apart.length() - c.apart.length(), params::SAME_PLACE * radius);
    let part = if farther <= allowed { 1.0 } else { (allowed / farther).sqrt() };
    (c.s + (k[0] - c.s) * part, c.t + (k[1] - c.t) * part)
}

/// Whether the element `other`, which is touched at the place `s` of element `e`, `apart` from there, lies over the
/// neighbor of `e`, which has its own row. A row's plane is fixed over the substep: one that leans toward what slides
/// along the thread is a wall at half of the way to the joint. Of a thread that folds back over itself the neighbor may
/// be one that cannot touch: only a pair among the candidates has a row.
fn leans(model: &Model, candidates: &Candidates, x: &[DVec3], e: usize, s: f64, other: usize, apart: DVec3) -> bool {
    let (neighbor, along) = match s {
        0.0 if e > 0 && model.is_element(e - 1) => (e - 1, x[e - 1] - x[e]),
        1.0 if model.is_element(e + 1) => (e + 1, x[e + 2] - x[e + 1]),
        _ => return false,
    };
    let pair = (neighbor.min(other) as u32, neighbor.max(other) as u32);
    (1e-6..1.0).contains(&(apart.dot(along) / along.length_squared()))
        && candidates.threads.binary_search(&pair).is_ok()
}

/// The last contact on the same pair of elements that is nearest in place, and its places.
fn nearest_known(old: &[Contact], a: usize, b: usize, s: f64, t: f64) -> Option<(Contact, [f64; 2])> {
    let pair = |c: &Contact| c.elements().map(|(a, b)| (a as usize, b as usize));
    let from = old.partition_point(|c| pair(c) < Some((a, b)));
    let near = old[from..].iter().take_while(|c| pair(c) == Some((a, b)));
    let far = |p: &[f64; 2]| (p[0] - s).abs() + (p[1] - t).abs();
    near.map(|c| (*c, places(c))).min_by(|x, y| far(&x.1).total_cmp(&far(&y.1)))
}

/// Places on the elements of a contact of threads.
fn places(c: &Contact) -> [f64; 2] {
    [c.a, c.b].map(|site| site.thread().map_or(0.0, |(_, s)| s))
}

/// Leaves one of rows at the same two places (neighboring elements share a particle). Only those: a row between
/// neighbors guards what its neighbor does not.
fn merge(rows: &mut Vec<ThreadRow>) {
    rows.sort_unstable_by(|x, y| x.place().0.total_cmp(&y.place().0).then(x.place().1.total_cmp(&y.place().1)));
    rows.dedup_by(|x, y| {
        let (p, q) = (x.place(), y.place());
        (p.0 - q.0).abs() < 1e-6 && (p.1 - q.1).abs() < 1e-6
    });
}

/// Gives each old contact's force and friction to the row that is nearest to it along both threads, within an element
/// and a half.
fn inherit(old: &[Contact], rows: &mut [ThreadRow]) {
    for c in old {
        let (Some((a, s)), Some((b, t))) = (c.a.thread(), c.b.thread()) else { continue };
        let (pa, pb) = (f64::from(a) + s, f64::from(b) + t);
        let from = rows.partition_point(|r| r.place().0 < pa - 1.5);
        let far = |r: &ThreadRow| {
            let p = r.place();
            (p.0 - pa).abs() + (p.1 - pb).abs()
        };
        let near = rows[from..]
            .iter_mut()
            .take_while(|r| r.place().0 <= pa + 1.5)
            .filter(|r| (r.place().1 - pb).abs() <= 1.5 && r.axes[0].dot(c.normal) > 0.0)
            .min_by(|x, y| far(x).total_cmp(&far(y)));
        if let Some(row) = near {
            let n = row.axes[0];
            let friction = c.friction - n * n.dot(c.friction);
            row.force += DVec3::new(c.normal_force, row.axes[1].dot(friction), row.axes[2].dot(friction));
            row.friction_before += friction;
            row.residual_slip = c.residual_slip - n * n.dot(c.residual_slip);
            row.sliding |= c.sliding;
            row.depth_before = row.depth();
        }
    }
}

/// Adds the rows that may act to the small problem.
pub(crate) fn add_entries(
    state: &State,
    motion: &Motion,
    step: &[DVec3],
    rows: &mut [ThreadRow],
    entries: &mut Vec<Entry>,
) {
    for (k, row) in rows.iter_mut().enumerate() {
        // Where the step without contact forces would leave the row.
        let d = |e: usize, s: f64| step[2 * e] * (1.0 - s) + step[2 * e + 2] * s;
        let moved = d(row.a, row.s) - d(row.b, row.t);
        let n = row.axes[0];
        let gap = n.dot(row.apart(&state.position)) - row.sum + n.dot(moved);
        if row.force.x <= 0.0 && !row.activate && gap > params::PRUNE * row.radii[0].min(row.radii[1]) {
            row.force = DVec3::ZERO;
            continue;
        }
        row.effective_compliance = row.compliance();
        let slip = row.slip(state, motion) + moved + row.residual_slip - row.friction_before * row.effective_compliance;
        let (allowed, normal) = regain(row.start_gap, row.depth_before, row.effective_compliance);
        let [a, b] = row.endpoints();
        entries.push(Entry {
            source: Source::Thread(k as u32),
            island: 0,
            sides: [Side::Chain(a), Side::Chain(b)],
            free: DVec3::new(gap - allowed, slip.dot(row.axes[1]), slip.dot(row.axes[2])),
            mu: row.mu[usize::from(row.sliding)],
            compliance: DVec3::new(normal, row.effective_compliance, row.effective_compliance),
            radius: row.radii[0].min(row.radii[1]),
            force: row.force,
        });
    }
}

/// Factor on the update so that no pair of centerlines comes nearer than half of the least distance allowed on the
/// straight way from the start of the substep to where the update leads; a pair that would goes most of the way there.
/// (Only that way counts, as where a substep is accepted: a prediction may have brought two pieces into or past each
/// other, and the way back is free.)
pub(crate) fn limit(state: &State, motion: &Motion, candidates: &Candidates, step: &[DVec3], scale: f64) -> f64 {
    let (x, start) = (&state.position, &motion.start);
    let mut scale = scale;
    for (a, b) in &candidates.threads {
        let (a, b) = (*a as usize, *b as usize);
        let corners = [a, a + 1, b, b + 1];
        let moved = largest_between(corners.map(|i| step[2 * i] * scale));
        let sum = candidates.radius[a] + candidates.radius[b];
        if moved < 0.2 * sum {
            continue;
        }
        let from = corners.map(|i| start[i]);
        if keeps_apart(from, corners.map(|i| x[i] + step[2 * i] * scale - start[i]), sum) {
            continue;
        }
        let c = segment::closest(x[a], x[a + 1], x[b], x[b + 1]).apart.length();
        let free = (c - 0.5 * sum).max(0.2 * sum);
        if moved > free {
            scale *= free / moved;
        }
    }
    scale
}

/// Largest difference of a vector at the ends of one element and one at those of another.
fn largest_between(v: [DVec3; 4]) -> f64 {
    let apart = |i: usize, j: usize| (v[i] - v[j]).length_squared();
    apart(0, 2).max(apart(0, 3)).max(apart(1, 2)).max(apart(1, 3)).sqrt()
}

/// Whether the centerlines of two elements stay half of `sum` apart on a straight way (conservative advancement).
fn keeps_apart(from: [DVec3; 4], way: [DVec3; 4], sum: f64) -> bool {
    let moved = largest_between(way);
    let mut u = 0.0;
    for _ in 0..20 {
        let at = |i: usize| from[i] + way[i] * u;
        let free = segment::closest(at(0), at(1), at(2), at(3)).apart.length() - 0.5 * sum;
        if free < 0.1 * sum {
            return false;
        }
        u += free / moved;
        if u >= 1.0 {
            return true;
        }
    }
    false
}

/// Adds rows where the iterate brings two pieces nearer than allowed although all rows are satisfied. True when any was
/// added, or when one was left out of the small problem.
pub(crate) fn extend(model: &Model, state: &State, motion: &Motion, candidates: &Candidates, rows: &mut Rows) -> bool {
    let start = &motion.start;
    let x = &state.position;
    let fresh = &mut rows.fresh;
    fresh.clear();
    for (a, b) in &candidates.threads {
        let (a, b) = (*a as usize, *b as usize);
        let sum = candidates.radius[a] + candidates.radius[b];
        let least = sum * (1.0 + params::KEEP - params::SLACK);
        let middle = 0.5 * (x[a] + x[a + 1] - x[b] - x[b + 1]).length()
            - 0.5 * ((x[a + 1] - x[a]).length() + (x[b + 1] - x[b]).length());
        if middle > least {
            continue;
        }
        let now = segment::closest(x[a], x[a + 1], x[b], x[b + 1]);
        let d = now.apart.length();
        if d >= least {
            continue;
        }
        let before = segment::closest(start[a], start[a + 1], start[b], start[b + 1]);
        let d0 = before.apart.length();
        if d > d0 - 1e-3 * sum && d0 < sum * (1.0 + params::KEEP) {
            continue;
        }
        if leans(model, candidates, x, b, now.t, a, now.apart) || leans(model, candidates, x, a, now.s, b, -now.apart) {
            continue;
        }
        // The side that it came from.
        let normal = now.apart.try_normalize().or_else(|| before.apart.try_normalize()).unwrap_or(DVec3::Z);
        let normal = if normal.dot(before.apart) < 0.0 { -normal } else { normal };
        let mut row = ThreadRow::new(model, start, a, b, now.s, now.t, normal);
        // Only an overlap that was there is forgiven, not that the two came round each other.
        row.start_gap = if d0 < row.sum { (normal.dot(row.apart(start)) - row.sum).min(d0 - row.sum) } else { 0.0 };
        fresh.push(row);
    }
    merge(fresh);
    let known = rows.threads.len();
    let mut found = false;
    for row in fresh.iter() {
        let same = rows.threads[..known].iter_mut().find(|r| {
            r.key() == row.key()
                && (r.s - row.s).abs() < 0.02
                && (r.t - row.t).abs() < 0.02
                && r.axes[0].dot(row.axes[0]) > 0.9999
        });
        match same {
            Some(old) => found |= !core::mem::replace(&mut old.activate, true),
            None => {
                rows.threads.push(*row);
                found = true;
            }
        }
    }
    found
}

/// What the next substep starts from: the forces, and the part of each sticking row's equation that the solve left
/// undone.
pub(crate) fn contacts<'a>(
    state: &'a State,
    motion: &'a Motion,
    rows: &'a [ThreadRow],
) -> impl Iterator<Item = Contact> + use<'a> {
    rows.iter().filter(|r| r.force.x > 0.0).map(|row| {
        let friction = row.axes[1] * row.force.y + row.axes[2] * row.force.z;
        let limit = row.mu[usize::from(row.sliding)] * row.force.x;
        let left =
            row.residual_slip + row.slip(state, motion) + (friction - row.friction_before) * row.effective_compliance;
        let at_limit = friction.length() >= params::AT_LIMIT * limit;
        let sliding = at_limit && left.length() > params::SLIP * row.radii[0].min(row.radii[1]);
        let most = params::RESIDUAL_SLIP_MOST * row.radii[0];
        Contact {
            a: Site::Thread { element: row.a as u32, s: row.s },
            b: Site::Thread { element: row.b as u32, s: row.t },
            normal: row.axes[0],
            normal_force: row.force.x,
            friction,
            residual_slip: if at_limit { DVec3::ZERO } else { left.clamp_length_max(most) },
            sliding,
        }
    })
}
