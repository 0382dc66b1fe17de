//! The shortest formula for a function that nobody listed: each is fitted to the function, and the nearest in its place.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::explain::engine::fitting::candidate::candidate;
use crate::explain::engine::fitting::edit::Place;
use crate::explain::engine::fitting::fitted::{Fitted, searched, with_more};
use crate::explain::engine::hypothesis::Ground;
use crate::explain::engine::screening::curve::{Curve, knots, piece};
use crate::explain::engine::screening::projection::Directions;
use crate::explain::engine::screening::screen::Lead;
use crate::explain::engine::terms::argument::Argument;
use crate::explain::engine::terms::library::{CURVE, TERMS};
use crate::explain::engine::terms::richer::richer;
use crate::explain::engine::terms::term::{Needs, Port, Shape, Starts, Term, curve, shape};
use crate::explain::engine::terms::values::{Instance, evaluate, grid};
use crate::explain::engine::thresholds::{MOST_STEPS, ROUNDS, THOROUGH};
use crate::physics::estimate::{Fit, PlantRecording, Study};

/// Id of all of these terms.
pub(in crate::explain::engine) const FORMULA: &str = "formula";

const WIDTHS: Starts = Starts::Spread(&[0.1, 0.2, 0.5, 1.0, 2.0]);
const MIDDLES: Starts = Starts::Quantiles(&[0.1, 0.3, 0.5, 0.7, 0.9]);
const POWERS: Starts = Starts::Powers(&[0.5, 1.0, 1.5, 2.5, 4.0]);

/// Functions of one variable with one or two shapes: powers, growth, decay, saturation, orifices, rise and fall.
const FORMULAS: &[Term] = &[
    curve(
        FORMULA,
        Port::Equation,
        Needs::BothSigns,
        "sign({z})*abs({z})^{p}",
        &[shape("p", POWERS, true)],
    ),
    law("abs({z})^{p}", &[shape("p", POWERS, true)]),
    // Hyperbolas, of what stays away from zero: a load of constant power.
    law("abs({z})^(-{q})", &[shape("q", POWERS, true)]),
    // About a usual value: of an absolute temperature the strength at zero would be beyond all numbers.
    law("exp(({z}{-usual})/{s})", &[shape("s", WIDTHS, true)]),
    law("exp(-({z}{-usual})/{s})", &[shape("s", WIDTHS, true)]),
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
    // ... beside a parameter that is the value at zero.
    law("1/(1 + ({z}/{s})^2) - 1", &[shape("s", WIDTHS, true)]),
    law("exp(-({z}/{s})^2) - 1", &[shape("s", WIDTHS, true)]),
    law(
        "exp(-(({z} - {o})/{s})^2)",
        &[shape("o", MIDDLES, false), shape("s", WIDTHS, true)],
    ),
    law(
        "tanh(({z} - {o})/{s})",
        &[shape("o", MIDDLES, false), shape("s", WIDTHS, true)],
    ),
];
/// Points at which a function is compared with a line, which it is where it is off by less than this part of what it varies by.
const POINTS: usize = 33;
const STRAIGHT: f64 = 0.02;
/// Formulas that are fitted to the recording: those nearest to the curve, and of the terms of the library those nearest to it.
const FITTED: usize = 4;
const LISTED: usize = 2;
/// Points between two knots at which a formula is compared with the straight piece there.
const BETWEEN: usize = 8;

const fn law(form: &'static str, shapes: &'static [Shape]) -> Term {
    curve(FORMULA, Port::Equation, Needs::Anything, form, shapes)
}

/// A formula for the curve, with its start.
struct Near {
    term: &'static Term,
    shapes: Vec<f64>,
    strength: f64,
    /// Its values at the knots.
    values: DVector<f64>,
    /// What it leaves of the residual that the curve could take, as a sum of squares.
    left: f64,
}

/// The formulas near to the function of a fit, fitted in its place; none where it is no function of one variable.
pub(in crate::explain::engine) fn formulas(
    best: &Fitted,
    arguments: &[Argument],
    ground: &Ground,
) -> Option<Vec<Fitted>> {
    let fitted = match &best.lead.curve {
        Some(_) => best.clone(),
        None => as_curve(best, arguments, ground)?,
    };
    let options = with_more(ground.options, fitted.candidate.values.len());
    let rough = fitted.candidate.rough(ground.study, MOST_STEPS);
    let study = ground.study.of(&rough, &options).ok()?;
    let curved = Curved::of(&fitted, &study, ground.study.parameters())?;
    let nearest = nearest(best, &curved, arguments, ground)?;
    let argument = &arguments[best.lead.argument?];
    let found = nearest
        .par_iter()
        .filter_map(|near| {
            let start = (&near.shapes[..], near.strength);
            let refit = |study: &Study, from: &Fit| study.refit(from, ROUNDS, THOROUGH);
            let what = (near.term, best.lead.argument);
            let from =
                |start_of: &Fitted| in_its_place(start_of, what, start, &refit, arguments, ground);
            from(&curved.with(&near.values)).or_else(|| from(&fitted))
        })
        .filter(|f| f.shapes.is_empty() || is_curved(f, argument, ground.recordings));
    Some(found.collect())
}

/// Values of functions of one variable at these points.
fn values_at(
    points: &[f64],
    mut instances: Vec<Instance>,
    argument: &Argument,
    recordings: &[PlantRecording],
) -> Option<Vec<DVector<f64>>> {
    let recording = PlantRecording {
        inputs: vec![],
        outputs: vec![vec![0.0; points.len()]],
        ..recordings.first()?.clone()
    };
    for instance in &mut instances {
        instance.argument = Some(0);
    }
    let values = evaluate(&instances, &[argument.at_points(points)], &[recording])?;
    let each = values.into_iter().map(|v| DVector::from_vec(v.concat()));
    Some(each.collect())
}

/// Whether a fitted formula bends over the values of its argument. One that rises or falls beyond them is a constant there, and others
/// may be straight lines.
fn is_curved(fitted: &Fitted, argument: &Argument, recordings: &[PlantRecording]) -> bool {
    let (low, high) = (argument.quantile(0.0), argument.quantile(1.0));
    let mut shapes = fitted.lead.term.shapes.iter().zip(&fitted.shapes);
    if shapes.any(|(shape, value)| shape.symbol == "o" && !(low..=high).contains(value)) {
        return false;
    }
    let points: Vec<f64> = (0..POINTS)
        .map(|i| low + (high - low) * i as f64 / (POINTS - 1) as f64)
        .collect();
    let instance = Instance {
        term: fitted.lead.term,
        argument: None,
        shapes: fitted.shapes.clone(),
    };
    let values = values_at(&points, vec![instance], argument, recordings);
    let Some(values) = values.and_then(|all| all.into_iter().next()) else {
        return true;
    };
    let line = DMatrix::from_fn(POINTS, 2, |i, j| [1.0, points[i]][j]);
    let off = |of: &DMatrix<f64>| -> Option<f64> {
        let fit = of.tr_mul(of).cholesky()?.solve(&of.tr_mul(&values));
        Some((&values - of * fit).norm())
    };
    let level = off(&line.columns(0, 1).into_owned());
    let parts = off(&line).zip(level);
    parts.is_none_or(|(bent, varies)| bent > STRAIGHT * varies)
}

/// A function as a curve, and what the recording says of its values: how the sum of squares grows with them where all other numbers
/// do their best. What parameters can do in its place, and where no free run comes, does not count in it.
struct Curved<'a> {
    /// The fit with the curve in the place of its term.
    fitted: &'a Fitted,
    study: &'a Study<'a>,
    curve: Curve,
    /// Points along the curve, and what gives the values at the knots that are nearest to values there.
    along: Vec<f64>,
    to_knots: DMatrix<f64>,
    /// Root of the information of the values.
    root: DMatrix<f64>,
    /// What the root makes of the best values.
    wanted: DVector<f64>,
    /// The other numbers, and what each of them changes by when a value does.
    others: Vec<usize>,
    instead: DMatrix<f64>,
}

impl<'a> Curved<'a> {
    /// The numbers of the curve begin at `first`.
    fn of(fitted: &'a Fitted, study: &'a Study<'a>, first: usize) -> Option<Self> {
        let knots = fitted.lead.curve.as_ref()?.knots.clone();
        let own = first..first + knots.len();
        let values = fitted.fit.point[own.clone()].to_vec();
        let inside = study.inside(&fitted.fit).into_iter();
        let others: Vec<usize> = inside.filter(|i| !own.contains(i)).collect();
        // A row more for each of the others, which says how far it may be: where they scale with the curve, all of them could vanish.
        let derivatives = study.all_derivatives(&fitted.fit)?;
        let samples = derivatives.nrows();
        let rows = samples + others.len();
        let values_alone = derivatives.columns(own.start, knots.len()).into_owned();
        let mut of_values = values_alone.resize_vertically(rows, 0.0);
        let mut of_others = derivatives
            .select_columns(&others)
            .resize_vertically(rows, 0.0);
        let reaches = study.reaches(&fitted.fit);
        for (j, &i) in others.iter().enumerate() {
            of_others[(samples + j, j)] = 12.0_f64.sqrt() / reaches[i];
        }
        let directions = Directions::of(of_others)?;
        let instead = of_values.column_iter_mut().map(|mut column| {
            let products = directions.off(column.as_mut_slice());
            -&directions.numbers * products
        });
        let instead = DMatrix::from_columns(&instead.collect::<Vec<_>>());
        let residual = DVector::from_vec(study.weighted_residual(&fitted.fit)?);
        let residual = residual.resize_vertically(rows, 0.0);
        let pieces = knots.windows(2).flat_map(|k| {
            let part = move |j: usize| k[0] + (k[1] - k[0]) * j as f64 / BETWEEN as f64;
            (0..BETWEEN).map(part)
        });
        let along: Vec<f64> = pieces.chain(knots.last().copied()).collect();
        let hats = DMatrix::from_fn(along.len(), knots.len(), |i, j| piece(&knots, j, along[i]));
        let to_knots = hats.tr_mul(&hats).cholesky()?.solve(&hats.transpose());
        let parts = of_values.qr();
        let root = parts.r();
        let curve = Curve { knots, values };
        let best = DVector::from_column_slice(&curve.values);
        let wanted = parts.q().tr_mul(&residual) + &root * best;
        Some(Self {
            fitted,
            study,
            curve,
            along,
            to_knots,
            root,
            wanted,
            others,
            instead,
        })
    }

    /// The fit with all other numbers where they do their best beside these values, as far as they are linear.
    fn with(&self, values: &DVector<f64>) -> Fitted {
        let change = values - DVector::from_column_slice(&self.curve.values);
        let mut shift = vec![0.0; self.fitted.fit.point.len()];
        for (&i, s) in self.others.iter().zip(&(&self.instead * change)) {
            shift[i] = *s;
        }
        let point = self.study.moved(&self.fitted.fit, &shift);
        let mut fitted = self.fitted.clone();
        fitted.fit.point = point;
        fitted
    }

    /// What values of a formula, but for its strength, leave.
    fn regression(&self, instance: Instance, values: DVector<f64>) -> Option<Near> {
        let column = &self.root * &values;
        let strength = match instance.term.free_strength {
            true => column.dot(&self.wanted) / column.norm_squared(),
            false => 1.0,
        };
        let left = (&self.wanted - strength * column).norm_squared();
        left.is_finite().then(|| Near {
            term: instance.term,
            shapes: instance.shapes,
            strength,
            values: strength * values,
            left,
        })
    }

    /// Whether less is left than the function explains, with all that its numbers cost.
    fn is_part(&self, near: &Near, best: &Fitted) -> bool {
        let cost = self.study.cost_of_a_number() * self.curve.knots.len() as f64;
        self.study.information() * near.left < best.gain + cost
    }

    /// Formulas as curves with the same knots, each the nearest to it, and what they leave.
    fn regressions(
        &self,
        instances: Vec<Instance>,
        argument: &Argument,
        recordings: &[PlantRecording],
    ) -> Option<Vec<Near>> {
        let values = values_at(&self.along, instances.clone(), argument, recordings)?;
        let each = instances.into_iter().zip(values);
        let near = each
            .filter_map(|(instance, values)| self.regression(instance, &self.to_knots * values));
        Some(near.collect())
    }
}

/// A fit with a curve in the place of its term, a function of one variable.
fn as_curve(best: &Fitted, arguments: &[Argument], ground: &Ground) -> Option<Fitted> {
    let (term, at) = (best.lead.term, best.lead.argument?);
    if !term.memories.is_empty() || !term.free_strength {
        return None;
    }
    let knots = knots(&arguments[at]);
    let instance = Instance {
        term,
        argument: None,
        shapes: best.shapes.clone(),
    };
    let values = values_at(&knots, vec![instance], &arguments[at], ground.recordings)?;
    let values = values.first()?.iter();
    let values = values.map(|v| best.strength() * v).collect();
    let mut lead = Lead::untested(&CURVE, best.lead.place).at(best.lead.place, Some(at), &[]);
    lead.arrives = best.arrives();
    lead.curve = Some(Curve { knots, values });
    let parameters = ground.study.parameters();
    let made = candidate(&ground.plant.spec, &lead, arguments, ground.recordings)?;
    let fit = made.from(&best.without_term(parameters), parameters);
    Some(Fitted {
        lead,
        candidate: made,
        fit,
        shapes: vec![],
        ..best.clone()
    })
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

/// The formulas that leave least.
fn nearest(
    best: &Fitted,
    curved: &Curved,
    arguments: &[Argument],
    ground: &Ground,
) -> Option<Vec<Near>> {
    let knots = &curved.curve.knots;
    let at = best.lead.argument?;
    let argument = &arguments[at];
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
    let of_argument = FORMULAS.iter().filter(|term| argument.serves(term.needs));
    let instances: Vec<Instance> = of_argument
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
    let regress = |instances| curved.regressions(instances, argument, ground.recordings);
    let mut found: Vec<Near> = Vec::new();
    take_nearer(&mut found, regress(instances)?);
    // How near a formula comes depends on its shapes more than the starts are close.
    let mut step = FIRST_STEP;
    while step > LAST_STEP {
        let neighbours: Vec<Instance> = (found.iter())
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
        let (count, most) = match near.term.id {
            FORMULA => (&mut kept[0], FITTED),
            // A straight line is no curve; from far away its own fit may have ended elsewhere.
            "linear" => return true,
            _ => (&mut kept[1], LISTED),
        };
        *count += 1;
        *count <= most && curved.is_part(near, best)
    });
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
