//! van Wingerden, Example II: the acoustic duct of Verhaegen & Verdult (2007).

use nalgebra::DMatrix;

use super::TestSystem;
use crate::linalg::{LinalgError, discrete_lyapunov, stationary_filter};
use crate::model::StateSpace;

/// Common denominator in powers of `q^-1`.
const DENOMINATOR: [f64; 20] = [
    1.0,
    -1.8937219532483,
    0.92020408176247,
    8.4317527635809e-13,
    -6.9870644340972e-13,
    3.2703011891141e-13,
    -2.805382578432e-14,
    -4.8518619047975e-13,
    9.0515016323085e-13,
    -8.9573340462955e-13,
    6.210493238185e-13,
    -4.065544303713e-13,
    3.8448359402553e-13,
    -4.932154080722e-13,
    5.3571245452629e-13,
    -6.7043859898372e-13,
    6.505086065112e-13,
    0.66499999999978,
    -1.2593250989101,
    0.61193571437226,
];

/// Numerator from the loudspeaker.
const FROM_INPUT: [f64; 20] = [
    0.0,
    -5.6534330123106e-06,
    5.6870704280702e-06,
    0.0077870811926239,
    0.0013389477125431,
    -0.0091260667240191,
    1.4435759589218e-08,
    -1.2021568096247e-08,
    -2.2746529807395e-09,
    6.3067990166664e-09,
    9.1305924779895e-10,
    -7.5200613526843e-09,
    1.9549739577695e-09,
    1.3891832078608e-08,
    -1.6372496840947e-08,
    0.0090003511972213,
    -0.0019333235957678,
    -0.0070669966879457,
    -3.7850561971775e-06,
    3.7590122810601e-06,
];

/// Numerator of the path of the process noise.
const FROM_NOISE: [f64; 20] = [
    0.0,
    -5.65645330123106e-06,
    5.345344280702e-06,
    0.00745341926239,
    0.0023389477125431,
    -0.0095480667240191,
    1.545435759589218e-08,
    -1.2343468096247e-08,
    -2.534549807395e-09,
    4.454930166664e-09,
    9.342424779895e-10,
    -7.2342313526843e-09,
    1.9549739577695e-09,
    1.564565078608e-08,
    -3.1272496840947e-08,
    0.009345511972213,
    -0.001876875957678,
    -0.0060669966879457,
    -3.54561971775e-06,
    3.7590122810601e-06,
];

/// Total noise below the output, both in open loop: the paper's "approximately 8 dB".
const SIGNAL_TO_NOISE_DB: f64 = 8.0;
/// Share of the noise variance that comes through the noise path; the rest is white at the output. Ours.
const SHARE_OF_PROCESS_NOISE: f64 = 0.7;
/// Output feedback `u = F y + r`. Ours: beyond +0.3 the loop is unstable.
const FEEDBACK: f64 = -0.1;

/// Acoustic duct, 19 states, one input, one output, in closed loop.
///
/// The paper prints no matrices. The transfer function is the published one of the duct (the third example of the
/// public PBSID toolbox, which is open loop). The paper states neither the noise model nor the feedback, so these
/// are **ours**: white noise through the toolbox's noise path gives 70 % of the noise variance, white noise at the
/// output 30 %; together they lie 8 dB below the output for white input in open loop; `K` and the innovation variance are those of
/// the stationary Kalman filter; `u = -0.1 y + r` with white `r`. The output is scaled to unit variance for white
/// input.
///
/// # Errors
/// [`LinalgError`] when the filter cannot be computed, which these numbers do not bring about.
pub fn acoustic_duct() -> Result<TestSystem, LinalgError> {
    let n = DENOMINATOR.len() - 1;
    // Observer form: the coefficients of the denominator in the first column, a shift beside it.
    let a = DMatrix::from_fn(n, n, |i, j| {
        if j == 0 {
            -DENOMINATOR[i + 1]
        } else if j == i + 1 {
            1.0
        } else {
            0.0
        }
    });
    let c = DMatrix::from_fn(1, n, |_, j| if j == 0 { 1.0 } else { 0.0 });
    // Both numerators start with zero: no direct feedthrough.
    let column = |numerator: &[f64; 20]| DMatrix::from_fn(n, 1, |i, _| numerator[i + 1]);
    let (mut b, mut noise) = (column(&FROM_INPUT), column(&FROM_NOISE));
    let variance = |source: &DMatrix<f64>| -> Result<f64, LinalgError> {
        Ok(discrete_lyapunov(&a, &(source * source.transpose()))?[(0, 0)])
    };
    b /= variance(&b)?.sqrt();
    // The output is what input and noise give together; the ratio is that of the output to the noise.
    let noise_variance = 10f64.powf(-SIGNAL_TO_NOISE_DB / 10.0);
    noise *= (SHARE_OF_PROCESS_NOISE * noise_variance / variance(&noise)?).sqrt();
    let measurement = DMatrix::from_element(1, 1, (1.0 - SHARE_OF_PROCESS_NOISE) * noise_variance);
    let filter = stationary_filter(
        &a,
        &c,
        &(&noise * noise.transpose()),
        &measurement,
        &DMatrix::zeros(n, 1),
    )?;
    Ok(TestSystem {
        system: StateSpace {
            a,
            b,
            c,
            d: DMatrix::zeros(1, 1),
            k: filter.gain,
            sample_time: 1.0,
        },
        innovation_covariance: filter.innovation_covariance,
        feedback: DMatrix::from_element(1, 1, FEEDBACK),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::spectral_radius;

    /// Figures of the notes behind this crate (`pbsid-opt.md` section 5), found with other software.
    #[test]
    fn figures_of_the_notes() {
        let duct = acoustic_duct().unwrap();
        let system = &duct.system;
        let near = |found: f64, expected: f64| {
            assert!((found - expected).abs() < 6e-4, "{found} {expected}");
        };
        near(spectral_radius(&system.a).unwrap(), 0.976);
        near(spectral_radius(&system.predictor_matrix()).unwrap(), 0.981);
        let closed = &system.a + &system.b * &duct.feedback * &system.c;
        near(spectral_radius(&closed).unwrap(), 0.988);
        near(duct.innovation_covariance[(0, 0)], 0.0727);
    }
}
