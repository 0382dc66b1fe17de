//! More knots for a curve where the recording asks for them.

use crate::explain::engine::fitting::candidate::{Candidate, candidate};
use crate::explain::engine::fitting::fitted::{Fitted, TIE, searched, with_more};
use crate::explain::engine::hypothesis::Ground;
use crate::explain::engine::screening::curve::Curve;
use crate::explain::engine::screening::projection::Projection;
use crate::explain::engine::screening::screen::Lead;
use crate::explain::engine::terms::argument::Argument;
use crate::explain::engine::thresholds::{MOST_STEPS, ROUNDS, THOROUGH};
use crate::physics::estimate::Fit;

/// Rounds in which knots are added.
const REFINEMENTS: usize = 3;
/// Most knots in all.
const MOST_KNOTS: usize = 30;
/// Samples that there are at least on each side of a new knot, up to its neighbour.
const LEAST_SAMPLES: usize = 10;

impl Curve {
    /// The same function with these knots more.
    fn with_knots(&self, new: &[f64]) -> Self {
        let mut knots = [&self.knots, new].concat();
        knots.sort_by(f64::total_cmp);
        let values = knots.iter().map(|&z| self.at(z)).collect();
        Self { knots, values }
    }
}

/// A curve with knots in the middle of those intervals where one alone gains what ties do not explain, as long as the whole
/// gains as much; none where that adds nothing.
pub(in crate::explain::engine) fn refined_curve(
    best: &Fitted,
    arguments: &[Argument],
    ground: &Ground,
) -> Option<Fitted> {
    let argument = &arguments[best.lead.argument?];
    let mut found: Option<Fitted> = None;
    for _ in 0..REFINEMENTS {
        let now = found.as_ref().unwrap_or(best);
        let Some(better) = refined(now, argument, arguments, ground) else {
            break;
        };
        found = Some(better);
    }
    found
}

fn refined(
    now: &Fitted,
    argument: &Argument,
    arguments: &[Argument],
    ground: &Ground,
) -> Option<Fitted> {
    let first = ground.study.parameters();
    let knots = now.lead.curve.as_ref()?.knots.clone();
    let values = now.fit.point[first..first + knots.len()].to_vec();
    let curve = Curve { knots, values };
    let samples = |from: f64, to: f64| {
        let all = argument.values.iter().flatten();
        all.filter(|z| (from..to).contains(*z)).count()
    };
    let middles = curve.knots.windows(2).filter_map(|pair| {
        let middle = 0.5 * (pair[0] + pair[1]);
        let few =
            samples(pair[0], middle) < LEAST_SAMPLES || samples(middle, pair[1]) < LEAST_SAMPLES;
        (!few).then_some(middle)
    });
    let middles: Vec<f64> = middles.collect();
    let with = |new: &[f64]| -> Option<(Lead, Candidate, Fit)> {
        let mut lead = now.lead.clone();
        lead.curve = Some(curve.with_knots(new));
        let made = candidate(&ground.plant.spec, &lead, arguments, ground.recordings)?;
        let start = made.from(&now.without_term(first), first);
        Some((lead, made, start))
    };
    let rough = |made: &Candidate| {
        let options = with_more(ground.options, made.values.len());
        (made.rough(ground.study, MOST_STEPS), options)
    };
    // A score test of every new knot, beside the curve as it is: with all of them in it, it is the same function.
    let projection = {
        let (plant, options) = rough(&now.candidate);
        Projection::new(&ground.study.of(&plant, &options).ok()?, &now.fit)?
    };
    let (lead, made, start) = with(&middles)?;
    let (plant, options) = rough(&made);
    let wide = ground.study.of(&plant, &options).ok()?;
    let derivatives = wide.derivatives(&start)?;
    let inside = wide.inside(&start);
    let knots = &lead.curve.as_ref()?.knots;
    let gain = |middle: f64| -> Option<f64> {
        let number = first + knots.iter().position(|&k| k == middle)?;
        let column = inside.iter().position(|&i| i == number)?;
        let column = derivatives.column(column).iter().copied().collect();
        Some(
            wide.information() * projection.test(column, true)?.statistic - wide.cost_of_a_number(),
        )
    };
    let tested = middles.iter().map(|&m| (gain(m).unwrap_or(0.0), m));
    let mut useful: Vec<(f64, f64)> = tested.filter(|(gain, _)| *gain > TIE.0).collect();
    useful.sort_by(|a, b| b.0.total_cmp(&a.0));
    useful.truncate(MOST_KNOTS.saturating_sub(curve.knots.len()));
    if useful.is_empty() {
        return None;
    }
    let new: Vec<f64> = useful.into_iter().map(|(_, middle)| middle).collect();
    let (lead, made, start) = with(&new)?;
    let (plant, options) = rough(&made);
    let fit = ground
        .study
        .of(&plant, &options)
        .ok()?
        .refit(&start, ROUNDS, THOROUGH)?;
    let gain = ground.fit.criterion - fit.criterion - searched(&lead, ground.recordings);
    (gain > now.gain + TIE.0).then(|| Fitted {
        gain,
        lead,
        candidate: made,
        fit,
        ..now.clone()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_knots_are_the_same_function() {
        let curve = Curve {
            knots: vec![-1.0, 0.5, 2.0],
            values: vec![3.0, -1.0, 4.0],
        };
        let finer = curve.with_knots(&[1.1, -0.2]);
        assert_eq!(finer.knots, [-1.0, -0.2, 0.5, 1.1, 2.0]);
        for i in 0..50 {
            let z = -2.0 + 0.1 * f64::from(i);
            assert!((finer.at(z) - curve.at(z)).abs() < 1e-12, "{z}");
        }
    }
}
