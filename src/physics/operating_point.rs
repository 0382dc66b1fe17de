//! A plant linearised at an operating point, and the derivatives of what follows from it with respect to parameters.
//!
//! An equilibrium moves with the parameters: with `f(x(p), u, p) = 0`, `dx/dp = -A^+ df/dp`, where `A^+` is the pseudo-inverse
//! (of a plant that integrates, an equilibrium is not unique; the nearest one is followed). Everything is then differentiated
//! along `(p + h, x + h dx/dp)` and `(p - h, x - h dx/dp)` by central differences of matrices that are exact; what the tangent
//! misses of the curve `x(p)` is even in `h` and cancels.

use nalgebra::{DMatrix, DVector};

use super::simulation::{LinearPlant, Plant, Point};
use crate::linalg::pseudo_inverse;

/// Step of the differences as a part of a parameter's size: rounding and curvature then cost less than 1e-9 of a derivative.
const STEP: f64 = 1e-6;
/// What Newton's method leaves of a state that is zero, as a part of the largest (at least of 1).
const ROUNDING: f64 = 1e-12;
/// Singular values below this part of the largest count as zero.
const RANK: f64 = 1e-12;

/// Where a plant is linearised.
#[derive(Debug, Clone, PartialEq)]
pub enum OperatingPoint {
    /// Where no state moves: searched for from this state.
    Equilibrium(Vec<f64>),
    /// At the initial values, which may depend on parameters.
    Start,
    /// At this state.
    State(Vec<f64>),
}

/// Why a plant cannot be linearised.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OperatingPointError {
    /// Newton's method finds no state at rest.
    #[error("no equilibrium was found near {near}")]
    NoEquilibrium {
        /// Names and values of the states where the search began.
        near: String,
    },
    /// A derivative has no value there.
    #[error(
        "the equations cannot be linearised at {state}: the derivative of {what} is not a finite number there"
    )]
    NotFinite {
        /// Names and values of the states.
        state: String,
        /// A state's derivative or an output.
        what: String,
    },
}

/// A plant at an operating point.
#[derive(Debug, Clone, PartialEq)]
pub struct Linearisation {
    /// `A, B, C, D`.
    pub linear: LinearPlant,
    /// The state.
    pub state: Vec<f64>,
}

/// A plant at an operating point, and a step to both sides of each parameter that is uncertain.
#[derive(Debug, Clone, PartialEq)]
pub struct OperatingPlant {
    /// At the parameters.
    pub at: Linearisation,
    /// The inputs.
    pub inputs: Vec<f64>,
    sides: Vec<[Linearisation; 2]>,
    widths: Vec<f64>,
}

impl OperatingPlant {
    /// Derivatives of quantities of the linearised plant: a row for each, a column for each uncertain parameter.
    pub(crate) fn jacobian(&self, of: impl Fn(&Linearisation) -> Vec<f64>) -> DMatrix<f64> {
        let columns: Vec<DVector<f64>> = self
            .sides
            .iter()
            .zip(&self.widths)
            .map(|([below, above], width)| {
                (DVector::from_vec(of(above)) - DVector::from_vec(of(below))) / *width
            })
            .collect();
        match columns.is_empty() {
            true => DMatrix::zeros(of(&self.at).len(), 0),
            false => DMatrix::from_columns(&columns),
        }
    }

    /// Covariance of quantities of the linearised plant, to first order, from that of the uncertain parameters.
    pub fn covariance(
        &self,
        parameters: &DMatrix<f64>,
        of: impl Fn(&Linearisation) -> Vec<f64>,
    ) -> DMatrix<f64> {
        let jacobian = self.jacobian(of);
        &jacobian * parameters * jacobian.transpose()
    }
}

impl Plant {
    /// Linearises at an operating point with these inputs, and beside it for each of the `uncertain` parameters, which are
    /// places in [`ModelSpec::parameters`](super::ModelSpec::parameters).
    ///
    /// # Errors
    /// [`OperatingPointError`] when there is no equilibrium, or the equations have no finite derivative there.
    pub fn at_operating_point(
        &self,
        point: &Point,
        inputs: &[f64],
        operating: &OperatingPoint,
        uncertain: &[usize],
    ) -> Result<OperatingPlant, OperatingPointError> {
        let state = match operating {
            OperatingPoint::Equilibrium(near) if near.is_empty() => Vec::new(),
            OperatingPoint::Equilibrium(near) => {
                let found = self.equilibrium(point, near, inputs);
                let mut state = found.ok_or_else(|| OperatingPointError::NoEquilibrium {
                    near: self.named_states(near),
                })?;
                // Newton's method ends this far from zero.
                let rounding = ROUNDING * state.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
                let small = state.iter_mut().filter(|x| x.abs() <= rounding);
                small.for_each(|x| *x = 0.0);
                state
            }
            OperatingPoint::Start => self.start(point),
            OperatingPoint::State(state) => state.clone(),
        };
        let linearised = |point: &Point, state: Vec<f64>| {
            let linear = self.linearise(point, &state, inputs, 0.0);
            self.check_finite(&linear, &state)?;
            Ok(Linearisation { linear, state })
        };
        let at = linearised(point, state)?;
        let spec = &self.spec;
        let places = spec.parameters();
        let (mut sides, mut widths) = (Vec::new(), Vec::new());
        for &place in uncertain {
            let v = spec.variable(places[place]);
            let value = point.parameters[place];
            let range = v.max - v.min;
            let size = if value != 0.0 {
                value.abs()
            } else if range.is_finite() && range > 0.0 {
                range
            } else {
                v.nominal.map_or(1.0, f64::abs)
            };
            let moved = |by: f64| {
                let mut moved = point.clone();
                moved.parameters[place] = (value + by).clamp(v.min, v.max);
                moved
            };
            let points = [moved(-STEP * size), moved(STEP * size)];
            let width = points[1].parameters[place] - points[0].parameters[place];
            if width <= 0.0 {
                // Its bounds leave it no other value.
                sides.push([at.clone(), at.clone()]);
                widths.push(1.0);
                continue;
            }
            let slope = match operating {
                _ if at.state.is_empty() => DVector::zeros(0),
                OperatingPoint::State(_) => DVector::zeros(at.state.len()),
                OperatingPoint::Start => {
                    let [below, above] =
                        [0, 1].map(|side| DVector::from_vec(self.start(&points[side])));
                    (above - below) / width
                }
                OperatingPoint::Equilibrium(_) => {
                    let [below, above] = [0, 1].map(|side| {
                        let linear = self.linearise(&points[side], &at.state, inputs, 0.0);
                        DVector::from_vec(linear.derivative)
                    });
                    let inverse = pseudo_inverse(&at.linear.a, RANK)
                        .unwrap_or_else(|_| DMatrix::zeros(at.state.len(), at.state.len()));
                    -inverse * ((above - below) / width)
                }
            };
            let side = |k: usize| {
                let by = points[k].parameters[place] - value;
                let state = at.state.iter().zip(&slope).map(|(x, s)| x + by * s);
                linearised(&points[k], state.collect())
            };
            sides.push([side(0)?, side(1)?]);
            widths.push(width);
        }
        Ok(OperatingPlant {
            at,
            inputs: inputs.to_vec(),
            sides,
            widths,
        })
    }

    /// `phi = 0.1, w = 0`.
    fn named_states(&self, state: &[f64]) -> String {
        let states = self.spec.states();
        let each = states
            .iter()
            .zip(state)
            .map(|(&v, x)| format!("{} = {x:.6}", self.spec.variable(v).name));
        each.collect::<Vec<_>>().join(", ")
    }

    fn check_finite(&self, linear: &LinearPlant, state: &[f64]) -> Result<(), OperatingPointError> {
        let spec = &self.spec;
        let row = |of: &DMatrix<f64>, i: usize| of.row(i).iter().all(|v| v.is_finite());
        let states = spec.states();
        let outputs = spec.outputs();
        let bad_state = (0..states.len()).find(|&i| {
            !(linear.derivative[i].is_finite() && row(&linear.a, i) && row(&linear.b, i))
        });
        let bad_output = (0..outputs.len())
            .find(|&i| !(linear.output[i].is_finite() && row(&linear.c, i) && row(&linear.d, i)));
        let what = bad_state
            .map(|i| format!("der({})", spec.variable(states[i]).name))
            .or_else(|| bad_output.map(|i| spec.variable(outputs[i]).name.clone()));
        match what {
            None => Ok(()),
            Some(what) => Err(OperatingPointError::NotFinite {
                state: self.named_states(state),
                what,
            }),
        }
    }
}
