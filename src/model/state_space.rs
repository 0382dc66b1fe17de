//! The innovation form.

use std::fmt;

use nalgebra::DMatrix;

use super::model_error::ModelError;
use crate::log::is_sample_time;

/// Linear time-invariant system in innovation form,
///
/// `x[k+1] = A x[k] + B u[k] + K e[k]`, `y[k] = C x[k] + D u[k] + e[k]`,
///
/// with `u` in `R^r`, `y` and the innovation `e` in `R^l`, `x` in `R^n`; `n = 0` is a static gain.
#[derive(Debug, Clone, PartialEq)]
pub struct StateSpace {
    /// State matrix, `n x n`.
    pub a: DMatrix<f64>,
    /// Input matrix, `n x r`.
    pub b: DMatrix<f64>,
    /// Output matrix, `l x n`.
    pub c: DMatrix<f64>,
    /// Feedthrough, `l x r`.
    pub d: DMatrix<f64>,
    /// Observer (Kalman) gain, `n x l`.
    pub k: DMatrix<f64>,
    /// Sample time in seconds.
    pub sample_time: f64,
}

impl StateSpace {
    /// A system from its matrices: `a` is `n x n`, `b` is `n x r`, `c` is `l x n`, `d` is `l x r`,
    /// `k` is `n x l`, `sample_time` in seconds.
    ///
    /// # Errors
    /// [`ModelError::Shape`], [`ModelError::NoOutput`], [`ModelError::NotFinite`] or
    /// [`ModelError::SampleTime`].
    pub fn new(
        a: DMatrix<f64>,
        b: DMatrix<f64>,
        c: DMatrix<f64>,
        d: DMatrix<f64>,
        k: DMatrix<f64>,
        sample_time: f64,
    ) -> Result<Self, ModelError> {
        let (n, r, l) = (a.nrows(), b.ncols(), c.nrows());
        if l == 0 {
            return Err(ModelError::NoOutput);
        }
        check_shape("A", &a, n, n, "A must be square")?;
        check_shape("B", &b, n, r, "it needs as many rows as A")?;
        check_shape("C", &c, l, n, "it needs as many columns as A")?;
        check_shape("D", &d, l, r, "it needs the rows of C and the columns of B")?;
        check_shape(
            "K",
            &k,
            n,
            l,
            "it needs the rows of A and a column per output",
        )?;
        for (name, matrix) in [("A", &a), ("B", &b), ("C", &c), ("D", &d), ("K", &k)] {
            check_finite(name, matrix)?;
        }
        if !is_sample_time(sample_time) {
            return Err(ModelError::SampleTime { value: sample_time });
        }
        Ok(Self {
            a,
            b,
            c,
            d,
            k,
            sample_time,
        })
    }

    /// A system without noise model: `K = 0`, so that prediction is simulation.
    ///
    /// # Errors
    /// As [`StateSpace::new`].
    pub fn deterministic(
        a: DMatrix<f64>,
        b: DMatrix<f64>,
        c: DMatrix<f64>,
        d: DMatrix<f64>,
        sample_time: f64,
    ) -> Result<Self, ModelError> {
        let k = DMatrix::zeros(a.nrows(), c.nrows());
        Self::new(a, b, c, d, k, sample_time)
    }

    /// Number of states `n`.
    pub fn states(&self) -> usize {
        self.a.nrows()
    }

    /// Number of inputs `r`.
    pub fn inputs(&self) -> usize {
        self.b.ncols()
    }

    /// Number of outputs `l`.
    pub fn outputs(&self) -> usize {
        self.c.nrows()
    }

    /// State matrix of the one-step predictor, `A - K C` (`n x n`).
    pub fn predictor_matrix(&self) -> DMatrix<f64> {
        &self.a - &self.k * &self.c
    }

    /// The same system in the state basis `T x` (`t` is `n x n`): `(T A T^-1, T B, C T^-1, D, T K)`.
    ///
    /// # Errors
    /// [`ModelError::Transformation`] when `t` is not square of order `n` or has no inverse.
    pub fn transformed(&self, t: &DMatrix<f64>) -> Result<Self, ModelError> {
        let failure = ModelError::Transformation {
            rows: t.nrows(),
            columns: t.ncols(),
        };
        if t.shape() != self.a.shape() {
            return Err(failure);
        }
        if self.states() == 0 {
            return Ok(self.clone());
        }
        let inverse = t.clone().try_inverse().ok_or(failure)?;
        Ok(Self {
            a: t * &self.a * &inverse,
            b: t * &self.b,
            c: &self.c * inverse,
            d: self.d.clone(),
            k: t * &self.k,
            sample_time: self.sample_time,
        })
    }
}

fn check_shape(
    matrix: &'static str,
    given: &DMatrix<f64>,
    expected_rows: usize,
    expected_columns: usize,
    reason: &'static str,
) -> Result<(), ModelError> {
    let (rows, columns) = given.shape();
    if (rows, columns) == (expected_rows, expected_columns) {
        return Ok(());
    }
    Err(ModelError::Shape {
        matrix,
        rows,
        columns,
        expected_rows,
        expected_columns,
        reason,
    })
}

fn check_finite(name: &'static str, matrix: &DMatrix<f64>) -> Result<(), ModelError> {
    for column in 0..matrix.ncols() {
        for row in 0..matrix.nrows() {
            let value = matrix[(row, column)];
            if !value.is_finite() {
                return Err(ModelError::NotFinite {
                    matrix: name,
                    row: row + 1,
                    column: column + 1,
                    value,
                });
            }
        }
    }
    Ok(())
}

impl fmt::Display for StateSpace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (n, r, l) = (self.states(), self.inputs(), self.outputs());
        writeln!(
            f,
            "state-space model: order {n}, {r} input{}, {l} output{}, sample time {} s",
            if r == 1 { "" } else { "s" },
            if l == 1 { "" } else { "s" },
            self.sample_time
        )?;
        for (name, matrix) in [
            ("A", &self.a),
            ("B", &self.b),
            ("C", &self.c),
            ("D", &self.d),
            ("K", &self.k),
        ] {
            if matrix.is_empty() {
                continue;
            }
            for (i, row) in matrix.row_iter().enumerate() {
                write!(f, "{}", if i == 0 { name } else { " " })?;
                write!(f, " {}", if i == 0 { "=" } else { " " })?;
                for value in row.iter() {
                    write!(f, " {value:>12.5e}")?;
                }
                writeln!(f)?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    fn system() -> StateSpace {
        StateSpace::new(
            dmatrix![0.8, 0.2; -0.1, 0.6],
            dmatrix![1.0; 0.5],
            dmatrix![1.0, 0.0],
            dmatrix![0.0],
            dmatrix![0.3; 0.1],
            0.1,
        )
        .unwrap()
    }

    #[test]
    fn wrong_shapes_are_named_with_their_sizes() {
        let s = system();
        let error = StateSpace::new(
            s.a.clone(),
            dmatrix![1.0, 2.0, 3.0],
            s.c.clone(),
            s.d.clone(),
            s.k.clone(),
            0.1,
        )
        .unwrap_err();
        assert_eq!(
            error.to_string(),
            "B is 1 x 3, but must be 2 x 3: it needs as many rows as A"
        );
        let gain = StateSpace::new(s.a, s.b, s.c, s.d, dmatrix![1.0, 2.0], 0.1).unwrap_err();
        assert!(
            gain.to_string()
                .starts_with("K is 1 x 2, but must be 2 x 1")
        );
    }

    #[test]
    fn values_that_are_no_numbers_are_refused() {
        let s = system();
        let mut a = s.a.clone();
        a[(1, 0)] = f64::NAN;
        let error =
            StateSpace::deterministic(a, s.b.clone(), s.c.clone(), s.d.clone(), 0.1).unwrap_err();
        assert!(error.to_string().starts_with("A[2, 1] is NaN"));
        for time in [0.0, -1.0, 1e-300, 1e300, f64::INFINITY, f64::NAN] {
            let made =
                StateSpace::deterministic(s.a.clone(), s.b.clone(), s.c.clone(), s.d.clone(), time);
            assert!(matches!(made, Err(ModelError::SampleTime { .. })));
        }
    }

    #[test]
    fn change_of_basis_keeps_the_markov_parameters() {
        let s = system();
        let t = s.transformed(&dmatrix![2.0, 1.0; -0.5, 3.0]).unwrap();
        approx::assert_relative_eq!(
            &t.c * &t.a * &t.a * &t.b,
            &s.c * &s.a * &s.a * &s.b,
            epsilon = 1e-13
        );
        approx::assert_relative_eq!(&t.c * &t.k, &s.c * &s.k, epsilon = 1e-13);
        assert!(s.transformed(&dmatrix![1.0, 2.0; 2.0, 4.0]).is_err());
        assert!(s.transformed(&dmatrix![1.0]).is_err());
    }

    #[test]
    fn display_shows_every_matrix() {
        let text = system().to_string();
        assert!(
            text.starts_with("state-space model: order 2, 1 input, 1 output, sample time 0.1 s")
        );
        assert_eq!(text.lines().count(), 1 + 2 + 2 + 1 + 1 + 2);
    }
}
