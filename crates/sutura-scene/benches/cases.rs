//! Cost of whole scenes as their elements grow, with the contacts: `cargo bench -p sutura-scene --bench cases [-- CASE
//! ...]`. CPU time of a frame, the median, the 99th percentile and the worst, most contacts, Newton iterations and
//! incidents, for each number of elements. All cases take some ten seconds; those named after `--` are run alone.
//!
//! - `lifted`: a silk thread lying on a table, one end lifted.
//! - `dropped`: a silk thread that falls 5 mm flat onto a floor.
//! - `lowered`: such a thread let down onto a floor end first at 5 cm/s, and let go. It hangs a little aslant: one that
//!   is exactly upright is pressed together along itself and never bends.
//! - `capstan`: the sample scene of this name with a shorter hold, some 3.5 s.

use std::path::Path;
use sutura_scene::{Runner, Scene};

/// Name, text, values set in it, numbers of elements.
type Case<'a> = (&'a str, &'a str, &'a [(&'a str, &'a str)], &'a [u32]);

const LIFTED: &str = r#"
[solver]
linear_damping = 0.5
angular_damping = 0.5
[friction]
default = 0.3
[[thread]]
name = "thread"
diameter = "0.32 mm"
young_modulus = "8.7 GPa"
bend_scale = 0.02
density = "1300 kg/m^3"
elements = 400
line = { from = "[-100, 0, 0.168] mm", to = "[100, 0, 0.168] mm" }
[[shape]]
name = "table"
kind = "plane"
[[grip]]
name = "end"
at = "end"
hold = "pin"
[[phase]]
duration = "0.2 s"
[[phase]]
duration = "0.2 s"
action = [{ move = "end", path = "linear", speed = "4 cm/s", keys = [{ by = "[0, 0, 20] mm" }] }]
"#;

const DROPPED: &str = r#"
[[thread]]
name = "thread"
size = "3-0"
material = "silk"
elements = 300
line = { from = "[0, 0, 5] mm", to = "[150, 0, 5] mm" }
[[shape]]
name = "floor"
kind = "plane"
[[phase]]
duration = "0.3 s"
"#;

const LOWERED: &str = r#"
[[thread]]
name = "thread"
size = "3-0"
material = "silk"
elements = 300
line = { from = "[0, 0, 155] mm", to = "[20, 0, 5] mm" }
[[shape]]
name = "floor"
kind = "plane"
[[grip]]
name = "hand"
at = "start"
hold = "pin"
[[phase]]
action = [{ move = "hand", path = "linear", keys = [{ by = "[0, 0, -150] mm", duration = "3 s" }] }]
[[phase]]
duration = "0.8 s"
action = [{ let_go = "hand" }]
"#;

fn main() {
    let capstan = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/capstan.toml");
    let capstan = std::fs::read_to_string(capstan).expect("a sample scene");
    let cases: [Case<'_>; 4] = [
        ("lifted", LIFTED, &[], &[100, 200, 300, 400]),
        ("dropped", DROPPED, &[], &[100, 200, 300, 600, 1000]),
        ("lowered", LOWERED, &[], &[100, 200, 300]),
        ("capstan", &capstan, &[("phase.hold.duration", "1.4 s")], &[130, 250, 350, 500, 700]),
    ];
    let asked: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    println!("   case  elements  contacts  median ms       p99     worst  Newton      CPU s  simulated s  incidents");
    for (name, text, set, counts) in cases.iter().filter(|c| asked.is_empty() || asked.iter().any(|a| a == c.0)) {
        for elements in *counts {
            let mut settings: Vec<_> = set.iter().map(|(key, value)| (key.to_string(), value.to_string())).collect();
            settings.push(("thread.thread.elements".into(), elements.to_string()));
            let scene = Scene::parse_with(text, &format!("{name}.toml"), &settings).unwrap_or_else(|e| panic!("{e}"));
            let mut runner = Runner::new(scene).unwrap_or_else(|e| panic!("{e}"));
            while !runner.step_frame().finished {}
            let r = runner.finish().report;
            let ms = r.ms_per_frame;
            let incidents = r.incidents.iter().map(|i| i.count).sum::<u64>();
            println!(
                "{name:>7} {elements:>9} {:>9} {:>10.3} {:>9.2} {:>9.2} {:>7} {:>10.2} {:>12.2} {incidents:>10}",
                r.work.max_contacts, ms.median, ms.p99, ms.max, r.work.newton_iterations, r.cpu_s, r.simulated_s,
            );
            if let Some(first) = r.incidents.first() {
                println!("{name:>7} first incident at {:.4} s: {}", first.first_s, first.message);
            }
        }
    }
}
