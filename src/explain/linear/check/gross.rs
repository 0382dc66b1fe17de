//! Samples that belong to no signal: dropouts to one value, and isolated outliers.
//!
//! What is looked at is recording minus simulation, sample by sample against the samples on both sides: a pulse that
//! leaves and comes back. A step, a ramp or an oscillation of the physics that is missing stands out from one side only,
//! or moves its neighbours as well. How far pulses go by chance is read from the pulses themselves: the largest are
//! compared with a Pareto tail fitted to those below (Hill 1975), so that heavy-tailed noise has heavy tails here too.

use std::ops::Range;

use crate::log::spacing;

/// Samples on each side that a pulse is compared with.
const BESIDE: usize = 3;
/// Samples on each side that tell how much the signal moves there anyway.
const AROUND: usize = 12;
/// And whether it does so for a moment only.
const NEAR: usize = 5;
/// A pulse must be so many times what neighbours differ by, everywhere and around it.
const STANDS_OUT: f64 = 8.0;
/// Probability, over a recording, of as many pulses as large by chance.
const LEVEL: f64 = 1e-6;
/// Largest share of the samples that is called isolated.
const MOST: f64 = 0.15;
/// Tail exponent of the heaviest noise that is ordinary: Student's t with three degrees of freedom, less its error.
const HEAVY: f64 = 2.3;
/// Share of the pulses that the tail is fitted to.
const TAIL: f64 = 0.05;
/// Pulses that the tail is fitted to, at least.
const LEAST_TAIL: usize = 20;
/// So many pulses to exactly one value are no chance where values do not repeat; of a coarse sensor, fewer are no evidence.
const SAME_VALUE: usize = 5;
/// A value that is held for so many samples, with a jump on both sides, is no chance either.
const HELD: usize = 8;
/// Share of the pulses that must go to that value.
const MOSTLY: f64 = 0.8;
/// A pulse to the value of the dropouts counts from here.
const DROPPED: f64 = 4.0;

/// What is wrong with one output of one recording.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Gross {
    /// The value of the dropouts and their samples.
    pub(crate) dropouts: Option<(f64, Vec<Range<usize>>)>,
    /// Outliers, one sample each.
    pub(crate) outliers: Vec<Range<usize>>,
}

impl Gross {
    pub(crate) fn samples(&self) -> impl Iterator<Item = &Range<usize>> {
        self.dropouts
            .iter()
            .flat_map(|(_, runs)| runs)
            .chain(&self.outliers)
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.samples().next().is_none()
    }
}

/// Equal samples in a row, and how far they stand out.
struct Pulse {
    samples: Range<usize>,
    /// Over what neighbours differ by.
    height: f64,
}

/// Dropouts and outliers of the recorded output `y`, of which `s` is the simulation.
pub(crate) fn gross(y: &[f64], s: &[f64]) -> Gross {
    let n = y.len();
    if n < 4 * AROUND {
        return Gross::default();
    }
    let error: Vec<f64> = y.iter().zip(s).map(|(y, s)| y - s).collect();
    let steps: Vec<f64> = error.windows(2).map(|p| (p[1] - p[0]).abs()).collect();
    let least_step = y
        .windows(2)
        .map(|p| (p[1] - p[0]).abs())
        .filter(|d| *d > 0.0)
        .fold(f64::INFINITY, f64::min);
    // Half of the differences of neighbours are below 0.95 standard deviations of white noise; steps of the sensor's
    // resolution are none. Where a sensor sits at a limit it shows no noise.
    let moved: Vec<bool> = y.windows(2).map(|p| p[0] != p[1]).collect();
    let all = 0..steps.len();
    let everywhere = movement(&steps, &moved, all.clone(), all.end..all.end, 0.0).max(least_step);
    if !everywhere.is_finite() || everywhere <= 0.0 {
        return Gross::default();
    }
    let coarse = spacing(y).is_some_and(|step| step > 0.05 * everywhere);
    let mut pulses = pulses(y, s, &error, everywhere, coarse);
    for pulse in pulses.iter_mut().filter(|p| p.height > DROPPED) {
        let (from, to) = (pulse.samples.start, pulse.samples.end);
        let beside = |reach: usize| {
            let before = from.saturating_sub(reach)..from.saturating_sub(1);
            let after = to.min(steps.len())..(to + reach - 1).min(steps.len());
            movement(&steps, &moved, before, after, everywhere)
        };
        let moves = beside(AROUND).max(beside(NEAR));
        pulse.height *= (everywhere / moves.max(everywhere)).min(1.0);
    }
    pulses.retain(|p| p.height > 0.0);
    pulses.sort_by(|a, b| b.height.total_cmp(&a.height));
    let beyond = beyond_chance(&pulses, n, coarse);
    let dropped = value_of_dropouts(y, &pulses, beyond, coarse);
    let mut found = Gross::default();
    if let Some(value) = dropped {
        found.dropouts = Some((value, dropouts(y, &pulses, value)));
    }
    // A good sample between dropouts stands out as well.
    let beside_dropout = |k: usize| {
        let near = k.saturating_sub(BESIDE)..(k + BESIDE + 1).min(n);
        dropped.is_some_and(|value| y[near].contains(&value))
    };
    found.outliers = pulses[..beyond]
        .iter()
        .filter(|p| p.samples.len() == 1 && !beside_dropout(p.samples.start))
        .map(|p| p.samples.clone())
        .collect();
    found.outliers.sort_by_key(|r| r.start);
    let count: usize = found.samples().map(ExactSizeIterator::len).sum();
    if count as f64 > MOST * n as f64 {
        return Gross::default();
    }
    found
}

/// Every run of equal samples away from the ends, as far as it stands out on both sides from what is around it, in the
/// recording and in its difference from the simulation alike.
fn pulses(y: &[f64], s: &[f64], error: &[f64], unit: f64, coarse: bool) -> Vec<Pulse> {
    let n = y.len();
    let mut list = Vec::new();
    let mut from = 0;
    while from < n {
        let mut to = from + 1;
        while to < n && y[to] == y[from] {
            to += 1;
        }
        if from >= BESIDE && to + BESIDE <= n && (coarse || !at_limit(y, from, to)) {
            let (before, after) = (from - BESIDE..from, to..to + BESIDE);
            let of = |v: &[f64], r: &Range<usize>| {
                let mut values = v[r.clone()].to_vec();
                median(&mut values)
            };
            let in_error = both_sides(
                y[from] - s[from] - of(error, &before),
                y[from] - s[to - 1] - of(error, &after),
            );
            // It need not be as large in the recording, which may move on meanwhile, but it must be there.
            let in_recording = both_sides(y[from] - of(y, &before), y[from] - of(y, &after));
            let height = in_error.abs() / unit;
            let height = if height < DROPPED {
                height
            } else if in_error * in_recording > 0.0 {
                height.min(2.0 * in_recording.abs() / unit)
            } else {
                0.0
            };
            list.push(Pulse {
                samples: from..to,
                height,
            });
        }
        from = to;
    }
    list
}

/// Whether samples beside `from..to` read one value, where values do not repeat otherwise: a sensor at a limit, from which
/// noise goes one way only.
fn at_limit(y: &[f64], from: usize, to: usize) -> bool {
    let beside = || y[from - BESIDE..from].iter().chain(&y[to..to + BESIDE]);
    beside().any(|v| beside().filter(|w| *w == v).count() > 1)
}

/// The smaller of two departures in the same direction; none where they are opposite.
fn both_sides(left: f64, right: f64) -> f64 {
    if left * right <= 0.0 {
        0.0
    } else if left.abs() < right.abs() {
        left
    } else {
        right
    }
}

/// What neighbours differ by in two stretches, as far as the recording moves there; `otherwise` where it hardly does.
fn movement(
    steps: &[f64],
    moved: &[bool],
    before: Range<usize>,
    after: Range<usize>,
    otherwise: f64,
) -> f64 {
    let mut values: Vec<f64> = before
        .chain(after)
        .filter(|k| moved[*k])
        .map(|k| steps[k])
        .collect();
    if values.len() < BESIDE {
        return otherwise;
    }
    median(&mut values)
}

/// How many of the largest pulses chance does not make, given the tail of the others.
fn beyond_chance(pulses: &[Pulse], samples: usize, coarse: bool) -> usize {
    let tail = ((TAIL * samples as f64) as usize).max(LEAST_TAIL);
    let most = (0.05 * samples as f64) as usize;
    let mut logs: Vec<f64> = pulses.iter().map(|p| p.height.ln()).collect();
    // A coarse sensor shows few pulses: those that it rounds off are no higher than a step.
    if coarse {
        logs.resize(logs.len().max(most + tail + 1), 0.0);
        logs.sort_by(|a, b| b.total_cmp(a));
    }
    // Of the first i logarithms.
    let mut sums = vec![0.0];
    for l in &logs {
        sums.push(sums[sums.len() - 1] + l);
    }
    let mut best = (LEVEL.ln(), 0);
    for i in 1..=most {
        let end = i + tail;
        if end >= logs.len() || logs[i - 1] < STANDS_OUT.ln() {
            break;
        }
        // Hill's estimate from the pulses below, less two of its standard errors.
        let excess = (sums[end] - sums[i]) / tail as f64 - logs[end];
        let exponent = (1.0 - 2.0 / (tail as f64).sqrt()) / excess.max(1e-9);
        // Heights in steps of the resolution tie, which looks like a light tail.
        let exponent = if coarse {
            exponent.min(HEAVY)
        } else {
            exponent
        };
        let expected = tail as f64 * (-exponent * (logs[i - 1] - logs[end])).exp();
        let count = i as f64;
        if expected >= count || coarse && i < SAME_VALUE {
            continue;
        }
        // Chernoff's bound of a Poisson tail; each count is tried.
        let chance = count * (expected / count).ln() + count - expected + 2.0 * count.ln();
        if chance < best.0 {
            best = (chance, i);
        }
    }
    best.1
}

/// The one value that most of what stands out reads exactly.
fn value_of_dropouts(y: &[f64], pulses: &[Pulse], beyond: usize, coarse: bool) -> Option<f64> {
    let far: Vec<&Pulse> = pulses
        .iter()
        .take_while(|p| p.height > STANDS_OUT)
        .collect();
    let mut values: Vec<f64> = far.iter().map(|p| y[p.samples.start]).collect();
    values.sort_by(f64::total_cmp);
    let (value, count) = values
        .chunk_by(|a, b| a == b)
        .map(|c| (c[0], c.len()))
        .max_by_key(|c| c.1)?;
    let longest = far
        .iter()
        .filter(|p| y[p.samples.start] == value)
        .map(|p| p.samples.len())
        .max()
        .unwrap_or(0);
    let among_beyond = pulses[..beyond]
        .iter()
        .filter(|p| y[p.samples.start] == value)
        .count();
    // One pulse alone is a dropout where it reads zero, or the same for several samples.
    let repeats = among_beyond >= 2 || among_beyond == 1 && (value == 0.0 || longest > 1);
    // Of values that repeat anyway, equal ones are no evidence of their own.
    let exact = count >= SAME_VALUE && count as f64 >= MOSTLY * far.len() as f64;
    // At rest, noise in steps goes to the same value often; dropouts do from any.
    let heights = || {
        far.iter()
            .filter(|p| y[p.samples.start] == value)
            .map(|p| p.height)
    };
    let (low, high) = (
        heights().fold(f64::INFINITY, f64::min),
        heights().fold(0.0, f64::max),
    );
    let inside = y.iter().any(|v| *v < value) && y.iter().any(|v| *v > value);
    let exact_in_steps = exact && inside && high > 1.5 * low;
    let exact = exact && !coarse;
    let held = longest >= HELD;
    // A value that is read otherwise as well, such as a limit, is none of dropouts.
    let there = y.iter().filter(|v| **v == value).count();
    let standing: usize = pulses
        .iter()
        .filter(|p| p.height > DROPPED && y[p.samples.start] == value)
        .map(|p| p.samples.len())
        .sum();
    let usual = if held {
        there > standing
    } else {
        there > 3 * standing
    };
    (exact_in_steps || (repeats || exact || held) && !usual).then_some(value)
}

/// All runs that read `value` and stand out, also at the ends of the recording; where no other sample reads it by
/// chance, all that read it.
fn dropouts(y: &[f64], pulses: &[Pulse], value: f64) -> Vec<Range<usize>> {
    let standing: Vec<Range<usize>> = pulses
        .iter()
        .filter(|p| p.height > DROPPED && y[p.samples.start] == value)
        .map(|p| p.samples.clone())
        .collect();
    let certain: usize = standing.iter().map(ExactSizeIterator::len).sum();
    let mut all: Vec<Range<usize>> = Vec::new();
    for (k, y) in y.iter().enumerate() {
        if *y != value {
            continue;
        }
        match all.last_mut() {
            Some(last) if last.end == k => last.end = k + 1,
            _ => all.push(k..k + 1),
        }
    }
    let there: usize = all.iter().map(ExactSizeIterator::len).sum();
    let mut runs = if there <= 3 * certain { all } else { standing };
    runs.sort_by_key(|r| r.start);
    runs
}

/// Middle of the values, which are put out of order.
pub(super) fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let at = values.len() / 2;
    *values.select_nth_unstable_by(at, f64::total_cmp).1
}

/// `y` with what is left out replaced by the simulation and the difference on both sides of it.
pub(crate) fn filled<'a>(
    y: &[f64],
    s: &[f64],
    left_out: impl Iterator<Item = &'a Range<usize>>,
) -> Vec<f64> {
    let n = y.len();
    let mut missing = vec![false; n];
    for range in left_out {
        missing[range.start.min(n)..range.end.min(n)].fill(true);
    }
    let mut filled = y.to_vec();
    let mut k = 0;
    while k < n {
        if !missing[k] {
            k += 1;
            continue;
        }
        let from = k;
        while k < n && missing[k] {
            k += 1;
        }
        let left = from.checked_sub(1).map(|j| y[j] - s[j]);
        let right = (k < n).then(|| y[k] - s[k]);
        let (left, right) = match (left, right) {
            (Some(l), Some(r)) => (l, r),
            (Some(e), None) | (None, Some(e)) => (e, e),
            (None, None) => return filled,
        };
        for (j, value) in filled.iter_mut().enumerate().take(k).skip(from) {
            let share = (j + 1 - from) as f64 / (k + 1 - from) as f64;
            *value = s[j] + left + share * (right - left);
        }
    }
    filled
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal, StudentT};

    /// A simulation, and a recording of it with an offset, another gain, slow noise and noise of heavy or light tails.
    fn recorded(seed: u64, samples: usize, tails: bool, noise: f64) -> (Vec<f64>, Vec<f64>) {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let student = StudentT::new(3.0).unwrap();
        let (mut x, mut v, mut u, mut slow) = (0.0, 0.0, 0.0, 0.0);
        let mut simulated = Vec::new();
        let mut recorded = Vec::new();
        for k in 0..samples {
            if k % 23 == 0 {
                u = random.sample::<f64, _>(StandardNormal);
            }
            v += 0.1 * (u - x) - 0.2 * v;
            x += 0.2 * v;
            let white: f64 = if tails {
                student.sample(&mut random)
            } else {
                random.sample(StandardNormal)
            };
            slow = 0.97 * slow + 0.25 * random.sample::<f64, _>(StandardNormal);
            simulated.push(5.0 + x);
            recorded.push(5.2 + 1.05 * x + noise * (white + slow));
        }
        (recorded, simulated)
    }

    #[test]
    fn dropouts_are_found_sample_by_sample() {
        for seed in 0..12 {
            let (mut y, s) = recorded(seed, 1500, seed % 2 == 0, 0.02);
            let mut random = ChaCha8Rng::seed_from_u64(seed + 100);
            let mut lost: Vec<usize> = (0..15)
                .flat_map(|_| {
                    let k = random.random_range(10..1480);
                    k..k + random.random_range(1..4)
                })
                .collect();
            lost.sort_unstable();
            lost.dedup();
            // As a rule zero; a converter may give its full scale.
            let value = if seed % 3 == 0 { 99.0 } else { 0.0 };
            for k in &lost {
                y[*k] = value;
            }
            let found = gross(&y, &s);
            let (at, runs) = found.dropouts.clone().expect("dropouts");
            assert_eq!(at, value);
            assert_eq!(runs.into_iter().flatten().collect::<Vec<_>>(), lost);
            assert!(found.outliers.is_empty(), "{:?}", found.outliers);
            let repaired = filled(&y, &s, found.samples());
            for k in lost {
                assert!((repaired[k] - 1.05 * s[k]).abs() < 0.5, "{k}");
            }
        }
    }

    #[test]
    fn a_long_dropout_is_found() {
        let (mut y, s) = recorded(5, 1500, false, 0.02);
        y[700..760].fill(0.0);
        let gone = 700..760;
        assert_eq!(gross(&y, &s).dropouts, Some((0.0, vec![gone])));
    }

    #[test]
    fn isolated_outliers_are_found_and_nothing_else() {
        for seed in 0..12 {
            let (mut y, s) = recorded(seed, 2000, false, 0.015);
            let mut random = ChaCha8Rng::seed_from_u64(seed + 100);
            let mut off: Vec<usize> = (0..10)
                .map(|i| 100 + 180 * i + random.random_range(0..100))
                .collect();
            off.sort_unstable();
            for k in &off {
                let sign = if random.random_bool(0.5) { 1.0 } else { -1.0 };
                y[*k] += sign * random.random_range(1.0..4.0);
            }
            let found = gross(&y, &s);
            assert_eq!(found.dropouts, None);
            let at: Vec<usize> = found.outliers.into_iter().flatten().collect();
            assert_eq!(at, off, "seed {seed}");
        }
    }

    #[test]
    fn heavy_tails_limits_and_steps_are_no_trouble() {
        for seed in 0..60 {
            let (y, s) = recorded(seed, 2000, true, 0.05);
            assert!(gross(&y, &s).is_empty(), "heavy tails, seed {seed}");
            // A sensor that ends at 0 and at 100 %.
            let limited: Vec<f64> = y.iter().map(|y| (y - 5.0).clamp(0.0, 1.0)).collect();
            let about: Vec<f64> = s.iter().map(|s| s - 5.0).collect();
            assert!(gross(&limited, &about).is_empty(), "limits, seed {seed}");
            let steps: Vec<f64> = y.iter().map(|y| (y / 0.1).round() * 0.1).collect();
            assert!(gross(&steps, &s).is_empty(), "steps, seed {seed}");
        }
    }
}
