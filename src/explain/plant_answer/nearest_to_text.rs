//! Of parameters and curves that a recording tells only together, those with parameters near the text.

use nalgebra::DMatrix;

use crate::explain::engine::thresholds::THOROUGH;
use crate::physics::estimate::{Fit, Study};

/// A standard deviation that a curve multiplies by this is due to the curve: it does what the parameter does.
const LOOSENED: f64 = 3.0;
/// Part of the slack that a step takes which cannot go to the text.
const NEARLY: f64 = 0.8;

/// The fit with those parameters as near to the text as the recording allows that a curve has made uncertain, and its covariance
/// given their values; none where there are no such parameters. The deviance may rise by `slack`. `text` are the parameters, with
/// which the numbers of the fit begin, and `before` is their covariance without the curve.
pub(super) fn nearest_to_text(
    study: &Study,
    fit: &Fit,
    text: &[f64],
    before: &DMatrix<f64>,
    slack: f64,
) -> Option<(Fit, DMatrix<f64>)> {
    let covariance = study.covariance(fit);
    let ratio = |i: usize| covariance[(i, i)] / before[(i, i)];
    let loosened = |i: &usize| ratio(*i).is_finite() && ratio(*i) > LOOSENED * LOOSENED;
    let mut parameters: Vec<usize> = (0..text.len()).filter(loosened).collect();
    parameters.sort_by(|&a, &b| ratio(b).total_cmp(&ratio(a)));
    let (mut moved, mut held) = (fit.clone(), Vec::new());
    for i in parameters {
        held.push(i);
        let to = |part: f64, moved: &Fit| {
            let mut start = moved.clone();
            start.point[i] += part * (text[i] - moved.point[i]);
            study.holding(&start, &held, THOROUGH)
        };
        let rise = |next: &Fit| next.deviance - fit.deviance;
        let whole = to(1.0, &moved)?;
        if rise(&whole) <= slack {
            moved = whole;
            continue;
        }
        // The deviance is nearly a parabola in what one parameter moves.
        let left = NEARLY * (slack - rise(&moved)).max(0.0);
        let part = (left / (rise(&whole) - rise(&moved))).sqrt();
        if let Some(next) = to(part, &moved).filter(|next| rise(next) <= slack) {
            moved = next;
        }
    }
    let covariance = given(study.covariance(&moved), &held);
    (!held.is_empty()).then_some((moved, covariance))
}

/// A covariance given some of its numbers. These keep their own variances.
fn given(mut covariance: DMatrix<f64>, held: &[usize]) -> DMatrix<f64> {
    for &i in held {
        let column = covariance.column(i).into_owned();
        let own = column[i];
        if own.is_finite() && own > 0.0 {
            covariance -= &column * column.transpose() / own;
        }
        covariance.row_mut(i).fill(0.0);
        covariance.column_mut(i).fill(0.0);
        covariance[(i, i)] = own;
    }
    covariance
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::estimate::{EstimateOptions, PlantRecording};
    use crate::physics::{Excitation, Hold, Plant, parse};

    const SAMPLES: usize = 800;

    /// A store that loses by `k*x`, and by a curve of `x` that may do the same.
    fn store() -> Plant {
        let text = "model Store
               parameter Real k = 0.4; parameter Real b = 1.2;
               parameter Real f1 = 0.1; parameter Real f2 = 0.1; parameter Real f3 = -0.2;
               input Real u; output Real y; Real x(start=0.2);
             equation
               der(x) = b*u - k*x + f1*max(0, min(1, (0 - x)/1)) + f3*max(0, min(1, (x - 0)/1))
                 + f2*max(0, min((x - (-1))/1, (1 - x)/1));
               y = x;
             end Store;";
        Plant::new(parse(text).unwrap())
    }

    /// What it does, with noise that is the same in every run.
    fn recorded(plant: &Plant) -> PlantRecording {
        let time = |k: usize| k as f64;
        let input: Vec<f64> = (0..SAMPLES)
            .map(|k| 1.2 * (0.05 * time(k)).sin() + (0.17 * time(k)).cos())
            .collect();
        let excitation = Excitation {
            inputs: &[&input],
            length: SAMPLES,
            sample_time: 0.1,
            start_time: 0.0,
            hold: Hold::Zero,
        };
        let run = plant.simulate(&plant.nominal(), &excitation, None).unwrap();
        let noise = |k: usize| 0.05 * ((k * 7919 % 101) as f64 / 50.0 - 1.0);
        let output = run.outputs[0].iter().enumerate();
        PlantRecording {
            outputs: vec![output.map(|(k, y)| y + noise(k)).collect()],
            inputs: vec![input],
            sample_time: 0.1,
            start_time: 0.0,
        }
    }

    #[test]
    fn what_a_curve_makes_uncertain_stays_as_the_text_has_it() {
        let plant = store();
        let recordings = [recorded(&plant)];
        let options = |parameters: usize| EstimateOptions {
            free: (0..5).map(|i| i < parameters).collect(),
            hold: Hold::Zero,
            form: None,
            least_squares: true,
        };
        let (with, without) = (options(5), options(2));
        let study = Study::new(&plant, &recordings, &with).unwrap();
        let fit = study.least_squares(&study.nominal()).unwrap();
        let simple = Study::new(&plant, &recordings, &without).unwrap();
        let before = simple.covariance(&simple.least_squares(&simple.nominal()).unwrap());
        let loose = study.covariance(&fit);

        let (near, tight) = nearest_to_text(&study, &fit, &[0.4, 1.2], &before, 4.0).unwrap();
        assert!(near.deviance - fit.deviance <= 4.0);
        assert_eq!(near.point[0], 0.4);
        // At its middle knot, where `x` is 0, the curve was known before.
        for i in [2, 4] {
            assert!(tight[(i, i)] < 0.2 * loose[(i, i)], "{i}: {tight} {loose}");
        }
        // A text far from what was recorded is met as nearly as the recording allows.
        let (near, _) = nearest_to_text(&study, &fit, &[0.45, 1.2], &before, 4.0).unwrap();
        assert!((1.0..=4.0).contains(&(near.deviance - fit.deviance)));
        assert!(near.point[0] > fit.point[0]);
    }
}
