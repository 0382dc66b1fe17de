//! Bouc-Wen hysteresis: a spring that yields and remembers.

/// A force proportional to a memory that saturates after a yield distance.
#[derive(Debug, Clone, PartialEq)]
pub struct BoucWen {
    /// Force for a unit memory.
    pub force: f64,
    /// Distance after which it yields.
    pub yield_distance: f64,
}

impl BoucWen {
    const BETA: f64 = 0.6;
    const GAMMA: f64 = 0.3;
    const POWER: f64 = 1.5;

    fn rate(&self, velocity: f64, memory: f64) -> f64 {
        let turn = Self::GAMMA + Self::BETA * (velocity * memory).signum();
        velocity / self.yield_distance * (1.0 - turn * memory.abs().powf(Self::POWER))
    }

    /// The memory after `step` at constant velocity, by the midpoint rule.
    pub fn advance(&self, velocity: f64, memory: f64, step: f64) -> f64 {
        let middle = memory + 0.5 * step * self.rate(velocity, memory);
        memory + step * self.rate(velocity, middle)
    }
}
