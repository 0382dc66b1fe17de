use nalgebra::DMatrix;
use rayon::prelude::*;

use super::fit_covariance::Certainty;
use super::*;
use crate::explain::linear::data::difference;
use crate::explain::linear::fixtures::{SAMPLES as N, effect, recorded, spring};
use crate::explain::linear::model::structure::Direction;

/// A mass on a spring that stiffens, all its numbers free.
fn structure() -> Structure {
    Structure {
        plant_free: true,
        ..spring(vec![effect("cubic_stiffness", "")])
    }
}

fn truth() -> Vec<f64> {
    let mut theta = structure().given();
    theta.push(1.5);
    theta
}

fn recording(seed: u64) -> Data {
    recorded(&structure(), &truth(), seed)
}

#[test]
fn slopes_are_those_of_central_differences() {
    let data = recording(1);
    let problem = Problem::new(&data);
    let structure = structure();
    let mut fit = Fit::at(&problem, structure.clone(), truth()).unwrap();
    for (i, slope) in fit.sensitivities(&problem).into_iter().enumerate() {
        let moved = |by: f64| {
            let mut theta = truth();
            theta[i] += by;
            structure.simulate(&theta, &data).unwrap()
        };
        let h = 1e-5;
        let central = difference(&moved(h), &moved(-h));
        let slope = slope.unwrap();
        let size = sum_of_squares(&slope[0]).sqrt();
        for (a, b) in slope[0].iter().zip(&central[0]) {
            assert!((a - b / (2.0 * h)).abs() < 2e-3 * size, "{i}: {a} {b}");
        }
    }
}

/// Estimates scatter about the truth as their stated covariance says, and their halves agree as often as they should.
#[test]
fn numbers_are_as_certain_as_is_said() {
    let runs = 60u32;
    let fits: Vec<(Vec<f64>, Certainty)> = (0..runs)
        .into_par_iter()
        .map(|seed| {
            let data = recording(100 + u64::from(seed));
            let problem = Problem::new(&data);
            // From a plant a little off, and no spring that stiffens.
            let mut start: Vec<f64> = truth().iter().map(|v| 1.02 * v).collect();
            *start.last_mut().unwrap() = 0.0;
            let mut fit = Fit::run(&problem, structure(), start, None, Effort::FINAL).unwrap();
            let certainty = fit.certainty(&problem).unwrap();
            (fit.theta, certainty)
        })
        .collect();
    for (i, truth) in truth().into_iter().enumerate() {
        let squares: f64 = fits
            .iter()
            .map(|(theta, certainty)| (theta[i] - truth).powi(2) / certainty.covariance[(i, i)])
            .sum();
        let apart: f64 = fits
            .iter()
            .map(|(_, c)| c.halves_disagree.as_ref().unwrap()[i].powi(2))
            .sum();
        // Chi-squared with 60 degrees of freedom: 0.2 of its mean is a standard deviation.
        for mean in [squares, apart].map(|sum| sum / f64::from(runs)) {
            assert!((0.4..1.7).contains(&mean), "number {i}: {mean}");
        }
    }
}

/// Dry friction sticks and slips, so that the outputs jump with its force; how certain that is is said nevertheless.
#[test]
fn dry_friction_is_as_certain_as_is_said() {
    const RUNS: u64 = 60;
    let mut structure = spring(vec![effect("coulomb_friction", "")]);
    structure.effects[0].direction = Direction::Free;
    // Through the speed, and hardly through the position.
    let truth = [0.002, 0.05];
    let squares: Vec<[f64; 2]> = (0..RUNS)
        .into_par_iter()
        .map(|seed| {
            let data = recorded(&structure, &truth, 500 + seed);
            let problem = Problem::new(&data);
            let start = vec![0.0, 0.04];
            let mut fit =
                Fit::run(&problem, structure.clone(), start, None, Effort::FINAL).unwrap();
            let covariance = fit.certainty(&problem).unwrap().covariance;
            [0, 1].map(|i| {
                assert!(covariance[(i, i)] > 0.0);
                (fit.theta[i] - truth[i]).powi(2) / covariance[(i, i)]
            })
        })
        .collect();
    for i in 0..2 {
        let mut each: Vec<f64> = squares.iter().map(|s| s[i]).collect();
        each.sort_by(f64::total_cmp);
        let within = each.iter().filter(|s| **s < 4.0).count();
        println!(
            "number {i}: {within} of {RUNS} within two deviations, median square {:.2}",
            each[30]
        );
        assert!(
            within >= 45,
            "number {i}: {within} of {RUNS} within two deviations"
        );
        assert!(
            (0.1..1.5).contains(&each[30]),
            "number {i}: median square {}",
            each[30]
        );
    }
}

#[test]
fn the_lesser_criterion_is_better() {
    let data = recording(3);
    let problem = Problem::new(&data);
    let count = problem.count();
    let right = Fit::at(&problem, structure(), truth()).unwrap();
    let mut worse_theta = truth();
    worse_theta[0] *= 0.9;
    let worse = Fit::at(&problem, structure(), worse_theta).unwrap();
    assert!(right.criterion(count) + 50.0 < worse.criterion(count));
    let mut kept = right.clone();
    kept.better_of(worse.clone(), count);
    assert_eq!(kept.theta, right.theta);
    let mut taken = worse;
    taken.better_of(right.clone(), count);
    assert_eq!(taken.theta, right.theta);
    // Schwarz: a number more costs the logarithm of the count.
    let more = Fit {
        free: right.free + 1,
        ..right.clone()
    };
    let cost = more.criterion(count) - right.criterion(count);
    assert!((cost - (count as f64).ln()).abs() < 1e-9);
}

#[test]
fn sizes_are_in_deviations_of_the_outputs() {
    let data = recording(4);
    let mut problem = Problem::new(&data);
    let scale = problem.scale[0];
    let half: Series = vec![vec![0.5 * scale; N]];
    assert!((problem.size(&half) - 0.5).abs() < 1e-12);
    assert!((problem.mean_square(&half) - 0.25).abs() < 1e-12);
    // Only what counts.
    let mut loud = half;
    loud[0][100..200].fill(1e3);
    problem.mask[0][100..200].fill(false);
    assert!((problem.mean_square(&loud) - 0.25).abs() < 1e-12);
    assert_eq!(problem.count(), N - 100);
}

#[test]
fn profiles_agree_with_slopes_where_all_is_smooth() {
    let data = recording(1);
    let problem = Problem::new(&data);
    let mut fit = Fit::run(&problem, structure(), truth(), None, Effort::FINAL).unwrap();
    let covariance = fit.certainty(&problem).unwrap().covariance;
    let all = 0..fit.theta.len();
    let mut kept = covariance.clone();
    fit.narrow(&problem, &mut kept, all.clone());
    assert_eq!(kept, covariance);
    for i in all {
        let std = covariance[(i, i)].sqrt();
        let reached = [-1.0, 1.0].map(|side| fit.reach(&problem, i, side, 4.0 * std).unwrap());
        let ratio = 0.5 * (reached[0] + reached[1]) / std;
        assert!((ratio - 1.0).abs() < 0.1, "number {i}: {ratio}");
        // As if slopes had said nothing: a hundred times as uncertain.
        let mut wide = covariance.clone();
        wide.row_mut(i).scale_mut(100.0);
        wide.column_mut(i).scale_mut(100.0);
        fit.narrow(&problem, &mut wide, i..i + 1);
        let ratio = wide[(i, i)].sqrt() / std;
        assert!((ratio - 1.0).abs() < 0.15, "number {i}: {ratio}");
        let j = (i + 1) % fit.theta.len();
        let correlation = |c: &DMatrix<f64>| c[(i, j)] / (c[(i, i)] * c[(j, j)]).sqrt();
        assert!((correlation(&wide) - correlation(&covariance)).abs() < 1e-9);
    }
}

/// Broyden's condition, and the least change: what is across the step keeps its derivative.
#[test]
fn updated_derivatives_foretell_the_step_that_was_made() {
    let data = recording(1);
    let problem = Problem::new(&data);
    let mut fit = Fit::at(&problem, structure(), truth()).unwrap();
    let noise = fit.noise.clone();
    let slopes = fit.sensitivities(&problem);
    let mut jacobian = Jacobian::new(&problem, &noise, &slopes).unwrap();
    let count = fit.theta.len();
    let step = DVector::from_fn(count, |i, _| 0.05 * truth()[i] * (1.0 + i as f64).sin());
    let ahead: Vec<f64> = truth()
        .iter()
        .zip(step.iter())
        .map(|(t, s)| t + s)
        .collect();
    let moved = structure().simulate(&ahead, &data).unwrap();
    let change = noise.whiten(&difference(&moved, &fit.simulated), &problem.mask);
    let change: Vec<f64> = change
        .iter()
        .zip(&problem.mask)
        .flat_map(|(e, mask)| e.iter().zip(mask))
        .filter(|(_, keep)| **keep)
        .map(|(e, _)| *e)
        .collect();
    let change = DVector::from_vec(change);
    let before = jacobian.columns().clone();
    let missed = (&before * &step - &change).norm();
    assert!(
        missed > 1e-3 * change.norm(),
        "the step is no test: {missed}"
    );
    jacobian.update(&problem, &noise, &step, &fit.simulated, &moved);
    let after = jacobian.columns();
    assert!((after * &step - &change).norm() < 1e-9 * change.norm());
    // Across, on the scale of the columns.
    let lengths = DVector::from_iterator(count, before.column_iter().map(|c| c.norm_squared()));
    let mut across = DVector::from_fn(count, |i, _| (2.0 + i as f64).cos() / lengths[i].sqrt());
    let along = across.component_mul(&lengths).dot(&step);
    across -= &step * (along / step.component_mul(&lengths).dot(&step));
    let kept = (after - before) * &across;
    assert!(kept.norm() < 1e-9 * change.norm());
}

/// A secant spans what a number is uncertain by, not its size: where the law is smooth it is the slope there.
#[test]
fn secants_of_a_smooth_law_are_its_slopes() {
    let data = recording(2);
    let problem = Problem::new(&data);
    let mut fit = Fit::at(&problem, structure(), truth()).unwrap();
    for (i, slope) in fit.sensitivities(&problem).into_iter().enumerate() {
        let (slope, secant) = (slope.unwrap(), fit.secant(&problem, i).unwrap());
        let apart = sum_of_squares(&difference(&secant, &slope)[0]).sqrt();
        let size = sum_of_squares(&slope[0]).sqrt();
        assert!(apart < 0.1 * size, "{i}: {}", apart / size);
    }
}
