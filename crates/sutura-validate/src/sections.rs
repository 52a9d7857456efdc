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

use crate::study::Section;

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
    ]
}

/// A vector as a scene has it, SI.
fn vector(v: [f64; 3]) -> String {
    format!("[{:e}, {:e}, {:e}]", v[0], v[1], v[2])
}
