//! The windows that are asked for, and the lags that the moments need for them.

use super::memory_need::Sizes;
use crate::identify::{IdentifyError, Options, Order, horizon};

/// Largest order `(p + 1) q` of the data factor that is chosen automatically.
const LARGEST_AUTOMATIC_FACTOR: usize = 2000;

/// Longest past window that comes into question for `q` channels.
pub(crate) fn longest_past(options: &Options, q: usize) -> usize {
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
pub(crate) fn lags_needed(
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
