//! The spectrum of a signal of unknown length: Welch's averaged periodogram (Welch 1967, *IEEE Trans. Audio
//! Electroacoust.* 15, 70-73) with Hann windows that overlap by half.

use realfft::RealFftPlanner;

/// Samples of a segment.
const SEGMENT: usize = 4096;
/// Segments that a signal must be long enough for; a shorter one has shorter segments.
const SEGMENTS: usize = 4;
/// Samples of a segment at least.
const SHORTEST: usize = 16;
/// Share of the power below and above which the band of an excitation ends.
const TAIL: f64 = 0.05;

/// Where an input has its power.
#[derive(Debug, Clone, PartialEq)]
pub struct Excitation {
    /// Frequencies in hertz.
    pub hz: Vec<f64>,
    /// Share of the variance per hertz at each of them.
    pub density: Vec<f64>,
    /// From where to where nine tenths of the power lie, in hertz.
    pub band: [f64; 2],
}

/// Gathers a spectrum.
#[derive(Default)]
pub(crate) struct Welch {
    /// Samples that are not used up.
    waiting: Vec<f64>,
    /// Sums of periodograms, at multiples of the inverse of the length of a segment.
    power: Vec<f64>,
    /// Whether there were enough samples for segments of full length.
    long: bool,
    planner: Option<RealFftPlanner<f64>>,
    window: Vec<f64>,
}

impl Welch {
    /// Goes on by these samples.
    pub(crate) fn push(&mut self, values: &[f64]) {
        self.waiting.extend_from_slice(values);
        self.long |= self.waiting.len() >= SEGMENT * SEGMENTS;
        if self.long {
            self.segments(SEGMENT);
        }
    }

    /// Says that there are no more.
    pub(crate) fn end(&mut self) {
        let length = (self.waiting.len() / SEGMENTS + 1).next_power_of_two() / 2;
        if !self.long && length >= SHORTEST {
            self.segments(length);
        }
        self.waiting = Vec::new();
    }

    /// Adds what the waiting samples have of segments, and keeps the half of the last that the next will share.
    fn segments(&mut self, length: usize) {
        let transform = self
            .planner
            .get_or_insert_with(RealFftPlanner::new)
            .plan_fft_forward(length);
        if self.window.len() != length {
            self.window = (0..length)
                .map(|k| {
                    (std::f64::consts::PI * (k as f64 + 0.5) / length as f64)
                        .sin()
                        .powi(2)
                })
                .collect();
            self.power = vec![0.0; length / 2 + 1];
        }
        let mut input = transform.make_input_vec();
        let mut output = transform.make_output_vec();
        let mut from = 0;
        while let Some(segment) = self.waiting.get(from..from + length) {
            let mean = segment.iter().sum::<f64>() / length as f64;
            for ((x, value), w) in input.iter_mut().zip(segment).zip(&self.window) {
                *x = (value - mean) * w;
            }
            // Lengths are those that the transform was planned for.
            if transform.process(&mut input, &mut output).is_ok() {
                for (power, value) in self.power.iter_mut().zip(&output) {
                    *power += value.norm_sqr();
                }
            }
            from += length / 2;
        }
        self.waiting.drain(..from);
    }

    /// The spectrum, from the first frequency above zero; `None` for a signal that is too short or does not move.
    pub(crate) fn excitation(&self, sample_time: f64) -> Option<Excitation> {
        let length = self.window.len();
        let power = self.power.get(1..)?;
        let total: f64 = power.iter().sum();
        if !(total.is_finite() && total > 0.0 && sample_time > 0.0) {
            return None;
        }
        let step = 1.0 / (length as f64 * sample_time);
        let hz: Vec<f64> = (1..=power.len()).map(|k| k as f64 * step).collect();
        let at = |share: f64| {
            let mut sum = 0.0;
            let place = power.iter().position(|p| {
                sum += p;
                sum >= share * total
            });
            place.and_then(|k| hz.get(k)).copied()
        };
        Some(Excitation {
            density: power.iter().map(|p| p / (total * step)).collect(),
            band: [at(TAIL)?, at(1.0 - TAIL)?],
            hz,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn excitation(samples: usize, signal: impl Fn(f64) -> f64) -> Option<Excitation> {
        let values: Vec<f64> = (0..samples).map(|k| signal(k as f64 * 0.01)).collect();
        let mut welch = Welch::default();
        values.chunks(777).for_each(|part| welch.push(part));
        welch.end();
        welch.excitation(0.01)
    }

    #[test]
    fn a_sine_is_found_in_long_and_short_records() {
        for samples in [200, 5000, 100_000] {
            let found =
                excitation(samples, |t| 5.0 + (std::f64::consts::TAU * 10.0 * t).sin()).unwrap();
            let step = found.hz[0];
            assert!(
                found.band.iter().all(|f| (f - 10.0).abs() <= 1.5 * step),
                "{:?}",
                found.band
            );
            let power: f64 = found.density.iter().map(|d| d * step).sum();
            assert!((power - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn without_movement_there_is_no_spectrum() {
        assert_eq!(excitation(5000, |_| 3.0), None);
        assert_eq!(excitation(20, f64::sin), None);
        assert_eq!(excitation(0, f64::sin), None);
    }
}
