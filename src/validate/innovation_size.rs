//! Are the residuals as large as the model says?

use nalgebra::DMatrix;
use statrs::distribution::{ContinuousCDF, Normal};

use super::parameter_errors::Sensitivity;
use super::residuals::Residuals;
use super::result::{InnovationSize, OutputSize};
use super::validation_options::{Relation, ValidationOptions};

/// Compares the residual variance `s` of each output with the stated variance.
///
/// `N Var(s) = mean e^4 - s^2 + 4 sum_{j>=1} gamma_j^2`: no normality assumed, and colour allowed for
/// (Bartlett's formula). On fresh records a right model shows `s = Lambda_ii + E[psi Cov(theta) psi']_ii`, and the
/// stated variance is itself an estimate from about `rank / tr(J Cov(theta))` samples, with the same relative
/// accuracy for a sample. `ln(s / expected)` is then normal.
///
/// `None` when a stated variance is not positive, or the residuals of some output vanish.
pub(super) fn innovation_size(
    stated: &DMatrix<f64>,
    residuals: &Residuals,
    lags: usize,
    sensitivity: Option<&Sensitivity>,
    relation: Relation,
    options: &ValidationOptions,
) -> Option<InnovationSize> {
    let l = residuals.outputs;
    let variances: Vec<f64> = (0..l).map(|o| residuals.variance(o)).collect();
    if (0..l).any(|o| stated[(o, o)] <= 0.0 || variances[o] <= 0.0) {
        return None;
    }
    let n = residuals.gram.columns as f64;
    let excess = |o: usize| sensitivity.map_or(0.0, |s| s.excess[o] / variances[o]);
    let total: f64 = (0..l).map(excess).sum();
    // Tested samples over those that the stated variance comes from.
    let both = match (relation, sensitivity) {
        (Relation::Fresh, Some(s)) if s.rank() > 0 => 1.0 + n * total / s.rank() as f64,
        _ => 1.0,
    };
    let law = Normal::standard();
    let outputs: Vec<OutputSize> = (0..l)
        .map(|o| {
            let (second, fourth) = residuals.moments[o];
            let kurtosis = fourth * residuals.kept as f64 / (second * second);
            let channel = residuals.inputs + o;
            let now = residuals.row(channel, 0);
            let colour: f64 = (1..=lags)
                .map(|lag| {
                    let product = residuals.gram.gram[(now, residuals.row(channel, lag))];
                    (product / (n * variances[o])).powi(2)
                })
                .sum();
            let relative = (kurtosis - 1.0).max(0.0) + 4.0 * colour;
            let deviation = (relative / n * both).sqrt();
            let ratio = variances[o] / stated[(o, o)];
            let expected_ratio = match relation {
                Relation::Fresh => 1.0 + sensitivity.map_or(0.0, |s| s.excess[o] / stated[(o, o)]),
                Relation::Estimation => 1.0,
            };
            let z = (ratio / expected_ratio).ln().abs() / deviation.max(f64::MIN_POSITIVE);
            OutputSize {
                output: options.output(o),
                stated_variance: stated[(o, o)],
                residual_variance: variances[o],
                ratio,
                expected_ratio,
                p_value: (2.0 * law.sf(z)).clamp(0.0, 1.0),
            }
        })
        .collect();
    let smallest = outputs.iter().map(|o| o.p_value).fold(1.0, f64::min);
    Some(InnovationSize {
        outputs,
        p_value: (smallest * l as f64).min(1.0),
    })
}
