//! Poles, zeros and gains.

use std::f64::consts::TAU;

use crate::covariance::{Root, StaticGain};
use crate::log::Channel;
use crate::report::text::number::{significant, with_std};
use crate::report::text::table::Table;
use crate::report::text::{Style, WIDTH};

/// Poles as natural frequency, damping and time constant; a line for each pair, at most so many.
pub(crate) fn poles(title: &str, roots: &[Root], most: usize, style: Style) -> String {
    if roots.is_empty() {
        return String::new();
    }
    let more = roots.iter().filter(|root| root.imag >= 0.0).count();
    format!(
        "\n{title}\n{}{}",
        pole_table(roots, most, style).lines(),
        and_more(more, most)
    )
}

/// The same as a table.
pub(crate) fn pole_table(roots: &[Root], most: usize, style: Style) -> Table {
    pole_table_of(roots, most, style, kind)
}

#[cfg(feature = "cli")]
/// Poles in the `s` plane.
pub(crate) fn continuous_pole_table(roots: &[Root], style: Style) -> Table {
    pole_table_of(roots, usize::MAX, style, |root| {
        let word = match (root.imag == 0.0, root.damping) {
            (true, None) => "integrator",
            (true, _) => "real",
            (false, _) => "pair",
        };
        match root.time_constant_s.is_some_and(|t| t < 0.0) {
            true => format!("{word}, unstable"),
            false => word.to_owned(),
        }
    })
}

fn pole_table_of(
    roots: &[Root],
    most: usize,
    style: Style,
    kind: impl Fn(&Root) -> String,
) -> Table {
    let mut table = Table::new([
        "",
        "natural frequency [Hz]",
        "[rad/s]",
        "damping",
        "time constant [s]",
    ]);
    for root in roots.iter().filter(|root| root.imag >= 0.0).take(most) {
        table.row([
            kind(root),
            with_std(root.natural_frequency_hz, root.natural_frequency_std, style),
            with_std(
                root.natural_frequency_hz.map(|f| f * TAU),
                root.natural_frequency_std.map(|f| f * TAU),
                style,
            ),
            if root.imag == 0.0 {
                String::new()
            } else {
                with_std(root.damping, root.damping_std, style)
            },
            with_std(root.time_constant_s, root.time_constant_std, style),
        ]);
    }
    table
}

/// Says that a list was cut.
fn and_more(count: usize, most: usize) -> String {
    match count.saturating_sub(most) {
        0 => String::new(),
        more => format!("  and {more} more, which `innovant show` lists\n"),
    }
}

/// What a pole is, in a word.
fn kind(root: &Root) -> String {
    let modulus = root.real.hypot(root.imag);
    let word = match (root.imag == 0.0, root.damping) {
        (true, None) => "integrator",
        (true, _) if modulus == 0.0 => "delay",
        (true, _) if root.real < 0.0 => "alternating",
        (true, _) => "real",
        (false, _) => "pair",
    };
    if modulus > 1.0 && root.damping.is_some() {
        format!("{word}, unstable")
    } else {
        word.to_owned()
    }
}

/// Zeros in the `z` plane: most zeros of a sampled model are not those of the plant, so their place says more
/// than their frequency.
pub(crate) fn zeros(title: &str, zeros: &[Root], style: Style) -> String {
    if zeros.is_empty() {
        return String::new();
    }
    let mut table = Table::new(["", "real part", "imaginary part", "modulus"]);
    for zero in zeros.iter().filter(|zero| zero.imag >= 0.0) {
        let std = |index: usize| zero.covariance.map(|c| c[index][index].max(0.0).sqrt());
        let pair = zero.imag != 0.0;
        table.row([
            if pair { "pair" } else { "real" }.to_owned(),
            with_std(Some(zero.real), std(0), style),
            if pair {
                with_std(Some(zero.imag), std(1), style)
            } else {
                String::new()
            },
            significant(zero.real.hypot(zero.imag), 4),
        ]);
    }
    format!("\n{title}\n{}", table.lines())
}

/// Static gains, a line for each path, at most so many.
pub(super) fn static_gains(
    title: &str,
    gains: &[StaticGain],
    most: usize,
    inputs: &[Channel],
    outputs: &[Channel],
    style: Style,
) -> String {
    let table = gain_table(gains, most, inputs, outputs, style);
    if table.is_empty() {
        return String::new();
    }
    format!(
        "\n{title}\n{}{}",
        table.lines(),
        and_more(gains.len(), most)
    )
}

/// The same as a table.
pub(crate) fn gain_table(
    gains: &[StaticGain],
    most: usize,
    inputs: &[Channel],
    outputs: &[Channel],
    style: Style,
) -> Table {
    let mut table = Table::new(["from", "to", "gain", ""])
        .flush_left(1)
        .flush_left(3);
    let unit = |channels: &[Channel], name: &str| {
        channels
            .iter()
            .find(|c| c.name == name)
            .and_then(|c| c.unit.clone())
    };
    for gain in gains.iter().take(most) {
        let units = match (unit(outputs, &gain.output), unit(inputs, &gain.input)) {
            (None, None) => String::new(),
            (Some(output), None) => format!("{output} per unit"),
            (Some(output), Some(input)) if input == output => String::new(),
            (output, Some(input)) => {
                format!("{} per {input}", output.as_deref().unwrap_or("unit"))
            }
        };
        table.row([
            shortened(&gain.input),
            shortened(&gain.output),
            gain.value
                .map_or("infinite (integrator)".to_owned(), |value| {
                    with_std(Some(value), gain.standard_deviation, style)
                }),
            shortened(&units),
        ]);
    }
    table
}

/// A name that leaves room for the numbers.
pub(crate) fn shortened(name: &str) -> String {
    const LONGEST: usize = WIDTH / 5;
    if name.chars().count() <= LONGEST {
        name.to_owned()
    } else {
        name.chars()
            .take(LONGEST - 3)
            .chain("...".chars())
            .collect()
    }
}
