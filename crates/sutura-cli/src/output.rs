//! Files that the program writes, and the folder of a run.
//!
//! What an earlier run left in the folder is removed before the next one begins, by a list that the earlier one wrote;
//! no other file is touched. Each file is moved to its place when it is whole, and the report comes last: a folder with
//! a report has everything that the run left, and one without is of a run that did not end. The list is locked while a
//! run goes on, so that two do not mix; the lock goes with the process, however that ends.

use anyhow::{Context as _, bail};
use std::collections::BTreeSet;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{ErrorKind, Read as _, Seek as _, Write as _};
use std::path::{Component, Path, PathBuf};
use sutura_scene::{PARTIAL, write_whole};

/// Writes a file, whole or not at all.
pub fn put(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    write_whole(path, bytes).with_context(|| format!("cannot write {}", path.display()))
}

/// The report of a run.
pub const REPORT: &str = "report.json";
/// What else is always called alike.
const FIXED: [&str; 2] = ["trajectory.sutura", "input.sutura"];
/// Folders that belong to a run as a whole.
const SUBFOLDERS: [&str; 3] = ["series", "plots", "stills"];
/// The list of what a run wrote.
const LIST: &str = ".sutura-run";
const LIST_HEAD: &str =
    "# Results of a run of sutura in this folder, which the next run here replaces; locked while one goes on.\n";

/// The folder of a run that is under way.
pub struct Folder {
    path: PathBuf,
    list: File,
    /// What is in the list.
    names: BTreeSet<String>,
    /// Results of an earlier run that had to stay.
    kept: BTreeSet<String>,
}

impl Folder {
    /// Makes the folder, or takes over one that is there: removes the results of the run before, but for the file from
    /// which this one starts. An error where another run goes on, or where files that are of no run would be in the
    /// way; `saves` are the names of states to be written.
    pub fn open(path: &Path, start: Option<&Path>, saves: &[String]) -> anyhow::Result<Folder> {
        std::fs::create_dir_all(path).with_context(|| format!("cannot make the folder {}", path.display()))?;
        let list_path = path.join(LIST);
        let cannot = || format!("cannot write {}", list_path.display());
        let mut list = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(&list_path)
            .with_context(cannot)?;
        match list.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => bail!(
                "another run is writing into {}; wait for it, or choose another folder with --out",
                path.display()
            ),
            // Not every file system has locks.
            Err(TryLockError::Error(e)) if e.kind() == ErrorKind::Unsupported => {}
            Err(TryLockError::Error(e)) => {
                return Err(e).with_context(|| format!("cannot lock {}", list_path.display()));
            }
        }
        let mut text = String::new();
        list.read_to_string(&mut text).with_context(|| format!("cannot read {}", list_path.display()))?;
        let mut earlier: BTreeSet<String> = text.lines().filter(|l| is_inside(l)).map(str::to_owned).collect();
        if text.is_empty() && is_report(&path.join(REPORT)) {
            earlier = unlisted(path);
        }
        refuse_others(path, &earlier, saves)?;

        let start = start.and_then(|s| s.canonicalize().ok());
        let kept: BTreeSet<String> =
            earlier.iter().filter(|n| start.is_some() && path.join(n).canonicalize().ok() == start).cloned().collect();
        // The report goes first: without it nothing passes for a result.
        for name in [REPORT]
            .into_iter()
            .chain(earlier.iter().map(String::as_str))
            .filter(|n| earlier.contains(*n) && !kept.contains(*n))
        {
            for file in [path.join(name), path.join(format!("{name}{PARTIAL}"))] {
                match std::fs::remove_file(&file) {
                    Err(e) if e.kind() != ErrorKind::NotFound => {
                        return Err(e).with_context(|| format!("cannot remove {} of an earlier run", file.display()));
                    }
                    _ => {}
                }
            }
        }
        for name in SUBFOLDERS {
            // One that is not empty stays.
            let _ = std::fs::remove_dir(path.join(name));
        }
        let head = kept.iter().fold(LIST_HEAD.to_owned(), |text, name| text + name + "\n");
        list.set_len(0)
            .and_then(|()| list.rewind())
            .and_then(|()| list.write_all(head.as_bytes()))
            .with_context(cannot)?;
        Ok(Folder { path: path.into(), list, names: kept.clone(), kept })
    }

    /// Writes a result.
    pub fn write(&mut self, name: &str, bytes: &[u8]) -> anyhow::Result<()> {
        let path = self.path.join(name);
        let again = self.kept.remove(name);
        if !again {
            if !self.names.insert(name.into()) {
                bail!("two results would be called {}", path.display());
            }
            if path.symlink_metadata().is_ok() {
                bail!(
                    "{} is there, and not of an earlier run: move it away, or choose another folder with --out",
                    path.display()
                );
            }
            // Before the file, so that it is known to the next run whatever happens.
            self.list
                .write_all(format!("{name}\n").as_bytes())
                .with_context(|| format!("cannot write {}", self.path.join(LIST).display()))?;
        }
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
        }
        put(&path, bytes)
    }
}

/// Whether a name leads to a file within the folder; a list may have been changed.
fn is_inside(name: &str) -> bool {
    !name.is_empty()
        && !name.starts_with('#')
        && Path::new(name).components().all(|c| matches!(c, Component::Normal(_)))
}

/// Whether a file is a report of a run.
fn is_report(path: &Path) -> bool {
    let report = std::fs::read(path).ok().and_then(|bytes| serde_json::from_slice::<serde_json::Value>(&bytes).ok());
    report.is_some_and(|r| r["scene"].is_string() && r["state_hash"].is_string())
}

/// The results of a run of a version that wrote no list.
fn unlisted(path: &Path) -> BTreeSet<String> {
    let mut names: BTreeSet<String> = [REPORT].into_iter().chain(FIXED).map(str::to_owned).collect();
    names.extend(in_subfolders(path).into_iter().filter(|n| [".csv", ".svg", ".png"].iter().any(|e| n.ends_with(e))));
    names
}

/// What there is in the folders of a run.
fn in_subfolders(path: &Path) -> Vec<String> {
    let mut names = Vec::new();
    for folder in SUBFOLDERS {
        let Ok(entries) = std::fs::read_dir(path.join(folder)) else { continue };
        names.extend(entries.filter_map(|e| Some(format!("{folder}/{}", e.ok()?.file_name().to_string_lossy()))));
    }
    names.sort();
    names
}

/// An error where files that are of no run would be in the way of this one.
fn refuse_others(path: &Path, earlier: &BTreeSet<String>, saves: &[String]) -> anyhow::Result<()> {
    let own = || [REPORT, LIST].into_iter().chain(FIXED).chain(SUBFOLDERS);
    if let Some((k, name)) = saves.iter().enumerate().find(|(k, n)| own().any(|o| o == *n) || saves[..*k].contains(n)) {
        let by = if saves[..k].contains(name) { "another phase" } else { "the run itself" };
        bail!("the state of a phase is to be saved as {name}, which {by} writes: give it another name");
    }
    let fixed = [REPORT].into_iter().chain(FIXED).map(str::to_owned).chain(saves.iter().cloned());
    let there = fixed.filter(|n| path.join(n).symlink_metadata().is_ok()).chain(in_subfolders(path));
    let is_known =
        |name: &String| earlier.contains(name) || name.strip_suffix(PARTIAL).is_some_and(|n| earlier.contains(n));
    match there.into_iter().find(|n| !is_known(n)) {
        Some(name) => bail!(
            "{} is not of an earlier run: move it away, or choose another folder with --out",
            path.join(name).display()
        ),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn listing(folder: &Path) -> Vec<String> {
        let mut names = in_subfolders(folder);
        names.extend(
            std::fs::read_dir(folder)
                .unwrap()
                .map(|e| e.unwrap())
                .filter(|e| e.path().is_file())
                .map(|e| e.file_name().to_string_lossy().into()),
        );
        names.sort();
        names
    }

    #[test]
    fn only_results_of_the_run_before_are_removed() {
        let temporary = tempfile::tempdir().unwrap();
        let path = temporary.path().join("run");
        let mut folder = Folder::open(&path, None, &[]).unwrap();
        for name in ["series/frame.csv", "plots/tension.svg", "tied.state", REPORT] {
            folder.write(name, b"one").unwrap();
        }
        assert!(folder.write(REPORT, b"two").unwrap_err().to_string().contains("two results"));
        assert!(Folder::open(&path, None, &[]).err().unwrap().to_string().contains("another run"));
        drop(folder);
        std::fs::write(path.join("run.glb"), b"mine").unwrap();
        // What was being written when a run was ended.
        std::fs::write(path.join("tied.state.partial"), b"cut").unwrap();
        let mut folder = Folder::open(&path, Some(&path.join("../run/tied.state")), &["tied.state".into()]).unwrap();
        assert_eq!(listing(&path), [LIST, "run.glb", "tied.state", "tied.state.partial"]);
        assert!(!path.join("plots").exists());
        folder.write("tied.state", b"two").unwrap();
        drop(folder);
        Folder::open(&path, None, &[]).unwrap();
        assert_eq!(listing(&path), [LIST, "run.glb"]);
    }

    #[test]
    fn files_of_others_are_neither_removed_nor_replaced() {
        let refused = |name: &str, saves: &[String]| {
            let temporary = tempfile::tempdir().unwrap();
            let file = temporary.path().join(name);
            std::fs::create_dir_all(file.parent().unwrap()).unwrap();
            std::fs::write(&file, b"{}").unwrap();
            let error = Folder::open(temporary.path(), None, saves).err().unwrap().to_string();
            assert!(error.contains("not of an earlier run") && error.contains("--out") && file.is_file(), "{error}");
        };
        refused(REPORT, &[]);
        refused("plots/mine.png", &[]);
        refused("my.toml", &["my.toml".into()]);
        let temporary = tempfile::tempdir().unwrap();
        for saves in [&["a".to_owned(), "a".into()][..], &[REPORT.into()], &["plots".into()]] {
            assert!(Folder::open(temporary.path(), None, saves).err().unwrap().to_string().contains("another name"));
        }
        // A list that somebody changed leads nowhere else.
        let temporary = tempfile::tempdir().unwrap();
        let (path, other) = (temporary.path().join("run"), temporary.path().join("other"));
        std::fs::create_dir(&path).unwrap();
        std::fs::write(&other, b"mine").unwrap();
        std::fs::write(path.join(LIST), format!("../other\n{}\n", other.display())).unwrap();
        Folder::open(&path, None, &[]).unwrap();
        assert!(other.is_file());
    }

    #[test]
    fn results_of_a_version_without_a_list_are_replaced() {
        let temporary = tempfile::tempdir().unwrap();
        let path = temporary.path();
        std::fs::create_dir(path.join("series")).unwrap();
        std::fs::write(path.join("series/frame.csv"), b"old").unwrap();
        std::fs::write(path.join(REPORT), br#"{ "scene": "s", "state_hash": "0" }"#).unwrap();
        Folder::open(path, None, &[]).unwrap();
        assert_eq!(listing(path), [LIST]);
    }
}
