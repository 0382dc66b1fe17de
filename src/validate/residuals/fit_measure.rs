//! Fit measures, accumulated block by block.

use crate::validate::{FitMeasure, OutputFit, ValidateError, ValidationOptions};

/// Sums of one output over one record at a time.
#[derive(Debug, Clone, Default)]
struct Sums {
    samples: f64,
    error: f64,
    error_squares: f64,
    /// Sums over the finished records about their own means.
    variation: f64,
    /// Sums over the current record about its first sample.
    record: (f64, f64, f64, f64),
}

/// Accumulates `sum (y - yhat)^2` and `sum (y - mean y)^2`, the mean taken record by record.
#[derive(Debug, Clone)]
pub(crate) struct FitSums {
    outputs: Vec<Sums>,
}

impl FitSums {
    pub(crate) fn new(outputs: usize) -> Self {
        Self {
            outputs: vec![Sums::default(); outputs],
        }
    }

    /// A block of outputs `y` with their errors `y - yhat`.
    pub(crate) fn add(&mut self, output: usize, y: &[f64], errors: &[f64]) {
        let sums = &mut self.outputs[output];
        if sums.record.0 == 0.0 {
            sums.record.3 = y.first().copied().unwrap_or(0.0);
        }
        let reference = sums.record.3;
        let (mut sum, mut squares) = (0.0, 0.0);
        let (mut error, mut error_squares) = (0.0, 0.0);
        for (y, e) in y.iter().zip(errors) {
            let deviation = y - reference;
            sum += deviation;
            squares += deviation * deviation;
            error += e;
            error_squares += e * e;
        }
        sums.record.0 += y.len() as f64;
        sums.record.1 += sum;
        sums.record.2 += squares;
        sums.error += error;
        sums.error_squares += error_squares;
    }

    /// The record is over.
    pub(super) fn end_record(&mut self) {
        for sums in &mut self.outputs {
            let (samples, sum, squares, _) = std::mem::take(&mut sums.record);
            if samples > 0.0 {
                let variation = squares - sum * sum / samples;
                // What rounding leaves of a constant.
                if variation > 1e-13 * squares {
                    sums.variation += variation;
                }
                sums.samples += samples;
            }
        }
    }

    /// Whether all the sums are finite: a free run may overflow.
    pub(crate) fn is_finite(&self) -> bool {
        self.outputs.iter().all(|s| s.error_squares.is_finite())
    }

    /// Root mean square of each output about its mean.
    pub(crate) fn deviations(&self) -> Vec<f64> {
        self.outputs
            .iter()
            .map(|s| (s.variation / s.samples.max(1.0)).sqrt())
            .collect()
    }

    pub(crate) fn measure(&self, options: &ValidationOptions) -> Result<FitMeasure, ValidateError> {
        let mut outputs = Vec::with_capacity(self.outputs.len());
        let mut relative = 0.0;
        for (index, sums) in self.outputs.iter().enumerate() {
            if sums.variation <= 0.0 {
                return Err(ValidateError::ConstantOutput {
                    name: options.output(index),
                });
            }
            let share = sums.error_squares / sums.variation;
            relative += share;
            outputs.push(OutputFit {
                output: options.output(index),
                fit_percent: 100.0 * (1.0 - share.sqrt()),
                rms_error: (sums.error_squares / sums.samples).sqrt(),
                mean_error: sums.error / sums.samples,
            });
        }
        Ok(FitMeasure {
            fit_percent: 100.0 * (1.0 - (relative / outputs.len().max(1) as f64).sqrt()),
            outputs,
        })
    }
}

/// Fit of predictions: for each record a pair of recorded and predicted values for each output. What was not recorded does not
/// count.
///
/// # Errors
/// [`ValidateError::ConstantOutput`] when an output does not move.
pub(crate) fn fit_measure(
    output_names: &[String],
    records: &[Vec<(&[f64], &[f64])>],
) -> Result<FitMeasure, ValidateError> {
    let mut sums = FitSums::new(output_names.len());
    for record in records {
        for (output, (recorded, predicted)) in record.iter().enumerate() {
            let known = recorded
                .iter()
                .zip(*predicted)
                .filter(|(y, _)| y.is_finite());
            let (y, errors): (Vec<f64>, Vec<f64>) = known.map(|(y, p)| (*y, y - p)).unzip();
            sums.add(output, &y, &errors);
        }
        sums.end_record();
    }
    sums.measure(&ValidationOptions {
        output_names: output_names.to_vec(),
        ..ValidationOptions::default()
    })
}

/// Error below this share of the output that is left to rounding: the square root of working precision.
const EXACT: f64 = 1.5e-8;

impl FitMeasure {
    /// Whether what is left is rounding.
    pub(crate) fn exact(&self) -> bool {
        self.fit_percent > 100.0 * (1.0 - EXACT)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn closed_form_over_two_records_and_any_blocks() {
        let mut sums = FitSums::new(1);
        sums.add(0, &[1.0, 3.0], &[0.5, -0.5]);
        sums.add(0, &[5.0], &[0.0]);
        sums.end_record();
        sums.add(0, &[100.0, 102.0], &[1.0, 0.0]);
        sums.end_record();
        // Variation 8 about 3 and 2 about 101; squared errors 0.5 + 1.
        let fit = sums.measure(&ValidationOptions::default()).unwrap();
        let expected = 100.0 * (1.0 - (1.5_f64 / 10.0).sqrt());
        assert!((fit.fit_percent - expected).abs() < 1e-12);
        assert!((fit.outputs[0].rms_error - (1.5_f64 / 5.0).sqrt()).abs() < 1e-15);
        assert!((fit.outputs[0].mean_error - 0.2).abs() < 1e-15);
    }

    #[test]
    fn a_constant_output_has_no_fit() {
        let mut sums = FitSums::new(1);
        sums.add(0, &[0.1; 7], &[0.0; 7]);
        sums.end_record();
        let error = sums.measure(&ValidationOptions::default()).unwrap_err();
        assert!(error.to_string().starts_with("output y1 is constant"));
    }
}
