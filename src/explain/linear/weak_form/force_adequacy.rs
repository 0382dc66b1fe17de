//! Is what an averaged equation leaves noise?

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::correlated_regression::Regression;
use super::equation_of_motion::Equation;
use super::windows::{Reading, Windows, quantile};
use crate::explain::linear::data::Data;
use crate::explain::linear::screening::output_adequacy::{Adequacy, SHARE};

/// Corners of the broken lines that are fitted to what is left, in each variable.
const CORNERS: usize = 9;

/// Structure that is left may be this share of the force (squared) that the equation's last step has explained: an
/// unnamed law of a third of its size. Friction of real drives is a textbook law to some ten percents (load
/// distribution, lubrication and direction all change it).
pub(crate) const IMPERFECTION: f64 = 0.1;

/// Whether the rest is noise, or little beside what was found.
pub(crate) fn holds(a: &Adequacy) -> bool {
    a.share < SHARE || a.holds()
}

/// Broken lines in rate, position, input and time, fitted beside the equation's own columns; `before` is the sum of
/// squares without what was found.
///
/// What is fitted is the acceleration: were it the input, a broken line in it would foretell it by itself.
pub(crate) fn adequacy(
    windows: &Windows,
    data: &Data,
    equation: &Equation,
    fit: &Regression,
    before: f64,
) -> Option<Adequacy> {
    let n = windows.places.len();
    let clock = |s: usize, k: usize| data.segments[s].start_time + k as f64 * data.sample_time;
    // Straight lines in rate and input, and in the position beside a spring, are in the equation.
    let mut families: Vec<Vec<Vec<f64>>> = vec![
        hats(windows, |s, k| windows.rate[s][k], true),
        hats(windows, |s, k| windows.input[s][k], true),
        hats(windows, clock, false),
    ];
    if windows.reading == Reading::Position {
        families.push(hats(
            windows,
            |s, k| windows.position[s][k],
            equation.spring,
        ));
    }
    let plain = equation.fit_motion(windows, data, &[])?;
    // One family after the other beside the equation: together they may be dependent (a triangle of the position
    // is one of time).
    let mut best: Option<(f64, usize)> = None;
    let mut features = 0;
    for family in &families {
        let count = family.len();
        features += count;
        let Some(wider) = equation.fit_motion(windows, data, family) else {
            continue;
        };
        let gained = (1.0 - wider.squares / plain.squares).max(0.0);
        if best.is_none_or(|b| gained > b.0) {
            best = Some((gained, count));
        }
    }
    let (gained, count) = best?;
    let independent = plain.effective();
    // Chance gains this much of each feature.
    let chance = count as f64 / independent.max(count as f64 + 1.0);
    let statistic = independent * gained / (1.0 - gained).max(1e-300);
    let p_value = ChiSquared::new(count as f64).map_or(1.0, |d| d.sf(statistic));
    let share = (gained - chance).max(0.0);
    (n > 2 * features).then(|| Adequacy {
        // The force is tested, not the motion.
        share_of_error: 0.0,
        tolerated: IMPERFECTION,
        features,
        // The best of several families was taken (Bonferroni).
        p_value: (p_value * families.len() as f64).min(1.0),
        share,
        of_removed: share * fit.squares / (before - fit.squares).max(1e-300),
    })
}

/// Triangles over the quantiles of a variable: all but the first, for a constant is in the equation, and without the last
/// where a straight line is in it too.
fn hats(
    windows: &Windows,
    of: impl Fn(usize, usize) -> f64,
    straight_line_known: bool,
) -> Vec<Vec<f64>> {
    let mut corners: Vec<f64> = Vec::new();
    for i in 0..CORNERS {
        let q = i as f64 / (CORNERS - 1) as f64;
        let at = quantile(windows.places.iter().map(|&(s, k)| of(s, k)), q);
        if corners.last().is_none_or(|last| at > *last) {
            corners.push(at);
        }
    }
    (1..corners.len() - usize::from(straight_line_known))
        .map(|i| {
            let (low, top) = (corners[i - 1], corners[i]);
            let high = corners.get(i + 1).copied();
            windows.average(|s, k| {
                let v = of(s, k);
                if v <= top {
                    ((v - low) / (top - low)).max(0.0)
                } else {
                    high.map_or(1.0, |high| ((high - v) / (high - top)).max(0.0))
                }
            })
        })
        .collect()
}
