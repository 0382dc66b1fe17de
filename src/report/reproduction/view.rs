//! Everything the template of a reproduction is given.

use serde::Serialize;

use super::bars::{Chart, chart};
use super::pictures::group;
use crate::report::drawing::number::number;
use crate::report::drawing::plot::Group;
use crate::reproduce::{Agreement, Comparison, Origin, Reproduction, Table};

/// The page as the template sees it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct View {
    experiment: String,
    title: String,
    paper: String,
    version: String,
    runs: String,
    command: String,
    counts: Vec<Count>,
    comparison: Vec<CompareRow>,
    figures: Vec<Group>,
    charts: Vec<Chart>,
    tables: Vec<NumberTable>,
    paper_facts: Vec<[String; 2]>,
    our_facts: Vec<[String; 2]>,
    remarks: Vec<String>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct Count {
    class: &'static str,
    name: &'static str,
    count: usize,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct CompareRow {
    place: String,
    paper: String,
    here: String,
    why: String,
    class: &'static str,
    agreement: &'static str,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct NumberTable {
    id: String,
    title: String,
    caption: String,
    rows_are: String,
    columns: Vec<String>,
    rows: Vec<NumberRow>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct NumberRow {
    name: String,
    printed: bool,
    values: Vec<String>,
}

/// Symbols that plain text has to do without.
pub(super) fn typeset(text: &str) -> String {
    text.replace("+-", "±")
        .replace("sigma^2", "σ²")
        .replace("sigma2", "σ²")
}

/// The class of an agreement in the style sheet.
fn class(of: Agreement) -> &'static str {
    match of {
        Agreement::Yes => "yes",
        Agreement::Partly => "partly",
        Agreement::No => "no",
        Agreement::Misprint => "misprint",
    }
}

fn counts(of: &[Comparison]) -> Vec<Count> {
    let names = [
        (Agreement::Yes, "agree"),
        (Agreement::Partly, "agree in part"),
        (Agreement::No, "do not agree"),
        (Agreement::Misprint, "errors in print"),
    ];
    names
        .into_iter()
        .map(|(agreement, name)| Count {
            class: class(agreement),
            name,
            count: of.iter().filter(|c| c.agreement == agreement).count(),
        })
        .filter(|c| c.count > 0)
        .collect()
}

fn table(of: &Table) -> NumberTable {
    NumberTable {
        id: of.id.clone(),
        title: of.title.clone(),
        caption: of.caption.clone(),
        rows_are: of.rows_are.clone(),
        columns: of.columns.iter().map(|c| typeset(c)).collect(),
        rows: of
            .rows
            .iter()
            .map(|row| NumberRow {
                name: row.name.clone(),
                printed: row.printed,
                values: row
                    .values
                    .iter()
                    .map(|v| number(v.unwrap_or(f64::NAN), of.digits))
                    .collect(),
            })
            .collect(),
    }
}

/// The page of a reproduction.
pub(super) fn view(of: &Reproduction) -> View {
    let facts = |source: Origin| {
        of.setup
            .iter()
            .filter(|f| f.source == source)
            .map(|f| [f.name.clone(), typeset(&f.value)])
            .collect()
    };
    View {
        experiment: of.experiment.clone(),
        title: of.title.clone(),
        paper: of.paper.clone(),
        version: of.version.clone(),
        runs: match of.runs == of.paper_runs {
            true => format!("{} Monte Carlo runs, as in the paper", of.runs),
            false => format!(
                "{} Monte Carlo runs; the paper has {}",
                of.runs, of.paper_runs
            ),
        },
        command: format!(
            "innovant reproduce {} --runs {} --seed {}",
            of.experiment, of.runs, of.seed
        ),
        counts: counts(&of.comparison),
        comparison: of
            .comparison
            .iter()
            .map(|c| CompareRow {
                place: c.place.clone(),
                paper: typeset(&c.paper),
                here: typeset(&c.here),
                why: typeset(&c.why),
                class: class(c.agreement),
                agreement: c.agreement.words(),
            })
            .collect(),
        figures: of.figures.iter().filter_map(group).collect(),
        charts: of.bars.iter().map(chart).collect(),
        tables: of.tables.iter().map(table).collect(),
        paper_facts: facts(Origin::Paper),
        our_facts: facts(Origin::Ours),
        remarks: of.remarks.iter().map(|r| typeset(r)).collect(),
    }
}
