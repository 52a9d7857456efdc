//! Row E-18, figure 18: three threads twined round each other (the sample scene `twine`).

use crate::led::{self, Moment, Run, SCALED, TRUE, find, moved};
use crate::measure::{mm, number, percent};
use crate::outcome::{Check, Compare, Outcome};
use crate::plan::{Experiment, Plan};
use sutura::Hold;
use sutura::glam::DVec3;

pub const EXPERIMENT: Experiment = Experiment { name: "fig18", title: "Three threads twined", figures: "18", plan };

fn plan() -> Plan {
    // They are laid without friction, which begins when they are pulled.
    Plan::new(
        vec![()],
        |()| "twine".into(),
        |()| led::all("twine", Hold::Clamp, 0.5, &[30], Some("pull")),
        |found| finish(&found[0].1),
    )
}

fn finish(runs: &[Run]) -> Outcome {
    let mut out = Outcome::default();
    out.say(
        "The sample scene `twine`: three threads of 0.5 mm and 40 mm, laid three times round each other without friction, pulled with 0.5 N each, then held with friction. As in figure 16 the \
         ends go the same ways for the paper's solver (each stays back by half of the stretch, so that the threads are neither slack nor pulled longer), whose threads are chains of 80 spheres each; its friction begins where that of the scene does. There is no gravity: scale counts by the diameters that an end moves in a step.",
    );
    let [direct, scaled, real] = ["direct", SCALED, TRUE].map(|n| find(runs, n));
    let said = |r: &Run| match r.diverged {
        Some(_) => moved(r),
        None => format!("{} contacts, {} of the particles in touch; {}", r.contacts, percent(r.touching), moved(r)),
    };
    out.compare.push(Compare {
        what: "18: three threads twined".into(),
        published: "nearly every sphere in contact; stable, no sliding, no penetration".into(),
        effective: said(scaled),
        true_scale: said(real),
        direct: said(direct),
    });
    let mut check =
        |what: &str, bar: &str, found: String, passed: bool| out.checks.push(Check::new(what, bar, found, passed));
    check("direct: part of the particles in touch", ">= 95 %", percent(direct.touching), direct.touching >= 0.95);
    check("direct: drift in 1 s", "<= 0.001 mm", mm(direct.drift), direct.drift <= 1e-6);
    check("direct: least clearance [diameters]", ">= -0.05", number(direct.clearance[0]), direct.clearance[0] >= -0.05);
    check("direct: nothing passes through", "none", direct.passages.to_string(), direct.passages == 0);
    check(
        "paper, effective scale: nothing passes through, as published",
        "none",
        scaled.passages.to_string(),
        scaled.passages == 0 && scaled.diverged.is_none(),
    );
    out.tables.extend([led::table("runs", "Runs of the three threads", runs), led::times("times", runs)]);
    let look = (DVec3::new(0.0, 1.0, -0.3), DVec3::Z);
    let moments = [
        Moment { phase: "twine", words: "twined", look, at: DVec3::ZERO, width: 0.024 },
        Moment { phase: "hold", words: "held", look, at: DVec3::ZERO, width: 0.024 },
        Moment { phase: "hold", words: "held, middle", look, at: DVec3::ZERO, width: 0.008 },
    ];
    let finest = runs.last().expect("there are runs");
    out.pictures.push(led::picture("twine", "Three threads twined", &[direct, scaled, finest], &moments));
    out
}
