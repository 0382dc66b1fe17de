//! From scaled channels back to the user's units.

use nalgebra::DMatrix;

use crate::covariance::{ParameterCovariance, ParameterLayout};
use crate::model::StateSpace;

/// The system whose inputs and outputs are in the units of the recording, when those of `system` were
/// divided by `scale` (inputs, then outputs).
pub(super) fn system_in_user_units(system: &StateSpace, scale: &[f64]) -> StateSpace {
    let (su, sy) = scale.split_at(system.inputs());
    StateSpace {
        a: system.a.clone(),
        b: DMatrix::from_fn(system.states(), system.inputs(), |i, j| {
            system.b[(i, j)] / su[j]
        }),
        c: DMatrix::from_fn(system.outputs(), system.states(), |i, j| {
            system.c[(i, j)] * sy[i]
        }),
        d: DMatrix::from_fn(system.outputs(), system.inputs(), |i, j| {
            system.d[(i, j)] * sy[i] / su[j]
        }),
        k: DMatrix::from_fn(system.states(), system.outputs(), |i, j| {
            system.k[(i, j)] / sy[j]
        }),
        sample_time: system.sample_time,
    }
}

/// Factor of each parameter between scaled and user units.
fn parameter_factors(layout: &ParameterLayout, scale: &[f64]) -> Vec<f64> {
    let ones = StateSpace {
        a: DMatrix::from_element(layout.states, layout.states, 1.0),
        b: DMatrix::from_element(layout.states, layout.inputs, 1.0),
        c: DMatrix::from_element(layout.outputs, layout.states, 1.0),
        d: DMatrix::from_element(layout.outputs, layout.inputs, 1.0),
        k: DMatrix::from_element(layout.states, layout.outputs, 1.0),
        sample_time: 1.0,
    };
    layout.pack(&system_in_user_units(&ones, scale))
}

/// The covariance of the parameters in user units.
pub(super) fn covariance_in_user_units(
    covariance: &ParameterCovariance,
    scale: &[f64],
) -> ParameterCovariance {
    let factors = parameter_factors(&covariance.layout, scale);
    let mut out = covariance.clone();
    for j in 0..factors.len() {
        for i in 0..factors.len() {
            out.matrix[(i, j)] *= factors[i] * factors[j];
        }
    }
    out
}

/// The covariance of the innovations in user units.
pub(super) fn innovation_in_user_units(
    covariance: &DMatrix<f64>,
    output_scale: &[f64],
) -> DMatrix<f64> {
    DMatrix::from_fn(covariance.nrows(), covariance.ncols(), |i, j| {
        covariance[(i, j)] * output_scale[i] * output_scale[j]
    })
}
