//! Lines over the picture: frames, contacts, primitives, grips and their forces.

use crate::control::Viewer;
use crate::source::Play;
use crate::stage::{Prop, Stage, place};
use bevy::prelude::*;
use sutura_bevy::sutura::glam::DVec3;
use sutura_bevy::sutura::{ContactView, Geometry, Pose, World as Engine};
use sutura_bevy::{Grip, Hand, Solid, Space, Strand, Sutura};
use sutura_scene::{Contact, Frame};

const STICKS: Color = Color::srgb(0.25, 0.95, 0.45);
const SLIPS: Color = Color::srgb(1.0, 0.55, 0.1);
const NORMAL: Color = Color::srgb(0.85, 0.9, 1.0);
const PRIMITIVE: Color = Color::srgba(1.0, 0.95, 0.55, 0.8);
const GRIP: Color = Color::srgb(1.0, 0.85, 0.2);
const FORCE: Color = Color::srgb(1.0, 0.36, 0.12);

/// Lines lie over what they belong to.
pub fn set_up(mut store: ResMut<GizmoConfigStore>) {
    let (config, _) = store.config_mut::<DefaultGizmoConfigGroup>();
    config.depth_bias = -0.02;
    config.line.width = 2.0;
}

/// Draws them.
pub fn draw(
    mut gizmos: Gizmos,
    viewer: Res<Viewer>,
    stage: Res<Stage>,
    space: Res<Space>,
    sutura: Res<Sutura>,
    hand: Res<Hand>,
    strands: Query<&Strand, With<Prop>>,
    solids: Query<&Solid>,
    grips: Query<&Grip>,
) {
    let size = strands.iter().map(|s| s.skin.radius).fold(0.0, f64::max).max(1e-5);
    if viewer.frames {
        for strand in &strands {
            for (e, q) in strand.orientations.iter().enumerate() {
                let middle = (strand.positions[e] + strand.positions[e + 1]) * 0.5;
                let long = 3.5 * strand.skin.radius;
                for (axis, color) in [
                    (DVec3::X, Color::srgb(1.0, 0.25, 0.2)),
                    (DVec3::Y, Color::srgb(0.3, 1.0, 0.3)),
                    (DVec3::Z, Color::srgb(0.35, 0.55, 1.0)),
                ] {
                    gizmos.line(space.place(middle), space.place(middle + *q * axis * long), color);
                }
            }
        }
    }
    if viewer.primitives {
        for strand in &strands {
            for (e, q) in strand.orientations.iter().enumerate() {
                capsule(
                    &mut gizmos,
                    &space,
                    strand.positions[e],
                    strand.positions[e + 1],
                    *q * DVec3::X,
                    strand.skin.radius,
                );
            }
        }
        for solid in &solids {
            outline(&mut gizmos, &space, &solid.geometry, solid.pose, size);
        }
    }
    let past = stage.shown();
    if viewer.contacts {
        let touches = past.map_or_else(|| touches_now(sutura.world()), |frame| touches_then(&stage, frame));
        let greatest = touches.iter().map(|t| t.force.length()).fold(1e-6, f64::max);
        for t in touches {
            // The normal is as long as a few radii; forces are to each other as their lengths.
            let reach = 12.0 * t.radius;
            gizmos.line(space.place(t.at), space.place(t.at + t.normal * 4.0 * t.radius), NORMAL);
            let color = if t.sliding { SLIPS } else { STICKS };
            let friction = t.force - t.normal * t.force.dot(t.normal);
            gizmos.line(space.place(t.at), space.place(t.at + friction * (reach / greatest)), color);
            gizmos.sphere(Isometry3d::from_translation(space.place(t.at)), t.radius as f32 * space.scale * 0.35, color);
        }
    }
    let holds: Vec<(DVec3, DVec3)> = match past {
        Some(frame) => {
            let forces =
                frame.forces.iter().flat_map(|f| &f.grips).map(|f| place(*f)).chain(std::iter::repeat(DVec3::ZERO));
            frame.grips.iter().zip(forces).filter_map(|(at, force)| Some((place((*at)?), force))).collect()
        }
        None => {
            // Grips of the scene, of the keyboard, of the mouse.
            let world = sutura.world();
            let scenes = sutura.simulation::<Play>().into_iter().flat_map(|p| p.0.grips().filter_map(|(_, h)| h));
            let scenes =
                scenes.filter_map(|h| Some((world.grip_pose(h).ok()?.position, world.grip_wrench(h).ok()?.force)));
            let hands =
                grips.iter().filter_map(|g| Some((world.grip_pose(g.handle()?).ok()?.position, g.wrench().force)));
            let body = matches!(hand.held, Some(sutura_bevy::Held::Body(_))).then_some((hand.at, hand.force));
            scenes.chain(hands).chain(body).collect()
        }
    };
    for (at, force) in holds {
        if !viewer.instruments || past.is_some() {
            gizmos.sphere(Isometry3d::from_translation(space.place(at)), 2.2 * size as f32 * space.scale, GRIP);
        }
        // A centimeter a newton.
        let tip = at + force * 0.01;
        if force.length() > 0.01 {
            gizmos.arrow(space.place(at), space.place(tip), FORCE);
        }
    }
}

/// A contact to be drawn.
struct Touch {
    /// On the surface of the thread \[m\].
    at: DVec3,
    /// Toward the thread.
    normal: DVec3,
    /// On the thread \[N\].
    force: DVec3,
    sliding: bool,
    /// Of the thread \[m\].
    radius: f64,
}

/// Those of the present.
fn touches_now(world: &Engine) -> Vec<Touch> {
    let touch = |c: ContactView| {
        let (slot, ..) = c.a.thread()?;
        let radius = world.view().rods().find(|r| r.slot() == slot)?.radius();
        Some(Touch { at: c.point - c.normal * radius, normal: c.normal, force: c.force, sliding: c.sliding, radius })
    };
    world.contacts().filter_map(touch).collect()
}

/// Those of a frame that is remembered, or was recorded with its forces.
fn touches_then(stage: &Stage, frame: &Frame) -> Vec<Touch> {
    let touch = |c: &Contact| {
        let (radius, normal) = (stage.header.threads.get(c.on.thread as usize)?.radius, place(c.normal));
        Some(Touch { at: place(c.point) - normal * radius, normal, force: place(c.force), sliding: c.sliding, radius })
    };
    frame.forces.iter().flat_map(|f| &f.contacts).filter_map(touch).collect()
}

/// A capsule by two circles and four lines.
fn capsule(gizmos: &mut Gizmos, space: &Space, a: DVec3, b: DVec3, side: DVec3, radius: f64) {
    let axis = (b - a).normalize_or(DVec3::Z);
    let u = (side - axis * side.dot(axis)).normalize_or(axis.any_orthonormal_vector()) * radius;
    let v = axis.cross(u);
    for d in [u, v, -u, -v] {
        gizmos.line(space.place(a + d), space.place(b + d), PRIMITIVE);
    }
    for end in [a, b] {
        ring(gizmos, space, end, u, v);
    }
}

fn ring(gizmos: &mut Gizmos, space: &Space, center: DVec3, u: DVec3, v: DVec3) {
    let at = |k: u32| {
        let (sin, cos) = (f64::from(k) / 40.0 * core::f64::consts::TAU).sin_cos();
        space.place(center + u * cos + v * sin)
    };
    gizmos.linestrip((0..=40).map(at), PRIMITIVE);
}

/// The edges of a shape.
fn outline(gizmos: &mut Gizmos, space: &Space, geometry: &Geometry, pose: Pose, size: f64) {
    let axis = |v: DVec3| pose.orientation * v;
    let (x, y, z) = (axis(DVec3::X), axis(DVec3::Y), axis(DVec3::Z));
    match geometry {
        Geometry::Plane => {
            let half = 100.0 * size;
            for k in -4..=4 {
                let s = half * f64::from(k) / 4.0;
                gizmos.line(
                    space.place(pose.position + x * s - y * half),
                    space.place(pose.position + x * s + y * half),
                    PRIMITIVE,
                );
                gizmos.line(
                    space.place(pose.position + y * s - x * half),
                    space.place(pose.position + y * s + x * half),
                    PRIMITIVE,
                );
            }
        }
        Geometry::Sphere { radius } => {
            for (u, v) in [(x, y), (y, z), (z, x)] {
                ring(gizmos, space, pose.position, u * *radius, v * *radius);
            }
        }
        Geometry::Capsule { radius, half_length } | Geometry::Cylinder { radius, half_length } => {
            let round = matches!(geometry, Geometry::Capsule { .. });
            capsule(gizmos, space, pose.position - z * *half_length, pose.position + z * *half_length, x, *radius);
            if round {
                for end in [-*half_length, *half_length] {
                    ring(gizmos, space, pose.position + z * end, x * *radius, z * *radius);
                    ring(gizmos, space, pose.position + z * end, y * *radius, z * *radius);
                }
            }
        }
        Geometry::Box { half_sides } => {
            let corner = |i: usize| {
                let sign = |bit: usize| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
                space.place(
                    pose.position
                        + x * (sign(0) * half_sides.x)
                        + y * (sign(1) * half_sides.y)
                        + z * (sign(2) * half_sides.z),
                )
            };
            for i in 0..8 {
                for bit in (0..3).filter(|b| i >> b & 1 == 0) {
                    gizmos.line(corner(i), corner(i | 1 << bit), PRIMITIVE);
                }
            }
        }
        Geometry::Mesh { vertices, triangles } => {
            for t in triangles {
                let [a, b, c] = t.map(|i| space.place(pose.transform_point(vertices[i as usize])));
                gizmos.linestrip([a, b, c, a], PRIMITIVE);
            }
        }
    }
}
