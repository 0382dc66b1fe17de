//! Recordings that are ill-conditioned, with known truth: either the answer is right within its stated uncertainty, or
//! the tool says that it is not to be trusted. Never neither.
//!
//! Of each kind of recording many are drawn. An answer is *trusted* when it comes without a warning and its residual
//! tests do not reject it. The share of stated 95 % regions, of all that were drawn, that are trusted and do not hold
//! the truth must be what 95 % leaves over; and where the information is in the recording, nearly all must be trusted.
//!
//! `cargo test --release --test numbers_that_lie -- --nocapture` prints the table; `INNOVANT_LIE_RUNS` asks for as many
//! recordings of each kind, `INNOVANT_LIE_ONLY` for the kinds whose name holds a text.

use innovant::identify::{MemoryRecords, Options};
use innovant::internal::systems::{TestSystem, van_wingerden_one};
use innovant::log::Log;
use innovant::model::StateSpace;
use innovant::validate::identify_and_test;
use nalgebra::{DMatrix, Matrix2};
use rayon::prelude::*;

#[path = "support/coverage.rs"]
mod coverage;
use coverage::{Count, coverage};

/// What the answers of one kind must be.
#[derive(Clone, Copy, PartialEq)]
enum Must {
    /// The information is there: at least four of five are trusted.
    Trust,
    /// It is not: no answer may come without a warning, an objection of the tests or an error.
    Doubt,
    /// It depends on the recording.
    BeHonest,
}

/// A recording of a plant, by its seed.
type Record = Box<dyn Fn(&TestSystem, u64) -> Log + Sync>;

struct Kind {
    name: &'static str,
    must: Must,
    runs: u64,
    plant: TestSystem,
    frequencies: Vec<f64>,
    record: Record,
}

#[derive(Default, Clone, Copy)]
struct Outcome {
    /// Regions of trusted answers: frequency response, its magnitude, poles.
    trusted: [Count; 3],
    /// Of all answers.
    all: [Count; 3],
    runs: usize,
    trusted_runs: usize,
    errors: usize,
}

fn identified(kind: &Kind, seed: u64) -> Outcome {
    let mut outcome = Outcome {
        runs: 1,
        ..Outcome::default()
    };
    let logs = [(kind.record)(&kind.plant, seed)];
    let found = MemoryRecords::new(&logs)
        .map_err(Into::into)
        .and_then(|mut records| identify_and_test(&mut records, &Options::default()));
    let Ok(tested) = found else {
        outcome.errors = 1;
        return outcome;
    };
    let doubted = tested.tests.as_ref().is_none_or(|t| t.rejected)
        || !tested.model.summary.as_ref().unwrap().warnings.is_empty();
    outcome.all = coverage(&kind.plant, &tested.model, &kind.frequencies);
    if !doubted {
        outcome.trusted_runs = 1;
        outcome.trusted = outcome.all;
    }
    outcome
}

fn sum(mut a: Outcome, b: Outcome) -> Outcome {
    for (x, y) in a.trusted.iter_mut().zip(&b.trusted) {
        x.add(y);
    }
    for (x, y) in a.all.iter_mut().zip(&b.all) {
        x.add(y);
    }
    a.runs += b.runs;
    a.trusted_runs += b.trusted_runs;
    a.errors += b.errors;
    a
}

/// Errors of one model at several places are not independent of each other. A judgement, not a measurement: as many
/// count as independent as two by two channels have.
const INDEPENDENT_PER_RUN: f64 = 4.0;

/// The line of the table, and what is wrong with it.
fn check(kind: &Kind, index: usize, runs: u64) -> (String, Vec<String>) {
    let found = (0..runs)
        .into_par_iter()
        .map(|run| identified(kind, 1000 * (1 + index as u64) + run))
        .reduce(Outcome::default, sum);
    let lies = |k: usize| {
        let (trusted, all) = (&found.trusted[k], &found.all[k]);
        (trusted.total - trusted.inside_95) as f64 / all.total.max(1) as f64
    };
    let share = |count: &Count| {
        if count.total == 0 {
            "    -".to_owned()
        } else {
            format!("{:5.1}", count.shares().0)
        }
    };
    let line = format!(
        "{:<34} {:>4} runs, {:>4} errors, {:>4} trusted; inside 95 %, trusted: G {} |G| {} poles {}; all: G {} |G| {}; \
         trusted and wrong {:.1} / {:.1} %",
        kind.name,
        found.runs,
        found.errors,
        found.trusted_runs,
        share(&found.trusted[0]),
        share(&found.trusted[1]),
        share(&found.trusted[2]),
        share(&found.all[0]),
        share(&found.all[1]),
        100.0 * lies(0),
        100.0 * lies(1),
    );
    // Three binomial standard deviations.
    let bound = 0.05 + 3.0 * (0.05 * 0.95 / (runs as f64 * INDEPENDENT_PER_RUN)).sqrt();
    let mut wrong = Vec::new();
    for (k, what) in ["frequency response", "its magnitude"].iter().enumerate() {
        if lies(k) > bound {
            wrong.push(format!(
                "{}: {what} trusted and wrong in {:.1} %, at most {:.1}",
                kind.name,
                100.0 * lies(k),
                100.0 * bound
            ));
        }
    }
    let trusted = found.trusted_runs as f64 / found.runs as f64;
    if kind.must == Must::Trust && trusted < 0.8 || kind.must == Must::Doubt && trusted > 0.0 {
        wrong.push(format!("{}: {:.0} % trusted", kind.name, 100.0 * trusted));
    }
    (line, wrong)
}

#[test]
fn an_answer_is_right_or_it_says_that_it_is_not() {
    let asked = std::env::var("INNOVANT_LIE_RUNS").ok();
    let asked: Option<u64> = asked.and_then(|v| v.parse().ok());
    let only = std::env::var("INNOVANT_LIE_ONLY").unwrap_or_default();
    let answers: Vec<(String, Vec<String>)> = kinds()
        .par_iter()
        .enumerate()
        .filter(|(_, kind)| kind.name.contains(&only))
        .map(|(index, kind)| check(kind, index, asked.unwrap_or(kind.runs)))
        .collect();
    for (line, _) in &answers {
        println!("{line}");
    }
    let wrong: Vec<String> = answers.into_iter().flat_map(|(_, wrong)| wrong).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

const SPREAD: [f64; 8] = [0.1, 0.3, 0.6, 0.785, 1.2, 1.8, 2.36, 3.0];

fn kinds() -> Vec<Kind> {
    let mut kinds = Vec::new();
    let mut add = |name, must, runs, plant: &TestSystem, frequencies: &[f64], record| {
        kinds.push(Kind {
            name,
            must,
            runs,
            plant: plant.clone(),
            frequencies: frequencies.to_vec(),
            record,
        });
    };
    let closed = van_wingerden_one();
    let mut open = closed.clone();
    open.feedback.fill(0.0);

    // Inputs through low-pass filters in series: condition of the data factor 1e2, 1e4, 3e5, 2e8.
    for (name, must, runs, pole, order) in [
        ("coloured, 1 pole at 0.9", Must::Trust, 24, 0.9, 1),
        ("coloured, 2 poles at 0.97", Must::Trust, 12, 0.97, 2),
        ("coloured, 4 poles at 0.9", Must::Trust, 4, 0.9, 4),
        ("coloured, 4 poles at 0.99", Must::BeHonest, 1, 0.99, 4),
    ] {
        let low_pass: Record = Box::new(move |plant, seed| coloured(plant, seed, pole, order));
        add(name, must, runs, &open, &SPREAD, low_pass);
    }
    for (name, must, share) in [
        ("inputs alike to 1e-2", Must::Trust, 1e-2),
        ("inputs alike to 1e-4", Must::BeHonest, 1e-4),
        ("inputs alike to 1e-6", Must::Doubt, 1e-6),
        ("one input twice", Must::Doubt, 0.0),
    ] {
        let alike: Record = Box::new(move |plant, seed| {
            let mut first = 0.0;
            plant.record_with(2000, seed, |_, channel, white| {
                if channel == 0 {
                    first = white;
                }
                first + if channel == 1 { share * white } else { 0.0 }
            })
        });
        add(name, must, 24, &open, &SPREAD, alike);
    }

    let low = [0.02, 0.1, 0.3, 1.0, 3.0];
    let integrator = single(&[-1.8, 0.8], &[0.1, 0.08], &[0.6, -0.4], 0.1);
    add(
        "integrator",
        Must::BeHonest,
        24,
        &integrator,
        &low,
        plain(2000),
    );
    let mut controlled = integrator;
    controlled.feedback[(0, 0)] = -0.5;
    let name = "integrator in closed loop";
    add(name, Must::BeHonest, 24, &controlled, &low, plain(2000));
    let double = single(&[-2.0, 1.0], &[0.005, 0.005], &[0.3, -0.2], 0.1);
    add(
        "double integrator",
        Must::BeHonest,
        24,
        &double,
        &low,
        plain(2000),
    );

    for (name, must, damping, samples) in [
        ("damping 1e-2, 2000 samples", Must::Trust, 1e-2, 2000),
        ("damping 1e-3, 2000 samples", Must::BeHonest, 1e-3, 2000),
        ("damping 1e-4, 2000 samples", Must::BeHonest, 1e-4, 2000),
        ("damping 1e-4, 20000 samples", Must::BeHonest, 1e-4, 20_000),
    ] {
        let plant = resonance(damping);
        let around = [0.1, 0.3, 0.59, 0.6, 0.61, 1.0, 3.0];
        add(name, must, 24, &plant, &around, plain(samples));
    }

    let wide = modal(12, 8, 2);
    add(
        "12 outputs from 8 inputs",
        Must::BeHonest,
        1,
        &wide,
        &SPREAD,
        plain(2000),
    );

    // Rounded by the logger: the controller knew better.
    for (name, must, of_inputs, of_outputs) in [
        ("outputs in steps of 0.1", Must::Trust, 0.0, 0.1),
        ("outputs in steps of 1", Must::Doubt, 0.0, 1.0),
        ("inputs in steps of 0.1", Must::Trust, 0.1, 0.0),
        ("inputs in steps of 1", Must::Doubt, 1.0, 0.0),
    ] {
        let rounded: Record = Box::new(move |plant, seed| {
            let mut log = plant.record(2000, seed);
            round(&mut log.input_data, of_inputs);
            round(&mut log.output_data, of_outputs);
            log
        });
        add(name, must, 24, &closed, &SPREAD, rounded);
    }
    // Rounded outputs of a plant without feedback are noise like any other.
    let open_rounded: Record = Box::new(|plant, seed| {
        let mut log = plant.record(2000, seed);
        round(&mut log.output_data, 1.0);
        log
    });
    add(
        "outputs in steps, open loop",
        Must::Trust,
        24,
        &open,
        &SPREAD,
        open_rounded,
    );

    for (name, held) in [
        ("30 % at rest", 0.0),
        ("30 % at another operating point", 10.0),
    ] {
        let at_rest: Record = Box::new(move |plant, seed| {
            plant.record_with(2000, seed, |k, _, white| {
                if (700..1300).contains(&k) {
                    held
                } else {
                    white
                }
            })
        });
        add(name, Must::Trust, 24, &open, &SPREAD, at_rest);
    }

    for (name, must, samples) in [
        ("40 samples, 2 x 2", Must::BeHonest, 40),
        ("100 samples, 2 x 2", Must::BeHonest, 100),
        ("400 samples, 2 x 2", Must::BeHonest, 400),
    ] {
        add(name, must, 24, &closed, &SPREAD, plain(samples));
    }
    let fat = modal(6, 6, 2);
    add(
        "150 samples, 6 x 6",
        Must::BeHonest,
        6,
        &fat,
        &SPREAD,
        plain(150),
    );
    kinds
}

fn plain(samples: usize) -> Record {
    Box::new(move |plant, seed| plant.record(samples, seed))
}

fn round(columns: &mut [Vec<f64>], step: f64) {
    if step > 0.0 {
        for value in columns.iter_mut().flatten() {
            *value = (*value / step).round() * step;
        }
    }
}

/// Inputs that are white noise through `order` first-order filters, each of unit variance from white noise.
fn coloured(plant: &TestSystem, seed: u64, pole: f64, order: usize) -> Log {
    let gain = (1.0 - pole * pole).sqrt();
    let mut states = vec![vec![0.0; order]; plant.system.inputs()];
    plant.record_with(2000, seed, |_, channel, white| {
        states[channel].iter_mut().fold(white, |input, state| {
            *state = pole * *state + gain * input;
            *state
        })
    })
}

/// One input, one output: `y[k] + a1 y[k-1] + ... = b1 u[k-1] + ... + e[k] + ...` in observer form.
fn single(a: &[f64], b: &[f64], k: &[f64], noise: f64) -> TestSystem {
    let n = a.len();
    let mut observer = DMatrix::zeros(n, n);
    for (row, value) in a.iter().enumerate() {
        observer[(row, 0)] = -value;
        if row + 1 < n {
            observer[(row, row + 1)] = 1.0;
        }
    }
    let mut c = DMatrix::zeros(1, n);
    c[(0, 0)] = 1.0;
    TestSystem {
        system: StateSpace {
            a: observer,
            b: DMatrix::from_column_slice(n, 1, b),
            c,
            d: DMatrix::zeros(1, 1),
            k: DMatrix::from_column_slice(n, 1, k),
            sample_time: 1.0,
        },
        innovation_covariance: DMatrix::from_element(1, 1, noise * noise),
        feedback: DMatrix::zeros(1, 1),
    }
}

/// A resonance at 0.6 rad/sample.
fn resonance(damping: f64) -> TestSystem {
    let natural = 0.6;
    let radius = f64::exp(-damping * natural);
    let angle = natural * (1.0 - damping * damping).sqrt();
    let a = [-2.0 * radius * angle.cos(), radius * radius];
    single(&a, &[0.2, 0.1], &[-0.7 - a[0], 0.2 - a[1]], 0.5)
}

/// Every input and output couples to every mode.
fn modal(outputs: usize, inputs: usize, modes: usize) -> TestSystem {
    let n = 2 * modes;
    let mut a = DMatrix::zeros(n, n);
    for mode in 0..modes {
        let (radius, angle) = (0.85 + 0.02 * mode as f64, 0.4 + 0.9 * mode as f64);
        let (s, c) = angle.sin_cos();
        a.view_mut((2 * mode, 2 * mode), (2, 2))
            .copy_from(&(Matrix2::new(c, s, -s, c) * radius));
    }
    let wave = |i: usize, j: usize, rate: f64| ((1.0 + i as f64) * (2.0 + j as f64) * rate).sin();
    TestSystem {
        system: StateSpace {
            a,
            b: DMatrix::from_fn(n, inputs, |i, j| wave(i, j, 0.73)),
            c: DMatrix::from_fn(outputs, n, |i, j| wave(i, j, 1.19)),
            d: DMatrix::zeros(outputs, inputs),
            k: DMatrix::from_fn(n, outputs, |i, j| 0.02 * wave(i, j, 0.41)),
            sample_time: 1.0,
        },
        innovation_covariance: DMatrix::identity(outputs, outputs),
        feedback: DMatrix::zeros(inputs, outputs),
    }
}
