//! `explain` on cases that an independent fine-step simulator draws (`tests/concealed/`).
//!
//! ```text
//! cargo test --release --test concealed -- --nocapture
//! ```
//!
//! prints what was concealed against what was said. `INNOVANT_CONCEALED_CASES` sets how many cases conceal an effect
//! (40), `INNOVANT_CONCEALED_NULLS` how many conceal nothing (24), `INNOVANT_CONCEALED_LEFT_OUT` how many effects are asked
//! for again without their entry in the library (8), `INNOVANT_CONCEALED_SEED` draws others, and
//! `INNOVANT_CONCEALED_SAMPLES` sets their length; `INNOVANT_CONCEALED_FOLDER` keeps the cases that were not answered
//! rightly, as files with their truth.

#[path = "concealed/mod.rs"]
mod concealed;
mod study;

use std::time::Instant;

use concealed::{Drawing, Effect, Kind, draw};
use innovant::explain::{Explanation, Options, Verdict, explain};
use innovant::report::to_json;
use rayon::prelude::*;
use study::answer::Outcome;
use study::plan::Plan;
use study::question::Question;
use study::tables::{self, count, quantile, sorted};

/// At most this many of `n`, when each has probability `share`: the mean and one and a half deviations, rounded up.
fn most(share: f64, n: usize) -> usize {
    let mean = share * n as f64;
    (mean + 1.5 * mean.sqrt()).ceil() as usize
}

#[test]
fn concealed_effects_are_named() {
    let plan = Plan::from_environment();
    let start = Instant::now();
    let answers = plan.run();
    println!("{plan:?}");
    tables::print(&answers);
    println!("{:.0} s", start.elapsed().as_secs_f64());

    let effects = &answers.effects;
    for answer in effects
        .iter()
        .chain(&answers.nulls)
        .chain(&answers.left_out)
        .chain(&answers.unlisted)
    {
        let failed = answer.outcome == Outcome::Failed;
        assert!(!failed, "{}: {:?}", answer.label, answer.trouble);
    }
    let wrong = count(effects, Outcome::Wrong);
    assert!(wrong <= most(0.03, effects.len()), "{wrong} wrong names");
    let alarms = count(&answers.nulls, Outcome::FalseAlarm);
    assert!(
        alarms <= most(0.01, answers.nulls.len()),
        "{alarms} false alarms"
    );
    // What is not in the library is not called something else more often than not.
    let invented = count(&answers.left_out, Outcome::Wrong);
    let asked = answers.left_out.len();
    assert!(
        2 * invented <= asked,
        "{invented} of {asked} took another name"
    );
    // Eight of ten, with 1.6 standard deviations of slack: 28 of 40.
    let n = effects.len() as f64;
    let least = 0.8 * n - 1.6 * (0.16 * n).sqrt();
    let named = count(effects, Outcome::Named);
    assert!(named as f64 >= least.floor(), "{named} of {n} named");
    let removed = sorted(effects, |a| a.removed);
    let median = quantile(&removed, 0.5);
    assert!(median > 0.9, "median {median} of the error removed");
    let overlaps = sorted(effects, |a| a.overlap);
    if !overlaps.is_empty() {
        let median = quantile(&overlaps, 0.5);
        assert!(median > 0.8, "median overlap of windows {median}");
    }
}

fn ask(question: &Question) -> Explanation {
    explain(
        std::slice::from_ref(&question.recording),
        &question.simulation,
        &Options::default(),
    )
    .unwrap()
}

fn ids(explanation: &Explanation) -> Vec<&str> {
    explanation
        .effects
        .iter()
        .map(|e| e.effect.as_str())
        .collect()
}

fn drawing(kind: Kind) -> Drawing {
    Drawing {
        kind,
        samples: 1500,
        ..Drawing::default()
    }
}

/// Other units of both recording and simulation change nothing: the true plant stays consistent.
#[test]
fn true_plants_stay_consistent_in_other_units() {
    let right = (0..)
        .map(|index| draw(7, index, &drawing(Kind::Null)))
        .filter(|case| {
            case.truth.parameter_error == 0.0 && case.truth.known_to_simulation.is_empty()
        });
    for case in right.take(4) {
        let question = Question::of(&case);
        for question in [&question, &question.in_units(1e3, 1e3)] {
            let said = ask(question);
            assert_eq!(
                said.verdict,
                Verdict::Consistent,
                "{:?}: {:?}",
                case.truth,
                said.summary
            );
        }
    }
}

/// What is said depends neither on the unit of the outputs nor on when the clock was set.
#[test]
fn answers_do_not_depend_on_units_or_the_clock() {
    let effects = [
        Effect::CoulombFriction,
        Effect::CubicStiffness,
        Effect::InputSaturation,
        Effect::SensorOffset,
        Effect::LoadStep,
        Effect::PeriodicDisturbance,
    ];
    let ask_again = |(index, effect): (usize, Effect)| {
        let mut changed = Vec::new();
        let case = draw(11, index, &drawing(Kind::Effect(effect)));
        let question = Question::of(&case);
        let said = ask(&question);
        const LATER: f64 = 7200.0;
        for (what, question, moved) in [
            (
                "outputs times 1000, later",
                question.in_units(1.0, 1e3).starting_at(LATER),
                LATER,
            ),
            ("all times 1000", question.in_units(1e3, 1e3), 0.0),
        ] {
            let again = ask(&question);
            let same_window = again
                .location
                .time
                .iter()
                .zip(&said.location.time)
                .all(|(a, b)| (0..2).all(|i| (a[i] - b[i] - moved).abs() < 2.0 * case.truth.dt));
            if again.verdict != said.verdict || ids(&again) != ids(&said) || !same_window {
                let words = |e: &Explanation| {
                    format!("{:?} {:?} {:?}", e.verdict, ids(e), e.location.time.first())
                };
                changed.push(format!(
                    "{}, {what}: {} became {}",
                    effect.id(),
                    words(&said),
                    words(&again)
                ));
            }
        }
        changed
    };
    let changed: Vec<String> = effects
        .into_par_iter()
        .enumerate()
        .with_max_len(1)
        .flat_map_iter(ask_again)
        .collect();
    assert!(changed.is_empty(), "{}", changed.join("\n"));
}

/// How well the answer fits, in percent: what was never fitted where there is such, else what was.
fn fits(explanation: &Explanation) -> [f64; 3] {
    let steps = explanation
        .fit
        .heldout
        .as_ref()
        .unwrap_or(&explanation.fit.train);
    [steps.simulation, steps.parameters_only, steps.augmented].map(|figure| figure.fit_percent)
}

/// Neither do units of up to 1e6, the unit of time, the order of channels or the number of threads change what is said.
///
/// Fits agree to 0.05 %: a search ends where a step gains 1e-6 of its cost, and numbers of another size round otherwise on
/// the way there.
#[test]
fn answers_do_not_depend_on_how_the_channels_are_written() {
    const SAME_FIT: f64 = 0.05;
    let mut changed = Vec::new();
    // The second has more than one output.
    for (effect, outputs) in [(Effect::InputBacklash, 1), (Effect::SensorSaturation, 2)] {
        let drawing = Drawing {
            samples: 1000,
            ..drawing(Kind::Effect(effect))
        };
        let case = (0..)
            .map(|index| draw(12, index, &drawing))
            .find(|case| case.recording.outputs.len() == outputs);
        let question = Question::of(&case.unwrap());
        let in_pool = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            pool.install(|| ask(&question))
        };
        let said = in_pool(1);
        assert_eq!(to_json(&said).unwrap(), to_json(&in_pool(2)).unwrap());
        for (what, question) in [
            (
                "small inputs, large outputs, slower",
                question.in_units(1e-6, 1e6).in_time_of(1e3),
            ),
            (
                "large inputs, small outputs, faster, turned",
                question.in_units(1e6, 1e-6).in_time_of(1e-3).turned(),
            ),
        ] {
            let again = ask(&question);
            let apart = fits(&again)
                .into_iter()
                .zip(fits(&said))
                .map(|(a, b)| (a - b).abs())
                .fold(0.0, f64::max);
            if again.verdict != said.verdict || ids(&again) != ids(&said) || apart > SAME_FIT {
                changed.push(format!(
                    "{}, {what}: {:?} {:?} became {:?} {:?}, fits {:?} {:?}",
                    effect.id(),
                    said.verdict,
                    ids(&said),
                    again.verdict,
                    ids(&again),
                    fits(&said),
                    fits(&again),
                ));
            }
        }
    }
    assert!(changed.is_empty(), "{}", changed.join("\n"));
}
