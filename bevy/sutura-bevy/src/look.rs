//! How things look: materials and textures, all of them computed.

use bevy::asset::RenderAssetUsages;
use bevy::image::{ImageAddressMode, ImageSampler, ImageSamplerDescriptor};
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat, TextureViewDescriptor, TextureViewDimension};
use core::f32::consts::{PI, TAU};

/// How a thread looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThreadLook {
    /// Its color.
    pub color: Srgba,
    /// Color of the tracer: one strand of a braid, a line along a monofilament. It shows the twist.
    pub tracer: Srgba,
    /// Braided or smooth.
    pub braided: bool,
}

impl Default for ThreadLook {
    fn default() -> Self {
        ThreadLook::of(0)
    }
}

impl ThreadLook {
    /// One of the looks for the threads of a scene, by their number.
    pub fn of(number: usize) -> Self {
        // Violet and blue are the colors of dyed suture; the rest tells further threads apart.
        let colors = [("#6a3fc4", "#f2e6c9"), ("#1f5fd0", "#f4f0e6"), ("#c8472f", "#f6e3c0"), ("#d9c58a", "#3d3424"), ("#b8377f", "#f2e6c9")];
        let (color, tracer) = colors[number % colors.len()];
        let hex = |s: &str| Srgba::hex(s).unwrap_or(Srgba::WHITE);
        ThreadLook { color: hex(color), tracer: hex(tracer), braided: true }
    }
}

/// How a body looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum BodyLook {
    /// Brushed steel.
    #[default]
    Steel,
    /// Green surgical cloth.
    Drape,
    /// Not drawn.
    Hidden,
}

/// Side of a tile of drape \[m\].
pub const DRAPE_TILE: f32 = 0.12;

/// The materials of bodies, made once.
#[derive(Resource, Debug, Clone)]
pub struct Materials {
    /// Steel.
    pub steel: Handle<StandardMaterial>,
    /// Drape; a tile of its texture has sides of [`DRAPE_TILE`].
    pub drape: Handle<StandardMaterial>,
}

impl Materials {
    pub(crate) fn make(images: &mut Assets<Image>, materials: &mut Assets<StandardMaterial>) -> Self {
        let (color, normal) = drape();
        let drape = materials.add(StandardMaterial {
            base_color_texture: Some(images.add(color)),
            normal_map_texture: Some(images.add(normal)),
            perceptual_roughness: 0.95,
            reflectance: 0.25,
            ..default()
        });
        let steel = materials.add(StandardMaterial { base_color: Color::srgb(0.80, 0.81, 0.83), metallic: 1.0, perceptual_roughness: 0.22, ..default() });
        Materials { steel, drape }
    }
}

/// The material of a thread.
pub(crate) fn thread(look: &ThreadLook, images: &mut Assets<Image>) -> StandardMaterial {
    let (color, normal) = strands(look);
    StandardMaterial {
        base_color_texture: Some(images.add(color)),
        normal_map_texture: Some(images.add(normal)),
        perceptual_roughness: if look.braided { 0.5 } else { 0.3 },
        reflectance: 0.5,
        ..default()
    }
}

/// Strands of a braid that run one way around the thread; as many run the other way.
const CARRIERS: f32 = 6.0;

/// Color and normals of the surface of a thread: once around it, and as long along it.
fn strands(look: &ThreadLook) -> (Image, Image) {
    const SIZE: usize = 256;
    let (base, tracer) = (look.color, look.tracer);
    if !look.braided {
        let color = picture(SIZE, |u, _| {
            let t = smooth(0.09, 0.07, (u - 0.5).abs());
            mix(base, tracer, t)
        });
        return (mipped(SIZE, color, TextureFormat::Rgba8UnormSrgb), mipped(SIZE, normals(SIZE, 0.0, |_, _| 0.0), TextureFormat::Rgba8Unorm));
    }
    // Two families of strands cross; in a checkerboard one or the other is on top.
    let cell = |u: f32, v: f32| {
        let (p, q) = (CARRIERS * (u + v), CARRIERS * (u - v));
        let first = (p.floor() + q.floor()).rem_euclid(2.0) < 0.5;
        let (across, along, number) =
            if first { (p.rem_euclid(1.0), q.rem_euclid(1.0), p.floor()) } else { (q.rem_euclid(1.0), p.rem_euclid(1.0), q.floor() + 1000.0 * CARRIERS) };
        (across, along, number.rem_euclid(CARRIERS) < 0.5 && first)
    };
    let height = |u: f32, v: f32| {
        let (across, along, _) = cell(u, v);
        (PI * across).sin().max(0.0).powf(0.6) * (0.55 + 0.45 * (PI * along).sin())
    };
    let color = picture(SIZE, |u, v| {
        let (across, _, traced) = cell(u, v);
        let fibers = 0.94 + 0.06 * (across * TAU * 4.0).sin();
        let shade = (0.45 + 0.55 * height(u, v)) * fibers;
        scaled(if traced { tracer } else { base }, shade)
    });
    (mipped(SIZE, color, TextureFormat::Rgba8UnormSrgb), mipped(SIZE, normals(SIZE, 0.035, height), TextureFormat::Rgba8Unorm))
}

/// Color and normals of a tile of drape: a weave, with soft folds.
fn drape() -> (Image, Image) {
    const SIZE: usize = 1024;
    const YARNS: f32 = 256.0;
    let folds = |u: f32, v: f32| {
        let wave = |a: f32, b: f32, shift: f32| (TAU * (a * u + b * v) + shift + 0.9 * (TAU * (b * u - a * v)).sin()).sin();
        0.45 * wave(1.0, 2.0, 0.3) + 0.3 * wave(3.0, -1.0, 1.1) + 0.16 * wave(2.0, 5.0, 2.7) + 0.09 * wave(7.0, 3.0, 0.9)
    };
    let weave = |u: f32, v: f32| {
        let (x, y) = (u * YARNS, v * YARNS);
        // Twill: the crossing moves on by one from row to row.
        let over = (x.floor() + y.floor()).rem_euclid(4.0) < 2.0;
        let (across, along) = if over { (y.rem_euclid(1.0), x.rem_euclid(1.0)) } else { (x.rem_euclid(1.0), y.rem_euclid(1.0)) };
        (PI * across).sin() * (0.7 + 0.3 * (PI * along).sin())
    };
    let height = |u: f32, v: f32| 0.007 * folds(u, v) + 0.0003 * weave(u, v);
    let base = Srgba::rgb(0.13, 0.36, 0.32);
    let color = picture(SIZE, |u, v| {
        let mottle = 1.0 + 0.05 * folds(v, u);
        scaled(base, mottle * (0.87 + 0.13 * weave(u, v)))
    });
    (mipped(SIZE, color, TextureFormat::Rgba8UnormSrgb), mipped(SIZE, normals(SIZE, 1.0, height), TextureFormat::Rgba8Unorm))
}

/// The light of an operating theater from all around: lamps above, dim walls. Diffuse and specular cube maps.
pub fn surroundings() -> (Image, Image) {
    // Lamps: direction, cosine of their half angle, brightness and warmth.
    let lamps = [
        (Vec3::new(0.3, 1.0, 0.35), 0.90, 1.0),
        (Vec3::new(-0.9, 0.55, 0.2), 0.93, 0.75),
        (Vec3::new(0.75, 0.35, -0.7), 0.95, 0.6),
        (Vec3::new(-0.1, 0.5, 1.0), 0.965, 0.5),
    ];
    let light = |d: Vec3, blur: f32| {
        let sky = 0.20 + 0.22 * smooth(-0.2 - blur, 1.0, d.y);
        let ground = Vec3::new(0.10, 0.17, 0.155) * smooth(0.15 + blur, -0.35 - blur, d.y);
        let mut sum = Vec3::new(0.93, 0.98, 1.0) * sky * smooth(-0.45 - blur, 0.1 + blur, d.y) + ground;
        for (to, edge, bright) in lamps {
            let c = d.dot(to.normalize());
            // A blurred lamp is wider and fainter.
            let (inner, outer) = (edge + 0.02, edge - 0.03 - 1.2 * blur);
            sum += Vec3::new(1.0, 0.97, 0.92) * bright * smooth(outer, inner, c) / (1.0 + 9.0 * blur);
        }
        // Long lamps by the walls, which metal shows as streaks.
        for (x, z) in [(0.8, 0.6), (-0.95, 0.3), (0.2, -0.98)] {
            let side = Vec2::new(d.x, d.z).try_normalize().map_or(0.0, |s| s.dot(Vec2::new(x, z)));
            let level = smooth(-0.95 - blur, -0.5, d.y) * smooth(0.95 + blur, 0.6, d.y);
            sum += Vec3::new(0.95, 0.98, 1.0) * (0.6 * level * smooth(0.88 - 0.9 * blur, 0.97, side) / (1.0 + 5.0 * blur));
        }
        sum
    };
    (cube(8, 1, |d, _| light(d, 1.0)), cube(64, 7, |d, rough| light(d, rough * rough)))
}

/// A cube map with `levels` mip levels from the light of each direction at each roughness.
fn cube(size: usize, levels: usize, light: impl Fn(Vec3, f32) -> Vec3) -> Image {
    let mut data = Vec::new();
    for face in 0..6 {
        for level in 0..levels {
            let side = (size >> level).max(1);
            for y in 0..side {
                for x in 0..side {
                    let at = |k: usize| 2.0 * (k as f32 + 0.5) / side as f32 - 1.0;
                    let (s, t) = (at(x), at(y));
                    let d = match face {
                        0 => Vec3::new(1.0, -t, -s),
                        1 => Vec3::new(-1.0, -t, s),
                        2 => Vec3::new(s, 1.0, t),
                        3 => Vec3::new(s, -1.0, -t),
                        4 => Vec3::new(s, -t, 1.0),
                        _ => Vec3::new(-s, -t, -1.0),
                    };
                    let rough = if levels > 1 { level as f32 / (levels - 1) as f32 } else { 1.0 };
                    let c = light(d.normalize(), rough);
                    data.extend(bytes(Srgba::from(LinearRgba::rgb(c.x, c.y, c.z))));
                }
            }
        }
    }
    let extent = Extent3d { width: size as u32, height: size as u32, depth_or_array_layers: 6 };
    let mut image = Image::new_uninit(extent, TextureDimension::D2, TextureFormat::Rgba8UnormSrgb, RenderAssetUsages::RENDER_WORLD);
    image.data = Some(data);
    image.texture_descriptor.mip_level_count = levels as u32;
    image.texture_view_descriptor = Some(TextureViewDescriptor { dimension: Some(TextureViewDimension::Cube), ..default() });
    image.sampler = ImageSampler::linear();
    image
}

/// Texels of a square picture, u and v in [0, 1).
fn picture(size: usize, color: impl Fn(f32, f32) -> Srgba) -> Vec<[u8; 4]> {
    let at = |k: usize| (k as f32 + 0.5) / size as f32;
    (0..size * size).map(|i| bytes(color(at(i % size), at(i / size)))).collect()
}

/// Normals of a periodic height field over a unit square, heights times `scale`.
fn normals(size: usize, scale: f32, height: impl Fn(f32, f32) -> f32) -> Vec<[u8; 4]> {
    let (at, e) = (|k: usize| (k as f32 + 0.5) / size as f32, 0.5 / size as f32);
    let one = |i: usize| {
        let (u, v) = (at(i % size), at(i / size));
        let slope = |a: f32, b: f32| scale * (b - a) / (2.0 * e);
        let n = Vec3::new(-slope(height(u - e, v), height(u + e, v)), -slope(height(u, v - e), height(u, v + e)), 1.0).normalize();
        let byte = |x: f32| ((0.5 * x + 0.5) * 255.0).round() as u8;
        [byte(n.x), byte(n.y), byte(n.z), 255]
    };
    (0..size * size).map(one).collect()
}

/// A texture that repeats, with all its smaller versions.
fn mipped(size: usize, texels: Vec<[u8; 4]>, format: TextureFormat) -> Image {
    let (mut data, mut level, mut side, mut levels) = (Vec::new(), texels, size, 1);
    data.extend(level.iter().flatten());
    while side > 1 {
        let half = side / 2;
        let mean = |i: usize| {
            let (x, y) = (2 * (i % half), 2 * (i / half));
            let four = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)].map(|(x, y)| level[y * side + x]);
            std::array::from_fn(|c| (four.iter().map(|t| u32::from(t[c])).sum::<u32>() / 4) as u8)
        };
        level = (0..half * half).map(mean).collect();
        data.extend(level.iter().flatten());
        (side, levels) = (half, levels + 1);
    }
    let extent = Extent3d { width: size as u32, height: size as u32, depth_or_array_layers: 1 };
    let mut image = Image::new_uninit(extent, TextureDimension::D2, format, RenderAssetUsages::RENDER_WORLD);
    image.data = Some(data);
    image.texture_descriptor.mip_level_count = levels;
    let mode = ImageAddressMode::Repeat;
    image.sampler = ImageSampler::Descriptor(ImageSamplerDescriptor {
        address_mode_u: mode,
        address_mode_v: mode,
        anisotropy_clamp: 8,
        ..ImageSamplerDescriptor::linear()
    });
    image
}

fn bytes(c: Srgba) -> [u8; 4] {
    [c.red, c.green, c.blue, c.alpha].map(|x| (x.clamp(0.0, 1.0) * 255.0).round() as u8)
}

fn mix(a: Srgba, b: Srgba, t: f32) -> Srgba {
    Srgba::rgb(a.red + (b.red - a.red) * t, a.green + (b.green - a.green) * t, a.blue + (b.blue - a.blue) * t)
}

fn scaled(c: Srgba, by: f32) -> Srgba {
    Srgba::rgb(c.red * by, c.green * by, c.blue * by)
}

/// From 0 at `from` to 1 at `to`, smoothly.
fn smooth(from: f32, to: f32, x: f32) -> f32 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
