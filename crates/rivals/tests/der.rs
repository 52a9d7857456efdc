//! Discrete elastic rods against closed forms. Lengths and bars are those of a rod clamped in the middle of its held
//! edges (`scene.rs`).

mod support;

use std::f64::consts::{PI, TAU};

use glam::{DQuat, DVec3};
use support::{line, thread};
use sutura_rivals::der::Settings;
use sutura_rivals::{Der, Hold, Pose, Rod, Scene, Shape, Solver};

/// A level thread along x, clamped at its first edge, whose length from the middle of that edge on is 50 mm. Ends at
/// rest: reach and drop of its tip from there, over the length.
fn cantilever(n: usize, load: f64, weight: f64) -> (f64, f64) {
    let length = 0.05;
    let edge = length / (n as f64 - 0.5);
    let rod = thread(line(n, edge, DVec3::X));
    let ei = rod.young * rod.second_moment();
    let gravity = DVec3::NEG_Z * weight * ei / length.powi(3) / (rod.density * rod.area());
    let at = DQuat::from_rotation_y(PI / 2.0);
    let scene = Scene {
        first: Hold::Clamp(Box::new(move |_| Pose::new(DVec3::ZERO, at))),
        loads: vec![(n, DVec3::NEG_Z * load * ei / (length * length))],
        gravity,
        ..Scene::of(rod)
    };
    let mut der = Der::new(scene, Settings { iterations: 500, ..Settings::default() }).unwrap();
    // Steps this long forget inertia. Each jumps to rest, which takes Newton's method more iterations than a step of a
    // frame.
    for _ in 0..12 {
        der.step(10.0);
    }
    assert_eq!(der.unsolved(), 0);
    let tip = der.positions()[n];
    assert!(tip.y.abs() < 1e-9);
    ((tip.x - 0.5 * edge) / length, -tip.z / length)
}

/// Errors at three refinements fall with the second order, to a final bar.
fn assert_second_order(name: &str, errors: [f64; 3], bar: f64) {
    let order = (errors[1] / errors[2]).abs().log2();
    println!("{name}: errors {errors:?}, order {order:.2}");
    assert!(order > 1.8, "{name}: {errors:?}, order {order}");
    assert!(errors[2].abs() < bar, "{name}: {errors:?}");
}

/// Tip loads k = P L^2 / EI, from elliptic integrals: reach and drop.
#[test]
fn elastica_under_a_tip_load() {
    for (k, reach, drop) in [(1.0, 0.943567, 0.301721), (5.0, 0.612372, 0.713792), (10.0, 0.445004, 0.810609)] {
        let runs = [10, 20, 40].map(|n| cantilever(n, k, 0.0));
        assert_second_order(&format!("k = {k}, reach"), runs.map(|r| r.0 - reach), 1e-3);
        assert_second_order(&format!("k = {k}, drop"), runs.map(|r| r.1 - drop), 1e-3);
    }
}

/// Own weight g = w L^3 / EI, from differential equations: reach and drop.
#[test]
fn elastica_under_its_weight() {
    for (g, reach, drop) in [(2.0, 0.966893, 0.238507), (10.0, 0.656354, 0.700200)] {
        let runs = [10, 20, 40].map(|n| cantilever(n, 0.0, g));
        assert_second_order(&format!("g = {g}, reach"), runs.map(|r| r.0 - reach), 1e-3);
        assert_second_order(&format!("g = {g}, drop"), runs.map(|r| r.1 - drop), 1e-3);
    }
}

/// A rod clamped at both ends, which do not come nearer, is turned until its torque is `m` EI / L. Beyond Greenhill's
/// limit it leaves its axis, by so little that it only stretches to bear the tension at which `m` is the limit: that
/// tension over EI / L^2, and the torque.
fn greenhill(n: usize, m: f64) -> [f64; 2] {
    let length = 0.1;
    let edge = length / (n as f64 - 1.0);
    let rod = thread(line(n, edge, DVec3::Z));
    let ei = rod.young * rod.second_moment();
    let turn = m * rod.young / (2.0 * rod.shear);
    let end = DVec3::Z * edge * n as f64;
    let scene = Scene {
        first: Hold::Clamp(Box::new(|_| Pose::new(DVec3::ZERO, DQuat::IDENTITY))),
        last: Hold::Clamp(Box::new(move |t| Pose::new(end, DQuat::from_rotation_z(turn * (t / 10.0).min(1.0))))),
        // A nudge, without which it would stay straight.
        loads: vec![(n / 2, DVec3::X * 1e-9), (n / 3, DVec3::Y * 1e-9)],
        ..Scene::of(rod)
    };
    let mut der = Der::new(scene, Settings::default()).unwrap();
    for _ in 0..10 {
        der.step(1.0);
    }
    for _ in 0..60 {
        der.step(10.0);
    }
    let forces = der.elastic_forces();
    [(forces[0] + forces[1]).z * length * length / ei, der.twisting_moments()[0] * length / ei]
}

/// Clamped rods under tension t = T L^2 / EI lose their axis at the torque m = M L / EI (determinant of the linear
/// problem; 8.986819 at t = 0).
#[test]
fn greenhill_clamped_rod() {
    let [t, _] = greenhill(40, 0.98 * 8.986819);
    assert!(t.abs() < 0.01, "below the limit there is no tension: {t}");
    for (t, m) in [(10.0, 10.42886), (50.0, 15.58932)] {
        let runs = [20, 40, 80].map(|n| greenhill(n, m));
        println!("Greenhill, m = {m}: {runs:?}");
        assert_second_order(&format!("Greenhill, t = {t}"), runs.map(|r| r[0] / t - 1.0), 0.01);
        assert!((runs[2][1] / m - 1.0).abs() < 1e-3, "{runs:?}");
    }
}

/// A rod clamped at both ends, drawn together by 10 mm on 200 mm and turned twelve times, leaves its axis in a helix
/// whose envelope is a hyperbolic secant. Tension 15.8416 mN and torque 0.210038 mN m are those of the closed form for
/// a long rod.
#[test]
fn localized_helical_buckling() {
    let mut errors = vec![];
    for n in [160, 320] {
        let length = 0.2;
        let edge = length / (n as f64 - 1.0);
        let rod = thread(line(n, edge, DVec3::Z));
        let end = edge * n as f64;
        let scene = Scene {
            first: Hold::Clamp(Box::new(|_| Pose::new(DVec3::ZERO, DQuat::IDENTITY))),
            last: Hold::Clamp(Box::new(move |t| {
                let (way, turns) = ((t / 20.0).min(1.0), 12.0 * ((t - 20.0) / 60.0).clamp(0.0, 1.0));
                Pose::new(DVec3::Z * (end - 0.01 * way), DQuat::from_rotation_z(TAU * turns))
            })),
            loads: vec![(n / 2, DVec3::X * 1e-6)],
            ..Scene::of(rod)
        };
        let mut der = Der::new(scene, Settings::default()).unwrap();
        for _ in 0..400 {
            der.step(0.25);
        }
        for _ in 0..40 {
            der.step(5.0);
        }
        let forces = der.elastic_forces();
        let tension = (forces[0] + forces[1]).z;
        let torque = der.twisting_moments()[0];
        // The wrench along z at the clamp, where the edge lies along z: the torque is that of twist.
        errors.push((tension / 15.8416e-3 - 1.0, torque.abs() / 0.210038e-3 - 1.0));
        println!("localized, {n} edges: tension {tension:.6e} N, torque {torque:.6e} N m, unsolved {}", der.unsolved());
    }
    for (t, m) in &errors {
        assert!(t.abs() < 0.02 && m.abs() < 0.005, "{errors:?}");
    }
    assert!(
        errors[1].0.abs() < 0.3 * errors[0].0.abs() && errors[1].1.abs() < 0.3 * errors[0].1.abs(),
        "not of second order: {errors:?}"
    );
}

/// Michell: a naturally straight rod bent to a ring and turned loses its plane at 2 pi sqrt 3 EI / GJ; a ring of n
/// edges stands 34 / n^2 more. The ring is an open rod whose two held edges lie on each other. Ends at rest: its torque
/// over Michell's. (It may swing about the held edge as a whole, which costs nothing.)
fn michell(n: usize, share: f64) -> f64 {
    // n - 1 edges close the ring; the last edge lies on the first.
    let round = n as f64 - 1.0;
    let edge = 0.12 / round;
    let radius = 0.5 * edge / (PI / round).sin();
    let rod = thread(line(n, edge, DVec3::X));
    let rod_ei = rod.young * rod.second_moment();
    let corner = |i: usize| DVec3::new((TAU * i as f64 / round).cos(), (TAU * i as f64 / round).sin(), 0.0) * radius;
    let start = Shape::untwisted((0..=n).map(corner).collect(), DVec3::Z);
    let turn = share * TAU * 3.0_f64.sqrt() * rod.young / (2.0 * rod.shear);
    let (first, last) = (start.frames[0], start.frames[n - 1]);
    let (p, q) = (start.points[0], start.points[n]);
    let scene = Scene {
        first: Hold::Clamp(Box::new(move |_| Pose::new(p, first))),
        last: Hold::Clamp(Box::new(move |t| Pose::new(q, last * DQuat::from_rotation_z(turn * (t / 20.0).min(1.0))))),
        loads: vec![(n / 3, DVec3::Z * 1e-5 * rod_ei / (radius * radius))],
        ..Scene::of(Rod { start, ..rod })
    };
    let mut der = Der::new(scene, Settings::default()).unwrap();
    for _ in 0..20 {
        der.step(1.0);
    }
    for _ in 0..100 {
        der.step(10.0);
    }
    der.twisting_moments()[n / 2] * edge * round / (TAU * 3.0_f64.sqrt() * rod_ei)
}

#[test]
fn michell_ring() {
    for n in [32, 64] {
        let limit = 1.0 + 34.0 / f64::from(n as u32 - 1).powi(2);
        let [below, above] = [0.99, 1.01].map(|m| michell(n, m * limit));
        println!("Michell, {n} edges: torque {below:.4} at 0.99, {above:.4} at 1.01 of the limit {limit:.4}");
        // Below it, all of the turn is twist.
        assert!((below / (0.99 * limit) - 1.0).abs() < 1e-4, "{n}: {below}");
        assert!(above < 0.5, "{n}: {above}");
    }
}

/// A helix that is its own rest shape has no forces: it stays to rounding, also when it is turned in space and its
/// reference frames are not those of its rest shape.
#[test]
fn a_natural_helix_stays() {
    let helix = support::helix(60);
    let turn = DQuat::from_rotation_x(1.0) * DQuat::from_rotation_z(0.5);
    let start = Shape {
        points: helix.points.iter().map(|&p| turn * p).collect(),
        frames: helix.frames.iter().map(|&q| turn * q).collect(),
    };
    let mut der = Der::new(
        Scene::of(Rod { start: start.clone(), rest: helix, ..thread(line(60, 1e-3, DVec3::X)) }),
        Settings::default(),
    )
    .unwrap();
    for _ in 0..60 {
        der.step(1.0 / 60.0);
    }
    let moved = der.positions().iter().zip(&start.points).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    assert!(moved < 1e-10, "{moved}");
    // Let go from a straight line, it winds up again, to the shape of the rest length and pitch.
    let line = Shape::straight(DVec3::ZERO, DVec3::X * der.rest_lengths().iter().sum::<f64>(), 60, DVec3::Y);
    let rest = support::helix(60);
    let far = rest.points[0].distance(rest.points[60]);
    let mut der = Der::new(
        Scene { drag: 5.0, ..Scene::of(Rod { start: line, rest, ..thread(support::line(60, 1e-3, DVec3::X)) }) },
        Settings::default(),
    )
    .unwrap();
    for _ in 0..240 {
        der.step(1.0 / 60.0);
    }
    let ends = der.positions()[0].distance(der.positions()[60]);
    assert!((ends / far - 1.0).abs() < 1e-6, "{ends} for {far}");
    assert!(der.elastic_energy().iter().sum::<f64>() < 1e-15);
}

/// A free rod that flies and springs out of a bent shape: its center falls as implicit Euler has it, its momentum is
/// exact.
#[test]
fn free_fall_and_momentum() {
    let rod = Rod {
        start: support::helix(30),
        ..thread(line(30, support::helix(30).points[0].distance(support::helix(30).points[1]), DVec3::X))
    };
    let masses = rod.masses();
    let total: f64 = masses.iter().sum();
    let g = DVec3::new(0.0, 0.0, -9.81);
    let mut der = Der::new(Scene { gravity: g, ..Scene::of(rod) }, Settings::default()).unwrap();
    let v = DVec3::new(0.3, -0.2, 0.5);
    der.set_velocities(&vec![v; 31]);
    let center = |der: &Der| der.positions().iter().zip(&masses).map(|(p, m)| *p * *m).sum::<DVec3>() / total;
    let before = center(&der);
    let (h, steps) = (1.0 / 3000.0, 300);
    for _ in 0..steps {
        der.step(h);
    }
    let m = f64::from(steps);
    let fallen = v * (m * h) + g * (h * h * m * (m + 1.0) / 2.0);
    assert!((center(&der) - before - fallen).length() < 1e-9, "{}", center(&der) - before - fallen);
    let momentum: DVec3 = der.velocities().iter().zip(&masses).map(|(v, m)| *v * *m).sum();
    let wanted = (v + g * (m * h)) * total;
    // Each step is solved to a few parts in 10^9 of an edge or better.
    assert!((momentum - wanted).length() < 1e-7 * wanted.length(), "{momentum} for {wanted}");
    assert_eq!(der.unsolved(), 0);
}

/// The first mode of a cantilever, omega = 3.516 sqrt(EI / (rho A L^4)), in a small free swing: inertia and stiffness.
/// Implicit Euler makes of it atan(omega h) / h, and an amplitude that shrinks by 1 / sqrt(1 + (omega h)^2) a step.
#[test]
fn frequency_of_a_cantilever() {
    let (n, length) = (30, 0.05);
    let edge = length / (n as f64 - 0.5);
    let rod = thread(line(n, edge, DVec3::Z));
    let omega = 3.51602 * (rod.young * rod.second_moment() / (rod.density * rod.area())).sqrt() / (length * length);
    let scene = Scene { first: Hold::Clamp(Box::new(|_| Pose::new(DVec3::ZERO, DQuat::IDENTITY))), ..Scene::of(rod) };
    let mut der = Der::new(scene, Settings::default()).unwrap();
    let mode = |i: usize| {
        let b = 1.87510407 * (i as f64 - 0.5) * edge / length;
        b.cosh() - b.cos() - 0.73409551 * (b.sinh() - b.sin())
    };
    let v: Vec<DVec3> = (0..=n).map(|i| if i < 2 { DVec3::ZERO } else { DVec3::X * 0.005 * mode(i) }).collect();
    der.set_velocities(&v);
    let h = TAU / omega / 400.0;
    let (mut crossings, mut peaks, mut peak) = (vec![], vec![], 0.0_f64);
    let mut before = 0.0;
    for i in 0..1300 {
        der.step(h);
        let x = der.positions()[n].x;
        if before < 0.0 && x >= 0.0 || before > 0.0 && x <= 0.0 {
            peaks.push(peak);
            peak = 0.0;
            crossings.push((f64::from(i) + before / (before - x)) * h);
        }
        before = x;
        peak = peak.max(x.abs());
    }
    let got = PI * (crossings.len() - 1) as f64 / (crossings[crossings.len() - 1] - crossings[0]);
    let wanted = libm::atan(omega * h) / h;
    // From the third to the fifth one goes a whole turn.
    let (faded, theory) = (peaks[4] / peaks[2], (1.0 + (omega * h).powi(2)).powf(-0.5 * TAU / wanted / h));
    println!("cantilever: {got} rad/s for {wanted}, amplitude after a turn {faded} for {theory}");
    assert!((got / wanted - 1.0).abs() < 1e-3, "{got} for {wanted}");
    assert!((faded - theory).abs() < 1e-3, "{faded} for {theory}");
}
