//! Correlations of what the model leaves, with the bounds that a right model keeps.

use super::grid;
use super::plot::{Axis, Drawing, Group, Kind, Plot, Series};
use super::typeset_number::number;
use crate::validate::{PairCorrelation, Validation};

/// A right model exceeds a bound at this share of the lags.
const BEYOND_BY_CHANCE: f64 = 0.01;

/// Auto- and cross-correlations.
pub(super) fn pictures(of: &Validation) -> Vec<Group> {
    let own = |pair: &PairCorrelation| match pair.from == pair.to {
        true => format!("{} with its own past", pair.to),
        false => format!("{} with the past of {}", pair.to, pair.from),
    };
    let input = |pair: &PairCorrelation| format!("{} with past {}", pair.to, pair.from);
    let drawn = |pairs: &[PairCorrelation], title: &dyn Fn(&PairCorrelation) -> String| {
        pairs
            .iter()
            .filter(|pair| !pair.lags.is_empty())
            .map(|pair| picture(pair, title(pair)))
            .collect()
    };
    let mut groups = grid(
        "whiteness",
        "Residuals and their past",
        drawn(&of.autocorrelation, &own),
    );
    groups.extend(grid(
        "past-inputs",
        "Residuals and past inputs",
        drawn(&of.cross_correlation, &input),
    ));
    groups
}

fn picture(of: &PairCorrelation, title: String) -> Plot {
    let points = || of.lags.iter().zip(of.values.iter().zip(&of.bounds_99));
    let side = |beyond: bool| {
        points()
            .filter(move |(_, (value, bound))| (value.abs() > **bound) == beyond)
            .map(|(lag, (value, _))| (*lag as f64, *value))
            .collect::<Vec<_>>()
    };
    let beyond = side(true);
    let expected = BEYOND_BY_CHANCE * of.lags.len() as f64;
    let caption = format!(
        "{} of {} beyond the bound; a right model has {} on average.",
        match beyond.len() {
            0 => "None".to_owned(),
            some => some.to_string(),
        },
        of.lags.len(),
        number(expected, 2)
    );
    let limits = points().map(|(lag, (_, bound))| (*lag as f64, -bound, *bound));
    let mut series = vec![
        Series::marks("within", "bar-1", Kind::Bars, side(false)).within("99 % bound", limits),
    ];
    if !beyond.is_empty() {
        series.push(Series::marks("beyond", "bar-3", Kind::Bars, beyond));
    }
    let largest = points().fold(0.0, |m: f64, (_, (v, b))| m.max(v.abs()).max(*b));
    let lags = of.lags.iter().map(|lag| *lag as f64);
    Plot {
        title,
        caption,
        height: "low",
        drawing: Drawing {
            x: Axis::new("lag", "samples").whole().over(lags),
            y: Axis::new("correlation", "").over([-largest, largest]),
            series,
            ..Drawing::default()
        },
    }
}
