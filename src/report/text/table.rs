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

    /// The columns in which some row has something: the header, then a cell for each row, and whether it is set flush
    /// left.
    pub(crate) fn columns(&self) -> Vec<(Vec<&str>, bool)> {
        let count = self.rows.first().map_or(0, Vec::len);
        (0..count)
            .map(|c| {
                let cells = self.rows.iter();
                let cells = cells.map(|row| row.get(c).map_or("", String::as_str));
                (cells.collect(), self.left.contains(&c))
            })
            .filter(|(cells, _): &(Vec<&str>, bool)| {
                cells.iter().skip(1).any(|cell| !matches!(*cell, "" | "-"))
            })
            .collect()
    }

    /// The lines, indented by two spaces. A column in which no row has anything is left out.
    pub(crate) fn lines(&self) -> String {
        let columns = self.columns();
        let width = |cells: &[&str]| cells.iter().map(|c| c.chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = columns.iter().map(|(cells, _)| width(cells)).collect();
        let mut out = String::new();
        for index in 0..self.rows.len() {
            let mut line = String::from(" ");
            let mut gap = 1;
            for ((cells, left), width) in columns.iter().zip(&widths) {
                let text = cells[index];
                let pad = " ".repeat(width - text.chars().count());
                line.push_str(&" ".repeat(gap));
                gap = GAP;
                if *left {
                    line.push_str(text);
                    line.push_str(&pad);
                } else {
                    line.push_str(&pad);
                    line.push_str(text);
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
