//! How much memory a request may take: asked before anything of that size is allocated.
//!
//! Whoever knows how large the arrays of a request become estimates their sum and calls [`check`], which refuses what
//! is beyond the limit of the process: what [`set_memory_limit`] says (`--memory-limit` on the command line), else the
//! environment variable `INNOVANT_MEMORY`, else half of the memory that this machine or control group has. Half,
//! because the estimates are within a factor of two of the measured peaks (`tests/limits.rs`).
//!
//! | request | who estimates |
//! |---|---|
//! | a model from recordings | `identify::data::memory_need` |
//! | a recording held in memory | `log::Log`, as it is read |
//! | what a simulation leaves out | `explain::memory` |

use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// The environment variable with the limit.
pub(crate) const VARIABLE: &str = "INNOVANT_MEMORY";
/// Where neither the machine nor the control group says how much memory there is.
const UNKNOWN_MACHINE: u64 = 4 << 30;

/// What [`set_memory_limit`] was told; zero is nothing.
static ASKED: AtomicU64 = AtomicU64::new(0);

/// A limit, and who set it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MemoryLimit {
    /// Bytes.
    pub bytes: u64,
    /// Where it comes from.
    pub origin: Origin,
}

/// Who set a limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// The request itself: an option of its own, or its share in a batch.
    Request,
    /// The caller, with [`set_memory_limit`] or `--memory-limit`.
    Asked,
    /// The environment variable `INNOVANT_MEMORY`.
    Environment,
    /// Half of what the machine or the control group has.
    Machine,
    /// Nobody: the machine does not say what it has.
    Unknown,
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Request => "for this one",
            Self::Asked => "as asked for",
            Self::Environment => "by INNOVANT_MEMORY",
            Self::Machine => "half of what this machine has",
            Self::Unknown => "this machine does not say what it has",
        })
    }
}

/// A request that is refused, or a limit that cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LimitError {
    /// More memory than allowed.
    #[error(
        "{what} would need about {} of memory, and the limit is {} ({}); {advice}, or raise the limit with \
         --memory-limit or {VARIABLE}", size(*.needed), size(.limit.bytes), .limit.origin
    )]
    TooLarge {
        /// The request.
        what: String,
        /// Bytes that it would need.
        needed: u64,
        /// What there is.
        limit: MemoryLimit,
        /// How to need less.
        advice: String,
    },
    /// The environment variable is no size.
    #[error("{VARIABLE} is `{value}`: {reason}")]
    Variable {
        /// Its value.
        value: String,
        /// What is wrong with it.
        reason: String,
    },
}

/// Sets the limit of this process in bytes; `None` takes it back to the environment's or the machine's.
pub fn set_memory_limit(bytes: Option<u64>) {
    ASKED.store(bytes.unwrap_or(0), Ordering::Relaxed);
}

/// The limit of this process.
///
/// # Errors
/// [`LimitError::Variable`] when `INNOVANT_MEMORY` is needed and no size.
pub(crate) fn memory_limit() -> Result<MemoryLimit, LimitError> {
    let of = |bytes, origin| Ok(MemoryLimit { bytes, origin });
    let asked = ASKED.load(Ordering::Relaxed);
    if asked > 0 {
        return of(asked, Origin::Asked);
    }
    if let Some(value) = std::env::var_os(VARIABLE) {
        let value = value.to_string_lossy().into_owned();
        return match parse_size(&value) {
            Ok(bytes) => of(bytes, Origin::Environment),
            Err(reason) => Err(LimitError::Variable { value, reason }),
        };
    }
    match [machine(), control_group()].into_iter().flatten().min() {
        Some(bytes) => of(bytes / 2, Origin::Machine),
        None => of(UNKNOWN_MACHINE, Origin::Unknown),
    }
}

/// Refuses a request that needs more than the limit of this process, or more than `own` bytes where the request has a
/// limit of its own. `what` begins the message; `advice` says how to need less, as an order to the reader.
///
/// # Errors
/// [`LimitError`].
pub(crate) fn check(
    needed: u64,
    own: Option<u64>,
    what: impl FnOnce() -> String,
    advice: impl FnOnce() -> String,
) -> Result<(), LimitError> {
    let limit = match own {
        Some(bytes) => MemoryLimit {
            bytes,
            origin: Origin::Request,
        },
        None => memory_limit()?,
    };
    if needed <= limit.bytes {
        return Ok(());
    }
    Err(LimitError::TooLarge {
        what: what(),
        needed,
        limit,
        advice: advice(),
    })
}

/// Bytes from a number with a unit: `8G`, `500MB`, `1.5GiB`; `K`, `M`, `G`, `T` are powers of 1000, `Ki` and so on of
/// 1024, no unit is bytes.
///
/// # Errors
/// Says what is expected.
pub fn parse_size(text: &str) -> Result<u64, String> {
    let help = || "expected a size such as 500M, 8G or 1.5GiB".to_owned();
    let text = text.trim();
    let digits = text
        .find(|c: char| !(c.is_ascii_digit() || c == '.'))
        .unwrap_or(text.len());
    let (number, unit) = text.split_at(digits);
    let number: f64 = number.parse().map_err(|_| help())?;
    let unit = unit.trim().to_ascii_lowercase();
    let bare = unit.strip_suffix('b').unwrap_or(&unit);
    let (letter, base) = match bare.strip_suffix('i') {
        Some(letter) => (letter, 1024_f64),
        None => (bare, 1000_f64),
    };
    let power = match letter {
        "" if base == 1000.0 => 0,
        "k" => 1,
        "m" => 2,
        "g" => 3,
        "t" => 4,
        _ => return Err(help()),
    };
    let bytes = number * base.powi(power);
    if bytes >= 1.0 && bytes < u64::MAX as f64 {
        Ok(bytes as u64)
    } else {
        Err(help())
    }
}

/// Bytes for people.
pub(crate) fn size(bytes: u64) -> String {
    let units = ["kB", "MB", "GB", "TB", "PB", "EB"];
    let mut value = bytes as f64 / 1e3;
    let mut unit = 0;
    while value >= 999.5 && unit + 1 < units.len() {
        value /= 1e3;
        unit += 1;
    }
    let digits = if value < 9.95 { 1 } else { 0 };
    format!("{value:.digits$} {}", units[unit])
}

/// Bytes of `values` numbers; as many as can be counted where that overflows.
pub(crate) fn of_numbers(factors: &[usize]) -> u64 {
    factors
        .iter()
        .fold(size_of::<f64>() as u64, |product, factor| {
            product.saturating_mul(*factor as u64)
        })
}

/// Memory of the machine (Linux).
fn machine() -> Option<u64> {
    let text = fs::read_to_string("/proc/meminfo").ok()?;
    total_of(&text)
}

/// `MemTotal` of `/proc/meminfo`, which is in kibibytes.
fn total_of(meminfo: &str) -> Option<u64> {
    let line = meminfo
        .lines()
        .find_map(|line| line.strip_prefix("MemTotal:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kibibytes.checked_mul(1024)
}

/// The smallest limit of the control groups that this process is in (Linux): containers have one.
fn control_group() -> Option<u64> {
    let groups = fs::read_to_string("/proc/self/cgroup").ok()?;
    let limit = |file: &Path| -> Option<u64> { fs::read_to_string(file).ok()?.trim().parse().ok() };
    files_of(&groups)
        .iter()
        .filter_map(|file| limit(file))
        .min()
}

/// Where the limits of these groups and the groups around them stand: version 2 first, then version 1. A group as seen
/// from inside a container may have no directory there, and its root is the container's own then.
fn files_of(groups: &str) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for line in groups.lines() {
        let mut fields = line.splitn(3, ':').skip(1);
        let (Some(controllers), Some(group)) = (fields.next(), fields.next()) else {
            continue;
        };
        let (root, file) = match controllers {
            "" => ("/sys/fs/cgroup", "memory.max"),
            _ if controllers.split(',').any(|c| c == "memory") => {
                ("/sys/fs/cgroup/memory", "memory.limit_in_bytes")
            }
            _ => continue,
        };
        let group = Path::new(group.trim_start_matches('/'));
        files.extend(
            group
                .ancestors()
                .map(|group| Path::new(root).join(group).join(file)),
        );
    }
    files
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_and_written() {
        for (text, bytes) in [
            ("8G", 8_000_000_000),
            ("500MB", 500_000_000),
            ("1.5GiB", 1_610_612_736),
            ("64 k", 64_000),
            ("2Ki", 2048),
            ("123", 123),
        ] {
            assert_eq!(parse_size(text), Ok(bytes), "{text}");
        }
        for text in [
            "",
            "G",
            "-1G",
            "0",
            "8X",
            "1e9",
            "1..2G",
            "iB",
            "99999999999T",
            "NaN",
        ] {
            assert!(parse_size(text).is_err(), "{text}");
        }
        for (bytes, text) in [
            (500, "0.5 kB"),
            (1_049_000, "1.0 MB"),
            (999_700, "1.0 MB"),
            (3_200_000_000, "3.2 GB"),
            (47_000_000_000, "47 GB"),
        ] {
            assert_eq!(size(bytes), text);
        }
    }

    #[test]
    fn what_is_beyond_the_limit_is_refused_with_numbers() {
        let ask = |needed| {
            check(
                needed,
                Some(2_000_000_000),
                || "this".into(),
                || "do less".into(),
            )
        };
        assert_eq!(ask(2_000_000_000), Ok(()));
        assert_eq!(
            ask(3_200_000_000).unwrap_err().to_string(),
            "this would need about 3.2 GB of memory, and the limit is 2.0 GB (for this one); do less, or raise the \
             limit with --memory-limit or INNOVANT_MEMORY"
        );
    }

    #[test]
    fn the_machine_and_its_groups_are_read() {
        assert_eq!(
            total_of("MemTotal:       24689764 kB\nMemFree: 1 kB\n"),
            Some(25_282_318_336)
        );
        assert_eq!(total_of("MemFree: 1 kB\n"), None);
        let files = |groups: &str| -> Vec<String> {
            files_of(groups)
                .iter()
                .map(|f| f.display().to_string())
                .collect()
        };
        assert_eq!(
            files("0::/a/b\n"),
            [
                "/sys/fs/cgroup/a/b/memory.max",
                "/sys/fs/cgroup/a/memory.max",
                "/sys/fs/cgroup/memory.max"
            ]
        );
        assert_eq!(
            files("5:cpu:/x\n4:memory,hugetlb:/x\n"),
            [
                "/sys/fs/cgroup/memory/x/memory.limit_in_bytes",
                "/sys/fs/cgroup/memory/memory.limit_in_bytes"
            ]
        );
    }

    #[test]
    fn sizes_that_overflow_are_as_large_as_can_be() {
        assert_eq!(of_numbers(&[10, 3]), 240);
        assert_eq!(of_numbers(&[usize::MAX, usize::MAX, 2]), u64::MAX);
    }
}
