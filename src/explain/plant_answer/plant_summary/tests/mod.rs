//! Sentences of answers.

use super::*;
use crate::explain::explanation::{Evidence, FitFigure, FitSteps};
use std::collections::BTreeMap;

/// An effect with this gain.
pub(in super::super) fn found(id: &str, criterion_gain: f64) -> EffectFound {
    EffectFound {
        effect: id.to_owned(),
        hypothesis: false,
        variant: String::new(),
        signal: "v".to_owned(),
        port: "process".to_owned(),
        equation: "m*der(v) = u - c*v".to_owned(),
        enters: Some("v".to_owned()),
        depends: vec!["v".to_owned()],
        law: None,
        parameters: BTreeMap::new(),
        evidence: Evidence {
            criterion_gain,
            criterion_needed: NEEDED,
            heldout_gain: None,
            halves_disagree: None,
        },
        sentence: format!("{id} enters the equation of v"),
    }
}

#[test]
fn what_is_as_good_as_the_closest_is_listed() {
    let closest = &found("quadratic_drag", 40.0);
    let rival = |id: &str, less: f64| Alternative {
        effect: id.to_owned(),
        support: 1.0,
        criterion_gain: closest.evidence.criterion_gain - less,
        why_not: String::new(),
    };
    let all = [
        rival(&closest.effect, 0.0),
        rival("natural_convection", 5.0),
        rival("sensor_offset", 7.0),
    ];
    let said = as_good(closest, &all).unwrap();
    assert!(said.ends_with("by BIC: natural convection."), "{said}");
    assert_eq!(as_good(closest, &all[..1]), None);
}

fn output(name: &str, percent: [f64; 3], heldout: Option<[f64; 2]>) -> OutputFit {
    let figure = |fit_percent: f64| FitFigure {
        rmse: 1.0,
        fit_percent,
    };
    let train = FitSteps {
        simulation: figure(percent[0]),
        parameters_only: figure(percent[1]),
        augmented: figure(percent[2]),
        noise_floor: figure(99.0),
        improvement_95: None,
    };
    let heldout = heldout.map(|[without, with]| {
        let mut steps = train.clone();
        steps.parameters_only.fit_percent = without;
        steps.augmented.fit_percent = with;
        steps
    });
    OutputFit {
        output: name.to_owned(),
        train,
        heldout,
    }
}

const NOTHING: Told = Told {
    verdict: Verdict::Consistent,
    probability: 0.85,
    effects: &[],
    parameters: &[],
    differs: Differs::No,
    alternatives: &[],
    outputs: &[],
    p_value: 0.3,
    strays: 1.1,
    astray: None,
    refused: None,
    too_short: None,
};

#[test]
fn all_outputs_are_told() {
    let one = [output("y", [10.0, 20.0, 30.0], Some([5.0, 25.0]))];
    assert_eq!(
        free_runs(&one, false, Origin::Text),
        "Free run of y: 10.0 % with the values of the text, 20.0 % with estimated parameters and initial states."
    );
    assert!(
        held_out(&one)
            .unwrap()
            .ends_with("it: 5.0 % without it, 25.0 % with it.")
    );
    let two = [
        output("T2", [10.0, 20.0, 30.0], Some([5.0, 25.0])),
        output("T1", [70.0, 80.0, 90.0], Some([60.0, 85.0])),
    ];
    assert_eq!(
        free_runs(&two, true, Origin::Text),
        "Free run of each output, worst first: T2 10.0 % with the values of the text, 20.0 % with estimated parameters and \
         initial states, 30.0 % with what was found; T1 70.0 %, 80.0 %, 90.0 %."
    );
    let said = held_out(&two).unwrap();
    assert!(
        said.ends_with("T2 5.0 % without it, 25.0 % with it; T1 60.0 %, 85.0 %."),
        "{said}"
    );
    assert_eq!(held_out(&[output("y", [1.0; 3], None)]), None);
}

#[test]
fn a_residual_that_is_not_white_is_not_called_noise() {
    let hidden = nothing_missing(&NOTHING, false, true);
    assert!(!hidden[0].contains("white"), "{hidden:?}");
    let white = nothing_missing(&NOTHING, false, false);
    assert_eq!(
        white,
        ["The equations explain the recording with the values of the text; residuals are white."]
    );
    let told = Told {
        p_value: 0.0027,
        strays: 6.3,
        astray: None,
        refused: None,
        too_short: None,
        ..NOTHING
    };
    let said = nothing_missing(&told, false, false);
    assert_eq!(
        said[0],
        "With the values of the text, no effect of the library improves the fit significantly, but the residual is not white \
         (p = 0.0027)."
    );
    assert!(said[1].contains("6.3 times"), "{said:?}");
    assert!(said[1].contains("cannot be told apart"), "{said:?}");
    let told = Told {
        strays: 6.3,
        astray: None,
        refused: None,
        too_short: None,
        ..NOTHING
    };
    assert!(!nothing_missing(&told, false, false)[0].contains("white"));
}

#[test]
fn parameters_that_differ_together_are_not_called_those_of_the_text() {
    let test = JointTest {
        chi_square: 312.0,
        degrees_of_freedom: 4,
        p_value: 0.0,
        largest_correlation: 0.9871,
    };
    let told = Told {
        differs: Differs::Together(test),
        ..NOTHING
    };
    let said = nothing_missing(&told, false, false).join(" ");
    assert!(!said.contains("with the values of the text"), "{said}");
    assert!(
        said.contains("chi-square 312.0, 4 degrees of freedom, p < 1e-12"),
        "{said}"
    );
    assert!(said.contains("by up to 0.987"), "{said}");
}

#[test]
fn a_bound_and_nothing_missing_do_not_stand_together() {
    let bounds = ["UA (min = 1.000)".to_owned()];
    let told = Told {
        verdict: Verdict::Parameters,
        differs: Differs::Parameters,
        ..NOTHING
    };
    assert!(nothing_missing(&told, false, false)[0].ends_with("nothing is missing in them."));
    assert!(!nothing_missing(&told, true, false)[0].contains("nothing is missing"));
    assert!(
        bounds_in_words(&bounds, &told)
            .unwrap()
            .contains("The bound is wrong")
    );
    let said = bounds_in_words(&bounds, &NOTHING).unwrap();
    assert!(!said.contains("The bound is wrong"), "{said}");
    assert_eq!(bounds_in_words(&[], &told), None);
}

#[test]
fn structure_beside_a_name_is_told_with_its_probability() {
    assert!(structure(0.38).contains("no structure in the residuals (p = 0.38)"));
    assert!(structure(0.0063).ends_with("still find structure in the residuals (p = 0.0063)"));
    assert!(structure(1e-25).ends_with("(p < 1e-12): more is missing than this"));
}

#[test]
fn the_closest_candidate_is_not_called_proven() {
    let said = closest(&found("quadratic_drag", 40.0));
    assert!(said.contains("not proven (quadratic_drag): "), "{said}");
}
