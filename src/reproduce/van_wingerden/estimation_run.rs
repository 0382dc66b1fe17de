//! One run: PBSID_opt at the paper's windows, with the covariance of the paper, and polished.

use nalgebra::DMatrix;
use num_complex::Complex64;

use crate::covariance::{Covariance2, ParameterCovariance, frequency_response_covariance};
use crate::identify::variance::subspace_covariance;
use crate::identify::{
    Decomposition, Effort, Estimate, Varx, Weight, decompose, polish, system_matrices, varx,
};
use crate::log::Log;
use crate::model::StateSpace;
pub(super) use crate::reproduce::data_factor::Failure;
use crate::reproduce::data_factor::raw_factor;

/// Windows and order.
#[derive(Debug, Clone, Copy)]
pub(super) struct Setting {
    pub(super) samples: usize,
    pub(super) past: usize,
    pub(super) future: usize,
    pub(super) order: usize,
}

/// PBSID_opt as the paper has it: no level removed, weight identity.
#[derive(Debug)]
pub(super) struct Subspace {
    pub(super) varx: Varx,
    pub(super) estimate: Estimate,
}

impl Subspace {
    /// Identifies from a recording.
    pub(super) fn new(log: &Log, setting: &Setting) -> Result<Self, Failure> {
        let factor = raw_factor(log, setting.past)?;
        let varx = varx(&factor, false).map_err(|e| e.to_string())?;
        let decomposition: Decomposition =
            decompose(&factor, &varx, setting.future, Weight::Identity)
                .map_err(|e| e.to_string())?;
        let estimate = system_matrices(
            &factor,
            &varx,
            &decomposition,
            decomposition.svd.state_map(setting.order),
            log.sample_time,
        )
        .map_err(|e| e.to_string())?;
        Ok(Self { varx, estimate })
    }

    /// Response and its covariance (41), signs put right.
    pub(super) fn response(&self, grid: &[f64]) -> Result<Response, Failure> {
        let covariance =
            subspace_covariance(&self.estimate, &self.varx).map_err(|e| e.to_string())?;
        Response::new(&self.estimate.system, &covariance, grid)
    }

    /// The same for the maximum-likelihood model of the same order.
    pub(super) fn polished(&self, grid: &[f64]) -> Result<Response, Failure> {
        let polished = polish(&self.estimate.system, &self.varx, None, Effort::Full)
            .map_err(|e| e.to_string())?;
        Response::new(&polished.system, &polished.covariance, grid)
    }
}

/// A frequency response with its covariance at the frequencies of a grid.
#[derive(Debug, Clone)]
pub(super) struct Response {
    pub(super) value: Vec<DMatrix<Complex64>>,
    pub(super) covariance: Vec<DMatrix<Covariance2>>,
}

impl Response {
    /// Of a system with the covariance of its parameters.
    pub(super) fn new(
        system: &StateSpace,
        covariance: &ParameterCovariance,
        grid: &[f64],
    ) -> Result<Self, Failure> {
        let covariance = grid
            .iter()
            .map(|&w| frequency_response_covariance(system, covariance, w))
            .collect::<Result<_, _>>()
            .map_err(|e| e.to_string())?;
        Ok(Self {
            value: truth(system, grid),
            covariance,
        })
    }
}

/// The response of a system that is known.
pub(super) fn truth(system: &StateSpace, grid: &[f64]) -> Vec<DMatrix<Complex64>> {
    grid.iter().map(|&w| system.frequency_response(w)).collect()
}
