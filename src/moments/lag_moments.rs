//! The moments of one record, and how two adjacent records become one.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::gram::Gram;
use super::trend::{Detrend, Trend};

/// Lag correlations of one record with what is needed to correct them at both ends.
///
/// All sums are of samples from which `reference` was subtracted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LagMoments {
    pub(super) channels: usize,
    pub(super) lags: usize,
    pub(super) samples: usize,
    pub(super) reference: Vec<f64>,
    /// `C(tau) = sum_{k=0}^{N-1-tau} z[k] z[k+tau]'`, `tau = 0..=lags`.
    pub(super) correlations: Vec<DMatrix<f64>>,
    /// `sum_k z[k]`.
    pub(super) sum: Vec<f64>,
    /// `sum_k k z[k]`.
    pub(super) index_sum: Vec<f64>,
    /// First `min(lags, N)` samples, a column a channel.
    pub(super) head: Vec<Vec<f64>>,
    /// Last `min(lags, N)` samples, a column a channel.
    pub(super) tail: Vec<Vec<f64>>,
}

impl LagMoments {
    /// Number of samples `N`.
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// Number of channels `q`.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Largest lag.
    pub fn lags(&self) -> usize {
        self.lags
    }

    /// Whether all parts have the sizes that channels, lags and samples say: not so in a damaged document.
    pub fn is_consistent(&self) -> bool {
        let (q, ends) = (self.channels, self.lags.min(self.samples));
        self.correlations.len() == self.lags + 1
            && self.correlations.iter().all(|c| c.shape() == (q, q))
            && [&self.reference, &self.sum, &self.index_sum]
                .iter()
                .all(|v| v.len() == q)
            && [&self.head, &self.tail].iter().all(|columns| {
                columns.len() == q && columns.iter().all(|column| column.len() == ends)
            })
    }

    /// Mean of each channel.
    pub fn mean(&self) -> Vec<f64> {
        let n = self.samples.max(1) as f64;
        self.reference
            .iter()
            .zip(&self.sum)
            .map(|(reference, sum)| reference + sum / n)
            .collect()
    }

    /// Root mean square of each channel about its mean; NaN where its squares leave the range of numbers.
    pub fn standard_deviation(&self) -> Vec<f64> {
        let n = self.samples.max(1) as f64;
        (0..self.channels)
            .map(|c| {
                let mean = self.sum[c] / n;
                let variance = self.correlations[0][(c, c)] / n - mean * mean;
                // Rounding makes a variance of nothing negative.
                if variance < 0.0 { 0.0 } else { variance.sqrt() }
            })
            .collect()
    }

    /// Correlation coefficient of two channels at lag zero, about their means.
    pub fn correlation(&self, i: usize, j: usize) -> f64 {
        let n = self.samples.max(1) as f64;
        let deviation = self.standard_deviation();
        let covariance = self.correlations[0][(i, j)] / n - self.sum[i] * self.sum[j] / (n * n);
        covariance / (deviation[i] * deviation[j])
    }

    /// The trend of each channel as `detrend` asks.
    pub fn trend(&self, detrend: Detrend) -> Trend {
        let n = self.samples as f64;
        match detrend {
            Detrend::None => Trend::zero(self.channels),
            Detrend::Linear if self.samples > 1 => {
                // Regression on k - (N-1)/2, whose sum of squares is N (N^2 - 1) / 12.
                let middle = (n - 1.0) / 2.0;
                let spread = n * (n * n - 1.0) / 12.0;
                let slope: Vec<f64> = (0..self.channels)
                    .map(|c| (self.index_sum[c] - middle * self.sum[c]) / spread)
                    .collect();
                let level = (0..self.channels)
                    .map(|c| self.reference[c] + self.sum[c] / n - slope[c] * middle)
                    .collect();
                Trend { level, slope }
            }
            Detrend::Mean | Detrend::Linear => Trend {
                level: self.mean(),
                slope: vec![0.0; self.channels],
            },
        }
    }

    /// The Gram matrix `sum_k zeta[k] zeta[k]'` of windows of `past + 1` samples, with `trend` taken out.
    ///
    /// Block `(i, j)` is `G_ij = sum_{k=0}^{Nc-1} z[k+i] z[k+j]'`, `Nc = N - past`. The first block row is
    /// `C(j)` less its products beyond `Nc`, and
    /// `G_{i+1,j+1} = G_ij - z[i] z[j]' + z[Nc+i] z[Nc+j]'`.
    /// A trend `a + b k` turns `zeta[k]` into `zeta[k] - alpha - beta k`, block `i` of `alpha` being
    /// `a + b i`, which changes the sum by products of `alpha` and `beta` with `sum zeta` and `sum k zeta`.
    ///
    /// # Panics
    /// When `past` exceeds the lags of the moments. A record not longer than `past` gives zero columns.
    pub fn gram(&self, past: usize, trend: &Trend) -> Gram {
        assert!(past <= self.lags, "past window within the accumulated lags");
        let q = self.channels;
        let order = (past + 1) * q;
        if self.samples <= past {
            return Gram::empty(order);
        }
        let columns = self.samples - past;
        let mut gram = DMatrix::<f64>::zeros(order, order);

        // First block row: all products z[k] z[k+i]' with k < Nc.
        let tail_length = self.tail[0].len();
        let tail_at = |channel: usize, k: usize| self.tail[channel][k + tail_length - self.samples];
        for lag in 0..=past {
            for a in 0..q {
                for b in 0..q {
                    let mut value = self.correlations[lag][(a, b)];
                    for k in columns..self.samples - lag {
                        value -= tail_at(a, k) * tail_at(b, k + lag);
                    }
                    gram[(a, lag * q + b)] = value;
                }
            }
        }
        // Down the diagonals by displacement; only the upper triangle of blocks is walked.
        for i in 0..past {
            for j in i..past {
                for b in 0..q {
                    let (first_b, last_b) = (self.head[b][j], tail_at(b, columns + j));
                    for a in 0..q {
                        let change = tail_at(a, columns + i) * last_b - self.head[a][i] * first_b;
                        gram[((i + 1) * q + a, (j + 1) * q + b)] =
                            gram[(i * q + a, j * q + b)] + change;
                    }
                }
            }
        }
        for j in 0..order {
            for i in 0..j {
                gram[(j, i)] = gram[(i, j)];
            }
        }
        self.remove_trend(&mut gram, past, trend);
        Gram { gram, columns }
    }

    fn remove_trend(&self, gram: &mut DMatrix<f64>, past: usize, trend: &Trend) {
        let q = self.channels;
        let order = gram.nrows();
        let columns = self.samples - past;
        // Relative to the reference level; counted from the middle of the windows, so that the sums of
        // index powers stay small and their cross term vanishes.
        let middle = (columns as f64 - 1.0) / 2.0;
        let mut alpha = vec![0.0; order];
        let mut beta = vec![0.0; order];
        let mut first = vec![0.0; order]; // sum_k zeta[k]
        let mut second = vec![0.0; order]; // sum_k (k - middle) zeta[k]
        let tail_length = self.tail[0].len();
        for c in 0..q {
            // Sums over the samples k = i .. Nc + i - 1, for i = 0, then one step at a time.
            let tail_at = |k: usize| self.tail[c][k + tail_length - self.samples];
            let mut sum = self.sum[c];
            let mut index_sum = self.index_sum[c];
            for k in columns..self.samples {
                sum -= tail_at(k);
                index_sum -= k as f64 * tail_at(k);
            }
            for i in 0..=past {
                let row = i * q + c;
                alpha[row] =
                    trend.level[c] - self.reference[c] + trend.slope[c] * (i as f64 + middle);
                beta[row] = trend.slope[c];
                first[row] = sum;
                second[row] = index_sum - (i as f64 + middle) * sum;
                if i < past {
                    let (out, into) = (self.head[c][i], tail_at(columns + i));
                    sum += into - out;
                    index_sum += (columns + i) as f64 * into - i as f64 * out;
                }
            }
        }
        let n = columns as f64;
        let squares = n * (n * n - 1.0) / 12.0;
        for j in 0..order {
            for i in 0..order {
                gram[(i, j)] += -first[i] * alpha[j]
                    - alpha[i] * first[j]
                    - second[i] * beta[j]
                    - beta[i] * second[j]
                    + n * alpha[i] * alpha[j]
                    + squares * beta[i] * beta[j];
            }
        }
    }

    /// Moments of this record followed without a gap by `next`: chunks of one log merge to the moments
    /// of the whole.
    ///
    /// # Panics
    /// When channels or lags differ.
    pub fn append(&self, next: &LagMoments) -> LagMoments {
        assert_eq!(self.channels, next.channels, "same channels");
        assert_eq!(self.lags, next.lags, "same lags");
        if self.samples == 0 {
            return next.clone();
        }
        if next.samples == 0 {
            return self.clone();
        }
        let next = next.with_reference(&self.reference);
        let q = self.channels;
        let mut correlations = self.correlations.clone();
        for (lag, block) in correlations.iter_mut().enumerate() {
            *block += &next.correlations[lag];
            // Products across the seam: sample N_a - back of this record, lag - back of the next.
            for back in 1..=lag.min(self.samples) {
                let ahead = lag - back;
                if ahead >= next.samples {
                    continue;
                }
                for j in 0..q {
                    let right = next.head[j][ahead];
                    for i in 0..q {
                        let tail = &self.tail[i];
                        block[(i, j)] += tail[tail.len() - back] * right;
                    }
                }
            }
        }
        let offset = self.samples as f64;
        let take = self.lags;
        LagMoments {
            channels: q,
            lags: self.lags,
            samples: self.samples + next.samples,
            reference: self.reference.clone(),
            correlations,
            sum: (0..q).map(|c| self.sum[c] + next.sum[c]).collect(),
            index_sum: (0..q)
                .map(|c| self.index_sum[c] + next.index_sum[c] + offset * next.sum[c])
                .collect(),
            head: (0..q)
                .map(|c| {
                    let both = self.head[c].iter().chain(&next.head[c]);
                    both.take(take).copied().collect()
                })
                .collect(),
            tail: (0..q)
                .map(|c| {
                    let both: Vec<f64> =
                        self.tail[c].iter().chain(&next.tail[c]).copied().collect();
                    both[both.len() - both.len().min(take)..].to_vec()
                })
                .collect(),
        }
    }

    /// The first `samples` samples as moments of their own, for at most as many samples as lags: what a
    /// block of the jackknife needs from its successor.
    pub(super) fn beginning(&self, samples: usize) -> LagMoments {
        let q = self.channels;
        let head: Vec<Vec<f64>> = self
            .head
            .iter()
            .map(|column| column[..samples.min(column.len())].to_vec())
            .collect();
        let samples = head[0].len();
        let mut correlations = vec![DMatrix::zeros(q, q); self.lags + 1];
        for (lag, block) in correlations.iter_mut().enumerate().take(samples) {
            for j in 0..q {
                for i in 0..q {
                    block[(i, j)] = (0..samples - lag)
                        .map(|k| head[i][k] * head[j][k + lag])
                        .sum();
                }
            }
        }
        LagMoments {
            channels: q,
            lags: self.lags,
            samples,
            reference: self.reference.clone(),
            correlations,
            sum: head.iter().map(|c| c.iter().sum()).collect(),
            index_sum: head
                .iter()
                .map(|c| c.iter().enumerate().map(|(k, v)| k as f64 * v).sum())
                .collect(),
            tail: head.clone(),
            head,
        }
    }

    /// The same record about another reference level.
    fn with_reference(&self, reference: &[f64]) -> LagMoments {
        let q = self.channels;
        let shift: Vec<f64> = (0..q).map(|c| self.reference[c] - reference[c]).collect();
        let mut moved = self.clone();
        moved.reference = reference.to_vec();
        let n = self.samples;
        // Partial sums without the last / the first `lag` samples, updated as the lag grows.
        let mut without_last = self.sum.clone();
        let mut without_first = self.sum.clone();
        for lag in 0..=self.lags.min(n) {
            if lag > 0 {
                for c in 0..q {
                    let tail = &self.tail[c];
                    without_last[c] -= tail[tail.len() - lag];
                    without_first[c] -= self.head[c][lag - 1];
                }
            }
            let count = (n - lag) as f64;
            let block = &mut moved.correlations[lag];
            for j in 0..q {
                for i in 0..q {
                    block[(i, j)] += without_last[i] * shift[j]
                        + shift[i] * without_first[j]
                        + count * shift[i] * shift[j];
                }
            }
        }
        let indices = n as f64 * (n as f64 - 1.0) / 2.0;
        for (c, shift) in shift.iter().enumerate() {
            moved.sum[c] += n as f64 * shift;
            moved.index_sum[c] += indices * shift;
            for value in moved.head[c].iter_mut().chain(moved.tail[c].iter_mut()) {
                *value += shift;
            }
        }
        moved
    }
}

#[cfg(test)]
mod tests {
    use super::super::LagAccumulator;
    use super::*;

    /// A record with offset, drift and coloured noise, three channels.
    fn record(samples: usize) -> Vec<Vec<f64>> {
        let mut state = 7_u64;
        let mut noise = move || {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let mut slow = 0.0;
        let mut columns = vec![Vec::new(); 3];
        for k in 0..samples {
            slow = 0.9 * slow + noise();
            columns[0].push(3.0 + noise());
            columns[1].push(slow - 0.002 * k as f64);
            columns[2].push(slow * 0.3 + noise() - 20.0);
        }
        columns
    }

    fn accumulate(columns: &[Vec<f64>], lags: usize, chunk: usize) -> LagMoments {
        let mut accumulator = LagAccumulator::new(columns.len(), lags);
        let n = columns[0].len();
        let mut from = 0;
        while from < n {
            let to = (from + chunk).min(n);
            let slices: Vec<&[f64]> = columns.iter().map(|c| &c[from..to]).collect();
            accumulator.push(&slices);
            from = to;
        }
        accumulator.moments()
    }

    /// The sum written out.
    fn literal(columns: &[Vec<f64>], past: usize, trend: &Trend) -> DMatrix<f64> {
        let q = columns.len();
        let count = columns[0].len() - past;
        let zeta = DMatrix::from_fn((past + 1) * q, count, |row, k| {
            let (i, c) = (row / q, row % q);
            columns[c][k + i] - trend.at(c, k + i)
        });
        &zeta * zeta.transpose()
    }

    fn relative(a: &DMatrix<f64>, b: &DMatrix<f64>) -> f64 {
        (a - b).amax() / b.amax()
    }

    #[test]
    fn gram_is_the_sum_of_outer_products() {
        let columns = record(2500);
        for (past, lags) in [(1, 1), (4, 4), (4, 9), (30, 30)] {
            let moments = accumulate(&columns, lags, 2500);
            for detrend in [Detrend::None, Detrend::Mean, Detrend::Linear] {
                let trend = moments.trend(detrend);
                let gram = moments.gram(past, &trend);
                assert_eq!(gram.columns, 2500 - past);
                let error = relative(&gram.gram, &literal(&columns, past, &trend));
                assert!(error < 1e-12, "past {past} {detrend:?}: {error:e}");
            }
        }
    }

    #[test]
    fn trends_are_the_least_squares_ones() {
        let columns = record(1800);
        let moments = accumulate(&columns, 3, 1800);
        let linear = moments.trend(Detrend::Linear);
        let mean = moments.trend(Detrend::Mean);
        for (c, column) in columns.iter().enumerate() {
            let average = column.iter().sum::<f64>() / 1800.0;
            approx::assert_relative_eq!(mean.level[c], average, max_relative = 1e-12);
            let (mut sum, mut weighted) = (0.0, 0.0);
            for (k, value) in column.iter().enumerate() {
                let rest = value - linear.at(c, k);
                sum += rest;
                weighted += rest * (k as f64 - 899.5);
            }
            assert!(sum.abs() < 1e-8 && weighted.abs() < 1e-4);
        }
    }

    #[test]
    fn chunks_do_not_matter_to_the_last_bit() {
        let columns = record(3100);
        let whole = accumulate(&columns, 12, 3100);
        for chunk in [1, 7, 1024, 1025] {
            let parts = accumulate(&columns, 12, chunk);
            assert_eq!(whole.correlations, parts.correlations);
            assert_eq!(whole.sum, parts.sum);
        }
    }

    #[test]
    fn adjacent_records_append_to_the_whole() {
        let columns = record(3000);
        let trend = accumulate(&columns, 10, 3000).trend(Detrend::Linear);
        let whole = accumulate(&columns, 10, 3000).gram(10, &trend).gram;
        for cut in [1, 3, 10, 1024, 1500, 2995] {
            let part = |from: usize, to: usize| {
                let slice: Vec<Vec<f64>> = columns.iter().map(|c| c[from..to].to_vec()).collect();
                accumulate(&slice, 10, 4000)
            };
            let merged = part(0, cut).append(&part(cut, 3000));
            assert_eq!(merged.samples(), 3000);
            let error = relative(&merged.gram(10, &trend).gram, &whole);
            assert!(error < 1e-11, "cut at {cut}: {error:e}");
            let three = part(0, cut)
                .append(&part(cut, cut + 2))
                .append(&part(cut + 2, 3000));
            assert!(relative(&three.gram(10, &trend).gram, &whole) < 1e-11);
        }
    }

    #[test]
    fn beginning_is_a_record_of_its_own() {
        let columns = record(1500);
        let moments = accumulate(&columns, 8, 1500);
        let short: Vec<Vec<f64>> = columns.iter().map(|c| c[..6].to_vec()).collect();
        let trend = Trend::zero(3);
        let error = relative(
            &moments.beginning(6).gram(2, &trend).gram,
            &literal(&short, 2, &trend),
        );
        assert!(error < 1e-12);
    }

    #[test]
    fn too_short_a_record_has_no_columns() {
        let columns = record(5);
        let moments = accumulate(&columns, 8, 5);
        assert_eq!(moments.gram(5, &Trend::zero(3)).columns, 0);
        assert_eq!(moments.gram(4, &Trend::zero(3)).columns, 1);
    }
}
