//! What threads and shapes look like: triangle meshes, and the skin that follows a moving thread (theory, section 18).
//!
//! A thread is a tube with one bone an element. Its bind pose is the thread straight along z from the origin at its
//! rest lengths, bones at the middles of the elements, d1 along x: a bone's pose is the middle of its element and its
//! material frame, so that a texture shows twist. Each vertex follows up to four bones by linear blending, what every
//! game engine does on the graphics processor; [`Skin::pose`] does the same here.
//!
//! Weights are those of a quadratic B-spline over three bones ([`Blend::Smooth`]). Where neighboring elements turn by
//! an angle a, blending takes a part 1 - cos(a / 2) of the width in the plane of the bend and nothing of that across; a
//! bone's scale gives both half of it back, so that the area stays.
//!
//! ```
//! use sutura::glam::DVec3;
//! use sutura::skin::{Bone, Skin, SkinSpec};
//! use sutura::{Material, RodSpec, Settings, World};
//!
//! # fn main() -> Result<(), sutura::Error> {
//! let mut world = World::new(Settings::default())?;
//! let thread = RodSpec::straight(DVec3::ZERO, DVec3::X * 0.1, 100, 1e-4, Material::elastic(2e9, 1150.0));
//! let rod = world.insert_rod(&thread)?;
//! let skin = Skin::new(&SkinSpec { sides: 8, ..SkinSpec::of(&world.rod(rod)?) })?;
//! let mut bones = vec![Bone::default(); skin.n_bones()];
//!
//! // Each frame: the bones, to the graphics processor with `joints`, `weights` and `bind` of the skin ...
//! world.step(1.0 / 60.0);
//! skin.bones(&world.rod(rod)?, &mut bones);
//!
//! // ... or the vertices.
//! let mut positions = vec![[0.0; 3]; skin.n_vertices()];
//! let mut normals = vec![[0.0; 3]; skin.n_vertices()];
//! skin.pose(&bones, &mut positions, &mut normals);
//! # Ok(())
//! # }
//! ```

use crate::error::{Error, check};
use crate::math::{Pose, exp};
use crate::model::section::{Profile, Section};
use crate::model::shape::Geometry;
use crate::view::RodView;
use core::f64::consts::{FRAC_PI_2, PI, TAU};
use glam::{DQuat, DVec2, DVec3, Mat3, Quat, Vec3};
use parry3d_f64::shape::{Ball, Capsule, Cuboid, Cylinder};

/// A triangle mesh, lengths in meters. Triangles are counterclockwise seen from outside.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TriangleMesh {
    /// Corners \[m\].
    pub positions: Vec<[f32; 3]>,
    /// Unit normals, one a corner.
    pub normals: Vec<[f32; 3]>,
    /// Texture coordinates, one a corner, or none.
    pub uvs: Vec<[f32; 2]>,
    /// Corners of each triangle.
    pub triangles: Vec<[u32; 3]>,
}

impl TriangleMesh {
    /// The mesh of a body where it is placed.
    pub fn placed(&self, pose: &Pose) -> Self {
        let turn = |n: &[f32; 3]| (pose.orientation * Vec3::from(*n).as_dvec3()).as_vec3().to_array();
        let place = |x: &[f32; 3]| pose.transform_point(Vec3::from(*x).as_dvec3()).as_vec3().to_array();
        TriangleMesh {
            positions: self.positions.iter().map(place).collect(),
            normals: self.normals.iter().map(turn).collect(),
            ..self.clone()
        }
    }
}

/// How the vertices of a skin follow bones.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Blend {
    /// Quadratic B-spline over the three nearest bones: the tube has no edges, and is thinned by no more than two bones
    /// would.
    #[default]
    Smooth,
    /// The four nearest bones by the inverse of the vertex's distance from them, as in the 2018 paper. It thins bends
    /// three times as much or more.
    InverseDistance,
}

/// A skin to make.
#[derive(Debug, Clone, PartialEq)]
pub struct SkinSpec {
    /// Rest lengths of the elements \[m\], > 0.
    pub lengths: Vec<f64>,
    /// Radius of a round section \[m\], > 0.
    pub radius: f64,
    /// Shape of the cross-section, its axes along d1 (x) and d2 (y).
    pub section: Section,
    /// Factor on the size of the section along the thread.
    pub size: Profile,
    /// Of a closed thread, the turn about d3 at rest from its last frame to its first \[rad\]: a tube without ends.
    pub seam: Option<f64>,
    /// Vertices around, 3 to 256. A rectangle has four sides whatever this is.
    pub sides: u32,
    /// Rings of vertices an element, 1 to 64. One lies at each joint.
    pub rings: u32,
    /// How vertices follow bones.
    pub blend: Blend,
}

/// Where a bone is: the middle of an element and its material frame. As a transform of a game engine: this translation
/// and rotation, the scale `(scale, scale, stretch)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bone {
    /// Middle of the element in the world \[m\].
    pub position: Vec3,
    /// `world_from_material`.
    pub orientation: Quat,
    /// Factor on the cross-section, along d1 and d2: 1 where the thread is straight, more where blending would make it
    /// thinner.
    pub scale: f32,
    /// Length of the element over that in the bind pose.
    pub stretch: f32,
}

impl Default for Bone {
    fn default() -> Self {
        Bone { position: Vec3::ZERO, orientation: Quat::IDENTITY, scale: 1.0, stretch: 1.0 }
    }
}

/// The skin of a thread: its mesh in the bind pose, and which bones each vertex follows.
#[derive(Debug, Clone, PartialEq)]
pub struct Skin {
    mesh: TriangleMesh,
    joints: Vec<[u16; 4]>,
    weights: Vec<[f32; 4]>,
    /// Place of each bone along z in the bind pose \[m\].
    bind: Vec<f64>,
    /// Length of each element in the bind pose \[m\].
    lengths: Vec<f64>,
    /// Bones beyond the seam of a closed thread: which element each repeats, and how it is turned from it.
    repeats: Vec<(usize, DQuat)>,
    n_elements: usize,
    blend: Blend,
    rows: Vec<Row>,
    /// Vertices of a row.
    width: usize,
}

/// Vertices at one place along the thread, which follow the same bones.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Row {
    joints: [u16; 4],
    weights: [f32; 4],
    /// From each of these bones to the row, along z in the bind pose \[m\].
    offsets: [f32; 4],
}

/// Vertices around a cross-section.
struct Outline {
    corners: Vec<Corner>,
    /// Length around \[m\].
    circumference: f64,
    /// Half its smaller width \[m\].
    thinnest: f64,
    /// Flat ends instead of round ones.
    flat: bool,
}

struct Corner {
    at: DVec2,
    /// Gradient of the section's equation: across the surface, not of unit length.
    gradient: DVec2,
    /// Part of the circumference before it.
    u: f64,
    /// Whether a face lies between it and the next.
    face: bool,
}

/// What the surface is at a row, which decides its normals.
enum Surface {
    /// The tube, with the rate at which its size grows \[1/m\].
    Side(f64),
    /// A round end, half an ellipsoid, at this latitude \[rad\]: positive at the end of the thread, negative at its
    /// start.
    Round(f64),
    /// A flat end that looks along z this way.
    Flat(f64),
}

/// A row to make: where it is along z, on which element and which part of it, how large, its texture coordinate.
struct Place {
    z: f64,
    element: usize,
    part: f64,
    size: f64,
    surface: Surface,
    v: f64,
}

impl SkinSpec {
    /// A round tube of one radius with 12 sides and 4 rings an element.
    pub fn new(lengths: Vec<f64>, radius: f64) -> Self {
        SkinSpec {
            lengths,
            radius,
            section: Section::Round,
            size: Profile::default(),
            seam: None,
            sides: 12,
            rings: 4,
            blend: Blend::Smooth,
        }
    }

    /// The tube of a thread as it is now: its rest lengths, section, size and seam, with 12 sides and 4 rings an
    /// element.
    pub fn of(rod: &RodView<'_>) -> Self {
        SkinSpec {
            section: rod.cross_section(),
            size: rod.size().clone(),
            seam: rod.seam_turn(),
            ..Self::new(rod.rest_lengths().to_vec(), rod.section_radius())
        }
    }

    fn validate(&self) -> Result<(), Error> {
        let what = "skin";
        for (i, l) in self.lengths.iter().enumerate() {
            check(what, &format!("lengths[{i}]"), *l, *l > 0.0, "a finite length > 0 [m]")?;
        }
        let n = self.lengths.len();
        let least = if self.seam.is_some() { 3 } else { 1 };
        check(
            what,
            "lengths",
            n as f64,
            n >= least && n <= 65_000,
            "1 to 65 000 elements, 3 or more of a closed thread",
        )?;
        check(what, "radius", self.radius, self.radius > 0.0, "a finite radius > 0 [m]")?;
        check(what, "sides", f64::from(self.sides), (3..=256).contains(&self.sides), "3 to 256")?;
        check(what, "rings", f64::from(self.rings), (1..=64).contains(&self.rings), "1 to 64")?;
        if let Some(turn) = self.seam {
            check(what, "seam", turn, true, "a finite angle [rad]")?;
        }
        self.section.validate()?;
        self.size.validate(what, "size")
    }
}

impl Skin {
    /// Makes the skin.
    pub fn new(spec: &SkinSpec) -> Result<Self, Error> {
        spec.validate()?;
        let n = spec.lengths.len();
        let outline = Outline::new(&spec.section, spec.radius, spec.sides);
        let width = outline.corners.len();
        // Bones beyond the seam are those of the other end again: as many on each side as a vertex there may follow.
        let beyond = match (spec.seam, spec.blend) {
            (None, _) => 0,
            (Some(_), Blend::Smooth) => 1,
            (Some(_), Blend::InverseDistance) => 2,
        };
        // Rounded so that the first ring and the last have their vertices at the same places.
        let side = if spec.section == Section::Round { TAU / f64::from(spec.sides) } else { PI };
        let turn = (spec.seam.unwrap_or(0.0) / side).round() * side;
        let ahead = (0..beyond).map(|k| (k, exp(DVec3::Z * -turn)));
        let behind = (0..beyond).map(|k| (n - beyond + k, exp(DVec3::Z * turn)));
        let repeats: Vec<(usize, DQuat)> = ahead.chain(behind).collect();

        let length: f64 = spec.lengths.iter().sum();
        let middles: Vec<f64> =
            spec.lengths.iter().scan(0.0, |arc, l| Some(std::mem::replace(arc, *arc + l) + 0.5 * l)).collect();
        let mut bind = middles.clone();
        bind.extend(middles[..beyond].iter().map(|z| z + length));
        bind.extend(middles[n - beyond..].iter().map(|z| z - length));
        // Bones in the order in which they lie: those behind the start, those of the elements, those beyond the end.
        let order: Vec<usize> = (n + beyond..n + 2 * beyond).chain(0..n + beyond).collect();

        let places = places(spec, &outline);
        let mut skin = Skin {
            mesh: TriangleMesh::default(),
            joints: Vec::new(),
            weights: Vec::new(),
            bind,
            lengths: spec.lengths.clone(),
            repeats,
            n_elements: n,
            blend: spec.blend,
            rows: Vec::new(),
            width,
        };
        for place in &places {
            let row = match spec.blend {
                Blend::Smooth => skin.smooth(place, &order, beyond),
                Blend::InverseDistance => skin.inverse_distance(place.z, &order, spec.radius * spec.size.at(place.z)),
            };
            skin.rows.push(row);
            for corner in &outline.corners {
                let at = corner.at * place.size;
                let normal = match place.surface {
                    Surface::Side(growth) => {
                        let n = corner.gradient.normalize();
                        n.extend(-growth * corner.at.dot(n))
                    }
                    Surface::Round(latitude) => {
                        let (sin, cos) = libm::sincos(latitude);
                        (corner.gradient * cos).extend(sin / outline.thinnest)
                    }
                    Surface::Flat(way) => DVec3::Z * way,
                };
                skin.mesh.positions.push(at.extend(place.z).as_vec3().to_array());
                skin.mesh.normals.push(normal.normalize().as_vec3().to_array());
                skin.mesh.uvs.push([corner.u as f32, place.v as f32]);
                skin.joints.push(row.joints);
                skin.weights.push(row.weights);
            }
        }
        for (i, pair) in places.windows(2).enumerate() {
            let row = |k: usize| ((i + k) * width) as u32;
            // Rows at one place are the edge of a flat end.
            if pair[0].z == pair[1].z && pair[0].size == pair[1].size {
                continue;
            }
            for k in (0..width - 1).filter(|k| outline.corners[*k].face) {
                let (a, b) = (row(0) + k as u32, row(1) + k as u32);
                if pair[0].size > 0.0 {
                    skin.mesh.triangles.push([a, a + 1, if pair[1].size > 0.0 { b + 1 } else { b }]);
                }
                if pair[1].size > 0.0 {
                    skin.mesh.triangles.push([a, b + 1, b]);
                }
            }
        }
        Ok(skin)
    }

    /// The mesh in the bind pose, with texture coordinates: u around, from 0 at d1 to 1; v along, in circumferences
    /// from the start of the thread, so that a square of the texture is a square on the thread. Around a closed thread
    /// v grows by a whole number.
    pub fn mesh(&self) -> &TriangleMesh {
        &self.mesh
    }
    /// Number of vertices.
    pub fn n_vertices(&self) -> usize {
        self.mesh.positions.len()
    }
    /// Number of elements of the thread that it fits. A thread on a reel gains and loses elements: then it wants
    /// another skin.
    pub fn n_elements(&self) -> usize {
        self.n_elements
    }
    /// Number of bones: one an element, and of a closed thread some that repeat elements beyond its seam.
    pub fn n_bones(&self) -> usize {
        self.bind.len()
    }
    /// The four bones that each vertex follows; those of no weight are 0.
    pub fn joints(&self) -> &[[u16; 4]] {
        &self.joints
    }
    /// How much each vertex follows them; the sum is 1.
    pub fn weights(&self) -> &[[f32; 4]] {
        &self.weights
    }
    /// Place of each bone on the z axis in the bind pose, where its frame is the world's \[m\]: the inverse bind matrix
    /// is a translation by minus that.
    pub fn bind(&self) -> &[f64] {
        &self.bind
    }

    /// The bones of a thread.
    ///
    /// # Panics
    /// When the thread has another number of elements than [`Skin::n_elements`], or `bones` is not as long as
    /// [`Skin::n_bones`].
    pub fn bones(&self, rod: &RodView<'_>, bones: &mut [Bone]) {
        self.bones_at(rod.positions(), rod.orientations(), bones);
    }

    /// The bones of a thread with these particles \[m\], n + 1, and material frames, n.
    ///
    /// # Panics
    /// When the lengths do not fit.
    pub fn bones_at(&self, positions: &[DVec3], orientations: &[DQuat], bones: &mut [Bone]) {
        let n = self.n_elements;
        assert!(
            positions.len() == n + 1 && orientations.len() == n,
            "a thread of {} elements, the skin is of {n}",
            orientations.len()
        );
        assert_eq!(bones.len(), self.n_bones(), "bones of the skin");
        let mut kept = self.repeats.first().map_or(1.0, |_| self.seam_area(orientations));
        for e in 0..n {
            let before = kept;
            kept = match orientations.get(e + 1) {
                Some(next) => area_kept(orientations[e].conjugate() * *next),
                None => self.repeats.first().map_or(1.0, |_| self.seam_area(orientations)),
            };
            let scale = match self.blend {
                Blend::Smooth => (0.5 * (before + kept)).sqrt().recip().min(WIDEST) as f32,
                Blend::InverseDistance => 1.0,
            };
            let middle = (positions[e] + positions[e + 1]) * 0.5;
            let stretch = ((positions[e + 1] - positions[e]).length() / self.lengths[e]) as f32;
            bones[e] = Bone { position: middle.as_vec3(), orientation: orientations[e].as_quat(), scale, stretch };
        }
        for (k, (e, turn)) in self.repeats.iter().enumerate() {
            bones[n + k] = Bone { orientation: (orientations[*e] * *turn).as_quat(), ..bones[*e] };
        }
    }

    /// [`area_kept`] at the seam of a closed thread.
    fn seam_area(&self, orientations: &[DQuat]) -> f64 {
        let [first, .., last] = orientations else { return 1.0 };
        // The first repeat is the first element as it goes on from the last.
        area_kept(last.conjugate() * *first * self.repeats[0].1)
    }

    /// Positions \[m\] and unit normals of the vertices where the bones are, by linear blending: M = sum of w R S, the
    /// transposed inverse of M for normals. Nothing is allocated.
    ///
    /// # Panics
    /// When `bones` is not as long as [`Skin::n_bones`], or a buffer not as long as [`Skin::n_vertices`].
    pub fn pose(&self, bones: &[Bone], positions: &mut [[f32; 3]], normals: &mut [[f32; 3]]) {
        assert_eq!(bones.len(), self.n_bones(), "bones of the skin");
        assert!(
            positions.len() == self.n_vertices() && normals.len() == self.n_vertices(),
            "buffers of {} vertices",
            self.n_vertices()
        );
        let bound = self.mesh.positions.chunks_exact(self.width).zip(self.mesh.normals.chunks_exact(self.width));
        let out = positions.chunks_exact_mut(self.width).zip(normals.chunks_exact_mut(self.width));
        for ((row, (x, n)), (to_x, to_n)) in self.rows.iter().zip(bound).zip(out) {
            let mut m = Mat3::ZERO;
            let mut center = Vec3::ZERO;
            for k in 0..4 {
                let w = row.weights[k];
                if w > 0.0 {
                    let bone = bones[usize::from(row.joints[k])];
                    let r = Mat3::from_quat(bone.orientation);
                    m.x_axis += r.x_axis * (w * bone.scale);
                    m.y_axis += r.y_axis * (w * bone.scale);
                    m.z_axis += r.z_axis * (w * bone.stretch);
                    center += (bone.position + r.z_axis * (row.offsets[k] * bone.stretch)) * w;
                }
            }
            // The matrix of cofactors is the transposed inverse but for a factor.
            let (cx, cy, cz) = (m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
            for ((x, n), (to_x, to_n)) in x.iter().zip(n).zip(to_x.iter_mut().zip(to_n)) {
                *to_x = (center + m.x_axis * x[0] + m.y_axis * x[1]).to_array();
                let normal = cx * n[0] + cy * n[1] + cz * n[2];
                *to_n = (normal * (1.0 / normal.length())).to_array();
            }
        }
    }

    /// The row at part `t` of element `e` follows elements e - 1, e, e + 1 by (1 - t)^2 / 2, 3/4 - (t - 1/2)^2, t^2 /
    /// 2. All bones of weight agree on the joint, so that the tube has no edge there whatever the lengths. At an end
    ///    the last bone takes the part of the one that is missing.
    fn smooth(&self, place: &Place, order: &[usize], beyond: usize) -> Row {
        let t = place.part;
        let wanted = [0.5 * (1.0 - t) * (1.0 - t), 0.75 - (t - 0.5) * (t - 0.5), 0.5 * t * t];
        let mut parts: Vec<(usize, f64)> = Vec::new();
        for (k, w) in wanted.into_iter().enumerate() {
            let i = (place.element + beyond + k).saturating_sub(1).min(order.len() - 1);
            match parts.iter_mut().find(|p| p.0 == order[i]) {
                Some(p) => p.1 += w,
                None => parts.push((order[i], w)),
            }
        }
        self.row(place.z, &parts)
    }

    /// The four bones nearest to vertices at `radius` from the axis, by the inverse of their distance.
    fn inverse_distance(&self, z: f64, order: &[usize], radius: f64) -> Row {
        let mut near: Vec<(usize, f64)> = order.iter().map(|b| (*b, (self.bind[*b] - z).hypot(radius))).collect();
        near.sort_by(|a, b| a.1.total_cmp(&b.1));
        near.truncate(4);
        let sum: f64 = near.iter().map(|(_, d)| 1.0 / d).sum();
        let parts: Vec<(usize, f64)> = near.iter().map(|(b, d)| (*b, 1.0 / d / sum)).collect();
        self.row(z, &parts)
    }

    fn row(&self, z: f64, parts: &[(usize, f64)]) -> Row {
        let mut row = Row { joints: [0; 4], weights: [0.0; 4], offsets: [0.0; 4] };
        for (k, (bone, weight)) in parts.iter().filter(|p| p.1 > 0.0).enumerate() {
            row.joints[k] = *bone as u16;
            row.weights[k] = *weight as f32;
            row.offsets[k] = (z - self.bind[*bone]) as f32;
        }
        row
    }
}

/// The most that a bone's scale makes up for: it widens the thread across the bend by as much.
const WIDEST: f64 = 1.25;

/// Part of the area of a cross-section that is left midway between two bones with this turn q from one to the other:
/// the mean (1 + R) / 2 of both shrinks by w = cos(a / 2) across the axis of the turn and not along it, so that the
/// area across z shrinks by w sqrt(1 - q_z^2).
fn area_kept(q: DQuat) -> f64 {
    q.w.abs() * (1.0 - q.z * q.z).max(0.0).sqrt()
}

impl Outline {
    fn new(section: &Section, radius: f64, sides: u32) -> Self {
        let mut corners = Vec::new();
        let (thinnest, flat) = match *section {
            Section::Round => (Self::round(radius, radius, sides, &mut corners), false),
            Section::Ellipse([a, b]) => (Self::round(a, b, sides, &mut corners), false),
            Section::Rectangle([a, b]) => {
                let at = [(1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0)]
                    .map(|(x, y)| DVec2::new(0.5 * a * x, 0.5 * b * y));
                for (k, gradient) in [DVec2::X, DVec2::Y, DVec2::NEG_X, DVec2::NEG_Y].into_iter().enumerate() {
                    corners.push(Corner { at: at[k], gradient, u: 0.0, face: true });
                    corners.push(Corner { at: at[(k + 1) % 4], gradient, u: 0.0, face: false });
                }
                (0.5 * a.min(b), true)
            }
        };
        let mut around = 0.0;
        for k in 1..corners.len() {
            around += (corners[k].at - corners[k - 1].at).length();
            corners[k].u = around;
        }
        corners.iter_mut().for_each(|c| c.u /= around);
        // Chords are shorter than the arcs of a circle.
        let half = PI / f64::from(sides);
        let circumference = if flat { around } else { around * half / libm::sin(half) };
        Outline { corners, circumference, thinnest, flat }
    }

    fn round(a: f64, b: f64, sides: u32, corners: &mut Vec<Corner>) -> f64 {
        for k in 0..=sides {
            let (sin, cos) = libm::sincos(TAU * f64::from(k % sides) / f64::from(sides));
            corners.push(Corner {
                at: DVec2::new(a * cos, b * sin),
                gradient: DVec2::new(cos / a, sin / b),
                u: 0.0,
                face: k < sides,
            });
        }
        a.min(b)
    }
}

/// The rows of a skin from the start to the end.
fn places(spec: &SkinSpec, outline: &Outline) -> Vec<Place> {
    let (n, rings) = (spec.lengths.len(), spec.rings as usize);
    let mut body: Vec<Place> = Vec::new();
    let mut start = 0.0;
    for (e, l) in spec.lengths.iter().enumerate() {
        let last = usize::from(e + 1 == n);
        for k in 0..rings + last {
            let part = k as f64 / rings as f64;
            let z = start + l * part;
            // The size is linear between its points, so that any step within a piece gives its growth.
            let step = 0.25 * l / rings as f64;
            let growth = (spec.size.at(z + step) - spec.size.at(z - step)) / (2.0 * step);
            body.push(Place { z, element: e, part, size: spec.size.at(z), surface: Surface::Side(growth), v: 0.0 });
        }
        start += l;
    }
    for k in 1..body.len() {
        let mean = outline.circumference * 0.5 * (body[k].size + body[k - 1].size);
        body[k].v = body[k - 1].v + (body[k].z - body[k - 1].z) / mean;
    }
    if spec.seam.is_some() {
        let turns = body[body.len() - 1].v;
        let whole = turns.round().max(1.0) / turns;
        body.iter_mut().for_each(|p| p.v *= whole);
        return body;
    }
    // Ends: rows of a quarter of the sides, or the middle and the rim of a flat one. They follow the last element
    // alone.
    let latitudes = (spec.sides as usize / 4).max(2);
    let end = |at: &Place, way: f64| -> Vec<Place> {
        let place = |z: f64, size: f64, surface: Surface, arc: f64| {
            let v = at.v + way * arc / (outline.circumference * at.size);
            Place { z, element: at.element, part: at.part, size, surface, v }
        };
        if outline.flat {
            let rim = place(at.z, at.size, Surface::Flat(way), 0.0);
            return vec![rim, place(at.z, 0.0, Surface::Flat(way), outline.thinnest * at.size)];
        }
        let depth = outline.thinnest * at.size;
        let row = |k: usize| {
            let latitude = FRAC_PI_2 * k as f64 / latitudes as f64;
            let (sin, cos) = libm::sincos(latitude);
            let size = if k == latitudes { 0.0 } else { at.size * cos };
            place(at.z + way * depth * sin, size, Surface::Round(way * latitude), depth * latitude)
        };
        (1..=latitudes).map(row).collect()
    };
    let (mut all, after) = (end(&body[0], -1.0), end(&body[body.len() - 1], 1.0));
    all.reverse();
    all.extend(body);
    all.extend(after);
    all
}

/// The mesh of a shape in its own frame, with edges where faces meet at more than 40 degrees and smooth elsewhere.
/// Round ones have `sides` sides (3 or more), a plane is a square of `half_side` \[m\] about its origin. The meshes of
/// round and square ones are parry3d's.
pub fn shape_mesh(geometry: &Geometry, sides: u32, half_side: f64) -> TriangleMesh {
    let sides = sides.max(3);
    let (points, triangles) = match geometry {
        Geometry::Plane => {
            let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
                .map(|(x, y)| DVec3::new(x * half_side, y * half_side, 0.0));
            return creased(&corners, &[[0, 1, 2], [0, 2, 3]]);
        }
        Geometry::Mesh { vertices, triangles } => return creased(vertices, triangles),
        Geometry::Sphere { radius } => Ball::new(*radius).to_trimesh(sides, (sides / 2).max(2)),
        Geometry::Capsule { radius, half_length } => {
            Capsule::new_y(*half_length, *radius).to_trimesh(sides, (sides / 2).max(2))
        }
        Geometry::Cylinder { radius, half_length } => Cylinder::new(*half_length, *radius).to_trimesh(sides),
        Geometry::Box { half_sides } => Cuboid::new(DVec3::new(half_sides.x, half_sides.z, half_sides.y)).to_trimesh(),
    };
    // Parry's axis of revolution is y, ours is z.
    let turned: Vec<DVec3> = points.into_iter().map(|p| DVec3::new(p.x, -p.z, p.y)).collect();
    creased(&turned, &triangles)
}

/// A mesh with normals: at each corner of a triangle the mean, by angle, of the triangles around the vertex that are
/// turned from it by less than 40 degrees. Vertices with several normals are repeated.
fn creased(vertices: &[DVec3], triangles: &[[u32; 3]]) -> TriangleMesh {
    const CREASE: f64 = 0.766_044_443_118_978;
    let corner = |t: usize, k: usize| vertices[triangles[t][k % 3] as usize];
    let area = |t: usize| (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0));
    // A triangle without area has no normal, and is not seen.
    let faces: Vec<Option<DVec3>> = (0..triangles.len()).map(|t| area(t).try_normalize()).collect();
    let mut around: Vec<Vec<(usize, usize)>> = vec![Vec::new(); vertices.len()];
    for (t, triangle) in triangles.iter().enumerate().filter(|(t, _)| faces[*t].is_some()) {
        for k in 0..3 {
            around[triangle[k] as usize].push((t, k));
        }
    }
    let mut mesh = TriangleMesh::default();
    // Of each vertex, its normals so far and which vertex of the mesh has them.
    let mut made: Vec<Vec<(DVec3, u32)>> = vec![Vec::new(); vertices.len()];
    for (t, triangle) in triangles.iter().enumerate() {
        let Some(face) = faces[t] else { continue };
        let indices = triangle.map(|v| {
            let v = v as usize;
            let mut normal = DVec3::ZERO;
            for (other, k) in &around[v] {
                let Some(n) = faces[*other].filter(|n| n.dot(face) > CREASE) else { continue };
                let (a, b) = (corner(*other, k + 1) - vertices[v], corner(*other, k + 2) - vertices[v]);
                normal += n * libm::atan2(a.cross(b).length(), a.dot(b));
            }
            let normal = normal.normalize_or(face);
            if let Some((_, i)) = made[v].iter().find(|(n, _)| *n == normal) {
                return *i;
            }
            let i = mesh.positions.len() as u32;
            mesh.positions.push(vertices[v].as_vec3().to_array());
            mesh.normals.push(normal.as_vec3().to_array());
            made[v].push((normal, i));
            i
        });
        mesh.triangles.push(indices);
    }
    mesh
}
