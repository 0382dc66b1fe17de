//! What is added around the plant: inputs that effects need, and what effects add to the outputs themselves, which no
//! state of the plant knows of.

use crate::explain::effects::{CHARGE_ORDERS, Clock, charge};
use crate::explain::linear::data::Series;
use crate::explain::linear::model::continuous::moment_columns;
use crate::explain::linear::model::linear_plant::Plant;

/// The plant with the moments of its inputs as further inputs: all first ones, then all second ones.
pub(crate) fn with_moments(plant: &Plant) -> Plant {
    let columns = moment_columns(plant);
    let (n, r, l) = (plant.states, plant.inputs, plant.outputs);
    let mut wider = plant.clone();
    wider.inputs = 3 * r;
    wider.b = (0..n)
        .flat_map(|i| (0..3 * r).map(move |j| (i, j)))
        .map(|(i, j)| match j / r {
            0 => plant.b[i * r + j],
            degree => columns[j % r][degree - 1][i],
        })
        .collect();
    wider.d = (0..l)
        .flat_map(|o| (0..3 * r).map(move |j| (o, j)))
        .map(|(o, j)| if j < r { plant.d[o * r + j] } else { 0.0 })
        .collect();
    wider
}

/// Adds `c cos(2 pi f t) + s sin(2 pi f t)` to each output, `parts` being `c, s` of each.
pub(crate) fn add_sine(frequency: f64, parts: &[f64], clock: &Clock, outputs: &mut Series) {
    let turn = std::f64::consts::TAU * frequency;
    for (output, part) in outputs.iter_mut().zip(parts.chunks_exact(2)) {
        for (k, y) in output.iter_mut().enumerate() {
            let (s, c) = (turn * clock.time(k)).sin_cos();
            *y += part[0] * c + part[1] * s;
        }
    }
}

/// Adds a curve of the integral of `input` to each output.
pub(crate) fn add_charge(
    shape: &[f64],
    coefficients: &[f64],
    input: &[f64],
    clock: &Clock,
    outputs: &mut Series,
) {
    let mut integral = 0.0;
    for (k, u) in input.iter().enumerate() {
        let values = charge(shape, integral);
        for (output, c) in outputs
            .iter_mut()
            .zip(coefficients.chunks_exact(CHARGE_ORDERS))
        {
            output[k] += values.iter().zip(c).map(|(v, c)| v * c).sum::<f64>();
        }
        integral += u * clock.step;
    }
}

/// Adds the response of a second-order mode, `q+ = p q + (1 - |p|) u`, `y += a Re q + b Im q`.
pub(crate) fn add_mode(
    shape: &[f64],
    residues: &[f64],
    input: &[f64],
    clock: &Clock,
    outputs: &mut Series,
) {
    let w = std::f64::consts::TAU * shape[0] * clock.step;
    let damping = shape[1].min(0.999);
    let radius = (-damping * w).exp();
    let angle = w * (1.0 - damping * damping).sqrt();
    let (im, re) = (radius * angle.sin(), radius * angle.cos());
    let gain = 1.0 - radius;
    let (mut q_re, mut q_im) = (0.0, 0.0);
    for (k, u) in input.iter().enumerate() {
        for (output, residue) in outputs.iter_mut().zip(residues.chunks_exact(2)) {
            output[k] += residue[0] * q_re + residue[1] * q_im;
        }
        (q_re, q_im) = (re * q_re - im * q_im + gain * u, re * q_im + im * q_re);
    }
}
