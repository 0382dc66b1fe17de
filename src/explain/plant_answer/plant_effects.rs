//! What is said of each effect that was found, and of its rivals.

use std::collections::BTreeMap;

use nalgebra::DMatrix;

use super::Answer;
use super::formula_in_numbers::{in_numbers, with_short_literals};
use crate::explain::document::sentences::{number, quantity};
use crate::explain::engine::fitting::edit::{Place, is_shared_term, user_of};
use crate::explain::engine::fitting::fitted::Fitted;
use crate::explain::engine::hypothesis::Hypothesis;
use crate::explain::engine::screening::curve::Curve;
use crate::explain::engine::terms::term::{Port, Starts};
use crate::explain::engine::terms::values::{about_usual, filled};
use crate::explain::engine::thresholds::NEEDED;
use crate::explain::explanation::{Alternative, EffectFound, Evidence, Law, Quantity};
use crate::physics::{Excitation, Hold, ModelSpec, Plant, VariableId, parse};

/// Points of a law.
const LAW_POINTS: usize = 41;
/// Parameters of an effect that the summary lists.
const MOST_ESTIMATES: usize = 6;
/// Points of a curve that it lists.
/// Of a curve whose shape is known so many times better than its values, the deviations of the shape are said.
const MOSTLY_LINE: f64 = 0.5;
const MOST_POINTS: usize = 12;
/// Step of the differences that give a law's slopes, as a part of a parameter.
const DIFFERENCE: f64 = 1e-4;

/// A difference of temperatures in degC is one in K.
fn of_a_difference(unit: String) -> String {
    match unit.as_str() {
        "degC" => "K".to_owned(),
        _ => unit,
    }
}

/// The unit of the one variable that an effect depends on, as the text has it: an angle in degrees is no pure number to read.
fn unit_of_argument(fitted: &Fitted, spec: &ModelSpec) -> Option<String> {
    let [name] = &fitted.depends[..] else {
        return None;
    };
    let variable = spec.variable(spec.find(name)?);
    (fitted.argument == *name).then(|| variable.unit_text.clone())?
}

impl Answer<'_> {
    pub(super) fn effect(&self, step: usize, fitted: &Fitted) -> Option<EffectFound> {
        let before = self.spec_before(step);
        let id = self.called(before, fitted);
        let at = fitted.lead.place.variable(before);
        // A parameter acts through the equation that uses it, and what several rates share through these.
        let entered = match fitted.lead.place {
            Place::Parameter(p) => user_of(before, p),
            _ => at,
        };
        let entered = match is_shared_term(before, entered) {
            true => user_of(before, entered),
            false => entered,
        };
        let name = |v| before.variable(v).column().to_owned();
        let (at, enters) = (name(at), name(entered));
        let covariance = &self.within_bounds;
        let is_offset = fitted.lead.sensor && fitted.lead.term.form == "1.0";
        let mut parameters = BTreeMap::new();
        for (i, (name, at)) in self.parameters_of(fitted).enumerate() {
            let std = covariance[(at, at)].max(0.0).sqrt();
            let shape = fitted.lead.term.shapes.get(i);
            let unit = match shape {
                Some(shape) if shape.is_value() => unit_of_argument(fitted, &self.plant.spec),
                None if is_offset => before.variable(entered).unit_text.clone(),
                _ => None,
            };
            parameters.insert(
                name.clone(),
                Quantity {
                    value: self.found.fit.point[at],
                    std: std.is_finite().then_some(std),
                    unit: unit.unwrap_or_else(|| of_a_difference(self.unit(name))),
                },
            );
        }
        let depends = match fitted.lead.term.port {
            _ if fitted.depends.is_empty() && fitted.lead.term.form.contains("time") => {
                vec!["time".to_owned()]
            }
            _ => fitted.depends.clone(),
        };
        let depends = match fitted.lead.place {
            Place::Parameter(_) => depends.into_iter().chain([at.clone()]).collect(),
            _ => depends,
        };
        let place = match fitted.lead.place {
            Place::Equation(_) if fitted.lead.sensor => format!("the sensor {enters}"),
            Place::Equation(_) => match fitted.lead.arrives {
                Some((other, _)) => {
                    let other = before.equations[other].unknown.variable();
                    format!("the equations of {at} and {}", name(other))
                }
                None => format!("the equation of {at}"),
            },
            Place::Input(_) => format!("the input {enters}"),
            Place::Parameter(_) => format!("the parameter {at}"),
        };
        let of = match fitted.depends.as_slice() {
            [] if depends.iter().any(|d| d == "time") => " as a function of time".to_owned(),
            [] => String::new(),
            names => format!(" as a function of {}", names.join(" and ")),
        };
        let equation = fitted.candidate.equation.clone();
        // A curve is called f: its pieces are no reading.
        let readable = match &fitted.lead.curve {
            Some(curve) => {
                let values = fitted.candidate.names.iter().rev().take(curve.values.len());
                let names: Vec<String> = values.rev().cloned().collect();
                let argument = &fitted.argument;
                let text = format!("({})", curve.text(argument, &names));
                equation.replace(&text, &format!("f({argument})"))
            }
            None => equation.clone(),
        };
        let readable = with_short_literals(&readable, &self.own_text());
        Some(EffectFound {
            hypothesis: fitted.hypothesis.is_some(),
            effect: id.clone(),
            variant: fitted.lead.term.id.to_owned(),
            signal: enters.clone(),
            port: match fitted.lead.term.port {
                Port::Input => "input",
                Port::Sensor => "sensor",
                Port::Equation | Port::Parameter => "process",
            }
            .to_owned(),
            equation,
            law: self.law(fitted),
            enters: Some(enters),
            depends,
            parameters,
            evidence: Evidence {
                criterion_gain: fitted.gain,
                criterion_needed: NEEDED,
                heldout_gain: None,
                halves_disagree: None,
            },
            sentence: format!(
                "{} enters {place}{of}: {}",
                match fitted.hypothesis {
                    Some(_) => format!("The hypothesis {id}"),
                    None => spoken(&id),
                },
                readable
            ),
        })
    }

    /// The parameters of an effect, with their positions among those of the whole plant.
    pub(super) fn parameters_of<'f>(
        &'f self,
        fitted: &'f Fitted,
    ) -> impl Iterator<Item = (&'f String, usize)> + 'f {
        let spec = &self.found.plant.spec;
        let position = |name: &str| {
            let called = |&v: &VariableId| spec.variable(v).name == name;
            spec.parameters().iter().position(called)
        };
        fitted
            .candidate
            .names
            .iter()
            .filter_map(move |name| Some((name, position(name)?)))
    }

    /// The text of the plant and of the hypotheses.
    fn own_text(&self) -> String {
        let hypotheses = self.hypotheses.iter().map(Hypothesis::text);
        let texts = std::iter::once(self.plant.spec.text.as_str()).chain(hypotheses);
        texts.collect::<Vec<_>>().join(" ")
    }

    /// The parameters of an effect with their standard deviations, or its curve with them; none where there are many. `label` says
    /// whose they are. Of a parameter that changes also what it is besides.
    pub(super) fn estimates(
        &self,
        fitted: &Fitted,
        effect: &EffectFound,
        label: &str,
    ) -> Vec<String> {
        let mut lines = self.own_estimates(fitted, effect, label);
        // What a parameter is besides, which may differ from the text without being surely different; and beside a curve those of its
        // equation, from which it counts.
        let (given, place) = (&self.plant.spec, fitted.lead.place);
        let replaced = fitted
            .hypothesis
            .is_some_and(|which| self.hypotheses[which].replaces());
        let beside: Vec<VariableId> = match place {
            Place::Parameter(v) if !replaced => vec![v],
            place if fitted.lead.curve.is_some() => {
                let parameters = given.parameters().into_iter();
                parameters.filter(|&v| place.uses(given, v)).collect()
            }
            _ => vec![],
        };
        let spec = &self.found.plant.spec;
        let known = beside.into_iter().filter_map(|v| {
            let name = &given.variable(v).name;
            let called = |&v: &VariableId| spec.variable(v).name == *name;
            let at = spec.parameters().iter().position(called)?;
            let (value, std, unit) = (*self.found.fit.point.get(at)?, None, self.unit(name));
            let quantity = quantity(&Quantity { value, std, unit });
            Some(format!("{name} = {quantity}"))
        });
        let known: Vec<String> = known.collect();
        if !known.is_empty() {
            lines.push(format!("There, {}.", known.join(", ")));
        }
        lines
    }

    fn own_estimates(&self, fitted: &Fitted, effect: &EffectFound, label: &str) -> Vec<String> {
        let mut all: Vec<(&String, &Quantity)> = Vec::new();
        for name in &fitted.candidate.names {
            all.extend(effect.parameters.get(name).map(|q| (name, q)));
        }
        if let Some(curve) = &fitted.lead.curve {
            let mut values: Vec<Quantity> = all.iter().map(|(_, q)| (*q).clone()).collect();
            let numbers: Vec<usize> = self.parameters_of(fitted).map(|(_, at)| at).collect();
            let covariance = DMatrix::from_fn(numbers.len(), numbers.len(), |i, j| {
                self.within_bounds[(numbers[i], numbers[j])]
            });
            let shape = beside_a_line(&curve.knots, &covariance);
            if let Some(shape) = &shape {
                let each = values.iter_mut().zip(shape);
                each.for_each(|(value, std)| value.std = Some(*std));
            }
            let points: Vec<(f64, &Quantity)> = curve.knots.iter().copied().zip(&values).collect();
            let mut lines: Vec<String> = curve_in_numbers(&fitted.argument, &points)
                .into_iter()
                .collect();
            lines.extend(shape.map(|_| {
                "These deviations are those of its shape: what is a straight line in it, parameters of the equations do as well."
                    .to_owned()
            }));
            return lines;
        }
        if !(1..=MOST_ESTIMATES).contains(&all.len()) {
            return vec![];
        }
        let angular = |name: &str| {
            let mut shapes = fitted.lead.term.shapes.iter().zip(&fitted.candidate.names);
            shapes.any(|(shape, n)| n == name && shape.starts == Starts::Peaks)
        };
        let each = all.iter().map(|(name, q)| {
            let period = match angular(name) {
                true => format!(" (period {})", quantity(&period(q))),
                false => String::new(),
            };
            format!("{name} = {}{period}", quantity(q))
        });
        let each: Vec<String> = each.collect();
        let mut lines = vec![format!("{label}: {}.", each.join("; "))];
        // The names of an unlisted function say nothing about its form.
        if effect.effect == "law" {
            let formula = with_short_literals(&effect.equation, &self.own_text());
            let formula = in_numbers(&formula, &effect.parameters);
            lines.push(format!("In numbers: {formula}."));
        }
        lines
    }

    /// The unit of a parameter in words; empty for a pure number.
    pub(super) fn unit(&self, parameter: &str) -> String {
        let variable = self.found.plant.spec.find(parameter);
        let unit = variable.and_then(|v| self.units[v.index()].clone());
        unit.filter(|u| u != "1").unwrap_or_default()
    }

    /// What is added to an equation, as a curve of its one argument, with its standard deviation.
    pub(super) fn law(&self, fitted: &Fitted) -> Option<Law> {
        let term = fitted.lead.term;
        if term.port != Port::Equation || !term.memories.is_empty() {
            return None;
        }
        // Of a difference or a product of variables, it is the curve of that.
        let variable = match fitted.depends.as_slice() {
            [] => return None,
            [one] if fitted.hypothesis.is_some() => one.clone(),
            _ if fitted.hypothesis.is_some() => return None,
            _ => fitted.argument.clone(),
        };
        let at_point: Vec<usize> = self.parameters_of(fitted).map(|(_, at)| at).collect();
        let values: Vec<f64> = at_point.iter().map(|&i| self.found.fit.point[i]).collect();
        let (low, high) = fitted.range;
        let at: Vec<f64> = (0..LAW_POINTS)
            .map(|i| low + (high - low) * i as f64 / (LAW_POINTS - 1) as f64)
            .collect();
        let value = self.curve_of(fitted, &values, &at)?;
        let covariance = &self.within_bounds;
        let mut slopes = Vec::new();
        for (i, &p) in at_point.iter().enumerate() {
            let std = covariance[(p, p)].max(0.0).sqrt();
            let step = DIFFERENCE * (values[i].abs() + if std.is_finite() { std } else { 0.0 });
            let mut moved = values.clone();
            moved[i] += step;
            let there = self.curve_of(fitted, &moved, &at)?;
            slopes.push(
                there
                    .iter()
                    .zip(&value)
                    .map(|(a, b)| if step > 0.0 { (a - b) / step } else { 0.0 })
                    .collect::<Vec<f64>>(),
            );
        }
        // Where nothing is known, the law may be as large as anywhere.
        let unknown = value.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        let std = (0..at.len()).map(|k| {
            let mut variance = 0.0;
            for (i, &p) in at_point.iter().enumerate() {
                for (j, &q) in at_point.iter().enumerate() {
                    // A knot that no sample is near has an infinite variance, which is of no matter elsewhere.
                    let slopes = slopes[i][k] * slopes[j][k];
                    if slopes != 0.0 {
                        variance += slopes * covariance[(p, q)];
                    }
                }
            }
            if variance.is_finite() {
                variance.max(0.0).sqrt()
            } else {
                unknown
            }
        });
        Some(Law {
            variable,
            std: std.collect(),
            value,
            at,
        })
    }

    /// What a term adds where its argument has these values, with these values of its numbers.
    fn curve_of(&self, fitted: &Fitted, values: &[f64], at: &[f64]) -> Option<Vec<f64>> {
        if let Some(curve) = &fitted.lead.curve {
            let curve = Curve {
                knots: curve.knots.clone(),
                values: values.to_vec(),
            };
            return Some(at.iter().map(|&z| curve.at(z)).collect());
        }
        let term = fitted.lead.term;
        let parameter = |name: &str| {
            let spec = &self.found.plant.spec;
            let mut parameters = spec.parameters().into_iter();
            let at = parameters.position(|v| spec.variable(v).name == name)?;
            Some(format!("({:e})", self.found.fit.point[at]))
        };
        let text = match fitted.hypothesis.and_then(|i| self.hypotheses.get(i)) {
            Some(hypothesis) => hypothesis.as_law("z", |word| {
                let own = hypothesis.numbers().iter().position(|n| n.name == word);
                own.map_or_else(|| parameter(word), |i| Some(format!("({:e})", values[i])))
            })?,
            None => {
                let shapes: Vec<String> = values.iter().map(|v| format!("({v:e})")).collect();
                let strength = shapes.get(term.shapes.len())?;
                let form = filled(term.form, term, "z", &[], &shapes, (0.0, 1.0));
                format!("{strength}*({})", about_usual(&form, fitted.usual))
            }
        };
        let text = format!("model Law input Real z; output Real y; equation y = {text}; end Law;");
        let inputs = [at];
        let excitation = Excitation {
            inputs: &inputs,
            length: at.len(),
            sample_time: 1.0,
            start_time: 0.0,
            hold: Hold::Zero,
        };
        let plant = Plant::new(parse(&text).ok()?);
        let run = plant.simulate(&plant.nominal(), &excitation, None).ok()?;
        run.outputs.into_iter().next()
    }

    /// What else was tried first, without what is the answer or the closest to one.
    pub(super) fn alternatives(&self) -> Vec<Alternative> {
        let Some(first) = self.found.steps.first() else {
            return vec![];
        };
        let own = self.effects().enumerate();
        let mut seen: Vec<String> = own
            .map(|(step, f)| self.called(self.spec_before(step), f))
            .collect();
        let answer = seen.first().map(|id| id.replace('_', " "));
        let best = first.first().map_or(1.0, |f| f.gain).max(1e-9);
        let mut all = Vec::new();
        for fitted in first {
            let id = self.called(&self.plant.spec, fitted);
            if seen.contains(&id) || fitted.gain <= 0.0 {
                continue;
            }
            seen.push(id.clone());
            all.push(Alternative {
                effect: id,
                support: (fitted.gain / best).clamp(0.0, 1.0),
                criterion_gain: fitted.gain,
                why_not: format!(
                    "{}: {}",
                    fitted.candidate.equation,
                    lost(fitted.gain, best, answer.as_deref())
                ),
            });
        }
        all
    }
}

/// Why something is not the answer that gains so much in the criterion; `best` is the gain of the answer, or without one of the
/// best.
fn lost(gain: f64, best: f64, answer: Option<&str>) -> String {
    match answer {
        Some(answer) if gain <= best => {
            format!("its criterion gains {gain:.1}, that of {answer} {best:.1}")
        }
        Some(answer) => {
            format!("its criterion gains {gain:.1}, but {answer} explains more of held-out blocks")
        }
        None if gain < NEEDED => {
            format!("its criterion gains {gain:.1}, and {NEEDED:.1} is needed")
        }
        None => format!(
            "its criterion gains {gain:.1} ({NEEDED:.1} is needed), but the held-out comparison does not accept it"
        ),
    }
}

/// The period of an angular frequency, in hours where it is at least two of them.
fn period(frequency: &Quantity) -> Quantity {
    const HOUR: f64 = 3600.0;
    let seconds = std::f64::consts::TAU / frequency.value.abs();
    let relative = frequency.std.map(|s| s / frequency.value.abs());
    let (value, unit) = match seconds >= 2.0 * HOUR {
        true => (seconds / HOUR, "h"),
        false => (seconds, "s"),
    };
    Quantity {
        value,
        std: relative.map(|r| r * value),
        unit: unit.to_owned(),
    }
}

/// Standard deviations of the values of a curve beside a straight line through them, where most of what is not known is that line.
fn beside_a_line(knots: &[f64], covariance: &DMatrix<f64>) -> Option<Vec<f64>> {
    let m = knots.len();
    if covariance.nrows() != m || m <= 2 || covariance.iter().any(|c| !c.is_finite()) {
        return None;
    }
    let (first, range) = (knots[0], knots[m - 1] - knots[0]);
    let line = DMatrix::from_fn(m, 2, |i, j| [1.0, (knots[i] - first) / range][j]);
    let normal = (line.transpose() * &line).try_inverse()?;
    let off = DMatrix::identity(m, m) - &line * normal * line.transpose();
    let shape = &off * covariance * off.transpose();
    let std = |of: &DMatrix<f64>| -> Vec<f64> {
        of.diagonal().iter().map(|v| v.max(0.0).sqrt()).collect()
    };
    let (whole, shape) = (std(covariance), std(&shape));
    let mostly = whole
        .iter()
        .zip(&shape)
        .all(|(whole, shape)| *shape < MOSTLY_LINE * whole);
    mostly.then_some(shape)
}

/// A curve at its knots, or at some of many.
fn curve_in_numbers(argument: &str, points: &[(f64, &Quantity)]) -> Option<String> {
    let last = points.len().checked_sub(1)?;
    let shown = points.len().min(MOST_POINTS);
    let each: Vec<String> = (0..shown)
        .map(|i| points[i * last / (shown - 1).max(1)])
        .map(|(at, value)| format!("{} at {}", quantity(value), number(at)))
        .collect();
    let between = match shown == points.len() {
        true => "linear between these values",
        false => "these are some of its values",
    };
    Some(format!("f({argument}) = {}; {between}.", each.join(", ")))
}

/// The id in words, as a sentence begins with it.
pub(crate) fn spoken(id: &str) -> String {
    if id == "law" {
        return "An unlisted function".to_owned();
    }
    let words = id.replace('_', " ");
    let mut letters = words.chars();
    letters.next().map_or(String::new(), |first| {
        first.to_uppercase().collect::<String>() + letters.as_str()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(value: f64, std: f64, unit: &str) -> Quantity {
        Quantity {
            value,
            std: Some(std),
            unit: unit.to_owned(),
        }
    }

    #[test]
    fn a_curve_beside_a_line_that_parameters_do_is_known_better_than_its_values() {
        let knots = [0.0, 1.0, 2.0, 4.0];
        let own = |i: usize, j: usize| if i == j { 0.01 } else { 0.0 };
        let shared = |i: usize, j: usize| 1.0 + 0.3 * knots[i] * knots[j];
        let both = DMatrix::from_fn(4, 4, |i, j| own(i, j) + shared(i, j));
        let shape = beside_a_line(&knots, &both).unwrap();
        // What is left of independent values: less than each of them has.
        assert!(shape.iter().all(|s| *s < 0.1), "{shape:?}");
        // Nothing is shared: the values are what is known.
        assert_eq!(beside_a_line(&knots, &DMatrix::from_fn(4, 4, own)), None);
    }

    #[test]
    fn a_frequency_has_a_period() {
        let said = quantity(&period(&measured(0.020_943_3, 0.000_195_4, "1/s")));
        assert_eq!(said, "300.0 +- 2.8 s");
        let said = quantity(&period(&measured(1.4497e-4, 5.7e-7, "1/s")));
        assert_eq!(said, "12.039 +- 0.047 h");
    }

    #[test]
    fn a_curve_is_told_at_its_knots() {
        let values = [measured(1.25, 0.1, "N"), measured(-0.5, 0.05, "N")];
        let two = [(-2.0, &values[0]), (3.5, &values[1])];
        assert_eq!(
            curve_in_numbers("v", &two).unwrap(),
            "f(v) = 1.25 +- 0.10 N at -2.000, -0.500 +- 0.050 N at 3.500; linear between these values."
        );
        let many: Vec<(f64, &Quantity)> = (0..40).map(|i| (f64::from(i), &values[0])).collect();
        let said = curve_in_numbers("v", &many).unwrap();
        assert_eq!(said.matches(" at ").count(), MOST_POINTS, "{said}");
        assert!(said.contains("at 39.00; these are some"), "{said}");
        assert_eq!(curve_in_numbers("v", &[]), None);
    }

    #[test]
    fn what_lost_is_told_why() {
        let said = |gain, best, answer| lost(gain, best, answer);
        assert!(said(3.0, 40.0, Some("drag")).ends_with("that of drag 40.0"));
        assert!(said(30.0, 4.5, Some("drag")).ends_with("explains more of held-out blocks"));
        assert!(said(4.5, 4.5, None).ends_with("16.0 is needed"));
        assert!(said(123.3, 123.3, None).ends_with("held-out comparison does not accept it"));
    }
}
