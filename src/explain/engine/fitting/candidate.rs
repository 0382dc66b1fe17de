//! A lead made into a plant that can be fitted.

use crate::explain::engine::fitting::edit::{Edit, NewParameter, Place, acting, literal};
use crate::explain::engine::screening::screen::Lead;
use crate::explain::engine::terms::argument::Argument;
use crate::explain::engine::terms::names::is_without_units;
use crate::explain::engine::terms::term::{Needs, Port, Starts};
use crate::explain::engine::terms::values::{FAST, about_usual, filled};
use crate::explain::engine::thresholds::{GLANCED_ACCURACY, limited};
use crate::physics::estimate::{Fit, PlantRecording, Study};
use crate::physics::{ModelSpec, Node, Plant};

/// Shortest time constant, in samples.
const LEAST_SAMPLES: f64 = 0.1;
/// Narrowest width, as a part of the argument's standard deviation.
const LEAST_SPREAD: f64 = 1e-3;

/// Least and most part of a whole.
const LEAST_SHARE: (f64, f64) = (0.001, 0.95);
/// Least and greatest power: laws of physics have powers from 1/4 (laminar convection) to 4 (radiation).
const POWERS: (f64, f64) = (0.25, 4.0);
/// Least yield of bristles, as a part of the value that is started from.
const LEAST_YIELD: f64 = 0.05;

/// A plant with a term more.
#[derive(Debug, Clone)]
pub(crate) struct Candidate {
    pub(crate) plant: Plant,
    /// Names of the new parameters.
    pub(crate) names: Vec<String>,
    /// Values that they start from.
    pub(crate) values: Vec<f64>,
    pub(crate) new_states: usize,
    /// Free initial states of the plant without the term, and those of the term in each recording.
    pub(crate) own_starts: usize,
    pub(crate) starts: Vec<Vec<f64>>,
    /// What stands at the place now, and the equations of the memories in it.
    pub(crate) equation: String,
}

/// A name that the plant does not have.
pub(in crate::explain::engine) fn free_name(spec: &ModelSpec, wanted: &str) -> String {
    let mut name = wanted.to_owned();
    let mut n = 1;
    while spec.find(&name).is_some() || spec.find(&format!("{name}_acting")).is_some() {
        n += 1;
        name = format!("{wanted}{n}");
    }
    name
}

/// The plant with the lead's term in it.
pub(crate) fn candidate(
    spec: &ModelSpec,
    lead: &Lead,
    arguments: &[Argument],
    recordings: &[PlantRecording],
) -> Option<Candidate> {
    let term = lead.term;
    let first = recordings.first()?;
    let (h, times) = (first.sample_time, (first.start_time, first.sample_time));
    let argument = lead.argument.map(|a| &arguments[a]);
    let mut edit = Edit::default();
    let mut values = Vec::new();
    let mut shapes = Vec::new();
    for (shape, &value) in term.shapes.iter().zip(&lead.shapes) {
        let name = free_name(spec, &format!("{}_{}", term.id, shape.symbol));
        let (min, max) = match shape.starts {
            Starts::Instants(_) => PlantRecording::span(recordings),
            // What follows within a sample does not follow: it is a function.
            Starts::Length(_) => (h, f64::INFINITY),
            Starts::Samples(_) if term.form.contains("delay") => (0.0, 100.0 * value + h),
            // Shorter times and narrower shapes are not told from none, and cost steps.
            Starts::Samples(_) if term.form.contains("{m}") => (LEAST_SAMPLES * h, f64::INFINITY),
            Starts::Spread(_) => (
                LEAST_SPREAD * argument.map_or(0.0, Argument::spread),
                f64::INFINITY,
            ),
            Starts::Share(_) => LEAST_SHARE,
            Starts::Powers(_) => POWERS,
            Starts::Travel(_) => {
                // What yields within a sample is a function of the sign, which has terms of its own.
                let of_a_sample = argument
                    .filter(|a| !a.velocity)
                    .map_or(0.0, |a| h * a.size_quantile(0.5));
                (of_a_sample.max(LEAST_YIELD * value), f64::INFINITY)
            }
            _ if shape.positive => (1e-3 * value, f64::INFINITY),
            _ => (f64::NEG_INFINITY, f64::INFINITY),
        };
        edit.parameters.push(NewParameter {
            name: name.clone(),
            value,
            min,
            max,
            description: String::new(),
        });
        values.push(value);
        shapes.push(name);
    }
    // The argument: for a sensor what it shows, for an input the input itself.
    let text = match (argument, lead.place) {
        (None, _) => String::new(),
        (Some(_), Place::Equation(at)) if lead.sensor && term.needs != Needs::Another => {
            match spec.expressions.node(spec.equations[at].right) {
                Node::Variable(_) => "{v}".to_owned(),
                _ => "({v})".to_owned(),
            }
        }
        (Some(a), _) => a.expression.clone(),
    };
    let memories: Vec<String> = (0..term.memories.len())
        .map(|i| match i {
            0 => free_name(spec, &format!("{}_state", term.id)),
            _ => free_name(spec, &format!("{}_state_{i}", term.id)),
        })
        .collect();
    let factor = match lead.place {
        Place::Equation(at) => spec.equations[at].coefficient,
        _ => None,
    };
    let factor = factor.map(|id| {
        let span = spec.expressions.span(id);
        let text = &spec.text[span.start..span.end];
        match spec.expressions.node(id) {
            Node::Variable(_) => text.to_owned(),
            _ => format!("({text})"),
        }
    });
    let form = match term.form.contains("{instant}") {
        true => {
            let name = free_name(spec, &format!("{}_time", term.id));
            let unit = match is_without_units(spec) {
                true => "",
                false => "(unit=\"s\")",
            };
            let value = literal(h / FAST);
            (edit.declarations).push(format!("final parameter Real {name}{unit} = {value};"));
            term.form.replace("{instant}", &name)
        }
        false => term.form.to_owned(),
    };
    let body = filled(&form, term, &text, &memories, &shapes, times);
    let body = match factor {
        Some(factor) => body.replace("{a}", &factor),
        None => body.replace("{a}*", "").replace("{a}", "1.0"),
    };
    let body = about_usual(&body, argument.map_or(0.0, Argument::usual));
    let rate = argument.and_then(|a| a.rate.as_deref());
    let body = match body.contains("{dz}") {
        true => body.replace("{dz}", rate?),
        false => body,
    };
    for (memory, name) in term.memories.iter().zip(&memories) {
        let first = memory.start.at(argument.map_or(0.0, |a| a.values[0][0]));
        let source = if lead.sensor {
            let Place::Equation(at) = lead.place else {
                return None;
            };
            let right = spec.expressions.span(spec.equations[at].right);
            format!("({})", &spec.text[right.start..right.end])
        } else {
            text.clone()
        };
        let previous = memory.previous(&memories);
        let rate = filled(memory.rate, term, &source, &previous, &shapes, times);
        let free = memory.has_free_start(argument);
        edit.declarations
            .push(memory.declaration(name, first, free));
        edit.equations.push(memory.equation(name, &rate));
    }
    let new_states = term.memories.iter().filter(|m| !m.sampled).count();
    let added = if let Some(curve) = &lead.curve {
        let names: Vec<String> = (1..=curve.values.len())
            .map(|i| free_name(spec, &format!("{}_{i}", term.id)))
            .collect();
        for (name, &value) in names.iter().zip(&curve.values) {
            edit.parameters.push(NewParameter {
                name: name.clone(),
                value,
                min: f64::NEG_INFINITY,
                max: f64::INFINITY,
                description: String::new(),
            });
            values.push(value);
        }
        format!("({})", curve.text(&text, &names))
    } else if term.free_strength {
        let name = free_name(spec, &format!("{}_{}", term.id, term.symbol));
        edit.parameters.push(NewParameter {
            name: name.clone(),
            value: lead.strength,
            min: f64::NEG_INFINITY,
            max: f64::INFINITY,
            description: String::new(),
        });
        values.push(lead.strength);
        format!("{name}*({body})")
    } else {
        format!("({body})")
    };
    debug_assert!(!(lead.sensor && term.port != Port::Sensor));
    // What stands in the place of a signal is written without it: `u_acting = delay(u, T)`.
    let replaced = match term.port {
        Port::Equation => "{v}",
        _ => &text,
    };
    let whole = (!term.free_strength && lead.curve.is_none())
        .then(|| body.strip_suffix(&format!(" - {replaced}")))
        .flatten();
    let change = whole.map_or_else(|| format!("{{v}} + {added}"), str::to_owned);
    edit.changes.push((lead.place, change));
    if let Some((other, strength)) = lead.arrives {
        let there = spec.variable(spec.equations[other].unknown.variable());
        let wanted = format!("{}_{}_{}", term.id, term.symbol, there.column());
        let name = free_name(spec, &wanted);
        let change = format!("{{v}} + {name}*({body})");
        edit.changes.push((Place::Equation(other), change));
        edit.parameters.push(NewParameter {
            name,
            value: strength,
            min: f64::NEG_INFINITY,
            max: f64::INFINITY,
            description: String::new(),
        });
        values.push(strength);
    }
    let mut changed = edit.apply(spec).ok()?;
    let mut starts = vec![Vec::new(); recordings.len()];
    for (memory, name) in term.memories.iter().zip(&memories) {
        let of_recordings: Vec<f64> = argument.map_or_else(Vec::new, |a| {
            let first = a.values.iter().map(|values| values[0]);
            first.map(|v| memory.start.at(v)).collect()
        });
        if memory.has_free_start(argument) {
            let each = starts.iter_mut().zip(&of_recordings);
            each.for_each(|(to, &start)| to.push(start));
        }
        let state = changed.find(name)?;
        let state = &mut changed.variables[state.index()];
        (state.uncorrected, state.starts) = (true, of_recordings);
    }
    let names = edit.parameters.iter().map(|p| p.name.clone()).collect();
    let places = [
        Some(lead.place),
        lead.arrives.map(|(at, _)| Place::Equation(at)),
    ];
    let changed_equations = places
        .into_iter()
        .flatten()
        .map(|place| equation_text(&changed, spec, place));
    let changed_equations: Vec<String> = changed_equations.collect();
    let own = edit
        .equations
        .iter()
        .map(|e| e.trim().trim_end_matches(';'));
    let equations: Vec<&str> = (changed_equations.iter().map(String::as_str))
        .chain(own)
        .collect();
    Some(Candidate {
        equation: equations.join("; "),
        plant: Plant::new(changed),
        names,
        values,
        new_states,
        own_starts: free_starts(spec),
        starts,
    })
}

/// Number of initial states that are estimated.
fn free_starts(spec: &ModelSpec) -> usize {
    let states = spec.states().into_iter();
    states.filter(|&v| !spec.variable(v).fixed).count()
}

/// The changed equation as it stands in the new text.
pub(in crate::explain::engine) fn equation_text(
    changed: &ModelSpec,
    spec: &ModelSpec,
    place: Place,
) -> String {
    let variable = place.variable(spec);
    let name = match place {
        Place::Equation(_) => spec.variable(variable).name.clone(),
        Place::Input(_) | Place::Parameter(_) => acting(spec, variable),
    };
    let equation = changed
        .equations
        .iter()
        .find(|e| changed.variable(e.unknown.variable()).name == name);
    equation.map_or(String::new(), |e| {
        let left = changed.expressions.span(e.left);
        let right = changed.expressions.span(e.right);
        let part = |s: crate::physics::Span| changed.text[s.start..s.end].trim().to_owned();
        format!("{} = {}", part(left), part(right))
    })
}

impl Candidate {
    /// The plant with the term, simulated as accurately as fits need that are only compared, in so many steps a sample at most; the
    /// study is that of the plant without it.
    pub(crate) fn rough(&self, study: &Study, most_steps: usize) -> Plant {
        let plant = self.plant.clone().with_accuracy(GLANCED_ACCURACY);
        limited(plant, study, most_steps)
    }

    /// The numbers of a fit of the plant without the term, with the term's.
    pub(crate) fn from(&self, fit: &Fit, parameters: usize) -> Fit {
        let (own, others) = fit.point.split_at(parameters);
        let (starts, gains) = others.split_at(self.own_starts * self.starts.len());
        let mut point = [own, &self.values].concat();
        for (r, new) in self.starts.iter().enumerate() {
            point.extend(&starts[r * self.own_starts..][..self.own_starts]);
            point.extend(new);
        }
        point.extend(gains);
        Fit {
            point,
            ..fit.clone()
        }
    }

    /// The numbers of a fit of the plant with the term, without the term's; the plant without it has so many parameters.
    pub(crate) fn without(&self, fit: &Fit, parameters: usize) -> Fit {
        let mut point = fit.point[..parameters].to_vec();
        let mut others = &fit.point[parameters + self.values.len()..];
        for new in &self.starts {
            let (of_recording, behind) = others.split_at(self.own_starts + new.len());
            point.extend(&of_recording[..self.own_starts]);
            others = behind;
        }
        point.extend(others);
        Fit {
            point,
            ..fit.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::explain::engine::fitting::edit::{places, sensors};
    use crate::explain::engine::terms::arguments_of_plant::arguments;
    use crate::explain::engine::terms::library::TERMS;
    use crate::explain::engine::terms::term::Needs;
    use crate::explain::engine::terms::values::grid;
    use crate::physics::{Hold, parse};

    #[test]
    fn every_term_of_the_library_makes_a_plant_with_names_of_its_own() {
        let text = "model Motor
               parameter Real R(unit=\"Ohm\") = 1; parameter Real J = 1;
               input Real u(unit=\"V\"); input Real d(unit=\"K\"); output Real y(unit=\"rad\");
               Real phi(unit=\"rad\"); Real w(unit=\"rad/s\"); Real T(unit=\"K\"); Real psi(unit=\"rad\");
             equation
               der(psi) = w - psi; der(phi) = w; J*der(w) = u/R - w; der(T) = u*w - (T - d); y = phi;
             end Motor;";
        let spec = parse(text).unwrap();
        let wave = |k: usize| (0.3 * k as f64).sin();
        let recordings = [PlantRecording {
            inputs: vec![(0..200).map(wave).collect(); 2],
            outputs: vec![(0..200).map(wave).collect()],
            sample_time: 0.1,
            start_time: 0.0,
        }];
        let mut arguments = arguments(&spec);
        let mut made = BTreeSet::new();
        // Every argument of both signs, and positive.
        for (term, lifts) in (TERMS.iter()).flat_map(|t| [(t, [1.5, 0.0]), (t, [0.0, 1.5])]) {
            for (i, argument) in arguments.iter_mut().enumerate() {
                let lift = lifts[i % 2];
                let values: Vec<Vec<f64>> = vec![(0..200).map(|k| wave(k) + lift).collect()];
                argument.set(values.clone(), values);
            }
            let mut at: Vec<Place> = match term.port {
                Port::Sensor => sensors(&spec).into_iter().map(Place::Equation).collect(),
                _ => places(&spec, &spec),
            };
            at.retain(|place| match term.port {
                Port::Equation | Port::Sensor => matches!(place, Place::Equation(_)),
                Port::Input => matches!(place, Place::Input(_)),
                Port::Parameter => matches!(place, Place::Parameter(_)),
            });
            let own: Vec<Option<usize>> = match term.needs {
                Needs::Time => vec![None],
                _ => (0..arguments.len())
                    .filter(|&a| arguments[a].serves(term.needs))
                    .map(Some)
                    .collect(),
            };
            for (place, argument) in at.iter().flat_map(|p| own.iter().map(move |a| (*p, *a))) {
                for shapes in grid(term, argument.map(|a| &arguments[a]), &recordings, &[3.0]) {
                    let mut lead = Lead::untested(term, place).at(place, argument, &shapes);
                    lead.sensor = term.port == Port::Sensor;
                    lead.strength = 0.1;
                    if let Some(candidate) = candidate(&spec, &lead, &arguments, &recordings) {
                        let names: BTreeSet<&String> = candidate.names.iter().collect();
                        assert_eq!(names.len(), candidate.names.len(), "{names:?}");
                        made.insert(term.id);
                    }
                }
            }
        }
        let all: BTreeSet<&str> = TERMS.iter().map(|t| t.id).collect();
        assert_eq!(made, all);
    }

    #[test]
    fn initial_states_of_a_term_stand_behind_those_of_the_plant_in_each_recording() {
        let text = "model M parameter Real a = 1; input Real u; output Real y; Real x; Real v;
             equation der(x) = v; der(v) = u - a*v; y = x; end M;";
        let spec = parse(text).unwrap();
        let column = vec![0.5; 50];
        let recording = PlantRecording {
            inputs: vec![column.clone()],
            outputs: vec![column.clone()],
            sample_time: 0.1,
            start_time: 0.0,
        };
        let recordings = [recording.clone(), recording];
        let mut arguments = arguments(&spec);
        arguments
            .iter_mut()
            .for_each(|a| a.set(vec![vec![3.0; 50], vec![7.0; 50]], vec![]));
        let place = Place::Equation(sensors(&spec)[0]);
        let term = TERMS.iter().find(|t| t.id == "sensor_lag").unwrap();
        let shown = arguments.iter().position(|a| a.expression == "x");
        let mut lead = Lead::untested(term, place).at(place, shown, &[0.2]);
        lead.sensor = true;
        let made = candidate(&spec, &lead, &arguments, &recordings).unwrap();
        let fit = Fit {
            form: crate::physics::estimate::Form::Innovation,
            point: vec![1.0, 10.0, 11.0, 20.0, 21.0, 0.1, 0.2],
            noise: crate::noise::Noise::unit(1),
            deviance: 0.0,
            criterion: 0.0,
        };
        let with = made.from(&fit, 1);
        let expected = [1.0, 0.2, 10.0, 11.0, 3.0, 20.0, 21.0, 7.0, 0.1, 0.2];
        assert_eq!(with.point, expected);
        assert_eq!(made.without(&with, 1).point, fit.point);
    }

    /// With a short time constant and within wide limits a sensor shows what the equations say, also where that is a sum.
    #[test]
    fn a_sensor_of_a_sum_shows_the_sum() {
        let text = "model M parameter Real d = 0.5; input Real u; output Real y; Real x(start=1);
             equation der(x) = u - x; y = x + d*u; end M;";
        let spec = parse(text).unwrap();
        let wave = vec![1.0; 200];
        let recordings = [PlantRecording {
            inputs: vec![wave.clone()],
            outputs: vec![wave.clone()],
            sample_time: 0.1,
            start_time: 0.0,
        }];
        let run = |plant: &Plant| {
            let all = recordings[0].run(plant, &plant.nominal(), Hold::Zero);
            all.unwrap().remove(0)
        };
        let expected = run(&Plant::new(spec.clone()));
        let mut arguments = arguments(&spec);
        arguments
            .iter_mut()
            .for_each(|a| a.set(vec![wave.clone()], vec![wave.clone()]));
        let place = Place::Equation(sensors(&spec)[0]);
        for (id, shapes) in [
            ("sensor_lag", vec![0.02]),
            ("sensor_saturation", vec![-9.0, 9.0]),
        ] {
            let term = TERMS.iter().find(|t| t.id == id).unwrap();
            let mut lead = Lead::untested(term, place).at(place, Some(0), &shapes);
            lead.sensor = true;
            let made = candidate(&spec, &lead, &arguments, &recordings).unwrap();
            // From the second sample on, when the lag has caught up.
            let late = run(&made.plant).into_iter().zip(&expected).skip(1);
            for (found, expected) in late {
                assert!((found - expected).abs() < 0.02, "{id}: {found} {expected}");
            }
        }
    }
}
