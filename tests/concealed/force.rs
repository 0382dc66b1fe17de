//! Everything that acts as a force at a site, behind one face.

use super::contact::{Cogs, Magnet, Stop, Swing};
use super::friction::Bristles;
use super::hysteresis::BoucWen;

/// What a force remembers: bristle bend, Bouc-Wen memory, or position and velocity of an attached mass.
pub type Memory = [f64; 2];

/// A force law. Forces resist: positive ones push towards negative positions.
#[derive(Debug, Clone, PartialEq)]
pub enum Force {
    /// LuGre friction.
    Friction(Bristles),
    /// Bouc-Wen hysteresis.
    Hysteresis(BoucWen),
    /// `c v |v|`.
    Drag(f64),
    /// `k x^3`.
    Cubic(f64),
    /// `k x |x|` if odd, `k x^2` if not.
    Quadratic {
        /// `k`.
        coefficient: f64,
        /// Whether the sign of `x` counts.
        odd: bool,
    },
    /// End stops.
    Stop(Stop),
    /// A magnet.
    Magnet(Magnet),
    /// Cogs.
    Cogs(Cogs),
    /// A pendulum instead of a spring.
    Swing(Swing),
    /// A force periodic in time, with a second harmonic.
    Periodic {
        /// Amplitude of the fundamental.
        amplitude: f64,
        /// Frequency in hertz.
        frequency: f64,
        /// Phase of the fundamental.
        phase: f64,
        /// Amplitude of the second harmonic over that of the fundamental.
        second: f64,
    },
    /// A constant force from a time on.
    Load {
        /// The force.
        force: f64,
        /// When it starts, seconds.
        from: f64,
    },
    /// A change of stiffness from a time on.
    Stiffening {
        /// The additional stiffness.
        stiffness: f64,
        /// When it starts, seconds.
        from: f64,
    },
    /// A mass that hangs on a spring and a damper.
    Attached {
        /// Its mass.
        mass: f64,
        /// Its natural frequency, radians per second.
        rate: f64,
        /// Its damping ratio.
        damping: f64,
    },
}

impl Force {
    /// The force that resists the motion.
    pub fn resist(&self, position: f64, velocity: f64, memory: &Memory, time: f64) -> f64 {
        match self {
            Self::Friction(law) => law.force(velocity, memory[0]),
            Self::Hysteresis(law) => law.force * memory[0],
            Self::Drag(c) => c * velocity * velocity.abs(),
            Self::Cubic(k) => k * position.powi(3),
            Self::Quadratic { coefficient, odd } => {
                coefficient * position * if *odd { position.abs() } else { position }
            }
            Self::Stop(law) => law.force(position, velocity),
            Self::Magnet(law) => law.force(position),
            Self::Cogs(law) => law.force(position),
            Self::Swing(law) => law.force(position),
            Self::Periodic {
                amplitude,
                frequency,
                phase,
                second,
            } => {
                let angle = std::f64::consts::TAU * frequency * time + phase;
                amplitude * (angle.sin() + second * (2.0 * angle).sin())
            }
            Self::Load { force, from } => {
                if time >= *from {
                    *force
                } else {
                    0.0
                }
            }
            Self::Stiffening { stiffness, from } => {
                if time >= *from {
                    stiffness * position
                } else {
                    0.0
                }
            }
            Self::Attached {
                mass,
                rate,
                damping,
            } => {
                -mass
                    * (rate * rate * (memory[0] - position)
                        + 2.0 * damping * rate * (memory[1] - velocity))
            }
        }
    }

    /// The memory after `step`, for the mean position and velocity over it.
    pub fn advance(&self, position: f64, velocity: f64, memory: &mut Memory, step: f64) {
        match self {
            Self::Friction(law) => memory[0] = law.advance(velocity, memory[0], step),
            Self::Hysteresis(law) => memory[0] = law.advance(velocity, memory[0], step),
            Self::Attached { rate, damping, .. } => {
                let pull = |q: f64, speed: f64| {
                    -rate * rate * (q - position) - 2.0 * damping * rate * (speed - velocity)
                };
                let [q, speed] = *memory;
                let middle = [q + 0.5 * step * speed, speed + 0.5 * step * pull(q, speed)];
                *memory = [
                    q + step * middle[1],
                    speed + step * pull(middle[0], middle[1]),
                ];
            }
            _ => {}
        }
    }
}
