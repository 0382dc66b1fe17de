//! Derivatives of an external simulator by differences of runs.

use std::sync::Arc;

use super::ExternalPlant;
use super::cache::Answer;
use super::step::{self, Change, Next, OutputNoise, PROBE, PROBES};
use crate::physics::simulated::{Run, Slopes};
use crate::physics::simulation::{Direction, Excitation};

/// Steps tried for one derivative.
const ATTEMPTS: usize = 4;
/// A difference to one side errs by the first power of its step, which is therefore this part of that of a central one.
const ONE_SIDED: f64 = 0.25;
/// A side that is shorter than this part of the other is left out: its rounding would count too much.
const SHORT: f64 = 0.2;

type Columns = Arc<Vec<Vec<f64>>>;

/// A parameter moved to both sides, within its bounds.
struct Moved {
    /// Place of the parameter.
    index: usize,
    /// Step as a part of the magnitude.
    relative: f64,
    up: f64,
    down: f64,
}

/// Derivatives of `runs`, which have the same parameters, with respect to `directions`.
pub(super) fn slopes(
    plant: &ExternalPlant,
    runs: &[Run],
    directions: &[Direction],
) -> Option<Vec<Slopes>> {
    let parameters: Vec<usize> = directions
        .iter()
        .map(|d| match d {
            Direction::Parameter(i) => Some(*i),
            // There are no states, and no observer.
            Direction::Start(_) | Direction::Gain(..) => None,
        })
        .collect::<Option<_>>()?;
    let values = &runs.first()?.point.parameters;
    let base = answers(plant, runs, std::slice::from_ref(values));
    let base: Vec<Columns> = base
        .into_iter()
        .next()?
        .into_iter()
        .collect::<Result<_, _>>()
        .ok()?;
    let noise = noise(plant, runs, values, &parameters, base.first()?);
    let mut found: Vec<Option<Vec<Vec<Vec<f64>>>>> = vec![None; parameters.len()];
    for attempt in 1..=ATTEMPTS {
        let open: Vec<usize> = (0..parameters.len())
            .filter(|&d| found[d].is_none())
            .collect();
        if open.is_empty() {
            break;
        }
        let moved: Vec<Moved> = open
            .iter()
            .map(|&d| place(plant, values, parameters[d], &noise))
            .collect();
        let points: Vec<Vec<f64>> = moved
            .iter()
            .flat_map(|m| {
                [m.up, -m.down].map(|by| {
                    let mut point = values.clone();
                    point[m.index] += by;
                    point
                })
            })
            .collect();
        let answers = answers(plant, runs, &points);
        for ((&d, m), ends) in open.iter().zip(&moved).zip(answers.chunks(2)) {
            let [up, down] = ends else { continue };
            let side = |answers: &[Answer], step: f64| -> Option<Vec<Columns>> {
                let columns: Result<Vec<Columns>, _> = answers.iter().cloned().collect();
                columns.ok().filter(|_| step > 0.0)
            };
            let (up, down) = (side(up, m.up), side(down, m.down));
            if up.is_none() && down.is_none() {
                if m.up > 0.0 || m.down > 0.0 {
                    return None;
                }
                // Its bounds leave it no room.
                found[d] = Some(nothing(&base));
                continue;
            }
            let (slope, change) = difference(&base, up.as_deref(), down.as_deref(), m, &noise);
            match step::judge(change, m.relative) {
                Next::Nothing => found[d] = Some(nothing(&base)),
                Next::Again(relative) => {
                    plant.lock().steps.remember(m.index, relative);
                    if attempt == ATTEMPTS {
                        found[d] = Some(slope);
                    }
                }
                Next::Take => found[d] = Some(slope),
            }
        }
    }
    // From parameter, recording, output to recording, output, parameter.
    let found: Vec<_> = found.into_iter().collect::<Option<_>>()?;
    Some(
        (0..runs.len())
            .map(|r| {
                (0..base[r].len())
                    .map(|o| found.iter().map(|of| of[r][o].clone()).collect())
                    .collect()
            })
            .collect(),
    )
}

/// Answers of all recordings at each point.
fn answers(plant: &ExternalPlant, runs: &[Run], points: &[Vec<f64>]) -> Vec<Vec<Answer>> {
    let asked: Vec<(Excitation, Vec<f64>)> = points
        .iter()
        .flat_map(|p| runs.iter().map(|r| (r.excitation, p.clone())))
        .collect();
    let answers = plant.answers(&asked);
    answers.chunks(runs.len()).map(<[Answer]>::to_vec).collect()
}

/// Noise of the outputs, measured once.
fn noise(
    plant: &ExternalPlant,
    runs: &[Run],
    values: &[f64],
    parameters: &[usize],
    base: &Columns,
) -> Vec<OutputNoise> {
    if let Some(known) = plant.lock().steps.noise.clone() {
        return known;
    }
    let points: Vec<Vec<f64>> = (1..=PROBES)
        .map(|k| {
            let mut point = values.to_vec();
            for &i in parameters {
                let (magnitude, (min, max)) = scale(plant, values, i);
                let by = PROBE * magnitude * k as f64;
                let room = PROBE * magnitude * PROBES as f64;
                if point[i] + room <= max {
                    point[i] += by;
                } else if point[i] - room >= min {
                    point[i] -= by;
                }
            }
            point
        })
        .collect();
    let probes: Vec<Answer> = answers(plant, &runs[..1], &points)
        .into_iter()
        .flatten()
        .collect();
    let found = step::noise(base, &probes);
    plant.lock().steps.noise = Some(found.clone());
    found
}

/// Magnitude and bounds of a parameter.
fn scale(plant: &ExternalPlant, values: &[f64], index: usize) -> (f64, (f64, f64)) {
    let variable = &plant.spec.variables[plant.spec.parameters()[index].index()];
    let (min, max) = (variable.min, variable.max);
    (
        step::magnitude(values[index], plant.nominal[index], min, max),
        (min, max),
    )
}

/// Where a parameter is moved to.
fn place(plant: &ExternalPlant, values: &[f64], index: usize, noise: &[OutputNoise]) -> Moved {
    let (magnitude, (min, max)) = scale(plant, values, index);
    let relative = plant
        .lock()
        .steps
        .relative
        .get(index)
        .copied()
        .flatten()
        .unwrap_or_else(|| step::first(noise));
    let step = relative * magnitude;
    let room = |room: f64| {
        if room < SHORT * step {
            0.0
        } else {
            step.min(room)
        }
    };
    let (mut up, mut down) = (room(max - values[index]), room(values[index] - min));
    if up == 0.0 {
        down *= ONE_SIDED;
    }
    if down == 0.0 {
        up *= ONE_SIDED;
    }
    // The bounds hold also where a sum is rounded.
    let inside = |v: f64| v.clamp(min, max);
    Moved {
        index,
        relative,
        up: inside(values[index] + up) - values[index],
        down: values[index] - inside(values[index] - down),
    }
}

/// The derivative from a run at one or both sides, and how much was seen: for each recording a column for each output.
fn difference(
    base: &[Columns],
    up: Option<&[Columns]>,
    down: Option<&[Columns]>,
    moved: &Moved,
    noise: &[OutputNoise],
) -> (Vec<Vec<Vec<f64>>>, Change) {
    let (u, d) = (moved.up, moved.down);
    // Weights of both ends and the middle: exact for a parabola.
    let (of_up, of_down) = match (up, down) {
        (Some(_), Some(_)) => (d / (u * (u + d)), -u / (d * (u + d))),
        (Some(_), None) => (1.0 / u, 0.0),
        _ => (0.0, -1.0 / d),
    };
    let both = up.is_some() && down.is_some();
    let mut change = Change::default();
    let (mut second, mut expected, mut count) = (0.0, 0.0, 0.0);
    let slope = base
        .iter()
        .enumerate()
        .map(|(r, base)| {
            base.iter()
                .enumerate()
                .map(|(o, middle)| {
                    let up = up.map(|c| c[r][o].as_slice());
                    let down = down.map(|c| c[r][o].as_slice());
                    let spread = noise[o].spread;
                    expected += 2.0 * middle.len() as f64 * (noise[o].error / spread).powi(2);
                    count += middle.len() as f64;
                    middle
                        .iter()
                        .enumerate()
                        .map(|(k, &m)| {
                            let above = up.map_or(0.0, |c| c[k] - m);
                            let below = down.map_or(0.0, |c| c[k] - m);
                            change.first += ((above - below) / spread).powi(2);
                            second += ((above + below) / spread).powi(2);
                            of_up * above + of_down * below
                        })
                        .collect()
                })
                .collect()
        })
        .collect();
    change.first /= count;
    change.noise = expected / count;
    change.second = both.then_some(second / count);
    (slope, change)
}

/// A parameter without influence.
fn nothing(base: &[Columns]) -> Vec<Vec<Vec<f64>>> {
    base.iter()
        .map(|columns| columns.iter().map(|c| vec![0.0; c.len()]).collect())
        .collect()
}
