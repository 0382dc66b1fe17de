//! Units of hours and days in equations that run in seconds.

use super::Unit;
use super::check::{SizeConflict, size_conflicts};
use super::compare::{rounded, slow_time};
use crate::physics::error::{excerpt, position, shortened};
use crate::physics::expression::{ExpressionId, Node, VariableId};
use crate::physics::spec::{ModelSpec, VariableKind};
use std::fmt;

/// Seconds in a minute, an hour and a day, minutes in a day, hours in a day.
const CLOCKS: [f64; 5] = [60.0, 3600.0, 86_400.0, 1440.0, 24.0];
/// A conversion differs from one of these times a power of ten by less than this part.
const ROUNDED: f64 = 1e-3;
/// Variables that are listed.
const MOST_LISTED: usize = 4;

/// Parts of an equation of which one counts time in minutes, hours or days.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct OtherClock {
    /// Where it stands.
    pub(crate) line: usize,
    /// Column, counted from 1.
    pub(crate) column: usize,
    message: String,
}

impl fmt::Display for OtherClock {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

/// The first part of a plant that counts time in another unit than seconds, if there is one.
///
/// Units say so where both sides of an equation have them, and differ by a conversion of time. Where a side has none, a time constant
/// or rate in minutes, hours or days says so in a text without any number that converts it.
pub(crate) fn other_clock(spec: &ModelSpec) -> Option<OtherClock> {
    let found = size_conflicts(spec).into_iter();
    found
        .filter(|c| converts_time(c.sizes[0] / c.sizes[1]))
        .find_map(|c| conflict(spec, &c))
        .or_else(|| unconverted(spec))
}

/// Whether a factor is one of time, perhaps with another prefix: l/min and m3/s, km/h and m/s.
fn converts_time(factor: f64) -> bool {
    let power_of_ten = |v: f64| {
        let digits = v.log10();
        (10f64.powf(digits - digits.round()) - 1.0).abs() < ROUNDED
    };
    CLOCKS
        .iter()
        .any(|c| power_of_ten(factor / c) || power_of_ten(factor * c))
}

/// Whether a number of the text may convert times, perhaps with a thousand: 3600, 3.6.
fn is_conversion(number: f64) -> bool {
    let is = |expected: f64| (number / expected - 1.0).abs() < ROUNDED;
    CLOCKS.iter().any(|c| is(*c) || is(c * 1e3) || is(c * 1e-3))
}

fn conflict(spec: &ModelSpec, found: &SizeConflict) -> Option<OtherClock> {
    let slow = found.parts.map(|part| slow_variables(spec, part));
    // The side that is in hours, the right one where both are.
    let side = (0..2).rev().find(|&side| !slow[side].is_empty())?;
    let mut listed: Vec<VariableId> = Vec::new();
    for &v in slow.iter().flatten() {
        if !listed.contains(&v) {
            listed.push(v);
        }
    }
    let factor = found.sizes[side] / found.sizes[1 - side];
    let remedy = match factor < 1.0 {
        true => format!("divide it by {}", rounded(1.0 / factor)),
        false => format!("multiply it by {}", rounded(factor)),
    };
    let part = excerpt(&spec.text, spec.expressions.span(found.parts[side]));
    let whole = excerpt(&spec.text, found.at);
    let message = format!(
        "`{whole}`: a plant runs in seconds, and {}: the factor {} is missing; `{part}`: {remedy}, or give these in seconds",
        list(spec, &listed),
        rounded(factor.max(1.0 / factor)),
    );
    let (line, column) = position(&spec.text, found.at.start);
    Some(OtherClock {
        line,
        column,
        message,
    })
}

/// `k` is in d, `rain` in mm/d.
fn list(spec: &ModelSpec, variables: &[VariableId]) -> String {
    let each = variables.iter().take(MOST_LISTED).map(|&v| {
        let v = spec.variable(v);
        let unit = v.unit_text.as_deref().unwrap_or("");
        (shortened(&v.name), shortened(unit))
    });
    let mut said = String::new();
    for (name, unit) in each {
        said += &match said.is_empty() {
            true => format!("`{name}` is in {unit}"),
            false => format!(", `{name}` in {unit}"),
        };
    }
    said
}

/// Variables in an expression whose units have minutes, hours or days.
fn slow_variables(spec: &ModelSpec, root: ExpressionId) -> Vec<VariableId> {
    let all = spec.expressions.variables(root).into_iter();
    all.filter(|&v| is_slow(spec, v)).collect()
}

fn is_slow(spec: &ModelSpec, v: VariableId) -> bool {
    let unit = spec.variable(v).unit_text.as_deref();
    unit.is_some_and(|unit| slow_time(unit).is_some())
}

/// A parameter in hours beside a derivative, where units do not say whether it is converted.
fn unconverted(spec: &ModelSpec) -> Option<OtherClock> {
    let time = |v: VariableId| {
        let unit = spec.variable(v).unit;
        unit.is_some_and(|u| {
            u.same(&Unit::SECOND) || u.power(-1.0).is_some_and(|u| u.same(&Unit::SECOND))
        })
    };
    // 1/min is a speed.
    let constant = |v: VariableId| {
        let text = spec.variable(v).unit_text.as_deref().unwrap_or("");
        time(v) && is_slow(spec, v) && (slow_time(text) != Some("min") || text.trim() == "min")
    };
    // Hours that are no time constants: a clock.
    let clock = |&v: &VariableId| spec.variable(v).kind != VariableKind::Parameter && time(v);
    let mut all = (0..spec.variables.len()).map(|i| VariableId(i as u32));
    if all.any(|v| clock(&v)) || numbers(&spec.text).any(is_conversion) {
        return None;
    }
    let (equation, v) = spec.equations.iter().find_map(|e| {
        let sides = [e.left, e.right];
        let moves = sides.iter().any(|&side| has_derivative(spec, side));
        let mut slow = sides.iter().flat_map(|&side| slow_variables(spec, side));
        let of = slow.find(|&v| constant(v) && spec.variable(v).kind == VariableKind::Parameter);
        of.filter(|_| moves).map(|v| (e, v))
    })?;
    let whole = excerpt(&spec.text, equation.span);
    let text = spec.variable(v).unit_text.as_deref().unwrap_or("");
    let seconds = match slow_time(text) {
        Some("min") => "60",
        Some("h" | "hr") => "3600",
        _ => "86400",
    };
    let (line, column) = position(&spec.text, equation.span.start);
    Some(OtherClock {
        line,
        column,
        message: format!(
            "`{whole}`: a plant runs in seconds, and {}: no factor of {seconds} is in the text; write it into the equation, or give \
             the parameter in seconds",
            list(spec, &[v])
        ),
    })
}

fn has_derivative(spec: &ModelSpec, root: ExpressionId) -> bool {
    let mut waiting = vec![root];
    while let Some(id) = waiting.pop() {
        let node = spec.expressions.node(id);
        if matches!(node, Node::Derivative(_)) {
            return true;
        }
        waiting.extend(node.operands());
    }
    false
}

/// The numbers of a text.
fn numbers(text: &str) -> impl Iterator<Item = f64> {
    let in_number = |c: char| c.is_ascii_digit() || c == '.';
    text.split(move |c: char| !in_number(c))
        .filter_map(|part| part.trim_matches('.').parse().ok())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::parse;

    fn said(variables: &str, equations: &str) -> Option<String> {
        let text = format!("model M {variables} equation {equations} end M;");
        other_clock(&parse(&text).unwrap()).map(|c| c.to_string())
    }

    const STORE: &str = "parameter Real k(unit=\"d\") = 20; input Real r(unit=\"mm/d\"); output Real y(unit=\"mm\"); Real S(unit=\"mm\");";

    #[test]
    fn a_rate_in_days_is_told_with_its_factor() {
        let said = said(STORE, "der(S) = r - S/k; y = S;").unwrap();
        assert!(
            said.contains("`r` is in mm/d, `k` in d: the factor 86400"),
            "{said}"
        );
        assert!(said.contains("`r - S/k`: divide it by 86400"), "{said}");
    }

    #[test]
    fn other_conversions_of_time_are_told() {
        for (variables, equations, words) in [
            (
                "parameter Real C(unit=\"kW.h/K\") = 5; input Real P(unit=\"kW\"); output Real T(unit=\"K\");",
                "C*der(T) = P;",
                "`C*der(T)`: multiply it by 3600",
            ),
            (
                "parameter Real C(unit=\"kWh/K\") = 5; input Real P(unit=\"kW\"); output Real T(unit=\"K\");",
                "C*der(T) = P;",
                "`C*der(T)`: multiply it by 3600",
            ),
            (
                "input Real q(unit=\"l/min\"); output Real V(unit=\"m3\");",
                "der(V) = q;",
                "divide it by 60000",
            ),
            (
                "input Real v(unit=\"km/h\"); output Real x(unit=\"m\");",
                "der(x) = v;",
                "divide it by 3.6",
            ),
            // Without units of the state.
            (
                "parameter Real k(unit=\"h\") = 2; input Real u; output Real x;",
                "k*der(x) = u - x;",
                "no factor of 3600 is in the text",
            ),
        ] {
            let said = said(variables, equations).unwrap_or_default();
            assert!(said.contains(words), "{equations}: {said}");
        }
    }

    #[test]
    fn sound_plants_are_left_alone() {
        for (variables, equations) in [
            (STORE, "86400*der(S) = r - S/k; y = S;"),
            (STORE, "der(S) = (r - S/k)/86400; y = S;"),
            (STORE, "der(S) = (r - S/k)/(24*3600); y = S;"),
            (
                "parameter Real Q(unit=\"A.h\") = 5; input Real i(unit=\"A\"); output Real s;",
                "3600*Q*der(s) = -i;",
            ),
            (
                "parameter Real Q(unit=\"A.h\") = 5; constant Real hour(unit=\"s/h\") = 3600; input Real i(unit=\"A\"); output Real s(unit=\"1\");",
                "hour*Q*der(s) = -i;",
            ),
            (
                "parameter Real k(unit=\"d\") = 5; constant Real day = 86400; input Real u; output Real x;",
                "day*k*der(x) = u - x;",
            ),
            // A limit of a speed, not a rate.
            (
                "parameter Real most(unit=\"km/h\") = 50; input Real v(unit=\"km/h\"); output Real y; Real x;",
                "der(x) = -x; y = if v > most then x else 0;",
            ),
            // A clock.
            (
                "parameter Real from(unit=\"h\") = 7; input Real hour(unit=\"h\"); output Real x;",
                "der(x) = (if hour > from then 1 else 0) - x;",
            ),
            (
                "parameter Real n0(unit=\"1/min\") = 50; input Real n(unit=\"1/min\"); output Real x;",
                "der(x) = (n - n0) - x;",
            ),
            (
                "parameter Real tau(unit=\"s\") = 50; input Real u(unit=\"kW\"); output Real x(unit=\"W\");",
                "tau*der(x) = u - x;",
            ),
        ] {
            assert_eq!(said(variables, equations), None, "{equations}");
        }
    }
}
