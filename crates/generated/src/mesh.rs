//! Shapes as triangles, wound so that normals point out of the material.

use core::f64::consts::{PI, TAU};
use sutura::Geometry;
use sutura::glam::DVec3;

/// A box.
pub fn cuboid(half: DVec3) -> Geometry {
    let sign = |bit: usize| if bit == 0 { -1.0 } else { 1.0 };
    let vertices = (0..8).map(|k| DVec3::new(sign(k & 1), sign(k >> 1 & 1), sign(k >> 2)) * half).collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    Geometry::Mesh { vertices, triangles: quads.into_iter().flat_map(halves).collect() }
}

fn halves([a, b, c, d]: [u32; 4]) -> [[u32; 3]; 2] {
    [[a, b, c], [a, c, d]]
}

/// A profile (radius, height) that has the material on its left, turned about z in `n` pieces; `closed`: its end is
/// joined to its start. No point of it is on the axis.
fn turned(profile: &[(f64, f64)], closed: bool, n: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let m = profile.len() as u32;
    let at = |i: u32, (r, z): (f64, f64)| {
        let (s, c) = libm::sincos(TAU * f64::from(i) / f64::from(n));
        DVec3::new(r * c, r * s, z)
    };
    let quad = |i: u32, k: u32| {
        let (j, l) = ((i + 1) % n, (k + 1) % m);
        halves([i * m + k, j * m + k, j * m + l, i * m + l])
    };
    let strips = m - u32::from(!closed);
    let vertices = (0..n).flat_map(|i| profile.iter().map(move |p| at(i, *p))).collect();
    (vertices, (0..n).flat_map(|i| (0..strips).flat_map(move |k| quad(i, k))).collect())
}

fn closed(profile: &[(f64, f64)], n: u32) -> Geometry {
    let (vertices, triangles) = turned(profile, true, n);
    Geometry::Mesh { vertices, triangles }
}

/// A solid whose profile (radius, height) begins and ends on the axis, at these heights.
fn solid(bottom: f64, profile: &[(f64, f64)], top: f64, n: u32) -> Geometry {
    let (mut vertices, mut triangles) = turned(profile, false, n);
    let (m, low) = (profile.len() as u32, vertices.len() as u32);
    vertices.extend([DVec3::Z * bottom, DVec3::Z * top]);
    let fans = |i: u32| {
        let j = (i + 1) % n;
        [[low, j * m, i * m], [low + 1, i * m + m - 1, j * m + m - 1]]
    };
    triangles.extend((0..n).flat_map(fans));
    Geometry::Mesh { vertices, triangles }
}

/// A cylinder of `n` sides.
pub fn cylinder(radius: f64, half_length: f64, n: u32) -> Geometry {
    solid(-half_length, &[(radius, -half_length), (radius, half_length)], half_length, n)
}

/// A ball of `n` meridians.
pub fn ball(radius: f64, n: u32) -> Geometry {
    let rings = n / 2;
    let at = |k: u32| libm::sincos(PI * (f64::from(k) / f64::from(rings) - 0.5));
    let profile: Vec<(f64, f64)> = (1..rings).map(at).map(|(s, c)| (radius * c, radius * s)).collect();
    solid(-radius, &profile, radius, n)
}

/// A tube about z with an inner and an outer wall, its ends closed between them; `n` sides, `rings` pieces along it.
pub fn tube(inner: f64, wall: f64, half_length: f64, n: u32, rings: u32) -> Geometry {
    let z = |k: u32| half_length * (2.0 * f64::from(k) / f64::from(rings) - 1.0);
    let outside = (0..=rings).map(|k| (inner + wall, z(k)));
    let inside = (0..=rings).rev().map(|k| (inner, z(k)));
    closed(&outside.chain(inside).collect::<Vec<_>>(), n)
}

/// A ring about z.
pub fn torus(major: f64, minor: f64, n: u32, around: u32) -> Geometry {
    let at = |k: u32| libm::sincos(TAU * f64::from(k) / f64::from(around));
    let profile: Vec<(f64, f64)> = (0..around).map(at).map(|(s, c)| (major + minor * c, minor * s)).collect();
    closed(&profile, n)
}

/// Two walls that face each other across z, each a box of this thickness or, without any, a sheet.
pub fn slot(half_gap: f64, thickness: f64, half: f64) -> Geometry {
    let wall = |sign: f64| {
        let plain = if thickness > 0.0 {
            cuboid(DVec3::new(half, half, 0.5 * thickness))
        } else {
            sheet(half, half, 1, 1, 0.0)
        };
        let turn = if sign < 0.0 { sutura::glam::DQuat::from_rotation_x(PI) } else { sutura::glam::DQuat::IDENTITY };
        moved(plain, |v| turn * v + DVec3::Z * (sign * (half_gap + 0.5 * thickness)))
    };
    joined(wall(-1.0), wall(1.0))
}

/// A sheet across z with a boundary, in `n` by `m` squares, which waves by `wave`.
pub fn sheet(half_x: f64, half_y: f64, n: u32, m: u32, wave: f64) -> Geometry {
    let at = |i: u32, j: u32| {
        let (u, v) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(m));
        DVec3::new(half_x * (2.0 * u - 1.0), half_y * (2.0 * v - 1.0), wave * libm::sin(5.0 * u) * libm::cos(4.0 * v))
    };
    let vertices = (0..=n).flat_map(|i| (0..=m).map(move |j| at(i, j))).collect();
    let number = |i: u32, j: u32| i * (m + 1) + j;
    let square = |i: u32, j: u32| halves([number(i, j), number(i + 1, j), number(i + 1, j + 1), number(i, j + 1)]);
    Geometry::Mesh { vertices, triangles: (0..n).flat_map(|i| (0..m).flat_map(move |j| square(i, j))).collect() }
}

/// The same surface with its other side out.
pub fn inward(geometry: Geometry) -> Geometry {
    let Geometry::Mesh { vertices, triangles } = geometry else { return geometry };
    Geometry::Mesh { vertices, triangles: triangles.into_iter().map(|[a, b, c]| [a, c, b]).collect() }
}

fn moved(geometry: Geometry, by: impl Fn(DVec3) -> DVec3) -> Geometry {
    let Geometry::Mesh { vertices, triangles } = geometry else { return geometry };
    Geometry::Mesh { vertices: vertices.into_iter().map(by).collect(), triangles }
}

fn joined(a: Geometry, b: Geometry) -> Geometry {
    let (Geometry::Mesh { mut vertices, mut triangles }, Geometry::Mesh { vertices: more, triangles: faces }) = (a, b)
    else {
        unreachable!("both are meshes")
    };
    let n = vertices.len() as u32;
    vertices.extend(more);
    triangles.extend(faces.into_iter().map(|t| t.map(|v| v + n)));
    Geometry::Mesh { vertices, triangles }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    /// Volume by the divergence theorem, and whether every edge is used once in each direction.
    fn volume(geometry: &Geometry) -> (f64, bool) {
        let Geometry::Mesh { vertices, triangles } = geometry else { unreachable!() };
        let mut edges = BTreeMap::new();
        let mut sum = 0.0;
        for t in triangles {
            let [a, b, c] = t.map(|v| vertices[v as usize]);
            sum += a.dot(b.cross(c)) / 6.0;
            for (from, to) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                *edges.entry((from, to)).or_insert(0) += 1;
            }
        }
        (sum, edges.iter().all(|((a, b), n)| *n == 1 && edges.get(&(*b, *a)) == Some(&1)))
    }

    #[test]
    fn closed_meshes_are_closed_and_have_their_volume() {
        let polygon = |n: f64| 0.5 * n * (TAU / n).sin();
        let all = [
            (cuboid(DVec3::new(1.0, 2.0, 3.0)), 48.0),
            (cylinder(2.0, 3.0, 12), polygon(12.0) * 4.0 * 6.0),
            (tube(1.0, 0.5, 2.0, 10, 3), polygon(10.0) * (2.25 - 1.0) * 4.0),
            (slot(1.0, 0.5, 2.0), 2.0 * 16.0 * 0.5),
        ];
        for (mesh, wanted) in all {
            let (v, closed) = volume(&mesh);
            assert!(closed && (v - wanted).abs() < 1e-12 * wanted, "{v} for {wanted}");
            let (v, closed) = volume(&inward(mesh));
            assert!(closed && (v + wanted).abs() < 1e-12 * wanted);
        }
        // A ball and a ring in flat pieces are a little smaller than round ones.
        let (v, closed) = volume(&ball(1.0, 24));
        assert!(closed && v < 4.0 / 3.0 * PI && v > 0.95 * 4.0 / 3.0 * PI, "{v} {closed}");
        let (v, closed) = volume(&torus(3.0, 1.0, 32, 16));
        let round = 2.0 * PI * PI * 3.0;
        assert!(closed && v < round && v > 0.95 * round, "{v}");
        assert!(!volume(&sheet(1.0, 1.0, 3, 2, 0.1)).1);
    }
}
