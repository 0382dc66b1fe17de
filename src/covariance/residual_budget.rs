//! How much of a record the effect of the parameter errors on the residuals is averaged over, and what that takes.
//!
//! Residual tests spend this budget; an identification, which the tests follow, counts it beforehand.

/// Most lags that residuals are tested at by default.
pub(crate) const MOST_LAGS: usize = 25;
/// Most samples that the sensitivities are averaged over.
const MOST_SAMPLES: usize = 20_000;
/// Fewest, whatever the effort.
const FEWEST_SAMPLES: usize = 4_000;
/// Multiplications that the averages may take.
const EFFORT: usize = 40_000_000;
/// Matrices of tested regressors times sensitivities that are there at once.
const PRODUCTS: usize = 6;

/// Numbers that the averages take for a model of `inputs` and `outputs` whose covariance has so many directions: the
/// sensitivities of all samples, and [`PRODUCTS`] products of them with the tested regressors.
pub(crate) fn numbers_of_tests(inputs: usize, outputs: usize, directions: usize) -> usize {
    let channels = inputs.saturating_add(outputs);
    let width = channels.saturating_mul(MOST_LAGS + 1);
    let each = directions.saturating_mul(outputs);
    let samples = samples_followed(each, width);
    each.saturating_mul(samples.saturating_add(width.saturating_mul(PRODUCTS)))
}

/// Samples that sensitivities are averaged over, where each has `each` numbers and is multiplied with `width`.
pub(crate) fn samples_followed(each: usize, width: usize) -> usize {
    (EFFORT / each.saturating_mul(width).max(1)).clamp(FEWEST_SAMPLES, MOST_SAMPLES)
}
