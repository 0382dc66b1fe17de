//! Drives whose equation of motion is integrated in small steps, asked for that equation.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rayon::prelude::*;

use super::equation_of_motion::Equation;
use super::equation_proof::halves;
use super::force_adequacy::adequacy;
use super::laws::Form;
use super::windows::{Reading, Windows};
use crate::explain::linear::data::{Data, Segment};
use crate::explain::linear::model::structure::Structure;
use crate::explain::linear::screening::output_adequacy::Adequacy;

const STEP: f64 = 0.01;
const SAMPLES: usize = 4000;
const MASS: f64 = 0.4;
const VISCOUS: f64 = 1.1;
const CONSTANT: f64 = 0.3;
const SPRING: f64 = 6.0;

/// A mass that is pushed, and what resists it: `law(x, v)`.
fn drive(
    reading: Reading,
    spring: f64,
    law: impl Fn(f64, f64) -> f64,
    noise: f64,
    seed: u64,
) -> Data {
    const FINE: usize = 20;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || -> f64 { random.sample(StandardNormal) };
    let (mut x, mut v, mut push) = (0.0, 0.0, 0.0);
    let (mut input, mut output) = (Vec::new(), Vec::new());
    for _ in 0..SAMPLES {
        push = 0.95 * push + normal();
        input.push(push);
        let seen = match reading {
            Reading::Position => x,
            Reading::Velocity => v,
        };
        output.push(seen + noise * normal());
        let h = STEP / FINE as f64;
        let acceleration =
            |x: f64, v: f64| (push - VISCOUS * v - CONSTANT - spring * x - law(x, v)) / MASS;
        for _ in 0..FINE {
            // Heun's step.
            let a = acceleration(x, v);
            let b = acceleration(x + h * v, v + h * a);
            x += h * (v + 0.5 * h * a);
            v += 0.5 * h * (a + b);
        }
    }
    Data {
        segments: vec![Segment {
            inputs: vec![input, vec![1.0; SAMPLES]],
            outputs: vec![output],
            start_time: 2.0,
        }],
        sample_time: STEP,
        inputs: 2,
        outputs: 1,
        constant: true,
    }
}

/// Noise of the sensor that is more than what sampling leaves.
const NOISY: [(Reading, f64); 2] = [(Reading::Position, 2e-4), (Reading::Velocity, 2e-2)];

/// A spring, where the position is measured.
fn spring(reading: Reading) -> f64 {
    match reading {
        Reading::Position => SPRING,
        Reading::Velocity => 0.0,
    }
}

/// Coefficients of the equation before that of a law.
fn truth(reading: Reading) -> Vec<f64> {
    let mut numbers = vec![MASS, VISCOUS, CONSTANT];
    numbers.extend((reading == Reading::Position).then_some(SPRING));
    numbers
}

/// An equation with the law of this name, without shape, and a spring if the position is measured.
fn equation(reading: Reading, law: &str) -> Equation {
    let form = |id: &str| {
        Form::all(reading, &|d| d.id == id)
            .into_iter()
            .next()
            .map(|form| (form, 0.0))
    };
    Equation {
        reading,
        spring: reading == Reading::Position,
        laws: form(law).into_iter().collect(),
    }
}

#[test]
fn an_equation_that_is_made_a_plant_moves_as_it_says() {
    let size = 0.7;
    let position = drive(Reading::Position, SPRING, |x, _| size * x.powi(3), 0.0, 1);
    let velocity = drive(Reading::Velocity, 0.0, |_, v| size * v * v.abs(), 0.0, 2);
    for (data, reading, law) in [
        (&position, Reading::Position, "cubic_stiffness"),
        (&velocity, Reading::Velocity, "quadratic_drag"),
    ] {
        let mut numbers = truth(reading);
        numbers.push(size);
        let (structure, theta) = equation(reading, law)
            .structure(&numbers, &[[0.0, 0.0]], STEP)
            .unwrap();
        // A law is held over a step.
        let structure = Structure {
            substeps: 8,
            ..structure
        };
        let simulated = structure.simulate(&theta, data).unwrap();
        let recorded = &data.segments[0].outputs[0];
        let scale = recorded.iter().fold(0.0_f64, |most, y| most.max(y.abs()));
        for (a, b) in simulated[0].iter().zip(recorded) {
            assert!((a - b).abs() < 3e-3 * scale, "{law}: {a} {b}");
        }
    }
}

#[test]
fn a_mass_forgets_as_fast_as_its_slowest_motion() {
    let with = |spring| Equation {
        spring,
        ..equation(Reading::Position, "")
    };
    // Underdamped: the envelope is exp(-d/2M t); overdamped: the slower of two exponentials, here exp(-t/2).
    let after = |numbers: &[f64]| with(true).forgets_after(numbers);
    assert!((after(&[0.5, 0.2, 0.0, 80.0]) - 5.0).abs() < 1e-12);
    assert!((after(&[2.0, 9.0, 0.3, 4.0]) - 2.0).abs() < 1e-12);
    // An input that is wired in reverse.
    assert!((after(&[-2.0, -9.0, 0.3, -4.0]) - 2.0).abs() < 1e-12);
    // Nothing brakes it, nothing holds it.
    assert_eq!(after(&[1.0, 0.0, 0.0, 4.0]), f64::INFINITY);
    assert_eq!(after(&[1.0, 2.0, 0.0, -4.0]), f64::INFINITY);
    assert_eq!(with(false).forgets_after(&[1.0, 2.0, 0.0]), f64::INFINITY);
}

/// Numbers that the noise of the sensor scatters come out within what is said, and their halves differ as they should.
#[test]
fn an_averaged_equation_knows_its_numbers() {
    const RUNS: u64 = 40;
    let size = 0.5;
    for (reading, noise) in NOISY {
        let found: Vec<_> = (0..RUNS)
            .into_par_iter()
            .map(|seed| {
                let drag = |_: f64, v: f64| size * v * v.abs();
                let data = drive(reading, spring(reading), drag, noise, 10 + seed);
                let windows = Windows::choose(&data, reading).unwrap();
                let equation = equation(reading, "quadratic_drag");
                let fit = equation.fit(&windows, &data, false).unwrap();
                let differ = halves(&equation, &windows, &data).unwrap();
                (fit.coefficients.clone(), fit.covariance(), differ)
            })
            .collect();
        let mean = |of: &dyn Fn(usize) -> f64| (0..found.len()).map(of).sum::<f64>() / RUNS as f64;
        for (i, truth) in truth(reading).into_iter().chain([size]).enumerate() {
            let bias = mean(&|run| found[run].0[i] / truth - 1.0);
            assert!(bias.abs() < 3e-3, "{reading:?} {i}: {bias}");
            // Windows overlap by half, and what they share of the noise is of either sign: fewer than it seems.
            let squares = mean(&|run| (found[run].0[i] - truth).powi(2) / found[run].1[(i, i)]);
            assert!((0.05..1.4).contains(&squares), "{reading:?} {i}: {squares}");
        }
        let squares = mean(&|run| found[run].2.powi(2));
        assert!((0.1..1.4).contains(&squares), "{reading:?}: {squares}");
    }
}

#[test]
fn what_an_equation_leaves_is_told_from_noise() {
    const RUNS: u64 = 40;
    for (reading, noise) in NOISY {
        for size in [0.0, 0.5] {
            let found: Vec<Adequacy> = (0..RUNS)
                .into_par_iter()
                .map(|seed| {
                    let drag = |_: f64, v: f64| size * v * v.abs();
                    let data = drive(reading, spring(reading), drag, noise, 90 + seed);
                    let windows = Windows::choose(&data, reading).unwrap();
                    let plain = equation(reading, "");
                    let fit = plain.fit(&windows, &data, false).unwrap();
                    // As if what was found had left a tenth of the squares there were.
                    adequacy(&windows, &data, &plain, &fit, 10.0 * fit.squares).unwrap()
                })
                .collect();
            let seen = found.iter().filter(|a| a.p_value < 0.05).count();
            let shares = found.iter().map(|a| a.share);
            if size == 0.0 {
                // At 5 % each, more than 6 of 40 come about once in a hundred.
                assert!(seen <= 6, "{reading:?}: {seen}");
                assert!(shares.fold(0.0, f64::max) < 0.1);
            } else {
                assert_eq!(seen, found.len());
                assert!(shares.fold(1.0, f64::min) > 0.8);
                assert!(
                    found
                        .iter()
                        .all(|a| (9.0 * a.of_removed / a.share - 1.0).abs() < 1e-9)
                );
            }
        }
    }
}

/// A law of this name.
fn form(id: &str) -> Form {
    Form::all(Reading::Position, &|d| d.id == id)[0]
}

#[test]
fn a_pitch_is_found_from_either_side() {
    let pitch = 0.5;
    let cogging = |x: f64, _: f64| 1.5 * (std::f64::consts::TAU / pitch * x + 0.4).sin();
    let data = drive(Reading::Position, SPRING, cogging, 2e-4, 5);
    let windows = Windows::choose(&data, Reading::Position).unwrap();
    for share in [0.97, 1.03] {
        let start = Equation {
            laws: vec![(form("cogging"), share * pitch)],
            ..equation(Reading::Position, "")
        };
        let found = start.refined(&windows, &data, 1.04).laws[0].1;
        assert!((found / pitch - 1.0).abs() < 3e-3, "{share}: {found}");
    }
    // Pitches are tried in steps of one ratio, up to half the range of motion.
    let shapes = form("cogging").shapes(&windows, 2.0, STEP);
    let ratio = shapes[1] / shapes[0];
    assert!(ratio > 1.0);
    for pair in shapes.windows(2) {
        assert!((pair[1] / pair[0] / ratio - 1.0).abs() < 1e-9);
    }
    let positions = windows.position[0].iter().copied();
    let (low, high) = positions.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| {
        (f64::min(a, x), f64::max(b, x))
    });
    let last = shapes[shapes.len() - 1];
    assert!((2.0 * last / (high - low) - 1.0).abs() < 1e-9, "{last}");
}

#[test]
fn laws_owe_their_shapes() {
    for (id, owed) in [
        ("coulomb_friction", 0),
        ("quadratic_drag", 0),
        ("cubic_stiffness", 0),
        ("stribeck_friction", 1),
        ("input_dead_zone", 1),
        ("input_saturation", 1),
        ("cogging", 2),
        ("load_step", 2),
    ] {
        assert_eq!(form(id).owed(), owed, "{id}");
        assert_eq!(form(id).has_shape(), owed > 0, "{id}");
    }
}

#[test]
fn laws_that_would_push_are_not_physical() {
    // Whichever way the input is wired, the mass tells the sign.
    for side in [1.0, -1.0] {
        for id in ["coulomb_friction", "quadratic_drag"] {
            assert!(form(id).is_physical(&[0.2 * side], side));
            assert!(!form(id).is_physical(&[-0.2 * side], side));
        }
        assert!(form("stribeck_friction").is_physical(&[0.2 * side, 0.1 * side], side));
        assert!(!form("stribeck_friction").is_physical(&[0.2 * side, -0.1 * side], side));
    }
    // What an actuator takes off the input is about as large as it says.
    for id in ["input_dead_zone", "input_saturation"] {
        for (coefficient, physical) in [(1.0, true), (0.8, true), (0.5, false), (-1.0, false)] {
            assert_eq!(form(id).is_physical(&[coefficient], 1.0), physical, "{id}");
        }
    }
    assert!(form("cubic_stiffness").is_physical(&[-3.0], 1.0));
}
