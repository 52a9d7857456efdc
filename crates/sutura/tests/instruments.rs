//! Instruments: jaws that hold by friction (`docs/theory.md` 22).

use sutura::glam::DVec3;
use sutura::{
    BodyMotion, BodySpec, ColliderSpec, Friction, Geometry, InstrumentSpec, NeedlePoint, NeedleShape, NeedleSpec, Pose,
    Settings, World,
};

const DT: f64 = 1.0 / 240.0;

fn world(mu: f64, gravity: DVec3) -> World {
    World::new(Settings { gravity, friction: Friction { stick: mu, slide: mu }, ..Settings::default() }).unwrap()
}

fn step(world: &mut World, n: u32) {
    for k in 0..n {
        let t = std::time::Instant::now();
        let report = world.step(DT);
        println!(
            "{k} {:.2} ms sub {} rej {} it {} res {:.1e} contacts {}",
            t.elapsed().as_secs_f64() * 1e3,
            report.substeps,
            report.rejected,
            report.newton_iterations,
            report.residual,
            report.contacts
        );
        assert!(report.incidents.is_empty(), "step {k}: {:?}", report.incidents);
    }
}

/// Jaws that close on a wire across them hold it against 2 mu F, F the force on it.
#[test]
fn jaws_hold_a_wire_up_to_the_limit_of_friction() {
    let mu = 0.3;
    let mut world = world(mu, DVec3::ZERO);
    let spec = InstrumentSpec { opening: 0.15, ..InstrumentSpec::needle_driver(Pose::IDENTITY) };
    let tool = world.insert_instrument(&spec).unwrap();
    // Along y between the jaws, in the middle of them: pulled along y.
    let wire = Geometry::Capsule { radius: 3e-4, half_length: 6e-3 };
    let turn = sutura::glam::DQuat::from_rotation_arc(DVec3::Z, DVec3::Y);
    let at = DVec3::Z * 0.5 * spec.jaw.x;
    let wire = world.insert_body(&BodySpec::solid(wire, 7900.0, Pose::new(at, turn))).unwrap();
    step(&mut world, 24);
    world.close_jaws(&tool, &spec, true).unwrap();
    step(&mut world, 60);
    let before = world.body(wire).unwrap().center();
    let normal: f64 = world.contacts().map(|c| c.force.dot(c.normal)).sum();
    println!("normal {normal} at {before}, angles {:?}", tool.hinges.map(|h| world.joint(h).unwrap().coordinate()));
    assert!((normal / (2.0 * spec.closing_force) - 1.0).abs() < 0.05, "{normal}");
}
