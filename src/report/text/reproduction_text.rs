//! A reproduction for the terminal: the comparison with the paper as a table.

use std::fmt::Write as _;

use super::wrapped;
use crate::reproduce::Reproduction;

/// Widths of the columns: where, paper, here, agreement; with three spaces between them a hundred.
const WIDTHS: [usize; 4] = [20, 22, 35, 14];
const GAP: &str = "   ";

/// The comparison, a row a statement of the paper.
pub(crate) fn reproduction_text(reproduction: &Reproduction) -> String {
    let mut text = String::new();
    let heading = format!("{}: {}", reproduction.experiment, reproduction.title);
    text.push_str(&wrapped("", &heading));
    let _ = writeln!(
        text,
        "{} runs (the paper: {}), seed {}\n",
        reproduction.runs, reproduction.paper_runs, reproduction.seed
    );
    text.push_str(&row(["where", "paper says", "we get", "agree?"]));
    let rules = WIDTHS.map(|width| "-".repeat(width));
    text.push_str(&row(rules.each_ref().map(String::as_str)));
    for c in &reproduction.comparison {
        text.push_str(&row([&c.place, &c.paper, &c.here, c.agreement.words()]));
    }
    if !reproduction.remarks.is_empty() {
        text.push('\n');
    }
    for remark in &reproduction.remarks {
        text.push_str(&wrapped("  ", remark));
    }
    text
}

/// Cells side by side, each wrapped to its column.
fn row(cells: [&str; 4]) -> String {
    let mut columns = Vec::with_capacity(cells.len());
    for (cell, width) in cells.iter().zip(WIDTHS) {
        columns.push(lines(cell, width));
    }
    let height = columns.iter().map(Vec::len).max().unwrap_or(0);
    let mut text = String::new();
    for k in 0..height {
        let mut line = String::from(" ");
        for (column, width) in columns.iter().zip(WIDTHS) {
            let part = column.get(k).map_or("", String::as_str);
            let room = width.saturating_sub(part.chars().count());
            let _ = write!(line, "{part}{}{GAP}", " ".repeat(room));
        }
        text.push_str(line.trim_end());
        text.push('\n');
    }
    text
}

/// Words in lines of at most `width` columns; a longer word stands alone.
fn lines(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let last = lines.last_mut();
        match last {
            Some(line) if line.is_empty() => line.push_str(word),
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_wrapped_side_by_side() {
        let text = row(["one two three four five six", "b", "c", "yes"]);
        let expected = format!(" one two three four{}b", " ".repeat(5));
        assert!(text.starts_with(&expected), "{text}");
        assert_eq!(text.lines().count(), 2);
        assert_eq!(text.lines().nth(1), Some(" five six"));
        assert!(
            text.lines()
                .all(|line| line.chars().count() <= crate::report::text::WIDTH)
        );
    }
}
