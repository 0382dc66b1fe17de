//! Gradients against differences of the criterion, forms against each other, and the covariance against the polish.

use nalgebra::{DMatrix, DVector};

use super::*;
use crate::covariance::static_gain_std;
use crate::identify::{Options, Order, Polish, identify};
use crate::log::Log;
use crate::systems;

fn signals(log: &Log) -> Vec<Vec<f64>> {
    log.input_data
        .iter()
        .chain(&log.output_data)
        .cloned()
        .collect()
}

fn perturbed(system: &StateSpace, size: f64) -> StateSpace {
    let shift = |m: &DMatrix<f64>, seed: f64| {
        DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| {
            m[(i, j)] + size * (seed + 1.7 * i as f64 + 2.3 * j as f64).sin()
        })
    };
    StateSpace {
        a: shift(&system.a, 0.3),
        b: shift(&system.b, 1.1),
        c: shift(&system.c, 2.2),
        d: system.d.clone(),
        k: shift(&system.k, 0.7),
        sample_time: system.sample_time,
    }
}

#[test]
fn gradient_agrees_with_differences_of_the_criterion() {
    let two_by_two = systems::two_by_two();
    let armax = systems::knudsen_armax();
    let cases = [
        (
            two_by_two.record(300, 1),
            two_by_two.system,
            Form::Innovation,
            false,
        ),
        (armax.record(300, 2), armax.system.system, Form::Armax, true),
    ];
    for (log, system, form, feedthrough) in cases {
        let layout = ParameterLayout::of(&system, feedthrough);
        let signals = signals(&log);
        let start = form.start(&perturbed(&system, 0.01)).unwrap();
        let l = layout.outputs;
        let identity = DMatrix::identity(l, l);
        let (x0, _) = sensitivity::prediction_errors(&start, &signals, &identity).unwrap();
        let directions = form.directions(&start, &layout).unwrap();
        let factor =
            sensitivity::linearised_errors(&start, &layout, &directions, &signals, &x0, &identity)
                .unwrap();
        let coordinates = directions.ncols();
        let products = factor.transpose() * &factor;
        for p in 0..coordinates {
            let moved = |by: f64| {
                let mut step = vec![0.0; coordinates];
                step[p] = by;
                let system = form
                    .moved(&start, &layout, &directions, &step, &identity)
                    .unwrap();
                sensitivity::prediction_errors(&system, &signals, &identity)
                    .unwrap()
                    .1
                    .trace()
            };
            let numeric = (moved(1e-5) - moved(-1e-5)) / 4e-5;
            let exact = products[(p, coordinates)];
            let scale = (products[(p, p)] * products[(coordinates, coordinates)]).sqrt();
            assert!(
                (numeric - exact).abs() < 1e-5 * scale,
                "{form:?} {p}: {numeric} {exact}"
            );
        }
    }
}

#[test]
fn both_forms_end_at_the_same_model_from_any_start() {
    let example = systems::knudsen_armax();
    let log = example.record(1000, 4);
    let signals = signals(&log);
    let mut found = Vec::new();
    for form in [Form::Innovation, Form::Armax] {
        for size in [0.0, 0.02] {
            let start = perturbed(&example.system.system, size);
            let made = prediction_error_method(&start, &[&signals], true, form, STEPS).unwrap();
            let first = prediction_error_method(&start, &[&signals], true, form, 0).unwrap();
            assert!(made.converged && made.cost <= first.cost, "{form:?}");
            found.push((made.system.armax().unwrap().unwrap(), made.cost));
        }
    }
    for (armax, cost) in &found[1..] {
        assert!((cost - found[0].1).abs() < 1e-5);
        for (a, b) in armax.c.iter().zip(&found[0].0.c) {
            assert!((a - b).abs() < 1e-4, "{a} {b}");
        }
    }
}

/// The polish does the same with the vector ARX coefficients: static gains and their standard deviations agree.
#[test]
fn agrees_with_the_polish_of_a_long_record() {
    let example = systems::two_by_two();
    let log = example.record(4000, 6);
    let options = Options {
        order: Order::Fixed(3),
        polish: Polish::Always,
        ..Options::default()
    };
    let polished = identify(std::slice::from_ref(&log), &options).unwrap();
    let mut signals = signals(&log);
    for (column, level) in signals.iter_mut().zip(
        polished
            .inputs
            .iter()
            .chain(&polished.outputs)
            .map(|c| c.level),
    ) {
        for value in column {
            *value -= level;
        }
    }
    let start = perturbed(&example.system, 0.01);
    let made =
        prediction_error_method(&start, &[&signals], false, Form::Innovation, STEPS).unwrap();
    assert!(made.converged);
    // The static gains: the poles of this system are too close together for standard deviations of their own.
    let theirs = polished.covariance.as_ref().unwrap();
    let stds = [
        static_gain_std(&made.system, &made.covariance)
            .unwrap()
            .unwrap(),
        static_gain_std(&polished.system, theirs).unwrap().unwrap(),
    ];
    let gains = [
        made.system.static_gain().unwrap(),
        polished.system.static_gain().unwrap(),
    ];
    for i in 0..4 {
        let std = stds[1][i];
        assert!((gains[0][i] - gains[1][i]).abs() < 0.3 * std);
        assert!(
            (stds[0][i] / std - 1.0).abs() < 0.15,
            "{} {std}",
            stds[0][i]
        );
    }
    let lambda = polished.innovation_covariance.unwrap();
    assert!((&made.innovation_covariance - &lambda).amax() < 0.03 * lambda.amax());
}

#[test]
fn two_experiments_have_an_initial_state_each() {
    let example = systems::knudsen_armax();
    let (mut first, second) = (example.record(800, 7), example.record(800, 8));
    // The first starts far from rest.
    let free = example
        .system
        .system
        .simulate(
            &[&vec![0.0; 800]],
            Some(&DVector::from_row_slice(&[5.0, -3.0])),
        )
        .unwrap();
    for (y, extra) in first.output_data[0].iter_mut().zip(&free[0]) {
        *y += extra;
    }
    let (first, second) = (signals(&first), signals(&second));
    let start = &example.system.system;
    let both =
        prediction_error_method(start, &[&first, &second], true, Form::Armax, STEPS).unwrap();
    assert!(both.converged);
    let one = prediction_error_method(start, &[&second], true, Form::Armax, STEPS).unwrap();
    let std = |made: &PredictionErrorEstimate| made.armax.as_ref().unwrap().1[(0, 0)].sqrt();
    let ratio = std(&one) / std(&both);
    assert!(ratio > 1.2 && ratio < 1.8, "{ratio}");
    let error = both.armax.as_ref().unwrap().0.a[1] - example.armax.a[1];
    assert!(error.abs() < 4.0 * std(&both), "{error}");
}

#[test]
fn what_has_no_likelihood_or_no_form_is_an_error() {
    let example = systems::knudsen_armax();
    let silent = vec![vec![0.0; 100], vec![0.0; 100]];
    let start = &example.system.system;
    assert!(prediction_error_method(start, &[&silent], true, Form::Armax, 3).is_err());
    let two = systems::two_by_two();
    let signals = signals(&two.record(100, 1));
    let error =
        prediction_error_method(&two.system, &[&signals], false, Form::Armax, 3).unwrap_err();
    assert!(error.to_string().contains("one input and one output"));
}

/// The minimum of `|J d + r|^2 + (damping s_1)^2 |d|^2` over columns of unit size, by its normal equations.
#[test]
fn steps_are_damped_least_squares() {
    let unit = [1e-6, 1.0, 1e4];
    let jacobian = DMatrix::from_fn(9, 3, |i, j| {
        unit[j] * ((i * 3 + j * j + i * j) as f64).sin()
    });
    let residual = DVector::from_fn(9, |i, _| (i as f64).cos());
    let mut factor = jacobian.clone().insert_column(3, 0.0);
    factor.set_column(3, &residual);
    let found = Linearised::new(&qr_r(&factor), 3).unwrap();
    let scale: Vec<f64> = jacobian.column_iter().map(|c| c.norm()).collect();
    let even = DMatrix::from_fn(9, 3, |i, j| jacobian[(i, j)] / scale[j]);
    let gram = even.tr_mul(&even);
    let right = -even.tr_mul(&residual);
    let largest = gram.symmetric_eigenvalues().max();
    for damping in [0.0, 0.1, 3.0] {
        let damped = &gram + DMatrix::identity(3, 3) * (damping * damping * largest);
        let wanted = damped.cholesky().unwrap().solve(&right);
        for (i, step) in found.step(damping).into_iter().enumerate() {
            let wanted = wanted[i] / scale[i];
            assert!((step / wanted - 1.0).abs() < 1e-9, "{damping} {i}");
        }
    }
    let full = gram.cholesky().unwrap();
    assert!((found.decrease() - right.dot(&full.solve(&right))).abs() < 1e-10);
    let inverse = full.inverse();
    let covariance = found.covariance();
    for i in 0..3 {
        for j in 0..3 {
            let wanted = inverse[(i, j)] / (scale[i] * scale[j]);
            assert!((covariance[(i, j)] / wanted - 1.0).abs() < 1e-9);
        }
    }
}
