//! What happens between the command and the plant: the input path.

/// One element of an input path.
#[derive(Debug, Clone, PartialEq)]
pub enum Element {
    /// Soft-knee saturation; a side without limit is infinite.
    Saturation {
        /// Upper level.
        upper: f64,
        /// Lower level, counted positively.
        lower: f64,
        /// Sharpness of the knee.
        sharpness: f64,
    },
    /// Dead zone with rounded edges.
    DeadZone {
        /// Upper edge.
        upper: f64,
        /// Lower edge, counted positively.
        lower: f64,
        /// Radius of the edges.
        radius: f64,
    },
    /// Play of this half width.
    Play(f64),
    /// Largest slope, per second.
    RateLimit(f64),
    /// Gain for positive and for negative commands.
    Asymmetry(f64, f64),
    /// Delay in seconds.
    Delay(f64),
    /// Time constant in seconds.
    Lag(f64),
    /// Gain before and after a time.
    GainChange {
        /// Factor after the change.
        factor: f64,
        /// When, seconds.
        from: f64,
    },
    /// Gain `exp(-sensitivity * heat)`, the heat a lagged square of the command.
    Derating {
        /// How much gain a unit of heat takes.
        sensitivity: f64,
        /// Thermal time constant, seconds.
        time_constant: f64,
    },
    /// Constant factor: what a missing input really does.
    Factor(f64),
}

fn saturate(u: f64, level: f64, sharpness: f64) -> f64 {
    if level.is_finite() {
        u / (1.0 + (u.abs() / level).powf(sharpness)).powf(1.0 / sharpness)
    } else {
        u
    }
}

fn soft_plus(x: f64) -> f64 {
    x.max(0.0) + (-x.abs()).exp().ln_1p()
}

/// The input path of one channel with its memory.
#[derive(Debug, Clone)]
pub struct InputPath {
    elements: Vec<Element>,
    memory: Vec<f64>,
}

impl InputPath {
    /// A path from rest.
    pub fn new(elements: Vec<Element>) -> Self {
        Self {
            memory: vec![0.0; elements.len()],
            elements,
        }
    }

    /// The mean effective input over `[time, time + step]`, given the commands so far, one a sample of `dt`.
    pub fn advance(&mut self, commands: &[f64], time: f64, step: f64, dt: f64) -> f64 {
        let delay = self
            .elements
            .iter()
            .map(|e| if let Element::Delay(d) = e { *d } else { 0.0 })
            .sum::<f64>();
        let mut u = held_mean(commands, time - delay, step, dt);
        for (element, memory) in self.elements.iter().zip(&mut self.memory) {
            u = match element {
                Element::Saturation {
                    upper,
                    lower,
                    sharpness,
                } => saturate(u, if u > 0.0 { *upper } else { *lower }, *sharpness),
                Element::DeadZone {
                    upper,
                    lower,
                    radius,
                } => {
                    radius
                        * (soft_plus((u - upper) / radius) - soft_plus((-u - lower) / radius)
                            + soft_plus(-lower / radius)
                            - soft_plus(-upper / radius))
                }
                Element::Play(half) => {
                    *memory = memory.clamp(u - half, u + half);
                    *memory
                }
                Element::RateLimit(slope) => {
                    let before = *memory;
                    *memory += (u - before).clamp(-slope * step, slope * step);
                    0.5 * (before + *memory)
                }
                Element::Asymmetry(positive, negative) => {
                    u * if u > 0.0 { positive } else { negative }
                }
                Element::Delay(_) => u,
                Element::Lag(time_constant) => {
                    let share = step / time_constant;
                    let before = *memory;
                    *memory = u + (before - u) * (-share).exp();
                    u + (before - *memory) / share
                }
                Element::GainChange { factor, from } => {
                    if time >= *from {
                        u * factor
                    } else {
                        u
                    }
                }
                Element::Derating {
                    sensitivity,
                    time_constant,
                } => {
                    let gain = (-sensitivity * *memory).exp();
                    *memory = u * u + (*memory - u * u) * (-step / time_constant).exp();
                    u * gain
                }
                Element::Factor(factor) => u * factor,
            };
        }
        u
    }
}

/// The mean over `[start, start + step]` of commands held over samples of `dt`; zero before the first.
fn held_mean(commands: &[f64], start: f64, step: f64, dt: f64) -> f64 {
    let at = |sample: f64| {
        if sample < 0.0 {
            0.0
        } else {
            let index = (sample as usize).min(commands.len().saturating_sub(1));
            commands.get(index).copied().unwrap_or(0.0)
        }
    };
    const EDGE: f64 = 1e-9;
    let first = (start / dt + EDGE).floor();
    let boundary = (first + 1.0) * dt;
    let share = ((boundary - start) / step).clamp(0.0, 1.0);
    if share >= 1.0 - EDGE {
        at(first)
    } else {
        share * at(first) + (1.0 - share) * at(first + 1.0)
    }
}
