//! Row E-16, figure 16: a square knot, tied around a post by both ends, let go and loaded (the sample scene
//! `square_knot`).

use crate::led::{self, Moment, Run, SCALED, TRUE, find, verdict};
use crate::measure::{mm, number};
use crate::outcome::{Check, Compare, Outcome};
use crate::plan::{Experiment, Plan};
use sutura::Hold;
use sutura::glam::DVec3;

pub const EXPERIMENT: Experiment = Experiment { name: "fig16", title: "A square knot", figures: "16", plan };

fn plan() -> Plan {
    Plan::new(
        vec![()],
        |()| "square knot".into(),
        |()| led::all("square_knot", Hold::Pin, 1.0, &[30, 100], None),
        |found| finish(&found[0].1),
    )
}

fn finish(runs: &[Run]) -> Outcome {
    let mut out = Outcome::default();
    out.say(
        "The sample scene `square_knot`: a 3-0 silk thread of 20 cm around a post of 10 mm, two throws, each drawn to 2 N; then the ends are let go and the halves of the post load the loop with \
         1 N for 11 s. *Direct* runs it as it is. The paper's solver knows no forces: its hands (ends, fingers) and the halves of the post go the ways that they go there, frame by frame, but that each end stays back by what the thread of *direct* is stretched (1.1 mm at 2 N), so that no thread is pulled longer than it is; and its thread \
         is a chain of 889 spheres side by side. At its *effective scale* the scene is a hundred times as large and the hands are as quick as what falls (lengths as the square of times), which is ten \
         steps in a frame; at *true scale* it is one step in a frame of 1/60 s. It is held under load for 3 s of the 10 s. Drift counts the tails, which swing. The ways suit the thread of *direct* and need not suit one that bends otherwise: a throw that is missed for that reason is no fault of contact; passages, overlap and divergence are.",
    );
    let direct = find(runs, "direct");
    let knot = |r: &Run, phase: &str| r.at(phase).map_or("-".to_string(), |s| s.knot.clone());
    let said = |r: &Run| match r.diverged {
        Some(_) => verdict(r),
        None => format!("{}; {}", knot(r, "hold"), verdict(r)),
    };
    out.compare.push(Compare {
        what: "16: square knot".into(),
        published: "tied, holds (picture)".into(),
        effective: format!(
            "{} (100 steps a frame: {})",
            said(find(runs, SCALED)),
            said(find(runs, "paper, 100 steps a frame"))
        ),
        true_scale: said(find(runs, TRUE)),
        direct: format!("{}; slip under load {}", said(direct), mm(direct.slip)),
    });
    let mut check =
        |what: String, bar: &str, found: String, passed: bool| out.checks.push(Check::new(what, bar, found, passed));
    check(
        "direct: the knot after 11 s under load".into(),
        "square",
        knot(direct, "hold"),
        knot(direct, "hold") == "square",
    );
    check("direct: slip in 10 s under load".into(), "<= 0.1 mm", mm(direct.slip), direct.slip <= 1e-4);
    check("direct: nothing passes through".into(), "none", direct.passages.to_string(), direct.passages == 0);
    check("direct: least clearance [diameters]".into(), ">= -0.05", number(direct.least()), direct.least() >= -0.05);
    let scaled = find(runs, SCALED);
    let finest = runs.last().expect("there are runs");
    check(
        "paper, effective scale: the knot at the end, as published".into(),
        "square",
        knot(scaled, "hold"),
        knot(scaled, "hold") == "square",
    );
    check(
        "paper, effective scale: nothing passes through, as published".into(),
        "none",
        scaled.passages.to_string(),
        scaled.passages == 0 && scaled.diverged.is_none(),
    );

    let mut knots = crate::outcome::Table::new(
        "knots",
        "The knot that is recognized",
        &["solver", "first drawn", "second drawn", "let go", "at the end", "slip under load [mm]"],
    );
    for r in runs {
        let slip = if r.slip.is_finite() && r.diverged.is_none() { (1e3 * r.slip).into() } else { "-".into() };
        let mut row = vec![r.name.clone().into()];
        row.extend(["first draw", "second draw", "let go", "hold"].map(|p| knot(r, p).into()));
        row.push(slip);
        knots.row(row);
    }
    out.tables.extend([knots, led::table("runs", "Runs of the square knot", runs), led::times("times", runs)]);

    let look = (DVec3::new(-0.1, 0.3, -1.0), DVec3::Y);
    let wide = DVec3::new(0.0, -0.04, 0.0);
    let near = DVec3::new(0.0, -0.004, 0.0);
    let moments = [
        Moment { phase: "first throw", words: "first throw", look, at: wide, width: 0.12 },
        Moment { phase: "first draw", words: "first drawn", look, at: near, width: 0.017 },
        Moment { phase: "second throw", words: "second throw", look, at: wide, width: 0.12 },
        Moment { phase: "second draw", words: "tightened", look, at: near, width: 0.017 },
        Moment { phase: "hold", words: "under load", look, at: near, width: 0.017 },
    ];
    out.pictures.push(led::picture("knot", "The square knot", &[direct, scaled, finest], &moments));
    out
}
