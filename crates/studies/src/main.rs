//! The program `studies`: fills the tables in docs/studies.

use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;
use std::process::ExitCode;
use sutura_studies::case::{Budget, Filter, seconds};
use sutura_studies::firm::Firm;
use sutura_studies::hands::Hands;
use sutura_studies::hold::{self, Hold};
use sutura_studies::overhand::{self, Overhand};
use sutura_studies::robustness::Robustness;
use sutura_studies::run::{Plan, Study, run};
use sutura_studies::throws::Throws;

/// Parameter studies of Sutura. Cases that are in the table already are left out.
#[derive(Parser, Debug)]
#[command(name = "studies", version)]
struct Cli {
    #[command(subcommand)]
    study: Which,
}

#[derive(Subcommand, Debug)]
enum Which {
    /// The sweep of the overhand knot: 162 cases, each drawn tight and let go
    Overhand {
        #[command(flatten)]
        common: Common,
        /// Run one case, of the sweep or not, say how it goes and write nothing:
        /// `r=0.2,e=2,speed=0.05,mu=0.3,l=2,substep=240`
        #[arg(long = "try", value_name = "KEY=VALUE,...", conflicts_with_all = ["only", "again", "jobs"])]
        one: Option<String>,
    },
    /// Which knots hold: threads, knots, friction and the force with which the tails were drawn
    Hold {
        #[command(flatten)]
        common: Common,
        /// Run one case, of the study or not, say how it goes and write nothing:
        /// `thread=silk,knot=granny,draw=1,mu=0.3,l=1,substep=480`
        #[arg(long = "try", value_name = "KEY=VALUE,...", conflicts_with_all = ["only", "again", "jobs"])]
        one: Option<String>,
    },
    /// Scenes of a generator, half of them absurd: no panic, no hang, no number that is not finite, the same bits
    /// however they are played
    Robustness(Robustness),
    /// Threads thrown at, over, through and into shapes of all kinds: nothing passes, nothing is given up
    Throws(Throws),
    /// Two noisy hands at play with a thread over a post: nothing passes, nothing is given up, frame by frame
    Hands(Hands),
    /// Loads up to the strength of a suture: knots, crossed threads, turns around a post, hooked bights, edges
    Firm(Firm),
}

#[derive(Args, Debug)]
struct Common {
    /// Folder for the tables
    #[arg(long, default_value = "docs/studies")]
    out: PathBuf,
    /// Cases with these levels of the factors only: `mu=0.1,mu=0.3,l=2`
    #[arg(long, default_value = "", value_name = "FACTOR=LEVEL,...")]
    only: String,
    /// CPU time after which a case is given up: `60s`, `2min`
    #[arg(long, default_value = "60s", value_parser = seconds)]
    budget: f64,
    /// Frames after which a case is given up
    #[arg(long, default_value_t = 5000, value_parser = clap::value_parser!(u32).range(1..))]
    frames: u32,
    /// Cases to run at a time; more than one makes the times of all worse
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    jobs: u16,
    /// Run cases again that are in the table
    #[arg(long)]
    again: bool,
    /// Say how each case goes
    #[arg(long, short)]
    verbose: bool,
}

impl Common {
    fn budget(&self) -> Budget {
        Budget { cpu_s: self.budget, frames: self.frames }
    }

    fn run<S: Study>(&self) -> anyhow::Result<()> {
        let plan = Plan {
            folder: self.out.clone(),
            only: Filter::parse(&self.only, S::FACTORS)?,
            budget: self.budget(),
            jobs: self.jobs.into(),
            again: self.again,
            verbose: self.verbose,
            engine: overhand::engine(),
        };
        let ran = run::<S>(&plan)?;
        eprintln!("{ran} cases were run; see {}", plan.folder.join(S::NAME).with_extension("md").display());
        Ok(())
    }
}

fn main() -> ExitCode {
    let done = match Cli::parse().study {
        Which::Overhand { common, one: None } => common.run::<Overhand>(),
        Which::Overhand { common, one: Some(case) } => overhand::Case::parse(&case).map(|case| {
            Overhand::run(&case, common.budget(), &mut |line| eprintln!("{line}"));
        }),
        Which::Hold { common, one: None } => common.run::<Hold>(),
        Which::Hold { common, one: Some(case) } => hold::Case::parse(&case).map(|case| {
            Hold::run(&case, common.budget(), &mut |line| eprintln!("{line}"));
        }),
        Which::Robustness(robustness) => return verdict(robustness.run()),
        Which::Throws(throws) => return verdict(throws.run()),
        Which::Hands(hands) => return verdict(Ok(hands.run())),
        Which::Firm(firm) => return verdict(firm.run()),
    };
    verdict(done.map(|()| true))
}

/// What the program ends with: done, not as it must be, or an error.
fn verdict(done: anyhow::Result<bool>) -> ExitCode {
    match done {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(e) => {
            eprintln!("error: {e:#}");
            ExitCode::from(2)
        }
    }
}
