//! Everything the template is given.

use serde::Serialize;

use super::head::{Column, Head, Row, Table, capitalised, sections};
use super::plant_plots;
use super::plot::Group;
use super::provenance::Source;
use super::typeset_number::{exact, fixed, with_unit};
use crate::physics::Plant;
use crate::physics::estimate::{Evaluation, PlantRecording};
use crate::report::text::{
    Style, initial_state_table, leaves_something_out, parameter_table, percent, plant_verdict,
    residual_test_table,
};
use crate::report::{PlantDocument, text};

/// Correlations from this size on mean that hardly more than a combination of the two is known.
const STRONG: f64 = 0.95;
/// Parameters whose correlations fit on a page.
const MOST_CORRELATED: usize = 12;

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
    parameters: Option<Table>,
    undetermined: Vec<String>,
    correlations: Option<Table>,
    initial_states: Option<Table>,
    recordings: Vec<Group>,
    tests: Option<Table>,
    residuals: Vec<Group>,
    equations: String,
    sources: Vec<Source>,
    facts: Vec<(&'static str, String)>,
}

/// The page of a plant.
pub(super) fn view(
    plant: &Plant,
    document: &PlantDocument,
    records: &[PlantRecording],
    found: &Evaluation,
) -> View {
    let spec = &plant.spec;
    let samples: usize = records
        .iter()
        .map(|r| r.outputs.first().map_or(0, Vec::len))
        .sum();
    let sentence = plant_verdict(document, &format!("{} from {samples} samples", spec.name));
    let (about, answer) = sentence.split_once(": ").unwrap_or(("", &sentence));
    let (headline, rest) = answer.split_once("; ").unwrap_or((answer, ""));
    let (kind, class) = match (
        leaves_something_out(document),
        document.undetermined.is_empty(),
    ) {
        (true, _) => ("Doubtful", "is-doubtful"),
        (false, false) => ("Not determined", "is-doubtful"),
        (false, true) => ("Accepted", "is-accepted"),
    };
    let style = Style::UNICODE;
    let mut remarks: Vec<String> = document
        .parameters
        .iter()
        .filter(|p| p.at_bound)
        .map(|p| {
            format!(
                "{} is at its bound: the bound may be wrong, or the equations leave something out.",
                p.name
            )
        })
        .collect();
    if found.simulated.is_none() {
        remarks.push(
            "There is no free run: from the inputs alone the plant cannot be simulated to the end."
                .to_owned(),
        );
    }
    let point = found
        .points
        .first()
        .cloned()
        .unwrap_or_else(|| plant.nominal());
    View {
        head: Head {
            title: format!("{}: {headline}", spec.name),
            class,
            command: "identify",
            names: document.recordings.iter().map(|r| r.name.clone()).collect(),
            sections: sections(&[
                ("parameters", "Parameters", true),
                ("recordings", "Recording", true),
                ("residuals", "Residuals", true),
                ("equations", "Equations", true),
                ("provenance", "Provenance", true),
            ]),
            version: env!("CARGO_PKG_VERSION").to_owned(),
        },
        kind,
        headline: capitalised(headline),
        about: [about.to_owned(), capitalised(rest)]
            .iter()
            .filter(|said| !said.is_empty())
            .map(|said| format!("{said}."))
            .collect::<Vec<_>>()
            .join(" "),
        remarks,
        fit: fit(document),
        parameters: Table::of(
            &parameter_table(document, style),
            "Estimate ± one standard deviation; 95 % interval from the profile of the likelihood",
        ),
        undetermined: document
            .undetermined
            .iter()
            .map(|m| capitalised(m))
            .collect(),
        correlations: correlations(document),
        initial_states: document.initial_states.first().and_then(|s| {
            let caption = match document.initial_states.len() {
                1 => "Initial states",
                _ => "Initial states of the first recording",
            };
            Table::of(&initial_state_table(s, style), caption)
        }),
        recordings: plant_plots::recordings(plant, document, records, found),
        tests: Table::of(
            &residual_test_table(&document.residual_tests),
            "Tests of the whitened residuals: a small p says no",
        ),
        residuals: plant_plots::residuals(plant, document, records, found),
        equations: plant.text_at(&point),
        sources: Source::all(&document.recordings),
        facts: vec![
            (
                "Plant",
                match spec.description.is_empty() {
                    true => spec.name.clone(),
                    false => format!("{}: {}", spec.name, spec.description),
                },
            ),
            ("Form", document.form.clone()),
            (
                "Inputs between samples",
                match document.hold.as_str() {
                    "linear" => "on straight lines",
                    _ => "held",
                }
                .to_owned(),
            ),
            (
                "Sample time",
                document
                    .sample_time
                    .map_or(String::new(), |t| with_unit(&exact(t), "s")),
            ),
            ("Written by", format!("innovant {}", document.version)),
        ],
    }
}

/// Fits in free run, narrow enough for the first screen.
fn fit(document: &PlantDocument) -> Option<Table> {
    let mut table = text::Table::new(["output", "estimated", "text", "linear model"]);
    for f in &document.fit {
        let share = |value: Option<f64>| value.map_or(String::new(), percent);
        table.row([
            f.output.clone(),
            percent(f.free_run_percent),
            share(f.text_percent),
            share(f.linear_model_percent),
        ]);
    }
    Table::of(&table, "")
}

/// Correlations of the estimates; rows with a strong one are marked.
fn correlations(document: &PlantDocument) -> Option<Table> {
    let covariance = &document.covariance.as_ref()?.0;
    let count = document.parameters.len();
    if !(2..=MOST_CORRELATED).contains(&count) || covariance.shape() != (count, count) {
        return None;
    }
    let column = |name: &str| Column {
        name: name.to_owned(),
        words: false,
    };
    let names = || document.parameters.iter().map(|p| p.name.as_str());
    let correlation =
        |i: usize, j: usize| covariance[(i, j)] / (covariance[(i, i)] * covariance[(j, j)]).sqrt();
    let row = |(i, name): (usize, &str)| {
        let cells = (0..count).map(|j| match i.cmp(&j) {
            std::cmp::Ordering::Greater => fixed(correlation(i, j), 3),
            std::cmp::Ordering::Equal => "1".to_owned(),
            std::cmp::Ordering::Less => String::new(),
        });
        Row {
            cells: [name.to_owned()].into_iter().chain(cells).collect(),
            marked: (0..i).any(|j| correlation(i, j).abs() > STRONG),
        }
    };
    Some(Table {
        caption: "Correlations of the estimates; near 1 or −1 (bold) hardly more than a combination of the two is known"
            .to_owned(),
        columns: [column("")].into_iter().chain(names().map(column)).collect(),
        rows: names().enumerate().map(row).collect(),
        class: "",
    })
}
