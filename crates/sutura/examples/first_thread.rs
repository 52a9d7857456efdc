//! The example of the README: a thread held at one end falls, swings out, and hangs.

use sutura::glam::DVec3;
use sutura::knot::{Ends, recognize};
use sutura::{GripSpec, Hold, Material, Place, RodSpec, Settings, World};

fn main() -> Result<(), sutura::Error> {
    // 10 cm of a 2-0 monofilament: radius 0.15 mm, E = 2 GPa, 1150 kg/m^3, straight along x, in 100 elements.
    let material = Material { bend_damping: 0.01, ..Material::elastic(2e9, 1150.0) };
    let thread = RodSpec::straight(DVec3::ZERO, DVec3::X * 0.1, 100, 0.15e-3, material);

    let mut world = World::new(Settings { linear_damping: 0.99, ..Settings::default() })?;
    let rod = world.insert_rod(&thread)?;
    let grip = world.insert_grip(&GripSpec::at_once(rod, Place::Start, Hold::Pin))?;

    for _frame in 0..300 {
        // A step never fails: what went wrong, if anything did, is in its report.
        let report = world.step(1.0 / 60.0);
        for incident in &report.incidents {
            eprintln!("at {:.3} s: {}", incident.time, incident.kind);
        }
    }

    let view = world.rod(rod)?;
    let held = world.grip_wrench(grip)?.force.z;
    println!("the end hangs at {:.4} m", view.positions()[100]);
    println!("the grip carries {:.4} mN", 1e3 * held);
    println!("knot: {}", recognize(view.positions(), Ends::Free, 1));
    Ok(())
}
