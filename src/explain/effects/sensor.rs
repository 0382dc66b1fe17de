//! What happens between the plant's output and the recorded value.

use super::{Action, Clock, Definition, Mimic, Observed, Parameter, Unit, level};

pub(super) static ENTRIES: &[Definition] = &[
    Definition {
        id: "sensor_saturation",
        variant: "",
        name: "saturation of the sensor",
        equation: "y = clamp(y_true, -limit, limit)",
        parameters: &[Parameter::positive("limit", Unit::Position)],
        mimics: MIMICS,
        linear: &[],
        persists: true,
        action: Action::Sensor(saturate),
        starts: reached,
    },
    Definition {
        id: "sensor_saturation",
        variant: "upper",
        name: "saturation of the sensor on the upper side",
        equation: "y = min(y_true, limit)",
        parameters: &[Parameter::real("limit", Unit::Position)],
        mimics: MIMICS,
        linear: &[],
        persists: true,
        action: Action::Sensor(saturate_upper),
        starts: reached_upper,
    },
    Definition {
        id: "sensor_saturation",
        variant: "lower",
        name: "saturation of the sensor on the lower side",
        equation: "y = max(y_true, limit)",
        parameters: &[Parameter::real("limit", Unit::Position)],
        mimics: MIMICS,
        linear: &[],
        persists: true,
        action: Action::Sensor(saturate_lower),
        starts: reached_lower,
    },
    Definition {
        id: "sensor_saturation",
        variant: "range",
        name: "saturation of the sensor on both sides, each with a limit of its own",
        equation: "y = clamp(y_true, lower_limit, upper_limit)",
        parameters: &[
            Parameter::real("lower_limit", Unit::Position),
            Parameter::real("upper_limit", Unit::Position),
        ],
        mimics: MIMICS,
        linear: &[],
        persists: true,
        action: Action::Sensor(saturate_range),
        starts: reached_range,
    },
    Definition {
        id: "sensor_offset",
        variant: "",
        name: "offset of the sensor",
        equation: "y = y_true + offset",
        parameters: &[Parameter::real("offset", Unit::Position)],
        mimics: &[Mimic {
            effect: "load_step",
            experiment: "switch the plant off and read the sensor at rest",
        }],
        linear: &[0],
        persists: true,
        action: Action::Sensor(offset),
        starts: |_| vec![vec![0.0]],
    },
    Definition {
        id: "sensor_drift",
        variant: "",
        name: "drift of the sensor",
        equation: "y = y_true + d t",
        parameters: &[Parameter::real("drift_rate", Unit::Rate)],
        mimics: DRIFT_MIMICS,
        linear: &[0],
        persists: false,
        action: Action::Sensor(drift),
        starts: |_| vec![vec![0.0]],
    },
    Definition {
        id: "sensor_drift",
        variant: "curved",
        name: "drift of the sensor",
        equation: "y = y_true + a s + b s^2 + c s^3, s = share of the recording",
        parameters: &[
            Parameter::real("drift", Unit::Position),
            Parameter::real("drift_square", Unit::Position),
            Parameter::real("drift_cube", Unit::Position),
        ],
        mimics: DRIFT_MIMICS,
        linear: &[0, 1, 2],
        persists: false,
        action: Action::Sensor(curved_drift),
        starts: |_| vec![vec![0.0, 0.0, 0.0]],
    },
    Definition {
        id: "sensor_drift",
        variant: "late",
        name: "drift of the sensor that begins late",
        equation: "y = y_true + d (t - t0) for t >= t0",
        parameters: &[
            Parameter::real("drift_rate", Unit::Rate),
            Parameter::real("from", Unit::Second),
        ],
        mimics: DRIFT_MIMICS,
        linear: &[0],
        persists: false,
        action: Action::Sensor(late_drift),
        starts: |seen| seen.change_times.iter().map(|t| vec![0.0, *t]).collect(),
    },
    Definition {
        id: "sensor_saturation",
        variant: "soft",
        name: "saturation of the sensor with a soft knee",
        equation: "y = y_true/(1 + |y_true/limit|^s)^(1/s)",
        parameters: &[
            Parameter::positive("limit", Unit::Position),
            super::actuator::SHARPNESS,
        ],
        mimics: MIMICS,
        linear: &[],
        persists: true,
        action: Action::Sensor(saturate_softly),
        starts: |_| Vec::new(),
    },
    Definition {
        id: "sensor_rectification",
        variant: "",
        name: "sensor that loses the sign",
        equation: "y = |y_true|",
        parameters: &[],
        mimics: &[Mimic {
            effect: "input_asymmetry",
            experiment: "an input that drives the output slowly through zero: a rectified signal has a corner there",
        }],
        linear: &[],
        persists: true,
        action: Action::Sensor(rectify),
        starts: |_| vec![vec![]],
    },
    Definition {
        id: "sensor_quantization",
        variant: "",
        name: "coarse resolution of the sensor",
        equation: "y = step round(y_true/step)",
        parameters: &[Parameter::positive("step", Unit::Position)],
        mimics: &[],
        linear: &[],
        persists: true,
        action: Action::Exact,
        starts: |_| Vec::new(),
    },
    Definition {
        id: "sensor_freeze",
        variant: "",
        name: "sensor that holds its value for a while",
        equation: "y(t) = y(t0) for t0 <= t <= t1",
        parameters: &[
            Parameter::real("from", Unit::Second),
            Parameter::real("to", Unit::Second),
        ],
        mimics: &[],
        linear: &[],
        persists: false,
        action: Action::Exact,
        starts: |_| Vec::new(),
    },
    Definition {
        id: "sensor_dropout",
        variant: "",
        name: "dropouts of the sensor",
        equation: "y = value in the samples that drop out",
        parameters: &[
            Parameter::real("value", Unit::Position),
            Parameter::real("count", Unit::Ratio),
            Parameter::real("first", Unit::Second),
        ],
        mimics: &[],
        linear: &[],
        persists: false,
        action: Action::Exact,
        starts: |_| Vec::new(),
    },
    Definition {
        id: "sensor_outliers",
        variant: "",
        name: "isolated outliers of the sensor",
        equation: "y = y_true + error in isolated samples",
        parameters: &[
            Parameter::real("largest", Unit::Position),
            Parameter::real("count", Unit::Ratio),
            Parameter::real("first", Unit::Second),
        ],
        mimics: &[],
        linear: &[],
        persists: false,
        action: Action::Exact,
        starts: |_| Vec::new(),
    },
    Definition {
        id: "sensor_wrap",
        variant: "",
        name: "angle that starts again each turn",
        equation: "y = y_true - period round(y_true/period)",
        parameters: &[
            Parameter::real("period", Unit::Position),
            Parameter::real("count", Unit::Ratio),
            Parameter::real("first", Unit::Second),
        ],
        mimics: &[],
        linear: &[],
        persists: false,
        action: Action::Exact,
        starts: |_| Vec::new(),
    },
    Definition {
        id: "swapped_outputs",
        variant: "",
        name: "exchanged outputs",
        equation: "y1 = y2_true, y2 = y1_true",
        parameters: &[],
        mimics: &[],
        linear: &[],
        persists: false,
        action: Action::Exact,
        starts: |_| Vec::new(),
    },
    Definition {
        id: "clock_drift",
        variant: "",
        name: "clocks of different rates",
        equation: "y(t) = y_true(t (1 + rate))",
        parameters: &[
            Parameter::real("rate", Unit::Ratio),
            Parameter::real("lag_at_end", Unit::Second),
        ],
        mimics: &[],
        linear: &[],
        persists: false,
        action: Action::Exact,
        starts: |_| Vec::new(),
    },
];

const DRIFT_MIMICS: &[Mimic] = &[Mimic {
    effect: "load_step",
    experiment: "a long recording at a constant input: a drift goes on, a load step is over",
}];

const MIMICS: &[Mimic] = &[
    Mimic {
        effect: "end_stop",
        experiment: "a step that reaches the limit: a stop changes the motion that follows, a sensor does not",
    },
    Mimic {
        effect: "input_saturation",
        experiment: "a large slow input: a saturated actuator lowers the motion, a saturated sensor only what is shown of it",
    },
];

fn saturate(p: &[f64], y: &mut [f64], _: &Clock) {
    for y in y {
        *y = y.clamp(-p[0], p[0]);
    }
}

fn saturate_upper(p: &[f64], y: &mut [f64], _: &Clock) {
    for y in y {
        *y = y.min(p[0]);
    }
}

fn saturate_lower(p: &[f64], y: &mut [f64], _: &Clock) {
    for y in y {
        *y = y.max(p[0]);
    }
}

fn saturate_range(p: &[f64], y: &mut [f64], _: &Clock) {
    for y in y {
        *y = y.max(p[0]).min(p[1]);
    }
}

fn offset(p: &[f64], y: &mut [f64], _: &Clock) {
    for y in y {
        *y += p[0];
    }
}

fn drift(p: &[f64], y: &mut [f64], clock: &Clock) {
    for (k, y) in y.iter_mut().enumerate() {
        *y += p[0] * k as f64 * clock.step;
    }
}

fn curved_drift(p: &[f64], y: &mut [f64], _: &Clock) {
    let length = y.len().max(1) as f64;
    for (k, y) in y.iter_mut().enumerate() {
        let s = k as f64 / length;
        *y += s * (p[0] + s * (p[1] + s * p[2]));
    }
}

fn late_drift(p: &[f64], y: &mut [f64], clock: &Clock) {
    for (k, y) in y.iter_mut().enumerate() {
        *y += p[0] * (clock.time(k) - p[1]).max(0.0);
    }
}

fn saturate_softly(p: &[f64], y: &mut [f64], _: &Clock) {
    for y in y {
        *y = super::actuator::soft(*y, p[0], p[1]);
    }
}

fn rectify(_: &[f64], y: &mut [f64], _: &Clock) {
    for y in y {
        *y = y.abs();
    }
}

fn reached(seen: &Observed) -> Vec<Vec<f64>> {
    [0.5, 0.7, 0.85, 0.93, 0.97, 0.99]
        .map(|q| vec![level(&seen.channel, q, f64::abs).max(1e-12)])
        .to_vec()
}

fn reached_lower(seen: &Observed) -> Vec<Vec<f64>> {
    [0.3, 0.15, 0.07, 0.02]
        .map(|q| vec![level(&seen.channel, q, |v| v)])
        .to_vec()
}

fn reached_range(seen: &Observed) -> Vec<Vec<f64>> {
    [(0.05, 0.95), (0.15, 0.85), (0.03, 0.8), (0.2, 0.97)]
        .map(|(low, high)| {
            vec![
                level(&seen.channel, low, |v| v),
                level(&seen.channel, high, |v| v),
            ]
        })
        .to_vec()
}

fn reached_upper(seen: &Observed) -> Vec<Vec<f64>> {
    [0.7, 0.85, 0.93, 0.98]
        .map(|q| vec![level(&seen.channel, q, |v| v)])
        .to_vec()
}
