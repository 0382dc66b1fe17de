//! What is said of each effect that was found, and of its rivals.

use std::collections::BTreeMap;

use super::Answer;
use crate::explain::engine::edit::{Place, user_of};
use crate::explain::engine::library::Port;
use crate::explain::engine::names::named;
use crate::explain::engine::screen::filled;
use crate::explain::engine::search::{Fitted, NEEDED};
use crate::explain::explanation::{Alternative, EffectFound, Evidence, Law, Quantity, Verdict};
use crate::physics::{Excitation, Hold, Plant};

/// Points of a law.
const LAW_POINTS: usize = 41;

impl Answer<'_> {
    pub(super) fn effect(&self, step: usize, fitted: &Fitted) -> Option<EffectFound> {
        let before = self.spec_before(step);
        let id = named(before, fitted);
        let at = fitted.lead.place.variable(before);
        // A parameter acts through the equation that uses it.
        let entered = match fitted.lead.place {
            Place::Parameter(p) => user_of(before, p),
            _ => at,
        };
        let name = |v| before.variable(v).column().to_owned();
        let (at, enters) = (name(at), name(entered));
        let covariance = self.whole.covariance(&self.found.fit);
        let spec = &self.found.plant.spec;
        let names: Vec<&str> = spec
            .parameters()
            .iter()
            .map(|&v| spec.variable(v).name.as_str())
            .collect();
        let mut parameters = BTreeMap::new();
        for name in &fitted.candidate.names {
            let at = names.iter().position(|n| n == name)?;
            let std = covariance[(at, at)].max(0.0).sqrt();
            parameters.insert(
                name.clone(),
                Quantity {
                    value: self.found.fit.point[at],
                    std: std.is_finite().then_some(std),
                    unit: String::new(),
                },
            );
        }
        let depends = match fitted.lead.term.port {
            Port::Sensor if !fitted.depends.is_empty() => vec![enters.clone()],
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
        Some(EffectFound {
            effect: id.to_owned(),
            variant: fitted.lead.term.id.to_owned(),
            signal: enters.clone(),
            port: match fitted.lead.term.port {
                Port::Input => "input",
                Port::Sensor => "sensor",
                Port::Equation | Port::Parameter => "process",
            }
            .to_owned(),
            equation: fitted.candidate.equation.clone(),
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
                spoken(id),
                fitted.candidate.equation
            ),
        })
    }

    /// What is added to an equation, as a curve of its one argument.
    fn law(&self, fitted: &Fitted) -> Option<Law> {
        let term = fitted.lead.term;
        if term.port != Port::Equation || term.memory.is_some() || fitted.depends.len() != 1 {
            return None;
        }
        let spec = &self.found.plant.spec;
        let names: Vec<&str> = spec
            .parameters()
            .iter()
            .map(|&v| spec.variable(v).name.as_str())
            .collect();
        let shapes: Vec<String> = fitted
            .candidate
            .names
            .iter()
            .filter_map(|n| names.iter().position(|m| m == n))
            .map(|at| format!("({:e})", self.found.fit.point[at]))
            .collect();
        let strength = shapes.last()?;
        let text = filled(term.form, term, "z", "", &shapes, 1.0);
        let curve = crate::physics::parse(&format!(
            "model Law input Real z; output Real y; equation y = {strength}*({text}); end Law;"
        ))
        .ok()?;
        let (low, high) = fitted.range;
        let at: Vec<f64> = (0..LAW_POINTS)
            .map(|i| low + (high - low) * i as f64 / (LAW_POINTS - 1) as f64)
            .collect();
        let inputs = [at.as_slice()];
        let excitation = Excitation {
            inputs: &inputs,
            length: LAW_POINTS,
            sample_time: 1.0,
            start_time: 0.0,
            hold: Hold::Zero,
        };
        let plant = Plant::new(curve);
        let run = plant.simulate(&plant.nominal(), &excitation, None).ok()?;
        Some(Law {
            variable: fitted.depends[0].clone(),
            std: vec![0.0; LAW_POINTS],
            value: run.outputs.into_iter().next()?,
            at,
        })
    }

    pub(super) fn alternatives(&self, verdict: Verdict) -> Vec<Alternative> {
        let Some(first) = self.found.steps.first() else {
            return vec![];
        };
        let best = first.first().map_or(1.0, |f| f.gain).max(1e-9);
        let skip = usize::from(verdict == Verdict::Named);
        let mut seen: Vec<&str> = first
            .iter()
            .take(skip)
            .map(|f| named(&self.plant.spec, f))
            .collect();
        let mut all = Vec::new();
        for fitted in first.iter().skip(skip) {
            let id = named(&self.plant.spec, fitted);
            if seen.contains(&id) || fitted.gain <= 0.0 {
                continue;
            }
            seen.push(id);
            all.push(Alternative {
                effect: id.to_owned(),
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
    let words = id.replace('_', " ");
    let mut letters = words.chars();
    letters.next().map_or(String::new(), |first| {
        first.to_uppercase().collect::<String>() + letters.as_str()
    })
}
