//! Chores of this repository, run as `cargo xtask <command>`. Every command that the checks consist of is written down
//! here and nowhere else; `.ci/run` only calls `cargo xtask ci`.

mod ci;
mod fuzz;
mod imports;
mod program;
mod release;
mod states;
mod tally;
mod viewer;

use std::process::ExitCode;
use tally::Tally;

const HELP: &str = "\
cargo xtask ci               the whole check: format, lints, tests, documentation, sample scenes and their GLB files, same bits in every build
cargo xtask test [ARGS]      all tests (`cargo test --workspace`), with a count at the end
cargo xtask scenes [NAMES]   run sample scenes with the release build, all of them without names: their states are those that
                             are kept, and they are valid GLB
cargo xtask bench [ARGS]     `sutura bench` with the release build
cargo xtask fuzz [TARGET] [--minutes M]
                             fuzz one target or all, each for so long (10)
cargo xtask imports [--list] do modules of the engine import each other in a circle? --list prints every import
cargo xtask viewer           the part of the whole check that is about the plugin for Bevy and the viewer
cargo xtask bless [picture]  run the square knot and take its last picture for the README
cargo xtask bless states     run all sample scenes and keep their states, where these are meant to change
cargo xtask release          is this commit ready to be released? (changes nothing)";

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let Some((command, rest)) = args.split_first() else {
        println!("{HELP}");
        return ExitCode::SUCCESS;
    };
    let takes_arguments = matches!(command.as_str(), "test" | "scenes" | "bench" | "fuzz" | "imports" | "bless");
    let mut tally = Tally::default();
    match command.as_str() {
        _ if !takes_arguments && !rest.is_empty() => return usage(&format!("`{command}` takes no arguments")),
        "ci" => ci::everything(&mut tally),
        "test" => ci::tests(&mut tally, rest),
        "scenes" => {
            let recorded = ci::scenes(&mut tally, rest);
            ci::glb(&mut tally, &recorded);
        }
        "bench" => program::bench(&mut tally, rest),
        "fuzz" => {
            if let Err(problem) = fuzz::command(&mut tally, rest) {
                return usage(&problem);
            }
        }
        "imports" => {
            if let Err(problem) = imports::command(&mut tally, rest) {
                return usage(&problem);
            }
        }
        "viewer" => viewer::check(&mut tally),
        "bless" => match rest.first().map(String::as_str) {
            _ if rest.len() > 1 => return usage("`bless` takes one argument"),
            None | Some("picture") => program::bless_picture(&mut tally),
            Some("states") => states::bless(&mut tally),
            Some(what) => return usage(&format!("`bless` takes `picture` or `states`, not `{what}`")),
        },
        "release" => release::ready(&mut tally),
        "help" | "--help" | "-h" => {
            println!("{HELP}");
            return ExitCode::SUCCESS;
        }
        _ => return usage(&format!("there is no command `{command}`")),
    }
    tally.close()
}

fn usage(problem: &str) -> ExitCode {
    eprintln!("error: {problem}\n\n{HELP}");
    ExitCode::from(2)
}
