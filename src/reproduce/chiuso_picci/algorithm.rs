//! The algorithms; one run of one of them; its true asymptotic variance.

use num_complex::Complex64;

use crate::covariance::frequency_response_covariance;
use crate::identify::{Options, Order, Polish, Weight, identify};
use crate::log::Log;
use crate::moments::Detrend;
pub(super) use crate::reproduce::data::Failure;
use crate::reproduce::error::ReproduceError;
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
    pub(super) weight: Weight,
}

/// The algorithms.
pub(super) fn algorithms() -> Vec<Algorithm> {
    vec![Algorithm {
        name: "PBSID_opt",
        in_paper: false,
        weight: Weight::Identity,
    }]
}

/// What one run finds: response and its estimated variance at the frequencies of the grid.
#[derive(Debug, Clone)]
pub(super) struct Found {
    pub(super) response: Vec<Complex64>,
    pub(super) variance: Vec<f64>,
}

impl Algorithm {
    fn options(&self, windows: &Windows) -> Options {
        Options {
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
        let variance = grid
            .iter()
            .map(|&w| {
                let spread = frequency_response_covariance(&model.system, &covariance, w)?;
                let [[re, _], [_, im]] = spread[(0, 0)];
                Ok(re + im)
            })
            .collect::<Result<_, crate::covariance::CovarianceError>>()
            .map_err(|e| e.to_string())?;
        Ok(Found {
            response: grid
                .iter()
                .map(|&w| model.system.frequency_response(w)[(0, 0)])
                .collect(),
            variance,
        })
    }

    /// True asymptotic variance divided by the number of columns.
    pub(super) fn true_variance(
        &self,
        plant: &ClosedLoop,
        windows: &Windows,
        grid: &[f64],
    ) -> Result<Vec<f64>, ReproduceError> {
        let log = plant.record(1_000_000, 1)?;
        let found = self
            .run(&log, windows, grid)
            .map_err(|first| ReproduceError::Failed {
                method: self.name.to_owned(),
                failed: 1,
                runs: 1,
                first,
            })?;
        let scale = (log.samples() - windows.past) as f64 / windows.columns as f64;
        Ok(found.variance.iter().map(|v| v * scale).collect())
    }
}
