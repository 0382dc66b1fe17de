//! Identities, the literal form on a small problem, derivatives, noise-free data.

use nalgebra::DMatrix;

use super::*;
use crate::linalg::{cholesky_upper, spectral_radius};
use crate::log::Log;
use crate::moments::RFactor;
use crate::systems;

fn factor(log: &Log, window: usize) -> RFactor {
    RFactor::of_samples(&log.channel_data(), log.inputs.len(), window).unwrap()
}

/// The Toeplitz matrix of definition 3.
fn toeplitz(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    c: &DMatrix<f64>,
    d: &DMatrix<f64>,
    blocks: usize,
) -> DMatrix<f64> {
    let (l, m) = d.shape();
    let mut out = DMatrix::zeros(blocks * l, blocks * m);
    for column in 0..blocks {
        out.view_mut((column * l, column * m), (l, m)).copy_from(d);
        let mut state = b.clone();
        for row in column + 1..blocks {
            out.view_mut((row * l, column * m), (l, m))
                .copy_from(&(c * &state));
            state = a * state;
        }
    }
    out
}

fn population(system: &StateSpace, covariance: &DMatrix<f64>, blocks: usize) -> DMatrix<f64> {
    let l = system.outputs();
    let h = toeplitz(
        &system.a,
        &system.k,
        &system.c,
        &DMatrix::identity(l, l),
        blocks,
    );
    let noise = DMatrix::identity(blocks, blocks).kronecker(covariance);
    &h * noise * h.transpose()
}

#[test]
fn toeplitz_regressor_times_parameters_is_the_toeplitz_matrix() {
    let system = systems::two_by_two().system;
    let d = DMatrix::from_row_slice(2, 2, &[0.3, -0.1, 0.2, 0.5]);
    let observability = Observability::of(&system.a, &system.c, 5).unwrap();
    let stacked_parameters = {
        let mut m = DMatrix::zeros(5, 2);
        m.rows_mut(0, 2).copy_from(&d);
        m.rows_mut(2, 3).copy_from(&system.b);
        m
    };
    let h = toeplitz(&system.a, &system.b, &system.c, &d, 5);
    let left = observability.toeplitz_regressor(&system.a, &system.c) * stacked_parameters;
    assert!((left - observability.stacked(&h, 2)).amax() < 1e-13);
    assert!((observability.complement.transpose() * &observability.gamma).amax() < 1e-13);
}

#[test]
fn both_steps_return_the_truth_from_the_population() {
    for example in [systems::two_by_two(), systems::van_wingerden_one()] {
        let mut system = example.system;
        // The identity needs no stable predictor, the covariance only needs to be what it is.
        system.d.fill(0.0);
        let blocks = 5;
        let rows = blocks * 2;
        let log = systems::two_by_two().record(200, 1);
        let mut regression = Regression::new(&factor(&log, 2 + blocks - 1), 2).unwrap();
        assert_eq!(regression.residual_covariance.shape(), (rows, rows));
        regression.residual_covariance =
            population(&system, &example.innovation_covariance, blocks);
        let observability = Observability::of(&system.a, &system.c, blocks).unwrap();
        for step in [ResidualStep::FirstColumn, ResidualStep::Cholesky] {
            let noise =
                stochastic(&regression, &observability, &system.a, &system.c, step).unwrap();
            assert!((noise.k - &system.k).amax() < 1e-10, "{step:?}");
            let error = noise.innovation_covariance - &example.innovation_covariance;
            assert!(error.amax() < 1e-10, "{step:?}");
        }
    }
}

/// Knudsen's formulas with matrices as long as the recording, stacked as printed.
#[test]
fn agrees_with_the_literal_form() {
    let log = systems::two_by_two().record(240, 5);
    let (past, future, n) = (4, 4, 3);
    let (m, l) = (2, 2);
    let columns = 240 - past - future + 1;
    let hankel = |channels: &[Vec<f64>], from: usize, blocks: usize| {
        let width = channels.len();
        DMatrix::from_fn(blocks * width, columns, |row, k| {
            channels[row % width][from + row / width + k]
        })
    };
    let (yp, up) = (
        hankel(&log.output_data, 0, past),
        hankel(&log.input_data, 0, past),
    );
    let (yf, uf) = (
        hankel(&log.output_data, past, future),
        hankel(&log.input_data, past, future),
    );
    let stack = |parts: &[&DMatrix<f64>]| {
        let rows: Vec<_> = parts.iter().flat_map(|p| p.row_iter()).collect();
        DMatrix::from_rows(&rows)
    };
    let wp = stack(&[&yp, &up]);
    let z = stack(&[&wp, &uf]);
    let inverse = (&z * z.transpose()).try_inverse().unwrap();
    let theta = &yf * z.transpose() * inverse;
    let residual = &yf - &theta * &z;
    let p = &residual * residual.transpose() / (columns - z.nrows()) as f64;
    let theta_p = theta.columns(0, wp.nrows()).into_owned();
    let theta_f = theta.columns(wp.nrows(), future * m).into_owned();
    let root = cholesky_upper(&(&wp * wp.transpose())).unwrap().transpose();
    let svd = (theta_p * root).svd(true, false);
    let u = svd.u.unwrap();
    let gamma = u.columns(0, n).into_owned();
    let perp = u.columns(n, future * l - n).into_owned();
    let c = gamma.rows(0, l).into_owned();
    let rows = (future - 1) * l;
    let upper = gamma.rows(0, rows).into_owned();
    let a = upper.clone().pseudo_inverse(1e-12).unwrap() * gamma.rows(l, rows);
    // Least squares over vec of the unknowns, one column of the regressor for each entry.
    let solve = |target: &DMatrix<f64>, width: usize, free: &dyn Fn(usize, usize) -> bool| {
        let mut entries = Vec::new();
        let mut regressors = Vec::new();
        for column in 0..width {
            for row in 0..l + n {
                if row < l && !free(row, column) {
                    continue;
                }
                let (mut d, mut b) = (DMatrix::zeros(l, width), DMatrix::zeros(n, width));
                if row < l {
                    d[(row, column)] = 1.0;
                } else {
                    b[(row - l, column)] = 1.0;
                }
                let h = perp.transpose() * toeplitz(&a, &b, &c, &d, future);
                regressors.push(nalgebra::DVector::from_column_slice(h.as_slice()));
                entries.push((row, column));
            }
        }
        let right = perp.transpose() * target;
        let solution = DMatrix::from_columns(&regressors)
            .pseudo_inverse(1e-12)
            .unwrap()
            * nalgebra::DVector::from_column_slice(right.as_slice());
        let mut out = DMatrix::zeros(l + n, width);
        for (value, (row, column)) in solution.iter().zip(entries) {
            out[(row, column)] = *value;
        }
        out
    };
    let db = solve(&theta_f, m, &|_, _| true);
    let lower = cholesky_upper(&p).unwrap().transpose();
    let gm = solve(&lower, l, &|row, column| row >= column);
    let g = gm.rows(0, l).into_owned();
    let k_cholesky = gm.rows(l, n) * g.clone().try_inverse().unwrap();
    let r_first = p.view((0, 0), (l, l)).into_owned();
    let k_first = upper.pseudo_inverse(1e-12).unwrap()
        * p.view((l, 0), (rows, l))
        * r_first.clone().try_inverse().unwrap();

    let regression = Regression::new(&factor(&log, past + future - 1), past).unwrap();
    let decomposition = Decomposition::new(&regression).unwrap();
    let expected = [
        (ResidualStep::FirstColumn, k_first, r_first),
        (ResidualStep::Cholesky, k_cholesky, &g * g.transpose()),
    ];
    for (step, k, r) in expected {
        let found = knudsen(&regression, &decomposition, n, true, step, 2.0).unwrap();
        let d = db.rows(0, l).into_owned();
        assert!((&found.system.d - d).amax() < 1e-9);
        assert!((&found.innovation_covariance - r).amax() < 1e-9);
        let mut power = DMatrix::identity(n, n);
        let mut found_power = DMatrix::identity(n, n);
        for _ in 0..6 {
            let b = db.rows(l, n).into_owned();
            let markov = [
                (
                    &c * &power * b,
                    &found.system.c * &found_power * &found.system.b,
                ),
                (
                    &c * &power * &k,
                    &found.system.c * &found_power * &found.system.k,
                ),
            ];
            for (literal, ours) in markov {
                assert!((literal - ours).amax() < 1e-9, "{step:?}");
            }
            power = &a * power;
            found_power = &found.system.a * found_power;
        }
    }
}

/// Central differences of the whole estimate, decomposition and all, in quantities that do not depend on the basis.
#[test]
fn jacobian_agrees_with_finite_differences() {
    let log = systems::two_by_two().record(400, 2);
    let (past, future, n) = (3, 4, 3);
    let regression = Regression::new(&factor(&log, past + future - 1), past).unwrap();
    let decomposition = Decomposition::new(&regression).unwrap();
    for step in [ResidualStep::FirstColumn, ResidualStep::Cholesky] {
        for feedthrough in [true, false] {
            let estimate = |r: &Regression| {
                let d = Decomposition::new(r).unwrap();
                let made = knudsen(r, &d, n, feedthrough, step, 1.0).unwrap();
                assert_eq!(made.system.k, made.raw_noise.k);
                made
            };
            let base = estimate(&regression);
            let jacobian = jacobian(
                &regression,
                &decomposition,
                &base.deterministic,
                &base.raw_noise,
                step,
                feedthrough,
            )
            .unwrap();
            let layout = jacobian.layout;
            let invariants = |system: &StateSpace, r: &DMatrix<f64>| {
                let mut out = vec![r[(0, 0)], r[(1, 0)], r[(1, 1)], system.d[(1, 0)]];
                let mut power = DMatrix::identity(n, n);
                for _ in 0..3 {
                    out.extend((&system.c * &power * &system.b).iter());
                    out.extend((&system.c * &power * &system.k).iter());
                    power = &system.a * power;
                }
                out
            };
            let check = |change: &dyn Fn(&mut Regression, f64), row: &[f64], what: &str| {
                let moved = |by: f64| {
                    let mut r = regression.clone();
                    change(&mut r, by);
                    let e = estimate(&r);
                    invariants(&e.system, &e.innovation_covariance)
                };
                let size = 1e-5;
                let (up, down) = (moved(size), moved(-size));
                // The same step along the Jacobian.
                let along = |by: f64| {
                    let theta: Vec<f64> = layout
                        .pack(&base.system)
                        .iter()
                        .zip(row)
                        .map(|(t, j)| t + by * j)
                        .collect();
                    let mut r = base.innovation_covariance.clone();
                    let tail = &row[layout.len()..];
                    for (entry, j) in [(0, 0), (1, 0), (1, 1)].iter().zip(tail) {
                        r[*entry] += by * j;
                    }
                    invariants(&layout.unpack(&theta, &base.system), &r)
                };
                let (linear_up, linear_down) = (along(size), along(-size));
                let scale = invariants(&base.system, &base.innovation_covariance)
                    .iter()
                    .fold(0.0_f64, |a, b| a.max(b.abs()));
                for i in 0..up.len() {
                    let numeric = (up[i] - down[i]) / (2.0 * size);
                    let linear = (linear_up[i] - linear_down[i]) / (2.0 * size);
                    assert!(
                        (numeric - linear).abs() < 1e-5 * (scale + linear.abs()),
                        "{step:?} {what} {i}: {numeric} {linear}"
                    );
                }
            };
            let rows = future * 2;
            for (a, b) in [(0, 0), (3, 5), (7, 11), (2, 13), (5, 19), (6, 15)] {
                let row: Vec<f64> = jacobian
                    .of_coefficients
                    .column(a + rows * b)
                    .iter()
                    .copied()
                    .collect();
                let change = |r: &mut Regression, by: f64| r.coefficients[(a, b)] += by;
                check(&change, &row, "Theta");
            }
            for (a, b) in [(0, 0), (1, 0), (5, 2), (7, 7)] {
                let weight = if a == b { 1.0 } else { 2.0 };
                let row: Vec<f64> = jacobian
                    .of_covariance
                    .column(a + rows * b)
                    .iter()
                    .map(|v| v * weight)
                    .collect();
                let change = |r: &mut Regression, by: f64| {
                    r.residual_covariance[(a, b)] += by;
                    if a != b {
                        r.residual_covariance[(b, a)] += by;
                    }
                };
                check(&change, &row, "P");
            }
        }
    }
}

#[test]
fn a_predictor_outside_the_circle_is_mirrored() {
    let (a, c) = (DMatrix::from_element(1, 1, 0.5), DMatrix::identity(1, 1));
    let noise = NoiseModel {
        k: DMatrix::from_element(1, 1, 2.5),
        innovation_covariance: DMatrix::from_element(1, 1, 3.0),
    };
    let (found, mirrored) = minimum_phase(&a, &c, noise);
    // The zero at -2 moves to -1/2, the variance grows by four.
    assert!(mirrored);
    assert!((found.k[(0, 0)] - 1.0).abs() < 1e-12);
    assert!((found.innovation_covariance[(0, 0)] - 12.0).abs() < 1e-12);
    let (again, mirrored) = minimum_phase(&a, &c, found.clone());
    assert_eq!((again, mirrored), (found, false));
}

#[test]
fn without_noise_the_model_is_exact_and_has_none() {
    let mut example = systems::knudsen_bj();
    example.system.innovation_covariance.fill(0.0);
    let log = example.record(400, 1);
    let regression = Regression::new(
        &RFactor::from_panels(qr_of(&log, 9), 400 - 9, 1, &[1.0, 1.0]),
        4,
    )
    .unwrap();
    let decomposition = Decomposition::new(&regression).unwrap();
    // Without noise only the part that the input reaches shows: F, of second order.
    let found = knudsen(
        &regression,
        &decomposition,
        2,
        true,
        ResidualStep::Cholesky,
        1.0,
    )
    .unwrap();
    assert_eq!(found.innovation_covariance[(0, 0)], 0.0);
    assert!(found.system.k.amax() == 0.0);
    let truth = example.system.system.impulse_response(8);
    for (t, f) in truth.iter().zip(found.system.impulse_response(8)) {
        assert!((t - f).amax() < 1e-7);
    }
    assert!(spectral_radius(&found.system.a).unwrap() < 1.0);
}

fn qr_of(log: &Log, window: usize) -> DMatrix<f64> {
    let rows = log.samples() - window;
    let stacked = DMatrix::from_fn(rows, 2 * (window + 1), |k, column| {
        if column % 2 == 0 {
            log.input_data[0][k + column / 2]
        } else {
            log.output_data[0][k + column / 2]
        }
    });
    crate::linalg::qr_r(&stacked)
}

#[test]
fn orders_and_windows_that_do_not_fit_say_what_would() {
    let log = systems::knudsen_armax().record(300, 1);
    let data = factor(&log, 6);
    let regression = Regression::new(&data, 3).unwrap();
    let decomposition = Decomposition::new(&regression).unwrap();
    let error = decomposition.observability(4).unwrap_err();
    assert!(
        error.to_string().contains("the largest order here is 3"),
        "{error}"
    );
    assert!(Regression::new(&data, 7).is_err());
    let short = systems::knudsen_armax().record(24, 1);
    let error = Regression::new(&factor_of_short(&short, 8), 4).unwrap_err();
    assert!(error.to_string().contains("too short"), "{error}");
}

fn factor_of_short(log: &Log, window: usize) -> RFactor {
    let r = qr_of(log, window);
    RFactor::from_panels(r.resize(18, 18, 0.0), 16, 1, &[1.0, 1.0])
}
