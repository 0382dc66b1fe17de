//! The Gauss-Newton polish: the maximum-likelihood model of the given order, computed from `R` alone.
//!
//! The vector ARX coefficients are a sufficient statistic as long as the past window is long enough, so
//! the prediction-error estimate is the model whose own coefficients
//! `Xi(theta) = [C At^{p-1} [B~ K] ... C [B~ K] (D)]`, `At = A - K C`, `B~ = B - K D`, are nearest to the
//! estimated ones in their own metric:
//!
//! `min_theta | Lambda^{-1/2} (Ry' - Xi(theta) Rz') |_F^2`.
//!
//! At the minimum the cost is chi-square with `l m - n (r + 2 l) (- l r)` degrees of freedom when order
//! and window are right, which makes a test of both; and the inverse of the information matrix is the
//! Cramer-Rao bound. Indirect prediction-error method of Soderstrom, Stoica & Friedlander (1991) applied
//! to the first step of PBSID.

mod balanced;
mod linearised;
mod predictor;
mod stabilised;

use nalgebra::DMatrix;

use self::balanced::balanced;
pub(super) use self::balanced::reduced;
use self::linearised::{boundary_gradient, linearise};
pub(super) use self::predictor::Problem;
pub use self::predictor::predictor_coefficients;
pub(super) use self::stabilised::stabilised;
use super::stable::{with_poles_inside, with_stable_predictor};
use super::subspace::Varx;
use crate::covariance::{ParameterCovariance, ParameterLayout};
use crate::linalg::{LinalgError, all_finite, cholesky_upper, multiply_nt, solve_upper_transposed};
use crate::model::StateSpace;

/// The iteration ends when a step promises less than this in the cost, which is in units of chi-square: the
/// parameters are then within 1e-10 standard deviations of the minimum, whatever start they came from. In a flat valley it ends
/// before ([`FLAT_STEPS`]), and rounding of the start is seen along it.
const DECREASE: f64 = 1e-20;
/// Of steps that promise less than this, the costs differ by little more than their rounding (1e-16 of a cost of 100 is
/// 1e-14): choosing among them would be chance, and two starts that differ by rounding would end 1e-6 standard deviations
/// apart. From here on the plain step is taken, as long as each promises less than the one before.
const PLAIN: f64 = 1e-10;
/// The referee of an order needs no more.
const REFEREE_DECREASE: f64 = 1e-12;
/// A Gauss-Newton iteration that has not ended by then will not.
const ITERATIONS: usize = 60;
/// Lengths of the Gauss-Newton step that are tried.
const LENGTHS: [f64; 3] = [1.0, 0.5, 0.25];
/// Levenberg-Marquardt dampings that are tried, relative to the largest singular value of the Jacobian, as powers of
/// ten: `(from, to, steps a decade)`. An order too high, or an input that hardly excites some direction, makes the
/// Jacobian nearly singular, and only damping of the size of the singular values in question helps there. Where that is
/// a large share of them, a decade is too coarse: along a curved valley the longest step that still leads down counts.
const DAMPINGS: [(i32, i32, i32); 2] = [(-10, -6, 1), (-5, 0, 4)];
/// Steps in a row that each gain less than [`GAIN`] end the iteration: a flat valley, where the cost, and
/// with it every prediction, no longer changes. Steps that come to the minimum gain little too, but each promises less than
/// [`NEARING`] of the one before.
const FLAT_STEPS: usize = 3;
/// See [`FLAT_STEPS`].
const NEARING: f64 = 0.5;
/// See [`FLAT_STEPS`]; in units of chi-square.
const GAIN: f64 = 1e-5;

/// How far to go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Effort {
    /// To the minimum.
    Full,
    /// To the minimum, unless it becomes plain that the chi-square test rejects the order anyway.
    Referee,
}

/// A cost this many times its degrees of freedom is beyond any acceptance: the referee stops once
/// [`FLAT_STEPS`] steps in a row are too small to bring the cost below it with the steps that are left.
const HOPELESS: f64 = 10.0;

/// Result of the polish, in scaled units.
#[derive(Debug, Clone)]
pub(crate) struct Polished {
    /// The system at the minimum.
    pub(crate) system: StateSpace,
    /// Inverse information, `(X' X)^+`, in the basis of the system.
    pub(crate) covariance: ParameterCovariance,
    /// Cost at the start and at the minimum (chi-square units).
    pub(crate) start_cost: f64,
    /// Cost at the minimum.
    pub(crate) cost: f64,
    /// Degrees of freedom of the cost.
    pub(crate) degrees_of_freedom: usize,
    /// Number of Gauss-Newton steps.
    pub(crate) iterations: usize,
    /// Whether the iteration ended by its criterion.
    pub(crate) converged: bool,
}

/// Polishes `start` against the vector ARX estimate. When `largest_radius` is given, the spectral radius of
/// `A` stays within it.
///
/// # Errors
/// [`LinalgError`] when the innovation covariance is singular (a noise-free record needs no polish) or
/// the iteration meets numbers that are not finite at its start.
pub(crate) fn polish(
    start: &StateSpace,
    varx: &Varx,
    largest_radius: Option<f64>,
    effort: Effort,
) -> Result<Polished, LinalgError> {
    let layout = ParameterLayout::of(start, varx.feedthrough);
    let problem = Problem::new(varx, layout)?;
    // Powers of an unstable predictor up to the past window would overflow the regression.
    let mut system =
        with_stable_predictor(start, &varx.innovation_covariance).unwrap_or_else(|| start.clone());
    let rank = layout.identifiable();
    let start_cost = problem.cost(&system);
    if !start_cost.is_finite() {
        return Err(LinalgError::NotFinite {
            what: "predictor coefficients",
        });
    }
    let mut cost = start_cost;
    let mut iterations = 0;
    let mut flat = 0;
    let mut slow = 0;
    let degrees_of_freedom = (layout.outputs * varx.regressors()).saturating_sub(rank);
    let hopeless = HOPELESS * degrees_of_freedom as f64;
    let converged;
    let mut promised = f64::INFINITY;
    let exact = effort == Effort::Full && largest_radius.is_none();
    let covariance = loop {
        system = balanced(&system, varx.past);
        let jacobian = problem.jacobian(&system);
        if !all_finite(&jacobian) {
            return Err(LinalgError::NotFinite {
                what: "Gauss-Newton step",
            });
        }
        let residual = problem.residual(&system);
        let boundary = match largest_radius {
            Some(radius) => boundary_gradient(&system, &layout, radius)?,
            None => DMatrix::zeros(0, layout.len()),
        };
        let linearised = linearise(jacobian, residual.as_slice(), rank, &boundary)?;
        let before = std::mem::replace(&mut promised, linearised.decrease());
        let plain = promised < PLAIN && exact;
        let enough = if plain { DECREASE } else { REFEREE_DECREASE };
        // Plain steps that no longer shrink have met the rounding of the residual.
        if promised < enough || flat == FLAT_STEPS || (plain && promised >= before) {
            converged = true;
            break linearised.covariance();
        }
        if iterations == ITERATIONS || (effort == Effort::Referee && slow == FLAT_STEPS) {
            converged = plain;
            break linearised.covariance();
        }
        iterations += 1;
        let theta = layout.pack(&system);
        if plain {
            let step = linearised.step(0.0);
            let moved: Vec<f64> = theta.iter().zip(step.iter()).map(|(v, s)| v + s).collect();
            let candidate = layout.unpack(&moved, &system);
            let candidate_cost = problem.cost(&candidate);
            if !candidate_cost.is_finite() {
                converged = true;
                break linearised.covariance();
            }
            (system, cost) = (candidate, candidate_cost);
            continue;
        }
        // A cost is cheap beside a Jacobian: try all, take the best.
        let better = tries()
            .filter_map(|(length, damping)| {
                let moved: Vec<f64> = theta
                    .iter()
                    .zip(linearised.step(damping).iter())
                    .map(|(value, change)| value + length * change)
                    .collect();
                let candidate = layout.unpack(&moved, &system);
                let candidate = match largest_radius {
                    Some(radius) => with_poles_inside(&candidate, radius).ok()?,
                    None => candidate,
                };
                let candidate_cost = problem.cost(&candidate);
                (candidate_cost < cost).then_some((candidate, candidate_cost))
            })
            .min_by(|a, b| a.1.total_cmp(&b.1));
        match better {
            Some((candidate, candidate_cost)) => {
                let nearing = exact && promised < NEARING * before;
                flat = if cost - candidate_cost < GAIN && !nearing {
                    flat + 1
                } else {
                    0
                };
                // At this rate, would the steps that are left bring it within reach?
                let left = (ITERATIONS - iterations) as f64 * (cost - candidate_cost);
                slow = if candidate_cost - left > hopeless {
                    slow + 1
                } else {
                    0
                };
                system = candidate;
                cost = candidate_cost;
            }
            None => {
                // At the minimum to rounding.
                converged = linearised.decrease() < GAIN * (1.0 + cost);
                break linearised.covariance();
            }
        }
    };
    Ok(Polished {
        system,
        covariance: ParameterCovariance {
            layout,
            matrix: covariance,
            degrees_of_freedom: None,
        },
        start_cost,
        cost,
        degrees_of_freedom,
        iterations,
        converged,
    })
}

/// Length and damping of the steps of which the one that decreases the cost most is taken.
fn tries() -> impl Iterator<Item = (f64, f64)> {
    let damped = DAMPINGS.into_iter().flat_map(|(from, to, steps)| {
        (from * steps..=to * steps)
            .map(move |power| 10f64.powf(f64::from(power) / f64::from(steps)))
    });
    LENGTHS
        .into_iter()
        .map(|length| (length, 0.0))
        .chain(damped.map(|damping| (1.0, damping)))
}

/// Cost of a system against the vector ARX estimate (chi-square units), infinite when its predictor
/// overflows.
///
/// # Errors
/// [`LinalgError`] when the innovation covariance is singular.
pub(crate) fn coefficient_cost(system: &StateSpace, varx: &Varx) -> Result<f64, LinalgError> {
    let upper = cholesky_upper(&varx.innovation_covariance)?;
    let coefficients = predictor_coefficients(system, varx.past, varx.feedthrough);
    let difference = &varx.output_factor - multiply_nt(&varx.regressor_factor, &coefficients);
    let cost = solve_upper_transposed(&upper, &difference.transpose()).norm_squared();
    Ok(if cost.is_finite() {
        cost
    } else {
        f64::INFINITY
    })
}

#[cfg(test)]
mod tests {
    use super::predictor::tests::{system, varx_of};
    use super::*;

    #[test]
    fn polish_finds_the_system_from_a_perturbed_start() {
        for feedthrough in [false, true] {
            let truth = system(feedthrough);
            let varx = varx_of(&truth, 6, feedthrough);
            let mut start = truth.clone();
            start.a[(0, 1)] += 0.05;
            start.b[(1, 0)] -= 0.1;
            start.k[(0, 0)] += 0.1;
            let layout = ParameterLayout::of(&truth, feedthrough);
            let whitened = Problem::new(&varx, layout).unwrap().cost(&start);
            let cost = coefficient_cost(&start, &varx).unwrap();
            assert!(
                cost > 1.0 && (cost / whitened - 1.0).abs() < 1e-9,
                "{cost} {whitened}"
            );
            let result = polish(&start, &varx, None, Effort::Full).unwrap();
            assert!((result.start_cost / cost - 1.0).abs() < 1e-9);
            assert!(result.converged && result.cost < 1e-10 * result.start_cost);
            let found = predictor_coefficients(&result.system, 6, feedthrough);
            assert!((found - &varx.coefficients).amax() < 1e-8);
            assert!(result.iterations <= 12, "{}", result.iterations);
        }
    }

    #[test]
    fn dampings_span_all_decades() {
        let dampings: Vec<f64> = tries().map(|t| t.1).filter(|d| *d > 0.0).collect();
        let (low, high) = (dampings[0], dampings[dampings.len() - 1]);
        assert!((low / 1e-10 - 1.0).abs() < 1e-9 && (high - 1.0).abs() < 1e-9);
        // Never more than a decade apart, and less where they are a large share.
        for pair in dampings.windows(2) {
            let most = if pair[0] > 0.9e-5 { 1.8 } else { 10.1 };
            assert!(pair[0] < pair[1] && pair[1] < most * pair[0], "{pair:?}");
        }
        assert_eq!(tries().filter(|t| t.1 == 0.0).count(), LENGTHS.len());
    }
}
