//! The laws that an averaged equation of motion is asked about: each is linear in its coefficients, given one number
//! of shape at most.

use super::windows::{Reading, Windows, quantile};
use crate::explain::effects::{self, Definition, decay};
use crate::explain::linear::search::plausibility::FEWEST_PERIODS;

/// Cogging pitches that are tried over the range of motion.
const PITCHES: usize = 80;
/// Times at which a load may begin.
const LOAD_TIMES: usize = 40;
/// An actuator effect must enter with about the size it has: this share more or less.
const INPUT_TOLERANCE: f64 = 0.3;

/// One law of the library, as columns.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Form {
    pub(crate) definition: &'static Definition,
    kind: Kind,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Coulomb,
    Stribeck,
    Drag,
    Directional,
    Cubic,
    OddQuadratic,
    EvenQuadratic,
    Cogging,
    GainOfPosition,
    Load,
    DeadZone,
    Saturation,
}

const FORMS: &[(&str, &str, Kind)] = &[
    ("coulomb_friction", "", Kind::Coulomb),
    ("stribeck_friction", "", Kind::Stribeck),
    ("quadratic_drag", "", Kind::Drag),
    ("direction_dependent_friction", "", Kind::Directional),
    ("cubic_stiffness", "", Kind::Cubic),
    ("quadratic_stiffness", "odd", Kind::OddQuadratic),
    ("quadratic_stiffness", "even", Kind::EvenQuadratic),
    ("cogging", "", Kind::Cogging),
    ("position_dependent_gain", "", Kind::GainOfPosition),
    ("load_step", "", Kind::Load),
    ("input_dead_zone", "", Kind::DeadZone),
    ("input_saturation", "", Kind::Saturation),
];

impl Form {
    /// All that can be asked with this reading: without a measured position there are no laws of it.
    pub(crate) fn all(reading: Reading, allowed: &dyn Fn(&Definition) -> bool) -> Vec<Self> {
        FORMS
            .iter()
            .filter_map(|(id, variant, kind)| {
                let definition = effects::find(id, variant)?;
                let of_position = matches!(
                    kind,
                    Kind::Cubic
                        | Kind::OddQuadratic
                        | Kind::EvenQuadratic
                        | Kind::Cogging
                        | Kind::GainOfPosition
                );
                (allowed(definition) && (reading == Reading::Position || !of_position)).then_some(
                    Self {
                        definition,
                        kind: *kind,
                    },
                )
            })
            .collect()
    }

    /// Whether the law changes the input instead of adding a force.
    pub(crate) fn on_input(&self) -> bool {
        matches!(self.kind, Kind::DeadZone | Kind::Saturation)
    }

    /// Numbers of shape that are tried; a single zero for a law without one.
    pub(crate) fn shapes(&self, windows: &Windows, start: f64, step: f64) -> Vec<f64> {
        let input = |q: f64| quantile(windows.input.iter().flatten().map(|u| u.abs()), q);
        match self.kind {
            Kind::Stribeck => [0.01, 0.02, 0.05, 0.1, 0.2, 0.4]
                .map(|share| share * windows.quick)
                .to_vec(),
            Kind::Cogging => {
                let all = || windows.position.iter().flatten().copied();
                let range = quantile(all(), 1.0) - quantile(all(), 0.0);
                // A pitch that is passed within half a window is averaged away.
                let shortest = 2.0 * windows.quick * windows.half as f64 * step;
                let (low, high) = (shortest.min(0.3 * range), range / FEWEST_PERIODS);
                (0..PITCHES)
                    .map(|i| low * (high / low).powf(i as f64 / (PITCHES - 1) as f64))
                    .collect()
            }
            Kind::Load => {
                let length = windows.rate[0].len() as f64 * step;
                (1..LOAD_TIMES)
                    .map(|i| start + length * i as f64 / LOAD_TIMES as f64)
                    .collect()
            }
            Kind::DeadZone => [0.05, 0.1, 0.2, 0.35, 0.5, 0.7].map(input).to_vec(),
            Kind::Saturation => [0.5, 0.7, 0.8, 0.9, 0.95, 0.99].map(input).to_vec(),
            _ => vec![0.0],
        }
    }

    /// Whether a number of shape is fitted.
    pub(crate) fn has_shape(&self) -> bool {
        matches!(
            self.kind,
            Kind::Stribeck | Kind::Cogging | Kind::Load | Kind::DeadZone | Kind::Saturation
        )
    }

    /// Numbers that the law owes beside its coefficients: a shape; one chosen among many pitches or times counts
    /// about twice (Djuric 1996; Zhang and Siegmund 2007).
    pub(crate) fn owed(&self) -> usize {
        match self.kind {
            Kind::Cogging | Kind::Load => 2,
            _ => usize::from(self.has_shape()),
        }
    }

    /// The law's force against the motion at unit coefficients, averaged over the windows.
    pub(crate) fn columns(&self, w: &Windows, shape: f64, start: f64, step: f64) -> Vec<Vec<f64>> {
        let x = |s: usize, k: usize| w.position[s][k];
        let v = |s: usize, k: usize| w.rate[s][k];
        let u = |s: usize, k: usize| w.input[s][k];
        let side = |v: f64| if v == 0.0 { 0.0 } else { v.signum() };
        match self.kind {
            Kind::Coulomb => vec![w.average(|s, k| side(v(s, k)))],
            Kind::Stribeck => vec![
                w.average(|s, k| side(v(s, k))),
                w.average(|s, k| side(v(s, k)) * decay((v(s, k) / shape).powi(2))),
            ],
            Kind::Drag => vec![w.average(|s, k| v(s, k) * v(s, k).abs())],
            Kind::Directional => vec![w.average(|s, k| v(s, k).abs())],
            Kind::Cubic => vec![w.average(|s, k| x(s, k).powi(3))],
            Kind::OddQuadratic => vec![w.average(|s, k| x(s, k) * x(s, k).abs())],
            Kind::EvenQuadratic => vec![w.average(|s, k| x(s, k) * x(s, k))],
            Kind::Cogging => {
                let turn = std::f64::consts::TAU / shape;
                vec![
                    w.average(|s, k| (turn * x(s, k)).sin()),
                    w.average(|s, k| (turn * x(s, k)).cos()),
                ]
            }
            Kind::GainOfPosition => vec![w.average(|s, k| -x(s, k) * u(s, k))],
            Kind::Load => vec![w.average(|_, k| {
                if start + k as f64 * step >= shape {
                    -1.0
                } else {
                    0.0
                }
            })],
            Kind::DeadZone => vec![w.average(|s, k| u(s, k).clamp(-shape, shape))],
            Kind::Saturation => vec![w.average(|s, k| u(s, k) - u(s, k).clamp(-shape, shape))],
        }
    }

    /// Whether the coefficients are physical; `side` is the sign of the mass (an input may be wired in reverse).
    pub(crate) fn is_physical(&self, coefficients: &[f64], side: f64) -> bool {
        match self.kind {
            Kind::Coulomb | Kind::Drag => coefficients[0] * side > 0.0,
            Kind::Stribeck => coefficients.iter().all(|c| c * side > 0.0),
            Kind::DeadZone | Kind::Saturation => (coefficients[0] - 1.0).abs() < INPUT_TOLERANCE,
            _ => true,
        }
    }

    /// Amplitude and shape parameters in the library's order.
    pub(crate) fn numbers(&self, coefficients: &[f64], shape: f64) -> (f64, Vec<f64>) {
        match self.kind {
            Kind::Stribeck => {
                let excess = coefficients[1] / coefficients[0];
                (coefficients[0], vec![excess.clamp(0.02, 20.0), shape])
            }
            Kind::Cogging => (
                coefficients[0].hypot(coefficients[1]),
                vec![shape, coefficients[1].atan2(coefficients[0])],
            ),
            Kind::Load => (coefficients[0], vec![shape]),
            Kind::DeadZone | Kind::Saturation => (1.0, vec![shape]),
            _ => (coefficients[0], Vec::new()),
        }
    }
}
