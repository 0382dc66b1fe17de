//! A time column to seconds: numbers in some unit, numbers since 1970, dates, times of day.

use super::sampling::time_unit;
use super::stamp::{DAY, Format, iso};
use crate::log::text::{Header, Mark, decimal, is_missing};
use crate::log::{LogError, Roles, TimeUnit};

/// Seconds since 1970 of times that are taken for dates: 1979 to 2200. What a clock shows that counts from when it was
/// switched on is less.
const DATES: std::ops::RangeInclusive<f64> = 3e8..=7.3e9;
/// Cells that are looked at to tell how a column writes dates.
const LOOKED_AT: usize = 4000;

/// A date and time, as the stamps say it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Origin {
    /// Nanoseconds since 1970-01-01 00:00:00, of UTC when the stamps say so and else of the logger's own clock.
    pub nanoseconds: i128,
    /// Whether the stamps are known to be UTC: they count from 1970.
    pub utc: bool,
}

impl std::fmt::Display for Origin {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&iso(self.nanoseconds))?;
        f.write_str(if self.utc { " UTC" } else { "" })
    }
}

impl Origin {
    /// The date and time that [`Display`](std::fmt::Display) has written.
    pub fn parse(text: &str) -> Option<Self> {
        let stamp = text.strip_suffix(" UTC");
        let date: jiff::civil::DateTime = stamp.unwrap_or(text).parse().ok()?;
        let moment = date.to_zoned(jiff::tz::TimeZone::UTC).ok()?;
        Some(Self {
            nanoseconds: moment.timestamp().as_nanosecond(),
            utc: stamp.is_some(),
        })
    }

    /// Seconds from another to this.
    pub fn since(&self, other: &Self) -> f64 {
        (self.nanoseconds - other.nanoseconds) as f64 * 1e-9
    }
}

/// A time column in seconds.
#[derive(Debug)]
pub(crate) struct Stamps {
    /// Seconds since the origin, or as the column counts them; NaN where there is none.
    pub(crate) seconds: Vec<f64>,
    /// Date and time at second zero, when the column says so.
    pub(crate) origin: Option<Origin>,
    /// What a stamp is rounded to as a number, in seconds.
    pub(crate) rounding: f64,
    pub(crate) said: Option<String>,
}

/// The unit of numbers that may count from 1970: in which they are dates, by their size. `None` when they are no dates.
pub(crate) fn epoch(value: f64, unit: TimeUnit, sure: bool) -> Option<TimeUnit> {
    // Days and hours are counted from other days than that of Unix.
    let dated = |unit: TimeUnit| unit.seconds() <= 1.0 && DATES.contains(&(value * unit.seconds()));
    if dated(unit) {
        return Some(unit);
    }
    // A unit that someone has stated is right unless it leads beyond all calendars.
    if sure || (value * unit.seconds() <= *DATES.end() && unit != TimeUnit::Seconds) {
        return None;
    }
    [
        TimeUnit::Milliseconds,
        TimeUnit::Microseconds,
        TimeUnit::Nanoseconds,
    ]
    .into_iter()
    .find(|unit| dated(*unit))
}

/// Reads the cells of the time column; `error` says what is wrong with one that is no time.
pub(crate) fn read(
    header: &Header,
    index: usize,
    cells: &[&str],
    mark: Mark,
    roles: &Roles,
    error: &dyn Fn(usize) -> LogError,
) -> Result<Stamps, LogError> {
    let column = header.column(index);
    let present = || cells.iter().copied().filter(|cell| !is_missing(cell));
    if let Some(first) = present().find_map(|cell| mark.number(cell)) {
        let stated = time_unit(header, index, roles.time_unit)?;
        return match epoch(first, stated, roles.time_unit.is_some()) {
            Some(unit) => since_1970(cells, mark, unit, unit != stated, &column, error),
            None => {
                let scale = stated.seconds();
                let seconds: Vec<f64> =
                    numbers(cells, error, |cell| mark.number(cell).map(|v| v * scale))?;
                let largest = seconds
                    .iter()
                    .copied()
                    .filter(|s| s.is_finite())
                    .fold(0.0, |m: f64, s| m.max(s.abs()));
                Ok(Stamps {
                    seconds,
                    origin: None,
                    rounding: 2.0 * f64::EPSILON * largest,
                    said: (stated != TimeUnit::Seconds).then(|| format!("`{column}` in {stated}")),
                })
            }
        };
    }
    let stride = (cells.len() / LOOKED_AT).max(1);
    let Some(format) = Format::of(present().step_by(stride)) else {
        let bad = cells
            .iter()
            .position(|cell| !is_missing(cell) && Format::of(std::iter::once(*cell)).is_none());
        return Err(error(bad.unwrap_or(0)));
    };
    let mut whole: Vec<Option<i128>> = Vec::with_capacity(cells.len());
    let mut last: Option<i128> = None;
    let mut days = 0;
    for (row, cell) in cells.iter().enumerate() {
        if is_missing(cell) {
            whole.push(None);
            continue;
        }
        let stamp = format.nanoseconds(cell).ok_or_else(|| error(row))?;
        // A time of day begins again at midnight.
        if format.order.is_none() && last.is_some_and(|last| stamp + DAY / 2 < last) {
            days += 1;
        }
        last = Some(stamp);
        whole.push(Some(stamp + days * DAY));
    }
    let first = whole.iter().flatten().next().copied().unwrap_or(0);
    let origin = Origin {
        nanoseconds: first,
        utc: format.offset,
    };
    let clock = iso(first);
    let said = match format.order {
        None => format!(
            "`{column}` is a time of day; time zero is the first, {}",
            clock.get(11..).unwrap_or_default()
        ),
        Some(order) => format!(
            "`{column}` holds dates as {}{}; time zero is {origin}",
            order.words(),
            if format.ambiguous {
                " (day and month may be the other way round)"
            } else {
                ""
            }
        ),
    };
    Ok(Stamps {
        seconds: relative(&whole, first, 1e-9),
        origin: format.order.map(|_| Origin {
            nanoseconds: first,
            utc: format.offset,
        }),
        rounding: 0.0,
        said: Some(said),
    })
}

fn numbers(
    cells: &[&str],
    error: &dyn Fn(usize) -> LogError,
    number: impl Fn(&str) -> Option<f64>,
) -> Result<Vec<f64>, LogError> {
    let one = |(row, cell): (usize, &&str)| match number(cell) {
        Some(value) => Ok(value),
        None if is_missing(cell) => Ok(f64::NAN),
        None => Err(error(row)),
    };
    cells.iter().enumerate().map(one).collect()
}

/// Differences are taken in whole numbers: a double holds seconds since 1970 to a quarter of a microsecond only.
fn since_1970(
    cells: &[&str],
    mark: Mark,
    unit: TimeUnit,
    by_size: bool,
    column: &str,
    error: &dyn Fn(usize) -> LogError,
) -> Result<Stamps, LogError> {
    // Billionths of the unit.
    let mut rounding = 0.0;
    let mut whole = Vec::with_capacity(cells.len());
    for (row, cell) in cells.iter().enumerate() {
        whole.push(match billionths(cell, mark) {
            Some(exact) => Some(exact),
            None if is_missing(cell) => None,
            None => {
                let value = mark.number(cell).ok_or_else(|| error(row))?;
                rounding = 2.0 * f64::EPSILON * value * unit.seconds();
                Some((value * 1e9) as i128)
            }
        });
    }
    let first = whole.iter().flatten().next().copied().unwrap_or(0);
    // Billionths of the unit to nanoseconds: a division by 1, a thousand, a million or a billion.
    let origin = Origin {
        nanoseconds: first / (1.0 / unit.seconds()).round().max(1.0) as i128,
        utc: true,
    };
    let by = if by_size { " by their size" } else { "" };
    Ok(Stamps {
        seconds: relative(&whole, first, 1e-9 * unit.seconds()),
        said: Some(format!(
            "`{column}` counts {}{by} from 1970; time zero is {origin}",
            plural(unit)
        )),
        origin: Some(origin),
        rounding,
    })
}

fn plural(unit: TimeUnit) -> &'static str {
    match unit {
        TimeUnit::Seconds => "seconds",
        TimeUnit::Milliseconds => "milliseconds",
        TimeUnit::Microseconds => "microseconds",
        TimeUnit::Nanoseconds => "nanoseconds",
        TimeUnit::Minutes => "minutes",
        TimeUnit::Hours => "hours",
        TimeUnit::Days => "days",
    }
}

fn relative(whole: &[Option<i128>], first: i128, scale: f64) -> Vec<f64> {
    // A division by a whole number rounds once: k / 1000 is the double of the decimal.
    let rate = (1.0 / scale).round();
    let one = |stamp: &Option<i128>| stamp.map_or(f64::NAN, |stamp| (stamp - first) as f64 / rate);
    whole.iter().map(one).collect()
}

/// A number without an exponent, times a billion.
fn billionths(cell: &str, mark: Mark) -> Option<i128> {
    let point = if mark == Mark::Comma { ',' } else { '.' };
    let (whole, fraction) = cell.split_once(point).unwrap_or((cell, ""));
    let digits = |text: &str| text.bytes().all(|b| b.is_ascii_digit());
    if whole.is_empty() || whole.len() > 20 || !digits(whole) || !digits(fraction) {
        return None;
    }
    let mut value: i128 = whole.parse().ok()?;
    for place in 0..9 {
        let digit = fraction
            .as_bytes()
            .get(place)
            .map_or(0, |b| i128::from(b - b'0'));
        value = value * 10 + digit;
    }
    Some(value)
}

/// What the first rows of a plain file say of its time column, before they are read as numbers.
pub(crate) fn first_look(
    header: &Header,
    index: usize,
    text: &[u8],
    roles: &Roles,
) -> Result<(), LogError> {
    const ROWS: usize = 64;
    let mut fields = Vec::new();
    let mut stamps: Vec<f64> = Vec::with_capacity(ROWS);
    for line in text.split(|byte| *byte == b'\n').take(ROWS) {
        crate::log::text::split(line, header.separator, &mut fields);
        let cell = fields
            .get(index)
            .and_then(|range| line.get(range.clone()))
            .unwrap_or_default();
        match decimal::read(cell).filter(|(_, used)| *used == cell.len()) {
            Some((value, _)) => stamps.push(value),
            None => break,
        }
    }
    let Some(first) = stamps.first() else {
        return Ok(());
    };
    let Ok(stated) = time_unit(header, index, roles.time_unit) else {
        return Ok(());
    };
    let dated = epoch(*first, stated, roles.time_unit.is_some());
    let unit = dated.unwrap_or(stated).seconds();
    if let Some(asked) = roles.sample_time {
        return check_sample_time(header, index, stamps.iter().map(|s| s * unit), asked);
    }
    let from_name = roles.time_unit.is_none()
        && header.channels.get(index).is_some_and(|c| c.unit.is_none())
        && stated != TimeUnit::Seconds;
    if dated.is_some() || from_name {
        return Err(LogError::Dated {
            name: header.name.clone(),
            column: header.column(index),
        });
    }
    Ok(())
}

/// How far a sample time may be from the step of the time column before one of them is wrong: rounded stamps and clocks that
/// drift are within it, units and counters are not.
const CONTRADICTION: f64 = 0.02;

/// Refuses a sample time that the stamps (seconds) contradict: by their median step and by their mean one.
pub(crate) fn check_sample_time(
    header: &Header,
    index: usize,
    stamps: impl Iterator<Item = f64>,
    asked: f64,
) -> Result<(), LogError> {
    let stamps: Vec<f64> = stamps.filter(|s| s.is_finite()).collect();
    let mut steps: Vec<f64> = stamps.windows(2).map(|w| w[1] - w[0]).collect();
    if steps.len() < 2 {
        return Ok(());
    }
    let mean = steps.iter().sum::<f64>() / steps.len() as f64;
    steps.sort_by(f64::total_cmp);
    let median = steps.get(steps.len() / 2).copied().unwrap_or(mean);
    // Stamps that are rounded to more than a step say little.
    let largest = stamps.iter().fold(0.0, |m: f64, s| m.max(s.abs()));
    let off =
        |step: f64| (step - asked).abs() > CONTRADICTION * asked + 4.0 * f64::EPSILON * largest;
    if off(mean) && off(median) && median > 0.0 {
        return Err(LogError::SampleTimeContradicted {
            name: header.name.clone(),
            column: header.column(index),
            found: super::sampling::readable(median),
            asked,
        });
    }
    Ok(())
}
