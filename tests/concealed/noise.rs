//! Measurement noise: white or coloured, Gaussian or heavy-tailed.

use super::dice::Dice;

/// A first-order autoregression.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Standard deviation, relative to the signal's.
    pub ratio: f64,
    /// Correlation from one sample to the next.
    pub colour: f64,
    /// Whether the innovations are Student t with four degrees of freedom instead of normal.
    pub heavy: bool,
}

impl Noise {
    /// The name of the tail in the truth file.
    pub fn tail(&self) -> &'static str {
        if self.heavy { "student_t4" } else { "gaussian" }
    }

    /// A stationary sequence.
    pub fn sequence(&self, samples: usize, dice: &mut Dice) -> Vec<f64> {
        const SETTLE: usize = 200;
        let fresh = (1.0 - self.colour * self.colour).sqrt();
        let mut state = 0.0;
        (0..samples + SETTLE)
            .map(|_| {
                let innovation = if self.heavy {
                    dice.student()
                } else {
                    dice.normal()
                };
                state = self.colour * state + fresh * innovation;
                self.ratio * state
            })
            .skip(SETTLE)
            .collect()
    }
}
