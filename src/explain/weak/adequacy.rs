//! Is what an averaged equation leaves noise?

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::super::adequacy::{Adequacy, SHARE};
use super::super::data::Data;
use super::model::Equation;
use super::regression::Regression;
use super::windows::{Reading, Windows, quantile};

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
pub(crate) fn adequacy(
    windows: &Windows,
    data: &Data,
    equation: &Equation,
    fit: &Regression,
    before: f64,
) -> Option<Adequacy> {
    let n = windows.places.len();
    let clock = |s: usize, k: usize| data.segments[s].start_time + k as f64 * data.sample_time;
    let mut families: Vec<Vec<Vec<f64>>> = vec![
        hats(windows, |s, k| windows.rate[s][k]),
        hats(windows, |s, k| windows.input[s][k]),
        hats(windows, clock),
    ];
    if windows.reading == Reading::Position {
        families.push(hats(windows, |s, k| windows.position[s][k]));
    }
    // One family after the other beside the equation: together they may be dependent (a triangle of the position
    // is one of time).
    let mut best: Option<(f64, usize)> = None;
    let mut features = 0;
    for family in &families {
        let count = family.len();
        features += count;
        let Some(wider) = equation.fit_with(windows, data, family) else {
            continue;
        };
        let gained = (fit.squares - wider.squares).max(0.0);
        if best.is_none_or(|b| gained > b.0) {
            best = Some((gained, count));
        }
    }
    let (gained, count) = best?;
    let independent = fit.effective();
    // Chance gains this much of each feature.
    let chance = count as f64 * fit.squares / independent.max(count as f64 + 1.0);
    let statistic = independent * gained / (fit.squares - gained).max(1e-300);
    let p_value = ChiSquared::new(count as f64).map_or(1.0, |d| d.sf(statistic));
    let share = ((gained - chance) / fit.squares).max(0.0);
    (n > 2 * features).then(|| Adequacy {
        tolerated: IMPERFECTION,
        features,
        // The best of several families was taken (Bonferroni).
        p_value: (p_value * families.len() as f64).min(1.0),
        share,
        of_removed: share * fit.squares / (before - fit.squares).max(1e-300),
    })
}

/// Triangles over the quantiles of a variable, all but the first: a constant is in the equation.
fn hats(windows: &Windows, of: impl Fn(usize, usize) -> f64) -> Vec<Vec<f64>> {
    let mut corners: Vec<f64> = Vec::new();
    for i in 0..CORNERS {
        let q = i as f64 / (CORNERS - 1) as f64;
        let at = quantile(windows.places.iter().map(|&(s, k)| of(s, k)), q);
        if corners.last().is_none_or(|last| at > *last) {
            corners.push(at);
        }
    }
    (1..corners.len())
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
