//! Time stamps to a grid: which sample each row is, and where a recording ends and another begins.
//!
//! The step is the mean of the steps near their median, refined by least squares over all rows. A row is placed by
//! following the phase of the clock, which jitter of less than half a sample does not lose.

use super::repair::{repair, spread_coarse};
use super::sampling::{GAP, STEP_TOLERANCE, check_drift, readable, shortest_within};
use super::stamped_rows::{CONFLICTS, Rows, counted, typical_step};
use crate::log::{LogError, Missing};

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
pub(crate) struct Piece {
    /// Rows of the table, in their order.
    pub(crate) rows: Vec<usize>,
    /// The sample that each is, from 0.
    pub(crate) samples: Vec<usize>,
    /// Stamp of each row in seconds, repaired.
    pub(crate) times: Vec<f64>,
}

/// The clock of a table.
#[derive(Debug)]
pub(crate) struct Grid {
    pub(crate) pieces: Vec<Piece>,
    /// Sample time in seconds.
    pub(crate) step: f64,
    /// The largest distance of a stamp from the grid, in samples, without what rounding of the stamps makes of it.
    pub(crate) jitter: f64,
    pub(crate) said: Vec<String>,
}

/// Places the rows on a grid; with `resample`, only orders them and cuts them at gaps.
pub(crate) fn lay(
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
            jitter: 0.0,
            said,
        });
    }
    let bridged = |policy: Missing| match policy {
        Missing::Auto | Missing::Keep => BRIDGED,
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
    let worst = worst_jitter(&pieces, step).unwrap_or(0.0);
    let jitter = (worst - 4.0 * rows.rounding / step).max(0.0);
    if jitter > STEP_TOLERANCE {
        said.push(format!(
            "time stamps off by up to {:.0} % of a sample: placed on a grid of {} s, their mean spacing",
            100.0 * worst,
            readable(step)
        ));
    }
    Ok(Grid {
        pieces,
        step,
        jitter,
        said,
    })
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
