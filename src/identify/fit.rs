//! From recordings to system matrices with their covariance: windows, order, estimate, polish.

use nalgebra::DMatrix;

use super::candidate::{Candidate, Window, cost_p_value};
use super::data::Data;
use super::error::IdentifyError;
use super::horizon;
use super::options::{CovarianceKind, Options, Order, Polish};
use super::order::{self, OrderEvidence};
use super::pbsid_opt::{Decomposition, Weight, decompose, system_matrices};
use super::polish::{coefficient_cost, polish};
use super::records::Records;
use super::scaling;
use super::stable::{largest_stable_radius, stabilised, with_poles_inside};
use super::summary::{
    Asked, Diagnostics, Horizons, OrderTest, PastEvidence, StabilityCost, Summary,
};
use super::truncation::{LARGEST_FOR_POLISH, past_for_truncation};
use super::varx::{Varx, varx};
use super::warnings;
use crate::covariance::{ParameterCovariance, jackknife_covariance, subspace_covariance};
use crate::linalg::spectral_radius;
use crate::model::StateSpace;
use crate::moments::{RFactor, Trend};

/// Largest order `(p + 1) q` of the data factor that is chosen automatically.
const LARGEST_AUTOMATIC_FACTOR: usize = 2000;
/// Largest order of the data factor at all: its Gram matrix takes 3.2 GB.
const LARGEST_FACTOR: usize = 20_000;
/// Target of the truncation measure when the past window is lengthened: well below the gate, because
/// the measure is itself an estimate.
const TRUNCATION_TARGET: f64 = 0.1;
/// Innovations of two outputs that differ more in size (in the user's units) make the identity weight a
/// question of units.
const LARGEST_UNIT_RATIO: f64 = 3.0;
/// Relative innovation variance below which a record is noise-free to rounding.
const NOISE_FREE: f64 = 1e-16;

/// Singular values that are reported.
const SINGULAR_VALUES_KEPT: usize = 40;

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
}

/// The data factor of the chosen past window with its vector ARX model.
struct Windowed {
    factor: RFactor,
    varx: Varx,
}

/// Fits a model to recordings.
///
/// # Errors
/// [`IdentifyError`] says what is wrong with the recordings or the options.
pub fn fit(records: &mut dyn Records, options: &Options) -> Result<Fit, IdentifyError> {
    let q = records.inputs().len() + records.outputs().len();
    let outputs = records.outputs().len();
    check_windows(options, q, outputs)?;
    let longest = horizon::LONGEST_PAST_ON_DEMAND
        .min((LARGEST_AUTOMATIC_FACTOR / q).saturating_sub(1))
        .max(1);
    let data = Data::read(records, options, options.past.unwrap_or(longest))?;
    let sample_time = records.sample_time();

    let mut explanation = Vec::new();
    let (past, past_windows) = match options.past {
        Some(past) => (past, Vec::new()),
        None => choose_past(&data, records, options, &mut explanation)?,
    };
    let mut chosen = windowed(&data, records, past, options)?;
    let mut selection = select(&chosen, options, sample_time)?;

    if options.past.is_none() {
        // The past window must be long enough for the predictor of the model that it leads to.
        let samples = data.samples;
        let limit = horizon::longest_past(samples, q, data.lags()).max(chosen.factor.past);
        for _ in 0..4 {
            let past = chosen.factor.past;
            if selection.noise_free
                || selection.candidate.truncation < TRUNCATION_TARGET
                || past >= limit
            {
                break;
            }
            let system = selection.system();
            let wanted = past_for_truncation(
                system,
                &selection.candidate.estimate.state_covariance,
                &chosen.varx.innovation_covariance,
                TRUNCATION_TARGET,
                past + 1,
                limit,
                chosen.varx.columns,
            )
            .unwrap_or(limit)
            // An estimate of the decay from a short window is not to be trusted far beyond it.
            .min(2 * past + 2);
            chosen = windowed(&data, records, wanted, options)?;
            selection = select(&chosen, options, sample_time)?;
            explanation.retain(|line| !line.starts_with("past window lengthened"));
            explanation.push(format!(
                "past window lengthened to {wanted} so that what it cuts off no longer matters"
            ));
        }
    }
    finish(
        records,
        options,
        &data,
        chosen,
        selection,
        past_windows,
        explanation,
    )
}

fn check_windows(options: &Options, q: usize, outputs: usize) -> Result<(), IdentifyError> {
    let (past, future) = (options.past, options.future);
    let wrong = |reason: String| {
        Err(IdentifyError::Horizon {
            past: past.unwrap_or(0),
            future: future.unwrap_or(0),
            reason,
        })
    };
    if past == Some(0) || future == Some(0) {
        return wrong("both windows must be at least 1".to_owned());
    }
    if let (Some(past), Some(future)) = (past, future)
        && future > past
    {
        return wrong("the future window cannot be longer than the past window".to_owned());
    }
    if let Some(past) = past
        && (past.saturating_add(1)).saturating_mul(q) > LARGEST_FACTOR
    {
        return wrong(format!(
            "the data factor would have (past + 1) x {q} channels = {} columns; the limit is {LARGEST_FACTOR} \
             ({:.1} GB); lower --past",
            (past.saturating_add(1)).saturating_mul(q),
            (LARGEST_FACTOR * LARGEST_FACTOR * 8) as f64 / 1e9
        ));
    }
    let largest = match (past, future) {
        (_, Some(future)) => Some(future * outputs),
        (Some(past), None) => Some(past * outputs),
        (None, None) => None,
    };
    let orders: Vec<usize> = match &options.order {
        Order::Auto => Vec::new(),
        Order::Fixed(n) => vec![*n],
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
                reason: "it needs a window of at least order / outputs samples".to_owned(),
            });
        }
    }
    Ok(())
}

fn windowed(
    data: &Data,
    records: &mut dyn Records,
    past: usize,
    options: &Options,
) -> Result<Windowed, IdentifyError> {
    let q = data.channels();
    if data.samples <= past {
        return Err(IdentifyError::TooShort {
            samples: data.samples,
            past,
            needed: past * (q + 1) + records.outputs().len() + 1,
        });
    }
    let factor = data.factor(records, past)?;
    let varx = varx(&factor, options.feedthrough)?;
    Ok(Windowed { factor, varx })
}

/// Order asked for, or the largest one that the automatic choice may take.
fn order_in_mind(options: &Options) -> usize {
    match &options.order {
        Order::Auto => 1,
        Order::Fixed(n) => *n,
        Order::Compare(list) => list.iter().copied().max().unwrap_or(1),
    }
}

fn choose_past(
    data: &Data,
    records: &mut dyn Records,
    options: &Options,
    explanation: &mut Vec<String>,
) -> Result<(usize, Vec<PastEvidence>), IdentifyError> {
    let q = data.channels();
    let outputs = records.outputs().len();
    let limit = horizon::longest_past(data.samples, q, horizon::LONGEST_PAST.min(data.lags()));
    // An order or a future window that was asked for must fit in.
    let smallest = order_in_mind(options)
        .div_ceil(outputs)
        .max(options.future.unwrap_or(1));
    let limit = limit.max(smallest).min(data.lags());
    if smallest > limit {
        return Err(IdentifyError::TooShort {
            samples: data.samples,
            past: smallest,
            needed: smallest * (q + 1) + outputs + 1,
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
    let past = past.max(smallest).min(limit);
    explanation.push(format!(
        "past window {past}: Akaike's criterion of the vector ARX model is smallest at {best} (of 1..{limit})"
    ));
    let evidence = criterion
        .into_iter()
        .filter(|(_, akaike)| akaike.is_finite())
        .map(|(past, akaike)| PastEvidence { past, akaike })
        .collect();
    Ok((past, evidence))
}

/// The chosen order with everything that spoke for it.
struct Selection {
    candidate: Candidate,
    decomposition: Decomposition,
    weight: Weight,
    future: usize,
    evidence: Vec<OrderEvidence>,
    explanation: String,
    noise_free: bool,
}

impl Selection {
    fn system(&self) -> &StateSpace {
        self.candidate
            .polished
            .as_ref()
            .map_or(&self.candidate.estimate.system, |p| &p.system)
    }
}

fn select(
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
    let largest = order::LARGEST_AUTOMATIC_ORDER.max(order_in_mind(options));
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

/// The singular value criterion proposes; the chi-square test moves the order up while it rejects, and
/// down while it does not.
fn choose_order(
    evidence: &mut Vec<OrderEvidence>,
    varx: &Varx,
    estimate: &mut dyn FnMut(usize) -> Option<Candidate>,
) -> (usize, String) {
    let proposal = order::proposal(evidence).unwrap_or(1);
    let largest = evidence.len().max(1);
    let mut tested = |evidence: &mut Vec<OrderEvidence>, n: usize| -> Option<f64> {
        note(evidence, &estimate(n)?, varx);
        evidence.iter().find(|e| e.order == n)?.p_value
    };
    // Without a test (the polish did not converge, as happens when the order is too high) nothing speaks
    // against going down.
    let accepts = |p: Option<f64>| p.is_some_and(|p| p >= order::REFEREE_LEVEL);
    let first = tested(evidence, proposal);
    if first.is_none() || accepts(first) {
        let mut order = proposal;
        while order > 1 && accepts(tested(evidence, order - 1)) {
            order -= 1;
        }
        let reason = if order < proposal {
            "the smallest that the chi-square test accepts"
        } else if first.is_none() {
            "smallest singular value criterion"
        } else if order == 1 {
            "smallest singular value criterion, and the chi-square test accepts it"
        } else {
            "smallest singular value criterion, and the chi-square test accepts it but not one state less"
        };
        return (order, format!("order {order}: {reason}"));
    }
    for order in proposal + 1..=(proposal + order::ORDERS_ABOVE).min(largest) {
        if accepts(tested(evidence, order)) {
            return (
                order,
                format!(
                    "order {order}: the singular value criterion proposes {proposal}, but the chi-square test \
                     rejects everything below {order}"
                ),
            );
        }
    }
    let order = best_by_schwarz(evidence, |_| true).unwrap_or(proposal);
    (
        order,
        format!(
            "order {order}: smallest Schwarz criterion of {proposal}..{}; the chi-square test accepts none \
             of them, so the plant is not linear of a low order, or the past window is too short for it",
            (proposal + order::ORDERS_ABOVE).min(largest)
        ),
    )
}

#[allow(clippy::too_many_lines)]
fn finish(
    records: &mut dyn Records,
    options: &Options,
    data: &Data,
    windowed: Windowed,
    selection: Selection,
    past_windows: Vec<PastEvidence>,
    mut explanation: Vec<String>,
) -> Result<Fit, IdentifyError> {
    let Windowed { factor, varx } = windowed;
    let Selection {
        candidate,
        decomposition,
        weight,
        future,
        evidence,
        explanation: order_explanation,
        noise_free,
    } = selection;
    explanation.push(order_explanation);
    let order = candidate.order;
    let outputs = factor.outputs;

    let use_polish = match options.polish {
        Polish::Never => false,
        Polish::Always => true,
        Polish::Auto => candidate.truncation <= LARGEST_FOR_POLISH,
    };
    let polished = candidate.polished.filter(|_| use_polish);
    let order_test = polished.as_ref().map(|p| OrderTest {
        chi_square: p.cost,
        degrees_of_freedom: p.degrees_of_freedom,
        p_value: cost_p_value(
            p.cost,
            p.degrees_of_freedom,
            outputs * varx.degrees_of_freedom(),
        ),
    });
    let estimate = candidate.estimate;
    let (mut system, mut covariance) = match &polished {
        Some(p) => (p.system.clone(), p.covariance.clone()),
        None => (
            estimate.system.clone(),
            subspace_covariance(&estimate, &varx)?,
        ),
    };

    let mut stability = None;
    let limit = largest_stable_radius(varx.columns);
    let radius = spectral_radius(&system.a)?;
    if options.stable && radius > limit {
        let before = coefficient_cost(&system, &varx).unwrap_or(f64::NAN);
        let after = match stabilised(&system, &varx) {
            Ok(constrained) => {
                covariance = constrained.covariance;
                system = constrained.system;
                constrained.cost
            }
            // A noise-free record has no likelihood to polish.
            Err(_) => {
                system = with_poles_inside(&system, limit)?;
                f64::NAN
            }
        };
        let now = spectral_radius(&system.a)?;
        if now.is_nan() || now >= 1.0 {
            return Err(IdentifyError::NoStableModel {
                order,
                spectral_radius: now,
            });
        }
        let increase = (after - before).max(0.0);
        stability = increase.is_finite().then(|| StabilityCost {
            spectral_radius_before: radius,
            chi_square_increase: increase,
            p_value: cost_p_value(increase, 1, outputs * varx.degrees_of_freedom()),
        });
    }

    let mut jackknife_blocks = None;
    if options.covariance == CovarianceKind::Robust {
        let replicates: Vec<Vec<f64>> = data
            .factors_without_blocks(factor.past)
            .iter()
            .filter_map(|part| {
                let part_varx = super::varx::varx(part, options.feedthrough).ok()?;
                let part_decomposition = decompose(part, &part_varx, future, weight).ok()?;
                // The map to the state stays that of all data: so every replicate is in the same basis.
                let replicate = system_matrices(
                    part,
                    &part_varx,
                    &part_decomposition,
                    estimate.state_map.clone(),
                    system.sample_time,
                )
                .ok()?
                .system;
                let replicate = if polished.is_some() {
                    polish(&system, &part_varx, None).ok()?.system
                } else {
                    replicate
                };
                Some(covariance.layout.pack(&replicate))
            })
            .collect();
        jackknife_blocks = Some(replicates.len());
        covariance = jackknife_covariance(covariance.layout, &replicates).ok_or_else(|| {
            IdentifyError::Option(format!(
                "--covariance robust needs at least 3 blocks of data, and only {} could be made: give a longer \
                 recording, a smaller --past, or --covariance model",
                replicates.len()
            ))
        })?;
    }

    let mut summary = Summary {
        method: "pbsid-opt".to_owned(),
        weight,
        polished: polished.is_some(),
        order,
        horizons: Horizons {
            past: factor.past,
            future,
        },
        samples: data.samples,
        degrees_of_freedom: varx.degrees_of_freedom(),
        options: Asked {
            order_automatic: !matches!(options.order, Order::Fixed(_)),
            past_automatic: options.past.is_none(),
            polish: options.polish,
            covariance: options.covariance,
            detrend: options.detrend,
            feedthrough: options.feedthrough,
            stable: options.stable,
            seed: options.seed,
        },
        diagnostics: Diagnostics {
            windows: varx.columns,
            route: factor.route,
            reciprocal_condition: factor.reciprocal_condition,
            truncation: candidate
                .truncation
                .is_finite()
                .then_some(candidate.truncation),
            singular_values: decomposition
                .singular_values
                .iter()
                .take(SINGULAR_VALUES_KEPT.max(order + 5))
                .copied()
                .collect(),
            spectral_radius: spectral_radius(&system.a)?,
            predictor_radius: spectral_radius(&(&system.a - &system.k * &system.c))?,
            order_test,
            orders: evidence,
            past_windows,
            stability,
            jackknife_blocks,
        },
        explanation,
        warnings: Vec::new(),
    };
    summary.warnings = warnings::of_fit(&summary, &varx, noise_free, options);
    Ok(Fit {
        system: scaling::system_in_user_units(&system, &data.scale),
        covariance: scaling::covariance_in_user_units(&covariance, &data.scale),
        innovation_covariance: scaling::innovation_in_user_units(
            &varx.innovation_covariance,
            &data.scale[factor.inputs..],
        ),
        levels: data.levels.clone(),
        delays: data.delays().to_vec(),
        first_trend: data.trend(0).clone(),
        summary,
    })
}
