//! Which of two explanations of simulated columns is given, and what is taken back where the simulator is not understood.

use super::document::sentences::NOTHING_ADEQUATE;
use super::engine::select::CHANCE;
use super::explanation::{Explanation, SignalTraces, Verdict};
use super::linear::answer::probability::UNLIKELY;
use crate::noise::{Colours, Mask, Noise, effective_samples, kept, sum_of_squares};

/// An effect beside a simulator that is neither linear nor reproduced by equations must take this part off the mean square of the
/// error in blocks left out: more is explained than is not.
const MOST: f64 = 0.5;
/// ... and so much where it is none of the inputs and sensors: other parameters of a simulator that is not known may look like dynamics.
/// Three times as much is explained as is not.
const MOST_INSIDE: f64 = 0.75;
/// Runs whose errors differ by less than this part are equally good (the tolerance of the project's score on real recordings).
const EQUAL: f64 = 0.02;

/// Twice the logarithm of a Bayes factor that is very strong evidence for one of two models (R. E. Kass and A. E. Raftery, *J. Am.
/// Stat. Assoc.* 90, 1995).
const VERY_STRONG: f64 = 10.0;

/// A free run with at least this fit (in percent) follows the recording: it leaves 1 % of the variance.
const FOLLOWS: f64 = 90.0;

/// The part of the mean square of the error in blocks left out that the answer takes off what the simulation leaves, as it is given
/// or with other parameters.
fn removed(explanation: &Explanation) -> f64 {
    explanation.fit.heldout.as_ref().map_or(0.0, |steps| {
        let without = steps.parameters_only.rmse.min(steps.simulation.rmse);
        1.0 - (steps.augmented.rmse / without.max(f64::MIN_POSITIVE)).powi(2)
    })
}

/// The part that it must take off.
fn needed(explanation: &Explanation) -> f64 {
    let mut effects = explanation.effects.iter();
    let at_port = |id: &str| id.starts_with("sensor_") || id.starts_with("input_");
    match effects.all(|e| at_port(&e.effect)) {
        true => MOST,
        false => MOST_INSIDE,
    }
}

/// Whether an explanation relative to a simulator that is not linear is doubtful: it leaves structure, or its effects explain less
/// than they leave. Other parameters of the simulator, which a linear model of the difference cannot express, may look like them.
pub(crate) fn is_doubtful(explanation: &Explanation) -> bool {
    !explanation.remaining.adequate
        || match explanation.verdict {
            Verdict::Unexplained => true,
            Verdict::Named | Verdict::Family => removed(explanation) < needed(explanation),
            Verdict::Consistent | Verdict::Parameters => false,
        }
}

/// Takes back names beside which blocks of the recording that were not fitted are followed worse than without them, or, of names that
/// are more likely wrong than right, no better. What is read off
/// the data, such as the step of a coarse sensor, has no gain in a criterion and makes no fit better.
pub(crate) fn unless_refuted(mut explanation: Explanation) -> Explanation {
    let named = matches!(explanation.verdict, Verdict::Named | Verdict::Family);
    let mut effects = explanation.effects.iter();
    let fitted = effects.any(|e| e.evidence.criterion_gain > 0.0);
    if !(named && fitted) {
        return explanation;
    }
    // What is more likely wrong than right must show there.
    let shows = explanation.probability > 0.5 || explanation.fit.heldout.is_none();
    let least = if shows { -EQUAL } else { EQUAL };
    let removed = removed(&explanation);
    if removed < 1.0 - (1.0 - least).powi(2) {
        let than = if removed < 0.0 { "worse" } else { "no better" };
        take_back(
            &mut explanation,
            Verdict::Unexplained,
            &format!(
                "Something is left out, and the following is not sure: over blocks of the recording that were not fitted, simulations are {than} with it than without it."
            ),
        );
    }
    explanation
}

/// Whether an explanation relative to a linear simulator needs no second opinion: it found nothing, or a listed effect that is not
/// [`UNLIKELY`], or a law of outputs without units, whose name depends on these.
pub(crate) fn is_sure(explanation: &Explanation, has_units: bool) -> bool {
    match explanation.verdict {
        Verdict::Consistent | Verdict::Parameters => true,
        Verdict::Named | Verdict::Family if is_law(explanation) => !has_units,
        Verdict::Named | Verdict::Family => explanation.probability > UNLIKELY,
        Verdict::Unexplained => false,
    }
}

fn is_law(explanation: &Explanation) -> bool {
    explanation.effects.iter().any(|e| e.effect == "law")
}

/// Whether an explanation by the equations of a linear simulator replaces one that is not sure: it names what the other does not, or
/// a listed effect where the other has a law, and follows the recording as closely; or it follows clearly closer than another name.
pub(crate) fn replaces(equations: &Explanation, other: &Explanation) -> bool {
    let more = match other.verdict {
        Verdict::Unexplained => stands_in(equations, other),
        _ => {
            let most = match is_law(other) {
                true => 1.0 + EQUAL,
                false => (1.0 - MOST).sqrt(),
            };
            !is_law(equations) && error_over(equations, other).is_some_and(|e| e <= most)
        }
    };
    equations.verdict == Verdict::Named && more
}

/// Takes back what is not sure of a doubtful explanation: where it leaves structure, what it says, and where it leaves none, but
/// explains less than noise does, that anything is missing. Of little structure beside little that was explained the same holds: no linear
/// model of the difference follows other parameters of a simulator that is not linear.
pub(crate) fn doubt(explanation: &mut Explanation) {
    let (removed, needed) = (removed(explanation), needed(explanation));
    let little =
        removed < needed && explanation.remaining.p_value >= CHANCE && runs_without(explanation);
    match explanation.verdict {
        Verdict::Named | Verdict::Family => {}
        Verdict::Unexplained if little => {}
        _ => return,
    }
    if removed > 0.0 && !little && (removed >= needed || !explanation.remaining.adequate) {
        take_back(
            explanation,
            Verdict::Unexplained,
            "Something is left out, and the following is not sure, because other parameters of the simulator may look like it.",
        );
    } else {
        take_back(
            explanation,
            Verdict::Parameters,
            &format!(
                "Nothing is surely left out: beside other parameters, the following takes less than {:.0} % of the mean square off blocks of the recording that were not fitted.",
                100.0 * needed
            ),
        );
    }
}

/// Whether other parameters alone follow the recording in blocks left out.
fn runs_without(explanation: &Explanation) -> bool {
    let steps = explanation.fit.heldout.as_ref();
    steps.is_some_and(|steps| steps.parameters_only.fit_percent >= FOLLOWS)
}

/// Puts another verdict in the place of a name, with the reason first. Where nothing is surely left out, no effects are listed.
pub(crate) fn take_back(explanation: &mut Explanation, verdict: Verdict, reason: &str) {
    if verdict == Verdict::Parameters {
        explanation.effects.clear();
    }
    explanation.verdict = verdict;
    // It is the probability of what is taken back.
    let of_effect =
        |line: &String| line.contains("Probability that this is right") || line == NOTHING_ADEQUATE;
    explanation.summary.retain(|line| !of_effect(line));
    explanation.summary.insert(0, reason.to_owned());
}

/// Error of one explanation's run over that of another, the geometric mean over recordings and outputs; none where they show
/// different ones. Blocks left out do not compare them: equations run freely over thirds that their fit has not seen, a linear
/// model over short blocks inside of what was fitted. Few parameters were fitted to the whole, so that it tells enough.
fn error_over(one: &Explanation, other: &Explanation) -> Option<f64> {
    let squares = |e: &Explanation| -> Vec<f64> {
        let mean = |errors: &mut dyn Iterator<Item = f64>| {
            let known = errors.filter(|e| e.is_finite());
            let (sum, count) = known.fold((0.0, 0), |(sum, n), e| (sum + e * e, n + 1));
            sum / f64::from(count.max(1))
        };
        let traces = e.signals.iter();
        traces.map(|t| mean(&mut errors(t).into_iter())).collect()
    };
    let (ours, theirs) = (squares(one), squares(other));
    if ours.is_empty() || ours.len() != theirs.len() {
        return None;
    }
    let least = f64::MIN_POSITIVE;
    let logs = ours.iter().zip(&theirs);
    let sum: f64 = logs.map(|(a, b)| (a.max(least) / b.max(least)).ln()).sum();
    Some((0.5 * sum / ours.len() as f64).exp())
}

/// Whether an explanation by equations that reproduce the columns stands in the place of a doubtful one: parameters of the
/// simulator are accounted for in it. Its run must follow the recording as closely, and where it leaves structure itself, clearly
/// closer: it takes at least [`MOST`] off the mean square of the error of the other.
pub(crate) fn stands_in(equations: &Explanation, doubtful: &Explanation) -> bool {
    let most = match equations.remaining.adequate {
        true => 1.0 + EQUAL,
        false => (1.0 - MOST).sqrt(),
    };
    error_over(equations, doubtful).is_some_and(|error| error <= most)
}

/// Whether the run with what was found leaves more than 1 % of the variance of an output, and most of that can be predicted from what was
/// left before: slow noise, or physics that was not found.
pub(crate) fn leaves_slow_error(explanation: &Explanation) -> bool {
    let most = (1.0 - FOLLOWS / 100.0).powi(2);
    explanation.signals.iter().any(|trace| {
        let errors = errors(trace);
        let mask: Mask = vec![errors.iter().map(|e| e.is_finite()).collect()];
        let residual = vec![kept(&errors, &mask[0])];
        let recorded = kept(&trace.recorded, &mask[0]);
        let mask: Mask = vec![vec![true; recorded.len()]];
        let noise = Noise::estimate(&residual, 1, &mask, Colours::Few);
        let left = sum_of_squares(&residual[0]) / recorded.len().max(1) as f64;
        left > most * variance(&recorded) && noise.absorbs(&residual, &mask)
    })
}

fn variance(values: &[f64]) -> f64 {
    let count = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / count;
    values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count
}

/// Static laws inside a plant, which a plant of another class may have by its nature.
const CURVES: [&str; 5] = [
    "law",
    "cubic_stiffness",
    "quadratic_stiffness",
    "end_stop",
    "stiffness_change",
];

fn is_curve(explanation: &Explanation) -> bool {
    let mut effects = explanation.effects.iter();
    effects.any(|e| CURVES.contains(&e.effect.as_str()))
}

fn is_drive(explanation: &Explanation) -> bool {
    let model = explanation.model.as_ref();
    model.is_some_and(|model| model.mechanics.is_some())
}

/// Whether the run with what was found follows the recording.
pub(crate) fn runs_close(explanation: &Explanation) -> bool {
    explanation.verdict != Verdict::Unexplained
        && explanation.fit.train.augmented.fit_percent >= FOLLOWS
}

/// The same where nothing is left beside it.
pub(crate) fn follows(explanation: &Explanation) -> bool {
    runs_close(explanation) && explanation.remaining.adequate
}

/// Whether another plant may explain more than a linear explanation, which names nothing surely, or leaves structure or much of the
/// output (a noise model with a slow root takes what a wrong plant leaves for noise), or names a curve.
pub(crate) fn leaves_room(linear: &Explanation) -> bool {
    match linear.verdict {
        Verdict::Consistent | Verdict::Parameters => false,
        Verdict::Unexplained => true,
        // The averaged equation of motion is of a drive already.
        Verdict::Named | Verdict::Family if is_drive(linear) => false,
        Verdict::Named | Verdict::Family => !follows(linear) || is_curve(linear),
    }
}

fn errors(trace: &SignalTraces) -> Vec<f64> {
    let pairs = trace.recorded.iter().zip(&trace.augmented);
    pairs.map(|(recorded, run)| recorded - run).collect()
}

/// Decrease of Schwarz's criterion of an explanation against a run with so many times its error and so many parameters less, under
/// white noise of as many values as are independent.
pub(crate) fn criterion_gain(explanation: &Explanation, times: f64, parameters: usize) -> f64 {
    let residual: Vec<Vec<f64>> = explanation.signals.iter().map(errors).collect();
    let mask: Mask = residual.iter().map(|e| vec![true; e.len()]).collect();
    let count = effective_samples(&residual, &mask).max(1.0);
    2.0 * count * times.ln() - parameters as f64 * count.ln()
}

/// Whether an explanation by another plant stands in the place of a linear one: of one without a name as equations do ([`stands_in`]),
/// of one with a name where it has one too and its run is clearly closer, or as close where its class has the curve from the start,
/// which the linear one fits with more numbers. With a second effect beside that of its class it must be the likelier one; a curve
/// beside it is no better than one alone.
pub(crate) fn supersedes(other: &Explanation, linear: &Explanation) -> bool {
    if linear.verdict == Verdict::Unexplained {
        return stands_in(other, linear);
    }
    let parameters = |e: &Explanation| e.effects.iter().map(|e| e.parameters.len()).sum::<usize>();
    let more = parameters(other).saturating_sub(parameters(linear));
    let simpler = other.effects.len() <= linear.effects.len();
    let closer = |error: f64| match is_curve(linear) && other.remaining.adequate {
        true if simpler => error <= 1.0 + EQUAL,
        true if !is_curve(other) => criterion_gain(other, 1.0 / error, more) > VERY_STRONG,
        _ => error <= (1.0 - MOST).sqrt(),
    };
    matches!(other.verdict, Verdict::Named | Verdict::Family)
        && error_over(other, linear).is_some_and(closer)
}

/// Whether two explanations name the same effects. They were found in different ways, so that each confirms the other.
pub(crate) fn agree(one: &Explanation, other: &Explanation) -> bool {
    let ids = |e: &Explanation| -> Vec<String> {
        let mut ids: Vec<String> = e.effects.iter().map(|e| e.effect.clone()).collect();
        ids.sort_unstable();
        ids
    };
    let named = |e: &Explanation| e.verdict == Verdict::Named;
    named(one) && named(other) && ids(one) == ids(other)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explain::columns::tests::drag;

    /// The same explanation, with these errors in blocks left out.
    fn with_errors(of: &Explanation, without: f64, with: f64, adequate: bool) -> Explanation {
        let mut e = of.clone();
        let mut steps = e.fit.train.clone();
        (steps.simulation.rmse, steps.parameters_only.rmse) = (2.0 * without, without);
        steps.augmented.rmse = with;
        e.fit.heldout = Some(steps);
        e.remaining.adequate = adequate;
        e.remaining.p_value = if adequate { 0.5 } else { 1e-12 };
        e
    }

    #[test]
    fn the_better_explanation_is_given_and_what_is_not_sure_is_taken_back() {
        let named = drag();
        assert!(is_doubtful(&with_errors(&named, 1.0, 0.52, true)));
        assert!(!is_doubtful(&with_errors(&named, 1.0, 0.48, true)));
        let mut sensor = with_errors(&named, 1.0, 0.7, true);
        sensor.effects[0].effect = "sensor_saturation".to_owned();
        assert!(!is_doubtful(&sensor));
        let judged = |without: f64, with: f64, adequate: bool| {
            let mut e = with_errors(&named, without, with, adequate);
            assert!(is_doubtful(&e));
            doubt(&mut e);
            (e.verdict, e.effects.len())
        };
        assert_eq!(judged(1.0, 0.9, false), (Verdict::Unexplained, 1));
        assert_eq!(judged(1.0, 0.9, true), (Verdict::Parameters, 0));
        assert_eq!(judged(1.0, 1.1, true), (Verdict::Parameters, 0));
        assert_eq!(judged(1.0, 0.5, false), (Verdict::Unexplained, 1));

        // Little structure beside little that was explained, where other parameters follow the recording.
        let little = |p_value: f64, fit: f64| {
            let mut e = with_errors(&named, 1.0, 0.9, false);
            e.verdict = Verdict::Unexplained;
            e.remaining.p_value = p_value;
            if let Some(steps) = &mut e.fit.heldout {
                steps.parameters_only.fit_percent = fit;
            }
            e.summary.push(NOTHING_ADEQUATE.to_owned());
            doubt(&mut e);
            (
                e.verdict,
                e.summary.iter().any(|line| line == NOTHING_ADEQUATE),
            )
        };
        assert_eq!(little(1e-8, 98.0), (Verdict::Parameters, false));
        assert_eq!(little(1e-10, 98.0), (Verdict::Unexplained, true));
        assert_eq!(little(1e-8, 80.0), (Verdict::Unexplained, true));

        // What makes blocks left out worse is no effect, however sure the criterion is of it.
        let unless_worse = |with: f64| unless_refuted(with_errors(&named, 1.0, with, true)).verdict;
        assert_eq!(unless_worse(1.01), Verdict::Named);
        assert_eq!(unless_worse(1.05), Verdict::Unexplained);

        let run = |error: f64, adequate: bool| {
            let mut e = with_errors(&named, 1.0, 0.8, adequate);
            for t in &mut e.signals {
                let errors = t.augmented.iter_mut().zip(&t.recorded);
                errors.for_each(|(s, y)| *s = y + error * (*s - y));
            }
            e
        };
        let linear = run(1.0, false);
        assert!(stands_in(&run(0.9, true), &linear));
        assert!(!stands_in(&run(1.1, true), &linear));
        assert!(!stands_in(&run(0.9, false), &linear));
        assert!(stands_in(&run(0.5, false), &linear));

        // A second opinion.
        let with = |error: f64, verdict: Verdict, id: &str| {
            let mut e = run(error, true);
            e.verdict = verdict;
            e.effects[0].effect = id.to_owned();
            e
        };
        let drag = with(0.9, Verdict::Named, "quadratic_drag");
        let law = with(1.0, Verdict::Named, "law");
        let unexplained = with(1.0, Verdict::Unexplained, "hysteresis");
        assert!(!is_sure(&law, true) && is_sure(&law, false) && is_sure(&drag, true));
        assert!(!is_sure(&unexplained, false));
        assert!(is_sure(&with(1.0, Verdict::Parameters, "law"), true));
        assert!(replaces(&drag, &law) && !replaces(&law, &law));
        assert!(!replaces(
            &with(1.1, Verdict::Named, "quadratic_drag"),
            &law
        ));
        assert!(replaces(&drag, &unexplained) && replaces(&law, &unexplained));
        assert!(!replaces(
            &with(0.1, Verdict::Unexplained, "law"),
            &unexplained
        ));

        // Another plant.
        let curve = with(1.0, Verdict::Named, "cubic_stiffness");
        let other = with(1.0, Verdict::Named, "tank_outflow");
        assert!(leaves_room(&curve) && leaves_room(&unexplained));
        assert!(!leaves_room(&with(1.0, Verdict::Parameters, "law")));
        assert!(supersedes(&other, &curve) && supersedes(&other, &unexplained));
        assert!(!supersedes(
            &other,
            &with(1.0, Verdict::Named, "input_delay")
        ));
        assert!(supersedes(
            &with(0.5, Verdict::Named, "tank_outflow"),
            &with(1.0, Verdict::Named, "input_delay")
        ));
        let mut two = other.clone();
        two.effects.push(curve.effects[0].clone());
        assert!(!supersedes(&two, &curve));
        assert!(!supersedes(
            &with(0.5, Verdict::Parameters, "tank_outflow"),
            &curve
        ));

        assert!(agree(&run(1.1, true), &linear));
        let mut other = run(1.1, true);
        other.effects[0].effect = "coulomb_friction".to_owned();
        assert!(!agree(&other, &linear));
    }
}
