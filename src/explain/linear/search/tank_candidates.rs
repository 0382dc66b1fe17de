//! Tanks in place of the linear plant: the class `cascade` as a structure like any other.
//!
//! Its numbers are held by the effects `tank_outflow` and `overflow`, its levels are the state. The linear plant of such
//! a structure is what the tanks do near their mean levels: with it, features and places are judged as elsewhere.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::single_effects::Ranked;
use crate::explain::effects::{self, Definition};
use crate::explain::explanation::StatePrior;
use crate::explain::linear::cascade::{self, Cascade, CascadeFit, Number};
use crate::explain::linear::data::Data;
use crate::explain::linear::fit::{Effort, Fit, Problem};
use crate::explain::linear::model::coordinates::Coordinates;
use crate::explain::linear::model::functionals::Signal;
use crate::explain::linear::model::linear_plant::Plant;
use crate::explain::linear::model::structure::tank_simulation::{Tanks, number_of};
use crate::explain::linear::model::structure::{Direction, Instance, Structure};
use crate::linalg::Rows;

/// Step of the differences that the linear plant is taken from, as a share of the mean levels and of the mean input.
const DIFFERENCE: f64 = 1e-5;

/// Tanks that leave a larger mean square error than so many times another explanation's are not pursued: noise with colour
/// makes up for less.
const MOST_ERROR: f64 = 2.0;

/// Share of the samples in which a pump with a bias may stand still.
const MOST_IDLE: f64 = 0.1;

/// Tanks that could have made the recording, fitted like any other explanation. None where they cannot: the test for
/// that is a few passes over the samples. `others` are explanations of other classes.
pub(crate) fn candidates(
    problem: &Problem,
    given: &Structure,
    allowed: &(dyn Fn(&Definition) -> bool + Sync),
    others: &[&Fit],
) -> Vec<Ranked> {
    let data = problem.data;
    // Beside effects that a simulator has already, a plant of another class has no meaning.
    if data.signals() != 1 || data.outputs != 1 || !given.known.is_empty() {
        return Vec::new();
    }
    let most = others
        .iter()
        .map(|fit| problem.mean_square(&fit.residual))
        .fold(f64::INFINITY, f64::min)
        * problem.scale[0].powi(2)
        * MOST_ERROR;
    let Some(found) = found(problem, most) else {
        return Vec::new();
    };
    // Where outflows in proportion to the levels do as well, nothing speaks for tanks.
    if found.losses.outflow <= 0.0 || found.cascade.parts.pump_bias && idles(data, &found) {
        return Vec::new();
    }
    let brimless = {
        let mut other = found.clone();
        other.cascade.parts.upper_overflow = false;
        other.cascade.parts.lower_overflow = false;
        other
    };
    let mut forms = vec![two_tanks(data, &found), one_tank(data, &found)];
    if found.cascade.parts != brimless.cascade.parts {
        forms.extend([two_tanks(data, &brimless), one_tank(data, &brimless)]);
    }
    forms
        .into_iter()
        .flatten()
        .filter(|(structure, _)| structure.effects.iter().all(|e| allowed(e.definition)))
        .filter_map(|(structure, theta)| {
            let mut fit = Fit::run(problem, structure, theta, None, Effort::FINAL)?;
            fit.structure.coordinates = Arc::new(linearised(data, &fit.structure, &fit.theta));
            Some(Ranked::new(problem, fit))
        })
        .collect()
}

fn found(problem: &Problem, most: f64) -> Option<CascadeFit> {
    let records: Vec<(&[f64], &[f64])> = problem
        .data
        .segments
        .iter()
        .map(|s| (s.inputs[0].as_slice(), s.outputs[0].as_slice()))
        .collect();
    cascade::fit(&records, &problem.mask, most)
}

/// Whether the pump stands still in more of the recording than outliers make up. An input that is negative is a command
/// relative to an operating point: where half of it does nothing, the law is another one.
fn idles(data: &Data, found: &CascadeFit) -> bool {
    let (pump, bias) = (
        found.cascade.number(Number::Pump),
        found.cascade.number(Number::Bias),
    );
    let (mut still, mut n) = (0.0, 0.0);
    for u in data.segments.iter().flat_map(|s| &s.inputs[0]) {
        still += f64::from(u8::from(pump * u + bias <= 0.0));
        n += 1.0;
    }
    still > MOST_IDLE * n
}

/// The cascade as it was found.
fn two_tanks(data: &Data, found: &CascadeFit) -> Option<(Structure, Vec<f64>)> {
    let initial = found.initial.iter().map(|x| x.to_vec()).collect();
    structured(data, &found.cascade, "two tanks", initial)
}

/// One tank with the mean flow and the time constants of both together.
fn one_tank(data: &Data, found: &CascadeFit) -> Option<(Structure, Vec<f64>)> {
    let mut cascade = found.cascade;
    cascade.parts.upper_overflow = false;
    let number = |n: Number| found.cascade.number(n);
    let (mut roots, mut levels, mut n) = ([0.0; 2], 0.0, 0.0);
    for (segment, x) in data.segments.iter().zip(&found.initial) {
        for x in found.cascade.levels(&segment.inputs[0], *x) {
            roots = [0, 1].map(|i| roots[i] + x[i].max(0.0).sqrt());
            levels += x[1];
            n += 1.0;
        }
    }
    // About a level x the time constant is 2 sqrt(x)/d.
    let time = 2.0 * roots[0] / n / number(Number::UpperOutflow)
        + 2.0 * roots[1] / n / number(Number::LowerOutflow);
    let slower = 2.0 * roots[1] / n / time / number(Number::LowerOutflow);
    if !(slower.is_finite() && slower > 0.0 && levels > 0.0) {
        return None;
    }
    for flow in [
        Number::Pump,
        Number::LowerOutflow,
        Number::Inflow,
        Number::Bias,
    ] {
        cascade.numbers[flow as usize] *= slower;
    }
    let initial = found.initial.iter().map(|x| vec![x[1]]).collect();
    structured(data, &cascade, "one tank", initial)
}

/// A structure with the parts of `cascade`, and its numbers.
fn structured(
    data: &Data,
    cascade: &Cascade,
    tanks: &str,
    initial: Vec<Vec<f64>>,
) -> Option<(Structure, Vec<f64>)> {
    let parts = cascade.parts;
    let mut variant = tanks.to_owned();
    for (present, word) in [
        (parts.constant_inflow, ", inflow"),
        (parts.pump_bias, ", bias"),
    ] {
        if present {
            variant.push_str(word);
        }
    }
    let mut definitions = vec![effects::find("tank_outflow", &variant)?];
    match (parts.upper_overflow, parts.lower_overflow) {
        (true, true) => definitions.push(effects::find("overflow", "both")?),
        (true, false) => definitions.push(effects::find("overflow", "upper")?),
        (false, true) => definitions.push(effects::find("overflow", "lower")?),
        (false, false) => {}
    }
    let mut theta: Vec<f64> = initial.iter().flatten().copied().collect();
    for parameter in definitions.iter().flat_map(|d| d.parameters) {
        let (number, rate) = number_of(parameter.name)?;
        let value = cascade.number(number) / if rate { data.sample_time } else { 1.0 };
        theta.push(if parameter.logarithmic {
            value.max(parameter.lower).ln()
        } else {
            value
        });
    }
    let structure = Structure {
        coordinates: Arc::new(Coordinates::fixed(
            still(data, initial.first().map_or(0, Vec::len)),
            vec![0],
        )),
        plant_free: false,
        initial_free: true,
        initial,
        feedthrough_free: false,
        substeps: 1,
        recording: None,
        effects: definitions
            .into_iter()
            .map(|definition| Instance {
                definition,
                channel: 0,
                signal: Signal::Output(0),
                direction: Direction::Matched(0),
            })
            .collect(),
        known: Vec::new(),
        adjusted: 0,
    };
    let coordinates = Arc::new(linearised(data, &structure, &theta));
    Some((
        Structure {
            coordinates,
            ..structure
        },
        theta,
    ))
}

/// A plant of so many states that does nothing.
fn still(data: &Data, states: usize) -> Plant {
    Plant {
        states,
        inputs: data.inputs,
        outputs: 1,
        a: vec![0.0; states * states],
        b: vec![0.0; states * data.inputs],
        c: vec![0.0; states],
        d: vec![0.0; data.inputs],
        sample_time: data.sample_time,
    }
}

/// What the tanks do near their mean levels at the mean input; where there is a constant input, the operating point
/// enters through it.
fn linearised(data: &Data, structure: &Structure, theta: &[f64]) -> Coordinates {
    let tanks = Tanks::of(structure, theta, data.sample_time);
    let mean = mean_and_covariance(&all_states(data, structure, theta, &tanks)).0;
    let (mut sum, mut n) = (0.0, 0.0);
    for u in data.segments.iter().flat_map(|s| &s.inputs[tanks.pump]) {
        sum += u;
        n += 1.0;
    }
    let input = sum / f64::max(n, 1.0);
    let states = structure.states();
    let mut plant = still(data, states);
    let at = tanks.next(&mean, input);
    for j in 0..states {
        let step = DIFFERENCE * mean[j].max(f64::MIN_POSITIVE);
        let mut moved = mean.clone();
        moved[j] -= step;
        for (i, (a, b)) in at.iter().zip(tanks.next(&moved, input)).enumerate() {
            plant.a[i * states + j] = (a - b) / step;
        }
    }
    let step = DIFFERENCE * input.abs().max(1e-12);
    for (i, (a, b)) in at.iter().zip(tanks.next(&mean, input - step)).enumerate() {
        plant.b[i * data.inputs] = (a - b) / step;
        if data.constant {
            let linear: f64 = (0..states)
                .map(|j| plant.a[i * states + j] * mean[j])
                .sum::<f64>()
                + plant.b[i * data.inputs] * input;
            plant.b[i * data.inputs + data.inputs - 1] = a - linear;
        }
    }
    plant.c[states - 1] = 1.0;
    Coordinates::fixed(plant, vec![0])
}

/// The levels at all samples.
fn all_states(data: &Data, structure: &Structure, theta: &[f64], tanks: &Tanks) -> Vec<Vec<f64>> {
    data.segments
        .iter()
        .enumerate()
        .flat_map(|(s, segment)| {
            let start = tanks.initial(structure.initial_state(theta, s));
            tanks.cascade.levels(&segment.inputs[tanks.pump], start)
        })
        .map(|levels| tanks.state(levels))
        .collect()
}

fn mean_and_covariance(states: &[Vec<f64>]) -> (Vec<f64>, DMatrix<f64>) {
    let n = states.first().map_or(0, Vec::len);
    let count = states.len().max(1) as f64;
    let mut mean = DVector::zeros(n);
    for x in states {
        mean += DVector::from_column_slice(x) / count;
    }
    let mut covariance = DMatrix::zeros(n, n);
    for x in states {
        let e = DVector::from_column_slice(x) - &mean;
        covariance += &e * e.transpose() / count;
    }
    (mean.iter().copied().collect(), covariance)
}

/// Where the levels were in the recording, and how closely the recorded one was met: what is known of the levels at the
/// beginning of another recording. The upper level is seen only through the lower one, and ends far outside without.
pub(crate) fn prior(data: &Data, fit: &Fit) -> Option<StatePrior> {
    if !fit.structure.is_tanks() {
        return None;
    }
    let tanks = Tanks::of(&fit.structure, &fit.theta, data.sample_time);
    let (mean, mut covariance) =
        mean_and_covariance(&all_states(data, &fit.structure, &fit.theta, &tanks));
    let squares = fit.residual.iter().flatten().map(|e| e * e);
    let count = fit.residual.iter().map(Vec::len).sum::<usize>().max(1) as f64;
    let variance = squares.sum::<f64>() / count;
    // Levels of no spread still have that of the errors.
    for i in 0..mean.len() {
        covariance[(i, i)] += variance.max(f64::MIN_POSITIVE);
    }
    Some(StatePrior {
        mean,
        covariance: Rows(covariance),
        error_std: variance.sqrt(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explain::linear::cascade::{Law, Losses, Parts};
    use crate::explain::linear::data::Segment;

    /// A pump of flow 0.5 a volt, and 1 at none, that stands still below -2.
    fn still(share: f64) -> bool {
        let n = 400;
        let inputs: Vec<f64> = (0..n)
            .map(|k| {
                if (k as f64) < share * n as f64 {
                    -3.0
                } else {
                    2.0
                }
            })
            .collect();
        let data = Data {
            segments: vec![Segment {
                inputs: vec![inputs],
                outputs: vec![vec![1.0; n]],
                start_time: 0.0,
            }],
            sample_time: 1.0,
            inputs: 1,
            outputs: 1,
            constant: false,
        };
        let parts = Parts {
            law: Law::Root,
            upper_overflow: false,
            lower_overflow: false,
            constant_inflow: false,
            pump_bias: true,
        };
        let found = CascadeFit {
            cascade: Cascade {
                parts,
                numbers: [0.5, 0.1, 0.1, 0.0, 0.0, 0.0, 0.0, 1.0],
            },
            deviations: [0.0; 8],
            initial: vec![[1.0; 2]],
            error: 0.1,
            count: n,
            free: 4,
            losses: Losses {
                outflow: 100.0,
                overflow: 0.0,
                upper_overflow: 0.0,
                exchange: f64::INFINITY,
            },
        };
        idles(&data, &found)
    }

    #[test]
    fn a_pump_that_stands_still_most_of_the_time_is_none() {
        assert!(!still(0.0) && !still(0.9 * MOST_IDLE));
        assert!(still(1.1 * MOST_IDLE) && still(0.5));
    }
}
