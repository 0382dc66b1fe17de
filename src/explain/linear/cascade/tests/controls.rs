//! Plants that are no tanks, and derivatives.

use super::super::*;
use super::{DRY, noisy, normals, staircase};
use crate::explain::linear::cascade::fit_cascade::{Problem, Trial};

/// Two real poles and an offset: the root is not needed, and where it is in use it loses against proportional outflow.
#[test]
fn a_linear_plant_is_better_left_linear() {
    for (seed, poles) in [[0.9, 0.95], [0.97, 0.5], [0.85, 0.85]]
        .into_iter()
        .enumerate()
    {
        let u = staircase(1000, 20, 10.0, seed as u64);
        let (mut x1, mut x2) = (2.0, 3.0);
        let mut y = Vec::with_capacity(u.len());
        for u in &u {
            y.push(x2 + 0.5);
            (x1, x2) = (
                poles[0] * x1 + (1.0 - poles[0]) * u,
                poles[1] * x2 + (1.0 - poles[1]) * x1,
            );
        }
        let fit = fit(
            &[(&u, &noisy(&y, 0.1, 50 + seed as u64))],
            &[vec![true; 1000]],
            f64::INFINITY,
        );
        assert!(fit.is_none_or(|f| f.losses.outflow < -20.0), "{poles:?}");
    }
}

#[test]
fn what_is_no_tank_is_left_alone() {
    let none =
        |u: &[f64], y: &[f64]| fit(&[(u, y)], &[vec![true; y.len()]], f64::INFINITY).is_none();
    let u = staircase(500, 20, 10.0, 3);
    let y = DRY.run(&u, [0.3, 0.4]);
    assert!(!none(&u, &noisy(&y, 0.05, 1)));
    // Its mean removed; fewer samples than can tell; an output of noise; a ringing one; an input about zero.
    assert!(none(&u, &y.iter().map(|y| y - 2.0).collect::<Vec<_>>()));
    assert!(none(&u[..80], &y[..80]));
    assert!(none(
        &u,
        &normals(500, 4).iter().map(|e| 5.0 + e).collect::<Vec<_>>()
    ));
    let mut ringing = vec![5.0, 5.0];
    for k in 2..500 {
        let next: f64 = 1.9 * ringing[k - 1] - 0.95 * ringing[k - 2] + 0.05 * u[k - 1];
        ringing.push(next);
    }
    assert!(none(
        &u,
        &ringing.iter().map(|y| y + 5.0).collect::<Vec<_>>()
    ));
    assert!(none(&normals(500, 5), &y));
    // A level that wanders by itself.
    let wander = normals(500, 6).into_iter().scan(0.0, |level, e| {
        *level = 0.97 * *level + 0.2 * e;
        Some(5.0 + *level)
    });
    assert!(none(&u, &wander.collect::<Vec<_>>()));
    assert!(
        none(&u, &vec![1.0; 500]) && none(&vec![0.0; 500], &y) && none(&u, &vec![f64::NAN; 500])
    );
    assert!(
        fit(&[], &[], f64::INFINITY).is_none() && fit(&[(&u, &y)], &[], f64::INFINITY).is_none()
    );
}

/// Gradients carried through the simulation against differences of the cost, with all parts acting.
#[test]
fn derivatives_match_differences() {
    for law in [Law::Root, Law::Linear] {
        let parts = Parts {
            law,
            upper_overflow: true,
            lower_overflow: true,
            constant_inflow: true,
            pump_bias: true,
        };
        let cascade = Cascade {
            parts,
            numbers: [0.3, 0.4, 0.5, 1.1, 0.4, 1.3, 0.07, 0.11],
        };
        let u = staircase(300, 20, 4.0, 6);
        let y: Vec<f64> = cascade
            .simulate(&u, [1.0, 2.0])
            .iter()
            .zip(normals(300, 8))
            .map(|(y, e)| y + e)
            .collect();
        let levels = cascade.levels(&u, [1.0, 2.0]);
        assert!(levels.iter().any(|x| x[0] == 1.1) && levels.iter().any(|x| x[1] == 1.3));
        let problem = Problem {
            records: vec![(u, y)],
            mask: vec![vec![true; 300]],
            count: 300,
        };
        let trial = problem.priced(Trial {
            cascade,
            initial: vec![[1.0, 2.0]],
            cost: 0.0,
        });
        let (_, pull) = problem.normal(&trial, &Number::ALL);
        let cost = |i: usize, h: f64| {
            let mut moved = trial.clone();
            match i {
                i if i < NUMBERS => moved.cascade.numbers[i] += h,
                i => moved.initial[0][i - NUMBERS] += h,
            }
            problem.priced(moved).cost
        };
        for i in 0..NUMBERS + 2 {
            let slope = (cost(i, 1e-6) - cost(i, -1e-6)) / 2e-6;
            let factor = Number::ALL.get(i).map_or(1.0, |n| {
                if n.positive() {
                    cascade.number(*n)
                } else {
                    1.0
                }
            });
            let carried = -2.0 * pull[i] / factor;
            assert!(
                (slope - carried).abs() < 1e-4 * (1.0 + slope.abs()),
                "{law:?} {i}: {slope} {carried}"
            );
        }
    }
}

/// Exchanged tanks are as slow as each other's place was, and the upper level keeps its distance from the rim in its
/// own measure; exchanged again they are what they were.
#[test]
fn tanks_are_exchanged_and_back() {
    for law in [Law::Root, Law::Linear] {
        let cascade = Cascade {
            parts: Parts {
                law,
                upper_overflow: true,
                lower_overflow: false,
                constant_inflow: false,
                pump_bias: false,
            },
            numbers: [0.05, 0.04, 0.08, 9.0, 0.4, 0.0, 0.0, 0.0],
        };
        let u: Vec<f64> = (0..400)
            .map(|k| 2.0 + 0.1 * (0.01 * f64::from(k)).sin())
            .collect();
        let y = cascade.simulate(&u, [6.0, 1.5]);
        let problem = Problem {
            records: vec![(u, y)],
            mask: vec![vec![true; 400]],
            count: 400,
        };
        let trial = problem.priced(Trial {
            cascade,
            initial: vec![[6.0, 1.5]],
            cost: 0.0,
        });
        let there = problem.exchanged(&trial);
        let [upper, lower] = problem.times(&trial);
        let [upper_there, lower_there] = problem.times(&there);
        assert!(upper / lower > 1.5 || lower / upper > 1.5);
        assert!((upper_there / lower - 1.0).abs() < 0.2, "{law:?}");
        assert!((lower_there / upper - 1.0).abs() < 0.2, "{law:?}");
        let share = |t: &Trial| t.initial[0][0] / t.cascade.number(Number::UpperRim);
        assert!((share(&there) / share(&trial) - 1.0).abs() < 1e-9);
        let back = problem.exchanged(&there);
        for number in Number::ALL {
            let (was, is) = (trial.cascade.number(number), back.cascade.number(number));
            assert!((is - was).abs() <= 0.2 * was.abs(), "{law:?} {number:?}");
        }
    }
}
