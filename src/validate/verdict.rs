//! The verdict, and what it means in words.

use super::result::{ResidualTest, Validation};
use super::validation_options::Relation;

/// Explained shares below this are called small: they change a prediction by less than a tenth of the
/// residual's size.
const SMALL_SHARE: f64 = 0.01;

/// Which of the tests reject at the family-wise level, by Holm's step-down procedure (1979, Scandinavian
/// Journal of Statistics 6:65): the `i`-th smallest of `m` p-values is held against `level / (m - i)`.
pub(super) fn holm(p_values: &[Option<f64>], level: f64) -> Vec<bool> {
    let mut order: Vec<usize> = (0..p_values.len())
        .filter(|&i| p_values[i].is_some())
        .collect();
    let value = |i: usize| p_values[i].unwrap_or(1.0);
    order.sort_by(|&a, &b| value(a).total_cmp(&value(b)));
    let mut rejected = vec![false; p_values.len()];
    for (rank, &i) in order.iter().enumerate() {
        if value(i) > level / (order.len() - rank) as f64 {
            break;
        }
        rejected[i] = true;
    }
    rejected
}

/// Residuals of which the past explains a larger share are not called white, even where the uncertainty of the parameters allows it.
/// Using a tenth of the variance would make predictions better by a twentieth of the residual's size.
const ALLOWED_SHARE: f64 = 0.1;

/// Share of the level at which what is only information gets a sentence.
const INFORMATION: f64 = 0.1;

impl Validation {
    /// Whether past residuals act on the inputs beyond doubt: the record was taken in closed loop.
    pub fn closed_loop(&self) -> bool {
        let limit = INFORMATION * self.level;
        let feedback = self.feedback.as_ref();
        feedback.is_some_and(|test| test.p_value < limit)
    }

    /// The test whose past predicts much of the residuals of a fresh recording without a rejection, because the uncertainty of the
    /// parameters allows it: the tests have little power then.
    pub fn allowed_by_uncertainty(&self) -> Option<&ResidualTest> {
        let fresh = self.relation == Relation::Fresh && !self.rejected;
        let tests = [self.past_inputs.as_ref(), self.whiteness.as_ref()];
        (tests.into_iter().flatten())
            .filter(|test| fresh && test.explained_share > ALLOWED_SHARE)
            .max_by(|a, b| a.explained_share.total_cmp(&b.explained_share))
    }
}

/// Decides, and fills in `rejected` and `findings`. `noise_model`: whether the model claims one.
pub(super) fn decide(validation: &mut Validation, noise_model: bool) {
    let p = |test: &Option<ResidualTest>| test.as_ref().map(|t| t.p_value);
    let fresh = validation.relation == Relation::Fresh;
    let family = [
        p(&validation.past_inputs),
        p(&validation.whiteness).filter(|_| noise_model),
        validation
            .innovation_size
            .as_ref()
            .map(|size| size.p_value)
            .filter(|_| fresh),
        p(&validation.linearity),
    ];
    let rejected = holm(&family, validation.level);
    let level = validation.level;
    let mut findings = Vec::new();

    if let (Some(test), true) = (&validation.past_inputs, rejected[0]) {
        findings.push(past_inputs_finding(test, noise_model));
    }
    if let (Some(test), true) = (&validation.whiteness, rejected[1]) {
        findings.push(whiteness_finding(test));
    }
    if let (Some(size), true) = (&validation.innovation_size, rejected[2]) {
        findings.extend(
            size.outputs
                .iter()
                .filter(|output| output.p_value * size.outputs.len() as f64 <= level)
                .map(|output| {
                    let (ratio, than) = if output.ratio > output.expected_ratio {
                        (output.ratio, "more")
                    } else {
                        (output.ratio, "less")
                    };
                    format!(
                        "the residual of {} has {ratio:.3} times the variance that the model states, {than} \
                         than chance allows: the noise of this recording differs from that of the \
                         identification, or the plant has changed; identify again on data like these",
                        output.output
                    )
                }),
        );
    }
    if let (Some(test), true) = (&validation.linearity, rejected[3]) {
        findings.push(linearity_finding(test));
    }
    validation.rejected = rejected.iter().any(|r| *r);
    // A rejection needs no more samples than it had.
    validation.too_short = validation.too_short.filter(|_| !validation.rejected);
    if !validation.rejected {
        findings.push(if let Some(short) = &validation.too_short {
            short.sentence()
        } else if let Some(test) = validation.allowed_by_uncertainty() {
            format!(
                "the past predicts {} of the residual variance{}, which the uncertainty of the parameters allows: these tests cannot \
                 tell the model from a wrong one; judge it by its free run, and identify it from a longer or richer recording",
                percent(test.explained_share),
                most(test)
            )
        } else if family.iter().all(Option::is_none) {
            "no test of the residuals applies: judge the model by its fit".to_owned()
        } else {
            format!(
                "the residuals are white at the {} % level",
                plain(100.0 * level)
            )
        });
    }
    findings.push(match &validation.linearity_scope {
        Some(scope) => scope.sentence.clone(),
        None => {
            "linearity was not tested: the recording is too short for it, or the residuals vanish"
                .to_owned()
        }
    });
    if let (Some(test), false) = (&validation.whiteness, noise_model)
        && test.p_value < level
    {
        findings.push(
            "the simulation errors are coloured, which a model without noise model does not rule out; the test \
             of past inputs allows for it"
                .to_owned(),
        );
    }
    let closed_loop = validation.closed_loop();
    if closed_loop {
        findings.push(
            "past residuals act on the inputs: the recording was taken in closed loop, and only past inputs \
             are tested"
                .to_owned(),
        );
    }
    if let Some(test) = &validation.same_sample
        && test.p_value < INFORMATION * level
        && let Some(strongest) = &test.strongest
    {
        // In closed loop the feedthrough of the plant and that of the controller cannot be told apart.
        let meaning = if closed_loop {
            "a controller acts without delay; the plant's own direct feedthrough, if any, cannot be told from it"
        } else {
            "the plant has direct feedthrough (try --feedthrough), or a controller acts without delay"
        };
        findings.push(format!(
            "{} and {} move together within one sample (correlation {:.3}): {meaning}",
            strongest.from, strongest.to, strongest.correlation
        ));
    }
    if let Some(reason) = &validation.free_run_unavailable {
        findings.push(format!("no free run: {reason}"));
    }
    validation.findings = findings;
}

fn past_inputs_finding(test: &ResidualTest, noise_model: bool) -> String {
    let cause = if noise_model {
        "the order is too low or the plant is not linear; try a higher --order"
    } else {
        "the model misses part of what the inputs do (gain, dynamics or a nonlinearity)"
    };
    format!(
        "past inputs predict {} of the residual variance{}: {cause}{}",
        percent(test.explained_share),
        most(test),
        if test.explained_share < SMALL_SHARE {
            ", if so small a part matters"
        } else {
            ""
        }
    )
}

fn whiteness_finding(test: &ResidualTest) -> String {
    format!(
        "past residuals predict {} of the residual variance{}: the noise model is not right, so the stated \
         uncertainty is not either; try a higher --order or a longer --past, or use --covariance robust{}",
        percent(test.explained_share),
        most(test),
        if test.explained_share < SMALL_SHARE {
            " (the part is small)"
        } else {
            ""
        }
    )
}

fn linearity_finding(test: &ResidualTest) -> String {
    format!(
        "squares and products of past inputs and outputs predict {} of the residual variance{}: the plant is not linear \
         over this recording, and the model is the best linear approximation of it here; its uncertainty is that \
         of a linear plant (use --covariance robust), and another range of motion has another model{}",
        percent(test.explained_share),
        most(test),
        if test.explained_share < SMALL_SHARE {
            " (the part is small)"
        } else {
            ""
        }
    )
}

fn most(test: &ResidualTest) -> String {
    test.strongest.as_ref().map_or_else(String::new, |s| {
        format!(", most at lag {} of {} -> {}", s.lag, s.from, s.to)
    })
}

/// A share with two significant digits.
fn percent(share: f64) -> String {
    let value = 100.0 * share;
    if value >= 10.0 {
        format!("{value:.0} %")
    } else if value >= 1.0 {
        format!("{value:.1} %")
    } else if value >= 0.01 {
        format!("{value:.2} %")
    } else {
        "less than 0.01 %".to_owned()
    }
}

fn plain(value: f64) -> String {
    let text = format!("{value:.4}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holm_steps_down() {
        let reject = |p: [f64; 3], level| holm(&p.map(Some), level);
        assert_eq!(reject([0.02, 0.5, 0.001], 0.05), [true, false, true]);
        assert_eq!(reject([0.03, 0.04, 0.001], 0.05), [false, false, true]);
        assert_eq!(reject([0.02, 0.02, 0.02], 0.05), [false, false, false]);
        assert_eq!(holm(&[None, Some(0.04), None], 0.05), [false, true, false]);
        assert_eq!(holm(&[None], 0.05), [false]);
    }

    /// A judgement of a fresh recording whose past inputs explain this share of the residuals with this p-value.
    fn judged(share: f64, p_value: f64) -> Validation {
        let test = serde_json::json!({
            "statistic": 1.2, "degrees_of_freedom": 7, "fitted_directions": 0, "variance_inflation": 1.0,
            "p_value": p_value, "explained_share": share, "explained_share_by_channel": [share], "strongest": null,
        });
        let fit = serde_json::json!({"fit_percent": 90.0, "outputs": []});
        let mut validation: Validation = serde_json::from_value(serde_json::json!({
            "relation": "fresh", "samples": 148, "tested_samples": 140, "start_up_samples": 0, "lags": 7, "level": 0.01,
            "one_step": fit, "free_run": null, "free_run_unavailable": null, "whiteness": null, "past_inputs": test,
            "own_past_lags": 1, "same_sample": null, "feedback": null, "innovation_size": null, "autocorrelation": [],
            "cross_correlation": [], "rejected": false, "findings": [],
        }))
        .unwrap();
        decide(&mut validation, true);
        validation
    }

    #[test]
    fn what_uncertain_parameters_allow_is_not_called_white() {
        let allowed = judged(0.76, 0.99);
        assert!(!allowed.rejected && allowed.allowed_by_uncertainty().is_some());
        assert!(
            allowed.findings[0]
                .starts_with("the past predicts 76 % of the residual variance, which")
        );
        let white = judged(0.09, 0.5);
        assert!(white.allowed_by_uncertainty().is_none());
        assert!(white.findings[0].starts_with("the residuals are white"));
        let rejected = judged(0.76, 1e-6);
        assert!(rejected.rejected && rejected.allowed_by_uncertainty().is_none());
    }

    #[test]
    fn numbers_read_well() {
        assert_eq!(percent(0.031), "3.1 %");
        assert_eq!(percent(0.31), "31 %");
        assert_eq!(percent(2e-4), "0.02 %");
        assert_eq!(percent(0.0), "less than 0.01 %");
        assert_eq!(plain(1.0), "1");
        assert_eq!(plain(0.5), "0.5");
    }
}
