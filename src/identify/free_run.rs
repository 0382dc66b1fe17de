//! The order of a recording that no linear model explains: by its free run.
//!
//! A recording with little noise of a plant that is not linear has no linear order: every further state follows the
//! nonlinear part of the motion a little better, and the evidence for it is beyond doubt, because noise is what
//! evidence is measured against. The singular values then hardly end, and a test against noise accepts nothing. What a
//! linear model can give there is the best linear approximation of the plant, and how good it is shows in free run: its
//! error is the nonlinear part, which is strongly correlated in time and so is worth far fewer samples than there are
//! (Bartlett 1946). By Schwarz's criterion with that many samples, states that only follow the nonlinear part do not pay.

use nalgebra::DVector;

use super::data::Data;
use super::delay::Aligner;
use super::error::IdentifyError;
use super::horizon;
use super::options::{Options, Order};
use super::order;
use super::pbsid_opt::{Weight, decompose, system_matrices};
use super::records::Records;
use super::select::{Windowed, automatic_weight};
use super::source::Source;
use super::stable::{largest_stable_radius, with_poles_inside};
use crate::linalg::spectral_radius;
use crate::model::StateSpace;

/// Orders that are run.
const ORDERS: [usize; 15] = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 15, 20, 25, 30];
/// From this proposal of the singular values on the free run is asked: plants of so many states are rare, and plants
/// that are not linear are not.
const MANY: usize = 15;
/// The free run overrules the singular values where it asks for this share of their order at most; else they were
/// right.
const FEW: f64 = 0.5;
/// Samples that are run, at most.
const LONGEST_RUN: usize = 200_000;
/// Lags over which the correlation of the error is summed.
const LAGS: usize = 500;

/// What the free runs say.
#[derive(Debug, Clone)]
pub struct LowOrder {
    /// The order.
    pub order: usize,
    /// Whether the model had to be made stable to be run.
    pub unstable: bool,
    /// Why.
    pub explanation: String,
}

/// The order by free run, when the singular values ask for many states; `None` when they do not, or when the free run
/// asks for many as well.
///
/// # Errors
/// When reading the recordings again fails, or the decomposition.
pub fn low_order(
    windowed: &Windowed,
    source: &mut Source,
    options: &Options,
) -> Result<Option<LowOrder>, IdentifyError> {
    let sample_time = source.sample_time();
    let (data, records) = source.parts();
    let Windowed { factor, varx } = windowed;
    if !matches!(options.order, Order::Auto) {
        return Ok(None);
    }
    let proposal = proposal(windowed, options)?;
    if proposal < MANY {
        return Ok(None);
    }
    let weight = options
        .weight
        .unwrap_or_else(|| automatic_weight(factor, varx));
    let radius = largest_stable_radius(varx.columns);
    let mut systems: Vec<(usize, StateSpace, bool)> = Vec::new();
    let future = horizon::future_for_order(factor.past, factor.outputs, ORDERS[0]);
    let decomposition = decompose(factor, varx, future, weight)?;
    for order in ORDERS {
        if order > decomposition.svd.largest_order() {
            break;
        }
        let map = decomposition.svd.state_map(order);
        let Ok(estimate) = system_matrices(factor, varx, &decomposition, map, sample_time) else {
            continue;
        };
        let system = estimate.system;
        let unstable = spectral_radius(&system.a)? > radius;
        let system = if unstable {
            match with_poles_inside(&system, radius) {
                Ok(inside) => inside,
                Err(_) => continue,
            }
        } else {
            system
        };
        systems.push((order, system, unstable));
    }
    let errors = free_runs(&systems, data, records)?;
    let size = |e: &Vec<Vec<f64>>| -> f64 { e.iter().flatten().map(|v| v * v).sum() };
    let Some((_, least)) = errors
        .iter()
        .map(|e| (size(e), e))
        .filter(|(s, _)| s.is_finite())
        .min_by(|a, b| a.0.total_cmp(&b.0))
    else {
        return Ok(None);
    };
    let independent: f64 = least.iter().map(|e| effective(e)).sum::<f64>().max(2.0);
    let parameters = |n: usize| (n * (factor.inputs + factor.outputs)) as f64;
    let best = systems
        .iter()
        .zip(&errors)
        .map(|((order, _, unstable), e)| {
            let criterion = independent * size(e).ln() + parameters(*order) * independent.ln();
            (criterion, *order, *unstable)
        })
        .filter(|(criterion, ..)| criterion.is_finite())
        .min_by(|a, b| a.0.total_cmp(&b.0));
    let Some((_, order, unstable)) = best.filter(|b| b.1 as f64 <= FEW * proposal as f64) else {
        return Ok(None);
    };
    Ok(Some(LowOrder {
        order,
        unstable,
        explanation: format!(
            "order {order}: the singular values ask for {proposal}, as they do for a plant that is not linear; of orders \
             1 to {} the free run asks for this one (its error is worth {independent:.0} independent samples)",
            systems.last().map_or(order, |s| s.0)
        ),
    }))
}

/// The order that the singular value criterion proposes.
fn proposal(windowed: &Windowed, options: &Options) -> Result<usize, IdentifyError> {
    let Windowed { factor, varx } = windowed;
    let largest = order::LARGEST_AUTOMATIC_ORDER;
    let future = options
        .future
        .unwrap_or_else(|| horizon::future_for_order_choice(factor.past, factor.outputs, largest))
        .min(factor.past);
    let canonical = decompose(factor, varx, future, Weight::Cva)?;
    let correlations =
        order::canonical_correlations(&canonical.svd.singular_values, factor.columns);
    let possible = canonical.svd.largest_order().min(future * factor.outputs);
    let evidence = order::singular_value_criterion(
        &correlations,
        factor.inputs,
        factor.outputs,
        factor.columns,
        possible.min(largest),
    );
    Ok(order::proposal(&evidence).unwrap_or(1))
}

/// Errors of the free runs from rest, in scaled units: one series an output for each system.
fn free_runs(
    systems: &[(usize, StateSpace, bool)],
    data: &Data,
    records: &mut dyn Records,
) -> Result<Vec<Vec<Vec<f64>>>, IdentifyError> {
    let outputs = records.outputs().len();
    let inputs = data.channels() - outputs;
    let mut errors = vec![vec![Vec::new(); outputs]; systems.len()];
    for experiment in 0..records.experiments() {
        let trend = data.trend(experiment).clone();
        let limit = LONGEST_RUN.min(records.kept_samples(experiment).max(1));
        let mut states: Vec<DVector<f64>> = systems
            .iter()
            .map(|(_, s, _)| DVector::zeros(s.states()))
            .collect();
        let mut at = 0;
        let mut aligner = Aligner::new(data.delays(), outputs);
        records.read(experiment, Some(limit), &mut |columns| {
            aligner.push(columns, &mut |columns| {
                let samples = columns.first().map_or(0, |c| c.len());
                let first = at;
                while at < first + samples {
                    let k = at - first;
                    let value = |c: usize| (columns[c][k] - trend.at(c, at)) / data.scale[c];
                    let u = DVector::from_fn(inputs, |j, _| value(j));
                    for (((_, system, _), x), e) in systems.iter().zip(&mut states).zip(&mut errors)
                    {
                        let y = &system.c * &*x + &system.d * &u;
                        for (o, e) in e.iter_mut().enumerate() {
                            e.push(value(inputs + o) - y[o]);
                        }
                        *x = &system.a * &*x + &system.b * &u;
                    }
                    at += 1;
                }
            });
        })?;
    }
    Ok(errors)
}

/// `N / sum rho^2`, the number of independent samples that a series is worth.
fn effective(series: &[f64]) -> f64 {
    let n = series.len();
    let variance: f64 = series.iter().map(|v| v * v).sum();
    let sum: f64 = (1..LAGS.min(n / 4))
        .map(|lag| {
            let r = series
                .iter()
                .zip(&series[lag..])
                .map(|(a, b)| a * b)
                .sum::<f64>()
                / variance.max(1e-300);
            // What chance adds to the sum is taken off.
            r * r - 1.0 / n as f64
        })
        .sum();
    n as f64 / (1.0 + 2.0 * sum.max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::records::MemoryRecords;
    use crate::log::{Channel, Log};
    use crate::moments::Detrend;
    use crate::systems::two_by_two;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;

    /// White errors count each; of an autoregression with coefficient a it is (1 - a^2) / (1 + a^2) of them.
    #[test]
    fn correlated_errors_count_less() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        let n = 20_000;
        for a in [0.0, 0.5, 0.9] {
            let mut state = 0.0;
            let series: Vec<f64> = (0..n)
                .map(|_| {
                    state = a * state + random.sample::<f64, _>(StandardNormal);
                    state
                })
                .collect();
            let expected = (1.0 - a * a) / (1.0 + a * a);
            let found = effective(&series) / n as f64;
            assert!(
                (found / expected - 1.0).abs() < 0.15,
                "{a}: {found} {expected}"
            );
        }
    }

    /// In whatever units it was recorded: the plant itself leaves nothing, another one does.
    #[test]
    fn free_runs_are_in_the_units_of_the_factors() {
        let truth = two_by_two().system;
        let units = [1e3, 0.02, 5.0, 1e-4];
        let wave = |rate: f64| -> Vec<f64> {
            (0..600)
                .map(|k| (rate * f64::from(k * k % 997)).sin())
                .collect()
        };
        let inputs = [wave(0.7), wave(1.3)];
        let outputs = truth.simulate(&[&inputs[0], &inputs[1]], None).unwrap();
        let in_units = |columns: &[Vec<f64>], units: &[f64]| -> Vec<Vec<f64>> {
            let of = columns.iter().zip(units);
            of.map(|(c, unit)| c.iter().map(|v| v * unit).collect())
                .collect()
        };
        let log = Log {
            name: "two by two".to_owned(),
            sample_time: 1.0,
            start_time: 0.0,
            inputs: vec![Channel::new("u1"), Channel::new("u2")],
            outputs: vec![Channel::new("y1"), Channel::new("y2")],
            input_data: in_units(&inputs, &units[..2]),
            output_data: in_units(&outputs, &units[2..]),
            sha256: None,
        };
        let logs = [log];
        let mut records = MemoryRecords::new(&logs).unwrap();
        let options = Options {
            detrend: Detrend::None,
            ..Options::default()
        };
        let data = Data::read(&mut records, &options, 20).unwrap();
        let mut scaled = truth.clone();
        let sizes: Vec<f64> = data.scale.iter().zip(units).map(|(s, u)| s / u).collect();
        for (mut column, size) in scaled.b.column_iter_mut().zip(&sizes[..2]) {
            column.scale_mut(*size);
        }
        for (mut row, size) in scaled.c.row_iter_mut().zip(&sizes[2..]) {
            row.scale_mut(1.0 / size);
        }
        let mut other = scaled.clone();
        other.b *= 1.1;
        let n = truth.states();
        let systems = [(n, scaled, false), (n, other, false)];
        let errors = free_runs(&systems, &data, &mut records).unwrap();
        let largest = |which: usize| {
            let all = errors[which].iter().flatten();
            all.fold(0.0_f64, |most, e| most.max(e.abs()))
        };
        assert!(largest(0) < 1e-9, "{}", largest(0));
        assert!(largest(1) > 1e-2, "{}", largest(1));
    }
}
