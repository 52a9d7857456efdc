//! Snapshots that are cut short, damaged, or of another world.

use crate::support::t1;
use crate::{DT, NAN, assert_finite, assert_usable, point, straight, thread};
use proptest::prelude::*;
use sutura::glam::DVec3;
use sutura::{
    Along, Drive, Error, Geometry, GripSpec, Handle, Hold, LoadKind, LoadSpec, Material, Place, Plasticity, Pose,
    Profile, ReelLaw, ReelSpec, RestShape, Rod, RodSpec, Section, Settings, ShapeMotion, ShapeSpec, WeldSpec, World,
};

/// A world with all that a snapshot holds: two threads that touch, on a plane, grips of all kinds, loads, a driven and
/// a removed shape.
fn full_world() -> World {
    let (material, radius) = t1();
    let mut world = World::new(Settings { halvings: 3, ..Settings::default() }).unwrap();
    let gone =
        world.insert_shape(&ShapeSpec::fixed(Geometry::Sphere { radius: 1e-3 }, Pose::at(DVec3::Z * 0.1))).unwrap();
    world.insert_shape(&ShapeSpec::fixed(Geometry::Plane, Pose::IDENTITY)).unwrap();
    let ball = ShapeSpec::fixed(Geometry::Sphere { radius: 2e-3 }, Pose::at(DVec3::new(0.0, 0.01, 4e-3)));
    world.insert_shape(&ShapeSpec { motion: ShapeMotion::Driven, ..ball }).unwrap();
    world.remove_shape(gone).unwrap();
    let low = DVec3::Z * (1.04 * radius);
    let plastic = Material {
        plasticity: Some(Plasticity { yield_curvature: 20.0, yield_twist: 20.0, hardening: 0.1 }),
        ..material.clone()
    };
    let a =
        world.insert_rod(&RodSpec::straight(low - DVec3::X * 0.01, low + DVec3::X * 0.01, 8, radius, plastic)).unwrap();
    let high = DVec3::Z * (3.1 * radius);
    let b = world
        .insert_rod(&RodSpec::straight(high - DVec3::Y * 0.01, high + DVec3::Y * 0.01, 7, radius, material))
        .unwrap();
    world.insert_grip(&GripSpec::new(a, Place::Start, Hold::Clamp)).unwrap();
    world.insert_grip(&GripSpec::new(b, Place::Start, Hold::Pin)).unwrap();
    let drive = Drive::Force { direction: DVec3::Y, force: 0.01, speed_limit: 0.01 };
    world.insert_grip(&GripSpec { drive, ..GripSpec::new(b, Place::End, Hold::Jaw) }).unwrap();
    world
        .insert_load(&LoadSpec {
            rod: b,
            kind: LoadKind::Mass { place: Place::Arc(0.004), mass: 1e-5, inertia: DVec3::ZERO },
        })
        .unwrap();
    world.insert_load(&LoadSpec { rod: a, kind: point(Place::End, DVec3::Z * 1e-5) }).unwrap();
    for _ in 0..6 {
        world.step(DT);
    }
    assert!(world.contacts().count() > 3, "{} touch", world.contacts().count());
    world
}

/// What must hold after any bytes were given to `restore`.
fn restore_damaged(world: &mut World, bytes: &[u8]) -> Result<(), Error> {
    let before = world.state_hash();
    let result = world.restore(bytes);
    match &result {
        Err(e) => {
            assert!(matches!(e, Error::Snapshot { .. }), "another error: {e}");
            assert_eq!(world.state_hash(), before, "an error changes nothing");
        }
        Ok(()) => {
            assert_finite(world);
            for _ in 0..2 {
                let report = world.step(DT);
                assert!(report.substeps + report.rejected <= 4 * 15, "{report:?}");
                assert_finite(world);
            }
            // Inserting and removing still work.
            let rod = world.insert_rod(&straight()).unwrap();
            let grip = world.insert_grip(&GripSpec::new(rod, Place::Start, Hold::Pin)).unwrap();
            world.remove_grip(grip).unwrap();
            world.remove_rod(rod).unwrap();
        }
    }
    result
}

#[test]
fn a_snapshot_cut_short_or_too_long() {
    let mut world = full_world();
    let bytes = world.snapshot();
    for n in 0..bytes.len() {
        assert!(restore_damaged(&mut world, &bytes[..n]).is_err(), "{n} of {} bytes were taken", bytes.len());
    }
    let mut longer = bytes.clone();
    longer.push(0);
    assert!(restore_damaged(&mut world, &longer).is_err());
    assert!(world.restore(&bytes).is_ok());
    assert_usable(&mut world, 2, "whole");
}

#[test]
fn a_snapshot_of_another_world() {
    let bytes = full_world().snapshot();
    let (mut other, rod) = thread(Settings::default());
    assert!(restore_damaged(&mut other, &bytes).is_err());
    // One with fewer shapes, and one from before a thread was removed.
    let taken = other.snapshot();
    other.remove_rod(rod).unwrap();
    assert!(restore_damaged(&mut other, &taken).is_err());
    assert_usable(&mut other, 1, "other");
}

/// A thread, a ring, a shape and a weld, one of which is otherwise.
#[derive(Clone)]
struct Parts {
    length: f64,
    elements: usize,
    radius: f64,
    rest: RestShape,
    section: Section,
    along: Along,
    closed: bool,
    geometry: Geometry,
    weld: Place,
    reel: bool,
}

impl Parts {
    fn world(&self) -> World {
        self.build().0
    }
    fn build(&self) -> (World, Handle<Rod>) {
        let mut world = World::new(Settings::default()).unwrap();
        let thread = RodSpec::straight(DVec3::ZERO, DVec3::X * self.length, self.elements, self.radius, t1().0);
        let a = world
            .insert_rod(&RodSpec {
                rest: self.rest.clone(),
                section: self.section,
                along: self.along.clone(),
                ..thread
            })
            .unwrap();
        let ring = RodSpec::ring(DVec3::Y * 0.05, DVec3::Z, DVec3::X * 0.02, 24, 0.16e-3, t1().0);
        let points = ring
            .centerline
            .iter()
            .copied()
            .chain((!self.closed).then(|| ring.centerline[0] + DVec3::Z * 1e-3))
            .collect();
        let ring = world
            .insert_rod(&RodSpec { centerline: points, closure: self.closed.then(Default::default), ..ring })
            .unwrap();
        world.insert_shape(&ShapeSpec::fixed(self.geometry.clone(), Pose::at(DVec3::Z * -0.2))).unwrap();
        let from = world.rod(ring).unwrap().positions()[12];
        let other = world.insert_rod(&RodSpec::straight(from, from + DVec3::Z * 0.02, 10, 0.16e-3, t1().0)).unwrap();
        // The ring's own weld is at its start.
        world.insert_weld(&WeldSpec::new(vec![(ring, self.weld), (other, Place::Start)])).ok();
        if self.reel {
            world.insert_reel(&ReelSpec { rod: a, at_end: true, law: ReelLaw::Rate(0.05), supply: None }).unwrap();
        }
        (world, a)
    }
}

#[test]
fn a_snapshot_of_a_world_that_is_built_otherwise_is_refused_and_says_what_differs() {
    let parts = Parts {
        length: 0.05,
        elements: 20,
        radius: 0.16e-3,
        rest: RestShape::Straight,
        section: Section::Round,
        along: Along::default(),
        closed: true,
        geometry: Geometry::Sphere { radius: 0.01 },
        weld: Place::Particle(12),
        reel: false,
    };
    let mut world = parts.world();
    for _ in 0..3 {
        world.step(DT);
    }
    let snapshot = world.snapshot();
    let bent = RestShape::Given { lengths: None, darboux: Some(vec![DVec3::X; 19]) };
    let thinner = Along { size: Profile(vec![(0.0, 1.0), (0.05, 0.5)]), ..Along::default() };
    let sheet = |z: f64| Geometry::Mesh {
        vertices: vec![DVec3::ZERO, DVec3::X, DVec3::new(0.0, 1.0, z)],
        triangles: vec![[0, 1, 2]],
    };
    for (other, words) in [
        (Parts { length: 0.1, ..parts.clone() }, &["thread 0", "element 0", "0.0025", "0.005"][..]),
        (Parts { elements: 25, ..parts.clone() }, &["thread 0", "20 elements there, 25 here"]),
        (Parts { radius: 5e-3, ..parts.clone() }, &["thread 0", "radius", "0.00016", "0.005"]),
        (Parts { rest: bent, ..parts.clone() }, &["thread 0", "rest shape"]),
        (Parts { section: Section::Ellipse([1e-4, 2e-4]), ..parts.clone() }, &["thread 0", "cross-section"]),
        (Parts { along: thinner, ..parts.clone() }, &["thread 0", "along"]),
        (Parts { closed: false, ..parts.clone() }, &["thread 1", "closed there, open here"]),
        (
            Parts { geometry: Geometry::Box { half_sides: DVec3::splat(0.06) }, ..parts.clone() },
            &["shape 0", "geometry"],
        ),
        (Parts { geometry: Geometry::Sphere { radius: 0.011 }, ..parts.clone() }, &["shape 0", "geometry"]),
        (Parts { geometry: sheet(0.1), ..parts.clone() }, &["shape 0", "geometry"]),
        (Parts { weld: Place::Particle(11), ..parts.clone() }, &["welds"]),
    ] {
        let mut other = other.world();
        let error = restore_damaged(&mut other, &snapshot).unwrap_err().to_string();
        assert!(words.iter().all(|w| error.contains(w)), "{error}: {words:?}");
        let own = other.snapshot();
        assert!(other.restore(&own).is_ok() && other.snapshot() == own);
    }
    let (mut same, rod) = parts.build();
    same.restore(&snapshot).unwrap();
    assert_eq!(same.state_hash(), world.state_hash());
    same.set_material(rod, &Material::elastic(1e9, 900.0)).unwrap();
    same.restore(&snapshot).unwrap();
    // Length fed in since does not matter, but what is on the reel does.
    let reeled = Parts { reel: true, ..parts.clone() };
    let mut fed = reeled.world();
    for _ in 0..20 {
        fed.step(DT);
    }
    let snapshot = fed.snapshot();
    for mut before in [reeled.world(), parts.world()] {
        before.restore(&snapshot).unwrap();
        assert_eq!(before.state_hash(), fed.state_hash());
    }
    let error =
        restore_damaged(&mut Parts { length: 0.06, ..reeled.clone() }.world(), &snapshot).unwrap_err().to_string();
    assert!(error.contains("thread 0") && error.contains("at the end"), "{error}");
    let error =
        restore_damaged(&mut Parts { length: 0.06, ..parts.clone() }.world(), &snapshot).unwrap_err().to_string();
    assert!(error.contains("thread 0") && error.contains("at the end"), "{error}");
    assert!(restore_damaged(&mut Parts { radius: 0.2e-3, ..reeled }.world(), &snapshot).is_err());
}

#[test]
fn a_snapshot_with_nan_in_place_of_a_number() {
    let mut world = full_world();
    let bytes = world.snapshot();
    // Eight bytes that make a number as they occur here are one, mostly; the others lie across two, and may make one
    // that will do.
    let number = |at: usize| f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()).abs();
    let numbers: Vec<usize> = (8..bytes.len() - 8).filter(|at| (1e-9..1e3).contains(&number(*at))).collect();
    assert!(numbers.len() > 200, "{}", numbers.len());
    let mut taken = 0;
    for at in &numbers {
        let mut damaged = bytes.clone();
        damaged[*at..at + 8].copy_from_slice(&NAN.to_le_bytes());
        taken += usize::from(restore_damaged(&mut world, &damaged).is_ok());
        world.restore(&bytes).unwrap();
    }
    assert!(taken < numbers.len() / 5, "{taken} of {} were taken", numbers.len());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_snapshot_with_a_flipped_bit(at in any::<prop::sample::Index>(), bit in 0u32..8) {
        let mut world = full_world();
        let mut bytes = world.snapshot();
        let at = at.index(bytes.len());
        bytes[at] ^= 1 << bit;
        let _ = restore_damaged(&mut world, &bytes);
    }

    #[test]
    fn a_snapshot_with_a_number_exchanged(at in any::<prop::sample::Index>(), new in prop_oneof![
        Just(f64::NAN.to_bits()), Just(f64::INFINITY.to_bits()), Just(f64::MAX.to_bits()), Just((-1e200f64).to_bits()), Just(0u64), Just(u64::MAX), any::<u64>(),
    ]) {
        let mut world = full_world();
        let mut bytes = world.snapshot();
        let at = at.index(bytes.len() - 8);
        bytes[at..at + 8].copy_from_slice(&new.to_le_bytes());
        let _ = restore_damaged(&mut world, &bytes);
    }

    #[test]
    fn any_bytes_as_a_snapshot(tail in prop::collection::vec(any::<u8>(), 0..200)) {
        let mut world = full_world();
        let mut bytes = world.snapshot()[..8].to_vec();
        bytes.extend(tail);
        let _ = restore_damaged(&mut world, &bytes);
    }
}
