//! Tips of instruments that hold threads: for the eye only, the engine knows nothing of them.

use crate::look::Materials;
use crate::mesh::Triangles;
use crate::space::Space;
use bevy::light::NotShadowCaster;
use bevy::prelude::*;
use core::f64::consts::{FRAC_PI_2, PI, TAU};
use sutura::Pose;
use sutura::glam::{DMat3, DQuat, DVec3};

/// The tip of a needle holder, closed on a thread. Its [`Transform`] is set by whoever spawned it, for which
/// [`Tip::pose`] helps.
#[derive(Component, Debug, Clone, Copy, PartialEq)]
#[require(Transform, Visibility)]
pub struct Tip {
    /// Diameter of the thread that it holds \[m\].
    pub bore: f64,
    /// Color of the band around its shaft.
    pub band: Srgba,
}

/// From the middle of what is held to the end of the jaws, to their joint, to the band, to its end, to where the shaft
/// has faded away \[m\].
const ENDS: f64 = -0.9e-3;
const JOINT: f64 = 8.6e-3;
const BAND: f64 = 13.0e-3;
const BAND_END: f64 = 14.6e-3;
const GONE: f64 = 34.0e-3;
/// Radius of the shaft \[m\].
const SHAFT: f64 = 1.05e-3;
/// Corners around what is round.
const SIDES: usize = 28;

impl Tip {
    /// Where it is when it holds a thread that runs along `tangent` at a place \[m\], with the hand in a direction from
    /// there.
    pub fn pose(at: DVec3, tangent: DVec3, hand: DVec3) -> Pose {
        let y = hand.normalize_or(DVec3::Z);
        // The jaws close across the thread; where it runs along them any way will do.
        let across = tangent - y * tangent.dot(y);
        let z = if across.length() > 0.05 * tangent.length() { across.normalize() } else { y.any_orthonormal_vector() };
        Pose::new(at, DQuat::from_mat3(&DMat3::from_cols(y.cross(z), y, z)))
    }

    /// What is solid of it, in its own axes: y to the hand, z along the thread, jaws that close along x.
    pub fn triangles(&self) -> Triangles {
        let mut out = Triangles::default();
        for side in [1.0, -1.0] {
            jaw(&mut out, self.bore, side);
        }
        // The joint with its pin, and the beginning of the shaft.
        let neck = [
            (JOINT - 0.4e-3, 0.3e-3),
            (JOINT - 0.2e-3, 0.95e-3),
            (JOINT + 0.4e-3, 1.12e-3),
            (JOINT + 2.0e-3, 1.12e-3),
            (JOINT + 2.5e-3, 0.86e-3),
        ];
        turned(&mut out, DVec3::Y, DVec3::ZERO, &neck);
        let shaft = [(JOINT + 2.5e-3, 0.86e-3), (JOINT + 3.1e-3, 0.86e-3), (JOINT + 3.3e-3, SHAFT), (BAND, SHAFT)];
        turned(&mut out, DVec3::Y, DVec3::ZERO, &shaft);
        let pin = [
            (-1.34e-3, 0.0),
            (-1.32e-3, 0.42e-3),
            (-1.22e-3, 0.52e-3),
            (1.22e-3, 0.52e-3),
            (1.32e-3, 0.42e-3),
            (1.34e-3, 0.0),
        ];
        turned(&mut out, DVec3::Z, DVec3::Y * (JOINT + 0.7e-3), &pin);
        out
    }

    /// The band.
    fn band(&self) -> Triangles {
        let mut out = Triangles::default();
        let bulge = 0.12e-3;
        turned(
            &mut out,
            DVec3::Y,
            DVec3::ZERO,
            &[(BAND, SHAFT), (BAND + bulge, SHAFT + bulge), (BAND_END - bulge, SHAFT + bulge), (BAND_END, SHAFT)],
        );
        out
    }

    /// The rest of the shaft, which fades away, and how much of it is there at each corner.
    fn rest(&self) -> (Triangles, Vec<[f32; 4]>) {
        let mut out = Triangles::default();
        let rows: Vec<(f64, f64)> =
            (0..=12).map(|k| (BAND_END + (GONE - BAND_END) * f64::from(k) / 12.0, SHAFT)).collect();
        turned(&mut out, DVec3::Y, DVec3::ZERO, &rows);
        let there = |p: &DVec3| {
            let t = ((GONE - p.y) / (GONE - BAND_END)).clamp(0.0, 1.0) as f32;
            [1.0, 1.0, 1.0, t * t * (3.0 - 2.0 * t)]
        };
        let colors = out.positions.iter().map(there).collect();
        (out, colors)
    }
}

/// One of the two jaws: half round outside, flat within, the flats as far apart as the thread is thick where it lies
/// between them.
fn jaw(out: &mut Triangles, bore: f64, side: f64) {
    // Along the jaw, thickness, half width.
    let stations = [
        (ENDS, 0.0, 0.0),
        (ENDS + 0.04e-3, 0.2e-3, 0.22e-3),
        (ENDS + 0.18e-3, 0.36e-3, 0.38e-3),
        (ENDS + 0.5e-3, 0.46e-3, 0.48e-3),
        (2.5e-3, 0.62e-3, 0.62e-3),
        (5.5e-3, 0.86e-3, 0.84e-3),
        (JOINT - 0.6e-3, 1.06e-3, 1.0e-3),
        (JOINT + 0.6e-3, 1.1e-3, 1.02e-3),
    ];
    let within = |y: f64| 0.5 * bore * (1.0 - y / JOINT).max(0.0) + 0.02e-3;
    let arc = |i: usize, k: usize| {
        let (y, t, w) = stations[i];
        let (sin, cos) = (PI * k as f64 / SIDES as f64).sin_cos();
        DVec3::new(side * (within(y) + t * sin.powf(0.8)), y, side * w * cos)
    };
    surface(out, stations.len(), SIDES, arc);
    let flat = |i: usize, k: usize| {
        let (y, _, w) = stations[i];
        DVec3::new(side * within(y), y, side * w * (2.0 * k as f64 - 1.0))
    };
    surface(out, stations.len(), 1, flat);
}

/// A profile (along an axis, from it) turned about the axis through a point.
fn turned(out: &mut Triangles, axis: DVec3, through: DVec3, profile: &[(f64, f64)]) {
    let u = axis.any_orthonormal_vector();
    let v = axis.cross(u);
    let at = |i: usize, k: usize| {
        let (sin, cos) = (TAU * k as f64 / SIDES as f64 + FRAC_PI_2).sin_cos();
        through + axis * profile[i].0 + (u * cos + v * sin) * profile[i].1
    };
    surface(out, profile.len(), SIDES, at);
}

/// A patch of rows and columns of corners, seen from where columns run counterclockwise of rows.
fn surface(out: &mut Triangles, rows: usize, columns: usize, at: impl Fn(usize, usize) -> DVec3) {
    let first = out.positions.len() as u32;
    for i in 0..rows {
        for k in 0..=columns {
            let (i0, i1) = (i.saturating_sub(1), (i + 1).min(rows - 1));
            // Around a pole the row itself has no extent; its neighbor tells the normal.
            let row =
                if (at(i, 0) - at(i, columns / 2)).length() < 1e-9 { if i == 0 { 1 } else { rows - 2 } } else { i };
            // What is closed has neighbors on both sides of its seam.
            let closed = columns > 1 && (at(row, 0) - at(row, columns)).length() < 1e-9;
            let (k0, k1) = if closed {
                ((k + columns - 1) % columns, (k + 1) % columns)
            } else {
                (k.saturating_sub(1), (k + 1).min(columns))
            };
            let normal = (at(row, k1) - at(row, k0)).cross(at(i1, k) - at(i0, k)).normalize_or(DVec3::Y);
            out.positions.push(at(i, k));
            out.normals.push(normal);
            out.uvs.push([0.0, 0.0]);
        }
    }
    for i in 0..rows as u32 - 1 {
        for k in 0..columns as u32 {
            let a = first + i * (columns as u32 + 1) + k;
            let b = a + columns as u32 + 1;
            out.indices.extend([[a, a + 1, b + 1], [a, b + 1, b]]);
        }
    }
}

/// Draws new ones.
pub(crate) fn mesh_tips(
    mut commands: Commands,
    space: Res<Space>,
    shared: Res<Materials>,
    tips: Query<(Entity, &Tip), Changed<Tip>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    for (entity, tip) in &tips {
        commands.entity(entity).despawn_related::<Children>();
        let plain = |t: &Triangles| crate::draw::mesh(t, space.scale, 1.0);
        let (rest, there) = tip.rest();
        let solid = meshes.add(plain(&tip.triangles()));
        let band = meshes.add(plain(&tip.band()));
        let rest = meshes.add(plain(&rest).with_inserted_attribute(Mesh::ATTRIBUTE_COLOR, there));
        let painted = materials.add(StandardMaterial {
            base_color: tip.band.into(),
            metallic: 0.6,
            perceptual_roughness: 0.35,
            ..default()
        });
        commands.spawn((Mesh3d(solid), MeshMaterial3d(shared.instrument.clone()), ChildOf(entity)));
        commands.spawn((Mesh3d(band), MeshMaterial3d(painted), ChildOf(entity)));
        commands.spawn((Mesh3d(rest), MeshMaterial3d(shared.fading.clone()), NotShadowCaster, ChildOf(entity)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn its_jaws_close_on_the_thread_and_its_surface_looks_outward() {
        let tip = Tip { bore: 0.3e-3, band: Srgba::WHITE };
        let solid = tip.triangles();
        let volume: f64 = solid
            .indices
            .iter()
            .map(|t| t.map(|i| solid.positions[i as usize]))
            .map(|[a, b, c]| a.dot(b.cross(c)) / 6.0)
            .sum();
        // It is open where the band begins; a disk there closes it. A jaw is about a half cone with a radius from 0.5
        // to 1 mm; the shaft has 1 mm.
        let volume = volume + BAND * PI * SHAFT * SHAFT / 3.0;
        assert!(volume > 2e-8 && volume < 6e-8, "{volume}");
        let wrong = solid.indices.iter().filter(|t| {
            let [a, b, c] = t.map(|i| solid.positions[i as usize]);
            let n = (b - a).cross(c - a);
            n.length() > 1e-14 && t.iter().any(|i| n.normalize().dot(solid.normals[*i as usize]) < -0.1)
        });
        assert_eq!(wrong.count(), 0);
        // Along the thread there is room for it and no more.
        let room = |x: f64| solid.hit(DVec3::new(x, 0.0, -0.01), DVec3::Z).is_none();
        assert!(room(0.0) && room(0.14e-3) && !room(0.2e-3) && !room(-0.2e-3));
        let pose = Tip::pose(DVec3::X, DVec3::Z, DVec3::new(0.0, 1.0, 1.0));
        assert!((pose.orientation * DVec3::Y - DVec3::new(0.0, 1.0, 1.0).normalize()).length() < 1e-12);
        assert!((pose.orientation * DVec3::X).dot(DVec3::Z).abs() < 1e-12);
    }
}
