//! Computes everything in [`Invariants`].

use std::f64::consts::TAU;

use nalgebra::DMatrix;
use num_complex::Complex64;

use super::bands::{ResponseBand, response_bands};
use super::covariance_error::CovarianceError;
use super::delta_method::{
    Covariance2, Path, PoleUncertainty, pole_uncertainties, static_gain_std, step_response_std_at,
    zero_uncertainties,
};
use super::invariants_document::{Invariants, ResponsePoint, Root, StaticGain, StepResponse};
use super::parameters::ParameterCovariance;
use super::quantile::interval_quantile;
use crate::model::{Pole, StateSpace};

/// Points of a step response in the document, and the longest one in samples (the sensitivity is carried
/// through every sample).
const STEP_POINTS: usize = 100;
const STEP_SAMPLES: usize = 2000;

/// All that does not depend on the state basis: poles, zeros, frequency responses at `frequencies` (rad/s),
/// static gain, step response, and for one input and one output the ARMAX polynomials; with uncertainty
/// when there is a covariance. `seed` is for the parameter draws behind the bands where the linearisation
/// is not to be trusted ([`response_bands`]).
///
/// # Errors
/// [`CovarianceError::Names`] when there is not one name per channel, [`CovarianceError::Layout`] or
/// [`CovarianceError::Size`] for the covariance of another model, [`CovarianceError::Model`] or
/// [`CovarianceError::Linalg`] when a factorisation fails.
pub fn invariants(
    system: &StateSpace,
    covariance: Option<&ParameterCovariance>,
    output_names: &[String],
    input_names: &[String],
    frequencies: &[f64],
    seed: u64,
) -> Result<Invariants, CovarianceError> {
    for (kind, given, expected) in [
        ("output", output_names.len(), system.outputs()),
        ("input", input_names.len(), system.inputs()),
    ] {
        if given != expected {
            return Err(CovarianceError::Names {
                kind,
                given,
                expected,
            });
        }
    }
    let innovation_names: Vec<String> = output_names.iter().map(|y| format!("e({y})")).collect();
    let bare = |roots: Vec<Pole>| {
        roots
            .into_iter()
            .map(|pole| PoleUncertainty::new(pole, None, system.sample_time))
            .collect()
    };
    let (poles, zeros): (Vec<_>, Vec<_>) = match covariance {
        Some(c) => (
            pole_uncertainties(system, c)?,
            zero_uncertainties(system, c)?,
        ),
        None => (bare(system.poles()?), bare(system.zeros()?)),
    };
    let responses = |path, inputs: &[String]| {
        points(
            system,
            covariance,
            frequencies,
            path,
            seed,
            output_names,
            inputs,
        )
    };
    let has_noise_model = covariance.is_some() || system.k.iter().any(|&v| v != 0.0);
    Ok(Invariants {
        poles: poles.iter().map(root).collect(),
        zeros: zeros.iter().map(root).collect(),
        frequency_response: responses(Path::Input, input_names)?,
        noise_response: if has_noise_model {
            responses(Path::Innovation, &innovation_names)?
        } else {
            Vec::new()
        },
        armax: system.armax()?.filter(|p| {
            [&p.a, &p.b, &p.c]
                .iter()
                .all(|c| c.iter().all(|v| v.is_finite()))
        }),
        static_gain: static_gain(system, covariance, output_names, input_names)?,
        step_response: step_response(system, covariance, output_names, input_names)?,
    })
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

fn finite_pair(pair: [f64; 2]) -> Option<[f64; 2]> {
    pair.iter().all(|v| v.is_finite()).then_some(pair)
}

fn finite_covariance(covariance: Covariance2) -> Option<Covariance2> {
    covariance
        .as_flattened()
        .iter()
        .all(|v| v.is_finite())
        .then_some(covariance)
}

fn root(uncertainty: &PoleUncertainty) -> Root {
    let pole = &uncertainty.pole;
    Root {
        real: pole.value.re,
        imag: pole.value.im,
        covariance: uncertainty.covariance.and_then(finite_covariance),
        natural_frequency_hz: finite(pole.natural_frequency / TAU),
        natural_frequency_std: uncertainty
            .natural_frequency_std
            .and_then(|v| finite(v / TAU)),
        damping: pole.damping.and_then(finite),
        damping_std: uncertainty.damping_std.and_then(finite),
        time_constant_s: pole.time_constant.and_then(finite),
        time_constant_std: uncertainty.time_constant_std.and_then(finite),
    }
}

fn points(
    system: &StateSpace,
    covariance: Option<&ParameterCovariance>,
    frequencies: &[f64],
    path: Path,
    seed: u64,
    outputs: &[String],
    inputs: &[String],
) -> Result<Vec<ResponsePoint>, CovarianceError> {
    let bands: Option<Vec<DMatrix<ResponseBand>>> = covariance
        .map(|c| response_bands(system, c, frequencies, path, seed))
        .transpose()?;
    let mut points = Vec::with_capacity(frequencies.len() * outputs.len() * inputs.len());
    for (index, &w) in frequencies.iter().enumerate() {
        let response = path.response(system, w);
        for (i, input) in inputs.iter().enumerate() {
            for (o, output) in outputs.iter().enumerate() {
                let band = bands.as_ref().map(|b| b[index][(o, i)]);
                points.push(response_point(w, (output, input), response[(o, i)], band));
            }
        }
    }
    Ok(points)
}

/// A response of a path (output, input) with its bands.
pub(crate) fn response_point(
    w: f64,
    (output, input): (&str, &str),
    g: Complex64,
    band: Option<ResponseBand>,
) -> ResponsePoint {
    ResponsePoint {
        rad_s: w,
        hz: w / TAU,
        output: output.to_owned(),
        input: input.to_owned(),
        real: finite(g.re),
        imag: finite(g.im),
        covariance: band.and_then(|b| finite_covariance(b.covariance)),
        magnitude: finite(g.norm()),
        magnitude_95: band.and_then(|b| finite_pair(b.magnitude_95)),
        magnitude_99: band.and_then(|b| finite_pair(b.magnitude_99)),
        phase_rad: finite(g.arg()),
        phase_95: band.and_then(|b| finite_pair(b.phase_95)),
        phase_99: band.and_then(|b| finite_pair(b.phase_99)),
        method: band.map(|b| b.method),
    }
}

fn static_gain(
    system: &StateSpace,
    covariance: Option<&ParameterCovariance>,
    outputs: &[String],
    inputs: &[String],
) -> Result<Vec<StaticGain>, CovarianceError> {
    let gain = system.static_gain();
    let std = match covariance {
        Some(c) => static_gain_std(system, c)?,
        None => None,
    };
    let quantile = interval_quantile(0.95, covariance.and_then(|c| c.degrees_of_freedom));
    let mut gains = Vec::with_capacity(outputs.len() * inputs.len());
    for (i, input) in inputs.iter().enumerate() {
        for (o, output) in outputs.iter().enumerate() {
            let value = gain.as_ref().and_then(|g| finite(g[(o, i)]));
            let standard_deviation = std.as_ref().and_then(|s| finite(s[(o, i)]));
            gains.push(StaticGain {
                output: output.clone(),
                input: input.clone(),
                value,
                standard_deviation,
                interval_95: value
                    .zip(standard_deviation)
                    .and_then(|(v, s)| finite_pair([v - quantile * s, v + quantile * s])),
            });
        }
    }
    Ok(gains)
}

fn step_response(
    system: &StateSpace,
    covariance: Option<&ParameterCovariance>,
    outputs: &[String],
    inputs: &[String],
) -> Result<Vec<StepResponse>, CovarianceError> {
    let samples = system.settling_samples(STEP_SAMPLES)?;
    let every = samples.div_ceil(STEP_POINTS);
    let at: Vec<usize> = (0..samples).step_by(every).collect();
    let response = system.step_response(samples);
    let std = covariance
        .map(|c| step_response_std_at(system, c, &at))
        .transpose()?;
    let mut steps = Vec::with_capacity(outputs.len() * inputs.len());
    for (i, input) in inputs.iter().enumerate() {
        for (o, output) in outputs.iter().enumerate() {
            steps.push(StepResponse {
                output: output.clone(),
                input: input.clone(),
                time_s: at.iter().map(|&k| k as f64 * system.sample_time).collect(),
                value: at.iter().map(|&k| finite(response[k][(o, i)])).collect(),
                standard_deviation: std
                    .as_ref()
                    .map(|s| s.iter().map(|s| finite(s[(o, i)])).collect()),
            });
        }
    }
    Ok(steps)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::covariance::test_covariances;
    use nalgebra::dmatrix;

    fn names(letter: &str, count: usize) -> Vec<String> {
        (1..=count).map(|i| format!("{letter}{i}")).collect()
    }

    fn all(
        system: &StateSpace,
        covariance: Option<&ParameterCovariance>,
        frequencies: &[f64],
    ) -> Invariants {
        let (y, u) = (names("y", system.outputs()), names("u", system.inputs()));
        let found = invariants(system, covariance, &y, &u, frequencies, 1).unwrap();
        // Whatever the model, the document survives JSON unchanged, so there is no NaN in it.
        let text = serde_json::to_string(&found).unwrap();
        assert_eq!(serde_json::from_str::<Invariants>(&text).unwrap(), found);
        found
    }

    /// The interval lies about the gain, as wide as its deviation and Student's quantile say.
    #[test]
    fn static_gains_have_intervals() {
        let (system, covariance) = test_covariances::two_by_three(true);
        let quantile = interval_quantile(0.95, covariance.degrees_of_freedom);
        assert!(quantile > 1.9);
        let gain = system.static_gain().unwrap();
        let found = all(&system, Some(&covariance), &[]).static_gain;
        for (i, found) in found.iter().enumerate() {
            let (value, std) = (found.value.unwrap(), found.standard_deviation.unwrap());
            assert_eq!(value, gain[(i % 3, i / 3)]);
            let [low, high] = found.interval_95.unwrap();
            assert!((low + high - 2.0 * value).abs() < 1e-12 * value.abs());
            assert!((high - low - 2.0 * quantile * std).abs() < 1e-9 * std && std > 0.0);
        }
    }

    #[test]
    fn every_channel_at_every_frequency() {
        let (system, covariance) = test_covariances::two_by_three(true);
        let found = all(&system, Some(&covariance), &[0.5, 2.0]);
        assert_eq!(found.poles.len(), 3);
        assert_eq!(found.frequency_response.len(), 2 * 6);
        assert_eq!(found.noise_response.len(), 2 * 9);
        assert_eq!(found.static_gain.len(), 6);
        assert_eq!(found.armax, None);
        let point = found
            .frequency_response
            .iter()
            .find(|p| p.rad_s == 2.0 && p.output == "y3" && p.input == "u1")
            .unwrap();
        let g = system.frequency_response(2.0)[(2, 0)];
        assert_eq!(point.real, Some(g.re));
        let [low, high] = point.magnitude_95.unwrap();
        assert!(low < g.norm() && g.norm() < high);
        let [wider, _] = point.magnitude_99.unwrap();
        assert!(wider < low);
        assert_eq!(found.noise_response[0].input, "e(y1)");
    }

    #[test]
    fn without_covariance_the_uncertainties_are_null() {
        let (mut system, _) = test_covariances::oscillator();
        system.k.fill(0.0);
        let found = all(&system, None, &[1.0]);
        assert!(found.armax.is_some());
        assert!(found.noise_response.is_empty());
        let json = serde_json::to_value(&found).unwrap();
        assert!(json["poles"][0]["covariance"].is_null());
        assert!(json["poles"][0]["natural_frequency_hz"].is_number());
        assert!(json["frequency_response"][0]["magnitude_95"].is_null());
        assert!(json["step_response"][0]["standard_deviation"].is_null());
    }

    #[test]
    fn key_names_are_those_of_the_design() {
        let (system, covariance) = test_covariances::oscillator();
        let json = serde_json::to_value(all(&system, Some(&covariance), &[1.0])).unwrap();
        for key in [
            "real",
            "imag",
            "covariance",
            "natural_frequency_hz",
            "natural_frequency_std",
            "damping",
            "damping_std",
            "time_constant_s",
        ] {
            assert!(!json["poles"][0][key].is_null(), "{key}");
        }
        for key in [
            "rad_s",
            "hz",
            "output",
            "input",
            "real",
            "imag",
            "covariance",
            "magnitude",
            "magnitude_95",
            "magnitude_99",
            "phase_rad",
            "phase_95",
            "phase_99",
        ] {
            assert!(!json["frequency_response"][0][key].is_null(), "{key}");
        }
        assert_eq!(json["frequency_response"][0]["method"], "linear");
    }

    #[test]
    fn hard_models_give_documents_too() {
        let (mut system, covariance) = test_covariances::oscillator();
        // An integrator asked at zero frequency, a double pole, an unstable one, a delay.
        for a in [
            dmatrix![1.0, 0.0; 0.0, 0.5],
            dmatrix![0.5, 1.0; 0.0, 0.5],
            dmatrix![1.0, 1.0; 0.0, 1.0],
            dmatrix![3.0, 0.0; 0.0, 0.5],
            dmatrix![0.0, 1.0; 0.0, 0.0],
        ] {
            system.a = a;
            let nyquist = system.nyquist();
            let found = all(&system, Some(&covariance), &[0.0, 1.0, nyquist]);
            assert_eq!(found.poles.len(), 2);
        }
    }

    #[test]
    fn static_models_and_models_without_input() {
        let (gain, covariance) = test_covariances::static_gain(1e-4);
        let found = all(&gain, None, &[0.1]);
        assert_eq!(found.static_gain[0].value, Some(2.0));
        let found = all(&gain, Some(&covariance), &[0.1]);
        assert!((found.static_gain[0].standard_deviation.unwrap() - 0.01).abs() < 1e-12);

        let noise = StateSpace::new(
            dmatrix![0.9],
            DMatrix::zeros(1, 0),
            dmatrix![1.0],
            DMatrix::zeros(1, 0),
            dmatrix![0.5],
            1.0,
        )
        .unwrap();
        let found = all(&noise, None, &[0.1]);
        assert!(found.frequency_response.is_empty());
        assert_eq!(found.noise_response.len(), 1);
        // Layout without feedthrough and without states has no parameter at all.
        let empty = crate::covariance::ParameterLayout {
            feedthrough: false,
            ..covariance.layout
        };
        let nothing = ParameterCovariance::new(empty, DMatrix::zeros(0, 0), None).unwrap();
        assert_eq!(
            all(&gain, Some(&nothing), &[0.1]).frequency_response[0].magnitude_95,
            Some([2.0, 2.0])
        );
    }

    #[test]
    fn one_name_per_channel() {
        let (system, _) = test_covariances::oscillator();
        let error = invariants(&system, None, &[], &names("u", 1), &[], 1).unwrap_err();
        assert_eq!(error.to_string(), "0 output names were given for 1 outputs");
    }
}
