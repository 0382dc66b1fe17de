//! Is the time base uniform, and what is its step?
//!
//! The step that rows are held against is the median of the first steps, which a few bad ones cannot move; the sample
//! time reported is (last - first) / (N - 1), which averages the rounding of all time stamps away.

use crate::log::sample_time::is_sample_time;
use crate::log::text::Header;
use crate::log::{LogError, TimeUnit};

/// How far one step may be off, relative to the sample time.
pub(crate) const STEP_TOLERANCE: f64 = 0.01;
/// A step beyond this many sample times means that samples are missing.
pub(super) const GAP: f64 = 1.5;
/// How far time may run away from a uniform grid, relative to the length of the record; also half a sample is always
/// allowed. A clock disciplined by NTP (slewed by 5e-4 for half of the record) bends by 1.25e-4.
const DRIFT_TOLERANCE: f64 = 2e-4;
/// Time stamps are taken to be right to this, relative to the time since the start.
const ROUNDING: f64 = 1e-9;
/// Steps the median is taken of.
const FIRST_STEPS: usize = 1023;
/// Time stamps kept, evenly spread, for the check of drift.
const MARKS: usize = 2048;

/// Follows the time stamps of a recording as they come.
#[derive(Debug)]
pub(crate) struct Sampling {
    /// Seconds in a unit of the time column.
    unit: f64,
    /// Column of the time stamps, from 0, and its name in messages.
    index: usize,
    column: String,
    /// Line of the first row: rows follow each other without blank lines.
    first_line: u64,
    count: usize,
    first: f64,
    last: f64,
    step: Option<f64>,
    marks: Vec<(usize, f64)>,
    stride: usize,
}

impl Sampling {
    /// For time stamps in column `index`, `unit` seconds each; the first row is on line `first_line`.
    pub(crate) fn new(header: &Header, index: usize, unit: f64, first_line: u64) -> Self {
        let column = header.column(index);
        let (first, last) = (0.0, 0.0);
        Self {
            unit,
            index,
            column,
            first_line,
            count: 0,
            first,
            last,
            step: None,
            marks: Vec::new(),
            stride: 1,
        }
    }

    /// Checks the next time stamps, in the unit of the column. The first call decides on the step to expect, so it
    /// should bring many.
    pub(crate) fn push(&mut self, header: &Header, times: &[f64]) -> Result<(), LogError> {
        let unit = self.unit;
        let times = times.iter().map(|time| time * unit);
        if self.step.is_none() {
            self.step = median_step(times.clone());
        }
        let step = self.step.unwrap_or(f64::NAN);
        for time in times {
            if self.count == 0 {
                self.first = time;
            } else {
                let found = time - self.last;
                let slack = self.slack(time);
                if !(found > 0.0 && (found - step).abs() <= STEP_TOLERANCE * step + slack) {
                    return Err(self.bad_step(header, time, step, slack));
                }
            }
            self.last = time;
            self.mark(time);
            self.count += 1;
        }
        Ok(())
    }

    /// Sample time and start time in seconds, once all time stamps have been pushed. At least two are needed.
    pub(crate) fn finish(&self, header: &Header) -> Result<(f64, f64), LogError> {
        if self.count < 2 {
            let purpose = "telling the sample time from the time column".to_owned();
            let hint = ", or pass `--dt S`";
            let (name, samples) = (header.name.clone(), self.count);
            return Err(LogError::TooShort {
                name,
                samples,
                needed: 2,
                purpose,
                hint,
            });
        }
        let steps = (self.count - 1) as f64;
        let mean = (self.last - self.first) / steps;
        let resolution = 4.0 * f64::EPSILON * self.first.abs().max(self.last.abs()) / steps;
        let sample_time = shortest_within(mean, resolution);
        self.check_drift(header, mean)?;
        if !is_sample_time(sample_time) {
            return Err(LogError::InvalidSampleTime { sample_time });
        }
        Ok((sample_time, self.first))
    }

    /// What honest time stamps may differ by from what they mean: 0.1 k is no double, and seconds since 1970 have
    /// steps of 2.4e-7.
    fn slack(&self, time: f64) -> f64 {
        4.0 * f64::EPSILON * time.abs() + ROUNDING * (time - self.first).abs()
    }

    fn bad_step(&self, header: &Header, after: f64, expected: f64, slack: f64) -> LogError {
        let (name, line, column) = (
            header.name.clone(),
            self.first_line + self.count as u64,
            self.column.clone(),
        );
        let (before, found) = (self.last, after - self.last);
        // A median that is no step at all comes from time stamps out of order further down.
        if found <= 0.0 || expected.is_nan() || expected <= 0.0 {
            return LogError::TimeNotIncreasing {
                name,
                line,
                column,
                before,
                after,
            };
        }
        let (found, expected) = (readable(found), readable(expected));
        if found > GAP * expected + slack {
            let recipe = split_recipe(header, line);
            return LogError::TimeGap {
                name,
                line,
                column,
                found,
                expected,
                recipe,
            };
        }
        let recipe = self.resample_recipe(header, expected);
        LogError::IrregularStep {
            name,
            line,
            column,
            found,
            expected,
            recipe,
        }
    }

    /// Keeps every `stride`-th time stamp, and doubles the stride when there are too many.
    fn mark(&mut self, time: f64) {
        if !self.count.is_multiple_of(self.stride) {
            return;
        }
        if self.marks.len() == MARKS {
            self.stride *= 2;
            let stride = self.stride;
            self.marks
                .retain(|(sample, _)| sample.is_multiple_of(stride));
            if !self.count.is_multiple_of(stride) {
                return;
            }
        }
        self.marks.push((self.count, time));
    }

    /// Steps that are each within 1 % may still add up: the marks are held against the grid through both ends.
    fn check_drift(&self, header: &Header, mean: f64) -> Result<(), LogError> {
        let length = self.last - self.first;
        let mut worst = (0.0, 0, 0.0, 0.0);
        for (sample, time) in &self.marks {
            let expected = self.first + *sample as f64 * mean;
            let off = (time - expected).abs() - self.slack(*time);
            if off > worst.0 {
                worst = (off, *sample, *time, expected);
            }
        }
        let (off, sample, found, expected) = worst;
        if off <= (0.5 * mean).max(DRIFT_TOLERANCE * length) {
            return Ok(());
        }
        let (name, line, column) = (
            header.name.clone(),
            self.first_line + sample as u64,
            self.column.clone(),
        );
        let (found, expected, sample_time) = (readable(found), readable(expected), readable(mean));
        let recipe = self.resample_recipe(header, mean).into_boxed_str();
        Err(LogError::ClockDrift {
            name,
            line,
            column,
            found,
            expected,
            sample_time,
            recipe,
        })
    }

    /// A line of Python that puts the recording on a uniform grid.
    fn resample_recipe(&self, header: &Header, step: f64) -> String {
        let index = self.index;
        let step = readable(step / self.unit);
        let mut options = String::new();
        match header.separator {
            b';' => options.push_str(", sep=';'"),
            b'\t' => options.push_str(", sep='\\t'"),
            _ => {}
        }
        if header.headerless {
            options.push_str(", header=None");
        } else if header.line > 1 {
            options.push_str(&format!(", skiprows={}", header.line - 1));
        }
        let (file, keep) = (
            &header.name,
            if header.headerless {
                ", header=False"
            } else {
                ""
            },
        );
        format!(
            "`python -c \"import numpy, pandas; d = pandas.read_csv('{file}'{options}); t = d.iloc[:, {index}]; \
             g = numpy.arange(t.iloc[0], t.iloc[-1], {step}); pandas.DataFrame({{c: numpy.interp(g, t, d[c]) for c in d}})\
             .to_csv('uniform.csv', index=False{keep})\"`"
        )
    }
}

/// Holds stamps against the grid through the middle of them: the row that is off the most, and the time it should have.
pub(super) fn check_drift(samples: &[usize], times: &[f64], step: f64) -> Result<(), (usize, f64)> {
    let (Some(first), Some(last)) = (times.first(), times.last()) else {
        return Ok(());
    };
    let phases = || {
        samples
            .iter()
            .zip(times)
            .map(|(k, t)| t - first - *k as f64 * step)
    };
    let phase = phases().sum::<f64>() / times.len() as f64;
    let worst = phases()
        .map(|p| (p - phase).abs())
        .enumerate()
        .max_by(|a, b| a.1.total_cmp(&b.1));
    match worst {
        Some((at, off)) if off > (0.5 * step).max(DRIFT_TOLERANCE * (last - first)) => {
            let sample = samples.get(at).copied().unwrap_or(0) as f64;
            Err((at, first + phase + sample * step))
        }
        _ => Ok(()),
    }
}

/// The commands that split a file before `line`.
fn split_recipe(header: &Header, line: u64) -> String {
    let file = &header.name;
    let before = line.saturating_sub(1);
    let repeat = if header.headerless {
        String::new()
    } else {
        format!("sed -n {}p {file}; ", header.line)
    };
    format!("`head -n {before} {file} > part1.csv; ({repeat}tail -n +{line} {file}) > part2.csv`")
}

/// The median of the first steps, of those that go forward.
fn median_step(times: impl Iterator<Item = f64>) -> Option<f64> {
    let times: Vec<f64> = times.take(FIRST_STEPS + 1).collect();
    let mut steps: Vec<f64> = times
        .iter()
        .zip(times.iter().skip(1))
        .map(|(a, b)| b - a)
        .filter(|s| *s > 0.0)
        .collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied()
}

/// The decimal with the fewest digits within `tolerance` of `value`: the sample time that was meant, rather than one
/// with the rounding of the last time stamp in its sixteenth digit.
pub(super) fn shortest_within(value: f64, tolerance: f64) -> f64 {
    let rounded = |digits: usize| format!("{value:.digits$e}").parse::<f64>().ok();
    (0..16)
        .filter_map(rounded)
        .find(|short| (short - value).abs() <= tolerance)
        .unwrap_or(value)
}

/// A value as a message shows it, to nine digits.
pub(crate) fn readable(value: f64) -> f64 {
    shortest_within(value, 1e-9 * value.abs())
}

/// Sampling as the time column `index` tells it, in the unit of that column.
pub(crate) fn time_base(
    header: &Header,
    index: usize,
    first_line: u64,
    asked: Option<TimeUnit>,
) -> Result<Sampling, LogError> {
    let scale = time_unit(header, index, asked)?.seconds();
    Ok(Sampling::new(header, index, scale, first_line))
}

/// Unit of the time column: as asked for, by its header, by the end of its name, or seconds.
pub(crate) fn time_unit(
    header: &Header,
    index: usize,
    asked: Option<TimeUnit>,
) -> Result<TimeUnit, LogError> {
    let channel = header.channels.get(index);
    let unit = channel.and_then(|channel| channel.unit.as_deref());
    if let Some(asked) = asked {
        return Ok(asked);
    }
    match unit {
        Some(unit) => TimeUnit::parse(unit).ok_or_else(|| LogError::TimeUnit {
            name: header.name.clone(),
            column: header.column(index),
            unit: unit.to_owned(),
        }),
        None => Ok(channel
            .and_then(|channel| TimeUnit::of_name(&channel.name))
            .unwrap_or(TimeUnit::Seconds)),
    }
}
