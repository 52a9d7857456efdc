//! Instruments: jaws that hold by friction (`docs/theory.md` 22).

use sutura::glam::{DQuat, DVec3};
use sutura::{Body, BodySpec, Friction, Geometry, Handle, Instrument, InstrumentSpec, Pose, Settings, World};

const DT: f64 = 1.0 / 240.0;
const MU: f64 = 0.3;

fn step(world: &mut World, n: u32) {
    for k in 0..n {
        let report = world.step(DT);
        assert!(report.incidents.is_empty(), "step {k}: {:?}", report.incidents);
    }
}

/// A needle driver whose jaws have closed on a wire along y, in the middle of them.
fn closed_on_a_wire(density: f64) -> (World, Instrument, InstrumentSpec, Handle<Body>) {
    let friction = Friction { stick: MU, slide: MU };
    let mut world = World::new(Settings { gravity: DVec3::ZERO, friction, ..Settings::default() }).unwrap();
    let spec = InstrumentSpec { opening: 0.2, ..InstrumentSpec::needle_driver(Pose::IDENTITY) };
    let tool = world.insert_instrument(&spec).unwrap();
    let wire = Geometry::Capsule { radius: 3e-4, half_length: 6e-3 };
    // It lies on the fixed jaw.
    let at = Pose::new(DVec3::new(3e-4, 0.0, 0.5 * spec.jaw.x), DQuat::from_rotation_arc(DVec3::Z, DVec3::Y));
    let wire = world.insert_body(&BodySpec::solid(wire, density, at)).unwrap();
    step(&mut world, 24);
    world.close_jaws(&tool, &spec, true).unwrap();
    step(&mut world, 60);
    (world, tool, spec, wire)
}

/// Sum of the normal forces on the wire.
fn pressed(world: &World) -> f64 {
    world.contacts().map(|c| c.force.dot(c.normal)).sum()
}

#[test]
fn jaws_press_with_their_force_and_open_again() {
    let (mut world, tool, spec, wire) = closed_on_a_wire(7900.0);
    // The torque of 10 N at the middle of a jaw, where the wire is.
    assert!((pressed(&world) / 20.0 - 1.0).abs() < 5e-3, "{}", pressed(&world));
    // The faces of both jaws are tangents of the wire: tan(a / 2) = r / way of the place where it touches.
    let way = world.body(wire).unwrap().center().z;
    let angle = 2.0 * (3e-4 / way).atan();
    let found = world.joint(tool.hinge).unwrap().coordinate();
    assert!((found - angle).abs() < 2e-3, "{found} {angle}");
    // It goes along, and stays where it is in the jaws.
    let from = world.body(wire).unwrap().pose().position;
    for k in 1..=48 {
        let shift = DVec3::new(1e-4, 2e-4, -1e-4) * f64::from(k);
        world.set_body_pose(tool.handle, Pose::at(shift)).unwrap();
        step(&mut world, 1);
    }
    let slipped = world.body(wire).unwrap().pose().position - from - DVec3::new(1e-4, 2e-4, -1e-4) * 48.0;
    assert!(slipped.length() < 2e-5, "{slipped}");
    world.close_jaws(&tool, &spec, false).unwrap();
    step(&mut world, 60);
    assert_eq!(world.contacts().count(), 0);
    world.remove_instrument(&tool).unwrap();
    assert_eq!(world.view().bodies().count(), 1);
}

#[test]
fn jaws_hold_up_to_twice_mu_times_their_force() {
    for (part, holds) in [(0.97, true), (1.03, false)] {
        let (mut world, _, _, wire) = closed_on_a_wire(7.9e6);
        let mass = world.body(wire).unwrap().mass().mass;
        let most = MU * pressed(&world);
        assert!((most / (2.0 * MU * 10.0) - 1.0).abs() < 5e-3, "{most}");
        // Along the hinge, which bears the jaws.
        for k in 1..=48 {
            let pull = part * most / mass * f64::from(k) / 48.0;
            world.set_settings(Settings { gravity: DVec3::Y * pull, ..world.settings().clone() }).unwrap();
            step(&mut world, 1);
        }
        // The last of the ramp comes to rest.
        step(&mut world, if holds { 24 } else { 0 });
        let from = world.body(wire).unwrap().center().y;
        step(&mut world, 24);
        let slid = world.body(wire).unwrap().center().y - from;
        // What is left over draws it out of the jaws.
        if holds {
            assert!(slid < 1e-6, "{slid}");
        } else {
            assert!(slid > 1e-4, "{slid}");
        }
    }
}
