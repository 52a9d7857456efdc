//! Time steps that are none, tiny or huge, and numbers that are finite and absurd.

use crate::support::t1;
use crate::{DT, INF, NAN, assert_finite, assert_usable, point, step, straight, thread};
use sutura::glam::DVec3;
use sutura::{
    Along, Drive, Error, Geometry, GripSpec, Hold, IncidentKind, LoadKind, LoadSpec, Material, Place, Pose, Profile,
    RestShape, RodSpec, Section, Settings, ShapeMotion, ShapeSpec, Shear, Stretch, World,
};

#[test]
fn time_steps_that_are_none() {
    let (mut world, _) = thread(Settings::default());
    step(&mut world, DT);
    let before = world.state_hash();
    for dt in [0.0, -0.0, -DT, NAN, INF, -INF] {
        let report = world.step(dt);
        assert!(
            matches!(report.incidents[..], [ref i] if matches!(i.kind, IncidentKind::BadInput { .. })),
            "{dt}: {report:?}"
        );
        assert_eq!((report.substeps, report.newton_iterations, world.state_hash()), (0, 0, before), "{dt}");
    }
    assert_usable(&mut world, 2, "after them");
}

#[test]
fn time_steps_that_are_tiny() {
    for dt in [1e-9, 1e-15, 1e-100, f64::MIN_POSITIVE, 5e-324] {
        let (mut world, rod) = thread(Settings::default());
        world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Clamp)).unwrap();
        step(&mut world, DT);
        step(&mut world, dt);
        assert_usable(&mut world, 3, &format!("dt {dt:e}"));
    }
}

/// A step that is not done for good, and says so, is stopped by the observer of this test after this many substeps.
const MANY: u32 = 20_000;

#[test]
fn time_steps_that_are_huge() {
    for (dt, substep) in [(1e9, 1.0 / 240.0), (1e300, 1.0 / 240.0), (DT, 1e-300)] {
        let (mut world, _) = thread(Settings { substep, gravity: DVec3::ZERO, ..Settings::default() });
        let mut substeps = 0;
        let report = world.step_with(dt, &mut |_| {
            substeps += 1;
            assert!(substeps < MANY, "dt {dt:e}, substep {substep:e}: {MANY} substeps and no end");
        });
        assert!(!report.incidents.is_empty(), "{report:?}");
        assert_finite(&world);
    }
}

#[test]
fn a_long_substep() {
    // A substep as long as the step, a thread held at one end that falls for ten seconds at once.
    for substep in [1.0, 10.0, 1e6] {
        let (mut world, rod) = thread(Settings { substep, ..Settings::default() });
        world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Pin)).unwrap();
        for _ in 0..3 {
            step(&mut world, substep.min(1e4));
        }
        world.set_settings(Settings::default()).unwrap();
        assert_usable(&mut world, 5, &format!("substep {substep:e}"));
    }
}

/// Steps a world that was built with absurd numbers; an error at building is as good.
fn absurd(what: &str, build: impl FnOnce(&mut World) -> Result<(), Error>) {
    let mut world = World::new(Settings { halvings: 3, ..Settings::default() }).unwrap();
    if build(&mut world).is_err() {
        return;
    }
    for _ in 0..3 {
        let report = step(&mut world, DT);
        assert!(report.converged || !report.incidents.is_empty(), "{what}: {report:?}");
    }
}

#[test]
fn absurd_threads() {
    let (material, radius) = t1();
    for x in [1e-300, 1e-150, 1e-30, 1e30, 1e150, 1e300] {
        let spec =
            |points: Vec<DVec3>, radius: f64, material: &Material| RodSpec::new(points, radius, material.clone());
        let points = |l: f64| (0..=4).map(|i| DVec3::X * (l * f64::from(i) / 4.0)).collect::<Vec<_>>();
        let insert = |s: RodSpec| move |w: &mut World| w.insert_rod(&s).map(|_| ());
        absurd(&format!("radius {x:e}"), insert(spec(points(0.01), x, &material)));
        absurd(&format!("length {x:e}"), insert(spec(points(x), radius, &material)));
        absurd(&format!("all lengths {x:e}"), insert(spec(points(x), 0.01 * x, &material)));
        absurd(
            &format!("density {x:e}"),
            insert(spec(points(0.01), radius, &Material { density: x, ..material.clone() })),
        );
        absurd(
            &format!("modulus {x:e}"),
            insert(spec(points(0.01), radius, &Material { young_modulus: x, ..material.clone() })),
        );
        absurd(
            &format!("shear modulus {x:e}"),
            insert(spec(points(0.01), radius, &Material { shear: Shear::Modulus(x), ..material.clone() })),
        );
        absurd(
            &format!("damping {x:e}"),
            insert(spec(points(0.01), radius, &Material { bend_damping: x, ..material.clone() })),
        );
        let thin = Section::Rectangle([x, 1e-4]);
        absurd(&format!("a side of {x:e}"), insert(RodSpec { section: thin, ..spec(points(0.01), radius, &material) }));
        let along = Along { modulus: Profile(vec![(0.0, 1.0), (0.01, x)]), ..Along::default() };
        absurd(&format!("modulus to {x:e}"), insert(RodSpec { along, ..spec(points(0.01), radius, &material) }));
        let far: Vec<DVec3> = points(0.01).iter().map(|p| *p + DVec3::Y * x).collect();
        absurd(&format!("{x:e} away"), insert(spec(far, radius, &material)));
        let crossing = points(x).iter().map(|p| DVec3::new(0.5 * x, p.x - 0.5 * x, 0.0)).collect::<Vec<_>>();
        let two = [spec(points(x), 0.01 * x, &material), spec(crossing, 0.01 * x, &material)];
        absurd(&format!("two that cross, all lengths {x:e}"), move |w| {
            two.iter().try_for_each(|s| w.insert_rod(s).map(|_| ()))
        });
        let lengths = RestShape::Given { lengths: Some(vec![x; 4]), darboux: None };
        absurd(
            &format!("rest length {x:e}"),
            insert(RodSpec { rest: lengths, ..spec(points(0.01), radius, &material) }),
        );
    }
}

/// Threads that give numbers that are not finite at once: refused, with the field.
#[test]
fn threads_that_are_no_threads() {
    let (material, radius) = t1();
    let refused = |spec: RodSpec, field: &str| {
        let e = World::default().insert_rod(&spec).unwrap_err();
        assert!(matches!(&e, Error::Invalid { field: f, .. } if f.starts_with(field)), "{field}: {e}");
    };
    let one = |from: DVec3, to: DVec3| RodSpec::straight(from, to, 1, radius, material.clone());
    // One element has no joint at which its twist would show.
    refused(RodSpec { pretwist: 1e300, ..one(DVec3::ZERO, DVec3::X * 0.01) }, "pretwist");
    refused(RodSpec { roll: 1e300, ..straight() }, "roll");
    // The middle of two points is not finite.
    refused(one(DVec3::X * 1.7e308, DVec3::X * 1.6e308), "centerline");
    // The second moment of area is less than the least number, and no distance is a finite number of diameters.
    refused(RodSpec { radius: 1e-100, ..straight() }, "section");
    refused(RodSpec { material: Material { density: 1e-300, ..material.clone() }, ..straight() }, "section");
}

/// Forces and positions that are finite, of which a reading is not: an incident, and the state is put back.
#[test]
fn readings_that_would_not_be_finite() {
    let (mut world, rod) = thread(Settings { halvings: 2, ..Settings::default() });
    let before = world.rod(rod).unwrap().positions().to_vec();
    world.set_settings(Settings { gravity: DVec3::NEG_Z * 1e300, ..world.settings().clone() }).unwrap();
    let report = step(&mut world, DT);
    assert!(report.incidents.iter().any(|i| i.kind == IncidentKind::NotFinite), "{report:?}");
    assert_eq!(world.rod(rod).unwrap().positions(), before);
}

#[test]
fn absurd_loads_and_grips() {
    for x in [1e-300, 1e-30, 1e6, 1e30, 1e150, 1e300] {
        let on = |kind: LoadKind| {
            move |w: &mut World| {
                let rod = w.insert_rod(&straight())?;
                w.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Clamp))?;
                w.insert_load(&LoadSpec { rod, kind }).map(|_| ())
            }
        };
        let place = Place::End;
        absurd(&format!("force {x:e}"), on(point(place, DVec3::Z * x)));
        absurd(&format!("torque {x:e}"), on(LoadKind::Point { place, force: DVec3::ZERO, torque: DVec3::Y * x }));
        absurd(&format!("force per length {x:e}"), on(LoadKind::Uniform { force_per_length: DVec3::Z * x }));
        absurd(&format!("mass {x:e}"), on(LoadKind::Mass { place, mass: x, inertia: DVec3::ZERO }));
        absurd(&format!("inertia {x:e}"), on(LoadKind::Mass { place, mass: 0.0, inertia: DVec3::splat(x) }));
        absurd(&format!("gravity {x:e}"), move |w| {
            w.set_settings(Settings { gravity: DVec3::NEG_Z * x, ..w.settings().clone() })?;
            w.insert_rod(&straight()).map(|_| ())
        });
        for hold in [Hold::Pin, Hold::Clamp, Hold::Jaw] {
            absurd(&format!("{hold:?} taken to {x:e}"), move |w| {
                let rod = w.insert_rod(&straight())?;
                let grip = w.insert_grip(&GripSpec::new(rod, Place::Start, hold))?;
                w.set_grip_pose(grip, Pose::at(DVec3::Y * x))
            });
            absurd(&format!("{hold:?} pulled with {x:e}"), move |w| {
                let rod = w.insert_rod(&straight())?;
                let drive = Drive::Force { direction: DVec3::Y, force: x, speed_limit: x };
                w.insert_grip(&GripSpec { drive, ..GripSpec::new(rod, Place::Start, hold) }).map(|_| ())
            });
        }
        absurd(&format!("a shape of {x:e}"), move |w| {
            w.insert_rod(&straight())?;
            w.insert_shape(&ShapeSpec::fixed(
                Geometry::Box { half_sides: DVec3::splat(x) },
                Pose::at(DVec3::NEG_Z * x),
            ))?;
            w.insert_shape(&ShapeSpec::fixed(Geometry::Cylinder { radius: x, half_length: x }, Pose::at(DVec3::Z * x)))
                .map(|_| ())
        });
        absurd(&format!("a shape pushed with {x:e}"), move |w| {
            w.insert_rod(&straight())?;
            let motion = ShapeMotion::Pushed { direction: DVec3::X, force: x, speed_limit: x };
            let ball = ShapeSpec::fixed(Geometry::Sphere { radius: 1e-3 }, Pose::at(DVec3::new(-2e-3, 0.0, 0.0)));
            w.insert_shape(&ShapeSpec { motion, ..ball }).map(|_| ())
        });
    }
}

#[test]
fn a_load_that_was_absurd() {
    let (mut world, rod) = thread(Settings { halvings: 2, ..Settings::default() });
    let load = world.insert_load(&LoadSpec { rod, kind: point(Place::End, DVec3::Z * 1e300) }).unwrap();
    let report = step(&mut world, DT);
    assert!(!report.incidents.is_empty(), "{report:?}");
    world.remove_load(load).unwrap();
    assert_usable(&mut world, 5, "load removed");
}

#[test]
fn a_healthy_thread_does_not_hide_an_absurd_one() {
    for x in [1e30, 1e60, 1e80, 1e100, 1e120, 1e140, 1e200, 1e300] {
        for stretch in [Stretch::Elastic, Stretch::Inextensible] {
            let mut world = World::new(Settings { halvings: 3, ..Settings::default() }).unwrap();
            let rod = world.insert_rod(&RodSpec { stretch, ..straight() }).unwrap();
            let healthy = straight();
            let healthy = RodSpec { centerline: healthy.centerline.iter().map(|p| *p + DVec3::Y).collect(), ..healthy };
            world.insert_rod(&healthy).unwrap();
            world.insert_load(&LoadSpec { rod, kind: point(Place::End, DVec3::Z * x) }).unwrap();
            for _ in 0..4 {
                let report = step(&mut world, DT);
                assert!(!report.incidents.is_empty(), "force {x:e}: {report:?}");
            }
            world.remove_rod(rod).unwrap();
            assert_usable(&mut world, 3, &format!("force {x:e}, thread removed"));
        }
    }
}
