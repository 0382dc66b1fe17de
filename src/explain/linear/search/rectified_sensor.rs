//! A sensor that loses the sign, where the simulation was identified from its readings.
//!
//! A linear model of `|y|` is of no plant: neither its order nor its poles are those of what moves, and no single step
//! leads from it to the plant behind the sensor. So plants are identified again from readings that were given a sign,
//! and ranked together with the law that may come with them, since the law changes the order that fits best.
//!
//! The sign is guessed from the input, low-passed by one of several time constants; of what follows from each guess
//! that one is kept which explains the readings themselves best, and its own sign is the next guess.

use rayon::prelude::*;

use super::forward_selection::SECOND_GAIN;
use super::plausibility::sane;
use super::single_effects::{Ranked, second_effects};
use crate::explain::effects::{self, Definition};
use crate::explain::linear::data::{Data, Series};
use crate::explain::linear::fit::{Effort, Fit, Problem};
use crate::explain::linear::identification::steiglitz_mcbride::of_order;
use crate::explain::linear::model::functionals::Signal;
use crate::explain::linear::model::linear_plant::Plant;
use crate::explain::linear::model::structure::without_effects::bare;
use crate::explain::linear::model::structure::{Direction, Instance, Structure};
use crate::linalg::spectral_radius;

/// Times a reading must come down to zero for its sign to be asked for: once or twice is a beginning, or an end.
const VISITS: usize = 3;
/// Below zero, readings may go by so many typical changes a sample: noise does.
const BELOW: f64 = 3.0;
/// ... and not by more than this share of the largest.
const BELOW_SHARE: f64 = 0.05;
/// Orders of the plant behind the sensor.
const ORDERS: std::ops::RangeInclusive<usize> = 1..=5;
/// Time constants of the guess, in samples.
const GUESSES: [f64; 5] = [1.0, 3.0, 10.0, 30.0, 100.0];
/// How often the sign of what was found is the next guess.
const AGAIN: usize = 3;
/// Orders beside which a law is looked for in the whole library.
const SEARCHED: usize = 2;
/// Width of the knee of friction at the start, as a share of the typical speed. From 0.05 to 3 times the fitted width the
/// recorded drives arrive at the same numbers.
const KNEE: f64 = 0.5;

/// Whether readings look as if they had lost their sign: none is negative beyond noise, and they come down to zero
/// again and again. This only decides whether the question is asked.
pub(crate) fn applies(data: &Data) -> bool {
    if data.signals() != 1 || data.outputs != 1 {
        return false;
    }
    let (mut squares, mut count) = (0.0, 0.0);
    let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
    for y in data.outputs_as_series() {
        for pair in y.windows(2) {
            squares += (pair[1] - pair[0]).powi(2);
            count += 1.0;
        }
        least = y.iter().copied().fold(least, f64::min);
        most = y.iter().copied().fold(most, f64::max);
    }
    let change = (squares / f64::max(count, 1.0)).sqrt();
    if least < -BELOW * change || least < -BELOW_SHARE * most {
        return false;
    }
    // A visit ends when the reading has left by several changes.
    let visits: usize = data
        .outputs_as_series()
        .map(|y| {
            let (mut visits, mut inside) = (0, false);
            for y in y {
                if *y < change && !inside {
                    visits += 1;
                    inside = true;
                } else if *y > BELOW * change {
                    inside = false;
                }
            }
            visits
        })
        .sum();
    visits >= VISITS
}

/// Plants behind a rectifying sensor, alone and with one law each, fitted like any other explanation.
pub(crate) fn candidates(
    problem: &Problem,
    given: &Structure,
    allowed: &(dyn Fn(&Definition) -> bool + Sync),
) -> Vec<Ranked> {
    let data = problem.data;
    let Some(rectification) = effects::find("sensor_rectification", "").filter(|d| allowed(d))
    else {
        return Vec::new();
    };
    if !given.known.is_empty() || !applies(data) {
        return Vec::new();
    }
    let ranked = |fit: Fit| Ranked::new(problem, fit);
    let orders: Vec<usize> = ORDERS.collect();
    let mut alone: Vec<Ranked> = orders
        .par_iter()
        .filter_map(|order| {
            let structure = behind(data, *order, rectification)?;
            let theta = structure.given();
            fitted(problem, structure, theta).map(ranked)
        })
        .collect();
    alone.retain(|r| stable(&r.fit));
    alone.sort_by(|a, b| a.criterion.total_cmp(&b.criterion));
    let Some(best) = alone.first().map(|r| r.criterion) else {
        return Vec::new();
    };
    let mut both: Vec<Ranked> = effects::find("coulomb_friction", "smooth")
        .filter(|d| allowed(d))
        .map(|friction| {
            alone
                .par_iter()
                .filter_map(|r| with_friction(problem, &r.fit, friction).map(ranked))
                .collect()
        })
        .unwrap_or_default();
    let firsts: Vec<&Ranked> = alone.iter().take(SEARCHED).collect();
    both.extend(second_effects(problem, &firsts, allowed));
    both.retain(|r| best - r.criterion > SECOND_GAIN && stable(&r.fit) && sane(problem, &r.fit));
    alone.extend(both);
    alone
}

fn fitted(problem: &Problem, structure: Structure, theta: Vec<f64>) -> Option<Fit> {
    let fit = Fit::run(problem, structure, theta, None, Effort::FINAL)?;
    Fit::at(problem, fit.structure, fit.theta)
}

fn stable(fit: &Fit) -> bool {
    spectral_radius(&fit.structure.plant(&fit.theta).a_matrix()).is_ok_and(|radius| radius < 1.0)
}

/// The plant of this order that explains the readings best, with its sensor.
fn behind(data: &Data, order: usize, rectification: &'static Definition) -> Option<Structure> {
    let mut best: Option<(f64, Structure, Series)> = None;
    let consider = |sign: &Series, best: &mut Option<(f64, Structure, Series)>| -> bool {
        let mut better = false;
        for (error, structure, signed) in identified(data, order, sign) {
            if best.as_ref().is_none_or(|b| error < b.0) {
                *best = Some((error, structure, signed));
                better = true;
            }
        }
        better
    };
    for time in GUESSES {
        consider(&guessed(data, time), &mut best);
    }
    for _ in 0..AGAIN {
        let Some((_, _, signed)) = best.clone() else {
            break;
        };
        if !consider(&signed, &mut best) {
            break;
        }
    }
    best.map(|(_, mut structure, _)| {
        structure.plant_free = true;
        structure.initial_free = true;
        structure.effects.push(Instance {
            definition: rectification,
            channel: 0,
            signal: Signal::Output(0),
            direction: Direction::Free,
        });
        structure
    })
}

/// The input low-passed over `time` samples.
fn guessed(data: &Data, time: f64) -> Series {
    let keep = (-1.0 / time).exp();
    data.segments
        .iter()
        .map(|segment| {
            let mut slow = 0.0;
            segment.inputs[0]
                .iter()
                .map(|u| {
                    slow = keep * slow + (1.0 - keep) * u;
                    slow
                })
                .collect()
        })
        .collect()
}

/// Plants from readings with the signs of `sign`: squared error of the readings, plant, and its output with its sign.
fn identified(data: &Data, order: usize, sign: &Series) -> Vec<(f64, Structure, Series)> {
    let mut signed = data.clone();
    for (segment, sign) in signed.segments.iter_mut().zip(sign) {
        for (y, sign) in segment.outputs[0].iter_mut().zip(sign) {
            *y *= if *sign < 0.0 { -1.0 } else { 1.0 };
        }
    }
    let found = if data.constant {
        of_order(&signed, order, 0, false)
    } else {
        let mut wider = signed.clone();
        for segment in &mut wider.segments {
            segment.inputs.push(vec![1.0; segment.outputs[0].len()]);
        }
        wider.inputs += 1;
        wider.constant = true;
        let mut found = of_order(&wider, order, 0, false);
        for (_, plant) in &mut found {
            *plant = without_constant(plant);
        }
        found
    };
    found
        .into_iter()
        .filter_map(|(_, plant)| {
            let (initial, _) =
                crate::explain::linear::identification::autoregression::initial_states(
                    &plant, &signed,
                )?;
            let structure = bare(&plant, &initial);
            let output = structure.simulate(&[], data)?;
            let error = output
                .iter()
                .zip(data.outputs_as_series())
                .flat_map(|(s, y)| s.iter().zip(y))
                .map(|(s, y)| (y - s.abs()).powi(2))
                .sum::<f64>();
            error.is_finite().then_some((error, structure, output))
        })
        .collect()
}

/// The plant of the first of two inputs.
fn without_constant(plant: &Plant) -> Plant {
    let column = |m: &[f64]| m.iter().step_by(2).copied().collect();
    Plant {
        inputs: 1,
        b: column(&plant.b),
        d: column(&plant.d),
        ..plant.clone()
    }
}

/// `fit` with friction on the speed in front of the sensor, from none at all.
fn with_friction(problem: &Problem, fit: &Fit, friction: &'static Definition) -> Option<Fit> {
    let mut structure = fit.structure.clone();
    structure.effects.push(Instance {
        definition: friction,
        channel: 0,
        signal: Signal::Integral(0),
        direction: Direction::Free,
    });
    let squares = problem.data.outputs_as_series().flatten().map(|y| y * y);
    let speed = (squares.sum::<f64>() / problem.data.samples().max(1) as f64).sqrt();
    let mut theta = fit.theta.clone();
    theta.extend(std::iter::repeat_n(0.0, structure.states()));
    theta.push((KNEE * speed).max(friction.parameters[0].lower).ln());
    fitted(problem, structure, theta)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explain::linear::fixtures::{NOISE, SAMPLES, recorded, spring};

    #[test]
    fn the_plant_behind_is_judged_by_what_the_sensor_reads() {
        let mut data = recorded(&spring(Vec::new()), &[], 2);
        let sign = vec![data.segments[0].outputs[0].clone()];
        data.segments[0].outputs[0]
            .iter_mut()
            .for_each(|y| *y = y.abs());
        let noise = SAMPLES as f64 * NOISE * NOISE;
        let least = |sign: &Series| {
            identified(&data, 2, sign)
                .into_iter()
                .map(|(error, _, _)| error)
                .fold(f64::INFINITY, f64::min)
        };
        let right = least(&sign);
        assert!((0.8..1.3).contains(&(right / noise)), "{right} {noise}");
        // Without signs it is another plant.
        let wrong = least(&vec![vec![1.0; SAMPLES]]);
        assert!(wrong > 1.6 * noise, "{wrong} {noise}");
    }
}
