//! Sensors.

use super::{A_SENSOR, PlantEffect, SHOWN, TIME, effect, like};

pub(super) const SENSORS: &[PlantEffect] = &[
    effect(
        "sensor_offset",
        "constant error of a sensor",
        "y = ... + c",
        A_SENSOR,
        TIME,
        &[like(
            "load_step",
            "Record at rest with all inputs off: what the sensor shows then is its offset.",
        )],
    ),
    effect(
        "sensor_drift",
        "error of a sensor that grows with time",
        "y = ... + c*time",
        A_SENSOR,
        TIME,
        &[like(
            "load_step",
            "Come back to the first operating point at the end: a drift is still there.",
        )],
    ),
    effect(
        "sensor_scale",
        "sensor of another gain",
        "y = ... + c*y",
        A_SENSOR,
        SHOWN,
        &[like(
            "parameters",
            "Calibrate the sensor at two known values; a gain of the plant cannot be told from it by inputs and outputs alone.",
        )],
    ),
    effect(
        "sensor_lag",
        "sensor that follows with a time constant",
        "y = m where T*der(m) = ... - m",
        A_SENSOR,
        SHOWN,
        &[like(
            "actuator_lag",
            "Start from another initial state without an input: only a sensor lags then.",
        )],
    ),
    effect(
        "sensor_rectification",
        "sensor that loses the sign",
        "y = abs(...)",
        A_SENSOR,
        SHOWN,
        &[like(
            "input_saturation",
            "Drive the output slowly through zero: a rectified signal has a corner there.",
        )],
    ),
    effect(
        "sensor_saturation",
        "limits of a sensor",
        "y = min(max(..., lower), upper)",
        A_SENSOR,
        SHOWN,
        &[like(
            "end_stop",
            "Record another variable as well: behind a saturated sensor the plant moves on.",
        )],
    ),
];
