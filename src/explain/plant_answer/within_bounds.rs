//! What the bounds of a text add to a covariance.

use nalgebra::DMatrix;

use crate::explain::document::sentences::number;
use crate::physics::{ModelSpec, Variable};

/// A covariance of numbers that begin with the parameters of a text, given that these are within their bounds: an observation of
/// each with the variance of a uniform distribution (the update of a Kalman filter, one parameter after the other). Parameters
/// that the recording determines only together have values of their own then.
pub(super) fn within_bounds(spec: &ModelSpec, mut covariance: DMatrix<f64>) -> DMatrix<f64> {
    for (i, v) in spec.parameters().into_iter().enumerate() {
        let variable = spec.variable(v);
        let variance = (variable.max - variable.min).powi(2) / 12.0;
        let column = covariance.column(i).into_owned();
        if variance.is_finite() && column[i].is_finite() && column[i] > 0.0 {
            covariance -= &column * column.transpose() / (column[i] + variance);
        }
    }
    covariance
}

/// Nearer to a bound than this part of the range between them, or of the bound where there is one, a value is at it.
const AT_BOUND: f64 = 1e-3;

/// Parameters that stop at a bound of the text, each with it.
#[derive(Debug, Default, PartialEq)]
pub(super) struct AtBounds {
    /// The recording asks for values beyond the bound.
    pub(super) determined: Vec<String>,
    /// The recording alone says less of them than their bounds do.
    pub(super) undetermined: Vec<String>,
}

/// Parameters that stop at a bound. `values` and their covariance, without bounds, begin with those of the parameters.
pub(super) fn at_bounds(spec: &ModelSpec, values: &[f64], covariance: &DMatrix<f64>) -> AtBounds {
    let mut found = AtBounds::default();
    for (i, (v, &value)) in spec.parameters().into_iter().zip(values).enumerate() {
        let variable = spec.variable(v);
        let is_open = || variable.max - variable.min < covariance[(i, i)].sqrt();
        match said_at_bound(variable, value) {
            Some(said) if is_open() => found.undetermined.push(said),
            said => found.determined.extend(said),
        }
    }
    found
}

fn said_at_bound(variable: &Variable, value: f64) -> Option<String> {
    let range = variable.max - variable.min;
    let near = |bound: f64| {
        let size = if range.is_finite() {
            range
        } else {
            bound.abs()
        };
        bound.is_finite() && range > 0.0 && (value - bound).abs() <= AT_BOUND * size
    };
    let (word, bound) = [("min", variable.min), ("max", variable.max)]
        .into_iter()
        .find(|(_, bound)| near(*bound))?;
    let bound = number(bound);
    Some(format!("{} ({word} = {bound})", variable.column()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::parse;

    #[test]
    fn parameters_at_a_bound_are_listed() {
        let text = "model Cart
               parameter Real m(min=1, max=3) = 2; parameter Real d(min=0) = 1; parameter Real k = 1;
               input Real u; output Real y; Real v;
             equation m*der(v) = u - d*v - k; y = v; end Cart;";
        let spec = parse(text).unwrap();
        let mut covariance = DMatrix::identity(3, 3);
        let said = at_bounds(&spec, &[2.9999, 0.0, 5.0], &covariance);
        assert_eq!(said.determined, ["m (max = 3.000)", "d (min = 0)"]);
        let inside = at_bounds(&spec, &[2.0, 0.1, 5.0], &covariance);
        assert_eq!(inside, AtBounds::default());
        // The recording says less of the mass than its bounds, 2 apart.
        covariance[(0, 0)] = 9.0;
        let said = at_bounds(&spec, &[2.9999, 0.0, 5.0], &covariance);
        assert_eq!(said.undetermined, ["m (max = 3.000)"]);
        assert_eq!(said.determined, ["d (min = 0)"]);
    }

    #[test]
    fn bounds_are_observations_of_the_parameters() {
        let text = "model Cart
               parameter Real m(min=1, max=3) = 2; parameter Real d(min=0) = 1;
               input Real u; output Real y; Real v;
             equation m*der(v) = u - d*v; y = v; end Cart;";
        let spec = parse(text).unwrap();
        // Mass, damper and a number of an effect that is found by its ratio to the mass only.
        let covariance =
            DMatrix::from_row_slice(3, 3, &[9.0, 0.1, 4.4, 0.1, 0.5, 0.2, 4.4, 0.2, 2.2]);
        let found = within_bounds(&spec, covariance.clone());
        let mut information = covariance.clone().try_inverse().unwrap();
        information[(0, 0)] += 12.0 / 4.0;
        let expected = information.try_inverse().unwrap();
        assert!((&found - &expected).norm() < 1e-9, "{found} {expected}");
        assert!(found[(2, 2)] < 0.2 * covariance[(2, 2)]);
        // What is not determined at all stays so.
        let mut none = covariance;
        none.row_mut(2).fill(0.0);
        none.column_mut(2).fill(0.0);
        none[(2, 2)] = f64::INFINITY;
        assert_eq!(within_bounds(&spec, none)[(2, 2)], f64::INFINITY);
    }
}
