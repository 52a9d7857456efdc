//! glTF 2.0, binary: a skinned tube with one joint an element for each thread, a node for each shape, one animation.
//!
//! Joints are no chain: all hang from one node at the origin, so that the path of a joint is that of the middle of its
//! element.

use super::texture::braid;
use super::{ExportError, Moment, Output, Seen, THREAD_COLORS, Writer, fitted};
use crate::trajectory::ShapeOutline;
use gltf::json::accessor::{ComponentType, GenericComponentType, Type};
use gltf::json::animation::{Channel, Interpolation, Property, Sampler, Target};
use gltf::json::buffer::{Target as Use, View};
use gltf::json::material::{PbrBaseColorFactor, PbrMetallicRoughness, StrengthFactor};
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::scene::UnitQuaternion;
use gltf::json::validation::Checked::Valid;
use gltf::json::validation::USize64;
use gltf::json::{
    Accessor, Animation, Asset, Buffer, Image, Index, Material, Mesh, Node, Root, Scene, Skin, Texture, texture,
};
use std::borrow::Cow;
use std::collections::BTreeMap;
use sutura::glam::DVec3;
use sutura::skin::{Bone, TriangleMesh};

/// Paths of all nodes that may move.
pub struct Glb {
    up: DVec3,
    times: Vec<f64>,
    /// One per bone of each thread, then one per shape.
    bones: Vec<Vec<Path>>,
    shapes: Vec<Path>,
}

#[derive(Default, Clone)]
struct Path {
    positions: Vec<[f32; 3]>,
    turns: Vec<[f32; 4]>,
    /// Of a bone.
    scales: Vec<[f32; 3]>,
}

/// A scale nearer to 1 than this is not seen.
const SEEN: f32 = 1e-3;

impl Path {
    /// Adds a place; of the two quaternions of a rotation the one nearer to the last, so that between them it takes the
    /// short way.
    fn push(&mut self, position: [f32; 3], turn: [f32; 4]) {
        let against =
            self.turns.last().is_some_and(|last| last.iter().zip(turn).map(|(a, b)| a * b).sum::<f32>() < 0.0);
        self.positions.push(position);
        self.turns.push(if against { turn.map(|v| -v) } else { turn });
    }

    /// Returns the path of a bone that comes after so many moments: until then the bone has no size.
    fn unseen(bone: &Bone, moments: usize) -> Self {
        let mut path = Path::default();
        for _ in 0..moments {
            path.push(bone.position.to_array(), bone.orientation.normalize().to_array());
            path.scales.push([0.0; 3]);
        }
        path
    }

    fn is_scaled(&self) -> bool {
        self.scales.iter().flatten().any(|s| (s - 1.0).abs() > SEEN)
    }
}

/// The document as it grows, and the bytes that it refers to.
struct Document {
    root: Root,
    bytes: Vec<u8>,
}

impl Glb {
    pub fn new(up: DVec3) -> Self {
        Glb { up, times: Vec::new(), bones: Vec::new(), shapes: Vec::new() }
    }

    /// One animation from time 0 on; what stays where it is has no channel.
    fn animate(&self, doc: &mut Document, nodes: &[Index<Node>]) {
        let first = self.times[0];
        let times: Vec<[f32; 1]> = self.times.iter().map(|t| [(t - first) as f32]).collect();
        let mut animation = Animation {
            extensions: None,
            extras: Default::default(),
            channels: Vec::new(),
            name: Some("run".into()),
            samplers: Vec::new(),
        };
        let mut input = None;
        for (node, path) in nodes.iter().zip(self.bones.iter().flatten().chain(&self.shapes)) {
            let moves = path
                .positions
                .iter()
                .any(|x| *x != path.positions[0])
                .then(|| (Property::Translation, doc.accessor(Type::Vec3, None, &path.positions)));
            let turns = path
                .turns
                .iter()
                .any(|q| *q != path.turns[0])
                .then(|| (Property::Rotation, doc.accessor(Type::Vec4, None, &path.turns)));
            let widens = path.is_scaled().then(|| (Property::Scale, doc.accessor(Type::Vec3, None, &path.scales)));
            for (property, output) in moves.into_iter().chain(turns).chain(widens) {
                let input = *input.get_or_insert_with(|| doc.bounded(Type::Scalar, None, &times));
                let sampler = Index::new(animation.samplers.len() as u32);
                let interpolation = Valid(Interpolation::Linear);
                animation.samplers.push(Sampler {
                    extensions: None,
                    extras: Default::default(),
                    input,
                    interpolation,
                    output,
                });
                let target =
                    Target { extensions: None, extras: Default::default(), node: *node, path: Valid(property) };
                animation.channels.push(Channel { sampler, target, extensions: None, extras: Default::default() });
            }
        }
        if !animation.channels.is_empty() {
            doc.root.push(animation);
        }
    }
}

impl Writer for Glb {
    fn add(&mut self, seen: &Seen<'_>, moment: &Moment, _: &mut Output) -> Result<(), ExportError> {
        let moment = fitted(seen.header, moment);
        let before = self.times.len();
        self.times.push(moment.time);
        for (k, (skin, strand)) in seen.looks.skins.iter().zip(&moment.threads).enumerate() {
            let mut bones = vec![Bone::default(); skin.n_bones()];
            skin.bones_at(&strand.positions, &strand.orientations, &mut bones);
            if self.bones.len() <= k {
                self.bones.push(bones.iter().map(|bone| Path::unseen(bone, before)).collect());
            }
            for (bone, path) in bones.iter().zip(&mut self.bones[k]) {
                path.push(bone.position.to_array(), bone.orientation.normalize().to_array());
                path.scales.push([bone.scale, bone.scale, bone.stretch]);
            }
        }
        self.shapes.resize(moment.shapes.len(), Path::default());
        for (pose, path) in moment.shapes.iter().zip(&mut self.shapes) {
            path.push(pose.position.as_vec3().to_array(), pose.orientation.as_quat().normalize().to_array());
        }
        Ok(())
    }

    fn finish(self: Box<Self>, seen: &Seen<'_>, out: &mut Output) -> Result<(), ExportError> {
        let Seen { header, looks } = seen;
        let mut doc = Document { root: Root::default(), bytes: Vec::new() };
        doc.root.asset = Asset { generator: Some(format!("Sutura {}", env!("CARGO_PKG_VERSION"))), ..Asset::default() };
        // Skinned meshes go by their joints alone and stand beside what is turned.
        let (mut scene_nodes, mut turned) = (Vec::new(), Vec::new());
        let mut moving: Vec<Index<Node>> = Vec::new();
        let texture = (!looks.skins.is_empty()).then(|| doc.braid());
        for (k, (skin, paths)) in looks.skins.iter().zip(&self.bones).enumerate() {
            let name = &header.threads[k].name;
            let color = THREAD_COLORS[k % THREAD_COLORS.len()];
            let material = doc.material(name, color, 0.0, 0.55, texture, false);
            let joints: Vec<Index<Node>> =
                paths.iter().enumerate().map(|(e, path)| doc.node(&format!("{name}.{e}"), path, None)).collect();
            moving.extend(&joints);
            let inverse: Vec<[f32; 16]> = skin
                .bind()
                .iter()
                .map(|z| [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., -*z as f32, 1.])
                .collect();
            let inverse = doc.accessor(Type::Mat4, None, &inverse);
            let parent =
                doc.root.push(Node { name: Some(name.clone()), children: Some(joints.clone()), ..Node::default() });
            let skin_index = doc.root.push(Skin {
                extensions: None,
                extras: Default::default(),
                inverse_bind_matrices: Some(inverse),
                joints,
                name: Some(name.clone()),
                skeleton: Some(parent),
            });
            let joints_accessor = doc.indices(Type::Vec4, Use::ArrayBuffer, skin.joints());
            let weights = doc.accessor(Type::Vec4, Some(Use::ArrayBuffer), skin.weights());
            let more = [(Semantic::Joints(0), joints_accessor), (Semantic::Weights(0), weights)];
            let mesh = doc.mesh(name, skin.mesh(), material, &more);
            let tube = doc.root.push(Node {
                name: Some(format!("{name}.skin")),
                mesh: Some(mesh),
                skin: Some(skin_index),
                ..Node::default()
            });
            turned.push(parent);
            scene_nodes.push(tube);
        }
        for ((mesh, shape), path) in looks.shapes.iter().zip(&header.shapes).zip(&self.shapes) {
            let name = &shape.name;
            // What has no inside is seen from both sides.
            let open = matches!(shape.outline, ShapeOutline::Plane | ShapeOutline::Mesh { .. });
            let (color, metallic, roughness) =
                if open { ([22, 86, 78], 0.0, 0.92) } else { ([219, 222, 227], 1.0, 0.3) };
            let material = doc.material(name, color, metallic, roughness, None, open);
            let mesh = doc.mesh(name, mesh, material, &[]);
            let node = doc.node(name, path, Some(mesh));
            moving.push(node);
            turned.push(node);
        }
        self.animate(&mut doc, &moving);
        if self.up == DVec3::Y || turned.is_empty() {
            scene_nodes.extend(turned);
        } else {
            let rotation = sutura::math::rotation_arc(self.up, DVec3::Y).as_quat().normalize();
            let rotation = Some(UnitQuaternion(rotation.to_array()));
            scene_nodes.push(doc.root.push(Node {
                name: Some("upright".into()),
                children: Some(turned),
                rotation,
                ..Node::default()
            }));
        }
        let scene =
            doc.root.push(Scene { extensions: None, extras: Default::default(), name: None, nodes: scene_nodes });
        doc.root.scene = Some(scene);
        out.write(None, &doc.into_glb()?)
    }
}

impl Document {
    /// Bytes as a view of the buffer, which begins at a multiple of four.
    fn view(&mut self, bytes: impl Iterator<Item = u8>, target: Option<Use>) -> Index<View> {
        let start = self.bytes.len();
        self.bytes.extend(bytes);
        let length = self.bytes.len() - start;
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.root.push(View {
            buffer: Index::new(0),
            byte_length: USize64::from(length),
            byte_offset: Some(USize64::from(start)),
            byte_stride: None,
            extensions: None,
            extras: Default::default(),
            name: None,
            target: target.map(Valid),
        })
    }

    fn push_accessor(
        &mut self,
        view: Index<View>,
        count: usize,
        component: ComponentType,
        kind: Type,
    ) -> Index<Accessor> {
        self.root.push(Accessor {
            buffer_view: Some(view),
            byte_offset: None,
            count: USize64::from(count),
            component_type: Valid(GenericComponentType(component)),
            extensions: None,
            extras: Default::default(),
            type_: Valid(kind),
            min: None,
            max: None,
            name: None,
            normalized: false,
            sparse: None,
        })
    }

    fn accessor<const N: usize>(&mut self, kind: Type, target: Option<Use>, values: &[[f32; N]]) -> Index<Accessor> {
        let view = self.view(values.iter().flatten().flat_map(|v| v.to_le_bytes()), target);
        self.push_accessor(view, values.len(), ComponentType::F32, kind)
    }

    /// The same with its least and greatest values, where the format wants them.
    fn bounded<const N: usize>(&mut self, kind: Type, target: Option<Use>, values: &[[f32; N]]) -> Index<Accessor> {
        let index = self.accessor(kind, target, values);
        let bound = |better: fn(f32, f32) -> f32| {
            let each: Vec<f32> = (0..N).map(|c| values.iter().map(|v| v[c]).reduce(better).unwrap_or(0.0)).collect();
            Some(gltf::json::Value::from(each))
        };
        let accessor = &mut self.root.accessors[index.value()];
        (accessor.min, accessor.max) = (bound(f32::min), bound(f32::max));
        index
    }

    fn indices<const N: usize>(&mut self, kind: Type, target: Use, values: &[[u16; N]]) -> Index<Accessor> {
        let view = self.view(values.iter().flatten().flat_map(|v| v.to_le_bytes()), Some(target));
        self.push_accessor(view, values.len(), ComponentType::U16, kind)
    }

    fn mesh(
        &mut self,
        name: &str,
        mesh: &TriangleMesh,
        material: Index<Material>,
        more: &[(Semantic, Index<Accessor>)],
    ) -> Index<Mesh> {
        let vertices = Some(Use::ArrayBuffer);
        let mut attributes = BTreeMap::new();
        attributes.insert(Valid(Semantic::Positions), self.bounded(Type::Vec3, vertices, &mesh.positions));
        attributes.insert(Valid(Semantic::Normals), self.accessor(Type::Vec3, vertices, &mesh.normals));
        if !mesh.uvs.is_empty() {
            attributes.insert(Valid(Semantic::TexCoords(0)), self.accessor(Type::Vec2, vertices, &mesh.uvs));
        }
        attributes.extend(more.iter().map(|(semantic, accessor)| (Valid(semantic.clone()), *accessor)));
        let view =
            self.view(mesh.triangles.iter().flatten().flat_map(|i| i.to_le_bytes()), Some(Use::ElementArrayBuffer));
        let indices = self.push_accessor(view, 3 * mesh.triangles.len(), ComponentType::U32, Type::Scalar);
        let primitive = Primitive {
            attributes,
            extensions: None,
            extras: Default::default(),
            indices: Some(indices),
            material: Some(material),
            mode: Valid(Mode::Triangles),
            targets: None,
        };
        self.root.push(Mesh {
            extensions: None,
            extras: Default::default(),
            name: Some(name.into()),
            primitives: vec![primitive],
            weights: None,
        })
    }

    /// A node where a path begins.
    fn node(&mut self, name: &str, path: &Path, mesh: Option<Index<Mesh>>) -> Index<Node> {
        let (translation, rotation) = (path.positions.first().copied(), path.turns.first().map(|q| UnitQuaternion(*q)));
        let scale = path.scales.first().copied().filter(|_| path.is_scaled());
        self.root.push(Node { name: Some(name.into()), mesh, translation, rotation, scale, ..Node::default() })
    }

    fn braid(&mut self) -> Index<Texture> {
        let view = self.view(braid().into_iter(), None);
        let mime_type = Some(gltf::json::image::MimeType("image/png".into()));
        let image = Image {
            buffer_view: Some(view),
            mime_type,
            name: Some("braid".into()),
            uri: None,
            extensions: None,
            extras: Default::default(),
        };
        let source = self.root.push(image);
        let sampler = self.root.push(texture::Sampler {
            mag_filter: Some(Valid(texture::MagFilter::Linear)),
            min_filter: Some(Valid(texture::MinFilter::LinearMipmapLinear)),
            ..texture::Sampler::default()
        });
        self.root.push(Texture {
            name: None,
            sampler: Some(sampler),
            source,
            extensions: None,
            extras: Default::default(),
        })
    }

    fn material(
        &mut self,
        name: &str,
        srgb: [u8; 3],
        metallic: f32,
        roughness: f32,
        texture: Option<Index<Texture>>,
        double_sided: bool,
    ) -> Index<Material> {
        let linear = |v: u8| {
            let v = f64::from(v) / 255.0;
            // Colors of the format are linear; sRGB as in IEC 61966-2-1.
            if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
        };
        let [r, g, b] = srgb.map(|v| linear(v) as f32);
        let base_color_texture =
            texture.map(|index| texture::Info { index, tex_coord: 0, extensions: None, extras: Default::default() });
        self.root.push(Material {
            name: Some(name.into()),
            double_sided,
            pbr_metallic_roughness: PbrMetallicRoughness {
                base_color_factor: PbrBaseColorFactor([r, g, b, 1.0]),
                base_color_texture,
                metallic_factor: StrengthFactor(metallic),
                roughness_factor: StrengthFactor(roughness),
                ..PbrMetallicRoughness::default()
            },
            ..Material::default()
        })
    }

    fn into_glb(mut self) -> Result<Vec<u8>, ExportError> {
        let length = USize64::from(self.bytes.len());
        self.root.push(Buffer {
            byte_length: length,
            name: None,
            uri: None,
            extensions: None,
            extras: Default::default(),
        });
        let json = self.root.to_vec().expect("a document in memory, with numbers that are finite");
        let padded = |n: usize| n.next_multiple_of(4);
        // Header, and two chunks with headers of their own.
        let length = u32::try_from(12 + 8 + padded(json.len()) + 8 + padded(self.bytes.len()))
            .map_err(|_| ExportError::TooLarge)?;
        let header = gltf::binary::Header { magic: *b"glTF", version: 2, length };
        let glb = gltf::binary::Glb { header, json: Cow::Owned(json), bin: Some(Cow::Owned(self.bytes)) };
        glb.to_vec().map_err(|_| ExportError::TooLarge)
    }
}
