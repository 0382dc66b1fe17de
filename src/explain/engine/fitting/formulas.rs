//! The shortest formula for a function that nobody listed: each is fitted to the function, and the nearest in its place.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::explain::engine::fitting::candidate::candidate;
use crate::explain::engine::fitting::edit::Place;
use crate::explain::engine::fitting::fitted::{Fitted, searched, with_more};
use crate::explain::engine::hypothesis::Ground;
use crate::explain::engine::screening::curve::Curve;
use crate::explain::engine::screening::screen::Lead;
use crate::explain::engine::terms::argument::Argument;
use crate::explain::engine::terms::library::TERMS;
use crate::explain::engine::terms::richer::richer;
use crate::explain::engine::terms::term::{Needs, Port, Shape, Starts, Term, curve, shape};
use crate::explain::engine::terms::values::{Instance, evaluate, grid};
use crate::explain::engine::thresholds::{GLANCE, MOST_STEPS, ROUNDS, THOROUGH};
use crate::physics::estimate::{Fit, Study};

/// Id of all of these terms.
pub(in crate::explain::engine) const FORMULA: &str = "formula";

const WIDTHS: Starts = Starts::Spread(&[0.1, 0.2, 0.5, 1.0, 2.0]);
const MIDDLES: Starts = Starts::Quantiles(&[0.1, 0.3, 0.5, 0.7, 0.9]);
const POWERS: Starts = Starts::Powers(&[0.5, 1.5, 2.5, 4.0]);

/// Functions of one variable with one or two shapes: powers, growth, decay, saturation, orifices, rise and fall.
const FORMULAS: &[Term] = &[
    law("sign({z})*abs({z})^{p}", &[shape("p", POWERS, true)]),
    law("abs({z})^{p}", &[shape("p", POWERS, true)]),
    law("exp({z}/{s})", &[shape("s", WIDTHS, true)]),
    law("exp(-{z}/{s})", &[shape("s", WIDTHS, true)]),
    // Through zero, where no parameter of the plant is the constant.
    law("exp({z}/{s}) - 1", &[shape("s", WIDTHS, true)]),
    law("exp(-{z}/{s}) - 1", &[shape("s", WIDTHS, true)]),
    law("tanh({z}/{s})", &[shape("s", WIDTHS, true)]),
    law("{z}/({s} + abs({z}))", &[shape("s", WIDTHS, true)]),
    // Through an orifice, laminar at small differences of pressure: the root alone has an infinite slope where it turns.
    law(
        "{z}/({z}^2 + {s}^2)^0.25",
        &[shape("s", Starts::Spread(&[0.02, 0.1, 0.3]), true)],
    ),
    law("{z}*exp(-({z}/{s})^2)", &[shape("s", WIDTHS, true)]),
    law("{z}/(1 + ({z}/{s})^2)", &[shape("s", WIDTHS, true)]),
    law("1/(1 + ({z}/{s})^2)", &[shape("s", WIDTHS, true)]),
    law(
        "exp(-(({z} - {o})/{s})^2)",
        &[shape("o", MIDDLES, false), shape("s", WIDTHS, true)],
    ),
    law(
        "tanh(({z} - {o})/{s})",
        &[shape("o", MIDDLES, false), shape("s", WIDTHS, true)],
    ),
];
/// Formulas that are fitted to the recording: those nearest to the curve, and of the terms of the library those nearest to it.
const FITTED: usize = 4;
const LISTED: usize = 2;
/// Parts of the values of a variable between which a function may turn.
const KNOTS: u8 = 10;
/// Steps in which the straight part of a curve passes into the parameters.
const PASSES: usize = 5;

const fn law(form: &'static str, shapes: &'static [Shape]) -> Term {
    curve(FORMULA, Port::Equation, Needs::Anything, form, shapes)
}

/// A formula for the curve, with its start.
struct Near {
    term: &'static Term,
    shapes: Vec<f64>,
    strength: f64,
    /// Slope of the curve's straight part beside it.
    slope: f64,
    /// What it leaves of the curve's sum of squares about its straight part.
    left: f64,
}

/// The formulas near to the function of a fit, fitted in its place; none where it is no function of one variable.
pub(in crate::explain::engine) fn formulas(
    best: &Fitted,
    arguments: &[Argument],
    ground: &Ground,
) -> Vec<Fitted> {
    let nearest = nearest(best, arguments, ground).unwrap_or_default();
    nearest
        .par_iter()
        .filter_map(|near| {
            let level = levelled(best, near.slope, ground);
            let best = level.as_ref().unwrap_or(best);
            let start = (&near.shapes[..], near.strength);
            let refit = |study: &Study, from: &Fit| study.refit(from, ROUNDS, THOROUGH);
            let what = (near.term, best.lead.argument);
            in_its_place(best, what, start, &refit, arguments, ground)
        })
        .filter(|f| turns_inside(f, arguments))
        .collect()
}

/// Whether the middle of a formula is among the values of its argument: what rises or falls beyond them is a constant.
fn turns_inside(fitted: &Fitted, arguments: &[Argument]) -> bool {
    let shapes = fitted.lead.term.shapes.iter().zip(&fitted.shapes);
    let mut middles = shapes.filter(|(shape, _)| shape.symbol == "o");
    let argument = fitted.lead.argument.map(|a| &arguments[a]);
    argument.is_none_or(|a| {
        middles.all(|(_, middle)| (a.quantile(0.0)..=a.quantile(1.0)).contains(middle))
    })
}

/// The curve of a fit, as its knots have it.
fn fitted_curve(best: &Fitted, ground: &Ground) -> Option<Curve> {
    let knots = best.lead.curve.as_ref()?.knots.clone();
    let first = ground.study.parameters();
    let values = best.fit.point[first..first + knots.len()].to_vec();
    Some(Curve { knots, values })
}

/// The fit with a curve that rises less by `slope`, where parameters can do that instead: a formula that leaves it to them starts from
/// there without a jump. Step by step, because what is straight may move a resonance far.
fn levelled(best: &Fitted, slope: f64, ground: &Ground) -> Option<Fitted> {
    let curve = fitted_curve(best, ground)?;
    let options = with_more(ground.options, best.candidate.values.len());
    let rough = best.candidate.rough(ground.study, MOST_STEPS);
    let inner = ground.study.of(&rough, &options).ok()?;
    let first = ground.study.parameters();
    let held: Vec<usize> = (first..first + curve.knots.len()).collect();
    let mut fit = best.fit.clone();
    for pass in 1..=PASSES {
        let part = slope * pass as f64 / PASSES as f64;
        for (i, (knot, value)) in curve.knots.iter().zip(&curve.values).enumerate() {
            fit.point[first + i] = value - part * knot;
        }
        fit = inner.holding(&fit, &held, GLANCE)?;
    }
    // What no parameter does stays in the curve.
    let allowed = inner.cost_of_a_number() * curve.knots.len() as f64;
    let rises = inner.information() * (fit.deviance - best.fit.deviance);
    (rises < allowed).then(|| Fitted {
        fit,
        ..best.clone()
    })
}

/// What a fitted function adds along the recordings, and where it may turn.
fn along_recordings(
    best: &Fitted,
    arguments: &[Argument],
    ground: &Ground,
) -> Option<(DVector<f64>, Vec<f64>)> {
    let at = best.lead.argument?;
    let argument = &arguments[at];
    if let Some(curve) = fitted_curve(best, ground) {
        let z = argument.values.iter().flatten();
        let values = z.map(|&z| curve.at(z)).collect::<Vec<_>>();
        return Some((DVector::from_vec(values), curve.knots));
    }
    let term = best.lead.term;
    if !term.memories.is_empty() || !term.free_strength {
        return None;
    }
    let instance = Instance {
        term,
        argument: Some(at),
        shapes: best.shapes.clone(),
    };
    let values = evaluate(&[instance], arguments, ground.recordings)?;
    let values = best.strength() * DVector::from_vec(values.concat().concat());
    let knots = (1..KNOTS).map(|k| argument.quantile(f64::from(k) / f64::from(KNOTS)));
    Some((values, knots.collect()))
}

/// Steps of a search for shapes: parts of a positive one, else of the standard deviation of the argument.
const FIRST_STEP: f64 = 0.4;
const LAST_STEP: f64 = 0.01;
/// What is left must be less by this part for another round.
const NEARER: f64 = 1e-3;

/// The neighbours of a formula, each with one shape moved.
fn moved(near: &Near, step: f64, spread: f64) -> Vec<(&'static Term, Vec<f64>)> {
    let each = near.term.shapes.iter().enumerate();
    let both = each.flat_map(|(i, shape)| [(i, shape, step), (i, shape, -step)]);
    let of = |(i, shape, step): (usize, &Shape, f64)| {
        let mut shapes = near.shapes.clone();
        match shape.positive {
            true => shapes[i] *= step.exp(),
            false => shapes[i] += step * spread,
        }
        (near.term, shapes)
    };
    both.map(of).collect()
}

/// Takes over what is nearer than what is known of the same term. Whether anything is by more than [`NEARER`].
fn take_nearer(found: &mut Vec<Near>, others: Vec<Near>) -> bool {
    let mut any = false;
    for near in others {
        match found.iter_mut().find(|n| n.term == near.term) {
            Some(known) if near.left < known.left => {
                any |= near.left < (1.0 - NEARER) * known.left;
                *known = near;
            }
            Some(_) => {}
            None => found.push(near),
        }
    }
    any
}

/// What one formula leaves of the function, beside a constant and a slope.
fn regression(
    wanted: &DVector<f64>,
    z: &[f64],
    column: &[f64],
    instance: Instance,
) -> Option<Near> {
    let basis = DMatrix::from_fn(z.len(), 3, |i, j| [1.0, z[i], column[i]][j]);
    let normal = (basis.transpose() * &basis).cholesky()?;
    let regression = normal.solve(&(basis.transpose() * wanted));
    let left = (wanted - &basis * &regression).norm_squared();
    left.is_finite().then(|| Near {
        term: instance.term,
        shapes: instance.shapes,
        strength: match instance.term.free_strength {
            true => regression[2],
            false => 1.0,
        },
        slope: regression[1],
        left,
    })
}

/// The regression of the function on each formula, beside a constant and a slope: those may be what parameters do.
fn nearest(best: &Fitted, arguments: &[Argument], ground: &Ground) -> Option<Vec<Near>> {
    let (wanted, knots) = along_recordings(best, arguments, ground)?;
    let at = best.lead.argument?;
    let argument = &arguments[at];
    let in_equation = matches!(best.lead.place, Place::Equation(_));
    // Of an input also limits and dead zones whose sides differ: a curve of it has both sides already.
    let richer_ones = TERMS.iter().filter(|term| term.port == Port::Input);
    let richer_ones = richer_ones.flat_map(richer);
    let listed = TERMS.iter().chain(richer_ones).filter(|term| {
        let is_function = term.memories.is_empty() && !term.form.contains("delay(");
        let another = *term != best.lead.term;
        let at_place = match best.lead.place {
            Place::Equation(_) => term.port == Port::Equation && term.free_strength,
            Place::Parameter(_) => term.port == Port::Parameter && term.free_strength,
            Place::Input(_) => term.port == Port::Input,
        };
        is_function && another && at_place && argument.serves(term.needs)
    });
    let instances: Vec<Instance> = FORMULAS
        .iter()
        .chain(listed)
        .flat_map(|term| {
            let mut all = grid(term, Some(argument), ground.recordings, &[]);
            // What rises and falls, or steps, may do so at any knot: between quantiles it would be missed.
            if let Some(middle) = term.shapes.iter().position(|s| s.symbol == "o") {
                let first = all.first().map(|shapes| shapes[middle]);
                let widths = all.iter().filter(|s| Some(s[middle]) == first);
                let widths: Vec<Vec<f64>> = widths.cloned().collect();
                for (shapes, knot) in widths
                    .iter()
                    .flat_map(|w| knots.iter().map(move |k| (w, k)))
                {
                    let mut moved = shapes.clone();
                    moved[middle] = *knot;
                    all.push(moved);
                }
            }
            all.into_iter().map(move |shapes| Instance {
                term,
                argument: Some(at),
                shapes,
            })
        })
        .collect();
    // Beyond its ends a curve is level, and the plant without it may run far beyond them: nothing is known there.
    let all: Vec<f64> = argument.values.concat();
    let inside = |z: f64| match (&best.lead.curve, knots.first(), knots.last()) {
        (Some(_), Some(&low), Some(&high)) => (low..=high).contains(&z),
        _ => true,
    };
    let known = |column: &[f64]| -> Vec<f64> {
        let pairs = column.iter().zip(&all).filter(|(_, z)| inside(**z));
        pairs.map(|(value, _)| *value).collect()
    };
    let z = known(&all);
    let wanted = DVector::from_vec(known(wanted.as_slice()));
    let regress = |instances: Vec<Instance>| -> Option<Vec<Near>> {
        let columns = evaluate(&instances, arguments, ground.recordings)?;
        let each = instances.into_iter().zip(columns);
        let near = each.filter_map(|(instance, column)| {
            regression(&wanted, &z, &known(&column.concat()), instance)
        });
        Some(near.collect())
    };
    let mut found: Vec<Near> = Vec::new();
    take_nearer(&mut found, regress(instances)?);
    // How near a formula comes depends on its shapes more than the starts are close.
    let mut step = FIRST_STEP;
    while step > LAST_STEP {
        let formulas = found.iter().filter(|near| near.term.id == FORMULA);
        let neighbours: Vec<Instance> = formulas
            .flat_map(|near| moved(near, step, argument.spread()))
            .map(|(term, shapes)| Instance {
                term,
                argument: Some(at),
                shapes,
            })
            .collect();
        if neighbours.is_empty() || !take_nearer(&mut found, regress(neighbours)?) {
            step *= 0.5;
        }
    }
    found.sort_by(|a, b| a.left.total_cmp(&b.left));
    let mut kept = [0; 2];
    found.retain(|near| {
        let is_formula = near.term.id == FORMULA;
        let (count, most) = match is_formula {
            true => (&mut kept[0], FITTED),
            false => (&mut kept[1], LISTED),
        };
        *count += 1;
        *count <= most
    });
    // A straight line is no curve; from far away its own fit may have ended elsewhere.
    if in_equation && let Some(term) = TERMS.iter().find(|term| term.id == "linear") {
        let basis = DMatrix::from_fn(z.len(), 2, |i, j| [1.0, z[i]][j]);
        let line = (basis.tr_mul(&basis).cholesky()).map(|n| n.solve(&basis.tr_mul(&wanted)));
        found.extend(line.map(|line| Near {
            term,
            shapes: vec![],
            strength: line[1],
            slope: 0.0,
            left: 0.0,
        }));
    }
    Some(found)
}

/// Another term, or another argument, at the place of a fit, fitted from these values of its shapes and its strength.
pub(super) fn in_its_place(
    best: &Fitted,
    (term, argument): (&'static Term, Option<usize>),
    (shapes, strength): (&[f64], f64),
    fitted: &dyn Fn(&Study, &Fit) -> Option<Fit>,
    arguments: &[Argument],
    ground: &Ground,
) -> Option<Fitted> {
    let place = best.lead.place;
    let mut lead = Lead::untested(term, place).at(place, argument, shapes);
    (lead.strength, lead.arrives) = (strength, best.arrives());
    instead(best, lead, fitted, arguments, ground)
}

/// Another lead in the place of a fit's.
pub(super) fn instead(
    best: &Fitted,
    mut lead: Lead,
    fitted: &dyn Fn(&Study, &Fit) -> Option<Fit>,
    arguments: &[Argument],
    ground: &Ground,
) -> Option<Fitted> {
    let (study, plant) = (ground.study, ground.plant);
    lead.sensor = lead.term.port == Port::Sensor;
    let made = candidate(&plant.spec, &lead, arguments, ground.recordings)?;
    let options = with_more(ground.options, made.values.len());
    let rough = made.rough(study, MOST_STEPS);
    let inner = study.of(&rough, &options).ok()?;
    let parameters = study.parameters();
    let without = best.without_term(parameters);
    let start = made.from(&without, parameters);
    let fit = fitted(&inner, &start)?;
    let argument = lead.argument.map(|a| &arguments[a]);
    let fitted = Fitted {
        gain: ground.fit.criterion - fit.criterion - searched(&lead, ground.recordings),
        shapes: fit.point[parameters..][..lead.shapes.len()].to_vec(),
        lead,
        candidate: made,
        fit,
        ..best.clone()
    };
    Some(fitted.depending_on(argument, &plant.spec, ground.recordings))
}
