//! A camera that turns about a point.

use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::input::mouse::{AccumulatedMouseMotion, AccumulatedMouseScroll, MouseScrollUnit};
use bevy::light::EnvironmentMapLight;
use bevy::pbr::{DistanceFog, FogFalloff};
use bevy::prelude::*;
use sutura_bevy::{Hand, Pointer, PointerCamera, look};

/// Height of the field of view \[rad\]: narrow, as through a loupe, so that near things are not blown up.
pub const FIELD: f32 = 0.42;
/// What is seen where nothing is.
pub const BACKGROUND: Color = Color::srgb(0.016, 0.055, 0.052);

/// Where the camera is.
#[derive(Resource, Debug, Clone, PartialEq)]
pub struct Orbit {
    /// The point in the middle of the picture.
    pub target: Vec3,
    /// From there to the eye.
    pub distance: f32,
    /// Direction from the target to the eye, and up in the picture.
    direction: Vec3,
    up: Vec3,
    /// Distance from which all of the scene is seen.
    reach: f32,
    home: (Vec3, f32, Vec3, Vec3),
}

impl Default for Orbit {
    fn default() -> Self {
        Orbit::new(Vec3::ZERO, 30.0, Vec3::new(0.4, 0.5, 0.8), Vec3::Y)
    }
}

impl Orbit {
    fn new(target: Vec3, distance: f32, direction: Vec3, up: Vec3) -> Self {
        let direction = direction.try_normalize().unwrap_or(Vec3::Z);
        let up = if up.cross(direction).length() > 0.05 { up.normalize() } else { direction.any_orthonormal_vector() };
        Orbit { target, distance, direction, up, reach: distance, home: (target, distance, direction, up) }
    }

    /// Looks from `from` (a direction from the point to the eye) at the points, all of them, or at a point with a
    /// width.
    pub fn fitted(
        points: &[Vec3],
        from: Vec3,
        up: Vec3,
        at: Option<Vec3>,
        width: Option<f32>,
        aspect: f32,
        zoom: f32,
    ) -> Self {
        let mut orbit = Orbit::new(Vec3::ZERO, 10.0, from, up);
        let (back, right) = (orbit.direction, orbit.right());
        let above = back.cross(right);
        let tan = (0.5 * FIELD).tan();
        let bounds = |axis: Vec3| {
            points
                .iter()
                .map(|p| p.dot(axis))
                .fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)))
        };
        let middle = |axis: Vec3| {
            let (a, b) = bounds(axis);
            if a <= b { axis * (0.5 * (a + b)) } else { Vec3::ZERO }
        };
        orbit.target = at.unwrap_or(middle(right) + middle(above) + middle(back));
        orbit.distance = match width {
            Some(width) => 0.5 * width / (aspect * tan),
            None => {
                let need = |p: &Vec3| {
                    let d = *p - orbit.target;
                    d.dot(back) + (d.dot(right).abs() / aspect).max(d.dot(above).abs()) / tan
                };
                1.12 * points.iter().map(need).fold(0.5, f32::max)
            }
        };
        orbit.reach = orbit.distance;
        orbit.distance /= zoom.max(1e-3);
        orbit.home = (orbit.target, orbit.distance, orbit.direction, orbit.up);
        orbit
    }

    /// Back to where it was fitted.
    pub fn go_home(&mut self) {
        (self.target, self.distance, self.direction, self.up) = self.home;
    }
    /// Direction to the eye where it was fitted: the lamp stands by it.
    pub fn home_direction(&self) -> Vec3 {
        self.home.2
    }
    /// To the right in the picture where it was fitted.
    pub fn home_right(&self) -> Vec3 {
        self.home.3.cross(self.home.2).normalize()
    }
    /// The middle of the picture where it was fitted.
    pub fn home_target(&self) -> Vec3 {
        self.home.0
    }
    /// Distance from which it was fitted.
    pub fn home_distance(&self) -> f32 {
        self.home.1
    }
    /// To the right in the picture.
    pub fn right(&self) -> Vec3 {
        self.up.cross(self.direction).normalize()
    }
    /// Upward in the picture.
    pub fn above(&self) -> Vec3 {
        self.direction.cross(self.right())
    }
    /// Into the picture.
    pub fn forward(&self) -> Vec3 {
        -self.direction
    }
    /// Where the camera is.
    pub fn transform(&self) -> Transform {
        Transform::from_translation(self.target + self.direction * self.distance).looking_at(self.target, self.up)
    }
    /// Turns by angles to the right and upward \[rad\].
    pub fn turn(&mut self, right: f32, up: f32) {
        self.direction = Quat::from_axis_angle(self.up, -right) * self.direction;
        let raised = Quat::from_axis_angle(self.right(), -up) * self.direction;
        // Not over the pole.
        if raised.dot(self.up).abs() < 0.995 {
            self.direction = raised.normalize();
        }
    }
    /// Moves the target by parts of the picture's height.
    pub fn pan(&mut self, right: f32, up: f32) {
        let height = 2.0 * self.distance * (0.5 * FIELD).tan();
        self.target += (self.right() * right + self.above() * up) * height;
    }
    /// Nearer (below 1) or farther.
    pub fn zoom(&mut self, factor: f32) {
        self.distance = (self.distance * factor).clamp(0.05, 1e4);
    }
    /// How large a length at the target is in a picture of this height, in pixels.
    pub fn pixels(&self, length: f32, height: u32) -> f32 {
        length * height as f32 / (2.0 * self.distance * (0.5 * FIELD).tan())
    }
    /// How far away all of the scene ends.
    pub fn far(&self) -> f32 {
        2.2 * self.distance.max(self.reach)
    }
    /// Depths between which things are drawn.
    pub fn depths(&self) -> (f32, f32) {
        (0.02 * self.distance, 30.0 * self.distance + 200.0)
    }
}

/// The light from all around, computed once.
#[derive(Resource)]
pub struct Surroundings(EnvironmentMapLight);

/// Makes it.
pub fn make_surroundings(mut commands: Commands, mut images: ResMut<Assets<Image>>) {
    let (diffuse, specular) = look::surroundings();
    let light = EnvironmentMapLight {
        diffuse_map: images.add(diffuse),
        specular_map: images.add(specular),
        intensity: 900.0,
        ..default()
    };
    commands.insert_resource(Surroundings(light));
}

/// What a camera of the viewer has.
pub fn lens(orbit: &Orbit, around: &Surroundings) -> impl Bundle {
    (
        Camera3d::default(),
        Camera { clear_color: ClearColorConfig::Custom(BACKGROUND), ..default() },
        Projection::from(projection(orbit)),
        orbit.transform(),
        // Needs no table of the renderer's. It is done before the samples of a pixel are averaged: highlights have
        // smooth edges then.
        Tonemapping::AcesFitted,
        Msaa::Sample4,
        around.0.clone(),
        fog(orbit),
        PointerCamera,
    )
}

fn projection(orbit: &Orbit) -> PerspectiveProjection {
    let (near, far) = orbit.depths();
    PerspectiveProjection { fov: FIELD, near, far, ..default() }
}

/// The table ends in the dark.
fn fog(orbit: &Orbit) -> DistanceFog {
    DistanceFog {
        color: BACKGROUND,
        falloff: FogFalloff::Linear { start: 0.7 * orbit.far(), end: 2.2 * orbit.far() },
        ..default()
    }
}

/// Puts the camera where it is to be.
pub fn follow(
    orbit: Res<Orbit>,
    mut cameras: Query<(&mut Transform, &mut Projection, &mut DistanceFog), With<PointerCamera>>,
) {
    if !orbit.is_changed() {
        return;
    }
    for (mut place, mut lens, mut air) in &mut cameras {
        *place = orbit.transform();
        let aspect = if let Projection::Perspective(p) = &*lens { p.aspect_ratio } else { 1.0 };
        *lens = Projection::from(PerspectiveProjection { aspect_ratio: aspect, ..projection(&orbit) });
        *air = fog(&orbit);
    }
}

/// The mouse moves the camera: right button (or left beside everything) turns, middle one moves, the wheel comes
/// nearer; while something is held, it brings that nearer.
pub fn orbit(
    mut orbit: ResMut<Orbit>,
    buttons: Res<ButtonInput<MouseButton>>,
    keys: Res<ButtonInput<KeyCode>>,
    motion: Res<AccumulatedMouseMotion>,
    scroll: Res<AccumulatedMouseScroll>,
    mut pointer: ResMut<Pointer>,
    hand: Res<Hand>,
    windows: Query<&Window>,
    mut mine: Local<bool>,
) {
    let height = windows.iter().next().map_or(720.0, Window::height).max(1.0);
    let shift = keys.pressed(KeyCode::ShiftLeft) || keys.pressed(KeyCode::ShiftRight);
    let any = [MouseButton::Left, MouseButton::Right, MouseButton::Middle];
    if buttons.any_just_pressed(any) {
        *mine = !pointer.busy;
    }
    let by = motion.delta / height;
    if *mine && by != Vec2::ZERO {
        let left = buttons.pressed(MouseButton::Left) && hand.held.is_none();
        if buttons.pressed(MouseButton::Middle) || (shift && buttons.pressed(MouseButton::Right)) {
            orbit.pan(-by.x, by.y);
        } else if buttons.pressed(MouseButton::Right) || left {
            orbit.turn(3.0 * by.x, 3.0 * by.y);
        }
    }
    let lines = scroll.delta.y * if scroll.unit == MouseScrollUnit::Line { 1.0 } else { 0.02 };
    if lines != 0.0 && !pointer.busy {
        if hand.held.is_some() {
            pointer.farther += 0.02 * lines;
        } else {
            orbit.zoom((-0.12 * lines).exp());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_is_in_the_picture_and_the_pole_is_not_crossed() {
        let points = [Vec3::new(-5.0, 0.0, 1.0), Vec3::new(5.0, 2.0, -1.0), Vec3::new(0.0, 4.0, 3.0)];
        let mut orbit = Orbit::fitted(&points, Vec3::new(0.3, 0.4, 1.0), Vec3::Y, None, None, 1.6, 1.0);
        let seen = |orbit: &Orbit, p: Vec3| {
            let view = orbit.transform().to_matrix().inverse();
            let clip = Mat4::perspective_infinite_reverse_rh(FIELD, 1.6, 0.1) * view;
            let at = clip.project_point3(p);
            at.x.abs() < 1.0 && at.y.abs() < 1.0
        };
        assert!(points.iter().all(|p| seen(&orbit, *p)));
        let before = orbit.clone();
        for _ in 0..100 {
            orbit.turn(0.1, 0.1);
        }
        assert!(orbit.transform().is_finite());
        assert!(orbit.above().dot(Vec3::Y) > 0.0);
        orbit.go_home();
        assert_eq!(orbit, before);
    }
}
