//! What a term is called at the place where it was found.

use crate::physics::{Binary, Equation, ModelSpec, Node, Unknown, VariableId, VariableKind};

use crate::explain::engine::fitting::edit::{Place, user_of};
use crate::explain::engine::fitting::fitted::Fitted;
use crate::explain::engine::terms::library::{TERMS, TIMES};
use crate::explain::engine::terms::term::{Needs, Port, Term};

/// What kind of quantity an argument is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Position,
    Velocity,
    Temperature,
    Other,
    /// It has no unit: it is what the effect needs.
    Unknown,
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
    let unit = |v: VariableId| unit_of(spec, v);
    let all =
        |of: &dyn Fn(VariableId) -> bool| !variables.is_empty() && variables.iter().all(|&v| of(v));
    let moves = spec
        .states()
        .iter()
        .any(|&v| defines(spec, v) || is_of_speed(unit(v)));
    // Of a position only the velocity need be known: `der(x) = v` with a state `v`. A length may be a level; an angle is a position, and
    // so is a length with a rate that is a product.
    let states = spec.states();
    let moves_by = |x: VariableId| {
        spec.equations.iter().any(|e| {
            e.unknown == Unknown::Derivative(x)
                && e.coefficient.is_none()
                && matches!(spec.expressions.node(e.rest), Node::Variable(v) if states.contains(&v))
        })
    };
    if all(&|v| defines(spec, v) || is_of_speed(unit(v))) {
        Kind::Velocity
    } else if all(&moves_by)
        || moves && all(&|v| matches!(unit(v), "m" | "mm"))
        || all(&|v| matches!(unit(v), "rad" | "deg"))
        || all(&|v| matches!(unit(v), "m" | "mm") && is_driven_only(spec, v))
    {
        Kind::Position
    } else if all(&|v| matches!(unit(v), "K" | "degC" | "degF")) {
        Kind::Temperature
    } else if all(&|v| spec.variable(v).unit_text.is_none()) {
        Kind::Unknown
    } else {
        Kind::Other
    }
}

/// Whether the rate of a state is a product without the state, as of a drive: a store has flows in and out.
fn is_driven_only(spec: &ModelSpec, state: VariableId) -> bool {
    let own = |e: &&Equation| e.unknown == Unknown::Derivative(state);
    spec.equations.iter().find(own).is_some_and(|e| {
        let is_sum = |node| matches!(node, Node::Binary(Binary::Add | Binary::Subtract, ..));
        let used = spec.expressions.variables(e.rest);
        !used.contains(&state) && !spec.expressions.contains(e.rest, &is_sum)
    })
}

/// Whether a unit is one of a speed.
fn is_of_speed(unit: &str) -> bool {
    matches!(
        unit,
        "m/s"
            | "cm/s"
            | "mm/s"
            | "km/h"
            | "kn"
            | "rad/s"
            | "deg/s"
            | "rpm"
            | "rev/min"
            | "r/min"
            | "1/min"
    )
}

/// Whether no variable of a plant has a unit.
pub(in crate::explain::engine) fn is_without_units(spec: &ModelSpec) -> bool {
    spec.variables.iter().all(|v| v.unit_text.is_none())
}

/// Whether a term slows the motion that it is a function of: without units, its own state is a velocity then.
fn slows(term: &Term) -> bool {
    matches!(term.id, "signed_square" | "cube" | "friction" | "one_sided")
}

/// Whether these may be velocities.
pub(in crate::explain::engine) fn may_be_velocity(
    spec: &ModelSpec,
    variables: &[VariableId],
) -> bool {
    matches!(kind(spec, variables), Kind::Velocity | Kind::Unknown)
}

/// Whether these may be angles.
pub(in crate::explain::engine) fn may_be_angle(spec: &ModelSpec, variables: &[VariableId]) -> bool {
    is_without_units(spec) && kind(spec, variables) == Kind::Position
}

/// Whether all of these are positions.
pub(in crate::explain::engine) fn is_position(spec: &ModelSpec, variables: &[VariableId]) -> bool {
    kind(spec, variables) == Kind::Position
}

/// Whether all of these are velocities.
pub(in crate::explain::engine) fn is_velocity(spec: &ModelSpec, variables: &[VariableId]) -> bool {
    kind(spec, variables) == Kind::Velocity
}

/// Whether a state with this unit is what a store holds: a level, a charge, a share of it.
fn flows(unit: &str) -> bool {
    matches!(
        unit,
        "m" | "m3" | "kg" | "1" | "%" | "A.h" | "C" | "V" | "l" | "L" | "Pa" | "bar"
    )
}

/// Whether a state with this unit is what flows, not what is stored: a current, a flow with inertia.
fn is_current(unit: &str) -> bool {
    matches!(unit, "A" | "mA") || is_flow(unit)
}

fn is_flow(unit: &str) -> bool {
    ["/s", "/min", "/h"].iter().any(|time| unit.ends_with(time))
}

/// Whether the square of a quantity with this unit may be a heat: a current, a voltage, or what has no unit.
fn may_heat(unit: &str) -> bool {
    matches!(unit, "A" | "mA" | "V" | "mV" | "W" | "")
}

/// Whether a variable is in no equation of the plant.
fn unused(spec: &ModelSpec, v: VariableId) -> bool {
    !spec.expressions.any(|n| *n == Node::Variable(v))
}

/// The term that a fitted one is over the values that occurred: a threshold that is exceeded throughout is none, nor is a narrow
/// middle, and a load from the beginning on is a constant.
fn term_in_range(found: &Fitted) -> &'static Term {
    let (from, to) = found.range;
    let is_plain = found.shapes.len() == 1;
    let id = match (found.lead.term.id, found.shapes.first()) {
        ("load_step", Some(&at)) if is_plain && is_early(at, found.range) => "load_constant",
        ("above", Some(&edge)) if is_plain && edge <= from + NARROW * (to - from) => "linear",
        ("both_sides", Some(&edge)) if edge < NARROW * from.abs().max(to.abs()) => "linear",
        ("root_above", Some(&edge)) if edge < 0.5 * (from + to) => "root",
        (id, _) => id,
    };
    let simpler = TERMS.iter().find(|term| term.id == id);
    simpler
        .filter(|_| id != found.lead.term.id)
        .unwrap_or(found.lead.term)
}

/// The id of what was found in a plant; `law` for a function that has no name there.
pub(crate) fn named(spec: &ModelSpec, found: &Fitted) -> &'static str {
    let variables: Vec<VariableId> = found.depends.iter().filter_map(|n| spec.find(n)).collect();
    let term = term_in_range(found);
    let id = match called(spec, term, found.lead.place, &variables) {
        // Of a speed that is never below zero the square is its own with the sign.
        "law" if term.id == "square" && found.range.0 >= 0.0 && is_velocity(spec, &variables) => {
            "quadratic_drag"
        }
        id => id,
    };
    // Values of the fit decide between names of one term.
    let (from, to) = found.range;
    let fastest = from.abs().max(to.abs());
    match (id, found.shapes.first()) {
        // What is always the same, and drives.
        ("coulomb_friction" | "leak", _) if is_constant(term) && found.strength() > 0.0 => {
            "load_step"
        }
        _ if feeds(spec, id, found) => "law",
        // A cube about a place that was not passed is no spring that gets stiffer to both sides, but a curve that bends.
        ("cubic_stiffness", Some(&rest)) if term.id == "cube" && !(from < rest && rest < to) => {
            "law"
        }
        // What an actuator does for having moved comes late: an input that is ahead of itself is no hysteresis.
        _ if term.id == "input_hysteresis" && found.strength() > 0.0 => "law",
        ("hysteresis", Some(&slip))
            if may_be_velocity(spec, &variables) && slip < YIELDS * found.travel =>
        {
            "coulomb_friction"
        }
        ("cogging", Some(&wave_number))
            if (wave_number * (to - from)).abs() < PERIODS * std::f64::consts::TAU
                && !is_once_a_turn(spec, &variables, wave_number) =>
        {
            "law"
        }
        // A wire that warms up conducts worse.
        ("temperature_dependent_resistance", _)
            if term.id == "parameter_heating"
                && unit_of(spec, found.lead.place.variable(spec)) == "Ohm"
                && found.strength() < 0.0 =>
        {
            "law"
        }
        // Dry friction is the same at every speed but the lowest.
        ("coulomb_friction" | "stribeck_friction", Some(&width)) if width > SATURATES * fastest => {
            "law"
        }
        _ => id,
    }
}

/// Whether a term is the same throughout.
fn is_constant(term: &Term) -> bool {
    matches!(term.id, "load_constant" | "one_way_friction")
}

/// A middle this narrow, as a part of the largest size, is none, and so is a threshold this low in the range.
const NARROW: f64 = 0.05;

/// Effects that take from the state in whose equation they stand: friction, drag, losses.
const LOSSES: [&str; 9] = [
    "coulomb_friction",
    "stribeck_friction",
    "viscous_friction",
    "quadratic_drag",
    "cubic_drag",
    "leak",
    "overflow",
    "radiation",
    "natural_convection",
];

/// Whether a term has the name of a loss, or of a stop, but the sign of a source: a function of its own state that drives it on,
/// or of a position that draws to where it begins.
fn feeds(spec: &ModelSpec, id: &str, found: &Fitted) -> bool {
    let Place::Equation(at) = found.lead.place else {
        return false;
    };
    let own = found.lead.place.variable(spec);
    let first = found.depends.first().and_then(|name| spec.find(name));
    let own_rate = spec.equations[at].unknown == Unknown::Derivative(own);
    // Below an edge the argument counts from it, and is negative.
    let source = match found.lead.term.id {
        "below" if id == "overflow" => found.strength() < 0.0,
        _ => found.strength() > 0.0,
    };
    let takes = LOSSES.contains(&id) && first == Some(own) || id == "end_stop";
    found.lead.term.free_strength && own_rate && takes && source
}

fn unit_of(spec: &ModelSpec, v: VariableId) -> &str {
    spec.variable(v).unit_text.as_deref().unwrap_or("")
}

/// Effects that are forms of one: what a second of them finds is what the first left.
pub(crate) fn family(id: &str) -> &str {
    match id {
        "stribeck_friction" | "hysteresis" | "efficiency" => "coulomb_friction",
        "cubic_drag" | "asymmetric_damping" => "quadratic_drag",
        "quadratic_stiffness" | "end_stop" => "cubic_stiffness",
        "backlash" => "extra_mode",
        "valve_stiction" => "input_backlash",
        "actuator_lag" => "input_delay",
        "input_curve" | "input_asymmetry" | "input_dead_zone" => "input_saturation",
        "sensor_drift" => "sensor_offset",
        _ => id,
    }
}

/// The special case of a form that has a name too.
pub(in crate::explain) fn special_case(id: &str) -> Option<&'static str> {
    match id {
        "stribeck_friction" => Some("coulomb_friction"),
        "asymmetric_damping" | "extra_mode" => Some("viscous_friction"),
        "hysteresis" => Some("input_backlash"),
        "cogging" => Some("gravity_torque"),
        _ => None,
    }
}

/// Fewer periods in a travel are a curve: up to here a wave turns twice, as a cubic does.
const PERIODS: f64 = 1.5;

/// Whether a wave is that of gravity, which has a term of its own: with one period in a turn, to a tenth.
fn is_once_a_turn(spec: &ModelSpec, variables: &[VariableId], wave_number: f64) -> bool {
    let turn = match variables.first().map(|&v| unit_of(spec, v)) {
        Some("rad") => 1.0,
        Some("deg") => std::f64::consts::PI / 180.0,
        _ if may_be_angle(spec, variables) => 1.0,
        _ => return false,
    };
    (wave_number / turn - 1.0).abs() < 0.1
}

/// Bristles that yield within this part of the travel are dry friction.
const YIELDS: f64 = 0.12;

/// Friction that needs more than this part of the highest speed to come up is not dry: at half of it, it is still below 99 %.
const SATURATES: f64 = 0.2;

/// The id of a term at a place, as a function of variables. Each but `hypothesis`, which has a name of its own, is described in
/// [`documentation`](super::documentation).
pub(crate) fn called(
    spec: &ModelSpec,
    term: &Term,
    place: Place,
    variables: &[VariableId],
) -> &'static str {
    if term.id == "hypothesis" {
        return term.id;
    }
    let own = place.variable(spec);
    let what = match kind(spec, variables) {
        Kind::Unknown if slows(term) && *variables == [own] => Kind::Velocity,
        known => known,
    };
    let unit = |v: VariableId| unit_of(spec, v);
    let unit_of_place = unit(own);
    let may_be_level = matches!(what, Kind::Other | Kind::Unknown) && !is_current(unit_of_place);
    match (term.port, term.id) {
        (Port::Sensor, id) => id,
        (Port::Input, "input_square" | "input_cube") => "input_curve",
        (Port::Input, "input_hysteresis") => "hysteresis",
        (Port::Input, id) => id,
        (Port::Parameter, "parameter_step" | "parameter_ramp") => "parameter_change",
        (Port::Parameter, "parameter_heating")
            if unit_of_place == "Ohm" && variables.iter().all(|&v| may_heat(unit(v)))
                || heats_itself(spec, own, variables) =>
        {
            "temperature_dependent_resistance"
        }
        (Port::Parameter, "parameter_sine") => "position_dependent_gain",
        (Port::Parameter, "parameter_of_sine") => "gravity_torque",
        (Port::Parameter, "parameter_curve" | "parameter_square" | "parameter_exponential") => {
            match what {
                Kind::Temperature if unit_of_place == "Ohm" => "temperature_dependent_resistance",
                Kind::Position => "position_dependent_gain",
                _ => "law",
            }
        }
        (Port::Equation, "signed_square") if what == Kind::Velocity => "quadratic_drag",
        // Turbulent losses of a pipe, in the equation of what flows through it.
        (Port::Equation, "signed_square") if *variables == [own] && is_flow(unit_of_place) => {
            "quadratic_drag"
        }
        (Port::Equation, "cube") => match what {
            Kind::Velocity => "cubic_drag",
            Kind::Position => "cubic_stiffness",
            _ => "law",
        },
        (Port::Equation, "square" | "signed_square") if what == Kind::Position => {
            "quadratic_stiffness"
        }
        (Port::Equation, "friction") if what == Kind::Velocity => "coulomb_friction",
        (Port::Equation, "one_way_friction") if *variables == [own] => "coulomb_friction",
        (Port::Equation, "stribeck" | "stribeck_bristles") => "stribeck_friction",
        (Port::Equation, "bristles") => "hysteresis",
        (Port::Equation, id @ ("extra_mode" | "backlash" | "efficiency")) => id,
        (Port::Equation, "gap") if what == Kind::Position => "backlash",
        (Port::Equation, "one_sided") if what == Kind::Velocity => "asymmetric_damping",
        (Port::Equation, "above" | "below" | "both_sides") => match what {
            Kind::Position => "end_stop",
            _ if *variables == [own] && may_be_level => "overflow",
            _ => "law",
        },
        (Port::Equation, "limit") => match what {
            Kind::Position => "end_stop",
            _ if !may_be_level => "law",
            _ if is_driven_only(spec, own) => "end_stop",
            _ => "overflow",
        },
        (Port::Equation, "root_above") if *variables == [own] && may_be_level => "overflow",
        (Port::Equation, "root") if *variables == [own] && may_be_level => "leak",
        // A voltage that goes round with an angle is none of its forces.
        (Port::Equation, "sine") if matches!(unit_of_place, "A" | "mA") => "law",
        (Port::Equation, "sine") => "cogging",
        (Port::Equation, "gravity") => "gravity_torque",
        (Port::Equation, "periodic") => "periodic_disturbance",
        (Port::Equation, "radiation") => "radiation",
        (Port::Equation, "natural_convection")
            if matches!(what, Kind::Temperature | Kind::Unknown) =>
        {
            "natural_convection"
        }
        (Port::Equation, "load_constant" | "load_ramp" | "load_step") => {
            let output =
                spec.variable(own).output && spec.variable(own).kind == VariableKind::Algebraic;
            match (output, term.id) {
                (true, "load_ramp") => "sensor_drift",
                (true, _) => "sensor_offset",
                // A constant outflow of a store, where it is no force.
                (false, "load_constant") if flows(unit_of_place) => "leak",
                (false, _) => "load_step",
            }
        }
        (Port::Equation, "linear") => {
            if variables.iter().any(|&v| unused(spec, v)) {
                "missing_input"
            } else if variables.len() > 1 {
                // What a temperature does to something that enters the same equation.
                let (heated, others): (Vec<VariableId>, Vec<_>) = variables
                    .iter()
                    .partition(|&&v| kind(spec, &[v]) == Kind::Temperature);
                // It may be a resistance only of what heats: a reaction that a temperature speeds up is none.
                let inside = |v: &VariableId| place.uses(spec, *v) && may_heat(unit(*v));
                if !heated.is_empty() && !others.is_empty() && others.iter().all(inside) {
                    "temperature_dependent_resistance"
                } else {
                    "law"
                }
            } else if *variables == [own] {
                match what {
                    Kind::Velocity => "viscous_friction",
                    _ if flows(unit_of_place) => "leak",
                    _ => "law",
                }
            } else {
                "cross_coupling"
            }
        }
        _ => "law",
    }
}

/// Whether a parameter without a unit may be a resistance that its own current heats: it damps the state of its equation, and
/// the heat is that of this state.
pub(in crate::explain::engine) fn heats_itself(
    spec: &ModelSpec,
    parameter: VariableId,
    heat: &[VariableId],
) -> bool {
    let [state] = *heat else { return false };
    let damping = |node: &Node| match *node {
        Node::Binary(Binary::Multiply, a, b) => {
            [a, b].map(|id| spec.expressions.node(id))
                == [Node::Variable(parameter), Node::Variable(state)]
        }
        _ => false,
    };
    let derived = |e: &Equation| e.unknown == Unknown::Derivative(state);
    is_without_units(spec)
        && user_of(spec, parameter) == state
        && spec.equations.iter().any(derived)
        && spec.expressions.any(damping)
}

/// How specific a term is: of two that explain a recording equally well the one with a name of its own is meant, and where the
/// same name may enter two equations, that of the variable it is a function of, else that of a derivative, else of an output.
pub(crate) fn rank(spec: &ModelSpec, found: &Fitted) -> u8 {
    let variables: Vec<VariableId> = found.depends.iter().filter_map(|n| spec.find(n)).collect();
    let term = term_in_range(found);
    let of_term = rank_of(spec, term, found.lead.place, &variables);
    match named(spec, found) {
        // A constant by its sign: it stands behind what has a name of its own, as every constant load.
        "load_step" if is_constant(term) && of_term < SPECIFIC => of_term + PLACES * CONSTANT,
        _ => of_term,
    }
}

/// Whether an instant comes before all that a search starts from.
fn is_early(instant: f64, (begin, end): (f64, f64)) -> bool {
    instant < begin + TIMES[0] * (end - begin)
}

/// The part of the rank that its name has.
pub(crate) fn name_rank(spec: &ModelSpec, found: &Fitted) -> u8 {
    rank(spec, found) / PLACES
}

/// Ranks of one name at different places.
const PLACES: u8 = 4;

/// Rank of the name of a load without an instant.
const CONSTANT: u8 = 3;

/// Ranks below this are names of their own.
pub(in crate::explain::engine) const SPECIFIC: u8 = PLACES;

/// The rank of a term at a place, as a function of variables.
pub(in crate::explain::engine) fn rank_of(
    spec: &ModelSpec,
    term: &Term,
    place: Place,
    variables: &[VariableId],
) -> u8 {
    let (of_place, elsewhere) = match place {
        Place::Equation(at) => {
            let own = place.variable(spec);
            let moves = |v: VariableId| is_velocity(spec, &[v]) || is_position(spec, &[v]);
            // Time, an input that nothing else uses, or where something is and how fast.
            let is_force = term.needs == Needs::Time
                || variables.iter().any(|&v| unused(spec, v))
                || !variables.is_empty() && variables.iter().all(|&v| moves(v));
            let elsewhere = match spec.equations[at].unknown {
                // What a sensor does at its own time comes last; and where nothing drives the plant it lags only by where it was at
                // the start, which a second store does too.
                _ if term.id == "sensor_drift" => 3,
                // A motion that never turns is slowed by friction sooner than its sensor has an offset.
                _ if term.id == "sensor_offset" && is_velocity(spec, &[own]) => 1,
                _ if term.port == Port::Sensor
                    && !term.memories.is_empty()
                    && spec.inputs().is_empty() =>
                {
                    1
                }
                _ if variables.contains(&own) || term.port != Port::Equation => 0,
                // A load and a force act on what moves, before what drives it.
                Unknown::Derivative(v) if is_force && !is_velocity(spec, &[v]) => 2,
                Unknown::Derivative(_) => 1,
                Unknown::Value(_) if spec.variable(own).output => 2,
                Unknown::Value(_) => 3,
            };
            (0, elsewhere)
        }
        Place::Input(_) => (0, 0),
        Place::Parameter(_) => (1, 0),
    };
    let of_name = match called(spec, term, place, variables) {
        "load_step" if term.id != "load_step" => CONSTANT + of_place,
        "law" | "cross_coupling" => 4 + of_place,
        "input_curve" | "parameter_change" => 2 + of_place,
        _ => of_place,
    };
    PLACES * of_name + elsewhere
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::parse;

    fn name(text: &str, term: &str, at: &str, of: &str) -> &'static str {
        let spec = parse(text).unwrap();
        let term = TERMS.iter().find(|t| t.id == term).unwrap();
        let unknown = |e: &Equation| e.unknown.variable() == spec.find(at).unwrap();
        let place = spec.equations.iter().position(unknown).unwrap();
        called(
            &spec,
            term,
            Place::Equation(place),
            &[spec.find(of).unwrap()],
        )
    }

    #[test]
    fn a_step_before_the_first_start_of_a_search_is_early() {
        assert!(is_early(11.9, (10.0, 50.0)));
        assert!(!is_early(12.1, (10.0, 50.0)));
    }

    #[test]
    fn without_units_what_slows_itself_is_a_velocity() {
        let bare = "model M input Real u; output Real y; Real w; Real i;
                    equation der(w) = i - w; der(i) = u - i; y = w; end M;";
        assert_eq!(name(bare, "signed_square", "w", "w"), "quadratic_drag");
        assert_eq!(name(bare, "friction", "w", "w"), "coulomb_friction");
        let pipe = bare.replace("Real w;", "Real w(unit=\"m3/s\");");
        assert_eq!(name(&pipe, "signed_square", "w", "w"), "quadratic_drag");
        // Not what another state does, and not what has a unit that is none of a velocity.
        assert_eq!(name(bare, "signed_square", "w", "i"), "law");
        let warm = bare.replace("Real w;", "Real w(unit=\"K\");");
        assert_eq!(name(&warm, "signed_square", "w", "w"), "law");
    }

    #[test]
    fn without_units_a_coefficient_that_damps_its_state_may_be_heated() {
        let spec = parse(
            "model M parameter Real r = 2; parameter Real b = 1; input Real u; output Real y; Real i;
             equation der(i) = b*u - r*i; y = i; end M;",
        )
        .unwrap();
        let v = |name: &str| spec.find(name).unwrap();
        assert!(heats_itself(&spec, v("r"), &[v("i")]));
        assert!(!heats_itself(&spec, v("b"), &[v("i")]));
        assert!(!heats_itself(&spec, v("r"), &[v("u")]));
    }
}
