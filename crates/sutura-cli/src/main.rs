//! The command-line program of Sutura: runs scenes, measures, plots and draws them, recognizes knots, and times itself.

mod args;
mod bench;
mod export;
mod knot;
mod knot_strength;
mod map;
mod output;
mod paper;
mod plot;
mod presets;
mod replay;
mod run;
mod scenes;
mod still;
mod validate;
mod view;

use args::{Cli, Command};
use clap::Parser as _;
use std::io::Write as _;
use std::process::ExitCode;

/// Everything asked for was done, and what was to hold holds.
const HOLDS: u8 = 0;
/// It was done, and something that was to hold does not.
const FAILS: u8 = 1;
/// It could not be done.
const BAD_INPUT: u8 = 2;

fn main() -> ExitCode {
    let judged = |holds: bool| if holds { HOLDS } else { FAILS };
    let done = match Cli::parse().command {
        None => run::run(&args::Run::of_sample("square_knot")).map(judged),
        Some(Command::Run(a)) => run::run(&a).map(judged),
        Some(Command::Scenes(a)) => scenes::scenes(&a).map(|()| HOLDS),
        Some(Command::Knot(a)) => knot::knot(&a),
        Some(Command::KnotStrength(a)) => knot_strength::knot_strength(&a).map(|()| HOLDS),
        Some(Command::Presets(a)) => presets::presets(&a).map(|()| HOLDS),
        Some(Command::Bench(a)) => bench::bench(&a).map(|()| HOLDS),
        Some(Command::Validate(a)) => validate::validate(&a).map(judged),
        Some(Command::Paper(a)) => paper::paper(&a).map(judged),
        Some(Command::Replay(a)) => replay::replay(&a).map(judged),
        Some(Command::Export(a)) => export::export(&a).map(|()| HOLDS),
        Some(Command::View(a)) => view::view(&a).map(judged),
    };
    ExitCode::from(match done {
        Ok(code) => code,
        Err(e) if e.downcast_ref::<std::io::Error>().is_some_and(|e| e.kind() == std::io::ErrorKind::BrokenPipe) => {
            HOLDS
        }
        Err(e) => {
            eprintln!("error: {e:#}");
            BAD_INPUT
        }
    })
}

/// Prints to standard output. A reader that went away, as `head` does, is an error of its own kind and no panic.
fn say(text: &str) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes())?;
    if !text.ends_with('\n') {
        out.write_all(b"\n")?;
    }
    Ok(out.flush()?)
}

/// Prints a value as JSON.
fn say_json<T: serde::Serialize>(value: &T) -> anyhow::Result<()> {
    say(&serde_json::to_string_pretty(value)?)
}

/// A table with a line under its headings; `numbers` are the columns to align to the right.
fn table(headings: &[&str], numbers: &[usize]) -> comfy_table::Table {
    let mut table = comfy_table::Table::new();
    let line = comfy_table::LineStyle::none().fill('─').junction('─');
    table
        .load_style(comfy_table::TableStyle::new().header_separator(line))
        .set_content_arrangement(comfy_table::ContentArrangement::Dynamic);
    table.set_header(headings.iter().copied());
    for &column in numbers {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(comfy_table::CellAlignment::Right);
        }
    }
    table
}

/// The word of `known` nearest to `word`, when at most a third of it is wrong: a farther one would mislead.
fn nearest<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let distances = known.into_iter().map(|k| (strsim::damerau_levenshtein(&word.to_lowercase(), k), k));
    distances.filter(|(d, k)| *d <= (word.chars().count().max(k.chars().count()) / 3).max(1)).min().map(|(_, k)| k)
}
