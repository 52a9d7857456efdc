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
        let rods = self.rods.iter().map(|(slot, radius, x, rest)| RodSlice { slot: *slot, radius: *radius, positions: x, rest_lengths: rest });
        let shapes =
            self.shapes.iter().map(|(slot, geometry, pose)| ShapeView { slot: *slot, geometry, pose: *pose, motion: crate::ShapeMotion::Fixed, surface: 0 });
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
    let show = |audit: &mut Audit, time, height| Scene::default().with_rod(3, R, still.clone()).with_rod(5, R, across(height)).show(audit, time);
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
    assert!(report.crossings.iter().all(|c| c.time == 0.3 && matches!(c.what, Pair::Threads { a: (3, 16), b: (5, 12) })), "{:?}", report.crossings);
    assert_eq!((report.states, report.crossings.len()), (4, 1));
}

#[test]
fn elements_next_to_each_other_are_left_out_and_a_fold_is_not() {
    // A hairpin of radius r in elements of r / 2: everything within pi r of thread is its own bend.
    let bend: Vec<DVec3> = (0..=6).map(|k| libm::sincos(core::f64::consts::PI * f64::from(k) / 6.0)).map(|(s, c)| DVec3::new(s * R, c * R, 0.0)).collect();
    let mut hairpin = line(DVec3::new(-20.0 * R, R, 0.0), bend[0], 40);
    hairpin.extend(&bend[1..]);
    hairpin.extend(&line(bend[6], DVec3::new(-20.0 * R, -R, 0.0), 40)[1..]);
    let mut audit = Audit::new();
    Scene::default().with_rod(0, R, hairpin.clone()).show(&mut audit, 0.0);
    // The legs touch side by side. A chord of the polygon bend is shorter than the arc's, by less than the sagitta of its pieces.
    let touch = audit.report().thread_clearance.unwrap();
    assert!(touch.abs() < 0.04, "{touch}");
    // The legs change sides.
    let crossed: Vec<DVec3> = hairpin.iter().map(|p| if p.x < -5.0 * R { DVec3::new(p.x, -p.y, p.z) } else { *p }).collect();
    Scene::default().with_rod(0, R, crossed).show(&mut audit, 0.1);
    assert!(audit.report().passes_through);
}

#[test]
fn a_whip_crack_without_contact_is_no_passage() {
    // Two threads fly by each other far and fast, one behind the other: boxes of the sweeps overlap, the threads never do.
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
    let vertices = (0..8).map(|k| DVec3::new(sign(k & 1) * 2e-3, sign(k >> 1 & 1) * 2e-3, sign(k >> 2) * 2e-4)).collect();
    let triangles = vec![[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]];
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
        let show = |audit: &mut Audit, time, height| Scene::default().with_rod(0, R, thread(height)).with_shape(7, geometry.clone(), pose).show(audit, time);
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
        Scene::default().with_rod(0, R, thread.clone()).with_shape(0, blade.clone(), Pose::new(DVec3::ZERO, DQuat::from_rotation_z(angle))).show(audit, time);
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
    Scene::default().with_rod(0, R, shifted(&still, DVec3::Z * -1e-3)).with_shape(0, Geometry::Sphere { radius: 1e-4 }, Pose::IDENTITY).show(&mut audit, 0.3);
    assert!(!audit.report().passes_through, "{:?}", audit.report().crossings);
    assert_eq!(audit.report().states, 4);
}

#[test]
fn a_state_that_is_not_finite_is_counted_and_skipped() {
    let still = line(DVec3::X * -5e-3, DVec3::X * 5e-3, 33);
    let show = |audit: &mut Audit, time, height| Scene::default().with_rod(0, R, still.clone()).with_rod(1, R, across(height)).show(audit, time);
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
    let mut scene = Scene::default().with_rod(2, R, line(DVec3::ZERO, DVec3::X, 10)).with_rod(4, R, line(DVec3::Y, DVec3::Y + DVec3::X, 10));
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
