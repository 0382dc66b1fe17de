//! Where recording and simulation differ: in time, frequency and operating region.

use statrs::distribution::{ChiSquared, ContinuousCDF, StudentsT};

use crate::explain::effects;
use crate::explain::explanation::Regime;
use crate::explain::linear::data::{Data, Series};
use crate::noise::{Mask, Noise};

/// Family-wise level of every map.
const LEVEL: f64 = 1e-3;
/// Windows that cover more of the recording than this are no windows: the difference is throughout.
const THROUGHOUT: f64 = 0.6;
/// Excess in dB from which a band is listed.
const EXCESS_DB: f64 = 1.0;
/// Ratio from which an operating region is listed.
const REGION: f64 = 1.5;
/// Nothing is said to be more times as large as something else: the square of the sixteen digits that a number has.
const MOST_TIMES: f64 = 1e32;
/// Bands of the frequency map, about.
const BANDS: usize = 16;

/// Squares of the residual under the noise that is left beside the best explanation: 1 in the mean where nothing is
/// missing. One series an output and segment.
pub(crate) fn excess(residual: &Series, noise: &Noise, mask: &Mask) -> Series {
    noise
        .whiten(residual, mask)
        .iter()
        .map(|e| e.iter().map(|v| (v * v).min(MOST_TIMES)).collect())
        .collect()
}

/// How many times `there` what is found `elsewhere`.
fn times(there: f64, elsewhere: f64) -> f64 {
    (there / elsewhere.max(1e-300)).min(MOST_TIMES)
}

/// Multi-scale windows of a segment in which `squares` exceeds noise, `[from s, to s, mean square]`; empty when that is
/// nowhere or throughout.
pub(crate) fn windows(data: &Data, squares: &Series, mask: &Mask, index: usize) -> Vec<[f64; 3]> {
    let segment = &data.segments[index];
    let n = segment.samples();
    let l = data.outputs;
    let (squares, mask) = (&squares[index * l..], &mask[index * l..]);
    // Outputs together; a prefix sum makes every window cheap.
    let mut sums = vec![0.0; n + 1];
    let mut counts = vec![0.0; n + 1];
    for k in 0..n {
        let (mut sum, mut count) = (0.0, 0.0);
        for o in 0..l {
            if mask[o][k] {
                sum += squares[o][k];
                count += 1.0;
            }
        }
        sums[k + 1] = sums[k] + sum;
        counts[k + 1] = counts[k] + count;
    }
    // Fourth moment over squared second, robustly: tails widen the test.
    let mut flagged = vec![false; n];
    let mut length = n / 4;
    let mut tests = 0.0;
    let mut windows = Vec::new();
    while length >= 24 {
        let step = length / 2;
        let mut from = 0;
        while from + length <= n {
            windows.push((from, from + length));
            tests += 1.0;
            from += step;
        }
        length /= 2;
    }
    for (from, to) in windows {
        let (sum, count) = (sums[to] - sums[from], counts[to] - counts[from]);
        if count < 8.0 {
            continue;
        }
        let p = ChiSquared::new(count).map_or(1.0, |d| d.sf(sum));
        if p * tests < LEVEL && sum > 1.3 * count {
            flagged[from..to].fill(true);
        }
    }
    let covered = flagged.iter().filter(|f| **f).count() as f64 / n.max(1) as f64;
    if covered > THROUGHOUT || covered == 0.0 {
        return Vec::new();
    }
    let time = |k: usize| segment.start_time + k as f64 * data.sample_time;
    let mut found = Vec::new();
    let mut k = 0;
    while k < n {
        if !flagged[k] {
            k += 1;
            continue;
        }
        let from = k;
        while k < n && flagged[k] {
            k += 1;
        }
        let (from, to) = trimmed(&sums, &counts, from, k);
        let strength = (sums[to] - sums[from]) / (counts[to] - counts[from]).max(1.0);
        found.push([time(from), time(to), strength]);
    }
    found.sort_by(|a, b| b[2].total_cmp(&a[2]));
    found.truncate(8);
    found
}

/// The part of a window whose excess is largest: ends without any are cut off.
fn trimmed(sums: &[f64], counts: &[f64], from: usize, to: usize) -> (usize, usize) {
    // Largest sum of (square - threshold): Kadane's scan.
    let threshold = 2.0;
    let (mut best, mut best_at, mut sum, mut start) = (0.0, (from, to), 0.0, from);
    for k in from..to {
        sum += sums[k + 1] - sums[k] - threshold * (counts[k + 1] - counts[k]);
        if sum <= 0.0 {
            sum = 0.0;
            start = k + 1;
        } else if sum > best {
            best = sum;
            best_at = (start, k + 1);
        }
    }
    best_at
}

/// Edges (indices) of logarithmic bands over a spectrum of `bins` bins, each wide enough for a test.
fn bands(bins: usize) -> Vec<(usize, usize)> {
    let mut edges = Vec::new();
    let mut from = 2;
    let ratio = (bins as f64 / 4.0).powf(1.0 / BANDS as f64).max(1.05);
    while from < bins {
        let to = ((from as f64 * ratio).ceil() as usize)
            .max(from + 6)
            .min(bins);
        edges.push((from, to));
        from = to;
    }
    edges
}

/// Bands `[from Hz, to Hz, dB]` in which the residual `before` exceeds what is left `after`.
pub(crate) fn frequencies(before: &[(f64, f64)], after: &[(f64, f64)]) -> Vec<[f64; 3]> {
    let edges = bands(before.len().min(after.len()));
    let tests = edges.len() as f64;
    edges
        .into_iter()
        .filter_map(|(from, to)| {
            let sum = |s: &[(f64, f64)]| s[from..to].iter().map(|p| p.1).sum::<f64>();
            let (b, a) = (sum(before), sum(after));
            let ratio = times(b, a);
            let db = 10.0 * ratio.log10();
            // The window correlates neighbours: about 2/3 of the bins are independent, two degrees of freedom each.
            let freedom = 2.0 * (to - from) as f64 * 0.66;
            let p = ChiSquared::new(freedom).map_or(1.0, |d| d.sf(freedom * ratio));
            (db > EXCESS_DB && p * tests < LEVEL).then(|| [before[from].0, before[to - 1].0, db])
        })
        .collect()
}

/// Sums over the squares of one region.
#[derive(Default)]
struct Moments {
    count: f64,
    sum: f64,
    squares: f64,
}

impl Moments {
    fn add(&mut self, value: f64) {
        self.count += 1.0;
        self.sum += value;
        self.squares += value * value;
    }

    fn mean(&self) -> f64 {
        self.sum / self.count
    }

    /// Variance of the mean.
    fn of_mean(&self) -> f64 {
        (self.squares / self.count - self.mean().powi(2)).max(0.0) / (self.count - 1.0)
    }

    /// Probability of a mean so far above that of `other` by chance: Welch's test (1947). What is missing elsewhere makes the
    /// squares uneven, which a chi-squared test of their sum would take for a region.
    fn exceeds(&self, other: &Self) -> f64 {
        let (a, b) = (self.of_mean(), other.of_mean());
        let freedom = (a + b).powi(2)
            / (a * a / (self.count - 1.0) + b * b / (other.count - 1.0)).max(1e-300);
        let t = (self.mean() - other.mean()) / (a + b).sqrt().max(1e-300);
        StudentsT::new(0.0, 1.0, freedom.max(1.0)).map_or(1.0, |d| d.sf(t))
    }
}

/// Operating regions of output `output` in which the difference is larger than elsewhere: eighths of the samples by the
/// size and by the signed value of each input, of the simulated output and of its rate.
pub(crate) fn regimes(
    data: &Data,
    simulated: &Series,
    squares: &Series,
    mask: &Mask,
    output: usize,
    names: (&[String], &[String]),
) -> Vec<Regime> {
    let l = data.outputs;
    let h = data.sample_time;
    let mut variables: Vec<(String, Vec<f64>)> = Vec::new();
    let over_segments = |f: &dyn Fn(usize) -> Vec<f64>| -> Vec<f64> {
        (0..data.segments.len()).flat_map(f).collect()
    };
    for input in 0..data.signals() {
        let u = over_segments(&|s| data.segments[s].inputs[input].clone());
        variables.push((
            format!("|{}|", names.0[input]),
            u.iter().map(|v| v.abs()).collect(),
        ));
        variables.push((names.0[input].clone(), u));
    }
    let y = over_segments(&|s| simulated[s * l + output].clone());
    let rate = over_segments(&|s| {
        let y = &simulated[s * l + output];
        (0..y.len())
            .map(|k| (y[(k + 1).min(y.len() - 1)] - y[k.saturating_sub(1)]) / (2.0 * h))
            .collect()
    });
    variables.push((
        format!("|{}|", names.1[output]),
        y.iter().map(|v| v.abs()).collect(),
    ));
    variables.push((names.1[output].clone(), y));
    variables.push((
        format!("|d/dt {}|", names.1[output]),
        rate.iter().map(|v| v.abs()).collect(),
    ));
    variables.push((format!("d/dt {}", names.1[output]), rate));
    let square = over_segments(&|s| squares[s * l + output].clone());
    let counts: Vec<bool> = (0..data.segments.len())
        .flat_map(|s| mask[s * l + output].clone())
        .collect();
    let mut found = Vec::new();
    let tests = (variables.len() * 8) as f64;
    for (name, values) in variables {
        let edges: Vec<f64> = (0..=8)
            .map(|i| effects::level(&values, f64::from(i) / 8.0, |v| v))
            .collect();
        let last = edges.len() - 2;
        for (eighth, pair) in edges.windows(2).enumerate() {
            // The ends are open: the edges are those of some samples, and a binary input stands on them.
            let holds = |v: f64| (v >= pair[0] || eighth == 0) && (v < pair[1] || eighth == last);
            let (mut inside, mut outside) = (Moments::default(), Moments::default());
            for ((v, e), keep) in values.iter().zip(&square).zip(&counts) {
                if *keep {
                    let side = if holds(*v) { &mut inside } else { &mut outside };
                    side.add(*e);
                }
            }
            if inside.count < 20.0 || outside.count < 20.0 {
                continue;
            }
            let ratio = times(inside.mean(), outside.mean());
            let p = (inside.exceeds(&outside) * tests).min(1.0);
            if ratio > REGION && p < LEVEL {
                found.push(Regime {
                    variable: name.clone(),
                    from: pair[0],
                    to: pair[1],
                    excess: ratio,
                    p_value: p,
                });
            }
        }
    }
    found.sort_by(|a, b| b.excess.total_cmp(&a.excess));
    found.truncate(6);
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explain::document::plots::{spectrum, spectrum_picture};
    use crate::explain::linear::data::Segment;

    fn data(samples: usize) -> Data {
        Data {
            segments: vec![Segment {
                inputs: vec![vec![0.0; samples]],
                outputs: vec![vec![0.0; samples]],
                start_time: 5.0,
            }],
            sample_time: 0.1,
            inputs: 1,
            outputs: 1,
            constant: false,
        }
    }

    /// Squares of noise with unit variance, by a generator of their own.
    fn noise(samples: usize, seed: u64) -> Vec<f64> {
        let mut state = seed;
        let mut uniform = move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            ((state >> 11) as f64 + 0.5) / (1u64 << 53) as f64
        };
        (0..samples)
            .map(|_| -2.0 * uniform().ln() * (std::f64::consts::TAU * uniform()).cos().powi(2))
            .collect()
    }

    #[test]
    fn a_window_is_where_squares_exceed_noise() {
        let n = 2000;
        let data = data(n);
        let mask: Mask = vec![vec![true; n]];
        let (mut alarms, mut apart) = (0, 0.0);
        for seed in 0..200 {
            let quiet = vec![noise(n, seed)];
            alarms += usize::from(!windows(&data, &quiet, &mask, 0).is_empty());
            let mut loud = quiet;
            loud[0][1200..1300].iter_mut().for_each(|e| *e += 6.0);
            let found = windows(&data, &loud, &mask, 0);
            assert_eq!(found.len(), 1, "{found:?}");
            let [from, to, strength] = found[0];
            apart += (from - 125.0).abs() + (to - 135.0).abs();
            assert!((strength - 7.0).abs() < 1.0, "{strength}");
            // What does not count shows nothing.
            let hidden: Mask = vec![(0..n).map(|k| !(1150..1350).contains(&k)).collect()];
            assert!(windows(&data, &loud, &hidden, 0).len() <= 1);
        }
        // Ends are found to some samples.
        assert!(apart / 400.0 < 0.6, "{}", apart / 400.0);
        // A level of 1e-3 for the whole map.
        assert!(alarms <= 2, "{alarms} windows of 200 without any");
        let everywhere = vec![noise(n, 7).iter().map(|e| 3.0 * e).collect()];
        assert!(windows(&data, &everywhere, &mask, 0).is_empty());
    }

    #[test]
    fn a_band_is_where_power_exceeds_what_is_left() {
        // A line of power 200 at 1.25 Hz in noise of power 2 on a bandwidth of 5 Hz.
        let n = 4000;
        let residual = |line: f64| -> Series {
            let e = noise(n, 3);
            let sign = noise(n, 4);
            vec![
                (0..n)
                    .map(|k| {
                        let t = 0.1 * k as f64;
                        let white = if sign[k] > 0.455 { 1.0 } else { -1.0 } * e[k].sqrt();
                        white + line * (std::f64::consts::TAU * 1.25 * t).sin()
                    })
                    .collect(),
            ]
        };
        let quiet = spectrum(&residual(0.0), 1, 0, 0.1);
        // Two-sided: the mean over frequency is variance times sample time.
        let mean = quiet.iter().map(|p| p.1).sum::<f64>() / quiet.len() as f64;
        assert!((mean / 0.1 - 1.0).abs() < 0.1, "{mean}");
        let found = frequencies(&spectrum(&residual(1.0), 1, 0, 0.1), &quiet);
        assert_eq!(found.len(), 1, "{found:?}");
        let [from, to, db] = found[0];
        assert!(from < 1.25 && 1.25 < to && db > 3.0, "{found:?}");
        assert!(frequencies(&quiet, &quiet).is_empty());
        // Decibels, of many bins each where they are drawn closely.
        let picture = spectrum_picture(&quiet, &quiet);
        assert!(picture.iter().all(|p| p[1] == p[2]));
        assert!(
            picture[picture.len() - 10..]
                .iter()
                .all(|p| (p[1] + 10.0).abs() < 1.5)
        );
    }

    /// Inputs above are high: an eighth of a ramp.
    const HIGH: f64 = 0.875;

    /// Two recordings of two outputs, of which the second missed three times as much where its input was high.
    fn unequal(input: fn(usize) -> f64) -> (Data, Series, Series, Mask) {
        let n = 1000;
        let mut data = data(n);
        data.outputs = 2;
        let second = |s: usize| (0..n).map(|k| input(2 * k + s)).collect::<Vec<f64>>();
        data.segments = (0..2)
            .map(|s| Segment {
                inputs: vec![second(s)],
                outputs: vec![vec![0.0; n]; 2],
                start_time: 0.0,
            })
            .collect();
        let simulated: Series = (0..4)
            .map(|i| noise(n, 7919 * (i + 1)).iter().map(|e| e - 1.0).collect())
            .collect();
        let mut squares: Series = (0..4).map(|i| noise(n, 104_729 * (i + 1))).collect();
        for s in 0..2 {
            let high = second(s);
            for (e, u) in squares[2 * s + 1].iter_mut().zip(&high) {
                *e *= if *u > HIGH { 9.0 } else { 1.0 };
            }
        }
        (data, simulated, squares, vec![vec![true; n]; 4])
    }

    #[test]
    fn an_operating_region_is_where_errors_are_larger() {
        let names = (&["u".to_owned()][..], &["a".to_owned(), "b".to_owned()][..]);
        // A ramp: the region is one end of it. A switch, of which all samples stand on the edges.
        let inputs: [fn(usize) -> f64; 2] = [
            |k| (k % 400) as f64 / 400.0,
            |k| if k % 37 < 20 { 1.0 } else { -1.0 },
        ];
        for (which, input) in inputs.into_iter().enumerate() {
            let (data, simulated, squares, mask) = unequal(input);
            let of =
                |output, mask: &Mask| regimes(&data, &simulated, &squares, mask, output, names);
            let found = of(1, &mask);
            assert!(!found.is_empty());
            for region in &found {
                assert!(
                    region.variable == "u" || region.variable == "|u|",
                    "{region:?}"
                );
                assert!(region.to > HIGH && region.p_value < 1e-6, "{region:?}");
            }
            let strongest = &found[0];
            // The test of means, for as many regions as were asked about: eighths of six variables.
            let (mut inside, mut outside) = (Moments::default(), Moments::default());
            for s in 0..2 {
                for (u, e) in data.segments[s].inputs[0].iter().zip(&squares[2 * s + 1]) {
                    let v = if strongest.variable == "u" {
                        *u
                    } else {
                        u.abs()
                    };
                    let side = if v >= strongest.from {
                        &mut inside
                    } else {
                        &mut outside
                    };
                    side.add(*e);
                }
            }
            let expected = 48.0 * inside.exceeds(&outside);
            assert!(
                (strongest.p_value - expected).abs() <= 1e-6 * expected,
                "{strongest:?} {expected}"
            );
            assert!((strongest.excess / 9.0 - 1.0).abs() < 0.35, "{strongest:?}");
            if which == 0 {
                assert!(
                    strongest.from > 0.86 && strongest.to > strongest.from,
                    "{strongest:?}"
                );
            }
            // The other output missed as much everywhere; and what does not count is not looked at.
            assert!(of(0, &mask).is_empty());
            let calm: Mask = (0..4)
                .map(|i| {
                    data.segments[i / 2].inputs[0]
                        .iter()
                        .map(|u| *u <= HIGH)
                        .collect()
                })
                .collect();
            assert!(of(1, &calm).is_empty());
        }
    }

    #[test]
    fn what_has_nothing_to_compare_with_is_said_in_numbers() {
        let before: Vec<(f64, f64)> = (0..200).map(|i| (f64::from(i), 1e200)).collect();
        let after: Vec<(f64, f64)> = (0..200).map(|i| (f64::from(i), 0.0)).collect();
        for band in frequencies(&before, &after) {
            assert_eq!(band[2], 320.0);
        }
        assert_eq!(times(1e9, 0.0), MOST_TIMES);
        assert_eq!(times(6.0, 2.0), 3.0);
    }

    #[test]
    fn ends_without_excess_are_cut_off() {
        let squares: Vec<f64> = (0..100)
            .map(|k| if (40..60).contains(&k) { 6.0 } else { 1.0 })
            .collect();
        let running = |values: &[f64]| -> Vec<f64> {
            std::iter::once(0.0)
                .chain(values.iter().scan(0.0, |sum, v| {
                    *sum += v;
                    Some(*sum)
                }))
                .collect()
        };
        let (sums, counts) = (running(&squares), running(&[1.0; 100]));
        assert_eq!(trimmed(&sums, &counts, 30, 70), (40, 60));
        assert_eq!(trimmed(&sums, &counts, 0, 30), (0, 30));
    }

    /// Student's t of 1.6740449 with 5.2040960 degrees of freedom, integrated by Simpson's rule.
    #[test]
    fn means_are_compared_by_welch() {
        let of = |values: &[f64]| {
            let mut moments = Moments::default();
            values.iter().for_each(|v| moments.add(*v));
            moments
        };
        let welch = 0.076_338_388_174_6;
        let (a, b) = (of(&[1.0, 4.0, 2.0, 7.0, 5.0]), of(&[2.0, 1.0, 3.0, 1.5]));
        assert!((a.exceeds(&b) - welch).abs() < 1e-9, "{}", a.exceeds(&b));
        assert!((b.exceeds(&a) - (1.0 - welch)).abs() < 1e-9);
    }
}
