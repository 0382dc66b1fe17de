//! The concealed effects by name, and the plants each can hide in.

use super::plant::PlantKind;

macro_rules! effects {
    ($($variant:ident = $id:literal, $doc:literal;)*) => {
        /// An effect that reality has and the simulation lacks.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
        pub enum Effect {
            $(#[doc = $doc] $variant,)*
        }

        impl Effect {
            /// Every effect.
            pub const ALL: &'static [Self] = &[$(Self::$variant),*];

            /// Its name in the truth file; unlisted ones start with `x_`.
            pub fn id(self) -> &'static str {
                match self { $(Self::$variant => $id),* }
            }
        }
    };
}

effects! {
    CoulombFriction = "coulomb_friction", "LuGre bristles of constant strength.";
    StribeckFriction = "stribeck_friction", "LuGre bristles that weaken with speed.";
    QuadraticDrag = "quadratic_drag", "A force with the square of the speed.";
    CubicStiffness = "cubic_stiffness", "A force with the cube of the position.";
    QuadraticStiffness = "quadratic_stiffness", "A force with `x^2` or `x |x|`.";
    EndStop = "end_stop", "Stiff, damped contact at one or both sides.";
    Hysteresis = "hysteresis", "Bouc-Wen force.";
    InputSaturation = "input_saturation", "Soft-knee saturation.";
    InputDeadZone = "input_dead_zone", "Dead zone with rounded edges.";
    InputBacklash = "input_backlash", "Play.";
    InputRateLimit = "input_rate_limit", "Limited slope.";
    InputAsymmetry = "input_asymmetry", "Another gain for each sign.";
    InputDelay = "input_delay", "Transport delay, also of fractions of a sample.";
    ActuatorLag = "actuator_lag", "First-order lag.";
    SensorSaturation = "sensor_saturation", "Limited reading.";
    SensorQuantization = "sensor_quantization", "Reading in steps.";
    SensorOffset = "sensor_offset", "Constant error of the reading.";
    SensorDrift = "sensor_drift", "Slowly growing error of the reading.";
    SensorRectification = "sensor_rectification", "Reading without its sign.";
    SensorFreeze = "sensor_freeze", "Held reading in a window.";
    PeriodicDisturbance = "periodic_disturbance", "A force periodic in time.";
    LoadStep = "load_step", "A constant force from some time on.";
    ExtraMode = "extra_mode", "An attached resonant mass, or a parallel mode.";
    GainChange = "gain_change", "Another input gain from some time on.";
    StiffnessChange = "stiffness_change", "Another stiffness from some time on.";
    MissingInput = "missing_input", "A second input the simulation ignores.";
    ThermalDerating = "x_thermal_derating", "Gain that falls exponentially with heat.";
    Cogging = "x_cogging", "A force sinusoidal in position.";
    Pendulum = "x_pendulum", "A spring that is a sine of a large angle.";
    SensorHysteresis = "x_sensor_hysteresis", "A reading with several plays.";
    SampleJitter = "x_dead_sample_jitter", "Readings taken at jittered times.";
    Magnetic = "x_magnetic", "A pull with one over the square of the gap.";
}

/// Pairs that occur together.
pub const PAIRS: [[Effect; 2]; 4] = [
    [Effect::CoulombFriction, Effect::InputDelay],
    [Effect::QuadraticDrag, Effect::InputDeadZone],
    [Effect::InputSaturation, Effect::PeriodicDisturbance],
    [Effect::CubicStiffness, Effect::SensorOffset],
];

impl Effect {
    /// Whether the contract lists it.
    pub fn is_listed(self) -> bool {
        !self.id().starts_with("x_")
    }

    /// Whether it sits in the sensor.
    pub fn is_sensor(self) -> bool {
        matches!(
            self,
            Self::SensorSaturation
                | Self::SensorQuantization
                | Self::SensorOffset
                | Self::SensorDrift
                | Self::SensorRectification
                | Self::SensorFreeze
                | Self::SensorHysteresis
                | Self::SampleJitter
        )
    }

    /// Whether it is a curve from command to input: two levels cannot tell it from a gain.
    pub fn is_input_curve(self) -> bool {
        matches!(
            self,
            Self::InputSaturation
                | Self::InputDeadZone
                | Self::InputBacklash
                | Self::InputAsymmetry
        )
    }

    /// Whether a plant can have it.
    pub fn fits(self, plant: PlantKind) -> bool {
        let stage = plant == PlantKind::Stage;
        match self {
            Self::CoulombFriction
            | Self::StribeckFriction
            | Self::QuadraticDrag
            | Self::Hysteresis
            | Self::ExtraMode => plant.moves(),
            Self::CubicStiffness | Self::QuadraticStiffness | Self::Magnetic => {
                plant.has_position() && !stage
            }
            Self::EndStop => plant.has_position(),
            Self::StiffnessChange | Self::Pendulum => plant.has_spring(),
            Self::Cogging => plant.moves(),
            Self::MissingInput => plant == PlantKind::Mimo,
            Self::InputBacklash => plant.moves(),
            Self::SensorSaturation | Self::SensorRectification => !stage,
            _ => true,
        }
    }

    /// Whether it may run under feedback from the reading it spoils.
    pub fn fits_loop(self) -> bool {
        !matches!(self, Self::SensorRectification | Self::MissingInput)
    }

    /// The ends of the search for its strength, in the strength's own unit, weakest first. Equal ends: fixed.
    pub fn strengths(self) -> (f64, f64) {
        match self {
            Self::CoulombFriction | Self::StribeckFriction => (1e-4, 0.9),
            Self::QuadraticDrag | Self::CubicStiffness => (1e-5, 50.0),
            Self::QuadraticStiffness => (1e-5, 5.0),
            Self::EndStop => (5.0, 0.3),
            Self::Hysteresis => (1e-4, 3.0),
            Self::InputSaturation | Self::SensorSaturation => (6.0, 0.15),
            Self::InputDeadZone | Self::InputBacklash => (1e-4, 1.5),
            Self::InputRateLimit => (5.0, 0.002),
            Self::InputAsymmetry => (1e-4, 0.8),
            Self::InputDelay => (0.005, 20.0),
            Self::ActuatorLag => (0.005, 60.0),
            Self::SensorQuantization => (1e-3, 2.0),
            Self::SensorOffset | Self::SensorDrift => (1e-4, 2.0),
            Self::SensorRectification => (1.0, 1.0),
            Self::SensorFreeze => (0.00125, 0.15),
            Self::PeriodicDisturbance => (1e-4, 5.0),
            Self::LoadStep => (1e-4, 3.0),
            Self::ExtraMode => (1e-5, 0.6),
            Self::GainChange | Self::StiffnessChange => (1e-4, 0.8),
            Self::MissingInput => (1e-4, 1.0),
            Self::ThermalDerating => (1e-3, 2.0),
            Self::Cogging => (1e-4, 3.0),
            Self::Pendulum => (0.02, 2.5),
            Self::SensorHysteresis => (1e-3, 1.0),
            Self::SampleJitter => (0.01, 1.0),
            Self::Magnetic => (1e-4, 8.0),
        }
    }

    /// Whether the fresh truth leaves it out: what depends on the noise or on the moment of recording only.
    pub fn is_of_the_recording(self) -> bool {
        matches!(
            self,
            Self::PeriodicDisturbance
                | Self::SensorDrift
                | Self::SensorFreeze
                | Self::SensorQuantization
                | Self::SampleJitter
        )
    }
}
