//! Which pieces may touch, and whether a substep's motion was allowed. Knows positions only; what contacts do is in
//! `row`.

pub(crate) mod overlap;
mod tree;

use crate::lanes::{Vec2, pairs};
use crate::model::body::BodyModel;
use crate::model::collider::{Collider, Distance};
use crate::model::cut::{End, Faces};
use crate::model::shape::ShapeMotion;
use crate::model::weld::{Member, WeldModel};
use crate::model::{Model, ShapeModel};
use crate::motion::Motion;
use crate::params;
use crate::rejection::Rejection;
use crate::segment;
use crate::state::State;
use core::ops::Range;
use glam::DVec3;
use tree::{Bounds, Tree};
use wide::f64x2;

/// Pairs that may touch in the substep, in array order.
#[derive(Default)]
pub(crate) struct Candidates {
    /// Elements `a < b`.
    pub threads: Vec<(u32, u32)>,
    /// Shape slot and element.
    pub shapes: Vec<(u32, u32)>,
    /// Slots of two shapes, one of them of a body.
    pub solids: Vec<(u32, u32)>,
    /// Boxes of the living shapes, all the way from the start of the substep to the iterate, in the order of their
    /// slots.
    shape_bounds: Vec<(DVec3, DVec3)>,
    /// Radius of the thread of each element \[m\].
    pub radius: Vec<f64>,
    /// Rest arc of each particle from the start of its rod \[m\].
    pub arc: Vec<f64>,
    tree: Tree,
    /// Total turning of the centerline up to each element \[rad\], at the start of the substep and at the iterate.
    turned: Vec<[f64; 2]>,
    /// The last element up to which a thread is nearly straight from each element on, at the start and at the iterate.
    straight: Vec<usize>,
}

impl Candidates {
    /// Takes up the radii of the model's threads.
    pub fn fit(&mut self, model: &Model) {
        self.radius.clear();
        self.radius.extend(model.rod_of.iter().map(|r| model.rods.at(*r).map_or(0.0, |r| r.radius)));
    }
}

/// Least clearances of an accepted state, in thread diameters.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Clearance {
    pub thread: Option<f64>,
    pub shape: Option<f64>,
}

/// Turning of a piece of thread \[rad\] up to which its own elements need not be looked at: two points on it are at
/// least cos(1 / 2) = 0.87 of the arc between them apart, 2.7 radii if they are no neighbors.
const STRAIGHT: f64 = 1.0;
/// Turning of such a piece after the substep beyond which it has to be looked at after all: cos(3 / 4) pi > 2.2.
const BENT: f64 = 1.5;

/// Total turning of two centerlines up to each element; from rod to rod it jumps.
fn turning(model: &Model, x: [&[DVec3]; 2], total: &mut Vec<[f64; 2]>) {
    total.resize(model.mass.len(), [0.0; 2]);
    let one = f64x2::splat(1.0);
    let (mut sum, mut before) = (f64x2::splat(0.0), None::<Vec2>);
    for e in 0..model.mass.len() {
        if !model.is_element(e) {
            sum += f64x2::splat(10.0 * BENT);
            before = None;
        } else {
            let d = Vec2::load(x[0][e + 1], x[1][e + 1]).less(&Vec2::load(x[0][e], x[1][e]));
            let t = d.scaled(one / d.dot(&d).sqrt());
            if let Some(b) = before {
                // The angle of unit vectors whose difference is c: 2 asin(c / 2) <= c + c^3 / 7 as c <= 2.
                let c = t.less(&b);
                let c2 = c.dot(&c);
                sum += c2.sqrt() * (one + c2 * f64x2::splat(1.0 / 7.0));
            }
            before = Some(t);
        }
        total[e] = sum.to_array();
    }
}

/// The same of one centerline, two elements at a time, in the second of the two places.
fn turning_at_end(model: &Model, x: &[DVec3], total: &mut [[f64; 2]]) {
    let one = f64x2::splat(1.0);
    let (mut sum, mut last, n) = (0.0, None, x.len());
    for (low, high) in pairs(0..n) {
        let next = |e: usize| x[(e + 1).min(n - 1)];
        let d = Vec2::load(next(low), next(high)).less(&Vec2::load(x[low], x[high]));
        let t = d.scaled(one / d.dot(&d).sqrt());
        let (first, second) = t.split();
        let c = t.less(&Vec2::load(last.unwrap_or(first), first));
        let c2 = c.dot(&c);
        let angles = (c2.sqrt() * (one + c2 * f64x2::splat(1.0 / 7.0))).to_array();
        last = Some(second);
        for (e, angle) in [low, high].into_iter().zip(angles).take(1 + high - low) {
            if !model.is_element(e) {
                sum += 10.0 * BENT;
            } else if e > 0 && model.is_element(e - 1) {
                sum += angle;
            }
            total[e][1] = sum;
        }
    }
}

/// Whether two elements, `a < b`, are so near along one thread that their overlap is bending, not contact: less than
/// half a turn of the thread's own radius. Likewise by way of a weld, and where a cut parted them: its faces are flat,
/// and the round ends that contact gives a thread lie in each other there.
#[inline]
fn neighbors(model: &Model, arc: &[f64], radius: &[f64], a: usize, b: usize) -> bool {
    arc[b] - arc[a + 1] < core::f64::consts::PI * radius[a] && model.rod_of[a] == model.rod_of[b]
        || model
            .welds
            .iter()
            .any(|(_, weld)| way_to_weld(model, arc, weld, a) + way_to_weld(model, arc, weld, b) < weld.filter_distance)
        || model.faces.iter().any(|faces| way_past_cut(model, arc, faces, a, b) < faces.filter_distance)
}

/// Rest arc between two elements by way of a cut, as if there were none; infinite where they are not on either side.
fn way_past_cut(model: &Model, arc: &[f64], faces: &Faces, a: usize, b: usize) -> f64 {
    let [first, second] = faces.ends;
    let way = |end: End, e: usize| {
        if end.rod != model.rod_of[e] {
            return f64::INFINITY;
        }
        if end.at_end { arc[end.index(model)] - arc[e + 1] } else { arc[e] }
    };
    (way(first, a) + way(second, b)).min(way(second, a) + way(first, b))
}

/// Rest arc between an element and a weld along its own thread; infinite where that is not joined there.
fn way_to_weld(model: &Model, arc: &[f64], weld: &WeldModel, e: usize) -> f64 {
    let way = |m: &Member| {
        let to = arc[m.index(model)];
        if m.rod == model.rod_of[e] { (to - arc[e + 1]).max(arc[e] - to).max(0.0) } else { f64::INFINITY }
    };
    weld.members.iter().map(way).fold(f64::INFINITY, f64::min)
}

/// Up to which way through a new weld elements of its threads do not touch: less than half a turn, or as far as they
/// overlap there now because they run into each other at an acute angle.
pub(crate) fn filter_distance(model: &Model, x: &[DVec3], weld: &WeldModel) -> f64 {
    // Where legs that meet at an angle a are a diameter apart they are r / sin(a / 2) long: 40 radii at 3 degrees.
    const FARTHEST: f64 = 40.0;
    let mut arc = Vec::new();
    arcs(model, &mut arc);
    let radius = |e: usize| model.rods.at(model.rod_of[e]).map_or(0.0, |r| r.radius);
    let near = |e: &usize| model.is_element(*e) && way_to_weld(model, &arc, weld, *e) < FARTHEST * radius(*e);
    let legs: Vec<usize> = (0..model.mass.len()).filter(near).collect();
    let mut filter_distance = weld.filter_distance;
    for (k, a) in legs.iter().enumerate() {
        for b in &legs[k + 1..] {
            let own =
                model.rod_of[*a] == model.rod_of[*b] && arc[*b] - arc[*a + 1] < core::f64::consts::PI * radius(*a);
            let apart = segment::closest(x[*a], x[*a + 1], x[*b], x[*b + 1]).apart.length();
            if !own && apart < (radius(*a) + radius(*b)) * (1.0 + params::KEEP) {
                let way = way_to_weld(model, &arc, weld, *a) + way_to_weld(model, &arc, weld, *b);
                filter_distance = filter_distance.max(way + 0.01 * radius(*a));
            }
        }
    }
    filter_distance
}

/// Up to which way from a new weld on a body elements of its threads do not touch the body: half a turn of the thread,
/// or as far as they are in it or at it now.
pub(crate) fn filter_distance_on_body(model: &Model, state: &State, weld: &WeldModel) -> f64 {
    let Some(body) = weld.anchor.and_then(|a| model.bodies.at(a.body)) else { return 0.0 };
    let mut filter_distance = 0.0_f64;
    for member in &weld.members {
        let rod = model.rods.at(member.rod).expect("welds go with their rods");
        let (i, r) = (member.index(model), rod.radius);
        let touches = |e: usize| {
            let ends = [state.position[e], state.position[e + 1]];
            body.shapes.iter().any(|(shape, _)| {
                let pose = &state.shape_pose[*shape as usize];
                let collider = &model.shapes.at(*shape).expect("shapes live with their body").collider;
                collider.segment_distance(ends.map(|p| pose.inverse_transform_point(p)), 1.1 * r).is_some()
            })
        };
        let way = |e: usize| {
            if e < i {
                (e + 1..i).map(|k| model.rest_length[k]).sum()
            } else {
                (i..e).map(|k| model.rest_length[k]).sum::<f64>()
            }
        };
        let mut filter = core::f64::consts::PI * r;
        let (before, after) = ((rod.elements().start..i).rev(), i..rod.elements().end);
        for e in before.take_while(|e| touches(*e)).chain(after.take_while(|e| touches(*e))) {
            filter = filter.max(way(e) + 0.01 * r);
        }
        filter_distance = filter_distance.max(filter);
    }
    filter_distance
}

/// Whether an element is held by the body that a shape is part of, so near that they do not touch.
fn attached(model: &Model, arc: &[f64], shape: &ShapeModel, e: usize) -> bool {
    shape.body.is_some_and(|body| {
        model.welds.iter().any(|(_, weld)| {
            weld.anchor.is_some_and(|a| a.body == body && way_to_weld(model, arc, weld, e) < a.filter_distance)
        })
    })
}

/// Rest arc of each particle from the start of its rod.
fn arcs(model: &Model, arc: &mut Vec<f64>) {
    arc.resize(model.mass.len(), 0.0);
    let mut s = 0.0;
    for (arc, l) in arc.iter_mut().zip(&model.rest_length) {
        *arc = s;
        s = if *l > 0.0 { s + l } else { 0.0 };
    }
}

/// Fills the candidates with all pairs that come within reach of each other between the start of the substep and the
/// iterate, with room for what Newton will add.
pub(crate) fn detect(model: &Model, state: &State, motion: &Motion, candidates: &mut Candidates) {
    let Motion { start, start_shape_pose, .. } = motion;
    let Candidates { threads, shapes, solids, shape_bounds, radius, arc, tree, turned, straight } = candidates;
    let n = model.mass.len();
    arcs(model, arc);
    turning(model, [start, &state.position], turned);
    straight.resize(n, 0);
    let mut last = 0;
    for e in 0..n {
        last = last.max(e);
        let [at_start, at_end] = turned[e];
        while turned.get(last + 1).is_some_and(|t| t[0] - at_start <= STRAIGHT && t[1] - at_end <= STRAIGHT) {
            last += 1;
        }
        straight[e] = last;
    }
    // Where each particle goes.
    let way = |i: usize| {
        let (from, to) = (start[i], state.position[i]);
        Bounds { lo: from.min(to), hi: from.max(to) }
    };
    let mut next = if n > 0 { way(0) } else { Bounds::EMPTY };
    tree.fill(n, |e| {
        let here = next;
        if e + 1 < n {
            next = way(e + 1);
        }
        if model.is_element(e) { here.union(&next).grown(radius[e] * (1.0 + params::REACH)) } else { Bounds::EMPTY }
    });
    threads.clear();
    let skip = |leaves: Range<usize>| leaves.start >= n || straight[leaves.start] + 1 >= leaves.end.min(n);
    tree.pairs(skip, |a, b| {
        if !neighbors(model, arc, radius, a, b) {
            threads.push((a as u32, b as u32));
        }
    });
    threads.sort_unstable();
    shapes.clear();
    shape_bounds.clear();
    for (slot, shape) in model.shapes.iter() {
        let k = slot as usize;
        let (lo, hi) = shape.collider.swept_bounds(&start_shape_pose[k], &state.shape_pose[k]);
        shape_bounds.push((lo, hi));
        // A plane's box is everything: it overlaps the empty leaves as well.
        tree.overlapping(&Bounds { lo, hi }, |e| {
            if e < model.mass.len() && model.is_element(e) && !attached(model, arc, shape, e) {
                shapes.push((slot, e as u32));
            }
        });
    }
    shapes.sort_unstable();
    solids.clear();
    if model.bodies.len() == 0 {
        return;
    }
    let living = || model.shapes.iter().zip(&*shape_bounds);
    for (k, ((a, first), (lo, hi))) in living().enumerate() {
        for ((b, second), (other_lo, other_hi)) in living().skip(k + 1) {
            let size =
                [a, b].iter().filter_map(|s| model.body_of(*s)).map(BodyModel::size).fold(f64::INFINITY, f64::min);
            let room = DVec3::splat(params::MARGIN * size);
            let moves = [first, second].iter().any(|s| s.body.is_some_and(|b| state.gives_way(b)));
            let near = moves && (*lo - room).cmple(*other_hi).all() && (*hi + room).cmpge(*other_lo).all();
            let root = |s: &ShapeModel| s.body.map(|b| state.root_of(b));
            if near && root(first) != root(second) && !model.apart(first.body, second.body) {
                solids.push((a, b));
            }
        }
    }
}

/// Why a motion is refused, and because of which rods.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Refused {
    pub reason: Rejection,
    pub rods: [u32; 2],
}

/// Says how deep contact forces press pieces into each other \[m\].
pub(crate) trait Pressed {
    /// Two elements or their neighbors.
    fn threads(&self, a: usize, b: usize) -> f64;
    /// An element or its neighbors into a shape.
    fn shape(&self, shape: u32, element: usize) -> f64;
}

/// Judges the motion from the start of the substep to the iterate: nothing may overlap by more than the tolerance and
/// still approach, nothing may have passed through.
pub(crate) fn sweep(
    model: &Model,
    state: &State,
    motion: &Motion,
    candidates: &mut Candidates,
    pressed: &impl Pressed,
) -> Result<Clearance, Refused> {
    if outran(model, state, candidates) {
        detect(model, state, motion, candidates);
    }
    let mut clearance = Clearance::default();
    let Motion { start, start_shape_pose, .. } = motion;
    let radius = &candidates.radius;
    let x = &state.position;
    for (a, b) in &candidates.threads {
        let (a, b) = (*a as usize, *b as usize);
        let sum = radius[a] + radius[b];
        let moved = relative_motion(start, x, a, b);
        // Cheap bound from the middles before the exact distance.
        let reach = 0.5 * ((x[a + 1] - x[a]).length() + (x[b + 1] - x[b]).length());
        let apart = 0.5 * (x[a] + x[a + 1] - x[b] - x[b + 1]).length() - reach;
        if apart - moved > 1.5 * sum {
            continue;
        }
        let now = segment::closest(x[a], x[a + 1], x[b], x[b + 1]).apart.length();
        let gap = (now - sum) / sum;
        clearance.thread = Some(clearance.thread.map_or(gap, |c| c.min(gap)));
        if now >= sum && moved < 0.5 * sum {
            continue;
        }
        let before = segment::closest(start[a], start[a + 1], start[b], start[b + 1]).apart.length();
        if gap < -params::OVERLAP && params::overlaps((before - sum) / sum, gap, pressed.threads(a, b) / sum) {
            return Err(Refused { reason: Rejection::ThreadOverlap, rods: [model.rod_of[a], model.rod_of[b]] });
        }
        if before - moved < params::PASS * sum && passes(start, x, a, b, params::PASS * sum.min(before)) {
            return Err(Refused { reason: Rejection::ThreadPassage, rods: [model.rod_of[a], model.rod_of[b]] });
        }
    }
    // Neighboring elements share a particle.
    let mut last: Option<((u32, usize), Distance)> = None;
    for (slot, e) in &candidates.shapes {
        let (k, e) = (*slot as usize, *e as usize);
        let shape = model.shapes.at(*slot).expect("candidate shapes live");
        let collider = &shape.collider;
        let r = radius[e];
        let refused = |reason| Refused { reason, rods: [model.rod_of[e]; 2] };
        let (start_pose, pose) = (&start_shape_pose[k], &state.shape_pose[k]);
        let from = [start[e], start[e + 1]].map(|p| start_pose.inverse_transform_point(p));
        let to = [x[e], x[e + 1]].map(|p| pose.inverse_transform_point(p));
        let first =
            last.filter(|(at, _)| *at == (*slot, e)).map_or_else(|| collider.distance_local(to[0]), |(_, seen)| seen);
        let second = collider.distance_local(to[1]);
        last = Some(((*slot, e + 1), second));
        let mut judge = |s: f64, value: f64| {
            let gap = (value - r) / (2.0 * r);
            clearance.shape = Some(clearance.shape.map_or(gap, |c| c.min(gap)));
            if gap >= -params::OVERLAP {
                return Ok(());
            }
            let before = collider.distance_local(from[0].lerp(from[1], s)).value;
            let pressed = pressed.shape(*slot, e) / (2.0 * r);
            if params::overlaps((before - r) / (2.0 * r), gap, pressed) {
                Err(refused(Rejection::ShapeOverlap))
            } else {
                Ok(())
            }
        };
        judge(0.0, first.value)?;
        judge(1.0, second.value)?;
        // A distance grows no faster than the way.
        let below = r * (1.0 - 2.0 * params::OVERLAP);
        if first.value.min(second.value) - 0.5 * (to[1] - to[0]).length() < below {
            let mut verdict = Ok(());
            collider.least_between(to, [first, second], below, |s, d| {
                if verdict.is_ok() {
                    verdict = judge(s, d.value);
                }
            });
            verdict?;
        }
        // Seen from the shape, whichever of the two moves.
        let moved = (to[0] - from[0]).length().max((to[1] - from[1]).length());
        let near = first.value.min(second.value) - 0.5 * (to[1] - to[0]).length() - moved;
        if near < params::PASS_SHAPE * r
            && moved > 0.5 * params::PASS_SHAPE * r
            && passes_shape(collider, from, to, moved, params::PASS_SHAPE * r)
        {
            return Err(refused(Rejection::ShapePassage));
        }
    }
    Ok(clearance)
}

/// Whether the iterate, or a shape that is pushed, left the boxes in which candidates were sought, or bent a piece that
/// was taken as straight.
fn outran(model: &Model, state: &State, candidates: &mut Candidates) -> bool {
    let radius = &candidates.radius;
    let x = &state.position;
    let left = (0..model.mass.len()).filter(|e| model.is_element(*e)).any(|e| {
        let b = candidates.tree.leaf(e);
        let keep = DVec3::splat(radius[e] * 1.1);
        let (lo, hi) = (b.lo + keep, b.hi - keep);
        x[e].min(x[e + 1]).cmplt(lo).any() || x[e].max(x[e + 1]).cmpgt(hi).any()
    });
    let pushed = model
        .shapes
        .iter()
        .zip(&candidates.shape_bounds)
        .filter(|((_, s), _)| matches!(s.motion, ShapeMotion::Pushed { .. } | ShapeMotion::OnBody))
        .any(|((slot, shape), (lo, hi))| {
            let (now_lo, now_hi) = shape.collider.bounds(&state.shape_pose[slot as usize]);
            now_lo.cmplt(*lo).any() || now_hi.cmpgt(*hi).any()
        });
    left || pushed || {
        // Both lanes the same: there is one centerline to look at.
        turning_at_end(model, x, &mut candidates.turned);
        let end = &candidates.turned;
        candidates.straight.iter().enumerate().any(|(a, b)| end[*b][1] - end[a][1] > BENT)
    }
}

/// Largest relative move of two points of the two elements.
#[inline]
pub(crate) fn relative_motion(from: &[DVec3], to: &[DVec3], a: usize, b: usize) -> f64 {
    let d = |i: usize| to[i] - from[i];
    let (a0, a1, b0, b1) = (d(a), d(a + 1), d(b), d(b + 1));
    (a0 - b0)
        .length_squared()
        .max((a0 - b1).length_squared())
        .max((a1 - b0).length_squared())
        .max((a1 - b1).length_squared())
        .sqrt()
}

/// Whether the centerlines come nearer than `least` on the straight way between two states (conservative advancement:
/// at distance d no contact can come before d / relative motion).
fn passes(from: &[DVec3], to: &[DVec3], a: usize, b: usize, least: f64) -> bool {
    let moved = relative_motion(from, to, a, b);
    let mut u = 0.0;
    for _ in 0..200 {
        let p = |i: usize| from[i].lerp(to[i], u);
        let d = segment::closest(p(a), p(a + 1), p(b), p(b + 1)).apart.length();
        if d < least {
            return true;
        }
        u += ((d - 0.9 * least) / moved).max(1e-3);
        if u >= 1.0 {
            return false;
        }
    }
    true
}

/// The same for an element and a shape, both ends given in the frame of the shape.
fn passes_shape(collider: &Collider, from: [DVec3; 2], to: [DVec3; 2], moved: f64, least: f64) -> bool {
    // Nothing is nearer than where it came from and where it went to, less half of the way.
    let Some((_, before)) = collider.segment_distance(from, least + moved) else { return false };
    // From an overlap any way out is good.
    let least = least.min(0.9 * before);
    if least <= 0.0 {
        return collider.segment_distance(to, before.min(0.0)).is_some();
    }
    let mut u = 0.0;
    for _ in 0..200 {
        let at = [0, 1].map(|k| from[k].lerp(to[k], u));
        match collider.segment_distance(at, least + moved * (1.0 - u)) {
            // The rest of the way is too short.
            None => return false,
            Some((_, d)) if d < least => return true,
            Some((_, d)) => u += ((d - 0.9 * least) / moved).max(1e-3),
        }
        if u >= 1.0 {
            return false;
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Material, RodSpec, World};

    struct Unpressed;

    impl Pressed for Unpressed {
        fn threads(&self, _: usize, _: usize) -> f64 {
            0.0
        }
        fn shape(&self, _: u32, _: usize) -> f64 {
            0.0
        }
    }

    /// A straight thread of 100 elements of one radius each, at the start of a substep in which nothing moves.
    fn straight_thread() -> (Model, State, Motion, Candidates, f64) {
        let r = 1e-4;
        let mut world = World::default();
        world
            .insert_rod(&RodSpec::straight(DVec3::ZERO, DVec3::X * (100.0 * r), 100, r, Material::elastic(1e9, 1000.0)))
            .unwrap();
        let (model, state) = world.into_parts();
        let (mut motion, mut candidates) = (Motion::default(), Candidates::default());
        motion.fit(&model);
        candidates.fit(&model);
        motion.start.copy_from_slice(&state.position);
        (model, state, motion, candidates, r)
    }

    #[test]
    fn a_straight_thread_has_no_candidates_and_a_fold_of_it_is_found_after_all() {
        let (model, mut state, motion, mut candidates, r) = straight_thread();
        detect(&model, &state, &motion, &mut candidates);
        assert!(candidates.threads.is_empty());
        assert!(sweep(&model, &state, &motion, &mut candidates, &Unpressed).is_ok());
        // The second half back along the first, one radius beside it.
        for i in 51..=100 {
            state.position[i] = state.position[100 - i] + DVec3::Y * r;
        }
        assert!(sweep(&model, &state, &motion, &mut candidates, &Unpressed).is_err());
    }

    #[test]
    fn only_pieces_that_bend_are_searched() {
        let (model, mut state, mut motion, mut candidates, r) = straight_thread();
        // A hairpin of radius 2 r in the middle.
        let turn = 7;
        for i in 50..=100 {
            let angle = (f64::from(i as u32 - 50) / f64::from(turn)).min(1.0) * core::f64::consts::PI;
            state.position[i] = state.position[50] + DVec3::new(angle.sin(), 1.0 - angle.cos(), 0.0) * (2.0 * r);
            if i > 50 + turn as usize {
                state.position[i] -= DVec3::X * (r * (i - 50 - turn as usize) as f64);
            }
        }
        motion.start.copy_from_slice(&state.position);
        detect(&model, &state, &motion, &mut candidates);
        let pairs = &candidates.threads;
        // The legs are 4 r apart, so each element of one is in reach of some of the other; no pair lies within one leg.
        assert!(pairs.iter().all(|(a, b)| *b >= 50 && *a < 57), "{pairs:?}");
        assert!((10..50).all(|a| pairs.iter().any(|(x, _)| *x == a)));
    }
}
