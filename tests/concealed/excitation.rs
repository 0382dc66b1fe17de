//! Inputs and references that make the plant move.

use super::dice::Dice;
use super::numbers::{deviation, mean};

/// The shape of an excitation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Excitation {
    /// Random levels held for random times.
    Steps,
    /// Two levels, switched at random multiples of a bit time.
    Prbs,
    /// Many sines with random phases.
    Multisine,
    /// Sweeps of the frequency, up or down.
    Chirp,
    /// Low-pass filtered white noise.
    Noise,
}

impl Excitation {
    /// Every shape.
    pub const ALL: [Self; 5] = [
        Self::Steps,
        Self::Prbs,
        Self::Multisine,
        Self::Chirp,
        Self::Noise,
    ];

    /// Its name in the truth file.
    pub fn id(self) -> &'static str {
        match self {
            Self::Steps => "steps",
            Self::Prbs => "prbs",
            Self::Multisine => "multisine",
            Self::Chirp => "chirp",
            Self::Noise => "noise",
        }
    }

    /// A sequence of zero mean (but for steps and bits, which keep theirs) and unit deviation, for a plant
    /// with this characteristic frequency in hertz.
    pub fn sequence(self, samples: usize, dt: f64, frequency: f64, dice: &mut Dice) -> Vec<f64> {
        let mut values = match self {
            Self::Steps => steps(samples, dt, frequency, dice),
            Self::Prbs => bits(samples, dt, frequency, dice),
            Self::Multisine => multisine(samples, dt, frequency, dice),
            Self::Chirp => chirp(samples, dt, frequency, dice),
            Self::Noise => noise(samples, dt, frequency, dice),
        };
        let centre = match self {
            Self::Steps | Self::Prbs => 0.0,
            _ => mean(&values),
        };
        let scale = deviation(&values).max(f64::MIN_POSITIVE);
        for value in &mut values {
            *value = (*value - centre) / scale;
        }
        values
    }
}

fn steps(samples: usize, dt: f64, frequency: f64, dice: &mut Dice) -> Vec<f64> {
    let (shortest, longest) = (0.4 / frequency, 2.5 / frequency);
    let mut values = Vec::with_capacity(samples);
    let mut level = 0.0;
    while values.len() < samples {
        let before = level;
        while f64::abs(level - before) < 0.2 {
            level = dice.between(-1.0, 1.0);
        }
        let held = (dice.between(shortest, longest) / dt).ceil() as usize;
        values.extend(std::iter::repeat_n(level, held.max(1)));
    }
    values.truncate(samples);
    values
}

fn bits(samples: usize, dt: f64, frequency: f64, dice: &mut Dice) -> Vec<f64> {
    let bit = (dice.between(0.12, 0.4) / frequency / dt).ceil().max(1.0) as usize;
    (0..samples.div_ceil(bit))
        .flat_map(|_| std::iter::repeat_n(dice.sign(), bit))
        .take(samples)
        .collect()
}

fn multisine(samples: usize, dt: f64, frequency: f64, dice: &mut Dice) -> Vec<f64> {
    let nyquist = 0.5 / dt;
    let low = frequency * dice.between(0.05, 0.3);
    let high = (frequency * dice.between(1.5, 3.0)).min(0.6 * nyquist);
    let count = 20 + dice.below(30);
    let lines: Vec<(f64, f64)> = (0..count)
        .map(|i| {
            let share = (i as f64 + dice.unit()) / count as f64;
            let hertz = low + (high - low) * share;
            (hertz, dice.between(0.0, std::f64::consts::TAU))
        })
        .collect();
    (0..samples)
        .map(|k| {
            let t = k as f64 * dt;
            lines
                .iter()
                .map(|(hertz, phase)| (std::f64::consts::TAU * hertz * t + phase).sin())
                .sum()
        })
        .collect()
}

fn chirp(samples: usize, dt: f64, frequency: f64, dice: &mut Dice) -> Vec<f64> {
    let low = frequency * dice.between(0.05, 0.2);
    let high = (frequency * dice.between(1.5, 3.0)).min(0.3 / dt);
    let sweeps = 1 + dice.below(4);
    let length = samples.div_ceil(sweeps).max(1);
    let down = dice.chance(0.3);
    let mut phase: f64 = 0.0;
    (0..samples)
        .map(|k| {
            let share = (k % length) as f64 / length as f64;
            let share = if down { 1.0 - share } else { share };
            phase += std::f64::consts::TAU * low * (high / low).powf(share) * dt;
            phase.sin()
        })
        .collect()
}

fn noise(samples: usize, dt: f64, frequency: f64, dice: &mut Dice) -> Vec<f64> {
    let corner = std::f64::consts::TAU * frequency * dice.between(0.8, 3.0) * dt;
    let keep = (-corner).exp();
    let mut state = [0.0; 2];
    let settle = (8.0 / corner) as usize;
    (0..samples + settle)
        .map(|_| {
            state[0] = keep * state[0] + (1.0 - keep) * dice.normal();
            state[1] = keep * state[1] + (1.0 - keep) * state[0];
            state[1]
        })
        .skip(settle)
        .collect()
}
