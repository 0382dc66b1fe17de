//! Dates and times of day as loggers write them, to nanoseconds.
//!
//! The order of day, month and year is a property of the column, not of the cell: [`Order::of`] looks at all of it.

use jiff::civil;

/// Nanoseconds in a second, and in a day.
const SECOND: i128 = 1_000_000_000;
pub(super) const DAY: i128 = 86_400 * SECOND;

/// What the numbers of a date mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Order {
    YearMonthDay,
    DayMonthYear,
    MonthDayYear,
}

impl Order {
    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::YearMonthDay => "year-month-day",
            Self::DayMonthYear => "day.month.year",
            Self::MonthDayYear => "month/day/year",
        }
    }
}

/// A stamp taken apart: numbers still without a meaning.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Parts {
    /// The three numbers of a date, and which is the year when its digits say so.
    date: Option<([i32; 3], Option<Order>)>,
    /// Nanoseconds since midnight.
    time: Option<i128>,
    /// Offset from UTC in seconds.
    offset: Option<i128>,
}

/// What all stamps of a column have in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Format {
    pub(crate) order: Option<Order>,
    /// Day and month could be swapped in every stamp.
    pub(super) ambiguous: bool,
    /// The stamps have an offset from UTC.
    pub(super) offset: bool,
}

impl Format {
    /// The format of the stamps; `None` when one of them is no stamp, or they are of different kinds.
    pub(crate) fn of<'a>(cells: impl Iterator<Item = &'a str>) -> Option<Self> {
        let mut order = None;
        let mut dated = None;
        let (mut day_first, mut month_first, mut dots, mut american) = (false, false, false, false);
        let (mut any, mut offset) = (false, false);
        for cell in cells {
            let parts = take_apart(cell)?;
            any = true;
            offset |= parts.offset.is_some();
            if *dated.get_or_insert(parts.date.is_some()) != parts.date.is_some() {
                return None;
            }
            let Some((numbers, said)) = parts.date else {
                continue;
            };
            if let Some(said) = said {
                if *order.get_or_insert(said) != said {
                    return None;
                }
            } else {
                day_first |= numbers[0] > 12;
                month_first |= numbers[1] > 12;
                dots |= cell.contains('.') && !cell.contains('/');
                let upper = cell.to_ascii_uppercase();
                american |= upper.contains("AM") || upper.contains("PM");
            }
        }
        if !any || (day_first && month_first) {
            return None;
        }
        if dated == Some(false) {
            return Some(Self {
                order: None,
                ambiguous: false,
                offset,
            });
        }
        let guessed = if month_first || (!day_first && american && !dots) {
            Order::MonthDayYear
        } else {
            Order::DayMonthYear
        };
        Some(Self {
            order: Some(order.unwrap_or(guessed)),
            ambiguous: order.is_none() && !day_first && !month_first && !dots,
            offset,
        })
    }

    /// Nanoseconds since 1970 (since midnight for a time of day), by the offset from UTC that the stamp has or as if it
    /// were UTC.
    pub(crate) fn nanoseconds(self, cell: &str) -> Option<i128> {
        let parts = take_apart(cell)?;
        let time = parts.time.unwrap_or(0) - parts.offset.unwrap_or(0) * SECOND;
        let Some(order) = self.order else {
            return Some(time);
        };
        let ([a, b, c], _) = parts.date?;
        let (year, month, day) = match order {
            Order::YearMonthDay => (a, b, c),
            Order::DayMonthYear => (c, b, a),
            Order::MonthDayYear => (c, a, b),
        };
        let date = civil::Date::new(
            i16::try_from(full_year(year)).ok()?,
            i8::try_from(month).ok()?,
            i8::try_from(day).ok()?,
        )
        .ok()?;
        let since = date.since(civil::Date::constant(1970, 1, 1)).ok()?;
        Some(i128::from(since.get_days()) * DAY + time)
    }
}

/// Two digits are a year of this century up to 68, as POSIX has it.
fn full_year(year: i32) -> i32 {
    match year {
        0..=68 => 2000 + year,
        69..=99 => 1900 + year,
        year => year,
    }
}

/// A moment as ISO 8601, to the nanosecond where it takes that.
pub(super) fn iso(nanoseconds: i128) -> String {
    let stamp = jiff::Timestamp::from_nanosecond(nanoseconds);
    stamp.map_or_else(
        |_| format!("{nanoseconds} ns since 1970"),
        |stamp| {
            let text = stamp.to_string();
            text.strip_suffix('Z').unwrap_or(&text).replace('T', " ")
        },
    )
}

/// Reads numbers and what stands between them; `None` when this is no date or time.
fn take_apart(cell: &str) -> Option<Parts> {
    let cell = cell.trim().trim_matches(['\'', '"']);
    if !cell.starts_with(|c: char| c.is_ascii_alphanumeric()) || cell.len() > 64 {
        return None;
    }
    let (date, rest) = read_date(cell);
    let rest = rest.trim_start_matches([' ', 'T', 't', '_', ',', '/', '-', ':']);
    if rest.is_empty() {
        // A date alone is a stamp of one sample a day.
        return date.map(|date| Parts {
            date: Some(date),
            time: None,
            offset: None,
        });
    }
    let (time, rest) = read_time(rest)?;
    let offset = read_offset(rest.trim())?;
    Some(Parts {
        date,
        time: Some(time),
        offset,
    })
}

/// Its numbers as they stand, and their order where the date itself says it.
type Date = ([i32; 3], Option<Order>);

/// A date at the start: `2026-11-23`, `23.11.2026`, `11/23/2026`, `23-Nov-2026`, `20261123`.
fn read_date(cell: &str) -> (Option<Date>, &str) {
    let none = (None, cell);
    // A weekday says nothing new.
    let text = match cell.split_once([' ', ',']) {
        Some((word, rest))
            if word.len() >= 3
                && word.chars().all(char::is_alphabetic)
                && month(word).is_none() =>
        {
            rest.trim_start_matches([' ', ','])
        }
        _ => cell,
    };
    let Some((first, after)) = number_or_month(text) else {
        return none;
    };
    // 20261123T100000: a compact date.
    if first.digits == 8 && !after.starts_with('.') {
        let value = first.value;
        return (
            Some((
                [value / 10_000, value / 100 % 100, value % 100],
                Some(Order::YearMonthDay),
            )),
            after,
        );
    }
    let mut rest = after;
    let mut parts = [first; 3];
    let mut separators = [' '; 2];
    for index in 1..3 {
        let mut letters = rest.chars();
        let Some(separator) = letters
            .next()
            .filter(|c| matches!(c, '-' | '/' | '.' | ' '))
        else {
            return none;
        };
        if separator == ' '
            && !parts.iter().any(|p| p.named)
            && !letters.as_str().starts_with(char::is_alphabetic)
        {
            return none;
        }
        separators[index - 1] = separator;
        let Some((part, after)) = number_or_month(letters.as_str().trim_start_matches([' ', '.']))
        else {
            return none;
        };
        parts[index] = part;
        rest = after.strip_prefix(',').unwrap_or(after);
    }
    let [a, b, c] = parts;
    let numbers = [a.value, b.value, c.value];
    if a.digits == 4 && !c.named {
        return (Some((numbers, Some(Order::YearMonthDay))), rest);
    }
    if a.named {
        return (Some((numbers, Some(Order::MonthDayYear))), rest);
    }
    if b.named {
        return (Some((numbers, Some(Order::DayMonthYear))), rest);
    }
    // `10.15.30` is no date when the year has neither two nor four digits.
    if !matches!(c.digits, 2 | 4) || a.digits > 2 || b.digits > 2 {
        return none;
    }
    (Some((numbers, None)), rest)
}

#[derive(Debug, Clone, Copy)]
struct Part {
    value: i32,
    digits: usize,
    named: bool,
}

fn number_or_month(text: &str) -> Option<(Part, &str)> {
    let digits = text.bytes().take_while(u8::is_ascii_digit).count();
    if digits > 0 {
        let (number, rest) = text.split_at_checked(digits)?;
        let value = number.parse().ok()?;
        return Some((
            Part {
                value,
                digits,
                named: false,
            },
            rest,
        ));
    }
    let letters = text.bytes().take_while(u8::is_ascii_alphabetic).count();
    let (word, rest) = text.split_at_checked(letters)?;
    Some((
        Part {
            value: month(word)?,
            digits: 0,
            named: true,
        },
        rest,
    ))
}

/// The number of a month by its English or German name.
fn month(word: &str) -> Option<i32> {
    const NAMES: [&str; 12] = [
        "jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec",
    ];
    let start = word.get(..3)?.to_ascii_lowercase();
    let start = match start.as_str() {
        "mai" => "may",
        "okt" => "oct",
        "dez" => "dec",
        other => other,
    };
    let at = NAMES.iter().position(|name| *name == start)?;
    i32::try_from(at + 1).ok()
}

/// `10:00`, `10:00:00.123`, `10:00:00,123`, `10:00:00:123`, `1:00 PM`, `100000.123`; the rest is the offset.
fn read_time(text: &str) -> Option<(i128, &str)> {
    let digits = |text: &str| text.bytes().take_while(u8::is_ascii_digit).count();
    let count = digits(text);
    let (first, mut rest) = text.split_at_checked(count)?;
    let mut fields: [i128; 3] = [0; 3];
    if count == 6 {
        for (field, at) in fields.iter_mut().zip([0, 2, 4]) {
            *field = first.get(at..at + 2)?.parse().ok()?;
        }
    } else {
        if !(1..=3).contains(&count) {
            return None;
        }
        fields[0] = first.parse().ok()?;
        let mut found = 1;
        while found < 3 {
            let Some(after) = rest.strip_prefix(':') else {
                break;
            };
            let count = digits(after);
            if count == 0 || count > 2 {
                return None;
            }
            let (number, after) = after.split_at_checked(count)?;
            fields[found] = number.parse().ok()?;
            rest = after;
            found += 1;
        }
        if found < 2 {
            return None;
        }
    }
    let mut fraction = 0;
    if let Some(after) = rest.strip_prefix(['.', ',', ':']) {
        let count = digits(after);
        let (number, after) = after.split_at_checked(count)?;
        for (place, digit) in number.bytes().take(9).enumerate() {
            fraction += i128::from(digit - b'0') * 10_i128.pow(8 - u32::try_from(place).ok()?);
        }
        rest = after;
    }
    let trimmed = rest.trim_start();
    let half = trimmed.get(..2).map(str::to_ascii_uppercase);
    match half.as_deref() {
        Some("AM") => {
            fields[0] %= 12;
            rest = trimmed.get(2..)?;
        }
        Some("PM") => {
            fields[0] = fields[0] % 12 + 12;
            rest = trimmed.get(2..)?;
        }
        _ => {}
    }
    let [hours, minutes, seconds] = fields;
    // 60 is a leap second.
    (minutes < 60 && seconds <= 60).then_some((
        ((hours * 60 + minutes) * 60 + seconds) * SECOND + fraction,
        rest,
    ))
}

/// `Z`, `UTC`, `+01:00`, `-0500`, or nothing; in seconds.
fn read_offset(text: &str) -> Option<Option<i128>> {
    // A zone in brackets repeats the offset: 2026-11-23T10:00:00+01:00[Europe/Berlin].
    let text = text.split('[').next().unwrap_or_default().trim();
    if text.is_empty() {
        return Some(None);
    }
    if matches!(text, "Z" | "z" | "UTC" | "GMT") {
        return Some(Some(0));
    }
    let text = text
        .strip_prefix("UTC")
        .or(text.strip_prefix("GMT"))
        .unwrap_or(text);
    let sign = match text.as_bytes().first()? {
        b'+' => 1,
        b'-' => -1,
        _ => return None,
    };
    let number: String = text.get(1..)?.chars().filter(|c| *c != ':').collect();
    let value: i128 = number.parse().ok()?;
    match number.len() {
        1 | 2 => Some(Some(sign * value * 3600)),
        4 => Some(Some(sign * (value / 100 * 3600 + value % 100 * 60))),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_moment_in_many_forms() {
        for text in [
            "2026-11-23T10:05:00.25Z",
            "2026-11-23 10:05:00.250",
            "2026/11/23 10:05:00.25",
            "23.11.2026 10:05:00,250",
            "23.11.26 10:05:00,250",
            "11/23/2026 10:05:00.25 AM",
            "23/11/2026 10:05:00:250",
            "23-Nov-2026 10:05:00.25",
            "Nov 23, 2026 10:05:00.25",
            "20261123T100500.25",
            "2026-11-23T11:05:00.25+01:00",
            "Mon 23 Nov 2026 10:05:00.25",
            "2026-11-23T05:05:00.25-0500",
            "2026-11-23T11:05:00,25+01:00[Europe/Berlin]",
            "2026-11-23_10:05:00.25",
        ] {
            let format = Format::of([text].into_iter()).unwrap_or_else(|| panic!("{text}"));
            let found = format.nanoseconds(text).unwrap_or_else(|| panic!("{text}"));
            assert_eq!(iso(found), "2026-11-23 10:05:00.25", "{text}");
        }
        let clock = Format::of(["10:00:00.5"].into_iter()).unwrap();
        assert_eq!(clock.nanoseconds("10:00:00.5"), Some(36_000_500_000_000));
        let noon = Format::of(["11/23/2026 12:00:01 PM"].into_iter()).unwrap();
        assert_eq!(
            iso(noon.nanoseconds("11/23/2026 12:00:01 PM").unwrap()),
            "2026-11-23 12:00:01"
        );
    }

    #[test]
    fn the_column_decides_on_the_order() {
        let of = |cells: &[&str]| Format::of(cells.iter().copied());
        assert_eq!(
            of(&["01/02/2026 10:00", "01/13/2026 10:00"]).unwrap().order,
            Some(Order::MonthDayYear)
        );
        assert_eq!(
            of(&["01/02/2026 10:00", "13/02/2026 10:00"]).unwrap().order,
            Some(Order::DayMonthYear)
        );
        let vague = of(&["01/02/2026 10:00"]).unwrap();
        assert!(vague.ambiguous);
        assert!(!of(&["01.02.2026 10:00"]).unwrap().ambiguous);
        assert_eq!(of(&["01/13/2026 10:00", "13/01/2026 10:00"]), None);
    }

    #[test]
    fn what_is_no_stamp() {
        for text in [
            "",
            "monday",
            "1.5",
            "12",
            "-3",
            "1e5",
            "a:b",
            "10:99:00",
            "V",
            "2026-13-45 10:00",
            "--",
        ] {
            let found = Format::of([text].into_iter()).and_then(|f| f.nanoseconds(text));
            assert_eq!(found, None, "{text}");
        }
    }
}
