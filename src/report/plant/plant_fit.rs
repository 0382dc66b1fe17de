//! How an estimated plant follows its recordings, beside the values of its text and the best linear model.

use super::plant_document::FitDocument;
use crate::identify::{Options, identify};
use crate::log::Log;
use crate::physics::estimate::{HELD_OUT_FROM, PlantEstimate, PlantRecording};
use crate::physics::{Excitation, Hold, Simulated};

/// `100 (1 - |y - s| / |y - mean y|)` over several recordings, and the root mean square of the error.
fn fit(pairs: &[(&[f64], &[f64])]) -> (f64, f64) {
    let (mut error, mut spread, mut count) = (0.0, 0.0, 0.0);
    for (y, s) in pairs {
        let mean = y.iter().sum::<f64>() / y.len().max(1) as f64;
        error += y.iter().zip(*s).map(|(y, s)| (y - s).powi(2)).sum::<f64>();
        spread += y.iter().map(|y| (y - mean).powi(2)).sum::<f64>();
        count += y.len() as f64;
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
                let pairs = measured(o).zip(runs.iter().skip(o).step_by(l));
                let later = pairs.map(|(y, s)| (last_part(y), last_part(s)));
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

/// What the held-out fit is judged on.
fn last_part(series: &[f64]) -> &[f64] {
    &series[(HELD_OUT_FROM * series.len() as f64) as usize..]
}

/// Order and free runs of the linear model that is identified from the same recordings.
fn linear_model(logs: &[Log]) -> Option<(usize, Vec<Vec<Vec<f64>>>)> {
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
