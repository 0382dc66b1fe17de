use std::sync::Arc;

use super::*;
use crate::explain::linear::fixtures::{self, SAMPLE_TIME, SAMPLES, effect, recorded, spring};
use crate::explain::linear::model::coordinates::Coordinates;
use crate::explain::linear::model::linear_plant::Plant;
use crate::explain::linear::model::structure::{Instance, Structure};
use crate::explain::linear::search::penalties::pulls;

/// Seconds of a recording.
const LENGTH: f64 = SAMPLES as f64 * SAMPLE_TIME;

/// What `structure` at `theta` is said to be of a recording of the bare plant.
fn with<T>(structure: Structure, theta: &[f64], of: impl Fn(&Problem, &Fit) -> T) -> T {
    let data = recorded(&spring(Vec::new()), &[], 1);
    let problem = Problem::new(&data);
    let fit = Fit::at(&problem, structure, theta.to_vec()).unwrap();
    of(&problem, &fit)
}

fn is_sane(effect: Instance, theta: &[f64]) -> bool {
    with(spring(vec![effect]), theta, sane)
}

/// Quantile of the motion of the bare plant.
fn motion(q: f64) -> f64 {
    with(spring(Vec::new()), &[], |_, fit| {
        effects::level(&fit.simulated[0], q, |v| v)
    })
}

/// Speed that is not often exceeded.
fn speed() -> f64 {
    with(
        spring(vec![effect("quadratic_drag", "")]),
        &[0.0],
        |problem, fit| speed_scale(problem, fit, 0),
    )
}

#[test]
fn thresholds_are_visited_from_both_sides() {
    // The input has a deviation of 2.
    for (limit, sane) in [(1e-6, false), (1.0, true), (4.0, true), (60.0, false)] {
        for id in ["input_saturation", "input_dead_zone"] {
            let found = is_sane(effect(id, ""), &[f64::ln(limit)]);
            // The dead zone calls it a width.
            assert_eq!(found, sane, "{id} {limit}");
        }
        let upper = effect("input_saturation", "upper");
        let share_above = if limit < 1.0 { 0.5 } else { 0.0 };
        assert_eq!(
            is_sane(upper, &[limit]),
            sane || share_above > 0.0,
            "{limit}"
        );
    }
    // A stop that is hardly felt: reached now and then, never, and leant on.
    let stop = |variant: &str, q: f64, by: f64| {
        is_sane(effect("end_stop", variant), &[1e-9, motion(q) + by])
    };
    assert!(stop("upper", 0.9, 0.0) && stop("lower", 0.1, 0.0));
    assert!(!stop("upper", 1.0, 1.0) && !stop("lower", 0.0, -1.0));
    assert!(!stop("upper", 0.3, 0.0) && !stop("lower", 0.7, 0.0));
    // A sensor that cuts off shows less than the motion.
    let cut = |limit: f64| is_sane(effect("sensor_saturation", ""), &[limit.ln()]);
    assert!(cut(motion(0.9)) && !cut(2.0 * motion(1.0)));
}

#[test]
fn changes_and_waves_take_place_in_the_recording() {
    for (share, sane) in [
        (0.01, false),
        (0.03, true),
        (0.97, true),
        (0.99, false),
        (-1.0, false),
    ] {
        let from = share * LENGTH;
        assert_eq!(
            is_sane(effect("gain_change", ""), &[0.1, from]),
            sane,
            "{share}"
        );
        assert_eq!(
            is_sane(effect("load_step", ""), &[0.1, from]),
            sane,
            "{share}"
        );
    }
    for (periods, sane) in [(1.9, false), (2.1, true)] {
        let theta = [f64::ln(periods / LENGTH), 0.1, 0.1];
        assert_eq!(
            is_sane(effect("periodic_disturbance", ""), &theta),
            sane,
            "{periods}"
        );
    }
    let range = motion(1.0) - motion(0.0);
    for (periods, sane) in [(1.9, false), (2.1, true)] {
        let theta = [1e-9, f64::ln(range / periods), 0.0];
        assert_eq!(is_sane(effect("cogging", ""), &theta), sane, "{periods}");
    }
    for (damping, sane) in [(0.05, true), (0.7, true), (0.72, false)] {
        let theta = [0.0, f64::ln(damping), 0.1, 0.1];
        assert_eq!(is_sane(effect("extra_mode", ""), &theta), sane, "{damping}");
    }
}

#[test]
fn friction_dissipates_and_breaks_away() {
    assert!(is_sane(effect("coulomb_friction", ""), &[0.01]));
    assert!(!is_sane(effect("coulomb_friction", ""), &[-0.01]));
    // A stiffness may have either sign.
    assert!(is_sane(effect("cubic_stiffness", ""), &[-0.01]));
    let stribeck = |excess: f64, share: f64| {
        let theta = [1e-3, f64::ln(excess), f64::ln(share * speed())];
        is_sane(effect("stribeck_friction", ""), &theta)
    };
    assert!(stribeck(0.5, 0.2) && stribeck(0.11, 1.4));
    assert!(!stribeck(0.09, 0.2) && !stribeck(0.5, 1.6));
    let amplitude = effects::level(
        &with(spring(Vec::new()), &[], |_, fit| fit.simulated[0].clone()),
        0.95,
        f64::abs,
    );
    let bristles = |share: f64| {
        is_sane(
            effect("coulomb_friction", "presliding"),
            &[1e-6, f64::ln(share * amplitude)],
        )
    };
    assert!(bristles(0.45) && !bristles(0.55));
    for (force, against) in [(0.1, false), (-0.1, true)] {
        let found = with(
            spring(vec![effect("hysteresis", "")]),
            &[force, 0.0, 0.5],
            |_, fit| pulls(fit, 0),
        );
        assert_eq!(found, against);
    }
}

#[test]
fn another_gain_for_each_sign_needs_more_than_two_levels() {
    let mut data = recorded(&spring(Vec::new()), &[], 1);
    let asymmetric = |data: &crate::explain::linear::data::Data| {
        let problem = Problem::new(data);
        let fit = Fit::at(
            &problem,
            spring(vec![effect("input_asymmetry", "")]),
            vec![0.1],
        )
        .unwrap();
        sane(&problem, &fit)
    };
    assert!(asymmetric(&data));
    for u in &mut data.segments[0].inputs[0] {
        *u = 2.0 * u.signum();
    }
    assert!(!asymmetric(&data));
}

#[test]
fn travel_and_speed_are_those_of_the_signal() {
    let drag = |signal: Signal| {
        spring(vec![Instance {
            signal,
            ..effect("quadratic_drag", "")
        }])
    };
    let of = |signal: Signal| {
        with(drag(signal), &[0.0], |problem, fit| {
            (
                travel(problem, fit, 0),
                speed_scale(problem, fit, 0),
                fit.simulated[0].clone(),
            )
        })
    };
    let (position, rate, y) = of(Signal::Output(0));
    assert_eq!(position, effects::level(&y, 0.95, f64::abs));
    let slopes: Vec<f64> = y.windows(2).map(|p| (p[1] - p[0]) / SAMPLE_TIME).collect();
    assert_eq!(rate, effects::level(&slopes, 0.8, f64::abs));
    // An output that is the speed.
    let (position, rate, y) = of(Signal::Integral(0));
    assert_eq!(rate, effects::level(&y, 0.8, f64::abs));
    let mut sum = 0.0;
    let integral: Vec<f64> = y
        .iter()
        .map(|v| {
            sum += SAMPLE_TIME * v;
            sum
        })
        .collect();
    assert!((position - effects::level(&integral, 0.95, f64::abs)).abs() < 1e-12 * position);
}

/// 9.49 is the 95 % point of chi-squared with four degrees of freedom, 18.47 the 99.9 % point.
#[test]
fn other_parameters_must_not_do_significantly_better() {
    with(
        spring(vec![effect("cubic_stiffness", "")]),
        &[0.1],
        |problem, fit| {
            let mut free = fit.clone();
            free.structure.plant_free = true;
            free.free = fit.free + 4;
            let ranked = |fit: &Fit| Ranked {
                criterion: 0.0,
                fit: fit.clone(),
            };
            for (better, reached, stays) in [
                (9.3, true, true),
                (9.7, false, true),
                (18.3, false, true),
                (18.7, false, false),
            ] {
                free.deviance = fit.deviance - better;
                assert_eq!(reaches(fit, &free, false), reached, "{better}");
                assert_eq!(
                    plant_may_stay(problem, &ranked(fit), &[ranked(&free)], None),
                    stays,
                    "{better}"
                );
                assert!(plant_may_stay(
                    problem,
                    &ranked(&free),
                    &[ranked(fit)],
                    None
                ));
            }
            // The same effect at another place says nothing of this one.
            free.structure.effects[0].channel = 1;
            assert!(plant_may_stay(
                problem,
                &ranked(fit),
                &[ranked(&free)],
                None
            ));
        },
    );
}

/// Two outputs, two recordings of which the second moves three times as far.
#[test]
fn travel_is_that_of_all_recordings() {
    let plant = Plant {
        outputs: 2,
        c: vec![1.0, 0.0, 0.2, 0.9],
        d: vec![0.0; 2],
        ..fixtures::plant()
    };
    let mut data = recorded(&spring(Vec::new()), &[], 1);
    data.outputs = 2;
    data.segments[0].outputs = vec![vec![0.0; SAMPLES]; 2];
    let mut further = data.segments[0].clone();
    further.inputs[0].iter_mut().for_each(|u| *u *= 3.0);
    data.segments.push(further);
    for (signal, of) in [
        (Signal::Output(1), [0.0, 1.0]),
        (Signal::Difference(0, 1), [1.0, -1.0]),
    ] {
        let structure = Structure {
            coordinates: Arc::new(Coordinates::new(&plant)),
            initial: vec![vec![0.0; 2]; 2],
            ..spring(vec![Instance {
                signal,
                ..effect("cubic_stiffness", "")
            }])
        };
        let problem = Problem::new(&data);
        let fit = Fit::at(&problem, structure, vec![0.0]).unwrap();
        let y = &fit.simulated;
        let position: Vec<f64> = (0..2)
            .flat_map(|s| (0..SAMPLES).map(move |k| of[0] * y[2 * s][k] + of[1] * y[2 * s + 1][k]))
            .collect();
        let found = travel(&problem, &fit, 0);
        assert_eq!(found, effects::level(&position, 0.95, f64::abs));
        // What the first alone shows is less.
        let first = effects::level(&position[..SAMPLES], 0.95, f64::abs);
        assert!(first < 0.8 * found, "{first} {found}");
    }
}
