//! Pictures of threads and bodies: meshes, skins, materials.

use crate::clock::{PhysicsClock, PhysicsLoop, advance};
use crate::cloth::Cloth;
use crate::look::{self, BodyLook, DRAPE_TILE, Materials};
use crate::mesh::Triangles;
use crate::space::Space;
use crate::things::{Body, Thread};
use crate::world::Sutura;
use crate::{tip, tube};
use bevy::app::RunFixedMainLoop;
use bevy::asset::AssetEventSystems;
use bevy::asset::RenderAssetUsages;
use bevy::camera::visibility::NoFrustumCulling;
use bevy::mesh::skinning::{SkinnedMesh, SkinnedMeshInverseBindposes};
use bevy::mesh::{Indices, PrimitiveTopology, VertexAttributeValues};
use bevy::prelude::*;
use sutura::glam::{DQuat, DVec3};
use sutura::skin::{Bone, Skin, SkinSpec};
use sutura::{Geometry, Pose};

/// Bones of one mesh: Bevy's limit, which is that of a uniform buffer.
const MOST_BONES: usize = 256;

/// A thread as it is drawn. [`Thread`]s have theirs from the world; one without a `Thread` (of a recording) is drawn as
/// it is set.
#[derive(Component, Debug, Clone, PartialEq)]
#[require(Transform, Visibility)]
pub struct Strand {
    /// Its skin.
    pub skin: SkinSpec,
    /// Particles \[m\], one more than elements.
    pub positions: Vec<DVec3>,
    /// Material frames of the elements.
    pub orientations: Vec<DQuat>,
    /// Tension of the elements \[N\]; empty where it is not known.
    pub tensions: Vec<f64>,
    /// How it looks.
    pub look: look::ThreadLook,
    /// Factor on the width of a round thread, where its own would be less than a pixel; 1 is true.
    pub stoutness: f64,
    /// Tensions that are shown as blue and as red \[N\]; `None` shows its own look.
    pub tension_scale: Option<(f64, f64)>,
}

/// A body as it is drawn, like a [`Strand`].
#[derive(Component, Debug, Clone, PartialEq)]
#[require(Transform, Visibility)]
pub struct Solid {
    /// Its geometry.
    pub geometry: Geometry,
    /// Where it is \[m\].
    pub pose: Pose,
    /// How it looks.
    pub look: BodyLook,
}

/// What draws a strand: its bones, and its meshes.
#[derive(Component, Debug, Clone)]
pub struct Drawn {
    /// An entity for each bone of the skin.
    pub bones: Vec<Entity>,
    /// The meshes that they move.
    pub parts: Vec<Entity>,
    /// The bone that moves each vertex of each mesh most.
    most: Vec<Vec<u16>>,
    skin: Skin,
    spec: SkinSpec,
    look: look::ThreadLook,
    stoutness: f64,
    plain: Handle<StandardMaterial>,
    colored: Handle<StandardMaterial>,
    is_colored: bool,
}

impl Drawn {
    fn fits(&self, strand: &Strand) -> bool {
        self.spec == strand.skin && self.look == strand.look && self.stoutness == strand.stoutness
    }
}

/// The last two states of a thread, between which it is drawn.
#[derive(Component, Debug, Default)]
pub(crate) struct States {
    frames: u64,
    before: Vec<(DVec3, DQuat)>,
    now: Vec<(DVec3, DQuat)>,
}

/// Whether what is drawn follows the world. While it does not, [`Strand`]s and [`Solid`]s are whoever's who turned it
/// off: to show the past.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Eq)]
pub struct Live(pub bool);

/// Adds the systems.
pub(crate) fn build(app: &mut App) {
    // They follow the world whether or not there is a renderer.
    app.insert_resource(Live(true));
    app.add_systems(
        RunFixedMainLoop,
        (show_threads, show_bodies).chain().after(advance).in_set(PhysicsLoop).run_if(|live: Res<Live>| live.0),
    );
    let renders = resource_exists::<Assets<StandardMaterial>>;
    app.add_systems(Startup, make_materials.run_if(renders));
    // Meshes that change are told to the renderer of the same picture.
    app.add_systems(
        PostUpdate,
        (mesh_strands, pose_bones, color_strands, mesh_solids, pose_solids, tip::mesh_tips)
            .chain()
            .before(TransformSystems::Propagate)
            .before(AssetEventSystems)
            .run_if(renders),
    );
}

fn make_materials(
    mut commands: Commands,
    mut images: ResMut<Assets<Image>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    commands.insert_resource(Materials::make(&mut images, &mut materials));
}

/// Strands of the threads of the world, between its last two states.
pub(crate) fn show_threads(
    mut commands: Commands,
    sutura: Res<Sutura>,
    clock: Res<PhysicsClock>,
    mut threads: Query<(Entity, &Thread, Option<&mut Strand>, Option<&mut States>)>,
) {
    for (entity, thread, strand, states) in &mut threads {
        let Some(rod) = thread.handle().and_then(|h| sutura.world().rod(h).ok()) else { continue };
        let (Some(mut strand), Some(mut states)) = (strand, states) else {
            let (positions, orientations) = (rod.positions().to_vec(), rod.orientations().to_vec());
            let strand = Strand {
                skin: SkinSpec::of(&rod),
                positions,
                orientations,
                tensions: Vec::new(),
                look: thread.look,
                stoutness: 1.0,
                tension_scale: None,
            };
            commands.entity(entity).insert((strand, States { frames: u64::MAX, ..States::default() }));
            continue;
        };
        if states.frames != clock.frames || states.now.is_empty() {
            states.frames = clock.frames;
            let States { before, now, .. } = &mut *states;
            std::mem::swap(before, now);
            now.clear();
            // The last particle has no frame of its own.
            let frames = rod.orientations().iter().copied().chain([DQuat::IDENTITY]);
            now.extend(rod.positions().iter().copied().zip(frames));
        }
        // Several frames of physics in one picture: then the last but one is not remembered, and the newest is drawn.
        let part = if states.before.len() == states.now.len() && clock.now <= 1 { clock.ahead() } else { 1.0 };
        let n = rod.n_elements();
        let States { before, now, .. } = &*states;
        let between = |i: usize| if part < 1.0 { before[i].0.lerp(now[i].0, part) } else { now[i].0 };
        let turned = |i: usize| {
            let (a, b) = (before.get(i).map_or(now[i].1, |s| s.1), now[i].1);
            if part < 1.0 { a.lerp(if a.dot(b) < 0.0 { -b } else { b }, part).normalize() } else { b }
        };
        strand.positions.clear();
        strand.positions.extend((0..=n).map(between));
        strand.orientations.clear();
        strand.orientations.extend((0..n).map(turned));
        strand.tensions.clear();
        strand.tensions.extend((0..n).map(|e| rod.tension(e)));
        strand.look = thread.look;
        // A reel makes the element at it longer and shorter all the time; what a hundredth of it misses is not seen.
        let fits = |(a, b): (&f64, &f64)| (a - b).abs() <= 0.01 * b;
        // A ring that is cut has two ends.
        let opened = strand.skin.seam.is_some() && !rod.is_closed();
        if opened || strand.skin.lengths.len() != n || !strand.skin.lengths.iter().zip(rod.rest_lengths()).all(fits) {
            strand.skin = SkinSpec::of(&rod);
        }
    }
}

/// Solids of the bodies of the world.
pub(crate) fn show_bodies(
    mut commands: Commands,
    sutura: Res<Sutura>,
    mut bodies: Query<(Entity, &Body, Option<&mut Solid>)>,
) {
    for (entity, body, solid) in &mut bodies {
        let Some(shape) = body.handle().and_then(|h| sutura.world().shape(h).ok()) else { continue };
        match solid {
            Some(mut solid) => {
                if solid.pose != shape.pose {
                    solid.pose = shape.pose;
                }
            }
            None => {
                commands.entity(entity).insert(Solid {
                    geometry: shape.geometry.clone(),
                    pose: shape.pose,
                    look: body.look,
                });
            }
        }
    }
}

/// Makes the meshes of strands that are new or have another number of elements.
fn mesh_strands(
    mut commands: Commands,
    space: Res<Space>,
    strands: Query<(Entity, &Strand, Option<&Drawn>)>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut images: ResMut<Assets<Image>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut poses: ResMut<Assets<SkinnedMeshInverseBindposes>>,
) {
    for (entity, strand, drawn) in &strands {
        if let Some(drawn) = drawn {
            if drawn.fits(strand) {
                continue;
            }
            for child in drawn.bones.iter().chain(&drawn.parts) {
                commands.entity(*child).try_despawn();
            }
        }
        let skin = match Skin::new(&SkinSpec { radius: strand.skin.radius * strand.stoutness, ..strand.skin.clone() }) {
            Ok(skin) => skin,
            Err(e) => {
                error_once!("a thread is not drawn: {e}");
                continue;
            }
        };
        // A bone has no Transform: its place in the world is set as it is, and nothing is propagated.
        let bones: Vec<Entity> =
            (0..skin.n_bones()).map(|_| commands.spawn((GlobalTransform::default(), ChildOf(entity))).id()).collect();
        let material = look::thread(&strand.look, &mut images);
        let colored = materials.add(StandardMaterial { base_color_texture: None, ..material.clone() });
        let plain = materials.add(material);
        let (mut parts, mut most) = (Vec::new(), Vec::new());
        for part in tube::parts(&skin, MOST_BONES) {
            let bind = part
                .bones
                .iter()
                .map(|b| Mat4::from_translation(Vec3::NEG_Z * skin.bind()[usize::from(*b)] as f32 * space.scale));
            let skinned = SkinnedMesh {
                inverse_bindposes: poses.add(bind.collect::<Vec<_>>()),
                joints: part.bones.iter().map(|b| bones[usize::from(*b)]).collect(),
            };
            let strongest = |v: &u32| {
                let (joints, weights) = (skin.joints()[*v as usize], skin.weights()[*v as usize]);
                (0..4).max_by(|a, b| weights[*a].total_cmp(&weights[*b])).map_or(0, |k| joints[k])
            };
            most.push(part.vertices.iter().map(strongest).collect());
            // Its bounds at rest say nothing of where it is.
            let shown = (
                Mesh3d(meshes.add(skin_mesh(&skin, &part, space.scale))),
                MeshMaterial3d(plain.clone()),
                skinned,
                NoFrustumCulling,
                ChildOf(entity),
            );
            parts.push(commands.spawn(shown).id());
        }
        let (spec, look, stoutness) = (strand.skin.clone(), strand.look, strand.stoutness);
        commands.entity(entity).insert(Drawn {
            bones,
            parts,
            most,
            skin,
            spec,
            look,
            stoutness,
            plain,
            colored,
            is_colored: false,
        });
    }
}

/// A part of a skin as a mesh of Bevy, in its units.
fn skin_mesh(skin: &Skin, part: &tube::Part, scale: f32) -> Mesh {
    let of = |v: &u32| *v as usize;
    let mesh = skin.mesh();
    let normals: Vec<[f32; 3]> = part.vertices.iter().map(|v| mesh.normals[of(v)]).collect();
    // Along u: around the thread.
    let tangent = |n: &[f32; 3]| {
        let t = Vec3::new(-n[1], n[0], 0.0).normalize_or(Vec3::X);
        [t.x, t.y, t.z, 1.0]
    };
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(
            Mesh::ATTRIBUTE_POSITION,
            part.vertices.iter().map(|v| mesh.positions[of(v)].map(|x| x * scale)).collect::<Vec<_>>(),
        )
        .with_inserted_attribute(Mesh::ATTRIBUTE_TANGENT, normals.iter().map(tangent).collect::<Vec<[f32; 4]>>())
        .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, normals)
        .with_inserted_attribute(
            Mesh::ATTRIBUTE_UV_0,
            part.vertices.iter().map(|v| mesh.uvs[of(v)]).collect::<Vec<_>>(),
        )
        .with_inserted_attribute(Mesh::ATTRIBUTE_JOINT_INDEX, VertexAttributeValues::Uint16x4(part.joints.clone()))
        .with_inserted_attribute(
            Mesh::ATTRIBUTE_JOINT_WEIGHT,
            part.vertices.iter().map(|v| skin.weights()[of(v)]).collect::<Vec<_>>(),
        )
        .with_inserted_indices(Indices::U32(part.indices.clone()))
}

/// Puts the bones where the elements are.
fn pose_bones(
    space: Res<Space>,
    strands: Query<(&Strand, &Drawn), Or<(Changed<Strand>, Changed<Drawn>)>>,
    mut bones: Query<&mut GlobalTransform>,
) {
    let mut posed = Vec::new();
    for (strand, drawn) in &strands {
        if drawn.spec != strand.skin {
            continue;
        }
        posed.resize(drawn.bones.len(), Bone::default());
        if strand.positions.is_empty() {
            // It is not there: nothing of it has a size.
            posed.fill(Bone { scale: 0.0, stretch: 0.0, ..Bone::default() });
        } else {
            drawn.skin.bones_at(&strand.positions, &strand.orientations, &mut posed);
        }
        for (entity, bone) in drawn.bones.iter().zip(&posed) {
            let Ok(mut place) = bones.get_mut(*entity) else { continue };
            let (x, q) = (Vec3::from_array(bone.position.to_array()), Quat::from_array(bone.orientation.to_array()));
            *place = GlobalTransform::from(Transform {
                translation: space.rotation * (x * space.scale),
                rotation: space.rotation * q,
                scale: Vec3::new(bone.scale, bone.scale, bone.stretch),
            });
        }
    }
}

/// Colors of the vertices by tension, where that is wanted.
fn color_strands(
    mut strands: Query<(&Strand, &mut Drawn), Changed<Strand>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut parts: Query<(&Mesh3d, &mut MeshMaterial3d<StandardMaterial>)>,
) {
    for (strand, mut drawn) in &mut strands {
        let scale = strand.tension_scale.filter(|_| !strand.tensions.is_empty());
        if scale.is_none() && !drawn.is_colored {
            continue;
        }
        drawn.is_colored = scale.is_some();
        let drawn = &*drawn;
        for (part, bones) in drawn.parts.iter().zip(&drawn.most) {
            let Ok((mesh, mut material)) = parts.get_mut(*part) else { continue };
            material.0 = if scale.is_some() { drawn.colored.clone() } else { drawn.plain.clone() };
            let Some(mut mesh) = meshes.get_mut(&mesh.0) else { continue };
            match scale {
                Some((low, high)) => {
                    let color = |bone: &u16| {
                        let tension = strand.tensions.get(usize::from(*bone)).copied().unwrap_or(0.0);
                        heat(((tension - low) / (high - low).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0) as f32)
                    };
                    mesh.insert_attribute(Mesh::ATTRIBUTE_COLOR, bones.iter().map(color).collect::<Vec<[f32; 4]>>());
                }
                None => drop(mesh.remove_attribute(Mesh::ATTRIBUTE_COLOR)),
            }
        }
    }
}

/// Blue, cyan, yellow, red: linear color for a number in [0, 1].
pub fn heat(t: f32) -> [f32; 4] {
    let stops = [[0.05, 0.12, 0.75], [0.02, 0.55, 0.65], [0.95, 0.75, 0.05], [0.85, 0.04, 0.02]];
    let x = t * 3.0;
    let (i, u) = ((x as usize).min(2), x - (x as usize).min(2) as f32);
    let c: [f32; 3] = std::array::from_fn(|k| stops[i][k] + (stops[i + 1][k] - stops[i][k]) * u);
    [c[0], c[1], c[2], 1.0]
}

/// Makes the meshes of new solids.
fn mesh_solids(
    mut commands: Commands,
    space: Res<Space>,
    shared: Res<Materials>,
    solids: Query<(Entity, &Solid), (Changed<Solid>, Without<Mesh3d>)>,
    mut meshes: ResMut<Assets<Mesh>>,
) {
    for (entity, solid) in &solids {
        let plane = matches!(solid.geometry, Geometry::Plane);
        // What lies is a table with a cloth on it.
        let look = if plane && solid.look == BodyLook::Steel { BodyLook::Drape } else { solid.look };
        let material = match look {
            BodyLook::Steel => &shared.steel,
            BodyLook::Drape => &shared.drape,
            BodyLook::Hidden => continue,
        };
        // What threads lie on is as flat as it is to them.
        let mesh = if plane {
            Cloth::default().mesh(space.scale)
        } else {
            mesh(&Triangles::of(&solid.geometry, 0.0), space.scale, DRAPE_TILE)
        };
        commands.entity(entity).insert((Mesh3d(meshes.add(mesh)), MeshMaterial3d(material.clone())));
    }
}

/// A mesh of Bevy, in its units.
pub(crate) fn mesh(t: &Triangles, scale: f32, tile: f32) -> Mesh {
    let v = |p: &DVec3| [p.x as f32, p.y as f32, p.z as f32];
    let mut mesh = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(
            Mesh::ATTRIBUTE_POSITION,
            t.positions.iter().map(|p| v(p).map(|x| x * scale)).collect::<Vec<_>>(),
        )
        .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, t.normals.iter().map(v).collect::<Vec<_>>())
        .with_inserted_attribute(
            Mesh::ATTRIBUTE_UV_0,
            t.uvs.iter().map(|uv| uv.map(|x| x as f32 / tile)).collect::<Vec<_>>(),
        )
        .with_inserted_indices(Indices::U32(t.indices.iter().flatten().copied().collect()));
    // Tangents along u: across the normal, about the z axis where it can be.
    let tangent = |n: &DVec3| {
        let t = if n.z.abs() < 0.99 { DVec3::Z.cross(*n) } else { DVec3::X - *n * n.x };
        let t = v(&t.normalize_or(DVec3::X));
        [t[0], t[1], t[2], 1.0]
    };
    mesh.insert_attribute(Mesh::ATTRIBUTE_TANGENT, t.normals.iter().map(tangent).collect::<Vec<[f32; 4]>>());
    mesh
}

/// Puts solids where the bodies are.
fn pose_solids(space: Res<Space>, mut solids: Query<(&Solid, &mut Transform), Or<(Changed<Solid>, Added<Mesh3d>)>>) {
    for (solid, mut place) in &mut solids {
        *place = space.transform(solid.pose);
    }
}
