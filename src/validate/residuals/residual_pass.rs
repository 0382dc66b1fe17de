//! The one pass over the records: residuals, their lag products, and the fit measures.

use nalgebra::{DMatrix, DVector};

use super::fit_measure::FitSums;
use crate::linalg::spectral_radius;
use crate::model::{ModelError, Predictor, Simulator, StateSpace, estimate_initial_state};
use crate::moments::{Detrend, Gram, LagAccumulator};
use crate::validate::{RecordView, ValidateError};

/// Samples handled at a time.
const BLOCK: usize = 4096;
/// Samples from which the initial state is estimated at most: what comes later says next to nothing
/// about it.
const SAMPLES_FOR_INITIAL_STATE: usize = 20_000;
/// The start-up is over when the predictor has shrunk the error of the initial state to this share.
const FORGOTTEN: f64 = 0.01;
/// Largest share of a record that is dropped as start-up (a predictor with an integrator never forgets).
const LARGEST_START_UP: usize = 10;
/// A pole this far outside the unit circle makes a free run meaningless.
const UNSTABLE: f64 = 1.0 + 1e-9;
/// Factor by which a predictor may amplify the error of its initial state over a record: rounding errors
/// then stay below the residuals.
const RUN_AWAY: f64 = 1e6;
/// Residuals below this share of the output are rounding errors.
pub(crate) const ROUNDING: f64 = 1e-10;

/// Where the predictor starts on a record, and the means that the lag products are taken about.
#[derive(Debug, Clone)]
pub(crate) struct Start {
    /// Estimated initial state of the predictor.
    pub(crate) state: DVector<f64>,
    /// Samples dropped.
    pub(crate) dropped: usize,
    /// Means of inputs, then residuals, over the samples kept.
    pub(crate) means: Vec<f64>,
}

/// What one pass leaves of the records.
#[derive(Debug)]
pub(crate) struct Residuals {
    /// Products of `[z[k]; ...; z[k+p]]` with `z = [u; e]` about their means.
    pub(crate) gram: Gram,
    /// Window `p`.
    pub(crate) past: usize,
    pub(crate) inputs: usize,
    pub(crate) outputs: usize,
    /// `(sum (e - mean)^2, sum (e - mean)^4)` of each output.
    pub(crate) moments: Vec<(f64, f64)>,
    /// Samples of all records, with and without start-up.
    pub(crate) samples: usize,
    pub(crate) kept: usize,
    /// Longest start-up.
    pub(crate) dropped: usize,
    pub(crate) starts: Vec<Start>,
    pub(crate) one_step: FitSums,
    /// Free run, or why there is none.
    pub(crate) free_run: Result<FitSums, String>,
}

impl Residuals {
    /// Row of a channel (inputs, then residuals) at a lag in [`Residuals::gram`].
    pub(crate) fn row(&self, channel: usize, lag: usize) -> usize {
        (self.past - lag) * (self.inputs + self.outputs) + channel
    }

    /// Residual variance of an output over the tested samples.
    pub(crate) fn variance(&self, output: usize) -> f64 {
        let row = self.row(self.inputs + output, 0);
        self.gram.gram[(row, row)] / self.gram.columns.max(1) as f64
    }
}

/// Samples of the start-up: until the slowest mode of the predictor has shrunk to [`FORGOTTEN`], at most a
/// tenth of the record.
pub(crate) fn start_up(system: &StateSpace, samples: usize) -> Result<usize, ValidateError> {
    let radius = spectral_radius(&system.predictor_matrix())?;
    let limit = samples / LARGEST_START_UP;
    if system.states() == 0 {
        return Ok(0);
    }
    if radius >= 1.0 {
        return Ok(limit);
    }
    let decay = FORGOTTEN.ln() / radius.max(1e-3).ln();
    Ok((decay.ceil() as usize).max(system.states()).min(limit))
}

/// One pass over all records with lag products up to `past`.
pub(crate) fn residuals(
    system: &StateSpace,
    innovation_covariance: Option<&DMatrix<f64>>,
    records: &[RecordView<'_>],
    past: usize,
) -> Result<Residuals, ValidateError> {
    let (r, l) = (system.inputs(), system.outputs());
    let bare = system.k.iter().all(|v| *v == 0.0);
    let pole = spectral_radius(&system.a)?;
    let predictor_radius = spectral_radius(&system.predictor_matrix())?;
    let mut free_run = if pole > UNSTABLE {
        Err(format!(
            "the model is unstable (pole of modulus {pole:.4}): a free run grows without bound"
        ))
    } else {
        Ok(FitSums::new(l))
    };
    let mut out = Residuals {
        gram: Gram::empty((past + 1) * (r + l)),
        past,
        inputs: r,
        outputs: l,
        moments: vec![(0.0, 0.0); l],
        samples: 0,
        kept: 0,
        dropped: 0,
        starts: Vec::new(),
        one_step: FitSums::new(l),
        free_run: Err(String::new()),
    };
    for (index, record) in records.iter().enumerate() {
        let data_error = |source: ModelError| ValidateError::Data {
            record: index + 1,
            source,
        };
        let samples = record.samples();
        if samples as f64 * predictor_radius.ln() > RUN_AWAY.ln() {
            return Err(ValidateError::PredictorDiverges {
                record: index + 1,
                spectral_radius: predictor_radius,
            });
        }
        let head = samples.min(SAMPLES_FOR_INITIAL_STATE);
        let (u, y) = (cut(record.inputs, 0, head), cut(record.outputs, 0, head));
        let state =
            estimate_initial_state(system, &u, &y, innovation_covariance).map_err(data_error)?;
        let mut predictor = Predictor::new(system, Some(&state)).map_err(data_error)?;
        let mut simulator = if bare || free_run.is_err() {
            None
        } else {
            let mut quiet = system.clone();
            quiet.k.fill(0.0);
            let x0 = estimate_initial_state(&quiet, &u, &y, innovation_covariance)
                .map_err(data_error)?;
            Some(Simulator::new(system, Some(&x0)).map_err(data_error)?)
        };

        let dropped = start_up(system, samples)?;
        let mut accumulator = LagAccumulator::new(r + l, past);
        let mut powers = vec![Powers::default(); l];
        let mut from = 0;
        while from < samples {
            let to = (from + BLOCK).min(samples);
            let (u, y) = (cut(record.inputs, from, to), cut(record.outputs, from, to));
            let errors = predictor.step(&u, &y).map_err(data_error)?.innovations;
            for o in 0..l {
                out.one_step.add(o, y[o], &errors[o]);
            }
            if let (Some(simulator), Ok(sums)) = (&mut simulator, &mut free_run) {
                let mut run = simulator.step(&u).map_err(data_error)?;
                for (o, simulated) in run.iter_mut().enumerate() {
                    for (s, y) in simulated.iter_mut().zip(y[o]) {
                        *s = y - *s;
                    }
                    sums.add(o, y[o], simulated);
                }
            }
            let skip = dropped.saturating_sub(from).min(to - from);
            if skip < to - from {
                let kept: Vec<&[f64]> = u
                    .iter()
                    .copied()
                    .chain(errors.iter().map(Vec::as_slice))
                    .map(|column| &column[skip..])
                    .collect();
                accumulator.push(&kept);
                for (powers, e) in powers.iter_mut().zip(&errors) {
                    powers.add(&e[skip..]);
                }
            }
            from = to;
        }
        out.one_step.end_record();
        if !out.one_step.is_finite() {
            return Err(ValidateError::PredictorDiverges {
                record: index + 1,
                spectral_radius: predictor_radius,
            });
        }
        if let Ok(sums) = &mut free_run {
            sums.end_record();
        }
        let moments = accumulator.moments();
        out.gram
            .add(&moments.gram(past, &moments.trend(Detrend::Mean)));
        for (total, powers) in out.moments.iter_mut().zip(&powers) {
            let (second, fourth) = powers.central();
            total.0 += second;
            total.1 += fourth;
        }
        out.samples += samples;
        out.kept += samples - dropped;
        out.dropped = out.dropped.max(dropped);
        out.starts.push(Start {
            state,
            dropped,
            means: moments.mean(),
        });
    }
    out.free_run = match free_run {
        Err(reason) => Err(reason),
        Ok(_) if bare => Ok(out.one_step.clone()),
        Ok(sums) if sums.is_finite() => Ok(sums),
        Ok(_) => Err("the free run of the model grows without bound".to_owned()),
    };
    Ok(out)
}

/// Samples `from..to` of every column.
pub(crate) fn cut<'a>(columns: &[&'a [f64]], from: usize, to: usize) -> Vec<&'a [f64]> {
    columns.iter().map(|column| &column[from..to]).collect()
}

/// Power sums about a reference near the mean.
#[derive(Debug, Clone, Default)]
struct Powers {
    reference: f64,
    samples: f64,
    sums: [f64; 4],
}

impl Powers {
    fn add(&mut self, values: &[f64]) {
        if self.samples == 0.0 {
            self.reference = values.iter().sum::<f64>() / values.len().max(1) as f64;
        }
        let mut sums = [0.0; 4];
        for value in values {
            let d = value - self.reference;
            let square = d * d;
            sums[0] += d;
            sums[1] += square;
            sums[2] += square * d;
            sums[3] += square * square;
        }
        for (total, sum) in self.sums.iter_mut().zip(sums) {
            *total += sum;
        }
        self.samples += values.len() as f64;
    }

    /// Second and fourth sum about the mean.
    fn central(&self) -> (f64, f64) {
        if self.samples == 0.0 {
            return (0.0, 0.0);
        }
        let mean = self.sums[0] / self.samples;
        let [_, second, third, fourth] = self.sums;
        (
            second - self.samples * mean * mean,
            fourth - 4.0 * mean * third + 6.0 * mean * mean * second
                - 3.0 * self.samples * mean.powi(4),
        )
    }
}
