//! What is said of each effect that was found, and of its rivals.

use std::collections::BTreeMap;

use super::Answer;
use crate::explain::engine::fitting::edit::{Place, user_of};
use crate::explain::engine::fitting::fitted::Fitted;
use crate::explain::engine::screening::curve::Curve;
use crate::explain::engine::terms::term::Port;
use crate::explain::engine::terms::values::filled;
use crate::explain::engine::thresholds::NEEDED;
use crate::explain::explanation::{Alternative, EffectFound, Evidence, Law, Quantity, Verdict};
use crate::physics::{Excitation, Hold, Plant, VariableId, parse};

/// Points of a law.
const LAW_POINTS: usize = 41;
/// Step of the differences that give a law's slopes, as a part of a parameter.
const DIFFERENCE: f64 = 1e-4;

impl Answer<'_> {
    pub(super) fn effect(&self, step: usize, fitted: &Fitted) -> Option<EffectFound> {
        let before = self.spec_before(step);
        let id = self.called(before, fitted);
        let at = fitted.lead.place.variable(before);
        // A parameter acts through the equation that uses it.
        let entered = match fitted.lead.place {
            Place::Parameter(p) => user_of(before, p),
            _ => at,
        };
        let name = |v| before.variable(v).column().to_owned();
        let (at, enters) = (name(at), name(entered));
        let covariance = &self.within_bounds;
        let mut parameters = BTreeMap::new();
        for (name, at) in self.parameters_of(fitted) {
            let std = covariance[(at, at)].max(0.0).sqrt();
            parameters.insert(
                name.clone(),
                Quantity {
                    value: self.found.fit.point[at],
                    std: std.is_finite().then_some(std),
                    unit: self.unit(name),
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
            Place::Equation(_) => format!("the equation of {enters}"),
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

    /// The unit of a parameter in words; empty for a pure number.
    pub(super) fn unit(&self, parameter: &str) -> String {
        let variable = self.found.plant.spec.find(parameter);
        let unit = variable.and_then(|v| self.units[v.index()].clone());
        unit.filter(|u| u != "1").unwrap_or_default()
    }

    /// What is added to an equation, as a curve of its one argument, with its standard deviation.
    fn law(&self, fitted: &Fitted) -> Option<Law> {
        let term = fitted.lead.term;
        if term.port != Port::Equation || !term.memories.is_empty() {
            return None;
        }
        // Of a difference or a product of variables, it is the curve of that.
        let variable = match fitted.depends.as_slice() {
            [] => return None,
            [one] => one.clone(),
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
            let step = DIFFERENCE * (values[i].abs() + covariance[(p, p)].max(0.0).sqrt());
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
            let std = variance.max(0.0).sqrt();
            if std.is_finite() { std } else { unknown }
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
        let text = match fitted.hypothesis.and_then(|i| self.hypotheses.get(i)) {
            Some(hypothesis) => hypothesis.as_law("z", |word| {
                let own = hypothesis.numbers().iter().position(|n| n.name == word);
                let value = match own {
                    Some(i) => values[i],
                    None => {
                        let spec = &self.found.plant.spec;
                        let parameters = spec.parameters();
                        let at = parameters
                            .iter()
                            .position(|&v| spec.variable(v).name == word)?;
                        self.found.fit.point[at]
                    }
                };
                Some(format!("({value:e})"))
            })?,
            None => {
                let shapes: Vec<String> = values.iter().map(|v| format!("({v:e})")).collect();
                let strength = shapes.last()?;
                let argument = match fitted.depends.as_slice() {
                    [one] => fitted.argument.replace(one, "z"),
                    _ => "z".to_owned(),
                };
                let form = filled(term.form, term, &argument, &[], &shapes, 1.0);
                format!("{strength}*({form})")
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

    pub(super) fn alternatives(&self, verdict: Verdict) -> Vec<Alternative> {
        let Some(first) = self.found.steps.first() else {
            return vec![];
        };
        let best = first.first().map_or(1.0, |f| f.gain).max(1e-9);
        let skip = usize::from(verdict == Verdict::Named);
        let mut seen: Vec<String> = first
            .iter()
            .take(skip)
            .map(|f| self.called(&self.plant.spec, f))
            .collect();
        let mut all = Vec::new();
        for fitted in first.iter().skip(skip) {
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
                    "{}: its criterion gains {:.1}, that of the best {:.1}",
                    fitted.candidate.equation, fitted.gain, best
                ),
            });
        }
        all
    }
}

/// The id in words, as a sentence begins with it.
fn spoken(id: &str) -> String {
    if id == "law" {
        return "An unlisted function".to_owned();
    }
    let words = id.replace('_', " ");
    let mut letters = words.chars();
    letters.next().map_or(String::new(), |first| {
        first.to_uppercase().collect::<String>() + letters.as_str()
    })
}
