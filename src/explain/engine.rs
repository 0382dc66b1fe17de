//! The whole inquiry, step by step.

use std::sync::Arc;

use super::baseline::identify_simulator;
use super::coordinates::Coordinates;
use super::data::{Data, Segment, Series};
use super::effects::{Action, Definition};
use super::fit::{Effort, Fit, Problem};
use super::plant::Plant;
use super::search::{Boring, single_effects};
use super::structure::Structure;
use crate::identify::Model;
use crate::log::Log;

/// What stands for the simulation.
#[derive(Debug, Clone)]
pub enum Simulation {
    /// A linear model.
    Model(Box<Model>),
    /// Simulated outputs, one log a recording (the channels are its outputs).
    Outputs(Vec<Log>),
}

/// The simulation as the engine knows it.
#[derive(Debug, Clone)]
pub(crate) struct Known {
    /// Plant and effects that the simulation holds, all numbers fixed.
    pub structure: Structure,
    /// What the simulator says beyond what `structure` says (a nonlinear simulator that was learnt imperfectly).
    pub correction: Option<Series>,
    /// Relative misfit of a simulator known by its outputs alone.
    pub misfit: f64,
}

/// Learns the simulation from its model or its outputs.
pub(crate) fn know(data: &Data, simulation: &Simulation) -> Option<Known> {
    match simulation {
        Simulation::Model(model) => {
            let plant = Plant::from_state_space(&model.system);
            let zero = vec![vec![0.0; plant.states]; data.segments.len()];
            Some(Known {
                structure: bare(&plant, &zero),
                correction: None,
                misfit: 0.0,
            })
        }
        Simulation::Outputs(logs) => {
            let mut noise_free = data.clone();
            for (segment, log) in noise_free.segments.iter_mut().zip(logs) {
                segment.outputs = log.output_data.clone();
            }
            let simulator = identify_simulator(&noise_free)?;
            let structure = bare(&simulator.plant, &simulator.initial);
            if simulator.is_linear() {
                return Some(Known {
                    structure,
                    correction: None,
                    misfit: simulator.misfit,
                });
            }
            learn_nonlinear(&noise_free, structure, simulator.misfit)
        }
    }
}

/// A plant without effects in minimal coordinates.
fn bare(plant: &Plant, initial: &[Vec<f64>]) -> Structure {
    let coordinates = Arc::new(Coordinates::new(plant));
    let initial = initial
        .iter()
        .map(|x| {
            (&coordinates.to_here * nalgebra::DVector::from_column_slice(x))
                .iter()
                .copied()
                .collect()
        })
        .collect();
    Structure {
        coordinates,
        plant_free: false,
        initial_free: false,
        initial,
        levels_free: false,
        effects: Vec::new(),
        known: Vec::new(),
    }
}

/// The effect that a nonlinear simulator holds, learnt from its noise-free outputs.
fn learn_nonlinear(noise_free: &Data, structure: Structure, misfit: f64) -> Option<Known> {
    let mut problem = Problem::new(noise_free);
    problem.noise_order = 0;
    let boring = Boring::fit(&problem, &structure)?;
    let physical = |d: &Definition| d.persists && matches!(d.action, Action::Force(..) | Action::Input(_) | Action::Sensor(_));
    let ranked = single_effects(&problem, &boring, &physical);
    let best = ranked.into_iter().next()?.fit;
    let best = Fit::run(&problem, best.structure.clone(), best.theta.clone(), Some(&best.noise), Effort::FINAL).unwrap_or(best);
    let fitted = &best.structure;
    let plant = fitted.plant(&best.theta);
    let initial = (0..noise_free.segments.len())
        .map(|s| fitted.initial_state(&best.theta, s).to_vec())
        .collect::<Vec<_>>();
    let mut coordinates = (*fitted.coordinates).clone();
    coordinates.given = plant;
    let structure = Structure {
        coordinates: Arc::new(coordinates),
        plant_free: false,
        initial_free: false,
        initial,
        known: vec![fitted.effect_numbers(&best.theta, 0).to_vec()],
        ..fitted.clone()
    };
    let said = structure.simulate(&[], noise_free)?;
    Some(Known {
        structure,
        correction: Some(noise_free.residual(&said)),
        misfit,
    })
}

/// TEMPORARY
pub fn scratch(recordings: &[Log], simulation: &Simulation) -> Option<Vec<String>> {
    let mut data = data_of(recordings);
    let known = know(&data, simulation)?;
    if let Some(correction) = &known.correction {
        println!(
            "   simulator misfit {:.2e} -> {:?} {:?}",
            known.misfit,
            known.structure.effects[0].definition.id,
            (correction[0].iter().map(|v| v * v).sum::<f64>() / correction[0].len() as f64).sqrt()
        );
        let l = data.outputs;
        for (s, segment) in data.segments.iter_mut().enumerate() {
            for (o, y) in segment.outputs.iter_mut().enumerate() {
                for (y, c) in y.iter_mut().zip(&correction[s * l + o]) {
                    *y -= c;
                }
            }
        }
    }
    let all = |_: &Definition| true;
    let (finding, _) = super::inquiry::inquire(&data, &known.structure, &all)?;
    let k = known.structure.effects.len();
    let mut named: Vec<String> = Vec::new();
    if matches!(finding.verdict, super::inquiry::Verdict::Named | super::inquiry::Verdict::Family) {
        named.extend(finding.model.structure.effects[k..].iter().map(|e| e.definition.id.to_owned()));
        if !finding.freezes.is_empty() { named.push("sensor_freeze".into()); }
        if finding.coarse.is_some() { named.push("sensor_quantization".into()); }
    }
    let c = finding.count;
    let mut lines = vec![format!("SAID {:?} {}", finding.verdict, named.join(","))];
    lines.push(format!("given {:.0} init {:.0} full {:.0} gain {:.1} adequacy {:?}", finding.boring.given.criterion(c), finding.boring.initial.criterion(c), finding.boring.full.criterion(c), finding.gain, finding.adequacy.map(|a| format!("stat {:.0}/{} p {:.1e} share {:.3} ofrem {:.4}", a.statistic, a.features, a.p_value, a.share, a.of_removed))));
    if let Some(fit) = &finding.augmented {
        for i in k..fit.structure.effects.len() {
            let e = &fit.structure.effects[i];
            lines.push(format!("  + {} {} {:?} {:?} free={} {:?}", e.definition.id, e.definition.variant, e.signal, e.direction, fit.structure.plant_free, fit.structure.shape(&fit.theta, i)));
        }
    }
    for r in finding.rivals.iter().take(5) {
        lines.push(format!("  {:10.1} {} {}", r.gain, r.definition.id, r.definition.variant));
    }
    Some(lines)
}

pub(crate) fn data_of(recordings: &[Log]) -> Data {
    Data {
        segments: recordings
            .iter()
            .map(|log| Segment {
                inputs: log.input_data.clone(),
                outputs: log.output_data.clone(),
                start_time: log.start_time,
            })
            .collect(),
        sample_time: recordings[0].sample_time,
        inputs: recordings[0].input_data.len(),
        outputs: recordings[0].output_data.len(),
    }
}
