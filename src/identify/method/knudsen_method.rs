//! Knudsen's methods as a [`Method`](super::Method).

use std::sync::{Arc, OnceLock};

use super::{Decomposed, Estimated, Orders, Uncertain, Windows};
use crate::covariance::ParameterCovariance;
use crate::identify::IdentifyError;
use crate::identify::algorithms::Stochastic;
use crate::identify::data::Source;
use crate::identify::knudsen::{
    Decomposition, Influence, Knudsen, Observability, Regression, ResidualStep,
    extended_observability, jacobian, knudsen,
};
use crate::identify::pem::{Form, PredictionErrorEstimate, Signals, prediction_error_method};
use crate::identify::polish::{Effort, polish};
use crate::identify::subspace::varx;
use crate::linalg::{multiply, pseudo_inverse};
use crate::model::StateSpace;
use crate::moments::RFactor;

/// Samples from which the covariance is computed, at most: the relative error of a variance that so many
/// windows give is below 2 %.
const COVARIANCE_SAMPLES: usize = 50_000;
/// Gauss-Newton steps of `--polish always`. From a past of twenty samples two steps reach the Cramer-Rao bound within
/// a few per cent in the paper's ARMAX system (one step leaves 17 % in one of its parameters), and where the likelihood
/// is flat (its BJ system) few steps do better than all: converged estimates have heavy tails there.
const POLISH_STEPS: usize = 2;
/// Relative size below which states are not observable to working precision.
const DEPENDENT: f64 = 1e-12;

/// Signals of all experiments, scaled and detrended.
type Experiments = Vec<Vec<Vec<f64>>>;

#[derive(Debug)]
struct Shared {
    windows: Windows,
    step: ResidualStep,
    regression: Regression,
    decomposition: Decomposition,
    experiments: OnceLock<Arc<Experiments>>,
}

/// The regression and the singular value decomposition of its coefficients.
///
/// # Errors
/// [`IdentifyError`] when the recordings are too short for the windows.
pub(super) fn decomposed(
    windows: &Windows,
    source: &mut Source<'_>,
) -> Result<Decomposed, IdentifyError> {
    let regression = regression(windows, source)?;
    let decomposition = Decomposition::new(&regression)?;
    let values = &decomposition.values;
    let first = values.first().copied().unwrap_or(0.0);
    let seen = values
        .iter()
        .take_while(|v| **v > first * DEPENDENT)
        .count();
    let step = match windows.stochastic {
        Some(Stochastic::FirstColumn) => ResidualStep::FirstColumn,
        _ => ResidualStep::Cholesky,
    };
    Ok(Decomposed::new(
        values.clone(),
        seen.min((regression.future - 1) * regression.outputs),
        Arc::new(Shared {
            decomposition,
            regression,
            step,
            windows: windows.clone(),
            experiments: OnceLock::new(),
        }),
    ))
}

/// The regression of the future on the past of these windows.
///
/// # Errors
/// [`IdentifyError`] when the recordings are too short for the windows.
pub(super) fn regression(
    windows: &Windows,
    source: &mut Source<'_>,
) -> Result<Regression, IdentifyError> {
    let past = windows.factor.past;
    Regression::new(&*source.factor(past + windows.future - 1)?, past)
}

/// All experiments in memory.
pub(super) fn experiments(source: &mut Source<'_>) -> Result<Experiments, IdentifyError> {
    (0..source.experiments())
        .map(|experiment| source.signals(experiment))
        .collect()
}

pub(super) fn slices(experiments: &Experiments) -> Vec<&Signals> {
    experiments.iter().map(Vec::as_slice).collect()
}

impl Shared {
    fn experiments(&self, source: &mut Source<'_>) -> Result<Arc<Experiments>, IdentifyError> {
        if let Some(known) = self.experiments.get() {
            return Ok(Arc::clone(known));
        }
        let read = Arc::new(experiments(source)?);
        Ok(Arc::clone(self.experiments.get_or_init(|| read)))
    }
}

impl Orders for Arc<Shared> {
    fn estimate(&self, order: usize, source: &mut Source<'_>) -> Result<Estimated, IdentifyError> {
        let windows = &self.windows;
        let feedthrough = windows.varx.feedthrough;
        let made = knudsen(
            &self.regression,
            &self.decomposition,
            order,
            feedthrough,
            self.step,
            windows.sample_time,
        )?;
        let experiments = if windows.comparing {
            Arc::default()
        } else {
            self.experiments(source)?
        };
        let improved = if windows.polish_by_method {
            let signals = slices(&experiments);
            let form = Form::Innovation;
            // A noise-free recording has no likelihood: its model is exact as it is.
            prediction_error_method(&made.system, &signals, feedthrough, form, POLISH_STEPS).ok()
        } else {
            None
        };
        let (system, innovation_covariance) = match &improved {
            Some(p) => (&p.system, &p.innovation_covariance),
            None => (&made.system, &made.innovation_covariance),
        };
        Ok(Estimated {
            system: system.clone(),
            innovation_covariance: innovation_covariance.clone(),
            window: self.regression.past + self.regression.future - 1,
            converged: true,
            uncertain: Arc::new(OfOrder {
                shared: Arc::clone(self),
                made,
                improved,
                experiments,
            }),
        })
    }
}

#[derive(Debug)]
struct OfOrder {
    shared: Arc<Shared>,
    made: Knudsen,
    improved: Option<PredictionErrorEstimate>,
    experiments: Arc<Experiments>,
}

impl Uncertain for OfOrder {
    /// By the delta method from the influence of every window; after the Gauss-Newton step the inverse information.
    fn covariance(&self) -> Result<Option<ParameterCovariance>, IdentifyError> {
        if let Some(improved) = &self.improved {
            return Ok(Some(improved.covariance.clone()));
        }
        let Shared {
            regression,
            decomposition,
            step,
            windows,
            ..
        } = self.shared.as_ref();
        if self.made.innovation_covariance.amax() == 0.0 || self.experiments.is_empty() {
            return Ok(None);
        }
        let jacobian = jacobian(
            regression,
            decomposition,
            &self.made.deterministic,
            &self.made.raw_noise,
            *step,
            windows.varx.feedthrough,
        )?;
        let mut influence = Influence::new(regression, &jacobian);
        let mut left = COVARIANCE_SAMPLES;
        for signals in self.experiments.iter() {
            let take = signals.first().map_or(0, Vec::len).min(left);
            left -= take;
            let part: Vec<Vec<f64>> = signals.iter().map(|c| c[..take].to_vec()).collect();
            influence.add(&part);
        }
        Ok(Some(influence.finish()?))
    }

    fn replicate(&self, factor: &RFactor) -> Result<StateSpace, IdentifyError> {
        let shared = &self.shared;
        let feedthrough = shared.windows.varx.feedthrough;
        if let Some(improved) = &self.improved {
            let varx = varx(&factor.leading(shared.regression.past), feedthrough)?;
            return Ok(polish(&improved.system, &varx, None, Effort::Full)?.system);
        }
        let regression = Regression::new(factor, shared.regression.past)?;
        let decomposition = Decomposition::new(&regression)?;
        let order = self.made.system.states();
        let time = self.made.system.sample_time;
        let step = shared.step;
        let made = knudsen(&regression, &decomposition, order, feedthrough, step, time)?;
        in_basis_of(&made.system, &self.made.system, regression.future)
    }
}

/// The system in the state basis in which its observability matrix is nearest to that of `reference`.
pub(super) fn in_basis_of(
    system: &StateSpace,
    reference: &StateSpace,
    blocks: usize,
) -> Result<StateSpace, IdentifyError> {
    // Gamma T^-1 near Gamma_reference: T = Gamma_reference^+ Gamma.
    let to = Observability::of(&reference.a, &reference.c, blocks)?.gamma;
    let from = extended_observability(&system.a, &system.c, blocks);
    let t = multiply(&pseudo_inverse(&to, DEPENDENT)?, &from);
    system
        .transformed(&t)
        .map_err(|error| IdentifyError::Option(error.to_string()))
}
