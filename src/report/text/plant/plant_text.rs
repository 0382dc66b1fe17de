//! A plant in equations, for people: what was read, and what was estimated.

use super::plant_validation_text::{initial_state_text, residual_test_table};
use crate::physics::{ModelSpec, Plant, Unknown, Variable, VariableKind, unit_conflicts};
use crate::report::PlantDocument;
use crate::report::plant::FitDocument;
use crate::report::text::number::{percent, significant, with_std};
use crate::report::text::table::Table;
use crate::report::text::{Style, wrapped};

/// Longest equation that is shown whole.
const LONGEST: usize = 66;
/// Level at which a test of residuals is said to fail.
const LEVEL: f64 = 0.01;
/// A linear model that leaves less than this share of the plant's error holds what the equations do not.
const FOLLOWS_BETTER: f64 = 0.8;
/// In innovation form, an error of the free run above so many one-step errors is said.
const FREE_RUN_APART: f64 = 2.0;

/// The plant as read: states, inputs, outputs, parameters, sorted equations, and an equilibrium.
pub fn plant_text(plant: &Plant) -> String {
    let spec = &plant.spec;
    let mut out = format!("{}{}\n", spec.name, described(&spec.description));
    let start = plant.start(&plant.nominal());
    let states = spec.states();
    let mut table = Table::new([
        "name",
        "unit",
        "start",
        "certain",
        "min",
        "max",
        "description",
    ])
    .flush_left(1)
    .flush_left(3)
    .flush_left(6);
    for (&v, start) in states.iter().zip(start) {
        let v = spec.variable(v);
        let certain = if v.fixed { "yes" } else { "" };
        let [name, unit, min, max, description] = cells(v);
        let start = significant(start, 6);
        table.row([name, unit, start, certain.to_owned(), min, max, description]);
    }
    out += &titled("States", &table);
    for (title, variables) in [("Inputs", spec.inputs()), ("Outputs", spec.outputs())] {
        let mut table = Table::new(["name", "unit", "min", "max", "description"])
            .flush_left(1)
            .flush_left(4);
        for v in variables {
            table.row(cells(spec.variable(v)));
        }
        out += &titled(title, &table);
    }
    let mut table = Table::new(["name", "value", "unit", "min", "max", "description"])
        .flush_left(2)
        .flush_left(5);
    for (v, value) in spec
        .parameters()
        .into_iter()
        .zip(plant.nominal().parameters)
    {
        let [name, unit, min, max, description] = cells(spec.variable(v));
        table.row([name, significant(value, 6), unit, min, max, description]);
    }
    out += &titled("Parameters that may be estimated", &table);
    let mut table = Table::new(["name", "value", "unit", "description"])
        .flush_left(2)
        .flush_left(3);
    for v in spec.of_kind(VariableKind::Constant) {
        let v = spec.variable(v);
        let [name, unit, _, _, description] = cells(v);
        let value = v.number.map_or(String::new(), |n| significant(n, 6));
        table.row([name, value, unit, description]);
    }
    out += &titled(
        "Constants, and parameters that are certain or follow from others",
        &table,
    );
    out += "\nEquations, in the order in which they are computed\n";
    let mut table = Table::new(["determines", "from", "line"]).flush_left(1);
    for equation in &spec.equations {
        let what = match equation.unknown {
            Unknown::Derivative(v) => format!("der({})", spec.variable(v).name),
            Unknown::Value(v) => spec.variable(v).name.clone(),
        };
        let line = 1 + spec
            .text
            .get(..equation.span.start)
            .map_or(0, |t| t.matches('\n').count());
        let text = squeezed(spec, equation.span.start, equation.span.end);
        let text = if text.chars().count() > LONGEST {
            text.chars().take(LONGEST).collect::<String>() + "..."
        } else {
            text
        };
        table.row([what, text, line.to_string()]);
    }
    out += &table.lines();
    out += &agreement(spec);
    out += &equilibrium(plant);
    out
}

/// A table under its title; nothing where it has no rows.
fn titled(title: &str, table: &Table) -> String {
    if table.is_empty() {
        return String::new();
    }
    format!("\n{title}\n{}", table.lines())
}

/// Name, unit, lower and upper bound, description.
fn cells(v: &Variable) -> [String; 5] {
    let bound = |b: f64| {
        if b.is_finite() {
            significant(b, 6)
        } else {
            String::new()
        }
    };
    let unit = v.unit_text.clone().unwrap_or_default();
    let description = v.description.clone();
    [
        v.name.clone(),
        unit,
        bound(v.min),
        bound(v.max),
        description,
    ]
}

/// Whether the units agree, and what was not compared.
fn agreement(spec: &ModelSpec) -> String {
    const LISTED: usize = 8;
    let conflicts = unit_conflicts(spec).len();
    let mut said = match conflicts {
        _ if spec.variables.iter().all(|v| v.unit.is_none()) => "Units were not checked".to_owned(),
        0 => "Units agree".to_owned(),
        1 => "1 unit conflict".to_owned(),
        n => format!("{n} unit conflicts"),
    };
    let without = spec.variables.iter().filter(|v| v.unit_text.is_none());
    let unknown = spec
        .variables
        .iter()
        .filter(|v| v.unit_text.is_some() && v.unit.is_none());
    for (names, what) in [
        (
            without.map(|v| v.name.as_str()).collect::<Vec<_>>(),
            "no unit",
        ),
        (
            unknown.map(|v| v.name.as_str()).collect(),
            "a unit that is not known",
        ),
    ] {
        let (s, verb) = match names.len() {
            0 => continue,
            1 => ("", "has"),
            _ => ("s", "have"),
        };
        let shown = names
            .iter()
            .take(LISTED)
            .copied()
            .collect::<Vec<_>>()
            .join(", ");
        let more = if names.len() > LISTED { ", ..." } else { "" };
        said += &format!(
            "; {} variable{s} {verb} {what} and fit{} everything: {shown}{more}",
            names.len(),
            if names.len() == 1 { "s" } else { "" }
        );
    }
    format!("\n{}", wrapped("", &said))
}

fn described(text: &str) -> String {
    if text.is_empty() {
        String::new()
    } else {
        format!(": {text}")
    }
}

/// A part of the text on one line.
fn squeezed(spec: &ModelSpec, from: usize, to: usize) -> String {
    let text = spec.text.get(from..to).unwrap_or_default();
    text.split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
        .trim_end_matches(';')
        .to_owned()
}

fn equilibrium(plant: &Plant) -> String {
    let spec = &plant.spec;
    let (states, inputs) = (spec.states(), spec.inputs());
    if states.is_empty() {
        return String::new();
    }
    let point = plant.nominal();
    let still = plant.equilibrium(&point, &plant.start(&point), &vec![0.0; inputs.len()]);
    let list = |values: &[f64]| {
        let each = states
            .iter()
            .zip(values)
            .map(|(&v, x)| format!("{} = {}", spec.variable(v).name, significant(*x, 6)));
        each.collect::<Vec<_>>().join(", ")
    };
    let within = |x: &Vec<f64>| {
        states
            .iter()
            .zip(x)
            .all(|(&v, x)| *x >= spec.variable(v).min && *x <= spec.variable(v).max)
    };
    match still.filter(within) {
        Some(x) => format!("\nEquilibrium with inputs 0\n{}", wrapped("  ", &list(&x))),
        None => "\nWith inputs 0 no equilibrium was found from the start values.\n".to_owned(),
    }
}

/// What was estimated.
pub fn plant_estimate_text(document: &PlantDocument, title: &str, style: Style) -> String {
    let mut out = wrapped("", &verdict(document, title));
    if !document.parameters.is_empty() {
        out += "\nParameters\n";
        out += &parameter_table(document, style).lines();
    }
    for message in &document.undetermined {
        out += &wrapped("  ! ", message);
    }
    out += &initial_state_text(&document.initial_states, style);
    out += "\nFit in free run\n";
    out += &plant_fit_table(document).lines();
    out += "\nResiduals\n";
    out += &residual_test_table(&document.residual_tests).lines();
    if let Some(simulator) = &document.simulator {
        out += &format!("\n{}", wrapped("", &simulator.said()));
    }
    out
}

/// The estimated parameters.
pub(crate) fn parameter_table(document: &PlantDocument, style: Style) -> Table {
    let in_text = match document.simulator {
        None => "in the text",
        Some(_) => "given",
    };
    let mut table = Table::new(["name", "estimate", "unit", "95 % interval", in_text, ""])
        .flush_left(2)
        .flush_left(5);
    for p in &document.parameters {
        let end = |e: Option<f64>| e.map_or("open".to_owned(), |e| significant(e, 6));
        let [low, high] = p.interval_95.unwrap_or([None, None]);
        table.row([
            p.name.clone(),
            with_std(Some(p.value), p.std, style),
            p.unit.clone().unwrap_or_default(),
            format!("{} to {}", end(low), end(high)),
            p.text_value.map_or(String::new(), |v| significant(v, 6)),
            if p.at_bound { "at its bound" } else { "" }.to_owned(),
        ]);
    }
    table
}

/// Fits in free run.
fn plant_fit_table(document: &PlantDocument) -> Table {
    let of_text = match document.simulator {
        None => "values of the text",
        Some(_) => "values given",
    };
    let mut table = Table::new([
        "output",
        "estimated",
        "rms error",
        "held out",
        of_text,
        "best linear model",
        "its order",
    ]);
    for f in &document.fit {
        table.row([
            f.output.clone(),
            percent(f.free_run_percent),
            significant(f.rms_error, 4),
            f.held_out_percent.map_or(String::new(), percent),
            f.text_percent.map_or(String::new(), percent),
            f.linear_model_percent.map_or(String::new(), percent),
            f.linear_model_order
                .map_or(String::new(), |n| n.to_string()),
        ]);
    }
    table
}

/// The headline: the form, what the residuals and the free run say of the equations, and what is open.
pub(crate) fn verdict(document: &PlantDocument, title: &str) -> String {
    let tests = &document.residual_tests;
    let level = LEVEL / tests.len().max(1) as f64;
    let fails = |question: &str| {
        let mut asked = tests.iter().filter(|t| t.question == question);
        asked.any(|t| t.p_value < level)
    };
    let depends = fails("inputs") || fails("products");
    let innovation = document.form == "innovation";
    let form = if innovation {
        "in innovation form (an observer corrects the states at each sample)"
    } else {
        "in free run"
    };
    let residuals = match (depends, fails("white")) {
        (true, _) => "the residuals depend on the inputs or on the outputs that they cause",
        (_, true) => "the residuals are not white: standard deviations may be too small",
        _ if innovation => "the one-step residuals are white and do not depend on the inputs",
        _ => "the residuals are white and do not depend on the inputs",
    };
    let mut out = vec![residuals.to_owned()];
    // The observer hides in one-step residuals what the free run shows.
    let followed = innovation.then(|| worst_followed(document)).flatten();
    if let Some(f) = followed {
        out.push(format!(
            "but the free run follows `{}` by {} only (rms error {}{})",
            f.output,
            percent(f.free_run_percent),
            significant(f.rms_error, 3),
            times(f, document),
        ));
    }
    let better = better_linear_model(document);
    if let Some((f, linear)) = better {
        out.push(format!(
            "a linear model of order {} follows `{}` better in free run, {} instead of {}",
            f.linear_model_order.unwrap_or(0),
            f.output,
            percent(linear),
            percent(f.free_run_percent)
        ));
    }
    let leave = match document.simulator {
        None => "the equations leave",
        Some(_) => "the simulator leaves",
    };
    let either = if depends || better.is_some() {
        Some("")
    } else {
        followed.map(|_| "either disturbances enter the states, or ")
    };
    if let Some(either) = either {
        out.push(format!(
            "{either}{leave} something out; see `innovant explain`"
        ));
    }
    if !document.undetermined.is_empty() {
        out.push("not every parameter is determined".to_owned());
    }
    let count = document.parameters.len();
    let s = if count == 1 { "" } else { "s" };
    format!(
        "{title}: {count} parameter{s} estimated {form}; {}",
        out.join("; ")
    )
}

#[cfg(feature = "report")]
/// Whether the equations leave something out: a test of the residuals fails, or a linear model follows clearly better.
pub(crate) fn leaves_something_out(document: &PlantDocument) -> bool {
    super::plant_validation_text::tests_fail(&document.residual_tests)
        || better_linear_model(document).is_some()
}

/// How many times the free run's error is larger than the one-step error.
fn times(f: &FitDocument, document: &PlantDocument) -> String {
    let noise = document.noise.iter().find(|n| n.output == f.output);
    noise.map_or(String::new(), |n| {
        let ratio = significant(f.rms_error / n.innovation_std, 2);
        format!(", {ratio} times the one-step error")
    })
}

/// The output that the free run follows worst, where its error is well above the one-step residual.
fn worst_followed(document: &PlantDocument) -> Option<&FitDocument> {
    let ratio = |f: &FitDocument| {
        let noise = document.noise.iter().find(|n| n.output == f.output);
        noise.map_or(0.0, |n| f.rms_error / n.innovation_std)
    };
    let apart = document.fit.iter().filter(|f| ratio(f) > FREE_RUN_APART);
    apart.max_by(|a, b| ratio(a).total_cmp(&ratio(b)))
}

/// An output that the best linear model follows clearly better, with its fit.
fn better_linear_model(document: &PlantDocument) -> Option<(&FitDocument, f64)> {
    let each = document
        .fit
        .iter()
        .filter_map(|f| Some((f, f.linear_model_percent?)));
    let mut better =
        each.filter(|(f, linear)| (100.0 - linear) < FOLLOWS_BETTER * (100.0 - f.free_run_percent));
    better.next()
}
