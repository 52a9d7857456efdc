//! Triangles of shapes, with normals and coordinates of a texture.

use core::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};
use sutura::Geometry;
use sutura::glam::DVec3;

/// A surface of triangles, lengths in meters.
#[derive(Debug, Clone, Default)]
pub struct Triangles {
    /// Corners \[m\].
    pub positions: Vec<DVec3>,
    /// Unit normals at the corners.
    pub normals: Vec<DVec3>,
    /// Coordinates of a texture at the corners \[m\]: lengths along the surface.
    pub uvs: Vec<[f64; 2]>,
    /// Corners of each triangle, counterclockwise seen from outside.
    pub indices: Vec<[u32; 3]>,
}

/// Sides of what is round.
const SIDES: usize = 64;
/// Part of the smaller size of a cylinder or box by which its edges are rounded: metal that is handled has no sharp
/// edges, and a round one catches light.
const ROUND: f64 = 0.04;

impl Triangles {
    /// Of a shape in its own frame; a plane is drawn as a square with sides of twice `plane` \[m\].
    pub fn of(geometry: &Geometry, plane: f64) -> Triangles {
        match geometry {
            Geometry::Plane => {
                let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
                let positions: Vec<DVec3> =
                    corners.iter().map(|(x, y)| DVec3::new(x * plane, y * plane, 0.0)).collect();
                let uvs = positions.iter().map(|p| [p.x, p.y]).collect();
                Triangles { positions, normals: vec![DVec3::Z; 4], uvs, indices: vec![[0, 1, 2], [0, 2, 3]] }
            }
            Geometry::Sphere { radius } => Self::turned(&arc(0.0, 0.0, *radius, -FRAC_PI_2, FRAC_PI_2, 32)),
            Geometry::Capsule { radius, half_length } => {
                let mut profile = arc(0.0, -half_length, *radius, -FRAC_PI_2, 0.0, 16);
                profile.extend(arc(0.0, *half_length, *radius, 0.0, FRAC_PI_2, 16));
                Self::turned(&profile)
            }
            Geometry::Cylinder { radius, half_length } => {
                let edge = ROUND * radius.min(*half_length);
                let mut profile = vec![(0.0, -half_length, -FRAC_PI_2)];
                profile.extend(arc(radius - edge, edge - half_length, edge, -FRAC_PI_2, 0.0, 6));
                profile.extend(arc(radius - edge, half_length - edge, edge, 0.0, FRAC_PI_2, 6));
                profile.push((0.0, *half_length, FRAC_PI_2));
                Self::turned(&profile)
            }
            Geometry::Box { half_sides } => Self::boxed(*half_sides),
            Geometry::Mesh { vertices, triangles } => Self::flat(vertices, triangles),
        }
    }

    /// A profile (distance from the z axis, z, angle of the normal above the horizon) turned about the z axis.
    fn turned(profile: &[(f64, f64, f64)]) -> Triangles {
        let mut out = Triangles::default();
        let (mut along, mut before) = (0.0, profile[0]);
        let widest = profile.iter().map(|p| p.0).fold(0.0, f64::max);
        for (r, z, slope) in profile {
            along += (r - before.0).hypot(z - before.1);
            before = (*r, *z, *slope);
            for k in 0..=SIDES {
                let turn = TAU * k as f64 / SIDES as f64;
                let out_of = DVec3::new(turn.cos(), turn.sin(), 0.0);
                out.positions.push(out_of * *r + DVec3::Z * *z);
                out.normals.push(out_of * slope.cos() + DVec3::Z * slope.sin());
                out.uvs.push([turn * widest, along]);
            }
        }
        out.grid(profile.len(), SIDES);
        out
    }

    /// Triangles between neighboring rows of `sides` + 1 corners.
    pub(crate) fn grid(&mut self, rows: usize, sides: usize) {
        for i in 0..rows.saturating_sub(1) {
            for k in 0..sides {
                let a = (i * (sides + 1) + k) as u32;
                let b = a + sides as u32 + 1;
                self.indices.extend([[a, a + 1, b + 1], [a, b + 1, b]]);
            }
        }
    }

    /// A box with rounded edges: each face a grid that is pressed onto the smaller box within and blown up by the
    /// radius of the edge.
    fn boxed(half: DVec3) -> Triangles {
        let edge = ROUND * 2.0 * half.min_element();
        let inner = half - edge;
        let mut out = Triangles::default();
        // Places across a face: fine in the edge, none in the flat.
        let across = |h: f64| -> Vec<f64> {
            let bend: Vec<f64> = (0..=4).map(|k| h - edge + edge * (FRAC_PI_4 * f64::from(k) / 4.0).tan()).collect();
            bend.iter().rev().map(|b| -b).chain(bend.iter().copied()).collect()
        };
        for axis in 0..3 {
            for sign in [-1.0, 1.0] {
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                let (us, vs) = (across(half[u]), across(half[v]));
                let first = out.positions.len() as u32;
                for b in &vs {
                    for a in &us {
                        let mut p = DVec3::ZERO;
                        (p[axis], p[u], p[v]) = (sign * half[axis], *a * sign, *b);
                        let core = p.clamp(-inner, inner);
                        let normal = (p - core).normalize();
                        out.positions.push(core + normal * edge);
                        out.normals.push(normal);
                        out.uvs.push([*a, *b]);
                    }
                }
                for i in 0..vs.len() - 1 {
                    for k in 0..us.len() - 1 {
                        let a = first + (i * us.len() + k) as u32;
                        let b = a + us.len() as u32;
                        out.indices.extend([[a, a + 1, b + 1], [a, b + 1, b]]);
                    }
                }
            }
        }
        out
    }

    /// Triangles of a mesh, each with corners and a normal of its own.
    fn flat(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Triangles {
        let mut out = Triangles::default();
        for t in triangles {
            let corners = t.map(|i| vertices[i as usize]);
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or(DVec3::Z);
            let u = (corners[1] - corners[0]).normalize_or(DVec3::X);
            let v = normal.cross(u);
            let first = out.positions.len() as u32;
            for c in corners {
                out.positions.push(c);
                out.normals.push(normal);
                out.uvs.push([(c - corners[0]).dot(u), (c - corners[0]).dot(v)]);
            }
            out.indices.push([first, first + 1, first + 2]);
        }
        out
    }

    /// Where a ray from outside first meets it, as a multiple of its direction.
    pub fn hit(&self, origin: DVec3, direction: DVec3) -> Option<f64> {
        let mut best: Option<f64> = None;
        for t in &self.indices {
            let [a, b, c] = t.map(|i| self.positions[i as usize]);
            let (e1, e2) = (b - a, c - a);
            let p = direction.cross(e2);
            let det = e1.dot(p);
            if det == 0.0 {
                continue;
            }
            let s = origin - a;
            let u = s.dot(p) / det;
            let q = s.cross(e1);
            let v = direction.dot(q) / det;
            let at = e2.dot(q) / det;
            if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && at > 0.0 && best.is_none_or(|b| at < b) {
                best = Some(at);
            }
        }
        best
    }
}

/// Part of a circle as a profile: center (from the axis, along it), radius, angles above the horizon.
fn arc(x: f64, z: f64, radius: f64, from: f64, to: f64, pieces: usize) -> Vec<(f64, f64, f64)> {
    let at = |k: usize| {
        let angle = from + (to - from) * k as f64 / pieces as f64;
        // The poles lie on the axis, whatever the cosine of a rounded right angle is.
        let r = if (angle.abs() - FRAC_PI_2).abs() < 1e-9 * PI { x } else { x + radius * angle.cos() };
        (r, z + radius * angle.sin(), angle)
    };
    (0..=pieces).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Volume by the divergence theorem: wrong where a triangle is missing or seen from inside.
    fn volume(t: &Triangles) -> f64 {
        t.indices.iter().map(|i| i.map(|k| t.positions[k as usize])).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
    }

    #[test]
    fn solids_are_closed_and_of_their_size() {
        let cases = [
            (Geometry::Sphere { radius: 0.5 }, 4.0 / 3.0 * PI * 0.125),
            (Geometry::Capsule { radius: 0.5, half_length: 1.0 }, 4.0 / 3.0 * PI * 0.125 + PI * 0.25 * 2.0),
            (Geometry::Cylinder { radius: 0.5, half_length: 1.0 }, PI * 0.25 * 2.0),
            (Geometry::Box { half_sides: DVec3::new(0.5, 1.0, 1.5) }, 6.0),
        ];
        for (geometry, want) in cases {
            let t = Triangles::of(&geometry, 0.0);
            // Flat sides of what is round, and rounded edges, take off less than this.
            let got = volume(&t) / want;
            assert!(got > 0.985 && got <= 1.0, "{geometry:?}: {got}");
            for i in &t.indices {
                let [a, b, c] = i.map(|k| t.positions[k as usize]);
                let n = (b - a).cross(c - a);
                // A triangle at a pole has no area.
                assert!(
                    n.length() < 1e-12 || i.iter().all(|k| n.normalize().dot(t.normals[*k as usize]) > 0.7),
                    "{geometry:?}"
                );
            }
        }
    }

    #[test]
    fn a_ray_meets_the_near_side() {
        let t = Triangles::of(&Geometry::Sphere { radius: 0.5 }, 0.0);
        let at = t.hit(DVec3::new(-2.0, 0.01, 0.02), DVec3::X).unwrap();
        assert!((at - 1.5).abs() < 0.01, "{at}");
        assert_eq!(t.hit(DVec3::new(-2.0, 1.0, 0.0), DVec3::X), None);
    }
}
