//! The plugin without a window: what a player does through its input, and what becomes of time.

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use std::ops::ControlFlow;
use std::time::Duration;
use sutura_bevy::sutura::glam::DVec3;
use sutura_bevy::sutura::input::Recording;
use sutura_bevy::sutura::{Geometry, Hold, Material, Place, Pose, RodSpec, Settings, ShapeSpec};
use sutura_bevy::{Body, Grip, Hand, Held, PhysicsClock, Pointer, Space, Sutura, SuturaPlugin, Thread};

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
    let spec = RodSpec::straight(DVec3::ZERO, DVec3::X * 0.1, 40, 0.2e-3, Material { bend_damping: 0.01, ..Material::elastic(1e9, 1150.0) });
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
    // Drawn 2 cm up over half a second, a little slack: each picture's place is reached in the physics of the same picture.
    for k in 1..=30 {
        let turn = 0.2 * f64::from(k) / 30.0;
        let at = DVec3::new(turn.cos(), 0.0, turn.sin()) * (0.1 - 0.0005 * (f64::from(k) / 5.0).min(1.0));
        look_at(&mut app, at, true);
        picture(&mut app, 1.0 / 60.0);
        // The first of these may still close what taking hold over 20 ms left. A hand that yields by 5 N hardly feels the weight of a thread.
        if k > 3 {
            let off = (end_of(&app, thread) - at).length();
            assert!(off < 0.01 * 0.02 / 30.0, "{off} m off the target in picture {k}");
        }
    }
    // Pulled against the pin: 2 mm more than its length along the line from there. It hardly stretches, so the force is the limit's.
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
    let pictures: Vec<f64> = [0.003, 0.4, 0.016, 0.05, 0.1, 0.007, 0.2, 0.011, 0.033, 0.18].into_iter().cycle().take(20).collect();
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
        let (time, frame) = (app.world().resource::<Sutura>().world().time(), app.world().resource::<PhysicsClock>().frame);
        assert!(real - time > -1e-9 && real - time < frame + 1e-9, "{real} {time}");
    }
    assert_eq!(app.world().resource::<PhysicsClock>().lost, 0.0);
    assert_eq!(app.world().resource::<PhysicsClock>().frames, 120);
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
            ball = Some(app.world_mut().spawn(Body::new(ShapeSpec::fixed(Geometry::Sphere { radius: 0.005 }, Pose::at(DVec3::new(0.05, 0.0, -0.007))))).id());
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
