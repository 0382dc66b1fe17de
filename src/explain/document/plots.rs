//! What plots show: traces with few points, spectra.

use realfft::RealFftPlanner;

use crate::noise::Series;

/// Samples that stand for all, at most about `most`: the smallest and the largest value of each stretch, so that no peak
/// of the error is lost.
pub(crate) fn extremes(error: &[f64], most: usize) -> Vec<usize> {
    if error.len() <= most {
        return (0..error.len()).collect();
    }
    let stretch = error.len().div_ceil(most / 2);
    let mut shown = Vec::with_capacity(most + 2);
    for (i, values) in error.chunks(stretch).enumerate() {
        let place = |better: fn(&f64, &f64) -> bool| {
            i * stretch
                + (1..values.len()).fold(0, |best, k| {
                    if better(&values[k], &values[best]) {
                        k
                    } else {
                        best
                    }
                })
        };
        let (low, high) = (place(|a, b| a < b), place(|a, b| a > b));
        shown.push(low.min(high));
        if low != high {
            shown.push(low.max(high));
        }
    }
    shown
}

/// Power of a residual over frequency, all series of one output together, Hann window: `(Hz, power)`.
pub(crate) fn spectrum(
    residual: &Series,
    outputs: usize,
    output: usize,
    sample_time: f64,
) -> Vec<(f64, f64)> {
    let mut total: Vec<(f64, f64)> = Vec::new();
    for column in residual.iter().skip(output).step_by(outputs) {
        let n = column.len();
        if n < 16 || !total.is_empty() && total.len() != n / 2 + 1 {
            continue;
        }
        let mut planner = RealFftPlanner::<f64>::new();
        let transform = planner.plan_fft_forward(n);
        let mut windowed: Vec<f64> = column
            .iter()
            .enumerate()
            .map(|(k, v)| {
                v * (std::f64::consts::PI * (k as f64 + 0.5) / n as f64)
                    .sin()
                    .powi(2)
            })
            .collect();
        let mut out = transform.make_output_vec();
        if transform.process(&mut windowed, &mut out).is_err() {
            continue;
        }
        let scale = sample_time / (0.375 * n as f64);
        let power = out.iter().map(|v| v.norm_sqr() * scale);
        if total.is_empty() {
            total = power
                .enumerate()
                .map(|(i, p)| (i as f64 / (n as f64 * sample_time), p))
                .collect();
        } else {
            for (t, p) in total.iter_mut().zip(power) {
                t.1 += p;
            }
        }
    }
    total
}

/// Thinned spectra for a picture, `[Hz, dB before, dB after]`.
pub(crate) fn spectrum_picture(before: &[(f64, f64)], after: &[(f64, f64)]) -> Vec<[f64; 3]> {
    let bins = before.len().min(after.len());
    let mut picture = Vec::new();
    let mut from = 1;
    while from < bins {
        let to = ((from as f64 * 1.04).ceil() as usize)
            .max(from + 2)
            .min(bins);
        let mean = |s: &[(f64, f64)]| {
            10.0 * (s[from..to].iter().map(|p| p.1).sum::<f64>() / (to - from) as f64)
                .max(1e-300)
                .log10()
        };
        picture.push([
            0.5 * (before[from].0 + before[to - 1].0),
            mean(before),
            mean(after),
        ]);
        from = to;
    }
    picture
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_every_peak() {
        let mut error: Vec<f64> = (0..100_000).map(|k| (0.01 * f64::from(k)).sin()).collect();
        error[77_777] = 9.0;
        error[77_780] = -8.0;
        let shown = extremes(&error, 1500);
        assert!(shown.len() <= 1502, "{}", shown.len());
        assert!(shown.contains(&77_777) && shown.contains(&77_780));
        assert!(shown.windows(2).all(|pair| pair[0] < pair[1]));
        assert_eq!(extremes(&error[..10], 1500), (0..10).collect::<Vec<_>>());
    }

    #[test]
    fn a_picture_stands_at_the_middle_of_its_bins() {
        let n = 400;
        let flat: Vec<(f64, f64)> = (0..n).map(|i| (0.01 * i as f64, 1.0)).collect();
        let picture = spectrum_picture(&flat, &flat);
        assert!((picture[0][0] - 0.015).abs() < 1e-12, "{:?}", picture[0]);
        assert!(picture.windows(2).all(|p| p[0][0] < p[1][0]));
        let last = picture[picture.len() - 1][0];
        assert!(3.9 < last && last < 3.99, "{last}");
    }
}
