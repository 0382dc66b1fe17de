//! Everything the template is given.

use serde::Serialize;

use super::head::{Head, Table, capitalised, sections};
use super::plot::Group;
use super::provenance::Source;
use super::typeset_number::{exact, with_unit};
use super::{
    PageError, order_plots, pole_zero_map, recording_plots, residual_plots, response_plots,
};
use crate::covariance::invariants;
use crate::identify::{IdentifiedChannel, Model, channel_names};
use crate::report::overview::Overview;
use crate::report::text::{
    Style, doubtful, findings, fit_table, gain_table, linearity_tested, method, order_table,
    pole_table, test_tables, too_short, verdict,
};
use crate::validate::Validation;

/// Frequencies of a response.
const FREQUENCIES: usize = 120;
/// Rows of a table.
const ROWS: usize = 24;

/// The page as the template sees it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct View {
    #[serde(flatten)]
    head: Head,
    kind: &'static str,
    headline: String,
    about: String,
    remarks: Vec<String>,
    fit: Option<Table>,
    no_free_run: Option<String>,
    evidence: Vec<Group>,
    orders: Option<Table>,
    how: Vec<String>,
    frequency: Vec<Group>,
    map: Option<Group>,
    poles: Option<Table>,
    gains: Option<Table>,
    steps: Vec<Group>,
    tests: Option<Table>,
    strongest: Option<Table>,
    residuals: Vec<Group>,
    recordings: Vec<Group>,
    sources: Vec<Source>,
    facts: Vec<(&'static str, String)>,
}

/// The page of a model.
pub(super) fn view(
    model: &Model,
    tests: Option<&Validation>,
    overview: Option<&Overview>,
) -> Result<View, PageError> {
    let described = invariants(
        &model.system,
        model.covariance.as_ref(),
        &channel_names(&model.outputs),
        &channel_names(&model.inputs),
        &model.system.default_frequencies(FREQUENCIES)?,
        model.summary.as_ref().map_or(0, |s| s.options.seed),
    )?;
    let summary = model.summary.as_ref();
    let sentence = verdict(model, tests);
    let (about, headline) = match sentence.split_once(": ") {
        Some((about, judgement)) => (format!("{about}."), judgement),
        None => (String::new(), sentence.as_str()),
    };
    let doubt = summary.is_some_and(|s| doubtful(s, tests));
    let short = too_short(model, tests).is_some();
    let (kind, class) = match (doubt, short, tests.is_some()) {
        (true, ..) => ("Doubtful", "is-doubtful"),
        (false, true, _) => ("Too short", "is-untested"),
        (false, false, true) => ("Accepted", "is-accepted"),
        (false, false, false) => ("Not tested", "is-untested"),
    };
    let remarks = summary.iter().flat_map(|s| s.warnings.clone());
    let remarks = remarks.chain(tests.iter().flat_map(|t| findings(t)));
    // A sentence that begins with the name of a channel keeps it as it is.
    let channels = || model.inputs.iter().chain(&model.outputs);
    let begins_with_name = |text: &str| channels().any(|c| text.starts_with(&c.channel.name));
    let as_sentence = |text: String| {
        let text = match begins_with_name(&text) {
            true => text,
            false => capitalised(&text),
        };
        format!("{}.", text.trim_end_matches('.'))
    };
    let style = Style::UNICODE;
    let channels_of =
        |of: &[IdentifiedChannel]| of.iter().map(|c| c.channel.clone()).collect::<Vec<_>>();
    let gains = gain_table(
        &described.static_gain,
        ROWS,
        &channels_of(&model.inputs),
        &channels_of(&model.outputs),
        style,
    );
    let tables = tests.map(test_tables);
    let evidence = summary.map(order_plots::pictures).unwrap_or_default();
    let recordings = overview
        .map(|o| recording_plots::pictures(o, model))
        .unwrap_or_default();
    let poles_known = pole_table(&described.poles, ROWS, style);
    Ok(View {
        head: Head {
            title: format!("{}: {headline}", model.recordings.first().map_or("Model", |r| r.name.as_str())),
            class,
            command: "identify",
            names: model.recordings.iter().map(|r| r.name.clone()).collect(),
            sections: sections(&[
                ("order", "Order", summary.is_some()),
                ("frequency", "Frequency", true),
                ("poles", "Poles", true),
                ("step", "Step", true),
                ("residuals", "Residuals", tests.is_some()),
                ("recordings", "Recording", !recordings.is_empty()),
                ("provenance", "Provenance", true),
            ]),
            version: env!("CARGO_PKG_VERSION").to_owned(),
        },
        kind,
        headline: capitalised(headline),
        about,
        remarks: remarks.map(as_sentence).collect(),
        fit: tests.and_then(|t| Table::of(&fit_table(t), "")),
        no_free_run: tests.and_then(|t| t.free_run_unavailable.clone()),
        evidence,
        orders: summary
            .and_then(|s| Table::of(&order_table(s), "Orders around the one chosen (bold); small p speaks against an order, small criteria for it"))
            .map(Table::with_stars_marked),
        how: summary
            .map(|s| {
                let tested = tests.and_then(linearity_tested).map(str::to_owned);
                let how = s.explanation.iter().cloned().chain([format!("method: {}", method(s))]);
                let how = how.chain(tested);
                how.map(|h| format!("{}.", capitalised(&h).trim_end_matches('.'))).collect()
            })
            .unwrap_or_default(),
        frequency: response_plots::frequency(&described),
        map: pole_zero_map::map(&described, model),
        poles: Table::of(&poles_known, "Poles, ± one standard deviation"),
        gains: Table::of(&gains, "Static gains, ± one standard deviation"),
        steps: response_plots::steps(&described, model),
        tests: tables.as_ref().and_then(|t| {
            Table::of(&t.0, "Tests of the residuals: can they be foreseen? A small p says yes; the share says how much of their variance (* for information)")
        }),
        strongest: tables.as_ref().and_then(|t| Table::of(&t.1, "Strongest correlations")),
        residuals: tests.map(residual_plots::pictures).unwrap_or_default(),
        recordings,
        sources: Source::all(&model.recordings),
        facts: vec![
            ("Inputs", listed(&model.inputs)),
            ("Outputs", listed(&model.outputs)),
            ("Sample time", with_unit(&exact(model.system.sample_time), "s")),
            ("Written by", format!("innovant {}", env!("CARGO_PKG_VERSION"))),
        ],
    })
}

fn listed(of: &[IdentifiedChannel]) -> String {
    let names: Vec<String> = of
        .iter()
        .map(|c| {
            let mut text = match &c.channel.unit {
                Some(unit) => format!("{} [{unit}]", c.channel.name),
                None => c.channel.name.clone(),
            };
            if c.delay > 0 {
                text.push_str(&format!(" (known delay: {} samples)", c.delay));
            }
            text
        })
        .collect();
    names.join(", ")
}
