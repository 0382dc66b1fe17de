//! Which models a search runs over: the directions it may take from a model, and where a step leads.

use nalgebra::DMatrix;

use super::super::stable::with_stable_predictor;
use crate::covariance::ParameterLayout;
use crate::linalg::{LinalgError, svd_thin};
use crate::model::{Armax, StateSpace};

/// Form of the model that is searched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Form {
    /// Innovation form with all entries free but those that only change the state basis: data-driven local
    /// coordinates (McKelvey, Helmersson & Ribarits 2004). Any number of inputs and outputs.
    Innovation,
    /// `A(q) y = B(q) u + C(q) e` in observer form, for one input and one output: the coordinates are the
    /// coefficients `a1..an, (b0), b1..bn, c1..cn`.
    Armax,
}

impl Form {
    /// A model of this form that behaves like `system`; `None` when there is none.
    pub(super) fn start(self, system: &StateSpace) -> Option<StateSpace> {
        match self {
            Self::Innovation => Some(system.clone()),
            Self::Armax => Some(system.armax().ok()??.state_space(system.sample_time)),
        }
    }

    /// Derivative of the packed matrices with respect to the coordinates, one column a coordinate.
    pub(super) fn directions(
        self,
        system: &StateSpace,
        layout: &ParameterLayout,
    ) -> Result<DMatrix<f64>, LinalgError> {
        match self {
            Self::Innovation => local_coordinates(system, layout),
            Self::Armax => Ok(observer_form(system, layout)),
        }
    }

    /// The model that a step along the coordinates leads to, with a stable predictor: one outside the unit circle is
    /// exchanged for that of the same noise spectrum.
    pub(super) fn moved(
        self,
        system: &StateSpace,
        layout: &ParameterLayout,
        directions: &DMatrix<f64>,
        step: &[f64],
        innovation_covariance: &DMatrix<f64>,
    ) -> Option<StateSpace> {
        let moved = match self {
            Self::Innovation => {
                let change = directions * DMatrix::from_column_slice(step.len(), 1, step);
                let theta: Vec<f64> = layout
                    .pack(system)
                    .iter()
                    .zip(change.iter())
                    .map(|(value, change)| value + change)
                    .collect();
                layout.unpack(&theta, system)
            }
            Self::Armax => {
                let Polynomials {
                    mut a,
                    mut b,
                    mut c,
                } = polynomials(system);
                let n = layout.states;
                let direct = usize::from(layout.feedthrough);
                for i in 0..n {
                    a[i + 1] += step[i];
                    b[i + 1] += step[n + direct + i];
                    c[i + 1] += step[2 * n + direct + i];
                }
                if layout.feedthrough {
                    b[0] += step[n];
                }
                Armax { a, b, c }.state_space(system.sample_time)
            }
        };
        let finite = layout.pack(&moved).iter().all(|v| v.is_finite());
        finite.then(|| with_stable_predictor(&moved, innovation_covariance).unwrap_or(moved))
    }
}

struct Polynomials {
    a: Vec<f64>,
    b: Vec<f64>,
    c: Vec<f64>,
}

/// Reads the coefficients off an observer form: `A = [-a ..]`, `B = b - a b0`, `K = c - a`.
fn polynomials(system: &StateSpace) -> Polynomials {
    let n = system.states();
    let direct = system.d[(0, 0)];
    let mut out = Polynomials {
        a: vec![1.0],
        b: vec![direct],
        c: vec![1.0],
    };
    for i in 0..n {
        let a = -system.a[(i, 0)];
        out.a.push(a);
        out.b.push(system.b[(i, 0)] + a * direct);
        out.c.push(system.k[(i, 0)] + a);
    }
    out
}

#[cfg(feature = "cli")]
/// The polynomials of a system that is in observer form.
pub(super) fn armax_of_observer_form(system: &StateSpace) -> Armax {
    let Polynomials { a, b, c } = polynomials(system);
    Armax { a, b, c }
}

fn observer_form(system: &StateSpace, layout: &ParameterLayout) -> DMatrix<f64> {
    let n = layout.states;
    let direct = usize::from(layout.feedthrough);
    let mut out = DMatrix::zeros(layout.len(), 3 * n + direct);
    let b0 = system.d[(0, 0)];
    for i in 0..n {
        // a_i: A[i, 0] = -a_i, B = b - a b0, K = c - a.
        out[(i, i)] = -1.0;
        out[(layout.b() + i, i)] = -b0;
        out[(layout.k() + i, i)] = -1.0;
        out[(layout.b() + i, n + direct + i)] = 1.0;
        out[(layout.k() + i, 2 * n + direct + i)] = 1.0;
        if layout.feedthrough {
            out[(layout.b() + i, n)] = system.a[(i, 0)];
        }
    }
    if layout.feedthrough {
        out[(layout.d(), n)] = 1.0;
    }
    out
}

/// Orthonormal directions across those of a change of basis, `dA = S A - A S`, `dB = S B`, `dK = S K`, `dC = -C S`.
fn local_coordinates(
    system: &StateSpace,
    layout: &ParameterLayout,
) -> Result<DMatrix<f64>, LinalgError> {
    let n = layout.states;
    let length = layout.len();
    // Zero columns make the left vectors a complete basis.
    let mut orbit = DMatrix::zeros(length, length.max(n * n));
    for j in 0..n {
        for i in 0..n {
            let mut s = DMatrix::zeros(n, n);
            s[(i, j)] = 1.0;
            let change = StateSpace {
                a: &s * &system.a - &system.a * &s,
                b: &s * &system.b,
                c: -(&system.c * &s),
                d: DMatrix::zeros(layout.outputs, layout.inputs),
                k: &s * &system.k,
                sample_time: system.sample_time,
            };
            orbit
                .column_mut(i + n * j)
                .copy_from_slice(&layout.pack(&change));
        }
    }
    let svd = svd_thin(&orbit)?;
    Ok(svd.u.columns(n * n, length - n * n).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::systems;

    #[test]
    fn observer_form_directions_agree_with_finite_differences() {
        let start = systems::knudsen_bj().system.system;
        let layout = ParameterLayout::of(&start, true);
        let directions = Form::Armax.directions(&start, &layout).unwrap();
        assert_eq!(directions.ncols(), 13);
        let lambda = DMatrix::identity(1, 1);
        for p in 0..13 {
            let moved = |by: f64| {
                let mut step = vec![0.0; 13];
                step[p] = by;
                let made = Form::Armax.moved(&start, &layout, &directions, &step, &lambda);
                layout.pack(&made.unwrap())
            };
            for ((up, down), d) in moved(1e-5)
                .iter()
                .zip(moved(-1e-5))
                .zip(directions.column(p).iter())
            {
                assert!(((up - down) / 2e-5 - d).abs() < 1e-8, "{p}");
            }
        }
    }

    #[test]
    fn local_coordinates_leave_out_the_change_of_basis() {
        let system = systems::two_by_two().system;
        let layout = ParameterLayout::of(&system, false);
        let directions = Form::Innovation.directions(&system, &layout).unwrap();
        assert_eq!(directions.ncols(), layout.identifiable());
        // A small change of basis is across all of them.
        let mut t = DMatrix::identity(3, 3);
        t[(0, 2)] = 1e-6;
        let turned = layout.pack(&system.transformed(&t).unwrap());
        let theta = layout.pack(&system);
        let change = DMatrix::from_fn(theta.len(), 1, |i, _| (turned[i] - theta[i]) / 1e-6);
        assert!(change.amax() > 0.1);
        assert!((directions.transpose() * change).amax() < 1e-5);
    }
}
