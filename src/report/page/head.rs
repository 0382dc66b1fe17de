//! What every page has: a name, sections, and tables.

use serde::Serialize;

use crate::report::text;

/// What the frame of a page is given.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Head {
    /// Stands in the title of the window.
    pub(super) title: String,
    /// Class of the page in the style sheet.
    pub(super) class: &'static str,
    /// The subcommand that wrote it.
    pub(super) command: &'static str,
    /// What it is about: files, or the experiment.
    pub(super) names: Vec<String>,
    /// Id and name of each section.
    pub(super) sections: Vec<(&'static str, &'static str)>,
    /// Version of innovant.
    pub(super) version: String,
}

/// The sections that are there.
pub(super) fn sections(
    all: &[(&'static str, &'static str, bool)],
) -> Vec<(&'static str, &'static str)> {
    all.iter()
        .filter(|s| s.2)
        .map(|(id, name, _)| (*id, *name))
        .collect()
}

/// The first letter large.
pub(super) fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    match letters.next() {
        Some(first) => first.to_uppercase().chain(letters).collect(),
        None => String::new(),
    }
}

/// A table as the template writes it: the first cell of a row is its name.
#[derive(Debug, Clone, PartialEq, Serialize, Default)]
pub(super) struct Table {
    pub(super) caption: String,
    pub(super) columns: Vec<Column>,
    pub(super) rows: Vec<Row>,
    pub(super) class: &'static str,
}

/// A heading, and whether words stand below it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Column {
    pub(super) name: String,
    pub(super) words: bool,
}

/// A row.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Row {
    pub(super) cells: Vec<String>,
    pub(super) marked: bool,
}

impl Table {
    /// A table as a terminal shows it; `None` without rows.
    pub(super) fn of(table: &text::Table, caption: &str) -> Option<Self> {
        if table.is_empty() {
            return None;
        }
        let columns = table.columns();
        let rows = columns.first().map_or(0, |(cells, _)| cells.len());
        let row = |k: usize| Row {
            cells: columns
                .iter()
                .map(|(cells, _)| cells[k].to_owned())
                .collect(),
            marked: false,
        };
        Some(Self {
            caption: caption.to_owned(),
            columns: columns
                .iter()
                .map(|(cells, words)| Column {
                    name: cells[0].to_owned(),
                    words: *words,
                })
                .collect(),
            rows: (1..rows).map(row).collect(),
            class: "",
        })
    }
    /// The same with rows marked whose names end with a star.
    pub(super) fn with_stars_marked(mut self) -> Self {
        for row in &mut self.rows {
            let name = row.cells.first_mut();
            let bare = name
                .as_ref()
                .and_then(|name| name.strip_suffix(" *"))
                .map(str::to_owned);
            if let (Some(name), Some(bare)) = (name, bare) {
                *name = bare;
                row.marked = true;
            }
        }
        self
    }
}
