//! A game: two players tug at a thread that lies around a post, one with A and D, one with the arrow keys. Whoever draws the middle of the thread
//! over to their side wins. Only the plugin's public interface is used.

use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::prelude::*;
use sutura_bevy::sutura::glam::{DQuat, DVec3};
use sutura_bevy::sutura::{Friction, Geometry, Hold, Material, Place, Pose, RodSpec, ShapeSpec};
use sutura_bevy::{Body, Grip, PhysicsFrame, PhysicsSet, Space, Sutura, SuturaPlugin, Thread};

/// Half the length of the thread on each side of the post \[m\].
const ARM: f64 = 0.06;
const POST: f64 = 0.006;
/// How fast a player pulls \[m/s\], and how hard, pulling and at rest \[N\].
const SPEED: f64 = 0.03;
const FORCE: (f64, f64) = (5.0, 2.0);

/// A player, by the keys that pull and give way.
#[derive(Component)]
struct Player(KeyCode, KeyCode);

fn main() {
    App::new()
        .add_plugins((DefaultPlugins, SuturaPlugin::default()))
        .add_systems(Startup, set_up)
        .add_systems(PhysicsFrame, pull.in_set(PhysicsSet::Drive))
        .add_systems(Update, score)
        .run();
}

fn set_up(mut commands: Commands, mut sutura: ResMut<Sutura>, space: Res<Space>) -> Result {
    sutura.edit().set_friction(0, 0, Friction::coulomb(0.1))?;
    // A U around the post, whose axis is y: up one side, half around, down the other.
    let radius = POST + 0.16e-3;
    let half_around = radius * std::f64::consts::PI;
    let at = |s: f64| {
        let a = (s - ARM) / radius;
        match s {
            s if s < ARM => DVec3::new(-radius, 0.0, s - ARM),
            s if s < ARM + half_around => DVec3::new(-radius * a.cos(), 0.0, radius * a.sin()),
            s => DVec3::new(radius, 0.0, ARM + half_around - s),
        }
    };
    let n = 120;
    let points = (0..=n).map(|i| at((2.0 * ARM + half_around) * f64::from(i) / f64::from(n))).collect();
    let material = Material { bend_damping: 0.01, bend_scale: 0.05, ..Material::elastic(2e9, 1150.0) };
    let thread = commands.spawn(Thread::new(RodSpec::new(points, 0.15e-3, material))).id();
    // The axis of a cylinder is its z.
    let lying = DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
    let post = Geometry::Cylinder { radius: POST, half_length: 0.01 };
    commands.spawn(Body::new(ShapeSpec::fixed(post, Pose::new(DVec3::ZERO, lying))));
    commands.spawn((Grip::new(thread, Place::Start, Hold::Pin), Player(KeyCode::KeyA, KeyCode::KeyD)));
    commands.spawn((Grip::new(thread, Place::End, Hold::Pin), Player(KeyCode::ArrowDown, KeyCode::ArrowUp)));

    let eye = space.place(DVec3::new(0.0, -0.2, 0.02));
    // The tone mapping that Bevy takes by itself wants a table that this build of it has not.
    commands.spawn((
        Camera3d::default(),
        Tonemapping::AcesFitted,
        Transform::from_translation(eye).looking_at(space.place(DVec3::new(0.0, 0.0, -0.025)), Vec3::Y),
    ));
    commands.spawn((DirectionalLight { illuminance: 8000.0, ..default() }, Transform::from_xyz(4.0, 10.0, 8.0).looking_at(Vec3::ZERO, Vec3::Y)));
    Ok(())
}

/// Before each frame of physics the grips go where their players pull them: down or up.
fn pull(keys: Res<ButtonInput<KeyCode>>, mut grips: Query<(&mut Grip, &Player)>, clock: Res<sutura_bevy::PhysicsClock>) {
    for (mut grip, Player(harder, weaker)) in &mut grips {
        let way = f64::from(keys.pressed(*weaker)) - f64::from(keys.pressed(*harder));
        let pose = grip.pose();
        grip.limits.force = if way < 0.0 { FORCE.0 } else { FORCE.1 };
        if grip.handle().is_some() {
            grip.target = Some(Pose::new(pose.position + DVec3::Z * way * SPEED * clock.frame, pose.orientation));
        }
    }
}

fn score(grips: Query<&Grip>, mut windows: Query<&mut Window>) {
    let mut ends = grips.iter().map(|g| (g.force(), g.pose().position.z));
    let (Some((left, a)), Some((right, b)), Ok(mut window)) = (ends.next(), ends.next(), windows.single_mut()) else { return };
    let ahead = if (a - b).abs() < 2.0 * POST {
        "even"
    } else if a < b {
        "left leads"
    } else {
        "right leads"
    };
    window.title = format!("tug: left {left:.2} N, right {right:.2} N, {ahead}");
}
