//! The recordings, and where the inputs have their power.

use super::plot::{Axis, Drawing, Group, Plot, Series, interval};
use super::typeset_number::number;
use crate::identify::Model;
use crate::log::Channel;
use crate::report::overview::{Excitation, Experiment, Overview};

/// Recordings that are shown before the rest is folded away.
const SHOWN: usize = 2;
/// Inputs whose band stands in words.
const IN_WORDS: usize = 4;
/// Power densities below the largest by more than this are not worth the room, in decibels.
const DEEPEST: f64 = 100.0;
const STYLES: [&str; 4] = ["first", "second", "third", "fourth"];

/// Every channel over time, and the spectra of the inputs.
pub(super) fn pictures(of: &Overview, model: &Model) -> Vec<Group> {
    let many = of.experiments.len() > 1;
    let mut groups = Vec::new();
    for (k, experiment) in of.experiments.iter().enumerate() {
        let title = |what: &str| match many {
            true => format!("{what}: {}", experiment.name),
            false => what.to_owned(),
        };
        let group = |id: &str, what: &str, plots, linked| Group {
            id: format!("{id}-{k}"),
            title: title(what),
            caption: String::new(),
            plots,
            folded: k >= SHOWN,
            linked,
            beside: false,
        };
        groups.push(group(
            "recording",
            "Over time",
            channels(experiment, model),
            true,
        ));
        if let Some(plot) = spectra(experiment, model) {
            groups.push(group(
                "excitation",
                "What excites the plant",
                vec![plot],
                false,
            ));
        }
    }
    groups
}

fn channels(of: &Experiment, model: &Model) -> Vec<Plot> {
    let inputs = model
        .inputs
        .iter()
        .zip(&of.inputs)
        .map(|(c, line)| (c, line, "input"));
    let outputs = model
        .outputs
        .iter()
        .zip(&of.outputs)
        .map(|(c, line)| (c, line, "output"));
    inputs
        .chain(outputs)
        .map(|(channel, line, role)| over_time(&channel.channel, line, role, of))
        .collect()
}

fn over_time(channel: &Channel, line: &[(f64, f64)], role: &'static str, of: &Experiment) -> Plot {
    let samples = of.samples;
    let low = line.iter().fold(f64::INFINITY, |m, p| m.min(p.1));
    let high = line.iter().fold(f64::NEG_INFINITY, |m, p| m.max(p.1));
    let unit = channel.unit.as_deref().unwrap_or_default();
    let thinned = match samples > line.len() {
        true => format!(
            ", drawn as smallest and largest of every {} samples",
            2 * samples / line.len().max(1)
        ),
        false => String::new(),
    };
    Plot {
        title: format!("{} ({role})", channel.name),
        caption: format!(
            "Between {}{thinned}.",
            interval(low, high, unit).replace(" – ", " and ")
        ),
        height: "low",
        drawing: Drawing {
            x: Axis::new("time", "s")
                .spanning(line.iter().map(|p| p.0))
                .since(of.origin.as_deref()),
            y: Axis::new(&channel.name, unit).over([low, high]),
            series: vec![Series::line(&channel.name, role, line.iter().copied())],
            ..Drawing::default()
        },
    }
}

fn spectra(of: &Experiment, model: &Model) -> Option<Plot> {
    let found: Vec<(&str, &Excitation)> = model
        .inputs
        .iter()
        .zip(&of.excitation)
        .filter_map(|(channel, excitation)| {
            Some((channel.channel.name.as_str(), excitation.as_ref()?))
        })
        .collect();
    let decibels = |density: f64| 10.0 * density.log10();
    let densities = found.iter().flat_map(|f| &f.1.density);
    let highest = densities.clone().fold(0.0, |m: f64, d| m.max(*d));
    let lowest = decibels(highest) - DEEPEST;
    let line = |e: &Excitation| {
        let density = e.density.iter().map(|d| decibels(*d).max(lowest));
        e.hz.iter().copied().zip(density).collect::<Vec<_>>()
    };
    let words: Vec<String> = found
        .iter()
        .take(IN_WORDS)
        .map(|(name, e)| {
            let [from, to] = e.band.map(|f| number(f, 2));
            format!("{name} between {from} and {to} Hz")
        })
        .collect();
    let series = found
        .iter()
        .enumerate()
        .map(|(k, (name, e))| Series::line(*name, STYLES[k % STYLES.len()], line(e)))
        .collect();
    let hz = found.iter().flat_map(|f| &f.1.hz).copied();
    (!found.is_empty()).then(|| Plot {
        title: "Power density of the inputs".to_owned(),
        caption: format!(
            "The model is known where there is power: nine tenths of it are in {}.",
            words.join("; in ")
        ),
        height: "ordinary",
        drawing: Drawing {
            x: Axis::new("frequency", "Hz").logarithmic(true).spanning(hz),
            y: Axis::new("share of the variance per Hz", "dB")
                .over(densities.map(|d| decibels(*d).max(lowest))),
            series,
            ..Drawing::default()
        },
    })
}
