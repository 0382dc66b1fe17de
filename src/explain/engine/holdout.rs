//! How well free runs follow the recordings in blocks that their fit has not seen.

use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::explain::engine::thresholds::{FOLLOWS, MOST_STEPS, limited};
use crate::noise::{Series, effective_samples};
use crate::physics::estimate::{Effort, EstimateOptions, Fit, Form, PlantRecording, Study};
use crate::physics::{Hold, Plant};

/// Blocks that each recording is cut into; each is left out once. Few and long: over a short run a wrong plant is saved by its
/// initial state.
const BLOCKS: usize = 3;
/// Less of the mean square error in blocks left out is not explained: what is left is then more than what was found.
pub(crate) const EXPLAINED: f64 = 0.5;
/// A run that takes this part off the variance of a recording is a very good one (D. N. Moriasi et al., *Trans. ASABE* 50, 2007,
/// Table 4: Nash-Sutcliffe efficiency above 0.75).
const VERY_GOOD: f64 = 0.75;
/// A free run that leaves less of the variance than this, a fit of 90 %, is close.
pub(super) const CLOSE: f64 = 0.01;
/// One that does not take more than this part off is unsatisfactory (the same).
pub(crate) const SATISFACTORY: f64 = 0.5;
/// Level of the test that errors are smaller than others.
const SMALLER: f64 = 0.05;
/// Errors of this many standard deviations and more are those of a run that leaves the recording.
const STAYS: f64 = 10.0;
/// Effort of a fit from that to all of the recordings.
const AGAIN: Effort = Effort {
    iterations: 12,
    settled: 0.1,
    attempts: 6,
};

/// What parameters are estimated by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Estimator {
    /// Maximum likelihood, in the form and with the noise of the search.
    Likelihood,
    /// Least squares of the free run.
    FreeRun,
    /// Not at all: the values of the text, from initial states by least squares.
    Given,
}

/// Errors of free runs in blocks that were left out.
#[derive(Debug, Clone)]
pub(crate) struct HeldOut {
    /// Mean square of each output.
    pub(crate) squares: Vec<f64>,
    /// Variance of each output.
    pub(crate) variances: Vec<f64>,
    /// Errors of each output, in all blocks of all recordings; none where nothing was measured.
    pub(crate) errors: Vec<Vec<f64>>,
}

impl HeldOut {
    /// Error over that of another, the geometric mean over outputs.
    pub(crate) fn over(&self, other: &Self) -> f64 {
        ratio(&self.squares, &other.squares)
    }

    /// Root of the mean square of an output, and how much of its standard deviation it is short of, in percent.
    pub(crate) fn figure(&self, output: usize) -> (f64, f64) {
        let (square, variance) = (self.squares[output], self.variances[output]);
        let part = (square / variance.max(f64::MIN_POSITIVE)).sqrt();
        (square.sqrt(), 100.0 * (1.0 - part))
    }

    /// The part of the mean square of another that is gone, the geometric mean over outputs.
    pub(crate) fn removed(&self, other: &Self) -> f64 {
        1.0 - self.over(other).powi(2)
    }

    /// Probability by chance that errors of an output are so much smaller than those of another, in mean square: a t-test of the
    /// differences of squares, with as many of them as are independent (F. X. Diebold and R. S. Mariano, *J. Bus. Econ. Stat.* 13, 1995).
    fn chance_of_output(&self, other: &Self, output: usize) -> f64 {
        let pairs = self.errors[output].iter().zip(&other.errors[output]);
        let smaller: Vec<f64> = pairs
            .map(|(own, other)| other * other - own * own)
            .collect();
        let known = || smaller.iter().filter(|d| d.is_finite());
        let count = known().count().max(1) as f64;
        let mean = known().sum::<f64>() / count;
        let variance = known().map(|d| (d - mean).powi(2)).sum::<f64>() / count;
        let keep = smaller.iter().map(|d| d.is_finite()).collect();
        let independent = effective_samples(&vec![smaller], &vec![keep]);
        let freedom = (independent - 1.0).max(1.0);
        let t = mean / (variance / freedom).sqrt().max(f64::MIN_POSITIVE);
        StudentsT::new(0.0, 1.0, freedom).map_or(1.0, |law| law.sf(t))
    }

    /// Whether errors of some output are smaller than those of another by more than chance, and those of none larger.
    pub(crate) fn surely_smaller(&self, other: &Self) -> bool {
        let chances: Vec<f64> = (0..self.errors.len())
            .map(|o| self.chance_of_output(other, o))
            .collect();
        chances.iter().any(|p| *p < SMALLER) && chances.iter().all(|p| *p <= 1.0 - SMALLER)
    }

    /// Whether free runs follow the recordings clearly better than their means do.
    pub(crate) fn follows(&self) -> bool {
        ratio(&self.squares, &self.variances) < FOLLOWS && self.stays()
    }

    /// Whether free runs follow the recordings so closely that what they leave is of little weight.
    pub(crate) fn follows_closely(&self) -> bool {
        ratio(&self.squares, &self.variances).powi(2) <= 1.0 - VERY_GOOD && self.stays()
    }

    /// Whether free runs leave next to nothing of the recordings.
    pub(crate) fn is_close(&self) -> bool {
        ratio(&self.squares, &self.variances).powi(2) <= CLOSE && self.stays()
    }

    /// Whether free runs stay near the recordings in every output, even if they do not follow them: those of an unstable plant
    /// leave them.
    pub(super) fn stays(&self) -> bool {
        let mut outputs = self.squares.iter().zip(&self.variances);
        outputs.all(|(square, variance)| *square < STAYS * STAYS * variance)
    }
}

fn ratio(a: &[f64], b: &[f64]) -> f64 {
    let logs = a
        .iter()
        .zip(b)
        .map(|(a, b)| 0.5 * (a.max(1e-300) / b.max(1e-300)).ln());
    (logs.sum::<f64>() / a.len().max(1) as f64).exp()
}

/// Error of the free run over all recordings, as a part of the standard deviation: the geometric mean over outputs.
pub(crate) fn free_run_error(
    study: &Study,
    fit: &Fit,
    recordings: &[PlantRecording],
) -> Option<f64> {
    let simulated = study.free_run(fit)?;
    let l = study.outputs();
    let (mut squares, mut variances) = (vec![0.0; l], vec![0.0; l]);
    for o in 0..l {
        let mut values = Vec::new();
        for (recording, simulated) in recordings.iter().zip(simulated.chunks(l)) {
            let pairs = recording.outputs[o].iter().zip(&simulated[o]);
            for (y, s) in pairs.filter(|(y, _)| y.is_finite()) {
                squares[o] += (y - s).powi(2);
                values.push(*y);
            }
        }
        let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
        variances[o] = values.iter().map(|y| (y - mean).powi(2)).sum();
    }
    let error = ratio(&squares, &variances);
    error.is_finite().then_some(error)
}

/// Samples of a recording that a fold leaves out: as many measured ones as any other.
fn block(recording: &PlantRecording, fold: usize) -> std::ops::Range<usize> {
    let values = recording.measured().len();
    let begin = |fold| match fold {
        BLOCKS => recording.samples(),
        _ => recording.before_measured(values * fold / BLOCKS),
    };
    begin(fold)..begin(fold + 1)
}

/// Samples that a fold leaves out of recording `r`: a block of each, or of several recordings whole ones. A step response says
/// little without its beginning.
fn left_out(recordings: &[PlantRecording], r: usize, fold: usize) -> std::ops::Range<usize> {
    match (recordings.len() >= BLOCKS, r % BLOCKS == fold) {
        (false, _) => block(&recordings[r], fold),
        (true, true) => 0..recordings[r].samples(),
        (true, false) => 0..0,
    }
}

/// The blocks of the first recording, from and to, in seconds; none where whole recordings are left out.
pub(crate) fn blocks(recordings: &[PlantRecording]) -> Vec<[f64; 2]> {
    let recording = match recordings {
        [first, others @ ..] if others.len() + 1 < BLOCKS => first,
        _ => return vec![],
    };
    let at = |k: usize| recording.start_time + k as f64 * recording.sample_time;
    (0..BLOCKS)
        .map(|fold| block(recording, fold))
        .map(|b| [at(b.start), at(b.end)])
        .collect()
}

fn cut(recording: &PlantRecording, range: std::ops::Range<usize>) -> PlantRecording {
    let part = |columns: &[Vec<f64>]| columns.iter().map(|c| c[range.clone()].to_vec()).collect();
    PlantRecording {
        inputs: part(&recording.inputs),
        outputs: part(&recording.outputs),
        start_time: recording.start_time + range.start as f64 * recording.sample_time,
        ..*recording
    }
}

/// The plant with every initial state free: a block does not begin where the recording does.
fn released(plant: &Plant, study: &Study) -> Plant {
    let mut spec = plant.spec.clone();
    for state in spec.states() {
        spec.variables[state.index()].fixed = false;
    }
    limited(Plant::new(spec), study, MOST_STEPS)
}

/// Options under which every parameter is free.
pub(crate) fn all_free(plant: &Plant, hold: Hold, estimator: Estimator) -> EstimateOptions {
    EstimateOptions {
        free: vec![true; plant.spec.parameters().len()],
        hold,
        form: None,
        least_squares: estimator != Estimator::Likelihood,
    }
}

/// Options under which only initial states are free, by least squares.
fn only_states(plant: &Plant, hold: Hold) -> EstimateOptions {
    EstimateOptions {
        free: vec![false; plant.spec.parameters().len()],
        ..all_free(plant, hold, Estimator::Given)
    }
}

/// The plant with the values of its text, and the initial states that fit the recordings best.
pub(crate) fn as_given(plant: &Plant, recordings: &[PlantRecording], hold: Hold) -> Option<Fit> {
    let options = only_states(plant, hold);
    let study = Study::new(plant, recordings, &options).ok()?;
    let fit = study.least_squares(&study.nominal())?;
    let nominal = plant.nominal().parameters;
    let point = nominal.into_iter().chain(fit.point).collect();
    Some(Fit { point, ..fit })
}

/// Leaves out one block after the other.
pub(super) fn held_out(
    plant: &Plant,
    fit: &Fit,
    estimator: Estimator,
    recordings: &[PlantRecording],
    hold: Hold,
) -> Option<HeldOut> {
    let options = all_free(plant, hold, estimator);
    let study = Study::new(plant, recordings, &options).ok()?;
    let states: Vec<Vec<Vec<f64>>> = study
        .trajectories(fit)?
        .into_iter()
        .map(|t| t.states)
        .collect();
    let released = released(plant, &study);
    let at = |r: usize, k: usize| states[r].iter().map(move |x| x[k]);
    let outputs = study.outputs();
    let parameters = study.parameters();
    let gains = match fit.form {
        Form::Innovation => &fit.point[fit.point.len() - states[0].len() * outputs..],
        Form::FreeRun => &[][..],
    };
    let folds: Option<Vec<Series>> = (0..BLOCKS)
        .into_par_iter()
        .map(|fold| {
            let (mut kept, mut kept_start) = (Vec::new(), Vec::new());
            let (mut test, mut test_start) = (Vec::new(), Vec::new());
            for (r, recording) in recordings.iter().enumerate() {
                let out = left_out(recordings, r, fold);
                for range in [0..out.start, out.end..recording.samples()] {
                    if !range.is_empty() {
                        kept_start.extend(at(r, range.start));
                        kept.push(cut(recording, range));
                    }
                }
                if !out.is_empty() {
                    test_start.extend(at(r, out.start));
                    test.push(cut(recording, out));
                }
            }
            let training = Study::new(&released, &kept, &options).ok()?;
            let mut point = fit.point[..parameters].to_vec();
            point.extend(kept_start);
            let again = match estimator {
                Estimator::Given => point,
                Estimator::FreeRun => training.least_squares_with(&point, AGAIN)?.point,
                Estimator::Likelihood => {
                    point.extend(gains);
                    let from = Fit {
                        point,
                        ..fit.clone()
                    };
                    training.compare(&from, AGAIN)?.point
                }
            };
            let fitted = released.with_values(&again[..parameters]);
            let of_states = only_states(&fitted, hold);
            let study = Study::new(&fitted, &test, &of_states).ok()?;
            let run = study.least_squares_with(&test_start, AGAIN)?;
            // What was not measured has no error.
            let mut residual = study.residual(&run)?;
            for (e, measured) in residual.iter_mut().zip(study.mask()) {
                let each = e.iter_mut().zip(measured).filter(|(_, m)| !**m);
                each.for_each(|(e, _)| *e = f64::NAN);
            }
            Some(residual)
        })
        .collect();
    let folds = folds?;
    let of_output = |o: usize, series: &Series, less: f64| -> (f64, f64) {
        let each = series.iter().skip(o).step_by(outputs).flatten();
        each.filter(|e| e.is_finite())
            .fold((0.0, 0.0), |(s, n), e| (s + (e - less).powi(2), n + 1.0))
    };
    let recorded: Series = recordings.iter().flat_map(|r| r.outputs.clone()).collect();
    let (mut squares, mut variances) = (Vec::new(), Vec::new());
    for o in 0..outputs {
        let each = folds.iter().map(|f| of_output(o, f, 0.0));
        let (sum, count) = each.fold((0.0, 0.0), |(s, n), (a, b)| (s + a, n + b));
        squares.push(sum / count);
        let known: Vec<f64> = recorded
            .iter()
            .skip(o)
            .step_by(outputs)
            .flatten()
            .copied()
            .filter(|y| y.is_finite())
            .collect();
        let mean = known.iter().sum::<f64>() / known.len().max(1) as f64;
        let (sum, count) = of_output(o, &recorded, mean);
        variances.push(sum / count);
    }
    // A fold holds the recordings that it leaves something out of, in their order.
    let errors_of = |o: usize| -> Vec<f64> {
        let each = (0..recordings.len()).flat_map(|r| folds.iter().map(move |f| (f, r)));
        let columns = each.filter_map(|(f, r)| f.get(r * outputs + o));
        columns.flatten().copied().collect()
    };
    squares.iter().all(|s| s.is_finite()).then(|| HeldOut {
        squares,
        variances,
        errors: (0..outputs).map(errors_of).collect(),
    })
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};

    use super::*;

    #[test]
    fn of_several_recordings_whole_ones_are_left_out() {
        let all = vec![of(&[1.0; 90]); 4];
        let folds = |recordings: usize| -> Vec<Vec<usize>> {
            let some = &all[..recordings];
            let each = |fold| (0..recordings).map(move |r| left_out(some, r, fold).len());
            (0..BLOCKS).map(|fold| each(fold).collect()).collect()
        };
        assert_eq!(folds(2), [[30, 30], [30, 30], [30, 30]]);
        assert_eq!(folds(4), [[90, 0, 0, 90], [0, 90, 0, 0], [0, 0, 90, 0]]);
    }

    #[test]
    fn blocks_have_as_many_measured_values() {
        let mut y = vec![f64::NAN; 100];
        for k in [1, 2, 3, 5, 9, 95] {
            y[k] = 1.0;
        }
        let ends = |fold| block(&of(&y), fold);
        assert_eq!([ends(0), ends(1), ends(2)], [0..3, 3..9, 9..100]);
        assert_eq!(of(&y).first_part(2.0 / 3.0), 9);
    }

    /// Under slow errors a small difference of their mean squares is chance, under white ones it is not.
    #[test]
    fn slow_errors_are_few() {
        const DRAWS: usize = 40;
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let mut judged = |memory: f64, smaller: f64| {
            let mut runs = |size: f64| {
                let mut x = 0.0;
                let each = (0..600).map(|_| {
                    x = memory * x + random.random::<f64>() - 0.5;
                    size * x
                });
                let errors = vec![each.collect::<Vec<f64>>()];
                HeldOut {
                    squares: vec![1.0],
                    variances: vec![1.0],
                    errors,
                }
            };
            let pairs: Vec<[HeldOut; 2]> = (0..DRAWS).map(|_| [runs(smaller), runs(1.0)]).collect();
            let sure = pairs
                .iter()
                .filter(|[own, other]| own.surely_smaller(other));
            let wrong = pairs
                .iter()
                .filter(|[own, other]| other.surely_smaller(own));
            [sure.count(), wrong.count()]
        };
        assert_eq!(judged(0.0, 0.8), [DRAWS, 0]);
        assert!(judged(0.9, 0.3)[0] > DRAWS * 9 / 10);
        // About one in twenty by chance, some more where few errors are independent.
        for memory in [0.0, 0.99] {
            let [one, other] = judged(memory, 1.0);
            assert!(one.max(other) <= DRAWS / 5, "{memory}: {one} and {other}");
        }
        assert!(judged(0.99, 0.8)[0] < DRAWS / 2);
    }

    fn of(y: &[f64]) -> PlantRecording {
        PlantRecording {
            inputs: vec![],
            outputs: vec![y.to_vec()],
            sample_time: 1.0,
            start_time: 0.0,
        }
    }
}
