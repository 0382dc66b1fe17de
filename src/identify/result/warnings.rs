//! What a user should know before trusting a model, in plain words.

use super::resolution::{CoarseChannel, WORTH_A_WARNING};
use super::summary::Summary;
use crate::covariance::{PoleUncertainty, projected_variance};
use crate::identify::algorithms::Method;
use crate::identify::order::REFEREE_LEVEL;
use crate::identify::subspace::{LARGEST_FOR_POLISH, Varx};
use crate::identify::{Options, Polish};
use crate::moments::Route;

/// Truncation that PBSID_opt itself no longer tolerates.
const LARGEST_FOR_SUBSPACE: f64 = 100.0;
/// Samples per regressor below which the asymptotic formulas are optimistic: their relative error in the
/// variance is about `p q / Nc`.
const SAMPLES_PER_REGRESSOR: f64 = 5.0;
/// Reciprocal condition below which some combination of past signals is hardly excited.
const POOR_EXCITATION: f64 = 1e-6;
/// Standard deviations from the unit circle within which a pole may as well lie on it: one-sided, 2.3 %.
const CLOSE_TO_THE_CIRCLE: f64 = 2.0;

/// Warnings that follow from the fit alone.
pub(super) fn of_fit(
    summary: &Summary,
    varx: &Varx,
    noise_free: bool,
    options: &Options,
) -> Vec<String> {
    let mut out = Vec::new();
    if noise_free {
        out.push(
            "the recording is noise-free to rounding: the model is exact, and its uncertainty of no meaning"
                .to_owned(),
        );
    }
    if summary.diagnostics.spectral_radius >= 1.0 {
        out.push(format!(
            "the model is unstable or integrating (spectral radius {:.6}): a free run may drift away; --stable asks for \
             a stable one",
            summary.diagnostics.spectral_radius
        ));
    }
    if let Some(test) = &summary.diagnostics.order_test
        && let Some(p) = test.p_value
        && p < REFEREE_LEVEL
    {
        let cut_off = summary.diagnostics.truncation.unwrap_or(f64::INFINITY) > LARGEST_FOR_POLISH;
        let or_window = if cut_off {
            ", or the past window is too short"
        } else {
            ""
        };
        out.push(format!(
            "a linear model of order {} does not explain the recording (chi-square {:.0} with {} degrees of freedom, \
             p = {p:.1e}): the order is too low, or the plant is not linear{or_window}; the covariance is optimistic, \
             --covariance robust is not",
            summary.order, test.chi_square, test.degrees_of_freedom
        ));
    }
    out.extend(summary.diagnostics.free_run_rest.iter().map(|rest| {
        let band = rest.band_hz.map_or_else(String::new, |[from, to]| {
            format!(", nine tenths of it between {from:.3e} and {to:.3e} Hz")
        });
        format!(
            "a linear model of order {} does not hold {:.3} % of the motion of {} (rms error of the free run on parts of \
             the recording held out){band}",
            summary.order,
            100.0 * rest.share,
            rest.output
        )
    }));
    // A model of as many states as the regression has past outputs is that regression itself, whose predictor forgets all
    // beyond the window: it says that nothing is cut off, whatever is.
    let whole_regression = summary.horizons.past * varx.innovation_covariance.nrows();
    if options.past.is_some() && summary.order >= whole_regression && !noise_free {
        out.push(format!(
            "a past window of {} holds no more than a model of order {}, which cannot tell what the window cuts off: raise \
             --past",
            summary.horizons.past, summary.order
        ));
    }
    match summary.diagnostics.truncation {
        // The oblique split of innovation estimation leaves hardly any bias (at most 0.15 standard deviations where
        // the others have 0.3: example 2 of Chiuso & Picci).
        Some(eta)
            if eta > LARGEST_FOR_SUBSPACE
                && (summary.polished || summary.method != Method::InnovationEstimation) =>
        {
            out.push(format!(
            "the past window of {} is too short for the noise dynamics (truncation {eta:.0}): estimates are biased; \
             raise --past",
            summary.horizons.past
        ));
        }
        Some(eta) if eta > LARGEST_FOR_POLISH && summary.polished => out.push(format!(
            "the past window of {} cuts off a part of the noise dynamics (truncation {eta:.1}, better below \
             {LARGEST_FOR_POLISH}): the uncertainty is somewhat understated; raise --past",
            summary.horizons.past
        )),
        Some(eta) if eta > LARGEST_FOR_POLISH
            && options.polish == Polish::Auto
            && options.polishes_by_default() => out.push(format!(
            "not polished to maximum likelihood, because the past window of {} cuts off too much (truncation \
             {eta:.1}, at most {LARGEST_FOR_POLISH}): raise --past",
            summary.horizons.past
        )),
        None if !noise_free => out.push(
            "what the past window cuts off could not be measured: the predictor of the model is not stable".to_owned(),
        ),
        _ => {}
    }
    let regressors = varx.regressors() as f64;
    if (varx.columns as f64) < SAMPLES_PER_REGRESSOR * regressors && !noise_free {
        out.push(format!(
            "short recording: {} windows for {} regressors; the uncertainty is understated by about {:.0} %",
            varx.columns,
            varx.regressors(),
            100.0 * regressors / varx.columns as f64
        ));
    }
    if varx.dependent {
        out.push(
            "the past signals are linearly dependent: the input does not excite the plant richly enough for this past \
             window, or one channel is computed from the others"
                .to_owned(),
        );
    } else if summary.diagnostics.route == Route::PanelQr
        && summary.diagnostics.reciprocal_condition < POOR_EXCITATION
    {
        out.push(format!(
            "poor excitation: some combinations of the past signals hardly occur (reciprocal condition {:.1e}), so \
             parts of the model rest on little information; their uncertainty says so",
            summary.diagnostics.reciprocal_condition
        ));
    }
    if let Some(past) = summary.diagnostics.past_limited_to {
        out.push(format!(
            "short recording: {} samples allow a past window of {past} at most, and that is what Akaike's criterion \
             chose; a model of a higher order, or slower noise, would not have been seen",
            summary.samples
        ));
    }
    out.extend(of_rounding(
        &summary.diagnostics.coarse_inputs,
        "if it was measured so, and not commanded",
    ));
    if let Some(stability) = &summary.diagnostics.stability {
        out.push(match stability.p_value {
            Some(p) if p < REFEREE_LEVEL => format!(
                "the recording speaks against a stable model (chi-square rises by {:.1}, p = {p:.1e})",
                stability.chi_square_increase
            ),
            _ => format!(
                "made stable at no significant cost (chi-square rises by {:.2})",
                stability.chi_square_increase
            ),
        });
    }
    out
}

/// Warnings about poles that may as well lie on the unit circle.
pub(super) fn of_poles(poles: &[PoleUncertainty]) -> Vec<String> {
    poles
        .iter()
        .filter(|p| p.pole.value.im >= 0.0)
        .filter_map(|p| {
            let radius = p.pole.value.norm();
            let (c, s) = (p.pole.value.re / radius, p.pole.value.im / radius);
            let deviation = projected_variance(&p.covariance?, c, s).sqrt();
            let distance = 1.0 - radius;
            // An unstable pole is told of by the spectral radius.
            (distance > 0.0 && distance < CLOSE_TO_THE_CIRCLE * deviation).then(|| {
                let what = if p.pole.value.im > 0.0 {
                    "an undamped resonance"
                } else {
                    "an integrator"
                };
                format!(
                    "a pole with |z| = {radius:.6} +- {deviation:.6} cannot be told from {what}: its time constant, the \
                     gain it makes and a free run over long times are not known, and near its frequency bands are too \
                     narrow; a longer recording would settle it"
                )
            })
        })
        .collect()
}

/// What rounding does, when it does more than the stated uncertainty says.
fn of_rounding(channels: &[CoarseChannel], condition: &str) -> Vec<String> {
    channels
        .iter()
        .filter(|channel| channel.bias > WORTH_A_WARNING)
        .map(|channel| {
            format!(
                "{} was recorded in steps of {}: {condition}, this biases the model by up to {:.0} standard deviations, \
                 which its uncertainty does not say; record it with a finer resolution",
                channel.channel, channel.step, channel.bias
            )
        })
        .collect()
}

/// Warnings that follow when the residual tests find that the recordings were taken in closed loop.
pub(crate) fn of_closed_loop(summary: &Summary) -> Vec<String> {
    let mut out = Vec::new();
    // The polish to maximum likelihood ends at the same model from any start; the few steps of a method that polishes
    // itself do not leave its bias behind.
    let kept = !summary.polished || summary.method.polishes_itself();
    let step = summary.stochastic.filter(|step| step.open_loop_only());
    if summary.method.open_loop_only() && kept {
        out.push(format!(
            "the recording was taken in closed loop, and --method {} is for open loop: the model is biased, and its \
             uncertainty does not say so; leave out --method, or take whitening, innovation-estimation or pem",
            summary.method.name()
        ));
    } else if let (Some(step), false) = (step, summary.polished) {
        out.push(format!(
            "the recording was taken in closed loop, and --stochastic {} is for open loop: K and the innovation \
             covariance are biased; leave it out, or take --stochastic innovations",
            step.name()
        ));
    }
    out.extend(of_rounding(
        &summary.diagnostics.coarse_outputs,
        "if the controller acted on what was not rounded",
    ));
    if summary.options.feedthrough {
        out.push(
            "the recording was taken in closed loop: D is only right when the controller acts with a delay; leave out \
             --feedthrough when it does not"
                .to_owned(),
        );
    }
    out
}

/// The gain `K` had to be replaced.
pub(super) fn predictor_mirrored() -> String {
    "the estimated predictor was unstable, so its gain K was replaced by the stable one of the same noise spectrum: \
     the noise model is uncertain; a longer recording, a lower --order or a longer --past would settle it"
        .to_owned()
}

/// The polish ran out of steps.
pub(super) fn not_converged() -> String {
    "the polish has not converged: some combination of the parameters is hardly determined by the recording, usually \
     because the order is too high; compare lower orders with --order"
        .to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Pole;
    use num_complex::Complex64;

    fn pole(re: f64, im: f64, radial_std: f64) -> PoleUncertainty {
        let value = Complex64::new(re, im);
        let (c, s) = (re / value.norm(), im / value.norm());
        // Uncertain along the radius alone.
        let v = radial_std * radial_std;
        PoleUncertainty {
            pole: Pole {
                value,
                natural_frequency: 1.0,
                damping: None,
                time_constant: None,
            },
            covariance: Some([[v * c * c, v * c * s], [v * c * s, v * s * s]]),
            natural_frequency_std: None,
            damping_std: None,
            time_constant_std: None,
        }
    }

    #[test]
    fn poles_that_may_lie_on_the_circle_are_told_of() {
        let distance = 1e-3;
        let (re, im) = (0.6 * (1.0 - distance), 0.8 * (1.0 - distance));
        let close = distance / CLOSE_TO_THE_CIRCLE;
        assert!(of_poles(&[pole(re, im, 0.9 * close)]).is_empty());
        let told = of_poles(&[pole(re, im, 1.1 * close), pole(re, -im, 1.1 * close)]);
        assert_eq!(told.len(), 1, "one of a pair");
        assert!(told[0].contains("undamped resonance"), "{}", told[0]);
        let told = of_poles(&[pole(1.0 - distance, 0.0, 1.1 * close)]);
        assert!(told[0].contains("an integrator"), "{told:?}");
        // Outside it is unstable, and said so elsewhere.
        assert!(of_poles(&[pole(1.001, 0.0, 1.0)]).is_empty());
    }

    #[test]
    fn rounding_is_told_of_where_it_matters() {
        let channel = |bias: f64| CoarseChannel {
            channel: "flow".to_owned(),
            step: 0.25,
            bias,
        };
        let told = of_rounding(
            &[
                channel(0.9 * WORTH_A_WARNING),
                channel(3.0 * WORTH_A_WARNING),
            ],
            "if so",
        );
        assert_eq!(told.len(), 1);
        assert!(told[0].contains("flow was recorded in steps of 0.25"));
        assert!(told[0].contains("up to 3 standard"), "{}", told[0]);
    }
}
