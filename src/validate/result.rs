//! The judgement as a document.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::validation_options::Relation;

/// Everything that [`validate`](super::validate()) found out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Validation {
    /// What the records have to do with the model.
    pub relation: Relation,
    /// Samples of all records.
    pub samples: usize,
    /// Samples whose residuals are tested: without the start-up of the predictor and the samples that
    /// only serve as a past.
    pub tested_samples: usize,
    /// Samples dropped at the start of every record because the estimated initial state still shows.
    pub start_up_samples: usize,
    /// Number of lags tested.
    pub lags: usize,
    /// Family-wise level of the verdict.
    pub level: f64,
    /// Fit of the prediction one sample ahead.
    pub one_step: FitMeasure,
    /// Fit of the free run from the inputs alone; missing when there is none.
    pub free_run: Option<FitMeasure>,
    /// Why there is no free run.
    pub free_run_unavailable: Option<String>,
    /// Are the residuals free of their own past? Missing when the residuals vanish.
    pub whiteness: Option<ResidualTest>,
    /// Are the residuals free of past inputs, beyond what their own past says? Missing without inputs that
    /// move or when the residuals vanish.
    pub past_inputs: Option<ResidualTest>,
    /// Lags of the residual's own past that the test of past inputs allows for.
    pub own_past_lags: usize,
    /// Do inputs and residual move in the same sample, beyond their pasts? Information only.
    pub same_sample: Option<ResidualTest>,
    /// Do past residuals act on the inputs? Then the record was taken in closed loop. Information only.
    pub feedback: Option<ResidualTest>,
    /// Are the residuals free of squares and products of past inputs and outputs? Missing when the record is too short
    /// for this test, or when the residuals vanish.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub linearity: Option<ResidualTest>,
    /// What the test of linearity looked at.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub linearity_scope: Option<LinearityScope>,
    /// There when the record is too short for the tests to speak against a model of this order, right or wrong.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub too_short: Option<TooShort>,
    /// Residual size against the innovation covariance that the model states.
    pub innovation_size: Option<InnovationSize>,
    /// Autocorrelations of the residuals for every pair of outputs.
    pub autocorrelation: Vec<PairCorrelation>,
    /// Correlations of residuals with past inputs, both freed of the residuals' own past, for every pair
    /// of input and output.
    pub cross_correlation: Vec<PairCorrelation>,
    /// Whether the model is rejected.
    pub rejected: bool,
    /// What was found and what to do about it, one sentence each.
    pub findings: Vec<String>,
}

/// How well outputs are reproduced.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FitMeasure {
    /// `100 (1 - sqrt(mean over outputs of |y - yhat|^2 / |y - mean y|^2))`.
    pub fit_percent: f64,
    /// Output by output.
    pub outputs: Vec<OutputFit>,
}

/// How well one output is reproduced.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OutputFit {
    /// Name of the output.
    pub output: String,
    /// `100 (1 - |y - yhat| / |y - mean y|)`, mean by record.
    pub fit_percent: f64,
    /// Root mean square of the error in units of the output.
    pub rms_error: f64,
    /// Mean of the error in units of the output.
    pub mean_error: f64,
}

/// One test of the residuals.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ResidualTest {
    /// Chi-square statistic.
    pub statistic: f64,
    /// Its degrees of freedom.
    pub degrees_of_freedom: usize,
    /// Directions of the correlations that the estimation has fitted away, which the degrees of freedom
    /// leave out.
    pub fitted_directions: usize,
    /// Factor on the variances, at least 1, for what first-order theory does not cover: a model from few
    /// samples on many fresh ones.
    pub variance_inflation: f64,
    /// Probability of a statistic of at least this size for a right model.
    pub p_value: f64,
    /// Share of the variance of what is tested that the tested past explains, mean over its channels,
    /// adjusted for degrees of freedom, 0 to 1. The effect size: with many samples anything is significant.
    pub explained_share: f64,
    /// The same for each channel.
    pub explained_share_by_channel: Vec<f64>,
    /// The correlation that exceeds its bound most.
    pub strongest: Option<Strongest>,
}

/// What the test of linearity looked at.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct LinearityScope {
    /// Samples tested.
    pub samples: usize,
    /// Pieces of the records that these are in: more than records when only a part of them was tested.
    pub pieces: usize,
    /// Squares and products tested.
    pub terms: usize,
    /// How many samples back they go.
    pub longest_lag: usize,
    /// The same as a sentence.
    pub sentence: String,
}

/// A recording that cannot tell a right model of this order from a wrong one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct TooShort {
    /// Samples of the recording.
    pub samples: usize,
    /// Numbers that were estimated from it: parameters, initial state, operating point.
    pub parameters: usize,
    /// Samples from which the tests have something to say.
    pub needed: usize,
}

/// The correlation that stands out most.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Strongest {
    /// Channel whose past it is.
    pub from: String,
    /// Channel that it shows in.
    pub to: String,
    /// How many samples back.
    pub lag: usize,
    /// Correlation coefficient.
    pub correlation: f64,
    /// Its two-sided 99 % bound for a right model.
    pub bound_99: f64,
}

/// Correlations of one pair of channels over the lags.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PairCorrelation {
    /// Channel whose past it is.
    pub from: String,
    /// Channel that it shows in.
    pub to: String,
    /// Lags in samples.
    pub lags: Vec<usize>,
    /// Correlation coefficients.
    pub values: Vec<f64>,
    /// Two-sided 99 % bounds for a right model, one by one.
    pub bounds_99: Vec<f64>,
}

/// Residual size against the size that the model states.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct InnovationSize {
    /// Output by output.
    pub outputs: Vec<OutputSize>,
    /// Smallest p-value of the outputs times their number (Bonferroni), at most 1.
    pub p_value: f64,
}

/// Residual size of one output.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OutputSize {
    /// Name of the output.
    pub output: String,
    /// Innovation variance that the model states.
    pub stated_variance: f64,
    /// Residual variance on these records.
    pub residual_variance: f64,
    /// Residual variance over stated variance.
    pub ratio: f64,
    /// Ratio that a right model would show: above 1 on fresh records by the errors of the parameters.
    pub expected_ratio: f64,
    /// Two-sided p-value of the difference.
    pub p_value: f64,
}
