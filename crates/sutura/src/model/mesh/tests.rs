use super::*;
use core::f64::consts::TAU;
use proptest::prelude::*;

type Mesh = (Vec<DVec3>, Vec<[u32; 3]>);

/// A ball with bumps, from rings of triangles between two poles; normals outward.
fn ball(rings: usize, around: usize, bumps: [f64; 3]) -> Mesh {
    let radius = |p: DVec3| 1.0 + 0.1 * (bumps[0] * p.x * p.y + bumps[1] * p.z * p.x + bumps[2] * p.y);
    let mut vertices = vec![DVec3::Z, DVec3::NEG_Z];
    for i in 1..=rings {
        let (sin, cos) = (0.5 * TAU * i as f64 / (rings + 1) as f64).sin_cos();
        vertices.extend((0..around).map(|k| {
            let turn = TAU * k as f64 / around as f64;
            DVec3::new(sin * turn.cos(), sin * turn.sin(), cos)
        }));
    }
    let at = |i: usize, k: usize| (2 + i * around + k % around) as u32;
    let mut triangles = Vec::new();
    for k in 0..around {
        triangles.push([0, at(0, k), at(0, k + 1)]);
        triangles.push([1, at(rings - 1, k + 1), at(rings - 1, k)]);
        for i in 0..rings - 1 {
            triangles.push([at(i, k), at(i + 1, k), at(i + 1, k + 1)]);
            triangles.push([at(i, k), at(i + 1, k + 1), at(i, k + 1)]);
        }
    }
    (vertices.into_iter().map(|p| p * radius(p)).collect(), triangles)
}

/// A tube about z without caps.
fn tube(rings: usize, around: usize, length: f64) -> Mesh {
    let mut vertices = Vec::new();
    for i in 0..=rings {
        vertices.extend((0..around).map(|k| {
            let turn = TAU * k as f64 / around as f64;
            DVec3::new(turn.cos(), turn.sin(), length * i as f64 / rings as f64)
        }));
    }
    let at = |i: usize, k: usize| (i * around + k % around) as u32;
    let mut triangles = Vec::new();
    for i in 0..rings {
        for k in 0..around {
            triangles.push([at(i, k), at(i, k + 1), at(i + 1, k + 1)]);
            triangles.push([at(i, k), at(i + 1, k + 1), at(i + 1, k)]);
        }
    }
    (vertices, triangles)
}

fn cube(at: DVec3, half: f64) -> Mesh {
    let sign = |b: u32| if b == 0 { -half } else { half };
    let vertices = (0..8).map(|k| at + DVec3::new(sign(k & 1), sign(k >> 1 & 1), sign(k >> 2))).collect();
    let triangles = vec![
        [0, 3, 1],
        [0, 2, 3],
        [4, 7, 6],
        [4, 5, 7],
        [0, 5, 4],
        [0, 1, 5],
        [2, 7, 3],
        [2, 6, 7],
        [0, 6, 2],
        [0, 4, 6],
        [1, 7, 5],
        [1, 3, 7],
    ];
    (vertices, triangles)
}

fn together(a: Mesh, b: &Mesh) -> Mesh {
    let (mut vertices, mut triangles) = a;
    let n = vertices.len() as u32;
    vertices.extend(&b.0);
    triangles.extend(b.1.iter().map(|t| t.map(|c| c + n)));
    (vertices, triangles)
}

fn inside_out((vertices, triangles): Mesh) -> Mesh {
    (vertices, triangles.into_iter().map(|[a, b, c]| [a, c, b]).collect())
}

fn passed((vertices, triangles): &Mesh) -> CheckedMesh {
    check(vertices, triangles, false).unwrap()
}

fn refused((vertices, triangles): &Mesh) -> (String, String) {
    match check(vertices, triangles, false).unwrap_err() {
        Error::Invalid { field, value, .. } => (field, value),
        e => panic!("{e}"),
    }
}

/// The triangles, each beginning with its least corner, in order.
fn canonical(triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let mut all: Vec<[u32; 3]> = triangles
        .iter()
        .map(|&[a, b, c]| {
            let least = a.min(b).min(c);
            if least == a {
                [a, b, c]
            } else if least == b {
                [b, c, a]
            } else {
                [c, a, b]
            }
        })
        .collect();
    all.sort_unstable();
    all
}

fn volume(m: &CheckedMesh) -> f64 {
    m.triangles.iter().map(|t| t.map(|c| m.vertices[c as usize])).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
}

fn mesh() -> impl Strategy<Value = Mesh> {
    let numbers = (1_usize..6, 3_usize..9, [-1.0..1.0, -1.0..1.0, -1.0..1.0], any::<u64>());
    numbers.prop_map(|(rings, around, bumps, seed)| {
        let (vertices, mut triangles) = ball(rings, around, bumps);
        // In any order, beginning with any corner.
        let mut s = seed | 1;
        let mut next = |n: usize| {
            s = s.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (s >> 33) as usize % n
        };
        for i in (1..triangles.len()).rev() {
            triangles.swap(i, next(i + 1));
            triangles[i].rotate_left(next(3));
        }
        (vertices, triangles)
    })
}

proptest! {
    #[test]
    fn a_closed_mesh_passes_as_it_is(m in mesh()) {
        let c = passed(&m);
        prop_assert!(c.closed && c.notes.is_empty(), "{:?}", c.notes);
        prop_assert_eq!((&c.vertices, &c.triangles), (&m.0, &m.1));
        // From outside, the same all over: a container.
        let c = passed(&inside_out(m));
        prop_assert!(c.closed && c.notes.len() == 1 && c.notes[0].contains("container") && volume(&c) < 0.0, "{:?}", c.notes);
    }

    #[test]
    fn a_missing_triangle_is_found_where_it_is(m in mesh(), k in any::<prop::sample::Index>()) {
        let (vertices, mut triangles) = m;
        let gone = triangles.remove(k.index(triangles.len()));
        let (field, value) = refused(&(vertices.clone(), triangles.clone()));
        let middle = gone.iter().map(|c| vertices[*c as usize]).sum::<DVec3>() / 3.0;
        prop_assert_eq!(field, "mesh");
        // The corners are added in another order there.
        let found: Vec<f64> = value.split(['(', ',', ')']).filter_map(|w| w.trim().parse().ok()).collect();
        prop_assert!((DVec3::from_slice(&found) - middle).length() < 2e-5, "{} {}", value, middle);
        prop_assert!(value.contains("1 small hole") && value.contains("3 edges"), "{}", value);
        let c = check(&vertices, &triangles, true).unwrap();
        prop_assert!(!c.closed && c.notes.len() == 1 && c.notes[0].contains("open"), "{:?}", c.notes);
    }

    #[test]
    fn turned_triangles_are_turned_back(m in mesh(), which in prop::collection::vec(any::<prop::sample::Index>(), 1..4)) {
        let mut turned = m.1.clone();
        let mut which: Vec<usize> = which.iter().map(|i| i.index(turned.len())).collect();
        which.sort_unstable();
        which.dedup();
        prop_assume!(2 * which.len() < turned.len());
        which.iter().for_each(|i| turned[*i].swap(0, 1));
        let c = passed(&(m.0, turned));
        prop_assert!(c.closed);
        prop_assert_eq!(canonical(&c.triangles), canonical(&m.1));
        prop_assert_eq!(c.notes.len(), 1);
        let first = format!("triangle {} at", which[0]);
        prop_assert!(c.notes[0].starts_with(&format!("turned {} triangle", which.len())) && c.notes[0].contains(&first), "{:?}", c.notes);
    }

    #[test]
    fn a_triangle_given_twice_is_left_out(m in mesh(), i in any::<prop::sample::Index>(), j in any::<prop::sample::Index>(), turn in any::<bool>()) {
        let (mut again, n) = (m.1.clone(), m.1.len());
        let (i, j) = (i.index(n), j.index(n + 1));
        let mut t = m.1[i];
        if turn {
            t.swap(1, 2);
        }
        t.rotate_left(1);
        again.insert(j, t);
        let (one, other) = if j <= i { (j, i + 1) } else { (i, j) };
        // The later one goes; where that is the sound one of two that face apart the other is turned.
        let c = passed(&(m.0, again));
        prop_assert!(c.closed);
        prop_assert_eq!(canonical(&c.triangles), canonical(&m.1));
        prop_assert!(c.notes.iter().any(|s| s.contains(&format!("triangle {other}, the same as {one}"))), "{:?}", c.notes);
    }

    #[test]
    fn loose_triangles_are_joined(m in mesh()) {
        let vertices: Vec<DVec3> = m.1.iter().flatten().map(|c| m.0[*c as usize]).collect();
        let triangles: Vec<[u32; 3]> = (0..m.1.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let c = passed(&(vertices, triangles));
        prop_assert!(c.closed && c.notes.len() == 1 && c.notes[0].starts_with("joined"), "{:?}", c.notes);
        prop_assert!(volume(&c) > 0.0);
    }

    #[test]
    fn a_third_triangle_at_an_edge_is_refused(m in mesh(), i in any::<prop::sample::Index>(), at in any::<prop::sample::Index>()) {
        let (mut vertices, mut triangles) = m;
        let t = triangles[i.index(triangles.len())];
        vertices.push(DVec3::splat(3.0));
        let j = at.index(triangles.len() + 1);
        triangles.insert(j, [t[1], t[0], vertices.len() as u32 - 1]);
        let (field, value) = refused(&(vertices.clone(), triangles));
        let edge = [t[0].min(t[1]), t[0].max(t[1])];
        prop_assert!(field.starts_with("triangles["));
        prop_assert!(value.contains("3 triangles") && value.contains(&j.to_string()), "{}", value);
        prop_assert!(value.contains(&format!("vertices {} and {}", edge[0], edge[1])) && value.contains(&coordinates(vertices[edge[0] as usize])), "{}", value);
    }

    /// A corner on the edge of one of its two triangles, and a triangle without area between them.
    #[test]
    fn a_triangle_without_area_is_taken_out_and_leaves_no_crack(m in mesh(), i in any::<prop::sample::Index>(), at in any::<prop::sample::Index>()) {
        let (mut vertices, mut triangles) = m;
        let i = i.index(triangles.len());
        let [a, b, c] = triangles[i];
        let middle = vertices.len() as u32;
        vertices.push((vertices[a as usize] + vertices[b as usize]) * 0.5);
        triangles[i] = [a, middle, c];
        triangles.push([middle, b, c]);
        let j = at.index(triangles.len() + 1);
        triangles.insert(j, [a, b, middle]);
        let found = passed(&(vertices.clone(), triangles));
        prop_assert!(found.closed, "{:?}", found.notes);
        prop_assert_eq!(&found.notes, &vec![format!("took out 1 triangle without area, the first triangle {j}")]);
        let least = found.triangles.iter().map(|t| t.map(|c| vertices[c as usize])).map(|[a, b, c]| (b - a).cross(c - a).length()).fold(1.0, f64::min);
        prop_assert!(least > 1e-6 && volume(&found) > 0.0);
    }

    #[test]
    fn collapsed_edges_leave_no_crack(m in mesh(), i in any::<prop::sample::Index>()) {
        let (mut vertices, mut triangles) = m;
        // The edge between two triangles opened to a slit with two corners at the same place.
        let [a, b, _] = triangles[i.index(triangles.len())];
        let twin = vertices.len() as u32;
        vertices.push(vertices[a as usize]);
        for t in triangles.iter_mut().filter(|t| t.contains(&a) && t.contains(&b)).take(1) {
            *t = t.map(|c| if c == a { twin } else { c });
        }
        triangles.push([a, b, twin]);
        let c = passed(&(vertices, triangles));
        prop_assert!(c.closed && c.notes[0].starts_with("left out 1 triangle with two corners at one place"), "{:?}", c.notes);
    }

    #[test]
    fn any_numbers_are_taken_or_refused(
        vertices in prop::collection::vec((-2_i32..2, -2_i32..2, -2_i32..2), 1..8),
        triangles in prop::collection::vec([0_u32..9, 0_u32..9, 0_u32..9], 0..12),
        open in any::<bool>(),
    ) {
        let vertices: Vec<DVec3> = vertices.into_iter().map(|(x, y, z)| DVec3::new(f64::from(x), f64::from(y), f64::from(z))).collect();
        if let Ok(c) = check(&vertices, &triangles, open) {
            // What has passed passes again, with nothing to mend.
            let again = check(&c.vertices, &c.triangles, open).unwrap();
            prop_assert_eq!(&again.triangles, &c.triangles);
            prop_assert_eq!(again.closed, c.closed);
            prop_assert!(again.notes.iter().all(|n| n.contains("open") || n.contains("container")), "{:?}", again.notes);
        }
    }
}

#[test]
fn sheets_are_open_and_said_to_be() {
    let triangle: Mesh = (vec![DVec3::ZERO, DVec3::X, DVec3::Y], vec![[0, 1, 2]]);
    let roof: Mesh =
        (vec![DVec3::Z, DVec3::X, DVec3::Y, -DVec3::X, -DVec3::Y], vec![[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]]);
    for m in [triangle, roof, tube(4, 12, 10.0)] {
        let c = passed(&m);
        assert!(!c.closed && c.notes.len() == 1 && c.notes[0].contains("open"), "{:?}", c.notes);
        assert_eq!(c.triangles, m.1);
    }
    // A pinhole in a sheet that is open anyway: threads may go through it.
    let (vertices, mut triangles) = tube(40, 24, 10.0);
    triangles.remove(500);
    let c = passed(&(vertices, triangles));
    assert!(!c.closed && c.notes[0].contains("3 holes"), "{:?}", c.notes);
}

#[test]
fn a_long_tube_has_to_be_said_to_be_open() {
    let m = tube(40, 12, 60.0);
    let (_, value) = refused(&m);
    assert!(value.contains("2 small holes") && value.contains("12 edges"), "{value}");
    assert!(!check(&m.0, &m.1, true).unwrap().closed);
}

#[test]
fn a_crack_is_refused_where_it_is() {
    // Two corners apart by next to nothing.
    let (mut vertices, mut triangles) = ball(5, 8, [0.0; 3]);
    let twin = vertices.len() as u32;
    vertices.push(vertices[2] * (1.0 + 1e-9));
    let t = triangles.iter_mut().find(|t| t.contains(&2)).unwrap();
    *t = t.map(|c| if c == 2 { twin } else { c });
    let (field, value) = refused(&(vertices, triangles));
    assert!(field == "mesh" && value.contains("1 small hole"), "{value}");
}

#[test]
fn a_moebius_strip_is_refused() {
    let n = 12;
    let edge = |k: usize, side: f64| {
        let turn = TAU * k as f64 / f64::from(n);
        let (sin, cos) = (0.5 * turn).sin_cos();
        DVec3::new(turn.cos(), turn.sin(), 0.0) * (1.0 + 0.3 * side * cos) + DVec3::Z * (0.3 * side * sin)
    };
    let n = n as usize;
    let vertices: Vec<DVec3> = (0..n).flat_map(|k| [edge(k, -1.0), edge(k, 1.0)]).collect();
    let at = |k: usize, side: usize| if k < n { (2 * k + side) as u32 } else { 1 - side as u32 };
    let triangles =
        (0..n).flat_map(|k| [[at(k, 0), at(k + 1, 0), at(k + 1, 1)], [at(k, 0), at(k + 1, 1), at(k, 1)]]).collect();
    let (field, value) = refused(&(vertices, triangles));
    assert!(field.starts_with("triangles[") && value.contains("one side"), "{value}");
}

#[test]
fn a_cavity_is_none_of_a_container() {
    let hollow = together(cube(DVec3::ZERO, 2.0), &inside_out(cube(DVec3::ZERO, 1.0)));
    let c = passed(&hollow);
    assert!(c.closed && c.notes.is_empty(), "{:?}", c.notes);
    // Beside each other, one of them is a container by itself.
    let beside = together(cube(DVec3::ZERO, 2.0), &inside_out(cube(DVec3::X * 10.0, 1.0)));
    let c = passed(&beside);
    assert!(c.closed && c.notes.len() == 1 && c.notes[0].contains("triangle 12 is a container"), "{:?}", c.notes);
}

#[test]
fn solids_that_touch_along_an_edge_stay_two() {
    let two = together(cube(DVec3::ZERO, 1.0), &cube(DVec3::new(2.0, 2.0, 0.0), 1.0));
    let c = passed(&two);
    assert!(c.closed && c.notes.is_empty() && c.triangles == two.1);
    // As loose triangles nobody can tell which belong together.
    let vertices: Vec<DVec3> = two.1.iter().flatten().map(|c| two.0[*c as usize]).collect();
    let triangles = (0..two.1.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    assert!(refused(&(vertices, triangles)).1.contains("4 triangles"));
}

#[test]
fn numbers_that_cannot_be() {
    let (vertices, triangles) = cube(DVec3::ZERO, 1.0);
    let mut v = vertices.clone();
    v[3].y = f64::NAN;
    assert_eq!(refused(&(v, triangles.clone())).0, "vertices[3]");
    let mut t = triangles;
    t[7][2] = 8;
    assert_eq!(refused(&(vertices.clone(), t)).0, "triangles[7]");
    assert_eq!(refused(&(vertices.clone(), vec![])).0, "triangles");
    assert_eq!(refused(&(vertices, vec![[0, 1, 1], [2, 2, 2]])).0, "triangles[0]");
}
