//! Streaming lag correlations by FFT.

use std::sync::Arc;

use nalgebra::DMatrix;
use realfft::num_complex::Complex;
use realfft::{RealFftPlanner, RealToComplex};

use super::lag_moments::LagMoments;

/// Shortest FFT segment. Long enough that the transform is cheap per sample, short enough to stay in
/// the second-level cache with its spectra.
const SHORTEST_SEGMENT: usize = 1024;

/// Accumulates `C(tau) = sum_k z[k] z[k+tau]'`, `tau = 0..=lags`, over a record that arrives in chunks of
/// any size.
///
/// The record is cut into segments of `S >= lags` samples, each transformed once with `S` zeros behind
/// it. The spectrum of two neighbouring segments side by side is then
/// `A_m(w) + (-1)^w A_{m+1}(w)`, so the cross-spectrum of segment `m` with itself and its right
/// neighbour costs one transform a channel a segment; it is summed over all segments and transformed
/// back only once. Segments do not depend on how the record was cut into chunks, so neither does the
/// result, to the last bit.
#[derive(Clone)]
pub struct LagAccumulator {
    channels: usize,
    lags: usize,
    segment: usize,
    transform: Arc<dyn RealToComplex<f64>>,
    /// Level subtracted from every sample, one a channel: the mean of the first segment. It only keeps
    /// the sums well scaled; the exact mean is taken out of the moments afterwards.
    reference: Option<Vec<f64>>,
    /// Samples that do not fill a segment yet, a column a channel, without the reference level.
    pending: Vec<Vec<f64>>,
    previous: Spectra,
    has_previous: bool,
    /// Sum of cross-spectra, entry `(i, j)` at `i * channels + j`.
    cross: Vec<Split>,
    samples: usize,
    sum: Vec<f64>,
    index_sum: Vec<f64>,
    head: Vec<Vec<f64>>,
    tail: Vec<Vec<f64>>,
    buffer: Vec<f64>,
    spectrum: Vec<Complex<f64>>,
    scratch: Vec<Complex<f64>>,
    current: Spectra,
    pair: Split,
}

/// Complex numbers as two arrays: loops over them vectorise.
#[derive(Clone)]
struct Split {
    re: Vec<f64>,
    im: Vec<f64>,
}

type Spectra = Vec<Split>;

impl Split {
    fn zeros(len: usize) -> Self {
        Self {
            re: vec![0.0; len],
            im: vec![0.0; len],
        }
    }
}

impl std::fmt::Debug for LagAccumulator {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LagAccumulator")
            .field("channels", &self.channels)
            .field("lags", &self.lags)
            .field("samples", &self.samples)
            .finish_non_exhaustive()
    }
}

impl LagAccumulator {
    /// An empty accumulator for `channels` channels and lags `0..=lags`.
    pub fn new(channels: usize, lags: usize) -> Self {
        let segment = Self::segment_of(lags);
        let transform = RealFftPlanner::new().plan_fft_forward(2 * segment);
        let bins = segment + 1;
        Self {
            channels,
            lags,
            segment,
            reference: None,
            pending: vec![Vec::with_capacity(segment); channels],
            previous: vec![Split::zeros(bins); channels],
            has_previous: false,
            cross: vec![Split::zeros(bins); channels * channels],
            samples: 0,
            sum: vec![0.0; channels],
            index_sum: vec![0.0; channels],
            head: vec![Vec::with_capacity(lags); channels],
            tail: vec![Vec::with_capacity(lags + segment); channels],
            buffer: transform.make_input_vec(),
            spectrum: transform.make_output_vec(),
            scratch: transform.make_scratch_vec(),
            current: vec![Split::zeros(bins); channels],
            pair: Split::zeros(bins),
            transform,
        }
    }

    /// Samples of a segment that holds `lags` lags.
    pub(crate) fn segment_of(lags: usize) -> usize {
        lags.checked_next_power_of_two()
            .unwrap_or(usize::MAX)
            .max(SHORTEST_SEGMENT)
    }

    /// Number of samples so far.
    pub fn samples(&self) -> usize {
        self.samples + self.pending.first().map_or(0, Vec::len)
    }

    /// Appends samples: one slice a channel, all of the same length.
    ///
    /// # Panics
    /// When the number of slices is not the number of channels, or their lengths differ.
    pub fn push(&mut self, columns: &[&[f64]]) {
        assert_eq!(columns.len(), self.channels, "one slice a channel");
        let length = columns.first().map_or(0, |c| c.len());
        assert!(
            columns.iter().all(|c| c.len() == length),
            "channels of equal length"
        );
        let mut from = 0;
        while from < length {
            let take = (self.segment - self.pending[0].len()).min(length - from);
            for (pending, column) in self.pending.iter_mut().zip(columns) {
                pending.extend_from_slice(&column[from..from + take]);
            }
            from += take;
            if self.pending[0].len() == self.segment {
                self.close_segment();
            }
        }
    }

    fn set_reference(&mut self) {
        let length = self.pending[0].len().max(1) as f64;
        let reference = self
            .pending
            .iter()
            .map(|column| column.iter().sum::<f64>() / length)
            .collect();
        self.reference = Some(reference);
    }

    /// Takes the pending samples, which may be fewer than a segment only at the end of the record.
    fn close_segment(&mut self) {
        if self.reference.is_none() {
            self.set_reference();
        }
        let first_index = self.samples;
        let length = self.pending[0].len();
        for channel in 0..self.channels {
            let reference = self.reference.as_ref().map_or(0.0, |r| r[channel]);
            let pending = &mut self.pending[channel];
            let mut sum = 0.0;
            let mut index_sum = 0.0;
            for (k, value) in pending.iter_mut().enumerate() {
                *value -= reference;
                sum += *value;
                index_sum += *value * k as f64;
            }
            self.sum[channel] += sum;
            self.index_sum[channel] += index_sum + sum * first_index as f64;

            let head = &mut self.head[channel];
            if head.len() < self.lags {
                let missing = (self.lags - head.len()).min(length);
                head.extend_from_slice(&pending[..missing]);
            }
            let tail = &mut self.tail[channel];
            tail.extend_from_slice(pending);
            if tail.len() > self.lags {
                let surplus = tail.len() - self.lags;
                tail.drain(..surplus);
            }

            self.buffer[..length].copy_from_slice(pending);
            self.buffer[length..].fill(0.0);
            // The lengths are those of the plan, so the transform cannot fail.
            let _ = self.transform.process_with_scratch(
                &mut self.buffer,
                &mut self.spectrum,
                &mut self.scratch,
            );
            let current = &mut self.current[channel];
            for (bin, value) in self.spectrum.iter().enumerate() {
                current.re[bin] = value.re;
                current.im[bin] = value.im;
            }
            pending.clear();
        }
        self.samples += length;
        if self.has_previous {
            self.add_cross(true);
        }
        std::mem::swap(&mut self.previous, &mut self.current);
        self.has_previous = true;
    }

    /// Adds the cross-spectra of the previous segment with itself and, if there is one, its successor.
    fn add_cross(&mut self, with_successor: bool) {
        let bins = self.segment + 1;
        for j in 0..self.channels {
            let (own, next) = (&self.previous[j], &self.current[j]);
            if with_successor {
                for bin in 0..bins {
                    let sign = 1.0 - 2.0 * (bin & 1) as f64;
                    self.pair.re[bin] = own.re[bin] + sign * next.re[bin];
                    self.pair.im[bin] = own.im[bin] + sign * next.im[bin];
                }
            } else {
                self.pair.re.copy_from_slice(&own.re);
                self.pair.im.copy_from_slice(&own.im);
            }
            for i in 0..self.channels {
                let a = &self.previous[i];
                let sum = &mut self.cross[i * self.channels + j];
                add_conjugate_product(sum, a, &self.pair, bins);
            }
        }
    }

    /// The moments of all samples pushed so far. The accumulator can go on afterwards.
    pub fn moments(&self) -> LagMoments {
        let mut last = self.clone();
        if !last.pending[0].is_empty() || last.reference.is_none() {
            last.close_segment();
        }
        last.add_cross(false);

        let length = 2 * last.segment;
        let inverse = RealFftPlanner::new().plan_fft_inverse(length);
        let mut spectrum = inverse.make_input_vec();
        let mut correlation = inverse.make_output_vec();
        let mut scratch = inverse.make_scratch_vec();
        let q = last.channels;
        let mut correlations = vec![DMatrix::zeros(q, q); last.lags + 1];
        for i in 0..q {
            for j in 0..q {
                let sum = &last.cross[i * q + j];
                for (bin, value) in spectrum.iter_mut().enumerate() {
                    *value = Complex::new(sum.re[bin], sum.im[bin]);
                }
                // The transform of real data is real at zero and at the Nyquist frequency.
                spectrum[0].im = 0.0;
                spectrum[last.segment].im = 0.0;
                let _ = inverse.process_with_scratch(&mut spectrum, &mut correlation, &mut scratch);
                for (lag, block) in correlations.iter_mut().enumerate() {
                    block[(i, j)] = correlation[lag] / length as f64;
                }
            }
        }
        LagMoments {
            channels: q,
            lags: last.lags,
            samples: last.samples,
            reference: last.reference.unwrap_or_else(|| vec![0.0; q]),
            correlations,
            sum: last.sum,
            index_sum: last.index_sum,
            head: last.head,
            tail: last.tail,
        }
    }
}

/// `sum += conj(a) b`, bin by bin.
fn add_conjugate_product(sum: &mut Split, a: &Split, b: &Split, bins: usize) {
    let (sum_re, sum_im) = (&mut sum.re[..bins], &mut sum.im[..bins]);
    let (a_re, a_im) = (&a.re[..bins], &a.im[..bins]);
    let (b_re, b_im) = (&b.re[..bins], &b.im[..bins]);
    for bin in 0..bins {
        sum_re[bin] += a_re[bin] * b_re[bin] + a_im[bin] * b_im[bin];
        sum_im[bin] += a_re[bin] * b_im[bin] - a_im[bin] * b_re[bin];
    }
}
