//! Flat or capsized: curves whose turning is known, a simulated square knot before and after it was spilled (the scene
//! spilled_square), and what must not change an answer.

mod support;

use proptest::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use support::resample;
use sutura::glam::{DQuat, DVec3};
use sutura::knot::{Ends, Form, KnotType, Verdict, form, form_of_strands, form_of_two, recognize};
use sutura::{GripSpec, Hold, LoadKind, LoadSpec, Material, Place, RodSpec, Settings, World};

/// Radius of the recorded thread \[mm\].
const RADIUS: f64 = 0.1125;

/// A recorded thread \[mm\]: the end that is pulled when the knot is spilled is the first point.
fn read(name: &str) -> Vec<DVec3> {
    let path = format!("{}/tests/polylines/{name}.csv", env!("CARGO_MANIFEST_DIR"));
    let point = |line: &str| DVec3::from_slice(&line.split(',').map(|x| x.parse().unwrap()).collect::<Vec<f64>>());
    std::fs::read_to_string(&path).unwrap().lines().map(point).collect()
}

fn of(points: &[DVec3], radius: f64) -> Option<Form> {
    let lengths: Vec<f64> = points.windows(2).map(|w| w[0].distance(w[1])).collect();
    form(points, &lengths, radius)
}

/// A circular arc of this angle in a plane.
fn arc(radius: f64, angle: f64) -> Vec<DVec3> {
    (0..=400)
        .map(|i| f64::from(i) / 400.0 * angle)
        .map(|a| DVec3::new(radius * a.cos(), radius * a.sin(), 0.0))
        .collect()
}

/// A straight strand along x, and one wound about it in contact: `turns` one way, then after a bend back, as in a
/// lark's head, or not, as in two half hitches, as many again. Thread of radius 1.
fn hitches(pitch: f64, turns: f64, larks_head: bool) -> [Vec<DVec3>; 2] {
    let helix = |sign: f64, shift: f64| {
        let n = 200;
        (0..=n).map(move |i| {
            let u = turns * f64::from(i) / f64::from(n);
            let (s, c) = (TAU * u).sin_cos();
            DVec3::new(shift + pitch * u, 2.0 * c, sign * 2.0 * s)
        })
    };
    let gap = 2.5;
    let second: Vec<DVec3> = helix(if larks_head { -1.0 } else { 1.0 }, pitch * turns + gap).collect();
    let straight = (0..=100).map(|i| DVec3::X * (f64::from(i) / 100.0 * (2.0 * pitch * turns + gap))).collect();
    [straight, helix(1.0, 0.0).chain(second).collect()]
}

#[test]
fn the_share_is_that_of_the_angles_turned_through() {
    for (a, b) in [(PI, PI), (PI, FRAC_PI_2), (0.4, TAU), (TAU, 0.9 * TAU)] {
        for radius in [3.0, 10.0] {
            let f = form_of_strands([&arc(radius, a), &arc(2.0 * radius, b)], 1.0).unwrap();
            // The polygon leaves out half a piece at each end, and a piece has one radius, rounded to a whole number of
            // pieces: 1.5 at most.
            assert!(
                (f.turning[0] - a).abs() < 1.5 / radius && (f.turning[1] - b).abs() < 0.75 / radius,
                "{a} {b} {radius}: {f:?}"
            );
            assert!((f.share - 2.0 * f.turning[0].min(f.turning[1]) / (f.turning[0] + f.turning[1])).abs() < 1e-15);
            assert!((f.share - 2.0 * a.min(b) / (a + b)).abs() < 0.25, "{a} {b} {radius}: {f:?}");
        }
    }
}

#[test]
fn half_hitches_and_larks_heads_on_a_straight_strand_have_capsized() {
    for larks_head in [false, true] {
        for pitch in [2.0, 3.0, 6.0] {
            for turns in [1.0, 1.5, 2.0] {
                let [straight, wound] = hitches(pitch, turns, larks_head);
                let f = form_of_strands([&straight, &wound], 1.0).unwrap();
                assert_eq!(
                    (f.verdict, f.share),
                    (Verdict::Capsized { straight: 0 }, 0.0),
                    "{larks_head} {pitch} {turns}: {f:?}"
                );
                let exchanged = form_of_strands([&wound, &straight], 1.0).unwrap();
                assert_eq!((exchanged.verdict, exchanged.share), (Verdict::Capsized { straight: 1 }, 0.0));
                // A bow of 30 degrees, as under a load, is still straight enough.
                let bow = arc(straight[100].x / 0.5, 0.5);
                assert_eq!(form_of_strands([&bow, &wound], 1.0).unwrap().verdict, Verdict::Capsized { straight: 0 });
            }
        }
    }
}

/// The strands of two threads are what lies within reach of the other, whatever the tails do.
#[test]
fn of_two_threads_the_tails_do_not_count() {
    let [straight, wound] = hitches(3.0, 2.0, true);
    let within = form_of_strands([&straight, &wound], 1.0).unwrap();
    let mut long: Vec<DVec3> = vec![DVec3::new(-60.0, 40.0, 0.0), DVec3::new(-20.0, 0.0, 0.0)];
    long.extend(&straight);
    let mut tails: Vec<DVec3> = vec![DVec3::new(-10.0, 30.0, 0.0), DVec3::new(0.0, 30.0, 0.0)];
    tails.extend(&wound);
    tails.push(wound[wound.len() - 1] + DVec3::Y * 30.0);
    let f = form_of_two(&long, &tails, 1.0).unwrap();
    assert_eq!(f.verdict, Verdict::Capsized { straight: 0 });
    assert!(f.share < 0.02 && (f.turning[1] / within.turning[1] - 1.0).abs() < 0.15, "{f:?} {within:?}");
    let two_bights =
        form_of_two(&arc(3.0, PI), &arc(3.0, PI).iter().map(|p| *p + DVec3::Z * 2.0).collect::<Vec<_>>(), 1.0).unwrap();
    assert_eq!(two_bights.verdict, Verdict::Flat);
    assert!(two_bights.share > 0.99);
}

/// The one knot by topology, two by form: figures of the scene, to two digits.
#[test]
fn a_tied_square_knot_is_flat_and_a_spilled_one_has_capsized() {
    let (tied, spilled) = (read("tied_square"), read("spilled_square"));
    for points in [&tied, &spilled] {
        assert_eq!(recognize(points, Ends::Free, 1).knot, KnotType::Square);
    }
    let (flat, capsized) = (of(&tied, RADIUS).unwrap(), of(&spilled, RADIUS).unwrap());
    assert_eq!(flat.verdict, Verdict::Flat);
    assert!(flat.share > 0.95, "{flat:?}");
    assert_eq!(capsized.verdict, Verdict::Capsized { straight: 0 }, "the strand that was pulled is straight");
    assert!((0.05..0.2).contains(&capsized.share), "{capsized:?}");
    // It is wound about the other by two turns, one each way.
    assert!(capsized.turning[1] > 1.5 * TAU && capsized.turning[0] < 1.0, "{capsized:?}");
}

#[test]
fn a_thread_in_more_or_fewer_pieces_has_the_same_form() {
    for name in ["tied_square", "spilled_square"] {
        let points = read(name);
        let whole = of(&points, RADIUS).unwrap();
        for n in [400, 600, 900, 2000] {
            let f = of(&resample(&points, n), RADIUS).unwrap();
            assert_eq!(f.verdict, whole.verdict, "{name} {n}");
            assert!((f.share - whole.share).abs() < 0.05, "{name} {n}: {f:?} {whole:?}");
        }
    }
}

#[test]
fn a_thread_read_backward_changes_the_names_of_its_strands() {
    for name in ["tied_square", "spilled_square"] {
        let points = read(name);
        let (f, b) =
            (of(&points, RADIUS).unwrap(), of(&points.iter().rev().copied().collect::<Vec<_>>(), RADIUS).unwrap());
        assert!((f.share - b.share).abs() < 0.02, "{f:?} {b:?}");
        match (f.verdict, b.verdict) {
            (Verdict::Capsized { straight: 0 }, Verdict::Capsized { straight: 1 }) | (Verdict::Flat, Verdict::Flat) => {
            }
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn what_is_no_knot_has_no_form() {
    let line: Vec<DVec3> = (0..100).map(|i| DVec3::X * f64::from(i)).collect();
    assert_eq!(of(&line, 1.0), None, "it touches itself nowhere");
    assert_eq!(of(&[], 1.0), None);
    assert_eq!(form_of_strands([&line, &line], 1.0), None, "nothing turns");
    assert_eq!(form_of_strands([&[], &arc(1.0, TAU)], 1.0).map(|f| f.verdict), Some(Verdict::Capsized { straight: 0 }));
    assert_eq!(form_of_strands([&[DVec3::NAN], &arc(3.0, TAU)], 1.0), None);
    assert_eq!(form_of_strands([&arc(3.0, TAU), &arc(3.0, TAU)], 0.0), None);
    assert_eq!(form_of_two(&line, &line.iter().map(|p| *p + DVec3::Y * 50.0).collect::<Vec<_>>(), 1.0), None);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    /// Turning, moving, mirroring and scaling leave it as it is.
    #[test]
    fn a_motion_of_the_whole_changes_nothing(axis in prop::array::uniform3(-1.0..1.0), angle in 0.0..TAU, shift in -1e3..1e3, scale in 1e-3..1e3, mirror: bool) {
        let q = DQuat::from_axis_angle(DVec3::from(axis).try_normalize().unwrap_or(DVec3::X), angle);
        for name in ["tied_square", "spilled_square"] {
            let points = read(name);
            let before = of(&points, RADIUS).unwrap();
            let moved = |p: &DVec3| q * (if mirror { *p * DVec3::new(-1.0, 1.0, 1.0) } else { *p }) * scale + DVec3::Z * (shift * scale);
            let f = of(&points.iter().map(moved).collect::<Vec<_>>(), RADIUS * scale).unwrap();
            prop_assert_eq!(f.verdict, before.verdict);
            prop_assert!((f.share - before.share).abs() < 1e-6, "{:?} {:?}", f, before);
        }
    }
}

/// A thread that hangs with a weight: the mean tension of a part is that at its middle.
#[test]
fn the_mean_tension_of_a_hanging_thread_is_that_at_the_middle_of_the_part() {
    let (material, radius, length, mass) = (Material::elastic(2e9, 1150.0), 0.15e-3, 0.1, 1e-3);
    let mut world = World::new(Settings { linear_damping: 0.99, ..Settings::default() }).unwrap();
    let rod = world.insert_rod(&RodSpec::straight(DVec3::ZERO, DVec3::Z * -length, 20, radius, material)).unwrap();
    world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Pin)).unwrap();
    let force = DVec3::Z * -mass * 9.81;
    world
        .insert_load(&LoadSpec { rod, kind: LoadKind::Point { place: Place::End, force, torque: DVec3::ZERO } })
        .unwrap();
    support::settle(&mut world, 1.0 / 60.0, 1e-7, 20.0);
    let view = world.rod(rod).unwrap();
    let weight = 1150.0 * PI * radius * radius * 9.81;
    // Whole elements: within one the tension is constant, and half its weight is carried at either end.
    for (from, to) in [(0.0, length), (0.02, 0.05), (0.09, 0.1)] {
        let wanted = mass * 9.81 + weight * (length - 0.5 * (from + to));
        let mean = view.mean_tension(from, to).unwrap();
        assert!((mean / wanted - 1.0).abs() < 1e-6, "{from} {to}: {mean} {wanted}");
    }
    assert_eq!(view.mean_tension(0.012, 0.013), Some(view.tension(2)), "a part of one element");
    assert_eq!(view.mean_tension(0.05, 0.05), None);
    assert_eq!(view.mean_tension(0.2, 0.3), None);
}
