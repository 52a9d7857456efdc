//! What lies in each other at one state, whatever brought it there. Nothing here judges a motion (`sweep` does): a
//! thread may be inserted across another one, a shape put onto a thread.
//!
//! Contact parts what is pressed into each other as long as the centerlines say where to. Where a centerline runs
//! within another thread, in a solid or across a mesh, what comes of it is a knot that nobody tied, or none.
//!
//! Left out is what contact leaves out (neighbors along a thread, through a weld and at a cut), and what is pressed in
//! by less than `PRESSED`.

use super::tree::{Bounds, Tree};
use super::{arcs, attached, neighbors, turning};
use crate::handle::Handle;
use crate::math::Pose;
use crate::model::collider::Collider;
use crate::model::cut::Faces;
use crate::model::mesh::solid_angle;
use crate::model::rod::Rod;
use crate::model::shape::{Geometry, Shape};
use crate::model::{Model, ShapeModel};
use crate::params;
use crate::segment;
use crate::state::State;
use core::ops::Range;
use glam::DVec3;
use std::collections::BTreeMap;

/// A place where a thread lies in a thread or a shape: the deepest of the pieces that lie in each other there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Overlap {
    /// The thread.
    pub rod: Handle<Rod>,
    /// Where on it, rest length from its start \[m\].
    pub arc: f64,
    /// What it lies in.
    pub with: OverlapWith,
    /// World point of the place \[m\]: halfway between two centerlines; with a shape on that of the thread.
    pub point: DVec3,
    /// How deep \[m\]: the sum of radii less the distance of centerlines; the radius less the distance of the
    /// centerline from the surface, which is negative in a solid.
    pub depth: f64,
    /// The same over the diameter of the thread, of two their mean.
    pub diameters: f64,
    /// Whether a centerline runs within the other thread, in the solid or across the mesh: contact cannot know on which
    /// side of it the thread belongs. What is only pressed into each other is pushed apart.
    pub through: bool,
}

/// What a thread lies in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum OverlapWith {
    /// A thread, another one or itself.
    Rod {
        /// Which.
        rod: Handle<Rod>,
        /// Where on it, rest length from its start \[m\].
        arc: f64,
    },
    /// A shape.
    Shape(Handle<Shape>),
}

impl Overlap {
    /// How it lies in the other.
    pub fn verb(&self) -> &'static str {
        match (self.through, self.with) {
            (false, _) => "is pressed into",
            (true, OverlapWith::Rod { .. }) => "passes through",
            (true, OverlapWith::Shape(_)) => "lies in",
        }
    }
}

/// One pair of elements that lie in each other.
struct Pair {
    a: usize,
    b: usize,
    s: f64,
    t: f64,
    apart: f64,
    /// Whether they are all but neighbors along the thread, or through a weld: then this is a bend or a fork.
    fold: bool,
}

/// One element in a shape.
struct Hit {
    element: usize,
    s: f64,
    /// Of the centerline from the surface, negative in a solid.
    distance: f64,
    crosses: bool,
}

/// All that lies in each other, threads first, in the order of their elements.
pub(crate) fn overlaps(model: &Model, state: &State) -> Vec<Overlap> {
    let n = model.mass.len();
    if n == 0 {
        return Vec::new();
    }
    let mut arc = Vec::new();
    arcs(model, &mut arc);
    let radius: Vec<f64> = (0..n).map(|e| model.rods.at(model.rod_of[e]).map_or(0.0, |r| r.radius)).collect();
    let x = &state.position;
    let mut tree = Tree::default();
    tree.fill(n, |e| if model.is_element(e) { Bounds::of(&[x[e], x[e + 1]], radius[e]) } else { Bounds::EMPTY });
    let seen = Seen { model, state, arc, radius };
    let mut found = seen.threads(&mut tree);
    for (slot, shape) in model.shapes.iter() {
        seen.shape(slot, shape, &mut tree, &mut found);
    }
    found
}

struct Seen<'a> {
    model: &'a Model,
    state: &'a State,
    arc: Vec<f64>,
    radius: Vec<f64>,
}

impl Seen<'_> {
    fn place(&self, e: usize, s: f64) -> (Handle<Rod>, f64) {
        (self.model.rods.handle(self.model.rod_of[e]), self.arc[e] + s * self.model.rest_length[e])
    }

    fn threads(&self, tree: &mut Tree) -> Vec<Overlap> {
        let Seen { model, state, arc, radius } = self;
        let (n, x) = (model.mass.len(), &state.position);
        // What is nearly straight does not meet itself.
        let mut turned = Vec::new();
        turning(model, [x, x], &mut turned);
        let straight = |range: Range<usize>| {
            range.start >= n || turned[range.end.min(n) - 1][0] - turned[range.start][0] <= super::STRAIGHT
        };
        let mut pairs: BTreeMap<(usize, usize), Pair> = BTreeMap::new();
        tree.pairs(straight, |a, b| {
            if neighbors(model, arc, radius, a, b) {
                return;
            }
            let c = segment::closest(x[a], x[a + 1], x[b], x[b + 1]);
            let (apart, sum) = (c.apart.length(), radius[a] + radius[b]);
            if sum - apart > params::PRESSED * sum {
                // One element more on each side would do.
                let next = |e: usize| if model.is_element(e) { model.rest_length[e] } else { 0.0 };
                let room = next(a) + next(b);
                let along = model.rod_of[a] == model.rod_of[b]
                    && arc[b] - arc[a + 1] < core::f64::consts::PI * radius[a] + room;
                let fork = |w: &crate::model::weld::WeldModel| {
                    super::way_to_weld(model, arc, w, a) + super::way_to_weld(model, arc, w, b)
                        < w.filter_distance + room
                };
                let faces = |f: &Faces| super::way_past_cut(model, arc, f, a, b) < f.filter_distance + room;
                let fold = along || model.welds.iter().any(|(_, w)| fork(w)) || model.faces.iter().any(faces);
                pairs.insert((a, b), Pair { a, b, s: c.s, t: c.t, apart, fold });
            }
        });
        // Pieces that belong together: neighboring elements of the one in neighboring elements of the other.
        let mut found = Vec::new();
        while let Some((_, first)) = pairs.pop_first() {
            let (mut stack, mut deepest) = (vec![first], None::<Pair>);
            let (mut through, mut fold) = (false, false);
            while let Some(pair) = stack.pop() {
                for i in pair.a.saturating_sub(1)..=pair.a + 1 {
                    for j in pair.b.saturating_sub(1)..=pair.b + 1 {
                        stack.extend(pairs.remove(&(i, j)));
                    }
                }
                through |= pair.apart < radius[pair.a].max(radius[pair.b]);
                fold |= pair.fold;
                let depth = |p: &Pair| radius[p.a] + radius[p.b] - p.apart;
                if deepest.as_ref().is_none_or(|d| depth(d) < depth(&pair)) {
                    deepest = Some(pair);
                }
            }
            let Some(pair) = deepest else { continue };
            let Pair { a, b, .. } = pair;
            let ((rod, arc), (other, other_arc)) = (self.place(a, pair.s), self.place(b, pair.t));
            let depth = radius[a] + radius[b] - pair.apart;
            found.push(Overlap {
                rod,
                arc,
                with: OverlapWith::Rod { rod: other, arc: other_arc },
                point: (x[a].lerp(x[a + 1], pair.s) + x[b].lerp(x[b + 1], pair.t)) * 0.5,
                depth,
                diameters: depth / (radius[a] + radius[b]),
                through: through && !fold,
            });
        }
        found
    }

    fn shape(&self, slot: u32, shape: &ShapeModel, tree: &mut Tree, found: &mut Vec<Overlap>) {
        let Seen { model, state, radius, .. } = self;
        let (n, x, pose) = (model.mass.len(), &state.position, &state.shape_pose[slot as usize]);
        let mut elements = Vec::new();
        if shape.container {
            elements.extend(0..n);
        } else {
            let (lo, hi) = shape.collider.bounds(pose);
            // A plane's box is everything: it overlaps the empty leaves as well.
            tree.overlapping(&Bounds { lo, hi }, |e| elements.extend((e < n).then_some(e)));
        }
        elements.retain(|e| model.is_element(*e) && !attached(model, &self.arc, shape, *e));
        elements.sort_unstable();
        let mut hits: Vec<Hit> = Vec::new();
        // Whether the start of the next element is in the solid, while that is known.
        let mut inside: Option<(usize, bool)> = None;
        for e in elements {
            let (a, b) = (x[e], x[e + 1]);
            let mut hit = if matches!(shape.geometry, Geometry::Mesh { .. }) {
                let crossing = crossing(&shape.collider, pose, a, b);
                let within = shape.closed
                    && inside.filter(|(at, _)| *at == e).map_or_else(|| in_solid(shape, pose, a), |(_, is)| is);
                let beyond = if crossing.is_some() { shape.closed && in_solid(shape, pose, b) } else { within };
                inside = Some((e + 1, beyond));
                match crossing {
                    Some(s) => {
                        let ends = [(0.0, a, within), (1.0, b, beyond)].into_iter().filter(|end| end.2);
                        let deep = |(s, p, _)| (s, -shape.collider.distance(pose, p).value.abs());
                        let (s, distance) =
                            ends.map(deep).fold((s, 0.0), |best, end| if end.1 < best.1 { end } else { best });
                        Hit { element: e, s, distance, crosses: true }
                    }
                    None => {
                        let away = |s: f64| shape.collider.distance(pose, a.lerp(b, s)).value.abs();
                        let middle = away(0.5);
                        let (s, distance) = if within {
                            // As deep as the deepest particle; searching between them costs more than it tells.
                            [(0.0, -away(0.0)), (0.5, -middle), (1.0, -away(1.0))]
                                .into_iter()
                                .fold((0.0, 0.0), |l, p| if p.1 < l.1 { p } else { l })
                        } else if middle - 0.5 * a.distance(b) > radius[e] {
                            // A distance grows no faster than the way.
                            continue;
                        } else {
                            least(away)
                        };
                        Hit { element: e, s, distance, crosses: false }
                    }
                }
            } else {
                let (s, d) = least(|s| shape.collider.distance(pose, a.lerp(b, s)).value);
                Hit { element: e, s, distance: d, crosses: false }
            };
            hit.crosses |= hit.distance < 0.0;
            if radius[e] - hit.distance > 2.0 * params::PRESSED * radius[e] {
                hits.push(hit);
            }
        }
        for piece in hits.chunk_by(|a, b| a.element + 1 == b.element) {
            let Some(deepest) = piece.iter().min_by(|a, b| a.distance.total_cmp(&b.distance)) else { continue };
            let Hit { element: e, s, distance, .. } = *deepest;
            let ((rod, arc), depth) = (self.place(e, s), radius[e] - distance);
            found.push(Overlap {
                rod,
                arc,
                with: OverlapWith::Shape(model.shapes.handle(slot)),
                point: x[e].lerp(x[e + 1], s),
                depth,
                diameters: depth / (2.0 * radius[e]),
                through: piece.iter().any(|h| h.crosses),
            });
        }
    }
}

/// Where on an element its centerline crosses a mesh.
fn crossing(collider: &Collider, pose: &Pose, a: DVec3, b: DVec3) -> Option<f64> {
    let Collider::Surface(surface) = collider else { return None };
    surface.crossing([a, b].map(|p| pose.inverse_transform_point(p)))
}

/// Whether a point lies in the solid of a closed mesh, by the solid angle under which it sees the surface.
fn in_solid(shape: &ShapeModel, pose: &Pose, point: DVec3) -> bool {
    let Geometry::Mesh { vertices, triangles } = &shape.geometry else { return false };
    let local = pose.inverse_transform_point(point);
    let angle: f64 = triangles.iter().map(|t| solid_angle(t.map(|c| vertices[c as usize] - local))).sum();
    // Of a container the surroundings are solid, and its inside sees the whole sphere from behind.
    let turns = angle / (2.0 * core::f64::consts::TAU) + f64::from(u8::from(shape.container));
    turns > 0.5
}

/// The least of a function on [0, 1] and where it is: that of a convex one within a ten thousandth. Where it is not a
/// number, as in the very middle of a ball, it does not count.
fn least(at: impl Fn(f64) -> f64) -> (f64, f64) {
    const GOLDEN: f64 = 0.381_966_011_250_105;
    let mut best = (0.0, at(0.0));
    for s in [0.5, 1.0] {
        let d = at(s);
        if d < best.1 || best.1.is_nan() {
            best = (s, d);
        }
    }
    let (mut lo, mut hi) = ((best.0 - 0.5_f64).max(0.0), (best.0 + 0.5).min(1.0));
    for _ in 0..20 {
        let (s, t) = (lo + GOLDEN * (hi - lo), hi - GOLDEN * (hi - lo));
        let (d, f) = (at(s), at(t));
        if d.min(f) < best.1 {
            best = if d < f { (s, d) } else { (t, f) };
        }
        if d < f {
            hi = t;
        } else {
            lo = s;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Material, RodSpec, ShapeSpec, World};
    use proptest::prelude::*;

    const R: f64 = 1e-4;

    fn line(from: DVec3, to: DVec3) -> RodSpec {
        RodSpec::straight(from, to, 20, R, Material::elastic(1e9, 1000.0))
    }

    fn world(rods: &[RodSpec]) -> World {
        let mut world = World::default();
        for rod in rods {
            world.insert_rod(rod).unwrap();
        }
        world
    }

    proptest! {
        /// Two straight threads at any distance and angle: the place and the depth that geometry gives.
        #[test]
        fn crossed_threads(angle in 0.3_f64..1.5, s in 0.1_f64..0.9, t in 0.1_f64..0.9, apart in 0.0_f64..2.5) {
            let along = DVec3::new(angle.cos(), angle.sin(), 0.0) * 0.02;
            let at = DVec3::X * 0.02 * s + DVec3::Z * (apart * R);
            let w = world(&[line(DVec3::ZERO, DVec3::X * 0.02), line(at - along * t, at + along * (1.0 - t))]);
            let found = w.overlaps();
            let depth = 2.0 - apart;
            prop_assert_eq!(found.len(), usize::from(depth > 0.2));
            if let Some(o) = found.first() {
                let OverlapWith::Rod { arc, .. } = o.with else { panic!() };
                prop_assert!((o.arc - 0.02 * s).abs() < 1e-12 && (arc - 0.02 * t).abs() < 1e-12);
                prop_assert!((o.depth - depth * R).abs() < 1e-14 && (o.diameters - 0.5 * depth).abs() < 1e-10);
                prop_assert!((o.point - DVec3::X * 0.02 * s - DVec3::Z * (0.5 * apart * R)).length() < 1e-12);
                prop_assert_eq!(o.through, apart < 1.0);
            }
        }

        /// The same in a mesh of a box and in the box: alike, wherever it is.
        #[test]
        fn a_solid_and_its_mesh(x in -2e-3..2e-3, y in -2e-3..2e-3, z in -1.5e-3..1.5e-3, turn in 0.0..3.0) {
            let half = 1e-3;
            let sign = |b: u32| if b == 0 { -half } else { half };
            let vertices: Vec<DVec3> = (0..8).map(|k| DVec3::new(sign(k & 1), sign(k >> 1 & 1), sign(k >> 2))).collect();
            let triangles = vec![[0, 3, 1], [0, 2, 3], [4, 7, 6], [4, 5, 7], [0, 5, 4], [0, 1, 5], [2, 7, 3], [2, 6, 7], [0, 6, 2], [0, 4, 6], [1, 7, 5], [1, 3, 7]];
            let pose = Pose::new(DVec3::new(x, y, z), glam::DQuat::from_rotation_z(turn));
            let in_it = |geometry: Geometry| {
                let mut w = world(&[line(DVec3::X * -4e-3, DVec3::X * 4e-3)]);
                w.insert_shape(&ShapeSpec::fixed(geometry, pose)).unwrap();
                w.overlaps()
            };
            let (solid, mesh) = (in_it(Geometry::Box { half_sides: DVec3::splat(half) }), in_it(Geometry::Mesh { vertices, triangles }));
            prop_assert_eq!(solid.len(), mesh.len());
            for (a, b) in solid.iter().zip(&mesh) {
                prop_assert_eq!(a.through, b.through);
                // What crosses the surface between two particles is as deep in the mesh as the deepest place of the
                // other elements.
                prop_assert!((a.depth - b.depth).abs() < if a.through { 2.5e-4 } else { 1e-8 }, "{:?} {:?}", a, b);
            }
        }
    }

    #[test]
    fn a_thread_through_the_middle_of_each_solid() {
        for geometry in [
            Geometry::Sphere { radius: 1e-3 },
            Geometry::Capsule { radius: 1e-3, half_length: 1e-3 },
            Geometry::Cylinder { radius: 1e-3, half_length: 1e-3 },
            Geometry::Box { half_sides: DVec3::splat(1e-3) },
        ] {
            let mut w = world(&[line(DVec3::X * -4e-3, DVec3::X * 4e-3)]);
            let shape = w.insert_shape(&ShapeSpec::fixed(geometry, Pose::IDENTITY)).unwrap();
            let found = w.overlaps();
            assert_eq!(found.len(), 1);
            let o = found[0];
            assert!(
                o.with == OverlapWith::Shape(shape)
                    && o.through
                    && (o.depth - 1.1e-3).abs() < 2e-8
                    && (o.arc - 4e-3).abs() < 1e-6,
                "{o:?}"
            );
        }
    }

    #[test]
    fn a_container_holds_what_is_inside_and_nothing_else() {
        let half = 1e-3;
        let sign = |b: u32| if b == 0 { -half } else { half };
        let vertices: Vec<DVec3> = (0..8).map(|k| DVec3::new(sign(k & 1), sign(k >> 1 & 1), sign(k >> 2))).collect();
        let triangles = vec![
            [0, 1, 3],
            [0, 3, 2],
            [4, 6, 7],
            [4, 7, 5],
            [0, 4, 5],
            [0, 5, 1],
            [2, 3, 7],
            [2, 7, 6],
            [0, 2, 6],
            [0, 6, 4],
            [1, 5, 7],
            [1, 7, 3],
        ];
        let geometry = Geometry::Mesh { vertices, triangles };
        let inside = |from: f64, to: f64| {
            let mut w = world(&[line(DVec3::X * from, DVec3::X * to)]);
            w.insert_shape(&ShapeSpec::fixed(geometry.clone(), Pose::IDENTITY)).unwrap();
            w.overlaps()
        };
        assert!(inside(-0.5e-3, 0.5e-3).is_empty());
        let out = inside(-0.5e-3, 1.5e-3);
        assert!(out.len() == 1 && out[0].through && out[0].depth > 5e-4, "{out:?}");
        let beyond = inside(5e-3, 6e-3);
        assert!(beyond.len() == 1 && beyond[0].through && beyond[0].depth > 4e-3, "{beyond:?}");
    }

    #[test]
    fn a_sheet_is_crossed_where_it_is() {
        let sheet = Geometry::Mesh {
            vertices: [(-1.0, -1.0), (1.0, -1.0), (0.0, 1.0)].map(|(y, z)| DVec3::new(0.0, y, z) * 1e-3).to_vec(),
            triangles: vec![[0, 1, 2]],
        };
        let mut w = world(&[
            line(DVec3::X * -4e-3, DVec3::X * 5e-3),
            line(DVec3::new(0.6e-4, -1e-3, 0.0), DVec3::new(0.6e-4, 1e-3, 0.0)),
        ]);
        w.insert_shape(&ShapeSpec::fixed(sheet, Pose::IDENTITY)).unwrap();
        let found: Vec<Overlap> =
            w.overlaps().into_iter().filter(|o| matches!(o.with, OverlapWith::Shape(_))).collect();
        assert_eq!(found.len(), 2);
        assert!(found[0].through && (found[0].arc - 4e-3).abs() < 1e-12 && (found[0].depth - R).abs() < 1e-15);
        assert!(!found[1].through && (found[1].depth - 0.4e-4).abs() < 1e-9);
    }

    #[test]
    fn bends_and_welds_are_none() {
        // Sharper than half a turn of its own radius, and a fork of 20 degrees.
        let corner = DVec3::ZERO;
        let mut points: Vec<DVec3> = (0..40).map(|i| DVec3::X * (0.5 * R * f64::from(40 - i))).collect();
        points.push(corner);
        let (sin, cos) = 0.5_f64.sin_cos();
        points.extend((1..=40).map(|i| DVec3::new(cos, sin, 0.0) * (0.5 * R * f64::from(i))));
        let w = world(&[RodSpec::new(points, R, Material::elastic(1e9, 1000.0))]);
        assert!(w.overlaps().iter().all(|o| !o.through), "{:?}", w.overlaps());
        let mut w = World::default();
        let a = w.insert_rod(&line(DVec3::ZERO, DVec3::X * 0.02)).unwrap();
        let b = w.insert_rod(&line(DVec3::ZERO, DVec3::new(0.019, 0.006, 0.0))).unwrap();
        assert!(w.overlaps().len() == 1 && w.overlaps()[0].through);
        w.insert_weld(&crate::WeldSpec::new(vec![(a, crate::Place::Start), (b, crate::Place::Start)])).unwrap();
        assert!(w.overlaps().is_empty(), "{:?}", w.overlaps());
        // A ring touches itself at its seam alone.
        let ring = RodSpec::ring(DVec3::Z * 0.01, DVec3::Z, DVec3::X * 5e-3, 80, R, Material::elastic(1e9, 1000.0));
        assert!(world(&[ring]).overlaps().is_empty());
    }

    #[test]
    fn each_place_is_said_once() {
        // A zigzag across a line: four crossings.
        let points = (0..=80).map(|i| {
            let u = f64::from(i) / 20.0;
            let tooth = (u - u.floor() - 0.5).abs() * 4.0 - 1.0;
            DVec3::new(0.004 * u + 0.001, 0.002 * tooth * if u as i64 % 2 == 0 { 1.0 } else { -1.0 }, 0.0)
        });
        let w = world(&[
            line(DVec3::ZERO, DVec3::X * 0.02),
            RodSpec::new(points.collect(), R, Material::elastic(1e9, 1000.0)),
        ]);
        let found = w.overlaps();
        assert!(found.len() >= 4 && found.iter().all(|o| o.through && o.diameters > 0.9), "{found:?}");
    }
}
