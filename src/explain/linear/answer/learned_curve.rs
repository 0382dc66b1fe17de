//! The missing static law, learnt without a form: hats over one variable, entering as the input does.

use nalgebra::{DMatrix, DVector};

use crate::explain::effects;
use crate::explain::explanation::Curve;
use crate::explain::linear::fit::{Fit, Problem};
use crate::explain::linear::model::functionals::Signal;
use crate::explain::linear::screening::score_tests::Bench;

/// Knots of the curve.
const KNOTS: usize = 11;

/// The variable whose static law explains most of what `fit` leaves, and that law.
pub(crate) fn learn(
    problem: &Problem,
    fit: &Fit,
    inputs: &[String],
    outputs: &[String],
) -> Option<Curve> {
    let mut fit = fit.clone();
    let noise = fit.noise.clone();
    let sensitivities = fit.sensitivities(problem);
    let bench = Bench::new(problem, &fit, &noise, sensitivities)?;
    let data = problem.data;
    let mut best: Option<(f64, Curve)> = None;
    let active = fit.structure.coordinates.active_inputs.clone();
    let &drive = active.iter().find(|j| **j < data.signals())?;
    let mut variables: Vec<(String, Vec<Vec<f64>>)> = (0..data.signals())
        .map(|j| {
            (
                inputs[j].clone(),
                data.segments.iter().map(|s| s.inputs[j].clone()).collect(),
            )
        })
        .collect();
    for signals in bench.signals() {
        let Signal::Output(o) = signals.instance_signal else {
            continue;
        };
        variables.push((outputs[o].clone(), signals.position.clone()));
        variables.push((format!("d/dt {}", outputs[o]), signals.rate.clone()));
    }
    for (variable, values) in variables {
        let all: Vec<f64> = values.concat();
        let (low, high) = (
            effects::level(&all, 0.005, |v| v),
            effects::level(&all, 0.995, |v| v),
        );
        if high <= low || high.is_nan() || low.is_nan() {
            continue;
        }
        let knots: Vec<f64> = (0..KNOTS)
            .map(|i| low + (high - low) * i as f64 / (KNOTS - 1) as f64)
            .collect();
        let Some((gain, coefficients, covariance)) = bench.static_law(drive, &values, &knots)
        else {
            continue;
        };
        if best.as_ref().is_some_and(|(g, _)| *g >= gain) {
            continue;
        }
        // The plant's own gain is free, so the law is determined up to a straight line: it is taken off.
        let (value, std) = detrended(&knots, &coefficients, &covariance);
        let resembles = shapes(&knots, &value);
        best = Some((
            gain,
            Curve {
                variable,
                force: format!("force in the unit of {}", inputs[drive]),
                at: knots,
                value,
                std,
                fitted: Vec::new(),
                resembles,
            },
        ));
    }
    best.map(|(_, curve)| curve)
}

/// Values less their straight line, and standard deviations.
fn detrended(at: &[f64], value: &DVector<f64>, covariance: &DMatrix<f64>) -> (Vec<f64>, Vec<f64>) {
    let n = at.len();
    let line = DMatrix::from_fn(n, 2, |i, j| if j == 0 { 1.0 } else { at[i] });
    let projector = line.clone().pseudo_inverse(1e-12).map_or_else(
        |_| DMatrix::identity(n, n),
        |inverse| DMatrix::identity(n, n) - &line * inverse,
    );
    let flat = &projector * value;
    let spread = &projector * covariance * projector.transpose();
    (
        flat.iter().copied().collect(),
        (0..n).map(|i| spread[(i, i)].max(0.0).sqrt()).collect(),
    )
}

/// Correlation with textbook shapes, each less its straight line, best first.
fn shapes(at: &[f64], value: &[f64]) -> Vec<(String, f64)> {
    let half = at.iter().fold(0.0_f64, |m, v| m.max(v.abs())).max(1e-300);
    type Shape = (&'static str, fn(f64) -> f64);
    let list: [Shape; 8] = [
        ("dry friction (sign)", |x| if x > 0.0 { 1.0 } else { -1.0 }),
        ("square with sign", |x| x * x.abs()),
        ("square", |x| x * x),
        ("cube", |x| x * x * x),
        ("dead zone", |x| x - x.clamp(-0.3, 0.3)),
        ("saturation", |x| x.clamp(-0.6, 0.6)),
        ("one-sided stop", |x| (x - 0.6).max(0.0)),
        ("sine", |x| (2.0 * std::f64::consts::PI * x).sin()),
    ];
    let identity = DMatrix::identity(at.len(), at.len());
    let (own, _) = detrended(at, &DVector::from_column_slice(value), &identity);
    let norm = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let mut found: Vec<(String, f64)> = list
        .iter()
        .map(|(name, law)| {
            let shape = DVector::from_iterator(at.len(), at.iter().map(|x| law(x / half)));
            let (shape, _) = detrended(at, &shape, &identity);
            let product: f64 = own.iter().zip(&shape).map(|(a, b)| a * b).sum();
            let size = norm(&own) * norm(&shape);
            (
                (*name).to_owned(),
                if size > 0.0 { product / size } else { 0.0 },
            )
        })
        .collect();
    found.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
    found.truncate(3);
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each textbook shape is recognised on top of a straight line, also upside down.
    #[test]
    fn shapes_are_recognised() {
        let at: Vec<f64> = (-30..=30).map(|i| 0.2 * f64::from(i)).collect();
        type Law = fn(f64) -> f64;
        let laws: [(&str, Law); 8] = [
            ("dry friction (sign)", |x| if x > 0.0 { 1.0 } else { -1.0 }),
            ("square with sign", |x| x * x * x.signum()),
            ("square", |x| x.powi(2)),
            ("cube", |x| x.powi(3)),
            ("dead zone", |x| (x - 0.3).max(0.0) + (x + 0.3).min(0.0)),
            ("saturation", |x| {
                if x.abs() < 0.6 { x } else { 0.6 * x.signum() }
            }),
            ("one-sided stop", |x| if x > 0.6 { x - 0.6 } else { 0.0 }),
            ("sine", |x| (std::f64::consts::TAU * x).sin()),
        ];
        for (name, law) in laws {
            for size in [3.0, -0.02] {
                let value: Vec<f64> = at
                    .iter()
                    .map(|x| size * law(x / 6.0) + 0.7 * x - 0.2)
                    .collect();
                let found = shapes(&at, &value);
                assert_eq!(found[0].0, name, "{found:?}");
                assert!((found[0].1 - size.signum()).abs() < 1e-9, "{found:?}");
            }
        }
        // A straight line is none of them.
        assert!(shapes(&at, &vec![0.0; at.len()]).iter().all(|s| s.1 == 0.0));
    }
}
