//! The plants: physical parameters, linear equations, and the places where extra physics can act.

use super::dice::Dice;
use super::linear::{Continuous, Matrix};

/// What a plant is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlantKind {
    /// Mass, spring and damper; the sensor reads position.
    MsdPosition,
    /// Mass, spring and damper; the sensor reads velocity.
    MsdVelocity,
    /// DC motor from voltage to speed.
    Motor,
    /// Two masses in a row, force on the first, positions of both.
    TwoMass,
    /// Heater and heated body; dt is 0.1 s.
    Thermal,
    /// Two coupled masses with a force on each, positions of both.
    Mimo,
    /// A stage with viscous friction and no spring: it integrates.
    Stage,
    /// A first-order actuator that drives a mass with spring and damper.
    ActuatedMass,
}

impl PlantKind {
    /// Every plant.
    pub const ALL: [Self; 8] = [
        Self::MsdPosition,
        Self::MsdVelocity,
        Self::Motor,
        Self::TwoMass,
        Self::Thermal,
        Self::Mimo,
        Self::Stage,
        Self::ActuatedMass,
    ];

    /// Its name in the truth file.
    pub fn id(self) -> &'static str {
        match self {
            Self::MsdPosition => "msd_pos",
            Self::MsdVelocity => "msd_vel",
            Self::Motor => "motor",
            Self::TwoMass => "two_mass",
            Self::Thermal => "thermal",
            Self::Mimo => "mimo",
            Self::Stage => "stage",
            Self::ActuatedMass => "actuated_mass",
        }
    }

    /// Sample time in seconds.
    pub fn sample_time(self) -> f64 {
        if self == Self::Thermal { 0.1 } else { 0.01 }
    }

    fn is_msd(self) -> bool {
        matches!(
            self,
            Self::MsdPosition | Self::MsdVelocity | Self::ActuatedMass
        )
    }

    /// Whether something moves in it.
    pub fn moves(self) -> bool {
        self != Self::Thermal
    }

    /// Whether it has a position that a spring or a stop can act on.
    pub fn has_position(self) -> bool {
        self.moves() && self != Self::Motor
    }

    /// Whether it has a spring to ground or between masses.
    pub fn has_spring(self) -> bool {
        self.is_msd() || matches!(self, Self::TwoMass | Self::Mimo)
    }
}

/// A difference of states: `x[plus] - x[minus]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Coordinate {
    /// The state counted positively.
    pub plus: usize,
    /// The state counted negatively, if any.
    pub minus: Option<usize>,
}

impl Coordinate {
    fn of(plus: usize) -> Self {
        Self { plus, minus: None }
    }

    fn between(plus: usize, minus: usize) -> Self {
        Self {
            plus,
            minus: Some(minus),
        }
    }

    /// Its value.
    pub fn value(self, state: &[f64]) -> f64 {
        state[self.plus] - self.minus.map_or(0.0, |i| state[i])
    }
}

/// A place where a resisting force can act.
#[derive(Debug, Clone, PartialEq)]
pub struct Site {
    /// In words.
    pub name: &'static str,
    /// The position state, or none: then the simulator integrates the velocity.
    pub position: Option<Coordinate>,
    /// The velocity state.
    pub velocity: Coordinate,
    /// How a unit force that resists the motion enters the state equation.
    pub push: Vec<f64>,
    /// The inertia that feels the force.
    pub mass: f64,
    /// The linear stiffness between the two ends, if there is a spring.
    pub stiffness: Option<f64>,
}

/// A plant with its parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Plant {
    /// What it is.
    pub kind: PlantKind,
    /// Its physical parameters; `linear` says which is which.
    pub parameters: Vec<f64>,
    /// Output scales.
    pub output_gain: Vec<f64>,
}

impl Plant {
    /// Draws the parameters within a decade of sensible values; output scales are 1.
    pub fn draw(kind: PlantKind, dice: &mut Dice) -> Self {
        let rate = |hertz: f64| std::f64::consts::TAU * hertz;
        let mut spring_mass = |low: f64, high: f64, loosest: f64| {
            let mass = dice.scale_between(0.3, 3.0);
            let frequency = rate(dice.scale_between(low, high));
            let damping = dice.scale_between(loosest, 0.6);
            let stiffness = mass * frequency * frequency;
            [mass, 2.0 * damping * mass * frequency, stiffness]
        };
        let parameters = match kind {
            PlantKind::MsdPosition | PlantKind::MsdVelocity => {
                let [m, c, k] = spring_mass(1.0, 8.0, 0.03);
                vec![m, c, k, dice.scale_between(0.3, 3.0)]
            }
            PlantKind::ActuatedMass => {
                let [m, c, k] = spring_mass(1.0, 6.0, 0.05);
                let gain = dice.scale_between(0.3, 3.0);
                vec![m, c, k, gain, dice.scale_between(0.01, 0.06)]
            }
            PlantKind::TwoMass => {
                let [m1, c1, k1] = spring_mass(1.0, 4.0, 0.05);
                let [m2, c2, k2] = spring_mass(2.5, 7.0, 0.03);
                let gain = dice.scale_between(0.3, 3.0);
                vec![m1, c1, k1, m2, 0.5 * c2, k2, gain]
            }
            PlantKind::Mimo => {
                let [m1, c1, k1] = spring_mass(1.5, 6.0, 0.04);
                let [m2, c2, k2] = spring_mass(1.5, 6.0, 0.04);
                let coupling = dice.scale_between(0.15, 0.8);
                let (c12, k12) = (0.1 * coupling * (c1 + c2), 0.5 * coupling * (k1 + k2));
                let first = dice.scale_between(0.3, 3.0);
                let second = first * k2 / k1 * dice.scale_between(0.5, 2.0);
                vec![m1, c1, k1, m2, c2, k2, c12, k12, first, second]
            }
            PlantKind::Motor => {
                let resistance = dice.scale_between(0.5, 3.0);
                let inductance = resistance * dice.scale_between(0.008, 0.05);
                let constant = dice.scale_between(0.1, 1.0);
                let back = constant * constant / resistance;
                let viscous = back * dice.scale_between(0.05, 0.5);
                let inertia = (viscous + back) * dice.scale_between(0.08, 0.6);
                let gain = dice.scale_between(0.5, 5.0);
                vec![inertia, viscous, resistance, inductance, constant, gain]
            }
            PlantKind::Thermal => {
                let (heater, body) = (dice.scale_between(0.3, 1.5), dice.scale_between(2.0, 8.0));
                let link = dice.scale_between(0.5, 2.0);
                let gain = dice.scale_between(0.5, 5.0);
                vec![heater * link, body * link, link, 0.4 * link, gain]
            }
            PlantKind::Stage => {
                let mass = dice.scale_between(0.3, 3.0);
                let settling = dice.scale_between(0.15, 1.0);
                vec![mass, mass / settling, dice.scale_between(0.3, 3.0)]
            }
        };
        let outputs = if matches!(kind, PlantKind::TwoMass | PlantKind::Mimo) {
            2
        } else {
            1
        };
        Self {
            kind,
            parameters,
            output_gain: vec![1.0; outputs],
        }
    }

    /// Number of inputs.
    pub fn inputs(&self) -> usize {
        if self.kind == PlantKind::Mimo { 2 } else { 1 }
    }

    /// Number of outputs.
    pub fn outputs(&self) -> usize {
        self.output_gain.len()
    }

    /// Every physical parameter off by the relative error, up or down.
    pub fn misjudged(&self, error: f64, dice: &mut Dice) -> Self {
        let mut other = self.clone();
        for value in &mut other.parameters {
            *value *= 1.0 + error * dice.sign();
        }
        other
    }

    /// The linear equations.
    pub fn linear(&self) -> Continuous {
        let p = &self.parameters;
        let (a, b, c) = match self.kind {
            PlantKind::MsdPosition | PlantKind::MsdVelocity => {
                let read = if self.kind == PlantKind::MsdPosition {
                    [1.0, 0.0]
                } else {
                    [0.0, 1.0]
                };
                (
                    Matrix::from_rows(&[&[0.0, 1.0], &[-p[2] / p[0], -p[1] / p[0]]]),
                    Matrix::from_rows(&[&[0.0], &[p[3] / p[0]]]),
                    Matrix::from_rows(&[&read]),
                )
            }
            PlantKind::ActuatedMass => (
                Matrix::from_rows(&[
                    &[0.0, 1.0, 0.0],
                    &[-p[2] / p[0], -p[1] / p[0], 1.0 / p[0]],
                    &[0.0, 0.0, -1.0 / p[4]],
                ]),
                Matrix::from_rows(&[&[0.0], &[0.0], &[p[3] / p[4]]]),
                Matrix::from_rows(&[&[1.0, 0.0, 0.0]]),
            ),
            PlantKind::TwoMass => (
                two_masses([p[0], p[1], p[2]], [p[3], 0.0, 0.0], [p[4], p[5]]),
                Matrix::from_rows(&[&[0.0], &[p[6] / p[0]], &[0.0], &[0.0]]),
                both_positions(),
            ),
            PlantKind::Mimo => (
                two_masses([p[0], p[1], p[2]], [p[3], p[4], p[5]], [p[6], p[7]]),
                Matrix::from_rows(&[
                    &[0.0, 0.0],
                    &[p[8] / p[0], 0.0],
                    &[0.0, 0.0],
                    &[0.0, p[9] / p[3]],
                ]),
                both_positions(),
            ),
            PlantKind::Motor => (
                Matrix::from_rows(&[&[-p[1] / p[0], p[4] / p[0]], &[-p[4] / p[3], -p[2] / p[3]]]),
                Matrix::from_rows(&[&[0.0], &[p[5] / p[3]]]),
                Matrix::from_rows(&[&[1.0, 0.0]]),
            ),
            PlantKind::Thermal => (
                Matrix::from_rows(&[
                    &[-p[2] / p[0], p[2] / p[0]],
                    &[p[2] / p[1], -(p[2] + p[3]) / p[1]],
                ]),
                Matrix::from_rows(&[&[p[4] / p[0]], &[0.0]]),
                Matrix::from_rows(&[&[0.0, 1.0]]),
            ),
            PlantKind::Stage => (
                Matrix::from_rows(&[&[0.0, 1.0], &[0.0, -p[1] / p[0]]]),
                Matrix::from_rows(&[&[0.0], &[p[2] / p[0]]]),
                Matrix::from_rows(&[&[1.0, 0.0]]),
            ),
        };
        let mut c = c;
        for (i, gain) in self.output_gain.iter().enumerate() {
            for j in 0..c.columns {
                c.set(i, j, c.at(i, j) * gain);
            }
        }
        Continuous { a, b, c }
    }

    /// Where forces can act, or heat for the thermal plant.
    pub fn sites(&self) -> Vec<Site> {
        let p = &self.parameters;
        let mass = |name, at: usize, states: usize, mass: f64, stiffness| {
            let mut push = vec![0.0; states];
            push[at + 1] = -1.0 / mass;
            Site {
                name,
                position: Some(Coordinate::of(at)),
                velocity: Coordinate::of(at + 1),
                push,
                mass,
                stiffness,
            }
        };
        match self.kind {
            PlantKind::MsdPosition | PlantKind::MsdVelocity => {
                vec![mass("mass", 0, 2, p[0], Some(p[2]))]
            }
            PlantKind::ActuatedMass => vec![mass("mass", 0, 3, p[0], Some(p[2]))],
            PlantKind::Stage => vec![mass("mass", 0, 2, p[0], None)],
            PlantKind::TwoMass | PlantKind::Mimo => {
                let two = self.kind == PlantKind::Mimo;
                vec![
                    mass("mass 1", 0, 4, p[0], Some(p[2])),
                    mass("mass 2", 2, 4, p[3], two.then_some(p[5])),
                    Site {
                        name: "coupling",
                        position: Some(Coordinate::between(2, 0)),
                        velocity: Coordinate::between(3, 1),
                        push: vec![0.0, 1.0 / p[0], 0.0, -1.0 / p[3]],
                        mass: p[0] * p[3] / (p[0] + p[3]),
                        stiffness: Some(if two { p[7] } else { p[5] }),
                    },
                ]
            }
            PlantKind::Motor => vec![Site {
                name: "shaft",
                position: None,
                velocity: Coordinate::of(0),
                push: vec![-1.0 / p[0], 0.0],
                mass: p[0],
                stiffness: None,
            }],
            PlantKind::Thermal => vec![Site {
                name: "body",
                position: None,
                velocity: Coordinate::of(1),
                push: vec![0.0, -1.0 / p[1]],
                mass: p[1],
                stiffness: None,
            }],
        }
    }

    /// The force (torque, heat flow) of a unit input held for long.
    pub fn force_scale(&self) -> f64 {
        let p = &self.parameters;
        match self.kind {
            PlantKind::MsdPosition | PlantKind::MsdVelocity | PlantKind::ActuatedMass => p[3],
            PlantKind::TwoMass => p[6],
            PlantKind::Mimo => p[8],
            PlantKind::Motor => p[4] * p[5] / p[2],
            PlantKind::Thermal => p[4],
            PlantKind::Stage => p[2],
        }
    }

    /// The frequency, in hertz, about which the plant is worth exciting.
    pub fn frequency(&self) -> f64 {
        let p = &self.parameters;
        let rate = match self.kind {
            PlantKind::MsdPosition | PlantKind::MsdVelocity | PlantKind::ActuatedMass => {
                (p[2] / p[0]).sqrt()
            }
            PlantKind::TwoMass => (p[2] / p[0]).sqrt(),
            PlantKind::Mimo => ((p[2] / p[0]) * (p[5] / p[3])).powf(0.25),
            PlantKind::Motor => (p[1] + p[4] * p[4] / p[2]) / p[0],
            PlantKind::Thermal => (p[2] + p[3]) / p[1],
            PlantKind::Stage => 2.0 * p[1] / p[0],
        };
        rate / std::f64::consts::TAU
    }
}

fn two_masses(first: [f64; 3], second: [f64; 3], link: [f64; 2]) -> Matrix {
    let ([m1, c1, k1], [m2, c2, k2], [c, k]) = (first, second, link);
    Matrix::from_rows(&[
        &[0.0, 1.0, 0.0, 0.0],
        &[-(k1 + k) / m1, -(c1 + c) / m1, k / m1, c / m1],
        &[0.0, 0.0, 0.0, 1.0],
        &[k / m2, c / m2, -(k2 + k) / m2, -(c2 + c) / m2],
    ])
}

fn both_positions() -> Matrix {
    Matrix::from_rows(&[&[1.0, 0.0, 0.0, 0.0], &[0.0, 0.0, 1.0, 0.0]])
}
