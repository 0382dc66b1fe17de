//! From what was found to what is said.

use super::learned_curve;
use super::probability::probability;
use super::regions;
use crate::explain::document::plots::{extremes, spectrum, spectrum_picture};
use crate::explain::document::sentences;
use crate::explain::effects::Port;
use crate::explain::explanation::{
    AugmentedModel, EXPLANATION_FORMAT, EffectSize, Explanation, FitTable, Location, NoiseFound,
    Remaining, SignalTraces, Verdict,
};
use crate::explain::linear::check::same_factor;
use crate::explain::linear::data::{Data, Series};
use crate::explain::linear::decision::output_error_decision::Finding;
use crate::explain::linear::fit::{Fit, Problem};
use crate::explain::linear::known::Known;
use crate::explain::linear::screening::output_adequacy::{LEVEL, adequacy};
use crate::explain::linear::search::cross_validation;
use crate::explain::linear::search::penalties::NEEDED;
use crate::identify::Recording;
use crate::log::{Channel, Log};
use crate::noise::Mask;

/// Points of a trace in the document, at most.
const TRACE_POINTS: usize = 1500;

pub(crate) struct Answer<'a> {
    pub(crate) recordings: &'a [Log],
    pub(crate) known: &'a Known,
    pub(crate) finding: &'a Finding,
    pub(crate) mask: Mask,
    pub(crate) seed: u64,
}

impl Answer<'_> {
    pub(crate) fn data(&self) -> &Data {
        &self.known.data
    }

    pub(crate) fn inputs(&self) -> &[Channel] {
        &self.recordings[0].inputs
    }

    pub(crate) fn outputs(&self) -> &[Channel] {
        &self.recordings[0].outputs
    }

    pub(crate) fn names(&self) -> (Vec<String>, Vec<String>) {
        let of = |list: &[Channel]| list.iter().map(|c| c.name.clone()).collect();
        (of(self.inputs()), of(self.outputs()))
    }

    fn problem(&self) -> Problem<'_> {
        Problem {
            mask: self.mask.clone(),
            ..Problem::new(self.data())
        }
    }

    pub(crate) fn say(&self) -> Explanation {
        let finding = self.finding;
        let problem = self.problem();
        let count = finding.count;
        let boring = finding.boring.best(count);
        let model = &finding.model;
        let shown = self.output_that_shows(boring, model);
        let (input_names, output_names) = self.names();
        let squares = regions::excess(&boring.residual, &model.noise, &self.mask);
        let effects = match &finding.weak {
            Some(proof) => self.drive_effects(proof),
            None => self.effects(&problem, model),
        };
        let (fit, effect_size, heldout_gain) = self.proof(boring, model, shown);
        let mut effects = effects;
        if let Some(first) = effects.first_mut() {
            first.evidence.heldout_gain = heldout_gain;
        }
        effects.extend(self.troubles());
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
        if let Some(proof) = &finding.weak {
            augmented.mechanics = Some(self.mechanics(proof));
        }
        let curve = (verdict == Verdict::Unexplained && finding.weak.is_none())
            .then(|| learned_curve::learn(&problem, boring, &input_names, &output_names))
            .flatten();
        let mut explanation = Explanation {
            format: EXPLANATION_FORMAT.to_owned(),
            hypotheses: vec![],
            verdict,
            probability: probability(finding, &fit),
            summary: Vec::new(),
            effects: if verdict == Verdict::Unexplained {
                Vec::new()
            } else {
                effects
            },
            alternatives,
            location,
            fit,
            parameters_together: None,
            parameters: if verdict == Verdict::Consistent {
                Vec::new()
            } else {
                self.parameter_changes(&problem, model)
            },
            remaining: match &finding.weak {
                Some(proof) => proof.remaining(),
                None => self.remaining(&problem, model),
            },
            separating_experiment,
            effect_size,
            detectable: self.detectable(verdict),
            noise: self.noise(model),
            curve,
            model: Some(augmented),
            plant: None,
            signals: self.signals(boring, model),
            recordings: self
                .recordings
                .iter()
                .map(|log| Recording::of_log(log, None))
                .collect(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
        };
        explanation.summary = sentences::summary(&explanation, NEEDED);
        for &recording in &explanation.location.recordings {
            let name = &self.recordings[recording].name;
            let at = explanation.effects.len().min(explanation.summary.len());
            explanation.summary.insert(
                at,
                format!("It acts in {name} only, not in the other recordings."),
            );
        }
        if let (Some(mechanics), true) = (
            explanation
                .model
                .as_ref()
                .and_then(|m| m.mechanics.as_ref()),
            matches!(verdict, Verdict::Parameters | Verdict::Unexplained),
        ) {
            explanation.summary.insert(1, mechanics.sentence.clone());
        }
        self.say_of_the_data(&mut explanation);
        explanation
    }

    /// What is wrong with the data comes first, whatever the answer is.
    fn say_of_the_data(&self, explanation: &mut Explanation) {
        let said = &mut explanation.summary;
        let new: Vec<String> = self
            .finding
            .troubles
            .iter()
            .map(|t| t.sentence.clone())
            .filter(|s| !said.contains(s))
            .collect();
        said.splice(0..0, new);
        if explanation.verdict == Verdict::Parameters {
            let free = &self.finding.boring.full;
            said.extend(same_factor(
                &self.known.structure.coordinates.given,
                &free.structure.plant(&free.theta),
                self.data().signals(),
            ));
        }
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

    fn proof(
        &self,
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
        let structure_share = self.finding.adequacy.map_or(0.0, |a| a.share_of_error);
        let train_steps = cross_validation::Steps {
            simulation: &given.residual,
            parameters_only: &parameters.residual,
            augmented: &model.residual,
            structure_share,
        };
        let train = cross_validation::steps(data, &train_steps, &self.mask, shown, None);
        let aside = &self.finding.heldout;
        let counts = aside.iter().flatten().any(|counts| *counts);
        let heldout = counts
            .then(|| cross_validation::steps(data, &train_steps, aside, shown, Some(self.seed)));
        let deviance = |fit: &Fit| fit.noise.deviance(&fit.residual, aside);
        let heldout_gain = match &self.finding.weak {
            Some(proof) => proof.heldout_gain,
            None => counts.then(|| deviance(parameters) - deviance(model)),
        };
        let square = |f: f64| f * f;
        let lost =
            |f: &crate::explain::explanation::FitFigure| square((100.0 - f.fit_percent) / 100.0);
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
            heldout_blocks: cross_validation::blocks(data)
                .into_iter()
                .map(|(s, a, b)| [time(s, a), time(s, b)])
                .collect(),
            outputs: vec![],
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
                let last = model.structure.recording.unwrap_or(0);
                time.push([shape[at], end(last), mean(shown).0]);
            }
        }
        if time.is_empty() {
            time = (0..data.segments.len())
                .filter(|s| model.structure.recording.is_none_or(|only| only == *s))
                .flat_map(|s| regions::windows(data, squares, &self.mask, s))
                .collect();
            time.sort_by(|a, b| b[2].total_cmp(&a[2]));
        }
        let before = spectrum(&boring.residual, l, shown, data.sample_time);
        let after = spectrum(&model.residual, l, shown, data.sample_time);
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
            recordings: model.structure.recording.into_iter().collect(),
            outputs: if found { outputs } else { Vec::new() },
            port: port.or_else(|| (!self.finding.freezes.is_empty()).then(|| "output".to_owned())),
            time: if found { time } else { Vec::new() },
            frequency: regions::frequencies(&before, &after),
            regime: if found {
                regions::regimes(data, &boring.simulated, squares, &self.mask, shown, names)
            } else {
                Vec::new()
            },
            equations: None,
        }
    }

    fn remaining(&self, problem: &Problem, model: &Fit) -> Remaining {
        let adequacy = self
            .finding
            .adequacy
            .or_else(|| adequacy(problem, model, &self.finding.boring.given, None));
        let Some(a) = adequacy else {
            return Remaining {
                adequate: true,
                p_value: 1.0,
                share: 0.0,
                share_of_removed: None,
                features: 0,
                sentence: "The recording is too short to test what is left".to_owned(),
            };
        };
        let share = 100.0 * a.share;
        let sentence = if a.p_value > LEVEL {
            a.sentence("")
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
            share_of_removed: a.of_removed.is_finite().then_some(a.of_removed),
            features: a.features,
            sentence: format!("{sentence}."),
        }
    }

    fn noise(&self, model: &Fit) -> Vec<NoiseFound> {
        (0..self.data().outputs)
            .map(|o| NoiseFound {
                output: self.outputs()[o].name.clone(),
                autoregression: model.noise.colours[o].ar.clone(),
                moving_average: model.noise.colours[o].ma.clone(),
                innovation_std: model.noise.scale[o],
                degrees_of_freedom: model
                    .noise
                    .degrees
                    .is_finite()
                    .then_some(model.noise.degrees),
            })
            .collect()
    }

    fn signals(&self, boring: &Fit, model: &Fit) -> Vec<SignalTraces> {
        let data = self.data();
        let l = data.outputs;
        let given = &self.finding.boring.given;
        let mut traces = Vec::new();
        for (s, segment) in data.segments.iter().enumerate() {
            for o in 0..l {
                let series = s * l + o;
                let shown = extremes(&given.residual[series], TRACE_POINTS);
                let thin = |v: &[f64]| -> Vec<f64> { shown.iter().map(|k| v[*k]).collect() };
                let before = spectrum(&boring.residual, l, o, data.sample_time);
                let after = spectrum(&model.residual, l, o, data.sample_time);
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
                    time: shown
                        .iter()
                        .map(|k| segment.start_time + *k as f64 * data.sample_time)
                        .collect(),
                    recorded: thin(recorded),
                    simulated: back(&given.simulated[series]),
                    parameters_only: back(&self.finding.boring.full.simulated[series]),
                    augmented: back(&model.simulated[series]),
                    spectrum: spectrum_picture(&before, &after),
                });
            }
        }
        traces
    }
}
