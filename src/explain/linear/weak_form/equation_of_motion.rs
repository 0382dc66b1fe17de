//! An equation of motion with its laws, fitted to windows; and the same as a plant that can be run.

use std::sync::Arc;

use nalgebra::DMatrix;

use super::correlated_regression::Regression;
use super::laws::Form;
use super::windows::{Reading, Windows};
use crate::explain::linear::data::Data;
use crate::explain::linear::model::coordinates::Coordinates;
use crate::explain::linear::model::functionals::Signal;
use crate::explain::linear::model::linear_plant::{Plant, row_major};
use crate::explain::linear::model::structure::{Direction, Instance, Structure};
use crate::linalg::exponential;

/// `u = M a + d v + F0 [+ k x] + laws`.
#[derive(Debug, Clone)]
pub(crate) struct Equation {
    pub(crate) reading: Reading,
    /// Whether a linear spring is in it.
    pub(crate) spring: bool,
    /// Laws with their number of shape.
    pub(crate) laws: Vec<(Form, f64)>,
}

/// Coefficients before those of the spring and the laws: mass, viscous friction, constant force.
const PLAIN: usize = 3;

/// Rounds and points of the refinement of a shape around the best of its grid.
const REFINEMENTS: usize = 4;
const POINTS: i32 = 4;

impl Equation {
    /// Least squares over the windows. With `ranking`, laws on the input have a coefficient of their own, which must
    /// come out near one; else they are what they are.
    pub(crate) fn fit(&self, windows: &Windows, data: &Data, ranking: bool) -> Option<Regression> {
        let (target, columns) = self.system(windows, data, ranking);
        let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        Regression::new(&columns, &target)
    }

    /// The acceleration from input, rate, constant, spring, laws and further columns: what the noise of the sensor is in is
    /// then the target, and no column can take the place of the input.
    pub(crate) fn fit_motion(
        &self,
        windows: &Windows,
        data: &Data,
        more: &[Vec<f64>],
    ) -> Option<Regression> {
        let (mut acceleration, mut columns) = self.system(windows, data, false);
        // The input changes place with the acceleration.
        std::mem::swap(&mut acceleration, &mut columns[0]);
        let columns: Vec<&[f64]> = columns.iter().chain(more).map(Vec::as_slice).collect();
        Regression::new(&columns, &acceleration)
    }

    /// Errors of given coefficients (as of [`Equation::fit`] without `ranking`) on windows.
    pub(crate) fn errors(&self, windows: &Windows, data: &Data, coefficients: &[f64]) -> Vec<f64> {
        let (target, columns) = self.system(windows, data, false);
        (0..target.len())
            .map(|i| {
                let said: f64 = columns
                    .iter()
                    .zip(coefficients)
                    .map(|(column, c)| column[i] * c)
                    .sum();
                target[i] - said
            })
            .collect()
    }

    /// Target and columns of the regression.
    fn system(&self, windows: &Windows, data: &Data, ranking: bool) -> (Vec<f64>, Vec<Vec<f64>>) {
        let start = data.segments[0].start_time;
        let one = vec![1.0; windows.places.len()];
        let mut target = windows.force.clone();
        let mut columns: Vec<Vec<f64>> =
            vec![windows.acceleration.clone(), windows.speed.clone(), one];
        if self.spring {
            columns.push(windows.average(|s, k| windows.position[s][k]));
        }
        for (form, shape) in &self.laws {
            let own = form.columns(windows, *shape, start, data.sample_time);
            if form.on_input() && !ranking {
                for (t, c) in target.iter_mut().zip(&own[0]) {
                    *t -= c;
                }
            } else {
                columns.extend(own);
            }
        }
        (target, columns)
    }

    /// Where the coefficients of each law begin, and how many they are.
    pub(crate) fn places(&self, ranking: bool) -> Vec<(usize, usize)> {
        let mut at = PLAIN + usize::from(self.spring);
        self.laws
            .iter()
            .map(|(form, _)| {
                let count = match form.definition.id {
                    _ if form.on_input() && !ranking => 0,
                    "stribeck_friction" | "cogging" => 2,
                    _ => 1,
                };
                at += count;
                (at - count, count)
            })
            .collect()
    }

    /// Numbers that the equation owes in all.
    pub(crate) fn owed(&self, regression: &Regression) -> f64 {
        let shapes: usize = self.laws.iter().map(|(form, _)| form.owed()).sum();
        (regression.coefficients.len() + shapes) as f64
    }

    /// Whether the mass is one, a spring pulls back (a drive that topples would not have been recorded for long), and
    /// the laws are physical.
    pub(crate) fn is_physical(&self, regression: &Regression) -> bool {
        let c = &regression.coefficients;
        let side = c[0].signum();
        c[0] != 0.0
            && !(self.spring && c[PLAIN] * side <= 0.0)
            && self
                .laws
                .iter()
                .zip(self.places(true))
                .all(|((form, _), (at, count))| {
                    form.is_physical(&c.as_slice()[at..at + count], side)
                })
    }

    /// Time in seconds in which the slowest free motion of the position decays to `1/e`, without the laws: infinite without a
    /// spring, for a mass then stays where it was pushed.
    pub(crate) fn forgets_after(&self, coefficients: &[f64]) -> f64 {
        if !self.spring {
            return f64::INFINITY;
        }
        let (mass, viscous, spring) = (coefficients[0], coefficients[1], coefficients[PLAIN]);
        // Roots of M s^2 + d s + k.
        let (half, square) = (0.5 * viscous / mass, spring / mass);
        let slowest = half - (half * half - square).max(0.0).sqrt();
        if slowest > 0.0 {
            1.0 / slowest
        } else {
            f64::INFINITY
        }
    }

    /// The last law's shape moved to where it fits best, within `width` (a factor) of what it is.
    pub(crate) fn refined(mut self, windows: &Windows, data: &Data, width: f64) -> Self {
        let Some(last) = self.laws.len().checked_sub(1) else {
            return self;
        };
        if !self.laws[last].0.has_shape() {
            return self;
        }
        let cost = |equation: &Self| {
            equation
                .fit(windows, data, true)
                .filter(|r| equation.is_physical(r))
                .map_or(f64::INFINITY, |r| r.motion_squares())
        };
        let mut least = cost(&self);
        let mut width = width.ln();
        for _ in 0..REFINEMENTS {
            let centre = self.laws[last].1;
            for i in -POINTS..=POINTS {
                let mut trial = self.clone();
                trial.laws[last].1 = centre * (width * f64::from(i) / f64::from(POINTS)).exp();
                let now = cost(&trial);
                if now < least {
                    least = now;
                    self = trial;
                }
            }
            width /= f64::from(POINTS);
        }
        self
    }

    /// The plant with its laws, from the coefficients and the initial position and rate of each segment; and its
    /// numbers. The second input is the constant 1.
    pub(crate) fn structure(
        &self,
        coefficients: &[f64],
        starts: &[[f64; 2]],
        step: f64,
    ) -> Option<(Structure, Vec<f64>)> {
        let (mass, viscous, constant) = (coefficients[0], coefficients[1], coefficients[2]);
        if !coefficients.iter().all(|c| c.is_finite()) || mass == 0.0 {
            return None;
        }
        let spring = if self.spring {
            coefficients[PLAIN]
        } else {
            0.0
        };
        let n = match self.reading {
            Reading::Position => 2,
            Reading::Velocity => 1,
        };
        // Exact for inputs that are held: exp of [A B; 0 0].
        let mut both = DMatrix::zeros(n + 2, n + 2);
        let last = n - 1;
        if n == 2 {
            both[(0, 1)] = 1.0;
            both[(1, 0)] = -spring / mass;
        }
        both[(last, last)] = -viscous / mass;
        both[(last, n)] = 1.0 / mass;
        both[(last, n + 1)] = -constant / mass;
        let held = exponential(&(both * step));
        if !held.iter().all(|v| v.is_finite()) {
            return None;
        }
        let b = held.view((0, n), (n, 2)).into_owned();
        let push: Vec<f64> = b.column(0).iter().copied().collect();
        let mut c = vec![0.0; n];
        c[0] = 1.0;
        let plant = Plant {
            states: n,
            inputs: 2,
            outputs: 1,
            a: row_major(&held.view((0, 0), (n, n)).into_owned()),
            b: row_major(&b),
            c,
            d: vec![0.0; 2],
            sample_time: step,
        };
        let signal = match self.reading {
            Reading::Position => Signal::Output(0),
            Reading::Velocity => Signal::Integral(0),
        };
        let mut theta = Vec::new();
        let mut effects = Vec::new();
        for ((form, shape), (at, count)) in self.laws.iter().zip(self.places(false)) {
            let (amplitude, parameters) = form.numbers(&coefficients[at..at + count], *shape);
            if !form.on_input() {
                theta.extend(push.iter().map(|b| b * amplitude));
            }
            for (p, v) in form.definition.parameters.iter().zip(&parameters) {
                theta.push(if p.logarithmic {
                    v.max(p.lower).ln()
                } else {
                    *v
                });
            }
            effects.push(Instance {
                definition: form.definition,
                channel: 0,
                signal,
                direction: Direction::Free,
            });
        }
        Some((
            Structure {
                coordinates: Arc::new(Coordinates::fixed(plant, vec![0, 1])),
                plant_free: false,
                initial_free: false,
                initial: starts.iter().map(|s| s[..n].to_vec()).collect(),
                feedthrough_free: false,
                substeps: 1,
                recording: None,
                effects,
                known: Vec::new(),
                adjusted: 0,
            },
            theta,
        ))
    }
}
