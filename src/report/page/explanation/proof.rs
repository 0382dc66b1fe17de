//! The proof: how much of the error each step removes, on samples that were fitted and on blocks that never were.

use serde::Serialize;

use super::explanation_words::capitalised;
use super::plot::interval;
use super::signals::augmented_name;
use super::typeset_number::{fixed, number, share, with_unit};
use crate::explain::{Explanation, FitFigure, FitSteps, Verdict};

/// Everything about the fit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Proof {
    output: String,
    unit: String,
    rows: Vec<Row>,
    has_heldout: bool,
    blocks: Vec<String>,
    intervals: Vec<Interval>,
    sizes: Vec<(&'static str, String)>,
    /// The steps as bars, for the first screen.
    ladder: Vec<Rung>,
    ladder_of: &'static str,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct Row {
    name: String,
    class: &'static str,
    train: [String; 2],
    heldout: Option<[String; 2]>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct Rung {
    name: String,
    class: &'static str,
    rmse: String,
    fit: String,
    width: String,
}

/// The bootstrap interval of the decrease of the error, as a picture: per cent along a line that has a zero on it.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Interval {
    of: &'static str,
    text: String,
    clear: bool,
    from: String,
    width: String,
    zero: String,
}

/// The proof as the template shows it.
pub(super) fn proof(of: &Explanation) -> Proof {
    let fit = &of.fit;
    let unit = unit(of);
    let steps = steps(of);
    let figures = |f: FitFigure| [number(f.rmse, 3), fixed(f.fit_percent, 1)];
    let rows = steps.iter().map(|(name, class, pick)| Row {
        name: name.clone(),
        class,
        train: figures(pick(&fit.train)),
        heldout: fit.heldout.as_ref().map(|h| figures(pick(h))),
    });
    let (shown, ladder_of) = match &fit.heldout {
        Some(heldout) => (heldout, "on blocks that were never fitted"),
        None => (&fit.train, "on the samples that were fitted"),
    };
    let largest = steps.iter().map(|s| s.2(shown).rmse).fold(0.0, f64::max);
    let ladder = steps.iter().map(|(name, class, pick)| {
        let figure = pick(shown);
        Rung {
            name: name.clone(),
            class,
            rmse: with_unit(&number(figure.rmse, 3), &unit),
            fit: format!("{} %", fixed(figure.fit_percent, 1)),
            width: format!("{:.2}", (100.0 * figure.rmse / largest).clamp(0.5, 100.0)),
        }
    });
    let sets = [
        ("fitted samples", Some(&fit.train)),
        ("held-out blocks", fit.heldout.as_ref()),
    ];
    let bounds: Vec<(&'static str, [f64; 2])> = sets
        .into_iter()
        .filter_map(|(samples, set)| {
            let set = set?;
            // Without a step from one to the other there is nothing to be sure of.
            let step = set.augmented != set.parameters_only;
            set.improvement_95
                .filter(|_| step && goes_beyond_parameters(of.verdict))
                .map(|bounds| (samples, bounds))
        })
        .collect();
    Proof {
        output: fit.output.clone(),
        has_heldout: fit.heldout.is_some(),
        blocks: fit
            .heldout_blocks
            .iter()
            .map(|[a, b]| interval(*a, *b, "s"))
            .collect(),
        intervals: intervals(&bounds, &unit),
        sizes: sizes(of, &unit),
        rows: rows.collect(),
        ladder: ladder.collect(),
        ladder_of,
        unit,
    }
}

/// Unit of the output that the figures are of.
fn unit(of: &Explanation) -> String {
    let traced = of.signals.iter().find(|s| s.output == of.fit.output);
    let modelled = of
        .model
        .iter()
        .flat_map(|m| &m.outputs)
        .find(|c| c.name == of.fit.output);
    traced
        .map(|s| s.unit.clone())
        .or_else(|| modelled.and_then(|c| c.unit.clone()))
        .unwrap_or_default()
}

type Pick = fn(&FitSteps) -> FitFigure;

/// Name, class and figures of every step that has something of its own to say.
fn steps(of: &Explanation) -> Vec<(String, &'static str, Pick)> {
    let simulation: Pick = |s| s.simulation;
    let parameters: Pick = |s| s.parameters_only;
    let augmented: Pick = |s| s.augmented;
    let floor: Pick = |s| s.noise_floor;
    let last = capitalised(augmented_name(of.verdict));
    let mut steps = vec![("Simulation as given".to_owned(), "simulation", simulation)];
    let train = &of.fit.train;
    let adds = train.augmented != train.parameters_only
        || of
            .fit
            .heldout
            .as_ref()
            .is_some_and(|h| h.augmented != h.parameters_only);
    match of.verdict {
        Verdict::Consistent => {}
        Verdict::Parameters => steps.push((last, "augmented", augmented)),
        Verdict::Named | Verdict::Family | Verdict::Unexplained => {
            steps.push(("Other parameters only".to_owned(), "parameters", parameters));
            if adds || !of.effects.is_empty() {
                steps.push((last, "augmented", augmented));
            }
        }
    }
    steps.push(("Noise alone".to_owned(), "floor", floor));
    steps
}

fn intervals(bounds: &[(&'static str, [f64; 2])], unit: &str) -> Vec<Interval> {
    let ends = || bounds.iter().flat_map(|b| b.1).filter(|v| v.is_finite());
    let low = ends().fold(0.0, f64::min);
    let high = ends().fold(0.0, f64::max);
    let room = 0.08 * (high - low).max(f64::MIN_POSITIVE);
    let place = |v: f64| 100.0 * (v - low + room) / (high - low + 2.0 * room);
    bounds
        .iter()
        .filter(|(_, [from, to])| from.is_finite() && to.is_finite())
        .map(|&(of, [from, to])| Interval {
            of,
            text: format!("{} to {}", number(from, 3), with_unit(&number(to, 3), unit)),
            clear: from > 0.0 || to < 0.0,
            from: format!("{:.2}", place(from)),
            width: format!("{:.2}", place(to) - place(from)),
            zero: format!("{:.2}", place(0.0)),
        })
        .collect()
}

/// Whether something was found that other parameters cannot do; gains are counted from these.
fn goes_beyond_parameters(verdict: Verdict) -> bool {
    !matches!(verdict, Verdict::Consistent | Verdict::Parameters)
}

fn sizes(of: &Explanation, unit: &str) -> Vec<(&'static str, String)> {
    let size = &of.effect_size;
    let mut sizes = vec![(
        "of the output’s variance is explained by the linear model",
        share(size.linear_share),
    )];
    if !goes_beyond_parameters(of.verdict) {
        return sizes;
    }
    if size.removed_share > 0.0 {
        sizes.push((
            "of the variance that it leaves is removed by what was found",
            share(size.removed_share),
        ));
    }
    if of.fit.heldout.is_some() && size.heldout_gain != 0.0 {
        sizes.push((
            "smaller error (root mean square) on blocks that were never fitted",
            with_unit(&number(size.heldout_gain, 3), unit),
        ));
    }
    sizes
}
