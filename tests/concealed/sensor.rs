//! What happens between the plant's output and the recorded reading.

/// One fault of a sensor, in the order in which they act.
#[derive(Debug, Clone, PartialEq)]
pub enum Fault {
    /// The sign is lost.
    Rectified,
    /// Several plays of rising width, averaged.
    Plays(f64),
    /// A constant error.
    Offset(f64),
    /// An error for each sample.
    Drift(Vec<f64>),
    /// Soft limits; a side without limit is infinite.
    Limited {
        /// Upper limit.
        upper: f64,
        /// Lower limit, counted positively.
        lower: f64,
    },
    /// Steps of this size; acts on the noisy reading.
    Quantised(f64),
    /// The reading of the first sample is held until the second; acts on the noisy reading.
    Frozen(usize, usize),
}

/// A sensor with its faults and their memory.
#[derive(Debug, Clone)]
pub struct Sensor {
    faults: Vec<Fault>,
    plays: [f64; 3],
    held: f64,
}

impl Sensor {
    const WIDTHS: [f64; 3] = [0.5, 1.0, 1.5];
    const SHARPNESS: f64 = 40.0;

    /// A sensor from rest.
    pub fn new(faults: Vec<Fault>) -> Self {
        Self {
            faults,
            plays: [0.0; 3],
            held: 0.0,
        }
    }

    /// The reading of `output` with additive `noise` at a sample.
    pub fn read(&mut self, output: f64, noise: f64, sample: usize) -> f64 {
        let mut y = output;
        for fault in &self.faults {
            y = match fault {
                Fault::Rectified => y.abs(),
                Fault::Plays(half) => {
                    for (play, width) in self.plays.iter_mut().zip(Self::WIDTHS) {
                        *play = play.clamp(y - width * half, y + width * half);
                    }
                    self.plays.iter().sum::<f64>() / self.plays.len() as f64
                }
                Fault::Offset(error) => y + error,
                Fault::Drift(errors) => y + errors.get(sample).copied().unwrap_or(0.0),
                Fault::Limited { upper, lower } => {
                    let level = if y > 0.0 { *upper } else { *lower };
                    if level.is_finite() {
                        let excess = (y.abs() / level).powf(Self::SHARPNESS);
                        if excess.is_finite() {
                            y / (1.0 + excess).powf(1.0 / Self::SHARPNESS)
                        } else {
                            level * y.signum()
                        }
                    } else {
                        y
                    }
                }
                Fault::Quantised(_) | Fault::Frozen(..) => y,
            };
        }
        y += noise;
        for fault in &self.faults {
            match fault {
                Fault::Quantised(step) => y = step * (y / step).round(),
                Fault::Frozen(from, to) => {
                    if sample == *from {
                        self.held = y;
                    }
                    if (*from..*to).contains(&sample) {
                        y = self.held;
                    }
                }
                _ => {}
            }
        }
        y
    }
}
