//! The test of what is left, on a mass on a spring: where nothing is left, and where a law is.

use rayon::prelude::*;

use super::*;
use crate::explain::linear::fit::Effort;
use crate::explain::linear::fixtures::{SAMPLES, effect, recorded, spring};
use crate::explain::linear::model::structure::Structure;

/// Of the law.
const SIZE: f64 = 300.0;

/// A linear plant, all its numbers free.
fn linear() -> Structure {
    Structure {
        plant_free: true,
        ..spring(Vec::new())
    }
}

/// The same with a spring that may stiffen.
fn stiffening() -> Structure {
    Structure {
        plant_free: true,
        ..spring(vec![effect("cubic_stiffness", "")])
    }
}

/// Starts at the truth: the law at `size`, or no law.
fn fitted(problem: &Problem, structure: Structure, size: Option<f64>) -> Fit {
    let mut theta = structure.given();
    theta.extend(size);
    Fit::run(problem, structure, theta, None, Effort::FINAL).unwrap()
}

#[test]
fn noise_is_called_structure_as_often_as_the_level_says() {
    let runs = 300u32;
    let p: Vec<f64> = (0..runs)
        .into_par_iter()
        .map(|seed| {
            let truth = spring(Vec::new());
            let data = recorded(&truth, &[], u64::from(seed));
            let problem = Problem::new(&data);
            let fit = fitted(&problem, linear(), None);
            let found = adequacy(&problem, &fit, &fit, None).unwrap();
            assert!(found.of_removed.is_infinite());
            found.p_value
        })
        .collect();
    // Two tests of which the lower probability counts, and Bonferroni's bound: at most the level, and not far below it. A
    // standard deviation is 3.8 and 6.3 of the counts expected.
    for (level, expected, most) in [(0.05, 15.0, 27.0), (0.15, 43.0, 62.0)] {
        let count = p.iter().filter(|p| **p < level).count() as f64;
        assert!(
            (0.35 * expected..=most).contains(&count),
            "{count} of {runs} below {level}, expected {expected}"
        );
    }
}

/// Under noise of first order, in which a missed law does not hide: what is asked is the test, not the noise model.
#[test]
fn a_law_that_was_missed_is_seen_in_its_size() {
    for seed in 0..4 {
        let mut truth = spring(vec![effect("cubic_stiffness", "")]).given();
        truth.push(SIZE);
        let data = recorded(&spring(vec![effect("cubic_stiffness", "")]), &truth, seed);
        let problem = Problem::new(&data);
        let without = fitted(&problem, linear(), None);
        let with = fitted(&problem, stiffening(), Some(SIZE));

        let missed = adequacy_under(Colours::First, &problem, &without, &without, None).unwrap();
        assert!(missed.p_value < LEVEL && !missed.holds(), "{missed:?}");
        // What the law removes is the structure that was there: hats in the position are near that law, and what chance explains is taken off.
        let noise = Noise::estimate(&without.residual, 1, &problem.mask, Colours::First);
        let there = square(
            &noise.whiten(&without.residual, &problem.mask),
            &problem.mask,
        );
        let now = square(&noise.whiten(&with.residual, &problem.mask), &problem.mask);
        let structure = 1.0 - now / there;
        assert!(
            missed.share > 0.45 * structure && missed.share < 1.02 * structure,
            "{} of {structure}",
            missed.share
        );
        // In the likelihood: the logarithm of what is left of the variance.
        let gain = -(SAMPLES as f64) * (1.0 - missed.share).ln();
        assert!((missed.gain(SAMPLES) - gain).abs() < 1e-9 * gain);

        let found =
            adequacy_under(Colours::First, &problem, &with, &without, Some(&without)).unwrap();
        assert!(found.p_value > LEVEL && found.holds(), "{found:?}");
        assert!(found.of_removed.is_finite() && found.of_removed < 0.1);

        // A tenth of the law is known: what is left, over what the tenth has removed.
        let mut tenth = truth.clone();
        *tenth.last_mut().unwrap() = 0.1 * SIZE;
        let tenth = Fit::at(&problem, spring(vec![effect("cubic_stiffness", "")]), tenth).unwrap();
        let bare = Fit::at(&problem, spring(Vec::new()), Vec::new()).unwrap();
        let left = adequacy_under(Colours::First, &problem, &tenth, &bare, Some(&bare)).unwrap();
        let noise = Noise::estimate(&tenth.residual, 1, &problem.mask, Colours::First);
        let whitened =
            |fit: &Fit| square(&noise.whiten(&fit.residual, &problem.mask), &problem.mask);
        let (before, now) = (whitened(&bare), whitened(&tenth));
        let expected = left.share * now / (before - now);
        assert!(!left.holds(), "{left:?}");
        assert!(
            (left.of_removed / expected - 1.0).abs() < 0.2,
            "{left:?} {expected}"
        );
    }
}

#[test]
fn a_line_is_seen_in_its_size() {
    let n = 4000;
    let mut alarms = 0;
    for seed in 0..200 {
        let quiet: Series = vec![
            recorded(&spring(Vec::new()), &[], seed)
                .segments
                .remove(0)
                .inputs
                .remove(0),
        ];
        let mask: Mask = vec![vec![true; quiet[0].len()]];
        alarms += usize::from(line(&quiet, &mask).p_value < 0.05);
    }
    // A bound on the probability, near what it is: 10 expected, 3.1 their standard deviation.
    assert!((2..=20).contains(&alarms), "{alarms} of 200");
    // Between two frequencies of the periodogram the line shows 40 % of its power in the one next to it, on one all.
    for (cycles, least) in [(400.0, 0.98), (400.5, 0.38)] {
        let wave: Series = vec![
            (0..n)
                .map(|k| {
                    let phase = std::f64::consts::TAU * cycles * f64::from(k) / f64::from(n);
                    let hash = f64::from(k).mul_add(78.233, 0.5).sin() * 43_758.545;
                    0.5 * phase.sin() + (hash - hash.floor() - 0.5)
                })
                .collect(),
        ];
        let mask: Mask = vec![vec![true; wave[0].len()]];
        let found = line(&wave, &mask);
        let power = 0.125 * f64::from(n);
        assert!(found.p_value < 1e-9);
        assert!(
            found.explained > (least - 0.03) * power && found.explained < 1.03 * power,
            "{} of {power}",
            found.explained
        );
    }
}

#[test]
fn another_class_is_asked_over_what_it_removed() {
    let objected = Adequacy {
        share_of_error: 0.0,
        features: 70,
        p_value: 1e-9,
        share: 0.3,
        of_removed: f64::INFINITY,
        tolerated: OF_REMOVED,
    };
    assert!(!objected.holds());
    // 0.3 of what is left is 0.06 of what was removed.
    let excused = objected.of_class(6.0, 1.0);
    assert!((excused.of_removed - 0.06).abs() < 1e-12 && excused.holds());
    assert!(!objected.of_class(3.0, 1.0).holds());
    assert!(!objected.of_class(1.0, 2.0).holds());
    let fine = Adequacy {
        share_of_error: 0.0,
        p_value: 0.5,
        ..objected
    };
    assert!(fine.of_class(1.0, 2.0).of_removed.is_infinite());
    // Beside no physics, little structure is no objection, however certain.
    for (share, holds) in [(0.029, true), (0.031, false)] {
        assert_eq!(Adequacy { share, ..objected }.holds(), holds);
    }
}

#[test]
fn structure_at_a_lower_level_is_not_called_nothing() {
    let said = |p_value: f64| {
        let found = Adequacy {
            features: 54,
            p_value,
            share: 0.01,
            share_of_error: 0.01,
            of_removed: f64::INFINITY,
            tolerated: OF_REMOVED,
        };
        assert!(found.holds());
        found.sentence("")
    };
    assert_eq!(
        said(0.38),
        "Nothing is left that 54 flexible features find (p = 0.38)"
    );
    assert_eq!(
        said(3e-4),
        "54 flexible features find structure in the residual at the 1 % level (p = 3e-4), but not at the 0.01 % level, which \
         would count against the answer"
    );
}
