//! Where the numbers of a page come from: the recordings.

use serde::Serialize;

use super::typeset_number::{exact, with_unit};
use crate::identify::Recording;

/// A recording as a page names it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Source {
    name: String,
    samples: usize,
    start: String,
    sha256: Option<String>,
}

impl Source {
    /// Of every recording.
    pub(super) fn all(recordings: &[Recording]) -> Vec<Self> {
        recordings
            .iter()
            .map(|recording| Self {
                name: recording.name.clone(),
                samples: recording.samples,
                start: with_unit(&exact(recording.start_time), "s"),
                sha256: recording.sha256.clone(),
            })
            .collect()
    }
}
