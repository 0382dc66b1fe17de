//! What to draw: kinds of cases, and the ranges of easy and hard ones.

use super::dice::Dice;
use super::effect::{Effect, PAIRS};
use super::noise::Noise;
use super::plant::PlantKind;

/// What a case conceals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// This effect.
    Effect(Effect),
    /// These two.
    Both(Effect, Effect),
    /// One of the pairs.
    Pair,
    /// Nothing.
    Null,
    /// An effect that no library lists.
    Unlisted,
    /// Any listed effect or pair.
    Any,
}

impl Kind {
    /// The effects of a case.
    pub fn effects(self, dice: &mut Dice) -> Vec<Effect> {
        let of = |listed: bool| -> Vec<Effect> {
            let all = Effect::ALL.iter().copied();
            all.filter(|effect| effect.is_listed() == listed).collect()
        };
        match self {
            Self::Effect(effect) => vec![effect],
            Self::Both(first, second) => vec![first, second],
            Self::Pair => dice.pick(&PAIRS).to_vec(),
            Self::Null => Vec::new(),
            Self::Unlisted => vec![dice.pick(&of(false))],
            Self::Any => {
                let listed = of(true);
                let choice = dice.below(listed.len() + PAIRS.len());
                match listed.get(choice) {
                    Some(effect) => vec![*effect],
                    None => PAIRS[choice - listed.len()].to_vec(),
                }
            }
        }
    }
}

/// How to draw a case.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drawing {
    /// Small effects in much, coloured and heavy-tailed noise.
    pub hard: bool,
    /// What it conceals.
    pub kind: Kind,
    /// Samples of the recording; the fresh input has half as many.
    pub samples: usize,
    /// Significant decimal digits of the columns.
    pub digits: usize,
    /// Whether under feedback; drawn if not given. The stage always is.
    pub closed_loop: Option<bool>,
}

impl Default for Drawing {
    fn default() -> Self {
        Self {
            hard: false,
            kind: Kind::Any,
            samples: 4000,
            digits: 9,
            closed_loop: None,
        }
    }
}

impl Drawing {
    /// The size the effects should have in the output, relative to its deviation. A missing input is larger,
    /// and so is what a plant without a spring integrates.
    pub fn effect_ratio(&self, effects: &[Effect], plant: PlantKind, dice: &mut Dice) -> f64 {
        const INTEGRATED: f64 = 5.0;
        let ratio = match (self.hard, effects.first()) {
            (false, Some(Effect::MissingInput)) => dice.scale_between(0.05, 1.0),
            (true, Some(Effect::MissingInput)) => dice.scale_between(0.02, 0.2),
            (false, Some(Effect::Pendulum)) => dice.scale_between(0.15, 0.4),
            (false, _) => dice.scale_between(0.04, 0.4),
            (true, _) => dice.scale_between(0.01, 0.04),
        };
        let integrates = plant == PlantKind::Stage
            && !effects
                .iter()
                .any(|e| e.is_sensor() || matches!(e, Effect::InputDelay | Effect::ActuatorLag));
        if integrates {
            INTEGRATED * ratio
        } else {
            ratio
        }
    }

    /// The measurement noise.
    pub fn noise(&self, dice: &mut Dice) -> Noise {
        let coloured = self.hard || self.kind == Kind::Null;
        let (least, most) = if self.hard {
            (0.01, 0.06)
        } else {
            (0.003, 0.03)
        };
        Noise {
            ratio: dice.scale_between(least, most),
            colour: if coloured {
                dice.pick(&[0.0, 0.0, 0.7, 0.95])
            } else {
                dice.pick(&[0.0, 0.0, 0.0, 0.0, 0.7, 0.95])
            },
            heavy: dice.chance(if coloured { 0.4 } else { 0.15 }),
        }
    }

    /// The relative error of the simulation's parameters.
    pub fn parameter_error(&self, dice: &mut Dice) -> f64 {
        dice.pick(&[0.0, 0.0, 0.01, 0.01, 0.03])
    }
}
