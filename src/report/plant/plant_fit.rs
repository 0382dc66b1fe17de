//! How an estimated plant follows its recordings, beside the values of its text and the best linear model.

use super::plant_document::FitDocument;
use crate::identify::{Options, identify};
use crate::log::Log;
use crate::physics::estimate::{HELD_OUT_FROM, PlantEstimate, PlantRecording};
use crate::physics::{Excitation, Hold, Simulated};

/// `100 (1 - |y - s| / |y - mean y|)` over several recordings, and the root mean square of the error; values that were not
/// measured, NaN, are left out.
fn fit(pairs: &[(&[f64], &[f64])]) -> (f64, f64) {
    let (mut error, mut spread, mut count) = (0.0, 0.0, 0.0);
    for (y, s) in pairs {
        let known = || y.iter().zip(*s).filter(|(y, _)| y.is_finite());
        let values = known().count() as f64;
        let mean = known().map(|(y, _)| y).sum::<f64>() / values.max(1.0);
        error += known().map(|(y, s)| (y - s).powi(2)).sum::<f64>();
        spread += known().map(|(y, _)| (y - mean).powi(2)).sum::<f64>();
        count += values;
    }
    (
        100.0 * (1.0 - (error / spread).sqrt()),
        (error / count).sqrt(),
    )
}

/// Fits in free run of the estimate, of the values of the text, and of the best linear model: one an output. `logs` are the
/// recordings again, for the linear model.
pub fn plant_fits(
    plant: &dyn Simulated,
    records: &[PlantRecording],
    logs: &[Log],
    estimate: &PlantEstimate,
    hold: Hold,
) -> Vec<FitDocument> {
    let outputs = plant.spec().outputs();
    let l = outputs.len();
    let text: Vec<Option<Vec<Vec<f64>>>> = records
        .iter()
        .map(|r| {
            let inputs: Vec<&[f64]> = r.inputs.iter().map(Vec::as_slice).collect();
            let excitation = Excitation {
                inputs: &inputs,
                length: r.outputs[0].len(),
                sample_time: r.sample_time,
                start_time: r.start_time,
                hold,
            };
            plant
                .first_run(&plant.nominal(), &excitation)
                .ok()
                .map(|t| t.outputs)
        })
        .collect();
    let linear = linear_model(logs);
    let measured = |o: usize| records.iter().map(move |r| r.outputs[o].as_slice());
    (0..l)
        .map(|o| {
            let simulated = estimate
                .simulated
                .iter()
                .skip(o)
                .step_by(l)
                .map(Vec::as_slice);
            let (percent, rms) = fit(&measured(o).zip(simulated).collect::<Vec<_>>());
            let of_text: Option<Vec<&[f64]>> = text
                .iter()
                .map(|t| t.as_ref().map(|t| t[o].as_slice()))
                .collect();
            let of_linear = linear
                .as_ref()
                .map(|(_, runs)| runs.iter().map(|r| r[o].as_slice()));
            let rest = |runs: &[Vec<f64>]| {
                let runs = runs.iter().skip(o).step_by(l);
                let later = records.iter().zip(runs).map(|(r, s)| {
                    let from = r.first_part(HELD_OUT_FROM);
                    (&r.outputs[o][from..], &s[from..])
                });
                fit(&later.collect::<Vec<_>>()).0
            };
            FitDocument {
                output: plant.spec().variable(outputs[o]).column().to_owned(),
                free_run_percent: percent,
                rms_error: rms,
                text_percent: of_text.map(|t| fit(&measured(o).zip(t).collect::<Vec<_>>()).0),
                held_out_percent: estimate.held_out.as_deref().map(rest),
                linear_model_percent: of_linear
                    .map(|t| fit(&measured(o).zip(t).collect::<Vec<_>>()).0),
                linear_model_order: linear.as_ref().map(|(order, _)| *order),
            }
        })
        .collect()
}

/// Order and free runs of the linear model that is identified from the same recordings; none where outputs are missing.
fn linear_model(logs: &[Log]) -> Option<(usize, Vec<Vec<Vec<f64>>>)> {
    logs.iter().try_for_each(Log::check).ok()?;
    let model = identify(logs, &Options::default()).ok()?;
    let runs: Option<Vec<_>> = logs
        .iter()
        .map(|log| {
            let inputs: Vec<&[f64]> = log.input_data.iter().map(Vec::as_slice).collect();
            let outputs: Vec<&[f64]> = log.output_data.iter().map(Vec::as_slice).collect();
            let start = model.initial_state_of(&inputs, &outputs).ok()?;
            model.simulate(&inputs, Some(&start)).ok()
        })
        .collect();
    Some((model.system.states(), runs?))
}
