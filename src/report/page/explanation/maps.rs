//! The pictures over frequency and over the variable of the learned law.

use super::explanation_words::{capitalised, effect_name, listed};
use super::plot::{Axis, Drawing, Group, Kind, Plot, Series, Shade, interval};
use super::signals::answers_differ;
use super::typeset_number::fixed;
use crate::explain::{Curve, Explanation, SignalTraces, Verdict};

/// Bands that carry their excess as a label: the strongest.
const LABELLED: usize = 3;
/// Frequencies that span more than this factor stand on a logarithmic axis.
const WIDE: f64 = 20.0;

/// Spectra of what is left, one for each output and recording that has one.
pub(super) fn frequency_maps(of: &Explanation) -> Vec<Group> {
    let many = of.signals.len() > 1;
    let mut groups: Vec<Group> = of
        .signals
        .iter()
        .filter_map(|s| frequency_map(of, s, many))
        .collect();
    for (k, group) in groups.iter_mut().enumerate() {
        group.id = format!("spectrum-{k}");
    }
    groups
}

fn frequency_map(of: &Explanation, s: &SignalTraces, many: bool) -> Option<Group> {
    let lines: Vec<[f64; 3]> = s.spectrum.iter().copied().filter(|l| l[0] > 0.0).collect();
    let column = |k: usize| lines.iter().map(move |l| l[k]);
    let over = [
        column(0).fold(f64::INFINITY, f64::min),
        column(0).fold(0.0, f64::max),
    ];
    if over[0] > over[1] {
        return None;
    }
    let consistent = of.verdict == Verdict::Consistent;
    let before: Vec<f64> = column(1).collect();
    let after: Vec<f64> = column(2).collect();
    let two = !consistent && answers_differ(&before, &after);
    let shown = if two { 2 } else { 1 };
    let points = |k: usize| lines.iter().map(move |l| (l[0], l[k]));
    let name = if two { "before" } else { "residual" };
    let mut series = vec![Series::line(name, "simulation", points(1))];
    if two {
        series.push(Series::line("after", "augmented", points(2)));
    }
    let mut strongest: Vec<f64> = of.location.frequency.iter().map(|band| band[2]).collect();
    strongest.sort_by(|a, b| b.total_cmp(a));
    let least = strongest
        .get(LABELLED - 1)
        .copied()
        .unwrap_or(f64::NEG_INFINITY);
    let bands: Vec<Shade> = of
        .location
        .frequency
        .iter()
        .filter_map(|[from, to, excess]| {
            let size = format!("{} dB", fixed(*excess, 0));
            let title = format!("{size} over noise, {}", interval(*from, *to, "Hz"));
            let label = match *excess >= least {
                true => format!("+{size}"),
                false => String::new(),
            };
            Shade::new(over, [*from, *to], label, title)
        })
        .collect();
    let caption = match bands.is_empty() {
        true if two => "The lower the second line lies, the more of the difference is explained.",
        true => "A line without peaks is what noise leaves.",
        false => {
            "Shaded: bands in which the difference stands out of the noise; the strongest carry their excess."
        }
    };
    let title = match many {
        true => format!("Over frequency: {}", s.output),
        false => "Over frequency".to_owned(),
    };
    Some(Group {
        id: String::new(),
        title,
        caption: String::new(),
        plots: vec![Plot {
            title: "Spectrum of the residual".to_owned(),
            caption: caption.to_owned(),
            height: "middle",
            drawing: Drawing {
                x: Axis::new("frequency", "Hz")
                    .logarithmic(over[1] > WIDE * over[0])
                    .spanning(over),
                y: Axis::new("power", "dB").over((1..=shown).flat_map(column)),
                series,
                shades: bands,
                ..Drawing::default()
            },
        }],
        folded: false,
        linked: false,
        beside: false,
    })
}

/// What each effect adds to its equation, over the variable that it depends on.
pub(super) fn laws(of: &Explanation) -> Vec<Group> {
    let all = of.effects.iter().filter_map(|e| Some((e, e.law.as_ref()?)));
    let drawn = all.enumerate().map(|(k, (effect, law))| {
        let points = || law.at.iter().copied().zip(law.value.iter().copied());
        let around = points().zip(&law.std).map(|((at, value), std)| {
            let std = if std.is_finite() { *std } else { 0.0 };
            (at, value - 2.0 * std, value + 2.0 * std)
        });
        let y = Axis::new("added", "").over(around.clone().flat_map(|(_, a, b)| [a, b]));
        let place = effect.enters.as_ref().unwrap_or(&effect.signal);
        Group {
            id: format!("law-{k}"),
            title: format!("{} against {}", capitalised(&effect_name(&effect.effect)), law.variable),
            caption: String::new(),
            plots: vec![Plot {
                title: format!("Added to the equation of {place}"),
                caption: "Over the values that the recording covers, with two standard deviations, given the form."
                    .to_owned(),
                height: "middle",
                drawing: Drawing {
                    x: Axis::new(&law.variable, "").over(law.at.iter().copied()),
                    y,
                    series: vec![
                        Series::line("added", "augmented", points())
                            .within("± 2 deviations", around),
                    ],
                    ..Drawing::default()
                },
            }],
            folded: false,
            linked: false,
            beside: false,
        }
    });
    drawn.collect()
}

/// The law as the recording shows it, and the fitted one over it.
pub(super) fn learned_curve(of: &Explanation) -> Option<Group> {
    let curve = of.curve.as_ref()?;
    let points = points(curve);
    if points.is_empty() {
        return None;
    }
    let fitted = fitted(curve);
    let heights = points
        .iter()
        .flat_map(|p| [p.1 - 2.0 * p.2, p.1 + 2.0 * p.2]);
    let y = Axis::new(&curve.force, "").over(heights.chain(fitted.iter().map(|p| p.1)));
    let dots = points.iter().map(|p| (p.0, p.1));
    let around = points
        .iter()
        .map(|p| (p.0, p.1 - 2.0 * p.2, p.1 + 2.0 * p.2));
    let mut series = vec![
        Series::marks("learned", "learned", Kind::Dots, dots).within("± 2 deviations", around),
    ];
    let title = match fitted.is_empty() {
        true => "Learned from the recording",
        false => "Learned, and the fitted law over it",
    };
    if !fitted.is_empty() {
        series.push(Series::line("fitted law", "augmented", fitted));
    }
    let like: Vec<String> = curve
        .resembles
        .iter()
        .take(3)
        .map(|(name, r)| format!("{} ({})", effect_name(name), fixed(*r, 2)))
        .collect();
    let mut caption = "Dots: the law as the recording shows it, no form assumed.".to_owned();
    if !like.is_empty() {
        caption.push_str(&format!(" It resembles {} (correlation).", listed(&like)));
    }
    Some(Group {
        id: "curve".to_owned(),
        title: "The missing law".to_owned(),
        caption: String::new(),
        plots: vec![Plot {
            title: title.to_owned(),
            caption,
            height: "middle",
            drawing: Drawing {
                x: Axis::new(&curve.variable, "").over(points.iter().map(|p| p.0)),
                y,
                series,
                ..Drawing::default()
            },
        }],
        folded: false,
        linked: false,
        beside: false,
    })
}

/// Place, value and deviation, from left to right.
fn points(curve: &Curve) -> Vec<(f64, f64, f64)> {
    let deviations = curve.std.iter().copied().chain(std::iter::repeat(0.0));
    let mut points: Vec<(f64, f64, f64)> = curve
        .at
        .iter()
        .zip(&curve.value)
        .zip(deviations)
        .map(|((at, value), std)| (*at, *value, if std.is_finite() { std } else { 0.0 }))
        .filter(|p| p.0.is_finite() && p.1.is_finite())
        .collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    points
}

fn fitted(curve: &Curve) -> Vec<(f64, f64)> {
    let places = curve.at.iter().copied();
    let mut points: Vec<(f64, f64)> = places.zip(curve.fitted.iter().copied()).collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    points
}
