//! Digital feedback: proportional with filtered derivative or with integral, one loop an output.

use super::dice::Dice;
use super::plant::{Plant, PlantKind};

/// `u = kp (r - y) + ki sum (r - y) dt - kd y'`.
#[derive(Debug, Clone, PartialEq)]
pub struct Controller {
    /// Proportional gain.
    pub proportional: f64,
    /// Integral gain.
    pub integral: f64,
    /// Derivative gain, on the reading only.
    pub derivative: f64,
    /// Time constant of the derivative's filter, seconds.
    pub filter: f64,
    sum: f64,
    slope: f64,
    last: Option<f64>,
}

impl Controller {
    /// A controller at rest.
    pub fn new(proportional: f64, integral: f64, derivative: f64) -> Self {
        Self {
            proportional,
            integral,
            derivative,
            filter: 0.02,
            sum: 0.0,
            slope: 0.0,
            last: None,
        }
    }

    /// A sensible loop from output `i` of the unscaled plant to its input `i`, for each such pair.
    pub fn draw(plant: &Plant, dice: &mut Dice) -> Vec<Self> {
        let p = &plant.parameters;
        let mut stiffen = |mass: f64, stiffness: f64, gain: f64| {
            let push = dice.between(0.2, 0.9) * stiffness / gain;
            let brake = dice.between(0.1, 0.4) * (stiffness * mass).sqrt() / gain;
            Self::new(push, 0.0, brake)
        };
        match plant.kind {
            PlantKind::MsdPosition => vec![stiffen(p[0], p[2], p[3])],
            PlantKind::ActuatedMass => {
                let mut tame = stiffen(p[0], p[2], p[3]);
                tame.proportional *= 0.5;
                vec![tame]
            }
            PlantKind::TwoMass => vec![stiffen(p[0], p[2], p[6])],
            PlantKind::Mimo => vec![stiffen(p[0], p[2], p[8]), stiffen(p[3], p[5], p[9])],
            PlantKind::MsdVelocity => {
                let proportional = dice.between(0.3, 1.5) * (p[2] * p[0]).sqrt() / p[3];
                vec![Self::new(proportional, 0.0, 0.0)]
            }
            PlantKind::Motor => {
                let drag = p[1] + p[4] * p[4] / p[2];
                let proportional = dice.between(0.5, 2.0) * drag * p[2] / (p[4] * p[5]);
                let integral = proportional * drag / p[0] * dice.between(0.3, 1.0);
                vec![Self::new(proportional, integral, 0.0)]
            }
            PlantKind::Thermal => {
                let proportional = dice.between(0.5, 2.0) * p[3] / p[4];
                let integral = proportional * p[3] / p[1] * dice.between(0.2, 0.8);
                vec![Self::new(proportional, integral, 0.0)]
            }
            PlantKind::Stage => {
                let rate = std::f64::consts::TAU * dice.between(0.5, 1.5);
                let proportional = p[0] * rate * rate / p[2];
                let derivative = (1.6 * p[0] * rate - p[1]).max(0.0) / p[2];
                vec![Self::new(proportional, 0.0, derivative)]
            }
        }
    }

    /// The same loop for readings that are `gain` times larger.
    pub fn for_readings_scaled_by(&self, gain: f64) -> Self {
        Self {
            filter: self.filter,
            ..Self::new(
                self.proportional / gain,
                self.integral / gain,
                self.derivative / gain,
            )
        }
    }

    /// The same loop with all gains halved.
    pub fn halved(&self) -> Self {
        self.for_readings_scaled_by(2.0)
    }

    /// The command for a reference and a reading.
    pub fn command(&mut self, reference: f64, reading: f64, dt: f64) -> f64 {
        let error = reference - reading;
        let rise = (reading - self.last.unwrap_or(reading)) / dt;
        self.last = Some(reading);
        self.slope += (rise - self.slope) * dt / (self.filter + dt);
        self.sum += error * dt;
        self.proportional * error + self.integral * self.sum - self.derivative * self.slope
    }
}
