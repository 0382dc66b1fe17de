//! The prediction error method: the model whose one-step prediction errors over the recording are smallest.
//!
//! Minimises `N log det (1/N) sum e[k] e[k]'`, which for normal innovations is maximum likelihood, by Gauss-Newton
//! steps in the time domain, damped (Levenberg-Marquardt) where a plain step does not lead down. The initial state of
//! each experiment is free, and eliminated in every step. Unlike the polish, which works on the vector ARX
//! coefficients, nothing is cut off by a past window; it needs every sample in every step instead.
//!
//! | file | what it holds |
//! |---|---|
//! | `parametrisation` | innovation form in local coordinates, ARMAX in observer form |
//! | `sensitivity` | prediction errors and their derivatives, as a triangular factor |
//!
//! The covariance is the inverse of the information, the Cramer-Rao bound for normal innovations (Ljung, *System
//! Identification*, 2nd ed., section 9.3), with the innovation covariance divided by the residual degrees of freedom.

mod parametrisation;
mod sensitivity;
#[cfg(test)]
mod tests;

use nalgebra::{DMatrix, DVector};

use super::identify_error::IdentifyError;
use crate::covariance::{ParameterCovariance, ParameterLayout};
use crate::linalg::{
    LinalgError, all_finite, cholesky_upper, multiply_nt, multiply_tn, qr_r,
    solve_upper_transposed, svd_thin,
};
use crate::model::{ModelError, StateSpace};

pub(crate) use parametrisation::Form;
pub(crate) use sensitivity::Signals;

/// A search that has not ended by then will not.
pub(crate) const STEPS: usize = 100;
/// The search ends when a step promises less than this in the cost, in units of chi-square: the parameters are then
/// within a thousandth of a standard deviation of the minimum.
const DECREASE: f64 = 1e-6;
/// Length and Levenberg-Marquardt damping (relative to the largest singular value) of the steps that are tried.
const TRIES: [(f64, f64); 9] = [
    (1.0, 0.0),
    (0.5, 0.0),
    (0.25, 0.0),
    (1.0, 1e-5),
    (1.0, 1e-4),
    (1.0, 1e-3),
    (1.0, 1e-2),
    (1.0, 1e-1),
    (1.0, 1.0),
];
/// Tried when none of [`TRIES`] leads down; of those the first that does is taken, for a cost here needs every sample.
const LAST_TRY: (f64, f64) = (0.1, 1.0);
/// Singular values of the Jacobian below this share of the largest are not determined by the data.
const UNDETERMINED: f64 = 1e-11;

/// Result of the search.
#[derive(Debug, Clone)]
pub(crate) struct PredictionErrorEstimate {
    /// The model, in the units of the signals.
    pub(crate) system: StateSpace,
    /// Covariance of the innovations: sum of squares over residual degrees of freedom.
    pub(crate) innovation_covariance: DMatrix<f64>,
    /// Inverse information, in the basis of the system.
    pub(crate) covariance: ParameterCovariance,
    #[cfg(feature = "cli")]
    /// The polynomials with the covariance of `a1..an, (b0), b1..bn, c1..cn`, when that was the form.
    pub(crate) armax: Option<(crate::model::Armax, DMatrix<f64>)>,
    /// `N log det` of the mean square prediction errors.
    pub(crate) cost: f64,
    /// Whether no step promised anything any more.
    pub(crate) converged: bool,
}

/// Improves `start` by at most `steps` steps.
///
/// # Errors
/// [`IdentifyError::Option`] for an ARMAX form of a model that has not one input and one output,
/// [`IdentifyError::Linalg`] when the prediction errors of the start are not finite or vanish (a noise-free recording
/// has no likelihood).
pub(crate) fn prediction_error_method(
    start: &StateSpace,
    experiments: &[&Signals],
    feedthrough: bool,
    form: Form,
    steps: usize,
) -> Result<PredictionErrorEstimate, IdentifyError> {
    let layout = ParameterLayout::of(start, feedthrough);
    let start = form.start(start).ok_or_else(|| {
        IdentifyError::Option(format!(
            "an ARMAX model has one input and one output; here are {} and {}",
            layout.inputs, layout.outputs
        ))
    })?;
    let search = Search {
        experiments,
        layout,
        samples: experiments
            .iter()
            .map(|e| e.first().map_or(0, Vec::len))
            .sum(),
    };
    let identity = DMatrix::identity(layout.outputs, layout.outputs);
    // The initial state depends on the weight and the weight on it: twice is enough.
    let rough = search.point(start.clone(), &identity)?;
    let mut point = search.point(start, &rough.mean_square)?;
    let mut taken = 0;
    let mut converged = false;
    let (directions, linearised) = loop {
        let directions = form.directions(&point.system, &layout)?;
        let linearised = search.linearise(&point, &directions)?;
        if linearised.decrease() < DECREASE {
            converged = true;
            break (directions, linearised);
        }
        if taken == steps {
            break (directions, linearised);
        }
        let mut tries = TRIES.iter().chain([&LAST_TRY]);
        let better = tries.find_map(|&(length, damping)| {
            let step: Vec<f64> = linearised
                .step(damping)
                .iter()
                .map(|s| length * s)
                .collect();
            let lambda = &point.mean_square;
            let system = form.moved(&point.system, &layout, &directions, &step, lambda)?;
            let candidate = search.point(system, lambda).ok()?;
            (candidate.cost < point.cost).then_some(candidate)
        });
        match better {
            Some(candidate) => {
                point = candidate;
                taken += 1;
            }
            None => {
                // At the minimum to rounding.
                converged = linearised.decrease() < DECREASE.sqrt();
                break (directions, linearised);
            }
        }
    };
    // Each output has its share of the parameters, and of the initial states.
    let parameters = directions.ncols() + layout.states * experiments.len();
    let lost = parameters as f64 / layout.outputs as f64;
    let samples = search.samples as f64;
    let inflation = samples / (samples - lost).max(1.0);
    let coordinates = linearised.covariance() * inflation;
    let matrix = multiply_nt(&(&directions * &coordinates), &directions);
    Ok(PredictionErrorEstimate {
        #[cfg(feature = "cli")]
        armax: (form == Form::Armax).then(|| {
            (
                parametrisation::armax_of_observer_form(&point.system),
                coordinates,
            )
        }),
        covariance: ParameterCovariance::of_matrix(layout, &matrix),
        innovation_covariance: &point.mean_square * inflation,
        system: point.system,
        cost: point.cost,
        converged,
    })
}

/// What stays the same during a search.
struct Search<'a> {
    experiments: &'a [&'a Signals],
    layout: ParameterLayout,
    samples: usize,
}

/// A model with its prediction errors.
struct Point {
    system: StateSpace,
    initial_states: Vec<DVector<f64>>,
    mean_square: DMatrix<f64>,
    cost: f64,
}

impl Search<'_> {
    fn point(&self, system: StateSpace, lambda: &DMatrix<f64>) -> Result<Point, IdentifyError> {
        let l = self.layout.outputs;
        let mut initial_states = Vec::with_capacity(self.experiments.len());
        let mut sum = DMatrix::zeros(l, l);
        for signals in self.experiments {
            let (x0, squares) =
                sensitivity::prediction_errors(&system, signals, lambda).map_err(of_model)?;
            initial_states.push(x0);
            sum += squares;
        }
        let mean_square = sum / self.samples as f64;
        let not_finite = LinalgError::NotFinite {
            what: "prediction errors",
        };
        if !all_finite(&mean_square) {
            return Err(not_finite.into());
        }
        let upper = cholesky_upper(&mean_square)?;
        let log_determinant: f64 = upper.diagonal().iter().map(|d| 2.0 * d.ln()).sum();
        Ok(Point {
            system,
            initial_states,
            mean_square,
            cost: self.samples as f64 * log_determinant,
        })
    }

    fn linearise(
        &self,
        point: &Point,
        directions: &DMatrix<f64>,
    ) -> Result<Linearised, LinalgError> {
        let l = self.layout.outputs;
        let upper = cholesky_upper(&point.mean_square)?;
        let whitener = solve_upper_transposed(&upper, &DMatrix::identity(l, l));
        let columns = directions.ncols() + 1;
        let mut stacked = DMatrix::zeros(0, columns);
        for (signals, x0) in self.experiments.iter().zip(&point.initial_states) {
            let factor = sensitivity::linearised_errors(
                &point.system,
                &self.layout,
                directions,
                signals,
                x0,
                &whitener,
            )?;
            let head = stacked.nrows();
            stacked = stacked.resize_vertically(head + factor.nrows(), 0.0);
            stacked.rows_mut(head, factor.nrows()).copy_from(&factor);
        }
        Linearised::new(&qr_r(&stacked), columns - 1)
    }
}

fn of_model(error: ModelError) -> IdentifyError {
    match error {
        ModelError::Linalg(error) => error.into(),
        other => IdentifyError::Option(other.to_string()),
    }
}

/// The linearised problem in the singular directions of its Jacobian, columns scaled to unit size.
struct Linearised {
    scale: Vec<f64>,
    directions: DMatrix<f64>,
    values: Vec<f64>,
    projected: Vec<f64>,
}

impl Linearised {
    fn new(factor: &DMatrix<f64>, parameters: usize) -> Result<Self, LinalgError> {
        let rows = factor.nrows().min(parameters);
        let mut jacobian = factor.view((0, 0), (rows, parameters)).into_owned();
        let mut scale = Vec::with_capacity(parameters);
        for mut column in jacobian.column_iter_mut() {
            let norm = column.norm();
            let unit = if norm > 0.0 { 1.0 / norm } else { 1.0 };
            column.scale_mut(unit);
            scale.push(unit);
        }
        let svd = svd_thin(&jacobian)?;
        let right = factor.view((0, parameters), (rows, 1)).into_owned();
        let projected = multiply_tn(&svd.u, &right);
        Ok(Self {
            scale,
            directions: svd.v,
            values: svd.values.iter().copied().collect(),
            projected: projected.iter().copied().collect(),
        })
    }

    fn determined(&self) -> f64 {
        UNDETERMINED * self.values.first().copied().unwrap_or(0.0)
    }

    /// Decrease of the cost that a full step promises.
    fn decrease(&self) -> f64 {
        let determined = self.determined();
        self.values
            .iter()
            .zip(&self.projected)
            .filter(|(value, _)| **value > determined)
            .map(|(_, p)| p * p)
            .sum()
    }

    /// The step in the coordinates; `damping` zero is Gauss-Newton.
    fn step(&self, damping: f64) -> Vec<f64> {
        let determined = self.determined();
        let largest = self.values.first().copied().unwrap_or(0.0);
        let along = DVector::from_iterator(
            self.values.len(),
            self.values.iter().zip(&self.projected).map(|(&value, &p)| {
                if value > determined {
                    -p * value / (value * value + (damping * largest).powi(2))
                } else {
                    0.0
                }
            }),
        );
        (&self.directions * along)
            .iter()
            .zip(&self.scale)
            .map(|(step, scale)| step * scale)
            .collect()
    }

    /// Inverse of the information.
    fn covariance(&self) -> DMatrix<f64> {
        let determined = self.determined();
        let mut root = self.directions.clone();
        for (i, &value) in self.values.iter().enumerate() {
            let inverse = if value > determined { 1.0 / value } else { 0.0 };
            root.column_mut(i).scale_mut(inverse);
        }
        for (i, scale) in self.scale.iter().enumerate() {
            root.row_mut(i).scale_mut(*scale);
        }
        multiply_nt(&root, &root)
    }
}
