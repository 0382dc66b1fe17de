//! What is taken back from an explanation of simulated columns where the simulator is not understood.

use super::explanation::{Explanation, Verdict};

/// An effect beside a simulator that is neither linear nor reproduced by equations must take this part off the mean square of the
/// error in blocks left out: more is explained than is not.
const MOST: f64 = 0.5;

/// Takes back what is not sure where the simulator's own nonlinearity is not known: its parameters may differ, and what they do
/// then looks like an effect.
pub(crate) fn doubt(explanation: &mut Explanation) {
    if !matches!(explanation.verdict, Verdict::Named | Verdict::Family) {
        return;
    }
    let removed = explanation.fit.heldout.as_ref().map_or(0.0, |steps| {
        let (with, without) = (steps.augmented.rmse, steps.parameters_only.rmse);
        1.0 - (with / without.max(f64::MIN_POSITIVE)).powi(2)
    });
    if removed >= MOST && explanation.remaining.adequate {
        return;
    }
    let said = if removed > 0.0 {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explain::columns::tests::drag;

    /// The same explanation, with these errors in blocks left out.
    fn with_errors(of: &Explanation, without: f64, with: f64) -> Explanation {
        let mut e = of.clone();
        let mut steps = e.fit.train.clone();
        steps.parameters_only.rmse = without;
        steps.augmented.rmse = with;
        e.fit.heldout = Some(steps);
        e.remaining.adequate = true;
        e
    }

    #[test]
    fn what_is_not_sure_is_taken_back() {
        let named = drag();
        let judged = |without: f64, with: f64| {
            let mut e = with_errors(&named, without, with);
            doubt(&mut e);
            (e.verdict, e.effects.len())
        };
        assert_eq!(judged(1.0, 0.5), (Verdict::Named, 1));
        assert_eq!(judged(1.0, 0.9), (Verdict::Unexplained, 1));
        assert_eq!(judged(1.0, 1.1), (Verdict::Parameters, 0));
        let mut structure = with_errors(&named, 1.0, 0.5);
        structure.remaining.adequate = false;
        doubt(&mut structure);
        assert_eq!(structure.verdict, Verdict::Unexplained);
    }
}
