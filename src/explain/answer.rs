//! From what was found to what is said.

use std::collections::BTreeMap;

use super::adequacy::adequacy;
use super::curve;
use super::data::{Data, Series};
use super::effects::{self, Action, Definition, Port};
use super::error::ExplainError;
use super::explanation::{
    Alternative, AugmentedModel, Detectable, EFFECTS_TIE, EXPLANATION_FORMAT, EffectFound,
    EffectSize, Evidence, Explanation, FitTable, Location, NoiseFound, ParameterChange, Quantity,
    Remaining, SignalTraces, Verdict,
};
use super::fit::{Fit, Problem};
use super::inquiry::{Finding, NEEDED, inquire};
use super::locate;
use super::noise::Mask;
use super::probability::probability;
use super::prove;
use super::simulation::{Known, Simulation, know};
use super::structure::{Direction, Functionals, Signal, dot};
use super::words;
use crate::identify::Recording;
use crate::log::{Channel, Log};
use crate::model::StateSpace;

/// What can be asked for.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Effects that are taken out of the library: what would be said if nobody had thought of them?
    pub without: Vec<String>,
    /// Seed of the bootstrap.
    pub seed: u64,
}

/// Points of a trace in the document, at most.
const TRACE_POINTS: usize = 1500;

/// Compares `recordings` with `simulation` and says what the simulation leaves out.
///
/// # Errors
/// [`ExplainError`]: recordings and simulation do not fit together, are too short, or the simulation is unstable.
pub fn explain(
    recordings: &[Log],
    simulation: &Simulation,
    options: &Options,
) -> Result<Explanation, ExplainError> {
    for id in &options.without {
        if effects::library().all(|d| d.id != id) {
            return Err(ExplainError::UnknownEffect { id: id.clone() });
        }
    }
    let known = know(recordings, simulation)?;
    let allowed = |d: &Definition| !options.without.iter().any(|id| id == d.id);
    let (finding, mask) =
        inquire(&known.data, &known.structure, &allowed).ok_or_else(|| ExplainError::NoFit {
            name: recordings[0].name.clone(),
        })?;
    Ok(Answer {
        recordings,
        known: &known,
        finding: &finding,
        mask,
        seed: options.seed,
    }
    .say())
}

struct Answer<'a> {
    recordings: &'a [Log],
    known: &'a Known,
    finding: &'a Finding,
    mask: Mask,
    seed: u64,
}

impl Answer<'_> {
    fn data(&self) -> &Data {
        &self.known.data
    }

    fn inputs(&self) -> &[Channel] {
        &self.recordings[0].inputs
    }

    fn outputs(&self) -> &[Channel] {
        &self.recordings[0].outputs
    }

    fn names(&self) -> (Vec<String>, Vec<String>) {
        let of = |list: &[Channel]| list.iter().map(|c| c.name.clone()).collect();
        (of(self.inputs()), of(self.outputs()))
    }

    fn problem(&self) -> Problem<'_> {
        Problem {
            mask: self.mask.clone(),
            ..Problem::new(self.data())
        }
    }

    fn say(&self) -> Explanation {
        let finding = self.finding;
        let problem = self.problem();
        let count = finding.count;
        let boring = finding.boring.best(count);
        let model = &finding.model;
        let shown = self.output_that_shows(boring, model);
        let (input_names, output_names) = self.names();
        let squares = locate::excess(&boring.residual, &model.noise);
        let effects = self.effects(&problem, model);
        let (fit, effect_size, heldout_gain) = self.proof(&problem, boring, model, shown);
        let mut effects = effects;
        if let Some(first) = effects.first_mut() {
            first.evidence.heldout_gain = heldout_gain;
        }
        let verdict = finding.verdict;
        let location = self.location(
            &squares,
            boring,
            model,
            shown,
            (&input_names, &output_names),
        );
        let alternatives = self.alternatives();
        let separating_experiment = self.experiment();
        let mut augmented = AugmentedModel::describe(
            &model.structure,
            &model.theta,
            self.inputs(),
            self.outputs(),
            &self.known.delays,
            self.data().constant,
        );
        if self.known.relative {
            augmented.reference = Some(Box::new(AugmentedModel::describe(
                &self.known.structure,
                &[],
                self.inputs(),
                self.outputs(),
                &self.known.delays,
                self.data().constant,
            )));
        }
        let curve = (verdict == Verdict::Unexplained)
            .then(|| curve::learn(&problem, boring, &input_names, &output_names))
            .flatten();
        let mut explanation = Explanation {
            format: EXPLANATION_FORMAT.to_owned(),
            verdict,
            probability: probability(finding),
            summary: Vec::new(),
            effects: if verdict == Verdict::Unexplained {
                Vec::new()
            } else {
                effects
            },
            alternatives,
            location,
            fit,
            parameters: self.parameter_changes(boring),
            remaining: self.remaining(&problem, model),
            separating_experiment,
            effect_size,
            detectable: self.detectable(verdict),
            noise: self.noise(model),
            curve,
            model: augmented,
            signals: self.signals(boring, model),
            recordings: self
                .recordings
                .iter()
                .map(|log| Recording {
                    name: log.name.clone(),
                    sha256: log.sha256.clone(),
                    samples: log.samples(),
                    start_time: log.start_time,
                })
                .collect(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
        };
        explanation.summary = words::summary(&explanation, NEEDED);
        explanation
    }

    /// The output whose error falls most, relative to its noise.
    fn output_that_shows(&self, boring: &Fit, model: &Fit) -> usize {
        let l = self.data().outputs;
        let drop = |o: usize| {
            let size = |r: &Series| {
                r.iter()
                    .skip(o)
                    .step_by(l)
                    .flatten()
                    .map(|v| v * v)
                    .sum::<f64>()
            };
            size(&boring.residual) / size(&model.residual).max(1e-300)
        };
        (0..l)
            .max_by(|a, b| drop(*a).total_cmp(&drop(*b)))
            .unwrap_or(0)
    }

    fn signal_name(&self, effect: &super::structure::Instance) -> String {
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

    fn effects(&self, problem: &Problem, model: &Fit) -> Vec<EffectFound> {
        let mut fit = model.clone();
        let covariance = fit.covariance(problem);
        let mut found = Vec::new();
        for index in model.structure.first_new()..model.structure.effects.len() {
            let effect = &model.structure.effects[index];
            let definition = effect.definition;
            let signal = self.signal_name(effect);
            let (input, output) = self.channels_of(effect);
            let integral = matches!(effect.signal, Signal::Integral(_));
            let offset = model.structure.effect_offset(index);
            let std = |at: usize| covariance.as_ref().map(|c| c[(at, at)].max(0.0).sqrt());
            let mut parameters = BTreeMap::new();
            let amplitudes = effect.amplitudes(model.structure.states());
            if let Action::Force(..) = definition.action {
                self.amplitude(model, index, covariance.as_ref(), &mut parameters);
            }
            for (i, p) in definition.parameters.iter().enumerate() {
                let at = offset + amplitudes + i;
                let value = model.structure.shape(&model.theta, index)[i];
                parameters.insert(
                    p.name.to_owned(),
                    Quantity {
                        value,
                        std: std(at).map(|s| if p.logarithmic { s * value } else { s }),
                        unit: words::unit_text(p.unit, input, output, integral),
                    },
                );
            }
            let mut effect_found = EffectFound {
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
                    halves_disagree: None,
                },
                sentence: String::new(),
            };
            effect_found.sentence = words::sentence(definition, &effect_found);
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

    fn exact(&self, id: &str, output: usize, numbers: &[(&str, f64, &str)]) -> Option<EffectFound> {
        let definition = effects::find(id, "")?;
        let mut found = EffectFound {
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
        found.sentence = words::sentence(definition, &found);
        Some(found)
    }

    fn channels_of(&self, effect: &super::structure::Instance) -> (&Channel, &Channel) {
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
        let numbers = structure.effect_numbers(&model.theta, index);
        let offset = structure.effect_offset(index);
        let fixed = !structure.plant_free && index < structure.known.len();
        let per = match effect.definition.id {
            "cubic_stiffness" => 3,
            "quadratic_stiffness" | "quadratic_drag" => 2,
            "end_stop" | "stiffness_change" | "position_dependent_gain" => 1,
            _ => 0,
        };
        let (value, std, unit) = match effect.direction {
            Direction::Matched(input) => (
                numbers[0],
                covariance
                    .filter(|_| !fixed)
                    .map(|c| c[(offset, offset)].max(0.0).sqrt()),
                self.inputs()[input].unit.clone().unwrap_or_default(),
            ),
            Direction::Free => {
                // Along the strongest input's effect on the rate.
                let gain = |input: usize| dot(&rate, &plant.b_column(input));
                let input = (0..self.data().signals())
                    .max_by(|a, b| gain(*a).abs().total_cmp(&gain(*b).abs()))
                    .unwrap_or(0);
                let scale = gain(input);
                if scale.abs() < 1e-300 {
                    return;
                }
                let n = structure.states();
                let value = dot(&rate, &numbers[..n]) / scale;
                let std = covariance.filter(|_| !fixed).map(|c| {
                    let block = c.view((offset, offset), (n, n));
                    let r = nalgebra::DVector::from_column_slice(&rate);
                    ((r.transpose() * block * &r)[(0, 0)].max(0.0)).sqrt() / scale.abs()
                });
                (
                    value * scale.signum(),
                    std,
                    self.inputs()[input].unit.clone().unwrap_or_default(),
                )
            }
        };
        let (_, output) = self.channels_of(effect);
        let of = output.unit.clone().unwrap_or_default();
        let rate_unit = if matches!(effect.signal, Signal::Integral(_)) {
            of.clone()
        } else {
            format!("{of}/s")
        };
        let unit = match (unit.is_empty() || of.is_empty(), per, effect.definition.id) {
            (_, 0, _) => unit,
            (true, ..) => String::new(),
            (false, 1, _) => format!("{unit}/({of})"),
            (false, p, "quadratic_drag") => format!("{unit}/({rate_unit})^{p}"),
            (false, p, _) => format!("{unit}/({of})^{p}"),
        };
        let name = match effect.definition.id {
            "coulomb_friction" | "stribeck_friction" => "friction_force",
            "quadratic_drag" => "drag",
            "hysteresis" => "loop_force",
            "load_step" => "load",
            "end_stop" => "stop_stiffness",
            "stiffness_change" => "stiffness_change",
            "position_dependent_gain" => "gain_per_position",
            _ => "stiffness",
        };
        parameters.insert(name.to_owned(), Quantity { value, std, unit });
    }

    fn proof(
        &self,
        problem: &Problem,
        boring: &Fit,
        model: &Fit,
        shown: usize,
    ) -> (FitTable, EffectSize, Option<f64>) {
        let data = self.data();
        let given = &self.finding.boring.given;
        let parameters = &self.finding.boring.full;
        let parameters = if self.finding.verdict == Verdict::Consistent {
            boring
        } else {
            parameters
        };
        let structure_share = self
            .finding
            .adequacy
            .map_or(0.0, |a| if a.p_value < 0.01 { a.share } else { 0.0 });
        let train_steps = prove::Steps {
            simulation: &given.residual,
            parameters_only: &parameters.residual,
            augmented: &model.residual,
            structure_share,
        };
        let train = prove::steps(data, &train_steps, &self.mask, shown, None);
        let (train_mask, test_mask) = prove::split(data, &self.mask);
        let (refit_parameters, refit_model) = rayon::join(
            || prove::refit(problem, parameters, &train_mask),
            || prove::refit(problem, model, &train_mask),
        );
        let heldout = match (&refit_parameters, &refit_model) {
            (Some(p), Some(m)) => Some(prove::steps(
                data,
                &prove::Steps {
                    simulation: &given.residual,
                    parameters_only: &p.residual,
                    augmented: &m.residual,
                    structure_share,
                },
                &test_mask,
                shown,
                Some(self.seed),
            )),
            _ => None,
        };
        let heldout_gain = match (&refit_parameters, &refit_model) {
            (Some(p), Some(m)) => Some(
                p.noise.deviance(&p.residual, &test_mask)
                    - m.noise.deviance(&m.residual, &test_mask),
            ),
            _ => None,
        };
        let square = |f: f64| f * f;
        let lost = |f: &super::explanation::FitFigure| square((100.0 - f.fit_percent) / 100.0);
        let size = EffectSize {
            linear_share: (1.0 - lost(&train.parameters_only)).clamp(0.0, 1.0),
            removed_share: (1.0
                - square(train.augmented.rmse / train.parameters_only.rmse.max(1e-300)))
            .clamp(0.0, 1.0),
            heldout_gain: heldout
                .as_ref()
                .map_or(0.0, |h| h.parameters_only.rmse - h.augmented.rmse),
        };
        let time = |s: usize, k: usize| data.segments[s].start_time + k as f64 * data.sample_time;
        let table = FitTable {
            output: self.outputs()[shown].name.clone(),
            train,
            heldout,
            heldout_blocks: prove::blocks(data)
                .into_iter()
                .map(|(s, a, b)| [time(s, a), time(s, b)])
                .collect(),
        };
        (table, size, heldout_gain)
    }

    fn location(
        &self,
        squares: &Series,
        boring: &Fit,
        model: &Fit,
        shown: usize,
        names: (&[String], &[String]),
    ) -> Location {
        let data = self.data();
        let l = data.outputs;
        let end = |s: usize| {
            data.segments[s].start_time + data.segments[s].samples() as f64 * data.sample_time
        };
        let mean = |o: usize| {
            let (mut sum, mut n) = (0.0, 0.0);
            for s in (o..squares.len()).step_by(l) {
                for (v, keep) in squares[s].iter().zip(&self.mask[s]) {
                    if *keep {
                        sum += v;
                        n += 1.0;
                    }
                }
            }
            (sum / f64::max(n, 1.0), n)
        };
        // Mean square beyond what noise of this length shows.
        let mut outputs: Vec<String> = (0..l)
            .filter(|o| {
                let (m, n) = mean(*o);
                m > 1.0 + 4.0 * (2.0 / f64::max(n, 1.0)).sqrt()
            })
            .map(|o| names.1[o].clone())
            .collect();
        if outputs.is_empty() && self.finding.verdict != Verdict::Consistent {
            outputs.push(names.1[shown].clone());
        }
        let mut time: Vec<[f64; 3]> = Vec::new();
        for freeze in &self.finding.freezes {
            let at =
                |k: usize| data.segments[freeze.segment].start_time + k as f64 * data.sample_time;
            time.push([at(freeze.from), at(freeze.to), 1.0]);
        }
        for index in model.structure.first_new()..model.structure.effects.len() {
            let effect = &model.structure.effects[index];
            let shape = model.structure.shape(&model.theta, index);
            if let Some(at) = effect
                .definition
                .parameters
                .iter()
                .position(|p| p.name == "from")
            {
                time.push([shape[at], end(0), mean(shown).0]);
            }
        }
        if time.is_empty() {
            time = locate::windows(data, squares, &self.mask);
        }
        let before = locate::spectrum(&boring.residual, l, shown, data.sample_time);
        let after = locate::spectrum(&model.residual, l, shown, data.sample_time);
        let port = (!model.structure.new_effects().is_empty()).then(|| {
            match model.structure.new_effects()[0].definition.port() {
                Port::Input | Port::Path => "input",
                Port::Force => "inside",
                Port::Sensor | Port::Exact => "output",
            }
            .to_owned()
        });
        let found = self.finding.verdict != Verdict::Consistent;
        Location {
            outputs: if found { outputs } else { Vec::new() },
            port: port.or_else(|| (!self.finding.freezes.is_empty()).then(|| "output".to_owned())),
            time: if found { time } else { Vec::new() },
            frequency: locate::frequencies(&before, &after),
            regime: if found {
                locate::regimes(data, boring, squares, &self.mask, shown, names)
            } else {
                Vec::new()
            },
        }
    }

    fn alternatives(&self) -> Vec<Alternative> {
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
        self.finding
            .rivals
            .iter()
            .filter(|r| unexplained || !named.contains(&r.definition.id))
            .take(12)
            .map(|r| {
                let why_not = if unexplained {
                    format!(
                        "it leaves structure that noise does not make (evidence {})",
                        words::number(r.gain)
                    )
                } else if gain <= 0.0 {
                    format!(
                        "evidence {}, and {NEEDED:.0} is needed",
                        words::number(r.gain)
                    )
                } else if gain - r.gain < EFFECTS_TIE {
                    "it explains this recording equally well".to_owned()
                } else if r.gain < NEEDED {
                    format!(
                        "it explains no more than other parameters do (evidence {})",
                        words::number(r.gain)
                    )
                } else {
                    format!(
                        "its evidence is {} against {}: exp({}) times less likely",
                        words::number(r.gain),
                        words::number(gain),
                        words::number(0.5 * (gain - r.gain))
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

    fn experiment(&self) -> Option<String> {
        let best = self.finding.rivals.first()?;
        match self.finding.verdict {
            Verdict::Family => {
                let named = self.finding.model.structure.new_effects().first()?.definition;
                let rival = self.finding.rivals.iter().find(|r| r.definition.id != named.id)?;
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
            Verdict::Unexplained => best.definition.mimics.first().map(|m| m.experiment.to_owned()).or_else(|| {
                Some("repeat the recording at half and at twice the amplitude, and once with a slow ramp over the whole range".to_owned())
            }),
            _ => None,
        }
    }

    fn remaining(&self, problem: &Problem, model: &Fit) -> Remaining {
        let adequacy = self
            .finding
            .adequacy
            .or_else(|| adequacy(problem, model, None));
        let Some(a) = adequacy else {
            return Remaining {
                adequate: true,
                p_value: 1.0,
                share: 0.0,
                features: 0,
                sentence: "The recording is too short to test what is left".to_owned(),
            };
        };
        let share = 100.0 * a.share;
        let sentence = if a.p_value > super::adequacy::LEVEL {
            format!(
                "What is left is noise to {} flexible features (p = {:.2})",
                a.features, a.p_value
            )
        } else if a.holds() {
            format!(
                "{share:.1} % of what is left is structure still: real, but small beside what was found"
            )
        } else {
            format!(
                "{share:.0} % of what is left is structure (p = {:.0e})",
                a.p_value
            )
        };
        Remaining {
            adequate: a.holds(),
            p_value: a.p_value,
            share: a.share,
            features: a.features,
            sentence: format!("{sentence}."),
        }
    }

    fn noise(&self, model: &Fit) -> Vec<NoiseFound> {
        (0..self.data().outputs)
            .map(|o| NoiseFound {
                output: self.outputs()[o].name.clone(),
                autoregression: model.noise.ar[o].clone(),
                innovation_std: model.noise.scale[o],
                degrees_of_freedom: model
                    .noise
                    .degrees
                    .is_finite()
                    .then_some(model.noise.degrees),
            })
            .collect()
    }

    /// How large effects must have been: from the error of what a few of them would have added.
    fn detectable(&self, verdict: Verdict) -> Vec<Detectable> {
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

    fn parameter_changes(&self, boring: &Fit) -> Vec<ParameterChange> {
        let fit = if self.finding.model.structure.plant_free {
            &self.finding.model
        } else {
            boring
        };
        if !fit.structure.plant_free {
            return self.adjustments(fit);
        }
        let system = |plant: &super::plant::Plant| {
            StateSpace::deterministic(
                plant.a_matrix(),
                plant.b_matrix(),
                plant.c_matrix(),
                plant.d_matrix(),
                plant.sample_time,
            )
            .ok()
        };
        let (Some(before), Some(after)) = (
            system(&fit.structure.coordinates.given),
            system(&fit.structure.plant(&fit.theta)),
        ) else {
            return Vec::new();
        };
        let mut changes = Vec::new();
        if let (Ok(mut a), Ok(mut b)) = (before.poles(), after.poles()) {
            let key = |p: &crate::model::Pole| (p.natural_frequency, p.value.im);
            a.retain(|p| p.value.im >= 0.0);
            b.retain(|p| p.value.im >= 0.0);
            a.sort_by(|x, y| key(x).0.total_cmp(&key(y).0));
            b.sort_by(|x, y| key(x).0.total_cmp(&key(y).0));
            if a.len() == b.len() {
                for (i, (x, y)) in a.iter().zip(&b).enumerate() {
                    changes.push(ParameterChange {
                        name: format!("natural frequency {}", i + 1),
                        simulation: x.natural_frequency / std::f64::consts::TAU,
                        recording: y.natural_frequency / std::f64::consts::TAU,
                        unit: "Hz".to_owned(),
                    });
                    if let (Some(simulation), Some(recording), true) =
                        (x.damping, y.damping, x.value.im > 0.0 && y.value.im > 0.0)
                    {
                        changes.push(ParameterChange {
                            name: format!("damping ratio {}", i + 1),
                            simulation,
                            recording,
                            unit: String::new(),
                        });
                    }
                }
            }
        }
        if let (Some(a), Some(b)) = (before.static_gain(), after.static_gain()) {
            for o in 0..self.outputs().len() {
                for j in 0..self.data().signals() {
                    if a[(o, j)].abs() > 1e-9 {
                        changes.push(ParameterChange {
                            name: format!(
                                "static gain {}/{}",
                                self.outputs()[o].name,
                                self.inputs()[j].name
                            ),
                            simulation: a[(o, j)],
                            recording: b[(o, j)],
                            unit: String::new(),
                        });
                    }
                }
            }
        }
        changes.retain(|c| c.simulation.is_finite() && c.recording.is_finite());
        changes
    }

    /// Single numbers that were adjusted beside the plant as given.
    fn adjustments(&self, fit: &Fit) -> Vec<ParameterChange> {
        let structure = &fit.structure;
        (structure.known.len()..structure.first_new())
            .map(|index| {
                let effect = &structure.effects[index];
                let number = structure.effect_numbers(&fit.theta, index)[0];
                let (input, output) = self.channels_of(effect);
                let unit = |of: &str| match (&input.unit, &output.unit) {
                    (Some(i), Some(o)) => format!("{i}/({o}{of})"),
                    _ => String::new(),
                };
                match effect.definition.id {
                    "input_gain" => ParameterChange {
                        name: format!("gain of {}, relative", input.name),
                        simulation: 1.0,
                        recording: 1.0 + number,
                        unit: String::new(),
                    },
                    id => ParameterChange {
                        name: format!(
                            "additional {} at {}",
                            id.trim_start_matches("linear_"),
                            output.name
                        ),
                        simulation: 0.0,
                        recording: number,
                        unit: unit(if id == "linear_damping" { "/s" } else { "" }),
                    },
                }
            })
            .collect()
    }

    fn signals(&self, boring: &Fit, model: &Fit) -> Vec<SignalTraces> {
        let data = self.data();
        let l = data.outputs;
        let given = &self.finding.boring.given;
        let mut traces = Vec::new();
        for (s, segment) in data.segments.iter().enumerate() {
            let stride = segment.samples().div_ceil(TRACE_POINTS).max(1);
            let thin = |v: &[f64]| -> Vec<f64> { v.iter().step_by(stride).copied().collect() };
            for o in 0..l {
                let series = s * l + o;
                let before = locate::spectrum(&boring.residual, l, o, data.sample_time);
                let after = locate::spectrum(&model.residual, l, o, data.sample_time);
                // In the units of the recording, also where the engine works relative to a simulator.
                let skip = ((segment.start_time - self.recordings[s].start_time) / data.sample_time)
                    .round()
                    .max(0.0) as usize;
                let recorded = &self.recordings[s].output_data[o][skip..skip + segment.samples()];
                let correction: Vec<f64> = recorded
                    .iter()
                    .zip(&segment.outputs[o])
                    .map(|(r, y)| r - y)
                    .collect();
                let back = |v: &[f64]| -> Vec<f64> {
                    thin(
                        &v.iter()
                            .zip(&correction)
                            .map(|(v, c)| v + c)
                            .collect::<Vec<_>>(),
                    )
                };
                traces.push(SignalTraces {
                    output: self.outputs()[o].name.clone(),
                    unit: self.outputs()[o].unit.clone().unwrap_or_default(),
                    recording: s,
                    time: (0..segment.samples())
                        .step_by(stride)
                        .map(|k| segment.start_time + k as f64 * data.sample_time)
                        .collect(),
                    recorded: thin(recorded),
                    simulated: back(&given.simulated[series]),
                    parameters_only: back(&self.finding.boring.full.simulated[series]),
                    augmented: back(&model.simulated[series]),
                    spectrum: locate::spectrum_picture(&before, &after),
                });
            }
        }
        traces
    }
}

fn port_name(port: Port) -> &'static str {
    match port {
        Port::Input => "input",
        Port::Force => "force",
        Port::Sensor | Port::Exact => "sensor",
        Port::Path => "path",
    }
}
