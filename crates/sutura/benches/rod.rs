//! Cost of a thread without contact: `cargo bench -p sutura --bench rod [-- ELEMENTS ...]`. Nanoseconds an element of
//! CPU time: the least of many repeats for the parts of a Newton iteration, the median frame of two seconds for a whole
//! drop.

use cpu_time::ThreadTime;
use sutura::glam::DVec3;
use sutura::kernels::Kernels;
use sutura::{GripSpec, Hold, Material, Place, RodSpec, Settings, Stretch, World};

const LENGTH: f64 = 0.15;

fn thread(elements: usize) -> World {
    let mut world = World::new(Settings::default()).expect("defaults are valid");
    let spec = RodSpec::straight(DVec3::ZERO, DVec3::X * LENGTH, elements, 1e-4, Material::elastic(1e9, 1150.0));
    let rod = world.insert_rod(&RodSpec { stretch: Stretch::Inextensible, ..spec }).expect("a valid thread");
    world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Pin)).expect("a free place");
    world
}

/// Least time of a call \[ns\].
fn least(mut work: impl FnMut()) -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..30 {
        let start = ThreadTime::now();
        for _ in 0..20 {
            work();
        }
        best = best.min(start.elapsed().as_secs_f64() * 1e9 / 20.0);
    }
    best
}

fn main() {
    let mut counts: Vec<usize> = std::env::args().filter_map(|a| a.parse().ok()).collect();
    if counts.is_empty() {
        counts = vec![120, 500, 2000];
    }
    println!(
        "{:>8} {:>9} {:>9} {:>9} {:>12} {:>17}",
        "elements", "assemble", "factor", "solve", "ms a frame", "ns/element/frame"
    );
    for n in counts {
        let mut world = thread(n);
        let mut ms: Vec<f64> = (0..120)
            .map(|_| {
                let start = ThreadTime::now();
                world.step(1.0 / 60.0);
                1e3 * start.elapsed().as_secs_f64()
            })
            .collect();
        ms.sort_by(f64::total_cmp);
        // The parts, where it hangs and swings.
        let mut k = Kernels::new(world);
        let each = 1.0 / n as f64;
        let assemble = least(|| k.assemble()) * each;
        let both = least(|| assert!(std::hint::black_box(k.factor()))) * each;
        let solve = least(|| _ = std::hint::black_box(k.solve())) * each;
        println!(
            "{n:>8} {assemble:>9.1} {:>9.1} {solve:>9.1} {:>12.4} {:>17.0}",
            both - assemble,
            ms[60],
            1e6 * ms[60] * each
        );
    }
}
