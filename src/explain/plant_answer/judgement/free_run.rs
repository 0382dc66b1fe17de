//! Whether a free run without an effect is too poor for "nothing is missing" to be said of it.

use crate::explain::engine::holdout::{as_given, free_run_error};
use crate::explain::engine::misled::growth;
use crate::explain::explanation::OutputFit;
use crate::physics::Plant;
use crate::physics::estimate::{Fit, PlantRecording, Study};

/// A free run that leaves more of an output than so many one-step errors strays: with this noise what is slow explains most of it.
pub(in crate::explain::plant_answer) const STRAYS: f64 = 2.0;

/// What a number takes off the deviance of noise on average: the mean of chi-square with one degree of freedom.
const ONE_NUMBER: f64 = 1.0;

/// Why a free run without an effect is too poor for nothing to be missing.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::explain::plant_answer) enum Astray {
    /// It leaves half of the variance of an output, and far more than predictions of the next sample do or would: a noise model or an
    /// observer has taken over what the equations should do, or nothing has.
    Slow,
    /// A constant leaves less of this output, by more than its one number takes off noise.
    WorseThanConstant(String),
    /// A constant leaves less of the outputs than the values of the text, which nothing refutes, and as little as any others.
    AsConstant,
}

/// What the free run without an effect leaves of the variance of an output.
fn left(output: &OutputFit) -> f64 {
    output.train.parameters_only.left()
}

/// Whether that is half of it or more.
pub(in crate::explain::plant_answer) fn leaves_half(output: &OutputFit) -> bool {
    output.train.parameters_only.leaves_half()
}

/// Whether the free run is too poor. Of an unstable plant that its inputs hold a free run says nothing.
pub(in crate::explain::plant_answer) fn astray(
    outputs: &[OutputFit],
    strays: f64,
    plant: &Plant,
    (study, fit): (&Study, &Fit),
    recordings: &[PlantRecording],
    as_in_text: bool,
) -> Option<Astray> {
    let share = study.effective_share(fit);
    // The variance of one-step errors is about that part of what a slow error has.
    let slow = strays > STRAYS || share.is_some_and(|share| share < STRAYS.powi(-2));
    let independent = share.unwrap_or(1.0) * (study.count() / outputs.len().max(1)) as f64;
    let beaten = |o: &&OutputFit| independent * left(o).ln() > ONE_NUMBER;
    // By Schwarz's criterion, against the one number of a constant.
    let numbers = (fit.point.len() as f64 - 1.0).max(0.0);
    let no_better =
        |o: &OutputFit| independent * left(o).ln() > -numbers * independent.max(1.0).ln();
    let text_is_beaten = || {
        let given = as_given(plant, recordings, study.hold())?;
        let error = free_run_error(study, &given, recordings)?;
        Some(2.0 * independent * error.ln() > ONE_NUMBER)
    };
    let found = match outputs.iter().find(beaten) {
        Some(o) => Some(Astray::WorseThanConstant(o.output.clone())),
        None if slow && outputs.iter().any(leaves_half) => Some(Astray::Slow),
        None => (as_in_text && outputs.iter().all(no_better))
            .then(text_is_beaten)
            .flatten()
            .and_then(|beaten| beaten.then_some(Astray::AsConstant)),
    };
    let held = || {
        let inputs = !plant.spec.inputs().is_empty();
        inputs && is_unstable(plant, study, fit, recordings)
    };
    found.filter(|_| !held())
}

/// Whether a small difference grows more than e-fold over a recording, by the poles along it.
fn is_unstable(plant: &Plant, study: &Study, fit: &Fit, recordings: &[PlantRecording]) -> bool {
    growth(plant, study, fit, recordings).is_none_or(|growth| growth > 1.0)
}
