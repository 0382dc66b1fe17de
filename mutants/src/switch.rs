//! Which mutant is on, and which were met: one program holds them all, so that it is built once.

use std::io::Write;
use std::sync::LazyLock;
use std::sync::atomic::{AtomicBool, Ordering};

const MOST: usize = 20_000;

static ON: LazyLock<usize> = LazyLock::new(|| {
    std::env::var("INNOVANT_MUTANT")
        .ok()
        .and_then(|number| number.parse().ok())
        .unwrap_or(0)
});
static MET_FILE: LazyLock<Option<String>> = LazyLock::new(|| std::env::var("INNOVANT_MET").ok());
static MET: [AtomicBool; MOST] = [const { AtomicBool::new(false) }; MOST];

#[inline]
pub(crate) fn on(number: usize) -> bool {
    if *ON == number {
        return true;
    }
    if let Some(path) = &*MET_FILE
        && !MET[number].swap(true, Ordering::Relaxed)
    {
        let file = std::fs::OpenOptions::new().append(true).create(true).open(path);
        // A site that is not noted is one that no test seems to reach: told at the end.
        let _ = file.and_then(|mut file| file.write_all(format!("{number}\n").as_bytes()));
    }
    false
}
