//! A file appears whole or not at all.
//!
//! It is written beside its place, as `.innovant-*.part`, and takes its name in the end. A process that is killed leaves
//! such a part; the next one that writes into the same folder clears it. A part is locked as long as its writer lives,
//! so that parts of other processes are left alone.

use std::collections::BTreeSet;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use tempfile::NamedTempFile;

use crate::log::LogError;

/// How the names of parts begin and end.
const PART: (&str, &str) = (".innovant-", ".part");
/// Folders that this process has cleared of parts: once is enough, and a batch writes thousands of files into one.
static CLEARED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Where bytes go until they are complete.
enum Place {
    Stdout(io::Stdout),
    /// A device or a pipe, such as `/dev/null`: there is nothing to replace.
    Special(File),
    /// A file beside the target, which takes the target's place in the end and is deleted if that never comes.
    Beside(NamedTempFile),
}

/// An output that takes its name only when [`AtomicFile::commit`] is called.
pub(super) struct AtomicFile {
    place: Place,
    /// What the user called it.
    path: PathBuf,
    /// What it is, symbolic links followed: a link stays a link.
    target: PathBuf,
}

impl AtomicFile {
    /// Starts an output to `path`; `-` is standard output.
    pub(crate) fn create(path: &Path) -> Result<Self, LogError> {
        let (path, failed) = (path.to_owned(), |source| LogError::Write {
            path: path.to_owned(),
            source,
        });
        let target = fs::canonicalize(&path).unwrap_or_else(|_| path.clone());
        if path.as_os_str() == "-" {
            return Ok(Self {
                place: Place::Stdout(io::stdout()),
                path,
                target,
            });
        }
        let existing = fs::metadata(&target).ok();
        if existing.as_ref().is_some_and(fs::Metadata::is_dir) {
            return Err(failed(io::ErrorKind::IsADirectory.into()));
        }
        let place = match existing {
            Some(about) if !about.is_file() => Place::Special(
                OpenOptions::new()
                    .write(true)
                    .open(&target)
                    .map_err(failed)?,
            ),
            existing => Place::Beside(beside(&target, existing).map_err(failed)?),
        };
        Ok(Self {
            place,
            path,
            target,
        })
    }

    /// The name for messages.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Makes what was written the file of that name.
    pub(super) fn commit(mut self) -> Result<(), LogError> {
        let path = self.path;
        let failed = |source| LogError::Write {
            path: path.clone(),
            source,
        };
        match &mut self.place {
            Place::Stdout(stdout) => stdout.flush().map_err(failed),
            Place::Special(file) => file.flush().map_err(failed),
            Place::Beside(file) => file.as_file().sync_data().map_err(failed),
        }?;
        if let Place::Beside(file) = self.place {
            file.persist(&self.target)
                .map_err(|error| failed(error.error))?;
        }
        Ok(())
    }
}

/// A temporary file in the folder of `target` (a rename does not cross file systems), with the permissions that
/// `target` has, or else those of any new file.
fn beside(target: &Path, existing: Option<fs::Metadata>) -> io::Result<NamedTempFile> {
    if existing
        .as_ref()
        .is_some_and(|about| about.permissions().readonly())
    {
        // The rename would succeed: it is the folder that must be writable. Yet read-only is meant.
        return Err(io::ErrorKind::PermissionDenied.into());
    }
    let folder = target
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    clear_once(folder);
    let mut builder = tempfile::Builder::new();
    builder.prefix(PART.0).suffix(PART.1);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // Passed to open(2), which takes the umask off.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    let file = loop {
        let file = builder.tempfile_in(folder)?;
        // Who clears the folder may have come between: then the lock is theirs, or the file is gone. Where files
        // cannot be locked nobody clears either.
        let lost = matches!(file.as_file().try_lock(), Err(TryLockError::WouldBlock));
        if !lost && file.path().exists() {
            break file;
        }
    };
    if let Some(about) = existing {
        file.as_file().set_permissions(about.permissions())?;
    }
    Ok(file)
}

/// Clears `folder`, the first time that this process writes into it.
fn clear_once(folder: &Path) {
    let Ok(mut cleared) = CLEARED.lock() else {
        return;
    };
    if cleared.insert(folder.to_owned()) {
        clear(folder);
    }
}

/// Deletes the parts that processes left which are no more. What cannot be read or deleted is no reason not to write.
fn clear(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else {
        return;
    };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if name.starts_with(PART.0)
            && name.ends_with(PART.1)
            && let Ok(file) = OpenOptions::new().write(true).open(entry.path())
            && file.try_lock().is_ok()
        {
            let _ = fs::remove_file(entry.path());
        }
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match &mut self.place {
            Place::Stdout(stdout) => stdout.write(bytes),
            Place::Special(file) => file.write(bytes),
            Place::Beside(file) => file.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match &mut self.place {
            Place::Stdout(stdout) => stdout.flush(),
            Place::Special(file) => file.flush(),
            Place::Beside(file) => file.flush(),
        }
    }
}

/// Writes `contents` to `path` (`-` is standard output) so that the file appears whole or not at all.
///
/// # Errors
/// The file cannot be written; one that was there before stays as it was.
pub fn write_file_atomically(path: &Path, contents: &[u8]) -> Result<(), LogError> {
    let mut file = AtomicFile::create(path)?;
    file.write_all(contents).map_err(|source| LogError::Write {
        path: path.to_owned(),
        source,
    })?;
    file.commit()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_the_dead_are_cleared_and_those_of_the_living_are_not() {
        let folder = tempfile::tempdir().unwrap();
        let left = folder.path().join(".innovant-dead.part");
        fs::write(&left, "half").unwrap();
        let other = folder.path().join(".innovant-notes.txt");
        fs::write(&other, "mine").unwrap();
        let target = folder.path().join("model.json");
        let mut living = AtomicFile::create(&target).unwrap();
        assert!(!left.exists() && other.exists());
        living.write_all(b"whole").unwrap();
        // As another process would.
        clear(folder.path());
        living.commit().unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"whole");
    }
}
