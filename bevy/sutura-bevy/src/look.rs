//! How things look: materials and textures, all of them computed.

use crate::cloth::{uneven, wave};
use bevy::asset::RenderAssetUsages;
use bevy::image::{ImageAddressMode, ImageSampler, ImageSamplerDescriptor};
use bevy::prelude::*;
use bevy::render::render_resource::{
    Extent3d, TextureDimension, TextureFormat, TextureViewDescriptor, TextureViewDimension,
};
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
        // Dyed violet, undyed and blue are the colors of suture; the rest tells further threads apart.
        let colors = [
            ("#7b45e0", "#f4ecff"),
            ("#dccb9c", "#7c4a1c"),
            ("#2263dc", "#e8f1ff"),
            ("#e0553a", "#fff0dc"),
            ("#c43f9a", "#fff0f6"),
        ];
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
pub const DRAPE_TILE: f32 = 0.048;

/// The materials of bodies, made once.
#[derive(Resource, Debug, Clone)]
pub struct Materials {
    /// Brushed steel.
    pub steel: Handle<StandardMaterial>,
    /// Steel of instruments, darker and smoother.
    pub instrument: Handle<StandardMaterial>,
    /// The same, for meshes whose colors say where it fades away.
    pub fading: Handle<StandardMaterial>,
    /// Drape; a tile of its texture has sides of [`DRAPE_TILE`].
    pub drape: Handle<StandardMaterial>,
}

impl Materials {
    pub(crate) fn make(images: &mut Assets<Image>, materials: &mut Assets<StandardMaterial>) -> Self {
        let (color, normal) = drape();
        let drape = materials.add(StandardMaterial {
            base_color_texture: Some(images.add(color)),
            normal_map_texture: Some(images.add(normal)),
            perceptual_roughness: 0.92,
            reflectance: 0.18,
            ..default()
        });
        let steel = materials.add(StandardMaterial {
            base_color: Color::srgb(0.86, 0.87, 0.89),
            metallic: 1.0,
            perceptual_roughness: 0.26,
            ..default()
        });
        let polished = StandardMaterial {
            base_color: Color::srgb(0.72, 0.74, 0.77),
            metallic: 1.0,
            perceptual_roughness: 0.24,
            ..default()
        };
        let fading = materials.add(StandardMaterial { alpha_mode: AlphaMode::Blend, ..polished.clone() });
        Materials { steel, instrument: materials.add(polished), fading, drape }
    }
}

/// The material of a thread.
pub(crate) fn thread(look: &ThreadLook, images: &mut Assets<Image>) -> StandardMaterial {
    let (color, normal) = strands(look);
    StandardMaterial {
        base_color_texture: Some(images.add(color)),
        normal_map_texture: Some(images.add(normal)),
        perceptual_roughness: if look.braided { 0.42 } else { 0.26 },
        reflectance: 0.55,
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
            let t = smooth(0.06, 0.045, (u - 0.5).abs());
            mix(base, tracer, t)
        });
        return (
            mipped(SIZE, color, TextureFormat::Rgba8UnormSrgb),
            mipped(SIZE, normals(SIZE, 0.0, |_, _| 0.0), TextureFormat::Rgba8Unorm),
        );
    }
    // Two families of strands cross; in a checkerboard one or the other is on top.
    let cell = |u: f32, v: f32| {
        let (p, q) = (CARRIERS * (u + v), CARRIERS * (u - v));
        let first = (p.floor() + q.floor()).rem_euclid(2.0) < 0.5;
        let (across, along, number) = if first {
            (p.rem_euclid(1.0), q.rem_euclid(1.0), p.floor())
        } else {
            (q.rem_euclid(1.0), p.rem_euclid(1.0), q.floor() + 1000.0 * CARRIERS)
        };
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
    (
        mipped(SIZE, color, TextureFormat::Rgba8UnormSrgb),
        mipped(SIZE, normals(SIZE, 0.035, height), TextureFormat::Rgba8Unorm),
    )
}

/// Color and normals of a tile of drape: a twill of yarns none of which is quite like the next.
fn drape() -> (Image, Image) {
    const SIZE: usize = 1024;
    const YARNS: f32 = 160.0;
    // Height of the cloth, the yarn on top, whether that runs along u, and where along it.
    let weave = |u: f32, v: f32| {
        // Yarns wander a little from their straight lines.
        let (x, y) = (u * YARNS + 0.35 * wave(v, 1), v * YARNS + 0.35 * wave(u, 2));
        let over = (x.floor() + y.floor()).rem_euclid(4.0) < 2.0;
        let (across, along, yarn) = if over { (y, x, y.floor()) } else { (x, y, x.floor()) };
        let (across, along) = (across.rem_euclid(1.0), 0.5 * along.rem_euclid(2.0));
        let height = (PI * across).sin().max(0.0).powf(0.7) * (0.72 + 0.28 * (PI * along).sin());
        (height, yarn, over)
    };
    let base = Srgba::rgb(0.085, 0.335, 0.305);
    let color = picture(SIZE, |u, v| {
        let (height, yarn, over) = weave(u, v);
        let own = uneven(yarn, YARNS, if over { 1 } else { 2 });
        // Thick and thin places along a yarn.
        let slub = wave(if over { u } else { v } + own, 7 + (own * 5.0) as u32);
        let shade = (0.60 + 0.44 * height) * (0.91 + 0.15 * own + 0.05 * slub);
        let c = scaled(base, shade);
        // Worn fibers are paler.
        mix(c, Srgba::rgb(0.42, 0.62, 0.58), 0.10 * height * own * own)
    });
    (
        mipped(SIZE, color, TextureFormat::Rgba8UnormSrgb),
        mipped(SIZE, normals(SIZE, 0.0007, |u, v| weave(u, v).0), TextureFormat::Rgba8Unorm),
    )
}

/// A lamp with a screen before it: direction to its middle, half its width and height (at distance 1), brightness.
struct Screen(Vec3, f32, f32, f32);

/// The light of an operating theater from all around: lamps above and by the walls in a dim room, a green table below.
/// Diffuse and specular cube maps.
pub fn surroundings() -> (Image, Image) {
    let screens = [
        // Over the table; by the walls, upright; behind it, low and wide.
        Screen(Vec3::new(-0.45, 1.0, 0.05), 0.36, 0.36, 4.0),
        Screen(Vec3::new(0.6, 0.75, -0.4), 0.24, 0.24, 3.5),
        Screen(Vec3::new(-1.0, 0.28, 0.35), 0.22, 0.75, 2.6),
        Screen(Vec3::new(1.0, 0.30, 0.15), 0.09, 0.85, 3.4),
        Screen(Vec3::new(0.15, 0.42, -1.0), 0.95, 0.16, 2.8),
        Screen(Vec3::new(0.55, 0.75, 1.0), 0.42, 0.22, 2.0),
        Screen(Vec3::new(-0.55, 0.30, 1.0), 0.30, 0.70, 2.0),
    ];
    let light = |d: Vec3, blur: f32| {
        let wall = 0.38 + 0.34 * smooth(-0.3 - blur, 0.9, d.y) * smooth(1.3, 0.5, d.y);
        // The table is bright under the lamp and dark on the other side, which gives metal above it its roundness.
        let lit = 0.25 + 2.2 * smooth(0.75 + blur, -0.85 - blur, d.x - 0.4 * d.z);
        let table = Vec3::new(0.075, 0.175, 0.160) * (lit * smooth(0.05 + blur, -0.25 - blur, d.y));
        let mut sum = Vec3::new(0.90, 0.98, 1.0) * wall * smooth(-0.30 - blur, 0.10 + blur, d.y) + table;
        for Screen(to, width, height, bright) in &screens {
            let n = to.normalize();
            let u = n.cross(if n.y.abs() > 0.9 { Vec3::X } else { Vec3::Y }).normalize();
            let ahead = d.dot(n);
            if ahead <= 0.05 {
                continue;
            }
            // A screen that is blurred is wider and fainter.
            let edge = 0.03 + 1.1 * blur;
            let within =
                |x: f32, half: f32| smooth(half + edge, half - edge, x.abs() / ahead) * half / (half + 0.35 * edge);
            sum +=
                Vec3::new(1.0, 0.975, 0.94) * (*bright * within(d.dot(u), *width) * within(d.dot(u.cross(n)), *height));
        }
        sum
    };
    // What comes from the half room above a surface, by the cosine law.
    const AROUND: usize = 600;
    let rays: Vec<(Vec3, Vec3)> = (0..AROUND)
        .map(|k| {
            let (y, turn) = (1.0 - (2 * k + 1) as f32 / AROUND as f32, 2.399_963_2 * k as f32);
            let r = (1.0 - y * y).sqrt();
            Vec3::new(r * turn.cos(), y, r * turn.sin())
        })
        .map(|d| (d, light(d, 0.1)))
        .collect();
    let diffuse = |d: Vec3| rays.iter().map(|(to, l)| *l * d.dot(*to).max(0.0)).sum::<Vec3>() * (4.0 / AROUND as f32);
    (cube(8, 1, |d, _| diffuse(d)), cube(128, 8, |d, rough| light(d, rough * rough)))
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
                    data.extend(shared_exponent(c).to_le_bytes());
                }
            }
        }
    }
    let extent = Extent3d { width: size as u32, height: size as u32, depth_or_array_layers: 6 };
    let mut image =
        Image::new_uninit(extent, TextureDimension::D2, TextureFormat::Rgb9e5Ufloat, RenderAssetUsages::RENDER_WORLD);
    image.data = Some(data);
    image.texture_descriptor.mip_level_count = levels as u32;
    image.texture_view_descriptor =
        Some(TextureViewDescriptor { dimension: Some(TextureViewDimension::Cube), ..default() });
    image.sampler = ImageSampler::linear();
    image
}

/// Light brighter than white in four bytes: three numbers of nine bits, and five bits for the exponent that they share.
fn shared_exponent(c: Vec3) -> u32 {
    let c = c.clamp(Vec3::ZERO, Vec3::splat(65000.0));
    let exponent = (c.max_element().max(1e-9).log2().floor() as i32 + 1).clamp(-15, 16);
    let unit = ((exponent - 9) as f32).exp2();
    let [r, g, b] = (c / unit).to_array().map(|x| (x.round() as u32).min(511));
    r | g << 9 | b << 18 | ((exponent + 15) as u32) << 27
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
        let n = Vec3::new(-slope(height(u - e, v), height(u + e, v)), -slope(height(u, v - e), height(u, v + e)), 1.0)
            .normalize();
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
        anisotropy_clamp: 4,
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
