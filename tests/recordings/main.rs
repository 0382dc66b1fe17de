//! What `explain` says, blind, of public recordings of real plants: through the command line (`process`) and through the
//! library (`mechanical`).
//!
//! They are data of others, so they are not part of the project: the tests look for them in `../shared/recordings` and
//! are left out, with a printed reason, where that is missing. Sources and published figures are in the notes there.

#[path = "../support/folder.rs"]
mod folder;
mod mechanical;
mod process;

use std::path::{Path, PathBuf};

/// Their folder, or `None` with a printed reason.
fn recordings() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/recordings");
    if folder.is_dir() {
        Some(folder)
    } else {
        println!("left out: {} is missing", folder.display());
        None
    }
}
