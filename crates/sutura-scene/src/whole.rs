//! Files that are whole or not there.

use std::path::Path;

/// Ending of a file that is being written.
pub const PARTIAL: &str = ".partial";

/// Writes a file by way of another beside it, which is moved to its place when it is whole: whoever is stopped, or
/// finds the disk full, leaves what was there before. What is no plain file (a pipe, a device) is written to as it is.
pub fn write_whole(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    // A link stays one.
    let path = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
    if path.exists() && !path.is_file() {
        return std::fs::write(path, bytes);
    }
    let mut beside = path.clone().into_os_string();
    beside.push(PARTIAL);
    let done = std::fs::write(&beside, bytes).and_then(|()| std::fs::rename(&beside, &path));
    if done.is_err() {
        // The first error is the one to tell.
        let _ = std::fs::remove_file(&beside);
    }
    done
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_as_a_whole_or_left() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.csv");
        write_whole(&file, b"old").unwrap();
        write_whole(&file, b"new").unwrap();
        assert_eq!(std::fs::read(&file).unwrap(), b"new");
        assert!(write_whole(&folder.path().join("none/a.csv"), b"new").is_err());
        assert!(write_whole(folder.path(), b"new").is_err());
        // The place of the file beside it is taken, so it cannot be written.
        std::fs::create_dir(folder.path().join("a.csv.partial")).unwrap();
        assert!(write_whole(&file, b"newer").is_err());
        assert_eq!(std::fs::read(&file).unwrap(), b"new");
    }

    #[test]
    #[cfg(unix)]
    fn a_link_stays_one_and_a_full_device_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("a"), folder.path().join("b"));
        std::fs::write(&file, b"old").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        write_whole(&link, b"new").unwrap();
        assert!(link.is_symlink() && std::fs::read(&file).unwrap() == b"new");
        if Path::new("/dev/full").exists() {
            assert_eq!(
                write_whole(Path::new("/dev/full"), b"new").unwrap_err().kind(),
                std::io::ErrorKind::StorageFull
            );
        }
    }
}
