//! A file looked at as a whole: whatever a logger writes becomes columns of numbers and stamps.

use super::layout::{self, Layout};
use crate::log::LogError;
use crate::log::roles::{Assigned, RoleNeed, Roles, assign};
use crate::log::text::{Mark, Marks, RowParser, decode, fields, is_missing};
use crate::log::time::{Stamps, counted, stamps};

/// Rows that are looked at to tell how numbers are written.
const LOOKED_AT: usize = 20_000;

/// A file as a table of numbers.
#[derive(Debug)]
pub(crate) struct Whole<'a> {
    pub(crate) layout: Layout,
    pub(crate) assigned: Assigned,
    /// A column a channel, inputs then outputs; NaN where a value is missing.
    pub(crate) columns: Vec<Vec<f64>>,
    pub(crate) stamps: Option<Stamps>,
    /// Text and number of the line of each row.
    pub(crate) rows: Vec<&'a str>,
    pub(crate) lines: Vec<u64>,
    pub(crate) said: Vec<String>,
}

/// Encodings are undone first: rows borrow from the text.
pub(crate) fn text<'a>(
    name: &str,
    bytes: &'a [u8],
) -> Result<(std::borrow::Cow<'a, str>, Option<&'static str>), LogError> {
    decode(name, bytes)
}

impl<'a> Whole<'a> {
    /// Finds the columns of `text` and reads those with a role. `None` when no rows are alike.
    pub(crate) fn read(
        name: &str,
        text: &'a str,
        roles: &Roles,
        need: RoleNeed,
    ) -> Result<Option<Self>, LogError> {
        let all = layout::lines(text);
        let Some(layout) = layout::find(name, &all, roles) else {
            return Ok(None);
        };
        let header = &layout.header;
        let assigned = assign(roles, need, header)?;
        let mut said = Vec::new();
        let (rows, lines) = rows_of(&all, &layout, &assigned, &mut said)?;
        if rows.is_empty() {
            return Err(LogError::NoData {
                name: name.to_owned(),
                line: header.line,
            });
        }
        let wanted: Vec<usize> = assigned
            .inputs
            .iter()
            .chain(&assigned.outputs)
            .chain(&assigned.time)
            .copied()
            .collect();
        let marks = marks(&rows, header.separator, &wanted);
        if marks.contains(&Mark::Comma) {
            said.push("decimal commas".to_owned());
        }
        let channels = assigned.inputs.len() + assigned.outputs.len();
        let parser = RowParser::new(
            header.clone(),
            vec![None; header.channels.len()],
            assigned.time,
        );
        let mut columns = vec![Vec::with_capacity(rows.len()); channels];
        let mut cells: Vec<&str> = Vec::new();
        let mut times: Vec<&str> = Vec::new();
        for (row, line) in rows.iter().zip(&lines) {
            fields(row, header.separator, &mut cells);
            for ((column, index), mark) in columns.iter_mut().zip(&wanted).zip(&marks) {
                let cell = cells.get(*index).copied().unwrap_or_default();
                column.push(match mark.number(cell) {
                    Some(value) => value,
                    None if is_missing(cell) => f64::NAN,
                    None => return Err(parser.bad_cell(cell.as_bytes(), *line, *index)),
                });
            }
            if let Some(index) = assigned.time {
                times.push(cells.get(index).copied().unwrap_or_default());
            }
        }
        let stamps = match assigned.time {
            Some(index) => {
                let mark = marks.get(channels).copied().unwrap_or_default();
                let bad = |row: usize| {
                    let cell = times.get(row).copied().unwrap_or_default();
                    parser.bad_cell(cell.as_bytes(), lines.get(row).copied().unwrap_or(0), index)
                };
                match stamps::read(header, index, &times, mark, roles, &bad) {
                    Ok(stamps) => Some(stamps),
                    // A column that is no time does not matter when the sample time is given.
                    Err(_) if roles.sample_time.is_some() => None,
                    Err(error) => return Err(error),
                }
            }
            None => None,
        };
        Ok(Some(Self {
            layout,
            assigned,
            columns,
            stamps,
            rows,
            lines,
            said,
        }))
    }
}

type Rows<'a> = (Vec<&'a str>, Vec<u64>);

/// The lines that are rows of data.
fn rows_of<'a>(
    all: &[&'a str],
    layout: &Layout,
    assigned: &Assigned,
    said: &mut Vec<String>,
) -> Result<Rows<'a>, LogError> {
    let header = &layout.header;
    let expected = header.raw.len();
    let title = (!header.headerless)
        .then(|| all.get(header.line as usize - 1))
        .flatten();
    let (mut rows, mut lines) = (Vec::new(), Vec::new());
    let (mut blank, mut again) = (0, 0);
    let mut waiting = 0;
    let mut cells: Vec<&str> = Vec::new();
    for (index, line) in all.iter().enumerate().skip(layout.data) {
        if line.trim().is_empty() {
            waiting += 1;
            continue;
        }
        if Some(line) == title {
            again += 1;
            continue;
        }
        fields(line, header.separator, &mut cells);
        let extra = cells.get(expected..).unwrap_or_default();
        if cells.len() < expected || extra.iter().any(|cell| !cell.is_empty()) {
            let says = |cells: &[&str]| {
                let wanted = assigned.inputs.iter().chain(&assigned.outputs);
                let number = |at: &usize| {
                    cells
                        .get(*at)
                        .is_some_and(|cell| crate::log::text::is_number(cell))
                };
                wanted.clone().any(number)
            };
            // Remarks at the end of a file have no numbers where the channels are.
            let mut rest = all.iter().skip(index);
            if !rest.any(|line| says(&layout::cut(line, header.separator))) {
                said.push(format!(
                    "{} of text below the data",
                    counted(all.len() - index, "line")
                ));
                break;
            }
            let parser = RowParser::new(header.clone(), vec![None; expected], assigned.time);
            return Err(parser.ragged(line, index as u64 + 1, index + 1 == all.len()));
        }
        blank += std::mem::take(&mut waiting);
        rows.push(*line);
        lines.push(index as u64 + 1);
    }
    if blank > 0 {
        // Without a time column a blank line may stand for anything.
        if assigned.time.is_none() {
            let line = lines
                .windows(2)
                .find(|w| w[1] > w[0] + 1)
                .map_or(0, |w| w[0] + 1);
            return Err(LogError::BlankLine {
                name: header.name.clone(),
                line,
            });
        }
        said.push(format!(
            "{} between rows skipped",
            counted(blank, "blank line")
        ));
    }
    if again > 0 {
        said.push(format!(
            "the header {} again",
            if again == 1 {
                "once".to_owned()
            } else {
                format!("{again} times")
            }
        ));
    }
    Ok((rows, lines))
}

/// How each of the wanted columns writes numbers.
fn marks(rows: &[&str], separator: u8, wanted: &[usize]) -> Vec<Mark> {
    let mut counts = vec![Marks::default(); wanted.len()];
    let stride = (rows.len() / LOOKED_AT).max(1);
    let mut cells: Vec<&str> = Vec::new();
    for row in rows.iter().step_by(stride).filter(|row| row.contains(',')) {
        fields(row, separator, &mut cells);
        for (count, index) in counts.iter_mut().zip(wanted) {
            count.count(cells.get(*index).copied().unwrap_or_default());
        }
    }
    counts.into_iter().map(Marks::mark).collect()
}
