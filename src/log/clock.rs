//! Time stamps to a grid: which sample each row is, where the clock was repaired, and where a recording ends and another
//! begins.
//!
//! The step is the mean of the steps near their median, refined by least squares over all rows. A row is placed by
//! following the phase of the clock, which jitter of less than half a sample does not lose.

use super::error::LogError;
use super::roles::Missing;
use super::sampling::{GAP, STEP_TOLERANCE, check_drift, readable, shortest_within};

/// Share of rows that have the stamp of the row before from which on the stamps are taken to be coarse.
const COARSE: f64 = 0.25;
/// Share of rows whose stamp may be in conflict with the others.
const CONFLICTS: f64 = 0.01;
/// Samples missing in a row that are interpolated; more are a gap. Two points of a straight line between neighbours
/// say little that the neighbours do not.
pub(super) const BRIDGED: usize = 2;
/// Share of samples that may be missing between the stamps, beside gaps: with more, the step is not the step.
const SPARSE: f64 = 0.2;
/// Largest distance of a stamp from the phase of the clock, in samples: at half a sample it is between two.
const JITTER: f64 = 0.45;
/// Largest root mean square of the distances; stamps without any grid have 0.29 (uniform between two samples).
const JITTER_RMS: f64 = 0.2;
/// How fast the phase follows the stamps: slow enough to average jitter, fast enough for an error of the step of 5 %.
const FOLLOW: f64 = 0.2;

/// Rows of one recording: where they are on its grid.
#[derive(Debug, Clone, Default)]
pub(super) struct Piece {
    /// Rows of the table, in their order.
    pub(super) rows: Vec<usize>,
    /// The sample that each is, from 0.
    pub(super) samples: Vec<usize>,
    /// Stamp of each row in seconds, repaired.
    pub(super) times: Vec<f64>,
}

/// The clock of a table.
#[derive(Debug)]
pub(super) struct Grid {
    pub(super) pieces: Vec<Piece>,
    /// Sample time in seconds.
    pub(super) step: f64,
    pub(super) said: Vec<String>,
}

/// What is known of the rows.
pub(super) struct Rows<'a> {
    pub(super) name: &'a str,
    /// Header of the time column.
    pub(super) column: &'a str,
    /// Stamps in seconds since the first, NaN where there is none.
    pub(super) stamps: &'a [f64],
    /// Line of each row.
    pub(super) lines: &'a [u64],
    /// Rounding of a stamp in seconds, as far as its number has any.
    pub(super) rounding: f64,
    /// Whether a row says the same as the one before it in every column.
    pub(super) same: &'a dyn Fn(usize) -> bool,
}

/// Places the rows on a grid; with `resample`, only orders them and cuts them at gaps.
pub(super) fn lay(
    rows: &Rows<'_>,
    policy: Missing,
    resample: Option<f64>,
) -> Result<Grid, LogError> {
    let mut said = Vec::new();
    let mut kept: Vec<(usize, f64)> = rows
        .stamps
        .iter()
        .copied()
        .enumerate()
        .filter(|(_, stamp)| stamp.is_finite())
        .collect();
    let unstamped = rows.stamps.len() - kept.len();
    if unstamped > 0 {
        if policy == Missing::Error {
            let row = rows
                .stamps
                .iter()
                .position(|stamp| !stamp.is_finite())
                .unwrap_or(0);
            return Err(LogError::EmptyCell {
                name: rows.name.to_owned(),
                line: rows.line(row),
                column: rows.column.to_owned(),
            });
        }
        said.push(format!(
            "{} without a time stamp left out",
            counted(unstamped, "row")
        ));
    }
    if kept.len() < 2 {
        return Err(rows.too_short(kept.len()));
    }
    if let Some(spread) = spread_coarse(rows, &mut kept)? {
        said.push(spread);
    } else {
        repair(rows, &mut kept, policy, &mut said)?;
    }
    let rough = typical_step(&kept).ok_or_else(|| rows.too_short(kept.len()))?;
    let runs = cut_at_resets(rows, kept, rough, policy, &mut said)?;
    if let Some(wanted) = resample {
        let longest = (BRIDGED as f64 + 1.0 + JITTER) * rough.max(wanted);
        let pieces = runs
            .into_iter()
            .flat_map(|run| {
                cut_where(run, |before, after| {
                    policy != Missing::Interpolate && after - before > longest
                })
            })
            .map(|run| Piece {
                samples: Vec::new(),
                times: run.iter().map(|(_, time)| *time).collect(),
                rows: run.into_iter().map(|(row, _)| row).collect(),
            })
            .collect();
        return Ok(Grid {
            pieces,
            step: rough,
            said,
        });
    }
    let bridged = |policy: Missing| match policy {
        Missing::Auto => BRIDGED,
        Missing::Split | Missing::Error => 0,
        Missing::Interpolate => usize::MAX,
    };
    // The step first, from rows that follow each other closely; then the rows with gaps, for which the step must be right.
    let close: Vec<Piece> = runs
        .iter()
        .flat_map(|run| place(run, rough, BRIDGED))
        .collect();
    let (step, certain) = fitted_step(&close).unwrap_or((rough, 0.0));
    let pieces: Vec<Piece> = runs
        .iter()
        .flat_map(|run| place(run, step, bridged(policy)))
        .collect();
    check_grid(rows, &pieces, step, policy)?;
    let length = pieces
        .iter()
        .filter_map(|p| Some(p.times.last()? - p.times.first()?))
        .fold(0.0, f64::max);
    let samples = pieces
        .iter()
        .filter_map(|p| p.samples.last())
        .max()
        .copied()
        .unwrap_or(1)
        .max(1) as f64;
    let largest = rows
        .stamps
        .iter()
        .copied()
        .filter(|s| s.is_finite())
        .fold(length, |m, s| m.max(s.abs()));
    let slack = (4.0 * f64::EPSILON * largest + 2.0 * rows.rounding) / samples;
    let step = shortest_within(step, slack.max(3.0 * certain));
    if let Some(jitter) = worst_jitter(&pieces, step)
        && jitter > STEP_TOLERANCE + 4.0 * rows.rounding / step
    {
        said.push(format!(
            "time stamps off by up to {:.0} % of a sample: placed on a grid of {} s, their mean spacing",
            100.0 * jitter,
            readable(step)
        ));
    }
    Ok(Grid { pieces, step, said })
}

impl Rows<'_> {
    fn line(&self, row: usize) -> u64 {
        self.lines.get(row).copied().unwrap_or(0)
    }

    fn too_short(&self, samples: usize) -> LogError {
        LogError::TooShort {
            name: self.name.to_owned(),
            samples,
            needed: 2,
            purpose: "telling the sample time from the time column".to_owned(),
            hint: ", or pass `--dt S`",
        }
    }

    fn not_increasing(&self, before: f64, row: usize, after: f64) -> LogError {
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
pub(super) fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

/// The mean of the steps within half of their median.
fn typical_step(rows: &[(usize, f64)]) -> Option<f64> {
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

/// Stamps with fewer digits than the sampling needs: rows that share one are spread evenly when there are as many of them
/// at every stamp.
fn spread_coarse(rows: &Rows<'_>, kept: &mut [(usize, f64)]) -> Result<Option<String>, LogError> {
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
fn repair(
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
        let dropped: std::collections::HashSet<usize> = conflicts.iter().map(|c| c.0).collect();
        kept.retain(|row| !dropped.contains(&row.0));
    }
    Ok(())
}

type Run = Vec<(usize, f64)>;

fn cut_where(run: Run, cut: impl Fn(f64, f64) -> bool) -> Vec<Run> {
    let mut runs = Vec::new();
    let mut current: Run = Vec::new();
    for row in run {
        if current.last().is_some_and(|last| cut(last.1, row.1)) {
            runs.push(std::mem::take(&mut current));
        }
        current.push(row);
    }
    runs.push(current);
    runs
}

/// Where time goes back, another recording begins.
fn cut_at_resets(
    rows: &Rows<'_>,
    kept: Run,
    step: f64,
    policy: Missing,
    said: &mut Vec<String>,
) -> Result<Vec<Run>, LogError> {
    let resets: Vec<(f64, usize, f64)> = kept
        .windows(2)
        .filter(|w| w[1].1 <= w[0].1)
        .map(|w| (w[0].1, w[1].0, w[1].1))
        .collect();
    let Some((before, row, after)) = resets.first().copied() else {
        return Ok(vec![kept]);
    };
    let count = kept.len();
    let runs = cut_where(kept, |before, after| after <= before);
    // Rows that are not sorted go back all the time.
    let unsorted =
        resets.len() as f64 > CONFLICTS * count as f64 || runs.iter().any(|run| run.len() < 2);
    if policy == Missing::Error || unsorted {
        return Err(rows.not_increasing(before, row, after));
    }
    said.push(format!(
        "time goes back by {} s before line {}: {} recordings",
        readable((before - after).max(step * f64::EPSILON)),
        rows.line(row),
        runs.len()
    ));
    Ok(runs)
}

/// Gives each row of a run its sample; cut where more than `bridged` are missing.
fn place(run: &Run, step: f64, bridged: usize) -> Vec<Piece> {
    let mut pieces = Vec::new();
    let mut piece = Piece::default();
    let mut phase = f64::NAN;
    for &(row, time) in run {
        let ahead = ((time - phase) / step).round().max(1.0);
        let sample = match piece.samples.last() {
            Some(last) if ahead - 1.0 <= bridged as f64 => last + ahead as usize,
            Some(_) => {
                pieces.push(std::mem::take(&mut piece));
                0
            }
            None => 0,
        };
        phase = match piece.samples.is_empty() {
            true => time,
            false => {
                let due = phase + ahead * step;
                due + FOLLOW * (time - due)
            }
        };
        piece.rows.push(row);
        piece.samples.push(sample);
        piece.times.push(time);
    }
    pieces.push(piece);
    pieces
}

/// The step by least squares, with a phase for each piece, and its standard deviation.
fn fitted_step(pieces: &[Piece]) -> Option<(f64, f64)> {
    let (mut sxx, mut sxy, mut syy, mut count) = (0.0, 0.0, 0.0, 0.0);
    for piece in pieces {
        let n = piece.rows.len() as f64;
        let mean_k = piece.samples.iter().map(|k| *k as f64).sum::<f64>() / n;
        // Relative to the first stamp: sums of large stamps would lose digits.
        let first = piece.times.first().copied().unwrap_or(0.0);
        let mean_t = piece.times.iter().map(|t| t - first).sum::<f64>() / n;
        for (k, t) in piece.samples.iter().zip(&piece.times) {
            let (dk, dt) = (*k as f64 - mean_k, t - first - mean_t);
            sxx += dk * dk;
            sxy += dk * dt;
            syy += dt * dt;
        }
        count += n - 1.0;
    }
    if sxx <= 0.0 {
        return None;
    }
    let step = sxy / sxx;
    let residual = (syy - step * sxy).max(0.0) / count.max(1.0);
    // Differences of sums lose half of the digits: what they leave of exact stamps is rounding.
    let floor = f64::EPSILON * syy / count.max(1.0);
    Some((step, ((residual - floor).max(0.0) / sxx).sqrt()))
}

/// Distances of the stamps from the phase of the clock, in samples.
fn distances(piece: &Piece, step: f64) -> Vec<f64> {
    let mut phase = f64::NAN;
    let mut last = 0;
    piece
        .samples
        .iter()
        .zip(&piece.times)
        .enumerate()
        .map(|(index, (sample, time))| {
            if index == 0 {
                phase = *time;
                last = *sample;
                return 0.0;
            }
            let due = phase + (sample - last) as f64 * step;
            let off = time - due;
            phase = due + FOLLOW * off;
            last = *sample;
            off / step
        })
        .collect()
}

fn worst_jitter(pieces: &[Piece], step: f64) -> Option<f64> {
    pieces
        .iter()
        .flat_map(|piece| distances(piece, step))
        .map(f64::abs)
        .max_by(f64::total_cmp)
}

/// Refuses gaps that are not to be, stamps without a grid, and a clock that runs away from it.
fn check_grid(
    rows: &Rows<'_>,
    pieces: &[Piece],
    step: f64,
    policy: Missing,
) -> Result<(), LogError> {
    let (name, column) = (rows.name.to_owned(), rows.column.to_owned());
    let line = |piece: &Piece, at: usize| rows.line(piece.rows.get(at).copied().unwrap_or(0));
    if policy == Missing::Error
        && let [first, second, ..] = pieces
    {
        let found = second
            .times
            .first()
            .zip(first.times.last())
            .map_or(f64::NAN, |(b, a)| b - a);
        let (found, expected) = (readable(found), readable(step));
        let recipe = "`--missing split` does".to_owned();
        return Err(LogError::TimeGap {
            name,
            line: line(second, 0),
            column,
            found,
            expected,
            recipe,
        });
    }
    let irregular = |piece: &Piece, at: usize| {
        let found = piece
            .times
            .get(at)
            .zip(piece.times.get(at.wrapping_sub(1)))
            .map_or(f64::NAN, |(b, a)| b - a);
        LogError::IrregularStep {
            name: name.clone(),
            line: line(piece, at),
            column: column.clone(),
            found: readable(found),
            expected: readable(step),
            recipe: format!("`--resample {}` does", readable(step)),
        }
    };
    let (mut sum, mut count, mut absent) = (0.0, 0.0, 0.0);
    for piece in pieces {
        let off = distances(piece, step);
        if let Some(at) = off.iter().position(|d| d.abs() > JITTER) {
            return Err(irregular(piece, at));
        }
        sum += off.iter().map(|d| d * d).sum::<f64>();
        count += off.len() as f64;
        absent += piece
            .samples
            .last()
            .map_or(0.0, |last| (last + 1 - piece.rows.len()) as f64);
    }
    let sparse = policy != Missing::Interpolate && absent > SPARSE * (count + absent);
    if (sum / f64::max(count, 1.0)).sqrt() > JITTER_RMS || sparse {
        let worst = pieces.iter().flat_map(|piece| {
            piece
                .times
                .windows(2)
                .enumerate()
                .map(move |(at, w)| (piece, at + 1, (w[1] - w[0]) / step))
        });
        let first = worst
            .filter(|(_, _, steps)| *steps > GAP || (steps - 1.0).abs() > JITTER_RMS)
            .min_by_key(|w| line(w.0, w.1));
        if let Some((piece, at, _)) = first {
            return Err(irregular(piece, at));
        }
    }
    for piece in pieces {
        check_drift(&piece.samples, &piece.times, step).map_err(|(at, expected)| {
            LogError::ClockDrift {
                name: name.clone(),
                line: line(piece, at),
                column: column.clone(),
                found: readable(piece.times.get(at).copied().unwrap_or(f64::NAN)),
                expected: readable(expected),
                sample_time: readable(step),
                recipe: format!("`--resample {}` does", readable(step)).into_boxed_str(),
            }
        })?;
    }
    Ok(())
}
