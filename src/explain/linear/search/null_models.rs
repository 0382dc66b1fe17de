//! Null models: the simulation as given, with other initial states, with other parameters, and no missing physics.

use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::explain::effects;
use crate::explain::linear::fit::{Effort, Fit, Problem};
use crate::explain::linear::model::functionals::{Functionals, Signal};
use crate::explain::linear::model::structure::{Direction, Instance, Structure};

/// Probability by chance below which other parameters are certain. Slow noise makes a likelihood ratio larger than its law says.
const REFUSED: f64 = 1e-6;

/// The explanations without new physics.
#[derive(Debug, Clone)]
pub(crate) struct Boring {
    /// The simulation as it was given.
    pub(crate) given: Fit,
    /// With other initial states, if the criterion allows.
    pub(crate) strict: Fit,
    /// The plant as given, with what the criterion allows of other initial states, gains, stiffness, damping and mass.
    pub(crate) near: Fit,
    /// With other parameters and initial states.
    pub(crate) full: Fit,
}

impl Boring {
    /// All of them around `structure`, the simulation as it is known; `refit` is another plant from which its parameters may
    /// be fitted as well.
    pub(crate) fn fit(
        problem: &Problem,
        structure: &Structure,
        refit: Option<&Structure>,
    ) -> Option<Self> {
        let count = problem.count();
        let fit = |structure: Structure, theta: Vec<f64>| {
            Fit::run(problem, structure, theta, None, Effort::FINAL)
        };
        let with = |plant_free, initial_free| {
            let structure = Structure {
                plant_free,
                initial_free,
                ..structure.clone()
            };
            let theta = structure.given();
            (structure, theta)
        };
        let run = |(structure, theta)| fit(structure, theta);
        let (given, (initial, full)) = rayon::join(
            || run(with(false, false)),
            || rayon::join(|| run(with(false, true)), || run(with(true, true))),
        );
        let (given, mut full) = (given?, full?);
        if let Some(other) = refit.and_then(|refit| fit(refit.clone(), refit.given())) {
            full.better_of(other, count);
        }
        if let Some(about) = about_an_operating_point(problem, structure, &full) {
            full.better_of(about, count);
        }
        let mut near = given.clone();
        near.better_of(initial?, count);
        let strict = near.clone();
        let adjusted: Vec<Fit> = adjustments(problem, structure)
            .into_par_iter()
            .filter_map(|list| {
                let mut structure = near.structure.clone();
                structure.adjusted = list.len();
                let mut theta = near.theta.clone();
                theta.extend(
                    list.iter()
                        .flat_map(|i| vec![0.0; i.len(structure.states(), structure.outputs())]),
                );
                structure.effects.extend(list);
                fit(structure, theta)
            })
            .collect();
        for candidate in adjusted {
            near.better_of(candidate, count);
        }
        Some(Self {
            given,
            strict,
            near,
            full,
        })
    }

    /// Takes over what fits with an effect show of the other numbers: without the effect they may be a better null model than was
    /// found, and what was gained by them is no evidence of the effect. Whether anything was better.
    pub(crate) fn improve_from(&mut self, problem: &Problem, promising: &[&Fit]) -> bool {
        let count = problem.count();
        let least = self.best(count).criterion(count);
        let better: Vec<Fit> = (promising.par_iter())
            .filter_map(|fit| {
                let (structure, theta) = fit.structure.without_new_effects(&fit.theta);
                Fit::at(problem, structure, theta)
            })
            .filter(|fit| fit.criterion(count) < least)
            .filter_map(|fit| fit.improved(problem, Effort::FINAL))
            .collect();
        for fit in better {
            match fit.structure.plant_free {
                true => self.full.better_of(fit, count),
                false => self.near.better_of(fit, count),
            }
        }
        self.best(count).criterion(count) < least
    }

    /// Whether the likelihood ratio refuses the simulation as given, although a criterion that counts every number of the plant prefers
    /// it: of many numbers few may have changed.
    pub(crate) fn refuses_given(&self) -> bool {
        let more = self.full.free.saturating_sub(self.given.free).max(1);
        let gained = (self.given.deviance - self.full.deviance).max(0.0);
        ChiSquared::new(more as f64).is_ok_and(|law| law.sf(gained) < REFUSED)
    }

    /// The one with the least criterion.
    pub(crate) fn best(&self, count: usize) -> &Fit {
        if self.full.criterion(count) < self.near.criterion(count) {
            &self.full
        } else {
            &self.near
        }
    }
}

/// Other parameters about an operating point: where a plant with other gains is linear about a level, its outputs are
/// shifted as well, and that is no offset of a sensor. Only where the level lies within what the inputs visit: there the
/// shift is less than the other gains make of one standard deviation of the inputs.
fn about_an_operating_point(problem: &Problem, given: &Structure, full: &Fit) -> Option<Fit> {
    const WITHIN: f64 = 1.0;
    let data = problem.data;
    let offset = effects::find("sensor_offset", "")?;
    let mut structure = full.structure.clone();
    structure.adjusted = data.outputs;
    structure
        .effects
        .extend((0..data.outputs).map(|channel| Instance {
            definition: offset,
            channel,
            signal: Signal::Output(channel),
            direction: Direction::Free,
        }));
    let mut theta = full.theta.clone();
    theta.extend(std::iter::repeat_n(0.0, data.outputs));
    let fit = Fit::run(problem, structure, theta, Some(&full.noise), Effort::FINAL)?;
    let gain = |plant: &crate::explain::linear::model::linear_plant::Plant| {
        let n = plant.states;
        let inverse = (nalgebra::DMatrix::identity(n, n) - plant.a_matrix()).try_inverse()?;
        Some(plant.c_matrix() * inverse * plant.b_matrix() + plant.d_matrix())
    };
    let change = gain(&fit.structure.plant(&fit.theta))? - gain(&given.coordinates.given)?;
    let mean = |j: usize| {
        let values = || data.segments.iter().flat_map(|s| s.inputs[j].iter());
        values().sum::<f64>() / values().count().max(1) as f64
    };
    let spread = data.input_scale();
    let signals = data.signals();
    let within = (0..data.outputs).all(|o| {
        let at_mean: f64 = (0..data.inputs).map(|j| change[(o, j)] * mean(j)).sum();
        let first = fit.structure.effect_offset(fit.structure.known.len() + o);
        let reach: f64 = (0..signals)
            .map(|j| (change[(o, j)] * spread[j]).abs())
            .sum();
        (at_mean + fit.theta[first]).abs() <= WITHIN * reach
    });
    within.then_some(fit)
}

/// Most numbers that are adjusted together.
const MOST_ADJUSTED: usize = 8;

/// Sets of adjustments that are tried: gains; gains, stiffness, damping and mass.
fn adjustments(problem: &Problem, structure: &Structure) -> Vec<Vec<Instance>> {
    let (Some(gain), Some(stiffness), Some(damping), Some(inertia)) = (
        effects::find("input_gain", ""),
        effects::find("linear_stiffness", ""),
        effects::find("linear_damping", ""),
        effects::find("linear_inertia", ""),
    ) else {
        return Vec::new();
    };
    let plant = &structure.coordinates.given;
    let rows = Functionals::new(plant);
    let inputs: Vec<usize> = structure
        .coordinates
        .active_inputs
        .iter()
        .copied()
        .filter(|j| *j < problem.data.signals())
        .collect();
    let gains: Vec<Instance> = inputs
        .iter()
        .map(|&channel| Instance {
            definition: gain,
            channel,
            signal: Signal::Output(0),
            direction: Direction::Matched(channel),
        })
        .collect();
    let mut forces = Vec::new();
    for output in 0..plant.outputs {
        let signal = if rows.integrates(plant, output) {
            Signal::Integral(output)
        } else {
            Signal::Output(output)
        };
        for &input in &inputs {
            for definition in [stiffness, damping, inertia] {
                forces.push(Instance {
                    definition,
                    channel: input,
                    signal,
                    direction: Direction::Matched(input),
                });
            }
        }
    }
    let mut sets = vec![gains.clone()];
    if gains.len() + forces.len() <= MOST_ADJUSTED {
        if inputs.len() == 1 {
            sets.extend(forces.iter().map(|f| vec![*f]));
        }
        sets.push(forces.clone());
        sets.push(gains.into_iter().chain(forces).collect());
    }
    sets
}
