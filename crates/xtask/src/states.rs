//! The states of the sample scenes, kept in a file: what is not meant to change what the engine computes changes no
//! bit of it, and what is meant to shows which scenes it changes.

use crate::ci::{self, Recorded};
use crate::program::{self, Profile, Program};
use crate::tally::{Tally, root};
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// The file. It is not among the scenes, since every change in that folder builds again what has them built in.
const KEPT: &str = "crates/xtask/states.txt";

const HEADING: &str = "\
# Sample scenes as the release build records them: name, number of steps, hash of the state after the last, and a hash
# over those after every step (FNV-1a). `cargo xtask bless states` writes this file, where a change is meant.
";

/// What is kept of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct States {
    steps: usize,
    /// Hash of the state after the last step.
    last: u64,
    /// Hash of the hashes after every step.
    all: u64,
}

impl States {
    /// From the hash after every step; of no steps there is nothing to keep.
    fn of(hashes: &[u64]) -> Result<Self, String> {
        let last = *hashes.last().ok_or("it has no step")?;
        Ok(States { steps: hashes.len(), last, all: fnv(hashes.iter().flat_map(|h| h.to_le_bytes())) })
    }

    /// An error that says what is not as it was.
    fn compare(&self, kept: &States) -> Result<(), String> {
        let differs = if self.steps != kept.steps {
            format!("it has {} steps, not {}", self.steps, kept.steps)
        } else if self.last != kept.last {
            format!("the state after the last step is {:016x}, not {:016x}", self.last, kept.last)
        } else if self.all != kept.all {
            format!("the last state is the same, but the hash over all is {:016x}, not {:016x}", self.all, kept.all)
        } else {
            return Ok(());
        };
        Err(format!("{differs} as in {KEPT}; where that is meant, `cargo xtask bless states` writes it anew"))
    }
}

/// FNV-1a, as the state's own hash.
fn fnv(bytes: impl Iterator<Item = u8>) -> u64 {
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

/// The states of scenes by their names.
type Table = BTreeMap<String, States>;

fn kept() -> Result<Table, String> {
    let text = std::fs::read_to_string(root().join(KEPT)).map_err(|e| format!("{KEPT}: {e}"))?;
    read(&text)
}

fn read(text: &str) -> Result<Table, String> {
    let mut table = Table::new();
    for (i, line) in text.lines().enumerate().filter(|(_, line)| !line.starts_with('#')) {
        let hash = |word: &str| u64::from_str_radix(word, 16).ok().filter(|_| word.len() == 16);
        let states = match line.split_whitespace().collect::<Vec<_>>()[..] {
            [name, steps, last, all] => steps
                .parse()
                .ok()
                .zip(hash(last).zip(hash(all)))
                .map(|(steps, (last, all))| (name.to_string(), States { steps, last, all })),
            _ => None,
        };
        let (name, states) =
            states.ok_or_else(|| format!("{KEPT}:{}: wanted a name, a number and two hashes: {line}", i + 1))?;
        if table.insert(name.clone(), states).is_some() {
            return Err(format!("{KEPT}:{}: there is already a line of `{name}`", i + 1));
        }
    }
    Ok(table)
}

fn write(table: &Table) -> String {
    table.iter().fold(HEADING.to_string(), |mut text, (name, States { steps, last, all })| {
        let _ = writeln!(text, "{name:20} {steps:5} {last:016x} {all:016x}");
        text
    })
}

/// Compares what scenes recorded with what is kept.
pub fn check(tally: &mut Tally, sutura: &Program, recorded: &[Recorded]) {
    let kept = match kept() {
        Ok(kept) => kept,
        Err(why) => return tally.count("states", Err(why)),
    };
    let mut same = 0;
    // A scene of a folder below, as `validation/capstan`, is no sample and has no line.
    for Recorded { name, input, .. } in recorded.iter().filter(|r| !r.name.contains('/')) {
        let wanted = kept
            .get(name)
            .ok_or_else(|| format!("{KEPT} has no line of this scene; `cargo xtask bless states` writes it"));
        let states = sutura.hashes(input).and_then(|hashes| States::of(&hashes));
        let result = wanted.and_then(|wanted| states?.compare(wanted));
        same += usize::from(result.is_ok());
        tally.count(&format!("states of {name}"), result);
    }
    println!("   states of {same} scenes: as in {KEPT}");
}

/// Writes the file anew from all sample scenes; not where one of them fails.
pub fn bless(tally: &mut Tally) {
    let Some(sutura) = program::build(tally, Profile::Release) else { return };
    let result = ci::sample_names().and_then(|names| {
        let recorded = ci::record(tally, &sutura, &names);
        if recorded.len() < names.len() {
            return Err(format!("not every scene passed; {KEPT} is as it was"));
        }
        let states = |r: &Recorded| Ok((r.name.clone(), States::of(&sutura.hashes(&r.input)?)?));
        let table: Table = recorded.iter().map(states).collect::<Result<_, String>>()?;
        let old = kept().unwrap_or_default();
        let changed: Vec<&str> =
            table.iter().filter(|(name, states)| old.get(*name) != Some(*states)).map(|(name, _)| &**name).collect();
        println!("   {KEPT}: {} of {} lines changed {changed:?}", changed.len(), table.len());
        std::fs::write(root().join(KEPT), write(&table)).map_err(|e| format!("{KEPT}: {e}"))
    });
    tally.count("states", result);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_state_is_told_and_what_of_it_differs() {
        let hashes = [7, 8, 9];
        let kept = States::of(&hashes).unwrap();
        let found = |hashes: &[u64]| States::of(hashes).unwrap().compare(&kept);
        assert_eq!(found(&hashes), Ok(()));
        let last = found(&[7, 8, 10]).unwrap_err();
        assert!(last.starts_with("the state after the last step is 000000000000000a, not 0000000000000009"), "{last}");
        assert!(last.contains("cargo xtask bless states"));
        // The same end by another way, two states in the wrong order among them.
        for other in [[7, 6, 9], [8, 7, 9]] {
            let all = found(&other).unwrap_err();
            assert!(all.starts_with("the last state is the same, but the hash over all is"), "{all}");
        }
        assert!(found(&[7, 8, 8, 9]).unwrap_err().starts_with("it has 4 steps, not 3"));
        assert!(States::of(&[]).is_err());
    }

    /// Numbers of the authors of FNV, of the empty text and of `foobar`.
    #[test]
    fn the_hash_is_fnv_1a() {
        assert_eq!(fnv("".bytes()), 0xcbf2_9ce4_8422_2325);
        assert_eq!(fnv("foobar".bytes()), 0x8594_4171_f739_67e8);
    }

    #[test]
    fn what_is_written_is_read() {
        let table = Table::from([
            ("capstan".to_string(), States { steps: 716, last: 1, all: u64::MAX }),
            ("twine".to_string(), States { steps: 1, last: 0, all: 2 }),
        ]);
        assert_eq!(read(&write(&table)), Ok(table));
    }

    #[test]
    fn a_damaged_line_is_refused_with_its_number() {
        let good = "capstan 716 1f324c6f7df6a42d 0123456789abcdef\n";
        assert_eq!(read(good).unwrap().len(), 1);
        for bad in [&good[..good.len() - 2], &good.replace("716", "x"), &good.replace("716 ", ""), "capstan", ""] {
            let error = read(&format!("# heading\n{bad}\n")).unwrap_err();
            assert!(error.contains("states.txt:2:"), "{error}");
        }
        assert!(read(&good.repeat(2)).unwrap_err().contains("already"));
    }

    #[test]
    fn every_sample_scene_has_its_states_kept_and_no_other() {
        assert_eq!(kept().unwrap().into_keys().collect::<Vec<_>>(), ci::sample_names().unwrap());
    }
}
