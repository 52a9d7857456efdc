//! Still pictures of threads and shapes: rays cast at capsules, cylinders, boxes and triangles, with soft shadow and ambient
//! occlusion, so that over and under at a crossing can be told. A picture is a function of its input alone.
//!
//! The thread is drawn as a tube about a smooth curve near its polyline, not as the polyline's capsules (see [`smooth`]).

use anyhow::Context as _;
use core::f64::consts::{PI, TAU};
use std::path::Path;
use std::sync::Mutex;
use sutura::glam::DVec3;
use sutura::{Geometry, Pose};

/// Linear light, red green blue.
pub type Color = DVec3;

/// What is to be seen.
#[derive(Default)]
pub struct Subject {
    /// The threads.
    pub tubes: Vec<Tube>,
    /// What they touch.
    pub solids: Vec<Solid>,
}

/// A thread.
pub struct Tube {
    /// Centerline \[m\].
    pub points: Vec<DVec3>,
    /// Radius \[m\].
    pub radius: f64,
}

/// A shape.
pub struct Solid {
    /// In its own frame.
    pub geometry: Geometry,
    /// Where it is.
    pub pose: Pose,
}

/// How to look at it. What is `None` is chosen to suit the subject.
#[derive(Clone, Default)]
pub struct Look {
    /// Direction in which the eye looks.
    pub direction: Option<DVec3>,
    /// Direction that is up in the picture.
    pub up: Option<DVec3>,
    /// Point in the middle of the picture \[m\].
    pub at: Option<DVec3>,
    /// Width of the picture at that point \[m\].
    pub width: Option<f64>,
    /// Parallel rays instead of rays from an eye.
    pub orthographic: bool,
}

/// Size of a picture in pixels.
#[derive(Clone, Copy)]
pub struct Size {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

/// Thread colors by slot, chosen to be told apart also by the color-blind (after Okabe and Ito 2008, darkened a little).
pub const THREAD_COLORS: [[u8; 3]; 6] = [[38, 84, 160], [222, 128, 20], [0, 140, 105], [190, 70, 130], [110, 80, 170], [150, 110, 60]];
const SOLID_COLOR: [u8; 3] = [206, 202, 194];
/// Cells of the 4 x 4 grid of a pixel in the order in which they are sampled: first four that share no row and no column.
const SAMPLE_ORDER: [u32; 16] = [1, 7, 8, 14, 2, 4, 11, 13, 0, 6, 9, 15, 3, 5, 10, 12];
/// Samples of a pixel that looks like its neighbors.
const FEW: usize = 4;
/// Ambient occlusion rays for each sample; a pixel averages 4 or 16 times as many.
const OCCLUSION_RAYS: u32 = 2;
/// Half the opening angle of the perspective, as a tangent: narrow, so that a thread's thickness hardly depends on its depth.
const HALF_FIELD: f64 = 0.2;

/// The eye, or the screen of parallel rays.
#[derive(Clone, Debug)]
pub struct Camera {
    at: DVec3,
    right: DVec3,
    up: DVec3,
    forward: DVec3,
    /// Half the picture's width at `at` \[m\].
    half_width: f64,
    aspect: f64,
    distance: f64,
    orthographic: bool,
}

struct Ray {
    origin: DVec3,
    direction: DVec3,
}

impl Camera {
    /// The camera that `look` asks for, fitted to `points` (with `radius` around each) where it asks for nothing.
    pub fn fit(look: &Look, points: &[DVec3], radius: f64, size: Size) -> Camera {
        let forward = look.direction.unwrap_or(DVec3::new(-0.3, 0.8, -0.52)).normalize_or(DVec3::Y);
        let up = look.up.unwrap_or(DVec3::Z);
        let up = if up.cross(forward).length() > 0.05 * up.length() { up } else { forward.any_orthonormal_vector() };
        let right = forward.cross(up).normalize();
        let up = right.cross(forward);
        let aspect = f64::from(size.width) / f64::from(size.height);
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for p in points {
            let p = DVec3::new(p.dot(right), p.dot(up), p.dot(forward));
            (low, high) = (low.min(p - radius), high.max(p + radius));
        }
        if points.is_empty() {
            (low, high) = (DVec3::splat(-0.01), DVec3::splat(0.01));
        }
        let middle = (low + high) * 0.5;
        let at = look.at.unwrap_or(right * middle.x + up * middle.y + forward * middle.z);
        // Nearer things look larger: what lies in front of `at` needs a wider picture there.
        let half_width = look.width.map_or_else(
            || {
                let need = points.iter().map(|p| {
                    let d = *p - at;
                    let across = (d.dot(right).abs() + radius).max((d.dot(up).abs() + radius) * aspect);
                    if look.orthographic { across } else { across - d.dot(forward) * HALF_FIELD }
                });
                1.08 * need.fold(4.0 * radius, f64::max)
            },
            |w| 0.5 * w,
        );
        Camera { at, right, up, forward, half_width, aspect, distance: half_width / HALF_FIELD, orthographic: look.orthographic }
    }

    /// Width of the picture at the point looked at \[m\].
    pub fn width(&self) -> f64 {
        2.0 * self.half_width
    }

    /// Through a point of the screen, both coordinates from -1 to 1.
    fn ray(&self, x: f64, y: f64) -> Ray {
        let screen = self.right * (x * self.half_width) + self.up * (y * self.half_width / self.aspect);
        if self.orthographic {
            Ray { origin: self.at + screen - self.forward * self.distance, direction: self.forward }
        } else {
            Ray { origin: self.at - self.forward * self.distance, direction: (screen + self.forward * self.distance).normalize() }
        }
    }

    fn toward(&self, p: DVec3) -> Ray {
        let back = if self.orthographic { -self.forward } else { (self.at - self.forward * self.distance - p).normalize() };
        Ray { origin: p, direction: back }
    }
}

/// A picture, 8 bits each of red, green and blue.
pub struct Image {
    /// Size in pixels.
    pub size: Size,
    /// Row by row from the top left.
    pub rgb: Vec<u8>,
}

impl Image {
    /// Writes a PNG file.
    pub fn write(&self, path: &Path) -> anyhow::Result<()> {
        let file = std::fs::File::create(path).with_context(|| format!("cannot write {}", path.display()))?;
        let mut encoder = png::Encoder::new(std::io::BufWriter::new(file), self.size.width, self.size.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.write_header().and_then(|mut w| w.write_image_data(&self.rgb)).with_context(|| format!("cannot write {}", path.display()))
    }
}

/// Points of a smooth curve near the polyline `x`: a quadratic B-spline whose control points are moved out by a sixteenth of the
/// second difference, so that it leaves the polyline by no more than a sixteenth of it, outward at the middles of the elements and
/// inward at the joints alike. Neighboring pieces turn by at most 0.08 rad, which an outline hardly shows, and
/// shading turns smoothly from one to the next (see [`Capsule`]).
pub fn smooth(x: &[DVec3]) -> Vec<DVec3> {
    let n = x.len();
    if n < 3 {
        return x.to_vec();
    }
    let control = |i: usize| if i == 0 || i == n - 1 { x[i] } else { x[i] - (x[i - 1] - x[i] * 2.0 + x[i + 1]) / 16.0 };
    let mut out = vec![x[0]];
    for i in 1..n - 1 {
        let (a, b, c) = (control(i - 1), control(i), control(i + 1));
        let (from, to) = (if i == 1 { a } else { (a + b) * 0.5 }, if i == n - 2 { c } else { (b + c) * 0.5 });
        let parts = ((b - a).angle_between(c - b) / 0.08).ceil().clamp(1.0, 16.0) as usize;
        for k in 1..=parts {
            let s = k as f64 / parts as f64;
            out.push(from * ((1.0 - s) * (1.0 - s)) + b * (2.0 * s * (1.0 - s)) + to * (s * s));
        }
    }
    out
}

/// One thing that a ray can hit.
enum Primitive {
    Capsule(Capsule),
    Cylinder { pose: Pose, radius: f64, half_length: f64 },
    Box { pose: Pose, half_sides: DVec3 },
    Triangle([DVec3; 3]),
}

/// Points within `radius` of a piece of a line; `axis` is a unit vector, or zero for a ball.
struct Capsule {
    start: DVec3,
    axis: DVec3,
    length: f64,
    radius: f64,
    /// Tangents of a curve of which this is a piece, at its two ends: its normals are across them. Zero at an end of the curve.
    tangents: [DVec3; 2],
}

impl Capsule {
    fn new(start: DVec3, end: DVec3, radius: f64) -> Capsule {
        Capsule { start, axis: (end - start).normalize_or_zero(), length: (end - start).length(), radius, tangents: [DVec3::ZERO; 2] }
    }

    /// The pieces of a curve.
    fn chain(points: &[DVec3], radius: f64) -> impl Iterator<Item = Capsule> + '_ {
        let tangent = move |i: usize| if i == 0 || i + 1 == points.len() { DVec3::ZERO } else { (points[i + 1] - points[i - 1]).normalize_or_zero() };
        (1..points.len()).map(move |i| Capsule { tangents: [tangent(i - 1), tangent(i)], ..Capsule::new(points[i - 1], points[i], radius) })
    }
}

struct Hit {
    t: f64,
    normal: DVec3,
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
            Primitive::Cylinder { pose, radius, half_length } => around(pose, DVec3::new(*radius, *radius, *half_length)),
            Primitive::Box { pose, half_sides } => around(pose, *half_sides),
            Primitive::Triangle([a, b, c]) => Bounds { low: a.min(*b).min(*c), high: a.max(*b).max(*c) },
        }
    }

    /// First hit from outside at 0 < t < `far`.
    fn hit(&self, ray: &Ray, far: f64) -> Option<Hit> {
        match self {
            Primitive::Capsule(c) => hit_capsule(ray, c, far),
            Primitive::Cylinder { pose, radius, half_length } => in_frame(pose, ray, |r| hit_cylinder(r, *radius, *half_length, far)),
            Primitive::Box { pose, half_sides } => in_frame(pose, ray, |r| hit_box(r, *half_sides, far)),
            Primitive::Triangle(corners) => hit_triangle(ray, corners, far),
        }
    }
}

fn in_frame(pose: &Pose, ray: &Ray, hit: impl Fn(&Ray) -> Option<Hit>) -> Option<Hit> {
    let local = Ray { origin: pose.inverse_transform_point(ray.origin), direction: pose.orientation.conjugate() * ray.direction };
    hit(&local).map(|h| Hit { normal: pose.orientation * h.normal, ..h })
}

/// The smaller root of |o + t d - axis|^2 = r^2 with the axis of direction `u` (unit; zero for a sphere) through the origin of `o`.
fn entry(o: DVec3, d: DVec3, u: DVec3, radius: f64) -> Option<f64> {
    let (o, d) = (o - u * o.dot(u), d - u * d.dot(u));
    let (a, b, c) = (d.length_squared(), o.dot(d), o.length_squared() - radius * radius);
    let discriminant = b * b - a * c;
    (discriminant > 0.0 && a > 0.0).then(|| (-b - discriminant.sqrt()) / a)
}

fn hit_capsule(ray: &Ray, c: &Capsule, far: f64) -> Option<Hit> {
    // From the point of the ray nearest to the start: at a meter's distance the roots of a tenth of a millimeter lose digits.
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
    (t > 0.0 && t < far && u >= 0.0 && v >= 0.0 && u + v <= 1.0).then(|| Hit { t, normal: n.normalize() * facing.signum() })
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

/// A tree of bounding boxes over the primitives, halved at the median of the longest side. Solids larger than a few pieces of thread
/// would make every box large; they stand beside the tree.
struct Tree {
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
    fn build(primitives: Vec<(Primitive, Color)>) -> Tree {
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
        let axis = if side.x >= side.y && side.x >= side.z { DVec3::X } else { [DVec3::Y, DVec3::Z][usize::from(side.z > side.y)] };
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
    fn hit(&self, ray: &Ray, far: f64, any: bool) -> Option<(Hit, Color)> {
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
        let enter = |index: usize, far: f64| self.nodes[index].bounds.enter(ray.origin, inverse, far).map(|near| (near, index));
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

/// A flat half space; it is drawn as the background with the shadows that fall on it.
struct Floor {
    point: DVec3,
    normal: DVec3,
}

struct Stage {
    tree: Tree,
    floors: Vec<Floor>,
}

impl Stage {
    fn new(subject: &Subject) -> Stage {
        let mut primitives = Vec::new();
        let mut floors = Vec::new();
        for (i, tube) in subject.tubes.iter().enumerate() {
            let color = linear(THREAD_COLORS[i % THREAD_COLORS.len()]);
            let curve = smooth(&tube.points);
            primitives.extend(Capsule::chain(&curve, tube.radius).map(|c| (Primitive::Capsule(c), color)));
        }
        for solid in &subject.solids {
            let color = linear(SOLID_COLOR);
            let pose = solid.pose;
            match &solid.geometry {
                Geometry::Plane => floors.push(Floor { point: pose.position, normal: pose.orientation * DVec3::Z }),
                Geometry::Sphere { radius } => primitives.push((Primitive::Capsule(Capsule::new(pose.position, pose.position, *radius)), color)),
                Geometry::Capsule { radius, half_length } => {
                    let (a, b) = (pose.transform_point(DVec3::Z * *half_length), pose.transform_point(DVec3::Z * -half_length));
                    primitives.push((Primitive::Capsule(Capsule::new(a, b, *radius)), color));
                }
                Geometry::Cylinder { radius, half_length } => {
                    primitives.push((Primitive::Cylinder { pose, radius: *radius, half_length: *half_length }, color));
                }
                Geometry::Box { half_sides } => primitives.push((Primitive::Box { pose, half_sides: *half_sides }, color)),
                Geometry::Mesh { vertices, triangles } => {
                    for t in triangles {
                        let corner = |k: usize| pose.transform_point(vertices[t[k] as usize]);
                        primitives.push((Primitive::Triangle([corner(0), corner(1), corner(2)]), color));
                    }
                }
            }
        }
        Stage { tree: Tree::build(primitives), floors }
    }

    fn blocked(&self, ray: &Ray, far: f64) -> bool {
        self.tree.hit(ray, far, true).is_some()
    }
}

/// Which way to look so that most of `points` is seen and spread wide: the best of a fixed set of directions.
pub fn best_direction(subject: &Subject, points: &[DVec3], up: DVec3) -> DVec3 {
    let stage = Stage::new(subject);
    let n = points.len().max(1) as f64;
    let middle = points.iter().sum::<DVec3>() / n;
    let size = points.iter().map(|p| (*p - middle).length()).fold(1e-9, f64::max);
    let (x, y) = (up.any_orthonormal_vector(), up.cross(up.any_orthonormal_vector()));
    let mut best = (f64::NEG_INFINITY, x);
    for height in [0.25, 0.55, 0.9, 1.35] {
        for k in 0..16 {
            let turn = TAU * (f64::from(k) + 0.35) / 16.0;
            let back = (x * turn.cos() + y * turn.sin()) * f64::cos(height) + up * f64::sin(height);
            let camera = Camera::fit(&Look { direction: Some(-back), up: Some(up), ..Look::default() }, points, 0.02 * size, Size { width: 4, height: 3 });
            let mut seen = 0.0;
            let mut spread = [0.0; 3];
            for p in points.iter().step_by(1 + points.len() / 200) {
                let ray = camera.toward(*p);
                let start = Ray { origin: *p + ray.direction * (0.02 * size), ..ray };
                let clear = !stage.blocked(&start, f64::INFINITY) && stage.floors.iter().all(|f| ray.direction.dot(f.normal) > 0.0);
                seen += if clear { 1.0 } else { 0.0 };
                let (u, v) = ((*p - middle).dot(camera.right), (*p - middle).dot(camera.up));
                spread = [spread[0] + u * u, spread[1] + v * v, spread[2] + 1.0];
            }
            // Wide rather than high suits the page; half of the score is being seen at all.
            let score = seen / spread[2] + 0.6 * (spread[0] / spread[2]).sqrt() / size + 0.5 * (spread[1] / spread[2]).sqrt() / size;
            if score > best.0 {
                best = (score, -back);
            }
        }
    }
    best.1
}

/// Draws the subject: a few samples in each pixel, then more where neighbors differ.
pub fn render(subject: &Subject, camera: &Camera, size: Size) -> Image {
    let painter = Painter { stage: Stage::new(subject), camera, size };
    let (columns, rows) = (size.width as usize, size.height as usize);
    let coarse = painter.each_pixel(|x, y| painter.sum(x, y, 0..FEW) / FEW as f64);
    let differs = |x: usize, y: usize| {
        let (mut low, mut high) = (Color::INFINITY, Color::NEG_INFINITY);
        for v in y.saturating_sub(1)..(y + 2).min(rows) {
            for color in &coarse[v * columns + x.saturating_sub(1)..v * columns + (x + 2).min(columns)] {
                let seen = color.map(|c| c.max(0.0).sqrt());
                (low, high) = (low.min(seen), high.max(seen));
            }
        }
        (high - low).max_element() > 0.02
    };
    let all = SAMPLE_ORDER.len();
    let fine = painter.each_pixel(|x, y| {
        let few = coarse[y * columns + x];
        if differs(x, y) { (few * FEW as f64 + painter.sum(x, y, FEW..all)) / all as f64 } else { few }
    });
    Image { size, rgb: fine.into_iter().flat_map(encode).collect() }
}

struct Painter<'a> {
    stage: Stage,
    camera: &'a Camera,
    size: Size,
}

impl Painter<'_> {
    /// The value of `paint` at each pixel, row by row, on all cores.
    fn each_pixel(&self, paint: impl Fn(usize, usize) -> Color + Sync) -> Vec<Color> {
        let columns = self.size.width as usize;
        let mut colors = vec![Color::ZERO; columns * self.size.height as usize];
        let rows = Mutex::new(colors.chunks_mut(columns).enumerate());
        let workers = std::thread::available_parallelism().map_or(1, usize::from);
        std::thread::scope(|scope| {
            for _ in 0..workers {
                scope.spawn(|| {
                    loop {
                        let next = rows.lock().expect("no worker panics while it holds the rows").next();
                        let Some((y, row)) = next else { break };
                        for (x, color) in row.iter_mut().enumerate() {
                            *color = paint(x, y);
                        }
                    }
                });
            }
        });
        colors
    }

    /// Sum over some of the samples of a pixel.
    fn sum(&self, x: usize, y: usize, samples: core::ops::Range<usize>) -> Color {
        let mut dice = Dice::new(samples.start);
        let place = |at: usize, cell: u32, count: u32| 2.0 * (at as f64 + (f64::from(cell) + 0.5) / 4.0) / f64::from(count) - 1.0;
        let one = |k: u32| {
            let (u, v) = (place(x, k % 4, self.size.width), -place(y, k / 4, self.size.height));
            look_along(&self.stage, self.camera, &self.camera.ray(u, v), v, &mut dice)
        };
        SAMPLE_ORDER[samples].iter().copied().map(one).sum()
    }
}

/// Light that comes along a ray.
fn look_along(stage: &Stage, camera: &Camera, ray: &Ray, screen_y: f64, dice: &mut Dice) -> Color {
    let background = linear([226, 231, 237]).lerp(linear([250, 251, 252]), 0.5 + 0.5 * screen_y);
    let struck = stage.tree.hit(ray, f64::INFINITY, false);
    let mut nearest = struck.as_ref().map_or(f64::INFINITY, |(h, _)| h.t);
    let mut floor_normal = None;
    for floor in &stage.floors {
        let t = (floor.point - ray.origin).dot(floor.normal) / ray.direction.dot(floor.normal);
        // A floor seen from its solid side would hide everything.
        if ray.direction.dot(floor.normal) < 0.0 && t > 0.0 && t < nearest {
            (nearest, floor_normal) = (t, Some(floor.normal));
        }
    }
    let reach = 0.12 * camera.half_width;
    let p = ray.origin + ray.direction * nearest;
    if let Some(normal) = floor_normal {
        let open = openness(stage, p, normal, 2.0 * reach, dice);
        let lit = light(stage, camera, p, normal, dice).0;
        return background * (0.96 * (0.5 + 0.5 * open) * (0.72 + 0.28 * lit));
    }
    let Some((hit, albedo)) = struck else { return background };

    let normal = hit.normal;
    let open = openness(stage, p, normal, reach, dice);
    let (lit, toward_light) = light(stage, camera, p, normal, dice);
    let facing = -normal.dot(ray.direction);
    let sky = 0.5 + 0.5 * normal.dot(camera.up);
    // A weak light from the eye keeps the roundness of what lies in shadow.
    let ambient = (0.24 + 0.2 * sky + 0.22 * facing) * (0.15 + 0.85 * open * open);
    let diffuse = 0.66 * lit * normal.dot(toward_light).max(0.0);
    let half = (toward_light - ray.direction).normalize();
    let shine = 0.16 * lit * normal.dot(half).max(0.0).powi(40);
    // A dark rim outlines each tube against what lies behind it.
    let rim = 0.25 + 0.75 * smoothstep(facing / 0.5);
    let color = albedo * ((ambient + diffuse) * rim) + shine * rim;
    // What lies deeper than the middle fades a little into the background.
    let depth = ((p - camera.at).dot(camera.forward) / (2.0 * camera.half_width)).clamp(0.0, 1.0);
    color.lerp(background, 0.2 * depth)
}

/// How much of the light from the key lamp arrives (0 or 1, softened by the average over a pixel), and from where.
fn light(stage: &Stage, camera: &Camera, p: DVec3, normal: DVec3, dice: &mut Dice) -> (f64, DVec3) {
    let lamp = (camera.up * 0.85 - camera.right * 0.45 - camera.forward * 0.75).normalize();
    let (a, b) = dice.pair();
    let across = lamp.any_orthonormal_vector();
    let (radius, turn) = (0.045 * a.sqrt(), TAU * b);
    let direction = (lamp + (across * turn.cos() + lamp.cross(across) * turn.sin()) * radius).normalize();
    if normal.dot(direction) <= 0.0 {
        return (0.0, lamp);
    }
    let ray = Ray { origin: p + normal * (1e-4 * camera.half_width), direction };
    (if stage.blocked(&ray, f64::INFINITY) { 0.0 } else { 1.0 }, lamp)
}

/// Share of the hemisphere over `p` that is open within `reach`, weighted by the cosine.
fn openness(stage: &Stage, p: DVec3, normal: DVec3, reach: f64, dice: &mut Dice) -> f64 {
    let across = normal.any_orthonormal_vector();
    let other = normal.cross(across);
    let mut open = 0.0;
    for _ in 0..OCCLUSION_RAYS {
        let (a, b) = dice.pair();
        let (radius, turn) = (a.sqrt(), TAU * b);
        let direction = (across * turn.cos() + other * turn.sin()) * radius + normal * (1.0 - a).max(0.0).sqrt();
        let ray = Ray { origin: p + normal * (1e-3 * reach), direction };
        open += stage.tree.hit(&ray, reach, false).map_or(1.0, |(h, _)| (h.t / reach).sqrt());
    }
    open / f64::from(OCCLUSION_RAYS)
}

/// Evenly spread pairs in the unit square: the sequence of the plastic number (Roberts 2018). Every pixel uses the same ones, so that
/// what is smooth looks smooth and not grainy.
struct Dice {
    at: (f64, f64),
}

impl Dice {
    /// The sequence from the first pair of a sample on.
    fn new(sample: usize) -> Dice {
        let skipped = (sample * (1 + OCCLUSION_RAYS as usize)) as f64;
        Dice { at: ((0.5 + skipped * PLASTIC.0).fract(), (0.5 + skipped * PLASTIC.1).fract()) }
    }
    fn pair(&mut self) -> (f64, f64) {
        self.at = ((self.at.0 + PLASTIC.0).fract(), (self.at.1 + PLASTIC.1).fract());
        self.at
    }
}

/// One over the plastic number, and one over its square.
const PLASTIC: (f64, f64) = (0.754_877_666_246_692_8, 0.569_840_290_998_053_3);

fn smoothstep(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

fn linear(srgb: [u8; 3]) -> Color {
    let one = |v: u8| (f64::from(v) / 255.0).powf(2.2);
    Color::new(one(srgb[0]), one(srgb[1]), one(srgb[2]))
}

fn encode(c: Color) -> [u8; 3] {
    let one = |v: f64| (255.0 * v.clamp(0.0, 1.0).powf(1.0 / 2.2)).round() as u8;
    [one(c.x), one(c.y), one(c.z)]
}

/// The part of the threads worth a closer look: points where thread lies near other thread (or near itself, `pi` radii along it
/// left out); where there is none, around the sharpest bend; nothing when the threads are nearly straight.
pub fn knot_region(tubes: &[Tube]) -> Vec<DVec3> {
    let all: Vec<(usize, f64, DVec3, f64)> = tubes
        .iter()
        .enumerate()
        .flat_map(|(k, tube)| {
            let mut arc = 0.0;
            let mut last = tube.points.first().copied().unwrap_or(DVec3::ZERO);
            tube.points.iter().map(move |p| {
                arc += (*p - last).length();
                last = *p;
                (k, arc, *p, tube.radius)
            })
        })
        .collect();
    let near = |factor: f64| {
        let touching = |(k, s, p, r): &(usize, f64, DVec3, f64)| {
            all.iter().any(|(k2, s2, p2, r2)| {
                let reach = factor * (r + r2);
                (p2 - p).length_squared() < reach * reach && (k != k2 || (s - s2).abs() > PI * (factor + 1.0) * r.max(*r2))
            })
        };
        all.iter().filter(|a| touching(a)).map(|a| a.2).collect::<Vec<_>>()
    };
    let mut points = near(2.0);
    if points.len() < 4 {
        points = near(4.0);
    }
    if points.len() < 4 {
        let bend = |w: &[DVec3]| (w[0] - w[1] * 2.0 + w[2]).length() * 4.0 / (w[2] - w[0]).length_squared();
        let bends = tubes.iter().flat_map(|t| t.points.windows(3).map(move |w| (bend(w) * t.radius, w[1], t.radius)));
        // Bends of more than fifty radii are no sight.
        if let Some((_, p, r)) = bends.filter(|b| b.0 > 0.02).max_by(|a, b| a.0.total_cmp(&b.0)) {
            points = all.iter().filter(|a| (a.2 - p).length() < 30.0 * r).map(|a| a.2).collect();
        }
    }
    // The far tenth is left out: a thread that brushes another far away is not the knot.
    let middle = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
    points.sort_by(|a, b| (*a - middle).length().total_cmp(&(*b - middle).length()));
    points.truncate((points.len() * 9).div_ceil(10));
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Size = Size { width: 48, height: 48 };

    /// Two threads that cross at the origin, the first along x at height `z` over the second along y.
    fn crossing(z: f64) -> Subject {
        let tube = |along: DVec3, at: DVec3| Tube { points: (-4..=4).map(|i| along * (f64::from(i) * 1e-3) + at).collect(), radius: 3e-4 };
        Subject { tubes: vec![tube(DVec3::X, DVec3::Z * z), tube(DVec3::Y, DVec3::ZERO)], solids: Vec::new() }
    }

    fn from_above(subject: &Subject, orthographic: bool) -> Image {
        let look = Look { direction: Some(-DVec3::Z), up: Some(DVec3::Y), at: Some(DVec3::ZERO), width: Some(4e-3), orthographic };
        render(subject, &Camera::fit(&look, &[], 1e-4, SIZE), SIZE)
    }

    /// Blue less red at a pixel: positive on the first thread's color, negative on the second's.
    fn blueness(image: &Image, x: u32, y: u32) -> i32 {
        let at = (3 * (y * image.size.width + x)) as usize;
        i32::from(image.rgb[at + 2]) - i32::from(image.rgb[at])
    }

    #[test]
    fn the_upper_thread_covers_the_lower_one() {
        for orthographic in [false, true] {
            let (over, under) = (from_above(&crossing(7e-4), orthographic), from_above(&crossing(-7e-4), orthographic));
            // The colors differ by over 100 of 255; shading and fading take less than half of that.
            assert!(blueness(&over, 24, 24) > 40, "the first thread is over: {}", blueness(&over, 24, 24));
            assert!(blueness(&under, 24, 24) < -40, "the first thread is under: {}", blueness(&under, 24, 24));
            // Beside the crossing each is seen: x runs to the right, y upward.
            assert!(blueness(&over, 44, 24) > 40 && blueness(&over, 24, 4) < -40);
        }
    }

    #[test]
    fn a_picture_has_the_same_bytes_each_time() {
        assert!(from_above(&crossing(7e-4), false).rgb == from_above(&crossing(7e-4), false).rgb, "whatever thread draws which row");
    }

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
                        assert!((hit.normal.length() - 1.0).abs() < 1e-9 && hit.normal.dot(ray.direction) < 1e-9, "toward the eye");
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
        let down = |x: f64, y: f64| hit_triangle(&Ray { origin: DVec3::new(x, y, 2.0), direction: -DVec3::Z }, &corners, 10.0);
        let hit = down(0.2, 0.3).expect("inside");
        assert!((hit.t - 2.0).abs() < 1e-15 && hit.normal == DVec3::Z);
        assert!(down(0.6, 0.6).is_none() && down(-0.1, 0.5).is_none());
        let up = hit_triangle(&Ray { origin: DVec3::new(0.2, 0.3, -1.0), direction: DVec3::Z }, &corners, 10.0).expect("from below");
        assert_eq!(up.normal, -DVec3::Z);
    }

    #[test]
    fn everything_fits_into_the_picture() {
        let points: Vec<DVec3> = (0..200).map(|i| f64::from(i) * 0.1).map(|t| DVec3::new(t.cos(), 2.0 * t.sin(), 0.3 * t) * 1e-2).collect();
        for orthographic in [false, true] {
            let look = Look { direction: Some(DVec3::new(0.4, 0.7, -0.3)), orthographic, ..Look::default() };
            let camera = Camera::fit(&look, &points, 1e-3, Size { width: 400, height: 300 });
            let mut widest = 0.0_f64;
            for p in &points {
                let d = *p - camera.at;
                let depth = d.dot(camera.forward);
                let scale = if orthographic { 1.0 } else { camera.distance / (camera.distance + depth) };
                let (u, v) = (d.dot(camera.right) * scale / camera.half_width, d.dot(camera.up) * scale * camera.aspect / camera.half_width);
                assert!(u.abs() < 1.0 && v.abs() < 1.0, "{u} {v}");
                widest = widest.max(u.abs()).max(v.abs());
            }
            // A margin of a radius and a twelfth, no more than a third of the picture wasted.
            assert!(widest > 0.66, "{widest}");
        }
    }

    #[test]
    fn the_smooth_curve_stays_near_the_polyline() {
        let x: Vec<DVec3> = (0..=24).map(|i| f64::from(i) * 0.5).map(|t| DVec3::new(t.cos(), t.sin(), 0.2 * t)).collect();
        let curve = smooth(&x);
        assert_eq!((curve[0], curve[curve.len() - 1]), (x[0], x[24]));
        // The second difference of a circle of radius 1 in steps of 0.5 rad is 2 (1 - cos 0.5) = 0.245: a sixteenth of it is 0.0153, and
        // the curve's own second order adds a tenth. The first and last pieces, which begin at the end itself, keep within an eighth.
        let far = |p: &DVec3| {
            let to_segment = |w: &[DVec3]| {
                let d = w[1] - w[0];
                (*p - w[0] - d * ((*p - w[0]).dot(d) / d.length_squared()).clamp(0.0, 1.0)).length()
            };
            x.windows(2).map(to_segment).fold(f64::INFINITY, f64::min)
        };
        let ends = |p: &&DVec3| [x[0], x[24]].iter().any(|e| (**p - *e).length() < 0.8);
        assert!(curve.iter().map(far).fold(0.0, f64::max) < 0.0306);
        let inner = curve.iter().filter(|p| !ends(p)).map(far).fold(0.0, f64::max);
        assert!(inner < 0.0153 * 1.1, "{inner}");
        let sharpest = curve.windows(3).map(|w| (w[1] - w[0]).angle_between(w[2] - w[1])).fold(0.0, f64::max);
        assert!(sharpest < 0.16, "pieces of 0.08 rad, twice that where curves of different bend meet: {sharpest}");
    }

    #[test]
    fn the_knot_region_is_where_thread_meets_thread() {
        let crossing = crossing(7e-4);
        let points = knot_region(&crossing.tubes);
        assert!(!points.is_empty() && points.iter().all(|p| p.length() < 3e-3), "around the origin: {points:?}");
        let straight = [Tube { points: (0..50).map(|i| DVec3::X * (f64::from(i) * 1e-3)).collect(), radius: 1e-4 }];
        assert!(knot_region(&straight).is_empty(), "nothing to see on a straight thread");
    }
}
