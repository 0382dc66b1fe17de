//! Identification with the tests that belong to it: a model, and whether its own recordings speak against it.

use super::deviations::{Deviations, judge};
use super::{Relation, Validation};
use crate::identify::{
    IdentifyError, Model, Options, Records, identify_records, warnings_of_closed_loop,
};

/// A model with the tests of its residuals on the recordings that it was estimated from.
#[derive(Debug, Clone, PartialEq)]
pub struct TestedModel {
    /// The model; what the tests say against it as a whole is among its warnings.
    pub model: Model,
    /// The tests; `None` when they could not be made, and a warning says why.
    pub tests: Option<Validation>,
}

/// Identifies a model and tests its residuals: what `innovant identify` does.
///
/// The tests look at what `records` still hold in memory.
///
/// # Errors
/// [`IdentifyError`] says what is wrong with the recordings or the options.
pub fn identify_and_test(
    records: &mut dyn Records,
    options: &Options,
) -> Result<TestedModel, IdentifyError> {
    let model = identify_records(records, options)?;
    check_recorded_once(&model)?;
    let deviations = Deviations::of_records(records, &model)?;
    Ok(test_residuals(model, &deviations))
}

/// Tests the residuals of a model on the recordings that it was estimated from, as [`identify_and_test`] does at once:
/// `deviations` are what [`Deviations::of_records`] gives after the identification.
pub fn test_residuals(mut model: Model, deviations: &[Deviations]) -> TestedModel {
    match judge(&model, deviations, Relation::Estimation, None) {
        Ok(tests) => {
            if let Some(summary) = &mut model.summary
                && tests.closed_loop()
            {
                let found = warnings_of_closed_loop(summary);
                summary.warnings.extend(found);
            }
            TestedModel {
                model,
                tests: Some(tests),
            }
        }
        Err(reason) => {
            if let Some(summary) = &mut model.summary {
                summary
                    .warnings
                    .push(format!("the residuals were not tested: {reason}"));
            }
            TestedModel { model, tests: None }
        }
    }
}

/// Which part of a file a recording is, as [`crate::log::Reading`] names them.
fn part_of(name: &str) -> Option<&str> {
    name.rsplit_once(" [part ").map(|(_, part)| part)
}

/// Two files may be copies of one.
fn check_recorded_once(model: &Model) -> Result<(), IdentifyError> {
    for (index, recording) in model.recordings.iter().enumerate() {
        let copy = model.recordings[..index]
            .iter()
            // Parts of one file have one hash, and differ in which part they are.
            .find(|other| {
                other.sha256.is_some()
                    && other.sha256 == recording.sha256
                    && part_of(&other.name) == part_of(&recording.name)
            });
        if let Some(copy) = copy {
            return Err(IdentifyError::SameRecording {
                first: copy.name.clone(),
                second: recording.name.clone(),
            });
        }
    }
    Ok(())
}
