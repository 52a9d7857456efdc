//! The built-in scenes: listed, shown, copied out, and found by name for `run`.

use crate::args::{Scenes, ScenesAction};
use crate::{say, table};
use anyhow::{Context as _, bail};
use sutura_scene::{Sample, samples};

/// The command `sutura scenes`.
pub fn scenes(args: &Scenes) -> anyhow::Result<()> {
    match args.action.as_ref().unwrap_or(&ScenesAction::List) {
        ScenesAction::List => {
            let mut t = table(&["scene", "what it shows"], &[]);
            for sample in samples() {
                t.add_row([sample.name, sample.title]);
            }
            say(&format!("{t}\n\nRun one with `sutura run NAME`, copy one to a file with `sutura scenes copy NAME`."))
        }
        ScenesAction::Show { name } => say(find(name)?.text),
        ScenesAction::Copy { name, file, force } => {
            let sample = find(name)?;
            let file = file.clone().unwrap_or_else(|| format!("{}.toml", sample.name).into());
            if file.exists() && !force {
                bail!("{} exists; `--force` replaces it", file.display());
            }
            crate::output::put(&file, sample.text.as_bytes())?;
            say(&format!("wrote {}; run it with `sutura run {}`", file.display(), file.display()))
        }
    }
}

/// The built-in scene of a name.
pub fn find(name: &str) -> anyhow::Result<&'static Sample> {
    let wanted = name.strip_suffix(".toml").unwrap_or(name);
    samples().iter().find(|s| s.name == wanted).with_context(|| {
        let names: Vec<&str> = samples().iter().map(|s| s.name).collect();
        match crate::nearest(wanted, names.iter().copied()) {
            Some(near) => format!("no built-in scene is called `{name}`; did you mean `{near}`?"),
            None => format!("no built-in scene is called `{name}`; there are {}", names.join(", ")),
        }
    })
}
