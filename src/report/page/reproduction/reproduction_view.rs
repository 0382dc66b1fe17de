//! Everything the template of a reproduction is given.

use serde::Serialize;

use super::head::{Column, Head, Row, Table, sections};
use super::plot::Group;
use super::reproduction_plots::{bars, figure};
use super::typeset_number::{number, typeset};
use crate::reproduce::{self, Agreement, Comparison, Origin, Reproduction};

/// The page as the template sees it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct View {
    #[serde(flatten)]
    head: Head,
    paper: String,
    runs: String,
    again: String,
    counts: Vec<Count>,
    comparison: Vec<CompareRow>,
    figures: Vec<Group>,
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
    table: Table,
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

fn table(of: &reproduce::Table) -> NumberTable {
    let column = |name: String, words| Column { name, words };
    let numbers = of.columns.iter().map(|c| column(typeset(c), false));
    let row = |row: &reproduce::Row| {
        let numbers = row.values.iter();
        let numbers = numbers.map(|v| number(v.unwrap_or(f64::NAN), of.digits));
        Row {
            cells: std::iter::once(row.name.clone()).chain(numbers).collect(),
            marked: row.printed,
        }
    };
    let table = Table {
        columns: std::iter::once(column(of.rows_are.clone(), true))
            .chain(numbers)
            .collect(),
        rows: of.rows.iter().map(row).collect(),
        class: "wide printed",
        ..Table::default()
    };
    NumberTable {
        id: of.id.clone(),
        title: of.title.clone(),
        caption: of.caption.clone(),
        table,
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
    let figures: Vec<Group> = of
        .bars
        .iter()
        .map(bars)
        .chain(of.figures.iter().map(figure))
        .collect();
    View {
        head: Head {
            title: of.title.clone(),
            class: "reproduction",
            command: "reproduce",
            names: vec![of.experiment.clone()],
            sections: sections(&[
                ("comparison", "Comparison", true),
                ("figures", "Figures", !figures.is_empty()),
                ("tables", "Tables", !of.tables.is_empty()),
                ("setup", "Set-up", true),
                ("remarks", "Remarks", !of.remarks.is_empty()),
            ]),
            version: of.version.clone(),
        },
        paper: of.paper.clone(),
        runs: match of.runs == of.paper_runs {
            true => format!("{} Monte Carlo runs, as in the paper", of.runs),
            false => format!(
                "{} Monte Carlo runs; the paper has {}",
                of.runs, of.paper_runs
            ),
        },
        again: format!(
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
        figures,
        tables: of.tables.iter().map(table).collect(),
        paper_facts: facts(Origin::Paper),
        our_facts: facts(Origin::Ours),
        remarks: of.remarks.iter().map(|r| typeset(r)).collect(),
    }
}
