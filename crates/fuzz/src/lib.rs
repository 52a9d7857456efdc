//! What Sutura is fuzzed with. A target is a function of any bytes that panics when it finds a fault: a panic of the
//! product, a number that is not finite without an incident, a reader whose answer does not read back. The fuzzer
//! (`fuzz/`) and the tests that replay the corpus (`tests/replay.rs`) run the same functions.
//!
//! The size of what is run is bounded here, where it may be legitimate and only slow; what is absurd in size the
//! product refuses by itself.

mod edits;
mod expr;
mod finite;
mod input;
mod knot;
mod saved;
mod scene;
mod snapshot;
mod trajectory;

/// A fuzz target.
#[derive(Debug, Clone, Copy)]
pub struct Target {
    /// Name, that of its folder in the corpus and of its program in `fuzz/`.
    pub name: &'static str,
    /// Tries one input.
    pub run: fn(&[u8]),
}

/// All targets.
pub const TARGETS: &[Target] = &[
    Target { name: "edits", run: edits::run },
    Target { name: "expr", run: expr::run },
    Target { name: "knot", run: knot::run },
    Target { name: "saved", run: saved::run },
    Target { name: "scene", run: scene::run },
    Target { name: "snapshot", run: snapshot::run },
    Target { name: "trajectory", run: trajectory::run },
];

/// Tries one input on a target by its name.
///
/// # Panics
///
/// When the input finds a fault; when there is no such target.
pub fn run(target: &str, data: &[u8]) {
    let target =
        TARGETS.iter().find(|t| t.name == target).unwrap_or_else(|| panic!("there is no fuzz target `{target}`"));
    (target.run)(data);
}
