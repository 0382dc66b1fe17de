//! Whether the free runs of a recording mislead: its inputs react to disturbances, or the plant adds them up.
//!
//! In a closed loop the input answers what disturbs the plant. A function of the input then follows the disturbance, and takes
//! error off a free run without being physics: least squares of the free run is biased, in blocks left out as well. One-step
//! predictions are not (L. Ljung, *System Identification*, 2nd ed. 1999, sec. 13.4: the direct method).
//!
//! A plant that integrates adds up what disturbs it. Its free run leaves a random walk, and of two such series one seems to explain
//! the other (C. W. J. Granger and P. Newbold, *J. Econometrics* 2, 1974).

use crate::noise::{inputs_foretold, inputs_switched};
use crate::physics::estimate::{Fit, PlantRecording, Study};
use crate::physics::{Hold, Plant};

/// A pole whose time constant is longer than this many recordings integrates.
const INTEGRATES: f64 = 3.0;
/// Samples of a recording at which a plant is linearised.
const LOOKED_AT: usize = 16;

/// Logarithm of what a small difference grows by over a recording, by the poles along it; none where the plant cannot be simulated.
pub(crate) fn growth(
    plant: &Plant,
    study: &Study,
    fit: &Fit,
    recordings: &[PlantRecording],
) -> Option<f64> {
    let trajectories = study.trajectories(fit)?;
    if plant.spec.states().is_empty() {
        return Some(f64::NEG_INFINITY);
    }
    let points = study.points(fit);
    let each = trajectories.iter().zip(recordings).zip(points);
    let growths = each.map(|((trajectory, recording), point)| {
        let samples = recording.samples();
        let mut lineariser = plant.lineariser(&point);
        let every = (samples / LOOKED_AT).max(1);
        let (mut growth, mut looked_at) = (0.0, 0.0);
        for k in (0..samples).step_by(every) {
            let state: Vec<f64> = trajectory.states.iter().map(|x| x[k]).collect();
            let inputs: Vec<f64> = recording.inputs.iter().map(|u| u[k]).collect();
            let time = recording.start_time + k as f64 * recording.sample_time;
            let poles = lineariser.at(&state, &inputs, time).a.complex_eigenvalues();
            growth += poles.iter().map(|p| p.re).fold(f64::NEG_INFINITY, f64::max);
            looked_at += 1.0;
        }
        growth / looked_at * samples as f64 * recording.sample_time
    });
    growths.reduce(f64::max)
}

/// Whether a plant adds up what disturbs it.
pub(super) fn integrates(
    plant: &Plant,
    study: &Study,
    fit: &Fit,
    recordings: &[PlantRecording],
) -> bool {
    growth(plant, study, fit, recordings).is_some_and(|growth| growth > -1.0 / INTEGRATES)
}

/// The inputs that react to what a fit leaves.
pub(in crate::explain::engine) fn reacting_inputs(
    study: &Study,
    fit: &Fit,
    recordings: &[PlantRecording],
    hold: Hold,
) -> Vec<usize> {
    let Some(residual) = study.residual(fit) else {
        return vec![];
    };
    let innovations = fit.noise.whiten(&residual, study.mask());
    let inputs: Vec<&[Vec<f64>]> = recordings.iter().map(|r| &r.inputs[..]).collect();
    // What the input is between samples acts on the output that ends them, unless it is held.
    let simulated = study.free_run(fit);
    let at_once = simulated.as_ref().filter(|_| hold == Hold::Zero);
    let mut reacting = inputs_foretold(&innovations, study.mask(), &inputs, at_once);
    if let Some(simulated) = &simulated {
        let recorded = recordings.iter().flat_map(|r| r.outputs.clone()).collect();
        reacting.extend(inputs_switched(&recorded, simulated, study.mask(), &inputs));
        reacting.sort_unstable();
        reacting.dedup();
    }
    reacting
}
