//! Where the columns of a text are: separator, header, units, first row of data.
//!
//! Rows of data are alike and most of the file, so they are looked at first: the separator is the one that cuts them into
//! the same number of fields with the most numbers among them. The header is looked for above them.

use crate::log::Roles;
use crate::log::roles::is_usual_time;
use crate::log::text::{Channel, Header, fields, is_missing, is_number};
use crate::log::time::Format;

/// Rows that are looked at to tell how rows are made.
const LOOKED_AT: usize = 200;
/// Share of the rows that must have the same number of fields.
const ALIKE: f64 = 0.6;
/// Rows between the header and the data: units, descriptions, types.
const MOST_HEADER_ROWS: usize = 4;
/// Longest text that a row of units has in a cell.
const LONGEST_UNIT: usize = 12;
/// Lines above the header that are looked through.
const LONGEST_PREAMBLE: usize = 400;

/// How a text is laid out.
#[derive(Debug)]
pub(crate) struct Layout {
    /// Names, units and the separator.
    pub(crate) header: Header,
    /// Index of the first line of data.
    pub(crate) data: usize,
    /// What is to be said.
    pub(crate) said: Vec<String>,
}

/// The lines of a text with their numbers, ended by LF, CRLF or CR.
pub(crate) fn lines(text: &str) -> Vec<&str> {
    let end = if text.contains('\n') { '\n' } else { '\r' };
    let mut lines: Vec<&str> = text
        .split(end)
        .map(|line| line.strip_suffix('\r').unwrap_or(line))
        .collect();
    if lines
        .last()
        .is_some_and(|line| line.trim().is_empty() || *line == "\u{1a}")
    {
        lines.pop();
    }
    lines
}

/// Finds the columns; `None` when no rows are alike.
pub(crate) fn find(name: &str, lines: &[&str], roles: &Roles) -> Option<Layout> {
    let mut said = Vec::new();
    // Excel's own remark on the separator.
    let excel = lines
        .first()
        .and_then(|line| line.trim_matches('"').trim().strip_prefix("sep="));
    let from = usize::from(excel.is_some());
    let sample = sample(lines, from);
    let (separator, count) = separator(&sample, excel)?;
    if !matches!(separator, b',') {
        said.push(format!("columns separated by {}", words(separator)));
    }
    let rows: Vec<Vec<&str>> = sample
        .iter()
        .map(|line| cut(line, separator))
        .filter(|row| row.len() == count)
        .collect();
    let numeric: Vec<bool> = (0..count)
        .map(|column| {
            let cells = || rows.iter().filter_map(|row| row.get(column));
            let present = cells().filter(|cell| !is_missing(cell)).count();
            let numbers = cells().filter(|cell| is_value(cell)).count();
            // Half of them where the one row of a file stands below its header.
            numbers > 0 && numbers * 2 >= present
        })
        .collect();
    let is_data = |line: &str| {
        let row = cut(line, separator);
        let wanted = numeric.iter().filter(|n| **n).count();
        let (mut good, mut values) = (0, 0);
        for (cell, _) in row.iter().zip(&numeric).filter(|(_, numeric)| **numeric) {
            let value = is_value(cell);
            values += usize::from(value);
            good += usize::from(value || is_missing(cell));
        }
        row.len().abs_diff(count) <= 1 && values > 0 && good * 10 >= wanted * 6
    };
    let data = (from..lines.len().min(LONGEST_PREAMBLE + from)).find(|index| {
        let at = |index: usize| lines.get(index).copied().unwrap_or_default();
        let next = lines
            .iter()
            .skip(index + 1)
            .find(|line| !line.trim().is_empty());
        is_data(at(*index)) && next.is_none_or(|next| is_data(next))
    })?;
    let (at, units) = header_row(lines, from, data, separator, count, roles);
    let bare = |line: &str| {
        line.trim_start()
            .trim_start_matches(['#', '%'])
            .trim_start()
            .to_owned()
    };
    let header_line = at.and_then(|at| lines.get(at)).map(|line| bare(line));
    let mut raw: Vec<String> = match &header_line {
        Some(line) => cut(line, separator)
            .iter()
            .map(|f| f.replace("\"\"", "\""))
            .collect(),
        None => (1..=count).map(|column| column.to_string()).collect(),
    };
    // A separator at the end of each line makes a column of nothing.
    while raw.len() > 1
        && raw.last().is_some_and(String::is_empty)
        && !numeric.get(raw.len() - 1).copied().unwrap_or(false)
    {
        raw.pop();
    }
    let mut channels: Vec<Channel> = match at {
        Some(_) => raw.iter().map(|field| Channel::parse(field)).collect(),
        None => raw.iter().map(Channel::new).collect(),
    };
    // A table that was written with its index, which has no name: `df.to_csv(...)`; or one whose dates have another name.
    let timeless = roles.time.is_none() && !channels.iter().any(|c| is_usual_time(&c.name));
    if let Some(first) = channels.first_mut()
        && at.is_some()
    {
        let cells = || rows.iter().filter_map(|row| row.first()).copied();
        if is_unnamed(&first.name) && holds_times(cells()) {
            said.push("column 1 has no name and is taken as the time".to_owned());
            first.name = "time".to_owned();
        } else if timeless && Format::of(cells()).is_some() {
            said.push(format!(
                "column `{}` holds dates and is taken as the time",
                first.name
            ));
            first.name = "time".to_owned();
        }
    }
    if let Some(row) = units.and_then(|at| lines.get(at)) {
        let row = bare(row);
        for (channel, unit) in channels.iter_mut().zip(cut(&row, separator)) {
            let unit = unit.trim_matches(['[', ']', '(', ')', ' ']);
            if channel.unit.is_none() && !unit.is_empty() && !matches!(unit, "-" | "--" | "1") {
                channel.unit = Some(unit.to_owned());
            }
        }
        said.push(format!("units in line {}", units.map_or(0, |at| at + 1)));
    }
    let above = lines.get(from..at.unwrap_or(data)).unwrap_or_default();
    let above = above
        .iter()
        .filter(|line| !line.trim().is_empty() && !line.starts_with('#'))
        .count();
    if above > 0 {
        said.push(format!(
            "{above} {} of text above the header",
            if above == 1 { "line" } else { "lines" }
        ));
    }
    if at.is_none() {
        said.push("no header: columns go by number".to_owned());
    }
    let header = Header {
        name: name.to_owned(),
        channels,
        raw,
        separator,
        headerless: at.is_none(),
        line: at.unwrap_or(data) as u64 + 1,
    };
    Some(Layout { header, data, said })
}

/// A line cut into its fields.
pub(crate) fn cut(line: &str, separator: u8) -> Vec<&str> {
    let mut row = Vec::new();
    fields(line, separator, &mut row);
    row
}

/// The name of a column without one: none, or pandas' for it.
fn is_unnamed(name: &str) -> bool {
    name.is_empty() || name == "Unnamed: 0"
}

/// Whether cells are dates, or numbers that only grow and are not a count of rows.
fn holds_times<'a>(cells: impl Iterator<Item = &'a str> + Clone) -> bool {
    if Format::of(cells.clone()).is_some() {
        return true;
    }
    let numbers: Option<Vec<f64>> = cells.map(|cell| cell.trim().parse().ok()).collect();
    numbers.is_some_and(|t| {
        t.windows(2).all(|pair| pair[0] < pair[1]) && t.iter().any(|t| t.fract() != 0.0)
    })
}

fn is_value(cell: &str) -> bool {
    is_number(cell) || Format::of(std::iter::once(cell)).is_some()
}

/// Lines spread over the last two thirds, where no header is.
fn sample<'a>(lines: &[&'a str], from: usize) -> Vec<&'a str> {
    let lines: Vec<&str> = lines
        .iter()
        .skip(from)
        .copied()
        .filter(|line| !line.trim().is_empty())
        .collect();
    let tail = lines.get(lines.len() / 3..).unwrap_or_default();
    let stride = (tail.len() / LOOKED_AT).max(1);
    tail.iter().copied().step_by(stride).collect()
}

/// The separator of the rows, and how many fields most of them have.
fn separator(sample: &[&str], excel: Option<&str>) -> Option<(u8, usize)> {
    let named = excel
        .and_then(|text| text.bytes().next())
        .filter(u8::is_ascii);
    let candidates: &[u8] = match &named {
        Some(b) => std::slice::from_ref(b),
        None => b";\t,| ",
    };
    let mut best: Option<(f64, u8, usize)> = None;
    for &candidate in candidates {
        let rows: Vec<Vec<&str>> = sample.iter().map(|line| cut(line, candidate)).collect();
        let mut counts: Vec<usize> = rows.iter().map(Vec::len).collect();
        counts.sort_unstable();
        let Some(count) = mode(&counts).filter(|count| *count > 1) else {
            continue;
        };
        let alike: Vec<&Vec<&str>> = rows.iter().filter(|row| row.len() == count).collect();
        let share = alike.len() as f64 / rows.len() as f64;
        let cells = || {
            alike
                .iter()
                .flat_map(|row| row.iter())
                .filter(|cell| !cell.is_empty())
        };
        let values = cells()
            .filter(|cell| is_value(cell) || is_missing(cell))
            .count() as f64;
        let score = share * values / cells().count().max(1) as f64;
        if share >= ALIKE && best.is_none_or(|(most, _, _)| score > most) {
            best = Some((score, candidate, count));
        }
    }
    best.filter(|(score, _, _)| *score > 0.0)
        .map(|(_, separator, count)| (separator, count))
}

/// The most frequent of sorted numbers.
fn mode(sorted: &[usize]) -> Option<usize> {
    sorted
        .chunk_by(|a, b| a == b)
        .max_by_key(|run| run.len())
        .and_then(|run| run.first().copied())
}

/// The lines of the header and of the units, if there are any.
fn header_row(
    lines: &[&str],
    from: usize,
    data: usize,
    separator: u8,
    count: usize,
    roles: &Roles,
) -> (Option<usize>, Option<usize>) {
    let bare = |index: usize| {
        let line = lines.get(index).copied().unwrap_or_default();
        line.trim_start()
            .trim_start_matches(['#', '%'])
            .trim_start()
    };
    let fits = |index: &usize| {
        let row = cut(bare(*index), separator);
        row.len().abs_diff(count) <= 1 && row.iter().any(|cell| !cell.is_empty())
    };
    // Comments may stand between the header and the data.
    let comment = |index: &usize| {
        let line = lines.get(*index).map_or("", |line| line.trim_start());
        line.starts_with(['#', '%']) && !fits(index)
    };
    let above: Vec<usize> = (from..data)
        .rev()
        .filter(|index| !bare(*index).trim().is_empty() && !comment(index))
        .take(MOST_HEADER_ROWS)
        .take_while(fits)
        .collect();
    let asked: Vec<Channel> = [&roles.inputs, &roles.outputs]
        .into_iter()
        .flatten()
        .flatten()
        .chain(&roles.time)
        .map(|name| Channel::parse(name))
        .collect();
    let found = |index: usize| {
        let row: Vec<Channel> = cut(bare(index), separator)
            .iter()
            .map(|cell| Channel::parse(cell))
            .collect();
        asked
            .iter()
            .filter(|asked| row.iter().any(|channel| channel.answers_to(asked, true)))
            .count()
    };
    let by_name = above
        .iter()
        .copied()
        .max_by_key(|index| found(*index))
        .filter(|index| found(*index) > 0);
    let units_like = |index: usize| {
        let row = cut(bare(index), separator);
        let short = |cell: &&str| cell.chars().count() <= LONGEST_UNIT;
        row.iter().all(short) && row.iter().any(|cell| is_unit_cell(cell))
    };
    let last = above.first().copied();
    let header = by_name.or_else(|| match (last, above.get(1)) {
        (Some(last), Some(before)) if units_like(last) => Some(*before),
        (last, _) => last,
    });
    let units = header.and_then(|header| {
        above
            .iter()
            .copied()
            .filter(|index| *index > header)
            .find(|index| units_like(*index))
    });
    (header, units)
}

/// Whether a cell of a row of units is one beyond doubt.
fn is_unit_cell(cell: &str) -> bool {
    let inner = cell.trim_matches(['[', ']', '(', ')', ' ']);
    !inner.is_empty() && (crate::log::text::is_unit(inner) || inner.len() + 2 == cell.len())
}

fn words(separator: u8) -> &'static str {
    match separator {
        b';' => "semicolons",
        b'\t' => "tabs",
        b'|' => "vertical bars",
        b' ' => "spaces",
        b',' => "commas",
        _ => "the sign that the first line names",
    }
}
