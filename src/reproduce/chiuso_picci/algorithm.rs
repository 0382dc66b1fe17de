//! The algorithms; one run of one of them; its true asymptotic variance.

use num_complex::Complex64;

use crate::covariance::{CovarianceError, ParameterCovariance, frequency_response_covariance};
use crate::identify::variance::{AsymptoticMethod, asymptotic_covariance};
use crate::identify::{Method, Options, Order, Polish, Prediction, Weight, identify};
use crate::log::Log;
use crate::model::StateSpace;
use crate::moments::Detrend;
use crate::reproduce::ReproduceError;
pub(super) use crate::reproduce::data_factor::Failure;
use crate::systems::ClosedLoop;

/// Windows, length and order.
#[derive(Debug, Clone, Copy)]
pub(super) struct Windows {
    pub(super) past: usize,
    pub(super) future: usize,
    /// Columns of the data matrices.
    pub(super) columns: usize,
    pub(super) order: usize,
}

/// An algorithm of the study.
#[derive(Debug, Clone, Copy)]
pub(super) struct Algorithm {
    pub(super) name: &'static str,
    /// Whether the paper's figure has it.
    pub(super) in_paper: bool,
    method: Method,
    asymptotic: AsymptoticMethod,
    weight: Weight,
}

/// The whitening filter, by the name that it has here.
pub(super) const WHITENING: &str = "whitening filter";
/// PBSID_opt, likewise.
pub(super) const OPTIMISED: &str = "PBSID_opt";

/// The algorithms: the paper's two, and what is added.
pub(super) fn algorithms() -> Vec<Algorithm> {
    let whitening = AsymptoticMethod::Nested(Prediction::Whitening);
    let innovation = AsymptoticMethod::Nested(Prediction::InnovationEstimation);
    vec![
        Algorithm {
            name: WHITENING,
            in_paper: true,
            method: Method::Whitening,
            asymptotic: whitening,
            weight: Weight::Identity,
        },
        Algorithm {
            name: "innovation estimation",
            in_paper: true,
            method: Method::InnovationEstimation,
            asymptotic: innovation,
            weight: Weight::Identity,
        },
        Algorithm {
            name: "innovation estimation, CVA",
            in_paper: false,
            method: Method::InnovationEstimation,
            asymptotic: innovation,
            weight: Weight::Cva,
        },
        Algorithm {
            name: OPTIMISED,
            in_paper: false,
            method: Method::PbsidOpt,
            asymptotic: AsymptoticMethod::PbsidOpt,
            weight: Weight::Identity,
        },
    ]
}

/// What one run finds: response and its estimated variance at the frequencies of the grid.
#[derive(Debug, Clone)]
pub(super) struct Found {
    pub(super) response: Vec<Complex64>,
    pub(super) variance: Vec<f64>,
}

/// Variance of the response, `E|F - E F|^2`, at the frequencies of the grid.
fn variances(
    system: &StateSpace,
    covariance: &ParameterCovariance,
    grid: &[f64],
) -> Result<Vec<f64>, CovarianceError> {
    grid.iter()
        .map(|&w| {
            let spread = frequency_response_covariance(system, covariance, w)?;
            let [[re, _], [_, im]] = spread[(0, 0)];
            Ok(re + im)
        })
        .collect()
}

impl Algorithm {
    fn options(&self, windows: &Windows) -> Options {
        Options {
            method: self.method,
            order: Order::Fixed(windows.order),
            past: Some(windows.past),
            future: Some(windows.future),
            weight: Some(self.weight),
            polish: Polish::Never,
            detrend: Detrend::None,
            ..Options::default()
        }
    }

    /// Identifies from a recording.
    pub(super) fn run(&self, log: &Log, windows: &Windows, grid: &[f64]) -> Result<Found, Failure> {
        let model = identify(std::slice::from_ref(log), &self.options(windows))
            .map_err(|e| e.to_string())?;
        let covariance = model.covariance.ok_or("no covariance")?;
        Ok(Found {
            response: grid
                .iter()
                .map(|&w| model.system.frequency_response(w)[(0, 0)])
                .collect(),
            variance: variances(&model.system, &covariance, grid).map_err(|e| e.to_string())?,
        })
    }

    /// True asymptotic variance divided by the number of columns.
    pub(super) fn true_variance(
        &self,
        plant: &ClosedLoop,
        windows: &Windows,
        grid: &[f64],
    ) -> Result<Vec<f64>, ReproduceError> {
        let covariance = asymptotic_covariance(
            plant,
            self.asymptotic,
            self.weight,
            windows.past,
            windows.future,
        )?;
        let columns = windows.columns as f64;
        let variances = variances(&plant.plant, &covariance, grid)?;
        Ok(variances.into_iter().map(|v| v / columns).collect())
    }
}
