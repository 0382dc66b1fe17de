//! What the bounds of a text add to a covariance.

use nalgebra::DMatrix;

use crate::explain::document::sentences::number;
use crate::physics::ModelSpec;

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

/// Parameters that stop at a bound of the text, each with it. `values` begins with those of the parameters.
pub(super) fn at_bounds(spec: &ModelSpec, values: &[f64]) -> Vec<String> {
    let parameters = spec.parameters().into_iter().zip(values);
    parameters
        .filter_map(|(v, &value)| {
            let variable = spec.variable(v);
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
        })
        .collect()
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
        let said = at_bounds(&spec, &[2.9999, 0.0, 5.0]);
        assert_eq!(said, ["m (max = 3.000)", "d (min = 0)"]);
        assert!(at_bounds(&spec, &[2.0, 0.1, 5.0]).is_empty());
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
