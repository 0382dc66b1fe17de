//! A plant made ready: excited, scaled, and measurable with and without effects.

use super::controller::Controller;
use super::dice::Dice;
use super::effect::Effect;
use super::excitation::Excitation;
use super::numbers::{deviation, distance, round_to};
use super::plant::Plant;
use super::simulate::{Drive, Resolution, Run, run};
use super::wiring::{Laws, Occasion, Placing, Scale};

/// An effect in its place with its strength.
#[derive(Debug, Clone, PartialEq)]
pub struct Placed {
    /// Where and what.
    pub placing: Placing,
    /// How strong.
    pub strength: f64,
}

/// A plant with its drive.
#[derive(Debug, Clone)]
pub struct Scene {
    /// The plant, its outputs scaled to unit deviation.
    pub plant: Plant,
    /// The feedback, empty in open loop.
    pub controllers: Vec<Controller>,
    /// The inputs, or the references under feedback.
    pub columns: Vec<Vec<f64>>,
    /// Motion of each site in the linear plant.
    pub scales: Vec<Scale>,
    /// Effects the simulation knows.
    pub known: Vec<Placed>,
    /// Measurement noise, a column an output.
    pub noise: Vec<Vec<f64>>,
    /// Whether the second input acts in reality only.
    pub missing_input: bool,
    /// Significant digits of recorded numbers.
    pub digits: usize,
}

impl Scene {
    /// Excites a plant and scales its outputs; none if no stable loop was found.
    pub fn prepare(
        mut plant: Plant,
        closed_loop: bool,
        missing_input: bool,
        mut columns: Vec<Vec<f64>>,
        digits: usize,
        dice: &mut Dice,
    ) -> Option<Self> {
        let mut controllers = if closed_loop {
            Controller::draw(&plant, dice)
        } else {
            Vec::new()
        };
        plant.output_gain.fill(1.0);
        let mut scene = Self {
            plant,
            controllers: Vec::new(),
            columns: columns.clone(),
            scales: Vec::new(),
            known: Vec::new(),
            noise: Vec::new(),
            missing_input,
            digits,
        };
        if closed_loop {
            const HALVINGS: usize = 4;
            let mut halvings = 0;
            let first = loop {
                scene.controllers.clone_from(&controllers);
                let trial = scene.linear_run();
                if trial.is_sane() && settles(&trial) {
                    break trial;
                }
                if halvings == HALVINGS {
                    return None;
                }
                halvings += 1;
                for law in &mut controllers {
                    *law = law.halved();
                }
            };
            for (column, command) in columns.iter_mut().zip(&first.inputs) {
                let factor = 1.0 / deviation(command);
                column.iter_mut().for_each(|v| *v *= factor);
            }
            scene.columns = columns;
        } else {
            for column in &mut scene.columns {
                for value in column {
                    *value = round_to(*value, digits);
                }
            }
        }
        let unscaled = scene.linear_run();
        let gains: Vec<f64> = unscaled.clean.iter().map(|y| 1.0 / deviation(y)).collect();
        if gains.iter().any(|gain| !gain.is_finite()) {
            return None;
        }
        for ((law, column), gain) in scene
            .controllers
            .iter_mut()
            .zip(&mut scene.columns)
            .zip(&gains)
        {
            *law = law.for_readings_scaled_by(*gain);
            column.iter_mut().for_each(|v| *v *= gain);
        }
        scene.plant.output_gain = gains;
        let scaled = scene.linear_run();
        let rate = std::f64::consts::TAU * scene.plant.frequency();
        let sites = scene.plant.sites();
        scene.scales = sites
            .iter()
            .enumerate()
            .map(|(i, site)| {
                let velocity = deviation(&scaled.velocities[i]);
                let position = if site.position.is_some() {
                    deviation(&scaled.positions[i])
                } else {
                    velocity / rate
                };
                Scale { position, velocity }
            })
            .collect();
        scaled.is_sane().then_some(scene)
    }

    /// The drive of the recording.
    pub fn drive(&self) -> Drive<'_> {
        if self.controllers.is_empty() {
            Drive::Open(&self.columns)
        } else {
            Drive::Loop {
                controllers: &self.controllers,
                references: &self.columns,
                digits: self.digits,
            }
        }
    }

    /// The laws of what the simulation knows and of these effects.
    pub fn laws(&self, effects: &[Placed], occasion: Occasion) -> Laws {
        let mut laws = Laws::default();
        for placed in self.known.iter().chain(effects) {
            placed.placing.place(
                placed.strength,
                &self.plant,
                &self.scales,
                occasion,
                &mut laws,
            );
        }
        let acts = |placed: &Placed| placed.placing.effect == Effect::MissingInput;
        if self.missing_input && !effects.iter().any(acts) {
            laws.elements
                .push((1, super::actuator::Element::Factor(0.0)));
        }
        laws
    }

    fn linear_run(&self) -> Run {
        run(
            &self.plant,
            &self.laws(&[], Occasion::Fresh),
            &self.drive(),
            &[],
            Resolution::EXACT,
        )
    }

    /// The recording with these effects.
    pub fn record(&self, effects: &[Placed], resolution: Resolution) -> Run {
        let occasion = Occasion::Recording(self.samples());
        let laws = self.laws(effects, occasion);
        run(&self.plant, &laws, &self.drive(), &self.noise, resolution)
    }

    /// Number of samples of the recording.
    pub fn samples(&self) -> usize {
        self.columns.first().map_or(0, Vec::len)
    }

    /// How much these effects change the output that shows them most, relative to its deviation, for the same
    /// command: under feedback too, where the simulation sees the recorded command.
    pub fn effect_ratio(&self, effects: &[Placed], without: &Run, resolution: Resolution) -> f64 {
        let with = self.record(effects, resolution);
        if !with.is_tame() {
            return f64::INFINITY;
        }
        let replay;
        let reference = if !self.controllers.is_empty() {
            let laws = self.laws(&[], Occasion::Recording(self.samples()));
            let drive = Drive::Open(&with.inputs);
            replay = run(&self.plant, &laws, &drive, &[], resolution);
            &replay
        } else {
            without
        };
        with.clean
            .iter()
            .zip(&reference.clean)
            .map(|(a, b)| distance(a, b) / deviation(a).max(f64::MIN_POSITIVE))
            .fold(0.0, f64::max)
    }

    /// The strength at which an effect alone reaches the ratio, or the end of its range nearest to it.
    pub fn strength_for(&self, placing: &Placing, ratio: f64) -> f64 {
        const HALVINGS: usize = 13;
        const TOLERANCE: f64 = 0.02;
        let (weakest, strongest) = placing.effect.strengths();
        if weakest == strongest {
            return strongest;
        }
        let without = self.record(&[], Resolution::SEARCH);
        let at = |share: f64| weakest * (strongest / weakest).powf(share);
        let reached = |share: f64| {
            let placed = Placed {
                placing: placing.clone(),
                strength: at(share),
            };
            self.effect_ratio(&[placed], &without, Resolution::SEARCH)
        };
        if reached(1.0) < ratio {
            return strongest;
        }
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            let found = reached(middle);
            if (found / ratio - 1.0).abs() < TOLERANCE {
                return at(middle);
            }
            if found < ratio {
                low = middle;
            } else {
                high = middle;
            }
        }
        at(low)
    }

    /// A fresh excitation for every input.
    pub fn fresh_columns(
        &self,
        kind: Excitation,
        samples: usize,
        dice: &mut Dice,
    ) -> Vec<Vec<f64>> {
        let dt = self.plant.kind.sample_time();
        (0..self.plant.inputs())
            .map(|_| {
                kind.sequence(samples, dt, self.plant.frequency(), dice)
                    .into_iter()
                    .map(|v| round_to(v, self.digits))
                    .collect()
            })
            .collect()
    }
}

/// Whether the second half of a run is no larger than the first.
fn settles(trial: &Run) -> bool {
    const GROWTH: f64 = 2.5;
    trial.clean.iter().all(|y| {
        let (first, second) = y.split_at(y.len() / 2);
        deviation(second) < GROWTH * deviation(first)
    })
}
