//! Values of expressions along the predictions of a plant.

use crate::explain::engine::fitting::edit::Edit;
use crate::physics::Plant;
use crate::physics::estimate::{Fit, PlantRecording, Study};

/// Samples of a recording that are looked at.
const LOOKED_AT: usize = 1000;

/// Smallest and largest value of an expression along the predictions of a plant; none for what has no argument.
pub(in crate::explain::engine) fn range_along(
    fitted: (&Study, &Fit),
    recordings: &[PlantRecording],
    text: &str,
) -> Option<(f64, f64)> {
    let texts = [text.to_owned()];
    let wanted = if text.is_empty() { &[] } else { &texts[..] };
    let values = along(fitted, recordings, wanted)?.pop()?;
    let from = values.iter().copied().min_by(f64::total_cmp)?;
    Some((from, values.iter().copied().max_by(f64::total_cmp)?))
}

/// The factor that brings the second of two expressions nearest to the first along the predictions of a plant, and the part of the first's
/// mean square that it explains then.
pub(in crate::explain::engine) fn factor_along(
    fitted: (&Study, &Fit),
    recordings: &[PlantRecording],
    texts: &[String; 2],
) -> Option<(f64, f64)> {
    let [wanted, own]: [Vec<f64>; 2] = along(fitted, recordings, texts)?.try_into().ok()?;
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let factor = product(&wanted, &own) / product(&own, &own);
    let part = factor * product(&wanted, &own) / product(&wanted, &wanted);
    part.is_finite().then_some((factor, part))
}

/// Values of expressions in the variables of a plant along its predictions, for all recordings one after the other.
pub(in crate::explain::engine) fn along(
    (study, fit): (&Study, &Fit),
    recordings: &[PlantRecording],
    texts: &[String],
) -> Option<Vec<Vec<f64>>> {
    if texts.is_empty() {
        return Some(vec![]);
    }
    let numbered = texts.iter().enumerate();
    let edit = Edit {
        declarations: (0..texts.len())
            .map(|i| format!("output Real probe_{i};"))
            .collect(),
        equations: numbered
            .map(|(i, text)| format!("probe_{i} = {text};"))
            .collect(),
        ..Edit::default()
    };
    let plant = Plant::new(edit.apply(&study.plant().spec).ok()?);
    let outputs = study.outputs();
    let mut columns = vec![Vec::new(); texts.len()];
    let trajectories = study.trajectories(fit)?;
    let points = study.points(fit);
    for ((trajectory, recording), point) in trajectories.iter().zip(recordings).zip(points) {
        let samples = recording.samples();
        let mut lineariser = plant.lineariser(&point);
        for k in (0..samples).step_by((samples / LOOKED_AT).max(1)) {
            let state: Vec<f64> = trajectory.states.iter().map(|x| x[k]).collect();
            let inputs: Vec<f64> = recording.inputs.iter().map(|u| u[k]).collect();
            let time = recording.start_time + k as f64 * recording.sample_time;
            let linear = lineariser.at(&state, &inputs, time);
            for (column, &v) in columns.iter_mut().zip(&linear.output[outputs..]) {
                column.push(v);
            }
        }
    }
    Some(columns)
}
