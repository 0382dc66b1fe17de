//! The final model: polish or not, stability, covariance, summary, the user's units.

use nalgebra::DMatrix;

use super::resolution::{Stepped, coarse};
use super::summary::{
    Asked, Diagnostics, Horizons, OrderTest, PastEvidence, StabilityCost, Summary,
};
use super::{scaling, warnings};
use crate::covariance::{
    ParameterCovariance, ParameterLayout, jackknife_covariance, pole_uncertainties,
};
use crate::identify::algorithms::Method;
use crate::identify::data::{Data, Source};
use crate::identify::method::Estimated;
use crate::identify::order::{
    Evidence, FreeRunRest, OrderEvidence, Selection, Windowed, cost_p_value, polish_is_used,
};
use crate::identify::polish::{Effort, Polished, coefficient_cost, polish, stabilised};
use crate::identify::stable::{largest_stable_radius, with_poles_inside, with_stable_predictor};
use crate::identify::subspace::{Varx, varx};
use crate::identify::{CovarianceKind, IdentifyError, Options, Order, Polish};
use crate::linalg::spectral_radius;
use crate::model::StateSpace;
use crate::moments::Trend;

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
    /// What speaks for a dead time.
    pub(crate) dead_time: Evidence,
}

/// Everything decided before the final numbers.
pub(crate) struct Chosen {
    /// Data of the past window.
    pub(crate) windowed: Windowed,
    /// The order.
    pub(crate) selection: Selection,
    /// Evidence on the past windows.
    pub(crate) past_windows: Vec<PastEvidence>,
    /// Channels that were recorded in steps.
    pub(crate) stepped: Vec<Stepped>,
    /// Longest past window that the recording allowed, where it was the choice.
    pub(crate) past_limited_to: Option<usize>,
    /// What the free run on held-out blocks leaves, where that decided about the order.
    pub(crate) free_run_rest: Vec<FreeRunRest>,
    /// How it was decided.
    pub(crate) explanation: Vec<String>,
}

/// Makes the model out of what was chosen.
///
/// # Errors
/// [`IdentifyError::NoStableModel`], or too few blocks for the jackknife.
pub(crate) fn finish(
    options: &Options,
    data: &Data,
    source: &Source<'_>,
    chosen: Chosen,
) -> Result<Fit, IdentifyError> {
    let Chosen {
        windowed,
        selection,
        past_windows,
        stepped,
        past_limited_to,
        free_run_rest,
        mut explanation,
    } = chosen;
    let Windowed { factor, varx } = windowed;
    let Selection {
        candidate,
        singular_values,
        weight,
        future,
        evidence,
        explanation: order_explanation,
        noise_free,
    } = selection;
    explanation.push(order_explanation);
    let order = candidate.order;
    let outputs = factor.outputs;

    let use_polish = polish_is_used(options, &candidate);
    // Prediction error is maximum likelihood already.
    if options.polish == Polish::Auto
        && !options.polishes_by_default()
        && options.method != Method::Pem
        && !noise_free
    {
        explanation.push(format!(
            "not polished: {} was asked for by name and keeps its own numbers; --polish always takes it to maximum \
             likelihood",
            options.own_numbers()
        ));
    }
    let polished_by_method = use_polish && options.method.polishes_itself();
    let polished = candidate
        .polished
        .filter(|_| use_polish && !polished_by_method);
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
    let (mut system, mut covariance, mut innovation_covariance) = match &polished {
        Some(p) => (
            p.system.clone(),
            Some(p.covariance.clone()),
            varx.innovation_covariance.clone(),
        ),
        None => (
            estimate.system.clone(),
            estimate.uncertain.covariance()?,
            estimate.innovation_covariance.clone(),
        ),
    };

    let mut stability = None;
    if options.stable {
        let made = make_stable(&system, &varx)?;
        if let Some((stable, stable_covariance, cost)) = made {
            if stable_covariance.is_some() {
                // Polished under the constraint.
                innovation_covariance = varx.innovation_covariance.clone();
                covariance = stable_covariance;
            }
            system = stable;
            stability = cost;
        }
    }

    // The covariance is that of the estimated gain; the transfer from inputs to outputs does not depend on it.
    let mirrored = with_stable_predictor(&system, &innovation_covariance);
    let predictor_mirrored = mirrored.is_some();
    system = mirrored.unwrap_or(system);

    let mut jackknife_blocks = None;
    let by_formula = covariance.filter(|_| options.covariance == CovarianceKind::Model);
    let covariance = if let Some(covariance) = by_formula {
        covariance
    } else {
        let replicates = replicates(
            source,
            options,
            &Replicated {
                estimate: &estimate,
                system: &system,
                polished: polished.is_some(),
                past: factor.past,
            },
        );
        jackknife_blocks = Some(replicates.len());
        let layout = ParameterLayout::of(&system, varx.feedthrough);
        let replicates: Vec<Vec<f64>> = replicates.iter().map(|s| layout.pack(s)).collect();
        jackknife_covariance(layout, &replicates).ok_or_else(|| {
            let (whose, instead) = match options.covariance {
                CovarianceKind::Robust => ("--covariance robust", "--covariance model"),
                // Estimates without a formula of their own.
                CovarianceKind::Model => ("the covariance of this method", "--polish always"),
            };
            IdentifyError::Option(format!(
                "{whose} needs at least 3 blocks of data, and only {} could be made: give a longer recording, a \
                 smaller --past, or {instead}",
                replicates.len()
            ))
        })?
    };

    let (of_inputs, of_outputs): (Vec<_>, Vec<_>) = stepped
        .into_iter()
        .partition(|channel| channel.index < factor.inputs);
    let (coarse_inputs, coarse_outputs) = if noise_free {
        (Vec::new(), Vec::new())
    } else {
        (
            coarse(&of_inputs, &varx, &data.scale)?,
            coarse(&of_outputs, &varx, &data.scale)?,
        )
    };
    let mut summary = Summary {
        method: options.method,
        stochastic: options.stochastic,
        weight,
        polished: polished.is_some() || polished_by_method,
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
            singular_values: singular_values
                .into_iter()
                .take(SINGULAR_VALUES_KEPT.max(order + 5))
                .collect(),
            spectral_radius: spectral_radius(&system.a)?,
            predictor_radius: spectral_radius(&(&system.a - &system.k * &system.c))?,
            order_test,
            orders: evidence,
            free_run_rest,
            past_windows,
            past_limited_to,
            coarse_inputs,
            coarse_outputs,
            stability,
            jackknife_blocks,
        },
        explanation,
        warnings: Vec::new(),
    };
    summary.warnings = warnings::of_fit(&summary, &varx, noise_free, options);
    if polished.as_ref().is_some_and(|p| !p.converged) || !estimate.converged {
        summary.warnings.push(warnings::not_converged());
    }
    if predictor_mirrored && !noise_free {
        summary.warnings.push(warnings::predictor_mirrored());
    }
    let poles = pole_uncertainties(&system, &covariance).unwrap_or_default();
    summary.warnings.extend(warnings::of_poles(&poles));
    let covariance = scaling::covariance_in_user_units(&covariance, &data.scale);
    // What the recording hardly determines, in units far apart, may lie beyond any number.
    if !covariance.matrix.iter().all(|v| v.is_finite()) {
        return Err(IdentifyError::SingularRegression {
            what: "the states and inputs",
        });
    }
    Ok(Fit {
        system: scaling::system_in_user_units(&system, &data.scale),
        covariance,
        innovation_covariance: scaling::innovation_in_user_units(
            &innovation_covariance,
            &data.scale[factor.inputs..],
        ),
        levels: data.levels.clone(),
        delays: data.delays().to_vec(),
        first_trend: data.trend(0).clone(),
        dead_time: Evidence::new(
            &varx,
            chosen_evidence(&summary),
            factor.inputs,
            &data.scale[factor.inputs..],
        ),
        summary,
    })
}

/// What speaks for and against the order that was chosen.
fn chosen_evidence(summary: &Summary) -> Option<&OrderEvidence> {
    let orders = &summary.diagnostics.orders;
    orders.iter().find(|e| e.order == summary.order)
}

/// A stable system, its covariance when it was polished, and what it cost.
type MadeStable = (
    StateSpace,
    Option<ParameterCovariance>,
    Option<StabilityCost>,
);

/// `None` when the system is stable as it is.
fn make_stable(system: &StateSpace, varx: &Varx) -> Result<Option<MadeStable>, IdentifyError> {
    let limit = largest_stable_radius(varx.columns);
    let radius = spectral_radius(&system.a)?;
    if radius <= limit {
        return Ok(None);
    }
    let (stable, covariance, cost) = match stabilised(system, varx) {
        Ok(Polished {
            system,
            covariance,
            cost,
            ..
        }) => (system, Some(covariance), Some(cost)),
        // A noise-free record has no likelihood to polish.
        Err(_) => (with_poles_inside(system, limit)?, None, None),
    };
    let now = spectral_radius(&stable.a)?;
    if now.is_nan() || now >= 1.0 {
        return Err(IdentifyError::NoStableModel {
            order: system.states(),
            spectral_radius: now,
        });
    }
    // Against the best model of the same order without the constraint.
    let free = polish(system, varx, None, Effort::Full)
        .map(|p| p.cost)
        .or_else(|_| coefficient_cost(system, varx))
        .unwrap_or(f64::NAN);
    let stability = cost
        .map(|cost| (cost - free).max(0.0))
        .filter(|increase| increase.is_finite())
        .map(|increase| StabilityCost {
            spectral_radius_before: radius,
            chi_square_increase: increase,
            p_value: cost_p_value(
                increase,
                1,
                varx.coefficients.nrows() * varx.degrees_of_freedom(),
            ),
        });
    Ok(Some((stable, covariance, stability)))
}

/// What is estimated again without each block.
struct Replicated<'a> {
    estimate: &'a Estimated,
    system: &'a StateSpace,
    polished: bool,
    past: usize,
}

/// The model without each block of the jackknife, all in the same basis: a method keeps its map to the state, and
/// the polish starts from the model of all data.
fn replicates(source: &Source<'_>, options: &Options, of: &Replicated<'_>) -> Vec<StateSpace> {
    let window = if of.polished {
        of.past
    } else {
        of.estimate.window
    };
    source
        .factors_without_blocks(window)
        .iter()
        .filter_map(|part| {
            if of.polished {
                let part_varx = varx(part, options.feedthrough).ok()?;
                return polish(of.system, &part_varx, None, Effort::Full)
                    .ok()
                    .map(|p| p.system);
            }
            of.estimate.uncertain.replicate(part).ok()
        })
        .collect()
}
