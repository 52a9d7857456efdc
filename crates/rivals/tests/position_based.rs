//! The two position-based methods: what they keep exactly, and what they can and cannot show.

mod support;

use glam::{DQuat, DVec3};
use support::{helix, line, out_of_plane, pressed_and_turned, thread};
use sutura_rivals::{Der, Hold, Pbd, Pber, Pose, Rod, Scene, Solver, der, pbd, pber};

/// A helix that is its own rest shape violates nothing: it stays, wherever it is.
#[test]
fn a_natural_helix_stays() {
    let rod = || thread(helix(60));
    let mut solvers: [Box<dyn Solver>; 2] = [
        Box::new(Pber::new(Scene::of(rod()), pber::Settings::default()).unwrap()),
        Box::new(Pbd::new(Scene::of(rod()), pbd::Settings::default()).unwrap()),
    ];
    for solver in &mut solvers {
        for _ in 0..60 {
            solver.step(1.0 / 60.0);
        }
        let moved = solver.positions().iter().zip(&helix(60).points).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        assert!(moved < 1e-10, "{moved}");
    }
}

/// Let go from a straight line, the ghost points wind the rod up to its helix again; distances between points on a line
/// cannot push any of them off it, and the rod stays straight.
#[test]
fn a_straight_line_winds_up_to_its_helix() {
    let (n, rest) = (60, helix(60));
    let far = rest.points[0].distance(rest.points[n]);
    let edge = rest.points[0].distance(rest.points[1]);
    let scene = || Scene { drag: 5.0, ..Scene::of(Rod { start: line(n, edge, DVec3::X), ..thread(helix(n)) }) };
    let mut pber = Pber::new(scene(), pber::Settings { bend_twist: DVec3::ONE, ..Default::default() }).unwrap();
    let mut pbd = Pbd::new(scene(), pbd::Settings::default()).unwrap();
    for _ in 0..800 {
        pber.step(1.0 / 60.0);
        pbd.step(1.0 / 60.0);
    }
    let ends = |s: &dyn Solver| s.positions()[0].distance(s.positions()[n]) / far;
    println!("ends of the helix: ghost points {}, distances {}", ends(&pber), ends(&pbd));
    assert!((ends(&pber) - 1.0).abs() < 0.01, "{}", ends(&pber));
    assert!(pber.greatest_strain() < 1e-3);
    assert!((ends(&pbd) - 1.0).abs() > 0.1, "{}", ends(&pbd));
}

/// Constraints act between points: momentum is that of free fall to rounding, while the rod springs out of a bent
/// shape.
#[test]
fn momentum() {
    let g = DVec3::new(0.0, 0.0, -9.81);
    let rod =
        || Rod { start: helix(30), ..thread(line(30, helix(30).points[0].distance(helix(30).points[1]), DVec3::X)) };
    let (h, steps) = (1.0 / 240.0, 120);
    let wanted = DVec3::new(0.3, -0.2, 0.5) + g * (h * f64::from(steps));
    let masses = rod().masses();
    let mean = |v: &[DVec3], m: &[f64]| v.iter().zip(m).map(|(v, m)| *v * *m).sum::<DVec3>() / m.iter().sum::<f64>();
    let mut pber = Pber::new(
        Scene { gravity: g, ..Scene::of(rod()) },
        pber::Settings { ghost_gravity: true, ..Default::default() },
    )
    .unwrap();
    let mut pbd = Pbd::new(Scene { gravity: g, ..Scene::of(rod()) }, pbd::Settings::default()).unwrap();
    pber.set_velocities(&[DVec3::new(0.3, -0.2, 0.5); 61]);
    pbd.set_velocities(&[DVec3::new(0.3, -0.2, 0.5); 31]);
    for _ in 0..steps {
        pber.step(h);
        pbd.step(h);
    }
    // Edges are all of one length, so that every ghost point has the mass of an inner vertex.
    let with_ghosts: Vec<f64> = masses.iter().copied().chain((0..30).map(|_| masses[1])).collect();
    assert!((mean(pber.velocities(), &with_ghosts) - wanted).length() < 1e-9);
    assert!((mean(pbd.velocities(), &masses) - wanted).length() < 1e-9);
    let grown = |s: &dyn Solver| {
        s.positions()[0].distance(s.positions()[30]) / helix(30).points[0].distance(helix(30).points[30])
    };
    assert!(grown(&pber) > 1.5 && grown(&pbd) > 1.5, "it did spring: {} {}", grown(&pber), grown(&pbd));
}

/// A straight rod whose end is turned by 3 radians: its twist is even inside, whatever the (small) number. The joint of
/// a held edge has a half, the next nine tenths, by their stiffness (`pber.rs`); they also bend a little, and the rod
/// leaves its axis by a tenth of an edge.
#[test]
fn twist_spreads_evenly_inside() {
    let n = 20;
    for number in [0.01, 0.03] {
        let scene = Scene {
            first: Hold::Clamp(Box::new(|_| Pose::new(DVec3::ZERO, DQuat::IDENTITY))),
            last: Hold::Clamp(Box::new(|t| Pose::new(DVec3::Z * 0.1, DQuat::from_rotation_z(3.0 * t.min(1.0))))),
            drag: 5.0,
            ..Scene::of(thread(line(n, 0.1 / 20.0, DVec3::Z)))
        };
        let mut pber =
            Pber::new(scene, pber::Settings { bend_twist: DVec3::splat(number), ..Default::default() }).unwrap();
        for _ in 0..2000 {
            pber.step(1.0 / 60.0);
        }
        let frames = pber.frames().unwrap();
        let twist: Vec<f64> = frames.windows(2).map(|q| q[0].angle_between(q[1])).collect();
        println!("twist with number {number}: {twist:.4?}");
        // The little bending makes the angles between frames a little larger than the twist.
        assert!((twist.iter().sum::<f64>() - 3.0).abs() < 0.01, "{twist:?}");
        for t in &twist[3..n - 4] {
            // The order of a sweep leaves a difference in the middle that is of the order of the number.
            assert!((t / twist[5] - 1.0).abs() < number, "{twist:?}");
        }
        for (joint, share) in [(0, 0.5), (1, 0.9), (n - 3, 0.9), (n - 2, 0.5)] {
            assert!((twist[joint] / twist[5] - share).abs() < 0.02, "{joint}: {twist:?}");
        }
        assert!(pber.positions().iter().all(|p| p.truncate().length() < 0.15 * 0.1 / 20.0));
    }
}

/// Pressed together and turned once, a rod leaves its plane when a method couples bending and twist, and not when it
/// knows no twist.
#[test]
fn an_out_of_plane_loop() {
    // One step a frame falls by most of an edge, which no number of sweeps below some hundreds brings back.
    let settings = pber::Settings { substeps: 20, ..Default::default() };
    let mut pber = Pber::new(pressed_and_turned(1.0), settings).unwrap();
    let mut flat = Pber::new(pressed_and_turned(0.0), settings).unwrap();
    let mut pbd = Pbd::new(pressed_and_turned(1.0), pbd::Settings { substeps: 20, ..Default::default() }).unwrap();
    let mut der = Der::new(pressed_and_turned(1.0), der::Settings::default()).unwrap();
    for _ in 0..210 {
        for solver in [&mut pber as &mut dyn Solver, &mut pbd, &mut der, &mut flat] {
            solver.step(1.0 / 60.0);
        }
    }
    for (name, s) in [
        ("ghost points", &pber as &dyn Solver),
        ("distances", &pbd),
        ("discrete elastic rods", &der),
        ("ghost points, no turn", &flat),
    ] {
        println!(
            "{name}: out of plane {:.3} mm, elongation {:.2e}, greatest strain {:.2e}",
            1e3 * out_of_plane(s),
            s.elongation(),
            s.greatest_strain()
        );
    }
    assert!(out_of_plane(&pber) > 0.01 && out_of_plane(&der) > 0.01);
    assert!(out_of_plane(&pbd) < 1e-9 && out_of_plane(&flat) < 1e-9);
    assert!(pber.greatest_strain() < 0.01 && pbd.greatest_strain() < 0.03);
    assert!(der.greatest_strain() < 1e-4);
}

/// What the methods lack, and the engine's comparison shows: stiffness depends on iterations. More sweeps hold a level
/// cantilever higher.
#[test]
fn stiffness_depends_on_iterations() {
    let tip = |iterations: usize| {
        let rod = thread(line(20, 0.15 / 20.0, DVec3::X));
        let frame = rod.start.frames[0];
        let scene = Scene {
            first: Hold::Clamp(Box::new(move |_| Pose::new(DVec3::ZERO, frame))),
            gravity: DVec3::NEG_Z * 9.81,
            drag: 5.0,
            ..Scene::of(rod)
        };
        let mut pber = Pber::new(scene, pber::Settings { substeps: 10, iterations, ..Default::default() }).unwrap();
        (0..200).for_each(|_| pber.step(1.0 / 60.0));
        -pber.positions()[20].z
    };
    let drops = [5, 20, 80].map(tip);
    println!("drop of the tip [m], length 0.15 m, at 5, 20, 80 sweeps: {drops:?}");
    assert!(drops[0] > 1.2 * drops[1] && drops[1] > 1.2 * drops[2], "{drops:?}");
}

/// What cannot be simulated is refused, with the reason.
#[test]
fn refused() {
    let scene = || Scene::of(thread(line(10, 1e-3, DVec3::X)));
    let reason = Pber::new(scene(), pber::Settings { ghost: 1.5, ..Default::default() }).err().unwrap().to_string();
    assert!(reason.contains("stiffness numbers"), "{reason}");
    let reason =
        Pbd::new(Scene { loads: vec![(11, DVec3::X)], ..scene() }, pbd::Settings::default()).err().unwrap().to_string();
    assert!(reason.contains("load on vertex 11"), "{reason}");
    let rod = Rod { young: -1.0, ..scene().rod };
    let reason = Der::new(Scene::of(rod), der::Settings::default()).err().unwrap().to_string();
    assert!(reason.contains("young"), "{reason}");
}
