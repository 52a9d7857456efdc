//! What a ray hits first: capsules, cylinders, boxes and triangles, in a tree of boxes.

use super::Color;
use sutura::Pose;
use sutura::glam::DVec3;

pub(super) struct Ray {
    pub origin: DVec3,
    pub direction: DVec3,
}

pub(super) struct Hit {
    pub t: f64,
    pub normal: DVec3,
}

/// One thing that a ray can hit.
pub(super) enum Primitive {
    Capsule(Capsule),
    Cylinder { pose: Pose, radius: f64, half_length: f64 },
    Box { pose: Pose, half_sides: DVec3 },
    Triangle([DVec3; 3]),
}

/// Points within `radius` of a piece of a line; `axis` is a unit vector, or zero for a ball.
pub(super) struct Capsule {
    start: DVec3,
    axis: DVec3,
    length: f64,
    radius: f64,
    /// Tangents of a curve of which this is a piece, at its two ends: its normals are across them. Zero at an end of
    /// the curve.
    tangents: [DVec3; 2],
}

impl Capsule {
    pub fn new(start: DVec3, end: DVec3, radius: f64) -> Capsule {
        Capsule {
            start,
            axis: (end - start).normalize_or_zero(),
            length: (end - start).length(),
            radius,
            tangents: [DVec3::ZERO; 2],
        }
    }

    /// The pieces of a curve.
    pub fn chain(points: &[DVec3], radius: f64) -> impl Iterator<Item = Capsule> + '_ {
        let tangent = move |i: usize| {
            if i == 0 || i + 1 == points.len() {
                DVec3::ZERO
            } else {
                (points[i + 1] - points[i - 1]).normalize_or_zero()
            }
        };
        (1..points.len()).map(move |i| Capsule {
            tangents: [tangent(i - 1), tangent(i)],
            ..Capsule::new(points[i - 1], points[i], radius)
        })
    }
}

impl Primitive {
    fn bounds(&self) -> Bounds {
        let around = |pose: &Pose, half: DVec3| {
            let (x, y, z) = (pose.orientation * DVec3::X, pose.orientation * DVec3::Y, pose.orientation * DVec3::Z);
            let half = x.abs() * half.x + y.abs() * half.y + z.abs() * half.z;
            Bounds { low: pose.position - half, high: pose.position + half }
        };
        match self {
            Primitive::Capsule(c) => {
                let end = c.start + c.axis * c.length;
                Bounds { low: c.start.min(end) - c.radius, high: c.start.max(end) + c.radius }
            }
            Primitive::Cylinder { pose, radius, half_length } => {
                around(pose, DVec3::new(*radius, *radius, *half_length))
            }
            Primitive::Box { pose, half_sides } => around(pose, *half_sides),
            Primitive::Triangle([a, b, c]) => Bounds { low: a.min(*b).min(*c), high: a.max(*b).max(*c) },
        }
    }

    /// First hit from outside at 0 < t < `far`.
    fn hit(&self, ray: &Ray, far: f64) -> Option<Hit> {
        match self {
            Primitive::Capsule(c) => hit_capsule(ray, c, far),
            Primitive::Cylinder { pose, radius, half_length } => {
                in_frame(pose, ray, |r| hit_cylinder(r, *radius, *half_length, far))
            }
            Primitive::Box { pose, half_sides } => in_frame(pose, ray, |r| hit_box(r, *half_sides, far)),
            Primitive::Triangle(corners) => hit_triangle(ray, corners, far),
        }
    }
}

fn in_frame(pose: &Pose, ray: &Ray, hit: impl Fn(&Ray) -> Option<Hit>) -> Option<Hit> {
    let local = Ray {
        origin: pose.inverse_transform_point(ray.origin),
        direction: pose.orientation.conjugate() * ray.direction,
    };
    hit(&local).map(|h| Hit { normal: pose.orientation * h.normal, ..h })
}

/// The smaller root of |o + t d - axis|^2 = r^2 with the axis of direction `u` (unit; zero for a sphere) through the
/// origin of `o`.
fn entry(o: DVec3, d: DVec3, u: DVec3, radius: f64) -> Option<f64> {
    let (o, d) = (o - u * o.dot(u), d - u * d.dot(u));
    let (a, b, c) = (d.length_squared(), o.dot(d), o.length_squared() - radius * radius);
    let discriminant = b * b - a * c;
    (discriminant > 0.0 && a > 0.0).then(|| (-b - discriminant.sqrt()) / a)
}

fn hit_capsule(ray: &Ray, c: &Capsule, far: f64) -> Option<Hit> {
    // From the point of the ray nearest to the start: at a meter's distance the roots of a tenth of a millimeter lose
    // digits.
    let shift = (c.start - ray.origin).dot(ray.direction);
    let o = ray.origin + ray.direction * shift - c.start;
    let t = entry(o, ray.direction, c.axis, c.radius);
    let along = t.map(|t| (o + ray.direction * t).dot(c.axis));
    let (t, center) = match (t, along) {
        (Some(t), Some(along)) if (0.0..=c.length).contains(&along) => (t, c.axis * along),
        // Both balls are inside the endless cylinder: a ray that misses it misses them, unless it runs along it.
        (None, _) if ray.direction.dot(c.axis).abs() < 0.999_999 => return None,
        _ => {
            let (start, end) = (DVec3::ZERO, c.axis * c.length);
            let ball = |center: DVec3| entry(o - center, ray.direction, DVec3::ZERO, c.radius).map(|t| (t, center));
            [ball(start), ball(end)].into_iter().flatten().min_by(|a, b| a.0.total_cmp(&b.0))?
        }
    };
    (t + shift > 0.0 && t + shift < far).then(|| {
        let normal = (o + ray.direction * t - center) / c.radius;
        let place = if c.length > 0.0 { center.length() / c.length } else { 0.0 };
        let tangent = c.tangents[0].lerp(c.tangents[1], place);
        Hit { t: t + shift, normal: (normal - tangent * normal.dot(tangent)).normalize() }
    })
}

fn hit_cylinder(ray: &Ray, radius: f64, half_length: f64, far: f64) -> Option<Hit> {
    let mut best: Option<Hit> = None;
    if let Some(t) = entry(ray.origin, ray.direction, DVec3::Z, radius) {
        let p = ray.origin + ray.direction * t;
        if p.z.abs() <= half_length {
            best = Some(Hit { t, normal: DVec3::new(p.x, p.y, 0.0) / radius });
        }
    }
    let face = -ray.direction.z.signum();
    let t = (face * half_length - ray.origin.z) / ray.direction.z;
    let p = ray.origin + ray.direction * t;
    if t.is_finite() && p.x * p.x + p.y * p.y <= radius * radius && best.as_ref().is_none_or(|h| t < h.t) {
        best = Some(Hit { t, normal: DVec3::Z * face });
    }
    best.filter(|h| h.t > 0.0 && h.t < far)
}

fn hit_box(ray: &Ray, half: DVec3, far: f64) -> Option<Hit> {
    let side = -DVec3::new(ray.direction.x.signum(), ray.direction.y.signum(), ray.direction.z.signum());
    let enter = (side * half - ray.origin) / ray.direction;
    let leave = (-side * half - ray.origin) / ray.direction;
    let t = enter.max_element();
    let axis = [DVec3::X, DVec3::Y, DVec3::Z][if t == enter.x { 0 } else { 1 + usize::from(t != enter.y) }];
    (t > 0.0 && t < far && t <= leave.min_element()).then(|| Hit { t, normal: axis * side })
}

fn hit_triangle(ray: &Ray, [a, b, c]: &[DVec3; 3], far: f64) -> Option<Hit> {
    let (e1, e2, o) = (*b - *a, *c - *a, ray.origin - *a);
    let n = e1.cross(e2);
    let facing = -ray.direction.dot(n);
    let t = o.dot(n) / facing;
    let q = o.cross(ray.direction);
    let (u, v) = (e2.dot(q) / facing, -e1.dot(q) / facing);
    // Both sides are seen; the normal is turned to the ray.
    (t > 0.0 && t < far && u >= 0.0 && v >= 0.0 && u + v <= 1.0)
        .then(|| Hit { t, normal: n.normalize() * facing.signum() })
}

#[derive(Clone, Copy)]
struct Bounds {
    low: DVec3,
    high: DVec3,
}

impl Bounds {
    fn join(self, other: Bounds) -> Bounds {
        Bounds { low: self.low.min(other.low), high: self.high.max(other.high) }
    }
    /// Where a ray with these inverse direction components enters, if it does before `far`.
    fn enter(&self, origin: DVec3, inverse: DVec3, far: f64) -> Option<f64> {
        let (a, b) = ((self.low - origin) * inverse, (self.high - origin) * inverse);
        let (near, leave) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
        (near <= leave && near < far).then_some(near)
    }
}

/// A tree of bounding boxes over the primitives, halved at the median of the longest side. Solids larger than a few
/// pieces of thread would make every box large; they stand beside the tree.
pub(super) struct Tree {
    large: Vec<(Primitive, Color)>,
    nodes: Vec<Node>,
    primitives: Vec<(Primitive, Color)>,
}

struct Node {
    bounds: Bounds,
    kind: NodeKind,
}

enum NodeKind {
    /// Primitives from the first index up to the second.
    Leaf(usize, usize),
    /// The first child follows its parent; this is the second.
    Fork(usize),
}

impl Tree {
    pub fn build(primitives: Vec<(Primitive, Color)>) -> Tree {
        let is_large = |p: &(Primitive, Color)| !matches!(p.0, Primitive::Capsule(_) | Primitive::Triangle(_));
        let (large, mut primitives): (Vec<_>, Vec<_>) = primitives.into_iter().partition(is_large);
        let mut nodes = Vec::new();
        let n = primitives.len();
        if n > 0 {
            Self::split(&mut nodes, &mut primitives, 0, n);
        }
        Tree { large, nodes, primitives }
    }

    fn split(nodes: &mut Vec<Node>, primitives: &mut [(Primitive, Color)], from: usize, to: usize) {
        let slice = &mut primitives[from..to];
        let bounds = slice.iter().map(|p| p.0.bounds()).reduce(Bounds::join).expect("a node has primitives");
        let index = nodes.len();
        nodes.push(Node { bounds, kind: NodeKind::Leaf(from, to) });
        if slice.len() <= 3 {
            return;
        }
        let side = bounds.high - bounds.low;
        let axis = if side.x >= side.y && side.x >= side.z {
            DVec3::X
        } else {
            [DVec3::Y, DVec3::Z][usize::from(side.z > side.y)]
        };
        let key = |p: &(Primitive, Color)| {
            let b = p.0.bounds();
            (b.low + b.high).dot(axis)
        };
        let half = slice.len() / 2;
        slice.select_nth_unstable_by(half, |a, b| key(a).total_cmp(&key(b)));
        Self::split(nodes, primitives, from, from + half);
        let second = nodes.len();
        nodes[index].kind = NodeKind::Fork(second);
        Self::split(nodes, primitives, from + half, to);
    }

    /// The nearest hit before `far`, or with `any` the first that is found.
    pub fn hit(&self, ray: &Ray, far: f64, any: bool) -> Option<(Hit, Color)> {
        let mut best: Option<(Hit, Color)> = None;
        let mut far = far;
        // Whether the search is over.
        let mut test = |primitives: &[(Primitive, Color)], far: &mut f64| {
            for (primitive, color) in primitives {
                if let Some(hit) = primitive.hit(ray, *far) {
                    *far = hit.t;
                    best = Some((hit, *color));
                    if any {
                        return true;
                    }
                }
            }
            false
        };
        if test(&self.large, &mut far) || self.nodes.is_empty() {
            return best;
        }
        let inverse = ray.direction.recip();
        let enter =
            |index: usize, far: f64| self.nodes[index].bounds.enter(ray.origin, inverse, far).map(|near| (near, index));
        // A tree halved at the median is no deeper than the logarithm of its size.
        let mut stack = [(0.0, 0_usize); 64];
        let mut height = 0;
        let mut next = enter(0, far);
        loop {
            let Some((near, index)) = next else {
                if height == 0 {
                    return best;
                }
                height -= 1;
                next = Some(stack[height]);
                continue;
            };
            next = None;
            if near >= far {
                continue;
            }
            match self.nodes[index].kind {
                NodeKind::Leaf(from, to) => {
                    if test(&self.primitives[from..to], &mut far) {
                        return best;
                    }
                }
                NodeKind::Fork(second) => match (enter(index + 1, far), enter(second, far)) {
                    (Some(a), Some(b)) => {
                        let (nearer, farther) = if a.0 <= b.0 { (a, b) } else { (b, a) };
                        stack[height] = farther;
                        height += 1;
                        next = Some(nearer);
                    }
                    (a, b) => next = a.or(b),
                },
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::stage::Dice;
    use super::*;
    use core::f64::consts::TAU;

    #[test]
    fn hits_lie_on_the_surface_and_normals_point_out() {
        let turn = DVec3::new(0.3, -0.5, 0.8).normalize();
        let pose = Pose::new(DVec3::new(0.1, 0.2, -0.1), sutura::glam::DQuat::from_axis_angle(turn, 0.9));
        let (half, radius, length) = (DVec3::new(0.3, 0.2, 0.4), 0.25, 0.35);
        // Signed distances in the frame of the body; of the box and the cylinder only their zero matters here.
        let box_distance = |p: DVec3| (p.abs() - half).max_element();
        let cylinder_distance = |p: DVec3| (p.x.hypot(p.y) - radius).max(p.z.abs() - length);
        let capsule_distance = |p: DVec3| (p - DVec3::Z * p.z.clamp(-length, length)).length() - radius;
        let ends = [-length, length].map(|z| pose.transform_point(DVec3::Z * z));
        let cases: [(Primitive, &dyn Fn(DVec3) -> f64); 3] = [
            (Primitive::Box { pose, half_sides: half }, &box_distance),
            (Primitive::Cylinder { pose, radius, half_length: length }, &cylinder_distance),
            (Primitive::Capsule(Capsule::new(ends[0], ends[1], radius)), &capsule_distance),
        ];
        for (primitive, distance) in &cases {
            let mut dice = Dice::new(0);
            let (mut hits, mut misses) = (0, 0);
            for _ in 0..2000 {
                let on_sphere = |(a, b): (f64, f64)| {
                    let (z, turn) = (2.0 * a - 1.0, TAU * b);
                    DVec3::new((1.0 - z * z).sqrt() * turn.cos(), (1.0 - z * z).sqrt() * turn.sin(), z)
                };
                let origin = pose.position + on_sphere(dice.pair()) * 3.0;
                let toward = pose.position + on_sphere(dice.pair()) * 0.6;
                let ray = Ray { origin, direction: (toward - origin).normalize() };
                let inside = |t: f64| distance(pose.inverse_transform_point(ray.origin + ray.direction * t));
                match primitive.hit(&ray, f64::INFINITY) {
                    Some(hit) => {
                        hits += 1;
                        // Twelve digits are left of sixteen after the roots of a quadratic.
                        assert!(inside(hit.t).abs() < 1e-11, "on the surface: {}", inside(hit.t));
                        assert!(
                            (hit.normal.length() - 1.0).abs() < 1e-9 && hit.normal.dot(ray.direction) < 1e-9,
                            "toward the eye"
                        );
                        let b = primitive.bounds();
                        let p = ray.origin + ray.direction * hit.t;
                        assert!((b.low - 1e-9).cmple(p).all() && (b.high + 1e-9).cmpge(p).all(), "within its bounds");
                        assert!(primitive.hit(&ray, 0.99 * hit.t).is_none(), "not beyond the limit");
                    }
                    None => {
                        misses += 1;
                        let nearest = (0..600).map(|k| inside(0.01 * f64::from(k))).fold(f64::INFINITY, f64::min);
                        assert!(nearest > -1e-2, "a ray that is said to miss stays outside: {nearest}");
                    }
                }
            }
            assert!(hits > 200 && misses > 200, "both happen: {hits} and {misses}");
        }
    }

    #[test]
    fn a_triangle_is_hit_inside_its_sides() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let down =
            |x: f64, y: f64| hit_triangle(&Ray { origin: DVec3::new(x, y, 2.0), direction: -DVec3::Z }, &corners, 10.0);
        let hit = down(0.2, 0.3).expect("inside");
        assert!((hit.t - 2.0).abs() < 1e-15 && hit.normal == DVec3::Z);
        assert!(down(0.6, 0.6).is_none() && down(-0.1, 0.5).is_none());
        let up = hit_triangle(&Ray { origin: DVec3::new(0.2, 0.3, -1.0), direction: DVec3::Z }, &corners, 10.0)
            .expect("from below");
        assert_eq!(up.normal, -DVec3::Z);
    }
}
