//! Recordings that are ill-conditioned, with known truth: either the answer is right within its stated uncertainty, or
//! the tool says that it is not to be trusted. Never neither.
//!
//! `cargo test --release --test numbers_that_lie -- --nocapture` prints the table; `INNOVANT_LIE_RUNS` for more runs.

use innovant::identify::{MemoryRecords, Options};
use innovant::log::Log;
use innovant::model::StateSpace;
use innovant::systems::{TestSystem, van_wingerden_one};
use innovant::validate::identify_and_test;
use nalgebra::{DMatrix, Matrix2};
use rayon::prelude::*;

#[path = "support/coverage.rs"]
mod coverage;
use coverage::{Count, coverage};

/// What a battery of recordings of one kind came to.
#[derive(Default, Clone)]
struct Outcome {
    trusted: [Count; 3],
    all: [Count; 3],
    warned: usize,
    rejected: usize,
    failed: usize,
    conditions: Vec<f64>,
    orders: Vec<usize>,
    warnings: Vec<String>,
}

fn one(plant: &TestSystem, log: Log, frequencies: &[f64]) -> Outcome {
    let mut outcome = Outcome::default();
    let logs = [log];
    let found = MemoryRecords::new(&logs)
        .map_err(Into::into)
        .and_then(|mut records| identify_and_test(&mut records, &Options::default()));
    let tested = match found {
        Ok(tested) => tested,
        Err(error) => {
            outcome.failed = 1;
            outcome.warnings.push(format!("ERROR {error}"));
            return outcome;
        }
    };
    let model = &tested.model;
    let summary = model.summary.as_ref().unwrap();
    outcome
        .conditions
        .push(summary.diagnostics.reciprocal_condition);
    outcome.orders.push(summary.order);
    outcome.rejected = usize::from(tested.tests.as_ref().is_none_or(|t| t.rejected));
    outcome.warned = usize::from(!summary.warnings.is_empty());
    outcome.warnings.clone_from(&summary.warnings);
    let counts = coverage(plant, model, frequencies);
    if outcome.rejected + outcome.warned == 0 {
        outcome.trusted = counts;
    }
    outcome.all = counts;
    outcome
}

fn battery(
    name: &str,
    runs: u64,
    plant: &TestSystem,
    frequencies: &[f64],
    record: impl Fn(u64) -> Log + Sync,
) {
    let start = std::time::Instant::now();
    let total = (0..runs)
        .into_par_iter()
        .map(|run| one(plant, record(7000 + run), frequencies))
        .reduce(Outcome::default, |mut a, b| {
            for (x, y) in a.trusted.iter_mut().zip(&b.trusted) {
                x.add(y);
            }
            for (x, y) in a.all.iter_mut().zip(&b.all) {
                x.add(y);
            }
            a.warned += b.warned;
            a.rejected += b.rejected;
            a.failed += b.failed;
            a.conditions.extend(b.conditions);
            a.orders.extend(b.orders);
            a.warnings.extend(b.warnings);
            a
        });
    let mut conditions = total.conditions.clone();
    conditions.sort_by(f64::total_cmp);
    let mut orders = total.orders.clone();
    orders.sort();
    let shares = |c: [Count; 3]| {
        c.map(|c| {
            let (a, b) = c.shares();
            format!("{a:5.1}/{b:5.1} ({})", c.total)
        })
        .join("  ")
    };
    println!(
        "{name:<40} rcond {:.1e}  orders {:?}..{:?} (true {}) runs {runs} failed {} rejected {} warned {}  {:.1} s\n      trusted {}\n      all     {}",
        conditions
            .get(conditions.len() / 2)
            .copied()
            .unwrap_or(f64::NAN),
        orders.first(),
        orders.last(),
        plant.system.states(),
        total.failed,
        total.rejected,
        total.warned,
        start.elapsed().as_secs_f64(),
        shares(total.trusted),
        shares(total.all)
    );
    let mut kinds: std::collections::BTreeMap<String, usize> = Default::default();
    for w in &total.warnings {
        *kinds
            .entry(
                w.split(|c: char| c.is_ascii_digit())
                    .next()
                    .unwrap_or_default()
                    .to_owned(),
            )
            .or_default() += 1;
    }
    for (w, n) in kinds {
        println!("        {n} x {w}");
    }
}

fn open_loop(mut plant: TestSystem) -> TestSystem {
    plant.feedback.fill(0.0);
    plant
}

/// White noise through `m` first-order low-pass filters with pole `pole`, unit variance roughly.
struct LowPass {
    pole: f64,
    states: Vec<Vec<f64>>,
}
impl LowPass {
    fn new(pole: f64, order: usize, channels: usize) -> Self {
        Self {
            pole,
            states: vec![vec![0.0; order]; channels],
        }
    }
    fn next(&mut self, channel: usize, white: f64) -> f64 {
        let gain = (1.0 - self.pole * self.pole).sqrt();
        let mut v = white;
        for s in &mut self.states[channel] {
            *s = self.pole * *s + gain * v;
            v = *s;
        }
        v
    }
}

fn siso(a: &[f64], b: &[f64], k: &[f64], dt: f64, noise: f64) -> TestSystem {
    let n = a.len();
    let mut companion = DMatrix::zeros(n, n);
    for i in 0..n {
        companion[(i, 0)] = -a[i];
        if i + 1 < n {
            companion[(i, i + 1)] = 1.0;
        }
    }
    let mut c = DMatrix::zeros(1, n);
    c[(0, 0)] = 1.0;
    TestSystem {
        system: StateSpace {
            a: companion,
            b: DMatrix::from_column_slice(n, 1, b),
            c,
            d: DMatrix::zeros(1, 1),
            k: DMatrix::from_column_slice(n, 1, k),
            sample_time: dt,
        },
        innovation_covariance: DMatrix::from_element(1, 1, noise * noise),
        feedback: DMatrix::zeros(1, 1),
    }
}

/// `12 x 8`, five modes.
fn wide(outputs: usize, inputs: usize, modes: usize) -> TestSystem {
    let n = 2 * modes;
    let mut a = DMatrix::zeros(n, n);
    for m in 0..modes {
        let (radius, angle) = (0.9 + 0.015 * m as f64, 0.2 + 0.5 * m as f64);
        let block = Matrix2::new(angle.cos(), angle.sin(), -angle.sin(), angle.cos()) * radius;
        a.view_mut((2 * m, 2 * m), (2, 2)).copy_from(&block);
    }
    let wave = |i: usize, j: usize, s: f64| ((1.0 + i as f64) * (2.0 + j as f64) * s).sin();
    TestSystem {
        system: StateSpace {
            a,
            b: DMatrix::from_fn(n, inputs, |i, j| wave(i, j, 0.73)),
            c: DMatrix::from_fn(outputs, n, |i, j| wave(i, j, 1.19)),
            d: DMatrix::zeros(outputs, inputs),
            k: DMatrix::from_fn(n, outputs, |i, j| 0.08 * wave(i, j, 0.41)),
            sample_time: 1.0,
        },
        innovation_covariance: DMatrix::identity(outputs, outputs),
        feedback: DMatrix::zeros(inputs, outputs),
    }
}

#[test]
fn survey() {
    let runs: u64 = std::env::var("INNOVANT_LIE_RUNS")
        .ok()
        .and_then(|v| v.parse().ok())
        .unwrap_or(40);
    let only = std::env::var("INNOVANT_LIE_ONLY").unwrap_or_default();
    let go = |name: &str| name.contains(&only);
    let w8 = [0.1, 0.3, 0.6, 0.785, 1.2, 1.8, 2.36, 3.0];
    for (pole, order) in [
        (0.9, 1),
        (0.9, 2),
        (0.97, 2),
        (0.9, 4),
        (0.97, 4),
        (0.99, 4),
        (0.99, 6),
    ] {
        let name = format!("coloured {pole}^{order}");
        if !go(&name) {
            continue;
        }
        let plant = open_loop(van_wingerden_one());
        battery(&name, runs, &plant, &w8, |seed| {
            let mut f = LowPass::new(pole, order, 2);
            plant.record_with(2000, seed, |_, c, w| f.next(c, w))
        });
    }
    for eps in [1e-2, 1e-4, 1e-6, 1e-8, 0.0] {
        let name = format!("collinear {eps:e}");
        if !go(&name) {
            continue;
        }
        let plant = open_loop(van_wingerden_one());
        battery(&name, runs, &plant, &w8, |seed| {
            let mut first = 0.0;
            plant.record_with(2000, seed, |_, c, w| {
                if c == 0 {
                    first = w;
                    w
                } else {
                    first + eps * w
                }
            })
        });
    }
    // Integrator and double integrator with a lag.
    if go("integrator") {
        // (1 - q)(1 - .8 q)
        let plant = siso(&[-1.8, 0.8], &[0.1, 0.08], &[0.6, -0.4], 1.0, 0.1);
        battery(
            "integrator, open loop",
            runs,
            &plant,
            &[0.02, 0.1, 0.3, 1.0, 3.0],
            |seed| plant.record(2000, seed),
        );
        let mut plant = plant;
        plant.feedback[(0, 0)] = -0.5;
        battery(
            "integrator, closed loop",
            runs,
            &plant,
            &[0.02, 0.1, 0.3, 1.0, 3.0],
            |seed| plant.record(2000, seed),
        );
        let plant = siso(&[-2.0, 1.0], &[0.005, 0.005], &[0.3, -0.2], 1.0, 0.1);
        battery(
            "double integrator, open loop",
            runs,
            &plant,
            &[0.02, 0.1, 0.3, 1.0, 3.0],
            |seed| plant.record(2000, seed),
        );
    }
    for (zeta, n) in [(1e-2, 2000), (1e-3, 2000), (1e-4, 2000), (1e-4, 20000)] {
        let name = format!("resonance {zeta:e} N {n}");
        if !go(&name) {
            continue;
        }
        let wn = 0.6;
        let (radius, angle) = (f64::exp(-zeta * wn), wn * f64::sqrt(1.0 - zeta * zeta));
        let a = [-2.0 * radius * angle.cos(), radius * radius];
        let plant = siso(&a, &[0.2, 0.1], &[0.3 - a[0] - 1.0, -a[1] + 0.2], 1.0, 0.5);
        battery(
            &name,
            runs,
            &plant,
            &[0.1, 0.3, 0.59, 0.6, 0.61, 1.0, 3.0],
            |seed| plant.record(n, seed),
        );
    }
    if go("wide") {
        let plant = wide(12, 8, 5);
        battery("wide 12 x 8, N 5000", runs / 4, &plant, &w8, |seed| {
            plant.record(5000, seed)
        });
        let plant = wide(12, 8, 5);
        battery("wide 12 x 8, N 1000", runs / 4, &plant, &w8, |seed| {
            plant.record(1000, seed)
        });
    }
    for (what, step_y, step_u) in [
        ("y .1", 0.1, 0.0),
        ("y 1", 1.0, 0.0),
        ("y 3", 3.0, 0.0),
        ("u 1", 0.0, 1.0),
        ("both 1", 1.0, 1.0),
    ] {
        let name = format!("quantised {what}");
        if !go(&name) {
            continue;
        }
        let plant = van_wingerden_one();
        battery(&name, runs, &plant, &w8, |seed| {
            let mut log = plant.record(2000, seed);
            for (columns, step) in [
                (&mut log.output_data, step_y),
                (&mut log.input_data, step_u),
            ] {
                if step > 0.0 {
                    for c in columns {
                        for v in c {
                            *v = (*v / step).round() * step;
                        }
                    }
                }
            }
            log
        });
    }
    if go("rest") {
        let plant = open_loop(van_wingerden_one());
        battery("rest 30 %", runs, &plant, &w8, |seed| {
            plant.record_with(
                2000,
                seed,
                |k, _, w| if (700..1300).contains(&k) { 0.0 } else { w },
            )
        });
        battery("rest 30 % far away", runs, &plant, &w8, |seed| {
            plant.record_with(
                2000,
                seed,
                |k, _, w| if (700..1300).contains(&k) { 10.0 } else { w },
            )
        });
        battery("rest 90 %", runs, &plant, &w8, |seed| {
            plant.record_with(2000, seed, |k, _, w| if k < 1800 { 0.0 } else { w })
        });
    }
    for n in [40, 60, 100, 200, 400] {
        let name = format!("short {n}");
        if !go(&name) {
            continue;
        }
        let plant = van_wingerden_one();
        battery(&name, runs, &plant, &w8, |seed| plant.record(n, seed));
        let plant = wide(3, 3, 2);
        battery(&format!("short {n}, 3 x 3"), runs, &plant, &w8, |seed| {
            plant.record(n, seed)
        });
    }
}
