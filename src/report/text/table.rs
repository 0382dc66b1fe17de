//! Columns that line up.

/// Space between two columns.
const GAP: usize = 3;

/// A table with a header line; cells are set flush right, those of the first column flush left.
#[derive(Debug, Default)]
pub(crate) struct Table {
    rows: Vec<Vec<String>>,
    left: Vec<usize>,
}

impl Table {
    /// A table with these column headings.
    pub(crate) fn new<const N: usize>(header: [&str; N]) -> Self {
        Self {
            rows: vec![header.iter().map(ToString::to_string).collect()],
            left: vec![0],
        }
    }

    /// Sets a further column, counted from 0, flush left.
    pub(crate) fn flush_left(mut self, column: usize) -> Self {
        self.left.push(column);
        self
    }

    /// Appends a row.
    pub(crate) fn row<const N: usize>(&mut self, cells: [String; N]) {
        self.rows.push(cells.into());
    }

    /// Whether there are no rows below the header.
    pub(crate) fn is_empty(&self) -> bool {
        self.rows.len() < 2
    }

    /// The lines, indented by two spaces. A column in which no row has anything is left out.
    pub(crate) fn lines(&self) -> String {
        let columns = self.rows.first().map_or(0, Vec::len);
        let cell = |row: &Vec<String>, c: usize| row.get(c).cloned().unwrap_or_default();
        let mut widths = Vec::new();
        for c in 0..columns {
            let filled = self
                .rows
                .iter()
                .skip(1)
                .any(|row| !matches!(cell(row, c).as_str(), "" | "-"));
            let width = self.rows.iter().map(|row| cell(row, c).chars().count());
            widths.push(filled.then_some(width.max().unwrap_or(0)));
        }
        let mut out = String::new();
        for row in &self.rows {
            let mut line = String::from(" ");
            let mut gap = 1;
            for (c, width) in widths.iter().enumerate() {
                let Some(width) = width else { continue };
                let text = cell(row, c);
                let pad = " ".repeat(width - text.chars().count());
                line.push_str(&" ".repeat(gap));
                gap = GAP;
                if self.left.contains(&c) {
                    line.push_str(&text);
                    line.push_str(&pad);
                } else {
                    line.push_str(&pad);
                    line.push_str(&text);
                }
            }
            out.push_str(line.trim_end());
            out.push('\n');
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_line_up_and_empty_ones_disappear() {
        let mut table = Table::new(["name", "none", "value"]);
        assert!(table.is_empty());
        table.row(["a".into(), "-".into(), "1 ± 0.5".into()]);
        table.row(["long".into(), String::new(), "22".into()]);
        assert_eq!(
            table.lines(),
            "  name     value\n  a      1 ± 0.5\n  long        22\n"
        );
    }
}
