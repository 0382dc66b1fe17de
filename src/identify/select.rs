//! Choice of the order, with everything that speaks for it.

use super::candidate::{Candidate, Window, cost_p_value};
use super::error::IdentifyError;
use super::horizon;
use super::options::{Options, Order, Polish};
use super::order::{self, OrderEvidence};
use super::pbsid_opt::{Decomposition, Weight, decompose};
use super::varx::Varx;
use crate::linalg::spectral_radius;
use crate::moments::RFactor;

/// Innovations of two outputs that differ more in size (in the user's units) make the identity weight a
/// question of units.
const LARGEST_UNIT_RATIO: f64 = 3.0;
/// Relative innovation variance below which a record is noise-free to rounding.
const NOISE_FREE: f64 = 1e-16;

/// The data factor of a past window with its vector ARX model.
pub struct Windowed {
    /// Data.
    pub factor: RFactor,
    /// Vector ARX estimate.
    pub varx: Varx,
}

/// The chosen order with everything that spoke for it.
pub struct Selection {
    /// The model of that order.
    pub candidate: Candidate,
    /// Decomposition that it came from.
    pub decomposition: Decomposition,
    /// Its weight.
    pub weight: Weight,
    /// Future window.
    pub future: usize,
    /// What spoke for and against each order.
    pub evidence: Vec<OrderEvidence>,
    /// Why this order.
    pub explanation: String,
    /// Whether the record is noise-free to rounding.
    pub noise_free: bool,
}

/// Estimates the orders that come into question and chooses among them.
///
/// # Errors
/// [`IdentifyError::Order`] for an order that the windows do not allow.
pub fn select(
    windowed: &Windowed,
    options: &Options,
    sample_time: f64,
) -> Result<Selection, IdentifyError> {
    let Windowed { factor, varx } = windowed;
    let (outputs, past) = (factor.outputs, factor.past);
    let noise_free = varx
        .innovation_covariance
        .diagonal()
        .iter()
        .any(|v| *v < NOISE_FREE);
    let window = Window {
        factor,
        varx,
        sample_time,
        polish: !noise_free && options.polish != Polish::Never,
    };
    // Only the referee of the order needs a polished cost when no polish was asked for.
    let referee = Window {
        polish: !noise_free,
        ..window
    };
    let weight = options
        .weight
        .unwrap_or_else(|| automatic_weight(factor, varx));
    let largest = order::LARGEST_AUTOMATIC_ORDER.max(options.order.largest());
    let future_for_choice = options
        .future
        .unwrap_or_else(|| horizon::future_for_order_choice(past, outputs, largest));
    let canonical = decompose(factor, varx, future_for_choice, Weight::Cva)?;
    let correlations = order::canonical_correlations(&canonical.singular_values, factor.columns);
    let possible = canonical.largest_order().min(future_for_choice * outputs);
    let mut evidence = order::singular_value_criterion(
        &correlations,
        factor.inputs,
        outputs,
        factor.columns,
        possible.min(largest.max(order::LARGEST_AUTOMATIC_ORDER)),
    );

    let future_for = |n: usize| {
        options
            .future
            .unwrap_or_else(|| horizon::future_for_order(past, outputs, n))
    };
    let estimate = |n: usize,
                    window: &Window<'_>|
     -> Result<(Candidate, Decomposition), IdentifyError> {
        let decomposition = decompose(factor, varx, future_for(n), weight)?;
        let possible = decomposition.largest_order();
        if n > possible {
            return Err(IdentifyError::Order {
                order: n,
                largest: possible,
                reason: "the recording shows no more states than that in these windows".to_owned(),
            });
        }
        Ok((window.candidate(&decomposition, n)?, decomposition))
    };

    let (order, explanation) = match &options.order {
        Order::Fixed(n) => (*n, format!("order {n}: as asked")),
        Order::Compare(list) => {
            for n in list {
                let (candidate, _) = estimate(*n, &referee)?;
                note(&mut evidence, &candidate, varx);
            }
            let best = best_by_schwarz(&evidence, |e| list.contains(&e.order)).unwrap_or(list[0]);
            (
                best,
                format!("order {best}: smallest Schwarz criterion of those asked for"),
            )
        }
        Order::Auto => choose_order(&mut evidence, varx, &mut |n| {
            estimate(n, &referee).ok().map(|(candidate, _)| candidate)
        }),
    };
    let (candidate, decomposition) = estimate(order, &window)?;
    if window.polish {
        note(&mut evidence, &candidate, varx);
    }
    Ok(Selection {
        future: future_for(order),
        candidate,
        decomposition,
        weight,
        evidence,
        explanation,
        noise_free,
    })
}

fn automatic_weight(factor: &RFactor, varx: &Varx) -> Weight {
    let sizes: Vec<f64> = varx
        .innovation_covariance
        .diagonal()
        .iter()
        .zip(&factor.scale[factor.inputs..])
        .map(|(variance, scale)| variance.sqrt() * scale)
        .collect();
    let largest = sizes.iter().copied().fold(0.0, f64::max);
    let smallest = sizes.iter().copied().fold(f64::INFINITY, f64::min);
    if largest > LARGEST_UNIT_RATIO * smallest {
        Weight::Cva
    } else {
        Weight::Identity
    }
}

/// Enters the test of a candidate into the evidence.
fn note(evidence: &mut Vec<OrderEvidence>, candidate: &Candidate, varx: &Varx) {
    let index = match evidence.iter().position(|e| e.order == candidate.order) {
        Some(index) => index,
        None => {
            evidence.push(OrderEvidence {
                order: candidate.order,
                canonical_correlation: 0.0,
                singular_value_criterion: f64::MAX,
                chi_square: None,
                degrees_of_freedom: None,
                p_value: None,
                schwarz: None,
                spectral_radius: None,
            });
            evidence.len() - 1
        }
    };
    let entry = &mut evidence[index];
    let system = candidate
        .polished
        .as_ref()
        .map_or(&candidate.estimate.system, |p| &p.system);
    entry.spectral_radius = spectral_radius(&system.a).ok();
    let Some(polished) = &candidate.polished else {
        return;
    };
    let outputs = varx.coefficients.nrows();
    let parameters = polished.covariance.layout.identifiable() as f64;
    entry.chi_square = Some(polished.cost);
    entry.degrees_of_freedom = Some(polished.degrees_of_freedom);
    entry.p_value = cost_p_value(
        polished.cost,
        polished.degrees_of_freedom,
        outputs * varx.degrees_of_freedom(),
    );
    entry.schwarz = Some(polished.cost + parameters * (varx.columns as f64).ln());
}

fn best_by_schwarz(
    evidence: &[OrderEvidence],
    among: impl Fn(&OrderEvidence) -> bool,
) -> Option<usize> {
    evidence
        .iter()
        .filter(|e| among(e))
        .filter_map(|e| e.schwarz.map(|s| (e.order, s)))
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(order, _)| order)
}

/// The singular value criterion proposes; the chi-square test moves the order up while it rejects, and down
/// while it does not. An order whose model cannot be computed is too high for the record: only orders below it
/// are looked at then.
fn choose_order(
    evidence: &mut Vec<OrderEvidence>,
    varx: &Varx,
    estimate: &mut dyn FnMut(usize) -> Option<Candidate>,
) -> (usize, String) {
    let proposal = order::proposal(evidence).unwrap_or(1);
    let largest = evidence.len().max(1);
    let mut test = |evidence: &mut Vec<OrderEvidence>, n: usize| {
        if let Some(candidate) = estimate(n) {
            note(evidence, &candidate, varx);
        }
    };
    let find = |evidence: &[OrderEvidence], n: usize| -> Option<OrderEvidence> {
        let entry = evidence.iter().find(|e| e.order == n)?;
        entry.schwarz.is_some().then(|| entry.clone())
    };
    // Without degrees of freedom (order and window match exactly) there is nothing to reject.
    let accepts = |e: &OrderEvidence| e.p_value.is_none_or(|p| p >= order::REFEREE_LEVEL);

    let mut start = proposal;
    test(evidence, start);
    while start > 1 && find(evidence, start).is_none() {
        start -= 1;
        test(evidence, start);
    }
    let Some(mut best) = find(evidence, start) else {
        return (
            proposal,
            format!("order {proposal}: smallest singular value criterion"),
        );
    };
    if accepts(&best) {
        while best.order > 1 {
            test(evidence, best.order - 1);
            // The test of the whole model may accept what a comparison with one state more would not.
            match find(evidence, best.order - 1) {
                Some(fewer) if accepts(&fewer) && fewer.schwarz <= best.schwarz => best = fewer,
                _ => break,
            }
        }
        let order = best.order;
        let reason = if order < proposal {
            format!(
                "the singular value criterion proposes {proposal}, but the chi-square test accepts {order}, and the \
                 Schwarz criterion does not regret the rest"
            )
        } else if order == 1 {
            "smallest singular value criterion, and the chi-square test accepts it".to_owned()
        } else {
            "smallest singular value criterion; the chi-square test accepts it, and one state less is worse"
                .to_owned()
        };
        return (order, format!("order {order}: {reason}"));
    }
    let last = if start < proposal {
        start
    } else {
        (proposal + order::ORDERS_ABOVE).min(largest)
    };
    for order in start + 1..=last {
        test(evidence, order);
        if find(evidence, order).is_some_and(|e| accepts(&e)) {
            return (
                order,
                format!(
                    "order {order}: the singular value criterion proposes {proposal}, but the chi-square test \
                     rejects everything below {order}"
                ),
            );
        }
    }
    let order = best_by_schwarz(evidence, |_| true).unwrap_or(start);
    (
        order,
        format!(
            "order {order}: smallest Schwarz criterion of those that could be computed; the chi-square test accepts \
             none of them, so the plant is not linear of a low order, or the past window is too short for it"
        ),
    )
}
