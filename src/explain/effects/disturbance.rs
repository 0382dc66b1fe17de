//! What acts on the plant and was not commanded, and paths that the simulation lacks.

use super::{Action, Definition, Mimic, Motion, Needs, Observed, Parameter, Sense, Unit};

pub(super) static ENTRIES: &[Definition] = &[
    Definition {
        id: "periodic_disturbance",
        variant: "",
        name: "periodic disturbance",
        equation: "y = y_true + a cos(2 pi f t + phase), an amplitude and a phase at each output",
        parameters: &[Parameter::positive("frequency", Unit::Hertz)],
        mimics: &[Mimic {
            effect: "extra_mode",
            experiment: "record without any input: a disturbance is still there, a resonance is not",
        }],
        linear: &[],
        persists: false,
        action: Action::Sine,
        starts: |seen| seen.lines.iter().map(|f| vec![*f]).collect(),
    },
    Definition {
        id: "load_step",
        variant: "",
        name: "constant load from some time on",
        equation: "F = F0 for t >= t0",
        parameters: &[Parameter::real("from", Unit::Second)],
        mimics: &[
            Mimic {
                effect: "sensor_offset",
                experiment: "read the sensor at rest, unloaded, before and after",
            },
            Mimic {
                effect: "sensor_drift",
                experiment: "a long recording at a constant input: a drift goes on, a load step is over",
            },
        ],
        linear: &[],
        persists: true,
        action: Action::Force(step, Needs::Time, Sense::Either),
        starts: |seen| seen.change_times.iter().map(|t| vec![*t]).collect(),
    },
    Definition {
        id: "extra_mode",
        variant: "",
        name: "resonance that the simulation lacks",
        equation: "y = y_true + H u, H of order 2",
        parameters: &[
            Parameter::positive("frequency", Unit::Hertz),
            Parameter::positive("damping", Unit::Ratio),
        ],
        mimics: &[
            Mimic {
                effect: "input_delay",
                experiment: "a sweep over the resonance: only a resonance has a peak",
            },
            Mimic {
                effect: "periodic_disturbance",
                experiment: "record without any input: a disturbance is still there, a resonance is not",
            },
        ],
        linear: &[],
        persists: true,
        action: Action::Mode,
        starts: |seen| seen.frequencies.iter().map(|f| vec![*f, 0.05]).collect(),
    },
    Definition {
        id: "state_of_charge",
        variant: "",
        name: "dependence of the output on the integral of the input (state of charge)",
        equation: "y = y_true + c1 s + c2 P2(s) + c3 P3(s) + c4 P4(s), s = (int u dt - centre)/half_range, P Legendre polynomials",
        parameters: &[
            Parameter::real("centre", Unit::InputSeconds).held(),
            Parameter::positive("half_range", Unit::InputSeconds).held(),
        ],
        mimics: &[Mimic {
            effect: "sensor_drift",
            experiment: "let the input rest in the middle of the recording: a drift goes on, a charge stays",
        }],
        linear: &[],
        persists: true,
        action: Action::Charge,
        starts: charges,
    },
    Definition {
        id: "missing_input",
        variant: "",
        name: "input that acts in reality and not in the simulation",
        equation: "x+ = A x + B u + b u_missing",
        parameters: &[],
        mimics: &[],
        linear: &[],
        persists: true,
        action: Action::MissingPath,
        starts: |_| vec![vec![]],
    },
];

/// The range of the integral over the recording.
fn charges(seen: &Observed) -> Vec<Vec<f64>> {
    let (mut at, mut low, mut high) = (0.0, 0.0_f64, 0.0_f64);
    for u in &seen.channel {
        at += u * seen.step;
        low = low.min(at);
        high = high.max(at);
    }
    if high > low {
        vec![vec![0.5 * (low + high), 0.5 * (high - low)]]
    } else {
        Vec::new()
    }
}

fn step(p: &[f64], motion: &Motion, _: &mut [f64; 3]) -> f64 {
    motion.clock.share_after(motion.sample, p[0])
}
