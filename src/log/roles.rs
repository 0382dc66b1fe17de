//! Which column is an input, an output, the time.

use std::collections::HashMap;

use super::log_error::LogError;
use super::sample_time::is_sample_time;
use super::text::{Channel, Header};

/// What the user asked for: `--inputs`, `--outputs`, `--time`, `--dt`. The default leaves all to the headers.
///
/// How the rows are read beside that: `--missing`, `--resample`, `--time-unit`.
///
/// A name matches a header with or without the unit in brackets (`force` finds `force [N]`), with the same case if it
/// can be, in any case if only one column fits. What is not asked for goes by the header: u or U starts an input, y or
/// Y an output, `t` or `time` is the time.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize)]
pub struct Roles {
    /// Input columns, in the order wanted.
    pub inputs: Option<Vec<String>>,
    /// Output columns, in the order wanted.
    pub outputs: Option<Vec<String>>,
    /// The time column; seconds, unless the header says `[ms]`, `[us]`, `[ns]`, `[min]` or `[h]`.
    pub time: Option<String>,
    /// Sample time in seconds; when given, rows follow each other at it, and the time column may not contradict it.
    pub sample_time: Option<f64>,
    /// What is done about samples that are missing.
    #[serde(skip_serializing_if = "Missing::is_auto")]
    pub missing: Missing,
    /// Sample time in seconds of a uniform grid that the rows are put on, without aliases.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub resample: Option<f64>,
    /// Unit of the time column, whatever its header says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_unit: Option<TimeUnit>,
}

/// What is done about samples that are missing: rows that are not there, cells that are empty or NaN.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Missing {
    /// Up to two in a row are interpolated, at more the recording is split into several.
    #[default]
    Auto,
    /// An error.
    Error,
    /// The recording is split at every one.
    Split,
    /// All are interpolated.
    Interpolate,
    /// Outputs stay missing, as NaN: for equations, which are compared with what was measured only. Inputs are interpolated
    /// up to two in a row, the recording is split at more; at irregular times they are held.
    Keep,
}

impl Missing {
    fn is_auto(&self) -> bool {
        *self == Self::Auto
    }
}

/// Unit of a time column.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[allow(missing_docs, reason = "the names say it")]
#[serde(rename_all = "lowercase")]
pub enum TimeUnit {
    Seconds,
    Milliseconds,
    Microseconds,
    Nanoseconds,
    Minutes,
    Hours,
    Days,
}

impl TimeUnit {
    /// Seconds in the unit.
    pub fn seconds(self) -> f64 {
        match self {
            Self::Seconds => 1.0,
            Self::Milliseconds => 1e-3,
            Self::Microseconds => 1e-6,
            Self::Nanoseconds => 1e-9,
            Self::Minutes => 60.0,
            Self::Hours => 3600.0,
            Self::Days => 86_400.0,
        }
    }

    /// The unit by the sign that a header or a flag has for it.
    pub fn parse(text: &str) -> Option<Self> {
        Some(match text.trim().to_lowercase().as_str() {
            "s" | "sec" | "secs" | "second" | "seconds" => Self::Seconds,
            "ms" | "msec" | "millis" | "milliseconds" => Self::Milliseconds,
            "us" | "µs" | "μs" | "usec" | "micros" | "microseconds" => Self::Microseconds,
            "ns" | "nsec" | "nanos" | "nanoseconds" => Self::Nanoseconds,
            "min" | "mins" | "minute" | "minutes" => Self::Minutes,
            "h" | "hr" | "hrs" | "hour" | "hours" => Self::Hours,
            "d" | "day" | "days" => Self::Days,
            _ => return None,
        })
    }

    /// The unit at the end of a name: `time_ms`, `t_sec`, `epoch_ns`; or of a name that is a unit: `Seconds`.
    pub(super) fn of_name(name: &str) -> Option<Self> {
        match name.rsplit_once(['_', '-', '.']) {
            Some((_, last)) => Self::parse(last),
            None => Self::of_word(name),
        }
    }

    /// The unit that a word spells out. `min` is more often a minimum, `s` and `d` are letters.
    fn of_word(word: &str) -> Option<Self> {
        let word = word.trim().to_lowercase();
        let spelled = word.ends_with('s') && word.len() > 3 || word == "sec";
        Self::parse(&word).filter(|_| spelled)
    }
}

impl std::fmt::Display for TimeUnit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Seconds => "s",
            Self::Milliseconds => "ms",
            Self::Microseconds => "us",
            Self::Nanoseconds => "ns",
            Self::Minutes => "min",
            Self::Hours => "h",
            Self::Days => "d",
        })
    }
}

/// What `--time` says when no column is to be read as the time, and `--inputs` when there are none.
pub(super) const NO_TIME: &str = "none";
const NO_INPUTS: &str = "none";

impl Roles {
    /// Inputs and outputs by name, as a model names them.
    pub fn named(inputs: &[Channel], outputs: &[Channel]) -> Self {
        let names = |channels: &[Channel]| Some(channels.iter().map(ToString::to_string).collect());
        Self {
            inputs: names(inputs),
            outputs: names(outputs),
            ..Self::default()
        }
    }
}

impl Roles {
    /// Whether no column is to be the time: `--time none`, unless a column is called so.
    fn is_timeless(&self, header: &Header) -> Result<bool, LogError> {
        Ok(self.time.as_deref() == Some(NO_TIME) && find(header, NO_TIME)?.is_none())
    }

    /// Whether there are no inputs: `--inputs none`, unless a column is called so.
    fn is_free(&self, header: &Header) -> Result<bool, LogError> {
        let asked = self.inputs.as_deref();
        let is_none = |name: &String| matches!(name.trim(), NO_INPUTS | "");
        let none = asked.is_some_and(|names| names.iter().all(is_none));
        Ok(none && find(header, NO_INPUTS)?.is_none())
    }
}

/// Which roles the caller cannot do without.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum RoleNeed {
    /// Inputs and outputs, at least one of each.
    #[default]
    Identify,
    /// Inputs; outputs are not read.
    InputsOnly,
    /// Outputs; inputs are not read (a simulation's answer).
    OutputsOnly,
    /// Inputs, and the outputs if the file has all of them: one that is missing means that none is read.
    InputsAndMaybeOutputs,
    /// Outputs, and the inputs if there are any: none where they are called `none`, and where no column is left for them.
    OutputsAndMaybeInputs,
}

/// Indices of the columns with a role.
#[derive(Debug, PartialEq)]
pub(super) struct Assigned {
    pub(super) inputs: Vec<usize>,
    pub(super) outputs: Vec<usize>,
    pub(super) time: Option<usize>,
}

/// Finds the columns that `roles` and `need` ask for.
pub(super) fn assign(roles: &Roles, need: RoleNeed, header: &Header) -> Result<Assigned, LogError> {
    if let Some(sample_time) = roles.sample_time.filter(|dt| !is_sample_time(*dt)) {
        return Err(LogError::InvalidSampleTime { sample_time });
    }
    let timeless = roles.is_timeless(header)?;
    let asked_time = roles
        .time
        .as_deref()
        .filter(|_| !timeless)
        .map(|asked| known(header, asked))
        .transpose()?;
    let wants_inputs = need != RoleNeed::OutputsOnly;
    let wants_outputs = need != RoleNeed::InputsOnly;

    let maybe_inputs = need == RoleNeed::OutputsAndMaybeInputs;
    let mut inputs = match maybe_inputs && roles.is_free(header)? {
        true => Some(Vec::new()),
        false => asked_columns(header, roles.inputs.as_deref(), wants_inputs)?,
    };
    let free_of_inputs = inputs.as_ref().is_some_and(Vec::is_empty);
    let strict = matches!(
        need,
        RoleNeed::Identify | RoleNeed::OutputsOnly | RoleNeed::OutputsAndMaybeInputs
    );
    let mut outputs = asked_columns(header, roles.outputs.as_deref(), strict)?;
    if need == RoleNeed::InputsAndMaybeOutputs {
        let asked = roles.outputs.as_ref().map_or(0, Vec::len);
        outputs = outputs.map(|found| {
            if found.len() == asked {
                found
            } else {
                Vec::new()
            }
        });
    }
    // Columns asked for in any role are not candidates for a default, even where that role is not read.
    let taken: Vec<usize> = asked_time
        .into_iter()
        .chain(inputs.iter().flatten().copied())
        .chain(outputs.iter().flatten().copied())
        .collect();
    let time = asked_time.or_else(|| default_time(header, &taken).filter(|_| !timeless));
    let free = |index: &usize| !taken.contains(index) && Some(*index) != time;
    let starting_with = |letters: [char; 2]| -> Vec<usize> {
        let starts = |index: &usize| {
            header
                .channels
                .get(*index)
                .is_some_and(|c| c.name.starts_with(letters))
        };
        (0..header.channels.len())
            .filter(starts)
            .filter(free)
            .collect()
    };
    let inputs = if wants_inputs {
        inputs.take().unwrap_or_else(|| starting_with(['u', 'U']))
    } else {
        Vec::new()
    };
    let outputs = if wants_outputs {
        outputs.take().unwrap_or_else(|| starting_with(['y', 'Y']))
    } else {
        Vec::new()
    };

    let (no_inputs, no_outputs) = (inputs.is_empty(), outputs.is_empty());
    match need {
        RoleNeed::Identify | RoleNeed::OutputsAndMaybeInputs if no_inputs && no_outputs => {
            return Err(no_roles(header, time, need));
        }
        RoleNeed::InputsOnly | RoleNeed::InputsAndMaybeOutputs
            if no_inputs && roles.inputs.is_none() =>
        {
            return Err(no_roles(header, time, need));
        }
        RoleNeed::OutputsOnly if no_outputs && roles.outputs.is_none() => {
            return Err(no_roles(header, time, need));
        }
        _ => {}
    }
    let (name, headers) = (header.name.clone(), header.list());
    let is_left = |index: usize| !outputs.contains(&index) && Some(index) != time;
    let left = (0..header.channels.len()).any(is_left);
    if wants_inputs && no_inputs && !(maybe_inputs && (free_of_inputs || !left)) {
        let example = match maybe_inputs {
            true => "--inputs a,b`, or say that there are none: `--inputs none",
            false => "--inputs a,b",
        };
        return Err(LogError::NoInputs {
            name,
            headers,
            example: example.to_owned(),
        });
    }
    if strict && no_outputs {
        return Err(LogError::NoOutputs {
            name,
            headers,
            example: "--outputs c".to_owned(),
        });
    }
    if time.is_none() && roles.sample_time.is_none() {
        return Err(LogError::NoTime { name, headers });
    }
    let assigned = Assigned {
        inputs,
        outputs,
        time,
    };
    assigned.check_distinct(header)?;
    Ok(assigned)
}

impl Assigned {
    /// Refuses a column with two roles, and two columns with one name (a model could not tell them apart).
    fn check_distinct(&self, header: &Header) -> Result<(), LogError> {
        let role = |role: &'static str, columns: &[usize]| {
            columns.iter().map(|c| (role, *c)).collect::<Vec<_>>()
        };
        let mut all = role("input", &self.inputs);
        all.extend(role("output", &self.outputs));
        all.extend(self.time.map(|column| ("time", column)));
        let mut columns: HashMap<usize, &'static str> = HashMap::new();
        let mut names: HashMap<&str, usize> = HashMap::new();
        for (second, b) in all {
            if let Some(first) = columns.insert(b, second) {
                let (name, column) = (header.name.clone(), header.column(b));
                return Err(LogError::ColumnGivenTwice {
                    name,
                    column,
                    first,
                    second,
                });
            }
            let Some(channel) = header.channels.get(b) else {
                continue;
            };
            if let Some(a) = names.insert(&channel.name, b) {
                return Err(header.duplicate(a, b));
            }
        }
        Ok(())
    }
}

/// The columns asked for; those not found are left out unless `strict`.
fn asked_columns(
    header: &Header,
    asked: Option<&[String]>,
    strict: bool,
) -> Result<Option<Vec<usize>>, LogError> {
    let Some(asked) = asked else { return Ok(None) };
    let mut columns = Vec::with_capacity(asked.len());
    for name in asked {
        if strict {
            columns.push(known(header, name)?);
        } else {
            columns.extend(find(header, name)?);
        }
    }
    Ok(Some(columns))
}

/// The column called `asked`, or an error that lists the headers.
fn known(header: &Header, asked: &str) -> Result<usize, LogError> {
    find(header, asked)?.ok_or_else(|| {
        let suggestion = if header.headerless {
            " (the file has no header: columns go by number, from 1)".to_owned()
        } else {
            closest(header, asked)
                .map(|header| format!(" (did you mean `{header}`?)"))
                .unwrap_or_default()
        };
        let (name, column, headers) = (header.name.clone(), asked.to_owned(), header.list());
        LogError::UnknownColumn {
            name,
            column,
            suggestion,
            headers,
        }
    })
}

/// The column that `asked` names, if there is one and only one.
fn find(header: &Header, asked: &str) -> Result<Option<usize>, LogError> {
    let asked = asked.trim();
    let channel = Channel::parse(asked);
    let passes: [&dyn Fn(&Channel) -> bool; 3] = [
        &|candidate| *candidate == channel && (channel.unit.is_some() || candidate.unit.is_none()),
        &|candidate| candidate.answers_to(&channel, false),
        // `t` is the time, and no temperature.
        &|candidate| candidate.name != "t" && candidate.answers_to(&channel, true),
    ];
    for pass in passes {
        let mut found = header
            .channels
            .iter()
            .enumerate()
            .filter(|(_, c)| !c.name.is_empty() && pass(c));
        let Some((first, channel)) = found.next() else {
            continue;
        };
        let Some((second, other)) = found.next() else {
            return Ok(Some(first));
        };
        if channel == other {
            return Err(header.duplicate(first, second));
        }
        let matches = [channel, other].into_iter().chain(found.map(|(_, c)| c));
        let matches = matches
            .map(|c| format!("`{c}`"))
            .collect::<Vec<_>>()
            .join(", ");
        return Err(LogError::AmbiguousColumn {
            name: header.name.clone(),
            column: asked.to_owned(),
            matches,
        });
    }
    Ok(None)
}

/// `t`, else `time` in any case, else another usual name of it, else `T` (which is more often a temperature), with or
/// without a unit.
fn default_time(header: &Header, taken: &[usize]) -> Option<usize> {
    if header.headerless {
        return None;
    }
    let named = |fits: &dyn Fn(&str) -> bool| {
        header
            .channels
            .iter()
            .enumerate()
            .position(|(index, c)| fits(&c.name) && !taken.contains(&index))
    };
    named(&|name| name == "t")
        .or_else(|| named(&|name| name.eq_ignore_ascii_case("time")))
        .or_else(|| named(&is_usual_time))
        .or_else(|| named(&|name| name == "T"))
}

/// `t`, `time`, `Time_s`, `timestamp`, `epoch_ms`, `Zeit`, `Seconds` and the like.
pub(super) fn is_usual_time(name: &str) -> bool {
    if name == "t" || name.eq_ignore_ascii_case("time") || TimeUnit::of_word(name).is_some() {
        return true;
    }
    let bare = match TimeUnit::of_name(name) {
        Some(_) => name
            .rsplit_once(['_', '-', '.'])
            .map_or(name, |(bare, _)| bare),
        None => name,
    };
    let word: String = bare
        .to_lowercase()
        .chars()
        .filter(|c| c.is_alphanumeric())
        .collect();
    (bare != name && (word == "t" || word == "time"))
        || matches!(
            word.as_str(),
            "timestamp"
                | "datetime"
                | "date"
                | "zeit"
                | "zeitstempel"
                | "epoch"
                | "unixtime"
                | "elapsed"
                | "elapsedtime"
                | "testtime"
        )
}

/// Most bytes of names in an example of what to type.
const LONGEST_EXAMPLE: usize = 1000;

/// The error that shows what to type, made of the file's own headers: the last column as output, the rest as inputs.
fn no_roles(header: &Header, time: Option<usize>, need: RoleNeed) -> LogError {
    let quote = |text: &str| {
        let plain = text
            .chars()
            .all(|c| c.is_alphanumeric() || "_-.,/".contains(c));
        if plain {
            text.to_owned()
        } else {
            format!("'{text}'")
        }
    };
    let mut names: Vec<&str> = Vec::new();
    for (index, channel) in header.channels.iter().enumerate() {
        if Some(index) != time && !channel.name.is_empty() {
            names.push(&channel.name);
        }
    }
    let mut example = String::new();
    if header.headerless && names.len() > 2 {
        names.remove(0);
        example.push_str("--time 1 ");
    }
    // Of many columns the example picks none.
    let short = names.iter().map(|name| name.len()).sum::<usize>() < LONGEST_EXAMPLE;
    let (inputs, output) = match names.split_last() {
        Some((last, rest)) if !rest.is_empty() && short => (rest.join(","), (*last).to_owned()),
        _ => ("a,b".to_owned(), "c".to_owned()),
    };
    example.push_str(&match need {
        RoleNeed::OutputsAndMaybeInputs if names.len() == 1 => {
            format!("--outputs {}", quote(names[0]))
        }
        RoleNeed::Identify | RoleNeed::OutputsAndMaybeInputs => {
            format!("--inputs {} --outputs {}", quote(&inputs), quote(&output))
        }
        RoleNeed::OutputsOnly => format!("--outputs {}", quote(&output)),
        RoleNeed::InputsOnly | RoleNeed::InputsAndMaybeOutputs => {
            format!("--inputs {}", quote(&inputs))
        }
    });
    LogError::NoRoles {
        name: header.name.clone(),
        headers: header.list(),
        hint: header.hint(),
        example,
    }
}

/// The header nearest to `asked` by edit distance, if it is near enough to be a slip.
fn closest<'a>(header: &'a Header, asked: &str) -> Option<&'a Channel> {
    let asked = Channel::parse(asked).name.to_lowercase();
    // One letter in the place of another says nothing where there is only one.
    let allowed = match asked.chars().count() {
        0 | 1 => 0,
        length => (length / 3).max(1),
    };
    let distances = header
        .channels
        .iter()
        .filter(|c| !c.name.is_empty())
        .map(|channel| {
            let name = channel.name.to_lowercase();
            let part = asked.len() > 2
                && (name.contains(&asked) || (name.len() > 2 && asked.contains(&name)));
            (
                if part {
                    1
                } else {
                    edit_distance(&asked, &name)
                },
                channel,
            )
        });
    distances
        .min_by_key(|(distance, _)| *distance)
        .filter(|(distance, _)| *distance <= allowed)
        .map(|(_, c)| c)
}

/// Levenshtein distance in characters.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, from) in a.chars().enumerate() {
        let mut previous = i + 1;
        let mut next = vec![previous];
        for ((to, diagonal), above) in b.iter().zip(&row).zip(row.iter().skip(1)) {
            previous = (diagonal + usize::from(from != *to))
                .min(above + 1)
                .min(previous + 1);
            next.push(previous);
        }
        row = next;
    }
    row.last().copied().unwrap_or(0)
}
