//! From an effect and its strength to laws in the plant: where each acts and how large a unit of strength is.

use super::actuator::Element;
use super::contact::{Cogs, Magnet, Stop, Swing};
use super::dice::Dice;
use super::effect::Effect;
use super::force::Force;
use super::friction::Bristles;
use super::hysteresis::BoucWen;
use super::plant::{Plant, Site};
use super::sensor::Fault;

/// How far and how fast a site moves in the linear plant: the units of strengths.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    /// Standard deviation of the position.
    pub position: f64,
    /// Standard deviation of the velocity.
    pub velocity: f64,
}

/// Everything about an effect except its strength.
#[derive(Debug, Clone, PartialEq)]
pub struct Placing {
    /// Which effect.
    pub effect: Effect,
    /// The site it acts at, an index into the plant's sites.
    pub site: usize,
    /// The input channel it acts on.
    pub channel: usize,
    /// The output channel it acts on.
    pub output: usize,
    /// Plus or minus one.
    pub sign: f64,
    /// When it starts, as a share of the record.
    pub onset: f64,
    /// Uniform numbers that settle the rest.
    pub chances: [f64; 4],
    /// Sine coefficients of a drift's wandering.
    pub wander: [f64; 4],
}

/// When the plant runs: in the recording, or later with the fresh input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Occasion {
    /// The recording of this many samples.
    Recording(usize),
    /// The fresh run: what changed has changed, what passed has passed.
    Fresh,
}

/// The laws in force during a run.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Laws {
    /// Forces, each with its site.
    pub forces: Vec<(usize, Force)>,
    /// Input path elements, each with its channel.
    pub elements: Vec<(usize, Element)>,
    /// Sensor faults, each with its output.
    pub faults: Vec<(usize, Fault)>,
    /// Resonances beside the plant.
    pub parallel: Vec<ParallelMode>,
    /// How late a reading can be, as a share of a sample, and the seed of its lateness.
    pub jitter: (f64, u64),
}

/// A resonance beside the plant, from an input to an output.
#[derive(Debug, Clone, PartialEq)]
pub struct ParallelMode {
    /// The output it adds to.
    pub output: usize,
    /// The input that drives it.
    pub channel: usize,
    /// Its static gain.
    pub gain: f64,
    /// Natural frequency, radians per second.
    pub rate: f64,
    /// Damping ratio.
    pub damping: f64,
}

impl Placing {
    /// Draws where and when an effect acts.
    pub fn draw(effect: Effect, plant: &Plant, dice: &mut Dice) -> Self {
        let sites = plant.sites();
        let springy: Vec<usize> = (0..sites.len())
            .filter(|&i| sites[i].stiffness.is_some())
            .collect();
        let masses = sites.len().min(plant.outputs());
        let site = match effect {
            Effect::StiffnessChange | Effect::Pendulum if !springy.is_empty() => {
                dice.pick(&springy)
            }
            Effect::EndStop
            | Effect::Magnetic
            | Effect::Cogging
            | Effect::ExtraMode
            | Effect::PeriodicDisturbance
            | Effect::LoadStep => dice.below(masses),
            _ => dice.below(sites.len()),
        };
        let first = |dice: &mut Dice, count: usize| {
            if count > 1 && dice.chance(0.3) { 1 } else { 0 }
        };
        let channel = if effect == Effect::MissingInput {
            1
        } else {
            first(dice, plant.inputs())
        };
        Self {
            effect,
            site,
            channel,
            output: first(dice, plant.outputs()),
            sign: dice.sign(),
            onset: dice.between(0.3, 0.75),
            chances: std::array::from_fn(|_| dice.unit()),
            wander: std::array::from_fn(|_| dice.normal()),
        }
    }

    /// The signal it is seen at, for the truth file.
    pub fn signal(&self, plant: &Plant) -> String {
        if self.effect.is_sensor() {
            return format!("y{}", self.output + 1);
        }
        let mut path = Laws::default();
        let unit = Scale {
            position: 1.0,
            velocity: 1.0,
        };
        let scales = vec![unit; plant.sites().len()];
        self.place(1.0, plant, &scales, Occasion::Recording(1), &mut path);
        if path.elements.is_empty() {
            plant
                .sites()
                .get(self.site)
                .map_or("plant", |site| site.name)
                .into()
        } else {
            format!("u{}", self.channel + 1)
        }
    }

    /// The samples between which it acts, for those that act in a part of the record only.
    pub fn window(&self, strength: f64, samples: usize) -> Option<(usize, usize)> {
        let start = (self.onset * samples as f64) as usize;
        match self.effect {
            Effect::SensorFreeze => {
                let length = ((strength * samples as f64) as usize).max(5);
                Some((start, (start + length).min(samples)))
            }
            Effect::LoadStep | Effect::GainChange | Effect::StiffnessChange => {
                Some((start, samples))
            }
            Effect::SensorDrift if self.chances[0] < Self::LATE_DRIFT => Some((start, samples)),
            _ => None,
        }
    }

    const LATE_DRIFT: f64 = 0.2;

    /// Adds the effect to the laws of a run.
    pub fn place(
        &self,
        strength: f64,
        plant: &Plant,
        scales: &[Scale],
        occasion: Occasion,
        laws: &mut Laws,
    ) {
        if occasion == Occasion::Fresh && self.effect.is_of_the_recording() {
            return;
        }
        let dt = plant.kind.sample_time();
        let sites = plant.sites();
        let (Some(site), Some(scale)) = (sites.get(self.site), scales.get(self.site)) else {
            return;
        };
        let from = match occasion {
            Occasion::Recording(samples) => {
                self.window(strength, samples).map_or(0.0, |w| w.0 as f64) * dt
            }
            Occasion::Fresh => 0.0,
        };
        if let Some(force) = self.force(strength, plant, site, *scale, from) {
            laws.forces.push((self.site, force));
        } else if let Some(element) = self.element(strength, plant, from) {
            laws.elements.push((self.channel, element));
        } else if let Some(fault) = self.fault(strength, occasion) {
            laws.faults.push((self.output, fault));
        } else if self.effect == Effect::SampleJitter {
            laws.jitter = (strength, self.chances[0].to_bits());
        } else if self.effect == Effect::ExtraMode {
            laws.parallel.push(ParallelMode {
                output: self.output,
                channel: self.channel,
                gain: strength * self.sign,
                rate: self.mode_rate(plant),
                damping: 0.01 + 0.04 * self.chances[1],
            });
        }
    }

    fn mode_rate(&self, plant: &Plant) -> f64 {
        let factor = 0.6 * (2.5_f64 / 0.6).powf(self.chances[2]);
        let highest = 0.25 / plant.kind.sample_time();
        std::f64::consts::TAU * (plant.frequency() * factor).min(highest)
    }

    fn force(&self, s: f64, plant: &Plant, site: &Site, scale: Scale, from: f64) -> Option<Force> {
        let unit = plant.force_scale();
        let Scale { position, velocity } = scale;
        let [first, second, third, _] = self.chances;
        Some(match self.effect {
            Effect::CoulombFriction | Effect::StribeckFriction => {
                let sliding = s * unit;
                let presliding = position * 0.002 * 5.0_f64.powf(first);
                let stiffness = sliding / presliding;
                let extra = if self.effect == Effect::StribeckFriction {
                    0.4 + 0.6 * second
                } else {
                    0.0
                };
                Force::Friction(Bristles {
                    sliding,
                    breakaway: sliding * (1.0 + extra),
                    stribeck_speed: velocity * 0.05 * 4.0_f64.powf(third),
                    stiffness,
                    damping: 0.6 * (stiffness * site.mass).sqrt(),
                })
            }
            Effect::Hysteresis => Force::Hysteresis(BoucWen {
                force: s * unit,
                yield_distance: position * (0.15 + 0.6 * first),
            }),
            Effect::QuadraticDrag => Force::Drag(s * unit / velocity.powi(2)),
            Effect::CubicStiffness => Force::Cubic(s * unit / position.powi(3)),
            Effect::QuadraticStiffness => Force::Quadratic {
                coefficient: s * unit / position.powi(2),
                odd: first < 0.5,
            },
            Effect::EndStop => {
                let stiffness = (unit / position) * 20.0 * 5.0_f64.powf(first);
                let gap = s * position;
                let (upper, lower) = match second {
                    x if x < 0.3 => (gap, f64::INFINITY),
                    x if x < 0.5 => (f64::INFINITY, gap),
                    _ => (gap, gap * (0.85 + 0.3 * third)),
                };
                Force::Stop(Stop {
                    upper,
                    lower,
                    stiffness,
                    damping: 0.3 * (stiffness * site.mass).sqrt(),
                })
            }
            Effect::PeriodicDisturbance => Force::Periodic {
                amplitude: s * unit,
                frequency: plant.frequency() * 0.35 * 5.0_f64.powf(first),
                phase: std::f64::consts::TAU * second,
                second: if third < 0.3 { 0.25 } else { 0.0 },
            },
            Effect::LoadStep => Force::Load {
                force: self.sign * s * unit,
                from,
            },
            Effect::StiffnessChange => Force::Stiffening {
                stiffness: self.sign * s * site.stiffness?,
                from,
            },
            Effect::ExtraMode if first < 0.7 => Force::Attached {
                mass: s * site.mass,
                rate: self.mode_rate(plant),
                damping: 0.01 + 0.04 * second,
            },
            Effect::Cogging => Force::Cogs(Cogs {
                force: s * unit,
                pitch: position * (0.7 + 1.5 * first),
                phase: std::f64::consts::TAU * second,
            }),
            Effect::Pendulum => Force::Swing(Swing {
                stiffness: site.stiffness?,
                angle: s / position,
            }),
            Effect::Magnetic => Force::Magnet(Magnet {
                force: s * unit,
                gap: 3.0 + 1.5 * first,
                scale: position,
            }),
            _ => return None,
        })
    }

    fn element(&self, s: f64, plant: &Plant, from: f64) -> Option<Element> {
        let dt = plant.kind.sample_time();
        let [first, second, third, _] = self.chances;
        Some(match self.effect {
            Effect::InputSaturation => {
                let (upper, lower) = one_sided(s, first);
                Element::Saturation {
                    upper,
                    lower,
                    sharpness: 10.0 + 14.0 * second,
                }
            }
            Effect::InputDeadZone => Element::DeadZone {
                upper: s,
                lower: s * (0.9 + 0.2 * second),
                radius: s * (0.02 + 0.06 * third),
            },
            Effect::InputBacklash => Element::Play(s),
            Effect::InputRateLimit => Element::RateLimit(s / dt),
            Effect::InputAsymmetry => {
                if first < 0.5 {
                    Element::Asymmetry(1.0 + self.sign * s, 1.0 - self.sign * s)
                } else if self.sign > 0.0 {
                    Element::Asymmetry(1.0 - s, 1.0)
                } else {
                    Element::Asymmetry(1.0, 1.0 - s)
                }
            }
            Effect::InputDelay => Element::Delay(s * dt),
            Effect::ActuatorLag => Element::Lag(s * dt),
            Effect::GainChange => Element::GainChange {
                factor: 1.0 + self.sign * s,
                from,
            },
            Effect::ThermalDerating => Element::Derating {
                sensitivity: s,
                time_constant: (150.0 + 800.0 * first) * dt,
            },
            Effect::MissingInput => Element::Factor(s),
            _ => return None,
        })
    }

    fn fault(&self, s: f64, occasion: Occasion) -> Option<Fault> {
        let first = self.chances[0];
        Some(match self.effect {
            Effect::SensorSaturation => {
                let (upper, lower) = one_sided(s, first);
                Fault::Limited { upper, lower }
            }
            Effect::SensorQuantization => Fault::Quantised(s),
            Effect::SensorOffset => Fault::Offset(self.sign * s),
            Effect::SensorRectification => Fault::Rectified,
            Effect::SensorHysteresis => Fault::Plays(s),
            Effect::SensorDrift => {
                let Occasion::Recording(samples) = occasion else {
                    return None;
                };
                Fault::Drift(self.drift(s * self.sign, samples))
            }
            Effect::SensorFreeze => {
                let Occasion::Recording(samples) = occasion else {
                    return None;
                };
                let (from, to) = self.window(s, samples)?;
                Fault::Frozen(from, to)
            }
            _ => return None,
        })
    }

    /// A ramp that bends (as in the shared cases), one that starts late, or a smooth wandering.
    fn drift(&self, size: f64, samples: usize) -> Vec<f64> {
        const WANDERING: f64 = 0.5;
        let bend = 0.25 * (2.0 * self.chances[1] - 0.5);
        let half_turn = std::f64::consts::PI;
        (0..samples)
            .map(|k| {
                let share = k as f64 / samples as f64;
                if self.chances[0] < Self::LATE_DRIFT {
                    size * ((share - self.onset) / (1.0 - self.onset)).max(0.0)
                } else if self.chances[0] < WANDERING {
                    let walk = |(i, c): (usize, &f64)| {
                        let order = i as f64 + 0.5;
                        c / order * (half_turn * order * share).sin()
                    };
                    size * self.wander.iter().enumerate().map(walk).sum::<f64>()
                } else {
                    size * (share + bend * (half_turn * share).sin())
                }
            })
            .collect()
    }
}

/// Limits on both sides, or on one for a third of the draws.
fn one_sided(level: f64, chance: f64) -> (f64, f64) {
    match chance {
        x if x < 0.15 => (level, f64::INFINITY),
        x if x < 0.3 => (f64::INFINITY, level),
        _ => (level, level),
    }
}
