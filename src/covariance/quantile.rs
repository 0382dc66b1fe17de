//! Quantiles that turn standard deviations into intervals, and covariances into ellipses.

use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

/// Half-width, in standard deviations, of the two-sided interval that holds the fraction `level`: the
/// normal quantile for a model-based covariance (`degrees_of_freedom` `None`), Student's for an estimated
/// one.
///
/// Infinite for `level >= 1` and for degrees of freedom that are not positive; zero for `level <= 0`.
pub fn interval_quantile(level: f64, degrees_of_freedom: Option<f64>) -> f64 {
    if level <= 0.0 {
        return 0.0;
    }
    let upper = 0.5 + level / 2.0;
    if upper >= 1.0 {
        return f64::INFINITY;
    }
    match degrees_of_freedom {
        // Beyond this Student's quantile differs from the normal one by less than 1e-7 of itself.
        Some(nu) if nu > 1e8 => interval_quantile(level, None),
        None => Normal::standard().inverse_cdf(upper),
        Some(nu) => StudentsT::new(0.0, 1.0, nu).map_or(f64::INFINITY, |t| t.inverse_cdf(upper)),
    }
}

/// Squared radius, in units of the covariance, of the ellipse that holds the fraction `level` of a pair of
/// real quantities: `x' Cov^-1 x <= c`.
///
/// `chi2` with two degrees of freedom, `c = -2 ln(1 - level)`, for a model-based covariance; Hotelling's
/// `2 nu / (nu - 1) F(2, nu - 1)` for one estimated with `nu` degrees of freedom, which for two numerator
/// degrees of freedom has the closed form `c = nu ((1 - level)^(-2 / (nu - 1)) - 1)`.
///
/// Infinite for `level >= 1` and for `nu <= 1`; zero for `level <= 0`.
pub fn ellipse_quantile(level: f64, degrees_of_freedom: Option<f64>) -> f64 {
    if level <= 0.0 {
        return 0.0;
    }
    if level >= 1.0 {
        return f64::INFINITY;
    }
    let tail = (-level).ln_1p();
    match degrees_of_freedom {
        None => -2.0 * tail,
        Some(nu) if nu > 1.0 => nu * (-2.0 * tail / (nu - 1.0)).exp_m1(),
        Some(_) => f64::INFINITY,
    }
}

#[cfg(test)]
#[path = "tests/quantile_tests.rs"]
mod tests;
