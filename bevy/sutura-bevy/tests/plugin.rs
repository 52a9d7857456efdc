//! The plugin without a window: what a player does through its input, and what becomes of time.

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use std::ops::ControlFlow;
use std::time::Duration;
use sutura_bevy::sutura::glam::{DQuat, DVec3};
use sutura_bevy::sutura::input::Recording;
use sutura_bevy::sutura::{
    Geometry, GripSpec, Handle, Hold, Material, Place, Pose, RodSpec, Settings, ShapeSpec, Stretch,
};
use sutura_bevy::{
    Body, Grip, Hand, Held, PhysicsClock, PhysicsFrame, PhysicsSet, Pointer, PointerCamera, Space, Sutura,
    SuturaPlugin, Thread, sutura,
};

/// An app whose pictures take as long as they are told to.
fn app() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, SuturaPlugin::default()));
    let settings = Settings { gravity: DVec3::ZERO, linear_damping: 0.99, ..Settings::default() };
    app.insert_resource(Sutura::new(settings, true).unwrap());
    // The machine may be busy: the budget is for players, not for tests.
    app.world_mut().resource_mut::<PhysicsClock>().budget = Duration::from_secs(1000);
    app
}

fn picture(app: &mut App, seconds: f64) {
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f64(seconds)));
    app.update();
}

/// 10 cm of thread along x, 40 elements, its start pinned.
fn thread(app: &mut App) -> Entity {
    let spec = RodSpec::straight(
        DVec3::ZERO,
        DVec3::X * 0.1,
        40,
        0.2e-3,
        Material { bend_damping: 0.01, ..Material::elastic(1e9, 1150.0) },
    );
    let thread = app.world_mut().spawn(Thread::new(spec)).id();
    app.world_mut().spawn(Grip::new(thread, Place::Start, Hold::Pin));
    thread
}

/// Looks along -y of the engine at a point of it.
fn look_at(app: &mut App, at: DVec3, pressed: bool) {
    let space = *app.world().resource::<Space>();
    let eye = space.place(at + DVec3::Y * 0.3);
    let forward = space.direction(DVec3::NEG_Y);
    let mut pointer = app.world_mut().resource_mut::<Pointer>();
    pointer.ray = Some(Ray3d::new(eye, Dir3::new(forward).unwrap()));
    (pointer.forward, pointer.pressed, pointer.reach) = (forward, pressed, 0.01);
}

fn end_of(app: &App, thread: Entity) -> DVec3 {
    let handle = app.world().get::<Thread>(thread).unwrap().handle().unwrap();
    *app.world().resource::<Sutura>().world().rod(handle).unwrap().positions().last().unwrap()
}

#[test]
fn the_hand_takes_a_thread_pulls_and_lets_go() {
    let mut app = app();
    let thread = thread(&mut app);
    picture(&mut app, 1.0 / 60.0);
    let start = DVec3::X * 0.1;
    look_at(&mut app, start, true);
    picture(&mut app, 1.0 / 60.0);
    assert!(matches!(app.world().resource::<Hand>().held, Some(Held::Thread(_))));
    // Drawn 2 cm up over half a second, a little slack: each picture's place is reached in the physics of the same
    // picture.
    for k in 1..=30 {
        let turn = 0.2 * f64::from(k) / 30.0;
        let at = DVec3::new(turn.cos(), 0.0, turn.sin()) * (0.1 - 0.0005 * (f64::from(k) / 5.0).min(1.0));
        look_at(&mut app, at, true);
        picture(&mut app, 1.0 / 60.0);
        // The first of these may still close what taking hold over 20 ms left. A hand that yields by 5 N hardly feels
        // the weight of a thread.
        if k > 3 {
            let off = (end_of(&app, thread) - at).length();
            assert!(off < 0.01 * 0.02 / 30.0, "{off} m off the target in picture {k}");
        }
    }
    // Pulled against the pin: 2 mm more than its length along the line from there. It hardly stretches, so the force is
    // the limit's.
    let limit = app.world().resource::<Hand>().force_limit;
    let straight = DVec3::new(0.2f64.cos(), 0.0, 0.2f64.sin());
    for k in 1..=60 {
        look_at(&mut app, straight * (0.102 + 0.002 * f64::from(k) / 60.0), true);
        picture(&mut app, 1.0 / 60.0);
    }
    let (force, along) = (app.world().resource::<Hand>().force, straight);
    assert!(force.length() > 0.5 * limit && force.dot(along) > 0.99 * force.length(), "{force}");
    let handle = app.world().get::<Thread>(thread).unwrap().handle().unwrap();
    let tension = app.world().resource::<Sutura>().world().rod(handle).unwrap().tension(20);
    assert!((tension / force.length() - 1.0).abs() < 0.05, "the hand says {force} N, the thread {tension} N");
    // Let go: no force, no grip, and the thread gives way.
    look_at(&mut app, straight * 0.104, false);
    picture(&mut app, 1.0 / 60.0);
    assert_eq!(app.world().resource::<Hand>().held, None);
    assert_eq!(app.world().resource::<Hand>().force, DVec3::ZERO);
    assert_eq!(app.world_mut().query::<&Grip>().iter(app.world()).count(), 1);
    for _ in 0..30 {
        picture(&mut app, 1.0 / 60.0);
    }
    let tension = app.world().resource::<Sutura>().world().rod(handle).unwrap().tension(20);
    assert!(tension.abs() < 0.01 * limit, "{tension}");
}

/// What a hand that leads a taut thread feels at most \[N\], and incidents.
fn lead(app: &mut App, grip: Entity, frames: u32, way: impl Fn(&Grip) -> (DVec3, f64)) -> (f64, usize) {
    let (mut most, mut incidents) = (0.0f64, 0);
    for _ in 0..frames {
        let mut g = app.world_mut().get_mut::<Grip>(grip).unwrap();
        let ((step, turn), pose) = (way(&g), g.pose());
        let about = DQuat::from_axis_angle(pose.orientation * DVec3::Z, turn);
        g.target = (step != DVec3::ZERO || turn != 0.0)
            .then(|| Pose::new(pose.position + step, (about * pose.orientation).normalize()));
        picture(app, 1.0 / 60.0);
        most = most.max(app.world().get::<Grip>(grip).unwrap().force());
        incidents += app.world().resource::<Sutura>().incidents.len();
    }
    (most, incidents)
}

#[test]
fn a_thread_that_does_not_stretch_is_pulled_no_harder_than_the_limit() {
    let mut app = app();
    let spec = RodSpec::straight(
        DVec3::ZERO,
        DVec3::X * 0.1,
        40,
        0.2e-3,
        Material { bend_damping: 0.01, ..Material::elastic(1e9, 1150.0) },
    );
    let thread = app.world_mut().spawn(Thread::new(RodSpec { stretch: Stretch::Inextensible, ..spec })).id();
    app.world_mut().spawn(Grip::new(thread, Place::Start, Hold::Pin));
    let limit = 2.0;
    let grip = app.world_mut().spawn(Grip::new(thread, Place::End, Hold::Clamp).limited(0.5, limit)).id();
    picture(&mut app, 0.05);
    // Slack, taut, beyond; at rest; turned while it is pulled; let go.
    let (_, incidents) = lead(&mut app, grip, 30, |_| (DVec3::X * -0.02 / 60.0, 0.0));
    assert_eq!(incidents, 0);
    let (most, incidents) = lead(&mut app, grip, 90, |_| (DVec3::X * 0.02 / 60.0, 0.0));
    assert!(incidents == 0 && most > 0.98 * limit && most < 1.01 * limit, "{most} N, {incidents}");
    let (most, incidents) = lead(&mut app, grip, 30, |_| (DVec3::ZERO, 0.0));
    assert!(incidents == 0 && most < 1.01 * limit, "{most} N, {incidents}");
    let (most, incidents) = lead(&mut app, grip, 60, |_| (DVec3::X * 0.02 / 60.0, 0.05));
    assert!(incidents == 0 && most < 1.01 * limit, "{most} N, {incidents}");
    let turned = app.world().get::<Grip>(grip).unwrap();
    assert!((turned.pose().position.length() - 0.1).abs() < 1e-6);
    // Along the sphere of its length, where a force along the way alone would not do.
    let (most, incidents) = lead(&mut app, grip, 120, |_| (DVec3::Z * 0.02 / 60.0, 0.0));
    let at = app.world().get::<Grip>(grip).unwrap().pose().position;
    println!("across: {most} N, {incidents} incidents, at {at}");
    assert!(incidents == 0 && most < 1.01 * limit, "{most} N, {incidents}");
    assert!(at.z > 0.035 && at.length() < 0.1 + 1e-6, "{at}");
}

#[test]
fn a_post_drawn_against_a_taut_thread_stops_at_the_limit() {
    let mut app = app();
    // A thread between two pins, a little slack, and a post across it above.
    let thread = thread(&mut app);
    let end = app.world_mut().spawn(Grip::new(thread, Place::End, Hold::Pin)).id();
    picture(&mut app, 0.05);
    lead(&mut app, end, 30, |_| (DVec3::X * -0.002 / 60.0, 0.0));
    let across = DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
    let post = Geometry::Cylinder { radius: 0.003, half_length: 0.01 };
    let post =
        app.world_mut().spawn(Body::new(ShapeSpec::fixed(post, Pose::new(DVec3::new(0.05, 0.0, 0.006), across)))).id();
    // The pins are a vise, the hand is not.
    app.world_mut().query::<&mut Grip>().iter_mut(app.world_mut()).for_each(|mut grip| grip.limits.yields = false);
    picture(&mut app, 1.0 / 60.0);
    let limit = 2.0;
    app.world_mut().resource_mut::<Hand>().force_limit = limit;
    let at = |app: &App| {
        let handle = app.world().get::<Body>(post).unwrap().handle().unwrap();
        app.world().resource::<Sutura>().world().shape(handle).unwrap().pose.position
    };
    let start = at(&app);
    look_at(&mut app, start, true);
    picture(&mut app, 1.0 / 60.0);
    assert_eq!(app.world().resource::<Hand>().held, Some(Held::Body(post)));
    // 3 cm down, where the thread lets it no farther than a few millimeters.
    let (mut most, mut incidents) = (0.0f64, 0);
    for k in 1..=240 {
        look_at(&mut app, start - DVec3::Z * 0.03 * (f64::from(k) / 180.0).min(1.0), true);
        picture(&mut app, 1.0 / 60.0);
        most = most.max(app.world().resource::<Hand>().force.length());
        incidents += app.world().resource::<Sutura>().incidents.len();
    }
    let (force, depth) = (app.world().resource::<Hand>().force, start.z - at(&app).z);
    println!("{force} N, most {most} N, {depth} m down, {incidents} incidents");
    assert_eq!(incidents, 0);
    // It stops where the thread pushes back with the limit: within 1 %, and at no time beyond by more than 2 %.
    assert!((force.length() / limit - 1.0).abs() < 0.01 && force.z < 0.0, "{force}");
    assert!(most < 1.02 * limit, "{most}");
    assert!(depth > 0.008 && depth < 0.02, "{depth}");
    // Let go of, it stays.
    let rests = at(&app);
    look_at(&mut app, start, false);
    picture(&mut app, 0.1);
    assert_eq!(at(&app), rests);
}

#[test]
fn a_mouse_event_moves_the_grip_in_the_physics_of_the_same_picture() {
    use bevy::input::{ButtonState, InputPlugin, mouse::MouseButtonInput};
    use bevy::window::{PrimaryWindow, WindowResolution};
    let mut app = app();
    app.add_plugins(InputPlugin);
    let thread = thread(&mut app);
    let (width, height) = (600, 400);
    let window = app
        .world_mut()
        .spawn((Window { resolution: WindowResolution::new(width, height), ..default() }, PrimaryWindow))
        .id();
    // A camera that looks along -y of the engine, as Bevy would set it up for this window.
    let space = *app.world().resource::<Space>();
    let place = Transform::from_translation(space.place(DVec3::new(0.1, -0.3, 0.0)))
        .looking_at(space.place(DVec3::X * 0.1), Vec3::Y);
    let mut camera = Camera::default();
    let lens = PerspectiveProjection { aspect_ratio: width as f32 / height as f32, ..default() };
    camera.computed.clip_from_view = bevy::camera::CameraProjection::get_clip_from_view(&lens);
    camera.computed.target_info =
        Some(bevy::camera::RenderTargetInfo { physical_size: UVec2::new(width, height), scale_factor: 1.0 });
    app.world_mut().spawn((camera, GlobalTransform::from(place), PointerCamera));
    picture(&mut app, 1.0 / 60.0);
    picture(&mut app, 1.0 / 60.0);
    let middle = Vec2::new(300.0, 200.0);
    let events = |app: &mut App, at: Vec2, state: Option<ButtonState>| {
        app.world_mut().get_mut::<Window>(window).unwrap().set_cursor_position(Some(at));
        if let Some(state) = state {
            app.world_mut().write_message(MouseButtonInput { button: MouseButton::Left, state, window });
        }
        picture(app, 1.0 / 60.0);
    };
    events(&mut app, middle, Some(ButtonState::Pressed));
    let Some(Held::Thread(grip)) = app.world().resource::<Hand>().held else { panic!("nothing is held") };
    // Taking hold takes 20 ms.
    events(&mut app, middle, None);
    events(&mut app, middle, None);
    for k in 1..20u16 {
        let before = end_of(&app, thread);
        let at = middle + Vec2::new(-0.3 * f32::from(k), -f32::from(k));
        events(&mut app, at, None);
        // Where the line of sight of this very event crosses the plane of what is held.
        let pointer = app.world().resource::<Pointer>();
        let target = app.world().get::<Grip>(grip).unwrap().target.unwrap().position;
        let ray = pointer.ray.unwrap();
        let (from, to) = (space.place_back(ray.origin), space.direction_back(*ray.direction));
        let t = (target.y - from.y) / to.y;
        assert!((from + to * t - target).length() < 1e-3 * 0.3, "{} {target}", from + to * t);
        let now = end_of(&app, thread);
        assert!((now - target).length() < 0.02 * (before - target).length(), "picture {k}: {now} is not {target}");
    }
    events(&mut app, middle, Some(ButtonState::Released));
    assert_eq!(app.world().resource::<Hand>().held, None);
}

#[test]
fn the_hand_takes_a_body_and_leaves_what_is_out_of_reach() {
    let mut app = app();
    let ball = ShapeSpec::fixed(Geometry::Sphere { radius: 0.01 }, Pose::at(DVec3::new(0.0, 0.0, 0.05)));
    let ball = app.world_mut().spawn(Body::new(ball)).id();
    picture(&mut app, 1.0 / 60.0);
    look_at(&mut app, DVec3::new(0.05, 0.0, 0.05), true);
    picture(&mut app, 1.0 / 60.0);
    assert_eq!(app.world().resource::<Hand>().held, None);
    // Drawn over it with the button down it is not taken either.
    look_at(&mut app, DVec3::new(0.0, 0.0, 0.05), true);
    picture(&mut app, 1.0 / 60.0);
    assert_eq!(app.world().resource::<Hand>().held, None);
    look_at(&mut app, DVec3::new(0.0, 0.0, 0.05), false);
    picture(&mut app, 1.0 / 60.0);
    look_at(&mut app, DVec3::new(0.0, 0.0, 0.05), true);
    picture(&mut app, 1.0 / 60.0);
    assert_eq!(app.world().resource::<Hand>().held, Some(Held::Body(ball)));
    for k in 1..=60 {
        look_at(&mut app, DVec3::new(0.0005 * f64::from(k), 0.0, 0.05), true);
        picture(&mut app, 1.0 / 60.0);
    }
    let handle = app.world().get::<Body>(ball).unwrap().handle().unwrap();
    let at = app.world().resource::<Sutura>().world().shape(handle).unwrap().pose.position;
    assert!((at - DVec3::new(0.03, 0.0, 0.05)).length() < 1e-6, "{at}");
}

#[test]
fn physics_keeps_real_time_at_any_rate_of_pictures() {
    // Pictures of 3 ms to 0.4 s, in any order, add up to two seconds.
    let pictures: Vec<f64> =
        [0.003, 0.4, 0.016, 0.05, 0.1, 0.007, 0.2, 0.011, 0.033, 0.18].into_iter().cycle().take(20).collect();
    let total: f64 = pictures.iter().sum();
    assert!((total - 2.0).abs() < 1e-12);
    let mut app = app();
    thread(&mut app);
    // The first picture of an app has no length.
    picture(&mut app, 0.0);
    let mut real = 0.0;
    for seconds in pictures {
        picture(&mut app, seconds);
        real += seconds;
        let (time, frame) =
            (app.world().resource::<Sutura>().world().time(), app.world().resource::<PhysicsClock>().frame);
        assert!(real - time > -1e-9 && real - time < frame + 1e-9, "{real} {time}");
    }
    assert_eq!(app.world().resource::<PhysicsClock>().lost, 0.0);
    assert_eq!(app.world().resource::<PhysicsClock>().frames, 120);
}

/// The end of a thread is led by a script that counts frames of physics, as a recorded input does. 3 s in pictures of
/// these lengths, over and over; the state and how much time physics is behind at most.
fn led(pictures: &[f64]) -> (u64, f64, u64) {
    let mut app = app();
    let thread = thread(&mut app);
    // What is put in is recorded input: a pose for each frame of physics, by its number.
    app.add_systems(
        PhysicsFrame,
        (move |clock: Res<PhysicsClock>,
               mut sutura: ResMut<Sutura>,
               threads: Query<&Thread>,
               mut grip: Local<Option<Handle<sutura::Grip>>>| {
            let rod = threads.get(thread).unwrap().handle().unwrap();
            let grip = *grip
                .get_or_insert_with(|| sutura.edit().insert_grip(&GripSpec::new(rod, Place::End, Hold::Pin)).unwrap());
            let turn = 0.05 * clock.frames as f64;
            sutura
                .edit()
                .set_grip_pose(grip, Pose::at(DVec3::new(0.09 + 0.01 * turn.cos(), 0.0, 0.02 * turn.sin())))
                .unwrap();
        })
        .in_set(PhysicsSet::Drive),
    );
    // The first picture of an app has no length.
    picture(&mut app, 0.0);
    let (mut real, mut behind) = (0.0, 0.0f64);
    for seconds in pictures.iter().cycle() {
        if real + seconds > 3.0 + 1e-9 {
            break;
        }
        picture(&mut app, *seconds);
        real += seconds;
        let ahead = app.world().resource::<Sutura>().world().time() - real;
        assert!(ahead < 1e-4, "physics is {ahead} s ahead");
        behind = behind.max(-ahead);
    }
    let clock = app.world().resource::<PhysicsClock>();
    assert_eq!(clock.lost, 0.0);
    (app.world().resource::<Sutura>().world().state_hash(), behind, clock.frames)
}

#[test]
fn at_any_rate_of_pictures_the_same_physics_keeps_real_time() {
    let sixtieth = 1.0 / 60.0;
    let same = led(&[sixtieth]);
    assert_eq!(same.2, 180);
    for rate in [60.0, 10.0, 30.0, 144.0] {
        let (hash, behind, frames) = led(&[1.0 / rate]);
        assert_eq!((hash, frames), (same.0, 180), "{rate} pictures a second");
        assert!(behind < sixtieth, "{rate} pictures a second: {behind} s behind");
    }
    // One picture of half a second among quick ones: after it physics is where real time is.
    let mut slow = vec![sixtieth; 90];
    slow[30] = 0.5;
    slow.truncate(1 + 60);
    let (hash, behind, frames) = led(&[slow.clone(), vec![sixtieth; 90]].concat());
    assert_eq!((hash, frames), (same.0, 180));
    assert!(behind < sixtieth, "{behind} s behind");
}

#[test]
fn what_a_player_did_is_done_again_to_the_same_bit() {
    let mut app = app();
    let thread = thread(&mut app);
    // Pictures of very different lengths, a hand that wanders, a body that comes and goes.
    let mut ball = None;
    for k in 0..60u32 {
        let turn = f64::from(k) * 0.2;
        look_at(&mut app, DVec3::new(0.1 + 0.01 * turn.cos(), 0.0, 0.02 * turn.sin()), (5..50).contains(&k));
        if k == 20 {
            ball = Some(
                app.world_mut()
                    .spawn(Body::new(ShapeSpec::fixed(
                        Geometry::Sphere { radius: 0.005 },
                        Pose::at(DVec3::new(0.05, 0.0, -0.007)),
                    )))
                    .id(),
            );
        }
        if let Some(ball) = ball.take_if(|_| k == 40) {
            app.world_mut().despawn(ball);
        }
        picture(&mut app, [0.004, 0.05, 0.017, 0.1][k as usize % 4]);
    }
    app.world_mut().despawn(thread);
    picture(&mut app, 0.1);
    let sutura = app.world().resource::<Sutura>();
    assert_eq!(sutura.world().view().rods().count(), 0);
    let bytes = sutura.recording().unwrap().to_bytes();
    let mut steps = 0;
    let again = Recording::from_bytes(&bytes).unwrap().replay(&mut |step| {
        assert!(step.is_same(), "step {}", step.step);
        steps += 1;
        ControlFlow::Continue(())
    });
    assert_eq!(again.unwrap().state_hash(), sutura.world().state_hash());
    assert!(steps > 100, "{steps}");
}

#[test]
fn physics_that_cannot_keep_up_is_bounded_and_says_so() {
    let mut app = app();
    thread(&mut app);
    picture(&mut app, 0.0);
    // No time at all for physics: one frame a picture.
    app.world_mut().resource_mut::<PhysicsClock>().budget = Duration::ZERO;
    for _ in 0..100 {
        picture(&mut app, 0.1);
    }
    let clock = app.world().resource::<PhysicsClock>();
    assert_eq!(clock.frames, 100);
    assert!(clock.is_late() && clock.owed <= clock.most_owed);
    assert!((clock.lost + clock.owed + 100.0 * clock.frame - 10.0).abs() < 1e-6, "{clock:?}");
    assert!((clock.rate - 10.0 / 60.0).abs() < 0.01, "{clock:?}");
    // As much as the rest of a picture takes: one that is slow to draw leaves time for more than one frame.
    app.world_mut().resource_mut::<PhysicsClock>().share = Duration::from_secs(10);
    std::thread::sleep(Duration::from_millis(200));
    picture(&mut app, 0.1);
    assert!(app.world().resource::<PhysicsClock>().now > 1);
}

#[test]
fn what_the_world_refuses_says_why() {
    let mut app = app();
    let bad = RodSpec::straight(DVec3::ZERO, DVec3::X * 0.1, 10, -1.0, Material::elastic(1e9, 1150.0));
    let bad = app.world_mut().spawn(Thread::new(bad)).id();
    picture(&mut app, 0.1);
    let thread = app.world().get::<Thread>(bad).unwrap();
    assert!(thread.handle().is_none());
    assert!(thread.error().unwrap().to_string().contains("radius"));
}
