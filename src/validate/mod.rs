//! Does a model fit a recording, and has it left anything to explain?
//!
//! Residuals `e[k]` are the innovations of the one-step predictor (the simulation errors of a model with
//! `K = 0`), without the start-up in which the estimated initial state still shows. A right model leaves
//! residuals that nothing known at the time predicts: neither their own past (*whiteness*) nor past
//! inputs. Both are tested as partial correlations, see `residuals`:
//!
//! | test | target | regressors tested | given |
//! |---|---|---|---|
//! | whiteness (Hosking 1980) | `e[k]` | `e[k-1..k-M]` | nothing |
//! | past inputs (Granger 1969) | `e[k]` | `u[k-1..k-M]` | `e[k-1..k-a]` |
//! | same sample, for information | `e[k]` | `u[k]` | `e[k-1..k-a]`, `u[k-1..k-M]` |
//! | linearity (Lee, White and Granger 1993) | `e[k]` | squares and products of `u[k-i]`, `y[k-i]` | all that is linear |
//! | feedback, for information (Caines and Chan 1975) | `u[k]` | `e[k-1..k-M]` | `u[k-1..k-b]` |
//!
//! - *Closed loop.* Feedback makes future inputs depend on `e[k]`, so only past inputs are tested. The input of the
//!   same sample is tested only when the model has direct feedthrough (`D` not zero or estimated): with
//!   `D = 0` a controller without delay makes `u[k]` depend on `e[k]`.
//! - *Coloured noise.* The residuals of a model without noise model, or with a wrong one, are coloured. Past
//!   inputs are then tested given the past of the residuals, `a` lags by Akaike's criterion and a margin: colour
//!   neither inflates the statistic nor hides what inputs do, in closed loop too, where past inputs carry
//!   past residuals.
//! - *Parameter errors.* Residuals come from estimated parameters. Their covariance widens the covariance of
//!   the correlations on a fresh record and narrows it on the record estimated from, see `parameter_errors`; the
//!   degrees of freedom follow from its rank. What first-order theory misses on a fresh record
//!   widens it too.
//! - *Offsets.* Means over the record are taken out of inputs and residuals, and reported with the fit.
//!
//! - *Linearity.* Correlations only see what is linear. The residual is tested against squares and products of past
//!   inputs and outputs as well, given all that is linear in the past, see `linearity`.
//!
//! Because everything is significant in a long record, each test says which share of the variance it is
//! about (`R^2`, adjusted for degrees of freedom).
//!
//! | folder or file | what it holds |
//! |---|---|
//! | `residuals` | the one pass over the records; partial correlations from lag products; how much past to allow for |
//! | `parameter_errors` | what the errors of the parameters do, first and second order; statistic, degrees of freedom, bounds |
//! | `linearity` | squares and products of the past |
//! | `length` | how long a record must be for any of this |
//! | `innovation_size` | residual variance against the stated one |
//! | `deviations` | recordings in the units of the user, as a model sees them |
//! | `identified` | identification with the tests that belong to it |
//! | `verdict` | which tests reject together, and the sentences |
//!
//! Source: Ljung, *System Identification*, 2nd ed. (1999), chapter 16.

pub(crate) mod deviations;
pub(crate) mod identified;
mod innovation_size;
mod length;
mod linearity;
mod parameter_errors;
mod preconditions;
mod residuals;
mod result;
mod validate_error;
mod validation_options;
mod verdict;

#[cfg(test)]
mod tests;

#[cfg(feature = "cli")]
pub(crate) use deviations::{Deviations, Zero, judge};
pub use identified::{TestedModel, identify_and_test};
pub(crate) use length::too_short;
pub(crate) use residuals::fit_measure;
pub use result::{
    FitMeasure, InnovationSize, LinearityScope, OutputFit, OutputSize, PairCorrelation,
    ResidualTest, Strongest, TooShort, Validation,
};
pub use validate_error::ValidateError;
pub use validation_options::{RecordView, Relation, ValidationOptions};

use nalgebra::DMatrix;

use crate::covariance::{MOST_LAGS, ParameterCovariance};
use crate::model::StateSpace;
use linearity::Linearity;
use parameter_errors::{Outcome, Regressor, ScoreCovariance, Sensitivity, outcome};
use residuals::{Partial, Residuals};

/// Samples of each channel for one lag, by default.
const SAMPLES_PER_LAG: usize = 10;
/// Samples wanted for each tested or conditioning regressor.
const SAMPLES_PER_REGRESSOR: usize = 3;

/// Judges a model on one or more records.
///
/// - `system`: the model, `n` states, `r` inputs, `l` outputs; `K = 0` for one without noise model.
/// - `innovation_covariance` (`l x l`): what the model states about the size of the innovations.
/// - `covariance`: covariance of the parameters *in the basis of `system`*; without it the parameters count as
///   exact. On the estimation record the estimate is taken to be efficient (maximum likelihood).
/// - `records`: columns as deviations from the operating point.
/// - `relation`: whether the model was estimated from these very records.
///
/// # Errors
/// [`ValidateError`] for data that do not fit the model, hold NaN, are too short, or do not move, and for a
/// model whose one-step predictor is unstable.
pub fn validate(
    system: &StateSpace,
    innovation_covariance: Option<&DMatrix<f64>>,
    covariance: Option<&ParameterCovariance>,
    records: &[RecordView<'_>],
    relation: Relation,
    options: &ValidationOptions,
) -> Result<Validation, ValidateError> {
    preconditions::check(system, innovation_covariance, covariance, records, options)?;
    let (r, l) = (system.inputs(), system.outputs());
    let q = r + l;
    let samples: usize = records.iter().map(RecordView::samples).sum();
    let lags = options
        .lags
        .unwrap_or_else(|| (samples / (SAMPLES_PER_LAG * q)).clamp(1, MOST_LAGS));
    let longest = residuals::longest(samples, q);
    let past = lags.max(longest);
    let needed_columns = q
        .saturating_mul(lags)
        .max(r.saturating_mul(lags).saturating_add(l * longest))
        .saturating_mul(SAMPLES_PER_REGRESSOR);
    // Before anything is allocated that grows with the lags asked for.
    if samples < past.saturating_add(needed_columns) {
        return Err(ValidateError::TooShort {
            samples,
            lags,
            needed: past.saturating_add(needed_columns),
        });
    }
    let mut residuals = residuals::residuals(system, innovation_covariance, records, past)?;
    let one_step = residuals.one_step.measure(options)?;
    let (free_run, free_run_unavailable) = match &residuals.free_run {
        Ok(sums) => (Some(sums.measure(options)?), None),
        Err(reason) => (None, Some(reason.clone())),
    };
    if residuals.gram.columns < needed_columns {
        return Err(ValidateError::TooShort {
            samples: residuals.kept,
            lags,
            needed: needed_columns + past * records.len(),
        });
    }
    leave_out_rounding(&mut residuals);

    let tests = Tests {
        residuals: &residuals,
        lags,
        own_past: residuals::order(&residuals, r, l, longest),
        longest,
        options,
    };
    let sensitivity = match covariance {
        Some(covariance) => {
            let starts = &residuals.starts;
            Sensitivity::new(system, covariance, records, starts, past, relation)?
        }
        None => None,
    };
    let sensitivity = sensitivity.as_ref();
    let feedthrough = system.d.iter().any(|v| *v != 0.0)
        || covariance.is_some_and(|covariance| covariance.layout.feedthrough);

    let whiteness = tests.whiteness(sensitivity, relation)?;
    let past_inputs = tests.past_inputs(sensitivity, relation, feedthrough)?;
    let same_sample = if feedthrough {
        None
    } else {
        tests.same_sample()?
    };
    let feedback = tests.feedback()?;
    let innovation_size = innovation_covariance.and_then(|stated| {
        innovation_size::innovation_size(stated, &residuals, lags, sensitivity, relation, options)
    });

    let linearity = Linearity {
        system,
        covariance,
        innovation_covariance,
        records,
        residuals: &residuals,
        lags,
        own_past: tests.own_past,
        feedthrough,
        options,
    }
    .test()?;
    let (linearity, linearity_scope) = linearity.unzip();
    let fitted = covariance.filter(|_| relation == Relation::Estimation);
    let too_short = too_short(
        (system.states(), r, l),
        fitted.map_or(0, |c| c.layout.identifiable()),
        residuals.samples,
    )
    // What is exact to rounding leaves no doubt, and what is rejected is rejected.
    .filter(|_| !one_step.exact());

    let mut validation = Validation {
        relation,
        samples: residuals.samples,
        tested_samples: residuals.gram.columns,
        start_up_samples: residuals.dropped,
        lags,
        level: options.level,
        one_step,
        free_run,
        free_run_unavailable,
        autocorrelation: whiteness.as_ref().map_or_else(Vec::new, Tested::pairs),
        whiteness: whiteness.map(|tested| tested.result),
        cross_correlation: past_inputs.as_ref().map_or_else(Vec::new, Tested::pairs),
        past_inputs: past_inputs.map(|tested| tested.result),
        own_past_lags: tests.own_past,
        same_sample: same_sample.map(|tested| tested.result),
        feedback: feedback.map(|tested| tested.result),
        linearity,
        linearity_scope,
        too_short,
        innovation_size,
        rejected: false,
        findings: Vec::new(),
    };
    let noise_model = innovation_covariance.is_some() || system.k.iter().any(|v| *v != 0.0);
    verdict::decide(&mut validation, noise_model);
    Ok(validation)
}

/// Residuals that are rounding errors take no part in the tests.
fn leave_out_rounding(residuals: &mut Residuals) {
    let deviations = residuals.one_step.deviations();
    for (output, deviation) in deviations.iter().enumerate() {
        if residuals.variance(output).sqrt() > residuals::ROUNDING * deviation {
            continue;
        }
        for lag in 0..=residuals.past {
            let row = residuals.row(residuals.inputs + output, lag);
            residuals.gram.gram.row_mut(row).fill(0.0);
            residuals.gram.gram.column_mut(row).fill(0.0);
        }
    }
}

/// The tests on what one pass left of the records.
struct Tests<'a> {
    residuals: &'a Residuals,
    lags: usize,
    own_past: usize,
    longest: usize,
    options: &'a ValidationOptions,
}

/// A test with the correlations behind it.
struct Tested {
    result: ResidualTest,
    outcome: Outcome,
    /// Names of the tested regressors' channels, with lags.
    from: Vec<(String, usize)>,
    to: Vec<String>,
}

impl Tests<'_> {
    /// Channels `first..first + count` at every lag of `lags`, lag by lag.
    fn regressors(
        first: usize,
        count: usize,
        lags: std::ops::RangeInclusive<usize>,
    ) -> Vec<Regressor> {
        lags.flat_map(|lag| (first..first + count).map(move |channel| (channel, lag)))
            .collect()
    }

    fn residual_lags(&self, lags: std::ops::RangeInclusive<usize>) -> Vec<Regressor> {
        Self::regressors(self.residuals.inputs, self.residuals.outputs, lags)
    }

    fn input_lags(&self, lags: std::ops::RangeInclusive<usize>) -> Vec<Regressor> {
        Self::regressors(0, self.residuals.inputs, lags)
    }

    fn whiteness(
        &self,
        sensitivity: Option<&Sensitivity>,
        relation: Relation,
    ) -> Result<Option<Tested>, ValidateError> {
        let (target, tested) = (self.residual_lags(0..=0), self.residual_lags(1..=self.lags));
        self.run(&target, &tested, &[], sensitivity, relation)
    }

    fn past_inputs(
        &self,
        sensitivity: Option<&Sensitivity>,
        relation: Relation,
        feedthrough: bool,
    ) -> Result<Option<Tested>, ValidateError> {
        let first = usize::from(!feedthrough);
        let target = self.residual_lags(0..=0);
        let tested = self.input_lags(first..=self.lags);
        let given = self.residual_lags(1..=self.own_past);
        self.run(&target, &tested, &given, sensitivity, relation)
    }

    fn same_sample(&self) -> Result<Option<Tested>, ValidateError> {
        let target = self.residual_lags(0..=0);
        let mut given = self.residual_lags(1..=self.own_past);
        given.extend(self.input_lags(1..=self.lags));
        self.run(
            &target,
            &self.input_lags(0..=0),
            &given,
            None,
            Relation::Fresh,
        )
    }

    fn feedback(&self) -> Result<Option<Tested>, ValidateError> {
        let r = self.residuals.inputs;
        if r == 0 {
            return Ok(None);
        }
        let own = residuals::order(self.residuals, 0, r, self.longest);
        let target = self.input_lags(0..=0);
        let tested = self.residual_lags(1..=self.lags);
        let given = self.input_lags(1..=own);
        self.run(&target, &tested, &given, None, Relation::Fresh)
    }

    fn run(
        &self,
        target: &[Regressor],
        tested: &[Regressor],
        given: &[Regressor],
        sensitivity: Option<&Sensitivity>,
        relation: Relation,
    ) -> Result<Option<Tested>, ValidateError> {
        let rows = |regressors: &[Regressor]| -> Vec<usize> {
            regressors
                .iter()
                .map(|&(channel, lag)| self.residuals.row(channel, lag))
                .collect()
        };
        let gram = &self.residuals.gram;
        let partial = Partial::new(
            &gram.gram,
            gram.columns,
            &rows(given),
            &rows(tested),
            &rows(target),
        )?;
        if partial.dimension() == 0 {
            return Ok(None);
        }
        let covariance = match sensitivity {
            Some(sensitivity) => {
                let averages = sensitivity.averages(&partial, given, tested, target);
                ScoreCovariance::new(&partial, sensitivity, &averages, relation)?
            }
            None => ScoreCovariance::exact(partial.dimension()),
        };
        let Some(outcome) = outcome(&partial, &covariance) else {
            return Ok(None);
        };
        let name = |channel: usize| {
            let r = self.residuals.inputs;
            if channel < r {
                self.options.input(channel)
            } else {
                self.options.output(channel - r)
            }
        };
        let from: Vec<(String, usize)> = tested.iter().map(|&(c, lag)| (name(c), lag)).collect();
        let to: Vec<String> = target.iter().map(|&(c, _)| name(c)).collect();
        let shares = partial.explained();
        Ok(Some(Tested {
            result: ResidualTest {
                statistic: outcome.statistic,
                degrees_of_freedom: outcome.degrees_of_freedom,
                fitted_directions: outcome.fitted,
                variance_inflation: outcome.inflation,
                p_value: outcome.p_value,
                explained_share: shares.iter().sum::<f64>() / shares.len().max(1) as f64,
                explained_share_by_channel: shares,
                strongest: strongest(&outcome, &from, &to),
            },
            outcome,
            from,
            to,
        }))
    }
}

/// The correlation that exceeds its bound by the largest factor.
fn strongest(outcome: &Outcome, from: &[(String, usize)], to: &[String]) -> Option<Strongest> {
    let mut best: Option<(f64, Strongest)> = None;
    for (j, to) in to.iter().enumerate() {
        for (i, (name, lag)) in from.iter().enumerate() {
            let (correlation, bound_99) = (outcome.correlations[(i, j)], outcome.bounds[(i, j)]);
            if bound_99 <= 0.0 {
                continue;
            }
            let factor = correlation.abs() / bound_99;
            if best.as_ref().is_none_or(|(largest, _)| factor > *largest) {
                let found = Strongest {
                    from: name.clone(),
                    to: to.clone(),
                    lag: *lag,
                    correlation,
                    bound_99,
                };
                best = Some((factor, found));
            }
        }
    }
    best.map(|(_, found)| found)
}

impl Tested {
    /// Correlations pair by pair. The regressors are ordered lag by lag, so that a channel comes back every
    /// `count` rows.
    fn pairs(&self) -> Vec<PairCorrelation> {
        let first = self.from.first().map_or(0, |(_, lag)| *lag);
        let count = self.from.iter().filter(|(_, lag)| *lag == first).count();
        let mut pairs = Vec::with_capacity(count * self.to.len());
        for channel in 0..count {
            for (j, to) in self.to.iter().enumerate() {
                let rows = || (channel..self.from.len()).step_by(count);
                pairs.push(PairCorrelation {
                    from: self.from[channel].0.clone(),
                    to: to.clone(),
                    lags: rows().map(|i| self.from[i].1).collect(),
                    values: rows().map(|i| self.outcome.correlations[(i, j)]).collect(),
                    bounds_99: rows().map(|i| self.outcome.bounds[(i, j)]).collect(),
                });
            }
        }
        pairs
    }
}
