//! Knot recognition against knots of known type: reference polylines, closed braids, connected sums, open ends, and
//! what must not change an answer. Invariants are those of KnotInfo and of the tables that the polylines came with.

use proptest::prelude::*;
use std::f64::consts::TAU;
use sutura::audit::Audit;
use sutura::glam::{DQuat, DVec3};
use sutura::knot::{Ends, Hand, KnotType, Problem, Recognition, Throws, entries, gauss_linking, recognize, writhe};
use sutura::{Material, RodSpec, Settings, World};

fn read(name: &str) -> Vec<DVec3> {
    let path = format!("{}/tests/polylines/{name}.csv", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap();
    let point = |line: &str| {
        let v: Vec<f64> = line.split(',').map(|x| x.trim().parse().unwrap()).collect();
        DVec3::new(v[0], v[1], v[2])
    };
    text.lines().map(point).collect()
}

/// The reference polylines with knot, determinant, signature and Alexander polynomial.
fn references() -> Vec<(&'static str, KnotType, u64, i32, &'static [i64])> {
    vec![
        ("figure8", KnotType::FigureEight, 5, 0, &[1, -3, 1]),
        ("granny_+3+3", KnotType::Granny(Hand::Right), 9, -4, &[1, -2, 3, -2, 1]),
        ("square_+3-3", KnotType::Square, 9, 0, &[1, -2, 3, -2, 1]),
        ("surgeon_square_+5-3", KnotType::SurgeonSquare(Hand::Right), 15, -2, &[1, -2, 3, -3, 3, -2, 1]),
        ("throw_+1_unknot", KnotType::Unknot, 1, 0, &[1]),
        ("throw_+3", KnotType::Trefoil(Hand::Right), 3, -2, &[1, -1, 1]),
        ("throw_-3", KnotType::Trefoil(Hand::Left), 3, 2, &[1, -1, 1]),
        ("trefoil_L", KnotType::Trefoil(Hand::Left), 3, 2, &[1, -1, 1]),
        ("trefoil_R", KnotType::Trefoil(Hand::Right), 3, -2, &[1, -1, 1]),
    ]
}

/// Closed braid on `n` strands: letter `i` is a right-handed crossing of strands `i - 1` and `i`, `-i` a left-handed
/// one. It starts on the outermost strand. Letter 0 is none: short words get enough of them for the polygon to stay
/// round.
fn closed_braid(n: usize, word: &[i32]) -> Vec<DVec3> {
    let mut word = word.to_vec();
    word.resize(word.len().max(14), 0);
    let steps = word.len();
    let at = |radius: f64, turn: f64, height: f64| {
        let (s, c) = (TAU * turn / steps as f64).sin_cos();
        DVec3::new(radius * c, radius * s, height)
    };
    let mut points = Vec::new();
    let mut lane = n - 1;
    loop {
        for (k, letter) in word.iter().enumerate() {
            let (inner, right_handed) = ((letter.unsigned_abs() as usize).wrapping_sub(1), *letter > 0);
            let radius = 2.0 + lane as f64;
            points.push(at(radius, k as f64, 0.0));
            let outward = match lane {
                l if l == inner => Some(true),
                l if *letter != 0 && l == inner + 1 => Some(false),
                _ => None,
            };
            if let Some(outward) = outward {
                // The strand that goes outward lies over in a right-handed crossing.
                let height = if outward == right_handed { 0.4 } else { -0.4 };
                lane = if outward { lane + 1 } else { lane - 1 };
                points.push(at(0.5 * (radius + 2.0 + lane as f64), k as f64 + 0.5, height));
            } else {
                points.push(at(radius, k as f64 + 0.5, 0.0));
            }
        }
        if lane == n - 1 {
            return points;
        }
    }
}

/// Stacked throws of these numbers of crossings (positive is right-handed), as a closed curve: their connected sum.
fn throws(crossings: &[i32]) -> Vec<DVec3> {
    let word: Vec<i32> =
        crossings.iter().zip(1..).flat_map(|(c, i)| (0..c.abs()).map(move |_| i * c.signum())).collect();
    closed_braid(crossings.len() + 1, &word)
}

/// The same curve in pieces of about equal length.
fn resampled(points: &[DVec3], closed: bool, n: usize) -> Vec<DVec3> {
    let mut points = points.to_vec();
    if closed {
        points.push(points[0]);
    }
    let length: f64 = points.windows(2).map(|w| w[0].distance(w[1])).sum();
    let mut out = Vec::new();
    for w in points.windows(2) {
        let pieces = (w[0].distance(w[1]) / length * n as f64).ceil().max(1.0) as usize;
        out.extend((0..pieces).map(|k| w[0].lerp(w[1], k as f64 / pieces as f64)));
    }
    if !closed {
        out.push(points[points.len() - 1]);
    }
    out
}

/// A closed braid cut where it is outermost, with straight tails that lead outward.
fn opened(closed: &[DVec3], tail: f64) -> Vec<DVec3> {
    let radial = closed[0].normalize();
    let along = DVec3::Z.cross(radial);
    let mut points = resampled(closed, true, 400);
    points.insert(0, points[0] + along * 0.05);
    points.remove(1);
    points.insert(0, points[0] + (radial + along * 0.5) * tail);
    let last = closed[0] - along * 0.05;
    points.push(last);
    points.push(last + (radial - along * 0.5) * tail);
    resampled(&points, false, 600)
}

/// SplitMix64, for test data.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
    /// Coordinates in (-1, 1).
    fn vector(&mut self) -> DVec3 {
        DVec3::new(2.0 * self.unit() - 1.0, 2.0 * self.unit() - 1.0, 2.0 * self.unit() - 1.0)
    }
}

/// Bends all of space: a stack of smooth shears, each one-to-one, so the knot stays and its shape does not.
fn bent(points: &[DVec3], seed: u64) -> Vec<DVec3> {
    let mut random = Random(seed);
    let mut points = points.to_vec();
    for _ in 0..6 {
        let along = random.vector().normalize();
        let across = random.vector().cross(along).normalize();
        let (phase, waves) = (TAU * random.unit(), 0.5 + random.unit());
        for p in &mut points {
            *p += across * (1.2 * (waves * p.dot(along) + phase).sin());
        }
    }
    points
}

fn mirrored(points: &[DVec3]) -> Vec<DVec3> {
    points.iter().map(|p| DVec3::new(p.x, p.y, -p.z)).collect()
}

fn mirror(knot: KnotType) -> KnotType {
    let other = |h: Hand| if h == Hand::Right { Hand::Left } else { Hand::Right };
    match knot {
        KnotType::Trefoil(h) => KnotType::Trefoil(other(h)),
        KnotType::Cinquefoil(h) => KnotType::Cinquefoil(other(h)),
        KnotType::Granny(h) => KnotType::Granny(other(h)),
        KnotType::SurgeonSquare(h) => KnotType::SurgeonSquare(other(h)),
        KnotType::SurgeonGranny(h) => KnotType::SurgeonGranny(other(h)),
        KnotType::SquareAndThrow(h) => KnotType::SquareAndThrow(other(h)),
        KnotType::ThreeEqualThrows(h) => KnotType::ThreeEqualThrows(other(h)),
        KnotType::SurgeonSquareAndThrow(h) => KnotType::SurgeonSquareAndThrow(other(h)),
        KnotType::TripleThrow(h) => KnotType::TripleThrow(other(h)),
        KnotType::QuadrupleThrow(h) => KnotType::QuadrupleThrow(other(h)),
        KnotType::Throws(t) => KnotType::Throws(Throws { right: t.left, left: t.right }),
        same => same,
    }
}

/// Every stack of throws in the table, and more, with determinant and signature.
fn stacks() -> Vec<(&'static [i32], KnotType, u64, i32)> {
    use Hand::{Left, Right};
    let further = |right, left| KnotType::Throws(Throws { right, left });
    vec![
        (&[1], KnotType::Unknot, 1, 0),
        (&[1, -1, 1], KnotType::Unknot, 1, 0),
        (&[3], KnotType::Trefoil(Right), 3, -2),
        (&[5], KnotType::Cinquefoil(Right), 5, -4),
        (&[7], KnotType::TripleThrow(Right), 7, -6),
        (&[-9], KnotType::QuadrupleThrow(Left), 9, 8),
        (&[3, -3], KnotType::Square, 9, 0),
        (&[-3, -3], KnotType::Granny(Left), 9, 4),
        (&[5, -3], KnotType::SurgeonSquare(Right), 15, -2),
        (&[3, -5], KnotType::SurgeonSquare(Left), 15, 2),
        (&[5, 3], KnotType::SurgeonGranny(Right), 15, -6),
        (&[3, -3, 3], KnotType::SquareAndThrow(Right), 27, -2),
        (&[3, 3, 3], KnotType::ThreeEqualThrows(Right), 27, -6),
        (&[5, -3, 3], KnotType::SurgeonSquareAndThrow(Right), 45, -4),
        (&[3, -3, 3, -3], further([2, 0, 0, 0], [2, 0, 0, 0]), 81, 0),
        (&[5, -5], further([0, 1, 0, 0], [0, 1, 0, 0]), 25, 0),
        (&[7, -3, 1], further([0, 0, 1, 0], [1, 0, 0, 0]), 21, -4),
    ]
}

fn assert_certain(r: &Recognition, knot: KnotType, determinant: u64, signature: i32, what: &str) {
    assert_eq!((r.knot, r.determinant, r.signature), (knot, determinant, signature), "{what}: {r}");
    assert_eq!((r.problem, r.projections_agreed), (None, r.projections_total), "{what}: {r}");
}

#[test]
fn reference_polylines_have_their_knots_from_every_direction() {
    for (name, knot, determinant, signature, alexander) in references() {
        let points = read(name);
        for seed in 0..20 {
            let r = recognize(&points, Ends::Closed, seed);
            assert_certain(&r, knot, determinant, signature, name);
            assert_eq!(r.alexander, alexander, "{name}");
        }
        let flipped = recognize(&mirrored(&points), Ends::Closed, 1);
        assert_certain(&flipped, mirror(knot), determinant, -signature, name);
        let back: Vec<DVec3> = points.iter().rev().copied().collect();
        assert_certain(&recognize(&back, Ends::Closed, 1), knot, determinant, signature, name);
    }
}

#[test]
fn stacks_of_throws_are_named_closed_held_and_free() {
    for (crossings, knot, determinant, signature) in stacks() {
        let what = format!("{crossings:?}");
        let closed = throws(crossings);
        for seed in 0..5 {
            assert_certain(&recognize(&closed, Ends::Closed, seed), knot, determinant, signature, &what);
        }
        let open = opened(&closed, 5.0);
        let (first, last) = (open[0] - open[1], open[open.len() - 1] - open[open.len() - 2]);
        let held = recognize(&open, Ends::Held { start: first, end: last * 7.0 }, 3);
        assert_certain(&held, knot, determinant, signature, &what);
        assert_eq!((held.closures_agreed, held.closures_total), (1, 1));
        let free = recognize(&open, Ends::Free, 3);
        assert_eq!(
            (free.knot, free.determinant, free.signature, free.problem),
            (knot, determinant, signature, None),
            "{what}: {free}"
        );
        assert!(
            free.closures_total >= 20 && f64::from(free.closures_agreed) >= 0.9 * f64::from(free.closures_total),
            "{what}: {free}"
        );
    }
}

/// Prime knots that are no throws, and those that share invariants with knots that are: 8_20, 10_140 with the square
/// knot, 10_132 with the double throw, 6_1 with the square knot's determinant and signature, 7_4 with the surgeon's.
/// Braid words, determinants, |signatures| and polynomials of KnotInfo.
#[test]
fn knots_that_only_resemble_are_unknown_with_their_invariants() {
    type Row = (&'static str, usize, &'static [i32], u64, u32, &'static [i64]);
    let table: [Row; 11] = [
        ("5_2", 3, &[1, 1, 1, 2, -1, 2], 7, 2, &[2, -3, 2]),
        ("6_1", 4, &[1, 1, 2, -1, -3, 2, -3], 9, 0, &[2, -5, 2]),
        ("7_4", 4, &[1, 1, 2, -1, 2, 2, 3, -2, 3], 15, 2, &[4, -7, 4]),
        ("8_19", 3, &[1, 1, 1, 2, 1, 1, 1, 2], 3, 6, &[1, -1, 0, 1, 0, -1, 1]),
        ("8_20", 3, &[1, 1, 1, -2, -1, -1, -1, -2], 9, 0, &[1, -2, 3, -2, 1]),
        ("8_21", 3, &[1, 1, 1, 2, -1, -1, 2, 2], 15, 2, &[1, -4, 5, -4, 1]),
        ("9_42", 4, &[1, 1, 1, -2, -1, -1, 3, -2, 3], 7, 2, &[1, -2, 1, -2, 1]),
        ("10_124", 3, &[1, 1, 1, 1, 1, 2, 1, 1, 1, 2], 1, 8, &[1, -1, 0, 1, -1, 1, 0, -1, 1]),
        ("10_132", 4, &[1, 1, 1, -2, -1, -1, -2, -3, 2, -3, -3], 5, 0, &[1, -1, 1, -1, 1]),
        ("10_140", 4, &[1, 1, 1, -2, -1, -1, -1, -2, -3, 2, -3], 9, 0, &[1, -2, 3, -2, 1]),
        ("T(2,11)", 2, &[1; 11], 11, 10, &[1, -1, 1, -1, 1, -1, 1, -1, 1, -1, 1]),
    ];
    for (name, strands, word, determinant, signature, alexander) in table {
        let points = closed_braid(strands, word);
        for seed in 0..10 {
            let r = recognize(&points, Ends::Closed, seed);
            assert_eq!(
                (r.knot, r.problem, r.name(), r.is_certain()),
                (KnotType::Unknown, None, "unnamed", true),
                "{name}: {r}"
            );
            assert_eq!(
                (r.determinant, r.signature.unsigned_abs(), r.alexander.as_slice()),
                (determinant, signature, alexander),
                "{name}: {r}"
            );
            let mirrored = recognize(&mirrored(&points), Ends::Closed, seed);
            assert_eq!((mirrored.knot, mirrored.signature), (KnotType::Unknown, -r.signature), "{name}");
        }
    }
    // The same way of building knots gives the figure-eight its name.
    let r = recognize(&closed_braid(3, &[1, -2, 1, -2]), Ends::Closed, 0);
    assert_certain(&r, KnotType::FigureEight, 5, 0, "4_1");
    // A sum with a knot that has none.
    let r = recognize(&closed_braid(4, &[1, -2, 1, -2, 3, 3, 3]), Ends::Closed, 0);
    assert_eq!((r.knot, r.notation.as_str(), r.determinant), (KnotType::Unknown, "4_1 # 3_1", 15));
}

/// Whatever bends space keeps the knot, however many points it takes and however bad the shape gets.
#[test]
fn bending_space_changes_nothing() {
    for (crossings, knot, determinant, signature) in stacks() {
        for seed in 0..6 {
            let n = [300, 600, 1200][seed as usize % 3];
            // Pieces short enough for the polygon to follow the bent curve.
            let points = bent(&resampled(&throws(crossings), true, n), seed);
            assert_certain(
                &recognize(&points, Ends::Closed, seed),
                knot,
                determinant,
                signature,
                &format!("{crossings:?} bent {seed}"),
            );
        }
    }
}

/// Long tails that wander: each a random walk that leads away from the knot on the whole.
#[test]
fn wandering_tails_do_not_hide_the_knot() {
    let mut named = 0;
    let mut total = 0;
    for (crossings, knot, ..) in stacks() {
        for seed in 0..4 {
            let mut random = Random(seed);
            let mut points = opened(&throws(crossings), 4.0);
            for _ in 0..2 {
                points.reverse();
                let (mut p, mut d) = (points[0], (points[0] - points[1]).normalize());
                let out = d;
                let mut tail = Vec::new();
                for _ in 0..200 {
                    d = (d + random.vector() * 0.3 + out * 0.03).normalize();
                    p += d * 0.15;
                    tail.push(p);
                }
                tail.reverse();
                tail.extend(&points);
                points = tail;
            }
            let r = recognize(&points, Ends::Free, seed);
            total += 1;
            named += i32::from(r.knot == knot);
            // A closure may go wrong, a name may not.
            assert!(r.knot == knot || r.knot == KnotType::Unknown, "{crossings:?}: {r}");
        }
    }
    // The tails may get tangled by themselves, seldom.
    assert!(named * 10 >= total * 9, "{named} of {total}");
}

/// A trefoil cut ever shorter is a knot, then none; between, where the end lies in the loop, the closures disagree.
#[test]
fn an_end_inside_the_loop_is_unknown() {
    let trefoil = torus_trefoil(400, 1.0);
    let knots = |percent: usize| {
        (0..10).map(|seed| recognize(&trefoil[..4 * percent], Ends::Free, seed).knot).collect::<Vec<_>>()
    };
    assert!(knots(70).iter().all(|k| *k == KnotType::Unknot));
    assert!(knots(95).iter().all(|k| *k == KnotType::Trefoil(Hand::Right)));
    let between = knots(84);
    assert!(between.iter().filter(|k| **k == KnotType::Unknown).count() >= 7, "{between:?}");
    // What is not certain is another thing than a knot without a name.
    let unsure =
        (0..10).map(|seed| recognize(&trefoil[..336], Ends::Free, seed)).filter(|r| r.knot == KnotType::Unknown);
    assert!(unsure.into_iter().all(|r| r.name() == "unknown" && !r.is_certain()));
    assert!(
        between.iter().all(|k| matches!(k, KnotType::Unknown | KnotType::Unknot | KnotType::Trefoil(Hand::Right))),
        "{between:?}"
    );
}

#[test]
fn input_that_makes_no_sense_is_a_problem_and_no_panic() {
    let x = |v: f64| DVec3::X * v;
    let two = [x(0.0), x(1.0)];
    let cases: Vec<(Vec<DVec3>, Ends, Problem)> = vec![
        (vec![], Ends::Closed, Problem::TooFewPoints),
        (vec![], Ends::Free, Problem::TooFewPoints),
        (vec![x(1.0)], Ends::Free, Problem::TooFewPoints),
        (vec![x(1.0); 50], Ends::Closed, Problem::TooFewPoints),
        (two.to_vec(), Ends::Closed, Problem::TooFewPoints),
        (vec![x(0.0), x(f64::NAN), x(2.0)], Ends::Free, Problem::NotFinite),
        (vec![x(0.0), x(f64::INFINITY), x(2.0)], Ends::Closed, Problem::NotFinite),
        (two.to_vec(), Ends::Held { start: DVec3::ZERO, end: DVec3::X }, Problem::NotFinite),
        (two.to_vec(), Ends::Held { start: DVec3::NAN, end: DVec3::X }, Problem::NotFinite),
    ];
    for (points, ends, problem) in cases {
        let r = recognize(&points, ends, 0);
        assert_eq!((r.knot, r.problem), (KnotType::Unknown, Some(problem)), "{points:?} {ends:?}");
    }
    // A ball of string is given up, soon.
    let mut random = Random(5);
    let tangle: Vec<DVec3> = (0..1000).map(|_| random.vector()).collect();
    for ends in [Ends::Closed, Ends::Free] {
        let r = recognize(&tangle, ends, 0);
        assert_eq!((r.knot, r.problem), (KnotType::Unknown, Some(Problem::TooTangled)));
    }
    // A curve through itself has no knot type: any answer but a knot.
    let eight: Vec<DVec3> =
        (0..40).map(|k| f64::from(k) * TAU / 40.0).map(|t| DVec3::new(t.sin(), (2.0 * t).sin(), 0.0)).collect();
    assert!(matches!(recognize(&eight, Ends::Closed, 0).knot, KnotType::Unknot | KnotType::Unknown));
    // Straight, planar, tiny, huge, and far away: all unknots.
    let straight: Vec<DVec3> = (0..500).map(|k| x(f64::from(k))).collect();
    let circle: Vec<DVec3> =
        (0..500).map(|k| f64::from(k) * TAU / 500.0).map(|t| DVec3::new(t.cos(), t.sin(), 0.0)).collect();
    for (points, ends) in [
        (&straight, Ends::Free),
        (&straight, Ends::Held { start: -DVec3::X, end: DVec3::X }),
        (&circle, Ends::Closed),
        (&circle, Ends::Free),
    ] {
        for scale in [1e-200, 1e-6, 1.0, 1e150] {
            let scaled: Vec<DVec3> = points.iter().map(|p| *p * scale + DVec3::splat(3.0 * scale)).collect();
            assert_certain(&recognize(&scaled, ends, 0), KnotType::Unknot, 1, 0, "straight or planar");
        }
    }
}

#[test]
fn what_is_recognized_reads_well() {
    let r = recognize(&throws(&[3, -3]), Ends::Closed, 0);
    assert_eq!(r.to_string(), "square knot (3_1 # m3_1), det 9, signature 0");
    assert_eq!(r.knot.name(), "square");
    let r = recognize(&closed_braid(3, &[1, 1, 1, -2, -1, -1, -1, -2]), Ends::Closed, 0);
    assert_eq!(r.to_string(), "unnamed, det 9, signature 0, 8 crossings");
    for (_, knot, ..) in stacks() {
        assert!(KnotType::NAMES.contains(&knot.name()) && KnotType::NAMES.contains(&mirror(knot).name()));
    }
}

#[test]
fn the_same_seed_gives_the_same_answer() {
    let open = opened(&throws(&[5, -3]), 3.0);
    assert_eq!(recognize(&open, Ends::Free, 42), recognize(&open, Ends::Free, 42));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// Turned, moved, scaled, started elsewhere, read backward, and disturbed by less than half the distance of its
    /// strands.
    #[test]
    fn recognition_sees_only_the_knot(
        which in 0..17_usize, seed: u64, axis in (-1.0..1.0, -1.0..1.0, -1.0..1.0), angle in 0.0..TAU, scale in -6.0..6.0, start in 0..200_usize,
        reverse: bool, mirror_it: bool,
    ) {
        let (crossings, knot, determinant, signature) = stacks()[which];
        let mut random = Random(seed);
        let mut points = resampled(&throws(crossings), true, 300);
        // Strands are at least 0.4 apart; noise of 0.1 in each coordinate moves two points nearer by less than 0.35.
        points.iter_mut().for_each(|p| *p += random.vector() * 0.1);
        let n = points.len();
        points.rotate_left(start % n);
        if reverse {
            points.reverse();
        }
        if mirror_it {
            points = mirrored(&points);
        }
        let axis = DVec3::from(axis).try_normalize().unwrap_or(DVec3::Z);
        let turn = DQuat::from_axis_angle(axis, angle);
        let scale = 10_f64.powf(scale);
        let points: Vec<DVec3> = points.iter().map(|p| turn * (*p * scale) + axis * (10.0 * scale)).collect();
        let (knot, signature) = if mirror_it { (mirror(knot), -signature) } else { (knot, signature) };
        let r = recognize(&points, Ends::Closed, seed);
        prop_assert_eq!((r.knot, r.determinant, r.signature, r.problem), (knot, determinant, signature, None));
    }

    /// A random polygon has some knot; no view may disagree with another, and nothing may panic.
    #[test]
    fn random_polygons_have_one_answer(seed: u64, n in 3..30_usize) {
        let mut random = Random(seed);
        let points: Vec<DVec3> = (0..n).map(|_| random.vector()).collect();
        let r = recognize(&points, Ends::Closed, seed);
        let other = recognize(&points, Ends::Closed, !seed);
        prop_assert!(r.problem.is_none() || r.problem == Some(Problem::TooTangled), "{}", r);
        if r.problem.is_none() && other.problem.is_none() {
            prop_assert_eq!((r.determinant, r.signature, &r.alexander), (other.determinant, other.signature, &other.alexander));
        }
    }
}

/// Right-handed for +1: R = 1, a = 0.4.
fn torus_trefoil(n: usize, hand: f64) -> Vec<DVec3> {
    let point = |k: usize| {
        let t = TAU * k as f64 / n as f64;
        let r = 1.0 + 0.4 * (3.0 * t).cos();
        DVec3::new(r * (2.0 * t).cos(), r * (2.0 * t).sin(), -hand * 0.4 * (3.0 * t).sin())
    };
    (0..n).map(point).collect()
}

#[test]
fn writhe_of_the_torus_trefoil() {
    // Table of section 11, all digits given.
    for (n, want) in [(50, 3.321992), (100, 3.333206), (200, 3.336092), (400, 3.336819)] {
        let points = torus_trefoil(n, 1.0);
        assert!((writhe(&points, true) - want).abs() < 5e-7, "{n}: {}", writhe(&points, true));
        assert!((writhe(&torus_trefoil(n, -1.0), true) + want).abs() < 5e-7);
        assert_certain(&recognize(&points, Ends::Closed, 0), KnotType::Trefoil(Hand::Right), 3, -2, "torus trefoil");
    }
    let flat: Vec<DVec3> = torus_trefoil(100, 1.0).iter().map(|p| DVec3::new(p.x, p.y, 0.0)).collect();
    assert!(writhe(&flat[..40], false).abs() < 1e-12);
}

#[test]
fn writhe_of_a_long_helix_is_fullers() {
    // n (1 - p / sqrt(p^2 + (2 pi a)^2)) but for the ends, which give O(1): 20 turns against 40 take them out.
    let helix = |turns: usize| -> Vec<DVec3> {
        (0..=turns * 40)
            .map(|k| k as f64 / 40.0)
            .map(|t| DVec3::new((TAU * t).cos(), (TAU * t).sin(), TAU * t))
            .collect()
    };
    let per_turn = (writhe(&helix(40), false) - writhe(&helix(20), false)) / 20.0;
    // Pitch 2 pi, radius 1. Polygons of 40 sides a turn differ by (2 pi / 40)^2 / 6, the ends' remainder is of the
    // order 1 / 20^2.
    assert!((per_turn - (1.0 - 0.5_f64.sqrt())).abs() < 4e-3, "{per_turn}");
}

#[test]
fn writhe_changes_by_two_where_the_thread_passes_through_itself() {
    // The upper strand of a crossing at height +h and -h.
    let at = |h: f64| {
        let mut p = vec![
            DVec3::new(-5.0, 0.0, 0.0),
            DVec3::new(5.0, 0.0, 0.0),
            DVec3::new(8.0, 6.0, 0.3),
            DVec3::new(0.1, 5.0, h),
        ];
        p.extend([DVec3::new(0.0, -5.0, h), DVec3::new(-8.0, -6.0, 0.4)]);
        p
    };
    let jump = writhe(&at(1e-7), true) - writhe(&at(-1e-7), true);
    // The height changes the rest by its own size over the lengths.
    assert!((jump.abs() - 2.0).abs() < 1e-6, "{jump}");
}

#[test]
fn linking_numbers_are_integers() {
    let circle = |n: usize| (0..n).map(move |k| TAU * k as f64 / n as f64);
    let a: Vec<DVec3> = circle(60).map(|t| DVec3::new(t.cos(), t.sin(), 0.0)).collect();
    let b: Vec<DVec3> = circle(60).map(|t| DVec3::new(1.0 + 0.7 * t.cos(), 0.0, 0.7 * t.sin())).collect();
    let back: Vec<DVec3> = b.iter().rev().copied().collect();
    let away: Vec<DVec3> = b.iter().map(|p| *p + DVec3::X * 5.0).collect();
    // Sums of 3,600 angles: 1e-12 is a few last digits each.
    assert!((gauss_linking(&a, &b).abs() - 1.0).abs() < 1e-12);
    assert!((gauss_linking(&a, &b) + gauss_linking(&a, &back)).abs() < 1e-12);
    assert!(gauss_linking(&a, &away).abs() < 1e-12);
    for n in [2.0, 3.0, 5.0] {
        let helix: Vec<DVec3> = circle(300)
            .map(|t| {
                DVec3::new(
                    (1.0 + 0.3 * (n * t).cos()) * t.cos(),
                    (1.0 + 0.3 * (n * t).cos()) * t.sin(),
                    0.3 * (n * t).sin(),
                )
            })
            .collect();
        assert!((gauss_linking(&a, &helix).abs() - n).abs() < 1e-11);
    }
}

/// Two strands side by side over a length of 20 diameters, apart by 45 degrees at both ends, with a long loop between:
/// the arc lengths of the corners. `tail` is added to the first tail; the last one may come back and lie across the
/// loop.
fn side_by_side(tail: f64, across: bool) -> (Vec<DVec3>, [f64; 4]) {
    let (half, wide) = (10.0, 20.0);
    let p = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    let diagonal = DVec3::new(-1.0, -1.0, 0.0).normalize();
    let mut corners = vec![
        p(-half - wide, -wide, 0.0) + diagonal * tail,
        p(-half, 0.0, 0.0),
        p(half, 0.0, 0.0),
        p(half + wide, -wide, 0.0),
    ];
    corners.extend([
        p(half + 3.0 * wide, 0.0, 0.0),
        p(half + wide, 1.0 + wide, 0.0),
        p(half, 1.0, 0.0),
        p(-half, 1.0, 0.0),
        p(-half - wide, 1.0 + wide, 0.0),
    ]);
    if across {
        corners.extend([p(0.0, 60.0, 1.0), p(half + 2.0 * wide, 60.0, 1.0), p(half + 2.0 * wide, -60.0, 1.0)]);
    }
    let arc = |k: usize| corners[..=k].windows(2).map(|w| w[0].distance(w[1])).sum::<f64>();
    (corners.clone(), [arc(1), arc(2), arc(6), arc(7)])
}

fn lengths(points: &[DVec3]) -> Vec<f64> {
    points.windows(2).map(|w| w[0].distance(w[1])).collect()
}

#[test]
fn entries_are_where_the_strands_part() {
    // Diameter 1. The other strand's corner is the nearest place, at 1.2 diameters where a^2 + sqrt(2) a + 1 = 1.44.
    let a = ((2.0_f64 + 1.76).sqrt() - 2.0_f64.sqrt()) / 2.0;
    let mut first = None;
    for (tail, n) in [(0.0, 150), (0.3, 150), (1.7, 400), (0.0, 999)] {
        for across in [false, true] {
            let (corners, arc) = side_by_side(tail, across);
            let points = resampled(&corners, false, n);
            let e = entries(&points, &lengths(&points), 0.5).unwrap();
            let got = [e.tail_a, e.loop_ab.unwrap()[0], e.loop_ab.unwrap()[1], e.tail_b];
            for (got, want) in got.iter().zip([arc[0] - a, arc[1] + a, arc[2] - a, arc[3] + a]) {
                // The elements end at the corners, so only the sums of lengths round off.
                assert!((got - want).abs() < 1e-9, "{tail} {n} {across}: {got} {want}");
            }
            // The thread slips through by what the tail grew, the loop alike.
            let slip = e.slip_since(first.get_or_insert(e));
            assert!((slip - tail).abs() < 1e-9, "{slip}");
        }
    }
}

#[test]
fn entries_are_material() {
    // Stretched by a fifth and carried elsewhere, the same places of the thread are in touch; the radius grows alike.
    let (corners, _) = side_by_side(0.0, false);
    let points = resampled(&corners, false, 300);
    let e = entries(&points, &lengths(&points), 0.5).unwrap();
    let moved: Vec<DVec3> = points.iter().map(|p| DQuat::from_rotation_y(0.8) * *p * 1.2 + DVec3::splat(7.0)).collect();
    // What counts as a neighbor along the thread is measured in rest length, so it changes a little; no contact is that
    // near.
    let after = entries(&moved, &lengths(&points), 0.6).unwrap();
    assert!(after.slip_since(&e) < 1e-9, "{after:?} {e:?}");
}

#[test]
fn a_tight_overhand_knot_has_tails_and_no_loop() {
    // The torus trefoil cut open, as thick as its strands allow: about 0.7 apart at the nearest.
    let closed = torus_trefoil(300, 1.0);
    let (first, last) = (closed[0], closed[299]);
    let tangent = (closed[1] - closed[0]).normalize();
    let mut points = vec![first - tangent * 0.2 + DVec3::X * 6.0 - tangent * 4.0];
    points.extend(&closed);
    points.push(last + tangent * 0.2 + DVec3::X * 6.0 + tangent * 4.0);
    let points = resampled(&points, false, 400);
    assert_eq!(recognize(&points, Ends::Free, 0).knot, KnotType::Trefoil(Hand::Right));
    let e = entries(&points, &lengths(&points), 0.35).unwrap();
    assert_eq!(e.loop_ab, None);
    assert!(e.tail_a > 5.0 && e.tail_b - e.tail_a > 10.0, "{e:?}");
}

#[test]
fn entries_of_nothing_are_none() {
    let straight: Vec<DVec3> = (0..50).map(|k| DVec3::X * f64::from(k)).collect();
    assert_eq!(entries(&straight, &lengths(&straight), 0.5), None);
    assert_eq!(entries(&straight, &[1.0], 0.5), None);
    assert_eq!(entries(&straight, &lengths(&straight), f64::NAN), None);
    assert_eq!(entries(&[], &[], 0.5), None);
    assert_eq!(entries(&[DVec3::ZERO], &[], 0.5), None);
    let mut bad = straight.clone();
    bad[7].y = f64::NAN;
    assert_eq!(entries(&bad, &lengths(&straight), 0.5), None);
}

#[test]
fn the_audit_sees_every_substep_of_a_world() {
    let mut world = World::new(Settings::default()).unwrap();
    let (from, to) = (DVec3::ZERO, DVec3::X * 0.05);
    let rod = world.insert_rod(&RodSpec::straight(from, to, 50, 1e-4, Material::elastic(2e9, 1150.0))).unwrap();
    let mut audit = Audit::new();
    let mut substeps = 0;
    for _ in 0..6 {
        substeps += u64::from(world.step_with(1.0 / 60.0, &mut |view| audit.observe(view)).substeps);
    }
    let report = audit.report();
    assert_eq!((report.states, report.states_not_finite, report.passes_through), (substeps, 0, false));
    assert_eq!((report.thread_clearance, report.shape_clearance), (None, None));
    // It falls freely: g t^2 / 2 is 49 mm, and nothing stretches it beyond round-off of its position over its element
    // length.
    assert!(world.rod(rod).unwrap().positions()[0].z < -0.04);
    assert_eq!(report.max_elongation[0].0, rod.index());
    assert!(report.max_elongation[0].1 < 1e-9, "{:?}", report.max_elongation);
}
