//! The proof: figures on blocks that were never fitted.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::explain::explanation::{FitFigure, FitSteps};
use crate::explain::linear::data::{Data, Series};
use crate::explain::linear::fit::{Effort, Fit, Problem};
use crate::noise::Mask;

/// Blocks that are set aside, spread over each recording, and the share of it that they make up: enough for the figures of
/// the proof, and little enough to miss.
const BLOCKS: usize = 8;
const SHARE: f64 = 0.12;
/// Blocks of the rest that a candidate is tried on while candidates are compared, between those that are set aside.
const INNER_BLOCKS: usize = 7;
const INNER_SHARE: f64 = 0.2;
/// Draws of the bootstrap.
const DRAWS: usize = 500;
/// Pieces that it draws, in total: each many correlation times long.
const PIECES: usize = 40;

/// Blocks `(segment, from, to)`, `count` in each segment, that make up `share` of it, centred at `centre(block)` of it.
fn spread(
    data: &Data,
    count: usize,
    share: f64,
    centre: impl Fn(f64) -> f64,
) -> Vec<(usize, usize, usize)> {
    let mut list = Vec::new();
    for (s, segment) in data.segments.iter().enumerate() {
        let n = segment.samples();
        let length = (share * n as f64 / count as f64) as usize;
        for b in 0..count {
            let from = (centre(b as f64) * n as f64 - length as f64 / 2.0).max(0.0) as usize;
            list.push((s, from, (from + length).min(n)));
        }
    }
    list
}

/// Blocks `(segment, from, to)` that are set aside before anything is looked at, and used once, for the proof.
pub(crate) fn blocks(data: &Data) -> Vec<(usize, usize, usize)> {
    spread(data, BLOCKS, SHARE, |b| (b + 0.5) / BLOCKS as f64)
}

/// Blocks in the middle between those.
fn inner_blocks(data: &Data) -> Vec<(usize, usize, usize)> {
    spread(data, INNER_BLOCKS, INNER_SHARE, |b| {
        (b + 1.0) / (INNER_BLOCKS + 1) as f64
    })
}

/// The mask without the blocks that are set aside, and with nothing else.
pub(crate) fn set_aside(data: &Data, mask: &Mask) -> (Mask, Mask) {
    split(data, mask, &blocks(data))
}

/// The same of the blocks that candidates are tried on, and their share of the values.
pub(crate) fn inner(data: &Data, mask: &Mask) -> (Mask, Mask, f64) {
    let (train, test) = split(data, mask, &inner_blocks(data));
    let count = |mask: &Mask| mask.iter().flatten().filter(|keep| **keep).count() as f64;
    let share = count(&test) / count(mask).max(1.0);
    (train, test, share)
}

fn split(data: &Data, mask: &Mask, blocks: &[(usize, usize, usize)]) -> (Mask, Mask) {
    let mut train = mask.clone();
    let mut test: Mask = mask.iter().map(|m| vec![false; m.len()]).collect();
    for &(s, from, to) in blocks {
        for o in 0..data.outputs {
            let series = s * data.outputs + o;
            for k in from..to {
                test[series][k] = mask[series][k];
                train[series][k] = false;
            }
        }
    }
    (train, test)
}

/// `fit` again without the blocks.
pub(crate) fn refit(problem: &Problem, fit: &Fit, train: &Mask) -> Option<Fit> {
    let without = Problem {
        mask: train.clone(),
        ..problem.clone()
    };
    fit.improved(&without, Effort::RANK)
}

/// Root mean square of what each half of the recordings leaves in the other: `residual` fits the samples of a mask.
pub(crate) fn across_halves(
    mask: &Mask,
    residual: impl Fn(&Mask) -> Option<Series> + Sync,
) -> Option<f64> {
    let half = |first: bool| -> Mask {
        mask.iter()
            .map(|m| {
                m.iter()
                    .enumerate()
                    .map(|(k, keep)| *keep && (k < m.len() / 2) == first)
                    .collect()
            })
            .collect()
    };
    let halves = [half(true), half(false)];
    let (first, second) = rayon::join(|| residual(&halves[0]), || residual(&halves[1]));
    let (mut sum, mut n) = (0.0, 0usize);
    for (residual, other) in [(first?, &halves[1]), (second?, &halves[0])] {
        for (e, keep) in residual.iter().zip(other) {
            for (e, _) in e.iter().zip(keep).filter(|(_, keep)| **keep) {
                sum += e * e;
                n += 1;
            }
        }
    }
    Some((sum / n.max(1) as f64).sqrt())
}

/// An error so many times the output's variation is as bad as any; an output that stands still has none.
const MOST_LOST: f64 = 1e6;

/// Root of the ratio of an error to what is there, sums of squares.
fn lost_share(error: f64, there: f64) -> f64 {
    if error == 0.0 {
        0.0
    } else {
        (error / there).sqrt().min(MOST_LOST)
    }
}

/// Fit figure of one output over the samples of `mask`.
pub(crate) fn figure(data: &Data, residual: &Series, mask: &Mask, output: usize) -> FitFigure {
    let (mut error, mut n, mut sum) = (0.0, 0.0, 0.0);
    let outputs: Vec<&Vec<f64>> = data.outputs_as_series().collect();
    let each = |f: &mut dyn FnMut(f64, f64)| {
        for s in (output..outputs.len()).step_by(data.outputs) {
            for k in 0..outputs[s].len() {
                if mask[s][k] {
                    f(outputs[s][k], residual[s][k]);
                }
            }
        }
    };
    each(&mut |y, r| {
        error += r * r;
        sum += y;
        n += 1.0;
    });
    let mean = sum / f64::max(n, 1.0);
    let mut there = 0.0;
    each(&mut |y, _| there += (y - mean).powi(2));
    FitFigure {
        rmse: (error / f64::max(n, 1.0)).sqrt(),
        fit_percent: 100.0 * (1.0 - lost_share(error, there)),
    }
}

/// Residuals of the four steps.
pub(crate) struct Steps<'a> {
    pub(crate) simulation: &'a Series,
    pub(crate) parameters_only: &'a Series,
    pub(crate) augmented: &'a Series,
    /// Share of the augmented residual's variance that is structure, not noise.
    pub(crate) structure_share: f64,
}

/// The table row for the samples of `mask`.
pub(crate) fn steps(
    data: &Data,
    steps: &Steps,
    mask: &Mask,
    output: usize,
    seed: Option<u64>,
) -> FitSteps {
    let augmented = figure(data, steps.augmented, mask, output);
    let rmse = augmented.rmse * (1.0 - steps.structure_share).max(0.0).sqrt();
    let lost = 100.0 - augmented.fit_percent;
    FitSteps {
        simulation: figure(data, steps.simulation, mask, output),
        parameters_only: figure(data, steps.parameters_only, mask, output),
        augmented,
        noise_floor: FitFigure {
            rmse,
            fit_percent: if augmented.rmse > 0.0 {
                100.0 - lost * rmse / augmented.rmse
            } else {
                100.0
            },
        },
        improvement_95: seed.and_then(|seed| improvement(steps, mask, data.outputs, output, seed)),
    }
}

/// Paired block bootstrap of the decrease of the root mean square error.
fn improvement(
    steps: &Steps,
    mask: &Mask,
    outputs: usize,
    output: usize,
    seed: u64,
) -> Option<[f64; 2]> {
    let mut pairs: Vec<(f64, f64)> = Vec::new();
    for s in (output..mask.len()).step_by(outputs) {
        for (k, keep) in mask[s].iter().enumerate() {
            if *keep {
                pairs.push((
                    steps.parameters_only[s][k].powi(2),
                    steps.augmented[s][k].powi(2),
                ));
            }
        }
    }
    let length = pairs.len() / PIECES;
    if length < 4 {
        return None;
    }
    let pieces: Vec<(f64, f64)> = pairs
        .chunks_exact(length)
        .map(|c| c.iter().fold((0.0, 0.0), |(a, b), p| (a + p.0, b + p.1)))
        .collect();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let n = (pieces.len() * length) as f64;
    let mut gains: Vec<f64> = (0..DRAWS)
        .map(|_| {
            let (a, b) = (0..pieces.len()).fold((0.0, 0.0), |(a, b), _| {
                let piece = pieces[random.random_range(0..pieces.len())];
                (a + piece.0, b + piece.1)
            });
            (a / n).sqrt() - (b / n).sqrt()
        })
        .collect();
    gains.sort_by(f64::total_cmp);
    Some([gains[DRAWS / 40], gains[DRAWS - 1 - DRAWS / 40]])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explain::linear::data::Segment;
    use rand_distr::StandardNormal;

    const N: usize = 2000;

    fn wave(size: f64, rate: f64) -> Vec<f64> {
        (0..N).map(|k| size * (rate * k as f64).sin()).collect()
    }

    fn data() -> Data {
        Data {
            segments: vec![Segment {
                inputs: vec![vec![0.0; N]],
                outputs: vec![wave(1.0, 0.31)],
                start_time: 0.0,
            }],
            sample_time: 1.0,
            inputs: 1,
            outputs: 1,
            constant: false,
        }
    }

    #[test]
    fn blocks_are_set_aside_all_over() {
        let data = data();
        let mask = vec![vec![true; N]];
        let (train, test) = set_aside(&data, &mask);
        let held = test[0].iter().filter(|keep| **keep).count();
        assert_eq!(held, (SHARE * N as f64) as usize);
        assert!(train[0].iter().zip(&test[0]).all(|(a, b)| a != b));
        // One block in each part, none at the ends.
        for part in test[0].chunks(N / BLOCKS) {
            assert_eq!(part.iter().filter(|keep| **keep).count(), held / BLOCKS);
            assert!(!part[0] && !part[N / BLOCKS - 1]);
        }
        // What candidates are tried on is never of them.
        let (_, tried, share) = inner(&data, &train);
        assert!((share * (1.0 - SHARE) / INNER_SHARE - 1.0).abs() < 0.01);
        assert!(tried[0].iter().zip(&test[0]).all(|(a, b)| !(*a && *b)));
    }

    /// Errors of 0.9, 0.5 and 0.1 of the output: figures, noise floor, and an improvement over other parameters, not over the
    /// simulation.
    #[test]
    fn figures_are_those_of_the_errors() {
        let data = data();
        let mask = vec![vec![true; N]];
        let errors = [0.9, 0.5, 0.1].map(|size| vec![wave(size, 0.31)]);
        let found = steps(
            &data,
            &Steps {
                simulation: &errors[0],
                parameters_only: &errors[1],
                augmented: &errors[2],
                structure_share: 0.75,
            },
            &mask,
            0,
            Some(1),
        );
        for (figure, size) in [
            (found.simulation, 0.9),
            (found.parameters_only, 0.5),
            (found.augmented, 0.1),
            // A quarter of the variance is noise.
            (found.noise_floor, 0.05),
        ] {
            assert!((figure.rmse - size * 0.5_f64.sqrt()).abs() < 1e-3);
            assert!((figure.fit_percent - 100.0 * (1.0 - size)).abs() < 0.01);
        }
        let [low, high] = found.improvement_95.unwrap();
        let gained = 0.4 * 0.5_f64.sqrt();
        assert!(
            low <= gained + 1e-3 && gained - 1e-3 <= high,
            "{low} {high}"
        );
        assert!(high - low < 0.05, "{low} {high}");
    }

    #[test]
    fn each_half_answers_for_the_other() {
        let mask = vec![vec![true; N]];
        // A fit that is perfect where it was made, and off by 1 and 3 where it was not.
        let error = across_halves(&mask, |own| {
            let off = if own[0][0] { 1.0 } else { 3.0 };
            let residual = own[0].iter().map(|own| if *own { 0.0 } else { off });
            Some(vec![residual.collect()])
        });
        assert!((error.unwrap() - 5.0_f64.sqrt()).abs() < 1e-12);
        assert!(across_halves(&mask, |own| own[0][0].then(|| vec![vec![0.0; N]])).is_none());
    }

    /// Of errors that are white, half of a size less: the gain's deviation is the root of `(1 + 1/4) / 2N`.
    #[test]
    fn improvements_are_as_certain_as_white_errors_allow() {
        let n = 20_000;
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut white = |size: f64| -> Series {
            vec![
                (0..n)
                    .map(|_| size * random.sample::<f64, _>(StandardNormal))
                    .collect(),
            ]
        };
        let (before, after) = (white(1.0), white(0.5));
        let of = Steps {
            simulation: &before,
            parameters_only: &before,
            augmented: &after,
            structure_share: 0.0,
        };
        let [low, high] = improvement(&of, &vec![vec![true; n]], 1, 0, 9).unwrap();
        let expected = 2.0 * 1.96 * (1.25 / (2.0 * n as f64)).sqrt();
        let ratio = (high - low) / expected;
        assert!((0.6..1.4).contains(&ratio), "{ratio}");
        assert!(low < 0.5 && 0.5 < high, "{low} {high}");
    }
}
