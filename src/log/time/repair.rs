//! Time stamps that are coarse, repeated or out of order, put where the grid of the others has a place for them.

use std::collections::HashSet;

use super::sampling::{STEP_TOLERANCE, readable};
use super::stamped_rows::{CONFLICTS, Rows, counted, typical_step};
use crate::log::{LogError, Missing};

/// Share of rows that have the stamp of the row before from which on the stamps are taken to be coarse.
const COARSE: f64 = 0.25;

/// Stamps with fewer digits than the sampling needs: rows that share one are spread evenly when there are as many of them
/// at every stamp.
pub(super) fn spread_coarse(
    rows: &Rows<'_>,
    kept: &mut [(usize, f64)],
) -> Result<Option<String>, LogError> {
    let shared = kept.windows(2).filter(|w| w[0].1 == w[1].1).count();
    if (shared as f64) < COARSE * kept.len() as f64 {
        return Ok(None);
    }
    let groups: Vec<&[(usize, f64)]> = kept.chunk_by(|a, b| a.1 == b.1).collect();
    let first_row = kept.first().map_or(0, |(row, _)| *row);
    let Some(inner) = groups
        .get(1..groups.len().saturating_sub(1))
        .filter(|g| !g.is_empty())
    else {
        return Err(rows.not_increasing(kept[0].1, first_row + 1, kept[0].1));
    };
    let stamp = |group: &[(usize, f64)]| group.first().map_or(f64::NAN, |(_, time)| *time);
    if let Some(pair) = groups.windows(2).find(|w| stamp(w[1]) < stamp(w[0])) {
        let row = pair[1].first().map_or(0, |(row, _)| *row);
        return Err(rows.not_increasing(stamp(pair[0]), row, stamp(pair[1])));
    }
    let (least, most) = inner.iter().fold((usize::MAX, 0), |(a, b), g| {
        (a.min(g.len()), b.max(g.len()))
    });
    let mut steps: Vec<f64> = groups
        .windows(2)
        .map(|w| stamp(w[1]) - stamp(w[0]))
        .collect();
    steps.sort_by(f64::total_cmp);
    let resolution = steps.get(steps.len() / 2).copied().unwrap_or(f64::NAN);
    let even = steps
        .iter()
        .all(|step| (step / resolution - 1.0).abs() < STEP_TOLERANCE);
    if most - least > 1 || !even {
        return Err(LogError::CoarseStamps {
            name: rows.name.to_owned(),
            column: rows.column.to_owned(),
            resolution: readable(resolution),
            least,
            most,
        });
    }
    // Whole groups only: the first and the last may be cut.
    let counted_rows: usize = inner.iter().map(|group| group.len()).sum();
    let span = stamp(groups[groups.len() - 1]) - stamp(inner[0]);
    let step = span / counted_rows as f64;
    let (origin, skipped) = (stamp(inner[0]), groups[0].len() as f64);
    for (index, row) in kept.iter_mut().enumerate() {
        row.1 = origin + (index as f64 - skipped) * step;
    }
    let many = if least == most {
        most.to_string()
    } else {
        format!("{least} or {most}")
    };
    Ok(Some(format!(
        "time stamps only to {} s, each shared by {many} rows: the rows are spread evenly, {} s apart",
        readable(resolution),
        readable(step)
    )))
}

/// Rows written twice are dropped; stamps that repeat or are out of order are put where the grid has a place for them.
pub(crate) fn repair(
    rows: &Rows<'_>,
    kept: &mut Vec<(usize, f64)>,
    policy: Missing,
    said: &mut Vec<String>,
) -> Result<(), LogError> {
    let Some(step) = typical_step(kept) else {
        return Err(rows.not_increasing(kept[0].1, kept[1].0, kept[1].1));
    };
    if policy == Missing::Error {
        return match kept.windows(2).find(|w| w[1].1 <= w[0].1) {
            Some(w) => Err(rows.not_increasing(w[0].1, w[1].0, w[1].1)),
            None => Ok(()),
        };
    }
    let before = kept.len();
    let mut last: Option<(usize, f64)> = None;
    kept.retain(|&(row, time)| {
        let again = last.is_some_and(|(r, t)| t == time && r + 1 == row && (rows.same)(row));
        last = Some((row, time));
        !again
    });
    if kept.len() < before {
        said.push(format!(
            "{} written twice: the second dropped",
            counted(before - kept.len(), "row")
        ));
    }
    let near = |found: f64, steps: f64| (found - steps * step).abs() < 0.5 * step;
    let (mut repaired, mut conflicts) = (Vec::new(), Vec::new());
    let mut at = 0;
    while at < kept.len() {
        let time = kept[at].1;
        let run = kept[at..].iter().take_while(|row| row.1 == time).count();
        if run > 1 {
            let count = run as f64;
            let previous = at.checked_sub(1).map(|p| kept[p].1);
            let next = kept.get(at + run).map(|row| row.1);
            let forward = next.map_or(previous.is_some_and(|p| near(time - p, 1.0)), |next| {
                near(next - time, count)
            });
            let backward = previous.map_or(next.is_some_and(|n| near(n - time, 1.0)), |p| {
                near(time - p, count)
            });
            if forward || backward {
                for (k, row) in kept[at..at + run].iter_mut().enumerate() {
                    let shift = if forward {
                        k as f64
                    } else {
                        k as f64 - (count - 1.0)
                    };
                    row.1 = time + shift * step;
                }
                repaired.extend(kept[at..at + run].iter().skip(1).map(|row| row.0));
            } else {
                conflicts.extend(kept[at + 1..at + run].iter().map(|row| (row.0, time)));
            }
        }
        at += run;
    }
    // One stamp that is out of order, between two that are two steps apart.
    for at in 1..kept.len().saturating_sub(1) {
        let (a, b, c) = (kept[at - 1].1, kept[at].1, kept[at + 1].1);
        if near(c - a, 2.0) && (b <= a || b >= c) {
            kept[at].1 = 0.5 * (a + c);
            repaired.push(kept[at].0);
        }
    }
    if conflicts.len() as f64 > CONFLICTS * kept.len() as f64
        && let Some((row, time)) = conflicts.first()
    {
        return Err(rows.not_increasing(*time, *row, *time));
    }
    if let Some(first) = repaired.first() {
        said.push(format!(
            "{} repaired from the grid (repeated or out of order), first in line {}",
            counted(repaired.len(), "time stamp"),
            rows.line(*first)
        ));
    }
    if let Some((first, _)) = conflicts.first() {
        said.push(format!(
            "{} with the stamp of another row and no free place on the grid dropped, first in line {}",
            counted(conflicts.len(), "row"),
            rows.line(*first)
        ));
        let dropped: HashSet<usize> = conflicts.iter().map(|c| c.0).collect();
        kept.retain(|row| !dropped.contains(&row.0));
    }
    Ok(())
}
