//! The subject as rays meet it, and the light that comes back along them.

use super::camera::Camera;
use super::cast::{Capsule, Primitive, Ray, Tree};
use super::{Color, Subject};
use core::f64::consts::TAU;
use sutura::Geometry;
use sutura::glam::DVec3;
use sutura_scene::export::THREAD_COLORS;

const SOLID_COLOR: [u8; 3] = [206, 202, 194];

/// Ambient occlusion rays for each sample; a pixel averages 4 or 16 times as many.
const OCCLUSION_RAYS: u32 = 2;

pub(super) struct Stage {
    tree: Tree,
    pub floors: Vec<Floor>,
}

/// A flat half space; it is drawn as the background with the shadows that fall on it.
pub(super) struct Floor {
    point: DVec3,
    pub normal: DVec3,
}

impl Stage {
    pub fn new(subject: &Subject) -> Stage {
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
                Geometry::Sphere { radius } => {
                    primitives.push((Primitive::Capsule(Capsule::new(pose.position, pose.position, *radius)), color));
                }
                Geometry::Capsule { radius, half_length } => {
                    let (a, b) =
                        (pose.transform_point(DVec3::Z * *half_length), pose.transform_point(DVec3::Z * -half_length));
                    primitives.push((Primitive::Capsule(Capsule::new(a, b, *radius)), color));
                }
                Geometry::Cylinder { radius, half_length } => {
                    primitives.push((Primitive::Cylinder { pose, radius: *radius, half_length: *half_length }, color));
                }
                Geometry::Box { half_sides } => {
                    primitives.push((Primitive::Box { pose, half_sides: *half_sides }, color));
                }
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

    pub fn blocked(&self, ray: &Ray, far: f64) -> bool {
        self.tree.hit(ray, far, true).is_some()
    }
}

/// Points of a smooth curve near the polyline `x`: a quadratic B-spline whose control points are moved out by a
/// sixteenth of the second difference, so that it leaves the polyline by no more than a sixteenth of it, outward at the
/// middles of the elements and inward at the joints alike. Neighboring pieces turn by at most 0.08 rad, which an
/// outline hardly shows, and shading turns smoothly from one to the next (see [`Capsule`]).
fn smooth(x: &[DVec3]) -> Vec<DVec3> {
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

/// Light that comes along a ray.
pub(super) fn look_along(stage: &Stage, camera: &Camera, ray: &Ray, screen_y: f64, dice: &mut Dice) -> Color {
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

/// Evenly spread pairs in the unit square: the sequence of the plastic number (Roberts 2018). Every pixel uses the same
/// ones, so that what is smooth looks smooth and not grainy.
pub(super) struct Dice {
    at: (f64, f64),
}

impl Dice {
    /// The sequence from the first pair of a sample on.
    pub fn new(sample: usize) -> Dice {
        let skipped = (sample * (1 + OCCLUSION_RAYS as usize)) as f64;
        Dice { at: ((0.5 + skipped * PLASTIC.0).fract(), (0.5 + skipped * PLASTIC.1).fract()) }
    }
    pub fn pair(&mut self) -> (f64, f64) {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smooth_curve_stays_near_the_polyline() {
        let x: Vec<DVec3> =
            (0..=24).map(|i| f64::from(i) * 0.5).map(|t| DVec3::new(t.cos(), t.sin(), 0.2 * t)).collect();
        let curve = smooth(&x);
        assert_eq!((curve[0], curve[curve.len() - 1]), (x[0], x[24]));
        // The second difference of a circle of radius 1 in steps of 0.5 rad is 2 (1 - cos 0.5) = 0.245: a sixteenth of
        // it is 0.0153, and the curve's own second order adds a tenth. The first and last pieces, which begin at the
        // end itself, keep within an eighth.
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
}
