//! A game: two players tug at a thread that lies around a post, the left one (red) with A and D, the right one (blue)
//! with the arrow keys. Whoever is ahead colors the picture; whoever is ahead by 3 cm has won, and Space begins anew.
//! Only the plugin's public interface is used.

use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::light::EnvironmentMapLight;
use bevy::prelude::*;
use sutura_bevy::sutura::glam::{DQuat, DVec3};
use sutura_bevy::sutura::{Friction, Geometry, Hold, Material, Place, Pose, RodSpec, ShapeSpec};
use sutura_bevy::{Body, Grip, PhysicsClock, PhysicsFrame, PhysicsSet, Space, Sutura, SuturaPlugin, Thread, look};

/// Length of the thread on each side of the post \[m\], and the post.
const ARM: f64 = 0.06;
const POST: f64 = 0.006;
/// By how much one end is lower than the other when its player has won \[m\].
const WIN: f64 = 0.03;
/// How fast a player pulls \[m/s\], and how hard, pulling and at rest \[N\].
const SPEED: f64 = 0.03;
const FORCE: (f64, f64) = (5.0, 2.0);

/// A player: the keys that pull and give way, and the color.
#[derive(Component)]
struct Player(KeyCode, KeyCode, Color);

fn main() {
    App::new()
        .add_plugins((DefaultPlugins, SuturaPlugin::default()))
        .insert_resource(GlobalAmbientLight { brightness: 400.0, ..default() })
        .add_systems(Startup, (set_up, begin))
        .add_systems(PhysicsFrame, pull.in_set(PhysicsSet::Drive))
        .add_systems(Update, (score, begin.run_if(|keys: Res<ButtonInput<KeyCode>>| keys.just_pressed(KeyCode::Space))))
        .run();
}

fn set_up(
    mut commands: Commands,
    mut sutura: ResMut<Sutura>,
    space: Res<Space>,
    mut images: ResMut<Assets<Image>>,
) -> Result {
    sutura.edit().set_friction(0, 0, Friction::coulomb(0.1))?;
    // The axis of a cylinder is its z.
    let lying = DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
    commands.spawn(Body::new(ShapeSpec::fixed(
        Geometry::Cylinder { radius: POST, half_length: 0.01 },
        Pose::new(DVec3::ZERO, lying),
    )));
    let (diffuse_map, specular_map) = look::surroundings();
    commands.spawn((
        Camera3d::default(),
        // The one that Bevy takes by itself wants a table that this build of it has not.
        Tonemapping::AcesFitted,
        EnvironmentMapLight {
            diffuse_map: images.add(diffuse_map),
            specular_map: images.add(specular_map),
            intensity: 2500.0,
            ..default()
        },
        Transform::from_translation(space.place(DVec3::new(0.0, -0.12, 0.01)))
            .looking_at(space.place(DVec3::new(0.0, 0.0, -0.045)), Vec3::Y),
    ));
    commands.spawn((
        DirectionalLight { illuminance: 12_000.0, ..default() },
        Transform::from_xyz(4.0, 10.0, 8.0).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    Ok(())
}

/// A new thread and two players in place of those there were: a U around the post, whose axis is y, up one side, half
/// around, down the other.
fn begin(mut commands: Commands, old: Query<Entity, Or<(With<Thread>, With<Grip>)>>) {
    old.iter().for_each(|entity| commands.entity(entity).despawn());
    let radius = POST + 0.3e-3;
    let half_around = radius * std::f64::consts::PI;
    let at = |s: f64| match s - ARM {
        u if u < 0.0 => DVec3::new(-radius, 0.0, u),
        u if u < half_around => DVec3::new(-radius * (u / radius).cos(), 0.0, radius * (u / radius).sin()),
        u => DVec3::new(radius, 0.0, half_around - u),
    };
    let points = (0..=120).map(|i| at((2.0 * ARM + half_around) * f64::from(i) / 120.0)).collect();
    let material = Material { bend_damping: 0.01, bend_scale: 0.05, ..Material::elastic(2e9, 1150.0) };
    let thread = commands.spawn(Thread::new(RodSpec::new(points, 0.3e-3, material))).id();
    let (red, blue) = (Color::srgb(0.9, 0.35, 0.3), Color::srgb(0.35, 0.5, 0.95));
    commands.spawn((Grip::new(thread, Place::Start, Hold::Pin), Player(KeyCode::KeyA, KeyCode::KeyD, red)));
    commands.spawn((Grip::new(thread, Place::End, Hold::Pin), Player(KeyCode::ArrowDown, KeyCode::ArrowUp, blue)));
}

/// Before each frame of physics the grips go where their players pull them: down or up.
fn pull(keys: Res<ButtonInput<KeyCode>>, mut grips: Query<(&mut Grip, &Player)>, clock: Res<PhysicsClock>) {
    let (low, high) = grips
        .iter()
        .map(|(g, _)| g.pose().position.z)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), z| (a.min(z), b.max(z)));
    let won = high - low >= WIN;
    for (mut grip, Player(harder, weaker, _)) in grips.iter_mut().filter(|(grip, _)| grip.handle().is_some()) {
        let way = f64::from(keys.pressed(*weaker)) - f64::from(keys.pressed(*harder));
        let way = if won { 0.0 } else { way };
        let pose = grip.pose();
        grip.limits.force = if way < 0.0 { FORCE.0 } else { FORCE.1 };
        grip.target = Some(Pose::new(pose.position + DVec3::Z * way * SPEED * clock.frame, pose.orientation));
    }
}

fn score(
    grips: Query<(&Grip, &Player)>,
    space: Res<Space>,
    mut air: ResMut<ClearColor>,
    mut windows: Query<&mut Window>,
    mut gizmos: Gizmos,
) {
    let ends: Vec<_> = grips
        .iter()
        .filter(|(grip, _)| grip.handle().is_some())
        .map(|(g, p)| (p.2, g.pose().position, g.force()))
        .collect();
    let ([(red, a, left), (blue, b, right)], Ok(mut window)) = (&ends[..], windows.single_mut()) else { return };
    for (color, at, _) in &ends {
        gizmos.sphere(Isometry3d::from_translation(space.place(*at)), 0.002 * space.scale, *color);
    }
    let lead = b.z - a.z;
    let (who, color) = if lead > 0.0 { ("left", red) } else { ("right", blue) };
    let ahead = (lead.abs() / WIN).min(1.0);
    air.0 = Color::srgb(0.85, 0.87, 0.88).mix(color, ahead as f32);
    let says = if ahead < 0.2 {
        "even".into()
    } else {
        format!("{who} {}", if ahead < 1.0 { "leads" } else { "has won (Space: again)" })
    };
    window.title = format!("tug: left {left:.2} N, right {right:.2} N, {says}");
}
