//! What a cell says: a number in one of the ways that programs write them, nothing, or text.

use super::decimal::finite;

/// Words for a value that is not there, also those that plant historians write in its place (system digital states). An infinity is
/// none of them: it is what a sensor beyond its range gives.
const MISSING: [&str; 38] = [
    "",
    "nan",
    "-nan",
    "+nan",
    "nan(ind)",
    "-nan(ind)",
    "na",
    "n/a",
    "#n/a",
    "#na",
    "#nv",
    "<na>",
    "null",
    "none",
    "nil",
    "missing",
    "no data",
    "nodata",
    "bad",
    "-",
    "--",
    "---",
    "?",
    "\\n",
    "#value!",
    "#div/0!",
    "bad input",
    "bad quality",
    "comm fail",
    "i/o timeout",
    "timeout",
    "not connect",
    "no result",
    "no sample",
    "scan off",
    "scan timeout",
    "shutdown",
    "pt created",
];
/// Characters of the longest of them.
const LONGEST: usize = 12;

/// Whether a cell says that there is no value.
pub(crate) fn is_missing(cell: &str) -> bool {
    // Short ones first: nearly all cells are numbers and end here.
    if cell.len() > LONGEST || cell.as_bytes().first().is_some_and(u8::is_ascii_digit) {
        return false;
    }
    let word = cell.to_ascii_lowercase();
    MISSING.contains(&word.as_str()) || word.trim_start_matches('-').starts_with("1.#")
}

/// How a column writes its numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Mark {
    /// `1234.5`, and `1,234.5` where the cell cannot be anything else.
    #[default]
    Point,
    /// `1234,5`, also `1.234,5`.
    Comma,
}

impl Mark {
    /// The number of a cell.
    pub(crate) fn number(self, cell: &str) -> Option<f64> {
        if let Some(value) = finite(cell.as_bytes()) {
            let thousands = self == Self::Comma && cell.contains('.') && grouped(cell, '.');
            if !thousands {
                return Some(value);
            }
        }
        let plain: String = cell
            .chars()
            .filter(|c| !matches!(c, '\u{a0}' | '\u{202f}' | ' ' | '\''))
            .collect();
        let text = if plain.len() == cell.len() {
            cell
        } else {
            plain.as_str()
        };
        if text.len() != cell.len() && !spaced(cell) {
            return None;
        }
        let (decimal, thousand) = match self {
            Self::Point => ('.', ','),
            Self::Comma => (',', '.'),
        };
        let (whole, fraction) = match text.split_once(decimal) {
            Some((whole, fraction)) => (whole, Some(fraction)),
            None => (text, None),
        };
        if whole.contains(thousand) && !grouped(whole, thousand) {
            return None;
        }
        let mut made: String = whole.chars().filter(|c| *c != thousand).collect();
        if let Some(fraction) = fraction {
            made.push('.');
            made.push_str(fraction);
        }
        finite(made.as_bytes())
    }
}

/// Whether all digits after the first separator are in groups of three: `1,234,567`.
fn grouped(text: &str, separator: char) -> bool {
    let text = text.trim_start_matches(['+', '-']);
    let mut groups = text.split(separator);
    let first = groups.next().unwrap_or_default();
    let digits = |group: &str| group.bytes().all(|b| b.is_ascii_digit());
    (1..=3).contains(&first.len())
        && first != "0"
        && digits(first)
        && groups.all(|group| group.len() == 3 && digits(group))
}

/// Whether spaces or apostrophes stand between groups of three digits only.
fn spaced(cell: &str) -> bool {
    let whole = cell.split(['.', ',']).next().unwrap_or_default();
    let same: String = whole
        .chars()
        .map(|c| {
            if matches!(c, '\u{a0}' | '\u{202f}' | ' ' | '\'') {
                ' '
            } else {
                c
            }
        })
        .collect();
    let rest = cell.get(whole.len()..).unwrap_or_default();
    grouped(&same, ' ') && !rest.contains(['\u{a0}', '\u{202f}', ' ', '\''])
}

/// Counts the ways in which the cells of a column write numbers.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Marks {
    commas: usize,
    points: usize,
    /// Both in one cell, the comma last or the point last.
    comma_last: usize,
    point_last: usize,
}

impl Marks {
    pub(crate) fn count(&mut self, cell: &str) {
        match (cell.rfind(','), cell.rfind('.')) {
            (None, None) => {}
            (None, Some(_)) => self.points += usize::from(Mark::Point.number(cell).is_some()),
            (Some(_), None) => self.commas += usize::from(Mark::Comma.number(cell).is_some()),
            (Some(comma), Some(point)) if comma > point => {
                self.comma_last += usize::from(Mark::Comma.number(cell).is_some());
            }
            _ => self.point_last += usize::from(Mark::Point.number(cell).is_some()),
        }
    }

    pub(crate) fn mark(self) -> Mark {
        let comma = match (self.comma_last, self.point_last) {
            (0, 0) => self.commas > self.points,
            (comma, point) => comma > point,
        };
        if comma { Mark::Comma } else { Mark::Point }
    }
}

/// Whether a cell is a number in any of the ways.
pub(crate) fn is_number(cell: &str) -> bool {
    finite(cell.as_bytes()).is_some()
        || Mark::Comma.number(cell).is_some()
        || Mark::Point.number(cell).is_some()
}

/// Cuts a line at `separator` (a space stands for any run of spaces), outside quotes; the fields come without their
/// quotes and the spaces around them.
pub(crate) fn fields<'a>(line: &'a str, separator: u8, into: &mut Vec<&'a str>) {
    into.clear();
    if separator == b' ' {
        into.extend(line.split_whitespace().map(unquoted));
        return;
    }
    let mut rest = line;
    loop {
        let trimmed = rest.trim_start_matches(|c| c == ' ' || (c == '\t' && separator != b'\t'));
        let quote = trimmed
            .as_bytes()
            .first()
            .copied()
            .filter(|b| matches!(b, b'"' | b'\''));
        let inside = quote.and_then(|quote| closing(trimmed, quote, separator));
        let (field, after) = match inside {
            Some(end) => (
                trimmed.get(1..end),
                trimmed.get(end + 1..).unwrap_or_default(),
            ),
            None => {
                let end = memchr::memchr(separator, rest.as_bytes()).unwrap_or(rest.len());
                (rest.get(..end), rest.get(end..).unwrap_or_default())
            }
        };
        into.push(field.unwrap_or_default().trim());
        match memchr::memchr(separator, after.as_bytes()).and_then(|at| after.get(at + 1..)) {
            Some(next) => rest = next,
            None => return,
        }
    }
}

fn unquoted(field: &str) -> &str {
    ['"', '\'']
        .iter()
        .find_map(|quote| field.strip_prefix(*quote)?.strip_suffix(*quote))
        .unwrap_or(field)
}

/// Where the quote that opens `text` closes: before a separator or the end. An apostrophe within a text closes nothing.
fn closing(text: &str, quote: u8, separator: u8) -> Option<usize> {
    let bytes = text.as_bytes();
    let mut at = 1;
    while let Some(found) = memchr::memchr(quote, bytes.get(at..)?) {
        let end = at + found;
        if bytes.get(end + 1) == Some(&quote) && quote == b'"' {
            at = end + 2;
            continue;
        }
        let after = text.get(end + 1..)?.trim_start_matches(' ');
        if after.is_empty() || after.as_bytes().first() == Some(&separator) {
            return Some(end);
        }
        at = end + 1;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_many_ways() {
        for (mark, cell, value) in [
            (Mark::Point, "1234.5", 1234.5),
            (Mark::Point, "1,234.5", 1234.5),
            (Mark::Point, "1 234.5", 1234.5),
            (Mark::Point, "1'234.5", 1234.5),
            (Mark::Comma, "1234,5", 1234.5),
            (Mark::Comma, "1.234,5", 1234.5),
            (Mark::Comma, "1.234", 1234.0),
            (Mark::Comma, "0.234", 0.234),
            (Mark::Comma, "1\u{a0}234,5", 1234.5),
            (Mark::Comma, "-8,5e-3", -8.5e-3),
            (Mark::Comma, ",5", 0.5),
        ] {
            assert_eq!(mark.number(cell), Some(value), "{cell}");
        }
        for cell in ["1,2,3", "1,23.4", "abc", "1 2", "12.", "--1"] {
            assert!(!is_number(cell) || cell == "12.", "{cell}");
        }
        assert_eq!(Mark::Point.number("1,5"), None);
    }

    #[test]
    fn missing_values_have_many_names() {
        for cell in [
            "",
            "NaN",
            "NA",
            "N/A",
            "#N/A",
            "null",
            "-",
            "-1.#IND",
            "#VALUE!",
            "I/O Timeout",
            "Pt Created",
        ] {
            assert!(is_missing(cell), "{cell}");
        }
        for cell in ["0", "-1", "inf", "MAN", "1e5", "abc"] {
            assert!(!is_missing(cell), "{cell}");
        }
    }

    #[test]
    fn quotes_of_both_kinds() {
        let of = |line: &'static str, separator| {
            let mut found = Vec::new();
            fields(line, separator, &mut found);
            found
        };
        assert_eq!(
            of("\"0,5\", 'a, b' ,\"c \"\"d\"\"\",", b','),
            ["0,5", "a, b", "c \"\"d\"\"", ""]
        );
        assert_eq!(of("'n pump,1", b','), ["'n pump", "1"]);
        assert_eq!(of("  0.1   \"2\" -3 ", b' '), ["0.1", "2", "-3"]);
        assert_eq!(of("1;;2;", b';'), ["1", "", "2", ""]);
    }
}
