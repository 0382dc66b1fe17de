//! Long recordings: effects are searched for in a part of their samples, and what is found is fitted to all of them.

use crate::explain::engine::fitting::fitted::{Fitted, with_more};
use crate::explain::engine::holdout::{Estimator, all_free};
use crate::explain::engine::search::Found;
use crate::explain::engine::thresholds::{MOST_STEPS, ROUNDS, THOROUGH, limited};
use crate::physics::estimate::{EstimateOptions, Fit, Form, PlantRecording, Study};
use crate::physics::{Hold, Plant};

/// Samples that are searched: more than twice as many as a name needs (250 to 2000, math/explain.md).
const SEARCHED: usize = 5000;
/// Recordings with up to this part more are searched whole.
const LITTLE_MORE: f64 = 0.25;
/// Where few samples were measured, they are searched whole, with up to so many times more between them.
const MOST_BETWEEN: usize = 5;
/// What samples between those that are kept would add must be less than this part: of the variance of an input, and of the
/// mean square of what the simulation leaves.
const NEGLIGIBLE: f64 = 0.01;
const ROUNDING: f64 = 1e-12;

/// The samples that are searched.
#[derive(Debug, Clone)]
pub(crate) struct Part {
    pub(crate) recordings: Vec<PlantRecording>,
    /// Every so many samples is one of them; of stretches 1.
    pub(crate) every: usize,
}

/// What the summary says of a search in a part of the samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Searched {
    pub(crate) every: usize,
    pub(crate) samples: usize,
}

impl Part {
    pub(crate) fn searched(&self) -> Searched {
        Searched {
            every: self.every,
            samples: self.recordings.iter().map(PlantRecording::samples).sum(),
        }
    }
}

/// The part of recordings that is searched: every so many samples, where those between add nothing, and otherwise the stretch of
/// each in which the outputs go furthest. None where recordings are short.
pub(crate) fn part(plant: &Plant, recordings: &[PlantRecording], hold: Hold) -> Option<Part> {
    let all: usize = recordings.iter().map(PlantRecording::samples).sum();
    let measured: usize = recordings.iter().map(|r| r.measured().len()).sum();
    let little = |samples: usize| samples as f64 <= (1.0 + LITTLE_MORE) * SEARCHED as f64;
    if little(all) || little(measured) && all <= MOST_BETWEEN * SEARCHED {
        return None;
    }
    let every = all.div_ceil(SEARCHED);
    let thinned = thinned(recordings, every, hold)
        .filter(|thinned| as_before(plant, recordings, thinned, every, hold) == Some(true));
    Some(match thinned {
        Some(recordings) => Part { recordings, every },
        None => Part {
            recordings: stretches(plant, recordings, all),
            every: 1,
        },
    })
}

/// Every so many samples, with the mean of the inputs for as long as each stands; none where an input varies meanwhile.
fn thinned(recordings: &[PlantRecording], every: usize, hold: Hold) -> Option<Vec<PlantRecording>> {
    // A held input acts after its sample, one that is interpolated on both sides of it.
    let before = match hold {
        Hold::Zero => 0,
        Hold::Linear => every / 2,
    };
    let each = recordings.iter().map(|r| {
        let n = r.samples();
        let kept = (0..n).step_by(every);
        let means = |u: &Vec<f64>| {
            let span = |k: usize| &u[k.saturating_sub(before)..(k + every - before).min(n)];
            let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
            let means: Vec<f64> = kept.clone().map(|k| mean(span(k))).collect();
            let within = kept.clone().zip(&means).map(|(k, m)| {
                let squares = span(k).iter().map(|u| (u - m).powi(2));
                squares.sum::<f64>()
            });
            let level = mean(u);
            let total: f64 = u.iter().map(|u| (u - level).powi(2)).sum();
            // A constant varies by what its mean is rounded by.
            let rounding = u.iter().map(|u| (ROUNDING * u).powi(2)).sum::<f64>();
            (within.sum::<f64>() <= NEGLIGIBLE * total + rounding).then_some(means)
        };
        Some(PlantRecording {
            inputs: r.inputs.iter().map(means).collect::<Option<_>>()?,
            outputs: r
                .outputs
                .iter()
                .map(|y| y.iter().copied().step_by(every).collect())
                .collect(),
            sample_time: r.sample_time * every as f64,
            start_time: r.start_time,
        })
    });
    each.collect()
}

/// Whether the plant, fitted to the thinned recordings, runs over these as over all samples, compared with what it leaves of them;
/// none where it does not run. Values of the text may leave so much that any difference were little.
fn as_before(
    plant: &Plant,
    recordings: &[PlantRecording],
    thinned: &[PlantRecording],
    every: usize,
    hold: Hold,
) -> Option<bool> {
    let options = all_free(plant, hold, Estimator::FreeRun);
    let study = Study::new(plant, thinned, &options).ok()?;
    let points = study.points(&study.least_squares(&study.nominal())?);
    let outputs = recordings.first()?.outputs.len();
    let mut changed = vec![0.0; outputs];
    let mut left = vec![0.0; outputs];
    for ((r, t), point) in recordings.iter().zip(thinned).zip(&points) {
        let run = |r: &PlantRecording| r.run(plant, point, hold).ok();
        let (whole, few) = (run(r)?, run(t)?);
        for o in 0..outputs {
            let pairs = whole[o].iter().step_by(every).zip(&few[o]);
            for ((s, f), y) in pairs.zip(&t.outputs[o]).filter(|(_, y)| y.is_finite()) {
                changed[o] += (s - f).powi(2);
                left[o] += (s - y).powi(2);
            }
        }
    }
    let mut each = changed.iter().zip(&left);
    Some(each.all(|(changed, left)| *changed <= NEGLIGIBLE * left))
}

/// The stretch of each recording in which the outputs go furthest; the first one where states start as the text says.
fn stretches(plant: &Plant, recordings: &[PlantRecording], all: usize) -> Vec<PlantRecording> {
    let spec = &plant.spec;
    let fixed = spec.states().iter().any(|&v| spec.variable(v).fixed);
    let range = |y: &[f64]| {
        let known = y.iter().filter(|y| y.is_finite());
        let (low, high) = known.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &y| {
            (low.min(y), high.max(y))
        });
        (high - low).max(0.0)
    };
    let each = recordings.iter().map(|r| {
        let n = r.samples();
        let length = (n * SEARCHED).div_ceil(all).min(n);
        let starts = (0..=n - length).step_by((length / 4).max(1));
        let travelled = |from: usize| -> f64 {
            let each = r.outputs.iter();
            each.map(|y| range(&y[from..from + length]) / range(y).max(f64::MIN_POSITIVE))
                .sum()
        };
        let mut best = (travelled(0), 0);
        for from in starts.skip(1).filter(|_| !fixed) {
            let travelled = travelled(from);
            if travelled > best.0 {
                best = (travelled, from);
            }
        }
        let from = best.1;
        let cut = |columns: &[Vec<f64>]| -> Vec<Vec<f64>> {
            let each = columns.iter();
            each.map(|c| c[from..from + length].to_vec()).collect()
        };
        PlantRecording {
            inputs: cut(&r.inputs),
            outputs: cut(&r.outputs),
            start_time: r.start_time + from as f64 * r.sample_time,
            ..*r
        }
    });
    each.collect()
}

impl Found {
    /// Everything that the answer uses, fitted to all samples. None where that fails.
    pub(crate) fn on_all(mut self, recordings: &[PlantRecording], part: &Part) -> Option<Self> {
        let refit = |plant: &Plant, fit: &Fit, options: &EstimateOptions| -> Option<Fit> {
            let own = Study::new(plant, recordings, options).ok()?;
            let limited = limited(plant.clone(), &own, MOST_STEPS);
            let study = own.of(&limited, options).ok()?;
            let mut point = study.nominal();
            // Thinned recordings start where all samples do.
            let known = if part.every > 1 {
                point.len()
            } else {
                study.parameters()
            };
            point[..known].copy_from_slice(&fit.point[..known]);
            if fit.form == Form::Innovation {
                point.extend(&fit.point[fit.point.len().checked_sub(study.gains())?..]);
            }
            let from = Fit {
                point,
                ..fit.clone()
            };
            study.refit(&from, ROUNDS, THOROUGH)
        };
        let mut options = self.options.clone();
        options.free.truncate(self.given.spec.parameters().len());
        let own = |f: &mut Fitted, options: &EstimateOptions| {
            let with = with_more(options, f.candidate.values.len());
            f.fit = refit(&f.candidate.plant, &f.fit, &with)?;
            Some(with)
        };
        for trial in &mut self.trials {
            if let Some(f) = &mut trial.alone {
                own(f, &options)?;
            }
        }
        self.baseline = refit(&self.given, &self.baseline, &options)?;
        for step in self.steps.iter_mut().take(self.accepted) {
            options = own(step.first_mut()?, &options)?;
        }
        self.fit = refit(&self.plant, &self.fit, &self.options)?;
        self.part = Some(part.searched());
        self.held_out = None;
        Some(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::parse;

    const LAG: &str = "model Lag
  parameter Real T = 5; input Real u; output Real y; Real x(start=1);
equation
  T*der(x) = u - x; y = x;
end Lag;
";

    /// A ramp with a jump at 0.7 of it; the input changes after so many samples.
    fn recording(samples: usize, held: usize) -> PlantRecording {
        let at = |k: usize| k as f64 / samples as f64;
        PlantRecording {
            inputs: vec![
                (0..samples)
                    .map(|k| ((k / held * 7) % 5) as f64 - 2.0)
                    .collect(),
            ],
            outputs: vec![
                (0..samples)
                    .map(|k| at(k) + if at(k) > 0.7 { 10.0 } else { 0.0 })
                    .collect(),
            ],
            sample_time: 0.1,
            start_time: 3.0,
        }
    }

    fn part_of(text: &str, recordings: &[PlantRecording]) -> Option<Part> {
        part(&Plant::new(parse(text).unwrap()), recordings, Hold::Zero)
    }

    #[test]
    fn every_so_many_samples_where_those_between_add_nothing() {
        assert!(part_of(LAG, &[recording(6000, 400)]).is_none());
        let part = part_of(LAG, &[recording(12_000, 1000), recording(7000, 1000)]).unwrap();
        assert_eq!((part.every, part.searched().samples), (4, 3000 + 1750));
        let first = &part.recordings[0];
        assert_eq!((first.sample_time, first.start_time), (0.4, 3.0));
        assert_eq!(
            first.outputs[0][2000],
            recording(12_000, 1000).outputs[0][8000]
        );
        assert_eq!(
            first.inputs[0][2000],
            recording(12_000, 1000).inputs[0][8000]
        );
    }

    #[test]
    fn an_input_that_stays_constant_is_thinned() {
        let mut decay = recording(11_000, 1);
        decay.inputs[0].fill(0.1);
        decay.outputs[0] = (0..11_000)
            .map(|k| 0.1 + (-0.002 * f64::from(k)).exp() + 0.01 * (2.3 * f64::from(k)).sin())
            .collect();
        assert_eq!(part_of(LAG, &[decay]).unwrap().every, 3);
    }

    #[test]
    fn a_stretch_where_an_input_changes_meanwhile() {
        let all = recording(20_000, 3);
        let part_of_all = part_of(LAG, std::slice::from_ref(&all)).unwrap();
        let stretch = &part_of_all.recordings[0];
        assert_eq!((part_of_all.every, stretch.samples()), (1, 5000));
        // The jump is in it, and its time is that of the recording.
        assert!(stretch.outputs[0][0] < 1.0 && stretch.outputs[0][4999] > 10.0);
        let from = ((stretch.start_time - 3.0) / 0.1).round() as usize;
        assert_eq!(stretch.inputs[0][..], all.inputs[0][from..from + 5000]);
        // What starts as the text says is searched from its start.
        let fixed = LAG.replace("start=1", "start=1, fixed=true");
        let part_of_all = part_of(&fixed, std::slice::from_ref(&all)).unwrap();
        assert_eq!(part_of_all.recordings[0].start_time, 3.0);
    }
}
