//! The command `sutura view`: starts the viewer, which is a program of its own, or says how to get it.

use crate::args::View;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Its name.
const VIEWER: &str = "sutura-view";

/// How to get it.
const GET_IT: &str = "\
the viewer `sutura-view` is neither beside this program nor in PATH. It is built apart, since it brings a game engine (some 20 minutes of one core):

    cargo install --path bevy/sutura-view

in a clone of the repository; `scripts/viewer_setup.sh` installs what it needs to run on Debian. More in docs/viewer.md";

/// Runs the command; false when the viewer ended with an error, which it has said itself.
pub fn view(args: &View) -> anyhow::Result<bool> {
    let Some(program) = find() else { anyhow::bail!(GET_IT) };
    let status = Command::new(&program).args(&args.scene).args(&args.rest).status();
    let status = status.map_err(|e| anyhow::anyhow!("cannot start {}: {e}", program.display()))?;
    Ok(status.success())
}

/// Beside this program, in the build folder of the viewer, or in PATH.
fn find() -> Option<PathBuf> {
    let name = format!("{VIEWER}{}", std::env::consts::EXE_SUFFIX);
    let own = std::env::current_exe().ok();
    let beside = own.as_deref().and_then(Path::parent).map(|folder| folder.join(&name));
    let path = std::env::var_os("PATH").unwrap_or_default();
    beside.into_iter().chain(std::env::split_paths(&path).map(|folder| folder.join(&name))).find(|p| p.is_file())
}
