//! What a term is called at the place where it was found.

use crate::physics::{ModelSpec, Node, Unknown, VariableId, VariableKind};

use super::edit::Place;
use super::library::Port;
use super::search::Fitted;

/// What kind of quantity an argument is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Position,
    Velocity,
    Temperature,
    Other,
}

/// The state whose derivative is defined as this variable: `der(x) = v`.
fn defines(spec: &ModelSpec, v: VariableId) -> bool {
    spec.equations.iter().any(|e| {
        matches!(e.unknown, Unknown::Derivative(_))
            && e.coefficient.is_none()
            && spec.expressions.node(e.rest) == Node::Variable(v)
    })
}

fn kind(spec: &ModelSpec, variables: &[VariableId]) -> Kind {
    let unit = |v: VariableId| spec.variable(v).unit_text.as_deref().unwrap_or("");
    let all =
        |of: &dyn Fn(VariableId) -> bool| !variables.is_empty() && variables.iter().all(|&v| of(v));
    let moves = spec
        .states()
        .iter()
        .any(|&v| defines(spec, v) || matches!(unit(v), "m/s" | "rad/s"));
    if all(&|v| defines(spec, v) || matches!(unit(v), "m/s" | "rad/s" | "rpm" | "rev/min")) {
        Kind::Velocity
    } else if moves && all(&|v| matches!(unit(v), "m" | "rad" | "deg" | "mm")) {
        Kind::Position
    } else if all(&|v| matches!(unit(v), "K" | "degC")) {
        Kind::Temperature
    } else {
        Kind::Other
    }
}

/// Whether a variable is in no equation of the plant.
fn unused(spec: &ModelSpec, v: VariableId) -> bool {
    !spec.expressions.any(|n| *n == Node::Variable(v))
}

/// The id of what was found in a plant; `law` for a function that has no name there.
pub(crate) fn named(spec: &ModelSpec, found: &Fitted) -> &'static str {
    let term = found.lead.term;
    let variables: Vec<VariableId> = found.depends.iter().filter_map(|n| spec.find(n)).collect();
    let what = kind(spec, &variables);
    let own = found.lead.place.variable(spec);
    let unit_of_place = spec.variable(own).unit_text.as_deref().unwrap_or("");
    match (term.port, term.id) {
        (Port::Sensor, id) => id,
        (Port::Input, "input_square" | "input_cube") => "input_curve",
        (Port::Input, id) => id,
        (Port::Parameter, "parameter_step" | "parameter_ramp") => "parameter_change",
        (Port::Parameter, "parameter_heating") if unit_of_place == "Ohm" => {
            "temperature_dependent_resistance"
        }
        (Port::Parameter, "parameter_curve" | "parameter_square") => match what {
            Kind::Temperature if unit_of_place == "Ohm" => "temperature_dependent_resistance",
            Kind::Position => "position_dependent_gain",
            _ => "law",
        },
        (Port::Equation, "signed_square") if what == Kind::Velocity => "quadratic_drag",
        (Port::Equation, "cube") => match what {
            Kind::Velocity => "cubic_drag",
            Kind::Position => "cubic_stiffness",
            _ => "law",
        },
        (Port::Equation, "square" | "signed_square") if what == Kind::Position => {
            "quadratic_stiffness"
        }
        (Port::Equation, "friction") if what == Kind::Velocity => "coulomb_friction",
        (Port::Equation, "stribeck") if what == Kind::Velocity => "stribeck_friction",
        (Port::Equation, "one_sided") if what == Kind::Velocity => "asymmetric_damping",
        (Port::Equation, "above" | "below" | "both_sides") => match what {
            Kind::Position => "end_stop",
            Kind::Other if variables == [own] => "overflow",
            _ => "law",
        },
        (Port::Equation, "root_above") if variables == [own] => "overflow",
        (Port::Equation, "root") if variables == [own] => "leak",
        (Port::Equation, "sine") => "cogging",
        (Port::Equation, "radiation") => "radiation",
        (Port::Equation, "natural_convection") if what == Kind::Temperature => "natural_convection",
        (Port::Equation, "load_constant" | "load_ramp" | "load_step") => {
            let output =
                spec.variable(own).output && spec.variable(own).kind == VariableKind::Algebraic;
            match (output, term.id) {
                (true, "load_ramp") => "sensor_drift",
                (true, _) => "sensor_offset",
                (false, _) => "load_step",
            }
        }
        (Port::Equation, "linear") => {
            if variables.iter().any(|&v| unused(spec, v)) {
                "missing_input"
            } else if variables.len() > 1 {
                let heated = variables
                    .iter()
                    .any(|&v| kind(spec, &[v]) == Kind::Temperature);
                if heated {
                    "temperature_dependent_resistance"
                } else {
                    "law"
                }
            } else {
                "cross_coupling"
            }
        }
        _ => "law",
    }
}

/// How specific a term is: of two that explain a recording equally well the one with a name of its own is meant.
pub(crate) fn rank(spec: &ModelSpec, found: &Fitted) -> u8 {
    let place = match found.lead.place {
        Place::Equation(_) | Place::Input(_) => 0,
        Place::Parameter(_) => 1,
    };
    match named(spec, found) {
        "load_step" if found.lead.term.id != "load_step" => 3 + place,
        "law" | "cross_coupling" => 4 + place,
        "input_curve" | "parameter_change" => 2 + place,
        _ => place,
    }
}
