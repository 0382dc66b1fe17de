//! Which sign the terms beta of Appendix B have, by a check along one path: no statistics, only first order.

use nalgebra::{DMatrix, DVector};

use super::estimation_run::{Failure, Setting, Subspace};
use crate::identify::predictor_coefficients;
use crate::identify::variance::jacobian_with_sign;
use crate::model::StateSpace;
use crate::systems::TestSystem;

/// The share of the parameters' error that is not explained by the error of the vector ARX coefficients, with the
/// terms beta positive and, as printed, negative: `|dtheta - J vec M| / |dtheta|`.
///
/// The truth is taken into the basis of the estimate by `T = S Gamma`, (18) and (29), so that the error of the
/// parameters is known exactly.
pub(super) fn unexplained(
    plant: &TestSystem,
    setting: &Setting,
    seed: u64,
) -> Result<[f64; 2], Failure> {
    let log = plant.record(setting.samples, seed);
    let subspace = Subspace::new(&log, setting)?;
    let error_of_varx =
        &subspace.varx.coefficients - predictor_coefficients(&plant.system, setting.past, false);
    let truth = plant
        .system
        .transformed(&basis(
            &plant.system,
            &subspace.estimate.state_map,
            setting.future,
        ))
        .map_err(|e| e.to_string())?;
    let moved = |sign: f64| {
        let (layout, jacobian) = jacobian_with_sign(&subspace.estimate, &subspace.varx, sign);
        let pack = |system: &StateSpace| DVector::from_vec(layout.pack(system));
        let error = pack(&subspace.estimate.system) - pack(&truth);
        let explained = jacobian * DVector::from_column_slice(error_of_varx.as_slice());
        (&error - explained).norm() / error.norm()
    };
    Ok([moved(1.0), moved(-1.0)])
}

/// `S Gamma`, with the observability matrix (18) of the predictor.
fn basis(system: &StateSpace, state_map: &DMatrix<f64>, future: usize) -> DMatrix<f64> {
    let predictor = system.predictor_matrix();
    let outputs = system.outputs();
    let mut gamma = DMatrix::zeros(future * outputs, system.states());
    let mut block = system.c.clone();
    for i in 0..future {
        gamma.rows_mut(i * outputs, outputs).copy_from(&block);
        block = &block * &predictor;
    }
    state_map * gamma
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::systems::van_wingerden_one;

    #[test]
    fn plus_is_right_and_the_rest_is_of_second_order() {
        let plant = van_wingerden_one();
        let at = |samples: usize| {
            let setting = Setting {
                samples,
                past: 20,
                future: 20,
                order: 4,
            };
            unexplained(&plant, &setting, 9).unwrap()
        };
        let (short, long) = (at(2000), at(200_000));
        assert!(short[0] < 0.2 && long[0] < 0.03, "{short:?} {long:?}");
        assert!(long[1] > 10.0 * long[0], "{long:?}");
    }
}
