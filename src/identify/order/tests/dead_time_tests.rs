//! Tests of `dead_time`.

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

use crate::identify::fit_aligned::fit_aligned;
use crate::identify::{MemoryRecords, Model, Options, identify};
use crate::log::{Channel, Log};

/// `y` follows `u` with a pole at 0.9 after `dead` samples, under slow and white noise; with `gain` a controller closes the
/// loop.
fn recorded(dead: usize, samples: usize, gain: f64, seed: u64) -> Log {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
    let (mut u, mut y, mut x, mut slow, mut r) = (vec![], vec![], 0.0, 0.0, 0.0);
    for k in 0..samples {
        slow = 0.9 * slow + 0.1 * normal();
        let measured: f64 = x + slow + 0.1 * normal();
        if k % 8 == 0 {
            r = normal();
        }
        u.push(r - gain * measured);
        y.push(measured);
        let late: f64 = if k >= dead { u[k - dead] } else { 0.0 };
        x = 0.9 * x + 0.1 * late;
    }
    Log {
        name: "dead time".to_owned(),
        sample_time: 1.0,
        start_time: 0.0,
        inputs: vec![Channel::new("u")],
        outputs: vec![Channel::new("y")],
        input_data: vec![u],
        output_data: vec![y],
        sha256: None,
    }
}

fn model(log: Log, input_delay: Vec<usize>) -> Model {
    let options = Options {
        input_delay,
        ..Options::default()
    };
    identify(&[log], &options).unwrap()
}

/// To a sample more where the first coefficient is small, in open and closed loop.
#[test]
fn leading_coefficients_tell_the_dead_time() {
    for (dead, gain) in [(3, 0.0), (8, 0.0), (8, 0.5), (15, 0.0)] {
        let found: Vec<usize> = (0..5)
            .map(|seed| {
                let logs = [recorded(dead, 3000, gain, seed)];
                let mut records = MemoryRecords::new(&logs).unwrap();
                let fit = fit_aligned(&mut records, &Options::default()).unwrap();
                fit.dead_time.proposed[0]
            })
            .collect();
        let right = found.iter().filter(|d| (dead..=dead + 1).contains(d));
        assert!(right.count() >= 4, "{dead} {gain}: {found:?}");
    }
}

/// Two outputs that are heated by two inputs, each over its own lags: without the dead time no order is accepted.
#[test]
fn dead_time_costs_no_states() {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(5);
    let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
    let (dead, samples) = (8, 2500);
    let (mut u, mut y) = (vec![Vec::new(); 2], vec![Vec::new(); 2]);
    let (mut x, mut slow) = ([0.0; 2], [0.0; 2]);
    let mut held = [0.0; 2];
    for k in 0..samples {
        for i in 0..2 {
            if (k + 7 * i) % 15 == 0 {
                held[i] = normal();
            }
            u[i].push(held[i]);
            slow[i] = 0.95 * slow[i] + 0.02 * normal();
            y[i].push(x[i] + slow[i] + 0.02 * normal());
        }
        let late = |i: usize| if k >= dead { u[i][k - dead] } else { 0.0 };
        x = [
            0.96 * x[0] + 0.01 * x[1] + 0.05 * late(0),
            0.01 * x[0] + 0.95 * x[1] + 0.06 * late(1),
        ];
    }
    let mut log = recorded(0, 10, 0.0, 1);
    log.inputs.push(Channel::new("v"));
    log.outputs.push(Channel::new("z"));
    (log.input_data, log.output_data) = (u, y);
    let model = model(log, Vec::new());
    let delays: Vec<usize> = model.inputs.iter().map(|c| c.delay).collect();
    assert!(
        delays.iter().all(|d| (dead - 1..=dead).contains(d)),
        "{delays:?}"
    );
    assert!(model.system.states() <= 3, "{model}");
}

#[test]
fn a_plant_without_dead_time_has_none() {
    for seed in 0..10 {
        let model = model(recorded(0, 3000, 0.0, seed), Vec::new());
        assert_eq!(model.inputs[0].delay, 0, "{seed}");
    }
}

#[test]
fn what_the_user_says_counts() {
    assert_eq!(model(recorded(8, 2000, 0.0, 1), vec![0]).inputs[0].delay, 0);
    assert_eq!(model(recorded(8, 2000, 0.0, 1), vec![5]).inputs[0].delay, 5);
}
