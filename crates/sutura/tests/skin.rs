//! The skin of threads and the meshes of shapes: closed, outward, of the right size, and true to the thread that they
//! follow.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};
use sutura::glam::{DQuat, DVec2, DVec3, Mat4, Quat, Vec3};
use sutura::skin::{Blend, Bone, Skin, SkinSpec, TriangleMesh, shape_mesh};
use sutura::{Closure, Geometry, Material, Profile, RodSpec, Section, Settings, World};

const R: f64 = 1e-4;

fn vector(x: [f32; 3]) -> DVec3 {
    Vec3::from(x).as_dvec3()
}

/// Euler characteristic of the surface, vertices at one place taken as one; fails where an edge does not have one
/// triangle on each side.
fn euler(mesh: &TriangleMesh, positions: &[[f32; 3]]) -> i64 {
    // Vertices that are meant to be one are nearer than a thousandth of a radius, others farther apart.
    let mut one: Vec<usize> = Vec::new();
    for (i, x) in positions.iter().enumerate() {
        let same = (0..i).find(|k| one[*k] == *k && (vector(*x) - vector(positions[*k])).length() < 1e-3 * R);
        one.push(same.unwrap_or(i));
    }
    let key = |i: u32| one[i as usize];
    let mut edges: BTreeMap<_, [i32; 2]> = BTreeMap::new();
    let mut corners = BTreeMap::new();
    for t in &mesh.triangles {
        for k in 0..3 {
            let (a, b) = (key(t[k]), key(t[(k + 1) % 3]));
            assert_ne!(a, b, "a triangle without area");
            corners.insert(a, ());
            edges.entry((a.min(b), a.max(b))).or_default()[usize::from(a < b)] += 1;
        }
    }
    assert!(edges.values().all(|sides| *sides == [1, 1]), "an edge with other than a triangle on each side");
    corners.len() as i64 - edges.len() as i64 + mesh.triangles.len() as i64
}

/// Volume within \[m^3\]: positive where triangles look outward.
fn volume(mesh: &TriangleMesh, positions: &[[f32; 3]]) -> f64 {
    let at = |i: u32| vector(positions[i as usize]);
    mesh.triangles.iter().map(|t| at(t[0]).dot(at(t[1]).cross(at(t[2]))) / 6.0).sum()
}

/// Normals are of unit length and on the outer side of each triangle.
fn looks_outward(mesh: &TriangleMesh, positions: &[[f32; 3]], normals: &[[f32; 3]], least: f64) {
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|i| vector(positions[i as usize]));
        let face = (b - a).cross(c - a).normalize();
        for i in t {
            let n = vector(normals[*i as usize]);
            assert!((n.length() - 1.0).abs() < 1e-6, "a normal of length {}", n.length());
            assert!(n.dot(face) > least, "a normal {:.3} against its triangle", n.dot(face));
        }
    }
}

struct Posed {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
}

fn pose(skin: &Skin, positions: &[DVec3], orientations: &[DQuat]) -> Posed {
    let mut bones = vec![Bone::default(); skin.n_bones()];
    skin.bones_at(positions, orientations, &mut bones);
    let n = skin.n_vertices();
    let mut posed = Posed { positions: vec![[0.0; 3]; n], normals: vec![[0.0; 3]; n] };
    skin.pose(&bones, &mut posed.positions, &mut posed.normals);
    posed
}

/// Rows of a round tube with 12 sides without its ends: center and vertices.
fn rows(skin: &Skin, posed: &Posed, rings: usize) -> Vec<(DVec3, Vec<DVec3>)> {
    let n_rows = skin.n_elements() * rings + 1;
    let caps = (skin.n_vertices() / 13 - n_rows) / 2;
    let row = |x: &[[f32; 3]]| {
        let x: Vec<DVec3> = x[..12].iter().map(|x| vector(*x)).collect();
        (x.iter().sum::<DVec3>() / 12.0, x)
    };
    posed.positions.chunks(13).skip(caps).take(n_rows).map(row).collect()
}

/// Smallest and largest distance of vertices from the centerline, across it, over the radius; without a few rows at the
/// ends.
fn thickness(rows: &[(DVec3, Vec<DVec3>)], leave_out: usize) -> (f64, f64) {
    let (mut least, mut most) = (f64::INFINITY, 0.0f64);
    for i in leave_out..rows.len() - leave_out {
        let along = (rows[i + 1].0 - rows[i - 1].0).normalize();
        for x in &rows[i].1 {
            let off = *x - rows[i].0;
            let across = (off - along * off.dot(along)).length() / R;
            (least, most) = (least.min(across), most.max(across));
        }
    }
    (least, most)
}

/// A thread of `n` elements of length `element` on an arc of this radius, without twist; in diameters.
fn arc(n: usize, element: f64, radius: f64) -> (Vec<DVec3>, Vec<DQuat>, Vec<f64>) {
    let turn = 2.0 * (0.5 * element / radius).asin();
    let at = |k: f64, r: f64| DVec3::new(r * (turn * k).cos(), 0.0, r * (turn * k).sin()) * (2.0 * R);
    // From the origin on, so that single precision suffices for a bend that is nearly none.
    let positions = (0..=n).map(|k| at(k as f64, radius) - at(0.0, radius)).collect();
    // Turned by an angle of no meaning, so that no vertex lies just in the plane of the bend.
    let frame = |k: usize| DQuat::from_rotation_y(-turn * (k as f64 + 0.5)) * DQuat::from_rotation_z(0.1);
    (positions, (0..n).map(frame).collect(), vec![element * 2.0 * R; n])
}

#[test]
fn a_straight_tube_is_a_closed_surface_of_the_right_size() {
    let spec = SkinSpec { sides: 24, ..SkinSpec::new(vec![3e-4, 2e-4, 5e-4], R) };
    let skin = Skin::new(&spec).unwrap();
    let mesh = skin.mesh();
    assert_eq!(euler(mesh, &mesh.positions), 2);
    looks_outward(mesh, &mesh.positions, &mesh.normals, 0.8);
    // The polygon of 24 sides has 0.9886 of the circle's area; the ends are two halves of a ball, coarser.
    let exact = PI * R * R * 1e-3 + 4.0 / 3.0 * PI * R * R * R;
    let ratio = volume(mesh, &mesh.positions) / exact;
    assert!((0.985..0.9886).contains(&ratio), "{ratio}");
    for (x, n) in mesh.positions.iter().zip(&mesh.normals) {
        let x = vector(*x);
        let off = x - DVec3::Z * x.z.clamp(0.0, 1e-3);
        assert!((off.length() / R - 1.0).abs() < 1e-5, "{x} is {} radii from the axis", off.length() / R);
        assert!((off.normalize() - vector(*n)).length() < 1e-4);
    }
}

#[test]
fn a_square_of_texture_is_a_square_on_the_thread() {
    let spec = SkinSpec { sides: 64, ..SkinSpec::new(vec![2e-4; 10], R) };
    let skin = Skin::new(&spec).unwrap();
    let (mesh, mut seen) = (skin.mesh(), 0);
    for t in &mesh.triangles {
        let x = t.map(|i| vector(mesh.positions[i as usize]));
        if x.iter().any(|x| !(0.0..=2e-3).contains(&x.z)) {
            continue;
        }
        let uv = t.map(|i| mesh.uvs[i as usize].map(f64::from));
        for (a, b) in [(0, 1), (1, 2), (2, 0)] {
            let length = DVec2::new(uv[b][0] - uv[a][0], uv[b][1] - uv[a][1]).length() * TAU * R;
            assert!((length / (x[b] - x[a]).length() - 1.0).abs() < 2e-3, "{length} for {}", (x[b] - x[a]).length());
            seen += 1;
        }
    }
    assert!(seen > 1000);
}

#[test]
fn straight_and_gently_curved_threads_keep_their_radius() {
    for (element, radius) in [(1.0, 1e4), (1.0, 10.0), (2.0, 10.0), (3.0, 10.0), (0.5, 3.0), (1.0, 3.0)] {
        let (x, q, lengths) = arc(20, element, radius);
        let skin = Skin::new(&SkinSpec::new(lengths, R)).unwrap();
        let (least, most) = thickness(&rows(&skin, &pose(&skin, &x, &q), 4), 5);
        println!("element {element}, bend {radius} diameters: {least:.4} to {most:.4}");
        assert!(least > 0.98 && most < 1.02, "element {element}, bend {radius}: {least} to {most}");
    }
}

#[test]
fn a_bend_of_one_diameter_keeps_its_radius_by_the_law_of_linear_blending() {
    for element in [0.25, 0.5, 0.75, 1.0] {
        let (x, q, lengths) = arc(20, element, 1.0);
        let skin = Skin::new(&SkinSpec::new(lengths.clone(), R)).unwrap();
        let (least, most) = thickness(&rows(&skin, &pose(&skin, &x, &q), 4), 9);
        // Blending takes cos(a / 2) of the width in the plane; the scale gives each way half of that back.
        let law = (0.5f64 * element).asin().cos().sqrt();
        println!("element {element} diameters: {least:.4} to {most:.4}, law {law:.4} to {:.4}", 1.0 / law);
        assert!(least > 0.92 && most < 1.08, "element {element}: {least} to {most}");
        // No vertex lies just in the plane of the bend, so that it is a little less thin than the law says there.
        assert!(least > law - 1e-3 && most < 1.0 / law + 1e-3, "element {element}: {least} to {most}");
        // The weights of the paper thin more: what these were chosen for.
        let printed = Skin::new(&SkinSpec { blend: Blend::InverseDistance, ..SkinSpec::new(lengths, R) }).unwrap();
        let (thin, _) = thickness(&rows(&printed, &pose(&printed, &x, &q), 4), 9);
        println!("   inverse distance: {thin:.4}");
        assert!(1.0 - thin > 4.0 * (1.0 - least), "element {element}: {thin}");
    }
}

#[test]
fn the_coarse_elements_of_a_tight_knot_keep_their_radius() {
    // Elements of two diameters that turn by 70 and by 82 degrees, as in the scene `square_knot` when it is tied, and
    // while it is drawn.
    for (turn, bound) in [(70.0f64, 0.11), (82.0, 0.16)] {
        let (x, q, lengths) = arc(16, 2.0, 1.0 / (0.5 * turn.to_radians()).sin());
        let skin = Skin::new(&SkinSpec::new(lengths, R)).unwrap();
        let (least, most) = thickness(&rows(&skin, &pose(&skin, &x, &q), 4), 9);
        println!("turns of {turn} degrees: {least:.4} to {most:.4}");
        assert!(least > 1.0 - bound && most < 1.0 + bound, "turns of {turn}: {least} to {most}");
    }
}

#[test]
fn a_bend_has_no_edges() {
    // Turn of the line of centers from one row to the next where 60 degrees lie between elements, rows being a 16th of
    // an element apart.
    let (x, q, lengths) = arc(12, 1.0, 1.0);
    let skin = Skin::new(&SkinSpec { rings: 16, ..SkinSpec::new(lengths, R) }).unwrap();
    let rows = rows(&skin, &pose(&skin, &x, &q), 16);
    let inner = &rows[32..rows.len() - 32];
    let sharpest = inner.windows(3).map(|w| (w[1].0 - w[0].0).angle_between(w[2].0 - w[1].0)).fold(0.0, f64::max);
    // Evenly spread it would be 3.75 degrees.
    assert!(sharpest < 2.0 * PI / 3.0 / 16.0, "{} degrees", sharpest.to_degrees());
}

/// What a graphics processor does with joints, weights and inverse bind matrices.
#[test]
fn posing_is_linear_blending_of_each_vertex() {
    for (blend, seam) in [
        (Blend::Smooth, None),
        (Blend::InverseDistance, None),
        (Blend::Smooth, Some(0.4)),
        (Blend::InverseDistance, Some(0.4)),
    ] {
        let (x, q, lengths) = arc(8, 1.0, 2.0);
        let size = Profile(vec![(0.0, 1.0), (1e-3, 0.5)]);
        let skin = Skin::new(&SkinSpec {
            blend,
            seam,
            size,
            section: Section::Ellipse([R, 0.6 * R]),
            ..SkinSpec::new(lengths, R)
        })
        .unwrap();
        let mut bones = vec![Bone::default(); skin.n_bones()];
        skin.bones_at(&x, &q, &mut bones);
        let matrices: Vec<Mat4> = bones
            .iter()
            .zip(skin.bind())
            .map(|(b, z)| {
                Mat4::from_scale_rotation_translation(Vec3::new(b.scale, b.scale, b.stretch), b.orientation, b.position)
                    * Mat4::from_translation(Vec3::Z * (-*z as f32))
            })
            .collect();
        let posed = pose(&skin, &x, &q);
        for i in 0..skin.n_vertices() {
            let (joints, weights) = (skin.joints()[i], skin.weights()[i]);
            assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-6);
            let mut m = Mat4::ZERO;
            for k in 0..4 {
                m += matrices[usize::from(joints[k])] * weights[k];
            }
            let there = m.transform_point3(Vec3::from(skin.mesh().positions[i]));
            assert!((there - Vec3::from(posed.positions[i])).length() < 1e-3 * R as f32, "{blend:?}: vertex {i}");
            let normal = m.inverse().transpose().transform_vector3(Vec3::from(skin.mesh().normals[i])).normalize();
            assert!((normal - Vec3::from(posed.normals[i])).length() < 1e-4, "{blend:?}: normal {i}");
        }
    }
}

#[test]
fn elements_that_are_stretched_each_its_own_way_are_drawn_from_particle_to_particle() {
    let lengths = vec![3e-4; 6];
    let mut x = vec![DVec3::ZERO];
    for stretch in [1.4, 0.7, 1.0, 1.02, 1.5, 0.5] {
        x.push(x[x.len() - 1] + DVec3::Z * (3e-4 * stretch));
    }
    for blend in [Blend::Smooth, Blend::InverseDistance] {
        let spec = SkinSpec { blend, sides: 12, rings: 4, ..SkinSpec::new(lengths.clone(), R) };
        let skin = Skin::new(&spec).unwrap();
        let posed = pose(&skin, &x, &[DQuat::IDENTITY; 6]);
        looks_outward(skin.mesh(), &posed.positions, &posed.normals, 0.5);
        if blend == Blend::Smooth {
            for (row, x) in rows(&skin, &posed, 4).iter().step_by(4).zip(&x) {
                assert!((row.0 - *x).length() < 1e-3 * R, "{} instead of {x}", row.0);
            }
        }
    }
}

#[test]
fn a_thread_of_true_size_far_from_the_origin_keeps_its_radius() {
    // A meter from the origin a coordinate is good to 6e-8 m, a sixteen-hundredth of this radius.
    let n = 200;
    let at = DVec3::new(0.6, -0.5, 0.7);
    let along = DVec3::new(0.48, 0.6, 0.64);
    let q = DQuat::from_rotation_arc(DVec3::Z, along);
    let x: Vec<DVec3> = (0..=n).map(|k| at + along * (1e-3 * f64::from(k))).collect();
    let skin = Skin::new(&SkinSpec::new(vec![1e-3; 200], R)).unwrap();
    let (least, most) = thickness(&rows(&skin, &pose(&skin, &x, &vec![q; 200]), 4), 1);
    assert!(least > 0.998 && most < 1.002, "{least} to {most}");
}

#[test]
fn twist_of_the_frames_turns_the_skin() {
    let n = 40;
    let x: Vec<DVec3> = (0..=n).map(|k| DVec3::Z * (2e-4 * k as f64)).collect();
    let q: Vec<DQuat> = (0..n).map(|k| DQuat::from_rotation_z(0.1 * k as f64)).collect();
    let skin = Skin::new(&SkinSpec::new(vec![2e-4; n], R)).unwrap();
    let rows = rows(&skin, &pose(&skin, &x, &q), 4);
    // In the middle of an element, away from the ends, the first vertex lies along its d1.
    for e in 2..n - 2 {
        let off = rows[4 * e + 2].1[0] - rows[4 * e + 2].0;
        let angle = (off.y.atan2(off.x) - 0.1 * e as f64).rem_euclid(TAU);
        assert!(angle.min(TAU - angle) < 1e-5, "element {e}: {angle}");
    }
}

#[test]
fn a_closed_thread_has_no_ends_and_no_seam() {
    for (twist, blend) in
        [(0.0, Blend::Smooth), (TAU * 1.25, Blend::Smooth), (1.0, Blend::Smooth), (TAU * 1.25, Blend::InverseDistance)]
    {
        let ring = RodSpec::ring(DVec3::ZERO, DVec3::Z, DVec3::X * 2e-3, 30, R, Material::elastic(1e9, 1150.0));
        let mut world = World::new(Settings::default()).unwrap();
        let rod = world.insert_rod(&RodSpec { closure: Some(Closure { twist }), ..ring }).unwrap();
        let view = world.rod(rod).unwrap();
        let skin = Skin::new(&SkinSpec { blend, ..SkinSpec::of(&view) }).unwrap();
        let posed = pose(&skin, view.positions(), view.orientations());
        assert_eq!(euler(skin.mesh(), &posed.positions), 0, "a torus");
        looks_outward(skin.mesh(), &posed.positions, &posed.normals, 0.8);
        // Rows turn evenly all the way around, the seam not excepted.
        let rows = rows(&skin, &posed, 4);
        let angle = |i: usize| {
            let off = rows[i].1[0] - rows[i].0;
            off.z.atan2(off.dot(rows[i].0.normalize()))
        };
        let turns: Vec<f64> = (1..rows.len()).map(|i| (angle(i) - angle(i - 1) + PI).rem_euclid(TAU) - PI).collect();
        let most = turns.iter().map(|t| t.abs()).fold(0.0, f64::max);
        // A turn that is no whole number of sides is rounded: at most half of one of twelve sides is made up for at the
        // seam, over eight rows.
        assert!(most < 3.0 * twist.abs() / 120.0 + PI / 12.0, "twist {twist}, {blend:?}: {most} a row");
        let whole = skin.mesh().uvs.last().unwrap()[1];
        assert!((whole - whole.round()).abs() < 1e-4 && whole >= 1.0, "texture along: {whole}");
    }
}

#[test]
fn sections_and_sizes_are_those_of_the_thread() {
    let material = Material::elastic(1e9, 1150.0);
    let straight = RodSpec::straight(DVec3::ZERO, DVec3::Z * 4e-3, 20, R, material);
    let mut tapered = RodSpec { section: Section::Rectangle([4e-4, 1e-4]), ..straight };
    tapered.along.size = Profile(vec![(0.0, 1.0), (4e-3, 0.5)]);
    let mut world = World::new(Settings::default()).unwrap();
    let rod = world.insert_rod(&tapered).unwrap();
    let view = world.rod(rod).unwrap();
    let skin = Skin::new(&SkinSpec::of(&view)).unwrap();
    let posed = pose(&skin, view.positions(), view.orientations());
    assert_eq!(euler(skin.mesh(), &posed.positions), 2);
    looks_outward(skin.mesh(), &posed.positions, &posed.normals, 0.99);
    // A frustum: V = L (A0 + A1 + sqrt(A0 A1)) / 3.
    let (a0, a1) = (4e-8, 1e-8f64);
    let exact = 4e-3 * (a0 + a1 + (a0 * a1).sqrt()) / 3.0;
    assert!((volume(skin.mesh(), &posed.positions) / exact - 1.0).abs() < 1e-4);

    let ellipse =
        Skin::new(&SkinSpec { section: Section::Ellipse([2.0 * R, R]), sides: 48, ..SkinSpec::new(vec![1e-3], R) })
            .unwrap();
    let mesh = ellipse.mesh();
    assert_eq!(euler(mesh, &mesh.positions), 2);
    looks_outward(mesh, &mesh.positions, &mesh.normals, 0.8);
    let exact = PI * 2.0 * R * R * 1e-3 + 4.0 / 3.0 * PI * 2.0 * R * R * R;
    let ratio = volume(mesh, &mesh.positions) / exact;
    assert!((0.993..0.9972).contains(&ratio), "{ratio}");
}

#[test]
fn posing_allocates_nothing() {
    let (x, q, lengths) = arc(50, 1.0, 5.0);
    let skin = Skin::new(&SkinSpec::new(lengths, R)).unwrap();
    let mut bones = vec![Bone::default(); skin.n_bones()];
    let (mut positions, mut normals) = (vec![[0.0; 3]; skin.n_vertices()], vec![[0.0; 3]; skin.n_vertices()]);
    let info = allocation_counter::measure(|| {
        skin.bones_at(&x, &q, &mut bones);
        skin.pose(&bones, &mut positions, &mut normals);
    });
    assert_eq!(info.count_total, 0);
    assert!(positions.iter().all(|x| *x != [0.0; 3]));
}

#[test]
fn shapes_are_closed_outward_and_of_the_right_size() {
    let (r, h) = (5e-3, 1e-2);
    let sphere = 4.0 / 3.0 * PI * r * r * r;
    let cylinder = PI * r * r * 2.0 * h;
    let sides = DVec3::new(1e-3, 2e-3, 3e-3);
    for (geometry, exact, least) in [
        (Geometry::Sphere { radius: r }, sphere, 0.99),
        (Geometry::Capsule { radius: r, half_length: h }, sphere + cylinder, 0.99),
        (Geometry::Cylinder { radius: r, half_length: h }, cylinder, 0.995),
        (Geometry::Box { half_sides: sides }, 8.0 * sides.x * sides.y * sides.z, 0.999_99),
    ] {
        let mesh = shape_mesh(&geometry, 64, 1.0);
        assert_eq!(euler(&mesh, &mesh.positions), 2, "{geometry:?}");
        looks_outward(&mesh, &mesh.positions, &mesh.normals, 0.9);
        let ratio = volume(&mesh, &mesh.positions) / exact;
        assert!(ratio > least && ratio < 1.000_01, "{geometry:?}: {ratio}");
        let along = |k: usize| mesh.positions.iter().map(|x| f64::from(x[k])).fold(0.0, f64::max);
        let wanted = match geometry {
            Geometry::Sphere { .. } => DVec3::splat(r),
            Geometry::Capsule { .. } => DVec3::new(r, r, r + h),
            Geometry::Cylinder { .. } => DVec3::new(r, r, h),
            _ => sides,
        };
        for k in 0..3 {
            assert!((along(k) / wanted[k] - 1.0).abs() < 2e-3, "{geometry:?}: {} along axis {k}", along(k));
        }
    }
    // A box has a normal for each face at each corner; a ball is smooth.
    assert_eq!(shape_mesh(&Geometry::Box { half_sides: sides }, 8, 1.0).positions.len(), 24);
    let ball = shape_mesh(&Geometry::Sphere { radius: r }, 32, 1.0);
    assert!(ball.positions.iter().zip(&ball.normals).all(|(x, n)| vector(*x).normalize().dot(vector(*n)) > 0.999));
    let plane = shape_mesh(&Geometry::Plane, 8, 0.1);
    assert_eq!(plane.normals, vec![[0.0, 0.0, 1.0]; 4]);
    looks_outward(&plane, &plane.positions, &plane.normals, 0.999);
    let vertices = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::ONE];
    let open = shape_mesh(&Geometry::Mesh { vertices, triangles: vec![[0, 1, 2], [1, 3, 2], [0, 0, 1]] }, 8, 1.0);
    assert_eq!(open.triangles.len(), 2, "what has no area is left out");
}

#[test]
fn what_makes_no_tube_is_refused() {
    let good = SkinSpec::new(vec![1e-3; 3], R);
    for bad in [
        SkinSpec { lengths: vec![], ..good.clone() },
        SkinSpec { lengths: vec![1e-3, 0.0], ..good.clone() },
        SkinSpec { radius: f64::NAN, ..good.clone() },
        SkinSpec { sides: 2, ..good.clone() },
        SkinSpec { rings: 0, ..good.clone() },
        SkinSpec { seam: Some(f64::INFINITY), ..good.clone() },
        SkinSpec { lengths: vec![1e-3; 2], seam: Some(0.0), ..good.clone() },
        SkinSpec { section: Section::Ellipse([R, -R]), ..good.clone() },
        SkinSpec { size: Profile(vec![(0.0, 0.0)]), ..good.clone() },
    ] {
        assert!(Skin::new(&bad).is_err(), "{bad:?}");
    }
    assert!(Skin::new(&good).is_ok());
    let one = Skin::new(&SkinSpec::new(vec![1e-3], R)).unwrap();
    assert_eq!((one.n_bones(), Quat::IDENTITY), (1, Bone::default().orientation));
}
