//! Which of two explanations of simulated columns is given, and what is taken back where the simulator is not understood.

use super::explanation::{Explanation, Verdict};

/// An effect beside a simulator that is neither linear nor reproduced by equations must take this part off the mean square of the
/// error in blocks left out: more is explained than is not.
const MOST: f64 = 0.5;

/// The part of the mean square of the error in blocks left out that the answer takes off.
fn removed(explanation: &Explanation) -> f64 {
    explanation.fit.heldout.as_ref().map_or(0.0, |steps| {
        let (with, without) = (steps.augmented.rmse, steps.parameters_only.rmse);
        1.0 - (with / without.max(f64::MIN_POSITIVE)).powi(2)
    })
}

/// Whether an explanation relative to a simulator that is not linear is doubtful: it leaves structure, or its effects explain less
/// than they leave. Other parameters of the simulator, which a linear model of the difference cannot express, may look like them.
pub(crate) fn is_doubtful(explanation: &Explanation) -> bool {
    !explanation.remaining.adequate
        || match explanation.verdict {
            Verdict::Unexplained => true,
            Verdict::Named | Verdict::Family => removed(explanation) < MOST,
            Verdict::Consistent | Verdict::Parameters => false,
        }
}

/// Takes back what is not sure of a doubtful explanation.
pub(crate) fn doubt(explanation: &mut Explanation) {
    if !matches!(explanation.verdict, Verdict::Named | Verdict::Family) {
        return;
    }
    let said = if removed(explanation) > 0.0 {
        explanation.verdict = Verdict::Unexplained;
        "something is left out, and the following is not sure, because other parameters of the simulator may look like it."
    } else {
        explanation.verdict = Verdict::Parameters;
        explanation.effects.clear();
        "other parameters explain blocks of the recording that were not fitted as well as the following does."
    };
    explanation.summary.insert(
        0,
        format!("The simulator is not linear, and no equations were found that reproduce its columns: {said}"),
    );
}

/// Whether an explanation by equations that reproduce the columns stands in the place of a doubtful one. Its free run must follow
/// the recording closer in blocks left out, and where it leaves structure itself, clearly: it takes at least [`MOST`] off the mean
/// square of the error of the other. An explanation without effects has no blocks left out; few parameters were fitted then, and
/// the samples that they were fitted to tell the same.
pub(crate) fn stands_in(equations: &Explanation, doubtful: &Explanation) -> bool {
    let error = |e: &Explanation| {
        let steps = e.fit.heldout.as_ref().unwrap_or(&e.fit.train);
        steps.augmented.rmse
    };
    let most = match equations.remaining.adequate {
        true => 1.0,
        false => (1.0 - MOST).sqrt(),
    };
    equations.fit.output == doubtful.fit.output && error(equations) < most * error(doubtful)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explain::columns::tests::drag;

    /// The same explanation, with these errors in blocks left out.
    fn with_errors(of: &Explanation, without: f64, with: f64, adequate: bool) -> Explanation {
        let mut e = of.clone();
        let mut steps = e.fit.train.clone();
        steps.parameters_only.rmse = without;
        steps.augmented.rmse = with;
        e.fit.heldout = Some(steps);
        e.remaining.adequate = adequate;
        e
    }

    #[test]
    fn the_better_explanation_is_given_and_what_is_not_sure_is_taken_back() {
        let named = drag();
        assert!(!is_doubtful(&with_errors(&named, 1.0, 0.5, true)));
        let judged = |without: f64, with: f64, adequate: bool| {
            let mut e = with_errors(&named, without, with, adequate);
            assert!(is_doubtful(&e));
            doubt(&mut e);
            (e.verdict, e.effects.len())
        };
        assert_eq!(judged(1.0, 0.9, true), (Verdict::Unexplained, 1));
        assert_eq!(judged(1.0, 1.1, true), (Verdict::Parameters, 0));
        assert_eq!(judged(1.0, 0.5, false), (Verdict::Unexplained, 1));

        let linear = with_errors(&named, 1.0, 0.8, false);
        let equations = |with: f64, adequate: bool| with_errors(&named, 1.0, with, adequate);
        assert!(stands_in(&equations(0.7, true), &linear));
        assert!(!stands_in(&equations(0.9, true), &linear));
        assert!(!stands_in(&equations(0.7, false), &linear));
        assert!(stands_in(&equations(0.5, false), &linear));
    }
}
