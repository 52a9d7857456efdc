//! Cost of a skin: `cargo bench -p sutura --bench skin`. CPU time, the least of many repeats, for a thread of 15 cm on
//! a helix.

use cpu_time::ThreadTime;
use sutura::glam::{DQuat, DVec3};
use sutura::skin::{Bone, Skin, SkinSpec};

fn least(mut work: impl FnMut()) -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..200 {
        let start = ThreadTime::now();
        for _ in 0..10 {
            work();
        }
        best = best.min(start.elapsed().as_secs_f64() * 1e3 / 10.0);
    }
    best
}

fn main() {
    println!(
        "{:>8} {:>6} {:>6} {:>9} {:>10} {:>10} {:>16}",
        "elements", "sides", "rings", "vertices", "ms bones", "ms skin", "ms / 10 000"
    );
    for (elements, sides, rings) in [(120, 12, 4), (192, 12, 4), (500, 12, 4), (450, 8, 2), (2000, 12, 4)] {
        let at = |s: f64| DVec3::new(5e-3 * (200.0 * s).cos(), 5e-3 * (200.0 * s).sin(), 0.3 * s);
        let x: Vec<DVec3> = (0..=elements).map(|k| at(0.15 * f64::from(k) / f64::from(elements))).collect();
        let q: Vec<DQuat> =
            x.windows(2).map(|w| DQuat::from_rotation_arc(DVec3::Z, (w[1] - w[0]).normalize())).collect();
        let lengths = x.windows(2).map(|w| (w[1] - w[0]).length()).collect();
        let skin = Skin::new(&SkinSpec { sides, rings, ..SkinSpec::new(lengths, 1e-4) }).expect("a valid tube");
        let mut bones = vec![Bone::default(); skin.n_bones()];
        let n = skin.n_vertices();
        let (mut positions, mut normals) = (vec![[0.0; 3]; n], vec![[0.0; 3]; n]);
        let ms_bones = least(|| skin.bones_at(std::hint::black_box(&x), &q, std::hint::black_box(&mut bones)));
        let ms = least(|| {
            skin.pose(
                std::hint::black_box(&bones),
                std::hint::black_box(&mut positions),
                std::hint::black_box(&mut normals),
            );
        });
        println!(
            "{elements:>8} {sides:>6} {rings:>6} {n:>9} {ms_bones:>10.4} {ms:>10.4} {:>16.4}",
            1e4 * (ms + ms_bones) / n as f64
        );
    }
}
