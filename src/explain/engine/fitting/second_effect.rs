//! What may be named beside an effect that was found.

use crate::explain::engine::fitting::edit::Place;
use crate::explain::engine::fitting::fitted::{Fitted, with_more};
use crate::explain::engine::screening::screen::{Lead, Screen};
use crate::explain::engine::terms::names::{called, family};
use crate::explain::engine::terms::term::Port;
use crate::physics::ModelSpec;
use crate::physics::estimate::{EstimateOptions, Study};

/// The strength of a second effect must differ from 0 by so many standard deviations with all parameters free, whatever their
/// bounds (p = 0.001): what a parameter would do beyond its bound is no second effect.
const DETERMINED: f64 = 3.3;

/// Whether a term may be named beside an effect. It must have a name of its own: a function without a name may be what is left of
/// the first; and it must not be a function of the same variables at the same kind of place, which may be the part that the
/// formula of the first leaves (math/physics.md, "Fits and decision", 8).
pub(in crate::explain::engine) fn differs(
    id: &str,
    port: Port,
    depends: &[String],
    (first, its_id): (&Fitted, &str),
) -> bool {
    let kind = |port: Port| match port {
        Port::Equation | Port::Parameter => Port::Equation,
        port => port,
    };
    // What comes later is no function of its argument.
    let is_later = |id: &str| matches!(id, "input_delay" | "actuator_lag");
    let repeats = !depends.is_empty()
        && depends == first.depends
        && kind(port) == kind(first.lead.term.port)
        && is_later(id) == is_later(its_id);
    let is_new = family(id) != family(its_id) && !repeats;
    are_apart(id, its_id) || is_new && has_own_name(id)
}

/// Whether a term is more than a function without a name, or another value of what a linear plant has.
fn has_own_name(id: &str) -> bool {
    !matches!(id, "law" | "cross_coupling" | "viscous_friction")
}

/// Whether a term is the effect that was named first, in another equation and of other variables: the edge of a second tank, the friction
/// of a second body.
pub(in crate::explain::engine) fn repeats_elsewhere(
    id: &str,
    place: Place,
    depends: &[String],
    (first, its_id): (&Fitted, &str),
) -> bool {
    let in_equation = |place: Place| matches!(place, Place::Equation(_));
    id == its_id
        && has_own_name(id)
        && in_equation(place)
        && in_equation(first.lead.place)
        && place != first.lead.place
        && !depends.is_empty()
        && !depends.iter().any(|v| first.depends.contains(v))
}

/// Effects of one variable that act at opposite ends of it, and often together: the middle and the ends of an input, the friction and
/// the drag of what coasts, the outlet and the edge of a tank.
const APART: [[&str; 2]; 6] = [
    ["input_dead_zone", "input_saturation"],
    ["coulomb_friction", "quadratic_drag"],
    ["stribeck_friction", "quadratic_drag"],
    ["coulomb_friction", "viscous_friction"],
    ["stribeck_friction", "viscous_friction"],
    ["leak", "overflow"],
];

pub(in crate::explain::engine) fn are_apart(one: &str, other: &str) -> bool {
    APART
        .iter()
        .any(|pair| *pair == [one, other] || *pair == [other, one])
}

/// Whether the strength of a term differs from 0 by more than the parameters leave open.
pub(in crate::explain::engine) fn determined(
    study: &Study,
    found: &Fitted,
    options: &EstimateOptions,
) -> bool {
    if !found.lead.term.free_strength {
        return true;
    }
    let options = with_more(options, found.candidate.values.len());
    let at = options.free.len() - 1;
    let Ok(own) = study.of(&found.candidate.plant, &options) else {
        return false;
    };
    // Where no parameter is at a bound, the gain says it: of a hard stop only its place is determined, and how hard it is is not.
    let at_no_bound = own.inside(&found.fit).len() == found.fit.point.len();
    at_no_bound
        || own
            .deviations_from_zero(&found.fit, at)
            .is_some_and(|away| away > DETERMINED)
}

/// Drops what may not be named beside an effect, but for the best term and the best curve: what these explain as well is no
/// evidence of another.
pub(in crate::explain::engine) fn drop_alike(
    screen: &mut Screen,
    spec: &ModelSpec,
    first: (&Fitted, &str),
) {
    let arguments = &screen.arguments;
    let mut taken = [false; 2];
    let mut keep = |lead: &Lead| {
        let variables = lead.argument.map_or(&[][..], |a| &arguments[a].variables);
        let id = called(spec, lead.term, lead.place, variables);
        let depends = spec.names(variables);
        if differs(id, lead.term.port, &depends, first)
            || repeats_elsewhere(id, lead.place, &depends, first)
        {
            return true;
        }
        !std::mem::replace(&mut taken[usize::from(lead.curve.is_some())], true)
    };
    screen.leads.retain(&mut keep);
    screen.curves.retain(&mut keep);
}
