//! The language of conditions, probes and checks, in a scene that has one of everything.

use sutura_scene::Scene;

const BEFORE: &str = r#"
frame_rate = 240
[solver]
halvings = 2
[[thread]]
name = "silk"
radius = "0.1 mm"
young_modulus = "2 GPa"
density = "1000 kg/m^3"
elements = 8
line = { from = [0, 0, 0], to = [0.02, 0, 0] }
[[shape]]
name = "post"
kind = "sphere"
radius = "5 mm"
position = "[10, 0, -4] mm"
[[body]]
name = "ball"
kind = "sphere"
radius = "2 mm"
density = "1 g/cc"
position = "[15, 0, 3] mm"
[[grip]]
name = "left"
at = "start"
[[phase]]
name = "run"
duration = "8 ms"
[[probe]]
name = "earlier"
what = "position(silk.end)"
"#;

pub fn run(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    // Of these a TOML text of one line can say all but the quote of its own kind.
    if text.chars().any(|c| c == '\'' || (c.is_control() && c != '\t')) || text.len() > 2000 {
        return;
    }
    for rest in [
        format!("[[probe]]\nname = \"later\"\nwhat = '{text}'\n"),
        format!("[[check]]\nname = \"it\"\nthat = '{text}'\n"),
        format!("[[check]]\nname = \"near\"\nthat = '{text}'\nequals = '{text}'\ntolerance = \"1 %\"\n"),
        format!("[[check]]\nname = \"number\"\nthat = \"time\"\nbetween = ['{text}', '{text}']\n"),
        format!("[[phase]]\nname = \"until\"\nuntil = '{text}'\nmax_duration = \"8 ms\"\nout_of_time = \"accept\"\n"),
    ] {
        if let Ok(scene) = Scene::parse(&format!("{BEFORE}{rest}"), "fuzzed.toml") {
            crate::scene::play(scene);
        }
    }
}
