//! All numbers of a reproduction as one long table, a number a row.

use crate::reproduce::{Curve, Reproduction};

/// CSV with the columns `kind, part, panel, series, line, x, value, lower, upper`.
///
/// `kind` is `figure`, `bars` or `table`; `part` the id of the figure, chart or table; `panel` the panel, the group
/// of bars or the row; `series` the curve, the kind of bar or the column; `line` counts the lines of a bundle from 1;
/// `lower` and `upper` are the limits of a band. Cells without a number are empty.
///
/// # Errors
/// [`csv::Error`], which writing to memory does not bring about.
pub(crate) fn reproduction_csv(reproduction: &Reproduction) -> Result<String, csv::Error> {
    let mut rows = Rows(csv::Writer::from_writer(Vec::new()));
    rows.0.write_record([
        "kind", "part", "panel", "series", "line", "x", "value", "lower", "upper",
    ])?;
    for figure in &reproduction.figures {
        for panel in &figure.panels {
            for curve in &panel.curves {
                rows.curve([&figure.id, &panel.title], curve, &figure.at)?;
            }
        }
    }
    for bars in &reproduction.bars {
        for series in &bars.series {
            for (group, value) in bars.groups.iter().zip(&series.values) {
                rows.number(["bars", &bars.id, group, &series.name], *value)?;
            }
        }
    }
    for table in &reproduction.tables {
        for row in &table.rows {
            for (column, value) in table.columns.iter().zip(&row.values) {
                rows.number(["table", &table.id, &row.name, column], *value)?;
            }
        }
    }
    let bytes = rows
        .0
        .into_inner()
        .map_err(|error| csv::Error::from(error.into_error()))?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

struct Rows(csv::Writer<Vec<u8>>);

impl Rows {
    fn curve(
        &mut self,
        [part, panel]: [&str; 2],
        curve: &Curve,
        at: &[f64],
    ) -> Result<(), csv::Error> {
        for (index, line) in curve.lines.iter().enumerate() {
            for (k, (x, value)) in at.iter().zip(line).enumerate() {
                let limit = |side: usize| {
                    let band = curve.band.as_ref().filter(|_| index == 0)?;
                    band[side].get(k).copied().flatten()
                };
                let numbers = [Some(*x), *value, limit(0), limit(1)].map(text);
                let counted = (index + 1).to_string();
                let names = ["figure", part, panel, &curve.name, &counted];
                self.0
                    .write_record(names.into_iter().chain(numbers.iter().map(String::as_str)))?;
            }
        }
        Ok(())
    }

    fn number(&mut self, names: [&str; 4], value: Option<f64>) -> Result<(), csv::Error> {
        let value = text(value);
        self.0
            .write_record(names.into_iter().chain(["", "", &value, "", ""]))
    }
}

/// The shortest form that is read back exactly.
fn text(value: Option<f64>) -> String {
    value.map_or_else(String::new, |v| format!("{v:e}"))
}
