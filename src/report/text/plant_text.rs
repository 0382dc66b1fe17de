//! A plant in equations, for people: what was read, and what was estimated.

use super::number::{percent, significant, with_std};
use super::plant_validation_text::{initial_state_text, residual_test_table};
use super::table::Table;
use super::{Style, wrapped};
use crate::physics::{ModelSpec, Plant, Unknown, VariableKind};
use crate::report::PlantDocument;

/// Longest equation that is shown whole.
const LONGEST: usize = 66;
/// Level at which a test of residuals is said to fail.
const LEVEL: f64 = 0.01;
/// A linear model that leaves less than this share of the plant's error holds what the equations do not.
const FOLLOWS_BETTER: f64 = 0.8;

/// The plant as read: states, inputs, outputs, parameters, sorted equations, and an equilibrium.
pub fn plant_text(plant: &Plant) -> String {
    let spec = &plant.spec;
    let mut out = format!("{}{}\n", spec.name, described(&spec.description));
    for (title, kind) in [
        ("States", VariableKind::State),
        ("Inputs", VariableKind::Input),
    ] {
        let variables: Vec<_> = spec.of_kind(kind).collect();
        if variables.is_empty() {
            continue;
        }
        out += &format!("\n{title}\n");
        let mut table = Table::new(["name", "unit", "start", "certain", "description"])
            .flush_left(1)
            .flush_left(3)
            .flush_left(4);
        let starts = plant.start(&plant.nominal());
        for (i, &v) in variables.iter().enumerate() {
            let v = spec.variable(v);
            let state = kind == VariableKind::State;
            table.row([
                v.name.clone(),
                v.unit_text.clone().unwrap_or_default(),
                if state {
                    significant(starts[i], 6)
                } else {
                    String::new()
                },
                if state && v.fixed { "yes" } else { "" }.to_owned(),
                v.description.clone(),
            ]);
        }
        out += &table.lines();
    }
    out += "\nOutputs\n";
    let mut table = Table::new(["name", "unit", "description"])
        .flush_left(1)
        .flush_left(2);
    for v in spec.outputs() {
        let v = spec.variable(v);
        table.row([
            v.name.clone(),
            v.unit_text.clone().unwrap_or_default(),
            v.description.clone(),
        ]);
    }
    out += &table.lines();
    let parameters = spec.parameters();
    if !parameters.is_empty() {
        out += "\nParameters that may be estimated\n";
        let mut table = Table::new(["name", "value", "unit", "min", "max", "description"])
            .flush_left(2)
            .flush_left(5);
        for (&v, value) in parameters.iter().zip(plant.nominal().parameters) {
            let v = spec.variable(v);
            let bound = |b: f64| {
                if b.is_finite() {
                    significant(b, 6)
                } else {
                    String::new()
                }
            };
            table.row([
                v.name.clone(),
                significant(value, 6),
                v.unit_text.clone().unwrap_or_default(),
                bound(v.min),
                bound(v.max),
                v.description.clone(),
            ]);
        }
        out += &table.lines();
    }
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
            text.chars().take(LONGEST).collect::<String>() + " ..."
        } else {
            text
        };
        table.row([what, text, line.to_string()]);
    }
    out += &table.lines();
    out += &equilibrium(plant);
    out
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
    out
}

/// The estimated parameters.
pub(crate) fn parameter_table(document: &PlantDocument, style: Style) -> Table {
    let mut table = Table::new([
        "name",
        "estimate",
        "unit",
        "95 % interval",
        "in the text",
        "",
    ])
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
    let mut table = Table::new([
        "output",
        "estimated",
        "rms error",
        "values of the text",
        "best linear model",
        "its order",
    ]);
    for f in &document.fit {
        table.row([
            f.output.clone(),
            percent(f.free_run_percent),
            significant(f.rms_error, 4),
            f.text_percent.map_or(String::new(), percent),
            f.linear_model_percent.map_or(String::new(), percent),
            f.linear_model_order
                .map_or(String::new(), |n| n.to_string()),
        ]);
    }
    table
}

/// The headline.
pub(crate) fn verdict(document: &PlantDocument, title: &str) -> String {
    let failed: Vec<&str> = document
        .residual_tests
        .iter()
        .filter(|t| t.p_value < LEVEL / document.residual_tests.len().max(1) as f64)
        .map(|t| t.question.as_str())
        .collect();
    let in_free_run = document.form != "innovation";
    let better = document.fit.iter().filter(|_| in_free_run).find(|f| {
        f.linear_model_percent
            .is_some_and(|l| (100.0 - l) < FOLLOWS_BETTER * (100.0 - f.free_run_percent))
    });
    let form = match document.form.as_str() {
        "innovation" => {
            "in innovation form (an observer with a constant gain: the noise enters the states, or the plant integrates)"
        }
        _ => "in free run",
    };
    let what = if let (Some(f), Some(linear)) =
        (better, better.and_then(|f| f.linear_model_percent))
    {
        format!(
            "a linear model of order {} follows `{}` better, {} instead of {}: the equations leave something out; see \
             `innovant explain`",
            f.linear_model_order.unwrap_or(0),
            f.output,
            percent(linear),
            percent(f.free_run_percent)
        )
    } else if failed.contains(&"inputs") || failed.contains(&"products") {
        "the residuals depend on the inputs or on the outputs that they cause: the equations leave something out; see \
         `innovant explain`"
            .to_owned()
    } else if failed.contains(&"white") {
        "the residuals are not white: standard deviations may be too small".to_owned()
    } else {
        "the residuals are white and do not depend on the inputs".to_owned()
    };
    let count = document.parameters.len();
    let s = if count == 1 { "" } else { "s" };
    let open = if document.undetermined.is_empty() {
        ""
    } else {
        "; not every parameter is determined"
    };
    format!("{title}: {count} parameter{s} estimated {form}; {what}{open}")
}
