//! The table and the names hold together.

use std::collections::BTreeSet;

use super::*;
use crate::explain::engine::fitting::edit::{Place, places, sensors};
use crate::explain::engine::terms::argument::ArgumentForm;
use crate::explain::engine::terms::arguments_of_plant::arguments;
use crate::explain::engine::terms::library::TERMS;
use crate::explain::engine::terms::names::called;
use crate::explain::engine::terms::term::{Needs, Port};
use crate::physics::parse;

/// Plants that between them have every kind of place and argument that a name depends on.
const PLANTS: [&str; 3] = [
    "model Motor
       parameter Real R(unit=\"Ohm\") = 1; parameter Real J = 1;
       input Real u(unit=\"V\"); input Real d(unit=\"N.m\"); output Real y(unit=\"rad\");
       Real phi(unit=\"rad\"); Real w(unit=\"rad/s\"); Real T(unit=\"K\");
     equation
       der(phi) = w; J*der(w) = u/R - w; der(T) = u - T; y = phi;
     end Motor;",
    "model Tank
       parameter Real A = 2; input Real q; output Real y; Real h;
     equation
       A*der(h) = q - h; y = 2*h;
     end Tank;",
    "model Oven
       parameter Real k = 1; input Real P(unit=\"W\"); input Real Ta(unit=\"K\"); output Real y(unit=\"K\"); Real T(unit=\"K\");
     equation
       der(T) = P - k*(T - Ta); y = T;
     end Oven;",
];

fn names() -> BTreeSet<&'static str> {
    let mut all = BTreeSet::new();
    for text in PLANTS {
        let spec = parse(text).unwrap();
        let sensors = sensors(&spec);
        let arguments = arguments(&spec);
        for term in TERMS {
            let mut at: Vec<Place> = match term.port {
                Port::Sensor => sensors.iter().map(|&s| Place::Equation(s)).collect(),
                _ => places(&spec, &spec),
            };
            at.retain(|place| match term.port {
                Port::Equation | Port::Sensor => matches!(place, Place::Equation(_)),
                Port::Input => matches!(place, Place::Input(_)),
                Port::Parameter => matches!(place, Place::Parameter(_)),
            });
            for place in at {
                if term.needs == Needs::Time {
                    all.insert(called(&spec, term, place, &[]));
                    continue;
                }
                for argument in &arguments {
                    // What an argument must be, as far as that does not depend on a recording.
                    let serves = match term.needs {
                        Needs::Radiation => argument.form == ArgumentForm::Radiation,
                        Needs::Reciprocal => argument.form == ArgumentForm::Reciprocal,
                        Needs::Difference => argument.form == ArgumentForm::Difference,
                        Needs::Stretch => argument.serves(Needs::Stretch),
                        Needs::Angle => argument.angle,
                        _ => true,
                    };
                    if serves {
                        all.insert(called(&spec, term, place, &argument.variables));
                    }
                }
            }
        }
    }
    all
}

/// Of the structures that ship with the program.
const OWN_EFFECTS: [&str; 1] = ["tank_outflow"];

#[test]
fn every_name_is_described_and_every_description_is_a_name() {
    let described: BTreeSet<&str> = plant_effects().map(|e| e.id).collect();
    assert_eq!(described.len(), plant_effects().count(), "an id twice");
    // What structures have from the start is no term of the library.
    let all: BTreeSet<&str> = names().into_iter().chain(OWN_EFFECTS).collect();
    assert_eq!(all, described);
}

#[test]
fn what_imitates_an_effect_is_described_too() {
    for effect in plant_effects() {
        assert!(!effect.imitations.is_empty(), "{}", effect.id);
        for i in effect.imitations {
            assert!(
                i.effect == "parameters" || plant_effect(i.effect).is_some(),
                "{}: {}",
                effect.id,
                i.effect
            );
            assert!(i.experiment.ends_with('.'), "{}", i.experiment);
        }
    }
}
