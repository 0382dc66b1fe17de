//! What the paper says, held against the study.

use super::algorithm::{OPTIMISED, WHITENING};
use super::variance::{Outcome, Plan};
use crate::reproduce::document::{Agreement, Comparison};
use crate::reproduce::plain_numbers::{number, range};

/// A mean that lies this near to the true variance cannot be told from it in a figure over several decades.
const READABLE: f64 = 1.15;

/// Whether two variances are equal within [`READABLE`].
fn equal(ratio: f64) -> bool {
    (1.0 / READABLE..=READABLE).contains(&ratio)
}

/// The statements of section 5 and of the conclusions.
pub(super) fn statements(outcomes: &[Outcome]) -> Vec<Comparison> {
    let mut rows = Vec::new();
    for o in outcomes.iter().filter(|o| o.algorithm.in_paper) {
        let ratio = |k: usize| o.mean[k] / o.truth[k];
        let median = |k: usize| o.percentiles[k][1] / o.truth[k];
        rows.push(Comparison::new(
            &format!("Fig. 1, {}", o.algorithm.name),
            "the mean of the estimated variances lies on the true variance",
            format!(
                "mean estimated / true variance {} over the eight frequencies, median estimated / true {}",
                range(Plan::given().map(ratio)),
                range(Plan::given().map(median))
            ),
            Agreement::of_all(Plan::given().map(|k| equal(ratio(k)))),
            format!(
                "within {} % of the true variance at all eight",
                percent_off(READABLE)
            ),
        ));
    }
    let inside =
        |o: &Outcome, k: usize| (o.percentiles[k][0]..=o.percentiles[k][2]).contains(&o.truth[k]);
    let of_paper = || outcomes.iter().filter(|o| o.algorithm.in_paper);
    let held: Vec<bool> = of_paper()
        .flat_map(|o| Plan::given().map(move |k| inside(o, k)))
        .collect();
    rows.push(Comparison::new(
        "Fig. 1, percentiles",
        "the true variance lies between the 5 % and 95 % percentiles of the estimated ones",
        format!(
            "true at {} of {} points",
            held.iter().filter(|inside| **inside).count(),
            held.len()
        ),
        Agreement::of_all(held),
        "at the eight frequencies, for the paper's algorithms",
    ));
    let spread = |o: &Outcome| -> f64 {
        let logs: Vec<(f64, f64)> = Plan::given()
            .map(|k| {
                let [low, _, high] = o.percentiles[k];
                (o.truth[k].ln(), (high / low).ln())
            })
            .collect();
        correlation(&logs)
    };
    let spreads: Vec<f64> = of_paper().map(spread).collect();
    rows.push(Comparison::new(
        "Section 5",
        "\"the variation of the estimated variance grows large as the variance itself grows\"",
        format!(
            "correlation between the logarithm of the variance and that of the spread of its estimates: {}",
            range(spreads.iter().copied())
        ),
        Agreement::of_all(spreads.iter().map(|c| *c > 0.0)),
        "a positive correlation",
    ));
    rows
}

/// The algorithms against each other, by their true asymptotic variance.
pub(super) fn against_optimised(outcomes: &[Outcome]) -> Vec<Comparison> {
    let find = |name: &str| outcomes.iter().find(|o| o.algorithm.name == name);
    let (Some(optimised), Some(whitening)) = (find(OPTIMISED), find(WHITENING)) else {
        return Vec::new();
    };
    let ratios: Vec<f64> = Plan::given()
        .map(|k| whitening.truth[k] / optimised.truth[k])
        .collect();
    vec![Comparison::new(
        "van Wingerden, footnote 1",
        "the optimised version has a variance equal to or below that of the whitening filter",
        format!(
            "true variance of the whitening filter / of PBSID_opt: {}",
            range(ratios.iter().copied())
        ),
        Agreement::of_all(ratios.iter().map(|r| *r >= 1.0 - 1e-6)),
        "at the eight frequencies",
    )]
}

fn percent_off(factor: f64) -> String {
    number(100.0 * (factor - 1.0), 2)
}

/// Correlation coefficient.
fn correlation(points: &[(f64, f64)]) -> f64 {
    let count = points.len() as f64;
    let (x, y) = points
        .iter()
        .fold((0.0, 0.0), |(x, y), p| (x + p.0 / count, y + p.1 / count));
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for p in points {
        let (a, b) = (p.0 - x, p.1 - y);
        xx += a * a;
        xy += a * b;
        yy += b * b;
    }
    xy / (xx * yy).sqrt()
}

/// Errors in print that change the variance. Each is settled by a derivation that the literal formulas, so
/// repaired, agree with (`tests/library/literal_nested.rs`).
pub(super) fn misprints() -> Vec<Comparison> {
    let row = |place: &str, paper: &str, here: &str, why: &str| {
        Comparison::new(place, paper, here, Agreement::Misprint, why)
    };
    vec![
        row(
            "(3.1), M_x1",
            "K [I 0] - Abar Gamma^-L",
            "K [I 0] - A Gamma^-L",
            "the state equation holds A once the innovation is among the regressors",
        ),
        row(
            "(3.2), second rows",
            "z^- beside M_x2",
            "zbar^-, and only M_x1 in the first, only M_x2 in the second matrix",
            "M_x2 multiplies the error of the shifted predictor",
        ),
        row(
            "(3.5), tau",
            "tau = h - k",
            "tau = h - k + 1",
            "both factors must carry the same sample of the innovation; section 4's column ranges agree with that",
        ),
        row(
            "Section 4, column ranges",
            "columns up to (f-1) q, k up to f-2",
            "all remaining columns, k = 0..f-1 for both",
            "the part of the past that the future does not explain would be lost",
        ),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlation_of_lines() {
        let rising: Vec<(f64, f64)> = (0..5).map(|k| (f64::from(k), 2.0 * f64::from(k))).collect();
        approx::assert_relative_eq!(correlation(&rising), 1.0, epsilon = 1e-12);
        let falling: Vec<(f64, f64)> = rising.iter().map(|p| (p.0, -p.1)).collect();
        approx::assert_relative_eq!(correlation(&falling), -1.0, epsilon = 1e-12);
        assert!(equal(1.1) && !equal(0.8));
        assert_eq!(percent_off(READABLE), "15");
    }
}
