use super::*;
use glam::DQuat;

const R: f64 = 1e-4;

/// Threads and shapes as plain values, for one state.
#[derive(Default)]
struct Scene {
    rods: Vec<(usize, f64, Vec<DVec3>, Vec<f64>)>,
    shapes: Vec<(usize, Geometry, Pose)>,
}

impl Scene {
    fn with_rod(mut self, slot: usize, radius: f64, x: Vec<DVec3>) -> Self {
        let rest = x.windows(2).map(|w| w[0].distance(w[1])).collect();
        self.rods.push((slot, radius, x, rest));
        self
    }
    fn with_shape(mut self, slot: usize, geometry: Geometry, pose: Pose) -> Self {
        self.shapes.push((slot, geometry, pose));
        self
    }
    fn show(&self, audit: &mut Audit, time: f64) {
        let rods = self.rods.iter().map(|(slot, radius, x, rest)| RodSlice {
            slot: *slot,
            turned: 0,
            radius: *radius,
            positions: x,
            rest_lengths: rest,
        });
        let shapes = self.shapes.iter().map(|(slot, geometry, pose)| ShapeView {
            slot: *slot,
            geometry,
            pose: *pose,
            motion: crate::ShapeMotion::Fixed,
            surface: 0,
            body: None,
        });
        audit.observe_slices(time, rods, shapes, core::iter::empty());
    }
}

/// `n` elements from `from` to `to`.
fn line(from: DVec3, to: DVec3, n: usize) -> Vec<DVec3> {
    (0..=n).map(|i| from.lerp(to, i as f64 / n as f64)).collect()
}

fn shifted(x: &[DVec3], by: DVec3) -> Vec<DVec3> {
    x.iter().map(|p| *p + by).collect()
}

fn across(height: f64) -> Vec<DVec3> {
    line(DVec3::new(0.37e-4, -5e-3, height), DVec3::new(0.41e-4, 5e-3, height), 25)
}

#[test]
fn a_thread_drawn_through_another_in_one_state_is_found_and_a_touch_is_not() {
    let still = line(DVec3::X * -5e-3, DVec3::X * 5e-3, 33);
    let show = |audit: &mut Audit, time, height| {
        Scene::default().with_rod(3, R, still.clone()).with_rod(5, R, across(height)).show(audit, time);
    };
    let mut audit = Audit::new();
    show(&mut audit, 0.0, 3.0 * R);
    show(&mut audit, 0.1, 2.0 * R); // Touches.
    show(&mut audit, 0.2, 4.0 * R);
    assert!(!audit.report().passes_through);
    // Touching is clearance 0; the heights were set exactly, so only round-off is allowed.
    assert!(audit.report().thread_clearance.unwrap().abs() < 1e-12);
    show(&mut audit, 0.3, -4.0 * R);
    let report = audit.report();
    assert!(report.passes_through);
    assert!(
        report.crossings.iter().all(|c| c.time == 0.3 && matches!(c.what, Pair::Threads { a: (3, 16), b: (5, 12) })),
        "{:?}",
        report.crossings
    );
    assert_eq!((report.states, report.crossings.len()), (4, 1));
}

#[test]
fn elements_next_to_each_other_are_left_out_and_a_fold_is_not() {
    // A hairpin of radius r in elements of r / 2: everything within pi r of thread is its own bend.
    let bend: Vec<DVec3> = (0..=6)
        .map(|k| libm::sincos(core::f64::consts::PI * f64::from(k) / 6.0))
        .map(|(s, c)| DVec3::new(s * R, c * R, 0.0))
        .collect();
    let mut hairpin = line(DVec3::new(-20.0 * R, R, 0.0), bend[0], 40);
    hairpin.extend(&bend[1..]);
    hairpin.extend(&line(bend[6], DVec3::new(-20.0 * R, -R, 0.0), 40)[1..]);
    let mut audit = Audit::new();
    Scene::default().with_rod(0, R, hairpin.clone()).show(&mut audit, 0.0);
    // The legs touch side by side. A chord of the polygon bend is shorter than the arc's, by less than the sagitta of
    // its pieces.
    let touch = audit.report().thread_clearance.unwrap();
    assert!(touch.abs() < 0.04, "{touch}");
    // The legs change sides.
    let crossed: Vec<DVec3> =
        hairpin.iter().map(|p| if p.x < -5.0 * R { DVec3::new(p.x, -p.y, p.z) } else { *p }).collect();
    Scene::default().with_rod(0, R, crossed).show(&mut audit, 0.1);
    assert!(audit.report().passes_through);
}

#[test]
fn a_whip_crack_without_contact_is_no_passage() {
    // Two threads fly by each other far and fast, one behind the other: boxes of the sweeps overlap, the threads never
    // do.
    let show = |audit: &mut Audit, time: f64| {
        let along = DVec3::new(0.7, 0.7, 0.0) * time;
        let a = shifted(&across(0.0), along);
        let b = shifted(&across(0.0), along + DVec3::new(2.5 * R, 0.0, 0.0));
        Scene::default().with_rod(0, R, a).with_rod(1, R, b).show(audit, time);
    };
    let mut audit = Audit::new();
    show(&mut audit, 0.0);
    show(&mut audit, 1.0);
    assert!(!audit.report().passes_through);
    // The threads are not quite across the shift: by 4e-4, whose square is the tolerance.
    assert!((audit.report().thread_clearance.unwrap() - 0.25).abs() < 2e-7);
}

#[test]
fn mixed_radii_count_in_mean_diameters() {
    let mut audit = Audit::new();
    let still = line(DVec3::X * -5e-3, DVec3::X * 5e-3, 33);
    Scene::default().with_rod(0, R, still).with_rod(1, 3.0 * R, across(5.0 * R)).show(&mut audit, 0.0);
    assert!((audit.report().thread_clearance.unwrap() - 0.25).abs() < 1e-12);
}

fn solids() -> Vec<(Geometry, f64)> {
    // Each with the height of its top over its origin.
    vec![
        (Geometry::Plane, 0.0),
        (Geometry::Sphere { radius: 1e-3 }, 1e-3),
        (Geometry::Capsule { radius: 1e-3, half_length: 2e-3 }, 3e-3),
        (Geometry::Cylinder { radius: 1e-3, half_length: 2e-3 }, 2e-3),
        (Geometry::Box { half_sides: DVec3::new(1e-3, 1e-3, 2e-3) }, 2e-3),
        (slab(), 2e-4),
    ]
}

/// A thin closed box as a mesh.
fn slab() -> Geometry {
    let vertices =
        (0..8).map(|k| DVec3::new(sign(k & 1) * 2e-3, sign(k >> 1 & 1) * 2e-3, sign(k >> 2) * 2e-4)).collect();
    let triangles = vec![
        [0, 1, 3],
        [0, 3, 2],
        [4, 6, 7],
        [4, 7, 5],
        [0, 4, 5],
        [0, 5, 1],
        [2, 3, 7],
        [2, 7, 6],
        [0, 2, 6],
        [0, 6, 4],
        [1, 5, 7],
        [1, 7, 3],
    ];
    Geometry::Mesh { vertices, triangles }
}

fn sign(bit: u32) -> f64 {
    if bit == 0 { -1.0 } else { 1.0 }
}

#[test]
fn a_thread_laid_on_a_shape_touches_it_and_drawn_through_is_found() {
    let pose = Pose::new(DVec3::new(0.01, 0.02, 0.03), crate::math::exp(DVec3::new(0.3, -0.5, 1.1)));
    for (geometry, top) in solids() {
        let over = |height: f64| line(DVec3::new(0.0, -5e-3, top + height), DVec3::new(0.0, 5e-3, top + height), 25);
        let thread = |height: f64| over(height).into_iter().map(|p| pose.transform_point(p)).collect::<Vec<_>>();
        let show = |audit: &mut Audit, time, height| {
            Scene::default().with_rod(0, R, thread(height)).with_shape(7, geometry.clone(), pose).show(audit, time);
        };
        let mut audit = Audit::new();
        show(&mut audit, 0.0, 8.0 * R);
        assert_eq!(audit.report().shape_clearance, None, "{geometry:?}");
        show(&mut audit, 0.1, R);
        let touching = audit.report().clone();
        // Round-off of the pose over the radius.
        assert!(touching.shape_clearance.unwrap().abs() < 1e-9, "{geometry:?} {:?}", touching.shape_clearance);
        assert!(!touching.passes_through, "{geometry:?}");
        // Beyond the other side in one state.
        show(&mut audit, 0.2, -2.0 * top - 8.0 * R);
        assert!(audit.report().passes_through, "{geometry:?}");
        assert!(matches!(audit.report().crossings[0].what, Pair::Shape { thread: (0, _), shape: 7 }), "{geometry:?}");
    }
}

#[test]
fn a_shape_that_moves_through_a_still_thread_is_found() {
    let thread = across(0.0);
    for (geometry, top) in solids() {
        let show = |audit: &mut Audit, time, height: f64| {
            let pose = Pose::at(DVec3::Z * (height - top));
            Scene::default().with_rod(0, R, thread.clone()).with_shape(0, geometry.clone(), pose).show(audit, time);
        };
        let mut audit = Audit::new();
        show(&mut audit, 0.0, -5.0 * R);
        show(&mut audit, 0.1, -R);
        show(&mut audit, 0.2, -5.0 * R);
        assert!(!audit.report().passes_through, "{geometry:?}");
        show(&mut audit, 0.3, 2.0 * top + 5.0 * R);
        assert!(audit.report().passes_through, "{geometry:?}");
    }
}

#[test]
fn a_turning_blade_sweeps_a_thread() {
    // The blade turns by a right angle about z and its arm passes the thread between the two states.
    let blade = Geometry::Box { half_sides: DVec3::new(5e-3, 1e-4, 1e-3) };
    let thread = line(DVec3::new(3e-3, 3e-3, -2e-3), DVec3::new(3e-3, 3e-3, 2e-3), 20);
    let show = |audit: &mut Audit, time, angle: f64| {
        Scene::default()
            .with_rod(0, R, thread.clone())
            .with_shape(0, blade.clone(), Pose::new(DVec3::ZERO, DQuat::from_rotation_z(angle)))
            .show(audit, time);
    };
    let mut audit = Audit::new();
    show(&mut audit, 0.0, 0.0);
    show(&mut audit, 0.1, 0.3);
    assert!(!audit.report().passes_through);
    show(&mut audit, 0.2, 1.3);
    assert!(audit.report().passes_through);
}

#[test]
fn threads_and_shapes_that_come_and_go_are_taken_up_anew() {
    let still = line(DVec3::X * -5e-3, DVec3::X * 5e-3, 33);
    let mut audit = Audit::new();
    Scene::default().with_rod(0, R, still.clone()).with_rod(1, R, across(4.0 * R)).show(&mut audit, 0.0);
    // The second thread is another one, with another number of particles: it did not come from above.
    let other = line(DVec3::new(0.0, -5e-3, -4.0 * R), DVec3::new(0.0, 5e-3, -4.0 * R), 20);
    Scene::default().with_rod(0, R, still.clone()).with_rod(1, R, other.clone()).show(&mut audit, 0.1);
    // It goes, and the first moves on where it was; a plane appears above.
    let roof = Pose::new(DVec3::Z, DQuat::from_rotation_x(core::f64::consts::PI));
    Scene::default().with_rod(0, R, still.clone()).with_shape(0, Geometry::Plane, roof).show(&mut audit, 0.2);
    Scene::default()
        .with_rod(0, R, shifted(&still, DVec3::Z * -1e-3))
        .with_shape(0, Geometry::Sphere { radius: 1e-4 }, Pose::IDENTITY)
        .show(&mut audit, 0.3);
    assert!(!audit.report().passes_through, "{:?}", audit.report().crossings);
    assert_eq!(audit.report().states, 4);
}

#[test]
fn a_state_that_is_not_finite_is_counted_and_skipped() {
    let still = line(DVec3::X * -5e-3, DVec3::X * 5e-3, 33);
    let show = |audit: &mut Audit, time, height| {
        Scene::default().with_rod(0, R, still.clone()).with_rod(1, R, across(height)).show(audit, time);
    };
    let mut audit = Audit::new();
    show(&mut audit, 0.0, 4.0 * R);
    show(&mut audit, 0.1, f64::NAN);
    // The passage happened between the good states around it.
    show(&mut audit, 0.2, -4.0 * R);
    assert_eq!(audit.report().states_not_finite, 1);
    assert!(audit.report().passes_through);
}

#[test]
fn elongation_is_the_largest_seen_of_each_thread() {
    let mut audit = Audit::new();
    let mut scene = Scene::default().with_rod(2, R, line(DVec3::ZERO, DVec3::X, 10)).with_rod(
        4,
        R,
        line(DVec3::Y, DVec3::Y + DVec3::X, 10),
    );
    scene.show(&mut audit, 0.0);
    scene.rods[1].2[10].x += 0.01; // The last element of 0.1.
    scene.show(&mut audit, 0.1);
    scene.rods[1].2[10].x -= 0.01;
    scene.show(&mut audit, 0.2);
    let e = &audit.report().max_elongation;
    assert_eq!((e[0].0, e[1].0), (2, 4));
    assert!(e[0].1 < 1e-12 && (e[1].1 - 0.1).abs() < 1e-12, "{e:?}");
}

/// What the quick search finds is what a look at all pairs finds, at random states of two tangled threads.
#[test]
fn the_least_clearance_is_that_of_all_pairs() {
    let mut angle = 0.0_f64;
    for seed in 0..20 {
        let mut thread = |n: usize| {
            let mut x = vec![DVec3::new(f64::from(seed) * 3e-5, 0.0, 0.0)];
            for _ in 0..n {
                angle += 2.4;
                let d = DVec3::new(angle.sin(), (1.7 * angle).cos(), (0.6 * angle).sin()).normalize();
                x.push(x[x.len() - 1] + d * 3.3e-4);
            }
            x
        };
        let (a, b) = (thread(40), thread(25));
        let mut least = f64::INFINITY;
        for (i, p) in a.windows(2).enumerate() {
            for q in b.windows(2) {
                least = least.min(segments([p[0], p[1]], [q[0], q[1]]) - 2.0 * R);
            }
            // One element between is 3.3 radii of thread, more than pi.
            for q in a.windows(2).skip(i + 2) {
                least = least.min(segments([p[0], p[1]], [q[0], q[1]]) - 2.0 * R);
            }
        }
        for q in 0..b.len() - 1 {
            for p in q + 2..b.len() - 1 {
                least = least.min(segments([b[p], b[p + 1]], [b[q], b[q + 1]]) - 2.0 * R);
            }
        }
        let mut audit = Audit::new();
        Scene::default().with_rod(0, R, a).with_rod(1, R, b).show(&mut audit, 0.0);
        assert_eq!(audit.report().thread_clearance, (least < 2.0 * R).then_some(least / (2.0 * R)), "{seed}");
    }
}

/// Whether anything passed between two states of one thread and one shape, after the first of them is clean.
fn passes(geometry: &Geometry, from: (&Pose, &[DVec3]), to: (&Pose, &[DVec3])) -> bool {
    let mut audit = Audit::new();
    for (time, (pose, x)) in [from, to].into_iter().enumerate() {
        Scene::default()
            .with_rod(0, R, x.to_vec())
            .with_shape(0, geometry.clone(), *pose)
            .show(&mut audit, time as f64);
        assert!(time > 0 || !audit.report().passes_through, "{geometry:?}");
    }
    audit.report().passes_through
}

/// A still shape and a thread that moves from one place to another.
fn moves_through(geometry: &Geometry, from: &[DVec3], to: &[DVec3]) -> bool {
    passes(geometry, (&Pose::IDENTITY, from), (&Pose::IDENTITY, to))
}

/// A profile (radius, height) turned about z: a tube or a ring with all of its wall.
fn turned(profile: &[(f64, f64)]) -> Geometry {
    let (n, m) = (16, profile.len() as u32);
    let at = |i: u32, (r, z): (f64, f64)| {
        DQuat::from_rotation_z(core::f64::consts::TAU * f64::from(i) / f64::from(n)) * DVec3::new(r, 0.0, z)
    };
    let vertices = (0..n).flat_map(|i| profile.iter().map(move |p| at(i, *p))).collect();
    let number = |i: u32, k: u32| (i % n) * m + k % m;
    let quad = |i: u32, k: u32| {
        [[number(i, k), number(i + 1, k), number(i + 1, k + 1)], [number(i, k), number(i + 1, k + 1), number(i, k + 1)]]
    };
    Geometry::Mesh { vertices, triangles: (0..n).flat_map(|i| (0..m).flat_map(move |k| quad(i, k))).collect() }
}

#[test]
fn what_is_thinner_than_a_step_is_not_missed() {
    // Elements of ten diameters, a plate of half a radius, a wire between two particles, and the way of one state a
    // hundred times that.
    let thread = line(DVec3::new(0.3e-3, -5e-3, 0.0), DVec3::new(0.3e-3, 5e-3, 0.0), 5);
    let plate = Geometry::Box { half_sides: DVec3::new(5e-3, 5e-3, 0.25 * R) };
    let wire = Geometry::Cylinder { radius: 0.5 * R, half_length: 5e-3 };
    let needle = Geometry::Capsule { radius: 0.5 * R, half_length: 5e-3 };
    let lying = DQuat::from_rotation_y(core::f64::consts::FRAC_PI_2);
    for (geometry, orientation) in [(plate, DQuat::IDENTITY), (wire, lying), (needle, lying)] {
        let at = |y: f64, z: f64| Pose::new(DVec3::new(0.0, y, z), orientation);
        for (y, from, to, through) in [
            (0.9e-3, -5e-3, 5e-3, true),
            (0.1e-3, 5e-3, -3e-3, true),
            (0.9e-3, -5e-3, -R, false),
            (0.2e-3, 5e-3, 0.8 * R, false),
        ] {
            assert_eq!(
                passes(&geometry, (&at(y, from), &thread), (&at(y, to), &thread)),
                through,
                "{geometry:?} {from} {to}"
            );
            // Both move, as fast as the shape alone did and across that.
            let carried = shifted(&thread, DVec3::new(4e-3, 0.0, 0.0));
            let moved = Pose::new(DVec3::new(4e-3, y, to), orientation);
            assert_eq!(
                passes(&geometry, (&at(y, from), &thread), (&moved, &carried)),
                through,
                "{geometry:?} {from} {to}"
            );
        }
        // Taken along 30 mm in a state.
        let far = DVec3::new(0.0, 0.0, 0.03);
        let moved = Pose::new(DVec3::new(0.0, 0.0, -1.1 * R) + far, orientation);
        assert!(!passes(&geometry, (&at(0.0, -1.1 * R), &thread), (&moved, &shifted(&thread, far))));
    }
}

#[test]
fn in_a_tube_a_thread_may_go_anywhere_but_through_the_wall() {
    let (a, b, h) = (4.0 * R, 5.0 * R, 2e-3);
    let tube = turned(&[(b, -h), (b, h), (a, h), (a, -h)]);
    let within = line(DVec3::Z * -1e-3, DVec3::Z * 1e-3, 7);
    // The inner wall is a polygon, nearest in the middle of its sides.
    let wall = a * libm::cos(core::f64::consts::PI / 16.0);
    let side = DVec3::new(libm::cos(core::f64::consts::PI / 16.0), libm::sin(core::f64::consts::PI / 16.0), 0.0);
    assert!(!moves_through(&tube, &within, &shifted(&within, DVec3::Z * 1e-2)), "out through the mouth");
    assert!(!moves_through(&tube, &within, &shifted(&within, side * (wall - 0.3 * R))), "pressed deep into the wall");
    assert!(moves_through(&tube, &within, &shifted(&within, side * 7.0 * R)), "out through the wall");
    assert!(moves_through(&tube, &within, &shifted(&within, side * 4.4 * R)), "into the wall");
    let beside = shifted(&within, side * 7.0 * R);
    assert!(
        !moves_through(&tube, &beside, &shifted(&beside, side * -(2.0 * R - 0.3 * R))),
        "pressed deep from outside"
    );
    assert!(moves_through(&tube, &beside, &within), "in through the wall");
    // The tube is drawn off a thread at rest, or dragged across it.
    assert!(!passes(&tube, (&Pose::IDENTITY, &within), (&Pose::at(DVec3::Z * 8e-3), &within)));
    assert!(passes(&tube, (&Pose::IDENTITY, &within), (&Pose::at(side * 20.0 * R), &within)));
}

#[test]
fn through_a_ring_is_no_passage_and_across_it_is() {
    let profile: Vec<(f64, f64)> = (0..8)
        .map(|k| libm::sincos(core::f64::consts::TAU * f64::from(k) / 8.0))
        .map(|(s, c)| (8.0 * R + 2.0 * R * c, 2.0 * R * s))
        .collect();
    let ring = turned(&profile);
    let through = line(DVec3::new(R, 0.0, -3e-3), DVec3::new(0.0, R, 3e-3), 9);
    assert!(!moves_through(&ring, &through, &shifted(&through, DVec3::Z * 5e-3)));
    assert!(moves_through(&ring, &through, &shifted(&through, DVec3::X * 2e-3)));
    // Turned over about its middle, the ring does not touch what goes through there; turned about its rim it does.
    let tip = |angle: f64| Pose::new(DVec3::ZERO, DQuat::from_rotation_x(angle));
    let short = line(DVec3::new(0.0, 0.0, -3.0 * R), DVec3::new(0.0, 0.0, 3.0 * R), 3);
    assert!(!passes(&ring, (&tip(0.0), &short), (&tip(0.4), &short)));
    assert!(passes(&ring, (&tip(1.0), &through), (&tip(2.1), &through)));
}

#[test]
fn around_the_boundary_of_a_sheet_is_no_passage_and_through_it_is() {
    let vertices = vec![
        DVec3::new(-2e-3, -2e-3, 0.0),
        DVec3::new(2e-3, -2e-3, 0.0),
        DVec3::new(2e-3, 2e-3, 0.0),
        DVec3::new(-2e-3, 2e-3, 0.0),
    ];
    let sheet = Geometry::Mesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3]] };
    let above = line(DVec3::new(-1e-3, -3e-3, 5.0 * R), DVec3::new(1e-3, 3e-3, 5.0 * R), 11);
    let (beside, below) = (shifted(&above, DVec3::X * 6e-3), shifted(&above, DVec3::Z * -10.0 * R));
    assert!(moves_through(&sheet, &above, &below));
    assert!(
        !moves_through(&sheet, &above, &beside) && !moves_through(&sheet, &beside, &shifted(&below, DVec3::X * 6e-3))
    );
    assert!(!moves_through(&sheet, &shifted(&below, DVec3::X * 6e-3), &below));
    assert!(!moves_through(&sheet, &above, &shifted(&above, DVec3::Z * -4.7 * R)), "pressed deep");
    // Along its diagonal, where two triangles meet.
    let diagonal = line(DVec3::new(-3e-3, -3e-3, R), DVec3::new(3e-3, 3e-3, R), 11);
    assert!(moves_through(&sheet, &diagonal, &shifted(&diagonal, DVec3::Z * -2.0 * R)));
}

#[test]
fn in_a_container_and_between_two_walls_of_one_mesh() {
    let inside = line(DVec3::new(-1e-3, 0.0, 0.0), DVec3::new(1e-3, 0.0, 0.0), 7);
    let slab = slab();
    assert!(!moves_through(&slab, &inside, &shifted(&inside, DVec3::new(0.5e-3, -1e-3, 0.7 * R))));
    assert!(moves_through(&slab, &inside, &shifted(&inside, DVec3::new(0.0, 0.0, 3.0 * R))));
    // The container moves on without it, or along with it.
    assert!(passes(&slab, (&Pose::IDENTITY, &inside), (&Pose::at(DVec3::Y * 8e-3), &inside)));
    let along = DVec3::new(0.01, 0.02, 0.03);
    assert!(!passes(&slab, (&Pose::IDENTITY, &inside), (&Pose::at(along), &shifted(&inside, along))));
}

#[test]
fn what_turns_beside_a_thread_or_takes_it_along_is_no_passage() {
    // A thread at rest touches a shaft that turns by half a radian between two states: as seen from the shaft the chord
    // of its way is 0.3 mm inside.
    let shaft = Geometry::Cylinder { radius: 1e-2, half_length: 1e-2 };
    let thread = line(DVec3::new(1e-2 + R, -2e-3, 0.0), DVec3::new(1e-2 + R, 2e-3, 0.0), 9);
    let turn = |angle: f64| Pose::new(DVec3::ZERO, DQuat::from_rotation_z(angle));
    assert!(!passes(&shaft, (&turn(0.0), &thread), (&turn(0.5), &thread)));
    // The tip of a blade goes by at a radius.
    let blade = Geometry::Box { half_sides: DVec3::new(1e-2, 1e-4, 1e-3) };
    let near = line(DVec3::new(1e-2 + R, 3e-3, -2e-3), DVec3::new(1e-2 + R, 3e-3, 2e-3), 9);
    assert!(!passes(&blade, (&turn(0.0), &near), (&turn(0.6), &near)));
    let reached = shifted(&near, DVec3::new(-8.0 * R, 0.0, 0.0));
    assert!(passes(&blade, (&turn(0.0), &reached), (&turn(0.6), &reached)));
    // A thread on the flat of the blade goes along with it: as seen from the world the chord of its way is inside.
    let carried = |angle: f64| {
        let on = line(DVec3::new(9.5e-3, 1e-4 + R, -5e-4), DVec3::new(9.5e-3, 1e-4 + R, 5e-4), 5);
        on.iter().map(|p| turn(angle).transform_point(*p)).collect::<Vec<_>>()
    };
    assert!(!passes(&blade, (&turn(0.0), &carried(0.0)), (&turn(0.5), &carried(0.5))));
    // Left behind it is not.
    assert!(passes(&blade, (&turn(0.0), &carried(0.0)), (&turn(0.5), &carried(0.0))));
}

/// Any solid or mesh that moves, turns by up to half a radian and meets a thread that moves: what the audit says is
/// what a look at two thousand instants says, but where the way as seen from the shape or the world tells, or one of
/// them comes nearer than that look can tell.
#[test]
fn moved_shapes_are_seen_as_by_a_look_at_every_instant() {
    let mut state = 1_u64;
    let mut unit = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let mut vector = |size: f64| DVec3::new(unit() - 0.5, unit() - 0.5, unit() - 0.5) * (2.0 * size);
    let (mut passed, mut missed) = (0, 0);
    for number in 0..600 {
        let geometry = solids().swap_remove(1 + number % 5).0;
        let from = Pose::new(vector(1e-3), crate::math::exp(vector(2.0)));
        let to =
            Pose::new(from.position + vector(6e-3), (crate::math::exp(vector(0.3)) * from.orientation).normalize());
        let middle = vector(4e-3);
        let x = line(middle - vector(3e-3), middle + vector(3e-3), 1);
        let y: Vec<DVec3> = x.iter().map(|p| *p + vector(6e-3)).collect();
        let Geometry::Mesh { vertices, triangles } = &geometry else {
            let at = |t: f64, straight_from_shape: bool| {
                let pose = from.interpolate(&to, t);
                let world = [0, 1].map(|i| pose.inverse_transform_point(x[i].lerp(y[i], t)));
                let own = [0, 1].map(|i| from.inverse_transform_point(x[i]).lerp(to.inverse_transform_point(y[i]), t));
                segment_solid(if straight_from_shape { own } else { world }, &geometry)
            };
            let least = |own: bool| (0..=2000).map(|i| at(f64::from(i) / 2000.0, own)).fold(f64::INFINITY, f64::min);
            if at(0.0, true) <= 0.0 {
                continue;
            }
            // The nearest instant is missed by a thousandth of a way of some 20 mm at most.
            let (own, world) = (least(true), least(false));
            let nearest = own.max(world);
            if nearest.abs() > 1e-5 {
                assert_eq!(passes(&geometry, (&from, &x), (&to, &y)), nearest < 0.0, "{number}: {own} {world}");
                (passed, missed) = (passed + i32::from(nearest < 0.0), missed + i32::from(nearest > 0.0));
            }
            continue;
        };
        let pierced = |t: f64| {
            let pose = from.interpolate(&to, t);
            let p = [0, 1].map(|i| pose.inverse_transform_point(x[i].lerp(y[i], t)));
            triangles.iter().map(|c| segment_triangle(p, c.map(|v| vertices[v as usize]))).fold(f64::INFINITY, f64::min)
        };
        if pierced(0.0) < TOUCHING * R {
            continue;
        }
        let least = (0..=2000).map(|i| pierced(f64::from(i) / 2000.0)).fold(f64::INFINITY, f64::min);
        // What stays this far off either way is no passage; what goes in to stay or comes out at the other side is one.
        let found = passes(&geometry, (&from, &x), (&to, &y));
        if least > 5e-4 {
            assert!(!found, "{number}: {least}");
            missed += 1;
        } else if pierced(1.0) == 0.0 {
            assert!(found, "{number}");
            passed += 1;
        }
    }
    assert!(passed > 30 && missed > 30, "{passed} {missed}");
}
