//! All cases, section by section. Numbers are those of the sections of the reference tables that they were set up from.

mod s01_cantilever;
mod s02_hanging;
mod s03_columns;
mod s04_twist;
mod s05_localized;
mod s06_arcs;
mod s07_springs;
mod s08_vibration;
mod s09_capstan;
mod s10_knot_force;
mod s11_writhe;
mod s12_knots;
mod s13_identities;
mod s14_friction;
mod s17_frames;
mod s18_second_order;
mod s19_joined;
mod s20_reels;

use crate::study::{Bar, Level, Quantity, Section, Study};
use sutura_scene::Outcome;

/// Numbers of elements of cases that are compared with a continuum.
const ELEMENTS: [u32; 3] = [25, 50, 100];

/// All sections, in order.
pub fn sections() -> Vec<Section> {
    vec![
        s01_cantilever::section(),
        s02_hanging::section(),
        s03_columns::section(),
        s04_twist::section(),
        s05_localized::section(),
        s06_arcs::section(),
        s07_springs::section(),
        s08_vibration::section(),
        s09_capstan::section(),
        s10_knot_force::section(),
        s11_writhe::section(),
        s12_knots::section(),
        s13_identities::section(),
        s14_friction::section(),
        s17_frames::section(),
        s18_second_order::section(),
        s19_joined::section(),
        s20_reels::section(),
    ]
}

/// A vector as a scene has it, SI.
fn vector(v: [f64; 3]) -> String {
    format!("[{:e}, {:e}, {:e}]", v[0], v[1], v[2])
}

/// The same statics with other settings of the solver: a static answer depends on none. `own` is the substep of the
/// scene \[s\].
fn independence(
    name: &str,
    own: f64,
    mut study: Study,
    what: &str,
    measure: impl Fn(&Outcome) -> f64 + Send + Sync + 'static,
) -> Study {
    // Short steps damp little by themselves; without more the slow swing would take minutes to die.
    let short = |n: u32| {
        let settings =
            [("solver.substep", format!("{:e}", 1.0 / f64::from(n))), ("solver.linear_damping", "0.99".into())];
        Level::new(format!("1/{n} s, damping 0.99"), 0.0, &settings)
    };
    let mut levels = vec![
        Level::new("as it is", 0.0, &[]),
        Level::new("half the substep", 0.0, &[("solver.substep", format!("{:e}", 0.5 * own))]),
        short(600),
        short(1200),
        short(2400),
        Level::new("24 iterations", 0.0, &[("solver.newton_max", "24".into())]),
        Level::new("tolerance 0.003", 0.0, &[("solver.tolerance", "0.003".into())]),
    ];
    for damping in ["0.5", "0.99"] {
        levels.push(Level::new(
            format!("damping {damping}"),
            0.0,
            &[("solver.linear_damping", damping.into()), ("solver.angular_damping", damping.into())],
        ));
    }
    study.quantities.clear();
    study.curve = None;
    study.quick = false;
    study.name = name.into();
    study.levels(levels).quantity(Quantity::measured(what, measure, Vec::new(), "each other", Bar::Same(0.001)))
}
