//! How many independent values a correlated residual is worth.

use realfft::RealFftPlanner;

use super::{Mask, Series, kept};

/// Number of independent values whose mean is as uncertain as that of the residual, summed over recordings and outputs: the
/// number of values over the integrated autocorrelation time `1 + 2 (r1 + r2 + ...)`. Sums of two neighbours are added while
/// they are positive, each at most as large as the one before (C. J. Geyer, *Statistical Science* 7, 1992, section 3.3:
/// the initial monotone sequence). Lags count the values that are there.
pub(crate) fn effective_samples(residual: &Series, mask: &Mask) -> f64 {
    residual
        .iter()
        .zip(mask)
        .map(|(e, keep)| of_one(e, keep))
        .sum()
}

fn of_one(e: &[f64], keep: &[bool]) -> f64 {
    let mut padded = kept(e, keep);
    let count = padded.len();
    if count < 4 {
        return count as f64;
    }
    let mean = padded.iter().sum::<f64>() / count as f64;
    padded.iter_mut().for_each(|e| *e -= mean);
    padded.resize(2 * count.next_power_of_two(), 0.0);
    let mut planner = RealFftPlanner::<f64>::new();
    let forward = planner.plan_fft_forward(padded.len());
    let backward = planner.plan_fft_inverse(padded.len());
    let mut spectrum = forward.make_output_vec();
    if forward.process(&mut padded, &mut spectrum).is_err() {
        return count as f64;
    }
    spectrum.iter_mut().for_each(|v| *v = (v.norm_sqr()).into());
    let mut covariance = backward.make_output_vec();
    if backward.process(&mut spectrum, &mut covariance).is_err() || covariance[0] <= 0.0 {
        return count as f64;
    }
    let mut time = -1.0;
    let mut last = f64::INFINITY;
    for pair in covariance[..count / 2 * 2].chunks(2) {
        let sum = (pair[0] + pair[1]) / covariance[0];
        if sum <= 0.0 {
            break;
        }
        last = last.min(sum);
        time += 2.0 * last;
    }
    count as f64 / time.clamp(1.0, count as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    const SAMPLES: usize = 200_000;

    #[test]
    fn an_autoregression_has_the_information_of_its_spectrum_at_zero() {
        let mut dice = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        for a in [0.0, 0.6, 0.9] {
            let mut x = 0.0;
            let e: Vec<f64> = (0..SAMPLES)
                .map(|_| {
                    let w: f64 = StandardNormal.sample(&mut dice);
                    x = a * x + w;
                    x
                })
                .collect();
            let keep = vec![true; e.len()];
            let share = effective_samples(&vec![e], &vec![keep]) / SAMPLES as f64;
            let expected = (1.0 - a) / (1.0 + a);
            assert!((share / expected - 1.0).abs() < 0.2, "{a}: {share}");
        }
    }

    #[test]
    fn a_residual_that_never_returns_counts_as_few() {
        let e: Vec<f64> = (0..1000).map(|k| (k as f64 / 300.0).sin()).collect();
        let keep = vec![true; e.len()];
        assert!(effective_samples(&vec![e], &vec![keep]) < 5.0);
    }
}
