//! Models and records for the tests of the whole judgement.

use nalgebra::{DMatrix, dmatrix};
use rayon::prelude::*;

use crate::covariance::ParameterCovariance;
use crate::identify::fit_recordings::fit;
use crate::identify::{Fit, MemoryRecords, Options, Order};
use crate::log::Log;
use crate::model::StateSpace;
use crate::systems::{TestSystem, servo};
use crate::validate::{
    RecordView, Relation, ResidualTest, Validation, ValidationOptions, validate,
};
use statrs::distribution::{Binomial, DiscreteCDF};

pub(super) fn identified(log: &Log, order: usize) -> Fit {
    let options = Options {
        order: Order::Fixed(order),
        ..Options::default()
    };
    let logs = [log.clone()];
    fit(&mut MemoryRecords::new(&logs).unwrap(), &options).unwrap()
}

/// Judges a system on a log whose operating point is `levels`.
pub(super) fn judged(
    system: &StateSpace,
    innovation_covariance: Option<&DMatrix<f64>>,
    covariance: Option<&ParameterCovariance>,
    log: &Log,
    levels: &[f64],
    relation: Relation,
) -> Validation {
    let columns: Vec<Vec<f64>> = log
        .input_data
        .iter()
        .chain(&log.output_data)
        .enumerate()
        .map(|(i, column)| {
            let level = levels.get(i).copied().unwrap_or(0.0);
            column.iter().map(|v| v - level).collect()
        })
        .collect();
    let slices: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
    let (inputs, outputs) = slices.split_at(log.input_data.len());
    let records = [RecordView { inputs, outputs }];
    validate(
        system,
        innovation_covariance,
        covariance,
        &records,
        relation,
        &ValidationOptions::default(),
    )
    .unwrap()
}

pub(super) fn judged_fit(fit: &Fit, log: &Log, relation: Relation) -> Validation {
    judged(
        &fit.system,
        Some(&fit.innovation_covariance),
        Some(&fit.covariance),
        log,
        &fit.levels,
        relation,
    )
}

/// Runs `judge` for many seeds.
pub(super) fn study(runs: u64, judge: impl Fn(u64) -> Validation + Send + Sync) -> Vec<Validation> {
    (0..runs).into_par_iter().map(judge).collect()
}

/// Without its noise model.
pub(super) fn bare(test: &TestSystem) -> StateSpace {
    let mut system = test.system.clone();
    system.k.fill(0.0);
    system
}

/// [`servo`] with the gain whose predictor is stable and whose outputs have the same spectrum; that of
/// `servo` itself has a predictor pole at 1.0245.
pub(super) fn steady_servo() -> TestSystem {
    let mut test = servo();
    test.system.k = dmatrix![6.21094739; 5.92040503; 5.54387457];
    test.innovation_covariance = dmatrix![0.01049615];
    test
}

/// How often each test rejects at `level`, held against binomial bounds that a right test leaves once in a
/// thousand times.
pub(super) fn assert_level(name: &str, studies: &[Validation], tests: &[&str]) {
    for test in tests {
        let p_values: Vec<f64> = studies.iter().map(|v| p_value(v, test)).collect();
        for level in [0.05, 0.01] {
            let law = Binomial::new(level, studies.len() as u64).unwrap();
            let most = (0..).find(|&k| law.sf(k) < 1e-3).unwrap();
            let least = (0..).find(|&k| law.cdf(k) > 1e-3).unwrap();
            let found = p_values.iter().filter(|p| **p < level).count() as u64;
            println!("{name}: {test} at {level}: {found} of {}", studies.len());
            assert!(
                (least..=most).contains(&found),
                "{name}: {test} rejects {found} of {} times at level {level}; expected {least} to {most}",
                studies.len()
            );
        }
    }
}

fn p_value(validation: &Validation, test: &str) -> f64 {
    let of = |test: &Option<ResidualTest>| test.as_ref().map(|t| t.p_value);
    match test {
        "whiteness" => of(&validation.whiteness),
        "past inputs" => of(&validation.past_inputs),
        "linearity" => of(&validation.linearity),
        "same sample" => of(&validation.same_sample),
        "feedback" => of(&validation.feedback),
        "size" => validation.innovation_size.as_ref().map(|s| s.p_value),
        _ => None,
    }
    .unwrap()
}
