//! A function that nobody listed, as straight pieces between knots.

use nalgebra::DVector;

use crate::explain::engine::fitting::edit::{Place, literal};
use crate::explain::engine::screening::path::{Entry, Hooked, Path, TOGETHER};
use crate::explain::engine::screening::projection::Projection;
use crate::explain::engine::screening::screen::Lead;
use crate::explain::engine::terms::argument::{Argument, ArgumentForm};
use crate::explain::engine::terms::library::CURVE;
use crate::explain::engine::terms::summands::multiplies_only;
use crate::explain::engine::terms::term::Port;
use crate::noise::Series;
use crate::physics::{ModelSpec, Unknown, VariableKind};

/// Knots of a curve: half of them at quantiles, half at equal distances.
const KNOTS: usize = 9;
/// Knots that are nearer than this part of the range are one.
const NEAREST: f64 = 0.03;
/// Places and arguments that are tried: those of the best terms in equations, of the best at inputs, and at parameters.
const PAIRS: usize = 2;
/// Characteristics of the plant that are tried as curves.
const CHARACTERISTICS: usize = 3;
/// Statistics that differ by less than this part are rounding.
const SAME: f64 = 1e-6;
/// Added to the diagonal of the regression, as a part of it: the straight part of a curve may be what parameters do.
const RIDGE: f64 = 1e-6;

/// Knots of a curve, and its values there.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Curve {
    pub(crate) knots: Vec<f64>,
    pub(crate) values: Vec<f64>,
}

/// Knots over the values of an argument.
pub(in crate::explain::engine) fn knots(argument: &Argument) -> Vec<f64> {
    let (low, high) = (argument.quantile(0.0), argument.quantile(1.0));
    let mut all: Vec<f64> = (0..KNOTS)
        .map(|i| {
            let part = i as f64 / (KNOTS - 1) as f64;
            0.5 * (argument.quantile(part) + low + part * (high - low))
        })
        .collect();
    all.dedup_by(|b, a| *b - *a < NEAREST * (high - low));
    all
}

/// Value at `z` of the piece around a knot: 1 there, 0 at its neighbours, level beyond the ends.
pub(crate) fn piece(knots: &[f64], i: usize, z: f64) -> f64 {
    let rise = i
        .checked_sub(1)
        .map_or(1.0, |b| (z - knots[b]) / (knots[i] - knots[b]));
    let fall = knots.get(i + 1).map_or(1.0, |a| (a - z) / (a - knots[i]));
    rise.min(fall).clamp(0.0, 1.0)
}

/// The same as text.
fn piece_text(knots: &[f64], i: usize, z: &str) -> String {
    let rise = i.checked_sub(1).map(|b| {
        let width = literal(knots[i] - knots[b]);
        format!("({z} - ({}))/{width}", literal(knots[b]))
    });
    let fall = knots.get(i + 1).map(|&a| {
        let width = literal(a - knots[i]);
        format!("(({}) - {z})/{width}", literal(a))
    });
    match (rise, fall) {
        (Some(r), Some(f)) => format!("max(0, min({r}, {f}))"),
        (Some(one), None) | (None, Some(one)) => format!("max(0, min(1, {one}))"),
        (None, None) => "1.0".to_owned(),
    }
}

impl Curve {
    /// Its value where the argument is `z`.
    pub(crate) fn at(&self, z: f64) -> f64 {
        let each = self.values.iter().enumerate();
        each.map(|(i, v)| v * piece(&self.knots, i, z)).sum()
    }

    /// The curve as text, with names for its values.
    pub(crate) fn text(&self, z: &str, names: &[String]) -> String {
        let pieces = names.iter().enumerate();
        let each = pieces.map(|(i, name)| format!("{name}*{}", piece_text(&self.knots, i, z)));
        each.collect::<Vec<_>>().join(" + ")
    }
}

/// Equations that say what a variable is as a function of one other, or of a difference, and that argument: springs, resistances,
/// valves. Their straight lines are curves in truth, however little a test along a wrong run shows of it.
fn characteristics(
    spec: &ModelSpec,
    places: &[Place],
    arguments: &[Argument],
) -> Vec<(Place, usize)> {
    let of = |place: &Place| -> Option<(Place, usize)> {
        let Place::Equation(at) = *place else {
            return None;
        };
        let equation = &spec.equations[at];
        let is_sensor = spec.variable(equation.unknown.variable()).output;
        if is_sensor || matches!(equation.unknown, Unknown::Derivative(_)) {
            return None;
        }
        let mut own = spec.expressions.variables(equation.right);
        own.retain(|&v| {
            let kind = spec.variable(v).kind;
            !matches!(kind, VariableKind::Parameter | VariableKind::Constant)
        });
        own.sort_unstable();
        let is_own = |a: &Argument| {
            let mut variables = a.variables.clone();
            variables.sort_unstable();
            let form = is_of_curves(a.form);
            form && variables == own
        };
        Some((*place, arguments.iter().position(is_own)?))
    };
    places.iter().filter_map(of).take(CHARACTERISTICS).collect()
}

/// Whether a curve of such an argument is one of a quantity, not of what was made of several for one law.
fn is_of_curves(form: ArgumentForm) -> bool {
    matches!(
        form,
        ArgumentForm::Variable | ArgumentForm::Difference | ArgumentForm::Sum
    )
}

/// Curves at the places and of the arguments of the best terms, and of the plant's own characteristics.
pub(in crate::explain::engine) fn curves(
    spec: &ModelSpec,
    leads: &[Lead],
    arguments: &[Argument],
    hooked: &Hooked,
    path: &Path,
    projection: &Projection,
    whiten: &(dyn Fn(&Series) -> Vec<f64> + Sync),
) -> Vec<Lead> {
    let at_port = |port: Port| {
        let mut pairs: Vec<(Place, usize)> = Vec::new();
        let of_port = leads.iter().filter(|lead| lead.term.port == port);
        for lead in of_port.filter(|lead| lead.term.memories.is_empty()) {
            let Some(argument) = lead.argument else {
                continue;
            };
            let form = arguments[argument].form;
            let of_one = is_of_curves(form);
            let of_one = of_one
                && match lead.place {
                    Place::Parameter(p) => {
                        !multiplies_only(spec, p, &arguments[argument].variables)
                    }
                    _ => true,
                };
            if of_one && !pairs.contains(&(lead.place, argument)) {
                pairs.push((lead.place, argument));
            }
        }
        pairs.truncate(PAIRS);
        pairs
    };
    let mut pairs: Vec<(Place, usize)> = [Port::Input, Port::Equation, Port::Parameter]
        .into_iter()
        .flat_map(at_port)
        .collect();
    for pair in characteristics(spec, &hooked.places, arguments) {
        if !pairs.contains(&pair) {
            pairs.push(pair);
        }
    }
    let each = pairs.into_iter().filter_map(|(place, at)| {
        let argument = &arguments[at];
        let hook = hooked.places.iter().position(|p| *p == place)?;
        let knots = knots(argument);
        let signals: Vec<[Series; 2]> = (0..knots.len())
            .map(|i| {
                let of = |values: &Vec<f64>| values.iter().map(|&z| piece(&knots, i, z)).collect();
                [&argument.values, &argument.ends].map(|each| each.iter().map(of).collect())
            })
            .collect();
        let (columns, products): (Vec<Vec<f64>>, Vec<DVector<f64>>) = signals
            .chunks(TOGETHER)
            .flat_map(|signals| {
                let entering: Vec<(&Series, &Series)> =
                    signals.iter().map(|[at, end]| (at, end)).collect();
                path.propagate(Entry::Hook(hooked.columns[hook]), &entering)
            })
            .map(|series| {
                let mut column = whiten(&series);
                let products = projection.off(&mut column);
                (column, products)
            })
            .unzip();
        let regression = projection.regression(&columns, RIDGE)?;
        let statistic = regression.decrease;
        (statistic.is_finite() && knots.len() > 2).then(|| {
            let mut lead = Lead::untested(&CURVE, place);
            (lead.argument, lead.statistic) = (Some(at), statistic);
            lead.shift = projection.shift(&products, &regression);
            let values = regression.values.iter().copied().collect();
            lead.curve = Some(Curve { knots, values });
            lead
        })
    });
    let mut found: Vec<Lead> = Vec::new();
    for lead in each {
        // A function of an input that enters one equation is the same in that equation: it is said of the input.
        let same = |f: &Lead| {
            let apart = (f.statistic - lead.statistic).abs();
            f.argument == lead.argument && apart < SAME * lead.statistic
        };
        if !found.iter().any(same) {
            found.push(lead);
        }
    }
    found.sort_by(|a, b| b.statistic.total_cmp(&a.statistic));
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::{Excitation, Hold, Plant, parse};

    #[test]
    fn text_and_values_of_a_curve_agree() {
        let knots = vec![-2.0, -0.5, 0.25, 3.0];
        let values = [1.0, -2.0, 0.5, 4.0];
        let curve = Curve {
            knots: knots.clone(),
            values: values.to_vec(),
        };
        let names: Vec<String> = values
            .iter()
            .map(|v| format!("({})", literal(*v)))
            .collect();
        let text = format!(
            "model M input Real z; output Real y; equation y = {}; end M;",
            curve.text("z", &names)
        );
        let plant = Plant::new(parse(&text).unwrap());
        let at: Vec<f64> = (0..60).map(|i| -3.0 + 0.12 * f64::from(i)).collect();
        let run = plant
            .simulate(
                &plant.nominal(),
                &Excitation {
                    inputs: &[&at],
                    length: at.len(),
                    sample_time: 1.0,
                    start_time: 0.0,
                    hold: Hold::Zero,
                },
                None,
            )
            .unwrap();
        for (z, y) in at.iter().zip(&run.outputs[0]) {
            let sum: f64 = (0..4).map(|i| values[i] * piece(&knots, i, *z)).sum();
            assert!((sum - y).abs() < 1e-12, "{z}: {sum} {y}");
        }
        assert_eq!(piece(&knots, 1, -0.5), 1.0);
        assert_eq!(piece(&knots, 0, -9.0), 1.0);
    }
}
