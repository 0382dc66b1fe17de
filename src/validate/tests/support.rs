//! Models and records for the tests of the whole judgement.

use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::covariance::ParameterCovariance;
use crate::identify::{Fit, MemoryRecords, Options, Order, fit};
use crate::log::Log;
use crate::model::StateSpace;
use crate::systems::TestSystem;
use crate::validate::{RecordView, Relation, Validation, ValidationOptions, validate};

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
