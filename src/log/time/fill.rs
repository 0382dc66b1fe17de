//! Samples that are missing: interpolated, or the recording is cut there.

use super::time_grid::{BRIDGED, Piece};
use crate::log::Missing;

/// Fewer samples in a row are left out when a recording is cut: they are shorter than the past that any model looks at.
pub(crate) const SHORTEST: usize = 20;

/// Samples without a gap.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Filled {
    /// The first sample, counted on the grid of its piece.
    pub(crate) from: usize,
    /// A column a channel.
    pub(crate) columns: Vec<Vec<f64>>,
}

/// What was done, to be said.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Tally {
    /// Values interpolated, a count a channel.
    pub(crate) interpolated: Vec<usize>,
    /// Values that stay missing.
    pub(crate) kept: Vec<usize>,
    /// Longest run of them.
    pub(crate) longest: usize,
    /// Samples left out because a value was missing there or because they stood alone.
    pub(crate) left_out: usize,
}

/// The rows of a piece on its grid, in parts without missing values; those of outputs may be kept. `columns` are those of the
/// table, the first `inputs` of them inputs, NaN where a value is missing.
pub(crate) fn fill(
    piece: &Piece,
    columns: &[Vec<f64>],
    inputs: usize,
    policy: Missing,
    tally: &mut Tally,
) -> Vec<Filled> {
    let samples = piece.samples.last().map_or(0, |last| last + 1);
    tally.interpolated.resize(columns.len(), 0);
    tally.kept.resize(columns.len(), 0);
    let mut gridded: Vec<Vec<f64>> = columns
        .iter()
        .map(|column| {
            let mut out = vec![f64::NAN; samples];
            for (row, sample) in piece.rows.iter().zip(&piece.samples) {
                if let (Some(place), Some(value)) = (out.get_mut(*sample), column.get(*row)) {
                    *place = *value;
                }
            }
            out
        })
        .collect();
    let most = match policy {
        Missing::Auto | Missing::Keep => BRIDGED,
        Missing::Split | Missing::Error => 0,
        Missing::Interpolate => usize::MAX,
    };
    let required = match policy {
        Missing::Keep => inputs,
        _ => columns.len(),
    };
    for (column, count) in gridded
        .iter_mut()
        .zip(&mut tally.interpolated)
        .take(required)
    {
        let (filled, longest) = bridge(column, most);
        *count += filled;
        tally.longest = tally.longest.max(longest);
    }
    for (column, count) in gridded.iter().zip(&mut tally.kept).skip(required) {
        *count += column.iter().filter(|v| !v.is_finite()).count();
    }
    let whole = |k: usize| {
        gridded
            .iter()
            .take(required)
            .all(|column| column.get(k).is_some_and(|v| v.is_finite()))
    };
    let mut parts = Vec::new();
    let mut from = 0;
    while from < samples {
        if !whole(from) {
            tally.left_out += 1;
            from += 1;
            continue;
        }
        let to = (from..samples).find(|k| !whole(*k)).unwrap_or(samples);
        if to - from < SHORTEST && to - from < samples {
            tally.left_out += to - from;
        } else {
            let columns = gridded
                .iter()
                .map(|c| c.get(from..to).unwrap_or_default().to_vec())
                .collect();
            parts.push(Filled { from, columns });
        }
        from = to;
    }
    parts
}

/// Straight lines over runs of at most `most` missing values: how many values, and the longest run.
pub(super) fn bridge(column: &mut [f64], most: usize) -> (usize, usize) {
    let (mut filled, mut longest) = (0, 0);
    let mut last: Option<(usize, f64)> = None;
    for at in 0..column.len() {
        let value = column[at];
        if !value.is_finite() {
            continue;
        }
        if let Some((before, from)) = last {
            let run = at - before - 1;
            if run > 0 && run <= most {
                for (k, place) in column[before + 1..at].iter_mut().enumerate() {
                    let share = (k + 1) as f64 / (run + 1) as f64;
                    *place = from + share * (value - from);
                }
                filled += run;
                longest = longest.max(run);
            }
        }
        last = Some((at, value));
    }
    (filled, longest)
}

#[cfg(test)]
mod tests {
    use super::*;

    const GONE: f64 = f64::NAN;

    fn piece(samples: usize) -> Piece {
        Piece {
            rows: (0..samples).collect(),
            samples: (0..samples).collect(),
            times: Vec::new(),
        }
    }

    #[test]
    fn short_runs_are_bridged_and_long_ones_cut() {
        let mut column: Vec<f64> = (0..100).map(f64::from).collect();
        for at in [0, 10, 20, 21, 50, 51, 52, 99] {
            column[at] = GONE;
        }
        let mut tally = Tally::default();
        let parts = fill(&piece(100), &[column.clone()], 0, Missing::Auto, &mut tally);
        assert_eq!(
            (tally.interpolated.clone(), tally.longest, tally.left_out),
            (vec![3], 2, 5)
        );
        assert_eq!(
            parts
                .iter()
                .map(|p| (p.from, p.columns[0].len()))
                .collect::<Vec<_>>(),
            [(1, 49), (53, 46)]
        );
        for part in &parts {
            assert!(
                part.columns[0]
                    .iter()
                    .enumerate()
                    .all(|(k, v)| (v - (part.from + k) as f64).abs() < 1e-12)
            );
        }
        let mut tally = Tally::default();
        let parts = fill(
            &piece(100),
            &[column.clone()],
            0,
            Missing::Interpolate,
            &mut tally,
        );
        assert_eq!((parts.len(), tally.longest, tally.left_out), (1, 3, 2));
        let parts = fill(
            &piece(100),
            &[column.clone()],
            0,
            Missing::Split,
            &mut Tally::default(),
        );
        assert_eq!(parts.iter().map(|p| p.from).collect::<Vec<_>>(), [22, 53]);
        // Outputs that are kept do not cut; inputs do.
        let mut tally = Tally::default();
        let columns = [column.clone(), column];
        let parts = fill(&piece(100), &columns[1..], 0, Missing::Keep, &mut tally);
        assert_eq!((parts.len(), tally.kept, tally.left_out), (1, vec![8], 0));
        assert!(parts[0].columns[0][50].is_nan());
        let mut tally = Tally::default();
        let parts = fill(&piece(100), &columns, 1, Missing::Keep, &mut tally);
        assert_eq!(
            (parts.len(), tally.interpolated, tally.kept),
            (2, vec![3, 0], vec![0, 8])
        );
    }
}
