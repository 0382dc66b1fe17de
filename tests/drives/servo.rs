//! A drive in closed loop, integrated at 20 steps a sample, with friction of bristles: shares nothing with the library.

use crate::dice::Dice;
use crate::friction::Bristles;

/// Sample time in seconds, steps a sample, samples.
pub const STEP: f64 = 1e-3;
const FINE: usize = 20;
pub const SAMPLES: usize = 20_000;

/// What a linear model of the drive leaves out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Missing {
    Nothing,
    Coulomb,
    Stribeck,
    Drag,
    Cubic,
    Cogging,
}

impl Missing {
    pub const ALL: [Self; 6] = [
        Self::Nothing,
        Self::Coulomb,
        Self::Stribeck,
        Self::Drag,
        Self::Cubic,
        Self::Cogging,
    ];

    pub fn id(self) -> &'static str {
        match self {
            Self::Nothing => "",
            Self::Coulomb => "coulomb_friction",
            Self::Stribeck => "stribeck_friction",
            Self::Drag => "quadratic_drag",
            Self::Cubic => "cubic_stiffness",
            Self::Cogging => "cogging",
        }
    }
}

/// A drive with its controller.
#[derive(Debug, Clone)]
pub struct Drive {
    pub missing: Missing,
    /// Whether the velocity is what is measured (and controlled).
    pub speed: bool,
    pub mass: f64,
    pub viscous: f64,
    pub load: f64,
    /// Size of the law: friction force, drag, stiffness, cogging force.
    pub size: f64,
    pitch: f64,
    bristles: Option<Bristles>,
    travel: f64,
    quick: f64,
    bandwidth: f64,
    resolution: f64,
}

/// What is recorded.
pub struct Recorded {
    pub input: Vec<f64>,
    pub output: Vec<f64>,
}

impl Drive {
    /// A drive of any size, from a watch to a machine tool; in any unit.
    pub fn draw(missing: Missing, speed: bool, dice: &mut Dice) -> Self {
        let mass = dice.scale_between(1e-2, 2e2);
        let travel = dice.scale_between(0.05, 50.0);
        let time = dice.between(0.5, 1.5);
        let quick = 1.5 * travel / time;
        let push = mass * quick / (0.3 * time);
        let friction = push * dice.between(0.2, 0.6);
        let bend = travel * dice.scale_between(2e-5, 2e-4);
        let bristles = |breakaway: f64, dice: &mut Dice| {
            let stiffness = friction / bend;
            Bristles {
                sliding: friction,
                breakaway: friction * breakaway,
                stribeck_speed: quick * dice.between(0.05, 0.2),
                stiffness,
                damping: (stiffness * mass).sqrt(),
            }
        };
        let (bristles, size) = match missing {
            Missing::Coulomb => (Some(bristles(1.0, dice)), friction),
            Missing::Stribeck => (Some(bristles(dice.between(1.5, 2.2), dice)), friction),
            Missing::Drag => (None, push * dice.between(0.4, 1.0) / (quick * quick)),
            Missing::Cubic => (None, push * dice.between(0.4, 1.0) / travel.powi(3)),
            Missing::Cogging => (None, push * dice.between(0.1, 0.4)),
            Missing::Nothing => (None, 0.0),
        };
        Self {
            missing,
            speed,
            mass,
            viscous: push / quick * dice.between(0.3, 1.0),
            // Of a speed it cannot be told from an offset of the sensor.
            load: if speed {
                0.0
            } else {
                push * dice.between(-0.1, 0.1)
            },
            size,
            pitch: travel * dice.scale_between(0.05, 0.3),
            bristles,
            travel,
            quick,
            bandwidth: std::f64::consts::TAU * dice.between(2.0, 5.0),
            resolution: dice.scale_between(1e-6, 1e-5),
        }
    }

    fn law(&self, x: f64, v: f64, bend: f64) -> f64 {
        match (&self.bristles, self.missing) {
            (Some(bristles), _) => bristles.force(v, bend),
            (None, Missing::Drag) => self.size * v * v.abs(),
            (None, Missing::Cubic) => self.size * x.powi(3),
            (None, Missing::Cogging) => {
                self.size * (std::f64::consts::TAU * x / self.pitch + 1.0).sin()
            }
            _ => 0.0,
        }
    }

    /// Runs the loop over a new sequence of moves.
    pub fn record(&self, dice: &mut Dice) -> Recorded {
        let reference = self.moves(dice);
        let h = STEP / FINE as f64;
        let (mut x, mut v, mut bend) = (0.0, 0.0, 0.0);
        let (mut last, mut slope, mut sum): (Option<f64>, f64, f64) = (None, 0.0, 0.0);
        let (mut input, mut output) = (Vec::new(), Vec::new());
        let w = self.bandwidth;
        for r in &reference {
            let reading = if self.speed {
                v + 1e-3 * self.quick * dice.normal()
            } else {
                let grid = self.resolution * self.travel;
                (x / grid).round() * grid
            };
            let u = if self.speed {
                sum += w * w * self.mass * (r - reading) * STEP * 0.5;
                2.0 * w * self.mass * (r - reading) + sum
            } else {
                // The rate is filtered over 2 ms, as drives do.
                let raw = last.map_or(0.0, |l| (reading - l) / STEP);
                slope += (raw - slope) / 3.0;
                last = Some(reading);
                self.mass * (w * w * (r - reading) - 1.4 * w * slope)
            };
            input.push(u);
            output.push(reading);
            for _ in 0..FINE {
                let pull = |x: f64, v: f64| {
                    (u - self.viscous * v - self.load - self.law(x, v, bend)) / self.mass
                };
                let a = pull(x, v);
                let b = pull(x + h * v, v + h * a);
                let next = v + 0.5 * h * (a + b);
                let middle = 0.5 * (v + next);
                if let Some(bristles) = &self.bristles {
                    bend = bristles.advance(middle, bend, h);
                }
                x += h * middle;
                v = next;
            }
        }
        Recorded { input, output }
    }

    /// Moves from place to place with limited velocity (or a sequence of speeds), standing still between.
    fn moves(&self, dice: &mut Dice) -> Vec<f64> {
        let mut reference = Vec::with_capacity(SAMPLES);
        let mut at = 0.0;
        while reference.len() < SAMPLES {
            let size = if self.speed { self.quick } else { self.travel };
            let to = dice.between(-1.0, 1.0) * size;
            let length = if self.speed {
                (dice.between(0.1, 0.6) / STEP) as usize
            } else {
                let speed = dice.between(0.2, 1.0) * self.quick;
                (1.5 * f64::abs(to - at) / speed / STEP) as usize + 20
            };
            for k in 0..length {
                let s = (k + 1) as f64 / length as f64;
                reference.push(at + (to - at) * s * s * (3.0 - 2.0 * s));
            }
            at = to;
            let rest = (dice.between(0.02, 0.3) / STEP) as usize;
            reference.extend(std::iter::repeat_n(at, rest));
        }
        reference.truncate(SAMPLES);
        reference
    }

    /// A linear model of the drive with parameters that are somewhat wrong, `(A, B)` in position and velocity.
    pub fn nominal(&self, dice: &mut Dice) -> (Vec<f64>, Vec<f64>) {
        let mass = self.mass * dice.between(0.85, 1.2);
        let viscous = self.viscous * dice.between(0.7, 1.4);
        let decay = (-viscous / mass * STEP).exp();
        let way = (1.0 - decay) * mass / viscous;
        if self.speed {
            (vec![decay], vec![(1.0 - decay) / viscous])
        } else {
            (
                vec![1.0, way, 0.0, decay],
                vec![(STEP - way) / viscous, (1.0 - decay) / viscous],
            )
        }
    }
}
