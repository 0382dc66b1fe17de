//! A linear plant by simulation error: a start for the fit of parameters.
//!
//! An identified model predicts one step ahead. On a recording with little noise and a plant that is not linear such a
//! model may be of high order, unstable or poor in simulation, and what it lacks would be called physics. The simulation
//! is taken as it is even so; but the refit that it is compared with may be of another order, chosen by regression (ARX)
//! refined by Steiglitz and McBride's iteration, judged by free simulation.

use nalgebra::DMatrix;

use super::autoregression::initial_states;
use crate::explain::linear::data::{Data, Segment};
use crate::explain::linear::model::linear_plant::Plant;
use crate::linalg::{eigenvalues, least_squares};

/// Highest order that is tried.
const MOST_ORDER: usize = 4;
/// Passes of the iteration.
const PASSES: usize = 6;
/// A higher order must lower the simulation error by this share: elbow, since misfit of a plant that is not linear
/// always falls a little with the order.
const WORTH: f64 = 0.08;
/// Poles are reflected into this circle.
const INSIDE: f64 = 0.9995;

/// The best plant of one input over `[u, 1]` and one output.
pub(crate) fn rebaseline(data: &Data) -> Option<Plant> {
    let mut best: Option<(f64, Plant)> = None;
    for order in 1..=MOST_ORDER {
        let own = of_order(data, order, 0, true)
            .into_iter()
            .min_by(|a, b| a.0.total_cmp(&b.0));
        let Some(own) = own else { continue };
        if best.as_ref().is_none_or(|b| own.0 < b.0 * (1.0 - WORTH)) {
            best = Some(own);
        }
    }
    best.map(|(_, plant)| plant)
}

/// All passes at one order and delay, with an operating point or about zero: `(relative simulation error, plant)`.
pub(crate) fn of_order(
    data: &Data,
    order: usize,
    delay: usize,
    operating_point: bool,
) -> Vec<(f64, Plant)> {
    let mut found = Vec::new();
    let mut denominator = vec![0.0; order];
    for pass in 0..=PASSES {
        let Some((a, b, constant)) = regression(
            data,
            order,
            delay,
            operating_point,
            if pass == 0 { &[] } else { &denominator },
        ) else {
            break;
        };
        denominator = stabilised(&a).unwrap_or(a);
        let plant = companion(&denominator, &b, constant, data.sample_time);
        let delayed = shifted(data, delay);
        if let Some((_, misfit)) = initial_states(&plant, &delayed) {
            found.push((misfit, plant));
        }
    }
    found
}

/// Least squares of `A(q) y_f = B(q) u_f + c`, signals filtered by the last denominator.
fn regression(
    data: &Data,
    order: usize,
    delay: usize,
    operating_point: bool,
    filter: &[f64],
) -> Option<(Vec<f64>, Vec<f64>, f64)> {
    let first = order + delay + 1;
    let rows: usize = data
        .segments
        .iter()
        .map(|s| s.samples().saturating_sub(first))
        .sum();
    if rows < 6 * (2 * order + 1) {
        return None;
    }
    let columns = 2 * order + usize::from(operating_point);
    let mut m = DMatrix::zeros(rows, columns);
    let mut t = DMatrix::zeros(rows, 1);
    let mut row = 0;
    for segment in &data.segments {
        let u = filtered(&segment.inputs[0], filter);
        let y = filtered(&segment.outputs[0], filter);
        let one = filtered(&vec![1.0; u.len()], filter);
        for k in first..u.len() {
            for i in 0..order {
                m[(row, i)] = -y[k - 1 - i];
                m[(row, order + i)] = u[k - 1 - delay - i];
            }
            if operating_point {
                m[(row, 2 * order)] = one[k];
            }
            t[(row, 0)] = y[k];
            row += 1;
        }
    }
    let c = least_squares(&m, &t).ok()?;
    c.iter().all(|v| v.is_finite()).then(|| {
        (
            (0..order).map(|i| c[(i, 0)]).collect(),
            (0..order).map(|i| c[(order + i, 0)]).collect(),
            if operating_point {
                c[(2 * order, 0)]
            } else {
                0.0
            },
        )
    })
}

/// `v / A(q)`.
fn filtered(v: &[f64], a: &[f64]) -> Vec<f64> {
    let mut out: Vec<f64> = Vec::with_capacity(v.len());
    for (k, v) in v.iter().enumerate() {
        let mut y = *v;
        for (i, a) in a.iter().enumerate().take(k) {
            y -= a * out[k - 1 - i];
        }
        out.push(y);
    }
    out
}

/// Denominator with its roots reflected into the circle.
fn stabilised(a: &[f64]) -> Option<Vec<f64>> {
    let n = a.len();
    let matrix = DMatrix::from_fn(n, n, |i, j| {
        if i == 0 {
            -a[j]
        } else if i == j + 1 {
            1.0
        } else {
            0.0
        }
    });
    let roots = eigenvalues(&matrix).ok()?;
    let mut polynomial = vec![num_complex::Complex64::new(1.0, 0.0)];
    for mut root in roots {
        let size = root.norm();
        if size > 1.0 {
            root /= size * size;
        }
        if root.norm() > INSIDE {
            root *= INSIDE / root.norm();
        }
        let mut next = polynomial.clone();
        next.push(num_complex::Complex64::new(0.0, 0.0));
        for (i, p) in polynomial.iter().enumerate() {
            next[i + 1] -= p * root;
        }
        polynomial = next;
    }
    Some(polynomial[1..].iter().map(|c| c.re).collect())
}

/// Observer form: `y[k] = sum -a_i y[k-i] + b_i u[k-i] + c`.
pub(super) fn companion(a: &[f64], b: &[f64], constant: f64, sample_time: f64) -> Plant {
    let n = a.len();
    let mut plant = Plant {
        states: n,
        inputs: 2,
        outputs: 1,
        a: vec![0.0; n * n],
        b: vec![0.0; 2 * n],
        c: vec![0.0; n],
        d: vec![0.0; 2],
        sample_time,
    };
    for i in 0..n {
        plant.a[i * n] = -a[i];
        if i + 1 < n {
            plant.a[i * n + i + 1] = 1.0;
        }
        plant.b[2 * i] = b[i];
    }
    plant.b[1] = constant;
    plant.c[0] = 1.0;
    plant
}

/// The data with the first input held back by `delay` samples.
pub(crate) fn shifted(data: &Data, delay: usize) -> Data {
    Data {
        segments: data
            .segments
            .iter()
            .map(|s| {
                let mut inputs = s.inputs.clone();
                inputs[0] = crate::explain::linear::data::delayed(&s.inputs[0], delay);
                Segment {
                    inputs,
                    ..s.clone()
                }
            })
            .collect(),
        ..data.clone()
    }
}
