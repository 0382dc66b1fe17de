//! A progress bar on a terminal, for work that takes a while.

use std::fs;
use std::io::{self, IsTerminal};

use indicatif::{ProgressBar, ProgressStyle};

use crate::identify::ReadProgress;
use crate::log::Source;

/// Below this many bytes reading is over before a bar has been seen.
const LARGE: u64 = 50 << 20;

/// Progress of reading the recordings, or of work on many things.
#[derive(Debug)]
pub(crate) struct Progress {
    bar: Option<ProgressBar>,
}

impl Progress {
    /// A bar over the bytes of all files, if standard error is a terminal and there are many.
    pub(crate) fn over(sources: &[Source], quiet: bool) -> Self {
        let bytes: u64 = sources
            .iter()
            .map(|source| match source {
                Source::Path(path) => fs::metadata(path).map_or(0, |about| about.len()),
                Source::Stdin => 0,
            })
            .sum();
        if quiet || bytes < LARGE || !io::stderr().is_terminal() {
            return Self { bar: None };
        }
        let bar = ProgressBar::new(bytes);
        let style = ProgressStyle::with_template(
            "{msg} {wide_bar} {bytes}/{total_bytes} {bytes_per_sec}, {eta} left",
        );
        if let Ok(style) = style {
            bar.set_style(style);
        }
        bar.set_message("reading");
        Self { bar: Some(bar) }
    }

    /// What [`FileRecords::with_progress`](crate::identify::FileRecords::with_progress) calls: the bytes read of the
    /// current file, which start again at each.
    pub(crate) fn callback(&self) -> ReadProgress<'static> {
        let bar = self.bar.clone();
        let (mut before, mut last) = (0, 0);
        Box::new(move |bytes, _| {
            if bytes < last {
                before += last;
            }
            last = bytes;
            if let Some(bar) = &bar {
                bar.set_position(before + bytes);
                if bar.length().is_some_and(|length| before + bytes >= length) {
                    bar.set_message("fitting");
                }
            }
        })
    }

    /// A bar over `count` things, if standard error is a terminal.
    pub(crate) fn counting(count: usize, what: &'static str, quiet: bool) -> Self {
        if quiet || count < 2 || !io::stderr().is_terminal() {
            return Self { bar: None };
        }
        let bar = ProgressBar::new(count as u64);
        if let Ok(style) =
            ProgressStyle::with_template("{wide_bar} {pos} of {len} {msg}, {eta} left")
        {
            bar.set_style(style);
        }
        bar.set_message(what);
        Self { bar: Some(bar) }
    }

    /// A count of runs, how many there will be is not known, if standard error is a terminal.
    pub(crate) fn runs(quiet: bool) -> Self {
        if quiet || !io::stderr().is_terminal() {
            return Self { bar: None };
        }
        let bar = ProgressBar::new_spinner();
        if let Ok(style) =
            ProgressStyle::with_template("{spinner} {pos} runs of the simulator, {elapsed}")
        {
            bar.set_style(style);
        }
        Self { bar: Some(bar) }
    }

    /// One more of them is done.
    pub(crate) fn one_more(&self) {
        if let Some(bar) = &self.bar {
            bar.inc(1);
        }
    }

    /// Writes to the terminal while the bar is out of the way.
    pub(crate) fn aside(&self, write: impl FnOnce()) {
        match &self.bar {
            Some(bar) => bar.suspend(write),
            None => write(),
        }
    }

    /// Takes the bar away.
    pub(crate) fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.finish();
    }
}
