//! Tables of points, and what is recognized in any polyline.

use crate::finite::{self, one};
use crate::input::Input;
use sutura::glam::DVec3;
use sutura::knot::{Ends, KnotType, entries, gauss_linking, recognize, writhe};
use sutura_scene::points_from_table;

/// Points of a polyline that is recognized: enough for any knot that has a name.
const MOST_POINTS: usize = 250;

pub fn run(data: &[u8]) {
    let mut input = Input::new(data);
    let kind = input.byte();
    let seed = u64::from(input.byte());
    match kind % 4 {
        0 => {
            if let Ok(points) = points_from_table(input.rest()) {
                assert!(points.len() >= 3 && points.iter().all(|p| p.is_finite()));
                look(&points, kind, seed);
            }
        }
        // Coordinates of a coarse grid: much meets exactly.
        1 => {
            let points: Vec<DVec3> = input
                .rest()
                .chunks_exact(3)
                .map(|c| DVec3::from_array([0, 1, 2].map(|i| f64::from(c[i] as i8))))
                .collect();
            look(&points, kind, seed);
        }
        // A walk of short steps: long chains that are tangled closely.
        2 => {
            let step =
                |c: &[u8]| DVec3::from_array([0, 1, 2].map(|i| f64::from((c[i / 2] >> (4 * (i % 2))) & 15) - 7.5));
            let walk = input.rest().chunks_exact(2).scan(DVec3::ZERO, |x, c| {
                *x += step(c);
                Some(*x)
            });
            look(&walk.collect::<Vec<_>>(), kind, seed);
        }
        // Any numbers.
        _ => {
            let mut points = Vec::new();
            while !input.is_empty() && points.len() < MOST_POINTS {
                points.push(input.vector(1.0));
            }
            look(&points, kind, seed);
        }
    }
}

fn look(points: &[DVec3], kind: u8, seed: u64) {
    let points = &points[..points.len().min(MOST_POINTS)];
    let (first, last) = (points.first().copied().unwrap_or_default(), points.last().copied().unwrap_or_default());
    let ends = match (kind / 4) % 3 {
        0 => Ends::Closed,
        1 => Ends::Held { start: first - last, end: last - first },
        _ => Ends::Free,
    };
    let found = recognize(points, ends, seed);
    assert!(
        (0.0..=0.25).contains(&found.trimmed)
            && found.closures_agreed <= found.closures_total
            && found.projections_agreed <= found.projections_total
    );
    assert!(found.problem.is_some() || found.knot == KnotType::Unknown || found.determinant > 0, "{found:?}");
    if kind & 128 != 0 {
        assert_eq!(found, recognize(points, ends, seed), "the same seed, another answer");
    }
    if points.iter().any(|p| !p.is_finite()) {
        assert_eq!(found.knot, KnotType::Unknown);
    } else {
        finite::assert(one("writhe", writhe(points, kind & 64 == 0)));
        let (a, b) = points.split_at(points.len() / 2);
        finite::assert(one("linking number", gauss_linking(a, b)));
    }
    let lengths: Vec<f64> = points.windows(2).map(|w| w[0].distance(w[1])).collect();
    let radius = f64::from(kind / 8) * 0.1;
    if let Some(e) = entries(points, &lengths, radius) {
        let ordered = e.tail_a <= e.tail_b && e.loop_ab.is_none_or(|[a, b]| e.tail_a <= a && a <= b && b <= e.tail_b);
        assert!(ordered, "{e:?}");
    }
}
