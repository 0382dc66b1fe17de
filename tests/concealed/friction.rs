//! Friction that sticks: LuGre bristles, with or without the Stribeck fall.

/// Bristles between two surfaces. Their mean bend is the law's internal state.
#[derive(Debug, Clone, PartialEq)]
pub struct Bristles {
    /// Sliding force.
    pub sliding: f64,
    /// Force that breaks away from rest; equal to `sliding` for Coulomb friction.
    pub breakaway: f64,
    /// Speed over which the breakaway force falls to the sliding force.
    pub stribeck_speed: f64,
    /// Stiffness of the bristles.
    pub stiffness: f64,
    /// Damping of the bristles at rest; it fades with speed.
    pub damping: f64,
}

impl Bristles {
    fn steady_bend(&self, speed: f64) -> f64 {
        let ratio = speed / self.stribeck_speed;
        (self.sliding + (self.breakaway - self.sliding) * (-ratio * ratio).exp()) / self.stiffness
    }

    /// The force that resists the motion.
    pub fn force(&self, velocity: f64, bend: f64) -> f64 {
        let limit = self.steady_bend(velocity);
        let bend_rate = velocity - velocity.abs() / limit * bend;
        let ratio = velocity / self.stribeck_speed;
        self.stiffness * bend + self.damping * (-ratio * ratio).exp() * bend_rate
    }

    /// The bend after `step` at constant velocity, exactly.
    pub fn advance(&self, velocity: f64, bend: f64, step: f64) -> f64 {
        let limit = self.steady_bend(velocity);
        let travelled = velocity.abs() * step / limit;
        let target = limit * velocity.signum();
        target + (bend - target) * (-travelled).exp()
    }
}
