//! Choice of the order: singular values propose, the chi-square test disposes.

use serde::{Deserialize, Serialize};

/// Level of the chi-square test that referees the order.
pub(crate) const REFEREE_LEVEL: f64 = 0.01;
/// Orders above the proposal that are tried when the test rejects it.
pub(super) const ORDERS_ABOVE: usize = 4;
/// Largest order that is considered without being asked for.
pub(super) const LARGEST_AUTOMATIC_ORDER: usize = 30;

/// What speaks for and against one order.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct OrderEvidence {
    /// The order.
    pub order: usize,
    /// Canonical correlation that this order adds (between past and future, 0..1).
    pub canonical_correlation: f64,
    /// Singular value criterion (Bauer 2001); smallest is best.
    pub singular_value_criterion: f64,
    /// Cost of the best model of this order against the vector ARX model, when it was computed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chi_square: Option<f64>,
    /// Its degrees of freedom.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub degrees_of_freedom: Option<usize>,
    /// Probability of so large a cost when the order is right.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub p_value: Option<f64>,
    /// Cost plus `log(N)` for each parameter (Schwarz); smallest is best.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub schwarz: Option<f64>,
    /// Spectral radius of `A`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spectral_radius: Option<f64>,
}

/// Canonical correlations from the singular values of the canonically weighted decomposition.
pub(super) fn canonical_correlations(singular_values: &[f64], columns: usize) -> Vec<f64> {
    let scale = 1.0 / (columns as f64).sqrt();
    singular_values
        .iter()
        .map(|s| (s * scale).min(1.0))
        .collect()
}

/// `SVC(n) = rho_{n+1}^2 + d(n) log(N) / N`, `d(n) = n (r + 2 l)`, for `n = 1 ..= largest`.
pub(super) fn singular_value_criterion(
    correlations: &[f64],
    inputs: usize,
    outputs: usize,
    columns: usize,
    largest: usize,
) -> Vec<OrderEvidence> {
    (1..=largest.min(correlations.len()))
        .map(|order| {
            let next = correlations.get(order).copied().unwrap_or(0.0);
            OrderEvidence {
                order,
                canonical_correlation: correlations[order - 1],
                singular_value_criterion: next * next + penalty(order, inputs, outputs, columns),
                chi_square: None,
                degrees_of_freedom: None,
                p_value: None,
                schwarz: None,
                spectral_radius: None,
            }
        })
        .collect()
}

/// `d(n) log(N) / N`, the price of the parameters of an order.
pub(crate) fn penalty(order: usize, inputs: usize, outputs: usize, columns: usize) -> f64 {
    let samples = columns as f64;
    (order * (inputs + 2 * outputs)) as f64 * samples.ln() / samples
}

/// The order with the smallest criterion.
pub(crate) fn proposal(evidence: &[OrderEvidence]) -> Option<usize> {
    evidence
        .iter()
        .min_by(|a, b| {
            a.singular_value_criterion
                .total_cmp(&b.singular_value_criterion)
        })
        .map(|e| e.order)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `n (r + 2 l)` numbers: `A`, `B`, `C` and `K` less the choice of the state basis.
    #[test]
    fn an_order_costs_its_parameters() {
        let price = penalty(3, 2, 1, 1000);
        assert!((price - 12.0 * 1000_f64.ln() / 1000.0).abs() < 1e-15);
    }
}
