//! A cloth that lies on a table, with the folds that it has from being spread out by hand.

use crate::draw;
use crate::look::DRAPE_TILE;
use crate::mesh::Triangles;
use bevy::prelude::Mesh;
use sutura::glam::{DVec2, DVec3};

/// A cloth in the plane z = 0 of its own axes, its folds below.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cloth {
    /// Half the side of the part that is looked at \[m\]: there its mesh is fine, and beyond it gets darker, as beside
    /// the lamp of a table.
    pub reach: f64,
    /// Half the side of all of it \[m\].
    pub half: f64,
    /// Factor on the height of its folds; 0 is ironed.
    pub folds: f64,
}

/// One fold: a long ridge that ends gently, and bends a little.
struct Fold {
    at: DVec2,
    along: DVec2,
    length: f64,
    width: f64,
    height: f64,
    bend: f64,
}

/// Folds lie within this distance from the middle \[m\], and there are as many.
const FOLDED: f64 = 0.42;
const FOLDS: u32 = 84;

impl Default for Cloth {
    fn default() -> Self {
        Cloth { reach: 0.1, half: 3.0, folds: 0.0 }
    }
}

impl Cloth {
    /// As a mesh for the material [`drape`](crate::look::Materials::drape), a meter in so many units, in the axes of
    /// the engine.
    pub fn mesh(&self, scale: f32) -> Mesh {
        let (surface, light) = self.surface();
        let colors: Vec<[f32; 4]> = light.iter().map(|l| [*l, *l, *l, 1.0]).collect();
        draw::mesh(&surface, scale, DRAPE_TILE).with_inserted_attribute(Mesh::ATTRIBUTE_COLOR, colors)
    }

    /// Its surface, and how much light comes to each corner: less in the valleys, and less far from the middle.
    pub fn surface(&self) -> (Triangles, Vec<f32>) {
        // Cells a side: ironed cloth needs them for the light alone. Small triangles cost more than anything else where
        // the renderer is software.
        let n: usize = if self.folds > 0.0 { 72 } else { 32 };
        let at = |k: usize| self.along_side(2.0 * k as f64 / n as f64 - 1.0);
        let folds = folds();
        let height = |x: f64, y: f64| {
            let p = DVec2::new(x, y);
            // Far away nothing stands up against the dark.
            let near = self.folds / (1.0 + (p.length() / (1.8 * self.reach)).powi(4));
            if self.folds > 0.0 { near * folds.iter().map(|f| f.height(p)).sum::<f64>() } else { 0.0 }
        };
        let mut heights: Vec<f64> =
            (0..=n).flat_map(|j| (0..=n).map(move |i| (i, j))).map(|(i, j)| height(at(i), at(j))).collect();
        let crest = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        heights.iter_mut().for_each(|h| *h -= crest);
        let h = |i: usize, j: usize| heights[j * (n + 1) + i];
        let (mut out, mut light) = (Triangles::default(), Vec::new());
        for j in 0..=n {
            for i in 0..=n {
                let (x, y) = (at(i), at(j));
                // Normals are finer than the corners are apart.
                let e = 5e-4;
                let slope =
                    DVec2::new(height(x + e, y) - height(x - e, y), height(x, y + e) - height(x, y - e)) / (2.0 * e);
                out.positions.push(DVec3::new(x, y, h(i, j)));
                out.normals.push(DVec3::new(-slope.x, -slope.y, 1.0).normalize());
                out.uvs.push([x, y]);
                // A corner below its surroundings sees less of the room.
                let (i0, i1, j0, j1) = (i.saturating_sub(2), (i + 2).min(n), j.saturating_sub(2), (j + 2).min(n));
                let around = 0.25 * (h(i0, j) + h(i1, j) + h(i, j0) + h(i, j1));
                let open = (1.0 + 260.0 * (h(i, j) - around)).clamp(0.55, 1.12);
                let far = (DVec2::new(x, y).length() / self.reach - 0.55).max(0.0);
                light.push((open / (1.0 + 0.28 * far * far)) as f32);
            }
        }
        out.grid(n + 1, n);
        (out, light)
    }

    /// Where along a side a part from -1 to 1 of the cells ends: most of them are where one looks.
    fn along_side(&self, t: f64) -> f64 {
        let (inner, part) = (1.35 * self.reach, 0.74);
        let s = t.abs();
        let x = if s <= part {
            inner * s / part
        } else {
            inner * (self.half / inner).max(1.0).powf(((s - part) / (1.0 - part)).powf(1.3))
        };
        x.copysign(t)
    }
}

impl Fold {
    fn height(&self, p: DVec2) -> f64 {
        let d = p - self.at;
        let s = d.dot(self.along);
        if s.abs() > 2.2 * self.length {
            return 0.0;
        }
        let across = d.perp_dot(self.along) + self.bend * s * s;
        // Folds are narrow where they are high and run out wide.
        let w = self.width * (1.0 + 0.5 * (s / self.length).powi(2));
        let u = across / w;
        if u.abs() > 4.0 { 0.0 } else { self.height * (-(s / self.length).powi(2)).exp() / (1.0 + u * u).powi(2) }
    }
}

/// The folds, most of them along two ways that cross.
fn folds() -> Vec<Fold> {
    (0..FOLDS)
        .map(|k| {
            let r = |n: u32| noise(8 * k + n);
            let at = DVec2::new(2.0 * r(0) - 1.0, 2.0 * r(1) - 1.0) * FOLDED;
            let angle = if k % 4 == 0 { -0.9 } else { 0.42 } + 0.75 * (r(2) - 0.5);
            let size = 0.6 + 0.8 * r(3);
            Fold {
                at,
                along: DVec2::from_angle(angle),
                length: (0.045 + 0.075 * r(4)) * size,
                width: (0.009 + 0.009 * r(5)) * size,
                height: (0.0022 + 0.0075 * r(6) * r(6)) * size,
                bend: 5.0 * (r(7) - 0.5),
            }
        })
        .collect()
}

/// A number in [0, 1) that looks random, by number.
fn noise(k: u32) -> f64 {
    let mut x = k.wrapping_mul(0x9e37_79b9) ^ 0x85eb_ca6b;
    for _ in 0..2 {
        x = (x ^ (x >> 16)).wrapping_mul(0x045d_9f3b);
    }
    f64::from(x ^ (x >> 16)) / (f64::from(u32::MAX) + 1.0)
}

/// Light and dark of yarns and the like, in [0, 1) and periodic in `period`.
pub(crate) fn uneven(k: f32, period: f32, seed: u32) -> f32 {
    noise((k.rem_euclid(period) as u32).wrapping_mul(31).wrapping_add(seed)) as f32
}

/// A smooth wave of period 1 with no two crests alike, in [-1, 1].
pub(crate) fn wave(x: f32, seed: u32) -> f32 {
    let part = |n: u32| {
        (core::f32::consts::TAU * ((n as f32) * x + noise(seed.wrapping_mul(17).wrapping_add(n)) as f32)).sin()
    };
    (part(2) + 0.7 * part(3) + 0.6 * part(5) + 0.4 * part(9)) / 2.7
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folds_lie_below_what_lies_on_the_cloth_and_have_the_slopes_of_their_normals() {
        let cloth = Cloth { reach: 0.1, half: 3.0, folds: 1.0 };
        let (surface, light) = cloth.surface();
        assert_eq!(surface.positions.len(), light.len());
        let deepest = surface.positions.iter().map(|p| p.z).fold(0.0, f64::min);
        assert!(surface.positions.iter().all(|p| p.z <= 0.0) && deepest < -0.002 && deepest > -0.03, "{deepest}");
        assert!(surface.positions.iter().any(|p| p.z == 0.0));
        for t in &surface.indices {
            let [a, b, c] = t.map(|i| surface.positions[i as usize]);
            let normal = (b - a).cross(c - a).normalize();
            assert!(t.iter().all(|i| surface.normals[*i as usize].dot(normal) > 0.7));
        }
        assert!(light.iter().all(|l| *l > 0.0 && *l < 1.2));
        let ironed = Cloth { folds: 0.0, ..cloth }.surface().0;
        assert!(ironed.positions.iter().all(|p| p.z == 0.0));
        assert!((0..100).all(|k| (0.0..1.0).contains(&noise(k))));
        assert!((wave(0.0, 3) - wave(1.0, 3)).abs() < 1e-4);
    }
}
