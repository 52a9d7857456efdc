//! Sections that are not round, rolled, pre-twisted or changing along the thread, against closed forms.

mod support;

use core::f64::consts::{FRAC_PI_4, PI, TAU};
use support::{quiet, settle};
use sutura::glam::{DQuat, DVec3};
use sutura::math::frame_from_tangent;
use sutura::{
    Along, GripSpec, Handle, Hold, LoadKind, LoadSpec, Material, Place, Plasticity, Pose, Profile, Rod, RodSpec,
    Section, Settings, World,
};

const LENGTH: f64 = 0.05;
const WIDTH: f64 = 1e-3;
const THICKNESS: f64 = 0.4e-3;
const STRIP: Section = Section::Rectangle([WIDTH, THICKNESS]);
const E: f64 = 2e9;
const NU: f64 = 0.4;

/// A straight thread along x with d1 along y and d2 along z.
fn spec(n: usize) -> RodSpec {
    let frames = Some(vec![frame_from_tangent(DVec3::X, DVec3::Y); n]);
    RodSpec { frames, ..RodSpec::straight(DVec3::ZERO, DVec3::X * LENGTH, n, 0.2e-3, Material::elastic(E, 1150.0)) }
}

fn insert(world: &mut World, n: usize, change: &dyn Fn(&mut RodSpec)) -> Handle<Rod> {
    let mut spec = spec(n);
    change(&mut spec);
    world.insert_rod(&spec).unwrap()
}

fn tip(world: &World, rod: Handle<Rod>) -> DVec3 {
    *world.rod(rod).unwrap().positions().last().unwrap()
}

/// Where the tip of a cantilever goes under a tip load.
fn deflection(n: usize, change: &dyn Fn(&mut RodSpec), force: DVec3) -> DVec3 {
    let mut world = World::new(quiet()).unwrap();
    let rod = insert(&mut world, n, change);
    world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Clamp)).unwrap();
    world
        .insert_load(&LoadSpec { rod, kind: LoadKind::Point { place: Place::End, force, torque: DVec3::ZERO } })
        .unwrap();
    settle(&mut world, 0.1, 1e-11, 60.0);
    tip(&world, rod) - DVec3::X * LENGTH
}

/// Measured over wanted value with `n`, `2 n` and `4 n` elements: second order, and right in the limit.
fn second_order(what: &str, n: usize, limit: f64, measure: &dyn Fn(usize) -> f64, want: f64) {
    let errors = [n, 2 * n, 4 * n].map(|n| measure(n) / want - 1.0);
    let limits = (4.0 * errors[2] - errors[1]) / 3.0;
    println!("{what}: errors {errors:?}, extrapolated {limits:e}");
    assert!(limits.abs() < limit, "{what}: {errors:?} {limits:e}");
    for pair in errors.windows(2) {
        assert!((3.7..4.3).contains(&(pair[0] / pair[1])), "{what}: not second order: {errors:?}");
    }
}

/// Bending stiffness about d1 and d2, and shear compliance times length, of the strip.
fn strip() -> (f64, f64, f64) {
    let k = 10.0 * (1.0 + NU) / (12.0 + 11.0 * NU);
    let shear = LENGTH / (k * E / (2.0 * (1.0 + NU)) * WIDTH * THICKNESS);
    (E * WIDTH * THICKNESS.powi(3) / 12.0, E * THICKNESS * WIDTH.powi(3) / 12.0, shear)
}

/// Tip load that deflects a cantilever of bending stiffness `ei` by a thousandth of its length: the closed forms are
/// those of small deflections, and err by 1e-6.
fn small_load(ei: f64) -> f64 {
    1e-3 * LENGTH * 3.0 * ei / LENGTH.powi(3)
}

#[test]
fn a_strip_is_limp_one_way_and_stiff_the_other() {
    let (ei1, ei2, shear) = strip();
    let set = |s: &mut RodSpec| s.section = STRIP;
    for (what, along, ei) in [("about d1", DVec3::Z, ei1), ("about d2", DVec3::Y, ei2)] {
        let p = small_load(ei);
        let want = p * (LENGTH.powi(3) / (3.0 * ei) + shear);
        second_order(what, 10, 5e-6, &|n| deflection(n, &set, along * p).dot(along), want);
    }
}

#[test]
fn a_rolled_strip_deflects_obliquely() {
    let (ei1, ei2, shear) = strip();
    let p = small_load(ei1);
    for roll in [FRAC_PI_4, 0.3] {
        let (s, c) = roll.sin_cos();
        let k = LENGTH.powi(3) / 3.0;
        let want =
            DVec3::new(0.0, p * k * s * c * (1.0 / ei2 - 1.0 / ei1), p * (k * (s * s / ei2 + c * c / ei1) + shear));
        let set = |spec: &mut RodSpec| (spec.section, spec.roll) = (STRIP, roll);
        second_order("along the load", 10, 5e-6, &|n| deflection(n, &set, DVec3::Z * p).z, want.z);
        second_order("across", 10, 5e-6, &|n| deflection(n, &set, DVec3::Z * p).y, want.y);
    }
}

#[test]
fn a_pretwisted_strip_rests_without_moment_and_bends_by_its_mean_compliance() {
    let (ei1, ei2, shear) = strip();
    let p = small_load(ei1);
    let (mean, half_difference) = (0.5 * (1.0 / ei1 + 1.0 / ei2), 0.5 * (1.0 / ei1 - 1.0 / ei2));
    for pretwist in [5.0, -3.0 * TAU] {
        let set = |spec: &mut RodSpec| (spec.section, spec.pretwist) = (STRIP, pretwist);
        // The compliance at s is mean + half difference * (cos, -sin)(k s) along and across, k = 2 pretwist / L; its
        // integral with (L - s)^2.
        let k = 2.0 * pretwist / LENGTH;
        let along = 2.0 * LENGTH / (k * k) - 2.0 * (k * LENGTH).sin() / k.powi(3);
        let across = LENGTH * LENGTH / k - 2.0 * (1.0 - (k * LENGTH).cos()) / k.powi(3);
        let want = p * (mean * LENGTH.powi(3) / 3.0 + half_difference * along + shear);
        let want_across = -p * half_difference * across;
        if pretwist.abs() < TAU {
            second_order("along the load", 40, 1e-5, &|n| deflection(n, &set, DVec3::Z * p).z, want);
            second_order("across", 40, 1e-5, &|n| deflection(n, &set, DVec3::Z * p).y, want_across);
        } else {
            // An element turns by 0.12 rad; three turns are near the mean.
            let tip = deflection(160, &set, DVec3::Z * p);
            assert!((tip.z / want - 1.0).abs() < 1e-4, "{tip} {want}");
            second_order("across, three turns", 80, 1e-4, &|n| deflection(n, &set, DVec3::Z * p).y, want_across);
            assert!((tip.z / (p * mean * LENGTH.powi(3) / 3.0) - 1.0).abs() < 0.01, "{tip}");
        }
        // Nothing moves by itself.
        let mut world = World::new(quiet()).unwrap();
        let rod = insert(&mut world, 40, &set);
        for _ in 0..10 {
            world.step(0.1);
        }
        let view = world.rod(rod).unwrap();
        assert!(view.energy().total() < 1e-25, "{:?}", view.energy());
        assert!((view.twist() * TAU / pretwist - 39.0 / 40.0).abs() < 1e-12, "{}", view.twist());
    }
}

#[test]
fn a_cone_and_a_rod_of_growing_modulus_bend_as_their_integrals_say() {
    let r = 0.2e-3f64;
    let ei = E * PI * r.powi(4) / 4.0;
    let shear = LENGTH / (6.0 * (1.0 + NU) / (7.0 + 6.0 * NU) * E / (2.0 * (1.0 + NU)) * PI * r * r);
    let p = small_load(ei);
    // Integral of (1 - x)^2 / (1 - x / 2)^4 is 2/3, of (1 - x / 2)^-2 is 2.
    let cone = |s: &mut RodSpec| s.along.size = Profile(vec![(0.0, 1.0), (LENGTH, 0.5)]);
    second_order(
        "cone",
        20,
        1e-5,
        &|n| deflection(n, &cone, DVec3::Z * p).z,
        p * (LENGTH.powi(3) / ei * (2.0 / 3.0) + 2.0 * shear),
    );
    // Integral of (1 - x)^2 / (1 + x) is 4 ln 2 - 5/2, of 1 / (1 + x) is ln 2.
    let ln2 = core::f64::consts::LN_2;
    let stiffer = |s: &mut RodSpec| s.along.modulus = Profile(vec![(0.0, 1.0), (LENGTH, 2.0)]);
    second_order(
        "modulus",
        20,
        1e-5,
        &|n| deflection(n, &stiffer, DVec3::Z * p).z,
        p * (LENGTH.powi(3) / ei * (4.0 * ln2 - 2.5) + ln2 * shear),
    );
}

/// Torque that turns one end against the other by `angle`.
fn torque(n: usize, change: &dyn Fn(&mut RodSpec), angle: f64) -> f64 {
    let mut world = World::new(quiet()).unwrap();
    let rod = insert(&mut world, n, change);
    world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Clamp)).unwrap();
    let end = world.insert_grip(&GripSpec::at_once(rod, Place::End, Hold::Clamp)).unwrap();
    let pose = world.grip_pose(end).unwrap();
    world.set_grip_pose(end, Pose::new(pose.position, DQuat::from_rotation_x(angle) * pose.orientation)).unwrap();
    settle(&mut world, 0.1, 1e-9, 60.0);
    world.grip_wrench(end).unwrap().torque.x
}

#[test]
fn torsion_of_an_ellipse_a_rectangle_and_a_cone() {
    let g = E / (2.0 * (1.0 + NU));
    let (a, b) = (0.5 * WIDTH, 0.5 * THICKNESS);
    let ellipse = PI * (a * b).powi(3) / (a * a + b * b);
    let rectangle = 0.249 * WIDTH * THICKNESS.powi(3); // Timoshenko and Goodier, sides 2.5 to 1, three digits
    for (section, j, limit) in [(Section::Ellipse([a, b]), ellipse, 1e-7), (STRIP, rectangle, 2e-3)] {
        let got = torque(20, &|s| s.section = section, 0.5);
        assert!((got / (g * j * 0.5 / LENGTH) - 1.0).abs() < limit, "{section:?}: {got}");
    }
    // Integral of (1 - x / 2)^-4 is 14/3.
    let cone = |s: &mut RodSpec| s.along.size = Profile(vec![(0.0, 1.0), (LENGTH, 0.5)]);
    let gj = g * PI * 0.2e-3f64.powi(4) / 2.0;
    second_order("cone", 20, 1e-5, &|n| torque(n, &cone, 0.5), gj * 0.5 / LENGTH * 3.0 / 14.0);
}

#[test]
fn a_deep_strip_buckles_sideways() {
    // Cantilever under a tip load at the centroid: P = 4.013 sqrt(EI GJ) / L^2 with the EI of the limp way (Timoshenko
    // and Gere, section 6.3), for a strip whose other EI is much larger: here 100 times.
    let (w, t) = (2e-3, 0.2e-3);
    let ei = E * w * t * t * t / 12.0;
    let gj = E / (2.0 * (1.0 + NU)) * 0.312 * w * t * t * t;
    let critical = 4.013 * (ei * gj).sqrt() / (LENGTH * LENGTH);
    let sideways = |load: f64| {
        let mut world = World::new(quiet()).unwrap();
        let rod = insert(&mut world, 40, &|s| s.section = Section::Rectangle([t, w]));
        world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Clamp)).unwrap();
        // A nudge, so that it need not wait for rounding errors.
        let at = |part: f64| LoadKind::Point {
            place: Place::End,
            force: DVec3::new(0.0, 1e-5, -1.0) * (load * critical * part),
            torque: DVec3::ZERO,
        };
        let load = world.insert_load(&LoadSpec { rod, kind: at(0.0) }).unwrap();
        for i in 1..=20 {
            world.set_load(load, at(f64::from(i) / 20.0)).unwrap();
            world.step(0.1);
        }
        for _ in 0..300 {
            world.step(0.1);
        }
        tip(&world, rod).y.abs() / LENGTH
    };
    let (below, above) = (sideways(0.97), sideways(1.03));
    println!("sideways {below} {above}");
    assert!(below < 0.01 && above > 0.1, "{below} {above}");
}

#[test]
fn density_along_the_thread_weighs() {
    // Factor 1 + 2 x: weight 2, moment about the start 7/6 of the uniform one's weight and length. Stiff, so that it
    // hardly sags, yet not so stiff that the force is lost in the rounding of positions.
    let g = 9.81;
    let change = |s: &mut RodSpec| {
        s.section = STRIP;
        s.material.young_modulus = 30.0 * E;
        s.along.density = Profile(vec![(0.0, 1.0), (LENGTH, 3.0)]);
    };
    let held = |n: usize| {
        let mut world = World::new(Settings { gravity: DVec3::NEG_Z * g, ..quiet() }).unwrap();
        let rod = insert(&mut world, n, &change);
        let grip = world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Clamp)).unwrap();
        settle(&mut world, 0.1, 1e-11, 60.0);
        world.grip_wrench(grip).unwrap()
    };
    let weight = 1150.0 * WIDTH * THICKNESS * LENGTH * g;
    let force = held(10).force.z;
    assert!((force / (2.0 * weight) - 1.0).abs() < 1e-7, "{force:e} {:e}", 2.0 * weight);
    second_order("moment", 10, 1e-6, &|n| held(n).torque.y, -weight * LENGTH * 7.0 / 6.0);
}

/// Lowest w^2 of a cantilever of unit length and stiffness with mass `1 + growth x`, by Rayleigh and Ritz in x^2 ..
/// x^7.
fn lowest(growth: f64) -> f64 {
    const N: usize = 6;
    let power = |i: usize| (i + 2) as f64;
    let stiffness =
        |i: usize, j: usize| power(i) * (power(i) - 1.0) * power(j) * (power(j) - 1.0) / (power(i) + power(j) - 3.0);
    let mass = |i: usize, j: usize| 1.0 / (power(i) + power(j) + 1.0) + growth / (power(i) + power(j) + 2.0);
    let times = |a: &dyn Fn(usize, usize) -> f64, v: &[f64; N]| -> [f64; N] {
        core::array::from_fn(|i| (0..N).map(|j| a(i, j) * v[j]).sum())
    };
    let dot = |a: &[f64; N], b: &[f64; N]| -> f64 { a.iter().zip(b).map(|(x, y)| x * y).sum() };
    let mut v = [1.0; N];
    let mut value = 0.0;
    for _ in 0..20 {
        // Inverse iteration; elimination without pivots, the stiffness is positive definite.
        let mut right = times(&mass, &v);
        let mut a: [[f64; N]; N] = core::array::from_fn(|i| core::array::from_fn(|j| stiffness(i, j)));
        for k in 0..N {
            for i in k + 1..N {
                let f = a[i][k] / a[k][k];
                for j in k..N {
                    a[i][j] -= f * a[k][j];
                }
                right[i] -= f * right[k];
            }
        }
        for k in (0..N).rev() {
            v[k] = (right[k] - (k + 1..N).map(|j| a[k][j] * v[j]).sum::<f64>()) / a[k][k];
        }
        let size = dot(&v, &v).sqrt();
        v = v.map(|x| x / size);
        value = dot(&v, &times(&stiffness, &v)) / dot(&v, &times(&mass, &v));
    }
    value
}

#[test]
fn the_frequency_of_a_cantilever_whose_density_grows() {
    assert!((lowest(0.0).sqrt() - 3.516_015).abs() < 1e-5, "{}", lowest(0.0).sqrt());
    // So thin that shear and rotational inertia, which Rayleigh and Ritz leave out, lower it by a few 1e-6 only.
    let thickness = 0.25 * THICKNESS;
    let ei = E * WIDTH * thickness.powi(3) / 12.0;
    let want = (lowest(2.0) * ei / (1150.0 * WIDTH * thickness)).sqrt() / (LENGTH * LENGTH);
    let h = TAU / want / 400.0;
    let frequency = |n: usize| {
        let mut world = World::new(Settings { substep: h, ..quiet() }).unwrap();
        let rod = insert(&mut world, n, &|s| {
            s.section = Section::Rectangle([WIDTH, thickness]);
            s.along.density = Profile(vec![(0.0, 1.0), (LENGTH, 3.0)]);
        });
        world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Clamp)).unwrap();
        let force = DVec3::Z * small_load(ei);
        let load = world
            .insert_load(&LoadSpec { rod, kind: LoadKind::Point { place: Place::End, force, torque: DVec3::ZERO } })
            .unwrap();
        for _ in 0..100 {
            world.step(50.0 * h);
        }
        world.remove_load(load).unwrap();
        // Times at which the tip passes the axis upward; the first period lets the higher modes die.
        let mut crossings = Vec::new();
        while crossings.len() < 6 {
            let before = tip(&world, rod).z;
            world.step(h);
            let after = tip(&world, rod).z;
            if before < 0.0 && after >= 0.0 {
                crossings.push(world.time() - h * after / (after - before));
            }
        }
        // Implicit Euler turns a mode by atan(w h) a step.
        let measured = 4.0 * TAU / (crossings[5] - crossings[1]);
        (measured * h).tan() / h
    };
    second_order("frequency", 10, 2e-5, &frequency, want);
}

#[test]
fn contact_takes_the_largest_radius_and_plastic_set_wants_a_section_without_preference() {
    let mut world = World::new(quiet()).unwrap();
    let rod = insert(&mut world, 10, &|s| {
        s.along = Along { size: Profile(vec![(0.0, 0.5), (0.01, 1.5), (LENGTH, 1.0)]), ..Along::default() }
    });
    assert_eq!(world.rod(rod).unwrap().radius(), 0.2e-3 * 1.5);
    let mut flat = spec(10);
    flat.section = STRIP;
    flat.material.plasticity = Some(Plasticity { yield_curvature: 100.0, yield_twist: 100.0, hardening: 0.0 });
    let error = world.insert_rod(&flat).unwrap_err().to_string();
    assert!(error.contains("material.plasticity"), "{error}");
    flat.section = Section::Rectangle([WIDTH; 2]);
    world.insert_rod(&flat).unwrap();
}
