//! The findings one by one: effects with their numbers, rivals, changed parameters.

use std::collections::BTreeMap;

use super::linear_answer::Answer;
use crate::explain::document::channel_units::{is_position, is_rate};
use crate::explain::document::sentences;
use crate::explain::effects::{self, Action, Definition, Port};
use crate::explain::explanation::{
    Alternative, Detectable, EFFECTS_TIE, EffectFound, Evidence, Quantity, Verdict,
};
use crate::explain::linear::check::Trouble;
use crate::explain::linear::fit::{Fit, Problem};
use crate::explain::linear::model::functionals::{
    Functionals, Signal, dot, matched_sign, static_equivalent,
};
use crate::explain::linear::model::linear_plant::Plant;
use crate::explain::linear::model::structure::Direction;
use crate::explain::linear::search::penalties::NEEDED;
use crate::log::Channel;

/// What a force that depends on an output is called.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Called {
    /// As the library calls it.
    Itself,
    /// What grows with the square or the cube of a speed or a flow is a drag, whatever state of the plant it is.
    Drag,
    CubicDrag,
    /// A spring is a function of a position or an angle, or makes the plant oscillate. The same function of a temperature or a level
    /// is a loss or an outflow, which linear models cannot tell apart.
    Law,
}

fn called(definition: &Definition, output: &Channel, plant: &Plant) -> Called {
    match definition.id {
        "quadratic_stiffness" if definition.variant == "odd" && is_rate(output) => Called::Drag,
        "cubic_stiffness" if definition.variant.is_empty() && is_rate(output) => Called::CubicDrag,
        "quadratic_stiffness" | "cubic_stiffness"
            if !is_position(output) && !plant.oscillates() =>
        {
            Called::Law
        }
        _ => Called::Itself,
    }
}

impl Answer<'_> {
    fn signal_name(&self, effect: &crate::explain::linear::model::structure::Instance) -> String {
        let (inputs, outputs) = self.names();
        match effect.definition.port() {
            Port::Input | Port::Path => inputs.get(effect.channel).cloned().unwrap_or_default(),
            Port::Sensor | Port::Exact => outputs.get(effect.channel).cloned().unwrap_or_default(),
            Port::Force => match effect.signal {
                Signal::Output(o) | Signal::Integral(o) => outputs[o].clone(),
                Signal::Difference(i, j) => format!("{} - {}", outputs[i], outputs[j]),
            },
        }
    }

    pub(crate) fn effects(&self, problem: &Problem, model: &Fit) -> Vec<EffectFound> {
        let mut fit = model.clone();
        let mut certainty = fit.certainty(problem);
        if let Some(certainty) = &mut certainty {
            let structure = &model.structure;
            let from = structure.effect_offset(structure.first_new());
            fit.narrow(problem, &mut certainty.covariance, from..structure.len());
            for at in (structure.first_new()..structure.effects.len())
                .filter_map(|index| structure.change_time(index))
            {
                fit.ask_all_times(problem, &mut certainty.covariance, at);
            }
        }
        let covariance = certainty.as_ref().map(|c| &c.covariance);
        let disagreement = certainty.as_ref().and_then(|c| c.halves_disagree.as_ref());
        let mut found = Vec::new();
        let structure = &model.structure;
        for index in structure.first_new()..structure.effects.len() {
            let effect = &structure.effects[index];
            let definition = effect.definition;
            let signal = self.signal_name(effect);
            let (input, output) = self.channels_of(effect);
            let integral = matches!(effect.signal, Signal::Integral(_));
            let offset = model.structure.effect_offset(index);
            let std = |at: usize| covariance.map(|c| c[(at, at)].max(0.0).sqrt());
            let mut parameters = BTreeMap::new();
            let amplitudes = effect.amplitudes(model.structure.states());
            if let (Action::Force(..), false) = (definition.action, definition.is_curve()) {
                self.amplitude(model, index, covariance, &mut parameters);
            }
            for (i, p) in definition.parameters.iter().enumerate() {
                let at = offset + amplitudes + i;
                let value = model.structure.shape(&model.theta, index)[i];
                parameters.insert(
                    p.name.to_owned(),
                    Quantity {
                        value,
                        std: std(at).map(|s| if p.logarithmic { s * value } else { s }),
                        unit: sentences::unit_text(p.unit, input, output, integral),
                    },
                );
            }
            let mut signal = signal;
            if let Action::Sine = definition.action {
                let from = offset + amplitudes + definition.parameters.len();
                signal = self.sine_amplitudes(model, index, from, covariance, &mut parameters);
            }
            let called = called(definition, output, &structure.coordinates.given);
            let definition = match called {
                Called::Drag => effects::find("quadratic_drag", "").unwrap_or(definition),
                _ => definition,
            };
            if matches!(called, Called::Drag | Called::CubicDrag)
                && let Some(drag) = parameters.remove("stiffness")
            {
                parameters.insert("drag".to_owned(), drag);
            }
            let mut effect_found = EffectFound {
                hypothesis: false,
                enters: None,
                depends: vec![],
                law: None,
                effect: definition.id.to_owned(),
                variant: definition.variant.to_owned(),
                signal,
                port: port_name(definition.port()).to_owned(),
                equation: definition.equation.to_owned(),
                parameters,
                evidence: Evidence {
                    criterion_gain: self.finding.gain,
                    criterion_needed: NEEDED,
                    heldout_gain: None,
                    // What begins at some time is not in both halves.
                    halves_disagree: disagreement.filter(|_| !definition.changes()).map(|z| {
                        let end = offset + effect.len(structure.states(), structure.outputs());
                        z[offset..end].iter().copied().fold(0.0, f64::max)
                    }),
                },
                sentence: String::new(),
            };
            effect_found.sentence = sentences::sentence(definition, &effect_found);
            if called == Called::CubicDrag {
                let stiffness = &effect_found.sentence;
                effect_found.sentence = stiffness.replace("cubic stiffness", "cubic drag");
                effect_found.effect = "cubic_drag".to_owned();
            }
            if called == Called::Law {
                effect_found.effect = "law".to_owned();
                effect_found.depends = vec![output.name.clone()];
                effect_found.sentence = format!(
                    "A function of {0} acts where the input does: {1}. The slowest mode of the plant does not oscillate, and neither a unit nor the name says that {0} is a position or a rate: \
                     a spring, a loss and an outflow look alike.",
                    output.name, definition.equation
                );
            }
            found.push(effect_found);
        }
        for freeze in &self.finding.freezes {
            let time = |k: usize| {
                self.data().segments[freeze.segment].start_time + k as f64 * self.data().sample_time
            };
            found.extend(self.exact(
                "sensor_freeze",
                freeze.output,
                &[
                    ("from", time(freeze.from), "s"),
                    ("to", time(freeze.to), "s"),
                ],
            ));
        }
        if let Some((output, step)) = self.finding.coarse {
            let unit = self.outputs()[output].unit.clone().unwrap_or_default();
            found.extend(self.exact("sensor_quantization", output, &[("step", step, &unit)]));
        }
        found
    }

    /// Amplitudes of a sinusoid at the outputs; the name of the output that shows it most, over its noise.
    fn sine_amplitudes(
        &self,
        model: &Fit,
        index: usize,
        from: usize,
        covariance: Option<&nalgebra::DMatrix<f64>>,
        parameters: &mut BTreeMap<String, Quantity>,
    ) -> String {
        let numbers = model.structure.effect_numbers(&model.theta, index);
        let parts = &numbers[model.structure.effects[index].definition.parameters.len()..];
        let mut most = (0.0, 0);
        for (o, part) in parts.chunks_exact(2).enumerate() {
            let size = part[0].hypot(part[1]);
            let std = covariance.map(|c| {
                // First order: the variance along the phase that was found.
                let g = [part[0] / size.max(1e-300), part[1] / size.max(1e-300)];
                let at = from + 2 * o;
                let variance: f64 = (0..2)
                    .flat_map(|i| (0..2).map(move |j| (i, j)))
                    .map(|(i, j)| g[i] * c[(at + i, at + j)] * g[j])
                    .sum();
                variance.max(0.0).sqrt()
            });
            let name = if parts.len() == 2 {
                "amplitude".to_owned()
            } else {
                format!("amplitude_{}", self.outputs()[o].name)
            };
            parameters.insert(
                name,
                Quantity {
                    value: size,
                    std,
                    unit: self.outputs()[o].unit.clone().unwrap_or_default(),
                },
            );
            let seen = size / model.noise.scale[o];
            if seen > most.0 {
                most = (seen, o);
            }
        }
        self.outputs()[most.1].name.clone()
    }

    /// What was wrong with the data, where that is an answer of its own.
    pub(crate) fn troubles(&self) -> Vec<EffectFound> {
        let of_trouble = |trouble: &Trouble| {
            let numbers: Vec<(&str, f64, &str)> = trouble
                .numbers
                .iter()
                .map(|n| (n.name, n.value, n.unit.as_str()))
                .collect();
            let mut found = self.exact(trouble.kind.id()?, trouble.output, &numbers)?;
            found.sentence.clone_from(&trouble.sentence);
            Some(found)
        };
        self.finding
            .troubles
            .iter()
            .filter_map(of_trouble)
            .collect()
    }

    fn exact(&self, id: &str, output: usize, numbers: &[(&str, f64, &str)]) -> Option<EffectFound> {
        let definition = effects::find(id, "")?;
        let mut found = EffectFound {
            hypothesis: false,
            enters: None,
            depends: vec![],
            law: None,
            effect: id.to_owned(),
            variant: String::new(),
            signal: self.outputs()[output].name.clone(),
            port: "sensor".to_owned(),
            equation: definition.equation.to_owned(),
            parameters: numbers
                .iter()
                .map(|(name, value, unit)| {
                    (
                        (*name).to_owned(),
                        Quantity {
                            value: *value,
                            std: None,
                            unit: (*unit).to_owned(),
                        },
                    )
                })
                .collect(),
            evidence: Evidence {
                criterion_gain: 0.0,
                criterion_needed: 0.0,
                heldout_gain: None,
                halves_disagree: None,
            },
            sentence: String::new(),
        };
        found.sentence = sentences::sentence(definition, &found);
        Some(found)
    }

    fn channels_of(
        &self,
        effect: &crate::explain::linear::model::structure::Instance,
    ) -> (&Channel, &Channel) {
        let input = match effect.direction {
            Direction::Matched(input) => input,
            Direction::Free => effect.channel.min(self.inputs().len() - 1),
        };
        let output = match effect.signal {
            Signal::Output(o) | Signal::Integral(o) | Signal::Difference(o, _) => o,
        };
        (
            &self.inputs()[input.min(self.inputs().len() - 1)],
            &self.outputs()[output],
        )
    }

    /// The amplitude of a force: in the unit of an input, through which it acts or to which it is compared by what both
    /// do to the rate.
    fn amplitude(
        &self,
        model: &Fit,
        index: usize,
        covariance: Option<&nalgebra::DMatrix<f64>>,
        parameters: &mut BTreeMap<String, Quantity>,
    ) {
        let structure = &model.structure;
        let effect = &structure.effects[index];
        let plant = structure.plant(&model.theta);
        let rows = Functionals::new(&plant);
        let rate = rows.of(&plant, effect.signal).rate;
        let position = match effect.signal {
            Signal::Output(o) | Signal::Integral(o) => plant.c_row(o).to_vec(),
            Signal::Difference(i, j) => plant
                .c_row(i)
                .iter()
                .zip(plant.c_row(j))
                .map(|(a, b)| a - b)
                .collect(),
        };
        let numbers = structure.effect_numbers(&model.theta, index);
        let offset = structure.effect_offset(index);
        let fixed = !structure.plant_free && index < structure.known.len();
        let (value, std, unit) = match effect.direction {
            Direction::Matched(input) => (
                numbers[0],
                covariance
                    .filter(|_| !fixed)
                    .map(|c| c[(offset, offset)].max(0.0).sqrt()),
                self.inputs()[input].unit.clone().unwrap_or_default(),
            ),
            Direction::Free => {
                // The input with the strongest effect on the rate.
                let gain = |input: usize| dot(&rate, &plant.b_column(input));
                let input = (0..self.data().signals())
                    .max_by(|a, b| gain(*a).abs().total_cmp(&gain(*b).abs()))
                    .unwrap_or(0);
                let Some(balance) = static_equivalent(&plant, &position, input) else {
                    return;
                };
                let n = structure.states();
                let sign = matched_sign(&plant, &rows.of(&plant, effect.signal).forward, input);
                let value = sign * dot(&balance, &numbers[..n]);
                let std = covariance.filter(|_| !fixed).map(|c| {
                    let block = c.view((offset, offset), (n, n));
                    let r = nalgebra::DVector::from_column_slice(&balance);
                    ((r.transpose() * block * &r)[(0, 0)].max(0.0)).sqrt()
                });
                (
                    value,
                    std,
                    self.inputs()[input].unit.clone().unwrap_or_default(),
                )
            }
        };
        let (_, output) = self.channels_of(effect);
        let of = output.unit.clone().unwrap_or_default();
        let integral = matches!(effect.signal, Signal::Integral(_));
        let unit = amplitude_unit(effect.definition.id, &unit, &of, integral);
        let name = amplitude_name(effect.definition.id);
        parameters.insert(name.to_owned(), Quantity { value, std, unit });
    }

    pub(crate) fn alternatives(&self) -> Vec<Alternative> {
        let named: Vec<&str> = self
            .finding
            .model
            .structure
            .new_effects()
            .iter()
            .map(|e| e.definition.id)
            .collect();
        let gain = self.finding.gain;
        let unexplained = self.finding.verdict == Verdict::Unexplained;
        // A name is left out although nothing is left beside it.
        let unlikely = unexplained && self.finding.adequacy.is_none_or(|a| a.holds());
        self.finding
            .rivals
            .iter()
            .filter(|r| unexplained || !named.contains(&r.definition.id))
            .take(12)
            .map(|r| {
                let why_not = if unlikely && named.contains(&r.definition.id) {
                    format!(
                        "of names with so small a lead, or beside so much structure, two of three are wrong (evidence {})",
                        sentences::number(r.gain)
                    )
                } else if unexplained {
                    format!(
                        "it leaves structure that noise does not make (evidence {})",
                        sentences::number(r.gain)
                    )
                } else if gain <= 0.0 {
                    format!(
                        "evidence {}, and {NEEDED:.0} is needed",
                        sentences::number(r.gain)
                    )
                } else if gain - r.gain < EFFECTS_TIE {
                    "it explains this recording equally well".to_owned()
                } else if r.gain < NEEDED {
                    format!(
                        "it explains no more than other parameters do (evidence {})",
                        sentences::number(r.gain)
                    )
                } else {
                    format!(
                        "its evidence is {} against {}: exp({}) times less likely",
                        sentences::number(r.gain),
                        sentences::number(gain),
                        sentences::number(0.5 * (gain - r.gain))
                    )
                };
                Alternative {
                    effect: r.definition.id.to_owned(),
                    support: if gain > 0.0 {
                        (r.gain / gain).clamp(0.0, 1.0)
                    } else {
                        0.0
                    },
                    criterion_gain: r.gain,
                    why_not,
                }
            })
            .collect()
    }

    pub(crate) fn experiment(&self) -> Option<String> {
        let best = self.finding.rivals.first()?;
        match self.finding.verdict {
            Verdict::Family => {
                let named = self
                    .finding
                    .model
                    .structure
                    .new_effects()
                    .first()?
                    .definition;
                let rival = self
                    .finding
                    .rivals
                    .iter()
                    .find(|r| r.definition.id != named.id)?;
                named
                    .mimics
                    .iter()
                    .find(|m| m.effect == rival.definition.id)
                    .or_else(|| rival.definition.mimics.iter().find(|m| m.effect == named.id))
                    .map(|m| m.experiment.to_owned())
                    .or_else(|| {
                        Some(format!(
                            "repeat the recording at half and at twice the amplitude: {} and {} scale differently",
                            named.name, rival.definition.name
                        ))
                    })
            }
            Verdict::Unexplained => best
                .definition
                .mimics
                .first()
                .map(|m| {
                    // Nothing is named: the sentence says which candidates it is about.
                    let spoken = |id: &str| id.replace('_', " ");
                    let (one, other) = (spoken(best.definition.id), spoken(m.effect));
                    format!("{} (tells {one} from {other})", m.experiment)
                })
                .or_else(|| Some(sentences::OTHER_AMPLITUDES.to_owned())),
            _ => None,
        }
    }

    /// How large effects must have been: from the error of what a few of them would have added.
    pub(crate) fn detectable(&self, verdict: Verdict) -> Vec<Detectable> {
        if !matches!(verdict, Verdict::Consistent | Verdict::Parameters) {
            return Vec::new();
        }
        let mut list: Vec<Detectable> = self
            .finding
            .detectable
            .iter()
            .map(|(definition, instance, share)| Detectable {
                effect: definition.id.to_owned(),
                signal: self.signal_name(instance),
                share_of_output: *share,
            })
            .collect();
        list.sort_by(|a, b| a.share_of_output.total_cmp(&b.share_of_output));
        list
    }
}

/// What the amplitude of a force is called.
pub(crate) fn amplitude_name(id: &str) -> &'static str {
    match id {
        "coulomb_friction" | "stribeck_friction" => "friction_force",
        "quadratic_drag" => "drag",
        "hysteresis" => "loop_force",
        "load_step" => "load",
        "cogging" => "cogging_force",
        "direction_dependent_friction" => "friction_difference",
        "end_stop" => "stop_stiffness",
        "stiffness_change" => "stiffness_change",
        "mass_change" => "mass_change",
        "gravity_torque" => "torque_per_angle",
        "radiation" => "radiation_coefficient",
        "orifice_flow" => "flow_coefficient",
        "position_dependent_gain" => "gain_per_position",
        _ => "stiffness",
    }
}

/// Its unit, from those of the input and of the output; `integral`: the output is a rate.
pub(crate) fn amplitude_unit(id: &str, input: &str, output: &str, integral: bool) -> String {
    let per = match id {
        "cubic_stiffness" => 3,
        "quadratic_stiffness" | "quadratic_drag" => 2,
        "end_stop" | "stiffness_change" | "position_dependent_gain" => 1,
        "direction_dependent_friction" => 1,
        _ => 0,
    };
    let rate = if integral {
        output.to_owned()
    } else {
        format!("{output}/s")
    };
    match (input.is_empty() || output.is_empty(), per, id) {
        (_, 0, _) => input.to_owned(),
        (true, ..) => String::new(),
        (false, 1, "direction_dependent_friction") => format!("{input}/({rate})"),
        (false, 1, _) => format!("{input}/({output})"),
        (false, p, "quadratic_drag") => format!("{input}/({rate})^{p}"),
        (false, p, _) => format!("{input}/({output})^{p}"),
    }
}

pub(crate) fn port_name(port: Port) -> &'static str {
    match port {
        Port::Input => "input",
        Port::Force => "force",
        Port::Sensor | Port::Exact => "sensor",
        Port::Path => "path",
    }
}
