//! From recordings to system matrices with their covariance: windows, order, estimate, polish.

use std::sync::Arc;

use nalgebra::DMatrix;

use super::data::Data;
use super::dead_time::{self, Evidence};
use super::error::IdentifyError;
use super::finish::{Chosen, finish};
use super::free_run::{FreeRun, by_free_run, many_states};
use super::horizon;
use super::memory::Sizes;
use super::options::{Options, Order};
use super::records::Records;
use super::resolution::stepped;
use super::select::{Selection, Windowed, propose, select};
use super::source::Source;
use super::summary::{PastEvidence, Summary};
use super::truncation::past_for_truncation;
use super::varx::varx;
use crate::covariance::ParameterCovariance;
use crate::model::StateSpace;
use crate::moments::Trend;

/// Largest order `(p + 1) q` of the data factor that is chosen automatically.
const LARGEST_AUTOMATIC_FACTOR: usize = 2000;
/// Target of the truncation measure when the past window is lengthened: well below the gate, because
/// the measure is itself an estimate.
const TRUNCATION_TARGET: f64 = 0.1;

/// A fitted model in the user's units.
#[derive(Debug)]
pub struct Fit {
    /// System matrices.
    pub system: StateSpace,
    /// Covariance of the parameters.
    pub covariance: ParameterCovariance,
    /// Covariance of the innovations.
    pub innovation_covariance: DMatrix<f64>,
    /// Levels of inputs, then outputs.
    pub levels: Vec<f64>,
    /// Delay of each input in samples.
    pub delays: Vec<usize>,
    /// Trend of the first experiment.
    pub first_trend: Trend,
    /// How it came about.
    pub summary: Summary,
    /// What speaks for a dead time.
    pub(super) dead_time: Evidence,
}

/// Fits a model to recordings; where no delay is given, inputs that do nothing for some samples are shifted.
///
/// # Errors
/// [`IdentifyError`] says what is wrong with the recordings or the options.
pub fn fit(records: &mut dyn Records, options: &Options) -> Result<Fit, IdentifyError> {
    let plain = fit_aligned(records, options)?;
    Ok(dead_time::shifted(records, options, &plain).unwrap_or(plain))
}

/// Fits a model with the delays that `options` give.
pub(super) fn fit_aligned(
    records: &mut dyn Records,
    options: &Options,
) -> Result<Fit, IdentifyError> {
    let (r, outputs) = (records.inputs().len(), records.outputs().len());
    let q = r + outputs;
    let lags = lags_needed(options, r, outputs)?;
    let longest = longest_past(options, q);
    let data = Data::read(records, options, lags)?;
    let longest = longest.min(data.lags());

    let mut explanation = Vec::new();
    let ChosenPast {
        past,
        evidence: past_windows,
        limited_to: past_limited_to,
    } = match options.past {
        Some(past) => ChosenPast {
            past,
            evidence: Vec::new(),
            limited_to: None,
        },
        None => choose_past(&data, records, options, longest, &mut explanation)?,
    };
    let stepped = stepped(records)?;
    let mut source = Source::new(&data, records);
    let chosen = windowed(&mut source, past, options)?;
    // A plant that is not linear, recorded with little noise, has no linear order: its free run decides.
    let many = many_states(&chosen, options)?;
    let at_once = if many {
        by_free_run(&chosen, &mut source, options)?
    } else {
        None
    };
    let run = match at_once {
        Some(run) => Ok(run),
        None => {
            let (chosen, selection) =
                linear_order(chosen, longest, &mut source, options, &mut explanation)?;
            let asked =
                !many && matches!(options.order, Order::Auto) && selection.rejected(&chosen);
            let run = if asked {
                by_free_run(&chosen, &mut source, options)?
            } else {
                None
            };
            run.ok_or((chosen, selection))
        }
    };
    let (chosen, selection, free_run_rest, unstable) = match run {
        Ok(FreeRun {
            windowed,
            selection,
            unstable,
            rest,
        }) => {
            explanation.push(format!(
                "past window {} for the free run",
                windowed.factor.past
            ));
            (windowed, selection, rest, unstable)
        }
        Err((chosen, selection)) => (chosen, selection, Vec::new(), false),
    };
    let options = Options {
        stable: options.stable || unstable,
        ..options.clone()
    };
    finish(
        &options,
        &data,
        &source,
        Chosen {
            windowed: chosen,
            selection,
            past_windows,
            stepped,
            past_limited_to,
            free_run_rest,
            explanation,
        },
    )
}

/// The order of a linear plant, with a past window that is long enough for its predictor.
fn linear_order(
    mut chosen: Windowed,
    longest: usize,
    source: &mut Source<'_>,
    options: &Options,
    explanation: &mut Vec<String>,
) -> Result<(Windowed, Selection), IdentifyError> {
    // While the past window is too short the tests of the order have no meaning: they wait until it is chosen.
    let mut selection = if options.past.is_none() {
        propose(&chosen, options, source)?
    } else {
        select(&chosen, options, source)?
    };

    if options.past.is_none() {
        // The past window must be long enough for the predictor of the model that it leads to.
        let (samples, q) = (source.samples(), source.scale().len());
        let limit = horizon::longest_past(samples, q, longest).max(chosen.factor.past);
        for _ in 0..4 {
            let past = chosen.factor.past;
            if selection.noise_free
                || selection.candidate.truncation < TRUNCATION_TARGET
                || past >= limit
            {
                break;
            }
            let wanted = past_for_truncation(
                &selection.candidate.predictor,
                &selection.candidate.state_covariance,
                &chosen.varx.innovation_covariance,
                TRUNCATION_TARGET,
                past + 1,
                limit,
                chosen.varx.columns,
            )
            .unwrap_or(limit)
            // An estimate of the decay from a short window is not to be trusted far beyond it.
            .min(2 * past + 2);
            chosen = windowed(source, wanted, options)?;
            selection = propose(&chosen, options, source)?;
            explanation.retain(|line| !line.starts_with("past window lengthened"));
            explanation.push(format!(
                "past window lengthened to {wanted} so that what it cuts off no longer matters"
            ));
        }
        // Of an order that is given there is nothing to select, so its proposal is final already.
        let proposal_is_final =
            matches!(options.order, Order::Fixed(_)) && !options.method.polishes_itself();
        if !proposal_is_final {
            selection = select(&chosen, options, source)?;
        }
    }
    Ok((chosen, selection))
}

/// Longest past window that comes into question for `q` channels.
fn longest_past(options: &Options, q: usize) -> usize {
    options.past.unwrap_or_else(|| {
        horizon::LONGEST_PAST_ON_DEMAND
            .min((LARGEST_AUTOMATIC_FACTOR / q).saturating_sub(1))
            .max(1)
    })
}

/// Lags that the moments of `inputs` inputs and `outputs` outputs must hold.
///
/// # Errors
/// [`IdentifyError`] for windows or orders that are impossible.
pub(super) fn lags_needed(
    options: &Options,
    inputs: usize,
    outputs: usize,
) -> Result<usize, IdentifyError> {
    for (role, count) in [("input", inputs), ("output", outputs)] {
        if count == 0 {
            return Err(IdentifyError::NoChannel { role });
        }
    }
    let q = inputs + outputs;
    check_windows(options, outputs)?;
    let longest = longest_past(options, q);
    let lags = options.method.lags(longest, options.future);
    let lags = options
        .stochastic
        .map_or(lags, |step| lags.max(step.lags(longest, options.future)));
    Sizes {
        inputs,
        outputs,
        past: options.past,
        lags,
        order: match options.order {
            Order::Auto => None,
            _ => Some(options.order.largest()),
        },
    }
    .check(options)?;
    Ok(lags)
}

fn check_windows(options: &Options, outputs: usize) -> Result<(), IdentifyError> {
    let (past, future) = (options.past, options.future);
    let wrong = |reason: String| {
        let asked: Vec<String> = [("--past", past), ("--future", future)]
            .into_iter()
            .filter_map(|(flag, value)| Some(format!("{flag} {}", value?)))
            .collect();
        Err(IdentifyError::Horizon {
            asked: asked.join(" "),
            reason,
        })
    };
    if past == Some(0) || future == Some(0) {
        return wrong("both windows must be at least 1".to_owned());
    }
    if let (Some(past), Some(future)) = (past, future)
        && future > past
        && !options.method.allows_longer_future()
    {
        return wrong("the future window cannot be longer than the past window".to_owned());
    }
    let largest = match (past, future) {
        (_, Some(future)) => Some(future.saturating_mul(outputs)),
        (Some(past), None) => Some(past.saturating_mul(outputs)),
        (None, None) => None,
    };
    let orders: Vec<usize> = match &options.order {
        Order::Auto => Vec::new(),
        Order::Fixed(n) => vec![*n],
        Order::Compare(list) if list.is_empty() => {
            return Err(IdentifyError::Option(
                "no order is given to compare; name at least one with --order".to_owned(),
            ));
        }
        Order::Compare(list) => list.clone(),
    };
    for order in orders {
        if order == 0 {
            return Err(IdentifyError::Order {
                order,
                largest: largest.unwrap_or(1),
                reason: "a model has at least one state".to_owned(),
            });
        }
        if let Some(largest) = largest
            && order > largest
        {
            return Err(IdentifyError::Order {
                order,
                largest,
                reason: "it needs --future (or --past) of at least order / outputs samples"
                    .to_owned(),
            });
        }
    }
    Ok(())
}

pub(super) fn windowed(
    source: &mut Source<'_>,
    past: usize,
    options: &Options,
) -> Result<Windowed, IdentifyError> {
    Sizes {
        past: Some(past),
        lags: past,
        ..source.sizes()
    }
    .check(options)?;
    let factor = source.factor(past)?;
    let varx = Arc::new(varx(&factor, options.feedthrough)?);
    Ok(Windowed { factor, varx })
}

/// The past window that Akaike's criterion leads to.
struct ChosenPast {
    past: usize,
    evidence: Vec<PastEvidence>,
    /// The limit, where it was the choice and the length of the recording set it.
    limited_to: Option<usize>,
}

fn choose_past(
    data: &Data,
    records: &mut dyn Records,
    options: &Options,
    longest: usize,
    explanation: &mut Vec<String>,
) -> Result<ChosenPast, IdentifyError> {
    let q = data.channels();
    let outputs = records.outputs().len();
    let limit = horizon::longest_past(data.samples, q, horizon::LONGEST_PAST.min(longest));
    // An order or a future window that was asked for must fit in.
    let smallest =
        options
            .order
            .largest()
            .div_ceil(outputs)
            .max(if options.method.allows_longer_future() {
                1
            } else {
                options.future.unwrap_or(1)
            });
    let limit = limit.max(smallest).min(longest);
    let preferred = options
        .method
        .smallest_past(outputs, options.order.largest());
    if smallest > limit || smallest.saturating_mul(q + 1) + outputs >= data.samples {
        let order = options.order.largest();
        // The past window that the recording allows, with more windows than regressors.
        let largest = (data.samples.saturating_sub(outputs + 1) / (q + 1)).min(longest);
        return Err(if order.div_ceil(outputs) >= smallest {
            IdentifyError::Order {
                order,
                largest: largest * outputs,
                reason: format!(
                    "it needs a past window of {smallest} samples, more than {} samples of {q} channels allow",
                    data.samples
                ),
            }
        } else {
            IdentifyError::Horizon {
                asked: format!("--future {smallest}"),
                reason: format!(
                    "{} samples of {q} channels allow at most {largest}",
                    data.samples
                ),
            }
        });
    }
    let criterion = horizon::akaike(&data.factor(records, limit)?, options.feedthrough);
    let best = horizon::best_past(&criterion).unwrap_or(1);
    let noise_free = criterion
        .iter()
        .any(|(_, value)| *value == f64::NEG_INFINITY);
    // Akaike's choice balances bias against variance of the predictions; the states need the tail of the
    // predictor a little more, and the polish takes the extra variance out again.
    let past = if noise_free { best } else { best + 2 };
    let past = past.max(smallest).max(preferred).min(limit);
    explanation.push(format!(
        "past window {past}: Akaike's criterion of the vector ARX model is smallest at {best} (of 1..{limit}){}",
        if past == preferred && best + 2 < preferred {
            format!("; {} wants at least {preferred}", options.method.name())
        } else {
            String::new()
        }
    ));
    let evidence = criterion
        .into_iter()
        .filter(|(_, akaike)| akaike.is_finite())
        .map(|(past, akaike)| PastEvidence { past, akaike })
        .collect();
    let by_length = limit < horizon::LONGEST_PAST.min(longest);
    Ok(ChosenPast {
        past,
        evidence,
        limited_to: (by_length && best == limit).then_some(limit),
    })
}
