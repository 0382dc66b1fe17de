//! Standard output, and files that must be writable before the work starts.

use std::collections::HashSet;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use crate::log::{LogError, Source, write_file_atomically};

/// Writes text to standard output.
pub(crate) fn print(text: &str) -> io::Result<()> {
    let mut stdout = io::stdout().lock();
    stdout.write_all(text.as_bytes())?;
    stdout.flush()
}

/// Writes text to standard error; nobody reading it is no reason to stop.
pub(crate) fn note(text: &str) {
    let _ = io::stderr().write_all(text.as_bytes());
}

/// A place for the result that was writable when the work began.
#[derive(Debug)]
pub(crate) struct Output {
    path: PathBuf,
}

impl Output {
    /// Checks that `path` (`-` is standard output) can be written, without leaving a trace, and that it is not one
    /// of the files that are read.
    ///
    /// # Errors
    /// [`LogError::Write`], or what is read would be overwritten.
    pub(crate) fn check(path: &Path, read: &[&Path]) -> anyhow::Result<Self> {
        let output = Self {
            path: path.to_owned(),
        };
        if output.is_stdout() {
            return Ok(output);
        }
        let target = fs::canonicalize(path);
        if let Ok(target) = &target {
            for source in read {
                if fs::canonicalize(source).is_ok_and(|source| source == *target) {
                    anyhow::bail!(
                        "{}: this file is read, and writing the result to it would destroy it; choose another name \
                         for --output",
                        path.display()
                    );
                }
            }
        }
        let target = target.unwrap_or_else(|_| path.to_owned());
        output
            .try_place(&target)
            .map_err(|source| LogError::Write {
                path: path.to_owned(),
                source,
            })?;
        Ok(output)
    }

    /// Checks the two files that a command can write, the document and the page.
    ///
    /// # Errors
    /// Those of [`Output::check`], or both are the same file.
    pub(crate) fn check_both(
        document: Option<&Path>,
        page: Option<&Path>,
        read: &[&Path],
    ) -> anyhow::Result<(Option<Self>, Option<Self>)> {
        if let (Some(document), Some(page)) = (document, page)
            && document == page
        {
            anyhow::bail!(
                "{}: --output and --report name the same file; give two",
                document.display()
            );
        }
        let place = |path: Option<&Path>| path.map(|path| Self::check(path, read)).transpose();
        Ok((place(document)?, place(page)?))
    }

    fn try_place(&self, target: &Path) -> io::Result<()> {
        match fs::metadata(target) {
            Ok(about) if about.is_dir() => return Err(io::ErrorKind::IsADirectory.into()),
            Ok(about) if about.permissions().readonly() => {
                return Err(io::ErrorKind::PermissionDenied.into());
            }
            // A device or a pipe: opening it may have an effect, so it waits until there is something to write.
            Ok(about) if !about.is_file() => return Ok(()),
            _ => {}
        }
        if self.path.as_os_str().is_empty() {
            return Err(io::ErrorKind::NotFound.into());
        }
        let folder = target
            .parent()
            .filter(|folder| !folder.as_os_str().is_empty())
            .unwrap_or(Path::new("."));
        // Deleted as soon as it is closed, which is here.
        tempfile::tempfile_in(folder).map(drop)
    }

    /// Whether the result goes to standard output.
    pub(crate) fn is_stdout(&self) -> bool {
        self.path.as_os_str() == "-"
    }

    /// The name for messages.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Writes the result; the file appears whole or not at all.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub(crate) fn write(&self, text: &str) -> Result<(), LogError> {
        write_file_atomically(&self.path, text.as_bytes())
    }
}

/// The files among sources.
pub(crate) fn paths(sources: &[Source]) -> Vec<&Path> {
    sources
        .iter()
        .filter_map(|source| match source {
            Source::Path(path) => Some(path.as_path()),
            Source::Stdin => None,
        })
        .collect()
}

/// Refuses a recording that is named twice: its noise would count as information. Standard input can be read once.
///
/// # Errors
/// Says which.
pub(crate) fn check_distinct(sources: &[Source]) -> anyhow::Result<()> {
    // A batch has thousands: each is looked at once.
    let mut seen = HashSet::with_capacity(sources.len());
    for source in sources {
        match source {
            Source::Stdin if !seen.insert(PathBuf::from("-")) => anyhow::bail!(
                "`-` is given twice, and standard input can be read only once: name a file"
            ),
            Source::Stdin => {}
            Source::Path(path) => {
                let file = fs::canonicalize(path).unwrap_or_else(|_| path.clone());
                // A pipe may be named twice and is another one each time.
                let is_special = fs::metadata(&file).is_ok_and(|about| !about.is_file());
                if !is_special && !seen.insert(file) {
                    anyhow::bail!(
                        "{source} is given twice: what it says would count twice; name each file once"
                    );
                }
            }
        }
    }
    Ok(())
}
