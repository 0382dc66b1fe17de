//! One output's equation: linear terms, and the nonlinear functions that leave least, added one by one or two together.

use nalgebra::DMatrix;

use super::drop_coefficients::eliminate;
use super::filtered_signals::{Part, Regressors, Signal, Signals};

/// Most nonlinear functions of an equation.
const MOST_FUNCTIONS: usize = 3;
/// Functions that are best alone; each is also tried with every other one.
const BEST: usize = 8;
/// A function is taken that leaves at most this part of the error; of two together each must.
const HELPS: f64 = 0.5;
/// Error that interpolation between samples leaves: nothing is looked for below it.
const EXACT: f64 = 2e-5;
/// A column is dependent on others when less than this part of its length is left beside them.
const DEPENDENT: f64 = 1e-5;

/// `D^order y = sum of coefficient * D^k signal`.
#[derive(Debug, Clone)]
pub(super) struct OutputEquation {
    pub(super) order: usize,
    /// Signal, derivative and coefficient.
    pub(super) terms: Vec<(usize, usize, f64)>,
    /// Norm of what is left, over that of the left-hand side.
    pub(super) error: f64,
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn less(v: &mut [f64], q: &[f64]) {
    let along = dot(v, q);
    v.iter_mut().zip(q).for_each(|(v, q)| *v -= along * q);
}

/// What is left of a column beside orthonormal ones. Twice is enough (Giraud, Langou and Rozloznik, *Numerische Mathematik* 101,
/// 2005).
fn beside(column: &[f64], orthonormal: &[Vec<f64>]) -> Vec<f64> {
    let mut v = column.to_vec();
    for _ in 0..2 {
        orthonormal.iter().for_each(|q| less(&mut v, q));
    }
    v
}

/// At unit length; none where the column was dependent on what was subtracted from it.
fn unit(mut v: Vec<f64>) -> Option<Vec<f64>> {
    let length = dot(&v, &v).sqrt();
    if length.is_nan() || length < DEPENDENT {
        return None;
    }
    v.iter_mut().for_each(|v| *v /= length);
    Some(v)
}

/// Columns orthogonalised one after the other, with what is left of a target.
struct Basis<'a> {
    regressors: &'a Regressors,
    orthonormal: Vec<Vec<f64>>,
    /// Columns that were independent.
    columns: Vec<usize>,
    rest: Vec<f64>,
}

/// What a function adds to a basis, and what it leaves of the target.
#[derive(Clone)]
struct Addition {
    orthonormal: Vec<Vec<f64>>,
    rest: Vec<f64>,
}

impl Addition {
    /// With more columns, which are orthogonal to the basis.
    fn and(&self, columns: &[Vec<f64>]) -> Self {
        let mut more = self.clone();
        for column in columns {
            if let Some(q) = unit(beside(column, &more.orthonormal)) {
                less(&mut more.rest, &q);
                more.orthonormal.push(q);
            }
        }
        more
    }

    fn error(&self) -> f64 {
        dot(&self.rest, &self.rest).sqrt()
    }
}

impl Basis<'_> {
    fn add(&mut self, column: usize) {
        let left = beside(&self.regressors.columns[column], &self.orthonormal);
        if let Some(q) = unit(left) {
            less(&mut self.rest, &q);
            self.orthonormal.push(q);
            self.columns.push(column);
        }
    }

    fn nothing(&self) -> Addition {
        Addition {
            orthonormal: vec![],
            rest: self.rest.clone(),
        }
    }

    fn error(&self) -> f64 {
        dot(&self.rest, &self.rest).sqrt()
    }

    /// Coefficients of the columns, by back substitution.
    fn coefficients(&self, target: &[f64]) -> Vec<f64> {
        let mut values: Vec<f64> = self.orthonormal.iter().map(|q| dot(target, q)).collect();
        for i in (0..values.len()).rev() {
            let q = &self.orthonormal[i];
            for k in i + 1..values.len() {
                values[i] -= values[k] * dot(&self.regressors.columns[self.columns[k]], q);
            }
            values[i] /= dot(&self.regressors.columns[self.columns[i]], q);
        }
        values
    }
}

/// Whether a function can stand on the right: it must be of what the states determine.
fn allowed(signal: &Signal, orders: &[usize]) -> bool {
    match signal {
        Signal::Function(_, parts) => parts.iter().all(|part| match part {
            Part::Output(j) => orders[*j] > 0,
            Part::Rate(j) => orders[*j] > 1,
            Part::Input(_) => true,
        }),
        _ => true,
    }
}

/// The equation of an output where those of all outputs have these orders.
pub(super) fn output_equation(
    signals: &Signals,
    regressors: &Regressors,
    output: usize,
    orders: &[usize],
) -> OutputEquation {
    let order = orders[output];
    let target_column = regressors.column(output, order);
    let target = &regressors.columns[target_column];
    let mut linear: Vec<usize> = regressors.transients().collect();
    let mut functions: Vec<Vec<usize>> = Vec::new();
    for (s, signal) in signals.all.iter().enumerate() {
        let derivatives: Vec<usize> = match signal {
            Signal::Output(j) => (0..orders[*j])
                .filter(|&k| *j != output || k < order)
                .collect(),
            Signal::Input(_) => (0..=order).collect(),
            Signal::One => vec![0],
            Signal::Function(..) if allowed(signal, orders) => (0..order.max(1)).collect(),
            Signal::Function(..) => continue,
        };
        let columns = derivatives.into_iter().map(|k| regressors.column(s, k));
        match signal {
            Signal::Function(..) => functions.push(columns.collect()),
            _ => linear.extend(columns),
        }
    }
    let mut basis = Basis {
        regressors,
        orthonormal: vec![],
        columns: vec![],
        rest: target.clone(),
    };
    // Relative to what the transients leave of it: a constant is no success.
    linear.iter().for_each(|&c| basis.add(c));
    let mut taken = 0;
    while taken < MOST_FUNCTIONS && basis.error() > EXACT && !functions.is_empty() {
        let left: Vec<Vec<Vec<f64>>> = functions
            .iter()
            .map(|g| {
                let columns = g.iter().map(|&c| &regressors.columns[c]);
                columns.map(|c| beside(c, &basis.orthonormal)).collect()
            })
            .collect();
        let nothing = basis.nothing();
        let alone: Vec<Addition> = left.iter().map(|g| nothing.and(g)).collect();
        let mut single: Vec<(f64, usize)> = alone
            .iter()
            .enumerate()
            .map(|(g, addition)| (addition.error(), g))
            .collect();
        single.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
        if taken + 2 <= MOST_FUNCTIONS && single[0].0 > EXACT {
            for &(_, g) in single.iter().take(BEST) {
                for h in (0..functions.len()).filter(|&h| h != g) {
                    pairs.push((alone[g].and(&left[h]).error(), g, h));
                }
            }
        }
        let pair = pairs.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
        let now = basis.error();
        let chosen = match (single[0], pair) {
            ((alone, g), Some((both, ..)))
                if alone < HELPS * now && both > HELPS * HELPS * alone =>
            {
                vec![g]
            }
            (_, Some((both, g, h))) if both < HELPS * HELPS * now => vec![g, h],
            ((alone, g), _) if alone < HELPS * now => vec![g],
            _ => break,
        };
        for &g in &chosen {
            functions[g].iter().for_each(|&c| basis.add(c));
        }
        taken += chosen.len();
        functions = functions
            .into_iter()
            .enumerate()
            .filter_map(|(i, f)| (!chosen.contains(&i)).then_some(f))
            .collect();
    }
    let coefficients = basis.coefficients(target);
    let error = basis.error();
    let information = DMatrix::from_fn(coefficients.len(), coefficients.len(), |i, j| {
        let column = |i: usize| &regressors.columns[basis.columns[i]];
        dot(column(i), column(j))
    });
    let whole = || coefficients.iter().copied().enumerate().collect();
    let kept = eliminate(
        &information,
        &coefficients,
        error.powi(2) + EXACT.powi(2),
        |_| true,
    )
    .unwrap_or_else(whole);
    let scale = regressors.scale[target_column];
    let per_signal = regressors.column(1, 0);
    let terms = kept
        .into_iter()
        .map(|(i, value)| (basis.columns[i], value))
        .filter(|(c, _)| !regressors.transients().contains(c))
        .map(|(c, value)| {
            let value = value * scale / regressors.scale[c].max(f64::MIN_POSITIVE);
            (c / per_signal, c % per_signal, value)
        })
        .collect();
    OutputEquation {
        order,
        terms,
        error,
    }
}
