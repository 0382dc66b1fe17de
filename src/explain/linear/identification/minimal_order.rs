//! The linear system of least order behind a column of simulated outputs.
//!
//! Regression of rounded outputs on themselves is biased, the more so the faster the sampling: orders rise until the
//! rounding is followed, an input that does nothing stands for a constant, and what such states do beside an effect is
//! nobody's physics. So each order is fitted by simulation error, without a level and with one, and the first that leaves
//! no more than the digits of the file is taken.

use super::autoregression::{Autoregression, Simulator, initial_states, of_order};
use super::steiglitz_mcbride::companion;
use crate::explain::effects;
use crate::explain::linear::data::Data;
use crate::explain::linear::fit::{Effort, Fit, Problem};
use crate::explain::linear::model::functionals::Signal;
use crate::explain::linear::model::linear_plant::Plant;
use crate::explain::linear::model::structure::without_effects::bare;
use crate::explain::linear::model::structure::{Direction, Instance, Structure};
use crate::linalg::least_squares;
use crate::noise::Colours;

/// Highest order that is tried.
const MOST_ORDER: usize = 8;
/// The misfit may be so many times that of rounding: some of it is the solver's.
const OF_ROUNDING: f64 = 2.0;
/// A misfit below this share of the output's deviation is that of a solver with its usual tolerances.
const SOLVER: f64 = 3e-6;
/// Samples that the order is chosen on, at most.
const MOST_SAMPLES: usize = 8000;
/// Decimals that a file may hold.
const MOST_DECIMALS: i32 = 12;

/// A simulator, and the level of each output that it is linear about.
pub(crate) struct Simplest {
    pub(crate) plant: Plant,
    pub(crate) initial: Vec<Vec<f64>>,
    pub(crate) level: Option<Vec<f64>>,
}

/// The simplest linear system that reproduces `data` (noise-free outputs) to their digits; `None` where none does.
pub(crate) fn simplest(data: &Data) -> Option<Simplest> {
    let mut short = data.clone();
    for segment in &mut short.segments {
        for channel in segment.inputs.iter_mut().chain(&mut segment.outputs) {
            channel.truncate(MOST_SAMPLES / data.segments.len().max(1));
        }
    }
    let scale = short.output_scale();
    let share: f64 = (0..short.outputs)
        .map(|o| {
            let digits: f64 = short
                .segments
                .iter()
                .map(|s| rounding(&s.outputs[o]))
                .fold(0.0, f64::max);
            (digits / scale[o]).powi(2)
        })
        .sum::<f64>()
        / short.outputs.max(1) as f64;
    let tolerance = (OF_ROUNDING * share.sqrt()).max(SOLVER);
    let silent = short
        .segments
        .iter()
        .all(|s| s.inputs.iter().flatten().all(|u| *u == 0.0));
    for order in 1..=MOST_ORDER {
        for level in [false, true] {
            let found = if silent {
                decay(&short, order, level)
            } else {
                forced(&short, order, level)
            };
            let Some((found, misfit)) = found.and_then(|start| fitted(&short, &start)) else {
                continue;
            };
            if misfit <= tolerance {
                return Some(whole(data, without_idle_inputs(&short, found, tolerance)));
            }
        }
    }
    None
}

/// With the initial states of the whole recordings.
fn whole(data: &Data, found: Simplest) -> Simplest {
    let about = less(data, found.level.as_deref());
    match initial_states(&found.plant, &about) {
        Some((initial, _)) => Simplest { initial, ..found },
        None => found,
    }
}

/// `data` less the levels of its outputs.
fn less(data: &Data, level: Option<&[f64]>) -> Data {
    let mut about = data.clone();
    for segment in &mut about.segments {
        for (y, level) in segment.outputs.iter_mut().zip(level.unwrap_or_default()) {
            y.iter_mut().for_each(|y| *y -= level);
        }
    }
    about
}

/// An order by regression, about a level or not.
fn forced(data: &Data, order: usize, level: bool) -> Option<Simplest> {
    let level = if level {
        Some(super::simulator_offset::level_at(data, order)?)
    } else {
        None
    };
    let Simulator { plant, initial, .. } = of_order(&less(data, level.as_deref()), order)?;
    // More states than there is an order come of rounding.
    (plant.states <= order * data.outputs).then_some(Simplest {
        plant,
        initial,
        level,
    })
}

/// A decay without any input, of one output.
fn decay(data: &Data, order: usize, level: bool) -> Option<Simplest> {
    if data.outputs != 1 {
        return None;
    }
    let Autoregression {
        regressors,
        targets,
        ..
    } = Autoregression::new(data, order, level)?;
    let (r, q) = (data.inputs, data.inputs + 1);
    let mut columns: Vec<usize> = (0..order).map(|i| r + i * q + r).collect();
    columns.extend(level.then(|| regressors.ncols() - 1));
    let solved = least_squares(&regressors.select_columns(&columns), &targets).ok()?;
    let a: Vec<f64> = (0..order).map(|i| -solved[(i, 0)]).collect();
    let sum: f64 = 1.0 + a.iter().sum::<f64>();
    let level = level.then(|| vec![solved[(order, 0)] / sum * data.output_scale()[0]]);
    if level.iter().flatten().any(|v| !v.is_finite()) {
        return None;
    }
    let form = companion(&a, &vec![0.0; order], 0.0, data.sample_time);
    let plant = Plant {
        inputs: r,
        b: vec![0.0; order * r],
        d: vec![0.0; r],
        ..form
    };
    let (initial, _) = initial_states(&plant, &less(data, level.as_deref()))?;
    Some(Simplest {
        plant,
        initial,
        level,
    })
}

/// The same by simulation error, and its misfit in standard deviations of the outputs.
fn fitted(data: &Data, start: &Simplest) -> Option<(Simplest, f64)> {
    let about = less(data, start.level.as_deref());
    let mut problem = Problem::new(&about);
    problem.colours = Colours::White;
    let mut structure = Structure {
        plant_free: true,
        initial_free: true,
        ..bare(&start.plant, &start.initial)
    };
    if start.level.is_some() {
        let offset = effects::find("sensor_offset", "")?;
        structure.adjusted = data.outputs;
        structure.effects = (0..data.outputs)
            .map(|channel| Instance {
                definition: offset,
                channel,
                signal: Signal::Output(channel),
                direction: Direction::Free,
            })
            .collect();
    }
    let theta = structure.given();
    let fit = Fit::run(&problem, structure, theta, None, Effort::FINAL)?;
    let misfit = problem.mean_square(&fit.residual).sqrt();
    let shift = fit.structure.effect_offset(0);
    let level = start.level.as_ref().map(|level| {
        level
            .iter()
            .enumerate()
            .map(|(o, level)| level + fit.theta[shift + o])
            .collect()
    });
    let initial = (0..data.segments.len())
        .map(|s| fit.structure.initial_state(&fit.theta, s).to_vec())
        .collect();
    let found = Simplest {
        plant: fit.structure.plant(&fit.theta),
        initial,
        level,
    };
    misfit.is_finite().then_some((found, misfit))
}

/// Takes the paths of inputs out that the simulation does not need: they would stand for what a missing input does.
fn without_idle_inputs(data: &Data, mut found: Simplest, tolerance: f64) -> Simplest {
    if data.inputs < 2 {
        return found;
    }
    for input in 0..data.inputs {
        let mut plant = found.plant.clone();
        for matrix in [&mut plant.b, &mut plant.d] {
            matrix
                .chunks_exact_mut(data.inputs)
                .for_each(|row| row[input] = 0.0);
        }
        let trial = Simplest {
            plant,
            initial: found.initial.clone(),
            level: found.level.clone(),
        };
        if let Some((without, misfit)) = fitted(data, &trial)
            && misfit <= tolerance
        {
            found = without;
        }
    }
    found
}

/// Root mean square of what rounding to the digits of a file has taken off: of each decade of size, the finest step. A decade of few
/// values may show fewer digits than the file has (`1` for 1.00000): those of other decades count, with as many decimals where these
/// are of larger values, and as many digits where they are of smaller ones.
fn rounding(column: &[f64]) -> f64 {
    let mut finest: Vec<(i32, i32)> = Vec::new();
    let decade = |v: f64| v.abs().log10().floor() as i32;
    for v in column.iter().filter(|v| **v != 0.0 && v.is_finite()) {
        let decimals = (-MOST_DECIMALS..=MOST_DECIMALS).find(|d| {
            let scaled = v * 10f64.powi(*d);
            scaled.round() != 0.0 && (scaled - scaled.round()).abs() <= 1e-9 * scaled.abs()
        });
        let decimals = decimals.unwrap_or(MOST_DECIMALS + 1);
        match finest.iter_mut().find(|(of, _)| *of == decade(*v)) {
            Some((_, most)) => *most = decimals.max(*most),
            None => finest.push((decade(*v), decimals)),
        }
    }
    let known = |of: i32| {
        let each = finest
            .iter()
            .map(|(other, most)| most - (of - other).max(0));
        each.max()
    };
    let squares: f64 = column
        .iter()
        .filter(|v| **v != 0.0)
        .filter_map(|v| known(decade(*v)))
        .map(|decimals| 10f64.powi(-2 * decimals) / 12.0)
        .sum();
    (squares / column.len().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explain::linear::fixtures::{recorded, spring};

    fn rounded(data: &mut Data, digits: i32) {
        for y in &mut data.segments[0].outputs[0] {
            let unit = 10f64.powi((y.abs().max(1e-9)).log10().floor() as i32 + 1 - digits);
            *y = (*y / unit).round() * unit;
        }
    }

    /// A mass on a spring in a file of six digits, about a level and not.
    #[test]
    fn rounding_makes_no_states() {
        let structure = spring(Vec::new());
        let mut data = recorded(&structure, &[], 3);
        let clean = structure.simulate(&[], &data).unwrap();
        for level in [0.0, 40.0] {
            data.segments[0].outputs[0] = clean[0].iter().map(|y| y + level).collect();
            rounded(&mut data, 6);
            let found = simplest(&data).expect("a linear simulator");
            assert_eq!(found.plant.states, 2, "{level}");
            assert_eq!(found.level.is_some(), level > 0.0);
        }
    }

    /// Beside an input that does nothing.
    #[test]
    fn an_input_that_does_nothing_has_no_path() {
        let structure = spring(Vec::new());
        let mut data = recorded(&structure, &[], 3);
        data.inputs = 2;
        let n = data.segments[0].samples();
        data.segments[0]
            .inputs
            .push((0..n).map(|k| 3.5 + (0.01 * k as f64).sin()).collect());
        let mut one = data.clone();
        one.inputs = 1;
        one.segments[0].inputs.truncate(1);
        data.segments[0].outputs = structure.simulate(&[], &one).unwrap();
        rounded(&mut data, 6);
        let found = simplest(&data).expect("a linear simulator");
        assert_eq!(found.plant.states, 2);
        assert!(found.plant.b_column(1).iter().all(|b| *b == 0.0));
    }

    #[test]
    fn digits_are_counted() {
        let three: Vec<f64> = (0..1000)
            .map(|k| (f64::from(k) * 1.2345).round() * 1e-3)
            .collect();
        let step = 1e-3 / 12f64.sqrt();
        assert!((rounding(&three) / step - 1.0).abs() < 0.05);
        // One value of a larger decade without a fraction, at three decimals and at three digits.
        let mut small: Vec<f64> = three.iter().map(|v| 0.1 + 0.7 * v.fract()).collect();
        small
            .iter_mut()
            .for_each(|v| *v = (*v * 1e3).round() * 1e-3);
        small[0] = 1.0;
        assert!((rounding(&small) / step - 1.0).abs() < 0.1);
    }

    #[test]
    fn a_decay_needs_no_input() {
        let mut data = recorded(&spring(Vec::new()), &[], 3);
        let n = data.segments[0].samples();
        data.segments[0].inputs[0].fill(0.0);
        data.segments[0].outputs[0] = (0..n).map(|k| 130.0 * 0.997f64.powi(k as i32)).collect();
        rounded(&mut data, 6);
        let found = simplest(&data).expect("a decay");
        assert_eq!((found.plant.states, found.level.is_some()), (1, false));
        assert!((found.plant.a[0] - 0.997).abs() < 1e-5);
    }
}
