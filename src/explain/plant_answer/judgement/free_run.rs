//! Whether a free run without an effect is too poor for "nothing is missing" to be said of it.

use crate::explain::engine::holdout::SATISFACTORY;
use crate::explain::engine::misled::growth;
use crate::explain::explanation::OutputFit;
use crate::physics::Plant;
use crate::physics::estimate::{Fit, PlantRecording, Study};

/// A free run that leaves more of an output than so many one-step errors strays: with this noise what is slow explains most of it.
pub(in crate::explain::plant_answer) const STRAYS: f64 = 2.0;

/// Whether the free run of an output leaves half of its variance, and far more than predictions of the next sample do or would: a
/// noise model or an observer has taken over what the equations should do, or nothing has. Of an unstable plant that its inputs hold
/// a free run says nothing.
pub(in crate::explain::plant_answer) fn is_astray(
    outputs: &[OutputFit],
    strays: f64,
    plant: &Plant,
    (study, fit): (&Study, &Fit),
    recordings: &[PlantRecording],
) -> bool {
    let unsatisfactory = |o: &OutputFit| {
        let left = 1.0 - 0.01 * o.train.parameters_only.fit_percent;
        left * left >= 1.0 - SATISFACTORY
    };
    let held = || {
        let inputs = !plant.spec.inputs().is_empty();
        inputs && is_unstable(plant, study, fit, recordings)
    };
    // The variance of one-step errors is about that part of what a slow error has.
    let slow = || {
        let share = study.effective_share(fit);
        share.is_some_and(|share| share < STRAYS.powi(-2))
    };
    outputs.iter().any(unsatisfactory) && (strays > STRAYS || slow()) && !held()
}

/// Whether a small difference grows more than e-fold over a recording, by the poles along it.
fn is_unstable(plant: &Plant, study: &Study, fit: &Fit, recordings: &[PlantRecording]) -> bool {
    growth(plant, study, fit, recordings).is_none_or(|growth| growth > 1.0)
}
