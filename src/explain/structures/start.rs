//! Where the parameters of a structure start: least squares in free run, from time constants between the sample time and the length
//! of the recordings. The recordings are cut into stretches that each have their own initial state: over a whole recording, what
//! integrates drifts so far that a slow lag follows it closer.

use rayon::prelude::*;

use super::text::Marks;
use crate::explain::engine::long_recordings::part;
use crate::physics::estimate::{EstimateOptions, PlantRecording, Study};
use crate::physics::{Hold, Plant, parse};

/// Time constants that are tried are at least so many samples, and at most this part of a recording.
const LEAST_SAMPLES: f64 = 5.0;
const LONGEST: f64 = 0.1;
/// A free run drifts whose error over whole recordings is so many times that over stretches.
const DRIFTS: f64 = 2.0;
/// Stretches that the recordings are cut into, together.
const STRETCHES: usize = 10;
/// The next is at most so many times the one before. A search by least squares bridges more.
const RATIO: f64 = 5.0;

/// A structure with its parameters by least squares in free run, or the likeliest where that drifts.
pub(super) struct Started {
    pub(super) plant: Plant,
    /// Root mean square error of its free run over stretches with their own initial states.
    pub(super) error: f64,
    /// BIC of the likelier of free run and observer: the free run of a plant that integrates drifts, however right it is.
    pub(super) criterion: f64,
}

/// The best of all starts; none where no run from any of them stays finite.
pub(super) fn started(
    equations: &str,
    marks: &Marks,
    recordings: &[PlantRecording],
    hold: Hold,
) -> Option<Started> {
    let first = recordings.first()?;
    let longest = recordings.iter().map(PlantRecording::samples).max()?;
    let least = LEAST_SAMPLES * first.sample_time;
    let most = (LONGEST * longest as f64 * first.sample_time).max(least);
    let steps = ((most / least).ln() / RATIO.ln()).ceil().max(1.0);
    let times = (0..=steps as usize).map(|i| least * (most / least).powf(i as f64 / steps));
    let plants: Vec<Plant> = times
        .filter_map(|time| Some(Plant::new(parse(&marks.fill(equations, time)).ok()?)))
        .collect();
    let part = part(plants.first()?, recordings, hold);
    let searched = part.as_ref().map_or(recordings, |p| &p.recordings[..]);
    let options = EstimateOptions {
        free: vec![true; plants.first()?.spec.parameters().len()],
        hold,
        form: None,
        least_squares: true,
    };
    let from_least_squares = |plant: &Plant, recordings: &[PlantRecording]| {
        let study = Study::new(plant, recordings, &options).ok()?;
        let fit = study.least_squares(&study.nominal())?;
        let residual = study.residual(&fit)?;
        let squares = residual.iter().flatten().map(|e| e * e).sum::<f64>();
        let error = (squares / study.count().max(1) as f64).sqrt();
        let point = study.points(&fit).into_iter().next()?;
        let plant = Plant::new(parse(&plant.text_at(&point)).ok()?);
        error.is_finite().then_some((error, plant))
    };
    let stretches = stretches(searched);
    let all: Vec<(f64, Plant)> = plants
        .par_iter()
        .filter_map(|plant| from_least_squares(plant, &stretches))
        .collect();
    let (error, plant) = all.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    let whole = from_least_squares(&plant, searched);
    let likely = EstimateOptions {
        least_squares: false,
        ..options.clone()
    };
    let study = Study::new(&plant, searched, &likely).ok()?;
    let fit = study.fit(None).ok()?;
    let plant = match whole.filter(|(whole, _)| *whole <= DRIFTS * error) {
        Some((_, plant)) => plant,
        None => {
            let point = study.points(&fit).into_iter().next()?;
            Plant::new(parse(&plant.text_at(&point)).ok()?)
        }
    };
    Some(Started {
        plant,
        error,
        criterion: fit.criterion,
    })
}

fn stretches(recordings: &[PlantRecording]) -> Vec<PlantRecording> {
    let all: usize = recordings.iter().map(PlantRecording::samples).sum();
    let most = all.div_ceil(STRETCHES).max(1);
    let cut = |recording: &PlantRecording, from: usize, to: usize| {
        let part = |columns: &[Vec<f64>]| columns.iter().map(|c| c[from..to].to_vec()).collect();
        PlantRecording {
            inputs: part(&recording.inputs),
            outputs: part(&recording.outputs),
            start_time: recording.start_time + from as f64 * recording.sample_time,
            ..*recording
        }
    };
    let of = |recording| {
        let samples = PlantRecording::samples(recording);
        let count = samples.div_ceil(most).max(1);
        let ends = move |i: usize| i * samples / count;
        (0..count).map(move |i| cut(recording, ends(i), ends(i + 1)))
    };
    recordings.iter().flat_map(of).collect()
}
