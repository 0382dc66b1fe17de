//! From recordings to system matrices with their covariance, inputs shifted by their dead time where that is better.

use super::data::Records;
use super::fit_aligned::fit_aligned;
use super::identify_error::IdentifyError;
use super::options::Options;
use super::order::LEVEL;
use super::result::Fit;

/// Criteria that differ by less are as good: "not worth more than a bare mention" (ibidem).
const AS_GOOD: f64 = 2.0;
/// Samples less than proposed that are tried.
const FEWER: usize = 2;
/// By how much Schwarz's criterion must fall: "very strong" evidence (Kass and Raftery 1995).
const NEEDED: f64 = 10.0;

/// Fits a model to recordings; where no delay is given, inputs that do nothing for some samples are shifted.
///
/// # Errors
/// [`IdentifyError`] says what is wrong with the recordings or the options.
pub fn fit(records: &mut dyn Records, options: &Options) -> Result<Fit, IdentifyError> {
    let plain = fit_aligned(records, options)?;
    Ok(shifted(records, options, &plain).unwrap_or(plain))
}

/// The model of inputs that are shifted by the dead time that `plain` proposes, where that is clearly better.
fn shifted(records: &mut dyn Records, options: &Options, plain: &Fit) -> Option<Fit> {
    let known = !options.input_delay.is_empty() || records.reduced().is_some();
    let proposed = &plain.dead_time.proposed;
    // The smooth beginning of a response may save a state as well, at the price of a bias: only where no order does without.
    let known = known || plain.dead_time.accepted;
    if known || proposed.iter().all(|d| *d == 0) {
        return None;
    }
    // The first coefficients of a smooth response may be too small to be seen: fewer samples are tried as well, and the fewest
    // that do as well are right more often than the most.
    let mut tried: Vec<(f64, Fit)> = Vec::new();
    for fewer in (0..=FEWER).rev() {
        let input_delay: Vec<usize> = proposed.iter().map(|d| d.saturating_sub(fewer)).collect();
        if input_delay.iter().all(|d| *d == 0) {
            continue;
        }
        let options = Options {
            input_delay,
            ..options.clone()
        };
        let Ok(fit) = fit_aligned(records, &options) else {
            continue;
        };
        if let Some(gain) = fit.dead_time.gain_over(&plain.dead_time)
            && fit.dead_time.accepted
        {
            tried.push((gain, fit));
        }
    }
    let most = tried.iter().map(|t| t.0).reduce(f64::max)?;
    let (gain, mut shifted) = tried
        .into_iter()
        .find(|(gain, _)| *gain >= NEEDED && *gain > most - AS_GOOD)?;
    let said: Vec<String> = records
        .inputs()
        .iter()
        .zip(&shifted.delays)
        .filter(|(_, delay)| **delay > 0)
        .map(|(channel, delay)| format!("{} {delay} samples", channel.name))
        .collect();
    shifted.summary.explanation.insert(
        0,
        format!(
            "dead time: {}; no coefficient of the vector ARX model is significant up to there (p > {LEVEL}), and with the input \
             shifted order {} does what takes order {} without (its BIC is smaller by {gain:.0}); --delay 0 \
             leaves it out",
            said.join(", "),
            shifted.summary.order,
            plain.summary.order,
        ),
    );
    Some(shifted)
}
