//! Knots by name.

use sutura::glam::DVec3;
use sutura::knot::{Ends, KnotType, recognize};

fn read(name: &str) -> Vec<DVec3> {
    let path = format!("{}/tests/polylines/{name}.csv", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap();
    text.lines()
        .map(|l| {
            let v: Vec<f64> = l.split(',').map(|x| x.trim().parse().unwrap()).collect();
            DVec3::new(v[0], v[1], v[2])
        })
        .collect()
}

#[test]
fn reference() {
    for name in ["figure8", "granny_+3+3", "square_+3-3", "surgeon_square_+5-3", "throw_+1_unknot", "throw_+3", "throw_-3", "trefoil_L", "trefoil_R"] {
        let p = read(name);
        for seed in 0..3 {
            let t = std::time::Instant::now();
            let r = recognize(&p, Ends::Closed, seed);
            println!("{name}: {r} {:?} {} {}/{} {:?}", r.alexander, r.crossings, r.projections_agreed, r.projections_total, t.elapsed());
        }
    }
}
