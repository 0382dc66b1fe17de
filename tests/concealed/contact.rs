//! Forces that depend on where the body is: stops, magnets, cogs and pendulums.

/// A stop with stiffness and damping that can only push.
#[derive(Debug, Clone, PartialEq)]
pub struct Stop {
    /// Distance of the upper stop, infinite if there is none.
    pub upper: f64,
    /// Distance of the lower stop, infinite if there is none.
    pub lower: f64,
    /// Contact stiffness.
    pub stiffness: f64,
    /// Contact damping.
    pub damping: f64,
}

impl Stop {
    /// The force that resists the motion.
    pub fn force(&self, position: f64, velocity: f64) -> f64 {
        let push = |depth: f64, speed: f64| {
            if depth > 0.0 {
                (self.stiffness * depth + self.damping * speed).max(0.0)
            } else {
                0.0
            }
        };
        push(position - self.upper, velocity) - push(-self.lower - position, -velocity)
    }
}

/// A magnet on one side that pulls with one over the square of the gap.
#[derive(Debug, Clone, PartialEq)]
pub struct Magnet {
    /// Pull at a unit gap.
    pub force: f64,
    /// Gap at position zero, in units of `scale`.
    pub gap: f64,
    /// Length that counts as one.
    pub scale: f64,
}

impl Magnet {
    const CLOSEST: f64 = 0.4;

    /// The force that resists the motion: negative, it pulls towards the magnet.
    pub fn force(&self, position: f64) -> f64 {
        let gap = (self.gap - position / self.scale).max(Self::CLOSEST);
        -self.force / (gap * gap)
    }
}

/// A force sinusoidal in position.
#[derive(Debug, Clone, PartialEq)]
pub struct Cogs {
    /// Amplitude.
    pub force: f64,
    /// Distance between cogs.
    pub pitch: f64,
    /// Phase at position zero.
    pub phase: f64,
}

impl Cogs {
    /// The force that resists the motion.
    pub fn force(&self, position: f64) -> f64 {
        self.force * (std::f64::consts::TAU * position / self.pitch + self.phase).sin()
    }
}

/// What is left of a spring when it is a pendulum: `k (sin(a x) / a - x)`.
#[derive(Debug, Clone, PartialEq)]
pub struct Swing {
    /// Stiffness at small angles.
    pub stiffness: f64,
    /// Angle for a unit of position.
    pub angle: f64,
}

impl Swing {
    /// The force that resists the motion, beyond the linear spring.
    pub fn force(&self, position: f64) -> f64 {
        self.stiffness * ((self.angle * position).sin() / self.angle - position)
    }
}
