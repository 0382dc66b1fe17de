//! A whole case: drawn, recorded, simulated wrongly, and its truth.

use std::collections::BTreeMap;

use super::dice::Dice;
use super::drawing::Drawing;
use super::effect::Effect;
use super::excitation::Excitation;
use super::linear::Discrete;
use super::numbers::{deviation, distance, root_mean_square, round_to};
use super::plant::{Plant, PlantKind};
use super::scene::{Placed, Scene};
use super::simulate::{Drive, Resolution, Run, run};
use super::truth::{Model, Truth};
use super::wiring::{Occasion, Placing};

/// A recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// Seconds.
    pub time: Vec<f64>,
    /// Input columns.
    pub inputs: Vec<Vec<f64>>,
    /// Output columns.
    pub outputs: Vec<Vec<f64>>,
}

/// What is given of the simulation.
#[derive(Debug, Clone, PartialEq)]
pub enum Simulation {
    /// The discrete linear model itself.
    Model(Model),
    /// Only its outputs for the recorded inputs.
    Column(Vec<Vec<f64>>),
}

/// A case with its truth.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// The real thing.
    pub recording: Recording,
    /// What the simulator says.
    pub simulation: Simulation,
    /// Input columns never recorded.
    pub fresh_input: Vec<Vec<f64>>,
    /// A nonlinear simulator's answer to them.
    pub fresh_simulation: Option<Vec<Vec<f64>>>,
    /// The true noise-free answer to them.
    pub fresh_truth: Vec<Vec<f64>>,
    /// The answer of a simulation with the right parameters and without the effect.
    pub fresh_ideal: Vec<Vec<f64>>,
    /// The answer.
    pub truth: Truth,
    /// Significant digits of written columns.
    pub digits: usize,
}

/// Draws case `index` of a seed: the same for the same arguments, and independent of other indices.
pub fn draw(seed: u64, index: usize, drawing: &Drawing) -> Case {
    const STRICT: usize = 12;
    let mut dice = Dice::new(seed, index as u64);
    let effects = drawing.kind.effects(&mut dice);
    let mut attempts = 0;
    loop {
        if let Some(case) = attempt(drawing, &effects, attempts < STRICT, &mut dice.fork()) {
            return case;
        }
        attempts += 1;
    }
}

fn choose_plant(effects: &[Effect], closed_loop: Option<bool>, dice: &mut Dice) -> PlantKind {
    let mut choices: Vec<PlantKind> = PlantKind::ALL
        .into_iter()
        .filter(|plant| effects.iter().all(|effect| effect.fits(*plant)))
        .filter(|plant| closed_loop != Some(false) || *plant != PlantKind::Stage)
        .collect();
    if choices.contains(&PlantKind::MsdPosition) {
        choices.push(PlantKind::MsdPosition);
    }
    if choices.is_empty() {
        PlantKind::MsdPosition
    } else {
        dice.pick(&choices)
    }
}

fn attempt(drawing: &Drawing, effects: &[Effect], strict: bool, dice: &mut Dice) -> Option<Case> {
    let kind = choose_plant(effects, drawing.closed_loop, dice);
    let may_loop = effects.iter().all(|effect| effect.fits_loop());
    let wants_loop = drawing.closed_loop.unwrap_or_else(|| dice.chance(0.25));
    let closed_loop = kind == PlantKind::Stage || (may_loop && wants_loop);
    let missing = effects.contains(&Effect::MissingInput);
    let plant = Plant::draw(kind, dice);
    let dt = kind.sample_time();
    let curved = !closed_loop && effects.iter().any(|effect| effect.is_input_curve());
    let shapes: Vec<Excitation> = Excitation::ALL
        .into_iter()
        .filter(|shape| !(curved && *shape == Excitation::Prbs))
        .collect();
    let excitation = dice.pick(&shapes);
    let columns = (0..plant.inputs())
        .map(|_| excitation.sequence(drawing.samples, dt, plant.frequency(), dice))
        .collect();
    let mut scene = Scene::prepare(plant, closed_loop, missing, columns, drawing.digits, dice)?;
    let noise = drawing.noise(dice);
    scene.noise = (0..scene.plant.outputs())
        .map(|_| noise.sequence(drawing.samples, dice))
        .collect();
    scene.known = known_effects(&scene, effects, dice);

    let wanted = drawing.effect_ratio(effects, kind, dice);
    let concealed: Vec<Placed> = effects
        .iter()
        .map(|effect| {
            let placing = Placing::draw(*effect, &scene.plant, dice);
            let share = if effects.len() > 1 { 0.8 } else { 1.0 };
            let strength = scene.strength_for(&placing, share * wanted);
            Placed { placing, strength }
        })
        .collect();
    let recorded = scene.record(&concealed, Resolution::FINE);
    let without = scene.record(&[], Resolution::FINE);
    let ratio = scene.effect_ratio(&concealed, &without, Resolution::FINE);
    let visible = ratio > 0.5 * wanted || effects.is_empty() || drawing.hard || !strict;
    if !recorded.is_tame() || !visible {
        return None;
    }

    let error = drawing.parameter_error(dice);
    let believed = scene.plant.misjudged(error, dice);
    let simulator = Simulator::new(&scene, believed);
    let simulated = simulator.answer(&scene, &recorded.inputs);
    let others: Vec<Excitation> = Excitation::ALL
        .into_iter()
        .filter(|other| *other != excitation)
        .collect();
    let fresh_kind = dice.pick(&others);
    let fresh = fresh_run(&scene, &concealed, fresh_kind, dice);
    if !fresh.is_sane() || simulated.iter().flatten().any(|v| !v.is_finite()) {
        return None;
    }
    let fresh_simulated = simulator.answer(&scene, &fresh.inputs);
    let fresh_ideal = Simulator::new(&scene, scene.plant.clone()).answer(&scene, &fresh.inputs);
    let nonlinear = !scene.known.is_empty();
    let as_model = !nonlinear && dice.chance(0.5);
    let window = concealed
        .iter()
        .find_map(|p| p.placing.window(p.strength, drawing.samples))
        .map(|(from, to)| [from, to].map(|k| round_to(k as f64 * dt, 12)));
    let truth = Truth {
        case: 0,
        effects: ids(&concealed),
        known_to_simulation: ids(&scene.known),
        plant: kind.id().into(),
        excitation: excitation.id().into(),
        closed_loop,
        effect_ratio: ratio,
        effect_ratio_wanted: if effects.is_empty() { 0.0 } else { wanted },
        noise_ratio: noise.ratio,
        noise_colour: noise.colour,
        noise_tail: noise.tail().into(),
        hard: drawing.hard,
        parameter_error: error,
        strengths: named(&scene, &concealed, |p| p.strength),
        places: named(&scene, &concealed, |p| p.placing.signal(&scene.plant)),
        par: particulars(&scene, &concealed),
        dt,
        given: if as_model {
            "model"
        } else {
            "simulated output"
        }
        .into(),
        rmse_sim: distance(&recorded.readings[0], &simulated[0]),
        rmse_noise: root_mean_square(scene.noise[0].iter().copied()),
        rmse_fresh_sim: distance(&fresh.clean[0], &fresh_simulated[0]),
        y_std: deviation(&recorded.clean[0]),
        window,
        baseline: Model::from(&simulator.linear),
    };
    let digits = drawing.digits;
    Some(Case {
        recording: Recording {
            time: (0..drawing.samples)
                .map(|k| round_to(k as f64 * dt, 12))
                .collect(),
            inputs: recorded.inputs,
            outputs: rounded(recorded.readings, digits),
        },
        simulation: if as_model {
            Simulation::Model(truth.baseline.clone())
        } else {
            Simulation::Column(rounded(simulated, digits))
        },
        fresh_input: fresh.inputs,
        fresh_simulation: nonlinear.then(|| rounded(fresh_simulated, digits)),
        fresh_truth: rounded(fresh.clean, digits),
        fresh_ideal: rounded(fresh_ideal, digits),
        truth,
        digits,
    })
}

/// In one of ten cases that allow it, an effect that the simulation knows too.
fn known_effects(scene: &Scene, effects: &[Effect], dice: &mut Dice) -> Vec<Placed> {
    let effect = dice.pick(&[Effect::CubicStiffness, Effect::QuadraticDrag]);
    let allowed = scene.plant.kind.has_spring()
        && scene.plant.outputs() == 1
        && !effects.iter().any(|e| {
            matches!(
                e,
                Effect::CubicStiffness | Effect::QuadraticDrag | Effect::Pendulum
            )
        });
    if !(allowed && dice.chance(0.2)) {
        return Vec::new();
    }
    let placing = Placing::draw(effect, &scene.plant, dice);
    let strength = scene.strength_for(&placing, dice.between(0.1, 0.3));
    vec![Placed { placing, strength }]
}

/// The simulation as its makers believe it.
struct Simulator {
    believed: Plant,
    linear: Discrete,
}

impl Simulator {
    fn new(scene: &Scene, believed: Plant) -> Self {
        let mut linear = believed.linear().discretise(believed.kind.sample_time());
        if scene.missing_input {
            for i in 0..linear.b.rows {
                linear.b.set(i, 1, 0.0);
            }
        }
        Self { believed, linear }
    }

    fn answer(&self, scene: &Scene, inputs: &[Vec<f64>]) -> Vec<Vec<f64>> {
        if scene.known.is_empty() {
            return self.linear.simulate(inputs);
        }
        let laws = scene.laws(&[], Occasion::Fresh);
        let drive = Drive::Open(inputs);
        run(&self.believed, &laws, &drive, &[], Resolution::FINE).clean
    }
}

/// The real plant on a fresh input in open loop. A plant that integrates gets the commands of a fresh loop.
fn fresh_run(scene: &Scene, concealed: &[Placed], kind: Excitation, dice: &mut Dice) -> Run {
    let laws = scene.laws(concealed, Occasion::Fresh);
    let samples = scene.samples() / 2;
    let mut columns = scene.fresh_columns(kind, samples, dice);
    let drive = if scene.plant.kind == PlantKind::Stage {
        for (column, old) in columns.iter_mut().zip(&scene.columns) {
            let size = deviation(old);
            column.iter_mut().for_each(|v| *v *= size);
        }
        Drive::Loop {
            controllers: &scene.controllers,
            references: &columns,
            digits: scene.digits,
        }
    } else {
        Drive::Open(&columns)
    };
    run(&scene.plant, &laws, &drive, &[], Resolution::FINE)
}

fn rounded(columns: Vec<Vec<f64>>, digits: usize) -> Vec<Vec<f64>> {
    columns
        .into_iter()
        .map(|column| column.into_iter().map(|v| round_to(v, digits)).collect())
        .collect()
}

fn ids(effects: &[Placed]) -> Vec<String> {
    effects
        .iter()
        .map(|p| p.placing.effect.id().into())
        .collect()
}

fn named<T>(
    scene: &Scene,
    concealed: &[Placed],
    what: impl Fn(&Placed) -> T,
) -> BTreeMap<String, T> {
    concealed
        .iter()
        .chain(&scene.known)
        .map(|p| (p.placing.effect.id().into(), what(p)))
        .collect()
}

fn particulars(scene: &Scene, concealed: &[Placed]) -> BTreeMap<String, f64> {
    let mut par = BTreeMap::new();
    for (i, value) in scene.plant.parameters.iter().enumerate() {
        par.insert(format!("plant_{i}"), *value);
    }
    for (i, value) in scene.plant.output_gain.iter().enumerate() {
        par.insert(format!("output_gain_{}", i + 1), *value);
    }
    for (i, scale) in scene.scales.iter().enumerate() {
        par.insert(format!("position_scale_{i}"), scale.position);
        par.insert(format!("velocity_scale_{i}"), scale.velocity);
    }
    par.insert("force_scale".into(), scene.plant.force_scale());
    for placed in concealed.iter().chain(&scene.known) {
        let id = placed.placing.effect.id();
        for (i, value) in placed.placing.chances.iter().enumerate() {
            par.insert(format!("{id}.chance_{i}"), *value);
        }
        par.insert(format!("{id}.sign"), placed.placing.sign);
        par.insert(format!("{id}.onset"), placed.placing.onset);
    }
    par
}
