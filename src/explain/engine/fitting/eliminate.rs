//! Backward elimination: whether what was found second explains the recording without what was found first.
//!
//! The first effect is the best that one term can do while the other is missing, and a flexible term can stand for both. Once
//! the second is there the first may be of no use.

use crate::explain::engine::fitting::candidate::candidate;
use crate::explain::engine::fitting::edit::Place;
use crate::explain::engine::fitting::fitted::{Fitted, searched, with_more};
use crate::explain::engine::screening::path::{hooked, path};
use crate::explain::engine::terms::arguments_of_plant::arguments;
use crate::explain::engine::thresholds::{MOST_STEPS, ROUNDS, THOROUGH, limited};
use crate::physics::estimate::{EstimateOptions, Fit, PlantRecording, Study};
use crate::physics::{ModelSpec, Plant};

/// The place of the same name in another text.
fn same_place(place: Place, of: &ModelSpec, given: &ModelSpec) -> Option<Place> {
    let v = given.find(&of.variable(place.variable(of)).name)?;
    Some(match place {
        Place::Input(_) => Place::Input(v),
        Place::Parameter(_) => Place::Parameter(v),
        Place::Equation(_) => Place::Equation(
            given
                .equations
                .iter()
                .position(|e| e.unknown.variable() == v)?,
        ),
    })
}

/// The plant with the second of two effects alone, fitted from where the two of them ended. `study` and `baseline` are those of
/// the plant without either.
pub(in crate::explain::engine) fn alone(
    plant: &Plant,
    study: &Study,
    baseline: &Fit,
    first: &Fitted,
    second: &Fitted,
    recordings: &[PlantRecording],
    options: &EstimateOptions,
) -> Option<Fitted> {
    let spec = &plant.spec;
    let place = same_place(second.lead.place, &first.candidate.plant.spec, spec)?;
    let mut arguments = arguments(spec);
    let hooked = hooked(spec, spec, &arguments)?;
    path(
        study,
        (baseline, baseline),
        &hooked,
        recordings,
        &mut arguments,
    )?;
    let argument = match second.lead.argument {
        Some(_) => Some(
            arguments
                .iter()
                .position(|a| a.expression == second.argument)?,
        ),
        None => None,
    };
    let mut lead = second.lead.clone().at(place, argument, &second.shapes);
    let from = &first.candidate.plant.spec;
    lead.arrives = match lead.arrives {
        Some((at, strength)) => match same_place(Place::Equation(at), from, spec)? {
            Place::Equation(at) => Some((at, strength)),
            _ => None,
        },
        None => None,
    };
    let made = candidate(spec, &lead, &arguments, recordings)?;
    // From the numbers of both: those of the plant, with those of the second alone.
    let own = study.parameters();
    let dropped = first.candidate.values.len();
    let values = &second.fit.point[own + dropped..][..made.values.len()];
    let of_first = second.without_term(own + dropped);
    let without = first.candidate.without(&of_first, own);
    let mut from = made.from(&without, own);
    from.point[own..][..values.len()].copy_from_slice(values);
    let options = with_more(options, made.values.len());
    let limited = limited(made.plant.clone(), study, MOST_STEPS);
    let inner = study.of(&limited, &options).ok()?;
    let fit = inner.refit(&from, ROUNDS, THOROUGH)?;
    let gain = study.criterion(baseline) - fit.criterion - searched(&lead, recordings);
    Some(Fitted {
        shapes: fit.point[own..][..lead.shapes.len()].to_vec(),
        lead,
        candidate: made,
        fit,
        gain,
        ..second.clone()
    })
}
