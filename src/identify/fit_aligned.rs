//! From recordings to system matrices with their covariance, for known delays: windows, order, estimate, polish.

use super::data::{Data, Records, Source, lags_needed, longest_past};
use super::horizon;
use super::identify_error::IdentifyError;
use super::options::{Options, Order};
use super::order::{
    FreeRun, Selection, Windowed, by_free_run, many_states, propose, select, windowed,
};
use super::result::{Chosen, Fit, PastEvidence, finish, stepped};
use super::subspace::past_for_truncation;

/// Target of the truncation measure when the past window is lengthened: well below the gate, because
/// the measure is itself an estimate.
const TRUNCATION_TARGET: f64 = 0.1;

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
