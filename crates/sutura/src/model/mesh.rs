//! Triangle meshes as they come out of files: checked when they are inserted, mended where there is only one way to,
//! refused with the place where there is not.
//!
//! | what is found | what is done |
//! |---|---|
//! | a coordinate that is not finite, a corner that there is not, no triangles | refused |
//! | triangles without area, the same triangle twice, corners at the very same place along a seam | mended and said |
//! | triangles turned against their neighbors | the lesser part of their component is turned and said |
//! | an edge of three triangles or more, a surface with one side (a Moebius strip) | refused |
//! | a closed component | solid where its normals point outward. One that no other surrounds and whose normals point inward is a container: free space |
//! | | is inside it. It is said |
//! | a component that would be closed but for small holes | refused, unless it is said to be open |
//! | any other with an edge | a sheet, met from both sides; where its largest hole is, is said |
//!
//! A hole is small where it is one missing triangle, or has less than [`SMALL_HOLE`] of the area of its component: a
//! crack, a missing cap, a slip of the modeler. So a tube longer than some 13 diameters with both ends open has to be
//! said to be open.
//!
//! Not looked at: whether triangles pass through each other.

use crate::error::{Error, coordinates};
use glam::DVec3;
use std::collections::BTreeMap;

/// Area of a hole over that of its component under which it is small.
const SMALL_HOLE: f64 = 0.02;
/// Area of a triangle over the square of its longest side under which it has none: rounding of its corners.
const NO_AREA: f64 = 1e-12;

/// A mesh that has passed.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct CheckedMesh {
    /// As given; those at one place along a seam are still there, the triangles use the first.
    pub vertices: Vec<DVec3>,
    /// Counterclockwise as seen from outside, of every component alike.
    pub triangles: Vec<[u32; 3]>,
    /// Whether every component is closed: then the side of a point is that of the surface there.
    pub closed: bool,
    /// Whether a part is a container, so that what is far away is solid.
    pub container: bool,
    /// What was mended, and what a user may not have meant, each a sentence without its full stop.
    pub notes: Vec<String>,
}

/// A triangle and its number in the input.
#[derive(Debug, Clone, Copy)]
struct Face {
    corners: [u32; 3],
    number: u32,
}

impl Face {
    /// Its edges in its direction, each with the corner opposite.
    fn edges(&self) -> [(u32, u32, u32); 3] {
        let [a, b, c] = self.corners;
        [(a, b, c), (b, c, a), (c, a, b)]
    }
    fn turned(self) -> Self {
        let [a, b, c] = self.corners;
        Face { corners: [a, c, b], ..self }
    }
}

/// One triangle at an edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Side {
    /// Smaller corner first.
    edge: (u32, u32),
    face: u32,
    /// Whether the triangle runs from the smaller to the larger.
    ascending: bool,
}

/// A triangle beyond an edge of another.
#[derive(Debug, Clone, Copy)]
struct Neighbor {
    face: usize,
    /// Whether both run the same way along the edge, so that one has to be turned.
    against: bool,
    edge: (u32, u32),
}

/// The edge of a hole, corner by corner.
struct Hole {
    middle: DVec3,
    corners: usize,
    area: f64,
    across: f64,
}

/// Checks a mesh and mends what can be mended. `open` says that small holes are meant.
pub(crate) fn check(vertices: &[DVec3], triangles: &[[u32; 3]], open: bool) -> Result<CheckedMesh, Error> {
    let mut notes = Vec::new();
    let mut faces = numbers(vertices, triangles)?;
    collapsed(vertices, &mut faces, &mut notes);
    let mut doubled = twice(&mut faces);
    let joined = join_seams(vertices, &mut faces);
    doubled.extend(twice(&mut faces));
    slivers(vertices, &mut faces, &mut notes)?;
    if let Some((first, again)) = doubled.first() {
        notes.push(format!(
            "left out {} given twice, the first triangle {again}, the same as {first}",
            count(doubled.len(), "triangle")
        ));
    }
    if let Some(v) = joined.first() {
        let place = coordinates(vertices[*v as usize]);
        notes.push(format!(
            "joined {} with others at the same place, the first vertex {v} at {place}",
            count(joined.len(), "vertex")
        ));
    }
    if faces.is_empty() {
        let t = triangles[0];
        return Err(invalid(
            "triangles[0]",
            format!("{t:?} at {}", at_corners(vertices, t)),
            "a triangle with an area",
        ));
    }
    let sides = sides(&faces);
    if let Some(crowd) = sides.chunk_by(|a, b| a.edge == b.edge).find(|c| c.len() > 2) {
        return Err(crowded(vertices, &faces, crowd));
    }
    let component = orient(vertices, &mut faces, &sides, &mut notes)?;
    let closed = openings(vertices, &faces, &component, open, &mut notes)?;
    let container = containers(vertices, &faces, &component, &closed, &mut notes);
    Ok(CheckedMesh {
        vertices: vertices.to_vec(),
        triangles: faces.iter().map(|f| f.corners).collect(),
        closed: closed.iter().all(|c| *c),
        container,
        notes,
    })
}

fn invalid(field: impl Into<String>, value: impl Into<String>, wanted: &'static str) -> Error {
    Error::Invalid { what: "shape", field: field.into(), value: value.into(), wanted }
}

fn count(n: usize, what: &str) -> String {
    match (n, what) {
        (1, _) => format!("1 {what}"),
        (_, "vertex") => format!("{n} vertices"),
        _ => format!("{n} {what}s"),
    }
}

fn at_corners(vertices: &[DVec3], t: [u32; 3]) -> String {
    t.map(|c| coordinates(vertices[c as usize])).join(", ")
}

/// Whether all numbers are usable.
fn numbers(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Result<Vec<Face>, Error> {
    if let Some(i) = vertices.iter().position(|v| !crate::math::is_place(*v)) {
        return Err(invalid(
            format!("vertices[{i}]"),
            format!("{:?}", vertices[i]),
            "finite coordinates whose squares are finite too [m]",
        ));
    }
    if triangles.is_empty() {
        return Err(invalid("triangles", "none", "at least one triangle"));
    }
    if let Some(i) = triangles.iter().position(|t| t.iter().any(|c| *c as usize >= vertices.len())) {
        return Err(invalid(format!("triangles[{i}]"), format!("{:?}", triangles[i]), "indices of vertices"));
    }
    Ok(triangles.iter().enumerate().map(|(i, t)| Face { corners: *t, number: i as u32 }).collect())
}

/// Leaves out triangles with two corners at one place: what they joined meets without them.
fn collapsed(vertices: &[DVec3], faces: &mut Vec<Face>, notes: &mut Vec<String>) {
    let flat = |f: &Face| f.edges().iter().any(|(a, b, _)| a == b || vertices[*a as usize] == vertices[*b as usize]);
    let gone: Vec<u32> = faces.iter().filter(|f| flat(f)).map(|f| f.number).collect();
    faces.retain(|f| !flat(f));
    if let Some(first) = gone.first() {
        notes.push(format!(
            "left out {} with two corners at one place, the first triangle {first}",
            count(gone.len(), "triangle")
        ));
    }
}

/// Leaves out the later of two triangles with the same corners, whichever way they run; the pairs by their numbers.
fn twice(faces: &mut Vec<Face>) -> Vec<(u32, u32)> {
    let sorted = |f: &Face| {
        let mut c = f.corners;
        c.sort_unstable();
        c
    };
    let mut order: Vec<usize> = (0..faces.len()).collect();
    order.sort_by_key(|i| (sorted(&faces[*i]), *i));
    let mut again: Vec<(u32, u32)> = Vec::new();
    let mut gone = vec![false; faces.len()];
    for same in order.chunk_by(|a, b| sorted(&faces[*a]) == sorted(&faces[*b])) {
        for i in &same[1..] {
            again.push((faces[same[0]].number, faces[*i].number));
            gone[*i] = true;
        }
    }
    let mut gone = gone.into_iter();
    faces.retain(|_| !gone.next().unwrap_or(false));
    again.sort_unstable_by_key(|p| p.1);
    again
}

/// Joins vertices at the very same place where the surface ends at both: the corners of loose triangles, the seams of
/// textures. What touches elsewhere stays apart. The vertices that gave way.
fn join_seams(vertices: &[DVec3], faces: &mut [Face]) -> Vec<u32> {
    let sides = sides(faces);
    let mut ends: Vec<u32> = sides
        .chunk_by(|a, b| a.edge == b.edge)
        .filter(|c| c.len() == 1)
        .flat_map(|c| [c[0].edge.0, c[0].edge.1])
        .collect();
    // Zero and minus zero are one place.
    let key = |v: u32| (vertices[v as usize] + DVec3::ZERO).to_array().map(f64::to_bits);
    ends.sort_unstable_by_key(|v| (key(*v), *v));
    ends.dedup();
    let mut becomes: BTreeMap<u32, u32> = BTreeMap::new();
    for same in ends.chunk_by(|a, b| key(*a) == key(*b)) {
        becomes.extend(same[1..].iter().map(|v| (*v, same[0])));
    }
    if !becomes.is_empty() {
        for face in faces.iter_mut() {
            face.corners = face.corners.map(|c| becomes.get(&c).copied().unwrap_or(c));
        }
    }
    becomes.into_keys().collect()
}

/// Takes triangles whose corners lie on one line out of the mesh, so that no crack stays: the neighbor beyond the
/// longest side is cut at the corner that lies on it.
fn slivers(vertices: &[DVec3], faces: &mut Vec<Face>, notes: &mut Vec<String>) -> Result<(), Error> {
    let flat = |f: &Face| {
        let [a, b, c] = f.corners.map(|c| vertices[c as usize]);
        let longest = (b - a).length().max((c - a).length()).max((c - b).length());
        (b - a).cross(c - a).length() <= NO_AREA * longest * longest
    };
    let mut left: Vec<usize> = (0..faces.len()).rev().filter(|i| flat(&faces[*i])).collect();
    let Some(first) = left.last().map(|i| faces[*i].number) else { return Ok(()) };
    let n = left.len();
    let key = |a: u32, b: u32| (a.min(b), a.max(b));
    let mut at: BTreeMap<(u32, u32), Vec<usize>> = BTreeMap::new();
    for (i, f) in faces.iter().enumerate() {
        f.edges().iter().for_each(|(a, b, _)| at.entry(key(*a, *b)).or_default().push(i));
    }
    let mut gone = vec![false; faces.len()];
    // Every cut ends one; where they lie on each other it could go round for ever.
    let mut steps = 4 * n;
    while let Some(i) = left.pop() {
        let face = faces[i];
        if gone[i] || !flat(&face) {
            continue;
        }
        steps = steps.checked_sub(1).ok_or_else(|| {
            invalid(
                format!("triangles[{}]", face.number),
                format!("{:?} at {}", face.corners, at_corners(vertices, face.corners)),
                "a triangle with an area",
            )
        })?;
        let longest = |(a, b, _): &(u32, u32, u32)| (vertices[*a as usize] - vertices[*b as usize]).length_squared();
        let (a, c, middle) =
            face.edges().into_iter().max_by(|x, y| longest(x).total_cmp(&longest(y))).expect("three edges");
        gone[i] = true;
        for (a, b, _) in face.edges() {
            at.entry(key(a, b)).or_default().retain(|k| *k != i);
        }
        let Some(other) = at.get(&key(a, c)).and_then(|o| o.first().copied()) else { continue };
        let (from, to, opposite) =
            faces[other].edges().into_iter().find(|(x, y, _)| key(*x, *y) == key(a, c)).expect("it is at this edge");
        for (a, b, _) in faces[other].edges() {
            at.entry(key(a, b)).or_default().retain(|k| *k != other);
        }
        let number = faces[other].number;
        faces[other] = Face { corners: [from, middle, opposite], number };
        faces.push(Face { corners: [middle, to, opposite], number });
        gone.push(false);
        for k in [other, faces.len() - 1] {
            faces[k].edges().iter().for_each(|(a, b, _)| at.entry(key(*a, *b)).or_default().push(k));
            left.push(k);
        }
    }
    let mut gone = gone.into_iter();
    faces.retain(|_| !gone.next().unwrap_or(false));
    notes.push(format!("took out {} without area, the first triangle {first}", count(n, "triangle")));
    Ok(())
}

/// All edges, those of one edge together.
fn sides(faces: &[Face]) -> Vec<Side> {
    let mut sides: Vec<Side> = Vec::with_capacity(3 * faces.len());
    for (i, face) in faces.iter().enumerate() {
        sides.extend(face.edges().map(|(a, b, _)| Side {
            edge: (a.min(b), a.max(b)),
            face: i as u32,
            ascending: a < b,
        }));
    }
    sides.sort_unstable();
    sides
}

fn crowded(vertices: &[DVec3], faces: &[Face], crowd: &[Side]) -> Error {
    let numbers: Vec<String> = crowd.iter().map(|s| faces[s.face as usize].number.to_string()).collect();
    let (a, b) = crowd[0].edge;
    let edge = format!(
        "vertices {a} and {b}, from {} to {}",
        coordinates(vertices[a as usize]),
        coordinates(vertices[b as usize])
    );
    let value = format!("one of {} triangles ({}) at the edge of {edge}", crowd.len(), numbers.join(", "));
    invalid(format!("triangles[{}]", numbers[0]), value, "at most two triangles at an edge")
}

/// Turns triangles so that neighbors agree; the component of each, numbered from zero.
fn orient(
    vertices: &[DVec3],
    faces: &mut [Face],
    sides: &[Side],
    notes: &mut Vec<String>,
) -> Result<Vec<usize>, Error> {
    let mut next: Vec<Vec<Neighbor>> = vec![Vec::new(); faces.len()];
    for pair in sides.chunk_by(|a, b| a.edge == b.edge).filter(|c| c.len() == 2) {
        let against = pair[0].ascending == pair[1].ascending;
        for (of, with) in [(pair[0], pair[1]), (pair[1], pair[0])] {
            next[of.face as usize].push(Neighbor { face: with.face as usize, against, edge: of.edge });
        }
    }
    let mut component = vec![usize::MAX; faces.len()];
    let mut turned = vec![false; faces.len()];
    let (mut n_components, mut all) = (0, Vec::new());
    for start in 0..faces.len() {
        if component[start] != usize::MAX {
            continue;
        }
        let (mut members, mut stack) = (vec![start], vec![start]);
        component[start] = n_components;
        while let Some(i) = stack.pop() {
            for Neighbor { face: k, against, edge } in &next[i] {
                if component[*k] == usize::MAX {
                    component[*k] = n_components;
                    turned[*k] = turned[i] ^ against;
                    members.push(*k);
                    stack.push(*k);
                } else if turned[*k] != turned[i] ^ against {
                    let place = [edge.0, edge.1].map(|v| coordinates(vertices[v as usize])).join(" to ");
                    let value = format!(
                        "of a surface with one side: triangles {} and {} meet at the edge from {place}",
                        faces[i].number, faces[*k].number
                    );
                    return Err(invalid(format!("triangles[{}]", faces[i].number), value, "a surface with two sides"));
                }
            }
        }
        // The lesser part gives way; of halves that without the first triangle.
        let many = members.iter().filter(|i| turned[**i]).count();
        let flip = 2 * many > members.len();
        all.extend(members.iter().filter(|i| turned[**i] != flip).copied());
        n_components += 1;
    }
    all.sort_unstable();
    for i in &all {
        faces[*i] = faces[*i].turned();
    }
    if let Some(first) = all.first() {
        let place = at_corners(vertices, faces[*first].corners);
        notes.push(format!(
            "turned {} facing against the neighbors, the first triangle {} at {place}",
            count(all.len(), "triangle"),
            faces[*first].number
        ));
    }
    Ok(component)
}

/// The holes of each component; whether each is closed. Those that a component would be closed without are refused,
/// unless it is `open`.
fn openings(
    vertices: &[DVec3],
    faces: &[Face],
    component: &[usize],
    open: bool,
    notes: &mut Vec<String>,
) -> Result<Vec<bool>, Error> {
    let n = component.iter().max().map_or(0, |c| c + 1);
    let mut area = vec![0.0; n];
    for (f, c) in faces.iter().zip(component) {
        let [p, q, r] = f.corners.map(|c| vertices[c as usize]);
        area[*c] += 0.5 * (q - p).cross(r - p).length();
    }
    // Along the hole, against the triangles at its edge.
    let mut ends: Vec<Vec<(u32, u32)>> = vec![Vec::new(); n];
    for alone in sides(faces).chunk_by(|a, b| a.edge == b.edge).filter(|c| c.len() == 1) {
        let (a, b) = alone[0].edge;
        ends[component[alone[0].face as usize]].push(if alone[0].ascending { (b, a) } else { (a, b) });
    }
    let mut closed = vec![true; n];
    for (c, ends) in ends.into_iter().enumerate().filter(|(_, e)| !e.is_empty()) {
        closed[c] = false;
        let mut holes = loops(&ends).into_iter().map(|l| Hole::new(vertices, &l)).collect::<Vec<_>>();
        holes.sort_by(|a, b| b.area.total_cmp(&a.area));
        let small = |h: &Hole| h.area < SMALL_HOLE * area[c] || h.corners == 3 && h.area < 0.5 * area[c];
        let largest = &holes[0];
        let place = format!(
            "at {}, {} edges around it, {:.2e} m across",
            coordinates(largest.middle),
            largest.corners,
            largest.across
        );
        if !open && holes.iter().all(small) {
            let value = format!("closed but for {}, the largest {place}", count(holes.len(), "small hole"));
            return Err(invalid("mesh", value, "a closed mesh, or one that is said to be open"));
        }
        notes.push(format!(
            "the mesh is open, so threads meet it from both sides: {}, the largest {place}",
            count(holes.len(), "hole")
        ));
    }
    Ok(closed)
}

/// Edges head to tail as closed ways. Where several meet in a vertex the shorter ways come off first.
fn loops(ends: &[(u32, u32)]) -> Vec<Vec<u32>> {
    let mut from: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    ends.iter().for_each(|(a, b)| from.entry(*a).or_default().push(*b));
    let mut found = Vec::new();
    let mut place: BTreeMap<u32, usize> = BTreeMap::new();
    for (start, _) in ends {
        let mut way = vec![*start];
        place.clear();
        place.insert(*start, 0);
        while let Some(next) = from.get_mut(way.last().expect("it begins somewhere")).and_then(Vec::pop) {
            if let Some(k) = place.get(&next).copied() {
                let off = way.split_off(k);
                for v in &off {
                    place.remove(v);
                }
                found.push(off);
            }
            place.insert(next, way.len());
            way.push(next);
        }
    }
    found
}

impl Hole {
    fn new(vertices: &[DVec3], way: &[u32]) -> Self {
        let at = |k: usize| vertices[way[k % way.len()] as usize];
        let middle = (0..way.len()).map(at).sum::<DVec3>() / way.len() as f64;
        let area = (0..way.len()).map(|k| 0.5 * (at(k) - middle).cross(at(k + 1) - middle).length()).sum();
        let across = 2.0 * (0..way.len()).map(|k| at(k).distance(middle)).fold(0.0, f64::max);
        Hole { middle, corners: way.len(), area, across }
    }
}

/// Says which closed components are containers: turned inside out, and in no other. Whether there are any.
fn containers(
    vertices: &[DVec3],
    faces: &[Face],
    component: &[usize],
    closed: &[bool],
    notes: &mut Vec<String>,
) -> bool {
    let mut any = false;
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); closed.len()];
    component.iter().enumerate().for_each(|(i, c)| members[*c].push(i));
    let corners = |i: usize| faces[i].corners.map(|c| vertices[c as usize]);
    let volume = |c: usize| {
        // From a corner of its own, so that far from the origin no digits are lost.
        let origin = corners(members[c][0])[0];
        members[c].iter().map(|i| corners(*i).map(|p| p - origin)).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum::<f64>()
    };
    let bounds = |c: usize| {
        let points = members[c].iter().flat_map(|i| corners(*i));
        points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), p| (lo.min(p), hi.max(p)))
    };
    let boxes: Vec<_> = (0..closed.len()).map(bounds).collect();
    for c in (0..closed.len()).filter(|c| closed[*c]) {
        if volume(c) >= 0.0 {
            continue;
        }
        let point = corners(members[c][0])[0];
        let around = |d: usize| {
            let (lo, hi) = boxes[d];
            d != c && closed[d] && point.cmpge(lo).all() && point.cmple(hi).all() && {
                let angle: f64 = members[d].iter().map(|i| solid_angle(corners(*i).map(|p| p - point))).sum();
                angle.abs() > core::f64::consts::TAU
            }
        };
        if !(0..closed.len()).any(around) {
            any = true;
            let number = faces[members[c][0]].number;
            notes.push(format!(
                "the part with triangle {number} is a container: its normals point inward, so threads are free inside it and everything around it is solid"
            ));
        }
    }
    any
}

/// Signed solid angle of a triangle as seen from the origin (van Oosterom and Strackee 1983).
pub(crate) fn solid_angle([a, b, c]: [DVec3; 3]) -> f64 {
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    2.0 * libm::atan2(a.dot(b.cross(c)), below)
}

#[cfg(test)]
mod tests;
