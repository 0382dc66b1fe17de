//! Neighbours of a fit's term: forms with one shape more, the same function of one variable only, and a change of a parameter.

use rayon::prelude::*;

use crate::explain::engine::fitting::edit::{
    Place, is_shared_term, places, with_what_they_are_made_of,
};
use crate::explain::engine::fitting::fitted::{Fitted, TIE, with_more};
use crate::explain::engine::fitting::formulas::{in_its_place, instead};
use crate::explain::engine::hypothesis::Ground;
use crate::explain::engine::screening::along::{along, factor_along};
use crate::explain::engine::screening::screen::Lead;
use crate::explain::engine::terms::argument::{Argument, ArgumentForm};
use crate::explain::engine::terms::library::TERMS;
use crate::explain::engine::terms::names::{called, named, special_case};
use crate::explain::engine::terms::richer::richer;
use crate::explain::engine::terms::term::{Needs, Port, Starts, Term, curve};
use crate::explain::engine::terms::values::{expression, grid, starts};
use crate::explain::engine::thresholds::{FINISHED, GLANCE, MOST_STEPS, ROUNDS, THOROUGH, limited};
use crate::physics::estimate::{Fit, PlantRecording, Study};
use crate::physics::{ModelSpec, Unknown, VariableId, VariableKind};

/// The richer form of a fit's term that fits best, or that of this again, where that gains what ties do not explain. What the simple form
/// leaves would else be taken for a second effect.
pub(in crate::explain::engine) fn richer_form(
    fitted: &Fitted,
    arguments: &[Argument],
    ground: &Ground,
) -> Option<Fitted> {
    let richer = with_one_shape_more(fitted, arguments, ground)?;
    Some(with_one_shape_more(&richer, arguments, ground).unwrap_or(richer))
}

fn with_one_shape_more(fitted: &Fitted, arguments: &[Argument], ground: &Ground) -> Option<Fitted> {
    let argument = fitted.lead.argument.map(|a| &arguments[a]);
    let begun = |term: &'static Term| -> Vec<(&'static Term, f64)> {
        let new = term.shapes.last().map(|shape| shape.starts);
        let each = new.map(|new| starts(new, argument, ground.recordings, &[]));
        each.into_iter()
            .flatten()
            .map(|start| (term, start))
            .collect()
    };
    let is_product = argument.is_some_and(|a| a.form == ArgumentForm::Product);
    let forms = richer(fitted.lead.term).filter(|term| is_product || !term.is_of_product());
    let each: Vec<(&Term, f64)> = forms.flat_map(begun).collect();
    let glanced = each.into_par_iter().filter_map(|(term, start)| {
        let shapes = [&fitted.shapes[..], &[start]].concat();
        let strength = match term.free_strength {
            true => fitted.strength(),
            false => 1.0,
        };
        let what = (term, fitted.lead.argument);
        in_its_place(
            fitted,
            what,
            (&shapes[..], strength),
            &glance,
            arguments,
            ground,
        )
    });
    clearly_better(fitted, glanced, ground)
}

/// The same function of one of the variables that a fit's term depends on, where that gains what ties do not explain: a screen asks
/// along the fit without the term, where the difference of two variables may look like one of them.
pub(in crate::explain::engine) fn of_one_variable(
    fitted: &Fitted,
    arguments: &[Argument],
    ground: &Ground,
) -> Option<Fitted> {
    let (term, place) = (fitted.lead.term, fitted.lead.argument?);
    let own = &arguments[place].variables;
    if own.len() < 2 || fitted.lead.curve.is_some() {
        return None;
    }
    let start = (&fitted.shapes[..], fitted.strength());
    let of_one = |a: &usize| {
        let argument = &arguments[*a];
        argument.variables.len() == 1
            && own.contains(&argument.variables[0])
            && argument.serves(term.needs)
    };
    let others: Vec<usize> = (0..arguments.len()).filter(of_one).collect();
    let glanced = others.into_par_iter().filter_map(|other| {
        in_its_place(
            fitted,
            (term, Some(other)),
            start,
            &glance,
            arguments,
            ground,
        )
    });
    clearly_better(fitted, glanced, ground)
}

/// The special case of a fit's term that has a name too, from the values of the fit, where it gains as much: a screen may have found only
/// the richer form from where it starts.
pub(in crate::explain::engine) fn simpler_form(
    fitted: &Fitted,
    arguments: &[Argument],
    ground: &Ground,
) -> Option<Fitted> {
    let (spec, lead) = (&ground.plant.spec, &fitted.lead);
    let wanted = special_case(named(spec, fitted))?;
    let argument = &arguments[lead.argument?];
    let symbols = |term: &Term| term.shapes.iter().map(|s| s.symbol).collect::<Vec<_>>();
    let own = symbols(lead.term);
    let special = |t: &&Term| {
        let fewer = symbols(t);
        let is_part = fewer.len() < own.len() && own.starts_with(&fewer);
        // A form with fewer shapes may need other values, such as a motion that never turns.
        let serves = !fewer.is_empty() && argument.serves(t.needs);
        is_part && serves && called(spec, t, lead.place, &argument.variables) == wanted
    };
    let fits = TERMS.iter().filter(special).filter_map(|term| {
        let start = (&fitted.shapes[..term.shapes.len()], fitted.strength());
        let what = (term, lead.argument);
        let glanced = in_its_place(fitted, what, start, &glance, arguments, ground)?;
        thoroughly(glanced, ground)
    });
    let best = fits.max_by(|a, b| a.gain.total_cmp(&b.gain))?;
    (best.gain >= fitted.gain && best.is_resolved(ground.study)).then_some(best)
}

/// Parts of what leaves one equation that start as what arrives in another; negative of what enters both, such as a heat.
const ARRIVES: [f64; 3] = [1.0, 0.1, -1.0];

/// The same in a second equation too, with a strength of its own, where that gains what ties do not explain: what flows over the rim of
/// one tank falls into the next, and what heats one body cools another, or a current heats both. Where it is a function of the state of
/// the second, it leaves that one.
pub(in crate::explain::engine) fn also_elsewhere(
    fitted: &Fitted,
    given: &ModelSpec,
    arguments: &[Argument],
    ground: &Ground,
) -> Option<Fitted> {
    let (spec, lead) = (&ground.plant.spec, &fitted.lead);
    let (Place::Equation(here), Some(argument)) = (lead.place, lead.argument) else {
        return None;
    };
    let plain = lead.term.free_strength && lead.curve.is_none() && !lead.term.form.contains("{a}");
    if !plain || lead.sensor || lead.arrives.is_some() {
        return None;
    }
    let of = with_what_they_are_made_of(spec, &arguments[argument].variables);
    let own = lead.place.variable(spec);
    let others = places(spec, given).into_iter().filter_map(|place| {
        let Place::Equation(at) = place else {
            return None;
        };
        let is_rate = matches!(spec.equations[at].unknown, Unknown::Derivative(_));
        // What flows out of a store depends on what is in it; an input may act on all.
        let is_input = |v: &VariableId| {
            use VariableKind::{Algebraic, Input};
            matches!(spec.variable(*v).kind, Input | Algebraic)
        };
        let is_source =
            of.contains(&place.variable(spec)) || of.contains(&own) || of.iter().all(is_input);
        (at != here && is_rate && is_source).then_some(at)
    });
    // Of a difference also each variable alone.
    let alone = |a: &usize| matches!(arguments[*a].variables[..], [one] if of.contains(&one) && of.len() > 1);
    let other = |a: &usize| *a != argument && alone(a) && arguments[*a].serves(lead.term.needs);
    let singles = (0..arguments.len()).filter(other);
    let shapes_of = |a: usize| grid(lead.term, Some(&arguments[a]), ground.recordings, &[]);
    let singles = singles.flat_map(|a| shapes_of(a).into_iter().map(move |shapes| (a, shapes)));
    let functions: Vec<(usize, Vec<f64>)> = [(argument, fitted.shapes.clone())]
        .into_iter()
        .chain(singles)
        .collect();
    let strength = fitted.strength();
    let mut leads: Vec<Lead> = Vec::new();
    for at in others {
        for (argument, shapes) in &functions {
            let of = &arguments[*argument].variables;
            for there in ARRIVES.map(|part| -part * strength) {
                let both = source_first(spec, of, [(here, strength), (at, there)]);
                leads.push(in_both(lead, both, *argument, shapes));
            }
        }
    }
    let glanced =
        (leads.into_par_iter()).filter_map(|new| instead(fitted, new, &glance, arguments, ground));
    clearly_better(fitted, glanced, ground)
}

/// Equations that a term enters, and its strength there: first that of the variable that it is a function of, which it leaves.
fn source_first(spec: &ModelSpec, of: &[VariableId], both: [(usize, f64); 2]) -> [(usize, f64); 2] {
    let [one, other] = both;
    let is_of = |at: usize| of.contains(&spec.equations[at].unknown.variable());
    match is_of(other.0) && !is_of(one.0) {
        true => [other, one],
        false => both,
    }
}

fn in_both(lead: &Lead, both: [(usize, f64); 2], argument: usize, shapes: &[f64]) -> Lead {
    let [(first, strength), second] = both;
    let mut new = lead
        .clone()
        .at(Place::Equation(first), Some(argument), shapes);
    (new.strength, new.arrives) = (strength, Some(second));
    new
}

/// A function of what several rates share, which has a name of ours, as one of the variables that this is made of. It begins with the same
/// values along the fit.
pub(in crate::explain::engine) fn of_what_is_shared(
    fitted: &Fitted,
    arguments: &[Argument],
    ground: &Ground,
) -> Option<Fitted> {
    let (spec, lead) = (&ground.plant.spec, &fitted.lead);
    let old = &arguments[lead.argument?];
    let shared = |v: &VariableId| is_shared_term(spec, *v);
    let plain = lead.term.free_strength && lead.term.memories.is_empty() && lead.curve.is_none();
    if !plain || lead.term.form.contains("{a}") || !old.variables.iter().any(shared) {
        return None;
    }
    let made_of = with_what_they_are_made_of(spec, &old.variables);
    let others = arguments.iter().enumerate().filter(|(_, a)| {
        let form = matches!(a.form, ArgumentForm::Variable | ArgumentForm::Difference);
        let own = |v: &VariableId| made_of.contains(v) && !shared(v);
        form && a.variables.iter().all(own) && a.serves(lead.term.needs)
    });
    let options = with_more(ground.options, fitted.candidate.values.len());
    let study = ground.study.of(&fitted.candidate.plant, &options).ok()?;
    let values = |texts: &[String]| along((&study, &fitted.fit), ground.recordings, texts);
    let term_at = |argument: &Argument, shapes: &[f64]| {
        let of = (&argument.expression[..], argument.usual());
        expression(lead.term, of, shapes, ground.study.sample_time())
    };
    let anew = |(at, argument): (usize, &Argument)| {
        let both = [&old.expression, &argument.expression].map(|text| text.to_owned());
        let [from, to]: [Vec<f64>; 2] = values(&both)?.try_into().ok()?;
        // Where the fit has this value of what is shared.
        let there = |value: f64| {
            let distance = |i: &usize| (from[*i] - value).abs();
            let nearest = (0..from.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
            nearest.map_or(value, |i| to[i])
        };
        let each = lead.term.shapes.iter().zip(&fitted.shapes);
        let shapes: Vec<f64> = each
            .map(|(shape, &value)| match shape.starts {
                Starts::Quantiles(_) | Starts::SizeQuantiles(_) => there(value),
                _ => value,
            })
            .collect();
        let terms = [term_at(old, &fitted.shapes), term_at(argument, &shapes)];
        let (part, _) = factor_along((&study, &fitted.fit), ground.recordings, &terms)?;
        let strength = fitted.strength() * part;
        let new = match (lead.place, fitted.arrives()) {
            (Place::Equation(here), Some((to, there))) => {
                let both = [(here, strength), (to, there * part)];
                let both = source_first(spec, &argument.variables, both);
                in_both(lead, both, at, &shapes)
            }
            _ => {
                let mut new = lead.clone().at(lead.place, Some(at), &shapes);
                new.strength = strength;
                new
            }
        };
        let glanced = instead(fitted, new, &glance, arguments, ground)?;
        thoroughly(glanced, ground)
    };
    let fits = others
        .filter_map(anew)
        .filter(|f| f.is_resolved(ground.study));
    let best = fits.max_by(|a, b| a.gain.total_cmp(&b.gain))?;
    (best.gain > fitted.gain - TIE.0).then_some(best)
}

/// Parts of a parameter by which it may change, and of the recording's length at which.
const CHANGES: [f64; 2] = [-0.3, 0.3];
const WHEN: [f64; 4] = [0.2, 0.4, 0.6, 0.8];
/// Of all these, the likeliest so many of a parameter are fitted.
const STARTS: usize = 3;

/// What begins at some time, or drifts, as a change of each parameter of its equations: a load as one that begins when it does, and a
/// change of a parameter as one of the others. From the plant without it a fit may not get there, where parameters have gone to their
/// bounds to make up for it.
pub(in crate::explain::engine) fn as_parameter_changes(
    fitted: &Fitted,
    given: &ModelSpec,
    arguments: &[Argument],
    ground: &Ground,
) -> Vec<Fitted> {
    let ids: &[&str] = match fitted.lead.term.id {
        "load_step" | "load_ramp" | "parameter_step" | "parameter_ramp" => {
            &["parameter_step", "parameter_ramp"]
        }
        _ => return vec![],
    };
    let terms = TERMS.iter().filter(|term| ids.contains(&term.id));
    let spec = &ground.plant.spec;
    let parameters = spec.parameters();
    let all = places(spec, given);
    let there = fitted.lead.place;
    let equations: Vec<Place> = match there {
        Place::Parameter(v) => {
            let uses = |e: &Place| matches!(e, Place::Equation(_)) && e.uses(spec, v);
            all.iter().copied().filter(uses).collect()
        }
        place => vec![place],
    };
    let beside = |place: &Place| match *place {
        Place::Parameter(v) => *place != there && equations.iter().any(|e| e.uses(spec, v)),
        _ => false,
    };
    let (begin, end) = PlantRecording::span(ground.recordings);
    let own = fitted.lead.term.shapes.iter().zip(&fitted.shapes);
    let own = own
        .into_iter()
        .find(|(s, _)| s.is_instant())
        .map(|(_, t)| *t);
    let instants = |term: &Term| -> Vec<Vec<f64>> {
        match (term.shapes, own) {
            ([], _) => vec![vec![]],
            (_, Some(own)) => vec![vec![own]],
            _ => (WHEN.iter().map(|part| vec![begin + part * (end - begin)])).collect(),
        }
    };
    let off_bounds = ground
        .study
        .off_bounds(&fitted.fit, given.parameters().len());
    let off_bounds = off_bounds.map(|fit| Fitted {
        fit,
        ..fitted.clone()
    });
    let froms: Vec<&Fitted> = [fitted].into_iter().chain(&off_bounds).collect();
    let changed = |(term, place): (&'static Term, Place)| {
        let at = parameters.iter().position(|&p| p == place.variable(spec))?;
        let of_from = |from: &&'_ Fitted| -> Vec<(Vec<f64>, f64)> {
            let value = from.fit.point.get(at).copied().unwrap_or(0.0);
            let all = instants(term).into_iter();
            all.flat_map(|t| CHANGES.map(|part| (t.clone(), part * value)))
                .collect()
        };
        let starts: Vec<(&Fitted, (Vec<f64>, f64))> = (froms.iter())
            .flat_map(|from| of_from(from).into_iter().map(|start| (*from, start)))
            .collect();
        let begun =
            |how: &(dyn Fn(&Study, &Fit) -> Option<Fit> + Sync), from, shapes: &[f64], strength| {
                let mut lead = Lead::untested(term, place).at(place, None, shapes);
                lead.strength = strength;
                instead(from, lead, how, arguments, ground)
            };
        let as_it_is = |study: &Study, from: &Fit| {
            let deviance = study.deviance(from)?;
            Some(Fit {
                deviance,
                ..from.clone()
            })
        };
        let mut starts: Vec<(f64, &Fitted, Vec<f64>, f64)> = (starts.into_par_iter())
            .filter_map(|(from, (shapes, strength))| {
                let deviance = begun(&as_it_is, from, &shapes, strength)?.fit.deviance;
                Some((deviance, from, shapes, strength))
            })
            .collect();
        starts.sort_by(|a, b| a.0.total_cmp(&b.0));
        starts.truncate(STARTS);
        let glanced = (starts.into_par_iter())
            .filter_map(|(_, from, shapes, strength)| begun(&glance, from, &shapes, strength));
        glanced.min_by(|a, b| a.fit.deviance.total_cmp(&b.fit.deviance))
    };
    let pairs: Vec<(&'static Term, Place)> = terms
        .flat_map(|t| all.iter().filter(|p| beside(p)).map(move |p| (t, *p)))
        .collect();
    let mut glanced: Vec<Fitted> = pairs.into_par_iter().filter_map(changed).collect();
    glanced.sort_by(|a, b| a.fit.deviance.total_cmp(&b.fit.deviance));
    glanced.truncate(FINISHED);
    let fits = glanced
        .into_par_iter()
        .filter_map(|g| thoroughly(g, ground));
    fits.collect()
}

/// The size of a variable as what a parameter depends on: the saturation of iron is the same for both signs of a current.
const SIZE: Term = curve(
    "parameter_curve",
    Port::Parameter,
    Needs::BothSigns,
    "abs({z})",
    &[],
);
const SIZES: &[Term] = &[SIZE];

/// A function in the place of a parameter as a straight line, as one of the size, and as a square: a screen that hardly tells two forms
/// apart keeps one.
pub(in crate::explain::engine) fn as_plain_functions(
    fitted: &Fitted,
    arguments: &[Argument],
    ground: &Ground,
) -> Vec<Fitted> {
    let (Place::Parameter(_), Some(argument)) = (fitted.lead.place, fitted.lead.argument) else {
        return vec![];
    };
    let plain = |t: &&Term| matches!(t.id, "parameter_curve" | "parameter_square");
    let new = |t: &&Term| **t != *fitted.lead.term && arguments[argument].serves(t.needs);
    let terms: Vec<&'static Term> = TERMS
        .iter()
        .filter(plain)
        .chain(SIZES)
        .filter(new)
        .collect();
    let fits = terms.into_par_iter().filter_map(|term| {
        let (what, start) = ((term, Some(argument)), (&[][..], 0.0));
        let glanced = in_its_place(fitted, what, start, &glance, arguments, ground)?;
        thoroughly(glanced, ground)
    });
    fits.collect()
}

/// A function without a name in each other equation where it has one: what a motor's torque does, its voltage hardly does otherwise.
/// A screen has one wave number for each place, and the best at one may be found at another.
pub(in crate::explain::engine) fn named_elsewhere(
    fitted: &Fitted,
    given: &ModelSpec,
    arguments: &[Argument],
    ground: &Ground,
) -> Vec<Fitted> {
    let (spec, lead) = (&ground.plant.spec, &fitted.lead);
    let (Place::Equation(_), Some(argument)) = (lead.place, lead.argument) else {
        return vec![];
    };
    let variables = &arguments[argument].variables;
    let is_named = |place: Place| called(spec, lead.term, place, variables) != "law";
    if lead.curve.is_some() || is_named(lead.place) {
        return vec![];
    }
    let others = places(spec, given).into_iter();
    let others = others.filter(|place| matches!(place, Place::Equation(_)) && is_named(*place));
    let fits = others.collect::<Vec<_>>().into_par_iter();
    fits.filter_map(|place| {
        let there = Lead::untested(lead.term, place).at(place, Some(argument), &fitted.shapes);
        let first = ground.study.parameters();
        let shapes: Vec<usize> = (first..first + fitted.shapes.len()).collect();
        // How strong it is there is found first.
        let held = |study: &Study, from: &Fit| study.holding(from, &shapes, THOROUGH);
        thoroughly(instead(fitted, there, &held, arguments, ground)?, ground)
    })
    .collect()
}

fn glance(study: &Study, from: &Fit) -> Option<Fit> {
    study.glance(from, GLANCE)
}

/// The best of these, where it gains what ties do not explain: of each form the best at a glance, fitted until nothing changes.
fn clearly_better(
    fitted: &Fitted,
    glanced: impl ParallelIterator<Item = Fitted>,
    ground: &Ground,
) -> Option<Fitted> {
    // A glance may not get as far as a fit; what it leaves worse than no term at all is not followed.
    let most = fitted.fit.deviance + fitted.gain;
    let mut glanced: Vec<Fitted> = glanced.filter(|g| g.fit.deviance <= most).collect();
    glanced.sort_by(|a, b| a.fit.deviance.total_cmp(&b.fit.deviance));
    let mut forms: Vec<Fitted> = Vec::new();
    for one in glanced {
        let form = |f: &Fitted| (f.lead.term, f.lead.place, f.lead.arrives.map(|(at, _)| at));
        let same = |f: &Fitted| (form(f), &f.argument) == (form(&one), &one.argument);
        if !forms.iter().any(same) {
            forms.push(one);
        }
    }
    forms.truncate(FINISHED);
    let thorough = forms.into_par_iter().filter_map(|f| thoroughly(f, ground));
    let resolved = thorough.filter(|f| f.is_resolved(ground.study));
    let better = resolved.max_by(|a, b| a.gain.total_cmp(&b.gain))?;
    (better.gain > fitted.gain + TIE.0).then_some(better)
}

/// The same, fitted until nothing changes.
fn thoroughly(glanced: Fitted, ground: &Ground) -> Option<Fitted> {
    let options = with_more(ground.options, glanced.candidate.values.len());
    let limited = limited(glanced.candidate.plant.clone(), ground.study, MOST_STEPS);
    let study = ground.study.of(&limited, &options).ok()?;
    let fit = study.refit(&glanced.fit, ROUNDS, THOROUGH)?;
    let first = ground.study.parameters();
    Some(Fitted {
        gain: glanced.gain + glanced.fit.criterion - fit.criterion,
        shapes: fit.point[first..][..glanced.shapes.len()].to_vec(),
        fit,
        ..glanced
    })
}
