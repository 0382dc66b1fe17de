//! Rows with time stamps, before they are placed on a grid.

use super::sampling::readable;
use crate::log::LogError;

/// Share of rows whose stamp may be in conflict with the others.
pub(super) const CONFLICTS: f64 = 0.01;

/// What is known of the rows.
pub(crate) struct Rows<'a> {
    pub(crate) name: &'a str,
    /// Header of the time column.
    pub(crate) column: &'a str,
    /// Stamps in seconds since the first, NaN where there is none.
    pub(crate) stamps: &'a [f64],
    /// Line of each row.
    pub(crate) lines: &'a [u64],
    /// Rounding of a stamp in seconds, as far as its number has any.
    pub(crate) rounding: f64,
    /// Whether a row says the same as the one before it in every column.
    pub(crate) same: &'a dyn Fn(usize) -> bool,
}

impl Rows<'_> {
    pub(crate) fn line(&self, row: usize) -> u64 {
        self.lines.get(row).copied().unwrap_or(0)
    }

    pub(super) fn too_short(&self, samples: usize) -> LogError {
        LogError::TooShort {
            name: self.name.to_owned(),
            samples,
            needed: 2,
            purpose: "telling the sample time from the time column".to_owned(),
            hint: ", or pass `--dt S`",
        }
    }

    pub(super) fn not_increasing(&self, before: f64, row: usize, after: f64) -> LogError {
        LogError::TimeNotIncreasing {
            name: self.name.to_owned(),
            line: self.line(row),
            column: self.column.to_owned(),
            before: readable(before),
            after: readable(after),
        }
    }
}

/// "1 row", "2 rows".
pub(crate) fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

/// The mean of the steps within half of their median.
pub(super) fn typical_step(rows: &[(usize, f64)]) -> Option<f64> {
    let mut steps: Vec<f64> = rows
        .windows(2)
        .map(|w| w[1].1 - w[0].1)
        .filter(|step| *step > 0.0)
        .collect();
    if steps.is_empty() {
        return None;
    }
    let middle = steps.len() / 2;
    let (_, median, _) = steps.select_nth_unstable_by(middle, f64::total_cmp);
    let median = *median;
    let near: Vec<f64> = steps
        .into_iter()
        .filter(|s| (s / median - 1.0).abs() < 0.5)
        .collect();
    Some(near.iter().sum::<f64>() / near.len() as f64)
}
