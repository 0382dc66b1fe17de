//! How residuals move with the parameters of the model.
//!
//! With `dx = dx[k]/d theta` along a direction `(dA, dB, dK, dC, dD)` of the parameter space,
//!
//! `dx[k+1] = (A - K C) dx[k] + dA x[k] + dB u[k] + dK e[k] - K (dC x[k] + dD u[k])`,
//! `de[k]   = -C dx[k] - dC x[k] - dD u[k]`,
//!
//! the derivative of the predictor (Ljung, *System Identification*, 2nd ed., section 10.3). Directions that
//! only change the state basis give `de = 0`.

use nalgebra::DMatrix;

use crate::covariance::ParameterCovariance;
use crate::linalg::multiply;
use crate::model::StateSpace;
use crate::validate::RecordView;
use crate::validate::residuals::Start;

/// Samples handled at a time.
const BLOCK: usize = 512;

/// Consecutive samples of one record.
#[derive(Debug)]
pub(crate) struct Segment {
    /// `[u; e]` about their means, sample after sample.
    pub(crate) z: Vec<f64>,
    /// `de/d theta`, sample after sample, entry `output * directions + direction`.
    pub(crate) psi: Vec<f64>,
    pub(crate) samples: usize,
}

/// The sensitivity filters of all directions.
pub(crate) struct Filters {
    /// Rows `state * m + direction` then `n m + output * m + direction`, from `[x; u; e]`: the forcing of `dx`,
    /// and `dC x + dD u`.
    forcing: DMatrix<f64>,
    predictor: DMatrix<f64>,
    directions: usize,
}

impl Filters {
    pub(crate) fn new(
        system: &StateSpace,
        covariance: &ParameterCovariance,
        basis: &DMatrix<f64>,
    ) -> Self {
        let (n, r, l) = (system.states(), system.inputs(), system.outputs());
        let layout = covariance.layout;
        let m = basis.ncols();
        let mut forcing = DMatrix::zeros((n + l) * m, n + r + l);
        for c in 0..m {
            let theta = basis.column(c);
            for o in 0..l {
                let row = (n + o) * m + c;
                for j in 0..n {
                    forcing[(row, j)] = theta[layout.c() + o + l * j];
                }
                if layout.feedthrough {
                    for j in 0..r {
                        forcing[(row, n + j)] = theta[layout.d() + o + l * j];
                    }
                }
            }
            for i in 0..n {
                let row = i * m + c;
                for j in 0..n {
                    forcing[(row, j)] = theta[i + n * j];
                }
                for j in 0..r {
                    forcing[(row, n + j)] = theta[layout.b() + i + n * j];
                }
                for j in 0..l {
                    forcing[(row, n + r + j)] = theta[layout.k() + i + n * j];
                }
                for o in 0..l {
                    for j in 0..n + r {
                        forcing[(row, j)] -= system.k[(i, o)] * forcing[((n + o) * m + c, j)];
                    }
                }
            }
        }
        Self {
            forcing,
            predictor: system.predictor_matrix(),
            directions: m,
        }
    }

    /// Runs over the start-up and `samples` samples after it.
    pub(crate) fn run(
        &self,
        system: &StateSpace,
        record: &RecordView<'_>,
        start: &Start,
        samples: usize,
    ) -> Segment {
        let (n, r, l) = (system.states(), system.inputs(), system.outputs());
        let m = self.directions;
        let end = start.dropped + samples;
        let mut z = Vec::with_capacity(samples * (r + l));
        let mut psi = Vec::with_capacity(samples * l * m);
        let mut x = start.state.clone();
        let mut dx = vec![0.0; n * m];
        let mut next = vec![0.0; n * m];
        let mut from = 0;
        while from < end {
            let to = (from + BLOCK).min(end);
            let mut operand = DMatrix::zeros(n + r + l, to - from);
            for k in from..to {
                let mut column = operand.column_mut(k - from);
                column.rows_mut(0, n).copy_from(&x);
                for j in 0..r {
                    column[n + j] = record.inputs[j][k];
                }
                for o in 0..l {
                    let mut e = record.outputs[o][k];
                    for j in 0..n {
                        e -= system.c[(o, j)] * x[j];
                    }
                    for j in 0..r {
                        e -= system.d[(o, j)] * record.inputs[j][k];
                    }
                    column[n + r + o] = e;
                }
                let mut ahead = x.clone();
                for i in 0..n {
                    let mut sum = 0.0;
                    for j in 0..n {
                        sum += system.a[(i, j)] * x[j];
                    }
                    for j in 0..r {
                        sum += system.b[(i, j)] * column[n + j];
                    }
                    for o in 0..l {
                        sum += system.k[(i, o)] * column[n + r + o];
                    }
                    ahead[i] = sum;
                }
                x = ahead;
            }
            let forced = multiply(&self.forcing, &operand);
            for k in from..to {
                let force = forced.column(k - from);
                let force = force.as_slice();
                if k >= start.dropped {
                    let values = operand.column(k - from);
                    z.extend((0..r + l).map(|i| values[n + i] - start.means[i]));
                    for o in 0..l {
                        let at = psi.len();
                        psi.extend(force[(n + o) * m..(n + o + 1) * m].iter().map(|v| -v));
                        for j in 0..n {
                            let c = system.c[(o, j)];
                            for (p, d) in psi[at..].iter_mut().zip(&dx[j * m..(j + 1) * m]) {
                                *p -= c * d;
                            }
                        }
                    }
                }
                next.copy_from_slice(&force[..n * m]);
                for i in 0..n {
                    for j in 0..n {
                        let a = self.predictor[(i, j)];
                        let row = &mut next[i * m..(i + 1) * m];
                        for (v, d) in row.iter_mut().zip(&dx[j * m..(j + 1) * m]) {
                            *v += a * d;
                        }
                    }
                }
                std::mem::swap(&mut dx, &mut next);
            }
            from = to;
        }
        Segment { z, psi, samples }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::covariance::ParameterLayout;
    use crate::systems::van_wingerden_one;

    /// Filters against a difference quotient of the predictor itself.
    #[test]
    fn filters_are_the_derivative_of_the_innovations() {
        let test = van_wingerden_one();
        let mut system = test.system.clone();
        system.d = DMatrix::from_row_slice(2, 2, &[0.3, -0.2, 0.1, 0.4]);
        let log = test.record(80, 3);
        let (u, y): (Vec<&[f64]>, Vec<&[f64]>) = (
            log.input_data.iter().map(Vec::as_slice).collect(),
            log.output_data.iter().map(Vec::as_slice).collect(),
        );
        let layout = ParameterLayout {
            states: 4,
            inputs: 2,
            outputs: 2,
            feedthrough: true,
        };
        let covariance = ParameterCovariance {
            layout,
            matrix: DMatrix::identity(layout.len(), layout.len()),
            degrees_of_freedom: None,
        };
        let basis = DMatrix::identity(layout.len(), layout.len());
        let start = Start {
            state: nalgebra::DVector::zeros(4),
            dropped: 5,
            means: vec![0.0; 4],
        };
        let record = RecordView {
            inputs: &u,
            outputs: &y,
        };
        let segment = Filters::new(&system, &covariance, &basis).run(&system, &record, &start, 75);
        let theta = layout.pack(&system);
        let m = layout.len();
        for parameter in 0..m {
            let moved = |step: f64| {
                let mut theta = theta.clone();
                theta[parameter] += step;
                let system = layout.unpack(&theta, &system);
                system.one_step(&u, &y, None).unwrap().innovations
            };
            let (up, down) = (moved(1e-5), moved(-1e-5));
            for k in [0, 20, 74] {
                for o in 0..2 {
                    let quotient = (up[o][k + 5] - down[o][k + 5]) / 2e-5;
                    let found = segment.psi[(k * 2 + o) * m + parameter];
                    assert!(
                        (quotient - found).abs() < 1e-5 * (1.0 + quotient.abs()),
                        "parameter {parameter}, sample {k}: {quotient} {found}"
                    );
                }
            }
        }
        let innovations = system.one_step(&u, &y, None).unwrap().innovations;
        assert!((segment.z[4 * 10 + 3] - innovations[1][15]).abs() < 1e-12);
    }
}
