//! Choice of the order, with everything that speaks for it.

use std::sync::Arc;

use super::evidence::{self, OrderEvidence};
use super::order_candidate::{Candidate, Window, cost_p_value};
use crate::identify::algorithms::Method;
use crate::identify::data::{Sizes, Source};
use crate::identify::method::{Decomposed, Windows};
use crate::identify::polish::Effort;
use crate::identify::subspace::{LARGEST_FOR_POLISH, Varx, Weight, decompose, varx};
use crate::identify::{IdentifyError, Options, Order, horizon};
use crate::linalg::spectral_radius;
use crate::moments::RFactor;

/// Innovations of two outputs that differ more in size (in the user's units) make the identity weight a
/// question of units.
const LARGEST_UNIT_RATIO: f64 = 3.0;
/// Relative innovation variance below which a record is noise-free to rounding.
const NOISE_FREE: f64 = 1e-16;

/// The data factor of a past window with its vector ARX model.
pub(crate) struct Windowed {
    /// Data.
    pub(crate) factor: Arc<RFactor>,
    /// Vector ARX estimate.
    pub(crate) varx: Arc<Varx>,
}

/// The data of a past window, if they fit into memory.
///
/// # Errors
/// [`IdentifyError::Limit`], or a window that does not fit the recordings.
pub(crate) fn windowed(
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

/// The chosen order with everything that spoke for it.
pub(crate) struct Selection {
    /// The model of that order.
    pub(crate) candidate: Candidate,
    /// Singular values of the decomposition that it came from.
    pub(crate) singular_values: Vec<f64>,
    /// Weight of that decomposition.
    pub(crate) weight: Weight,
    /// Future window.
    pub(crate) future: usize,
    /// What spoke for and against each order.
    pub(crate) evidence: Vec<OrderEvidence>,
    /// Why this order.
    pub(crate) explanation: String,
    /// Whether the record is noise-free to rounding.
    pub(crate) noise_free: bool,
}

impl Selection {
    /// Whether the chi-square test rejects the order, over a past window that is long enough for this test.
    pub(crate) fn rejected(&self, windowed: &Windowed) -> bool {
        let varx = &windowed.varx;
        let freedom = varx.coefficients.nrows() * varx.degrees_of_freedom();
        self.candidate.truncation <= LARGEST_FOR_POLISH
            && self.candidate.polished.as_ref().is_some_and(|p| {
                cost_p_value(p.cost, p.degrees_of_freedom, freedom)
                    .is_some_and(|p| p < evidence::REFEREE_LEVEL)
            })
    }
}

/// The model of the order that is asked for or that the singular values propose, without any test of it.
///
/// # Errors
/// As [`select`].
pub(crate) fn propose(
    windowed: &Windowed,
    options: &Options,
    source: &mut Source<'_>,
) -> Result<Selection, IdentifyError> {
    select_by(windowed, options, source, true)
}

/// Estimates the orders that come into question and chooses among them.
///
/// # Errors
/// [`IdentifyError::Order`] for an order that the windows do not allow.
pub(crate) fn select(
    windowed: &Windowed,
    options: &Options,
    source: &mut Source<'_>,
) -> Result<Selection, IdentifyError> {
    select_by(windowed, options, source, false)
}

fn select_by(
    windowed: &Windowed,
    options: &Options,
    source: &mut Source<'_>,
    proposal_only: bool,
) -> Result<Selection, IdentifyError> {
    let Windowed { factor, varx } = windowed;
    let (outputs, past) = (factor.outputs, factor.past);
    let noise_free = varx
        .innovation_covariance
        .diagonal()
        .iter()
        .any(|v| *v < NOISE_FREE);
    let polish = !noise_free && options.may_polish();
    let weight = options.weight.unwrap_or_else(|| {
        options
            .method
            .default_weight(automatic_weight(factor, varx))
    });
    let largest = evidence::LARGEST_AUTOMATIC_ORDER.max(options.order.largest());
    let future_for_choice = options
        .future
        .unwrap_or_else(|| horizon::future_for_order_choice(past, outputs, largest));
    // A method may look further ahead than back; the singular values that orders are compared by do not.
    let ahead = future_for_choice.min(past);
    let canonical = decompose(factor, varx, ahead, Weight::Cva)?;
    let correlations =
        evidence::canonical_correlations(&canonical.svd.singular_values, factor.columns);
    let possible = canonical.svd.largest_order().min(ahead * outputs);
    let mut evidence = evidence::singular_value_criterion(
        &correlations,
        factor.inputs,
        outputs,
        factor.columns,
        possible.min(largest.max(evidence::LARGEST_AUTOMATIC_ORDER)),
    );

    let mut estimator = Estimator {
        // The referee of the order needs a polished cost also when no polish was asked for.
        window: Window {
            windows: Windows {
                factor: Arc::clone(factor),
                varx: Arc::clone(varx),
                future: future_for_choice,
                weight,
                stochastic: options.stochastic,
                comparing: true,
                polish_by_method: false,
                sample_time: source.sample_time(),
            },
            polish: !noise_free,
            effort: Effort::Referee,
        },
        options,
        method: options.method.for_comparing_orders(),
        source,
        decompositions: Vec::new(),
        candidates: Vec::new(),
    };
    let (order, explanation) = match &options.order {
        Order::Auto if proposal_only => (evidence::proposal(&evidence).unwrap_or(1), String::new()),
        Order::Compare(_) if proposal_only => (options.order.largest(), String::new()),
        Order::Fixed(n) => (*n, format!("order {n}: as asked")),
        Order::Compare(list) => {
            for n in list {
                note(&mut evidence, estimator.candidate(*n)?, varx);
            }
            let best = best_by_schwarz(&evidence, |e| list.contains(&e.order)).unwrap_or(list[0]);
            (
                best,
                format!("order {best}: smallest BIC of those asked for"),
            )
        }
        Order::Auto => choose_order(&mut evidence, varx, &mut estimator)?,
    };
    estimator.for_good(order, polish, proposal_only);
    let candidate = estimator.candidate(order)?.clone();
    if polish {
        note(&mut evidence, &candidate, varx);
    }
    let future = estimator.future_for(order);
    Ok(Selection {
        future,
        candidate,
        singular_values: estimator.decomposition(future)?.singular_values,
        weight,
        evidence,
        explanation,
        noise_free,
    })
}

/// Estimates orders of one past window, each once, and decomposes each future window once.
struct Estimator<'a, 'b> {
    window: Window,
    options: &'a Options,
    method: Method,
    source: &'a mut Source<'b>,
    decompositions: Vec<(usize, Decomposed)>,
    candidates: Vec<Candidate>,
}

impl Estimator<'_, '_> {
    /// From here on candidates are final: with what the referee was content is taken to its end, or estimated again. A
    /// proposal is not final, and a method that makes its own improvements waits with them.
    fn for_good(&mut self, order: usize, polish: bool, proposal_only: bool) {
        let own_numbers = self.options.method.polishes_itself();
        self.candidates
            .retain(|c| c.order == order && polish && !own_numbers && c.polished.is_some());
        let kept = std::mem::take(&mut self.candidates);
        self.candidates = kept.into_iter().map(|c| self.window.finished(c)).collect();
        self.window.polish = polish && !own_numbers;
        self.window.effort = Effort::Full;
        if own_numbers && !proposal_only {
            self.method = self.options.method;
            self.window.windows.comparing = false;
            self.window.windows.polish_by_method = polish;
            self.decompositions.clear();
        }
    }

    /// Estimates an order once more, from the accepted model of the order above it. What a subspace method makes of
    /// coloured inputs may be too poor a start, and then the order seems to be too low.
    fn reconsider(&mut self, order: usize) -> Option<&Candidate> {
        let at = |n: usize| self.candidates.iter().position(|c| c.order == n);
        let (index, above) = (at(order)?, at(order + 1)?);
        let larger = &self.candidates[above].polished.as_ref()?.system;
        let found = self.window.reconsidered(&self.candidates[index], larger)?;
        self.candidates[index] = found;
        self.candidates.get(index)
    }

    fn future_for(&self, order: usize) -> usize {
        let factor = &self.window.windows.factor;
        self.options
            .future
            .unwrap_or_else(|| self.method.future(factor.past, factor.outputs, order))
    }

    fn decomposition(&mut self, future: usize) -> Result<Decomposed, IdentifyError> {
        if let Some((_, known)) = self.decompositions.iter().find(|(f, _)| *f == future) {
            return Ok(known.clone());
        }
        let windows = Windows {
            future,
            ..self.window.windows.clone()
        };
        let own = self.method.decompose(&windows, self.source)?;
        let made = match self.options.stochastic {
            Some(step) if !self.method.has_own(step) => step.instead_of_own(own, windows),
            _ => own,
        };
        self.decompositions.push((future, made.clone()));
        Ok(made)
    }

    fn candidate(&mut self, order: usize) -> Result<&Candidate, IdentifyError> {
        let known = self.candidates.iter().position(|c| c.order == order);
        let index = match known {
            Some(index) => index,
            None => {
                let sizes = Sizes {
                    past: Some(self.window.windows.factor.past),
                    order: Some(order),
                    ..self.source.sizes()
                };
                sizes.check(self.options)?;
                let decomposition = self.decomposition(self.future_for(order))?;
                let possible = decomposition.largest_order;
                if order > possible {
                    return Err(IdentifyError::Order {
                        order,
                        largest: possible,
                        reason: "the recording shows no more states than that in these windows"
                            .to_owned(),
                    });
                }
                let made = self.window.candidate(&decomposition, order, self.source)?;
                self.candidates.push(made);
                self.candidates.len() - 1
            }
        };
        Ok(&self.candidates[index])
    }
}

/// The weight of the decomposition where none is asked for.
pub(super) fn automatic_weight(factor: &RFactor, varx: &Varx) -> Weight {
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
                // Beyond the last singular value that is not zero only the penalty is left.
                canonical_correlation: 0.0,
                singular_value_criterion: evidence::penalty(
                    candidate.order,
                    candidate.estimate.system.inputs(),
                    candidate.estimate.system.outputs(),
                    varx.columns,
                ),
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
    estimator: &mut Estimator<'_, '_>,
) -> Result<(usize, String), IdentifyError> {
    let proposal = evidence::proposal(evidence).unwrap_or(1);
    let largest = evidence.len().max(1);
    let test = |evidence: &mut Vec<OrderEvidence>, estimator: &mut Estimator<'_, '_>, n: usize| {
        match estimator.candidate(n) {
            Ok(candidate) => note(evidence, candidate, varx),
            // How much memory there is must not decide which model comes out.
            Err(error @ IdentifyError::Limit(_)) => return Err(error),
            Err(_) => {}
        }
        Ok(())
    };
    let find = |evidence: &[OrderEvidence], n: usize| -> Option<OrderEvidence> {
        let entry = evidence.iter().find(|e| e.order == n)?;
        entry.schwarz.is_some().then(|| entry.clone())
    };
    // Without degrees of freedom (order and window match exactly) there is nothing to reject.
    let accepts = |e: &OrderEvidence| e.p_value.is_none_or(|p| p >= evidence::REFEREE_LEVEL);

    let mut start = proposal;
    test(evidence, estimator, start)?;
    while start > 1 && find(evidence, start).is_none() {
        start -= 1;
        test(evidence, estimator, start)?;
    }
    let Some(mut best) = find(evidence, start) else {
        return Ok((
            proposal,
            format!("order {proposal}: smallest singular value criterion"),
        ));
    };
    if accepts(&best) {
        while best.order > 1 {
            let order = best.order - 1;
            test(evidence, estimator, order)?;
            // The test of the whole model may accept what a comparison with one state more would not.
            let will_do = |e: &OrderEvidence| accepts(e) && e.schwarz <= best.schwarz;
            if !find(evidence, order).is_some_and(|e| will_do(&e))
                && let Some(candidate) = estimator.reconsider(order)
            {
                note(evidence, candidate, varx);
            }
            match find(evidence, order) {
                Some(fewer) if will_do(&fewer) => best = fewer,
                _ => break,
            }
        }
        let order = best.order;
        let reason = if order < proposal {
            format!(
                "the singular value criterion proposes {proposal}, but the chi-square test accepts {order}, and the \
                 BIC is not larger without the rest"
            )
        } else if order == 1 {
            "smallest singular value criterion, and the chi-square test accepts it".to_owned()
        } else {
            "smallest singular value criterion; the chi-square test accepts it, and one state less is worse"
                .to_owned()
        };
        return Ok((order, format!("order {order}: {reason}")));
    }
    // Where the past window cuts off too much, the cost holds that as well, and the test says nothing about the order.
    let cut_off = estimator.candidate(start)?.truncation;
    if cut_off > LARGEST_FOR_POLISH {
        let above: Vec<usize> =
            (start + 1..=(start + evidence::ORDERS_ABOVE).min(largest)).collect();
        // A state too many, which only noise has, may be what lasts longer than the window.
        let below: Vec<usize> = (1..start).rev().collect();
        for direction in [above, below] {
            let mut last = best.schwarz;
            for order in direction {
                test(evidence, estimator, order)?;
                match find(evidence, order) {
                    Some(next) if next.schwarz < last => last = next.schwarz,
                    _ => break,
                }
            }
        }
        let order = best_by_schwarz(evidence, |_| true).unwrap_or(start);
        return Ok((
            order,
            format!(
                "order {order}: smallest BIC; the past window cuts off too much of order {start} \
                 (truncation {cut_off:.1}) for the chi-square test to tell"
            ),
        ));
    }
    let last = if start < proposal {
        start
    } else {
        (proposal + evidence::ORDERS_ABOVE).min(largest)
    };
    for order in start + 1..=last {
        test(evidence, estimator, order)?;
        if find(evidence, order).is_some_and(|e| accepts(&e)) {
            return Ok((
                order,
                format!(
                    "order {order}: the singular value criterion proposes {proposal}, but the chi-square test \
                     rejects everything below {order}"
                ),
            ));
        }
    }
    let order = best_by_schwarz(evidence, |_| true).unwrap_or(start);
    Ok((
        order,
        format!(
            "order {order}: smallest BIC of those that could be computed; the chi-square test accepts \
             none of them, so the plant is not linear of a low order, or the past window is too short for it"
        ),
    ))
}
