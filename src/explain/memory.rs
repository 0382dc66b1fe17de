//! What a question takes of memory, before the library of effects is held against the recording.

use super::document::explain_error::ExplainError;
use crate::limits::{self, of_numbers};
use crate::log::Log;

/// What the program takes for nothing.
const BASE: u64 = 12 << 20;
/// Numbers a sample of one output: what each effect and each flexible feature adds to the simulated output, and the
/// derivatives of the fits. Measured, as the next one (`tests/limits.rs`).
const NUMBERS: usize = 500;
/// The same for each thread, on which a fit of its own runs.
const NUMBERS_OF_A_THREAD: usize = 80;

/// Refuses recordings that would take more memory than there may be.
///
/// # Errors
/// [`ExplainError::Limit`].
pub(super) fn check(recordings: &[Log]) -> Result<(), ExplainError> {
    let Some(first) = recordings.first() else {
        return Ok(());
    };
    let samples: usize = recordings.iter().map(Log::samples).sum();
    let outputs = first.outputs.len();
    let numbers = NUMBERS + NUMBERS_OF_A_THREAD * rayon::current_num_threads();
    let name = || match recordings.len() {
        1 => first.name.clone(),
        count => format!("{} (and {} more)", first.name, count - 1),
    };
    limits::check(
        BASE.saturating_add(of_numbers(&[samples, outputs, numbers])),
        None,
        || {
            format!(
                "{}: explaining {samples} samples of {outputs} outputs",
                name()
            )
        },
        || {
            "take the part of the recording in which the simulation is wrong, or sample it more slowly".to_owned()
        },
    )?;
    Ok(())
}
